"""Dimensions of a Lagrangian, checked term by term where the nomenclature or the user declares units."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

from sympy import Add, Expr, expand
from sympy.core.function import AppliedUndef

from cra_sym import symbols as table
from cra_sym.symbols import Dimension

__all__ = ["check_dimensions"]

ENERGY = Dimension(2, 1, -2)
ENERGY_PER_LENGTH = Dimension(1, 1, -2)


def check_dimensions(
    density: Expr,
    ends: Mapping[str, Expr],
    units: Mapping[Any, str],
    virtual_work: Iterable[tuple[Expr, Expr, Any]] = (),
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

    Raises
    ------
    ValueError
        Names the term, its dimension and the dimension it should have.
    """
    if not isinstance(units, Mapping):
        raise TypeError(f"units = {units!r}: allowed is a mapping from symbols to units")
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
            found = _dimension(term, declared)
            if found not in (None, wanted):
                raise ValueError(
                    f"{label}, term {term}: its dimension is {_written(found)}, "
                    f"that of {'an energy' if wanted == ENERGY else 'an energy per length'} is {_written(wanted)}"
                )


def _name(key: Any) -> str:
    return key if isinstance(key, str) else key.func.__name__ if isinstance(key, AppliedUndef) else key.name


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
    """Tell whether the atom is the very symbol of the nomenclature: the same letter alone proves nothing."""
    try:
        entry = table.symbol(name)
    except KeyError:
        return False
    if isinstance(atom, AppliedUndef):
        return isinstance(entry, AppliedUndef) and atom.func == entry.func and len(atom.args) == len(entry.args)
    return atom == entry


def _written(dimension: Dimension | None) -> str:
    assert dimension is not None
    return " ".join(f"{unit}^{power}" for unit, power in zip(("m", "kg", "s"), dimension, strict=True) if power) or "1"
