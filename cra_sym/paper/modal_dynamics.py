"""The dynamic equation of a mode and Duhamel's integral: equations (11)-(13)."""

from __future__ import annotations

from typing import Any

import numpy as np
from sympy import Eq, Expr, Integral, S, cos, dsolve, exp, lambdify, sqrt

from cra_sym.mechanics import hamilton
from cra_sym.paper.energy import (
    L,
    generalised,
    inner_mass,
    modal_numbers,
    phi_i,
    q_i,
    separation,
    t,
    tidy,
    v,
    w,
    x,
)
from cra_sym.paper.equations import Derivation, Proof, derived, proves, samples
from cra_sym.paper.evaluation import put, termwise
from cra_sym.paper.modal_sum import ModalSum, member, written_out
from cra_sym.paper.oracles import forces
from cra_sym.paper.oracles.shooting import integrate, sample, shoot
from cra_sym.paper.orthogonality import modal_energies, orthogonality, stiffness_identity
from cra_sym.symbols import symbol

__all__ = ["duhamel", "dynamic_equation", "initial_values"]

M_i, K_i, Gamma_i, omega_i, zeta_i, tau = (
    symbol(name) for name in ("M_i", "K_i", "Gamma_i", "omega_i", "zeta_i", "tau")
)


@derived(11, "dynamic equation", (5, 8, "16b"))
def dynamic_equation() -> Derivation[Eq]:
    """Hamilton's principle for the modal energies: one equation for each mode, driven by the acceleration of the base.
    A modal damping ratio is included; it is zero in the paper."""
    kinetic, potential = (_one_mode(e.rhs) for e in modal_energies())
    yield "energies of mode i", "Its terms of (5), and those that couple it with the base.", (kinetic, potential)
    friction = -2 * zeta_i * omega_i * M_i * q_i.diff(t)
    result = hamilton(
        S.Zero, fields=[], coordinates=[q_i], prescribed=[w], x=x, domain=(0, L), t=t, left=kinetic - potential,
        virtual_work=[(friction, q_i, None)],
    )  # fmt: skip
    yield (
        "Hamilton's principle",
        "Variation of the coordinate, with the virtual work of the damping force.",
        result.coordinate_equations[0],
    )
    balance = result.coordinate_equations[0].lhs - result.coordinate_equations[0].rhs
    driven = Gamma_i * w.diff(t, 2)
    free = (balance - driven).expand().subs(K_i, omega_i**2 * M_i)
    return Eq(M_i * (free / M_i).expand(), -driven)


def _one_mode(energy: Expr) -> Expr:
    return energy.replace(lambda e: isinstance(e, ModalSum), lambda e: e.function)


@proves(11)
def prove_dynamic_equation() -> Proof:
    """D'Alembert's principle: without damping it is the virtual work of all forces, written by hand, along mode i for a
    motion in any two modes, by (6), (16b) and (16c); with damping, a free vibration that decays as exp(-zeta_i omega_i
    t) satisfies it."""
    equation = dynamic_equation().lhs - dynamic_equation().rhs
    two = separation().rhs.members("i", "j")
    mass, stiffness = (e.lhs - e.rhs for e in orthogonality())
    q_j = member(q_i, "j")
    work = -put(forces.virtual_work(phi_i), {v: two})
    zero = mass * q_j.diff(t, 2) + stiffness * q_j + (K_i - omega_i**2 * M_i) * q_i
    named = {e.lhs: e.rhs for e in generalised()}
    yield stiffness_identity()[1].lhs - stiffness_identity()[1].rhs - (K_i - omega_i**2 * M_i)
    yield termwise((work - zero.subs(named) - equation.subs(zeta_i, 0).subs(named)).doit(integrals=False))
    ringing = exp(-zeta_i * omega_i * t) * cos(omega_i * sqrt(1 - zeta_i**2) * t)
    yield dynamic_equation().lhs.subs(q_i, ringing).doit()


@samples(11)
def sample_dynamic_equation() -> bool:
    """The virtual work of all forces on a random arm, by quadrature, for a virtual displacement along a mode computed
    by shooting and a motion in three modes."""
    values = sample(11)
    shapes, length = shoot(values), values["L"]
    q, acceleration, base = np.array([0.3, -0.5, 0.2]), np.array([0.7, 0.4, -0.6]), 0.9
    line_mass, bending = values["rho"] * values["A"], values["E"] * values["I_z"]

    def elastic(place: Any, amplitudes: Any, derivative: int = 0) -> Any:
        return sum(a * shape(place, derivative) for a, shape in zip(amplitudes, shapes, strict=True))

    for mode, displacement, rate in zip(shapes, q, acceleration, strict=True):
        work = integrate(lambda p: line_mass * (base + elastic(p, acceleration)) * mode(p), length)  # noqa: B023
        work += integrate(lambda p: bending * elastic(p, q, 2) * mode(p, 2), length)  # noqa: B023
        work += values["m_e"] * (base + elastic(length, acceleration)) * mode(length)
        work += values["J_e"] * elastic(length, acceleration, 1) * mode(length, 1)
        work += values["k_t"] * elastic(0.0, q) * mode(0.0) + values["k_r"] * elastic(0.0, q, 1) * mode(0.0, 1)
        equation = dynamic_equation()
        numbers = {q_i.diff(t, 2): rate, q_i.diff(t): 0, q_i: displacement, w.diff(t, 2): base}
        found = (equation.lhs - equation.rhs).subs(numbers).subs(modal_numbers(values, mode))
        if abs(found.subs({omega_i: mode.omega, zeta_i: 0}) - work) > 1e-6 * abs(work):
            return False
    return True


def _homogeneous(displacement: Expr, velocity: Expr) -> Expr:
    """Solve the undamped equation (11) without drive for given initial values."""
    free = dynamic_equation().lhs.subs(zeta_i, 0) / M_i
    initial = {q_i.subs(t, 0): displacement, q_i.diff(t).subs(t, 0): velocity}
    return dsolve(Eq(free.expand(), 0), q_i, ics=initial).rhs


@derived(12, "Duhamel's integral", (11,))
def duhamel() -> Derivation[Eq]:
    """Undamped: the free motion from the initial values plus the superposed free motions due to the impulses -Γ_i w'' /
    M_i dτ of the base (Duhamel's integral). For ω_i = 0, sin(ω_i t) / ω_i is t."""
    impulse = _homogeneous(S.Zero, S.One)
    start, rate = symbol("C_1"), symbol("C_2")
    free = _homogeneous(start, rate).subs({start: q_i.subs(t, 0), rate: q_i.diff(t).subs(t, 0)})
    yield "free motion", "Without drive, from the initial values.", Eq(q_i, free)
    yield "unit impulse", "The free motion with zero initial displacement and unit initial velocity.", impulse
    drive = (dynamic_equation().rhs / M_i).subs(t, tau) * impulse.subs(t, t - tau) * omega_i
    yield (
        "impulse of the base at tau",
        "The impulse of the base per unit of time, and its effect at t.",
        drive / omega_i,
    )
    constant, varying = drive.as_independent(tau)
    return Eq(q_i, free + constant / omega_i * Integral(varying, (tau, 0, t)))


@proves(12)
def prove_duhamel() -> Proof:
    """It satisfies (11) and the initial values."""
    solution, equation = duhamel().rhs, dynamic_equation()
    yield duhamel().lhs == q_i
    yield (equation.lhs - equation.rhs).subs(zeta_i, 0).subs(q_i, solution).doit(integrals=False)
    yield solution.subs(t, 0).doit() - q_i.subs(t, 0)
    yield solution.diff(t).subs(t, 0).doit() - q_i.diff(t).subs(t, 0)


@samples(12)
def sample_duhamel() -> bool:
    """A Runge-Kutta solution of (11) for a base motion."""
    from scipy.integrate import quad, solve_ivp

    solution = duhamel().rhs
    omega, start, rate, ratio = 3.1, 0.2, -0.4, 0.8

    def push(time: float) -> float:
        return float(-ratio * (0.3 * time + np.cos(1.7 * time)))

    reference = solve_ivp(lambda s, q: (q[1], push(s) - omega**2 * q[0]), (0, 2), (start, rate), rtol=1e-10, atol=1e-12)
    numbers = {Gamma_i: ratio, M_i: 1, omega_i: omega, q_i.subs(t, 0): start, q_i.diff(t).subs(t, 0): rate}
    (integral,) = solution.atoms(Integral)
    known = integral.function.subs(w.diff(t, 2).subs(t, tau), 0.3 * tau + cos(1.7 * tau))
    inside = lambdify(tau, known.subs(numbers).subs(t, 2.0), "numpy")
    value = solution.subs(integral, quad(inside, 0.0, 2.0, epsabs=1e-12)[0]).subs(numbers).subs(t, 2.0)
    return bool(abs(float(value) - reference.y[0, -1]) < 1e-8)


@derived(13, "its initial values", (2, 6, "16c"))
def initial_values() -> Derivation[tuple[Eq, Eq]]:
    """An arm at rest in the inertial frame when the base starts with velocity w'(0): relative to the base it moves
    backwards, v(x, 0) = 0 and v_t(x, 0) = -w'(0). The inner product with a mode gives the coordinate of that mode."""
    speed = w.diff(t).subs(t, 0)
    participation = generalised()[2]
    at_start = tuple(Eq(at_zero, value) for at_zero, value in ((v.subs(t, 0), 0), (v.diff(t).subs(t, 0), -speed)))
    yield "arm at rest when the base starts", "Displacement and velocity relative to the base.", at_start
    projected = [
        tidy(inner_mass(phi_i, start)).subs(tidy(participation.rhs), Gamma_i).doit(integrals=False)
        for start in (S.Zero, S.One)
    ]
    yield (
        "product with mode i",
        "By (16c) the sum over modes reduces to M_i times the coordinate; a uniform unit displacement gives this.",
        Eq(inner_mass(phi_i, S.One), projected[1]),
    )
    start, rate = q_i.subs(t, 0), q_i.diff(t).subs(t, 0)
    return Eq(start, projected[0].doit() / M_i), Eq(rate, -speed * projected[1] / M_i)


@proves(13)
def prove_initial_values() -> Proof:
    """Of all modal velocities these minimise the kinetic energy (5) in the inertial frame: its derivative by each
    vanishes. All displacements are zero."""
    (still, rate), start = initial_values(), {w.diff(t): w.diff(t).subs(t, 0)}
    slope = written_out(modal_energies()[0].rhs, "i", "j").diff(q_i.diff(t)).subs(start)
    yield (still.lhs, rate.lhs) == (q_i.subs(t, 0), q_i.diff(t).subs(t, 0))
    yield slope.subs(q_i.diff(t), rate.rhs)
    yield still.rhs


@samples(13)
def sample_initial_values() -> bool:
    """Among all modal velocities these leave the least kinetic energy (3) in the inertial frame, found by
    least squares over quadrature points of a random arm."""
    values, speed = sample(13), 0.7
    shapes, length = shoot(values), values["L"]
    nodes, weights = np.polynomial.legendre.leggauss(40)
    places = 0.5 * length * (nodes + 1.0)
    scale = np.sqrt(0.5 * length * weights * values["rho"] * values["A"])
    tip, turn = np.sqrt(values["m_e"]), np.sqrt(values["J_e"])
    rows = [np.append(scale * s(places), [tip * s(length), turn * s(length, 1)]) for s in shapes]
    target = -speed * np.append(scale, [tip, 0.0])
    best = np.linalg.lstsq(np.array(rows).T, target, rcond=None)[0]
    rate = initial_values()[1].rhs.subs(w.diff(t).subs(t, 0), speed)
    found = [float(rate.subs(modal_numbers(values, shape))) for shape in shapes]
    return bool(np.allclose(found, best, rtol=1e-7))
