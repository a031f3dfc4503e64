"""The motion of the base and the response to it: equations (33) and (34)."""

from __future__ import annotations

from typing import Any

import mpmath
from sympy import Add, Eq, Expr, I, Integral, Rational, cos, expand_mul, lambdify, pi, sin, sinc
from sympy.simplify.fu import TR8

from cra_sym.model.oscillator import unit_responses
from cra_sym.paper.equations import Derivation, Proof, derived, numbered, proves, samples
from cra_sym.paper.modal_dynamics import duhamel, dynamic_equation
from cra_sym.symbols import dimension, symbol

__all__ = ["base_motion", "modal_response"]

t, tau, w, q_i = (symbol(name) for name in ("t", "tau", "w", "q_i"))
v_m, a_m, B, varpi, psi = (symbol(name) for name in ("v_m", "a_m", "B", "varpi", "psi"))
omega_i, zeta_i, Gamma_i, M_i = (symbol(name) for name in ("omega_i", "zeta_i", "Gamma_i", "M_i"))


@numbered(33, "motion of the driving base", "assumption")
def base_motion() -> Eq:
    """A mean motion with constant velocity or constant acceleration, plus a harmonic disturbance. Several harmonics may
    be added. The phase of each matters; the constant that it adds to the displacement does not."""
    return Eq(w, v_m * t + a_m * t**2 / 2 + B * sin(varpi * t + psi))


@proves(33)
def prove_base_motion() -> Proof:
    """Dimensions; without disturbance the motion starts at zero with the mean velocity and the mean acceleration; the
    disturbance alone is harmonic with angular frequency varpi and amplitude B."""
    mean, alone = base_motion().rhs.subs(B, 0), base_motion().rhs.subs({v_m: 0, a_m: 0})
    yield dimension(base_motion()) == dimension("w")
    yield base_motion().rhs - mean - alone
    for order, start in enumerate((0, v_m, a_m, 0)):
        yield mean.diff(t, order).subs(t, 0) - start
    yield alone.diff(t, 2) + varpi**2 * alone
    yield alone.subs({t: 0, psi: pi / 2}) - B
    yield alone.subs({t: 0, psi: 0})


def _integral_of_cosine(phase: Expr) -> Expr:
    """Return the integral over (0, t) of the cosine of a phase linear in tau: t sinc(half the change) cos(mean phase).

    It is an entire function of the rate of the phase; at rate zero it is the secular term t cos(phase).
    """
    change = phase.coeff(tau) * t
    return t * sinc(change / 2) * cos((phase.subs(tau, 0) + change / 2).expand())


@derived(34, "response of a mode", (12, 33))
def modal_response() -> Derivation[Eq]:
    """(33) substituted in (12), for an arm at rest before the base starts: v(x, 0) = 0 and y'(x, 0) = 0, so a base that
    starts with a velocity acts on the arm by an impulse. Undamped; at varpi = omega_i, sinc(0) = 1 gives the secular
    term."""
    moved = base_motion().rhs
    strike = (-Gamma_i / M_i * moved.diff(t)).subs(t, 0)
    solution = duhamel().rhs.subs({q_i.diff(t).subs(t, 0): strike, q_i.subs(t, 0): 0})
    yield "initial values", "The initial velocity of the base is an impulse on an arm at rest, (13).", Eq(q_i, solution)
    (integral,) = solution.atoms(Integral)
    shape = integral.function.subs(w.subs(t, tau).diff(tau, 2), moved.diff(t, 2).subs(t, tau))
    yield "acceleration of (33)", "Put under the integral.", Integral(shape, *integral.limits)
    sums = TR8(shape.expand()).expand().replace(sin, lambda phase: cos((phase - pi / 2).expand(), evaluate=False))
    yield "products to sums", "Each term a cosine whose phase is linear in τ.", Integral(sums, *integral.limits)
    total = Add(*(_integrated(term) for term in Add.make_args(sums)))
    terms = Add.make_args(solution.subs(integral, total))
    return Eq(q_i, Add(*(expand_mul(term, deep=False) for term in terms)))


def _integrated(term: Expr) -> Expr:
    factor, wave = term.as_independent(tau)
    return factor * _integral_of_cosine(wave.args[0].expand())


@proves(34)
def prove_modal_response() -> Proof:
    """It satisfies (11) with the motion (33), with zero initial displacement and the initial velocity of an arm at rest
    in the inertial frame: for varpi different from omega_i, and by continuity (both sides are entire in varpi) also at
    omega_i."""
    plain = modal_response().rhs.replace(sinc, lambda angle: sin(angle) / angle)
    equation = (dynamic_equation().lhs - dynamic_equation().rhs).subs({zeta_i: 0, q_i: plain, w: base_motion().rhs})
    strike = -Gamma_i / M_i * base_motion().rhs.diff(t)
    yield modal_response().lhs == q_i
    yield equation.doit()
    yield plain.subs(t, 0)
    yield (plain.diff(t) - strike).subs(t, 0)


@samples(34)
def sample_modal_response() -> bool:
    """Another derivation, by divided differences of the exponential function: the unit responses of
    :mod:`cra_sym.model.oscillator` without damping, away from resonance, near it and at it."""
    unit, push, start = unit_responses(), -Gamma_i / M_i, base_motion().rhs.diff(t).subs(t, 0)
    wave = unit.harmonic * (cos(psi) + I * sin(psi))
    numbers = {v_m: 0.3, a_m: -0.7, B: 0.05, psi: 0.9, Gamma_i: 0.4, M_i: 1.3, omega_i: 2, zeta_i: 0}
    numbers = {name: Rational(str(value)) for name, value in numbers.items()}
    own = _own_context()
    with own.workdps(40):
        for rate in (Rational(7, 3), 2 + Rational(1, 10**9), Rational(2)):
            parts = (modal_response().rhs, start * unit.impulse + a_m * unit.step, wave, push * B * varpi**2, push)
            found, plain, swing, weight, factor = (_function(part.subs(numbers | {varpi: rate}), own) for part in parts)
            gap = found(3) - factor(3) * plain(3) + weight(3) * own.im(swing(3))
            if abs(gap) > 1e-20:
                return False
    return True


def _own_context() -> Any:
    """Return an mpmath context separate from the shared one of the process."""
    return mpmath.mp.clone()


def _function(expression: Expr, own: Any) -> Any:
    """Return the expression as a function of t in the arithmetic of a context."""
    names = {name: getattr(own, name) for name in dir(own) if not name.startswith("_")}
    return lambdify(t, expression, [names, "mpmath"])
