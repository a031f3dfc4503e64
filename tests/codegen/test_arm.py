"""The arm printed from one source: input that was taken wrongly before, and numbers beside the package's own."""

from __future__ import annotations

import math
from functools import cache
from itertools import product
from types import SimpleNamespace

import numpy as np
import pytest
from sympy import Add, Rational

import cra_sym as cra
from cra_sym.arm.lagrangian import arm_model
from cra_sym.codegen import arm_energies, arm_library
from cra_sym.symbols import E, J_e, k_r, k_t, m_b, m_e, rho
from tests.campaigns.languages import worst
from tests.codegen import kit
from tests.codegen.kit import arm_without_vectors

FIELDS = ("L", "b", "h", "E", "rho", "m_b", "m_e", "J_e", "k_t", "k_r", "zeta")


@cache
def exported() -> SimpleNamespace:
    """The exported Python; its reference vectors are what the READMEs' tests compare with."""
    text = arm_without_vectors("crane").texts("python")["crane.py"]
    names: dict = {}
    exec(compile(text, "crane", "exec"), names)
    return SimpleNamespace(**names)


def arm_of(arm: cra.Arm, **changes):
    return exported().Arm(**{name: float(getattr(arm, name)) for name in FIELDS} | changes)


@pytest.mark.parametrize("kind", [np.float64, np.float32, np.int64, np.longdouble, int])
def test_any_number_is_a_number(kind):
    arm = cra.Arm.nominal().replace(k_t=1000.0, k_r=0.0)
    found = exported().natural_frequencies(arm_of(arm, k_t=kind(1000), k_r=kind(0)), 3)
    np.testing.assert_allclose(np.asarray(found, float), cra.natural_frequencies(arm, 3), rtol=1e-12)


def test_groups_at_both_ends_of_the_range_and_close_pairs():
    """Groups of 1e-200 and 1e200, soft springs together, arms whose frequencies come in pairs: as the package."""
    groups = list(product((0.0, 1e-60, 1e200, math.inf), (1e-60, 3.0), (1e-200, 1e5), (0.0, 1e-200)))
    groups += [(1e-200, 3.0, 0.1, 0.0), (3.0, 1e-200, 0.1, 0.0), (2.0, 1e-4, 1e9, 1e-3), (500.0, 0.0, 1e6, 2e-3)]
    groups += [(1e9, 1e9, 1e9, 1e9), (1e-12, 1e-12, 1e12, 1e12)]
    for one in groups:
        expected = cra.frequency_parameters(*one, modes=6)
        np.testing.assert_allclose(exported().frequency_parameters(*one, 6), expected, rtol=1e-12)


def test_random_arms_agree_with_the_package():
    rng = np.random.default_rng(17)
    groups = 10 ** rng.uniform(-6, 9, (4, 300))
    expected = cra.frequency_parameters(*groups, modes=8)
    found = np.array([exported().frequency_parameters(*column, 8) for column in groups.T.tolist()])
    assert np.max(np.abs(found - expected) / expected) < 1e-12


def test_another_lagrangian_is_exported_as_its_model_says(monkeypatch):
    """Every term times its own factor: nothing that is printed is typed in beside the Lagrangian."""
    factors = {m_b: 1.3, m_e: 1.7, J_e: 0.6, k_t: 1.9, k_r: 0.7, rho: 1.4, E: 0.8}
    changed = {
        name: Add(*(n * f for n in Add.make_args(arm_model().pieces[name].expand()) for s, f in exact if n.has(s)))
        for exact in [[(s, Rational(f)) for s, f in factors.items()]]
        for name in ("density", "left", "right")
    }
    model = arm_model().replace(**changed)
    monkeypatch.setattr(arm_energies, "arm_model", lambda: model)
    names: dict = {}
    made = arm_without_vectors.__wrapped__("crane")
    exec(compile(made.texts("python")["crane.py"], "crane", "exec"), names)
    arm = cra.Arm.nominal().replace(k_t=2e3, k_r=50.0, m_e=0.05, J_e=1e-4, zeta=0.01)
    given = names["Arm"](**{name: float(getattr(arm, name)) for name in FIELDS})
    system, modes = model.at(arm.values, zeta=arm.zeta), names["modes_of"](given, 3)
    modal, rates = cra.modal_parameters(system, 3), cra.sensitivities(system, 3, by=("k_t", "k_r"))
    for name in ("frequency", "participation", "root_displacement", "root_slope", "root_moment", "tip_slope"):
        np.testing.assert_allclose([getattr(mode, name) for mode in modes], getattr(modal, name), rtol=1e-11)
    found = np.array([names["sensitivity"](mode) for mode in modes])
    expected = [rates.rate["k_t"], rates.rate["k_r"], rates.log["k_t"], rates.log["k_r"]]
    np.testing.assert_allclose(found.T, expected, rtol=1e-10)
    states = np.array(names["state_space_force"](given, 3, modes, 8, 64)[0]).reshape(8, 8)
    np.testing.assert_allclose(states, cra.state_space(system, 3, input="drive_force").A, rtol=1e-9, atol=1e-9)
    shaken = names["Excitation"](k_t=0.0, k_r=0.0, amplitude=1.0)
    axial = [[names["coupling"](given, shaken, one, other, 1.0) for other in modes] for one in modes]
    np.testing.assert_allclose(axial, modal.axial, rtol=1e-11)


def test_modes_that_are_refused():
    arm = arm_of(cra.Arm.nominal())
    for modes in (0, -1, 1001):
        with pytest.raises(ValueError, match="modes: must be 1 to 1000"):
            exported().natural_frequencies(arm, modes)
    with pytest.raises(ValueError, match="k_t, k_r"):
        exported().modes_of(arm_of(cra.Arm.nominal(), k_t=math.nan), 2)


def test_stiffnesses_are_rigid_unless_given():
    """As in the package, in the languages whose records have beginnings."""
    arm = exported().Arm(L=1.0, b=0.03, h=0.003, E=7e10, rho=2700.0)
    assert arm.k_t == arm.k_r == math.inf
    text = arm_library.source("arm")
    assert text.count("float = inf") == 2


def test_random_arms_in_another_language():
    """A sample of `tests.campaigns.languages`, which has 10 000 arms and all languages."""
    kit.needs("javascript")
    frequencies, modal = worst("javascript", 60)
    assert frequencies < 1e-14 and modal < 1e-12
