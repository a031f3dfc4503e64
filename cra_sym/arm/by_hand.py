"""The boundary conditions of a mode written down by hand: the exact second route behind the checks of (18)-(29).

Nothing here comes from a derivation. In units of the length and the bending stiffness the shape is
``C_1 cos + C_2 sin + C_3 cosh + C_4 sinh`` of lambda times the place.
"""

from __future__ import annotations

from itertools import combinations

from sympy import Expr, Matrix, cos, cosh, sin, sinh

from cra_sym.mechanics.identities import vanishes
from cra_sym.symbols import symbol

__all__ = ["eliminated", "jets", "proportional", "root_rows", "tip_rows"]

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


def eliminated() -> Matrix:
    """Return the two conditions on C_1 and C_2 alone, by Cramer's rule: force and moment at the tip."""
    systems = [Matrix.vstack(root_rows(), tip_rows()[row, :]) for row in (0, 1)]
    return Matrix([[system[:, [first, 2, 3]].det() for first in (0, 1)] for system in systems])


def proportional(rows: Matrix, others: Matrix) -> bool:
    """Tell whether each row of a matrix is some row of another but for a factor, exactly: every minor vanishes."""

    def same(one: Matrix, two: Matrix) -> bool:
        columns = combinations(range(one.cols), 2)
        return any(one) and all(vanishes(one[i] * two[j] - one[j] * two[i]) for i, j in columns)

    used = {next((k for k in range(others.rows) if same(rows[r, :], others[k, :])), None) for r in range(rows.rows)}
    return None not in used and len(used) == others.rows
