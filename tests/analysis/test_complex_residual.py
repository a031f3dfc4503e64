"""Residual vibration where dampers and gyroscopic forces couple the modes: against time histories and input shapers."""

from __future__ import annotations

import numpy as np
import pytest
import sympy as sp
from scipy.linalg import block_diag, expm

import cra_sym as cra
from cra_sym.solvers.free_peaks import free_peaks
from tests.systems import BENT, VALUES, _model, m, t, v, w, x
from tests.systems import TURNING as WITHOUT_NATURAL_MODES
from tests.systems import system as named

c, g = sp.symbols("c g")
MOVE = cra.BaseMotion.trapezoid(0.1, 0.4, 3.0)
END = {"right": m * (v + w).diff(t) ** 2 / 2}
DAMPED = _model(BENT, **END, virtual_work=[(-c * v.diff(t), v, "right")])
TURNING = _model(BENT + g * v.diff(t) * v.diff(x), **END)
#: A string that runs along itself: its base acts by its velocity too.
RUNNING = _model(
    m * ((v + w).diff(t) + g * v.diff(x)) ** 2 / 2 - 20 * v.diff(x) ** 2 / 2,
    left=-25 * v**2,
    right=-25 * v**2,
)
AFTER = np.linspace(0.0, 4.0, 8001)


def damped(**changes):
    return DAMPED.at(VALUES | {"c": 0.3} | changes)


def test_no_damper_is_the_sum_over_natural_modes():
    still = _model(BENT, **END).at(VALUES)
    assert cra.residual_vibration(damped(c=0.0), MOVE, 3) == pytest.approx(
        cra.residual_vibration(still, MOVE, 3), rel=1e-8
    )


@pytest.mark.parametrize(
    "system",
    [damped(), damped(c=8.0), TURNING.at(VALUES | {"g": 0.2}), RUNNING.at({"l": 1.2, "m": 0.3, "g": 3.0})],
    ids=str,
)
def test_one_mode_is_its_largest_value_and_several_bound_theirs(system):
    one, three = (np.abs(cra.tip_response(system, MOVE, MOVE.duration + AFTER, modes)).max() for modes in (1, 3))
    # the grid misses a peak by (omega h)^2 / 8; with the strong damper, and along the string, modes are too far from
    # orthogonal for a single pair
    pair = system.values.get("c") != 8.0 and system.model is not RUNNING
    assert not pair or cra.residual_vibration(system, MOVE, 1) == pytest.approx(one, rel=1e-3)
    assert three <= cra.residual_vibration(system, MOVE, 3) * (1 + 1e-9) <= 1.2 * three


def test_a_batch_is_its_members():
    dampers, ways = np.array([0.1, 0.5]), cra.BaseMotion.trapezoid([[0.1], [0.2]], 0.4, 3.0)
    found = cra.residual_vibration(damped(c=dampers), ways, 2)
    for (i, k), value in np.ndenumerate(found):
        assert value == pytest.approx(cra.residual_vibration(damped(c=dampers[k]), ways[i, 0], 2), rel=1e-9)


def test_dampers_that_leave_modes_apart_are_ratios():
    """Kelvin and Voigt's, with rigid springs: c omega^2 / EI of every mode, as modal damping of the same size."""
    from tests.systems import EI, rhoA

    held = {"left": None, "essential": [v.subs(x, 0), v.diff(x).subs(x, 0)]}
    inner = _model(BENT, **held, virtual_work=[(-c * v.diff(x, 2).diff(t), v.diff(x, 2), "domain")])
    assert {EI, rhoA, c} <= set(inner.symbols)
    beam = inner.at({name: value for name, value in VALUES.items() if name in ("l", "rhoA", "EI")} | {"c": 0.02})
    still = _model(BENT, **held).at({name: beam.values[name] for name in ("l", "rhoA", "EI")})
    ratios = 0.02 / 5.0 * 2 * np.pi * cra.natural_frequencies(still, 3) / 2
    expected = cra.residual_vibration(still, MOVE, 3, zeta=ratios)
    assert cra.residual_vibration(beam, MOVE, 3) == pytest.approx(expected, rel=1e-9)


@pytest.mark.parametrize("order", [1, 2])
def test_a_shaper_for_a_complex_mode_leaves_nothing_of_it(order):
    system = damped(c=1.0)
    first = cra.eigenvalues(system, 1)[0]
    shaper = cra.input_shaper(abs(first), -first.real / abs(first), order)
    whole = cra.residual_vibration(system, MOVE, 1)
    # eigenvalues settle to 1e-9
    assert cra.residual_vibration(system, MOVE.shaped(*shaper), 1) < 1e-8 * whole


def test_the_gradient_is_the_slope():
    system, by = damped(), ("k", "c", "m", "duration")
    value, gradient = cra.residual_vibration_gradient(system, MOVE, by, 2)
    assert value == cra.residual_vibration(system, MOVE, 2)
    slopes, small = [], 1e-3
    for name in by[:3]:
        place = system.values[name]
        sides = [cra.residual_vibration(system.replace(**{name: place * f}), MOVE, 2) for f in (1 + small, 1 - small)]
        slopes.append((sides[0] - sides[1]) / (2 * small * place))
    last, longer = (cra.BaseMotion.trapezoid(0.1, 0.4, 3.0, MOVE.duration + part * 2e-4) for part in (1, 2))
    ends = [cra.residual_vibration(system, one, 2) for one in (MOVE, last, longer)]
    slopes.append((-3 * ends[0] + 4 * ends[1] - ends[2]) / 4e-4)
    np.testing.assert_allclose(gradient, slopes, rtol=2e-5)  # of the differences of second order here


@pytest.mark.parametrize("name", WITHOUT_NATURAL_MODES)
def test_the_gradient_of_a_pipe_and_of_a_shaft(name):
    """A load in the Lagrangian was unknown; and where planes repeat a frequency, the steps were rounding errors."""
    system, inputs = named(name), {"w": MOVE, "p": cra.Force.sampled([0.0, 0.1, 0.2], [0.0, 2.0, 0.0], exact=True)}
    value, (slope,) = cra.residual_vibration_gradient(system, inputs, ("U",), 1)
    assert value == cra.residual_vibration(system, inputs, 1)
    speeds = system.values["U"] * (1 + 1e-3 * np.array([-2, -1, 1, 2]))
    at = cra.residual_vibration(system.replace(U=speeds), inputs, 1)
    by_hand = (at @ [1, -8, 8, -1]) / (12e-3 * system.values["U"])
    assert slope == pytest.approx(by_hand, rel=1e-5)  # documented as 1e-6; the fourth-order difference is far below


def test_what_has_no_such_sum_is_named():
    with pytest.raises(ValueError, match=r"zeta has shape \(2,\): its last axis must have one value"):
        cra.residual_vibration(damped(), MOVE, 2, zeta=[0.01, 0.02])
    with pytest.raises(ValueError, match="motion never stops accelerating"):
        cra.residual_vibration(damped(), cra.BaseMotion(acceleration=1.0), 2)
    batch, three = cra.Arm.nominal().replace(m_e=[0.1, 0.2]), cra.BaseMotion.trapezoid([0.1, 0.2, 0.3], 0.4, 3.0)
    for function in (cra.residual_vibration, cra.residual_vibration_gradient):
        with pytest.raises(ValueError, match=r"broadcast together: system \(2,\), motion \(3,\)"):
            function(batch, three, modes=2)


MOVES = {
    "stretched": cra.BaseMotion.s_curve(0.2, 1.0, 4.0, 40.0, duration=[[1.0], [1.3], [2.2]]),
    "sum": cra.BaseMotion.trapezoid(0.1, [[0.2], [0.3]], 3.0) + cra.BaseMotion.s_curve(0.1, 1.0, 4.0, 90.0),
    "sampled": cra.BaseMotion.sampled(1e-3 * np.arange(401), np.sin(0.005 * np.pi * np.arange(401))),
    "coasting": cra.BaseMotion(velocity=[[0.1], [-0.2]]) + cra.BaseMotion.trapezoid(0.1, 0.2, 1.0),
}
COUPLED = {
    "damped": damped(c=8.0),
    "turning": TURNING.at(VALUES | {"g": 0.2}),
    "along": RUNNING.at({"l": 1.2, "m": 0.3, "g": [3.0, 4.0]}),  # whose support must come to rest
}


@pytest.mark.parametrize(("name", "move"), [(n, m) for n in COUPLED for m in MOVES if (n, m) != ("along", "coasting")])
def test_amplitudes_at_the_stop_are_those_of_matrix_exponentials(name, move, monkeypatch):
    """These move the states of modes that are almost dependent, and here of all."""
    found = cra.residual_vibration(COUPLED[name], MOVES[move], 3)
    monkeypatch.setattr("cra_sym.analysis.complex_responses._SLANTED", 0.0)
    whole = cra.residual_vibration(COUPLED[name], MOVES[move], 3)
    # both lose as many digits as the vibration is smaller than the motion
    np.testing.assert_allclose(found, whole, rtol=1e-9, atol=1e-13)


def oscillator(omega, ratio):
    return np.array([[0.0, 1.0], [-(omega**2), -2 * ratio * omega]])


@pytest.mark.parametrize("ratio", [0.0, 0.1, 0.9, 0.9999, 1.0, 1.0001, 1.5, 20.0])
@pytest.mark.parametrize("state", [(1.0, 0.0), (1.0, 3.0), (-0.2, 1.0), (0.3, -5.0), (0.0, 1.0)])
def test_a_pair_swings_as_far_as_its_history_does(ratio, state):
    system = oscillator(2.0, ratio)
    times = np.linspace(0.0, 4.0, 4001)
    history = np.abs((expm(times[:, None, None] * system) @ np.array(state))[:, 0]).max()
    turn = np.array([[1.0, 0.4], [-0.3, 0.8]])  # the same in other coordinates
    found = free_peaks(turn @ system @ np.linalg.inv(turn), np.linalg.inv(turn)[0], (turn @ state)[None], 0)
    assert found[0] == pytest.approx(history, rel=1e-5)  # near critical damping half the digits are lost


def test_what_grows_has_no_largest_value_and_a_rigid_body_keeps_its_place():
    still = np.array([[1e-3, 0.0], [0.0, 0.0]])
    assert free_peaks(oscillator(1.0, -0.1), np.array([1.0, 0.0]), still, 0).tolist() == [np.inf, 0.0]
    free = block_diag([[0.0, 1.0], [0.0, 0.0]], oscillator(2.0, 0.0))
    row = np.array([1.0, 0.0, 1.0, 0.0])
    states = np.array([[0.5, 0.0, 0.25, 0.0], [0.5, 0.1, 0.25, 0.0]])
    assert free_peaks(free, row, states, 1) == pytest.approx(np.array([0.75, np.inf]), rel=1e-12)


def test_the_gradient_is_not_led_astray_by_a_kink():
    """A rod on a moving base with a damper at its end: the peak of a mode comes at once or half a turn later, and the
    switch from one to the other lies beside these values."""
    rho, stiff, spring, mass, drag, length, x, t = sp.symbols("rho EA k m d l x t")
    u, base = sp.Function("u")(x, t), sp.Function("w")(t)
    rod = cra.Model(
        rho * (u + base).diff(t) ** 2 / 2 - stiff * u.diff(x) ** 2 / 2,
        fields=[u], prescribed=[base], x=x, domain=(0, length), t=t,
        left=-spring * u**2 / 2, right=mass * (u + base).diff(t) ** 2 / 2,
        virtual_work=[(-drag * u.diff(t), u, "right")],
    )  # fmt: skip
    values = {"rho": 2.0, "EA": 900.0, "k": 2000.0, "m": 0.3, "d": 3.0, "l": 0.8}
    system, move = rod.at(values), cra.BaseMotion.trapezoid(0.1, 0.2, 1.0)
    _, gradient = cra.residual_vibration_gradient(system, move, list(values), 3)
    for name, found in zip(values, gradient, strict=True):
        h = 1e-4 * values[name]
        at = {
            k: cra.residual_vibration(system.replace(**{name: values[name] + k * h}), move, 3) for k in (-2, -1, 1, 2)
        }
        # rounding 1e-13 over h; the fourth-order error is far below
        assert found == pytest.approx((8 * (at[1] - at[-1]) - at[2] + at[-2]) / (12 * h), rel=1e-7)
