"""Expressions as language-independent straight-line functions: shared subexpressions, safe names, branches."""

from __future__ import annotations

import re
import unicodedata
from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import sympy as sp
from sympy.logic.boolalg import Boolean

from cra_sym.codegen.names import FORTRAN, RESERVED
from cra_sym.kernels.source import shared_steps

__all__ = ["Argument", "Case", "DerivedFunction", "Location", "function", "scalars"]


@dataclass(frozen=True)
class Argument:
    """One argument: a number, or a row of numbers under one name.

    Attributes
    ----------
    name : str
        Valid in every language.
    symbols : tuple of Symbol
    row : bool
        Whether the symbols are the entries of a row.
    """

    name: str
    symbols: tuple[sp.Symbol, ...]
    row: bool


@dataclass(frozen=True)
class Location:
    """Location of a symbol's value: a variable, or an entry (from 0) of a row."""

    name: str
    entry: int | None = None


@dataclass(frozen=True)
class Case:
    """Steps and outputs under a condition; None is 'otherwise'."""

    condition: Any
    steps: tuple[tuple[sp.Symbol, sp.Expr], ...]
    outputs: tuple[sp.Expr, ...]


@dataclass(frozen=True)
class DerivedFunction:
    """A function of numbers and rows of numbers, to be printed in any language.

    Attributes
    ----------
    name, summary : str
    arguments : tuple of Argument
    branches : tuple of Case
        One without a condition, or several, the last of which is 'otherwise'.
    scalar : bool
        Whether the result is a number instead of a row.
    places : dict
        Location of every symbol.
    """

    name: str
    summary: str
    arguments: tuple[Argument, ...]
    branches: tuple[Case, ...]
    scalar: bool
    places: dict[sp.Symbol, Location]

    @property
    def size(self) -> int:
        """Number of outputs."""
        return len(self.branches[0].outputs)

    @property
    def variables(self) -> list[str]:
        """Names of all intermediate results, in order, without duplicates."""
        return list(dict.fromkeys(self.places[symbol].name for b in self.branches for symbol, _ in b.steps))


def function(name: str, summary: str, expression: Any, arguments: Sequence[tuple[str, Any]]) -> DerivedFunction:
    """Turn an expression into a straight-line function.

    Parameters
    ----------
    name : str
        Lower-case identifier.
    summary : str
        One line on what it returns.
    expression : Expr or sequence of Expr
        A result that is a Piecewise becomes a branch, each with its own shared subexpressions.
    arguments : sequence of (name, symbol or sequence of symbols)
        A sequence makes a row. Symbols that do not occur are allowed inside a row only.

    Raises
    ------
    ValueError
        If a symbol of the expression is not an argument, or an expression is not real arithmetic.
    """
    scalar = isinstance(expression, sp.Expr)
    outputs = [sp.sympify(e, strict=True) for e in ([expression] if scalar else expression)]
    branches = [_branch(condition, values) for condition, values in _alternatives(outputs)]
    free = set().union(*map(_free_symbols, branches))
    taken: set[str] = {"out", "found"}
    places: dict[sp.Symbol, Location] = {}
    signature = []
    for wish, symbols in arguments:
        row = not isinstance(symbols, sp.Symbol)
        members = tuple(symbols) if row else (symbols,)
        if not free & set(members):
            continue
        given = new_name(wish, taken)
        signature.append(Argument(given, members, row))
        places |= {s: Location(given, i if row else None) for i, s in enumerate(members)}
    missing = sorted(str(s) for s in free - set(places))
    if missing:
        raise ValueError(f"symbols of the expression that are not arguments: {', '.join(missing)}")
    for branch in branches:
        places |= {symbol: Location(f"x{n}") for n, (symbol, _) in enumerate(branch.steps)}
    return DerivedFunction(name, summary, tuple(signature), tuple(branches), scalar, places)


def scalars(symbols: Iterable[sp.Symbol]) -> list[tuple[str, sp.Symbol]]:
    """Return symbols as arguments under their own names."""
    return [(symbol.name, symbol) for symbol in symbols]


def _alternatives(outputs: list[sp.Expr]) -> list[tuple[Any, list[sp.Expr]]]:
    """Return the conditions common to all outputs, and the outputs under each."""
    if not all(isinstance(e, sp.Piecewise) for e in outputs):
        return [(None, outputs)]
    conditions = [tuple(condition for _, condition in e.args) for e in outputs]
    if len(set(conditions)) > 1 or conditions[0][-1] != sp.true:
        return [(None, outputs)]
    return [
        (None if condition == sp.true else condition, [e.args[i][0] for e in outputs])
        for i, condition in enumerate(conditions[0])
    ]


def _branch(condition: Any, values: list[sp.Expr]) -> Case:
    """Share subexpressions; conditions are written inline, since variables are numbers."""
    steps, values = shared_steps(values)
    conditions: dict[sp.Basic, sp.Basic] = {}
    kept = []
    for symbol, value in steps:
        value = value.xreplace(conditions)
        if isinstance(value, Boolean):
            conditions[symbol] = value
        else:
            kept.append((symbol, plain(value)))
    results = [plain(value.xreplace(conditions)) for value in values]
    used = Counter(symbol for value in (*dict(kept).values(), *results) for symbol in _symbols_in(value))
    alone = {symbol: value for symbol, value in kept if used[symbol] == 1 and symbol in results}
    needed = tuple(step for step in kept if step[0] not in alone)
    return Case(condition, needed, tuple(alone.get(value, value) for value in results))


def _symbols_in(expression: sp.Expr) -> Iterator[sp.Symbol]:
    """Yield a symbol once for each time it stands in an expression."""
    return (node for node in sp.preorder_traversal(expression) if isinstance(node, sp.Symbol))


def _free_symbols(branch: Case) -> set[sp.Symbol]:
    expressions = [*(value for _, value in branch.steps), *branch.outputs]
    found = set().union(*(e.free_symbols for e in (*expressions, branch.condition) if e is not None))
    return found - {symbol for symbol, _ in branch.steps}


def new_name(wish: str, taken: set[str]) -> str:
    """Return a name that is valid in every language and not taken yet, regardless of case; add it to those taken."""
    base = re.sub(r"_+", "_", re.sub(r"[^0-9A-Za-z]", "_", _latin(wish))).strip("_") or "value"
    base = base if base[0].isalpha() else f"n_{base}"
    base = base[:40]
    name, number = base, 1
    lower = {other.lower() for other in taken}
    while name in RESERVED or name.lower() in FORTRAN | lower or re.fullmatch(r"[xX]\d+[a-c]?", name):
        number += 1
        name = f"{base}_{number}"
    taken.add(name)
    return name


def _latin(text: str) -> str:
    """Return a text with Greek letters spelled out."""
    found = []
    for letter in unicodedata.normalize("NFKD", text):
        word = unicodedata.name(letter, "")
        greek = word.split()[-1].lower() if word.startswith("GREEK ") else letter
        found.append(greek.capitalize() if letter.isupper() and greek != letter else greek)
    return "".join(found)


_REWRITTEN: dict[Any, Any] = {
    sp.sinc: lambda u: sp.Piecewise((sp.sin(u) / u, sp.Ne(u, 0)), (1, True)),
    sp.sign: lambda u: sp.Piecewise((-1, u < 0), (1, u > 0), (0, True)),
    sp.Heaviside: lambda u, h: sp.Piecewise((0, u < 0), (1, u > 0), (h, True)),
    sp.ITE: lambda c, a, b: (c & a) | (~c & b),
    sp.sec: lambda u: 1 / sp.cos(u),
    sp.csc: lambda u: 1 / sp.sin(u),
    sp.cot: lambda u: sp.cos(u) / sp.sin(u),
    sp.sech: lambda u: 1 / sp.cosh(u),
    sp.csch: lambda u: 1 / sp.sinh(u),
    sp.coth: lambda u: 1 / sp.tanh(u),
    sp.acot: lambda u: sp.atan(1 / u),
    sp.asec: lambda u: sp.acos(1 / u),
    sp.acsc: lambda u: sp.asin(1 / u),
}


def plain(expression: Any) -> sp.Expr:
    """Return the expression in the functions every language has."""
    expression = sp.sympify(expression, strict=True)
    if expression.has(sp.I, sp.zoo, sp.nan, sp.oo, -sp.oo):
        raise ValueError("the expression holds imaginary or infinite numbers: exported code computes with real ones")
    for kind, rewritten in _REWRITTEN.items():
        if expression.has(kind):
            expression = expression.replace(kind, rewritten)
    return expression
