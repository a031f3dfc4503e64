"""The route of a uniform Lagrangian with two displacements a section and two wave numbers.

Beams under tension, on foundations, with shear: whatever is even under a reflection of x.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache, cached_property, partial
from itertools import product
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from cra_sym.kernels import Kernel, compiled, kernel
from cra_sym.kernels.parts import in_parts, wants_compiler
from cra_sym.model.routes import GeneralRoute, StateModes, Values
from cra_sym.model.spatial import SpatialProblem
from cra_sym.model.values import flat_columns
from cra_sym.solvers.waves import Search, UniformProblem, lowest_waves, template
from cra_sym.solvers.waves_modes import wave_states

if TYPE_CHECKING:
    from sympy import Symbol

    from cra_sym.mechanics import StateForm

__all__ = ["TwoWaves", "two_waves_route"]

Array = NDArray[np.float64]
_COST = 10  # roots of one wave number that one of these costs, to judge whether machine code pays


@dataclass(frozen=True, eq=False)
class TwoWaves:
    """Closed forms where they apply, dynamic stiffness for the sets of values where they do not.

    Attributes
    ----------
    spatial : SpatialProblem
    order : tuple of int
        Displacements in the order of `UniformProblem`: even ones under reflection first.
    even : int
        How many are even.
    matrices : Kernel
        Of the parameters: entries of A_OE and A_EO without z, then their factors of z.
    ends : Kernel
        Of the parameters: stiffness and mass of the displacements of the left end, in order, then of the right one,
        then the coupling of stiffness and mass of the left end and of the right one.
    held : tuple of (int, int)
        End and position, in order, of displacements that essential conditions hold.
    stiffnesses : dict of int to (int, int)
        Position of each parameter that may be infinite, with the end and the position of what it then holds.
    """

    spatial: SpatialProblem
    order: tuple[int, ...]
    even: int
    matrices: Kernel
    ends: Kernel
    held: tuple[tuple[int, int], ...]
    stiffnesses: dict[int, tuple[int, int]]

    @cached_property
    def _general(self) -> GeneralRoute:
        return GeneralRoute(self.spatial)

    def covers(self, values: Values) -> bool:
        """Return True: sets of values without closed forms take the dynamic stiffness one by one."""
        return True

    def angular_frequencies(self, values: Values, shape: tuple[int, ...], modes: int) -> Array:
        """Return the first natural frequencies, rad/s, ascending and complete, shape (*shape, modes)."""
        columns = flat_columns(values, shape)
        squares = np.empty((columns.shape[1], modes))
        simple = self._covered(columns)
        if simple.all():
            self._fill(columns, squares)
        else:
            for rows, find in ((simple, self._fill), (~simple, self._fill_generally)):
                if rows.any():
                    part = np.empty((int(rows.sum()), modes))
                    find(columns[:, rows], part)
                    squares[rows] = part
        return np.sqrt(squares).reshape(*shape, modes)

    def modes(self, values: Values, shape: tuple[int, ...], omega: Array) -> StateModes:
        """Return the modes of all the first frequencies."""
        columns = flat_columns(values, shape)
        if not self._covered(columns).all():
            return self._general.modes(values, shape, omega)
        return StateModes(omega, self.spatial, columns, partial(self._states, columns))

    def _covered(self, columns: Array) -> NDArray[np.bool_]:
        """Return for which sets the closed forms hold: infinite values that hold one displacement, no negative mass."""
        others = [position for position in range(len(columns)) if position not in self.stiffnesses]
        simple = ~np.isinf(columns[others]).any(axis=0)
        problem = self._problem(columns)
        ends = np.concatenate([problem.stiffness, problem.mass], axis=-1)
        finite = np.isfinite(problem.odd_by_even).all(axis=(0, 2, 3)) & np.isfinite(problem.even_by_odd).all(
            axis=(0, 2, 3)
        )
        return simple & finite & (ends >= 0).all(axis=(0, 2)) & (problem.length > 0)

    def _fill(self, columns: Array, squares: Array) -> None:
        roots = _COST * squares.size
        search = _search() if wants_compiler(roots, _parts) else None
        problem = self._problem(columns)

        def part(rows: slice) -> None:
            squares[rows] = lowest_waves(problem.take(rows), squares.shape[1], search)

        in_parts(part, len(squares), squares.shape[1], threads=None, compiled=search is not None)

    def _fill_generally(self, columns: Array, squares: Array) -> None:
        squares[:] = self._general.angular_frequencies(list(columns), columns.shape[1:], squares.shape[1]) ** 2

    def _states(self, columns: Array, z: Array, x: Array) -> Array:
        """Return the state of every mode at places x (rows, stations), shape (rows, modes, stations, 4)."""
        problem = self._problem(columns)
        _, left = self.spatial.geometry.function(*np.where(np.isinf(columns), 0.0, columns))
        share = np.clip((x - np.broadcast_to(left, len(x))[:, None]) / problem.length[:, None], 0.0, 1.0)
        found = wave_states(problem, z, share)
        n = len(self.order)
        back = np.argsort(self.order)
        return found[..., [*back, *(n + back)]]

    def _problem(self, columns: Array) -> UniformProblem:
        rows, n = columns.shape[1], len(self.order)
        finite = np.where(np.isinf(columns), 0.0, columns)
        with np.errstate(all="ignore"):
            matrices = _stacked(self.matrices, finite, rows).reshape(2, 2, n, n, rows)
            ends = _stacked(self.ends, finite, rows)
            length, _ = self.spatial.geometry.function(*finite)
        stiffness = np.moveaxis(ends[: 2 * n].reshape(2, n, rows), -1, 1).copy()
        mass = np.moveaxis(ends[2 * n : 4 * n].reshape(2, n, rows), -1, 1)
        for end, place in self.held:
            stiffness[end, :, place] = np.inf
        for position, (end, place) in self.stiffnesses.items():
            stiffness[end, np.isinf(columns[position]), place] = np.inf
        odd_by_even, even_by_odd = (np.moveaxis(matrices[:, k], -1, 1) for k in (0, 1))
        couplings = ends[4 * n :].reshape(2, 2, rows)
        length = np.array(np.broadcast_to(length, rows), dtype=np.float64)
        return UniformProblem(
            length, odd_by_even, even_by_odd, stiffness, mass, self.even, couplings if couplings.any() else None
        )


def _stacked(function: Kernel, columns: Array, rows: int) -> Array:
    """Return the outputs of a kernel as rows of an array."""
    return np.array([np.broadcast_to(value, rows) for value in function.function(*columns)], dtype=np.float64)


def _parts() -> tuple[str, dict[str, Kernel]]:
    return template(), {}


@cache
def _search() -> Search:
    found: Search = compiled(*_parts()).lowest_waves
    return found


def two_waves_route(form: StateForm, spatial: SpatialProblem, symbols: Sequence[Symbol]) -> TwoWaves | None:
    """Return the route of a uniform spatial problem with two displacements a section, None for every other problem.

    Parameters
    ----------
    form : StateForm
        Conservative.
    spatial : SpatialProblem
        The same, compiled.
    symbols : sequence of Symbol
        The parameters, in the order in which their values are given.
    """
    n = len(form.displacements)
    if n != 2 or form.coordinates or not form.uniform or form.damped:
        return None
    split = _parity(form.system, n)
    free = _free_places(form, n)
    if split is None or free is None:
        return None
    order, even, odd_by_even, even_by_odd = split
    entries = [(_powers(e, form.parameter)) for matrix in (odd_by_even, even_by_odd) for e in matrix]
    ends = _end_entries(form, order, n)
    if None in entries or ends is None:
        return None
    if not any((*(entry[1] for entry in entries), *ends[2 * n : 4 * n])):  # type: ignore[index]
        return None  # nothing has mass: the general route says so
    matrices = tuple(entry[power] for power in (0, 1) for entry in entries)  # type: ignore[index]
    place = {displacement: position for position, displacement in enumerate(order)}
    held = tuple((i // n, place[i % n]) for i in range(2 * n) if i not in free)
    stiffnesses = {
        symbols.index(symbol): (i // n, place[i % n])
        for symbol in symbols
        for i in range(2 * n)
        if _only_entry(form, symbol) == i
    }
    return TwoWaves(
        spatial,
        order,
        even,
        kernel(matrices, tuple(symbols), backend="numpy"),
        kernel(ends, tuple(symbols), backend="numpy"),
        held,
        stiffnesses,
    )


def _parity(system: Any, n: int) -> tuple[tuple[int, ...], int, Any, Any] | None:
    """Return even displacements first, their number, A_OE and A_EO, or None if a reflection changes the problem."""
    for signs in product((True, False), repeat=n - 1):
        is_even = (True, *signs)
        order = (*(i for i in range(n) if is_even[i]), *(i for i in range(n) if not is_even[i]))
        even = sum(is_even)
        first = [i if is_even[i] else n + i for i in order]
        second = [n + i if is_even[i] else i for i in order]
        if all(system[i, j].expand() == 0 for part in (first, second) for i in part for j in part):
            return order, even, system.extract(second, first), system.extract(first, second)
    return None


def _powers(entry: Any, parameter: Any) -> tuple[Any, Any] | None:
    """Return the part of an entry without z and its factor of z, or None if it is not linear in z."""
    slope = entry.diff(parameter).expand()
    return None if slope.has(parameter) else (entry.subs(parameter, 0), slope)


def _free_places(form: StateForm, n: int) -> set[int] | None:
    """Return the displacements of the ends that are free, or None if essential conditions combine them."""
    places = set()
    for column in range(form.free.cols):
        moved = [i for i in range(2 * n) if form.free[i, column] != 0]
        if len(moved) != 1:
            return None
        places.add(moved[0])
    return places


def _end_entries(form: StateForm, order: tuple[int, ...], n: int) -> tuple[Any, ...] | None:
    """Return stiffness and mass of both ends and their couplings, or None if the ends are linked or not linear in z."""
    boundary = form.boundary
    if any(boundary[i, n + j].expand() != 0 for i in range(n) for j in range(n)):
        return None
    powers = {}
    for end in (0, 1):
        for i, j in product(range(n), repeat=2):
            found = _powers(boundary[end * n + order[i], end * n + order[j]], form.parameter)
            if found is None:
                return None
            powers[end, i, j] = found
    diagonal = [sign * powers[end, i, i][k] for k, sign in ((0, 1), (1, -1)) for end in (0, 1) for i in range(n)]
    coupled = [sign * powers[end, 0, 1][k] for k, sign in ((0, 1), (1, -1)) for end in (0, 1)]
    return (*diagonal, *coupled)


def _only_entry(form: StateForm, symbol: Symbol) -> int | None:
    """Return the displacement of an end that a stiffness alone holds, None if there is none or it does more."""
    inside = form.system.free_symbols | form.length.free_symbols | form.free.free_symbols
    slope = form.boundary.diff(symbol)
    places = [i for i in range(slope.rows) if slope[i, i] != 0 and not slope[i, i].has(symbol, form.parameter)]
    return places[0] if symbol not in inside and len(places) == 1 and sum(e != 0 for e in slope) == 1 else None
