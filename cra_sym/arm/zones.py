"""Where a zone of instability lies and how wide it is: the derived kernels of multiple scales, fed with modes."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cache
from typing import Any

import numpy as np

from cra_sym.arm.analysis import ModalParameters, modal_parameters
from cra_sym.arm.excitation import AxialBase, JointStiffness
from cra_sym.arm.parameters import Arm
from cra_sym.arm.residual import moments_of_all_modes
from cra_sym.kernels import Kernel, derived_kernel

__all__ = ["Parametric", "Zone", "first_order_zone", "zone_of"]

Parametric = JointStiffness | AxialBase
#: Modes in the sums of second order; those beyond enter by their statics (joint) or not at all (axial base, where the
#: terms fall off with the sixth power of the mode's number).
_SPECTATORS = 24


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
        How far the second order moves the zone, rad/s; 0 in a zone to first order.
    strength : ndarray
        Positive where the coupling can feed both modes, zero without coupling, negative where it cannot.
    """

    centre: np.ndarray
    half_width: np.ndarray
    free_half_width: np.ndarray
    shift: np.ndarray
    strength: np.ndarray


@cache
def _kernel(name: str) -> Kernel:
    return derived_kernel(f"cra_sym.arm.boundaries:{name}", backend="numpy")


def _evaluate(name: str, values: dict[str, Any]) -> Any:
    kernel = _kernel(name)
    return kernel(*(values[argument] for argument in kernel.arguments))


def _kind(first: int, second: int) -> tuple[str, dict[str, int]]:
    """Return the kind of resonance and the modes behind its labels, counted from 0; ``second`` is signed."""
    if first == second:
        return "principal", {"n": first - 1}
    return ("sum" if second > 0 else "difference"), {"m": first - 1, "n": abs(second) - 1}


def _quantities(
    arm: Arm, modal: ModalParameters, excitation: Parametric, epsilon: Any, first: int, second: int, tongue: int
) -> tuple[dict[str, Any], np.ndarray, np.ndarray]:
    """Return what the kernels ask for by name, the exact resonance, and the coupling there."""
    _, labels = _kind(first, second)
    omega = modal.omega
    centre = (omega[..., first - 1] + np.sign(second) * omega[..., abs(second) - 1]) / tongue
    coupling, slope = excitation.coupling(modal, centre), excitation.slope(modal, centre)
    values: dict[str, Any] = {"epsilon": epsilon}
    for a, i in labels.items():
        values |= {f"omega_{a}": omega[..., i], f"c_{a}": np.asarray(arm.zeta) * omega[..., i], f"S_{a}": 0.0}
        for b, k in labels.items():
            values |= {f"P_{a}{b}": coupling[..., i, k], f"dP_{a}{b}": slope[..., i, k], f"W_{a}{b}": 0.0}
    return values, centre, coupling


def _sums(
    arm: Arm,
    modal: ModalParameters,
    excitation: Parametric,
    values: dict[str, Any],
    coupling: np.ndarray,
    labels: dict[str, int],
    name: str,
) -> dict[str, np.ndarray]:
    """Return the sums over all modes of the arm."""
    spectators = np.setdiff1d(np.arange(modal.omega.shape[-1]), list(labels.values()))
    columns = {key: np.asarray(value)[..., None] for key, value in values.items()}
    kernel = _kernel(name)
    sums = {}
    for which in kernel(*(1.0 for _ in kernel.arguments)):
        row, target = labels[which[2]], labels[which[-1]]
        path = coupling[..., row, :] * coupling[..., :, target]
        at = columns | {"omega_j": modal.omega[..., spectators], "path": path[..., spectators]}
        table = _evaluate(name, at)[which]
        total = table["resonant"][..., 0] + np.where(at["path"] == 0, 0.0, table["spectator"]).sum(axis=-1)
        if isinstance(excitation, JointStiffness):
            with np.errstate(divide="ignore", invalid="ignore"):
                known = [np.where(path == 0, 0.0, path / modal.omega**power).sum(axis=-1) for power in (2, 4)]
            whole = moments_of_all_modes(arm, modal, excitation, row, target)
            tails = table["tail"][..., 0], table["tail_2"][..., 0]
            total = total + sum(t * (all_ - some) for t, all_, some in zip(tails, whole, known, strict=True))
        sums[which] = total
    return sums


def zone_of(
    arm: Arm, excitation: Parametric, epsilon: np.ndarray, first: int, second: int, tongue: int, modes: int
) -> Zone:
    """Return a zone to second order; modes are counted from 1, and ``second`` is negative for a difference."""
    kind, labels = _kind(first, second)
    modal = modal_parameters(arm, max(modes, _SPECTATORS))
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        values, centre, coupling = _quantities(arm, modal, excitation, epsilon, first, second, tongue)
        values |= _sums(arm, modal, excitation, values, coupling, labels, f"sums_{kind}_{tongue}")
        zone = _zone(kind, tongue, values, centre, arm)
        return replace(zone, shift=_with_damping(f"shift_{kind}_{tongue}", values, arm)[0])


def first_order_zone(
    arm: Arm, modal: ModalParameters, excitation: Parametric, epsilon: np.ndarray, first: int, second: int
) -> Zone:
    """Return a zone to first order, from modes already computed."""
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        values, centre, _ = _quantities(arm, modal, excitation, epsilon, first, second, 1)
        return _zone(_kind(first, second)[0], 1, values, centre, arm)


def _zone(kind: str, tongue: int, values: dict[str, Any], centre: np.ndarray, arm: Arm) -> Zone:
    half_width, free = _with_damping(f"half_width_{kind}_{tongue}", values, arm)
    through = "P" if tongue == 1 else "W"
    strength = values[f"{through}_nn"] ** 2
    if kind != "principal":
        strength = (1 if kind == "sum" else -1) * values[f"{through}_mn"] * values[f"{through}_nm"]
    half_width = np.where((strength > 0) & (centre > 0), half_width, np.nan)
    return Zone(centre, half_width, free, np.zeros_like(free), strength)


def _with_damping(name: str, values: dict[str, Any], arm: Arm) -> tuple[np.ndarray, np.ndarray]:
    """Return a quantity of the boundary, each arm with its damping, and the same without any."""
    free, damping = _evaluate(name, values), np.asarray(arm.zeta) > 0
    return (np.where(damping, _evaluate(f"damped_{name}", values), free) if damping.any() else free), free
