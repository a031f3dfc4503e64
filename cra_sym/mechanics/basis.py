"""General solutions of linear equations with constant coefficients: functions closed under differentiation.

A basis is a row ``b(x)`` with ``b' = b M``. Derivatives, integrals and boundary values then are matrix products of M
with ``b(left)`` and ``b(right)``, in which functions at the right end are single symbols tied by polynomial relations.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Literal

from sympy import (
    Eq,
    Expr,
    Matrix,
    Poly,
    Rational,
    Symbol,
    cos,
    cosh,
    diag,
    exp,
    eye,
    gcd,
    roots,
    sin,
    sinh,
    sqrt,
    zeros,
)

from cra_sym.mechanics.jets import HamiltonError

__all__ = ["Naming", "SolutionBasis", "general_solution"]

Naming = Callable[[str], Symbol]


@dataclass(frozen=True)
class SolutionBasis:
    """Basis of the solutions of a spatial problem, with x counted from the left end.

    Attributes
    ----------
    functions : tuple of Expr
        Scalar functions of x, in terms of ``wave_numbers``.
    derivative : Matrix
        M with ``b' = b M``.
    left, right : Matrix, shape (1, N)
        Values at the ends; at the right end in the ``values`` symbols.
    values : dict of Symbol to Expr
        Meaning of the symbols, in terms of ``wave_numbers`` times the length.
    relations : tuple of (Symbol, Expr)
        ``symbol**2 = expression``.
    fields : tuple of Matrix
        Field number f is ``b fields[f] constants``.
    wave_numbers : dict of Symbol to Expr or None
        Wave numbers times the length, with their values as functions of the frequency; None if given only by
        ``dispersion``.
    dispersion : Eq
        Equation the wave numbers satisfy.
    """

    functions: tuple[Expr, ...]
    derivative: Matrix
    left: Matrix
    right: Matrix
    values: dict[Symbol, Expr]
    relations: tuple[tuple[Symbol, Expr], ...]
    fields: tuple[Matrix, ...]
    wave_numbers: dict[Symbol, Expr | None]
    dispersion: Eq


def general_solution(
    operator: Matrix, r: Symbol, x: Expr, length: Expr, kind: Literal["hyperbolic", "decaying"], name: Naming
) -> SolutionBasis:
    """Return the general solution of ``operator(d/dx) phi = 0``.

    Parameters
    ----------
    operator : Matrix
        Square, polynomial in r = d/dx.
    x, length : Expr
        Position from the left end, and length.
    kind : {'hyperbolic', 'decaying'}
        For ``phi'''' = beta**4 phi``: cosh and sinh, or exponentials that decay from either end and stay bounded.
    name : callable
        Returns a symbol that is not in use.
    """
    determinant = Poly(operator.det(method="berkowitz").expand(), r)
    degree = determinant.degree()
    if operator.shape == (1, 1) and degree in (2, 4) and len(determinant.terms()) == 2 and determinant.nth(0) != 0:
        power = -determinant.nth(0) / determinant.nth(degree)
        return _single_term(degree, power if degree == 4 else -power, x, length, kind, name)
    if all(power % 2 == 0 for (power,), _ in determinant.terms()):
        return _paired(operator, determinant, r, x, length, name)
    return _exponential(operator, determinant, r, x, length, name)


def _single_term(degree: int, power: Expr, x: Expr, length: Expr, kind: str, name: Naming) -> SolutionBasis:
    """Solve ``phi'' = -beta**2 phi`` (degree 2) and ``phi'''' = beta**4 phi`` (degree 4)."""
    lam = name("lambda")
    beta = lam / length
    co, si = name("cos_lambda"), name("sin_lambda")
    functions: list[Expr] = [cos(beta * x), sin(beta * x)]
    blocks = [Matrix([[0, beta], [-beta, 0]])]
    left, right = [1, 0], [co, si]
    values: dict[Symbol, Expr] = {co: cos(lam), si: sin(lam)}
    relations = [(si, 1 - co**2)]
    if degree == 4 and kind == "decaying":
        decay = name("exp_minus_lambda")
        functions += [exp(-beta * x), exp(-beta * (length - x))]
        blocks.append(diag(-beta, beta))
        left, right = [*left, 1, decay], [*right, decay, 1]
        values[decay] = exp(-lam)
    elif degree == 4:
        ch, sh = name("cosh_lambda"), name("sinh_lambda")
        functions += [cosh(beta * x), sinh(beta * x)]
        blocks.append(Matrix([[0, beta], [beta, 0]]))
        left, right = [*left, 1, 0], [*right, ch, sh]
        values.update({ch: cosh(lam), sh: sinh(lam)})
        relations.append((sh, ch**2 - 1))
    return SolutionBasis(
        tuple(functions),
        diag(*blocks),
        Matrix([left]),
        Matrix([right]),
        values,
        tuple(relations),
        (eye(degree),),
        {lam: length * power ** Rational(1, degree)},
        Eq(beta**degree, power, evaluate=False),
    )


def _paired(operator: Matrix, determinant: Poly, r: Symbol, x: Expr, length: Expr, name: Naming) -> SolutionBasis:
    """Solve an equation even in d/dx: cosh(r x) and sinh(r x) for each root r**2."""
    half = determinant.degree() // 2
    squares = _square_roots(determinant, r, half)
    null = _null_vector(operator, determinant, r)
    fields = [zeros(2 * half) for _ in range(operator.rows)]
    functions: list[Expr] = []
    blocks: list[Matrix] = []
    left: list[Expr] = []
    right: list[Expr] = []
    values: dict[Symbol, Expr] = {}
    relations: list[tuple[Symbol, Expr]] = []
    numbers: dict[Symbol, Expr | None] = {}
    for index in range(half):
        number = name(f"lambda_{index + 1}")
        rate = number / length
        ch, sh = name(f"cosh_{index + 1}"), name(f"sinh_{index + 1}")
        functions += [cosh(rate * x), sinh(rate * x)]
        blocks.append(Matrix([[0, rate], [rate, 0]]))
        left, right = [*left, 1, 0], [*right, ch, sh]
        values.update({ch: cosh(number), sh: sinh(number)})
        relations.append((sh, ch**2 - 1))
        numbers[number] = None if squares is None else length * sqrt(squares[index])
        for field, entry in zip(fields, null, strict=True):
            even, odd = _parity(entry, r)
            even, odd = even.subs(r, rate), odd.subs(r, rate)
            field[2 * index : 2 * index + 2, 2 * index : 2 * index + 2] = Matrix([[even, odd], [odd, even]])
    return SolutionBasis(
        tuple(functions),
        diag(*blocks),
        Matrix([left]),
        Matrix([right]),
        values,
        tuple(relations),
        tuple(fields),
        numbers,
        Eq(determinant.as_expr(), 0, evaluate=False),
    )


def _exponential(operator: Matrix, determinant: Poly, r: Symbol, x: Expr, length: Expr, name: Naming) -> SolutionBasis:
    """Solve the general case: exp(r x) for each root r."""
    degree = determinant.degree()
    found = _distinct(determinant, degree) if degree <= 2 else None
    null = _null_vector(operator, determinant, r)
    numbers = {name(f"lambda_{index + 1}"): None if found is None else length * found[index] for index in range(degree)}
    ends = {name(f"exp_{index + 1}"): exp(number) for index, number in enumerate(numbers)}
    return SolutionBasis(
        tuple(exp(number * x / length) for number in numbers),
        diag(*(number / length for number in numbers)),
        Matrix([[1] * degree]),
        Matrix([list(ends)]),
        ends,
        (),
        tuple(diag(*(entry.subs(r, number / length) for number in numbers)) for entry in null),
        numbers,
        Eq(determinant.as_expr(), 0, evaluate=False),
    )


def _square_roots(determinant: Poly, r: Symbol, half: int) -> Sequence[Expr] | None:
    """Return the roots r**2 in closed form if there are at most two."""
    if half > 2:
        return None
    squared = Poly({(power // 2,): coefficient for (power,), coefficient in determinant.terms()}, r)
    return _distinct(squared, half)


def _distinct(polynomial: Poly, degree: int) -> Sequence[Expr]:
    found = [root for root, count in roots(polynomial).items() for _ in range(count)]
    if len(set(found)) != degree:
        raise HamiltonError(
            f"separate: the characteristic equation {polynomial.as_expr()} = 0 has a repeated root at every frequency,"
            " so its solutions hold powers of x; use the state form or ritz"
        )
    return found


def _null_vector(operator: Matrix, determinant: Poly, r: Symbol) -> list[Expr]:
    """Return a vector, polynomial in r, that the operator annihilates at every root and that vanishes at none."""
    adjugate = operator.adjugate().applyfunc(lambda entry: entry.expand())
    columns = [list(adjugate[:, j]) for j in range(adjugate.cols)]
    columns.append([sum(row) for row in zip(*columns, strict=True)])
    for column in columns:
        common: Expr = determinant.as_expr()
        for entry in column:
            common = gcd(common, entry)
        if not common.has(r):
            return column
    raise HamiltonError("separate: fields with common wave numbers do not couple; separate them one at a time")


def _parity(entry: Expr, r: Symbol) -> tuple[Expr, Expr]:
    mirrored = entry.subs(r, -r)
    return ((entry + mirrored) / 2).expand(), ((entry - mirrored) / 2).expand()
