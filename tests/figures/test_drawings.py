"""Figures draw where they are told; Figures 1 and 2 show the derived mode shape of the arm they are given."""

import re
import warnings
from inspect import signature
from pathlib import Path

import numpy as np
import pytest
from matplotlib.figure import Figure

import cra_sym as cra
from cra_sym import figures
from cra_sym.figures import FIGURES, _function
from cra_sym.figures.drawing import deflection
from cra_sym.figures.joint import figure_2


def test_a_rigid_joint_gives_nothing():
    xi = np.linspace(0, 1, 11)
    rigid = deflection(cra.Arm.nominal(), xi)
    assert rigid[-1] == 1
    np.testing.assert_allclose(rigid[0], 0, atol=1e-12)
    soft = deflection(None, xi)
    assert soft[0] > 0.05 and soft[1] - soft[0] > 0.01


FIGURE_MODULES = sorted(Path(figures.__file__).parent.glob("*.py"))
SMALL = {
    "fig11": {"k_t": [1e3], "points": 2},
    "fig12": {"m_e": [0.0], "points": 2},
    "zones": {"points": 2},
    "backbone": {"points": 2, "modes": 1},
    "slip_amplitude": {"amplitude": [0.01], "modes": 1},
    "frequency_response": {"points": 2},
    "residual_vibration": {"points": 2},
    "input_shaping": {"points": 2},
    "frequencies": {"values": [1.0, np.inf], "modes": 1},
    "response": {"t": [0.0, 0.1], "modes": 1},
    "mode_shapes": {"modes": 1},
}
SHAPES = {"fig04": (2, 2), "fig05": (2, 2), "fig06": (2, 2), "fig11": (1, 3), "fig12": (1, 3), "zones": (1, 3)}
SHAPES |= {"mode_shapes": (1, 1), "response": (1, 1)}
DEAR = {"accuracy", "combinations", "inside_tongues", "preload", "preload_tongues", "shaken_across", "shaken_along"}
DEAR |= {"slip_loop", "zone_widths"}


def test_axes_are_made_in_one_place():
    """So that the figures of seconds take a user's axes as the others do."""
    makers = {path.name for path in FIGURE_MODULES if re.search(r"subplots?\(", path.read_text(encoding="utf-8"))}
    assert makers == {"drawing.py", "live.py"}


def drawable():
    for name in FIGURES:
        kinds = {"ax", "axes"} & signature(_function(name)).parameters.keys()
        if kinds and name not in DEAR:
            yield name, *kinds


@pytest.mark.parametrize(("name", "kind"), [*drawable()], ids=lambda given: given)
def test_every_figure_draws_where_it_is_told_in_the_smallest_sizes(name, kind):
    """Axes of a part of a figure; nothing else is touched, and the whole figure is returned."""
    whole = Figure()
    part, other = whole.subfigures(1, 2)
    grid = part.subplots(*(SHAPES.get(name, (1, 2)) if kind == "axes" else (1, 1)), squeeze=False)
    given = grid if kind == "axes" else grid[0, 0]
    with warnings.catch_warnings(action="error"):
        assert _function(name)(**SMALL.get(name, {}), **{kind: given}) is whole
    assert all(ax.lines or ax.collections or ax.texts or ax.patches for ax in grid.flat)
    assert not other.axes and not other.texts


@pytest.mark.parametrize(
    ("name", "options", "words"),
    [
        ("fig03", {"axes": 3}, "axes = 3: must be an Axes"),
        ("fig06", {"axes": [Figure().add_subplot()]}, "axes: must be 4 for this figure, 2 x 2, not 1"),
        ("frequencies", {"ax": [1]}, r"ax = \[1\]: must be an Axes"),
        ("fig03", {"k_t": 1e3}, "k_t = 1000.0: must hold at least 2 values"),
        ("fig04", {"k_r": [1.0, np.inf]}, r"k_r\[1\] = inf: must be real numbers in \(0, inf\)"),
        ("fig12", {"m_e": []}, r"m_e = \[\]: must hold at least 1 value$"),
        ("zones", {"epsilon": 0.0}, "epsilon = 0.0: must be real numbers in"),
        ("combinations", {"points": 5}, "points = 5: must be an integer of at least 6"),
        ("mode_shapes", {"phase": np.nan}, r"phase = nan: must be real numbers in \(-inf, inf\)"),
        ("slip_loop", {"preload": [1.0, 2.0]}, "preload has shape"),
        ("slip_amplitude", {"curve": 3}, "curve = 3: must be a Backbone"),
        ("derivation", {"chosen": ()}, "chosen = .*: must hold at least one equation"),
        ("fig01", {"arm": cra.Arm.nominal().replace(m_e=[0.1, 0.2])}, "system has shape"),
        ("fig10", {"arm": cra.Arm.nominal().replace(m_e=[0.1, 0.2])}, "system has shape"),
    ],
)
def test_what_a_figure_cannot_draw_is_named(name, options, words):
    with pytest.raises((TypeError, ValueError), match=words):
        _function(name)(**options)


def test_the_drawn_arm_follows_the_stiffness():
    def root(arm):
        collection = figure_2(arm).axes[0].collections[0]
        vertices = collection.get_paths()[0].vertices
        ends = vertices[vertices[:, 0] == 0, 1]
        return (ends.min() + ends.max()) / 2

    nominal = cra.Arm.nominal()
    assert root(nominal) == pytest.approx(0, abs=1e-6)
    assert root(nominal.replace(k_t=50.0)) > root(nominal.replace(k_t=500.0)) > 0
