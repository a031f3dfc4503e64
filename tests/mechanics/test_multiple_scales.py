"""Multiple scales: the derivation itself, against series known from elsewhere."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
from scipy.special import ellipk, mathieu_a, mathieu_b
from sympy import (
    Function,
    I,
    IndexedBase,
    Matrix,
    Rational,
    S,
    Symbol,
    diag,
    expand,
    lambdify,
    series,
    simplify,
    sqrt,
    symbols,
)

from cra_sym.mechanics.multiple_scales import multiple_scales
from cra_sym.mechanics.parametric import ParametricResonance
from cra_sym.mechanics.two_scales import EPSILON

OMEGA, P, ZETA, SLOPE = (IndexedBase(name) for name in ("omega", "P", "zeta", "dP"))
m, n = symbols("m n", integer=True, positive=True)
w, p, q = symbols("w p q", positive=True)


def mathieu_error(tongue: int, coefficient, upper: bool):
    """Put the boundary into a = 4 w^2 / varpi^2, q = 2 epsilon p / varpi^2 and compare with the series of a(q)."""
    result = multiple_scales([w], Matrix([[p]]), (1, 1), order=2, tongue=tongue)
    varpi = result.explicit(result.boundary[upper])
    a, strength = 4 * w**2 / varpi**2, 2 * EPSILON * p / varpi**2
    return simplify(series(a - coefficient(strength), EPSILON, 0, 3).removeO())


def test_first_tongue_is_mathieus_series():
    assert mathieu_error(1, lambda s: 1 + s - s**2 / 8, upper=False) == 0
    assert mathieu_error(1, lambda s: 1 - s - s**2 / 8, upper=True) == 0


def test_second_tongue_is_mathieus_series():
    assert mathieu_error(2, lambda s: 4 + 5 * s**2 / 12, upper=False) == 0
    assert mathieu_error(2, lambda s: 4 - s**2 / 12, upper=True) == 0


@pytest.mark.parametrize(("tongue", "lower", "upper"), [(1, mathieu_a, mathieu_b), (2, mathieu_a, mathieu_b)])
def test_boundary_against_mathieus_characteristic_values(tongue, lower, upper):
    result = multiple_scales([w], Matrix([[p]]), (1, 1), order=2, tongue=tongue)
    sides = [lambdify((w, p, EPSILON), result.explicit(side)) for side in result.boundary]
    for side, characteristic in zip(sides, (lower, upper), strict=True):
        errors = []
        for epsilon in (0.1, 0.05):
            varpi = side(1.0, 1.0, epsilon)
            errors.append(abs(4 / varpi**2 - characteristic(tongue, 2 * epsilon / varpi**2)))
        assert errors[1] < errors[0] / 2**2.8


def test_first_order_widths():
    """Half-widths written down by hand, undamped and damped."""
    c, d = symbols("c_m c_n", positive=True)
    half = {
        kind: multiple_scales(OMEGA, P, spec).border.half_width
        for kind, spec in {"principal": (n, n), "sum": (m, n), "difference": (m, -n)}.items()
    }
    lam = P[m, n] * P[n, m] / (OMEGA[m] * OMEGA[n])
    assert simplify(half["principal"] ** 2 - (EPSILON * P[n, n] / (2 * OMEGA[n])) ** 2) == 0
    assert simplify(half["sum"] ** 2 - EPSILON**2 * lam / 4) == 0
    assert simplify(half["difference"] ** 2 + EPSILON**2 * lam / 4) == 0
    damped = multiple_scales(OMEGA, P, (m, n), damping=ZETA)
    wanted = (c + d) ** 2 * (EPSILON**2 * lam / (16 * c * d) - 1)
    assert simplify(damped.border.half_width**2 - wanted) == 0
    alone = multiple_scales(OMEGA, P, (n, n), damping=ZETA)
    threshold = alone.explicit(alone.border.threshold)
    assert simplify(threshold**2 - (4 * ZETA[n] * OMEGA[n] ** 2 / P[n, n]) ** 2) == 0


@cache
def general(about, tongue):
    return multiple_scales(OMEGA, P, about, order=2, coupling_slope=SLOPE, damping=ZETA, size=3, tongue=tongue)


@pytest.mark.sample(2, 1)
@pytest.mark.parametrize(("spec", "tongue"), [((2, 2), 1), ((2, 2), 2), ((1, 3), 1), ((3, -1), 2)])
def test_symbolic_number_of_modes_is_the_written_out_system(spec, tongue):
    """The sum over a symbolic number of modes, done for three, is the system of three modes."""
    rng = np.random.default_rng(1)
    freq = [Rational(int(k), 7) for k in (11, 24, 53)]
    coupling = Matrix(3, 3, [Rational(int(k), 5) for k in rng.integers(1, 20, 9)])
    slope = coupling / 3
    direct = multiple_scales(
        freq, coupling, spec, order=2, coupling_slope=slope, damping=[Rational(1, 50)] * 3, tongue=tongue
    )
    about = (m, n * (1 if spec[1] > 0 else -1)) if spec[0] != spec[1] else (n, n)
    symbolic = general(about, tongue)
    labels = {n: abs(spec[1])} | ({m: spec[0]} if spec[0] != spec[1] else {})
    values = {OMEGA[i + 1]: freq[i] for i in range(3)} | {ZETA[i + 1]: Rational(1, 50) for i in range(3)}
    values |= {P[i + 1, j + 1]: coupling[i, j] for i in range(3) for j in range(3)}
    values |= {SLOPE[i + 1, j + 1]: slope[i, j] for i in range(3) for j in range(3)}
    for mine, theirs in zip(symbolic.boundary, direct.boundary, strict=True):
        number = symbolic.explicit(mine).subs(labels).doit().subs(values)
        assert complex((number - direct.explicit(theirs)).subs(EPSILON, 0.7)) == pytest.approx(0, abs=1e-12)


def test_forced_resonance_of_the_transverse_base():
    """A force -M'' w of a base w_1 sin(varpi t): linear growth at the rate omega w_1 Gamma / (4 M)."""
    gamma, mass, w1 = symbols("Gamma M w_1", positive=True)
    result = multiple_scales([w], None, 1, forcing=[-I * gamma * w1 * w**2 / mass])
    assert result.border is None
    equation = result.amplitude_equations[0]
    t, detuning = Symbol("t", real=True), Symbol("Delta", real=True)
    from sympy import exp

    assert simplify(equation.rhs + EPSILON * w * w1 * gamma / (4 * mass) * exp(I * detuning * t)) == 0
    assert simplify(result.response.growth - EPSILON * w * w1 * gamma / (2 * mass)) == 0
    with pytest.raises(ValueError, match="no stability boundary"):
        _ = result.boundary


def test_backbone_is_the_duffing_oscillators():
    """Detuning of the free amplitude against the exact period, an elliptic integral."""
    cubic = symbols("g", positive=True)
    result = multiple_scales([w], None, 1, forcing=[symbols("f", positive=True)], cubic=[cubic])
    a = Symbol("a", positive=True)
    backbone = lambdify((w, cubic, EPSILON, a), result.response.backbone.rhs)
    errors = []
    for epsilon in (0.1, 0.05):
        strength = epsilon * 2.0 * 0.5**2
        parameter = strength / (2 * (1.5**2 + strength))
        exact = np.pi * np.sqrt(1.5**2 + strength) / (2 * ellipk(parameter)) - 1.5
        errors.append(abs(backbone(1.5, 2.0, epsilon, 0.5) - exact))
    assert errors[1] < errors[0] / 3.5


def test_steps_follow_the_textbook():
    result = general((m, n), 1)
    names = [step.name for step in result.steps]
    assert names[:7] == [
        "expansion",
        "operators",
        "order 0",
        "order 1",
        "free vibration",
        "detuning",
        "excitation in exponentials",
    ]
    for step in result.steps:
        assert set(step.derived_from) <= set(names[: names.index(step.name)])
        assert step._repr_latex_().startswith("$")
    assert result.step("boundary").expression[0].rhs == result.boundary[0]
    assert "varpi" in result._repr_latex_()
    with pytest.raises(ValueError, match="must be one of 'expansion'"):
        result.step("conclusion")


def test_free_vibration_solves_its_problem_and_the_rates_leave_no_secular_term():
    """Put the solution of order 1 back: the driven part is bounded and solves the equation."""
    from cra_sym.mechanics.parametric import ParametricSystem
    from cra_sym.mechanics.two_scales import TwoScaleExpansion, amplitude, conjugate_amplitude

    about = ParametricResonance.of((1, 2))
    system = ParametricSystem.of(about, symbols("w_1:4", positive=True), Matrix(3, 3, symbols("p:3:3")))
    expansion = TwoScaleExpansion(system, about, 2)
    frozen = {f(3): 0 for f in (amplitude, conjugate_amplitude)}
    for i in system.rows:
        field = expansion.fields[1][i]
        left = field.fast(system.omegas).fast(system.omegas) + field * system.omega(i) ** 2
        rest = left + expansion.right_sides[0][i] * -1
        for (vector, _), c in rest.terms.items():
            if vector not in (expansion.unit(i), expansion.unit(i, -1)):
                assert simplify(c.xreplace(expansion.receptances).subs(frozen)) == 0


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: multiple_scales([w], Matrix([[p]]), (1, 1), order=3), "order = 3"),
        (lambda: multiple_scales([w], Matrix([[p]]), (1, 1), tongue=3), "tongue = 3"),
        (lambda: multiple_scales([w], Matrix([[p]]), (1, 1), tongue=2), "appears at order 2"),
        (lambda: multiple_scales([w], Matrix([[p]]), (1, 2)), "mode 2: must be a mode from 1 to 1"),
        (lambda: multiple_scales([w], Matrix([[p]]), (1, -1)), "difference of a mode with itself"),
        (lambda: multiple_scales([w], Matrix([[p]]), (0, 1)), "modes counted from 1"),
        (lambda: multiple_scales([w], Matrix([[p]]), (1, 1, 1)), "resonance ="),
        (lambda: multiple_scales([w], p, (1, 1)), "1 x 1 Matrix"),
        (lambda: multiple_scales([w, q], diag(p, p), (1, 1), damping=[0]), "sequence of 2"),
        (lambda: multiple_scales([S(1), S(3)], Matrix([[1, 1], [1, 1]]), (1, 1), order=2), "internal resonance"),
        (lambda: multiple_scales([w], Matrix([[p]]), (1, 1), order=2, cubic=[q]), "must be 1"),
        (lambda: multiple_scales(OMEGA, P, (Symbol("j", integer=True, positive=True), n)), "index j"),
    ],
)
def test_bad_input_is_named(call, message):
    with pytest.raises(ValueError, match=message):
        call()


def test_text_is_no_resonance():
    with pytest.raises(TypeError, match="resonance = "):
        multiple_scales([w], Matrix([[p]]), ("1", "1"))


def test_expand_is_not_fooled_by_functions():
    """Couplings may be any expression, such as a function of a parameter."""
    f = Function("f")(q)
    result = multiple_scales([w], Matrix([[f]]), (1, 1))
    assert expand(result.border.half_width**2 - (EPSILON * sqrt(f**2) / (2 * w)) ** 2) == 0
