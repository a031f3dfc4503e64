"""Exact steady vibration of a model that is driven at an end or on a lumped coordinate."""

from __future__ import annotations

from typing import Literal

import numpy as np
from sympy import Expr

from cra_sym.checks import shown
from cra_sym.mechanics import StateForm
from cra_sym.model.spatial import check_range
from cra_sym.solvers.shapes import states
from cra_sym.solvers.stiffness import DynamicStiffness

__all__ = ["driven_displacement", "steady_states"]

_MOST_LEVELS = 22  # four million pieces


def driven_displacement(form: StateForm, drive: Expr, ends: tuple[Expr, Expr]) -> int:
    """Return the position of a displacement in the order (q(left), w, q(right)).

    Raises
    ------
    ValueError
        If it is none of them, or an essential condition holds it.
    """
    left, right = ([displacement.subs(form.x, end) for displacement in form.displacements] for end in ends)
    order = [*left, *form.coordinates, *right]
    if not isinstance(drive, Expr) or drive not in order:
        raise ValueError(f"drive = {shown(drive)}: allowed are {', '.join(map(str, order))}")
    place = order.index(drive)
    if form.free[place, :].is_zero_matrix:
        raise ValueError(f"drive = {drive}: an essential condition holds it still")
    return place


def steady_states(
    problem: DynamicStiffness,
    parameter: np.ndarray,
    row: np.ndarray,
    share: np.ndarray,
    place: int,
    kind: Literal["force", "motion"],
) -> np.ndarray:
    """Return the complex state (q, w, P) for a unit force on, or a unit motion of, one displacement.

    A prescribed motion is the force that produces it, divided by what that force does.

    Raises
    ------
    ValueError
        If the waves are too short to follow, or an infinite stiffness holds what is driven.
    """
    levels = problem.levels(parameter, row)
    if levels.max(initial=0) > _MOST_LEVELS:
        raise ValueError(
            "angular_frequency: allowed are those whose waves are no shorter than a millionth of the domain"
        )
    here = problem.evaluate(parameter, row, keep_tree=True, levels=levels)
    assert here.tree is not None
    check_range(here.matrix)
    drive = here.tree.scale[:, place, None] * here.unit[:, place, :]
    if (drive == 0.0).all(axis=1).any():
        raise ValueError("drive: an infinite stiffness holds it still")
    u = here.solve(drive.astype(here.matrix.dtype))
    if kind == "motion":
        u = u / (drive * u).sum(axis=1, keepdims=True)
    return states(problem, here, u, parameter, row, share)
