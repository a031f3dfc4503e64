"""A sum over modes: every name that ends in ``_i`` stands for the member i."""

from __future__ import annotations

from typing import Any

from sympy import Expr, Function, Sum, Symbol, oo
from sympy.core.function import AppliedUndef

from cra_sym.symbols import symbol

__all__ = ["ModalSum", "member", "written_out"]


def member(expression: Any, index: str) -> Any:
    """Return ``expression`` with each name ``..._i`` replaced by ``..._<index>``."""
    renamed = expression
    for function in {atom.func for atom in expression.atoms(AppliedUndef) if atom.func.__name__.endswith("_i")}:
        renamed = renamed.replace(function, Function(function.__name__[:-1] + index))
    for atom in {atom for atom in expression.atoms(Symbol) if atom.name.endswith("_i")}:
        renamed = renamed.xreplace({atom: Symbol(atom.name[:-1] + index, **atom.assumptions0)})
    return renamed


def written_out(expression: Any, *indices: str) -> Any:
    """Return ``expression`` with the members of the given indices in place of each sum over modes."""
    return expression.replace(lambda part: isinstance(part, ModalSum), lambda part: part.members(*indices))


class ModalSum(Sum):  # type: ignore[misc]  # SymPy has no types
    """Sum over all modes of a term written for mode i.

    SymPy's own ``Sum`` would take names such as ``phi_i`` for constants and multiply them by the number of terms, so
    this one stays unevaluated; :meth:`members` writes some of its terms out.

    >>> from cra_sym.symbols import phi_i, q_i
    >>> ModalSum(phi_i * q_i).members("i", "j")
    phi_i(x)*q_i(t) + phi_j(x)*q_j(t)
    """

    def __new__(cls, term: Any, *limits: Any, **_: Any) -> Any:
        """Take the term of mode i."""
        return super().__new__(cls, term, *(limits or [(symbol("i"), 1, oo)]))

    def _sympyrepr(self, printer: Any) -> str:
        """Return text that evaluates to the same sum: its class is not one of those that SymPy brings."""
        arguments = ", ".join(printer._print(part) for part in self.args)
        return f"__import__({__name__!r}, fromlist=['ModalSum']).ModalSum({arguments})"

    def doit(self, **_: Any) -> Expr:
        """Return the sum itself: it has no closed form."""
        return self

    def members(self, *indices: str) -> Expr:
        """Return the sum of the members with the given indices."""
        return sum((member(self.function, index) for index in indices), start=self.function * 0)
