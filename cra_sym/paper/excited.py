"""Excitation by the disturbed base: equations (35) and (36).

(35) does not lead to a parametric system: in linear theory a base that moves across the arm only forces it. Equations
numbered with a letter give two parametric excitations: the same disturbance along the arm, and a fluctuating joint.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from sympy import Eq, Expr, Integral, S, cos, sin

from cra_sym.arm.lagrangian import paper_lagrangian
from cra_sym.paper.energy import L, phi_i, phi_j, potential, single_mode, t, w, x
from cra_sym.paper.equations import Derivation, Proof, derived, numbered, proves, samples
from cra_sym.paper.evaluation import at, evaluate, termwise, virtual_factors
from cra_sym.paper.modal_dynamics import dynamic_equation
from cra_sym.paper.oracles import forces
from cra_sym.paper.oracles.shooting import integrate, sample, shoot
from cra_sym.paper.parametric import AXIAL, TRANSVERSE, coupling, excited_lagrangian
from cra_sym.symbols import Dimension, dimension, symbol

__all__: list[str] = []

epsilon, varpi, P_ij, w_0, w_1, u, u_0 = (symbol(n) for n in "epsilon varpi P_ij w_0 w_1 u u_0".split())


@numbered(35, "disturbed base", "assumption")
def disturbed_base() -> Eq:
    """A small harmonic motion of the base about a constant mean, transverse to the arm."""
    return Eq(w, TRANSVERSE)


@proves(35)
def prove_disturbed_base() -> Proof:
    """It is a length; it starts at w_0 with the velocity epsilon w_1 varpi and oscillates about w_0 with angular
    frequency varpi."""
    motion = disturbed_base().rhs
    yield dimension(disturbed_base()) == Dimension(m=1)
    yield motion.subs(t, 0) - w_0
    yield motion.diff(t).subs(t, 0) - epsilon * w_1 * varpi
    yield motion.diff(t, 2) + varpi**2 * (motion - w_0)


@numbered("35a", "base disturbed along the arm", "assumption")
def axial_base() -> Eq:
    """The same disturbance in the direction of the manipulator."""
    return Eq(u, AXIAL)


@proves("35a")
def prove_axial_base() -> Proof:
    """It is a length; it starts at rest from epsilon u_0 and oscillates about zero with angular frequency varpi."""
    motion = axial_base().rhs
    yield dimension(axial_base()) == Dimension(m=1)
    yield motion.subs(t, 0) - epsilon * u_0
    yield motion.diff(t).subs(t, 0)
    yield motion.diff(t, 2) + varpi**2 * motion


@numbered("35b", "fluctuating joint", "assumption", (4,))
def fluctuating_joint() -> Eq:
    """The energy of a joint whose preload, and with it both stiffnesses, fluctuates."""
    return Eq(symbol("U"), -at(excited_lagrangian("joint stiffness").left, 0))


@proves("35b")
def prove_fluctuating_joint() -> Proof:
    """It is an energy: that of the springs of (4), which oscillates about its mean with relative amplitude epsilon and
    angular frequency varpi."""
    beam, full = (e.rhs for e in potential())
    yield dimension(fluctuating_joint()) == dimension("U")
    yield fluctuating_joint().rhs - (full - beam) * (1 + epsilon * cos(varpi * t))


@derived(36, "excited system", (11, 35))
def excited_system() -> Derivation[Eq]:
    """(35) substituted in (11). The disturbance appears on the right-hand side only: no coefficient of the unknown
    depends on time, so this is a forced system and not, as the paper says, a parametric one."""
    acceleration = Eq(w.diff(t, 2), TRANSVERSE.diff(t, 2))
    yield "acceleration of the base", "(35) differentiated twice.", acceleration
    return dynamic_equation().subs(w, TRANSVERSE).doit()


@proves(36)
def prove_excited_system() -> Proof:
    """The left-hand side of (11), whose coefficients do not depend on time, and on the right-hand side -Gamma_i times
    the acceleration of (35)."""
    equation, q = excited_system(), symbol("q_i")
    yield not any(equation.lhs.diff(q.diff(t, k) if k else q).has(t) for k in range(3))
    yield equation.lhs - dynamic_equation().lhs
    yield equation.rhs - symbol("Gamma_i") * epsilon * w_1 * varpi**2 * sin(varpi * t)


@samples(36)
def sample_excited_system() -> bool:
    """The work of the inertia forces of a random arm moving rigidly with the base, on modes computed by shooting."""
    values, equation = sample(36), excited_system()
    length, instant = values["L"], {t: 0.37, varpi: 2.1, w_1: 0.6, epsilon: 0.01}
    acceleration = float(disturbed_base().rhs.diff(t, 2).subs(instant))
    for mode in shoot(values):
        gamma = values["rho"] * values["A"] * integrate(mode, length) + values["m_e"] * mode(length)
        force = equation.rhs.subs(symbol("Gamma_i"), gamma).subs(instant)
        if abs(float(force) + gamma * acceleration) > 1e-9 * abs(gamma):
            return False
    return True


@derived("36a", "coupling by the fluctuating joint", ("35b", 7))
def joint_coupling() -> Derivation[Eq]:
    """Two modes, of unit generalised mass, in the terms of the Lagrangian with epsilon cos(varpi t). The modal
    stiffness varies in time: the excitation is parametric."""
    yield (
        "joint that fluctuates",
        "The terms of the Lagrangian at the joint.",
        excited_lagrangian("joint stiffness").left,
    )
    yield "two modes", "Put in at the joint.", _two_modes(excited_lagrangian("joint stiffness").left)
    return Eq(P_ij, coupling("joint stiffness"), evaluate=False)


@derived("36b", "coupling by the base disturbed along the arm", ("35a", 7))
def axial_coupling() -> Derivation[Eq]:
    """Bending shortens the manipulator, and the axial inertia force does work on this foreshortening. It grows with
    varpi^2."""
    still, moving = paper_lagrangian().density.subs(w, 0).doit(), excited_lagrangian("axial base").density
    load = Integral((moving - still).subs(u, AXIAL).doit(), (x, 0, L))
    yield "foreshortening", "The terms that the axial acceleration adds to the Lagrangian.", load
    yield "two modes", "Put in.", _two_modes(load)
    return Eq(P_ij, coupling("axial base"), evaluate=False)


def _two_modes(lagrangian: Expr) -> Expr:
    """Return a part of the Lagrangian with two modes substituted."""
    return single_mode(lagrangian, phi_i * symbol("q_i") + phi_j * symbol("q_j")).doit(integrals=False)


@proves("36a")
def prove_joint_coupling() -> Proof:
    """The energy (35b) of two modes, differentiated by both coordinates and by the fluctuation; the work of the extra
    spring forces of one on the other, written by hand."""
    q_i, q_j, swing = symbol("q_i"), symbol("q_j"), epsilon * cos(varpi * t)
    energy = single_mode(fluctuating_joint().rhs, phi_i * q_i + phi_j * q_j)
    yield energy.diff(q_i).diff(q_j).diff(epsilon) * epsilon / swing - joint_coupling().rhs
    yield joint_coupling().rhs - forces.spring_product(phi_i, phi_j)
    yield joint_coupling().lhs == P_ij


@samples("36a")
def sample_joint_coupling() -> bool:
    """The work of the two additional spring forces of a mode on another; modes computed by shooting."""
    values = sample(361)
    first, second = shoot(values)[:2]
    work = values["k_t"] * first(0.0) * second(0.0) + values["k_r"] * first(0.0, 1) * second(0.0, 1)
    found = evaluate(joint_coupling().rhs, values, {phi_i: first, phi_j: second})
    return bool(abs(found / work - 1) < 1e-10)


@proves("36b")
def prove_axial_coupling() -> Proof:
    """The axial momentum of a bent arm: the foreshortening of every point, whose derivative is the product of the
    slopes of the two modes, is integrated from the joint, with the masses of manipulator and end-effector."""
    shortening = symbol("eta")
    momentum = forces.mass_product(shortening, S.One)
    found = axial_coupling().rhs / (u_0 * varpi**2)
    found = found.xreplace({phi_i.diff(x): shortening.diff(x) / phi_j.diff(x)})
    along, _, *others = virtual_factors(termwise(found) - momentum, shortening)
    yield axial_coupling().lhs == P_ij
    yield along
    yield from others


@samples("36b")
def sample_axial_coupling() -> bool:
    """The axial momentum of a bent arm, with the foreshortening of every point by its own quadrature from
    the joint on, its second derivative by two modes computed by shooting."""
    values = sample(362)
    first, second = shoot(values)[:2]
    length, line_mass = values["L"], values["rho"] * values["A"]

    def shortening(place: Any, a: float, b: float) -> Any:
        shares = [integrate(lambda p: (a * first(p, 1) + b * second(p, 1)) ** 2 / 2, end) for end in np.ravel(place)]
        return np.reshape(shares, np.shape(place))

    def moment(a: float, b: float) -> float:
        line = integrate(lambda p: line_mass * shortening(p, a, b), length)
        return line + values["m_e"] * float(shortening(length, a, b))

    mixed = (moment(1, 1) - moment(1, -1) - moment(-1, 1) + moment(-1, -1)) / 4
    numbers = values | {"u_0": 0.3, "varpi": 1.7}
    found = evaluate(axial_coupling().rhs, numbers, {phi_i: first, phi_j: second})
    return bool(abs(found / (0.3 * 1.7**2 * mixed) - 1) < 1e-9)
