"""Elastic-slip elements found from frequency and damping over amplitude: those put in, with goodness of fit."""

from __future__ import annotations

import numpy as np
import pytest
from sympy import Function, symbols

import cra_sym as cra
from cra_sym.symbols import t, x

K_D, SLIP, CHI = symbols("k_d f_s chi")
AMPLITUDE = np.array([0.05, 0.15, 0.3, 0.6, 1.2])
Q = Function("q")(t)


def mass(element, values):
    """One mass on a spring of 4 and an element, slightly damped."""
    model = cra.Model(
        0, fields=(), x=x, domain=(0, 1), t=t, coordinates=[Q], left=Q.diff(t) ** 2 / 2 - 2 * Q**2,
        hysteresis=[(element, Q, None)],
    )  # fmt: skip
    return model.at(values, zeta=0.002)


def jenkins(**values):
    return mass(cra.Jenkins(K_D, SLIP), {"k_d": 3.0, "f_s": 0.5} | values)


def measured(system, amplitude=AMPLITUDE):
    curve = cra.backbone(system, 1, amplitude=amplitude, modes=1)
    return curve.angular_frequency / (2 * np.pi), curve.damping_ratio


def test_a_jenkins_element_is_found_with_its_uncertainty():
    rng = np.random.default_rng(5)
    sigma = 1e-3, 1e-3
    frequency, ratio = (v + s * rng.standard_normal(v.size) for v, s in zip(measured(jenkins()), sigma, strict=True))
    begun = jenkins(k_d=1.5, f_s=0.9)
    fit = cra.identify_slip(begun, AMPLITUDE, frequency, np.abs(ratio), sigma, ("k_d", "f_s"), modes=1)
    assert fit.fits and fit.identifiable and fit.degrees_of_freedom == 8
    assert fit.p_value > 0.01 and len(fit.solutions) == 1
    for name, right, variance in zip(fit.values, (3.0, 0.5), np.diag(fit.covariance), strict=True):
        assert abs(fit.values[name] - right) < 4 * np.sqrt(variance) < 0.2 * right
    # the two data of small amplitude are those of everything stuck: omega^2 = 4 + k_d
    stuck = (2 * np.pi * fit.frequencies[0]) ** 2
    assert stuck == pytest.approx(4 + fit.values["k_d"], rel=1e-3)  # but for damping of 0.2 %, squared


def test_an_exponent_is_found():
    element, amplitude = cra.Iwan(3.0, SLIP, chi=CHI, beta=0.2, number=12), AMPLITUDE[[0, 2, 4]]
    right = mass(element, {"f_s": 0.5, "chi": -0.6})
    fit = cra.identify_slip(
        right.replace(chi=-0.3, f_s=0.7), amplitude, *measured(right, amplitude), (1e-3, 1e-3), ("chi", "f_s"), modes=1
    )
    assert fit.fits
    assert fit.values["chi"] == pytest.approx(-0.6, abs=1e-3) and fit.values["f_s"] == pytest.approx(0.5, rel=1e-3)


def test_what_does_not_fit_is_said():
    amplitude = AMPLITUDE[1:4:2]
    frequency, ratio = measured(jenkins(), amplitude)
    with pytest.warns(cra.MisfitWarning, match="no values of the unknown parameters fit: chi2"):
        fit = cra.identify_slip(jenkins(), amplitude, frequency * 1.2, ratio, (1e-4, 1e-4), ["f_s"], modes=1)
    assert not fit.fits and fit.p_value < 0.01


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"amplitude": AMPLITUDE[::-1]}, r"amplitude\[1\]: must ascend"),
        ({"frequency": [1.0]}, r"frequency has shape \(1,\): must be \(5,\), as amplitude"),
        ({"uncertainty": (0.0, 1.0)}, r"uncertainty = 0.0: must be real numbers in \(0, inf\)"),
        ({"unknown": ["mu"]}, "unknown = 'mu': must be among"),
        ({"unknown": []}, "must be one to four different names"),
    ],
)
def test_bad_input_is_named(changes, words):
    ones = np.ones(5)
    given = {"amplitude": AMPLITUDE, "frequency": ones, "damping_ratio": ones, "uncertainty": (1.0, 1.0),
             "unknown": ["k_d"]}  # fmt: skip
    with pytest.raises(ValueError, match=words):
        cra.identify_slip(jenkins(), **given | changes)
    with pytest.raises(ValueError, match="no elastic-slip elements"):
        cra.identify_slip(cra.Arm.nominal(), **given)
