"""Generalised forces of a variation, integrated by parts: field equations, end conditions and lumped equations."""

from __future__ import annotations

import functools
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from sympy import Add, Eq, Equality, Expr, Integral, Limit, S

from cra_sym.cached import cached_property
from cra_sym.mechanics.jets import END_NAMES, End, Jet, JetSpace
from cra_sym.mechanics.points import InteriorPoint
from cra_sym.mechanics.steps import compact_latex, variation_of
from cra_sym.mechanics.variation import Forces, Variation, lagrange_forces

__all__ = ["BoundaryCondition", "GeneralisedForces", "JumpCondition", "varied_form"]


class BoundaryCondition(Equality):  # type: ignore[misc]  # SymPy has no types
    """An equation at one end; equal to, and usable as, the plain ``Eq`` of its two sides.

    Attributes
    ----------
    end : {'left', 'right'}
    variation : Expr
        The variation it belongs to, for example ``δv`` or its slope, evaluated at the end.
    displacement : Expr
        The end displacement that is varied.
    kind : {'natural', 'essential'}
        A natural condition follows from an arbitrary variation; an essential one makes the variation zero.
    variables : (str, str)
        Names of position and time, for the notation.
    """

    end: End
    variation: Expr
    displacement: Expr
    kind: str
    variables: tuple[str, str]

    def __new__(
        cls,
        lhs: Expr,
        rhs: Expr,
        end: End,
        variation: Expr,
        displacement: Expr,
        kind: str = "natural",
        variables: tuple[str, str] = ("x", "t"),
    ) -> BoundaryCondition:
        made: BoundaryCondition = super().__new__(cls, lhs, rhs, evaluate=False)
        made.end, made.variation, made.displacement, made.kind = end, variation, displacement, kind
        made.variables = variables
        return made

    @property
    def _tags(self) -> dict[str, Any]:
        names = ("end", "variation", "displacement", "kind", "variables")
        return {name: getattr(self, name) for name in names}

    @property
    def func(self) -> Any:  # keeps the tags when SymPy rebuilds the equation
        return functools.partial(type(self), **self._tags)

    def __getnewargs__(self) -> tuple[Any, ...]:
        return (*self.args, *self._tags.values())

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Equality) and self.args == other.args

    def __hash__(self) -> int:
        return hash(Eq(*self.args, evaluate=False))

    def _repr_latex_(self) -> str:
        return rf"$\displaystyle {compact_latex(Eq(*self.args, evaluate=False), self.variables)}$"


class JumpCondition(BoundaryCondition):
    """Jump of a natural force at an interior place, or the condition of a support there.

    The displacements of a section are continuous; so are natural forces without a term at that place.

    Attributes
    ----------
    place : Expr
    variation, displacement, kind
        As of a `BoundaryCondition`.
    """

    @property
    def place(self) -> Expr:
        """The interior place."""
        return self.end


@dataclass(frozen=True)
class GeneralisedForces:
    """Generalised forces after integration by parts in time: conservative or applied, inside or at the ends."""

    variation: Variation
    inside: Forces
    inside_applied: Forces
    ends: Forces
    ends_applied: Forces

    @classmethod
    def of(cls, variation: Variation) -> GeneralisedForces:
        space = variation.space
        applied: tuple[Forces, Forces] = ({}, {})
        for force, jet, everywhere in variation.applied:
            target = applied[0 if everywhere else 1]
            target[jet] = target.get(jet, S.Zero) + force
        inside, ends = lagrange_forces(space, variation.density), lagrange_forces(space, variation.ends)
        return cls(variation, inside, applied[0], ends, applied[1])

    def by_parts(self, forces: Forces, number: int, lowest: int = 0) -> Expr:
        """Return sum_{a >= lowest} (-D_x)^(a - lowest) of the forces on the a-th x derivative of one unknown."""
        space = self.variation.space
        total: Expr = S.Zero
        for order in range(max((jet.space for jet in forces if jet.unknown == number), default=-1), lowest - 1, -1):
            total = forces.get(Jet(number, order, 0, None), S.Zero) - space.d_x(total)
        return total

    def field_equation(self, number: int) -> Eq:
        """Collect the factor of the variation of one field in the interval."""
        left, right = map(self.variation.space.write, self.field_sides(number))
        return Eq(left, right, evaluate=False)

    def field_sides(self, number: int) -> tuple[Expr, Expr]:
        """Return inertial and elastic forces, and applied ones, per length in jet symbols."""
        return -self.by_parts(self.inside, number), self.by_parts(self.inside_applied, number)

    def boundary_force(self, number: int, order: int) -> Expr:
        """Return the factor of the variation of the order-th derivative in the boundary term [...]_0^L."""
        both = (self.by_parts(forces, number, order + 1) for forces in (self.inside, self.inside_applied))
        return Add(*both)

    def end_force(self, displacement: Jet) -> Expr:
        """Return the factor of an end displacement from the end terms alone."""
        return self.ends.get(displacement, S.Zero) + self.ends_applied.get(displacement, S.Zero)

    def end_factor(self, displacement: Jet) -> Expr:
        """Return the whole factor of the variation of an end displacement."""
        return self.end_force(displacement) + self.boundary_factors[displacement]

    def reaction(self, displacement: Jet) -> Expr:
        """Return the work-equivalent force on this displacement of the forces at eliminated displacements."""
        shares = self.variation.elimination.shares(displacement)
        return Add(*(factor * self.end_factor(pivot) for pivot, factor in shares))

    def boundary_conditions(self) -> tuple[BoundaryCondition, ...]:
        """Collect the factor of each end displacement, or the essential condition that replaces it."""
        return tuple(map(self._condition, self.boundary_factors))

    def jump_conditions(self, write: Callable[[Expr], Expr] | None = None) -> tuple[JumpCondition, ...]:
        """Collect the factor of each displacement of a section at interior places; fields in order.

        ``write`` converts jet symbols to expressions, by default in the functions themselves.
        """
        space, found = self.variation.space, []
        write = write or space.write
        for point in self.variation.points:
            forces = lagrange_forces(space, point.lagrangian)
            for force, jet in point.applied:
                forces[jet] = forces.get(jet, S.Zero) + force
            for number, top in enumerate(self.variation.orders):
                for order in range(top):
                    found.append(self._jump(point, forces, Jet(number, order, 0, None), write))
        return tuple(found)

    def _jump(
        self, point: InteriorPoint, forces: Forces, displacement: Jet, write: Callable[[Expr], Expr]
    ) -> JumpCondition:
        space, held = self.variation.space, displacement in point.held
        varied = varied_form(space, displacement).subs(space.x, point.place)
        moved = write(space.symbol(displacement)).subs(space.x, point.place)
        tags = point.place, varied, moved, "essential" if held else "natural", space.names
        if held:
            return JumpCondition(moved, S.Zero, *tags)
        sign = (-1) ** (self.variation.orders[displacement.unknown] - displacement.space)
        inner = write(sign * self.boundary_force(displacement.unknown, displacement.space))
        after, before = (Limit(inner, space.x, point.place, side) for side in "+-")
        outer = write(sign * forces.get(displacement, S.Zero))
        return JumpCondition(after - before, outer.subs(space.x, point.place), *tags)

    def interior_factors(self) -> Forces:
        """Return the factor of every variation in the interval, coordinates included."""
        numbers = range(len(self.variation.space.unknowns))
        return {
            Jet(n, 0, 0, None): self.by_parts(self.inside, n) + self.by_parts(self.inside_applied, n) for n in numbers
        }

    @cached_property
    def boundary_factors(self) -> Forces:
        """Factor of every end displacement that integration by parts leaves, end terms apart; left before right."""
        factors: Forces = {}
        for end, sign in zip(END_NAMES, (-1, 1), strict=True):
            for number, top in enumerate(self.variation.orders):
                for order in range(top):
                    force = self.variation.space.at(end, self.boundary_force(number, order))
                    factors[Jet(number, order, 0, end)] = sign * force
        return factors

    def _condition(self, displacement: Jet) -> BoundaryCondition:
        space, end = self.variation.space, displacement.place
        assert isinstance(end, str)
        left, right = map(space.write, self.condition_sides(displacement))
        return BoundaryCondition(left, right, end, *self.tags(displacement))

    def tags(self, displacement: Jet) -> tuple[Expr, Expr, str, tuple[str, str]]:
        """Return the attributes of a condition other than its end: variation, displacement, kind and notation."""
        space = self.variation.space
        kind = "natural" if self.variation.elimination.value(displacement) is None else "essential"
        return varied_form(space, displacement), space.form(displacement), kind, space.names

    def condition_sides(self, displacement: Jet) -> tuple[Expr, Expr]:
        """Return both sides of the condition of one end displacement, in jet symbols."""
        fixed = self.variation.elimination.value(displacement)
        if fixed is not None:
            return self.variation.space.symbol(displacement), fixed
        # T - U has -EI/2 (v^(m))^2: this sign leaves the elastic coefficient of the left-hand side positive
        sign = (-1) ** (self.variation.orders[displacement.unknown] - displacement.space)
        side = sign if displacement.place == "right" else -sign
        outer = self.end_force(displacement) + self.reaction(displacement)
        return side * self.boundary_factors[displacement], -side * outer

    def coordinate_equation(self, number: int, reactions: bool = True) -> Eq:
        """Collect the factor of the variation of one lumped coordinate."""
        jet, zero = Jet(number, 0, 0, None), S.Zero
        lumped = self._integrated(self.ends.get(jet, zero), self.inside.get(jet, zero), -1)
        work = self.ends_applied.get(jet, zero) + (self.reaction(jet) if reactions else zero)
        return Eq(lumped, self._integrated(work, self.inside_applied.get(jet, zero)), evaluate=False)

    def _integrated(self, lumped: Expr, per_length: Expr, sign: int = 1) -> Expr:
        """Add to a lumped force the integral of one per length (times the length where it does not vary along x)."""
        space = self.variation.space
        a, b = space.ends["left"], space.ends["right"]
        still = per_length.xreplace(
            {space.symbol(j): S.Zero for j in space.jets(per_length) if space.is_field(j.unknown)}
        )
        if still.has(space.x):
            still = S.Zero
        varying = space.write(sign * (per_length - still))
        integral = Integral(varying, (space.x, a, b)) if varying != 0 else S.Zero
        return space.write(sign * (lumped + (b - a) * still)) + integral


def varied_form(space: JetSpace, displacement: Jet) -> Expr:
    """Return the variation of a jet as a derivative of ``δv``, evaluated if it belongs to an end."""
    delta = variation_of(space.unknowns[displacement.unknown])
    for variable, order in ((space.x, displacement.space), (space.t, displacement.time)):
        delta = delta.diff(variable, order) if order else delta
    return delta if displacement.place is None else delta.subs(space.x, space.ends[displacement.place])
