"""The route of a uniform Lagrangian with up to three displacements a section and as many wave numbers.

Strings on foundations, beams under tension or with shear, bending with torsion, a beam joined to a string: whatever is
even under a reflection of x.
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
    kept,
    lowest_waves,
    template,
)
from cra_sym.solvers.waves_modes import wave_states

if TYPE_CHECKING:
    from sympy import Symbol

    from cra_sym.mechanics import StateForm

__all__ = ["Waves", "waves_route"]

Array = NDArray[np.float64]
_MOST = 3  # displacements of a section
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
    ends : Kernel
        Of the parameters: for the left end and then the right one stiffness and mass matrices of the displacements, in
        order, and the matrix that ties those that are held.
    held : tuple of (int, int)
        End and position, in order, of displacements that essential conditions hold.
    stiffnesses : dict of int to (int, int)
        Position of each parameter that may be infinite, with the end and the position of what it then holds.
    known : tuple of (0, 1 or None)
        Coefficients of the problem that are the same for all parameters.
    """

    spatial: SpatialProblem
    order: tuple[int, ...]
    structure: Structure
    matrices: Kernel
    ends: Kernel
    held: tuple[tuple[int, int], ...]
    stiffnesses: dict[int, tuple[int, int]]
    known: tuple[int | None, ...]

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
        problem, simple = self._covered(columns)
        if simple.all():
            self._fill(problem, squares)
        else:
            part = np.empty((int(simple.sum()), modes))
            self._fill(problem.take(np.flatnonzero(simple)), part)
            squares[simple] = part
            rest = columns[:, ~simple]
            squares[~simple] = self._general.angular_frequencies(list(rest), rest.shape[1:], modes) ** 2
        return np.sqrt(squares).reshape(*shape, modes)

    def modes(self, values: Values, shape: tuple[int, ...], omega: Array) -> StateModes:
        """Return the modes of all the first frequencies."""
        columns = flat_columns(values, shape)
        problem, simple = self._covered(columns)
        if not simple.all():
            return self._general.modes(values, shape, omega)
        return StateModes(omega, self.spatial, columns, partial(self._states, columns, problem))

    def _covered(self, columns: Array) -> tuple[UniformProblem, NDArray[np.bool_]]:
        """Return the problem, and for which sets its closed forms hold.

        They do where infinite values hold one displacement each and no end has negative stiffness or mass.
        """
        others = [position for position in range(len(columns)) if position not in self.stiffnesses]
        simple = ~np.isinf(columns[others]).any(axis=0)
        problem = self._problem(columns)
        for matrix in (problem.odd_by_even, problem.even_by_odd):
            simple &= np.isfinite(matrix).all(axis=(0, 2, 3))
        for ends in (problem.stiffness, problem.mass):
            simple &= (ends >= 0).all(axis=(0, 2))
        return problem, np.asarray(simple & (problem.length > 0))

    def _fill(self, problem: UniformProblem, squares: Array) -> None:
        roots = _COST * squares.size
        parts = _parts(self.structure, self.known)
        search = _search(parts) if wants_compiler(roots, parts) else None

        def part(rows: slice) -> None:
            squares[rows] = lowest_waves(problem.take(rows), squares.shape[1], search, self._functions)

        if search is None:
            part(slice(None))
        else:
            in_parts(part, len(squares), squares.shape[1], threads=None, compiled=True)

    def _states(self, columns: Array, problem: UniformProblem, z: Array, x: Array) -> Array:
        """Return the state of every mode at places x (rows, stations), shape (rows, modes, stations, 2 n)."""
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
        matrix = np.moveaxis(ends.reshape(2, 3, n, n, rows), -1, 2)
        diagonal = np.arange(n)
        stiffness, mass = (matrix[:, kind][..., diagonal, diagonal].copy() for kind in (0, 1))
        for end, place in self.held:
            stiffness[end, :, place] = np.inf
        for position, (end, place) in self.stiffnesses.items():
            stiffness[end, np.isinf(columns[position]), place] = np.inf
        couplings = np.moveaxis(matrix[:, :2], 1, 0).copy()
        couplings[..., diagonal, diagonal] = 0.0
        odd_by_even, even_by_odd = (np.moveaxis(matrices[:, k], -1, 1) for k in (0, 1))
        return UniformProblem(
            np.array(np.broadcast_to(length, rows), dtype=np.float64),
            odd_by_even,
            even_by_odd,
            stiffness,
            mass,
            self.structure.odd,
            couplings if couplings.any() else None,
            matrix[:, 2] if matrix[:, 2].any() else None,
            self.structure.sizes,
            self.known,
        )


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
    """Return the route of a uniform spatial problem with up to three displacements a section, else None.

    Parameters
    ----------
    form : StateForm
        Conservative.
    spatial : SpatialProblem
        The same, compiled.
    symbols : sequence of Symbol
        The parameters, in the order in which their values are given.
    """
    from cra_sym.model.waves_form import end_matrices, known_coefficients, only_entry, parity, powers

    n = len(form.displacements)
    if n > _MOST or form.coordinates or not form.uniform or form.damped:
        return None
    split = parity(form.system, n)
    ends = None if split is None else end_matrices(form, *split[:2])
    if split is None or ends is None:
        return None
    order, odd, sizes = split
    even_state = [n + i if odd[at] else i for at, i in enumerate(order)]
    odd_state = [(place + n) % (2 * n) for place in even_state]
    matrices = [form.system.extract(odd_state, even_state), form.system.extract(even_state, odd_state)]
    entries = [powers(entry, form.parameter) for matrix in matrices for entry in matrix]
    if None in entries:
        return None
    flat = tuple(entry[power] for power in (0, 1) for entry in entries)  # type: ignore[index]
    if not any((*flat[len(entries) :], *(entry for end in ends for entry in end[1]))):
        return None  # nothing has mass: the general route says so
    place = {displacement: position for position, displacement in enumerate(order)}
    held = tuple((end, at) for end in (0, 1) for at in range(n) if at not in ends[end][3])
    stiffnesses = {
        symbols.index(symbol): (i // n, place[i % n])
        for symbol in symbols
        for i in range(2 * n)
        if only_entry(form, symbol) == i
    }
    structure = Structure(odd, sizes)
    known = known_coefficients(structure, flat, ends, set(stiffnesses.values()))
    return Waves(
        spatial,
        order,
        structure,
        kernel(flat, tuple(symbols), backend="numpy"),
        kernel(tuple(entry for end in ends for matrix in end[:3] for entry in matrix), tuple(symbols), backend="numpy"),
        held,
        stiffnesses,
        tuple(kept(structure, known)),
    )
