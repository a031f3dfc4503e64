"""Uniform problems with up to three waves a section: what they are made of, motions without energy, buckling."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property, reduce
from itertools import accumulate, combinations, pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .straight import Exact
from .waves_kernel import minors, total

__all__ = ["Floats", "Integers", "Structure", "UniformProblem", "negative_energy", "rigid_motions"]

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]

_DEPENDENT = 1e-14  # a row of unit size that rounding leaves of a dependent one
_TERMS = 4  # coefficients of polynomials in z


@dataclass(frozen=True)
class Structure:
    """What the rows of a problem have in common.

    Attributes
    ----------
    odd : tuple of bool
        Which displacements are odd under reflection.
    sizes : tuple of int
        Displacements that are coupled inside, block by block.
    """

    odd: tuple[bool, ...]
    sizes: tuple[int, ...]

    @property
    def n(self) -> int:
        """Displacements of a section."""
        return len(self.odd)

    @cached_property
    def blocks(self) -> tuple[tuple[int, int], ...]:
        """First displacement of each block, and the first that follows it."""
        ends = list(accumulate(self.sizes, initial=0))
        return tuple(pairwise(ends))

    @property
    def matrices(self) -> tuple[int, int]:
        """Where the entries of both matrices begin among the coefficients."""
        return 0, 2 * self.n**2

    def condition(self, end: int, displacement: int) -> int:
        """Return where the factors of a condition begin: those of q, of -z q and of P."""
        return (4 + 3 * (1 - end)) * self.n**2 + 3 * self.n * displacement

    def table(self, displacement: int) -> int:
        """Return where the polynomials of a block begin whose first displacement this is."""
        return 10 * self.n**2 + _TERMS * displacement

    @property
    def coefficients(self) -> int:
        """Number of all coefficients."""
        return self.table(self.n)

    def steps(self, entries: Sequence[Any]) -> tuple[tuple[int, int], ...]:
        """Return end and displacement of the conditions that differ from E = 0, in the order in which they replace it.

        Odd displacements come first: while the even ones are held, what couples both is idle. Displacements that follow
        others come before these if they are even, which are held, and after them if they are odd, which are free.
        """

        def place(end: int, i: int) -> tuple[bool, bool]:
            force = entries[self.condition(end, i) + 2 * self.n + i]
            follows = isinstance(force, Exact) and not force.value
            return not self.odd[i], follows == self.odd[i]

        ordered = {end: sorted(range(self.n), key=lambda i: place(end, i)) for end in (1, 0)}
        return tuple((end, i) for end in (1, 0) for i in ordered[end] if not self._is_reference(entries, end, i))

    def _is_reference(self, entries: Sequence[Any], end: int, i: int) -> bool:
        first = self.condition(end, i)
        row = [entry.value if isinstance(entry, Exact) else None for entry in entries[first : first + 3 * self.n]]
        one = i + (2 * self.n if self.odd[i] else 0)
        return row == [int(j == one) for j in range(3 * self.n)]


@dataclass(frozen=True)
class UniformProblem:
    """Problems of motions ``cos(omega t)`` with ``z = omega^2``, constant along x and even under ``x -> -x``.

    The state of a section has n displacements q and their natural forces P (positive at the right end). Displacement i
    and its force are partners ``E[i]`` and ``O[i]``: of a displacement that is even under reflection ``E[i] = q_i`` and
    ``O[i] = P_i``, of an odd one ``E[i] = P_i`` and ``O[i] = q_i``. Then ``O' = A_OE E`` and ``E' = A_EO O``.

    Parameters
    ----------
    length : ndarray, shape (rows,)
        In (0, inf).
    odd_by_even, even_by_odd : ndarray, shape (2, rows, n, n)
        A_OE and A_EO: the part without z, and the factor of z; n is 1 to 3.
    stiffness, mass : ndarray, shape (2, rows, n)
        Of the end conditions at the left (first) and right end, in the units of P over those of q:
        ``P + (k - z m) q = 0`` at the right end, ``-P + (k - z m) q = 0`` at the left. Stiffness in [0, inf], inf holds
        the displacement; masses in [0, inf).
    odd : tuple of bool
        Which displacements are odd. (If all of a block are, call them even.)
    couplings : ndarray, shape (2, 2, rows, n, n), optional
        Off-diagonal entries of the end matrices: stiffness and mass, of the left and the right end. An offset mass m at
        the distance e has m e. The end matrices must be positive semidefinite, and couple no two odd displacements.
    ties : ndarray, shape (2, rows, n, n), optional
        A displacement i that is held at an end is ``sum_j ties[end, row, i, j] q_j`` there, of displacements j of the
        same parity that are not held; stiffness, mass and couplings of these are those of the motion that is left.
    sizes : tuple of int, optional
        Displacements that the matrices couple, block by block in order. Default: one block of all.
    known : tuple of (0, 1 or None), optional
        Coefficients, as `Structure` orders them, that are 0 or 1 in all rows: formulas for them are shorter.
    """

    length: Floats
    odd_by_even: Floats
    even_by_odd: Floats
    stiffness: Floats
    mass: Floats
    odd: tuple[bool, ...] = (False, True)
    couplings: Floats | None = None
    ties: Floats | None = None
    sizes: tuple[int, ...] | None = None
    known: tuple[int | None, ...] | None = None

    def __post_init__(self) -> None:
        rows, n = len(self.length), self.odd_by_even.shape[-1]
        shapes: dict[str, tuple[int, ...]] = {"odd_by_even": (2, rows, n, n), "even_by_odd": (2, rows, n, n)}
        shapes |= {"stiffness": (2, rows, n), "mass": (2, rows, n)}
        shapes |= {"couplings": (2, 2, rows, n, n), "ties": (2, rows, n, n)}
        for name, shape in shapes.items():
            value = getattr(self, name)
            if value is not None and value.shape != shape:
                raise ValueError(f"{name}: the shape {value.shape} must be {shape}")
        if not 1 <= n <= 3:
            raise ValueError(f"odd_by_even: the number of displacements {n} must be 1, 2 or 3")
        if len(self.odd) != n:
            raise ValueError(f"odd = {self.odd}: must tell of each of {n} displacements whether it is odd")
        if sum(self.structure.sizes) != n:
            raise ValueError(f"sizes = {self.sizes}: the sum must be {n}")
        for start, stop in self.structure.blocks:
            if all(self.odd[start:stop]):
                raise ValueError(f"odd = {self.odd}: not all displacements of a block must be odd")

    @cached_property
    def structure(self) -> Structure:
        """What all rows have in common."""
        return Structure(tuple(self.odd), self.sizes or (len(self.odd),))

    def take(self, rows: Integers | slice) -> UniformProblem:
        """Return the problem of some of the parameter sets."""
        names = ("odd_by_even", "even_by_odd", "stiffness", "mass", "ties")
        parts = {name: getattr(self, name) for name in names}
        parts = {name: None if part is None else part[:, rows] for name, part in parts.items()}
        couplings = None if self.couplings is None else self.couplings[:, :, rows]
        return replace(self, length=self.length[rows], couplings=couplings, **parts)

    def end_rows(self, end: int, rows: Integers | slice = slice(None)) -> tuple[Floats, Floats, Floats]:
        """Return the factors of q, of -z q and of P in the conditions of an end, shape (rows, n, n) each.

        A condition of a displacement that is held has no force.
        """
        stiffness, mass = self.stiffness[end, rows], self.mass[end, rows]
        held, unit = np.isinf(stiffness), np.eye(stiffness.shape[1])
        springs, masses = np.where(held, 1.0, stiffness)[:, :, None] * unit, mass[:, :, None] * unit
        force = np.where(held, 0.0, 1.0)[:, :, None] * unit
        if self.couplings is not None:
            springs, masses = springs + self.couplings[0, end, rows], masses + self.couplings[1, end, rows]
        ties = 0.0 if self.ties is None else self.ties[end, rows]
        if self.couplings is not None or self.ties is not None:
            springs = np.where(held[:, :, None], unit - ties, springs)
        if self.ties is not None:
            force = force + np.where(held[:, :, None], 0.0, np.swapaxes(ties, 1, 2))
        masses = np.where(held[:, :, None], 0.0, masses)
        return springs, masses, force

    @cached_property
    def varying(self) -> list[int]:
        """Which coefficients are not known."""
        return [
            place for place, value in enumerate(self.known or [None] * self.structure.coefficients) if value is None
        ]

    @np.errstate(invalid="ignore")
    def coefficients(self) -> Floats:
        """Return the coefficients that vary, as `Structure` orders them, shape (varying, rows).

        Matrices times half the length, end conditions, polynomials of the dispersion relation.
        """
        structure, n, half = self.structure, len(self.odd), 0.5 * self.length
        k = np.zeros((len(self.varying), len(self.length)))
        row = {place: k[at] for at, place in enumerate(self.varying)}
        matrices = self.odd_by_even, self.even_by_odd
        for at in range(4 * n * n):
            if at in row:
                (which, power), (i, j) = divmod(at // (n * n), 2), divmod(at % (n * n), n)
                np.multiply(matrices[which][power, :, i, j], half, out=row[at])
        for end in (1, 0):
            for i in range(n):
                first = structure.condition(end, i)
                if any(place in row for place in range(first, first + 3 * n)):
                    self._enter_condition(row, first, end, i)
        self._enter_dispersion(row)
        return k

    def all_coefficients(self) -> Floats:
        """Return all coefficients, those that are known too."""
        return replace(self, known=None).coefficients()

    def _enter_condition(self, row: dict[int, Floats], first: int, end: int, i: int) -> None:
        """Enter the factors of a condition over 1 + k + m; O is reflected at the left end."""
        n = len(self.odd)
        stiffness, mass = self.stiffness[end, :, i], self.mass[end, :, i]
        held = np.isinf(stiffness)
        some = held.any()
        share = 1.0 / (1.0 + stiffness + mass)
        for j in range(n):
            sign = -1.0 if end == 0 and self.odd[i] != self.odd[j] else 1.0
            unit = 1.0 if i == j else 0.0
            ties = (0.0, 0.0) if self.ties is None else (self.ties[end, :, i, j], self.ties[end, :, j, i])
            for part, own in ((0, stiffness), (1, mass)):
                if first + part * n + j in row:
                    value = own * share if i == j else 0.0
                    if self.couplings is not None:
                        value = value + self.couplings[part, end, :, i, j] * (share * sign)
                    row[first + part * n + j][:] = (
                        np.where(held, unit - ties[0] if part == 0 else 0.0, value) if some else value
                    )
            if first + 2 * n + j in row:
                row[first + 2 * n + j][:] = share * (unit + ties[1])

    def _enter_dispersion(self, row: dict[int, Floats]) -> None:
        structure, n = self.structure, len(self.odd)
        for start, stop in structure.blocks:
            a, b = (
                [
                    [[row.get(first + shift + n * i + j, Exact(0)) for shift in (0, n * n)] for j in range(start, stop)]
                    for i in range(start, stop)
                ]
                for first in structure.matrices
            )
            for order in range(1, stop - start + 1):
                first = structure.table(start + order - 1)
                if any(place in row for place in range(first, first + _TERMS)):
                    for place, value in enumerate(_symmetric(b, a, order)[:_TERMS], start=first):
                        if place in row:
                            row[place][:] = 0.0 if isinstance(value, Exact) else value


Polynomial = list[Any]


def _times(first: Polynomial, second: Polynomial) -> Polynomial:
    found: Polynomial = [Exact(0)] * (len(first) + len(second) - 1)
    for i, one in enumerate(first):
        for j, other in enumerate(second):
            found[i + j] = found[i + j] + one * other
    return found


def _minor(matrix: list[list[Polynomial]], rows: tuple[int, ...], columns: tuple[int, ...]) -> Polynomial:
    if len(rows) == 1:
        return matrix[rows[0]][columns[0]]
    terms = []
    for at, column in enumerate(columns):
        rest = _minor(matrix, rows[1:], columns[:at] + columns[at + 1 :])
        term = _times(matrix[rows[0]][column], rest)
        terms.append(term if at % 2 == 0 else [-value for value in term])
    return [total(powers) for powers in zip(*terms, strict=True)]


def _symmetric(b: list[list[Polynomial]], a: list[list[Polynomial]], order: int) -> Polynomial:
    """Return an elementary symmetric function of the eigenvalues of ``b a`` (Cauchy and Binet), a polynomial in z."""
    sets = list(combinations(range(len(a)), order))
    terms = [_times(_minor(b, one, other), _minor(a, other, one)) for one in sets for other in sets]
    return [total(powers) for powers in zip(*terms, strict=True)]


def rigid_motions(problem: UniformProblem) -> Integers:
    """Return how many independent motions without strain energy and without deflected springs each row has.

    Exact: such a motion has P = 0, so ``q' = A_qq q`` with ``A_Pq q = 0``, and is zero where an end has stiffness. Only
    linear dependence of a few rows of numbers decides.
    """
    rows, n = problem.stiffness.shape[1:]
    result = np.zeros(rows, dtype=np.int64)
    sprung = problem.stiffness > 0.0
    coupled = np.zeros(rows, dtype=bool)
    if problem.couplings is not None:
        coupled |= problem.couplings[0].any(axis=(0, 2, 3))
    if problem.ties is not None:
        coupled |= problem.ties.any(axis=(0, 2, 3))
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
        stiffness = problem.end_rows(end, open_)[0]
        size = np.abs(stiffness).max(axis=2, keepdims=True)
        conditions.append(stiffness / np.where(size > 0.0, size, 1.0) @ motion)
    result[open_] = n - _ranks(np.concatenate(conditions, axis=1))
    return result


def _static_blocks(problem: UniformProblem, rows: Integers) -> tuple[Floats, Floats]:
    """Return A_qq and A_Pq at z = 0 times half the length, shape (rows, n, n) each."""
    h = 0.5 * problem.length[rows, None, None]
    a, b = problem.odd_by_even[0, rows] * h, problem.even_by_odd[0, rows] * h
    odd = np.array(problem.odd)
    even_row, even_column = ~odd[:, None], ~odd[None, :]
    gradient = np.where(even_row & ~even_column, b, np.where(~even_row & even_column, a, 0.0))
    force = np.where(even_row & even_column, a, np.where(~even_row & ~even_column, b, 0.0))
    return gradient, force


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
    found = ~_are_semidefinite(force)
    if problem.couplings is not None:
        for end in (0, 1):
            held = np.isinf(problem.stiffness[end])
            stiffness = np.where(held[:, :, None] | held[:, None, :], 0.0, problem.end_rows(end)[0])
            found |= ~_are_semidefinite(stiffness)
    return found


def _are_semidefinite(matrices: Floats) -> NDArray[np.bool_]:
    """Return where all principal minors of symmetric matrices are not negative, but for rounding."""
    n = matrices.shape[1]
    every = np.ones(len(matrices), dtype=bool)
    for size in range(1, n + 1):
        for places in combinations(range(n), size):
            entries = [[matrices[:, i, j] for j in places] for i in places]
            scale = reduce(np.multiply, [np.abs(entries[i][i]) for i in range(size)])
            every &= minors(entries)[0] >= (0.0 if size == 1 else -1e-14 * scale)
    return every
