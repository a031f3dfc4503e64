"""The characteristic determinant of a problem with constant coefficients, and a bound of it, in ball arithmetic."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

from .ball_spans import Rows, Span, Spanned

__all__ = ["BallDeterminant"]

_SWEEPS = 4  # of the scaling that makes rows and columns of a bound alike


@dataclass(frozen=True)
class BallDeterminant:
    """The determinant of the conditions of a motion; its zeros, with their multiplicities, are the eigenvalues.

    It is an analytic function of the parameter wherever the coefficients are.

    Parameters
    ----------
    flint : module
    parts : callable
        Returns the problem in balls of the working precision.
    """

    flint: Any
    parts: Callable[[], Spanned]

    def value(self, z: Any) -> Any:
        """Return a ball that contains the determinant at a value of the parameter (acb)."""
        of = self.flint.acb_mat

        def carried(span: Span, state: Rows) -> Rows:
            matrix = of([[entry * span.length for entry in row] for row in span.system.at(z)])
            return list((matrix.exp() * of(state)).tolist()) if state else state

        return of(self.parts().conditions(lambda matrix: matrix.at(z), carried)).det()

    def bound(self, radius: Any) -> Any | None:
        """Return a bound of the modulus of the determinant where the parameter does not exceed a radius (arb).

        The exponential of a matrix is at most that of a matrix of bounds of its entries. None if a coefficient may be
        infinite there.
        """
        of, missing = self.flint.arb_mat, False

        def at(matrix: Any) -> Rows:
            nonlocal missing
            found: Rows | None = matrix.bound(radius)
            if found is None:
                missing, found = True, matrix.at(self.flint.arb(0))
            return found

        def carried(span: Span, state: Rows) -> Rows:
            matrix = of([[entry * span.length for entry in row] for row in at(span.system)])
            return list((matrix.exp() * of(state)).tolist()) if state else state

        parts = self.parts()
        parts = replace(parts, free=[[abs(value) for value in column] for column in parts.free])
        rows = parts.conditions(at, carried, sign=1)
        return None if missing else _largest(self.flint, [[abs(self.flint.arb(e)) for e in row] for row in rows])


def _largest(flint: Any, rows: Rows) -> Any:
    """Return a bound of the determinants of all matrices whose entries do not exceed some in modulus.

    Of matrices with scaled columns, the product of the sums of their rows; the scales make the columns alike.
    """
    size = len(rows)
    scale = [flint.arb(1)] * size
    for _ in range(_SWEEPS):
        sums = [sum((e * s for e, s in zip(row, scale, strict=True)), flint.arb(0)) for row in rows]
        shares = [
            sum((row[j] / s for row, s in zip(rows, sums, strict=True) if s > 0), flint.arb(0)) for j in range(size)
        ]
        scale = [flint.arb((1 / s).mid()) if s > 0 else flint.arb(1) for s in shares]
    found = flint.arb(1)
    for row, factor in zip(rows, scale, strict=True):
        found = found * sum((e * s for e, s in zip(row, scale, strict=True)), flint.arb(0)) / factor
    return found.upper()
