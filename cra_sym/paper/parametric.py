"""The three excitations, derived from the Lagrangian by Hamilton's principle."""

from __future__ import annotations

from functools import cache
from typing import Any

from sympy import Add, Dummy, Expr, Integral, Mul, cos, factor, integrate, sin, symbols

from cra_sym.arm.lagrangian import ArmLagrangian, kinetic_energy, paper_lagrangian, potential_energy
from cra_sym.mechanics import hamilton
from cra_sym.paper.energy import L, phi_i, phi_j, q_i, q_j, single_mode, t, tidy, v, w, x
from cra_sym.paper.evaluation import put
from cra_sym.symbols import symbol

__all__ = ["AXIAL", "TRANSVERSE", "axial_load", "coupling", "excited_lagrangian", "excited_motion"]

u, u_0, w_0, w_1, varpi, epsilon = (symbol(name) for name in ("u", "u_0", "w_0", "w_1", "varpi", "epsilon"))

KINDS = ("joint stiffness", "axial base", "transverse base")
#: Base motions along and across the arm.
AXIAL, TRANSVERSE = epsilon * u_0 * cos(varpi * t), w_0 + epsilon * w_1 * sin(varpi * t)


@cache
def axial_load() -> Expr:
    """Return the mass beyond x: the axial force per unit of axial acceleration of the base.

    The mass that has transverse kinetic energy in (3) also moves axially.
    """
    place, across = Dummy("x"), v.diff(t)
    density, tip = (part.diff(across, across) for part in kinetic_energy()[::2])
    return integrate(density.subs(x, place), (place, x, L)) + tip


@cache
def excited_lagrangian(kind: str) -> ArmLagrangian:
    """Return the Lagrangian of the arm with one of the excitations, the base otherwise at rest.

    A base that moves by u along the arm: a point of the deflected arm is at x + u - s, where s, the integral of
    v_x^2 / 2 from the joint on, is the foreshortening. In the kinetic energy the product -u' s' is, up to a total time
    derivative, u'' s; and the mass-weighted integral of s is, by parts, that of the load times v_x^2 / 2.
    """
    density, left, right = paper_lagrangian()
    if kind == "joint stiffness":
        swing = epsilon * cos(varpi * t)
        springs = potential_energy().left - potential_energy(joint=False).left
        left = left + springs - springs * (1 + swing)
        return ArmLagrangian(*(part.subs(w, 0).doit() for part in (density, left, right)))
    if kind == "axial base":
        density = density + u.diff(t, 2) * axial_load() * v.diff(x) ** 2 / 2
        return ArmLagrangian(*(part.subs(w, 0).doit() for part in (density, left, right)))
    if kind == "transverse base":
        return ArmLagrangian(density, left, right)
    raise ValueError(f"kind = {kind!r}: must be one of {', '.join(KINDS)}")


@cache
def excited_motion(kind: str) -> Any:
    """Return the result of Hamilton's principle for the excited arm with prescribed motion of the base."""
    density, left, right = excited_lagrangian(kind)
    base = {"axial base": [u], "transverse base": [w]}.get(kind, [])
    return hamilton(density, fields=[v], x=x, domain=(0, L), t=t, left=left, right=right, prescribed=base)


@cache
def coupling(kind: str) -> Expr:
    """Return P_ij of a parametric excitation: two modes substituted in the terms of the Lagrangian with epsilon
    cos(varpi t)."""
    total = put(excited_lagrangian(kind).total(), {u: AXIAL})
    two = single_mode(total, phi_i * q_i + phi_j * q_j)
    names = dict(zip((q_i, q_j), symbols("q_1 q_2"), strict=True))
    plain = two.subs({q.diff(t): 0 for q in names}).subs(names)
    form = -plain.diff(names[q_i]).diff(names[q_j]).doit(integrals=False)
    swing = Dummy("swing")
    share = _together(tidy(form.subs(cos(varpi * t), swing / epsilon).diff(swing)))
    if share.has(swing, t, epsilon):
        raise ArithmeticError(f"{kind}: the excitation is not linear in epsilon cos(varpi t): {share}")
    return share


def _together(expression: Expr) -> Expr:
    """Return the integrals along the arm combined into one, with constants in front."""
    parts = expression.expand()
    whole = [(parts.coeff(integral), integral) for integral in parts.atoms(Integral)]
    if not whole:
        return parts
    inside = factor(sum(c * integral.function for c, integral in whole))
    outside, along = inside.as_independent(x, as_Add=False)
    if outside.could_extract_minus_sign():
        sums = [part for part in Mul.make_args(along) if isinstance(part, Add)]
        outside, along = -outside, along.xreplace({sums[0]: -sums[0]}) if sums else -along
    rest = parts - sum(c * integral for c, integral in whole)
    return rest + outside * Integral(along, *whole[0][1].limits)
