"""Uniform spans between interior places, with their matrices in an exact arithmetic: input of proved counts."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

__all__ = ["EnergyTerm", "Node", "RationalMatrix", "Span", "Spanned", "multiplicity", "static_solutions"]

Rows = list[list[Any]]


class EnergyTerm(NamedTuple):
    """A term ``value p q`` of the energy density, p and q derivatives of fields.

    Attributes
    ----------
    fields : (int, int)
    gaps : (int, int)
        Orders by which p and q lie below the highest derivative of their field.
    stiffness, first, mass : arb
        ``value = stiffness + s first + s^2 mass``.
    """

    fields: tuple[int, int]
    gaps: tuple[int, int]
    stiffness: Any
    first: Any
    mass: Any


@dataclass(frozen=True)
class RationalMatrix:
    """A matrix of rational functions of the parameter z, or s.

    Attributes
    ----------
    columns : int
    entries : sequence of (sequence, sequence)
        Row by row: coefficients of numerator and denominator, the constant ones first.
    """

    columns: int
    entries: Sequence[tuple[Sequence[Any], Sequence[Any]]]

    def _rows(self, entries: Sequence[Any]) -> Rows:
        return [list(entries[k : k + self.columns]) for k in range(0, len(entries), self.columns)]

    def at(self, z: Any) -> Rows:
        """Return the matrix at a value of the parameter."""
        return self._rows([_horner(p, z) if len(q) == 1 else _horner(p, z) / _horner(q, z) for p, q in self.entries])

    def bound(self, radius: Any) -> Rows | None:
        """Return what no entry exceeds in modulus where the parameter does not exceed the radius; None if one may."""
        found = []
        for numerator, denominator in self.entries:
            size = _horner([abs(value) for value in numerator], radius)
            if len(denominator) > 1:
                first, *rest = (abs(value) for value in denominator)
                least = first - radius * _horner(rest, radius)
                if not least > 0:
                    return None
                size = size / least
            found.append(size)
        return self._rows(found)

    def shifted(self, point: Any) -> RationalMatrix:
        """Return the matrix as a function of the distance of the parameter from a point."""
        return RationalMatrix(self.columns, [(_about(p, point), _about(q, point)) for p, q in self.entries])

    def series(self, order: int) -> list[Rows]:
        """Return the first coefficients of the power series of the matrix about zero, one matrix for each power."""
        entries = []
        for numerator, denominator in self.entries:
            first, *rest = denominator
            found: list[Any] = []
            for k in range(order):
                value = numerator[k] if k < len(numerator) else 0 * first
                found.append((value - sum(q * found[k - 1 - j] for j, q in enumerate(rest[:k]))) / first)
            entries.append(found)
        return [self._rows([entry[k] for entry in entries]) for k in range(order)]


def _horner(coefficients: Sequence[Any], z: Any) -> Any:
    *lower, value = coefficients
    for coefficient in reversed(lower):
        value = value * z + coefficient
    return value


def _about(coefficients: Sequence[Any], point: Any) -> list[Any]:
    """Return the coefficients of a polynomial in the distance from a point, by repeated division."""
    found = list(coefficients)
    for first in range(len(found) - 1):
        for k in range(len(found) - 2, first - 1, -1):
            found[k] = found[k] + point * found[k + 1]
    return found


class Span(NamedTuple):
    """A part along x with constant coefficients: A of ``y' = A y``, ``y = (q, w, P, r)``, its length, its energy."""

    system: RationalMatrix
    length: Any
    terms: Sequence[EnergyTerm]


class Node(NamedTuple):
    """What acts between two spans: terms of the growth of (P, r) per unit of (q, w); displacements that are held."""

    forces: Sequence[RationalMatrix]
    held: tuple[int, ...]


@dataclass(frozen=True)
class Spanned:
    """A problem in one exact arithmetic, balls of one precision or fractions.

    Attributes
    ----------
    displacements, coordinates : int
        n and m.
    spans, nodes : sequence
        One node fewer than spans.
    boundary : RationalMatrix
        In the order (q(left), w, q(right)).
    free : sequence of columns
        They span the motions that the supports of the ends allow.
    """

    displacements: int
    coordinates: int
    spans: Sequence[Span]
    nodes: Sequence[Node]
    boundary: RationalMatrix
    free: Sequence[Sequence[Any]]

    @property
    def even(self) -> bool:
        """Whether the parameter occurs in even powers alone, as s does without dampers."""
        matrices = [
            self.boundary,
            *(span.system for span in self.spans),
            *(m for node in self.nodes for m in node.forces),
        ]
        return not any(value != 0 for m in matrices for entry in m.entries for part in entry for value in part[1::2])

    def conditions(
        self,
        at: Callable[[RationalMatrix], Rows],
        carried: Callable[[Span, Rows], Rows],
        sign: int = -1,
    ) -> Rows:
        """Return the conditions of a motion, as many as unknowns: the matrix whose determinant vanishes at eigenvalues.

        Unknowns are factors of the free motions, the forces P at the left end and the reactions of supports inside;
        conditions are continuity at the right end, the balance of forces on free motions, and the supports.

        Parameters
        ----------
        at : callable
            Returns the rows of a matrix at the parameter's value.
        carried : callable
            Returns states at the right end of a span, row by row per unit of each unknown, from those at its left end.
        sign : int
            -1; or 1, of what is subtracted, which makes bounds of bounds.
        """
        n, m, columns = self.displacements, self.coordinates, self.free
        moved: Rows = [[column[i] for column in columns] for i in range(2 * n + m)]
        reactions = sum(len(node.held) for node in self.nodes)
        width = len(columns) + n + reactions
        state: Rows = [row + [0] * (width - len(columns)) for row in moved[: n + m]]
        state += [[int(k == len(columns) + i) for k in range(width)] for i in range(n)] + [[0] * width] * m
        start, held = state[n + m : 2 * n + m], []
        for number, span in enumerate(self.spans):
            if number:
                node = self.nodes[number - 1]
                held += [state[place] for place in node.held]
                for forces in node.forces:
                    jump = _times(at(forces), state[: n + m])
                    state = state[: n + m] + [_sum(row, more) for row, more in zip(state[n + m :], jump, strict=True)]
                first = width - reactions + len(held) - len(node.held)
                for k, place in enumerate(node.held):
                    row = list(state[n + m + place])
                    row[first + k] = row[first + k] + 1
                    state[n + m + place] = row
            state = carried(span, state)
        still = [row + [0] * (width - len(columns)) for row in moved]
        rows = [_sum(state[i], [sign * value for value in still[n + m + i]]) for i in range(n)]
        inner = [[sign * value for value in row] for row in start] + state[2 * n + m :] + state[n + m : 2 * n + m]
        whole = [_sum(force, more) for force, more in zip(inner, _times(at(self.boundary), still), strict=True)]
        return rows + _times(columns, whole) + held

    def _each(self, change: Callable[[RationalMatrix], RationalMatrix]) -> Spanned:
        """Return the problem with all matrices changed."""
        return replace(
            self,
            spans=[span._replace(system=change(span.system)) for span in self.spans],
            nodes=[node._replace(forces=[change(one) for one in node.forces]) for node in self.nodes],
            boundary=change(self.boundary),
        )

    def shifted(self, point: Any) -> Spanned:
        """Return the problem with the distance of the parameter from a point as its parameter."""
        return self._each(lambda matrix: matrix.shifted(point))

    def jets(self, order: int) -> Spanned:
        """Return the problem of the first coefficients of motions that are power series in the parameter, at zero.

        It has ``order`` times as many displacements. With s = 0 as an eigenvalue the number of its solutions is the sum
        of the lengths of the Jordan chains there, none counted beyond the order.
        """

        def block(matrix: RationalMatrix) -> RationalMatrix:
            parts = matrix.series(order)
            size = len(parts[0])
            entries = [
                ([parts[a - b][i][j] if a >= b else 0 * parts[0][i][j]], [1])
                for i in range(size)
                for a in range(order)
                for j in range(matrix.columns)
                for b in range(order)
            ]
            return RationalMatrix(matrix.columns * order, entries)

        def several(places: tuple[int, ...]) -> tuple[int, ...]:
            return tuple(place * order + a for place in places for a in range(order))

        whole = self._each(block)
        return replace(
            whole,
            displacements=self.displacements * order,
            coordinates=self.coordinates * order,
            nodes=[node._replace(held=several(node.held)) for node in whole.nodes],
            free=[
                [value if a == b else 0 for value in c for a in range(order)] for c in self.free for b in range(order)
            ],
        )


def static_solutions(flint: Any, problem: Spanned) -> int:
    """Return the number of independent solutions at z = 0 that are polynomials in x, from exact numbers.

    Parameters
    ----------
    flint : module
    problem : Spanned
        In fractions (fmpq).
    """
    of, extra = flint.fmpq_mat, list[list[Any]]()

    def carried(span: Span, state: Rows) -> Rows:
        rows = span.system.at(flint.fmpq(0))
        if not rows:
            return state
        matrix, found = of(rows), of(state)
        term = found
        for power in range(1, len(rows) + 1):
            term = matrix * term * (span.length / power)
            found = found + term
        extra.extend(term.tolist())  # of a polynomial this power is zero
        return list((found - term).tolist())

    rows = problem.conditions(lambda matrix: matrix.at(flint.fmpq(0)), carried) + extra
    return len(rows[0]) - of(rows).rank() if rows and rows[0] else 0


def multiplicity(flint: Any, problem: Spanned, at_least: int) -> int:
    """Return the multiplicity of z = 0 as an eigenvalue, of solutions that are polynomials in x: a lower bound of all.

    Parameters
    ----------
    flint : module
    problem : Spanned
        In fractions (fmpq).
    at_least : int
        The number of these solutions.
    """
    before, found, order = 0, at_least, 2
    while before != found:
        before, found = found, static_solutions(flint, problem.jets(order))
        order += 1
    return found


def _sum(row: Sequence[Any], other: Sequence[Any]) -> list[Any]:
    return [a + b for a, b in zip(row, other, strict=True)]


def _times(left: Sequence[Sequence[Any]], right: Sequence[Sequence[Any]]) -> Rows:
    width = len(right[0]) if right else 0
    return [
        [sum(factor * other[k] for factor, other in zip(row, right, strict=True)) for k in range(width)] for row in left
    ]
