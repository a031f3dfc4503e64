"""Symbols whose names a problem does not use."""

from __future__ import annotations

from collections.abc import Iterable

from sympy import Expr, S, Symbol

from cra_sym.mechanics.hamilton import HamiltonResult

__all__ = ["Names", "given_expressions"]


class Names:
    """Makes symbols whose names the given expressions do not use."""

    def __init__(self, expressions: Iterable[Expr]) -> None:
        self._used = {symbol.name for expression in expressions for symbol in S(expression).free_symbols}

    def __call__(self, name: str) -> Symbol:
        """Return a symbol of that name, with underscores appended if it is in use."""
        while name in self._used:
            name += "_"
        return Symbol(name)


def given_expressions(result: HamiltonResult) -> list[Expr]:
    """Return everything that was given: a derived symbol must not share a name with what is in these."""
    forces = (force for force, _, _ in result.virtual_work)
    return [result.density, result.left, result.right, *result.domain, *result.essential, *forces]
