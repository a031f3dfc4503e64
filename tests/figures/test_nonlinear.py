"""Figures of nonlinear vibration show what the numbers say."""

from __future__ import annotations

import matplotlib
import numpy as np
import pytest
from matplotlib.figure import Figure

import cra_sym as cra
from cra_sym.figures.drawing import BLUE, ORANGE
from cra_sym.figures.nonlinear import (
    cubic_joint,
    figure_amplitude_map,
    figure_backbone,
    figure_inside_tongues,
    figure_sweep,
    swept,
)
from tests.nonlinear_models import sprung


@pytest.fixture(scope="module")
def states():
    arm = cra.Arm.nominal().replace(k_t=1e3)
    excitation = cra.JointStiffness(k_t=1.0)
    lower, upper = cra.stability_boundary(arm, excitation, 0.3, (2, 2))
    frequency = np.linspace(lower - 2, upper + 5, 9)
    system = cubic_joint(arm, 1e9, 1e-3)
    return cra.steady_states(
        system, frequency, excitation=excitation, epsilon=0.3, modes=2, harmonics=3, period=2
    ), upper


def test_a_sweep_upwards_leaves_the_zone_and_one_downwards_does_not_see_it(states):
    found, upper = states
    up, down = swept(found), swept(found[::-1])[::-1]
    beyond = np.array([here[0].angular_frequency for here in found]) > upper + 1
    assert (up[beyond] > 1e-4).all() and not down[beyond].any()
    assert (np.diff(up) >= 0).all()
    ax = figure_sweep(found).axes[0]
    np.testing.assert_allclose(ax.lines[2].get_ydata(), 1e3 * up)


@pytest.mark.filterwarnings("ignore:a curve was not followed to its end")  # one mode that a softening joint pushes away
def test_the_joint_bends_the_answers_to_its_side():
    (ax,) = figure_inside_tongues(modes=1).axes
    middle = np.mean(ax.get_xlim())
    for color, side in ((BLUE, 1), (ORANGE, -1)):
        points = np.concatenate([line.get_xydata() for line in ax.lines if line.get_color() == color])
        assert side * (points[np.nanargmax(points[:, 1]), 0] - middle) > 0


def test_a_backbone_shows_where_it_is_unstable():
    ax = Figure().subplots()
    drawn = figure_backbone(sprung(), modes=3, points=130, branches=True, ax=ax)
    assert drawn is ax.figure and len(ax.lines[0].get_xdata()) == 130
    assert ax.lines[-1].get_linestyle() == "--" and len(ax.lines[-1].get_xdata()) > 100
    with matplotlib.rc_context():
        chart = figure_amplitude_map([1.0, 2.0, 3.0], [0.1, 0.2], np.ones((2, 3)), ([1.2, 1.1], [2.0, 2.4]))
    assert len(chart.axes) == 2 and len(chart.axes[0].lines) == 2
