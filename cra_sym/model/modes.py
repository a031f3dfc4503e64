"""What a model returns besides plain arrays."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

__all__ = ["Modes", "tip_sign"]


@dataclass(frozen=True, eq=False)
class Modes:
    """Mass-normalised modes, mode axis last (before the section's displacements).

    Attributes
    ----------
    omega : ndarray, shape (..., modes)
        rad/s.
    left, right : ndarray, shape (..., modes, n)
        Displacements of the end sections: fields in order, each with its lower derivatives.
    left_force, right_force : ndarray, shape (..., modes, n)
        Natural forces P conjugate to them.
    coordinate : ndarray, shape (..., modes, m)
        Share of each lumped coordinate.
    """

    omega: np.ndarray
    left: np.ndarray
    right: np.ndarray
    left_force: np.ndarray
    right_force: np.ndarray
    coordinate: np.ndarray

    @property
    def frequency(self) -> np.ndarray:
        """Hz."""
        return self.omega / (2.0 * np.pi)


def tip_sign(tip: np.ndarray) -> np.ndarray:
    """Return the sign that makes the first tip displacement which is not zero positive, shape (..., 1)."""
    scale = np.abs(tip).max(axis=-2, keepdims=True)
    moving = np.abs(tip) > 1e-7 * np.where(scale > 0.0, scale, 1.0)
    first = np.take_along_axis(tip, moving.argmax(axis=-1)[..., None], axis=-1)
    return np.where(first < 0.0, -1.0, 1.0)
