"""State spaces of systems without natural modes: gyroscopic forces and forces that follow the motion."""

from __future__ import annotations

import numpy as np
import pytest
import sympy as sp
from scipy.linalg import expm

import cra_sym as cra

x, t, length, EI, m, M, U, k = sp.symbols("x t l EI m M U k")
v, w, F, p, q, r = sp.Function("v")(x, t), *(sp.Function(name)(t) for name in "wFpqr")
VALUES = {"l": 1.2, "EI": 5.0, "m": 0.2, "M": 0.3, "U": 2.0, "k": 800.0}


@pytest.fixture(scope="module")
def pipe():
    """A cantilever that conveys fluid, on a spring, on a base that moves, under a uniform load."""
    model = cra.Model(
        m * (v + w).diff(t) ** 2 / 2 + M * (v.diff(t) + U * v.diff(x)) ** 2 / 2 + M * v.diff(t) * w.diff(t)
        - EI * v.diff(x, 2) ** 2 / 2 + F * v,
        fields=[v], prescribed=[w, F], x=x, domain=(0, length), t=t, left=-k * v**2 / 2,
        essential=[v.diff(x).subs(x, 0)], virtual_work=[(-M * U * (v.diff(t) + U * v.diff(x)), v, "right")],
    )  # fmt: skip
    return model.at(VALUES)


def turning(*coordinates, more=sp.S.Zero):
    """A mass on two springs in a frame that turns at the speed U."""
    kinetic = m * ((p.diff(t) - U * q) ** 2 + (q.diff(t) + U * p) ** 2) / 2
    return cra.Model(
        sp.S.Zero, fields=(), coordinates=[p, q, *coordinates], prescribed=[F], x=x, domain=(0, 1), t=t,
        left=kinetic - k * (p**2 + 2 * q**2) / 2 + F * p + more,
    ).at({"m": 0.5, "U": 1.5, "k": 4.0})  # fmt: skip


def transfer(found, Omega):
    turned = [found.C @ np.linalg.solve(1j * one * np.eye(len(found.A)) - found.A, found.B) + found.D for one in Omega]
    return np.moveaxis(np.array(turned), 0, -1)


def test_a_turning_mass_by_hand():
    system, Omega = turning(), np.array([0.7, 3.1])
    found = cra.state_space(system, 2, "F", ["p", "q", p.diff(t, 2)])
    assert found.state_names == ("q_1_1", "q_1_2", "q_2_1", "q_2_2")
    stiff = np.array([4.0, 8.0])[:, None] - 0.5 * (Omega**2 + 1.5**2)
    crossed = 2j * Omega * 0.5 * 1.5
    by_hand = np.array([stiff[1], -crossed]) / (stiff[0] * stiff[1] + crossed**2)
    np.testing.assert_allclose(transfer(found, Omega)[:2, 0], by_hand, rtol=1e-9, atol=1e-12)
    np.testing.assert_allclose(transfer(found, Omega)[2, 0], -(Omega**2) * by_hand[0], rtol=1e-9)
    np.testing.assert_allclose(cra.frequency_response(system, Omega, drive=F), by_hand[0], rtol=1e-9)
    for number, s in enumerate(cra.eigenvalues(system, 2)):
        block = found.A[2 * number : 2 * number + 2, 2 * number : 2 * number + 2]
        np.testing.assert_allclose(block, [[s.real, s.imag], [-s.imag, s.real]], rtol=1e-9, atol=1e-9)
    assert np.count_nonzero(found.A) <= 8


def test_rigid_motions_share_a_block():
    system = turning(r, more=m * r.diff(t) ** 2 / 2 + F * r)
    found = cra.state_space(system, 3, "F", ["r", "p"])
    assert found.state_names[:2] == ("q_1_1", "q_1_2")
    held = found.discrete(0.1)
    state, moved = np.zeros(6), []
    for _ in range(5):
        state = held.A @ state + held.B[:, 0]
        moved.append((held.C @ state)[0])
    np.testing.assert_allclose(moved, (0.1 * np.arange(1, 6)) ** 2 / 2 / 0.5, rtol=1e-7)


def test_a_held_force_is_the_response(pipe):
    """Both are the same sum of modes: to the accuracy of the eigenvalues."""
    step, number = 0.02, 12
    found = cra.state_space(pipe, 4, "F", ["v", "tip_velocity", ("v", 0.5), "tip_acceleration"])
    held = found.discrete(step)
    states = [np.zeros(8)]
    for _ in range(number):
        states.append(held.A @ states[-1] + held.B[:, 0])
    outputs = held.C @ np.array(states).T + held.D
    times, push = step * np.arange(number + 1), {F: cra.Force(1.0), w: cra.BaseMotion()}
    for row, derivative in ((0, 0), (1, 1), (3, 2)):
        expected = cra.tip_response(pipe, push, times, 4, derivative)
        np.testing.assert_allclose(outputs[row], expected, rtol=0, atol=1e-8 * np.abs(expected).max())
    expected = cra.response(pipe, push, times, 0.5, 4)
    np.testing.assert_allclose(outputs[2], expected, rtol=0, atol=1e-8 * np.abs(expected).max())


def test_many_modes_are_the_boundary_value_problem(pipe):
    Omega, end = np.array([3.0, 20.0, 60.0]), v.subs(x, length)
    found = cra.state_space(pipe, 8, ["w", "F", end], ["v", "w", "y"])
    assert found.state_names[:2] == ("w", "w_rate")
    whole = transfer(found, Omega)
    for column, drive in enumerate((w, F, end)):
        missing = cra.frequency_response(pipe, Omega, drive=drive) - whole[0, column]
        assert np.abs(missing).max() < 2e-5  # the modes left out bend as if at rest
        np.testing.assert_allclose(missing, missing[0], rtol=0, atol=5e-8)
    np.testing.assert_allclose(whole[1, 0], -1 / Omega**2, rtol=1e-12)
    np.testing.assert_allclose(whole[2], whole[0] + whole[1], rtol=1e-9)
    s = np.linalg.eigvals(found.A)
    for one in cra.eigenvalues(pipe, 8):
        assert np.abs(s - one).min() < 1e-8 * abs(one)


def test_python_control_takes_it(pipe):
    pytest.importorskip("control")
    found = cra.state_space(pipe, 2, "F", ["v", ("v", 0.5)])
    handed = found.to_control()
    assert list(handed.output_labels) == ["v", "v(0_5)"] and list(handed.state_labels) == list(found.state_names)
    np.testing.assert_array_equal(handed.A, found.A)
    np.testing.assert_allclose(found.discrete(1e-2).A, expm(1e-2 * found.A), rtol=0, atol=1e-12)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"input": "drive_force"}, "make w a coordinate"),
        ({"input": "F", "outputs": ["root_force"]}, "name the force of a spring as an expression"),
        ({"input": "F", "outputs": [v.diff(x, 3).subs(x, 0.5)]}, "must be at most 2"),
        ({"input": "F", "outputs": ["q"]}, "must be one of v, y"),
        ({"input": "G"}, "must be one of .*F, w"),
    ],
)
def test_what_complex_modes_do_not_have(pipe, options, message):
    with pytest.raises(ValueError, match=message):
        cra.state_space(pipe, 2, **options)
