"""Mode shapes of uniform problems with up to three waves a section, in closed form from the columns of the determinant.

The modal mass is exact without quadrature: for motions ``y(x; z)`` with ``y' = A(z) y``, the kinetic energy of a
section is the derivative of ``q_z P - P_z q`` along x, so its integral is the difference of the values at the ends. The
derivative by z is by a complex step, without cancellation (Squire and Trapp, SIAM Review 40, 1998).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cra_sym.cached import cached_property

from . import waves_kernel, waves_three
from .shapes import clusters
from .straight import Exact
from .waves_count import (
    KINDS,
    assembled,
    block_waves,
    condition,
    displacements,
    end_rows,
    lowest_branch,
    regime,
    sections,
    signs,
)
from .waves_problem import Floats, UniformProblem
from .waves_structure import Structure

__all__ = ["WaveShapes", "block_at", "block_integrals"]

kernel: Any = waves_kernel  # formulas of arrays and terms, without types
three: Any = waves_three

Complexes = NDArray[np.complex128]

_PLACES = np.array([1.0, 0.83, 0.57, 0.29])
"""Stations, in half lengths from mid-span, that are not all nodes of any wave."""

_TINY_SHARE = 1e-45
"""Smaller values are the square of the complex step."""

SMALL_SHARE = 1e-6
"""Smaller columns may be rounding."""

ROUNDING = 2.0**-48  # relative, of some operations
ROOT_ERROR = 2.0**-42  # relative, of a root of three waves
_TINY = 1e-100
_STEP = 1e-30  # of the lowest frequency of half a wave along the length


@dataclass(frozen=True, eq=False)
class WaveShapes:
    """Mode shapes, mass-normalised; the sign is arbitrary.

    Parameters
    ----------
    problem : UniformProblem
    z : ndarray, shape (rows, modes)
        Roots as `lowest_waves` gives them. Equal ones get independent, mass-orthogonal shapes.
    """

    problem: UniformProblem
    z: Floats

    @np.errstate(all="ignore")
    def states(self, share: Floats) -> Floats:
        """Return the state (q, w, P) of every mode at stations, shape (rows, modes, stations, 2 n + m).

        Parameters
        ----------
        share : ndarray, shape (rows, stations)
            Distance from the left end in lengths, 0 to 1.

        Returns
        -------
        ndarray
            q in the order of the problem, lumped coordinates, then P.
        """
        structure = self.problem.structure
        if not self.z.size:
            return np.empty((*self.z.shape, share.shape[1], structure.moving))
        null = self._factors
        along = _columns(structure, self._coefficients(), self._roots, 2.0 * share[self._row] - 1.0)
        even, odd = _parts(along, null[..., None])
        q, force = displacements(structure, list(even), list(odd))
        lumped = null.T[2 * structure.n : structure.moving, :, None]
        lumped = np.broadcast_to(lumped, (structure.coordinates, *q[0].shape))
        states = np.moveaxis(np.concatenate([q, lumped, force]), 0, -1)
        size = np.abs(states).max(axis=(1, 2), keepdims=True, initial=0.0)
        return np.where(np.abs(states) > _TINY_SHARE * size, states, 0.0).reshape(*self.z.shape, *states.shape[1:])

    @property
    def _row(self) -> NDArray[np.int64]:
        return np.repeat(np.arange(len(self.z)), self.z.shape[1])

    @property
    def _roots(self) -> Floats:
        return clusters(self.z)[1].ravel()

    def _coefficients(self) -> Floats:
        return self.problem.take(self._row).all_coefficients()

    @cached_property
    def _factors(self) -> Floats:
        """The factors of the columns in every shape, shape (rows modes, places)."""
        structure, (place, _) = self.problem.structure, clusters(self.z)
        k, z = self._coefficients(), self._roots
        unit = lowest_branch(structure, k, 1.0)
        step = _STEP * np.where(np.isfinite(unit) & (unit > 0.0), unit, 1.0)
        conditions = _conditions(
            structure, k, z, _columns(structure, k, z, np.broadcast_to(_PLACES, (z.size, len(_PLACES))))
        )
        null = _null_vectors(conditions, _vanishing(structure, k, z, conditions), place.ravel())
        ends = _columns(structure, k, z + 1j * step, np.ones((z.size, 1)))[..., 0]
        mass = _mass(self.problem, self._row, ends, step, len(self.z))
        null = _normalised(null.reshape(*self.z.shape, structure.places), place, mass)
        return null.reshape(z.size, structure.places)


def _columns(structure: Structure, k: Floats, z: Any, place: Floats) -> Any:
    """Return E and O on all columns, real or complex as z, shape (2, n, 2 n, roots, stations).

    ``place`` is x in half lengths from mid-span, shape (roots, stations); each column is over its size at the ends.
    """
    n = structure.n
    result = np.zeros((2, n, 2 * n, *place.shape), dtype=z.dtype)
    blocks = []
    for block, (a, b) in zip(structure.blocks, sections(structure, k[:, :, None], z[:, None]), strict=True):
        waves = block_waves(structure, block, a, b)
        size = block[1] - block[0]
        found = np.empty((4 * size * size, *place.shape), dtype=z.dtype)
        place_of_kind = regime(_real(waves)) if size > 1 else 0.0
        for at, kind in enumerate(KINDS[size]):
            part = np.flatnonzero(np.broadcast_to(place_of_kind == at, (len(z), 1)))
            if part.size:
                x = np.where(place[part] == 0.0, _TINY, place[part])  # quotients of sizes that vanish at mid-span
                a_part, b_part, own = _members((a, b, waves), part)
                columns = block_at(signs(structure, block), a_part, b_part, own, x, kind)
                found[:, part] = np.array([np.broadcast_to(entry, x.shape) for entry in columns])
        blocks.append(found)
    for half, rows in enumerate(assembled(structure, blocks)):
        for i in range(n):
            for c in range(2 * n):
                if isinstance(rows[i][c], np.ndarray):
                    result[half, i, c] = rows[i][c]
    return result


def _real(waves: Any) -> Any:
    return tuple(_real(entry) if isinstance(entry, tuple) else np.real(entry) for entry in waves)


def _members(values: Any, part: Any) -> Any:
    if isinstance(values, tuple):
        return tuple(_members(value, part) for value in values)
    return values[part] if isinstance(values, np.ndarray) and values.ndim else values


def block_at(reflected: list[int], a: Any, b: Any, waves: Any, x: Any, kind: str) -> Any:
    """Return the columns of a block at places x, in one regime."""
    if len(a) == 1:
        c, s = _waves(waves[0], x)
        return kernel.columns_of_one(a[0], b[0], c, x * s)
    if len(a) == 4:
        return _pair(a, b, waves, x, kind)
    _, mu, pair, matrices, vectors, masks, _ = waves
    if kind == "series":
        found = three.near_columns(a, b, reflected, x * x)
        return (*found[:9], *(x * entry for entry in found[9:18]), *found[18:27], *(x * entry for entry in found[27:]))
    c, s = _waves(mu, x)
    single = kernel.columns_of_one(*vectors[:2], c, x * s)
    return three.joined_columns(single, _pair(matrices[:4], matrices[4:], pair, x, kind), vectors, masks)


def block_integrals(reflected: list[int], a: Any, b: Any, waves: Any, kind: str) -> Any:
    """Return half the integrals over the length of E of the E-columns (first) and of O of the O-columns (third part).

    They are the columns with ``sinh(sqrt mu) / sqrt mu`` in place of ``cosh(sqrt mu)``.
    """
    if len(a) == 1:
        _, s = kernel.wave(waves[0])
        return kernel.columns_of_one(a[0], b[0], s, s)
    if len(a) == 4:
        return _pair_integrals(a, b, waves, kind)
    _, mu, pair, matrices, vectors, masks, _ = waves
    if kind == "series":
        _, s, reflected_s = three.near_functions(a, b, reflected, 1.0)
        return (*s, *s, *reflected_s, *s)
    _, s = kernel.wave(mu)
    single = kernel.columns_of_one(*vectors[:2], s, s)
    return three.joined_columns(single, _pair_integrals(matrices[:4], matrices[4:], pair, kind), vectors, masks)


def _pair_integrals(a: Any, b: Any, waves: Any, kind: str) -> Any:
    if kind == "near":
        series = kernel.near_series(*waves[:3])
    else:
        pair = (kernel.half_sums if kind == "close" else kernel.eigenvalues)(*waves[:3])
        big_c, big_s, small_c, small_s = (value for m in pair for value in kernel.wave(m))
        if kind != "close":
            return kernel.distant_columns(a, b, *waves, big_s, big_s, small_s, small_s)[:16]
        series = kernel.close_series(*pair, big_c, big_s, small_c, small_s)
    _, _, s0, s1, _ = series
    return kernel.close_columns(a, b, *waves, s0, s1, s0, s1)


def _pair(a: Any, b: Any, waves: Any, x: Any, kind: str) -> Any:
    """Return the columns of a block of two at places x, in one regime."""
    square = x * x
    if kind == "near":
        series = kernel.near_series(waves[0] * square, waves[1] * square * square, waves[2] * square * square)
    else:
        pair = (kernel.half_sums if kind == "close" else kernel.eigenvalues)(*waves[:3])
        functions = [value for m in pair for value in _waves(m, x)]
        if kind != "close":
            big_c, big_s, small_c, small_s = functions
            return kernel.distant_columns(a, b, *waves, big_c, x * big_s, small_c, x * small_s)[:16]
        series = kernel.close_series(*(m * square for m in pair), *functions)
    c0, c1, s0, s1, _ = series
    return kernel.close_columns(a, b, *waves, c0, square * c1, x * s0, x * square * s1)


def _waves(m: Any, x: Any) -> tuple[Any, Any]:
    """Return cosh(sqrt(m) x) and sinh(sqrt(m) x) / (sqrt(m) x) over exp(sqrt m) for positive m."""
    c, s = kernel.wave(m * (x * x))
    decay = np.exp(kernel.positive_root(m) * (np.abs(x) - 1.0))
    return decay * c, decay * s


def _parts(columns: Any, null: Any) -> tuple[Any, Any]:
    """Return E and O of combinations of the columns, shape (n, ...) each."""
    even, odd = (columns * np.moveaxis(null, 1, 0)[: columns.shape[2]]).sum(axis=2)
    return even, odd


def _conditions(structure: Structure, k: Floats, z: Floats, columns: Floats) -> Floats:
    """Return the matrix of all conditions on the columns, shape (roots, places, places, stations)."""
    ends, entries = end_rows(structure, *(list(part) for part in columns)), k[:, :, None]
    result = np.zeros((structure.places, structure.places, *columns.shape[3:]))
    for place, row in enumerate(result):
        found = condition(structure, entries, z[:, None], place, *ends)
        for c, value in enumerate(found):
            row[c] = float(value.value) if isinstance(value, Exact) else value
    return np.moveaxis(result, 2, 0)


def _vanishing(structure: Structure, k: Floats, z: Floats, conditions: Floats) -> NDArray[np.bool_]:
    """Return which columns, shape (roots, places), satisfy the conditions wherever the ends are, but for rounding.

    A uniform motion at its cut-off, for example, has no force anywhere. Rounding is what is left of a small column when
    root and coefficients change within their errors.
    """
    columns = np.abs(conditions).max(axis=(1, 3))
    largest = columns.max(axis=1, keepdims=True)
    found: NDArray[np.bool_] = columns <= _TINY_SHARE * largest
    part = np.flatnonzero((columns <= SMALL_SHARE * largest).any(axis=1))
    if part.size:
        places = np.broadcast_to(_PLACES, (part.size, len(_PLACES)))
        sign = np.random.default_rng(1).choice([-1.0, 1.0], (len(k), part.size))
        for side in (-1.0, 1.0):
            entries, root = k[:, part] * (1.0 + side * sign * ROUNDING), z[part] * (1.0 + side * ROOT_ERROR)
            columns_there = _columns(structure, entries, root, places)
            other = _conditions(structure, entries, root, columns_there)
            found[part] |= columns[part] <= np.abs(other - conditions[part]).max(axis=(1, 3))
    return found


def _null_vectors(matrices: Floats, zero: NDArray[np.bool_], place: NDArray[np.int64]) -> Floats:
    """Return the null vectors of matrices (roots, 2 n, 2 n, places) at the first place; all places set the scale.

    The scale is that of all stations, since a column that satisfies the end conditions by itself is rounding at the
    ends; those that do so everywhere are ``zero``. For equal roots it is the null vector with the root's number among
    them.
    """
    size = np.abs(matrices).max(axis=3)
    columns = size.max(axis=1)
    scale = np.where(zero, 0.0, 1.0) / np.where(zero, 1.0, columns)
    rows = (size * scale[:, None, :]).max(axis=2)
    rows = np.where(rows > 0.0, rows, 1.0)
    balanced = matrices[..., 0] * scale[:, None, :] / rows[:, :, None]
    vectors = np.linalg.svd(balanced)[2]
    return vectors[np.arange(len(place)), -1 - place] * np.where(zero, 1.0, scale)


def _mass(problem: UniformProblem, row: NDArray[np.int64], ends: Complexes, step: Floats, rows: int) -> Any:
    """Return the function (i, first, second) that is the modal mass of two motions of mode i in every row."""
    structure, n = problem.structure, problem.structure.n
    sign = np.where(problem.odd, -1.0, 1.0)[:, None]
    columns, rate = ends.real, ends.imag / step
    modes = row.size // rows
    masses = problem.springs_and_masses()[1]

    def mass(i: int, first: Floats, second: Floats) -> Floats:
        here = slice(i, None, modes)
        total, moved = np.zeros(rows), []
        for side in (-1.0, 1.0):
            flip = np.repeat([1.0, side, 1.0], [n, n, structure.places - 2 * n])
            # at the left end E of O-columns and O of E-columns have the other sign
            states = [_parts(columns[..., here], vector * flip) for vector in (first, second)]
            (e1, o1), (e2, o2) = ((e, side * o) for e, o in states)
            e_rate, o_rate = _parts(rate[..., here], first * flip)
            total += side * (sign * (e_rate * o2 - side * o_rate * e2)).sum(axis=0)
            moved.append([displacements(structure, list(e), list(o))[0] for e, o in ((e1, o1), (e2, o2))])
        one, other = (
            np.concatenate([*(end[at] for end in moved), vector.T[2 * n : structure.moving]])
            for at, vector in enumerate((first, second))
        )
        total += np.einsum("ir,rij,jr->r", one, masses, other)
        if problem.stretches is not None:  # not expanded into the matrix, which would cancel digits
            links = (np.einsum("rli,ir->rl", problem.stretches, motion) for motion in (one, other))
            total += np.prod([problem.mass[:, structure.moving :], *links], axis=0).sum(axis=1)
        return total

    return mass


def _normalised(null: Floats, place: NDArray[np.int64], mass: Any) -> Floats:
    """Return the vectors with modal mass one, equal roots' orthogonal to each other."""
    for i in range(null.shape[1]):
        for back in range(1, int(place[:, i].max(initial=0)) + 1):
            tied = place[:, i] >= back
            overlap = mass(i, null[:, i - back], null[:, i])
            null[:, i] -= np.where(tied, overlap, 0.0)[:, None] * null[:, i - back]
        null[:, i] /= np.sqrt(mass(i, null[:, i], null[:, i]))[:, None]
    return null
