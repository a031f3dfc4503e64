"""Curves through branch points, of an equation whose curves are a line and a circle."""

from __future__ import annotations

import numpy as np
import pytest

from cra_sym.solvers.branching import branches
from cra_sym.solvers.continuation import follow, started


class LineAndCircle:
    """x (x^2 + (p - 2)^2 - 1) = 0 and y = 0: the line is crossed at p = 1 and p = 3.

    The unknown is x over ``unit``; the metric is that of x.
    """

    lowest = 0.0

    def __init__(self, unit=1.0):
        self.unit = unit

    def metric(self, unknowns, frequency):
        return np.array([self.unit, 1.0, 1.0])

    def linearised(self, vector):
        x, y, p = vector * self.metric(None, None)
        residual = np.array([x * (x**2 + (p - 2) ** 2 - 1), y])
        slope = (3 * x**2 + (p - 2) ** 2 - 1) * self.unit
        return residual, np.array([[slope, 0, 2 * x * (p - 2)], [0, 1, 0]]), 1.0

    def mark(self, rates, tangent, metric):
        return int(np.sign(np.linalg.det(np.vstack([rates, tangent]))))

    def plain(self, before, after, turned):
        return before == after

    def longest(self, frequency):
        return 0.05


def followed(points, ended, unit=1.0):
    curve = LineAndCircle(unit)
    whole = []
    for point in follow(curve, started(curve, np.zeros(2), 0.5)):
        whole.append(point)
        if point.frequency > 3.5:
            return whole, branches(curve, whole, points, ended)


@pytest.mark.parametrize("unit", [1.0, 1e-6, 1e6])
def test_a_loop_through_two_branch_points_is_found_once_and_closes(unit):
    whole, (loop,) = followed(1000, lambda point: False, unit)
    np.testing.assert_allclose([p.frequency for p in whole if p.crossing], [1.0, 3.0], atol=1e-4)
    x, p = np.array([[point.unknowns[0] * unit, point.frequency] for point in loop.points]).T
    np.testing.assert_allclose(x**2 + (p - 2) ** 2, 1.0, atol=1e-5)  # next to the line no better
    angle = np.unwrap(np.arctan2(x, p - 2))
    assert abs(abs(angle[-1] - angle[0]) - 2 * np.pi) < 0.1 and not loop.broken
    assert sum(point.crossing for point in loop.points) == 1  # at p = 3; the one at p = 1 is its origin


def test_a_branch_ends_on_both_sides_where_it_is_told_to():
    _, found = followed(1000, lambda point: point.frequency > 2.0)
    left, right = found
    for branch, side in ((left, -1), (right, 1)):
        assert not branch.broken and all(side * (point.frequency - 2) < 1.0 + 1e-9 for point in branch.points)
    assert max(abs(point.unknowns[0]) for point in left.points) > 0.9
    assert len(right.points) == 2  # beyond from the start
    assert len(followed(6, lambda point: False)[1][0].points) == 6
