"""Contribution of the omitted modes to a receptance, analytic up to the next natural frequency."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

__all__ = ["moments", "nodes", "remainder"]

Array = NDArray[np.float64]
_FARTHEST, _NEAREST, _NUMBER = -0.6, -0.03, 16
"""Nodes in z over the next squared frequency: on the negative axis, where the stiffness is positive definite and far
from singular. The interpolation error is about (1.6 / 9.1)^16 = 1e-12 at z = 0, by the ellipse through the nearest
pole."""


def nodes(limit: Array) -> Array:
    """Return the nodes z = omega^2 at which a receptance has to be evaluated, shape (rows, nodes).

    Parameters
    ----------
    limit : ndarray, shape (rows,)
        Square of the first natural frequency that is left out.
    """
    angles = np.cos(np.pi * (np.arange(_NUMBER) + 0.5) / _NUMBER)
    return limit[:, None] * (0.5 * (_FARTHEST + _NEAREST) + 0.5 * (_NEAREST - _FARTHEST) * angles)


def remainder(values: Array, squares: Array, residues: Array, limit: Array) -> Callable[[NDArray[Any]], Array]:
    """Return the receptance minus that of the first modes, as a function of z for small z.

    Parameters
    ----------
    values : ndarray, shape (rows, nodes, ...)
        ``sum over all modes of residue / (omega^2 - z)`` at the nodes.
    squares : ndarray, shape (rows, modes)
        omega^2 of the first modes.
    residues : ndarray, shape (rows, modes, ...)
    limit : ndarray, shape (rows,)

    Returns
    -------
    callable
        Takes z of shape (rows, points), real or complex, |z| a small part of the limit; returns (rows, points, ...).
    """
    coefficients, centre, half = _coefficients(values, squares, residues, limit)

    def at(z: NDArray[Any]) -> Array:
        place = (np.asarray(z) / limit[:, None] - centre) / half
        basis = np.moveaxis(np.polynomial.chebyshev.chebvander(place, _NUMBER - 1), -1, 1)
        return np.asarray(np.einsum("rnp,rn...->rp...", basis, coefficients))

    return at


def moments(values: Array, squares: Array, residues: Array, limit: Array) -> tuple[Array, Array]:
    """Return the sums of residue / omega^2 and of residue / omega^4 over the modes beyond the first ones.

    Parameters and shapes are those of `remainder`; the sums have the shape (rows, ...).
    """
    coefficients, centre, half = _coefficients(values, squares, residues, limit)
    place, inner = -centre / half, half
    value = np.polynomial.chebyshev.chebval(place, np.moveaxis(coefficients, 1, 0))
    slope = np.polynomial.chebyshev.chebval(place, np.polynomial.chebyshev.chebder(np.moveaxis(coefficients, 1, 0)))
    scale = (limit * inner).reshape(-1, *(1,) * (value.ndim - 1))
    return np.asarray(value), np.asarray(slope / scale)


def _coefficients(values: Array, squares: Array, residues: Array, limit: Array) -> tuple[Array, float, float]:
    """Return Chebyshev coefficients of the remainder, shape (rows, nodes, ...), and the interval."""
    gap = squares[:, None, :] - nodes(limit)[:, :, None]
    left = values - np.einsum("rnm,rm...->rn...", 1.0 / gap, residues)
    angles = np.pi * (np.arange(_NUMBER) + 0.5) / _NUMBER
    transform = np.cos(np.arange(_NUMBER)[:, None] * angles) * (2.0 / _NUMBER)
    transform[0] /= 2.0
    centre, half = 0.5 * (_FARTHEST + _NEAREST), 0.5 * (_NEAREST - _FARTHEST)
    return np.einsum("kn,rn...->rk...", transform, left), centre, half
