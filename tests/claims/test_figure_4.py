"""Fig. 4: the derived frequencies beside those of the flipped sign."""

import numpy as np

import cra_sym as cra
from cra_sym.claims.figure_4 import figure_4
from cra_sym.paper.oracles.flipped import flipped_frequencies


def curves(ax):
    return [line for line in ax.lines if len(line.get_xdata()) > 2]


def test_figure_4_sets_the_derived_result_beside_the_flipped_sign():
    k_r = np.logspace(2, 5, 7)
    derived, flipped, *relative = figure_4(k_r=k_r).axes
    softened = cra.Arm.nominal().replace(k_r=k_r)
    np.testing.assert_array_equal([line.get_ydata() for line in curves(derived)], cra.natural_frequencies(softened).T)
    np.testing.assert_array_equal([line.get_ydata() for line in curves(flipped)], flipped_frequencies(softened).T)
    assert all(np.all(np.diff(line.get_ydata()) > 0) for line in curves(relative[0]))
    assert all(np.all(np.diff(line.get_ydata()) < 0) for line in curves(relative[1]))
