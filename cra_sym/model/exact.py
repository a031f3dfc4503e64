"""Expressions that are evaluated without rounding of their constants: in ball arithmetic, or in fractions."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import islice
from typing import TYPE_CHECKING, Any

from cra_sym.kernels import Kernel, kernel
from cra_sym.solvers.ball_spans import RationalMatrix

if TYPE_CHECKING:
    from sympy import Expr, Matrix, Symbol

__all__ = ["ExactKernel", "ExactMatrix", "exact_kernel", "exact_matrix"]


_LARGE = 2**31  # integers from here on are printed as floating-point numbers


@dataclass(frozen=True)
class ExactKernel:
    """A kernel whose constants are arguments and in which nothing is divided.

    Attributes
    ----------
    kernel : Kernel
        Of numerators and denominators; its last arguments are the constants.
    constants : tuple of (int, int)
        Numerator and denominator of each; (1, 0) stands for pi.
    quotients : tuple of (int, int or None)
        For each expression the places of numerator and denominator.
    """

    kernel: Kernel
    constants: tuple[tuple[int, int], ...]
    quotients: tuple[tuple[int, int | None], ...]

    def __call__(self, number: Callable[[int], Any], pi: Any, *values: Any) -> list[Any]:
        """Return the values of all expressions; ``number`` makes a number of the arithmetic of an integer."""
        constants = [pi if q == 0 else number(p) / number(q) for p, q in self.constants]
        parts = [
            number(value) if isinstance(value, int) else value for value in self.kernel.function(*values, *constants)
        ]
        return [parts[top] if bottom is None else parts[top] / parts[bottom] for top, bottom in self.quotients]


def exact_kernel(expressions: Sequence[Expr], symbols: Sequence[Symbol]) -> ExactKernel:
    """Return a kernel of rational functions, with every number that is not a small integer as an argument."""
    from sympy import Dummy, Float, Integer, Rational, fraction, pi, together

    parts: dict[Expr, int] = {}
    quotients = []
    for expression in expressions:
        # a Float of binary digits equals a fraction exactly
        exact = expression.xreplace({atom: Rational(atom) for atom in expression.atoms(Float)})
        top, bottom = (exact, Integer(1)) if exact.is_polynomial() else fraction(together(exact))
        places = [parts.setdefault(part, len(parts)) for part in (top, bottom) if part != 1 or part is top]
        quotients.append((places[0], places[1] if len(places) > 1 else None))
    found = {
        atom for e in parts for atom in e.atoms(Rational) if not (isinstance(atom, Integer) and abs(atom) < _LARGE)
    }
    found |= {pi} & {atom for e in parts for atom in e.atoms(type(pi))}
    names = {atom: Dummy(f"constant_{k}") for k, atom in enumerate(sorted(found, key=str))}
    constants = tuple((1, 0) if atom is pi else (int(atom.p), int(atom.q)) for atom in names)
    plain = tuple(e.xreplace(names) for e in parts)
    return ExactKernel(kernel(plain, (*symbols, *names.values()), backend="numpy"), constants, tuple(quotients))


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
    from sympy import Float, Poly, Rational, cancel, fraction, together

    found: list[Expr] = []
    lengths = []
    for entry in matrix:
        exact = entry.xreplace({atom: Rational(atom) for atom in entry.atoms(Float)})
        top, bottom = exact, Rational(1)
        if not exact.is_polynomial(parameter):
            top, bottom = fraction(cancel(together(exact)))
        if not bottom.has(parameter):
            top, bottom = exact.expand() if bottom == 1 else top / bottom, Rational(1)
        parts = [Poly(part, parameter).all_coeffs()[::-1] if part.has(parameter) else [part] for part in (top, bottom)]
        found += [*parts[0], *parts[1]]
        lengths.append((len(parts[0]), len(parts[1])))
    return ExactMatrix(exact_kernel(found, symbols), matrix.cols, tuple(lengths))
