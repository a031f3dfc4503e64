"""Bound of the free response of a linear system: the sum of the peaks of its complex modes."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import schur, solve_sylvester

__all__ = ["free_peaks", "peaks_of_modes"]

Array = NDArray[np.float64]
Complex = NDArray[np.complex128]
_STILL = 1e-7  # of the largest eigenvalue: rounding error of a double zero of a rigid-body mode
_REAL = 1e-9  # relative size of a part of an eigenvalue that is rounding
_LOW = 1e-9  # of the largest state: a velocity below is rounding


def free_peaks(system: Array, row: Array, states: Array, rigid: int) -> Array:
    """Return the sum over the free motions of ``y' = system y`` from a state of their peaks in ``row y``.

    A pair of complex eigenvalues is one motion, and so are two neighbouring real ones, as of an overdamped mode. The
    peak of a growing motion is inf.

    Parameters
    ----------
    system : ndarray, shape (r, r)
    row : ndarray, shape (r,)
    states : ndarray, shape (states, r)
    rigid : int
        Number of rigid-body modes, which keep their displacement, or grow linearly if they have a velocity.

    Returns
    -------
    ndarray, shape (states,)
    """
    total = np.zeros(len(states))
    if rigid:
        total, system, row, states = _without_rigid_motions(system, row, states)
    s, vectors = np.linalg.eig(system)
    return np.asarray(total + peaks_of_modes(s, (row @ vectors) * np.linalg.solve(vectors, states.T.astype(complex)).T))


def peaks_of_modes(s: Complex, shares: Complex) -> Array:
    """Return the same for motions ``sum of shares exp(s t)``, shape (states,).

    Parameters
    ----------
    s : ndarray of complex, shape (r,)
        Eigenvalues, both of each conjugate pair.
    shares : ndarray of complex, shape (states, r)
    """
    total = np.zeros(len(shares))
    for k in np.flatnonzero(s.imag > _REAL * np.abs(s)):
        total += _pair_peaks(2 * shares[:, k].real, 2 * (shares[:, k] * s[k]).real, s[k], s[k].conjugate())
    falling = np.flatnonzero(np.abs(s.imag) <= _REAL * np.abs(s))
    falling = falling[np.argsort(-s[falling].real)]
    for first in range(0, falling.size, 2):
        two = falling[first : first + 2]
        value, slope = shares[:, two].sum(axis=1).real, (shares[:, two] * s[two]).sum(axis=1).real
        total += _pair_peaks(value, slope, *s[two]) if two.size == 2 else _real_peaks(value, float(s[two[0]].real))
    return total


def _without_rigid_motions(system: Array, row: Array, states: Array) -> tuple[Array, Array, Array, Array]:
    """Return the contribution of rigid-body motions, and the system without them (their invariant subspace)."""
    size = np.abs(np.linalg.eigvals(system)).max()
    turned, frame, number = schur(system, sort=lambda real, imaginary: np.hypot(real, imaginary) < _STILL * size)
    first, rest, between = turned[:number, :number], turned[number:, number:], turned[:number, number:]
    joined = solve_sylvester(first, -rest, -between)
    row, states = row @ frame, states @ frame
    still = states[:, :number] - states[:, number:] @ joined.T
    offset, speed = still @ row[:number], still @ (row[:number] @ first)
    moves = np.abs(speed) > _LOW * size * (np.abs(still) @ np.abs(row[:number]))
    return np.where(moves, np.inf, np.abs(offset)), rest, row[:number] @ joined + row[number:], states[:, number:]


def _real_peaks(value: Array, rate: float) -> Array:
    return np.where((rate > 0.0) & (value != 0.0), np.inf, np.abs(value))


def _pair_peaks(value: Array, slope: Array, one: complex, other: complex) -> Array:
    """Return the largest absolute values of solutions of ``(d/dt - one)(d/dt - other) f = 0`` from f and f' on."""
    middle, half = 0.5 * (one + other).real, 0.5 * (one - other)
    if max(one.real, other.real) > _REAL * abs(one):
        return np.where((value != 0.0) | (slope != 0.0), np.inf, 0.0)
    # f = exp(middle t) (value cosh(half t) + drift sinh(half t)/half); it turns where tanh(half t)/half = -slope/below
    drift = slope - middle * value
    below = middle * drift + (half**2).real * value
    if half.imag:
        turn = np.mod(np.arctan2(-slope * abs(half.imag), below), np.pi) / abs(half.imag)
    else:
        with np.errstate(divide="ignore", invalid="ignore"):
            ratio = np.where(below != 0.0, -slope / below, np.inf)
        inside = (ratio > 0.0) & (ratio * half.real < 1.0) & np.isfinite(ratio)
        ratio = np.where(inside, ratio, 0.0)
        turn = np.arctanh(ratio * half.real) / half.real if half.real else ratio
    angle = half * turn
    small = np.abs(angle) < 1e-8
    swing = np.where(small, turn, (np.sinh(angle) / np.where(small, 1.0, half)).real)
    later = np.abs(np.exp(middle * turn) * (value * np.cosh(angle).real + drift * swing))
    return np.asarray(np.maximum(np.abs(value), later))
