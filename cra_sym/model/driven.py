"""Harmonic inputs of a model: a prescribed motion, a force, or a displacement that a unit force acts on."""

from __future__ import annotations

from dataclasses import replace
from itertools import product

from sympy import Expr, Function, Matrix, S, Symbol, cancel, eye, zeros

from cra_sym.checks import shown
from cra_sym.kernels import Kernel, kernel
from cra_sym.mechanics import StateForm
from cra_sym.mechanics.points import at_place
from cra_sym.model.lagrangian import Model
from cra_sym.model.spatial import SpatialProblem, spatial_problem

__all__ = ["driven", "driven_coordinate", "driven_displacement", "driven_spatial", "pushed", "reacting"]


def driven(model: Model, name: str) -> SpatialProblem:
    """Return the spatial problem with the acceleration of a prescribed motion, or a force, as a lumped coordinate.

    A prescribed motion w becomes a free coordinate and is replaced by its acceleration a: w = -a / omega^2, so its
    column and its row are divided by -omega^2 (by s^2 where the parameter is s). A force becomes a coordinate
    unchanged. The diagonal entry is left out, since the input is given.
    """
    freed = model.freed(name)
    form = freed.state_form
    number = next(k for k, c in enumerate(form.coordinates) if c.func.__name__ == name)
    n, m, z = len(form.displacements), len(form.coordinates), form.parameter
    moves = any(motion.func.__name__ == name for motion in model.motions)
    factor = (1 / z**2 if form.damped else -1 / z) if moves else S.One
    system, boundary = form.system.as_mutable(), form.boundary.as_mutable()
    points = [matrix.as_mutable() for _, matrix, _ in form.points]
    own = n + number
    for matrix, row, column in (
        (system, 2 * n + m + number, own),
        *((other, own, own) for other in (boundary, *points)),
    ):
        matrix[row, column] = S.Zero
        matrix[:, column] = (matrix[:, column] * factor).applyfunc(cancel)
        matrix[row, :] = (matrix[row, :] * factor).applyfunc(cancel)
        if matrix.has(1 / z):
            raise ValueError(f"{name} acts by more than its acceleration")
    there = tuple(
        (place, matrix.as_immutable(), held) for (place, _, held), matrix in zip(form.points, points, strict=True)
    )
    changed = replace(form, system=system.as_immutable(), boundary=boundary.as_immutable(), points=there)
    return spatial_problem(reacting(changed), model.symbols, model.equations.domain[0])


def driven_spatial(model: Model) -> SpatialProblem:
    """Return the spatial problem with all forces, the reactions of interior supports as lumped coordinates."""
    return spatial_problem(reacting(model.state_form), model.symbols, model.equations.domain[0])


def reacting(form: StateForm) -> StateForm:
    """Return the same problem with interior supports replaced by their reactions, as further lumped coordinates.

    A reaction R works against the displacement that is held: its Lagrangian is R v(a). The force jumps by R there, and
    the equation of R says that the displacement vanishes.
    """
    reactions = [(number, k) for number, (_, _, held) in enumerate(form.points) for k in held]
    if not reactions:
        return form
    n, m = len(form.displacements), len(form.coordinates)
    t = form.coordinates[0].args[0] if m else Symbol("t")
    added = tuple(Function(f"reaction_{k}")(t) for k in range(len(reactions)))
    points = []
    for number, (place, matrix, _) in enumerate(form.points):
        extended = _insert_zeros(matrix, (n + m,), len(reactions))
        for row, (own, k) in enumerate(reactions):
            if own == number:
                extended[k, n + m + row] = extended[n + m + row, k] = S.One
        points.append((place, extended.as_immutable(), ()))
    # not by joins: those of no columns lose their rows
    free = zeros(form.free.rows + len(reactions), form.free.cols + len(reactions))
    for row, column in product(range(form.free.rows), range(form.free.cols)):
        free[row if row < n + m else row + len(reactions), column] = form.free[row, column]
    free[n + m : n + m + len(reactions), form.free.cols :] = eye(len(reactions))
    return replace(
        form,
        coordinates=(*form.coordinates, *added),
        system=_insert_zeros(form.system, (n + m, 2 * (n + m)), len(reactions)).as_immutable(),
        boundary=_insert_zeros(form.boundary, (n + m,), len(reactions)).as_immutable(),
        free=free.as_immutable(),
        points=tuple(points),
    )


def _insert_zeros(matrix: Matrix, places: tuple[int, ...], number: int) -> Matrix:
    """Insert ``number`` rows and columns of zeros into a square matrix before each index in ``places`` (ascending)."""
    found = matrix.as_mutable()
    for place in reversed(places):
        found = found.row_insert(place, zeros(number, found.cols))
        found = found.col_insert(place, zeros(found.rows, number))
    return found


def driven_coordinate(model: Model, name: str) -> int:
    """Return the index of a prescribed motion among the lumped coordinates of the model in which it is free."""
    return [c.func.__name__ for c in model.freed(name).state_form.coordinates].index(name)


def driven_displacement(model: Model, drive: Expr) -> int:
    """Return the position of a displacement in the order (q(left), w, q(right)).

    Raises
    ------
    ValueError
        If it is none of them, or an essential condition holds it.
    """
    form = model.state_form
    left, right = (
        [displacement.subs(form.x, end) for displacement in form.displacements] for end in model.equations.domain
    )
    order = [*left, *form.coordinates, *right]
    if not isinstance(drive, Expr) or drive not in order:
        known = ", ".join(map(str, (*model.driving, *order)))
        inside = ", or a displacement at an interior place" if form.displacements else ""
        raise ValueError(f"drive = {shown(drive)}: must be one of {known}{inside}")
    place = order.index(drive)
    if form.free[place, :].is_zero_matrix:
        raise ValueError(f"drive = {drive}: an essential condition holds it still")
    return place


def pushed(model: Model, drive: Expr) -> tuple[Model, str, Kernel] | None:
    """Return the model with a force on a displacement at an interior place, the force's name and the place.

    None if ``drive`` is not at an interior place, or the model has coordinates alone.

    Raises
    ------
    ValueError
        If the expression is not a displacement of a section.
    """
    local = at_place(drive, model.equations.x) if isinstance(drive, Expr) else None
    if local is None or local[0] in model.equations.domain or not model.state_form.displacements:
        return None
    place, displacement = local
    if displacement not in model.state_form.displacements:
        known = ", ".join(map(str, model.state_form.displacements))
        raise ValueError(f"drive = {shown(drive)}: what a force acts on at {place} must be one of {known}")
    force = Function("unit_force")(model.equations.t)
    inside = [*model.pieces["inside"], (place, force * displacement)]
    found = model.replace(inside=inside)
    found.symbols = model.symbols  # those of oscillating terms too, which take values all the same
    return found, force.func.__name__, kernel(place, model.symbols, backend="numpy")
