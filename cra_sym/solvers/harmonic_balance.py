"""Harmonic balance of modal equations: alternating frequency and time, with exact Jacobians.

The action over a period is stationary for harmonic test functions, so neither accelerations nor their derivatives are
needed. The number of samples makes the sums exact.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from cra_sym.solvers.modal_polynomials import Derivatives, ModalPolynomials

__all__ = ["Balance", "Basis", "flattened", "newton", "peak"]

Array = NDArray[np.float64]
_SHORTEST = 1.0 / 64  # least share of a damped Newton step


def flattened(known: Array) -> Array:
    """Merge the axes of points and samples of known functions (points, known functions, samples)."""
    points, functions, samples = known.shape
    return known.swapaxes(0, 1).reshape(functions, points * samples)


@dataclass(frozen=True, eq=False)
class Basis:
    """Harmonics of one period, as functions of the phase.

    Attributes
    ----------
    cosines, sines : tuple of int
        Multiples of the phase; 0 among the cosines is the constant.
    samples : int
    """

    cosines: tuple[int, ...]
    sines: tuple[int, ...]
    samples: int

    @classmethod
    def whole(cls, harmonics: int, samples: int) -> Basis:
        """Return the constant and all harmonics."""
        return cls(tuple(range(harmonics + 1)), tuple(range(1, harmonics + 1)), samples)

    @property
    def size(self) -> int:
        """Number of functions."""
        return len(self.cosines) + len(self.sines)

    @cached_property
    def orders(self) -> Array:
        """Multiple of the phase of every function."""
        return np.array([*self.cosines, *self.sines], float)

    @cached_property
    def phase(self) -> Array:
        """Phases of the samples."""
        return 2 * np.pi * np.arange(self.samples) / self.samples

    def values(self, phase: Array, derivative: int = 0) -> Array:
        """Return the functions, or their derivatives by the phase, shape (..., size)."""
        turn = 0.5 * np.pi * derivative
        angle = phase[..., None] * self.orders + turn
        split = len(self.cosines)
        found = np.concatenate([np.cos(angle[..., :split]), np.sin(angle[..., split:])], axis=-1)
        return found * self.orders**derivative

    @cached_property
    def weights(self) -> Array:
        """Factor that makes the mean product of a function with itself one."""
        return np.where(self.orders > 0, 2.0, 1.0)

    @cached_property
    def products(self) -> tuple[Array, Array, Array]:
        """Mean products B B, B D and D D at the samples, weighted, shape (samples, size * size)."""
        value, rate = self.values(self.phase), self.values(self.phase, 1)
        left = self.weights / self.samples
        return tuple(
            np.einsum("sm,sl->sml", left * one, other).reshape(self.samples, -1)
            for one, other in ((value, value), (value, rate), (rate, rate))
        )

    @cached_property
    def turned(self) -> Array:
        """Matrix of the derivative by the phase in the basis, weighted as `products`, shape (size, size)."""
        value, rate = self.values(self.phase), self.values(self.phase, 1)
        return (self.weights * value).T @ rate / self.samples


@dataclass(frozen=True, eq=False)
class Balance:
    """Residual of harmonic balance and its rates.

    Attributes
    ----------
    equations : ModalPolynomials
    basis : Basis
    """

    equations: ModalPolynomials
    basis: Basis

    @property
    def size(self) -> int:
        """Number of unknowns."""
        return self.equations.modes * self.basis.size

    def coefficients(self, unknowns: Array) -> Array:
        """Return unknowns of shape (points, size) as (points, modes, functions)."""
        return unknowns.reshape(-1, self.equations.modes, self.basis.size)

    def residual(
        self, unknowns: Array, frequency: Array, causes: Array | None = None
    ) -> tuple[Array, Array, Array, Array]:
        """Return the residual, its rates by the unknowns and by the frequency, and a scale of its terms.

        Parameters
        ----------
        unknowns : ndarray, shape (points, size)
        frequency : ndarray, shape (points,)
            Angular frequency of the period.
        causes : ndarray, shape (points, known functions, samples), optional

        Returns
        -------
        residual : ndarray, shape (points, size)
        jacobian : ndarray, shape (points, size, size)
        rate : ndarray, shape (points, size)
            By the frequency, known functions held.
        scale : ndarray, shape (points,)
        """
        basis, n, m = self.basis, self.equations.modes, self.basis.size
        points = len(unknowns)
        x = self.coefficients(unknowns)
        value, rate = basis.values(basis.phase), basis.values(basis.phase, 1)
        q = (x @ value.T).swapaxes(1, 2)
        turn = (x @ rate.T).swapaxes(1, 2) if self.equations.moves_mass else np.zeros_like(q)
        w = frequency[:, None, None]
        shape = (points * basis.samples, n)
        flat = None if causes is None else flattened(causes)
        found = self.equations.derivatives(q.reshape(shape), (w * turn).reshape(shape), flat)
        force, momentum = (part.reshape(points, basis.samples, n).swapaxes(1, 2) for part in found[:2])
        left, left_rate = (basis.weights / basis.samples * b for b in (value, rate))
        moves, pushes = self.equations.by_velocity[1], self.equations.by_velocity[0]

        stiff = self.equations.omega[:, None] ** 2 - (w * basis.orders) ** 2
        damped = self.equations.damping @ x @ basis.turned.T
        pulse = momentum @ left_rate if self.equations.moves_mass else np.zeros_like(x)
        residual = -stiff * x - w * damped + force @ left + w * pulse
        blocks = self._blocks(found, w, points)
        jacobian = blocks.reshape(points, n, n, m, m).transpose(0, 1, 3, 2, 4).copy()
        if self.equations.damping.any():
            jacobian -= w[..., None, None] * np.einsum("ij,ml->imjl", self.equations.damping, basis.turned)
        jacobian = jacobian.reshape(points, n * m, n * m)
        diagonal = np.arange(n * m)
        jacobian[:, diagonal, diagonal] -= stiff.reshape(points, -1)
        by_frequency = 2 * w * basis.orders**2 * x - damped + pulse
        moving = turn.reshape(*shape, 1)
        for depends, part, test in ((pushes, found.force_v, left), (moves, found.momentum_v, w * left_rate)):
            if depends:
                slope = (part @ moving).reshape(points, basis.samples, n).swapaxes(1, 2)
                by_frequency = by_frequency + slope @ test
        scale = np.sqrt(((self.equations.omega[:, None] ** 2 + (w * basis.orders) ** 2) ** 2 * x**2).sum(axis=(1, 2)))
        return residual.reshape(points, -1), jacobian, by_frequency.reshape(points, -1), scale

    def _blocks(self, found: Derivatives, w: Array, points: int) -> Array:
        """Return the rates of the nonlinear terms by the unknowns, shape (points, modes * modes, size * size)."""
        n, m = self.equations.modes, self.basis.size
        by_q_q, by_q_v, by_v_q, by_v_v = (
            part.reshape(points, self.basis.samples, n * n).swapaxes(1, 2) for part in found[2:]
        )
        bb, bd, dd = self.basis.products
        pushes, moves = self.equations.by_velocity
        blocks = by_q_q @ bb
        if pushes:
            db = bd.reshape(-1, m, m).swapaxes(1, 2).reshape(-1, m * m)
            db = db * (self.basis.weights[:, None] / self.basis.weights[None, :]).reshape(-1)
            blocks = blocks + w * (by_q_v @ bd) + w * (by_v_q @ db)
        if moves:
            blocks = blocks + w**2 * (by_v_v @ dd)
        return np.asarray(blocks)


def newton(
    balance: Balance,
    unknowns: Array,
    frequency: Array,
    causes: Array | None = None,
    *,
    floor: float = 0.0,
    tolerance: float = 1e-11,
    most: int = 40,
    whole: bool = False,
) -> tuple[Array, NDArray[np.bool_]]:
    """Return solutions of harmonic balance at given frequencies, many at once, and which converged.

    Newton's method; a step that does not reduce the residual is halved, unless ``whole`` is set. Undamped steps may
    leave the neighbourhood of the start and find further solutions.

    Parameters
    ----------
    balance : Balance
    unknowns : ndarray, shape (points, size)
        Starts.
    frequency : ndarray, shape (points,)
    causes : ndarray, shape (points, known functions, samples), optional
    floor : float
        Force below which a residual counts as rounding, since zero may be a solution.
    tolerance : float
        Residual relative to the forces that balance.
    most : int
        Iterations.
    """
    x = unknowns.copy()
    done = np.zeros(len(x), bool)
    open_ = np.arange(len(x))
    last, step, share = np.full(len(x), np.inf), np.zeros_like(x), np.ones(len(x))
    for _ in range(most):
        some = None if causes is None else causes[open_]
        residual, jacobian, _, scale = balance.residual(x[open_], frequency[open_], some)
        size = np.linalg.norm(residual, axis=1)
        done[open_[size <= tolerance * scale + floor]] = True
        rises = ~(size < last[open_]) & (share[open_] > _SHORTEST) & (not whole)  # then the step was too long
        back = open_[rises & ~done[open_]]
        share[back] *= 0.5
        x[back] += share[back, None] * step[back]
        on = ~rises & np.isfinite(size) & ~done[open_]
        at = open_[on]
        step[at], last[at], share[at] = _solved(jacobian[on], residual[on]), size[on], 1.0
        x[at] -= step[at]
        open_ = np.sort(np.concatenate([back, at]))
        if not open_.size:
            break
    return x, done


def _solved(jacobian: Array, residual: Array) -> Array:
    try:
        return np.asarray(np.linalg.solve(jacobian, residual[:, :, None])[:, :, 0])
    except np.linalg.LinAlgError:
        return np.stack([np.linalg.lstsq(j, r, rcond=None)[0] for j, r in zip(jacobian, residual, strict=True)])


def peak(basis: Basis, rows: Array, coefficients: Array) -> tuple[Array, Array]:
    """Return the largest value of ``|sum rows[i] q_i|`` over a period, and the phase at which it is reached.

    Parameters
    ----------
    basis : Basis
    rows : ndarray, shape (modes,)
    coefficients : ndarray, shape (points, modes, functions)

    Returns
    -------
    largest, phase : ndarray, shape (points,)
    """
    series = rows @ coefficients
    number = 8 * int(basis.orders.max(initial=1.0)) + 8
    grid = 2 * np.pi * np.arange(number) / number
    values = series @ basis.values(grid).T
    best, where = np.full(len(series), -1.0), np.zeros(len(series))
    for sign in (1.0, -1.0):  # the largest and the smallest sample, refined by Newton's method
        phase = grid[(sign * values).argmax(axis=1)]
        for _ in range(6):
            slope, bend = ((series * basis.values(phase, k)).sum(axis=1) for k in (1, 2))
            step = np.where(sign * bend < 0, -slope / np.where(bend == 0, 1.0, bend), 0.0)
            phase = phase + np.clip(step, -np.pi / number, np.pi / number)
        found = np.abs((series * basis.values(phase)).sum(axis=1))
        where, best = np.where(found > best, phase, where), np.maximum(best, found)
    return best, where
