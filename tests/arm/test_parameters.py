"""Arm: validation, value semantics, groups and provenance."""

import copy
import pickle

import numpy as np
import pytest

from cra_sym import Arm

NOMINAL = Arm.nominal()


def test_groups_of_the_nominal_arm():
    assert NOMINAL.rhoA * NOMINAL.L == pytest.approx(0.243)
    assert NOMINAL.EI == pytest.approx(4.649, abs=1e-3)
    assert NOMINAL.angular_frequency_scale == pytest.approx(4.37399, abs=5e-5)
    assert NOMINAL.kappa_t == NOMINAL.kappa_r == np.inf
    assert NOMINAL.mu == pytest.approx(0.001 / 0.243)
    assert NOMINAL.iota == 0.0


def test_groups_do_not_depend_on_units():
    arm = NOMINAL.replace(k_t=1e4, k_r=20.0, J_e=1e-5)
    grams_millimetres = Arm(
        L=1e3 * arm.L, b=1e3 * arm.b, h=1e3 * arm.h, E=arm.E, rho=1e-6 * arm.rho, m_b=1e3 * arm.m_b, m_e=1e3 * arm.m_e,
        J_e=1e9 * arm.J_e, k_t=1e3 * arm.k_t, k_r=1e9 * arm.k_r,
    )  # fmt: skip
    for group in ("kappa_t", "kappa_r", "mu", "iota"):
        assert getattr(grams_millimetres, group) == pytest.approx(getattr(arm, group), rel=1e-14)


def test_the_nominal_numbers_and_what_is_not_said():
    strip = {"L": 1.0, "b": 0.03, "h": 0.003, "E": 68.875e9, "rho": 2700.0, "m_b": 5.0}
    bare = Arm(**strip)
    assert (bare.m_e, bare.J_e, bare.zeta) == (0.0, 0.0, 0.0) and bare.k_t == bare.k_r == np.inf
    assert NOMINAL == bare.replace(m_e=0.001)


def test_provenance_covers_every_field():
    assert set(Arm.provenance) == set(Arm._names())
    assert {entry.kind for entry in Arm.provenance.values()} == {"published", "calibrated", "assumed"}
    assert all(getattr(NOMINAL, name) == entry.value and entry.note for name, entry in Arm.provenance.items())


@pytest.mark.parametrize(
    ("field", "value", "error"),
    [
        ("L", 0.0, ValueError), ("b", -1.0, ValueError), ("h", np.nan, ValueError), ("E", np.inf, ValueError),
        ("rho", 0, ValueError), ("m_b", -1e-9, ValueError), ("m_e", np.inf, ValueError), ("J_e", -1.0, ValueError),
        ("k_t", -1.0, ValueError), ("k_r", np.nan, ValueError), ("zeta", 1.0, ValueError), ("zeta", -0.1, ValueError),
        ("L", "1", TypeError), ("k_t", None, TypeError), ("m_e", True, TypeError), ("E", 1 + 2j, TypeError),
        ("k_t", -0.05, ValueError), ("k_t", [1.0, -2.0], ValueError), ("rho", [[1.0], [1.0, 2.0]], TypeError),
    ],
)  # fmt: skip
def test_bad_values_name_the_field(field, value, error):
    with pytest.raises(error, match=rf"^{field}(\[1\])? = .*must be real numbers in"):
        NOMINAL.replace(**{field: value})


def test_other_bad_input():
    with pytest.raises(ValueError, match=r"k_t \(2,\), k_r \(3,\)"):
        NOMINAL.replace(k_t=[1, 2], k_r=[1, 2, 3])
    with pytest.raises(TypeError, match="'k' is not a parameter of Arm"):
        NOMINAL.replace(k=1.0)
    with pytest.raises(ValueError, match="EI = 0"):
        NOMINAL.replace(h=1e-200)
    with pytest.raises(ValueError, match="EI = inf"):
        NOMINAL.replace(b=[0.03, 1.0], h=[1e200, 1e200])


def test_value_semantics_with_arrays():
    values = np.array([1.0, 2.0])
    arm = NOMINAL.replace(k_t=values)
    values[0] = 7.0
    assert arm.k_t[0] == 1.0
    with pytest.raises(ValueError, match="read-only"):
        arm.k_t[0] = 3.0
    with pytest.raises(AttributeError):
        arm.k_t = 3.0
    same = NOMINAL.replace(k_t=[1.0, 2.0])
    assert arm == same and hash(arm) == hash(same) and arm != NOMINAL and arm != "arm"
    assert NOMINAL.replace(m_e=-0.0) == NOMINAL.replace(m_e=0)
    assert NOMINAL.replace(k_t=np.float64(3)).k_t.__class__ is float
    loose = NOMINAL.replace(k_t=1e-9, k_r=1e-9)
    assert loose.k_t == loose.k_r == 1e-9


@pytest.mark.parametrize("clone", [copy.copy, copy.deepcopy, lambda arm: pickle.loads(pickle.dumps(arm))])
def test_copies_are_equal_and_read_only(clone):
    arm = NOMINAL.replace(k_t=np.geomspace(1, 1e3, 3)[:, None], m_e=[0.0, 0.1])
    other = clone(arm)
    assert other == arm and hash(other) == hash(arm) and other.shape == (3, 2)
    assert not other.k_t.flags.writeable


def test_repr_evaluates_back():
    arm = NOMINAL.replace(k_t=[1.0, np.inf])
    assert eval(repr(arm), {"Arm": Arm, "array": np.array, "inf": np.inf}) == arm  # the test's own text
