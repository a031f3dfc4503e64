"""What keeps a problem from having natural frequencies: dampers, gyroscopic terms, forces that follow the motion."""

from __future__ import annotations

from sympy import Derivative, Expr, Symbol

from cra_sym.mechanics import StateForm

__all__ = ["asymmetry", "odd_in_time"]


def odd_in_time(term: Expr, t: Symbol) -> bool:
    """Tell whether a force term changes sign when time runs backwards."""
    orders = (number for node in term.atoms(Derivative) for symbol, number in node.variable_count if symbol == t)
    return sum(orders) % 2 == 1


def asymmetry(form: StateForm) -> str:
    """Return what keeps the problem from being symmetric, or an empty text."""
    if form.damped:
        return "the Lagrangian has terms of first order in time"
    half = form.system.rows // 2
    a, b, c, d = (form.system[i : i + half, j : j + half] for i in (0, half) for j in (0, half))
    pairs = ((b, b.T), (c, c.T), (d, -a.T), (form.boundary, form.boundary.T))
    if all(entry.expand() == 0 for left, right in pairs for entry in left - right):
        return ""
    return "the virtual work has forces that follow the motion"
