r"""Monodromy matrices of any equations of second order with periodic coefficients, many systems at once.

.. math:: \frac{d}{dt}\Bigl(\dot q + \sum_r g_r (M_r\dot q + B_r q)\Bigr) + \Bigl(C + \sum_r g_r C_r\Bigr)\dot q
          + \Bigl(K + \sum_r g_r K_r\Bigr) q = 0

with :math:`g_r` epsilon times a cosine or sine of a multiple of :math:`\varpi t`. The state is q and the momentum p
under the derivative by time. Each step is a Taylor series, whose coefficients are sums over those of the cosines. All
systems take the same number of steps per period, so the latter are the same for all.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cra_sym.solvers.floquet import MOST_STEPS, Oscillation, exponents_of, rate_of, whole_period
from cra_sym.solvers.periodic_systems import LIGHTEST, PeriodicSystem, Sizes, Swing

__all__ = [
    "PeriodicSystem",
    "Swing",
    "floquet_exponents",
    "growth_rate",
    "mass_and_inverse",
    "monodromy",
    "step_coefficients",
]

Array = NDArray[np.float64]
_HIGHEST = 24
"""Order of the series, at most."""
_WIDEST = 3.0  # largest step, in units of the fastest motion's time; beyond it the terms of the series lose digits
_SHARE = 1e-4
"""Coefficients of cosines below this share of the tolerance are left out; their sum is far below the tolerance."""
_PRODUCTS = 31  # cost of the matrix products of one term, in units of half a term of a product of series
_BLOCK = 384  # systems propagated together, small enough for the cache


def _applied(matrix: Array, states: Array) -> Array:
    """Return matrix times states, (N, N, points or 1) times (N, columns, points)."""
    if matrix.shape[-1] == 1:
        return np.asarray((matrix[..., 0] @ states.reshape(len(states), -1)).reshape(len(matrix), *states.shape[1:]))
    return np.asarray(np.einsum("ijp,jkp->ikp", matrix, states))


def step_coefficients(wave: Oscillation, step: int, steps: int, order: int, least: float = 0.0) -> Array:
    """Return the Taylor coefficients of a cosine or sine over one step of a period, as a function of 0 <= tau <= 1.

    Without those at the end that are below ``least``.
    """
    turn = 2 * np.pi * wave.order / steps
    phase = turn * step + (0.0 if wave.kind == "cos" else -np.pi / 2)
    k = np.arange(order + 1)
    factors = np.cumprod(np.concatenate([[1.0], turn / k[1:]]))
    k = k[: np.nonzero(factors >= least)[0][-1] + 1]
    factors = factors[: len(k)]
    return np.asarray(np.array([np.cos(phase), -np.sin(phase), -np.cos(phase), np.sin(phase)])[k % 4] * factors)


class _Series:
    """Taylor coefficients of q, dq/dtau and p over one step, by recursion.

    The terms of one oscillation add K_r q + C_r u to the forces and B_r q + M_r u to the momenta, with u = dq/dt: one
    product of series each.
    """

    def __init__(self, system: PeriodicSystem, steps: int, order: int, least: float) -> None:
        self.system, self.h, self.order = system, system.period / steps, order
        self.steps, self.least = steps, least
        size, points = len(system.stiffness), system.period.size
        self.shape = (size, 2 * size, points)
        swings = system.swings
        pushes = [s.stiffness is not None or s.damping is not None for s in swings]
        carries = [s.momentum is not None or s.mass is not None for s in swings]
        store = (order + 1, *self.shape)
        self.forces = [np.empty(store) if there else None for there in pushes]
        self.momenta = [np.empty(store) if there else None for there in carries]
        # all products with q are one product, those with u another
        own = system.damping if system.damping.any() else None
        self.of_q = _Stack([system.stiffness, *(s.stiffness for s in swings), *(s.momentum for s in swings)])
        self.of_u = _Stack([own, *(s.damping for s in swings), *(s.mass for s in swings)])

    def advanced(self, step: int, q: Array, p: Array) -> tuple[Array, Array]:
        """Return the state at the end of a step."""
        waves = [
            step_coefficients(swing.oscillation, step, self.steps, self.order, self.least)
            for swing in self.system.swings
        ]
        found = _mass_and_inverse(self.system, waves)
        mass = None if found is None else found[1]
        if found is not None and _is_diagonal(found[0]):
            mass = np.einsum("iip->ip", found[1])[:, None]
        end_q, end_p, p = q.copy(), p.copy(), p.copy()
        for k in range(self.order):
            rate, resistance = self._rates(k, q, p, waves, mass)
            step_size = self.h / (k + 1)
            q, p = np.multiply(rate, step_size, out=rate), np.multiply(resistance, -step_size, out=resistance)
            end_q += q
            end_p += p
        return end_q, end_p

    def _rates(self, k: int, q: Array, p: Array, waves: list[Array], mass: Array | None) -> tuple[Array, Array]:
        """Return the coefficients k of dq/dt and of -dp/dt."""
        number = len(self.system.swings)
        of_q = self.of_q(q)
        rate, resistance = p, of_q[0]
        assert resistance is not None
        for r, kept in enumerate(self.momenta):
            if kept is not None:
                of_both = of_q[1 + number + r]
                kept[k] = 0.0 if of_both is None else of_both
                rate -= self._weighed(r, waves[r], kept, k)
        if mass is not None:
            rate = np.multiply(rate, mass, out=rate) if mass.shape[1] == 1 else _applied(mass, rate)
        of_u = self.of_u(rate)
        if of_u[0] is not None:
            resistance += of_u[0]
        for r, kept in enumerate(self.momenta):
            if kept is not None and (carried := of_u[1 + number + r]) is not None:
                kept[k] += carried
        for r, kept in enumerate(self.forces):
            if kept is not None:
                parts = [part for part in (of_q[1 + r], of_u[1 + r]) if part is not None]
                kept[k] = parts[0] if len(parts) == 1 else np.add(*parts)
                resistance += self._weighed(r, waves[r], kept, k)
        return rate, resistance

    def _weighed(self, swing: int, wave: Array, kept: Array, k: int) -> Array:
        """Return the coefficient k of the product of an oscillation and a series."""
        length = min(k + 1, len(wave))
        found = wave[length - 1 :: -1] @ kept[k + 1 - length : k + 1].reshape(length, -1)
        found = found.reshape(self.shape)
        return np.multiply(found, self.system.swings[swing].size, out=found)


def _mass_and_inverse(system: PeriodicSystem, waves: list[Array]) -> tuple[Array, Array] | None:
    """Return the mass at the start of a step and its inverse, (N, N, points) each; None if it does not oscillate."""
    swings = zip(system.swings, waves, strict=True)
    terms = [s.mass * (s.size * wave[0]) for s, wave in swings if s.mass is not None]
    if not terms:
        return None
    mass = np.eye(len(system.stiffness))[..., None] + sum(terms)
    if _is_diagonal(mass):
        inverse = np.zeros_like(mass)
        np.einsum("iip->ip", inverse)[:] = 1.0 / np.einsum("iip->ip", mass)
        return mass, inverse
    return mass, np.moveaxis(np.linalg.inv(np.moveaxis(mass, -1, 0)), 0, -1)


def mass_and_inverse(system: PeriodicSystem, step: int, steps: int) -> tuple[Array, Array] | None:
    """Return the mass at the start of a step of a period, as the series use it, and its inverse, or None."""
    return _mass_and_inverse(system, [step_coefficients(s.oscillation, step, steps, 0) for s in system.swings])


class _Stack:
    """Several matrices, some of them None, applied to a state in one product."""

    def __init__(self, matrices: Sequence[Array | None]) -> None:
        there = [matrix for matrix in matrices if matrix is not None]
        self.there = [matrix is not None for matrix in matrices]
        if there:
            points = max(matrix.shape[-1] for matrix in there)
            self.whole = np.concatenate([np.broadcast_to(m, (*m.shape[:2], points)) for m in there])

    def __call__(self, states: Array) -> list[Array | None]:
        """Return the products, None for None."""
        if not any(self.there):
            return [None] * len(self.there)
        parts = iter(_applied(self.whole, states).reshape(-1, *states.shape))
        return [next(parts) if there else None for there in self.there]


def _is_diagonal(matrix: Array) -> bool:
    return not matrix[~np.eye(len(matrix), dtype=bool)].any()


def propagated(
    system: PeriodicSystem, steps: int, order: int, *, half: bool = False, least: float = 0.0
) -> Iterator[tuple[Array, Array]]:
    """Yield (q, p), shape (N, 2N, points), after every step of a period, or of half of it, from every unit state.

    Coefficients of cosines below ``least`` are left out.
    """
    series = _Series(system, steps, order, least)
    q, p = (
        np.ascontiguousarray(np.broadcast_to(half[..., None], series.shape))
        for half in np.split(np.eye(series.shape[1]), 2)
    )
    for step in range(steps // 2 if half else steps):
        q, p = series.advanced(step, q, p)
        yield q, p


def monodromy(system: PeriodicSystem, tolerance: float = 1e-8) -> Array:
    """Return the monodromy matrices of (q, p), shape (points, 2N, 2N), for a relative error of about ``tolerance``."""
    parity, damping = system.parity(), system.damping
    system, axes = system.in_axes_of_mass()
    angle = system.period * system.rate()
    size, points = 2 * len(system.stiffness), system.period.size
    out = np.empty((points, size, size))
    if not points:
        return out
    rank = np.argsort(angle, kind="stable")
    blocks = [rank[start : start + _BLOCK] for start in range(0, points, _BLOCK)]
    for block, series in zip(blocks, _majorants(system, blocks).T, strict=True):
        steps, order = _cheapest(series, tolerance)
        states = propagated(system.take(block), steps, order, half=parity is not None, least=_SHARE * tolerance)
        end = deque(states, maxlen=1)
        out[block] = np.moveaxis(np.concatenate(end[0]), -1, 0)
    if axes is not None:
        turn = np.kron(np.eye(2), axes)
        out = turn @ out @ turn.T
    return out if parity is None else whole_period(out, np.moveaxis(damping, -1, 0), parity)


def _majorants(system: PeriodicSystem, blocks: Sequence[NDArray[np.intp]]) -> Array:
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
    unit = period * np.array([system.rate()[block].max() for block in blocks])  # of time: angles
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
    stiffness = series(largest.stiffness, largest.still[0]) * (period / unit) ** 2
    damping = series(largest.damping, largest.still[1]) * period / unit
    momentum = series(largest.momentum) * period / unit
    mass = series(largest.mass, waves=np.where(k[:, None, None] % 2 == 0, waves, 0.0))
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


def _cheapest(series: Array, tolerance: float) -> tuple[int, int]:
    """Return an even number of steps a period and the order of their series that reach the tolerance at least cost.

    The error of a series truncated after order n is the coefficient n + 1 times ``h**(n + 1)`` per step.
    """
    orders = np.arange(6, _HIGHEST + 1)
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


def growth_rate(*given: Any, tolerance: float = 1e-8) -> Array:
    """Return max(0, largest real part of the exponents), shape (...); arguments of :meth:`PeriodicSystem.of`."""
    system, shape = PeriodicSystem.of(*given)
    return rate_of(monodromy(system, tolerance), system.period).reshape(shape)


def floquet_exponents(*given: Any, tolerance: float = 1e-8) -> NDArray[np.complex128]:
    """Return all Floquet exponents, shape (..., 2N), largest real part first; arguments as :func:`growth_rate`."""
    system, shape = PeriodicSystem.of(*given)
    exponents = exponents_of(monodromy(system, tolerance), system.period)
    return exponents.reshape(*shape, exponents.shape[-1])
