"""Amplitude equations against those of oscilate, another implementation of multiple scales."""

from __future__ import annotations

import sympy as sp
from oscilate.MMS import Dynamical_system, Multiple_scales_oscillator, scale_parameters

import cra_sym as cra
from tests.nonlinear_models import oscillator, q, t, x

TIME = sp.Symbol("t", real=True)
ONE, TWO = (sp.Function(name, real=True)(TIME) for name in ("one", "two"))
FIRST, SECOND, SMALL = sp.symbols("omega_1 omega_2 epsilon", positive=True)
SQUARE, CUBE, DAMPING, FORCE = sp.symbols("square cube damping force", real=True)
AMPLITUDES, PHASE = sp.symbols("A B"), sp.Symbol("phase")  # the phase stands for exp(i sigma t)
LINEAR = ONE.diff(TIME, 2) + 2 * DAMPING * ONE.diff(TIME) + FIRST**2 * ONE
F, r = sp.Function("F")(t), sp.Function("r")(t)


def without_phase(expression, sigma):
    return expression.replace(lambda e: isinstance(e, sp.exp) and e.has(sigma), lambda _: PHASE)


def theirs(equations, scaling, order, force=None, about=1, ratios=None):
    """Return the rates of the amplitudes by oscilate, without its scaling."""
    unknowns, omegas = [ONE, TWO][: len(equations)], [FIRST, SECOND][: len(equations)]
    system = Dynamical_system(TIME, unknowns, equations, omegas, F=FORCE if force else 0, fF=force)
    _, scaled = scale_parameters(list(scaling), list(scaling.values()), SMALL)
    detunings = [0] * len(unknowns) if ratios else 0
    scales = Multiple_scales_oscillator(
        system, SMALL, order, FIRST, scaled, ratio_omegaMMS=about, ratio_omega_osc=ratios, detunings=detunings
    )
    scales.apply_MMS()
    plain = {sp.Symbol(rf"\tilde{{{s.name}}}", **s.assumptions0): s for s in scaling}
    named = dict(zip(scales.coord.A, AMPLITUDES, strict=False))
    found = []
    for secular, amplitude in zip(scales.sol.sec, named, strict=True):
        (rate,) = sp.solve(secular[order], amplitude.diff(scales.tS[order]))
        found.append(without_phase(rate, scales.sigma).xreplace(plain).subs(named))
    return found


def ours(model, resonance, values):
    """Return the rates of the amplitudes of the slow flow, in the symbols of the equations of motion."""
    equations = model.slow_flow(resonance).amplitude_equations
    named = dict(zip((equation.lhs.args[0] for equation in equations), AMPLITUDES, strict=False))
    found = []
    for equation in equations:
        plain = {s: values.get(s.name, s) for s in equation.rhs.free_symbols}
        found.append(without_phase(equation.rhs, sp.Symbol("sigma", real=True)).xreplace(plain).subs(named))
    return found


def same(mine, other):
    for one, two in zip(mine, other, strict=True):
        assert sp.expand(one - two) == 0, (one, two)


def test_primary_resonance_with_quadratic_and_cubic_terms():
    model = oscillator(q.diff(t) ** 2 / 2 - q**2 / 2 - q**3 / 3 - q**4 / 4, virtual_work=[(F, q, None)])
    values = {"omega_1": FIRST, "C_111": SQUARE, "K_1111": CUBE / 2, "c_1": DAMPING, "f_1": FORCE}
    equation = LINEAR + SQUARE * ONE**2 + CUBE * ONE**3
    same(ours(model, 1, values), theirs([equation], {DAMPING: 2, SQUARE: 1, CUBE: 2, FORCE: 2}, 2, [1]))


def test_principal_parametric_resonance():
    model = oscillator(q.diff(t) ** 2 / 2 - q**2 / 2 - q**4 / 4)
    values = {"omega_1": FIRST, "K_1111": CUBE / 2, "c_1": DAMPING, "P_11": FORCE}
    equation = LINEAR + CUBE * ONE**3
    same(ours(model, (1, 1), values), theirs([equation], {DAMPING: 1, CUBE: 1, FORCE: 1}, 1, [-ONE], about=2))


def test_internal_resonance_of_one_to_two():
    energy = q.diff(t) ** 2 / 2 + r.diff(t) ** 2 / 2 - q**2 / 2 - 2 * r**2 - q**2 * r
    model = cra.Model(0, fields=(), coordinates=[q, r], x=x, domain=(0, 1), t=t, left=energy)
    values = {"omega_1": FIRST, "omega_2": SECOND, "C_112": SQUARE, "c_1": 0, "c_2": 0}
    first = ONE.diff(TIME, 2) + FIRST**2 * ONE + 2 * SQUARE * ONE * TWO
    second = TWO.diff(TIME, 2) + SECOND**2 * TWO + SQUARE * ONE**2
    mine = [rate.subs({PHASE: 1, SECOND: 2 * FIRST}) for rate in ours(model, ("internal", 1, 2, 2), values)]
    other = theirs([first, second], {SQUARE: 1}, 1, ratios=[1, 2])
    same(mine, [rate.subs(SECOND, 2 * FIRST) for rate in other])
