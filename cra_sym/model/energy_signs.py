"""Energies that must be sums of squares: values that would make them negative are refused by name, on every route."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from cra_sym.model.projection import BilinearForm, Displacement, Domain
from cra_sym.solvers.waves_static import are_semidefinite, coupled

if TYPE_CHECKING:
    from cra_sym.mechanics.weak import Bilinear
    from cra_sym.model.lagrangian import Model

__all__ = ["EnergyForm", "leading", "masses", "refuse_negative"]

Values = Mapping[str, float | NDArray[np.float64]]
_SHARES = (np.arange(64) + 0.5) / 64  # stations, as shares of the length, at which coefficients that vary are checked
_WHERE = {"left": "the left end", "right": "the right end", "lumped": "the lumped coordinates"}


class EnergyForm(NamedTuple):
    """An energy of a model.

    Attributes
    ----------
    kind : str
        'kinetic' or 'strain'.
    form : BilinearForm
    names : tuple of (tuple of str)
        Parameters in the coefficients inside, and in the others, in the order of the model's symbols.
    definite : bool
        Whether it is a sum of squares with these as factors, negative only where one of them is.
    """

    kind: str
    form: BilinearForm
    names: tuple[tuple[str, ...], tuple[str, ...]]
    definite: bool


def masses(model: Model) -> EnergyForm:
    """Return the kinetic energy of a model."""
    from cra_sym.mechanics.weak import weak_form

    _ = model.numerics("spatial" if model.numerics("conservative") else "damped_spatial")  # refuses unused fields
    weak = weak_form(model.linearised.variation)
    return _energy(model, "kinetic", model.numerics("inertia"), (weak.inside, weak.discrete), 2)


def leading(model: Model) -> EnergyForm:
    """Return the strain energy of the highest derivatives of the fields of a model."""
    from cra_sym.mechanics.weak import weak_form
    from cra_sym.model.forms import form_of

    weak = weak_form(model.linearised.variation)
    _, highest, _ = weak.fields()
    inside = {pair: {0: e[0]} for pair, e in weak.inside.items() if 0 in e and set(pair) <= set(highest)}
    none: Bilinear = {}
    return _energy(model, "strain", form_of(weak, {"stiffness": (inside, none)}, model.symbols), (inside, none), 0)


def _energy(model: Model, kind: str, form: BilinearForm, parts: Sequence[Bilinear], power: int) -> EnergyForm:
    from sympy import Dummy

    known = {symbol: Dummy(symbol.name, nonnegative=True) for symbol in model.symbols}
    definite, names = True, []
    for part in parts:
        found = [(pair, e[power]) for pair, e in part.items() if power in e]
        definite &= all(p == q and value.xreplace(known).is_nonnegative for (p, q), value in found)
        symbols = set().union(*(value.free_symbols for _, value in found))
        names.append(tuple(symbol.name for symbol in model.symbols if symbol in symbols))
    return EnergyForm(kind, form, (names[0], names[1]), bool(definite))


def refuse_negative(energy: EnergyForm, domain: Domain, shape: tuple[int, ...], values: Values) -> None:
    """Raise if a motion of the ends, or of a section, has negative energy.

    Parameters
    ----------
    energy : EnergyForm
    domain : Domain
    shape : tuple of int
        Shape of the batch.
    values : mapping
        Values of all parameters.

    Raises
    ------
    ValueError
        Names the parameter that is negative, or all of them if none is.
    """
    kind, form, names, definite = energy
    if definite and all(np.min(values[name]) >= 0.0 for name in {*names[0], *names[1]}):
        return
    numbers = [np.asarray(value)[..., None] for value in domain.values]
    shares = _SHARES[:1] if form.uniform else _SHARES
    x = np.asarray(domain.left)[..., None] + np.multiply.outer(domain.length, shares)
    with np.errstate(all="ignore"):
        parts = (form.inside, form.density.function(x, *numbers)), (form.ends, form.points.function(*numbers))
    for (pairs, coefficients), own in zip(parts, names, strict=True):
        places = list(dict.fromkeys(place for pair in pairs for place in pair))
        pattern = np.zeros((len(places), len(places)), dtype=bool)
        matrix = np.zeros((*shape, len(shares) if pairs is form.inside else 1, *pattern.shape))
        for (p, q), value in zip(pairs, coefficients, strict=True):
            entry = places.index(p), places.index(q)
            pattern[entry], matrix[(..., *entry)] = True, value
        matrix = np.where(np.isfinite(matrix), matrix, 0.0)
        for group in coupled(pattern | pattern.T):
            part = matrix[..., group, :][..., group]
            right = are_semidefinite(part.reshape(-1, len(group), len(group))).reshape(part.shape[:-2])
            if not right.all():
                *row, station = np.unravel_index(int(np.argmin(right)), right.shape)
                at = np.broadcast_to(x, (*shape, len(shares)))[(*row, station)] if len(shares) > 1 else None
                given = {name: float(np.broadcast_to(values[name], shape)[*row]) for name in own}
                raise ValueError(_refusal(kind, places[group[0]], at, given))


def _refusal(kind: str, place: Displacement, at: float | None, given: Mapping[str, float]) -> str:
    """Return the message: the parameters that are negative, or all of them, and where the energy is negative."""
    told = ", ".join(f"{name} = {value:g}" for name, value in given.items() if value < 0.0)
    told = told or ", ".join(f"{name} = {value:g}" for name, value in given.items()) or "values"
    where = _WHERE.get(place.where, "an interior place")
    if place.where == "inside":
        where = "a section" if at is None else f"the section at x = {at:.6g}"
    return f"{told}: the {kind} energy of {where} is negative; it must be at least 0"
