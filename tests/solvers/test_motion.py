"""Base motions: kinematics, limits of point-to-point moves, sampled records, sums, and every bad input named."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from cra_sym.solvers.force import Force
from cra_sym.solvers.motion import BaseMotion


def test_mean_motion_and_disturbance_follow_equation_33():
    motion = BaseMotion(0.1, 0.3, 1e-3, 10.0, 0.4)
    t = np.linspace(0, 2, 7)
    w, v, a = motion.kinematics(t)
    assert w == pytest.approx(0.1 * t + 0.15 * t**2 + 1e-3 * np.sin(10 * t + 0.4))
    assert v == pytest.approx(0.1 + 0.3 * t + 1e-2 * np.cos(10 * t + 0.4))
    assert a == pytest.approx(0.3 - 0.1 * np.sin(10 * t + 0.4))
    plain = BaseMotion(amplitude=1e-3, angular_frequency=10.0)
    assert plain.displacement(t) == pytest.approx(1e-3 * np.sin(10 * t))
    assert not BaseMotion(0.1, angular_frequency=10.0, phase=0.4).acceleration(t).any()


def test_what_is_not_given_is_nothing():
    t = np.linspace(0, 2, 5)
    np.testing.assert_allclose(BaseMotion(amplitude=2.0, phase=np.pi / 2).kinematics(t)[:2], [[2.0] * 5, [0.0] * 5])
    assert BaseMotion.sampled([0.0, 1.0], [3.0, 3.0]).velocity(0.0) == 0.0
    assert Force(2.0, angular_frequency=3.0, phase=1.0)(t) == pytest.approx(2.0)


def test_a_sum_is_a_superposition_and_an_array_is_a_batch():
    first, second = BaseMotion(velocity=0.1), BaseMotion(amplitude=[1e-3, 2e-3], angular_frequency=10.0)
    total = 2.0 * (first + second)
    assert total.shape == (2,)
    assert total.displacement(0.3) == pytest.approx(2 * (first.displacement(0.3) + second.displacement(0.3)))
    assert total.velocity([0.0, 1.0]).shape == (2, 2)


def test_velocity_and_way_are_integrals():
    """Simpson's rule is exact on every piece of a record, of a move and of their delayed copies, and before them."""
    record = BaseMotion.sampled(
        np.linspace(0.4, 1.6, 5), [[0.7, -0.2, 1.1, 0.3, 0.9], np.ones(5)], velocity=[0.2, -0.3]
    )
    move = BaseMotion.s_curve([0.5, -0.8], 0.4, 1.0, 4.0).shaped([0.3, 0.7], [0.0, 0.37])
    for motion in (record, move, BaseMotion([0.3, 0.1], -0.6), 3.0 * record + move):
        knots = [np.ravel(term.knots) for term in motion.terms]
        ends = np.unique(np.round(np.concatenate([[0.0, 3.0], *knots]), 12))
        left, right = ends[:-1] + 1e-9, ends[1:] - 1e-9  # to either side of a jump of acceleration
        (w_0, v_0, a_0), (_, v_m, a_m), (w_1, v_1, a_1) = map(motion.kinematics, (left, (left + right) / 2, right))
        np.testing.assert_allclose(w_1 - w_0, (right - left) / 6 * (v_0 + 4 * v_m + v_1), atol=1e-13)
        np.testing.assert_allclose(v_1 - v_0, (right - left) / 6 * (a_0 + 4 * a_m + a_1), atol=1e-13)
        np.testing.assert_allclose(motion.displacement(0.0), 0.0, atol=0.0)
        np.testing.assert_allclose(w_1[:, :-1], w_0[:, 1:], atol=1e-8)
        np.testing.assert_allclose(v_1[:, :-1], v_0[:, 1:], atol=1e-8)


def test_the_fastest_move_is_at_one_of_its_limits_all_the_time():
    """Pontryagin: jerk, acceleration or velocity sits at its limit in every phase, whichever of them are reached."""
    reached = set()
    for v_max, a_max, j_max in np.array(np.meshgrid([0.1, 1.0, 30.0], [0.5, 3.0, 50.0], [2.0, 40.0, 900.0])).T.reshape(
        -1, 3
    ):
        move = BaseMotion.s_curve(0.8, v_max, a_max, j_max)
        (piece,) = move.terms
        phases = np.nonzero(np.diff(piece.knots) > 1e-9)[0]
        _, v, a = move.kinematics((piece.knots[phases] + piece.knots[phases + 1]) / 2)
        at = np.isclose(np.abs([piece.jerk[phases], a, v]), np.array([[j_max], [a_max], [v_max]]), rtol=1e-9)
        assert at.any(axis=0).all()
        assert piece.jerk[-1] == piece.acceleration[-1] == 0.0
        reached.add(tuple(at.any(axis=1)[1:]))
    assert len(reached) == 4  # limits of acceleration and of velocity: each of the four cases has come up


@settings(max_examples=60, deadline=None, derandomize=True)
@given(
    st.floats(1e-3, 5.0),
    st.floats(1e-2, 5.0) | st.just(np.inf),
    st.floats(1e-2, 50.0),
    st.floats(1e-1, 1e4) | st.just(np.inf),
)
def test_moves_keep_their_limits_reach_their_place_and_stop(distance, v_max, a_max, j_max):
    move = BaseMotion.s_curve(-distance, v_max, a_max, j_max)
    t = np.linspace(0.0, move.duration, 4001)
    w, v, a = move.kinematics(t)
    # the last samples sit on the last knot, where rounding decides on which side of a jump of acceleration they are
    assert w[-1] == pytest.approx(-distance, rel=1e-9)
    assert abs(v[-1]) < 1e-9 * np.abs(v).max()
    assert np.abs(v).max() <= v_max * (1 + 1e-9)
    assert np.abs(a).max() <= a_max * (1 + 1e-9)
    if np.isfinite(j_max):
        assert np.abs(np.diff(a)).max() <= j_max * t[1] * (1 + 1e-6)
    assert (move.velocity(2 * move.duration), move.acceleration(2 * move.duration)) == (pytest.approx(0, abs=1e-9), 0)


def test_the_fastest_move_is_the_classical_one():
    assert BaseMotion.trapezoid(0.5, v_max=np.inf, a_max=2.0).duration == pytest.approx(2 * np.sqrt(0.5 / 2.0))
    assert BaseMotion.trapezoid(0.5, v_max=0.5, a_max=1.0).duration == pytest.approx(0.5 / 0.5 + 0.5 / 1.0)
    # v/j and a/j: distance / v + v / a + a / j
    assert BaseMotion.s_curve(2.0, 0.5, 1.0, 4.0).duration == pytest.approx(2.0 / 0.5 + 0.5 / 1.0 + 1.0 / 4.0)
    # too short for any limit but jerk: four equal phases
    assert BaseMotion.s_curve(1e-3, 10.0, 10.0, 2.0).duration == pytest.approx(4 * np.cbrt(1e-3 / 4.0))


def test_a_given_duration_slows_the_move_down_uniformly():
    for way, duration in ((0.5, 3.2), (0.02, 1.1)):
        fast, slow = BaseMotion.s_curve(way, 0.5, 1.0, 10.0), BaseMotion.s_curve(way, 0.5, 1.0, 10.0, duration=duration)
        assert slow.duration == pytest.approx(duration)
        t = np.linspace(0, fast.duration, 11)
        assert slow.displacement(t * duration / fast.duration) == pytest.approx(fast.displacement(t))


def test_batched_moves_are_single_moves():
    durations = np.array([1.6, 2.0, 4.0])
    batch = BaseMotion.s_curve(0.5, 0.5, 1.0, 100.0, duration=durations)
    t = np.linspace(0, 5, 50)
    for row, duration in zip(batch.displacement(t), durations, strict=True):
        assert row == pytest.approx(BaseMotion.s_curve(0.5, 0.5, 1.0, 100.0, duration=duration).displacement(t))


@pytest.mark.parametrize(
    ("limits", "named"),
    [((0.5, 100.0, 1e6), "v_max"), ((100.0, 1.0, 1e6), "a_max"), ((100.0, 100.0, 1.0), "j_max")],
)
def test_an_infeasible_move_names_the_limit(limits, named):
    least = BaseMotion.s_curve(0.5, *limits).duration
    with pytest.raises(ValueError, match=f"duration = .*at least .*{named}"):
        BaseMotion.s_curve(0.5, *limits, duration=0.9 * least)
    BaseMotion.s_curve(0.5, *limits, duration=least)


@pytest.mark.parametrize(
    ("limits", "reached"),
    [
        ((np.inf, 2.0, np.inf), "a_max"),
        ((0.5, 1.0, np.inf), "v_max and a_max"),
        ((0.5, 1.0, 9.0), "v_max and a_max and j_max"),
        ((0.1, 50.0, 9.0), "v_max and j_max"),
        ((np.inf, 0.5, 9.0), "a_max and j_max"),
        ((np.inf, 50.0, 9.0), "j_max"),
    ],
)
def test_only_limits_that_the_fastest_move_reaches_are_in_its_way(limits, reached):
    with pytest.raises(ValueError, match=f"within its limit {reached}$"):
        BaseMotion.s_curve(0.5, *limits, duration=0.01)


def test_sampled_acceleration_is_linear_between_samples():
    t = np.linspace(0.5, 2.5, 5)
    motion = BaseMotion.sampled(t, [0.0, 1.0, 0.0, -1.0, 0.0], velocity=0.2)
    assert motion.acceleration([0.0, 0.75, 1.0, 2.0, 9.0]) == pytest.approx([0, 0.5, 1, -1, 0])
    assert motion.velocity([0.0, 1.5, 9.0]) == pytest.approx([0.2, 0.7, 0.2])
    assert motion.displacement(0.5) == pytest.approx(0.1)
    assert motion.duration == 2.5


def test_records_and_velocities_are_batches_of_their_own():
    t, record, later = np.linspace(0.5, 2.5, 5), np.array([0.0, 1.0, 0.0, -2.0, 0.5]), np.linspace(0.0, 4.0, 9)
    one = BaseMotion.sampled(t, record, 0.2).displacement(later)
    coasts = BaseMotion.sampled(t, record, [0.2, 0.5]).displacement(later)
    np.testing.assert_allclose(coasts, [one, one + 0.3 * later], rtol=1e-13)
    runs = BaseMotion.sampled(t, [record, 2 * record], 0.2).displacement(later)
    np.testing.assert_allclose(runs, [one, 2 * one - 0.2 * later], rtol=1e-13)


def test_shaping_convolves_with_impulses():
    move = BaseMotion.trapezoid(1.0, 1.0, 2.0)
    shaped = move.shaped([0.25, 0.75], [0.0, 0.4])
    t = np.linspace(0.4, 3, 20)
    assert shaped.displacement(t) == pytest.approx(0.25 * move.displacement(t) + 0.75 * move.displacement(t - 0.4))
    assert shaped.duration == pytest.approx(move.duration + 0.4)
    with pytest.raises(ValueError, match="from rest"):
        BaseMotion(velocity=0.1).shaped([1.0], [0.0])


def test_an_impulse_delays_and_shapers_are_a_batch():
    move, t = BaseMotion.trapezoid(1.0, 1.0, 2.0), np.linspace(0.4, 3, 20)
    assert move.shaped([1.0], [0.4]).displacement(t) == pytest.approx(move.displacement(t - 0.4))
    shapers = np.array([[0.25, 0.75], [0.5, 0.5], [1.0, 0.0]]), np.array([[0.0, 0.4], [0.1, 0.3], [0.2, 0.0]])
    batch = move.shaped(*shapers).displacement(t)
    np.testing.assert_allclose(
        batch, [move.shaped(*shaper).displacement(t) for shaper in zip(*shapers, strict=True)], atol=1e-15
    )


def test_duration_is_when_the_acceleration_ends():
    assert BaseMotion().duration == 0.0
    assert BaseMotion(velocity=1.0).duration == 0.0
    assert BaseMotion(amplitude=1e-3).terms[0].duration == 0.0
    assert BaseMotion(acceleration=[0.0, 1.0]).duration.tolist() == [0.0, np.inf]
    assert BaseMotion.sampled([1.0, 2.0], [[0.0, 0.0], [0.0, 1.0]]).duration.tolist() == [0.0, 2.0]
    assert (BaseMotion.trapezoid(1, 1, 1) + BaseMotion(amplitude=1e-3, angular_frequency=3.0)).duration == np.inf


def test_a_force_is_what_its_fields_say():
    t = np.linspace(0.0, 2.0, 9)
    force = Force([1.0, -2.0], 1.5, [3.0, 0.0], 0.4)
    assert force(t)[0] == pytest.approx(1.0 + 1.5 * np.sin(3.0 * t + 0.4))
    assert force(t)[1] == pytest.approx(-2.0 + 1.5 * np.sin(0.4))  # one that does not swing is constant
    assert Force(amplitude=1.5, angular_frequency=3.0)(t) == pytest.approx(1.5 * np.sin(3.0 * t))
    assert not Force()(t).any() and (Force(1.0, 2.0, phase=np.pi / 2)(t) == 3.0).all()
    record = Force.sampled([0.5, 1.0, 1.5], [2.0, -1.0, 3.0])
    assert record([0.2, 0.5, 0.75, 1.25, 1.5]) == pytest.approx([0.0, 2.0, 0.5, 1.0, 0.0])
    assert (force + record)(t) == pytest.approx(force(t) + record(t))
    for size, varpi in ((1.0, 1e-160), (1e-300, 1e15)):
        with pytest.raises(ValueError, match="too small or too large"):
            Force(amplitude=size, angular_frequency=varpi)
    for history in (BaseMotion, Force):
        with pytest.raises(ValueError, match=r"angular_frequency = .*1e\+15"):
            history(amplitude=1.0, angular_frequency=1.1e15)


def test_a_motion_lasts_until_it_accelerates_no_more():
    assert BaseMotion.trapezoid(1.0, 1.0, 2.0).duration == pytest.approx(1.5)
    assert BaseMotion.sampled([0.0, 1.0, 2.0], [1.0, 0.0, 0.0]).duration == 2.0
    assert BaseMotion(velocity=1.0).duration == 0.0 and BaseMotion(acceleration=1.0).duration == np.inf


@pytest.mark.parametrize(
    ("make", "error", "words"),
    [
        (lambda: BaseMotion(velocity="fast"), TypeError, "velocity"),
        (lambda: BaseMotion(amplitude=np.nan), ValueError, "amplitude"),
        (lambda: BaseMotion(angular_frequency=-1.0), ValueError, "angular_frequency = -1"),
        (lambda: BaseMotion(velocity=[1, 2], amplitude=[1, 2, 3]), ValueError, r"velocity \(2,\), amplitude \(3,\)"),
        (lambda: BaseMotion.sampled([0, 2, 1], [0, 0, 0]), ValueError, r"t\[2\] = 1 after 2: .*increase"),
        (lambda: BaseMotion.sampled([0, 1, 0.5], [0, 0, 0]), ValueError, r"t\[2\] = 0.5 after 1: .*increase"),
        (lambda: BaseMotion.sampled([0, 1, 3], [0, 0, 0]), ValueError, r"t\[2\] = 3 is 2 s after t\[1\]"),
        (lambda: BaseMotion.sampled([0, 1], [0, 0, 0]), ValueError, "acceleration has 3 samples: its last axis must"),
        (lambda: BaseMotion.sampled([1.0], [0.0]), ValueError, "at least two"),
        (lambda: BaseMotion.sampled([-1, 0], [0, 0]), ValueError, r"t\[0\] = -1"),
        (lambda: BaseMotion.trapezoid(1, 0.0, 1), ValueError, "v_max = 0"),
        (lambda: BaseMotion.trapezoid(1, 1, np.inf), ValueError, "a_max = inf"),
        (lambda: BaseMotion.trapezoid(1, 1, 1, duration=-2.0), ValueError, "duration = -2"),
        (lambda: BaseMotion.s_curve([1, 2], [1, 2, 3], 1, 1), ValueError, "broadcast"),
        (lambda: BaseMotion().displacement(-0.05), ValueError, "t = -0.05"),
        (lambda: BaseMotion.sampled([0, 1], 3.0), ValueError, r"acceleration has shape \(\)"),
        (lambda: BaseMotion.trapezoid(1, 1, 1).shaped(1.0, [0.0, 0.1]), ValueError, r"amplitudes \(\) and times"),
        (lambda: BaseMotion().displacement([[0.1]]), ValueError, "one axis"),
        (lambda: BaseMotion.trapezoid(1, 1, 1).shaped([0.5, 0.5], [0.1]), ValueError, "one time for each impulse"),
        (lambda: BaseMotion.trapezoid(1, 1, 1).shaped([0.5, 0.5], [-0.05, 0.1]), ValueError, r"times\[0\] = -0.05"),
        (lambda: BaseMotion() + 1.0, TypeError, "unsupported"),
    ],
)
def test_bad_input_is_named(make, error, words):
    with pytest.raises(error, match=words):
        make()
