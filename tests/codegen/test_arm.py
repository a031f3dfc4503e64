"""The arm printed from one source: input that was taken wrongly before, and numbers beside the package's own."""

from __future__ import annotations

import math
from functools import cache
from itertools import product
from types import SimpleNamespace

import numpy as np
import pytest

import cra_sym as cra
from cra_sym.codegen import arm_library
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


@pytest.mark.parametrize("language", ["c", "fortran", "javascript"])
def test_random_arms_in_languages(language):
    """A sample of `tests.campaigns.languages`, which has 10 000 arms."""
    if not kit.has(language):
        pytest.skip(f"{language} needs {kit.COMMANDS[language][0]}")
    frequencies, modal = worst(language, 60)
    assert frequencies < 1e-14 and modal < 1e-12
