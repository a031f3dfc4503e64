"""What the modes left out contribute by their statics, when the joint's stiffness fluctuates.

A static unit force at the joint moves the whole arm by 1/k_t, a unit moment turns it by 1/k_r, and nothing bends. So
the sums over all modes of b_i b_j / omega^2 and b_i b_j / omega^4, with b the displacement or slope at the joint, are
the compliance 1/k and the rigid body's inertia over k_s k_r; what the first modes leave of them is known exactly.
Without one of the springs its motion is free, and the other's takes along as much of it as leaves it no momentum.
"""

from __future__ import annotations

import numpy as np

from cra_sym.analysis.modes import ModalParameters
from cra_sym.arm.excitations import JointStiffness
from cra_sym.arm.parameters import Arm

__all__ = ["moments_of_all_modes", "spring_vectors", "static_terms"]


def spring_vectors(modal: ModalParameters) -> np.ndarray:
    """Return sqrt(k_t) phi_i(0) and sqrt(k_r) phi_i'(0), 1/s, shape (..., 2, modes); zero at infinite stiffness."""
    translation = np.einsum("...ii->...i", modal.stiffness_translation)
    rotation = np.einsum("...ii->...i", modal.stiffness_rotation)
    # shear and moment at the joint keep the sign where displacement and slope vanish
    return np.stack(
        [-np.sign(modal.root_shear) * np.sqrt(translation), np.sign(modal.root_moment) * np.sqrt(rotation)], axis=-2
    )


def moments_of_all_modes(
    arm: Arm, modal: ModalParameters, excitation: JointStiffness, row: int, target: int
) -> tuple[np.ndarray, np.ndarray]:
    """Return the sums over all modes j of P_rj P_jt / omega_j^2 and P_rj P_jt / omega_j^4, in closed form.

    Parameters
    ----------
    row, target : int
        The modes r and t, counted from 0.
    """
    weights = [np.asarray(excitation.k_t), np.asarray(excitation.k_r)]
    springs = [modal.stiffness_translation, modal.stiffness_rotation]
    second = sum(w**2 * p[..., row, target] for w, p in zip(weights, springs, strict=True))
    ends = [modal.root_displacement, modal.root_slope]
    beam, length, tip = np.asarray(arm.rhoA) * arm.L, np.asarray(arm.L), np.asarray(arm.m_e)
    mass, moment, turning = beam + tip, (beam / 2 + tip) * length, (beam / 3 + tip) * length**2 + arm.J_e
    elastic = [np.asarray(k) > 0 for k in (arm.k_t, arm.k_r)]
    inertia = [
        [mass - np.where(elastic[1], 0.0, moment**2 / turning), moment],
        [moment, turning - np.where(elastic[0], 0.0, moment**2 / mass)],
    ]
    there = [np.where(spring, weight, 0.0) for spring, weight in zip(elastic, weights, strict=True)]
    fourth = sum(
        there[s] * there[r] * inertia[s][r] * ends[s][..., row] * ends[r][..., target] for s in (0, 1) for r in (0, 1)
    )
    return second, fourth


def static_terms(modal: ModalParameters, excitation: JointStiffness) -> tuple[np.ndarray, np.ndarray]:
    r"""Return the coupling in rank-one terms that include the statics of the modes left out.

    The fluctuating springs act on the displacement at the joint, to which the modes left out give a static share. With
    R its matrix and a the weights the stiffness is :math:`B^T a\,\epsilon c\,(1 + R a\,\epsilon c)^{-1} B` for
    :math:`c = \cos\varpi t`, and the eigenvectors of :math:`a^{1/2} R a^{1/2}` split it.

    Returns
    -------
    coupling : ndarray, shape (..., 2, modes, modes)
    compliance : ndarray, shape (..., 2)
        P_r and lambda_r of :mod:`cra_sym.solvers.floquet`.
    """
    b = spring_vectors(modal)
    with np.errstate(divide="ignore", invalid="ignore"):
        shares = np.where(b == 0, 0.0, b / modal.omega[..., None, :])
    remaining = np.eye(2) - shares @ shares.swapaxes(-1, -2)
    root = np.sqrt(np.stack(np.broadcast_arrays(excitation.k_t, excitation.k_r), axis=-1))
    compliance, vectors = np.linalg.eigh(root[..., :, None] * remaining * root[..., None, :])
    rows = vectors.swapaxes(-1, -2) @ (root[..., None] * b)
    return rows[..., :, None] * rows[..., None, :], compliance
