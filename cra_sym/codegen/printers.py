"""SymPy printers for C, Fortran and the restricted form, with all numbers as doubles and fractions as one division."""

from __future__ import annotations

import re
import textwrap
from collections.abc import Mapping
from typing import Any, ClassVar

import sympy as sp
from sympy.printing.codeprinter import CodePrinter
from sympy.printing.precedence import PRECEDENCE
from sympy.printing.pycode import PythonCodePrinter

from cra_sym.codegen.program import Argument, DerivedFunction, Location

__all__ = ["FormPrinter", "ScalarPrinter"]

_SAME = "sqrt exp expm1 log log1p sin cos tan asin acos atan atan2 sinh cosh tanh asinh acosh atanh floor".split()
_EXACT = 2**53  # integers up to this are doubles


class ScalarPrinter(CodePrinter):  # type: ignore[misc]
    """Base class of the printers: arithmetic of doubles in a form that is the same in all languages.

    Attributes
    ----------
    functions : dict
        SymPy's name of a function to the language's.
    entry : str
        Format of an entry of a row, from ``name`` and ``index``.
    origin : int
        Index of the first entry.
    """

    functions: ClassVar[dict[str, str]] = {}
    entry = "{name}[{index}]"
    origin = 0
    choice = "({condition} ? {value} : {otherwise})"
    both, either, negation, unequal = "&&", "||", "!({})", "!="
    power = "pow({base}, {exponent})"

    def __init__(self, places: Mapping[sp.Symbol, Location]) -> None:
        super().__init__()
        self.places = places

    guarded = False  # whether a quotient may be discarded by a later conditional

    def number(self, value: float) -> str:
        """Return a literal that reads back as exactly this double."""
        return repr(value)

    def doprint(self, expression: Any) -> str:
        """Return the expression as text on one line.

        Raises
        ------
        ValueError
            If it contains something without an equivalent in the language.
        """
        return str(self._print(expression))

    def _print(self, expr: Any, **kwargs: Any) -> str:
        if isinstance(expr, sp.Function) and not isinstance(expr, sp.Piecewise):
            return self._called(expr)
        return str(super()._print(expr, **kwargs))

    def _called(self, expr: Any) -> str:
        name = type(expr).__name__
        if name in ("Max", "Min"):
            terms = [self._print(term) for term in expr.args]
            text = terms[-1]
            for term in reversed(terms[:-1]):
                text = f"{self.functions[name]}({term}, {text})"
            return text
        if name == "log" and len(expr.args) == 2:
            return self._print(sp.Mul(sp.log(expr.args[0]), 1 / sp.log(expr.args[1]), evaluate=False))
        if name not in self.functions:
            raise ValueError(f"{name} has no equivalent in {type(self).__name__.removesuffix('Printer')}")
        return f"{self.functions[name]}({', '.join(self._print(term) for term in expr.args)})"

    _print_Max = _print_Min = _called

    def _print_Symbol(self, expr: sp.Symbol) -> str:
        place = self.places[expr]
        if place.entry is None:
            return place.name
        return self.entry.format(name=place.name, index=place.entry + self.origin)

    _print_Dummy = _print_Symbol

    def _print_Integer(self, expr: sp.Integer) -> str:
        return self.number(_double(expr))

    _print_Zero = _print_One = _print_NegativeOne = _print_Integer

    def _print_Rational(self, expr: sp.Rational) -> str:
        if max(abs(expr.p), expr.q) > _EXACT:
            return self.number(_double(expr))
        return f"{self.number(float(expr.p))}/{self.number(float(expr.q))}"

    _print_Half = _print_Rational

    def _print_Float(self, expr: sp.Float) -> str:
        return self.number(_double(expr))

    _print_NumberSymbol = _print_Float
    _print_Pi = _print_Exp1 = _print_GoldenRatio = _print_EulerGamma = _print_Catalan = _print_Float

    def _print_Mul(self, expr: sp.Mul) -> str:
        return str(CodePrinter._print_Mul(self, expr))

    def _print_Pow(self, expr: sp.Pow) -> str:
        if expr.exp == -1:
            return f"{self.number(1.0)}/{self.parenthesize(expr.base, PRECEDENCE['Pow'])}"
        if abs(expr.exp) == sp.S.Half:
            root = f"{self.functions['sqrt']}({self._print(expr.base)})"
            return root if expr.exp > 0 else f"{self.number(1.0)}/{root}"
        if expr.exp == sp.Rational(1, 4):
            return f"{self.functions['sqrt']}({self.functions['sqrt']}({self._print(expr.base)}))"
        if expr.exp == 2 and expr.base.is_Symbol:
            return f"{self._print(expr.base)}*{self._print(expr.base)}"
        if expr.base == sp.E:
            return f"{self.functions['exp']}({self._print(expr.exp)})"
        return self._powered(expr)

    def _powered(self, expr: sp.Pow) -> str:
        return self.power.format(base=self._print(expr.base), exponent=self._print(expr.exp))

    def _print_Piecewise(self, expr: sp.Piecewise) -> str:
        if expr.args[-1].cond != sp.true:
            raise ValueError(f"a Piecewise without a last case: {expr}")
        text = self._print(expr.args[-1].expr)
        for value, condition in reversed(expr.args[:-1]):
            text = self.choice.format(condition=self._print(condition), value=self._print(value), otherwise=text)
        return text

    def _print_Relational(self, expr: Any) -> str:
        operator = {"!=": self.unequal}.get(expr.rel_op, expr.rel_op)
        return f"({self._print(expr.lhs)} {operator} {self._print(expr.rhs)})"

    def _print_And(self, expr: Any) -> str:
        return f"({f' {self.both} '.join(map(self._print, expr.args))})"

    def _print_Or(self, expr: Any) -> str:
        return f"({f' {self.either} '.join(map(self._print, expr.args))})"

    def _print_Not(self, expr: Any) -> str:
        return self.negation.format(self._print(expr.args[0]))

    def wrapped(self, text: str, indent: str) -> str:
        """Return a statement on as many lines as it needs."""
        return "\n".join(
            textwrap.wrap(text, 110, initial_indent=indent, subsequent_indent=f"{indent}    ", break_long_words=False)
        )


def _double(value: Any) -> float:
    number = float(value)
    if number in (float("inf"), float("-inf")):
        raise ValueError("number out of the range of double precision")
    return number


class FormPrinter(ScalarPrinter, PythonCodePrinter):  # type: ignore[misc]
    """The restricted form, which all languages are printed from."""

    functions: ClassVar = {n: n for n in _SAME} | {"Abs": "abs", "ceiling": "ceil", "Max": "max", "Min": "min"}
    choice = "({value} if {condition} else {otherwise})"
    both, either, negation = "and", "or", "(not {})"
    power = "pow({base}, {exponent})"
    helper = """\
def _inverse(x: float) -> float:
    \"\"\"Return 1 / x, and 0 for 0: where that occurs the quotient is discarded.\"\"\"
    return 1.0 / (x if x != 0.0 else 1.0) if x != 0.0 else 0.0


"""

    def _print_Mul(self, expr: sp.Mul) -> str:
        if not (self.guarded and any(f.is_Pow and f.exp == -1 for f in expr.args)):
            return super()._print_Mul(expr)
        minus = expr.args[0] == -1
        text = "*".join(self.parenthesize(factor, PRECEDENCE["Mul"]) for factor in expr.args[minus:])
        return f"-{text}" if minus else text

    def _print_Pow(self, expr: sp.Pow) -> str:
        return f"_inverse({self._print(expr.base)})" if self.guarded and expr.exp == -1 else super()._print_Pow(expr)

    @classmethod
    def helped(cls, text: str) -> str:
        """Return the helper functions that a text calls."""
        return cls.helper if "_inverse(" in text else ""

    @classmethod
    def text_of(cls, function: DerivedFunction, name: str, *, checked: bool) -> str:
        """Return a function of numbers, with one row of results and at most three branches, as text.

        If checked, it raises where a result is not finite.
        """
        lines = []
        for number, branch in enumerate(function.branches):
            letter = "" if len(function.branches) == 1 else "abc"[number]
            own = {s: Location(f"{function.places[s].name}{letter}") for s, _ in branch.steps}
            printer = cls(function.places | own)
            values = (*(v for _, v in branch.steps), *branch.outputs)
            printer.guarded = any(value.has(sp.Piecewise) for value in values)
            indent = "" if len(function.branches) == 1 else "    "
            if indent:
                word = "else" if branch.condition is None else "elif" if number else "if"
                lines.append(f"{word}{'' if branch.condition is None else ' ' + printer.doprint(branch.condition)}:")
            steps = [f"{printer.places[symbol].name} = {printer.doprint(value)}" for symbol, value in branch.steps]
            result = "return {1}" if function.scalar else "found[{0}] = {1}"
            steps += [result.format(i, printer.doprint(value)) for i, value in enumerate(branch.outputs)]
            lines += [indent + step for step in steps]
        parameters = "".join(f"{a.name}: {_kind(a)}, " for a in function.arguments)
        if function.scalar:
            head = f"def {name}({parameters.removesuffix(', ')}) -> float:"
        else:
            head = f"def {name}({parameters}found: Out[Row[float, {function.size}]]) -> None:"
        if checked:
            finite = " and ".join(f"isfinite(found[{i}])" for i in range(function.size))
            lines += [f"if not ({finite}):", "    raise Overflow"]
        entries = [f"{a.name}: {', '.join(s.name for s in a.symbols)}" for a in function.arguments if _is_told(a)]
        doc = [f'"""{function.summary}', "", *entries, '"""'] if entries else [f'"""{function.summary}"""']
        body = "\n    ".join([*doc, *lines]).replace("\n    \n", "\n\n")
        return f"{head}\n    {body}\n"


def _is_told(argument: Argument) -> bool:
    """Return whether the entries of a row have names that say more than their number."""
    return argument.row and not all(re.fullmatch(r"k\d+", symbol.name) for symbol in argument.symbols)


def _kind(argument: Argument) -> str:
    return f"Row[float, {len(argument.symbols)}]" if argument.row else "float"
