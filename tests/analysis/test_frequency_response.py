"""Exact frequency responses against modal series, steady states in time, statics, and the field equation."""

import numpy as np
import pytest
import sympy as sp

import cra_sym as cra
from cra_sym import Arm, BaseMotion
from cra_sym.symbols import L, t, v, x

OMEGA = np.array([0.01, 1.0, 5.0, 15.2, 30.0, 96.0, 150.0, 300.0, 2000.0])
JOINTS = [{}, {"k_t": 1e3, "k_r": 50.0}, {"k_t": 1e3, "k_r": 0.0, "J_e": 1e-3}, {"k_t": 50.0}]


def series(arm, omega, x, modes, damping):
    """Return the sum over modes."""
    p, shapes = cra.modal_parameters(arm, modes), cra.mode_shapes(arm, x, modes)
    omega = omega[:, None]
    if damping == "modal":
        stiffness = p.omega**2 + 2j * arm.zeta * p.omega * omega
    else:
        stiffness = p.omega**2 * (1 + 2j * arm.zeta)
    return ((-p.participation / (stiffness - omega**2)) @ shapes).T


@pytest.mark.parametrize("joint", JOINTS)
@pytest.mark.parametrize("zeta", [0.0, 0.01, 0.4])
@pytest.mark.parametrize("damping", ["modal", "structural"])
def test_the_modal_series_converges_to_it(joint, zeta, damping):
    arm = Arm.nominal().replace(zeta=zeta, **joint)
    places = [0.2, 1.0]
    exact = cra.frequency_response(arm, OMEGA, places, damping=damping)
    gaps = [np.abs(series(arm, OMEGA, places, modes, damping) / exact - 1).max() for modes in (3, 12, 48, 200)]
    assert gaps[0] > gaps[1] > gaps[2]
    # the rest of the sum falls like modes^-5, 4e-9 here; a rigid mode leaves 1e-8 of damping in the other
    assert gaps[3] < 1e-8


def test_truncation_costs_most_at_the_root_of_a_stiff_joint():
    arm = Arm.nominal().replace(k_t=1e5, zeta=0.01)
    exact = cra.frequency_response(arm, 5.0, [0.0, 1.0])
    cost = np.abs(series(arm, np.array([5.0]), [0.0, 1.0], 5, "modal")[:, 0] / exact - 1)
    assert cost[0] > 0.05 > 1e-3 > cost[1]


def test_it_is_the_steady_state_of_the_time_response():
    arm, rate = Arm.nominal().replace(k_t=1e3, k_r=50.0, zeta=0.1), 12.0
    t = 60.0 + np.linspace(0, 0.5, 11)
    motion = BaseMotion(amplitude=1e-3, angular_frequency=rate)
    found = cra.tip_response(arm, motion, t, modes=40)
    complex_amplitude = cra.frequency_response(arm, rate) * (-1e-3 * rate**2)
    assert found == pytest.approx((complex_amplitude * np.exp(1j * rate * t)).imag, rel=1e-9, abs=1e-12)


def test_both_dampings_agree_at_a_resonance_and_differ_at_rest():
    arm = Arm.nominal().replace(zeta=0.005)
    resonance = cra.modal_parameters(arm, 1).omega[0]
    peak, low = (
        cra.frequency_response(arm, rate) / cra.frequency_response(arm, rate, damping="structural")
        for rate in (resonance, 0.0)
    )
    assert abs(peak - 1) < 1e-3
    assert low == pytest.approx(1 + 0.01j)


def test_statics_and_limits():
    arm = Arm.nominal().replace(k_t=1e3, k_r=50.0, J_e=1e-3)
    root = -(arm.rhoA * arm.L + arm.m_e) / arm.k_t
    turn = (arm.rhoA * arm.L**2 / 2 + arm.m_e * arm.L) / arm.k_r
    tip = root - turn * arm.L - (arm.rhoA * arm.L**4 / 8 + arm.m_e * arm.L**3 / 3) / arm.EI
    assert cra.frequency_response(arm, 0.0, [0.0, 1.0]) == pytest.approx([root, tip], rel=1e-12)
    assert cra.frequency_response(arm.replace(zeta=0.05), [0.0, 5.0])[0] == pytest.approx(tip, rel=1e-12)
    stiff = cra.frequency_response(arm.replace(k_t=1e14, k_r=1e14), OMEGA)
    assert stiff == pytest.approx(cra.frequency_response(arm.replace(k_t=np.inf, k_r=np.inf), OMEGA), rel=1e-7)
    loose = arm.replace(k_t=0.0, k_r=0.0, zeta=0.02)
    assert cra.frequency_response(loose, OMEGA[1:], 0.4) == pytest.approx(1 / OMEGA[1:] ** 2, rel=1e-8)


def test_power_series_and_exponentials_meet():
    arm = Arm.nominal().replace(k_t=1e3, k_r=50.0)
    seam = 4.0 * arm.angular_frequency_scale  # lambda = 2
    below, above = cra.frequency_response(arm, [seam * (1 - 1e-9), seam * (1 + 1e-9)], [0.0, 0.5, 1.0]).T
    assert above == pytest.approx(below, rel=1e-7)
    extreme = cra.frequency_response(arm, [1e5, 1e8], [0.0, 1.0])
    assert np.isfinite(extreme).all()


def test_driven_by_a_force_it_is_the_receptance_of_a_cantilever():
    """Bishop and Johnson: (sin cosh - cos sinh) / (EI beta^3 (1 + cos cosh)) at the tip of a bare rigid arm."""
    arm = Arm.nominal().replace(m_e=0.0)
    lam = np.array([0.3, 1.0, 3.0, 12.0])
    found = cra.frequency_response(arm, lam**2 * arm.angular_frequency_scale, drive=v.subs(x, L))
    s, c, S, C = np.sin(lam), np.cos(lam), np.sinh(lam), np.cosh(lam)
    exact = (s * C - c * S) / (lam**3 * (1 + c * C)) * arm.L**3 / arm.EI
    np.testing.assert_allclose(found, exact, rtol=1e-9)  # the stiffness loses its condition, some 1e4, at lambda = 0.3


def test_batches_broadcast_and_single_values_drop_axes():
    arms = Arm.nominal().replace(k_t=np.array([[1e3], [np.inf]]), L=[0.8, 1.0], zeta=[0.0, 0.02])
    whole = cra.frequency_response(arms, OMEGA, [0.0, 0.4])
    assert whole.shape == (2, 2, 2, OMEGA.size)
    assert cra.frequency_response(arms, OMEGA).shape == (2, 2, OMEGA.size)
    assert cra.frequency_response(arms, 3.0).shape == (2, 2)
    one = cra.frequency_response(Arm.nominal().replace(k_t=1e3, L=0.8), OMEGA, 0.4)
    assert whole[0, 0, 1] == pytest.approx(one, rel=1e-12)


@pytest.mark.parametrize(
    ("arguments", "error", "words"),
    [
        ({"angular_frequency": -1.0}, ValueError, "angular_frequency = -1"),
        ({"angular_frequency": [[1.0]]}, ValueError, "angular_frequency has shape"),
        ({"x": 2.0}, ValueError, "x = 2"),
        ({"damping": "viscous"}, ValueError, "damping = 'viscous'"),
        ({"system": 3}, TypeError, "system = 3"),
    ],
)
def test_bad_input_is_named(arguments, error, words):
    with pytest.raises(error, match=words):
        cra.frequency_response(**({"system": Arm.nominal(), "angular_frequency": 1.0} | arguments))


POINT, SPREAD = (sp.Function(name)(t) for name in ("point", "spread"))
mass, tension = sp.symbols("mass tension")
STRING = mass * v.diff(t) ** 2 / 2 - tension * v.diff(x) ** 2 / 2
HELD = {"fields": [v], "x": x, "domain": (0, L), "t": t, "essential": [v.subs(x, 0), v.subs(x, L)]}


@pytest.mark.parametrize("zeta", [0.0, 0.02])
def test_forces_along_the_span_are_those_of_the_modal_series(zeta):
    """As a term of the Lagrangian and as virtual work, spread over the span; only odd modes of a string answer."""
    values, grid = ({"mass": 1.0, "tension": 4.0, "L": 1.5}, zeta), np.array([0.0, 1.0, 3.0, 9.0])
    number = np.arange(1, 4001, 2)
    omega = number * np.pi / 1.5 * 2.0
    driven = 4 / (number * np.pi) * np.sin(number * np.pi * 0.4 / 1.5)  # load times shape over the modal mass
    gap = omega**2 + 2j * zeta * omega * grid[:, None] - grid[:, None] ** 2
    exact = (driven / gap).sum(axis=-1)  # what is left out falls with the square of the number: 1e-11 of it
    for model in (
        cra.Model(STRING + SPREAD * v, **HELD),
        cra.Model(STRING, **HELD, virtual_work=[(SPREAD, v, "domain")]),
    ):
        found = cra.frequency_response(model.at(*values), grid, 0.4, drive=SPREAD)
        np.testing.assert_allclose(found, exact, rtol=1e-8)


def test_a_force_at_an_interior_place_is_reciprocal_and_static():
    arm = Arm.nominal().replace(k_t=1e3, k_r=50.0, zeta=0.01)
    there = cra.frequency_response(arm, OMEGA[:-1], 1.0, drive=v.subs(x, L / 2))
    back = cra.frequency_response(arm, OMEGA[:-1], 0.5, drive=v.subs(x, L))
    np.testing.assert_allclose(there, back, rtol=1e-6)  # modal damping where the problem varies along x: 1e-6
    string = cra.Model(STRING, **HELD).at({"mass": 1.0, "tension": 4.0, "L": 1.5})
    found = cra.frequency_response(string, 3.0, [0.2, 0.7, 1.3], drive=v.subs(x, 0.7))
    wave = 3.0 / 2.0  # the closed form of a string that a force parts
    near, far = np.sin(wave * np.array([0.2, 0.7, 0.7])), np.sin(wave * np.array([0.8, 0.8, 0.2]))
    np.testing.assert_allclose(found, near * far / (4.0 * wave * np.sin(wave * 1.5)), rtol=1e-9)
    named = cra.Model(STRING, **HELD, inside=[(sp.Symbol("a"), POINT * v)])
    system = named.at({"mass": 1.0, "tension": 4.0, "L": 1.5, "a": 0.7})
    np.testing.assert_allclose(cra.frequency_response(system, 3.0, 0.2, drive="point"), found[0], rtol=1e-9)


@pytest.mark.parametrize(
    ("drive", "kind", "words"),
    [
        (v.subs(x, 2.0), None, r"drive: place = 2 must be in the domain"),
        (v.diff(x, 2).subs(x, 0.5), None, "what a force acts on at 0.5.* must be one of"),
        (v.subs(x, 0.5), "motion", "kind = 'motion': what drives at an interior place must be a force"),
        (v, None, r"drive = v\(x, t\): must be one of w\(t\), v\(0, t\)"),
        ("F", None, "drive = 'F': must be one of w"),
    ],
)
def test_what_does_not_drive_is_named(drive, kind, words):
    with pytest.raises(ValueError, match=words):
        cra.frequency_response(Arm.nominal(), 1.0, drive=drive, kind=kind)


def test_a_force_inside_beside_terms_that_oscillate():
    """It was refused where a parameter is in the oscillating terms alone; the static deflection has a closed form."""
    EI, rho, k, b, epsilon, varpi = sp.symbols("EI rho k b epsilon varpi")
    model = cra.Model(
        rho * v.diff(t) ** 2 / 2 - EI * v.diff(x, 2) ** 2 / 2, fields=[v], x=x, domain=(0, L), t=t,
        essential=[v.subs(x, 0), v.diff(x).subs(x, 0)], small=(epsilon, varpi),
        right=-k * v**2 / 2 - b * epsilon * sp.cos(varpi * t) * v**2 / 2,
    )  # fmt: skip
    system = model.at({EI: 5.0, rho: 0.4, k: 30.0, b: 7.0, L: 1.0})
    place = 0.6
    alone = place**2 * (3 - place) / 6 / 5.0  # a unit force on the cantilever moves its tip by that
    found = cra.frequency_response(system, 0.0, drive=v.subs(x, place))
    assert found == pytest.approx(alone / (1 + 30.0 / (3 * 5.0)), rel=1e-12)


def test_coordinates_alone_have_no_places_to_drive():
    """What a force may act on was an empty list."""
    q, k, m = sp.Function("q")(t), *sp.symbols("k m")
    block = cra.Model(
        0, fields=[], x=x, domain=(0, L), t=t, coordinates=[q], left=m * q.diff(t) ** 2 / 2 - k * q**2 / 2
    )
    system = block.at({m: 1.0, k: 4.0, **({L: 1.0} if L in block.symbols else {})})
    for drive in (v.subs(x, 0.1), sp.Function("y")(0.1, t), "z"):
        with pytest.raises(ValueError, match=r"drive = .*: must be one of q\(t\)$"):
            cra.frequency_response(system, 1.0, drive=drive)
    assert cra.frequency_response(system, 1.0, drive=q) == pytest.approx(1 / 3, rel=1e-12)
