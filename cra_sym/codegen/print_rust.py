"""The restricted form as Rust, without allocation: rows are slices, functions that may fail return a Result."""

from __future__ import annotations

import ast
import math
from collections.abc import Sequence
from typing import ClassVar

from cra_sym.codegen.printing import Lines, Printer
from cra_sym.kernels.form import Constant, FunctionDefinition, Program, Record, Type, error_name

__all__ = ["RustPrinter"]

_FUNCTIONS = "sqrt exp log sin cos tan asin acos atan sinh cosh tanh asinh acosh atanh floor ceil abs min max atan2"

_IN_CORE = {"abs", "min", "max", "isfinite", "float", "int"}

_OF_PI = {math.pi: "PI", math.pi / 2: "FRAC_PI_2", 2 / math.pi: "FRAC_2_PI"}

_UPDATES = ast.Add | ast.Sub | ast.Mult | ast.Div


def _last(body: Sequence[ast.stmt]) -> set[int]:
    """Return the statements with which a body ends, in all its branches."""
    match body[-1] if body else None:
        case ast.If(body=first, orelse=second) if second:
            return _last(first) | _last(second)
        case None:
            return set()
    return {id(body[-1])}


def _most_writes(body: Sequence[ast.stmt], name: str) -> int:
    """Return the largest number of assignments to a variable on any path through a body."""
    total = 0
    for statement in body:
        match statement:
            case ast.If(body=first, orelse=second):
                total += max(_most_writes(first, name), _most_writes(second, name))
            case ast.For(body=inside) | ast.While(body=inside):
                total += 2 * _most_writes(inside, name)
            case ast.Assign(targets=[ast.Name(id=target)]) | ast.AugAssign(target=ast.Name(id=target)):
                total += target == name
    return total


class RustPrinter(Printer):
    """Rust 2021."""

    name, title = "rust", "Rust"
    choice_least = 0
    reals: ClassVar = ("float64", "float32")
    functions: ClassVar = {n: n for n in _FUNCTIONS.split()} | {
        "log": "ln", "expm1": "exp_m1", "log1p": "ln_1p", "pow": "powf", "isfinite": "is_finite",
    }  # fmt: skip

    def __init__(self, form: Program, prefix: str, real: str = "float64") -> None:
        super().__init__(form, prefix, real)
        self.infinity = f"{self.word}::INFINITY"
        self.needs_std: set[str] = set()
        for name, function in form.functions.items():
            if function.uses - _IN_CORE or function.calls & self.needs_std:
                self.needs_std.add(name)

    @property
    def word(self) -> str:
        """The type of a real number."""
        return "f64" if self.real == "float64" else "f32"

    @property
    def doc_comment(self) -> str:
        return "///"

    def errors(self) -> str:
        """Return the error type."""
        names = "\n".join(f"    {name}," for name in self.form.errors)
        return f"/// What goes wrong.\n#[derive(Clone, Copy, Debug, PartialEq, Eq)]\npub enum Error {{\n{names}\n}}"

    def constant(self, constant: Constant) -> str:
        values, kind = self.literal(constant), self.scalar(constant.type)
        doc = f"/// {constant.comment}\n" if constant.comment else ""
        head = f"{self.visibility(constant)}const {constant.name}"
        if constant.type.length is None:
            return f"{doc}{head}: {kind} = {values[0]};"
        return doc + self.row(f"{head}: [{kind}; {len(values)}] = [", values, "];")

    def visibility(self, part: Constant | Record) -> str:
        """Return `pub` for what is part of the interface."""
        return "pub " if self.is_public(part) else ""

    def record(self, record: Record) -> Lines:
        yield from (f"/// {line}".rstrip() for line in record.doc.splitlines())
        yield "#[derive(Clone, Copy, Debug, PartialEq)]"
        public = self.visibility(record)
        yield f"{public}struct {record.name} {{"
        for name, kind in record.fields.items():
            if record.comments[name]:
                yield f"    /// {record.comments[name]}"
            yield f"    {public}{name}: {self.owned(kind)},"
        yield from ("}", "", f"impl {record.name} {{", "    /// All zero.", f"    {public}const fn zero() -> Self {{")
        yield f"        {record.name} {{"
        for name in record.fields:
            yield f"            {name}: {self.begun(record, name)},"
        yield from ("        }", "    }", "}")

    def scalar(self, kind: Type) -> str:
        """Return the type of one value."""
        return {"float": self.word, "int": "i32", "bool": "bool"}.get(kind.name) or kind.name

    def size(self, kind: Type) -> str:
        """Return the length of a row in its type."""
        return str(kind.length) if isinstance(kind.length, int) else f"{kind.length} as usize"

    def owned(self, kind: Type) -> str:
        """Return the type of a variable or a field."""
        return self.scalar(kind) if kind.length is None else f"[{self.scalar(kind)}; {self.size(kind)}]"

    def parameter(self, name: str, kind: Type) -> str:
        """Return the declaration of a parameter."""
        if kind.scalar:
            return f"{name}: {self.scalar(kind)}"
        reference = "&mut " if kind.changed else "&"
        fixed = kind.length is None or isinstance(kind.length, int) or kind.length in self.form.constants
        return f"{name}: {reference}{self.owned(kind) if fixed else f'[{self.scalar(kind)}]'}"

    def documented(self, function: FunctionDefinition) -> Lines:
        mark = "///" if function.public else "//"
        yield from (f"{mark} {line}".rstrip() for line in function.doc.splitlines())

    def head(self, function: FunctionDefinition) -> Lines:
        if function.name in self.needs_std:
            yield '#[cfg(feature = "std")]'
        result = "()" if function.result is None else self.scalar(function.result)
        if function.name in self.failing:
            result = f"Result<{result}, Error>"
        arrow = "" if result == "()" else f" -> {result}"
        given = [self.parameter(name, kind) for name, kind in function.parameters.items()]
        start = f"{'pub ' if function.public else ''}fn {self.function_name(function)}("
        line = f"{start}{', '.join(given)}){arrow} {{"
        if len(line) <= 100:
            yield line
        else:
            yield start
            yield from (f"    {parameter}," for parameter in given)
            yield f"){arrow} {{"

    def tail(self, function: FunctionDefinition) -> Lines:
        if function.name in self.failing and function.result is None:
            yield "    Ok(())"
        yield "}"

    def declared(self, name: str, kind: Type, value: str | None, fixed: bool) -> str:
        if value is None:
            once = self.current.writes[name] == 1 or _most_writes(self.current.body, name) == 1
            mutable = "" if once else "mut "
            return f"let {mutable}{name}: {self.owned(kind)}"
        return f"let {'' if fixed else 'mut '}{name} = {value}"

    def made(self, kind: Type) -> str:
        if kind.length is not None:
            return f"[{self.made(kind.element)}; {self.size(kind)}]"
        return {"float": "0.0", "int": "0", "bool": "false"}.get(kind.name) or f"{kind.name}::zero()"

    def if_head(self, condition: str) -> str:
        return f"if {condition} {{"

    def while_head(self, condition: str) -> str:
        return f"while {condition} {{"

    def choice(self, condition: str, value: str, otherwise: str) -> tuple[str, int]:
        return f"if {condition} {{ {value} }} else {{ {otherwise} }}", 0

    def loop(self, name: str, start: str, stop: ast.expr, step: int) -> str:
        if step == 1:
            return f"for {name} in {start}..{self.expression(stop, 5)} {{"
        return f"for {name} in ({self.last(stop, -1)}..{start} + 1).rev() {{"

    def loop_over(self, node: ast.For, name: str) -> str:
        used = any(isinstance(n, ast.Name) and n.id == name for part in node.body for n in ast.walk(part))
        return name if used else f"_{name}"

    def _in_range(self, one: ast.expr, other: ast.expr, inside: bool) -> str:
        """Return a check of a value between or outside of two bounds as a range, or nothing if it is none."""
        match one, other:
            case (
                ast.Compare(left=value, ops=[first], comparators=[low]),
                ast.Compare(left=again, ops=[second], comparators=[high]),
            ) if ast.unparse(value) == ast.unparse(again):
                signs = (ast.GtE, ast.Lt, ast.LtE) if inside else (ast.Lt, ast.GtE, ast.Gt)
                if isinstance(first, signs[0]) and isinstance(second, signs[1:]):
                    dots = ".." if isinstance(second, signs[1]) else "..="
                    bounds = f"{self.expression(low, 5)}{dots}{self.expression(high, 5)}"
                    return f"{'' if inside else '!'}({bounds}).contains(&{self.expression(value, 10)})"
        return ""

    def printed(self, node: ast.expr) -> tuple[str, int]:
        if not isinstance(node, ast.BoolOp):
            return super().printed(node)
        inside, parts, rest = isinstance(node.op, ast.And), [], list(node.values)
        while rest:
            found = self._in_range(rest[0], rest[1], inside) if len(rest) > 1 else ""
            parts.append(found or self.expression(rest[0], 4))
            rest = rest[2 if found else 1 :]
        return (
            (parts[0], 8 if parts[0].startswith("!") else 10)
            if len(parts) == 1
            else (f" {self.both if inside else self.either} ".join(parts), 2)
        )

    def call_statement(self, target: str, call: ast.Call, callee: FunctionDefinition, indent: str) -> Lines:
        changed = [kind.changed for kind in callee.parameters.values()]
        given = ", ".join(self.argument(a, c) for a, c in zip(call.args, changed, strict=True))
        start = f"{target} = " if target else ""
        question = "?" if callee.name in self.failing else ""
        yield from self.plain(f"{start}{self.function_name(callee)}({given}){question}", indent)

    def argument(self, node: ast.expr, changed: bool = False) -> str:
        kind, text = self.kind(node), self.expression(node)
        own = isinstance(node, ast.Name) and node.id in self.current.parameters
        if kind.scalar or own:
            return text
        return f"&mut {text}" if changed else f"&{text}"

    def index(self, node: ast.expr) -> str:
        text, strength = self.printed(node)
        if isinstance(node, ast.Constant):
            return text
        return f"{text} as usize" if strength >= 9 else f"({text}) as usize"

    def statement(self, node: ast.stmt, indent: str, declares: str | None) -> Lines:
        match node:
            case ast.Assign(targets=[ast.Name(id=name)], value=ast.Call() as call) if (
                declares is not None and self.callee(call) in self.form.functions
            ):
                start = "let" if self.current.writes[name] == 1 else "let mut"
                yield from self.call_statement(f"{start} {name}", call, self.form.functions[self.callee(call)], indent)
            case ast.Raise() if id(node) in _last(self.current.body) and self.current.result is not None:
                error = self.raised(error_name(node), "").removeprefix("return ")
                yield f"{indent}{error}"
            case ast.Return(value=ast.expr() as value) if id(node) in _last(self.current.body):
                text = self.expression(value)
                yield from self.wrapped(f"Ok({text})" if self.current.name in self.failing else text, indent)
            case ast.Assign(targets=[target], value=ast.BinOp(left=left, op=op, right=right)) if (
                declares is None and ast.unparse(target) == ast.unparse(left) and isinstance(op, _UPDATES)
            ):
                yield from self.plain(self.updated(target, op, right), indent)
            case _:
                yield from super().statement(node, indent, declares)

    def returned(self, value: str | None) -> Lines:
        if self.current.name in self.failing:
            yield f"return Ok({value or '()'})"
        else:
            yield "return" if value is None else f"return {value}"

    def raised(self, error: str, message: str) -> str:
        return f"return Err(Error::{error})"

    def built_in(self, name: str, arguments: Sequence[ast.expr]) -> tuple[str, int]:
        kind = self.scalar(self.kind(arguments[0]))
        word = name if kind == "i32" else self.functions[name]
        return f"{kind}::{word}({', '.join(self.expression(a) for a in arguments)})", 10

    def number(self, value: float) -> str:
        name = _OF_PI.get(value)
        return f"core::{self.word}::consts::{name}" if name else super().number(value)

    def to_float(self, node: ast.expr) -> tuple[str, int]:
        if self.real == "float64":
            return f"f64::from({self.expression(node)})", 10
        return f"{self.expression(node, 9)} as f32", 1

    def to_int(self, node: ast.expr) -> tuple[str, int]:
        return f"{self.expression(node, 9)} as i32", 1
