"""Bound of the free response of a linear system: the sum of the peaks of its complex modes."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import schur, solve_sylvester

__all__ = ["free_peaks"]

Array = NDArray[np.float64]
_STILL = 1e-7  # of the largest eigenvalue: rounding error of a double zero of a rigid-body mode
_REAL = 1e-9  # relative size of a part of an eigenvalue that is rounding
_LOW = 1e-9  # of the largest state: a velocity below is rounding


def free_peaks(system: Array, row: Array, state: Array, rigid: int) -> float:
    """Return the sum over the free motions of ``y' = system y`` from a state of their peaks in ``row y``.

    A pair of complex eigenvalues is one motion, and so are two neighbouring real ones, as of an overdamped mode. The
    peak of a growing motion is inf.

    Parameters
    ----------
    system : ndarray, shape (r, r)
    row, state : ndarray, shape (r,)
    rigid : int
        Number of rigid-body modes, which keep their displacement, or grow linearly if they have a velocity.
    """
    total = 0.0
    if rigid:
        total, system, row, state = _without_rigid_motions(system, row, state)
    s, vectors = np.linalg.eig(system)
    shares = (row @ vectors) * np.linalg.solve(vectors, state.astype(complex))
    turning = np.flatnonzero(s.imag > _REAL * np.abs(s))
    total += sum(_pair_peak(2 * shares[k].real, 2 * (shares[k] * s[k]).real, s[k], s[k].conjugate()) for k in turning)
    falling = np.flatnonzero(np.abs(s.imag) <= _REAL * np.abs(s))
    falling = falling[np.argsort(-s[falling].real)]
    for first in range(0, falling.size, 2):
        two = falling[first : first + 2]
        value, slope = shares[two].sum().real, (shares * s)[two].sum().real
        total += _pair_peak(value, slope, *s[two]) if two.size == 2 else _real_peak(value, float(s[two[0]].real))
    return float(total)


def _without_rigid_motions(system: Array, row: Array, state: Array) -> tuple[float, Array, Array, Array]:
    """Return the contribution of rigid-body motions, and the system without them (their invariant subspace)."""
    size = np.abs(np.linalg.eigvals(system)).max()
    turned, frame, number = schur(system, sort=lambda real, imaginary: np.hypot(real, imaginary) < _STILL * size)
    first, rest, between = turned[:number, :number], turned[number:, number:], turned[:number, number:]
    joined = solve_sylvester(first, -rest, -between)
    row, state = row @ frame, frame.T @ state
    still = state[:number] - joined @ state[number:]
    offset, speed = row[:number] @ still, row[:number] @ first @ still
    moves = abs(speed) > _LOW * size * (np.abs(row[:number]) @ np.abs(still))
    return (np.inf if moves else abs(offset)), rest, row[:number] @ joined + row[number:], state[number:]


def _real_peak(value: float, rate: float) -> float:
    return np.inf if rate > 0.0 and value != 0.0 else abs(value)


def _pair_peak(value: float, slope: float, one: complex, other: complex) -> float:
    """Return the largest absolute value of the solution of ``(d/dt - one)(d/dt - other) f = 0`` from f and f' on."""
    middle, half = 0.5 * (one + other).real, 0.5 * (one - other)
    if max(one.real, other.real) > _REAL * abs(one) and (value or slope):
        return np.inf
    # f = exp(middle t) (value cosh(half t) + drift sinh(half t)/half); it turns where tanh(half t)/half = -slope/below
    drift = slope - middle * value
    below = middle * drift + (half**2).real * value
    if half.imag:
        turn = np.mod(np.arctan2(-slope * abs(half.imag), below), np.pi) / abs(half.imag)
    else:
        ratio = -slope / below if below else np.inf
        inside = ratio > 0.0 and ratio * half.real < 1.0
        turn = (np.arctanh(ratio * half.real) / half.real if half.real else ratio) if inside else 0.0
    angle = half * turn
    swing = turn if abs(angle) < 1e-8 else (np.sinh(angle) / half).real
    return float(max(abs(value), abs(np.exp(middle * turn) * (value * np.cosh(angle).real + drift * swing))))
