"""Steady states: counted, against closed forms, time integration, Floquet theory and Hill's method."""

from __future__ import annotations

import numpy as np
import pytest
import sympy as sp
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

import cra_sym as cra
from cra_sym.solvers.hill import hill_exponents
from tests.nonlinear_models import BEAM, EI, beam, k_3, mass, oscillator, q, t, v

k, alpha, gamma, eta = sp.symbols("k alpha gamma eta", positive=True)
F = sp.Function("F")(t)


def parametron(**changes):
    lagrangian = q.diff(t) ** 2 / 2 - k * q**2 / 2 - alpha * q**4 / 4
    work = [(-gamma * q.diff(t) - eta * q**2 * q.diff(t), q, None)]
    values = {"k": 1.0, "alpha": 1.0, "gamma": 0.01, "eta": 0.3}
    return oscillator(lagrangian, virtual_work=work).at({**values, **changes})


def settled(rate, start, period, periods, samples=4001):
    """Return the largest displacement over the last period of an integration."""
    run = solve_ivp(rate, (0, periods * period), start, method="DOP853", rtol=1e-11, atol=1e-13)
    last = np.linspace(0, period, samples)
    end = solve_ivp(rate, (0, period), run.y[:, -1], method="DOP853", t_eval=last, rtol=1e-11, atol=1e-13)
    return np.abs(end.y[0]).max()


# the parametron ---------------------------------------------------------------------------------------------------


def test_parametron_has_one_three_and_five_states():
    counts, stable = [], []
    for varpi in (0.98, 1.0, 1.02, 1.05):
        states = cra.steady_states(
            parametron(), 2 * varpi, excitation=cra.Fluctuation(k=1.0), epsilon=0.05, modes=1, harmonics=1, period=2
        )
        counts.append(len(states))
        stable.append(sum(state.stable for state in states))
    assert counts == [1, 3, 5, 5] and stable == [1, 2, 3, 3]


def test_a_chart_is_what_its_sizes_give_one_by_one():
    frequency, sizes = np.array([2.05, 1.97]), [0.03, 0.06]
    options = {"excitation": cra.Fluctuation(k=1.0), "modes": 1, "harmonics": 3, "period": 2}
    chart = cra.steady_states(parametron(), frequency, epsilon=sizes, **options)
    for size, row in zip(sizes, chart, strict=True):
        single = cra.steady_states(parametron(), frequency, epsilon=size, **options)
        for here, alone in zip(row, single, strict=True):
            np.testing.assert_allclose([s.amplitude for s in here], [s.amplitude for s in alone], rtol=1e-9)
            assert [s.stable for s in here] == [s.stable for s in alone] and {s.epsilon for s in here} == {size}
    assert [[len(here) for here in row] for row in chart][1] == [5, 1]


def test_excitation_of_the_lagrangian_itself_and_a_force_together():
    """The published parametron: the spring pulsates at 2 varpi, and a force goes with varpi."""
    epsilon, varpi, push = sp.symbols("epsilon varpi push")
    pulsating = (1 - epsilon * sp.cos(2 * varpi * t)) * q**2 / 2
    lagrangian = q.diff(t) ** 2 / 2 - pulsating - alpha * q**4 / 4 - push * sp.cos(varpi * t) * q
    work = [(-gamma * q.diff(t) - eta * q**2 * q.diff(t), q, None)]
    model = oscillator(lagrangian, virtual_work=work, small=(epsilon, varpi))
    system = model.at({alpha: 1.0, gamma: 0.01, eta: 0.3, push: 1e-3})
    options = {"excitation": model.excitation, "epsilon": 0.05, "modes": 1, "harmonics": 1}
    found = cra.steady_states(system, [0.98, 1.0, 1.02, 1.05], **options)
    assert [len(states) for states in found] == [1, 3, 5, 5]
    assert [sum(state.stable for state in states) for states in found] == [1, 2, 3, 3]
    assert found[0][0].amplitude > 0


def test_a_parameter_of_nonlinear_terms_may_not_fluctuate():
    with pytest.raises(ValueError, match="alpha is in nonlinear terms too"):
        cra.steady_states(
            oscillator(q.diff(t) ** 2 / 2 - alpha * q**2 / 2 - alpha * q**4).at({alpha: 1.0}),
            2.0,
            excitation=cra.Fluctuation(alpha=1.0),
            epsilon=0.1,
            modes=1,
        )


def test_amplitude_inside_the_tongue_is_that_of_time_integration():
    states = cra.steady_states(parametron(), 2.04, excitation=cra.Fluctuation(k=1.0), epsilon=0.05, modes=1, period=2)
    assert [state.stable for state in states] == [True, False, False, True, True]

    def rate(time, y):
        return [y[1], -(1 + 0.05 * np.cos(2.04 * time)) * y[0] - y[0] ** 3 - (0.01 + 0.3 * y[0] ** 2) * y[1]]

    wanted = settled(rate, [0.3, 0.0], 4 * np.pi / 2.04, 350)
    np.testing.assert_allclose(states[-1].amplitude, wanted, rtol=1e-6)
    first_order = (2.04 - 2) / 2 + np.sqrt((0.05 / 4) ** 2 - 0.005**2)  # without nonlinear damping, physics of a tongue
    assert abs(states[-1].amplitude / np.sqrt(8 / 3 * first_order) - 1) < 0.06
    assert all(state.error_harmonics < 1e-8 and state.error_modes == 0 for state in states)


def test_rest_loses_stability_where_growth_begins():
    excitation = cra.Fluctuation(k=1.0)

    def largest(varpi):
        rest = cra.steady_states(parametron(), varpi, excitation=excitation, epsilon=0.05, modes=1, period=2)[0]
        assert rest.amplitude == 0
        return np.log(np.abs(rest.multipliers[0]))

    def growth(varpi):
        return cra.floquet_exponents(linear, excitation, varpi, 0.05, 1, tolerance=1e-11)[0].real

    linear = oscillator(q.diff(t) ** 2 / 2 - k * q**2 / 2).at({"k": 1.0}, zeta=0.005)
    for low, high in ((1.95, 1.99), (2.01, 2.05)):
        edge = brentq(growth, low, high, xtol=1e-13)
        inside = 1.0 if growth(high) > 0 else -1.0
        assert largest(edge + 1e-8 * inside) > 0 > largest(edge - 1e-8 * inside)
    lower, upper = cra.stability_boundary(linear, excitation, 0.05, modes=1)
    assert abs(edge - upper) < 0.05**2 and lower < upper


def test_multipliers_are_those_of_the_monodromy_matrix_and_of_hill():
    """Three modes, with damping: integration by Runge-Kutta at an answer, and Hill's matrix at rest."""
    system = beam(right=-k_3 * v**4 / 4).at({EI: 1.0, mass: 1.0, "L": 1.0, k_3: 1.0}, zeta=0.01)
    excitation = cra.Fluctuation(EI=1.0)
    varpi, epsilon = 2 * 3.52, 0.2
    states = cra.steady_states(system, varpi, excitation=excitation, epsilon=epsilon, modes=3, period=2, harmonics=13)
    polynomials = cra.nonlinear_modal_equations(system, 3).polynomials
    coupling = np.diag(polynomials.omega**2)  # the bending stiffness fluctuates, and nothing else is elastic
    assert len(states) >= 3 and states[-1].stable

    def rate(time, y):
        n, place, speed, along = 3, y[:3], y[3:6], y[6:].reshape(6, 6)
        found = polynomials.derivatives(place[None], speed[None])
        stiff = np.diag(polynomials.omega**2) + epsilon * np.cos(varpi * time) * coupling
        matrix = np.block([[np.zeros((n, n)), np.eye(n)], [found.force_q[0] - stiff, -polynomials.damping]])
        force = found.force[0] - stiff @ place - polynomials.damping @ speed
        return np.concatenate([speed, force, (matrix @ along).ravel()])

    state = states[-1]
    h, period = (state.coefficients.shape[1] - 1) // 2, 4 * np.pi / varpi
    orders = np.arange(1, h + 1)
    start = np.concatenate(
        [
            state.coefficients[:, : h + 1].sum(axis=1),
            (state.coefficients[:, h + 1 :] * orders).sum(axis=1) * varpi / 2,
            np.eye(6).ravel(),
        ]
    )
    end = solve_ivp(rate, (0, period), start, method="DOP853", rtol=1e-11, atol=1e-13).y[:, -1]
    assert np.abs(end[:6] - start[:6]).max() < 1e-5 * state.amplitude  # mode 2 is near the sixth harmonic
    wanted = np.linalg.eigvals(end[6:].reshape(6, 6))
    gap = np.abs(state.multipliers[:, None] - wanted[None, :]).min(axis=1)
    assert gap.max() < 1e-5
    exponents = hill_exponents(polynomials.omega, coupling, varpi, epsilon, np.diag(polynomials.damping) / 2)
    gap = np.abs(states[0].multipliers[:, None] - np.exp(exponents * period)[None, :]).min(axis=1)
    assert states[0].amplitude == 0 and gap.max() < 1e-8


# driven ------------------------------------------------------------------------------------------------------------


def test_duffing_has_the_answers_of_its_cubic():
    """One harmonic is a cubic in a^2, ((1 - w^2) a + 3 a^3/4)^2 + (2 zeta w a)^2 = f^2: all its roots are there."""
    system = oscillator(q.diff(t) ** 2 / 2 - q**2 / 2 - q**4 / 4, virtual_work=[(F, q, None)]).at({}, zeta=0.02)
    frequency = np.linspace(0.7, 1.9, 25)
    states = cra.steady_states(system, frequency, drive={F: 0.1}, modes=1, harmonics=1)
    for varpi, found in zip(frequency, states, strict=True):
        d = 1 - varpi**2
        roots = np.roots([9 / 16, 1.5 * d, d**2 + (0.04 * varpi) ** 2, -0.01])
        wanted = np.sort(np.sqrt(roots[np.abs(roots.imag) < 1e-9].real))
        np.testing.assert_allclose([s.amplitude for s in found], wanted, rtol=1e-9)
    assert {len(found) for found in states} == {1, 3}


def test_helmholtz_and_van_der_pol_damping_against_time_integration():
    lagrangian = q.diff(t) ** 2 / 2 - q**2 / 2 - q**3 / 3
    work = [(F - (sp.Rational(1, 10) + q**2) * q.diff(t) / 2, q, None)]
    system = oscillator(lagrangian, virtual_work=work).at({})
    state, *beyond = cra.steady_states(system, 0.8, drive={"F": 0.05}, modes=1, harmonics=12)
    assert [other.stable for other in beyond] == [False, True, False]  # a fold, and one about the top of the barrier

    def rate(time, y):
        return [y[1], -y[0] - y[0] ** 2 - (0.05 + y[0] ** 2 / 2) * y[1] + 0.05 * np.cos(0.8 * time)]

    wanted = settled(rate, [0.15, 0.0], 2 * np.pi / 0.8, 100)
    np.testing.assert_allclose(state.amplitude, wanted, rtol=1e-6)
    assert state.stable and state.error_harmonics < 1e-6
    # damping that feeds small motions, as van der Pol's: rest is not an attractor, the forced answer locks in
    fed = oscillator(q.diff(t) ** 2 / 2 - q**2 / 2, virtual_work=[(F + (1 - q**2) * q.diff(t) / 5, q, None)]).at({})
    found = cra.steady_states(fed, 1.0, drive={F: 0.5}, modes=1, harmonics=13)
    locked = [s for s in found if s.stable]

    def fed_rate(time, y):
        return [y[1], -y[0] + 0.2 * (1 - y[0] ** 2) * y[1] + 0.5 * np.cos(time)]

    np.testing.assert_allclose(locked[-1].amplitude, settled(fed_rate, [0.1, 0.0], 2 * np.pi, 60), rtol=1e-6)


def test_without_nonlinear_terms_it_is_the_frequency_response():
    arm = cra.Arm.nominal().replace(k_t=1e4, zeta=0.01)
    w = sp.Function("w")(t)
    small = 1e-6
    (state,) = cra.steady_states(arm, 30.0, drive={w: small}, modes=12)
    response = cra.frequency_response(arm, 30.0)  # of the base's acceleration
    np.testing.assert_allclose(state.amplitude, np.abs(response) * 900.0 * small, rtol=1e-4)  # twelve modes


def test_a_base_that_shakes_along_a_shortened_arm_is_the_axial_excitation():
    """The kinetic energy (u_t - s_t)^2/2 holds (36b): its tongue is that of the excitation by name."""
    s, u = sp.Function("s")(v.args[0], t), sp.Function("u")(t)
    density = BEAM + mass * (u.diff(t) - s.diff(t)) ** 2 / 2
    options = {"quadratures": {s: v.diff(v.args[0]) ** 2 / 2}, "prescribed": [u]}
    shaken = beam(density, **options).at({EI: 1.0, mass: 1.0, "L": 1.0}, zeta=0.01)
    plain = beam().at({EI: 1.0, mass: 1.0, "L": 1.0}, zeta=0.01)
    varpi = 2 * 3.516
    states = cra.steady_states(shaken, varpi, drive={u: 0.03}, modes=2, period=2)
    exponents = cra.floquet_exponents(plain, cra.AxialBase(0.03), varpi, 1.0, 2)
    np.testing.assert_allclose(
        np.sort(np.abs(states[0].multipliers)), np.sort(np.exp(exponents.real * 4 * np.pi / varpi)), rtol=1e-7
    )
    assert states[0].amplitude == 0 and not states[0].stable and states[-1].stable


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"epsilon": 0.1}, "excitation, epsilon: both or neither"),
        ({"excitation": cra.Fluctuation(k=1.0), "epsilon": [[0.1, 0.2]]}, "epsilon has shape"),
        ({"excitation": 3, "epsilon": 0.1}, "excitation = 3: must be a Parametric"),
        ({"drive": {"G": 1.0}}, "drive: G does not drive the model"),
        ({"drive": {"F": np.nan}}, "drive: F = nan"),
        ({"period": 0}, "period = 0: must be an integer from 1"),
        ({"harmonics": 2.5}, "harmonics = 2.5"),
        ({"zeta": -1.0}, "zeta = -1.0"),
    ],
)
def test_bad_input_is_named(options, message):
    system = oscillator(q.diff(t) ** 2 / 2 - k * q**2 / 2 - q**4, virtual_work=[(F, q, None)]).at({k: 1.0})
    with pytest.raises((TypeError, ValueError), match=message):
        cra.steady_states(system, 1.0, modes=1, **options)


# responses in time ---------------------------------------------------------------------------------------------------


def test_response_of_a_nonlinear_arm_settles_on_its_steady_state():
    arm = cra.Arm.nominal().replace(k_t=1e4, k_r=1e3)
    w, v_arm = sp.Function("w")(t), arm.model.equations.fields[0]
    harder = arm.model.replace(left=cra.paper_lagrangian()[1] - k_3 * v_arm**4 / 4)
    system = harder.at({**arm.values, "k_3": 1e13}, zeta=0.1)
    varpi = 15.3
    states = cra.steady_states(system, varpi, drive={w: 0.02}, modes=1)
    (state,) = states
    times = 8.0 + np.linspace(0, 2 * np.pi / varpi, 801)
    motion = cra.BaseMotion(amplitude=0.02, angular_frequency=varpi, phase=np.pi / 2)
    tip = cra.tip_response(system, motion, times, modes=1, start="base")
    np.testing.assert_allclose(np.abs(tip).max(), state.amplitude, rtol=2e-5)  # 801 samples see the peak to 1e-5
    linear = cra.tip_response(arm.replace(zeta=0.1), motion, times, modes=1, start="base")
    assert np.abs(np.abs(linear).max() / np.abs(tip).max() - 1) > 1e-3


def test_response_in_the_rotating_frame_is_that_of_plain_integration():
    system = oscillator(q.diff(t) ** 2 * (1 + q**2) / 2 - 8 * q**2 + q**4, virtual_work=[(F, q, None)]).at(
        {}, zeta=0.03
    )
    times = np.array([3.0, 0.0, 1.1])
    found = {n: cra.tip_response(system, {F: cra.Force(1.5)}, times, modes=1, derivative=n) for n in (0, 1, 2)}

    def rate(_, y):
        pull = -16 * y[0] + 4 * y[0] ** 3 - 0.24 * y[1] + 1.5 + y[0] * y[1] ** 2
        return [y[1], (pull - 2 * y[0] * y[1] ** 2) / (1 + y[0] ** 2)]

    run = solve_ivp(rate, (0, 3), [0.0, 0.0], method="DOP853", t_eval=np.sort(times), rtol=1e-11, atol=1e-13)
    wanted = run.y[:, [2, 0, 1]]
    np.testing.assert_allclose(found[0], wanted[0], atol=1e-8)
    np.testing.assert_allclose(found[1], wanted[1], atol=1e-7)
    np.testing.assert_allclose(found[2], [rate(0, y)[1] for y in wanted.T], atol=1e-6)


def test_a_nonlinear_response_that_runs_away_or_is_a_batch_is_refused():
    system = oscillator(q.diff(t) ** 2 / 2 - q**2 / 2 + q**4, virtual_work=[(F, q, None)]).at({})
    with pytest.raises(ValueError, match="diverges"):
        cra.tip_response(system, {F: cra.Force(3.0)}, 10.0, modes=1)
    with pytest.raises(ValueError, match=r"field = F.*: must be one of q"):
        cra.tip_response(system, {F: cra.Force(0.1)}, 1.0, modes=1, field=F)
    with pytest.raises(ValueError, match="motion: must not be a batch"):
        cra.tip_response(system, {F: cra.Force([0.1, 0.2])}, 1.0, modes=1)
