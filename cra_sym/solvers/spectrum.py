"""Complete spectra: the first zeros of an entire function with real zeros only, none missed and none doubled.

An exact count says how many zeros lie below any point; Ostrowski's square-root step then climbs from a point between
two zeros to either of them, monotonically and at cubic order, without ever passing it.
"""

from __future__ import annotations

from typing import Protocol

import numpy as np

__all__ = ["Characteristic", "spectrum"]

_LARGEST_NUMBER_OF_STEPS = 80


class Characteristic(Protocol):
    """A family of characteristic functions, one in each lane, entire in z and with zeros z >= 0 only.

    Attributes
    ----------
    zeros : ndarray of int, shape (lanes,)
        Multiplicity of the zero at z = 0.
    """

    zeros: np.ndarray

    def count(self, z: float | np.ndarray, lanes: np.ndarray | slice) -> np.ndarray:
        """Return the number of zeros below z, those at 0 included, in the lanes asked for."""

    def evaluate(self, z: np.ndarray, lanes: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return the function and its first two derivatives by z, all multiplied by one positive factor.

        The sign of the function is that of (-1)**N, N the number of zeros below z. Up to some z the zeros at 0 may
        be divided out, and have to be at z = 0 itself.
        """


def spectrum(characteristic: Characteristic, modes: int, grid: np.ndarray) -> np.ndarray:
    """Return the first zeros of every lane.

    Parameters
    ----------
    characteristic : Characteristic
        The functions and their counts.
    modes : int
        How many zeros, multiplicity included.
    grid : ndarray
        Ascending positive z where zeros are counted first; at least ``modes`` zeros must lie below the last. The finer
        it separates the zeros, the less is left to do.

    Returns
    -------
    ndarray, shape (lanes, modes)
        The zeros, ascending; those at 0 are exactly 0.

    Raises
    ------
    ArithmeticError
        If too few zeros lie below the end of the grid, or a zero is not reached: the function is not of this kind.
    """
    lanes = len(characteristic.zeros)
    counts = np.array([characteristic.zeros, *(characteristic.count(z, slice(None)) for z in grid)], dtype=np.int64)
    if lanes and counts[-1].min() < modes:
        raise ArithmeticError(f"{counts[-1].min()} zeros lie below the end of the grid, {modes} are wanted")
    number, lane = (index.ravel() for index in np.indices((modes, lanes)))
    right = _first_point_with(counts, modes)[number, lane]
    z = np.zeros(modes * lanes)
    wanted = np.flatnonzero(number >= characteristic.zeros[lane])
    number, lane, right = number[wanted], lane[wanted], right[wanted]
    points = np.array([0.0, *grid])
    bracket = points[right - 1], points[right], counts[right - 1, lane], counts[right, lane]
    z[wanted] = _polished(characteristic, number, lane, _start(characteristic, number, lane, *bracket))
    return z.reshape(modes, lanes).T


def _first_point_with(counts: np.ndarray, modes: int) -> np.ndarray:
    """Return, for each number of zeros and each lane, the first grid point that has more than so many below it."""
    lanes = np.arange(counts.shape[1])
    points = np.zeros((modes + 1, counts.shape[1]), dtype=np.int64)
    for row in counts:
        points[np.minimum(row, modes), lanes] += 1
    return np.cumsum(points, axis=0)[:modes]


def _start(
    characteristic: Characteristic,
    number: np.ndarray,
    lane: np.ndarray,
    low: np.ndarray,
    high: np.ndarray,
    count_low: np.ndarray,
    count_high: np.ndarray,
) -> np.ndarray:
    """Return points with the wanted zero next to them: ``number`` zeros below, or one more."""
    low, high, count_low, count_high = low.copy(), high.copy(), count_low.copy(), count_high.copy()
    between = np.flatnonzero((count_low < number) & (number + 1 < count_high))
    while between.size:
        middle = np.where(low[between] > 0, np.sqrt(low[between] * high[between]), high[between] / 16)
        counted = np.asarray(characteristic.count(middle, lane[between]))
        below = counted <= number[between]
        low[between[below]], count_low[between[below]] = middle[below], counted[below]
        high[between[~below]], count_high[between[~below]] = middle[~below], counted[~below]
        between = between[(count_low[between] < number[between]) & (number[between] + 1 < count_high[between])]
    alone = (count_low == number) & (count_high == number + 1) & (low > 0)
    middle = (np.sqrt(np.sqrt(low)) + np.sqrt(np.sqrt(high))) ** 4 / 16
    return np.where(alone, middle, np.where(count_low == number, low, high))


def _polished(characteristic: Characteristic, number: np.ndarray, lane: np.ndarray, z: np.ndarray) -> np.ndarray:
    """Climb to the zeros from points next to them."""
    active = np.arange(z.size)
    previous = np.zeros(z.size)  # the step before, none at first
    even = number % 2 == 0
    for _ in range(_LARGEST_NUMBER_OF_STEPS):
        if not active.size:
            return z
        value, slope, curvature = characteristic.evaluate(z[active], lane[active])
        ascent = slope * slope - value * curvature  # positive between zeros, by a sum over all zeros
        with np.errstate(invalid="ignore", divide="ignore"):
            step = np.abs(value) / np.sqrt(ascent)
        step[value == 0] = 0.0
        z[active] += np.where((value > 0) == even[active], step, -step)
        with np.errstate(invalid="ignore", divide="ignore", over="ignore"):
            remaining = step * (step / previous[active]) ** 3  # the order is three
        previous[active] = step
        active = active[~((remaining <= 1e-17 * z[active]) | (step <= 4e-16 * z[active]))]
    raise ArithmeticError(f"{active.size} zeros were not reached")
