"""All local minima of the misfit between measured and computed natural frequencies, over any parameters of a system."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from cra_sym.analysis.sensitivities import Sensitivities, sensitivities
from cra_sym.model.system import System

__all__ = ["Data", "Search", "Unknown", "unknowns"]

Array = NDArray[np.float64]
Kind = Literal["stiffness", "signed", "nonnegative"]

_SOFTEST, _STIFFEST = 1e-8, 1e8  # of a stiffness in natural units: beyond, it is absent or rigid to rounding
_RANGE = 1e3  # factor by which other parameters may differ from where the search begins
_MOST_POINTS = 20_000
_SAMPLES = 8_192  # where a grid would have more points
_LINKED = 4.0  # chi2 on the way between two minima, above theirs, up to which they are one: two standard deviations
_LOWEST = 200  # places of a grid that are starts whatever is beside them
_STEPS = 25
_APART = 1e-2  # of a coordinate: ends of a descent that are closer are one
_FEW = 24
_MOST_KEPT = 1000
_LARGEST = 1e150  # of a residual, whose square is a number


@dataclass(frozen=True)
class Unknown:
    """A parameter to be estimated, with the coordinate in which it is searched.

    That is ln(1 + unit/k) for the stiffness k of an end, in which a rigid one is the ordinary value 0, ln(p / unit) for
    others, and ln(1 + p/unit) for one that is zero where the search begins.

    Attributes
    ----------
    name : str
    kind : {'stiffness', 'signed', 'nonnegative'}
    unit : float
    prior : (value, uncertainty), optional
    """

    name: str
    kind: Kind
    unit: float
    prior: tuple[float, float] | None = None

    @property
    def bounds(self) -> tuple[float, float]:
        """Smallest and largest coordinate."""
        if self.kind == "stiffness":
            return 0.0, float(np.log1p(1 / _SOFTEST))
        return (-np.log(_RANGE), np.log(_RANGE)) if self.kind == "signed" else (0.0, np.log1p(_RANGE))

    @property
    def grid(self) -> Array:
        """Coordinates among which the search starts."""
        if self.prior is not None:
            return np.array([self.coordinate(self.prior[0])])
        if self.kind == "stiffness":
            return np.log1p(1 / np.logspace(-4.0, 6.0, 41))
        return np.linspace(*self.bounds, 13)

    def coordinate(self, value: float) -> float:
        """Return the coordinate of a value."""
        if self.kind == "stiffness":
            return float(np.clip(np.log1p(self.unit / value), *self.bounds)) if value > 0 else self.bounds[1]
        return float(np.log(value / self.unit) if self.kind == "signed" else np.log1p(value / self.unit))

    def value(self, coordinate: Array) -> Array:
        """Return values from coordinates; a stiffness that is rigid to rounding is inf."""
        if self.kind == "stiffness":
            rigid = coordinate < 1e-12
            soft = self.unit / np.expm1(np.where(rigid, 1.0, coordinate))
            return np.where(rigid, np.inf, soft)
        return self.unit * (np.exp(coordinate) if self.kind == "signed" else np.expm1(coordinate))

    def rate(self, coordinate: Array) -> Array:
        """Return the derivative by the coordinate of what has a finite one everywhere: 1/k of a stiffness, p else."""
        return np.exp(coordinate) / self.unit if self.kind == "stiffness" else np.exp(coordinate) * self.unit

    def slopes(self, found: Sensitivities) -> Array:
        """Return the derivatives of the frequencies by 1/k of a stiffness, by p itself otherwise."""
        return found.compliance[self.name] if self.kind == "stiffness" else found.rate[self.name]

    def gradient(self, found: Sensitivities, coordinate: Array) -> Array:
        """Return the derivatives of the frequencies by the coordinate, shape (..., modes)."""
        column = np.asarray(coordinate)[..., None]
        slope = self.slopes(found) * self.rate(column)
        if self.kind == "stiffness":
            with np.errstate(divide="ignore", invalid="ignore"):
                soft = -found.frequency * found.log[self.name] * (1 + 1 / np.expm1(column))
            slope = np.where(np.expm1(column) > 1, soft, slope)  # soft: the rate by k is the exact one
        return np.where(np.isfinite(slope), slope, 0.0)

    def prior_row(self, value: Any) -> Any:
        """Return the derivative of the prior's residual by 1/k of a stiffness, by p itself otherwise."""
        assert self.prior is not None
        return (-(value**2) if self.kind == "stiffness" else 1.0) / self.prior[1]


def unknowns(system: System, names: Sequence[str], prior: dict[str, tuple[float, float]]) -> tuple[Unknown, ...]:
    """Return the parameters to be estimated, in natural units."""
    stiff = [name for name in names if name in system.numerics("stiffnesses")]
    units = natural_stiffnesses(system, stiff)
    found = []
    for name in names:
        start = prior[name][0] if name in prior else float(np.asarray(system.values[name]))
        if name in units:
            found.append(Unknown(name, "stiffness", units[name], prior.get(name)))
        elif start != 0:
            found.append(Unknown(name, "signed", start, prior.get(name)))
        else:
            found.append(Unknown(name, "nonnegative", _natural_unit(system, name), prior.get(name)))
    return tuple(found)


def natural_stiffnesses(system: System, names: Sequence[str]) -> dict[str, float]:
    """Return the stiffnesses beside which the structure itself gives as much as the end.

    The first give of a rigid support lowers omega^2 by P^2 times its compliance, P its force in the first elastic mode;
    P^2 / omega^2 is the stiffness that would halve it.
    """
    if not names:
        return {}
    rigid = system.replace(**dict.fromkeys(names, np.inf))
    number = _elastic(rigid)
    modes, omega = rigid.modes(number), rigid.natural_frequencies(number)
    units = {}
    for name in names:
        spring = system.numerics("stiffnesses")[name]
        factor = float(spring.factor.function(*rigid.domain.values))
        ratio = modes.force(spring.end, spring.place)[omega > 0] ** 2 / (factor * omega[omega > 0] ** 2)
        units[name] = float(ratio[0] if ratio[0] > 1e-6 * ratio.max() else ratio.max())
    return units


def _natural_unit(system: System, name: str) -> float:
    """Return the value that would change the square of a frequency as much as it is."""
    found = sensitivities(system, _elastic(system), by=(name,))
    change = np.abs(found.rate[name])[found.frequency > 0] / found.frequency[found.frequency > 0]
    if not change.max() > 0:
        raise ValueError(f"unknown: {name} does not change the natural frequencies")
    return float(1 / (2 * change.max()))


def _elastic(system: System) -> int:
    """Return a number of modes of which the last is elastic, with two more if the model has them."""
    for number in (3, 6, 9, 12):
        if system.natural_frequencies(number)[-1] > 0:
            return number
    raise ValueError("system: none of its first twelve modes is elastic")


@dataclass(frozen=True)
class Data:
    """Measured frequencies (Hz), their standard deviations, and the modes they belong to, counted from 0."""

    measured: Array
    sigma: Array
    modes: NDArray[np.intp]

    def without(self, entry: int) -> Data:
        """Return the data without one of the frequencies."""
        return Data(np.delete(self.measured, entry), np.delete(self.sigma, entry), np.delete(self.modes, entry))


@dataclass
class Search:
    """Least squares over the coordinates of some unknowns."""

    system: System
    unknowns: tuple[Unknown, ...]
    most_modes: int
    _known: dict[bytes, Sensitivities] = field(default_factory=dict)
    _table: tuple[Array, Array, tuple[int, ...]] | None = None

    def values(self, place: Array) -> dict[str, Any]:
        """Return the values of the unknowns at a place, or arrays of them at places (..., unknowns)."""
        return {unknown.name: unknown.value(place[..., i])[()] for i, unknown in enumerate(self.unknowns)}

    def found(self, place: Array) -> Sensitivities:
        """Return frequencies and sensitivities at a place, or at places; the last ones are kept."""
        key = place.tobytes()
        if key not in self._known:
            if len(self._known) > _MOST_KEPT:
                self._known.clear()
            names = tuple(unknown.name for unknown in self.unknowns)
            found = sensitivities(self.system.replace(**self.values(place)), self.most_modes, by=names)
            self._known[key] = found
        return self._known[key]

    def residuals(self, place: Array, data: Data) -> Array:
        """Return computed minus measured frequencies, and values minus priors, in units of their uncertainty."""
        try:
            frequency = self.found(place).frequency[..., data.modes]
        except ValueError:  # of a structure that has buckled or is none
            frequency = np.full((*place.shape[:-1], data.modes.size), np.nan)
        values = self.values(place)
        prior = [(values[u.name] - u.prior[0]) / u.prior[1] for u in self.unknowns if u.prior is not None]
        rows = [(frequency - data.measured) / data.sigma, *(np.asarray(one)[..., None] for one in prior)]
        found: Array = np.clip(np.concatenate(rows, axis=-1), -_LARGEST, _LARGEST)
        return found

    def gradient(self, place: Array, data: Data) -> Array:
        """Return the derivatives of the residuals by the coordinates, shape (..., residuals, unknowns)."""
        found, values = self.found(place), self.values(place)
        columns = [u.gradient(found, place[..., i])[..., data.modes] / data.sigma for i, u in enumerate(self.unknowns)]
        known = [(i, u) for i, u in enumerate(self.unknowns) if u.prior is not None]
        prior = np.zeros((*place.shape[:-1], len(known), len(self.unknowns)))
        for row, (i, u) in enumerate(known):
            prior[..., row, i] = u.prior_row(values[u.name]) * u.rate(place[..., i])
        slopes: Array = np.clip(np.concatenate([np.stack(columns, -1), prior], axis=-2), -_LARGEST, _LARGEST)
        return slopes

    def chi2(self, place: Array, data: Data) -> float:
        """Return the sum of the squared residuals."""
        return float(np.sum(self.residuals(place, data) ** 2))

    # ------------------------------------------------------------------------------------------------------------

    def minima(self, data: Data, most: int | None = None) -> list[Array]:
        """Return the local minima, best first, or those that the lowest ends of the descent lead to."""
        places = [self._polished(start, data) for start in self._descended(self._starts(data), data)[:most]]
        places.sort(key=lambda place: self.chi2(place, data))
        return places

    def distinct(self, places: Sequence[Array], data: Data) -> list[Array]:
        """Return those places that no path links to a better one within the uncertainty of the data."""
        kept: list[Array] = []
        for place in places:
            if not any(self._linked(place, other, data) for other in kept):
                kept.append(place)
        return kept

    def _polished(self, start: Array, data: Data, held: tuple[Array, float] | None = None) -> Array:
        from scipy.optimize import least_squares

        low, high = np.array([unknown.bounds for unknown in self.unknowns]).T
        direction, share = (np.zeros(len(start)), 0.0) if held is None else held

        def residuals(place: Array) -> Array:
            own = self.residuals(place, data)
            return own if held is None else np.append(own, 1e3 * np.sqrt(_LINKED) * (direction @ place - share))

        def gradient(place: Array) -> Array:
            own = self.gradient(place, data)
            return own if held is None else np.vstack([own, 1e3 * np.sqrt(_LINKED) * direction])

        tolerance = 1e-14 if held is None else 1e-8
        start = np.clip(start, low + 1e-9, high - 1e-9)
        with np.errstate(all="ignore"):
            found = least_squares(
                residuals, start, gradient, bounds=(low, high), x_scale="jac",
                xtol=tolerance, ftol=tolerance, gtol=tolerance,
                max_nfev=200 if held is None else 20,
            )  # fmt: skip
        place: Array = found.x
        stiff = np.array([unknown.kind != "signed" for unknown in self.unknowns])
        return np.where(stiff & (place < 1e-12), 0.0, place)

    def _starts(self, data: Data) -> Array:
        """Return the local minima of the misfit on the grid, weighted by the uncertainties and relative, and the lowest
        of its places."""
        places, frequencies, shape = self._grid()
        with np.errstate(all="ignore"):
            off = frequencies[:, data.modes] - data.measured
            costs = [np.sum((off / scale) ** 2, -1) for scale in (data.sigma, data.measured)]
        found: set[int] = set()
        for cost in costs:
            finite = np.where(np.isfinite(cost), cost, np.inf)
            if not np.isfinite(finite).any():
                raise ValueError("system: it has no natural frequencies for any values of the unknown parameters")
            found |= set(np.argsort(finite)[:_LOWEST].tolist())
            found |= set(_lowest(finite.reshape(shape))) if shape else set()
        return places[sorted(found)]

    def _descended(self, places: Array, data: Data) -> Array:
        """Follow all starts at once by damped Gauss-Newton steps; return those that end apart, the lowest of each.

        Where some start leads to values without natural frequencies, the starts are returned as they are.
        """
        low, high = np.array([unknown.bounds for unknown in self.unknowns]).T
        places = np.clip(places, low + 1e-9, high - 1e-9)
        residuals = self.residuals(places, data)
        if not np.isfinite(residuals).all():
            return places[np.argsort(np.nan_to_num(np.sum(residuals**2, -1), nan=np.inf))][:_FEW]
        damping = np.full(len(places), 1e-2)
        with np.errstate(all="ignore"):
            cost = np.sum(residuals**2, -1)
            for _ in range(_STEPS):
                jacobian = self.gradient(places, data)
                normal = np.swapaxes(jacobian, -1, -2) @ jacobian
                size = np.einsum("...ii->...i", normal)
                floor = 1e-12 * size.max(axis=-1, keepdims=True) + np.finfo(float).tiny
                normal += np.eye(len(low)) * (damping[:, None] * np.maximum(size, floor) + floor)[:, None]
                push = np.swapaxes(jacobian, -1, -2) @ residuals[..., None]
                tried = np.clip(places - np.linalg.solve(normal, push)[..., 0], low + 1e-9, high - 1e-9)
                there = self.residuals(tried, data)
                lower = np.sum(there**2, -1) < cost
                places = np.where(lower[:, None], tried, places)
                residuals = np.where(lower[:, None], there, residuals)
                cost = np.sum(residuals**2, -1)
                damping = np.clip(np.where(lower, damping / 5, damping * 4), 1e-12, 1e12)
        kept: list[Array] = []
        for place in places[np.argsort(cost)]:
            if all(np.max(np.abs(place - other)) > _APART for other in kept):
                kept.append(place)
        return np.array(kept[:_FEW])

    def _grid(self) -> tuple[Array, Array, tuple[int, ...]]:
        """Return places (P, unknowns), their frequencies (P, modes) and the shape of the grid, () for a sample."""
        if self._table is None:
            axes = [unknown.grid for unknown in self.unknowns]
            shape = tuple(axis.size for axis in axes)
            if np.prod(shape) <= _MOST_POINTS:
                places = np.stack(np.meshgrid(*axes, indexing="ij"), -1).reshape(-1, len(axes))
            else:
                from scipy.stats import qmc

                low, high = np.array([(axis.min(), axis.max()) for axis in axes]).T
                places = low + (high - low) * qmc.Sobol(len(axes), seed=0).random(_SAMPLES)
                shape = ()
            self._table = places, self._frequencies(places), shape
        return self._table

    def _frequencies(self, places: Array) -> Array:
        values = {u.name: u.value(column) for u, column in zip(self.unknowns, places.T, strict=True)}
        try:
            omega = self.system.replace(**values).natural_frequencies(self.most_modes)
        except ValueError:  # somewhere the structure has buckled: point by point
            omega = np.full((len(places), self.most_modes), np.nan)
            for row, place in enumerate(places):
                try:
                    omega[row] = self.system.replace(**self.values(place)).natural_frequencies(self.most_modes)
                except ValueError:
                    continue
        return omega / (2 * np.pi)

    def _linked(self, place: Array, other: Array, data: Data) -> bool:
        """Tell whether a path leads from one minimum to another on which the misfit stays within the uncertainty."""
        step = other - place
        distance = float(np.linalg.norm(step))
        if distance < 1e-6:
            return True
        limit = max(self.chi2(place, data), self.chi2(other, data)) + _LINKED
        direction, here = step / distance, place
        for share in (0.5, 0.25, 0.75, 0.125, 0.375, 0.625, 0.875):
            target = place + share * step
            here = self._polished(target, data, (direction, float(direction @ target)))
            if self.chi2(here, data) > limit:
                return False
        return True


def _lowest(cost: Array) -> list[int]:
    """Return the flat positions of the entries of a grid that no neighbour, diagonal ones too, is below."""
    padded = np.pad(cost, 1, constant_values=np.inf)
    inner = tuple(slice(1, -1) for _ in cost.shape)
    least = np.isfinite(cost)
    for shift in itertools.product((-1, 0, 1), repeat=cost.ndim):
        moved = padded[tuple(slice(1 + s, size + 1 + s) for s, size in zip(shift, cost.shape, strict=True))]
        least &= padded[inner] <= moved
    return np.flatnonzero(least).tolist()
