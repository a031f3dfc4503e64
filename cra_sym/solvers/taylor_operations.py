"""The series of :mod:`cra_sym.solvers.taylor` as a list of operations on vectors, for its compiled version.

The vectors of one coefficient are q, p and the forces; u = dq/dt where the mass oscillates, else p is u; sums; and last
the rows that are multiplied by the oscillations, which are kept for all later coefficients.
"""

from __future__ import annotations

from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from cra_sym.solvers.periodic_systems import PeriodicSystem
from cra_sym.solvers.taylor import LEAST_ORDER, SHARE, factors, mass_and_inverse, step_coefficients

__all__ = ["Loop", "Operations"]

Array = NDArray[np.float64]
_SET, _ADD, _SERIES = 0, 1, 2  # a linear combination, set or added; with _SERIES a product of series
_CACHED = 1 << 15  # numbers that a chunk of systems works on
_FEWEST = 16  # systems in a chunk, or a multiple of it: loops over all columns then leave no rest for SIMD code
_MOST = 1 << 22  # numbers of coefficients or inverse masses that are given at a time


class Loop(Protocol):
    """The compiled loop."""

    def __call__(
        self,
        kinds: NDArray[np.int64],
        targets: NDArray[np.int64],
        starts: NDArray[np.int64],
        sources: NDArray[np.int64],
        swings: NDArray[np.int64],
        shared: NDArray[np.int64],
        values: Array,
        first_inverse: int,
        inverse: Array,
        kept: int,
        rows: int,
        moved: int,
        waves: Array,
        counts: NDArray[np.int64],
        sizes: Array,
        soft_rows: NDArray[np.int64],
        soft: Array,
        h: Array,
        rate: Array,
        limit: float,
        least: int,
        order: int,
        chunk: int,
        out: Array,
    ) -> None:
        """Write the maps over all steps to ``out``, shape (points, 2N, 2N).

        Parameters
        ----------
        kinds, targets, swings : ndarray, shape (operations,)
            What an operation does to its target: set it to a linear combination of vectors, or add that; set it to a
            coefficient of the product of an oscillation, of this number, and the series of one vector, or add that.
        starts : ndarray, shape (operations + 1,)
            Where the entries of every operation start.
        sources, shared : ndarray, shape (entries,)
            The vector of an entry, and whether all systems have the same factor.
        values : ndarray, shape (entries, points) or (entries, 1)
            The factors.
        first_inverse, inverse : int; ndarray, shape (steps, those entries, points)
            The entries from ``first_inverse`` on are the inverse of the mass at the start of the step.
        kept, rows, moved : int
            Index of the first vector that is kept, number of these for each coefficient, index of the first one of u.
        waves : ndarray, shape (steps, R, order)
            Coefficients of the oscillations, of which the first ``counts`` are used.
        sizes : ndarray, shape (R, points)
        soft_rows, soft : ndarray, shapes (R,), (rows, points)
            Row of the compliance of an oscillation, or -1; the compliances times the sizes.
        h, rate : ndarray, shape (points,)
            Step, and the rate by which displacements are compared with momenta.
        limit : float
            Size of the next coefficient, relative to the state, at which a step ends; 0 for the whole order.
        least, order : int
            Number of coefficients that the first step is expected to take, and the largest number.
        chunk : int
            Number of systems that are propagated together, not more than there are.
        """


class Operations:
    """The operations of a batch of systems."""

    def __init__(self, system: PeriodicSystem, loop: Loop) -> None:
        self.system, self.loop, self.size = system, loop, len(system.stiffness)
        n = self.size
        momenta = [factors(s.momentum, s.mass) for s in system.swings]
        forces = [factors(s.stiffness, s.damping) for s in system.swings]
        resisting, _, damping = factors(None, system.damping if system.damping.any() else None)
        masses = [s.mass for s in system.swings if s.mass is not None]
        self.moved = 3 * n if masses else n
        self.sums = 4 * n if masses else 3 * n
        self.kept = self.sums + sum(left.shape[1] for left, *_ in (*momenta, *forces) if left is not None)
        self.kept += 0 if resisting is None else resisting.shape[1]
        self.rows = 0
        self.operations: list[tuple[int, int, int]] = []  # kind, target, oscillation
        self.starts = [0]
        self.entries: list[tuple[int, Array]] = []  # source, factor of one or of all systems
        unknown = []  # rows without what u adds, which depends on them
        for swing, (left, of_q, of_u) in enumerate(momenta):
            unknown.append((self._rows((of_q, 0), (None if of_u is None else 0 * of_u, 0)), of_u))
            self._multiply(swing, left, *unknown[-1][0], n, -1.0)
        self.first_inverse, off = len(self.entries), ~np.eye(n, dtype=bool)[..., None]
        self.inverse = np.zeros((n, n), bool)
        if masses:
            self.inverse |= any((m * off).any() for m in masses) | ~off[..., 0]
            self._combine(_SET, self.moved, (np.where(self.inverse[..., None], np.nan, 0.0), n))
        for (first, _), of_u in unknown:
            self._combine(_ADD, first, (of_u, self.moved))
        own = (damping, self.moved)
        if resisting is not None:
            self.sums += self._combine(_SET, self.sums, own)
            own = (resisting, self.sums - resisting.shape[1])
        self._combine(_SET, 2 * n, (system.stiffness, 0), own)
        for swing, (left, of_q, of_u) in enumerate(forces):
            self._multiply(swing, left, *self._rows((of_q, 0), (of_u, self.moved)), 2 * n, 1.0)

    def _combine(self, kind: int, target: int, *matrices: tuple[Array | None, int]) -> int:
        """Append products of matrices and the vectors from the given ones on; return their number of rows."""
        there = [(matrix, first) for matrix, first in matrices if matrix is not None]
        count = len(there[0][0]) if there else 0
        for row in range(count):
            for matrix, first in there:
                columns = np.nonzero(matrix[row].any(axis=-1))[0]
                self.entries += [(first + int(column), matrix[row, column]) for column in columns]
            self._operate(kind, target + row)
        return count

    def _operate(self, kind: int, target: int, swing: int = 0) -> None:
        self.operations.append((kind, target, swing))
        self.starts.append(len(self.entries))

    def _rows(self, *matrices: tuple[Array | None, int]) -> tuple[int, int]:
        """Append rows that are kept; return the first one and their number."""
        first = self.kept + self.rows
        count = self._combine(_SET, first, *matrices)
        self.rows += count
        return first, count

    def _multiply(self, swing: int, left: Array | None, first: int, count: int, target: int, sign: float) -> None:
        """Append the product of an oscillation and the series of rows, times a left factor, added to the target."""
        into, kind = (target, _ADD) if left is None else (self.sums, _SET)
        for row in range(count):
            self.entries.append((first + row, np.array([sign])))
            self._operate(_SERIES + kind, into + row, swing)
        if left is not None:
            self._combine(_ADD, target, (left, self.sums))
            self.sums += count

    def maps(
        self, index: NDArray[np.intp], rate: Array, steps: int, order: int, tolerance: float, *, half: bool
    ) -> Array:
        """Return the maps of some of the systems over a period, or over half of it, shape (points, 2N, 2N)."""
        system, number = self.system.take(index), steps // 2 if half else steps
        most = max(1, _MOST // max(1, order * len(system.swings), int(self.inverse.sum()) * index.size))
        total: Array | None = None
        for start in range(0, number, most):
            some = range(start, min(start + most, number))
            found = self._propagated(system, index, rate, some, steps, order, tolerance)
            total = found if total is None else found @ total
        assert total is not None
        return total

    def _propagated(
        self,
        system: PeriodicSystem,
        index: NDArray[np.intp],
        rate: Array,
        some: range,
        steps: int,
        order: int,
        tolerance: float,
    ) -> Array:
        """Return the maps over some of the steps of a period."""
        waves = np.zeros((len(some), len(system.swings), order))
        inverse = np.empty((len(some), int(self.inverse.sum()), index.size))
        counts = np.zeros(len(system.swings), dtype=np.int64)
        for row, step in enumerate(some):
            found = [step_coefficients(s.oscillation, step, steps, order - 1, SHARE * tolerance) for s in system.swings]
            for swing, wave in enumerate(found):
                counts[swing] = len(wave)
                waves[row, swing, : len(wave)] = wave
            masses = mass_and_inverse(system, found)
            if masses is not None:
                inverse[row] = masses[1][self.inverse]
        factors = [factor if factor.size == 1 else factor[index] for _, factor in self.entries]
        points = max(factor.size for factor in factors)
        shared = np.array([factor.size == 1 for factor in factors], dtype=np.int64)
        shared[self.first_inverse : self.first_inverse + inverse.shape[1]] = 0
        flexible = np.array([s.compliance is not None for s in system.swings], dtype=bool)
        soft = [s.size * s.compliance for s in system.swings if s.compliance is not None]
        kinds, targets, swings = np.array(self.operations, dtype=np.int64).reshape(-1, 3).T.copy()
        numbers = 2 * self.size * (self.kept + order * self.rows)
        out = np.empty((index.size, 2 * self.size, 2 * self.size))
        self.loop(
            kinds,
            targets,
            np.array(self.starts, dtype=np.int64),
            np.array([source for source, _ in self.entries], dtype=np.int64),
            swings,
            shared,
            np.array([np.broadcast_to(factor, points) for factor in factors]),
            self.first_inverse,
            inverse,
            self.kept,
            self.rows,
            self.moved,
            waves,
            counts,
            np.array([s.size for s in system.swings]).reshape(-1, index.size),
            np.where(flexible, np.cumsum(flexible) - 1, -1),
            np.array(soft).reshape(-1, index.size),
            system.period / steps,
            rate,
            tolerance / steps,
            LEAST_ORDER,
            order,
            min(index.size, max(_FEWEST, _CACHED // numbers // _FEWEST * _FEWEST)),
            out,
        )
        return out
