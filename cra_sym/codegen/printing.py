"""Common parts of the printers of the restricted form: precedence, declarations, comments, blocks.

A language is a subclass that prints declarations, loops, calls and so on of the checked text of
:mod:`cra_sym.kernels.form`. Brackets keep the tree of every expression, so that all languages round alike.
"""

from __future__ import annotations

import ast
import re
import textwrap
from collections.abc import Iterable, Iterator, Sequence
from typing import ClassVar

from cra_sym.codegen.print_expressions import OPERATORS, ExpressionPrinter
from cra_sym.kernels.form import Constant, FunctionDefinition, Program, Record, Type

__all__ = ["Lines", "Printer", "folded", "snake"]

Lines = Iterator[str]


def snake(name: str) -> str:
    """Return a CamelCase name in lower case with underscores."""
    return re.sub(r"(?<=[a-z0-9])(?=[A-Z])", "_", name).lower()


def folded(text: str, width: int, indent: str) -> list[str]:
    """Return a statement wrapped at blanks outside of strings."""
    whole = re.sub(r"'[^']*'|\"[^\"]*\"", lambda found: found[0].replace(" ", "\0"), text)
    lines = textwrap.wrap(
        whole, width, initial_indent=indent, subsequent_indent=f"{indent}    ", break_long_words=False,
        break_on_hyphens=False,
    )  # fmt: skip
    return [line.replace("\0", " ") for line in lines]


class Printer(ExpressionPrinter):
    """Printer of a checked text in one language.

    Parameters
    ----------
    form : Program
    prefix : str
        Prefix of public names, where the language has no namespaces.
    real : {'float64', 'float32'}
    """

    name = title = ""
    comment, indent, width = "//", "    ", 110
    closing = "}"
    reals: ClassVar[tuple[str, ...]] = ("float64",)

    def __init__(self, form: Program, prefix: str, real: str = "float64") -> None:
        if real not in self.reals:
            raise ValueError(f"real = {real!r}: {self.title} has {', '.join(self.reals)}")
        self.form, self.prefix, self.real = form, prefix, real
        self.failing = form.failing(self.also_failing())

    def also_failing(self) -> frozenset[str]:
        """Return functions that may fail in this language although they raise nothing."""
        return frozenset()

    # The whole ----------------------------------------------------------------------------------------------------

    def constants(self) -> str:
        """Return the constants as text."""
        return "\n".join(self.constant(constant) for constant in self.form.constants.values())

    def records(self) -> str:
        """Return the records as text."""
        return "\n\n".join("\n".join(self.record(record)) for record in self.form.records.values())

    def all_functions(self) -> str:
        """Return the functions as text."""
        return self.several(self.form.functions.values())

    def several(self, functions: Iterable[FunctionDefinition]) -> str:
        """Return some functions as text."""
        return self.between.join("\n".join(self.function(function)) for function in functions)

    def function(self, function: FunctionDefinition) -> Lines:
        """Yield the lines of a function."""
        self.current = function
        yield from self.documented(function)
        yield from self.head(function)
        checks = self.checks(function)
        yield from self.block(function.body[:checks], function.node.lineno, self.indent)
        yield from self.start(function)
        line = function.body[checks - 1].end_lineno if checks else function.node.lineno
        yield from self.block(function.body[checks:], line or 0, self.indent)
        yield from self.tail(function)

    def checks(self, function: FunctionDefinition) -> int:
        """Return the number of statements at the beginning that only check the input."""
        for number, statement in enumerate(function.body):
            match statement:
                case ast.If(body=[ast.Raise()], orelse=[]):
                    continue
                case ast.Expr(value=ast.Call() as call) if not self.form.functions[self.callee(call)].changed:
                    continue
            return number
        return len(function.body)

    def start(self, function: FunctionDefinition) -> Lines:
        """Yield the statements that create the results, where the caller does not."""
        yield from ()

    def documented(self, function: FunctionDefinition) -> Lines:
        """Yield the docstring of a function as comments before it."""
        for line in textwrap.dedent(function.doc).strip().splitlines():
            yield f"{self.outer}{self.doc_comment} {line}".rstrip()

    between = "\n\n"  # functions
    outer = ""  # indentation of functions

    @property
    def doc_comment(self) -> str:
        """Prefix of a line of documentation."""
        return self.comment

    def is_public(self, part: Constant | Record) -> bool:
        """Return whether a constant or a record is part of the interface."""
        return part.name in self.form.interface

    # Overridden by languages -----------------------------------------------------------------------------------------

    def constant(self, constant: Constant) -> str:
        """Return a constant."""
        raise NotImplementedError

    def row(self, head: str, values: Sequence[str], tail: str, comment: str = "") -> str:
        """Return a row of values between two texts: on one line if it is short, with the comment after the first."""
        line = f"{head}{', '.join(values)}{tail}"
        if len(line) + len(comment) <= self.width:
            return line + comment
        inside = textwrap.wrap(
            f"{', '.join(values)},", self.width, initial_indent=self.indent, subsequent_indent=self.indent
        )
        return "\n".join([head.rstrip() + comment, *inside, tail.lstrip()])

    def record(self, record: Record) -> Lines:
        """Yield the lines of a record."""
        raise NotImplementedError

    def head(self, function: FunctionDefinition) -> Lines:
        """Yield the lines before the body."""
        raise NotImplementedError

    def tail(self, function: FunctionDefinition) -> Lines:
        """Yield the lines after the body."""
        yield self.outer + self.closing

    def declared(self, name: str, kind: Type, value: str | None, fixed: bool) -> str:
        """Return a declaration, or an empty text where none is needed."""
        raise NotImplementedError

    def made(self, kind: Type) -> str:
        """Return a new row of zeros or a new record."""
        raise NotImplementedError

    infinity = ""  # initial values of fields

    def begun(self, record: Record, name: str) -> str:
        """Return the initial value of a field of a record."""
        return self.infinity if name in record.infinite else self.made(record.fields[name])

    def loop(self, name: str, start: str, stop: ast.expr, step: int) -> str:
        """Return the head of a loop over integers."""
        raise NotImplementedError

    def call_statement(self, target: str, call: ast.Call, callee: FunctionDefinition, indent: str) -> Lines:
        """Yield a call as a statement, with the use of its result and the handling of a failure."""
        raise NotImplementedError

    def returned(self, value: str | None) -> Lines:
        """Yield the return statement."""
        raise NotImplementedError

    def raised(self, error: str, message: str) -> str:
        """Return the statement that raises an error."""
        raise NotImplementedError

    def if_head(self, condition: str) -> str:
        """Return the head of a branch."""
        return f"if ({condition}) {{"

    def while_head(self, condition: str) -> str:
        """Return the head of a loop."""
        return f"while ({condition}) {{"

    otherwise = "} else {"
    otherwise_if = "} else "
    end_if = end_loop = "}"
    leave, again = "break;", "continue;"
    end = ";"

    def wrapped(self, text: str, indent: str) -> Lines:
        """Yield a wrapped statement."""
        yield from folded(text, self.width, indent)

    # Statements ---------------------------------------------------------------------------------------------------

    def block(self, statements: Sequence[ast.stmt], line: int, indent: str) -> Lines:
        """Yield statements, each with the comments before it and on its line."""
        for statement in statements:
            for number in range(line + 1, statement.lineno):
                if number in self.form.alone:
                    yield f"{indent}{self.comment} {self.form.comments[number]}"
            yield from self.with_declarations(statement, indent)
            line = statement.end_lineno or line

    def with_declarations(self, statement: ast.stmt, indent: str) -> Lines:
        """Yield a statement after the declarations it needs."""
        start = None
        for name, home in self.current.homes.items():
            if home == id(statement):
                if isinstance(statement, ast.Assign) and isinstance(statement.targets[0], ast.Name):
                    start = name
                else:
                    yield from self.plain(self.declared(name, self.current.locals[name], None, False), indent)
        lines = list(self.statement(statement, indent, start))
        beside = self.comment_beside(statement)
        if beside and len(lines[0]) + len(beside) + 3 <= self.width + 10:
            lines[0] += f" {self.comment} {beside}"
        elif beside:
            yield f"{indent}{self.comment} {beside}"
        yield from lines

    def comment_beside(self, statement: ast.stmt) -> str:
        """Return the comment on the first line of a statement."""
        return "" if statement.lineno in self.form.alone else self.form.comments.get(statement.lineno, "")

    def plain(self, text: str, indent: str) -> Lines:
        """Yield a statement with its terminator."""
        if text:
            yield from self.wrapped(text + self.end, indent)

    def statement(self, node: ast.stmt, indent: str, declares: str | None) -> Lines:
        """Yield the lines of a statement."""
        inner = indent + self.indent
        match node:
            case ast.Assign(targets=[target], value=ast.Call() as call) if self.callee(call) in self.form.functions:
                callee = self.form.functions[self.callee(call)]
                if self.alone(callee):
                    yield from self.plain(self.declaration_before(declares), indent)
                    yield from self.call_statement(self.expression(target), call, callee, indent)
                else:
                    yield from self.assigned(target, self.expression(call), indent, declares)
            case ast.Assign(targets=[ast.Name(id=name)], value=ast.Call()) if not self.current.locals[name].scalar:
                kind = self.current.locals[name]
                yield from self.plain(self.declared(name, kind, self.made(kind), False), indent)
            case ast.Assign(targets=[target], value=value):
                yield from self.assigned(target, self.expression(value), indent, declares)
            case ast.AugAssign(target=target, op=op, value=value):
                yield from self.plain(self.updated(target, op, value), indent)
            case ast.For(target=ast.Name(id=name), iter=ast.Call(args=args)):
                start, stop = (args[0], args[1]) if len(args) > 1 else (ast.Constant(0), args[0])
                yield indent + self.loop(
                    self.loop_over(node, name), self.expression(start), stop, -1 if len(args) == 3 else 1
                )
                yield from self.block(node.body, node.lineno, inner)
                yield indent + self.end_loop
            case ast.While(test=test):
                yield from self.headed(self.while_head(self.expression(test)), indent)
                yield from self.block(node.body, node.lineno, inner)
                yield indent + self.end_loop
            case ast.If():
                yield from self.branches(node, indent)
            case ast.Break():
                yield indent + self.leave
            case ast.Continue():
                yield indent + self.again
            case ast.Return(value=value):
                for line in self.returned(None if value is None else self.expression(value)):
                    yield from self.plain(line, indent)
            case ast.Raise(exc=ast.Name(id=error)):
                yield from self.plain(self.raised(error, snake(error).replace("_", " ")), indent)
            case ast.Raise(exc=ast.Call(func=ast.Name(id=error), args=[ast.Constant(value=message)])):
                yield from self.plain(self.raised(error, str(message)), indent)
            case ast.Expr(value=ast.Call() as call):
                yield from self.call_statement("", call, self.form.functions[self.callee(call)], indent)

    def headed(self, text: str, indent: str) -> Lines:
        """Yield the head of a branch or a loop, wrapped if the language allows that."""
        yield indent + text

    def loop_over(self, node: ast.For, name: str) -> str:
        """Return the variable of a loop."""
        return name

    def branches(self, node: ast.If, indent: str, prefix: str = "") -> Lines:
        """Yield a choice with all its branches."""
        yield from self.headed(prefix + self.if_head(self.expression(node.test)), indent)
        yield from self.block(node.body, node.lineno, indent + self.indent)
        match node.orelse:
            case []:
                yield from filter(None, [(indent + self.end_if) if self.end_if else ""])
            case [ast.If() as other] if id(other) not in self.current.homes.values():
                yield from self.branches(other, indent, self.otherwise_if)
            case others:
                yield indent + self.otherwise
                yield from self.block(others, node.body[-1].end_lineno or 0, indent + self.indent)
                yield from filter(None, [(indent + self.end_if) if self.end_if else ""])

    def assigned(self, target: ast.expr, value: str, indent: str, declares: str | None) -> Lines:
        """Yield an assignment, which may be a declaration."""
        if declares is None:
            yield from self.plain(f"{self.expression(target)} = {value}", indent)
        else:
            kind, fixed = self.current.locals[declares], self.current.writes[declares] == 1
            yield from self.plain(self.declared(declares, kind, value, fixed), indent)

    def declaration_before(self, declares: str | None) -> str:
        """Return the declaration of a variable that a call then fills in."""
        return "" if declares is None else self.declared(declares, self.current.locals[declares], None, False)

    def updated(self, target: ast.expr, op: ast.operator, value: ast.expr) -> str:
        """Return an assignment such as ``x += value``."""
        return f"{self.expression(target)} {OPERATORS[type(op)][0]}= {self.expression(value)}"

    def alone(self, callee: FunctionDefinition) -> bool:
        """Return whether a call of the function is a statement of its own."""
        return bool(callee.changed) or callee.name in self.failing
