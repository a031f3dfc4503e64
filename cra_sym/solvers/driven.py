"""Steady vibration of a dynamic stiffness that is driven at one of its coordinates."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from .shapes import states
from .stiffness import DynamicStiffness

__all__ = ["driven_states"]

_MOST_LEVELS = 22  # four million pieces


def driven_states(
    problem: DynamicStiffness,
    parameter: NDArray[np.generic],
    row: NDArray[np.intp],
    share: NDArray[np.float64],
    place: int,
    kind: str,
) -> NDArray[np.generic]:
    """Return the state (q, w, P) for a unit force on, or a unit motion of, one coordinate.

    Parameters
    ----------
    problem : DynamicStiffness
    parameter : ndarray, shape (members,)
        z or s, real or complex.
    row : ndarray of int, shape (members,)
        Parameter set of each.
    share : ndarray, shape (members, stations)
        Distance from the left end in lengths.
    place : int
        Position in the order (q(left), w, q(right)).
    kind : {'force', 'motion'}

    Returns
    -------
    ndarray, shape (members, stations, 2 n + m)
        Infinite where a resonance is met to the last digit.

    Raises
    ------
    ValueError
        If the waves are too short, or an infinite stiffness holds the driven coordinate.
    """
    levels = problem.levels(parameter, row)
    if levels.max(initial=0) > _MOST_LEVELS:
        raise ValueError("angular_frequency: the waves must not be shorter than a millionth of the domain")
    here = problem.evaluate(parameter, row, keep_tree=True, levels=levels)
    if not np.isfinite(here.matrix).all():
        raise ValueError("values: they lead beyond the range of double precision")
    assert here.tree is not None
    drive = here.tree.scale[:, place, None] * here.unit[:, place, :]
    if (drive == 0.0).all(axis=1).any():
        raise ValueError("drive: an infinite stiffness holds it still")
    drive = drive.astype(here.matrix.dtype)
    u = here.solve(drive) if kind == "force" else _moved(here.matrix, drive)
    return states(problem, here, u, parameter, row, share)


def _moved(matrix: NDArray[np.generic], drive: NDArray[np.generic]) -> NDArray[np.generic]:
    """Return u for drive' u = 1 without other forces, by a bordered system, which is regular at antiresonances."""
    members, size = drive.shape
    largest = np.abs(drive).max(axis=1, keepdims=True)
    bordered = np.zeros((members, size + 1, size + 1), dtype=matrix.dtype)
    bordered[:, :size, :size] = matrix
    bordered[:, :size, size] = bordered[:, size, :size] = drive / largest
    load = np.zeros((members, size + 1, 1), dtype=matrix.dtype)
    load[:, size, 0] = 1.0 / largest[:, 0]
    singular = np.linalg.det(bordered) == 0
    bordered[singular] = np.eye(size + 1)
    load[singular] = np.inf
    return np.linalg.solve(bordered, load)[:, :size, 0]
