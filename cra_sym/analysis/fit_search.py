"""All local minima of the misfit between measured and computed natural frequencies, over any parameters of a system."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cra_sym.analysis.fit_rates import frequencies, rated
from cra_sym.analysis.fit_unknowns import RatedFrequencies, Unknown
from cra_sym.model.routes import Estimated
from cra_sym.model.system import System

__all__ = ["Data", "Search"]

Array = NDArray[np.float64]

_MOST_POINTS = 20_000
_POINTS = (25, 13)  # of a parameter that is not a stiffness of an end: the most that the grid can have
_SAMPLES = 8_192  # points of a sample, where a grid would have more
_LINKED = 4.0  # rise of chi2 between two minima up to which they count as one: two standard deviations
_LOWEST = 200  # lowest grid points that are starts even if they are not local minima
_STEPS, _MORE_STEPS = 25, 50
_IDLE = 7  # successive steps without progress
_LEAST_DAMPING = 1e-5  # from which seven rejected steps bring it to a full one
_MARGIN = 1e-9  # margin of a coordinate inside its bounds
_NOTHING = 1e-20  # relative decrease of chi2 at convergence
_HOLD = 1e3 * _LINKED**0.5  # weight of a component that is held fixed
_SHARES = (0.125, 0.25, 0.375, 0.5, 0.625, 0.75, 0.875)  # points along the path between two minima
_SAME = 1e-6  # difference of a coordinate below which minima count as one
_APART = 1e-2  # difference of a coordinate below which end points of descents count as one
_FEW = 24
_MOST_KEPT = 1000
_LARGEST = 1e150  # largest residual, whose square does not overflow


@dataclass(frozen=True)
class Data:
    """Measured frequencies (Hz), their standard deviations, and the modes they belong to, counted from 0.

    Each has the shape (m,), or (P, m) for points with data of their own.
    """

    measured: Array
    sigma: Array
    modes: NDArray[np.intp]

    def without(self, entry: int) -> Data:
        """Return the data without one of the frequencies."""
        return Data(np.delete(self.measured, entry), np.delete(self.sigma, entry), np.delete(self.modes, entry))

    def rows(self, rows: NDArray[np.intp]) -> Data:
        """Return the data of some of the points."""
        return self if self.modes.ndim == 1 else Data(self.measured[rows], self.sigma[rows], self.modes[rows])

    def of(self, by_mode: Array) -> Array:
        """Return the entries of an array (..., modes) that belong to the data."""
        return by_mode[..., self.modes] if self.modes.ndim == 1 else np.take_along_axis(by_mode, self.modes, -1)


@dataclass
class Search:
    """Least squares over the coordinates of some unknowns."""

    system: System
    unknowns: tuple[Unknown, ...]
    most_modes: int
    _known: dict[tuple[tuple[int, ...], bytes], RatedFrequencies] = field(default_factory=dict)
    _table: tuple[Array, Array, tuple[int, ...]] | None = None

    def values(self, place: Array) -> dict[str, Any]:
        """Return the values of the unknowns at a point, or arrays of them at points (..., unknowns)."""
        return {unknown.name: unknown.value(place[..., i])[()] for i, unknown in enumerate(self.unknowns)}

    def found(self, place: Array) -> RatedFrequencies:
        """Return frequencies and sensitivities at a point, or at points; the last result is cached."""
        key = place.shape, place.tobytes()
        if key not in self._known:
            if len(self._known) > _MOST_KEPT:
                self._known.clear()
            self._known[key] = rated(self.system, self.unknowns, place, self.most_modes)
        return self._known[key]

    def residuals(self, place: Array, data: Data) -> Array:
        """Return computed minus measured frequencies, and values minus priors, in units of their uncertainty."""
        try:
            frequency = data.of(self.found(place).frequency)
        except ValueError:  # the structure has buckled, or the values are not admissible
            frequency = np.full((*place.shape[:-1], data.modes.shape[-1]), np.nan)
        values = self.values(place)
        prior = [(values[u.name] - u.prior[0]) / u.prior[1] for u in self.unknowns if u.prior is not None]
        rows = [(frequency - data.measured) / data.sigma, *(np.asarray(one)[..., None] for one in prior)]
        found: Array = np.clip(np.concatenate(rows, axis=-1), -_LARGEST, _LARGEST)
        return found

    def gradient(self, place: Array, data: Data) -> Array:
        """Return the derivatives of the residuals by the coordinates, shape (..., residuals, unknowns)."""
        found, values = self.found(place), self.values(place)
        columns = [data.of(u.gradient(found, place[..., i])) / data.sigma for i, u in enumerate(self.unknowns)]
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

    def minima(self, data: Data) -> list[Array]:
        """Return the local minima, best first.

        Of end points that are connected within the uncertainty, as in a valley of values that the data do not
        distinguish, only the lowest is refined to its minimum.
        """
        ends = self._descended(self._starts(data), data)
        ends = np.array(self.distinct([*self._apart(*self._followed(ends, data, _MORE_STEPS))], data))
        places = [self._polished(end, data) for end in ends]
        places.sort(key=lambda place: self.chi2(place, data))
        return places

    def lowest(self, trials: Sequence[Data]) -> list[Array]:
        """Return the lowest end point of short descents for each of several data sets; not always a minimum."""
        starts = [np.clip(self._starts(data, _FEW // 4), *self._bounds) for data in trials]
        owner = np.repeat(np.arange(len(trials)), [len(places) for places in starts])
        fields = (np.array([getattr(data, name) for data in trials])[owner] for name in ("measured", "sigma", "modes"))
        places, cost = self._followed(np.concatenate(starts), Data(*fields), _STEPS)
        return [places[owner == k][np.argmin(cost[owner == k])] for k in range(len(trials))]

    def misfit(self, data: Data) -> float:
        """Return the smallest sum of the squared relative differences on the grid."""
        with np.errstate(all="ignore"):
            cost = np.sum((self._grid()[1][:, data.modes] / data.measured - 1) ** 2, -1)
        return float(np.min(cost, where=np.isfinite(cost), initial=np.inf))

    def distinct(self, places: Sequence[Array], data: Data) -> list[Array]:
        """Return the points that no path within the uncertainty of the data connects to a better one."""
        kept: list[Array] = []
        left = list(places)
        while left:
            kept.append(left.pop(0))
            if left:
                linked = self._linked(np.array(left), kept[-1], data)
                left = [place for place, is_linked in zip(left, linked, strict=True) if not is_linked]
        return kept

    def _polished(self, start: Array, data: Data) -> Array:
        if self.chi2(start, data) <= _NOTHING:
            return self._rounded(start)
        from scipy.optimize import least_squares

        low, high = self._bounds
        with np.errstate(all="ignore"):
            found = least_squares(
                lambda place: self.residuals(place, data), np.clip(start, low, high),
                lambda place: self.gradient(place, data), bounds=(low - _MARGIN, high + _MARGIN), x_scale="jac",
                xtol=1e-14, ftol=1e-14, gtol=1e-14, max_nfev=100,
            )  # fmt: skip
        return self._rounded(found.x)

    def _rounded(self, place: Array) -> Array:
        """Return the point with values within the margin of rigid, or of zero, set to exactly that."""
        stiff = np.array([unknown.kind != "signed" for unknown in self.unknowns])
        return np.where(stiff & (place <= 2 * _MARGIN), 0.0, place)

    @property
    def _bounds(self) -> tuple[Array, Array]:
        """Smallest and largest coordinates, a margin inside the allowed range."""
        low, high = np.array([unknown.bounds for unknown in self.unknowns]).T
        return low + _MARGIN, high - _MARGIN

    def _starts(self, data: Data, lowest: int = 0) -> Array:
        """Return the local minima of the misfit on the grid, weighted and relative, and its lowest points."""
        places, known, shape = self._grid()
        with np.errstate(all="ignore"):
            off = known[:, data.modes] - data.measured
            costs = [np.sum((off / scale) ** 2, -1) for scale in (data.sigma, data.measured)]
        found: set[int] = set()
        for cost in costs:
            finite = np.where(np.isfinite(cost), cost, np.inf)
            number = np.isfinite(finite).sum()
            if not number:
                raise ValueError("system: it has no natural frequencies for any values of the unknown parameters")
            found |= set(np.argsort(finite)[: min(lowest or self._most_starts, number)].tolist())
            found |= set(_lowest(finite.reshape(shape))) if shape else set()
        return places[sorted(found)]

    @property
    def _most_starts(self) -> int:
        """Number of lowest grid points that are starts: fewer where evaluations are expensive.

        They are without natural modes, and where some values give no stable structure; less so where frequencies are
        not the roots of a determinant of few waves.
        """
        if self.system.conservative_part is not self.system or not np.isfinite(self._grid()[1]).all():
            return _FEW // 3
        return _FEW if isinstance(self.system.numerics("route"), Estimated) else _LOWEST

    def _descended(self, places: Array, data: Data) -> Array:
        """Follow all starts at once; return those that end apart, the lowest of each group."""
        places = np.clip(places, *self._bounds)
        finite = np.isfinite(np.sum(self.residuals(places, data) ** 2, -1))
        return self._apart(*self._followed(places[finite], data, _STEPS))

    @staticmethod
    def _apart(places: Array, cost: Array) -> Array:
        """Return the lowest few points that are distinct at the resolution of the search."""
        kept: list[Array] = []
        for place in places[np.argsort(cost)]:
            if all(np.max(np.abs(place - other)) > _APART for other in kept):
                kept.append(place)
        return np.array(kept[:_FEW])

    def _followed(
        self,
        places: Array,
        data: Data,
        steps: int,
        held: tuple[Array, Array] | None = None,
        enough: Array | float = _NOTHING,
    ) -> tuple[Array, Array]:
        """Take damped Gauss-Newton steps from all points at once; return the end points and their chi2.

        A point stops where chi2 is low enough, or after some steps without progress; one without a stable system stays.

        Parameters
        ----------
        places : ndarray, shape (P, unknowns)
        data : Data
        steps : int
        held : tuple of ndarrays, shape (P, unknowns), (P,), optional
            Directions, and the components of the points along them, which are held fixed.
        enough : float or ndarray, shape (P,), optional
            Chi2 at which a point stops.
        """
        bounds, places = self._bounds, places.copy()
        lines = held if held is None else (_HOLD * held[0], _HOLD * held[1])

        def rows(at: Array, on: NDArray[np.intp]) -> tuple[Array, Array]:
            own = data.rows(on)
            found = self.residuals(at, own)
            stable = np.isfinite(found).all(-1).any()
            slopes = self.gradient(at, own) if stable else np.zeros((*found.shape, at.shape[-1]))
            if lines is None:
                return found, slopes
            off = np.einsum("pi,pi->p", lines[0][on], at) - lines[1][on]
            return np.concatenate([found, off[:, None]], -1), np.concatenate([slopes, lines[0][on, None, :]], -2)

        on = np.arange(len(places))
        enough, idle, damping = np.broadcast_to(enough, on.shape), np.zeros(on.size), np.full(on.size, 1e-2)
        with np.errstate(all="ignore"):
            residuals, jacobian = rows(places, on)
            cost = np.nan_to_num(np.sum(residuals**2, -1), nan=np.inf)
            for _ in range(steps):
                on = np.flatnonzero(np.isfinite(cost) & (cost > enough) & (idle <= _IDLE))
                if not on.size:
                    break
                turned = np.swapaxes(jacobian[on], -1, -2)
                normal = turned @ jacobian[on]
                size = np.einsum("...ii->...i", normal)
                floor = 1e-12 * size.max(axis=-1, keepdims=True) + np.finfo(float).tiny
                normal += np.eye(places.shape[-1]) * (damping[on, None] * np.maximum(size, floor) + floor)[:, None]
                tried = np.clip(places[on] - np.linalg.solve(normal, turned @ residuals[on, :, None])[..., 0], *bounds)
                tried = np.where(np.isfinite(tried), tried, places[on])
                there, slopes = rows(tried, on)
                reached = np.sum(there**2, -1)
                lower = reached < cost[on]
                idle[on] = np.where(cost[on] - reached > 1e-6 * cost[on], 0, idle[on] + 1)
                damping[on] = np.clip(np.where(lower, damping[on] / 5, damping[on] * 4), _LEAST_DAMPING, 1e12)
                better = on[lower]
                places[better], cost[better] = tried[lower], reached[lower]
                residuals[better], jacobian[better] = there[lower], slopes[lower]
        return places, cost

    def _grid(self) -> tuple[Array, Array, tuple[int, ...]]:
        """Return points (P, unknowns), their frequencies (P, modes) and the shape of the grid, () for a sample."""
        if self._table is None:
            for points in _POINTS:
                axes = [unknown.grid(points) for unknown in self.unknowns]
                shape = tuple(axis.size for axis in axes)
                if np.prod(shape) <= _MOST_POINTS:
                    break
            if np.prod(shape) <= _MOST_POINTS:
                places = np.stack(np.meshgrid(*axes, indexing="ij"), -1).reshape(-1, len(axes))
            else:
                from scipy.stats import qmc

                low, high = np.array([(axis.min(), axis.max()) for axis in axes]).T
                places = low + (high - low) * qmc.Sobol(len(axes), seed=0).random(_SAMPLES)
                shape = ()
            self._table = places, frequencies(self.system, self.unknowns, places, self.most_modes), shape
        return self._table

    def _linked(self, places: Array, other: Array, data: Data) -> NDArray[np.bool]:
        """Return which minima a path connects to another with the misfit within the uncertainty."""
        step = other - places
        distance = np.linalg.norm(step, axis=-1)
        limit = np.array([max(self.chi2(place, data), self.chi2(other, data)) for place in places]) + _LINKED
        highest = np.zeros(len(places))
        far = np.flatnonzero(distance > _SAME)
        if far.size:
            direction = np.repeat(step[far] / distance[far, None], len(_SHARES), axis=0)
            starts = (places[far, None] + np.array(_SHARES)[:, None] * step[far, None]).reshape(-1, places.shape[-1])
            held = direction, np.einsum("pi,pi->p", direction, starts)
            low_enough = np.repeat(limit[far], len(_SHARES))
            ends = self._followed(starts, data, _STEPS, held, low_enough)[1]
            highest[far] = ends.reshape(far.size, -1).max(axis=-1)
        return np.asarray(highest <= limit)


def _lowest(cost: Array) -> list[int]:
    """Return the flat indices of the local minima of a grid, with diagonal neighbours."""
    padded = np.pad(cost, 1, constant_values=np.inf)
    inner = tuple(slice(1, -1) for _ in cost.shape)
    least = np.isfinite(cost)
    for shift in itertools.product((-1, 0, 1), repeat=cost.ndim):
        moved = padded[tuple(slice(1 + s, size + 1 + s) for s, size in zip(shift, cost.shape, strict=True))]
        least &= padded[inner] <= moved
    return np.flatnonzero(least).tolist()
