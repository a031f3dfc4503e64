"""Bound of the largest compliance beyond a Ritz basis on the stresses, which proves that no mode is missed.

Ritz's method bounds compliances from below. With the largest compliance t of all motions whose strains are orthogonal
to the basis, the k-th compliance is between the k-th one of the basis and that plus t. Such motions vanish at the ends
of every element. The integral, over an element of length h, of a function orthogonal to polynomials of degree p is in
the mean square at most h / (2 p) times the function, and pointwise bounded by the root of that.

With the compliance 1 / W as the weight of the orthogonality, what counts is the largest ``(1 - x^2) / W`` for x from
-1 to 1 on the element, so that a stiffness may nearly vanish at an end. For the integral F of a load over the element
minus a straight line vanishes at both ends, and Gegenbauer's polynomials y with ``(1 - x^2) y'' = -n (n - 1) y`` expand
it: beyond degree p the mean square of the sum over ``1 - x^2`` is less than that of ``F'`` over p (p + 1).
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from .stress import Columns

__all__ = ["complete", "tail"]

Array = NDArray[np.float64]
_SHARES = 0.0, 0.2, 0.5, 0.8
"""Share of the (logarithmic) gap between two compliances allotted to the potential energy; inertia has the rest."""


def complete(
    compliances: Array, elastic: NDArray[np.intp], left_out: Array, loading: Array, load: Array
) -> NDArray[np.bool_]:
    """Return for which sets it is proved that no mode is missing among the first elastic ones.

    It is proved where a gap between compliances, after the last mode or one of the next, is larger than the compliance
    beyond the basis can bridge. With motions v of the basis and w orthogonal to it, stiffness and mass of ``v + w``
    satisfy, for any positive a and b,
    ``K >= (1 - b load) K(v) + (1 - loading - loading / b) K(w)`` and ``M <= (1 + a) M(v) + (1 + 1 / a) M(w)``.

    Parameters
    ----------
    compliances : ndarray, shape (sets, more than modes)
        Of the basis, descending.
    elastic : ndarray of int, shape (sets,)
        Number of modes requested, without rigid-body motions.
    left_out, loading : ndarray, shape (sets,)
        As `tail` returns.
    load : ndarray, shape (sets,)
        Largest potential energy of displacements, by magnitude, over the energy of a motion of the basis.
    """
    number = np.arange(1, compliances.shape[1])
    first = compliances[:, :-1]
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        gap = first / np.where(compliances[:, 1:] > 0.0, compliances[:, 1:], 1e-300 * first)
        good = np.zeros(first.shape, dtype=bool)
        for share in _SHARES:
            taken = 1.0 - gap**-share  # b times load
            per_b = np.where(load[:, None] > 0.0, load[:, None] / taken, 0.0)
            stiff = 1.0 - np.where(loading[:, None] > 0.0, loading[:, None] * (1.0 + per_b), 0.0)
            rest = gap ** (1.0 - share)  # 1 + a
            good |= (stiff > 0.0) & (rest / (rest - 1.0) * left_out[:, None] < stiff * first)
    return np.asarray((good & (number >= elastic[:, None])).any(axis=1) | (elastic == 0))


def tail(columns: Columns) -> tuple[Array, Array]:
    """Return bounds of the motions beyond the basis by element, both (sets, elements).

    The first bounds their largest compliance without the potential energy of displacements, the second the magnitude of
    this energy over that of the strains. Elements at whose end a stiffness vanishes have no such motions: 0.
    """
    mesh, problem = columns.mesh, columns.problem
    starts = np.searchsorted(mesh.owner, np.arange(len(mesh.elements) - 1))
    edges = columns.grid.ends[:, np.searchsorted(mesh.pieces, mesh.elements)]
    # of three integrals the product is less than that, of n the last factor is that of degree p - n + 1
    reach = 0.5 * np.diff(edges, axis=1) / (mesh.degree + min(3 - max(problem.orders, default=1), 0))
    weights = columns.weights.reshape(len(columns.weights), *columns.grid.x.shape[1:])

    def most(entry: Array) -> Array:
        found: Array = np.maximum.reduceat(np.abs(entry).max(axis=-1), starts, axis=-1)
        return found

    def whole(entry: Array) -> Array:
        found: Array = np.add.reduceat((np.abs(entry) * weights).sum(axis=-1), starts, axis=-1)
        return found

    mean, peak = _amplitudes(columns, reach, most, 1.0 - columns.grid.local**2)

    def held(name: str) -> Array:
        total = np.zeros((columns.sets, len(mesh.elements) - 1))
        for (i, j), entry in columns.coefficient[name].items():
            if max(i, j) < problem.displacements:
                smooth, lumped = most(entry) * mean[i] * mean[j], whole(entry) * peak[i] * peak[j]
                total += (1 if i == j else 2) * np.minimum(smooth, lumped)
        return np.where(mesh.strained, 0.0, total)

    return held("M"), held("R")


def _amplitudes(
    columns: Columns, reach: Array, most: Callable[[Array], Array], inner: Array
) -> tuple[list[Array], list[Array]]:
    """Return bounds of each displacement for unit strain energy, in the mean square and pointwise.

    ``inner`` is ``1 - x^2`` on the element at the points.
    """
    problem = columns.problem
    tops, fields = problem.tops(), len(problem.orders)
    mean: dict[int, Array] = {}
    peak: dict[int, Array] = {}
    while len(mean) < problem.displacements:
        for place in (k for k in reversed(range(problem.displacements)) if k not in mean):
            rate = np.zeros((fields, *reach.shape))  # by the strain that causes it
            anywhere = np.zeros_like(rate)
            needed = [place + 1]
            if place in tops:
                field = tops.index(place)
                soft = columns.compliance[field, field]
                rate[field], anywhere[field] = np.sqrt(most(soft * inner)), np.sqrt(most(soft))
                needed = [j for i, j in columns.coefficient["B"] if i == field and j < problem.displacements]
            if all(j in mean for j in needed):
                for j in needed:
                    own = mean[j] if place not in tops else most(columns.coefficient["B"][field, j]) * mean[j]
                    rate, anywhere = rate + own, anywhere + own
                mean[place], peak[place] = reach * rate, np.sqrt(reach) * anywhere
                break
    order = range(problem.displacements)
    return [np.sqrt((mean[k] ** 2).sum(axis=0)) for k in order], [np.sqrt((peak[k] ** 2).sum(axis=0)) for k in order]
