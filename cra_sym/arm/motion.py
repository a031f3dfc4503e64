"""Hamilton's principle and what it gives in the interval, at the ends and for the base: equations (8)-(10)."""

from __future__ import annotations

import random
from functools import cache
from typing import Any

import numpy as np
from sympy import Eq, Expr, Function, Integral, S, lambdify, solve

from cra_sym.arm.energy import (
    ENERGY,
    L,
    lagrangian,
    modal_numbers,
    phi_i,
    single_mode,
    t,
    v,
    w,
    x,
)
from cra_sym.arm.equations import checks, numbered
from cra_sym.arm.evaluation import at, integrate_polynomials, put
from cra_sym.arm.joint import boundary_conditions, free_vibration, section_forces
from cra_sym.arm.shooting import sample, shoot
from cra_sym.mechanics.hamilton import hamilton
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


@checks(8, "sampled")
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


@checks(9, "sampled")
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


@checks(10, "sampled")
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


@checks(16)
def _() -> bool:
    """Hamilton's principle gives the same four conditions."""
    pairs = zip(boundary_conditions(), natural_conditions(), strict=True)
    return all((ours.lhs - ours.rhs - theirs.lhs + theirs.rhs).expand() == 0 for ours, theirs in pairs)


@checks("10a", "sampled")
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


@checks("10b", "sampled")
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
