"""Multiple scales at a principal resonance: equations (37)-(49).

The paper's own (43) and (48) are lost. The plain numbers treat an excitation that is parametric, (36a) or (36b); those
with a letter follow the paper's words literally, to a forced resonance, or supply what it leaves out.
"""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np
from sympy import Derivative, Eq, Expr, Function, I, S, Symbol, conjugate, cos, exp

from cra_sym.arm.boundaries import forced_growth, forced_resonance, general_resonance, plain
from cra_sym.arm.energy import inner_mass
from cra_sym.arm.equations import checks, numbered
from cra_sym.arm.evaluation import evaluate
from cra_sym.arm.parametric import phi_i, t, x
from cra_sym.arm.shooting import sample, shoot
from cra_sym.symbols import Dimension, dimension, symbol

__all__: list[str] = []

epsilon, sigma, varpi, omega_n, T_0, T_1 = (symbol(name) for name in "epsilon sigma varpi omega_n T_0 T_1".split())
P_ij, P_nn, M_n, Gamma_n, w_1, zeta_n = (symbol(name) for name in "P_ij P_nn M_n Gamma_n w_1 zeta_n".split())


@cache
def principal(order: int = 1, *, damped: bool = False) -> Any:
    """Return multiple scales at the principal resonance of one mode among any number."""
    return general_resonance("principal", order, damped=damped)


def _step(name: str) -> Any:
    shown = principal().step(name).expression
    return tuple(map(plain, shown)) if isinstance(shown, tuple) else plain(shown)


# Expansion (37)-(43) --------------------------------------------------------------------------------------------


@numbered(37, "two-scale expansion", "assumption", ("36a", "36b"))
def two_scale_expansion() -> Any:
    """A solution is sought that depends on fast and slow time."""
    return _step("expansion")


@numbered(38, "derivative operators", "derived", (37,))
def derivative_operators() -> Any:
    """The chain rule: D_k is the derivative with respect to T_k = epsilon^k t."""
    return _step("operators")


@numbered(39, "order 0", "derived", (37, 38))
def order_0() -> Any:
    """Terms without epsilon."""
    return _step("order 0")


@numbered(40, "order 1", "derived", (37, 38))
def order_1() -> Any:
    """Terms with epsilon: the slow derivative and the excitation drive."""
    return _step("order 1")


@numbered(41, "solution of order 0", "derived", (39,))
def order_0_solution() -> Any:
    """Each mode swings at its own frequency; its complex amplitude A_n depends on slow time."""
    return _step("free vibration")


@numbered(42, "detuning", "definition")
def detuning() -> Any:
    """The paper's text measures the detuning from omega_n; the sources it follows, and a parametric excitation, ask for
    2 omega_n: here the latter (the former is (42a)). Its own symbols are lost."""
    return _step("detuning")


@numbered("42a", "detuning from the natural frequency", "definition")
def forced_detuning() -> Eq:
    """The paper's words taken literally: what the forced system (36) calls for."""
    return plain(forced_resonance().step("detuning").expression)


@numbered(43, "the excitation in slow time", "derived", (42,))
def excitation_in_exponentials() -> Any:
    """The paper's equation is lost; from (41) and (42) it can only be this, the excitation at the detuned frequency."""
    return _step("excitation in exponentials")


@numbered(44, "secular terms", "derived", (40, 41, 43))
def secular_terms() -> Any:
    """Factor of exp(i omega_n T_0) on the right of order 1."""
    return _step("secular terms")


@numbered(45, "solvability", "derived", (44,))
def solvability() -> Any:
    """Order 1 has a bounded solution only if its right-hand side is orthogonal to the free vibration."""
    return _step("solvability")


def residual(rate: Expr | None = None) -> tuple[Expr, Expr]:
    """Put the expansion into the equation of motion of a single mode; return what is left at orders 0 and 1.

    The slow derivative of the amplitude is that of (48), or ``rate`` if given.
    """
    a, b = Function("a")(t), Function("b")(t)
    names = {Symbol("A_n", commutative=False): a, Symbol("Abar_n", commutative=False): b}
    (written,) = order_0_solution()
    zeroth = written.rhs.subs(T_0, t).xreplace(names)
    driven = principal(2).step("order-1 solution").expression[0].rhs
    first = plain(driven).subs({T_0: t, T_1: epsilon * t}).xreplace(names)
    excitation = excitation_in_exponentials().rhs.subs({T_0: t, T_1: epsilon * t})
    q = zeroth + epsilon * first
    motion = q.diff(t, 2) + omega_n**2 * q + epsilon * excitation * P_nn * q
    rates = _rates(a, b) if rate is None else {a: epsilon * rate, b: epsilon * conjugate(rate)}
    for f in (a, b):
        second = rates[f].diff(t).subs({g.diff(t): r for g, r in rates.items()})
        motion = motion.subs(f.diff(t, 2), second)
    motion = motion.subs({g.diff(t): r for g, r in rates.items()})
    # in slow time the phase is no power of epsilon
    plain_motion = motion.expand().subs(epsilon * sigma * t, Symbol("phase", real=True)).expand()
    return tuple((plain_motion.coeff(epsilon, k) * exp(-I * omega_n * t)).expand() for k in (0, 1))


def _rates(a: Expr, b: Expr) -> dict[Expr, Expr]:
    """Return (48) and its conjugate for the functions a and b of t."""
    drift = amplitude_equation().rhs
    names = {Function("A_n")(t): a, Function("Abar_n")(t): b}
    forward = drift.xreplace(names)
    swapped = {a: b, b: a, I: -I}
    return {a: forward, b: forward.xreplace(swapped)}


@checks(37)
def _() -> bool:
    """Put into the equation of motion of a mode, with the slow evolution (48), it leaves nothing at orders 0 and 1."""
    return residual() == (0, 0)


@checks(38)
def _() -> bool:
    """A function of t and epsilon t, differentiated twice."""
    trial = cos(2 * T_0) * exp(T_1)
    total = trial.subs({T_0: t, T_1: epsilon * t}).diff(t, 2)
    scales = {symbol_.name: time for symbol_, time in zip((Symbol("D_0"), Symbol("D_1")), (T_0, T_1), strict=True)}
    _, second = derivative_operators()
    found: Expr = S.Zero
    for term in second.rhs.expand().as_ordered_terms():
        part, factor = trial, S.One
        for base, power in (f.as_base_exp() for f in term.as_ordered_factors()):
            if base.is_Symbol and base.name in scales:
                part = part.diff(scales[base.name], power)
            else:
                factor = factor * base**power
        found += factor * part
    gap = (total - found.subs({T_0: t, T_1: epsilon * t})).expand()
    return gap.coeff(epsilon, 0) == gap.coeff(epsilon, 1) == 0 != gap


@checks(39)
def _() -> bool:
    """The free vibration, put into the equation of motion without excitation, leaves nothing."""
    return residual()[0] == 0


@checks(40)
def _() -> bool:
    """Its bounded solution, put with the rest into the equation of motion, leaves nothing at first order."""
    return residual()[1] == 0


@checks(41)
def _() -> bool:
    """Differentiated twice."""
    (solution,) = order_0_solution()
    return (solution.rhs.diff(T_0, 2) + omega_n**2 * solution.rhs).expand() == 0


@checks(42)
def _() -> bool:
    """Frequencies; at the exact resonance one excitation period is half a period of the mode."""
    return dimension(detuning()) == Dimension(s=-1) and detuning().rhs.subs(sigma, 0) == 2 * omega_n


@checks("42a")
def _() -> bool:
    """Frequencies; at the exact resonance both periods are the same."""
    return dimension(forced_detuning()) == Dimension(s=-1) and forced_detuning().rhs.subs(sigma, 0) == omega_n


@checks(43)
def _() -> bool:
    """Euler's formula for the detuned frequency."""
    cosine = cos((detuning().rhs * T_0).expand().subs(epsilon * T_0, T_1))
    return (cosine.rewrite(exp) - excitation_in_exponentials().rhs).expand().equals(0)


@checks(44)
def _() -> bool:
    """Any other slow evolution of the amplitude leaves in the equation of motion just these terms, sign changed."""
    rate = Symbol("r", real=True)
    left = [term for term in residual(rate)[1].args if not any(e.args[0].has(t) for e in term.atoms(exp))]
    slow = {Symbol(name, commutative=False): Function(small)(t) for name, small in (("A_n", "a"), ("Abar_n", "b"))}
    (terms,) = secular_terms()
    shown = terms.subs(Symbol("D_1", commutative=False) * Symbol("A_n", commutative=False), rate).xreplace(slow)
    return (sum(left, S.Zero) + shown.subs(T_1, Symbol("phase", real=True) / sigma)).expand() == 0


@checks(45)
def _() -> bool:
    """An oscillator driven at its own frequency, whatever the force, swings ever wider: t times a harmonic."""
    from sympy import dsolve

    f = Function("f")(t)
    driven = dsolve(Eq(f.diff(t, 2) + omega_n**2 * f, cos(omega_n * t)), f).rhs
    return driven.expand().coeff(t, 1).has(t) and not solvability()[0].lhs.has(T_0)


@numbered(46, "inner product", "definition", (6,))
def inner_product() -> Eq:
    """For complex functions on (0, L), with the masses of manipulator and end-effector; modes are orthogonal in it."""
    f, g = (Function(name)(x) for name in "fg")
    return Eq(Symbol(r"\langle f, g \rangle"), inner_mass(f, conjugate(g)).doit(integrals=False), evaluate=False)


@checks(46)
def _() -> bool:
    """Numbers: modes of a random arm found by shooting are orthogonal in it."""
    values, f, g = sample(46), Function("f")(x), Function("g")(x)
    shapes = shoot(values)
    real = inner_mass(f, g)
    gram = [[evaluate(real, values, {f: a, g: b}) for a in shapes] for b in shapes]
    scale = np.sqrt(np.diag(gram))
    return bool(np.abs(gram / scale / scale[:, None] - np.eye(len(shapes))).max() < 1e-8)


@numbered(47, "solvability, term by term", "derived", (45, 46))
def distributed() -> Eq:
    """The inner product with the mode taken of each term: its generalised mass comes in front."""
    return Eq((M_n * solvability()[0].lhs).expand(), 0, evaluate=False)


@checks(47)
def _() -> bool:
    """Numbers: the mass in front is the inner product of a mode found by shooting with itself."""
    values = sample(47)
    (mode, *_rest) = shoot(values)
    mass = evaluate(inner_mass(phi_i, phi_i), values, {phi_i: mode})
    ratio = (distributed().lhs.subs(M_n, mass) - mass * solvability()[0].lhs).expand()
    return mass > 0 and ratio == 0


# Amplitude equation and boundary (48)-(49) ----------------------------------------------------------------------


@numbered(48, "amplitude equation", "derived", (47,))
def amplitude_equation() -> Eq:
    """The paper's equation is lost. For a parametric excitation the amplitude is driven by its own conjugate; here
    the derivative is by the time t."""
    return plain(principal().amplitude_equations[0]).subs(Symbol("Delta", real=True), epsilon * sigma)


@checks(48)
def _() -> bool:
    """Put with the expansion into the equation of motion it leaves nothing at orders 0 and 1."""
    return residual() == (0, 0) != residual(Symbol("r", real=True))


@numbered("48a", "amplitude equation of the literal route", "derived", (36, "42a"))
def forced_amplitude_equation() -> Eq:
    """What (36) gives: no conjugate amplitude, so linear growth at resonance and no boundary of stability."""
    found = plain(forced_resonance().amplitude_equations[0])
    return found.subs(Symbol("Delta", real=True), epsilon * sigma)


@checks("48a")
def _() -> bool:
    """Numbers: a forced oscillator integrated for a hundred periods against the amplitude's straight line."""
    from scipy.integrate import solve_ivp

    numbers = {omega_n: 2.0, Gamma_n: 0.8, M_n: 1.3, w_1: 0.7, epsilon: 0.01, sigma: 0}
    rate = abs(complex(forced_amplitude_equation().rhs.subs(numbers)))
    push = 0.8 / 1.3 * 0.7 * 0.01 * 2.0**2
    end = 200.0 * np.pi / 2.0
    run = solve_ivp(lambda s, q: (q[1], push * np.sin(2.0 * s) - 4.0 * q[0]), (0, end), (0, 0), rtol=1e-9, atol=1e-12)
    amplitude = np.hypot(run.y[0, -1], run.y[1, -1] / 2.0)
    return bool(abs(2 * rate * end / amplitude - 1) < 0.01)


@numbered(49, "stability boundary", "derived", (48,))
def stability_boundary() -> tuple[Eq, Eq]:
    """The amplitude of (48) grows between these two frequencies. The paper's boundary, borrowed from axially moving
    beams, does not follow from its (36); this one follows from (48)."""
    return _step("boundary")


@checks(49)
def _() -> bool:
    """Mathieu's characteristic values: the error shrinks with the square of epsilon."""
    from scipy.special import mathieu_a, mathieu_b

    errors = []
    for size in (0.02, 0.01):
        numbers = {omega_n: 1.0, P_nn: 1.0, epsilon: size}
        lower, upper = (float(side.rhs.subs(numbers)) for side in stability_boundary())
        errors.append(
            max(abs(4 / v**2 - curve(1, 2 * size / v**2)) for v, curve in ((lower, mathieu_a), (upper, mathieu_b)))
        )
    return bool(3.5 < errors[0] / errors[1] < 4.5)


@numbered("49a", "growth of the literal route", "derived", ("48a",))
def forced_measure() -> Eq:
    """What can be said instead for a base that moves across the arm: how fast the tip's amplitude grows at resonance,
    for epsilon = 1. It is a velocity, no frequency."""
    expression, _ = forced_growth()
    return Eq(Derivative(Symbol("a"), t), expression, evaluate=False)


@checks("49a")
def _() -> bool:
    """A velocity; and it does not change when the mode is scaled."""
    expression, (_, gamma, tip, mass, _) = forced_growth()
    scaled = expression.subs({gamma: 3 * gamma, tip: 3 * tip, mass: 9 * mass}, simultaneous=True)
    units = dimension(expression, {tip: Dimension()})
    return units == Dimension(m=1, s=-1) and scaled.equals(expression)


@numbered("49b", "threshold of damping", "derived", (48,))
def damping_threshold() -> Eq:
    """With a damping ratio zeta_n the amplitude grows only above this epsilon."""
    damped = principal(damped=True)
    return Eq(epsilon, plain(damped.explicit(damped.border.threshold)), evaluate=False)


@checks("49b")
def _() -> bool:
    """Numbers: the Floquet multipliers of one mode in the middle of its zone, just below and just above."""
    from cra_sym.solvers.floquet import floquet_exponents

    numbers = {omega_n: 1.0, P_nn: 1.0, zeta_n: 0.005}
    threshold = float(damping_threshold().rhs.subs(numbers))
    sizes = threshold * np.array([0.98, 1.02])
    below, above = floquet_exponents([1.0], [[[1.0]]], 2.0 - sizes**2 / 32, sizes, 0.005)[:, 0].real
    return bool(below < 0 < above)
