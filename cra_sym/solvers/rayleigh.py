"""Rayleigh-Ritz values of computed mode shapes, which restore digits that rounding of the stiffness takes from roots.

A stiffness joined from short pieces is a small difference of large terms where the motion hardly strains a piece: soft
joints, heavy tips, strings with a small bending stiffness. The forces in the computed shape have no such cancellation,
and the relative error of a strain energy computed from them is of the order of the square of that of the shape.
"""

from __future__ import annotations

from itertools import combinations

import numpy as np

from .shapes import mode_vectors, nodes
from .stiffness import GOLDEN, DynamicStiffness, transfer

__all__ = ["quotients", "ritz_values", "stationary_values"]


def quotients(problem: DynamicStiffness, z: np.ndarray) -> np.ndarray:
    """Return the Rayleigh quotient of each mode, whose error is the square of that of the shape.

    Parameters
    ----------
    problem : DynamicStiffness
    z : ndarray, shape (rows, modes)
        Approximate roots, as `mode_states` takes them.

    Returns
    -------
    ndarray, shape (rows, modes)
    """
    here, u, row = mode_vectors(problem, z)
    at, result = z.ravel(), np.empty(z.size)
    for level, member, start, edge in nodes(problem, here, u):
        own = at[member, None]
        strain, kinetic = _energies(problem, row[member], own, at[member], level, start[:, :, None], edge[:, None])
        result[member] = (strain / kinetic)[:, 0, 0]
    return result.reshape(z.shape)


def ritz_values(problem: DynamicStiffness, z: np.ndarray, almost_rigid: np.ndarray) -> np.ndarray:
    """Return Ritz values on the span of the soft modes with the given approximate roots.

    Parameters
    ----------
    problem : DynamicStiffness
    z : ndarray, shape (rows, modes)
    almost_rigid : ndarray of int, shape (rows,)
        Number of the first modes that are almost rigid, for which static shapes are used.

    Returns
    -------
    ndarray, shape (rows, modes)
        omega^2
    """
    modes = z.shape[1]
    at = np.where(np.arange(modes) < almost_rigid[:, None], 0.0, z)  # shapes of one evaluation are independent
    here, u, _ = mode_vectors(problem, at, common_levels=True)
    result = np.empty(z.shape)
    for level, member, start, edge in nodes(problem, here, u):
        of = member[::modes] // modes
        start, edge = start.reshape(2, len(of), modes, *start.shape[2:]), edge.reshape(len(of), modes, -1)
        strain, kinetic = _energies(problem, of, at[of], np.zeros(len(of)), level, start, edge)
        result[of] = stationary_values(strain, kinetic)
    return result


def stationary_values(strain: np.ndarray, kinetic: np.ndarray) -> np.ndarray:
    """Return the stationary values of strain over kinetic energy, ascending, of a stack of pairs of small matrices."""
    frame = np.linalg.inv(np.linalg.cholesky(kinetic))
    return np.sort(_jacobi(frame @ strain @ np.swapaxes(frame, -1, -2)), axis=1)


def _jacobi(matrix: np.ndarray) -> np.ndarray:
    """Return the eigenvalues of a stack of small graded matrices by Jacobi's rotations.

    LAPACK's are accurate relative to the largest, Jacobi's relative to each of them (Demmel and Veselic 1992).
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


def energies_of_springs(stiffness: np.ndarray, motions: np.ndarray) -> np.ndarray:
    """Return ``motions @ stiffness @ motions.T`` of a stack of small matrices, as a sum over elongations.

    A spring between two points that move together stores no energy. The product would leave rounding errors of its
    large terms; elongations, from an elimination with diagonal pivots, do not. A remainder below rounding is set to
    zero.

    Parameters
    ----------
    stiffness : ndarray, shape (rows, places, places)
        Symmetric.
    motions : ndarray, shape (rows, modes, places)

    Returns
    -------
    ndarray, shape (rows, modes, modes)
    """
    rest, size = stiffness.copy(), np.abs(stiffness)
    every, rounding = np.arange(len(rest)), 4.0 * np.finfo(float).eps
    result = np.zeros((*motions.shape[:2], motions.shape[1]))
    for _ in range(rest.shape[-1]):
        place = np.abs(np.diagonal(rest, axis1=1, axis2=2)).argmax(axis=1)
        pivot, column = rest[every, place, place], rest[every, :, place]
        direction = column / np.where(pivot == 0.0, np.inf, pivot)[:, None]
        elongation = (motions @ direction[..., None])[..., 0]
        result += pivot[:, None, None] * elongation[:, :, None] * elongation[:, None, :]
        eliminated = column[:, :, None] * direction[:, None, :]
        size = size + np.abs(eliminated)
        rest = rest - eliminated
        rest[np.abs(rest) <= rounding * size] = 0.0
        own = pivot != 0.0
        rest[every[own], place[own]] = rest[every[own], :, place[own]] = 0.0
    return np.asarray(result + motions @ rest @ np.swapaxes(motions, -1, -2))


def _energies(
    problem: DynamicStiffness,
    rows: np.ndarray,
    z: np.ndarray,
    reference: np.ndarray,
    level: int,
    start: np.ndarray,
    edge: np.ndarray,
) -> tuple[np.ndarray, np.ndarray]:
    """Return the matrices of strain and kinetic energy of the modes of each row, shape (rows, modes, modes).

    ``start`` (part, row, mode, piece, state) is the state at the left of every piece, ``edge`` (row, mode, place) the
    motion of the ends and coordinates. The energies are those at ``z = reference``.
    """
    n, m = problem.displacements, problem.coordinates
    pieces = 1 if problem.uniform else start.shape[3]
    index, modes = np.repeat(rows, z.shape[1]), z.shape[1]
    end, end_slope = problem.boundary(reference, rows)
    strain = energies_of_springs(end - reference[:, None, None] * end_slope, edge)
    kinetic = edge @ -end_slope @ np.swapaxes(edge, -1, -2)
    points, weights = np.polynomial.legendre.leggauss(8 if problem.uniform else 5)  # of pieces with exponents to 1, 1/4
    for part, (origin, share) in enumerate(((0.0, GOLDEN), (GOLDEN, 1.0 - GOLDEN))):
        width = np.full((1, pieces), share / 2.0**level)
        nodes_left = origin + np.arange(pieces) * width
        for point, weight in zip(0.5 * (1.0 + points), 0.5 * weights, strict=True):
            omega, _ = problem.exponent(z.ravel(), index, nodes_left, width * point)
            carried = transfer(omega).reshape(len(rows), modes, pieces, *omega.shape[2:])
            state = (carried @ start[part][..., None])[..., : 2 * n + m, 0]
            densities = _energy_densities(*problem.system(reference, rows, nodes_left + width * point), reference, n, m)
            length = (weight * problem.length[rows])[:, None, None] * width[0, 0]
            for total, density in zip((strain, kinetic), densities, strict=True):
                weighted = (density[:, None] @ state[..., None])[..., 0]
                total += length * np.einsum("rips,rjps->rij", state, weighted)
    return strain, kinetic


def _energy_densities(
    system: np.ndarray, slope: np.ndarray, z: np.ndarray, n: int, m: int
) -> tuple[np.ndarray, np.ndarray]:
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
