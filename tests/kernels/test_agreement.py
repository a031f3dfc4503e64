"""NumPy and machine code agree within the bound that `kernel` states."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import pytest
import sympy as sp

from cra_sym.kernels import has_compiler, kernel

pytestmark = pytest.mark.skipif(not has_compiler(), reason="llvmlite is an option")

x, a = sp.symbols("x a")
BOUND = 2  # units in the last place between the value of an elementary function and the exact one, on either way,
WIDER = {sp.tan: 4, sp.tanh: 4, sp.cot: 4, sp.coth: 4}  # but for these of machine code
ROUNDING = 2.0**-53
FUNCTIONS = [
    *(sp.sin, sp.cos, sp.exp, sp.tan, sp.asin, sp.acos, sp.atan, sp.sinh, sp.cosh, sp.tanh, sp.asinh, sp.acosh),
    *(sp.atanh, sp.log, sp.sqrt, sp.cbrt, sp.Abs, sp.floor, sp.ceiling),
]
RECIPROCALS = [sp.sec, sp.csc, sp.cot, sp.sech, sp.csch, sp.coth]
POSITIVE = [
    *(0.0, 5e-324, 1e-310, 2.0**-1022, 1e-300, 1e-17, 1e-8, 0.5, 1.0, np.pi / 2, np.pi, 355.0, 708.5, 709.79, 745.2),
    *(746.0, 999999.9, 1e6, 1000000.1, 1e15, 1e22, 2.0**1023, 1.7976931348623157e308, np.inf, np.nan),
]
EDGES = np.array([*POSITIVE, *(-v for v in POSITIVE)])


def points() -> np.ndarray:
    rng = np.random.default_rng(20261130)
    ranges = [rng.uniform(-limit, limit, 4000) for limit in (1.0, 10.0, 700.0, 1e6)]
    zeros = np.arange(1, 2000) * (np.pi / 2)
    return np.concatenate([EDGES, *ranges, zeros, 10.0 ** rng.uniform(-320, 308, 2000)])


def pair(expression: Any, *values: np.ndarray) -> list[Any]:
    arguments = (x, a)[: len(values)]
    return [kernel(expression, arguments, backend=backend)(*values) for backend in ("compiled", "numpy")]


def assert_close(got: np.ndarray, wanted: np.ndarray, units: float) -> None:
    """Assert that values differ by so many units in the last place, and that zeros and infinities have their signs."""
    exceptional = ~np.isfinite(wanted) | (wanted == 0.0)
    np.testing.assert_array_equal(got[exceptional], wanted[exceptional])
    np.testing.assert_array_equal(np.signbit(got[wanted == 0.0]), np.signbit(wanted[wanted == 0.0]))
    got, wanted = got[~exceptional], wanted[~exceptional]
    exponent = np.frexp(np.maximum(np.abs(got), np.abs(wanted)))[1]
    assert np.max(np.abs(got - wanted) / np.ldexp(1.0, np.maximum(exponent - 53, -1074))) <= units


@pytest.mark.parametrize("function", FUNCTIONS, ids=lambda f: f.__name__)
def test_elementary_functions(function):
    assert_close(*pair(function(x), points()), WIDER.get(function, BOUND) + BOUND)


@pytest.mark.parametrize("function", RECIPROCALS, ids=lambda f: f.__name__)
def test_reciprocals(function):
    # A unit in the last place is at most twice as large a share of the reciprocal, which is rounded once more.
    assert_close(*pair(function(x), points()), 2 * (WIDER.get(function, BOUND) + BOUND) + 1)


@pytest.mark.parametrize("expression", [x**a, sp.atan2(x, a)], ids=str)
def test_functions_of_two_arguments(expression):
    rng = np.random.default_rng(20261130)
    pairs = [grid.ravel() for grid in np.meshgrid(EDGES, EDGES)]
    values = [np.concatenate([edge, rng.uniform(-30.0, 30.0, 9000)]) for edge in pairs]
    assert_close(*pair(expression, *values), 2 * BOUND)


def test_extremes_but_for_the_sign_of_zero():
    values = [grid.ravel() for grid in np.meshgrid(EDGES, EDGES)]
    for expression in (sp.Max(x, a), sp.Min(x, a), sp.Mod(x, a), sp.sign(x - a), sp.Heaviside(x - a)):
        np.testing.assert_array_equal(*pair(expression, *values))


@dataclass
class Bounded:
    """Values and bounds of their rounding errors: running error analysis, where a fused operation rounds less often."""

    value: np.ndarray
    error: np.ndarray | float = 0.0

    def rounded(self, units: float = 0.5) -> Bounded:
        return Bounded(self.value, self.error + 2 * units * ROUNDING * np.abs(self.value))

    def __neg__(self) -> Bounded:
        return Bounded(-self.value, self.error)

    def __add__(self, other: Any) -> Bounded:
        other = bounded(other)
        return Bounded(self.value + other.value, self.error + other.error).rounded()

    def __mul__(self, other: Any) -> Bounded:
        other = bounded(other)
        error = self.error * np.abs(other.value) + np.abs(self.value) * other.error + self.error * other.error
        return Bounded(self.value * other.value, error).rounded()

    def reciprocal(self) -> Bounded:
        least = np.abs(self.value) - self.error
        assert np.all(least > 0.0)
        return Bounded(1.0 / self.value, self.error / least**2)

    def __sub__(self, other: Any) -> Bounded:
        return self + -bounded(other)

    def __rsub__(self, other: Any) -> Bounded:
        return bounded(other) + -self

    def __truediv__(self, other: Any) -> Bounded:
        return self * bounded(other).reciprocal()

    def __rtruediv__(self, other: Any) -> Bounded:
        return bounded(other) * self.reciprocal()

    __radd__, __rmul__ = __add__, __mul__

    def sin(self) -> Bounded:
        return Bounded(np.sin(self.value), self.error).rounded(2 * BOUND)  # its slope is at most 1

    def cos(self) -> Bounded:
        return Bounded(np.cos(self.value), self.error).rounded(2 * BOUND)

    def exp(self) -> Bounded:
        return Bounded(np.exp(self.value), np.exp(self.value) * np.expm1(self.error)).rounded(2 * BOUND)


def bounded(value: Any) -> Bounded:
    return value if isinstance(value, Bounded) else Bounded(np.asarray(value, dtype=float))


def sample(rng: np.random.Generator, depth: int) -> sp.Expr:
    """Return a random expression of x and a in which no denominator vanishes."""
    if depth == 0:
        return (x, a, sp.Float(rng.uniform(-2, 2)), sp.Integer(rng.integers(1, 5)))[rng.integers(4)]
    one, two = (sample(rng, depth - 1) for _ in range(2))
    kinds = one + two, one * two, one - two, one / (2 + sp.sin(two)), sp.sin(one) * two, sp.cos(one) - two, one**3
    return (*kinds, sp.exp(sp.sin(one)) * two)[rng.integers(8)]


def test_expressions_agree_within_the_bounds_of_their_steps():
    rng = np.random.default_rng(20261130)
    expressions = [sample(rng, 4) for _ in range(12)]
    values = rng.uniform(-3.0, 3.0, (2, 2000))
    names = {f"f{k}": expression + 0 * x for k, expression in enumerate(expressions)}
    by_machine, by_numpy = pair(names, *values)
    for name, bound in zip(names, kernel(list(names.values()), (x, a)).function(*map(Bounded, values)), strict=True):
        # Both are within the error of the exact value. Errors are sums of some hundred terms, themselves rounded.
        assert np.all(np.abs(by_machine[name] - by_numpy[name]) <= 2.001 * bounded(bound).error), name


def test_machine_code_gives_a_lane_the_same_value_in_any_company():
    f = kernel(sp.sin(x) * sp.cos(a) + sp.exp(-x) * a + x**3 / (a + 4), (x, a), backend="compiled")
    values = np.random.default_rng(20261130).uniform(0.0, 3.0, (2, 301))
    whole = f(*values)
    for count in (1, 2, 3, 5, 8, 13, 16, 100):
        parts = [f(*values[:, start : start + count]) for start in range(0, 301, count)]
        np.testing.assert_array_equal(np.concatenate(parts), whole)
