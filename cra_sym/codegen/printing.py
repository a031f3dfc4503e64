"""What the printers of the restricted form share: precedence, declarations, comments, blocks.

A language is a subclass that says how it writes a declaration, a loop, a call and the like; what it writes comes from
the checked text of :mod:`cra_sym.kernels.form`. The tree of every expression is kept, brackets and all, so that every
language rounds alike.
"""

from __future__ import annotations

import ast
import re
import textwrap
from collections.abc import Iterator, Mapping, Sequence
from typing import ClassVar

import numpy as np

from cra_sym.kernels.form import INT, Constant, Form, Function, Record, Type

__all__ = ["ALWAYS", "Printer", "snake"]

Lines = Iterator[str]
ALWAYS = 10  # the precedence of what never needs brackets
_ADD, _MULTIPLY, _UNARY = 6, 7, 8
_COMPARE = 4
_LARGEST_SINGLE = 3e38
_OPERATORS: dict[type, tuple[str, int]] = {
    ast.Add: ("+", _ADD),
    ast.Sub: ("-", _ADD),
    ast.Mult: ("*", _MULTIPLY),
    ast.Div: ("/", _MULTIPLY),
}
_COMPARISONS: dict[type, str] = {
    ast.Lt: "<", ast.LtE: "<=", ast.Gt: ">", ast.GtE: ">=", ast.Eq: "==", ast.NotEq: "!=",
}  # fmt: skip


def snake(name: str) -> str:
    """Return a CamelCase name in lower case with underscores."""
    return re.sub(r"(?<=[a-z0-9])(?=[A-Z])", "_", name).lower()


class Printer:
    """Prints a checked text in one language.

    Parameters
    ----------
    form : Form
    prefix : str
        In front of all that is public, where the language has no name spaces.
    real : {'float64', 'float32'}
    """

    name = title = ""
    comment, indent, width = "//", "    ", 110
    true, false = "true", "false"
    both, either, negation = "&&", "||", "!"
    origin = 0
    closing = "}"
    functions: ClassVar[Mapping[str, str]] = {}
    reals: ClassVar[tuple[str, ...]] = ("float64",)

    def __init__(self, form: Form, prefix: str, real: str = "float64") -> None:
        if real not in self.reals:
            raise ValueError(f"real = {real!r}: {self.title} has {', '.join(self.reals)}")
        self.form, self.prefix, self.real = form, prefix, real
        self.failing = form.failing(self.also_failing())

    def also_failing(self) -> frozenset[str]:
        """Return functions that fail in this language though they raise nothing."""
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
        return "\n\n".join("\n".join(self.function(function)) for function in self.form.functions.values())

    def function(self, function: Function) -> Lines:
        """Yield the lines of a function."""
        self.current = function
        yield from self.documented(function)
        yield from self.head(function)
        yield from self.block(function.body, function.node.lineno, self.indent)
        yield from self.tail(function)

    def documented(self, function: Function) -> Lines:
        """Yield what a function does, as comments in front of it."""
        for line in textwrap.dedent(function.doc).strip().splitlines():
            yield f"{self.outer}{self.doc_comment} {line}".rstrip()

    outer = ""  # indentation of functions

    @property
    def doc_comment(self) -> str:
        """What starts a line of documentation."""
        return self.comment

    # What a language says -----------------------------------------------------------------------------------------

    def constant(self, constant: Constant) -> str:
        """Return a constant."""
        raise NotImplementedError

    def record(self, record: Record) -> Lines:
        """Yield the lines of a record."""
        raise NotImplementedError

    def head(self, function: Function) -> Lines:
        """Yield the lines before the body."""
        raise NotImplementedError

    def tail(self, function: Function) -> Lines:
        """Yield the lines after the body."""
        yield self.outer + self.closing

    def declared(self, name: str, kind: Type, value: str | None, fixed: bool) -> str:
        """Return a declaration, or an empty text where none is needed."""
        raise NotImplementedError

    def made(self, kind: Type) -> str:
        """Return a new row of zeros or a new record."""
        raise NotImplementedError

    def loop(self, name: str, start: str, stop: ast.expr, step: int) -> str:
        """Return the head of a loop over integers."""
        raise NotImplementedError

    def call_statement(self, target: str, call: ast.Call, callee: Function, indent: str) -> Lines:
        """Yield a call that stands alone, with what becomes of its result and of a failure."""
        raise NotImplementedError

    def returned(self, value: str | None) -> Lines:
        """Yield what leaves the function."""
        raise NotImplementedError

    def raised(self, error: str, message: str) -> str:
        """Return what makes the function fail."""
        raise NotImplementedError

    def choice(self, condition: str, value: str, otherwise: str) -> tuple[str, int]:
        """Return a conditional expression and its precedence; the parts are bracketed as operands of comparisons."""
        return f"{condition} ? {value} : {otherwise}", 0

    def if_head(self, condition: str) -> str:
        """Return the head of a branch."""
        return f"if ({condition}) {{"

    def while_head(self, condition: str) -> str:
        """Return the head of a loop."""
        return f"while ({condition}) {{"

    choice_least = 1  # what binds less is bracketed inside a choice
    otherwise = "} else {"
    otherwise_if = "} else "
    end_if = end_loop = "}"
    leave, again = "break;", "continue;"
    end = ";"

    def wrapped(self, text: str, indent: str) -> Lines:
        """Yield a statement on as many lines as it needs."""
        yield from textwrap.wrap(
            text, self.width, initial_indent=indent, subsequent_indent=f"{indent}    ", break_long_words=False,
            break_on_hyphens=False,
        )  # fmt: skip

    # Statements ---------------------------------------------------------------------------------------------------

    def block(self, statements: Sequence[ast.stmt], line: int, indent: str) -> Lines:
        """Yield statements, each with the comments before it and beside it."""
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
        """Yield a statement with what ends it."""
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
        """Yield the head of a branch or a loop, which only some languages let go on in the next line."""
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
        return f"{self.expression(target)} {_OPERATORS[type(op)][0]}= {self.expression(value)}"

    def alone(self, callee: Function) -> bool:
        """Return whether a call of the function is a statement of its own."""
        return bool(callee.changed) or callee.name in self.failing

    @staticmethod
    def callee(call: ast.Call) -> str:
        """Return the name of what is called."""
        assert isinstance(call.func, ast.Name)
        return call.func.id

    # Expressions --------------------------------------------------------------------------------------------------

    def kind(self, node: ast.expr) -> Type:
        """Return the type of an expression."""
        return self.current.types[id(node)]

    def expression(self, node: ast.expr, least: int = 0) -> str:
        """Return an expression, in brackets if it binds less than ``least``."""
        text, strength = self.printed(node)
        return f"({text})" if strength < least else text

    def printed(self, node: ast.expr) -> tuple[str, int]:
        """Return an expression and how strongly it binds."""
        match node:
            case ast.Constant(value=bool() as value):
                return (self.true if value else self.false), ALWAYS
            case ast.Constant(value=float() as value):
                return self.number(value), ALWAYS
            case ast.Constant(value=value):
                return str(value), ALWAYS
            case ast.Name(id=name):
                return self.variable(name), ALWAYS
            case ast.Attribute(value=base, attr=name):
                return self.field(base, name), ALWAYS
            case ast.Subscript(value=base, slice=index):
                return self.entry(self.expression(base), self.index(index)), ALWAYS
            case ast.UnaryOp(op=ast.USub(), operand=part):
                return f"-{self.expression(part, _UNARY)}", _UNARY
            case ast.UnaryOp(operand=part):
                return f"{self.negation}{self.expression(part, ALWAYS)}", 3
            case ast.BinOp(left=left, op=op, right=right):
                return self.operation(left, op, right)
            case ast.Compare(left=left, ops=[op], comparators=[right]):
                return self.compared(left, op, right)
            case ast.BoolOp(op=op, values=parts):
                word = self.both if isinstance(op, ast.And) else self.either
                return f" {word} ".join(self.expression(part, _COMPARE) for part in parts), 2
            case ast.IfExp(test=test, body=body, orelse=orelse):
                return self.choice(*(self.expression(part, self.choice_least) for part in (test, body, orelse)))
            case ast.Call(args=args):
                return self.called(self.callee(node), args)
        raise AssertionError(ast.dump(node))

    def operation(self, left: ast.expr, op: ast.operator, right: ast.expr) -> tuple[str, int]:
        """Return an operation on two numbers."""
        if isinstance(op, ast.FloorDiv | ast.Mod):
            return self.divided(left, right, isinstance(op, ast.Mod))
        sign, strength = _OPERATORS[type(op)]
        return f"{self.expression(left, strength)} {sign} {self.expression(right, strength + 1)}", strength

    def divided(self, left: ast.expr, right: ast.expr, rest: bool) -> tuple[str, int]:
        """Return the quotient or the rest of integers that are not negative."""
        sign = "%" if rest else "/"
        return f"{self.expression(left, _MULTIPLY)} {sign} {self.expression(right, _UNARY)}", _MULTIPLY

    def compared(self, left: ast.expr, op: ast.cmpop, right: ast.expr) -> tuple[str, int]:
        """Return a comparison."""
        sign = self.comparison(_COMPARISONS[type(op)])
        return f"{self.expression(left, _COMPARE + 1)} {sign} {self.expression(right, _COMPARE + 1)}", _COMPARE

    def comparison(self, sign: str) -> str:
        """Return the language's sign of a comparison."""
        return sign

    def called(self, name: str, arguments: Sequence[ast.expr]) -> tuple[str, int]:
        """Return a call inside an expression."""
        if name in self.form.functions:
            given = ", ".join(self.argument(a) for a in arguments)
            return f"{self.function_name(self.form.functions[name])}({given})", ALWAYS
        if name == "float":
            return self.to_float(arguments[0])
        if name == "int":
            return self.to_int(arguments[0])
        return self.built_in(name, arguments)

    def built_in(self, name: str, arguments: Sequence[ast.expr]) -> tuple[str, int]:
        """Return a call of a function of the language."""
        integer = self.kind(arguments[0]) == INT
        word = self.integer_function(name) if integer else self.functions[name]
        return f"{word}({', '.join(self.expression(a) for a in arguments)})", ALWAYS

    def integer_function(self, name: str) -> str:
        """Return the word for abs, min or max of integers."""
        return name

    def argument(self, node: ast.expr, changed: bool = False) -> str:
        """Return an argument of a call of a function of the text."""
        return self.expression(node)

    def variable(self, name: str) -> str:
        """Return a variable or a constant."""
        return name

    def field(self, base: ast.expr, name: str) -> str:
        """Return a field of a record."""
        return f"{self.expression(base)}.{name}"

    def entry(self, row: str, index: str) -> str:
        """Return an entry of a row."""
        return f"{row}[{index}]"

    def index(self, node: ast.expr) -> str:
        """Return an index, counted as the language does."""
        if not self.origin:
            return self.expression(node)
        match node:
            case ast.Constant(value=int() as value):
                return str(value + 1)
            case ast.BinOp(left=left, op=ast.Sub(), right=ast.Constant(value=1)):
                return self.expression(left)
        return f"{self.expression(node, _ADD)} + 1"

    def last(self, stop: ast.expr, step: int) -> str:
        """Return the last number of a loop, for languages that name it instead of the one after it."""
        match stop:
            case ast.Constant(value=int() as value):
                return str(value - step)
            case ast.UnaryOp(op=ast.USub(), operand=ast.Constant(value=int() as value)):
                return str(-value - step)
            case ast.BinOp(left=left, op=ast.Add(), right=ast.Constant(value=1)) if step == 1:
                return self.expression(left)
        return f"{self.expression(stop, _ADD)} {'-' if step == 1 else '+'} 1"

    def number(self, value: float) -> str:
        """Return a literal that reads back as exactly this number."""
        return self.digits(value)

    def digits(self, value: float) -> str:
        """Return the fewest digits that tell a number of this type from all others."""
        return str(np.float32(value)) if self.real == "float32" else repr(float(value))

    def literal(self, constant: Constant) -> list[str]:
        """Return the values of a constant."""
        if self.real == "float32" and any(abs(v) > _LARGEST_SINGLE for v in constant.values):
            raise ValueError(f"real = 'float32': {constant.name} is out of its range; take float64 or fewer modes")
        return [str(v) if constant.type.name == "int" else self.number(v) for v in constant.values]

    def to_float(self, node: ast.expr) -> tuple[str, int]:
        """Return an integer as a double."""
        raise NotImplementedError

    def to_int(self, node: ast.expr) -> tuple[str, int]:
        """Return a double cut toward zero."""
        raise NotImplementedError

    def function_name(self, function: Function) -> str:
        """Return the name of a function as it is printed."""
        return function.name.lstrip("_")

    def loops_length(self, kind: Type) -> str:
        """Return the length of a row as text."""
        return str(kind.length)
