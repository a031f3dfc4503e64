"""The first two modes where their frequencies nearly coincide: Rayleigh-Ritz values keep digits a determinant loses.

A heavy end-effector on a soft joint moves as a rigid body, along and about itself. Tuned alike, the two motions have
frequencies as close as their coupling is weak, and zeros of the determinant at a relative distance g are known to
eps / g only. The energies of the two motions have no such loss. All other neighbours are well apart.
"""

from __future__ import annotations

import numpy as np

from cra_sym.arm.spectrum import pair
from cra_sym.kernels import derived_kernel

__all__ = ["CLOSE", "resolve_close_pairs"]

CLOSE = 0.1
"""Relative distance of two frequencies below which their zeros are replaced by Rayleigh-Ritz values."""

_POLYNOMIALS = derived_kernel("cra_sym.arm.shapes:polynomials")
_POINTS, _WEIGHTS = np.polynomial.legendre.leggauss(12)  # exact to rounding up to z of 5, where all close pairs lie
_XI = np.append((1 + _POINTS) / 2, 1.0)[:, None]
_PANEL = _WEIGHTS[:, None] / 2
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
        rows[close, mode] = _ritz_values(rows[close, mode] ** 4, *groups)[mode] ** 0.25


def _ritz_values(
    z: np.ndarray, kappa_t: np.ndarray, kappa_r: np.ndarray, mu: np.ndarray, iota: np.ndarray
) -> np.ndarray:
    """Return both stationary values of strain over kinetic energy among the solutions that meet the root's conditions.

    Those for the given z hold the mode up to the error of z, which enters squared.
    """
    (s_t, c_t), (s_r, c_r) = pair(kappa_t), pair(kappa_r)
    states = np.array([[c_t, 0 * z, 0 * z, -s_t], [0 * z, c_r, s_r, 0 * z]])  # at the root, for each amplitude
    displacement, slope, curvature = (_derivative(states, z, order) for order in range(3))

    def integral(shape: np.ndarray) -> np.ndarray:
        return np.einsum("apn,bpn,pm->abn", shape[:, :-1], shape[:, :-1], _PANEL)

    def at_tip(shape: np.ndarray) -> np.ndarray:
        return shape[:, None, -1] * shape[None, :, -1]

    strain = integral(curvature)
    strain[0, 0] += s_t * c_t
    strain[1, 1] += s_r * c_r
    kinetic = integral(displacement) + mu * at_tip(displacement) + iota * at_tip(slope)
    return _eigenvalues(strain, kinetic)


def _derivative(states: np.ndarray, z: np.ndarray, order: int) -> np.ndarray:
    """Return a derivative by xi of the solutions with the given states at the root, shape (2, points, arms)."""
    solutions = _POLYNOMIALS.function(
        _XI, z
    )  # the derivative of each is the one before it, of the first z times the last
    terms = (states[:, None, j] * (z if j < order else 1.0) * solutions[(j - order) % 4] for j in range(4))
    return sum(terms, np.zeros((2, len(_XI), z.size)))


def _eigenvalues(strain: np.ndarray, kinetic: np.ndarray) -> np.ndarray:
    """Return the two eigenvalues of a symmetric pair of 2 x 2 matrices, ascending."""
    scale = np.sqrt(np.array([kinetic[0, 0], kinetic[1, 1]]))
    strain = strain / (scale[:, None] * scale[None, :])
    coupling = kinetic[0, 1] / (scale[0] * scale[1])
    left = strain[0, 0]
    independent = 1 - coupling**2
    mixed = (strain[0, 1] - coupling * left) / np.sqrt(independent)
    right = (strain[1, 1] - coupling * (2 * strain[0, 1] - coupling * left)) / independent
    middle, radius = (left + right) / 2, np.hypot((left - right) / 2, mixed)
    return np.array([middle - radius, middle + radius])
