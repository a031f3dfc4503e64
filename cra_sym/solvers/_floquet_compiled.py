"""The inner loop of :mod:`cra_sym.solvers.floquet`, compiled; imported only when Numba is there and worth its start."""

from __future__ import annotations

import numpy as np
from numba import njit

__all__ = ["kick_and_drift"]


@njit(cache=True, error_model="numpy")
def kick_and_drift(
    drifts: np.ndarray,
    h: np.ndarray,
    kicks: np.ndarray,
    commutator: float,
    swings: np.ndarray,
    coupling: np.ndarray,
    compliance: np.ndarray,
    epsilon: np.ndarray,
    state: np.ndarray,
) -> None:
    """Propagate the states in place; the batch axis is innermost, so that its loops vectorise.

    Parameters
    ----------
    drifts : ndarray, shape (stages + 1, 2, 2, N, points)
        Free propagators: before each kick, and (last) between steps.
    h : ndarray, shape (points,)
        Step.
    kicks : ndarray, shape (stages,)
        Weights of the kicks.
    commutator : float
        Weight of the commutator in the middle kick.
    swings : ndarray, shape (steps, stages)
        cos(varpi t) at the kicks.
    coupling, compliance, epsilon : ndarray
        As in :class:`cra_sym.solvers.floquet.Oscillators`, with a full batch axis.
    state : ndarray, shape (2N, 2N, points)
    """
    stages, modes = kicks.size, coupling.shape[1]
    total = np.empty((modes, modes, h.size))
    force, again, weight = np.empty((modes, h.size)), np.empty((modes, h.size)), np.empty(h.size)
    for step in range(len(swings)):
        for stage in range(stages):
            _drift(drifts[stages if stage == 0 and step > 0 else stage], state, weight)
            _stiffness(coupling, compliance, epsilon, swings[step, stage], weight, total)
            for j in range(2 * modes):
                _apply(total, state, j, force)
                _scale(h, -kicks[stage], 1, weight)
                _add(state, j, weight, force)
                if 2 * stage == stages - 1:
                    _apply(total, force.reshape(modes, 1, h.size), 0, again)
                    _scale(h, commutator, 3, weight)
                    _add(state, j, weight, again)
    _drift(drifts[0], state, weight)


@njit(cache=True, error_model="numpy")
def _scale(h, factor, power, out):  # type: ignore[no-untyped-def]
    for k in range(h.size):
        out[k] = factor * h[k]
    for _ in range(power - 1):
        for k in range(h.size):
            out[k] *= h[k]


@njit(cache=True, error_model="numpy")
def _stiffness(coupling, compliance, epsilon, cosine, weight, total):  # type: ignore[no-untyped-def]
    for r in range(len(coupling)):
        soft = compliance[r]
        for k in range(weight.size):
            swing = epsilon[k] * cosine
            weight[k] = swing / (1.0 + soft[k] * swing)
        for i in range(len(total)):
            for n in range(len(total)):
                p, out = coupling[r, i, n], total[i, n]
                for k in range(weight.size):
                    out[k] = p[k] * weight[k] + (out[k] if r else 0.0)


@njit(cache=True, error_model="numpy")
def _apply(matrix, columns, j, out):  # type: ignore[no-untyped-def]
    for i in range(len(matrix)):
        total = out[i]
        for n in range(len(matrix)):
            c, q = matrix[i, n], columns[n, j]
            for k in range(c.size):
                total[k] = c[k] * q[k] + (total[k] if n else 0.0)


@njit(cache=True, error_model="numpy")
def _add(state, j, weight, term):  # type: ignore[no-untyped-def]
    for i in range(len(term)):
        p, f = state[len(term) + i, j], term[i]
        for k in range(weight.size):
            p[k] += weight[k] * f[k]


@njit(cache=True, error_model="numpy")
def _drift(m, state, moved):  # type: ignore[no-untyped-def]
    modes = m.shape[2]
    for i in range(modes):
        m00, m01, m10, m11 = m[0, 0, i], m[0, 1, i], m[1, 0, i], m[1, 1, i]
        for j in range(2 * modes):
            q, p = state[i, j], state[modes + i, j]
            for k in range(moved.size):
                moved[k] = m00[k] * q[k] + m01[k] * p[k]
                p[k] = m10[k] * q[k] + m11[k] * p[k]
            for k in range(moved.size):
                q[k] = moved[k]
