"""Loads and bilinear forms of a model projected on its natural modes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from cra_sym.cached import cached_property
from cra_sym.kernels import Kernel, kernel
from cra_sym.model.cuts import Cuts
from cra_sym.model.moving import Jumps
from cra_sym.model.routes import Modes, RigidShare, Stations

__all__ = [
    "BilinearForm",
    "Displacement",
    "Domain",
    "EndParameter",
    "Load",
    "Projected",
    "displaced_at",
    "project",
    "stations",
]

Array = NDArray[np.float64]
_POINTS, _WEIGHTS = np.polynomial.legendre.leggauss(10)
_MOST_KEPT = 1_000_000  # numbers of one displacement of all modes that are stored for the next form


class Displacement(NamedTuple):
    """A displacement: along the interval, of an end section or a lumped coordinate.

    Attributes
    ----------
    where : {'inside', 'left', 'right', 'lumped', 'point'}
    entry : int
        Of the section's displacement, or of the coordinate.
    order : int
        Derivative by x of that displacement; 0 at the ends.
    number : int
        Of the interior place.
    """

    where: Literal["inside", "left", "right", "lumped", "point"]
    entry: int
    order: int
    number: int = 0


@dataclass(frozen=True)
class Load:
    """Generalised forces of a unit input.

    Attributes
    ----------
    inside, ends : tuple of Displacement
        Displacements they act on: along the interval, and at the ends or on lumped coordinates.
    density : Kernel
        Of (x, parameters): forces per length on ``inside``.
    force : Kernel
        Of the parameters: forces on ``ends``.
    uniform : bool
        Whether the density is constant along x.
    share : Kernel or None
        Of the parameters: factor of the part of this load that is the inertia of a rigid translation of the first
        field; only if its mass is one uniform density with end masses.
    rest, rest_ends
        Forces on both ends that remain besides that part.
    places : Kernel or None
        Of the parameters: interior places, if there are any.
    cuts : Cuts or None
        Where the density is not smooth, if it is not.
    """

    inside: tuple[Displacement, ...]
    ends: tuple[Displacement, ...]
    density: Kernel
    force: Kernel
    uniform: bool
    share: Kernel | None = None
    rest: Kernel | None = None
    rest_ends: tuple[Displacement, ...] = ()
    places: Kernel | None = None
    cuts: Cuts | None = None

    @classmethod
    def unit(cls, place: Displacement, at: float, symbols: Sequence[Any]) -> Load:
        """Return one unit of force on a displacement; ``at`` is where an interior place is."""
        none, one = (kernel(values, symbols, backend="numpy") for values in ((), (1.0,)))
        return cls((), (place,), none, one, True, places=kernel((at,), symbols, backend="numpy"))


@dataclass(frozen=True)
class BilinearForm:
    """Bilinear forms with common entries, such as the rates of stiffness and mass by every parameter.

    Attributes
    ----------
    names : tuple of str
        One for each form. Those called 'stiffness' and 'mass', if there, are the whole energies.
    inside, ends : tuple of (Displacement, Displacement)
        Entries, each once.
    density, points : Kernel
        Of (x, parameters) and of the parameters: coefficients of all entries of the first form, then of the next.
    uniform : bool
        Whether the coefficients inside are constant along x.
    jumps : Jumps or None
        Of the coefficients inside, if the forms are rates by the parameters: then 'stiffness' and 'mass' are there,
        and '<parameter> stiffness' and '<parameter> mass' in the order of the parameters.
    places : Kernel or None
        Of the parameters: interior places, if there are any.
    cuts : Cuts or None
        As of a `Load`.
    """

    names: tuple[str, ...]
    inside: tuple[tuple[Displacement, Displacement], ...]
    ends: tuple[tuple[Displacement, Displacement], ...]
    density: Kernel
    points: Kernel
    uniform: bool
    jumps: Jumps | None = None
    places: Kernel | None = None
    cuts: Cuts | None = None


class EndParameter(NamedTuple):
    """A parameter that adds itself, times a factor, to the stiffness or to the inertia of one displacement of an end.

    Attributes
    ----------
    end, place : int
        Left (0) or right (1), and which displacement.
    factor : Kernel
        Of the parameters.
    """

    end: int
    place: int
    factor: Kernel


class Domain(NamedTuple):
    """Domain and parameters of a batch of modes.

    Attributes
    ----------
    values : sequence of float or ndarray
        Parameters in the order of the model's symbols, infinite ones replaced by 0.
    left, length : float or ndarray
        m.
    """

    values: Sequence[float | Array]
    left: float | Array
    length: float | Array


def column(value: float | Array, axes: int = 1) -> float | Array:
    """Return a parameter with last axes of length one, for modes and points; numbers stay numbers."""
    return value[(..., *(None,) * axes)] if isinstance(value, np.ndarray) and value.ndim else value


def stations(domain: Domain, modes: Modes, cuts: Cuts | None = None) -> tuple[Array, Array]:
    """Return points and weights of a quadrature along the domain, shape (points,) or (..., points)."""
    panels = modes.omega.shape[-1] + 8  # ten points each: several to a half-wave of the highest mode
    if cuts is not None and (cuts.elsewhere or not isinstance(modes, Stations)):
        return cuts.stations(domain.values, domain.left, domain.length, modes.omega.shape[:-1], 2 * panels)
    if isinstance(modes, Stations):
        return modes.stations()
    share = ((np.arange(panels)[:, None] + 0.5 * (1.0 + _POINTS)) / panels).ravel()
    length = column(domain.length)
    return np.asarray(column(domain.left) + share * length), np.tile(0.5 * _WEIGHTS / panels, panels) * length


_ASIDE = 1e-10  # lengths; a quantity that jumps at a place is evaluated on both sides of it


def displaced(domain: Domain, modes: Modes, place: Displacement, places: Kernel | None) -> Array:
    """Return a displacement of an end, an interior place or a lumped coordinate of every mode, shape (..., modes)."""
    if place.where == "point" and places is not None:
        return _at_place(domain, modes, place, places)
    if place.where == "lumped":
        return modes.coordinate(place.entry)
    return modes.displacement(int(place.where == "right"), place.entry)


def _at_place(domain: Domain, modes: Modes, place: Displacement, places: Kernel) -> Array:
    at = np.broadcast_to(column(places.function(*domain.values)[place.number]), (*modes.omega.shape[:-1], 1))
    left = column(domain.left)
    there = (at > left) & (at < left + column(domain.length))
    return np.where(
        there, displaced_at(domain, modes, place.entry, place.order, np.where(there, at, left)[..., 0]), 0.0
    )


def displaced_at(domain: Domain, modes: Modes, entry: int, order: int, place: float | Array) -> Array:
    """Return a derivative of a displacement of every mode at a place of the domain, shape (..., modes).

    At a jump it is the mean of both sides.
    """
    at = np.broadcast_to(column(place), (*modes.omega.shape[:-1], 1))
    left = column(domain.left)
    right, aside = left + column(domain.length), _ASIDE * column(domain.length)
    if not order:
        return modes.shape(entry, 0, at)[..., 0]
    inside = (at > left) & (at < right)
    before, after = (modes.shape(entry, order, at + np.where(inside, side * aside, 0.0))[..., 0] for side in (-1, 1))
    return 0.5 * (before + after)


def along(modes: Modes, place: Displacement, x: Array) -> Array:
    """Return a displacement of every mode at places along the interval, shape (..., modes, stations)."""
    if place.where == "lumped":
        return modes.coordinate(place.entry)[..., None]
    return modes.shape(place.entry, place.order, x)


def project(domain: Domain, modes: Modes, load: Load) -> Array:
    """Return the generalised force of a load on every mode, shape (..., modes)."""
    if load.share is not None and load.rest is not None and isinstance(modes, RigidShare):
        total = column(load.share.function(*domain.values)) * modes.momentum()
        return _add_ends(total, domain, modes, load, load.rest_ends, load.rest.function(*domain.values))
    total = np.zeros(modes.omega.shape)
    total = _add_ends(total, domain, modes, load, load.ends, load.force.function(*domain.values))
    if not load.inside:
        return total
    x, weights = stations(domain, modes, load.cuts)
    density = load.density.function(x, *map(column, domain.values))
    for place, factor in zip(load.inside, density, strict=True):
        total = total + ((factor * weights)[..., None, :] * along(modes, place, x)).sum(axis=-1)
    return total


def _add_ends(
    total: Array,
    domain: Domain,
    modes: Modes,
    load: Load,
    places: Sequence[Displacement],
    forces: Sequence[float | Array],
) -> Array:
    for place, force in zip(places, forces, strict=True):
        total = total + column(force) * displaced(domain, modes, place, load.places)
    return total


class Projected:
    """Bilinear forms between modes, or of each mode with itself; the integrals are shared by all forms.

    Parameters
    ----------
    domain : Domain
    modes : Modes
    form : BilinearForm
    diagonal : bool
        Whether only a mode with itself is wanted: arrays of shape (..., modes) instead of (..., modes, modes).
    """

    def __init__(self, domain: Domain, modes: Modes, form: BilinearForm, *, diagonal: bool = False) -> None:
        self._domain, self._modes, self._form, self._diagonal = domain, modes, form, diagonal
        self._shapes: dict[Displacement, Array] = {}

    def __getitem__(self, name: str) -> Array:
        """Return the form of that name.

        Raises
        ------
        KeyError
            If there is none.
        """
        if name not in self._form.names:
            raise KeyError(name)
        number = self._form.names.index(name)
        axes = 1 if self._diagonal else 2
        total: Array = np.zeros(self._shape)
        for factor, product in zip(self._points[number], self._ends, strict=True):
            if not _is_zero(factor):
                total += column(factor, axes) * product
        for entry in range(len(self._form.inside)):
            total += self._inside(number, entry)
        if self._form.jumps is not None and number > 1:
            total = total + self._moved(self._form.jumps, *divmod(number - 2, 2))
        return total

    def _moved(self, jumps: Jumps, parameter: int, kind: int) -> Array | float:
        """Return the rate of stiffness (0) or mass (1) due to jumps that move with a parameter.

        Where the displacement itself jumps, such as a curvature, its values on the two sides are multiplied with each
        other, since the conjugate force is continuous.
        """
        shape = self._modes.omega.shape[:-1]
        values = [np.broadcast_to(value, shape).ravel() for value in self._domain.values]
        *sides, rate = jumps.sides(np.array(values).reshape(len(values), -1))
        if not rate[parameter].any():
            return 0.0
        entries = len(self._form.inside)
        before, after = (side.reshape(*shape, -1) for side in sides)
        density = [self._form.density.function(x, *map(column, self._domain.values)) for x in (before, after)]
        total: Array = np.zeros(self._shape)
        for entry, (first, second) in enumerate(self._form.inside):
            k = kind * entries + entry
            factor = (density[0][k] - density[1][k]) * rate[parameter].reshape(*shape, -1)
            for one, other in ((before, after), (after, before)):
                left, right = along(self._modes, first, one), along(self._modes, second, other)
                weighted = left * (0.5 * factor)[..., None, :]
                total += (weighted * right).sum(axis=-1) if self._diagonal else weighted @ right.swapaxes(-1, -2)
        return total

    @property
    def _shape(self) -> tuple[int, ...]:
        shape = self._modes.omega.shape
        return shape if self._diagonal else (*shape, shape[-1])

    @cached_property
    def _points(self) -> list[Sequence[float | Array]]:
        return self._by_form(self._form.points.function(*self._domain.values), len(self._form.ends))

    @cached_property
    def _density(self) -> list[Sequence[float | Array]]:
        """Coefficients inside, at the stations of the quadrature unless they are constant along x."""
        if self._form.uniform:
            values = self._form.density.function(0.0, *self._domain.values)
        else:
            values = self._form.density.function(self._stations[0], *map(column, self._domain.values))
        return self._by_form(values, len(self._form.inside))

    def _by_form(self, values: Sequence[float | Array], entries: int) -> list[Sequence[float | Array]]:
        return [values[k * entries : (k + 1) * entries] for k in range(len(self._form.names))]

    @cached_property
    def _stations(self) -> tuple[Array, Array]:
        return stations(self._domain, self._modes, self._form.cuts)

    @cached_property
    def _ends(self) -> list[Array]:
        places = self._form.places
        return [
            self._product(*(displaced(self._domain, self._modes, place, places) for place in pair))
            for pair in self._form.ends
        ]

    def _product(self, first: Array, second: Array) -> Array:
        return first * second if self._diagonal else first[..., :, None] * second[..., None, :]

    def _inside(self, number: int, entry: int) -> Array | float:
        factor = self._density[number][entry]
        if _is_zero(factor):
            return 0.0
        if self._form.uniform:
            return column(factor, 1 if self._diagonal else 2) * self._integrals[entry]
        return self._quadrature(entry, factor)

    def _quadrature(self, entry: int, factor: float | Array) -> Array:
        """Return the integral of a coefficient times both displacements of an entry."""
        _, weights = self._stations
        one, other = self._form.inside[entry]
        first = self._along(one)
        second = first if other == one else self._along(other)
        weighted = np.broadcast_to(factor * weights, np.broadcast_shapes(np.shape(factor), np.shape(weights)))
        if self._diagonal:
            return np.asarray((weighted[..., None, :] * first * second).sum(axis=-1))
        stations = np.broadcast_shapes(first.shape[-1:], second.shape[-1:], weighted.shape[-1:])
        second = np.broadcast_to(second, (*second.shape[:-1], *stations))
        product = (first * weighted[..., None, :]) @ second.swapaxes(-1, -2)
        symmetric = self._form.inside[entry][0] == self._form.inside[entry][1]
        return (product + product.swapaxes(-1, -2)) / 2 if symmetric else product

    def _along(self, place: Displacement) -> Array:
        """Return a displacement of every mode at the stations; computed once unless it is large."""
        found = self._shapes.get(place)
        if found is None:
            found = along(self._modes, place, self._stations[0])
            if found.size <= _MOST_KEPT:
                self._shapes[place] = found
        return found

    @cached_property
    def _integrals(self) -> list[Array]:
        """Integrals of the products of every entry, from the normalisation where that determines them."""
        form = self._form
        if not form.inside or len(form.inside) > 2 or not {"stiffness", "mass"} <= set(form.names):
            return [self._quadrature(entry, 1.0) for entry in range(len(form.inside))]
        k, m = form.names.index("stiffness"), form.names.index("mass")
        axes = 1 if self._diagonal else 2
        unit = np.ones(self._modes.omega.shape[-1]) if self._diagonal else np.eye(self._modes.omega.shape[-1])
        squares = self._modes.omega**2 if self._diagonal else self._modes.omega[..., None] ** 2 * unit
        left = squares, np.array(np.broadcast_to(unit, squares.shape))
        for number, whole in zip((k, m), left, strict=True):
            for factor, product in zip(self._points[number], self._ends, strict=True):
                if not _is_zero(factor):
                    whole -= column(factor, axes) * product
        (a, *b), (c, *d) = (tuple(column(f, axes) for f in self._density[number]) for number in (k, m))
        if not b:  # the same displacement occurs in stiffness and mass
            return [left[1] / c]
        if _is_zero(b[0]) and _is_zero(c):  # in place: fresh memory costs more than the quotients
            return [np.divide(whole, factor, out=whole) for whole, factor in zip(left, (a, d[0]), strict=True)]
        determinant = a * d[0] - b[0] * c
        return [(left[0] * d[0] - left[1] * b[0]) / determinant, (left[1] * a - left[0] * c) / determinant]


def _is_zero(factor: float | Array) -> bool:
    return np.ndim(factor) == 0 and factor == 0
