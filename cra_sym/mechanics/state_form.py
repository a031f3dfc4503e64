"""The exact first-order form of a spatial problem, y' = A y, with its end matrices: input of the numerical solvers."""

from __future__ import annotations

from dataclasses import dataclass

from sympy import Expr, Matrix, Not, Or, Piecewise, S, Symbol, diag, eye, zeros
from sympy.core.function import AppliedUndef

from cra_sym import checks
from cra_sym.mechanics.equations import GeneralisedForces
from cra_sym.mechanics.hamilton import HamiltonResult
from cra_sym.mechanics.jets import END_NAMES, HamiltonError, Jet
from cra_sym.mechanics.weak import WeakForm, polynomial, weak_form

__all__ = ["StateForm", "state_form"]


@dataclass(frozen=True)
class StateForm:
    """Spatial problem ``y' = system y`` of motions ``e^(s t)``, with ``y = (q, w, P, r)``.

    Attributes
    ----------
    displacements : tuple of Expr
        q: the fields and their slopes, as many as are displacements of a section (n).
    forces : tuple of Expr
        P: the natural partner of each, positive at the right end; ``-P`` acts at the left end.
    coordinates : tuple of applied undefined functions
        w: lumped coordinates, constant along x (m). Their partner r is zero at the left end and accumulates the force
        on the coordinate.
    system : Matrix, shape (2 (n + m), 2 (n + m))
    boundary : Matrix, shape (2 n + m, 2 n + m)
        Contribution of end terms and lumped coordinates to the dynamic stiffness, in the order (q(left), w, q(right)).
    free : Matrix, shape (2 n + m, f)
        Its columns span the motions the essential conditions allow.
    parameter : Symbol
        ``z = omega**2``, or ``s`` if odd powers of s occur.
    damped : bool
        Whether the parameter is s.
    x : Symbol
    length : Expr
    points : tuple of (place, Matrix, held)
        At interior places the forces P and r increase by the matrix, (n + m, n + m), times (q, w); the displacements of
        a section with the indices ``held`` vanish there.
    """

    displacements: tuple[Expr, ...]
    forces: tuple[Expr, ...]
    coordinates: tuple[AppliedUndef, ...]
    system: Matrix
    boundary: Matrix
    free: Matrix
    parameter: Symbol
    damped: bool
    x: Symbol
    length: Expr
    points: tuple[tuple[Expr, Matrix, tuple[int, ...]], ...] = ()

    @property
    def uniform(self) -> bool:
        """Whether the system is constant along x, with nothing at interior places."""
        return not self.points and not self.system.has(self.x)


def state_form(result: HamiltonResult) -> StateForm:
    """Return the exact first-order form of the linear problem.

    With the density of potential minus kinetic energy as a quadratic form W of the displacements q of a section, of the
    highest derivatives h and of the coordinates w, ``P_top = W_hh h + W_hq q + W_hw w`` gives h, and
    ``P_j' = W_jq q + W_jh h + W_jw w - P_(j-1)``. Without damping the system is Hamiltonian.

    Raises
    ------
    HamiltonError
        For a Lagrangian that is not quadratic, or a field without stiffness in its highest derivative.

    Examples
    --------
    >>> from sympy import Function, symbols
    >>> from cra_sym.mechanics import hamilton
    >>> x, t, T, rho, l, m = symbols("x t T rho l m")
    >>> y = Function("y")(x, t)
    >>> string = hamilton(rho*y.diff(t)**2/2 - T*y.diff(x)**2/2, fields=[y], x=x, domain=(0, l), t=t,
    ...                   right=m*y.diff(t)**2/2, essential=[y.subs(x, 0)])
    >>> form = state_form(string)
    >>> form.system
    Matrix([
    [     0, 1/T],
    [-rho*z,   0]])
    >>> form.boundary, form.free
    (Matrix([
    [0,    0],
    [0, -m*z]]), Matrix([
    [0],
    [1]]))
    """
    checks.instance("result", result, HamiltonResult)
    weak = weak_form(result.variation)
    parameter = result.unused_symbol("z" if weak.even else "s")
    section, _, _ = weak.fields()
    space, forces = result.variation.space, GeneralisedForces.of(result.variation)
    return StateForm(
        tuple(space.form(jet) for jet in section),
        tuple(space.write(-forces.boundary_force(jet.unknown, jet.space)) for jet in section),
        space.coordinates,
        _system(weak, parameter),
        _boundary(weak, parameter),
        free_motions(weak),
        parameter,
        not weak.even,
        result.x,
        result.domain[1] - result.domain[0],
        _points(weak, parameter),
    )


def _points(weak: WeakForm, parameter: Symbol) -> tuple[tuple[Expr, Matrix, tuple[int, ...]], ...]:
    section, _, lumped = weak.fields()
    rows = [*section, *lumped]
    return tuple(
        (
            point.place,
            Matrix(
                len(rows),
                len(rows),
                [polynomial(point.form.get((p, q), {}).items(), parameter, weak.even) for p in rows for q in rows],
            ),
            tuple(section.index(jet) for jet in point.held),
        )
        for point in weak.points
    )


def _system(weak: WeakForm, parameter: Symbol) -> Matrix:
    section, highest, lumped = weak.fields()
    n, m = len(section), len(lumped)

    def stiffness(rows: list[Jet], columns: list[Jet]) -> Matrix:
        entries = [polynomial(weak.inside.get((p, q), {}).items(), parameter, weak.even) for p in rows for q in columns]
        return Matrix(len(rows), len(columns), entries)

    leading = stiffness(highest, highest)
    if leading.det() == 0:
        names = [str(weak.variation.space.form(jet)) for jet in highest]
        raise HamiltonError(
            f"density: the quadratic form in {', '.join(names)} is singular, so the problem has no state form"
            + _linear_cure(weak, [jet for row, jet in enumerate(highest) if leading[row, :].is_zero_matrix])
        )
    _check_parts(leading, weak.variation.space.x)
    for row, jet in enumerate(highest):
        if jet.space == 0 and leading[row, row].has(parameter):
            raise HamiltonError(
                f"density: {weak.variation.space.form(jet)} has inertia or damping but no derivative by "
                f"{weak.variation.space.x}, so infinitely many motions share one eigenvalue"
                "; give it a stiffness along the length"
            )
    # columns of y = (q, w, P, r); the highest derivatives follow from the definition of the top forces
    state = [*section, *lumped]
    width = 2 * (n + m)
    pick_top = zeros(len(highest), width)
    for row, jet in enumerate(highest):
        if jet.space:
            pick_top[row, n + m + section.index(jet._replace(space=jet.space - 1))] = S.One
    motion = eye(n + m).row_join(zeros(n + m))
    top = _inverse(leading) * (pick_top - stiffness(highest, state) * motion)
    slope, lower = zeros(n, width), zeros(n + m, width)
    for row, jet in enumerate(section):
        raised = jet._replace(space=jet.space + 1)
        if raised in section:
            slope[row, row + 1] = lower[row + 1, n + m + row] = S.One
        else:
            slope[row, :] = top[highest.index(raised), :]
    rate = stiffness(state, state) * motion + stiffness(state, highest) * top - lower
    return Matrix.vstack(slope, zeros(m, width), rate)


def _linear_cure(weak: WeakForm, jets: list[Jet]) -> str:
    """Return the advice for highest derivatives that occur in products with lower ones alone."""
    space = weak.variation.space
    for jet in jets:
        partners = [
            q.space for pair in weak.inside for p, q in (pair, pair[::-1]) if (p, q.unknown) == (jet, jet.unknown)
        ]
        if jet.space > 1 and partners and (jet.space + min(partners)) % 2 == 0:
            half = (jet.space + min(partners)) // 2
            names = [space.form(jet._replace(space=order)) for order in (jet.space, min(partners), half)]
            return (
                f"; integrate the product of {names[0]} and {names[1]} by parts, to {names[2]}**2 and terms at the ends"
            )
    return ""


def _check_parts(leading: Matrix, x: Symbol) -> None:
    """Raise an error that names the part of the domain on which a stiffness is zero."""
    for stiffness in leading.diagonal() if leading.rows else ():
        for piecewise in stiffness.atoms(Piecewise):
            for value, condition in piecewise.args:
                if stiffness.xreplace({piecewise: value}) == 0:
                    earlier = [c for _, c in piecewise.args[: [c for _, c in piecewise.args].index(condition)]]
                    where = condition if condition != True else Not(Or(*earlier))  # noqa: E712
                    raise HamiltonError(
                        f"density: the stiffness {stiffness} is 0 where {where}; every part of the domain in {x} needs "
                        "a stiffness: end the domain there, or join two fields"
                    )


def _inverse(matrix: Matrix) -> Matrix:
    """Return the inverse; diagonal entries are not simplified, so that 1 + exp(-x) stays bounded."""
    if not matrix.rows:  # lumped coordinates alone
        return matrix
    return diag(*(1 / entry for entry in matrix.diagonal())) if matrix.is_diagonal() else matrix.inv()


def _boundary(weak: WeakForm, parameter: Symbol) -> Matrix:
    rows = end_displacements(weak)
    entries = [polynomial(weak.ends.get((p, q), {}).items(), parameter, weak.even) for p in rows for q in rows]
    return Matrix(len(rows), len(rows), entries)


def end_displacements(weak: WeakForm) -> list[Jet]:
    """Return the displacements of the left end, the coordinates and the displacements of the right end."""
    section, _, lumped = weak.fields()
    left, right = ([jet._replace(place=end) for jet in section] for end in END_NAMES)
    return [*left, *lumped, *right]


def free_motions(weak: WeakForm) -> Matrix:
    """Return the matrix whose columns span the motions of ends and coordinates that the essential conditions allow."""
    rows, fixed = end_displacements(weak), weak.variation.elimination.factors
    kept = [jet for jet in rows if jet not in fixed]
    return Matrix(len(rows), len(kept), lambda i, j: fixed.get(rows[i], {rows[i]: S.One}).get(kept[j], S.Zero))
