"""The restricted form as C99."""

from __future__ import annotations

import ast
from collections.abc import Sequence
from typing import ClassVar

from cra_sym.codegen.printing import Lines, Printer, snake
from cra_sym.kernels.form import Constant, FunctionDefinition, Record, Type

__all__ = ["CPrinter"]

_FUNCTIONS = (
    "sqrt exp expm1 log log1p sin cos tan asin acos atan sinh cosh tanh asinh acosh atanh floor ceil atan2 pow".split()
)


class CPrinter(Printer):
    """C99: rows are pointers, functions that may fail return a status, and public functions refuse NULL."""

    name, title = "c", "C99"
    functions: ClassVar = {n: n for n in _FUNCTIONS} | {
        "abs": "fabs", "min": "fmin", "max": "fmax", "isfinite": "isfinite",
    }  # fmt: skip
    reals: ClassVar = ("float64", "float32")
    true, false = "1", "0"

    def also_failing(self) -> frozenset[str]:
        return frozenset(
            f.name for f in self.form.functions.values() if f.public and any(map(_points, f.parameters.values()))
        )

    @property
    def word(self) -> str:
        """The type of a real number."""
        return "double" if self.real == "float64" else "float"

    def header(self) -> str:
        """Return constants, status, records and public functions as declarations."""
        errors = [f"{self.upper}_NULL_POINTER", *(self.error(e) for e in self.form.errors)]
        listed = [f"    {self.upper}_OK = 0", *(f"    {name} = {n}" for n, name in enumerate(errors, 1))]
        inside = ",\n".join(listed)
        status = f"typedef enum {{\n{inside}\n}} {self.prefix}_status;"
        public = [f for f in self.form.functions.values() if f.public]
        declarations = ["\n".join([*self.documented(f), *self.signature(f, ";")]) for f in public]
        records = "\n\n".join("\n".join(self.record(r)) for r in self.form.records.values() if self.is_public(r))
        return "\n\n".join(filter(None, [status, self.integers(), records, *declarations]))

    def integers(self) -> str:
        """Return the constants for the caller."""
        found = []
        for c in filter(self.is_in_header, self.form.constants.values()):
            name = self.variable(c.name)
            if not _counts(c):
                found.append(self.documented_constant(c, f"#define {name} {self.literal(c)[0]}"))
            elif c.name.startswith("MOST_"):  # sizes of arrays, which may be set where memory is limited
                found += [f"#ifndef {name}", self.documented_constant(c, f"#define {name} {c.values[0]}"), "#endif"]
            else:
                found.append(self.constant(c))
        return "\n".join(found)

    def constants(self) -> str:
        return "\n".join(self.constant(c) for c in self.form.constants.values() if not self.is_in_header(c))

    def records(self) -> str:
        return "\n\n".join("\n".join(self.record(r)) for r in self.form.records.values() if not self.is_public(r))

    def is_in_header(self, constant: Constant) -> bool:
        """Return whether a constant is in the header."""
        return self.is_public(constant) and constant.type.length is None

    def constant(self, constant: Constant) -> str:
        kind, values = self.scalar(constant.type), self.literal(constant)
        name = self.variable(constant.name)
        if _counts(constant):
            return self.documented_constant(constant, f"enum {{ {name} = {constant.values[0]} }};")
        if constant.type.length is None:
            return self.documented_constant(constant, f"static const {kind} {name} = {values[0]};")
        comment = f" /* {constant.comment} */" if constant.comment else ""
        return self.row(f"static const {kind} {name}[{len(values)}] = {{ ", values, " };", comment)

    def documented_constant(self, constant: Constant, text: str) -> str:
        """Return a constant with its comment."""
        return f"{text} /* {constant.comment} */" if constant.comment else text

    @property
    def upper(self) -> str:
        """The prefix in capitals."""
        return self.prefix.upper()

    def error(self, name: str) -> str:
        """Return the status of an error."""
        return f"{self.upper}_{snake(name).upper()}"

    def record(self, record: Record) -> Lines:
        yield from (f"// {line}".rstrip() for line in record.doc.splitlines())
        yield "typedef struct {"
        for name, kind in record.fields.items():
            length = "" if kind.length is None else f"[{self.length(kind)}]"
            comment = f" // {record.comments[name]}" if record.comments[name] else ""
            yield f"    {self.scalar(kind)} {name}{length};{comment}"
        yield f"}} {self.record_name(record.name)};"

    def record_name(self, name: str) -> str:
        """Return the type of a record."""
        return f"{self.prefix}_{snake(name)}"

    def scalar(self, kind: Type) -> str:
        """Return the type of one value."""
        plain = {"float": self.word, "int": "int", "bool": "int"}
        return plain.get(kind.name) or self.record_name(kind.name)

    def length(self, kind: Type) -> str:
        """Return a length: a number or a constant."""
        return self.variable(str(kind.length))

    def variable(self, name: str) -> str:
        return f"{self.upper}_{name}" if name in self.form.constants else name

    def function_name(self, function: FunctionDefinition) -> str:
        return f"{self.prefix}_{function.name}" if function.public else function.name.lstrip("_")

    def parameter(self, name: str, kind: Type) -> str:
        """Return the declaration of a parameter."""
        if kind.scalar:
            return f"{self.scalar(kind)} {name}"
        const = "" if kind.changed else "const "
        if kind.length is None:
            return f"{const}{self.scalar(kind)} *{name}"
        fixed = isinstance(kind.length, int) or kind.length in self.form.constants
        return f"{const}{self.scalar(kind)} {name}[{self.length(kind) if fixed else ''}]"

    def signature(self, function: FunctionDefinition, end: str) -> Lines:
        """Yield the head of a function."""
        parameters = [self.parameter(name, kind) for name, kind in function.parameters.items()]
        result = "void" if function.result is None else self.scalar(function.result)
        if function.name in self.failing:
            parameters += [] if function.result is None else [f"{result} *result"]
            result = f"{self.prefix}_status"
        static = "" if function.public else "static inline "
        head = f"{static}{result} {self.function_name(function)}("
        text, lines = head, []
        for number, parameter in enumerate(parameters or ["void"]):
            piece = parameter + (", " if number + 1 < len(parameters) else f"){end}")
            if len(text) + len(piece) > self.width:
                lines.append(text.rstrip())
                text = " " * len(head)
            text += piece
        yield from [*lines, text]

    def head(self, function: FunctionDefinition) -> Lines:
        yield from self.signature(function, "")
        yield "{"
        pointers = [n for n, kind in function.parameters.items() if _points(kind)]
        if function.public:
            pointers += ["result"] if function.result and function.name in self.failing else []
            if pointers:
                tests = " || ".join(f"{name} == NULL" for name in pointers)
                yield from self.wrapped(f"if ({tests}) {{", self.indent)
                yield from (f"        return {self.upper}_NULL_POINTER;", "    }")
        if function.calls & self.failing:
            yield f"    {self.prefix}_status status;"

    def tail(self, function: FunctionDefinition) -> Lines:
        if function.name in self.failing and function.result is None:
            yield f"    return {self.upper}_OK;"
        yield "}"

    def declared(self, name: str, kind: Type, value: str | None, fixed: bool) -> str:
        if kind.length is not None:
            return f"{self.scalar(kind)} {name}[{self.length(kind)}] = {{ {self.zero(kind)} }}"
        if not kind.scalar:
            return f"{self.scalar(kind)} {name} = {{ 0 }}"
        const = "const " if fixed else ""
        return f"{const}{self.scalar(kind)} {name}" + ("" if value is None else f" = {value}")

    def zero(self, kind: Type) -> str:
        """Return a zero of a type."""
        return self.number(0.0) if kind.name == "float" else "0"

    def made(self, kind: Type) -> str:
        return ""

    def loop(self, name: str, start: str, stop: ast.expr, step: int) -> str:
        sign, change = ("<", "++") if step == 1 else (">", "--")
        return f"for (int {name} = {start}; {name} {sign} {self.expression(stop, 5)}; {name}{change}) {{"

    def call_statement(self, target: str, call: ast.Call, callee: FunctionDefinition, indent: str) -> Lines:
        changed = [kind.changed for kind in callee.parameters.values()]
        given = [self.argument(a, c) for a, c in zip(call.args, changed, strict=True)]
        name = self.function_name(callee)
        if callee.name not in self.failing:
            start = f"{target} = " if target else ""
            yield from self.plain(f"{start}{name}({', '.join(given)})", indent)
            return
        given += [f"&{target}"] if target else []
        yield from self.plain(f"status = {name}({', '.join(given)})", indent)
        yield f"{indent}if (status != {self.upper}_OK) {{"
        yield f"{indent}    return status;"
        yield f"{indent}}}"

    def argument(self, node: ast.expr, changed: bool = False) -> str:
        kind = self.kind(node)
        text = self.expression(node)
        own = isinstance(node, ast.Name) and node.id in self.current.parameters
        return f"&{text}" if not kind.scalar and kind.length is None and not own else text

    def field(self, base: ast.expr, name: str) -> str:
        own = isinstance(base, ast.Name) and base.id in self.current.parameters
        return f"{self.expression(base)}{'->' if own else '.'}{name}"

    def returned(self, value: str | None) -> Lines:
        if self.current.name not in self.failing:
            yield "return" if value is None else f"return {value}"
            return
        if value is not None:
            yield f"*result = {value}"
        yield f"return {self.upper}_OK"

    def raised(self, error: str, message: str) -> str:
        return f"return {self.error(error)}"

    def number(self, value: float) -> str:
        text = self.digits(value)
        if self.real == "float64":
            return text
        return f"{text}{'' if '.' in text or 'e' in text else '.0'}f"

    def built_in(self, name: str, arguments: Sequence[ast.expr]) -> tuple[str, int]:
        text, strength = super().built_in(name, arguments)
        if self.real == "float32" and self.kind(arguments[0]).name == "float" and name != "isfinite":
            text = text.replace("(", "f(", 1)
        return text, strength

    def integer_function(self, name: str) -> str:
        return {"abs": "abs", "min": "smaller_of", "max": "larger_of"}[name]

    def to_float(self, node: ast.expr) -> tuple[str, int]:
        return f"({self.word}){self.expression(node, 9)}", 8

    def to_int(self, node: ast.expr) -> tuple[str, int]:
        return f"(int){self.expression(node, 9)}", 8


def _points(kind: Type) -> bool:
    return not kind.scalar


def _counts(constant: Constant) -> bool:
    return constant.type.name == "int" and constant.type.length is None
