"""Negative energies are refused by name, on every route; energies that only look negative are not."""

from __future__ import annotations

import numpy as np
import pytest
import sympy as sp

import cra_sym as cra

x, t, L = sp.symbols("x t L")
v = sp.Function("v")(x, t)
w = sp.Function("w")(t)
EI, T, m, m_e, m_w, e, k, k_t = sp.symbols("EI T m m_e m_w e k k_t")
HALF = sp.Rational(1, 2)
INSIDE = HALF * m * v.diff(t) ** 2
BEAM, STRING = INSIDE - HALF * EI * v.diff(x, 2) ** 2, INSIDE - HALF * T * v.diff(x) ** 2
CLAMPED = (v.subs(x, 0), v.diff(x).subs(x, 0))
TIP = HALF * m_e * v.diff(t) ** 2
GIVEN = {"EI": 1.3, "T": 3.0, "m": 1.1, "m_e": 0.4, "m_w": 0.8, "e": 0.2, "k": 5.0, "k_t": 50.0, "L": 1.2}


def system(density, right=TIP, coordinates=(), essential=CLAMPED, **changed):
    model = cra.Model(
        density, fields=[v], x=x, domain=(0, L), t=t, right=right, coordinates=coordinates, essential=essential
    )
    return model.at({s.name: (GIVEN | changed)[s.name] for s in model.symbols})


@pytest.mark.parametrize(
    ("made", "words"),
    [
        (lambda: system(BEAM, m=-1.0), "m = -1: the kinetic energy of a section is negative; it must be at least 0"),
        (lambda: system(BEAM, EI=-1.0), "EI = -1: the strain energy of a section is negative; it must be at least 0"),
        (lambda: system(BEAM, EI=[1.0, -2.0]), "EI = -2: the strain energy of a section"),
        (lambda: system(STRING, essential=CLAMPED[:1], T=-1.0), "T = -1: the strain energy of a section"),
        (lambda: system(BEAM, m_e=-0.1), "m_e = -0.1: the kinetic energy of the right end is negative"),
        (lambda: system(BEAM, m_e=[0.1, -0.2]), "m_e = -0.2: the kinetic energy of the right end"),
        (lambda: system(STRING, essential=CLAMPED[:1], m_e=-0.1), "m_e = -0.1: the kinetic energy of the right end"),
        (lambda: system(BEAM + INSIDE * x, m_e=-0.1), "m_e = -0.1: the kinetic energy of the right end"),
        (lambda: system(BEAM - 2 * INSIDE * x), "m = 1.1: the kinetic energy of the section at x = 0.515"),
        (
            lambda: system(BEAM, HALF * m_w * w.diff(t) ** 2 - HALF * k * (v - w) ** 2, [w], m_w=-0.5),
            "m_w = -0.5: the kinetic energy of the lumped coordinates",
        ),
        (
            lambda: system(BEAM, TIP - HALF * m_w * v.diff(x, t) ** 2 * e),
            r"e = 0.2, m_e = 0.4, m_w = 0.8: the kinetic energy of the right end",
        ),
    ],
)  # fmt: skip
def test_negative_energy_is_refused_by_name(made, words):
    with pytest.raises(ValueError, match=words):
        made().natural_frequencies(2)


def test_analyses_refuse_it_too():
    for call in (cra.eigenvalues, cra.modal_parameters, cra.sensitivities):
        with pytest.raises(ValueError, match=r"m_e = -0.1: the kinetic energy of the right end"):
            call(system(BEAM, m_e=-0.1))


def test_compression_is_not_negative_bending():
    """The load enters below the highest derivative: a column buckles at Euler's load, not before."""
    euler = np.pi**2 * 1.3 / (4 * 1.2**2)
    pressed = BEAM - HALF * T * v.diff(x) ** 2
    assert (system(pressed, right=0, T=-0.999 * euler).natural_frequencies(2) > 0).all()
    with pytest.raises(ValueError, match="has buckled"):
        system(pressed, right=0, T=-1.001 * euler).natural_frequencies(2)


def test_a_negative_offset_is_not_a_negative_mass():
    """The same mass on the other side of the end section, whose energy is a square too."""
    offset = HALF * m_e * (v.diff(t) + e * v.diff(x, t)) ** 2
    found, outward = (system(BEAM, offset, e=value).natural_frequencies(3) for value in (-0.2, 0.2))
    assert (found > outward).all()  # further out it is moved more by the lowest modes


def test_a_mass_may_be_a_difference_of_parameters():
    less = HALF * (m_e - m_w) * v.diff(t) ** 2
    np.testing.assert_allclose(
        system(BEAM, less, m_e=1.0).natural_frequencies(3), system(BEAM, m_e=0.2).natural_frequencies(3), rtol=1e-12
    )
