"""Figures of systems other than an arm: the curves are those of the public functions, axes say what they show."""

from __future__ import annotations

import numpy as np
import pytest
import sympy as sp
from matplotlib.backends.backend_agg import FigureCanvasAgg

import cra_sym as cra
from cra_sym.figures import FIGURES, draw, shows_any_system
from cra_sym.figures.vibration import shaped_moves
from tests.systems import NAMES, TURNING, system

COARSE = {
    "zones": {"points": 5, "tolerance": 1e-3},
    "combinations": {"points": 21},
    "frequency_response": {"points": 50},
    "residual_vibration": {"points": 9},
    "input_shaping": {"points": 9},
}
SHOWN = [name for name in FIGURES if shows_any_system(name) and name not in ("slip_amplitude", "backbone")]


# those of the others cost seconds and take no other way
DEAR = {
    "combinations": ("string", "gantry"),
    "residual_vibration": ("string", "two planes"),
    "input_shaping": ("string", "gantry"),
}


@pytest.mark.sample(4, 3)
@pytest.mark.parametrize("name", NAMES)
def test_every_figure_of_a_system_draws_every_system(name):
    given = system(name, 0.01)
    for figure in SHOWN:
        if name in DEAR.get(figure, NAMES):
            drawn = draw(figure, given, **COARSE.get(figure, {}))
            FigureCanvasAgg(drawn).draw()
            assert all(ax.lines or ax.collections or ax.texts for ax in drawn.axes), figure
            assert any(ax.get_xlabel() for ax in drawn.axes) and any(ax.get_ylabel() for ax in drawn.axes), figure


def test_figures_of_what_has_no_natural_modes():
    pipe, shaft = (system(name) for name in TURNING)
    for figure in ("residual_vibration", "input_shaping"):
        draw(figure, pipe, **COARSE[figure])
    exact, _, many = curves(draw("frequency_response", shaft, points=12).axes[0])
    alone = np.abs(cra.frequency_response(shaft, exact[:, 0], drive="w"))
    np.testing.assert_allclose(exact[:, 1], alone, rtol=1e-9)
    np.testing.assert_allclose(many[:, 1], exact[:, 1], rtol=0.05)  # of twelve modes


def test_a_linear_system_has_neither_friction_nor_a_backbone_to_draw():
    with pytest.raises(ValueError, match="system: must have elastic-slip elements"):
        draw("slip_amplitude", system("string", 0.01))
    with pytest.raises(ValueError, match="system: is linear, so its backbone has no end"):
        draw("backbone", system("string", 0.01))


@pytest.mark.parametrize(("name", "options"), [("slip_amplitude", {"amplitude": [0.01]}), ("backbone", {"points": 9})])
def test_an_arm_is_given_the_joint_that_such_a_figure_is_about(name, options):
    arm = cra.Arm.nominal().replace(zeta=0.01)
    (line, *_) = draw(name, arm, **options, modes=2).axes[0].lines
    assert abs(line.get_ydata()[0] / cra.natural_frequencies(arm, 1) - 1) < 0.4  # of the rigid joint


def curves(ax):
    return [line.get_xydata() for line in ax.lines if len(line.get_xdata()) > 10]


def test_the_curves_are_the_public_functions():
    """Each in the shape and the units of what it says."""
    given = system("beam with an interior mass", 0.02)
    over = draw("frequencies", given, parameter="m").axes[0]
    values = curves(over)[0][:, 0]
    found = cra.natural_frequencies(given.replace(m=values))
    np.testing.assert_array_equal([curve[:, 1] for curve in curves(over)], found.T)
    assert over.get_xlabel() == "$m$" and values.min() < 0.1 < values.max()
    (shape,) = curves(draw("mode_shapes", given, modes=2).axes[1])
    np.testing.assert_array_equal(shape[:, 1], cra.mode_shapes(given, shape[:, 0], 2)[1])
    move = {"w": cra.BaseMotion.trapezoid(0.1, 0.2, 1.0), "p": cra.Force(2.0)}
    (moved,) = curves(draw("response", given, motion=move).axes[0])
    np.testing.assert_array_equal(moved[:, 1], cra.tip_response(given, move, moved[:, 0]))
    tip = draw("frequency_response", given, drive="p", points=20).axes[0]
    exact, few, more = curves(tip)
    np.testing.assert_allclose(exact[:, 1], np.abs(cra.frequency_response(given, exact[:, 0], drive="p")), rtol=1e-9)
    low = exact[:, 0] < 2 * np.pi * found[0, 0]
    assert (np.abs(more / exact - 1)[low, 1] < 1e-2).all() and (np.abs(few / exact - 1)[low, 1] < 5e-2).all()


def test_springs_of_the_ends_are_drawn_beside_rigid_ones():
    given = system("Timoshenko beam")
    (spring,) = [name for name in given.values if name == "k"]
    assert not given.numerics("stiffnesses")  # k holds two displacements: rigid ends are not one value of it
    arm = cra.Arm.nominal().replace(L=2.0, k_t=300.0, k_r=20.0)
    rigid, elastic = curves(draw("mode_shapes", arm).axes[0])
    np.testing.assert_array_equal(elastic[:, 1], cra.mode_shapes(arm, elastic[:, 0])[0])
    assert elastic[-1, 0] == 2.0 and abs(rigid[0, 1]) < 1e-12 and spring == "k"


@pytest.mark.parametrize("name", ["fig03", "fig05", "fig07", "fig08", "frequency_response", "response"])
def test_figures_follow_the_arm_handed_in(name):
    """Another length, end mass and joint move the curves, and the axes with them."""
    arm = cra.Arm.nominal().replace(L=3.0, m_e=0.05, k_t=2e3)
    options = {"points": 20} if name == "frequency_response" else {}
    paper, other = (curves(draw(name, *given, **options).axes[0])[-1] for given in ((), (arm,)))
    assert paper.shape == other.shape and not np.allclose(paper[:, 1], other[:, 1], rtol=0.05)
    assert not np.allclose(paper[:, 0], other[:, 0], rtol=0.05)


def test_a_string_held_at_both_ends_is_shown_where_it_moves():
    from sympy import symbols

    from cra_sym.symbols import L, t, v, x

    mass, tension = symbols("mass tension")
    string = cra.Model(
        mass * v.diff(t) ** 2 / 2 - tension * v.diff(x) ** 2 / 2,
        fields=[v], x=x, domain=(0, L), t=t, essential=[v.subs(x, 0), v.subs(x, L)],
    ).at({mass: 1.0, tension: 4.0, L: 1.0})  # fmt: skip
    (moved,) = curves(draw("response", string).axes[0])
    assert np.abs(moved[:, 1]).max() == pytest.approx(0.25, rel=0.1)  # the middle, unit velocity: half a period long
    answers = draw("frequency_response", string, points=15).axes
    assert len(answers) == 1 and np.isfinite(curves(answers[0])[0]).all()


@pytest.mark.parametrize(
    ("name", "given", "options", "words"),
    [
        ("fig06", system("string"), {}, "system has no parameter 'L': this figure is of an arm"),
        ("frequencies", 3, {}, "system = 3: must be a System"),
        ("frequencies", None, {"parameter": "k"}, "parameter = 'k': must be one of L, b"),
        ("frequencies", None, {"colour": 1}, r"colour = 1: 'frequencies' takes system, parameter"),
        ("derivation", cra.Arm.nominal(), {}, "it shows no arm"),
        ("input_shaping", None, {"parameter": "J_e"}, "J_e = 0 must be finite and not zero"),
        ("residual_vibration", None, {"parameter": "q"}, "parameter = 'q': must be one of L, b"),
        ("response", cra.Arm.nominal().replace(m_e=[0.1, 0.2]), {}, r"system has shape \(2,\)"),
    ],
)
def test_what_cannot_be_drawn_is_named(name, given, options, words):
    with pytest.raises((TypeError, ValueError), match=words):
        draw(name, given, **options)


def test_axes_of_what_is_left_after_moves_follow_the_arm():
    """Time, stiffness and colour reach as far as the vibration of an arm of four times the period does."""
    long = cra.Arm.nominal().replace(L=2.0, k_t=300.0, k_r=20.0, zeta=0.01)
    (panel, *_), (shaped, _) = (draw(name, long).axes for name in ("residual_vibration", "input_shaping"))
    period = 1 / cra.natural_frequencies(long.replace(k_t=np.inf), 1)[0]
    assert panel.get_xlim() == pytest.approx((0.85, 0.85 + 4.25 * period)) and 1.0 < period
    assert panel.get_ylim() == pytest.approx((1.0, 1e4))  # EI / L^3 is an eighth of the paper's arm's
    assert curves(shaped)[0][-1, 0] > 5.0
    (mesh, *_) = panel.collections
    assert mesh.norm.vmax / 10 < mesh.get_array().max() <= mesh.norm.vmax == pytest.approx(1e4 * mesh.norm.vmin)


def test_what_is_left_after_moves_of_any_system_is_the_public_function():
    given = system("gantry", 0.02)
    panel = draw("residual_vibration", given, parameter="c", points=9).axes[0]
    (mesh, *_) = panel.collections
    duration, stiffness = mesh.get_coordinates()[-1, -1]
    none, (fast, *_) = cra.Force.sampled([0.0, 1.0], [0.0, 0.0], exact=True), shaped_moves(given).values()
    slow = cra.BaseMotion.s_curve(0.5, 1.0, 4.0, 40.0, duration=duration)
    left = cra.residual_vibration(given.replace(c=stiffness), {"w": slow, "p": none})
    assert mesh.get_array().reshape(mesh.get_coordinates().shape[:2])[-1, -1] == pytest.approx(1e3 * left, rel=1e-9)
    assert panel.get_ylabel() == "$c$" and stiffness > 900.0
    shaped, wrong = draw("input_shaping", given, parameter="c", points=9).axes
    first = curves(shaped)[0]
    np.testing.assert_allclose(first[:, 1], 1e3 * cra.tip_response(given, {"w": fast, "p": none}, first[:, 0]))
    assert wrong.get_xlabel() == "true $c$ / assumed $c$"


def pendulum_under_a_carriage():
    x, t, m, k, c, g, length = sp.symbols("x t m k c g l")
    q, turn, w = (sp.Function(name)(t) for name in ("q", "turn", "w"))
    hung = m * ((q + w).diff(t) + length * turn.diff(t)) ** 2 / 2 - m * g * length * turn**2 / 2
    return cra.Model(
        0, fields=[], x=x, domain=(0, 1), t=t, coordinates=[q, turn], prescribed=[w],
        left=2 * m * (q + w).diff(t) ** 2 / 2 + hung - k * q**2 / 2, virtual_work=[(-c * q.diff(t), q, None)],
    ).at({"m": 0.6, "k": 100.0, "c": 0.5, "g": 9.81, "l": 0.7})  # fmt: skip


@pytest.mark.parametrize("name", ["combinations", "frequency_response", "residual_vibration", "input_shaping"])
def test_figures_of_two_coordinates(name):
    """They asked for a third mode, or for a field."""
    given = pendulum_under_a_carriage()
    drawn = draw(name, given, **COARSE[name])
    FigureCanvasAgg(drawn).draw()
    if name == "frequency_response":
        (panel,) = drawn.axes
        exact, one = curves(panel)
        static = np.diag([0.6 * 0.7 * 9.81, 100.0])[::-1, ::-1]
        mass = 0.6 * np.array([[3.0, 0.7], [0.7, 0.49]])
        for omega, found in exact[::7]:
            whole = static + 1j * omega * np.diag([0.5, 0.0]) - omega**2 * mass
            assert found == pytest.approx(abs(np.linalg.solve(whole, -mass[:, 0])[0]), rel=1e-9)
        assert one.shape == exact.shape and panel.get_ylabel().startswith("$q$ per unit")


def test_a_parameter_is_wrongly_known_as_far_as_there_is_a_system():
    """A length of half the assumed one would leave the mass outside, which the figure had refused."""
    x, t, a, m, length = sp.symbols("x t a m l")
    v, w = sp.Function("v")(x, t), sp.Function("w")(t)
    beam = cra.Model(
        (v + w).diff(t) ** 2 / 2 - 5 * v.diff(x, 2) ** 2, fields=[v], x=x, domain=(0, length), t=t, prescribed=[w],
        essential=[v.subs(x, 0), v.diff(x).subs(x, 0)], inside=[(a, m * (v + w).diff(t) ** 2 / 2)],
    ).at({"a": 0.9, "m": 0.2, "l": 1.2})  # fmt: skip
    _, wrong = draw("input_shaping", beam, parameter="l", points=5).axes
    factors = wrong.lines[0].get_xdata()
    assert 0.9 / 1.2 < factors[0] < 1.0 and factors[-1] == pytest.approx(1 / factors[0])
    held = beam.model.replace(essential=[v.subs(x, 0), v.subs(x, length)]).at(beam.values)
    for name in ("residual_vibration", "input_shaping"):
        with pytest.raises(ValueError, match="its right end does not move"):
            draw(name, held, parameter="m", points=3)
