"""Put shapes, motions and numbers into equations, at the ends of the manipulator and under integrals too."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import cache
from typing import Any

import numpy as np
from sympy import Derivative, Dummy, Expr, Integral, Matrix, Poly, S, Subs, lambdify, sympify

from cra_sym.arm.shooting import ShotMode, integrate, sample, shoot
from cra_sym.symbols import symbol

__all__ = [
    "at",
    "evaluate",
    "group_numbers",
    "integrate_polynomials",
    "put",
    "shapes_agree",
    "shot_coefficients",
]

x, L = symbol("x"), symbol("L")
C_1, beta, c_r, c_t, iota, kappa_r, kappa_t, lamda, mu, r_2, s_r, s_t = (
    symbol(name)
    for name in ("C_1", "beta", "c_r", "c_t", "iota", "kappa_r", "kappa_t", "lamda", "mu", "r_2", "s_r", "s_t")
)


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


@cache
def _integrand(integral: Integral, functions: tuple[Expr, ...]) -> tuple[Callable, list[str], list[tuple[Expr, int]]]:
    """Return the integrand as a function of x, the named parameters and the listed derivatives of the shapes."""
    jets = [(f, k) for f in functions for k in range(4, -1, -1) if integral.function.has(f.diff(x, k))]
    stand_ins = {f.diff(x, k): Dummy() for f, k in jets}
    plain = integral.function.subs(list(stand_ins.items()))
    parameters = sorted(plain.free_symbols - {x, *stand_ins.values()}, key=str)
    return lambdify([x, *parameters, *stand_ins.values()], plain, "numpy"), [p.name for p in parameters], jets


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
        function, names, jets = _integrand(integral, tuple(shapes))
        parameters = [values[name] for name in names]

        def along(place: np.ndarray, function=function, parameters=parameters, jets=jets) -> np.ndarray:
            return function(place, *parameters, *(shapes[f](place, k) for f, k in jets)) + 0.0 * place

        table[integral] = integrate(along, length)
    for function, shape in shapes.items():
        for place, number in ((S.Zero, 0.0), (L, length)):
            table |= {at(function.diff(x, k), place): float(shape(number, k)) for k in range(4)}
    return float(sympify(expression.xreplace(table), strict=True).subs(numbers))


def group_numbers(values: dict[str, float], mode_beta: float) -> dict[Expr, float]:
    """Return lamda and the dimensionless groups of an arm with a finite joint."""
    bending, mass, length = values["E"] * values["I_z"], values["rho"] * values["A"] * values["L"], values["L"]
    stiff_t, stiff_r = values["k_t"] * length**3 / bending, values["k_r"] * length / bending
    weights = {
        s_t: stiff_t / (1 + stiff_t),
        c_t: 1 / (1 + stiff_t),
        s_r: stiff_r / (1 + stiff_r),
        c_r: 1 / (1 + stiff_r),
    }
    return weights | {
        lamda: mode_beta * length,
        kappa_t: stiff_t,
        kappa_r: stiff_r,
        mu: values["m_e"] / mass,
        iota: values["J_e"] / (mass * length**2),
    }


def shot_coefficients(mode: ShotMode) -> Matrix:
    """Return C_1..C_4 of a mode found by shooting, from its values and derivatives at the root."""
    a, b, c, d = (mode.start[k] / mode.beta**k for k in range(4))
    return Matrix([(a - c) / 2, (b - d) / 2, (a + c) / 2, (b + d) / 2])


def shapes_agree(seeds: tuple[int, ...], shape: Expr, ratio: Expr, **joint: float) -> bool:
    """Compare a derived shape with modes found by shooting, scaled alike at the tip."""
    for seed in seeds:
        values = sample(seed) | joint
        for mode in shoot(values):
            numbers = group_numbers(values, mode.beta) | {C_1: 1.0, beta: mode.beta}
            numeric = shape.subs(r_2, ratio).subs(numbers)
            places = np.linspace(0.0, values["L"], 9)
            found = np.array([float(numeric.subs(x, place)) for place in places])
            expected = mode(places)
            if not np.allclose(found / found[-1], expected / expected[-1], atol=1e-6):
                return False
    return True
