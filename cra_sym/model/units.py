"""Dimensions of a Lagrangian, checked term by term where the nomenclature or the user declares units."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

from sympy import Add, Expr, Float, Symbol, expand, sympify
from sympy.core.function import AppliedUndef

from cra_sym import symbols as table
from cra_sym.checks import mapping, shown
from cra_sym.symbols import Dimension

__all__ = ["check_dimensions", "named_units", "symbol_units"]

ENERGY = Dimension(2, 1, -2)
ENERGY_PER_LENGTH = Dimension(1, 1, -2)


def check_dimensions(
    density: Expr,
    ends: Mapping[str, Expr],
    units: Mapping[Any, str],
    virtual_work: Iterable[tuple[Expr, Expr, Any]] = (),
    unknowns: Iterable[Any] = (),
) -> None:
    """Refuse a term whose dimension is not energy (per length in the density).

    Parameters
    ----------
    density : Expr
    ends : mapping of label to Expr
    units : mapping of symbol, function or name to unit
        For symbols that are not those of ``cra_sym.symbols``. Terms with a symbol of unknown unit are not judged.
    virtual_work : iterable of (force, displacement, place)
        The force times the displacement is judged, per length where the place is 'domain'.
    unknowns : iterable of symbol or function
        Coordinates, fields and motions. A term of these and numbers alone is not checked, nor one with a floating-point
        number: a number may carry any unit.

    Raises
    ------
    ValueError
        Names the term, its dimension and the dimension it should have.
    """
    bare = set(unknowns)
    declared = {_name(key): table.unit_dimension(unit) for key, unit in units.items()}
    for label, expression, wanted in (
        ("density", density, ENERGY_PER_LENGTH),
        *((label, end, ENERGY) for label, end in ends.items()),
        *(
            (
                f"virtual work on {displacement}",
                force * displacement,
                ENERGY_PER_LENGTH if place == "domain" else ENERGY,
            )
            for force, displacement, place in virtual_work
        ),
    ):
        for term in Add.make_args(expand(expression, deep=False)):
            if term.has(Float) or not {*term.atoms(AppliedUndef), *term.free_symbols} - bare:
                continue
            found = _dimension(term, declared)
            if found not in (None, wanted):
                raise ValueError(
                    f"{label}, term {term}: its dimension is {_unit_text(found)}, "
                    f"that of {'an energy' if wanted == ENERGY else 'an energy per length'} is {_unit_text(wanted)}"
                )


def named_units(units: Mapping[Any, str] | None, expressions: Iterable[Any]) -> Mapping[Any, str]:
    """Return the units, or raise an error if one is given for something that does not occur in the expressions."""
    units = mapping("units", units, "symbols to units")
    given = [sympify(expression, strict=True) for expression in expressions]
    known = {_name(atom) for e in given for atom in (*e.atoms(AppliedUndef), *e.free_symbols)}
    for key in units:
        if _name(key) not in known:
            names = ", ".join(sorted(known))
            raise ValueError(f"units: {shown(_name(key))} does not occur in the model; it has {names}")
    return units


def symbol_units(symbols: Iterable[Symbol], units: Mapping[Any, str]) -> dict[str, str]:
    """Return the unit of each symbol that is one of the nomenclature or was given one, by name."""
    declared = {_name(key): unit for key, unit in units.items()}
    known = {s.name: table.row(s.name).unit for s in symbols if _is_table_symbol(s, s.name)}
    return {s.name: (known | declared)[s.name] for s in symbols if s.name in known or s.name in declared}


def _name(key: Any) -> str:
    return key.func.__name__ if isinstance(key, AppliedUndef) else getattr(key, "name", str(key))


def _dimension(term: Expr, declared: Mapping[str, Dimension]) -> Dimension | None:
    """Return the dimension of a term, or None if a symbol in it has no declared unit."""
    given: dict[Any, Dimension] = {}
    for atom in (*term.atoms(AppliedUndef), *term.free_symbols):
        name = _name(atom)
        if name in declared:
            given[atom] = declared[name]
        elif not _is_table_symbol(atom, name):
            return None
    return None if term == 0 else table.dimension(term, given)


def _is_table_symbol(atom: Any, name: str) -> bool:
    """Tell whether the atom is the symbol of the nomenclature itself, not just another one of the same name."""
    try:
        entry = table.symbol(name)
    except KeyError:
        return False
    if isinstance(atom, AppliedUndef):
        return isinstance(entry, AppliedUndef) and atom.func == entry.func and len(atom.args) == len(entry.args)
    return bool(atom == entry)


def _unit_text(dimension: Dimension | None) -> str:
    assert dimension is not None
    return " ".join(f"{unit}^{power}" for unit, power in zip(("m", "kg", "s"), dimension, strict=True) if power) or "1"
