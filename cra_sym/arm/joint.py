"""The elastic joint by the principle of virtual work: equations (14)-(16), a route that does not use Hamilton's."""

from __future__ import annotations

import random

from sympy import Eq, Expr, Integral, Rational, S

from cra_sym.arm.energy import E, I_z, J_e, L, displacement, k_r, k_t, m_e, phi_i, q_i, single_mode, t, v, w, x
from cra_sym.arm.equations import checks, numbered
from cra_sym.arm.evaluation import at, evaluate, integrate_polynomials, put
from cra_sym.arm.shooting import sample, shoot
from cra_sym.symbols import Dimension, dimension, symbol

__all__ = ["boundary_conditions", "mode_conditions"]

eta, Q, M_z, rho, A, omega_i = (symbol(name) for name in ("eta", "Q", "M_z", "rho", "A", "omega_i"))


def _work() -> tuple[Expr, Expr]:
    """Virtual work at root and tip, not yet evaluated there."""
    tip_force = m_e * displacement().rhs.diff(t, 2)
    tip_moment = J_e * v.diff(x, t, t)
    root = -(Q + k_t * v) * eta + (M_z - k_r * v.diff(x)) * eta.diff(x)
    tip = (Q - tip_force) * eta - (M_z + tip_moment) * eta.diff(x)
    return root, tip


@numbered(14, "virtual work at the ends", "assumption", (1,))
def virtual_work() -> tuple[Eq, Eq]:
    """At the joint the manipulator's shear force and moment work against the two springs, at the tip against the
    inertia of the end-effector; for any virtual displacement the sum is zero."""
    root, tip = _work()
    return Eq(at(root, 0), 0), Eq(at(tip, L), 0)


@numbered(15, "shear force and bending moment", "assumption")
def section_forces() -> tuple[Eq, Eq]:
    """Small deflections of a Bernoulli-Euler beam: moment is curvature times bending stiffness, shear its slope."""
    moment = E * I_z * v.diff(x, 2)
    return Eq(Q, moment.diff(x)), Eq(M_z, moment)


def _with_section_forces(expression: Expr) -> Expr:
    """Put (15) into an expression in Q and M_z."""
    return put(expression, {law.lhs: law.rhs for law in section_forces()})


@checks(14, "sampled")
def _() -> bool:
    """With (15): the virtual work of the whole arm, for random polynomial motions, is the work (14) at the two ends
    plus that of the field equation along the manipulator."""
    rng = random.Random(14)

    def polynomial(variable: Expr, degree: int) -> Expr:
        return sum((rng.randint(-5, 5) * variable**k for k in range(degree)), S(rng.randint(1, 5)) * variable**degree)

    motion, base, virtual = polynomial(x, 5) * polynomial(t, 2), polynomial(t, 3), polynomial(x, 4)
    acceleration, bending = base.diff(t, 2) + motion.diff(t, 2), E * I_z
    inertia = rho * A * acceleration
    at_root = k_t * motion * virtual + k_r * motion.diff(x) * virtual.diff(x)
    at_tip = m_e * acceleration * virtual + J_e * motion.diff(x, t, t) * virtual.diff(x)
    density = bending * motion.diff(x, 2) * virtual.diff(x, 2) + inertia * virtual
    whole = -Integral(density, (x, 0, L)) - at(at_root, 0) - at(at_tip, L)
    ends = sum((_with_section_forces(e.lhs) for e in virtual_work()), S.Zero)
    ends = put(ends, {v: motion, eta: virtual, w: base})
    along = -Integral((bending * motion.diff(x, 4) + inertia) * virtual, (x, 0, L))
    energies = all(dimension(e) == dimension("U") for e in virtual_work())
    return energies and integrate_polynomials(whole - ends - along).expand() == 0


@checks(15)
def _() -> bool:
    """Dimensions; an arc of radius R carries the moment E I / R and no shear; a tip load F gives the shear -F
    everywhere, no moment at the tip and the textbook deflection F L^3 / (3 E I)."""
    radius, load = symbol("h"), symbol("C_1")
    shear, moment = (law.rhs for law in section_forces())
    arc, cantilever = x**2 / (2 * radius), load * x**2 * (3 * L - x) / (6 * E * I_z)
    return (
        [dimension(law) for law in section_forces()] == [Dimension(1, 1, -2), Dimension(2, 1, -2)]
        and (single_mode(shear, arc), single_mode(moment, arc)) == (0, E * I_z / radius)
        and single_mode(shear, cantilever).expand() == -load
        and at(single_mode(moment, cantilever), L).expand() == 0
        and at(cantilever, L) == Rational(1, 3) * load * L**3 / (E * I_z)
    )


@numbered(16, "boundary conditions", "derived", (14, 15))
def boundary_conditions() -> tuple[Eq, Eq, Eq, Eq]:
    """(15) in (14): the virtual displacement and the virtual slope at each end are arbitrary, so each one's factor
    vanishes on its own. Root force, root moment, tip force, tip moment."""
    root, tip = _work()

    def factor(work: Expr, choice: Expr, place: Expr) -> Expr:
        return at(_with_section_forces(put(work, {eta: choice})), place)

    return (
        _solved(factor(root, S.One, S.Zero), at(v.diff(x, 3), 0)),
        _solved(factor(root, x, S.Zero), at(v.diff(x, 2), 0)),
        _solved(factor(tip, S.One, L), at(v.diff(x, 3), L)),
        _solved(factor(tip, x - L, L), at(v.diff(x, 2), L)),
    )


def _solved(condition: Expr, derivative: Expr) -> Eq:
    """Write a condition linear in an end value as ``E I end value = rest``."""
    condition = condition.expand()
    sign = condition.coeff(derivative) / (E * I_z)
    return Eq(E * I_z * derivative, (-(condition - sign * E * I_z * derivative) / sign).expand())


@numbered("16a", "boundary conditions of a mode", "derived", (2, 16))
def mode_conditions() -> tuple[Eq, Eq, Eq, Eq]:
    """(2) in (16), the base at rest: in free vibration each coordinate obeys q'' = -ω² q and cancels."""
    return tuple(in_one_mode(e) for e in boundary_conditions())


def in_one_mode(equation: Eq) -> Eq:
    """Return an equation in v for one freely vibrating mode: an equation in phi_i."""
    left, right = (single_mode(side.subs(w, 0).doit()) for side in equation.args)
    return Eq(free_vibration(left), free_vibration(right), evaluate=False)


def free_vibration(expression: Expr) -> Expr:
    """Return the factor of q_i in an expression linear in q_i, with q_i'' = -omega_i^2 q_i."""
    return (expression.subs(q_i.diff(t, 2), -(omega_i**2) * q_i) / q_i).expand()


@checks("16a", "sampled")
def _() -> bool:
    """Numbers: the end values of a mode of a random arm, found by shooting, satisfy all four."""
    values = sample(16)
    for mode in shoot(values):
        for e in mode_conditions():
            gap = evaluate(e.lhs - e.rhs, values | {"omega_i": mode.omega}, {phi_i: mode})
            if abs(gap) > 1e-8 * abs(values["E"] * values["I_z"] * mode(values["L"], 4)):
                return False
    return True
