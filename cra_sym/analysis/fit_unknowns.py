"""Parameters to be estimated, each with the coordinate in which it is searched."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Literal, Protocol

import numpy as np
from numpy.typing import NDArray

from cra_sym.analysis.sensitivities import sensitivities
from cra_sym.model.system import System

__all__ = ["RatedFrequencies", "Unknown", "natural_stiffnesses", "unknowns"]

Array = NDArray[np.float64]
Kind = Literal["stiffness", "signed", "nonnegative"]

_SOFTEST, _STIFFEST = 1e-8, 1e8  # range of a stiffness in natural units, beyond which it is absent or rigid to rounding
_RANGE = 1e3  # factor by which other parameters may differ from their initial value


class RatedFrequencies(Protocol):
    """The part of :class:`Sensitivities` for fits: frequencies (..., modes), Hz, and their derivatives by name."""

    @property
    def frequency(self) -> Array:
        """Frequencies, Hz."""

    @property
    def rate(self) -> Mapping[str, Array]:
        """Derivatives by the values."""

    @property
    def log(self) -> Mapping[str, Array]:
        """Logarithmic derivatives."""

    @property
    def compliance(self) -> Mapping[str, Array]:
        """Derivatives by 1/k of every stiffness of an end."""


@dataclass(frozen=True)
class Unknown:
    """A parameter to be estimated, with the coordinate in which it is searched.

    That is ln(1 + unit/k) for the stiffness k of an end, so that a rigid one has the finite value 0, ln(p / unit) for
    other parameters, and ln(1 + p/unit) for one that is zero initially.

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

    def grid(self, points: int) -> Array:
        """Return the coordinates among which the search starts, ``points`` unless it is a stiffness of an end."""
        if self.prior is not None:
            return np.array([self.coordinate(self.prior[0])])
        if self.kind == "stiffness":
            return np.log1p(1 / np.logspace(-4.0, 6.0, 41))
        return np.linspace(*self.bounds, points)

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
        """Return the derivative by the coordinate of 1/k for a stiffness, else of p; it is finite everywhere."""
        return np.exp(coordinate) / self.unit if self.kind == "stiffness" else np.exp(coordinate) * self.unit

    def slopes(self, found: RatedFrequencies) -> Array:
        """Return the derivatives of the frequencies by 1/k of a stiffness, by p itself otherwise."""
        return found.compliance[self.name] if self.kind == "stiffness" else found.rate[self.name]

    def gradient(self, found: RatedFrequencies, coordinate: Array) -> Array:
        """Return the derivatives of the frequencies by the coordinate, shape (..., modes)."""
        column = np.asarray(coordinate)[..., None]
        slope = self.slopes(found) * self.rate(column)
        if self.kind == "stiffness":
            with np.errstate(divide="ignore", invalid="ignore"):
                soft = -found.frequency * found.log[self.name] * (1 + 1 / np.expm1(column))
            slope = np.where(np.expm1(column) > 1, soft, slope)  # soft: the rate by k is the accurate one
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
    """Return the end stiffnesses whose compliance equals that of the structure itself.

    A small compliance of a rigid support lowers omega^2 by P^2 times the compliance, with the force P in the first
    elastic mode, so the natural unit is P^2 / omega^2.
    """
    if not names:
        return {}
    system = system.basis
    rigid = system.replace(**dict.fromkeys(names, np.inf))
    number = _elastic(rigid)
    modes, omega = rigid.modes(number), rigid.natural_frequencies(number)
    units = {}
    for name in names:
        spring = system.numerics("stiffnesses")[name]
        factor = float(spring.factor.function(*rigid.domain.values))
        ratio = (modes.force(spring.end, spring.place)[omega > 0] / (np.sqrt(factor) * omega[omega > 0])) ** 2
        units[name] = float(ratio[0] if ratio[0] > 1e-6 * ratio.max() else ratio.max())
    return units


def _natural_unit(system: System, name: str) -> float:
    """Return the change of the parameter that would change the square of a frequency by 100 per cent."""
    if system.conservative_part is not system:
        raise ValueError(f"unknown: {name} = 0 in system: must have a value of its size, from which the search begins")
    found = sensitivities(system, _elastic(system), by=(name,))
    change = np.abs(found.rate[name])[found.frequency > 0] / found.frequency[found.frequency > 0]
    if not change.max() > 0:
        raise ValueError(f"unknown: {name} does not change the natural frequencies")
    return float(1 / (2 * change.max()))


def _elastic(system: System) -> int:
    """Return the number of modes up to the first elastic one, plus two if the model has them."""
    for number in (3, 6, 9, 12):
        if system.natural_frequencies(number)[-1] > 0:
            return number
    raise ValueError("system: none of its first twelve modes is elastic")
