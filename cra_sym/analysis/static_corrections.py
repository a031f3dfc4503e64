"""Static correction of omitted modes when the stiffness of an end fluctuates.

The contribution of the omitted modes to the receptance at the springs is analytic up to the next natural frequency, so
its value and slope at zero frequency follow from the exact receptance where that is well conditioned.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from cra_sym.model.excitations import Fluctuation
from cra_sym.model.spatial import SpatialProblem
from cra_sym.model.system import System
from cra_sym.model.values import flat_columns
from cra_sym.solvers.remainder import moments, nodes

__all__ = ["moments_of_other_modes", "static_terms"]

Array = NDArray[np.float64]


def moments_of_other_modes(system: System, excitation: Fluctuation, modes: int) -> tuple[Array, Array]:
    """Return the sums over the omitted modes j of b_sj b_rj / omega_j^2 and / omega_j^4.

    b is as in `Fluctuation.spring_displacements`.

    Returns
    -------
    second, fourth : ndarray, shape (..., springs, springs)
        1 and s2; 0 for an infinite stiffness.
    """
    names = excitation.springs(system)
    if modes >= system.most_modes:  # no modes are omitted
        nothing = np.zeros((*system.shape, len(names), len(names)))
        return nothing, nothing
    problem: SpatialProblem = system.numerics("spatial")
    if problem.supported:  # the reactions as unknowns; nothing of first order in time fluctuates here
        problem = system.numerics("driven_spatial")
    ends = [system.numerics("stiffnesses")[name] for name in names]
    places = [place if end == 0 else problem.displacements + problem.coordinates + place for end, place, _ in ends]
    columns = flat_columns(system.parameters, system.shape)
    rows = columns.shape[1]
    squares = system.natural_frequencies(modes + 1).reshape(rows, -1) ** 2
    limit = squares[:, -1]
    z = nodes(limit)
    receptance = np.zeros((*z.shape, len(names), len(names)))
    for members, _, some in problem.problems(columns):
        row = np.repeat(np.arange(len(members)), z.shape[1])
        here = some.evaluate(z[members].ravel(), row, keep_tree=True)
        assert here.tree is not None
        load = here.tree.scale[:, places, None] * here.unit[:, places, :]
        found = load @ np.linalg.solve(here.matrix, load.swapaxes(-1, -2))
        receptance[members] = found.reshape(len(members), z.shape[1], len(names), len(names))
    shapes = [system.modes(modes).displacement(end, place) for end, place, _ in ends]
    b = np.stack([shape.reshape(rows, modes) for shape in shapes], axis=-1)
    second, fourth = moments(receptance, squares[:, :-1], b[..., :, None] * b[..., None, :], limit)
    values = [
        system.values[name] * end.factor.function(*system.domain.values) for name, end in zip(names, ends, strict=True)
    ]
    flat = [np.broadcast_to(value, system.shape).ravel() for value in values]
    root = np.sqrt(np.stack([np.where(np.isinf(value), 0.0, value) for value in flat], axis=-1))
    scale = root[:, :, None] * root[:, None, :]
    shape = (*system.shape, len(names), len(names))
    return (scale * second).reshape(shape), (scale * fourth).reshape(shape)


def static_terms(system: System, excitation: Fluctuation, modes: int) -> tuple[Array, Array]:
    r"""Return the coupling as rank-one terms that include the static correction of the omitted modes.

    The fluctuating springs act on displacements to which the omitted modes contribute statically. With the static
    flexibility R and the weights a the stiffness is :math:`B^T a\,\epsilon c\,(1 + R a\,\epsilon c)^{-1} B` for
    :math:`c = \cos\varpi t`, and the eigenvectors of :math:`a^{1/2} R a^{1/2}` decouple it.

    Returns
    -------
    coupling : ndarray, shape (..., springs, modes, modes)
    compliance : ndarray, shape (..., springs)
        The K_r and lambda_r of :mod:`cra_sym.solvers.periodic`.
    """
    b = excitation.spring_displacements(system, modes)
    remaining, _ = moments_of_other_modes(system, excitation, modes)
    weights = [np.asarray(excitation.weights[name]) for name in excitation.springs(system)]
    root = np.sqrt(np.stack(np.broadcast_arrays(*weights), axis=-1))
    compliance, vectors = np.linalg.eigh(root[..., :, None] * remaining * root[..., None, :])
    rows = vectors.swapaxes(-1, -2) @ (root[..., None] * b)
    return rows[..., :, None] * rows[..., None, :], compliance
