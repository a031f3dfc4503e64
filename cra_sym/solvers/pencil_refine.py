"""Complex eigenvalues of stated accuracy: the lowest of a pencil must agree on two successive meshes."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from itertools import islice

import numpy as np
from numpy.typing import NDArray

from .pencil import Complex, GeneralContinuum, Index, Reduced, reduced
from .stress_mesh import Mesh, TooFineError
from .stress_refine import alike, meshed

__all__ = ["Settled", "local_spectrum", "lowest_eigenvalues", "matched", "meshes", "sequence"]

Array = NDArray[np.float64]
_STEPS = 4, 6  # degrees between the first two meshes, and between later ones
_MOST_DEGREE, _MOST_UNKNOWNS = 34, 420
_UNGRADED = 2  # meshes that may show a vanishing stiffness to leave all motions smooth
_PLACES = 64  # in each span, at which motions confined to a place are looked for
_LANES = 400_000  # numbers in the largest array of a chunk
_NEAR = 1e-3
"""Relative distance below which two eigenvalues are compared by their mean and their product: coalescing eigenvalues
are each accurate to half the digits only."""
_ROUNDING = 8 * float(np.finfo(float).eps)
"""Of an eigenvalue as large as the rate."""
_REAL = 1e-7
"""Relative imaginary part below which a pair cannot be told from a double real eigenvalue."""


@dataclass(frozen=True)
class Settled:
    """Lowest eigenvalues of a batch.

    Attributes
    ----------
    values : ndarray of complex, shape (rows, modes)
        By ascending modulus, one of each conjugate pair; the best known values where they did not converge, nan where
        there are no more.
    error : ndarray, shape (rows, modes)
        Relative difference of two meshes, of which the error on the finer one is a small part, and an allowance for
        rounding and for what the quadrature leaves out of the coefficients.
    """

    values: Complex
    error: Array


def lowest_eigenvalues(
    problem: GeneralContinuum, modes: int, oscillating: bool, tolerance: float, most: int | None = None
) -> Settled:
    """Return the lowest eigenvalues of every row, with meshes refined until they converge.

    Parameters
    ----------
    problem : GeneralContinuum
    modes : int
    oscillating : bool
        Leave out real eigenvalues.
    tolerance : float
        Relative difference of an eigenvalue on two meshes; the error on the finer one is far smaller.
    most : int, optional
        Maximum number of meshes, at least two; default: up to the finest.
    """
    rows = len(problem.edges)
    found = Settled(np.full((rows, modes), np.nan, dtype=complex), np.full((rows, modes), np.inf))
    for part, chosen, mesh, unresolved in meshes(problem, modes, tolerance):
        open_, before = np.arange(len(part)), None
        for finer in islice(sequence(mesh), most):
            results = [_all(chosen.take(open_[k]), finer) for k in _chunks(chosen, finer, len(open_))]
            values, rate = _joined([values for values, _ in results]), np.concatenate([rate for _, rate in results])
            if before is not None:
                picked, error = _compared(values, before, rate, modes, oscillating)
                place = part[open_]
                error = error + unresolved[open_, None]
                found.values[place], found.error[place] = picked, error
                still = (error > tolerance).any(axis=1)
                open_, values = open_[still], values[still]
            before = values
            if not len(open_):
                break
    return found


def local_spectrum(problem: GeneralContinuum) -> Complex:
    """Return the s at which a motion could be confined to one place along x, (places, number).

    There stiffness, dampers and inertia of the highest derivatives cancel. Eigenvalues accumulate at such s.

    Parameters
    ----------
    problem : GeneralContinuum
        Of one parameter set.
    """
    ends, share = problem.edges, (np.arange(_PLACES) + 0.5) / _PLACES
    x = (ends[:, :-1, None] + np.diff(ends, axis=1)[..., None] * share).reshape(1, -1)
    found, fields = problem.coefficients(x, np.zeros(1, dtype=np.intp)), len(problem.orders)
    offset = problem.displacements + problem.lumped
    stiffness, damping, mass = (np.zeros((x.size, fields, fields)) for _ in range(3))
    for i in range(fields):
        for j in range(fields):
            pair, above = (min(i, j), max(i, j)), (offset + min(i, j), offset + max(i, j))
            for matrix, entry in (
                (stiffness, found["W"].get(pair)), (damping, found["C"].get((i, j))), (mass, found["M"].get(above))
            ):  # fmt: skip
                if entry is not None:
                    matrix[:, i, j] = np.broadcast_to(entry, x.shape)[0]
    # 1 / s of (W + s C + s^2 M) e = 0
    zero, one = np.zeros_like(mass), np.broadcast_to(np.eye(fields), mass.shape)
    inverse = np.linalg.eigvals(
        np.block([[-np.linalg.solve(stiffness, damping), -np.linalg.solve(stiffness, mass)], [one, zero]])
    )
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.asarray(1.0 / np.where(np.abs(inverse) > 1e-12 * np.abs(inverse).max(initial=0.0), inverse, 0.0))


def meshes(
    problem: GeneralContinuum, modes: int, tolerance: float
) -> Iterator[tuple[Index, GeneralContinuum, Mesh, Array]]:
    """Yield rows that can share a mesh, their problem, the initial mesh, and the unresolved part of each row."""
    waiting = [(rows, problem.take(rows), ends) for rows, ends in alike(problem)]
    while waiting:
        rows, part, ends = waiting.pop()
        try:
            chosen, mesh, unresolved = meshed(part, ends, modes)
        except TooFineError:
            if len(rows) == 1:
                raise
            half = len(rows) // 2
            waiting += [(rows[k], part.take(k), ends) for k in (np.arange(half), np.arange(half, len(rows)))]
            continue
        if (unresolved > tolerance).any():
            raise ValueError(
                f"values: the coefficients along x are resolved to {unresolved.max():.1g} of their integral only; "
                "state jumps by Piecewise or Heaviside"
            )
        yield rows, chosen, mesh, unresolved  # type: ignore[misc]


def sequence(mesh: Mesh) -> Iterator[Mesh]:
    """Yield successively finer meshes: higher degrees, then smaller elements.

    Where a stiffness vanishes at an end, elements shrink geometrically towards it: forces that vanish more slowly leave
    logarithms there.
    """
    first, later = _STEPS
    mesh = replace(mesh, degree=mesh.degree - 2)
    yield mesh
    mesh, turn = replace(mesh, degree=mesh.degree + first), 1
    while (len(mesh.elements) - 1) * (mesh.degree + 1) <= _MOST_UNKNOWNS:
        yield mesh
        turn += 1
        if any(mesh.singular) and turn > _UNGRADED:
            mesh = _graded(mesh)
        elif mesh.degree + later <= _MOST_DEGREE and len(mesh.elements) < 20:
            mesh = replace(mesh, degree=mesh.degree + later)
        else:
            mesh = mesh.split(np.ones(len(mesh.elements) - 1, dtype=bool))


def _graded(mesh: Mesh) -> Mesh:
    """Return the mesh with the elements at the ends where a stiffness vanishes halved three times towards them."""
    for _ in range(3):
        marked = np.zeros(len(mesh.elements) - 1, dtype=bool)
        marked[0] |= mesh.singular[0]
        marked[-1] |= mesh.singular[1]
        mesh = mesh.split(marked)
    return mesh


def _chunks(problem: GeneralContinuum, mesh: Mesh, number: int) -> Iterator[Index]:
    size = problem.displacements + len(problem.orders) * (len(mesh.elements) - 1) * (mesh.degree + 1)
    step = max(1, _LANES // max(1, size * max(4 * size, (len(mesh.pieces) - 1) * mesh.points)))
    for start in range(0, number, step):
        yield np.arange(start, min(start + step, number))


def _all(problem: GeneralContinuum, mesh: Mesh) -> tuple[Complex, Array]:
    """Return all eigenvalues of every row, padded with nan, and the rates."""
    parts: list[Reduced] = list(reduced(problem, mesh))
    values = [part.eigenvalues() for part in parts]
    whole = np.full((len(problem.edges), max(v.shape[1] for v in values)), np.nan, dtype=complex)
    rate = np.empty(len(whole))
    for part, value in zip(parts, values, strict=True):
        whole[part.sets, : value.shape[1]] = value
        rate[part.sets] = part.rate
    return whole, rate


def _joined(parts: list[Complex]) -> Complex:
    """Join parts of a batch, padded with nan where a part has fewer columns."""
    width = max(part.shape[1] for part in parts)
    pad = (np.pad(part, ((0, 0), (0, width - part.shape[1])), constant_values=np.nan) for part in parts)
    return np.concatenate(list(pad))


def _compared(fine: Complex, coarse: Complex, rate: Array, modes: int, oscillating: bool) -> tuple[Complex, Array]:
    """Return the first eigenvalues, one of each pair, and their distance from those of the coarser mesh."""
    size = np.abs(fine)
    with np.errstate(invalid="ignore"):
        wanted = fine.imag > _REAL * size if oscillating else fine.imag >= -_REAL * size
    order = np.argsort(~wanted, axis=1, kind="stable")[:, :modes]
    order = np.pad(order, ((0, 0), (0, modes - order.shape[1])), constant_values=0)
    there = np.take_along_axis(wanted, order, axis=1) & (np.arange(modes) < wanted.sum(axis=1)[:, None])
    width = min(int(np.where(there, order, 0).max(initial=0)) + 4, fine.shape[1])
    near = matched(fine[:, :width], coarse)
    scale = np.maximum(size[:, :width], 1e-5 * rate[:, None])
    with np.errstate(divide="ignore", invalid="ignore"):
        error = np.abs(near - fine[:, :width]) / np.where(size[:, :width] > 0.0, size[:, :width], 1.0)
        gap = np.abs(fine[:, :width, None] - fine[:, None, :width])
        gap[:, np.arange(width), np.arange(width)] = np.inf
        gap = np.where(np.isnan(gap), np.inf, gap)
        other = gap.argmin(axis=2)
        mate, near_mate = (np.take_along_axis(s[:, :width], other, axis=1) for s in (fine, near))
        pair = np.maximum(
            0.5 * np.abs(near + near_mate - fine[:, :width] - mate) / scale,
            np.abs(near * near_mate - fine[:, :width] * mate) / scale**2,
        )
        close = np.take_along_axis(gap, other[..., None], axis=2)[..., 0] <= _NEAR * scale
        error = np.where(close, np.minimum(error, pair), error)
    error = np.where(np.isnan(error), np.inf, error) + _ROUNDING * _lost(size, rate)[:, :width]
    picked = np.where(there, np.take_along_axis(fine, order, axis=1), np.nan)
    return picked, np.where(there, np.take_along_axis(error, np.minimum(order, width - 1), axis=1), np.inf)


def _lost(size: Array, rate: Array) -> Array:
    """Return the relative rounding errors of eigenvalues of some moduli, in units of that of the rate.

    Of the slow ones the better of two: the absolute error of all, and the error relative to the slowest.
    """
    with np.errstate(divide="ignore", invalid="ignore"):
        share = size / rate[:, None]
        slowest = np.nanmin(np.where(share > 0.0, share, np.inf), axis=1, keepdims=True)
        slow = np.where(share > 0.0, np.minimum(1.0 / share, share / slowest), 0.0)
    return np.asarray(1.0 + share + slow)


def matched(fine: Complex, coarse: Complex) -> Complex:
    """Return the nearest eigenvalue of the coarser mesh for each, none twice.

    Mutual nearest neighbours are matched first, so that an eigenvalue without a partner does not take that of another.
    """
    free = np.where(np.isnan(coarse), np.inf, coarse)
    near = np.empty_like(fine)
    rows, number = np.arange(len(fine)), fine.shape[1]
    place = np.empty(fine.shape, dtype=np.intp)
    best, owner = np.full(free.shape, np.inf), np.full(free.shape, -1)
    for k in range(number):
        distance = _distance(free, fine[:, k])
        place[:, k] = distance.argmin(axis=1)
        owner[distance < best] = k
        best = np.minimum(best, distance)
    mutual = np.take_along_axis(owner, place, axis=1) == np.arange(number)
    for first in (True, False):
        for k in range(number):
            some = rows[mutual[:, k] == first]
            if not len(some):
                continue
            at = place[some, k] if first else _distance(free[some], fine[some, k]).argmin(axis=1)
            near[some, k] = free[some, at]
            free[some, at] = np.inf
    return near


def _distance(free: Complex, values: Complex) -> Array:
    with np.errstate(invalid="ignore"):
        distance = np.abs(free - values[:, None])
    return np.where(np.isnan(distance), np.inf, distance)
