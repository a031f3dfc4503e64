"""The decision procedure: identities are zero, their neighbours are not, and what it cannot decide it refuses."""

import random

import pytest
from sympy import Derivative, Float, Function, I, Rational, cos, cosh, exp, pi, sin, sinh, sqrt, symbols, tan

from cra_sym.mechanics.identities import vanishes

x, y, a, b = symbols("x y a b", positive=True)
n = symbols("n")
f = Function("f")

IDENTITIES = [
    (x + y) ** 3 - x**3 - 3 * x**2 * y - 3 * x * y**2 - y**3,
    x / (x + y) + y / (x + y) - 1,
    cos(x) ** 2 + sin(x) ** 2 - 1,
    cosh(x) ** 2 - sinh(x) ** 2 - 1,
    cos(x + y) - cos(x) * cos(y) + sin(x) * sin(y),
    sinh(2 * x + y) - sinh(2 * x) * cosh(y) - cosh(2 * x) * sinh(y),
    sin(3 * x) - 3 * sin(x) + 4 * sin(x) ** 3,
    2 * cos(x / 2) ** 2 - 1 - cos(x),
    exp(I * a * x) - cos(a * x) - I * sin(a * x),
    exp((a + I * b) * x) - exp(a * x) * (cos(b * x) + I * sin(b * x)),
    sin(x) / cos(x) + cos(x) / sin(x) - 2 / sin(2 * x),
    1 / (sqrt(a) + 1) - (sqrt(a) - 1) / (a - 1),
    (sqrt(a) + sqrt(b)) ** 2 - a - b - 2 * sqrt(a * b),
    (sqrt(1 - n**2) - 1) * (sqrt(1 - n**2) + 1) + n**2,
    1 / (sqrt(2) - 1) - sqrt(2) - 1,
    pi * (x + 1) ** 2 - pi * x**2 - 2 * pi * x - pi,
    f(x) * Derivative(f(x), x) * 2 - (Derivative(f(x), x) + f(x)) ** 2 + Derivative(f(x), x) ** 2 + f(x) ** 2,
]


@pytest.mark.parametrize("zero", IDENTITIES, ids=str)
def test_identities(zero):
    assert vanishes(zero)


@pytest.mark.parametrize("zero", IDENTITIES, ids=str)
def test_what_is_close_to_an_identity_is_none(zero):
    head, tail = zero.as_two_terms()
    assert not vanishes(head + Rational(101, 100) * tail if zero.is_Add else zero + Rational(1, 10**20))
    assert not vanishes(zero + x / 10**9)


z = symbols("z")
p, q = symbols("p q", commutative=False)
HARD = [
    exp(x + 1) - exp(1) * exp(x),
    (sqrt(2) + sqrt(3)) ** 2 - 5 - 2 * sqrt(6),
    1 / (a - I * b) - (a + I * b) / (a**2 + b**2),
    (sqrt(1 + sqrt(1 + z)) + 1) ** 2 - 2 - sqrt(1 + z) - 2 * sqrt(1 + sqrt(1 + z)),
    cos(a) - 4 * cos(a / 3) ** 3 + 3 * cos(a / 3),
    exp(a * sqrt(1 + b) ** 3) - exp(a * sqrt(1 + b)) * exp(a * b * sqrt(1 + b)),
]
#: True on one branch of a root only.
ON_ONE_BRANCH = [
    sqrt(n**2) - n,
    sqrt(n * z) - sqrt(n) * sqrt(z),
    sqrt(n) * (sqrt(n**2 * sqrt(1 + z)) - n * (1 + z) ** Rational(1, 4)),
    sqrt(1 - cos(x) ** 2) - sin(x),
]


@pytest.mark.parametrize("zero", HARD, ids=str)
def test_what_takes_more_than_expanding(zero):
    assert vanishes(zero) and not vanishes(zero + x / 10**9)


@pytest.mark.parametrize("branch", ON_ONE_BRANCH, ids=str)
def test_a_root_is_not_simplified_by_a_sign_nobody_gave(branch):
    assert not vanishes(branch)


@pytest.mark.parametrize(
    "wrong",
    [
        p * q - q * p,
        (sin(x) ** 2 + cos(x) ** 2 - 1) / (cosh(x) ** 2 - sinh(x) ** 2 - 1),
        ((sqrt(n + 1) - 1) * (sqrt(n + 1) + 1) - n) / ((sqrt(z + 1) - 1) * (sqrt(z + 1) + 1) - z),
        exp(x / (1 + x)) * exp(1 / (1 + x)) - exp(1),
    ],
    ids=str,
)
def test_what_does_not_commute_and_what_divides_by_zero_is_refused(wrong):
    with pytest.raises(ValueError, match="allowed are"):
        vanishes(wrong)


def test_random_products_of_sums():
    """A polynomial in all the functions, expanded and shuffled, against itself factored; a changed one differs."""
    rng = random.Random(3)
    functions = [cos(x), sin(x), cosh(x), sinh(x), cos(2 * x), sinh(x - y), a, exp(I * y)]
    for _ in range(4):
        factors = [sum(rng.randint(-3, 3) * rng.choice(functions) for _ in range(3)) + 1 for _ in range(2)]
        product = factors[0] * factors[1]
        assert vanishes(product - product.expand(trig=True))
        assert not vanishes(product - product.expand() + rng.choice(functions) / 100)


@pytest.mark.parametrize(
    "undecidable", [tan(x), exp(cos(x)), x**n, Float(0.5) * x, cos(x) * Float(1.0), exp(I * pi * sqrt(2))], ids=str
)
def test_what_it_cannot_decide_it_refuses(undecidable):
    with pytest.raises(ValueError, match="allowed are"):
        vanishes(undecidable)
