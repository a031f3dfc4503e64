"""Fig. 3 and the mode shapes: curves are the computed ones, axes say quantity and unit, styles differ."""

import numpy as np
import pytest
from matplotlib import style
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

import cra_sym as cra
from cra_sym.figures import FIGURES, STYLE
from cra_sym.figures.modes import figure_3, figure_4, figure_mode_shapes
from cra_sym.paper.flipped import flipped_frequencies

ARM = cra.Arm.nominal()


def curves(ax):
    return [line for line in ax.lines if len(line.get_xdata()) > 2]


@pytest.fixture(autouse=True)
def house_style():
    with style.context(STYLE):
        yield


def test_figure_3_shows_the_frequencies_against_the_translational_stiffness():
    k_t = np.logspace(0, 6, 13)
    left, right = figure_3(k_t=k_t).axes
    expected = cra.natural_frequencies(ARM.replace(k_t=k_t))
    np.testing.assert_array_equal([line.get_ydata() for line in curves(left)], expected.T)
    np.testing.assert_allclose([line.get_ydata()[-1] for line in curves(right)], 1.0, rtol=1e-3)
    assert left.get_xscale() == "log" and "N/m" in left.get_xlabel() and "Hz" in left.get_ylabel()
    assert len({line.get_linestyle() for line in curves(left)}) == 3


def test_figure_4_sets_the_derived_result_beside_the_flipped_sign():
    k_r = np.logspace(2, 5, 7)
    derived, flipped, *relative = figure_4(k_r=k_r).axes
    softened = cra.Arm.nominal().replace(k_r=k_r)
    np.testing.assert_array_equal([line.get_ydata() for line in curves(derived)], cra.natural_frequencies(softened).T)
    np.testing.assert_array_equal([line.get_ydata() for line in curves(flipped)], flipped_frequencies(softened).T)
    assert all(np.all(np.diff(line.get_ydata()) > 0) for line in curves(relative[0]))
    assert all(np.all(np.diff(line.get_ydata()) < 0) for line in curves(relative[1]))


def test_mode_shapes_are_those_of_the_two_joints():
    panels = figure_mode_shapes().axes
    elastic = cra.mode_shapes(ARM.replace(k_t=1e3, k_r=1e2), np.linspace(0, 1, 301))
    for mode, ax in enumerate(panels):
        rigid_line, elastic_line = curves(ax)
        np.testing.assert_array_equal(elastic_line.get_ydata(), elastic[mode])
        assert abs(rigid_line.get_ydata()[0]) < 1e-12 < 0.01 < abs(elastic_line.get_ydata()[0])


def test_given_axes_are_used():
    figure = Figure()
    axes = figure.subplots(1, 2)
    assert figure_3(k_t=[1.0, 10.0, 100.0], axes=axes) is figure


@pytest.mark.parametrize("name", ["fig03", "fig04", "mode_shapes"])
def test_registered_and_drawable(name):
    from cra_sym.figures import draw

    figure = draw(name)
    assert name in FIGURES
    FigureCanvasAgg(figure).draw()
