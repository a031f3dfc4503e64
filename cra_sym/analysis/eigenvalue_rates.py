"""Derivatives of complex eigenvalues by a parameter: differences of eighth order with a step adapted to the modes."""

from __future__ import annotations

from contextlib import suppress

import numpy as np
from numpy.typing import NDArray

from cra_sym.analysis.differences import offsets_at, own_stiffness, room_of, weights_at
from cra_sym.analysis.eigenvalues import eigenvalues
from cra_sym.model.system import System

__all__ = ["eigenvalue_rates", "with_next"]

Array = NDArray[np.float64]
Complex = NDArray[np.complex128]
_STEP = 0.02  # step of the differences, over the change at which an eigenvalue may meet another one
_FIRST, _TURNS = 1e-6, 4  # first step, over the value of the parameter, and the number of changes of it
_SHORTER = np.array([1.0, 0.25, 0.0625])  # steps that are compared, over the longest
_AGREE = 1e-6  # relative difference of two steps beyond which there is no derivative
_NOISE = 1e-12  # relative error of an eigenvalue
_SAME = 1e-9  # relative distance below which eigenvalues are repeated


def with_next(system: System, modes: int) -> Complex:
    """Return the first eigenvalues of motions that oscillate, and the next one if there is one."""
    with suppress(ValueError):
        return eigenvalues(system, modes + 1)
    return eigenvalues(system, modes)


def eigenvalue_rates(system: System, name: str, s: Complex, *, compliance: bool = False) -> Complex:
    """Return the derivatives of eigenvalues by a parameter, or by one over it, shape (..., modes).

    Of three steps, the one that agrees best with a longer one counts.

    Parameters
    ----------
    system : System
    name : str
    s : ndarray of complex, shape (..., modes)
        Its first eigenvalues.
    compliance : bool
        Whether the derivative is by one over the parameter, which then must be the stiffness of an end.

    Returns
    -------
    ndarray of complex, shape (..., modes)
        By an infinite value 0. It is nan where an eigenvalue is repeated or coalesces with another, since these may
        split like a root of the change. The relative error is about 1e-11, or that of the eigenvalues over the step.
    """
    given = np.broadcast_to(system.values[name], system.shape)
    with np.errstate(divide="ignore"):
        if compliance:
            return _rates(system, name, s, 1.0 / given, compliance=True)
        if name not in system.numerics("stiffnesses"):
            return _rates(system, name, s, given, compliance=False)
        stiff = given > own_stiffness(system, name)
        parts = []
        if stiff.any():
            inner = -((1.0 / given) ** 2)[..., None]
            parts.append(inner * _rates(system, name, s, 1.0 / given, compliance=True))
        if not stiff.all():
            parts.append(_rates(system, name, s, given, compliance=False))
    return np.where(stiff[..., None], parts[0], parts[-1])


def _rates(system: System, name: str, s: Complex, place: Array, *, compliance: bool) -> Complex:
    fixed = np.isinf(place)
    place = np.where(fixed, 1.0, place)
    gap = _gaps(s)

    def moved(values: Array) -> Complex:
        """Return the eigenvalues near s at other values of the parameter, shape (*values.shape, modes)."""
        with np.errstate(divide="ignore"):
            found = with_next(system.replace(**{name: 1.0 / values if compliance else values}), s.shape[-1] - 1)
        near = np.abs(found[..., None, :] - s[..., :, None]).argmin(axis=-1)
        return np.take_along_axis(found, near, axis=-1)

    size = np.where(place != 0.0, np.abs(place), _unit(system, name, compliance=compliance))
    longest = np.minimum(np.where(place != 0.0, _STEP * size, size), _STEP * room_of(system, name))
    width = np.minimum(_FIRST * size, longest)
    for _ in range(_TURNS):
        with np.errstate(divide="ignore", invalid="ignore"):
            share = (np.abs(moved(place + width) - s) / gap).max(axis=-1)
            width = np.minimum(width * np.minimum(_STEP / share, 1.0 / _FIRST), longest)
    steps = _SHORTER[:, *(None,) * place.ndim] * width
    offsets = offsets_at(place, width)
    change = moved(place + offsets * steps[:, None]) - s
    rates = (weights_at(offsets)[..., None] * change).sum(axis=1) / steps[..., None]
    apart = np.abs(np.diff(rates, axis=0))
    best = apart.argmin(axis=0)[None]
    rate, error = (np.take_along_axis(of, best, axis=0)[0] for of in (rates[1:], apart))
    rounding = _NOISE * np.abs(s) / steps[-1, ..., None]
    bad = ~(error <= _AGREE * np.abs(rate) + rounding) | (gap <= _SAME * np.abs(s))
    return np.where(fixed[..., None], 0.0, np.where(bad, complex(np.nan, np.nan), rate))


def _unit(system: System, name: str, *, compliance: bool) -> Array | float:
    """Return the size of a change of a parameter that is zero."""
    if name not in system.numerics("stiffnesses"):
        return 1.0
    stiffness = own_stiffness(system, name)
    return 1.0 / stiffness if compliance else stiffness


def _gaps(s: Complex) -> Array:
    """Return the distance of every eigenvalue from the nearest other one, conjugates included, shape (..., modes)."""
    apart = np.abs(s[..., :, None] - np.concatenate([s, s.conj()], axis=-1)[..., None, :])
    modes = np.arange(s.shape[-1])
    apart[..., modes, modes] = np.inf
    return np.asarray(apart.min(axis=-1))
