"""Systems with elastic-slip elements in time: limits, finite elements with regularised friction, energies, batches."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from sympy import Function, symbols

import cra_sym as cra
from cra_sym.symbols import t as time
from cra_sym.symbols import v, w, x
from tests.slip_reference import Structure

K_D, SLIP, C = symbols("k_d f_s c")
MOVE = cra.BaseMotion.trapezoid(0.3, 0.5, 2.0)
TIMES = np.linspace(0.0, 1.5, 61)


def slipping(arm, element, values, place="left", **pieces):
    return arm.model.replace(hysteresis=[(element, v, place)], **pieces).at({**arm.values, **values}, zeta=arm.zeta)


@pytest.fixture(scope="module")
def arm():
    return cra.Arm.nominal().replace(k_t=1e3)


@pytest.fixture(scope="module")
def joint(arm):
    return slipping(arm, cra.Jenkins(K_D, SLIP), {"k_d": 5e3, "f_s": 0.3})


def test_without_slip_it_is_the_stiffer_arm(arm, joint):
    stiff, held = arm.replace(k_t=6e3), joint.replace(f_s=1e6)
    gaps = []
    for modes in (2, 4, 8):
        found, right = (cra.tip_response(system, MOVE, TIMES, modes=modes) for system in (held, stiff))
        gaps.append(np.abs(found - right).max() / np.abs(right).max())
    # modes left out count as statics: what is missed is of their inertia, and of the shapes at the tip
    assert gaps[2] < gaps[1] < gaps[0] and gaps[2] < 1e-3
    assert not cra.slip_response(held, MOVE, TIMES).events[()]


def test_without_friction_it_is_the_arm_without_the_element(arm, joint):
    free = joint.replace(f_s=1e-12)
    right = cra.tip_response(arm, MOVE, TIMES, modes=3)
    np.testing.assert_allclose(
        cra.tip_response(free, MOVE, TIMES, modes=3), right, rtol=0, atol=1e-10 * np.abs(right).max()
    )
    assert cra.residual_vibration(free, MOVE, modes=3) <= cra.residual_vibration(arm, MOVE, modes=3) * (1 + 1e-9)


def test_energies_balance_and_slip_dissipates(joint):
    system = joint.replace(f_s=[0.1, 0.3, 0.6], zeta=0.01)
    found = cra.slip_response(system, MOVE, TIMES[1:], modes=3)
    assert (found.imbalance < 1e-12).all()  # rounding of some hundred steps
    assert (np.diff(found.dissipated) >= 0).all() and (found.dissipated[..., -1] > 0).all()
    assert (np.abs(found.force) <= np.array([0.1, 0.3, 0.6])[:, None, None]).all()
    assert (found.initial == 0).all()
    np.testing.assert_array_equal(found.tip, cra.slip_response(system, MOVE, TIMES, modes=3).tip[:, 1:])


def test_states_follow_the_events(joint):
    found = cra.slip_response(joint, MOVE, TIMES)
    state, told = 0, list(found.events[()])
    assert len(told) > 10
    for at, seen in zip(found.time, found.state[0], strict=True):
        while told and told[0].time < at:
            state = told.pop(0).state
        assert seen == state
    slips = found.state[0] != 0
    np.testing.assert_allclose(found.force[0][slips], 0.3 * found.state[0][slips], rtol=0, atol=1e-15)


def test_response_along_the_arm_and_its_derivatives(joint):
    along = cra.response(joint, MOVE, TIMES, [0.0, 1.0], modes=4)
    np.testing.assert_allclose(along[1], cra.tip_response(joint, MOVE, TIMES, modes=4), rtol=0, atol=1e-15)
    shuffled = TIMES[::-1]
    found = cra.tip_response(joint, MOVE, shuffled, modes=4)
    np.testing.assert_allclose(found, along[1][::-1], rtol=0, atol=1e-15)
    near = np.array([0.7, 0.7 + 1e-6])
    values = [cra.tip_response(joint, MOVE, near, modes=4, derivative=k) for k in (0, 1, 2)]
    for k in (0, 1):  # to first order in the step
        assert np.diff(values[k])[0] / 1e-6 == pytest.approx(values[k + 1].mean(), rel=1e-4)


def test_batches_of_arms_and_of_motions(joint):
    several = joint.replace(f_s=np.array([0.2, 0.4])[:, None])
    motions = cra.BaseMotion.trapezoid([0.1, 0.2, 0.3], 0.5, 2.0)
    found = cra.tip_response(several, motions, TIMES, modes=2)
    assert found.shape == (2, 3, TIMES.size)
    one = cra.tip_response(joint.replace(f_s=0.4), motions[1], TIMES, modes=2)
    np.testing.assert_allclose(found[1, 1], one, rtol=0, atol=1e-12 * np.abs(one).max())
    peaks = cra.residual_vibration(several, motions, modes=2)
    assert peaks.shape == (2, 3)
    assert cra.residual_vibration(joint.replace(f_s=0.4), motions[1], modes=2) == pytest.approx(peaks[1, 1], rel=1e-12)


def test_residual_vibration_is_the_largest_after_the_stop(joint):
    after = np.linspace(MOVE.duration, MOVE.duration + 5.0, 20_001)
    found = cra.residual_vibration(joint, MOVE, modes=3)
    largest = np.abs(cra.tip_response(joint, MOVE, after, modes=3)).max()
    assert largest <= found * (1 + 1e-12)
    assert largest > 0.98 * found  # the bound of the sum is reached, with frequencies that are incommensurable, late


def element_matrices(count, length, EI, rhoA):
    """Mass and stiffness of Hermite elements, with two coordinates a node."""
    h = length / count
    stiff = EI / h**3 * np.array(
        [[12, 6 * h, -12, 6 * h], [6 * h, 4 * h**2, -6 * h, 2 * h**2], [-12, -6 * h, 12, -6 * h],
         [6 * h, 2 * h**2, -6 * h, 4 * h**2]])  # fmt: skip
    mass = rhoA * h / 420 * np.array(
        [[156, 22 * h, 54, -13 * h], [22 * h, 4 * h**2, 13 * h, -3 * h**2], [54, 13 * h, 156, -22 * h],
         [-13 * h, -3 * h**2, -22 * h, 4 * h**2]])  # fmt: skip
    M, K = np.zeros((2 * count + 2,) * 2), np.zeros((2 * count + 2,) * 2)
    for e in range(count):
        part = slice(2 * e, 2 * e + 4)
        M[part, part] += mass
        K[part, part] += stiff
    return M, K


def test_finite_elements_with_smooth_friction_converge_to_it(arm, joint):
    """Five elements; f' = k u' (1 - |f / slip|^n) where f and u' have one sign (Bouc and Wen): n to infinity."""
    slip, times = 0.1, TIMES[:17]  # the acceleration jumps at some of these times
    M, K = element_matrices(5, 1.0, float(arm.EI), float(arm.rhoA))
    M[-2, -2] += arm.m_e
    K[0, 0] += arm.k_t
    keep = [0, *range(2, 12)]  # the root does not turn
    inertia = (M @ np.tile([1.0, 0.0], 6))[keep]
    M, K = M[np.ix_(keep, keep)], K[np.ix_(keep, keep)]
    flexible, inverse = np.linalg.solve(M, K), np.linalg.inv(M)

    def integrated(power):
        y, tip = np.zeros(23), [0.0]
        for begin, end in pairwise(times):
            base = -inverse @ inertia * float(MOVE.acceleration((begin + end) / 2))

            def rate(t, y, base=base):
                sticks = 1 - abs(y[22] / slip) ** power if y[22] * y[11] > 0 else 1.0
                moved = base - flexible @ y[:11] - inverse[:, 0] * y[22]
                return np.concatenate([y[11:22], moved, [5e3 * y[11] * sticks]])

            y = solve_ivp(rate, (begin, end), y, "LSODA", rtol=1e-6, atol=1e-9).y[:, -1]
            tip.append(y[9])
        return np.array(tip)

    exact = cra.tip_response(joint.replace(f_s=slip), MOVE, times, modes=6)
    gaps = [np.abs(integrated(power) - exact).max() / np.abs(exact).max() for power in (1, 8, 64)]
    assert gaps[0] > 4 * gaps[1] > 4 * gaps[2]
    assert gaps[2] < 1e-3  # what remains is of the elements: 1e-4 of the third frequency, five periods


def test_one_mass_against_integration():
    """Coordinates alone, two elements on one of them and a damper: nothing but the element is modelled."""
    q, F = Function("q")(time), Function("F")(time)
    model = cra.Model(
        0, fields=(), x=x, domain=(0, 1), t=time, coordinates=[q],
        left=q.diff(time) ** 2 / 2 - 2 * q**2, virtual_work=[(F - C * q.diff(time), q, None)],
        hysteresis=[(cra.Jenkins(3.0, 0.5), q, None), (cra.Jenkins(1.0, 0.4), q, None)],
    )  # fmt: skip
    load = {F: cra.Force(amplitude=2.0, angular_frequency=1.7)}
    found = cra.slip_response(model.at({C: 0.1}), load, TIMES * 4, modes=1)
    stiffness, slip = np.array([3.0, 1.0]), np.array([0.5, 0.4])

    def rate(t, y):
        inside = (np.abs(y[2:]) < slip) | (y[2:] * y[1] < 0)
        return [y[1], 2 * np.sin(1.7 * t) - 0.1 * y[1] - 4 * y[0] - y[2:].sum(), *np.where(inside, stiffness * y[1], 0)]

    run = solve_ivp(rate, (0, 6), np.zeros(4), "RK45", TIMES * 4, rtol=1e-8, atol=1e-9, max_step=1e-3)
    # each event is missed by up to a step: slip of 1e-3 s of velocities of order 1, times the stiffness
    np.testing.assert_allclose(found.displacement[0], run.y[0], rtol=0, atol=3e-3)
    assert found.imbalance < 1e-12 and len(found.events[()]) > 5
    pulse = {F: cra.Force.sampled([0.0, 0.5, 1.0], [0.0, 0.3, 0.0])}
    stuck = model.replace(hysteresis=[(cra.Jenkins(3.0, 50.0), q, None), (cra.Jenkins(1.0, 40.0), q, None)])
    stiff = model.replace(left=q.diff(time) ** 2 / 2 - 4 * q**2, hysteresis=())
    linear, held = (one.replace(virtual_work=[(F, q, None)]).at({}, zeta=0.0) for one in (stiff, stuck))
    assert cra.residual_vibration(held, pulse, modes=1) == pytest.approx(
        cra.residual_vibration(linear, pulse, modes=1), rel=1e-12
    )


def test_free_decay_ends_stuck_where_the_slider_stopped():
    """From a displacement beyond slip: by exact pieces between events; at rest the element holds a force."""
    q, stiffness, slip = Function("q")(time), 2.0, 0.3
    model = cra.Model(
        0, fields=(), x=x, domain=(0, 1), t=time, coordinates=[q], left=(q.diff(time) ** 2 - q**2) / 2,
        hysteresis=[(cra.Jenkins(K_D, SLIP), q, None)],
    )  # fmt: skip
    system = model.at({"k_d": [stiffness], "f_s": slip}, zeta=0.1)
    found = cra.slip_response(system, None, [0.5, 2.0, 5.0, 150.0], modes=1, initial={q: 1.0})
    referee = Structure.one_mass(1.0, 0.1, stiffness, slip, 0.0, 1.0)
    for k, end in enumerate((0.5, 2.0, 5.0)):
        (place, _), slider, _ = referee.run(np.array([1.0, 0.0]), 1.0 - slip / stiffness, 0.0, end)
        assert found.displacement[0, 0, k] == pytest.approx(place, rel=0, abs=1e-10)
    rest = stiffness * slider / (1.0 + stiffness)  # q + k_d (q - z) = 0; the last slip is before 5 s
    assert abs(rest) > 1e-3 and found.events[0][-1].time < 5.0
    assert found.displacement[0, 0, -1] == pytest.approx(rest, rel=0, abs=2e-6)  # exp(-0.1 * 145) = 5e-7
    assert found.force[0, 0, -1] == pytest.approx(-rest, rel=0, abs=2e-6) and found.imbalance < 1e-13
    empty = cra.slip_response(model.at({"k_d": [], "f_s": slip}), None, [1.0], modes=1, initial={q: 1.0})
    assert empty.tip.shape == (0, 1) and empty.events.shape == (0,)


def test_iwan_is_followed_as_its_elements(arm):
    joint = cra.Iwan(K_D, SLIP, chi=-0.5, beta=0.3, number=12)
    system = slipping(arm, joint, {"k_d": 5e3, "f_s": 0.3})
    found = cra.slip_response(system, MOVE, TIMES, modes=3)
    assert (
        found.imbalance < 1e-12 and found.force.shape[0] == joint.replace(stiffness=1.0, slip=1.0).elements(12)[0].size
    )
    assert np.abs(found.force.sum(axis=0)).max() <= 0.3 * (1 + 1e-12)


def test_dampers_beside_the_element(arm):
    damped = slipping(
        arm, cra.Jenkins(5e3, SLIP), {"f_s": 0.3, "c": 2.0}, virtual_work=[(-C * v.diff(time), v, "right")]
    )
    found = cra.slip_response(damped, MOVE, TIMES, modes=3)
    assert found.imbalance < 1e-12
    assert found.dampers[-1] > 0 and found.dissipated[0, -1] > 0


def test_bad_input_is_named(arm, joint):
    with pytest.raises(ValueError, match="no elastic-slip elements"):
        cra.slip_response(arm, MOVE, TIMES)
    with pytest.raises(ValueError, match=r"t\[1\]: must ascend"):
        cra.slip_response(joint, MOVE, [0.1, 0.1])
    with pytest.raises(ValueError, match="must be one time or more"):
        cra.slip_response(joint, MOVE, [])
    with pytest.raises(ValueError, match="must be real numbers in"):
        cra.slip_response(joint, MOVE, [-0.1, 0.1])
    with pytest.raises(ValueError, match="no history for w"):
        cra.slip_response(joint, None, TIMES)
    with pytest.raises(ValueError, match="never stops"):
        cra.residual_vibration(joint, {w: cra.BaseMotion(amplitude=1e-3, angular_frequency=3.0)})
