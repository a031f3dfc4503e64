"""The compiled path of a kernel gives what NumPy gives, and steps aside where it cannot."""

from __future__ import annotations

import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest
import sympy as sp

from cra_sym.kernels import Kernel, has_compiler, kernel, lanes

x, a = sp.symbols("x a")
compiler_only = pytest.mark.skipif(not has_compiler(), reason="llvmlite is an option")
expression = a * sp.sin(x) ** 3 + sp.exp(-x) / (1 + sp.cos(a * x) ** 2)


@pytest.fixture(scope="module")
def pair():
    outputs = {"f": expression, "slope": expression.diff(x), "m": sp.Matrix([[x, 1]])}
    return [kernel(outputs, (x, a), backend=backend) for backend in ("compiled", "numpy")]


def same(got, wanted):
    assert got.keys() == wanted.keys()
    for name in wanted:
        assert np.shape(got[name]) == np.shape(wanted[name])
        np.testing.assert_allclose(got[name], wanted[name], rtol=1e-14, atol=1e-14)


@compiler_only
@pytest.mark.parametrize("shapes", [((50,), (50,)), ((7, 1), (3,)), ((4,), ()), ((), ()), ((0,), ())])
def test_both_paths_agree(pair, shapes):
    rng = np.random.default_rng(2)
    values = [rng.uniform(0, 9, shape) for shape in shapes]
    same(*(f(*values) for f in pair))


@compiler_only
def test_threads_change_nothing(pair, monkeypatch):
    values = np.linspace(0, 30, 1001), np.linspace(0, 1, 1001)[::-1]
    one = pair[0](*values)
    monkeypatch.setattr(lanes, "_SPAN", 100)
    monkeypatch.setattr(lanes, "_WORTH", 1e-9)
    monkeypatch.setattr("cra_sym.kernels.lanes.processors", lambda: 3)
    several = pair[0](*values)
    for name in one:
        np.testing.assert_array_equal(one[name], several[name])


@compiler_only
def test_arguments_beyond_the_reduction_are_left_to_numpy(pair):
    values = np.array([0.5, 3e6, 1e15, np.inf]), 2.0
    same(*(f(*values) for f in pair))


@compiler_only
def test_a_comparison_hides_no_lost_lane():
    step = sp.Piecewise((1, sp.sin(x) > 0), (2, True))
    values = np.array([0.5, 4.0, 3e6, 3e6 + 3])
    got = [kernel(step, (x,), backend=backend)(values) for backend in ("compiled", "numpy")]
    np.testing.assert_array_equal(*got)
    assert {1.0, 2.0} == set(got[0])


@compiler_only
def test_conditions_compile():
    branches = (sp.sin(x) / x, sp.Ne(x, 0) & (a > 0)), (sp.Max(x, a, 1), (x < 5) | ~(a > -9)), (sp.Abs(a), True)
    odd = sp.Piecewise(*branches)
    values = np.array([0.0, 1, 1, 9, 2]), np.array([2.0, 1, -1, -1, np.nan])
    np.testing.assert_allclose(*(kernel(odd, (x, a), backend=b)(*values) for b in ("compiled", "numpy")), rtol=1e-15)


@pytest.mark.parametrize("odd", [sp.erf(x), sp.I * x, sp.sqrt(x) + 0 * a])
def test_what_has_no_machine_code_goes_to_numpy(odd):
    values = np.array([0.25, 4.0]) if odd.has(sp.erf, sp.I) else np.array([0.25 + 1j, 4.0])
    got = [kernel(odd, (x,), backend=backend)(values) for backend in ("compiled", "numpy")]
    np.testing.assert_array_equal(*got)


def test_what_the_compiler_refuses_goes_to_numpy():
    source = "from numpy import sort_complex\n\nARGUMENTS = ('x',)\nLAYOUT = ()\n\n\ndef evaluate(x):\n"
    f = Kernel(f"{source}    return sort_complex(x).real\n", ("x",), "compiled")
    np.testing.assert_array_equal(f([2.0, 1.0]), [1.0, 2.0])


@pytest.fixture
def compilations(monkeypatch):
    """Kernels in the order in which they were compiled, by a process that knows none yet and compiles early."""
    found, compile = [], lanes._compiled
    monkeypatch.setattr(lanes, "_loops", {})
    monkeypatch.setattr(lanes, "COMPILE_FROM", 10)
    monkeypatch.setattr(lanes, "_compiled", lambda kernel, *rest: found.append(kernel) or compile(kernel, *rest))
    return found


@compiler_only
def test_the_lanes_of_all_calls_add_up(compilations):
    counts = []
    for size in (4, 5, 1, 1, 50):
        np.testing.assert_array_equal(kernel(x + 1, (x,))(np.ones(size)), 2.0)  # equal kernels, made anew
        counts.append(len(compilations))
    assert counts == [0, 0, 1, 1, 1]


@compiler_only
def test_what_stays_below_the_number_of_lanes_is_never_compiled(compilations):
    f = kernel(x * a, (x, a))
    f(np.ones(9), np.ones(9))  # arrays and numbers in this order: a pattern of its own
    f(np.ones(9), 1.0)
    f(1.0, np.ones(9))
    for _ in range(9):
        f(1.0, 1.0)
    f(np.ones(99), 1j)
    f(np.ones(0), np.ones(0))
    kernel(x * a, (x, a), backend="numpy")(np.ones(99), np.ones(99))
    assert not compilations
    f(1.0, 1.0)
    assert compilations == [f]


@compiler_only
def test_long_sources_wait_for_more_lanes(compilations, monkeypatch):
    f = kernel(x + 2, (x,))
    monkeypatch.setattr(lanes, "_SHORT", len(f.source) / 2)
    f(np.ones(39))
    assert not compilations
    f(1.0)
    f([1.0])
    assert compilations == [f]


@compiler_only
@pytest.mark.parametrize(
    "slow", [x**a, sp.sqrt(x) ** 3 / sp.atan(x), sp.Mod(x, a), sp.Piecewise((sp.sin(x), x > 1), (a, True)), sp.cbrt(x)]
)
def test_what_machine_code_does_no_faster_is_compiled_on_request(compilations, slow):
    values = np.linspace(1.0, 9.0, 50), np.full(50, 3.0)
    default, asked = kernel(slow, (x, a)), kernel(slow, (x, a), backend="compiled")
    np.testing.assert_allclose(default(*values), asked(*values), rtol=8 * 2.0**-52)
    assert [lanes._loops[f.digest, (True, True)].fill is None for f in (default, asked)] == [True, False]


@compiler_only
@pytest.mark.parametrize("quick", [sp.pi * sp.Max(x, sp.sqrt(a)) + sp.Abs(x) * sp.log(a), sp.Heaviside(x - a) * sp.E])
def test_what_becomes_simd_code_is_compiled(compilations, quick):
    kernel(quick, (x, a))(np.ones(50), 2.0)
    assert len(compilations) == 1
    assert all(loop.fill for loop in lanes._loops.values())


@compiler_only
def test_the_second_call_with_many_lanes_is_machine_code(monkeypatch):
    f, values = kernel(sp.cos(x) * sp.exp(-a), (x, a)), np.linspace(0.0, 9.0, lanes.COMPILE_FROM)
    first = f(values, values)
    monkeypatch.setattr(Kernel, "_by_numpy", None)
    np.testing.assert_array_equal(f(values, values), first)


@compiler_only
def test_threads_that_call_at_once_compile_once(compilations):
    f, values = kernel(sp.sin(x) / (x + 3), (x,)), np.linspace(0.0, 9.0, 7)
    interval = sys.getswitchinterval()
    sys.setswitchinterval(1e-6)
    try:
        with ThreadPoolExecutor(4) as pool:
            found = list(pool.map(lambda _: f(values), range(40)))
    finally:
        sys.setswitchinterval(interval)
    assert compilations == [f]
    np.testing.assert_allclose(found, np.broadcast_to(np.sin(values) / (values + 3), (40, 7)), rtol=4 * 2.0**-52)


@compiler_only
def test_inputs_of_any_kind_share_one_loop(compilations):
    f, values = kernel(2 * x, (x,), backend="compiled"), np.arange(8.0)
    frozen, bytes_ = values.copy(), b"." + values.tobytes()
    frozen.flags.writeable = False
    for given in (values, frozen, values[::2], values[::-1], np.frombuffer(bytes_, offset=1), values.astype(int)):
        np.testing.assert_array_equal(f(given), 2 * given)
    assert compilations == [f]
    assert values.flags.writeable
    (loop,) = lanes._loops.values()
    assert len(loop.fill.origins) == 1


@compiler_only
def test_many_lost_lanes_are_left_to_numpy_with_numbers_beside_them():
    f = [kernel((sp.sin(x) * a, sp.cos(x)), (x, a), backend=backend) for backend in ("compiled", "numpy")]
    values, state = np.linspace(9e5, 3e6, 20_000), np.geterr()
    np.testing.assert_allclose(f[0](values, 2.0), f[1](values, 2.0), rtol=4 * 2.0**-52)
    assert np.geterr() == state


def test_a_few_small_calls_load_no_compiler():
    code = (
        "import sys; import numpy as np, sympy as sp\n"
        "from cra_sym.kernels import kernel\n"
        "x = sp.Symbol('x')\n"
        "for _ in range(99):\n"
        "    kernel(sp.sin(x), (x,))(np.ones(100)), kernel(sp.sin(x), (x,))(1.0)\n"
        "print('llvmlite' in sys.modules)"
    )
    run = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert run.stdout.split() == ["False"]


def test_without_a_compiler_everything_runs():
    code = (
        "import sys; sys.modules['llvmlite'] = None\n"
        "import sympy as sp, numpy as np\n"
        "from cra_sym.kernels import kernel, has_compiler, lanes\n"
        "x = sp.Symbol('x'); lanes.COMPILE_FROM = 1\n"
        "values = np.linspace(0, 1, 20000)\n"
        "for backend in (None, 'compiled', 'numpy'):\n"
        "    assert np.allclose(kernel(sp.sin(x), (x,), backend=backend)(values), np.sin(values))\n"
        "print(has_compiler())"
    )
    run = subprocess.run([sys.executable, "-W", "error", "-c", code], capture_output=True, text=True, check=True)
    assert run.stdout.split() == ["False"]
