"""Named inputs and outputs of state-space models: against frequency responses, lsim, statics and free bodies."""

from __future__ import annotations

import pickle
import sys

import numpy as np
import pytest
import sympy as sp
from scipy import signal

import cra_sym as cra
from cra_sym.extras import MissingExtraError
from cra_sym.symbols import A, I_z, J_e, L, h, k_r, k_t, m_e, rho, t, v, w, x
from cra_sym.symbols import E as modulus

ARM = cra.Arm.nominal().replace(k_t=1e3, k_r=50.0, m_e=0.05, J_e=1e-4)
GRID = np.array([3.0, 20.0, 70.0])  # rad/s, between the first natural frequencies
q, F = sp.Function("q")(t), sp.Function("F")(t)
c, m, k, a = sp.symbols("c m k a")
HALF = sp.Rational(1, 2)


def transfer(system, grid=GRID):
    """Return the transfer matrices, shape (outputs, inputs, frequencies)."""
    size = len(system.A)
    answers = [system.C @ np.linalg.solve(1j * s * np.eye(size) - system.A, system.B) + system.D for s in grid]
    return np.moveaxis(np.array(answers), 0, -1)


def truncation(system, modes, into, out, grid=GRID, most=400):
    """Return what the modes left out add to a transfer function at most, from 400 of them and their trend."""
    omega = system.natural_frequencies(most)[modes:]
    parts = np.abs(into(most)[modes:] * out(most)[modes:]) / (omega**2 - grid.max() ** 2)
    return 1.1 * parts.sum()


def test_transfer_functions_are_the_frequency_responses_but_for_the_modes_left_out():
    arm = ARM.replace(zeta=0.01)
    given = cra.state_space(arm, 12, outputs=["v", ("v", 0.4), "tip_acceleration"])
    tip, inside, acceleration = transfer(given)[:, 0]
    exact = cra.frequency_response(arm, GRID, [1.0, 0.4])

    def pushed(most):
        return cra.modal_parameters(arm, most).participation

    for found, place, right in ((tip, 1.0, exact[0]), (inside, 0.4, exact[1])):
        left_out = truncation(arm, 12, pushed, lambda most, place=place: cra.mode_shapes(arm, place, most))
        assert left_out < 1e-3 * np.abs(right).min()
        assert (np.abs(found - right) < left_out).all()
    np.testing.assert_allclose(acceleration, 1 - GRID**2 * tip, rtol=1e-12)
    assert given.D[0, 0] == 0 and given.D[2, 0] == pytest.approx(1 - np.sum(pushed(12) * tips(arm, 12)), rel=1e-10)


def tips(system, modes):
    return cra.modal_parameters(system, modes).tip_displacement


def test_a_force_on_a_displacement_is_that_of_the_frequency_response():
    drive = v.subs(x, L)
    given = cra.state_space(ARM, 12, [drive, v.diff(x).subs(x, L / 2)], ["v"])
    found = transfer(given)[0]
    left_out = truncation(ARM, 12, lambda n: tips(ARM, n), lambda n: tips(ARM, n))
    exact = cra.frequency_response(ARM, GRID, drive=drive)
    assert (np.abs(found[0] - exact) < left_out).all() and left_out < 1e-2 * np.abs(exact).min()
    slope = cra.mode_shapes(ARM, 0.5, 12, derivative=1)
    gap = ARM.natural_frequencies(12) ** 2 - GRID[:, None] ** 2
    np.testing.assert_allclose(found[1], (slope * tips(ARM, 12) / gap).sum(-1), rtol=1e-9)
    assert given.input_names == ("v(L, t)", str(v.diff(x).subs(x, L / 2)))


def test_the_force_on_a_free_base_is_seen_by_a_position():
    """The rigid-body motion is observable from w or y, as it is not from the elastic displacement alone."""

    def rank(outputs):
        s = cra.state_space(ARM, 1, "drive_force", outputs)
        scale = np.diag(1 / 20.0 ** np.arange(2).repeat(2))  # rates in units of the frequency
        A_, C = scale @ s.A @ np.linalg.inv(scale) / 20.0, s.C @ np.linalg.inv(scale)
        return np.linalg.matrix_rank(np.vstack([C @ np.linalg.matrix_power(A_, n) for n in range(4)]))

    assert (rank(["w"]), rank(["y"]), rank(["v"])) == (4, 4, 2)
    free = cra.state_space(ARM, 12, "drive_force", ["w", "y", "v"])
    found = transfer(free)[:, 0]
    np.testing.assert_allclose(found[1], found[0] + found[2], rtol=1e-12)
    whole = ARM.model.freed("w").at(ARM.values)
    exact = cra.frequency_response(whole, GRID, drive=w)
    np.testing.assert_allclose(found[2], exact, rtol=1e-3)  # 12 modes of the held base instead of all
    np.testing.assert_allclose(free.A[13, 0], 0.0)


def test_a_moving_base_is_a_state_only_where_it_is_seen():
    seen = cra.state_space(ARM, 3, outputs=["w", "y", "tip_velocity"])
    assert seen.state_names == ("w", "q_1", "q_2", "q_3", "w_rate", "q_1_rate", "q_2_rate", "q_3_rate")
    base, tip, speed = transfer(seen)[:, 0]
    np.testing.assert_allclose(base, -1 / GRID**2, rtol=1e-12)
    elastic = transfer(cra.state_space(ARM, 3))[0, 0]
    np.testing.assert_allclose(tip, base + elastic, rtol=1e-10)
    np.testing.assert_allclose(speed, 1j * GRID * tip, rtol=1e-10)


def test_forces_of_the_joint_are_those_of_its_springs_and_of_all_inertia():
    """Dynamic balance of the whole arm at a frequency: root force and moment against the inertia along the arm."""
    names = ["root_force", "root_moment", "tip_force", "tip_moment"]
    springs = [k_t * v.subs(x, 0), k_r * v.diff(x).subs(x, 0), modulus * I_z * v.diff(x, 2).subs(x, 0)]
    given = transfer(cra.state_space(ARM, 60, outputs=[*names, *springs]))[:, 0]
    force, moment, tip_force, tip_moment, translation, rotation, bending = given
    np.testing.assert_allclose(force, translation, rtol=1e-9)
    np.testing.assert_allclose(moment, rotation, rtol=1e-9)
    np.testing.assert_allclose(moment, bending, rtol=1e-9)
    points, weights = np.polynomial.legendre.leggauss(30)
    places = 0.5 * (1 + points)
    exact = cra.frequency_response(ARM, GRID, [*places, 1.0])
    accelerations = 1 - GRID**2 * exact
    share = 0.5 * weights * ARM.rhoA
    end = ARM.m_e * accelerations[-1]
    tip = cra.frequency_response(ARM, GRID, [1.0 - 1e-4, 1.0])
    turning = -ARM.J_e * GRID**2 * (tip[1] - tip[0]) / 1e-4
    # the arm pushes back on its root against the base: minus the sum of mass times acceleration
    np.testing.assert_allclose(force, -(share @ accelerations[:-1]) - end, rtol=3e-2)
    np.testing.assert_allclose(moment, -(share * places) @ accelerations[:-1] - end - turning, rtol=1e-4)
    np.testing.assert_allclose(tip_force, end, rtol=3e-2)
    np.testing.assert_allclose(tip_moment, turning, rtol=1e-2)


def test_static_forces_of_a_load_on_the_tip():
    """Statics of the lever: all of the force goes through the root, and its moment is force times length."""
    outputs = ["root_force", "root_moment", "strain", ("strain", 0.4), ("v", 0.3), "v"]
    system = cra.state_space(ARM.replace(m_e=0.0, J_e=0.0), 300, v.subs(x, L), outputs)
    force, moment, root, inside, third, tip = transfer(system, np.zeros(1))[:, 0, 0].real
    # 300 modes: the sum over the others falls with their number for a force that acts beside the end
    assert force == pytest.approx(1.0, abs=5e-3)
    assert moment == pytest.approx(ARM.L, rel=1e-4)
    assert root == pytest.approx(ARM.h / 2 * ARM.L / ARM.EI, rel=1e-4)
    assert inside == pytest.approx(ARM.h / 2 * 0.6 / ARM.EI, rel=1e-3)
    for place, found in ((0.3, third), (1.0, tip)):
        bending = (3 * place**2 - place**3) / (6 * ARM.EI)
        assert found == pytest.approx(1 / ARM.k_t + place / ARM.k_r + bending, rel=1e-6)


def test_a_rigid_root_carries_what_the_modes_have_of_the_mass():
    rigid = ARM.replace(k_t=np.inf, k_r=np.inf)
    force = transfer(cra.state_space(rigid, 8, outputs=["root_force"]), np.zeros(1))[0, 0, 0].real
    effective = np.sum(cra.modal_parameters(rigid, 8).participation ** 2)
    assert force == pytest.approx(-effective, rel=1e-9)
    assert 0.9 < effective / (rigid.rhoA + rigid.m_e) < 1
    with pytest.raises(ValueError, match=r"outputs: k_t = inf in k_t\*v\(0, t\) must be finite; name the force"):
        cra.state_space(rigid, outputs=[k_t * v.subs(x, 0)])


def test_the_held_input_is_exact():
    """Against lsim, whose linear interpolation is exact for a constant, and against the exponential of SciPy's hold."""
    system = cra.state_space(ARM.replace(zeta=0.02), 4, "drive_force", ["w", "v", "tip_acceleration", "root_moment"])
    step = 3e-3
    held = system.discrete(step)
    A_, B, C, D, _ = signal.cont2discrete((system.A, system.B, system.C, system.D), step, "zoh")
    for one, other in ((held.A, A_), (held.B, B), (held.C, C), (held.D, D)):
        np.testing.assert_allclose(one, other, rtol=1e-12, atol=1e-14)
    times = step * np.arange(50)
    _, found, _ = signal.dlsim(held, np.ones(50))
    _, expected, _ = signal.lsim(system, np.ones(50), times)
    size = np.abs(expected).max(axis=0)
    np.testing.assert_allclose(found / size, expected / size, rtol=1e-8, atol=1e-10)
    coarse = cra.state_space(ARM, 4, "drive_force").discrete(2 * step)
    fine = cra.state_space(ARM, 4, "drive_force").discrete(step)
    np.testing.assert_allclose(coarse.A, fine.A @ fine.A, atol=1e-9 * np.abs(fine.A).max())


def test_names_survive_in_python_control():
    control = pytest.importorskip("control", reason="needs the extra control: python-control")
    system = cra.state_space(ARM, 2, ["base_acceleration", v.subs(x, L)], {"angle": v.diff(x).subs(x, L), "y": "y"})
    there = cra.state_space(ARM, 2, outputs=[("v", 0.25)])
    assert there.output_names == ("v(0.25)",) and there.to_control().output_labels == ["v(0_25)"]  # no dots there
    made = system.to_control()
    assert made.input_labels == ["base_acceleration", "v(L, t)"] and made.output_labels == ["angle", "y"]
    assert made.state_labels == list(system.state_names) and made.isctime()
    np.testing.assert_allclose(made(20j), transfer(system, [20.0])[..., 0], rtol=1e-9)
    held = system.discrete(1e-3).to_control()
    assert held.dt == 1e-3 and held.output_labels == ["angle", "y"]
    assert isinstance(made, control.StateSpace)


def test_without_python_control_the_error_names_the_extra(monkeypatch):
    monkeypatch.setitem(sys.modules, "control", None)
    with pytest.raises(MissingExtraError, match=r"control is not installed.*'control'"):
        cra.state_space(ARM).to_control()


def test_a_state_space_is_one_of_scipy_and_a_value():
    system = cra.state_space(ARM, 2, outputs=["v", "w"])
    assert isinstance(system, signal.StateSpace) and isinstance(system, signal.lti)
    assert isinstance(system.discrete(0.1), signal.dlti)
    assert pickle.loads(pickle.dumps(system)) == system == cra.state_space(ARM, 2, outputs=["v", "w"])
    assert system != cra.state_space(ARM, 2, outputs=["v", "y"])


def beam(carried=w, **options):
    density = HALF * rho * A * (v + carried).diff(t) ** 2 - HALF * modulus * I_z * v.diff(x, 2) ** 2
    return cra.Model(density, fields=[v], prescribed=[w], x=x, domain=(0, L), t=t, **options)


VALUES = {"rho": 1.0, "A": 0.24, "E": 1.0, "I_z": 4.6, "L": 1.0, "k_t": 900.0, "k_r": 40.0}
JOINT = -HALF * k_t * v**2 - HALF * k_r * v.diff(x) ** 2


def test_any_model_has_its_coordinates_forces_and_places():
    """A mass on a spring at the tip, a force inside the span, two dampers; the whole by dynamic stiffness."""
    model = beam(
        left=JOINT,
        right=HALF * m * (q + w).diff(t) ** 2 - HALF * k * (v - q) ** 2,
        inside=[(a, F * v)],
        coordinates=[q],
        virtual_work=[(-c * v.diff(t), v, "left")],
    )
    system = model.at({**VALUES, "m": 0.2, "k": 50.0, "a": 0.35, "c": 0.7})
    given = cra.state_space(
        system, 9, ["base_acceleration", F, "q", v.subs(x, a)], ["v", "q", "y", k * (v.subs(x, L) - q)]
    )
    assert given.input_names == ("base_acceleration", "F", "q", "v(a, t)")
    found = transfer(given)
    np.testing.assert_allclose(found[:, 1], found[:, 3], rtol=1e-9)  # the force of the Lagrangian acts there
    found = found[:, :3]
    # nine modes: left out is a part in a thousand of what the base does, a hundredth of what a force on the mass does
    np.testing.assert_allclose(found[0, 0], cra.frequency_response(system, GRID, drive=w), rtol=3e-3)
    np.testing.assert_allclose(found[0, 2], cra.frequency_response(system, GRID, drive=q), rtol=3e-2)
    np.testing.assert_allclose(found[3], 50.0 * (found[0] - found[1]), rtol=1e-9)
    # the mass alone: m (q'' + w'') = force of the spring + what pushes it
    mass = 0.2 * (np.array([1, 0, 0])[:, None] - GRID**2 * found[1])
    np.testing.assert_allclose(mass[1], found[3, 1], rtol=2e-2)
    np.testing.assert_allclose(found[2, 0], found[0, 0] - 1 / GRID**2, rtol=1e-9)
    np.testing.assert_allclose(found[2, 1], found[0, 1], rtol=1e-9)
    with pytest.raises(ValueError, match="beside 'drive_force' must be displacements"):
        cra.state_space(system, 3, ["drive_force", "F"])


def test_the_tip_in_the_inertial_frame_of_a_base_that_turns():
    turn = sp.Function("turn")(t)
    density = HALF * rho * A * (v + w + x * turn).diff(t) ** 2 - HALF * modulus * I_z * v.diff(x, 2) ** 2
    model = cra.Model(density, fields=[v], prescribed=[w, turn], x=x, domain=(0, L), t=t, left=JOINT)
    system = model.at({**VALUES, "L": 1.5})
    found = transfer(cra.state_space(system, 4, [w, turn], ["y", "v", "tip_acceleration"]))
    np.testing.assert_allclose(found[0] - found[1], np.array([-1.0, -1.5])[:, None] / GRID**2, rtol=1e-12)
    np.testing.assert_allclose(found[2], -(GRID**2) * found[0], rtol=1e-9)
    with pytest.raises(ValueError, match="must have one prescribed motion that acts by its acceleration"):
        cra.state_space(system)


def test_the_tip_in_the_inertial_frame_of_a_beam_on_a_carriage():
    """The displacement of a coordinate that carries the beam had been left out; one of the tip mass carries nothing."""
    turn = sp.Function("turn")(t)
    held = HALF * m * (q + w).diff(t) ** 2 - HALF * c * q**2 - HALF * k * turn**2
    values = {**VALUES, "L": 1.5, "m": 0.3, "c": 70.0, "k": 40.0}
    crane, pushed = beam(w + q + x * turn, left=JOINT + held, coordinates=[q, turn]).at(values), v.subs(x, L)
    found = transfer(cra.state_space(crane, 20, pushed, ["y", "v", "q", "turn", "tip_acceleration"]))[:, 0]
    np.testing.assert_allclose(found[0], found[1] + found[2] + 1.5 * found[3], rtol=1e-12)
    np.testing.assert_allclose(found[4], -(GRID**2) * found[0], rtol=1e-9)
    # all modes; twenty leave 7e-6, by the third power of their number, of 6e-3
    exact = [cra.frequency_response(crane, GRID, 1.5, pushed, field=one) for one in (v, q, turn)]
    np.testing.assert_allclose(found[0], exact[0] + exact[1] + 1.5 * exact[2], rtol=5e-3)
    beside = HALF * m * (v + w + q).diff(t) ** 2 - HALF * c * q**2
    absorber = beam(left=JOINT, right=beside, coordinates=[q]).at({**VALUES, "m": 0.3, "c": 70.0})
    y, tip, own = transfer(cra.state_space(absorber, 5, v.subs(x, L), ["y", "v", "q"]))
    np.testing.assert_allclose(y, tip, rtol=1e-12)
    assert (np.abs(own) > 1e-3 * np.abs(tip)).all()


def test_a_force_on_a_motion_without_inertia_is_refused():
    """Rounding decided on its acceleration, or a singular matrix came to light."""
    carriage = HALF * m * (q + w).diff(t) ** 2 - HALF * k * q**2
    lumped = cra.Model(0, fields=[], x=x, domain=(0, 1), t=t, coordinates=[q], prescribed=[w], left=carriage)
    crane = beam(q + w, left=JOINT + carriage, coordinates=[q])
    for model, modes in ((lumped, 1), (crane, 12)):
        system = model.at({name: value for name, value in {**VALUES, "m": 0.3, "k": 70.0}.items()
                           if name in {symbol.name for symbol in model.symbols}})  # fmt: skip
        with pytest.raises(ValueError, match=rf"'drive_force': w has no mass of its own beside that of {modes} modes"):
            cra.state_space(system, modes, "drive_force", ["w"])


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ({"outputs": ["force"]}, r"outputs = 'force': must be one of v, y, tip_velocity, .*root_moment, .*strain"),
        ({"outputs": [v]}, "must be taken at a place"),
        ({"outputs": [v.subs(x, 0) ** 2]}, "must be linear"),
        ({"outputs": [c * v.subs(x, 0)]}, "c in .* is not a parameter; must be one of E, J_e"),
        ({"outputs": [v.diff(t, 3).subs(x, 0)]}, "at most twice"),
        ({"outputs": [q]}, r"q\(t\) must be made of v\(x, t\), w\(t\)"),
        ({"outputs": ["v", "v"]}, "each must be there once"),
        ({"outputs": [("v", 2.0)]}, r"outputs: place = 2.0: must be real numbers in \[0, 1\]"),
        ({"outputs": [("root_force", 0.5)]}, "'root_force' must be one of v, strain, which have a place"),
        ({"outputs": []}, "must have 1 to 1000 entries"),
        ({"input": v.diff(t).subs(x, L)}, "must be a displacement that a force acts on"),
        ({"input": "root_force"}, "input = 'root_force': must be one of base_acceleration, drive_force, w, v, y"),
        ({"input": ["w", "base_acceleration"]}, "each input once"),
        ({"input": ["drive_force", "w"]}, "each input once"),
    ],
)  # fmt: skip
def test_what_is_no_input_or_output_is_named(arguments, words):
    with pytest.raises(ValueError, match=words):
        cra.state_space(ARM, 2, **arguments)


def test_steps_are_checked():
    with pytest.raises(ValueError, match=r"dt = 0.0: must be real numbers in \(0, inf\)"):
        cra.state_space(ARM).discrete(0.0)
    with pytest.raises(ValueError, match="dt has shape"):
        cra.state_space(ARM).discrete([0.1, 0.2])
    with pytest.raises(TypeError, match=r"outputs = <object .*: must be an expression"):
        cra.state_space(ARM, outputs=[object()])


def test_a_base_that_follows_the_arm_is_refused():
    model = cra.Arm.nominal().model.replace(virtual_work=[(-c * v.diff(t), v + w, "right")])
    assert m_e in model.symbols and J_e in model.symbols and h in model.symbols
    with pytest.raises(ValueError, match="w: a force on it depends on"):
        cra.state_space(model.at({**ARM.values, "c": 1.0}), 2, "drive_force")
