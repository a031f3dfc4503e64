"""Responses against solve_ivp, energy, superposition, convergence in the modes, and the motion of the base itself."""

from itertools import pairwise
from math import sin

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import cra_sym as cra
from cra_sym import Arm, BaseMotion

NOMINAL = Arm.nominal()
GRID = np.linspace(0.0, 1.2, 97)
ANY = np.sort(np.random.default_rng(3).uniform(0.0, 1.2, 31))


def integrated(arm, motion, t, x, modes, zeta=0.0, start="inertial", breaks=()):
    """Return v, v', v'' by a Runge-Kutta method of order 8, started again at every kink of the acceleration."""
    p = cra.modal_parameters(arm, modes)
    shapes = cra.mode_shapes(arm, x, modes)
    velocity = motion.velocity(0.0) if start == "inertial" else 0.0
    state = np.concatenate([np.zeros(modes), -p.participation * velocity])
    out = np.empty((3, len(t)))

    edges = [0.0, *breaks, t[-1]]
    for left, right in pairwise(edges):
        acceleration = fast(motion, left, right, bool(len(breaks)))

        def rates(time, y, acceleration=acceleration):
            q, u = y[:modes], y[modes:]
            return np.concatenate([u, -p.participation * acceleration(time) - p.omega**2 * q - 2 * zeta * p.omega * u])

        inside = (t >= left) & ((t < right) | (right == t[-1]))
        solution = solve_ivp(
            rates, (left, right), state, "DOP853", rtol=1e-12, atol=1e-14, dense_output=True, first_step=1e-4
        )
        for k in np.flatnonzero(inside):
            y = solution.sol(t[k])
            out[:, k] = shapes @ y[:modes], shapes @ y[modes:], shapes @ rates(t[k], y)[modes:]
        state = solution.y[:, -1]
    return out


def fast(motion, left, right, linear):
    """Return the base acceleration within a segment as a function of a number; linear ones by two of their values."""
    if linear:
        times = left + (right - left) * np.array([0.25, 0.75])
        slope, level = np.polyfit(times, motion.acceleration(times), 1)
        return lambda time: level + slope * time
    mean = sum(float(term.acceleration[0]) for term in motion.terms if not hasattr(term, "phase"))
    waves = [tuple(map(float, term)) for term in motion.terms if hasattr(term, "phase")]
    return lambda time: mean - sum(B * rate**2 * sin(rate * time + phase) for B, rate, phase in waves)


OMEGA_1 = float(cra.modal_parameters(NOMINAL, 1).omega[0])


@pytest.mark.parametrize("zeta", [0.0, 0.03])
@pytest.mark.parametrize("varpi", [10.0, OMEGA_1, OMEGA_1 * (1 + 1e-9)], ids=["off", "at", "near"])
@pytest.mark.parametrize("start", ["inertial", "base"])
def test_the_closed_form_agrees_with_numerical_integration(zeta, varpi, start):
    motion = BaseMotion(0.1, 0.2, 1e-3, varpi, 0.7) + BaseMotion(amplitude=2e-4, angular_frequency=31.0)
    arm = NOMINAL.replace(zeta=zeta)
    reference = integrated(NOMINAL, motion, GRID, 1.0, 2, zeta, start)
    for order in range(3):
        found = cra.tip_response(arm, motion, GRID, 2, order, start=start)
        scattered = cra.tip_response(arm, motion, GRID[::-7], 2, order, start=start)
        assert found == pytest.approx(reference[order], abs=1e-8 * np.abs(reference[order]).max())
        assert scattered == pytest.approx(found[::-7], abs=1e-13 * np.abs(found).max())


def test_near_resonance_is_continuous_with_resonance():
    def at(varpi):
        return cra.tip_response(NOMINAL, BaseMotion(amplitude=1e-3, angular_frequency=varpi), [0.5, 3.0, 40.0])

    slope = (at(OMEGA_1 + 1e-3) - at(OMEGA_1 - 1e-3)) / 2e-3
    for gap in (1e-13, 1e-9, 1e-6):
        assert at(OMEGA_1 + gap) - at(OMEGA_1) == pytest.approx(
            slope * gap, abs=1e-3 * np.abs(slope).max() * gap + 1e-13
        )


@pytest.mark.parametrize("joint", [{"k_t": 1e3, "k_r": 0.0}, {"k_t": 0.0, "k_r": 50.0}, {"k_t": 0.0, "k_r": 0.0}])
def test_rigid_body_modes_move_like_any_other(joint):
    arm = NOMINAL.replace(**joint)
    motion = BaseMotion(0.1, 0.2, 1e-3, 10.0, 0.7)
    reference = integrated(arm, motion, ANY, 0.4, 3)
    for order in range(3):
        found = cra.response(arm, motion, ANY, 0.4, 3, order)
        assert found == pytest.approx(reference[order], abs=1e-9 * np.abs(reference[order]).max())


def test_a_loose_arm_stays_where_it_is():
    """With no joint at all the base leaves and the arm does not move: v = -(w - w(0)), every derivative of it."""
    arm = NOMINAL.replace(k_t=0.0, k_r=0.0)
    motion = BaseMotion(0.1, 0.2, 1e-3, 10.0, 0.7)
    w, velocity, acceleration = motion.kinematics(GRID)
    x = [0.0, 0.3, 1.0]
    for order, value in enumerate((w - w[0], velocity, acceleration)):
        found = cra.response(arm, motion, GRID, x, 2, order)
        assert found == pytest.approx(-np.broadcast_to(value, (3, GRID.size)), rel=1e-9, abs=1e-12)


def test_sampled_and_profiled_motions_agree_with_numerical_integration():
    t = np.linspace(0.0, 1.0, 6)
    record = BaseMotion.sampled(t, np.random.default_rng(5).normal(size=6), velocity=0.05, exact=True)
    move = BaseMotion.s_curve(0.1, 1.0, 2.0, 20.0)
    for motion, breaks in ((record, t[1:]), (move, np.unique(move.terms[0].knots.round(12))[1:])):
        for times in (GRID, ANY):
            reference = integrated(NOMINAL, motion, times, 1.0, 2, breaks=[b for b in breaks if b < times[-1]])
            for order in range(2):
                found = cra.tip_response(NOMINAL, motion, times, 2, order)
                assert found == pytest.approx(reference[order], abs=1e-9 * np.abs(reference[order]).max())


@pytest.mark.filterwarnings("ignore::cra_sym.UndersamplingWarning")
def test_a_finely_sampled_motion_approaches_the_closed_form():
    motion = BaseMotion(acceleration=0.2, amplitude=1e-3, angular_frequency=10.0, phase=0.3)
    errors = []
    for number in (200, 400):
        t = np.linspace(0, 1.2, number)
        record = BaseMotion.sampled(t, motion.acceleration(t), motion.velocity(0.0))
        error = cra.tip_response(NOMINAL, record, GRID) - cra.tip_response(NOMINAL, motion, GRID)
        errors.append(np.abs(error).max())
    assert errors[0] / errors[1] == pytest.approx(4.0, rel=0.05)


def test_superposition_and_scaling():
    parts = [BaseMotion(0.1), BaseMotion(0, 0.2), BaseMotion(0, 0, 1e-3, 10, 0.3), BaseMotion.trapezoid(0.2, 1, 2)]
    together = cra.tip_response(NOMINAL, parts[0] + parts[1] + parts[2] + 3 * parts[3], ANY)
    alone = [cra.tip_response(NOMINAL, part, ANY) for part in parts]
    assert together == pytest.approx(alone[0] + alone[1] + alone[2] + 3 * alone[3], abs=1e-14)


def test_energy_is_kept_after_the_stop_and_balanced_before():
    """Modal energy grows by the work of the inertia force and is constant once the base has stopped."""
    arm, modes = NOMINAL.replace(k_t=1e3, k_r=50.0), 3
    p = cra.modal_parameters(arm, modes)
    move = BaseMotion.s_curve(0.1, 1.0, 2.0, 20.0)
    x = np.array([0.3, 0.7, 1.0])
    t = np.linspace(0, 1.5 * move.duration, 4001)
    shapes = cra.mode_shapes(arm, x, modes)
    q, u = (np.linalg.solve(shapes.T, cra.response(arm, move, t, x, modes, order)) for order in (0, 1))
    energy = np.sum(u**2 + (p.omega[:, None] * q) ** 2, axis=0) / 2
    after = energy[t > move.duration]
    assert after == pytest.approx(after[0], rel=1e-10)
    power = -(p.participation @ u) * move.acceleration(t)
    work = np.concatenate([[0], np.cumsum((power[1:] + power[:-1]) / 2 * t[1])])
    assert work[-1] == pytest.approx(after[0], rel=1e-5)


def test_more_modes_converge_to_the_static_deflection():
    """Under a constant acceleration a damped arm comes to rest bent as statics says, the give of its joint included.

    The tip is right with few modes. The root displacement, of a stiff joint, is not: each mode adds Gamma_i^2 / k_t,
    which falls like 1/i^2 until the beam is as soft as the joint, lambda_i^3 = kappa_t.
    """
    arm, counts = NOMINAL.replace(k_t=1e5, k_r=50.0, zeta=0.3), (1, 2, 4, 8, 32)
    root = -(arm.rhoA * arm.L + arm.m_e) / arm.k_t
    turn = (arm.rhoA * arm.L**2 / 2 + arm.m_e * arm.L) / arm.k_r
    tip = root - turn * arm.L - (arm.rhoA * arm.L**4 / 8 + arm.m_e * arm.L**3 / 3) / arm.EI
    found = np.array([cra.response(arm, BaseMotion(acceleration=1.0), 60.0, [0.0, 1.0], modes) for modes in counts])
    root_error, tip_error = np.abs(found / [root, tip] - 1).T
    assert np.all(np.diff(root_error) < 0)
    assert np.all(np.diff(tip_error) < 0)
    assert root_error[2] > 0.05 > 1e-3 > tip_error[2]
    assert root_error[-1] < 1e-4
    assert tip_error[-1] < 1e-8


def test_batches_broadcast_and_single_values_drop_axes():
    arms = NOMINAL.replace(k_t=np.array([[1e3], [1e4], [np.inf]]))
    motion = BaseMotion(velocity=0.1, amplitude=[1e-3, 2e-3], angular_frequency=10.0, phase=np.pi)
    whole = cra.tip_response(arms, motion, GRID)
    assert whole.shape == (3, 2, GRID.size)
    one = cra.tip_response(NOMINAL.replace(k_t=1e4), BaseMotion(0.1, 0, 2e-3, 10.0, np.pi), GRID)
    assert whole[1, 1] == pytest.approx(one, abs=1e-15)
    assert cra.response(arms, motion, GRID, [0.0, 0.5]).shape == (3, 2, 2, GRID.size)
    assert cra.response(arms, motion, 0.3, [0.0, 0.5]).shape == (3, 2, 2)
    assert cra.response(arms, motion, 0.3, 0.5).shape == (3, 2)
    assert cra.tip_response(arms, motion, 0.3) == pytest.approx(cra.response(arms, motion, 0.3, 1.0), abs=1e-15)
    assert cra.response(arms, motion, GRID, 1.0) == pytest.approx(whole, abs=1e-15)
    assert cra.tip_response(arms, BaseMotion(), GRID).tolist() == np.zeros((3, 1, GRID.size)).tolist()
    moves = BaseMotion.s_curve(0.1, 1.0, 2.0, 20.0, duration=[[0.8, 1.0]])
    batch = cra.tip_response(arms, moves, ANY)
    single = BaseMotion.s_curve(0.1, 1.0, 2.0, 20.0, duration=1.0)
    assert batch[2, 1] == pytest.approx(cra.tip_response(NOMINAL, single, ANY), abs=1e-15)


def test_damping_may_differ_from_mode_to_mode():
    arm = NOMINAL.replace(zeta=0.02)
    motion = BaseMotion(velocity=0.1)
    same = cra.tip_response(NOMINAL, motion, GRID, 2, zeta=[0.02, 0.02])
    assert same == pytest.approx(cra.tip_response(arm, motion, GRID, 2), abs=1e-16)
    first = cra.tip_response(NOMINAL, motion, GRID, 2, zeta=[0.0, 0.9]) - cra.tip_response(NOMINAL, motion, GRID, 1)
    assert np.abs(first[GRID > 0.3]).max() < 1e-9


def test_residual_vibration_is_the_peak_after_the_stop():
    move = BaseMotion.s_curve(0.5, 1.0, 2.0, 20.0)
    after = np.linspace(move.duration, move.duration + 60, 40001)
    for zeta in (0.0, 0.01):
        arm = NOMINAL.replace(zeta=zeta)
        single = np.abs(cra.tip_response(arm, move, after, 1)).max()
        assert cra.residual_vibration(arm, move, modes=1) == pytest.approx(single, rel=1e-4)
        several = np.abs(cra.tip_response(arm, move, after)).max()
        assert several <= cra.residual_vibration(arm, move) <= 1.02 * several
        assert cra.residual_vibration(arm, move) == cra.residual_vibration(arm, move, 5), "five modes, as a response"
    strike = cra.residual_vibration(NOMINAL, BaseMotion(velocity=0.1), 1)
    p = cra.modal_parameters(NOMINAL, 1)
    assert strike == pytest.approx(0.1 * p.participation[0] * p.tip_displacement[0] / p.omega[0])


def test_residual_vibration_of_a_batch_stops_each_move_at_its_own_time():
    durations = np.array([1.2, 1.5, 2.0])
    moves = BaseMotion.s_curve(0.5, 1.0, 2.0, 20.0, duration=durations)
    arms = NOMINAL.replace(k_t=np.array([[1e3], [np.inf]]), zeta=0.02)
    found = cra.residual_vibration(arms, moves)
    assert found.shape == (2, 3)
    single = BaseMotion.s_curve(0.5, 1.0, 2.0, 20.0, duration=1.5)
    assert found[1, 1] == pytest.approx(cra.residual_vibration(NOMINAL.replace(zeta=0.02), single))


def test_a_pinned_arm_is_left_behind_by_a_move():
    arm = NOMINAL.replace(k_r=0.0, k_t=1e3)
    left = cra.residual_vibration(arm, BaseMotion.s_curve(0.5, 1.0, 2.0, 20.0), modes=1)
    p = cra.modal_parameters(arm, 1)
    assert left == pytest.approx(0.5 * p.participation[0] * p.tip_displacement[0])
    assert cra.residual_vibration(arm, BaseMotion(velocity=0.1), modes=1) == np.inf


@pytest.mark.parametrize(
    ("arguments", "error", "words"),
    [
        ({"t": [-1.0]}, ValueError, r"t\[0\] = -1"),
        ({"t": [[0.1]]}, ValueError, "one axis of times"),
        ({"x": 1.5}, ValueError, "x = 1.5"),
        ({"x": [[0.1]]}, ValueError, "one axis of places"),
        ({"modes": 0}, ValueError, "modes = 0"),
        ({"derivative": 3}, ValueError, "derivative = 3"),
        ({"start": "moving"}, ValueError, "start = 'moving'"),
        ({"zeta": 1.0}, ValueError, "zeta = 1"),
        ({"zeta": -0.05}, ValueError, "zeta = -0.05"),
        ({"zeta": [0.1, 0.2]}, ValueError, "zeta"),
        ({"motion": 3.0}, TypeError, "motion = 3.0"),
        (
            {"motion": BaseMotion([1.0, 2.0]), "system": NOMINAL.replace(k_t=[1, 2, 3])},
            ValueError,
            r"broadcast together: system \(3,\), motion \(2,\)",
        ),
    ],
)
def test_bad_input_is_named(arguments, error, words):
    good = {"system": NOMINAL, "motion": BaseMotion(0.1), "t": GRID, "x": 0.5, "modes": 3}
    with pytest.raises(error, match=words):
        cra.response(**(good | arguments))


def test_residual_vibration_needs_a_stop():
    with pytest.raises(ValueError, match="never stops"):
        cra.residual_vibration(NOMINAL, BaseMotion(acceleration=0.1))


def test_a_slow_mode_vibrates_after_the_stop_too():
    """However slow, it is not a rigid-body mode: what is left is the largest displacement of the next period."""
    arm, move = Arm.nominal().replace(k_t=0.02), BaseMotion.trapezoid(0.5, 1.0, 2.0)
    omega = cra.modal_parameters(arm, 1).omega[0]
    assert omega < 0.5
    t = move.duration + np.linspace(0, 2 * np.pi / omega, 2001)
    largest = np.abs(cra.tip_response(arm, move, t, modes=1)).max()
    assert cra.residual_vibration(arm, move, modes=1) == pytest.approx(largest, rel=1e-5)
