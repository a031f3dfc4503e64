r"""Proofs of stability and instability: enclosures of monodromy matrices and of their multipliers, many at once.

The Taylor steps of :mod:`cra_sym.solvers.periodic` give an approximate matrix. Truncation and rounding are bounded by a
majorant: a scalar series with the norms of the coefficients. Within a step errors grow at most by the logarithmic norm;
over many steps each error is referred to the initial state, so that it grows no faster than the motion. In modal units,
:math:`(\omega q, \dot q)`, free motion without damping keeps the Euclidean norm.

Approximate eigenvectors then turn the enclosure into a nearly diagonal one, whose discs by Gershgorin enclose the
multipliers (Rump 2001). A group of discs outside the unit circle and disjoint from all others proves instability; all
discs inside it prove stability. Without damping the multipliers come in pairs :math:`\rho, 1/\bar\rho` (Yakubovich and
Starzhinskii 1975). If a disc contains one multiplier and its reflection in the unit circle meets no other disc, it
contains the partner too, so that the multiplier is simple and of modulus one. If this holds for all discs, every motion
is bounded. Bounds are computed in doubles and enlarged by one per cent, far more than their rounding error.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cra_sym.solvers.floquet import MOST_STEPS
from cra_sym.solvers.periodic import PeriodicSystem, propagated

__all__ = ["STABLE", "UNDECIDED", "UNSTABLE", "enclosed_monodromy", "multiplier_discs", "proved_stability"]

Array = NDArray[np.float64]
STABLE, UNSTABLE, UNDECIDED = 1, -1, 0
_ORDER = 24
_ANGLE = 1.5  # largest step times the largest rate
_STEPS = 16  # least number of steps per period of the fastest cosine
_ROUNDING = np.finfo(float).eps / 2
_ENLARGED = 1.01
_BLOCK = 512
_RADII = np.geomspace(2.0, 64.0, 24)  # of circles on which the majorant is evaluated, in steps


@dataclass(frozen=True)
class _Bounds:
    """Norms of a batch in modal units, shape (points,); ``swings`` has one row a term."""

    still: Array
    swings: Array
    growth: Array
    turns: NDArray[np.int64]

    @property
    def rate(self) -> Array:
        """Bound of the norm of the coefficients, 1/s."""
        return np.asarray(self.still + self.swings.sum(axis=0))


def proved_stability(system: PeriodicSystem, unit: Array, conservative: bool, spread: float) -> NDArray[np.int8]:
    """Return STABLE, UNSTABLE or UNDECIDED for every system.

    Parameters
    ----------
    system : PeriodicSystem
        Stiffness and damping alone may oscillate.
    unit : ndarray, shape (N, points) or (N, 1)
        Factors of q in modal units, rad/s: the natural frequencies where they are positive.
    conservative : bool
        Whether all systems are without damping: symmetric stiffness, skew damping matrices.
    spread : float
        Relative uncertainty of the coefficients, against the sum of a row: the proof holds for all systems within it.

    Returns
    -------
    ndarray of int8, shape (points,)
    """
    bounds = _bounds(system, unit)
    steps = np.ceil(np.maximum(system.period * bounds.rate / _ANGLE, _STEPS * max(bounds.turns, default=1)))
    verdict = np.zeros(system.period.size, dtype=np.int8)
    possible = np.nonzero(steps <= MOST_STEPS)[0]
    order = possible[np.argsort(steps[possible], kind="stable")]
    for start in range(0, order.size, _BLOCK):
        block = order[start : start + _BLOCK]
        some = system.take(block)
        units = unit if unit.shape[-1] == 1 else unit[:, block]
        with np.errstate(all="ignore"):
            maps, error = enclosed_monodromy(some, units, int(steps[block[-1]]), spread)
            verdict[block] = _decided(*multiplier_discs(maps, error), conservative)
    return verdict


def _rows(matrix: Array) -> Array:
    return np.asarray(np.abs(matrix).sum(axis=1).max(axis=0))


def _size(matrix: Array) -> Array:
    return np.asarray(np.sqrt((matrix**2).sum(axis=(0, 1))))


def _bounds(system: PeriodicSystem, unit: Array) -> _Bounds:
    still = np.maximum(unit.max(axis=0), _rows(system.stiffness / unit) + _rows(system.damping))
    sides = np.eye(len(unit))[..., None] * unit - system.stiffness.swapaxes(0, 1) / unit[:, None]
    growth = 0.5 * _size(sides) + _negative(system.damping)
    swings, points = [], system.period.size
    for swing in system.swings:
        if swing.mass is not None or swing.momentum is not None:
            raise ValueError("swings: a mass or a momentum oscillates; must be stiffness and damping alone")
        size, total = np.abs(swing.size), np.zeros(points)
        if swing.stiffness is not None:
            total = total + size * _rows(swing.stiffness / unit)
            growth = growth + 0.5 * size * _size(swing.stiffness / unit[:, None])
        if swing.damping is not None:
            total = total + size * _rows(swing.damping)
            growth = growth + size * _size(swing.damping)
        swings.append(total)
    rows = np.array(swings).reshape(len(swings), points)
    turns = np.array([swing.oscillation.order for swing in system.swings], dtype=np.int64)
    return _Bounds(np.broadcast_to(still, points), rows, np.broadcast_to(growth, points), turns)


def _negative(damping: Array) -> Array:
    """Return a bound of the growth rate that negative damping can cause, 1/s."""
    symmetric = 0.5 * (damping + damping.swapaxes(0, 1))
    lowest = np.linalg.eigvalsh(np.moveaxis(symmetric, -1, 0))[:, 0]
    return np.asarray(np.maximum(0.0, -lowest) + 1e-14 * _size(symmetric))


def enclosed_monodromy(system: PeriodicSystem, unit: Array, steps: int, spread: float) -> tuple[Array, Array]:
    """Return monodromy matrices in modal units, (points, 2N, 2N), and bounds of their error in the Frobenius norm.

    Parameters
    ----------
    system, unit, spread
        As in :func:`proved_stability`.
    steps : int
    """
    bounds = _bounds(system, unit)
    size, points = 2 * len(unit), system.period.size
    factors = np.concatenate([np.broadcast_to(unit, (len(unit), points)), np.ones((len(unit), points))])
    scale = factors[:, None] / factors
    h = system.period / steps
    local = np.sqrt(size) * _local_error(bounds, h, steps, len(unit), spread)
    growth = bounds.growth + spread * np.sqrt(size) * bounds.rate
    factor = np.exp(_ENLARGED * h * growth)
    error, through = np.zeros((2, points))
    state = scale * np.eye(size)[..., None]
    for q, p in propagated(system, steps, _ORDER):
        new = local * _size(state)
        error = factor * error + new
        state = scale * np.concatenate([q, p])
        # as an error of the initial state, propagated by the exact map: it grows no faster than the motion
        through = through + _inverse_size(state, error) * new
        carried = np.where(through < 1.0, _size(state) * through / (1.0 - through), np.inf)
        error = np.fmin(error, _ENLARGED * carried)
    maps = np.moveaxis(state, -1, 0)
    return maps, _ENLARGED * (error + 4 * _ROUNDING * _size(state))


def _inverse_size(state: Array, error: Array) -> Array:
    """Return a bound of the norm of the inverse of every matrix within the error."""
    matrices = np.moveaxis(state, -1, 0)
    inverse = _inverse(matrices)
    off = np.linalg.norm(inverse @ matrices - np.eye(len(state)), axis=(1, 2)) + 1e-13 * _size(state) * _size(
        np.moveaxis(inverse, 0, -1)
    )
    size = _ENLARGED * np.linalg.norm(inverse, axis=(1, 2)) / (1.0 - off)
    return np.asarray(np.where((off < 1.0) & (size * error < 1.0), size / (1.0 - size * error), np.inf))


def _local_error(bounds: _Bounds, h: Array, steps: int, modes: int, spread: float) -> Array:
    """Return a bound of the error of one step, relative to the state in the largest norm of the columns."""
    angles = 2 * np.pi * bounds.turns / steps
    logs = []
    for radius in (1.0, *_RADII):
        # the integral from 0 to the radius of the norms of the coefficients, cosines as exponentials
        swung = np.where(angles > 0, np.expm1(angles * radius) / np.where(angles > 0, angles, 1.0), radius)
        logs.append(h * (bounds.still * radius + swung @ bounds.swings if len(angles) else bounds.still * radius))
    with np.errstate(over="ignore"):
        tails = [np.exp(log) * radius**-_ORDER / (radius - 1.0) for log, radius in zip(logs[1:], _RADII, strict=True)]
    # additions and products for one coefficient of the series, those of the cosines and of the step included; the k-th
    # coefficient has k times their error, and the sum of k times the majorant's coefficients is its slope
    operations = modes + 2 * _ORDER + 13 * int(max(bounds.turns, default=1)) + len(bounds.turns) + 30
    slope = h * (bounds.still + (np.exp(angles) @ bounds.swings if len(angles) else 0.0))
    rounding = ((operations * _ROUNDING + spread) * slope + (_ORDER + 1) * _ROUNDING) * np.exp(logs[0])
    return np.asarray(_ENLARGED * (np.min(tails, axis=0) + rounding))


def multiplier_discs(maps: Array, error: Array) -> tuple[NDArray[np.complex128], Array]:
    """Return centres and radii of discs that enclose the eigenvalues of every matrix within the error.

    Parameters
    ----------
    maps : ndarray, shape (points, n, n)
    error : ndarray, shape (points,)
        In the Frobenius norm.

    Returns
    -------
    centres, radii : ndarray, shape (points, n)
        A group of discs that meets no other contains as many eigenvalues as discs; a radius is inf without a bound.
    """
    size = maps.shape[-1]
    usable = np.isfinite(maps).all(axis=(1, 2)) & np.isfinite(error)
    maps = np.where(usable[:, None, None], maps, np.eye(size))
    centres, vectors = np.linalg.eig(maps)
    centres, vectors = centres.astype(complex), vectors.astype(complex)
    inverse = _inverse(vectors)
    product = (4 * size + 8) * _ROUNDING  # relative error of a complex product of matrices, against absolute values
    near = inverse @ (maps @ vectors)
    beside = np.abs(near - centres[:, :, None] * np.eye(size)).sum(axis=2)
    absolute = np.abs(inverse) @ (np.abs(maps) @ np.abs(vectors))
    rows, columns = np.sqrt((np.abs(inverse) ** 2).sum(axis=2)), np.sqrt((np.abs(vectors) ** 2).sum(axis=1))
    radii = beside + 2 * product * absolute.sum(axis=2) + rows * (error * columns.sum(axis=1))[:, None]
    unity = np.abs(inverse @ vectors - np.eye(size)) + product * (np.abs(inverse) @ np.abs(vectors))
    apart = unity.sum(axis=2).max(axis=1)
    whole = (np.abs(centres) + radii).max(axis=1)
    radii = _ENLARGED * (radii + (apart / (1.0 - apart) * whole)[:, None])
    good = usable & (apart < 0.5)
    return centres, np.where(good[:, None] & np.isfinite(radii), radii, np.inf)


def _inverse(matrices: NDArray[Any]) -> NDArray[Any]:
    try:
        return np.linalg.inv(matrices)
    except np.linalg.LinAlgError:  # one is singular; the later check rejects its pseudo-inverse
        return np.linalg.pinv(matrices)


def _decided(centres: NDArray[np.complex128], radii: Array, conservative: bool) -> NDArray[np.int8]:
    size = centres.shape[1]
    modulus, own = np.abs(centres), np.eye(size, dtype=bool)
    distance = np.abs(centres[:, :, None] - centres[:, None, :])
    meet = (distance <= radii[:, :, None] + radii[:, None, :]) | own
    for _ in range(int(np.ceil(np.log2(size))) + 1):
        meet = meet @ meet  # groups of discs that meet
    outside = modulus - radii > 1.0
    unstable = (outside & ~(meet & ~outside[:, None, :]).any(axis=2)).any(axis=1)
    stable = (modulus + radii < 1.0).all(axis=1)
    if conservative:
        inner = modulus * (modulus - radii)
        image = (
            np.where(inner > 0, radii / np.where(inner > 0, inner, 1.0), np.inf) + np.abs(1.0 - modulus**2) / modulus
        )
        image = _ENLARGED * np.maximum(image + 4 * _ROUNDING, radii)
        alone = (distance > image[:, :, None] + radii[:, None, :]) | own
        stable |= alone.all(axis=(1, 2)) & np.isfinite(radii).all(axis=1)
    return np.where(unstable, UNSTABLE, np.where(stable, STABLE, UNDECIDED)).astype(np.int8)
