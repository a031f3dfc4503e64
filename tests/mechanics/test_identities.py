"""The decision procedure: identities are zero, their neighbours are not, and what it cannot decide it refuses."""

import random
from itertools import count

import mpmath
import pytest
from sympy import (
    Add,
    Derivative,
    Float,
    Function,
    I,
    Max,
    Piecewise,
    Pow,
    Rational,
    cos,
    cosh,
    cot,
    exp,
    lambdify,
    log,
    oo,
    pi,
    preorder_traversal,
    sin,
    sinh,
    sqrt,
    symbols,
    tan,
)

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


z, c, d = symbols("z c d")
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
        z / (n + 1 / (sin(x) ** 2 + cos(x) ** 2 - 1)),
        1 + 1 / (1 + 1 / (sin(x) ** 2 + cos(x) ** 2 - 1)),
        sqrt(n + 1 / (cosh(x) ** 2 - sinh(x) ** 2 - 1)),
    ],
    ids=str,
)
def test_what_does_not_commute_and_what_divides_by_zero_is_refused(wrong):
    with pytest.raises(ValueError, match="must be"):
        vanishes(wrong)


#: Angle B, whole angle A: each function of A by functions of B and A - B.
ADDITION = {
    cos: lambda A, B: cos(B) * cos(A - B) - sin(B) * sin(A - B),
    sin: lambda A, B: sin(B) * cos(A - B) + cos(B) * sin(A - B),
    cosh: lambda A, B: cosh(B) * cosh(A - B) + sinh(B) * sinh(A - B),
    sinh: lambda A, B: sinh(B) * cosh(A - B) + cosh(B) * sinh(A - B),
    exp: lambda A, B: exp(B) * exp(A - B),
}
HALVES = {
    cos: lambda A: 1 - 2 * sin(A / 2) ** 2,
    sin: lambda A: 2 * sin(A / 2) * cos(A / 2),
    cosh: lambda A: 1 + 2 * sinh(A / 2) ** 2,
    sinh: lambda A: 2 * sinh(A / 2) * cosh(A / 2),
    exp: lambda A: exp(A / 2) ** 2,
}
EXPONENTIALS = {
    cos: lambda A: (exp(I * A) + exp(-I * A)) / 2,
    sin: lambda A: (exp(I * A) - exp(-I * A)) / (2 * I),
    cosh: lambda A: (exp(A) + exp(-A)) / 2,
    sinh: lambda A: (exp(A) - exp(-A)) / 2,
    exp: lambda A: cosh(A) + sinh(A),
}

CONJUGATES = {
    1 / (sqrt(a) + sqrt(b)): (sqrt(a) - sqrt(b)) / (a - b),
    1 / (sqrt(1 + a) - I): (sqrt(1 + a) + I) / (a + 2),
}


class Writer:
    """Writes random expressions, the same ones in other words, and such as differ in one place."""

    def __init__(self, seed):
        self.draw = random.Random(seed)
        self.terms = self.draw.sample([z, a * x, sqrt(b) * z, z * n, I * x, sqrt(1 + a) * x], 2)

    def angle(self):
        one, other = self.draw.sample(self.terms, 2)
        return one + self.draw.choice([-2, -1, 1, Rational(1, 2)]) * other

    def factor(self):
        functions = [function(self.angle()) for function in ADDITION]
        return self.draw.choice([*functions, *CONJUGATES, a, z, sqrt(a), sqrt(1 + a), f(x), f(x).diff(x), I, pi])

    def total(self):
        return self.draw.choice([-3, -1, Rational(1, 2), 2]) * self.factor() * self.factor() + self.factor() + 1

    def again(self, expression):
        """Return the same in other words: functions by an addition theorem, halves or exponentials, sums of roots
        conjugated, and all of it expanded over a factor that is not zero."""
        words = dict(CONJUGATES)
        for function in sorted(expression.atoms(*ADDITION), key=str):
            rule = self.draw.choice([ADDITION, HALVES, EXPONENTIALS])[function.func]
            whole = function.args[0]
            words[function] = rule(whole, self.angle()) if rule in ADDITION.values() else rule(whole)
        factor = self.factor() + z
        return (expression * factor).expand().xreplace(words) / factor

    def spoiled(self, expression):
        """Return the expression with a sign or a coefficient of one term, an exponent or an argument changed."""
        kinds = (Add, Pow, *ADDITION)
        nodes = list(preorder_traversal(expression))
        at = self.draw.choice([k for k, node in enumerate(nodes) if isinstance(node, kinds)])
        if isinstance(nodes[at], Add):
            other = nodes[at] - self.draw.choice(nodes[at].args) * self.draw.choice([2, Rational(1, 10)])
        else:
            other = nodes[at] * nodes[at].base if isinstance(nodes[at], Pow) else nodes[at].func(2 * nodes[at].args[0])
        places = count()

        def rebuilt(part):
            if next(places) == at:
                return other
            return part.func(*map(rebuilt, part.args)) if part.args else part

        return rebuilt(expression)

    def is_zero(self, expression):
        """Evaluate at a random point to fifty digits: where it is assumed real, it is."""
        expression = expression.xreplace({f(x).diff(x): c, f(x): d})
        unknown = [x, a, b, n, z, c, d]
        with mpmath.workdps(50):
            real = [mpmath.mpf(self.draw.uniform(0.5, 1.5)) for _ in range(3)]
            point = real + [mpmath.mpc(self.draw.uniform(-1, 1), self.draw.uniform(-1, 1)) for _ in unknown[3:]]
            value = abs(lambdify(unknown, expression, "mpmath")(*point))
        assert value < 1e-40 or value > 1e-12
        return value < 1e-40


@pytest.mark.parametrize("seed", range(12))
def test_random_identities_and_their_neighbours(seed):
    writer = Writer(seed)
    first = writer.total()
    zero = first - writer.again(first)
    assert vanishes(zero) and writer.is_zero(zero)
    for _ in range(2):
        near = writer.spoiled(zero)
        assert vanishes(near) == writer.is_zero(near)


STRANGERS = [tan(x), cot(1 / x), log(x) ** 2, x**n, (1 + x) ** z, (1 + x) ** I, Float(0.5) * x, x ** Float(0.5), p]
STRANGERS += [Max(x, n), Piecewise((x, n > 0), (1, True)), cos(exp(x)), cos(1), exp(I * pi * sqrt(2))]
PLACES = [
    lambda e: e,
    lambda e: z / (1 + e),
    lambda e: sqrt(n + e) * z,
    lambda e: (e + 1) * sin(x) ** 2 + (e + 1) * cos(x) ** 2 - 1 - e,
    lambda e: sin(x + e),
    lambda e: exp(z * e + x) * exp(-x) - exp(z * e),
    lambda e: cosh(sqrt(n + e)),
]


@pytest.mark.parametrize("stranger", STRANGERS, ids=str)
def test_what_it_does_not_know_is_refused_wherever_it_stands(stranger):
    for place in PLACES:
        with pytest.raises(ValueError, match="must be"):
            vanishes(place(stranger))


@pytest.mark.parametrize("wrong", [oo, Float("nan"), x > 0, "x - x"], ids=str)
def test_what_is_no_expression_of_finite_numbers_is_refused(wrong):
    with pytest.raises(ValueError):
        vanishes(wrong)
