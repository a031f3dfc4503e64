"""The boundary conditions of a mode written by hand: the exact second route of the checks of (18)-(29).

Nothing here comes from a derivation. In units of the length and the bending stiffness the shape is
``C_1 cos + C_2 sin + C_3 cosh + C_4 sinh`` of lambda times the position.
"""

from __future__ import annotations

from collections.abc import Iterator
from itertools import combinations

from sympy import Expr, Matrix, cos, cosh, sin, sinh

from cra_sym.symbols import symbol

__all__ = ["determinant", "eliminated", "jets", "joined", "minors", "root_rows", "tip_rows"]

lamda, mu, iota = (symbol(name) for name in ("lamda", "mu", "iota"))
s_t, c_t, s_r, c_r = (symbol(name) for name in ("s_t", "c_t", "s_r", "c_r"))


def jets(angle: Expr) -> tuple[Matrix, ...]:
    """Return the rows that give a shape and its first three derivatives where lambda times the place is ``angle``."""
    c, s, ch, sh = cos(angle), sin(angle), cosh(angle), sinh(angle)
    rows = ([c, s, ch, sh], [-s, c, sh, ch], [-c, -s, ch, sh], [s, -c, sh, ch])
    return tuple(lamda**order * Matrix([row]) for order, row in enumerate(rows))


def root_rows() -> Matrix:
    """Return force and moment at the joint: EI phi''' = -k_t phi and EI phi'' = k_r phi'."""
    shape, slope, curvature, third = jets(lamda * 0)
    return Matrix.vstack(c_t * third + s_t * shape, c_r * curvature - s_r * slope)


def tip_rows() -> Matrix:
    """Return force and moment at the tip: EI phi''' = -m_e omega^2 phi and EI phi'' = J_e omega^2 phi'."""
    shape, slope, curvature, third = jets(lamda)
    return Matrix.vstack(third + mu * lamda**4 * shape, curvature - iota * lamda**4 * slope)


def joined(place: Expr) -> Matrix:
    """Return displacement and three derivatives, at a place in units of the length, of any shape that satisfies the
    conditions at the joint, where they are c_t, c_r, s_r and -s_t: the pairs (s, c) need no common scale."""
    c, s, ch, sh = (function(lamda * place) for function in (cos, sin, cosh, sinh))
    krylov = [(ch + c) / 2, (sh + s) / 2, (ch - c) / 2, (sh - s) / 2]
    table = Matrix(4, 4, lambda row, column: lamda ** (row - column) * krylov[(column - row) % 4])
    return table * Matrix([c_t, c_r, s_r, -s_t])


def eliminated() -> Matrix:
    """Return the two conditions on C_1 and C_2 alone, by Cramer's rule: force and moment at the tip."""
    systems = [Matrix.vstack(root_rows(), tip_rows()[row, :]) for row in (0, 1)]
    return Matrix([[system[:, [first, 2, 3]].det() for first in (0, 1)] for system in systems])


def determinant() -> Expr:
    """Return the determinant of the four conditions."""
    return Matrix.vstack(root_rows(), tip_rows()).det(method="berkowitz")


def minors(rows: Matrix, others: Matrix) -> Iterator[Expr | bool]:
    """Yield the minors that vanish if each row of a matrix is proportional to that of another."""
    for one, two in ((rows[r, :], others[r, :]) for r in range(rows.rows)):
        yield any(one)
        for i, j in combinations(range(rows.cols), 2):
            yield one[i] * two[j] - one[j] * two[i]
