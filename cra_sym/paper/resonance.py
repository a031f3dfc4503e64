"""Multiple scales at a principal resonance, up to the equation of the amplitude: equations (37)-(48).

The paper's (43) and (48) are lost. The excitation here is parametric, (36a) or (36b); the paper taken literally leads
to a forced resonance, see :mod:`cra_sym.paper.literal_route`.
"""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np
from sympy import Derivative, Eq, Expr, Function, I, S, Sum, Symbol, conjugate, cos, exp, integrate, pi, roots

from cra_sym.mechanics.boundaries import general_resonance, plain
from cra_sym.mechanics.multiple_scales import MultipleScales
from cra_sym.paper.energy import generalised, inner_mass, phi_i, t, x
from cra_sym.paper.equations import Derivation, Proof, Stage, derived, numbered, proves, samples
from cra_sym.paper.evaluation import evaluate, put, termwise
from cra_sym.paper.operators import acting, named
from cra_sym.paper.oracles.shooting import sample, shoot
from cra_sym.symbols import Dimension, dimension, symbol

__all__: list[str] = []

epsilon, sigma, varpi, omega_n, T_0, T_1 = (symbol(name) for name in "epsilon sigma varpi omega_n T_0 T_1".split())
P_nn, M_n = symbol("P_nn"), symbol("M_n")


@cache
def principal(order: int = 1, *, damped: bool = False) -> MultipleScales:
    """Return multiple scales at the principal resonance of one mode among any number."""
    return general_resonance("principal", order, damped=damped)


def _step(name: str) -> Any:
    shown = principal().step(name).expression
    return tuple(map(plain, shown)) if isinstance(shown, tuple) else plain(shown)


# Expansion (37)-(43) --------------------------------------------------------------------------------------------


@numbered(37, "two-scale expansion", "assumption", ("36a", "36b"))
def two_scale_expansion() -> Any:
    """Expansion of the solution in epsilon, with terms that depend on fast and slow time."""
    return _step("expansion")


@derived(38, "derivative operators", (37,))
def derivative_operators() -> Derivation[Any]:
    """The chain rule: D_k is the derivative with respect to T_k = epsilon^k t."""
    motion, slow = Function("q_n")(T_0, T_1), epsilon * t
    rate = motion.diff(T_0) + slow.diff(t) * motion.diff(T_1)
    yield "chain rule", "A function of T_0 = t and T_1 = εt.", Eq(Derivative(motion.subs({T_0: t, T_1: slow}), t), rate)
    return _step("operators")


@derived(39, "order 0", (37, 38))
def order_0() -> Derivation[Any]:
    """Terms without epsilon."""
    yield _expanded()
    return _step("order 0")


@derived(40, "order 1", (37, 38))
def order_1() -> Derivation[Any]:
    """Terms with epsilon: the derivative by slow time and the excitation are on the right-hand side."""
    yield _expanded()
    return _step("order 1")


def _expanded() -> Stage:
    """Return the equation of motion of a mode with (37) and (38) substituted."""
    (motion,), (_, twice), system = two_scale_expansion(), derivative_operators(), principal().system
    operator = twice.rhs.subs({Symbol(name): named(name) for name in ("D_0", "D_1")})
    n, j = principal().resonance.first, system.spectator
    coupled = Sum(plain(system.p(n, j)) * (named(f"q_{j}0") + epsilon * named(f"q_{j}1")), (j, 1, system.size))
    left = (operator + omega_n**2) * motion.rhs + epsilon * cos(varpi * T_0) * coupled
    return "expansion put in", "(37) and (38) in the equation of motion of mode n.", Eq(left.expand(), 0)


@derived(41, "solution of order 0", (39,))
def order_0_solution() -> Derivation[Any]:
    """Each mode vibrates at its natural frequency; its complex amplitude A_n depends on slow time."""
    rate = Symbol("r")
    yield "exponential put in", "exp(r T_0) in (39).", Eq(rate**2 + omega_n**2, 0)
    yield "its roots", "Two, complex conjugate; so are the amplitudes.", tuple(roots(rate**2 + omega_n**2, rate))
    return _step("free vibration")


@numbered(42, "detuning", "definition")
def detuning() -> Any:
    """The paper measures the detuning from omega_n; the sources that it follows, and a parametric excitation, require 2
    omega_n, which is used here (the former is (42a)). The symbols of the paper are lost."""
    return _step("detuning")


@derived(43, "the excitation in slow time", (42,))
def excitation_in_exponentials() -> Derivation[Any]:
    """The paper's equation is lost; from (41) and (42) it can only be the excitation at the detuned frequency."""
    euler = cos(varpi * T_0).rewrite(exp)
    yield "Euler's formula", "Solved for the frequency of the excitation.", Eq(cos(varpi * T_0), euler, evaluate=False)
    return _step("excitation in exponentials")


@derived(44, "secular terms", (40, 41, 43))
def secular_terms() -> Derivation[Any]:
    """Factor of exp(i omega_n T_0) on the right of order 1."""
    written, drive = order_0_solution()[0], excitation_in_exponentials()
    right = _own_member(order_1()[0].rhs).subs(drive.lhs, drive.rhs).xreplace({written.lhs: written.rhs})
    yield "right of order 1", "(41) and (43) substituted in (40); of the sum, the term of mode n.", right.expand()
    return _step("secular terms")


@derived(45, "solvability", (44,))
def solvability() -> Derivation[Any]:
    """Order 1 has a bounded solution only if its right-hand side is orthogonal to the free vibration."""
    force, time = exp(I * omega_n * T_0), Function("q_n1")(T_0)
    swelling = -I * T_0 * force / (2 * omega_n)
    driven = Eq(time.diff(T_0, 2) + omega_n**2 * time, force)
    growth = "A force at the natural frequency of the mode gives a response that grows without bound."
    yield "what a secular term does", growth, (driven, Eq(time, swelling))
    return _step("solvability")


def residual(rate: Expr | None = None) -> tuple[Expr, Expr]:
    """Substitute the expansion in the equation of motion of a single mode; return the residuals at orders 0 and 1.

    The slow derivative of the amplitude is that of (48), or ``rate`` if given.
    """
    a, b = Function("a")(t), Function("b")(t)
    names = {named("A_n"): a, named("Abar_n"): b}
    (written,), (driven,) = order_0_solution(), principal(2).step("order-1 solution").expression
    zeroth = written.rhs.subs(T_0, t).xreplace(names)
    first = plain(driven.rhs).subs({T_0: t, T_1: epsilon * t}).xreplace(names)
    excitation = excitation_in_exponentials().rhs.subs({T_0: t, T_1: epsilon * t})
    (expanded,) = two_scale_expansion()
    q = expanded.rhs.xreplace({named("q_n0"): zeroth, named("q_n1"): first})
    motion = q.diff(t, 2) + omega_n**2 * q + epsilon * excitation * P_nn * q
    rates = _rates(a, b) if rate is None else {a: epsilon * rate, b: epsilon * conjugate(rate)}
    for f in (a, b):
        second = rates[f].diff(t).subs({g.diff(t): r for g, r in rates.items()})
        motion = motion.subs(f.diff(t, 2), second)
    motion = motion.subs({g.diff(t): r for g, r in rates.items()})
    # in slow time the phase is not a power of epsilon
    plain_motion = motion.expand().subs(epsilon * sigma * t, Symbol("phase", real=True)).expand()
    return tuple((plain_motion.coeff(epsilon, k) * exp(-I * omega_n * t)).expand() for k in (0, 1))


def _rates(a: Expr, b: Expr) -> dict[Expr, Expr]:
    """Return (48) and its conjugate for the functions a and b of t."""
    drift = amplitude_equation().rhs
    names = {Function("A_n")(t): a, Function("Abar_n")(t): b}
    forward = drift.xreplace(names)
    swapped = {a: b, b: a, I: -I}
    return {a: forward, b: forward.xreplace(swapped)}


_TIMES = {named("D_0"): T_0, named("D_1"): T_1}
_SLOW = {named("A_n"): Function("a")(T_1), named("Abar_n"): Function("b")(T_1)}


@cache
def _fields() -> dict[Symbol, Expr]:
    """Return orders 0 and 1 of a single mode, and its amplitudes, as functions of fast and slow time."""
    (zeroth,), (first,) = order_0_solution(), principal(2).step("order-1 solution").expression
    orders = {named("q_n0"): zeroth.rhs, named("q_n1"): plain(first.rhs)}
    return _SLOW | {name: order.xreplace(_SLOW) for name, order in orders.items()}


def _own_member(expression: Expr) -> Expr:
    """Return an expression with each sum over modes replaced by its term of mode n."""
    for total in expression.atoms(Sum):
        own = {s: Symbol(s.name.replace("j", "n"), **s.assumptions0) for s in total.function.free_symbols}
        expression = expression.xreplace({total: total.function.xreplace(own)})
    return expression


def _acted(expression: Expr) -> Expr:
    """Return an expression with operators for a single mode: the amplitudes of all other modes are zero."""
    expression, excitation = _own_member(expression), excitation_in_exponentials()
    return acting(expression, _fields(), _TIMES).subs(excitation.lhs, excitation.rhs)


def _left_over(equation: Eq) -> Expr:
    """Return the residual of an equation of the expansion for an amplitude that satisfies (48)."""
    a, b = _SLOW.values()
    rates = {f.diff(T_1): (rate / epsilon).subs(epsilon * t, T_1) for f, rate in _rates(a, b).items()}
    return _acted(equation.lhs - equation.rhs).subs(rates)


@proves(37)
def prove_two_scale_expansion() -> Proof:
    """For epsilon = 0 it is order 0; with (48) the equation of motion of a mode holds at orders 0 and 1."""
    yield two_scale_expansion()[0].rhs.subs(epsilon, 0) == named("q_n0")
    yield from residual()


@proves(38)
def prove_derivative_operators() -> Proof:
    """Any exponential of T_0 and T_1, and so any sum of them, differentiated once and twice as a function of t and
    epsilon t; for the second derivative the difference is of order epsilon^2."""
    fast, slow = Symbol("a"), Symbol("b")
    trial, gaps = exp(fast * T_0 + slow * T_1), []
    for order, operator in enumerate(derivative_operators(), start=1):
        applied = operator.rhs.subs({Symbol(name): named(name) for name in ("D_0", "D_1")}) * named("trial")
        found = acting(applied, {named("trial"): trial}, _TIMES)
        times = {T_0: t, T_1: epsilon * t}
        gaps.append(trial.subs(times).diff(t, order) - found.subs(times))
    yield gaps[0]
    yield gaps[1] - (epsilon * slow) ** 2 * trial.subs(times)


@proves(39)
def prove_order_0() -> Proof:
    """Its operators applied to the free vibration (41) give zero."""
    yield _left_over(order_0()[0])


@proves(40)
def prove_order_1() -> Proof:
    """Its operators applied to (41) and to the bounded first-order response give zero for amplitudes by (48)."""
    yield _left_over(order_1()[0])


@proves(41)
def prove_order_0_solution() -> Proof:
    """It is differentiated twice, and it is real: equal to its complex conjugate."""
    amplitudes = {named("A_n"): Symbol("a"), named("Abar_n"): Symbol("b")}
    swap = {Symbol("a"): Symbol("b"), Symbol("b"): Symbol("a"), I: -I}
    solution = order_0_solution()[0].rhs.xreplace(amplitudes)
    yield solution.xreplace(swap) - solution
    yield solution.diff(T_0, 2) + omega_n**2 * solution
    yield solution.coeff(Symbol("a")) - exp(I * omega_n * T_0)


@proves(42)
def prove_detuning() -> Proof:
    """Dimensions; the phase of the product of excitation and conjugate motion, exp(i (varpi - omega_n) T_0), relative
    to the motion exp(i omega_n T_0) depends on slow time alone, with the rate sigma."""
    yield dimension(detuning()) == Dimension(s=-1)
    yield detuning().lhs == varpi
    angle = ((detuning().rhs - omega_n - omega_n) * T_0).expand().subs(epsilon * T_0, T_1)
    yield angle.diff(T_0)
    yield angle.diff(T_1) - sigma


@proves(43)
def prove_excitation_in_exponentials() -> Proof:
    """Euler's formula for the detuned frequency."""
    written = excitation_in_exponentials()
    yield written.lhs - cos(varpi * T_0)
    yield written.rhs - cos((detuning().rhs * T_0).expand().subs(epsilon * T_0, T_1))


@proves(44)
def prove_secular_terms() -> Proof:
    """For any other slow evolution of the amplitude, minus these terms are the residual of the equation of motion."""
    rate = Symbol("r", real=True)
    left = [term for term in residual(rate)[1].args if not any(e.args[0].has(t) for e in term.atoms(exp))]
    slow = {named("A_n"): Function("a")(t), named("Abar_n"): Function("b")(t)}
    (terms,) = secular_terms()
    shown = terms.subs(named("D_1") * named("A_n"), rate).xreplace(slow)
    yield sum(left, S.Zero) + shown.subs(T_1, Symbol("phase", real=True) / sigma)


@proves(45)
def prove_solvability() -> Proof:
    """A force at the natural frequency of an oscillator gives the response t times a harmonic; the mean over one period
    of the right-hand side of (40) times exp(-i omega_n T_0) is the amplitude of that force."""
    swelling = t * exp(I * omega_n * t)
    period = 2 * pi / omega_n
    turned = (_acted(order_1()[0].rhs) * exp(-I * omega_n * T_0)).expand()
    mean = sum((integrate(term, (T_0, 0, period)) / period for term in turned.args), S.Zero)
    (condition,) = solvability()
    yield swelling.diff(t, 2) + omega_n**2 * swelling - 2 * I * omega_n * exp(I * omega_n * t)
    yield mean - _acted(condition.lhs - condition.rhs)


@numbered(46, "inner product", "definition", (6,))
def inner_product() -> Eq:
    """For complex functions on (0, L), with the masses of manipulator and end-effector; modes are orthogonal in it."""
    f, g = (Function(name)(x) for name in "fg")
    return Eq(Symbol(r"\langle f, g \rangle"), inner_mass(f, conjugate(g)).doit(integrals=False), evaluate=False)


@proves(46)
def prove_inner_product() -> Proof:
    """For functions with real and imaginary parts it is the combination of the mass products (6) of the four pairs of
    parts, the second function conjugated."""
    f, g = (Function(name)(x) for name in "fg")
    a, b, c, d = (Function(name)(x) for name in ("Re f", "Im f", "Re g", "Im g"))
    product = put(inner_product().rhs, {f: a + I * b, g: c + I * d})
    found = product.replace(conjugate, lambda e: e.xreplace({I: -I}))
    yield termwise(found - _mass(a, c) - _mass(b, d) - I * (_mass(b, c) - _mass(a, d)))


def _mass(first: Expr, second: Expr) -> Expr:
    """Return the bilinear form of two shapes whose quadratic form is the mass (6)."""
    mass = generalised()[0].rhs
    return (put(mass, {phi_i: first + second}) - put(mass, {phi_i: first - second})) / 4


@samples(46)
def sample_inner_product() -> bool:
    """Modes of a random arm, computed by shooting, are orthogonal in it."""
    f, g = Function("f"), Function("g")
    values, (one, two, *_rest) = sample(46), shoot(sample(46))
    real = inner_product().rhs.replace(conjugate, lambda e: e)
    gram = np.array([[evaluate(real, values, {f(x): a, g(x): b}) for a in (one, two)] for b in (one, two)])
    return bool(abs(gram[0, 1]) < 1e-8 * np.sqrt(gram[0, 0] * gram[1, 1]))


@derived(47, "solvability, term by term", (45, 46))
def distributed() -> Derivation[Eq]:
    """Inner product of each term with the mode; its generalised mass is a common factor."""
    factor = Symbol("c")
    alone = inner_mass(factor * phi_i, phi_i).doit(integrals=False)
    yield "one term", "The inner product (46) of c times a mode with that mode is c times its mass (6).", alone
    return Eq((M_n * solvability()[0].lhs).expand(), 0, evaluate=False)


@proves(47)
def prove_distributed() -> Proof:
    """For the explicit shape x^2, the inner products (46) of every term of (45) times the shape with the shape add up
    to (47), with M_n the mass (6) of that shape."""
    f, g, factor, shape = Function("f")(x), Function("g")(x), Symbol("c"), x**2
    mass = put(generalised()[0].rhs, {phi_i: shape}).doit()
    product = put(inner_product().rhs, {f: factor * shape, g: shape}).replace(conjugate, lambda e: e).doit()
    (before,), after = solvability(), distributed()
    total = sum((product.subs(factor, term) for term in (before.lhs - before.rhs).expand().args), S.Zero)
    yield (total - (after.lhs - after.rhs).subs(M_n, mass)).expand() == 0


# Amplitude equation (48) ----------------------------------------------------------------------------------------


@derived(48, "amplitude equation", (47,))
def amplitude_equation() -> Derivation[Eq]:
    """The paper's equation is lost. For a parametric excitation the rate of the amplitude contains its complex
    conjugate; here the derivative is by the time t."""
    rate, condition = named("D_1") * named("A_n"), solvability()[0].lhs
    slow = -condition.coeff(rate, 0) if condition.coeff(rate, 0) != 0 else condition
    yield (
        "slow derivative",
        "(47) solved for the rate; the mass of the mode cancels.",
        Eq(rate, slow / condition.coeff(rate)),
    )
    return plain(principal().amplitude_equations[0]).subs(Symbol("Delta", real=True), epsilon * sigma)


@proves(48)
def prove_amplitude_equation() -> Proof:
    """With the expansion, the residual of the equation of motion vanishes at orders 0 and 1; with any other rate it
    does not."""
    yield from residual()
    yield residual(Symbol("r", real=True)) != (0, 0)
