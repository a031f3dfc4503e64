"""Uniform problems with up to three waves a section: their data."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import combinations
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cra_sym.cached import cached_property

from .straight import Exact
from .waves_kernel import total
from .waves_structure import TERMS, Structure

__all__ = ["Floats", "Integers", "UniformProblem", "dispersion", "ranks"]

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]

_DEPENDENT = 1e-14  # norm below which the remainder of a unit row counts as dependent
_MOST = 3  # displacements that are coupled inside


@dataclass(frozen=True)
class UniformProblem:
    """Problems of motions ``cos(omega t)`` with ``z = omega^2``, constant along x and even under ``x -> -x``.

    The state of a section has n displacements q and their natural forces P (positive at the right end). Displacement i
    and its force are partners ``E[i]`` and ``O[i]``: of a displacement that is even under reflection ``E[i] = q_i`` and
    ``O[i] = P_i``, of an odd one ``E[i] = P_i`` and ``O[i] = q_i``. Then ``O' = A_OE E`` and ``E' = A_EO O``.

    Parameters
    ----------
    length : ndarray, shape (rows,)
        In (0, inf).
    odd_by_even, even_by_odd : ndarray, shape (2, rows, n, n)
        A_OE and A_EO: the part without z, and the factor of z.
    stiffness, mass : ndarray, shape (rows, dofs)
        Of the conditions of the left end, of the right end, of the m lumped coordinates and of links, in the units of P
        over those of q: ``P + (k - z m) q = 0`` at the right end, ``-P + (k - z m) q = 0`` at the left, and
        ``(k - z m) w = 0``. Stiffness in [0, inf], inf holds the displacement; masses in [0, inf).
    odd : tuple of bool
        Which displacements are odd; at least one of each block must be even.
    couplings : ndarray, shape (2, rows, 2 n + m, 2 n + m), optional
        Off-diagonal entries of stiffness and mass. Both matrices must be positive semidefinite. A mass on a lever arm
        is better a link: its matrix would cancel the digits of smaller masses.
    ties : ndarray, shape (rows, 2 n + m, 2 n + m), optional
        A dependent displacement i is ``sum_j ties[row, i, j] q_j`` of independent ones, whose stiffness, mass and
        couplings include its own. Which displacements may be tied must be `known`.
    sizes : tuple of int, optional
        Displacements that the matrices couple, block by block in order, 1 to 3 each. Default: one block of all.
    known : tuple of (0, 1 or None), optional
        Coefficients, as `Structure` orders them, that are 0 or 1 in all rows: formulas for them are shorter.
    coordinates : int
        m.
    linked : bool
        Whether couplings or ties join the ends; with coordinates or links they always may.
    stretches : ndarray, shape (rows, links, 2 n + m), optional
        Stretch of each link per unit of each displacement and coordinate. A link is a spring or a mass; the stiffness
        of one that is a mass must be `known` to be 0.
    """

    length: Floats
    odd_by_even: Floats
    even_by_odd: Floats
    stiffness: Floats
    mass: Floats
    odd: tuple[bool, ...] = (False, True)
    couplings: Floats | None = None
    ties: Floats | None = None
    sizes: tuple[int, ...] | None = None
    known: tuple[int | None, ...] | None = None
    coordinates: int = 0
    linked: bool = False
    stretches: Floats | None = None

    def __post_init__(self) -> None:
        rows, n, structure = len(self.length), self.odd_by_even.shape[-1], self.structure
        moving, places = 2 * n + self.coordinates, 2 * n + self.coordinates + structure.links
        shapes: dict[str, tuple[int, ...]] = {"odd_by_even": (2, rows, n, n), "even_by_odd": (2, rows, n, n)}
        shapes |= {"stiffness": (rows, places), "mass": (rows, places), "stretches": (rows, structure.links, moving)}
        shapes |= {"couplings": (2, rows, moving, moving), "ties": (rows, moving, moving)}
        for name, shape in shapes.items():
            value = getattr(self, name)
            if value is not None and value.shape != shape:
                raise ValueError(f"{name}: the shape {value.shape} must be {shape}")
        if len(self.odd) != n:
            raise ValueError(f"odd = {self.odd}: must tell of each of {n} displacements whether it is odd")
        if sum(structure.sizes) != n or not all(1 <= size <= _MOST for size in structure.sizes):
            raise ValueError(f"sizes = {self.sizes}: the sum must be {n}, each 1 to {_MOST}")
        if self.known is None and (self.ties is not None or self.mass[:, moving:].any()):
            raise ValueError("known = None: must be given with ties and with links that are masses")
        for start, stop in self.structure.blocks:
            if all(self.odd[start:stop]):
                raise ValueError(f"odd = {self.odd}: not all displacements of a block must be odd")

    @cached_property
    def structure(self) -> Structure:
        """The structure common to all rows."""
        links = 0 if self.stretches is None else self.stretches.shape[1]
        linked = self.linked or self.coordinates > 0 or links > 0
        return Structure(tuple(self.odd), self.sizes or (len(self.odd),), self.coordinates, links, linked)

    def without_idle_links(self) -> UniformProblem:
        """Return the problem without rigid links between displacements that are held already."""
        size = self.structure.moving
        rigid = np.isinf(self.stiffness[:, size:])
        if self.stretches is None or not rigid.any():
            return self
        rows = np.flatnonzero(rigid.any(axis=1))
        movable = np.where(np.isinf(self.stiffness[rows, :size])[:, None], 0.0, self.stretches[rows])
        held = np.where(rigid[rows, :, None], movable, 0.0)
        stiffness = self.stiffness.copy()
        for link in range(held.shape[1]):
            idle = rigid[rows, link] & (ranks(held[:, : link + 1]) == ranks(held[:, :link]))
            stiffness[rows[idle], size + link] = 0.0
        return replace(self, stiffness=stiffness)

    def take(self, rows: Integers | slice) -> UniformProblem:
        """Return the problem of some of the parameter sets."""
        parts = {name: getattr(self, name)[:, rows] for name in ("odd_by_even", "even_by_odd")}
        parts |= {name: getattr(self, name)[rows] for name in ("length", "stiffness", "mass")}
        couplings = None if self.couplings is None else self.couplings[:, rows]
        ties, stretches = (None if part is None else part[rows] for part in (self.ties, self.stretches))
        return replace(self, couplings=couplings, ties=ties, stretches=stretches, **parts)

    def springs_and_masses(self, rows: Integers | slice = slice(None)) -> tuple[Floats, Floats]:
        """Return the factors of displacements and of -z times these in all conditions, (rows, 2 n + m, 2 n + m) each.

        Links are left out. The condition of a held displacement is that it is zero.
        """
        size = self.structure.moving
        stiffness, mass = self.stiffness[rows, :size], self.mass[rows, :size]
        held, unit = np.isinf(stiffness)[:, :, None], np.eye(size)
        springs, masses = np.where(held[..., 0], 1.0, stiffness)[:, :, None] * unit, mass[:, :, None] * unit
        if self.couplings is not None:
            springs, masses = springs + self.couplings[0, rows], masses + self.couplings[1, rows]
        ties = 0.0 if self.ties is None else self.ties[rows]
        return np.where(held, unit - ties, springs), np.where(held, 0.0, masses)

    @cached_property
    def varying(self) -> list[int]:
        """Which coefficients are not known."""
        return [
            place for place, value in enumerate(self.known or [None] * self.structure.coefficients) if value is None
        ]

    @np.errstate(invalid="ignore")
    def coefficients(self, *, dispersion: bool = True) -> Floats:
        """Return the coefficients that vary, as `Structure` orders them, shape (varying, rows).

        Matrices times half the length, end conditions, polynomials of the dispersion relation: zeros instead of the
        latter without ``dispersion``, as the value of the determinant does not depend on them.
        """
        structure, n, half = self.structure, len(self.odd), 0.5 * self.length
        matrices = self.odd_by_even, self.even_by_odd
        given = half, *matrices, self.stiffness, self.mass, self.couplings, self.ties, self.stretches
        kind = np.result_type(*(value for value in given if value is not None))
        k = np.zeros((len(self.varying), len(self.length)), dtype=kind)
        row = {place: k[at] for at, place in enumerate(self.varying)}
        for at in range(4 * n * n):
            if at in row:
                (which, power), (i, j) = divmod(at // (n * n), 2), divmod(at % (n * n), n)
                np.multiply(matrices[which][power, :, i, j], half, out=row[at])
        for place in range(structure.places):
            if any(at in row for at in range(structure.condition(place), structure.condition(place + 1))):
                self._enter_condition(row, place)
        if dispersion:
            self._enter_dispersion(row)
        return k

    def all_coefficients(self) -> Floats:
        """Return all coefficients, including the known ones."""
        return replace(self, known=(None,) * self.structure.coefficients).coefficients()

    def _enter_condition(self, row: dict[int, Floats], place: int) -> None:
        """Enter the factors of a condition over 1 + k + m, with the signs of `waves_count.end_rows`."""
        structure, turned = self.structure, self.structure.turned
        stiffness, mass = self.stiffness[:, place], self.mass[:, place]
        held, link = np.isinf(stiffness), place - structure.moving
        some, share = held.any(), 1.0 / (1.0 + stiffness + mass)
        reach, first = structure.reach(place), structure.condition(place)
        for j, other in enumerate(reach):
            sign, unit = turned[place] * turned[other], 1.0 if other == place else 0.0
            if link >= 0 and first + j in row:
                assert self.stretches is not None
                row[first + j][:] = np.where(held, -1.0, -stiffness * share) * self.stretches[:, link, other] * sign
            if link >= 0 and first + len(reach) + j in row:
                assert self.stretches is not None
                row[first + len(reach) + j][:] = -mass * share * self.stretches[:, link, other] * sign
            if link >= 0:
                continue
            tie = 0.0 if self.ties is None or link >= 0 else self.ties[:, place, other]
            for part, own in ((0, stiffness), (1, mass)):
                at = first + part * len(reach) + j
                if at in row and link < 0:
                    value = own * share if other == place else 0.0
                    if self.couplings is not None:
                        value = value + self.couplings[part, :, place, other] * (share * sign)
                    row[at][:] = np.where(held, (unit - tie) * sign if part == 0 else 0.0, value) if some else value
        for j, other in enumerate(structure.forces(place), start=first + 2 * len(reach)):
            if j in row:
                row[j][:] = share * self._force(place, other) * (turned[place] * turned[other])

    def _force(self, place: int, other: int) -> Floats | float:
        """Return the factor of a force in the condition of a degree of freedom: its displacement per unit of that."""
        link, moving = other - self.structure.moving, self.structure.moving
        if place >= moving or link < 0:
            tie = 0.0 if self.ties is None or max(place, other) >= moving else self.ties[:, other, place]
            return (1.0 if place == other else 0.0) + tie
        assert self.stretches is not None
        return self.stretches[:, link, place]

    def _enter_dispersion(self, row: dict[int, Floats]) -> None:
        entries = [row.get(place, Exact(0)) for place in range(self.structure.condition(0))]
        for place, value in dispersion(self.structure, entries):
            if place in row:
                row[place][:] = 0.0 if isinstance(value, Exact) else value


def dispersion(structure: Structure, entries: Sequence[Any]) -> Iterator[tuple[int, Any]]:
    """Yield the coefficients of the dispersion relation, with their numbers, from those of the matrices."""
    n = structure.n
    for start, stop in structure.blocks:
        a, b = (
            [
                [[entries[first + shift + n * i + j] for shift in (0, n * n)] for j in range(start, stop)]
                for i in range(start, stop)
            ]
            for first in structure.matrices
        )
        for order in range(1, stop - start + 1):
            yield from enumerate(_symmetric(b, a, order)[:TERMS], start=structure.table(start + order - 1))


Polynomial = list[Any]


def _times(first: Polynomial, second: Polynomial) -> Polynomial:
    found: Polynomial = [Exact(0)] * (len(first) + len(second) - 1)
    for i, one in enumerate(first):
        for j, other in enumerate(second):
            found[i + j] = found[i + j] + one * other
    return found


def _minor(matrix: list[list[Polynomial]], rows: tuple[int, ...], columns: tuple[int, ...]) -> Polynomial:
    if len(rows) == 1:
        return matrix[rows[0]][columns[0]]
    terms = []
    for at, column in enumerate(columns):
        rest = _minor(matrix, rows[1:], columns[:at] + columns[at + 1 :])
        term = _times(matrix[rows[0]][column], rest)
        terms.append(term if at % 2 == 0 else [-value for value in term])
    return [total(powers) for powers in zip(*terms, strict=True)]


def _symmetric(b: list[list[Polynomial]], a: list[list[Polynomial]], order: int) -> Polynomial:
    """Return an elementary symmetric function of the eigenvalues of ``b a`` (Cauchy and Binet), a polynomial in z."""
    sets = list(combinations(range(len(a)), order))
    terms = [_times(_minor(b, one, other), _minor(a, other, one)) for one in sets for other in sets]
    return [total(powers) for powers in zip(*terms, strict=True)]


def ranks(matrix: Floats) -> Integers:
    """Return the rank of each matrix of a stack with few columns, by elimination with rows of unit size."""
    rest = matrix.copy()
    rank = np.zeros(len(rest), dtype=np.int64)
    every = np.arange(len(rest))
    for _ in range(min(matrix.shape[1:])):
        size = np.abs(rest).max(axis=2)
        rest = rest / np.where(size > 0.0, size, 1.0)[:, :, None]
        best = np.abs(rest).max(axis=1).argmax(axis=1)
        pivot_row = np.abs(rest[every, :, best]).argmax(axis=1)
        pivot = rest[every, pivot_row, best]
        rank += pivot != 0.0
        factor = rest[every, :, best] / np.where(pivot == 0.0, 1.0, pivot)[:, None]
        rest = rest - factor[:, :, None] * rest[every, pivot_row][:, None, :]
        rest = np.where(np.abs(rest) < _DEPENDENT, 0.0, rest)
    return rank
