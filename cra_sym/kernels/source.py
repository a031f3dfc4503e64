"""Python source from SymPy expressions, which NumPy evaluates on arrays and LLVM compiles for scalars."""

from __future__ import annotations

import ast
import builtins
import keyword
import re
from collections.abc import Iterable, Mapping, Sequence, Set
from itertools import islice, pairwise
from typing import Any

import numpy as np
import sympy as sp
from sympy.printing.codeprinter import PrintMethodNotImplementedError
from sympy.printing.numpy import SciPyPrinter
from sympy.printing.precedence import PRECEDENCE
from sympy.simplify.cse_main import tree_cse

from cra_sym.checks import shown

__all__ = ["check_arguments", "module_source", "shared_steps"]

Layout = Any  # (): one expression; (2, 2): a matrix; [layouts]: a sequence; {name: layout}: a mapping

_LARGEST = 20_000  # nodes up to which sums and products are searched for common parts
_LONGEST_CHAIN = 64  # integer powers up to this become products


class _Printer(SciPyPrinter):  # type: ignore[misc]  # SymPy has no types
    """SciPy's printer with given names, and with conditions as operators and ``where``, which work for scalars too."""

    def __init__(self, names: Mapping[sp.Symbol, str], shared: Mapping[sp.Symbol, sp.Basic]) -> None:
        super().__init__({"fully_qualified_modules": False, "allow_unknown_functions": False})
        self.names, self.shared = names, shared

    def _print_Symbol(self, expr: sp.Symbol) -> str:
        return self.names[expr]

    _print_Dummy = _print_Symbol

    def _print_NumberSymbol(self, expr: sp.NumberSymbol) -> str:
        return repr(float(expr))  # SciPy's constants would need SciPy

    _print_Pi = _print_Exp1 = _print_GoldenRatio = _print_EulerGamma = _print_NumberSymbol

    def _print_Integer(self, expr: sp.Integer) -> str:
        if abs(expr) < 2**31:
            return str(expr)
        if abs(expr) >= 2**1024:
            raise ValueError("expression: it holds a number out of the range of double precision")
        return repr(float(expr))

    def _print_Pow(self, expr: sp.Pow, rational: bool = False) -> str:
        base = self.parenthesize(expr.base, PRECEDENCE["Pow"])
        if expr.exp == 2 and expr.base.is_Symbol:
            return f"{base}*{base}"
        if expr.exp == -1:
            return f"1.0/{base}"
        return str(super()._print_Pow(expr, rational))

    def _print_coth(self, expr: sp.coth) -> str:
        """Write 1/tanh: SymPy's exponentials cancel near 0 and overflow."""
        return f"(1.0/{self._print(sp.tanh(*expr.args))})"

    def _print_csch(self, expr: sp.csch) -> str:
        return f"(1.0/{self._print(sp.sinh(*expr.args))})"

    def _print_sech(self, expr: sp.sech) -> str:
        return f"(1.0/{self._print(sp.cosh(*expr.args))})"

    def _print_Piecewise(self, expr: sp.Piecewise) -> str:
        """Write nested choices: by halves where the branches are the intervals of a table, else one after another."""
        if self._is_table([condition for _, condition in expr.args]):
            return self._halved(expr.args)
        *branches, (last, condition) = expr.args
        text = self._print(last) if condition == True else self._where(last, condition, "nan")  # noqa: E712
        for value, condition in reversed(branches):
            text = self._where(value, condition, text)
        return text

    def _is_table(self, conditions: Sequence[Any]) -> bool:
        """Return whether the conditions are ``x < number`` with one x and ascending numbers, and at last True."""
        *below, last = (self.shared.get(condition, condition) for condition in conditions)
        return (
            last == True  # noqa: E712
            and all(
                type(c) in (sp.StrictLessThan, sp.LessThan) and (c.rhs.is_Rational or c.rhs.is_Float) for c in below
            )
            and len({c.lhs for c in below}) == 1
            and all(first.rhs < second.rhs for first, second in pairwise(below))
        )

    def _halved(self, branches: Sequence[Any]) -> str:
        if len(branches) == 1:
            return str(self._print(branches[0][0]))
        middle = len(branches) // 2
        self._module_format("numpy.where")
        condition, first, second = branches[middle - 1][1], branches[:middle], branches[middle:]
        return f"where({self._print(condition)}, {self._halved(first)}, {self._halved(second)})"

    def _where(self, value: sp.Expr, condition: Any, otherwise: str) -> str:
        self._module_format("numpy.where")
        if otherwise == "nan":
            self._module_format("numpy.nan")
        return f"where({self._print(condition)}, {self._print(value)}, {otherwise})"

    def _print_ITE(self, expr: Any) -> str:
        return self._print_Piecewise(sp.Piecewise((expr.args[1], expr.args[0]), (expr.args[2], True)))

    def _print_Relational(self, expr: Any) -> str:
        return f"({self._print(expr.lhs)} {expr.rel_op} {self._print(expr.rhs)})"

    def _print_And(self, expr: Any) -> str:
        return f"({' & '.join(map(self._print, expr.args))})"

    def _print_Or(self, expr: Any) -> str:
        return f"({' | '.join(map(self._print, expr.args))})"

    def _print_Not(self, expr: Any) -> str:
        return f"({self._print(expr.args[0])} == False)"

    def _print_Max(self, expr: Any) -> str:
        return self._pairwise("maximum", expr.args)

    def _print_Min(self, expr: Any) -> str:
        return self._pairwise("minimum", expr.args)

    def _pairwise(self, function: str, terms: Sequence[sp.Expr]) -> str:
        self._module_format(f"numpy.{function}")
        text = self._print(terms[-1])
        for term in reversed(terms[:-1]):
            text = f"{function}({self._print(term)}, {text})"
        return str(text)


def check_arguments(arguments: Any) -> tuple[sp.Symbol, ...]:
    """Return the arguments as a tuple of distinct symbols.

    Raises
    ------
    TypeError
        If an argument is not a symbol: a function such as w(t) has to be replaced by a symbol first.
    ValueError
        If a symbol comes twice.
    """
    if isinstance(arguments, sp.Symbol):
        return (arguments,)
    if not isinstance(arguments, Iterable) or isinstance(arguments, str) or getattr(arguments, "ndim", 1) != 1:
        raise TypeError(f"arguments = {shown(arguments)}: must be a sequence of SymPy symbols")
    symbols: tuple[sp.Symbol, ...] = ()
    for symbol in arguments:  # one by one, since the sequence may be infinite
        if not isinstance(symbol, sp.Symbol):
            raise TypeError(f"arguments: {shown(symbol)} must be a SymPy symbol; substitute one for it")
        symbols += (symbol,)
    twice = {s.name for k, s in enumerate(symbols) if s in symbols[:k]}
    if twice:
        raise ValueError(f"arguments come twice: {', '.join(sorted(twice))}")
    return symbols


def module_source(expression: Any, arguments: Sequence[sp.Symbol]) -> str:
    """Return the text of a module: imports, the constants ARGUMENTS and LAYOUT, and the function ``evaluate``.

    Common subexpressions are computed once over all outputs; nothing is expanded. A single expression is returned
    directly, anything else as a flat tuple with its structure in LAYOUT.
    """
    symbols = check_arguments(arguments)
    layout, outputs = _flatten(expression)
    found = set().union(*(e.free_symbols | e.atoms(sp.Symbol) for e in outputs))
    missing = sorted(str(s) for s in found - set(symbols))
    if missing:
        raise ValueError(f"symbols of the expression that are not arguments: {', '.join(missing)}")
    steps, outputs = shared_steps(outputs)
    printer, values, results = _with_names(symbols, steps, outputs, frozenset())
    names = printer.names
    lines = [f"{names[symbol]} = {value}" for (symbol, _), value in zip(steps, values, strict=True)]
    lines.append(f"return {results[0]}" if layout == () else f"return ({''.join(text + ', ' for text in results)})")
    imports = [f"from {m} import {', '.join(sorted(n))}\n" for m, n in sorted(printer.module_imports.items())]
    signature = ", ".join(names[s] for s in symbols)
    body = "\n    ".join(lines)
    constants = f"ARGUMENTS = {tuple(s.name for s in symbols)!r}\nLAYOUT = {layout!r}\n"
    text = f"{''.join(imports)}\n{constants}\n\ndef evaluate({signature}):\n    {body}\n"
    _check_names(text)
    return text


def shared_steps(outputs: Sequence[sp.Expr]) -> tuple[list[tuple[sp.Symbol, sp.Expr]], list[sp.Expr]]:
    """Share common subexpressions over all outputs and turn integer powers into products; nothing is expanded."""
    names = sp.numbered_symbols("x", cls=sp.Dummy)
    nodes = (node for value in outputs for node in sp.preorder_traversal(value))
    if next(islice(nodes, _LARGEST, None), None) is not None:  # in a nested recurrence the repeated parts are its nodes
        replacements, outputs = tree_cse(outputs, names)
    else:
        replacements, outputs = sp.cse(outputs, symbols=names, list=True)
    return _without_powers(replacements, outputs)


def _flatten(expression: Any) -> tuple[Layout, list[sp.Expr]]:
    if isinstance(expression, Mapping):
        parts = {str(key): _flatten(value) for key, value in expression.items()}
        return {key: layout for key, (layout, _) in parts.items()}, [e for _, es in parts.values() for e in es]
    if isinstance(expression, (sp.MatrixBase, sp.NDimArray)):
        return tuple(map(int, expression.shape)), [sp.sympify(e, strict=True) for e in sp.flatten(expression)]
    if isinstance(expression, (list, tuple, sp.Tuple)):
        sequence = [_flatten(value) for value in expression]
        return [layout for layout, _ in sequence], [e for _, es in sequence for e in es]
    if isinstance(expression, (int, float, complex, np.number)) and not isinstance(expression, bool):
        expression = sp.sympify(expression, strict=True)
    if not isinstance(expression, sp.Expr):
        raise TypeError(
            f"expression = {shown(expression)}: must be SymPy expressions, matrices, sequences or dicts of them"
        )
    return (), [expression]


def _with_names(
    symbols: Sequence[sp.Symbol],
    steps: Sequence[tuple[sp.Symbol, sp.Expr]],
    outputs: Sequence[sp.Expr],
    taken: Set[str],
) -> tuple[_Printer, list[str], list[str]]:
    """Print steps and outputs, with other names of symbols if one is the name of a function."""
    names: dict[sp.Symbol, str] = {}
    for symbol in symbols:
        _assign_name(symbol, names, taken)
    for number, (symbol, _) in enumerate(steps):
        _assign_name(symbol, names, taken, f"x{number}")
    printer = _Printer(names, dict(steps))
    values = [_printed(printer, value) for _, value in steps]
    results = [_printed(printer, value) for value in outputs]
    imported: set[str] = set().union(*printer.module_imports.values())
    if imported & set(names.values()):
        return _with_names(symbols, steps, outputs, imported)
    return printer, values, results


def _assign_name(symbol: sp.Symbol, names: dict[sp.Symbol, str], taken: Set[str], wish: str | None = None) -> None:
    """Give ``symbol`` a unique identifier that is not a name of Python or NumPy."""
    base = wish or re.sub(r"[^0-9A-Za-z_]", "_", symbol.name)
    base = base if re.match(r"[A-Za-z]", base) else f"s{base}"
    others = taken | set(names.values())
    while base in others or keyword.iskeyword(base) or any(hasattr(m, base) for m in (builtins, np)):
        base += "_"
    names[symbol] = base


def _printed(printer: _Printer, expression: sp.Expr) -> str:
    try:
        return str(printer.doprint(expression))
    except (PrintMethodNotImplementedError, KeyError, NotImplementedError):
        kinds = sorted({e.func.__name__ for e in sp.preorder_traversal(expression) if not e.is_Atom})
        raise ValueError(f"no NumPy function for an expression made of {', '.join(kinds)}") from None


def _check_names(text: str) -> None:
    """Raise an error for a name without a binding, which the printer used without an import."""
    used, bound = set(), {"abs"}
    for node in ast.walk(ast.parse(text)):
        match node:
            case ast.Name(id=name, ctx=ast.Load()):
                used.add(name)
            case ast.Name(id=name) | ast.arg(arg=name) | ast.alias(name=name):
                bound.add(name)
    if used - bound:
        raise ValueError(f"no NumPy function for {', '.join(sorted(used - bound))} in the expression")


def _without_powers(
    replacements: Sequence[tuple[sp.Symbol, sp.Expr]], outputs: Sequence[sp.Expr]
) -> tuple[list[tuple[sp.Symbol, sp.Expr]], list[sp.Expr]]:
    """Turn integer powers into products by repeated squaring, sharing every intermediate power."""
    steps: list[tuple[sp.Symbol, sp.Expr]] = []
    known: dict[tuple[sp.Expr, int], sp.Symbol] = {}
    aliases: dict[sp.Expr, sp.Expr] = {}

    def power(base: sp.Expr, exponent: int) -> sp.Expr:
        if exponent == 1 and base.is_Symbol:
            return base
        if (base, exponent) not in known:
            if exponent == 1:
                value = base
            elif exponent % 2:
                value = power(base, exponent - 1) * power(base, 1)
            else:
                value = power(base, exponent // 2) ** 2
            known[base, exponent] = sp.Dummy("x")
            steps.append((known[base, exponent], value))
        return known[base, exponent]

    def rewrite(expression: sp.Expr) -> sp.Expr:
        if expression.is_Atom or isinstance(
            expression, (sp.RootOf, sp.RootSum)
        ):  # whose polynomial is not an expression
            return aliases.get(expression, expression)
        terms = [rewrite(term) for term in expression.args]
        if expression.is_Pow and expression.exp.is_Integer and 1 < abs(expression.exp) <= _LONGEST_CHAIN:
            product = power(terms[0], abs(int(expression.exp)))
            return product if expression.exp > 0 else 1 / product
        if terms == list(expression.args):
            return expression
        keep = {"evaluate": False} if expression.is_Add or expression.is_Mul or expression.is_Pow else {}
        return expression.func(*terms, **keep)

    for symbol, value in replacements:
        value = rewrite(value)
        if value.is_Symbol:
            aliases[symbol] = value
        else:
            steps.append((symbol, value))
    return steps, [rewrite(value) for value in outputs]
