"""The arm as an instance of :class:`cra_sym.Model`: what the arm can do, any Lagrangian can."""

from __future__ import annotations

from functools import cache

from sympy import Expr, Symbol

from cra_sym.arm.parameters import Arm
from cra_sym.mechanics.one_wave_form import one_wave_scales
from cra_sym.model import Model
from cra_sym.paper.energy import L, lagrangian, t, v, w, x
from cra_sym.paper.motion import F

__all__ = ["arm_model", "model_values"]


@cache
def arm_model(*, driven: bool = False) -> Model:
    """Return the model of the Lagrangian (7), the base at rest or, if ``driven``, free to move under the force F.

    Examples
    --------
    >>> import cra_sym as cra
    >>> arm = cra.Arm.nominal()
    >>> [f"{f:.3f}" for f in arm_model().natural_frequencies(model_values(arm))]
    ['2.428', '15.216', '42.610']
    """
    if driven:
        density, left, right = lagrangian()
        work = [(F, w, None)]
        return Model(
            density, fields=[v], coordinates=[w], x=x, domain=(0, L), t=t, left=left, right=right, virtual_work=work
        )
    density, left, right = (piece.subs(w, 0).doit() for piece in lagrangian())
    return Model(density, fields=[v], x=x, domain=(0, L), t=t, left=left, right=right)


def model_values(arm: Arm, *, driven: bool = False) -> dict[str, object]:
    """Return the arm's parameters by symbol name, as the model takes them."""
    names = ["L", "E", "rho", "A", "m_e", "J_e", "k_t", "k_r"] + (["m_b"] if driven else [])
    return {name: getattr(arm, name) for name in names} | {"I_z": arm.I}


def arm_scales() -> tuple[dict[str, Expr], tuple[Symbol, ...]]:
    """Return the scales and dimensionless groups of the arm with their arguments, derived from its Lagrangian."""
    model = arm_model()
    scales = one_wave_scales(model.state_form)
    assert scales is not None, "the arm has one wave number"
    return scales, model.symbols
