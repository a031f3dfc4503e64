"""The arm's family of determinants and shapes, which the exports of the arm print."""

from __future__ import annotations

from cra_sym.arm.parameters import Arm
from cra_sym.model.one_wave import OneWave
from cra_sym.model.one_wave_family import Family

__all__ = ["arm_family"]

_STRUCTURE = (("k", "k"), ("m", "m"))
"""Structure assumed by the text around the printed functions: springs at the left end, inertias at the right one."""


def arm_family() -> Family:
    """Return the family of the paper's Lagrangian.

    Raises
    ------
    ValueError
        If the Lagrangian has changed and the exports, which are written for springs at the joint, inertias at the tip
        and a base that carries everything, no longer describe it.
    """
    arm = Arm.nominal()
    route, load = arm.numerics("route"), arm.numerics("load", "w")
    carried = load.share is not None and load.share.function(*arm.parameters) == -1 and not load.rest_ends
    if not isinstance(route, OneWave) or route.family.structure != _STRUCTURE or not carried:
        raise ValueError(
            "the arm's Lagrangian must be that of a beam with springs at x = 0 and inertias at x = L, all on the base; "
            "export it as a model"
        )
    return route.family
