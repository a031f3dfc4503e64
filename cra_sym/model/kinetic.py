"""Check that the kinetic energy is not negative, and name the parameter that makes it so; common to all routes."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from cra_sym.model.projection import Domain, Form, Place
from cra_sym.solvers.waves_static import are_semidefinite

if TYPE_CHECKING:
    from cra_sym.model.lagrangian import Model

__all__ = ["Masses", "masses", "refuse_negative_mass"]

Values = Mapping[str, float | NDArray[np.float64]]
_SHARES = (np.arange(64) + 0.5) / 64  # stations, as shares of the length, at which masses that vary along x are checked
_WHERE = {"left": "the left end", "right": "the right end", "lumped": "the lumped coordinates"}


class Masses(NamedTuple):
    """The kinetic energy of a model.

    Attributes
    ----------
    form : Form
        The masses.
    names : tuple of (tuple of str)
        Parameters in those inside, and in the others, in the order of the model's symbols.
    definite : bool
        Whether it is a sum of squares with these as factors, negative only where one of them is.
    """

    form: Form
    names: tuple[tuple[str, ...], tuple[str, ...]]
    definite: bool


def masses(model: Model) -> Masses:
    """Return the kinetic energy of a model."""
    from sympy import Dummy

    from cra_sym.mechanics.weak import weak_form

    _ = model.numerics("spatial" if model.numerics("conservative") else "damped_spatial")  # refuses unused fields
    weak = weak_form(model.linearised.variation)
    known = {symbol: Dummy(symbol.name, nonnegative=True) for symbol in model.symbols}
    definite, names = True, []
    for form in (weak.inside, weak.discrete):
        found = [(pair, e[2]) for pair, e in form.items() if 2 in e]
        definite &= all(p == q and mass.xreplace(known).is_nonnegative for (p, q), mass in found)
        symbols = set().union(*(mass.free_symbols for _, mass in found))
        names.append(tuple(symbol.name for symbol in model.symbols if symbol in symbols))
    return Masses(model.numerics("inertia"), (names[0], names[1]), bool(definite))


def refuse_negative_mass(masses: Masses, domain: Domain, shape: tuple[int, ...], values: Values) -> None:
    """Raise if a motion of the ends, or of a section, has negative kinetic energy.

    Parameters
    ----------
    masses : Masses
    domain : Domain
    shape : tuple of int
        Of the batch.
    values : mapping
        Of all parameters.

    Raises
    ------
    ValueError
        Names the parameter that is negative, or all of them if none is.
    """
    form, names, definite = masses
    if definite and all(np.min(values[name]) >= 0.0 for name in {*names[0], *names[1]}):
        return
    numbers = [np.asarray(value)[..., None] for value in domain.values]
    shares = _SHARES[:1] if form.uniform else _SHARES
    x = np.asarray(domain.left)[..., None] + np.multiply.outer(domain.length, shares)
    with np.errstate(all="ignore"):
        parts = (form.inside, form.density.function(x, *numbers)), (form.ends, form.points.function(*numbers))
    for (pairs, coefficients), own in zip(parts, names, strict=True):
        for group in _groups(pairs):
            matrix = np.zeros((*shape, len(shares) if pairs is form.inside else 1, len(group), len(group)))
            for (p, q), value in zip(pairs, coefficients, strict=True):
                if p in group:
                    matrix[..., group.index(p), group.index(q)] = value
            flat = matrix.reshape(-1, len(group), len(group))
            right = are_semidefinite(np.where(np.isfinite(flat), flat, 0.0)).reshape(matrix.shape[:-2])
            if not right.all():
                *row, station = np.unravel_index(int(np.argmin(right)), right.shape)
                at = np.broadcast_to(x, (*shape, len(shares)))[(*row, station)] if len(shares) > 1 else None
                raise ValueError(_refusal(group[0], at, {n: np.broadcast_to(values[n], shape)[*row] for n in own}))


def _groups(pairs: Sequence[tuple[Place, Place]]) -> list[list[Place]]:
    """Return the places that masses couple, group by group."""
    groups: list[list[Place]] = []
    for pair in pairs:
        joined = [group for group in groups if set(pair) & set(group)]
        groups = [group for group in groups if group not in joined]
        groups.append(list(dict.fromkeys([place for group in joined for place in group] + list(pair))))
    return groups


def _refusal(place: Place, at: float | None, given: Mapping[str, float]) -> str:
    named = ", ".join(f"{name} = {value:g}" for name, value in given.items() if value < 0.0)
    named = named or ", ".join(f"{name} = {value:g}" for name, value in given.items()) or "values"
    where = _WHERE.get(place.where, "an interior place")
    if place.where == "inside":
        where = "a section" if at is None else f"the section at x = {at:.6g}"
    return f"{named}: the kinetic energy of {where} is negative; it must be at least 0"
