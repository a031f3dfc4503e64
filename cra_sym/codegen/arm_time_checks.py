"""Reference vectors for the time-domain functions of the arm: state space, fitted shapes, input shapers."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from cra_sym.analysis.modes import mode_shapes
from cra_sym.analysis.responses import response
from cra_sym.analysis.shaping import input_shaper
from cra_sym.arm.parameters import Arm
from cra_sym.codegen.in_time_checks import stepped_outputs
from cra_sym.codegen.model_time import Signals
from cra_sym.codegen.vectors import FIELDS, random_arms
from cra_sym.solvers.motion import BaseMotion

__all__ = ["arm_time_checks"]

Line = tuple[str, tuple[float, ...], tuple[float, ...], float]  # quantity, given, expected, largest size in a sum
_MODES = 4
_ALONE = {"float64": 1e-3, "float32": 0.1}  # of all mass, that a free base moves alone


def arm_time_checks(in_time: Signals, real: str, kept: int) -> Iterator[Line]:
    """Yield the reference vectors of the arm's time-domain functions, stepped with a number of modes."""
    nominal = Arm.nominal()
    arms = [nominal, nominal.replace(k_t=1e4, k_r=1e3, m_e=0.05, J_e=1e-4, zeta=0.02), *random_arms(6)]
    arms.append(nominal.replace(k_t=0.0, k_r=0.0, zeta=0.1))  # two rigid-body modes
    for arm in arms:
        given = tuple(float(getattr(arm, name)) for name in FIELDS)
        omega = arm.natural_frequencies(_MODES)
        slowest = float(omega[omega > 0.0][0])
        long = arm.replace(L=max(float(arm.L), in_time.reach))
        own = tuple(float(getattr(long, name)) for name in FIELDS)
        for time, steps, found, size in stepped_outputs(in_time, long, kept, _ALONE[real]):
            yield "in_time", (*own, time, 0.25, steps), found, size
        yield from _responses(arm, given, slowest)
        shaped = np.ravel(input_shaper(slowest, float(arm.zeta), order=3))
        yield "input_shaper", (slowest, float(arm.zeta)), tuple(shaped.tolist()), 0.0


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
