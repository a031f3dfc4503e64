"""The restricted form as JavaScript and Octave, with a base class for languages without types."""

from __future__ import annotations

import ast
import json
import re
from collections.abc import Sequence
from typing import ClassVar

from cra_sym.codegen.printing import Lines, Printer, folded, snake
from cra_sym.kernels.form import Constant, FunctionDefinition, Program, Record, Type

__all__ = ["SAME", "BracketingPrinter", "JavaScriptPrinter", "OctavePrinter", "ScriptPrinter"]

SAME = (
    "sqrt exp expm1 log log1p sin cos tan asin acos atan sinh cosh tanh asinh acosh atanh floor ceil atan2 pow".split()
)


def _mentions(node: ast.AST, name: str) -> bool:
    """Return whether a name occurs."""
    return any(isinstance(part, ast.Name) and part.id == name for part in ast.walk(node))


_STATEMENT = re.compile(r"return |[^\s\"'].*? [-+*/]?= ")
"""Tokens after which a value may follow."""


class ScriptPrinter(Printer):
    """Base class for languages without types: results are returned, and no variable is declared."""

    def __init__(self, form: Program, prefix: str, real: str = "float64") -> None:
        super().__init__(form, prefix, real)
        self.made_later: set[int] = set()

    def results(self, function: FunctionDefinition) -> list[str]:
        """Return the parameters that a function creates and returns."""
        return [name for name, kind in function.parameters.items() if kind.access == "out"]

    def block(self, statements: Sequence[ast.stmt], line: int, indent: str) -> Lines:
        """Yield statements without rows and records that are created only for the call that makes them."""
        found = (one for at, one in enumerate(statements) if self.is_made_later(one, statements[at + 1 :]))
        self.made_later |= set(map(id, found))
        yield from super().block(statements, line, indent)

    def statement(self, node: ast.stmt, indent: str, declares: str | None) -> Lines:
        if id(node) in self.made_later:
            self.left_to_call(declares or "")
        else:
            yield from super().statement(node, indent, declares)

    def left_to_call(self, name: str) -> None:
        """Leave the declaration of a variable to the call that makes it."""

    def is_made_later(self, statement: ast.stmt, after: Sequence[ast.stmt]) -> bool:
        """Return whether a statement only creates a row or a record that the next statement using it creates again."""
        match statement:
            case ast.Assign(targets=[ast.Name(id=name)], value=ast.Call()) if (
                self.current.homes.get(name) == id(statement)
                and not self.current.locals[name].scalar
                and not self.comment_beside(statement)
            ):
                found = next((one for one in after if _mentions(one, name)), None)
            case _:
                return False
        match found:
            case ast.Expr(value=ast.Call() as call) | ast.Assign(value=ast.Call() as call) if (
                callee := self.form.functions.get(self.callee(call))
            ):
                kinds = [kind.access for kind in callee.parameters.values()]
                given = [kinds[at] for at, argument in enumerate(call.args) if _mentions(argument, name)]
                return given == ["out"] and any(isinstance(a, ast.Name) and a.id == name for a in call.args)
        return False

    def given(self, function: FunctionDefinition) -> list[str]:
        """Return the parameters a caller gives."""
        return [name for name, kind in function.parameters.items() if kind.access != "out"]

    def declared(self, name: str, kind: Type, value: str | None, fixed: bool) -> str:
        return "" if value is None else f"{name} = {value}"

    def made(self, kind: Type) -> str:
        if kind.length is not None:
            return self.row_of(kind)
        return {"float": self.number(0.0), "int": "0", "bool": self.false}.get(kind.name) or self.new_record(kind.name)

    def row_of(self, kind: Type) -> str:
        """Return a new row."""
        raise NotImplementedError

    def new_record(self, name: str) -> str:
        """Return a new record."""
        raise NotImplementedError

    def start(self, function: FunctionDefinition) -> Lines:
        """Yield the statements that create the results."""
        for name in self.results(function):
            text = self.declared(name, function.parameters[name], self.made(function.parameters[name]), True)
            yield from self.plain(text, self.indent)

    def together(self, names: Sequence[str]) -> str:
        """Return several values as one."""
        return ", ".join(names)

    def returned(self, value: str | None) -> Lines:
        values = ([] if value is None else [value]) + self.results(self.current)
        yield f"return {self.together(values)}" if values else "return"

    def tail(self, function: FunctionDefinition) -> Lines:
        if function.result is None and self.results(function) and not isinstance(function.body[-1], ast.Return):
            yield from self.plain(next(iter(self.returned(None))), self.indent)
        yield from filter(None, [self.closing])

    def call_statement(self, target: str, call: ast.Call, callee: FunctionDefinition, indent: str) -> Lines:
        by_name = dict(zip(callee.parameters, call.args, strict=True))
        given = ", ".join(self.argument(by_name[name]) for name in self.given(callee))
        targets = ([target] if target else []) + [self.expression(by_name[name]) for name in self.results(callee)]
        start = f"{self.targets(targets)} = " if targets else ""
        yield from self.plain(f"{start}{self.function_name(callee)}({given})", indent)

    def targets(self, names: Sequence[str]) -> str:
        """Return the targets of the assignment of a call."""
        return self.together(names)


class BracketingPrinter(ScriptPrinter):
    """Base class for languages in which a line ends the statement: long ones are continued within brackets."""

    def wrapped(self, text: str, indent: str) -> Lines:
        if len(indent + text) <= self.width:
            yield indent + text
            return
        found = _STATEMENT.match(text)
        if found is None:
            yield from super().wrapped(text, indent)
            return
        head, value = found[0], text[found.end() :]
        yield f"{indent}{head}("
        yield from super().wrapped(value, f"{indent}    ")
        yield f"{indent})"


class JavaScriptPrinter(ScriptPrinter):
    """JavaScript, an ECMAScript module."""

    name, title, infinity = "javascript", "JavaScript", "Infinity"
    functions: ClassVar = {n: f"Math.{n}" for n in SAME} | {
        "abs": "Math.abs", "min": "Math.min", "max": "Math.max", "isfinite": "Number.isFinite",
    }  # fmt: skip

    def __init__(self, form: Program, prefix: str, real: str = "float64") -> None:
        super().__init__(form, prefix, real)
        self.undeclared: set[str] = set()

    def left_to_call(self, name: str) -> None:
        self.undeclared.add(name)

    def declaration_before(self, declares: str | None) -> str:
        self.undeclared |= {declares} if declares else set()
        return ""

    def call_statement(self, target: str, call: ast.Call, callee: FunctionDefinition, indent: str) -> Lines:
        results = set(self.results(callee))
        made = [a.id for a, name in zip(call.args, callee.parameters, strict=True)
                if name in results and isinstance(a, ast.Name)]  # fmt: skip
        new = {name for name in (target, *made) if name in self.undeclared}
        self.undeclared -= new
        (line, *more) = super().call_statement(target, call, callee, indent)
        if new and len(new) == bool(target) + len(results):
            whole = any(not self.current.locals[name].scalar or self.current.writes[name] > 1 for name in new)
            yield f"{indent}{'let' if whole else 'const'} {line.lstrip()}"
        else:
            yield from [f"{indent}let {', '.join(sorted(new))};"] if new else []
            yield line
        yield from more

    def constant(self, constant: Constant) -> str:
        values = self.literal(constant)
        comment = f" // {constant.comment}" if constant.comment else ""
        if constant.type.length is None:
            return f"{self.exported(constant)}const {constant.name} = {values[0]};{comment}"
        return self.row(f"{self.exported(constant)}const {constant.name} = [", values, "];", comment)

    def exported(self, part: Constant | Record) -> str:
        """Return `export` for what is part of the interface."""
        return "export " if self.is_public(part) else ""

    def record(self, record: Record) -> Lines:
        yield from (f"// {line}".rstrip() for line in record.doc.splitlines())
        yield f"{self.exported(record)}function {self.new_record(record.name)} {{"
        yield "    return {"
        for name in record.fields:
            comment = f" // {record.comments[name]}" if record.comments[name] else ""
            yield f"        {name}: {self.begun(record, name)},{comment}"
        yield from ("    };", "}")

    def row_of(self, kind: Type) -> str:
        if kind.name in self.form.records:
            return f"Array.from({{ length: {kind.length} }}, () => {self.new_record(kind.name)})"
        return f"new Array({kind.length}).fill({self.made(kind.element)})"

    def new_record(self, name: str) -> str:
        return f"new_{snake(name)}()"

    def head(self, function: FunctionDefinition) -> Lines:
        export = "export " if function.public else ""
        yield f"{export}function {self.function_name(function)}({', '.join(self.given(function))}) {{"

    def together(self, names: Sequence[str]) -> str:
        return names[0] if len(names) == 1 else f"[{', '.join(names)}]"

    def declared(self, name: str, kind: Type, value: str | None, fixed: bool) -> str:
        whole = not kind.scalar  # a call may return another object
        return f"let {name}" if value is None else f"{'const' if fixed and not whole else 'let'} {name} = {value}"

    def loop(self, name: str, start: str, stop: ast.expr, step: int) -> str:
        sign, change = ("<", "++") if step == 1 else (">", "--")
        return f"for (let {name} = {start}; {name} {sign} {self.expression(stop, 5)}; {name}{change}) {{"

    def comparison(self, sign: str) -> str:
        return {"==": "===", "!=": "!=="}.get(sign, sign)

    def divided(self, left: ast.expr, right: ast.expr, rest: bool) -> tuple[str, int]:
        text, strength = super().divided(left, right, rest)
        return (text, strength) if rest else (f"Math.floor({text})", 10)

    def raised(self, error: str, message: str) -> str:
        kind = "RangeError" if error.startswith("Invalid") else "Error"
        return f"throw new {kind}({json.dumps(message)})"

    def integer_function(self, name: str) -> str:
        return f"Math.{name}"

    def to_float(self, node: ast.expr) -> tuple[str, int]:
        return self.printed(node)

    def to_int(self, node: ast.expr) -> tuple[str, int]:
        return f"Math.trunc({self.expression(node)})", 10


class OctavePrinter(ScriptPrinter):
    """Octave and MATLAB: rows and records are values, so what a function changes it returns too."""

    name, title, infinity = "octave", "Octave", "Inf"
    comment, closing, origin, width = "%", "end", 1, 100
    negation = "~"
    choice_least = 0
    otherwise, otherwise_if, end_if, end_loop = "else", "else", "end", "end"
    functions: ClassVar = {n: n for n in (*SAME, "abs", "min", "max", "isfinite")} | {"pow": "power"}
    helpers = """\
function out = choose(condition, value, other)
    if condition
        out = value;
    else
        out = other;
    end
end
"""

    def results(self, function: FunctionDefinition) -> list[str]:
        return function.changed

    def start(self, function: FunctionDefinition) -> Lines:
        for name, kind in function.parameters.items():
            if kind.access == "out":
                yield from self.plain(f"{name} = {self.made(kind)}", self.indent)

    def constant(self, constant: Constant) -> str:
        values, lines = self.literal(constant), [f"% {constant.comment}"] if constant.comment else []
        if constant.type.length is None:
            return "\n".join([*lines, f"function out = {constant.name}()", f"    out = {values[0]};", "end"])
        row = list(self.wrapped(f"out = [{', '.join(values)}];", "    "))
        head, last = (
            [f"function out = {constant.name}(index)"],
            ["    if nargin", "        out = out(index);", "    end"],
        )
        return "\n".join([*lines, *head, *row, *last, "end"])

    def constants(self) -> str:
        return "\n\n".join(self.constant(constant) for constant in self.form.constants.values())

    def record(self, record: Record) -> Lines:
        yield f"function record = {self.new_record(record.name).removesuffix('()')}()"
        yield from (f"% {line}".rstrip() for line in record.doc.splitlines())
        for name in record.fields:
            comment = f" % {record.comments[name]}" if record.comments[name] else ""
            yield f"    record.{name} = {self.begun(record, name)};{comment}"
        yield "end"

    def row_of(self, kind: Type) -> str:
        if kind.name in self.form.records:
            return f"repmat({self.new_record(kind.name)}, 1, {kind.length})"
        return f"zeros(1, {kind.length})" if kind.name != "bool" else f"false(1, {kind.length})"

    def new_record(self, name: str) -> str:
        return f"new_{snake(name)}()"

    def documented(self, function: FunctionDefinition) -> Lines:
        yield from ()

    def head(self, function: FunctionDefinition) -> Lines:
        outs = (["result"] if function.result else []) + self.results(function)
        left = "" if not outs else f"{outs[0]} = " if len(outs) == 1 else f"[{', '.join(outs)}] = "
        yield f"function {left}{self.function_name(function)}({', '.join(self.given(function))})"
        yield from (f"% {line}".rstrip() for line in function.doc.splitlines())

    def tail(self, function: FunctionDefinition) -> Lines:
        yield "end"

    def returned(self, value: str | None) -> Lines:
        if value is not None:
            yield f"result = {value}"
        yield "return"

    def targets(self, names: Sequence[str]) -> str:
        return names[0] if len(names) == 1 else f"[{', '.join(names)}]"

    def wrapped(self, text: str, indent: str) -> Lines:
        lines = folded(text, self.width, indent)
        yield from " ...\n".join(lines).split("\n")

    def if_head(self, condition: str) -> str:
        return f"if {condition}"

    def while_head(self, condition: str) -> str:
        return f"while {condition}"

    def loop(self, name: str, start: str, stop: ast.expr, step: int) -> str:
        return f"for {name} = {start}:{'' if step == 1 else '-1:'}{self.last(stop, step)}"

    def choice(self, condition: str, value: str, otherwise: str) -> tuple[str, int]:
        return f"choose({condition}, {value}, {otherwise})", 10

    def updated(self, target: ast.expr, op: ast.operator, value: ast.expr) -> str:
        return f"{self.expression(target)} = {self.operation(target, op, value)[0]}"

    def entry(self, row: str, index: str) -> str:
        return f"{row}({index})"

    def comparison(self, sign: str) -> str:
        return {"!=": "~="}.get(sign, sign)

    def divided(self, left: ast.expr, right: ast.expr, rest: bool) -> tuple[str, int]:
        if rest:
            return f"mod({self.expression(left)}, {self.expression(right)})", 10
        return f"floor({super().divided(left, right, rest)[0]})", 10

    def raised(self, error: str, message: str) -> str:
        plain = message.replace("'", "''")  # a format string, in which % and \\ are special
        return f"error('{self.prefix}:{snake(error)}', '%s', '{plain}')"

    def to_float(self, node: ast.expr) -> tuple[str, int]:
        return self.printed(node)

    def to_int(self, node: ast.expr) -> tuple[str, int]:
        return f"fix({self.expression(node)})", 10
