"""Number of eigenvalues in a circle, by the argument principle on the exact characteristic function."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from .stiffness import DynamicStiffness

__all__ = ["number_inside"]

_POINTS = 64, 8192
_MOST_LEVELS = 10
_CLEAR = 0.05
"""Largest accepted distance of the integral from an integer. Two sums, one with twice the points, must agree."""


def number_inside(problem: DynamicStiffness, row: int, centre: complex, radius: float) -> int:
    """Return the number of zeros of the characteristic function in a circle, multiplicity counted.

    The integral of F'/F is a sum over equidistant points, whose error falls exponentially with their number.

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
        If the waves are too short, an eigenvalue lies on the circle or too near to it for 8192 points, or the function
        has lost all digits to rounding there.
    """
    least, most = _POINTS
    levels = problem.levels(np.array([centre + radius]), np.array([row]))
    if levels.max() > _MOST_LEVELS:
        raise ArithmeticError("the waves must not be shorter than a thousandth of the domain")
    total, number = 0.0 + 0.0j, 0
    before: int | None = None
    while number < most:
        new = number or least
        turn = (np.arange(new) + (0.5 if number else 0.0)) / new
        total += _sum(problem, row, centre, radius * np.exp(2j * np.pi * turn))
        number += new
        value = total / number
        whole = round(value.real)
        near = abs(value - whole) < _CLEAR
        if near and before == whole:
            return whole
        before = whole if near else None
    raise ArithmeticError(
        f"an eigenvalue lies within about {4 * radius / most:.1g} of the circle, or rounding leaves no digits there; "
        "change the radius"
    )


def _sum(problem: DynamicStiffness, row: int, centre: complex, arm: NDArray[np.complex128]) -> complex:
    total = 0.0 + 0.0j
    for part in np.array_split(arm, max(1, len(arm) // 256)):
        here = problem.evaluate(centre + part, np.full(len(part), row))
        total += complex((here.logarithmic_derivative * part).sum())
    return total
