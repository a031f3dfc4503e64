"""A derivation as a chain of frozen steps, displayed as LaTeX in subscript notation."""

from __future__ import annotations

import re
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

from sympy import Basic, Derivative, Function, Subs, Symbol
from sympy.core.function import AppliedUndef
from sympy.printing.latex import LatexPrinter

from cra_sym.mechanics.layout import arranged

__all__ = ["Step", "Steps", "compact_latex", "display_latex", "mathematics", "variation_of"]

_DELTA = "δ"


def variation_of(unknown: AppliedUndef) -> AppliedUndef:
    """Return the variation ``δv(x, t)`` of the unknown ``v(x, t)``."""
    return Function(_DELTA + unknown.func.__name__)(*unknown.args)


class _CompactPrinter(LatexPrinter):  # type: ignore[misc]  # SymPy has no types
    r"""Printer of derivatives as subscripts (``v_{xx}``), dots (``\dot{w}``) or primes (``\phi'(0)``).

    A field ``v(x, t)`` takes subscripts, at an end too (``v_{x}(0,t)``); a function of time alone takes dots; any other
    function of one argument takes primes. Derivatives by anything else are fractions.
    """

    def __init__(self, variables: tuple[str, str]) -> None:
        super().__init__()
        self._variables = variables

    def _own(self, argument: Basic) -> bool:
        return isinstance(argument, Symbol) and argument.name in self._variables

    def _head(self, function: AppliedUndef) -> tuple[str, str]:
        """Return the variation sign, if any, and the name."""
        name = function.func.__name__
        delta = r"\delta " if name.startswith(_DELTA) else ""
        return delta, self._print(Symbol(name.removeprefix(_DELTA)))

    def _place(self, arguments: Iterable[Basic]) -> str:
        """Return the arguments where they are needed: a value at an end, or a coefficient that varies along x."""
        arguments = tuple(arguments)
        if all(map(self._own, arguments)) and self._variables[1] in map(str, arguments):
            return ""
        return "(" + ",".join(map(self._print, arguments)) + ")"

    def _print_Function(self, expr: Any, exp: str | None = None) -> str:
        if not isinstance(expr, AppliedUndef):
            return str(super()._print_Function(expr, exp))
        return "".join(self._head(expr)) + self._place(expr.args) + (f"^{{{exp}}}" if exp else "")

    def _derivative(self, derivative: Derivative, arguments: Iterable[Basic]) -> str | None:
        """Return the short form of a derivative of a function, taken at ``arguments``, or None if it has none."""
        function, place = derivative.expr, self._place(arguments)
        delta, name = self._head(function)
        space, time = self._variables
        counts = {variable.name: int(count) for variable, count in derivative.variable_count}
        in_time = counts.pop(time, 0)
        in_space = sum(counts.values())
        if len(function.args) == 1:
            return delta + (_dotted(name, in_time) if in_time else _primed(name, in_space)) + place
        if len(function.args) > 2 or time not in map(str, function.args):
            return None
        marks = self._print(Symbol(space)) * in_space + self._print(Symbol(time)) * in_time
        return delta + (rf"{{{name}}}_{{,{marks}}}" if "_" in name else rf"{name}_{{{marks}}}") + place

    def _print_Derivative(self, expr: Derivative) -> str:
        short = self._derivative(expr, expr.expr.args) if isinstance(expr.expr, AppliedUndef) else None
        return short or super()._print_Derivative(expr)

    def _print_Subs(self, subs: Subs) -> str:
        inner = subs.expr
        if isinstance(inner, Derivative) and isinstance(inner.expr, AppliedUndef):
            point = dict(zip(subs.variables, subs.point, strict=True))
            short = self._derivative(inner, (point.get(argument, argument) for argument in inner.expr.args))
            return short or super()._print_Subs(subs)
        return str(super()._print_Subs(subs))

    def parenthesize(self, item: Any, *args: Any, **kwargs: Any) -> str:
        if isinstance(item, (Derivative, Subs)) and isinstance(item.expr, (AppliedUndef, Derivative)):
            return str(self._print(item))
        return str(super().parenthesize(item, *args, **kwargs))


def _dotted(name: str, order: int) -> str:
    letter, underscore, index = name.partition("_")
    mark = rf"\{'d' * order}ot{{{letter}}}" if order <= 3 else rf"{{{letter}^{{({order})}}}}"
    return mark + underscore + index


def _primed(name: str, order: int) -> str:
    return name + ("'" * order if order <= 4 else f"^{{({order})}}")


def compact_latex(expression: Any, variables: tuple[str, str] = ("x", "t")) -> str:
    r"""Return LaTeX with derivatives as subscripts; a tuple becomes lines.

    Parameters
    ----------
    expression : Basic or iterable of Basic
    variables : (str, str)
        Names of the position and of the time.

    Examples
    --------
    >>> from sympy import Function, symbols
    >>> x, t, L = symbols("x t L")
    >>> v, w = Function("v")(x, t), Function("w")(t)
    >>> print(compact_latex(v.diff(x, 2) + w.diff(t) + v.diff(x).subs(x, L)))
    v_{x}(L,t) + v_{xx} + \dot{w}
    """
    printer = _CompactPrinter(variables)
    if isinstance(expression, Iterable) and not isinstance(expression, Basic):
        return r"\begin{gathered}" + r" \\ ".join(map(printer.doprint, expression)) + r"\end{gathered}"
    return str(printer.doprint(expression))


def display_latex(expression: Any, variables: tuple[str, str] = ("x", "t"), tag: int | str | None = None) -> str:
    r"""Return the LaTeX of a displayed formula: a tuple becomes lines, a line that is too wide is broken.

    Parameters
    ----------
    expression : Basic or iterable of Basic
    variables : (str, str)
        Names of the position and of the time.
    tag : int or str, optional
        Number of the equation.

    Examples
    --------
    >>> from sympy import Eq, symbols
    >>> x, y = symbols("x y")
    >>> print(display_latex(Eq(y, x**2), tag=7))
    \begin{gathered} y = x^{2} \end{gathered} \qquad (7)
    """
    several = isinstance(expression, Iterable) and not isinstance(expression, Basic)
    parts = tuple(expression) if several else (expression,)
    body = r" \\[4pt] ".join(arranged(part, lambda line: compact_latex(line, variables)) for part in parts)
    upright = f"({tag})" if str(tag).isdigit() else rf"\mathrm{{({tag})}}"
    number = "" if tag is None else rf" \qquad {upright}"
    return rf"\begin{{gathered}} {body} \end{{gathered}}{number}"


_GREEK = "Delta|epsilon|iota|kappa|lambda|mu|omega|phi|psi|rho|sigma|varpi|zeta"
_NAMES = re.compile(rf"\b({_GREEK}|[^\W\d_](?=_))(?:_([A-Za-z0-9]+))?(?:\^([A-Za-z0-9]+))?(?![A-Za-z0-9_])")


def mathematics(prose: str) -> str:
    r"""Return prose in which names of Greek letters, and letters with an index, are LaTeX between dollar signs.

    >>> print(mathematics("D_k is the derivative with respect to T_k = epsilon^k t, $x_1$ stays."))
    $D_{k}$ is the derivative with respect to $T_{k}$ = $\epsilon^{k}$ t, $x_1$ stays.
    """
    parts = prose.split("$")
    parts[::2] = (_NAMES.sub(_as_latex, part) for part in parts[::2])
    return "$".join(parts)


def _as_latex(name: re.Match[str]) -> str:
    letter = name[1] if len(name[1]) == 1 else f"\\{name[1]}"
    index, power = (f"{mark}{{{text}}}" if text else "" for mark, text in (("_", name[2]), ("^", name[3])))
    return f"${letter}{index}{power}$"


@dataclass(frozen=True, repr=False)
class Step:
    """One step of a derivation.

    Attributes
    ----------
    name : str
        Short title.
    statement : str
        What is done and why, in one sentence.
    expression : Basic or tuple of Basic
        Result.
    derived_from : tuple of str
        Names of the steps it is derived from; empty for given expressions.
    check : str
        Independent check.
    variables : (str, str)
        Names of position and time, for the notation.
    tag : int or str, optional
        Number of the equation that the step ends with.
    """

    name: str
    statement: str
    expression: Any
    derived_from: tuple[str, ...] = ()
    check: str = ""
    variables: tuple[str, str] = ("x", "t")
    tag: int | str | None = None

    def __repr__(self) -> str:
        return f"Step {self.name!r}"

    def _formula(self) -> str:
        return display_latex(self.expression, self.variables, self.tag)

    def _repr_latex_(self) -> str:
        return rf"$\displaystyle {self._formula()}$"

    def _repr_markdown_(self) -> str:
        return f"**{self.name}.** {mathematics(self.statement)}\n\n$${self._formula()}$$"


class Steps(tuple[Step, ...]):
    """The steps of a derivation, in order, with a display in notebooks.

    >>> from sympy import symbols
    >>> a, b = symbols("a b")
    >>> steps = Steps([Step("given", "A sum.", a + b), Step("squared", "Its square.", (a + b) ** 2, ("given",))])
    >>> steps.step("squared").expression
    (a + b)**2
    """

    __slots__ = ()

    def step(self, name: str) -> Step:
        """Return the step of this name.

        Raises
        ------
        ValueError
            If there is none.
        """
        for step in self:
            if step.name == name:
                return step
        known = ", ".join(repr(step.name) for step in self)
        raise ValueError(f"name = {name!r}: must be one of {known}")

    def _repr_markdown_(self) -> str:
        return "\n\n".join(step._repr_markdown_() for step in self)
