"""The route of a uniform Lagrangian: parts along the span with up to three wave numbers each, joined at their ends.

This covers strings on foundations, beams under tension or with shear, bending with torsion, several beams: any model
that is even under a reflection of x, with any springs, masses, lumped coordinates and couplings of the ends. The
dynamic stiffness is used instead where a coordinate acts along the whole span other than as a rigid translation of it,
such as the base of a foundation (the motion of the span is then not a sum of free waves), and for more than twelve
conditions (two for each displacement of a section, one for each coordinate and each spring between them), whose
formulas would be too long.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cache, partial
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from cra_sym.cached import cached_property
from cra_sym.kernels import Kernel, compiled, kernel
from cra_sym.kernels.parts import Parts, in_parts, wants_compiler
from cra_sym.kernels.plain import functions_of
from cra_sym.model.coefficient_rates import CoefficientRates
from cra_sym.model.routes import GeneralRoute, StateModes, Values
from cra_sym.model.spatial import SpatialProblem
from cra_sym.model.values import flat_columns
from cra_sym.solvers.waves import (
    QUICK,
    Counts,
    Functions,
    Search,
    Structure,
    UniformProblem,
    formulas,
    lowest_waves,
    template,
)
from cra_sym.solvers.waves_count import Determinant
from cra_sym.solvers.waves_modes import WaveShapes
from cra_sym.solvers.waves_rates import (
    Slopes,
    compiled_root_rates,
    evaluated,
    rate_template,
    root_rates,
    slope_formulas,
)
from cra_sym.solvers.waves_static import equal_waves, idle_coordinates, negative_motions

if TYPE_CHECKING:
    from sympy import Symbol

    from cra_sym.mechanics import StateForm

__all__ = ["Waves", "waves_route"]

Array = NDArray[np.float64]
_BLOCK = 8192  # parameter sets per block
_SHAPES_BLOCK = 1024  # with several stations and modes each
_NEAR = 1e-4  # relative distance of two roots below which their rates come from the modes
_COST = 10  # cost of one root relative to one of a single wave number, to decide whether machine code pays


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
        held, links (see `cra_sym.model.waves_form.Conditions`).
    carried : Kernel or None
        Of the parameters: the displacement of the whole span per unit of each lumped coordinate.
    held : tuple of int
        Degrees of freedom that essential conditions hold.
    stiffnesses : dict of int to tuple of int
        For the index of each parameter that may be infinite, the degrees of freedom and links that it then holds.
    known : tuple of (0, 1 or None)
        Coefficients of the problem that are the same for all parameters.
    coordinates : tuple of str
        Lumped coordinates, for messages.
    analytic : bool
        Whether the matrices and conditions are analytic functions of the parameters.
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
    analytic: bool = False

    @cached_property
    def _functions(self) -> Functions:
        return functions_of(formulas(self.structure, self.known), QUICK)

    @cached_property
    def _slopes(self) -> Slopes:
        return evaluated(functions_of(slope_formulas(self.structure, self.known), QUICK))

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
            for start in range(rows.start, rows.stop, _BLOCK):  # the data of a block fit in the processor's cache
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
        if simple.any():
            some = slice(None) if simple.all() else np.flatnonzero(simple)
            part = problem if simple.all() else problem.take(np.flatnonzero(simple))
            found = squares[some] = lowest_waves(part, modes, search, self._functions)
            simple[some] = ~self._doubtful(part, found, compiled_too=search is not None)
        if not simple.all():
            rest = columns[:, ~simple]
            squares[~simple] = self._general.angular_frequencies(list(rest), rest.shape[1:], modes) ** 2

    def _doubtful(self, problem: UniformProblem, squares: Array, *, compiled_too: bool) -> NDArray[np.bool_]:
        """Return where symmetry may cost the closed forms digits or roots, which the dynamic stiffness does not lose.

        Waves inside may be equal; and double roots of parts that are joined are those of one determinant.
        """
        found = equal_waves(problem, squares[:, -1])
        if self.structure.linked and len(self.structure.sizes) + self.structure.coordinates > 2:
            zeros = np.zeros(len(squares), dtype=np.int64)
            function = Determinant(problem.coefficients(), self.structure, self._functions, zeros)
            counted = compiled(*_parts(self.structure, self.known)()).counts if compiled_too else None
            found |= _close(squares.T, function, counted).any(axis=0)
        return found

    def rates(
        self, values: Values, shape: tuple[int, ...], omega: Array, positions: Sequence[int]
    ) -> Sequence[Array] | None:
        """Return the derivatives of omega^2 by parameters, from the determinant, see `Rated`."""
        columns, z = flat_columns(values, shape), omega.reshape(-1, omega.shape[-1]) ** 2
        if not (self.analytic and (z > 0).all()):
            return None
        found, refused = np.empty((len(positions), *z.shape)), []
        parts, spectrum = (of(self.structure, self.known) for of in (_rate_parts, _parts))
        machine_code = wants_compiler(_COST * z.size, parts)
        if machine_code:
            by_determinant = partial(compiled_root_rates, compiled(*parts()).rates)
        else:
            by_determinant = partial(root_rates, slopes=self._slopes)
        counted = compiled(*spectrum()).counts if machine_code else None

        def fill(rows: slice) -> None:
            for start in range(rows.start, rows.stop, _BLOCK):
                part = slice(start, min(start + _BLOCK, rows.stop))
                if not self._enter_rates(columns[:, part], z[part], positions, by_determinant, counted, found[:, part]):
                    refused.append(start)

        if machine_code:
            in_parts(fill, len(z), z.shape[1], threads=None, compiled=True)
        else:
            fill(slice(0, len(z)))
        return None if refused else list(found.reshape(-1, *omega.shape))

    @np.errstate(all="ignore")
    def _enter_rates(
        self,
        columns: Array,
        z: Array,
        positions: Sequence[int],
        by_determinant: Callable[..., Array],
        counted: Counts | None,
        found: Array,
    ) -> bool:
        """Fill in the rates for some sets of values; return whether their frequencies are roots of the determinant."""
        problem, simple = self._covered(columns)
        if not simple.all() or equal_waves(problem, z[:, -1]).any():
            return False
        rows, modes = z.shape
        function = Determinant(problem.coefficients(), self.structure, self._functions, np.zeros(rows, dtype=np.int64))
        by_k = by_determinant(function=function, z=z.T)  # the sets of values come last: loops along them are long
        close = _close(z.T, function, counted)
        for at, of_k in self._coefficient_rates(columns, positions):
            total = np.zeros((modes, rows))
            for k, rate in of_k.items():
                total += by_k[k] * rate
            total[close] = np.nan
            found[at] = total.T
        return True

    @cached_property
    def _coefficient_rates(self) -> CoefficientRates:
        def coefficients(columns: Array) -> Array:
            return self._problem(columns)[0].coefficients(dispersion=False)

        return CoefficientRates(coefficients, len(self.matrices.arguments), tuple(self.stiffnesses))

    def modes(self, values: Values, shape: tuple[int, ...], omega: Array) -> StateModes:
        """Return the modes of all the first frequencies."""
        columns = flat_columns(values, shape)
        problem, simple = self._covered(columns)
        z = omega.reshape(-1, omega.shape[-1]) ** 2
        if not simple.all() or equal_waves(problem, z[:, -1]).any():
            return self._general.modes(values, shape, omega)
        blocks = [slice(start, start + _SHAPES_BLOCK) for start in range(0, max(len(z), 1), _SHAPES_BLOCK)]
        shapes = [WaveShapes(problem.take(block), z[block]) for block in blocks]
        return StateModes(omega, self.spatial, columns, partial(self._states, columns, shapes))

    def _covered(self, columns: Array) -> tuple[UniformProblem, NDArray[np.bool_]]:
        """Return the problem, and for which sets its closed forms hold.

        They do where infinite values hold one displacement or link each and nothing has negative stiffness or mass.
        """
        problem, simple = self._problem(columns)
        for position, column in enumerate(columns):
            if position not in self.stiffnesses:
                simple &= ~np.isinf(column)
        for ends in (problem.stiffness.T, problem.mass.T):
            for end in ends:
                simple &= end >= 0
        simple &= ~negative_motions(problem, 1)
        if (simple & idle_coordinates(problem)).any():
            names = ", ".join(self.coordinates)
            raise ValueError(f"values: a motion of the lumped coordinates {names} alone has neither mass nor stiffness")
        return problem, np.asarray(simple & (problem.length > 0))

    def _states(self, columns: Array, shapes: Sequence[WaveShapes], x: Array) -> Array:
        """Return the state of every mode at places x (rows, stations), shape (rows, modes, stations, 2 n + m)."""
        finite = np.where(np.isinf(columns), 0.0, columns)
        length, left = (np.broadcast_to(value, len(x))[:, None] for value in self.spatial.geometry.function(*finite))
        share = np.split(np.clip((x - left) / length, 0.0, 1.0), range(_SHAPES_BLOCK, len(x), _SHAPES_BLOCK))
        found = np.concatenate([some.states(there) for some, there in zip(shapes, share, strict=True)])
        n, m = len(self.order), self.structure.coordinates
        if self.carried is not None:
            carried = _rows_first(self.carried.function(*finite), len(x), (n, m), 0)
            found[..., :n] -= found[..., n : n + m] @ np.swapaxes(carried, 1, 2)[:, None]
        back = np.argsort(self.order)
        return found[..., [*back, *range(n, n + m), *(n + m + back)]]

    def _problem(self, columns: Array) -> tuple[UniformProblem, NDArray[np.bool_]]:
        """Return the problem, and for which sets the matrices are finite."""
        rows, n, structure = columns.shape[1], len(self.order), self.structure
        finite = [np.where(np.isinf(column), 0.0, column) for column in columns]
        with np.errstate(all="ignore"):
            entries, given = self.matrices.function(*finite), self.conditions.function(*finite)
            length, _ = self.spatial.geometry.function(*finite)
        good = np.ones(rows, dtype=bool)
        for entry in entries:
            good &= np.isfinite(entry)
        matrices = _filled(entries, rows).reshape(2, 2, n, n, rows)
        size, links = structure.moving, structure.links
        parts = [given[size**2 * part :][: size**2] for part in range(3)]
        joined = given[3 * size**2 :]
        stiffness = _filled([*parts[0][:: size + 1], *joined[:: 2 + size]], rows).T
        mass = _filled([*parts[1][:: size + 1], *joined[1 :: 2 + size]], rows).T
        stiffness[:, self.held] = np.inf
        for position, places in self.stiffnesses.items():
            infinite = np.isinf(columns[position])
            if infinite.any():
                for place in places:
                    stiffness[infinite, place] = np.inf
        aside = [[0.0 if at % (size + 1) == 0 else entry for at, entry in enumerate(part)] for part in parts[:2]]
        couplings, ties = [*aside[0], *aside[1]], parts[2]
        stretches = [entry for at, entry in enumerate(joined) if at % (2 + size) > 1]
        odd_by_even, even_by_odd = (np.moveaxis(matrices[:, k], -1, 1) for k in (0, 1))
        problem = UniformProblem(
            np.array(np.broadcast_to(length, rows), dtype=np.result_type(np.float64, length)),
            odd_by_even,
            even_by_odd,
            stiffness,
            mass,
            structure.odd,
            _rows_first(couplings, rows, (2, size, size), 1) if _any(couplings) else None,
            _rows_first(ties, rows, (size, size), 0) if _any(ties) else None,
            structure.sizes,
            self.known,
            structure.coordinates,
            structure.linked,
            _rows_first(stretches, rows, (links, size), 0) if links else None,
        )
        return problem.without_idle_links(), good


def _filled(values: Sequence[float | Array], rows: int) -> Array:
    """Return numbers and arrays as rows of an array."""
    found = np.empty((len(values), rows), dtype=np.result_type(np.float64, *values))
    for row, value in zip(found, values, strict=True):
        row[:] = value
    return found


def _close(z: Array, function: Determinant, counted: Counts | None) -> NDArray[np.bool_]:
    """Return which of the lowest of ascending roots, shape (modes, rows), have a close neighbour, also the next one."""
    near, beyond = np.diff(z, axis=0) < _NEAR * z[1:], z[-1] * (1.0 + _NEAR)
    if counted is None:
        number = function.count(beyond)[0]
    else:
        number = np.empty(beyond.size, dtype=np.int64)
        counted(number, np.empty(beyond.size), beyond, function.k)
    found = np.zeros(z.shape, dtype=bool)
    found[-1] = number > len(z)
    found[:-1] |= near
    found[1:] |= near
    return found


def _any(values: Sequence[float | Array]) -> bool:
    return any(value.any() if isinstance(value, np.ndarray) else value != 0 for value in values)


def _rows_first(values: Sequence[float | Array], rows: int, shape: tuple[int, ...], axis: int) -> Array:
    """Return the entries of matrices of a shape, with the axis of the sets of values put in."""
    return np.moveaxis(_filled(values, rows).reshape(*shape, rows), -1, axis)


@cache
def _parts(structure: Structure, known: tuple[int | None, ...]) -> Parts:
    """Return the arguments of the text of the compiled version, and its kernels."""
    text = cache(lambda: template(structure, known))
    return lambda: (text(), {})


@cache
def _rate_parts(structure: Structure, known: tuple[int | None, ...]) -> Parts:
    """Return the arguments of the text of the compiled rates, and its kernels."""
    text = cache(lambda: rate_template(structure, known))
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
    from sympy import Abs, Max, Min, Piecewise, sign, sympify

    from cra_sym.model.waves_form import waves_form

    found = waves_form(form, symbols)
    if found is None:
        return None
    order, ends, structure = found.order, found.conditions, found.structure
    given = (*ends.stiffness, *ends.mass, *ends.ties, *ends.links)
    entries = (*map(sympify, (*found.matrices, *given)), form.length)
    return Waves(
        spatial,
        order,
        structure,
        kernel(found.matrices, tuple(symbols), backend="numpy"),
        kernel(given, tuple(symbols), backend="numpy"),
        kernel(tuple(ends.carried), tuple(symbols), backend="numpy") if structure.coordinates else None,
        tuple(place for place in range(structure.moving) if place not in ends.free),
        {symbols.index(symbol): acting for symbol, acting in ends.springs.items()},
        found.known,
        tuple(str(coordinate) for coordinate in form.coordinates),
        not any(entry.has(Abs, Max, Min, Piecewise, sign) for entry in entries),
    )
