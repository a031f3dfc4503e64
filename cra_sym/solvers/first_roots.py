"""First root of polynomials on [0, 1], isolated by Descartes' rule of signs so that none is missed."""

from __future__ import annotations

from functools import cache
from math import comb

import numpy as np
from numpy.typing import NDArray

__all__ = ["first_roots", "hull", "rounding"]

Array = NDArray[np.float64]
_ROUNDING = 16 * np.finfo(float).eps  # values below this share of the sum of the coefficients' magnitudes count as zero
_HALVINGS = 40
_ITERATIONS = 80


@cache
def _bernstein(degree: int) -> Array:
    """Return the matrix that takes coefficients of powers to those of Bernstein's polynomials on [0, 1].

    A polynomial lies in the convex hull of the latter. It has at most as many roots as they have sign changes, and
    exactly as many for none or one.
    """
    matrix = np.array([[comb(j, k) / comb(degree, k) for k in range(degree + 1)] for j in range(degree + 1)])
    matrix.flags.writeable = False
    return matrix


def hull(coefficients: Array) -> tuple[Array, Array]:
    """Return bounds of polynomials on [0, 1], rounding included.

    Parameters
    ----------
    coefficients : ndarray, shape (degree + 1, members)

    Returns
    -------
    low, high : ndarray, shape (members,)
    """
    values = _bernstein(len(coefficients) - 1) @ coefficients
    return values.min(axis=0), values.max(axis=0)


def rounding(coefficients: Array) -> Array:
    """Return the rounding error of the values of polynomials, shape (members,)."""
    return np.asarray(_ROUNDING * np.abs(coefficients).sum(axis=0))


def first_roots(coefficients: Array) -> tuple[Array, NDArray[np.bool_]]:
    """Return the position on [0, 1] up to which each polynomial is resolved, and whether it crosses zero there.

    A polynomial with several roots is resolved up to a position before the second; one that starts at zero and
    decreases crosses at 0.

    Parameters
    ----------
    coefficients : ndarray, shape (degree + 1, members)

    Returns
    -------
    place : ndarray, shape (members,)
    falls : ndarray of bool, shape (members,)
    """
    powers = np.arange(len(coefficients))[:, None]
    matrix, members = _bernstein(len(coefficients) - 1), coefficients.shape[1]
    place, falls, open_ = np.ones(members), np.zeros(members, bool), np.arange(members)
    bracketed = np.zeros(members, bool)
    for halving in range(_HALVINGS + 1):
        scaled = coefficients[:, open_] * place[open_] ** powers
        values = matrix @ scaled
        zero = np.abs(values) <= rounding(scaled)
        lead, changes = _signs(np.where(zero, 0.0, np.sign(values)))
        at_once, one = lead < 0, (lead >= 0) & (changes == 1)
        place[open_[at_once]] = 0.0
        falls[open_[at_once | one]] = True
        bracketed[open_[one]] = True
        open_ = open_[(lead > 0) & (changes > 1)]
        if not open_.size:
            break
        if halving == _HALVINGS:  # roots that rounding makes indistinguishable
            falls[open_] = (coefficients[:, open_] * place[open_] ** powers).sum(axis=0) < 0
        else:
            place[open_] /= 2
    inside = np.flatnonzero(bracketed)
    place[inside] = _roots(coefficients[:, inside], place[inside])
    return place, falls


def _signs(signs: Array) -> tuple[Array, NDArray[np.intp]]:
    """Return the first sign that is not zero, and how often the sign changes, of each column."""
    there = signs != 0
    last = np.maximum.accumulate(np.where(there, np.arange(len(signs))[:, None], 0), axis=0)
    filled = np.take_along_axis(signs, last, axis=0)  # zeros take the preceding sign
    lead = np.take_along_axis(signs, there.argmax(axis=0)[None], axis=0)[0]
    return lead, (filled[1:] * filled[:-1] < 0).sum(axis=0)


def _roots(coefficients: Array, high: Array) -> Array:
    """Return the only root of each polynomial in (0, high), before which it is positive: Newton's method, guarded."""
    order = np.arange(len(coefficients))[:, None]
    slopes = coefficients[1:] * order[1:]
    low, high = np.zeros_like(high), high.copy()
    place = high / 2
    for _ in range(_ITERATIONS):
        powers = place**order
        value = (coefficients * powers).sum(axis=0)
        slope = (slopes * powers[:-1]).sum(axis=0)
        low, high = np.where(value > 0, place, low), np.where(value > 0, high, place)
        with np.errstate(all="ignore"):
            step = place - value / slope
        settled = np.abs(step - place) <= np.finfo(float).eps
        place = np.where(settled | ((step > low) & (step < high)), step, (low + high) / 2)
        if (settled | (high - low <= np.finfo(float).eps)).all():
            break
    return np.clip(place, low, high)
