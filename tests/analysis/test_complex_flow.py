"""Slow flow of complex modes: closed forms of whirls, orders of accuracy, limit cycles and exchange in time."""

from __future__ import annotations

import numpy as np
import pytest
import sympy as sp
from scipy.integrate import solve_ivp
from scipy.linalg import eig

import cra_sym as cra
from cra_sym.symbols import t, x

p, q = (sp.Function(name)(t) for name in "pq")
g, k, k_2, k_3, d, e, n, m, U = sp.symbols("g k k_2 k_3 d e n m U")
LUMPED = {"fields": (), "coordinates": [p, q], "x": x, "domain": (0, 1), "t": t}
MOVES = (p.diff(t) ** 2 + q.diff(t) ** 2) / 2 + g * (p * q.diff(t) - q * p.diff(t)) / 2
RING = k * (p**2 + q**2) / 2 + k_3 * (p**2 + q**2) ** 2 / 4


def bend(system, mode, modes=None):
    """Return the change of the frequency per squared amplitude of the mode."""
    flow = system.model.slow_flow(("free", mode), modes=modes)
    return float(flow.backbone.subs(cra.slow_flow_values(flow, system)))


@pytest.mark.parametrize(("mode", "sense"), [(1, -1), (2, 1)])
def test_circular_whirl(mode, sense):
    """w^2 - sense g w = k + k_3 A^2 with the radius A."""
    system = cra.Model(0, left=MOVES - RING, **LUMPED).at({"g": 0.7, "k": 2.0, "k_3": 0.5})
    size = np.abs(cra.mode_shapes(system, modes=2, damped=True)[mode - 1])
    omega = (sense * 0.7 + np.sqrt(0.49 + 8.0)) / 2
    assert bend(system, mode) == pytest.approx(size**2 * 0.5 / (2 * omega - sense * 0.7), rel=1e-12)


@pytest.mark.parametrize("speed", [20.0, 40.0])
def test_a_shaft_in_its_rotating_frame(speed):
    """Below its critical speed and above: whirl^2 = omega^2 + 3 k_3 A^2/(4 rhoA) in space, with the radius A."""
    length, rhoA, EI = sp.symbols("l rhoA EI")
    v, u = (sp.Function(name)(x, t) for name in ("v", "u"))
    shaft = cra.Model(
        rhoA * ((v.diff(t) - U * u) ** 2 + (u.diff(t) + U * v) ** 2) / 2
        - EI * (v.diff(x, 2) ** 2 + u.diff(x, 2) ** 2) / 2 - k_3 * (v**2 + u**2) ** 2 / 4,
        fields=[v, u], x=x, domain=(0, length), t=t,
        essential=[field.subs(x, end) for field in (v, u) for end in (0, length)],
    ).at({"rhoA": 0.3, "EI": 5.0, "l": 1.2, "k_3": 1e5, "U": speed})  # fmt: skip
    omega = np.sqrt(5.0 / 0.3) * (np.pi / 1.2) ** 2
    assert cra.eigenvalues(shaft, 2).imag == pytest.approx(np.sort([abs(omega - speed), omega + speed]), rel=1e-10)
    for mode in (1, 2):
        size = np.abs(cra.mode_shapes(shaft, 0.6, 2, damped=True)[mode - 1])
        change = 3 * 1e5 * size**2 / (8 * 0.3 * omega)
        # the lower whirl turns forwards in space above the critical speed, where its frequency is speed - omega
        sign = -1.0 if mode == 1 and speed > omega else 1.0
        assert bend(shaft, mode) == pytest.approx(sign * change, rel=1e-9)


@pytest.mark.parametrize("quick", [False, True])
def test_second_order_of_quadratic_terms_leaves_the_fourth_power(quick):
    """Springs at an angle; and forces of second degree with velocities beside them, which take no energy."""
    energy = k * p**2 / 2 + k * q**2 + k_2 * p**2 * q / 3 + k_3 * (p + q / 2) ** 4 / 4 + k_2 * p**3 / 5
    fast = k_3 * (p.diff(t) ** 2 * q**2 + p.diff(t) ** 4) / 6 if quick else 0
    system = cra.Model(0, left=MOVES - energy + fast, **LUMPED).at({"g": 0.7, "k": 2.0, "k_2": 0.3, "k_3": 0.5})
    shapes, frequencies = cra.mode_shapes(system, modes=2, damped=True), cra.eigenvalues(system, 2).imag
    for mode in (1, 2):
        curve = cra.backbone(system, mode, amplitude=0.2 / 2.0 ** np.arange(3), modes=2, harmonics=9)
        # the modes of the conservative part are the coordinates p and q, their masses one
        a = np.hypot(curve.coefficients[:, 0, 1], curve.coefficients[:, 0, 10]) / np.abs(shapes[mode - 1])
        errors = np.abs(curve.angular_frequency - frequencies[mode - 1] - bend(system, mode, 2) * a**2)
        assert (np.abs(np.log2(errors[:-1] / errors[1:]) - 4) < 0.3).all(), errors


def test_a_follower_force_has_a_limit_cycle():
    """Its growth against a damper that grows with the square: the relative error is of the order of the growth."""
    work = [(-n * q - d * p**2 * p.diff(t) - e * p**2, p, None), (n * p - e * q * p.diff(t), q, None)]
    model = cra.Model(0, left=MOVES - RING, virtual_work=work, **LUMPED)
    flow, errors = model.slow_flow(("free", 2)), []
    amplitude, time = flow.amplitude_equations[0].lhs.args[0], sp.Symbol("t", real=True)
    for growth in (0.04, 0.02):
        given = {"g": 0.7, "k": 2.0, "k_3": 0.5, "n": -growth, "d": 0.4, "e": 0.2}
        system = model.at(given)
        a = sp.Symbol("a", positive=True)
        rate = flow.amplitude_equations[0].rhs.subs(cra.slow_flow_values(flow, system)).subs(amplitude, a)
        size = float(sp.nsolve(sp.re(sp.expand(rate / a)), a, 0.5)) * 2
        assert time not in rate.free_symbols
        size *= np.abs(cra.mode_shapes(system, modes=2, damped=True)[1])

        def rates(_, y, s=given):
            (a, b, u, v), spring = y, 2.0 + 0.5 * (y[0] ** 2 + y[1] ** 2)
            one = -spring * a + 0.7 * v - s["n"] * b - 0.4 * a**2 * u - 0.2 * a**2
            return [u, v, one, -spring * b - 0.7 * u + s["n"] * a - 0.2 * b * u]

        until = 12.0 / growth + 40.0
        times = until - np.linspace(3.5, 0.0, 4001)
        run = solve_ivp(rates, (0.0, until), [size, 0.0, 0.0, -1.7 * size], "DOP853", times, rtol=1e-9, atol=1e-12)
        last = run.y[0]
        errors.append(abs(0.5 * np.ptp(last) / size - 1))
    assert errors[0] < 0.05 and errors[1] < 0.7 * errors[0], errors


def test_a_primary_resonance_converges_with_the_size_of_the_excitation():
    """Damping and detuning of order e, amplitudes of order sqrt(e): the relative error is of order e."""
    w = sp.Function("w")(t)
    carried = MOVES.subs(p.diff(t), (p + w).diff(t)) - RING
    work = [(-d * one.diff(t), one, None) for one in (p, q)]
    model = cra.Model(0, left=carried, virtual_work=work, prescribed=[w], **LUMPED)
    flow, sigma, a, errors = model.slow_flow(2), sp.Symbol("sigma", real=True), sp.Symbol("a", positive=True), []
    for e in (0.04, 0.02, 0.01):
        system, size = model.at({"g": 0.7, "k": 2.0, "k_3": 0.5, "d": 0.2 * e}), 0.3 * e**1.5
        omega = cra.eigenvalues(system, 2)[1].imag
        tip = np.abs(cra.mode_shapes(system, modes=2, damped=True)[1])
        force = 2 * omega * cra.forced_width(system, cra.TransverseBase(size), 2)[1] / tip
        ((*_, state),) = cra.steady_states(system, [omega + 0.2 * e], drive={w: size}, modes=2)
        values = cra.slow_flow_values(flow, system) | {sp.Symbol("f_2", real=True): force, sigma: 0.2 * e}
        difference = (flow.response.lhs - flow.response.rhs).subs(values)
        errors.append(abs(state.amplitude / (tip * float(sp.nsolve(difference / a, a, state.amplitude / tip))) - 1))
    assert (np.abs(np.log2(np.array(errors[:-1]) / errors[1:]) - 1) < 0.35).all(), errors


def test_internal_resonance_exchanges_energy_as_time_integration_says():
    """The second mode at twice the frequency: the full equations, seen by the left vectors of their matrix."""
    spring = 1.0
    other = sp.nsolve(  # squares of frequencies add up to k_1 + k_2 + g^2, their product is k_1 k_2
        sp.Symbol("z") + spring + 0.25 - 2.5 * sp.sqrt(spring * sp.Symbol("z")), 5.0
    )
    energy = k * p**2 / 2 + n * q**2 / 2 + k_2 * (p + 0.3 * q) ** 3 / 3
    system = cra.Model(0, left=MOVES - energy, **LUMPED).at({"g": 0.5, "k": spring, "n": float(other), "k_2": 0.6})
    s = cra.eigenvalues(system, 2)
    assert s[1].imag == pytest.approx(2 * s[0].imag, rel=1e-9)
    flow = system.model.slow_flow(("internal", 1, 2, 2))
    values = cra.slow_flow_values(flow, system)
    amplitudes = [equation.lhs.args[0] for equation in flow.amplitude_equations]
    names, conj = sp.symbols("z_1:3"), sp.symbols("w_1:3")
    put = {sp.conjugate(a): w for a, w in zip(amplitudes, conj, strict=True)} | dict(
        zip(amplitudes, names, strict=True)
    )
    sigma = sp.Symbol("sigma", real=True)
    slow = [equation.rhs.xreplace(put).subs({**values, sigma: 0.0}) for equation in flow.amplitude_equations]
    rate = sp.lambdify((*names, *conj), slow)
    shapes = np.array([cra.mode_shapes(system, modes=2, field=one, damped=True) for one in (p, q)])
    right = np.concatenate([shapes, shapes * s])
    start = 0.02 * np.array([1.0, 0.4])

    def full(_, y):
        push = 0.6 * (y[0] + 0.3 * y[1]) ** 2
        return [y[2], y[3], -spring * y[0] + 0.5 * y[3] - push, -float(other) * y[1] - 0.5 * y[2] - 0.3 * push]

    end = solve_ivp(full, (0.0, 120.0), 2 * (right @ start).real, "DOP853", rtol=1e-10, atol=1e-13).y[:, -1]
    matrix = np.array([[0, 0, 1, 0], [0, 0, 0, 1], [-spring, 0, 0, 0.5], [0, -float(other), -0.5, 0]], dtype=float)
    roots, left, _ = eig(matrix, left=True, right=True)
    tests = [left[:, np.abs(roots - one).argmin()].conj() for one in s]
    found = [test @ end / (test @ right[:, mode]) for mode, test in enumerate(tests)]
    run = solve_ivp(lambda _, z: rate(*z, *z.conj()), (0.0, 120.0), start.astype(complex), rtol=1e-9, atol=1e-12).y[
        :, -1
    ]
    np.testing.assert_allclose(np.abs(run), np.abs(found), atol=0.04 * start[0])  # of second order in the amplitude
    assert abs(np.abs(run[0]) / start[0] - 1) > 0.1  # energy did go


def test_what_the_flow_of_complex_modes_does_not_take_is_refused():
    model = cra.Model(0, left=MOVES - RING + n * p * q.diff(t) ** 2, **LUMPED)
    system = model.at({"g": 0.7, "k": 2.0, "k_3": 0.5, "n": 0.1})
    flow = model.slow_flow(("free", 1))
    with pytest.raises(ValueError, match=r"terms of third degree with velocities, .*use steady_states"):
        cra.slow_flow_values(flow, system)
    for resonance in ((1, 1), ("superharmonic", 1, 3)):
        with pytest.raises(ValueError, match=r"resonance = .*: must be n, \('free', n\) or \('internal', m, n, k\)"):
            model.slow_flow(resonance)
    with pytest.raises(ValueError, match="order = 2: must be 1 without natural modes"):
        model.slow_flow(("free", 1), order=2)
    plain = cra.Model(0, left=MOVES - RING, **LUMPED)
    flow, given = plain.slow_flow(("free", 1)), {"g": 0.7, "k": 2.0, "k_3": 0.5}
    with pytest.raises(ValueError, match="zeta: must be 0 where modes are complex"):
        cra.slow_flow_values(flow, plain.at(given, zeta=0.01))
    with pytest.raises(ValueError, match="system has the batch shape"):
        cra.slow_flow_values(flow, plain.at(given | {"k": [1.0, 2.0]}))
