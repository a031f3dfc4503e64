"""The dimensionless groups of the arm, defined once."""

from __future__ import annotations

from sympy import Expr, Symbol, solve

from cra_sym.symbols import symbol

__all__ = ["GROUPS", "in_groups"]

L, E, I_z, rho, A = (symbol(name) for name in ("L", "E", "I_z", "rho", "A"))
k_t, k_r, m_e, J_e = (symbol(name) for name in ("k_t", "k_r", "m_e", "J_e"))

#: Each parameter of the joint and of the end-effector, with its group and the definition of the group.
GROUPS: dict[Symbol, tuple[Symbol, Expr]] = {
    k_t: (symbol("kappa_t"), k_t * L**3 / (E * I_z)),
    k_r: (symbol("kappa_r"), k_r * L / (E * I_z)),
    m_e: (symbol("mu"), m_e / (rho * A * L)),
    J_e: (symbol("iota"), J_e / (rho * A * L**3)),
}


def in_groups() -> dict[Symbol, Expr]:
    """Return the parameters of joint and end-effector in terms of their groups."""
    return {parameter: solve(value - group, parameter)[0] for parameter, (group, value) in GROUPS.items()}
