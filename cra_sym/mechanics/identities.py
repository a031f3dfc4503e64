"""A decision procedure for identities between polynomials in circular, hyperbolic and exponential functions."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable, Mapping
from math import lcm

from sympy import (
    QQ,
    QQ_I,
    Abs,
    Derivative,
    Dummy,
    Expr,
    I,
    Indexed,
    Integer,
    Integral,
    Mul,
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
    factorint,
    pi,
    preorder_traversal,
    prime,
    sin,
    sinh,
    sympify,
)
from sympy.core.function import AppliedUndef

__all__ = ["vanishes"]

#: Nodes that are treated as indeterminates: the identity must hold for any value of them.
_OPAQUE = (AppliedUndef, Derivative, Subs, Integral, Sum, Indexed, conjugate, Abs)

_PI = Dummy("pi")


def vanishes(expression: Expr) -> bool:
    """Decide whether an expression is zero for all values of its symbols: proved, not sampled.

    The expression must be rational in its symbols, in roots, in undefined functions and derivatives, and in cos, sin,
    cosh, sinh and exp of polynomials (also in roots) without an imaginary constant. The addition theorems turn it into
    a rational function of exponentials, roots and the rest, each an independent indeterminate; if that function is
    zero, so is the expression wherever it is defined. The converse holds too, since exponentials of arguments that are
    linearly independent over the rationals are algebraically independent. Only relations between undefined functions,
    or between roots other than those of symbols and natural numbers, may be missed: such a root is characterised by
    its power alone.

    Parameters
    ----------
    expression : Expr

    Raises
    ------
    ValueError
        If the expression contains anything else, such as a floating-point number, a symbolic power or noncommutative
        symbols, or a division by zero at any depth.

    Examples
    --------
    >>> from sympy import cos, cosh, sin, sinh, symbols
    >>> x, y = symbols("x y")
    >>> vanishes(cos(x + y) - cos(x) * cos(y) + sin(x) * sin(y))
    True
    >>> vanishes(cosh(2 * x) - 2 * sinh(x) ** 2 + 1)
    False
    """
    expression = sympify(expression, strict=True)
    plain = expression.xreplace({atom: Dummy() for atom in expression.atoms(*_OPAQUE)} | {pi: _PI})
    plain, relations = _without_roots(_without_functions(plain))
    nodes = {node for part in (plain, *relations.values()) for node in preorder_traversal(part)}
    if not expression.is_commutative or not all(map(_is_rational, nodes)):
        raise ValueError(f"{expression}: must be exact numbers and circular, hyperbolic and exponential functions")
    if any(_is_zero(node.base, relations) for node in nodes if node.is_Pow and node.exp.is_negative):
        raise ValueError(f"{expression}: must be free of divisions by zero")
    return _is_zero(plain, relations)


def _is_rational(node: Expr) -> bool:
    """Tell whether a node may occur in a rational function with Gaussian rational coefficients."""
    known = node.is_Symbol or node.is_Rational or node is I
    return known or node.is_Add or node.is_Mul or (node.is_Pow and node.exp.is_Integer)


def _is_zero(expression: Expr, relations: Mapping[Dummy, Expr]) -> bool:
    """Tell whether an expression that is rational in its symbols, with no division by zero, is zero."""
    independent = relations.keys().isdisjoint(expression.free_symbols)
    return not (independent and _is_witness(expression)) and _normal(expression.as_numer_denom()[0], relations) == 0


def _is_witness(expression: Expr) -> bool:
    """Tell whether one exact evaluation shows that a rational function is not zero, which decides most cases."""
    symbols = sorted(expression.free_symbols, key=str)
    value = expression.xreplace({s: Rational(prime(k + 3), 101) for k, s in enumerate(symbols)}).expand()
    turned = value.coeff(I)
    return bool(turned.is_Rational and (value - I * turned).is_Rational and value != 0)


def _normal(polynomial: Expr, relations: Mapping[Dummy, Expr]) -> Expr:
    """Return a polynomial in normal form: expanded, and reduced by the relations that the roots satisfy."""
    for root, relation in relations.items():
        polynomial = Poly(polynomial, root).rem(Poly(relation, root)).as_expr().as_numer_denom()[0]
    symbols = sorted(polynomial.free_symbols, key=str)
    domain = QQ_I if polynomial.has(I) else QQ
    return domain.poly_ring(*symbols or [_PI]).from_sympy(polynomial).as_expr()


def _without_functions(expression: Expr) -> Expr:
    """Write all exponentials as powers of independent ones."""
    functions = expression.atoms(cos, sin, cosh, sinh, exp) - {S.Exp1}
    arguments = [f.args[0] * (I if isinstance(f, (cos, sin)) else 1) for f in functions] + [S.One]
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
    written = {function: forms[function.func](function.args[0]) for function in functions}
    return expression.xreplace(written | {S.Exp1: exponential(S.One)})


def _terms(argument: Expr) -> list[tuple[Rational, Expr, bool]]:
    """Return (rational factor, monomial, whether times i) for each term of an argument."""
    terms = []
    known = all(_is_rational(p) or (p.is_Pow and p.exp.is_Rational) for p in preorder_traversal(argument))
    for term in argument.expand().as_ordered_terms():
        factor, rest = term.as_coeff_Mul()
        turns = rest.has(I)
        monomial = (rest / I).expand() if turns else rest
        # a root of a sum is independent of its multiples, a quotient is not
        quotient = known and any(p.base.is_Add and not 0 < p.exp < 1 for p in monomial.atoms(Pow))
        constant = turns and monomial.free_symbols <= {_PI}
        if not known or not factor.is_Rational or monomial.has(I) or constant or quotient:
            raise ValueError(f"{argument}: must be a polynomial without an imaginary constant")
        if factor != 0:
            terms.append((factor, monomial, turns))
    return terms


def _without_roots(expression: Expr) -> tuple[Expr, dict[Dummy, Expr]]:
    """Write roots as powers of new symbols, and return the polynomials that vanish for these.

    Roots are replaced innermost first; polynomials are listed outermost first. The root of a symbol needs none: the
    symbol is a power of it.
    """
    symbols = expression.free_symbols
    simple: dict[Expr, Expr] = {}
    relations: dict[Dummy, Expr] = {}
    while inner := [
        power for power in expression.atoms(Pow) if _is_root(power) and not any(map(_is_root, power.base.atoms(Pow)))
    ]:
        orders: dict[Expr, int] = defaultdict(lambda: 1)
        for power in inner:
            for base in _factors(power.base):
                orders[base] = lcm(orders[base], int(power.exp.q))
        # no assumptions on a root, by which SymPy might simplify an outer one
        roots = {base: Dummy("root") for base in orders}
        expression = expression.xreplace(
            {p: Mul(*(roots[b] ** (p.exp * n * orders[b]) for b, n in _factors(p.base).items())) for p in inner}
        )
        simple |= {base: roots[base] ** order for base, order in orders.items() if base in symbols}
        found = {roots[base]: roots[base] ** order - base for base, order in orders.items() if base not in symbols}
        relations = found | relations
    return expression.xreplace(simple), {root: relation.xreplace(simple) for root, relation in relations.items()}


def _is_root(power: Expr) -> bool:
    if not power.exp.is_Rational:
        raise ValueError(f"{power}: must be free of symbolic powers")
    return not power.exp.is_Integer


def _factors(base: Expr) -> dict[Expr, int]:
    """Return the prime factors of an integer, since its root is a product of theirs, or any other base unchanged."""
    return {Integer(p): n for p, n in factorint(base).items()} if base.is_Integer and base > 0 else {base: 1}
