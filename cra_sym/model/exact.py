"""Expressions that are evaluated without rounding of their constants: in ball arithmetic, or in fractions."""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import islice
from typing import TYPE_CHECKING, Any

from cra_sym.kernels import Kernel, kernel
from cra_sym.solvers.ball_spans import RationalMatrix

if TYPE_CHECKING:
    from sympy import Expr, Matrix, Symbol

__all__ = ["ExactKernel", "ExactMatrix", "Irrational", "exact_kernel", "exact_matrix", "irrational_nodes"]


_BITS = 256
_LARGE = 2**31  # integers from here on are printed as floating-point numbers


@dataclass(frozen=True)
class Irrational:
    """Irrational functions of the parameters, which are evaluated in ball arithmetic alone.

    Attributes
    ----------
    kernel : Kernel
        Of the parameters and the constants.
    constants : tuple of (int, int)
    instead : tuple of (int, int)
        For each a fraction that takes its place in exact arithmetic; a relation that holds for it holds for any number.
    """

    kernel: Kernel
    constants: tuple[tuple[int, int], ...]
    instead: tuple[tuple[int, int], ...]


@dataclass(frozen=True)
class ExactKernel:
    """A kernel whose constants are arguments and in which nothing is divided.

    Attributes
    ----------
    kernel : Kernel
        Of numerators and denominators, in the parameters, the irrational functions and the constants.
    constants : tuple of (int, int)
        Numerator and denominator of each; (1, 0) stands for pi.
    quotients : tuple of (int, int or None)
        For each expression the places of numerator and denominator.
    irrational : Irrational or None
    """

    kernel: Kernel
    constants: tuple[tuple[int, int], ...]
    quotients: tuple[tuple[int, int | None], ...]
    irrational: Irrational | None = None

    def __call__(self, number: Callable[[int], Any], pi: Any, *values: Any) -> list[Any]:
        """Return the values of all expressions; ``number`` makes a number of the arithmetic of an integer."""

        def exact(fractions: Sequence[tuple[int, int]]) -> list[Any]:
            return [pi if q == 0 else number(p) / number(q) for p, q in fractions]

        others: Sequence[Any] = ()
        if self.irrational is not None and hasattr(pi, "cos"):
            others = self.irrational.kernel.function(*values, *exact(self.irrational.constants))
        elif self.irrational is not None:
            others = exact(self.irrational.instead)
        parts = [
            number(value) if isinstance(value, int) else value
            for value in self.kernel.function(*values, *others, *exact(self.constants))
        ]
        return [parts[top] if bottom is None else parts[top] / parts[bottom] for top, bottom in self.quotients]


def irrational_nodes(expression: Expr) -> set[Expr]:
    """Return the functions and powers that are not rational, the outermost ones."""
    from sympy import Function, Pow

    if isinstance(expression, Function) or (isinstance(expression, Pow) and not expression.exp.is_Integer):
        return {expression}
    return set().union(*map(irrational_nodes, expression.args))


def exact_kernel(expressions: Sequence[Expr], symbols: Sequence[Symbol]) -> ExactKernel:
    """Return a kernel of expressions, with every number that is not a small integer as an argument."""
    from sympy import Dummy, Integer, fraction, together

    given = list(map(_with_fractions, expressions))
    nodes = sorted(set().union(*map(irrational_nodes, given)), key=str)
    marks = {node: Dummy(f"irrational_{k}") for k, node in enumerate(nodes)}
    parts: dict[Expr, int] = {}
    quotients = []
    for expression in (e.xreplace(marks) for e in given):
        top, bottom = (expression, Integer(1)) if expression.is_polynomial() else fraction(together(expression))
        places = [parts.setdefault(part, len(parts)) for part in (top, bottom) if part != 1 or part is top]
        quotients.append((places[0], places[1] if len(places) > 1 else None))
    made, constants = _with_constants(tuple(parts), (*symbols, *marks.values()))
    if not nodes:
        return ExactKernel(made, constants, tuple(quotients))
    digests = (hashlib.sha256(str(node).encode()).digest() for node in nodes)
    instead = tuple((int.from_bytes(digest), 2**_BITS - 1) for digest in digests)
    return ExactKernel(made, constants, tuple(quotients), Irrational(*_with_constants(tuple(nodes), symbols), instead))


def _with_fractions(expression: Expr) -> Expr:
    """Return an expression with fractions in place of floating-point numbers, which they equal exactly."""
    from sympy import Float, Rational

    return expression.xreplace({atom: Rational(atom) for atom in expression.atoms(Float)})


def _with_constants(
    expressions: tuple[Expr, ...], symbols: Sequence[Symbol]
) -> tuple[Kernel, tuple[tuple[int, int], ...]]:
    """Return a kernel of expressions with the constants as last arguments, and these."""
    from sympy import Dummy, Integer, Rational, pi

    found = {
        atom
        for e in expressions
        for atom in e.atoms(Rational)
        if not (isinstance(atom, Integer) and abs(atom) < _LARGE)
    }
    found |= {pi} & {atom for e in expressions for atom in e.atoms(type(pi))}
    names = {atom: Dummy(f"constant_{k}") for k, atom in enumerate(sorted(found, key=str))}
    constants = tuple((1, 0) if atom is pi else (int(atom.p), int(atom.q)) for atom in names)
    plain = tuple(e.xreplace(names) for e in expressions)
    return kernel(plain, (*symbols, *names.values()), backend="numpy"), constants


@dataclass(frozen=True)
class ExactMatrix:
    """A matrix of rational functions of one variable, whose coefficients have no rounding of their constants.

    Attributes
    ----------
    coefficients : ExactKernel
    columns : int
    lengths : tuple of (int, int)
        Number of coefficients of numerator and denominator of each entry.
    """

    coefficients: ExactKernel
    columns: int
    lengths: tuple[tuple[int, int], ...]

    def __call__(self, number: Callable[[int], Any], pi: Any, *values: Any) -> RationalMatrix:
        """Return the matrix in the arithmetic of the values."""
        found = iter(self.coefficients(number, pi, *values))
        return RationalMatrix(
            self.columns, [(list(islice(found, top)), list(islice(found, bottom))) for top, bottom in self.lengths]
        )


def exact_matrix(matrix: Matrix, parameter: Symbol, symbols: Sequence[Symbol]) -> ExactMatrix:
    """Return a matrix of rational functions of the parameter."""
    from sympy import Poly, Rational, cancel, fraction, together

    found: list[Expr] = []
    lengths = []
    for entry in matrix:
        exact = _with_fractions(entry)
        top, bottom = exact, Rational(1)
        if not exact.is_polynomial(parameter):
            top, bottom = fraction(cancel(together(exact)))
        if not bottom.has(parameter):
            top, bottom = exact.expand() if bottom == 1 else top / bottom, Rational(1)
        parts = [Poly(part, parameter).all_coeffs()[::-1] if part.has(parameter) else [part] for part in (top, bottom)]
        found += [*parts[0], *parts[1]]
        lengths.append((len(parts[0]), len(parts[1])))
    return ExactMatrix(exact_kernel(found, symbols), matrix.cols, tuple(lengths))
