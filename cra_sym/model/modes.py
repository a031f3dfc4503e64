"""What a model returns besides plain arrays."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

__all__ = ["Modes"]


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
