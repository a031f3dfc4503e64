"""A linear problem with coefficients that are constant between places along x, for proofs in exact arithmetic."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from itertools import pairwise
from typing import TYPE_CHECKING, Any

from cra_sym.model.exact import ExactKernel, ExactMatrix
from cra_sym.model.projection import EndParameter
from cra_sym.solvers.ball_spans import EnergyTerm, Node, Span, Spanned
from cra_sym.solvers.certificates import precision

if TYPE_CHECKING:
    from cra_sym.model.numerics import Numerics

__all__ = ["BallLayout", "BallProblem", "BoundProblem", "Pattern", "bound"]

Number = Callable[[int], Any]
Pattern = tuple[tuple[tuple[int, ...], ...], tuple[tuple[int, ...], ...]]
"""For each cut the numbers of the terms inside that act there; for each span the signs of the switches."""
_LARGE_PRIME = 2**2203 - 1


def rational_pi(flint: Any) -> Any:
    """Return a fraction near pi that solves no algebraic equation with shorter coefficients, as pi solves none."""
    with precision(flint, 2300):
        return flint.fmpq((flint.arb.pi() * _LARGE_PRIME).floor().unique_fmpz(), _LARGE_PRIME)


@dataclass(frozen=True)
class BallLayout:
    """Where the coefficients change along x.

    Attributes
    ----------
    ends, points : ExactKernel
        Of the parameters: the ends of the domain; the places of terms inside.
    switches : ExactKernel
        Of the parameters: value at x = 0 and slope of each expression with whose sign the coefficients change.
    """

    ends: ExactKernel
    points: ExactKernel
    switches: ExactKernel

    def candidates(self, number: Number, pi: Any, values: Sequence[Any]) -> tuple[list[Any], list[tuple[Any, Any]]]:
        """Return all places at which something may act or change, nan where there is none, and the switches."""
        points, found = self.points(number, pi, *values), self.switches(number, pi, *values)
        pairs = list(zip(found[::2], found[1::2], strict=True))
        return [*points, *(math.nan if slope == 0 else -value / slope for value, slope in pairs)], pairs

    def cuts(self, number: Number, pi: Any, values: Sequence[Any]) -> tuple[tuple[int, ...], Pattern]:
        """Return for exact numbers which candidates are the ends of spans, and what acts and holds there.

        Raises
        ------
        ValueError
            If a term acts at an end or outside of the domain.
        """
        left, right = self.ends(number, pi, *values)
        places, pairs = self.candidates(number, pi, values)
        acting = len(places) - len(pairs)
        for place in places[:acting]:
            if not left < place < right:
                where = int(place.numerator) / int(place.denominator)
                raise ValueError(f"inside: a place must be in the domain, not at x = {where:g}")
        first: dict[Any, int] = {}
        for k, place in enumerate(places):
            if place is not math.nan and left < place < right:
                first.setdefault(place, k)
        inner = sorted(first)
        edges = [left, *inner, right]
        middles = [(a + b) / 2 for a, b in pairwise(edges)]
        nodes = tuple(tuple(k for k in range(acting) if places[k] == cut) for cut in inner)
        signs = tuple(tuple(1 if value + slope * x > 0 else -1 for value, slope in pairs) for x in middles)
        return tuple(first[cut] for cut in inner), (nodes, signs)


@dataclass(frozen=True)
class BallProblem:
    """A problem as functions of the parameters in exact arithmetic.

    Attributes
    ----------
    displacements, coordinates : int
        n and m.
    jets : tuple of ((int, int), (int, int))
        Fields and orders of the two displacements of each term of the energy density.
    orders : tuple of int
        Highest order of each field.
    systems, energies : tuple
        For each span A, and stiffness, coefficient of the velocity and mass of each term of the energy density.
    nodes : tuple of (tuple of ExactMatrix, tuple of int)
        What acts, and what is held, between the spans.
    boundary : ExactMatrix
    free : ExactKernel
        The entries of the matrix of free motions.
    squared, conservative, gyroscopic, dissipative : bool
        Whether the parameter is z = omega^2 and not s; whether all forces have a potential; whether there are forces of
        first order in time too, which do no work, or are those of dampers.
    """

    displacements: int
    coordinates: int
    jets: tuple[tuple[tuple[int, int], tuple[int, int]], ...]
    orders: tuple[int, ...]
    systems: tuple[ExactMatrix, ...]
    energies: tuple[ExactKernel, ...]
    nodes: tuple[tuple[tuple[ExactMatrix, ...], tuple[int, ...]], ...]
    boundary: ExactMatrix
    free: ExactKernel
    squared: bool
    conservative: bool
    gyroscopic: bool
    dissipative: bool

    def spanned(
        self, number: Number, pi: Any, values: Sequence[Any], places: Sequence[Any], fixed: Sequence[int]
    ) -> Spanned:
        """Return the problem in an arithmetic.

        Parameters
        ----------
        number : callable
            Makes a number of the arithmetic of an integer.
        pi : number
        values : sequence
            Of the parameters.
        places : sequence
            Ends of the spans.
        fixed : sequence of int
            Displacements of the ends that are held by infinite stiffness.
        """
        size = 2 * self.displacements + self.coordinates
        gaps = [tuple(self.orders[f] - o for f, o in zip(*jet, strict=True)) for jet in self.jets]
        spans = []
        for k, (system, energy) in enumerate(zip(self.systems, self.energies, strict=True)):
            entries = energy(number, pi, *values)
            terms = [
                EnergyTerm(fields, (gap[0], gap[1]), *entries[3 * i : 3 * i + 3])
                for i, ((fields, _), gap) in enumerate(zip(self.jets, gaps, strict=True))
            ]
            spans.append(Span(system(number, pi, *values), places[k + 1] - places[k], terms))
        nodes = [Node([one(number, pi, *values) for one in forces], held) for forces, held in self.nodes]
        free = _free_columns(self.free(number, pi, *values), size, fixed)
        boundary = self.boundary(number, pi, *values)
        return Spanned(self.displacements, self.coordinates, spans, nodes, boundary, free)


@dataclass(frozen=True)
class BoundProblem:
    """A problem at one set of values.

    Attributes
    ----------
    problem : BallProblem
    balls : callable
        Returns it in balls of the working precision.
    exact : Spanned
        The same in fractions.
    """

    problem: BallProblem
    balls: Callable[[], Spanned]
    exact: Spanned


def bound(
    flint: Any, numerics: Numerics, held: Mapping[str, EndParameter], values: Mapping[str, float], damped: bool
) -> BoundProblem:
    """Return the problem of one set of values; infinite stiffnesses hold their displacement.

    Parameters
    ----------
    flint : module
    numerics : Numerics
        Of the model.
    held : mapping
        The parameters that may be infinite.
    values : mapping of str to float
        In the order of the model's symbols.
    damped : bool
        Whether dampers are part of the problem.

    Raises
    ------
    ValueError
        If the coefficients vary between the places, or something is infinite that must not be.
    """
    finite = [0.0 if math.isinf(value) else value for value in values.values()]
    layout: BallLayout = numerics("ball_layout", damped)
    fractions = flint.fmpq, rational_pi(flint), [flint.fmpq(*value.as_integer_ratio()) for value in finite]
    sources, pattern = layout.cuts(*fractions)
    problem: BallProblem = numerics("ball_problem", damped, pattern)
    n, m = problem.displacements, problem.coordinates
    fixed = []
    for name in (name for name, value in values.items() if math.isinf(value)):
        if name not in held:
            raise ValueError(
                f"{name} = inf: only the stiffness of an end may be infinite ({', '.join(held) or 'none'})"
            )
        end, place, _ = held[name]
        fixed.append(place if end == 0 else n + m + place)

    def made(number: Number, pi: Any, numbers: Sequence[Any]) -> Spanned:
        left, right = layout.ends(number, pi, *numbers)
        places, _ = layout.candidates(number, pi, numbers)
        return problem.spanned(number, pi, numbers, [left, *(places[k] for k in sources), right], fixed)

    @cache
    def balls(bits: int) -> Spanned:
        return made(flint.arb, flint.arb.pi(), [flint.arb(value) for value in finite])

    return BoundProblem(problem, lambda: balls(flint.ctx.prec), made(*fractions))


def _free_columns(entries: Sequence[Any], size: int, fixed: Sequence[int]) -> list[list[Any]]:
    """Return the columns of free motions in which the fixed coordinates are zero."""
    number = len(entries) // size
    columns = [[entries[i * number + j] for i in range(size)] for j in range(number)]
    for place in fixed:
        moving = [column for column in columns if column[place] != 0]
        if len(moving) > 1:
            raise ValueError("certification needs an infinite stiffness to act on one free displacement")
        columns = [column for column in columns if column[place] == 0]
    return columns
