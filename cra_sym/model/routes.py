"""How a model gets its numbers: one protocol, and the route that takes every linear conservative model."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property, partial
from typing import Protocol, runtime_checkable

import numpy as np
from numpy.typing import NDArray

from cra_sym.model.spatial import SpatialProblem
from cra_sym.model.values import flat_columns
from cra_sym.solvers.eigenvalues import lowest
from cra_sym.solvers.shapes import mode_states

__all__ = [
    "Estimated",
    "GeneralRoute",
    "Modes",
    "RigidShare",
    "Route",
    "StateModes",
    "Stations",
    "mode_sign",
    "overview_places",
]

Array = NDArray[np.float64]
_SHARES = (0.0, 0.22, 0.53, 0.81, 1.0 - 1e-4, 1.0)  # ends, and places that are not a node of the first modes
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
    """Modes that know their momentum in a rigid translation of the first field."""

    def momentum(self) -> Array:
        """Return the integral of mass per length times shape, end masses included, shape (..., modes)."""


@runtime_checkable
class Estimated(Protocol):
    """A route that estimates its own error."""

    def estimated(self, values: Values, shape: tuple[int, ...], modes: int) -> tuple[Array, Array]:
        """Return the first natural frequencies and the estimated largest relative error of them, shape ``shape``."""


@runtime_checkable
class Stations(Protocol):
    """Modes that know where a quadrature must have its points."""

    def stations(self) -> tuple[Array, Array]:
        """Return points and weights of a quadrature along the domain, shape (..., points)."""


class Route(Protocol):
    """How frequencies and modes of a model are computed."""

    def covers(self, values: Values) -> bool:
        """Return whether the route serves these values; the general one serves all."""

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
        if self.spatial.points is not None:
            raise ValueError("inside: terms at interior places need fields with first or second derivatives by x")
        columns = flat_columns(values, shape)
        squares = np.empty((columns.shape[1], modes))
        for rows, _, problem in self.spatial.problems(columns):
            squares[rows] = lowest(problem, modes)
        return np.sqrt(squares).reshape(*shape, modes)

    def modes(self, values: Values, shape: tuple[int, ...], omega: Array) -> StateModes:
        """Return the modes of all the first frequencies."""
        columns = flat_columns(values, shape)
        return StateModes(omega, self.spatial, columns, partial(self._states, columns))

    def _states(self, columns: Array, z: Array, x: Array) -> Array:
        """Return the state of every mode at places x (rows, stations), shape (rows, modes, stations, 2 n + m)."""
        state = np.empty((*z.shape, x.shape[-1], 2 * self.spatial.displacements + self.spatial.coordinates))
        for rows, left, problem in self.spatial.problems(columns):
            state[rows] = mode_states(problem, z[rows], problem.shares(x[rows], left))
        return state


States = Callable[[Array, Array], Array]


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
        ``states(z, x)`` returns the states of the modes with omega^2 = z (rows, modes) at places x (rows, stations).
    """

    omega: Array
    spatial: SpatialProblem
    columns: Array
    states: States

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
        return self.states(self._z, overview_places(self.spatial, self._finite, len(self._z)))

    @cached_property
    def _sign(self) -> Array:
        return mode_sign(self._overview[..., : self.spatial.displacements])

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
        x = np.broadcast_to(x, (*self.omega.shape[:-1], x.shape[-1])).reshape(len(self._z), -1)
        row = self.spatial.derivative_row(place, derivative, self._z, x[:, None], self._finite)
        return (row * self._at(x)).sum(axis=-1).reshape(*self.omega.shape, x.shape[-1])

    def _at(self, x: Array) -> Array:
        key = x.tobytes()
        kept: dict[bytes, Array] = self.__dict__.setdefault("_kept", {})
        if key not in kept:
            found = self._signed(self.states(self._z, x))
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


def mode_sign(displacements: Array) -> Array:
    """Return the sign of every mode, shape (rows, modes, 1).

    It makes positive the first displacement of the right end that is not zero, or else the first one beside that end.

    Parameters
    ----------
    displacements : ndarray, shape (rows, modes, stations, n)
        At the places of :func:`overview_places`.
    """
    size = np.abs(displacements).max(axis=(1, 2), initial=0.0)[:, None]
    entries = np.concatenate([displacements[:, :, -1], displacements[:, :, -2]], axis=-1)
    moving = np.abs(entries) > np.concatenate([1e-7 * size, 1e-12 * size], axis=-1)  # more than rounding there
    first = np.take_along_axis(entries, moving.argmax(axis=-1)[..., None], axis=-1)
    return np.where(first < 0.0, -1.0, 1.0)
