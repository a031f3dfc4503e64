"""How each language writes a function; the expressions in it come from the language's printer."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import sympy as sp

from cra_sym.codegen.printers import PRINTERS, FortranPrinter, ScalarPrinter
from cra_sym.codegen.program import Argument, Branch, Function

__all__ = ["LANGUAGES", "Language"]


@dataclass(frozen=True)
class Language:
    """A language: its printer, and the words around the expressions.

    Attributes
    ----------
    name, title : str
        Name in calls, and as it is written.
    head : callable
        From a function to the lines before its body.
    step, output, result : str
        Formats of an intermediate result, an entry of the result, and a result that is one number.
    branch : tuple of str
        Formats of the first, a further and the last condition, and the end.
    tail : str
        Last line of a function.
    comment : str
    """

    name: str
    title: str
    head: Callable[[Function], list[str]]
    step: str
    output: str
    result: str
    branch: tuple[str, str, str, str]
    tail: str
    comment: str
    indent: str = "    "
    helpers: tuple[tuple[str, str], ...] = ()

    def helped(self, text: str) -> str:
        """Return the helper functions that a text of generated functions calls."""
        return "\n".join(helper for name, helper in self.helpers if f"{name}(" in text)

    def function(self, function: Function) -> str:
        """Return the text of a function."""
        printer = PRINTERS[self.name](function.places)
        lines = [f"{self.comment} {function.summary}", *self.head(function)]
        if len(function.branches) == 1:
            lines += self._body(function, function.branches[0], printer, self.indent)
        else:
            first, further, last, end = self.branch
            for number, branch in enumerate(function.branches):
                word = last if branch.condition is None else further if number else first
                condition = "" if branch.condition is None else printer.doprint(branch.condition)
                lines.append(printer.wrapped(word.format(condition), self.indent))
                lines += self._body(function, branch, printer, 2 * self.indent)
            lines += [f"{self.indent}{end}"] if end else []
        kind = "function" if function.scalar else "subroutine"
        return "\n".join(
            [*lines, *([self.tail.replace("{name}", function.name).replace("{kind}", kind)] if self.tail else [])]
        )

    def _body(self, function: Function, branch: Branch, printer: ScalarPrinter, indent: str) -> list[str]:
        everything = [*(value for _, value in branch.steps), *branch.outputs]
        printer.guarded = any(value.has(sp.Piecewise) for value in everything)
        lines = [
            printer.wrapped(self.step.format(name=function.places[symbol].name, value=printer.doprint(value)), indent)
            for symbol, value in branch.steps
        ]
        values = [printer.doprint(value) for value in branch.outputs]
        if function.scalar:
            return [*lines, printer.wrapped(self.result.format(value=values[0], name=function.name), indent)]
        if "{values}" in self.output:
            return [*lines, printer.wrapped(self.output.format(values=", ".join(values)), indent)]
        return lines + [
            printer.wrapped(self.output.format(index=i + printer.origin, value=value), indent)
            for i, value in enumerate(values)
        ]


def _c_head(f: Function) -> list[str]:
    def declared(a: Argument) -> str:
        return f"const double {a.name}[{len(a.symbols)}]" if a.row else f"double {a.name}"

    arguments = [declared(a) for a in f.arguments] + ([] if f.scalar else [f"double out[{f.size}]"])
    start = f"static {'double' if f.scalar else 'void'} {f.name}("
    text, width = start, len(start)
    for i, argument in enumerate(arguments):
        piece = argument + (", " if i < len(arguments) - 1 else ")")
        if width + len(piece) > 100:
            text, width = f"{text.rstrip()}\n{' ' * len(start)}", len(start)
        text, width = text + piece, width + len(piece)
    return [text, "{"]


def _fortran_head(f: Function) -> list[str]:
    names = [a.name for a in f.arguments]
    kind = "function" if f.scalar else "subroutine"
    result = " result(out)" if f.scalar else ""
    head = f"pure {kind} {f.name}({', '.join(names + ([] if f.scalar else ['out']))}){result}"
    lines = [FortranPrinter({}).wrapped(head, "  ")]
    for a in f.arguments:
        lines.append(f"    real(dp), intent(in) :: {a.name}{f'({len(a.symbols)})' if a.row else ''}")
    lines.append("    real(dp) :: out" if f.scalar else f"    real(dp), intent(out) :: out({f.size})")
    variables = f.variables
    for start in range(0, len(variables), 12):
        lines.append(f"    real(dp) :: {', '.join(variables[start : start + 12])}")
    return lines


_FORTRAN_HELPERS = (
    (
        "expm1",
        """\
  !> exp(x) - 1 without cancellation; not an intrinsic of Fortran.
  pure elemental function expm1(x) result(out)
    real(dp), intent(in) :: x
    real(dp) :: out
    out = 2.0_dp*sinh(0.5_dp*x)*exp(0.5_dp*x)
  end function expm1
""",
    ),
    (
        "log1p",
        """\
  !> log(1 + x) without cancellation.
  pure elemental function log1p(x) result(out)
    real(dp), intent(in) :: x
    real(dp) :: out
    out = x
    if (abs(x) > 1e-300_dp) out = 2.0_dp*atanh(x/(2.0_dp + x))
  end function log1p
""",
    ),
    (
        "floor_real",
        """\
  !> Largest whole number not above x, as a real.
  pure elemental function floor_real(x) result(out)
    real(dp), intent(in) :: x
    real(dp) :: out
    out = aint(x)
    if (out > x) out = out - 1.0_dp
  end function floor_real
""",
    ),
)
_BRACES = ("if ({}) {{", "}} else if ({}) {{", "}} else {{", "}")

LANGUAGES = {
    language.name: language
    for language in (
        Language(
            "c", "C99", _c_head, "const double {name} = {value};", "out[{index}] = {value};", "return {value};",
            _BRACES, "}", "//",
        ),
        Language(
            "fortran", "Fortran 2008", _fortran_head, "{name} = {value}", "out({index}) = {value}", "out = {value}",
            ("if ({}) then", "else if ({}) then", "else", "end if"), "  end {kind} {name}", "  !",
            helpers=_FORTRAN_HELPERS,
        ),
    )
}  # fmt: skip
