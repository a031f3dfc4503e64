"""Forces of elastic-slip elements over a period, exact between events, against small steps and differences."""

from __future__ import annotations

import numpy as np
import pytest

from cra_sym.solvers.slip_law import cycle, values

STIFFNESS, SLIP = np.array([1.0, 2.0, 0.7]), np.array([0.3, 1.5, 1.9])


def motions(rows, harmonics, seed):
    k = np.arange(1, harmonics + 1)
    return np.random.default_rng(seed).normal(size=(rows, 2 * harmonics + 1)) * np.r_[0.3, 1 / k, 1 / k]


def stepped(coefficients, stiffness, slip, number):
    """Return the harmonics of the force and the work it takes, the sliders dragged along in small steps."""
    h = coefficients.shape[1] // 2
    phase = 2 * np.pi * np.arange(number) / number
    places, limit = values(phase, h) @ coefficients.T, slip / stiffness
    slider, force, work = np.zeros((len(coefficients), slip.size)), np.zeros_like(places), np.zeros(len(coefficients))
    for turn in range(2):
        for k, u in enumerate(places):
            moved = np.clip(slider, u[:, None] - limit, u[:, None] + limit)
            work += turn * (np.abs(moved - slider) * slip).sum(axis=1)
            slider = moved
            force[k] = ((u[:, None] - slider) * stiffness).sum(axis=1)
    found = np.fft.rfft(force, axis=0) / number
    return np.concatenate([found[:1].real, 2 * found[1 : h + 1].real, -2 * found[1 : h + 1].imag]).T, work


def test_harmonics_of_the_force_are_those_of_small_steps():
    """The error of the steps falls with their square but for the kinks, so two numbers of them extrapolate."""
    given = motions(30, 5, 0)
    found = cycle(given, STIFFNESS, SLIP)
    coarse, fine = (stepped(given, STIFFNESS, SLIP, number) for number in (2**11, 2**12))
    assert found.reversals.shape[1] > 4  # inner loops among them
    np.testing.assert_allclose(found.force, fine[0] + (fine[0] - coarse[0]) / 3, rtol=0, atol=2e-5)
    np.testing.assert_allclose(found.loss, fine[1] + (fine[1] - coarse[1]) / 3, rtol=0, atol=1e-4)


def test_jacobian_is_that_of_differences():
    given, step = motions(30, 4, 1), 1e-6
    found = cycle(given, STIFFNESS, SLIP).jacobian
    ends = [[cycle(given + s * step * one, STIFFNESS, SLIP).force for s in (1, -1)] for one in np.eye(9)]
    wanted = np.stack([(a - b) / (2 * step) for a, b in ends], axis=-1)
    np.testing.assert_allclose(found, wanted, rtol=0, atol=1e-7)


@pytest.mark.parametrize("shift", [0.0, 0.4, 3.0])
def test_what_sticks_has_no_residual_force_or_the_least(shift):
    """A slider stays at 0 where it holds there, and is dragged only as far as it must."""
    given = np.array([[shift, 0.2, 0.0, 0.0, 0.1]])
    found = cycle(given, np.array([2.0]), np.array([1.0]))  # slips at 0.5
    phase = np.linspace(0, 2 * np.pi, 100_001)
    highest = (values(phase, 2) @ given[0]).max()
    slider = max(0.0, highest - 0.5)
    np.testing.assert_allclose(found.sliders, slider, atol=1e-9)
    np.testing.assert_allclose(found.force[0], 2 * (given[0] - [slider, 0, 0, 0, 0]), atol=1e-8)
    assert found.loss == 0


def test_work_over_a_period_is_what_sliders_take():
    given = motions(20, 6, 2)
    found = cycle(given, STIFFNESS, SLIP)
    k = np.arange(1, 7)
    rate = np.concatenate([k * given[:, 7:], -k * given[:, 1:7]], axis=1)
    work = np.pi * (found.force[:, 1:] * rate).sum(axis=1)
    np.testing.assert_allclose(work, found.loss, rtol=0, atol=1e-11)
