"""The arm is a system: the model of the paper's Lagrangian, bound to values."""

import pickle

import numpy as np
import pytest

import cra_sym as cra
from cra_sym.arm.lagrangian import paper_lagrangian
from cra_sym.paper.motion import dynamics
from cra_sym.symbols import A, I_z, L, b, h, symbol, t, v, w, x

JOINTS = [(np.inf, np.inf), (1e3, 1e2), (1e2, np.inf), (np.inf, 1.0), (0.0, 50.0), (300.0, 0.0), (0.0, 0.0)]


def test_an_arm_is_a_system():
    arm = cra.Arm.nominal()
    assert isinstance(arm, cra.System)
    assert list(arm.values) == ["L", "b", "h", "E", "rho", "m_b", "m_e", "J_e", "k_t", "k_r"]
    assert {symbol.name for symbol in arm.model.symbols} == set(arm.values)


def test_the_model_is_that_of_the_paper_s_lagrangian():
    density, left, right = paper_lagrangian()
    section = {A: b * h, I_z: b * h**3 / 12}
    own = cra.Model(
        density, fields=[v], prescribed=[w], x=x, domain=(0, L), t=t, left=left, right=right, definitions=section
    )
    assert own == cra.Arm.nominal().model


@pytest.mark.parametrize(("k_t", "k_r"), JOINTS)
def test_the_arm_written_by_hand_gives_its_numbers(k_t, k_r):
    """Area and second moment of area as parameters of their own: another model, the same arm."""
    arm = cra.Arm.nominal().replace(k_t=k_t, k_r=k_r, m_e=0.02, J_e=2e-5)
    density, left, right = paper_lagrangian()
    model = cra.Model(density, fields=[v], prescribed=[w], x=x, domain=(0, L), t=t, left=left, right=right)
    values = {name: value for name, value in arm.values.items() if name not in ("b", "h")}
    system = model.at({**values, "A": arm.A, "I_z": arm.I})
    expected = cra.natural_frequencies(arm, modes=5)
    np.testing.assert_allclose(cra.natural_frequencies(system, 5), expected, rtol=1e-13, atol=1e-9)
    elastic = expected > 0  # two rigid-body modes may be combined at will
    ours, theirs = (cra.modal_parameters(one, 5).participation[elastic] for one in (system, arm))
    np.testing.assert_allclose(ours, theirs, rtol=1e-9, atol=1e-12)


def test_equations_of_the_freed_base_are_those_of_the_derivation():
    density, left, right = paper_lagrangian()
    F = symbol("F")
    driven = cra.Model(
        density,
        fields=[v],
        coordinates=[w],
        x=x,
        domain=(0, L),
        t=t,
        left=left,
        right=right,
        virtual_work=[(F, w, None)],
    )
    assert driven.equations.equations == dynamics().equations


def test_a_free_base_moves_all_modes_and_adds_a_drift():
    arm = cra.Arm.nominal().replace(k_t=1e3, k_r=1e2)
    free = arm.model.freed("w")
    found = free.natural_frequencies(arm.values, modes=4)
    held = cra.natural_frequencies(arm, modes=3)
    assert found[0] == 0.0
    assert np.all(found[1:] > held)  # releasing a constraint on a mass that moves against the arm raises them
    heavy = free.natural_frequencies(arm.replace(m_b=1e9).values, modes=4)[1:]
    np.testing.assert_allclose(heavy, held, rtol=1e-6)  # of the order of the arm's mass over that of the base


def test_ritz_of_the_model_bounds_from_above():
    arm = cra.Arm.nominal().replace(k_t=1e3, k_r=1e2)
    upper = arm.model.ritz(elements=8).natural_frequencies(arm.values, modes=3)
    exact = cra.natural_frequencies(arm)
    assert np.all(upper >= exact * (1 - 1e-12))
    np.testing.assert_allclose(upper, exact, rtol=1e-3)


def test_systems_compare_by_value_and_pickle():
    arm = cra.Arm.nominal()
    system = arm.model.at(arm.values, zeta=0.01)
    again = pickle.loads(pickle.dumps(system))
    assert again == system and hash(again) == hash(system)
    assert system != system.replace(k_t=1e3) and system.replace(zeta=0.02) != system
    np.testing.assert_array_equal(cra.natural_frequencies(again), cra.natural_frequencies(system))
