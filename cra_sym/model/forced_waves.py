"""The arm on a harmonically moving base as a boundary-value problem, brought into the dimensionless form a solver
evaluates.

In units of L, E I_z and rho A, with w'' = exp(i z t) and v = U(x) exp(i z t), the field equation is U'''' - Z U = -1,
Z = z^2 = lambda^4. Nothing requires z to be real: damping makes it complex.
"""

from __future__ import annotations

from functools import cache

import sympy as sp

from cra_sym.paper.evaluation import put
from cra_sym.paper.joint import boundary_conditions
from cra_sym.paper.motion import field_and_base
from cra_sym.symbols import symbol

__all__ = ["end_conditions", "series_jets", "wave_jets"]

_SERIES_TERMS = 7  # the first term left out is below rounding for |lambda| <= 2: 2^28 / 28! < 1e-21
Z, b, xi = sp.Symbol("Z"), sp.Symbol("b"), symbol("xi")  # lambda^4 and lambda, complex
x, t, L, w, v = (symbol(name) for name in ("x", "t", "L", "w", "v"))


@cache
def _harmonic(equation: sp.Eq, shape: sp.Expr) -> sp.Expr:
    """Return the residual of an equation of motion for v = shape(x) exp(i z t), w'' = exp(i z t), in the units
    above."""
    z = symbol("omega")
    swing = sp.exp(sp.I * z * t)
    residual = put(equation.lhs - equation.rhs, {v: shape * swing, w: -swing / z**2})
    names = {"k_t": "kappa_t", "k_r": "kappa_r", "m_e": "mu", "J_e": "iota"}
    units: dict[sp.Symbol, object] = {symbol(name): 1 for name in ("E", "I_z", "rho", "A", "L")}
    units |= {symbol(old): symbol(new) for old, new in names.items()}
    return sp.expand(sp.expand(residual / swing).subs(units)).subs(z, sp.sqrt(Z))


def end_conditions() -> tuple[tuple[sp.Matrix, sp.Matrix], tuple[sp.Symbol, ...]]:
    """Return (R, r) of the end conditions R J = r, J = (U, U', U'', U''') at the root and then at the tip, with
    arguments.

    Derived from (16); each condition at the root is multiplied by c = 1 / (1 + kappa), so that a rigid joint is
    (s, c) = (1, 0).
    """
    jets = sp.symbols("U_0:8")
    rows = []
    for equation, place in zip(boundary_conditions(), (0, 0, L, L), strict=True):
        local = jets[:4] if place == 0 else jets[4:]
        shape = sum(jet * (x - place) ** k / sp.factorial(k) for k, jet in enumerate(local))
        residual = _harmonic(equation, shape)
        for spring in ("t", "r"):
            kappa, s, c = (symbol(f"{name}_{spring}") for name in ("kappa", "s", "c"))
            if residual.has(kappa):
                residual = sp.expand(sp.expand(residual).subs(kappa, s / c) * c)
        rows.append(residual)
    left, right = sp.linear_eq_to_matrix(rows, jets)
    return (left, right), (*(symbol(name) for name in ("s_t", "c_t", "s_r", "c_r", "mu", "iota")), Z)


def wave_jets() -> tuple[tuple[sp.Matrix, sp.Matrix], tuple[sp.Symbol, ...]]:
    """Return a basis of the homogeneous solutions and a particular solution, as jets (4 x 4 and 4 x 1), with arguments.

    The four exponentials decay from an end into the arm for Re lambda > 0 and Im lambda <= 0, and are 1 at that end
    at most.
    """
    waves = [sp.exp(-b * xi), sp.exp(-b * (1 - xi)), sp.exp(-sp.I * b * xi), sp.exp(-sp.I * b * (1 - xi))]
    return _jets(waves, 1 / b**4), (xi, b)


def series_jets() -> tuple[tuple[sp.Matrix, sp.Matrix], tuple[sp.Symbol, ...]]:
    """Return the basis with unit jets at the root, and the particular solution at rest there, as power series in Z."""

    def series(first: int) -> sp.Expr:
        return sum(Z**k * xi ** (4 * k + first) / sp.factorial(4 * k + first) for k in range(_SERIES_TERMS))

    return _jets([series(first) for first in range(4)], -series(4)), (xi, Z)


def _jets(basis: list[sp.Expr], particular: sp.Expr) -> tuple[sp.Matrix, sp.Matrix]:
    def jet(function: sp.Expr) -> list[sp.Expr]:
        return [function.diff(xi, order) for order in range(4)]

    return sp.Matrix([jet(function) for function in basis]).T, sp.Matrix(jet(particular))


def field_residual(shape: sp.Expr) -> sp.Expr:
    """Return the residual of the field equation for a shape U(x)."""
    return _harmonic(field_and_base()[0], shape)
