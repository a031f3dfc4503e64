"""Displacement, energies and the Lagrangian of the arm: equations (1)-(4), (6) and (7)."""

from __future__ import annotations

from functools import cache
from typing import Any, NamedTuple

from sympy import Eq, Expr, Integral, Rational

from cra_sym.arm.equations import checks, numbered
from cra_sym.arm.evaluation import at, evaluate, put
from cra_sym.arm.modal_sum import ModalSum
from cra_sym.symbols import Dimension, dimension, symbol

__all__ = ["ArmLagrangian", "lagrangian", "single_mode"]

x, t, w, v, y, L = (symbol(name) for name in ("x", "t", "w", "v", "y", "L"))
E, I_z, rho, A, b, h = (symbol(name) for name in ("E", "I_z", "rho", "A", "b", "h"))
m_b, m_e, J_e, k_t, k_r = (symbol(name) for name in ("m_b", "m_e", "J_e", "k_t", "k_r"))
phi_i, phi_j, q_i, q_j = (symbol(name) for name in ("phi_i", "phi_j", "q_i", "q_j"))

HALF = Rational(1, 2)
ENERGY = Dimension(2, 1, -2)


class ArmLagrangian(NamedTuple):
    """The arm's Lagrangian in the pieces that :func:`cra_sym.mechanics.hamilton` and :class:`cra_sym.Model` take."""

    density: Expr
    left: Expr
    right: Expr

    def total(self) -> Expr:
        """Return the Lagrangian as one expression: the density integrated, the end terms evaluated at their ends."""
        return Integral(self.density, (x, 0, L)) + at(self.left, 0) + at(self.right, L)


# Displacement (1)-(2) -------------------------------------------------------------------------------------------


@numbered(1, "displacement", "definition")
def displacement() -> Eq:
    """The manipulator rides on the base: what an observer at rest sees is the base's motion plus the elastic part."""
    return Eq(y, w + v)


@checks(1)
def _() -> bool:
    """Both sides are lengths; an arm that does not deform moves as its base, a base at rest leaves the deformation."""
    seen = displacement().rhs
    return dimension(displacement()) == Dimension(m=1) and (seen.subs(v, 0), seen.subs(w, 0)) == (w, v)


@numbered(2, "separation of variables", "assumption")
def separation() -> Eq:
    """The elastic displacement is a sum of shapes, each scaled by a coordinate of its own."""
    return Eq(v, ModalSum(phi_i * q_i))


@checks(2)
def _() -> bool:
    """Both sides are lengths; one term is separable, v v_xt = v_x v_t, and a sum of two is not."""
    one, two = separation().rhs.members("i"), separation().rhs.members("i", "j")

    def coupling(shape: Expr) -> Expr:
        return (shape * shape.diff(x, t) - shape.diff(x) * shape.diff(t)).expand()

    return dimension(separation()) == Dimension(m=1) and coupling(one) == 0 and coupling(two) != 0


def single_mode(expression: Expr, shape: Expr = phi_i * q_i) -> Expr:
    """Return ``expression`` with the elastic displacement v replaced by ``shape``, at the ends too."""
    return put(expression, {v: shape})


# Energies (3)-(4) -----------------------------------------------------------------------------------------------


def _kinetic() -> ArmLagrangian:
    speed = displacement().rhs.diff(t)
    base = HALF * m_b * w.diff(t) ** 2
    tip = HALF * m_e * speed**2 + HALF * J_e * v.diff(x, t) ** 2
    return ArmLagrangian(HALF * rho * A * speed**2, base, tip)


def _potential(joint: bool) -> ArmLagrangian:
    springs = HALF * k_t * v**2 + HALF * k_r * v.diff(x) ** 2
    return ArmLagrangian(HALF * E * I_z * v.diff(x, 2) ** 2, springs if joint else springs * 0, springs * 0)


@numbered(3, "kinetic energy", "definition", (1,))
def kinetic_energy() -> Eq:
    """Base, end-effector (with the rotary inertia J_e, which the paper leaves out) and manipulator."""
    return Eq(symbol("T"), _kinetic().total())


@checks(3)
def _() -> bool:
    """An energy; an arm that does not deform has the kinetic energy of one mass, one that turns rigidly about a root at
    rest that of its moment of inertia."""
    moved = single_mode(kinetic_energy().rhs, x * 0).doit()
    turned = single_mode(kinetic_energy().rhs, x * q_i).subs(w, 0).doit()
    mass = m_b + m_e + rho * A * L
    inertia = rho * A * L**3 / 3 + m_e * L**2 + J_e
    return (
        dimension(kinetic_energy()) == ENERGY
        and (moved - mass * w.diff(t) ** 2 / 2).expand() == 0
        and (turned - inertia * q_i.diff(t) ** 2 / 2).expand() == 0
    )


@numbered(4, "potential energy", "definition")
def potential_energy() -> tuple[Eq, Eq]:
    """First what the paper's words name, the bent manipulator alone; then with the two springs of the joint, without
    which the generalised stiffness (6) would contradict the natural frequency (30)."""
    return Eq(symbol("U_b"), _potential(False).total()), Eq(symbol("U"), _potential(True).total())


@checks(4)
def _() -> bool:
    """Energies; a straight arm stores energy in the joint alone, and a clamped one makes both forms equal."""
    beam, full = (equation.rhs for equation in potential_energy())
    give, turn = symbol("C_1") * L, symbol("C_2")
    straight = [single_mode(energy, give + turn * x).doit() for energy in (beam, full)]
    clamped = [single_mode(energy, x**2 / L).doit() for energy in (beam, full)]
    springs = (k_t * give**2 + k_r * turn**2) / 2
    return (
        all(dimension(equation) == ENERGY for equation in potential_energy())
        and straight[0] == 0
        and (straight[1] - springs).expand() == 0
        and clamped[0] == clamped[1] != 0
    )


# Modal masses and stiffnesses (6) ------------------------------------------------------------------------------


def inner_mass(first: Expr, second: Expr) -> Expr:
    """Inner product of two shapes with the masses of manipulator and end-effector."""
    tip = m_e * first * second + J_e * first.diff(x) * second.diff(x)
    return Integral(rho * A * first * second, (x, 0, L)) + at(tip, L)


def inner_stiffness(first: Expr, second: Expr, joint: bool = True) -> Expr:
    """Inner product of two shapes with the stiffness of manipulator and, unless switched off, joint."""
    root = k_t * first * second + k_r * first.diff(x) * second.diff(x)
    return Integral(E * I_z * first.diff(x, 2) * second.diff(x, 2), (x, 0, L)) + (at(root, 0) if joint else 0)


@numbered(6, "generalised mass, stiffness, participation", "definition", (2,))
def generalised() -> tuple[Eq, Eq, Eq]:
    """Mass and stiffness of a mode, and how strongly the base's acceleration drives it."""
    return (
        Eq(symbol("M_i"), inner_mass(phi_i, phi_i)),
        Eq(symbol("K_i"), inner_stiffness(phi_i, phi_i)),
        Eq(symbol("Gamma_i"), Integral(rho * A * phi_i, (x, 0, L)) + at(m_e * phi_i, L)),
    )


@checks(6)
def _() -> bool:
    """Dimensions; a shape that translates has the arm's mass, twice, and the translational spring; one that turns about
    the root has the moment of inertia, the static moment and the rotational spring."""
    mass, static, inertia = (rho * A * L**n / n + m_e * L ** (n - 1) for n in (1, 2, 3))
    moved = (mass, k_t, mass)
    turned = (inertia + J_e, k_r, static)
    return [dimension(e) for e in generalised()] == [Dimension(kg=1), Dimension(kg=1, s=-2), Dimension(kg=1)] and all(
        (put(e.rhs, {phi_i: shape}).doit() - known).expand() == 0
        for shape, values in ((x**0, moved), (x, turned))
        for e, known in zip(generalised(), values, strict=True)
    )


def tidy(value: Expr) -> Expr:
    """Return the integrals of ``value`` with one common integrand shape: expanded, constants inside."""
    return value.expand().replace(lambda e: isinstance(e, Integral), lambda e: Integral(e.function.expand(), *e.limits))


def modal_numbers(values: dict[str, float], shape: Any) -> dict[Expr, float]:
    """Return M_i, K_i and Gamma_i of a mode found by shooting: (6) by quadrature."""
    return {e.lhs: evaluate(e.rhs, values, {phi_i: shape}) for e in generalised()}


# Lagrangian (7) -------------------------------------------------------------------------------------------------


@cache
def lagrangian(*, joint: bool = True) -> ArmLagrangian:
    """Return T - U of (3) and (4) as density, root terms and tip terms; ``joint=False`` leaves the springs out."""
    return ArmLagrangian(*(T - U for T, U in zip(_kinetic(), _potential(joint), strict=True)))


@numbered(7, "Lagrangian", "definition", (3, 4))
def lagrangian_function() -> Eq:
    """Kinetic minus potential energy, the springs of the joint included."""
    return Eq(symbol("Lcal"), lagrangian().total())


@checks(7)
def _() -> bool:
    """An energy; equal to the difference of (3) and (4) on a shape that moves and bends everywhere."""
    shape = (x**3 / L**2 + x + L) * symbol("psi") * t / symbol("T_0")
    whole, T, U = (
        single_mode(e.rhs, shape).doit().expand()
        for e in (lagrangian_function(), kinetic_energy(), potential_energy()[1])
    )
    return dimension(lagrangian_function()) == ENERGY and (whole - T + U).expand() == 0 and U != 0 != T
