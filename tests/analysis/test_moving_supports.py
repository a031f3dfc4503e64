"""Motions that act by displacement and velocity: the same structure seen from the ground and from the moving base."""

import numpy as np
import pytest
import sympy as sp
from scipy.integrate import solve_ivp

import cra_sym as cra

x, t = sp.symbols("x t")
B, m, L, k, c, g = sp.symbols("B m L k c g", positive=True)
v, w = sp.Function("v")(x, t), sp.Function("w")(t)
VALUES = {B: 4.6, m: 0.24, L: 1.0, k: 300.0, g: 30.0}
MOVE = cra.BaseMotion.s_curve(0.1, v_max=0.5, a_max=1.0, j_max=10.0) + cra.BaseMotion(
    amplitude=1e-3, angular_frequency=17.0
)
TIMES = np.linspace(0.0, 2.0, 9)


def _beam(inertial, relative, **pieces):
    """A beam with a spring k at a moving root that does not rotate, and a spring g from its tip to the ground."""
    return cra.Model(
        m * inertial.diff(t) ** 2 / 2 - B * v.diff(x, 2) ** 2 / 2,
        fields=[v],
        prescribed=[w],
        x=x,
        t=t,
        domain=(0, L),
        left=-k * relative.subs(x, 0) ** 2 / 2,
        right=-g * inertial.subs(x, L) ** 2 / 2,
        essential=[v.diff(x).subs(x, 0)],
        **pieces,
    )


def _pair(*, dampers):
    """The model in displacements from the ground, and in those from the moving base."""
    ground, base = (v, v - w), (v + w, v)
    if not dampers:
        return [_beam(*frame).at(VALUES) for frame in (ground, base)]
    models = [
        _beam(*frame, virtual_work=[(-c * frame[1].diff(t), v, "left"), (-c * frame[0].diff(t) / 3, v, "right")])
        for frame in (ground, base)
    ]
    return [model.at({**VALUES, c: 2.0}) for model in models]


@pytest.mark.parametrize("dampers", [False, True])
def test_responses_agree_in_both_frames(dampers):
    ground, base = _pair(dampers=dampers)
    from_ground = cra.tip_response(ground, MOVE, TIMES, modes=20)
    from_base = cra.tip_response(base, {w: MOVE}, TIMES, modes=20) + MOVE.displacement(TIMES)
    # each sum leaves out the static deflections under its loads by the other modes, of the order of 1e-4
    np.testing.assert_allclose(from_ground, from_base, rtol=0, atol=3e-4 * np.ptp(from_base))
    coarse = cra.tip_response(ground, MOVE, TIMES, modes=5)
    assert np.abs(from_ground - from_base).max() < 0.1 * np.abs(coarse - from_base).max()


@pytest.mark.parametrize("dampers", [False, True])
def test_frequency_responses_agree_in_both_frames_and_with_the_state_space(dampers):
    ground, base = _pair(dampers=dampers)
    frequency = np.array([10.0, 20.0])
    exact = cra.frequency_response(ground, frequency)
    np.testing.assert_allclose(exact, cra.frequency_response(base, frequency, drive=w) + 1.0, rtol=1e-10)
    system = cra.state_space(ground, modes=20)
    for one, value in zip(frequency, exact, strict=True):
        s = 1j * one
        (found,) = (system.C @ np.linalg.solve(s * np.eye(len(system.A)) - system.A, system.B) + system.D)[0]
        assert abs(s**2 * found - value) < 1e-4 * abs(value)  # the input is w''; the omitted modes, as above


def test_steady_states_are_the_frequency_response():
    ground, _ = _pair(dampers=True)
    ((state,),) = cra.steady_states(ground, [20.0], drive={w: 1e-3}, modes=8)
    exact = abs(cra.frequency_response(ground, 20.0))
    assert abs(state.amplitude / (1e-3 * exact) - 1.0) < 1e-3  # the omitted modes


def test_a_nonlinear_spring_follows_its_support():
    q = sp.Function("q")(t)
    model = cra.Model(
        0,
        fields=(),
        coordinates=[q],
        prescribed=[w],
        x=x,
        t=t,
        domain=(0, 1),
        left=m * q.diff(t) ** 2 / 2 - k * (q - w) ** 2 / 2 - 1e4 * q**4 / 4,
        virtual_work=[(-c * (q - w).diff(t), q, None)],
    )
    system = model.at({m: 1.0, k: 300.0, c: 2.0})

    def rate(time, y):
        moved, speed = float(MOVE.displacement(time)), float(MOVE.velocity(time))
        return [y[1], -300.0 * (y[0] - moved) - 2.0 * (y[1] - speed) - 1e4 * y[0] ** 3]

    own = solve_ivp(rate, (0.0, 1.0), [0.0, 0.0], t_eval=[0.5, 1.0], rtol=1e-10, atol=1e-12, max_step=0.02)
    found = cra.tip_response(system, MOVE, [0.5, 1.0], modes=1)
    np.testing.assert_allclose(found, own.y[0], rtol=1e-6)


def test_residual_vibration_is_measured_from_the_new_equilibrium():
    ground, base = _pair(dampers=False)
    move = cra.BaseMotion.s_curve(0.1, v_max=0.5, a_max=1.0, j_max=10.0)
    tip = cra.tip_response(ground, move, move.duration + np.linspace(0.0, 2.0, 600), modes=1)
    peak = cra.residual_vibration(ground, move, modes=1)
    assert abs(np.ptp(tip) / (2.0 * peak) - 1.0) < 1e-3  # 600 samples miss the peak by less than that
    both = [cra.residual_vibration(system, move, modes=20) for system in (ground, base)]
    assert abs(both[0] / both[1] - 1.0) < 1e-3  # the omitted modes, as above


def test_a_motion_that_does_not_rest_or_is_no_motion_is_refused():
    ground, _ = _pair(dampers=True)
    with pytest.raises(ValueError, match="must be at rest after the stop"):
        cra.residual_vibration(ground, cra.BaseMotion(velocity=1.0))
    with pytest.raises(ValueError, match="by its displacement or velocity; give a BaseMotion"):
        cra.tip_response(ground, {w: cra.Force(1.0)}, TIMES)
