"""Rayleigh-Ritz values of computed mode shapes: full relative accuracy for frequencies far below those of the beam.

A soft joint moves the arm almost rigidly. Its frequency drowns in the rounding of the static stiffness, but the forces
in the computed shape do not: strain energy taken from the forces has no cancellation.
"""

from __future__ import annotations

from itertools import combinations

import numpy as np

from .shapes import mode_states
from .stiffness import DynamicStiffness

__all__ = ["quotients", "ritz_values"]

_POINTS, _WEIGHTS = np.polynomial.legendre.leggauss(10)


def ritz_values(problem: DynamicStiffness, z: np.ndarray, almost_rigid: np.ndarray) -> np.ndarray:
    """Return strain over kinetic energy, minimised over the span of the modes with the given approximate roots.

    Parameters
    ----------
    problem : DynamicStiffness
    z : ndarray, shape (rows, modes)
    almost_rigid : ndarray of int, shape (rows,)
        How many of the first modes hardly deform, so that their static shapes serve.

    Returns
    -------
    ndarray, shape (rows, modes)
        omega^2
    """
    at = np.where(np.arange(z.shape[1]) < almost_rigid[:, None], 0.0, z)  # shapes of one evaluation are independent
    strain, kinetic = _energies(problem, at)
    frame = np.linalg.inv(np.linalg.cholesky(kinetic))
    return np.sort(_jacobi(frame @ strain @ np.swapaxes(frame, -1, -2)), axis=1)


def _jacobi(matrix: np.ndarray) -> np.ndarray:
    """Return the eigenvalues of a stack of small graded matrices by Jacobi's rotations.

    LAPACK's are exact to rounding of the largest; Jacobi's are so to rounding of each (Demmel and Veselic 1992).
    """
    a = matrix.copy()
    size = a.shape[-1]
    for p, q in list(combinations(range(size), 2)) * 8:
        off = a[:, p, q]
        gap = a[:, q, q] - a[:, p, p]
        length = np.hypot(gap, 2.0 * off)
        tangent = 2.0 * off * np.where(gap < 0.0, -1.0, 1.0) / np.where(length > 0.0, np.abs(gap) + length, 1.0)
        cosine = 1.0 / np.hypot(1.0, tangent)
        rotation = np.zeros_like(a) + np.eye(size)
        rotation[:, p, p] = rotation[:, q, q] = cosine
        rotation[:, p, q], rotation[:, q, p] = tangent * cosine, -tangent * cosine
        diagonal = a[:, p, p] - tangent * off, a[:, q, q] + tangent * off
        a = np.swapaxes(rotation, -1, -2) @ a @ rotation
        a[:, p, p], a[:, q, q] = diagonal
        a[:, p, q] = a[:, q, p] = 0.0
    return np.diagonal(a, axis1=1, axis2=2)


def quotients(problem: DynamicStiffness, z: np.ndarray) -> np.ndarray:
    """Return strain over kinetic energy of each mode: an error of the shape enters squared."""
    strain, kinetic = _energies(problem, z)
    return np.diagonal(strain, axis1=1, axis2=2) / np.diagonal(kinetic, axis1=1, axis2=2)


def _energies(problem: DynamicStiffness, z: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the matrices of strain and kinetic energy of the modes, integrated panel by panel."""
    n, m = problem.displacements, problem.coordinates
    every = np.arange(len(z))
    reference = z[:, -1]
    system, _ = problem.system(reference, every, np.array([[0.0, 0.5, 1.0]]))
    radius = np.abs(np.linalg.eigvals(system)).max(initial=0.0) * problem.length.max()
    panels = int(np.ceil(radius)) + (1 if problem.uniform else 12)
    share = ((np.arange(panels)[:, None] + 0.5 * (1.0 + _POINTS)) / panels).ravel()
    state = mode_states(problem, z, np.broadcast_to(np.r_[0.0, share, 1.0], (len(z), len(share) + 2)))
    inner = (
        state[:, :, 1:-1]
        * np.sqrt(problem.length[:, None] * np.tile(0.5 * _WEIGHTS / panels, panels))[:, None, :, None]
    )
    densities = _energy_densities(*problem.system(reference, every, share[None]), reference, n, m)
    end, end_slope = problem.boundary(reference, every)
    lumped = end - reference[:, None, None] * end_slope, -end_slope
    edge = np.concatenate([state[:, :, 0, : n + m], state[:, :, -1, :n]], axis=-1)
    strain, kinetic = (
        (inner[:, :, None] * (density[:, None, None] @ inner[:, None, ..., None])[..., 0]).sum(axis=(-2, -1))
        + edge @ ends @ np.swapaxes(edge, -1, -2)
        for density, ends in zip(densities, lumped, strict=True)
    )
    return strain, kinetic


def _energy_densities(system, slope, z, n: int, m: int) -> tuple[np.ndarray, np.ndarray]:
    """Return the quadratic forms of strain and kinetic energy density in (q, w, P).

    With H = P q' - (U - z T) and A = [[H_P], [-H_q]]: T = dH/dz, and U = P H_P - H + z T.
    """
    motion, force = slice(0, n + m), slice(n + m, 2 * n + m)
    stiff = np.zeros((*system.shape[:2], 2 * n + m, 2 * n + m))
    inertia = np.zeros_like(stiff)
    inertia[..., motion, motion] = -slope[..., n + m :, motion]
    inertia[..., force, force] = slope[..., :n, force]
    inertia[..., force, motion] = slope[..., :n, motion]
    inertia[..., motion, force] = np.swapaxes(slope[..., :n, motion], -1, -2)
    stiff[..., motion, motion] = system[..., n + m :, motion]
    stiff[..., force, force] = system[..., :n, force]
    return stiff + z[:, None, None, None] * inertia, inertia
