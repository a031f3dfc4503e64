"""Terms that exclude natural frequencies: dampers, gyroscopic terms, follower forces."""

from __future__ import annotations

from sympy import Add, Derivative, Expr, Rational, Symbol

from cra_sym.mechanics import StateForm

__all__ = ["asymmetry", "odd_in_time", "vanishes"]


def odd_in_time(term: Expr, t: Symbol) -> bool:
    """Tell whether a force term changes sign when time runs backwards."""
    orders = (number for node in term.atoms(Derivative) for symbol, number in node.variable_count if symbol == t)
    return bool(sum(orders) % 2 == 1)


def vanishes(expression: Expr) -> bool:
    """Tell whether an expression is zero: by expansion, or else numerically at three points in 30 digits.

    Products of Piecewise do not cancel when they are expanded.
    """
    if expression == 0 or expression.expand() == 0:
        return True
    symbols = sorted(expression.free_symbols, key=str)
    for turn in range(1, 4):
        at = {symbol: Rational(7 * turn + 3 * k, 29 + 5 * k) for k, symbol in enumerate(symbols)}
        terms = [abs(complex(term.subs(at).evalf(30))) for term in Add.make_args(expression)]
        if abs(complex(expression.subs(at).evalf(30))) > 1e-20 * sum(terms):
            return False
    return True


def asymmetry(form: StateForm) -> str:
    """Return a description of the terms that make the problem unsymmetric, or an empty text."""
    if form.damped:
        return "the Lagrangian has gyroscopic terms, of first order in time"
    half = form.system.rows // 2
    a, b, c, d = (form.system[i : i + half, j : j + half] for i in (0, half) for j in (0, half))
    points = ((matrix, matrix.T) for _, matrix, _ in form.points)
    pairs = ((b, b.T), (c, c.T), (d, -a.T), (form.boundary, form.boundary.T), *points)
    if all(vanishes(entry) for left, right in pairs for entry in left - right):
        return ""
    return "the virtual work has forces that follow the motion"
