"""Nonlinear motions of systems without natural modes: closed forms, and integration in time by SciPy."""

from __future__ import annotations

import numpy as np
import pytest
import sympy as sp
from scipy.integrate import solve_ivp

import cra_sym as cra
from cra_sym.symbols import t, x

p, q, F = (sp.Function(name)(t) for name in ("p", "q", "F"))
g, k, k_3, k_2, c, n = sp.symbols("g k k_3 k_2 c n")
LUMPED = {"fields": (), "coordinates": [p, q], "x": x, "domain": (0, 1), "t": t}
MOVES = (p.diff(t) ** 2 + q.diff(t) ** 2) / 2 + g * (p * q.diff(t) - q * p.diff(t)) / 2
AMPLITUDES = np.array([0.1, 0.5, 1.0, 2.0])


@pytest.mark.parametrize(("mode", "sense"), [(1, -1), (2, 1)])
def test_circular_whirl_in_closed_form(mode, sense):
    """On a circle of radius A the complex displacement turns: w^2 - sense g w = k + k_3 A^2."""
    rotor = cra.Model(0, left=MOVES - k * (p**2 + q**2) / 2 - k_3 * (p**2 + q**2) ** 2 / 4, **LUMPED)
    system = rotor.at({"g": 0.7, "k": 2.0, "k_3": 0.5})
    line = cra.backbone(system, mode, amplitude=AMPLITUDES, modes=2, harmonics=3)
    omega = (sense * 0.7 + np.sqrt(0.49 + 4 * (2.0 + 0.5 * AMPLITUDES**2))) / 2
    energy = AMPLITUDES**2 * omega**2 / 2 + AMPLITUDES**2 + AMPLITUDES**4 / 8
    np.testing.assert_allclose(line.angular_frequency, omega, rtol=1e-10)
    np.testing.assert_allclose(line.energy, energy, rtol=1e-9)
    assert line.stable.all() and not line.error_harmonics.max() > 1e-9  # one harmonic is exact
    by_energy = cra.backbone(system, mode, energy=energy, modes=2, harmonics=3)
    np.testing.assert_allclose(by_energy.amplitude, AMPLITUDES, rtol=1e-9)


def returned(rate, state, period):
    run = solve_ivp(rate, (0.0, period), state, method="DOP853", rtol=1e-12, atol=1e-13)
    return run.y[:, -1]


@pytest.mark.parametrize("mode", [1, 2])
def test_backbone_without_symmetry_closes_in_time(mode):
    """Springs at an angle, of second and third degree: no instant about which the motion is even."""
    energy = k * p**2 / 2 + k * q**2 + k_2 * p**2 * q / 3 + k_3 * (p + q / 2) ** 4 / 4 + k_2 * p**3 / 5
    system = cra.Model(0, left=MOVES - energy, **LUMPED).at({"g": 0.7, "k": 2.0, "k_2": 0.3, "k_3": 0.5})
    slopes = sp.lambdify((p, q), [sp.diff(energy, u).subs({k: 2.0, k_2: 0.3, k_3: 0.5}) for u in (p, q)])

    def rate(_, y):
        force = slopes(y[0], y[1])
        return [y[2], y[3], 0.7 * y[3] - force[0], -0.7 * y[2] - force[1]]

    line = cra.backbone(system, mode, amplitude=[0.3, 0.8], modes=2, harmonics=15)
    # modes of the conservative part are the coordinates p and q here, their masses one
    for w, x_, largest in zip(line.angular_frequency, line.coefficients, line.amplitude, strict=True):
        cosines, sines = x_[:, :16], x_[:, 16:]
        start = np.concatenate([cosines.sum(axis=1), w * sines @ np.arange(1, 16)])
        end = returned(rate, start, 2 * np.pi / w)
        np.testing.assert_allclose(end, start, atol=1e-6 * largest)  # the harmonics left out
        phase = np.linspace(0, 2 * np.pi, 2001)[:, None]
        motion = np.cos(phase * np.arange(16)) @ cosines[0] + np.sin(phase * np.arange(1, 16)) @ sines[0]
        assert np.abs(motion).max() == pytest.approx(largest, rel=1e-5)
    # growing amplitudes leave the linear motion of the gyroscopic system
    small = cra.backbone(system, mode, amplitude=1e-4, modes=2)
    assert small.angular_frequency == pytest.approx(cra.eigenvalues(system, 2)[mode - 1].imag, rel=1e-6)
    whole = cra.backbone(system, mode, modes=2, harmonics=3, points=30)
    assert np.isfinite(whole.angular_frequency).all() and whole.amplitude[-1] > whole.amplitude[0]


def test_steady_states_are_those_of_time_integration():
    """Gyroscopic, with a force that follows (n), damped and driven: every stable state attracts and repeats."""
    work = [(F - c * p.diff(t), p, None), (-c * q.diff(t) - n * p, q, None)]
    model = cra.Model(0, left=MOVES - k * (p**2 + 1.2 * q**2) / 2 - k_3 * p**4 / 4, virtual_work=work, **LUMPED)
    values = {"g": 0.7, "k": 2.0, "k_3": 0.5, "c": 0.05, "n": 0.1}

    def rate(time, y, w):
        push = 0.2 * np.cos(w * time) - 0.05 * y[2] + 0.7 * y[3] - 2.0 * y[0] - 0.5 * y[0] ** 3
        return [y[2], y[3], push, -0.05 * y[3] - 0.7 * y[2] - 2.4 * y[1] - 0.1 * y[0]]

    seen = 0
    for w in (1.25, 2.1):
        states = cra.steady_states(model.at(values), w, drive={F: 0.2}, modes=2, harmonics=9)
        assert any(state.stable for state in states)
        seen += len(states)
        for state in states:
            cosines, sines = state.coefficients[:, :10], state.coefficients[:, 10:]
            start = np.concatenate([cosines.sum(axis=1), w * sines @ np.arange(1, 10)])
            period = 2 * np.pi / w
            end = returned(lambda time, y, w=w: rate(time, y, w), start, period)
            np.testing.assert_allclose(end, start, atol=1e-5 * state.amplitude)
            # multipliers against the map of small changes of the start
            step = 1e-6
            columns = [
                returned(lambda time, y, w=w: rate(time, y, w), start + side * step * unit, period)
                for unit in np.eye(4) for side in (1, -1)
            ]  # fmt: skip
            matrix = np.array([(a - b) / (2 * step) for a, b in zip(columns[::2], columns[1::2], strict=True)]).T
            expected = np.sort(np.abs(np.linalg.eigvals(matrix)))
            np.testing.assert_allclose(np.sort(np.abs(state.multipliers)), expected, atol=2e-5)
    assert seen == 4  # three of them at the resonance of the second motion
    curves = cra.response_curves(model.at(values), (1.8, 2.3), drive={F: 0.2}, modes=2, harmonics=5)
    (folds,) = [curve.folds for curve in curves]
    assert len(folds) == 2 and folds.min() < 2.1 < folds.max()


def test_response_in_time():
    """Of a rotor that is released: SciPy on the equations by hand."""
    system = cra.Model(0, left=MOVES - k * (p**2 + q**2) / 2 - k_3 * p**4 / 4, **LUMPED).at(
        {"g": 0.7, "k": 2.0, "k_3": 0.5}
    )
    times = np.linspace(0.0, 20.0, 41)
    run = solve_ivp(
        lambda _, y: [y[2], y[3], 0.7 * y[3] - 2.0 * y[0] - 0.5 * y[0] ** 3, -0.7 * y[2] - 2.0 * y[1]],
        (0.0, 20.0), [0.9, 0.0, 0.0, 0.4], method="DOP853", rtol=1e-12, atol=1e-13, t_eval=times,
    )  # fmt: skip
    for field, values in ((p, run.y[0]), (q, run.y[1])):
        found = cra.tip_response(system, {}, times, 2, initial={p: 0.9, q.diff(t): 0.4}, field=field)
        np.testing.assert_allclose(found, values, atol=1e-8)


def test_a_pipe_on_a_stop_closes_in_time():
    """Clamped at both ends, of a flowing mass and with a stop that hardens: the same equations by response()."""
    length, rhoA, EI, m, U, a = sp.symbols("l rhoA EI m U a")
    v = sp.Function("v")(x, t)
    pipe = cra.Model(
        rhoA * v.diff(t) ** 2 / 2 + m * (v.diff(t) + U * v.diff(x)) ** 2 / 2 - EI * v.diff(x, 2) ** 2 / 2,
        fields=[v], x=x, domain=(0, length), t=t, inside=[(a, -k_3 * v**4 / 4 + F * v)],
        essential=[u.subs(x, end) for end in (0, length) for u in (v, v.diff(x))],
    ).at({"rhoA": 0.3, "m": 0.2, "EI": 5.0, "U": 6.0, "l": 1.2, "a": 0.5, "k_3": 1e8})  # fmt: skip
    line = cra.backbone(pipe, 1, amplitude=[1e-6, 3e-3], modes=4, harmonics=25, place=0.5)
    exact = cra.eigenvalues(pipe, 1)[0].imag
    assert line.angular_frequency[0] == pytest.approx(exact, rel=1e-3)  # four modes of the pipe at rest
    assert line.angular_frequency[0] == pytest.approx(exact, rel=2 * line.error_modes[0] + 1e-9)
    assert line.angular_frequency[1] > 1.1 * exact
    w, equations = line.angular_frequency[1], cra.nonlinear_modal_equations(pipe, 4).polynomials
    cosines, sines = np.split(line.coefficients[1], [len(line.multiples)], axis=1)
    orders = np.array(line.multiples)
    start = np.concatenate([cosines.sum(axis=1), w * sines @ orders[orders > 0]])

    def rate(_, y):
        return np.concatenate([y[4:], equations.acceleration(y[None, :4], y[None, 4:])[0]])

    end = returned(rate, start, 2 * np.pi / w)
    size = np.abs(start).reshape(2, 4).max(axis=1).repeat(4)
    np.testing.assert_allclose(end / size, start / size, atol=1e-4)  # the harmonics left out
    states = cra.steady_states(pipe.replace(zeta=0.01), 1.05 * exact, drive={F: 2.0}, modes=3, harmonics=5, place=0.5)
    assert states and max(state.error_modes for state in states) < 0.05


@pytest.mark.parametrize("loaded", [False, True])
def test_a_shaft_in_its_rotating_frame(loaded):
    """Its whirl in space does not know of the frame: below the critical speed and above it, where it stands by its
    gyroscopic terms, frequencies in the frame differ by the speed of rotation alone."""
    length, rhoA, EI, Omega = sp.symbols("l rhoA EI Omega")
    v, u = (sp.Function(name)(x, t) for name in ("v", "u"))
    shaft = cra.Model(
        rhoA * ((v.diff(t) - Omega * u) ** 2 + (u.diff(t) + Omega * v) ** 2) / 2
        - EI * (v.diff(x, 2) ** 2 + u.diff(x, 2) ** 2) / 2 - k_3 * (v**2 + u**2) ** 2 / 4,
        fields=[v, u], x=x, domain=(0, length), t=t,
        essential=[field.subs(x, end) for field in (v, u) for end in (0, length)],
        virtual_work=[(F, v, length / 3)] if loaded else (),  # a load changes no mode
    )  # fmt: skip
    speeds, whirls = (20.0, 40.0), []
    for speed in speeds:
        system = shaft.at({"rhoA": 0.3, "EI": 5.0, "l": 1.2, "k_3": 1e5, "Omega": speed})
        backward, forward = (
            cra.backbone(system, mode, amplitude=[1e-5, 0.03], modes=6, harmonics=3, place=0.6) for mode in (1, 2)
        )
        assert backward.stable.all() and forward.stable.all()
        whirls += [forward.angular_frequency - speed, np.abs(speed - np.sign(speed - 30) * backward.angular_frequency)]
        np.testing.assert_allclose(cra.sensitivities(system, 2).eigenvalue_rate["Omega"][1], 1j, atol=1e-9)
    np.testing.assert_allclose(whirls, np.tile(whirls[0], (4, 1)), rtol=1e-9)
    assert whirls[0][0] == pytest.approx(np.sqrt(5.0 / 0.3) * (np.pi / 1.2) ** 2, rel=1e-6)
    assert whirls[0][1] > 1.1 * whirls[0][0]  # the foundation hardens


@pytest.mark.parametrize("place", ["carriage", "disc"])
def test_what_a_shaft_carries_in_a_rotating_frame(place):
    """Centrifugal forces on a mass beside the shaft, or on its end, buckle it too: whirls in space are the same."""
    length, rhoA, EI, Omega, m = sp.symbols("l rhoA EI Omega m")
    v, u = (sp.Function(name)(x, t) for name in ("v", "u"))

    def turns(one, other, mass):
        return mass * ((one.diff(t) - Omega * other) ** 2 + (other.diff(t) + Omega * one) ** 2) / 2

    carried = (p, q) if place == "carriage" else (v, u)
    joint = (
        sum((one - other) ** 2 for one, other in zip((v, u), (p, q), strict=True))
        if place == "carriage"
        else v**2 + u**2
    )
    shaft = cra.Model(
        turns(v, u, rhoA) - EI * (v.diff(x, 2) ** 2 + u.diff(x, 2) ** 2) / 2,
        fields=[v, u], coordinates=[p, q] if place == "carriage" else [], x=x, domain=(0, length), t=t,
        essential=[part.subs(x, 0) for field in (v, u) for part in (field, field.diff(x))],
        right=turns(*carried, m) - k * joint / 2 - k_3 * joint**2 / 4,
    )  # fmt: skip
    values = {"rhoA": 0.3, "EI": 5.0, "l": 1.0, "m": 0.05, "k": 30.0, "k_3": 1e4}
    below, above = (
        cra.backbone(shaft.at(values | {"Omega": speed}), mode, amplitude=0.02, modes=8, harmonics=3)
        for speed, mode in ((1.0, 2), (60.0, 3 if place == "carriage" else 2))
    )
    whirl = below.angular_frequency - 1.0
    assert abs(60.0 - above.angular_frequency) == pytest.approx(whirl, rel=1e-4)  # of the modes left out
    assert above.amplitude == pytest.approx(0.02)


def test_what_follows_the_motion_has_no_backbone():
    work = [(-n * p, q, None), (n * q, p, None)]
    model = cra.Model(0, left=MOVES - k * (p**2 + q**2) / 2 - k_3 * p**4 / 4, virtual_work=work, **LUMPED)
    system = model.at({"g": 0.7, "k": 2.0, "k_3": 0.5, "n": 0.1})
    with pytest.raises(ValueError, match="follow the motion"):
        cra.backbone(system, 1, amplitude=0.1, modes=2)


def test_a_lumped_rotor_above_its_critical_speed():
    """In a rotating frame no static position of it is stable; its circular whirls in space have one closed form."""
    m, U = sp.symbols("m U")
    w = sp.Function("w")(t)
    rotor = cra.Model(
        0, prescribed=[w],
        left=m * ((p.diff(t) + w.diff(t) - U * q) ** 2 + (q.diff(t) + U * (p + w)) ** 2) / 2
        - k * (p**2 + q**2) / 2 - k_3 * (p**2 + q**2) ** 2 / 4,
        **LUMPED,
    ).at({m: 2.0, k: 3.0, k_3: 1.7, U: 3.5})  # fmt: skip
    whirl = np.sqrt((3.0 + 1.7 * 0.25) / 2.0)
    for mode, exact in ((1, 3.5 - whirl), (2, 3.5 + whirl)):
        curve = cra.backbone(rotor, mode=mode, amplitude=0.5, modes=2)
        assert curve.angular_frequency == pytest.approx(exact, rel=1e-9)  # the tolerance of the harmonic balance
        assert curve.stable
    linear = rotor.model.replace(left=rotor.model.options["left"].subs(k_3, 0)).at({m: 2.0, k: 3.0, U: 3.5})
    exponents = cra.floquet_exponents(linear, cra.Fluctuation(k=1.0), 5.0, 0.0, modes=2)
    alone = np.sort(np.abs(np.exp(exponents * 2 * np.pi / 5.0) - 1))
    s = 1j * np.array([3.5 - np.sqrt(1.5), 3.5 + np.sqrt(1.5)])
    turned = np.sort(np.abs(np.exp(np.concatenate([s, -s]) * 2 * np.pi / 5.0) - 1))
    np.testing.assert_allclose(alone, turned, atol=1e-9)  # of the steps of a period


def test_eigenvalues_of_coupled_masses_to_rounding():
    """Springs in a row, whose stiffnesses cancel in the difference from those on single coordinates."""
    system = cra.Model(0, left=MOVES - k * p**2 / 2 - c * (q - p) ** 2 / 2, **LUMPED).at({k: 40.0, c: 30.0, g: 1.3})
    half = (70.0 + 30.0 + 1.69) / 2  # (70 - s)(30 - s) - 900 = g^2 s, with s = omega^2
    exact = np.sqrt(half + np.array([-1, 1]) * np.sqrt(half**2 - 1200.0))
    np.testing.assert_allclose(cra.eigenvalues(system, 2), 1j * exact, rtol=1e-13)
    assert all(np.isfinite(cra.sensitivities(system, 2).eigenvalue_rate[name]).all() for name in "kcg")
