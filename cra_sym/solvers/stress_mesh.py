"""Two meshes along x: quadrature pieces on which every coefficient is a polynomial to rounding, and basis elements.

Pieces are stated in a reference coordinate: the i-th span between neighbouring breakpoints is (i, i + 1). Parameter
sets whose breakpoints differ then share a mesh.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

__all__ = ["Grid", "Mesh", "Rule", "Sampler", "TooFineError", "VariationBounds", "cells", "places", "resolved", "rule"]

Array = NDArray[np.float64]
Sampler = Callable[[Array], Array]
"""Coefficients at places of shape (sets, points), as an array of shape (coefficients, sets, points)."""


@dataclass(frozen=True)
class VariationBounds:
    """Bounds of the variation of coefficients between their samples.

    Attributes
    ----------
    exponents : callable
        ``exponents(x, *parameters)``: exponents e of functions such as exp(e) or cos(e).
    columns : ndarray, shape (parameters, sets)
    decaying : int
        Number of exponents, the first ones, of functions that are constant where e is below -745.
    """

    exponents: Callable[..., Sequence[Any]]
    columns: Array
    decaying: int

    def take(self, rows: NDArray[np.intp]) -> VariationBounds:
        """Return the bounds of some of the parameter sets."""
        return replace(self, columns=self.columns[:, rows])

    def _at(self, x: NDArray[np.floating]) -> Array:
        with np.errstate(all="ignore"):
            exponents = self.exponents(x, *self.columns[..., None, None])
        return np.stack([np.broadcast_to(np.asarray(exponent, dtype=float), x.shape) for exponent in exponents])

    def resolved(self, x: Array) -> NDArray[np.bool_]:
        """Return whether the samples resolve the change of every exponent, (functions, sets, pieces).

        Parameters
        ----------
        x : ndarray, shape (sets, pieces, samples)
        """
        found = self._at(x)
        if np.isnan(found).any():  # exp(800 x) / (1 + exp(800 x)) is bounded
            found = self._at(x.astype(np.longdouble))
        found = np.clip(found, -1e300, 1e300)  # the logarithm of what overflows is infinite
        swing = np.ptp(found, axis=-1)
        gone = found.max(axis=-1) + swing / 8.0 < UNDERFLOW  # an exponent has no detail finer than an eighth
        good: NDArray[np.bool_] = swing <= SWING
        good[: self.decaying] |= gone[: self.decaying]
        return good


SWING = 48.0
"""Largest change of an exponent on a piece that 69 samples resolve."""
UNDERFLOW = -745.0
"""Exponent from which exp underflows."""

NODES = 32
"""Gauss points of the test of resolution: on a piece a coefficient must be a polynomial of that degree."""
TAIL = 1e-11
"""Relative size of the higher-degree part of a resolved coefficient. Gauss's rule integrates twice that degree, so the
error of an integral is far smaller; sin(1e3 x) itself is accurate only to this many digits."""
SPECK = 2e-16
"""Largest share of the integral of a coefficient on a piece that is left unresolved."""
SINGULAR = 1e-9
"""Share of the integral of a coefficient on a piece of no width from which on it counts as infinite there."""
ROUNDING = 8 * np.finfo(float).eps
"""The same relative to the largest value: a coefficient near a zero has no more digits."""
MOST_PIECES = 8000


class TooFineError(ValueError):
    """Coefficients that vary too finely to be resolved; ``sets`` is the number of parameter sets treated together."""

    def __init__(self, message: str, sets: int) -> None:
        super().__init__(message)
        self.sets = sets


@dataclass(frozen=True)
class Rule:
    """Gauss's rule on (-1, 1) with the matrices that go with it.

    Attributes
    ----------
    points, weights : ndarray, shape (G,)
    integral : ndarray, shape (G, G)
        Row i: integral from -1 to point i, exact for polynomials below degree G.
    spectrum : ndarray, shape (G, G)
        From values to Legendre coefficients.
    """

    points: Array
    weights: Array
    integral: Array
    spectrum: Array


@lru_cache
def rule(number: int) -> Rule:
    """Return Gauss's rule with that many points."""
    points, weights = np.polynomial.legendre.leggauss(number)
    table = np.polynomial.legendre.legvander(points, number)  # P_0 .. P_number at the points
    degree = np.arange(number)
    spectrum = (degree[:, None] + 0.5) * (weights[:, None] * table[:, :number]).T
    below = np.concatenate([-np.ones((number, 1)), table[:, : number - 1]], axis=1)  # P_(k-1); -1 for k = 0
    antiderivative = (table[:, 1:] - below) / (2 * degree + 1)
    return Rule(points, weights, antiderivative @ spectrum, spectrum)


@dataclass(frozen=True)
class Mesh:
    """Pieces and elements in the reference coordinate.

    Attributes
    ----------
    pieces : ndarray, shape (Q + 1,)
        Ends of the quadrature pieces; whole numbers are breakpoints.
    elements : ndarray, shape (E + 1,)
        Ends of the basis elements, some of the ends of the pieces.
    degree : int
        Highest degree of the Legendre functions on an element.
    strained : ndarray of bool, shape (E,)
        Elements on which the strain is expanded instead of the stress, since a stiffness vanishes at one end.
    smoothness : int
        Degree of the polynomials that the coefficients are on every piece.
    singular : tuple of bool
        Whether a stiffness vanishes at the left and at the right end.
    """

    pieces: Array
    elements: Array
    degree: int
    strained: NDArray[np.bool_]
    smoothness: int = NODES - 1
    singular: tuple[bool, bool] = (False, False)

    @property
    def owner(self) -> NDArray[np.intp]:
        """The element of each piece."""
        middle = 0.5 * (self.pieces[1:] + self.pieces[:-1])
        return np.searchsorted(self.elements, middle) - 1

    @property
    def points(self) -> int:
        """Gauss points of a piece, for the integrals of products of two displacements."""
        share = float((np.diff(self.pieces) / np.diff(self.elements)[self.owner]).max())
        swing = np.arccos(max(1.0 - 2.0 * share, -1.0)) / np.pi  # share of the oscillations of a Legendre function
        oscillations = self.degree if share > 0.99 else min(self.degree, int(np.ceil(self.degree * swing)) + 8)
        return oscillations + (self.smoothness + 1) // 2 + 4

    def split(self, marked: NDArray[np.bool_]) -> Mesh:
        """Return the mesh with some elements split, with half of their pieces, or of breakpoints, on each side.

        Pieces are small where the coefficients vary fast.
        """
        left, right = self.elements[:-1], self.elements[1:]
        middle = 0.5 * (left + right)
        middle = np.where(right - left > 1.5, np.round(middle), middle)
        starts = np.searchsorted(self.pieces, self.elements)
        pieces = self.pieces[(starts[:-1] + starts[1:]) // 2]
        middle = np.where((right - left < 1.5) & (np.diff(starts) > 1), pieces, middle)
        inner = middle[marked]
        elements = np.union1d(self.elements, inner)
        parents = np.searchsorted(self.elements, 0.5 * (elements[1:] + elements[:-1])) - 1
        return replace(self, elements=elements, pieces=np.union1d(self.pieces, inner), strained=self.strained[parents])


@dataclass(frozen=True)
class Grid:
    """A mesh in physical coordinates: shape (sets, ...), or one set if all are equal.

    Attributes
    ----------
    x : ndarray, shape (sets, Q, G)
    half : ndarray, shape (sets, Q)
        Half the length of each piece.
    local : ndarray, shape (sets, Q, G)
        Coordinate of each point in its element, -1 to 1.
    ends : ndarray, shape (sets, Q + 1)
    """

    x: Array
    half: Array
    local: Array
    ends: Array

    @classmethod
    def of(cls, mesh: Mesh, edges: Array, points: int) -> Grid:
        """Return the places of a mesh between breakpoints of shape (sets, spans + 1)."""
        ends, bounds = places(mesh.pieces, edges), places(mesh.elements, edges)
        half = 0.5 * np.diff(ends, axis=1)
        x = ends[:, :-1, None] + half[..., None] * (1.0 + rule(points).points)
        left, right = bounds[:, :-1][:, mesh.owner], bounds[:, 1:][:, mesh.owner]
        local = ((x - left[..., None]) - (right[..., None] - x)) / (right - left)[..., None]
        shares = (ends - ends[:, :1]) / (ends[:, -1:] - ends[:, :1])
        if len(local) > 1 and np.ptp(shares, axis=0).max() < 1e-14:  # invariant under scaling of the length
            local = local[:1]
        return cls(x, half, local, ends)


def places(reference: Array, edges: Array) -> Array:
    """Return the physical places of reference coordinates, shape (sets, len(reference))."""
    span = np.minimum(reference.astype(int), edges.shape[1] - 2)
    share = reference - span
    left, right = edges[:, span], edges[:, span + 1]
    found: Array = np.where(share < 0.5, left + share * (right - left), right - (1.0 - share) * (right - left))
    return found


def resolved(
    sample: Sampler, edges: Array, pieces: Array, what: str, variation: VariationBounds | None = None
) -> tuple[Array, Array, int]:
    """Return pieces that resolve every coefficient, the relative unresolved part (sets,), and the highest degree.

    Parameters
    ----------
    sample : callable
    edges : ndarray, shape (sets, spans + 1)
    pieces : ndarray, shape (Q + 1,)
        Initial pieces, in the reference coordinate.
    what : str
        What the coefficients are, for errors.
    variation : VariationBounds, optional
        By default coefficients have no detail that the initial pieces do not resolve.

    Raises
    ------
    TooFineError
        If some piece is still unresolved with 8000 pieces.

    Notes
    -----
    A piece is resolved if the last of 32 Legendre coefficients vanish, the polynomial agrees with the coefficient
    between the points, and the coefficient cannot vary between these. A piece with a jump is halved until it is
    negligible.
    """
    gauss = rule(NODES)
    off = np.linspace(-0.987, 0.983, 37)
    table = np.polynomial.legendre.legvander(off, NODES - 1) @ gauss.spectrum
    total = peak = np.zeros(0)
    unresolved, degree = np.zeros(len(edges)), 0
    done: list[Array] = []
    todo = np.stack([pieces[:-1], pieces[1:]], axis=1)
    most = MOST_PIECES + len(pieces)
    while len(todo):
        ends = np.stack([places(todo[:, k], edges) for k in (0, 1)], axis=-1)  # (sets, Q, 2)
        half = 0.5 * (ends[..., 1] - ends[..., 0])
        at = ends[..., :1] + half[..., None] * (1.0 + np.concatenate([gauss.points, off]))
        values = sample(at.reshape(len(edges), -1)).reshape(-1, *at.shape)
        _refuse(~np.isfinite(values), at)
        known, beyond = values[..., :NODES], values[..., NODES:]
        size = np.abs(values).max(axis=-1)
        peak = np.maximum(peak, size.max(axis=-1, keepdims=True)) if total.size else size.max(axis=-1, keepdims=True)
        if not total.size:  # integrals of the magnitudes, from the first sweep
            total = (np.abs(known) @ gauss.weights * half).sum(axis=-1, keepdims=True)
        series = np.abs(known @ gauss.spectrum.T)
        error = np.maximum(series[..., -2:].sum(axis=-1), np.abs(known @ table.T - beyond).max(axis=-1))
        # x itself is rounded, which limits the accuracy of a steep coefficient
        steep = 2.0 * ROUNDING * np.abs(ends).max(axis=-1) / (2.0 * half) * np.ptp(values, axis=-1)
        allowed = TAIL * size + ROUNDING * peak + steep
        smooth = error <= allowed
        rough = error > allowed - steep
        mass = size * half
        speck = mass <= SPECK * total
        total = np.maximum(total, mass.max(axis=-1, keepdims=True))
        good = (smooth | speck).all(axis=(0, 1))
        if variation is not None:
            good &= variation.resolved(at).all(axis=(0, 1))
        share = np.where(smooth, 0.0, mass / np.where(total > 0.0, total, 1.0))
        narrow = todo[:, 1] - todo[:, 0] <= 4 * np.spacing(todo[:, 1])
        good |= narrow
        _refuse(rough & (narrow | (steep > 1e-3 * size)) & (mass > SINGULAR * total), at[..., 0])
        unresolved += share[:, :, good].max(axis=0).sum(axis=1)
        done.append(todo[good])
        large = (series[:, :, good] > allowed[:, :, good, None]).any(axis=(0, 1, 2))
        degree = max(degree, int(np.max(np.nonzero(large)[0], initial=0)))
        todo = todo[~good]
        if sum(map(len, done)) + 2 * len(todo) > most:
            piece = places(todo[:1].ravel(), edges[:1])[0]
            raise TooFineError(
                f"{what} vary too finely along x to be resolved, at x = {piece[0]:.6g} to {piece[1]:.6g}: "
                f"{most} pieces do not suffice; relative error there {error[..., ~good].max():.1g}",
                len(edges),
            )
        middle = todo.mean(axis=1, keepdims=True)
        todo = np.concatenate([np.hstack([todo[:, :1], middle]), np.hstack([middle, todo[:, 1:]])])
    return np.unique(np.concatenate(done)), unresolved, degree


def _refuse(bad: NDArray[np.bool_], at: Array) -> None:
    """Raise where a coefficient is infinite, or has an integral on a piece without width."""
    if bad.any():
        place = np.argwhere(bad)[0]
        raise ValueError(
            f"values: they make a stiffness zero or a coefficient infinite at x = {at[tuple(place[1:])]:.6g}"
        )


def cells(edges: int, most: int) -> Array:
    """Return the ends of basis elements: one element for each span, or for groups of neighbours if there are many."""
    return np.unique(np.round(np.linspace(0.0, edges, min(edges, most) + 1)))
