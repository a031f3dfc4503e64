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
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from cra_sym.solvers.floquet import (
    MOST_STEPS,
    Oscillation,
    both_of_pairs,
    exponents_of,
    growth_of,
    paired_exponents,
    rate_of,
    whole_period,
)
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
_LEAST_ORDER = 6
_SHARE = 1e-4
"""Coefficients of cosines below this share of the tolerance are left out; their sum is far below the tolerance."""
_PRODUCTS = 31  # cost of the matrix products of one term, in units of half a term of a product of series
_SWUNG = 4  # weight of what oscillates against the angle in a period, in the choice of systems that are alike
_BLOCK = 768  # systems propagated together: fewer cost more calls, more leave the cache


def _applied(matrix: Array, states: Array, out: Array | None = None) -> Array:
    """Return matrix times states, (N, M, points or 1) times (M, columns, points)."""
    if matrix.shape[-1] > 1:
        return np.asarray(np.einsum("ijp,jkp->ikp", matrix, states, out=out))
    flat = None if out is None else out.reshape(len(out), -1)
    found = np.matmul(matrix[..., 0], states.reshape(len(states), -1), out=flat)
    return np.asarray(found.reshape(len(matrix), *states.shape[1:]))


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
    product of series each, of as many rows as these matrices have ranks together. A step ends before ``order`` where
    the next coefficient is expected below the tolerance, for each column of the state relative to the column.
    """

    def __init__(self, system: PeriodicSystem, steps: int, order: int, tolerance: float, factored: bool) -> None:
        self.system, self.h, self.order, self.steps = system, system.period / steps, order, steps
        self.tolerance, self.rate = tolerance, system.rate()
        self.fractions = self.h / np.arange(1, order + 1)[:, None]
        self.known = _LEAST_ORDER  # terms that the last step took
        size, points = len(system.stiffness), system.period.size
        self.shape = (size, 2 * size, points)
        self.forces, self.momenta = (
            [_Product(_factors(*pair, factored), order, self.shape) for pair in pairs]
            for pairs in (
                [(s.stiffness, s.damping) for s in system.swings],
                [(s.momentum, s.mass) for s in system.swings],
            )
        )
        self.still = _Beside(system.stiffness, system.damping if system.damping.any() else None)

    def advanced(self, step: int, state: Array) -> Array:
        """Return the state (q, p) at the end of a step."""
        size, least = len(self.system.stiffness), _SHARE * self.tolerance
        waves = [step_coefficients(s.oscillation, step, self.steps, self.order, least) for s in self.system.swings]
        terms = [(wave, swing.size) for wave, swing in zip(waves, self.system.swings, strict=True)]
        found = _mass_and_inverse(self.system, waves)
        mass = None if found is None else found[1]
        if found is not None and _is_diagonal(found[0]):
            mass = np.einsum("iip->ip", found[1])[:, None]
        end, z = state.copy(), state.copy()
        q, u = z[:size], z[size:]  # the coefficient k of p, then of u
        start, sizes = self._columns(z), deque[float](maxlen=3)
        for k, fraction in enumerate(self.fractions):
            for product, (wave, swing) in zip(self.momenta, terms, strict=True):
                if product.keep(k, z, of_u=False):
                    product.add(u, k, wave, -swing)
                elif k:
                    product.add(u, k - 1, wave[1:], -swing)
            if mass is not None and mass.shape[1] == 1:
                u *= mass
            elif mass is not None:
                u[:] = _applied(mass, u)
            resistance = self.still(z)
            for product, (wave, swing) in zip(self.forces, terms, strict=True):
                if product.keep(k, z):
                    product.add(resistance, k, wave, swing)
            for product in self.momenta:
                product.keep(k, z)
            np.multiply(u, fraction, out=q)
            np.multiply(resistance, -fraction, out=u)
            end += z
            if self.tolerance and k + 4 >= self.known:
                with np.errstate(all="ignore"):  # what overflows takes all terms
                    sizes.append(np.sqrt((self._columns(z) / start).max()))
                if self._is_last(sizes):
                    break
        self.known = max(_LEAST_ORDER, k + 1)
        return end

    def _columns(self, z: Array) -> Array:
        """Return the squares of the columns' norms, displacements in units of momenta, shape (2N, points)."""
        size = len(self.system.stiffness)
        q, p = (np.einsum("ijp,ijp->jp", part, part) for part in (z[:size], z[size:]))
        q *= self.rate**2
        q += p
        return np.asarray(q)

    def _is_last(self, sizes: Sequence[float]) -> bool:
        """Whether the next coefficient is expected below the tolerance; every second one may be small."""
        if len(sizes) < 3 or not sizes[-1] < sizes[0]:
            return len(sizes) == 3 and sizes[-1] == 0.0
        return bool(sizes[-1] * np.sqrt(sizes[-1] / sizes[0]) <= self.tolerance / self.steps)


class _Beside:
    """Matrices of q and of u, at least one of them, applied to both at once; or None."""

    def __init__(self, of_q: Array | None, of_u: Array | None) -> None:
        self.columns, self.matrix = slice(None), of_q
        there = [matrix for matrix in (of_q, of_u) if matrix is not None]
        if of_u is not None and of_q is not None:
            points = max(matrix.shape[-1] for matrix in there)
            self.matrix = np.concatenate([np.broadcast_to(m, (*m.shape[:2], points)) for m in there], axis=1)
        elif there:
            size = there[0].shape[1]
            self.matrix, self.columns = there[0], slice(size) if of_u is None else slice(size, None)

    def __call__(self, z: Array, out: Array | None = None) -> Array:
        """Return the product."""
        assert self.matrix is not None
        return _applied(self.matrix, z[self.columns], out)


class _Product:
    """Product of an oscillation and the series of a left factor times rows, which are kept."""

    def __init__(self, factors: tuple[Array | None, Array | None, Array | None], order: int, shape: Any) -> None:
        self.left, of_q, of_u = factors
        self.both, self.of_q = _Beside(of_q, of_u), _Beside(of_q, None)
        rows = 0 if self.both.matrix is None else len(self.both.matrix)
        self.rows = np.empty((order if rows else 0, rows, *shape[1:]))

    def keep(self, k: int, z: Array, *, of_u: bool = True) -> bool:
        """Set the coefficient k of the rows, without what u adds if told; tell whether there is any."""
        used = self.both if of_u else self.of_q
        if used.matrix is not None:
            used(z, self.rows[k])
        return used.matrix is not None

    def add(self, out: Array, last: int, wave: Array, size: Array) -> None:
        """Add ``size`` times the sum of rows to ``out``, the row ``last`` times the first coefficient of the wave."""
        if not len(self.rows):
            return
        count = min(last + 1, len(wave))
        part = self.rows[last + 1 - count : last + 1]
        # BLAS takes no vector that runs backwards
        found = (wave[:count][::-1].copy() @ part.reshape(count, -1)).reshape(part.shape[1:])
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


def _is_diagonal(matrix: Array) -> bool:
    return not matrix[~np.eye(len(matrix), dtype=bool)].any()


def propagated(
    system: PeriodicSystem,
    steps: int,
    order: int,
    *,
    half: bool = False,
    tolerance: float = 0.0,
    factored: bool = False,
) -> Iterator[Array]:
    """Yield (q, p), shape (2N, 2N, points), after every step of a period, or of half of it, from every unit state.

    All steps have ``order`` terms, or with a tolerance as many as it takes. With ``factored``, oscillating matrices of
    low rank are factored, which takes less time; the rounding of the factors is not that of the given matrices.
    """
    series = _Series(system, steps, order, tolerance, factored)
    size = series.shape[1]
    state = np.ascontiguousarray(np.broadcast_to(np.eye(size)[..., None], (size, *series.shape[1:])))
    for step in range(steps // 2 if half else steps):
        state = series.advanced(step, state)
        yield state


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


def _maps(system: PeriodicSystem, tolerance: float) -> _Maps:
    """Return the maps, for a relative error of about ``tolerance``, in axes that make oscillating masses diagonal."""
    parity = system.parity()
    system, axes = system.in_axes_of_mass(parity)
    rate, size, points = system.rate(), 2 * len(system.stiffness), system.period.size
    out = np.empty((points, size, size))
    angle, swung = system.period * rate, rate / system.rate(still=True)
    blocks = _alike(np.arange(points), np.array([np.log(angle), _SWUNG * np.log(swung)])) if points else []
    series = _majorants(system, rate, blocks).T if points else ()
    for block, logs in zip(blocks, series, strict=True):
        steps, order = _cheapest(logs, tolerance)
        half = parity is not None
        states = propagated(system.take(block), steps, order, half=half, tolerance=tolerance, factored=True)
        out[block] = np.moveaxis(deque(states, maxlen=1)[0], -1, 0)
    return _Maps(system, axes, parity, out)


def _alike(index: NDArray[np.intp], measures: Array) -> list[NDArray[np.intp]]:
    """Return the systems in blocks of similar measures: halves by the one that differs most, until they are blocks."""
    if index.size <= _BLOCK:
        return [index]
    given = measures[:, index]
    index = index[np.argsort(given[np.argmax(np.ptp(given, axis=1))], kind="stable")]
    half = _BLOCK * (-(-index.size // _BLOCK) // 2)
    return _alike(index[:half], measures) + _alike(index[half:], measures)


def monodromy(system: PeriodicSystem, tolerance: float = 1e-8) -> Array:
    """Return the monodromy matrices of (q, p), shape (points, 2N, 2N), for a relative error of about ``tolerance``."""
    found = _maps(system, tolerance)
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
    orders = np.arange(_LEAST_ORDER, _HIGHEST + 1)
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


def _pairs(system: PeriodicSystem, tolerance: float) -> tuple[Array | None, Array]:
    """Return one exponent of each pair of exponents where they come in pairs, else None, and the monodromy matrices."""
    found = _maps(system, tolerance)
    if found.parity is None or not system.conservative:
        return None, found.whole()
    return paired_exponents(found.canonical(), system.period), found.maps


def growth_rate(*given: Any, tolerance: float = 1e-8) -> Array:
    """Return max(0, largest real part of the exponents), shape (...); arguments of :meth:`PeriodicSystem.of`."""
    system, shape = PeriodicSystem.of(*given)
    growing, maps = _pairs(system, tolerance)
    rates = rate_of(maps, system.period) if growing is None else growth_of(growing)
    return rates.reshape(shape)


def floquet_exponents(*given: Any, tolerance: float = 1e-8) -> NDArray[np.complex128]:
    """Return all Floquet exponents, shape (..., 2N), largest real part first; arguments as :func:`growth_rate`."""
    system, shape = PeriodicSystem.of(*given)
    growing, maps = _pairs(system, tolerance)
    exponents = exponents_of(maps, system.period) if growing is None else both_of_pairs(growing, system.period)
    return exponents.reshape(*shape, exponents.shape[-1])
