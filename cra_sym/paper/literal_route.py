"""The paper's words of the stability analysis taken literally: a forced resonance, equations (42a), (48a) and (49a)."""

from __future__ import annotations

from sympy import Derivative, Eq, I, Symbol, cos, exp, pi, solve

from cra_sym.mechanics.boundaries import forced_growth, forced_resonance, plain
from cra_sym.paper.energy import t
from cra_sym.paper.equations import Derivation, Proof, derived, numbered, proves
from cra_sym.paper.excited import excited_system
from cra_sym.symbols import Dimension, dimension, symbol

__all__: list[str] = []

epsilon, sigma, varpi, omega_n, M_n, Gamma_n, T_0, T_1 = (
    symbol(n) for n in "epsilon sigma varpi omega_n M_n Gamma_n T_0 T_1".split()
)


@numbered("42a", "detuning from the natural frequency", "definition")
def forced_detuning() -> Eq:
    """The paper taken literally: the detuning that the forced system (36) requires."""
    return plain(forced_resonance().step("detuning").expression)


@proves("42a")
def prove_forced_detuning() -> Proof:
    """Dimensions; the phase of the excitation exp(i varpi T_0) relative to the motion exp(i omega_n T_0) depends on
    slow time alone, with the rate sigma."""
    yield dimension(forced_detuning()) == Dimension(s=-1)
    yield forced_detuning().lhs == varpi
    angle = ((forced_detuning().rhs - omega_n) * T_0).expand().subs(epsilon * T_0, T_1)
    yield angle.diff(T_0)
    yield angle.diff(T_1) - sigma


@derived("48a", "amplitude equation of the literal route", (36, "42a"))
def forced_amplitude_equation() -> Derivation[Eq]:
    """The result of (36): no conjugate amplitude, so linear growth at resonance and no stability boundary."""
    for step in forced_resonance().steps:
        if step.name in ("order 1", "secular terms", "solvability"):
            yield step.name, step.statement, tuple(map(plain, step.expression))
    found = plain(forced_resonance().amplitude_equations[0])
    return found.subs(Symbol("Delta", real=True), epsilon * sigma)


@proves("48a")
def prove_forced_amplitude_equation() -> Proof:
    """At resonance the amplitude grows in proportion to time, and the motion of the mode with this amplitude balances
    the force of (36). Away from resonance its phase rotates with the detuning."""
    drift = forced_amplitude_equation().rhs
    motion = 2 * drift.subs(sigma, 0) * t * cos(omega_n * t)
    force = excited_system().rhs.xreplace({symbol("Gamma_i"): Gamma_n}).subs(varpi, omega_n)
    yield M_n * (motion.diff(t, 2) + omega_n**2 * motion) - force
    yield drift - drift.subs(sigma, 0) * exp(I * epsilon * sigma * t)


@derived("49a", "growth of the literal route", ("48a",))
def forced_measure() -> Derivation[Eq]:
    """The corresponding result for a base that moves transversely: the rate of growth of the tip amplitude at
    resonance, for epsilon = 1. It is a velocity, not a frequency."""
    yield (
        "at resonance",
        "Without detuning the amplitude grows at a constant rate.",
        forced_amplitude_equation().subs(sigma, 0),
    )
    expression, _ = forced_growth()
    return Eq(Derivative(Symbol("a"), t), expression, evaluate=False)


@proves("49a")
def prove_forced_measure() -> Proof:
    """It is a velocity and does not depend on the normalisation of the mode; its square is that of the tip for the
    motion t times a harmonic that balances the force of (36) at resonance."""
    expression, (_, gamma, tip, mass, _) = forced_growth()
    shown = forced_measure().rhs
    yield forced_measure().lhs == Derivative(Symbol("a"), t)
    yield dimension(shown, {tip: Dimension()}) == Dimension(m=1, s=-1)
    yield shown - expression
    yield shown - shown.subs({gamma: 3 * gamma, tip: 3 * tip, mass: 9 * mass}, simultaneous=True)
    rate = Symbol("r")
    motion = rate * t * cos(omega_n * t)
    force = excited_system().rhs.xreplace({symbol("Gamma_i"): gamma}).subs(varpi, omega_n) / epsilon
    balance = (mass * (motion.diff(t, 2) + omega_n**2 * motion) - force).subs(t, pi / (2 * omega_n))
    (needed,) = solve(balance, rate)
    yield shown**2 - (needed * tip) ** 2
