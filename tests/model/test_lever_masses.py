"""A heavy mass on a lever arm at the end of a beam in bending and torsion: the digits of lighter masses are kept."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
import sympy as sp
from mpmath import mp, mpf

import cra_sym as cra

x, t, L = sp.Symbol("x"), sp.Symbol("t"), sp.Symbol("L")
v, phi = sp.Function("v")(x, t), sp.Function("phi")(x, t)
EI, GJ, rho, J, c, k_t, k_r, k_p = sp.symbols("EI GJ rho J c k_t k_r k_p")
m, e, y, J_b, J_t, taper = sp.symbols("m e y J_b J_t taper")
HALF = sp.Rational(1, 2)
SPAN = HALF * (rho * (v.diff(t) + c * phi.diff(t)) ** 2 + J * phi.diff(t) ** 2 - GJ * phi.diff(x) ** 2)
ROOT = -HALF * (k_t * v**2 + k_r * v.diff(x) ** 2 + k_p * phi**2)
TIP = HALF * (J_b * v.diff(x, t) ** 2 + J_t * phi.diff(t) ** 2)
ARM = v + e * v.diff(x) + y * phi  # displacement of the mass
VALUES = {"EI": 1.0, "GJ": 0.6, "rho": 1.0, "J": 0.02, "c": 0.1, "L": 1.0, "e": 0.5, "y": 0.4,
          "J_b": 0.1, "J_t": 0.2, "k_t": 10.0, "k_r": 20.0, "k_p": 30.0}  # fmt: skip
STIFF, HEAVY = ("EI", "GJ", "k_t", "k_r", "k_p"), ("rho", "J", "m", "J_b", "J_t")


@cache
def model(kind: str = "lever") -> cra.Model:
    right = TIP + (0 if kind == "held" else HALF * m * ARM.diff(t) ** 2)
    bending = EI * (1 + taper * x) if kind == "tapered" else EI
    return cra.Model(
        SPAN - HALF * bending * v.diff(x, 2) ** 2, fields=[v, phi], x=x, domain=(0, L), t=t, left=ROOT, right=right,
        essential=[ARM.subs(x, L)] if kind == "held" else [],
    )  # fmt: skip


def drawn(number: int) -> dict[str, float]:
    """Return values with a mass of 1e-8 to 1e12 times that of the span and any lever arm."""
    rng = np.random.default_rng([23, number])
    found = VALUES | {"m": 10.0 ** rng.uniform(-8, 12), "e": rng.uniform(-1, 1) * 10.0 ** rng.uniform(-2, 1)}
    found |= {"y": rng.uniform(-1, 1), "c": rng.choice([0.0, 0.1, -0.3])}
    found |= {name: 10.0 ** rng.uniform(-4, 1) for name in ("J_b", "J_t")}
    return found | {name: rng.choice([np.inf, 10.0 ** rng.uniform(-2, 4)]) for name in ("k_t", "k_r", "k_p")}


def root(values: dict[str, float], near: float) -> mpf:
    """Return the frequency next to one, from the exponential of the state matrix in 40 digits beyond what cancels."""
    given = {name: mpf(float(value)) for name, value in values.items()}
    masses, arm = (0, given["J_b"], given["J_t"]), (1, given["e"], given["y"])
    state, start = mp.zeros(6), mp.zeros(6, 3)  # v, v', phi, -(EI v'')', EI v'', GJ phi'
    state[0, 1], state[4, 3], state[1, 4], state[2, 5] = 1, -1, 1 / given["EI"], 1 / given["GJ"]
    for i, name in enumerate(("k_t", "k_r", "k_p")):
        start[i, i], start[3 + i, i] = (0, 1) if mp.isinf(given[name]) else (1, given[name])

    def determinant(omega: mpf) -> mpf:
        z, off = omega**2, given["rho"] * given["c"]
        state[3, 0], state[3, 2] = -z * given["rho"], -z * off
        state[5, 0], state[5, 2] = -z * off, -z * (off * given["c"] + given["J"])
        end = mp.expm(state * given["L"]) * start
        found = mp.zeros(3)
        for j in range(3):
            moved = sum(arm[i] * end[i, j] for i in range(3))
            for i in range(3):
                found[i, j] = end[3 + i, j] - z * (given["m"] * arm[i] * moved + masses[i] * end[i, j])
        return mp.det(found)

    omega, step = 2 * mp.pi * mpf(near), mpf(10) ** -9
    return mp.findroot(determinant, (omega * (1 - step), omega * (1 + step)), verify=False) / (2 * mp.pi)


@pytest.mark.sample(12, 23)
@pytest.mark.parametrize("number", range(300))
def test_any_mass_on_any_arm(number):
    """The error of a root of the determinant: some roundings of its terms, 1e-14 at most in thousands of beams."""
    values = drawn(number)
    found = cra.natural_frequencies(model().at(values), 4)
    with mp.workdps(60):  # 20 digits cancel at a mass of 1e12
        for frequency in found:
            exact = root(values, frequency)
            assert abs(frequency - exact) <= 1e-14 * exact, values


def test_an_immovable_mass_holds_its_point():
    """All modes but the first are those of the beam whose point is held, to span mass over end mass."""
    heavy, held = model().at({**VALUES, "m": 1e14}), model("held").at(VALUES)
    np.testing.assert_allclose(cra.natural_frequencies(heavy, 6)[1:], cra.natural_frequencies(held, 5), rtol=1e-12)
    stations = np.linspace(0.0, 1.0, 7)
    for field in (v, phi):
        shapes, expected = (cra.mode_shapes(one, stations, n, field=field) for one, n in ((heavy, 6), (held, 5)))
        np.testing.assert_allclose(shapes[1:], expected, atol=1e-12 * np.abs(expected).max())


@pytest.mark.parametrize("mass", [0.0, 1.0, 1e8, 1e12])
def test_sensitivities(mass):
    """Frequencies scale with the root of all stiffnesses, and with the inverse root of all masses."""
    log = cra.sensitivities(model().at({**VALUES, "m": mass}), 4).log
    np.testing.assert_allclose(sum(log[name] for name in STIFF), 0.5, rtol=1e-13)
    np.testing.assert_allclose(sum(log[name] for name in HEAVY), -0.5, rtol=1e-13)


@pytest.mark.parametrize("mass", [0.0, 1.0, 1e3])
def test_two_masses_on_opposite_arms(mass):
    """Two halves of a mass at -e and e are a mass at the end with the inertia m e^2, also where both are 0."""
    arms = (v + e * v.diff(x), v - e * v.diff(x))
    pair = model().replace(
        right=TIP + sum(HALF * part * arm.diff(t) ** 2 for part, arm in zip((m, y), arms, strict=True))
    )
    found = cra.natural_frequencies(pair.at({**VALUES, "m": mass / 2, "y": mass / 2}), 4)
    whole = {**VALUES, "m": mass, "e": 0.0, "y": 0.0, "J_b": VALUES["J_b"] + mass * VALUES["e"] ** 2}
    np.testing.assert_allclose(found, cra.natural_frequencies(model().at(whole), 4), rtol=1e-13)


@pytest.mark.parametrize("mass", [1e2, 1e4])
def test_accuracy_covers_the_rounding_of_end_masses(mass):
    """Along x the mass matrix of the ends is added up: the estimate holds, the closed form of no taper is exact."""
    system = model("tapered").at({**VALUES, "m": mass, "taper": 0.0})
    found, exact = (cra.natural_frequencies(one, 4) for one in (system, model().at({**VALUES, "m": mass})))
    assert np.abs(found / exact - 1.0).max() <= system.accuracy


def test_too_heavy_a_mass_is_refused():
    with pytest.raises(ValueError, match="heavy mass on a lever arm"):
        cra.natural_frequencies(model("tapered").at({**VALUES, "m": 1e7, "taper": 0.0}), 4)
