"""Expressions that are evaluated without rounding of their constants: in ball arithmetic, or in fractions."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from cra_sym.kernels import Kernel, kernel

if TYPE_CHECKING:
    from sympy import Expr, Symbol

__all__ = ["BallProblem", "ExactKernel", "exact_kernel"]


@dataclass(frozen=True)
class ExactKernel:
    """A kernel whose constants are arguments.

    Attributes
    ----------
    kernel : Kernel
        Its last arguments are the constants.
    constants : tuple of (int, int)
        Numerator and denominator of each; (1, 0) stands for pi.
    """

    kernel: Kernel
    constants: tuple[tuple[int, int], ...]

    def __call__(self, number: Callable[[int], Any], pi: Any, *values: Any) -> Sequence[Any]:
        """Return the values of all expressions; ``number`` makes a number of the arithmetic of an integer."""
        constants = [pi if q == 0 else number(p) / number(q) for p, q in self.constants]
        return [
            number(value) if isinstance(value, int) else value for value in self.kernel.function(*values, *constants)
        ]


def exact_kernel(expressions: Sequence[Expr], symbols: Sequence[Symbol]) -> ExactKernel:
    """Return a kernel of expressions with every number that is not an integer as an argument."""
    from sympy import Dummy, Float, Integer, Rational, pi

    found = {atom for e in expressions for atom in e.atoms(Float, Rational) if not isinstance(atom, Integer)}
    found |= {pi} & {atom for e in expressions for atom in e.atoms(type(pi))}
    names = {atom: Dummy(f"constant_{k}") for k, atom in enumerate(sorted(found, key=str))}
    exact = [(1, 0) if atom is pi else _fraction(atom) for atom in names]
    # a Float of binary digits equals a fraction exactly
    plain = tuple(e.xreplace(names) for e in expressions)
    return ExactKernel(kernel(plain, (*symbols, *names.values()), backend="numpy"), tuple(exact))


def _fraction(number: Any) -> tuple[int, int]:
    from sympy import Rational

    exact = Rational(number)
    return int(exact.p), int(exact.q)


@dataclass(frozen=True)
class BallProblem:
    """A uniform conservative spatial problem, gyroscopic terms included, as functions in exact arithmetic.

    Attributes
    ----------
    displacements, coordinates : int
        n and m.
    jets : tuple of ((int, int), (int, int))
        Fields and orders of the two displacements of each term of the energy density.
    orders : tuple of int
        Highest order of each field.
    system, boundary : ExactKernel
        Of (z, parameters), with gyroscopic terms of (s, parameters): the entries of A and B, row by row.
    geometry, free : ExactKernel
        Of the parameters: length and left end; the entries of the matrix of free motions.
    energy : ExactKernel
        Of the parameters: stiffness, coefficient of the velocity and mass of each term.
    gyroscopic : bool
    """

    displacements: int
    coordinates: int
    jets: tuple[tuple[tuple[int, int], tuple[int, int]], ...]
    orders: tuple[int, ...]
    system: ExactKernel
    boundary: ExactKernel
    geometry: ExactKernel
    free: ExactKernel
    energy: ExactKernel
    gyroscopic: bool
