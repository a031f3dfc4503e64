"""The arm's fast route: derived from its Lagrangian once on a machine, then read without SymPy."""

from __future__ import annotations

from functools import cache
from typing import Any

from cra_sym.arm.parameters import Arm
from cra_sym.kernels import derived_kernel
from cra_sym.model.one_wave import OneWave

__all__ = ["arm_route", "route_values"]


@cache
def arm_route() -> OneWave:
    """Return the route of the Lagrangian (7) with the base at rest."""
    return OneWave(derived_kernel("cra_sym.arm.instance:arm_scales"))


def route_values(arm: Arm) -> list[Any]:
    """Return the values of the route's parameters, numbers or arrays."""
    return [arm.I if name == "I_z" else getattr(arm, name) for name in arm_route().scales.arguments]
