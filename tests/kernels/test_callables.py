"""Kernels: values, broadcasting, refusals, pickles."""

from __future__ import annotations

import pickle
import subprocess
import sys

import numpy as np
import pytest
import sympy as sp

from cra_sym.kernels import Kernel, has_compiler, kernel, lanes

x, a, b = sp.symbols("x a b")


def test_values_agree_with_sympy_at_high_precision():
    expression = a * x**7 * sp.cos(x) + sp.exp(-x) / x**3 + (a + x) ** 4 - sp.sqrt(a) ** 3 + sp.pi * x**-1
    f = kernel(expression, (x, a))
    for point in ((0.3, 2.0), (1.7, 0.25), (40.0, 3.0)):
        exact = expression.evalf(30, subs=dict(zip((x, a), point, strict=True)))
        assert f(*point) == pytest.approx(float(exact), rel=4e-15)


def test_nothing_is_expanded():
    assert "(x + 1" in kernel(a * (x + 1) * (x + 2), (x, a)).source
    assert "**" not in kernel((x + a) ** 6 + x**-5, (x, a)).source


@pytest.mark.parametrize("shapes", [((), ()), ((4,), ()), ((3, 1), (4,)), ((0,), ()), ((2, 3), (2, 3)), ((9000,), ())])
def test_every_output_has_the_common_shape(shapes):
    f = kernel({"sum": x + a, "one": sp.Integer(1), "x": x, "m": sp.Matrix([[x, 2], [0, a]])}, (x, a))
    rng = np.random.default_rng(1)
    u, v = rng.random(shapes[0]), rng.random(shapes[1])
    got, shape = f(u, v), np.broadcast_shapes(*shapes)
    np.testing.assert_array_equal(got["sum"], u + v)
    assert np.shape(got["one"]) == np.shape(got["x"]) == shape
    assert np.all(got["one"] == 1)
    assert got["m"].shape == (*shape, 2, 2)
    np.testing.assert_array_equal(got["m"][..., 1, 1], np.broadcast_to(v, shape))


def test_scalars_give_floats_and_integers_are_numbers():
    f = kernel(x**-2 + a, (x, a))
    assert isinstance(f(2, 1), float)
    assert f(2, 1) == 1.25
    np.testing.assert_array_equal(f([1, 2], np.int8(1)), [2.0, 1.25])
    assert isinstance(kernel(sp.Integer(3), ())(), float)


def test_outputs_own_their_memory():
    f, values = kernel((x, x), (x,)), np.ones(3)
    first, second = f(values)
    first[0] = 5
    assert values[0] == second[0] == 1


def test_complex_numbers_pass_through():
    assert kernel(sp.I * x**2, (x,))(1 + 1j) == pytest.approx(-2)


def test_large_input_in_blocks_equals_small_input():
    f, values = kernel(sp.sin(x) * a, (x, a)), np.linspace(0, 9, 20001)
    np.testing.assert_array_equal(f(values, 2.0)[-7:], f(values[-7:], 2.0))


def test_sequences_keep_their_nesting():
    got = kernel([x, (a, sp.Matrix([x, a]))], (x, a))(1, 2)
    assert got[:1] == (1.0,)
    assert got[1][0] == 2.0
    np.testing.assert_array_equal(got[1][1], [[1.0], [2.0]])


def test_conditions_and_extremes():
    expression = sp.Piecewise((sp.sin(x) / x, sp.Ne(x, 0) & (a > 0)), (sp.Max(x, a, 1), x < 5))
    f = kernel(expression, (x, a))
    np.testing.assert_allclose(f([0, 1, 1, 9], [2, 1, -1, -1]), [2, np.sin(1), 1, np.nan])


@pytest.mark.parametrize("relation", [sp.StrictLessThan, sp.LessThan])
def test_a_table_of_many_steps(relation):
    """More branches than Python can nest parentheses; two tables share their conditions."""
    places = sp.S(range(1, 151))
    tables = [sp.Piecewise(*((k**n, relation(x, place)) for k, place in enumerate(places)), (-1, True)) for n in (1, 2)]
    at = np.array([-3.0, 0.5, 1.0, 76.0, 76.5, 150.0, 151.0, np.nan])
    k = np.searchsorted(np.arange(1, 151), at, side="right" if relation is sp.StrictLessThan else "left")
    first, second = kernel([table * a for table in tables], (x, a))(at, 1.0)
    np.testing.assert_array_equal(first, np.where(k < 150, k, -1))
    np.testing.assert_array_equal(second, np.where(k < 150, k**2, -1))


def test_no_warning_where_ieee_has_a_value():
    assert kernel(1 / x, (x,))(0.0) == np.inf


@pytest.mark.parametrize(
    "name", ["lambda", "class", "numpy", "cos", "x0", "_", "1", "a b", "print(1)", "γ", "__import__"]
)
def test_any_symbol_name_will_do(name):
    odd = sp.Symbol(name)
    f = kernel(odd * sp.cos(odd) + (x + odd) ** 2 + sp.exp((x + odd) ** 2), (odd, x))
    assert f.arguments == (name, "x")
    assert f(0.5, 1) == pytest.approx(0.5 * np.cos(0.5) + 1.5**2 + np.exp(1.5**2), rel=1e-15)


def test_any_key_will_do():
    key = "a'\n\"; print(1)\n\n\ndef evaluate("
    assert kernel({key: x}, (x,))(2) == {key: 2.0}


FUNCTIONS = [
    *(f(x) for f in (sp.tan, sp.asin, sp.acos, sp.atan, sp.sinh, sp.cosh, sp.tanh, sp.asinh, sp.atanh, sp.log)),
    *(f(x) for f in (sp.sqrt, sp.cbrt, sp.sec, sp.cot, sp.csc, sp.coth, sp.sech, sp.sinc, sp.re)),
    *(f(x) for f in (sp.erf, sp.erfc, sp.gamma, sp.loggamma, sp.factorial, sp.Si)),
    *(f(x, a) for f in (sp.atan2, sp.Max, sp.Min)),
    *(sp.besselj(1, x), sp.acosh(x + 1), sp.log(x, 2), sp.sign(x - a), sp.Abs(x - a), sp.Heaviside(x - a)),
    *(x**a, x**-3, x**100, x ** sp.Rational(-3, 2), sp.root(x, 5), sp.exp(x) ** a, sp.I * x),
    *(
        sp.pi * sp.E * sp.GoldenRatio * x,
        x / 3,
        sp.Rational(10**30, 3) * x,
        sp.Integer(2) ** 70 * x,
        sp.Float("0.1", 30),
    ),
    sp.Piecewise((sp.cos(x), sp.Or(a < x, x > 2)), (2, sp.Not(sp.Ne(a, 1))), (3, True)),
]


@pytest.mark.parametrize("expression", FUNCTIONS, ids=str)
def test_every_kind_of_expression(expression):
    exact = complex(expression.evalf(25, subs={x: 0.3, a: 0.7}))
    assert kernel(expression, (x, a))(0.3, 0.7) == pytest.approx(exact, rel=2e-14)


def test_symbols_that_share_a_name_stay_apart():
    p = sp.Symbol("x", positive=True)
    assert kernel(x - 2 * p, (x, p))(5, 1) == 3


def test_refusals_name_the_culprit():
    w = sp.Function("w")
    with pytest.raises(ValueError, match="not arguments: a, b"):
        kernel(a * b * x, (x,))
    with pytest.raises(ValueError, match="come twice: x"):
        kernel(x, (x, a, x))
    with pytest.raises(TypeError, match=r"w\(x\)"):
        kernel(w(x), (w(x),))
    with pytest.raises(ValueError, match="made of w"):
        kernel(w(x), (x,))
    with pytest.raises(ValueError, match="not arguments: M"):
        kernel(sp.MatrixSymbol("M", 2, 2)[0, 1] * x, (x,))
    with pytest.raises(ValueError, match="not arguments: a"):
        kernel(sp.Integral(sp.exp(a**2), (a, 0, x)), (x,))
    for expression in (sp.Sum(x**a, (a, 0, 3)), sp.Derivative(sp.sin(x), x), sp.Subs(x**2, x, a), sp.DiracDelta(x)):
        with pytest.raises(ValueError, match="no NumPy function"):
            kernel(expression, (x, a))
    with pytest.raises(ValueError, match="out of the range"):
        kernel(10**400 * x, (x,))
    with pytest.raises(TypeError, match="arguments"):
        kernel(x, "x")
    with pytest.raises(TypeError, match="__import__"):
        kernel("__import__('os')", (x,))
    for backend, error in (("fortran", ValueError), (np.zeros(3), TypeError), (3, TypeError)):
        with pytest.raises(error, match=r"^backend = .*must be 'numpy' or 'compiled'"):
            kernel(x, (x,), backend=backend)
    f = kernel(x + a, (x, a))
    with pytest.raises(TypeError, match=r"1 values given, 2 expected: \(x, a\)"):
        f(1)
    for value in ("2", [1.0, [2.0]], None, np.ma.masked_array([1.0, 2.0], mask=[False, True])):
        with pytest.raises(TypeError, match=r"a = .*: must be real or complex numbers"):
            f(1, value)
    for given in (1.0, np.array(1.0), (n for n in range(9))):
        with pytest.raises(TypeError, match=r"^arguments"):
            kernel(x, given)
    endless = []
    endless.append(endless)
    deep = x
    for _ in range(2000):
        deep = sp.Add(deep, 1, evaluate=False)
    for expression in (endless, {"k": endless}, deep):
        with pytest.raises(ValueError, match=r"^expression: it has too many levels"):
            kernel(expression, (x,))
    with pytest.raises(ValueError, match=r"no NumPy function for .*CRootOf"):
        kernel(sp.CRootOf(x**3 - x**2 + 1, 0) * x, (x,))
    with pytest.raises(ValueError, match=r"x \(2,\), a \(3,\)"):
        f([1, 2], [1, 2, 3])
    with pytest.raises(ValueError, match="do not broadcast"):
        f(np.ones((1,) * 40), 1.0)


def test_matrices_without_entries_have_the_shape_of_the_values():
    empty = kernel({"m": sp.Matrix(0, 3, []), "x": x}, (x,))([1.0, 2.0])
    assert empty["m"].shape == (2, 0, 3) and empty["x"].tolist() == [1.0, 2.0]


def test_equality_hash_and_copies_by_content():
    f, g = kernel(x * a, (x, a)), kernel(x * a, (x, a))
    assert f == g and hash(f) == hash(g) and f is not g
    assert f != kernel(x * a, (a, x))
    assert f != kernel(x * a, (x, a), backend="numpy")
    assert pickle.loads(pickle.dumps(f)) == f


def test_a_pickle_runs_in_another_process_without_sympy(tmp_path):
    f = kernel({"y": sp.cos(x) * a}, (x, a))
    (tmp_path / "kernel").write_bytes(pickle.dumps(f))
    code = (
        "import pickle, sys; f = pickle.load(open(sys.argv[1], 'rb'));"
        "print(f(0.5, [1, 2])['y'].tolist(), f.digest); assert 'sympy' not in sys.modules"
    )
    run = subprocess.run([sys.executable, "-c", code, tmp_path / "kernel"], capture_output=True, text=True, check=True)
    assert run.stdout.split("] ")[1].strip() == f.digest
    assert run.stdout.startswith(str(f(0.5, [1, 2])["y"].tolist()))


def test_repr_and_arguments_of_a_hand_made_kernel():
    f = Kernel("ARGUMENTS = ('t',)\nLAYOUT = ()\ndef evaluate(t):\n    return 2*t\n", ("t",))
    assert f(4) == 8
    assert "(t)" in repr(f)


@pytest.mark.parametrize("backend", ["numpy", "compiled"])
def test_signs_and_remainders_on_both_sides_of_zero(backend):
    if backend == "compiled" and not has_compiler():
        pytest.skip("llvmlite is an option")
    values = np.array([-7.3, -3.0, -0.05, 0.0, 0.05, 2.9, 3.0, 7.3])
    made = kernel((sp.sign(x), sp.Mod(x, a)), (x, a), backend=backend)
    assert backend == "numpy" or lanes._compiled(made, [True, False], 2)  # NumPy would take its place without a word
    for divisor in (3.0, -3.0):
        found = made(values, divisor)
        for ours, exact in zip(found, (np.sign(values), np.mod(values, divisor)), strict=True):
            np.testing.assert_array_equal(ours, exact)
