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
        couplings = np.zeros((2, 2, *shape))
        couplings[1, 1] = springs[3, :, 0] * offset
    return UniformProblem(length.copy(), a, b, springs[:2], springs[2:], couplings=couplings)


def positions(problem: UniformProblem) -> tuple[list[int], list[int]]:
    """Return where E and O stand in the state (q, P)."""
    return ([0, 3], [2, 1]) if problem.even == 1 else ([0, 1], [2, 3])


def stiffness(problem: UniformProblem) -> DynamicStiffness:
    """Return the dynamic stiffness of a problem whose rows hold the same displacements."""
    e, o = positions(problem)
    system = np.zeros((2, len(problem.length), 4, 4))
    system[:, :, np.array(o)[:, None], e] = problem.odd_by_even
    system[:, :, np.array(e)[:, None], o] = problem.even_by_odd
    springs, masses = (np.concatenate(list(ends), axis=1) for ends in (problem.stiffness, problem.mass))
    held = np.isinf(springs[0])
    assert (np.isinf(springs) == held).all()
    springs = np.where(held, 0.0, springs)

    def at(z, rows, share):
        return (system[0, rows] + z[:, None, None] * system[1, rows])[:, None], system[1, rows][:, None]

    def ends(z, rows):
        stiff, heavy = springs[rows, :, None] * np.eye(4), masses[rows, :, None] * np.eye(4)
        if problem.couplings is not None:
            for matrix, coupling in zip((stiff, heavy), problem.couplings, strict=True):
                for end, (i, j) in enumerate(((0, 1), (2, 3))):
                    matrix[:, i, j] = matrix[:, j, i] = coupling[end, rows]
        return stiff - z[:, None, None] * heavy, -heavy

    return DynamicStiffness(at, ends, problem.length, 2, 0, np.eye(4)[:, ~held])


def determinant(problem: UniformProblem, row: int, z: Any) -> Any:
    """Return the determinant of the end conditions on the transfer matrix of the whole length, in many digits."""
    e, o = positions(problem)
    system = mp.zeros(4)
    for rows, columns, part in ((o, e, problem.odd_by_even), (e, o, problem.even_by_odd)):
        for i, r in enumerate(rows):
            for j, c in enumerate(columns):
                system[r, c] = mpf(part[0, row, i, j]) + z * mpf(part[1, row, i, j])
    transfer = mp.expm(system * mpf(problem.length[row]))

    def pair(end, i):
        spring, mass = problem.stiffness[end, row, i], problem.mass[end, row, i]
        return (mpf(1), mpf(0)) if np.isinf(spring) else (mpf(spring) - z * mpf(mass), mpf(1))

    left, right = ([pair(end, i) for i in range(2)] for end in (0, 1))
    off = mpf(0)
    if problem.couplings is not None:
        assert not problem.couplings[:, 0, row].any()
        off = mpf(problem.couplings[0, 1, row]) - z * mpf(problem.couplings[1, 1, row])
    # motions that meet the conditions s q = c P at the left end, and what they leave of s q + c P at the right
    ends = [left[j][1] * transfer[:, j] + left[j][0] * transfer[:, 2 + j] for j in range(2)]
    rest = [[right[i][0] * end[i] + right[i][1] * (end[2 + i] + off * end[1 - i]) for end in ends] for i in range(2)]
    return rest[0][0] * rest[1][1] - rest[0][1] * rest[1][0]


def distance(problem: UniformProblem, row: int, z: float) -> float:
    """Return the relative distance of z to the root next to it, by the secant method in extended precision."""
    system = np.zeros((4, 4))
    e, o = positions(problem)
    system[np.ix_(o, e)] = problem.odd_by_even[0, row] + z * problem.odd_by_even[1, row]
    system[np.ix_(e, o)] = problem.even_by_odd[0, row] + z * problem.even_by_odd[1, row]
    growth = np.abs(np.linalg.eigvals(system).real).max() * problem.length[row]
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
