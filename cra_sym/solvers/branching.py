"""The other curves through the branch points of a curve."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from cra_sym.solvers.continuation import Followed, Point, correct, follow, point_at

__all__ = ["Branch", "beside", "branches"]

Array = NDArray[np.float64]
_AWAY = (0.02, 0.005, 0.1)  # distances at which the other curve through a branch point is sought
_SAME = 1e-3  # relative distance below which two branch points are the same


@dataclass(frozen=True, eq=False)
class Branch:
    """Points of another curve in order, without the branch point.

    Attributes
    ----------
    origin : Point
        The branch point at which it was found.
    points : list of Point
    broken : bool
        Whether it ends because the iteration failed to converge.
    """

    origin: Point
    points: list[Point]
    broken: bool


def beside(curve: Followed, point: Point, other: Array | None = None) -> list[Point]:
    """Return points of the other curve through a branch point, one on each side, oriented away from it.

    Parameters
    ----------
    curve : Followed
    point : Point
        Of one curve, at its branch point or next to it.
    other : ndarray, optional
        A direction, (size + 1,); default: the direction other than the tangent in which the equations change least.
    """
    _, rates, _ = curve.linearised(point.vector)
    metric = curve.metric(point.unknowns, point.frequency)
    own = point.tangent * metric / np.linalg.norm(point.tangent * metric)
    away = np.linalg.svd(np.vstack([rates / metric, own]))[2][-1] if other is None else other * metric
    away = away - (away @ own) * own
    away /= np.linalg.norm(away)
    found = []
    for side in (1.0, -1.0):
        for length in _AWAY:
            guess, plane = point.vector + side * length * away / metric, side * away * metric

            def constraint(z: Array, at: Array = guess, normal: Array = plane) -> tuple[float, Array]:
                return float(normal @ (z - at)), normal

            answer = correct(curve, guess, constraint, 20)
            if answer is not None and np.linalg.norm((answer[0] - point.vector) * metric) < 10 * length:
                found.append(point_at(curve, *answer, plane))
                break
    return found


def branches(curve: Followed, whole: Sequence[Point], points: int, ended: Callable[[Point], bool]) -> list[Branch]:
    """Return the other curves through the branch points of a curve, without duplicates.

    Parameters
    ----------
    curve : Followed
    whole : sequence of Point
    points : int
        Largest number of points of each, half of them on each side.
    ended : callable
        Whether a point is beyond the requested range.
    """
    found = list[Branch]()
    for origin in (point for point in whole if point.crossing):
        if any(point.crossing and _same(curve, origin, point) for other in found for point in other.points):
            continue
        sides, broken, closed = list[list[Point]](), False, False
        for start in beside(curve, origin):
            side = [start]
            for point in itertools.islice(follow(curve, start), 1, max(points // 2, 1)):
                closed = point.crossing and _same(curve, origin, point)
                if closed or ended(point):
                    break
                side.append(point)
            else:
                broken |= len(side) < points // 2
            sides.append(side)
            if closed:  # the other side is the same loop
                break
        line = [*(sides[1][::-1] if len(sides) > 1 else []), *(sides[0] if sides else [])]
        found.append(Branch(origin, line, broken or not sides))
    return found


def _same(curve: Followed, one: Point, other: Point) -> bool:
    """Tell whether two branch points are the same."""
    apart = (one.vector - other.vector) * curve.metric(one.unknowns, one.frequency)
    return bool(np.linalg.norm(apart) < _SAME)
