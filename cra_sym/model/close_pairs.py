"""The first two modes where their frequencies nearly coincide: Rayleigh-Ritz values keep digits a determinant loses.

A heavy end-effector on a soft joint moves as a rigid body, along and about itself. Tuned alike, the two motions have
frequencies as close as their coupling is weak, and zeros of the determinant at a relative distance g are known to
eps / g only. The energies of the two motions have no such loss. All other neighbours are well apart.
"""

from __future__ import annotations

import numpy as np

from cra_sym.model.modal import near_shape
from cra_sym.model.spectrum import pair
from cra_sym.solvers.rayleigh import stationary_values

__all__ = ["CLOSE", "resolve_close_pairs"]

CLOSE = 0.1
"""Relative distance of two frequencies below which their zeros are replaced by Rayleigh-Ritz values."""

_POINTS, _WEIGHTS = np.polynomial.legendre.leggauss(12)  # exact to rounding up to z of 5, where all close pairs lie
_XI = np.append((1 + _POINTS) / 2, 1.0)[:, None]
_ALMOST_RIGID = 5.0**0.25


def resolve_close_pairs(
    lam: np.ndarray, kappa_t: np.ndarray, kappa_r: np.ndarray, mu: np.ndarray, iota: np.ndarray
) -> None:
    """Correct, in place, the first two frequency parameters of every arm in which they lie close to each other.

    Parameters
    ----------
    lam : ndarray, shape (..., modes), contiguous
        Ascending frequency parameters.
    kappa_t, kappa_r, mu, iota : ndarray, shape (...)
    """
    if lam.shape[-1] < 2:
        return
    rows = lam.reshape(-1, lam.shape[-1])
    close = np.flatnonzero((rows[:, 0] > (1 - CLOSE) * rows[:, 1]) & (rows[:, 1] < _ALMOST_RIGID))
    groups = [value.reshape(-1)[close] for value in (kappa_t, kappa_r, mu, iota)]
    for mode in (0, 1) if close.size else ():
        rows[close, mode] = _ritz_values(rows[close, mode] ** 4, *groups)[:, mode] ** 0.25


def _ritz_values(
    z: np.ndarray, kappa_t: np.ndarray, kappa_r: np.ndarray, mu: np.ndarray, iota: np.ndarray
) -> np.ndarray:
    """Return both stationary values of strain over kinetic energy among the solutions that meet the root's conditions.

    Those for the given z hold the mode up to the error of z, which enters squared.
    """
    (s_t, c_t), (s_r, c_r) = pair(kappa_t), pair(kappa_r)
    states = np.array([[c_t, 0 * z], [0 * z, c_r], [0 * z, s_r], [-s_t, 0 * z]])[:, :, None]  # for each amplitude
    displacement, slope, curvature = (near_shape(states, z, _XI, order) for order in range(3))

    def integral(shape: np.ndarray) -> np.ndarray:
        return np.einsum("apn,bpn,p->nab", shape[:, :-1], shape[:, :-1], _WEIGHTS / 2)

    def at_tip(shape: np.ndarray, inertia: np.ndarray) -> np.ndarray:
        return np.einsum("an,bn,n->nab", shape[:, -1], shape[:, -1], inertia)

    strain = integral(curvature)
    strain[:, 0, 0] += s_t * c_t
    strain[:, 1, 1] += s_r * c_r
    return stationary_values(strain, integral(displacement) + at_tip(displacement, mu) + at_tip(slope, iota))
