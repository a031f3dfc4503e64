"""What can be swept: each quantity with its unit, meaning and the axes it adds."""

from __future__ import annotations

import inspect
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from typing import Any

import numpy as np

import cra_sym as cra
from cra_sym.checks import choice
from cra_sym.model.system import System

__all__ = ["QUANTITIES", "Quantity", "named_quantity"]


@dataclass(frozen=True)
class Quantity:
    """Something of a system that can be swept.

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
        except ValueError:  # a built-in function that does not say
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


def _natural_frequencies(system: System, *, modes: int = 3) -> Any:
    return cra.natural_frequencies(system, modes=modes)


def _sensitivity(name: str, system: System, *, modes: int = 3) -> Any:
    return getattr(cra.sensitivities(system, modes=modes), name)


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


_FREQUENCIES = "of the natural frequencies"
QUANTITIES: Mapping[str, Quantity] = {
    quantity.name: quantity
    for quantity in (
        Quantity("natural_frequencies", _natural_frequencies, "Hz", "natural frequencies", ("mode",)),
        *(
            Quantity(name, partial(_sensitivity, name), unit, f"{kind} {_FREQUENCIES} to {spring}", ("mode",))
            for name, unit, kind, spring in (
                ("df_dk_t", "Hz m/N", "sensitivity", "k_t"),
                ("df_dk_r", "Hz rad/(N m)", "sensitivity", "k_r"),
                ("log_k_t", "1", "logarithmic sensitivity", "k_t"),
                ("log_k_r", "1", "logarithmic sensitivity", "k_r"),
            )
        ),
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


def named_quantity(quantity: str | Callable[..., Any]) -> Quantity:
    """Return an entry of `QUANTITIES`, or a function of a system as a quantity."""
    if callable(quantity):
        name = getattr(quantity, "__name__", type(quantity).__name__)
        return Quantity(name, quantity, "", (inspect.getdoc(quantity) or name).splitlines()[0])
    return QUANTITIES[choice("quantity", quantity, QUANTITIES)]
