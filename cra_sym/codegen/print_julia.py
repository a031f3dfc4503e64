"""The restricted form as Julia."""

from __future__ import annotations

import ast
import json
from collections.abc import Sequence
from typing import ClassVar

from cra_sym.codegen.print_scripts import SAME, BracketingPrinter
from cra_sym.codegen.printing import Lines
from cra_sym.kernels.form import Constant, FunctionDefinition, Record, Type

__all__ = ["JuliaPrinter"]


class JuliaPrinter(BracketingPrinter):
    """Julia: rows are vectors, records mutable structs."""

    name, title = "julia", "Julia"
    comment, end, closing, origin = "#", "", "end", 1
    otherwise, otherwise_if, end_if, end_loop = "else", "else", "end", "end"
    leave, again, infinity = "break", "continue", "Inf"
    functions: ClassVar = {n: n for n in (*SAME, "abs", "min", "max", "isfinite")} | {"atan2": "atan", "pow": "^"}

    def constant(self, constant: Constant) -> str:
        values = self.literal(constant)
        comment = f" # {constant.comment}" if constant.comment else ""
        if constant.type.length is None:
            return f"const {constant.name} = {values[0]}{comment}"
        row = "\n".join(self.wrapped(", ".join(values) + ",", "    "))
        return f"const {constant.name} = [{comment}\n{row}\n]"

    def record(self, record: Record) -> Lines:
        yield from ('"""', record.doc or record.name, '"""', f"Base.@kwdef mutable struct {record.name}")
        words = {"float": "Float64", "int": "Int", "bool": "Bool"}
        for name, kind in record.fields.items():
            comment = f" # {record.comments[name]}" if record.comments[name] else ""
            word = words[kind.name] if kind.length is None else f"Vector{{{words[kind.name]}}}"
            yield f"    {name}::{word} = {self.begun(record, name)}{comment}"
        yield "end"

    def row_of(self, kind: Type) -> str:
        if kind.name in self.form.records:
            return f"[{kind.name}() for _ in 1:{kind.length}]"
        return f"fill({self.made(kind.element)}, {kind.length})"

    def new_record(self, name: str) -> str:
        return f"{name}()"

    def documented(self, function: FunctionDefinition) -> Lines:
        yield from ('"""', *function.doc.splitlines(), '"""') if function.doc else ()

    def head(self, function: FunctionDefinition) -> Lines:
        yield f"function {self.function_name(function)}({', '.join(self.given(function))})"

    def returned(self, value: str | None) -> Lines:
        values = ([] if value is None else [value]) + self.results(self.current)
        yield f"return {', '.join(values)}" if values else "return nothing"

    def tail(self, function: FunctionDefinition) -> Lines:
        if not isinstance(function.body[-1], ast.Return):
            yield f"    {next(iter(self.returned(None)))}"
        yield "end"

    def declared(self, name: str, kind: Type, value: str | None, fixed: bool) -> str:
        return f"local {name}" if value is None else f"{name} = {value}"

    def if_head(self, condition: str) -> str:
        return f"if {condition}"

    def while_head(self, condition: str) -> str:
        return f"while {condition}"

    def loop(self, name: str, start: str, stop: ast.expr, step: int) -> str:
        return f"for {name} in {start}:{'' if step == 1 else '-1:'}{self.last(stop, step)}"

    def divided(self, left: ast.expr, right: ast.expr, rest: bool) -> tuple[str, int]:
        return f"{'rem' if rest else 'div'}({self.expression(left)}, {self.expression(right)})", 10

    def raised(self, error: str, message: str) -> str:
        kind = "DomainError(nothing, " if error.startswith("Invalid") else "ErrorException("
        return f"throw({kind}{json.dumps(message)}))".replace("$", "\\$")

    def built_in(self, name: str, arguments: Sequence[ast.expr]) -> tuple[str, int]:
        if name == "pow":
            return f"{self.expression(arguments[0], 10)}^{self.expression(arguments[1], 10)}", 9
        return super().built_in(name, arguments)

    def to_float(self, node: ast.expr) -> tuple[str, int]:
        return f"Float64({self.expression(node)})", 10

    def to_int(self, node: ast.expr) -> tuple[str, int]:
        return f"trunc(Int, {self.expression(node)})", 10
