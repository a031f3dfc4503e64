"""Beams with two waves a section as numbers, and two independent routes to their frequencies."""

from __future__ import annotations

from typing import Any

import numpy as np
from mpmath import mp, mpf
from scipy.linalg import null_space

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
        couplings = np.zeros((2, *shape, 4, 4))
        couplings[1, :, 2, 3] = couplings[1, :, 3, 2] = springs[3, :, 0] * offset
    stiffness, mass = (np.concatenate(list(part), axis=1) for part in (springs[:2], springs[2:]))
    return UniformProblem(length.copy(), a, b, stiffness, mass, couplings=couplings)


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
    """Return stiffness and mass of (q left, w, q right), shape (rows, size, size), and allowed motions as columns.

    Rows hold the same. The stiffness of links is left out, see `links`.
    """
    size = problem.structure.moving
    springs, rigid = problem.stiffness[:, :size], np.isinf(problem.stiffness[:, size:])
    held = np.isinf(springs)
    assert (held == held[:1]).all() and (rigid == rigid[:1]).all()
    unit = np.eye(size)
    matrices = [np.where(held, 0.0, springs)[:, :, None] * unit, problem.mass[:, :size, None] * unit]
    if problem.couplings is not None:
        matrices = [matrix + more for matrix, more in zip(matrices, problem.couplings, strict=True)]
    allowed = unit.copy()
    if problem.ties is not None:
        assert (problem.ties == problem.ties[:1]).all()
        allowed += problem.ties[0]
    allowed = allowed[:, ~held[0]]
    if rigid.any():
        assert problem.stretches is not None
        assert (problem.stretches == problem.stretches[:1]).all()
        allowed = allowed @ null_space(problem.stretches[0, rigid[0]] @ allowed)
    order = in_state(problem)
    stiff, heavy = (matrix[:, order][:, :, order] for matrix in matrices)
    return stiff, heavy, allowed[order]


def in_state(problem: UniformProblem) -> list[int]:
    """Return the places in the order (q left, w, q right)."""
    n, size = len(problem.odd), problem.structure.moving
    return [*range(n), *range(2 * n, size), *range(n, 2 * n)]


def links(problem: UniformProblem) -> tuple[np.ndarray, np.ndarray]:
    """Return stiffness of each link, (rows, links), rigid ones left out, and what (q left, w, q right) stretch it."""
    found = problem.stiffness[:, problem.structure.moving :]
    stretches = np.zeros((len(found), 0, problem.structure.moving)) if problem.stretches is None else problem.stretches
    return np.where(np.isinf(found), 0.0, found), stretches[..., in_state(problem)]


def stiffness(problem: UniformProblem) -> DynamicStiffness:
    """Return the dynamic stiffness of a problem whose rows hold the same displacements."""
    n, m, found, (stiff, heavy, free) = len(problem.odd), problem.coordinates, system(problem), end_matrices(problem)
    stiff = stiff + np.einsum("rl,rli,rlj->rij", links(problem)[0], *[links(problem)[1]] * 2)
    size, place = 2 * (n + m), [*range(n), *range(n + m, 2 * n + m)]  # the state is (q, w, P, r)
    section = np.zeros((*found.shape[:2], size, size))
    section[:, :, np.array(place)[:, None], place] = found

    def at(z, rows, share):
        return (section[0, rows] + z[:, None, None] * section[1, rows])[:, None], section[1, rows][:, None]

    def ends(z, rows):
        return stiff[rows] - z[:, None, None] * heavy[rows], -heavy[rows]

    return DynamicStiffness(at, ends, problem.length, len(problem.odd), problem.coordinates, free)


def determinant(problem: UniformProblem, row: int, z: Any) -> Any:
    """Return the determinant of the end conditions on the transfer matrix of the whole length, in many digits."""
    n, constant, slope = len(problem.odd), *system(problem)[:, row]
    transfer = mp.expm((mp.matrix(constant) + z * mp.matrix(slope)) * mpf(problem.length[row]))
    alone = problem.take(np.array([row]))
    stiff, heavy, free = end_matrices(alone)
    boundary, free = mp.matrix(stiff[0]) - z * mp.matrix(heavy[0]), mp.matrix(free)
    for size, stretch in zip(links(alone)[0][0], links(alone)[1][0], strict=True):
        boundary += mpf(size) * mp.matrix(stretch) * mp.matrix(stretch).T
    # unknown: P at the left end and the free motions of all places; q of the right end, then forces on the free motions
    left, right = free[:n, :], free[free.rows - n :, :]
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
