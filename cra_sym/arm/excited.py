"""The disturbed base and what it excites: equations (35) and (36).

What (35) leads to is no parametric system: in linear theory a base that moves across the arm only forces it. Numbers
with a letter supply two excitations that are parametric: the same disturbance along the arm, and a fluctuating joint.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from sympy import Eq

from cra_sym.arm.energy import lagrangian
from cra_sym.arm.equations import checks, numbered
from cra_sym.arm.evaluation import at, evaluate
from cra_sym.arm.modal_dynamics import dynamic_equation
from cra_sym.arm.parametric import AXIAL, TRANSVERSE, coupling, excited_lagrangian, phi_i, phi_j, t, u, w
from cra_sym.arm.shooting import integrate, sample, shoot
from cra_sym.symbols import Dimension, dimension, symbol

__all__: list[str] = []

epsilon, varpi, P_ij, w_0, w_1, u_0 = (symbol(n) for n in ("epsilon", "varpi", "P_ij", "w_0", "w_1", "u_0"))


@numbered(35, "disturbed base", "assumption")
def disturbed_base() -> Eq:
    """A small harmonic motion of the driving base about a constant mean, across the arm."""
    return Eq(w, TRANSVERSE)


@checks(35)
def _() -> bool:
    """A length; it starts at w_0 with the speed epsilon w_1 varpi and swings about w_0 with angular frequency varpi."""
    motion = disturbed_base().rhs
    start = (motion.subs(t, 0), motion.diff(t).subs(t, 0)) == (w_0, epsilon * w_1 * varpi)
    swings = (motion.diff(t, 2) + varpi**2 * (motion - w_0)).expand() == 0
    return dimension(disturbed_base()) == Dimension(m=1) and start and swings


@numbered("35a", "base disturbed along the arm", "assumption")
def axial_base() -> Eq:
    """The same disturbance in the direction of the manipulator."""
    return Eq(u, AXIAL)


@checks("35a")
def _() -> bool:
    """A length; it starts at rest, epsilon u_0 away, and swings about zero with angular frequency varpi."""
    motion = axial_base().rhs
    start = (motion.subs(t, 0), motion.diff(t).subs(t, 0)) == (epsilon * u_0, 0)
    return dimension(axial_base()) == Dimension(m=1) and start and motion.diff(t, 2) == -(varpi**2) * motion


@numbered("35b", "fluctuating joint", "assumption", (4,))
def fluctuating_joint() -> Eq:
    """The preload of the bolts fluctuates, and both stiffnesses of the joint with it: the energy of the joint."""
    return Eq(symbol("U"), -at(excited_lagrangian("joint stiffness").left, 0))


@checks("35b")
def _() -> bool:
    """An energy; without epsilon the springs of (4)."""
    same = fluctuating_joint().rhs.subs(epsilon, 0) + at(lagrangian().left.subs(w, 0).doit(), 0)
    return dimension(fluctuating_joint()) == dimension("U") and same.expand() == 0


@numbered(36, "excited system", "derived", (11, 35))
def excited_system() -> Eq:
    """(35) in (11). The disturbance stands on the right only: no coefficient of the unknown depends on time, so this
    is a forced system and not, as the paper says, a parametric one."""
    return dynamic_equation().subs(w, TRANSVERSE).doit()


@checks(36)
def _() -> bool:
    """Equation (11) on the left, whose coefficients do not depend on time, and on the right -Gamma_i times the
    acceleration of (35); and numbers: the work of the inertia forces of a random arm, carried rigidly by the base, on
    modes found by shooting."""
    values, equation = sample(36), excited_system()
    if equation.lhs != dynamic_equation().lhs or equation.rhs + symbol("Gamma_i") * TRANSVERSE.diff(t, 2) != 0:
        return False
    length, q = values["L"], symbol("q_i")
    constant = all(not equation.lhs.diff(q.diff(t, k) if k else q).has(t) for k in range(3))
    instant = {t: 0.37, varpi: 2.1, w_1: 0.6, epsilon: 0.01}
    acceleration = float(TRANSVERSE.diff(t, 2).subs(instant))
    for mode in shoot(values):
        line = integrate(lambda p, mode=mode: values["rho"] * values["A"] * mode(p), length)
        gamma = line + values["m_e"] * mode(length)
        force = equation.rhs.subs(symbol("Gamma_i"), gamma).subs(instant)
        if abs(float(force) + gamma * acceleration) > 1e-9 * abs(gamma):
            return False
    return constant


@numbered("36a", "coupling by the fluctuating joint", "derived", ("35b", 7))
def joint_coupling() -> Eq:
    """Two modes in the Lagrangian's share of epsilon cos(varpi t), for modes of unit generalised mass. The stiffness
    of the modes varies in time: genuinely parametric."""
    return Eq(P_ij, coupling("joint stiffness"), evaluate=False)


@numbered("36b", "coupling by the base disturbed along the arm", "derived", ("35a", 7))
def axial_coupling() -> Eq:
    """A bent manipulator is shorter, and its foreshortening feels the axial inertia. It grows with varpi^2."""
    return Eq(P_ij, coupling("axial base"), evaluate=False)


@checks("36a", "sampled")
def _() -> bool:
    """Numbers: the work of the two extra spring forces of a mode found by shooting on another."""
    values = sample(361)
    first, second = shoot(values)[:2]
    work = values["k_t"] * first(0.0) * second(0.0) + values["k_r"] * first(0.0, 1) * second(0.0, 1)
    found = evaluate(joint_coupling().rhs, values, {phi_i: first, phi_j: second})
    return bool(abs(found / work - 1) < 1e-10)


@checks("36b", "sampled")
def _() -> bool:
    """Numbers: the axial momentum of a bent arm, with the foreshortening of every point by its own quadrature from
    the joint on, its second derivative by two modes found by shooting."""
    values = sample(362)
    first, second = shoot(values)[:2]
    length, line_mass = values["L"], values["rho"] * values["A"]

    def shortening(place: Any, a: float, b: float) -> Any:
        shares = [
            integrate(lambda p, end=end: (a * first(p, 1) + b * second(p, 1)) ** 2 / 2, end) for end in np.ravel(place)
        ]
        return np.reshape(shares, np.shape(place))

    def moment(a: float, b: float) -> float:
        line = integrate(lambda p: line_mass * shortening(p, a, b), length)
        return line + values["m_e"] * float(shortening(length, a, b))

    mixed = (moment(1, 1) - moment(1, -1) - moment(-1, 1) + moment(-1, -1)) / 4
    numbers = values | {"u_0": 0.3, "varpi": 1.7}
    found = evaluate(axial_coupling().rhs, numbers, {phi_i: first, phi_j: second})
    return bool(abs(found / (0.3 * 1.7**2 * mixed) - 1) < 1e-9)
