"""The explorer: sliders made from the nomenclature, pictures that are the kernels' numbers, life without widgets."""

from __future__ import annotations

import sys
from base64 import b64decode
from concurrent.futures import ThreadPoolExecutor
from io import BytesIO

import numpy as np
import pytest
import sympy as sp
from PIL import Image

import cra_sym as cra
from cra_sym.extras import MissingExtraError
from cra_sym.figures import draw
from cra_sym.symbols import nomenclature, row, t, x
from tests.systems import system

VALUES = {"k_t", "k_r", "m_e", "J_e", "L", "b", "h", "E", "rho", "v_m", "a_m", "B", "varpi", "psi", "epsilon"}
WIDGET = "application/vnd.jupyter.widget-view+json"


def pixels(png):
    return np.asarray(Image.open(BytesIO(png)).convert("L"), dtype=float)


def drawn(view, axis=0):
    """The curves of an axis: x and y of every line with more than a few points."""
    return [line.get_xydata() for line in view.figure.axes[axis].lines if len(line.get_xdata()) > 10]


@pytest.fixture(scope="module")
def moved():
    """An explorer whose sliders were all moved away from where they stood."""
    pytest.importorskip("ipywidgets", reason="needs the extra explore: ipywidgets")
    view = cra.explore()
    assert view.panel.children
    for name, value in {"k_t": 1e3, "k_r": np.inf, "m_e": 0.005, "v_m": 0.05, "B": 2e-3, "varpi": 20.0}.items():
        view.sliders[name].value = value
    view.sliders["epsilon"].value = 0.2
    return view


def test_a_slider_for_each_value_labelled_by_the_nomenclature(moved):
    assert set(moved.sliders) == VALUES <= {entry.name for entry in nomenclature()}
    for name, slider in moved.sliders.items():
        assert slider.tooltip == row(name).meaning
        assert f"${row(name).latex}$" in slider.description
        unit = row(name).unit.replace("^2", "²").replace("^3", "³")
        assert unit == "1" or unit in slider.description


def test_stiffness_runs_through_decades_to_a_rigid_joint(moved):
    for name in ("k_t", "k_r"):
        *finite, (label, rigid) = moved.sliders[name].options
        assert (label, rigid) == ("rigid", np.inf)
        np.testing.assert_allclose(np.diff(np.log10([value for _, value in finite])), 0.1, atol=1e-6)


def test_sliders_are_arm_and_motion(moved):
    assert moved.system == cra.Arm.nominal().replace(k_t=1e3, k_r=np.inf, m_e=0.005)
    expected = cra.BaseMotion(velocity=0.05, acceleration=0.1, amplitude=2e-3, angular_frequency=20.0)
    t = np.linspace(0, 1, 7)
    np.testing.assert_array_equal(moved.motion.kinematics(t), expected.kinematics(t))


def test_mode_shapes_are_the_kernels(moved):
    for mode in range(3):
        zero, rigid, elastic = moved.views["modes"].figure.axes[mode].lines
        x = elastic.get_xdata()
        np.testing.assert_array_equal(elastic.get_ydata(), cra.mode_shapes(moved.system, x)[mode])
        np.testing.assert_array_equal(rigid.get_ydata(), cra.mode_shapes(moved.system.replace(k_t=np.inf), x)[mode])
        assert not np.any(zero.get_ydata())
        hertz = cra.natural_frequencies(moved.system)[mode]
        assert f"{hertz:.2f} Hz" in elastic.get_label()


def test_response_is_the_kernels(moved):
    rigid, given = drawn(moved.views["response"])
    for arm, curve in ((moved.system.replace(k_t=np.inf), rigid), (moved.system, given)):
        np.testing.assert_array_equal(curve[:, 1], 1e3 * cra.tip_response(arm, moved.motion, curve[:, 0]))


def test_zones_are_the_kernels(moved):
    for mode in (1, 2, 3):
        lines = [
            line.get_xydata() for line in moved.views["zones"].figure.axes[mode - 1].lines if line.get_xdata().size
        ]
        centre = 2 * cra.modal_parameters(moved.system).omega[mode - 1]
        assert lines[0][-1, 1] == 0.2
        expected = [
            np.array(side) - centre
            for order in (1, 2)
            for side in cra.stability_boundary(
                moved.system, moved.excitation, lines[0][:, 1], (mode, mode), order=order
            )
        ]
        np.testing.assert_allclose([line[:, 0] for line in lines], expected, rtol=0, atol=1e-12)


def test_only_what_depends_on_a_slider_is_redrawn(moved):
    before = {name: image.value for name, image in moved.images.items()}
    moved.sliders["psi"].index += 12
    changed = {name for name, image in moved.images.items() if image.value != before[name]}
    assert changed == {"response"}


def test_a_redrawn_picture_is_the_one_drawn_from_scratch():
    """Frames are kept while only curves move; nothing of the old curves may stay."""
    pytest.importorskip("ipywidgets", reason="needs the extra explore: ipywidgets")
    view = cra.explore(B=2e-3)
    slider, image = view.sliders["psi"], view.images["response"]
    first = image.value
    slider.index = 1
    assert np.abs(pixels(image.value) - pixels(first)).max() > 100
    slider.value = 0.0
    np.testing.assert_array_equal(pixels(image.value), pixels(first))


def test_shapes_swing(moved):
    (play,) = [w for box in moved.panel.children[0].children for w in box.children if type(w).__name__ == "Play"]
    play.value = 12
    elastic = moved.views["modes"].figure.axes[0].lines[2]
    np.testing.assert_allclose(elastic.get_ydata(), -cra.mode_shapes(moved.system, elastic.get_xdata())[0])
    play.value = 0


def test_a_rigid_joint_cannot_fluctuate():
    view = cra.explore(k_t=np.inf)
    assert view.picture()
    assert all("rigid joint" in ax.texts[0].get_text() for ax in view.views["zones"].figure.axes)
    assert all(len(ax.collections) == 0 for ax in view.views["zones"].figure.axes)


def test_shows_sliders_and_a_picture(moved):
    data = moved._repr_mimebundle_()
    assert {WIDGET, "image/png", "text/plain"} == set(data)
    heights = [pixels(image.value).shape[0] for image in moved.images.values()]
    assert pixels(b64decode(data["image/png"])).shape[0] == sum(heights)


def test_without_the_extra_a_picture_and_an_error_that_names_it(monkeypatch):
    monkeypatch.setitem(sys.modules, "ipywidgets", None)
    view = cra.explore(k_t=1e3)
    assert set(view._repr_mimebundle_()) == {"image/png", "text/plain"}
    with pytest.raises(MissingExtraError, match=r"ipywidgets.*'explore'"):
        _ = view.panel


@pytest.mark.parametrize(
    ("given", "told"),
    [
        ({"k": 1.0}, "k: must be among"),
        ({"k_t": -1.0}, "k_t"),
        ({"k_t": [1.0, 2.0]}, r"k_t has shape \(2,\)"),
        ({"B": np.nan}, "B = nan"),
        ({"epsilon": 0.0}, "epsilon"),
        ({"epsilon": 1e3}, "epsilon"),
        ({"excitation": "x" * 1000}, r"^excitation = 'x{70,76}\.\.\.: must be a single"),
        ({"system": cra.Arm.nominal().replace(k_t=[1.0, 2.0])}, r"system has shape \(2,\)"),
        ({"system": 3}, "system = 3: must be a System"),
        ({"excitation": cra.TransverseBase(0.001)}, "TransverseBase"),
    ],
)
def test_bad_values_are_named(given, told):
    with pytest.raises((TypeError, ValueError), match=told):
        cra.explore(**given)


@pytest.mark.parametrize("name", ["Timoshenko beam", "gantry"])
def test_any_system_is_explored(name):
    """Sliders for all its parameters; the pictures are those of the system they stand for."""
    pytest.importorskip("ipywidgets", reason="needs the extra explore: ipywidgets")
    view = cra.explore(system(name), rhoA=0.4)
    assert view.panel.children and set(view.system.values) <= set(view.sliders)
    view.sliders["l"].index += 3
    length = view.sliders["l"].value
    assert view.system == system(name, rhoA=0.4, l=length) != system(name, rhoA=0.4)
    shape = view.views["modes"].figure.axes[0].lines[-1]
    expected = cra.mode_shapes(view.system, shape.get_xdata())[0]
    np.testing.assert_array_equal(shape.get_ydata(), expected)
    assert (view.motion is None) is (name == "gantry")  # a force acts on it too
    assert f"l = {length:.4g}" in repr(view)


def test_the_geometry_of_the_arm_has_sliders(moved):
    view = cra.explore()
    view._set(L=1.5, E=7e10)
    assert (view.system.L, view.system.E) == (1.5, 7e10)
    lowest, *_, highest = (value for _, value in moved.sliders["h"].options)
    assert lowest < cra.Arm.nominal().h < highest


@pytest.mark.parametrize("given", [{}, {"L": 0.87, "m_e": 1e-5, "J_e": 3e-6, "k_t": 123.4}, {"k_r": np.inf}])
def test_the_first_values_stand_on_the_sliders(given):
    """JupyterLab had moved them to the nearest step: the arm shown was 1.01 m long."""
    pytest.importorskip("ipywidgets", reason="needs the extra explore: ipywidgets")
    view = cra.explore(**given)
    for name, slider in view.sliders.items():
        values = [value for _, value in slider.options]
        assert values[slider.index] == slider.value == view.values[name]
        assert values == sorted(set(values)) and len(values) > 20


def test_sliders_moved_in_two_threads_leave_whole_pictures():
    """Titles and labels had been lost: JupyterLab runs what one slider starts beside what the next one does."""
    pytest.importorskip("ipywidgets", reason="needs the extra explore: ipywidgets")
    view, alone = cra.explore(), cra.explore()
    for one in (view, alone):
        one.views.pop("zones")  # the slow one
    moves = [{"a_m": 0.1 * k} for k in range(1, 6)], [{"B": 1e-3 * k} for k in range(1, 6)]
    with ThreadPoolExecutor(2) as pool:
        list(pool.map(lambda row: [view._set(**move) for move in row], moves))
    assert view.values == alone.values | {"a_m": 0.5, "B": 5e-3}
    figure = view.views["response"].figure
    assert figure.axes[0].get_title("left") and figure.axes[0].get_ylabel() and len(figure.axes[0].lines) == 4


def test_labels_are_not_cut_when_ticks_grow():
    """The y-label had been cut off once tick labels had two digits more."""
    view = cra.explore(k_t=1e3)
    figure = view.views["response"].figure
    view._draw("response")
    for values in ({"a_m": 1.0, "L": 3.0}, {"a_m": 0.001, "B": 0.0}, {"a_m": 1.0, "L": 4.0}):
        view._set(**values)
        for ax in figure.axes:
            box = ax.yaxis.get_tightbbox(figure.canvas.get_renderer())
            assert box.x0 >= 0 and box.y0 >= 0 and box.y1 <= figure.figure.bbox.height


def test_a_preload_is_a_slider_by_decades(monkeypatch):
    pytest.importorskip("ipywidgets", reason="needs the extra explore: ipywidgets")
    view = cra.explore(cra.BoltedJoint().parametric(cra.Arm.nominal(), 2.0))
    slider, redrawn = view.sliders["preload"], []
    monkeypatch.setattr(view, "_draw", redrawn.append)
    (_, lowest), *_, (_, highest) = slider.options
    assert lowest < 0.1 and highest > 50 and slider.value == 2.0
    slider.index += 10
    assert view.system.values["preload"] == slider.value > 7 and redrawn == ["modes", "response", "zones"]
    assert f"preload = {slider.value:.4g} N" in repr(view)


@pytest.mark.parametrize("turning", [False, True])
def test_coordinates_alone_are_explored(turning):
    """Two masses; where they turn, the complex modes have no picture."""
    a, b = (sp.Function(name)(t) for name in "ab")
    m, k, g = sp.symbols("m k g")
    energy = m * (a.diff(t) ** 2 + b.diff(t) ** 2) / 2 - k * (a**2 + 3 * (a - b) ** 2) / 2
    if turning:
        energy = energy + g * (a * b.diff(t) - b * a.diff(t)) / 2
    masses = cra.Model(0, fields=[], x=x, domain=(0, 1), t=t, coordinates=[a, b], left=energy)
    given = masses.at({m: 1.0, k: 100.0} | ({g: 0.5} if turning else {}))
    explorer = cra.explore(given, k=120.0)
    assert explorer.views.keys() == {"response", "zones"} | (set() if turning else {"modes"})
    before = explorer.picture()
    explorer._set(k=80.0)
    assert explorer.system.values["k"] == 80.0 and explorer.picture() != before
    if not turning:
        shown = [ax.lines[-1].get_ydata() for ax in draw("mode_shapes", given).axes]
        exact = [given.modes(2).coordinate(place) for place in (0, 1)]
        np.testing.assert_array_equal(np.transpose(shown), exact)


def test_values_without_a_system_are_said_in_the_picture():
    """A slider that leaves a mass outside the span had raised in its callback and left the old pictures."""
    pytest.importorskip("ipywidgets", reason="needs the extra explore: ipywidgets")
    view = cra.explore(system("beam with an interior mass"))
    view.picture()
    place = view.sliders["l"]
    good, bad = place.value, min(value for _, value in place.options)
    view.sliders["a"].value = max(value for _, value in view.sliders["a"].options)
    assert bad < view.values["a"] < good
    place.value = bad
    for one in view.views.values():
        (text,) = (text.get_text() for text in one.figure.axes[0].texts)
        assert "must be in the domain" in text.replace("\n", " ")
    assert view.values["l"] == bad and pixels(view.picture()).std() > 0
    place.value = good
    view.sliders["a"].value = 0.5
    assert drawn(view.views["response"])
