"""Uniform problems with two waves a section: their determinant and exact count in NumPy, and rigid-body motions."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from . import waves_kernel

__all__ = ["Determinant", "UniformProblem", "negative_energy", "rigid_motions"]

kernel: Any = waves_kernel  # formulas of arrays, without types: they are compiled text too

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]

_A, _B, _RIGHT, _LEFT, _POLYNOMIALS, _COUPLINGS = 0, 8, 16, 22, 28, 34
_DEPENDENT = 1e-14  # a row of unit size that rounding leaves of a dependent one


@dataclass(frozen=True)
class UniformProblem:
    """Problems of motions ``cos(omega t)`` with ``z = omega^2``, constant along x and even under ``x -> -x``.

    The state of a section has n displacements q and their natural forces P (positive at the right end). Displacement i
    and its force are partners ``E[i]`` and ``O[i]``: the first ``even`` displacements are even under reflection, with
    ``E[i] = q_i`` and ``O[i] = P_i``; the others are odd, with ``E[i] = P_i`` and ``O[i] = q_i``. Then ``O' = A_OE E``
    and ``E' = A_EO O``.

    Parameters
    ----------
    length : ndarray, shape (rows,)
        In (0, inf).
    odd_by_even, even_by_odd : ndarray, shape (2, rows, n, n)
        A_OE and A_EO: the part without z, and the factor of z.
    stiffness, mass : ndarray, shape (2, rows, n)
        Of the end conditions at the left (first) and right end, in the units of P over those of q:
        ``P + (k - z m) q = 0`` at the right end, ``-P + (k - z m) q = 0`` at the left. Stiffness in [0, inf], inf holds
        the displacement; masses in [0, inf).
    couplings : ndarray, shape (2, 2, rows), optional
        Off-diagonal entries of the end matrices: stiffness and mass, of the left and the right end. An offset mass m at
        the distance e has m e. The end matrices must be positive semidefinite.
    even : int
        Number of even displacements, 1 to n. (If all are odd, call them even.)
    """

    length: Floats
    odd_by_even: Floats
    even_by_odd: Floats
    stiffness: Floats
    mass: Floats
    even: int = 1
    couplings: Floats | None = None

    def __post_init__(self) -> None:
        rows, n = len(self.length), self.odd_by_even.shape[-1]
        shapes: dict[str, tuple[int, ...]] = {"odd_by_even": (2, rows, n, n), "even_by_odd": (2, rows, n, n)}
        shapes |= {"stiffness": (2, rows, n), "mass": (2, rows, n)}
        if self.couplings is not None:
            shapes["couplings"] = (2, 2, rows)
        for name, shape in shapes.items():
            if getattr(self, name).shape != shape:
                raise ValueError(f"{name}: the shape {getattr(self, name).shape} must be {shape}")
        if n != 2:
            raise ValueError(f"odd_by_even: the number of displacements {n} must be 2")
        if not 1 <= self.even <= n:
            raise ValueError(f"even = {self.even}: must be from 1 to {n}")

    def take(self, rows: NDArray[np.int64] | slice) -> UniformProblem:
        """Return the problem of some of the parameter sets."""
        matrices = self.odd_by_even[:, rows], self.even_by_odd[:, rows]
        couplings = None if self.couplings is None else self.couplings[:, :, rows]
        ends = self.stiffness[:, rows], self.mass[:, rows]
        return UniformProblem(self.length[rows], *matrices, *ends, self.even, couplings)

    def coefficients(self) -> Floats:
        """Return what `waves_kernel` takes, shape (42, rows): matrices times half the length, ends, dispersion."""
        rows = len(self.length)
        k = np.empty((42, rows))
        for first, matrix in ((_A, self.odd_by_even), (_B, self.even_by_odd)):
            k[first : first + 8] = np.moveaxis(matrix, 1, -1).reshape(8, rows) * (0.5 * self.length)
        for first, end in ((_RIGHT, 1), (_LEFT, 0)):
            for i in range(2):
                stiffness, mass = self.stiffness[end, :, i], self.mass[end, :, i]
                share = 1.0 / (1.0 + stiffness + mass)
                held = np.isinf(stiffness)
                k[first + 3 * i] = np.where(held, 1.0, np.where(held, 1.0, stiffness) * share)
                k[first + 3 * i + 1], k[first + 3 * i + 2] = mass * share, share
        k[_COUPLINGS:] = 0.0
        if self.couplings is not None:
            for first, end in ((_COUPLINGS, 1), (_COUPLINGS + 4, 0)):
                for i in range(4):
                    k[first + i] = self.couplings[i % 2, end] * k[(_RIGHT, _LEFT)[1 - end] + 3 * (i // 2) + 2]
        k[_POLYNOMIALS:_COUPLINGS] = _dispersion(*k[:_RIGHT].reshape(4, 4, rows))
        return k


def _dispersion(a0: Floats, a1: Floats, b0: Floats, b1: Floats) -> Floats:
    """Return the coefficients of 1, z and z^2 in the trace and the determinant of ``A_EO A_OE``."""

    def trace(b: Floats, a: Floats) -> Floats:
        products: Floats = b[0] * a[0] + b[1] * a[2] + b[2] * a[1] + b[3] * a[3]
        return products

    def determinant(m0: Floats, m1: Floats) -> tuple[Floats, Floats, Floats]:
        mixed = m0[0] * m1[3] + m1[0] * m0[3] - m0[1] * m1[2] - m1[1] * m0[2]
        return m0[0] * m0[3] - m0[1] * m0[2], mixed, m1[0] * m1[3] - m1[1] * m1[2]

    d, e = determinant(a0, a1), determinant(b0, b1)
    product = d[0] * e[0], d[0] * e[1] + d[1] * e[0], d[0] * e[2] + d[1] * e[1] + d[2] * e[0]
    return np.array([trace(b0, a0), trace(b1, a0) + trace(b0, a1), trace(b1, a1), *product])


class _Zero:
    """The number 0 as an entry of all rows: NumPy spends no time on products with it."""

    __array_ufunc__ = None

    def __mul__(self, other: Any) -> _Zero:
        return self

    __rmul__ = __mul__

    def __truediv__(self, other: Any) -> float:
        return 0.0

    def __add__(self, other: Any) -> Any:
        return other

    __radd__ = __add__

    def __rsub__(self, other: Any) -> Any:
        return other

    def __sub__(self, other: Any) -> Any:
        return -other

    def __neg__(self) -> _Zero:
        return self

    __abs__ = __neg__

    def __gt__(self, other: float) -> bool:
        return other < 0.0

    def __lt__(self, other: float) -> bool:
        return other > 0.0

    def __eq__(self, other: object) -> Any:
        return other == 0.0 if isinstance(other, float) else NotImplemented

    __hash__ = object.__hash__

    def __getitem__(self, members: Any) -> _Zero:
        return self


_ZERO = _Zero()


def end_conditions(k: Any, z: Any, end: int, odd: bool) -> tuple[Any, Any]:
    """Return what multiplies E[0], O[0], E[1], O[1] in both conditions of an end, and what couples displacements."""
    s1, c1, s2, c2 = kernel.pairs(k, z, _RIGHT if end else _LEFT)
    t1, t2 = kernel.couplings(k, z, _COUPLINGS + (0 if end else 4))
    if not odd:
        return (s1, c1, s2, c2), (t1, t2)
    return (s1, c1, c2, s2), ((t1, t2) if end else (-t1, -t2))  # O is reflected


def second_displacement(columns: Any, odd: bool) -> tuple[Any, ...]:
    """Return the second displacement on the four columns."""
    return (*columns[6:8], *columns[10:12]) if odd else (*columns[2:4], *columns[14:16])


class Determinant:
    """The determinant of the end conditions, entire in z up to a positive factor, with the exact count.

    Parameters
    ----------
    k : ndarray, shape (42, rows)
        From `UniformProblem.coefficients`.
    odd : bool
        Whether the second displacement is odd under reflection.
    zeros : ndarray of int, shape (rows,)
        Multiplicity of the zero at z = 0, which is divided out of the values.
    """

    def __init__(self, k: Floats, odd: bool, zeros: Integers) -> None:
        self.k, self.odd, self.zeros = k, odd, zeros
        used: NDArray[np.bool_] = np.any(k, axis=1)
        for first in (*range(_A, _A + 4, 2), *range(_B, _B + 4, 2)):  # no row of a matrix is left out
            used[first : first + 2] |= not used[[first, first + 1, first + 4, first + 5]].any()
        self._entries = [row if entry else _ZERO for row, entry in zip(k, used, strict=True)]

    def take(self, rows: Integers) -> Determinant:
        """Return the functions of some of the rows."""
        return Determinant(self.k[:, rows], self.odd, self.zeros[rows])

    @np.errstate(all="ignore")
    def value(self, z: Floats) -> Floats:
        """Return the determinant over ``z**zeros``."""
        result = np.empty(z.size)
        for part, _, columns, basis, ends in self._regimes(z):
            second = self._second(columns)
            ends = (kernel.minors(*kernel.conditions(*end, columns, second)) for end in ends)
            result[part] = kernel.joined(*ends) / basis
        return self._deflated(result, z)

    @np.errstate(all="ignore")
    def count(self, z: Floats) -> tuple[Integers, Floats]:
        """Return the exact number of zeros below z (for z > 0 those at 0 included), and the value."""
        number, result = np.empty(z.size, dtype=np.int64), np.empty(z.size)
        slopes = 0.5 * self.k[29] + z * self.k[30], self.k[32] + 2.0 * z * self.k[33], self._shears(z)
        for part, waves, columns, basis, (right, left) in self._regimes(z):
            more = (entry[part] for entry in slopes)
            count = kernel.chain(columns, self._second(columns), right, left, basis, *waves[:3], *more, self.odd)
            number[part], result[part] = count
        return number, self._deflated(result, z)

    def branch(self, turns: float) -> Floats:
        """Return the lowest z of free waves of ``turns`` half waves along the length."""
        z: Floats = kernel.branch((0.5 * np.pi * turns) ** 2, *self.k[_POLYNOMIALS:_COUPLINGS])
        return z

    def _deflated(self, value: Floats, z: Floats) -> Floats:
        return value / z**self.zeros if self.zeros.any() else value

    def _end(self, z: Floats, end: int) -> tuple[Any, ...]:
        """Return what multiplies E and O in both conditions of an end, and what couples the displacements."""
        return end_conditions(self._entries, z, end, self.odd)

    def _second(self, columns: tuple[Any, ...]) -> tuple[Any, ...]:
        return second_displacement(columns, self.odd)

    def _shears(self, z: Floats) -> NDArray[np.bool_]:
        b11, b12, b21, b22 = kernel.linear(self._entries, z, _B)
        found: NDArray[np.bool_] = self.odd & (b11 * b22 - b12 * b21 < 0.0)
        return found

    def _regimes(self, z: Floats) -> Iterator[tuple[Any, Any, Any, Floats, Any]]:
        """Yield, for each regime: its members, wave numbers, columns at the right end, their basis, end conditions."""
        a, b = kernel.linear(self._entries, z, _A), kernel.linear(self._entries, z, _B)
        groups = a, b, kernel.wave_numbers(a, b), *(entry for end in (1, 0) for entry in self._end(z, end))
        near, close = kernel.regime(*groups[2][:3])
        for name, mask in (("near", near), ("close", close & ~near), ("distant", ~(near | close))):
            members = np.flatnonzero(mask)
            if not members.size:
                continue
            part = slice(None) if members.size == z.size else members
            a, b, waves, *ends = (tuple(entry[part] for entry in group) for group in groups)
            if name != "near":
                pair = (kernel.half_sums if name == "close" else kernel.eigenvalues)(*waves[:3])
                functions = *kernel.wave(pair[0]), *kernel.wave(pair[1])
            if name == "distant":
                *columns, basis = kernel.distant_columns(a, b, *waves, *functions)
            else:
                series = kernel.close_series(*pair, *functions) if name == "close" else kernel.near_series(*waves[:3])
                *factors, exponent = series
                columns, basis = kernel.close_columns(a, b, *waves, *factors), np.exp(-exponent)
            yield part, waves, tuple(columns), basis, (ends[:2], ends[2:])


def rigid_motions(problem: UniformProblem) -> Integers:
    """Return how many independent motions without strain energy and without deflected springs each row has.

    Exact: such a motion has P = 0, so ``q' = A_qq q`` with ``A_Pq q = 0``, and is zero where an end has stiffness. Only
    linear dependence of a few rows of numbers decides.
    """
    rows, n = problem.stiffness.shape[1:]
    result = np.zeros(rows, dtype=np.int64)
    sprung = problem.stiffness > 0.0
    coupled = np.zeros(rows, dtype=bool) if problem.couplings is None else problem.couplings[0].any(axis=0)
    open_ = np.flatnonzero(coupled | ~sprung.all(axis=2).any(axis=0))
    if not open_.size:
        return result
    gradient, force = _static_blocks(problem, open_)
    right, left = np.eye(n), np.eye(n)
    power = term = np.broadcast_to(np.eye(n), gradient.shape)
    conditions = [force]
    for j in range(1, n):
        power = power @ gradient
        conditions.append(force @ power)
        term = power / float(np.prod(range(1, j + 1)))
        right, left = right + term, left + (-1.0) ** j * term
    for end, motion in ((0, left), (1, right)):
        conditions.append(_end_stiffness(problem, end, open_) @ motion)
    result[open_] = n - _ranks(np.concatenate(conditions, axis=1))
    return result


def _static_blocks(problem: UniformProblem, rows: Integers) -> tuple[Floats, Floats]:
    """Return A_qq and A_Pq at z = 0 times half the length, shape (rows, n, n) each."""
    n, even = problem.stiffness.shape[2], problem.even
    h = 0.5 * problem.length[rows, None, None]
    a, b = problem.odd_by_even[0, rows] * h, problem.even_by_odd[0, rows] * h
    first, second = slice(0, even), slice(even, n)
    gradient, force = np.zeros(a.shape), np.zeros(a.shape)
    gradient[:, first, second], gradient[:, second, first] = b[:, first, second], a[:, second, first]
    force[:, first, first], force[:, second, second] = a[:, first, first], b[:, second, second]
    return gradient, force


def _end_stiffness(problem: UniformProblem, end: int, rows: Integers) -> Floats:
    """Return the stiffness matrices of an end, each row over its size; an infinite one holds its displacement."""
    stiffness = problem.stiffness[end, rows]
    held = np.isinf(stiffness)
    matrix = np.where(held, 1.0, stiffness)[:, :, None] * np.eye(2)
    if problem.couplings is not None:
        matrix[:, [0, 1], [1, 0]] = np.where(held, 0.0, problem.couplings[0, end, rows, None])
    size = np.abs(matrix).max(axis=2, keepdims=True)
    return matrix / np.where(size > 0.0, size, 1.0)


def _ranks(matrix: Floats) -> Integers:
    """Return the rank of each matrix of a stack with few columns, by elimination with rows of unit size."""
    rest = matrix.copy()
    rank = np.zeros(len(rest), dtype=np.int64)
    every = np.arange(len(rest))
    for _ in range(matrix.shape[2]):
        size = np.abs(rest).max(axis=2)
        rest = rest / np.where(size > 0.0, size, 1.0)[:, :, None]
        best = np.abs(rest).max(axis=1).argmax(axis=1)
        pivot_row = np.abs(rest[every, :, best]).argmax(axis=1)
        pivot = rest[every, pivot_row, best]
        rank += pivot != 0.0
        factor = rest[every, :, best] / np.where(pivot == 0.0, 1.0, pivot)[:, None]
        rest = rest - factor[:, :, None] * rest[every, pivot_row][:, None, :]
        rest = np.where(np.abs(rest) < _DEPENDENT, 0.0, rest)
    return rank


@np.errstate(invalid="ignore", over="ignore", divide="ignore")
def negative_energy(problem: UniformProblem) -> NDArray[np.bool_]:
    """Return where static strain energy may be negative, as in compression: only there can a row buckle."""
    _, force = _static_blocks(problem, np.arange(len(problem.length)))
    off = force[:, 0, 1]
    scale = np.abs(force[:, 0, 0] * force[:, 1, 1])
    definite = force[:, 0, 0] * force[:, 1, 1] - off * force[:, 1, 0] >= -1e-15 * scale
    if problem.couplings is not None:
        for stiffness, coupling in zip(problem.stiffness, problem.couplings[0], strict=True):
            definite &= (coupling == 0.0) | (stiffness[:, 0] * stiffness[:, 1] >= (1.0 - 1e-14) * coupling**2)
    found: NDArray[np.bool_] = ~((force[:, 0, 0] >= 0.0) & (force[:, 1, 1] >= 0.0) & definite)
    return found
