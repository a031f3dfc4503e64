"""Sums over all modes from statics: what the modes that are left out contribute at low frequencies."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from .stiffness import DynamicStiffness

__all__ = ["static_moments"]

Array = NDArray[np.float64]
_ROUNDING = 1e-13  # of the balanced stiffness: some hundred rounding errors


def static_moments(problem: DynamicStiffness, places: list[int]) -> tuple[Array, Array]:
    """Return the sums over all elastic modes of q_s q_r / omega^2 and q_s q_r / omega^4 at some coordinates.

    They are the first two terms of the power series in omega^2 of the receptance: C = K^-1 and C M C, with stiffness K
    and mass M of the static deflections. Where rigid-body motions leave K singular they have no part in them: K is
    inverted on its range and the deflections are made to have no momentum in those motions.

    Parameters
    ----------
    problem : DynamicStiffness
        With the parameter omega^2.
    places : list of int
        Coordinates in the order (q(left), w, q(right)).

    Returns
    -------
    second, fourth : ndarray, shape (rows, places, places)
        Exact where no rigid-body motion moves the coordinates.
    """
    rows = len(problem.length)
    here = problem.evaluate(np.zeros(rows), np.arange(rows), keep_tree=True)
    assert here.tree is not None
    load = here.tree.scale[:, places, None] * here.unit[:, places, :]  # (rows, places, free)
    value, vector = np.linalg.eigh(here.matrix)
    rigid = np.abs(value) <= _ROUNDING * np.abs(value).max(axis=-1, keepdims=True)
    inverse = np.where(rigid, 0.0, 1.0 / np.where(rigid, 1.0, value))
    shares = load @ vector
    moved = (shares * inverse[:, None, :]) @ vector.swapaxes(-1, -2)
    second = moved @ load.swapaxes(-1, -2)
    mass = -here.derivative
    still = vector * rigid[:, None, :]  # rigid-body motions, other columns zero
    momentum = moved @ mass @ still
    inertia = still.swapaxes(-1, -2) @ mass @ still + np.eye(value.shape[-1]) * ~rigid[:, None, :]
    moved = moved - np.linalg.solve(inertia, momentum.swapaxes(-1, -2)).swapaxes(-1, -2) @ still.swapaxes(-1, -2)
    return second, moved @ mass @ moved.swapaxes(-1, -2)
