"""Figures of the joint that slips show what the numbers say."""

from __future__ import annotations

import numpy as np
import pytest
from matplotlib.figure import Figure

import cra_sym as cra
from cra_sym.figures.slipping import figure_preload, figure_slip_amplitude, figure_slip_loop, figure_tongue_bounds


@pytest.fixture(scope="module")
def arm():
    return cra.Arm.nominal().replace(zeta=0.002)


def test_the_loop_stays_between_the_slip_forces(arm):
    ax = Figure().subplots()
    assert figure_slip_loop(arm, preload=2.0, duration=0.6, ax=ax) is ax.figure
    whole, slips = (np.abs(line.get_ydata()) for line in ax.lines)
    limit = cra.BoltedJoint().values(2.0)["slip"]
    assert whole.max() <= limit * (1 + 1e-12) and slips.size > 5
    np.testing.assert_allclose(slips, limit, rtol=1e-12)


def test_preload_is_drawn_as_computed(arm):
    drawn = figure_preload(arm, preload=[0.5, 2.0, 50.0], duration=2.0, modes=2)
    left, middle, right = drawn.axes
    assert len(right.lines) == 3
    for line in left.lines:
        assert (np.diff(line.get_ydata()) > 0).all() and line.get_ydata()[-1] < 1
    late, taken = (line.get_ydata() for line in middle.lines)
    assert late[1] < late[2] and taken[2] == 0.0 and taken[1] > 5


def test_frequency_falls_and_damping_has_a_top(arm):
    joint = cra.BoltedJoint(rest=20.0, body_t=20.0, lever=0.05)
    left, right = figure_slip_amplitude(joint.on(arm, 0.7), amplitude=[2e-3, 2e-2, 0.2]).axes
    frequency, damping = left.lines[0].get_ydata(), right.lines[0].get_ydata()
    assert (np.diff(frequency) < 0).all()
    assert damping[1] > 10 * damping[0] and damping[1] > 2 * damping[2]


def test_bounds_of_tongues_are_drawn():
    bounded, threshold = figure_tongue_bounds([0.1, 0.2], [0.01, 0.011], [0.2, np.nan]).axes[0].lines
    assert bounded.get_ydata().tolist() == [10.0, 11.0] and threshold.get_ydata()[0] == 200.0
