"""A bolted joint over its preload: limits, monotony, series of springs, and the arm that holds it."""

from __future__ import annotations

import numpy as np
import pytest

import cra_sym as cra

PRELOAD = np.logspace(-2, 5, 30)


def test_stiffnesses_rise_with_preload_to_those_of_the_members():
    joint = cra.BoltedJoint()
    found = joint.values(PRELOAD)
    for name, limit in (("k_d", 1e6), ("k_r", 1e4)):
        assert (np.diff(found[name]) > 0).all()
        assert found[name][-1] == pytest.approx(limit, rel=1e-2)
    np.testing.assert_allclose(found["slip"], 0.15 * PRELOAD, rtol=1e-15)
    assert (found["k_t"] == 100.0).all()


def test_contact_alone_follows_its_power_law():
    """Rigid members: normal over sideways stiffness is Mindlin's ratio, both follow the power of the preload."""
    for exponent in (0.5, 1.0):
        joint = cra.BoltedJoint(body_t=np.inf, body_r=np.inf, exponent=exponent, reference=3.0, lever=0.02)
        found = joint.values([3.0, 30.0])
        for name in ("k_d", "k_r"):
            assert found[name][1] / found[name][0] == pytest.approx(10**exponent, rel=1e-14)
        # sphere-free form of Mindlin's ratio: 2 (1 - nu) / (2 - nu)
        assert found["k_d"][0] * 0.02**2 / found["k_r"][0] == pytest.approx(1.34 / 1.67, rel=1e-14)
        assert found["k_d"][0] == pytest.approx(1.34 / 1.67 * 3.0 / 5e-6, rel=1e-14)
    double = joint.replace(faces=2).values(3.0)
    assert double["k_d"] == 2 * found["k_d"][0] and double["slip"] == pytest.approx(2 * 0.15 * 3.0, rel=1e-15)


def test_the_greenwood_williamson_contact_has_the_stiffness_of_its_integral():
    """Summits exp(-z/sigma)/sigma, each pressed by z - d with a force of any power: dN/d(-d) = N/sigma."""
    sigma, z = 5e-6, np.linspace(0, 4e-4, 400_001)
    density = np.exp(-z / sigma) / sigma

    def force(d):
        return np.trapezoid(density * np.maximum(z - d, 0.0) ** 1.5, z)

    d, h = 2 * sigma, 1e-3 * sigma
    # trapezoids of 1 nm, and a central difference: (1e-3)^2/6 of the value
    assert (force(d - h) - force(d + h)) / (2 * h) == pytest.approx(force(d) / sigma, rel=1e-5)


def test_the_arm_with_the_joint_sticks_as_an_arm_of_both_springs():
    arm, joint = cra.Arm.nominal(), cra.BoltedJoint()
    system, values = joint.on(arm, PRELOAD), joint.values(PRELOAD)
    stiff = arm.replace(k_t=values["k_t"] + values["k_d"], k_r=values["k_r"])
    # other routes to the frequencies: closed forms of the arm, and of the model with an added spring
    np.testing.assert_allclose(cra.natural_frequencies(system), cra.natural_frequencies(stiff), rtol=1e-10)
    assert joint.on(arm, 3.0) == joint.on(arm.replace(k_t=1.0, k_r=2.0), 3.0)


def test_the_preload_as_a_parameter_is_the_joint_at_that_preload():
    arm, joint = cra.Arm.nominal().replace(zeta=0.01), cra.BoltedJoint(faces=2, exponent=0.7)
    system, right = joint.parametric(arm, [0.5, 20.0]), joint.on(arm, [0.5, 20.0])
    assert "preload" in system.values and not {"k_t", "k_r", "k_d", "slip"} & {*system.values}
    np.testing.assert_allclose(cra.natural_frequencies(system), cra.natural_frequencies(right), rtol=1e-12)
    move, times = cra.BaseMotion.trapezoid(0.3, 0.5, 2.0), np.linspace(0.0, 0.8, 9)
    found, wanted = (cra.tip_response(one, move, times, modes=2) for one in (system, right))
    # the same equations with other rounding, which events pass on
    np.testing.assert_allclose(found, wanted, rtol=0, atol=1e-10 * np.abs(wanted).max())
    for one, preload in zip(system.parameter_sets, (0.5, 20.0), strict=True):
        assert one == joint.parametric(arm, preload)


@pytest.mark.parametrize(
    ("name", "value", "words"),
    [
        ("rest", -1.0, r"must be real numbers in \[0, inf\)"),
        ("roughness", 0.0, r"must be real numbers in \(0, inf\)"),
        ("friction", np.inf, r"must be real numbers in \(0, inf\)"),
        ("exponent", 1.01, r"must be a real number in \(0, 1\]"),
        ("poisson", 0.6, r"must be real numbers in \[0, 0.5\]"),
        ("faces", 0, "must be an integer of at least 1"),
        ("lever", [1.0, 2.0], "must be one number"),
    ],
)
def test_bad_parameters_are_named(name, value, words):
    with pytest.raises(ValueError, match=f"{name}.*{words}"):
        cra.BoltedJoint(**{name: value})


def test_bad_arguments_are_named():
    joint = cra.BoltedJoint()
    with pytest.raises(ValueError, match=r"preload\[1\] = 0.0: must be real numbers in \(0, inf\)"):
        joint.values([1.0, 0.0])
    for method in (joint.on, joint.parametric):
        with pytest.raises(TypeError, match="must be an Arm"):
            method(3.0, 1.0)
    with pytest.raises(ValueError, match=r"preload = -1\.0: must be real numbers in"):
        joint.parametric(cra.Arm.nominal(), -1.0)
    with pytest.raises(TypeError, match="'torque' is not a parameter"):
        joint.replace(torque=1.0)
