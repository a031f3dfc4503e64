"""Put shapes, motions and numbers into equations, at the ends of the manipulator and under integrals too."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
from sympy import Derivative, Dummy, Expr, Integral, Poly, S, Subs, lambdify, sympify

from cra_sym.arm.shooting import integrate
from cra_sym.symbols import symbol

__all__ = ["at", "evaluate", "integrate_polynomials", "put"]

x, L = symbol("x"), symbol("L")


def at(expression: Expr, place: Any) -> Expr:
    """Return ``expression`` evaluated at a place on the manipulator, usually one of its ends."""
    return expression.subs(x, place)


def put(expression: Expr, values: Mapping[Expr, Expr]) -> Expr:
    """Return ``expression`` with functions replaced, without doing integrals.

    SymPy writes a derivative at the tip as ``Derivative(v(L, t), L)``; a value that depends on L itself must be
    differentiated before it is evaluated there, which ``subs`` and ``replace`` alone would not do.

    Parameters
    ----------
    expression : Expr
    values : mapping of applied function to Expr
        For example ``{v: x**2 * t / L}``, in the variables the function is applied to.
    """
    for function, value in values.items():
        variables = function.args

        def local(place: tuple, counts: dict, function=function, value=value, variables=variables) -> Expr:
            moved = dict(zip(variables, place, strict=True))
            for variable, position in moved.items():
                value = value.diff(variable, counts.pop(position, 0)) if position.is_Symbol else value
            assert not counts, f"derivative of {function} by {counts}"
            return value.subs(moved, simultaneous=True)

        def derivative(e: Derivative, local=local) -> Expr:
            return local(e.expr.args, dict(e.variable_count))

        head = function.func
        expression = expression.replace(lambda e, h=head: isinstance(e, Derivative) and e.expr.func == h, derivative)
        expression = expression.replace(head, lambda *place, local=local: local(place, {}))
    return expression.replace(lambda e: isinstance(e, Subs), lambda e: e.doit(integrals=False))


def integrate_polynomials(expression: Expr) -> Expr:
    """Return ``expression`` with its definite integrals of polynomials done."""

    def done(integral: Integral) -> Expr:
        ((variable, low, high),) = integral.limits
        antiderivative = Poly(integral.function, variable).integrate()
        return antiderivative.eval(high) - antiderivative.eval(low)

    return expression.replace(lambda e: isinstance(e, Integral), done)


def evaluate(expression: Expr, values: Mapping[str, float], shapes: Mapping[Expr, Callable] | None = None) -> float:
    """Return the number an expression has for given parameters and numeric mode shapes.

    Parameters
    ----------
    expression : Expr
        Integrals over the manipulator are done by quadrature.
    values : mapping
        Parameters by symbol name.
    shapes : mapping of applied function to callable
        For example ``{phi_i: mode}`` where ``mode(x, derivative)`` returns numbers.
    """
    shapes, length = shapes or {}, values["L"]
    numbers = {symbol(name): value for name, value in values.items()}
    table: dict[Expr, float] = {}
    expression = sympify(expression, strict=True)
    for integral in expression.atoms(Integral):
        jets = [(f.diff(x, k), shape, k) for f, shape in shapes.items() for k in range(4, -1, -1)]
        stand_ins = [Dummy() for _ in jets]
        plain = integral.function.subs(list(zip((jet for jet, *_ in jets), stand_ins, strict=True))).subs(numbers)
        function = lambdify([x, *stand_ins], plain, "numpy")

        def along(place: np.ndarray, function=function, jets=jets) -> np.ndarray:
            return function(place, *(shape(place, k) for _, shape, k in jets)) + 0.0 * place

        table[integral] = integrate(along, length)
    for function, shape in shapes.items():
        for place, number in ((S.Zero, 0.0), (L, length)):
            table |= {at(function.diff(x, k), place): float(shape(number, k)) for k in range(4)}
    return float(sympify(expression.xreplace(table), strict=True).subs(numbers))
