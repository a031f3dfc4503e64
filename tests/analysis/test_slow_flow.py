"""Multiple scales of nonlinear modal equations: closed forms, and orders of accuracy against the numbers."""

from __future__ import annotations

import numpy as np
import pytest
import sympy as sp
from scipy.integrate import solve_ivp

import cra_sym as cra
from tests.nonlinear_models import inextensible, oscillator, q, t, x

F = sp.Function("F")(t)
MIXED = q.diff(t) ** 2 / 2 - q**2 / 2 - q**3 / 3 - q**4 / 2  # C = 1, K = 1
PUSHED = {"virtual_work": [(F, q, None)]}


def order(errors, ratio):
    """Return the observed orders of errors at sizes that fall by a ratio."""
    return np.log(np.array(errors[:-1]) / np.array(errors[1:])) / np.log(ratio)


def test_backbone_coefficients_of_the_inextensible_arm():
    flow = inextensible().model.slow_flow(("free", 2))
    omega, big_j, big_k = sp.symbols("omega_2 J_2222 K_2222", real=True)
    assert (
        sp.expand(
            flow.backbone.xreplace({s: sp.Symbol(s.name, real=True) for s in flow.backbone.free_symbols})
            - (3 * big_k / (4 * omega) - big_j * omega / 4)
        )
        == 0
    )
    for mode, coefficient in ((1, 0.27261), (2, -568.88), (3, -13814.8)):
        flow = inextensible().model.slow_flow(("free", mode))
        value = flow.backbone.subs(cra.slow_flow_values(flow, inextensible()))
        np.testing.assert_allclose(float(value), coefficient, rtol=2e-5)


def test_quadratic_terms_act_through_the_second_order():
    """omega + (3 K/(4 omega) - 5 C^2/(12 omega^3)) a^2, and the next term is of order a^4."""
    flow = oscillator(MIXED).slow_flow(("free", 1))
    system = oscillator(MIXED).at({})
    bend = float(flow.backbone.subs(cra.slow_flow_values(flow, system)))
    np.testing.assert_allclose(bend, 3 / 4 - 5 / 12, rtol=1e-12)
    sizes = 0.1 / 2.0 ** np.arange(4)
    curve = cra.backbone(system, energy=sizes**2 / 2, modes=1)
    a = np.abs(curve.coefficients[:, 0, curve.multiples.index(1)])
    errors = np.abs(curve.angular_frequency - 1 - bend * a**2)
    assert (np.abs(order(errors, 2.0) - 4) < 0.3).all()
    assert [step.name for step in flow.steps][-2:] == ["secular terms", "amplitude equations"]


def beyond(bend, curve):
    """Return how far a backbone of frequency 1 at rest is from what slow flow says of its first harmonic."""
    size = np.abs(curve.coefficients[:, 0, curve.multiples.index(1)])
    guess = sp.lambdify(sp.Symbol("a", positive=True), bend)(size)
    return np.abs(curve.angular_frequency - 1 - guess * size**2)


@pytest.mark.parametrize(
    "lagrangian",
    [
        MIXED - q**5 / 5 - q**6 / 6,
        q.diff(t) ** 2 * (1 + q + q**2 - q**4 / 2) / 2 - q**2 / 2 - q**4 / 3,
    ],
)
def test_second_order_leaves_the_sixth_power_of_the_amplitude(lagrangian):
    model = oscillator(lagrangian)
    system, flow = model.at({}), model.slow_flow(("free", 1), order=2)
    bend = flow.backbone.subs(cra.slow_flow_values(flow, system))
    curve = cra.backbone(system, energy=(0.16 / 2.0 ** np.arange(3)) ** 2 / 2, modes=1, harmonics=15)
    assert (np.abs(order(beyond(bend, curve), 2.0) - 6) < 0.5).all()


def test_second_order_of_duffing_and_of_two_modes_by_hand():
    """omega + 3 alpha a^2/(8 omega) - 15 alpha^2 a^4/(256 omega^3) with alpha = 2 K; and r that q drives by q^2 r."""
    flow = oscillator(q.diff(t) ** 2 / 2 - q**2 / 2 - q**4 / 4).slow_flow(("free", 1), order=2)
    omega, big_k, a = sp.Symbol("omega_1", positive=True), sp.Symbol("K_1111", real=True), sp.Symbol("a", positive=True)
    known = 3 * big_k / (4 * omega) - 15 * big_k**2 * a**2 / (64 * omega**3)
    assert sp.expand(flow.backbone - known) == 0
    model = pair(1.0, 2.6, lambda q, r: q**2 * r)
    flow, system = model.slow_flow(("free", 1), order=2, modes=2), model.at({})
    bend = flow.backbone.subs(cra.slow_flow_values(flow, system))
    curve = cra.backbone(system, energy=(0.4 / 2.0 ** np.arange(3)) ** 2 / 2, modes=2, harmonics=10)
    assert (np.abs(order(beyond(bend, curve), 2.0) - 6) < 0.5).all()
    assert [step.name for step in flow.steps][-2:] == ["frequency", "amplitude equations"]


def steady(flow, system, symbols, sigma, start):
    """Return the positive amplitudes that the response equation has near a start."""
    a = sp.Symbol("a", positive=True)
    values = cra.slow_flow_values(flow, system) | {sp.Symbol(n, real=True): value for n, value in symbols.items()}
    difference = (flow.response.lhs - flow.response.rhs).subs(values).subs(sp.Symbol("sigma", real=True), sigma)
    return float(sp.nsolve(difference / a, a, start))


@pytest.mark.parametrize("kind", ["principal", "primary"])
def test_excited_amplitudes_converge_with_the_size_of_the_excitation(kind):
    """P, c and detuning of order e and amplitudes of order sqrt(e): the relative error is of order e."""
    k = sp.Symbol("k", positive=True)
    lagrangian = q.diff(t) ** 2 / 2 - k * q**2 / 2 - q**4 / 2
    model = oscillator(lagrangian, **PUSHED)
    errors = []
    for e in (0.08, 0.04, 0.02):
        system = model.at({k: 1.0}, zeta=0.1 * e)
        if kind == "principal":
            states = cra.steady_states(
                system, 2 + 0.4 * e, excitation=cra.Fluctuation(k=1.0), epsilon=e, modes=1, period=2, harmonics=7
            )
            guess = steady(model.slow_flow((1, 1)), system, {"P_11": e}, 0.4 * e, np.sqrt(0.6 * e))
        else:
            force = 0.5 * e**1.5
            states = cra.steady_states(system, 1 + 0.4 * e, drive={F: force}, modes=1)
            guess = steady(model.slow_flow(1), system, {"f_1": force}, 0.4 * e, np.sqrt(1.1 * e))
        first = states[-1].coefficients[0]
        h = (first.size - 1) // 2
        errors.append(abs(np.hypot(first[1], first[h + 1]) / guess - 1))
    assert (np.abs(order(errors, 2.0) - 1) < 0.35).all(), errors


@pytest.mark.parametrize(("kind", "factor"), [("superharmonic", 3), ("superharmonic", 2), ("subharmonic", 3)])
def test_super_and_subharmonic_amplitudes_converge(kind, factor):
    lagrangian = q.diff(t) ** 2 / 2 - q**2 / 2 - (q**3 / 3 if factor == 2 else q**4 / 2)
    model = oscillator(lagrangian, **PUSHED)
    flow = model.slow_flow((kind, 1, factor))
    errors = []
    for size in (0.02, 0.01, 0.005) if factor == 2 else (0.2, 0.1, 0.05):  # of the force, and of what it causes
        small = size if factor == 2 else size**2
        system = model.at({}, zeta=0.05 * small if kind == "superharmonic" else 0.002 * small)
        sigma = {"superharmonic": 0.3, "subharmonic": 3.0}[kind] * small
        varpi = (1 + sigma) / factor if kind == "superharmonic" else 3 + sigma
        period, number = (1, factor) if kind == "superharmonic" else (3, 1)
        states = cra.steady_states(system, varpi, drive={F: size}, modes=1, period=period, harmonics=3 * factor)
        answers = [state.coefficients[0] for state in states]
        h = 3 * factor
        found = np.array([np.hypot(c[number], c[h + number]) for c in answers])
        guess = steady(flow, system, {"f_1": size}, sigma, found.max())
        errors.append(np.abs(found / guess - 1).min())
    assert errors[-1] < 0.05 and errors[0] > errors[1] > errors[2], errors


def pair(first, second, coupling):
    r = sp.Function("r")(t)
    kinetic = (q.diff(t) ** 2 + r.diff(t) ** 2) / 2
    lagrangian = kinetic - first**2 * q**2 / 2 - second**2 * r**2 / 2 - coupling(q, r)
    return cra.Model(0, fields=(), coordinates=[q, r], x=x, domain=(0, 1), t=t, left=lagrangian)


@pytest.mark.parametrize(
    ("factor", "coupling"),
    [(2, lambda q, r: q**2 * r), (3, lambda q, r: q**3 * r), (1, lambda q, r: q**2 * r**2)],
)
def test_internal_resonance_exchanges_energy_as_time_integration_says(factor, coupling):
    model = pair(1.0, factor + 0.001, coupling)
    system, flow = model.at({}), model.slow_flow(("internal", 1, 2, factor))
    values = cra.slow_flow_values(flow, system)
    sigma = sp.Symbol("sigma", real=True)
    amplitude = [equation.lhs.args[0] for equation in flow.amplitude_equations]
    names, conj = sp.symbols("z_1:3"), sp.symbols("w_1:3")
    put = {sp.conjugate(a): w for a, w in zip(amplitude, conj, strict=True)} | dict(zip(amplitude, names, strict=True))
    time = sp.Symbol("t", real=True)
    rates = [e.rhs.xreplace(put).subs({**values, sigma: 0.001}) for e in flow.amplitude_equations]
    rate = sp.lambdify((time, *names, *conj), rates)
    size = {2: 0.02, 3: 0.15, 1: 0.1}[factor]
    start = np.array([size, 0.4 * size], complex)
    last = {2: 60.0, 3: 60.0, 1: 200.0}[factor]

    def slow(at, z):
        return np.array(rate(at, *z, *z.conj()))

    run = solve_ivp(slow, (0, last), start, rtol=1e-9, atol=1e-12)
    energy = (np.array([1.0, factor + 0.001])[:, None] ** 2 * np.abs(run.y) ** 2).sum(axis=0)
    assert np.ptp(energy) < 2e-3 * energy[0]  # conserved but for the detuning
    whole = cra.nonlinear_modal_equations(system, 2).polynomials

    def full(_, y):
        force = whole.derivatives(y[None, :2], y[None, 2:]).force[0]
        return np.append(y[2:], force - whole.omega**2 * y[:2])

    end = solve_ivp(full, (0, last), np.append(2 * start.real, [0.0, 0.0]), method="DOP853", rtol=1e-10, atol=1e-13)
    modal = np.hypot(end.y[:2, -1], end.y[2:, -1] / whole.omega) / 2
    np.testing.assert_allclose(np.abs(run.y[:, -1]), modal, atol=0.06 * size)
    assert factor == 1 or abs(np.abs(run.y[0, -1]) / size - 1) > 0.02  # energy did go


@pytest.mark.parametrize(
    ("resonance", "options", "message"),
    [
        (("free", 1), {"order": 3}, "order = 3: must be an integer from 1 to 2"),
        (1, {"order": 2}, r"resonance = 1: must be \('free', n\) with order = 2"),
        (("sideways", 1), {}, "resonance = .* must be a mode n"),
        (("internal", 1, 1, 2), {}, "resonance"),
        (("superharmonic", 1, 1), {}, "factor 1 must be at least 2"),
        ((1, 2, 3), {}, "resonance"),
        (0, {}, "resonance"),
        (2, {"modes": 1}, "modes = 1"),
    ],
)
def test_bad_resonances_are_named(resonance, options, message):
    with pytest.raises(ValueError, match=message):
        oscillator(MIXED).slow_flow(resonance, **options)
