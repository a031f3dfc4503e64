"""Systems without natural modes, as moving strings: what is swept, identified and explored is what oscillates."""

from __future__ import annotations

import matplotlib.pyplot as plt
import numpy as np
import pytest
import sympy as sp

import cra_sym as cra
from cra_sym.figures.modes import figure_frequencies
from tests.campaigns import columns

x, t, length, mass, tension, speed, k = sp.symbols("x t l m T c k")
v = sp.Function("v")(x, t)
VALUES = {"l": 1.2, "m": 0.3, "T": 20.0, "c": 3.0, "k": 500.0}


@pytest.fixture(scope="module")
def string():
    """A moving string between a wall and a spring; without a spring's give it is known in closed form."""
    return cra.Model(
        mass * (v.diff(t) + speed * v.diff(x)) ** 2 / 2 - tension * v.diff(x) ** 2 / 2,
        fields=[v], x=x, domain=(0, length), t=t, left=-k * v**2 / 2, essential=[v.subs(x, length)],
    ).at(VALUES)  # fmt: skip


def closed(number, speed):
    """Return the frequencies between two eyes, Hz: n (w^2 - c^2) / (2 l w), w the speed of waves."""
    wave = np.sqrt(20.0 / 0.3)
    return np.arange(1, number + 1) * (wave**2 - np.asarray(speed)[..., None] ** 2) / (2 * 1.2 * wave)


def test_identify_finds_the_speed_and_its_uncertainty(string):
    rigid = string.replace(k=np.inf)
    measured, sigma = closed(3, 3.0), np.array([0.01, 0.02, 0.02])
    fit = cra.identify(rigid.replace(c=1.3), measured, sigma, unknown=("c",))
    assert fit.fits and len(fit.solutions) == 1
    assert fit.values["c"] == pytest.approx(3.0, rel=1e-7)
    np.testing.assert_allclose(fit.frequencies, measured, rtol=1e-9)
    slope = -2 * 3.0 * np.arange(1, 4) / (2 * 1.2 * np.sqrt(20.0 / 0.3))
    assert fit.covariance[0, 0] == pytest.approx(1 / np.sum((slope / sigma) ** 2), rel=1e-6)


def test_identify_finds_a_spring(string):
    measured = cra.eigenvalues(string, 3).imag / (2 * np.pi)
    fit = cra.identify(string.replace(k=1.0), measured, 1e-3, unknown=("k",))
    assert fit.fits and fit.values["k"] == pytest.approx(500.0, rel=1e-6)


def test_identify_finds_the_springs_of_lumped_masses():
    """Two masses on springs, and one in a frame that turns: the characteristic polynomial by hand."""
    p, q = (sp.Function(name)(t) for name in "pq")
    lumped = {"fields": (), "coordinates": [p, q], "x": x, "domain": (0, 1), "t": t}
    kinetic, turning = mass * (p.diff(t) ** 2 + q.diff(t) ** 2) / 2, mass * speed * (p * q.diff(t) - q * p.diff(t))
    for more, c in ((0, 0.0), (turning, 0.4)):
        system = cra.Model(sp.S.Zero, left=kinetic + more - k * (p**2 + 2 * q**2) / 2, **lumped)
        squares = np.roots([1.0, -(3 * 5.0 / 0.3 + 4 * c**2), 2 * (5.0 / 0.3) ** 2])
        measured = np.sqrt(np.sort(squares)) / (2 * np.pi)
        given = {"m": 0.3, "k": 11.0} | ({"c": c} if c else {})
        fit = cra.identify(system.at(given), measured, 1e-3, unknown=("k",))
        assert fit.fits and fit.values["k"] == pytest.approx(5.0, rel=1e-7)


def test_identify_needs_a_size(string):
    with pytest.raises(ValueError, match="c = 0 in system: must have a value of its size"):
        cra.identify(string.replace(c=0.0), [1.0, 2.0], 0.1, unknown=("c",))


def test_identify_leaves_out_what_buckles():
    """Most of the axial loads among which the search starts buckle the column, whose frequencies are known."""
    P, EI = sp.symbols("P EI")
    column = cra.Model(
        mass * v.diff(t) ** 2 / 2 - EI * v.diff(x, 2) ** 2 / 2 + P * v.diff(x) ** 2 / 2,
        fields=[v], x=x, domain=(0, length), t=t, essential=[v.subs(x, 0), v.subs(x, length)],
    )  # fmt: skip
    wave = np.arange(1, 3) * np.pi / 1.2
    measured = wave * np.sqrt((5.0 * wave**2 - 10.0) / 0.2) / (2 * np.pi)
    fit = cra.identify(column.at({"m": 0.2, "EI": 5.0, "l": 1.2, "P": 4.0}), measured, 1e-3, unknown=("P",))
    assert fit.fits and fit.values["P"] == pytest.approx(10.0, rel=1e-9)


def test_a_column_is_found_where_others_buckle():
    """``python -m tests.campaigns.columns`` tries fifty."""
    assert columns.tried(columns.column(), trial=1) < columns.CLOSE


def test_sweeps_label_what_oscillates(string):
    speeds, rigid = np.array([0.5, 2.0, 4.0]), string.replace(k=np.inf)
    found = cra.sweep(rigid, "oscillating_frequencies", c=speeds, modes=2)
    assert found.oscillating_frequencies.dims == ("c", "mode") and found.oscillating_frequencies.attrs["units"] == "Hz"
    np.testing.assert_allclose(found.oscillating_frequencies, closed(2, speeds), rtol=1e-9)
    whole = cra.sweep(rigid, "eigenvalues", c=speeds, modes=2).eigenvalues
    np.testing.assert_allclose(whole.values.imag, 2 * np.pi * closed(2, speeds), rtol=1e-9)
    np.testing.assert_allclose(cra.sweep(rigid, "damping_ratios", c=speeds).damping_ratios, 0.0, atol=1e-9)
    with pytest.raises(ValueError, match="use eigenvalues"):
        cra.sweep(rigid, "natural_frequencies", c=speeds)


def test_the_figure_shows_what_oscillates(string):
    figure = figure_frequencies(string.replace(k=np.inf), "c", [1.0, 2.0], modes=2)
    (ax,) = figure.axes
    assert ax.get_ylabel() == "oscillating frequency / Hz"
    lines = [line.get_ydata() for line in ax.lines if len(line.get_ydata()) == 2 and line.get_label().startswith("$f")]
    np.testing.assert_allclose(np.transpose(lines), closed(2, [1.0, 2.0]), rtol=1e-9)
    plt.close(figure)


def test_explore_follows_the_complex_modes(string):
    view = cra.explore(string)
    assert set(view.views) == {"modes", "response", "zones"}
    for name in ("modes", "response"):
        view._draw(name)
    axes = view.views["modes"].figure.axes
    first = axes.flat[0].lines[-1].get_ydata()
    here = np.linspace(0.0, 1.2, 301)
    shapes = cra.mode_shapes(string, here, 3, damped=True)
    np.testing.assert_allclose(first, shapes[0].real, atol=1e-9)
    view._set(swing=1.0, c=5.0)
    shapes = cra.mode_shapes(string.replace(c=5.0), here, 3, damped=True)
    moved = axes.flat[0].lines[-1].get_ydata()
    np.testing.assert_allclose(moved, (shapes[0] * np.exp(1j)).real, atol=1e-9)
