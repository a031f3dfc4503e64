r"""Proofs of stability and instability: enclosures of monodromy matrices and of their multipliers, many at once.

The Taylor steps of :mod:`cra_sym.solvers.periodic` give an approximate matrix. Truncation and rounding are bounded by a
majorant: a scalar series with the norms of the coefficients. Within a step errors grow at most by the logarithmic norm;
over many steps each error is referred to the initial state, so that it grows no faster than the motion. In modal units,
:math:`(\omega q, p)`, free motion without damping keeps the Euclidean norm.

An oscillating mass :math:`M = 1 + \sum_r g_r M_r` enters by its inverse. With s the sum of the norms of the
:math:`g_r M_r`, its Taylor coefficients over a time tau are at most those of the scalar
:math:`\mu/(1 - \mu\,s\,(e^{n\varpi\tau} - 1))` with :math:`\mu = 1/(1 - s)`, which multiplies the majorant. The
computed inverse at the start of a step has a residual, which is bounded and taken as an error of the mass.

Approximate eigenvectors then turn the enclosure into a nearly diagonal one, whose discs by Gershgorin enclose the
multipliers (Rump 2001). A group of discs outside the unit circle and disjoint from all others proves instability; all
discs inside it prove stability. Without damping the multipliers come in pairs :math:`\rho, 1/\bar\rho` (Yakubovich and
Starzhinskii 1975). If a disc contains one multiplier and its reflection in the unit circle meets no other disc, it
contains the partner too, so that the multiplier is simple and of modulus one. If this holds for all discs, every motion
is bounded. Bounds are computed in doubles and enlarged by one per cent, far more than their rounding error.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cra_sym.solvers.floquet import MOST_STEPS
from cra_sym.solvers.periodic_systems import PeriodicSystem
from cra_sym.solvers.taylor import mass_at_step, propagated

__all__ = ["STABLE", "UNDECIDED", "UNSTABLE", "enclosed_monodromy", "multiplier_discs", "proved_stability"]

Array = NDArray[np.float64]
STABLE, UNSTABLE, UNDECIDED = 1, -1, 0
_ORDER = 24
_ANGLE = 1.5  # largest step times the largest rate
_STEPS = 16  # least number of steps per period of the fastest cosine
_ROUNDING = np.finfo(float).eps / 2
_ENLARGED = 1.01
_MASS_RADIUS = 4.0  # steps over which the bound of the inverse mass at most doubles
_BLOCK = 512
_RADII = np.geomspace(2.0, 64.0, 24)  # of circles on which the majorant is evaluated, in steps


@dataclass(frozen=True)
class _Bounds:
    """Norms of a batch in modal units, shape (points,); ``swings`` and ``masses`` have one row a term."""

    still: Array
    swings: Array
    growth: Array
    turns: NDArray[np.int64]
    masses: Array

    @property
    def light(self) -> Array:
        """Bound of the norm of the inverse mass; inf where it has none."""
        rest = 1.0 - _ENLARGED * self.masses.sum(axis=0)
        return np.where(rest > 0.0, 1.0 / np.where(rest > 0.0, rest, 1.0), np.inf)

    @property
    def condition(self) -> Array:
        """Bound of the relative change of the coefficients per relative change of the mass."""
        return np.asarray(self.light * (1.0 + self.masses.sum(axis=0)))

    @property
    def rate(self) -> Array:
        """Bound of the norm of the coefficients, 1/s, also over a step and some more where masses oscillate."""
        return np.asarray((self.still + self.swings.sum(axis=0)) * np.where(self.oscillates, 2.0 * self.light, 1.0))

    @property
    def oscillates(self) -> NDArray[np.bool_]:
        """Whether the mass oscillates."""
        return np.asarray(self.masses.any(axis=0))

    def least_steps(self) -> Array:
        """Return the number of steps a period from which on the inverse mass at most doubles over some steps."""
        share = np.maximum((self.masses.T * (self.turns > 0)).sum(axis=1) * self.light, 1e-300)
        turns = max(self.turns, default=1)
        found = 2 * np.pi * turns * _MASS_RADIUS / np.log1p(0.5 / share)
        return np.where(self.oscillates, found, 0.0)

    def inverse_mass(self, angles: Array, radius: float) -> Array | float:
        """Return a bound of the Taylor coefficients of the inverse mass: their sum at a radius, in steps."""
        if not self.oscillates.any():
            return 1.0
        share = self.light * (np.expm1(angles * radius) @ self.masses)
        inside = _ENLARGED * share < 1.0
        return np.where(inside, self.light / np.where(inside, 1.0 - _ENLARGED * share, 1.0), np.inf)


def proved_stability(system: PeriodicSystem, unit: Array, paired: bool, spread: float) -> NDArray[np.int8]:
    """Return STABLE, UNSTABLE or UNDECIDED for every system.

    Parameters
    ----------
    system : PeriodicSystem
        Stiffness, damping and mass may oscillate; momenta may not.
    unit : ndarray, shape (N, points) or (N, 1)
        Factors of q in modal units, rad/s: the natural frequencies where they are positive.
    paired : bool
        Whether with every multiplier also the inverse of its conjugate is one: the systems are conservative (symmetric
        stiffness, skew damping matrices) or reversible.
    spread : float
        Relative uncertainty of the coefficients, against the sum of a row: the proof holds for all systems within it.

    Returns
    -------
    ndarray of int8, shape (points,)
    """
    bounds = _bounds(system, unit)
    least = np.maximum(_STEPS * max(bounds.turns, default=1), bounds.least_steps())
    steps = np.ceil(np.maximum(system.period * bounds.rate / _ANGLE, least))
    verdict = np.zeros(system.period.size, dtype=np.int8)
    possible = np.nonzero(steps <= MOST_STEPS)[0]
    order = possible[np.argsort(steps[possible], kind="stable")]
    for start in range(0, order.size, _BLOCK):
        block = order[start : start + _BLOCK]
        some = system.take(block)
        units = unit if unit.shape[-1] == 1 else unit[:, block]
        with np.errstate(all="ignore"):
            maps, error = enclosed_monodromy(some, units, int(steps[block[-1]]), spread)
            verdict[block] = _decided(*multiplier_discs(maps, error), paired)
    return verdict


def _rows(matrix: Array) -> Array:
    return np.asarray(np.abs(matrix).sum(axis=1).max(axis=0))


def _size(matrix: Array) -> Array:
    return np.asarray(np.sqrt((matrix**2).sum(axis=(0, 1))))


def _bounds(system: PeriodicSystem, unit: Array) -> _Bounds:
    still = np.maximum(unit.max(axis=0), _rows(system.stiffness / unit) + _rows(system.damping))
    sides = np.eye(len(unit))[..., None] * unit - system.stiffness.swapaxes(0, 1) / unit[:, None]
    growth = 0.5 * _size(sides) + _negative(system.damping)
    swings, masses, points = [], [], system.period.size
    for swing in system.swings:
        if swing.momentum is not None:
            raise ValueError("swings: a momentum oscillates; must be stiffness, damping and mass alone")
        size, total = np.abs(swing.size), np.zeros(points)
        if swing.stiffness is not None:
            total = total + size * _rows(swing.stiffness / unit)
            growth = growth + 0.5 * size * _size(swing.stiffness / unit[:, None])
        if swing.damping is not None:
            total = total + size * _rows(swing.damping)
            growth = growth + size * _size(swing.damping)
        swings.append(total)
        masses.append(np.zeros(points) if swing.mass is None else size * _rows(swing.mass))
    rows, heavy = (np.array(part).reshape(len(swings), points) for part in (swings, masses))
    turns = np.array([swing.oscillation.order for swing in system.swings], dtype=np.int64)
    found = _Bounds(np.broadcast_to(still, points), rows, np.broadcast_to(growth, points), turns, heavy)
    if not heavy.any():
        return found
    with np.errstate(all="ignore"):  # in the Euclidean norm the inverse mass differs from 1 by at most this
        apart = np.sqrt(len(unit)) * (found.light - 1.0)
        damped = _size(system.damping) + sum(
            np.abs(s.size) * _size(s.damping) for s in system.swings if s.damping is not None
        )
        return replace(found, growth=found.growth + apart * (0.5 * unit.max(axis=0) + damped))


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
    local, by_mass = (np.sqrt(size) * part for part in _local_error(bounds, h, steps, len(unit), spread))
    growth = bounds.growth + spread * np.sqrt(size) * bounds.rate * bounds.condition
    factor = np.exp(_ENLARGED * h * growth)
    error, through = np.zeros((2, points))
    state = scale * np.eye(size)[..., None]
    for step, moved in enumerate(propagated(system, steps, _ORDER)):
        new = (local + by_mass * _residual(system, step, steps)) * _size(state)
        error = factor * error + new
        state = scale * moved
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


def _residual(system: PeriodicSystem, step: int, steps: int) -> Array | float:
    """Return a bound of the residual of the inverse mass that a step uses, in the row norm."""
    found = mass_at_step(system, step, steps)
    if found is None:
        return 0.0
    mass, inverse = (np.moveaxis(part, -1, 0) for part in found)
    product = np.abs(inverse) @ np.abs(mass)
    off = np.abs(inverse @ mass - np.eye(len(system.stiffness)))
    return np.asarray(_ENLARGED * (off + (mass.shape[-1] + 4) * _ROUNDING * product).sum(axis=2).max(axis=1))


def _local_error(bounds: _Bounds, h: Array, steps: int, modes: int, spread: float) -> tuple[Array, Array]:
    """Return a bound of the error of one step, relative to the state in the largest norm of the columns.

    The second is that per residual of the inverse mass.
    """
    angles = 2 * np.pi * bounds.turns / steps
    logs = []
    for radius in (1.0, *_RADII):
        # the integral from 0 to the radius of the norms of the coefficients, cosines as exponentials
        swung = np.where(angles > 0, np.expm1(angles * radius) / np.where(angles > 0, angles, 1.0), radius)
        whole = h * (bounds.still * radius + swung @ bounds.swings if len(angles) else bounds.still * radius)
        logs.append(whole * bounds.inverse_mass(angles, radius))
    with np.errstate(over="ignore"):
        tails = [np.exp(log) * radius**-_ORDER / (radius - 1.0) for log, radius in zip(logs[1:], _RADII, strict=True)]
    # additions and products for one coefficient of the series, those of the cosines and of the step included; the k-th
    # coefficient has k times their error, and the sum of k times the majorant's coefficients is its slope. The inverse
    # mass is a recursion over the coefficients too, of as many operations
    operations = 2 * modes + 2 * _ORDER + 13 * int(max(bounds.turns, default=1)) + len(bounds.turns) + 30
    operations *= 2 if bounds.oscillates.any() else 1
    slope = h * (bounds.still + (np.exp(angles) @ bounds.swings if len(angles) else 0.0))
    slope = slope * bounds.inverse_mass(angles, 1.0)
    by_mass = bounds.condition * slope * np.exp(logs[0])
    rounding = operations * _ROUNDING * slope * np.exp(logs[0]) + (_ORDER + 1) * _ROUNDING * np.exp(logs[0])
    return np.asarray(_ENLARGED * (np.min(tails, axis=0) + rounding + spread * by_mass)), _ENLARGED * by_mass


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


def _decided(centres: NDArray[np.complex128], radii: Array, paired: bool) -> NDArray[np.int8]:
    size = centres.shape[1]
    modulus, own = np.abs(centres), np.eye(size, dtype=bool)
    distance = np.abs(centres[:, :, None] - centres[:, None, :])
    meet = (distance <= radii[:, :, None] + radii[:, None, :]) | own
    for _ in range(int(np.ceil(np.log2(size))) + 1):
        meet = meet @ meet  # groups of discs that meet
    outside = modulus - radii > 1.0
    unstable = (outside & ~(meet & ~outside[:, None, :]).any(axis=2)).any(axis=1)
    stable = (modulus + radii < 1.0).all(axis=1)
    if paired:
        inner = modulus * (modulus - radii)
        image = (
            np.where(inner > 0, radii / np.where(inner > 0, inner, 1.0), np.inf) + np.abs(1.0 - modulus**2) / modulus
        )
        image = _ENLARGED * np.maximum(image + 4 * _ROUNDING, radii)
        alone = (distance > image[:, :, None] + radii[:, None, :]) | own
        stable |= alone.all(axis=(1, 2)) & np.isfinite(radii).all(axis=1)
    return np.where(unstable, UNSTABLE, np.where(stable, STABLE, UNDECIDED)).astype(np.int8)
