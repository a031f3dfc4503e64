"""Quantities for the exports of the arm from its Lagrangian: the span, springs and inertias at its ends, energies."""

from __future__ import annotations

from functools import cache

import sympy as sp

from cra_sym.arm.lagrangian import arm_model
from cra_sym.codegen.program import DerivedFunction, function
from cra_sym.mechanics.one_wave_form import one_wave_scales
from cra_sym.model import Model
from cra_sym.model.excited import axial_load
from cra_sym.symbols import symbol

__all__ = ["NUMBERS", "energy_functions"]

NUMBERS = tuple(symbol(name) for name in ("L", "b", "h", "E", "rho", "m_b", "m_e", "J_e", "k_t", "k_r"))
"""The parameters, in the order of the row that the functions take."""
x, t, w, v = (symbol(name) for name in ("x", "t", "w", "v"))


def energy_functions() -> tuple[DerivedFunction, ...]:
    """Return the functions of the arm's parameters for its groups, sensitivities and loads."""
    return _of(arm_model())


@cache
def _of(model: Model) -> tuple[DerivedFunction, ...]:
    numbers, moved = ("numbers", NUMBERS), sp.symbols("displacement slope", real=True)
    joint = _stated(model, "left").subs(v.diff(x), moved[1]).subs(v, moved[0])
    rates = [-2 * joint.diff(symbol(name)) for name in ("k_t", "k_r")]
    return (
        function(
            "arm_constants",
            "Bending stiffness, mass per length, springs, inertias, mass of all.",
            _line(model),
            [numbers],
        ),
        function("joint_rates", "Rates of twice the joint's energy by k_t and k_r.", rates, [("moved", moved)]),
        function("axial_load", "Compression by a unit acceleration along x.", axial_load(model), [("x", x), numbers]),
    )


def _line(model: Model) -> list[sp.Expr]:
    """Return stiffness, mass per length, springs and inertias of the span, and the mass that moves with the base."""
    found = one_wave_scales(model.conservative)
    assert found is not None, "arm_family refuses other Lagrangians"
    stiffness, inertia, length = (found[name] for name in ("stiffness", "inertia", "length"))
    springs = [found[f"kappa {j}"] * stiffness / length ** (3 - 2 * j) for j in (0, 1)]
    masses = [found[f"mu {2 + j}"] * inertia * length ** (1 + 2 * j) for j in (0, 1)]
    whole = sum((_carried(model, part) for part in ("left", "right")), start=sp.S.Zero)
    whole += sp.integrate(_carried(model, "density"), (x, *model.equations.domain))
    return [sp.cancel(value) for value in (stiffness, inertia, *springs, *masses, whole)]


def _carried(model: Model, piece: str) -> sp.Expr:
    """Return twice the kinetic energy of a piece at unit velocity of the base."""
    still = _stated(model, piece).subs(v, 0).doit()
    return sp.expand(2 * still.subs(w.diff(t), 1).subs(w, 0))


def _stated(model: Model, piece: str) -> sp.Expr:
    return model.pieces[piece].subs(dict(model.pieces["definitions"]))
