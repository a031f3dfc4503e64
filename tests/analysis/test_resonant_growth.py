"""Forced resonances of complex modes: residues of frequency responses, an integrator, and a matrix by hand."""

from __future__ import annotations

import numpy as np
import pytest
import sympy as sp
from scipy.integrate import solve_ivp
from scipy.linalg import eig

import cra_sym as cra
from tests.systems import BENT, VALUES, _model, k, length, m, t, v, w, x
from tests.systems import system as named

g, d = sp.symbols("g d")
p, q = (sp.Function(name)(t) for name in "pq")
BASE = cra.TransverseBase(1.0)
DISC = {"right": m * (v + w).diff(t) ** 2 / 2}
TURNING = _model(BENT + g * v.diff(t) * v.diff(x), **DISC)
RUNNING = _model(
    m * ((v + w).diff(t) + g * v.diff(x)) ** 2 / 2 - 20 * v.diff(x) ** 2 / 2, left=-25 * v**2, right=-25 * v**2
)
MASSES = cra.Model(  # two masses on springs in a frame that turns, on a base that moves one of them
    sp.S.Zero, fields=(), coordinates=[p, q], prescribed=[w], x=x, domain=(0, 1), t=t,
    left=m * ((p + w).diff(t) ** 2 + q.diff(t) ** 2) / 2 + m * g * (p * q.diff(t) - q * p.diff(t))
    - k * (p**2 + 2 * q**2 - p * q) / 2,
    virtual_work=[(-d * p.diff(t), p, None)],
)  # fmt: skip
SET = {"m": 0.3, "k": 5.0, "g": 0.4, "d": 0.0}


def residue(system, omega, kind):
    """Return the residue of the response to a displacement of the base at i omega, by central differences."""

    def amplitude(at):
        found = cra.frequency_response(system, at, drive="w")
        return found if kind == "support" else -(at**2) * found

    steps = omega * 2.0 ** -np.arange(9, 13)
    table = 0.5j * steps * np.array([amplitude(omega + h) - amplitude(omega - h) for h in steps])
    for order in (4, 16, 64):  # the errors are even in the step
        table = (order * table[1:] - table[:-1]) / (order - 1)
    return abs(table[0])


@pytest.mark.parametrize(
    ("system", "kind"),
    [(TURNING.at(VALUES | {"g": 0.2}), "motion"), (RUNNING.at({"l": 1.2, "m": 0.3, "g": 3.0}), "support"),
     (named("shaft", U=900.0), "motion")], ids=["turning", "running", "shaft"],
)  # fmt: skip
def test_the_growth_is_the_residue_of_the_frequency_response(system, kind):
    s, found = cra.eigenvalues(system, 2), cra.forced_width(system, BASE, 2)
    for value, growth in zip(s, found, strict=True):
        assert growth == pytest.approx(residue(system, value.imag, kind), rel=1e-8)  # the differences lose digits


def test_an_integrator_sees_the_tip_grow():
    system = MASSES.at(SET)
    s, found = cra.eigenvalues(system, 2).imag, cra.forced_width(system, BASE, 2)
    mass, stiffness, turn = SET["m"], SET["k"] * np.array([[1.0, -0.5], [-0.5, 2.0]]), 2 * SET["m"] * SET["g"]
    times = np.linspace(0.0, 30.0, 301)
    for omega, growth in zip(s, found, strict=True):

        def rate(time, y, omega=omega):
            force = -stiffness @ y[:2] + turn * np.array([y[3], -y[2]])
            return [*y[2:], force[0] / mass + omega**2 * np.sin(omega * time), force[1] / mass]

        moved = solve_ivp(rate, (0.0, 30.0), [0.0, 0.0, -omega, 0.0], "DOP853", times, rtol=1e-12, atol=1e-12).y[0]
        waves = [wave(one * times) for one in s for wave in (np.cos, np.sin)]
        growing = [times * np.cos(omega * times), times * np.sin(omega * times)]
        shares, *_ = np.linalg.lstsq(np.transpose([*growing, *waves]), moved, rcond=None)
        assert growth == pytest.approx(np.hypot(*shares[:2]), rel=1e-9)


def test_dampers_count_and_a_batch_is_its_members():
    """Right and left vectors of the matrix of the masses; the shape of a batch is that of the amplitudes too."""
    dampers = np.array([0.0, 0.05, 0.1])
    found = cra.forced_width(MASSES.at(SET | {"d": dampers}), cra.TransverseBase([[1.0], [2.0]]), 2)
    assert found.shape == (2, 3, 2)
    np.testing.assert_allclose(found[1], 2 * found[0], rtol=1e-14)
    for damper, growth in zip(dampers, found[0], strict=True):
        mass, turn = SET["m"], 2 * SET["g"]
        stiffness = SET["k"] / mass * np.array([[1.0, -0.5], [-0.5, 2.0]])
        friction = np.array([[damper / mass, -turn], [turn, 0.0]])
        matrix = np.block([[np.zeros((2, 2)), np.eye(2)], [-stiffness, -friction]])
        values, left, right = eig(matrix, left=True)
        for s, one in zip(cra.eigenvalues(MASSES.at(SET | {"d": damper}), 2), growth, strict=True):
            mode = np.abs(values - s).argmin()
            share = right[0, mode] * left[2, mode].conj() / (left[:, mode].conj() @ right[:, mode])
            assert one == pytest.approx(abs(share) * s.imag**2, rel=1e-11)


def test_without_gyroscopic_terms_it_is_that_of_natural_modes():
    natural, complex_ = _model(BENT, **DISC).at(VALUES), TURNING.at(VALUES | {"g": 0.0})
    np.testing.assert_allclose(cra.forced_width(complex_, BASE), cra.forced_width(natural, BASE), rtol=1e-8)
    assert np.isnan(cra.forced_width(named("shaft", U=0.0), BASE, 1)).all()  # the same in both planes
    # a base on a spring is the same as the spring's force on the base
    ground = _model(
        VALUES["rhoA"] * v.diff(t) ** 2 / 2 - VALUES["EI"] * v.diff(x, 2) ** 2 / 2,
        left=-k * (v - w) ** 2 / 2 - k * v.diff(x) ** 2 / 2,
    ).at({"k": 800.0, "l": 1.2})
    seen = _model(BENT).at({key: VALUES[key] for key in ("k", "l", "rhoA", "EI")})
    np.testing.assert_allclose(cra.forced_width(ground, BASE), cra.forced_width(seen, BASE), rtol=1e-8)
    assert np.isnan(cra.forced_width(named("two planes", c=5.0, a=0.0), BASE, 1)).all()
    # two free masses on a spring, one of which is pulled: the rigid-body mode does not grow
    pulled = cra.Model(
        sp.S.Zero, fields=(), coordinates=[p, q], prescribed=[w], x=x, domain=(0, 1), t=t,
        left=m * (p.diff(t) ** 2 + q.diff(t) ** 2) / 2 - k * (p - q) ** 2 / 2 + g * w.diff(t) * q,
    ).at({"m": 1.0, "k": 2.0, "g": 3.0})  # fmt: skip
    # of p = -q, of which the force 3 omega on q moves half
    np.testing.assert_allclose(cra.forced_width(pulled, BASE, 2), [0.0, 3.0 / 2 / 2], rtol=1e-8)


def test_what_does_not_grow_is_refused():
    with pytest.raises(ValueError, match=r"mode 1 decays by more than 0\.1 of its frequency, .*use frequency_response"):
        cra.forced_width(MASSES.at(SET | {"d": 0.5}), BASE, 2)
    with pytest.raises(ValueError, match="mode 1 grows by itself, so that no resonance shows; see eigenvalues"):
        cra.forced_width(MASSES.at(SET | {"d": -0.01}), BASE, 1)
    follows = sp.Symbol("P")
    column = cra.Model(
        (v + w).diff(t) ** 2 / 2 - v.diff(x, 2) ** 2 / 2 + follows * v.diff(x) ** 2 / 2, fields=[v], prescribed=[w],
        x=x, domain=(0, length), t=t, essential=[v.subs(x, 0), v.diff(x).subs(x, 0)],
        virtual_work=[(-follows * v.diff(x), v, "right")],
    )  # fmt: skip
    assert cra.forced_width(column.at({"P": 10.0, "l": 1.0}), BASE, 2).min() > 0
    with pytest.raises(ValueError, match="mode 1 grows by itself"):
        cra.forced_width(column.at({"P": 30.0, "l": 1.0}), BASE, 2)
