"""A decision procedure for identities between polynomials in circular, hyperbolic and exponential functions."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable
from math import lcm
from random import Random

from sympy import (
    Abs,
    Derivative,
    Dummy,
    Expr,
    Float,
    I,
    Indexed,
    Integral,
    Poly,
    Pow,
    Rational,
    S,
    Subs,
    Sum,
    conjugate,
    cos,
    cosh,
    exp,
    pi,
    sin,
    sinh,
)
from sympy.core.function import AppliedUndef, Function
from sympy.polys.fields import sfield

__all__ = ["vanishes"]

#: What stands for itself: whatever its value, the identity has to hold.
_OPAQUE = (AppliedUndef, Derivative, Subs, Integral, Sum, Indexed, conjugate, Abs)

Exponential = Callable[[Expr], Expr]


def vanishes(expression: Expr) -> bool:
    """Decide whether an expression is zero for all values of its symbols: proved, not sampled.

    The expression is rational in its symbols, in roots of them, in cos, sin, cosh, sinh and exp of polynomials without
    a constant multiple of pi, and in functions and derivatives that nothing is known of. Exponentials of arguments
    that are linearly independent over the rationals are algebraically independent, so after the addition theorems
    all these are independent indeterminates, and zero is what is the zero polynomial in them.

    Parameters
    ----------
    expression : Expr

    Raises
    ------
    ValueError
        If the expression holds something else, such as a floating-point number or a symbolic power.

    Examples
    --------
    >>> from sympy import cos, cosh, sin, sinh, symbols
    >>> x, y = symbols("x y")
    >>> vanishes(cos(x + y) - cos(x) * cos(y) + sin(x) * sin(y))
    True
    >>> vanishes(cosh(2 * x) - 2 * sinh(x) ** 2 + 1)
    False
    """
    plain = expression.xreplace({atom: Dummy(commutative=True) for atom in expression.atoms(*_OPAQUE)})
    plain = plain.xreplace({atom: Dummy() for atom in plain.atoms() if not atom.is_commutative} | {pi: _PI})
    plain = _without_functions(plain)
    plain, relations = _without_roots(plain)
    if plain.atoms(Float) or plain.atoms(Function):
        raise ValueError(f"{expression}: allowed are exact numbers and circular, hyperbolic and exponential functions")
    if not relations and _is_witness(plain):
        return False
    remainder = _numerator(plain)
    for root, relation in relations:
        remainder = Poly(remainder, root).rem(Poly(relation, root)).as_expr()
    symbols = sorted(remainder.free_symbols, key=str)
    return Poly(remainder, *symbols).is_zero if symbols else remainder.expand() == 0


def _is_witness(expression: Expr) -> bool:
    """Tell whether one exact evaluation shows that a rational function is not zero; that settles most of those."""
    rng = Random(0)
    point = {symbol: Rational(rng.randint(2, 97), 101) for symbol in sorted(expression.free_symbols, key=str)}
    value = expression.xreplace(point).expand()
    return bool(value.is_finite and value != 0)


def _numerator(expression: Expr) -> Expr:
    """Return the numerator of a rational function in normal form."""
    if not expression.free_symbols:
        return expression.expand()
    _, element = sfield(expression, *sorted(expression.free_symbols, key=str))
    return element.numer.as_expr()


_PI = Dummy("pi", positive=True)


def _without_functions(expression: Expr) -> Expr:
    """Write all exponentials as powers of independent ones."""
    known = (cos, sin, cosh, sinh, exp)
    arguments = [f.args[0] * (I if isinstance(f, (cos, sin)) else 1) for f in expression.atoms(*known)]
    if any(argument.has(*known) for argument in arguments):
        raise ValueError(f"{expression}: allowed are no functions of functions")
    scales: dict[tuple[Expr, bool], int] = defaultdict(lambda: 1)
    for argument in arguments:
        for factor, monomial, turns in _terms(argument):
            scales[monomial, turns] = lcm(scales[monomial, turns], int(factor.q))
    units = {key: Dummy("e") for key in scales}

    def exponential(argument: Expr) -> Expr:
        product = S.One
        for factor, monomial, turns in _terms(argument):
            product *= units[monomial, turns] ** (factor * scales[monomial, turns])
        return product

    forms: dict[type, Callable[[Expr], Expr]] = {
        exp: exponential,
        cosh: lambda a: (exponential(a) + 1 / exponential(a)) / 2,
        sinh: lambda a: (exponential(a) - 1 / exponential(a)) / 2,
        cos: lambda a: (exponential(I * a) + 1 / exponential(I * a)) / 2,
        sin: lambda a: (exponential(I * a) - 1 / exponential(I * a)) / (2 * I),
    }
    for function, form in forms.items():
        expression = expression.replace(function, form)
    return expression


def _terms(argument: Expr) -> list[tuple[Rational, Expr, bool]]:
    """Return (rational factor, monomial, whether times i) for each term of an argument."""
    terms = []
    for term in argument.expand().as_ordered_terms():
        factor, rest = term.as_coeff_Mul()
        turns = rest.has(I)
        monomial = (rest / I).expand() if turns else rest
        if not factor.is_Rational or monomial.has(I) or (turns and monomial.free_symbols <= {_PI}):
            raise ValueError(f"{argument}: allowed are no such arguments")
        if factor != 0:
            terms.append((factor, monomial, turns))
    return terms


def _without_roots(expression: Expr) -> tuple[Expr, list[tuple[Dummy, Expr]]]:
    """Write roots as powers of new symbols, and return the polynomials that vanish for roots of more than a symbol."""
    orders: dict[Expr, int] = defaultdict(lambda: 1)
    for power in expression.atoms(Pow):
        if not power.exp.is_Rational:
            raise ValueError(f"{power}: allowed are no symbolic powers")
        orders[power.base] = lcm(orders[power.base], int(power.exp.q))
    roots = {base: Dummy("root", positive=True) for base, order in orders.items() if order > 1}
    simple = {base: root ** orders[base] for base, root in roots.items() if base.is_Symbol}
    replaced = expression.replace(
        lambda e: isinstance(e, Pow) and e.base in roots and not e.base.is_Symbol,
        lambda e: roots[e.base] ** (e.exp * orders[e.base]),
    )
    relations = [(root, root ** orders[base] - base) for base, root in roots.items() if not base.is_Symbol]
    return replaced.subs(simple), [(root, relation.subs(simple)) for root, relation in relations]
