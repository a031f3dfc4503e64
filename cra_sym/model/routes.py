"""How a model gets its numbers: one protocol, and the route that takes every linear conservative model."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Protocol, runtime_checkable

import numpy as np
from numpy.typing import NDArray

from cra_sym.model.spatial import SpatialProblem
from cra_sym.model.values import flat_columns
from cra_sym.solvers.eigenvalues import lowest
from cra_sym.solvers.shapes import mode_states
from cra_sym.solvers.stiffness import DynamicStiffness

__all__ = ["GeneralRoute", "Modes", "RigidShare", "Route", "end_sign"]

Array = NDArray[np.float64]
_STATIONS = (0.0, 0.22, 0.53, 0.81, 1.0)  # ends, and places that are no node of the first modes
Values = Sequence[float | Array]
"""Parameters in the order of the model's symbols; they broadcast to the shape of the batch."""


class Modes(Protocol):
    """The first natural modes of a batch, mass-normalised, positive at the right end of the first field.

    Where the displacement of the first field vanishes there, its first derivative that does not is positive.

    Attributes
    ----------
    omega : ndarray, shape (..., modes)
        rad/s.
    """

    omega: Array

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


class Route(Protocol):
    """How frequencies and modes of a model are computed."""

    def angular_frequencies(self, values: Values, shape: tuple[int, ...], modes: int) -> Array:
        """Return the first natural frequencies, rad/s, ascending and complete, shape (*shape, modes)."""

    def modes(self, values: Values, shape: tuple[int, ...], omega: Array) -> Modes:
        """Return the modes of all the first frequencies."""


@dataclass(frozen=True, eq=False)
class GeneralRoute:
    """Dynamic stiffness: any linear conservative model, with coefficients that vary along x too."""

    spatial: SpatialProblem

    def angular_frequencies(self, values: Values, shape: tuple[int, ...], modes: int) -> Array:
        """Return the first natural frequencies, rad/s, ascending and complete, shape (*shape, modes)."""
        columns = flat_columns(values, shape)
        squares = np.empty((columns.shape[1], modes))
        for rows, _, problem in self.spatial.problems(columns):
            squares[rows] = lowest(problem, modes)
        return np.sqrt(squares).reshape(*shape, modes)

    def modes(self, values: Values, shape: tuple[int, ...], omega: Array) -> GeneralModes:
        """Return the modes of all the first frequencies."""
        return GeneralModes(omega, self.spatial, flat_columns(values, shape))


@dataclass(frozen=True, eq=False)
class GeneralModes:
    """Modes from the dynamic stiffness; ``omega`` has the shape of the batch, ``columns`` are flat."""

    omega: Array
    spatial: SpatialProblem
    columns: Array

    @cached_property
    def _problems(self) -> list[tuple[Array, Array, DynamicStiffness]]:
        return list(self.spatial.problems(self.columns))

    @cached_property
    def _ends(self) -> Array:
        """State (q, w, P) at both ends and some places between, shape (rows, modes, stations, 2 n + m)."""
        n, m = self.spatial.displacements, self.spatial.coordinates
        z = self._z
        state = np.empty((*z.shape, len(_STATIONS), 2 * n + m))
        for rows, _, problem in self._problems:
            state[rows] = mode_states(problem, z[rows], np.tile(_STATIONS, (len(rows), 1)))
        return state

    @cached_property
    def _sign(self) -> Array:
        n, m = self.spatial.displacements, self.spatial.coordinates
        left, right = self._ends[:, :, 0], self._ends[:, :, -1]
        size = np.abs(self._ends).max(axis=(1, 2), initial=0.0)[:, None]
        entries = np.concatenate([right[..., :n], left[..., :n], right[..., n + m :]], axis=-1)
        return end_sign(entries, np.concatenate([size[..., :n], size[..., :n], size[..., n + m :]], axis=-1))

    @property
    def _z(self) -> Array:
        return self.omega.reshape(-1, self.omega.shape[-1]) ** 2

    def _end(self, end: int, entry: int) -> Array:
        return (self._sign[..., 0] * self._ends[:, :, -end, entry]).reshape(self.omega.shape)

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
        z = self._z
        x = np.broadcast_to(x, (*self.omega.shape[:-1], x.shape[-1])).reshape(len(z), -1)
        state = self._states(x)
        finite = np.where(np.isinf(self.columns), 0.0, self.columns)
        row = self.spatial.derivative_row(place, derivative, z, x[:, None], finite)
        found = self._sign * (row * state).sum(axis=-1)
        return found.reshape(*self.omega.shape, x.shape[-1])

    def _states(self, x: Array) -> Array:
        key = x.tobytes()
        kept: dict[bytes, Array] = self.__dict__.setdefault("_kept", {})
        if key not in kept:
            n, m = self.spatial.displacements, self.spatial.coordinates
            state = np.empty((*self._z.shape, x.shape[-1], 2 * n + m))
            for rows, left, problem in self._problems:
                share = np.clip((x[rows] - left[:, None]) / problem.length[:, None], 0.0, 1.0)
                state[rows] = mode_states(problem, self._z[rows], share)
            kept.clear()  # one set of stations at a time: those of a quadrature serve many forms
            kept[key] = state
        return kept[key]

    def integral(self, place: int) -> None:
        """Return None: only quadrature gives integrals."""
        return None


def end_sign(entries: Array, size: Array) -> Array:
    """Return the sign that makes the first entry of every mode positive that is not zero, shape (..., modes, 1).

    Parameters
    ----------
    entries : ndarray, shape (..., modes, n)
        Displacements of the right end, then those of the left end, then forces of the right end.
    size : ndarray, shape (..., 1, n)
        What is large for each: the most in the domain and all modes.
    """
    moving = np.abs(entries) > 1e-7 * np.where(size > 0.0, size, np.inf)
    first = np.take_along_axis(entries, moving.argmax(axis=-1)[..., None], axis=-1)
    return np.where(first < 0.0, -1.0, 1.0)
