"""Checks of the arguments of identifications: measured frequencies, names of unknowns, priors."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from cra_sym.analysis.fit_search import Data
from cra_sym.checks import broadcastable, count, instance, listed, mapping, names, real_array, shown
from cra_sym.model.system import MOST_MODES, System
from cra_sym.si import check_rows, dimensions, paired

__all__ = ["checked_data", "checked_names", "checked_priors"]

_MOST_UNKNOWN = 6


def checked_data(system: System, name: str, measured: Any, uncertainty: Any, modes: Any) -> Data:
    """Return the measured frequencies, or raise an error that names the argument; ``name`` is that of ``measured``."""
    instance("system", system, System)
    if system.shape:
        raise ValueError(f"system has shape {system.shape}: must be a single set of values, not a batch")
    check_rows({name: measured, "uncertainty": uncertainty, "modes": modes})
    own, other = dimensions(measured), dimensions(uncertainty)
    if own and other and own != other:
        raise ValueError(f"uncertainty has the dimensions {other}: must have those of {name}, {own}")
    given = paired({name: measured, "uncertainty": uncertainty}, {name: "Hz", "uncertainty": "Hz"})
    frequencies = real_array(name, given[name], low=0.0, open_low=True, unit="Hz")
    sigma = real_array("uncertainty", given["uncertainty"], low=1e-60, high=1e60, unit="Hz")
    if frequencies.ndim != 1 or frequencies.size == 0:
        raise ValueError(f"{name} has shape {frequencies.shape}: must be one axis of frequencies")
    if np.any(np.diff(frequencies) <= 0):
        at = int(np.argmax(np.diff(frequencies) <= 0)) + 1
        raise ValueError(f"{name}[{at}] = {frequencies[at]:g}: must ascend, as natural frequencies do")
    if broadcastable(**{name: frequencies, "uncertainty": sigma}) != frequencies.shape:
        raise ValueError(f"uncertainty has shape {sigma.shape}: must be a number or {frequencies.shape}")
    if modes is None:
        numbers = np.arange(frequencies.size)
    else:
        chosen = [count("modes", mode, high=MOST_MODES) for mode in listed("modes", modes, "mode numbers from 1")]
        if len(chosen) != frequencies.size or sorted(set(chosen)) != chosen:
            raise ValueError(f"modes = {shown(modes)}: must be {frequencies.size} different modes, ascending")
        numbers = np.array(chosen) - 1
    return Data(frequencies, np.broadcast_to(sigma, frequencies.shape).copy(), numbers)


def checked_names(system: System, unknown: Any, prior: Mapping[str, Any]) -> tuple[str, ...]:
    """Return the names of all parameters to be estimated, or raise an error."""
    given = tuple(system.numerics("stiffnesses")) if unknown is None else names("unknown", unknown, system.values)
    found = tuple(dict.fromkeys([*given, *prior]))
    if not 1 <= len(found) <= _MOST_UNKNOWN:
        raise ValueError(f"unknown = {shown(unknown)}: must be 1 to {_MOST_UNKNOWN} names, those with priors included")
    return found


def checked_priors(system: System, prior: Any) -> dict[str, tuple[float, float]]:
    """Return value and uncertainty of each prior, or raise an error that names the parameter."""
    found = {}
    for name, pair in mapping("prior", prior, "names to (value, uncertainty)").items():
        if name not in system.values:
            raise ValueError(f"prior: {shown(name)} must be among {', '.join(system.values)}")
        numbers = real_array(f"prior: {name}", pair, unit=system.model.units.get(name))
        if numbers.shape != (2,) or not numbers[1] > 0:
            raise ValueError(f"prior: {name} = {shown(pair)}: must be a value and its positive uncertainty")
        value, deviation = map(float, numbers)
        if value == 0 or (value < 0 and name in system.numerics("stiffnesses")):
            raise ValueError(f"prior: {name} = {shown(pair)}: the value must be positive")
        found[name] = value, deviation
    return found
