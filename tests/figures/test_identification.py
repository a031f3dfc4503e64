"""The figure of a fit shows the numbers of the fit."""

import warnings

import numpy as np
import pytest
import sympy as sp
from matplotlib.figure import Figure

import cra_sym as cra
from cra_sym.figures.identification import figure_fit
from cra_sym.symbols import t, v, x

TENSION = sp.Symbol("tension")
STRING = cra.Model(
    v.diff(t) ** 2 / 2 - TENSION * v.diff(x) ** 2 / 2, fields=[v], x=x, domain=(0, 1), t=t,
    essential=[v.subs(x, 0), v.subs(x, 1)],
)  # fmt: skip


@pytest.mark.parametrize("off", [0.0, 0.1])
def test_data_and_fit_of_any_system(off):
    measured, modes = np.array([1.0, 2.0 + off, 4.0]), (1, 2, 4)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", cra.MisfitWarning)
        fit = cra.identify(STRING.at({"tension": 3.0}), measured, 0.01, unknown=("tension",), modes=modes)
    given = Figure().subplots(1, 2)
    left, right = figure_fit(fit, axes=given).axes
    assert [left, right] == list(given)
    np.testing.assert_array_equal(left.lines[0].get_xydata(), np.stack([modes, measured], -1))
    fitted = left.get_legend_handles_labels()
    np.testing.assert_array_equal(left.lines[-1].get_ydata(), fit.frequencies)
    assert sorted(fitted[1]) == ["fitted", "measured"]
    np.testing.assert_allclose(right.lines[-1].get_ydata(), (measured - fit.frequencies) / 0.01)
    assert [text.get_text() for text in right.texts] == (["mode 2"] if off else [])
    assert ("no fit" in right.get_title(loc="left")) == bool(off) and "Hz" in left.get_ylabel()


def test_what_is_no_fit_is_named():
    with pytest.raises(TypeError, match="fit = 3: must be an Identification"):
        figure_fit(3)
