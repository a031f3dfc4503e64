"""Every figure: drawn by derived numbers, told in words, deterministic, and without a trace in global state."""

from collections import defaultdict
from importlib import import_module

import numpy as np
import pytest
from matplotlib import rcParams
from matplotlib.backends.backend_agg import FigureCanvasAgg

from cra_sym.figures import FIGURES, described, draw, shows_an_arm
from cra_sym.report.pictures import save_figures
from tests.systems import system

#: The chapters show them whole.
COARSE = {
    "fig11": {"points": 9},
    "fig12": {"points": 9},
    "combinations": {"points": 60},
    "inside_tongues": {"modes": 2},
    "preload": {"duration": 1.0},
    "preload_tongues": {"amplitudes": 2},
    "residual_vibration": {"points": 41},
}


def function(name):
    module, attribute = FIGURES[name].split(":")
    return getattr(import_module(module), attribute)


def test_the_numbered_figures_lead_in_order():
    numbered = [name for name in FIGURES if name.startswith("fig")]
    assert list(FIGURES)[: len(numbered)] == sorted(numbered)


@pytest.mark.parametrize("name", FIGURES)
def test_words_for_those_who_do_not_see_it(name):
    first = function(name).__doc__.split("\n\n")[0]
    assert 20 < len(first) < 300


@pytest.fixture(scope="module", params=FIGURES)
def drawn(request):
    """Every figure, drawn once, with the global settings before and after."""
    before = dict(rcParams)
    return draw(request.param, **COARSE.get(request.param, {})), before, dict(rcParams)


def test_draws_something_and_leaves_no_trace(drawn):
    figure, before, after = drawn
    assert before == after
    # "C0" would be looked up where the figure is shown, in another style than that it was drawn in
    assert not [line for ax in figure.axes for line in ax.lines if str(line.get_color()).startswith("C")]
    canvas = FigureCanvasAgg(figure)
    canvas.draw()
    grey = np.asarray(canvas.buffer_rgba())[..., :3].mean(axis=-1)
    assert 0.005 < (grey < 250).mean() < 0.9


def test_axes_carry_quantity_and_unit(drawn):
    """Each column of panels names its horizontal axis at least once, each row its vertical one."""
    panels = [ax for ax in drawn[0].axes if ax.axison and ax.get_subplotspec()]
    columns, rows = defaultdict(str), defaultdict(str)
    for ax in panels:
        columns[ax.get_subplotspec().colspan.start] += ax.get_xlabel()
        rows[ax.get_subplotspec().rowspan.start] += ax.get_ylabel()
    assert all(columns.values()) and all(rows.values())


@pytest.mark.parametrize("asked", [draw, described, shows_an_arm])
def test_an_unknown_figure_is_named(asked):
    with pytest.raises(ValueError, match=r"fig99.*fig01"):
        asked("fig99")


def test_what_is_no_arm_is_named():
    with pytest.raises(TypeError, match="system = 5: must be a System"):
        draw("fig03", 5)
    string = system("string")
    with pytest.raises(ValueError, match="system has no parameter 'L': this figure is of an arm, with L, b, h, E"):
        draw("fig03", string)
    with pytest.raises(ValueError, match=r"'frequencies', 'mode_shapes', 'response', .* show any system"):
        draw("fig04", string)
    with pytest.raises(TypeError, match=r"system = <System.*must be an Arm"):
        function("fig04")(string)


def test_files_are_the_same_in_each_run(tmp_path):
    first, second = (save_figures(tmp_path / run, ["fig02"]) for run in "ab")
    assert [path.name for path in first] == ["fig02.png", "fig02.svg"]
    assert [path.read_bytes() for path in first] == [path.read_bytes() for path in second]
    assert len(first[0].read_bytes()) > 10_000
