r"""Monodromy matrices of any equations of second order with periodic coefficients, many systems at once.

.. math:: \frac{d}{dt}\Bigl(\dot q + \sum_r g_r (M_r\dot q + B_r q)\Bigr) + \Bigl(C + \sum_r g_r C_r\Bigr)\dot q
          + \Bigl(K + \sum_r g_r K_r\Bigr) q = 0

with :math:`g_r = s_r / (1 + \lambda_r s_r)` and :math:`s_r` epsilon times a cosine or sine of a multiple of
:math:`\varpi t`; :math:`\lambda_r` is nonzero only for the static correction of omitted modes. The state is q and the
momentum p under the derivative by time. The method is that of :mod:`cra_sym.solvers.taylor`.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from cra_sym.solvers.floquet import (
    MOST_STEPS,
    both_of_pairs,
    exponents_of,
    growth_of,
    multipliers_of,
    paired_exponents,
    rate_of,
    whole_period,
)
from cra_sym.solvers.periodic_systems import LIGHTEST, PeriodicSystem, Sizes, Swing
from cra_sym.solvers.taylor import LEAST_ORDER, propagated
from cra_sym.solvers.taylor_operations import Loop, Operations

__all__ = [
    "PeriodicSystem",
    "Swing",
    "floquet_exponents",
    "growth_rate",
    "monodromy",
]

Array = NDArray[np.float64]
_HIGHEST = 24
"""Order of the series, at most."""
_SHARP, _DOUBT = 1e-13, 10.0  # tolerance where multipliers come in pairs; error of the maps, over the tolerance
_WIDEST = 3.0  # largest step, in units of the fastest motion's time; beyond it the terms of the series lose digits
_PRODUCTS = 31  # cost of the matrix products of one term, in units of half a term of a product of series
_SWUNG = 4  # weight of what oscillates against the angle in a period, in the choice of systems that are alike
_STATES = 14_000  # numbers in the states propagated together: fewer cost more calls, more leave the cache


class _Maps(NamedTuple):
    """Maps of (q, p) over the period, or over its first half where `parity` gives the second."""

    system: PeriodicSystem
    axes: Array | None
    parity: NDArray[np.int8] | None
    maps: Array

    def whole(self) -> Array:
        """Return the maps over the period."""
        if self.parity is None:
            return self.maps
        return whole_period(self.maps, np.moveaxis(self.system.damping, -1, 0), self.parity)

    def canonical(self) -> Array:
        """Return the maps for canonical momenta; where signs change, coordinates and momenta change places."""
        assert self.parity is not None
        n, place, found = len(self.parity), np.arange(len(self.parity)), self.maps
        if self.system.damping.any():
            half = 0.5 * np.moveaxis(self.system.damping, -1, 0)
            lower = found[:, n:] + half @ found[:, :n]
            found = np.concatenate([found[:, :n], lower], axis=1)
            found[:, :, :n] -= found[:, :, n:] @ half
        if (self.parity < 0).any():  # (q, p) becomes (p, -q)
            index = np.concatenate([np.where(self.parity * sign > 0, place, n + place) for sign in (1, -1)])
            signs = np.concatenate([np.ones(n), self.parity])
            found = found[:, index[:, None], index] * (signs[:, None] * signs)
        return found


def _maps(system: PeriodicSystem, tolerance: float, loop: Loop | None) -> _Maps:
    """Return the maps, for a relative error of about ``tolerance``, in axes that make oscillating masses diagonal."""
    parity = system.parity()
    system, axes = system.in_axes_of_mass(parity)
    rate, size, points = system.rate(), 2 * len(system.stiffness), system.period.size
    out = np.empty((points, size, size))
    angle, swung = system.period * rate, rate / system.rate(still=True)
    measures = np.array([np.log(angle), _SWUNG * np.log(swung)])
    blocks = _alike(np.arange(points), measures, max(1, 2 * _STATES // size**2)) if points else []
    series = _majorants(system, rate, blocks).T if points else ()
    operations = Operations(system, loop) if loop is not None and points else None
    half = parity is not None
    for block, logs in zip(blocks, series, strict=True):
        steps, order = _cheapest(logs, tolerance)
        if operations is not None:
            out[block] = operations.maps(block, rate[block], steps, order, tolerance, half=half)
            continue
        states = propagated(system.take(block), steps, order, half=half, tolerance=tolerance, factored=True)
        with np.errstate(over="ignore", invalid="ignore"):
            out[block] = np.moveaxis(deque(states, maxlen=1)[0], -1, 0)
    return _Maps(system, axes, parity, _finite(out, half=half))


def _finite(maps: Array, *, half: bool = False) -> Array:
    """Return the maps, or raise an error if some motions overflow; from half of a period their squares are needed."""
    largest = np.finfo(float).max
    if not (np.abs(maps) < (np.sqrt(largest) / maps.shape[-1] if half else largest)).all():
        raise ValueError(
            "epsilon: some motions grow beyond 1e308 within a period of the excitation; must be smaller, or "
            "angular_frequency higher"
        )
    return maps


def _alike(index: NDArray[np.intp], measures: Array, most: int) -> list[NDArray[np.intp]]:
    """Return the systems in blocks of similar measures: halves by the one that differs most, until they are blocks."""
    if index.size <= most:
        return [index]
    given = measures[:, index]
    index = index[np.argsort(given[np.argmax(np.ptp(given, axis=1))], kind="stable")]
    half = most * (-(-index.size // most) // 2)
    return _alike(index[:half], measures, most) + _alike(index[half:], measures, most)


def monodromy(system: PeriodicSystem, tolerance: float = 1e-10, loop: Loop | None = None) -> Array:
    """Return the monodromy matrices of (q, p), shape (points, 2N, 2N), for a relative error of about ``tolerance``."""
    found = _maps(system, tolerance, loop)
    if found.axes is None:
        return found.whole()
    turn = np.kron(np.eye(2), found.axes)
    return np.asarray(turn @ found.whole() @ turn.T)


def _majorants(system: PeriodicSystem, rate: Array, blocks: Sequence[NDArray[np.intp]]) -> Array:
    """Return bounds of the Taylor coefficients of all motions, the time in periods, as logarithms.

    They are the Taylor coefficients of the scalar equations with norms in place of matrices, and with exponentials in
    place of cosines; for masses hyperbolic cosines, since the inverse of the mass is not an entire function. Shape
    (highest order + 2, blocks).
    """
    sizes = system.sizes()
    largest = Sizes(
        *(np.stack([part[:, block].max(axis=1, initial=0.0) for block in blocks], axis=-1) for part in sizes)
    )
    period = np.array([system.period[block].max() for block in blocks])
    unit = period * np.array([rate[block].max() for block in blocks])  # of time: angles
    count = _HIGHEST + 2
    k = np.arange(count)
    factorials = np.cumprod(np.concatenate([[1.0], k[1:]]))
    turns = np.array([s.oscillation.order for s in system.swings]).reshape(-1, 1)
    waves = (2 * np.pi * turns / unit) ** k[:, None, None] / factorials[:, None, None]

    def series(rows: Array, still: Any = 0.0, waves: Array = waves) -> Array:
        found = np.einsum("krb,rb->kb", waves, rows)
        found[0] += still
        return np.asarray(found)

    inverse = 1.0 / np.maximum(1.0 - largest.mass.sum(axis=0), LIGHTEST)
    stiffness = series(largest.stiffness, largest.still[0], _softened(waves, largest.softness)) * (period / unit) ** 2
    damping = series(largest.damping, largest.still[1]) * period / unit
    momentum = series(largest.momentum) * period / unit
    even = np.where(k[:, None, None] % 2 == 0, waves, 0.0)
    mass = series(largest.mass, waves=even)
    scale = np.sqrt(np.maximum(stiffness[0], np.finfo(float).tiny) / inverse)
    q, u, p = np.ones((3, count, len(blocks)))
    for n in range(count - 1):
        u[n] = p[n] + (momentum[: n + 1] * q[n::-1]).sum(axis=0) / scale
        if n:
            u[n] += (mass[1 : n + 1] * u[n - 1 :: -1]).sum(axis=0)
        u[n] *= inverse
        pushed = (stiffness[: n + 1] * q[n::-1]).sum(axis=0) / scale + (damping[: n + 1] * u[n::-1]).sum(axis=0)
        q[n + 1], p[n + 1] = scale * u[n] / (n + 1), pushed / (n + 1)
    return np.asarray(np.log(np.maximum(np.maximum(q, p), np.finfo(float).tiny)) + k[:, None] * np.log(unit))


def _softened(waves: Array, softness: Array) -> Array:
    """Return bounds of the coefficients of oscillations in series with a flexibility, shape (orders, R, blocks).

    That makes a fraction, which is not an entire function: hyperbolic cosines bound its denominator, as for masses.
    """
    if not softness.any():
        return waves
    found = np.array(np.broadcast_to(waves, (len(waves), *softness.shape)))
    least = np.maximum(1.0 - softness, LIGHTEST)
    for k in range(len(waves)):
        for j in range(2, k + 1, 2):
            found[k] += softness * waves[j] * found[k - j]
        found[k] /= least
    return found


def _cheapest(series: Array, tolerance: float) -> tuple[int, int]:
    """Return an even number of steps a period and the order of their series that reach the tolerance at least cost.

    The error of a series truncated after order n is the coefficient n + 1 times ``h**(n + 1)`` per step.
    """
    orders = np.arange(LEAST_ORDER, _HIGHEST + 1)
    angle = np.exp(series[1])
    logs = series[orders + 1] - np.log(tolerance)
    with np.errstate(over="ignore"):
        steps = 2 * np.ceil(np.maximum(np.exp(logs / orders), angle / _WIDEST) / 2)
    cost = steps * orders * (_PRODUCTS + orders)
    best = int(np.argmin(cost))
    if not steps[best] <= MOST_STEPS:
        raise ValueError(
            f"a period takes {steps[best]:.2g} steps, must be at most {MOST_STEPS:g}: the excitation is too slow "
            "against the fastest mode, or too strong"
        )
    return int(steps[best]), int(orders[best])


class _Growth(NamedTuple):
    """What exponents follow from: one of each pair, or the monodromy matrices, and their error if there are pairs."""

    pairs: Array | None
    maps: Array
    error: float | None


def _growth(system: PeriodicSystem, tolerance: float, loop: Loop | None) -> _Growth:
    conservative = system.conservative
    if conservative and system.parity() is not None:
        found = _maps(system, tolerance, loop)
        return _Growth(paired_exponents(found.canonical(), system.period), found.maps, None)
    if conservative or system.reversible:
        tolerance = min(tolerance, _SHARP)
        return _Growth(None, _maps(system, tolerance, loop).whole(), _DOUBT * tolerance)
    return _Growth(None, _maps(system, tolerance, loop).whole(), None)


def growth_rate(*given: Any, tolerance: float = 1e-10, loop: Loop | None = None) -> Array:
    """Return max(0, largest real part of the exponents), shape (...); arguments of :meth:`PeriodicSystem.of`."""
    system, shape = PeriodicSystem.of(*given)
    pairs, maps, error = _growth(system, tolerance, loop)
    if pairs is not None:
        return growth_of(pairs).reshape(shape)
    damped = error is None and bool(np.einsum("iip->p", system.damping).any())
    return rate_of(maps, system.period, damped=damped, error=error).reshape(shape)


def floquet_exponents(*given: Any, tolerance: float = 1e-10, loop: Loop | None = None) -> NDArray[np.complex128]:
    """Return all Floquet exponents, shape (..., 2N), largest real part first; arguments as :func:`growth_rate`."""
    system, shape = PeriodicSystem.of(*given)
    pairs, maps, error = _growth(system, tolerance, loop)
    if pairs is None:
        exponents = exponents_of(multipliers_of(maps, error), system.period)
    else:
        exponents = both_of_pairs(pairs, system.period)
    return exponents.reshape(*shape, exponents.shape[-1])
