"""Coefficients on one part of the domain: what switches along x is decided by the signs of the switches there."""

from __future__ import annotations

from collections.abc import Mapping

from sympy import Abs, Expr, Heaviside, Integer, Max, Min, Piecewise, S, SingularityFunction, Symbol, sign
from sympy.core.relational import Equality, Relational, Unequality
from sympy.logic.boolalg import Boolean

__all__ = ["resolved"]


def resolved(expression: Expr, x: Symbol, signs: Mapping[Expr, int]) -> Expr:
    """Return an expression without what switches along x, on a part where each switch keeps its sign.

    Parameters
    ----------
    expression : Expr
    x : Symbol
    signs : mapping of Expr to int
        1 or -1 for each expression that :func:`cra_sym.mechanics.breakpoints.switches` returns.

    Examples
    --------
    >>> from sympy import symbols
    >>> x, a, b = symbols("x a b")
    >>> resolved(3 + b * Heaviside(x - a) + Piecewise((2, x < a), (5, True)), x, {a - x: -1})
    b + 8
    """

    def of(switch: Expr) -> int | None:
        if not switch.has(x):
            return None
        return signs[switch] if switch in signs else -signs[-switch]

    def holds(condition: Boolean) -> Boolean:
        found = {}
        for relation in condition.atoms(Relational):
            place = of(relation.lhs - relation.rhs)
            if place is not None:
                found[relation] = S.true if _true(relation, place) else S.false
        return condition.xreplace(found)

    def value(node: Expr) -> Expr:
        if not node.args or not node.has(x):
            return node
        if isinstance(node, Piecewise):
            return Piecewise(*((value(part), holds(condition)) for part, condition in node.args))
        if isinstance(node, (Heaviside, sign, Abs)):
            place = of(node.args[0])
            assert place is not None
            if isinstance(node, Heaviside):
                return S.One if place > 0 else S.Zero
            return Integer(place) if isinstance(node, sign) else place * value(node.args[0])
        if isinstance(node, SingularityFunction):
            distance = node.args[0] - node.args[1]
            return S.Zero if of(distance) == -1 else value(distance) ** node.args[2]
        if isinstance(node, (Max, Min)):
            best = node.args[0]
            for other in node.args[1:]:
                place = of(best - other)
                if place is None:
                    return node
                best = other if (place < 0) == isinstance(node, Max) else best
            return value(best)
        return node.func(*(value(part) if isinstance(part, Expr) else part for part in node.args))

    return value(expression)


def _true(relation: Relational, place: int) -> bool:
    """Tell whether a relation holds where the sign of left minus right is known and not zero."""
    if isinstance(relation, (Equality, Unequality)):
        return isinstance(relation, Unequality)
    return (place < 0) == (relation.rel_op in ("<", "<="))
