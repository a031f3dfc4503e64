"""The parameters of a Lagrangian."""

from __future__ import annotations

import itertools
from collections.abc import Iterable

from sympy import Add, Expr, Symbol, sympify
from sympy.core.function import AppliedUndef

from cra_sym.mechanics import HamiltonResult

__all__ = ["parameters"]


def parameters(given: Iterable[Expr], result: HamiltonResult) -> tuple[Symbol, ...]:
    """Return every symbol of the expressions but x and t, by name; refuse undeclared fields and duplicate names."""
    expressions = [sympify(part, strict=True) for part in given]
    own = {result.x, result.t}
    known = {f.func for f in (*result.fields, *result.coordinates)}
    for term in (term for e in expressions for term in Add.make_args(e)):
        for function in term.atoms(AppliedUndef):
            if function.func not in known and own <= function.free_symbols:
                raise ValueError(f"term {term}: {function} is not one of the fields {list(map(str, result.fields))}")
    found = sorted({s for e in expressions for s in e.free_symbols} - own, key=lambda s: (s.name, str(s)))
    for first, second in itertools.pairwise(found):
        if first.name == second.name:
            raise ValueError(f"two different symbols are named {first.name}: their assumptions differ")
    return tuple(found)
