"""Input shapers: impulses that make a move leave no vibration of a known mode behind."""

from __future__ import annotations

from math import comb
from typing import Any

import numpy as np

from cra_sym.checks import broadcastable, count, default_floating_point, real_array

__all__ = ["input_shaper"]

_MOST_IMPULSES = 50


@default_floating_point
def input_shaper(angular_frequency: Any, zeta: Any = 0.0, order: int = 1) -> tuple[np.ndarray, np.ndarray]:
    """Return amplitudes and times of the zero-vibration shaper of a mode, for :meth:`BaseMotion.shaped`.

    Two impulses half a damped period apart cancel each other's vibration: (1, K)/(1 + K) with K = exp(-pi zeta /
    sqrt(1 - zeta^2)) (ZV). Applied ``order`` times it also zeroes the first ``order - 1`` derivatives of the residual
    vibration by the mode's frequency, at the price of half a period each: 2 is ZVD, 3 is ZVDD (Singer and
    Seering, 1990).

    Parameters
    ----------
    angular_frequency : array_like
        omega of the mode, rad/s; positive. Arrays are a batch.
    zeta : array_like
        Damping ratio, in [0, 1).
    order : int
        1 to 50.

    Returns
    -------
    amplitudes, times : ndarray, shape (..., order + 1)
        Amplitudes add up to 1; times in s.

    Raises
    ------
    TypeError, ValueError
        If an argument is out of its range or shapes do not broadcast together.

    Examples
    --------
    >>> import numpy as np
    >>> amplitudes, times = input_shaper(2 * np.pi, order=2)
    >>> print(amplitudes, times)
    [0.25 0.5  0.25] [0.  0.5 1. ]
    """
    omega = real_array("angular_frequency", angular_frequency, low=1e-300, unit="rad/s")
    ratio = real_array("zeta", zeta, low=0.0, high=np.nextafter(1.0, 0.0), unit="1", must="real numbers in [0, 1)")
    broadcastable(angular_frequency=omega, zeta=ratio)
    order = count("order", order, high=_MOST_IMPULSES)
    root = np.sqrt(1 - ratio**2)
    decay = np.exp(-np.pi * ratio / root)[..., None]
    steps = np.arange(order + 1)
    amplitudes = np.array([comb(order, k) for k in steps]) * decay**steps / (1 + decay) ** order
    times = (np.pi / (omega * root))[..., None] * steps
    amplitudes, times = np.broadcast_arrays(amplitudes, times)
    return amplitudes, times
