"""Hamilton's principle, the dynamic equation and Duhamel's integral: equations (8)-(13)."""

from __future__ import annotations

import random
from functools import cache
from typing import Any

import numpy as np
from sympy import Eq, Expr, Function, Integral, S, cos, dsolve, lambdify, solve

from cra_sym.arm.energy import (
    ENERGY,
    L,
    generalised,
    inner_mass,
    lagrangian,
    modal_energies,
    modal_numbers,
    phi_i,
    q_i,
    single_mode,
    t,
    tidy,
    v,
    w,
    x,
)
from cra_sym.arm.equations import checks, numbered
from cra_sym.arm.evaluation import at, integrate_polynomials, put
from cra_sym.arm.joint import free_vibration, section_forces
from cra_sym.arm.modal_sum import ModalSum
from cra_sym.arm.shooting import integrate, sample, shoot
from cra_sym.mechanics import hamilton
from cra_sym.symbols import dimension, symbol

__all__ = ["dynamics", "mode_field_equation", "natural_conditions"]

F, tau, rho, A, m_b, k_t = (symbol(name) for name in ("F", "tau", "rho", "A", "m_b", "k_t"))
M_i, K_i, Gamma_i, omega_i, zeta_i = (symbol(name) for name in ("M_i", "K_i", "Gamma_i", "omega_i", "zeta_i"))
Lcal, t_1, t_2 = (symbol(name) for name in ("Lcal", "t_1", "t_2"))

#: The virtual displacements as :func:`cra_sym.mechanics.hamilton` writes them.
delta_v, delta_w, delta_L = Function("δv")(x, t), Function("δw")(t), Function("δLcal")(t)

#: An arm whose parameters are different primes: exact arithmetic without symbols.
_SOME_ARM = dict(zip(map(symbol, ("L", "E", "I_z", "rho", "A", "m_b", "m_e", "J_e", "k_t", "k_r")),
                     (2, 3, 5, 7, 11, 13, 17, 19, 23, 29), strict=True))  # fmt: skip


@cache
def dynamics(*, driven: bool = True) -> Any:
    """Return Hamilton's principle carried out: the base driven by the force F, or its motion w prescribed."""
    base: dict[str, Any] = {"coordinates": [w], "virtual_work": [(F, w, None)]} if driven else {"prescribed": [w]}
    density, left, right = lagrangian()
    return hamilton(density, fields=[v], x=x, domain=(0, L), t=t, left=left, right=right, **base)


def _step(name: str) -> Expr:
    """Return what a step of :func:`dynamics` says is zero."""
    return next(step.expression for step in dynamics().steps if step.name == name)


# Hamilton's principle (8)-(10) ----------------------------------------------------------------------------------


@numbered(8, "Hamilton's principle", "assumption", (7,))
def hamiltons_principle() -> Eq:
    """Of all motions between two instants the true one makes the action stationary: the variation of the Lagrangian
    and the virtual work of the driving force add to nothing."""
    return Eq(Integral(delta_L + F * delta_w, (t, t_1, t_2)), 0)


@checks(8)
def _() -> bool:
    """Dimensions; and numbers: the action of a random arm swinging in a mode found by shooting is stationary for a
    virtual displacement that vanishes at both instants, and is not when the mode swings one per cent too fast."""
    values, duration, step = sample(8), 2.0, 1e-4
    mode = shoot(values, modes=1)[0]

    def slope(omega: float) -> float:
        def motion(size: float) -> Any:
            def displaced(place: Any, in_x: int, in_t: int, instants: Any) -> Any:
                virtual = (place**2 + 1.0, 2.0 * place, 2.0 + 0.0 * place)[in_x]
                rate = np.pi / duration
                window = rate * np.sin(2 * rate * instants) if in_t else np.sin(rate * instants) ** 2
                swing = -omega * np.sin(omega * instants) if in_t else np.cos(omega * instants)
                return np.multiply.outer(mode(place, in_x), swing) + size * np.multiply.outer(virtual, window)

            return displaced

        return (_action(values, motion(step), duration) - _action(values, motion(-step), duration)) / (2.0 * step)

    known = {"δLcal": ENERGY, "δw": dimension("w")}
    consistent = dimension(hamiltons_principle().lhs.function, known) == ENERGY
    return consistent and abs(slope(mode.omega)) < 1e-7 < 1e-3 < abs(slope(1.01 * mode.omega))


def _action(values: dict[str, float], motion: Any, duration: float) -> float:
    """Return the action of the arm on a base at rest, by quadrature of the Lagrangian (7)."""
    nodes, weights = np.polynomial.legendre.leggauss(24)
    instants, length = 0.5 * duration * (nodes + 1.0), values["L"]
    orders = [(1, 1), (2, 0), (0, 1), (1, 0), (0, 0)]
    jets = [symbol(f"C_{k}") for k in (1, 2, 3, 4)] + [symbol("psi")]
    named = list(zip(orders, jets, strict=True))
    numbers = {symbol(name): value for name, value in values.items()}
    rates = []
    for piece, place in zip(lagrangian(), (0.5 * length * (nodes + 1.0), 0.0, length), strict=True):
        plain = piece.subs(w, 0).doit().subs([(v.diff((x, a), (t, b)), jet) for (a, b), jet in named])
        values_of = lambdify(jets, plain.subs(numbers), "numpy")
        rates.append(values_of(*(motion(place, a, b, instants) for a, b in orders)))
    return float(0.5 * duration * weights @ (0.5 * length * weights @ rates[0] + rates[1] + rates[2]))


@numbered(9, "variation of the Lagrangian", "derived", (7, 8))
def variation() -> Eq:
    """The elastic displacement and the base's motion are varied; the first-order change of the Lagrangian, with the
    virtual work of the driving force."""
    return Eq(delta_L + F * delta_w, _step("Variation"))


@checks(9)
def _() -> bool:
    """Another route to the first variation: the Lagrangian of v + e delta_v, w + e delta_w differentiated by e, for
    random polynomial motions."""
    size, functions = symbol("epsilon"), _random_motion(9)
    moved = {v: functions[v] + size * functions[delta_v], w: functions[w] + size * functions[delta_w]}
    rate = integrate_polynomials(put(lagrangian().total(), moved).subs(_SOME_ARM)).diff(size).subs(size, 0)
    engine = integrate_polynomials(put(variation().rhs - F * delta_w, functions).subs(_SOME_ARM))
    return (rate - engine).expand() == 0 != rate


def _random_motion(seed: int, window: Expr = S.One) -> dict[Expr, Expr]:
    """Return polynomials for v, w and their variations, the latter times ``window``."""
    rng = random.Random(seed)

    def polynomial(*variables: Expr) -> Expr:
        total = S.Zero
        for power in range(1, 6):
            total += rng.randint(1, 9) * variables[0] ** power * (variables[-1] ** (power % 3) if variables[1:] else 1)
        return total

    return {
        v: polynomial(x, t),
        w: polynomial(t),
        delta_v: polynomial(x, t) * window,
        delta_w: polynomial(t) * window,
    }


@numbered(10, "principle with the variation put in", "derived", (8, 9))
def integrated_by_parts() -> Eq:
    """(9) in (8): integration by parts in time and along the manipulator frees the variations of their derivatives and
    leaves terms at the two ends."""
    return Eq(_step("Integration by parts in x"), 0)


@checks(10)
def _() -> bool:
    """For random polynomial motions and variations that vanish at both instants, the time integrals of (9) and of (10)
    agree."""
    functions = _random_motion(10, window=t**2 * (1 - t) ** 2)
    difference = variation().rhs - integrated_by_parts().lhs
    change = integrate_polynomials(put(difference, functions | {F: t**2}).subs(_SOME_ARM)).expand()
    return change != 0 and integrate_polynomials(Integral(change, (t, 0, 1))).expand() == 0


@numbered("10a", "field equation and equation of the base", "derived", (10,))
def field_and_base() -> tuple[Eq, Eq]:
    """Variations along the manipulator and of the base are arbitrary; those at the ends give the conditions (16)."""
    return dynamics().field_equations[0], dynamics().coordinate_equations[0]


def natural_conditions() -> tuple[Eq, ...]:
    """Return the four end conditions that Hamilton's principle leaves: root force and moment, tip force and moment."""
    return dynamics().boundary_conditions


@checks("10a")
def _() -> bool:
    """Newton: a slice accelerates under the slope of the shear force (15); the whole arm is one momentum balance."""
    field, base = field_and_base()
    shear, _ = (law.rhs for law in section_forces())
    momentum = m_b * w.diff(t) + symbol("m_e") * (w + at(v, L)).diff(t)
    line = Integral(rho * A * (w + v).diff(t), (x, 0, L))
    functions = _random_motion(101)
    slice_balance = field.lhs - field.rhs - rho * A * (w + v).diff(t, 2) - shear.diff(x)
    whole = integrate_polynomials(put(base.lhs - base.rhs + F - (momentum + line).diff(t), functions).subs(_SOME_ARM))
    return slice_balance.expand() == 0 and whole.expand() == 0


@numbered("10b", "field equation of a mode", "derived", (2, "10a"))
def mode_field_equation() -> Eq:
    """(2) in the field equation, the base at rest: each coordinate swings with q'' = -ω² q and cancels."""
    field = field_and_base()[0].lhs.subs(w, 0).doit()
    return Eq(free_vibration(single_mode(field).expand()), 0)


@checks("10b")
def _() -> bool:
    """Numbers: modes of a random arm found by shooting satisfy it along the manipulator."""
    values = sample(102)
    numbers = {symbol(name): value for name, value in values.items()}
    for mode in shoot(values):
        for place in np.linspace(0.1, 0.9, 5) * values["L"]:
            jets = {phi_i.diff(x, 4): float(mode(place, 4)), phi_i: float(mode(place))}
            residual = mode_field_equation().lhs.subs(jets).subs(numbers).subs(omega_i, mode.omega)
            if abs(residual) > 1e-8 * abs(jets[phi_i.diff(x, 4)]):
                return False
    return True


@numbered("10c", "equation of the base from its own free body", "derived", ("10a", 16))
def base_free_body() -> Eq:
    """The field equation integrated along the manipulator turns all inertia beyond the joint into the force of the
    translational spring: the base feels its own inertia, the spring and the drive."""
    field, base = field_and_base()
    inertia = rho * A * (v + w).diff(t, 2)
    (stiff,) = solve(Eq(field.lhs.expand(), 0), v.diff(x, 4))
    force = symbol("E") * symbol("I_z") * v.diff(x, 3)
    if (symbol("E") * symbol("I_z") * stiff + inertia).expand() != 0:
        raise ArithmeticError("the slice does not balance")
    at_ends = at(force, 0) - at(force, L)
    for condition in natural_conditions():
        at_ends = at_ends.subs(condition.lhs, condition.rhs)
    spread = Integral(rho * A * v.diff(t, 2), (x, 0, L)) + rho * A * L * w.diff(t, 2)
    left = (base.lhs - base.rhs + F).expand() - spread + at_ends
    return Eq(left.expand(), F)


@checks("10c")
def _() -> bool:
    """Written down from the free body of the base; and numbers: both forms agree on modes of a random arm found by
    shooting, ω_i² Γ_i = k_t φ_i(0)."""
    drawn = m_b * w.diff(t, 2) - k_t * at(v, 0) - F
    values = sample(103)
    gaps = [
        mode.omega**2 * modal_numbers(values, mode)[Gamma_i] / (values["k_t"] * mode(0.0)) - 1 for mode in shoot(values)
    ]
    return (base_free_body().lhs - base_free_body().rhs - drawn).expand() == 0 and bool(max(map(abs, gaps)) < 1e-7)


# Dynamic equation and Duhamel's integral (11)-(13) --------------------------------------------------------------


@numbered(11, "dynamic equation", "derived", (5, 8, "16b"))
def dynamic_equation() -> Eq:
    """Hamilton's principle on the modal energies: one equation a mode, driven by the base's acceleration. A damping
    ratio is carried along; it is zero in the paper."""
    kinetic, potential = (_one_mode(e.rhs) for e in modal_energies())
    friction = -2 * zeta_i * omega_i * M_i * q_i.diff(t)
    result = hamilton(
        S.Zero, fields=[], coordinates=[q_i], prescribed=[w], x=x, domain=(0, L), t=t, left=kinetic - potential,
        virtual_work=[(friction, q_i, None)],
    )  # fmt: skip
    balance = result.coordinate_equations[0].lhs - result.coordinate_equations[0].rhs
    driven = Gamma_i * w.diff(t, 2)
    free = (balance - driven).expand().subs(K_i, omega_i**2 * M_i)
    return Eq(M_i * (free / M_i).expand(), -driven)


def _one_mode(energy: Expr) -> Expr:
    return energy.replace(lambda e: isinstance(e, ModalSum), lambda e: e.function)


@checks(11)
def _() -> bool:
    """Numbers: the virtual work of all forces on a random arm, for a virtual displacement along a mode found by
    shooting while three modes move, by quadrature."""
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


@numbered(12, "Duhamel's integral", "derived", (11,))
def duhamel() -> Eq:
    """Undamped: the free motion from the initial values, and one free motion for each impulse -Γ_i w'' / M_i that
    the base has given since. With ω_i = 0, sin(ω_i t) / ω_i is t."""
    impulse = _homogeneous(S.Zero, S.One)
    start, rate = symbol("C_1"), symbol("C_2")
    free = _homogeneous(start, rate).subs({start: q_i.subs(t, 0), rate: q_i.diff(t).subs(t, 0)})
    drive = (dynamic_equation().rhs / M_i).subs(t, tau) * impulse.subs(t, t - tau) * omega_i
    constant, varying = drive.as_independent(tau)
    return Eq(q_i, free + constant / omega_i * Integral(varying, (tau, 0, t)))


@checks(12)
def _() -> bool:
    """Put into (11) it leaves nothing; and numbers: a Runge-Kutta solution of (11) for a random base motion."""
    from scipy.integrate import quad, solve_ivp

    solution, equation = duhamel().rhs, dynamic_equation()
    residual = (equation.lhs - equation.rhs).subs(zeta_i, 0).subs(q_i, solution).doit(integrals=False)
    exact = residual.expand() == 0
    omega, start, rate, ratio = 3.1, 0.2, -0.4, 0.8

    def push(time: float) -> float:
        return -ratio * (0.3 * time + np.cos(1.7 * time))

    reference = solve_ivp(lambda s, q: (q[1], push(s) - omega**2 * q[0]), (0, 2), (start, rate), rtol=1e-10, atol=1e-12)
    numbers = {Gamma_i: ratio, M_i: 1, omega_i: omega, q_i.subs(t, 0): start, q_i.diff(t).subs(t, 0): rate}
    (integral,) = solution.atoms(Integral)
    known = integral.function.subs(w.diff(t, 2).subs(t, tau), 0.3 * tau + cos(1.7 * tau))
    inside = lambdify(tau, known.subs(numbers).subs(t, 2.0), "numpy")
    value = solution.subs(integral, quad(inside, 0.0, 2.0, epsabs=1e-12)[0]).subs(numbers).subs(t, 2.0)
    return exact and bool(abs(float(value) - reference.y[0, -1]) < 1e-8)


@numbered(13, "its initial values", "derived", (2, 6, "16c"))
def initial_values() -> tuple[Eq, Eq]:
    """An arm at rest in the inertial frame when the base sets off with speed w'(0): seen from the base it moves
    backwards, v(x, 0) = 0 and v_t(x, 0) = -w'(0). The product with a mode picks out that mode's coordinate."""
    speed = w.diff(t).subs(t, 0)
    participation = generalised()[2]
    projected = [
        tidy(inner_mass(phi_i, start)).subs(tidy(participation.rhs), Gamma_i).doit(integrals=False)
        for start in (S.Zero, S.One)
    ]
    start, rate = q_i.subs(t, 0), q_i.diff(t).subs(t, 0)
    return Eq(start, projected[0].doit() / M_i), Eq(rate, -speed * projected[1] / M_i)


@checks(13)
def _() -> bool:
    """Numbers: among all modal velocities these leave the least kinetic energy (3) in the inertial frame, found by
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
    return initial_values()[0].rhs == 0 and bool(np.allclose(found, best, rtol=1e-7))
