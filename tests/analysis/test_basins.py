"""Basins of attraction against an integration of each motion by itself, and their limits."""

from dataclasses import replace

import numpy as np
import pytest
import sympy as sp
from scipy.integrate import solve_ivp

import cra_sym as cra
from cra_sym.symbols import w
from tests.nonlinear_models import inextensible, oscillator, q, t

F = sp.Function("F")(t)
DUFFING = oscillator(q.diff(t) ** 2 / 2 - q**2 / 2 - q**4 / 4, virtual_work=[(F, q, None)]).at({}, zeta=0.02)
STATES = cra.steady_states(DUFFING, 1.3, drive={F: 0.1}, modes=1)


def test_each_motion_by_itself_settles_where_its_basin_says():
    """The amplitude over the last five periods, of an integration that knows nothing of the steady states."""
    places, rates = np.linspace(-1.4, 1.4, 4), np.array([-0.9, 0.5])
    found = cra.basins(STATES, places, rates)
    assert found.shape == (2, 4) and {0, 2} == set(found.ravel())
    times = np.linspace(50, 55, 201) * 2 * np.pi / 1.3
    for row, velocity in enumerate(rates):
        for column, place in enumerate(places):
            run = solve_ivp(
                lambda s, y: [y[1], 0.1 * np.cos(1.3 * s) - 0.04 * y[1] - y[0] - y[0] ** 3],
                (0.0, times[-1]), [place, velocity], t_eval=times, rtol=1e-7, atol=1e-9, method="DOP853",
            )  # fmt: skip
            size = np.abs(run.y[0]).max()
            nearest = min((0, 2), key=lambda k: abs(STATES[k].amplitude - size))
            assert found[row, column] == nearest


def test_a_motion_on_a_stable_answer_stays_there():
    for k in (0, 2):
        cosine, sine = STATES[k].coefficients[0, [1, 8]]
        assert cra.basins(STATES, [STATES[k].coefficients[0, :8].sum()], [1.3 * sine], cycles=3)[0, 0] == k
        assert abs(cosine) > 0


def test_inertia_that_moves_with_the_arm_is_followed():
    """The inextensible arm, driven by nothing, comes to rest; from too far away it is called none of the answers."""
    system = inextensible().model.at(inextensible().values, zeta=0.2)
    states = cra.steady_states(system, 7.0, modes=1)
    assert cra.basins(states, [0.0, 0.05], [0.0]).tolist() == [[0, 0]]


def test_motions_that_diverge_leave_the_others_alone():
    """Beyond the barrier of a softening spring, at displacement 1, a motion has no bound."""
    soft = oscillator(q.diff(t) ** 2 / 2 - q**2 / 2 + q**4 / 4, virtual_work=[(F, q, None)]).at({}, zeta=0.05)
    states = cra.steady_states(soft, 0.8, drive={F: 0.05}, modes=1)
    assert [state.stable for state in states] == [True, False, False]
    assert cra.basins(states, [-1.5, -0.3, 0.3], [0.0, 0.1]).tolist() == [[-1, 0, 0]] * 2


def test_momenta_of_a_base_that_moves_are_followed():
    """A foreshortened mode shaken along: q'' + q (q q')' - q u'' + .2 q' + q = 0, from rest pushed and from afar."""
    u = sp.Function("u")(t)
    moved = oscillator((q.diff(t) ** 2 + (u.diff(t) - q * q.diff(t)) ** 2 - q**2) / 2).at({}, zeta=0.1)
    states = cra.steady_states(moved, 1.9, drive={u: 0.17}, modes=1, period=2, harmonics=5)
    assert [state.stable for state in states] == [False, True, True] and not states[0].amplitude
    starts = np.array([-0.3, 0.6])
    found = cra.basins(states, starts, [0.0], cycles=15)[0]

    def rate(time, y):
        (q, u), push = y.reshape(2, -1), -0.17 * 1.9**2 * np.cos(1.9 * time)
        return np.append(u, (q * push - q - 0.2 * u - q * u**2) / (1 + q**2))

    span = (0, 15 * 4 * np.pi / 1.9)
    reached = solve_ivp(rate, span, np.append(starts, [0.0, 0.0]), method="DOP853", rtol=1e-6, atol=1e-8).y[:2, -1]
    wanted = [states[k].coefficients[0, :6].sum() for k in found]
    np.testing.assert_allclose(reached, wanted, rtol=0.1)  # of the two opposite answers


@pytest.mark.parametrize(
    ("states", "options", "message"),
    [
        (STATES[1:2], {}, "states: must include a stable one"),
        ([3], {}, "states = 3: must be a SteadyState"),
        ((*STATES, *cra.steady_states(DUFFING, 1.4, drive={F: 0.1}, modes=1)), {}, "one angular frequency"),
        ((*STATES, replace(STATES[0], epsilon=0.1)), {}, "one epsilon"),
        (STATES, {"mode": 2}, "mode = 2"),
        (STATES, {"displacement": [np.nan]}, "displacement"),
        (STATES, {"cycles": 0}, "cycles = 0"),
    ],
)
def test_bad_input_is_named(states, options, message):
    with pytest.raises((TypeError, ValueError), match=message):
        cra.basins(states, **({"displacement": [0.0], "velocity": [0.0]} | options))


def test_without_damping_the_number_of_cycles_must_be_told():
    arm = cra.Arm.nominal().replace(k_t=1e4)
    states = cra.steady_states(arm, 30.0, drive={w: 1e-4}, modes=1)
    with pytest.raises(ValueError, match="cycles = None: must be given"):
        cra.basins(states, [0.0], [0.0])
