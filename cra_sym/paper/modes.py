"""Form of the mode shapes and their boundary conditions, for every stiffness from zero to infinity: (17)-(19)."""

from __future__ import annotations

from functools import cache

import numpy as np
from sympy import (
    Eq,
    Expr,
    I,
    MatMul,
    Matrix,
    Poly,
    Symbol,
    cos,
    cosh,
    exp,
    roots,
    sin,
    sinh,
    solve,
    sqrt,
    symbols,
    zeros,
)

from cra_sym.paper.energy import A, E, I_z, L, phi_i, rho, x
from cra_sym.paper.equations import Derivation, Proof, derived, proves, samples
from cra_sym.paper.evaluation import annihilates, put
from cra_sym.paper.groups import in_groups
from cra_sym.paper.joint import mode_conditions
from cra_sym.paper.motion import mode_field_equation
from cra_sym.paper.oracles import by_hand
from cra_sym.paper.oracles.by_hand import minors
from cra_sym.paper.oracles.shooting import sample, shoot
from cra_sym.symbols import symbol

__all__ = ["coefficients", "root_matrix", "tip_matrix"]

omega_i, beta, lamda, Delta, r_2 = (symbol(n) for n in ("omega_i", "beta", "lamda", "Delta", "r_2"))
kappa_t, kappa_r, mu, iota = (symbol(name) for name in ("kappa_t", "kappa_r", "mu", "iota"))
s_t, c_t, s_r, c_r = (symbol(name) for name in ("s_t", "c_t", "s_r", "c_r"))
coefficients = C_1, C_2, C_3, C_4 = tuple(symbol(f"C_{k}") for k in (1, 2, 3, 4))

#: Placeholders for cos, sin, cosh, sinh of lamda: identities between polynomials in these are decided exactly.
_c, _s, _ch, _sh = symbols("c s C S")
VALUES = {_c: cos(lamda), _s: sin(lamda), _ch: cosh(lamda), _sh: sinh(lamda)}


# General solution (17) ------------------------------------------------------------------------------------------


@cache
def basis() -> tuple[Expr, ...]:
    """Return four real solutions of the field equation of a mode, from the roots of its characteristic polynomial."""
    r = Symbol("r")
    quartic = Poly(_exponential(r).subs(omega_i, _frequency()).expand(), r)
    circular: list[Expr] = []
    hyperbolic: list[Expr] = []
    for root in roots(quartic):
        if root in (beta, I * beta):
            pair = (cosh(beta * x), sinh(beta * x)) if root == beta else (cos(beta * x), sin(beta * x))
            (hyperbolic if root == beta else circular).extend(pair)
    return (*circular, *hyperbolic)


def _exponential(rate: Symbol) -> Expr:
    """Return the residual of the field equation of a mode for an exponential of x, divided by the exponential."""
    return (put(mode_field_equation().lhs, {phi_i: exp(rate * x)}) / exp(rate * x)).expand()


@derived(17, "form of the mode shape", ("10b",))
def mode_form() -> Derivation[tuple[Eq, Eq]]:
    """The field equation of a mode has four exponential solutions, here in real form; the boundary conditions
    determine the coefficients."""
    r = Symbol("r")
    yield "exponential put in", "exp(r x) in the field equation (10b).", Eq(_exponential(r), 0)
    quartic = Eq(r**4, beta**4)
    yield (
        "characteristic equation",
        "With the wave number as abbreviation of the factor that does not depend on r.",
        quartic,
    )
    yield "its roots", "Two imaginary, two real.", tuple(roots(quartic.lhs - quartic.rhs, r))
    shape = sum(coefficient * function for coefficient, function in zip(coefficients, basis(), strict=True))
    return Eq(phi_i, shape), _wave()


@cache
def _wave() -> Eq:
    """Return the wave number beta, for which the field equation is phi'''' = beta^4 phi."""
    balance = mode_field_equation().lhs.subs(phi_i.diff(x, 4), beta**4 * phi_i) / phi_i
    (square,) = solve(balance.expand(), beta**4, simplify=False, check=False)
    return Eq(beta**4, square)


def _frequency() -> Expr:
    """Return the angular frequency of a wave number."""
    (square,) = solve(_wave(), omega_i**2)
    return sqrt(square)


@proves(17)
def prove_mode_form() -> Proof:
    """It satisfies the field equation, and its four functions are independent; the wave number is the textbook one of a
    beam."""
    shape, wave = mode_form()
    yield wave.rhs - rho * A * omega_i**2 / (E * I_z)
    residual = put(mode_field_equation().lhs, {phi_i: shape.rhs})
    yield residual.subs(omega_i, sqrt(solve(wave, omega_i**2)[0]))
    yield Matrix(4, 4, lambda row, column: basis()[column].diff(x, row)).subs(x, 0).det().expand() != 0
    yield set(coefficients) < shape.rhs.free_symbols


@samples(17)
def sample_mode_form() -> bool:
    """Modes of a random arm, computed by shooting with power series, are combinations of its functions."""
    places = np.linspace(0.0, 1.0, 30)
    for mode in shoot(sample(17)):
        table = np.array([[float(f.subs({beta: mode.beta, x: p})) for f in basis()] for p in places])
        gap = np.linalg.lstsq(table, mode(places), rcond=None)[1]
        if gap[0] > 1e-20 * np.sum(mode(places) ** 2):
            return False
    return True


# Boundary conditions as linear systems (18)-(19) ----------------------------------------------------------------


def dimensionless(expression: Expr) -> Expr:
    """Write an expression in lamda = beta L and the dimensionless groups."""
    return expression.subs({omega_i: _frequency(), **in_groups()}).subs(beta, lamda / L)


@cache
def _rows() -> tuple[Matrix, ...]:
    """Return the coefficients of C_1..C_4 in the four conditions on a mode in the order of (16), with placeholders."""
    shape, rows = mode_form()[0].rhs, []
    names = {value: name for name, value in VALUES.items()}
    for condition, power in zip(mode_conditions(), (3, 2, 3, 2), strict=True):
        balance = dimensionless(put(condition.lhs - condition.rhs, {phi_i: shape})) * L**power / (E * I_z)
        entries = [balance.subs(names).expand().coeff(coefficient) for coefficient in coefficients]
        common = lamda ** min(Poly(entry, lamda).monoms()[-1][0] for entry in entries if entry != 0)
        rows.append(Matrix([[(entry / common).expand() for entry in entries]]))
    return tuple(rows)


def _weighted(row: Matrix, stiffness: Symbol, spring: Symbol, compliance: Symbol) -> Matrix:
    """Write a row linear in a stiffness in the pair (spring, compliance): (1, 0) is rigid, (0, 1) is free."""
    return row.applyfunc(lambda e: (spring * e.coeff(stiffness, 1) + compliance * e.coeff(stiffness, 0)).expand())


def root_matrix() -> Matrix:
    """Return the 2 x 4 matrix of force and moment at the root, homogeneous in (s_t, c_t) and in (s_r, c_r)."""
    force, moment, *_ = _rows()
    return Matrix.vstack(_weighted(force, kappa_t, s_t, c_t), _weighted(moment, kappa_r, s_r, c_r))


def tip_matrix() -> Matrix:
    """Return the 2 x 4 matrix of force and moment at the tip."""
    return tip_in_short().subs(VALUES)


def tip_in_short() -> Matrix:
    """Return the same with placeholders for the functions of lamda."""
    return Matrix.vstack(*_rows()[2:])


def product_of(matrix: Matrix, unknowns: Matrix) -> Eq:
    """Return the system of equations of a matrix with two rows, as a product that is not carried out."""
    return Eq(MatMul(matrix, unknowns), zeros(2, 1), evaluate=False)


def _put_in(conditions: tuple[Eq, ...]) -> tuple[Eq, ...]:
    """Return conditions on a mode with (17) substituted."""
    shape = mode_form()[0].rhs
    return tuple(Eq(*(put(side, {phi_i: shape}).doit() for side in condition.args)) for condition in conditions)


def short_symbols() -> Eq:
    """Return the definitions of the abbreviations in displayed equations."""
    return Eq(Matrix([list(VALUES)]), Matrix([list(VALUES.values())]), evaluate=False)


@derived(18, "root system", ("16a", 17))
def root_system() -> Derivation[Eq]:
    """(17) substituted in the conditions at the joint. Each stiffness is written as the pair (s, c) = (κ, 1) / (1 + κ),
    so that a rigid joint (1, 0) and no joint (0, 1) are regular values."""
    yield (
        "shape put in",
        "(17) substituted in the force and moment conditions at the joint, x = 0.",
        _put_in(mode_conditions()[:2]),
    )
    rows = tuple(Eq((row * Matrix(coefficients))[0], 0) for row in _rows()[:2])
    yield "dimensionless", "With λ = β L and the groups of the parameters, divided by common factors.", rows
    return product_of(root_matrix(), Matrix(coefficients))


def _tip_system_in_short() -> tuple[Eq, Eq]:
    return product_of(tip_in_short(), Matrix(coefficients)), short_symbols()


@derived(19, "tip system", ("16a", 17), shown=_tip_system_in_short)
def tip_system() -> Derivation[Eq]:
    """(17) substituted in the conditions at the end-effector."""
    yield (
        "shape put in",
        "(17) substituted in the force and moment conditions at the tip, x = L.",
        _put_in(mode_conditions()[2:]),
    )
    return product_of(tip_matrix(), Matrix(coefficients))


@proves(18)
def prove_root_system() -> Proof:
    """Written by hand."""
    yield from minors(root_system().lhs.args[0], by_hand.root_rows())


@samples(18)
def sample_root_system() -> bool:
    """Coefficients of modes computed by shooting (random arm) satisfy it; at other wave numbers they do not."""
    return annihilates(root_system().lhs.args[0], 18)


@proves(19)
def prove_tip_system() -> Proof:
    """Written by hand."""
    yield from minors(tip_system().lhs.args[0], by_hand.tip_rows())


@samples(19)
def sample_tip_system() -> bool:
    """Coefficients of modes computed by shooting (random arm) satisfy it; at other wave numbers they do not."""
    return annihilates(tip_system().lhs.args[0], 19)
