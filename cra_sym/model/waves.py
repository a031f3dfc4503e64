"""The route of a uniform Lagrangian: parts along the span with up to three wave numbers each, joined at their ends.

Strings on foundations, beams under tension or with shear, bending with torsion, several beams: whatever is even under a
reflection of x, with any springs, masses, lumped coordinates and links of the ends. A coordinate that acts along the
whole span in another way than to carry it, such as the base of a foundation, keeps the dynamic stiffness: there the
motion of the span has a part that is not a free wave. So do more than twelve conditions (two for each displacement of a
section, one for each coordinate and each spring between places): the formulas would be too long.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache, cached_property, partial
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from cra_sym.kernels import Kernel, compiled, kernel
from cra_sym.kernels.parts import Parts, in_parts, wants_compiler
from cra_sym.kernels.plain import functions_of
from cra_sym.model.routes import GeneralRoute, StateModes, Values
from cra_sym.model.spatial import SpatialProblem
from cra_sym.model.values import flat_columns
from cra_sym.solvers.waves import (
    QUICK,
    Functions,
    Search,
    Structure,
    UniformProblem,
    formulas,
    lowest_waves,
    template,
)
from cra_sym.solvers.waves_modes import wave_states
from cra_sym.solvers.waves_problem import idle_coordinates, negative_motions

if TYPE_CHECKING:
    from sympy import Symbol

    from cra_sym.mechanics import StateForm

__all__ = ["Waves", "waves_route"]

Array = NDArray[np.float64]
_BLOCK = 8192  # sets of values at a time
_COST = 10  # roots of one wave number that one of these costs, to judge whether machine code pays


@dataclass(frozen=True, eq=False)
class Waves:
    """Closed forms where they apply, dynamic stiffness for the sets of values where they do not.

    Attributes
    ----------
    spatial : SpatialProblem
    order : tuple of int
        Displacements in the order of `UniformProblem`: those that are coupled inside together.
    structure : Structure
    matrices : Kernel
        Of the parameters: entries of A_OE and A_EO without z, then their factors of z.
    conditions : Kernel
        Of the parameters: stiffness and mass matrices of the ends and coordinates, the matrix that ties those that are
        held, stiffness and stretch of links.
    carried : Kernel or None
        Of the parameters: what a unit of each lumped coordinate gives the displacements all along.
    held : tuple of int
        Places that essential conditions hold.
    stiffnesses : dict of int to tuple of int
        Position of each parameter that may be infinite, with the places and links that it then holds.
    known : tuple of (0, 1 or None)
        Coefficients of the problem that are the same for all parameters.
    coordinates : tuple of str
        Lumped coordinates, for messages.
    """

    spatial: SpatialProblem
    order: tuple[int, ...]
    structure: Structure
    matrices: Kernel
    conditions: Kernel
    carried: Kernel | None
    held: tuple[int, ...]
    stiffnesses: dict[int, tuple[int, ...]]
    known: tuple[int | None, ...]
    coordinates: tuple[str, ...] = ()

    @cached_property
    def _functions(self) -> Functions:
        return functions_of(formulas(self.structure, self.known), QUICK)

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
        parts = _parts(self.structure, self.known)
        search = _search(parts) if wants_compiler(_COST * squares.size, parts) else None

        def fill(rows: slice) -> None:
            for start in range(rows.start, rows.stop, _BLOCK):  # what belongs to a block stays in the processor's cache
                block = slice(start, min(start + _BLOCK, rows.stop))
                self._fill(columns[:, block], squares[block], search)

        if search is None:
            fill(slice(0, len(squares)))
        else:
            in_parts(fill, len(squares), modes, threads=None, compiled=True)
        return np.sqrt(squares).reshape(*shape, modes)

    @np.errstate(all="ignore")
    def _fill(self, columns: Array, squares: Array, search: Search | None) -> None:
        """Fill in the squared frequencies of some sets of values."""
        modes = squares.shape[1]
        problem, simple = self._covered(columns)
        if simple.all():
            squares[...] = lowest_waves(problem, modes, search, self._functions)
            return
        if simple.any():
            part = problem.take(np.flatnonzero(simple))
            squares[simple] = lowest_waves(part, modes, search, self._functions)
        rest = columns[:, ~simple]
        squares[~simple] = self._general.angular_frequencies(list(rest), rest.shape[1:], modes) ** 2

    def modes(self, values: Values, shape: tuple[int, ...], omega: Array) -> StateModes:
        """Return the modes of all the first frequencies."""
        columns = flat_columns(values, shape)
        problem, simple = self._covered(columns)
        if not simple.all():
            return self._general.modes(values, shape, omega)
        return StateModes(omega, self.spatial, columns, partial(self._states, columns, problem))

    def _covered(self, columns: Array) -> tuple[UniformProblem, NDArray[np.bool_]]:
        """Return the problem, and for which sets its closed forms hold.

        They do where infinite values hold one displacement or link each and nothing has negative stiffness or mass.
        """
        others = [position for position in range(len(columns)) if position not in self.stiffnesses]
        simple = ~np.isinf(columns[others]).any(axis=0)
        problem = self._problem(columns)
        for matrix in (problem.odd_by_even, problem.even_by_odd):
            simple &= np.isfinite(matrix).all(axis=(0, 2, 3))
        for ends in (problem.stiffness, problem.mass):
            simple &= (ends >= 0).all(axis=1)
        simple &= ~negative_motions(problem, 1)
        if (simple & idle_coordinates(problem)).any():
            names = ", ".join(self.coordinates)
            raise ValueError(f"values: a motion of the lumped coordinates {names} alone has neither mass nor stiffness")
        return problem, np.asarray(simple & (problem.length > 0))

    def _states(self, columns: Array, problem: UniformProblem, z: Array, x: Array) -> Array:
        """Return the state of every mode at places x (rows, stations), shape (rows, modes, stations, 2 n + m)."""
        finite = np.where(np.isinf(columns), 0.0, columns)
        _, left = self.spatial.geometry.function(*finite)
        share = np.clip((x - np.broadcast_to(left, len(x))[:, None]) / problem.length[:, None], 0.0, 1.0)
        found = wave_states(problem, z, share)
        n, m = len(self.order), self.structure.coordinates
        if self.carried is not None:
            carried = np.moveaxis(_stacked(self.carried, finite, len(x)).reshape(n, m, -1), -1, 0)
            found[..., :n] -= found[..., n : n + m] @ np.swapaxes(carried, 1, 2)[:, None]
        back = np.argsort(self.order)
        return found[..., [*back, *range(n, n + m), *(n + m + back)]]

    def _problem(self, columns: Array) -> UniformProblem:
        rows, n, structure = columns.shape[1], len(self.order), self.structure
        finite = np.where(np.isinf(columns), 0.0, columns)
        with np.errstate(all="ignore"):
            matrices = _stacked(self.matrices, finite, rows).reshape(2, 2, n, n, rows)
            entries = _stacked(self.conditions, finite, rows)
            length, _ = self.spatial.geometry.function(*finite)
        size = structure.moving
        found = entries[: 3 * size**2].reshape(3, size, size, rows)
        links = entries[3 * size**2 :].reshape(structure.links, 1 + size, rows)
        diagonal = np.arange(size)
        stiffness = np.concatenate([found[0, diagonal, diagonal], links[:, 0]]).T.copy()
        mass = np.concatenate([found[1, diagonal, diagonal], np.zeros((structure.links, rows))]).T.copy()
        stiffness[:, self.held] = np.inf
        for position, places in self.stiffnesses.items():
            for place in places:
                stiffness[np.isinf(columns[position]), place] = np.inf
        matrix = np.moveaxis(found, -1, 1)
        matrix[:2, :, diagonal, diagonal] = 0.0
        odd_by_even, even_by_odd = (np.moveaxis(matrices[:, k], -1, 1) for k in (0, 1))
        return UniformProblem(
            np.array(np.broadcast_to(length, rows), dtype=np.float64),
            odd_by_even,
            even_by_odd,
            stiffness,
            mass,
            structure.odd,
            matrix[:2] if matrix[:2].any() else None,
            matrix[2] if matrix[2].any() else None,
            structure.sizes,
            self.known,
            structure.coordinates,
            structure.linked,
            np.moveaxis(links[:, 1:], -1, 0) if structure.links else None,
        ).without_idle_links()


def _stacked(function: Kernel, columns: Array, rows: int) -> Array:
    """Return the outputs of a kernel as rows of an array."""
    return np.array([np.broadcast_to(value, rows) for value in function.function(*columns)], dtype=np.float64)


@cache
def _parts(structure: Structure, known: tuple[int | None, ...]) -> Parts:
    """Return what makes the text of the compiled twin and its kernels."""
    text = cache(lambda: template(structure, known))
    return lambda: (text(), {})


@cache
def _search(parts: Parts) -> Search:
    found: Search = compiled(*parts()).lowest_waves
    return found


def waves_route(form: StateForm, spatial: SpatialProblem, symbols: Sequence[Symbol]) -> Waves | None:
    """Return the route of a uniform spatial problem with up to three wave numbers that are coupled inside, else None.

    Parameters
    ----------
    form : StateForm
        Conservative.
    spatial : SpatialProblem
        The same, compiled.
    symbols : sequence of Symbol
        The parameters, in the order in which their values are given.
    """
    from cra_sym.model.waves_form import waves_form

    found = waves_form(form, symbols)
    if found is None:
        return None
    order, ends, structure = found.order, found.conditions, found.structure
    return Waves(
        spatial,
        order,
        structure,
        kernel(found.matrices, tuple(symbols), backend="numpy"),
        kernel((*ends.stiffness, *ends.mass, *ends.ties, *ends.links), tuple(symbols), backend="numpy"),
        kernel(tuple(ends.carried), tuple(symbols), backend="numpy") if structure.coordinates else None,
        tuple(place for place in range(structure.moving) if place not in ends.free),
        {symbols.index(symbol): acting for symbol, acting in ends.springs.items()},
        found.known,
        tuple(str(coordinate) for coordinate in form.coordinates),
    )
