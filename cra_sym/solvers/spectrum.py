"""Complete spectra: the first zeros of an entire function with real zeros only, none missed and none repeated.

An exact count gives the number of zeros below any point. Ostrowski's square-root step then converges from a point
below a zero to that zero, with cubic order and without overshoot. The functions are those of lines with one wave
number,
in z = lambda^4 for beams and lambda^2 for strings, with zeros about pi apart in lambda.
"""

from __future__ import annotations

from typing import Protocol

import numpy as np

__all__ = ["Characteristic", "Lanes", "spectrum"]

Lanes = np.ndarray | slice
_MOST_STEPS = 80


class Characteristic(Protocol):
    """A family of characteristic functions, one in each lane, entire in z, with zeros z >= 0 only.

    Attributes
    ----------
    zeros : ndarray of int, shape (lanes,)
        Multiplicity of the zero at z = 0.
    """

    zeros: np.ndarray

    def count(self, z: float | np.ndarray, lanes: Lanes) -> tuple[np.ndarray, np.ndarray]:
        """Return the number of zeros below z, those at 0 included, and the function, in the lanes asked for.

        The function's scale depends on z only, and is such that its size grows moderately with z.
        """

    def evaluate(self, z: np.ndarray, lanes: Lanes) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return the function and its first two derivatives by z, all multiplied by one positive factor.

        The sign of the function is that of (-1)**N, N the number of zeros below z. Up to some z the zeros at 0 may
        be divided out, and have to be at z = 0 itself.
        """


def spectrum(characteristic: Characteristic, modes: int, offset: float = 1 / 16, power: int = 4) -> np.ndarray:
    """Return the first zeros of every lane.

    Parameters
    ----------
    characteristic : Characteristic
        The functions and their counts.
    modes : int
        How many zeros, multiplicity included.
    offset : float
        Zeros are counted at lambda = ``(k / 2 + offset) pi``, k = 0, 1, ...; best chosen away from accumulations of
        zeros.
    power : int
        z is this power of lambda.

    Returns
    -------
    ndarray, shape (lanes, modes)
        The zeros, ascending; those at 0 are exactly 0.

    Raises
    ------
    ArithmeticError
        If a zero is not reached: the function is not of this kind.
    """
    lanes = len(characteristic.zeros)
    points, counts, values = _counted(characteristic, modes, offset, power)
    number, lane = (index.ravel() for index in np.indices((modes, lanes)))
    right = _first_point_with(counts, modes)[number, lane]
    z = np.zeros(modes * lanes)
    wanted = np.flatnonzero(number >= characteristic.zeros[lane])
    number, lane, right = number[wanted], lane[wanted], right[wanted]
    start = _start(characteristic, number, lane, right, points, counts, values, power)
    z[wanted] = _climbed(characteristic, number, lane, start)
    return z.reshape(modes, lanes).T


def _counted(
    characteristic: Characteristic, modes: int, offset: float, power: int
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return points lambda, up to one with enough zeros below it, the counts there and the functions."""
    points, counts, values = [0.0], [characteristic.zeros], [np.full(len(characteristic.zeros), np.nan)]
    while counts[-1].min(initial=modes) < modes:
        if len(points) > 2 * modes + 40:
            raise ArithmeticError(f"{counts[-1].min()} zeros lie below lambda = {points[-1]:g}, {modes} are wanted")
        points.append(np.pi * ((len(points) - 1) / 2 + offset))
        number, value = characteristic.count(points[-1] ** power, slice(None))
        counts.append(number)
        values.append(value)
    return np.array(points), np.array(counts), np.array(values)


def _first_point_with(counts: np.ndarray, modes: int) -> np.ndarray:
    """Return, for each number and each lane, the index of the first point with more than that many zeros below."""
    lanes = np.arange(counts.shape[1])
    points = np.zeros((modes + 1, counts.shape[1]), dtype=np.int64)
    for row in counts:
        points[np.minimum(row, modes), lanes] += 1
    return np.cumsum(points, axis=0)[:modes]


def _start(
    characteristic: Characteristic,
    number: np.ndarray,
    lane: np.ndarray,
    right: np.ndarray,
    points: np.ndarray,
    counts: np.ndarray,
    values: np.ndarray,
    power: int,
) -> np.ndarray:
    """Return points close to the wanted zeros, with ``number`` zeros below, or one more."""
    low, high = points[right - 1] ** power, points[right] ** power
    below, above = counts[right - 1, lane], counts[right, lane]
    _separate(characteristic, number, lane, low, high, below, above)
    first = number == characteristic.zeros[lane]
    alone = ~first & (below == number) & (above == number + 1) & (right > 1)
    z = np.where(below == number, low, high)
    z[alone] = _by_phase(lane[alone], right[alone], points, values) ** power
    z[first] = _from_zero(characteristic, lane[first], high[first])
    second = np.flatnonzero((number == characteristic.zeros[lane] + 1) & (right < 3) & (above == number + 1))
    guess = _second_from_zero(characteristic, lane[second])
    inside = (low[second] < guess) & (guess < high[second])
    z[second[inside]] = guess[inside]
    return np.asarray(z)


def _separate(
    characteristic: Characteristic,
    number: np.ndarray,
    lane: np.ndarray,
    low: np.ndarray,
    high: np.ndarray,
    below: np.ndarray,
    above: np.ndarray,
) -> None:
    """Shrink, in place, brackets until on one side of the wanted zero there is no other."""
    crowded = np.flatnonzero((below < number) & (number + 1 < above))
    while crowded.size:
        middle = np.where(low[crowded] > 0, np.sqrt(low[crowded] * high[crowded]), high[crowded] / 16)
        counted, _ = characteristic.count(middle, lane[crowded])
        left = counted <= number[crowded]
        low[crowded[left]], below[crowded[left]] = middle[left], counted[left]
        high[crowded[~left]], above[crowded[~left]] = middle[~left], counted[~left]
        crowded = crowded[(below[crowded] < number[crowded]) & (number[crowded] + 1 < above[crowded])]


def _from_zero(characteristic: Characteristic, lane: np.ndarray, high: np.ndarray) -> np.ndarray:
    """Return the lower bound of the first positive zero that the first step from z = 0 gives; it is close."""
    value, slope, curvature = characteristic.evaluate(np.zeros(lane.size), lane)
    return np.asarray(np.minimum(_step(value, slope, curvature), high))


def _second_from_zero(characteristic: Characteristic, lane: np.ndarray) -> np.ndarray:
    """Return the larger zero of the function's first three terms at z = 0, nan where the two are not well separated."""
    value, slope, curvature = characteristic.evaluate(np.zeros(lane.size), lane)
    discriminant = slope * slope - 2 * value * curvature
    apart = np.where(discriminant > 0.1 * slope * slope, discriminant, np.nan)
    return np.asarray((np.abs(slope) + np.sqrt(apart)) / np.abs(curvature))


def _by_phase(lane: np.ndarray, right: np.ndarray, points: np.ndarray, values: np.ndarray) -> np.ndarray:
    """Return lambda of zeros that are alone in their intervals, by a fit of a sinusoid of growing amplitude.

    Neighbouring points are a quarter of a period apart, so that two values in a row give amplitude and phase.
    """
    before, left, here = (values[right - shift, lane] for shift in (2, 1, 0))
    inside = right + 1 < len(values)
    after = np.where(inside, values[np.minimum(right + 1, len(values) - 1), lane], left)
    growth = np.sqrt((here * here + after * after) / (before * before + left * left))
    growth = np.where(inside, np.sqrt(growth), growth)  # over two intervals, or over one
    opposite = np.abs(left) * np.where(right > 2, growth, 1.0)
    return np.asarray(points[right - 1] + _quarters(opposite, np.abs(here)) * (points[right] - points[right - 1]))


def _quarters(opposite: np.ndarray, adjacent: np.ndarray) -> np.ndarray:
    """Return the angle whose tangent is the first over the second, neither negative, in right angles to 2e-4."""
    share = opposite / (opposite + adjacent)
    product = share * (1 - share)
    return np.asarray(share + product * (1 - 2 * share) * (-0.3664 - product * (0.3404 + product * 1.5)))


def _step(
    value: np.ndarray,
    slope: np.ndarray,
    curvature: np.ndarray,
    z: np.ndarray | float = 1.0,
    lower: np.ndarray | int = 0,
) -> np.ndarray:
    """Return Ostrowski's step, the square root of one over the sum of (z - zero)^-2: no zero is nearer.

    Each of the ``lower`` zeros between 0 and the wanted one adds at least z^-2 to that sum. Subtracting these makes the
    step longer, but never beyond the wanted zero. Where the difference would be rounding, nothing is subtracted.
    """
    with np.errstate(invalid="ignore", divide="ignore", over="ignore"):
        whole, known = slope * slope - value * curvature, lower * (value / z) ** 2
        rest = np.where(whole - known > 1e-3 * whole, whole - known, whole)
        step = np.abs(value) / np.sqrt(rest)
    return np.where(value == 0, 0.0, step)


def _climbed(characteristic: Characteristic, number: np.ndarray, lane: np.ndarray, z: np.ndarray) -> np.ndarray:
    """Climb, in place, to the zeros from points next to them."""
    active = np.arange(z.size)
    previous = np.zeros(z.size)  # previous step
    even, lower = number % 2 == 0, number - characteristic.zeros[lane]
    for _ in range(_MOST_STEPS):
        if not active.size:
            return z
        value, slope, curvature = characteristic.evaluate(z[active], lane[active])
        step = _step(value, slope, curvature, z[active], lower[active])
        z[active] += np.where((value > 0) == even[active], step, -step)
        with np.errstate(invalid="ignore", divide="ignore", over="ignore"):
            remaining = step * (step / previous[active]) ** 3  # the order is three, once steps are short
        previous[active] = step
        there = (remaining <= 1e-15 * z[active]) & (step <= 0.1 * z[active])
        active = active[~(there | (step <= 1e-13 * z[active]))]
    raise ArithmeticError(f"{active.size} zeros were not reached")
