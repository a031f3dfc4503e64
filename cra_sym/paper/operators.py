"""Equations written with the operators D_k and the orders q_nk, applied to functions of fast and slow time."""

from __future__ import annotations

from collections.abc import Mapping

from sympy import Expr, Mul, S, Symbol

__all__ = ["acting", "named"]


def named(name: str) -> Symbol:
    """Return the symbol of an operator, an order or an amplitude in the equations."""
    return Symbol(name, commutative=False)


def acting(expression: Expr, fields: Mapping[Symbol, Expr], times: Mapping[Symbol, Symbol]) -> Expr:
    """Return an expression such as ``D_0**2*q_n0 + omega_n**2*q_n0`` for given functions.

    Parameters
    ----------
    expression : Expr
        A sum of products of a factor, powers of operators, and the field they act on.
    fields : mapping
        The function each field stands for.
    times : mapping
        The time by which each operator differentiates.
    """
    total: Expr = S.Zero
    for term in expression.expand().as_ordered_terms():
        factors, chain = term.args_cnc()
        result = fields[chain.pop()] if chain else S.One
        for operator, power in (f.as_base_exp() for f in reversed(chain)):
            result = result.diff(times[operator], power)
        total += Mul(*factors) * result
    return total
