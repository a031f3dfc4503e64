"""Hamilton's principle and the equations that follow from it for the interval, the ends and the base: (8)-(10)."""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np
from sympy import Eq, Expr, Function, Integral, lambdify

from cra_sym.arm.lagrangian import paper_lagrangian
from cra_sym.mechanics.hamilton import hamilton
from cra_sym.paper.energy import ENERGY, L, modal_numbers, phi_i, single_mode, t, v, w, x
from cra_sym.paper.equations import Derivation, Proof, derived, numbered, proves, samples
from cra_sym.paper.evaluation import at, put, termwise, virtual_factors
from cra_sym.paper.joint import boundary_conditions, free_vibration, rayleigh_factors, section_forces
from cra_sym.paper.oracles import forces
from cra_sym.paper.oracles.shooting import sample, shoot
from cra_sym.symbols import dimension, symbol

__all__ = ["dynamics", "mode_field_equation", "natural_conditions"]

F, m_b, k_t, t_1, t_2, Gamma_i, omega_i = (symbol(name) for name in "F m_b k_t t_1 t_2 Gamma_i omega_i".split())

#: The virtual displacements in the notation of :func:`cra_sym.mechanics.hamilton`.
delta_v, delta_w, delta_L = Function("δv")(x, t), Function("δw")(t), Function("δLcal")(t)


@cache
def dynamics(*, driven: bool = True) -> Any:
    """Return the result of Hamilton's principle: the base driven by the force F, or its motion w prescribed."""
    base: dict[str, Any] = {"coordinates": [w], "virtual_work": [(F, w, None)]} if driven else {"prescribed": [w]}
    density, left, right = paper_lagrangian()
    return hamilton(density, fields=[v], x=x, domain=(0, L), t=t, left=left, right=right, **base)


def _step(name: str) -> Expr:
    """Return the expression that a step of :func:`dynamics` equates to zero."""
    return dynamics().steps.step(name).expression


# Hamilton's principle (8)-(10) ----------------------------------------------------------------------------------


@numbered(8, "Hamilton's principle", "assumption", (7,))
def hamiltons_principle() -> Eq:
    """The actual motion between two instants makes the action stationary: the time integral of the variation of the
    Lagrangian plus the virtual work of the driving force is zero."""
    return Eq(Integral(delta_L + F * delta_w, (t, t_1, t_2)), 0)


def _first_variation() -> Expr:
    """Return the derivative by e, at e = 0, of the Lagrangian (7) of v + e delta_v, w + e delta_w."""
    size = symbol("epsilon")
    moved = {v: v + size * delta_v, w: w + size * delta_w}
    return put(paper_lagrangian().total(), moved).diff(size).subs(size, 0).doit(integrals=False)


@proves(8)
def prove_hamiltons_principle() -> Proof:
    """Dimensions; for any motion and any virtual displacement that vanishes at both instants, the integral is the
    virtual work of the forces of Newton's law on slices, joint, end-effector and base, so it is zero for all if and
    only if these balance."""
    known = {"δLcal": ENERGY, "δw": dimension("w")}
    yield dimension(hamiltons_principle().lhs.function, known) == ENERGY
    rate = hamiltons_principle().lhs.function.subs(delta_L, _first_variation())
    *elastic, base = forces.newton()
    for found, force in zip(virtual_factors(put(rate, {delta_w: x * 0}), delta_v), elastic, strict=True):
        yield termwise(found - force)
    (found,) = virtual_factors(put(rate, {delta_v: x * 0}), delta_w)
    yield termwise(found - base)


@samples(8)
def sample_hamiltons_principle() -> bool:
    """The action of a random arm vibrating in a mode computed by shooting is stationary for a virtual displacement that
    vanishes at both instants, and is not if the frequency is one per cent too high."""
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

    return abs(slope(mode.omega)) < 1e-7 < 1e-3 < abs(slope(1.01 * mode.omega))


def _action(values: dict[str, float], motion: Any, duration: float) -> float:
    """Return the action of the arm on a base at rest, by quadrature of the Lagrangian (7)."""
    nodes, weights = np.polynomial.legendre.leggauss(24)
    instants, length = 0.5 * duration * (nodes + 1.0), values["L"]
    orders = [(1, 1), (2, 0), (0, 1), (1, 0), (0, 0)]
    jets = [symbol(f"C_{k}") for k in (1, 2, 3, 4)] + [symbol("psi")]
    named = list(zip(orders, jets, strict=True))
    numbers = {symbol(name): value for name, value in values.items()}
    rates = []
    for piece, place in zip(paper_lagrangian(), (0.5 * length * (nodes + 1.0), 0.0, length), strict=True):
        plain = piece.subs(w, 0).doit().subs([(v.diff((x, a), (t, b)), jet) for (a, b), jet in named])
        values_of = lambdify(jets, plain.subs(numbers), "numpy")
        rates.append(values_of(*(motion(place, a, b, instants) for a, b in orders)))
    return float(0.5 * duration * weights @ (0.5 * length * weights @ rates[0] + rates[1] + rates[2]))


@derived(9, "variation of the Lagrangian", (7, 8))
def variation() -> Derivation[Eq]:
    """First variation of the Lagrangian for variations of the elastic displacement and of the motion of the base, with
    the virtual work of the driving force."""
    yield "Lagrangian", "Density along the manipulator, and terms at the two ends.", _step("Lagrangian")
    return Eq(delta_L + F * delta_w, _step("Variation"))


@proves(9)
def prove_variation() -> Proof:
    """The first variation as the derivative by e of the Lagrangian of v + e delta_v, w + e delta_w."""
    yield variation().lhs - delta_L - F * delta_w
    yield termwise(variation().rhs - F * delta_w - _first_variation())


@derived(10, "principle with the variation substituted", (8, 9))
def integrated_by_parts() -> Derivation[Eq]:
    """(9) substituted in (8): integration by parts in time and along the manipulator removes the derivatives of the
    variations and gives terms at the two ends."""
    in_time = "integration by parts in time"
    yield (
        in_time,
        "The variations vanish at both instants, so there are no terms at these.",
        _step(in_time.capitalize()),
    )
    return Eq(_step("Integration by parts in x"), 0)


@proves(10)
def prove_integrated_by_parts() -> Proof:
    """For all motions, and all variations that vanish at both instants, the time integrals of (9) and of (10) agree:
    they have the same factor of each variation."""
    for kept, other in ((delta_v, delta_w), (delta_w, delta_v)):
        one, two = (
            virtual_factors(put(side, {other: x * 0}), kept)
            for side in (variation().rhs, integrated_by_parts().lhs - integrated_by_parts().rhs)
        )
        for found, expected in zip(one, two, strict=True):
            yield termwise(found - expected)


@derived("10a", "field equation and equation of the base", (10,))
def field_and_base() -> Derivation[tuple[Eq, Eq]]:
    """Variations along the manipulator and of the base are arbitrary; those at the ends give the conditions (16)."""
    yield "collected terms", "Factor of each variation.", _step("Collected terms")
    return dynamics().field_equations[0], dynamics().coordinate_equations[0]


def natural_conditions() -> tuple[Eq, ...]:
    """Return the four end conditions of Hamilton's principle: root force and moment, tip force and moment."""
    conditions: tuple[Eq, ...] = dynamics().boundary_conditions
    return conditions


@proves(16)
def prove_boundary_conditions() -> Proof:
    """Hamilton's principle gives the same four conditions, and so does Newton's law for joint and end-effector."""
    _, *newton, _ = forces.newton()
    for e, theirs, force, sign in zip(boundary_conditions(), natural_conditions(), newton, (-1, 1, 1, -1), strict=True):
        yield e.lhs - e.rhs - theirs.lhs + theirs.rhs
        yield e.lhs - e.rhs - sign * force


@proves("10a")
def prove_field_and_base() -> Proof:
    """Newton's law: a slice accelerates under the derivative of the shear force, and the whole arm under the driving
    force."""
    field, base = field_and_base()
    on_slice, *_, on_arm = forces.newton()
    yield field.lhs - field.rhs + on_slice
    yield termwise(base.lhs - base.rhs + on_arm)


@derived("10b", "field equation of a mode", (2, "10a"))
def mode_field_equation() -> Derivation[Eq]:
    """(2) substituted in the field equation, base at rest: each coordinate satisfies q'' = -ω² q and cancels."""
    field = field_and_base()[0].lhs.subs(w, 0).doit()
    yield "base at rest", "The field equation of free vibration.", Eq(field, 0)
    one = single_mode(field).expand()
    yield "one mode", "One term of (2).", Eq(one, 0)
    return Eq(free_vibration(one), 0)


@proves("10b")
def prove_mode_field_equation() -> Proof:
    """Rayleigh's principle: the shape of a mode makes K_i - ω_i² M_i, written by hand, stationary."""
    along, *_ = rayleigh_factors()
    yield mode_field_equation().lhs - mode_field_equation().rhs - along


@samples("10b")
def sample_mode_field_equation() -> bool:
    """Modes of a random arm, computed by shooting, satisfy it along the manipulator."""
    values = sample(102)
    numbers = {symbol(name): value for name, value in values.items()}
    for mode in shoot(values):
        for place in np.linspace(0.1, 0.9, 5) * values["L"]:
            jets = {phi_i.diff(x, 4): float(mode(place, 4)), phi_i: float(mode(place))}
            residual = mode_field_equation().lhs.subs(jets).subs(numbers).subs(omega_i, mode.omega)
            if abs(residual) > 1e-8 * abs(jets[phi_i.diff(x, 4)]):
                return False
    return True


@derived("10c", "equation of the base from its free body", ("10a", 16))
def base_free_body() -> Derivation[Eq]:
    """The field equation integrated along the manipulator replaces the inertia forces beyond the joint by the force of
    the translational spring: its own inertia, the spring and the drive act on the base."""
    field, base = field_and_base()
    shear, _ = (law.rhs for law in section_forces())
    inertia = Integral((field.lhs - field.rhs - shear.diff(x)).expand(), (x, 0, L))
    integrated = Eq(inertia, -Integral(shear.diff(x), (x, 0, L)), evaluate=False)
    yield (
        "field equation integrated",
        "The inertia force of the manipulator is the difference of the shear forces at its ends.",
        integrated,
    )
    known = {e.lhs: e.rhs for e in boundary_conditions()}
    at_ends = at(shear, 0).subs(known) - at(shear, L).subs(known)
    yield "shear at the ends", "(16) gives the shear force at the joint and at the tip.", Eq(inertia, at_ends.expand())
    return Eq(termwise(base.lhs - base.rhs + F - inertia) + at_ends.expand(), F)


@proves("10c")
def prove_base_free_body() -> Proof:
    """Written from the free body of the base."""
    yield base_free_body().lhs - base_free_body().rhs - (m_b * w.diff(t, 2) - k_t * at(v, 0) - F)


@samples("10c")
def sample_base_free_body() -> bool:
    """Both forms agree for modes of a random arm computed by shooting, ω_i² Γ_i = k_t φ_i(0)."""
    values = sample(103)
    gaps = [
        mode.omega**2 * modal_numbers(values, mode)[Gamma_i] / (values["k_t"] * mode(0.0)) - 1 for mode in shoot(values)
    ]
    return bool(max(map(abs, gaps)) < 1e-7)
