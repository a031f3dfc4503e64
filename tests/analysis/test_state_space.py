"""State-space models against the closed form, momentum, and the frequencies of the arm on its free base."""

import numpy as np
import pytest
from scipy import signal

import cra_sym as cra
from cra_sym import Arm, BaseMotion

ARM = Arm.nominal().replace(k_t=1e3, k_r=50.0, zeta=0.01)


def held(system, inputs, step, start=None):
    """Return the outputs for an input held between the samples: the matrix exponential of an exact hold."""
    A, B, C, _, _ = signal.cont2discrete((system.A, system.B, system.C, system.D), step, "zoh")
    state = np.zeros(A.shape[0]) if start is None else start
    out = []
    for value in inputs:
        out.append((C @ state).item())
        state = A @ state + B[:, 0] * value
    return np.array(out)


def test_an_exact_hold_agrees_with_the_closed_form():
    step, modes = 0.01, 4
    t = step * np.arange(120)
    motion = BaseMotion(velocity=0.1, acceleration=0.3)
    p = cra.modal_parameters(ARM, modes)
    start = np.concatenate([np.zeros(modes), -p.participation * 0.1])
    found = held(cra.state_space(ARM, modes), np.full(t.size, 0.3), step, start)
    assert found == pytest.approx(cra.tip_response(ARM, motion, t, modes), rel=1e-10, abs=1e-14)


def test_three_modes_and_no_direct_path_unless_asked_for_more():
    system = cra.state_space(ARM)
    assert system.A.shape == (6, 6) and system.D.tolist() == [[0.0]]


@pytest.mark.filterwarnings("ignore::cra_sym.UndersamplingWarning")
def test_lsim_of_a_sampled_record_agrees_with_the_closed_form():
    t = np.linspace(0, 1, 51)
    a = np.random.default_rng(2).normal(size=51)
    _, found, _ = signal.lsim(cra.state_space(ARM, 4), a, t)
    assert found == pytest.approx(cra.tip_response(ARM, BaseMotion.sampled(t, a), t, 4), rel=1e-9, abs=1e-13)


def test_a_free_base_is_pushed_as_its_prescribed_motion_says():
    """Second route: the base acceleration that the force causes, prescribed, gives the same tip displacement."""
    modes, step = 4, 2e-3
    t = step * np.arange(500)
    system = cra.state_space(ARM, modes, input="drive_force")
    force = np.ones(t.size)
    found = held(system, force, step)
    observed = signal.StateSpace(system.A, system.B, system.A[modes + 1 : modes + 2], system.B[modes + 1 : modes + 2])
    acceleration = held(observed, force, step) + observed.D.item()
    prescribed = cra.tip_response(ARM, BaseMotion.sampled(t, acceleration), t, modes)
    assert found[:-1] == pytest.approx(prescribed[:-1], abs=2e-3 * np.abs(found).max())


def test_the_centre_of_mass_of_the_free_system_obeys_newton():
    modes = 5
    system = cra.state_space(ARM, modes, input="drive_force")
    p = cra.modal_parameters(ARM, modes)
    whole = ARM.m_b + ARM.m_e + ARM.rhoA * ARM.L
    momentum = np.concatenate([[whole], p.participation])
    rates = system.A[modes + 1 :], system.B[modes + 1 :]
    assert momentum @ rates[0] == pytest.approx(0.0, abs=1e-9)
    assert momentum @ rates[1] == pytest.approx(1.0)


def test_a_light_base_meets_the_spring_force_of_the_root():
    """The base's own free body, m_b w'' = F + k_t v(0): approached as modes are added."""
    gaps = []
    for modes in (2, 8, 32):
        p = cra.modal_parameters(ARM.replace(zeta=0.0), modes)
        system = cra.state_space(ARM.replace(zeta=0.0), modes, input="drive_force")
        q = np.linspace(1, 2, modes) / p.omega**2
        state = np.concatenate([[0.0], q, np.zeros(modes + 1)])
        acceleration = (system.A @ state)[modes + 1]
        gaps.append(abs(ARM.m_b * acceleration / (ARM.k_t * p.root_displacement @ q) - 1))
    assert gaps[0] > gaps[1] > gaps[2]
    assert gaps[2] < 0.01


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ({"input": "force"}, "input = 'force'"),
        ({"modes": 0}, "modes = 0"),
        ({"system": ARM.replace(k_t=[1, 2])}, "single"),
    ],
)
def test_bad_input_is_named(arguments, words):
    with pytest.raises(ValueError, match=words):
        cra.state_space(**({"system": ARM} | arguments))
