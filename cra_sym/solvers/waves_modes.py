"""Mode shapes of uniform problems with two waves a section, in closed form from the columns of the determinant.

The modal mass is exact without quadrature: for motions ``y(x; z)`` with ``y' = A(z) y``, the kinetic energy of a
section is the derivative of ``q_z P - P_z q`` along x, so its integral is what that has at the ends. The derivative by
z is that of a complex step, which loses nothing (Squire and Trapp, SIAM Review 40, 1998).
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from . import waves_kernel
from .shapes import clusters
from .waves_count import Floats, UniformProblem, end_conditions, second_displacement

__all__ = ["wave_states"]

kernel: Any = waves_kernel  # formulas of arrays, without types: they are compiled text too

Complexes = NDArray[np.complex128]

_PLACES = np.array([1.0, 0.83, 0.57, 0.29])
"""Places, in half lengths from mid-span, which no wave has all nodes at."""

_TINY_SHARE = 1e-45
"""What is less is the square of the complex step."""

_TINY = 1e-100
_STEP = 1e-30  # of the lowest frequency of half a wave along the length


def wave_states(problem: UniformProblem, z: Floats, share: Floats) -> Floats:
    """Return the state (q, P) of every mode at the stations, mass-normalised; the sign is arbitrary.

    Parameters
    ----------
    problem : UniformProblem
    z : ndarray, shape (rows, modes)
        Roots as `lowest_waves` gives them. Equal ones get independent, mass-orthogonal shapes.
    share : ndarray, shape (rows, stations)
        Distance from the left end in lengths, 0 to 1.

    Returns
    -------
    ndarray, shape (rows, modes, stations, 2 n)
        q in the order of the problem, then P.
    """
    rows, modes = z.shape
    row = np.repeat(np.arange(rows), modes)
    place, joined = clusters(z)
    with np.errstate(all="ignore"):
        k = problem.coefficients()[:, row]
        unit = kernel.branch((0.5 * np.pi) ** 2, *k[28:34])
        step = _STEP * np.where(np.isfinite(unit) & (unit > 0.0), unit, 1.0)
        moved = joined.ravel() + 1j * step
        columns = _columns(k, moved, np.broadcast_to(_PLACES, (row.size, len(_PLACES))))
        conditions = [_conditions(k, joined.ravel(), at, problem.even) for at in np.moveaxis(columns.real, 2, 0)]
        null = _null_vectors(np.array(conditions), place.ravel())
        ends = columns[..., 0]
        null = _normalised(null.reshape(rows, modes, 4), place, _mass(problem, row, ends, step, null.shape[0] // modes))
        along = _columns(k, moved, 2.0 * share[row] - 1.0).real
    even, odd = _parts(along, null.reshape(row.size, 4)[..., None])
    order = problem.even
    q = np.concatenate([even[:order], odd[order:]])
    force = np.concatenate([odd[:order], even[order:]])
    states = np.moveaxis(np.concatenate([q, force]), 0, -1)
    size = np.abs(states).max(axis=(1, 2), keepdims=True, initial=0.0)
    return np.where(np.abs(states) > _TINY_SHARE * size, states, 0.0).reshape(rows, modes, -1, 4)


def _columns(k: Floats, z: Complexes, place: Floats) -> Complexes:
    """Return E and O of the E-columns, O and E of the O-columns, shape (16, roots, stations).

    ``place`` is x in half lengths from mid-span, shape (roots, stations); each column is over its size at the ends.
    """
    entries = k[:, :, None]
    a, b = kernel.linear(entries, z[:, None], 0), kernel.linear(entries, z[:, None], 8)
    waves = kernel.wave_numbers(a, b)
    near, close = (mask[:, 0] for mask in kernel.regime(*(entry.real for entry in waves[:3])))
    result = np.empty((16, *place.shape), dtype=complex)
    for name, mask in (("near", near), ("close", close & ~near), ("distant", ~(near | close))):
        part = np.flatnonzero(mask)
        if not part.size:
            continue
        x = np.where(place[part] == 0.0, _TINY, place[part])  # quotients of sizes that vanish at mid-span
        square = x * x
        a_part, b_part, w = (tuple(entry[part] for entry in group) for group in (a, b, waves))
        if name == "near":
            c0, c1, s0, s1, _ = kernel.near_series(w[0] * square, w[1] * square * square, w[2] * square * square)
        else:
            pair = (kernel.half_sums if name == "close" else kernel.eigenvalues)(*w[:3])
            functions = [value for m in pair for value in _waves(m, x)]
            if name == "close":
                c0, c1, s0, s1, _ = kernel.close_series(*(m * square for m in pair), *functions)
        if name == "distant":
            big_c, big_s, small_c, small_s = functions
            columns = kernel.distant_columns(a_part, b_part, *w, big_c, x * big_s, small_c, x * small_s)[:16]
        else:
            columns = kernel.close_columns(a_part, b_part, *w, c0, square * c1, x * s0, x * square * s1)
        result[:, part] = columns
    return result


def _waves(m: Complexes, x: Floats) -> tuple[Complexes, Complexes]:
    """Return cosh(sqrt(m) x) and sinh(sqrt(m) x) / (sqrt(m) x) over exp(sqrt m) for positive m."""
    c, s = kernel.wave(m * x**2)
    decay = np.exp(kernel.positive_root(m) * (np.abs(x) - 1.0))
    return decay * c, decay * s


def _parts(columns: Any, null: Any) -> tuple[Any, Any]:
    """Return E and O of combinations of the columns, shape (2, ...) each."""
    e, o, p, q = columns.reshape(4, 2, 2, *columns.shape[1:])
    v, u = np.moveaxis(null, 1, 0)[:2], np.moveaxis(null, 1, 0)[2:]
    return (e * v).sum(axis=1) + (q * u).sum(axis=1), (o * v).sum(axis=1) + (p * u).sum(axis=1)


def _conditions(k: Floats, z: Floats, columns: Floats, even: int) -> Floats:
    """Return the matrix of the end conditions on the four columns, shape (roots, 4, 4)."""
    rows = []
    for end, sign in ((1, 1.0), (0, -1.0)):
        found = kernel.conditions(
            *end_conditions(k, z, end, even == 1), columns, second_displacement(columns, even == 1)
        )
        rows += [[x1, x2, sign * y1, sign * y2] for x1, x2, y1, y2 in found]
    return np.moveaxis(np.array(rows), -1, 0)


def _null_vectors(matrices: Floats, place: NDArray[np.int64]) -> Floats:
    """Return the null vectors of the first of some matrices, shape (places, roots, 4, 4), all of which set the scale.

    A column that meets the conditions at the ends by itself is rounding there, but not elsewhere. Of several vectors of
    an equal root it is the one in its place.
    """
    size = np.abs(matrices).max(axis=0)
    columns = size.max(axis=1)
    zero = columns <= _TINY_SHARE * columns.max(axis=1, keepdims=True)
    scale = np.where(zero, 0.0, 1.0) / np.where(zero, 1.0, columns)
    rows = (size * scale[:, None, :]).max(axis=2)
    rows = np.where(rows > 0.0, rows, 1.0)
    balanced = matrices[0] * scale[:, None, :] / rows[:, :, None]
    vectors = np.linalg.svd(balanced)[2]
    return vectors[np.arange(len(place)), 3 - place] * np.where(zero, 1.0, scale)


def _mass(problem: UniformProblem, row: NDArray[np.int64], ends: Complexes, step: Floats, rows: int) -> Any:
    """Return the function (i, first, second) that is the modal mass of two motions of mode i in every row."""
    sign = np.where(np.arange(2) < problem.even, 1.0, -1.0)[:, None]
    columns, rate = ends.real, ends.imag / step
    modes = row.size // rows

    def mass(i: int, first: Floats, second: Floats) -> Floats:
        here = slice(i, None, modes)
        total = np.zeros(rows)
        for end, side in ((1, 1.0), (0, -1.0)):
            flip = np.array([1.0, 1.0, side, side])
            # at the left end E of O-columns and O of E-columns have the other sign
            states = [_parts(columns[:, here], vector * flip) for vector in (first, second)]
            (e1, o1), (e2, o2) = ((e, side * o) for e, o in states)
            e_rate, o_rate = _parts(rate[:, here], first * flip)
            total += side * (sign * (e_rate * o2 - side * o_rate * e2)).sum(axis=0)
            q1, q2 = (np.where(sign > 0.0, e, o) for e, o in ((e1, o1), (e2, o2)))
            total += (problem.mass[end].T * q1 * q2).sum(axis=0)
            if problem.couplings is not None:
                total += problem.couplings[1, end] * (q1[0] * q2[1] + q1[1] * q2[0])
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
