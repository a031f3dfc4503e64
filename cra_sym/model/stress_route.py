"""Frequencies and modes of models whose coefficients vary along x: Ritz's method on the stresses, with an estimate."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from cra_sym.cached import cached_property
from cra_sym.kernels import Kernel
from cra_sym.model.announced import refinement
from cra_sym.model.routes import TOLERANCE, GeneralRoute, Values, mode_sign, overview_places
from cra_sym.model.spatial import HALVINGS, SpatialProblem
from cra_sym.model.values import flat_columns, infinite_patterns
from cra_sym.solvers.continuum import Continuum, Entries, PointTerm
from cra_sym.solvers.stress_refine import Found, solved

__all__ = ["StressModes", "StressRoute", "held_directions", "springs_and_supports", "springs_of"]

Array = NDArray[np.float64]
Index = NDArray[np.intp]
_AIM = 0.2
"""Target error of squared frequencies over the tolerance of frequencies: a tenth of the error accepted."""


@dataclass(frozen=True, eq=False)
class StressRoute:
    """Coefficients of the energies, compiled.

    Attributes
    ----------
    spatial : SpatialProblem
        For the ends, and for derivatives of shapes.
    orders : tuple of int
        Order of the highest derivative of each field.
    coefficients : Kernel
        Of (x, parameters): the entries, named by ``entries``.
    entries : tuple of (str, int, int)
        Which entry of 'W', 'B', 'D', 'R' or 'M' each is; see `cra_sym.solvers.continuum.Continuum`.
    reacting : SpatialProblem
        For counts by the dynamic stiffness: the reactions of supports at interior places are its last coordinates.
    """

    spatial: SpatialProblem
    orders: tuple[int, ...]
    coefficients: Kernel
    entries: tuple[tuple[str, int, int], ...]
    reacting: SpatialProblem

    def covers(self, values: Values) -> bool:
        """Return True: values that are out of range are refused by name."""
        return True

    def angular_frequencies(self, values: Values, shape: tuple[int, ...], modes: int) -> Array:
        """Return the first natural frequencies, rad/s, ascending and complete, shape (*shape, modes)."""
        return self.estimated(values, shape, modes, TOLERANCE)[0]

    def estimated(self, values: Values, shape: tuple[int, ...], modes: int, tolerance: float) -> tuple[Array, Array]:
        """Return the frequencies, and the estimated largest relative error of them, of shape ``shape``."""
        columns = flat_columns(values, shape)
        omega, accuracy = np.empty((columns.shape[1], modes)), np.empty(columns.shape[1])
        for found in self.found(columns, modes, tolerance, _AIM * tolerance):
            omega[found.rows], accuracy[found.rows] = np.sqrt(found.fields.z), found.accuracy
        return omega.reshape(*shape, modes), accuracy.reshape(shape)

    def modes(self, values: Values, shape: tuple[int, ...], omega: Array) -> StressModes:
        """Return the modes of all the first frequencies."""
        return self.estimated_modes(values, shape, omega, TOLERANCE)

    def estimated_modes(self, values: Values, shape: tuple[int, ...], omega: Array, tolerance: float) -> StressModes:
        """Return the modes of all the first frequencies; the error of a shape is of the order of the root of theirs."""
        columns = flat_columns(values, shape)
        found = self.found(columns, omega.shape[-1], tolerance, tolerance**2)
        return StressModes(omega, self.spatial, columns, list(found))

    def found(self, columns: Array, modes: int, tolerance: float, target: float) -> Iterator[Found]:
        """Yield the modes in groups of parameter sets; ``rows`` of each holds the indices of its sets.

        Parameters
        ----------
        columns : ndarray, shape (parameters, sets)
        modes : int
        tolerance : float
            Largest relative error of the frequencies that is accepted.
        target : float
            Target for the relative error of the squared frequencies.
        """
        for rows, infinite in infinite_patterns(columns):
            some = columns[:, rows].copy()
            some[list(infinite)] = 0.0
            length, left = (np.broadcast_to(v, len(rows)) for v in self.spatial.geometry(*some))
            directions, springs, mass = self._ends(some, infinite)
            for members, edges, nodes in self._edges(some, left, length):
                problem = Continuum(
                    self.orders,
                    self.spatial.coordinates,
                    self._evaluated(some[:, members]),
                    edges,
                    directions[members],
                    springs[members],
                    mass[members],
                    points=self._points(some[:, members], nodes),
                    variation=self.spatial.variation(some[:, members]),
                )
                with refinement() as progress:
                    solutions = solved(
                        problem, modes, 2.0 * tolerance, target, progress, self._counter(columns, rows[members])
                    )
                for found in solutions:
                    yield Found(rows[members][found.rows], found.fields, found.accuracy)

    def _counter(self, columns: Array, members: Index) -> Callable[[Index, Array], NDArray[np.intp] | None]:
        """Return the count of squared frequencies below z by Wittrick and Williams, for some of the sets.

        None where the dynamic stiffness does not follow the coefficients.
        """

        def counted(rows: Index, z: Array) -> NDArray[np.intp] | None:
            some = columns[:, members[rows]]
            number = np.empty(len(z), dtype=np.intp)
            try:
                halvings = max(GeneralRoute(self.reacting).needed(some), HALVINGS)
                for part, _, problem in self.reacting.problems(some, halvings):
                    number[part] = problem.evaluate(z[part], np.arange(len(part))).count
            except (ValueError, np.linalg.LinAlgError):
                return None
            return number - (self.reacting.coordinates - self.spatial.coordinates)

        return counted

    def _edges(self, columns: Array, left: Array, length: Array) -> list[tuple[Index, Array, tuple[int, ...]]]:
        if self.spatial.breaks is None:
            return [(np.arange(len(left)), np.stack([left, left + length], axis=1), ())]
        return self.spatial.breaks.edges(columns, left, length)

    def _evaluated(self, columns: Array) -> Callable[[Array, Index], dict[str, Entries]]:
        alike = np.ptp(columns, axis=1) == 0.0 if columns.size else np.ones(len(columns), dtype=bool)

        def coefficients(x: Array, rows: Index) -> dict[str, Entries]:
            values = [c[0] if same else c[rows][:, None] for c, same in zip(columns, alike, strict=True)]
            with np.errstate(all="ignore"):
                found = self.coefficients.function(x, *values)
                if not all(np.isfinite(entry).all() for entry in found):  # exp(800 x) / (1 + exp(800 x)) is bounded
                    longer = self.coefficients.function(x.astype(np.longdouble), *values)
                    found = [np.asarray(entry, dtype=float) for entry in longer]
            parts: dict[str, dict[tuple[int, int], Array]] = {name: {} for name in "WBDRMNC"}
            for (name, i, j), entry in zip(self.entries, found, strict=True):
                parts[name][i, j] = np.asarray(entry, dtype=float)
            return parts  # type: ignore[return-value]

        return coefficients

    def _points(self, columns: Array, nodes: tuple[int, ...]) -> tuple[PointTerm, ...]:
        points = self.spatial.points
        if points is None:
            return ()
        sets = columns.shape[1]
        found = []
        terms = points.at(np.zeros(sets), columns)
        for node, (stiffness, rate), held in zip(nodes, terms, points.held, strict=True):
            shape = (sets, *np.shape(stiffness)[-2:])
            springs = springs_and_supports(np.broadcast_to(stiffness, shape), held)
            found.append(PointTerm(node, *springs, -np.broadcast_to(rate, shape)))
        return tuple(found)

    # ------------------------------------------------------------------------------------------ the ends

    def _ends(self, columns: Array, infinite: tuple[int, ...]) -> tuple[Array, Array, Array]:
        """Return directions and stiffnesses of the springs at the ends, conditions included, and the masses there."""
        spatial, sets = self.spatial, columns.shape[1]
        size = 2 * spatial.displacements + spatial.coordinates
        parts = [held_directions(spatial.free, columns, size)]
        bare = columns.copy()
        for position in spatial.end_stiffness:
            bare[position] = 0.0
        for position in infinite:
            held = spatial.rigid_directions(position, columns)
            parts.append(springs_of(np.broadcast_to(held, (sets, size, size)), np.full(sets, np.inf)))
        for position, rate in spatial.end_stiffness.items():
            if position not in infinite and columns[position].any():
                parts.append(springs_of(np.broadcast_to(rate(*columns), (sets, size, size)), columns[position]))
        stiffness, mass = (np.broadcast_to(m, (sets, size, size)) for m in spatial.boundary(np.zeros(sets), *bare))
        parts.append(springs_of(stiffness, np.ones(sets)))
        directions = np.concatenate([np.broadcast_to(d, (sets, *d.shape[1:])) for d, _ in parts], axis=1)
        springs = np.concatenate([np.broadcast_to(k, (sets, *k.shape[1:])) for _, k in parts], axis=1)
        _, full = spatial.boundary(np.zeros(sets), *columns)
        return directions, springs, -np.broadcast_to(full, mass.shape)


def springs_and_supports(matrix: Array, held: tuple[int, ...]) -> tuple[Array, Array]:
    """Return the stiffness matrix of an interior place as springs, with an infinite one for each held displacement."""
    directions, springs = springs_of(matrix, np.ones(len(matrix)))
    sets = len(matrix)
    rows = np.broadcast_to(np.eye(matrix.shape[-1])[list(held)], (sets, len(held), matrix.shape[-1]))
    directions = np.broadcast_to(directions, (sets, *directions.shape[1:]))
    springs = np.broadcast_to(springs, (sets, springs.shape[1]))
    return np.concatenate([directions, rows], axis=1), np.concatenate(
        [springs, np.full((sets, len(held)), np.inf)], axis=1
    )


def held_directions(free: Kernel | None, columns: Array, size: int) -> tuple[Array, Array]:
    """Return the directions that the essential conditions hold, with infinite stiffness."""
    if free is None:
        return np.eye(size)[None], np.full((1, size), np.inf)
    motions = np.asarray(free(*columns))
    motions = _one_if_equal(motions.reshape(-1, *motions.shape[-2:]))
    still = (motions == 0.0).all(axis=(0, 2))  # imposed exactly
    units = np.broadcast_to(np.eye(size)[still], (len(motions), int(still.sum()), size))
    frame = np.linalg.svd(motions[:, ~still])[0][..., motions.shape[-1] :].swapaxes(-1, -2)
    others = np.zeros((*frame.shape[:2], size))
    others[..., ~still] = frame
    directions = np.concatenate([units, others], axis=1)
    return directions, np.full(directions.shape[:2], np.inf)


def springs_of(matrix: Array, factor: Array) -> tuple[Array, Array]:
    """Return a stiffness matrix times a factor as springs on directions."""
    value, frame = np.linalg.eigh(_one_if_equal(np.asarray(matrix)))
    with np.errstate(invalid="ignore"):
        there = np.abs(value) > 1e-14 * np.abs(value).max(axis=-1, keepdims=True)
    springs = np.where(there, value, 0.0)
    kept = there.any(axis=0)
    with np.errstate(invalid="ignore"):
        stiff = np.where(springs[:, kept] == 0.0, 0.0, springs[:, kept] * _one_if_equal(factor[:, None]))
    return frame.swapaxes(-1, -2)[:, kept], stiff


def _one_if_equal(values: Array) -> Array:
    """Return one set instead of all if they are equal."""
    return values[:1] if len(values) > 1 and (values == values[:1]).all() else values


# Modes -----------------------------------------------------------------------------------------------------------


@dataclass(frozen=True, eq=False)
class StressModes:
    """Modes of a batch; ``omega`` has the shape of the batch, ``columns`` are flat."""

    omega: Array
    spatial: SpatialProblem
    columns: Array
    found: list[Found]

    @property
    def _z(self) -> Array:
        return self.omega.reshape(-1, self.omega.shape[-1]) ** 2

    def _collected(self, part: Callable[[Found], Array]) -> Array:
        """Collect an array from all groups; the first axis is the parameter sets."""
        first = part(self.found[0])
        whole = np.empty((len(self._z), *first.shape[1:]))
        for found in self.found:
            whole[found.rows] = part(found)
        return whole

    @cached_property
    def _ends(self) -> Array:
        """(q(left), w, q(right)), (sets, modes, 2 n + m)."""
        return self._collected(lambda found: found.fields.ends)

    @cached_property
    def _forces(self) -> Array:
        """Natural forces of both ends, (sets, modes, 2, n)."""
        return self._collected(lambda found: np.stack([f[..., [0, -1]] for f in found.fields.force_ends], axis=-1))

    @cached_property
    def _sign(self) -> Array:
        finite = np.where(np.isinf(self.columns), 0.0, self.columns)
        places = overview_places(self.spatial, finite, len(self._z))
        states = self._collected(lambda found: found.fields.states(places[found.rows]))
        return mode_sign(states[..., : self.spatial.displacements])

    def _signed(self, values: Array) -> Array:
        return (self._sign[..., 0] * values).reshape(self.omega.shape)

    def displacement(self, end: int, place: int) -> Array:
        """Return a displacement of an end section, shape (..., modes)."""
        offset = end * (self.spatial.displacements + self.spatial.coordinates)
        return self._signed(self._ends[..., offset + place])

    def force(self, end: int, place: int) -> Array:
        """Return the natural force conjugate to it, shape (..., modes)."""
        return self._signed(self._forces[..., end, place])

    def coordinate(self, number: int) -> Array:
        """Return a lumped coordinate, shape (..., modes)."""
        return self._signed(self._ends[..., self.spatial.displacements + number])

    def shape(self, place: int, derivative: int, x: Array) -> Array:
        """Return a derivative of a displacement of the section at places, shape (..., modes, stations)."""
        z = self._z
        x = np.broadcast_to(x, (*self.omega.shape[:-1], x.shape[-1])).reshape(len(z), -1)
        state = self._states(x)
        finite = np.where(np.isinf(self.columns), 0.0, self.columns)
        row = self.spatial.derivative_row(place, derivative, z, x[:, None], finite)
        found: Array = self._sign * (row * state).sum(axis=-1)
        shape: Array = found.reshape(*self.omega.shape, x.shape[-1])
        return shape

    def _states(self, x: Array) -> Array:
        key = x.tobytes()
        kept: dict[bytes, Array] = self.__dict__.setdefault("_kept", {})
        if key not in kept:
            kept.clear()  # one set of stations at a time: those of a quadrature serve many forms
            kept[key] = self._collected(lambda found: found.fields.states(x[found.rows]))
        return kept[key]

    def stations(self) -> tuple[Array, Array]:
        """Return points and weights of a quadrature that respects the breakpoints, shape (..., points)."""
        most = max(found.fields.columns.weights.shape[1] for found in self.found)
        x, weights = np.empty((len(self._z), most)), np.zeros((len(self._z), most))
        for found in self.found:
            columns = found.fields.columns
            number = columns.weights.shape[1]
            x[found.rows, :number] = columns.grid.x.reshape(-1, number)
            x[found.rows, number:] = x[found.rows, number - 1 : number]
            weights[found.rows, :number] = columns.weights
        shape = (*self.omega.shape[:-1], most)
        return x.reshape(shape), weights.reshape(shape)

    def integral(self, place: int) -> Array:
        """Return the integral of a displacement over the domain, shape (..., modes)."""

        def part(found: Found) -> Array:
            columns = found.fields.columns
            values = found.fields.displaced[place]
            integral: Array = (values.reshape(*values.shape[:2], -1) * columns.weights[:, None]).sum(axis=-1)
            return integral

        return self._signed(self._collected(part))
