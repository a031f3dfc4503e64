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
from itertools import pairwise
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
_BLOCK = 768  # systems propagated together: fewer cost more calls, more leave the cache


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
    product of series each, of as many rows as these matrices have ranks together.
    """

    def __init__(self, system: PeriodicSystem, steps: int, order: int, least: float, factored: bool) -> None:
        self.system, self.h, self.order = system, system.period / steps, order
        self.steps, self.least = steps, least
        size, points = len(system.stiffness), system.period.size
        self.shape = (size, 2 * size, points)
        pushes = [_factors(s.stiffness, s.damping, factored) for s in system.swings]
        carries = [_factors(s.momentum, s.mass, factored) for s in system.swings]
        self.forces = [_Product(*found, order, self.shape) for found in pushes]
        self.momenta = [_Product(*found, order, self.shape) for found in carries]
        # all products with q are one product, those with u another
        own = system.damping if system.damping.any() else None
        self.of_q = _Stack([system.stiffness, *(found[1] for found in (*pushes, *carries))])
        self.of_u = _Stack([own, *(found[2] for found in (*pushes, *carries))])

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
        for product in (*self.forces, *self.momenta):
            product.known = -1
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
        sizes = [swing.size for swing in self.system.swings]
        of_q = self.of_q(q)
        rate, resistance = p, of_q[0]
        assert resistance is not None
        for product, of_both, wave, size in zip(self.momenta, of_q[1 + number :], waves, sizes, strict=True):
            product.keep(k, of_both)
            product.added(rate, k, wave, -size)
        if mass is not None:
            rate = np.multiply(rate, mass, out=rate) if mass.shape[1] == 1 else _applied(mass, rate)
        of_u = self.of_u(rate)
        if of_u[0] is not None:
            resistance += of_u[0]
        for product, carried in zip(self.momenta, of_u[1 + number :], strict=True):
            product.keep(k, carried)
        for r, product in enumerate(self.forces):
            product.keep(k, of_q[1 + r])
            product.keep(k, of_u[1 + r])
            product.added(resistance, k, waves[r], sizes[r])
        return rate, resistance


class _Product:
    """Product of an oscillation and the series of a left factor times rows, which are kept."""

    def __init__(self, left: Array | None, of_q: Array | None, of_u: Array | None, order: int, shape: Any) -> None:
        rows = next((len(matrix) for matrix in (of_q, of_u) if matrix is not None), 0)
        self.left = left
        self.rows = np.empty((order + 1 if rows else 0, rows, *shape[1:]))
        self.known = -1  # the highest coefficient kept in this step

    def keep(self, k: int, row: Array | None) -> None:
        """Add to the coefficient k of the rows."""
        if row is not None:
            if self.known == k:
                self.rows[k] += row
            else:
                self.rows[k] = row
            self.known = k

    def added(self, out: Array, k: int, wave: Array, size: Array) -> None:
        """Add the coefficient k of ``size`` times the product to ``out``, as far as the rows are kept."""
        first = k + 1 - min(k + 1, len(wave))
        last = self.known
        if last < first:
            return
        part = self.rows[first : last + 1]
        found = (wave[k - last : k - first + 1][::-1] @ part.reshape(len(part), -1)).reshape(part.shape[1:])
        found *= size
        out += found if self.left is None else _applied(self.left, found)


def _factors(of_q: Array | None, of_u: Array | None, wanted: bool) -> tuple[Array | None, Array | None, Array | None]:
    """Return a common left factor of two matrices, (N, rank, 1), and what it multiplies; None if unwanted or N."""
    there = [matrix for matrix in (of_q, of_u) if matrix is not None]
    if not wanted or not there or any(m.shape[-1] > 1 or not np.isfinite(m).all() for m in there):
        return None, of_q, of_u
    axes, sizes, _ = np.linalg.svd(np.concatenate(there, axis=1)[..., 0], full_matrices=False)
    left = axes[:, sizes > len(axes) * np.finfo(float).eps * sizes[0]]
    if left.shape[1] == len(axes):
        return None, of_q, of_u
    if not left.size:  # all entries are zero
        return None, None, None
    rows = [None if matrix is None else (left.T @ matrix[..., 0])[..., None] for matrix in (of_q, of_u)]
    return left[..., None], rows[0], rows[1]


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
        ends = np.cumsum([0, *(0 if matrix is None else len(matrix) for matrix in matrices)]).tolist()
        self.rows = [
            None if matrix is None else slice(*pair) for matrix, pair in zip(matrices, pairwise(ends), strict=True)
        ]
        if there:
            points = max(matrix.shape[-1] for matrix in there)
            self.whole = np.concatenate([np.broadcast_to(m, (*m.shape[:2], points)) for m in there])

    def __call__(self, states: Array) -> list[Array | None]:
        """Return the products, None for None."""
        if not any(self.rows):
            return [None] * len(self.rows)
        found = _applied(self.whole, states)
        return [None if rows is None else found[rows] for rows in self.rows]


def _is_diagonal(matrix: Array) -> bool:
    return not matrix[~np.eye(len(matrix), dtype=bool)].any()


def propagated(
    system: PeriodicSystem, steps: int, order: int, *, half: bool = False, least: float = 0.0, factored: bool = False
) -> Iterator[tuple[Array, Array]]:
    """Yield (q, p), shape (N, 2N, points), after every step of a period, or of half of it, from every unit state.

    Coefficients of cosines below ``least`` are left out. With ``factored``, oscillating matrices of low rank are
    factored, which takes less time; the rounding of the factors is not that of the given matrices.
    """
    series = _Series(system, steps, order, least, factored)
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
        some, least = system.take(block), _SHARE * tolerance
        states = propagated(some, steps, order, half=parity is not None, least=least, factored=True)
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
