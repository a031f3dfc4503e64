"""Number of eigenvalues in a circle, by the argument principle on the exact characteristic function."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from .stiffness import DynamicStiffness

__all__ = ["number_inside"]

_POINTS = 64, 1024
_MOST_LEVELS = 10
_CLEAR = 0.05
"""Largest accepted distance of the integral from an integer. Two sums, one with twice the points, must agree."""
_NEAREST = 8  # zeros near the circle that are sought at a time
_NEAR = 0.05  # F'/F over the number of points from which on a zero is near; the sum sees one at 0.2 with an error e^-5
_STEPS = 8  # of Newton's method
_ON = 1e-9  # distance of a zero from the circle, over the radius, within which its side is not decided
_AROUND, _CLUSTER, _MOST_CLUSTERED = 32, (1e-3, 2e-2), 4  # points on a circle around a cluster, its radii, its zeros
_SAME = 1e-5  # distance, over the radius, below which a zero has been found before
_SPLIT = 1e-10  # rounding of the coefficients of the polynomial of a cluster


def number_inside(problem: DynamicStiffness, row: int, centre: complex, radius: float) -> int:
    """Return the number of zeros of the characteristic function in a circle, multiplicity counted.

    The integral of F'/F is a sum over equidistant points, whose error falls exponentially with their number, the more
    slowly the nearer a zero is to the circle. Zeros near it are therefore found by Newton's method, or together as
    those of a polynomial where some coalesce: a zero at q radii contributes ``1 / (1 - q^N)`` to the sum over N points
    from 1 on, and 1 or 0 to the integral.

    Parameters
    ----------
    problem : DynamicStiffness
    row : int
        The parameter set.
    centre, radius : complex, float
        Of the circle in the parameter of the problem.

    Raises
    ------
    ArithmeticError
        If the waves are too short, an eigenvalue lies on the circle, several lie too near to it and to each other for
        1024 points, or the function has lost all digits to rounding there.
    """
    least, most = _POINTS
    levels = problem.levels(np.array([centre + radius]), np.array([row]))
    if levels.max() > _MOST_LEVELS:
        raise ArithmeticError("the waves must not be shorter than a thousandth of the domain")
    turns, slopes = np.zeros(0, dtype=complex), np.zeros(0, dtype=complex)
    zeros, doubt = np.zeros(0, dtype=complex), np.zeros(0)
    before: int | None = None
    shift = 1.0 / 3.0  # of the points, over their distance, lest any is a zero on the axes
    while len(turns) < most:
        new = len(turns) or least
        added = np.exp(2j * np.pi * (np.arange(new) + shift + (0.5 if len(turns) else 0.0)) / new)
        shift = 2.0 * shift % 1.0 if len(turns) else shift
        turns = np.concatenate([turns, added])
        slopes = np.concatenate([slopes, radius * _slopes(problem, row, centre + radius * added)])
        value = (slopes * turns).mean()
        found, unsure = _near(problem, row, centre, radius, turns, slopes)
        kept = np.abs(zeros[:, None] - found).min(axis=1, initial=np.inf) > _SAME
        zeros, doubt = np.concatenate([zeros[kept], found]), np.concatenate([doubt[kept], unsure])
        with np.errstate(over="ignore", divide="ignore", invalid="ignore"):
            rest = value - (1.0 / (1.0 - zeros ** len(turns) * np.exp(-2j * np.pi * shift))).sum()
        clear = np.isfinite(rest) and abs(rest - round(rest.real)) < _CLEAR
        number = round(rest.real) + int((np.abs(zeros) < 1.0).sum()) if clear else 0
        if clear and before == number:
            undecided = np.abs(np.abs(zeros) - 1.0) < doubt
            if undecided.any():
                change = 10.0 * doubt[undecided].max()
                raise ArithmeticError(f"an eigenvalue lies on the circle to rounding; change it by {change:.0g} of it")
            return number
        before = number if clear else None
    raise ArithmeticError(
        f"eigenvalues lie within about {4 / most:.1g} radii of the circle and of each other, or rounding leaves no "
        "digits there; change the radius"
    )


def _slopes(problem: DynamicStiffness, row: int, at: NDArray[np.complex128]) -> NDArray[np.complex128]:
    """Return F'/F at some places."""
    parts = np.array_split(at, max(1, len(at) // 256))
    return np.concatenate([problem.evaluate(part, np.full(len(part), row)).logarithmic_derivative for part in parts])


def _near(
    problem: DynamicStiffness,
    row: int,
    centre: complex,
    radius: float,
    turns: NDArray[np.complex128],
    slopes: NDArray[np.complex128],
) -> tuple[NDArray[np.complex128], NDArray[np.float64]]:
    """Return zeros near the circle that Newton's method reaches from the points next to them, and their uncertainty.

    Both are over the radius. One that is not a zero, or the same zero twice, makes the sum no integer or leaves the
    number as it is.
    """

    def scaled(place: NDArray[np.complex128]) -> NDArray[np.complex128]:
        return radius * _slopes(problem, row, centre + radius * place)

    order = np.argsort(np.angle(turns))
    size = np.abs(slopes[order])
    peaks = order[(size >= np.roll(size, 1)) & (size > np.roll(size, -1)) & (size > _NEAR * len(turns))]
    place = turns[peaks[np.argsort(-np.abs(slopes[peaks]))[:_NEAREST]]]
    if not len(place):
        return place, np.zeros(0)
    step = np.full(len(place), np.inf, dtype=complex)
    with np.errstate(all="ignore"):
        for _ in range(_STEPS):
            step = 1.0 / scaled(place)
            step = np.where(np.isnan(step), 0.0, step)  # of a zero to the last digit
            place = place - step
    there = np.isfinite(place) & (np.abs(np.abs(place) - 1.0) < 0.5)
    # the last step is the square of what it leaves
    good = there & (np.abs(step) < 1e-6)
    zeros, doubt = place[good], np.full(int(good.sum()), _ON)
    for middle, last in zip(place[there & ~good], np.abs(step[there & ~good]), strict=True):
        for reach in float(np.clip(16.0 * last, *_CLUSTER)) * np.array([1.0, 3.0]):
            if (np.abs(zeros - middle) < reach).any():
                break
            found = _cluster(scaled, middle, reach)
            own = max(_ON, reach * _SPLIT ** (1.0 / max(1, len(found))))
            zeros, doubt = np.concatenate([zeros, found]), np.concatenate([doubt, np.full(len(found), own)])
    return zeros, doubt


def _cluster(
    slopes: Callable[[NDArray[np.complex128]], NDArray[np.complex128]], middle: complex, reach: float
) -> NDArray[np.complex128]:
    """Return the zeros in a small circle, from the polynomial that the integrals of F'/F times powers determine."""
    turns = np.exp(2j * np.pi * (np.arange(_AROUND) + 0.25) / _AROUND)
    around = reach * slopes(middle + reach * turns)
    sums = [(around * turns ** (k + 1)).mean() for k in range(_MOST_CLUSTERED + 1)]
    if not np.isfinite(sums).all() or abs(sums[0] - round(sums[0].real)) > _CLEAR:
        return np.zeros(0, dtype=complex)
    number = round(sums[0].real)
    if not 0 < number <= _MOST_CLUSTERED:
        return np.zeros(0, dtype=complex)
    polynomial = [1.0 + 0j]
    for k in range(1, number + 1):  # Newton's identities
        polynomial.append(-sum(polynomial[k - j] * sums[j] for j in range(1, k + 1)) / k)
    return np.asarray(middle + reach * np.roots(polynomial))
