"""The restricted form in which an algorithm is written once: Python text, parsed, typed and checked, for printing.

A text is a Python module of constants, records (classes of annotated fields) and functions. Values are doubles
(`float`), integers (`int`), conditions (`bool`), rows of them and records. A function contains assignments, ``for``
over ``range``, ``while``, ``if``, ``break``, ``continue``, ``return``, ``raise`` and calls; comments and docstrings are
printed too.

Rules that let every language print the same arithmetic
    Parameters of type ``Row[float, n]`` or of a record are read only; ``Out[...]`` is created and returned by the
    function, ``Mut[...]`` is changed in place. No argument that is changed may be given twice in one call.
    Both sides of ``and``, ``or`` and ``a if c else b`` must be harmless to evaluate: some languages evaluate both.
    Integers and doubles do not mix; ``//`` and ``%`` are for integers that are not negative; `int` cuts toward zero.
    Functions are defined before they are called, so there is no recursion; local rows have constant lengths, so there
    is no heap. A local variable is first assigned, in the order of the text, then used, and keeps its type.
    Functions that change an argument, raise, or call one that does, are called in statements of their own.
"""

from __future__ import annotations

import ast
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field

from cra_sym.cached import cached_property

__all__ = [
    "BOOL",
    "FLOAT",
    "INT",
    "SCALARS",
    "Constant",
    "FormError",
    "FunctionDefinition",
    "Program",
    "Record",
    "Type",
    "error_name",
    "refused",
]  # fmt: skip


class FormError(ValueError):
    """Violation of the restricted form, with its line."""


@dataclass(frozen=True)
class Type:
    """A type: a scalar or a record by its name, or a row of them.

    Attributes
    ----------
    name : str
        ``float``, ``int``, ``bool`` or a record.
    length : int or str or None
        Of a row: a number, a constant or an integer parameter; None for one value.
    access : str
        Of a parameter: ``in``, ``out`` or ``mut``.
    """

    name: str
    length: int | str | None = None
    access: str = "in"

    @property
    def element(self) -> Type:
        """The type of an entry of a row."""
        return Type(self.name)

    @property
    def scalar(self) -> bool:
        """Whether it is one number or condition."""
        return self.length is None and self.name in SCALARS

    @property
    def changed(self) -> bool:
        """Whether a parameter of this type is written to."""
        return self.access != "in"

    def same(self, other: Type) -> bool:
        """Return whether the values have the same type, regardless of access."""
        return self.name == other.name and (self.length is None) == (other.length is None)


SCALARS = ("float", "int", "bool")
FLOAT, INT, BOOL = (Type(name) for name in SCALARS)


@dataclass(frozen=True)
class Constant:
    """A number, or a row of numbers, at the top of the text."""

    name: str
    type: Type
    values: tuple[float | int, ...]
    comment: str


@dataclass(frozen=True)
class Record:
    """A record: its fields by name, with the comment of each; those that are infinite unless they are given.

    Languages with default values of fields use the latter; in C a new record is zero.
    """

    name: str
    doc: str
    fields: Mapping[str, Type]
    comments: Mapping[str, str]
    infinite: frozenset[str] = frozenset()


@dataclass
class FunctionDefinition:
    """A function with the results of the check.

    Attributes
    ----------
    parameters : dict of str to Type
    result : Type or None
    types : dict of int to Type
        Type of every expression, by the id of its node.
    locals : dict of str to Type
    homes : dict of str to int
        For each local the id of the statement before which, or with which, it is declared.
    writes : dict of str to int
        Number of assignments to each local.
    loops : set of str
        Variables of ``for`` loops, which exist inside these only.
    calls, uses, raises : set of str
        Functions of the text and of the language that it calls, errors it raises itself.
    """

    name: str
    doc: str
    parameters: dict[str, Type]
    result: Type | None
    node: ast.FunctionDef
    types: dict[int, Type] = field(default_factory=dict)
    locals: dict[str, Type] = field(default_factory=dict)
    homes: dict[str, int] = field(default_factory=dict)
    writes: dict[str, int] = field(default_factory=dict)
    loops: set[str] = field(default_factory=set)
    calls: set[str] = field(default_factory=set)
    uses: set[str] = field(default_factory=set)
    raises: set[str] = field(default_factory=set)

    @property
    def public(self) -> bool:
        """Whether it is part of the interface: its name has no leading underscore."""
        return not self.name.startswith("_")

    @cached_property
    def names(self) -> frozenset[str]:
        """All names in it."""
        return frozenset(node.id for node in ast.walk(self.node) if isinstance(node, ast.Name))

    @property
    def bounds(self) -> frozenset[str]:
        """Names in the conditions under which it raises at once."""
        tests = [s.test for s in self.body if isinstance(s, ast.If) and isinstance(s.body[0], ast.Raise)]
        return frozenset(n.id for test in tests for n in ast.walk(test) if isinstance(n, ast.Name))

    @property
    def body(self) -> list[ast.stmt]:
        """The statements after the docstring."""
        return self.node.body[1:] if ast.get_docstring(self.node) else self.node.body

    @property
    def changed(self) -> list[str]:
        """The parameters that are written to."""
        return [name for name, kind in self.parameters.items() if kind.changed]


@dataclass(frozen=True)
class Program:
    """A program in the restricted form, parsed and checked.

    Attributes
    ----------
    doc : str
    constants, records, functions : dict
        By name, in the order of the text.
    comments : dict of int to str
        Comment of each line; the lines of those on a line of their own are also in `alone`.
    """

    doc: str
    constants: dict[str, Constant]
    records: dict[str, Record]
    functions: dict[str, FunctionDefinition]
    comments: dict[int, str]
    alone: frozenset[int]

    def failing(self, also: frozenset[str] = frozenset()) -> frozenset[str]:
        """Return the functions that raise, or call one that does; ``also`` are included."""
        found: set[str] = set()
        for name, function in self.functions.items():  # callees come first
            if name in also or function.raises or function.calls & found:
                found.add(name)
        return frozenset(found)

    @property
    def errors(self) -> list[str]:
        """Names of the errors raised, in the order of the text."""
        raised = (
            error_name(node)
            for function in self.functions.values()
            for node in ast.walk(function.node)
            if isinstance(node, ast.Raise)
        )
        return list(dict.fromkeys(raised))

    @cached_property
    def interface(self) -> frozenset[str]:
        """Constants and records for the caller.

        Records and lengths in public functions, bounds of their arguments, limits, and numbers that nothing here uses.
        """
        kinds = [kind for f in self.functions.values() if f.public for kind in f.parameters.values()]
        found = {str(kind.name) for kind in kinds if kind.name in self.records}
        for name in reversed(self.records):  # a record contains only earlier ones
            if name in found:
                kinds += self.records[name].fields.values()
                found |= {kind.name for kind in self.records[name].fields.values() if kind.name in self.records}
        found |= {str(kind.length) for kind in kinds}
        every: list[Record | FunctionDefinition] = [*self.records.values(), *self.functions.values()]
        used = {str(kind.length) for part in every for kind in _kinds_in(part)}
        used = used.union(*(f.names for f in self.functions.values()))
        found |= {name for name in self.constants if name.startswith("MOST_") or name not in used}
        bounds = frozenset[str]().union(*(f.bounds for f in self.functions.values() if f.public))
        found |= {name for name in bounds & {*self.constants} if self.constants[name].type == INT}
        return frozenset(found & {*self.constants, *self.records})

    def used_by(self, names: Sequence[str]) -> Program:
        """Return the program with these functions and all that they call."""
        wanted = set(names)
        for name in reversed(list(self.functions)):
            if name in wanted:
                wanted |= self.functions[name].calls
        kept = {name: f for name, f in self.functions.items() if name in wanted}
        return Program(self.doc, self.constants, self.records, kept, self.comments, self.alone)


def _kinds_in(part: Record | FunctionDefinition) -> Iterable[Type]:
    return part.fields.values() if isinstance(part, Record) else [*part.parameters.values(), *part.locals.values()]


def refused(node: ast.AST, reason: str = "") -> FormError:
    """Return an error with the line and the reason."""
    where = getattr(node, "lineno", "?")
    return FormError(f"line {where}: {ast.unparse(node).splitlines()[0]!r}: {reason or 'not in the restricted form'}")


def error_name(node: ast.Raise) -> str:
    """Return the name of what a statement raises."""
    match node.exc:
        case ast.Name(id=name) | ast.Call(func=ast.Name(id=name), args=[ast.Constant(value=str())], keywords=[]):
            return name
    raise refused(node, "raise a name, or a name with one text")
