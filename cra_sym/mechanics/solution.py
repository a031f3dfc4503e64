"""The general solution of a spatial problem as matrices: displacements, forces and conditions of ends and places."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from functools import cmp_to_key
from typing import Literal

from sympy import Add, Expr, Heaviside, Matrix, S, Symbol, sin, sinh, zeros

from cra_sym.cached import cached_property
from cra_sym.mechanics.basis import Naming, general_solution
from cra_sym.mechanics.jets import HamiltonError, Jet
from cra_sym.mechanics.state_form import end_displacements
from cra_sym.mechanics.weak import PointForm, WeakForm, polynomial

__all__ = ["GeneralSolution"]


class GeneralSolution:
    """Rows of coefficients of the unknowns: constants of the basis, amplitudes of coordinates, jumps of forces.

    To the right of an interior place the motion due to a unit jump of one natural force is added. The jumps caused by
    inertia, springs or a support are unknowns.

    Parameters
    ----------
    weak : WeakForm
        With coefficients that do not depend on x. Interior places ascend in the order in which they are stated, where
        their difference has no known sign.
    frequency : Symbol
        omega, or s if odd powers of s occur.
    kind : {'hyperbolic', 'decaying'}
        See `general_solution`.
    names : callable
        Makes a symbol that is not in use.
    """

    def __init__(
        self, weak: WeakForm, frequency: Symbol, kind: Literal["hyperbolic", "decaying"], names: Naming
    ) -> None:
        self.weak = weak
        self.parameter = frequency**2 if weak.even else frequency
        self.section, self.highest, self.lumped = weak.fields()
        space = weak.variation.space
        self.length = space.ends["right"] - space.ends["left"]
        r = names("r")
        count = len(self.highest)
        operator = Matrix(count, count, lambda p, q: self._operator(p, q, r))
        self.basis = general_solution(operator, r, space.x - space.ends["left"], self.length, kind, names)
        self.size = len(self.basis.functions)
        if self.size != 2 * len(self.section):
            raise HamiltonError("separate: the density is singular in its highest derivatives")
        self.known = self._frequency_of_wave_number(frequency)
        self.still = self._still(operator.subs(r, 0))
        self.points = _ascending(weak.points, space.ends["left"], space.ends["right"])
        self.jumps = [(point, jet) for point in self.points for jet in self.section if _acts(point, jet)]
        self.columns = self.size + len(self.lumped) + len(self.jumps)
        self._names = names

    def stiffness(self, varied: Jet, jet: Jet, ends: bool = False) -> Expr:
        """Return the stiffness between two displacements at this frequency."""
        form = self.weak.ends if ends else self.weak.inside
        return polynomial(form.get((varied, jet), {}).items(), self.parameter, self.weak.even)

    def _operator(self, p: int, q: int, r: Symbol) -> Expr:
        rows, columns = (range(self.highest[number].space + 1) for number in (p, q))
        return Add(
            *(
                (-1) ** a * r ** (a + b) * self.stiffness(Jet(p, a, 0, None), Jet(q, b, 0, None))
                for a in rows
                for b in columns
            )
        )

    def _frequency_of_wave_number(self, frequency: Symbol) -> dict[Expr, Expr]:
        """Return omega**2 in terms of the wave number if there is a single one."""
        if len(self.basis.wave_numbers) > 1 or not self.weak.even:
            return {}
        square = frequency**2
        residual = (self.basis.dispersion.lhs - self.basis.dispersion.rhs).expand()
        slope = residual.coeff(square)
        rest = (residual - slope * square).expand()
        return {} if slope == 0 or rest.has(frequency) else {square: -rest / slope}

    def _still(self, zero_order: Matrix) -> Matrix:
        """Return the constant displacement of each field that a unit amplitude of each coordinate causes."""
        fields = [jet._replace(space=0) for jet in self.highest]
        pull = Matrix(len(fields), len(self.lumped), lambda i, k: self.stiffness(fields[i], self.lumped[k]))
        if pull.is_zero_matrix:
            return pull
        if zero_order.det() == 0:
            raise HamiltonError(
                "separate: a coordinate drives a motion without a constant solution; use the state form"
            )
        return -zero_order.inv() * pull

    # ------------------------------------------------------------------------------------------------ stations

    def _values(self, offset: Expr) -> Matrix:
        """Return the functions of the basis at a distance from the left end, as newly defined symbols."""
        space = self.weak.variation.space
        values, relations = dict(self.basis.values), list(self.basis.relations)
        row: list[Expr] = []
        known = {value: symbol for symbol, value in values.items()}
        for function in self.basis.functions:
            sign, value = function.subs(space.x, space.ends["left"] + offset).as_coeff_Mul()
            if value not in known:
                symbol = known[value] = self._names(f"{value.func.__name__}_{len(values) + 1}")
                values[symbol] = value
                if isinstance(value, (sin, sinh)):  # behind cos and cosh
                    relations.append((symbol, 1 - row[-1] ** 2 if isinstance(value, sin) else row[-1] ** 2 - 1))
            row.append(sign * known[value])
        self.basis = replace(self.basis, values=values, relations=tuple(relations))
        return Matrix([row])

    @cached_property
    def _stations(self) -> tuple[Matrix, list[Matrix], Matrix]:
        """The functions at the left end, at every place and at the right end; below them those that start at places."""
        left = self.weak.variation.space.ends["left"]
        nothing = zeros(len(self.points), self.size)
        if not self.points:
            return self.basis.left, [], self.basis.right
        places = []
        for number, point in enumerate(self.points):
            begun = [self._values(point.place - other.place) for other in self.points[:number]]
            at = Matrix.vstack(self._values(point.place - left), *begun)
            places.append(Matrix.vstack(at, nothing[: nothing.rows + 1 - at.rows, :]))
        ends = [self._values(self.length + left - point.place) for point in self.points]
        return Matrix.vstack(self.basis.left, nothing), places, Matrix.vstack(self.basis.right, *ends)

    @cached_property
    def _starts(self) -> list[Matrix]:
        """Constants of the basis for a unit jump of each natural force of a section at its left end."""
        inverse = self.initial_state().inv(method="ADJ")
        return [inverse[:, len(self.section) + k] for k in range(len(self.section))]

    def begun(self, jump: tuple[PointForm, Jet]) -> tuple[Expr, ...]:
        """Return the motion of each field due to a unit jump."""
        space = self.weak.variation.space
        point, jet = jump
        shift = space.ends["left"] + space.x - point.place
        row = Matrix([self.basis.functions]).subs(space.x, shift) * Heaviside(space.x - point.place)
        start = self._starts[self.section.index(jet)]
        return tuple((row * field * start)[0] for field in self.basis.fields)

    # -------------------------------------------------------------------------------------------------- rows

    def _row(self, jet: Jet, at: Matrix) -> Matrix:
        """Return a derivative of a field where the basis has the values ``at``, or a coordinate."""
        if jet in self.lumped:
            row = self._zero()
            row[self.size + self.lumped.index(jet)] = S.One
            return row
        moved = zeros(1, len(self.lumped)) if jet.space else self.still[jet.unknown, :]
        return self._spread(at * self.basis.derivative**jet.space * self.basis.fields[jet.unknown], moved)

    def _spread(self, shapes: Matrix, moved: Matrix) -> Matrix:
        """Return the row of a quantity: entries of the basis, then of the motions that start at each place."""
        begun = zeros(1, len(self.jumps))
        if shapes.rows > 1:
            for number, (point, jet) in enumerate(self.jumps):
                own = shapes[1 + self.points.index(point), :]
                begun[number] = (own * self._starts[self.section.index(jet)])[0]
        return shapes[0, :].row_join(moved).row_join(begun)

    def _partners(self, varied: Jet) -> list[Jet]:
        return [jet for left, jet in self.weak.inside if left == varied]

    def _zero(self) -> Matrix:
        return zeros(1, self.columns)

    def _force(self, varied: Jet, at: Matrix) -> Matrix:
        """Return the natural partner of a displacement: P_j = W_(j+1) q - P_(j+1)'."""
        total, spread = self._zero(), at
        for order in range(varied.space + 1, self.highest[varied.unknown].space + 1):
            jet = varied._replace(space=order)
            rows = (self.stiffness(jet, other) * self._row(other, spread) for other in self._partners(jet))
            term = sum(rows, self._zero())
            if order > varied.space + 1:  # differentiated, so that constants along x vanish
                term[:, self.size : self.size + len(self.lumped)] = zeros(1, len(self.lumped))
            total, spread = total + term, -spread * self.basis.derivative
        return total

    def _gathered(self, coordinate: Jet) -> Matrix:
        """Return the force along the interval on a coordinate: integrals are differences of values at the ends."""
        _, _, right = self._stations
        total, change = self._zero(), right - Matrix.vstack(*[self.basis.left] * right.rows)
        for jet in self._partners(coordinate):
            row = self.length * self._row(jet, zeros(*right.shape))
            if jet not in self.lumped:
                gathered = change * self.basis.derivative ** (jet.space - 1) * self.basis.fields[jet.unknown]
                row += self._spread(gathered, zeros(1, len(self.lumped)))
            total += self.stiffness(coordinate, jet) * row
        for point, moved in zip(self.points, self._moved, strict=True):
            for varied, jet in point.form:
                if varied == coordinate:
                    total += self._at_point(point, varied, jet) * moved[jet]
        return total

    @cached_property
    def _moved(self) -> list[dict[Jet, Matrix]]:
        """Rows of the displacements of a section at every place, and of the coordinates."""
        return [{jet: self._row(jet, at) for jet in (*self.section, *self.lumped)} for at in self._stations[1]]

    def _at_point(self, point: PointForm, varied: Jet, jet: Jet) -> Expr:
        return polynomial(point.form.get((varied, jet), {}).items(), self.parameter, self.weak.even)

    def _jump_conditions(self) -> list[Matrix]:
        """Return the rows that define each jump, or that hold a displacement there."""
        table = []
        for number, (point, jet) in enumerate(self.jumps):
            moved = self._moved[self.points.index(point)]
            if jet in point.held:
                table.append(moved[jet])
                continue
            row = self._zero()
            row[self.size + len(self.lumped) + number] = S.One
            caused = (self._at_point(point, jet, other) * moved[other] for varied, other in point.form if varied == jet)
            table.append(row - sum(caused, self._zero()))
        return table

    def conditions(self) -> Matrix:
        """Return the equilibrium of ends, coordinates and interior places, or the essential condition in its place.

        Those of the right end are the last rows.
        """
        rows = end_displacements(self.weak)
        moves, forces = {}, {}
        left, _, right = self._stations
        for jet in rows:
            at, sign = (left, -1) if jet.place == "left" else (right, 1)
            inner = jet._replace(place=None)
            moves[jet] = self._row(inner, at)
            forces[jet] = self._gathered(jet) if jet in self.lumped else sign * self._force(inner, at)
        for varied, jet in self.weak.ends:
            forces[varied] = forces[varied] + self.stiffness(varied, jet, ends=True) * moves[jet]
        elimination = self.weak.variation.elimination
        table = []
        for jet in rows:
            if jet in elimination.factors:
                tied = (-factor * moves[other] for other, factor in elimination.factors[jet].items())
                table.append(sum(tied, moves[jet]))
            else:
                shares = (factor * forces[pivot] for pivot, factor in elimination.shares(jet))
                table.append(sum(shares, forces[jet]))
        last = len(table) - len(self.section)
        return Matrix.vstack(*table[:last], *self._jump_conditions(), *table[last:])

    def initial_state(self) -> Matrix:
        """Return displacements and forces at the left end; the matrix is singular only where the basis degenerates."""
        left = self.basis.left
        rows = [*(self._row(jet, left) for jet in self.section), *(self._force(jet, left) for jet in self.section)]
        return Matrix.vstack(*rows)[:, : self.size]


def _acts(point: PointForm, jet: Jet) -> bool:
    """Return whether a natural force jumps at an interior place."""
    return jet in point.held or any(varied == jet for varied, _ in point.form)


def _ascending(points: Iterable[PointForm], left: Expr, right: Expr) -> list[PointForm]:
    """Return the places within the domain in ascending order, as stated where the sign of a difference is not known."""
    inside = [p for p in points if not ((p.place - left).is_negative or (right - p.place).is_negative)]

    def order(first: PointForm, second: PointForm) -> int:
        gap = first.place - second.place
        return int(bool(gap.is_positive)) - int(bool(gap.is_negative))

    return sorted(inside, key=cmp_to_key(order))
