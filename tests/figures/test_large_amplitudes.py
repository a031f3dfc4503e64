"""Figures of large amplitudes show what the analysis says."""

import numpy as np
import pytest

import cra_sym as cra
from cra_sym.figures.drawing import BLUE, ORANGE
from cra_sym.figures.large_amplitudes import (
    figure_basins,
    figure_shaken_across,
    figure_shaken_along,
    foreshortened_arm,
)
from cra_sym.figures.nonlinear import cubic_joint
from cra_sym.figures.sweep_film import jumping_arm
from cra_sym.symbols import w

ARM = cra.Arm.nominal().replace(k_t=1e3, zeta=2e-3)


def test_a_small_foreshortened_arm_is_the_arm():
    """Its linear part; and (36b) comes out of the motion along it."""
    system = foreshortened_arm(ARM)
    np.testing.assert_allclose(cra.natural_frequencies(system), cra.natural_frequencies(ARM), rtol=1e-13)
    (ax,) = figure_shaken_along(ARM, amplitude=2e-3).axes
    lower, upper = cra.stability_boundary(ARM, cra.AxialBase(1.0), 2e-3, (2, 2))
    thin = [line.get_xydata() for line in ax.lines if line.get_linewidth() < 1 and not np.nanmax(line.get_ydata())]
    (unstable,) = (x[np.isfinite(y)] for x, y in (line.T for line in thin))  # at rest, up to the next stable points
    step = 0.01 * (upper - lower)  # next to a branch point of (2, 2) of second order
    assert abs(unstable[1] - lower) < step and abs(unstable[-2] - upper) < step
    assert np.nanmax([np.nanmax(line.get_ydata()) for line in ax.lines if len(line.get_ydata())]) > 100  # mm


def test_a_linear_joint_has_one_answer_and_a_hardening_one_up_to_three():
    (ax,) = figure_shaken_across().axes
    shown = [line for line in ax.lines if np.isfinite(line.get_ydata()).any()]
    kept, lost = ([line for line in shown if (line.get_linewidth() < 1) is thin] for thin in (False, True))
    (middle,) = (line.get_xdata()[np.isfinite(line.get_ydata())] for line in lost)
    assert [line.get_color() for line in kept] == [ORANGE, BLUE, BLUE] and lost[0].get_color() == BLUE
    assert len(np.unique(middle)) > 10 and middle.max() > middle.min() + 10


def test_basins_are_named_by_their_answers():
    joint = cubic_joint(ARM.replace(zeta=0.01), 1e9)
    states = cra.steady_states(joint, 84.0, drive={w: 1e-4}, modes=2, harmonics=5)
    figure = figure_basins(states, np.linspace(-2e-3, 2e-3, 3), [-0.05, 0.0, 0.05], mode=2, cycles=60)
    words = [text.get_text() for text in figure.axes[0].get_legend().get_texts()]
    assert words == [f"the state of {1e3 * state.amplitude:.2f} mm" for state in states if state.stable]


def test_the_film_of_the_jump_follows_both_sweeps():
    svg = jumping_arm(points=7)
    assert svg.count("<circle") == 14 and "<title" in svg and "stroke-dasharray" in svg
    with pytest.raises(ValueError, match="mode"):
        jumping_arm(mode=0)
