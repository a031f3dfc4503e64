"""Energies of a model with coefficients that vary along x, in the form that Ritz's method on the stresses needs."""

from __future__ import annotations

from typing import TYPE_CHECKING

from sympy import Expr, Matrix, S, zeros

from cra_sym.kernels import kernel
from cra_sym.mechanics.jets import Jet
from cra_sym.mechanics.weak import WeakForm, weak_form
from cra_sym.model.driven import reacting
from cra_sym.model.spatial import SpatialProblem, spatial_problem
from cra_sym.model.stress_route import StressRoute
from cra_sym.model.symmetry import vanishes

if TYPE_CHECKING:
    from cra_sym.model.lagrangian import Model

__all__ = ["apply_inverse", "integrates_in_sequence", "stress_route"]


def stress_route(model: Model, spatial: SpatialProblem) -> StressRoute | None:
    """Return the route of a model by its energies, or None for inertia of the highest derivatives."""
    weak = weak_form(model.linearised.variation)
    section, highest, lumped = weak.fields()
    orders = tuple(weak.variation.orders)
    if 0 in orders or any(jet in highest for pair, e in weak.inside.items() for jet in pair if 2 in e):
        return None
    state = [*section, *lumped]
    leading, coupled = _matrix(weak, highest, highest, 0), _matrix(weak, highest, state, 0)
    strain = apply_inverse(leading, coupled)
    cross = zeros(*coupled.shape)
    if not integrates_in_sequence(strain, section, highest):
        strain, cross = cross, coupled
    rest = _matrix(weak, state, state, 0) - (coupled.T * strain if cross.is_zero_matrix else zeros(len(state)))
    named = {"W": leading, "B": strain, "D": cross, "R": rest, "M": _matrix(weak, state, state, 2)}
    entries: dict[tuple[str, int, int], Expr] = {}
    x = weak.variation.space.x
    for name, matrix in named.items():
        for i in range(matrix.rows):
            for j in range(matrix.cols):
                value = matrix[i, j]
                if (j >= i or name in "BD") and value != 0 and not (name in "BR" and vanishes(value, x)):
                    entries[name, i, j] = value
    values = tuple(entries.values())
    return StressRoute(
        spatial,
        orders,
        kernel(values, (x, *model.symbols), backend="numpy"),
        tuple(entries),
        _reacting(model, spatial),
    )


def _reacting(model: Model, spatial: SpatialProblem) -> SpatialProblem:
    """Return the spatial problem with the reactions of interior supports as coordinates."""
    form = model.conservative
    supported = reacting(form)
    return spatial if supported is form else spatial_problem(supported, model.symbols, model.equations.domain[0])


def apply_inverse(leading: Matrix, coupled: Matrix) -> Matrix:
    """Return the inverse of the leading stiffness times the coupling; entry by entry if it is diagonal."""
    if coupled.is_zero_matrix:
        return coupled
    if leading.is_diagonal():
        return Matrix(*coupled.shape, lambda i, j: coupled[i, j] / leading[i, i])
    return leading.inv() * coupled


def _matrix(weak: WeakForm, rows: list[Jet], columns: list[Jet], power: int) -> Matrix:
    return Matrix(
        len(rows), len(columns), [weak.inside.get((p, q), {}).get(power, S.Zero) for p in rows for q in columns]
    )


def integrates_in_sequence(strain: Matrix, section: list[Jet], highest: list[Jet]) -> bool:
    """Return whether the displacements follow from the strains by successive integration."""
    waiting = list(range(len(section)))
    while waiting:
        for place in waiting:
            raised = section[place]._replace(space=section[place].space + 1)
            needed = (
                [section.index(raised)]
                if raised in section
                else [j for j in range(len(section)) if strain[highest.index(raised), j] != 0]
            )
            if not set(needed) & set(waiting):
                waiting.remove(place)
                break
        else:
            return False
    return True
