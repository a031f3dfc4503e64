"""Beams with two waves a section as numbers, and two independent routes to their frequencies."""

from __future__ import annotations

from typing import Any

import numpy as np
from mpmath import mp, mpf

from cra_sym.solvers.stiffness import DynamicStiffness
from cra_sym.solvers.waves import UniformProblem

INF = float("inf")


def beams(
    left: Any,
    right: Any = (0.0, 0.0),
    *,
    EI: Any = 1.0,
    rhoA: Any = 1.0,
    length: Any = 1.0,
    tension: Any = 0.0,
    foundation: Any = 0.0,
    shear: Any = INF,
    rotary: Any = 0.0,
    left_mass: Any = (0.0, 0.0),
    right_mass: Any = (0.0, 0.0),
    offset: Any = None,
) -> UniformProblem:
    """Return beams with E = (v, M), O = (V, theta): ends are pairs of stiffness, and of mass and inertia.

    ``offset`` moves the mass at the right end outward: its inertia is then about its own centre.
    """
    sections = EI, rhoA, length, tension, foundation, shear, rotary
    ends = [np.atleast_2d(np.asarray(end, dtype=float)) for end in (left, right, left_mass, right_mass)]
    shape = np.broadcast_shapes(*(np.shape(value) for value in sections), *(end.shape[:1] for end in ends))
    EI, rhoA, length, tension, foundation, shear, rotary = (
        np.broadcast_to(np.asarray(value, dtype=float), shape) for value in sections
    )
    springs = np.stack([np.broadcast_to(end, (*shape, 2)) for end in ends])
    a, b = np.zeros((2, *shape, 2, 2)), np.zeros((2, *shape, 2, 2))
    a[0, :, 0, 0], a[1, :, 0, 0], a[0, :, 1, 1] = foundation, -rhoA, 1.0 / EI
    b[0, :, 0, 0], b[0, :, 0, 1], b[0, :, 1, 0], b[0, :, 1, 1] = 1.0 / shear, 1.0, -1.0, tension
    b[1, :, 1, 1] = -rotary
    couplings = None
    if offset is not None:
        springs[3, :, 1] += springs[3, :, 0] * offset**2
        couplings = np.zeros((2, 2, *shape, 2, 2))
        couplings[1, 1, :, 0, 1] = couplings[1, 1, :, 1, 0] = springs[3, :, 0] * offset
    return UniformProblem(length.copy(), a, b, springs[:2], springs[2:], couplings=couplings)


def positions(problem: UniformProblem) -> tuple[list[int], list[int]]:
    """Return where E and O stand in the state (q, P)."""
    n = len(problem.odd)
    even = [n + i if odd else i for i, odd in enumerate(problem.odd)]
    return even, [(place + n) % (2 * n) for place in even]


def system(problem: UniformProblem) -> np.ndarray:
    """Return the matrix of a section: constants and factors of z, shape (2, rows, 2 n, 2 n)."""
    e, o = (np.array(places) for places in positions(problem))
    found = np.zeros((2, len(problem.length), len(e) * 2, len(e) * 2))
    found[:, :, o[:, None], e] = problem.odd_by_even
    found[:, :, e[:, None], o] = problem.even_by_odd
    return found


def end_matrices(problem: UniformProblem) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return stiffness and mass of both ends, shape (rows, 2 n, 2 n), and the motions that they allow as columns."""
    rows, n = problem.stiffness.shape[1:]
    stiff, heavy = np.zeros((2, rows, 2 * n, 2 * n))
    held = np.isinf(problem.stiffness)
    assert (held == held[:, :1]).all()
    basis = np.eye(2 * n)
    for end in (0, 1):
        here = slice(end * n, (end + 1) * n)
        stiff[:, here, here] = np.where(held[end], 0.0, problem.stiffness[end])[:, :, None] * np.eye(n)
        heavy[:, here, here] = problem.mass[end][:, :, None] * np.eye(n)
        if problem.couplings is not None:
            stiff[:, here, here] += problem.couplings[0, end]
            heavy[:, here, here] += problem.couplings[1, end]
        if problem.ties is not None:
            assert (problem.ties[end] == problem.ties[end, :1]).all()
            basis[here, here] += problem.ties[end, 0]
    return stiff, heavy, basis[:, ~held[:, 0].ravel()]


def stiffness(problem: UniformProblem) -> DynamicStiffness:
    """Return the dynamic stiffness of a problem whose rows hold the same displacements."""
    section, (stiff, heavy, free) = system(problem), end_matrices(problem)

    def at(z, rows, share):
        return (section[0, rows] + z[:, None, None] * section[1, rows])[:, None], section[1, rows][:, None]

    def ends(z, rows):
        return stiff[rows] - z[:, None, None] * heavy[rows], -heavy[rows]

    return DynamicStiffness(at, ends, problem.length, len(problem.odd), 0, free)


def determinant(problem: UniformProblem, row: int, z: Any) -> Any:
    """Return the determinant of the end conditions on the transfer matrix of the whole length, in many digits."""
    n, constant, slope = len(problem.odd), *system(problem)[:, row]
    transfer = mp.expm((mp.matrix(constant) + z * mp.matrix(slope)) * mpf(problem.length[row]))
    stiff, heavy, free = end_matrices(problem.take(np.array([row])))
    boundary, free = mp.matrix(stiff[0]) - z * mp.matrix(heavy[0]), mp.matrix(free)
    # unknown: P at the left end and the free motions of both; q of the right end, then forces on the free motions
    left, right = free[:n, :], free[n:, :]
    size = free.cols
    found = mp.zeros(n + size)
    found[:n, :n], found[:n, n:] = transfer[:n, n:], transfer[:n, :n] * left - right
    found[n:, n:] = right.T * transfer[n:, :n] * left + free.T * boundary * free
    found[n:, :n] = right.T * transfer[n:, n:] - left.T
    return mp.det(found)


def distance(problem: UniformProblem, row: int, z: float) -> float:
    """Return the relative distance of z to the root next to it, by the secant method in extended precision."""
    constant, slope = system(problem)[:, row]
    growth = np.abs(np.linalg.eigvals(constant + z * slope).real).max() * problem.length[row]
    with mp.workdps(50 + int(2.0 * growth)):  # the determinant cancels to exp(-2 growth) of its terms
        old, new = mpf(z), mpf(z) * (1 + mpf(10) ** -13)
        at_old, at_new = determinant(problem, row, old), determinant(problem, row, new)
        if at_old == 0:
            return 0.0
        for _ in range(20):
            old, new, at_old = new, new - at_new * (new - old) / (at_new - at_old), at_new
            if abs(new - old) < abs(new) * mpf(10) ** -22:
                return float(abs(mpf(z) - new) / new)
            at_new = determinant(problem, row, new)
    return INF
