"""Hamilton's principle for fields on an interval and lumped coordinates, with the steps of the derivation."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from sympy import Add, Basic, Eq, Expr, Integral, S, Symbol, sympify
from sympy.core.function import AppliedUndef
from sympy.core.symbol import uniquely_named_symbol

from cra_sym.cached import cached_property
from cra_sym.mechanics.equations import BoundaryCondition, GeneralisedForces, JumpCondition, varied_form
from cra_sym.mechanics.jets import HamiltonError, Jet, JetSpace, listed, scalar
from cra_sym.mechanics.quadratures import Quadrature, quadratures_of, with_constraints
from cra_sym.mechanics.steps import Step, Steps, compact_latex
from cra_sym.mechanics.variation import Variation, VirtualWork, vary

__all__ = ["BoundaryCondition", "HamiltonError", "HamiltonResult", "hamilton"]


@dataclass(frozen=True)
class HamiltonResult:
    """Equations of motion and the steps of their derivation.

    Attributes
    ----------
    field_equations : tuple of Eq
        One for each field: inertial and elastic forces = virtual work of the applied ones.
    boundary_conditions : tuple of BoundaryCondition
        Left end before right end, fields in order, displacement before slope.
    coordinate_equations : tuple of Eq
        One for each lumped coordinate.
    variation : Variation
        First variation, in jet symbols.
    jump_conditions : tuple of JumpCondition
        Of interior places: the jump of a natural force there, or the held displacement, each with its ``place`` and
        ``variation``.
    quadratures : tuple of Quadrature
        Fields that are integrals of others; they and their multipliers are the last of ``fields``.
    """

    field_equations: tuple[Eq, ...]
    boundary_conditions: tuple[BoundaryCondition, ...]
    coordinate_equations: tuple[Eq, ...]
    density: Expr
    left: Expr
    right: Expr
    fields: tuple[AppliedUndef, ...]
    coordinates: tuple[AppliedUndef, ...]
    x: Symbol
    t: Symbol
    domain: tuple[Expr, Expr]
    virtual_work: tuple[VirtualWork, ...]
    essential: tuple[Expr, ...]
    variation: Variation = field(repr=False, compare=False)
    jump_conditions: tuple[JumpCondition, ...] = ()
    quadratures: tuple[Quadrature, ...] = ()

    @property
    def equations(self) -> tuple[Eq, ...]:
        """All equations: fields, ends, interior places, coordinates."""
        return (
            *self.field_equations,
            *self.boundary_conditions,
            *self.jump_conditions,
            *self.coordinate_equations,
        )

    def unused_symbol(self, name: str, *others: Expr) -> Symbol:
        """Return a symbol of this name, modified if the input (or ``others``) contains one of the same name."""
        forces = (force for force, _, _ in self.virtual_work)
        given = (self.density, self.left, self.right, *self.domain, *self.essential, *forces, *others)
        return uniquely_named_symbol(name, [sympify(expression, strict=True) for expression in given])

    @cached_property
    def steps(self) -> Steps:
        """The derivation: variation, integration by parts, collected terms, equations."""
        return _narrate(self.variation, self.equations)

    def _repr_latex_(self) -> str:
        return rf"$\displaystyle {compact_latex(self.equations, self.variation.space.names)}$"


def hamilton(
    density: Expr,
    *,
    fields: Sequence[AppliedUndef],
    coordinates: Sequence[AppliedUndef] = (),
    x: Symbol,
    domain: tuple[Any, Any],
    t: Symbol,
    left: Expr | None = None,
    right: Expr | None = None,
    virtual_work: Sequence[VirtualWork] | None = None,
    essential: Sequence[Expr] | None = None,
    prescribed: Sequence[AppliedUndef] = (),
    inside: Sequence[tuple[Expr, Expr]] = (),
    quadratures: Mapping[AppliedUndef, Expr] | None = None,
) -> HamiltonResult:
    r"""Derive equations of motion and boundary conditions from :math:`\delta\int L\,dt + \int\delta W\,dt = 0`.

    Parameters
    ----------
    density : Expr
        Lagrangian density (kinetic minus potential energy per length) in the fields, the coordinates and their
        derivatives of any order; coefficients may depend on x.
    fields, coordinates : sequence of applied undefined functions
        ``v(x, t)`` and ``w(t)``: the unknowns, which are varied.
    x, t : Symbol
        Position and time.
    domain : (left, right)
        End coordinates.
    left, right : Expr, optional
        Lagrangian terms of each end. ``v(x, t)`` and its derivatives are understood at that end; evaluated forms
        such as ``v.subs(x, 0)`` or ``v.diff(x).subs(x, 0)`` are accepted too.
    virtual_work : sequence of (generalised force, displacement, place), optional
        Place is 'left', 'right', 'domain' (force per length), an interior place, or None (a coordinate, or evaluated
        forms). A damper is
        ``(-c*v.diff(t), v, 'left')``, Kelvin-Voigt damping ``(-c*v.diff(x, 2, t), v.diff(x, 2), 'domain')``.
    essential : sequence of Expr, optional
        Linear combinations of end displacements (and coordinates) that vanish, in evaluated form.
    prescribed : sequence of applied undefined functions, optional
        Known functions of x and t that occur with derivatives.
    inside : sequence of (place, Expr), optional
        Lagrangian terms at interior places, in displacements of a section there. The field equations hold between
        them. An essential condition at an interior place is one displacement in evaluated form.
    quadratures : mapping of applied undefined function to Expr, optional
        Fields s(x, t) that are the integral of an expression in the others and their x derivatives from the left end,
        such as the foreshortening ``{s: v.diff(x)**2/2}``. Each becomes a field with the constraint s_x = integrand,
        which a multiplier N_s(x, t) enforces: if s is a shortening, N_s is the tension. Its equation is s_x =
        integrand, that of s is the balance along x, and the end conditions of s give N_s there.

    Returns
    -------
    HamiltonResult

    Raises
    ------
    HamiltonError
        A ValueError that names the term and why it cannot be treated.

    Examples
    --------
    >>> from sympy import Function, symbols
    >>> x, t, T, rho, l, k = symbols("x t T rho l k")
    >>> y = Function("y")(x, t)
    >>> string = hamilton(rho*y.diff(t)**2/2 - T*y.diff(x)**2/2, fields=[y], x=x, domain=(0, l), t=t, left=-k*y**2/2)
    >>> string.field_equations[0].lhs == rho*y.diff(t, 2) - T*y.diff(x, 2)
    True
    >>> string.boundary_conditions[0]
    Eq(T*Subs(Derivative(y(x, t), x), x, 0), k*y(0, t))
    >>> string.boundary_conditions[0].end, string.boundary_conditions[0].variation
    ('left', δy(0, t))

    A mass at an interior place makes the force jump:

    >>> a, m = symbols("a m")
    >>> beaded = hamilton(-T*y.diff(x)**2/2, fields=[y], x=x, domain=(0, l), t=t, inside=[(a, m*y.diff(t)**2/2)])
    >>> beaded.jump_conditions[0].rhs, beaded.jump_conditions[0].place, beaded.jump_conditions[0].variation
    (m*Derivative(y(a, t), (t, 2)), a, δy(a, t))
    """
    constrained = quadratures_of(quadratures, listed("fields", fields), x, t, listed("domain", domain))
    if constrained:
        start = JetSpace((), (), x, t, domain).ends["left"]
        held = listed("essential", () if essential is None else essential)
        posed = with_constraints(constrained, scalar("density", density), fields, held, x, start)
        density, fields, essential = posed["density"], posed["fields"], posed["essential"]
    space = JetSpace(fields, coordinates, x, t, domain, prescribed)
    left, right = _optional(left), _optional(right)
    virtual_work = listed("virtual_work", () if virtual_work is None else virtual_work)
    essential = listed("essential", () if essential is None else essential)
    variation = vary(space, density, {"left": left, "right": right}, virtual_work, essential, inside)
    forces = GeneralisedForces.of(variation)
    field_equations = tuple(forces.field_equation(number) for number in range(len(space.fields)))
    boundary_conditions = forces.boundary_conditions()
    numbers = range(len(space.fields), len(space.unknowns))
    coordinate_equations = tuple(forces.coordinate_equation(number) for number in numbers)
    return HamiltonResult(
        field_equations,
        boundary_conditions,
        coordinate_equations,
        density,
        left,
        right,
        space.fields,
        space.coordinates,
        x,
        t,
        (space.ends["left"], space.ends["right"]),
        virtual_work,
        essential,
        variation,
        forces.jump_conditions(),
        constrained,
    )


def _optional(expression: Expr | None) -> Any:
    return S.Zero if expression is None else expression


# ---------------------------------------------------------------------------------------------------- the steps

_STEPS = (
    ("Lagrangian", "The Lagrangian density, integrated over the interval, with the Lagrangian terms of the two ends."),
    (
        "Variation",
        "The variation of the Lagrangian plus the virtual work of the applied forces; over time it adds up to zero.",
    ),
    (
        "Integration by parts in time",
        "Time derivatives leave the variations, which vanish at the first and last instant.",
    ),
    ("Integration by parts in x", "Space derivatives leave the variations and produce terms at the two ends."),
    (
        "Collected terms",
        "The factors of each variation: fields in the interval, displacements at the ends, coordinates.",
    ),
    ("Equations", "Variations that no essential condition forbids are arbitrary, so each factor vanishes."),
)


def _narrate(variation: Variation, equations: tuple[Basic, ...]) -> Steps:
    space, forces = variation.space, GeneralisedForces.of(variation)
    interval = (space.x, space.ends["left"], space.ends["right"])

    def work(pairs: Iterable[tuple[Jet, Expr]]) -> Expr:
        return Add(*(space.write(force) * varied_form(space, jet) for jet, force in pairs))

    def over(integrand: Expr) -> Expr:
        return Integral(integrand, interval) if integrand != 0 else S.Zero

    def momenta(lagrangian: Expr) -> list[tuple[Jet, Expr]]:
        return [(jet, lagrangian.diff(space.symbol(jet))) for jet in space.jets(lagrangian)]

    applied, ends_applied = forces.inside_applied.items(), forces.ends_applied.items()
    varied = over(work([*momenta(variation.density), *applied])) + work([*momenta(variation.ends), *ends_applied])
    end_work = work([*forces.ends.items(), *ends_applied])
    in_time = over(work([*forces.inside.items(), *applied])) + end_work
    inside, boundary = forces.interior_factors(), forces.boundary_factors
    in_space = over(work(inside.items())) + work(boundary.items()) + end_work
    collected = over(work((jet, force) for jet, force in inside.items() if space.is_field(jet.unknown))) + Add(
        work((jet, forces.end_factor(jet)) for jet in boundary),
        *(
            (equation.rhs - equation.lhs) * varied_form(space, Jet(number, 0, 0, None))
            for number in range(len(space.fields), len(space.unknowns))
            for equation in [forces.coordinate_equation(number, reactions=False)]
        ),
    )
    expressions = (
        over(space.restore(variation.density)) + space.restore(variation.ends),
        varied,
        in_time,
        in_space,
        collected,
        equations,
    )
    return Steps(
        Step(
            name, statement, expression, before, "first variation of the action on polynomial test motions", space.names
        )
        for (name, statement), expression, before in zip(
            _STEPS, expressions, [(), *((name,) for name, _ in _STEPS[:-1])], strict=True
        )
    )
