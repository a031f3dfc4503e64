"""Derivatives of modal quantities by a parameter: eighth-order differences with a step adapted to the modes."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from cra_sym.model.system import System

if TYPE_CHECKING:
    from cra_sym.analysis.sensitivities import Sensitivities

__all__ = [
    "by_differences",
    "central_weights",
    "offsets_at",
    "own_stiffness",
    "rates_by_moved_supports",
    "room_of",
    "weights_at",
]

Array = NDArray[np.float64]
Quantity = Callable[[System], Array]
_STEP = 0.02  # step of the differences, over the change of the parameter at which two modes would coincide
_SHORT = 1e-4  # of the room of a support: step of a first estimate of the slope
_SAME = 1e-9  # relative distance of squared frequencies below which they are repeated
_POINTS = 8  # points on one side of a parameter that cannot be negative, or four on each side


def by_differences(
    system: System,
    found: Sensitivities,
    name: str,
    quantity: Quantity,
    *,
    compliance: bool = False,
    step: float = _STEP,
) -> Array:
    """Return the derivative of a modal quantity by a parameter; by a stiff end spring it is taken via its compliance.

    Parameters
    ----------
    system : System
    found : Sensitivities
        Of the modes of the quantity and of the next one, which may be close to the last.
    name : str
    quantity : callable
        Takes a system, returns an array of shape (..., modes, ...) that begins with the shape of the batch.
    compliance : bool
        Whether the derivative is by one over the stiffness.
    step : float
        Step of the differences, over the change of the parameter at which two modes would coincide: small where the
        quantity has kinks, such as a peak that moves by a period.

    Returns
    -------
    ndarray
        With the shape of the quantity; the relative error is the larger of 1e-11 and that of the quantity over the
        step.
    """
    given = np.broadcast_to(system.values[name], system.shape)
    if compliance or name not in found.compliance:
        return _differences(system, found, name, quantity, compliance=compliance, step=step)
    stiff = given > own_stiffness(system, name)
    if not stiff.any():
        return _differences(system, found, name, quantity, compliance=False, step=step)
    by_compliance = _differences(system, found, name, quantity, compliance=True, step=step)
    more = (None,) * (by_compliance.ndim - given.ndim)
    with np.errstate(divide="ignore"):
        total = -((1 / given) ** 2)[(..., *more)] * by_compliance
    if not stiff.all():
        soft = _differences(system, found, name, quantity, compliance=False, step=step)
        total = np.where(stiff[(..., *more)], total, soft)
    return np.asarray(total)


def rates_by_moved_supports(system: System, name: str, modes: int) -> Array:
    """Return the derivatives of omega by a parameter that moves a support inside, rad/s over its unit, (..., modes)."""
    given, room = np.broadcast_to(system.values[name], system.shape), room_of(system, name)
    more = min(modes + 1, system.most_modes)  # the next mode may be close to the last one
    beside = system.replace(**{name: given + np.array([-1.0, 1.0])[:, *(None,) * given.ndim] * _SHORT * room})
    before, after = beside.natural_frequencies(more)
    slope = (after - before) / (2 * _SHORT * room)[..., None]
    width = _STEP * np.minimum(_reach(system.natural_frequencies(more), slope, given), room)
    offsets, weights = central_weights()
    moved = system.replace(**{name: given + offsets[:, *(None,) * given.ndim] * width}).natural_frequencies(modes)
    return np.asarray(np.tensordot(weights, moved, axes=1) / width[..., None])


def room_of(system: System, name: str) -> Array:
    """Return the change of a parameter at which a support inside meets another place; inf if it moves none."""
    moving = system.numerics("moving_supports").get(name)
    if moving is None:
        return np.full(system.shape, np.inf)
    found = [np.broadcast_to(value, system.shape) for value in moving.function(*system.domain.values)]
    share, rate, held = np.moveaxis(np.reshape(found, (3, -1, *system.shape)), 1, -1)
    gaps, speeds = (np.abs(part[..., :, None] - part[..., None, :]) for part in (share, rate))
    with np.errstate(divide="ignore", invalid="ignore"):
        meeting = np.where((speeds > 0) & (held[..., :, None] > 0), gaps / speeds, np.inf)
    return np.asarray(meeting.min(axis=(-2, -1)))


def own_stiffness(system: System, name: str) -> Array:
    """Return the end stiffness whose compliance equals that of the structure, shape of the batch."""
    rigid = system.basis.replace(**{name: np.inf})
    end, place, factor = system.numerics("stiffnesses")[name]
    force, unit = rigid.modes(1).force(end, place)[..., 0], factor.function(*rigid.domain.values)
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.broadcast_to((force / rigid.natural_frequencies(1)[..., 0]) ** 2 / unit, system.shape)


def _reach(frequency: Array, rate: Array, place: Array) -> Array:
    """Return the change of a parameter at which modes coincide or become rigid-body motions, to first order.

    In the complex plane of the parameter the modes are analytic up to about there.
    """
    squares = frequency**2
    slopes = np.where(np.isfinite(rate), np.abs(2 * frequency * rate), 0.0)
    gaps = np.abs(squares[..., :, None] - squares[..., None, :])
    with np.errstate(divide="ignore", invalid="ignore"):
        meeting = gaps / (slopes[..., :, None] + slopes[..., None, :])
        falling = squares / slopes
    own = np.eye(squares.shape[-1], dtype=bool)
    together = gaps <= _SAME * squares[..., :, None]  # repeated frequencies, apart by rounding
    meeting = np.where(own | together | np.isnan(meeting), np.inf, meeting)
    falling = np.where(squares > 0, falling, np.inf)
    reach = np.minimum(meeting.min(axis=(-2, -1)), falling.min(axis=-1))
    return np.where(np.isfinite(reach), reach, np.where(place > 0, place, 1.0))


def _differences(
    system: System, found: Sensitivities, name: str, quantity: Quantity, *, compliance: bool, step: float
) -> Array:
    """Return the derivative by differences: central where the parameter allows, else one-sided."""
    given = np.broadcast_to(system.values[name], system.shape)
    with np.errstate(divide="ignore"):
        place = 1 / given if compliance else given
    fixed = np.isinf(place)  # no finite difference exists there; the caller returns the limit
    place = np.where(fixed, 1.0, place)
    reach = _reach(found.frequency, found.compliance[name] if compliance else found.rate[name], place)
    if not compliance and name not in {*system.numerics("stiffnesses"), *system.numerics("inertias")}:
        reach = np.where(place == 0, reach, np.minimum(reach, np.abs(place)))  # such as a density: nothing beyond 0
    width = step * np.minimum(reach, room_of(system, name))
    offsets = offsets_at(place, width)
    values = place + offsets * width
    with np.errstate(divide="ignore"):
        moved = system.replace(**{name: 1 / values if compliance else values})
    values_there = quantity(moved)
    more = (None,) * (values_there.ndim - offsets.ndim)
    weights = weights_at(offsets) / width
    return np.asarray((weights[(..., *more)] * values_there).sum(axis=0))


def offsets_at(place: Array, width: Array) -> Array:
    """Return the offsets of a difference of eighth order, (points, ...): central, or those that keep the sign."""
    half = _POINTS // 2
    room = np.where(place < 0, half, np.floor(place / width).clip(0, half))
    return np.asarray(np.arange(-half, half + 1)[:, *(None,) * place.ndim] + (half - room))


def central_weights() -> tuple[Array, Array]:
    """Return the offsets and the weights of the central difference of eighth order."""
    offsets = np.arange(-(_POINTS // 2), _POINTS // 2 + 1.0)
    return offsets, weights_at(offsets)


def weights_at(offsets: Array) -> Array:
    """Return the weights of the derivative at 0 of the polynomial through values at offsets (points, ...)."""
    points = len(offsets)
    orders = np.arange(points, dtype=float).reshape(-1, *(1,) * offsets.ndim)
    powers = np.moveaxis(np.power(offsets, orders), (0, 1), (-2, -1))
    slope = np.zeros((*powers.shape[:-2], points, 1))
    slope[..., 1, 0] = 1.0
    return np.moveaxis(np.linalg.solve(powers, slope)[..., 0], -1, 0)
