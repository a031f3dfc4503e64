"""Spatial problem given by its energies: the input of Ritz's method on the stresses."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Self

import numpy as np
from numpy.typing import NDArray

from .stress_mesh import VariationBounds

__all__ = ["Continuum", "Entries", "PointTerm", "compliance"]

Array = NDArray[np.float64]
Entries = Mapping[tuple[int, int], Array]
Coefficients = Callable[[Array, NDArray[np.intp]], dict[str, Entries]]


@dataclass(frozen=True)
class PointTerm:
    """Springs and masses at a breakpoint.

    Attributes
    ----------
    node : int
        Number of the breakpoint among the edges.
    directions, springs : ndarray, shape (rows, springs, n + m), (rows, springs)
        Each spring, which may be infinite, acts on ``directions @ (q, w)``.
    mass : ndarray, shape (rows, n + m, n + m)
    """

    node: int
    directions: Array
    springs: Array
    mass: Array

    def take(self, rows: NDArray[np.intp]) -> PointTerm:
        """Return the terms of some of the parameter sets."""
        return PointTerm(self.node, self.directions[rows], self.springs[rows], self.mass[rows])


@dataclass(frozen=True)
class Continuum:
    """A spatial problem by its energies, batched over rows (parameter sets).

    With the highest derivatives h of the fields and the displacements s = (q, w) of a section and of the lumped
    coordinates, twice the potential energy per length is ``e' W e + 2 e' D s + s' R s``, with the strains
    ``e = h + B s``; twice the kinetic energy is ``z s' M s``.

    Attributes
    ----------
    orders : tuple of int
        Order of the highest derivative of each field.
    lumped : int
        Number of lumped coordinates m.
    coefficients : callable
        ``coefficients(x, rows)`` with x of shape (len(rows), points): 'W', 'B', 'D', 'R' and 'M' by entry, each entry
        broadcasting to the shape of x. Missing entries are zero; of symmetric matrices the upper half is given.
    edges : ndarray, shape (rows, spans + 1)
        Left end, breakpoints, right end.
    directions, springs : ndarray, shape (rows, springs, 2 n + m), (rows, springs)
        Each spring, which may be infinite, acts on ``directions @ (q(left), w, q(right))``.
    end_mass : ndarray, shape (rows, 2 n + m, 2 n + m)
    origin : int
        The end from which displacements are integrated, 0 or 1: not one at which a stiffness vanishes.
    points : tuple of PointTerm
        Springs and masses at breakpoints.
    variation : VariationBounds, optional
        Bounds of the variation of the coefficients; None for polynomials.
    """

    orders: tuple[int, ...]
    lumped: int
    coefficients: Coefficients
    edges: Array
    directions: Array
    springs: Array
    end_mass: Array
    origin: int = 0
    points: tuple[PointTerm, ...] = ()
    variation: VariationBounds | None = None

    @property
    def displacements(self) -> int:
        """Displacements of a section, n."""
        return sum(self.orders)

    def take(self, rows: NDArray[np.intp]) -> Self:
        """Return the problem of some of the parameter sets."""
        return replace(
            self,
            coefficients=lambda x, index: self.coefficients(x, rows[index]),
            edges=self.edges[rows],
            directions=self.directions[rows],
            springs=self.springs[rows],
            end_mass=self.end_mass[rows],
            points=tuple(point.take(rows) for point in self.points),
            variation=None if self.variation is None else self.variation.take(rows),
        )

    def acts_at(self, end: int, place: int) -> NDArray[np.bool_]:
        """Return in which rows springs, conditions or masses act on a displacement of the left (0) or right (1) end."""
        k = end * (self.displacements + self.lumped) + place
        sprung = ((self.directions[..., k] != 0.0) & (self.springs != 0.0)).any(axis=1)
        acts: NDArray[np.bool_] = sprung | (self.end_mass[:, k] != 0.0).any(axis=1)
        return acts

    def tops(self) -> list[int]:
        """Return the position of the highest displacement of each field in a section."""
        return [sum(self.orders[: k + 1]) - 1 for k in range(len(self.orders))]

    def sample(self, strained: bool) -> Callable[[Array], Array]:
        """Return all coefficients as one array: compliances, or stiffnesses where the strain is expanded."""
        rows = np.arange(len(self.edges))

        def values(x: Array) -> Array:
            found = self.coefficients(x, rows)
            parts = [found["W"]] if strained else [compliance(found["W"], len(self.orders))]
            parts += [found[name] for name in "BDRM"]
            entries = [entry for part in parts for entry in part.values()] or [np.zeros(())]  # lumped coordinates alone
            return np.stack([np.broadcast_to(entry, x.shape) for entry in entries])

        return values


def compliance(stiffness: Entries, size: int) -> Entries:
    """Return the inverse of a symmetric matrix given by entries, upper half."""
    if all(i == j for i, j in stiffness):
        with np.errstate(divide="ignore"):
            return {pair: 1.0 / entry for pair, entry in stiffness.items()}
    matrix = np.zeros((*np.broadcast_shapes(*(np.shape(e) for e in stiffness.values())), size, size))
    for (i, j), entry in stiffness.items():
        matrix[..., i, j] = matrix[..., j, i] = entry
    inverse = np.linalg.inv(matrix)
    return {(i, j): inverse[..., i, j] for i in range(size) for j in range(i, size) if np.any(inverse[..., i, j])}
