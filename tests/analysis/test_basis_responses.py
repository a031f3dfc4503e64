"""Responses where the boundary-value problem or the modes fail: stiffnesses that vanish at an end, matched ends."""

from __future__ import annotations

import numpy as np
import pytest
import sympy as sp
from numpy.testing import assert_allclose
from scipy.integrate import solve_ivp
from scipy.special import j0, jn_zeros, jv, yv

import cra_sym as cra

x, t, c = sp.symbols("x t c")
v, F, w = sp.Function("v")(x, t), sp.Function("F")(t), sp.Function("w")(t)
HALF = sp.Rational(1, 2)
ROOT = v.subs(x, 0)
KINETIC = v.diff(t) ** 2 / 2
ALONG, END = (-c * v.diff(t), v, "domain"), (-c * v.diff(t), v, "right")


def line(density, **options):
    return cra.Model(density, fields=[v], x=x, domain=(0, 1), t=t, essential=[ROOT], **options)


CHAIN = KINETIC - (1 - x) * v.diff(x) ** 2 / 2
PUSHED = line(CHAIN, virtual_work=[(F, v, HALF), ALONG])


def chain_receptance(omega, drag, places):
    """A force at the middle of a hanging chain, by Bessel functions of 2 q sqrt(1 - x), q^2 = omega^2 - i c omega."""
    q = np.sqrt(omega**2 - 1j * drag * omega)

    def above(u, order):
        z, top = 2 * q * np.sqrt(u), 2 * q
        return jv(order, z) * yv(0, top) - yv(order, z) * jv(0, top)

    z = 2 * q * np.sqrt(0.5)
    # continuous; the tension times the slope grows by -1 towards the tip; d/du J_0(2 q sqrt u) = -q J_1 / sqrt u
    matrix = [[jv(0, z), -above(0.5, 0)], [jv(1, z), -above(0.5, 1)]]
    below, over = np.linalg.solve(matrix, [0.0, -1.0 / (q * np.sqrt(0.5))])
    return [below * jv(0, 2 * q * np.sqrt(1 - p)) if p >= 0.5 else over * above(1 - p, 0) for p in places]


@pytest.mark.parametrize("drag", [0.3, 0.0])
def test_a_force_on_a_hanging_chain(drag):
    omega, places = np.array([0.7, 5.0]), [0.3, 0.8, 1.0]
    found = cra.frequency_response(PUSHED.at({c: drag}), omega, places, drive=F)
    assert_allclose(found.T, [chain_receptance(w_, drag, places) for w_ in omega], rtol=1e-9)
    inside = cra.frequency_response(line(CHAIN, virtual_work=[ALONG]).at({c: drag}), 0.7, 1.0, drive=v.subs(x, HALF))
    assert_allclose(inside, chain_receptance(0.7, drag, [1.0])[0], rtol=1e-9)


@pytest.mark.parametrize("drag", [0.3, 0.0])
def test_a_force_on_the_tip_of_a_chain_is_refused(drag):
    """It would move without bounds: the sum of squared tip displacements over squared frequencies diverges."""
    system = line(CHAIN, virtual_work=[(F, v, "right"), ALONG]).at({c: drag})
    for asked in (
        lambda: cra.tip_response(system, {F: cra.Force(1.0)}, [0.5]),
        lambda: cra.frequency_response(system, 2.0, drive=F),
        lambda: cra.state_space(system, 2, F),
    ):
        with pytest.raises(ValueError, match=r"vanishes at the right end .* or the load"):
            asked()
    with pytest.raises(ValueError, match="no finite response where a stiffness vanishes"):
        cra.frequency_response(system, 2.0, drive=v.subs(x, 1))


def test_a_chain_at_rest_and_one_that_is_shaken():
    model = line(CHAIN, virtual_work=[(F, v, HALF)])
    assert_allclose(cra.frequency_response(model.at({}), 0.0, [0.3, 1.0], drive=F), -np.log([0.7, 0.5]), rtol=1e-10)
    shaken = line(CHAIN.subs(v.diff(t), v.diff(t) + w.diff(t)), prescribed=[w])
    omega = np.array([0.4, 2.3])
    exact = (1 - 1 / j0(2 * omega)) / omega**2
    assert_allclose(cra.frequency_response(shaken.at({}), omega), exact, rtol=1e-9)


def test_modal_damping_of_a_chain():
    """The sum over 4000 modes, whose terms alternate and fall with the square of the number."""
    model = line(CHAIN, virtual_work=[(F, v, HALF)])
    zeros = jn_zeros(0, 4000)

    def shape(place):
        return j0(zeros * np.sqrt(1 - place)) / np.abs(jv(1, zeros))

    omega, zeta = 1.3, 0.02
    parts = shape(0.3) * shape(0.5) / (zeros**2 / 4 + 1j * zeta * zeros * omega - omega**2)
    found = cra.frequency_response(model.at({}, zeta=zeta), omega, 0.3, drive=F)
    assert_allclose(found, parts.sum(), rtol=1e-6)


def test_complex_shapes_of_a_chain_in_a_fluid_are_the_natural_ones():
    system = PUSHED.at({c: 0.3})
    places = [0.3, 0.8, 1.0]
    natural = cra.mode_shapes(system, places, modes=2)
    assert_allclose(cra.mode_shapes(system, places, modes=2, damped=True), natural, atol=1e-9)


def test_eigenvalues_are_counted_where_a_stiffness_vanishes():
    expected = np.sqrt(jn_zeros(0, 5) ** 2 / 4 - 0.15**2 + 0j)
    number = 2 * int((np.abs(-0.15 + 1j * expected) < 7.0).sum())
    assert cra.count_eigenvalues(PUSHED.at({c: 0.3}), 7.0) == number == 8
    upwards = cra.Model(KINETIC - x * v.diff(x) ** 2 / 2, fields=[v], x=x, domain=(0, 1), t=t, essential=[v.subs(x, 1)])
    assert cra.count_eigenvalues(upwards.at({}), 7.0) == 8
    with pytest.raises(ValueError, match="the displacement there makes the strain infinite"):
        cra.count_eigenvalues(line(CHAIN, virtual_work=[END]).at({c: 0.3}), 7.0)


@pytest.mark.parametrize("drag", [0.3, 3.0])
def test_a_wedge_in_a_fluid_has_a_logarithm_at_its_tip(drag):
    """((1 - x)^3 v'')'' = -((1 - x) s^2 + c s) v, by DOP853 over ln(1 - x) from the series at the tip."""
    wedge = cra.Model(
        (1 - x) * KINETIC - (1 - x) ** 3 * v.diff(x, 2) ** 2 / 2, fields=[v], x=x, domain=(0, 1), t=t,
        essential=[ROOT, v.diff(x).subs(x, 0)], virtual_work=[ALONG],
    )  # fmt: skip
    near = 1e-10  # the series lacks terms of that order

    def clamped(s):
        def rates(log, y):
            u, y = np.exp(log), y.reshape(4, 2)
            return u * np.stack([y[1], y[2] / u**3, y[3], -(u * s**2 + drag * s) * y[0]]).ravel()

        start = [[1, near], [0, 1], [-drag * s * near**2 / 2, -drag * s * near**3 / 6],
                 [-drag * s * near, -drag * s * near**2 / 2]]  # fmt: skip
        start = np.array(start, dtype=complex).ravel()
        states = solve_ivp(rates, [np.log(near), 0.0], start, method="DOP853", rtol=1e-12, atol=1e-30).y[:, -1]
        return np.linalg.det(states.reshape(4, 2)[:2])

    for s in cra.eigenvalues(wedge.at({c: drag}), 2):
        h = 1e-5 * abs(s)
        step = 2 * h * clamped(s) / (clamped(s + h) - clamped(s - h))
        assert abs(step) < 3e-9 * abs(s)


TIMES = np.array([0.25, 1.0, 1.9, 2.1, 3.0, 4.5])


@pytest.mark.parametrize("damping", ["modal", "structural"])
def test_a_taper_to_almost_a_point(damping):
    """At rest the integral of (1 - x)^2 / E I, E I = (1 - x + e)^3; else the first modes, at rest those beyond."""
    e, Omega, zeta = 1e-6, 3.0, 0.02
    tapered = cra.Model(
        KINETIC - (1 - x + e) ** 3 * v.diff(x, 2) ** 2 / 2, fields=[v], x=x, domain=(0, 1), t=t,
        essential=[ROOT, v.diff(x).subs(x, 0)], virtual_work=[(F, v, "right")],
    )  # fmt: skip
    system = tapered.at({}, zeta=zeta)
    found = cra.frequency_response(system, [0.0, Omega], drive=F, damping=damping)
    loss = 1.0 + (0.0 if damping == "modal" else 2j * zeta)
    static = (np.log((1 + e) / e) + 2 * e / (1 + e) - 0.5 * (e / (1 + e)) ** 2 - 1.5) / loss
    omega, tip = system.natural_frequencies(12), system.modes(12).displacement(1, 0)
    damped = omega**2 * loss + (2j * zeta * omega * Omega if damping == "modal" else 0.0)
    summed = (tip**2 * (1 / (damped - Omega**2) - 1 / (loss * omega**2))).sum()
    assert_allclose(found[0], static, rtol=1e-9)
    assert_allclose(found[1], static + summed, rtol=1e-3)


def string_with_a_damper(damper):
    """Velocity of the end: 1 / (1 + c), times -(1 - c) / (1 + c) whenever the wave has come back."""
    start, back = 1 / (1 + damper), (1 - damper) / (1 + damper)
    rounds = (TIMES // 2).astype(int)
    before = np.array([sum(start * (-back) ** k * 2 for k in range(n)) for n in rounds])
    return before + start * (-back) ** rounds * (TIMES - 2 * rounds)


@pytest.mark.parametrize("damper", [0.9, 0.999, 1 - 1e-6, 1.0, 1 + 1e-9])
def test_a_constant_force_before_a_matched_end(damper):
    """Modes all but depend on each other, or there are none: the motion of a basis has a kink to follow."""
    string = line(KINETIC - v.diff(x) ** 2 / 2, virtual_work=[(F, v, "right"), END]).at({c: damper})
    found = cra.tip_response(string, {F: cra.Force(1.0)}, TIMES, modes=10)
    assert_allclose(found, string_with_a_damper(damper), atol=5e-4)


def test_residual_vibration_before_a_matched_end_is_refused():
    string = line(
        KINETIC.subs(v.diff(t), v.diff(t) + w.diff(t)) - v.diff(x) ** 2 / 2, prescribed=[w], virtual_work=[END]
    )
    with pytest.raises(ValueError, match="absorbs the waves"):
        cra.residual_vibration(string.at({c: 1.0}), cra.BaseMotion.trapezoid(0.5, 0.5, 1.0))
