"""Refusal of forces on ends at which a stiffness vanishes, where they would make the strain infinite."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from cra_sym.model.projection import Load
from cra_sym.model.stress_route import StressRoute
from cra_sym.model.values import flat_columns
from cra_sym.solvers.stress_refine import alike

if TYPE_CHECKING:
    from cra_sym.model.system import System

__all__ = ["check_ends", "check_forces"]


def check_ends(system: System, columns: NDArray[np.float64]) -> None:
    """Raise a ValueError if a spring, mass or damper acts where a vanishing stiffness would make the strain infinite.

    Parameters
    ----------
    system : System
    columns : ndarray, shape (parameters, sets)
    """
    pencil = system.numerics("pencil")
    if pencil is not None:
        for _, problem in pencil.problems(columns):
            for _ in alike(problem):
                pass


def check_forces(system: System, load: Load, route: object) -> None:
    """Raise a ValueError if a load acts on a displacement of an end where that makes the strain infinite.

    If the stiffness goes to zero as the distance to the power a, no force may act on the displacement of a string for
    a >= 1, on the displacement of a beam for a >= 3, or on its slope for a >= 1. ``route`` computes the modes.
    """
    ends = [place for place in load.ends if place.where in ("left", "right")]
    if not ends or not isinstance(route, StressRoute):
        return
    columns, spatial = flat_columns(system.parameters, system.shape), route.spatial
    if not spatial.singular(columns).any():
        return
    pencil = system.numerics("pencil")
    size = 2 * spatial.displacements + spatial.coordinates
    units = np.eye(size)
    acting = [k.entry + (k.where == "right") * (spatial.displacements + spatial.coordinates) for k in ends]
    for rows, problem in pencil.problems(columns):
        pulled = np.broadcast_to(units[acting], (len(rows), len(acting), size))
        ones = np.ones((len(rows), len(acting)))
        for _ in alike(
            replace(
                problem,
                directions=np.concatenate([problem.directions, pulled], axis=1),
                springs=np.concatenate([problem.springs, ones], axis=1),
            )
        ):
            pass
