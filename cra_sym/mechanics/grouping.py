"""Sums written with common coefficients taken out, as derivations show them."""

from __future__ import annotations

from collections.abc import Iterable

from sympy import Add, Expr, Mul, S, Symbol, expand

__all__ = ["grouped"]


def grouped(expression: Expr, variables: Iterable[Symbol]) -> Expr:
    """Write ``a*y + a*z + b*y`` as ``a*(y + z) + b*y`` for the given variables, without expanding coefficients.

    Terms that are not linear in the variables are expanded first.
    """
    variables = list(variables)
    coefficients = {v: expression.diff(v) for v in variables}
    if any(c.has(*variables) for c in coefficients.values() if variables):
        pairs = [term.as_independent(*variables, as_Add=False) for term in Add.make_args(expand(expression))]
    else:
        pairs = [(c, v) for v, c in coefficients.items()]
        pairs.append((expression.xreplace(dict.fromkeys(variables, S.Zero)), S.One))
    groups: dict[Expr, list[Expr]] = {}
    for coefficient, variable in pairs:
        if expand(coefficient) == 0:
            continue
        if -coefficient in groups:
            groups[-coefficient].append(-variable)
        else:
            groups.setdefault(coefficient, []).append(variable)
    return Add(*(_signed(coefficient, Add(*members)) for coefficient, members in groups.items()))


def _signed(coefficient: Expr, factor: Expr) -> Expr:
    if coefficient.is_Add and coefficient.could_extract_minus_sign():
        return Mul(S.NegativeOne, -coefficient, factor)
    return Mul(coefficient, factor)
