"""Arclength continuation of the free periodic motions of modal equations, through folds, with nothing jumped silently.

The Jacobian of a conservative system is symmetric. Along the curve the number of its negative eigenvalues changes by
one exactly where the curve turns back in frequency; where it changes otherwise, a step has jumped an internal resonance
or passed a branch point, and the step is repeated with half its length until one or the other is plain.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from cra_sym.solvers.harmonic_balance import Balance

__all__ = ["Curve", "Measure", "Point", "correct", "first_crossing", "follow"]

Array = NDArray[np.float64]
Measure = Callable[[Array], tuple[float, Array]]
"""A positive number of the unknowns, such as the energy, and its gradient."""
_LARGEST = 0.05  # step relative to the size of the motion
_LARGEST_NEAR = 0.25  # the same where the frequency is still that of the linear mode
_NEAR = 0.005
_SMALLEST = 2e-5
_TURN = 0.9  # cosine of the largest angle between the tangents at both ends of a step


@dataclass(frozen=True)
class Point:
    """A point of the curve.

    Attributes
    ----------
    unknowns : ndarray, shape (size,)
    frequency : float
        Angular frequency, rad/s.
    tangent : ndarray, shape (size + 1,)
        By unknowns and frequency, of length one in the metric of the point.
    negative : int
        Negative eigenvalues of the Jacobian.
    step : float
        Length of the step that led here.
    crossing : bool
        Whether that step, as short as steps get, crosses another curve.
    """

    unknowns: Array
    frequency: float
    tangent: Array
    negative: int
    step: float = 0.0
    crossing: bool = False

    @property
    def vector(self) -> Array:
        """Unknowns and frequency."""
        return np.append(self.unknowns, self.frequency)


@dataclass(frozen=True, eq=False)
class Curve:
    """The equations of a curve and its metric.

    Attributes
    ----------
    balance : Balance
    linear : float
        Frequency of the linear mode.
    """

    balance: Balance
    linear: float

    def metric(self, unknowns: Array, frequency: float) -> Array:
        """Return the factors that make a change of all the energy, and of all the frequency, of size one."""
        basis, omega = self.balance.basis, self.balance.equations.omega
        energetic = np.sqrt(0.5 * (omega[:, None] ** 2 + (frequency * basis.orders) ** 2)).ravel()
        size = np.linalg.norm(energetic * unknowns)
        return np.append(energetic / size, 1.0 / frequency)

    def linearised(self, vector: Array) -> tuple[Array, Array, float]:
        """Return residual, its rates (size, size + 1), and the scale of the residual."""
        residual, jacobian, rate, scale = self.balance.residual(vector[None, :-1], vector[-1:])
        return residual[0], np.concatenate([jacobian[0], rate[0][:, None]], axis=1), float(scale[0])

    def negative(self, rates: Array) -> int:
        """Return the number of negative eigenvalues of the symmetric Jacobian."""
        weights = np.tile(self.balance.basis.weights, self.balance.equations.modes)
        scale = 1.0 / np.sqrt(weights)
        matrix = rates[:, :-1] * scale[:, None] / scale[None, :]
        size = np.sqrt(np.maximum(np.abs(np.diag(matrix)), 1e-12 * np.abs(matrix).max()))
        size[size == 0.0] = 1.0  # of a linear system, at its own frequency
        matrix = matrix / size[:, None] / size[None, :]
        return int((np.linalg.eigvalsh(0.5 * (matrix + matrix.T)) < 0).sum())

    def tangent(self, rates: Array, metric: Array, along: Array) -> Array:
        """Return the tangent of length one, in the sense of ``along``."""
        matrix = np.vstack([rates / metric, along * metric])
        right = np.zeros(len(matrix))
        right[-1] = 1.0
        found = np.linalg.solve(matrix, right)
        return np.asarray(found / np.linalg.norm(found) / metric)


def correct(
    curve: Curve, start: Array, constraint: Callable[[Array], tuple[float, Array]], most: int = 10
) -> tuple[Array, Array] | None:
    """Return the point of the curve near a start that obeys one more equation, with the rates there, or None.

    Parameters
    ----------
    curve : Curve
    start : ndarray, shape (size + 1,)
    constraint : callable
        Residual of the further equation, of the size of a relative error, and its gradient.
    most : int
        Iterations.
    """
    vector = start.copy()
    for _ in range(most):
        residual, rates, scale = curve.linearised(vector)
        value, gradient = constraint(vector)
        size = np.linalg.norm(residual) / scale if scale > 0 else np.inf
        if not np.isfinite(size):
            return None
        if size < 1e-11 and abs(value) < 1e-12:
            return vector, rates
        metric = curve.metric(vector[:-1], vector[-1])
        matrix = np.vstack([rates / metric, gradient / metric])
        try:
            step = np.linalg.solve(matrix, np.append(residual, value)) / metric
        except np.linalg.LinAlgError:
            return None
        vector = vector - step
        if vector[-1] <= 0:
            return None
        if size < 1e-9 and np.linalg.norm(step * metric) < 1e-13:
            return vector, rates
    return None


def first_point(curve: Curve, unknowns: Array, measure: Measure) -> Point | None:
    """Return the point near the linear mode with the given motion's measure, looking towards growth."""
    target, _ = measure(unknowns)

    def constraint(vector: Array) -> tuple[float, Array]:
        value, gradient = measure(vector[:-1])
        return np.log(value / target), np.append(gradient / value, 0.0)

    found = correct(curve, np.append(unknowns, curve.linear), constraint, 30)
    if found is None:
        return None
    vector, rates = found
    metric = curve.metric(vector[:-1], vector[-1])
    along = np.append(measure(vector[:-1])[1], 0.0) / metric
    tangent = curve.tangent(rates, metric, along / np.linalg.norm(along))
    return Point(vector[:-1], float(vector[-1]), tangent, curve.negative(rates))


def follow(curve: Curve, start: Point) -> Iterator[Point]:
    """Yield the points of a curve, the first included, until no step converges."""
    yield start
    point, length = start, _LARGEST_NEAR
    while True:
        near = abs(point.frequency / curve.linear - 1.0) < _NEAR
        length = min(length, _LARGEST_NEAR if near else _LARGEST)
        following = None
        while following is None and length >= _SMALLEST:
            following = _step(curve, point, length)
            if following is None:
                length *= 0.5
        if following is None:
            return
        point = following
        yield point
        length *= 2.0 if point.step == length else 1.0


def _step(curve: Curve, point: Point, length: float) -> Point | None:
    """Return the next point, or None if the step is too long for what happens along it."""
    metric = curve.metric(point.unknowns, point.frequency)
    tangent = point.tangent / np.linalg.norm(point.tangent * metric)
    predicted = point.vector + length * tangent
    plane = tangent * metric**2

    def constraint(vector: Array) -> tuple[float, Array]:
        return float(plane @ (vector - predicted)), plane

    found = correct(curve, predicted, constraint)
    if found is None:
        return None
    vector, rates = found
    if np.linalg.norm((vector - predicted) * metric) > 0.5 * length:
        return None
    here = curve.metric(vector[:-1], vector[-1])
    ahead = tangent * here
    new = curve.tangent(rates, here, ahead / np.linalg.norm(ahead))
    cosine = (new * here) @ ahead / np.linalg.norm(new * here) / np.linalg.norm(ahead)
    if cosine < _TURN:
        return None
    negative = curve.negative(rates)
    turned = (new[-1] > 0) != (point.tangent[-1] > 0)
    plain = abs(negative - point.negative) == int(turned)
    if not plain and length >= 2 * _SMALLEST:
        return None
    return Point(vector[:-1], float(vector[-1]), new, negative, length, not plain)


def first_crossing(
    value: float, slope: float, end: float, end_slope: float, step: float, target: float
) -> float | None:
    """Return the share of a step at which a cubic through both ends first takes a value, or None."""
    first, last = slope * step, end_slope * step
    rise = end - value
    cubic = [first + last - 2 * rise, 3 * rise - 2 * first - last, first, value - target]
    if not np.any(cubic[:3]):
        return None
    roots = np.roots(cubic)
    real = np.sort(roots[np.abs(roots.imag) < 1e-9].real)
    inside = real[(real >= -1e-12) & (real <= 1 + 1e-12)]
    return float(inside[0]) if inside.size else None
