"""Taylor series of equations of second order with periodic coefficients, many systems at once.

The equations are those of :mod:`cra_sym.solvers.periodic`. Each step of a period is a Taylor series, whose coefficients
are sums over those of the cosines. All systems take the same number of steps per period, so the latter are the same for
all.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cra_sym.solvers.floquet import Oscillation
from cra_sym.solvers.periodic_systems import PeriodicSystem, Swing

__all__ = [
    "LEAST_ORDER",
    "SHARE",
    "factors",
    "mass_and_inverse",
    "mass_at_step",
    "propagated",
    "step_coefficients",
    "swing_coefficients",
]

Array = NDArray[np.float64]
LEAST_ORDER = 6
SHARE = 1e-4
"""Coefficients of cosines below this share of the tolerance are left out; their sum is far below the tolerance."""


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


def swing_coefficients(swing: Swing, step: int, steps: int, order: int, least: float = 0.0) -> Array:
    r"""Return the coefficients of an oscillation w, or, shape (order + 1, points), of :math:`w / (1 + \lambda s w)`.

    That with a compliance, s being the size.
    """
    wave = step_coefficients(swing.oscillation, step, steps, order, least)
    if swing.compliance is None:
        return wave
    soft = swing.compliance * swing.size
    found = np.zeros((order + 1, soft.size))
    for k in range(order + 1):
        here = wave[1 : k + 1, None]
        found[k] = (wave[k] if k < len(wave) else 0.0) - soft * (here * found[k - len(here) : k][::-1]).sum(axis=0)
        found[k] /= 1.0 + soft * wave[0]
    return found


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
        self.known = LEAST_ORDER  # terms that the last step took
        size, points = len(system.stiffness), system.period.size
        self.shape = (size, 2 * size, points)
        self.forces, self.momenta = (
            [_Product(factors(*pair, factored), order, self.shape) for pair in pairs]
            for pairs in (
                [(s.stiffness, s.damping) for s in system.swings],
                [(s.momentum, s.mass) for s in system.swings],
            )
        )
        self.still = _Beside(system.stiffness, system.damping if system.damping.any() else None)

    def advanced(self, step: int, state: Array) -> Array:
        """Return the state (q, p) at the end of a step."""
        size, least = len(self.system.stiffness), SHARE * self.tolerance
        waves = [swing_coefficients(s, step, self.steps, self.order, least) for s in self.system.swings]
        terms = [(wave, swing.size) for wave, swing in zip(waves, self.system.swings, strict=True)]
        found = mass_and_inverse(self.system, waves)
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
                with np.errstate(all="ignore"):
                    sizes.append(np.sqrt((self._columns(z) / start).max()))
                if self._is_last(sizes):
                    break
        self.known = max(LEAST_ORDER, k + 1)
        return end

    def _columns(self, z: Array) -> Array:
        """Return the squares of the columns' norms, displacements in units of momenta, shape (2N, points)."""
        size = len(self.system.stiffness)
        with np.errstate(all="ignore"):  # what overflows takes all terms
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
        if wave.ndim > 1:
            found = np.einsum("kp,krcp->rcp", wave[:count][::-1], part)
        else:  # BLAS takes no vector that runs backwards
            found = (wave[:count][::-1].copy() @ part.reshape(count, -1)).reshape(part.shape[1:])
        found *= size
        out += found if self.left is None else _applied(self.left, found)


def factors(
    of_q: Array | None, of_u: Array | None, wanted: bool = True
) -> tuple[Array | None, Array | None, Array | None]:
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


def mass_and_inverse(system: PeriodicSystem, waves: list[Array]) -> tuple[Array, Array] | None:
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


def mass_at_step(system: PeriodicSystem, step: int, steps: int) -> tuple[Array, Array] | None:
    """Return the mass at the start of a step of a period, as the series use it, and its inverse, or None."""
    return mass_and_inverse(system, [step_coefficients(s.oscillation, step, steps, 0) for s in system.swings])


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
