"""The stability figures: what they show, on coarse charts."""

from __future__ import annotations

import numpy as np
import pytest

import cra_sym as cra
from cra_sym.figures import boundaries
from cra_sym.figures import stability as figures
from cra_sym.model.one_wave import OneWave


@pytest.mark.parametrize("draw", [figures.figure_11, figures.figure_12])
@pytest.mark.parametrize("excitation", [figures.JOINT, figures.AXIAL])
def test_principal_zones(draw, excitation):
    figure = draw(excitation=excitation, epsilon=0.2, points=9)
    panels = figure.axes
    assert len(panels) == 9 and all(ax.collections for ax in panels)
    arm = cra.Arm.nominal().replace(k_t=1e5) if draw is figures.figure_11 else cra.Arm.nominal().replace(k_t=1e4, m_e=0)
    centre = 2 * cra.modal_parameters(arm).omega[1]
    first, second = (
        np.array(cra.stability_boundary(arm, excitation, 0.2, (2, 2), order=order)) - centre for order in (1, 2)
    )
    drawn = [line.get_xdata()[-1] for line in panels[1].lines]
    assert np.allclose(drawn, [*first, *second])
    assert "$\\varpi - 2\\omega_3$" in panels[-1].get_xlabel()


@pytest.mark.parametrize("excitation", [figures.JOINT, figures.AXIAL])
def test_a_chart_computes_the_modes_of_an_arm_once(excitation, monkeypatch):
    """For each number of modes: a few for the first order and for Floquet theory, more for sums and statics."""
    asked = []
    frequencies, modes = OneWave.angular_frequencies, OneWave.modes

    def counted_frequencies(self, values, shape, number):
        asked.append(("frequencies", number))
        return frequencies(self, values, shape, number)

    def counted_modes(self, values, shape, omega):
        asked.append(("modes", omega.shape[-1]))
        return modes(self, values, shape, omega)

    monkeypatch.setattr(OneWave, "angular_frequencies", counted_frequencies)
    monkeypatch.setattr(OneWave, "modes", counted_modes)
    figures.figure_zones(excitation=excitation, points=5)
    assert len(asked) == len(set(asked)) <= 10


def test_combinations_are_named():
    figure = figures.figure_combinations(points=40)
    names = {text.get_text() for text in figure.axes[0].texts}
    assert {"$2\\omega_1$", "$\\omega_1+\\omega_3$", "$\\omega_2$"} <= names and len(names) == 9


def test_widths():
    figure = boundaries.figure_widths()
    assert len(figure.axes) == 6
    joint, along, across = ([line.get_ydata() for line in ax.lines[:3]] for ax in figure.axes[:3])
    assert all(np.all(np.diff(width[-50:]) < 0) for width in joint)
    assert np.all(np.diff(along[0]) > 0)
    assert np.allclose(
        np.array(across)[:, -1], cra.forced_width(cra.Arm.nominal().replace(k_t=1e6), boundaries.TRANSVERSE)
    )


def test_accuracy():
    figure = boundaries.figure_accuracy(epsilon=[0.06, 0.12])
    slopes = {line.get_label(): line.get_label().rpartition(" ")[2] for ax in figure.axes for line in ax.lines}
    assert len(slopes) == 8 or len({*slopes}) >= 6
    for label, slope in slopes.items():
        assert float(slope) > (2.8 if "order 2" in label else 1.9)


def test_a_rigid_joint_is_told_what_to_do():
    rigid = cra.Arm.nominal()
    for drawn in (figures.figure_12(rigid, m_e=[0.0], points=5), boundaries.figure_accuracy(rigid, [0.1, 0.2])):
        words = [text.get_text() for ax in drawn.axes for text in ax.texts]
        assert any("a rigid joint cannot" in said and "give $k_t$" in said for said in words)
