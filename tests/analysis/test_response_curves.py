"""Frequency-response curves: closed forms, and what steady states at single frequencies say."""

from __future__ import annotations

import numpy as np
import pytest
import sympy as sp

import cra_sym as cra
from tests.nonlinear_models import oscillator, q, t, x

F, r = sp.Function("F")(t), sp.Function("r")(t)
DUFFING = oscillator(q.diff(t) ** 2 / 2 - q**2 / 2 - q**4 / 4, virtual_work=[(F, q, None)])
TENTH = sp.Rational(1, 10)


def pair(lagrangian, driven):
    kinetic = (q.diff(t) ** 2 + r.diff(t) ** 2) / 2
    work = [(F, driven, None)] + [(-c.diff(t) / 20, c, None) for c in (q, r)]
    return cra.Model(
        0, fields=(), coordinates=[q, r], x=x, domain=(0, 1), t=t, left=kinetic - lagrangian, virtual_work=work
    ).at({})


def test_duffing_is_its_cubic_with_its_folds():
    """One harmonic: ((1 - w^2) a + 3 a^3/4)^2 + (2 zeta w a)^2 = f^2, and folds where its discriminant vanishes."""
    (curve,) = cra.response_curves(DUFFING.at({}, zeta=0.05), (0.6, 1.8), drive={F: 0.1}, modes=1, harmonics=1)
    w, a = curve.angular_frequency, curve.amplitude
    np.testing.assert_allclose(((1 - w**2) * a + 0.75 * a**3) ** 2 + (0.1 * w * a) ** 2, 0.01, rtol=1e-9)
    assert (w[0], w[-1]) == (0.6, 1.8) and not curve.closed and not curve.branch_points.size
    size, at = sp.symbols("size at")
    cubic = sp.Poly(((1 - at**2) + 3 * size / 4) ** 2 * size + (at / 10) ** 2 * size - sp.Rational(1, 100), size)
    roots = np.array([complex(root) for root in sp.Poly(cubic.discriminant(), at).nroots(n=15)])
    wanted = sorted(root.real for root in roots if abs(root.imag) < 1e-9 and 1 < root.real < 1.8)
    np.testing.assert_allclose(np.sort(curve.folds), wanted, rtol=1e-8)
    unstable = w[~curve.stable]
    assert np.count_nonzero(np.diff(curve.stable)) == 2 and unstable.size > 5
    assert wanted[0] - 1e-9 < unstable.min() < unstable.max() < wanted[1] + 1e-9


def test_the_branch_from_rest_begins_where_rest_loses_its_stability():
    """A parametron: the multipliers of rest tell the edges of its zone; the branch comes back through a fold."""
    k = sp.Symbol("k", positive=True)
    work = [(-q.diff(t) / 100 - 3 * TENTH * q**2 * q.diff(t), q, None)]
    system = oscillator(q.diff(t) ** 2 / 2 - k * q**2 / 2 - q**4 / 4, virtual_work=work).at({"k": 1.0})
    options = {"excitation": cra.Fluctuation(k=1.0), "epsilon": 0.05, "modes": 1, "period": 2, "harmonics": 5}
    rest, branch = cra.response_curves(system, (1.9, 2.2), **options)
    assert not rest.amplitude.any() and branch.closed and rest.branch_points.size == 2
    for edge in rest.branch_points:  # located to 1e-5 of the interval
        sides = cra.steady_states(system, edge + np.array([-1e-5, 1e-5]), **options)
        assert {states[0].stable for states in sides} == {True, False} and not sides[0][0].amplitude
    at = 2.05
    amplitudes = np.unique([round(s.amplitude, 5) for s in cra.steady_states(system, at, **options)])
    crossed = branch.angular_frequency - at
    steps = np.flatnonzero(crossed[:-1] * crossed[1:] < 0)
    share = crossed[steps] / (crossed[steps] - crossed[steps + 1])
    found = (1 - share) * branch.amplitude[steps] + share * branch.amplitude[steps + 1]
    gaps = np.abs(found[:, None] - amplitudes[None, 1:])  # linear between the points of the curve
    assert gaps.min(axis=0).max() < 5e-3 and gaps.min(axis=1).max() < 5e-3 and len(amplitudes) == 3


def test_two_like_oscillators_have_their_large_answers_beside_the_small_one():
    """1:1: starts in one mode alone do not lead there; the curve over the frequency has them all."""
    system = pair(q**2 / 2 + r**2 / 2 + (q - r) ** 2 / 80 + (q**4 + r**4) / 4, q)
    options = {"drive": {F: 0.08}, "modes": 2, "harmonics": 3}
    curves = cra.response_curves(system, (1.2, 1.3), **options)
    states = cra.steady_states(system, 1.25, **options)
    crossed = sum(np.count_nonzero(np.diff(np.sign(c.angular_frequency - 1.25))) for c in curves)
    assert len(states) == crossed == 3 and [s.stable for s in states] == [True, False, True]


def test_autoparametric_answers_are_found_where_the_simple_one_is_unstable():
    """1:2: the driven mode saturates; q is the subharmonic, whose threshold the simple answer's multipliers tell."""
    system = pair(q**2 / 2 + 2 * r**2 + 2 * q**2 * r / 5, r)
    states = cra.steady_states(system, 2.0, drive={F: 0.1}, modes=2, harmonics=5, period=2)
    simple, *others = states
    assert not simple.stable and simple.amplitude < 1e-12 and [s.stable for s in others] == [True, True]
    # exact resonance, one harmonic each: the driven one keeps to 2 c/g, the other takes up the rest of the force
    driven = np.hypot(*others[0].coefficients[:, [2, 5 + 2]].T)
    np.testing.assert_allclose(driven.max(), np.hypot(*others[1].coefficients[:, [2, 7]].T).max(), rtol=1e-9)


def test_symmetric_equations_have_their_broken_answers():
    """Strongly driven: the symmetric answer is unstable, a pair, each the mirror image of the other, is stable."""
    system = oscillator(q.diff(t) ** 2 / 2 - q**2 / 2 - q**4 / 4, virtual_work=[(F - q.diff(t) / 10, q, None)]).at({})
    states = cra.steady_states(system, 1.0, drive={F: 3.0}, modes=1, harmonics=15)
    assert [s.stable for s in states] == [False, True, True]
    np.testing.assert_allclose(states[1].coefficients[0][0], -states[2].coefficients[0][0], rtol=1e-9)
    np.testing.assert_allclose(states[1].amplitude, 2.131129386, rtol=1e-5)  # integration over 300 periods


@pytest.mark.parametrize(
    ("between", "options", "message"),
    [
        ((1.0, 0.5), {}, "between = .* must be two angular frequencies, the lower one first"),
        (1.0, {}, "between"),
        ((0.5, 1.0), {"epsilon": [0.1, 0.2], "excitation": cra.Fluctuation(k=1.0)}, "epsilon has shape"),
        ((0.5, 1.0), {"points": 1}, "points = 1"),
        ((0.5, 1.0), {"period": 0}, "period = 0"),
    ],
)
def test_bad_input_is_named(between, options, message):
    with pytest.raises(ValueError, match=message):
        cra.response_curves(DUFFING.at({}), between, modes=1, **options)


def test_a_curve_that_is_cut_short_says_so():
    with pytest.warns(cra.ConvergenceWarning, match="not followed to its end, in 10 points"):
        cra.response_curves(DUFFING.at({}, zeta=0.05), (0.6, 1.8), drive={F: 0.1}, modes=1, harmonics=1, points=10)
