"""The compiled path of a kernel gives what NumPy gives, and steps aside where it cannot."""

from __future__ import annotations

import subprocess
import sys

import numpy as np
import pytest
import sympy as sp

from cra_sym.kernels import Kernel, has_compiler, kernel, lanes

x, a = sp.symbols("x a")
numba_only = pytest.mark.skipif(not has_compiler(), reason="Numba is an option")
expression = a * sp.sin(x) ** 3 + sp.exp(-x) / (1 + sp.cos(a * x) ** 2)


@pytest.fixture(scope="module")
def pair():
    outputs = {"f": expression, "slope": expression.diff(x), "m": sp.Matrix([[x, 1]])}
    return [kernel(outputs, (x, a), backend=backend) for backend in ("numba", "numpy")]


def same(got, wanted):
    assert got.keys() == wanted.keys()
    for name in wanted:
        assert np.shape(got[name]) == np.shape(wanted[name])
        np.testing.assert_allclose(got[name], wanted[name], rtol=1e-14, atol=1e-14)


@numba_only
@pytest.mark.parametrize("shapes", [((50,), (50,)), ((7, 1), (3,)), ((4,), ()), ((), ()), ((0,), ())])
def test_both_paths_agree(pair, shapes):
    rng = np.random.default_rng(2)
    values = [rng.uniform(0, 9, shape) for shape in shapes]
    same(*(f(*values) for f in pair))


@numba_only
def test_threads_change_nothing(pair, monkeypatch):
    values = np.linspace(0, 30, 1001), np.linspace(0, 1, 1001)[::-1]
    one = pair[0](*values)
    monkeypatch.setattr(lanes, "_SPAN", 100)
    monkeypatch.setattr("numba.config.NUMBA_NUM_THREADS", 3)
    several = pair[0](*values)
    for name in one:
        np.testing.assert_array_equal(one[name], several[name])


@numba_only
def test_arguments_beyond_the_reduction_are_left_to_numpy(pair):
    values = np.array([0.5, 3e6, 1e15, np.inf]), 2.0
    same(*(f(*values) for f in pair))


@numba_only
def test_a_comparison_hides_no_lost_lane():
    step = sp.Piecewise((1, sp.sin(x) > 0), (2, True))
    values = np.array([0.5, 4.0, 3e6, 3e6 + 3])
    got = [kernel(step, (x,), backend=backend)(values) for backend in ("numba", "numpy")]
    np.testing.assert_array_equal(*got)
    assert {1.0, 2.0} == set(got[0])


@numba_only
def test_conditions_compile():
    branches = (sp.sin(x) / x, sp.Ne(x, 0) & (a > 0)), (sp.Max(x, a, 1), (x < 5) | ~(a > -9)), (sp.Abs(a), True)
    odd = sp.Piecewise(*branches)
    values = np.array([0.0, 1, 1, 9, 2]), np.array([2.0, 1, -1, -1, np.nan])
    np.testing.assert_allclose(*(kernel(odd, (x, a), backend=b)(*values) for b in ("numba", "numpy")), rtol=1e-15)


@pytest.mark.parametrize("odd", [sp.erf(x), sp.I * x, sp.sqrt(x) + 0 * a])
def test_what_is_not_for_numba_goes_to_numpy(odd):
    values = np.array([0.25, 4.0]) if odd.has(sp.erf, sp.I) else np.array([0.25 + 1j, 4.0])
    got = [kernel(odd, (x,), backend=backend)(values) for backend in ("numba", "numpy")]
    np.testing.assert_array_equal(*got)


def test_what_numba_refuses_goes_to_numpy():
    source = "from numpy import sort_complex\n\nARGUMENTS = ('x',)\nLAYOUT = ()\n\n\ndef evaluate(x):\n"
    f = Kernel(f"{source}    return sort_complex(x).real\n", ("x",), "numba")
    np.testing.assert_array_equal(f([2.0, 1.0]), [1.0, 2.0])


@numba_only
def test_only_large_inputs_are_compiled(monkeypatch):
    f, used = kernel(x + 1, (x,)), []
    monkeypatch.setattr(lanes, "evaluated", lambda kernel, arrays, shape, n: used.append(shape) or [np.zeros(shape)])
    monkeypatch.setattr(lanes, "COMPILE_FROM", 10)
    assert f(np.ones(9))[0] == 2 and not used
    f(np.ones(10))
    assert used == [(10,)]


def test_without_numba_everything_runs():
    code = (
        "import sys; sys.modules['numba'] = None\n"
        "import sympy as sp, numpy as np\n"
        "from cra_sym.kernels import kernel, has_compiler, lanes\n"
        "x = sp.Symbol('x'); lanes.COMPILE_FROM = 1\n"
        "values = np.linspace(0, 1, 20000)\n"
        "for backend in (None, 'numba', 'numpy'):\n"
        "    assert np.allclose(kernel(sp.sin(x), (x,), backend=backend)(values), np.sin(values))\n"
        "print(has_compiler())"
    )
    run = subprocess.run([sys.executable, "-W", "error", "-c", code], capture_output=True, text=True, check=True)
    assert run.stdout.split() == ["False"]
