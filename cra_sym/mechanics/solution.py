"""The general solution of a spatial problem as matrices: displacements, forces and conditions of both ends."""

from __future__ import annotations

from typing import Literal

from sympy import Add, Expr, Matrix, S, Symbol, zeros

from cra_sym.mechanics.basis import Naming, general_solution
from cra_sym.mechanics.jets import HamiltonError, Jet
from cra_sym.mechanics.state_form import end_displacements
from cra_sym.mechanics.weak import WeakForm, polynomial

__all__ = ["GeneralSolution"]


class GeneralSolution:
    """Rows of coefficients of the unknown constants: those of the basis, then the amplitudes of the coordinates.

    Parameters
    ----------
    weak : WeakForm
        With coefficients that do not depend on x.
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
        """Return omega**2 in terms of the wave number where one wave number serves all."""
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

    # -------------------------------------------------------------------------------------------------- rows

    def _row(self, jet: Jet, at: Matrix) -> Matrix:
        """Return a derivative of a field where the basis has the values ``at``, or a coordinate."""
        if jet in self.lumped:
            row = zeros(1, self.size + len(self.lumped))
            row[self.size + self.lumped.index(jet)] = S.One
            return row
        shape = at * self.basis.derivative**jet.space * self.basis.fields[jet.unknown]
        return shape.row_join(zeros(1, len(self.lumped)) if jet.space else self.still[jet.unknown, :])

    def _partners(self, varied: Jet) -> list[Jet]:
        return [jet for left, jet in self.weak.inside if left == varied]

    def _zero(self) -> Matrix:
        return zeros(1, self.size + len(self.lumped))

    def _force(self, varied: Jet, at: Matrix) -> Matrix:
        """Return the natural partner of a displacement: P_j = W_(j+1) q - P_(j+1)'."""
        total, spread = self._zero(), at
        for order in range(varied.space + 1, self.highest[varied.unknown].space + 1):
            jet = varied._replace(space=order)
            rows = (self.stiffness(jet, other) * self._row(other, spread) for other in self._partners(jet))
            term = sum(rows, self._zero())
            if order > varied.space + 1:  # differentiated: what is constant along x has gone
                term[:, self.size :] = zeros(1, len(self.lumped))
            total, spread = total + term, -spread * self.basis.derivative
        return total

    def _gathered(self, coordinate: Jet) -> Matrix:
        """Return the force along the interval on a coordinate: integrals are differences of values at the ends."""
        total, change = self._zero(), self.basis.right - self.basis.left
        for jet in self._partners(coordinate):
            row = self.length * self._row(jet, zeros(1, self.size))
            if jet not in self.lumped:
                row[:, : self.size] = change * self.basis.derivative ** (jet.space - 1) * self.basis.fields[jet.unknown]
            total += self.stiffness(coordinate, jet) * row
        return total

    def conditions(self) -> Matrix:
        """Return the equilibrium of ends and coordinates, or the essential condition in its place, row by row."""
        rows = end_displacements(self.weak)
        moves, forces = {}, {}
        for jet in rows:
            at, sign = (self.basis.left, -1) if jet.place == "left" else (self.basis.right, 1)
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
        return Matrix.vstack(*table)

    def initial_state(self) -> Matrix:
        """Return displacements and forces at the left end: singular only where the basis degenerates."""
        left = self.basis.left
        rows = [*(self._row(jet, left) for jet in self.section), *(self._force(jet, left) for jet in self.section)]
        return Matrix.vstack(*rows)[:, : self.size]
