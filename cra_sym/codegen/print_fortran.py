"""The restricted form as Fortran 2008: rows count from 0, procedures are pure, those that may fail have a status."""

from __future__ import annotations

import ast
from collections.abc import Sequence
from typing import ClassVar

from cra_sym.codegen.printing import Lines, Printer, folded, snake
from cra_sym.kernels.form import BOOL, FLOAT, Constant, FunctionDefinition, Record, Type

__all__ = ["FortranPrinter"]

_FUNCTIONS = "sqrt exp log sin cos tan asin acos atan sinh cosh tanh asinh acosh atanh abs min max atan2".split()


class FortranPrinter(Printer):
    """Fortran 2008."""

    name, title = "fortran", "Fortran 2008"
    choice_least = 0
    comment, outer, indent = "!", "  ", "    "
    true, false = ".true.", ".false."
    both, either, negation = ".and.", ".or.", ".not. "
    functions: ClassVar = {n: n for n in _FUNCTIONS} | {
        "expm1": "expm1", "log1p": "log1p", "floor": "floor_real", "ceil": "ceiling_real", "isfinite": "ieee_is_finite",
    }  # fmt: skip
    reals: ClassVar = ("float64", "float32")
    otherwise, otherwise_if, end_if, end_loop = "else", "else ", "end if", "end do"
    leave, again, end = "exit", "cycle", ""

    @property
    def doc_comment(self) -> str:
        return "!>"

    def wrapped(self, text: str, indent: str) -> Lines:
        lines = folded(text, self.width, indent)
        yield from " &\n".join(lines).split("\n")

    def headed(self, text: str, indent: str) -> Lines:
        yield from self.wrapped(text, indent)

    def constants(self) -> str:
        errors = [f"  integer, parameter :: {self.error(e)} = {n}" for n, e in enumerate(self.form.errors, 1)]
        ok = f"  integer, parameter :: {self.prefix}_ok = 0"
        return "\n".join([ok, *errors, super().constants()])

    def error(self, name: str) -> str:
        """Return the status of an error."""
        return f"{self.prefix}_{snake(name)}"

    def constant(self, constant: Constant) -> str:
        values, row = self.literal(constant), constant.type.length is not None
        shape = f"(0:{len(values) - 1})" if row else ""
        value = f"[{', '.join(values)}]" if row else values[0]
        comment = f"  !> {constant.comment}\n" if constant.comment else ""
        text = f"{self.scalar(constant.type)}, parameter :: {constant.name}{shape} = {value}"
        return comment + "\n".join(self.wrapped(text, "  "))

    def record(self, record: Record) -> Lines:
        yield from (f"  !> {line}".rstrip() for line in record.doc.splitlines())
        yield f"  type :: {self.record_name(record.name)}"
        for name, kind in record.fields.items():
            comment = f" ! {record.comments[name]}" if record.comments[name] else ""
            start = "huge(1.0_dp)" if name in record.infinite else self.zero(kind)
            yield f"    {self.scalar(kind)} :: {name}{self.bounds(kind)} = {start}{comment}"
        yield f"  end type {self.record_name(record.name)}"

    def record_name(self, name: str) -> str:
        """Return the type of a record."""
        return f"{self.prefix}_{snake(name)}"

    def scalar(self, kind: Type) -> str:
        """Return the type of one value."""
        plain = {"float": "real(dp)", "int": "integer", "bool": "logical"}
        return plain.get(kind.name) or f"type({self.record_name(kind.name)})"

    def bounds(self, kind: Type) -> str:
        """Return the bounds of a row."""
        if kind.length is None:
            return ""
        last = kind.length - 1 if isinstance(kind.length, int) else f"{kind.length} - 1"
        return f"(0:{last})"

    def is_subroutine(self, function: FunctionDefinition) -> bool:
        """Return whether the function is a subroutine."""
        return function.result is None or self.alone(function)

    def head(self, function: FunctionDefinition) -> Lines:
        names, subroutine = list(function.parameters), self.is_subroutine(function)
        if subroutine:
            names += ["result"] if function.result else []
            names += ["status"] if function.name in self.failing else []
        kind, end = ("subroutine", "") if subroutine else ("function", " result(result)")
        yield from self.wrapped(f"pure {kind} {self.function_name(function)}({', '.join(names)}){end}", "  ")
        for name, kind_of in self.by_dependence(function):
            intent = {"in": "in", "out": "out", "mut": "inout"}[kind_of.access]
            yield f"    {self.scalar(kind_of)}, intent({intent}) :: {name}{self.bounds(kind_of)}"
        if function.result is not None:
            yield f"    {self.scalar(function.result)}{', intent(out)' if subroutine else ''} :: result"
        if function.name in self.failing:
            yield "    integer, intent(out) :: status"
        for text, members in self.local_groups(function).items():
            yield from self.wrapped(f"{text} :: {', '.join(members)}", "    ")
        if function.name in self.failing:
            yield f"    status = {self.prefix}_ok"
            if function.result is not None:
                yield f"    result = {self.zero(function.result)}"

    def function_name(self, function: FunctionDefinition) -> str:
        return f"{self.prefix}_{function.name}" if function.public else function.name.lstrip("_")

    @staticmethod
    def by_dependence(function: FunctionDefinition) -> list[tuple[str, Type]]:
        """Return the parameters with those that are lengths first."""
        return sorted(function.parameters.items(), key=lambda item: item[1].length is not None)

    def zero(self, kind: Type) -> str:
        """Return a zero of a type."""
        return {"float": self.number(0.0), "int": "0", "bool": ".false."}[kind.name]

    def local_groups(self, function: FunctionDefinition) -> dict[str, list[str]]:
        """Return the locals by type, as they are declared."""
        groups: dict[str, list[str]] = {}
        for name in sorted(function.loops):
            groups.setdefault("integer", []).append(name)
        for name, kind in function.locals.items():
            groups.setdefault(self.scalar(kind), []).append(f"{name}{self.bounds(kind)}")
        return groups

    def tail(self, function: FunctionDefinition) -> Lines:
        kind = "subroutine" if self.is_subroutine(function) else "function"
        yield f"  end {kind} {self.function_name(function)}"

    def declared(self, name: str, kind: Type, value: str | None, fixed: bool) -> str:
        return "" if value is None else f"{name} = {value}"

    def made(self, kind: Type) -> str:
        return self.zero(kind) if kind.name not in self.form.records else f"{self.record_name(kind.name)}()"

    def if_head(self, condition: str) -> str:
        return f"if ({condition}) then"

    def while_head(self, condition: str) -> str:
        return f"do while ({condition})"

    def loop(self, name: str, start: str, stop: ast.expr, step: int) -> str:
        return f"do {name} = {start}, {self.last(stop, step)}{'' if step == 1 else ', -1'}"

    def choice(self, condition: str, value: str, otherwise: str) -> tuple[str, int]:
        return f"merge({value}, {otherwise}, {condition})", 10

    def call_statement(self, target: str, call: ast.Call, callee: FunctionDefinition, indent: str) -> Lines:
        given = [self.argument(a) for a in call.args]
        if not self.is_subroutine(callee):
            yield from self.plain(f"{target} = {self.function_name(callee)}({', '.join(given)})", indent)
            return
        if target:  # an argument that is an expression cannot be an alias of the result
            given = [f"({text})" if text == target else text for text in given] + [target]
        given += ["status"] if callee.name in self.failing else []
        yield from self.plain(f"call {self.function_name(callee)}({', '.join(given)})", indent)
        if callee.name in self.failing:
            yield f"{indent}if (status /= {self.prefix}_ok) return"

    def updated(self, target: ast.expr, op: ast.operator, value: ast.expr) -> str:
        sum_up = ast.BinOp(left=target, op=op, right=value)
        return f"{self.expression(target)} = {self.operation(sum_up.left, op, value)[0]}"

    def returned(self, value: str | None) -> Lines:
        if value is not None:
            yield f"result = {value}"
        yield "return"

    def raised(self, error: str, message: str) -> str:
        return f"status = {self.error(error)}; return"

    def field(self, base: ast.expr, name: str) -> str:
        return f"{self.expression(base)}%{name}"

    def entry(self, row: str, index: str) -> str:
        return f"{row}({index})"

    def printed(self, node: ast.expr) -> tuple[str, int]:
        match node:
            case ast.UnaryOp(op=ast.USub(), operand=part):
                return f"-{self.expression(part, 7)}", 6
            case ast.UnaryOp(op=ast.Not(), operand=part):
                return f".not. {self.expression(part, 10)}", 3
        return super().printed(node)

    def compared(self, left: ast.expr, op: ast.cmpop, right: ast.expr) -> tuple[str, int]:
        kind, equal = self.kind(left), isinstance(op, ast.Eq)
        if isinstance(op, ast.Eq | ast.NotEq):
            one, two = self.expression(left, 5), self.expression(right, 5)
            if kind == BOOL:
                return f"{one} {'.eqv.' if equal else '.neqv.'} {two}", 0
            if kind == FLOAT:  # compilers warn of == and /= between reals
                return (
                    (f"{one} <= {two} .and. {one} >= {two}", 2) if equal else (f"{one} < {two} .or. {one} > {two}", 2)
                )
            return f"{one} {'==' if equal else '/='} {two}", 4
        return super().compared(left, op, right)

    def divided(self, left: ast.expr, right: ast.expr, rest: bool) -> tuple[str, int]:
        if rest:
            return f"mod({self.expression(left)}, {self.expression(right)})", 10
        return super().divided(left, right, rest)

    def built_in(self, name: str, arguments: Sequence[ast.expr]) -> tuple[str, int]:
        if name == "pow":
            return f"{self.expression(arguments[0], 10)} ** {self.expression(arguments[1], 10)}", 9  # from the right
        return super().built_in(name, arguments)

    def number(self, value: float) -> str:
        mantissa, _, exponent = self.digits(value).partition("e")
        return f"{mantissa}{'' if '.' in mantissa else '.0'}{f'e{exponent}' if exponent else ''}_dp"

    def to_float(self, node: ast.expr) -> tuple[str, int]:
        return f"real({self.expression(node)}, dp)", 10

    def to_int(self, node: ast.expr) -> tuple[str, int]:
        return f"int({self.expression(node)})", 10
