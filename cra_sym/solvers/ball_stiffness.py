"""The exact number of natural frequencies below a point, proved in ball arithmetic, for uniform problems of any kind.

The interval is halved until no piece with clamped ends has a natural frequency below the point. The number of
frequencies below it is then that of the negative eigenvalues of the dynamic stiffness, condensed piece by piece and
including those of the eliminated blocks (Wittrick and Williams, 1971).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

from .certificates import UndecidedError, decided, negatives

__all__ = ["BallStiffness", "EnergyTerm"]

_MOST_LEVELS = 40


class EnergyTerm(NamedTuple):
    """A term ``value p q`` of the energy density, p and q derivatives of fields.

    Attributes
    ----------
    fields : (int, int)
    gaps : (int, int)
        Orders by which p and q lie below the highest derivative of their field.
    stiffness, gyroscopic, mass : arb
        ``value = stiffness + i omega gyroscopic - omega^2 mass``.
    """

    fields: tuple[int, int]
    gaps: tuple[int, int]
    stiffness: Any
    gyroscopic: Any
    mass: Any


@dataclass(frozen=True)
class BallStiffness:
    """A uniform conservative problem ``y' = A y``, ``y = (q, w, P, r)``, in ball arithmetic.

    With gyroscopic terms the dynamic stiffness is a Hermitian matrix. At a frequency omega > 0 of a motion with the
    potential energy k/2 > 0 and the mass m the form of that motion falls at the rate ``k / omega + omega m``: where the
    potential energy is positive definite, negative eigenvalues count the frequencies as they do without these terms
    (Wittrick and Williams, 1982).

    Parameters
    ----------
    flint : module
    system, boundary : callable
        Matrices A and B at z = omega^2 (arb), with gyroscopic terms at s = i omega (acb), as rows.
    length : callable
        Returns the length (arb).
    displacements, coordinates : int
        n and m.
    free : callable
        Returns the columns that span the motions the supports allow.
    terms : callable
        Returns the terms of the energy density.
    zeros : int
        Number of rigid-body motions.
    gyroscopic : bool
    """

    flint: Any
    system: Callable[[Any], Sequence[Sequence[Any]]]
    boundary: Callable[[Any], Sequence[Sequence[Any]]]
    length: Callable[[], Any]
    displacements: int
    coordinates: int
    free: Callable[[], Sequence[Sequence[Any]]]
    terms: Callable[[], Sequence[EnergyTerm]]
    zeros: int
    gyroscopic: bool = False

    def count(self, point: Any) -> int:
        """Return the proved number of natural frequencies below a frequency in Hz (exact arb)."""
        return decided(self.flint, lambda: self._count(2 * self.flint.arb.pi() * point))

    @property
    def _matrix(self) -> Any:
        return self.flint.acb_mat if self.gyroscopic else self.flint.arb_mat

    def _count(self, omega: Any) -> int:
        of, n, m = self._matrix, self.displacements, self.coordinates
        z = self.flint.acb(0, omega) if self.gyroscopic else omega**2
        length = self.length()
        levels = self._levels(omega, length)
        step = length / 2**levels
        matrix = of([[entry * step for entry in row] for row in self.system(z)]).exp()
        stiffness = self._piece(matrix)
        fixed = 0
        for _ in range(levels):
            stiffness, eliminated = self._joined(stiffness)
            fixed = 2 * fixed + eliminated
        total = stiffness + of([list(row) for row in self.boundary(z)])
        columns = self.free()
        if not columns:
            return fixed
        basis = of([[column[i] for column in columns] for i in range(2 * n + m)])
        return fixed + negatives((basis.transpose() * total * basis).table())

    def _levels(self, omega: Any, length: Any) -> int:
        """Return the number of halvings for which no piece with clamped ends has a natural frequency below omega.

        Functions that vanish at both ends of a piece of length h, with all derivatives but the highest, obey
        |p| <= (h / pi)^gap |highest derivative| in the norm of square integrals (Poincare's inequality), so the energy
        is positive where the highest derivatives outweigh all other terms.
        """
        terms = [(t.fields, t.gaps, t.stiffness - omega**2 * t.mass) for t in self.terms()]
        terms += [(t.fields, t.gaps, -abs(omega * t.gyroscopic)) for t in self.terms() if t.gyroscopic != 0]
        own = {f[0]: value for f, gaps, value in terms if gaps == (0, 0) and f[0] == f[1]}
        if not all(value > 0 for value in own.values()):
            raise UndecidedError("the stiffness of a highest derivative is not positive")
        size = {field: value.sqrt() for field, value in own.items()}
        others = [
            (sum(gaps), abs(value) / (size[f[0]] * size[f[1]]))
            for f, gaps, value in terms
            if not (gaps == (0, 0) and f[0] == f[1]) and not (f[0] == f[1] and gaps[0] == gaps[1] and value >= 0)
        ]
        share = length / self.flint.arb.pi()
        for levels in range(_MOST_LEVELS):
            if sum((value * share**gap for gap, value in others), self.flint.arb(0)) < 1:
                return levels
            share = share / 2
        raise UndecidedError("the waves are too short")

    def _piece(self, transfer: Any) -> Any:
        """Return the dynamic stiffness of a piece in the order (q(0), w, q(h)) from its transfer matrix."""
        n, m = self.displacements, self.coordinates
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

    def _joined(self, matrix: Any) -> tuple[Any, int]:
        """Return the stiffness of two like pieces, their common section eliminated, and its negative eigenvalues."""
        n, m = self.displacements, self.coordinates
        size = 2 * n + m
        left = [*range(n), *range(n, n + m), *range(size, size + n)]  # q(0), w, middle
        right = [*range(size, size + n), *range(n, n + m), *range(n + m, size)]  # middle, w, q(2 h)
        total = [[self.flint.arb(0)] * (size + n) for _ in range(size + n)]
        for places in (left, right):
            for i, row in enumerate(places):
                for j, column in enumerate(places):
                    total[row][column] = total[row][column] + matrix[i, j]
        middle = self._matrix([row[size:] for row in total[size:]])
        across = self._matrix([row[:size] for row in total[size:]])
        back = self._matrix([row[size:] for row in total[:size]])
        outer = self._matrix([row[:size] for row in total[:size]])
        return outer - back * middle.solve(across), negatives(middle.table())
