"""Model against model: the curves are the numbers given, axes say quantity and unit, styles differ."""

import numpy as np
from matplotlib.figure import Figure

from cra_sym.figures.models import figure_damped_joint, figure_eigenvalues, figure_slenderness


def drawn(ax):
    return np.array([line.get_ydata() for line in ax.lines if len(line.get_xdata()) > 2])


def test_a_thin_and_a_thick_theory_in_hertz_and_as_their_ratio():
    slenderness, thin = np.array([10.0, 20.0, 50.0]), np.array([[1.0, 6.0], [2.0, 12.0], [4.0, 24.0]])
    thick = thin * (1 - 3 / slenderness[:, None])
    given = Figure().subplots(1, 2)
    left, right = figure_slenderness(slenderness, thin, thick, axes=given).axes
    assert [left, right] == list(given)
    np.testing.assert_array_equal(drawn(left), [thick[:, 0], thin[:, 0], thick[:, 1], thin[:, 1]])
    np.testing.assert_allclose(drawn(right), 2 * [1 - 3 / slenderness])
    assert [line.get_linestyle() for line in left.lines] == ["-", ":", "-", ":"]
    assert "Hz" in left.get_ylabel() and right.get_xlabel() == left.get_xlabel()


def test_damping_ratios_against_the_damper():
    damper, ratio = np.array([0.1, 1.0, 10.0]), np.array([[1e-4, 1e-3], [1e-3, 1e-2], [1e-4, 1e-3]])
    (ax,) = figure_damped_joint(damper, ratio).axes
    np.testing.assert_array_equal(drawn(ax), ratio.T)
    assert len({line.get_linestyle() for line in ax.lines}) == 2
    assert ax.get_xscale() == ax.get_yscale() == "log" and "N s/m" in ax.get_xlabel()


def test_eigenvalues_in_their_plane():
    eigenvalues, load = np.array([[1j, 3j], [1.5j, 2.5j], [-0.5 + 2j, 0.5 + 2j]]), np.array([0.0, 1.0, 2.0])
    axes = figure_eigenvalues(eigenvalues, load, label="load / N").axes
    clouds = axes[0].collections
    for points, values in zip(clouds, eigenvalues.T, strict=True):
        np.testing.assert_array_equal(points.get_offsets(), np.column_stack([values.real, values.imag]))
        np.testing.assert_array_equal(points.get_array(), load)
    assert len({len(points.get_paths()[0]) for points in clouds}) == 2  # the markers differ
    assert "1/s" in axes[0].get_xlabel() and "rad/s" in axes[0].get_ylabel() and axes[1].get_ylabel() == "load / N"
