"""Breakpoints of coefficients along x: the expressions whose zeros are jumps, kinks and branch points.

The middle of a narrow peak or of a steep layer counts as a breakpoint too, if it can be located.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from itertools import combinations

import sympy
from sympy import (
    Abs,
    DiracDelta,
    Dummy,
    Expr,
    Heaviside,
    Max,
    Min,
    Mod,
    Piecewise,
    Pow,
    S,
    SingularityFunction,
    Subs,
    Symbol,
    ceiling,
    floor,
    frac,
    log,
    preorder_traversal,
    sign,
)
from sympy.core.function import AppliedUndef, Derivative, Function
from sympy.core.relational import Relational
from sympy.logic.boolalg import Boolean, BooleanAtom, BooleanFunction

from cra_sym.mechanics.jets import HamiltonError

__all__ = ["Exponents", "Switch", "derivative", "exponents", "switches"]

_SMOOTH = tuple(
    getattr(sympy, name)
    for name in (
        "sin cos tan cot sec csc sinc asin acos atan acot atan2 exp sinh cosh tanh coth sech csch asinh acosh atanh "
        "erf erfc gamma loggamma besselj bessely besseli besselk airyai airybi legendre chebyshevt chebyshevu LambertW"
    ).split()
)
_DECAYING = (sympy.exp, sympy.sech, sympy.csch, sympy.tanh, sympy.coth, sympy.erf, sympy.erfc)
_LOW_POWER = 8  # of a polynomial that has no detail finer than it shows
_KNOWN = (*_SMOOTH, Abs, sign, Heaviside, floor, ceiling, frac, Mod, log, Max, Min, SingularityFunction, Piecewise)


@dataclass(frozen=True)
class Switch:
    """An expression in x and the parameters whose zeros are breakpoints.

    Attributes
    ----------
    expression : Expr
    levels : bool
        Whether every integer value counts, not zero alone.
    """

    expression: Expr
    levels: bool = False

    def slope(self, x: Symbol) -> Expr | None:
        """Return the derivative by x if the expression is affine in x, or None."""
        if not self.expression.is_polynomial(x):
            return None
        slope = derivative(self.expression, x)
        return None if slope.has(x) else slope


def switches(expressions: Iterable[Expr], x: Symbol) -> tuple[Switch, ...]:
    """Return the expressions, without duplicates, at whose zeros the given ones may not be smooth in x.

    Raises
    ------
    HamiltonError
        Names what cannot be located: a condition that is not made of relations, an unknown function, a point load.

    Examples
    --------
    >>> from sympy import Abs, Heaviside, symbols
    >>> x, a, b = symbols("x a b")
    >>> [switch.expression for switch in switches([3 + 2 * Heaviside(x - a), Abs(x**2 - b)], x)]
    [a - x, b - x**2]
    """
    found: dict[Switch, None] = {}
    for expression in expressions:
        for node in preorder_traversal(expression):
            if isinstance(node, (Expr, Boolean)) and node.has(x):
                found |= dict.fromkeys(_signed(switch) for switch in _of(node, x) if switch.expression.has(x))
    return tuple(found)


def _signed(switch: Switch) -> Switch:
    """Return the expression with a normalised sign, so that it is not duplicated."""
    return Switch(-switch.expression, switch.levels) if switch.expression.could_extract_minus_sign() else switch


def derivative(expression: Expr, symbol: Symbol) -> Expr:
    """Return the derivative by a symbol between breakpoints: symbols are real, delta functions at jumps are left out.

    Examples
    --------
    >>> from sympy import Heaviside, symbols
    >>> x, a = symbols("x a")
    >>> derivative(x * Heaviside(x - a), x)
    Heaviside(-a + x)
    """
    real = {s: Dummy(s.name, real=True) for s in (expression.free_symbols | {symbol}) if isinstance(s, Symbol)}
    plain = expression.xreplace(real).replace(Mod, lambda value, period: value - period * floor(value / period))
    rate = plain.diff(real[symbol])
    if rate.has(DiracDelta, Derivative, Subs):
        flat = {node: S.Zero for node in rate.atoms(Derivative, Subs) if node.atoms(floor, ceiling, frac)}
        rate = rate.xreplace(flat).replace(DiracDelta, lambda *arguments: S.Zero)
    points = {node: S.Zero for node in rate.atoms(SingularityFunction) if node.args[2].is_negative}
    return rate.xreplace(points).xreplace({dummy: s for s, dummy in real.items()})


@dataclass(frozen=True)
class Exponents:
    """Expressions in x and the parameters that bound the variation of smooth functions.

    Only where an exponent e changes by a few units may exp(e), cos(e) and similar functions have an extremum.

    Attributes
    ----------
    decaying : tuple of Expr
        Exponents of functions that are constant to rounding where the exponent is very negative.
    others : tuple of Expr
    """

    decaying: tuple[Expr, ...]
    others: tuple[Expr, ...]


def exponents(expressions: Iterable[Expr], x: Symbol) -> Exponents:
    """Return the exponents of all functions in some expressions that are neither polynomials nor piecewise.

    Examples
    --------
    >>> from sympy import cos, exp, symbols, tanh
    >>> x, a = symbols("x a")
    >>> exponents([exp(-(x / a)**2) + cos(x), tanh(x) / (a + x)], x)
    Exponents(decaying=(-Abs(x), -log(Abs(a + x)), -x**2/a**2), others=(x,))
    """
    decaying: set[Expr] = set()
    others: set[Expr] = set()
    for expression in expressions:
        for node in preorder_traversal(expression):
            if isinstance(node, Pow) and node.has(x):
                degree = node.exp.is_Integer and 0 <= node.exp <= _LOW_POWER
                if node.base.has(x) and not degree and not (node.exp.is_Rational and 0 < node.exp < 1):
                    decaying.add(node.exp * log(Abs(node.base, evaluate=False), evaluate=False))
                elif not node.base.has(x):
                    decaying.add(node.exp * log(Abs(node.base, evaluate=False), evaluate=False))
            elif isinstance(node, _DECAYING) and node.has(x):
                decaying.add(node.args[0] if isinstance(node, sympy.exp) else -Abs(node.args[0]))
            elif isinstance(node, (sympy.atan, sympy.asinh)) and node.has(x):
                decaying.add(-log(1 + node.args[0] ** 2))
            elif isinstance(node, _SMOOTH) and node.has(x):
                others |= {argument for argument in node.args if argument.has(x)}
    return Exponents(tuple(sorted(decaying, key=str)), tuple(sorted(others, key=str)))


def _of(node: Expr | Boolean, x: Symbol) -> Iterator[Switch]:
    if isinstance(node, Piecewise):
        for _, condition in node.args:
            yield from (Switch(side) for side in _sides(condition, node))
    elif isinstance(node, (Heaviside, sign, Abs, log)):
        yield Switch(node.args[0])
    elif isinstance(node, SingularityFunction):
        if node.args[2].is_negative or node.args[2].is_nonnegative is None:
            raise HamiltonError(f"{node} acts at a point; state its term there with `inside`")
        yield Switch(node.args[0] - node.args[1])
    elif isinstance(node, DiracDelta):
        raise HamiltonError(f"{node} acts at a point; state its term there with `inside`")
    elif isinstance(node, (Max, Min)):
        yield from (Switch(first - second) for first, second in combinations(node.args, 2))
    elif isinstance(node, (floor, ceiling, frac)):
        yield Switch(node.args[0], levels=True)
    elif isinstance(node, Mod):
        yield Switch(node.args[0] / node.args[1], levels=True)
    elif isinstance(node, Pow):
        if not node.exp.is_integer and node.base.has(x):
            yield Switch(node.base)
    elif isinstance(node, AppliedUndef) or (isinstance(node, Function) and not isinstance(node, _KNOWN)):
        raise HamiltonError(f"{node}: where this function of {x} is not smooth cannot be located")


def _sides(condition: Boolean, node: Expr) -> Iterator[Expr]:
    if isinstance(condition, Relational):
        yield condition.lhs - condition.rhs
    elif isinstance(condition, BooleanFunction):
        for part in condition.args:
            yield from _sides(part, node)
    elif not isinstance(condition, BooleanAtom):
        raise HamiltonError(f"{node}: the condition {condition} is not made of relations, so it cannot be located")
