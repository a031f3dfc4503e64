"""What a model returns besides plain arrays."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

__all__ = ["Damped", "Modes"]


@dataclass(frozen=True, eq=False)
class Damped:
    """Complex eigenvalues s of motions ``exp(s t)``, mode axis last, by ascending ``|s|``.

    Refined roots of the exact characteristic function; that none is missing is not promised.
    """

    eigenvalues: np.ndarray

    @property
    def damping_ratio(self) -> np.ndarray:
        """``-Re s / |s|``."""
        size = np.abs(self.eigenvalues)
        return -self.eigenvalues.real / np.where(size > 0.0, size, 1.0)

    @property
    def frequency(self) -> np.ndarray:
        """``|Im s| / (2 pi)``, of the decaying oscillation, in Hz."""
        return np.abs(self.eigenvalues.imag) / (2.0 * np.pi)


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
