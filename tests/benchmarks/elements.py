"""What one would write without a frequency equation: Hermite beam elements, a dense eigensolution for each arm."""

from __future__ import annotations

import numpy as np
from scipy.linalg import eigh


def parameters(kappa_t: float, kappa_r: float, mu: float, modes: int, elements: int) -> np.ndarray:
    """Return lambda of the first modes; unit length, mass and bending stiffness."""
    h = 1 / elements
    k = np.array([[12, 6 * h, -12, 6 * h], [6 * h, 4 * h**2, -6 * h, 2 * h**2], [-12, -6 * h, 12, -6 * h],
                  [6 * h, 2 * h**2, -6 * h, 4 * h**2]]) / h**3  # fmt: skip
    m = np.array([[156, 22 * h, 54, -13 * h], [22 * h, 4 * h**2, 13 * h, -3 * h**2], [54, 13 * h, 156, -22 * h],
                  [-13 * h, -3 * h**2, -22 * h, 4 * h**2]]) * h / 420  # fmt: skip
    stiffness, mass = np.zeros((2, 2 * elements + 2, 2 * elements + 2))
    for e in range(elements):
        part = slice(2 * e, 2 * e + 4)
        stiffness[part, part] += k
        mass[part, part] += m
    stiffness[0, 0] += kappa_t
    stiffness[1, 1] += kappa_r
    mass[-2, -2] += mu
    squares = eigh(stiffness, mass, eigvals_only=True, subset_by_index=(0, modes - 1))
    return np.maximum(squares, 0.0) ** 0.25
