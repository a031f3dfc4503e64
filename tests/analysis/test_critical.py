"""Where stability is lost: buckling loads, flutter loads, pipes, against closed forms in 30 digits and elements."""

from __future__ import annotations

import numpy as np
import pytest
import sympy as sp
from mpmath import mp, mpc, mpf
from numpy.testing import assert_allclose

import cra_sym as cra

x, t = sp.symbols("x t")
P, U, beta, tau, k = sp.symbols("P U beta tau k")
v = sp.Function("v")(x, t)
HALF = sp.Rational(1, 2)
BEAM = HALF * v.diff(t) ** 2 - HALF * v.diff(x, 2) ** 2
PRESSED = BEAM + HALF * P * v.diff(x) ** 2
CLAMPED = [v.subs(x, 0), v.diff(x).subs(x, 0)]
FOLLOWER = [(-P * v.diff(x), v, "right")]
FLOW = BEAM + HALF * U**2 * v.diff(x) ** 2 + beta * U * v.diff(t) * v.diff(x)
OUTLET = [(-(U**2) * v.diff(x) - beta * U * v.diff(t), v, "right")]
ACCURACY = 1e-10  # what the elements settle to


def model(density=PRESSED, essential=CLAMPED, **options):
    return cra.Model(density, fields=[v], x=x, domain=(0, 1), t=t, essential=essential, **options)


@pytest.mark.parametrize(
    ("essential", "load"),
    [
        (CLAMPED, np.pi**2 / 4),
        ([v.subs(x, 0), v.subs(x, 1)], np.pi**2),
        ([*CLAMPED, v.subs(x, 1)], float(mp.findroot(lambda y: mp.tan(y) - y, 4.49) ** 2)),
        ([*CLAMPED, v.subs(x, 1), v.diff(x).subs(x, 1)], 4 * np.pi**2),
    ],
)
def test_eulers_columns(essential, load):
    found = cra.critical_value(model(essential=essential).at({P: 0}), P, between=(0, 50))
    assert_allclose(found.value, load, rtol=ACCURACY)
    assert (found.kind, found.angular_frequency) == ("divergence", 0.0)


def test_a_column_under_its_own_weight():
    """Greenhill 1881: J_{-1/3}(2 sqrt(q)/3) = 0."""
    own = model(BEAM + HALF * P * (1 - x) * v.diff(x) ** 2)
    exact = float((mpf(3) / 2 * mp.findroot(lambda j: mp.besselj(-mpf(1) / 3, j), 1.87)) ** 2)
    assert abs(exact - 7.83734744) < 1e-8
    assert_allclose(cra.critical_value(own.at({P: 0}), "P", (0, 20)).value, exact, rtol=ACCURACY)


def test_a_stepped_column_on_a_spring_in_a_batch():
    """Buckling of what varies along x: there the lowest natural frequency vanishes. Axes are those of the spring."""
    stiff = sp.Piecewise((1, x < HALF), (3, True))
    column = model(
        HALF * v.diff(t) ** 2 - HALF * stiff * v.diff(x, 2) ** 2 + HALF * P * v.diff(x) ** 2, right=-HALF * k * v**2
    )
    found = cra.critical_value(column.at({P: 0, k: [0.0, 1.0, np.inf]}), P, between=(0, 60))
    assert found.value.shape == found.kind.shape == (3,) and (found.kind == "divergence").all()
    for load, spring in zip(found.value, (0.0, 1.0, np.inf), strict=True):
        squares = (2 * np.pi * column.natural_frequencies({P: load * (1 - np.array([1e-6, 2e-6])), k: spring}, 1)) ** 2
        assert_allclose(squares[1] / squares[0], 2.0, rtol=1e-4)  # linear in the load, zero there
        with pytest.raises(ValueError, match="buckled"):
            column.natural_frequencies({P: load * (1 + 1e-6), k: spring}, 1)


def test_becks_column():
    """Where two roots of the closed form meet: 20.0509536187612 at omega^2 = 121.3425101405."""
    found = cra.critical_value(model(virtual_work=FOLLOWER).at({P: 0}), P, between=(0, 300))
    assert found.kind == "flutter"
    assert_allclose(found.value, 20.0509536187612, rtol=ACCURACY)
    assert_allclose(found.angular_frequency**2, 121.3425101405, rtol=1e-8)


def test_a_force_that_follows_in_part():
    """Divergence at cos(sqrt P) = a/(a - 1) for a share a below 1/2 that follows, flutter beyond (Bolotin 1963)."""
    share = sp.Symbol("share")
    column = model(virtual_work=[(-share * P * v.diff(x), v, "right")])
    shares = np.array([0.0, 0.3, 0.49, 0.51, 1.0])
    found = cra.critical_value(column.at({P: 0, share: shares}), P, between=(0, 60))
    assert found.kind.tolist() == ["divergence"] * 3 + ["flutter"] * 2
    assert_allclose(found.value[:3], np.arccos(shares[:3] / (shares[:3] - 1)) ** 2, rtol=ACCURACY)
    assert_allclose(found.value[3], 16.05, atol=0.02)


def test_leipholz_column():
    """Distributed follower load: 40.05; between elements that flutter and elements that do not."""
    column = model(BEAM + HALF * P * (1 - x) * v.diff(x) ** 2, virtual_work=[(-P * v.diff(x), v, "domain")])
    found = cra.critical_value(column.at({P: 0}), P, between=(0, 60))
    assert found.kind == "flutter" and abs(found.value - 40.05) < 0.01
    ritz = column.ritz(24)
    below, above = (ritz.eigenvalues({P: found.value * (1 + side)}, 2) for side in (-1e-5, 1e-5))
    assert np.abs(below.real).max() < 1e-6 < 1e-2 < np.abs(above.real).max()


def outlet_determinant(speed, omega, share):
    """v'''' + U^2 v'' + 2 b U s v' + s^2 v = 0 with s = i omega, clamped, free at the outlet (Paidoussis)."""
    s = mpc(0, omega)
    r = mp.polyroots([1, 0, speed**2, 2 * share * speed * s, s**2], maxsteps=200, extraprec=200)
    rows = [[1] * 4, r, [a**2 * mp.exp(a) for a in r], [a**3 * mp.exp(a) for a in r]]
    return mp.det(mp.matrix(rows))


@pytest.mark.parametrize(("ratio", "near"), [(0.2, 5.6), (0.5, 9.3), (0.8, 13.5), (1e-4, 4.2)])
def test_a_pipe_that_discharges_fluid(ratio, near):
    """Speed and frequency of flutter of Paidoussis' figure, and to all digits as a root of the closed form."""
    pipe = model(FLOW, virtual_work=OUTLET)
    found = cra.critical_value(pipe.at({U: 0.0, beta: np.sqrt(ratio)}), U, between=(0, 15))
    assert found.kind == "flutter" and abs(found.value - near) < 0.05
    with mp.workdps(30):
        share = mp.sqrt(mpf(ratio))

        def both(speed, omega):
            value = outlet_determinant(speed, omega, share)
            return value.real, value.imag

        exact = mp.findroot(both, (mpf(found.value), mpf(found.angular_frequency)), verify=False)
    assert_allclose(found.value, float(exact[0]), rtol=1e-9)
    assert_allclose(found.angular_frequency, float(exact[1]), rtol=1e-7)


def test_a_pipe_between_two_hinges_buckles_whatever_flows():
    """U = pi for every share of fluid; gyroscopic forces do no work."""
    pipe = model(FLOW, [v.subs(x, 0), v.subs(x, 1)])
    found = cra.critical_value(pipe.at({U: 0.0, beta: np.sqrt([0.0, 0.3, 0.8])}), U, between=(0, 6))
    assert_allclose(found.value, np.pi, rtol=ACCURACY)
    assert (found.kind == "divergence").all()


def test_little_internal_damping_lowers_becks_load():
    """Ziegler's paradox: 10.94 in the limit of no Kelvin-Voigt damping (Bolotin and Zhinzher 1969), 20.05 without."""
    work = [*FOLLOWER, (-tau * v.diff(x, 2, t), v.diff(x, 2), "domain")]
    damped = model(virtual_work=work)
    found = cra.critical_value(damped.at({P: 0, tau: [1e-3, 1e-5]}), P, between=(0, 30))
    assert_allclose(found.value, 10.94, atol=0.01)
    little = damped.at({P: 0, tau: 1e-8}, tolerance=1e-4)  # the growth that decides is 1e-8 of P: near rounding
    assert_allclose(cra.critical_value(little, P, between=(0, 30)).value, 10.94, atol=0.01)
    # the root passes the imaginary axis there
    s = damped.eigenvalues({P: found.value[0] * (1 + np.array([-1e-4, 1e-4])), tau: 1e-3}, 2)
    assert s.real.max(axis=1)[0] < 0 < s.real.max(axis=1)[1]


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("Q", (0, 30)), "parameter = 'Q': must be one of P"),
        ((P, (0, 15)), "stable at all 65 values of P from 0 to 15"),
        ((P, (25, 30)), "already unstable at P = 25 .flutter at 10.6"),
        ((P, (30, 0)), "between = .30, 0.: must be two real numbers, the lower one first"),
        ((P, 30.0), "between = 30.0: must be two real numbers"),
        ((P, (0, np.inf)), "between"),
    ],
)
def test_what_is_refused(arguments, message):
    system = model(virtual_work=FOLLOWER).at({P: 0})
    with pytest.raises(ValueError, match=message):
        cra.critical_value(system, *arguments)
    with pytest.raises(ValueError, match="points = 1"):
        cra.critical_value(system, P, (0, 30), points=1)
    with pytest.raises(TypeError, match="system"):
        cra.critical_value(3.0, P, (0, 30))
