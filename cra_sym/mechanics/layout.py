"""Displayed formulas on a page: a line that is too wide is broken at its sums."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator

from sympy import Add, Basic, Eq, Integral, Mul, S, fraction

__all__ = ["arranged"]

#: Line width of an article, without the equation number, in widths of a letter.
_LINE = 50.0
_NAMES = re.compile(r"\\(?:operatorname\{(\w+)\}|(cos|sin|cosh|sinh|exp|lim|log|tan))(?![a-zA-Z])")
_EMPTY = re.compile(r"\\(?:left|right|bigl|bigr|limits|displaystyle|quad|[,;! ])(?![a-zA-Z])|\\(?:begin|end)\{\w+\}")

Write = Callable[[Basic], str]


def arranged(part: Basic, write: Write) -> str:
    """Return the LaTeX of an expression or equation in lines that fit on a page.

    Parameters
    ----------
    part : Basic
    write : callable
        Returns the LaTeX of an expression on one line.
    """
    whole = write(part)
    if _width(whole) <= _LINE:
        return whole
    head, pieces = "", [whole]
    if isinstance(part, Eq):
        left, right = part.args
        if _width(write(left)) <= _LINE / 2:
            head, pieces = f"{write(left)} = ", _pieces(right, write)
        else:
            pieces = [*_pieces(left, write), f" = {write(right)}"]
    else:
        pieces = _pieces(part, write)
    if len(pieces) == 1:
        return whole
    lines = r" \\ &\quad ".join(_packed(pieces, _LINE - _width(head)))
    return rf"\begin{{aligned}} {head}&{lines} \end{{aligned}}"


def _packed(pieces: list[str], room: float) -> Iterator[str]:
    """Yield lines of as many pieces as fit, at least one each."""
    line = ""
    for piece in pieces:
        if line and _width(line + piece) > room:
            yield line
            line = ""
        line += piece
    yield line


def _pieces(expression: Basic, write: Write, room: float = _LINE) -> list[str]:
    """Return the LaTeX in pieces between which a line may end."""
    whole = write(expression)
    if isinstance(expression, Add):
        pieces: list[str] = []
        for term in expression.as_ordered_terms():
            first, *rest = _pieces(term, write, 0.8 * room)
            sign = "" if not pieces or first.lstrip().startswith("-") else " + "
            pieces += [f"{sign}{first}", *rest]
        return pieces
    if _width(whole) <= room:
        return [whole]
    if isinstance(expression, Integral):
        (_, low, high), *others = expression.limits
        inner = _pieces(expression.function, write, 0.8 * room)
        if not others and len(inner) > 1:
            variable = write(expression.limits[0][0])
            return _enclosed(rf"\int\limits_{{{write(low)}}}^{{{write(high)}}} ", inner, rf"\, d{variable}")
    if isinstance(expression, Mul):
        above, below = fraction(expression)
        if below != 1:
            negative = above.could_extract_minus_sign()
            sign, above = ("-", -above) if negative else ("", above)
            inner = _pieces(above, write, 0.8 * room)
            return _enclosed(rf"{sign}\frac{{1}}{{{write(below)}}} ", inner) if len(inner) > 1 else [whole]
        sums = [factor for factor in expression.args if isinstance(factor, Add | Integral)]
        if sums:
            widest = max(sums, key=lambda factor: _width(write(factor)))
            others_of = [factor for factor in expression.args if factor is not widest]
            inner = _pieces(widest, write, 0.8 * room)
            if len(inner) > 1:
                return _enclosed(_factors(others_of, write), inner)
    return [whole]


def _factors(factors: list[Basic], write: Write) -> str:
    """Return a product in front of parentheses."""
    product = Mul(*factors, evaluate=False)
    if product == -1:
        return "-"
    if product is S.One or not factors:
        return ""
    return rf"\left({write(product)}\right) " if isinstance(product, Add) else f"{write(product)} "


def _enclosed(before: str, inner: list[str], after: str = "") -> list[str]:
    return [rf"{before}\bigl({inner[0]}", *inner[1:-1], rf"{inner[-1]}\bigr){after}"]


def _width(latex: str) -> float:
    """Return the approximate width of a line of LaTeX, in widths of a letter."""
    rows = [_row_width(row) for row in re.split(r"\\\\(?:\[\w+\])?", latex)]
    return max(rows)


def _row_width(row: str) -> float:
    text = _EMPTY.sub("", _NAMES.sub(lambda name: "x" * len(name[1] or name[2]) + "|", row))
    return _measured(text, 0)[0] + 1.5 * text.count("&")


def _measured(text: str, place: int) -> tuple[float, int]:
    """Return the width from ``place`` to the closing brace of its group, and where that ends."""
    total = 0.0
    while place < len(text):
        character = text[place]
        if character == "}":
            return total, place + 1
        if text.startswith(r"\frac{", place):
            above, place = _measured(text, place + 6)
            below, place = _measured(text, place + 1)
            total += max(above, below) + 0.3
        elif character in "^_":
            small, place = _measured(text, place + 2) if text[place + 1 : place + 2] == "{" else (1.0, place + 2)
            total += 0.7 * small
        elif character == "{":
            inside, place = _measured(text, place + 1)
            total += inside
        elif character == "\\":
            command = re.match(r"\\([a-zA-Z]+|.)", text[place:])
            place += len(command[0]) if command else 1
            total += 1.0
        else:
            total += {" ": 0.0, "|": 0.3, "+": 2.2, "-": 2.0, "=": 2.4}.get(character, 0.9)
            place += 1
    return total, place
