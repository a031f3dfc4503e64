"""Structure common to the rows of a uniform problem: parities, blocks, and the positions of the coefficients."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import accumulate, pairwise
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from cra_sym.cached import cached_property

from .straight import Exact

__all__ = ["TERMS", "Structure"]

TERMS = 4
"""Number of coefficients of polynomials in z."""


class Chain(NamedTuple):
    """Degrees of freedom by the change of their conditions in the chain from E = 0, w = 0 and no links, in this order.

    Attributes
    ----------
    same : list of int
    Unchanged.
    first : list of int
        Odd displacements, free at the start, get their final condition.
    bound : list of int
        Odd displacements coupled to others are held.
    following : list of int
        Displacements that are zero or tied to held ones get their final condition; the count does not change.
    last : list of int
        Held displacements get their final condition.
    lumped : list of int
        Coordinates that are not known to be zero are released, links are added.
    """

    same: list[int]
    first: list[int]
    bound: list[int]
    following: list[int]
    last: list[int]
    lumped: list[int]


@dataclass(frozen=True)
class Structure:
    """Structure common to the rows of a problem.

    The degrees of freedom (``places``) are, in order, the displacements of the left end (0 to n - 1), those of the
    right end (n to 2 n - 1), the lumped coordinates, and the forces of links (springs and masses on a combination of
    the others). Each has one condition.

    Attributes
    ----------
    odd : tuple of bool
        Which displacements of a section are odd under reflection.
    sizes : tuple of int
        Displacements that are coupled inside, block by block.
    coordinates, links : int
        How many lumped coordinates and links there are.
    linked : bool
        Whether conditions involve degrees of freedom beyond their own end.
    """

    odd: tuple[bool, ...]
    sizes: tuple[int, ...]
    coordinates: int = 0
    links: int = 0
    linked: bool = False

    @property
    def n(self) -> int:
        """Displacements of a section."""
        return len(self.odd)

    @property
    def moving(self) -> int:
        """Displacements of both ends, and coordinates."""
        return 2 * self.n + self.coordinates

    @property
    def places(self) -> int:
        """Number of degrees of freedom, forces of links included."""
        return self.moving + self.links

    @cached_property
    def blocks(self) -> tuple[tuple[int, int], ...]:
        """First displacement of each block, and the first that follows it."""
        ends = list(accumulate(self.sizes, initial=0))
        return tuple(pairwise(ends))

    @cached_property
    def turned(self) -> NDArray[np.float64]:
        """-1 for the odd displacements of the left end, whose sign changes under reflection, else 1."""
        return np.array([-1.0 if place < self.n and self.odd[place] else 1.0 for place in range(self.places)])

    def is_odd(self, place: int) -> bool:
        """Return whether a degree of freedom is an odd displacement."""
        return place < 2 * self.n and self.odd[place % self.n]

    def reach(self, place: int) -> range:
        """Return the degrees of freedom whose displacements may occur in a condition."""
        first = place - place % self.n
        return range(self.moving) if self.linked else range(first, first + self.n)

    def forces(self, place: int) -> tuple[int, ...]:
        """Return the degrees of freedom whose forces may occur in a condition."""
        return (*range(2 * self.n), *range(self.moving, self.places)) if self.linked else tuple(self.reach(place))

    @property
    def matrices(self) -> tuple[int, int]:
        """Start of the entries of both matrices among the coefficients."""
        return 0, 2 * self.n**2

    def condition(self, place: int) -> int:
        """Return the start of the factors of a condition: of displacements, of -z times these, and of forces."""
        return 4 * self.n**2 + place * (2 * len(self.reach(0)) + len(self.forces(0)))

    def own(self, place: int) -> int:
        """Return the position of the factor of its own displacement, or of its force for a link."""
        if place >= self.moving:
            return self.condition(place) + 2 * self.moving + self.forces(place).index(place)
        return self.condition(place) + self.reach(place).index(place)

    def table(self, displacement: int) -> int:
        """Return the start of the polynomials of the block whose first displacement this is."""
        return self.condition(self.places) + TERMS * displacement

    @property
    def coefficients(self) -> int:
        """Number of all coefficients."""
        return self.table(self.n)

    @property
    def order(self) -> tuple[int, ...]:
        """Order in which determinants are expanded: coordinates and links, then block by block, right end first.

        The determinants of weakly coupled coordinates and blocks are then factors, which separates nearly equal roots.
        """
        blocks = [
            place for start, stop in self.blocks for end in (self.n, 0) for place in range(end + start, end + stop)
        ]
        return *range(2 * self.n, self.places), *blocks

    def sign(self, order: Sequence[int]) -> float:
        """Return the sign that makes a determinant with its rows in another order positive below all roots."""
        n = self.n
        rank = [*range(n, 2 * n), *range(n), *range(2 * n, self.places)]
        ranked = [rank[place] for place in order]
        swaps = sum(a > b for at, a in enumerate(ranked) for b in ranked[at + 1 :])
        return -1.0 if (n + swaps) % 2 else 1.0

    def is_mass(self, entries: Sequence[Any], place: int) -> bool:
        """Return whether a degree of freedom is the force of a link that is a mass: its stiffness is known to be 0."""
        first = self.condition(place)
        return place >= self.moving and all(_is(entry, 0) for entry in entries[first : first + self.moving])

    # Known entries of the conditions -------------------------------------------------------------------

    def touched(self, entries: Sequence[Any], place: int) -> tuple[set[int], set[int]]:
        """Return the degrees of freedom whose displacements, and those whose forces, may occur in a condition."""
        reach, first = self.reach(place), self.condition(place)
        size = len(reach)
        moved = {e for j, e in enumerate(reach) if not all(_is(entries[first + k], 0) for k in (j, size + j))}
        return moved, {d for j, d in enumerate(self.forces(place)) if not _is(entries[first + 2 * size + j], 0)}

    def chain(self, entries: Sequence[Any]) -> Chain:
        """Return the order in which the conditions E = 0, w = 0 and no links are replaced by the actual ones."""
        same = [place for place in self.order if place < self.moving and self._is_reference(entries, place)]
        rest = [place for place in self.order if place not in same]
        bound = [place for place in rest if self.is_odd(place) and self._is_bound(entries, place)]
        first = [place for place in rest if self.is_odd(place) and place not in bound]
        held = [place for place in rest if place < self.moving and _is(entries[self.own(place)], 1)]
        following = [place for place in held if place not in first]
        last = [place for place in rest if place not in (*first, *following)]
        coordinates = [place for place in last if 2 * self.n <= place < self.moving]
        lumped = self._in_turn(entries, coordinates)
        return Chain(same, first, bound, following, [place for place in last if place not in lumped], lumped)

    def _in_turn(self, entries: Sequence[Any], coordinates: list[int]) -> list[int]:
        """Return coordinates and links in an order in which a rigid link always joins something that may move.

        Each coordinate is released after one of its links has been added, so that one without mass has a stiffness. If
        that link is rigid and joins held ones, the count is known again once the coordinate is released.
        """
        links = {link: self.touched(entries, link)[0] for link in range(self.moving, self.places)}
        found: list[int] = []
        for number, coordinate in enumerate([-1, *coordinates]):
            own = [link for link, moved in links.items() if not moved & {*coordinates[number:]} and link not in found]
            found += own if coordinate < 0 else [*own[:1], coordinate, *own[1:]]
        return found

    def block(self, place: int) -> int:
        """Return the number of the block of a displacement, -1 for coordinates and links."""
        inside = [number for number, (start, stop) in enumerate(self.blocks) if start <= place % self.n < stop]
        return inside[0] if place < 2 * self.n else -1

    def _is_reference(self, entries: Sequence[Any], place: int) -> bool:
        """Return whether a condition is known to be E = 0."""
        reach, first, forces = self.reach(place), self.condition(place), self.forces(place)
        one = 2 * len(reach) + forces.index(place) if self.is_odd(place) else reach.index(place)
        row = entries[first : first + 2 * len(reach) + len(forces)]
        return all(_is(entry, int(at == one)) for at, entry in enumerate(row))

    def _is_bound(self, entries: Sequence[Any], place: int) -> bool:
        """Return whether an odd displacement is coupled to another one while all even ones are held."""
        moved, forces = self.touched(entries, place)
        for other in self.reach(place):
            theirs, their_forces = self.touched(entries, other)
            if other == place:
                continue
            if other in forces or (place in theirs and _is(entries[self.own(other)], 1)):
                return True
            if self.is_odd(other) and (other in moved or place in theirs or place in their_forces):
                return True
        return False


def _is(entry: Any, value: int) -> bool:
    return isinstance(entry, Exact) and entry.value == value
