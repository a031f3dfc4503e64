"""Header of every exported file: the model in words and formulas, and their hash."""

from __future__ import annotations

import hashlib
import textwrap

import sympy as sp
from sympy.core.function import AppliedUndef
from sympy.printing.str import StrPrinter

from cra_sym.model.lagrangian import Model

__all__ = ["stated"]


class _Plain(StrPrinter):  # type: ignore[misc]
    """Formulas in short: v for v(x, t), v_xx for its second derivative by x, ^ for powers."""

    def __init__(self, x: sp.Symbol, t: sp.Symbol) -> None:
        super().__init__()
        self._x, self._t = x, t

    def _print_AppliedUndef(self, expr: AppliedUndef, name: str = "") -> str:
        name = name or expr.func.__name__
        short = set(expr.args) <= {self._x, self._t}
        return name if short else f"{name}({', '.join(map(self._print, expr.args))})"

    _print_Function = _print_AppliedUndef

    def _print_Derivative(self, expr: sp.Derivative) -> str:
        if not isinstance(expr.expr, AppliedUndef):
            return str(super()._print_Derivative(expr))
        letters = [str(self._t if of == self._t else self._x) for of in expr.variables]
        joined = ("" if all(len(letter) == 1 for letter in letters) else "_").join(letters)
        return self._print_AppliedUndef(expr.expr, f"{expr.expr.func.__name__}_{joined}")

    def _print_Subs(self, expr: sp.Subs) -> str:
        if not isinstance(expr.expr, sp.Derivative) or expr.variables != (self._x,):
            return str(super()._print_Subs(expr))
        place = ", ".join([self._print(expr.point[0]), str(self._t)])
        return f"{self._print(expr.expr)}({place})"

    def _print_Equality(self, expr: sp.Eq) -> str:
        return f"{self._print(expr.lhs)} = {self._print(expr.rhs)}"


def stated(model: Model, width: int = 96) -> tuple[str, ...]:
    """Return a description of a model, in lines: Lagrangian, boundary conditions, the hash of both, linearisation."""
    pieces, found = model.pieces, model.equations
    printer = _Plain(found.x, found.t)
    parts = {
        "Lagrangian density": [pieces["density"]],
        "Lagrangian at the ends": [pieces["left"], pieces["right"]],
        "Lagrangian inside": pieces["inside"],
        "Virtual work": pieces["virtual_work"],
        "Field equations": found.field_equations,
        "Boundary conditions": found.boundary_conditions,
        "Equations of the coordinates": found.coordinate_equations,
    }
    stated_parts = {
        name: [printer.doprint(e).replace("**", "^") for e in values if e is not None and e != 0]
        for name, values in parts.items()
    }
    statements = [f"{name}: {'; '.join(texts)}" for name, texts in stated_parts.items() if texts]
    digest = hashlib.sha256("\n".join(statements).encode()).hexdigest()
    lines = [line for text in statements for line in textwrap.wrap(text, width, subsequent_indent="  ")]
    linear = ("The equations are nonlinear; the code computes with them linearised about zero.",)
    hashed = f"SHA-256 of the above: {digest}"
    return (*(line.replace("*/", "* /") for line in lines), hashed, *(linear if model.nonlinear else ()))
