"""Loads and bilinear forms of a weak form, compiled to numbers."""

from __future__ import annotations

from collections.abc import Iterable, Mapping

from sympy import Expr, S, Symbol, cancel

from cra_sym.kernels import Kernel, kernel
from cra_sym.mechanics.breakpoints import switches
from cra_sym.mechanics.jets import END_NAMES, Jet
from cra_sym.mechanics.weak import Bilinear, WeakForm
from cra_sym.model.breaks import breaks
from cra_sym.model.cuts import Cuts
from cra_sym.model.projection import BilinearForm, Displacement, Load

__all__ = ["form_of", "load_of"]

Symbols = tuple[Symbol, ...]


def load_of(weak: WeakForm, inside: Mapping[Jet, Expr], ends: Mapping[Jet, Expr], symbols: Symbols) -> Load:
    """Return a load given by its coefficients on displacements."""
    x = weak.variation.space.x
    share = rest = None
    others: dict[Jet, Expr] = {}
    factor = _translation_share(weak, inside)
    if factor is not None:
        translations = [Jet(0, 0, 0, end) for end in END_NAMES]
        masses = {jet: weak.ends.get((jet, jet), {}).get(2, S.Zero) for jet in translations}
        others = dict(ends) | {jet: cancel(ends.get(jet, S.Zero) - factor * mass) for jet, mass in masses.items()}
        others = {jet: value for jet, value in others.items() if value != 0}
        share = kernel(factor, symbols, backend="numpy")
        rest = kernel(tuple(others.values()), symbols, backend="numpy")
    return Load(
        tuple(_place(weak, jet) for jet in inside),
        tuple(_place(weak, jet) for jet in ends),
        kernel(tuple(inside.values()), (x, *symbols), backend="numpy"),
        kernel(tuple(ends.values()), symbols, backend="numpy"),
        not any(value.has(x) for value in inside.values()),
        share,
        rest,
        tuple(_place(weak, jet) for jet in others),
        places=_places(weak, symbols),
        cuts=_cuts(weak, inside.values(), symbols),
    )


def _translation_share(weak: WeakForm, inside: Mapping[Jet, Expr]) -> Expr | None:
    """Return the load's share of a rigid translation of the first field, if its mass is one uniform density."""
    field = Jet(0, 0, 0, None)
    masses = {pair: entry[2] for pair, entry in weak.inside.items() if 2 in entry}
    if set(masses) != {(field, field)} or set(inside) != {field} or len(weak.variation.orders) != 1:
        return None
    factor = cancel(inside[field] / masses[field, field])
    return None if factor.has(weak.variation.space.x) else factor


def form_of(weak: WeakForm, named: Mapping[str, tuple[Bilinear, Bilinear]], symbols: Symbols) -> BilinearForm:
    """Return bilinear forms with common entries, each given by its parts inside and at the ends."""
    x = weak.variation.space.x
    pairs = [tuple(dict.fromkeys(pair for forms in named.values() for pair in forms[part])) for part in (0, 1)]
    values = [
        tuple(sum(forms[part].get(pair, {}).values(), S.Zero) for forms in named.values() for pair in pairs[part])
        for part in (0, 1)
    ]
    inside, ends = (tuple((_place(weak, p), _place(weak, q)) for p, q in part) for part in pairs)
    return BilinearForm(
        tuple(named),
        inside,
        ends,
        kernel(values[0], (x, *symbols), backend="numpy"),
        kernel(values[1], symbols, backend="numpy"),
        not any(value.has(x) for value in values[0]),
        places=_places(weak, symbols),
        cuts=_cuts(weak, values[0], symbols),
    )


def _cuts(weak: WeakForm, densities: Iterable[Expr], symbols: Symbols) -> Cuts | None:
    """Return where densities are not smooth along the domain, or None."""
    x = weak.variation.space.x
    entries = [(power, value) for entry in weak.inside.values() for power, value in entry.items() if value.has(x)]
    given, own = [value for value in densities if value.has(x)], [value for power, value in entries if power != 1]
    found = {*switches(given, x)}
    if not found:
        return None
    every = [*given, *(value for _, value in entries)]
    places = tuple(point.place for point in weak.points)
    return Cuts(breaks(every, x, symbols, places), bool(found - {*switches(own, x)}))


def _places(weak: WeakForm, symbols: Symbols) -> Kernel | None:
    """Return the interior places as functions of the parameters, if there are any."""
    places = tuple(point.place for point in weak.points)
    return kernel(places, symbols, backend="numpy") if places else None


def _place(weak: WeakForm, jet: Jet) -> Displacement:
    section, _, lumped = weak.fields()
    if not weak.variation.space.is_field(jet.unknown):
        return Displacement("lumped", [coordinate.unknown for coordinate in lumped].index(jet.unknown), 0)
    if jet.place is None:
        return Displacement("inside", section.index(jet._replace(space=0)), jet.space)
    if isinstance(jet.place, int):
        return Displacement("point", section.index(jet._replace(place=None, space=0)), jet.space, jet.place)
    return Displacement(jet.place, section.index(jet._replace(place=None)), 0)
