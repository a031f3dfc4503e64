"""Quantities for sweeps, each with its unit, meaning and added axes."""

from __future__ import annotations

import inspect
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

import cra_sym as cra
from cra_sym.checks import shown
from cra_sym.model.system import System

__all__ = ["QUANTITIES", "Quantity", "named_quantity"]


@dataclass(frozen=True)
class Quantity:
    """A quantity of a system for sweeps.

    Attributes
    ----------
    name, unit, meaning : str
        Name and attributes of the variable.
    function : callable
        ``function(system, **options)``, an array of shape ``(*system.shape, *dims)``.
    dims : tuple of str
        Names of the axes the function adds; ``'mode'`` counts from 1.
    axes : mapping of str to str
        Options that broadcast with the system and may therefore be axes too, with their units.
    """

    name: str
    function: Callable[..., Any]
    unit: str
    meaning: str
    dims: tuple[str, ...] = ()
    axes: Mapping[str, str] = field(default_factory=dict)

    def check_options(self, given: Sequence[str], parameters: Sequence[str]) -> None:
        """Raise a TypeError that names an option the function does not take, or one that it needs."""
        try:
            entries = list(inspect.signature(self.function).parameters.values())[1:]
        except ValueError:  # a built-in function without a signature
            return
        if any(p.kind is p.VAR_KEYWORD for p in entries):
            return
        known = [p.name for p in entries]
        for key in given:
            if key not in known:
                names = ", ".join([*parameters, *known])
                raise TypeError(f"{key!r} is not a parameter of {self.name}: must be one of {names}")
        for p in entries:
            if p.default is p.empty and p.name not in given:
                raise TypeError(f"{self.name} needs the option {p.name}")


def _natural_frequencies(system: System, *, modes: int = 3) -> NDArray[np.float64]:
    return cra.natural_frequencies(system, modes=modes)


def _eigenvalues(system: System, *, modes: int = 3, oscillating: bool = True) -> Any:
    return cra.eigenvalues(system, modes, oscillating=oscillating)


def _oscillating_frequencies(system: System, *, modes: int = 3) -> NDArray[np.float64]:
    return cra.eigenvalues(system, modes).imag / (2 * np.pi)


def _damping_ratios(system: System, *, modes: int = 3) -> NDArray[np.float64]:
    return cra.damping_ratios(system, modes)


def _sensitivity(kind: str, parameter: str, system: System, *, modes: int = 3) -> Any:
    return getattr(cra.sensitivities(system, modes=modes, by=(parameter,)), kind)[parameter]


def _fits(system: System, given: Mapping[str, Any]) -> Iterator[Any]:
    """Fit the parameters of every system of a batch."""
    for place in np.ndindex(system.shape):
        values = {name: np.broadcast_to(value, system.shape)[place] for name, value in system.values.items()}
        yield cra.identify(system.replace(**values, zeta=0.0), **given)


def _identified(
    system: System, *, measured: Any, uncertainty: Any, unknown: Any = None, modes: Any = None, prior: Any = None
) -> Any:
    given = {"measured": measured, "uncertainty": uncertainty, "unknown": unknown, "modes": modes, "prior": prior}
    found = [list(fit.values.values()) for fit in _fits(system, given)]
    return np.array(found).reshape(*system.shape, -1)


def _misfit(
    system: System, *, measured: Any, uncertainty: Any, unknown: Any = None, modes: Any = None, prior: Any = None
) -> Any:
    given = {"measured": measured, "uncertainty": uncertainty, "unknown": unknown, "modes": modes, "prior": prior}
    return np.array([fit.chi2 for fit in _fits(system, given)]).reshape(system.shape)


def _peak_response(system: System, *, motion: Any, t: Any, modes: int = 5) -> Any:
    return np.max(np.abs(cra.tip_response(system, motion, t, modes=modes)), axis=-1)


def _residual_vibration(system: System, *, motion: Any, modes: int = 5) -> Any:
    return cra.residual_vibration(system, motion, modes=modes)


def _boundary_width(
    system: System, *, excitation: Any, epsilon: Any, resonance: tuple[int, int], order: int = 1, modes: int = 3
) -> Any:
    lower, upper = cra.stability_boundary(system, excitation, epsilon, resonance=resonance, order=order, modes=modes)
    return upper - lower


def _growth_rate(system: System, *, excitation: Any, angular_frequency: Any, epsilon: Any, modes: int = 3) -> Any:
    return cra.growth_rate(system, excitation, angular_frequency, epsilon, modes=modes)


QUANTITIES: Mapping[str, Quantity] = {
    quantity.name: quantity
    for quantity in (
        Quantity("natural_frequencies", _natural_frequencies, "Hz", "natural frequencies", ("mode",)),
        Quantity("eigenvalues", _eigenvalues, "rad/s", "complex eigenvalues", ("mode",)),
        Quantity(
            "oscillating_frequencies",
            _oscillating_frequencies,
            "Hz",
            "imaginary parts of the complex eigenvalues over 2 pi",
            ("mode",),
        ),
        Quantity("damping_ratios", _damping_ratios, "1", "damping ratios of the complex eigenvalues", ("mode",)),
        Quantity("identified", _identified, "", "values in SI that fit measured frequencies best", ("unknown",)),
        Quantity("misfit", _misfit, "1", "chi2 of the best fit to measured natural frequencies"),
        Quantity("peak_response", _peak_response, "m", "largest elastic tip displacement at the times t"),
        Quantity("residual_vibration", _residual_vibration, "m", "peak tip amplitude after the stop"),
        Quantity(
            "boundary_width",
            _boundary_width,
            "rad/s",
            "width of the instability region by multiple scales",
            axes={"epsilon": "1"},
        ),
        Quantity(
            "growth_rate",
            _growth_rate,
            "1/s",
            "growth rate by Floquet theory",
            axes={"angular_frequency": "rad/s", "epsilon": "1"},
        ),
    )
}


def named_quantity(quantity: str | Callable[..., Any], system: System) -> Quantity:
    """Return an entry of `QUANTITIES`, a sensitivity to a parameter of a system, or a function of it as a quantity."""
    if callable(quantity):
        name = getattr(quantity, "__name__", type(quantity).__name__)
        return Quantity(name, quantity, "", (inspect.getdoc(quantity) or name).splitlines()[0])
    units = system.model.units
    for parameter in system.values if isinstance(quantity, str) else ():
        for name, kind, unit, meaning in (
            (f"df_d{parameter}", "rate", _per(units.get(parameter, "")), "sensitivity"),
            (f"log_{parameter}", "log", "1", "logarithmic sensitivity"),
        ):
            if name == quantity:
                function = partial(_sensitivity, kind, parameter)
                return Quantity(name, function, unit, f"{meaning} of the natural frequencies to {parameter}", ("mode",))
    if isinstance(quantity, str) and quantity in QUANTITIES:
        return QUANTITIES[quantity]
    words = f"one of {', '.join(QUANTITIES)}, df_dNAME or log_NAME of a parameter, or a function of a system"
    raise (ValueError if isinstance(quantity, str) else TypeError)(f"quantity = {shown(quantity)}: must be {words}")


def _per(unit: str) -> str:
    """Return Hz over a unit, none if that is not known."""
    above, _, below = unit.partition("/")
    if not unit:
        return ""
    below = "" if above == "1" and not below else f"/({above})" if " " in above else f"/{above}"
    return " ".join(["Hz", *unit.partition("/")[2].split()]) + below
