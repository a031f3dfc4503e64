"""Modes of the arm by shooting with power series: the numerical second route of many checks.

Nothing here comes from a derivation: the end conditions are written by hand and the fundamental solutions are Taylor
series, independent of the derived trigonometric forms.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from math import factorial
from typing import Any

import numpy as np
from numpy.polynomial.legendre import leggauss

__all__ = ["ShotMode", "integrate", "sample", "shoot"]

_ORDERS = np.arange(28)
_FACTORIAL = np.array([float(factorial(n)) for n in range(4 * 28 + 4)])


def sample(seed: int, *, k_t: float | None = None, k_r: float | None = None) -> dict[str, float]:
    """Return random parameters of an arm, all of order one, by symbol name."""
    rng = np.random.default_rng(seed)
    names = ("L", "E", "I_z", "rho", "A", "m_b", "m_e", "J_e", "k_t", "k_r")
    values = dict(zip(names, rng.uniform(0.5, 1.5, len(names)), strict=True))
    values["m_e"] *= 0.3
    values["J_e"] *= 0.02
    values["k_t"] *= 50.0
    values["k_r"] *= 3.0
    return values | {name: value for name, value in (("k_t", k_t), ("k_r", k_r)) if value is not None}


@dataclass(frozen=True)
class ShotMode:
    """A mode as the initial values ``(phi, phi', phi'', phi''')`` at the root."""

    omega: float
    beta: float
    start: np.ndarray

    def __call__(self, x: float | np.ndarray, derivative: int = 0) -> np.ndarray:
        """Return the mode shape, or a derivative of it, at ``x``."""
        found: np.ndarray = np.sum(
            [value * _krylov(self.beta, x, k, derivative) for k, value in enumerate(self.start)], axis=0
        )
        return found


def _krylov(beta: Any, x: Any, k: int, derivative: int) -> np.ndarray:
    """Solution of the field equation whose k-th derivative is 1 and the other three are 0 at x = 0."""
    power = 4 * _ORDERS + k - derivative
    kept = power >= 0
    power, order = power[kept], 4 * _ORDERS[kept]
    beta, x = np.asarray(beta, dtype=float)[..., None], np.asarray(x, dtype=float)[..., None]
    found: np.ndarray = np.sum(beta**order * x**power / _FACTORIAL[power], axis=-1)
    return found


def shoot(values: dict[str, float], modes: int = 3) -> list[ShotMode]:
    """Return the lowest modes of the arm with the given parameters (joint stiffness finite and not zero)."""
    return list(_shoot(tuple(sorted(values.items())), modes))


@cache
def _shoot(items: tuple[tuple[str, float], ...], modes: int) -> tuple[ShotMode, ...]:
    values = dict(items)
    bending, line_mass, length = values["E"] * values["I_z"], values["rho"] * values["A"], values["L"]
    starts = np.array([[1.0, 0.0, 0.0, -values["k_t"] / bending], [0.0, 1.0, values["k_r"] / bending, 0.0]])
    starts /= np.abs(starts).max(axis=1, keepdims=True)
    speed = np.sqrt(bending / line_mass)

    def tip(beta: Any) -> np.ndarray:
        """Rows: moment and force conditions at the tip; columns: the two solutions that satisfy the conditions at the
        root."""
        square = (np.asarray(beta) ** 2 * speed) ** 2
        columns = []
        for start in starts:
            phi, slope, curvature, third = (ShotMode(0.0, beta, start)(length, k) for k in range(4))
            moment = bending * curvature - square * values["J_e"] * slope
            columns.append(np.stack([moment, bending * third + square * values["m_e"] * phi], axis=-1))
        return np.stack(columns, axis=-1)

    def residual(beta: Any) -> Any:
        return np.linalg.det(tip(beta))

    from scipy.optimize import brentq  # takes longer to import than the rest of this package

    grid = np.linspace(0.05, 12.0, 240) / length
    crossings = np.flatnonzero(np.diff(np.sign(residual(grid))))[:modes]
    found = []
    for k in crossings:
        beta = brentq(residual, grid[k], grid[k + 1], xtol=1e-15, rtol=1e-14)
        weights = np.linalg.svd(tip(beta))[2][-1]
        found.append(ShotMode(beta**2 * speed, beta, weights @ starts))
    return tuple(found)


def integrate(function: Callable[[np.ndarray], Any], length: float, points: int = 40) -> float:
    """Return the integral over (0, length) by Gauss-Legendre quadrature."""
    nodes, weights = leggauss(points)
    return float(0.5 * length * np.sum(weights * function(0.5 * length * (nodes + 1.0))))
