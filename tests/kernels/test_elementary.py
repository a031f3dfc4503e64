"""The branch-free functions against correctly rounded ones."""

from __future__ import annotations

import math

import mpmath
import numpy as np
import pytest

from cra_sym.kernels import compiled, elementary, has_compiler

BOUNDS = {"sin": 2, "cos": 2, "tan": 4, "exp": 2, "sinh": 2, "cosh": 2, "tanh": 4, "log": 2}  # as `kernel` says
TEMPLATE = """
def fill(out, x):
    for lane in range(out.size):
        out[lane] = {name}(x[lane])
"""


def points(name, count):
    rng = np.random.default_rng(3)
    if name == "log":
        near = 1 + rng.uniform(-1e-6, 1e-6, count)
        return np.concatenate([10.0 ** rng.uniform(-323, 308, count), rng.uniform(0.5, 2, count), near, [5e-324]])
    if name in ("exp", "sinh", "cosh", "tanh"):
        limits = {"exp": 709.7, "tanh": 25.0}.get(name, 710.4)
        small = [rng.uniform(-limit, limit, count) for limit in (3, 1)]
        return np.concatenate([rng.uniform(-min(limits, 708), limits, count), *small, [0.0, -0.0, 1e-300, 1e-320]])
    poles = np.arange(1, count) * (math.pi / 2)  # next to the zeros of sine and cosine
    return np.concatenate([rng.uniform(-4000, 4000, count), rng.uniform(-2, 2, count), poles, [0.0, 1e-300, 9.9e5]])


def worst_error(name, x, values):
    """Return the largest error in units in the last place."""
    with mpmath.workdps(40):
        exact = [getattr(mpmath, name)(mpmath.mpf(float(v))) for v in x]
        return max(
            float(abs(mpmath.mpf(float(value)) - true) / math.ulp(float(true)))
            for value, true in zip(values, exact, strict=True)
        )


@pytest.mark.parametrize("name", BOUNDS)
def test_plain_python_is_accurate(name):
    x = points(name, 400)
    assert worst_error(name, x, [getattr(elementary, name)(v) for v in x]) < BOUNDS[name]


@pytest.mark.skipif(not has_compiler(), reason="llvmlite is an option")
@pytest.mark.parametrize("name", BOUNDS)
def test_compiled_code_is_accurate(name):
    x = points(name, 2500)
    out = np.empty_like(x)
    compiled(TEMPLATE.format(name=name), {}).fill(out, x)
    assert worst_error(name, x, out) < BOUNDS[name]


def test_extremes_of_the_exponential():
    with np.errstate(over="ignore", under="ignore"):
        for x, exact in ((-np.inf, 0), (np.inf, np.inf), (-800.0, 0), (710.0, np.inf), (0.0, 1)):
            assert elementary.exp(np.float64(x)) == exact
    assert elementary.exp(np.float64(-745.0)) == math.exp(-745.0)  # subnormal
    assert elementary.exp(np.float64(709.78)) == pytest.approx(math.exp(709.78), rel=3e-16)
    assert math.isnan(elementary.exp(np.float64(np.nan)))


@pytest.mark.parametrize("name", ["sinh", "cosh", "tanh", "log", "sin", "tan"])
@pytest.mark.parametrize("x", [0.0, -0.0, np.inf, -np.inf, np.nan, 711.0, -711.0, -1.0, 5e-324, -5e-324])
def test_extremes_of_the_others(name, x):
    with np.errstate(all="ignore"):
        got, wanted = getattr(elementary, name)(np.float64(x)), getattr(np, name)(x)
    assert got == pytest.approx(wanted, rel=1e-15, abs=0.0, nan_ok=True)
    assert np.isnan(wanted) or math.copysign(1.0, got) == math.copysign(1.0, wanted)


@pytest.mark.parametrize("x", [np.nan, np.inf, -np.inf, 1.1e6, -1e300])
def test_no_sine_where_there_is_no_reduction(x):
    with np.errstate(invalid="ignore"):
        assert math.isnan(elementary.sin(np.float64(x)))
        assert math.isnan(elementary.cos(np.float64(x)))


def test_parts_of_the_constants_are_exact():
    with mpmath.workdps(60):
        parts = [1.5707963267341256, 6.077100506303966e-11, 2.0222662487959506e-21]
        assert abs(sum(map(mpmath.mpf, parts)) - mpmath.pi / 2) < mpmath.mpf(2) ** -120
        logarithm = [0.6931471803691238, 1.9082149292705877e-10]
        assert abs(sum(map(mpmath.mpf, logarithm)) - mpmath.log(2)) < mpmath.mpf(2) ** -84
    for part in (*parts[:2], logarithm[0]):  # products with 20 bits of quotient are exact
        mantissa, _ = math.frexp(part)
        assert (mantissa * 2**33).is_integer()
