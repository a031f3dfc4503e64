"""Arclength continuation of periodic motions of modal equations, through folds, with a check against branch jumps.

Free motions: the Jacobian of a conservative system is symmetric. Along the curve the number of its negative eigenvalues
changes by one exactly where the curve turns back in frequency; any other change means that a step has jumped
an internal resonance or passed a branch point, and the step is halved until it is clear which. Driven motions:
:mod:`cra_sym.solvers.driven_curve`.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from cra_sym.solvers.harmonic_balance import Balance

__all__ = [
    "Curve",
    "Followed",
    "Measure",
    "Point",
    "at_value",
    "between",
    "correct",
    "first_point",
    "follow",
    "passings",
    "point_at",
    "shares",
    "started",
]

Array = NDArray[np.float64]
Measure = Callable[[Array], tuple[float, Array]]
"""A positive function of unknowns and frequency, such as the energy, and its gradient."""
_LARGEST = 0.05  # step relative to the size of the motion
_LARGEST_NEAR = 0.25  # the same where the frequency is still that of the linear mode
_NEAR = 0.005
_SMALLEST = 2e-5
_LEAPS = 4 * _SMALLEST, 8 * _SMALLEST, 16 * _SMALLEST
_TURN = 0.9  # cosine of the largest angle between the tangents at both ends of a step


@dataclass(frozen=True)
class Point:
    """A point of the curve.

    Attributes
    ----------
    unknowns : ndarray, shape (size,)
    frequency : float
        Angular frequency, rad/s, or another parameter of the curve.
    tangent : ndarray, shape (size + 1,)
        By unknowns and frequency, of length one in the metric of the point.
    mark : int
        Negative eigenvalues of the Jacobian, or the sign of the determinant.
    step : float
        Length of the step that led here.
    crossing : bool
        Whether that step, of the least length allowed, crosses another curve.
    """

    unknowns: Array
    frequency: float
    tangent: Array
    mark: int
    step: float = 0.0
    crossing: bool = False

    @property
    def vector(self) -> Array:
        """Unknowns and frequency."""
        return np.append(self.unknowns, self.frequency)


class Followed(Protocol):
    """The equations of a curve, its metric, and the test for steps that are too long."""

    @property
    def lowest(self) -> float:
        """Lower limit of the frequency, or of another parameter of the curve."""

    def metric(self, unknowns: Array, frequency: float) -> Array:
        """Return the scale factors of unknowns and frequency: a change as large as the motion has norm one."""

    def linearised(self, vector: Array) -> tuple[Array, Array, float]:
        """Return residual, its rates (size, size + 1), and the scale of the residual."""

    def mark(self, rates: Array, tangent: Array, metric: Array) -> int:
        """Return an integer that changes where another curve crosses."""

    def plain(self, before: int, after: int, turned: bool) -> bool:
        """Tell whether the marks before and after a step are consistent with a step along one curve."""

    def longest(self, frequency: float) -> float:
        """Return the longest step."""


@dataclass(frozen=True, eq=False)
class Curve:
    """The equations of free motions and their metric.

    Attributes
    ----------
    balance : Balance
    linear : float
        Frequency of the linear mode.
    """

    balance: Balance
    linear: float
    lowest: float = 0.0

    def metric(self, unknowns: Array, frequency: float) -> Array:
        """Return the scale factors: a change as large as the energy, or as the frequency, has norm one."""
        basis, omega = self.balance.basis, self.balance.equations.omega
        energetic = np.sqrt(0.5 * (omega[:, None] ** 2 + (frequency * basis.orders) ** 2)).ravel()
        size = np.linalg.norm(energetic * unknowns)
        return np.append(energetic / size, 1.0 / frequency)

    def linearised(self, vector: Array) -> tuple[Array, Array, float]:
        """Return residual, its rates (size, size + 1), and the scale of the residual."""
        at = self.balance.at(vector[None, :-1], vector[-1:])
        jacobian = at.jacobian()[0]
        if self.balance.basis.sines:
            # the residual is orthogonal to the rate of the motion, along which the Jacobian is singular: a change of
            # the phase is excluded by a term in this direction alone
            rate = (at.x[0] @ self.balance.basis.turned.T).ravel()
            rate /= np.linalg.norm(rate)
            jacobian = jacobian - vector[-1] ** 2 * np.outer(rate, rate)
        rates = np.concatenate([jacobian, at.by_frequency[0][:, None]], axis=1)
        return at.residual[0], rates, float(at.scale[0])

    def mark(self, rates: Array, tangent: Array, metric: Array) -> int:
        """Return the number of negative eigenvalues of the symmetric Jacobian."""
        weights = np.tile(self.balance.basis.weights, self.balance.equations.modes)
        scale = 1.0 / np.sqrt(weights)
        matrix = rates[:, :-1] * scale[:, None] / scale[None, :]
        size = np.sqrt(np.maximum(np.abs(np.diag(matrix)), 1e-12 * np.abs(matrix).max()))
        size[size == 0.0] = 1.0  # of a linear system, at its own frequency
        matrix = matrix / size[:, None] / size[None, :]
        return int((np.linalg.eigvalsh(0.5 * (matrix + matrix.T)) < 0).sum())

    def plain(self, before: int, after: int, turned: bool) -> bool:
        """Tell whether the change of the number is consistent with a step along one curve."""
        return abs(after - before) == int(turned)

    def longest(self, frequency: float) -> float:
        """Return the longest step."""
        return _LARGEST_NEAR if abs(frequency / self.linear - 1.0) < _NEAR else _LARGEST


def _tangent(rates: Array, metric: Array, along: Array) -> Array:
    """Return the tangent of length one, in the sense of ``along``, a direction in the metric."""
    matrix = np.vstack([rates / metric, along])
    right = np.zeros(len(matrix))
    right[-1] = 1.0
    found = np.linalg.solve(matrix, right)
    return np.asarray(found / np.linalg.norm(found) / metric)


@np.errstate(over="ignore", invalid="ignore")  # a diverging iterate is detected by its residual
def correct(
    curve: Followed, start: Array, constraint: Callable[[Array], tuple[float, Array]], most: int = 10
) -> tuple[Array, Array] | None:
    """Return the point near a start that satisfies the curve's and one more equation, and the Jacobian; else None.

    Parameters
    ----------
    curve : Followed
    start : ndarray, shape (size + 1,)
    constraint : callable
        Residual of the further equation, as a relative error, and its gradient.
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
        if vector[-1] <= curve.lowest:
            return None
        if size < 1e-9 and np.linalg.norm(step * metric) < 1e-13:
            return vector, rates
    return None


def first_point(curve: Curve, unknowns: Array, measure: Measure) -> Point | None:
    """Return the point near the linear mode with the measure of the given motion, oriented towards growth."""
    start = np.append(unknowns, curve.linear)
    target, _ = measure(start)

    def constraint(vector: Array) -> tuple[float, Array]:
        value, gradient = measure(vector)
        return np.log(value / target), gradient / value

    found = correct(curve, start, constraint, 30)
    if found is None:
        return None
    vector, rates = found
    return point_at(curve, vector, rates, measure(vector)[1])


def started(curve: Followed, unknowns: Array, frequency: float, sense: float = 1.0) -> Point | None:
    """Return the point of a curve at a frequency, oriented towards higher ones, or lower ones if ``sense`` is -1."""
    plane = np.zeros(len(unknowns) + 1)
    plane[-1] = 1.0 / curve.metric(unknowns, frequency)[-1]
    found = correct(curve, np.append(unknowns, frequency), lambda z: (float(z[-1] - frequency) * plane[-1], plane), 20)
    return None if found is None else point_at(curve, *found, sense * plane)


def point_at(curve: Followed, vector: Array, rates: Array, gradient: Array) -> Point:
    """Return the point of a curve, oriented towards growth of a function with this gradient."""
    metric = curve.metric(vector[:-1], vector[-1])
    along = gradient / metric
    tangent = _tangent(rates, metric, along / np.linalg.norm(along))
    return Point(vector[:-1], float(vector[-1]), tangent, curve.mark(rates, tangent, metric))


def follow(curve: Followed, start: Point, *, leaps: bool = False) -> Iterator[Point]:
    """Yield the points of a curve, the first included, until no step converges.

    With ``leaps``, another curve that comes so close that the steps between them are too short is leapt over.
    """
    yield start
    point, length = start, curve.longest(start.frequency)
    while True:
        length = min(length, curve.longest(point.frequency))
        following = None
        while following is None and length >= _SMALLEST:
            following = _step(curve, point, length)
            if following is None:
                length *= 0.5
        for leap in _LEAPS if leaps and following is None else ():
            following = following or _step(curve, point, leap, leaps=True)
        if following is None:
            return
        point, length = following, max(length, following.step)
        yield point
        length *= 2.0 if point.step == length else 1.0


def _step(curve: Followed, point: Point, length: float, *, leaps: bool = False) -> Point | None:
    """Return the next point, or None if the step is too long."""
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
    new = _tangent(rates, here, ahead / np.linalg.norm(ahead))
    cosine = (new * here) @ ahead / np.linalg.norm(new * here) / np.linalg.norm(ahead)
    if cosine < _TURN:
        return None
    mark = curve.mark(rates, new, here)
    plain = curve.plain(point.mark, mark, (new[-1] > 0) != (point.tangent[-1] > 0))
    if not plain and length >= 2 * _SMALLEST and not leaps:
        return None
    return Point(vector[:-1], float(vector[-1]), new, mark, length, not plain)


def at_value(curve: Followed, before: Point, after: Point, share: float, frequency: float) -> Array | None:
    """Return the unknowns at a frequency that the curve passes at the given share of a step."""
    guess = between(before, after, share)
    found = started(curve, guess[:-1], frequency)
    return None if found is None else found.unknowns


def passings(before: Point, after: Point, frequency: float) -> Array:
    """Return the shares of a step at which the curve passes a frequency, ascending, by a cubic through both ends."""
    return shares(before.frequency, before.tangent[-1], after.frequency, after.tangent[-1], after.step, frequency)


def between(before: Point, after: Point, share: float) -> Array:
    """Return unknowns and frequency at a share of a step, by a cubic through both ends."""
    s, h = share, after.step
    return np.asarray(
        (1 + 2 * s) * (1 - s) ** 2 * before.vector
        + s * (1 - s) ** 2 * h * before.tangent
        + s**2 * (3 - 2 * s) * after.vector
        + s**2 * (s - 1) * h * after.tangent
    )


def shares(start: float, slope: float, end: float, end_slope: float, step: float, target: float) -> Array:
    """Return the shares of a step at which a cubic through both ends takes a value, ascending."""
    first, last, rise = slope * step, end_slope * step, end - start
    cubic = [first + last - 2 * rise, 3 * rise - 2 * first - last, first, start - target]
    if not np.any(cubic[:3]):
        return np.zeros(0)
    roots = np.roots(cubic)
    real = np.sort(roots[np.abs(roots.imag) < 1e-9].real)
    return np.asarray(real[(real >= -1e-12) & (real <= 1 + 1e-12)])
