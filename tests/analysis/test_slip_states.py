"""Steady states with elastic-slip elements against integration from event to event."""

from __future__ import annotations

import numpy as np
import pytest
import sympy as sp
from scipy.integrate import solve_ivp

import cra_sym as cra
from cra_sym.symbols import L, t, v, x
from tests.nonlinear_models import oscillator, q
from tests.slip_reference import Structure, integrated

F = sp.Function("F")(t)
k, alpha = sp.symbols("k alpha")
K, SPRING, SLIP, ZETA = 1.0, 0.5, 0.2, 0.01


def sliding(**options):
    lagrangian = q.diff(t) ** 2 / 2 - k * q**2 / 2 - alpha * q**4 / 4
    element = (cra.Jenkins(SPRING, SLIP), q, None)
    return oscillator(lagrangian, virtual_work=[(F, q, None)], hysteresis=[element], **options)


def mass(alpha=0.0, zeta=ZETA):
    return sliding().at({"k": K, "alpha": alpha}, zeta=zeta)


def start_of(state, frequency, limit):
    """Return displacement and velocity at the phase 0, and the slider after a period in small steps."""
    harmonics = state.coefficients[0].size // 2
    cosines, sines = np.split(state.coefficients[0], [harmonics + 1])
    order = np.arange(harmonics + 1)
    start = np.array([cosines.sum(), frequency * (order[1:] * sines).sum()])
    phase = 2 * np.pi * np.linspace(0, 1, 4001)[:, None]
    places, slider = np.cos(phase * order) @ cosines + np.sin(phase * order[1:]) @ sines, 0.0
    for u in np.tile(places, 2):
        slider = min(max(slider, u - limit), u + limit)
    return start, slider


# one mass ----------------------------------------------------------------------------------------------------------


def test_thirty_force_levels_are_those_of_integration_by_events():
    generator = np.random.default_rng(22)
    system, slipping = mass(), 0
    for level in np.geomspace(0.01, 2.0, 30):
        frequency = generator.uniform(0.7, 1.4)
        (state,) = cra.steady_states(system, frequency, drive={F: level}, modes=1)
        stuck = level / abs(K + SPRING - frequency**2 + 2j * ZETA * np.sqrt(K) * frequency)
        if stuck <= SLIP / SPRING:  # a transient may leave an offset; the answer has none
            np.testing.assert_allclose(state.amplitude, stuck, rtol=1e-12)
            assert state.loss == 0
            continue
        referee = Structure.one_mass(np.sqrt(K), ZETA, SPRING, SLIP, level, frequency)
        np.testing.assert_allclose(state.amplitude, referee.periodic()[2], rtol=1e-6)
        assert state.stable and state.error_modes < 1e-9 and state.error_harmonics < 1e-6
        slipping += 1
    assert slipping >= 12


def test_resonance_peak_falls_and_rises_with_the_force():
    """Little force: stuck. Much: the spring alone. Between them friction damps, best where the peak is lowest."""
    peaks, stuck_at = [], np.sqrt(K + SPRING) * np.sqrt(1 - 2 * ZETA**2 / 1.5)  # where the stuck amplitude is largest
    frequencies = np.sort(np.append(np.linspace(0.96, 1.24, 22), stuck_at))
    for level in np.geomspace(0.004, 3.0, 8):
        states = cra.steady_states(mass(), frequencies, drive={F: level}, modes=1, harmonics=7)
        assert all(len(answers) == 1 for answers in states)
        peaks.append(max(answers[0].amplitude for answers in states) / level)
    lowest = int(np.argmin(peaks))
    assert 0 < lowest < 7 and (np.diff(peaks[: lowest + 1]) < 1e-9).all() and (np.diff(peaks[lowest:]) > 0).all()
    stuck = 1 / (2 * ZETA * np.sqrt(K) * np.sqrt(K + SPRING - ZETA**2 * K))
    np.testing.assert_allclose(peaks[0], stuck, rtol=1e-9)
    assert peaks[lowest] < 0.15 * peaks[0] and peaks[-1] > 4 * peaks[lowest]


def test_multipliers_are_those_of_the_map_over_a_period():
    level, frequency, step = 0.4, 1.1, 1e-6
    (state,) = cra.steady_states(mass(), frequency, drive={F: level}, modes=1)
    referee = Structure.one_mass(np.sqrt(K), ZETA, SPRING, SLIP, level, frequency)
    place, slider, _ = referee.periodic()
    columns = []
    for move in np.eye(3) * step:
        (one, z_one), (other, z_other) = (
            referee.run(place + sign * move[:2], slider + sign * move[2], 0.0, 2 * np.pi / frequency)[:2]
            for sign in (1, -1)
        )
        columns.append(np.append(one - other, z_one - z_other) / (2 * step))
    values = np.linalg.eigvals(np.array(columns).T)
    wanted = values[np.argsort(-np.abs(values))][:2]
    np.testing.assert_allclose(np.abs(state.multipliers), np.abs(wanted), rtol=1e-5)
    np.testing.assert_allclose(np.sort_complex(state.multipliers), np.sort_complex(wanted), rtol=1e-5)


def test_loss_is_the_work_of_the_force_less_that_of_the_damper():
    level, frequency = 0.6, 1.05
    (state,) = cra.steady_states(mass(), frequency, drive={F: level}, modes=1)
    c = state.coefficients[0]
    h = np.arange(1, c.size // 2 + 1)
    cosines, sines = c[1 : h.size + 1], c[h.size + 1 :]
    supplied = np.pi * level * sines[0]
    damped = 2 * ZETA * np.sqrt(K) * np.pi * frequency * (h**2 * (cosines**2 + sines**2)).sum()
    np.testing.assert_allclose(state.loss, supplied - damped, rtol=1e-9)


def test_polynomial_terms_and_friction_together():
    level, frequency = 0.35, 1.3
    states = cra.steady_states(mass(alpha=0.8), frequency, drive={F: level}, modes=1, harmonics=31)
    assert states and all(state.error_harmonics < 1e-6 for state in states)

    def acceleration(time, place, speed):
        return level * np.cos(frequency * time) - 2 * ZETA * speed - K * place - 0.8 * place**3

    for state in (s for s in states if s.stable):
        place, slider = start_of(state, frequency, SLIP / SPRING)
        for _ in range(2):  # it closes upon itself
            place, slider, largest = integrated(acceleration, SPRING, SLIP, place, slider, 2 * np.pi / frequency)
            np.testing.assert_allclose(state.amplitude, largest, rtol=1e-6)


def stepped(states, sliders, number, load, frequency):
    """Move two masses with three elements over a period in small steps; states (4, columns), sliders (3, columns)."""
    stiffness = np.array([[4.0, -3.0], [-3.0, 3.0]])
    springs, limits, rows = TWO_SPRINGS[:, None], (TWO_SLIPS / TWO_SPRINGS)[:, None], TWO_ROWS
    h = 2 * np.pi / frequency / number

    def dragged(x, z):
        return np.clip(z, rows @ x - limits, rows @ x + limits)

    def acceleration(time, x, v, z):
        force = np.array([[load * np.cos(frequency * time)], [0.0]]) - stiffness @ x - 0.1 * v
        return (force - rows.T @ (springs * (rows @ x - z))) / np.array([[1.0], [2.0]])

    x, v = states[:2], states[2:]
    for k in range(number):
        half_x = x + h / 2 * v
        half_v = v + h / 2 * acceleration(k * h, x, v, sliders)
        middle = dragged(half_x, sliders)
        new = x + h * half_v
        v = v + h * acceleration((k + 0.5) * h, half_x, half_v, middle)
        x, sliders = new, dragged(new, middle)
    return np.concatenate([x, v]), sliders


TWO_SPRINGS, TWO_SLIPS = np.array([2.0, 1.0, 0.7]), np.array([0.3, 0.6, 0.2])
TWO_ROWS = np.array([[0.0, 1.0], [0.0, 1.0], [1.0, -1.0]])


def test_several_elements_on_two_displacements_and_their_multipliers():
    one, two = sp.Function("q_1")(t), sp.Function("q_2")(t)
    lagrangian = (one.diff(t) ** 2 + 2 * two.diff(t) ** 2 - one**2 - 3 * (two - one) ** 2) / 2
    places = (two, two, one - two)
    elements = [
        (cra.Jenkins(a, b), u, None) for a, b, u in zip(TWO_SPRINGS.tolist(), TWO_SLIPS.tolist(), places, strict=True)
    ]
    work = [(F - 0.1 * one.diff(t), one, None), (-0.1 * two.diff(t), two, None)]
    system = cra.Model(
        0, fields=(), coordinates=[one, two], x=x, domain=(0, 1), t=t, left=lagrangian, virtual_work=work,
        hysteresis=elements,
    ).at({})  # fmt: skip
    load, frequency, number = 0.9, 0.8, 4000
    (state,) = cra.steady_states(system, frequency, drive={F: load}, modes=2, field=two)
    found, sliders = np.zeros((4, 1)), np.zeros((3, 1))
    for _ in range(25):
        found, sliders = stepped(found, sliders, 400, load, frequency)
    for _ in range(3):
        found, sliders = stepped(found, sliders, number, load, frequency)
    modes = system.without_hysteresis.modes(2)
    shapes = np.stack([modes.coordinate(0), modes.coordinate(1)])
    harmonics = state.coefficients.shape[1] // 2
    np.testing.assert_allclose(shapes @ state.coefficients[:, : harmonics + 1].sum(axis=1), found[:2, 0], atol=2e-4)
    moves = 1e-5 * np.concatenate([np.eye(7), -np.eye(7)], axis=1)
    limits = (TWO_SLIPS / TWO_SPRINGS)[:, None]
    start = found + moves[:4]
    held = np.clip(sliders + moves[4:], TWO_ROWS @ start[:2] - limits, TWO_ROWS @ start[:2] + limits)
    end = np.concatenate(stepped(start, held, number, load, frequency))
    values = np.linalg.eigvals((end[:, :7] - end[:, 7:]) / 2e-5)
    wanted = values[np.argsort(-np.abs(values))][:4]
    assert state.stable and state.loss > 0 and np.abs(values).max() > 0.05
    np.testing.assert_allclose(np.abs(state.multipliers), np.abs(wanted), atol=3e-3)


def test_stiff_elements_are_led_to_from_soft_ones():
    """A spring 500 times as stiff as the rest: starts with everything stuck or nothing stuck lie too far away."""
    one, two = sp.Function("q_1")(t), sp.Function("q_2")(t)
    lagrangian = (one.diff(t) ** 2 + 2 * two.diff(t) ** 2 - one**2 - 3 * (two - one) ** 2) / 2
    frequency, spring, slip, load = 0.8, 500.0, 0.3, 0.45
    work = [(F - 0.02 * one.diff(t), one, None), (-0.02 * two.diff(t), two, None)]
    system = cra.Model(
        0, fields=(), coordinates=[one, two], x=x, domain=(0, 1), t=t, left=lagrangian, virtual_work=work,
        hysteresis=[(cra.Jenkins(spring, slip), two, None)],
    ).at({})  # fmt: skip
    (state,) = cra.steady_states(system, frequency, drive={F: load}, modes=2, field=one, harmonics=31)
    stiffness = np.array([[4.0, -3.0], [-3.0, 3.0]])
    referee = Structure(
        np.diag([1.0, 2.0]), 0.02 * np.eye(2), stiffness, np.array([0.0, 1.0]), spring, slip, load * np.array([1.0, 0]),
        frequency,
    )  # fmt: skip
    modes = system.without_hysteresis.modes(2)
    shapes = np.stack([modes.coordinate(0), modes.coordinate(1)])
    order = np.arange(state.coefficients.shape[1] // 2 + 1)
    cosines, sines = np.split(state.coefficients, [order.size], axis=1)
    start = np.concatenate([shapes @ cosines.sum(axis=1), frequency * shapes @ (sines * order[1:]).sum(axis=1)])
    phase = 2 * np.pi * np.linspace(0, 2, 40001)[:, None]
    along, slider = shapes[1] @ (cosines @ np.cos(phase * order).T + sines @ np.sin(phase * order[1:]).T), 0.0
    for u in along:
        slider = min(max(slider, u - slip / spring), u + slip / spring)
    end, _, _ = referee.run(start, slider, 0.0, 2 * np.pi / frequency)
    assert state.stable and state.loss > 0
    # corners of the force: 31 harmonics leave 3e-3 of the motion, 127 leave 3e-6 and take longer
    np.testing.assert_allclose(end, start, atol=5e-3 * np.abs(start).max())


# inside a tongue ---------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("epsilon", "published"), [(0.1, 0.217), (0.2, 0.238), (0.4, 0.299)])
def test_friction_bounds_what_grows_inside_a_tongue(epsilon, published):
    """At twice the frequency of the stuck mass rest is unstable, and slip bounds the motion."""
    system = sliding().replace(hysteresis=[(cra.Jenkins(SPRING, 0.1), q, None)]).at({"k": K, "alpha": 0.0})
    varpi = 2 * np.sqrt(K + SPRING)
    options = {"excitation": cra.Fluctuation(k=1.0), "epsilon": epsilon, "modes": 1, "period": 2}
    rest, *bounded = cra.steady_states(system, varpi, **options)
    assert rest.amplitude == 0 and not rest.stable
    growth = np.log(np.abs(rest.multipliers[0])) / (4 * np.pi / varpi)
    linear = cra.growth_rate(system, cra.Fluctuation(k=1.0), varpi, epsilon, modes=1)
    np.testing.assert_allclose(growth, linear, rtol=1e-6)
    assert len(bounded) == 2 and all(state.stable for state in bounded)
    np.testing.assert_allclose([state.amplitude for state in bounded], published, atol=6e-4)
    place, slider = np.array([0.3, 0.0]), 0.1

    def acceleration(time, x, _):
        return -K * (1 + epsilon * np.cos(varpi * time)) * x

    if epsilon == 0.4:
        for _ in range(60):
            place, slider, largest = integrated(acceleration, SPRING, 0.1, place, slider, 4 * np.pi / varpi)
        np.testing.assert_allclose(bounded[0].amplitude, largest, rtol=1e-5)


def test_friction_holds_below_a_threshold_where_the_free_mass_would_grow():
    """At twice the frequency of the slipping mass: rest is stable, and beyond an unstable motion nothing holds."""
    system = sliding().replace(hysteresis=[(cra.Jenkins(SPRING, 0.1), q, None)]).at({"k": K, "alpha": 0.0})
    options = {"excitation": cra.Fluctuation(k=1.0), "epsilon": 0.2, "modes": 1, "period": 2}
    rest, *threshold = cra.steady_states(system, 2 * np.sqrt(K), **options)
    assert rest.stable and threshold and not any(state.stable for state in threshold)

    def acceleration(time, x, _):
        return -K * (1 + 0.2 * np.cos(2 * time)) * x

    state = threshold[0]
    start, held = start_of(state, 1.0, 0.2)
    ends = []
    for share in (0.98, 1.02):
        place, slider = share * start, share * held
        for _ in range(16):
            place, slider, largest = integrated(acceleration, SPRING, 0.1, place, slider, 2 * np.pi)
        ends.append(largest)
    assert ends[0] < 0.8 * state.amplitude < 1.3 * state.amplitude < ends[1]


def test_excitation_of_the_lagrangian_itself():
    """A spring that pulsates in the Lagrangian is one that fluctuates, with elements beside it."""
    epsilon, varpi = sp.symbols("epsilon varpi")
    element = (cra.Jenkins(SPRING, 0.1), q, None)
    pulsating = q.diff(t) ** 2 / 2 - (1 + epsilon * sp.cos(varpi * t)) * q**2 / 2
    model = oscillator(pulsating, hysteresis=[element], small=(epsilon, varpi))
    options = {"epsilon": 0.2, "modes": 1, "period": 2, "harmonics": 9}
    own = cra.steady_states(model.at({}), 2.45, excitation=model.excitation, **options)
    other = oscillator(q.diff(t) ** 2 / 2 - k * q**2 / 2, hysteresis=[element]).at({"k": 1.0})
    fluctuating = cra.steady_states(other, 2.45, excitation=cra.Fluctuation(k=1.0), **options)
    assert len(own) == 3
    for one, two in zip(own, fluctuating, strict=True):
        np.testing.assert_allclose(one.amplitude, two.amplitude, rtol=1e-9)


# a beam ------------------------------------------------------------------------------------------------------------


def clamped_elements(number):
    """Return mass and stiffness of a clamped beam, E I = rho A = L = 1, on Hermite elements of this test's own."""
    h, size = 1.0 / number, 2 * number + 2
    mass, stiffness = np.zeros((size, size)), np.zeros((size, size))
    m = (
        h
        / 420
        * np.array(
            [
                [156, 22 * h, 54, -13 * h],
                [22 * h, 4 * h**2, 13 * h, -3 * h**2],
                [54, 13 * h, 156, -22 * h],
                [-13 * h, -3 * h**2, -22 * h, 4 * h**2],
            ]
        )
    )
    s = (
        np.array(
            [
                [12, 6 * h, -12, 6 * h],
                [6 * h, 4 * h**2, -6 * h, 2 * h**2],
                [-12, -6 * h, 12, -6 * h],
                [6 * h, 2 * h**2, -6 * h, 4 * h**2],
            ]
        )
        / h**3
    )
    for k in range(number):
        part = np.ix_(range(2 * k, 2 * k + 4), range(2 * k, 2 * k + 4))
        mass[part] += m
        stiffness[part] += s
    return mass[2:, 2:], stiffness[2:, 2:]


@pytest.mark.parametrize("level", [3.0, 8.0])
def test_clamped_beam_with_an_element_at_its_tip(level):
    """Against a time integration of finite elements, with the same damping ratios of the modes without the element."""
    zeta, frequency, spring, slip = 0.02, 5.0, 30.0, 3.0
    beam = cra.Model(
        v.diff(t) ** 2 / 2 - v.diff(x, 2) ** 2 / 2, fields=[v], x=x, domain=(0, L), t=t,
        essential=[v.subs(x, 0), v.diff(x).subs(x, 0)], virtual_work=[(F, v, "right")],
        hysteresis=[(cra.Jenkins(spring, slip), v, "right")],
    ).at({"L": 1.0}, zeta=zeta)  # fmt: skip
    (state,) = cra.steady_states(beam, frequency, drive={F: level}, modes=5)
    whole, stiff = clamped_elements(10)
    omega, shapes = np.linalg.eig(np.linalg.solve(whole, stiff))
    shapes = shapes / np.sqrt(np.einsum("ij,ik,kj->j", shapes, whole, shapes))
    damping = whole @ shapes @ np.diag(2 * zeta * np.sqrt(omega)) @ shapes.T @ whole
    tip = np.zeros(len(whole))
    tip[-2] = 1.0
    referee = Structure(whole, damping, stiff, tip, spring, slip, level * tip, frequency)
    assert state.stable and state.loss > 0
    np.testing.assert_allclose(state.amplitude, referee.settled(250), rtol=1e-4)  # the error of the elements


def test_stiff_elements_are_the_limit_of_regularised_friction_on_a_beam():
    """Coulomb's force at the tip is that of tanh(velocity/e), e to 0, and that of a stiff Jenkins element."""
    zeta, frequency, friction, level = 0.1, 4.0, 1.0, 4.0
    beam = cra.Model(
        v.diff(t) ** 2 / 2 - v.diff(x, 2) ** 2 / 2, fields=[v], x=x, domain=(0, L), t=t,
        essential=[v.subs(x, 0), v.diff(x).subs(x, 0)], virtual_work=[(F, v, "right")],
        hysteresis=[(cra.Jenkins(k, friction), v, "right")],
    ).at({"L": 1.0, "k": [100.0, 1600.0]}, zeta=zeta)  # fmt: skip
    options = {"drive": {F: level}, "modes": 3, "harmonics": 31}
    soft, firm = (cra.steady_states(one, frequency, **options)[0] for one in beam.parameter_sets)
    whole, stiff = clamped_elements(4)
    squares, shapes = np.linalg.eig(np.linalg.solve(whole, stiff))
    kept = np.argsort(squares)[:3]
    omega, tip = np.sqrt(squares[kept]), shapes[-2, kept]
    tip = tip / np.sqrt(np.einsum("ij,ik,kj->j", shapes, whole, shapes))[kept]

    def rate(time, y):
        force = level * np.cos(frequency * time) - friction * np.tanh(tip @ y[3:] / 0.02)
        return np.concatenate([y[3:], tip * force - 2 * zeta * omega * y[3:] - omega**2 * y[:3]])

    # transients fall below exp(-0.1 * 3.5 * 16 * 1.57) = 2e-4; 0.02 is 1/500 of the velocity
    times = 2 * np.pi / frequency * np.linspace(16.0, 17.0, 101)
    run = solve_ivp(rate, (0, times[-1]), np.zeros(6), "LSODA", times, rtol=1e-6, atol=1e-8)
    gaps = [state.amplitude / np.abs(tip @ run.y[:3]).max() - 1 for state in (soft, firm)]
    # a stop takes of the order of the period on the element, k_d^-1/2; omitted modes give as an element of 4e3 would
    assert gaps[0] > 2 * gaps[1] > 0 and gaps[1] < 1e-2 and soft.stable and firm.stable
    for state, stiffness in (
        (soft, 100.0),
        (firm, 1600.0),
    ):  # between two reversals a period the loss is that of a loop
        assert state.loss == pytest.approx(4 * friction * (state.amplitude - friction / stiffness), rel=1e-3)


# refused -----------------------------------------------------------------------------------------------------------


def test_what_is_refused():
    k_d = sp.Symbol("k_d")
    model = sliding().replace(hysteresis=[(cra.Jenkins(k_d, 0.1), q, None)])
    system = model.at({"k": K, "alpha": 0.0, "k_d": 0.5})
    with pytest.raises(ValueError, match="k_d is of an elastic-slip element, which must not fluctuate"):
        cra.steady_states(system, 2.0, excitation=cra.Fluctuation(k_d=1.0), epsilon=0.1, modes=1)
    with pytest.raises(ValueError, match="has elastic-slip elements, which are not polynomials"):
        cra.nonlinear_modal_equations(system, 1)
    with pytest.raises(ValueError, match="which have no slow flow"):
        model.slow_flow((1, 1))
    with pytest.raises(ValueError, match="batch shape"):
        cra.steady_states(system.replace(k_d=[0.5, 1.0]), 2.0, drive={F: 1.0}, modes=1)
    with pytest.raises(ValueError, match="harmonics = 200"):
        cra.steady_states(system, 2.0, drive={F: 1.0}, modes=1, harmonics=200)
