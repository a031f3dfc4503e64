"""The restricted form as Python."""

from __future__ import annotations

import ast
import json
from collections.abc import Sequence
from typing import ClassVar

from cra_sym.codegen.print_scripts import SAME, BracketingPrinter
from cra_sym.codegen.printing import Lines, snake
from cra_sym.kernels.form import FLOAT, Constant, FunctionDefinition, Record, Type

__all__ = ["PythonPrinter"]


class PythonPrinter(BracketingPrinter):
    """Python 3, the standard library alone."""

    name, title = "python", "Python"
    comment, end, closing, between = "#", "", "", "\n\n\n"
    true, false, infinity = "True", "False", "math.inf"
    both, either, negation = "and", "or", "not "
    otherwise, otherwise_if, end_if, end_loop = "else:", "el", "", ""
    leave, again = "break", "continue"
    functions: ClassVar = {n: f"math.{n}" for n in SAME} | {
        "abs": "abs", "min": "min", "max": "max", "isfinite": "math.isfinite",
    }  # fmt: skip

    def block(self, statements: Sequence[ast.stmt], line: int, indent: str) -> Lines:
        yield from filter(str.strip, super().block(statements, line, indent))

    def documented(self, function: FunctionDefinition) -> Lines:
        yield from ()

    def errors(self) -> str:
        """Return the classes of the errors raised."""
        base = {True: "ValueError", False: "ArithmeticError"}
        words = [f'class {e}({base[e.startswith("Invalid")]}):\n    """{snake(e).replace("_", " ").capitalize()}."""'
                 for e in self.form.errors]  # fmt: skip
        return "\n\n\n".join(words)

    def constant(self, constant: Constant) -> str:
        values = self.literal(constant)
        comment = f"  # {constant.comment}" if constant.comment else ""
        if constant.type.length is None:
            return f"{constant.name} = {values[0]}{comment}"
        return self.row(f"{constant.name} = (", values, ")" if len(values) > 1 else ",)", comment)

    def record(self, record: Record) -> Lines:
        yield from ("@dataclass", f"class {record.name}:", f'    """{record.doc or record.name}"""', "")
        for name, kind in record.fields.items():
            comment = f"  # {record.comments[name]}" if record.comments[name] else ""
            if kind.length is None:
                word = {"float": "float", "int": "int", "bool": "bool"}[kind.name]
                yield f"    {name}: {word} = {self.begun(record, name)}{comment}"
            else:
                yield f"    {name}: list = field(default_factory=lambda: {self.made(kind)}){comment}"
        numbers = [name for name, kind in record.fields.items() if kind == FLOAT]
        if numbers:
            names = ", ".join(f'"{name}"' for name in numbers)
            yield from ("", "    def __post_init__(self):")
            yield from self.wrapped(f"for name in ({names},):", "        ")
            yield "            setattr(self, name, _real(getattr(self, name)))"

    def records(self) -> str:
        return "\n\n\n".join("\n".join(self.record(record)) for record in self.form.records.values())

    def function_name(self, function: FunctionDefinition) -> str:
        return function.name

    def row_of(self, kind: Type) -> str:
        if kind.name in self.form.records:
            return f"[{kind.name}() for _ in range({kind.length})]"
        return f"[{self.made(kind.element)}] * {kind.length}"

    def new_record(self, name: str) -> str:
        return f"{name}()"

    def head(self, function: FunctionDefinition) -> Lines:
        yield f"def {function.name}({', '.join(self.given(function))}):"
        if function.doc:
            lines = function.doc.splitlines()
            yield f'    """{lines[0]}' + ('"""' if len(lines) == 1 else "")
            yield from (f"    {line}".rstrip() for line in lines[1:])
            yield from ['    """'] if len(lines) > 1 else []
        for name, kind in function.parameters.items():
            if function.public and kind == FLOAT:
                yield f"    {name} = _real({name})"

    def if_head(self, condition: str) -> str:
        return f"if {condition}:"

    def while_head(self, condition: str) -> str:
        return f"while {condition}:"

    def loop(self, name: str, start: str, stop: ast.expr, step: int) -> str:
        begin = "" if start == "0" and step == 1 else f"{start}, "
        return f"for {name} in range({begin}{self.expression(stop)}{'' if step == 1 else ', -1'}):"

    def choice(self, condition: str, value: str, otherwise: str) -> tuple[str, int]:
        return f"{value} if {condition} else {otherwise}", 0

    def divided(self, left: ast.expr, right: ast.expr, rest: bool) -> tuple[str, int]:
        return f"{self.expression(left, 7)} {'%' if rest else '//'} {self.expression(right, 8)}", 7

    def raised(self, error: str, message: str) -> str:
        return f"raise {error}({json.dumps(message)})"

    def to_float(self, node: ast.expr) -> tuple[str, int]:
        return f"float({self.expression(node)})", 10

    def to_int(self, node: ast.expr) -> tuple[str, int]:
        return f"int({self.expression(node)})", 10
