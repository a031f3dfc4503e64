"""Figures 5 to 10 and the vibration figures show what the kernels say: peaks and orders are read off the curves."""

import numpy as np
import pytest
from matplotlib.figure import Figure

import cra_sym as cra
from cra_sym import Arm, BaseMotion
from cra_sym.figures import responses, vibration
from cra_sym.figures.sensitivity import figure_5


def curves(ax, least=10):
    return [line.get_xydata() for line in ax.lines if len(line.get_xdata()) > least]


def peaks(ax):
    return [np.abs(curve[:, 1]).max() for curve in curves(ax)]


def test_figure_5_holds_the_sensitivities():
    raw, _, log, _ = figure_5().axes
    for mode, (curve, share) in enumerate(zip(curves(raw), curves(log), strict=True)):
        found = cra.sensitivities(Arm.nominal().replace(k_t=curve[:, 0]))
        assert curve[:, 1] == pytest.approx(found.df_dk_t[:, mode])
        assert share[:, 1] == pytest.approx(found.log_k_t[:, mode])


def test_figure_6_has_the_four_cases():
    velocity, acceleration, velocity_pi, acceleration_pi = map(peaks, responses.figure_6().axes)
    assert velocity_pi == pytest.approx([10.22, 11.00], abs=0.01)  # with, without
    assert velocity[0] > velocity[1] > velocity_pi[0]
    assert acceleration[0] > acceleration_pi[0] > acceleration[1] == acceleration_pi[1]
    curve = curves(responses.figure_6().axes[2])[0]
    motion = BaseMotion(velocity=0.1, amplitude=1e-3, angular_frequency=10.0, phase=np.pi)
    assert curve[:, 1] == pytest.approx(1e3 * cra.tip_response(Arm.nominal(), motion, curve[:, 0]), abs=1e-9)


@pytest.mark.parametrize("figure", [responses.figure_7, responses.figure_8])
def test_a_softer_joint_helps_above_resonance_only(figure):
    (rigid_low, soft_low), (rigid_high, soft_high) = map(peaks, figure().axes)
    assert soft_low > rigid_low
    assert soft_high < rigid_high


def test_figure_9_peaks_grow_with_acceleration():
    for ax in responses.figure_9().axes:
        assert np.all(np.diff(peaks(ax)) > 0)


def test_figure_10_one_error_for_all_and_peaks_that_never_grow():
    left, right = responses.figure_10().axes
    first, second, third = (curve[:, 1] for curve in curves(left))
    assert first == pytest.approx(second, abs=1e-11) and first == pytest.approx(third, abs=1e-11)
    assert all(np.all(np.diff(curve[:, 1]) < 1e-9) for curve in curves(right))


def test_the_residual_map_is_darkest_where_the_valley_line_runs():
    mesh = vibration.figure_residual_vibration().axes[0].collections[0]
    grid = mesh.get_array().reshape(mesh.get_coordinates().shape[:2])
    durations = mesh.get_coordinates()[0, :, 0]
    stiffest = grid[-1]
    near = (durations > 1.2) & (durations < 1.6)
    assert durations[near][np.argmin(stiffest[near])] == pytest.approx(1.40, abs=0.02)


def test_shaping_beats_an_equally_long_s_curve():
    arm = Arm.nominal().replace(k_t=1e3, k_r=1e2, zeta=0.01)
    moves = vibration.shaped_moves(arm)
    left = {name: cra.residual_vibration(arm, move) for name, move in moves.items()}
    assert left["ZVD"] < left["ZV"] < 1e-2 * left["slow S-curve"]
    wrong = {name: cra.residual_vibration(arm.replace(k_t=500.0), move) for name, move in moves.items()}
    assert wrong["ZVD"] < 0.1 * wrong["ZV"] < 0.1 * wrong["slow S-curve"]
    assert moves["ZVD"].duration == pytest.approx(moves["slow S-curve"].duration)


@pytest.mark.parametrize(
    ("figure", "shape"),
    [
        (figure_5, (2, 2)), (responses.figure_6, (2, 2)), (responses.figure_7, (1, 2)), (responses.figure_8, (1, 2)),
        (responses.figure_9, (1, 2)), (responses.figure_10, (1, 2)), (vibration.figure_frequency_response, (1, 2)),
        (vibration.figure_input_shaping, (1, 2)),
    ],
)  # fmt: skip
def test_draws_where_it_is_told(figure, shape):
    given = Figure().subplots(*shape)
    assert figure(axes=given) is given.flat[0].figure
    assert all(ax.lines for ax in given.flat)
