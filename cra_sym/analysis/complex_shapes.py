"""Complex mode shapes, from the exact dynamic stiffness or, where that has none, from the stress basis."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from cra_sym.analysis.eigenvalues import eigenvalues
from cra_sym.model.complex_shapes import CoarseIntegrationError, ComplexShapes
from cra_sym.model.routes import mode_sign, overview_places
from cra_sym.model.system import System
from cra_sym.model.values import flat_columns
from cra_sym.solvers.lowest_motions import LowestMotions, lowest_motions
from cra_sym.solvers.pencil import GeneralContinuum

__all__ = ["complex_shapes"]

Array = NDArray[np.float64]
Complex = NDArray[np.complex128]


def complex_shapes(system: System, modes: int, oscillating: bool, place: int, derivative: int, x: Array) -> Complex:
    """Return a derivative of a displacement of the section in complex modes, shape (..., modes, len(x))."""
    numerics = system.numerics
    if numerics("conservative"):
        return np.asarray(system.modes(modes).shape(place, derivative, x), dtype=complex)
    s, spatial = eigenvalues(system, modes, oscillating=oscillating), numerics("damped_spatial")
    columns = flat_columns(system.parameters, system.shape)
    if not spatial.supported and not spatial.singular(columns).any():
        shapes = ComplexShapes(s, spatial, numerics("damped"), columns, system.domain, numerics("inertia"))
        try:
            return shapes.shape(place, derivative, x)
        except CoarseIntegrationError:
            if numerics("pencil") is None:
                raise
    found = np.empty((columns.shape[1], modes, len(x)), dtype=complex)
    for row, values in enumerate(s.reshape(-1, modes)):
        found[row] = _of_basis(system, columns[:, row : row + 1], values, place, derivative, x)
    return found.reshape(*s.shape, len(x))


def _of_basis(system: System, column: Array, s: Complex, place: int, derivative: int, x: Array) -> Complex:
    """Return the shapes of one parameter set that belong to some of its lowest eigenvalues, (modes, stations)."""
    spatial = system.numerics("damped_spatial")
    orders = system.numerics("pencil").orders
    top = np.repeat(np.cumsum(orders), orders)[place]
    if place + derivative > top:
        raise ValueError(
            f"derivative = {derivative}: complex shapes with supports at interior places, or coefficients that vary "
            f"finely, have derivatives up to {top - place}"
        )
    ((_, problem),) = system.numerics("pencil").problems(column)
    motions = _motions(problem, s)
    values, vectors = np.linalg.eig(motions.system)
    own = motions.shapes @ vectors[:, [np.abs(values - one).argmin() for one in s]]
    basis = motions.basis
    energy = (np.abs(basis.problem.root_mass[0][:, None] * own) ** 2).sum(axis=0) / basis.problem.rate[0] ** 2
    ends = overview_places(spatial, np.where(np.isinf(column), 0.0, column), 1)[0]
    seen = np.stack([basis.shape(k, 0, ends).T @ own for k in range(spatial.displacements)], axis=-1)
    turn = mode_sign(np.swapaxes(seen, 0, 1)[None])[0, :, 0]
    shapes: Complex = (turn / np.sqrt(energy))[:, None] * (basis.shape(place, derivative, x).T @ own).T
    return shapes


def _motions(problem: GeneralContinuum, s: Complex) -> LowestMotions:
    """Return the motions of enough eigenvalues to include all of these."""
    number = len(s)
    while True:
        motions = lowest_motions(problem, number, 0.0)
        gap = np.abs(motions.eigenvalues[:, None] - s).min(axis=0)
        if (gap < 1e-6 * np.maximum(np.abs(s), 1e-6 * np.abs(s).max())).all():
            return motions
        number *= 2
