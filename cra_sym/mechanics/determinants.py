"""Determinants of matrices of polynomials, computed in SymPy's sparse polynomial rings for speed."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from functools import reduce
from typing import Any

from sympy import Add, Expr, Float, Matrix, Mul, Rational, S, Symbol
from sympy.polys.fields import sfield
from sympy.polys.matrices import DomainMatrix
from sympy.polys.rings import sring

__all__ = ["cofactors", "collected", "determinant", "divided", "primitive_rows", "without_content"]

Relations = Sequence[tuple[Symbol, Expr]]


def primitive_rows(matrix: Matrix) -> tuple[Matrix, list[Expr]]:
    """Clear the denominators of each row and divide it by its content.

    Returns
    -------
    rows : Matrix of polynomials
    contents : list of Expr
        ``matrix = diag(contents) * rows``.
    """
    field, entries = sfield([_exact(entry) for entry in matrix])
    ring, width = field.ring, matrix.cols
    rows, contents = [], []
    for i in range(matrix.rows):
        row = entries[i * width : (i + 1) * width]
        common = reduce(lambda a, b: a.lcm(b), (entry.denom for entry in row), ring.one)
        cleared = [entry.numer * common.exquo(entry.denom) for entry in row]
        content = reduce(lambda a, b: a.gcd(b), cleared, ring.zero) or ring.one
        rows.append([entry.exquo(content).as_expr() for entry in cleared])
        contents.append(content.as_expr() / common.as_expr())
    return Matrix(rows), contents


def determinant(matrix: Matrix, relations: Relations = ()) -> Any:
    """Return the determinant of a matrix of polynomials as a ring element, reduced by ``symbol**2 = expression``."""
    ring, table = _table(matrix, relations)
    return _reduced(_berkowitz(ring, table), relations)


def cofactors(matrix: Matrix, row: int, relations: Relations, variables: Iterable[Symbol]) -> list[Expr]:
    """Return the cofactors of one row, `collected`, without the monomial they share; they annihilate all other rows."""
    ring, table = _table(matrix, relations)
    rows = [entries for i, entries in enumerate(table) if i != row]
    minors = [_reduced(_berkowitz(ring, [r[:j] + r[j + 1 :] for r in rows]), relations) for j in range(matrix.cols)]
    signed = [(-1) ** (row + j) * minor for j, minor in enumerate(minors)]
    common = reduce(lambda a, b: a.gcd(b), (_monomial(ring, minor) for minor in signed if minor), ring.zero)
    return [collected(minor.exquo(common), variables) if minor else S.Zero for minor in signed]


def without_content(element: Any, variables: Iterable[Symbol]) -> tuple[Any, Expr]:
    """Split off the factor of a polynomial that is free of ``variables``."""
    ring = element.ring
    groups = _grouped_terms(element, set(variables))
    content = reduce(lambda a, b: a.gcd(b), map(ring.from_dict, groups.values()), ring.zero)
    return element.exquo(content), content.as_expr()


def divided(element: Any, divisor: Expr) -> tuple[Any, Expr]:
    """Return (quotient, 1) if the divisor divides the polynomial, otherwise both without common powers."""
    ring = element.ring
    if divisor.free_symbols <= set(ring.symbols):
        whole = ring.from_expr(divisor)
        quotient, remainder = divmod(element, whole)
        if not remainder:
            return quotient, S.One
        shared = _monomial(ring, element).gcd(_monomial(ring, whole))
        return element.exquo(shared), whole.exquo(shared).as_expr()
    return element, divisor


def collected(element: Any, variables: Iterable[Symbol]) -> Expr:
    """Write a polynomial as a sum of parameter monomials times polynomials in ``variables``."""
    ring, total = element.ring, []
    for monomial, terms in _grouped_terms(element, set(ring.symbols) - set(variables)).items():
        part = ring.from_dict(terms)
        shared = _monomial(ring, part)
        total.append(Mul(_power(ring, monomial), shared.as_expr(), part.exquo(shared).as_expr()))
    return Add(*total)


def _exact(entry: Expr) -> Expr:
    """Replace floats by their exact rational values, since polynomial arithmetic is exact."""
    return entry.xreplace({number: Rational(number) for number in entry.atoms(Float)})


def _table(matrix: Matrix, relations: Relations) -> tuple[Any, list[list[Any]]]:
    known = [expression for pair in relations for expression in pair]
    ring, elements = sring([*matrix, *known, S.One])
    width = matrix.cols
    return ring, [elements[i * width : (i + 1) * width] for i in range(matrix.rows)]


def _berkowitz(ring: Any, table: list[list[Any]]) -> Any:
    size = len(table)
    if not size:
        return ring.one
    characteristic = DomainMatrix(table, (size, size), ring.to_domain()).charpoly()
    return (-1) ** size * characteristic[-1]


def _reduced(element: Any, relations: Relations) -> Any:
    ring = element.ring
    ideal = [ring.from_expr(symbol**2 - square) for symbol, square in relations]
    return element.rem(ideal) if ideal and element else element


def _monomial(ring: Any, element: Any) -> Any:
    """Return the largest monomial, with the numeric content, that divides the polynomial."""
    exponents = tuple(min(powers) for powers in zip(*element.monoms(), strict=True))
    return ring.from_dict({exponents: element.content()})


def _grouped_terms(element: Any, inner: set[Symbol]) -> dict[tuple[int, ...], Any]:
    """Group terms by their powers of the ``inner`` generators; each group is a polynomial in the others."""
    at = [symbol in inner for symbol in element.ring.symbols]
    groups: dict[tuple[int, ...], dict[tuple[int, ...], Any]] = {}
    for monomial, coefficient in element.terms():
        key = tuple(n if own else 0 for n, own in zip(monomial, at, strict=True))
        rest = tuple(0 if own else n for n, own in zip(monomial, at, strict=True))
        groups.setdefault(key, {})[rest] = coefficient
    return groups


def _power(ring: Any, monomial: tuple[int, ...]) -> Expr:
    return Mul(*(symbol**n for symbol, n in zip(ring.symbols, monomial, strict=True)))
