"""Breakpoints of a batch of parameter sets: in closed form where they are affine in x, else by bisection."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from cra_sym.kernels import Kernel, kernel

if TYPE_CHECKING:
    from sympy import Expr, Symbol

__all__ = ["Breaks", "breaks", "varying"]

Array = NDArray[np.float64]
Index = NDArray[np.intp]
_SAMPLES = 513
_MOST = 4000  # breakpoints of one switch
_HALVINGS = 80  # from any sampled interval to the last bit


@dataclass(frozen=True)
class Breaks:
    """Compiled switches of the coefficients of a model; see :mod:`cra_sym.mechanics.breakpoints`.

    Attributes
    ----------
    affine : Kernel
        Of (x, parameters): value and slope of each switch that is affine in x.
    others : Kernel
        Of (x, parameters): values of the other switches.
    turns : Kernel
        Of (x, parameters): derivatives by x of these, and of the exponents in them.
    levels : tuple of bool
        Of the affine ones, then of the others: whether all integer values count.
    rates : tuple of (Kernel, tuple of int) or None
        Of (x, parameters), in the same order: derivatives by x and by the parameters of those indices, the ones that
        the switch has; None if it has none.
    places : Kernel
        Of the parameters: interior places of terms.
    """

    affine: Kernel
    others: Kernel
    turns: Kernel
    levels: tuple[bool, ...]
    rates: tuple[tuple[Kernel, tuple[int, ...]] | None, ...]
    places: Kernel

    def edges(self, columns: Array, left: Array, length: Array) -> list[tuple[Index, Array, tuple[int, ...]]]:
        """Return parameter sets grouped by their number of breakpoints and by which of these carry terms.

        For each group: the rows; (left end, breakpoints, right end), shape (sets, breakpoints + 2); and for each
        interior place the index of its breakpoint.

        Parameters
        ----------
        columns : ndarray, shape (parameters, sets)
        left, length : ndarray, shape (sets,)

        Raises
        ------
        ValueError
            If a place is at an end of the domain or outside.
        """
        right = left + length
        roots = [root for _, root in self._candidates(columns, left, length)]
        stated = np.empty((len(left), len(self.places.layout)))
        for k, place in enumerate(self.places.function(*columns)):
            stated[:, k] = place
        outside = np.argwhere((stated < left[:, None]) | (stated > right[:, None]))
        if outside.size:
            row, k = outside[0]
            domain = f"({left[row]:g}, {right[row]:g})"
            raise ValueError(f"inside: a place is at x = {stated[row, k]:g}; must be in the domain, {domain}")
        if ((stated == left[:, None]) | (stated == right[:, None])).any():
            raise ValueError("inside: a place is at an end of the domain; state its term with left or right")
        found = np.concatenate([left[:, None], *roots, stated, right[:, None]], axis=1)
        inside = (found > left[:, None]) & (found < right[:, None])
        inside[:, 0] = inside[:, -1] = True
        found = np.sort(np.where(inside, found, np.inf), axis=1)  # nan is outside
        gap = 4 * np.spacing(np.maximum(np.abs(left), np.abs(right)))[:, None]
        kept = np.isfinite(found)
        with np.errstate(invalid="ignore"):
            kept[:, 1:] &= np.diff(found, axis=1) > gap
        count = kept.sum(axis=1)
        groups = []
        for number in np.unique(count):
            rows = np.nonzero(count == number)[0]
            edges = found[rows][kept[rows]].reshape(len(rows), number)
            edges[:, -1] = right[rows]
            nodes = np.abs(edges[:, :, None] - stated[rows, None, :]).argmin(axis=1)
            for kind in np.unique(nodes, axis=0):
                alike = (nodes == kind).all(axis=1)
                groups.append((rows[alike], edges[alike], tuple(int(k) for k in kind)))
        return groups

    def moving(self, columns: Array, left: Array, length: Array) -> tuple[Array, Array]:
        """Return every breakpoint in the domain, (sets, breakpoints), and its rates by every parameter.

        A set with fewer breakpoints is padded with the left end and rates of zero; the shape of the rates is
        (parameters, sets, breakpoints).
        """
        places, rates = [np.zeros((len(left), 0))], [np.zeros((len(columns), len(left), 0))]
        for number, root in self._candidates(columns, left, length):
            inside = (root > left[:, None]) & (root < (left + length)[:, None])
            if not inside.any():
                continue
            at = np.where(inside, root, left[:, None])
            rate, rated = np.zeros((len(columns), *at.shape)), self.rates[number]
            if rated is not None:
                with np.errstate(all="ignore"):
                    found = rated[0].function(at, *columns[..., None])
                    for k, part in zip(rated[1], found[1:], strict=True):
                        rate[k] = -part / found[0]
            places.append(at)
            rates.append(np.where(inside & np.isfinite(rate), rate, 0.0))
        place, rate = np.concatenate(places, axis=1), np.concatenate(rates, axis=2)
        alike = np.abs(place[:, :, None] - place[:, None, :]) <= 1e-12 * length[:, None, None]
        return place, rate / alike.sum(axis=-1)  # each jump once, also where two switches meet

    def inside(self, columns: Array, left: Array, length: Array) -> Array:
        """Return all breakpoints and interior places, (sets, places); those outside the domain are at its left end."""
        found = [root for _, root in self._candidates(columns, left, length)]
        found += [np.broadcast_to(place, left.shape)[:, None] for place in self.places.function(*columns)]
        every = np.concatenate([left[:, None], *found], axis=1)
        with np.errstate(invalid="ignore"):
            return np.where((every > left[:, None]) & (every < (left + length)[:, None]), every, left[:, None])

    def _candidates(self, columns: Array, left: Array, length: Array) -> Iterator[tuple[int, Array]]:
        """Yield the number of each switch with its zeros, (sets, zeros), some of them outside or infinite."""
        arguments = columns[..., None]
        ends = left[:, None] + length[:, None] * np.array([0.0, 1.0])
        with np.errstate(all="ignore"):
            values = self.affine.function(ends, *arguments)
            for k in range(0, len(values), 2):
                value, slope = (np.broadcast_to(v, ends.shape) for v in values[k : k + 2])
                if self.levels[k // 2]:
                    level = _integers_within(value)
                    yield k // 2, ends[:, :1] + (level - value[:, :1]) / slope[:, :1]
                else:
                    yield k // 2, ends[:, :1] - value[:, :1] / slope[:, :1]
            if self.others.layout:
                yield from self._sampled(columns, self._samples(columns, left, length))

    def _samples(self, columns: Array, left: Array, length: Array) -> Array:
        """Return ascending positions between which no switch takes a value twice, (sets, samples)."""
        ends = left[:, None] + length[:, None] * np.array([0.0, 1.0])
        values = self.affine.function(ends, *columns[..., None])
        grid = left[:, None] + length[:, None] * np.linspace(0.0, 1.0, _SAMPLES)
        kinks = [ends[:, :1] - values[k] / values[k + 1] for k in range(0, len(values), 2)]
        grid = _insert_positions(grid, [np.broadcast_to(kink, ends.shape)[:, :1] for kink in kinks])
        turning = self.turns.function(grid, *columns[..., None])
        values = [np.broadcast_to(value, grid.shape) for value in turning]
        return _insert_positions(
            grid, [_roots(self.turns, k, 0.0, columns, grid, value) for k, value in enumerate(values)]
        )

    def _sampled(self, columns: Array, grid: Array) -> Iterator[tuple[int, Array]]:
        number = len(self.others.layout)
        sampled = self.others.function(grid, *columns[..., None])
        for k in range(number):
            value = np.broadcast_to(sampled[k], grid.shape)
            switch = len(self.levels) - number + k
            levels = _integers_within(value) if self.levels[switch] else np.zeros((1, 1))
            for level in np.unique(levels[np.isfinite(levels)]):
                yield switch, _roots(self.others, k, level, columns, grid, value)


def _roots(function: Kernel, number: int, level: float, columns: Array, grid: Array, value: Array) -> Array:
    """Return where one of the functions crosses a level between samples, (sets, roots), padded with inf."""
    above = value >= level
    row, cell = np.nonzero(above[:, 1:] != above[:, :-1])
    low, high, start = grid[row, cell], grid[row, cell + 1], above[row, cell]
    for _ in range(_HALVINGS):
        middle = 0.5 * (low + high)
        here = function.function(middle, *columns[:, row])[number] >= level
        low, high = np.where(here == start, middle, low), np.where(here == start, high, middle)
    found = np.full((len(grid), int(np.bincount(row, minlength=1).max(initial=0))), np.inf)
    found[row, np.arange(len(row)) - np.searchsorted(row, row)] = high
    return found


def _insert_positions(grid: Array, places: list[Array]) -> Array:
    """Insert further positions into ascending samples; those outside their range are dropped."""
    every = np.concatenate([grid, *places], axis=1)
    inside = (every >= grid[:, :1]) & (every <= grid[:, -1:])
    return np.sort(np.where(inside, every, grid[:, -1:]), axis=1)


def _integers_within(value: Array) -> Array:
    """Return the integers within the range of each row, (sets, integers), padded with inf."""
    low, high = np.ceil(np.nanmin(value, axis=1)), np.floor(np.nanmax(value, axis=1))
    count = int(np.max(high - low, initial=-1.0)) + 1
    if count > _MOST:
        raise ValueError(f"coefficients: {count} jumps along x must be at most {_MOST}")
    found = low[:, None] + np.arange(max(count, 0))
    return np.where(found <= high[:, None], found, np.inf)


def varying(expressions: Sequence[Expr], x: Symbol, symbols: Sequence[Symbol]) -> tuple[Kernel | None, int]:
    """Return bounds of the variation of coefficients, compiled in (x, parameters), and the number of decaying ones.

    None where they are polynomials between breakpoints. See :func:`cra_sym.mechanics.breakpoints.exponents`.
    """
    from cra_sym.mechanics.breakpoints import exponents

    found = exponents(expressions, x)
    if not found.decaying and not found.others:
        return None, 0
    return kernel((*found.decaying, *found.others), (x, *symbols), backend="numpy"), len(found.decaying)


def breaks(expressions: Sequence[Expr], x: Symbol, symbols: Sequence[Symbol], places: Sequence[Expr] = ()) -> Breaks:
    """Return the compiled switches of coefficients, with interior places of terms.

    Raises
    ------
    HamiltonError
        Names what cannot be located.
    """
    from cra_sym.mechanics.breakpoints import derivative, exponents, switches

    affine, others = [], []
    for switch in switches(expressions, x):
        slope = switch.slope(x)
        if slope is None:
            others.append(switch)
        else:
            affine.append((switch, slope))
    pairs = tuple(part for switch, slope in affine for part in (switch.expression, slope))
    values = tuple(switch.expression for switch in others)
    inner = exponents(values, x)
    turning = dict.fromkeys((*values, *inner.decaying, *inner.others))
    arguments = (x, *symbols)

    def rated(expression: Expr) -> tuple[Kernel, tuple[int, ...]] | None:
        free = expression.free_symbols
        own = tuple(k for k, symbol in enumerate(symbols) if symbol in free)
        if not own:
            return None
        by = (x, *(symbols[k] for k in own))
        return kernel(tuple(derivative(expression, symbol) for symbol in by), arguments, backend="numpy"), own

    every = [*(switch for switch, _ in affine), *others]
    return Breaks(
        kernel(pairs, arguments, backend="numpy"),
        kernel(values, arguments, backend="numpy"),
        kernel(tuple(derivative(part, x) for part in turning), arguments, backend="numpy"),
        tuple(switch.levels for switch in every),
        tuple(rated(switch.expression) for switch in every),
        kernel(tuple(places), tuple(symbols), backend="numpy"),
    )
