"""Derivatives of complex eigenvalues and modes by a parameter: differences of eighth order, their step adapted."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress

import numpy as np
from numpy.typing import NDArray

from cra_sym.analysis.differences import offsets_at, own_stiffness, room_of, weights_at
from cra_sym.analysis.eigenvalues import eigenvalues
from cra_sym.model.system import System

__all__ = ["eigenvalue_rates", "gaps", "mode_rates", "with_next"]

Array = NDArray[np.float64]
Complex = NDArray[np.complex128]
_STEP = 0.02  # step of the differences, over the change at which an eigenvalue may meet another one
_FIRST, _TURNS = 1e-6, 4  # first step, over the value of the parameter, and the number of changes of it
_SHORTER = np.array([1.0, 0.25, 0.0625])  # steps that are compared, over the longest
_AGREE = 1e-6  # relative difference of two steps beyond which there is no derivative
_NOISE, _ROUGH = 1e-12, 1e-8  # relative errors of an eigenvalue and, at most, of a mode
_SAME = 1e-9  # relative distance below which eigenvalues are repeated
Quantity = Callable[[System, Complex], Complex]


def with_next(system: System, modes: int) -> Complex:
    """Return the first eigenvalues of motions that oscillate, and the next one if there is one."""
    with suppress(ValueError):
        return eigenvalues(system, modes + 1)
    return eigenvalues(system, modes)


def eigenvalue_rates(system: System, name: str, s: Complex, *, compliance: bool = False) -> Complex:
    """Return the derivatives of eigenvalues by a parameter, or by one over it, shape (..., modes).

    The relative error is about 1e-11, or that of the eigenvalues over the step; otherwise as :func:`mode_rates`.
    """
    return mode_rates(system, name, s, lambda _, moved: moved, compliance=compliance, noise=_NOISE)


def mode_rates(
    system: System, name: str, s: Complex, quantity: Quantity, *, compliance: bool = False, noise: float = _ROUGH
) -> Complex:
    """Return the derivatives of a quantity of complex modes by a parameter, or by one over it, shape (..., modes, ...).

    Of three steps, the one that agrees best with a longer one counts.

    Parameters
    ----------
    system : System
    name : str
    s : ndarray of complex, shape (..., modes)
        Its first eigenvalues.
    quantity : callable
        ``quantity(system, s)`` returns the quantity of a batch with some of its eigenvalues, shape (..., modes, ...).
    compliance : bool
        Whether the derivative is by one over the parameter, which then must be the stiffness of an end.
    noise : float
        Relative error of the quantity.

    Returns
    -------
    ndarray of complex, shape (..., modes, ...)
        By an infinite value 0. It is nan where an eigenvalue is repeated or coalesces with another, since these may
        split like a root of the change.
    """
    given = np.broadcast_to(system.values[name], system.shape)

    def rates(place: Array, *, compliance: bool) -> Complex:
        return _rates(system, name, s, place, quantity, noise, compliance=compliance)

    with np.errstate(divide="ignore"):
        if compliance:
            return rates(1.0 / given, compliance=True)
        if name not in system.numerics("stiffnesses"):
            return rates(given, compliance=False)
        stiff = given > own_stiffness(system, name)
        if not stiff.any():
            return rates(given, compliance=False)
        by_compliance = rates(1.0 / given, compliance=True)
        more = (None,) * (by_compliance.ndim - given.ndim)
        found: Complex = -((1.0 / given) ** 2)[(..., *more)] * by_compliance
    return found if stiff.all() else np.where(stiff[(..., *more)], found, rates(given, compliance=False))


def _rates(
    system: System, name: str, s: Complex, place: Array, quantity: Quantity, noise: float, *, compliance: bool
) -> Complex:
    fixed = np.isinf(place)
    place = np.where(fixed, 1.0, place)
    gap, slope, here = gaps(s), np.zeros_like(s), quantity(system, s)
    more = (None,) * (here.ndim - place.ndim)
    repeated = (gap <= _SAME * np.abs(s))[(..., *more[1:])]
    if repeated.all() and repeated.size:
        return np.full_like(here, complex(np.nan, np.nan), dtype=complex)

    def moved(values: Array) -> tuple[System, Complex]:
        """Return the system at other values of the parameter and its eigenvalues there, (*values.shape, modes)."""
        with np.errstate(divide="ignore"):
            there = system.replace(**{name: 1.0 / values if compliance else values})
            found = with_next(there, s.shape[-1] - 1)
        near = s + slope * (values - place)[..., None]
        nearest = np.abs(found[..., None, :] - near[..., :, None]).argmin(axis=-1)
        return there, np.take_along_axis(found, nearest, axis=-1)

    size = np.where(place != 0.0, np.abs(place), _unit(system, name, compliance=compliance))
    longest = np.minimum(np.where(place != 0.0, _STEP * size, size), _STEP * room_of(system, name))
    width = np.minimum(_FIRST * size, longest)
    for _ in range(_TURNS):
        with np.errstate(divide="ignore", invalid="ignore"):
            there = moved(place + width)[1]
            slope, share = (there - s) / width[..., None], _approach(s, there)
            width = np.minimum(width * np.minimum(_STEP / share, 1.0 / _FIRST), longest)
    steps = _SHORTER[:, *(None,) * place.ndim] * width
    offsets = offsets_at(place, width)
    change = quantity(*moved(place + offsets * steps[:, None])) - here
    rates = (weights_at(offsets)[(..., *more)] * change).sum(axis=1) / steps[(..., *more)]
    beside = tuple(range(s.ndim - here.ndim, 0))  # axes after that of the modes
    apart = np.abs(np.diff(rates, axis=0)).max(axis=beside, keepdims=True)
    best = apart.argmin(axis=0)[None]
    rate, error = (np.take_along_axis(of, best, axis=0)[0] for of in (rates[1:], apart))
    largest, level = (np.abs(of).max(axis=beside, keepdims=True) for of in (rate, here))
    rounding = noise * level / steps[-1][(..., *more)]
    bad = ~(error <= _AGREE * largest + rounding) | repeated
    return np.where(fixed[(..., *more)], 0.0, np.where(bad, complex(np.nan, np.nan), rate))


def _unit(system: System, name: str, *, compliance: bool) -> Array | float:
    """Return the size of a change of a parameter that is zero."""
    if name not in system.numerics("stiffnesses"):
        return 1.0
    stiffness = own_stiffness(system, name)
    return 1.0 / stiffness if compliance else stiffness


def _approach(s: Complex, moved: Complex) -> Array:
    """Return the largest change of eigenvalues and of their distances, over these, shape (...)."""
    whole, change = np.concatenate([s, s.conj()], axis=-1), moved - s
    changes = np.concatenate([change, change.conj()], axis=-1)
    apart, nearer = (one[..., :, None] - all_[..., None, :] for one, all_ in ((s, whole), (change, changes)))
    by_pairs = np.where(apart == 0.0, 0.0, np.abs(nearer / apart)).max(axis=(-2, -1))
    return np.asarray(np.maximum(by_pairs, np.abs(change / s).max(axis=-1)))


def gaps(s: Complex) -> Array:
    """Return the distance of every eigenvalue from the nearest other one, conjugates included, shape (..., modes)."""
    apart = np.abs(s[..., :, None] - np.concatenate([s, s.conj()], axis=-1)[..., None, :])
    modes = np.arange(s.shape[-1])
    apart[..., modes, modes] = np.inf
    return np.asarray(apart.min(axis=-1))
