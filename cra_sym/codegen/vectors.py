"""Reference vectors: results of the package's own kernels for random and extreme arms, one line per check."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import fields
from typing import Any, NamedTuple

import numpy as np

import cra_sym as cra
from cra_sym.analysis import state_space as state_space_module
from cra_sym.analysis.modal_parameters import modal_parameters
from cra_sym.analysis.modes import mode_shapes, natural_frequencies
from cra_sym.analysis.responses import tip_response
from cra_sym.analysis.sensitivities import sensitivities
from cra_sym.analysis.zones import first_order_zone
from cra_sym.arm.excitations import JointStiffness
from cra_sym.arm.frequency_parameters import frequency_parameters
from cra_sym.arm.parameters import Arm
from cra_sym.codegen.characteristic import characteristic
from cra_sym.model.excitations import AxialBase

__all__ = ["SEED", "TOLERANCE", "ArmReference", "arm_checks", "extreme_arms", "random_arms"]

SEED = 20240229
TOLERANCE = 1e-12
FIELDS = tuple(field.name for field in fields(Arm))
_STIFFNESSES = (0.0, 1e-9, 1e12, np.inf)


class ArmReference(NamedTuple):
    """One line: a quantity, its inputs, the expected results, and the absolute error allowed."""

    quantity: str
    inputs: tuple[float, ...]
    outputs: tuple[float, ...]
    absolute: float = 0.0


def random_arms(count: int, seed: int = SEED) -> list[Arm]:
    """Return arms with random parameters, stiffnesses and inertias over many decades."""
    rng = np.random.default_rng(seed)

    def decades(low: float, high: float) -> float:
        return float(f"{10 ** rng.uniform(low, high):.6g}")

    made = []
    for _ in range(count):
        arm = Arm(
            L=decades(-1, 1), b=decades(-3, -1), h=decades(-3.5, -2), E=decades(9, 11.5), rho=decades(2.5, 4),
            m_b=decades(-1, 2), zeta=float(rng.choice([0.0, 0.0, 0.01, 0.3])),
        )  # fmt: skip
        stiff = float(arm.EI) / float(arm.L) ** 3
        mass = float(arm.rhoA) * float(arm.L)
        made.append(
            arm.replace(
                k_t=float(f"{stiff * decades(-3, 7):.6g}"),
                k_r=float(f"{stiff * float(arm.L) ** 2 * decades(-3, 7):.6g}"),
                m_e=float(f"{mass * decades(-3, 2):.6g}"),
                J_e=float(rng.choice([0.0, float(f"{mass * float(arm.L) ** 2 * decades(-5, 0):.6g}")])),
            )
        )
    return made


def extreme_arms() -> list[Arm]:
    """Return the nominal arm with stiffnesses of 0, 1e-9, 1e12 and infinity and tip masses from none to huge."""
    nominal = Arm.nominal()
    made = [nominal.replace(k_t=k_t, k_r=k_r) for k_t in _STIFFNESSES for k_r in _STIFFNESSES]
    made += [nominal.replace(k_t=k, k_r=k, m_e=m) for k in (0.0, 50.0, np.inf) for m in (0.0, 1e6)]
    made += [
        nominal.replace(k_t=50.0, k_r=k, J_e=j, m_e=m) for k in (0.0, 5.0) for j in (1e-9, 1e3) for m in (0.0, 1.0)
    ]
    return made


def arm_checks(*, everything: bool) -> Iterator[ArmReference]:
    """Yield the checks of an exported arm, quantity by quantity.

    Parameters
    ----------
    everything : bool
        Not only frequencies but also modes, sensitivities, responses, state space and stability.
    """
    arms = [Arm.nominal(), *extreme_arms(), *random_arms(24)]
    together = Arm(**{name: np.array([getattr(arm, name) for arm in arms]) for name in FIELDS})
    yield from _spectrum_checks(arms, together)
    if everything:
        yield from _modal_checks(arms, together)
        yield from _sensitivity_checks(arms, together)
        yield from _stability_checks(arms, together)
        for arm in _watched(arms):
            yield from _shape_checks(arm)
            yield from _response_checks(arm)
            yield from _system_checks(arm)


def _watched(arms: list[Arm]) -> Any:
    """Return an iterator over the arms with a progress bar on a terminal."""
    from tqdm import tqdm

    return tqdm(arms, desc="reference vectors", leave=False, disable=None)


def _row(values: Any) -> tuple[float, ...]:
    return tuple(np.asarray(values, float).ravel().tolist())


def _numbers(arm: Arm, *more: float) -> tuple[float, ...]:
    return (*(float(getattr(arm, name)) for name in FIELDS), *map(float, more))


def _check(quantity: str, inputs: tuple[float, ...], values: Any, loss: float = 0.0) -> ArmReference:
    row = _row(values)
    size = np.abs(row)[np.isfinite(row)]
    return ArmReference(quantity, inputs, row, TOLERANCE * loss * float(np.max(size, initial=0.0)))


def _spectrum_checks(arms: list[Arm], together: Arm) -> Iterator[ArmReference]:
    groups = np.stack([np.asarray(x) for x in (together.kappa_t, together.kappa_r, together.mu, together.iota)])
    solved = frequency_parameters(groups[0], groups[1], groups[2], groups[3], modes=6)
    for row, lam in zip(groups.T, solved, strict=True):
        yield ArmReference("frequency_parameters", _row(row), _row(lam))
    for arm, frequencies in zip(arms, natural_frequencies(together, 4), strict=True):
        yield ArmReference("natural_frequencies", _numbers(arm), _row(frequencies))
    for number, (kappa_t, kappa_r, mu, iota) in enumerate(groups.T.tolist()):
        for lam in (0.0, 0.7, 1.6, 4.0 + number / 7, 30.0):  # below and above the change to exponentials
            for order, (value, scale) in enumerate(zip(*characteristic(kappa_t, kappa_r, mu, iota, lam), strict=True)):
                inputs = kappa_t, kappa_r, mu, iota, lam, float(order)
                yield ArmReference("characteristic", inputs, (value,), TOLERANCE * scale)


_MODAL = (
    "omega", "participation", "root_displacement", "root_slope", "root_moment", "root_shear", "tip_displacement",
    "tip_slope",
)  # fmt: skip


def _modal_checks(arms: list[Arm], together: Arm) -> Iterator[ArmReference]:
    modal = modal_parameters(together, 4)
    for name in _MODAL:
        for arm, row in zip(arms, getattr(modal, name), strict=True):
            yield _check(name, _numbers(arm), row, float(name != "omega"))


def _sensitivity_checks(arms: list[Arm], together: Arm) -> Iterator[ArmReference]:
    """Yield the checks of sensitivities, with inf and nan for rigid-body modes."""
    found = sensitivities(together, 4)
    for name in ("df_dk_t", "df_dk_r", "log_k_t", "log_k_r"):
        for arm, row in zip(arms, getattr(found, name), strict=True):
            yield _check(name, _numbers(arm), row, 1.0)


def _shape_checks(arm: Arm) -> Iterator[ArmReference]:
    places = np.linspace(0.0, 1.0, 9) * float(arm.L)
    for derivative in range(4):
        table = mode_shapes(arm, places, 4, derivative)
        absolute = TOLERANCE * float(np.max(np.abs(table)))
        for k in (0, 3, 8):
            yield ArmReference("mode_shape", _numbers(arm, places[k], derivative), _row(table[:, k]), absolute)


def _response_checks(arm: Arm) -> Iterator[ArmReference]:
    omega = float(modal_parameters(arm, 3).omega[2])
    period = 2 * np.pi / omega
    motions = [
        (0.1, 0.0, 0.0, 0.0, 0.0),
        (0.0, 0.2, 1e-3, 0.9 * omega, 0.3),
        (0.05, -0.1, 1e-3, omega, np.pi),
        (0.0, 0.0, 1e-3, 0.01 * omega, 1.0),
    ]
    times = np.array([0.0, 1e-4, 0.03, 0.4, 7.3]) * period
    base = cra.BaseMotion(*np.transpose(motions))
    tables = np.asarray(tip_response(arm, base, times, modes=4)), np.asarray(base.displacement(times))
    for motion, values, moved in zip(motions, *tables, strict=True):
        scale = float(np.max(np.abs(values))) + float(np.max(np.abs(moved)))
        for t, value in zip(times, values, strict=True):
            yield ArmReference("tip_response", _numbers(arm, *motion, t), (float(value),), TOLERANCE * scale)


def _system_checks(arm: Arm) -> Iterator[ArmReference]:
    whole = float(arm.numerics("carried", "w").function(*arm.domain.values)[0])
    rest = whole - np.sum(modal_parameters(arm, 3).participation ** 2)
    for name, kind in (("acceleration", "base_acceleration"), ("force", "drive_force")):
        system = state_space_module.state_space(arm, 3, kind)
        loss = float(whole / rest) if name == "force" else 1.0  # mass that moves with the base but not in the modes
        for part in "ABC":
            yield _check(f"state_space_{name}_{part}", _numbers(arm), getattr(system, part), loss)


def _stability_checks(arms: list[Arm], together: Arm) -> Iterator[ArmReference]:
    modal = modal_parameters(together, 3)
    joint = 1.0 * modal.stiffness_translation + 0.5 * modal.stiffness_rotation
    for arm, P, G in zip(arms, joint, modal.axial, strict=True):
        yield _check("excitation_joint", _numbers(arm, 1.0, 0.5), P, 1.0)
        yield _check("excitation_axial", _numbers(arm, 1e-3, 10.0), 1e-3 * 10.0**2 * G, 1.0)
    excitations = ("joint", (1.0, 0.5), JointStiffness(1.0, 0.5)), ("axial", (1e-3, 0.0), AxialBase(1e-3))
    for name, numbers, excitation in excitations:
        for resonance in ((1, 1), (2, 2), (1, 2)):
            zone = first_order_zone(together, excitation, np.asarray(0.2), *resonance, modes=3)
            for arm, centre, half_width in zip(arms, zone.centre, zone.half_width, strict=True):
                if np.isfinite(half_width):
                    inputs = _numbers(arm, *numbers, 0.2, *resonance)
                    yield ArmReference(f"boundary_{name}", inputs, (centre - half_width, centre + half_width))
