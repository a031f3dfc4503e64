"""Goodness of fit to measured data, and Fisher information."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

__all__ = ["SMALLEST_P", "Goodness", "goodness", "information_inverse"]

Array = NDArray[np.float64]
SMALLEST_P = 0.01
"""Probability of a larger chi2 below which values do not fit."""
_LARGEST_RESIDUAL = 3.0  # largest residual, in sigma, of values that fit without degrees of freedom


class Goodness(NamedTuple):
    """Sum of the squared residuals, degrees of freedom, probability of a larger sum, and whether the values fit."""

    chi2: float
    freedom: int
    p_value: float
    fits: bool


def goodness(residuals: Array, unknowns: int) -> Goodness:
    """Return the goodness of fit of a number of unknowns, from the residuals over their standard deviations."""
    from scipy.special import chdtrc

    freedom, chi2 = residuals.size - unknowns, float(np.sum(residuals**2))
    if freedom <= 0:
        return Goodness(chi2, freedom, float("nan"), bool(np.abs(residuals).max() < _LARGEST_RESIDUAL))
    p_value = float(chdtrc(freedom, chi2))
    return Goodness(chi2, freedom, p_value, p_value >= SMALLEST_P)


def information_inverse(jacobian: Array) -> Array:
    """Return the inverse of the Fisher information of weighted residuals; inf where it is singular."""
    rows, columns = jacobian.shape
    size = np.linalg.norm(jacobian, axis=0)
    if rows < columns or not size.all():
        return np.full((columns, columns), np.inf)
    _, values, basis = np.linalg.svd(jacobian / size)
    if values[-1] <= 1e-12 * values[0]:
        return np.full((columns, columns), np.inf)
    return np.asarray((basis.T / values**2) @ basis / np.outer(size, size))
