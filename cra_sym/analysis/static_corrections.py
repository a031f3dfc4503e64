"""What the modes left out contribute by their statics, when the stiffness of an end fluctuates.

The sums over all modes of the products of displacements at the springs over omega^2 and over omega^4 are those of a
static problem; what the first modes leave of them is known exactly.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from cra_sym.model.excitations import Fluctuation
from cra_sym.model.spatial import SpatialProblem
from cra_sym.model.system import System
from cra_sym.model.values import flat_columns
from cra_sym.solvers.static_moments import static_moments

__all__ = ["moments_of_all_modes", "static_terms"]

Array = NDArray[np.float64]


def moments_of_all_modes(system: System, excitation: Fluctuation) -> tuple[Array, Array]:
    """Return the sums over all modes j of b_sj b_rj / omega_j^2 and / omega_j^4, b as in `spring_displacements`.

    Returns
    -------
    second, fourth : ndarray, shape (..., springs, springs)
        1 and s2; 0 for an infinite stiffness.
    """
    names = excitation.springs(system)
    problem: SpatialProblem = system.numerics("spatial")
    ends = [system.numerics("stiffnesses")[name] for name in names]
    places = [place if end == 0 else problem.displacements + problem.coordinates + place for end, place in ends]
    columns = flat_columns(system.parameters, system.shape)
    second, fourth = np.zeros((2, columns.shape[1], len(names), len(names)))
    for rows, _, some in problem.problems(columns):
        second[rows], fourth[rows] = static_moments(some, places)
    values = [np.broadcast_to(system.values[name], system.shape) for name in names]
    root = np.sqrt(np.stack([np.where(np.isinf(value), 0.0, value) for value in values], axis=-1))
    scale = root[..., :, None] * root[..., None, :]
    return scale * second.reshape(scale.shape), scale * fourth.reshape(scale.shape)


def static_terms(system: System, excitation: Fluctuation, modes: int) -> tuple[Array, Array]:
    r"""Return the coupling in rank-one terms that include the statics of the modes left out.

    The fluctuating springs act on their displacements, to which the modes left out give a static share. With R its
    matrix and a the weights the stiffness is :math:`B^T a\,\epsilon c\,(1 + R a\,\epsilon c)^{-1} B` for
    :math:`c = \cos\varpi t`, and the eigenvectors of :math:`a^{1/2} R a^{1/2}` split it.

    Returns
    -------
    coupling : ndarray, shape (..., springs, modes, modes)
    compliance : ndarray, shape (..., springs)
        P_r and lambda_r of :mod:`cra_sym.solvers.floquet`.
    """
    b = excitation.spring_displacements(system, modes)
    omega = system.natural_frequencies(modes)
    with np.errstate(divide="ignore", invalid="ignore"):
        shares = np.where(b == 0, 0.0, b / omega[..., None, :])
    second, _ = moments_of_all_modes(system, excitation)
    remaining = second - shares @ shares.swapaxes(-1, -2)
    weights = [np.asarray(excitation.weights[name]) for name in excitation.springs(system)]
    root = np.sqrt(np.stack(np.broadcast_arrays(*weights), axis=-1))
    compliance, vectors = np.linalg.eigh(root[..., :, None] * remaining * root[..., None, :])
    rows = vectors.swapaxes(-1, -2) @ (root[..., None] * b)
    return rows[..., :, None] * rows[..., None, :], compliance
