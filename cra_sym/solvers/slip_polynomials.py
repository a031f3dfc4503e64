"""Polynomial forces on modes with elastic-slip elements, as Taylor series over a step by Cauchy products.

The coefficient of each power of time follows from those of lower ones, so that a step is as exact as one of linear
modes; its length is limited so that the last terms of the series are rounding.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

__all__ = ["ForceSeries", "Polynomial", "polynomial_forces", "polynomial_potential", "reach"]

Array = NDArray[np.float64]
_ROUNDING = 1e-16
_PASSES = 60


class Polynomial(NamedTuple):
    """A force that is homogeneous in modal displacements and velocities, on the right of the equations.

    Attributes
    ----------
    tensor : ndarray, shape (N,) * (1 + positions + velocities) + (P,)
        Its first axis is that of the equations, then those of displacements, then those of velocities.
    positions, velocities : int
    conservative : bool
        Whether it has a potential.
    """

    tensor: Array
    positions: int
    velocities: int
    conservative: bool

    def of(self, members: NDArray[np.intp]) -> Polynomial:
        """Return the force on some members."""
        return self._replace(tensor=self.tensor[..., members])

    def at(self, q: Array, u: Array) -> Array:
        """Return the force (N, P) at displacements and velocities (N, P)."""
        found = self.tensor
        for vector in [u] * self.velocities + [q] * self.positions:
            found = np.einsum("...np,np->...p", found, vector)
        return found


def polynomial_forces(terms: Sequence[Polynomial], q: Array, u: Array) -> Array:
    """Return the sum of forces at displacements and velocities (N, P)."""
    return sum((term.at(q, u) for term in terms), np.zeros_like(q))


def polynomial_potential(terms: Sequence[Polynomial], q: Array) -> Array:
    """Return the potential, shape (P,), of the forces that have one."""
    parts = (-(q * term.at(q, q)).sum(axis=0) / (term.positions + 1) for term in terms if term.conservative)
    return sum(parts, np.zeros(q.shape[1]))


class ForceSeries:
    """The series of forces in powers of the time over the span, one coefficient after the other.

    Parameters
    ----------
    terms : sequence of Polynomial
    length : int
        Number of coefficients.
    span : ndarray, shape (P,)
    """

    def __init__(self, terms: Sequence[Polynomial], length: int, span: Array) -> None:
        self._terms, self._span = terms, np.where(span > 0, span, 1.0)
        self._products = [
            [np.zeros((length, *term.tensor.shape[: -1 - k], span.size)) for k in range(1, term.tensor.ndim - 1)]
            for term in terms
        ]

    def coefficient(self, k: int, q: Array) -> Array:
        """Return coefficient k of the sum, (N, P), from the coefficients (k + 2, N, P) of the displacements."""
        u = q[1 : k + 2] * np.arange(1.0, k + 2)[:, None, None] / self._span
        total = np.zeros_like(q[0])
        for term, products in zip(self._terms, self._products, strict=True):
            before: Array | None = None
            vectors = [u] * term.velocities + [q[: k + 1]] * term.positions
            for series, vector in zip(products, vectors, strict=True):
                if before is None:
                    series[k] = np.einsum("...np,np->...p", term.tensor, vector[k])
                else:
                    series[k] = np.einsum("k...np,knp->...p", before[: k + 1], vector[::-1])
                before = series
            total += products[-1][k]
        return np.asarray(total)


def reach(series: Array) -> Array:
    """Return the share of a span, at most 1, up to which the last terms of series (K, N, P) are rounding."""
    size, power = np.abs(series).max(axis=1), np.arange(len(series))[:, None]
    found = np.ones(size.shape[1])
    with np.errstate(all="ignore"):
        for _ in range(_PASSES):  # the largest term is another for shorter steps
            largest = (size * found**power).max(axis=0)
            shorter = np.where(size[-2:] > 0, (_ROUNDING * largest / size[-2:]) ** (1.0 / power[-2:]), 1.0).min(axis=0)
            if not (shorter < found * (1 - 1e-3)).any():
                break
            found = np.minimum(found, shorter)
    return np.where(np.isfinite(size).all(axis=0), found, np.nan)
