"""Formulas written once: evaluated on arrays, or recorded as branch-free source text for one pattern of coefficients.

`Exact` is a coefficient known to be 0 or 1; operations that it makes trivial are omitted, in arrays and in the text.
`Term` is a number in the text: each operation on it becomes a line.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from itertools import count
from typing import Any

__all__ = ["Exact", "Term", "straight", "wanted_lines"]

_NAMES = re.compile(r"\bt\d+\w*")
_OF_NUMPY = {"floor", "sqrt"}  # the other names are functions of the surrounding text


class Exact:
    """The number 0 or 1 in all lanes."""

    __slots__ = ("value",)
    __array_ufunc__ = None

    def __init__(self, value: int) -> None:
        self.value = value

    def __array_function__(self, function: Any, types: Any, given: Any, options: Any) -> Any:
        return function(*(float(x.value) if isinstance(x, Exact) else x for x in given))

    def __mul__(self, other: Any) -> Any:
        return other if self.value else self

    __rmul__ = __mul__

    def __truediv__(self, other: Any) -> Any:
        return 1.0 / _number(other) if self.value else self

    def __rtruediv__(self, other: Any) -> Any:
        return other if self.value else other / 0.0

    def __add__(self, other: Any) -> Any:
        return 1.0 + _number(other) if self.value else other

    __radd__ = __add__

    def __sub__(self, other: Any) -> Any:
        if isinstance(other, Exact) and other.value == self.value:
            return Exact(0)
        return 1.0 - _number(other) if self.value else -other

    def __rsub__(self, other: Any) -> Any:
        return other - 1.0 if self.value else other

    def __neg__(self) -> Any:
        return -1.0 if self.value else self

    def __abs__(self) -> Exact:
        return self

    def __gt__(self, other: Any) -> Any:
        return float(self.value) > _number(other)

    def __lt__(self, other: Any) -> Any:
        return float(self.value) < _number(other)

    def __eq__(self, other: object) -> Any:
        return float(self.value) == _number(other)

    __hash__ = object.__hash__

    def __getitem__(self, members: Any) -> Exact:
        return self


def _number(value: Any) -> Any:
    return float(value.value) if isinstance(value, Exact) else value


class Term:
    """A number in the text, by its name there, and the lines so far with the names of their results."""

    __slots__ = ("lines", "name")

    def __init__(self, name: str, lines: dict[str, str]) -> None:
        self.name, self.lines = name, lines

    def _new(self, text: str) -> Term:
        """Return the result of a line; an identical earlier line is used again."""
        name = self.lines.setdefault(text, f"t{len(self.lines)}")
        return Term(name, self.lines)

    def called(self, function: str, results: int) -> tuple[Term, ...]:
        """Return the results of another straight function."""
        text = f"{function}(k, i, {self.name})"
        names = self.lines.setdefault(text, ", ".join(f"t{len(self.lines)}_{k}" for k in range(results)))
        return tuple(Term(name, self.lines) for name in names.split(", "))

    def __array_ufunc__(self, function: Any, method: str, *given: Any) -> Any:
        name = function.__name__
        known = f"np.{name}" if name in _OF_NUMPY else name
        return self._new(f"{known}({', '.join(map(_written, given))})")

    def __array_function__(self, function: Any, types: Any, given: Any, options: Any) -> Any:
        condition, value, otherwise = given  # np.where
        if not isinstance(condition, Term):
            return value if condition else otherwise
        return self._new(f"where({', '.join(map(_written, given))})")

    def quotient(self, value: Any) -> Term:
        """Return a value over this one, and 0 where this one is 0."""
        return self._new(f"_quotient({_written(value)}, {self.name})")

    def __neg__(self) -> Term:
        return self._new(f"-{self.name}")

    def __abs__(self) -> Term:
        return self._new(f"abs({self.name})")


def _written(value: Any) -> str:
    return value.name if isinstance(value, Term) else repr(float(_number(value)))


def _operator(sign: str) -> tuple[Callable[..., Any], Callable[..., Any]]:
    def forward(self: Term, other: Any) -> Any:
        if isinstance(other, Exact):
            return NotImplemented  # Exact simplifies trivial operations
        if sign in "*/" and isinstance(other, float) and other == 1.0:
            return self
        return self._new(f"{self.name} {sign} {_written(other)}")

    def backward(self: Term, other: Any) -> Any:
        if sign == "*" and isinstance(other, float) and other == 1.0:
            return self
        return self._new(f"{_written(other)} {sign} {self.name}")

    return forward, backward


def _comparison(sign: str) -> Callable[..., Any]:
    return lambda self, other: self._new(f"{self.name} {sign} {_written(other)}")


def _joint(sign: str) -> Callable[..., Any]:
    """Return the operator & or |; one of the conditions may be Exact."""

    def joint(self: Term, other: Any) -> Any:
        if isinstance(other, Term):
            return self._new(f"{self.name} {sign} {other.name}")
        return (self if other else False) if sign == "&" else (True if other else self)

    return joint


for _name, _sign in (("add", "+"), ("sub", "-"), ("mul", "*"), ("truediv", "/")):
    _forward, _backward = _operator(_sign)
    setattr(Term, f"__{_name}__", _forward)
    setattr(Term, f"__r{_name}__", _backward)
for _name, _sign in (("lt", "<"), ("gt", ">"), ("le", "<="), ("ge", ">="), ("eq", "=="), ("ne", "!=")):
    setattr(Term, f"__{_name}__", _comparison(_sign))
for _name, _sign in (("and", "&"), ("or", "|")):
    setattr(Term, f"__{_name}__", _joint(_sign))
    setattr(Term, f"__r{_name}__", _joint(_sign))


def straight(
    name: str,
    function: Callable[..., Sequence[Any]],
    arguments: Sequence[str],
    entries: Sequence[int | None] = (),
) -> str:
    """Return the text of a function without branches.

    Parameters
    ----------
    name : str
    function : callable
        Takes the entries of a lane and the arguments; returns numbers.
    arguments : sequence of str
    entries : sequence of (0, 1 or None)
        None for what differs from lane to lane: these are the rows of an array ``k``.

    Returns
    -------
    str
        ``def name(k, i, *arguments)``: the function of column i.

    Examples
    --------
    >>> print(straight("_f", lambda k, z: [k[0] * z + k[1] * k[2] * z], ["z"], [None, 0, None]))
    def _f(k, i, z):
        t0 = k[0, i]
        t0 = t0 * z
        return t0
    """
    lines: dict[str, str] = {}
    origin, row = Term("", lines), count()
    given = [Exact(x) if x is not None else origin._new(f"k[{next(row)}, i]") for x in entries]
    results = function(given, *(Term(argument, lines) for argument in arguments))
    kept = wanted_lines(lines, [_written(result) for result in results])
    body, answers = _with_few_names(kept, [_written(result) for result in results])
    return f"def {name}(k, i, {', '.join(arguments)}):\n{body}    return {', '.join(answers)}"


def wanted_lines(lines: dict[str, str], results: Sequence[str]) -> list[tuple[list[str], str]]:
    """Return names and text of the lines that the results need."""
    wanted, kept = set(results), []
    for text, names in reversed(lines.items()):
        own = names.split(", ")
        if wanted & set(own):
            wanted |= set(_NAMES.findall(text))
            kept.append((own, text))
    return kept[::-1]


def _with_few_names(lines: list[tuple[list[str], str]], results: Sequence[str]) -> tuple[str, list[str]]:
    """Return the lines and results with names that are reused once their value is no longer needed.

    Arrays are thus freed early.
    """
    last = {name: at for at, (_, text) in enumerate(lines) for name in _NAMES.findall(text)}
    last |= dict.fromkeys(results, len(lines))
    slots: dict[str, str] = {}
    free: list[str] = []
    body = []

    def slot(match: re.Match[str]) -> str:
        return slots[match[0]]

    for at, (names, text) in enumerate(lines):
        written = _NAMES.sub(slot, text)
        free += [slots[name] for name in dict.fromkeys(_NAMES.findall(text)) if last[name] == at]
        for name in names:
            slots[name] = free.pop() if free else f"t{len(slots)}"
        free += [slots[name] for name in names if name not in last]
        body.append(f"    {', '.join(slots[name] for name in names)} = {written}\n")
    return "".join(body), [_NAMES.sub(slot, result) for result in results]
