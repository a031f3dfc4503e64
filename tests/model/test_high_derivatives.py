"""Densities with third and higher derivatives by x, and motions that potential energy alone holds: by polynomials."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
import sympy as sp
from mpmath import mp, mpf

import cra_sym as cra

x, t, a = sp.symbols("x t a")
v = sp.Function("v")(x, t)


def model(density, **options):
    return cra.Model(density, fields=[v], x=x, domain=(0, 1), t=t, **options)


def ritz_in_polynomials(inside, ends, held, tip=0.0, size=22):
    """Return all natural frequencies in 60 digits from the powers of x; those of unstable motions are imaginary.

    With a damper at the right end the eigenvalues with it.

    Twice the energies have the terms (kind, orders of two derivatives, coefficients of a polynomial) inside, and
    (kind, order, place, value) at the ends.
    """
    with mp.workdps(60):
        forms = {"stiffness": mp.zeros(size), "mass": mp.zeros(size)}
        for kind, a, b, coefficients in inside:
            for i, j in itertools.product(range(a, size), range(b, size)):
                integral = mp.fsum(mpf(c) / (i + j - a - b + p + 1) for p, c in enumerate(coefficients))
                forms[kind][i, j] += mp.ff(i, a) * mp.ff(j, b) * integral

        def row(order, place):
            return mp.matrix([[mp.ff(k, order) * mpf(place) ** max(k - order, 0) for k in range(size)]])

        for kind, order, place, value in ends:
            forms[kind] += mpf(value) * row(order, place).T * row(order, place)
        if held:
            conditions = mp.matrix([list(row(order, place)) for place, order in held])
            free = mp.qr(conditions.T)[0][:, len(held) :]
            forms = {kind: free.T * form * free for kind, form in forms.items()}
        inverse = mp.cholesky(forms["mass"]) ** -1
        squares, modes = mp.eigsy(inverse * forms["stiffness"] * inverse.T)
        order = sorted(range(len(squares)), key=lambda k: squares[k])
        omega = np.array([complex(mp.sqrt(squares[k])) for k in order])
        if not tip:
            return omega
        reached = row(0, 1) * (free if held else mp.eye(size)) * inverse.T * modes
        pull = np.sqrt(tip) * np.array([float(reached[k]) for k in order])
    # motions (omega q, q') of the modes
    swing = np.diag(omega.real)
    first = np.block([[0 * swing, swing], [-swing, -np.outer(pull, pull)]])
    found = np.linalg.eigvals(first)
    return found[found.imag > 0][np.argsort(np.abs(found[found.imag > 0]))]


MASS = ("mass", 0, 0, [1])


@pytest.mark.parametrize(
    ("order", "held", "more", "ends"),
    [
        (3, [(0, 0), (0, 1)], [(2, 2, [5])], []),
        (3, [], [(2, 2, [0, 1])], []),
        (3, [], [], [("mass", 1, 1, 0.3), ("mass", 2, 0, 0.1)]),
        (3, [(1, 0)], [(3, 1, [0, 0.4])], [("stiffness", 2, 0, 7), ("stiffness", 1, 1, 5)]),
        (4, [(0, 0), (1, 2)], [(1, 1, [3])], [("stiffness", 3, 1, 1e3)]),
    ],
)
def test_high_derivatives_that_vary_against_polynomials(order, held, more, ends):
    """Strain-gradient rods and beams with held, loose and free ends; rigid-body motions are exactly at rest."""
    inside = [MASS, ("stiffness", order, order, [1, 1])]
    density = v.diff(t) ** 2 / 2 - (1 + x) * v.diff(x, order) ** 2 / 2
    for a, b, coefficients in more:
        inside += [("stiffness", *pair, coefficients) for pair in {(a, b), (b, a)}]
        share = 1 if a != b else sp.S.Half
        density -= share * sum(c * x**p for p, c in enumerate(coefficients)) * v.diff(x, a) * v.diff(x, b)
    energies = [0, 0]
    for kind, power, place, value in ends:
        moved = v.diff(x, power)
        energies[place] += value * (moved.diff(t) ** 2 if kind == "mass" else -(moved**2)) / 2
    conditions = [v.diff(x, power).subs(x, place) for place, power in held]
    rod = model(density, essential=conditions, left=energies[0], right=energies[1])
    exact = ritz_in_polynomials(inside, ends, held)[:4].real
    system = rod.at({})
    found = system.natural_frequencies(4)
    still = exact < 1e-12 * exact[-1]
    assert (found[still] == 0.0).all() and system.accuracy <= 1e-10
    # rounding errors, and what 22 powers of x leave of the last of these modes, some 1e-13
    np.testing.assert_allclose(found[~still], exact[~still], rtol=float(system.accuracy) + 2e-13)


def test_what_a_foundation_alone_holds_under_a_load():
    """A loose column on a foundation, and one whose coupling of strain and displacement makes it unstable."""
    column = model((v.diff(t) ** 2 - (1 + x) * v.diff(x, 2) ** 2 - 50 * v**2 + a * v.diff(x) ** 2) / 2)
    inside = [MASS, ("stiffness", 2, 2, [1, 1]), ("stiffness", 0, 0, [50]), ("stiffness", 1, 1, [-1])]
    exact = ritz_in_polynomials(inside, [], [])[:4].real
    np.testing.assert_allclose(column.at({a: 1.0}).natural_frequencies(4), exact, rtol=1e-12)
    assert (ritz_in_polynomials([*inside[:3], ("stiffness", 1, 1, [-5])], [], [])[:2].imag > 0).tolist() == [
        True,
        False,
    ]
    with pytest.raises(ValueError, match="buckled: 1 unstable mode"):
        column.at({a: 5.0}).natural_frequencies(1)
    coupled = model((v.diff(t) ** 2 - (1 + x) * v.diff(x, 2) ** 2) / 2 - x**2 * v.diff(x, 2) * v)
    inside = [MASS, ("stiffness", 2, 2, [1, 1]), ("stiffness", 2, 0, [0, 0, 1]), ("stiffness", 0, 2, [0, 0, 1])]
    number = (ritz_in_polynomials(inside, [], []).imag > 1e-20).sum()
    with pytest.raises(ValueError, match=f"buckled: {number} unstable mode"):
        coupled.at({}).natural_frequencies(1)


def test_a_damped_strain_gradient_beam():
    """Eigenvalues on the basis of stresses, constant along x or not: the exact problem loses its digits there."""
    held = [(0, 0), (0, 1)]
    density = (v.diff(t) ** 2 - (1 + a * x) * v.diff(x, 3) ** 2 - v.diff(x, 2) ** 2) / 2
    beam = model(
        density, essential=[v.diff(x, k).subs(x, 0) for k in (0, 1)], virtual_work=[(-0.3 * v.diff(t), v, "right")]
    )
    for taper in (0.0, 0.5):
        inside = [MASS, ("stiffness", 3, 3, [1, taper]), ("stiffness", 2, 2, [1])]
        system = beam.at({a: taper})
        exact = ritz_in_polynomials(inside, [], held, tip=0.3)
        # rounding of the reference: eps times its largest frequency, some 1e6
        np.testing.assert_allclose(cra.eigenvalues(system, 3), exact[:3], rtol=1e-9)
