"""Modes that dampers couple: the equation and its integrals, and the closed form where nothing is coupled."""

from itertools import product

import numpy as np
import pytest

from cra_sym.kernels import derived_kernel
from cra_sym.solvers.coupled_modes import CoupledModes, coupled_response
from cra_sym.solvers.driven_modes import driven_response, state_at_stop
from cra_sym.solvers.modal_response import Oscillators
from cra_sym.solvers.motion import BaseMotion

OMEGA, ZETA, GAMMA = np.array([3.0, 11.0]), np.array([0.02, 0.05]), np.array([0.5, -0.2])
ROWS = np.array([[1.0, 0.7], [0.3, -1.0]])
DAMPING = np.array([[0.8, -1.9], [-1.9, 30.0]])  # the second mode hardly swings
MOTION = (
    BaseMotion(velocity=0.2, acceleration=-0.4, amplitude=0.01, angular_frequency=3.0, phase=0.7)
    + BaseMotion.sampled([0.3, 0.7, 1.1], [0.5, -1.0, 2.0], velocity=0.1)
    + BaseMotion.trapezoid(0.3, 0.6, 1.5).shaped([0.6, 0.4], [0.15, 0.5])
)
KNOTS = np.unique(np.concatenate([[0.0, 2.0], *(term.knots for term in MOTION.terms if hasattr(term, "knots"))]))
TIMES = np.r_[0.0, np.random.default_rng(3).uniform(0.0, 2.0, 20), 1.1]
INITIAL = np.array([0.02, -0.01]), np.array([0.1, 0.3])


@pytest.mark.parametrize(("start", "initial"), [("inertial", None), ("base", INITIAL)])
def test_the_equation_its_integrals_and_its_start_hold(start, initial):
    """Together they fix the solution: displacement, velocity and acceleration between all knots of the motion."""
    modes = CoupledModes(OMEGA, ZETA, DAMPING, GAMMA, np.eye(2))
    points, weights = np.polynomial.legendre.leggauss(14)
    span = np.diff(KNOTS)
    inside = (KNOTS[:-1, None] + span[:, None] * (1 + points) / 2).ravel()
    q, u, du = (coupled_response(modes, MOTION, inside, derivative, start, initial) for derivative in (0, 1, 2))
    friction = DAMPING + np.diag(2 * ZETA * OMEGA)
    cause = -GAMMA[:, None] * MOTION.acceleration(inside)
    np.testing.assert_allclose(du + friction @ u + OMEGA[:, None] ** 2 * q, cause, atol=1e-11)
    at_knots = [coupled_response(modes, MOTION, KNOTS, derivative, start, initial) for derivative in (0, 1)]
    for value, slope in zip(at_knots, (u, du), strict=True):
        integral = slope.reshape(2, span.size, -1) @ weights / 2 * span
        np.testing.assert_allclose(np.diff(value), integral, atol=1e-12)
    q_0, u_0 = initial or np.zeros((2, 2))
    np.testing.assert_allclose(at_knots[0][:, 0], q_0, atol=1e-15)
    left_behind = GAMMA * MOTION.velocity(0.0) if start == "inertial" else 0.0
    np.testing.assert_allclose(at_knots[1][:, 0], u_0 - left_behind, atol=1e-15)


@pytest.mark.parametrize("start", ["inertial", "base"])
def test_without_coupling_it_is_the_closed_form(start):
    """Exponentials of matrices against superposed unit responses, a batch of motions and of damping ratios at once."""
    motion, zeta = MOTION * np.array([1.0, -0.3, 0.0]), np.array([ZETA, 4 * ZETA, 0 * ZETA])
    motion = motion + BaseMotion.s_curve([0.2, 0.4, 0.1], 0.5, 1.0, 9.0)
    free, forced = (derived_kernel(f"cra_sym.model.oscillator:{name}_kernel") for name in ("free", "forced"))
    closed = Oscillators(OMEGA, zeta, GAMMA, ROWS, free, forced)
    coupled = CoupledModes(OMEGA, zeta, np.zeros((2, 2)), GAMMA, ROWS)
    for t, derivative in product((TIMES, np.linspace(0.0, 2.0, 70)), (0, 1, 2)):
        options = {"derivative": derivative, "start": start, "initial": INITIAL}
        found, expected = (
            f(o, motion, t, **options) for f, o in ((coupled_response, coupled), (driven_response, closed))
        )
        np.testing.assert_allclose(found, expected, atol=1e-11)


def test_state_at_the_stop():
    """The last instant of a move: where the modes are and how fast, whether the move began with a jerk or not."""
    motion = BaseMotion(velocity=[0.1, 0.0, -0.2]) + BaseMotion.s_curve(0.3, [0.3, 0.5, 0.9], 1.0, 9.0)
    free, forced = (derived_kernel(f"cra_sym.model.oscillator:{name}_kernel") for name in ("free", "forced"))
    stopped = state_at_stop(Oscillators(OMEGA, ZETA, GAMMA, np.eye(2), free, forced), motion)
    for derivative, values in enumerate(stopped):
        for member, stop in enumerate(motion.duration):
            still = CoupledModes(OMEGA, ZETA, np.zeros((2, 2)), GAMMA, np.eye(2))
            found = coupled_response(still, motion, stop, derivative)[member, :, 0]
            np.testing.assert_allclose(values[member], found, atol=1e-12)


@pytest.mark.parametrize("modes", [1, 2])
def test_a_batch_of_modes_is_a_loop(modes):
    """Everything but the damping ratios is the member's own; there may be one mode only."""
    few, size = slice(modes), np.array([1.0, 1.7, 0.6])[:, None]
    own = OMEGA[few] * size, DAMPING[few, few] * size[..., None], GAMMA[few] * size, ROWS[:, few] * size[..., None]
    free, forced = (derived_kernel(f"cra_sym.model.oscillator:{name}_kernel") for name in ("free", "forced"))

    def answers(omega, damping, gamma, rows):
        coupled = CoupledModes(omega, ZETA[few], damping, gamma, rows)
        closed = Oscillators(omega, ZETA[few], gamma, rows, free, forced)
        grid = [driven_response(closed, MOTION, np.linspace(0.0, 2.0, 70), derivative) for derivative in range(3)]
        return [coupled_response(coupled, MOTION, TIMES[:4], 0), driven_response(closed, MOTION, TIMES[:4], 0), *grid]

    singles = [answers(*member) for member in zip(*own, strict=True)]
    for found, expected in zip(answers(*own), zip(*singles, strict=True), strict=True):
        np.testing.assert_allclose(found, expected, atol=1e-12)


def test_times_that_run_backwards_give_the_same_values():
    """In uniform steps they must not be taken for a grid, through which the closed form is shifted forwards."""
    free, forced = (derived_kernel(f"cra_sym.model.oscillator:{name}_kernel") for name in ("free", "forced"))
    osc, t = Oscillators(OMEGA, ZETA, GAMMA, ROWS, free, forced), np.linspace(0.0, 4.0, 70)
    onwards, back = (driven_response(osc, MOTION, times, 0) for times in (t, t[::-1]))
    np.testing.assert_allclose(back[:, ::-1], onwards, atol=1e-12)


@pytest.mark.parametrize(("t", "derivative", "named"), [(-0.05, 0, "t = -0.05"), (0.0, -1, "derivative = -1")])
def test_what_was_before_is_refused(t, derivative, named):
    with pytest.raises(ValueError, match=named):
        coupled_response(CoupledModes(OMEGA, ZETA, DAMPING, GAMMA, ROWS), MOTION, t, derivative)


def test_no_times_give_no_values():
    coupled = CoupledModes(OMEGA, ZETA, DAMPING, GAMMA, ROWS)
    assert coupled_response(coupled, MOTION, [], 0).shape == (2, 0)
    free, forced = (derived_kernel(f"cra_sym.model.oscillator:{name}_kernel") for name in ("free", "forced"))
    assert driven_response(Oscillators(OMEGA, ZETA, GAMMA, ROWS, free, forced), MOTION, [], 0).shape == (2, 0)


def test_an_acceleration_that_sets_in_late_is_a_profile_of_one_knot():
    late = BaseMotion(acceleration=0.5).shaped([0.4, 0.6], [0.0, 0.3])
    free, forced = (derived_kernel(f"cra_sym.model.oscillator:{name}_kernel") for name in ("free", "forced"))
    found = driven_response(Oscillators(OMEGA, ZETA, GAMMA, ROWS, free, forced), late, TIMES, 0)
    coupled = CoupledModes(OMEGA, ZETA, np.zeros((2, 2)), GAMMA, ROWS)
    np.testing.assert_allclose(found, coupled_response(coupled, late, TIMES, 0), atol=1e-12)
