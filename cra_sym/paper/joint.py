"""The elastic joint by the principle of virtual work: equations (14)-(16), a route that does not use Hamilton's."""

from __future__ import annotations

from sympy import Eq, Expr, Integral, Rational, S

from cra_sym.paper.energy import (
    E,
    I_z,
    J_e,
    L,
    displacement,
    generalised,
    k_r,
    k_t,
    m_e,
    phi_i,
    q_i,
    single_mode,
    t,
    v,
    w,
    x,
)
from cra_sym.paper.equations import Proof, numbered, proves, samples
from cra_sym.paper.evaluation import at, evaluate, put, virtual_factors
from cra_sym.paper.oracles.shooting import sample, shoot
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


@proves(14)
def _() -> Proof:
    """With (15): for any motion and any virtual displacement, the virtual work of the whole arm is the work (14) at the
    two ends plus that of the field equation along the manipulator."""
    acceleration, bending = w.diff(t, 2) + v.diff(t, 2), E * I_z
    inertia = rho * A * acceleration
    at_root = k_t * v * eta + k_r * v.diff(x) * eta.diff(x)
    at_tip = m_e * acceleration * eta + J_e * v.diff(x, t, t) * eta.diff(x)
    density = bending * v.diff(x, 2) * eta.diff(x, 2) + inertia * eta
    whole = -Integral(density, (x, 0, L)) - at(at_root, 0) - at(at_tip, L)
    ends = sum((_with_section_forces(e.lhs - e.rhs) for e in virtual_work()), S.Zero)
    along = -Integral((bending * v.diff(x, 4) + inertia) * eta, (x, 0, L))
    yield all(dimension(e) == dimension("U") for e in virtual_work())
    for one, other in zip(virtual_factors(whole, eta), virtual_factors(ends + along, eta), strict=True):
        yield one - other


@proves(15)
def _() -> Proof:
    """Dimensions; an arc of radius R carries the moment E I / R and no shear; a tip load F gives the shear -F
    everywhere, no moment at the tip and the textbook deflection F L^3 / (3 E I)."""
    radius, load = symbol("h"), symbol("C_1")
    shear, moment = (law.rhs for law in section_forces())
    arc, cantilever = x**2 / (2 * radius), load * x**2 * (3 * L - x) / (6 * E * I_z)
    yield [dimension(law) for law in section_forces()] == [Dimension(1, 1, -2), Dimension(2, 1, -2)]
    yield single_mode(shear, arc)
    yield single_mode(moment, arc) - E * I_z / radius
    yield single_mode(shear, cantilever) + load
    yield at(single_mode(moment, cantilever), L)
    yield at(cantilever, L) - Rational(1, 3) * load * L**3 / (E * I_z)


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


def rayleigh_factors() -> tuple[Expr, ...]:
    """Return what a virtual change of a mode's shape is multiplied by in that of (K_i - omega_i^2 M_i) / 2, by (6).

    Along the manipulator, displacement and slope at the root, displacement and slope at the tip.
    """
    size = symbol("epsilon")
    M, K, _ = (e.rhs for e in generalised())
    varied = put(K - omega_i**2 * M, {phi_i: phi_i + size * eta}).diff(size).subs(size, 0)
    return virtual_factors(varied.doit(integrals=False) / 2, eta)


@proves("16a")
def _() -> Proof:
    """Rayleigh: among all shapes, that of a mode makes K_i - ω_i² M_i of (6) stationary, so these are its natural
    conditions."""
    _, *factors = rayleigh_factors()
    for e, factor, sign in zip(mode_conditions(), factors, (1, -1, -1, 1), strict=True):
        yield e.lhs - e.rhs - sign * factor


@samples("16a")
def _() -> bool:
    """The end values of a mode of a random arm, found by shooting, satisfy all four."""
    values = sample(16)
    for mode in shoot(values):
        for e in mode_conditions():
            gap = evaluate(e.lhs - e.rhs, values | {"omega_i": mode.omega}, {phi_i: mode})
            if abs(gap) > 1e-8 * abs(values["E"] * values["I_z"] * mode(values["L"], 4)):
                return False
    return True
