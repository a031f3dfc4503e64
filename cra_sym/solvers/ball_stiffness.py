"""The exact number of natural frequencies below a point, proved in ball arithmetic; coefficients constant in spans.

Each span is halved until no piece with clamped ends has a natural frequency below the point. The number of frequencies
below it is then that of the negative eigenvalues of the dynamic stiffness, condensed piece by piece and including those
of the eliminated blocks (Wittrick and Williams, 1971).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

from .ball_spans import Span, Spanned
from .certificates import UndecidedError, decided, negatives

__all__ = ["BallStiffness"]

_MOST_LEVELS = 40


class _Point(NamedTuple):
    """A value of the parameter, s^2, and s where it is real or its imaginary part where the first order turns."""

    z: Any
    square: Any
    rate: Any
    turn: Any


@dataclass(frozen=True)
class BallStiffness:
    """A conservative problem ``y' = A y``, ``y = (q, w, P, r)``, in ball arithmetic.

    With gyroscopic terms the dynamic stiffness is a Hermitian matrix. At a frequency omega > 0 of a motion with the
    potential energy k/2 > 0 and the mass m the form of that motion falls at the rate ``k / omega + omega m``: where the
    potential energy is positive definite, negative eigenvalues count the frequencies as they do without these terms
    (Wittrick and Williams, 1982).

    Parameters
    ----------
    flint : module
    parts : callable
        Returns the problem in balls of the working precision, at z = omega^2 (arb), with gyroscopic terms at
        s = i omega (acb).
    zeros : int
        Number of rigid-body motions.
    gyroscopic : bool
    """

    flint: Any
    parts: Callable[[], Spanned]
    zeros: int
    gyroscopic: bool = False

    def count(self, point: Any) -> int:
        """Return the proved number of natural frequencies below a frequency in Hz (exact arb)."""
        return decided(self.flint, lambda: self._count(self._oscillating(2 * self.flint.arb.pi() * point)))

    def signature(self, rate: Any) -> int:
        """Return the proved number of negative eigenvalues of the dynamic stiffness of motions ``exp(s t)``, s real.

        With dampers and forces that have a potential that is a symmetric matrix. Where the number changes by k, at
        least k eigenvalues s lie between, multiplicities counted.

        Parameters
        ----------
        rate : arb
            s in rad/s, the parameter of the problem.
        """
        return self._count(_Point(rate, rate**2, rate, self.flint.arb(0)))

    def _oscillating(self, omega: Any) -> _Point:
        turning = self.gyroscopic
        zero = self.flint.arb(0)
        return _Point(self.flint.acb(0, omega) if turning else omega**2, -(omega**2), zero, omega if turning else zero)

    @property
    def _matrix(self) -> Any:
        return self.flint.acb_mat if self.gyroscopic else self.flint.arb_mat

    def _count(self, point: _Point) -> int:
        of, parts, z = self._matrix, self.parts(), point.z
        stiffness, fixed = self._span(parts.spans[0], parts, point)
        for node, span in zip(parts.nodes, parts.spans[1:], strict=True):
            right, within = self._span(span, parts, point)
            stiffness, eliminated = self._joined(stiffness, right, parts, [m.at(z) for m in node.forces], node.held)
            fixed += within + eliminated
        if not parts.free:
            return fixed
        total = stiffness + of(parts.boundary.at(z))
        basis = of([list(row) for row in zip(*parts.free, strict=True)])
        return fixed + negatives((basis.transpose() * total * basis).tolist())

    def _span(self, span: Span, parts: Spanned, point: _Point) -> tuple[Any, int]:
        """Return the dynamic stiffness of a span and its number of natural frequencies with clamped ends."""
        levels = self._levels(span, point)
        step = span.length / 2**levels
        transfer = self._matrix([[entry * step for entry in row] for row in span.system.at(point.z)]).exp()
        stiffness, fixed = self._piece(transfer, parts), 0
        for _ in range(levels):
            stiffness, eliminated = self._joined(stiffness, stiffness, parts)
            fixed = 2 * fixed + eliminated
        return stiffness, fixed

    def _levels(self, span: Span, point: _Point) -> int:
        """Return the number of halvings for which no piece with clamped ends has a natural frequency below the point.

        Functions that vanish at both ends of a piece of length h, with all derivatives but the highest, obey
        |p| <= (h / pi)^gap |highest derivative| in the norm of square integrals (Poincare's inequality), so the energy
        is positive where the highest derivatives outweigh all other terms.
        """
        _, square, rate, turn = point
        terms = [(t.fields, t.gaps, t.stiffness + rate * t.first + square * t.mass) for t in span.terms]
        terms += [(t.fields, t.gaps, -abs(turn * t.first)) for t in span.terms if t.first != 0]
        own = {f[0]: value for f, gaps, value in terms if gaps == (0, 0) and f[0] == f[1]}
        if not all(value > 0 for value in own.values()):
            raise UndecidedError("the stiffness of a highest derivative is not positive")
        size = {field: value.sqrt() for field, value in own.items()}
        others = [
            (sum(gaps), abs(value) / (size[f[0]] * size[f[1]]))
            for f, gaps, value in terms
            if not (gaps == (0, 0) and f[0] == f[1]) and not (f[0] == f[1] and gaps[0] == gaps[1] and value >= 0)
        ]
        share = span.length / self.flint.arb.pi()
        for levels in range(_MOST_LEVELS):
            if sum((value * share**gap for gap, value in others), self.flint.arb(0)) < 1:
                return levels
            share = share / 2
        raise UndecidedError("the waves are too short")

    def _piece(self, transfer: Any, parts: Spanned) -> Any:
        """Return the dynamic stiffness of a piece in the order (q(0), w, q(h)) from its transfer matrix."""
        n, m = parts.displacements, parts.coordinates
        size = n + m

        def block(rows: range, columns: range) -> Any:
            return self._matrix(len(rows), len(columns), [transfer[i, j] for i in rows for j in columns])

        q, force, lumped = range(n), range(size, size + n), range(size + n, 2 * size)
        flexible = block(q, force).inv()
        identity = self._matrix(n, n, [int(i == j) for i in range(n) for j in range(n)])
        start = -1 * (flexible * block(q, range(size)))  # P(0) = start (q(0), w) + flexible q(h)
        rows: list[list[Any]] = [[None] * (2 * n + m) for _ in range(2 * n + m)]

        def put(index: range, left: Any, right: Any) -> None:
            for i, row in enumerate(index):
                for j in range(size):
                    rows[row][j] = left[i, j]
                for j in range(n):
                    rows[row][size + j] = right[i, j]

        put(range(n), -1 * start, -1 * flexible * identity)
        ends = [(range(size, size + n), force)] + ([(range(n, size), lumped)] if m else [])
        for target, source in ends:
            by_force = block(source, force)
            put(target, block(source, range(size)) + by_force * start, by_force * flexible)
        return self._matrix(rows)

    def _joined(
        self, first: Any, second: Any, parts: Spanned, forces: Sequence[Any] = (), held: Sequence[int] = ()
    ) -> tuple[Any, int]:
        """Return the stiffness of two pieces, their common section eliminated, and its negative eigenvalues.

        ``forces`` act at that section on (q, w), and some of its displacements may be ``held``.
        """
        n, m = parts.displacements, parts.coordinates
        size = 2 * n + m
        middle = range(size, size + n)
        total = [[self.flint.arb(0)] * (size + n) for _ in range(size + n)]
        added = [([*range(n), *range(n, n + m), *middle], first.tolist())]  # q(0), w, middle
        added += [([*middle, *range(n, n + m), *range(n + m, size)], second.tolist())]  # middle, w, q(2 h)
        added += [([*middle, *range(n, n + m)], rows) for rows in forces]
        for places, rows in added:
            for row, values in zip(places, rows, strict=True):
                for column, value in zip(places, values, strict=True):
                    total[row][column] = total[row][column] + value
        moving = [place for k, place in enumerate(middle) if k not in held]
        outer = self._matrix([row[:size] for row in total[:size]])
        if not moving:
            return outer, 0
        inner = self._matrix([[total[i][j] for j in moving] for i in moving])
        across = self._matrix([total[i][:size] for i in moving])
        back = self._matrix([[row[j] for j in moving] for row in total[:size]])
        return outer - back * inner.solve(across), negatives(inner.tolist())
