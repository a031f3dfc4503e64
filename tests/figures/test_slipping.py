"""Figures of the joint that slips show what the numbers say."""

from __future__ import annotations

import numpy as np
import pytest
from matplotlib.figure import Figure

import cra_sym as cra
from cra_sym.figures.slipping import (
    figure_preload,
    figure_preload_tongues,
    figure_slip_amplitude,
    figure_slip_loop,
    figure_tongue_bounds,
)


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
    peak, late, taken = (line.get_ydata() for line in middle.lines)
    assert (peak >= late).all() and peak[0] > late[0]
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


def test_a_contact_that_does_not_give_has_tongues_of_one_width_and_amplitudes_like_the_preload(arm):
    """All stiffnesses are those of the members, so that the preload scales the slip force and with it the motion."""
    joint = cra.BoltedJoint(rest=20.0, body_t=20.0, body_r=100.0, roughness=1e-12)
    drawn = figure_preload_tongues(arm, joint=joint, preload=[1.0, 3.0], amplitudes=2, harmonics=3)
    left, middle, right = drawn.axes
    scaled = [cra.backbone(joint.on(arm, N), 1, amplitude=0.02 * N, modes=2, harmonics=3) for N in (1.0, 3.0)]
    # the contact gives 1e-6 of the members, or less
    np.testing.assert_allclose(scaled[1].damping_ratio, scaled[0].damping_ratio, rtol=1e-5)
    np.testing.assert_allclose(left.lines[0].get_ydata()[0], scaled[0].damping_ratio, rtol=1e-12)
    widths = np.array([line.get_ydata() for line in middle.lines])
    np.testing.assert_allclose(widths[:2, 1], widths[:2, 0], rtol=1e-5)
    system, step = joint.on(arm, 1.0), 1e-4
    springs = ({name: (1 + side * step) * system.values[name] for name in ("k_t", "k_r")} for side in (1, -1))
    more, less = (2 * np.pi * cra.natural_frequencies(system.replace(**values), 2) for values in springs)
    omega = 2 * np.pi * cra.natural_frequencies(system, 2)
    rate = (more**2 - less**2) / (2 * step)
    # to first order in epsilon; the difference quotient is good to the square of its step
    wanted = 4 * np.sqrt((0.3 * rate / (4 * omega)) ** 2 - (arm.zeta * omega) ** 2)
    np.testing.assert_allclose(widths[:2, 0], wanted, rtol=1e-5)
    amplitude = right.lines[0].get_ydata()
    np.testing.assert_allclose(amplitude[1], 3 * amplitude[0], rtol=1e-6)
    assert amplitude[0] > 0
