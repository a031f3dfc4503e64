r"""Elastic-slip elements in parallel, distributed over the displacement at which they slip: closed forms.

A distribution is a sum of pieces of stiffness per slip displacement, ``factor phi**exponent`` from ``start`` to
``stop``, and of single elements. For one element of stiffness k that slips at phi, under a harmonic motion of
amplitude a, the in-phase first harmonic of the force is that of a stiffness k g(phi / a), with

.. math:: g(s) = (\theta - \cos\theta\sin\theta)/\pi, \quad \cos\theta = 1 - 2s, \quad s < 1,

and the energy lost in a cycle is 4 k phi (a - phi).
"""

from __future__ import annotations

import itertools
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.special import beta, betainc

__all__ = ["Distribution", "Piece"]

Array = NDArray[np.float64]
_POINTS, _WEIGHTS = np.polynomial.legendre.leggauss(16)
_DECADES = 3.0
"""Decades below the largest slip displacement that are divided into intervals of constant ratio."""
_CENTRED = ((1.0,), (1.0, -0.5), (1.0, -1.0, 0.25), (1.0, -1.5, 0.75, -0.125))  # powers of t - 1/2


class Piece(NamedTuple):
    """Stiffness per slip displacement for start < phi < stop: a sum of ``factor phi**exponent``.

    Attributes
    ----------
    terms : tuple of (factor, exponent)
    start, stop : ndarray
        All arrays of one shape (...).
    """

    terms: tuple[tuple[Array, Array], ...]
    start: Array
    stop: Array

    def moment(self, order: int, until: Array) -> Array:
        """Return the integral of phi^order times the density from the start to a displacement, at most to the stop."""
        end = np.clip(until, self.start, self.stop)
        total = np.zeros(np.shape(end))
        for factor, exponent in self.terms:
            power = exponent + order + 1.0
            total = total + factor * (end**power - self.start**power) / power
        return total


class Distribution(NamedTuple):
    """Elements in parallel.

    Attributes
    ----------
    pieces : tuple of Piece
    single : tuple of (stiffness, slip displacement)
        Arrays (...).
    """

    pieces: tuple[Piece, ...]
    single: tuple[tuple[Array, Array], ...]

    @classmethod
    def of_lines(cls, displacements: Array, densities: Array) -> Distribution:
        """Return the distribution whose density is linear between points, both of shape (points,)."""
        pieces = []
        for k in range(len(displacements) - 1):
            start, stop = displacements[k : k + 2]
            slope = (densities[k + 1] - densities[k]) / (stop - start)
            terms = ((densities[k] - slope * start, np.asarray(0.0)), (slope, np.asarray(1.0)))
            if densities[k] or densities[k + 1]:
                pieces.append(Piece(terms, np.asarray(start), np.asarray(stop)))
        return cls(tuple(pieces), ())

    def _moments(self, until: Array) -> tuple[Array, Array, Array]:
        """Return the moments 0, 1, 2 of the elements that slip before a displacement."""
        total = []
        for order in range(3):
            parts = [piece.moment(order, until) for piece in self.pieces]
            parts += [np.where(phi < until, k * phi**order, 0.0) for k, phi in self.single]
            total.append(np.asarray(sum(parts)))
        return total[0], total[1], total[2]

    @property
    def stiffness(self) -> Array:
        """Stiffness with all elements stuck."""
        return self._moments(np.asarray(np.inf))[0]

    @property
    def slip(self) -> Array:
        """Force when all elements slip."""
        return self._moments(np.asarray(np.inf))[1]

    def force(self, displacement: Array) -> Array:
        """Return the force on first loading from rest to a displacement."""
        size = np.abs(displacement)
        slipped, first, _ = self._moments(size)
        return np.asarray(np.sign(displacement) * (first + size * (self.stiffness - slipped)))

    def loss(self, amplitude: Array) -> Array:
        """Return the energy lost in a cycle."""
        _, first, second = self._moments(amplitude)
        return np.asarray(4.0 * (amplitude * first - second))

    def equivalent(self, amplitude: Array) -> Array:
        """Return the stiffness with the same first harmonic of the force that is in phase with the displacement."""
        total = np.zeros(np.shape(amplitude))
        with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
            for k, phi in self.single:
                total = total + k * _share(phi / amplitude)
            for piece in self.pieces:
                total = total + self._of_piece(piece, amplitude)
        return np.asarray(np.where(amplitude > 0, total, self.stiffness))

    def _of_piece(self, piece: Piece, amplitude: Array) -> Array:
        """Return the integral of the density times g; integrated by parts it is an incomplete beta function."""
        ends = [np.clip(np.minimum(end, amplitude), piece.start, piece.stop) for end in (piece.start, piece.stop)]
        shares = [np.minimum(end / amplitude, 1.0) for end in ends]
        total = piece.moment(0, piece.stop) - piece.moment(0, ends[1])
        for factor, exponent in piece.terms:
            power = exponent + 1.0
            whole = [_share(share) * end**power for share, end in zip(shares, ends, strict=True)]
            a = power + 1.5
            bent = 8.0 / np.pi * beta(a, 1.5) * (betainc(a, 1.5, shares[1]) - betainc(a, 1.5, shares[0]))
            total = total + factor / power * (whole[1] - whole[0] - amplitude**power * bent)
        return np.asarray(total)

    def elements(self, number: int) -> tuple[Array, Array]:
        """Return stiffness and slip force of single elements, shape (..., about number).

        Each piece is divided into intervals of constant ratio over the last decades, and each interval is represented
        by two elements with the same first four moments. Stiffness and slip force of the whole are exact, and the
        relative error of the loss falls with the square of the number.
        """
        found = [(np.asarray(k), np.asarray(k * phi)) for k, phi in self.single]
        each = max(1, (number - len(self.single)) // (2 * max(len(self.pieces), 1)))
        for piece in self.pieces:
            found += [pair for start, stop in _intervals(piece, each) for pair in _two_elements(piece, start, stop)]
        stiffness, slip = (np.stack(np.broadcast_arrays(*part), axis=-1) for part in zip(*found, strict=True))
        return stiffness, slip


def _share(s: Array) -> Array:
    """Return g(s), 1 where an element sticks."""
    s = np.clip(s, 0.0, 1.0)
    theta = 2.0 * np.arcsin(np.sqrt(s))  # cos theta = 1 - 2 s; for small s the difference is a series
    exact = theta - np.sin(theta) * np.cos(theta)
    series = 2.0 / 3.0 * theta**3 * (1.0 - theta**2 / 5.0 + 2.0 * theta**4 / 105.0 - theta**6 / 945.0)
    return np.asarray(np.where(theta < 0.1, series, exact) / np.pi)


def _intervals(piece: Piece, number: int) -> list[tuple[Array, Array]]:
    lowest = np.maximum(piece.start, piece.stop * 10.0**-_DECADES)
    shares = np.linspace(0.0, 1.0, number + 1) if number > 1 else np.array([0.0, 1.0])
    edges = [lowest * (piece.stop / lowest) ** share for share in shares]
    edges[0], edges[-1] = piece.start, piece.stop
    return list(itertools.pairwise(edges))


def _two_elements(piece: Piece, start: Array, stop: Array) -> list[tuple[Array, Array]]:
    """Return two elements with the moments 0 to 3 of an interval: a Gauss rule with the density as its weight."""
    middle, half = 0.5 * (start + stop), 0.5 * (stop - start)
    from_zero = start == 0.0
    place = np.multiply.outer(half, _POINTS)
    phi = np.where(from_zero[..., None], 1.0, middle[..., None] + place)
    density = sum(factor[..., None] * phi ** exponent[..., None] for factor, exponent in piece.terms)
    smooth = np.asarray(density) * _WEIGHTS * half[..., None]
    moments = []
    for order, powers in enumerate(_CENTRED):
        # from zero on: int_0^stop phi^exponent (phi - middle)^order, the bracket expanded with phi = stop t
        singular = sum(
            factor * stop ** (exponent + 1 + order) * sum(c / (exponent + 1 + order - j) for j, c in enumerate(powers))
            for factor, exponent in piece.terms
        )
        moments.append(np.where(from_zero, singular, (smooth * place**order).sum(axis=-1)))
    m0, m1, m2, m3 = moments
    determinant = m0 * m2 - m1**2
    b, c = (m1 * m2 - m0 * m3) / determinant, (m1 * m3 - m2**2) / determinant
    root = np.sqrt(np.maximum(0.25 * b**2 - c, 0.0))
    places = -0.5 * b - root, -0.5 * b + root
    weights = (m1 - places[1] * m0) / (places[0] - places[1]), (m1 - places[0] * m0) / (places[1] - places[0])
    return [(w, w * (middle + p)) for w, p in zip(weights, places, strict=True)]
