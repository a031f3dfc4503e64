"""The elastic joint by the principle of virtual work: equations (14)-(16).

The virtual work at the ends is derived from the Lagrangian and compared with the same work written by hand.
"""

from __future__ import annotations

from sympy import Eq, Expr, Integral, Rational, S

from cra_sym.arm.lagrangian import paper_lagrangian, potential_energy
from cra_sym.mechanics.jets import End, JetSpace
from cra_sym.mechanics.variation import lagrange_forces
from cra_sym.paper.energy import E, I_z, L, phi_i, q_i, single_mode, t, v, w, x
from cra_sym.paper.equations import Derivation, Proof, derived, proves, samples
from cra_sym.paper.evaluation import at, evaluate, put, virtual_factors
from cra_sym.paper.oracles import forces
from cra_sym.paper.oracles.shooting import sample, shoot
from cra_sym.symbols import Dimension, dimension, symbol

__all__ = ["boundary_conditions", "end_values", "mode_conditions", "section_forces"]

eta, Q, M_z, omega_i = (symbol(name) for name in ("eta", "Q", "M_z", "omega_i"))


@derived(14, "virtual work at the ends", (7,))
def virtual_work() -> Derivation[tuple[Eq, Eq]]:
    """The shear force and bending moment of the manipulator do work against the two springs at the joint and against
    the inertia of the end-effector at the tip; for any virtual displacement the sum is zero."""
    _, root, tip = paper_lagrangian()
    yield "what works at the ends", "The Lagrangian's terms at joint and tip.", (at(root, 0), at(tip, L))
    works = _work(root, "left"), _work(tip, "right")
    yield (
        "work of the springs and of the end-effector",
        "Generalised forces times virtual displacement and virtual slope.",
        works,
    )
    section = Q * eta - M_z * eta.diff(x)
    yield "work of the section", "Shear force and bending moment of the manipulator at the cut sections.", section
    return Eq(works[0] - at(section, 0), 0), Eq(works[1] + at(section, L), 0)


def _work(lagrangian: Expr, end: End) -> Expr:
    """Return the virtual work of the forces that follow from the Lagrangian of an end."""
    space = JetSpace([v], [], x, t, (S.Zero, L), [w])
    work = lagrange_forces(space, space.read(lagrangian, end, f"{end} end"))
    return sum(
        (space.restore(force) * at(eta.diff(x, jet.space), space.ends[end]) for jet, force in work.items()), S.Zero
    )


@derived(15, "shear force and bending moment", (4,))
def section_forces() -> Derivation[tuple[Eq, Eq]]:
    """Small deflections of an Euler-Bernoulli beam: the moment is the curvature times the bending stiffness, the shear
    force its derivative."""
    strain = potential_energy(joint=False).density
    yield "strain energy", "Per length of the manipulator, (4).", strain
    moment = strain.diff(v.diff(x, 2))
    return Eq(Q, moment.diff(x) - strain.diff(v.diff(x))), Eq(M_z, moment)


def _with_section_forces(expression: Expr) -> Expr:
    """Substitute (15) in an expression in Q and M_z."""
    return put(expression, {law.lhs: law.rhs for law in section_forces()})


@proves(14)
def prove_virtual_work() -> Proof:
    """With (15): for any motion and any virtual displacement, the virtual work of the whole arm, written by hand,
    is the work (14) at the two ends plus that of Newton's force on every slice of the manipulator."""
    ends = sum((_with_section_forces(e.lhs - e.rhs) for e in virtual_work()), S.Zero)
    along = Integral(forces.newton()[0] * eta, (x, 0, L))
    yield all(dimension(e) == dimension("U") for e in virtual_work())
    for one, other in zip(
        virtual_factors(forces.virtual_work(eta), eta), virtual_factors(ends + along, eta), strict=True
    ):
        yield one - other


@proves(15)
def prove_section_forces() -> Proof:
    """Dimensions; an arc of radius R has the moment E I / R and no shear force; a tip load F gives the constant shear
    force -F, no moment at the tip and the textbook deflection F L^3 / (3 E I)."""
    radius, load = symbol("h"), symbol("C_1")
    shear, moment = (law.rhs for law in section_forces())
    arc, cantilever = x**2 / (2 * radius), load * x**2 * (3 * L - x) / (6 * E * I_z)
    yield [dimension(law) for law in section_forces()] == [Dimension(1, 1, -2), Dimension(2, 1, -2)]
    yield single_mode(shear, arc)
    yield single_mode(moment, arc) - E * I_z / radius
    yield single_mode(shear, cantilever) + load
    yield at(single_mode(moment, cantilever), L)
    yield at(cantilever, L) - Rational(1, 3) * load * L**3 / (E * I_z)


@derived(16, "boundary conditions", (14, 15))
def boundary_conditions() -> Derivation[tuple[Eq, ...]]:
    """(15) substituted in (14): the virtual displacement and the virtual slope at each end are arbitrary, so the factor
    of each vanishes. Root force, root moment, tip force, tip moment."""
    shear, moment = (law.rhs for law in section_forces())
    works = ((virtual_work()[0].lhs, S.Zero), (virtual_work()[1].lhs, L))
    put_in = tuple(Eq(_with_section_forces(work), 0) for work, _ in works)
    yield "forces of the section put in", "(15) in the virtual work at joint and tip.", put_in
    chosen = [
        (_with_section_forces(put(work, {eta: choice})), at(force, place), value)
        for (work, place), values in zip(works, (end_values(v)[:2], end_values(v)[2:]), strict=True)
        for choice, force, value in zip((S.One, x - place), (shear, moment), values, strict=True)
    ]
    yield (
        "unit virtual displacement and rotation",
        "A unit virtual displacement gives the force, a unit virtual rotation about the end gives the moment.",
        tuple(Eq(balance.expand(), 0) for balance, _, _ in chosen),
    )
    return tuple(_solved(*balance) for balance in chosen)


def end_values(shape: Expr) -> tuple[Expr, ...]:
    """Return the quantities that the four conditions of (16) determine: v_xxx and v_xx at the root, then at the tip."""
    return tuple(at(shape.diff(x, order), place) for place in (S.Zero, L) for order in (3, 2))


def _solved(condition: Expr, force: Expr, value: Expr) -> Eq:
    """Write a condition linear in a section force as ``force = rest``; ``value`` is the derivative that the force
    contains."""
    condition = condition.expand()
    sign = condition.coeff(value) / force.coeff(value)
    return Eq(force, ((sign * force - condition) / sign).expand())


@derived("16a", "boundary conditions of a mode", (2, 16))
def mode_conditions() -> Derivation[tuple[Eq, ...]]:
    """(2) substituted in (16) with the base at rest: in free vibration each coordinate satisfies q'' = -ω² q and
    cancels."""
    one = tuple(Eq(*(single_mode(side.subs(w, 0).doit()) for side in e.args)) for e in boundary_conditions())
    yield "one mode, base at rest", "One term of (2) in (16).", one
    return tuple(in_one_mode(e) for e in boundary_conditions())


def in_one_mode(equation: Eq) -> Eq:
    """Return the equation in phi_i that follows from an equation in v for one mode in free vibration."""
    left, right = (single_mode(side.subs(w, 0).doit()) for side in equation.args)
    return Eq(free_vibration(left), free_vibration(right), evaluate=False)


def free_vibration(expression: Expr) -> Expr:
    """Return the factor of q_i in an expression linear in q_i, with q_i'' = -omega_i^2 q_i."""
    return (expression.subs(q_i.diff(t, 2), -(omega_i**2) * q_i) / q_i).expand()


def rayleigh_factors() -> tuple[Expr, ...]:
    """Return the factors of a virtual change of the mode shape in the variation of (K_i - omega_i^2 M_i) / 2, by hand.

    Along the manipulator, displacement and slope at the root, displacement and slope at the tip.
    """
    size = symbol("epsilon")
    varied = phi_i + size * eta
    energy = forces.stiffness_product(varied, varied) - omega_i**2 * forces.mass_product(varied, varied)
    return virtual_factors(energy.diff(size).subs(size, 0).doit(integrals=False) / 2, eta)


@proves("16a")
def prove_mode_conditions() -> Proof:
    """Rayleigh's principle: the shape of a mode makes K_i - ω_i² M_i, written by hand, stationary; these are its
    natural boundary conditions."""
    _, *factors = rayleigh_factors()
    for e, factor, sign in zip(mode_conditions(), factors, (1, -1, -1, 1), strict=True):
        yield e.lhs - e.rhs - sign * factor


@samples("16a")
def sample_mode_conditions() -> bool:
    """The end values of a mode of a random arm, computed by shooting, satisfy all four."""
    values = sample(16)
    for mode in shoot(values):
        for e in mode_conditions():
            gap = evaluate(e.lhs - e.rhs, values | {"omega_i": mode.omega}, {phi_i: mode})
            if abs(gap) > 1e-8 * abs(values["E"] * values["I_z"] * mode(values["L"], 4)):
                return False
    return True
