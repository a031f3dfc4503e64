"""Harmonic balance of modal equations: alternating frequency and time, with exact Jacobians.

The action over a period is stationary for harmonic test functions, so neither accelerations nor their derivatives are
needed. The number of samples makes the sums exact.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from cra_sym.cached import cached_property
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
    def sampled(self) -> tuple[Array, Array]:
        """The functions and their rates at the samples, shape (samples, size)."""
        return self.values(self.phase), self.values(self.phase, 1)

    @cached_property
    def tests(self) -> tuple[Array, Array]:
        """Weighted test functions and their rates: products with samples give the coefficients of a function."""
        left = self.weights / self.samples
        return left * self.sampled[0], left * self.sampled[1]

    @cached_property
    def products(self) -> tuple[Array, Array, Array]:
        """Mean products B B, B D and D D at the samples, weighted, shape (samples, size * size)."""
        (value, rate), (test, test_rate) = self.sampled, self.tests
        bb, bd, dd = (
            np.einsum("sm,sl->sml", one, other).reshape(self.samples, -1)
            for one, other in ((test, value), (test, rate), (test_rate, rate))
        )
        return bb, bd, dd

    @cached_property
    def turned(self) -> Array:
        """Matrix of the derivative by the phase in the basis, weighted as `products`, shape (size, size)."""
        return np.asarray(self.tests[0].T @ self.sampled[1])


@dataclass(frozen=True, eq=False)
class Balance:
    """The equations of harmonic balance.

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

    def at(self, unknowns: Array, frequency: Array, causes: Array | None = None) -> Balanced:
        """Return the residual at points; rates follow on request.

        Parameters
        ----------
        unknowns : ndarray, shape (points, size)
        frequency : ndarray, shape (points,)
            Angular frequency of the period.
        causes : ndarray, shape (points, known functions, samples), optional
        """
        basis, n = self.basis, self.equations.modes
        x, w = self.coefficients(unknowns), frequency[:, None, None]
        q = (x @ basis.sampled[0].T).swapaxes(1, 2)
        turn = (x @ basis.sampled[1].T).swapaxes(1, 2) if self.equations.moves_mass else np.zeros_like(q)
        flat = None if causes is None else flattened(causes)
        found = self.equations.derivatives(q.reshape(-1, n), (w * turn).reshape(-1, n), flat)
        return Balanced(self, x, w, turn, Derivatives(*(part.reshape(*q.shape[:2], *part.shape[1:]) for part in found)))


@dataclass(frozen=True, eq=False)
class Balanced:
    """Harmonic balance at points: the residual and its rates.

    Attributes
    ----------
    balance : Balance
    x : ndarray, shape (points, modes, functions)
    w : ndarray, shape (points, 1, 1)
        Angular frequency.
    turn : ndarray, shape (points, samples, modes)
        Rates of the coordinates by the phase, where needed.
    found : Derivatives
        With axes of points and samples.
    """

    balance: Balance
    x: Array
    w: Array
    turn: Array
    found: Derivatives

    @cached_property
    def _stiff(self) -> Array:
        return self.balance.equations.omega[:, None] ** 2 - (self.w * self.balance.basis.orders) ** 2

    @cached_property
    def _damped(self) -> Array:
        return np.asarray(self.balance.equations.damping @ self.x @ self.balance.basis.turned.T)

    @cached_property
    def _pulse(self) -> Array:
        if not self.balance.equations.moves_mass:
            return np.zeros_like(self.x)
        return np.asarray(self.found.momentum.swapaxes(1, 2) @ self.balance.basis.tests[1])

    @cached_property
    def residual(self) -> Array:
        """Residual, shape (points, size)."""
        pushed = self.found.force.swapaxes(1, 2) @ self.balance.basis.tests[0]
        residual = -self._stiff * self.x - self.w * self._damped + pushed + self.w * self._pulse
        return np.asarray(residual.reshape(len(self.x), -1))

    @property
    def scale(self) -> Array:
        """Size of the terms of the residual, shape (points,)."""
        squares = self.balance.equations.omega[:, None] ** 2 + (self.w * self.balance.basis.orders) ** 2
        return np.asarray(np.sqrt((squares**2 * self.x**2).sum(axis=(1, 2))))

    @property
    def by_frequency(self) -> Array:
        """Rate of the residual by the frequency, known functions held, shape (points, size)."""
        balance, (left, left_rate) = self.balance, self.balance.basis.tests
        by_frequency = 2 * self.w * balance.basis.orders**2 * self.x - self._damped + self._pulse
        pushes, moves = balance.equations.by_velocity
        for depends, part, test in (
            (pushes, self.found.force_v, left),
            (moves, self.found.momentum_v, self.w * left_rate),
        ):
            if depends:
                slope = (part @ self.turn[..., None])[..., 0].swapaxes(1, 2)
                by_frequency = by_frequency + slope @ test
        return np.asarray(by_frequency.reshape(len(self.x), -1))

    def jacobian(self, rows: slice | NDArray[np.bool_] = slice(None)) -> Array:
        """Return the rates of the residual by the unknowns, shape (points, size, size), at some of the points."""
        basis, equations, w = self.balance.basis, self.balance.equations, self.w[rows]
        n, m, points = equations.modes, basis.size, len(w)
        jacobian = self._blocks(rows, w).reshape(points, n, n, m, m).transpose(0, 1, 3, 2, 4).copy()
        if equations.damping.any():
            jacobian -= w[..., None, None] * np.einsum("ij,ml->imjl", equations.damping, basis.turned)
        jacobian = jacobian.reshape(points, n * m, n * m)
        diagonal = np.arange(n * m)
        jacobian[:, diagonal, diagonal] -= self._stiff[rows].reshape(points, n * m)
        return np.asarray(jacobian)

    def _blocks(self, rows: slice | NDArray[np.bool_], w: Array) -> Array:
        """Return the rates of the nonlinear terms by the unknowns, shape (points, modes * modes, size * size)."""
        basis, n = self.balance.basis, self.balance.equations.modes

        def part(one: Array) -> Array:
            return one[rows].reshape(len(w), basis.samples, n * n).swapaxes(1, 2)

        bb, bd, dd = basis.products
        pushes, moves = self.balance.equations.by_velocity
        blocks = part(self.found.force_q) @ bb
        if pushes:
            m = basis.size
            db = bd.reshape(-1, m, m).swapaxes(1, 2).reshape(-1, m * m)
            db = db * (basis.weights[:, None] / basis.weights[None, :]).reshape(-1)
            blocks = blocks + w * (part(self.found.force_v) @ bd) + w * (part(self.found.momentum_q) @ db)
        if moves:
            blocks = blocks + w**2 * (part(self.found.momentum_v) @ dd)
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
        balanced = balance.at(x[open_], frequency[open_], some)
        size = np.linalg.norm(balanced.residual, axis=1)
        done[open_[size <= tolerance * balanced.scale + floor]] = True
        rises = ~(size < last[open_]) & (share[open_] > _SHORTEST) & (not whole)  # then the step was too long
        back = open_[rises & ~done[open_]]
        share[back] *= 0.5
        x[back] += share[back, None] * step[back]
        on = ~rises & np.isfinite(size) & ~done[open_]
        at = open_[on]
        step[at], last[at], share[at] = _solved(balanced.jacobian(on), balanced.residual[on]), size[on], 1.0
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
