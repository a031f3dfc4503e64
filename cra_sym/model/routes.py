"""Protocol of the methods ("routes") for frequencies and modes, and the one for any linear conservative model."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any, Protocol, runtime_checkable

import numpy as np
from numpy.typing import NDArray

from cra_sym.cached import cached_property
from cra_sym.model.announced import refinement
from cra_sym.model.spatial import HALVINGS, SpatialProblem
from cra_sym.model.values import flat_columns
from cra_sym.solvers.eigenvalues import lowest
from cra_sym.solvers.shapes import mode_states
from cra_sym.solvers.stiffness import GOLDEN
from cra_sym.solvers.stress_mesh import Sampler, places, resolved
from cra_sym.solvers.stress_refine import cure

__all__ = [
    "ROUNDING",
    "TOLERANCE",
    "Estimated",
    "GeneralRoute",
    "Modes",
    "Rated",
    "RigidShare",
    "Route",
    "StateModes",
    "Stations",
    "mode_sign",
    "overview_places",
]

Array = NDArray[np.float64]
_SHARES = (0.0, 0.22, 0.53, 0.81, 1.0 - 1e-4, 1.0)  # ends, and positions that are not nodes of the first modes
ROUNDING = 1e-11
"""Bound of the relative rounding of frequencies from closed forms and from the dynamic stiffness."""
TOLERANCE = 1e-10
"""Relative error of a natural frequency beyond which it is refused, unless a system states its own."""
_NO_DIGIT = 5e-3  # relative error of a frequency without a digit that counts
_FEWEST, _MOST = 2, 11  # halvings of the two parts of a problem that varies along x
_CAUTION = 4.0  # two results may by chance differ by less than their rounding errors
Values = Sequence[float | Array]
"""Parameters in the order of the model's symbols; they broadcast to the shape of the batch."""


class Modes(Protocol):
    """The first natural modes of a batch, mass-normalised, positive at the right end of the first field.

    Where the displacement of the first field vanishes there, its first derivative that does not is positive.

    """

    @property
    def omega(self) -> Array:
        """Natural frequencies, rad/s, shape (..., modes)."""

    def displacement(self, end: int, place: int) -> Array:
        """Return a displacement of the left (0) or right (1) end section, shape (..., modes)."""

    def force(self, end: int, place: int) -> Array:
        """Return the natural force P conjugate to it; P acts at the right end, -P at the left."""

    def coordinate(self, number: int) -> Array:
        """Return a lumped coordinate, shape (..., modes)."""

    def shape(self, place: int, derivative: int, x: Array) -> Array:
        """Return a derivative of a displacement of the section at places x of shape (stations,) or (..., stations)."""

    def integral(self, place: int) -> Array | None:
        """Return the integral of a displacement over the domain, or None where only quadrature gives it."""


@runtime_checkable
class RigidShare(Protocol):
    """Modes with a method for their momentum in a rigid translation of the first field."""

    def momentum(self) -> Array:
        """Return the integral of mass per length times shape, end masses included, shape (..., modes)."""


@runtime_checkable
class Estimated(Protocol):
    """A route that estimates its own error."""

    def estimated(self, values: Values, shape: tuple[int, ...], modes: int, tolerance: float) -> tuple[Array, Array]:
        """Return the first natural frequencies and an estimate of their largest relative error, shape ``shape``.

        A ``ValueError`` is raised if it exceeds the tolerance.
        """

    def estimated_modes(self, values: Values, shape: tuple[int, ...], omega: Array, tolerance: float) -> Modes:
        """Return the modes of all the first frequencies, to the accuracy that the tolerance allows."""


@runtime_checkable
class Rated(Protocol):
    """A route that gives derivatives of the frequencies without modes."""

    def rates(
        self, values: Values, shape: tuple[int, ...], omega: Array, positions: Sequence[int]
    ) -> Sequence[Array] | None:
        """Return the derivatives of omega^2 by some parameters, shape (*shape, modes) each, or None.

        They are nan for repeated frequencies, and where rounding would spoil them.
        """


@runtime_checkable
class Stations(Protocol):
    """Modes with a quadrature rule of their own."""

    def stations(self) -> tuple[Array, Array]:
        """Return points and weights of a quadrature along the domain, shape (..., points)."""


class Route(Protocol):
    """Protocol of a method for the frequencies and modes of a model."""

    def covers(self, values: Values) -> bool:
        """Return whether the route is valid for these values; the general one is for all."""

    def angular_frequencies(self, values: Values, shape: tuple[int, ...], modes: int) -> Array:
        """Return the first natural frequencies, rad/s, ascending and complete, shape (*shape, modes)."""

    def modes(self, values: Values, shape: tuple[int, ...], omega: Array) -> Modes:
        """Return the modes of all the first frequencies."""


@dataclass(frozen=True, eq=False)
class GeneralRoute:
    """Dynamic stiffness: any linear conservative model, with coefficients that vary along x too."""

    spatial: SpatialProblem

    def covers(self, values: Values) -> bool:
        """Return True: values that are out of range are refused by name."""
        return True

    def angular_frequencies(self, values: Values, shape: tuple[int, ...], modes: int) -> Array:
        """Return the first natural frequencies, rad/s, ascending and complete, shape (*shape, modes)."""
        return np.sqrt(self._squares(flat_columns(values, shape), modes, HALVINGS)[0]).reshape(*shape, modes)

    def _squares(self, columns: Array, modes: int, halvings: int) -> tuple[Array, int]:
        """Return the squared frequencies, shape (sets, modes), and by how many halvings along x at most.

        ``halvings`` are the fewest; short waves need more.
        """
        if self.spatial.points is not None:
            raise ValueError(
                "inside: terms at interior places need a density without inertia of the highest derivatives by x"
            )
        squares, most = np.empty((columns.shape[1], modes)), halvings
        for rows, _, problem in self.spatial.problems(columns, halvings):
            squares[rows] = found = lowest(problem, modes)
            if not self.spatial.uniform:
                most = max(most, int(problem.levels(found[:, -1], np.arange(len(rows))).max()))
        return squares, most

    def estimated(self, values: Values, shape: tuple[int, ...], modes: int, tolerance: float) -> tuple[Array, Array]:
        """Return the frequencies and an estimate of their largest relative error, shape ``shape``.

        Where coefficients vary along x, the estimate is the difference between two step sizes. Smaller steps reduce the
        error of the integration and increase rounding.
        """
        if self.spatial.uniform:
            return self.angular_frequencies(values, shape, modes), np.full(shape, ROUNDING)
        columns = flat_columns(values, shape)
        before, halvings = self._squares(columns, modes, max(self.needed(columns), _FEWEST))
        least = np.full((columns.shape[1], modes), np.inf)
        with refinement() as progress:
            while halvings < _MOST:
                try:
                    squares, halvings = self._squares(columns, modes, halvings + 1)
                except ValueError:  # rounding error of so many steps in a soft direction
                    if np.isinf(least).all():
                        raise
                    break
                with np.errstate(divide="ignore", invalid="ignore"):
                    error = 0.5 * _CAUTION * np.where(squares == before, 0.0, np.abs(squares - before) / squares)
                before, least = squares, np.minimum(least, error)
                accuracy = np.maximum(error.max(axis=1), ROUNDING)
                if (error <= tolerance).all():
                    return np.sqrt(squares).reshape(*shape, modes), accuracy.reshape(shape)
                progress(float(error.max()), f"{2 ** (halvings + 1)} steps")
        row, mode = np.unravel_index(int(np.argmax(least)), least.shape)
        if least[row, mode] > _NO_DIGIT:
            raise ValueError(
                f"modes = {modes}: frequency {mode + 1} agrees between no two step sizes, since the rounding error of "
                "the stiffness hides it, as it does for rigid-body motions and soft springs; hold such motions by "
                "essential conditions or stiffer springs, or use ritz, which estimates no error"
            )
        raise ValueError(
            f"modes = {modes}: the relative error of frequency {mode + 1} stays at {least[row, mode]:.1g}; it comes "
            f"from the coefficients near x = {self._steepest(columns[:, row]):.6g}; {cure(least[row, mode])}"
        )

    def needed(self, columns: Array) -> int:
        """Return the number of halvings of the parts for which every coefficient is a polynomial on each step.

        Raises
        ------
        ValueError
            If it is too often: names the place.
        """
        needed = 0
        for some, edges in self._between_breaks(columns):
            ends, _, _ = resolved(
                self._sampler(some),
                edges,
                np.arange(edges.shape[1], dtype=float),
                "coefficients",
                self.spatial.variation(some),
            )
            width = (np.diff(places(ends, edges), axis=1) / (edges[:, -1:] - edges[:, :1])).min(axis=1)
            if (np.log2(GOLDEN / width) > _MOST - 1).any():
                row = int(np.argmin(width))
                at = places(ends, edges[row : row + 1])[0]
                finest = int(np.argmin(np.diff(at)))
                raise ValueError(
                    f"coefficients vary too finely at x = {at[finest]:.6g} to {at[finest + 1]:.6g} for a density with "
                    f"inertia of the highest derivatives by x: {2 ** (_MOST + 1)} steps along x do not suffice"
                )
            needed = max(needed, int(np.ceil(np.log2(GOLDEN / width)).max()))
        return needed

    def _between_breaks(self, columns: Array) -> Iterator[tuple[Array, Array]]:
        """Yield finite parameters, and (left end, breakpoints, right end), of sets that have as many."""
        finite = np.where(np.isinf(columns), 0.0, columns)
        length, left = (np.broadcast_to(value, finite.shape[1:]) for value in self.spatial.geometry.function(*finite))
        if self.spatial.breaks is None:
            yield finite, np.stack([left, left + length], axis=1)
            return
        for members, edges, _ in self.spatial.breaks.edges(finite, left, length):
            yield finite[:, members], edges

    def _sampler(self, columns: Array) -> Sampler:
        """Return the entries of the system at unit z along x."""

        def sample(x: Array) -> Array:
            found = np.asarray(self.spatial.system(x, 1.0, *columns[..., None])[0])
            return np.ascontiguousarray(np.moveaxis(found.reshape(*found.shape[:-2], -1), -1, 0))

        return sample

    def _steepest(self, column: Array) -> float:
        """Return the position at which the coefficients of a set change most."""
        ((some, edges),) = self._between_breaks(column[:, None])
        x = np.linspace(edges[0, 0], edges[0, -1], 4099)[1:-1]
        found = self._sampler(some)(x[None])[:, 0]
        size = np.abs(found).max(axis=1, keepdims=True)
        change = np.abs(np.diff(found, axis=1)) / np.where(size > 0.0, size, 1.0)
        return float(x[change.max(axis=0).argmax()])

    def estimated_modes(self, values: Values, shape: tuple[int, ...], omega: Array, tolerance: float) -> StateModes:
        """Return the modes of all the first frequencies."""
        return self.modes(values, shape, omega)

    def modes(self, values: Values, shape: tuple[int, ...], omega: Array) -> StateModes:
        """Return the modes of all the first frequencies."""
        columns = flat_columns(values, shape)
        z = omega.reshape(-1, omega.shape[-1]) ** 2
        return StateModes(omega, self.spatial, columns, partial(self._states, columns, z))

    def _states(self, columns: Array, z: Array, x: Array) -> Array:
        """Return the state of every mode at places x (rows, stations), shape (rows, modes, stations, 2 n + m)."""
        state = np.empty((*z.shape, x.shape[-1], 2 * self.spatial.displacements + self.spatial.coordinates))
        for rows, left, problem in self.spatial.problems(columns):
            state[rows] = mode_states(problem, z[rows], problem.shares(x[rows], left))
        return state


@dataclass(frozen=True, eq=False)
class StateModes:
    """Modes given by the state (q, w, P) of a section.

    Attributes
    ----------
    omega : ndarray, shape (..., modes)
    spatial : SpatialProblem
    columns : ndarray, shape (parameters, rows)
        Parameters of the flat batch.
    states : callable
        ``states(x)`` returns the states of all modes at places x (rows, stations), (rows, modes, stations, 2 n + m).
    """

    omega: Array
    spatial: SpatialProblem
    columns: Array
    states: Callable[[Array], Array]

    @cached_property
    def _z(self) -> Array:
        return self.omega.reshape(-1, self.omega.shape[-1]) ** 2

    @cached_property
    def _finite(self) -> Array:
        return np.where(np.isinf(self.columns), 0.0, self.columns)

    @cached_property
    def _ends(self) -> Array:
        """States at both ends, signed, shape (rows, modes, 2, 2 n + m)."""
        return self._signed(self._overview[:, :, [0, -1]])

    @cached_property
    def _overview(self) -> Array:
        """States at both ends and some places between, shape (rows, modes, stations, 2 n + m)."""
        return self.states(overview_places(self.spatial, self._finite, len(self._z)))

    @cached_property
    def _sign(self) -> Array:
        n, m = self.spatial.displacements, self.spatial.coordinates
        watched = n or m  # coordinates where there is no field
        return mode_sign(self._overview[..., :watched], self._overview[..., -1, n : n + m])

    def _signed(self, states: Array) -> Array:
        signed: Array = states * self._sign[..., None]
        return signed

    def _end(self, end: int, entry: int) -> Array:
        return self._ends[:, :, end, entry].reshape(self.omega.shape)

    def displacement(self, end: int, place: int) -> Array:
        """Return a displacement of an end section, shape (..., modes)."""
        return self._end(end, place)

    def force(self, end: int, place: int) -> Array:
        """Return the natural force conjugate to it, shape (..., modes)."""
        return self._end(end, self.spatial.displacements + self.spatial.coordinates + place)

    def coordinate(self, number: int) -> Array:
        """Return a lumped coordinate, shape (..., modes)."""
        return self._end(0, self.spatial.displacements + number)

    def shape(self, place: int, derivative: int, x: Array) -> Array:
        """Return a derivative of a displacement of the section at places, shape (..., modes, stations)."""
        x = np.broadcast_to(x, (*self.omega.shape[:-1], x.shape[-1])).reshape(len(self._z), x.shape[-1])
        row = self.spatial.derivative_row(place, derivative, self._z, x[:, None], self._finite)
        found = np.einsum("...i,...i->...", row, self._at(x))
        return np.asarray(found.reshape(*self.omega.shape, x.shape[-1]))

    def _at(self, x: Array) -> Array:
        key = x.tobytes()
        kept: dict[bytes, Array] = self.__dict__.setdefault("_kept", {})
        if key not in kept:
            found = self._signed(self.states(x))
            kept.clear()  # one set of stations at a time: those of a quadrature serve many forms
            kept[key] = found
        return kept[key]

    def integral(self, place: int) -> None:
        """Return None: only quadrature gives integrals."""
        return None


def overview_places(spatial: SpatialProblem, values: Array, rows: int) -> Array:
    """Return the places at which :func:`mode_sign` looks, shape (rows, stations)."""
    length, left = (np.broadcast_to(g, rows) for g in spatial.geometry.function(*values))
    return np.asarray(left[:, None] + np.multiply.outer(length, _SHARES))


def mode_sign(displacements: NDArray[Any], coordinates: NDArray[Any] | None = None) -> NDArray[Any]:
    """Return the sign of every mode, shape (rows, modes, 1); of complex modes a phase factor.

    It makes the first nonzero displacement of the right end positive, or else the first one next to that end, or else
    the first lumped coordinate.

    Parameters
    ----------
    displacements : ndarray, shape (rows, modes, stations, n)
        At the places of :func:`overview_places`.
    coordinates : ndarray, shape (rows, modes, m), optional
    """
    coordinates = displacements[:, :, 0, :0] if coordinates is None else coordinates
    size = np.abs(displacements).max(axis=(1, 2), initial=0.0)[:, None]
    lumped = np.abs(coordinates).max(axis=1, initial=0.0)[:, None]
    entries = np.concatenate([displacements[:, :, -1], displacements[:, :, -2], coordinates], axis=-1)
    least = np.concatenate([1e-7 * size, 1e-12 * size, 1e-12 * lumped], axis=-1)  # more than rounding there
    moving = np.abs(entries) > least
    first = np.take_along_axis(entries, moving.argmax(axis=-1)[..., None], axis=-1)
    if np.iscomplexobj(first):
        return np.asarray(np.conj(first) / np.where(first == 0.0, 1.0, np.abs(first)))
    return np.where(first < 0.0, -1.0, 1.0)
