"""Statics of a uniform problem: rigid motions, negative energy, coordinates without stiffness and mass."""

from __future__ import annotations

from functools import reduce
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from .waves_kernel import minors
from .waves_problem import Floats, Integers, UniformProblem, ranks

__all__ = [
    "are_semidefinite", "coupled", "equal_waves", "idle_coordinates", "negative_energy", "negative_motions",
    "rigid_motions",
]  # fmt: skip

_EQUAL = 1e-5  # relative distance of squared wave numbers that count as equal
_SMALL = 3  # matrices up to this size are tested by their principal minors


def rigid_motions(problem: UniformProblem) -> Integers:
    """Return the number of independent motions without strain and spring energy of each row.

    Exact: such a motion has P = 0, so ``q' = A_qq q`` with ``A_Pq q = 0``, and is zero where an end has stiffness. Only
    the rank of a few rows has to be determined numerically.
    """
    structure, n, m = problem.structure, problem.structure.n, problem.coordinates
    result = np.zeros(len(problem.length), dtype=np.int64)
    coupled = np.full(len(problem.length), structure.linked)
    if problem.couplings is not None:
        coupled |= problem.couplings[0].any(axis=(1, 2))
    if problem.ties is not None:
        coupled |= problem.ties.any(axis=(1, 2))
    sprung = problem.stiffness > 0.0
    open_ = np.flatnonzero(coupled | ~(sprung[:, :n].all(axis=1) | sprung[:, n : 2 * n].all(axis=1)))
    if not open_.size:
        return result
    gradient, force = _static_blocks(problem, open_)
    right, left = np.eye(n), np.eye(n)
    power = term = np.broadcast_to(np.eye(n), gradient.shape)
    inside = [force]
    for j in range(1, n):
        power = power @ gradient
        inside.append(force @ power)
        term = power / float(np.prod(range(1, j + 1)))
        right, left = right + term, left + (-1.0) ** j * term
    moved = np.zeros((open_.size, 2 * n + m, n + m))  # by the displacements of mid-span, and coordinates
    moved[:, :n, :n], moved[:, n : 2 * n, :n], moved[:, 2 * n :, n:] = left, right, np.eye(m)
    stiffness = problem.springs_and_masses(open_)[0]
    if problem.stretches is not None:
        stretched = problem.stiffness[open_, structure.moving :, None] > 0.0
        stiffness = np.concatenate([stiffness, np.where(stretched, problem.stretches[open_], 0.0)], axis=1)
    size = np.abs(stiffness).max(axis=2, keepdims=True)
    ends = stiffness / np.where(size > 0.0, size, 1.0) @ moved
    still = np.concatenate(inside, axis=1)
    still = np.concatenate([still, np.zeros((*still.shape[:2], m))], axis=2)
    result[open_] = n + m - ranks(np.concatenate([still, ends], axis=1))
    return result


def _static_blocks(problem: UniformProblem, rows: Integers) -> tuple[Floats, Floats]:
    """Return A_qq and A_Pq at z = 0 times half the length, shape (rows, n, n) each."""
    h = 0.5 * problem.length[rows, None, None]
    a, b = problem.odd_by_even[0, rows] * h, problem.even_by_odd[0, rows] * h
    odd = np.array(problem.odd)
    even_row, even_column = ~odd[:, None], ~odd[None, :]
    gradient = np.where(even_row & ~even_column, b, np.where(~even_row & even_column, a, 0.0))
    force = np.where(even_row & even_column, a, np.where(~even_row & ~even_column, b, 0.0))
    return gradient, force


@np.errstate(invalid="ignore", over="ignore", divide="ignore")
def negative_energy(problem: UniformProblem) -> NDArray[np.bool_]:
    """Return for which rows the static strain energy may be negative, as in compression; only these can buckle."""
    found = negative_motions(problem, 0)
    for start, stop in problem.structure.blocks:
        for matrix, odd in ((problem.odd_by_even[0], False), (problem.even_by_odd[0], True)):  # A_Pq at z = 0
            places = [place for place in range(start, stop) if problem.odd[place] == odd]
            if places:
                found |= ~are_semidefinite(matrix[:, places][:, :, places])
    return found


@np.errstate(invalid="ignore", over="ignore", divide="ignore")
def negative_motions(problem: UniformProblem, part: int) -> NDArray[np.bool_]:
    """Return for which rows the stiffness (part 0) or the mass (1) of the conditions may be negative in some motion."""
    found = np.zeros(len(problem.length), dtype=bool)
    if problem.couplings is None:
        return found
    held = np.isinf(problem.stiffness[:, : problem.structure.moving])
    matrix = np.where(held[:, :, None] | held[:, None, :], 0.0, problem.springs_and_masses()[part])
    pattern = problem.couplings[part].any(axis=0)
    for group in coupled(pattern | pattern.T):
        if len(group) > 1:
            found |= ~are_semidefinite(matrix[:, group][:, :, group])
    return found


def idle_coordinates(problem: UniformProblem) -> NDArray[np.bool_]:
    """Return for which rows the coordinates have a motion without any spring, mass or displacement of an end."""
    found, first, structure = np.zeros(len(problem.length), dtype=bool), 2 * problem.structure.n, problem.structure
    if problem.coordinates:
        lumped = slice(first, structure.moving)
        parts = [part[:, :, lumped] for part in problem.springs_and_masses()]
        if problem.ties is not None:
            parts.append(problem.ties[:, :first, lumped])
        if problem.stretches is not None:
            acts = (problem.stiffness + problem.mass)[:, structure.moving :, None] > 0.0
            parts.append(np.where(acts, problem.stretches[:, :, lumped], 0.0))
        found |= ranks(np.concatenate(parts, axis=1)) < problem.coordinates
    return found


def coupled(pattern: NDArray[np.bool_]) -> list[list[int]]:
    """Return the groups of indices that a symmetric pattern of entries couples, single ones included."""
    label = np.arange(len(pattern))
    for i, j in zip(*np.nonzero(pattern), strict=True):
        label[label == label[i]] = label[j]
    return [np.flatnonzero(label == value).tolist() for value in np.unique(label)]


def are_semidefinite(matrices: Floats) -> NDArray[np.bool_]:
    """Return which symmetric matrices are positive semidefinite up to rounding; small ones by principal minors."""
    n = matrices.shape[1]
    if n > _SMALL:
        scale = np.sqrt(np.abs(np.diagonal(matrices, axis1=1, axis2=2)))
        scale = np.where(scale > 0.0, scale, 1.0)
        values = np.linalg.eigvalsh(matrices / (scale[:, :, None] * scale[:, None, :]))
        return np.asarray(values[:, 0] >= -1e-14 * n)
    every = np.ones(len(matrices), dtype=bool)
    for size in range(1, n + 1):
        for places in combinations(range(n), size):
            entries = [[matrices[:, i, j] for j in places] for i in places]
            scale = reduce(np.multiply, [np.abs(entries[i][i]) for i in range(size)])
            every &= minors(entries)[0] >= (0.0 if size == 1 else -1e-14 * scale)
    return every


def equal_waves(problem: UniformProblem, z: Floats) -> NDArray[np.bool_]:
    """Return for which rows two waves that are coupled inside have next to the same wave number at any frequency.

    So have equal strings without a layer between them, or three in a symmetric layer: the formulas then divide by next
    to zero.

    Parameters
    ----------
    problem : UniformProblem
    z : ndarray, shape (rows,)
        A squared frequency of each row, rad^2/s^2.
    """
    found, start = np.zeros(len(z), dtype=bool), 0
    for size in problem.structure.sizes:
        block, start = slice(start, start + size), start + size
        if size > 2 or len(set(problem.odd[block])) < size:  # a displacement and its slope have other waves
            found |= np.logical_and(*(_discriminants_vanish(problem, block, share * z) for share in (1.0, 0.37)))
    return found


def _discriminants_vanish(problem: UniformProblem, block: slice, z: Floats) -> NDArray[np.bool_]:
    """Return where two of the squared wave numbers of a block are next to equal, relative to the largest."""
    one, other = (
        part[0][:, block, block] + z[:, None, None] * part[1][:, block, block]
        for part in (problem.odd_by_even, problem.even_by_odd)
    )
    matrix = one @ other
    trace = np.trace(matrix, axis1=1, axis2=2)
    square = 0.5 * (trace**2 - np.einsum("rij,rji->r", matrix, matrix))  # sum of products of two
    if matrix.shape[1] == 2:
        return np.asarray(np.abs(trace**2 - 4 * square) <= _EQUAL**2 * np.maximum(trace**2, 4 * np.abs(square)))
    product = np.linalg.det(matrix)
    apart = (trace * square) ** 2 - 4 * square**3 - 4 * trace**3 * product
    apart += 18 * trace * square * product - 27 * product**2
    size = np.maximum(np.maximum(np.abs(trace), np.sqrt(np.abs(square))), np.cbrt(np.abs(product)))
    return np.asarray(np.abs(apart) <= _EQUAL**2 * size**6)
