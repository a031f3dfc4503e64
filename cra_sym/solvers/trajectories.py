"""Motions integrated in time together; those that diverge do not affect the others."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import DOP853

__all__ = ["trajectories"]

Array = NDArray[np.float64]
Rate = Callable[[float, Array, Array, NDArray[np.intp]], Array]
"""Rates (2, motions, modes) of displacements and velocities at a time, for some of the motions, by number."""


def trajectories(rate: Rate, start: Array, times: Array, *, far: float, rtol: float, atol: float) -> Array:
    """Return displacements and velocities at times after 0, by the Runge-Kutta method of order eight.

    Parameters
    ----------
    rate : callable
    start : ndarray, shape (2, motions, modes)
        At time 0.
    times : ndarray
        Ascending, not negative.
    far : float
        Displacement beyond which a motion diverges.
    rtol, atol : float
        Tolerances.

    Returns
    -------
    ndarray, shape (2, motions, modes, times)
        nan after a displacement exceeds ``far``, or where no step is short enough.
    """
    found = np.full((*start.shape, times.size), np.nan)
    kept, begin, state = np.arange(start.shape[1]), 0.0, start
    found[..., times == 0.0] = start[..., None]

    def flat(time: float, y: Array) -> Array:
        q, u = y.reshape(2, kept.size, -1)
        return rate(time, q, u, kept).ravel()

    while kept.size:
        run, good = DOP853(flat, begin, state.ravel(), times[-1], rtol=rtol, atol=atol), np.ones(kept.size, bool)
        while run.status == "running" and good.all():
            run.step()
            state = run.y.reshape(2, kept.size, -1)
            good = np.abs(state[0]).max(axis=1) <= far
            passed = np.flatnonzero((times > begin) & (times <= run.t))
            if passed.size and run.status != "failed":
                part = found[:, kept]
                part[..., passed] = run.dense_output()(times[passed]).reshape(*state.shape, -1)
                found[:, kept] = part
            begin = run.t
        if run.status == "failed":  # no step is short enough for the fastest
            good[np.abs(state[1]).max(axis=1).argmax()] = False
        elif good.all():
            break
        kept, state = kept[good], state[:, good]
    return found
