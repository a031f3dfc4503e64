"""Analyses of models other than the arm: several motions, loads along x, several fields, repeated frequencies."""

from __future__ import annotations

import numpy as np
import pytest
import sympy as sp

import cra_sym as cra

x, t, EI, rhoA, L, k, c, m, e = sp.symbols("x t EI rhoA L k c m e")
v, u = (sp.Function(name)(x, t) for name in "vu")
w, turn, force, payload = (sp.Function(name)(t) for name in ("w", "turn", "force", "payload"))
BEAM = {EI: 4.6, rhoA: 0.24, L: 1.3}


def energy(displacement=v, stiffness=EI, field=v):
    return rhoA * displacement.diff(t) ** 2 / 2 - stiffness * field.diff(x, 2) ** 2 / 2


def springs(field=v):
    return -50 * field**2 / 2 - 3 * field.diff(x) ** 2 / 2


def beam(**options):
    return cra.Model(**{"density": energy(), "fields": [v], "x": x, "t": t, "domain": (0, L), **options})


TURNED = beam(density=energy(v + w + x * turn), prescribed=[w, turn], left=springs())
FREE = beam()
STRING = beam(density=rhoA * v.diff(t) ** 2 / 2 - EI * v.diff(x) ** 2 / 2, left=-2 * v**2 / 2)
PLANES = beam(density=energy() + energy(u, c, u), fields=[v, u], left=springs() + springs(u))


@pytest.mark.parametrize("zeta", [0.0, 0.001, 0.02])
def test_modal_damping_where_the_load_varies_along_x(zeta):
    """Summed modes: the quadrature at imaginary frequencies was as much as five times too large there."""
    system = TURNED.at(BEAM, zeta)
    omega, tip = system.natural_frequencies(60), system.modes(60).displacement(1, 0)
    driven = system.project(system.numerics("load", "turn"), 60)
    Omega = np.array([0.3, 1.0, 6.0, 20.0])
    gap = omega**2 + 2j * zeta * omega * Omega[:, None] - Omega[:, None] ** 2
    # what 60 modes leave out falls with the fifth power of their number
    np.testing.assert_allclose(
        cra.frequency_response(system, Omega, drive=turn), (driven * tip / gap).sum(-1), rtol=2e-7
    )


def test_modal_damping_of_a_string_at_low_frequency():
    """It was refused: the quadrature went on to waves shorter than could be followed."""
    system = STRING.at(BEAM, 0.02)
    omega, tip = system.natural_frequencies(400), system.modes(400).displacement(1, 0)
    gap = omega**2 + 2j * 0.02 * omega * 0.7 - 0.7**2
    found = cra.frequency_response(system, 0.7, drive=v.subs(x, L))
    tail = (tip[-1] / omega[-1]) ** 2 * 400  # residues over squared frequencies fall with the square of the number
    assert abs(found - (tip**2 / gap).sum()) < 2 * tail


def test_the_end_that_moves_turns_a_free_beam_about_its_centre_of_percussion():
    system = FREE.at(BEAM)
    found = cra.frequency_response(system, [0.0, 1e-2], drive=v.subs(x, 0), kind="motion")
    np.testing.assert_allclose(found, -0.5, rtol=1e-6)
    with pytest.raises(ValueError, match="can still move as a rigid body must have damping='structural'"):
        cra.frequency_response(system.replace(zeta=0.02), 1.0, drive=v.subs(x, 0), kind="motion")


def test_a_spring_that_holds_the_base_is_in_the_state_space():
    """It had been left out: the base drifted."""
    from cra_sym.symbols import w as base

    arm = cra.Arm.nominal().replace(k_t=1e3, k_r=100.0)
    _, left, _ = cra.paper_lagrangian()
    model = arm.model.replace(left=left - sp.Symbol("k_w") * base**2 / 2)
    values = {**arm.values, "k_w": 1e4}
    A = cra.state_space(model.at(values), 8, input="drive_force").A
    poles = np.sort(np.linalg.eigvals(A).imag)
    whole = model.freed("w").at(values).natural_frequencies(4)
    np.testing.assert_allclose(poles[poles > 0][:4], whole, rtol=1e-6)  # eight modes of the held base nearly do


def test_slopes_and_forces_of_the_ends_belong_to_the_first_field():
    modal = cra.modal_parameters(STRING.at(BEAM))
    slope = cra.mode_shapes(STRING.at(BEAM), [0.0, 1.3], derivative=1)
    np.testing.assert_allclose(modal.root_slope, slope[:, 0], rtol=1e-9)
    np.testing.assert_allclose(modal.tip_slope, slope[:, 1], atol=1e-9 * np.abs(slope).max())
    with pytest.raises(ValueError, match="root_moment: no force of the section is conjugate to the slope"):
        _ = modal.root_moment
    both = cra.modal_parameters(PLANES.at({**BEAM, c: 9.2}))
    np.testing.assert_allclose(
        both.tip_slope, cra.mode_shapes(PLANES.at({**BEAM, c: 9.2}), 1.3, derivative=1), atol=1e-9
    )


def test_a_repeated_frequency_has_no_derivative_by_what_splits_it():
    """The same beam in two planes; how its eigenspace was split decided the derivative."""
    rate = cra.sensitivities(PLANES.at({**BEAM, c: 4.6}), 4).rate
    assert np.isnan(rate["EI"]).all() and np.isnan(rate["c"]).all()
    assert np.isfinite(rate["rhoA"]).all()  # acts alike on both
    alone = cra.sensitivities(beam(left=springs()).at(BEAM), 2).rate["rhoA"]
    np.testing.assert_allclose(rate["rhoA"], np.repeat(alone, 2), rtol=1e-9)
    assert np.isfinite(cra.sensitivities(PLANES.at({**BEAM, c: 4.7}), 4).rate["EI"]).all()


def test_an_accelerated_base_pulls_the_mass_on_its_lever():
    """Against the integral of the mass beyond each place, the lever e included."""
    carried = beam(left=springs(), right=m * (v + e * v.diff(x)).diff(t) ** 2 / 2)
    system = carried.at({**BEAM, m: 0.05, e: 0.1})
    points, weights = np.polynomial.legendre.leggauss(40)
    places = 0.65 * (1 + points)
    slopes = cra.mode_shapes(system, places, 2, 1)
    tip = cra.mode_shapes(system, 1.3, 2, 1)
    load = 0.65 * weights * (0.24 * (1.3 - places) + 0.05)
    expected = (slopes * load) @ slopes.T + 0.05 * 0.1 * np.outer(tip, tip)
    np.testing.assert_allclose(cra.AxialBase(1.0).drives(system, 2)[0].stiffness, expected, rtol=1e-9)


def test_a_lumped_mass_of_unknown_place_is_not_pulled():
    q = sp.Function("q")(t)
    model = beam(left=springs(), right=m * q.diff(t) ** 2 / 2 - k * (v - q) ** 2 / 2, coordinates=[q])
    with pytest.raises(ValueError, match="the place along x of the mass that moves by q"):
        cra.AxialBase(1.0).drives(model.at({**BEAM, m: 0.5, k: 1e3}), 2)


def test_residual_vibration_is_after_all_that_drives_has_ended():
    move = cra.BaseMotion.trapezoid(0.1, 0.2, 1.0)
    model = beam(density=energy(v + w) + force * v, prescribed=[w, force], left=springs())
    with pytest.raises(ValueError, match="no history for force; must be a Force or a BaseMotion"):
        cra.residual_vibration(model.at(BEAM), move)
    with pytest.raises(ValueError, match="the force force never ends: must be a sampled record"):
        cra.residual_vibration(model.at(BEAM), {w: move, force: cra.Force(1.0)})


def carried(**pieces):
    """A payload on a spring under the tip of a beam on a base that moves, pulled by a force."""
    return beam(
        density=energy(v + w), coordinates=[payload], prescribed=[w], left=springs(),
        right=m * (payload + w).diff(t) ** 2 / 2 - k * (v - payload) ** 2 / 2 + force * payload, **pieces,
    )  # fmt: skip


def test_a_payload_is_an_output_too():
    """By the boundary-value problem, by modes in the frequency domain, and by modes in time."""
    system, Omega = carried().at({**BEAM, m: 0.2, k: 40.0}, zeta=0.03), np.array([0.0, 3.0, 40.0])
    for drive in ("w", "force"):
        modal = cra.state_space(system, 12, drive, ["payload"])
        summed = [(modal.C @ np.linalg.solve(1j * one * np.eye(24) - modal.A, modal.B))[0, 0] for one in Omega]
        found = cra.frequency_response(system, Omega, drive=drive, field=payload)
        # what the modes beyond give the payload falls with the twelfth power of their number
        np.testing.assert_allclose(found, summed, rtol=1e-9)
        at_places = cra.frequency_response(system, Omega, [0.0, 0.4], drive=drive, field=payload)
        np.testing.assert_allclose(at_places, [found, found], rtol=1e-12)
    moves = {w: cra.BaseMotion(), force: cra.Force(2.0)}
    pushed = cra.state_space(system, 4, "force", ["payload"]).discrete(0.1)
    state, steps = np.zeros(8), []
    for _ in range(4):
        steps.append((pushed.C @ state)[0])
        state = pushed.A @ state + pushed.B[:, 0] * 2.0
    times = 0.1 * np.arange(4)
    np.testing.assert_allclose(cra.tip_response(system, moves, times, 4, field=payload), steps, rtol=1e-9, atol=1e-15)
    np.testing.assert_allclose(cra.response(system, moves, times, [0.1, 1.0], 4, field=payload), [steps, steps], 1e-9)
    with pytest.raises(ValueError, match=r"field = w\(t\): must be one of v\(x, t\), payload\(t\)"):
        cra.tip_response(system, moves, times, field=w)


def test_the_payload_of_a_joint_that_slips():
    """The element sticks: the response is that of the model with a stiffer spring; the tip and the payload."""
    k_d, f_s = sp.symbols("k_d f_s")
    held = carried(hysteresis=[(cra.Jenkins(k_d, f_s), payload, None)]).at(
        {**BEAM, m: 0.2, k: 40.0, k_d: 5.0, f_s: 1e3}
    )
    moves, times = {w: cra.BaseMotion.trapezoid(0.1, 0.3, 2.0), force: cra.Force(0.0)}, np.linspace(0.0, 0.6, 7)
    found = cra.slip_response(held, moves, times, 3, field=payload).tip
    np.testing.assert_allclose(found, cra.response(held, moves, times, 0.7, 3, field=payload), rtol=1e-9, atol=1e-15)
    assert np.abs(found - cra.slip_response(held, moves, times, 3).tip).max() > 1e-3 * np.abs(found).max()


def test_each_of_two_lumped_masses_is_an_output():
    """A chain without fields, by hand."""
    chain = beam(
        density=0, fields=(), coordinates=[payload, turn], domain=(0, 1), prescribed=[w],
        left=m * ((payload + w).diff(t) ** 2 + (turn + w).diff(t) ** 2) / 2
        - k * (payload**2 + 3 * (turn - payload) ** 2) / 2,
    ).at({m: 0.5, k: 4.0})  # fmt: skip
    stiffness, Omega = np.array([[16.0, -12.0], [-12.0, 12.0]]), 2.0
    by_hand = np.linalg.solve(stiffness - 0.5 * Omega**2 * np.eye(2), [-0.5, -0.5])
    found = [cra.frequency_response(chain, Omega, field=one) for one in (payload, turn)]
    np.testing.assert_allclose(found, by_hand, rtol=1e-12)
    late = 1e-4  # after a start the masses stand still in the inertial frame
    for one in (payload, turn):
        assert cra.tip_response(chain, cra.BaseMotion(velocity=0.1), late, 2, field=one) == pytest.approx(-0.1 * late)


def test_the_base_as_a_coordinate_may_have_a_stiffness_that_fluctuates():
    """Loads of a lumped coordinate have no places along x: their product with those of a field failed."""
    q = sp.Function("q")(t)
    model = beam(density=energy(v + q), left=springs() - 900 * q**2 / 2 + q.diff(t) ** 2 / 2, coordinates=[q])
    system = model.at(BEAM)
    low, high = cra.stability_boundary(system, cra.Fluctuation(EI=1.0), 0.1)
    assert low < 2 * system.natural_frequencies(1)[0] < high


def test_a_system_is_frozen_and_bad_values_are_named():
    system = FREE.at(BEAM)
    with pytest.raises(AttributeError, match=r"zeta = 0.1: a System is frozen; use replace"):
        system.zeta = 0.1
    with pytest.raises(ValueError, match=r"L = inf must be in \(0, inf\)"):
        cra.natural_frequencies(FREE.at({**BEAM, L: np.inf}))
    with pytest.raises(ValueError, match=r"EI = 0: a coefficient of the equations becomes infinite"):
        cra.natural_frequencies(FREE.at({**BEAM, EI: 0.0}))
    with pytest.raises(ValueError, match=r"EI = nan: must be real numbers, or inf for the stiffness of an end"):
        FREE.at({**BEAM, EI: np.nan})


def test_a_weight_of_zero_asks_for_no_parameter():
    """A joint that fluctuates in k_t alone is that of a model without k_r; a weight that is not 0 names it."""
    k_t = sp.Symbol("k_t")
    model = cra.Model(
        rhoA * v.diff(t) ** 2 / 2 - EI * v.diff(x, 2) ** 2 / 2,
        fields=[v], x=x, domain=(0, L), t=t, left=-k_t * v**2 / 2, essential=[v.diff(x).subs(x, 0)],
    )  # fmt: skip
    system = model.at({rhoA: 1.0, EI: 1.0, L: 1.0, k_t: 10.0})
    for order in (1, 2):
        found = cra.stability_boundary(system, cra.JointStiffness(), 0.1, (1, 1), order=order)
        assert found == cra.stability_boundary(system, cra.Fluctuation(k_t=1.0), 0.1, (1, 1), order=order)
    with pytest.raises(ValueError, match="k_r is not a parameter; must be one of"):
        cra.stability_boundary(system, cra.JointStiffness(1.0, 0.5), 0.1, (1, 1))
