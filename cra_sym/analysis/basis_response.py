"""Frequency responses in the stress basis, for dampers along x and stiffnesses that vanish at an end."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import nullcontext, suppress

import numpy as np
from numpy.typing import NDArray

from cra_sym.analysis.modes import displaced
from cra_sym.model.projection import project
from cra_sym.model.routes import Modes
from cra_sym.model.system import System
from cra_sym.model.vanishing import check_forces
from cra_sym.solvers.driven_basis import driven_on_basis

__all__ = ["on_basis"]

Array = NDArray[np.float64]
Complex = NDArray[np.complex128]


def on_basis(
    system: System,
    columns: Array,
    s: Complex,
    drive: str | Callable[[Modes], Array],
    place: int,
    x: Array | None,
    *,
    motion: bool = False,
    zeta: Array | None = None,
) -> tuple[Complex, NDArray[np.bool_]]:
    """Return the amplitudes of responses to ``exp(s t)``, shape (sets, places, K), and for which sets they exist.

    Parameters
    ----------
    system : System
    columns : ndarray, shape (parameters, sets)
    s : ndarray of complex, shape (sets, K)
        rad/s.
    drive : str or callable
        Name of a motion or a force, or a callable: ``drive(modes)`` returns the driven displacement in each mode.
    place : int
        Output, as found by `section_place`.
    x : ndarray or None
        Places; None is the right end.
    motion : bool
        Whether the driven displacement is prescribed, with unit amplitude.
    zeta : ndarray, shape (sets,), optional
        Modal damping ratios.

    Raises
    ------
    ValueError
        If the response does not converge and there is no other method: with an infinite coefficient at an end, or with
        modal damping.
    """
    count = 1 if x is None else len(x)
    found = np.empty((len(s), count, s.shape[1]), dtype=complex)
    there = np.zeros(len(s), dtype=bool)
    pencil = system.numerics("pencil")
    if pencil is None:
        return found, there
    alone = system.numerics("damped_spatial").singular(columns) | (zeta is not None)

    def outputs(basis: Modes) -> Array:
        return displaced(system, basis, place)[None] if x is None else displaced(system, basis, place, x).T

    if isinstance(drive, str):
        check_forces(system, system.numerics("load", drive), pencil)
    for row in range(len(s)):
        column = columns[:, row : row + 1]

        def load(basis: Modes, column: Array = column) -> Array:
            if not isinstance(drive, str):
                return drive(basis)
            one = system.model.at(dict(zip(system.numerics("names"), column[:, 0], strict=True)))
            return project(one.domain, basis, system.numerics("load", drive))

        with nullcontext() if alone[row] else suppress(ValueError):
            ((_, problem),) = pencil.problems(column)
            ratio = 0.0 if zeta is None else float(zeta[row])
            found[row] = driven_on_basis(problem, s[row], load, outputs, motion=motion, zeta=ratio)
            there[row] = True
    return found, there
