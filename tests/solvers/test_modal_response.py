"""The solver alone: undamped oscillators with unit responses written down here, against matrix exponentials."""

import numpy as np
import pytest
from scipy.linalg import expm

from cra_sym.solvers.modal_response import (
    HarmonicInput,
    Oscillators,
    PiecewiseInput,
    Steady,
    free_peak,
    knot_states,
    piecewise_response,
    segment,
    steady_response,
)

OMEGA, GAMMA, ROWS = np.array([3.0, 11.0]), np.array([0.5, -0.2]), np.array([[1.0, 0.7], [0.3, -1.0]])


def free(t, omega, zeta):
    """Unit responses without damping."""
    t, omega = np.broadcast_arrays(t, omega)
    sine, cosine = np.sin(omega * t), np.cos(omega * t)
    return {
        "displacement": cosine, "impulse": sine / omega,
        "step": (1 - cosine) / omega**2, "ramp": (t - sine / omega) / omega**2,
    }  # fmt: skip


def forced(t, omega, zeta, varpi):
    """Response to exp(i varpi t), off resonance."""
    return (np.exp(1j * varpi * t) - np.cos(omega * t) - 1j * varpi / omega * np.sin(omega * t)) / (omega**2 - varpi**2)


OSC = Oscillators(OMEGA, np.zeros(1), GAMMA, ROWS, free, forced)
CAUSE = Steady(np.array([0.1, -0.3]), np.array([0.4]), [HarmonicInput(*np.array([[2e-2], [5.0], [0.3]]))])


def exact(t, derivative):
    """Return the outputs by one matrix exponential of oscillators, constant and phasor."""
    B, varpi, psi = (value[0] for value in CAUSE.harmonics[0])
    A = np.zeros((7, 7))  # q, q', 1, cos, sin
    A[:2, 2:4], A[2:4, :2] = np.eye(2), -np.diag(OMEGA**2)
    A[2:4, 4], A[2:4, 6] = -GAMMA * CAUSE.acceleration[0], GAMMA * B * varpi**2
    A[5, 6], A[6, 5] = -varpi, varpi
    start = np.array([0, 0, *CAUSE.velocity, 1, np.cos(psi), np.sin(psi)])
    read = np.hstack([ROWS, np.zeros((2, 5))]) @ np.linalg.matrix_power(A, derivative)
    return np.array([read @ expm(A * time) @ start for time in t]).T


@pytest.mark.parametrize("derivative", [0, 1, 2])
@pytest.mark.parametrize("t", [np.linspace(0.5, 7.0, 90), np.array([3.0, 0.0, 1.1])], ids=["grid", "any"])
def test_steady_causes(t, derivative):
    found = steady_response(OSC, CAUSE, t, derivative)
    assert found == pytest.approx(exact(t, derivative), rel=1e-11, abs=1e-12)


@pytest.mark.parametrize("count", [64, 65, 100, 127, 1000])
def test_a_grid_of_any_length_is_its_points(count):
    t = np.linspace(0.0, 20.0, count)
    scattered = steady_response(OSC, CAUSE, t[::-1])[..., ::-1]
    assert steady_response(OSC, CAUSE, t) == pytest.approx(scattered, abs=1e-13)


def test_a_uniform_grid_needs_few_unit_responses():
    """One for the first time, one from block to block, one from point to point; other times need one each."""
    asked = []

    def counted(t, omega, zeta):
        asked.append(np.size(t))
        return free(t, omega, zeta)

    for t, wanted in (np.linspace(0.3, 9.0, 1000), 3), (np.geomspace(0.3, 9.0, 1000), 1000):
        asked.clear()
        steady_response(OSC._replace(free=counted), CAUSE, t)
        assert sum(asked) == wanted


def test_a_record_of_equal_steps_needs_one_shift():
    asked = []

    def counted(t, omega, zeta):
        asked.append(np.size(t))
        return free(t, omega, zeta)

    level, jerk = np.random.default_rng(1).normal(size=(2, 21))
    for knots, wanted in (np.linspace(0.0, 2.0, 21), 1), (np.geomspace(0.1, 2.0, 21), 20):
        asked.clear()
        knot_states(OSC._replace(free=counted), PiecewiseInput(knots, level, jerk))
        assert sum(asked) == wanted


def test_times_taken_in_parts_and_a_batch_of_none(monkeypatch):
    """Even parts of one time each, which is what more oscillators than a part may hold come to."""
    t, several = np.array([0.3, 2.5, 0.0, 1.1]), OSC._replace(omega=OMEGA * [[1.0], [1.3], [0.7]])
    whole = steady_response(several, CAUSE, t)
    none = OSC._replace(omega=np.empty((0, 2)))
    assert steady_response(none, CAUSE, t).shape == (0, 2, 4)
    monkeypatch.setattr("cra_sym.solvers.modal_response._CHUNK", 1)
    np.testing.assert_allclose(steady_response(several, CAUSE, t), whole, rtol=1e-12)


def test_a_piece_is_a_sum_of_delayed_ramps():
    knots = np.array([0.2, 0.5, 1.4, 1.6])  # not uniform
    level, jerk = np.array([0.3, -0.5, 1.0, 0.0]), np.array([1.0, 0.0, -2.0, 0.0])
    t = np.linspace(0, 3, 50)
    expected = np.zeros((2, t.size))
    span = np.diff(knots, append=np.inf)
    for k, duration in enumerate(span):
        after, beyond = np.maximum(t - knots[k], 0.0), np.maximum(t - knots[k] - duration, 0.0)
        end = level[k] + (jerk[k] * duration if np.isfinite(duration) else 0.0)
        for values, a, j in ((after, level[k], jerk[k]), (beyond, -end, -jerk[k])):
            unit = free(values, OMEGA[:, None], 0.0)
            expected += ROWS @ (-GAMMA[:, None] * (a * unit["step"] + j * unit["ramp"]))
    assert piecewise_response(OSC, PiecewiseInput(knots, level, jerk), t) == pytest.approx(expected, abs=1e-13)


def test_uniform_and_listed_knots_agree():
    knots = np.linspace(0, 2, 21)
    level, jerk = np.random.default_rng(0).normal(size=(2, 21))
    uniform = knot_states(OSC, PiecewiseInput(knots, level, jerk))
    listed = knot_states(OSC, PiecewiseInput(knots[None], level, jerk))
    assert np.allclose(uniform, [values[0] for values in listed], atol=1e-13)
    records = knot_states(OSC, PiecewiseInput(knots, np.outer([1.0, -2.0], level), np.outer([1.0, -2.0], jerk)))
    for several, one in zip(records, uniform, strict=True):
        np.testing.assert_allclose(several, [one, -2.0 * one], atol=1e-13)
    t = np.array([-1.0, 0.0, 0.05, 2.0, 3.0])
    assert segment(knots, t).tolist() == segment(knots[None], t)[0].tolist() == [-1, 0, 0, 20, 20]


@pytest.mark.parametrize("derivative", [0, 2])
def test_batches_are_loops(derivative):
    """Oscillators in rows, causes in columns: steady ones on a grid or not, pieces with knots of their own."""
    rng = np.random.default_rng(4)
    omega, rows = rng.uniform(2.0, 9.0, (3, 1, 2)), rng.normal(size=(3, 1, 2, 2))
    osc = OSC._replace(omega=omega, rows=rows, gamma=rng.normal(size=(3, 1, 2)))
    harmonics = [
        HarmonicInput(*rng.uniform(1.0, 2.0, (3, 3, 4, 1))),
        HarmonicInput(*np.array([[0.1], [11.0], [0.5]])),
    ]
    steady = Steady(rng.normal(size=(4, 2)), rng.normal(size=(4, 1)), harmonics, rng.normal(size=(4, 2)))
    knots, level, jerk = np.sort(rng.uniform(0.0, 2.0, (4, 5))), *rng.normal(size=(2, 4, 5))
    times = np.linspace(0.0, 3.0, 70), np.array([0.3, 2.5, 0.0])
    found = [steady_response(osc, steady, t, derivative) for t in times]
    found += [piecewise_response(osc, PiecewiseInput(knots, level, jerk), t, derivative) for t in times]
    for i, j in np.ndindex(3, 4):
        one = osc._replace(omega=omega[i, 0], rows=rows[i, 0], gamma=osc.gamma[i, 0])
        cause = Steady(
            steady.velocity[j],
            steady.acceleration[j],
            [HarmonicInput(*(value[i, j] for value in harmonics[0])), harmonics[1]],
            steady.displacement[j],
        )
        single = [steady_response(one, cause, t, derivative) for t in times]
        single += [piecewise_response(one, PiecewiseInput(knots[j], level[j], jerk[j]), t, derivative) for t in times]
        for whole, part in zip(found, single, strict=True):
            np.testing.assert_allclose(whole[i, j], part, atol=1e-11)


def test_free_peak_is_the_largest_value_ever_reached():
    q, u = np.array([0.3, -0.1]), np.array([1.0, 2.0])
    for omega in (OMEGA, OMEGA / 20):
        unit = free(np.linspace(0, 30 / omega[0], 20001), omega[:, None], 0.0)
        history = np.abs(unit["displacement"] * q[:, None] + unit["impulse"] * u[:, None]).max(-1)
        assert free_peak(OSC._replace(omega=omega), q, u) == pytest.approx(history, rel=1e-6)


def test_free_peak_with_damping_and_of_rigid_modes():
    """A first extreme may be the largest although the start was smaller; a rigid mode leaves, or stays for ever."""

    def fading(t, omega, zeta):
        damped = omega * np.sqrt(1 - zeta**2)
        impulse = np.exp(-zeta * omega * t) * t * np.sinc(damped * t / np.pi)
        level = np.exp(-zeta * omega * t) * np.cos(damped * t) + zeta * omega * impulse
        return {"displacement": level, "impulse": impulse, "step": 0.0 * t, "ramp": 0.0 * t}

    zeta, rng = np.array([0.05, 0.6]), np.random.default_rng(2)
    fade = OSC._replace(zeta=zeta, free=fading)
    t = np.linspace(0, 5, 20001)
    unit = fading(t, OMEGA[:, None], zeta[:, None])
    for q, u in rng.normal(size=(20, 2, 2)) * np.array([[1.0], [8.0]]):
        history = np.abs(unit["displacement"] * q[:, None] + unit["impulse"] * u[:, None]).max(-1)
        missed = (OMEGA * t[1]).max() ** 2 / 8  # of a maximum halfway between two samples
        assert free_peak(fade, q, u) == pytest.approx(history, rel=missed)
    rigid = fade._replace(omega=np.zeros(2))
    assert free_peak(rigid, np.array([-0.3, 0.2]), np.array([0.0, 1e-3])).tolist() == [0.3, np.inf]
