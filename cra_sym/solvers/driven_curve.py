"""Curves of driven motions over one parameter, and their turning points.

The determinant of the equations together with the tangent changes its sign where another curve crosses, and at no fold.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from cra_sym.solvers.continuation import Followed, Point, between, correct, point_at
from cra_sym.solvers.harmonic_balance import Balance

__all__ = ["Driven", "turning"]

Array = NDArray[np.float64]
_LARGEST_DRIVEN = 0.1  # step relative to the size of the motion
_TURNS = 12  # of the search for a turning point


@dataclass(frozen=True, eq=False)
class Driven:
    """The equations of driven motions over one parameter, such as the frequency.

    Attributes
    ----------
    balance : Balance
    at : callable
        Angular frequency of the period, its rate by the parameter, and the known functions at a value of it.
    size : float
        Least energy norm by which a step is measured, since rest may be a solution.
    scale : float
        Change of the parameter that has the same norm as a change as large as the motion.
    moves : bool
        Whether the known functions depend on the parameter.
    lowest : float
        Lower limit of the parameter.
    """

    balance: Balance
    at: Callable[[float], tuple[float, float, Array]]
    size: float
    scale: float
    moves: bool = True
    lowest: float = 0.0

    def metric(self, unknowns: Array, frequency: float) -> Array:
        """Return the scale factors: a change as large as the energy, or of one scale of the parameter, has norm one."""
        basis, omega = self.balance.basis, self.balance.equations.omega
        energetic = np.sqrt(0.5 * (omega[:, None] ** 2 + (self.at(frequency)[0] * basis.orders) ** 2)).ravel()
        return np.append(energetic / np.hypot(np.linalg.norm(energetic * unknowns), self.size), 1.0 / self.scale)

    def linearised(self, vector: Array) -> tuple[Array, Array, float]:
        """Return residual, its rates (size, size + 1), and the scale of the residual."""
        unknowns, value = vector[None, :-1], float(vector[-1])
        frequency, rate, causes = self.at(value)
        own = np.array([frequency])
        balanced = self.balance.at(unknowns, own, causes)
        slope = rate * balanced.by_frequency[0]
        if self.moves:  # central difference: it only leads Newton's method
            h = 1e-3 * self.scale
            ends = [self.balance.at(unknowns, own, self.at(value + side * h)[2]).residual[0] for side in (-1, 1)]
            slope = slope + (ends[1] - ends[0]) / (2 * h)
        floor = self.size * float(self.balance.equations.omega.max())
        rates = np.concatenate([balanced.jacobian()[0], slope[:, None]], axis=1)
        return balanced.residual[0], rates, float(balanced.scale[0]) + floor

    def mark(self, rates: Array, tangent: Array, metric: Array) -> int:
        """Return the sign of the determinant of the equations and the tangent."""
        return int(np.linalg.slogdet(np.vstack([rates / metric, tangent * metric]))[0])

    def plain(self, before: int, after: int, turned: bool) -> bool:
        """Tell whether the sign is the same."""
        return before == after

    def longest(self, frequency: float) -> float:
        """Return the longest step."""
        return _LARGEST_DRIVEN


def turning(curve: Followed, before: Point, after: Point) -> Point | None:
    """Return the point between two at which the curve turns back in frequency, by the secant method."""
    metric = curve.metric(before.unknowns, before.frequency)
    chord = after.vector - before.vector
    plane = chord * metric**2 / np.linalg.norm(chord * metric)
    low, high, found = (0.0, before.tangent[-1]), (1.0, after.tangent[-1]), None
    for turn in range(_TURNS):
        share = (low[0] * high[1] - high[0] * low[1]) / (high[1] - low[1]) if turn % 3 < 2 else (low[0] + high[0]) / 2
        guess = between(before, after, share)
        answer = correct(curve, guess, lambda z, at=guess: (float(plane @ (z - at)), plane))  # type: ignore[misc]
        if answer is None:
            return found
        found = point_at(curve, *answer, plane)
        side = (share, found.tangent[-1])
        low, high = (side, high) if (side[1] > 0) == (low[1] > 0) else (low, side)
        if abs(side[1]) * curve.metric(found.unknowns, found.frequency)[-1] < 1e-9:
            break
    return found
