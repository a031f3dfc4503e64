"""The accuracy a user asks for: reached, told, or refused with the place; a long refinement shows on a terminal."""

from __future__ import annotations

import io
import pickle

import numpy as np
import pytest
import sympy as sp
from mpmath import mp, mpf
from scipy.optimize import brentq
from scipy.special import j0, y0

import cra_sym as cra
from cra_sym.model.routes import GeneralRoute

x, t = sp.symbols("x t")
a, c = sp.symbols("a c")
v = sp.Function("v")(x, t)


def model(density, essential=(0, 1), **options):
    conditions = [v.subs(x, end) for end in essential]
    return cra.Model(density, fields=[v], x=x, domain=(0, 1), t=t, essential=conditions, **options)


def string(tension, mass=1, **options):
    return model(mass * v.diff(t) ** 2 / 2 - tension * v.diff(x) ** 2 / 2, **options)


# a layer so steep that some rounds are needed, by exact values of a tolerance that asks for all digits
LAYER = string(1 + 100 * (1 + sp.tanh(a * (x - sp.Rational(37, 100)) * (1 + x / 9))))


@pytest.mark.parametrize("tolerance", [1e-3, 1e-6, 1e-10, 1e-12])
def test_what_is_asked_for_is_reached_and_told(tolerance):
    best = LAYER.at({a: [40.0, 300.0]}, tolerance=1e-13).natural_frequencies(4)
    system = LAYER.at({a: [40.0, 300.0]}, tolerance=tolerance)
    error = np.abs(system.natural_frequencies(4) / best - 1).max(axis=1)
    assert (error <= system.accuracy + 1e-13).all() and (system.accuracy <= tolerance).all()


def test_a_rough_answer_takes_less():
    """A tolerance of 1e-3 is met on a coarser basis than one of 1e-12."""
    sizes = []
    for tolerance in (1e-3, 1e-12):
        system = LAYER.at({a: 300.0}, tolerance=tolerance)
        route = system.numerics("route")
        columns = np.array([[300.0]])
        (found,) = route.found(columns, 3, tolerance, 0.2 * tolerance)
        sizes.append(found.fields.columns.size)
    assert sizes[0] < sizes[1]


def test_a_tolerance_is_part_of_a_system():
    system = LAYER.at({a: 40.0}, tolerance=1e-6)
    assert system.tolerance == 1e-6 and system != LAYER.at({a: 40.0})
    assert pickle.loads(pickle.dumps(system)) == system
    assert system.replace(a=50.0).tolerance == 1e-6 and system.replace(tolerance=1e-7).tolerance == 1e-7
    assert cra.Arm.nominal().tolerance == 1e-10
    for wrong in (0.0, 1.0, np.nan, -1e-10, 1e-15):
        with pytest.raises(ValueError, match=r"tolerance = .*must be real numbers in \[1e-13, 0.01\]"):
            LAYER.at({a: 1.0}, tolerance=wrong)
    with pytest.raises(ValueError, match="one number"):
        LAYER.at({a: 1.0}, tolerance=[1e-3, 1e-4])


# mass of the highest derivative ---------------------------------------------------------------------------------------


def love_rod(stiffness, lateral):
    """Love's rod: its lateral inertia moves with the strain."""
    return model((v.diff(t) ** 2 + lateral * v.diff(x, t) ** 2) / 2 - stiffness * v.diff(x) ** 2 / 2)


def test_a_rod_whose_lateral_inertia_jumps():
    """E u'' = -w^2 (u - l u''): sines of either side joined by (E - w^2 l) u'."""
    low, high = 0.01, 0.04
    rod = love_rod(1, sp.Piecewise((low, x < sp.Rational(2, 5)), (high, True)))
    assert isinstance(rod.numerics("route"), GeneralRoute)

    def joined(w):
        stiff = [1 - w**2 * inertia for inertia in (low, high)]
        k = [w / np.sqrt(s) for s in stiff]
        s1, c1, s2, c2 = np.sin(0.4 * k[0]), np.cos(0.4 * k[0]), np.sin(0.6 * k[1]), np.cos(0.6 * k[1])
        return stiff[0] * k[0] * c1 * s2 + stiff[1] * k[1] * c2 * s1

    exact = [brentq(joined, 2.0, 3.1, xtol=1e-15)]
    system = rod.at({})
    found = system.natural_frequencies(1)
    np.testing.assert_allclose(found, exact, rtol=1e-10)
    assert 0 < system.accuracy <= 1e-10


def test_frequencies_of_a_rod_end_where_its_lateral_inertia_outweighs_the_stiffness():
    """(s u')' + z u = 0 with s = 1 - z (1 + x) / 100 has Bessel functions of 200 sqrt(s / z); s(1) = 0 at z = 50.

    Roots of the condition of fixed ends below that are counted by its changes of sign.
    """
    rod = love_rod(1, (1 + x) / 100).at({})

    def fixed_ends(w):
        z, rate = w**2, w**2 / 100
        left, right = (2 * np.sqrt(z * (1 - rate * (1 + place))) / rate for place in (0, 1))
        return j0(left) * y0(right) - y0(left) * j0(right)

    w = np.linspace(0.1, 7.07, 4000)
    value = fixed_ends(w)
    roots = [brentq(fixed_ends, w[k], w[k + 1], xtol=1e-15) for k in np.nonzero(value[1:] * value[:-1] < 0)[0]]
    with pytest.raises(ValueError, match=rf"modes must be at most {len(roots)}$"):
        rod.natural_frequencies(21)
    np.testing.assert_allclose(rod.natural_frequencies(3), roots[:3], rtol=1e-10)


def test_the_estimate_of_such_a_rod_covers_the_error_of_its_short_waves():
    """With Bessel functions as above; the two meshes that are compared must differ for the shortest waves too."""
    rate = mpf(1) / 1000
    rod = love_rod(1, (1 + x) * sp.Rational(1, 1000)).at({})
    found = rod.natural_frequencies(2)

    def fixed_ends(w):
        z = mpf(w) ** 2
        left, right = (2 * mp.sqrt(z * (1 - rate * z * (1 + place))) / (rate * z) for place in (0, 1))
        return mp.besselj(0, left) * mp.bessely(0, right) - mp.bessely(0, left) * mp.besselj(0, right)

    roots = [float(mp.findroot(fixed_ends, (w * (1 - 1e-8), w * (1 + 1e-8)))) for w in found]
    error = np.abs(found / roots - 1)
    assert error.max() < rod.accuracy <= 1e-10


def test_frequencies_of_a_uniform_rod_with_lateral_inertia_accumulate():
    k = np.arange(1, 101) * np.pi
    uniform = love_rod(1, sp.Rational(1, 100)).at({})
    np.testing.assert_allclose(uniform.natural_frequencies(100), k / np.sqrt(1 + k**2 / 100), rtol=1e-11)
    with pytest.raises(ValueError, match="modes must be at most 318"):  # of z = k^2 / (1 + k^2 / 100) below 99.99
        uniform.natural_frequencies(400)


def test_a_rigid_body_motion_of_a_rod_with_lateral_inertia():
    sliding = model((v.diff(t) ** 2 + (1 + x) * v.diff(x, t) ** 2 / 100 - v.diff(x) ** 2) / 2, essential=())
    assert sliding.at({}).natural_frequencies(1) == 0.0


def test_a_general_problem_that_varies_too_fast_is_refused_with_place_and_figure():
    rod = love_rod(1, (2 + sp.sin(20000 * x + 10000 * x**2)) / 100)
    with pytest.raises(ValueError, match=r"vary too finely at x = .* to .* steps along x do not suffice"):
        rod.at({}).natural_frequencies(2)


# a terminal -----------------------------------------------------------------------------------------------------------


class _Terminal(io.StringIO):
    def isatty(self):
        return True


def test_refinement_shows_on_a_terminal_only(monkeypatch):
    for stream, shows in ((_Terminal(), True), (io.StringIO(), False)):
        monkeypatch.setattr("sys.stderr", stream)
        LAYER.at({a: 40.0}, tolerance=1e-12).natural_frequencies(3)
        assert ("refining along x" in stream.getvalue()) is shows
        if shows:
            assert "relative error" in stream.getvalue() and "elements" in stream.getvalue()
    quiet = _Terminal()
    monkeypatch.setattr("sys.stderr", quiet)
    string(1 + x).at({}).natural_frequencies(3)
    assert not quiet.getvalue()
