"""Position and width of zones of instability, from the derived kernels of multiple scales."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cache
from typing import Any

import numpy as np

from cra_sym.analysis.floquet import Matrices, matrices_of
from cra_sym.analysis.reduced_zones import reduced_zone
from cra_sym.analysis.static_corrections import moments_of_other_modes
from cra_sym.kernels import Kernel, derived_kernel
from cra_sym.model.excitations import Fluctuation, Parametric
from cra_sym.model.system import System

__all__ = ["Zone", "first_order_zone", "zone_of"]

#: Modes in the sums of second order. Those beyond are included statically for springs of ends, and neglected for
#: excitations along the span, where the terms decrease with the sixth power of the mode number.
_SPECTATORS = 24
_SMALLEST = 1e-9  # epsilon used in place of 0, at which a zone has a strength but negligible width
_UNCOUPLED = 1e-24  # squared coupling over the frequencies below which it is rounding


@dataclass(frozen=True)
class Zone:
    """A zone of instability.

    Attributes
    ----------
    centre : ndarray
        Exact resonance, rad/s.
    half_width : ndarray
        With damping, rad/s; nan where there is no instability.
    free_half_width : ndarray
        Without damping.
    shift : ndarray
        Second-order shift of the zone, rad/s; 0 to first order.
    strength : ndarray
        Positive where the coupling can destabilise both modes, zero without coupling, negative otherwise.
    sides : pair of ndarray, optional
        Where they do not follow from centre, shift and half-width.
    """

    centre: np.ndarray
    half_width: np.ndarray
    free_half_width: np.ndarray
    shift: np.ndarray
    strength: np.ndarray
    sides: tuple[np.ndarray, np.ndarray] | None = None

    @property
    def bounds(self) -> tuple[np.ndarray, np.ndarray]:
        """Both sides, rad/s: 0 and inf where a zone has no end."""
        if self.sides is not None:
            return self.sides
        return self.centre + self.shift - self.half_width, self.centre + self.shift + self.half_width


@cache
def _kernel(name: str) -> Kernel:
    return derived_kernel(f"cra_sym.mechanics.boundaries:{name}", backend="numpy")


def _evaluate(name: str, values: dict[str, Any]) -> Any:
    kernel = _kernel(name)
    return kernel(*(values[argument] for argument in kernel.arguments))


def _kind(first: int, second: int) -> tuple[str, dict[str, int]]:
    """Return the kind of resonance and its modes, counted from 0; ``second`` is signed."""
    if first == second:
        return "principal", {"n": first - 1}
    return ("sum" if second > 0 else "difference"), {"m": first - 1, "n": abs(second) - 1}


def _quantities(
    system: System, modes: int, excitation: Parametric, epsilon: Any, first: int, second: int, tongue: int
) -> tuple[dict[str, Any], np.ndarray, np.ndarray]:
    """Return the arguments of the kernels by name, the exact resonance, and the coupling there."""
    _, labels = _kind(first, second)
    omega = system.natural_frequencies(modes)
    centre = (omega[..., first - 1] + np.sign(second) * omega[..., abs(second) - 1]) / tongue
    coupling, slope = _coupling(system, excitation, modes, centre)
    values: dict[str, Any] = {"epsilon": epsilon}
    for a, i in labels.items():
        values |= {f"omega_{a}": omega[..., i], f"c_{a}": np.asarray(system.zeta) * omega[..., i], f"S_{a}": 0.0}
        for b, k in labels.items():
            values |= {f"P_{a}{b}": coupling[..., i, k], f"dP_{a}{b}": slope[..., i, k], f"W_{a}{b}": 0.0}
    return values, centre, coupling


def _coupling(system: System, excitation: Parametric, modes: int, varpi: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return P and dP/dvarpi, shape (..., modes, modes)."""
    (drive,) = excitation.drives(system, modes)
    assert drive.stiffness is not None
    power, varpi = drive.oscillation.power, varpi[..., None, None]
    return varpi**power * drive.stiffness, power * varpi ** max(power - 1, 0) * drive.stiffness


def _sums(
    system: System,
    omega: np.ndarray,
    excitation: Parametric,
    values: dict[str, Any],
    coupling: np.ndarray,
    labels: dict[str, int],
    name: str,
) -> dict[str, np.ndarray]:
    """Return the sums over all modes of the system."""
    spectators = np.setdiff1d(np.arange(omega.shape[-1]), list(labels.values()))
    alone = not spectators.size
    spectators = np.zeros(1, int) if alone else spectators  # a placeholder whose contribution is discarded below
    columns = {key: np.asarray(value)[..., None] for key, value in values.items()}
    kernel = _kernel(name)
    sums = {}
    for which in kernel(*(1.0 for _ in kernel.arguments)):
        row, target = labels[which[2]], labels[which[-1]]
        path = 0.0 * coupling[..., 0] if alone else coupling[..., row, :] * coupling[..., :, target]
        at = columns | {"omega_j": omega[..., spectators], "path": path[..., spectators]}
        table = _evaluate(name, at)[which]
        total = table["resonant"][..., 0] + np.where(at["path"] == 0, 0.0, table["spectator"]).sum(axis=-1)
        if isinstance(excitation, Fluctuation) and excitation.springs(system):
            others = _paths_of_other_modes(system, excitation, omega.shape[-1], row, target)
            tails = table["tail"][..., 0], table["tail_2"][..., 0]
            total = total + sum(tail * path for tail, path in zip(tails, others, strict=True))
        sums[which] = total
    return sums


def _paths_of_other_modes(
    system: System, excitation: Fluctuation, modes: int, row: int, target: int
) -> tuple[np.ndarray, np.ndarray]:
    """Return the sums over the omitted modes j of P_rj P_jt / omega_j^2 and / omega_j^4."""
    b = excitation.spring_displacements(system, modes)
    weights = np.stack(np.broadcast_arrays(*(excitation.weights[name] for name in excitation.springs(system))), axis=-1)
    first, last = (weights * b[..., mode] for mode in (row, target))
    second, fourth = (
        ((first[..., None, :] @ moment)[..., 0, :] * last).sum(axis=-1)
        for moment in moments_of_other_modes(system, excitation, modes)
    )
    return second, fourth


def derived(matrices: Matrices) -> bool:
    """Tell whether the derived boundaries apply: one symmetric stiffness times cos(varpi t), modal damping."""
    if not matrices.only_stiffness or len(matrices.drives) != 1:
        return False
    ((order, kind, _), stiffness, *_) = matrices.drives[0]
    symmetric = stiffness is not None and np.array_equal(stiffness, stiffness.swapaxes(-1, -2))
    return symmetric and order == 1 and kind == "cos"


def _with_spectators(system: System, modes: int) -> int:
    return max(modes, min(_SPECTATORS, system.most_modes))


def zone_of(
    system: System, excitation: Parametric, epsilon: np.ndarray, first: int, second: int, tongue: int, modes: int
) -> Zone:
    """Return a zone to second order; modes are counted from 1, and ``second`` is negative for a difference."""
    more = _with_spectators(system, modes)
    if not derived(matrices_of(system, excitation, modes)):
        return _reduced(system, excitation, epsilon, (first, second), tongue, more, 2)
    kind, labels = _kind(first, second)
    modes = more
    omega = system.natural_frequencies(modes)
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        values, centre, coupling = _quantities(system, modes, excitation, epsilon, first, second, tongue)
        values |= _sums(system, omega, excitation, values, coupling, labels, f"sums_{kind}_{tongue}")
        zone = _zone(kind, tongue, values, centre, system)
        return replace(zone, shift=_with_damping(f"shift_{kind}_{tongue}", values, system)[0])


def _reduced(
    system: System,
    excitation: Parametric,
    epsilon: np.ndarray,
    resonance: tuple[int, int],
    tongue: int,
    modes: int,
    order: int,
) -> Zone:
    positive = np.clip(np.where(epsilon > 0, epsilon, _SMALLEST), 1e-100, 1e60)  # their squares are numbers
    with np.errstate(over="ignore", invalid="ignore"):
        centre, sides = reduced_zone(system, excitation, positive, resonance, tongue, modes, order)
        half_width = (sides.upper - sides.lower) / 2
        middle = np.where(np.isinf(half_width), centre, (sides.lower + sides.upper) / 2)
    strength = sides.strength / positive**2
    strength = np.where(np.abs(strength) < _UNCOUPLED * centre**2, 0.0, strength)
    there = (strength > 0) & (centre > 0)
    half_width = np.where(there, np.where(epsilon > 0, half_width, 0.0), np.nan)
    shift = np.where(there, middle - centre, 0.0)
    endless = np.isinf(half_width)
    bounds = (
        np.where(endless, np.maximum(side, 0.0), centre + shift + sign * half_width)
        for sign, side in ((-1.0, sides.lower), (1.0, sides.upper))
    )
    lower, upper = bounds
    return Zone(centre, half_width, half_width, shift, strength, (lower, upper))


def first_order_zone(
    system: System, excitation: Parametric, epsilon: np.ndarray, first: int, second: int, modes: int, tongue: int = 1
) -> Zone:
    """Return a zone to first order; one of derived boundaries has tongue 1."""
    matrices = matrices_of(system, excitation, modes)
    if not derived(matrices):
        if matrices.modal.damping is not None or matrices.modal.stiffness is not None:
            modes = _with_spectators(system, modes)  # they couple the natural modes, of which the modes here are made
        return _reduced(system, excitation, epsilon, (first, second), tongue, modes, 1)
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        values, centre, _ = _quantities(system, modes, excitation, epsilon, first, second, 1)
        return _zone(_kind(first, second)[0], 1, values, centre, system)


def _zone(kind: str, tongue: int, values: dict[str, Any], centre: np.ndarray, system: System) -> Zone:
    half_width, free = _with_damping(f"half_width_{kind}_{tongue}", values, system)
    through = "P" if tongue == 1 else "W"
    strength = values[f"{through}_nn"] ** 2
    if kind != "principal":
        strength = (1 if kind == "sum" else -1) * values[f"{through}_mn"] * values[f"{through}_nm"]
    half_width = np.where((strength > 0) & (centre > 0), half_width, np.nan)
    return Zone(centre, half_width, free, np.zeros_like(free), strength)


def _with_damping(name: str, values: dict[str, Any], system: System) -> tuple[np.ndarray, np.ndarray]:
    """Return a quantity of the boundary with the damping of each system, and without damping."""
    free, damping = _evaluate(name, values), np.asarray(system.zeta) > 0
    return (np.where(damping, _evaluate(f"damped_{name}", values), free) if damping.any() else free), free
