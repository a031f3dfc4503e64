"""The derivation as a chain of steps in textbook order; every expression is taken from the expansion."""

from __future__ import annotations

from typing import Any

from sympy import Derivative, Eq, Expr, Function, I, Poly, S, Sum, Symbol, cos, exp

from cra_sym.mechanics.harmonics import Harmonics
from cra_sym.mechanics.parametric import Label
from cra_sym.mechanics.stability_condition import DETUNING, Border
from cra_sym.mechanics.steady_response import SteadyResponse
from cra_sym.mechanics.steps import Step, Steps
from cra_sym.mechanics.two_scales import (
    D0,
    D1,
    D2,
    EPSILON,
    SIGMA,
    TwoScaleExpansion,
    amplitude,
    conjugate_amplitude,
    derivatives,
)

__all__ = ["derivation"]

T0, T1, T2, TIME = (Symbol(name, real=True) for name in ("T_0", "T_1", "T_2", "t"))
VARPI = Symbol("varpi", positive=True)


def derivation(e: TwoScaleExpansion, edge: Border | None, response: SteadyResponse | None) -> Steps:
    """Return the steps from the expansion to the boundary or, for a forced resonance, to the steady response."""
    steps = [*_problems(e), *_first_order(e)]
    if e.order == 2:
        steps += _second_order(e)
    steps.append(_amplitude_equations(e))
    if edge is not None:
        steps += _stability(e, edge)
    if response is not None:
        steps.append(
            Step(
                "steady response",
                "Amplitude and phase are steady where the free part of the amplitude equation balances the drive.",
                (response.curve, response.backbone),
                ("amplitude equations",),
                "numerical integration of the equation of motion",
            )
        )
    return Steps(steps)


# writing the pieces -----------------------------------------------------------------------------------------------


def _q(i: Label, k: int) -> Symbol:
    return Symbol(f"q_{i}{k}", commutative=False)


def _operator(k: int) -> Symbol:
    """Return D_k as a prefix of its operand."""
    return Symbol(f"D_{k}", commutative=False)


def _written(e: TwoScaleExpansion, part: Harmonics) -> Expr:
    """Write a sum of harmonics, with the unknown rates of the amplitudes as D_k A."""
    named: dict[Symbol, Expr] = {}
    for a in (f(i) for i in e.system.rows for f in (amplitude, conjugate_amplitude)):
        shown = Symbol(a.name, commutative=False)
        named |= {Symbol(f"D{k}_{a}"): _operator(k) * shown for k in (1, 2)} | {a: shown}
    phase = SIGMA * (T1, T2)[e.scale - 1]
    return part.expression(e.system.omegas, T0, phase).xreplace(e.receptances).xreplace(named)


def _apply(operator: Expr, f: Expr) -> Expr:
    """Write a polynomial in D0, D1, D2 in front of a field."""
    total = S.Zero
    for powers, factor in Poly(operator, D0, D1, D2).terms():
        for k, power in enumerate(powers):
            factor *= _operator(k) ** power
        total += factor * f
    return total


def _coupling(e: TwoScaleExpansion, i: Label, k: int) -> Expr:
    system = e.system
    if system.coupling is None:
        return S.Zero
    if system.spectator is None:
        total = sum((system.p(i, j) * _q(j, k) for j in system.rows), S.Zero)
    else:
        total = Sum(system.p(i, system.spectator) * _q(system.spectator, k), (system.spectator, 1, system.size))
    return cos(VARPI * T0) * total


def _problem(e: TwoScaleExpansion, i: Label, k: int) -> Eq:
    """Write the equation of order k for mode i."""
    system, once, twice = e.system, derivatives(1), derivatives(2)
    left = _apply(D0**2, _q(i, k)) + system.omega(i) ** 2 * _q(i, k)
    right = sum((_apply(-twice[k - l], _q(i, l)) for l in range(k)), S.Zero)
    right -= (
        2
        * e.decay(i)
        / EPSILON**e.scale
        * sum((_apply(once[k - e.scale - l], _q(i, l)) for l in range(k - e.scale + 1)), S.Zero)
    )
    if k >= 1:
        right -= _coupling(e, i, k - 1)
    if k == 2 and e.scale == 1 and system.coupling_slope is not None:
        slopes = sum((system.slope(i, j) * _q(j, 0) for j in e.resonance.modes), S.Zero)
        right -= SIGMA * cos(VARPI * T0) * slopes
    if k == 1 and system.force(i) != 0:
        force = e.excitation.terms
        half = system.force(i) / 2
        right += sum((half if p == 1 else half.conjugate()) * exp(I * p * VARPI * T0) for _, p in force)
    if k == 1:
        right -= system.gamma(i) * _q(i, 0) ** 3
    return Eq(left, right, evaluate=False)


def _modes(e: TwoScaleExpansion) -> tuple[Label, ...]:
    """Return the modes written out in the steps: those of the resonance."""
    return e.resonance.modes


# the steps --------------------------------------------------------------------------------------------------------


def _problems(e: TwoScaleExpansion) -> list[Step]:
    powers = range(e.order + 1)
    shown = [Eq(Symbol(f"q_{i}", commutative=False), sum(EPSILON**k * _q(i, k) for k in powers)) for i in _modes(e)]
    d, d2 = Symbol(r"\frac{d}{dt}"), Symbol(r"\frac{d^2}{dt^2}")
    kept = [sum(derivatives(p)[k] * EPSILON**k for k in powers) for p in (1, 2)]
    return [
        Step(
            "expansion",
            "A solution is sought that depends on the fast time T_0 = t and on the slow times T_k = epsilon^k t.",
            tuple(shown),
            (),
            "the amplitude equations against Floquet theory",
        ),
        Step(
            "operators",
            "By the chain rule each time scale has a derivative of its own, D_k = d/dT_k.",
            (Eq(d, kept[0], evaluate=False), Eq(d2, kept[1], evaluate=False)),
            ("expansion",),
            "square of the first",
        ),
        Step(
            "order 0",
            "The terms without epsilon: free, undamped modes.",
            tuple(_problem(e, i, 0) for i in _modes(e)),
            ("expansion", "operators"),
            "its solution put back",
        ),
        Step(
            "order 1",
            "The terms with epsilon: order 0 drives order 1 through the slow derivative, damping and the excitation.",
            tuple(_problem(e, i, 1) for i in _modes(e)),
            ("expansion", "operators"),
            "its solution put back",
        ),
    ]


def _first_order(e: TwoScaleExpansion) -> list[Step]:
    r, system = e.resonance, e.system
    phase = SIGMA * (T1, T2)[e.scale - 1]
    centre = r.combine(system.omega(r.first), system.omega(r.second))
    excitation = e.excitation.expression(system.omegas, T0, phase)
    secular = {i: _written(e, part) for i, part in e.secular[0].items() if i in r.modes}
    return [
        Step(
            "free vibration",
            "Each mode vibrates at its own frequency with a complex amplitude that depends on slow time only.",
            tuple(Eq(_q(i, 0), _written(e, e.free(i)), evaluate=False) for i in _modes(e)),
            ("order 0",),
            "put back into order 0",
        ),
        Step(
            "detuning",
            "The excitation frequency is close to the exact resonance; sigma measures how close.",
            Eq(VARPI, centre + EPSILON**e.scale * SIGMA, evaluate=False),
            (),
            "",
        ),
        Step(
            "excitation in exponentials",
            "With the detuning, the excitation is a harmonic of natural frequencies whose phase drifts in slow time.",
            Eq(cos(VARPI * T0), excitation, evaluate=False),
            ("detuning",),
            "Euler's formula",
        ),
        Step(
            "secular terms",
            "On the right of order 1, these multiply exp(i omega T_0) of the mode itself and would grow without bound.",
            tuple(secular.values()),
            ("order 1", "free vibration", "excitation in exponentials"),
            "",
        ),
        Step(
            "solvability",
            "Order 1 has a bounded solution only if they vanish.",
            tuple(Eq(part, 0, evaluate=False) for part in secular.values()),
            ("secular terms",),
            "",
        ),
    ]


def _second_order(e: TwoScaleExpansion) -> list[Step]:
    solution = tuple(Eq(_q(i, 1), _written(e, e.fields[1][i]), evaluate=False) for i in _modes(e))
    secular = tuple(Eq(_written(e, part), 0, evaluate=False) for part in e.secular[1].values())
    sums = tuple(Eq(s.symbol, s.total, evaluate=False) for s in e.sums)
    return [
        Step(
            "order-1 solution",
            "What is left drives a bounded response of every mode at the combination frequencies.",
            solution,
            ("order 1", "solvability"),
            "put back into order 1",
        ),
        Step(
            "order 2",
            "The terms with epsilon^2.",
            tuple(_problem(e, i, 2) for i in _modes(e)),
            ("expansion", "operators"),
            "",
        ),
        Step(
            "sums over modes",
            "The excitation brings the order-1 response of every mode back to the resonant modes' own frequencies.",
            sums,
            ("order-1 solution", "order 2"),
            "a system of two modes written out",
        ),
        Step(
            "second-order solvability",
            "The secular terms of order 2 vanish too; D1 squared follows from the first solvability.",
            secular,
            ("order 2", "sums over modes", "solvability"),
            "",
        ),
    ]


def _amplitude_equations(e: TwoScaleExpansion) -> Step:
    of_time = {a: Function(a.name)(TIME) for j in _modes(e) for a in (amplitude(j), conjugate_amplitude(j))}
    shown: list[Any] = []
    for a in map(amplitude, _modes(e)):
        total: Expr = S.Zero
        for k, rates in enumerate(e.rates, start=1):
            part = rates[a].expression(e.system.omegas, T0, DETUNING * TIME)
            total += EPSILON**k * part.subs(SIGMA, DETUNING / EPSILON**e.scale)
        shown.append(Eq(Derivative(of_time[a], TIME), total.expand().xreplace(of_time), evaluate=False))
    return Step(
        "amplitude equations",
        "Solved for the slow derivatives, which together make up the derivative with respect to time.",
        tuple(shown),
        ("solvability",) if e.order == 1 else ("solvability", "second-order solvability"),
        "Floquet exponents",
    )


def _stability(e: TwoScaleExpansion, edge: Border) -> list[Step]:
    r, system = e.resonance, e.system
    centre = r.combine(system.omega(r.first), system.omega(r.second))
    sides = tuple(Eq(VARPI, centre + edge.centre + s * edge.half_width, evaluate=False) for s in (-1, 1))
    steps = [
        Step(
            "rotating frame",
            "In a frame that turns with Delta, varpi minus the exact resonance, the equations are autonomous.",
            edge.matrix,
            ("amplitude equations",),
            "",
        ),
        Step(
            "stability condition",
            "Rest is stable where this is positive: no exponent of the matrix has a positive real part.",
            edge.condition,
            ("rotating frame",),
            "eigenvalues of the matrix at sampled numbers",
        ),
        Step(
            "boundary",
            "The condition is zero on the two sides of the zone of instability.",
            sides,
            ("stability condition", "detuning"),
            "Floquet multipliers; Mathieu's characteristic values",
        ),
    ]
    if edge.threshold != 0:
        shown = Eq(EPSILON, edge.threshold, evaluate=False)
        steps.append(
            Step(
                "threshold",
                "Below this epsilon damping prevents any growth.",
                shown,
                ("boundary",),
                "Floquet multipliers",
            )
        )
    return steps
