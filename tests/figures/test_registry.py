"""Every figure: drawn by derived numbers, told in words, deterministic, and without a trace in global state."""

from importlib import import_module

import numpy as np
import pytest
from matplotlib import rcParams
from matplotlib.backends.backend_agg import FigureCanvasAgg

from cra_sym.figures import FIGURES, draw
from cra_sym.report.pictures import save_figures


def function(name):
    module, attribute = FIGURES[name].split(":")
    return getattr(import_module(module), attribute)


def test_names_are_in_order():
    assert list(FIGURES) == sorted(FIGURES)


@pytest.mark.parametrize("name", FIGURES)
def test_words_for_those_who_do_not_see_it(name):
    first = function(name).__doc__.split("\n\n")[0]
    assert 20 < len(first) < 300


@pytest.mark.parametrize("name", FIGURES)
def test_draws_something_and_leaves_no_trace(name):
    before = dict(rcParams)
    figure = draw(name)
    assert dict(rcParams) == before
    canvas = FigureCanvasAgg(figure)
    canvas.draw()
    grey = np.asarray(canvas.buffer_rgba())[..., :3].mean(axis=-1)
    assert 0.005 < (grey < 250).mean() < 0.9


@pytest.mark.parametrize("name", FIGURES)
def test_axes_carry_quantity_and_unit(name):
    for ax in draw(name).axes:
        if ax.axison and ax.get_label() != "<colorbar>":
            shown = [ax.xaxis, ax.yaxis]
            labels = [axis.get_label_text() for axis in shown if any(t.get_text() for t in axis.get_ticklabels())]
            assert all(labels), labels


def test_an_unknown_figure_is_named():
    with pytest.raises(ValueError, match=r"fig99.*fig01"):
        draw("fig99")


def test_files_are_the_same_in_each_run(tmp_path):
    first, second = (save_figures(tmp_path / run, ["fig02"]) for run in "ab")
    assert [path.name for path in first] == ["fig02.png", "fig02.svg"]
    assert [path.read_bytes() for path in first] == [path.read_bytes() for path in second]
    assert len(first[0].read_bytes()) > 10_000
