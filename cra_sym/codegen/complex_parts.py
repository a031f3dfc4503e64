"""Real and imaginary part of an expression in real symbols, node by node, so that common parts stay shared."""

from __future__ import annotations

import sympy as sp
from sympy.codegen.cfunctions import expm1

__all__ = ["complex_parts"]

Parts = tuple[sp.Expr, sp.Expr]


def complex_parts(expression: sp.Expr) -> Parts:
    """Return real and imaginary part, every symbol taken as real.

    SymPy's ``as_real_imag`` visits a shared subexpression as often as it occurs, and does not know ``expm1``.

    Examples
    --------
    >>> from sympy import I, exp, symbols
    >>> a, b = symbols("a b", real=True)
    >>> complex_parts(exp(a + I * b))
    (exp(a)*cos(b), exp(a)*sin(b))
    """
    return _parts(expression, {})


def _parts(e: sp.Expr, known: dict[sp.Expr, Parts]) -> Parts:
    if e not in known:
        known[e] = _found(e, known)
    return known[e]


def _found(e: sp.Expr, known: dict[sp.Expr, Parts]) -> Parts:
    if not e.has(sp.I):
        return e, sp.S.Zero
    if e == sp.I:
        return sp.S.Zero, sp.S.One
    if isinstance(e, sp.Piecewise):
        return _piecewise(e, known)
    parts = [_parts(term, known) for term in e.args]
    if e.is_Add:
        return sp.Add(*(re for re, _ in parts)), sp.Add(*(im for _, im in parts))
    if e.is_Mul:
        return _product(parts)
    if e.is_Pow and e.exp.is_Integer:
        base = _product([parts[0]] * abs(int(e.exp)))
        if e.exp > 0:
            return base
        square = base[0] ** 2 + base[1] ** 2
        return base[0] / square, -base[1] / square
    if isinstance(e, sp.exp):
        (re, im) = parts[0]
        return sp.exp(re) * sp.cos(im), sp.exp(re) * sp.sin(im)
    if isinstance(e, expm1):  # e^x cos y - 1 = (e^x - 1) cos y - 2 sin^2(y/2), without cancellation
        (re, im) = parts[0]
        return expm1(re) * sp.cos(im) - 2 * sp.sin(im / 2) ** 2, sp.exp(re) * sp.sin(im)
    raise ValueError(f"no real and imaginary part of {type(e).__name__} of a complex argument")


def _product(parts: list[Parts]) -> Parts:
    re, im = parts[0]
    for a, b in parts[1:]:
        re, im = re * a - im * b, re * b + im * a
    return re, im


def _piecewise(e: sp.Piecewise, known: dict[sp.Expr, Parts]) -> Parts:
    values = [_parts(value, known) for value, _ in e.args]
    conditions = [_real_condition(condition, known) for _, condition in e.args]
    re, im = (sp.Piecewise(*((v[k], c) for v, c in zip(values, conditions, strict=True))) for k in (0, 1))
    return re, im


def _real_condition(condition: sp.Basic, known: dict[sp.Expr, Parts]) -> sp.Basic:
    if not condition.has(sp.I):
        return condition
    if isinstance(condition, sp.Ne):
        re, im = _parts(condition.lhs - condition.rhs, known)
        return sp.Ne(re, 0) | sp.Ne(im, 0)
    raise ValueError(f"no real form of the condition {condition}")
