"""Reference vectors for the time-domain functions of the arm: matrix exponentials, fitted shapes, input shapers."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from cra_sym.analysis.modal_parameters import ModalParameters, modal_parameters
from cra_sym.analysis.modes import mode_shapes
from cra_sym.analysis.responses import response
from cra_sym.analysis.shaping import input_shaper
from cra_sym.arm.parameters import Arm
from cra_sym.codegen.blocks import Blocks
from cra_sym.codegen.frozen import stepped
from cra_sym.codegen.vectors import FIELDS, random_arms
from cra_sym.solvers.motion import BaseMotion

__all__ = ["arm_time_checks"]

Line = tuple[str, tuple[float, ...], tuple[float, ...], float]  # quantity, given, expected, largest size in a sum
_MODES = 4


def arm_time_checks() -> Iterator[Line]:
    """Yield the reference vectors of the arm's time-domain functions."""
    nominal = Arm.nominal()
    arms = [nominal, nominal.replace(k_t=1e4, k_r=1e3, m_e=0.05, J_e=1e-4, zeta=0.02), *random_arms(6)]
    arms.append(nominal.replace(k_t=0.0, k_r=0.0, zeta=0.1))  # two rigid-body modes
    for arm in arms:
        given = tuple(float(getattr(arm, name)) for name in FIELDS)
        modal = modal_parameters(arm, _MODES)
        omega, blocks = np.asarray(modal.omega), _blocks(arm, modal)
        follows = abs(blocks.through[5]) < 1e-3  # the tip of a free arm stays at rest, so its acceleration is rounding
        slowest = float(omega[omega > 0.0][0])
        for time, steps in ((0.02 / omega[-1], 40), (0.9 / omega[-1], 7), (0.3 / slowest, 12)):
            found, size = stepped(blocks, float(time), 0.25, steps)
            yield "in_time", (*given, float(time), 0.25, steps), tuple(found[:5] if follows else found), size
        yield from _responses(arm, given, slowest)
        shaped = np.ravel(input_shaper(slowest, float(arm.zeta), order=3))
        yield "input_shaper", (slowest, float(arm.zeta)), tuple(shaped.tolist()), 0.0


def _blocks(arm: Arm, modal: ModalParameters) -> Blocks:
    """Return the base and the modes as blocks of unit force: q = -Gamma p."""
    omega, push = np.asarray(modal.omega), -np.asarray(modal.participation)
    tip = push * np.asarray(modal.tip_displacement)
    stiffness, damping = np.append(0.0, omega**2), np.append(0.0, 2 * float(arm.zeta) * omega)
    rows = [
        np.append(1.0, 0 * tip),
        np.append(1.0, tip),
        np.append(0.0, tip),
        np.append(0.0, -push * np.asarray(modal.root_shear)),
        np.append(0.0, push * np.asarray(modal.root_moment)),
        np.append(0.0, -(omega**2) * tip),
    ]
    rates = np.zeros((6, len(stiffness)))
    rates[5, 1:] = -damping[1:] * tip
    return Blocks(stiffness, damping, np.array(rows), rates, np.array([0, 0, 0, 0, 0, 1 + tip.sum()]))


def _responses(arm: Arm, given: tuple[float, ...], slowest: float) -> Iterator[Line]:
    """Yield derivatives by x fitted to the displacement at as many points as there are modes."""
    numbers = (0.05, -0.1, 1e-3, 0.8 * slowest, 0.4)
    length, t = float(arm.L), 0.6 / slowest
    places = length * np.linspace(0.2, 1.0, _MODES)
    shapes = np.asarray(mode_shapes(arm, places, _MODES)).T
    moved = np.array([float(response(arm, BaseMotion(*numbers), t, x, modes=_MODES)) for x in places])
    q = np.linalg.solve(shapes, moved)
    for x in (0.0, 0.37 * length, length):
        for derivative in range(4):
            total = float(np.asarray(mode_shapes(arm, [x], _MODES, derivative))[:, 0] @ q)
            size = np.abs(mode_shapes(arm, places, _MODES, derivative)).max() * np.abs(q).max() * np.linalg.cond(shapes)
            yield "response", (*given, *numbers, t, x, derivative), (total,), float(size)
