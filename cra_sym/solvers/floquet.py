"""Floquet exponents of many systems, from their monodromy matrices or from maps over half a period."""

from __future__ import annotations

from typing import Literal, NamedTuple

import numpy as np

__all__ = [
    "MOST_STEPS",
    "Oscillation",
    "both_of_pairs",
    "exponents_of",
    "flat",
    "growth_of",
    "multipliers_of",
    "paired_exponents",
    "rate_of",
    "whole_period",
]

_SQUARES = 14  # of monodromy matrices: 16384 periods
MOST_STEPS = 1e7  # steps per period, which take minutes


class Oscillation(NamedTuple):
    """``varpi**power`` times the cosine or sine of ``order * varpi * t``; order 0 with 'cos' is constant."""

    order: int
    kind: Literal["cos", "sin"]
    power: int

    def rate(self) -> tuple[Oscillation, int]:
        """Return the oscillation of the derivative by time, and its factor."""
        other: Literal["cos", "sin"] = "sin" if self.kind == "cos" else "cos"
        return Oscillation(self.order, other, self.power + 1), -self.order if self.kind == "cos" else self.order


def flat(array: np.ndarray, shape: tuple[int, ...], own: int) -> np.ndarray:
    """Return an array whose batch axes are broadcast, made one and put last; ``own`` axes are its own."""
    tail = array.shape[array.ndim - own :]
    flat = np.broadcast_to(array, shape + tail).reshape(-1, *tail)
    return np.ascontiguousarray(np.moveaxis(flat, 0, -1))


def whole_period(half: np.ndarray, damping: np.ndarray, parity: np.ndarray) -> np.ndarray:
    r"""Return maps of (q, dq/dt) over a period from those over its first half, shape (points, 2N, 2N).

    Let the matrix A(t) of the equations be even in time and X a constant matrix with :math:`AX = XA^T`. Time reversal
    then gives the adjoint equation transformed by X, so that the map of the second half is :math:`X\Phi^TX^{-1}`. Such
    an X exists where a change of the signs of some q transposes K(t) and the constant C.

    Parameters
    ----------
    half : ndarray, shape (points, 2N, 2N)
    damping : ndarray, shape (points, N, N) or (1, N, N)
        C.
    parity : ndarray, shape (N,)
        The signs, 1 or -1.
    """
    n = len(parity)
    swapped = half.swapaxes(1, 2)
    # X = [[0, P], [P, -C P]], its inverse [[P C, P], [P, 0]]
    above, below = parity[:, None] * swapped[:, :n], parity[:, None] * swapped[:, n:]
    left = np.concatenate([below, above - damping @ below], axis=1)
    first, second = left[:, :, :n] * parity, left[:, :, n:] * parity
    return np.asarray(np.concatenate([first @ damping + second, first], axis=2) @ half)


def paired_exponents(half: np.ndarray, period: np.ndarray) -> np.ndarray:
    r"""Return one exponent s of each pair (s, -s) of a system without damping, its real part not negative.

    Let the map of the first half of the period be symplectic, in canonical coordinates whose reversal in time keeps the
    displacements and changes the signs of the momenta. The second half of the period is then the first one mirrored:
    with the blocks a, b, c, d of the half-period map, :math:`\sinh^2(sT/2)` are the eigenvalues of :math:`b^Tc`, and
    :math:`\cosh^2(sT/2)` those of :math:`d^Ta`. The smaller of the two is used, so that a double multiplier 1 or -1
    loses no digits.

    Parameters
    ----------
    half : ndarray, shape (points, 2N, 2N)
    period : ndarray, shape (points,)

    Returns
    -------
    complex ndarray, shape (points, N)
    """
    n = half.shape[-1] // 2
    a, b, c, d = half[:, :n, :n], half[:, :n, n:], half[:, n:, :n], half[:, n:, n:]
    sines = np.linalg.eigvals(b.swapaxes(1, 2) @ c).astype(complex)
    cosines = np.linalg.eigvals(d.swapaxes(1, 2) @ a).astype(complex)
    nearest = np.abs(1.0 + sines[:, :, None] - cosines[:, None, :]).argmin(axis=-1)
    cosines = np.take_along_axis(cosines, nearest, axis=-1)
    exponents = np.where(sines.real > -0.5, np.arcsinh(np.sqrt(sines)), np.arccosh(np.sqrt(cosines)))
    return np.asarray(2 * exponents / period[:, None])


def both_of_pairs(growing: np.ndarray, period: np.ndarray) -> np.ndarray:
    """Return all exponents, in the order of :func:`exponents_of`, from one of each pair."""
    return _ordered(np.concatenate([growing, -growing], axis=-1), period)


def growth_of(growing: np.ndarray) -> np.ndarray:
    """Return the largest growth rate, not below zero, from one exponent of each pair."""
    return np.asarray(np.maximum(growing.real.max(axis=-1), 0.0))


def multipliers_of(maps: np.ndarray, error: float | None = None) -> np.ndarray:
    r"""Return the multipliers of monodromy matrices, complex, shape (points, 2N).

    With an error of the maps, relative to their size: those of systems of whose multipliers :math:`\mu` also
    :math:`1/\bar\mu` is one, as without damping. One that has no such partner, or that the error may have moved off the
    unit circle, is on it.
    """
    found = np.linalg.eigvals(maps).astype(complex)
    if error is None:
        return found
    numbers, size = np.arange(found.shape[-1]), np.linalg.norm(maps, axis=(1, 2))[:, None]
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        partners = 1.0 / found.conj()
        own, apart = np.abs(found - partners), np.abs(partners[:, :, None] - found[:, None, :])
        apart[:, numbers, numbers] = np.inf
        # the error of two multipliers this near to each other grows by the inverse of their distance
        still = (own <= apart.min(axis=-1)) | (own**2 <= error * size)
        return np.asarray(np.where(still, found / np.abs(found), found))


def exponents_of(multipliers: np.ndarray, period: np.ndarray) -> np.ndarray:
    """Return the exponents of multipliers, shape (points, 2N), largest real part first.

    Their imaginary parts are fixed up to multiples of the excitation frequency and given between -1/2 and 1/2 of it.
    """
    return _ordered(np.log(multipliers) / period[:, None], period)


def _ordered(exponents: np.ndarray, period: np.ndarray) -> np.ndarray:
    order = np.lexsort((exponents.imag, -np.round(exponents.real * period[:, None], 9)), axis=-1)
    return np.take_along_axis(exponents, order, axis=-1)


def rate_of(maps: np.ndarray, period: np.ndarray, *, damped: bool, error: float | None = None) -> np.ndarray:
    """Return max(0, largest real part of the exponents) of monodromy matrices; ``error`` as of :func:`multipliers_of`.

    Damped systems most of whose points are stable are decided by powers: where the norm of one is below 1, so are all
    multipliers. Eigenvalues cost fifty times as much as a square.
    """
    rates, left, power = np.zeros(len(maps)), np.arange(len(maps)), maps
    for _ in range(_SQUARES if damped else 0):
        with np.errstate(over="ignore", invalid="ignore"):
            power = power @ power
            undecided = ~(np.einsum("pij,pij->p", power, power) < 0.25)  # far from 1, for the rounding
        if not undecided.all():
            left, power = left[undecided], power[undecided]
    growth = np.log(np.abs(multipliers_of(maps[left], error))).max(axis=-1)
    rates[left] = np.maximum(growth / period[left], 0.0)
    rates[rates * period <= 4 * np.finfo(float).eps] = 0.0  # rounding of a multiplier on the unit circle
    return rates
