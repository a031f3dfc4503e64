"""Frequencies to be fitted and their rates by the unknowns: natural ones, or those of complex eigenvalues."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from cra_sym.analysis.fit_unknowns import RatedFrequencies, Unknown
from cra_sym.analysis.sensitivities import sensitivities
from cra_sym.cached import cached_property
from cra_sym.model.system import System
from cra_sym.model.values import flat_columns
from cra_sym.solvers.pencil_refine import lowest_eigenvalues

__all__ = ["frequencies", "rated"]

Array = NDArray[np.float64]
Complex = NDArray[np.complex128]
_STEP = 1e-4  # step of a coordinate: the error of a central difference is its square
_GROWS = 1e-6  # real part over the modulus of what is unstable: two that meet are known to half their digits
_MORE = 2  # largest number of real eigenvalues among the lowest
_SETTLED, _MESHES = (1e-9, 1e-7), 3  # differences between two meshes: target, accepted; and the number of meshes


@dataclass(frozen=True)
class _Found:
    """Frequencies with known rates."""

    frequency: Array
    rate: Mapping[str, Array]
    log: Mapping[str, Array]
    compliance: Mapping[str, Array]


def rated(system: System, unknowns: Sequence[Unknown], place: Array, modes: int) -> RatedFrequencies:
    """Return frequencies and their rates at a point, or at points (P, unknowns); nan where there is no stable system.

    Raises
    ------
    ValueError
        If the system is not stable at the only point.
    """

    def all_at(at: Array) -> RatedFrequencies:
        if system.conservative_part is not system:
            return _Oscillating(system, unknowns, at, modes)
        names = tuple(unknown.name for unknown in unknowns)
        return sensitivities(_at(system, unknowns, at), modes, by=names)

    try:
        return all_at(place)
    except ValueError:  # some values are not admissible, or the structure has buckled
        if place.ndim == 1:
            raise
    good = np.asarray(np.isfinite(frequencies(system, unknowns, place, modes)).all(axis=-1))
    return _spread(all_at(place[good]), unknowns, good, modes)


def frequencies(system: System, unknowns: Sequence[Unknown], places: Array, modes: int) -> Array:
    """Return the frequencies at places, Hz, shape (P, modes); nan where there is no stable system."""
    try:
        there = _at(system, unknowns, places)
        if system.conservative_part is not system:
            return _stable(there, modes).imag / (2 * np.pi)
        return there.natural_frequencies(modes) / (2 * np.pi)
    except (ValueError, ArithmeticError):
        if len(places) == 1:
            return np.full((1, modes), np.nan)
    half = len(places) // 2
    return np.concatenate([frequencies(system, unknowns, part, modes) for part in (places[:half], places[half:])])


def _at(system: System, unknowns: Sequence[Unknown], place: Array) -> System:
    return system.replace(**{unknown.name: unknown.value(place[..., i])[()] for i, unknown in enumerate(unknowns)})


def _spread(part: RatedFrequencies, unknowns: Sequence[Unknown], good: NDArray[np.bool_], modes: int) -> _Found:
    """Return the results at all points, nan where there are none."""

    def among(values: Array) -> Array:
        found = np.full((len(good), modes), np.nan)
        found[good] = values
        return found

    def of(kind: Mapping[str, Array], stiff: bool = False) -> dict[str, Array]:
        names = [unknown.name for unknown in unknowns if not stiff or unknown.kind == "stiffness"]
        return {name: among(kind[name]) for name in names}

    return _Found(among(part.frequency), of(part.rate), of(part.log), of(part.compliance, stiff=True))


def _stable(system: System, modes: int) -> Complex:
    """Return the eigenvalues that oscillate, by ascending modulus, shape (..., modes); nan where a motion grows."""
    s = _eigenvalues(system, modes + _MORE, oscillating=False)
    with np.errstate(invalid="ignore"):
        grows = np.asarray((s.real > _GROWS * np.abs(s)).any(axis=-1))
        swings = s.imag > _GROWS * np.abs(s)
    few = swings.sum(axis=-1) < modes
    if (few & ~grows & np.isfinite(s).all(axis=-1)).any():
        s = _eigenvalues(system, modes, oscillating=True)
    else:
        s = np.take_along_axis(s, np.argsort(~swings, axis=-1, kind="stable")[..., :modes], axis=-1)
        grows |= few
    return np.where(grows[..., None], np.nan, s)


def _eigenvalues(system: System, modes: int, *, oscillating: bool) -> Complex:
    """Return the lowest eigenvalues, from few meshes; nan where they do not converge."""
    columns, pencil = flat_columns(system.parameters, system.shape), system.numerics("pencil")
    if pencil is None:
        raise ValueError(
            "system: a field that has no derivative by x leaves gyroscopic systems without an identification; "
            "eliminate the field"
        )
    found = np.full((columns.shape[1], modes), np.nan, dtype=complex)
    for rows, problem in pencil.problems(columns):
        with np.errstate(all="ignore"):
            settled = lowest_eigenvalues(problem, modes, oscillating, _SETTLED[0], _MESHES)
        found[rows] = np.where(settled.error < _SETTLED[1], settled.values, np.nan)
    return found.reshape(*system.shape, modes)


class _Oscillating:
    """Oscillating frequencies, with rates by differences of the eigenvalues along the coordinates, computed on use.

    Raises
    ------
    ValueError
        If a motion grows at the only place.
    """

    def __init__(self, system: System, unknowns: Sequence[Unknown], place: Array, modes: int) -> None:
        self._system, self._unknowns, self._place, self._modes = system, unknowns, place, modes
        self._s = _stable(_at(system, unknowns, place), modes)
        self.frequency = self._s.imag / (2 * np.pi)
        if place.ndim == 1 and not np.isfinite(self.frequency).all():
            raise ValueError("system: a motion grows, or does not oscillate as often, with these values")

    @cached_property
    def rate(self) -> dict[str, Array]:
        """Derivatives by the values."""
        found = {}
        for i, unknown in enumerate(self._unknowns):
            value = unknown.value(self._place[..., i, None])
            found[unknown.name] = self.log[unknown.name] * self.frequency / value
        return found

    @cached_property
    def log(self) -> dict[str, Array]:
        """Logarithmic derivatives."""
        found = {}
        for i, unknown in enumerate(self._unknowns):
            coordinate = self._place[..., i, None]
            with np.errstate(all="ignore"):
                turn = -1 / (1 + 1 / np.expm1(coordinate)) if unknown.kind == "stiffness" else 1.0
                found[unknown.name] = self._slopes[unknown.name] / self.frequency * turn
        return found

    @cached_property
    def compliance(self) -> dict[str, Array]:
        """Derivatives by 1/k of every stiffness of an end."""
        return {
            unknown.name: self._slopes[unknown.name] / unknown.rate(self._place[..., i, None])
            for i, unknown in enumerate(self._unknowns)
            if unknown.kind == "stiffness"
        }

    @cached_property
    def _slopes(self) -> dict[str, Array]:
        """Derivatives by the coordinates; beside a rigid end, where there is one side, of second order too."""
        found = {}
        good = np.isfinite(self.frequency).all(axis=-1)
        at, center = self._place[good], self._s[good]
        for i, unknown in enumerate(self._unknowns):
            rigid = (at[..., i] - _STEP < unknown.bounds[0])[..., None]
            moved = np.stack([at, at])
            moved[0, ..., i] += np.where(rigid[..., 0], 2 * _STEP, -_STEP)
            moved[1, ..., i] += _STEP
            s = _eigenvalues(_at(self._system, self._unknowns, moved), self._modes, oscillating=True)
            far = np.nan_to_num(np.abs(s[..., None, :] - center[..., None]), nan=np.inf)
            first, second = np.take_along_axis(s, far.argmin(axis=-1), axis=-1).imag
            one_sided = 4 * second - 3 * center.imag - first
            found[unknown.name] = np.full(self.frequency.shape, np.nan)
            found[unknown.name][good] = np.where(rigid, one_sided, second - first) / (2 * _STEP) / (2 * np.pi)
        return found
