"""Separation of variables: spatial problem, general solution, characteristic matrix and function, mode shapes."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Literal

from sympy import (
    Add,
    Eq,
    Expr,
    Function,
    Matrix,
    Mul,
    S,
    Symbol,
    cancel,
    factor_list,
    fraction,
)

from cra_sym import checks
from cra_sym.cached import cached_property
from cra_sym.mechanics.basis import SolutionBasis
from cra_sym.mechanics.determinants import cofactors, collected, determinant, divided, primitive_rows, without_content
from cra_sym.mechanics.equations import BoundaryCondition, GeneralisedForces, JumpCondition
from cra_sym.mechanics.grouping import grouped
from cra_sym.mechanics.hamilton import HamiltonResult
from cra_sym.mechanics.jets import HamiltonError, Jet, scalar
from cra_sym.mechanics.solution import GeneralSolution
from cra_sym.mechanics.steps import Step, Steps
from cra_sym.mechanics.weak import WeakForm, weak_form

__all__ = ["Modal", "SeparatedProblem", "separate"]


@dataclass(frozen=True)
class SeparatedProblem:
    """Homogeneous problem of the amplitudes in ``v(x, t) = phi(x) e^(i omega t)``, or ``phi(x) e^(s t)`` with damping.

    Attributes
    ----------
    field_equations : tuple of Eq
    boundary_conditions : tuple of BoundaryCondition
    jump_conditions : tuple of JumpCondition
        Of interior places.
    amplitudes : tuple of Expr
        ``phi(x)`` of each field, then the amplitude of each lumped coordinate.
    frequency : Symbol
        omega, or s if ``damped``.
    damped : bool
    left_out : tuple of Expr
        Generalised forces, per length and at ends, of prescribed motions and forces; they are not part of the problem.
    """

    field_equations: tuple[Eq, ...]
    boundary_conditions: tuple[BoundaryCondition, ...]
    jump_conditions: tuple[JumpCondition, ...]
    amplitudes: tuple[Expr, ...]
    frequency: Symbol
    damped: bool
    left_out: tuple[Expr, ...]


@dataclass(frozen=True)
class Modal:
    """Modes of a problem with constant coefficients in closed form.

    Attributes
    ----------
    spatial_problem : SeparatedProblem
    basis : SolutionBasis
        General solution; its ``values`` symbols stand for the functions at the right end.
    characteristic_matrix : Matrix
        Rows: conditions of the left end, lumped coordinates, interior places, conditions of the right end. Columns:
        constants of the basis, amplitudes of the coordinates, jumps of natural forces at interior places. Polynomial in
        the basis ``values``.
    characteristic_polynomial : Expr
        Its determinant over that of the initial state, so that its zeros are exactly the eigenvalues, without factors
        independent of the wave numbers; in the basis ``values``.
    scale : Expr
        ``det(characteristic_matrix) = scale * characteristic_polynomial``.
    still : Matrix
        Constant displacement of each field (rows) for a unit amplitude of each coordinate (columns).
    begun : tuple of tuple of Expr
        For each unit jump at an interior place, the motion of each field to the right of it.
    """

    spatial_problem: SeparatedProblem
    basis: SolutionBasis
    characteristic_matrix: Matrix
    characteristic_polynomial: Expr
    scale: Expr
    still: Matrix
    begun: tuple[tuple[Expr, ...], ...] = ()

    @property
    def frequency(self) -> Symbol:
        """Angular frequency omega, or s with damping."""
        return self.spatial_problem.frequency

    @property
    def characteristic_function(self) -> Expr:
        """The characteristic polynomial with the basis functions substituted: zero at every eigenvalue."""
        return self.characteristic_polynomial.xreplace(self.basis.values)

    def null_vector(self, row: int = -1) -> tuple[Expr, ...]:
        """Return constants that satisfy every condition but one: the cofactors of a row of the characteristic matrix.

        At an eigenvalue the omitted condition holds as well. By default the last one, of the right end, is omitted.

        The vector vanishes only if two solutions satisfy all others; for a string or a beam with uncoupled end
        conditions this would be a repeated frequency of the problem with the last displacement held.
        """
        matrix, basis = self.characteristic_matrix, self.basis
        variables = [*basis.values, *basis.wave_numbers, self.frequency]
        return tuple(cofactors(matrix, row % matrix.rows, basis.relations, variables))

    @cached_property
    def coefficients(self) -> tuple[Expr, ...]:
        """Constants of the mode shape and amplitudes of the coordinates, up to a factor, in the basis ``values``."""
        return self.null_vector()

    @property
    def mode_shapes(self) -> tuple[Expr, ...]:
        """Shape of each field as a function of x at an eigenvalue."""
        row = Matrix([self.basis.functions])
        size, lumped = len(self.basis.functions), self.still.cols
        constants, jumps = Matrix(self.coefficients[:size]), self.coefficients[size + lumped :]
        moved = self.still * Matrix(lumped, 1, self.coefficients[size : size + lumped])
        begun = [Add(*(jump * own[k] for jump, own in zip(jumps, self.begun, strict=True))) for k in range(len(moved))]
        shapes = (
            Add(*(row * field * constants)) + still + more
            for field, still, more in zip(self.basis.fields, moved, begun, strict=True)
        )
        return tuple(shape.xreplace(self.basis.values) for shape in shapes)

    @property
    def steps(self) -> Steps:
        """Steps from the separated equations to the mode shapes."""
        problem = self.spatial_problem
        names = ("Spatial problem", "General solution", "Characteristic equation", "Modes")
        motion = r"e^{s t}" if problem.damped else r"e^{i \omega t}"
        equations = (*problem.field_equations, *problem.boundary_conditions, *problem.jump_conditions)
        solutions = (self.basis.dispersion, *self.basis.functions)
        condition = Eq(self.characteristic_function, 0, evaluate=False)
        described = (
            (names[0], f"All unknowns move as ${motion}$.", equations, ("Equations",), "insertion"),
            (names[1], "Functions that span the solutions.", solutions, names[:1], "insertion"),
            (names[2], "The conditions have a solution other than zero.", condition, names[:2], "dynamic stiffness"),
            (names[3], "The solution, up to its amplitude.", self.mode_shapes, names[1:3], "boundary conditions"),
        )
        variables = problem.boundary_conditions[0].variables
        return Steps(
            Step(name, statement, expression, origin, check, variables)
            for name, statement, expression, origin, check in described
        )


def separate(
    result: HamiltonResult,
    *,
    parameters: Mapping[Symbol, Expr] | None = None,
    basis: Literal["hyperbolic", "decaying"] = "hyperbolic",
    frequency: Symbol | None = None,
) -> Modal:
    r"""Separate variables in the homogeneous linear problem and solve it in closed form.

    Parameters
    ----------
    result : HamiltonResult
    parameters : dict of Symbol to Expr, optional
        Parameters in terms of others, for example dimensionless groups. A stiffness from 0 to infinity is the ratio
        ``k: EI/L**3 * s/c`` of two finite numbers: denominators are cleared row by row, so both limits are regular.
    basis : {'hyperbolic', 'decaying'}
        For beams with one wave number: ``cosh, sinh``, or ``exp(-beta x), exp(-beta (L - x))``, which stay bounded at
        any frequency. Others, and those with interior places, always get cosh and sinh; `state_form` is the exact form
        to evaluate at high frequencies.
    frequency : Symbol, optional
        Symbol for omega (or s).

    Returns
    -------
    Modal

    Raises
    ------
    HamiltonError
        If the Lagrangian is not quadratic, its coefficients vary along x (`ritz` treats these), or the characteristic
        equation has a root that is repeated at every frequency.

    Notes
    -----
    To the right of an interior place the motion due to the jump of a natural force is added, so that inertia, springs,
    dampers and supports there have closed forms too. Places that are symbols must lie inside and be stated in ascending
    order. Parts with different coefficients have different wave numbers and must be separate fields (`cra_sym.joined`).

    Examples
    --------
    >>> from sympy import Function, symbols
    >>> from cra_sym.mechanics import hamilton
    >>> x, t, T, rho, l, k, kappa = symbols("x t T rho l k kappa")
    >>> y = Function("y")(x, t)
    >>> string = hamilton(rho*y.diff(t)**2/2 - T*y.diff(x)**2/2, fields=[y], x=x, domain=(0, l), t=t,
    ...                   right=-k*y**2/2, essential=[y.subs(x, 0)])
    >>> modal = separate(string, parameters={k: kappa*T/l})
    >>> modal.characteristic_function
    (kappa*sin(lambda) + lambda*cos(lambda))/lambda
    >>> modal.mode_shapes
    (sin(lambda*x/l),)

    A bead on a string between two walls:

    >>> a, m = symbols("a m")
    >>> beaded = hamilton(y.diff(t)**2/2 - y.diff(x)**2/2, fields=[y], x=x, domain=(0, 1), t=t,
    ...                   inside=[(a, m*y.diff(t)**2/2)], essential=[y.subs(x, 0), y.subs(x, 1)])
    >>> separate(beaded).characteristic_function
    (lambda*m*sin(a*lambda)*sin(lambda*(1 - a)) - sin(lambda))/lambda
    """
    checks.instance("result", result, HamiltonResult)
    checks.choice("basis", basis, ("hyperbolic", "decaying"))
    given = checks.mapping("parameters", parameters, "symbols to expressions")
    others = {key: scalar(f"parameters: {checks.shown(key)}", value) for key, value in given.items()}
    for symbol in (*others, *(() if frequency is None else (frequency,))):
        checks.instance("a parameter or frequency", symbol, Symbol)
    weak = weak_form(result.variation)
    if not weak.constant:
        raise HamiltonError(
            f"separate: {_varying(weak)} varies along {result.x}, so there is no closed form; use ritz or, for "
            "constant pieces, fields of their own (cra_sym.joined)"
        )

    def names(name: str) -> Symbol:
        return result.unused_symbol(name, *others.values())

    frequency = frequency or names("omega" if weak.even else "s")
    spatial = _spatial_problem(weak, frequency)
    solution = GeneralSolution(weak, frequency, "hyperbolic" if weak.points else basis, names)
    matrix, start = solution.conditions(), solution.initial_state()
    known = {**solution.known, **others}
    rows, contents = primitive_rows(matrix.subs(known))
    characteristic, scale = _characteristic(contents, rows, start.subs(known), solution.basis, frequency)
    begun = tuple(tuple(shape.subs(known) for shape in solution.begun(jump)) for jump in solution.jumps)
    return Modal(spatial, solution.basis, rows, characteristic, scale, solution.still.subs(known), begun)


def _varying(weak: WeakForm) -> Expr:
    x = weak.variation.space.x
    return next(value for entry in weak.inside.values() for value in entry.values() if value.has(x))


# ------------------------------------------------------------------------------------------------ the spatial problem


def _spatial_problem(weak: WeakForm, frequency: Symbol) -> SeparatedProblem:
    space, forces = weak.variation.space, GeneralisedForces.of(weak.variation)
    s = frequency if not weak.even else S.ImaginaryUnit * frequency
    heads = {
        number: Symbol(f"a_{unknown.func.__name__}")
        if not space.is_field(number)
        else Function("phi" if len(space.fields) == 1 else f"phi_{unknown.func.__name__}")(space.x)
        for number, unknown in enumerate(space.unknowns)
    }

    def form(jet: Jet) -> Expr:
        amplitude = heads[jet.unknown]
        derivative = amplitude.diff(space.x, jet.space) if jet.space else amplitude
        return derivative if jet.place is None else derivative.subs(space.x, space.ends[jet.place])

    def amplitude(expression: Expr) -> Expr:
        jets = space.jets(expression)
        symbols = {jet._replace(time=0): space.symbol(jet._replace(time=0)) for jet in jets}
        total = Add(*(expression.diff(space.symbol(j)) * s**j.time * symbols[j._replace(time=0)] for j in jets))
        return grouped(total, symbols.values()).xreplace({symbol: form(jet) for jet, symbol in symbols.items()})

    fields = []
    for number in range(len(space.fields)):
        inner, applied = forces.field_sides(number)
        fields.append(Eq(amplitude(inner - applied), 0, evaluate=False))
    conditions = []
    for jet in forces.boundary_factors:
        assert isinstance(jet.place, str)
        left, right = map(amplitude, forces.condition_sides(jet))
        variation, _, kind, names = forces.tags(jet)
        conditions.append(BoundaryCondition(left, right, jet.place, variation, form(jet), kind, names))
    loads = [*weak.inside_load.values(), *weak.end_load.values(), *weak.variation.elimination.offsets.values()]
    left_out = tuple(space.write(load) for load in loads if load != 0)
    amplitudes = tuple(heads.values())
    jumps = forces.jump_conditions(amplitude)
    return SeparatedProblem(tuple(fields), tuple(conditions), jumps, amplitudes, frequency, not weak.even, left_out)


# ------------------------------------------------------------------------------------------------ the determinant


def _characteristic(
    contents: Sequence[Expr], rows: Matrix, start: Matrix, basis: SolutionBasis, frequency: Symbol
) -> tuple[Expr, Expr]:
    """Return the determinant over that of the initial state, and the scale factor to the determinant of the rows.

    Where the basis degenerates both determinants vanish, which cancels in the ratio.
    """
    element = determinant(rows, basis.relations)
    if not element:
        raise HamiltonError("separate: the conditions do not determine the solution")
    start_rows, start_contents = primitive_rows(start)
    initial = determinant(start_rows, basis.relations).as_expr()
    rates = {*basis.wave_numbers, frequency}
    numerator, denominator = (
        _part(side, rates) for side in fraction(cancel(Mul(*contents) / Mul(*start_contents, initial)))
    )
    variables = [*basis.values, *rates]
    core, factor = without_content(element, variables)
    quotient, left_over = divided(core, denominator)
    polynomial = collected(quotient, variables) * numerator / left_over
    return polynomial, factor * denominator / (numerator * left_over)


def _part(polynomial: Expr, variables: set[Symbol]) -> Expr:
    """Return the product of the factors of a polynomial that contain one of the variables."""
    _, factors = factor_list(polynomial)
    return Mul(*(base**power for base, power in factors if base.free_symbols & variables))
