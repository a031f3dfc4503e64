"""Starts for steady states: rest, all one-mode, one-harmonic solutions, free vibration with several phases."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from cra_sym.analysis.nonlinear import samples
from cra_sym.analysis.periodic_forcing import Forced
from cra_sym.solvers.harmonic_balance import Balance, Basis
from cra_sym.solvers.polynomial_roots import monomials_up_to, polynomial_roots

__all__ = ["sampled", "seeds"]

Array = NDArray[np.float64]
_SAMPLED = 9  # frequencies at which each mode is solved alone, unless it is the whole problem
_PHASES = 4
_FAR = 0.5  # relative distance from a natural frequency beyond which a harmonic is not tried


def seeds(
    driven: Forced, basis: Basis, points: Array, order: NDArray[np.intp], period: int
) -> tuple[NDArray[np.intp], Array, float]:
    """Return starts for Newton's method.

    Parameters
    ----------
    driven : Forced
    basis : Basis
        Constant and harmonics of varpi / period.
    points : ndarray, shape (points, 2)
        Angular frequencies and sizes of the excitation.
    order : ndarray of int
        That sorts them, frequencies of each size in turn.
    period : int

    Returns
    -------
    where : ndarray of int, shape (starts,)
        The point each start belongs to.
    starts : ndarray, shape (starts, unknowns)
    size : float
        Modal amplitude at which nonlinear forces are as large as linear ones, or that of the linear response.
    """
    n, harmonics = driven.equations.modes, len(basis.cosines) - 1
    only = n == 1 and harmonics == 1
    picked = order if only else sampled(points, order)
    where, starts = list(range(len(points))), [np.zeros(n * basis.size) for _ in points]
    sizes = []
    for mode in range(n):
        alone = Forced(driven.equations.of(np.array([mode])), driven.waves)
        size = _size(alone)
        sizes.append(size)
        if not np.isfinite(size):
            continue
        for at in picked:
            for harmonic in _harmonics(alone, points[at, 0] / period, harmonics, only):
                small = _SingleMode(alone, harmonic, period, points[at], size)
                for constant, cosine, sine in small.answers(with_free=not only):
                    x = np.zeros((n, basis.size))
                    x[mode, [0, harmonic, harmonics + harmonic]] = constant, cosine, sine
                    where.append(int(at))
                    starts.append(x.ravel())
    size = min((s for s in sizes if np.isfinite(s)), default=1.0)
    return np.array(where, int), np.array(starts), float(size)


def sampled(points: Array, order: NDArray[np.intp], most: int = _SAMPLED) -> NDArray[np.intp]:
    """Return the indices of some points: a few frequencies of the smallest, middle and largest excitation."""
    sizes = np.unique(points[:, 1])
    chosen = sizes[np.unique([0, len(sizes) // 2, len(sizes) - 1])]
    rows = [order[points[order, 1] == size] for size in chosen]
    return np.concatenate([row[np.unique(np.linspace(0, len(row) - 1, most).round().astype(int))] for row in rows])


def _harmonics(alone: Forced, frequency: float, harmonics: int, only: bool) -> list[int]:
    omega = float(alone.equations.omega[0])
    if only:
        return [1]
    near = int(np.clip(round(omega / frequency), 1, harmonics))
    return [near] if abs(near * frequency - omega) <= _FAR * omega else []


def _size(alone: Forced) -> float:
    """Return the amplitude at which nonlinear and linear forces of one mode are equal; inf for a linear mode."""
    equations = alone.equations
    free = equations.free().nonlinear()
    forces = tuple(t for t in equations.forces if not t.causes and t.positions + t.velocities > 1)
    omega = max(float(equations.omega[0]), 1e-300)
    exponents = np.linspace(-40.0, 40.0, 81)
    for _ in range(4):  # successively finer tables around the first exponent at which they are equal
        q = 10.0 ** exponents[:, None]
        found = free.derivatives(q, omega * q)
        other = type(free)(free.omega, free.damping, (), forces).derivatives(q, omega * q)
        force = np.abs(found.force) + omega * np.abs(found.momentum) + np.abs(other.force)
        large = np.flatnonzero(force[:, 0] >= omega**2 * q[:, 0])
        if not large.size:
            return np.inf
        high = exponents[large[0]]
        exponents = np.linspace(exponents[max(large[0] - 1, 0)], high, 81)
    return float(10.0**high)


class _SingleMode:
    """One mode with a constant and one harmonic: polynomials in three unknowns."""

    def __init__(self, alone: Forced, harmonic: int, period: int, point: Array, size: float) -> None:
        self._size, self._degree = size, alone.equations.degree
        number = samples(self._degree, harmonic, alone.order * period)
        basis = Basis((0, harmonic), (harmonic,), number)
        self._balance = Balance(alone.equations, basis)
        self._free = Balance(alone.equations.free(), basis)
        self._frequency = float(point[0]) / period
        self._causes = alone.causes(point[:1], basis.phase, period, point[1:])

    def _residual(self, balance: Balance, unknowns: Array) -> Array:
        frequency = np.full(len(unknowns), self._frequency)
        return balance.at(unknowns, frequency, np.repeat(self._causes, len(unknowns), axis=0)).residual

    def answers(self, *, with_free: bool) -> Array:
        """Return all real solutions, and free vibration at the frequency with several phases, shape (solutions, 3)."""
        exponents = np.array(monomials_up_to(3, self._degree))
        points = np.random.default_rng(1).uniform(-1.5, 1.5, (2 * len(exponents), 3))
        table = np.prod(points[:, None, :] ** exponents, axis=-1)
        values = self._residual(self._balance, points * self._size)
        coefficients = np.linalg.lstsq(table, values, rcond=None)[0].T
        size = np.abs(coefficients).max()
        coefficients[np.abs(coefficients) < 1e-13 * size] = 0.0
        try:
            roots = polynomial_roots(coefficients, self._degree)
        except ValueError:
            roots = np.empty((0, 3), complex)
        real = roots[np.abs(roots.imag).max(axis=1) < 1e-5 * (1 + np.abs(roots).max(axis=1))].real
        found = [*real, *(self._free_vibration() if with_free else [])]
        return self._size * np.array(found).reshape(-1, 3)

    def _free_vibration(self) -> list[Array]:
        points = np.linspace(0.2, 1.5, self._degree)
        unknowns = np.zeros((len(points), 3))
        unknowns[:, 1] = points * self._size
        forces = self._residual(self._free, unknowns)[:, 1] / points
        polynomial = np.polyfit(points, forces, len(points) - 1)
        roots = np.roots(polynomial)
        sizes = roots[(np.abs(roots.imag) < 1e-9) & (roots.real > 0)].real
        phases = 2 * np.pi * np.arange(_PHASES) / _PHASES + 0.3
        return [np.array([0.0, a * np.cos(p), a * np.sin(p)]) for a in sizes for p in phases]
