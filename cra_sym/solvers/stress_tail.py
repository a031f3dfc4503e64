"""What a Ritz basis on the stresses leaves out: a bound of its largest compliance, so that no mode is missed.

Ritz's method bounds compliances from below. With the largest compliance t of all motions whose strains are orthogonal
to the basis, the k-th compliance is between the k-th one of the basis and that plus t. Such motions vanish at the ends
of every element: the integral over an element of length h of what is orthogonal to polynomials of degree p is at most
h / (2 p) times as large in the mean square, and at most its root at any place.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from .stress import Columns

__all__ = ["complete", "tail"]

Array = NDArray[np.float64]
SHARE = 0.1
"""Compliance of what is left out, relative to that of the last mode, that hides no mode by itself."""


def complete(compliances: Array, elastic: NDArray[np.intp], left_out: Array) -> NDArray[np.bool_]:
    """Return for each set whether no mode is missing among the first elastic ones.

    Proved where some gap between compliances, at the last mode or one of the next, is larger than what is left out.
    Where frequencies lie closer, what is left out must be smaller than a tenth of the last compliance.

    Parameters
    ----------
    compliances : ndarray, shape (sets, more than modes)
        Of the basis, descending.
    elastic : ndarray of int, shape (sets,)
        How many modes are asked for, rigid-body motions apart.
    left_out : ndarray, shape (sets,)
        As `tail` returns.
    """
    number = np.arange(1, compliances.shape[1])
    gaps = np.where(number >= elastic[:, None], -np.diff(compliances, axis=1), 0.0)
    last = np.take_along_axis(compliances, np.clip(elastic - 1, 0, None)[:, None], axis=1)[:, 0]
    allowed = np.maximum(gaps.max(axis=1, initial=0.0), SHARE * last)
    return np.asarray((left_out < allowed) | (elastic == 0))


def tail(columns: Columns) -> Array:
    """Return a bound of the largest compliance of what the basis leaves out, of each element, (sets, elements).

    Of elements at whose end a stiffness vanishes there is none, and 0 is returned. A potential energy of displacements
    is taken as if it were not there, which bounds the compliance if it is positive and small beside that of strains.
    """
    mesh, problem = columns.mesh, columns.problem
    starts = np.searchsorted(mesh.owner, np.arange(len(mesh.elements) - 1))
    edges = columns.grid.ends[:, np.searchsorted(mesh.pieces, mesh.elements)]
    reach = 0.5 * np.diff(edges, axis=1) / mesh.degree
    weights = columns.weights.reshape(len(columns.weights), *columns.grid.x.shape[1:])

    def most(entry: Array) -> Array:
        found: Array = np.maximum.reduceat(np.abs(entry).max(axis=-1), starts, axis=-1)
        return found

    def whole(entry: Array) -> Array:
        found: Array = np.add.reduceat((np.abs(entry) * weights).sum(axis=-1), starts, axis=-1)
        return found

    mean, peak = _amplitudes(columns, reach, most)
    total = np.zeros((columns.sets, len(mesh.elements) - 1))
    for (i, j), entry in columns.coefficient["M"].items():
        if max(i, j) < problem.displacements:
            smooth, lumped = most(entry) * mean[i] * mean[j], whole(entry) * peak[i] * peak[j]
            total += (1 if i == j else 2) * np.minimum(smooth, lumped)
    return np.where(mesh.strained, 0.0, total)


def _amplitudes(columns: Columns, reach: Array, most: Callable[[Array], Array]) -> tuple[list[Array], list[Array]]:
    """Return what unit strain energy displaces at most, in the mean square and at any place, by displacement."""
    problem = columns.problem
    tops, fields = problem.tops(), len(problem.orders)
    mean: dict[int, Array] = {}
    peak: dict[int, Array] = {}
    while len(mean) < problem.displacements:
        for place in (k for k in reversed(range(problem.displacements)) if k not in mean):
            rate = np.zeros((fields, *reach.shape))  # by the strain that causes it
            needed = [place + 1]
            if place in tops:
                field = tops.index(place)
                rate[field] = np.sqrt(most(columns.compliance[field, field]))
                needed = [j for i, j in columns.coefficient["B"] if i == field and j < problem.displacements]
            if all(j in mean for j in needed):
                for j in needed:
                    rate += mean[j] if place not in tops else most(columns.coefficient["B"][field, j]) * mean[j]
                mean[place], peak[place] = reach * rate, np.sqrt(reach) * rate
                break
    order = range(problem.displacements)
    return [np.sqrt((mean[k] ** 2).sum(axis=0)) for k in order], [np.sqrt((peak[k] ** 2).sum(axis=0)) for k in order]
