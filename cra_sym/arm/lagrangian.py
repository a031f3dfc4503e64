"""The paper's Lagrangian, (3), (4) and (7), from which everything else is derived."""

from __future__ import annotations

from functools import cache
from typing import NamedTuple

from sympy import Expr, Integral, Rational

from cra_sym.model import Model
from cra_sym.symbols import symbol

__all__ = ["ArmLagrangian", "arm_model", "paper_lagrangian"]

x, t, w, v, L = (symbol(name) for name in ("x", "t", "w", "v", "L"))
E, I_z, rho, A, b, h = (symbol(name) for name in ("E", "I_z", "rho", "A", "b", "h"))
m_b, m_e, J_e, k_t, k_r = (symbol(name) for name in ("m_b", "m_e", "J_e", "k_t", "k_r"))

HALF = Rational(1, 2)


class ArmLagrangian(NamedTuple):
    """The arm's Lagrangian in the pieces that :func:`cra_sym.mechanics.hamilton` and :class:`cra_sym.Model` take."""

    density: Expr
    left: Expr
    right: Expr

    def total(self) -> Expr:
        """Return the Lagrangian as one expression: the density integrated, the end terms evaluated at their ends."""
        return Integral(self.density, (x, 0, L)) + self.left.subs(x, 0) + self.right.subs(x, L)


def kinetic_energy() -> ArmLagrangian:
    """Return the kinetic energy (3) of manipulator, base and end-effector, which move with the speed of w + v."""
    speed = (w + v).diff(t)
    base = HALF * m_b * w.diff(t) ** 2
    tip = HALF * m_e * speed**2 + HALF * J_e * v.diff(x, t) ** 2
    return ArmLagrangian(HALF * rho * A * speed**2, base, tip)


def potential_energy(*, joint: bool = True) -> ArmLagrangian:
    """Return the potential energy (4) of the bent manipulator and, unless left out, of the joint's two springs."""
    springs = HALF * k_t * v**2 + HALF * k_r * v.diff(x) ** 2
    return ArmLagrangian(HALF * E * I_z * v.diff(x, 2) ** 2, springs if joint else springs * 0, springs * 0)


def paper_lagrangian(*, joint: bool = True) -> ArmLagrangian:
    """Return the paper's Lagrangian (7), for use in :class:`cra_sym.Model`, modified or unmodified.

    Parameters
    ----------
    joint : bool
        Whether the joint's springs store energy; the paper's words for (4) leave them out.

    Returns
    -------
    density, left, right : Expr
        Lagrangian density (J/m) and the Lagrangian of the base and joint at x = 0 and of the end-effector at x = L (J),
        in the symbols of ``cra_sym.symbols``: A and I_z are area and second moment of area of the section.

    Examples
    --------
    >>> density, left, right = paper_lagrangian()
    >>> right
    J_e*Derivative(v(x, t), t, x)**2/2 + m_e*(Derivative(v(x, t), t) + Derivative(w(t), t))**2/2
    """
    kinetic, potential = kinetic_energy(), potential_energy(joint=joint)
    return ArmLagrangian(*(T - U for T, U in zip(kinetic, potential, strict=True)))


@cache
def arm_model() -> Model:
    """Return the model of the paper's Lagrangian: the base's motion w(t) is prescribed, the section a rectangle."""
    density, left, right = paper_lagrangian()
    section = {A: b * h, I_z: b * h**3 / 12}
    return Model(
        density, fields=[v], prescribed=[w], x=x, domain=(0, L), t=t, left=left, right=right, definitions=section
    )
