"""Unit responses against the matrix exponential at 60 digits, at and around every limit; and (33), (34)."""

import mpmath
import numpy as np
import pytest
import sympy as sp

import cra_sym as cra
from cra_sym.kernels import derived_kernel
from cra_sym.model.oscillator import convolution, impulse_response, modal_operator, unit_responses
from cra_sym.symbols import symbol

FREE = derived_kernel("cra_sym.model.oscillator:free_kernel", backend="numpy")
FORCED = derived_kernel("cra_sym.model.oscillator:forced_kernel", backend="numpy")
t, omega, zeta, varpi = (symbol(name) for name in ("t", "omega_i", "zeta_i", "varpi"))


def exact(time, frequency, ratio, rate):
    """Return the unit responses by the exponential of one matrix that holds oscillator, clock and harmonic."""
    with mpmath.workdps(60):
        time, frequency, ratio, rate = map(mpmath.mpf, map(float, (time, frequency, ratio, rate)))
        matrix = mpmath.zeros(6)  # q, q', 1, t, cos, sin
        matrix[0, 1], matrix[1, 0], matrix[1, 1] = 1, -(frequency**2), -2 * ratio * frequency
        matrix[3, 2], matrix[4, 5], matrix[5, 4] = 1, -rate, rate
        values = {}
        for name, cause, start in [("step", 2, 2), ("ramp", 3, 2), ("cos", 4, 4), ("sin", 5, 4)]:
            driven = matrix.copy()
            driven[1, cause] = 1
            values[name] = mpmath.expm(driven * time)[0, start]
        free = mpmath.expm(matrix * time)
        return values | {"displacement": free[0, 0], "impulse": free[0, 1]}


def cases():
    rng = np.random.default_rng(7)
    for _ in range(32):
        frequency, time = 10 ** rng.uniform(-6, 2.5), 10 ** rng.uniform(-4, 1)
        ratio = rng.choice([0.0, 0.0, 0.01, 0.3, 0.99, 1 - 1e-9, 1 - 1e-13])
        damped = frequency * np.sqrt(1 - ratio**2)
        near = [
            damped,
            frequency * (1 + 1e-9),
            frequency * (1 - 1e-5),
            10 ** rng.uniform(-6, 2.5),
            0.5 / time,
            1.01 / time,
        ]
        yield time, frequency, ratio, rng.choice(near)
    yield from [(2.0, 0.0, 0.0, 10.0), (2.0, 0.0, 0.5, 0.1), (0.0, 3.0, 0.1, 3.0), (2.0, 5.0, 0.02, 0.0)]
    yield from [(1.0, 1.9, 0.99, 0.9), (1.0, 0.9, 0.99, 1.9)]  # angles for which the series would be too short


@pytest.mark.parametrize("case", list(cases()), ids=map(str, range(38)))
def test_the_kernels_are_exact_at_and_around_every_limit(case):
    time, frequency, _, rate = case
    truth, found = exact(*case), FREE(*case[:3])
    harmonic = FORCED(*case)
    scale = {"displacement": 1.0, "impulse": time, "step": time**2, "ramp": time**3}
    if frequency * time > 1:
        scale = {"displacement": 1.0, "impulse": 1 / frequency, "step": 1 / frequency**2, "ramp": time / frequency**2}
    scale["cos"] = scale["sin"] = abs(complex(float(truth["cos"]), float(truth["sin"])))
    found = found | {"cos": harmonic.real, "sin": harmonic.imag}
    # an angle of phi radians is known to phi units in the last place
    tolerance = 1e-15 * (1 + (frequency + rate) * time)
    for name, value in truth.items():
        assert abs(float(found[name] - value)) <= tolerance * scale[name] + 1e-300, name


def test_the_unit_responses_solve_the_modal_equation():
    """A second route: put into (11) at random rational values, with their initial values."""
    unit, q = unit_responses()._asdict(), sp.Function("q")(t)
    causes = {"displacement": 0, "impulse": 0, "step": 1, "ramp": t, "harmonic": sp.exp(sp.I * varpi * t)}
    numbers = {omega: sp.Rational(7, 3), zeta: sp.Rational(2, 9), varpi: sp.Rational(11, 5)}
    with mpmath.workdps(40):
        for name, cause in causes.items():
            response = sp.lambdify(t, unit[name].subs(numbers), "mpmath")
            jets = {q.diff(t, k): sp.sympify(mpmath.diff(response, 2, k)) for k in (2, 1, 0)}
            residual = (modal_operator(q) - cause).subs(jets).subs(numbers).subs(t, 2)
            assert abs(complex(residual)) < 1e-12, name
            start = [complex(mpmath.diff(response, mpmath.mpf(10) ** -30, k)) for k in (0, 1)]
            assert start == pytest.approx({"displacement": [1, 0], "impulse": [0, 1]}.get(name, [0, 0]), abs=1e-9)


def test_at_resonance_the_secular_term_comes_out():
    forced = sp.I * omega
    assert convolution(forced, forced).subs(t, 5) == 5 * sp.exp(5 * forced)
    time, frequency = 3.0, 7.0
    secular = (np.sin(frequency * time) - frequency * time * np.cos(frequency * time)) / (2 * frequency**2)
    assert FORCED(time, frequency, 0.0, frequency).imag == pytest.approx(secular, rel=1e-14)


def test_the_convolution_is_the_integral():
    a, b = -sp.Rational(1, 3), sp.I * 2
    integral = mpmath.quad(lambda tau: mpmath.exp(-(2 - tau) / 3 + 2j * tau), [0, 2])
    assert abs(complex(convolution(a, b).subs(t, 2)) - complex(integral)) < 1e-14


def test_the_impulse_response_is_entire_in_the_damped_frequency():
    assert impulse_response(sp.Integer(2), sp.Integer(0)).doit() == t * sp.exp(-2 * t)


@pytest.mark.parametrize("number", [33, 34])
def test_the_numbered_equations_hold(number):
    assert cra.equation(number).check()
