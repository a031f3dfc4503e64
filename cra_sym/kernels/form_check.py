"""Check of a function against the restricted form, and inference of all types in it."""

from __future__ import annotations

import ast
from collections.abc import Mapping, Sequence

from cra_sym.kernels.form import (
    BOOL,
    FLOAT,
    INT,
    SCALARS,
    Constant,
    FunctionDefinition,
    Record,
    Type,
    error_name,
    refused,
)  # fmt: skip

__all__ = ["Checker", "literal", "type_of"]

_REAL = {
    name: 1
    for name in (
        "sqrt exp expm1 log log1p sin cos tan asin acos atan sinh cosh tanh asinh acosh atanh floor ceil abs".split()
    )
} | {"atan2": 2, "pow": 2, "min": 2, "max": 2}
_BUILT_IN = {name: ([FLOAT] * count, FLOAT) for name, count in _REAL.items()} | {
    "isfinite": ([FLOAT], BOOL),
    "float": ([INT], FLOAT),
    "int": ([FLOAT], INT),
}


def literal(node: ast.expr) -> float | int | None:
    """Return a literal number, or None."""
    match node:
        case ast.Constant(value=bool()):
            return None
        case ast.Constant(value=(int() | float()) as value):
            return value
        case ast.UnaryOp(op=ast.USub(), operand=ast.Constant(value=(int() | float()) as value)):
            return -value
    return None


def type_of(node: ast.expr, records: Mapping[str, Record], lengths: Mapping[str, object]) -> Type:
    """Return the type of an annotation; ``lengths`` are the names allowed as the length of a row."""
    match node:
        case ast.Name(id=name) if name in SCALARS or name in records:
            return Type(name)
        case ast.Subscript(value=ast.Name(id="Row"), slice=ast.Tuple(elts=[ast.Name(id=name), length])):
            if name not in SCALARS and name not in records:
                raise refused(node, f"{name} is not a type")
            match length:
                case ast.Constant(value=int() as size):
                    return Type(name, size)
                case ast.Name(id=size_name) if size_name in lengths:
                    return Type(name, size_name)
        case ast.Subscript(value=ast.Name(id=("Out" | "Mut") as access), slice=inner):
            inside = type_of(inner, records, lengths)
            return Type(inside.name, inside.length, access.lower())
    raise refused(node, "no type of the restricted form")


class Checker:
    """Type inference for a function, with errors that name the line."""

    def __init__(
        self,
        node: ast.FunctionDef,
        constants: Mapping[str, Constant],
        records: Mapping[str, Record],
        functions: Mapping[str, FunctionDefinition],
    ) -> None:
        self.constants, self.records, self.functions = constants, records, functions
        arguments = node.args
        if arguments.vararg or arguments.kwarg or arguments.kwonlyargs or arguments.defaults or arguments.posonlyargs:
            raise refused(node, "parameters are plain")
        parameters: dict[str, Type] = {}
        for argument in arguments.args:
            if argument.annotation is None:
                raise refused(node, f"{argument.arg} has no type")
            integers = {name for name, kind in parameters.items() if kind == INT}
            known = {**{name: 0 for name in integers}, **constants}
            parameters[argument.arg] = type_of(argument.annotation, records, known)
        result: Type | None = None
        match node.returns:
            case None | ast.Constant(value=None):
                pass
            case ast.expr() as annotation:
                kind = type_of(annotation, records, constants)
                if not kind.scalar:
                    raise refused(node, "a result is a number or a condition; rows and records are Out")
                result = kind
        self.function = FunctionDefinition(node.name, ast.get_docstring(node) or "", parameters, result, node)
        self.paths: dict[str, list[tuple[int, ...]]] = {}
        self.loops: list[str] = []
        self.block(self.function.body, ())
        self.place_declarations()
        if result is not None and not _ends(self.function.body):
            raise refused(node, "not every way out returns a value")
        lower = [name.lower() for name in (*parameters, *self.function.locals, *self.function.loops)]
        top = {name.lower().strip("_") for name in (*functions, *constants)}
        clashes = {one for one in lower if lower.count(one) > 1} | set(lower) & top
        if clashes:
            raise refused(node, f"names must differ by more than case: {', '.join(sorted(clashes))}")

    # Statements ---------------------------------------------------------------------------------------------------

    def block(self, statements: Sequence[ast.stmt], path: tuple[int, ...]) -> None:
        for statement in statements:
            self.statement(statement, (*path, id(statement)))

    def statement(self, node: ast.stmt, path: tuple[int, ...]) -> None:
        self.path = path
        match node:
            case ast.Assign(targets=[target], value=value):
                self.assign(node, target, self.right_side(value))
            case ast.AugAssign(target=target, op=op, value=value):
                kind = self.value(value)
                old = self.value(target)
                if not (old == kind and kind in (FLOAT, INT)) or isinstance(op, ast.FloorDiv | ast.Mod):
                    raise refused(node, "both sides are numbers of one kind")
                self.operator(node, op, kind)
                self.assign(node, target, kind)
            case ast.For(target=ast.Name(id=name), iter=ast.Call(func=ast.Name(id="range"), args=args)):
                step = literal(args[2]) if len(args) == 3 else 1
                if step not in (1, -1) or any(self.value(a) != INT for a in args[:2]) or node.orelse:
                    raise refused(node, "loops go over range, up or down by 1")
                self.start_loop(node, name)
                self.inside(node.body, path, name)
                if any(isinstance(n, ast.Name) and n.id == name and _stored(n) for s in node.body for n in ast.walk(s)):
                    raise refused(node, f"{name} is the loop's")
            case ast.While(test=test, body=body, orelse=[]):
                self.condition(test)
                self.inside(body, path)
            case ast.If(test=test, body=body, orelse=orelse):
                self.condition(test)
                self.block(body, (*path, 0))
                self.block(orelse, (*path, 1))
            case ast.Break() | ast.Continue() if self.loops:
                pass
            case ast.Return(value=value):
                if (None if value is None else self.value(value)) != self.function.result:
                    raise refused(node, "not what the function returns")
            case ast.Raise():
                self.function.raises.add(error_name(node))
            case ast.Expr(value=ast.Call() as call):
                if self.called(call, alone=True) is not None:
                    raise refused(node, "its result is lost")
            case _:
                raise refused(node)

    def inside(self, body: Sequence[ast.stmt], path: tuple[int, ...], variable: str = "") -> None:
        self.loops.append(variable)
        self.block(body, (*path, 0))
        self.loops.pop()

    def start_loop(self, node: ast.stmt, name: str) -> None:
        function = self.function
        if name in function.parameters or name in function.locals or name in self.constants or name in self.loops:
            raise refused(node, f"{name} is something else already")
        function.loops.add(name)

    def right_side(self, value: ast.expr) -> Type:
        match value:
            case ast.Call(func=ast.Name(id="zeros"), args=[length]):
                return Type("float", self.length(length))
            case ast.Call(func=ast.Name(id="records"), args=[ast.Name(id=name), length]) if name in self.records:
                return Type(name, self.length(length))
            case ast.Call(func=ast.Name(id=name), args=[]) if name in self.records:
                return Type(name)
            case ast.Call():
                kind = self.called(value, alone=True)
                if kind is None:
                    raise refused(value, "it returns nothing")
                self.function.types[id(value)] = kind
                return kind
        return self.value(value)

    def length(self, node: ast.expr) -> int | str:
        match node:
            case ast.Constant(value=int() as size):
                return size
            case ast.Name(id=name) if name in self.constants:
                return name
        raise refused(node, "the length of a local row is a constant")

    def assign(self, node: ast.stmt, target: ast.expr, kind: Type) -> None:
        if not isinstance(target, ast.Name):
            if self.value(target) != kind:
                raise refused(node, "the types differ")
            self.check_writable(target)
            return
        name = target.id
        if name in self.function.parameters or name in self.constants or name in self.function.loops:
            raise refused(node, f"{name} is given and stays as it is")
        known = self.function.locals.setdefault(name, kind)
        if known != kind or (not kind.scalar and name in self.function.writes):
            raise refused(node, f"{name} keeps its type; rows and records are made once")
        self.function.writes[name] = self.function.writes.get(name, 0) + 1
        self.paths.setdefault(name, []).append(self.path)

    def check_writable(self, node: ast.expr) -> None:
        root = _root(node)
        if root in self.constants or (root in self.function.parameters and not self.function.parameters[root].changed):
            raise refused(node, f"{root} is read only")

    def place_declarations(self) -> None:
        for name, paths in self.paths.items():
            depth = 0
            while len({p[: depth + 1] for p in paths}) == 1 and len(paths[0]) > depth:
                depth += 1
            common = paths[0][:depth]
            if (
                common and common[-1] in (0, 1)
            ) or not common:  # a block: before its first statement that uses the name
                common = paths[0][: depth + 1]
            self.function.homes[name] = common[-1]

    # Expressions --------------------------------------------------------------------------------------------------

    def condition(self, node: ast.expr) -> None:
        if self.value(node) != BOOL:
            raise refused(node, "must be a condition")

    def value(self, node: ast.expr) -> Type:
        kind = self.kind(node)
        self.function.types[id(node)] = kind
        return kind

    def kind(self, node: ast.expr) -> Type:
        match node:
            case ast.Constant(value=bool()):
                return BOOL
            case ast.Constant(value=int() as number) if abs(number) < 2**31:
                return INT
            case ast.Constant(value=float()):
                return FLOAT
            case ast.Name(id=name):
                return self.named(node, name)
            case ast.Attribute(value=base, attr=name):
                record = self.value(base)
                if record.length is None and record.name in self.records and name in self.records[record.name].fields:
                    return self.records[record.name].fields[name]
            case ast.Subscript(value=base, slice=index):
                row = self.value(base)
                if row.length is not None and self.value(index) == INT:
                    return row.element
            case ast.UnaryOp(op=ast.USub(), operand=part) if (kind := self.value(part)) in (FLOAT, INT):
                return kind
            case ast.UnaryOp(op=ast.Not(), operand=part) if self.value(part) == BOOL:
                return BOOL
            case ast.BinOp(left=left, op=op, right=right):
                kind = self.value(left)
                if kind == self.value(right) and kind in (FLOAT, INT):
                    self.operator(node, op, kind)
                    return kind
            case ast.Compare(left=left, ops=[op], comparators=[right]):
                kind = self.value(left)
                equal = isinstance(op, ast.Eq | ast.NotEq)
                ordered = isinstance(op, ast.Lt | ast.LtE | ast.Gt | ast.GtE)
                if kind == self.value(right) and kind.scalar and (equal or (ordered and kind != BOOL)):
                    return BOOL
            case ast.BoolOp(values=parts) if all(self.value(part) == BOOL for part in parts):
                return BOOL
            case ast.IfExp(test=test, body=body, orelse=orelse):
                self.condition(test)
                kind = self.value(body)
                if kind == self.value(orelse) and kind.scalar:
                    return kind
            case ast.Call():
                result = self.called(node, alone=False)
                if result is not None:
                    return result
        raise refused(node, "not in the restricted form, or of types that do not fit")

    def operator(self, node: ast.AST, op: ast.operator, kind: Type) -> None:
        allowed = (ast.Add, ast.Sub, ast.Mult, ast.Div if kind == FLOAT else ast.FloorDiv | ast.Mod)
        if not any(isinstance(op, one) for one in allowed):
            raise refused(node, "floats have + - * /, integers + - * // %")

    def named(self, node: ast.expr, name: str) -> Type:
        if name in self.function.parameters:
            return self.function.parameters[name]
        if name in self.loops:
            return INT
        if name in self.function.locals:
            self.paths[name].append(self.path)
            return self.function.locals[name]
        if name in self.constants:
            return self.constants[name].type
        raise refused(node, f"{name} has no value yet")

    def called(self, node: ast.Call, *, alone: bool) -> Type | None:
        if not isinstance(node.func, ast.Name) or node.keywords:
            raise refused(node)
        name = node.func.id
        kinds = [self.value(argument) for argument in node.args]
        if name in _BUILT_IN and name not in self.functions:
            expected, result = _BUILT_IN[name]
            self.function.uses.add(name)
            if kinds == [INT] * len(expected) and name in ("abs", "min", "max"):
                return INT
            if kinds != expected:
                raise refused(node, f"takes {', '.join(kind.name for kind in expected)}")
            return result
        if name not in self.functions:
            raise refused(node, f"{name} is not defined above")
        callee = self.functions[name]
        self.check_arguments(node, callee, kinds)
        self.function.calls.add(name)
        if not alone and (callee.changed or name in failing(self.functions)):
            raise refused(node, "it changes an argument or may fail: call it in a statement of its own")
        return callee.result

    def check_arguments(self, node: ast.Call, callee: FunctionDefinition, kinds: Sequence[Type]) -> None:
        wanted = list(callee.parameters.values())
        if len(kinds) != len(wanted) or not all(a.same(b) for a, b in zip(kinds, wanted, strict=True)):
            raise refused(node, f"the arguments are not those of {callee.name}")
        texts = [ast.unparse(argument) for argument in node.args]
        for text, argument, kind in zip(texts, node.args, wanted, strict=True):
            if kind.changed:
                self.check_writable(argument)
                if sum(_overlap(text, other) for other in texts) > 1:
                    raise refused(node, f"{text} is changed and given twice")


def failing(functions: Mapping[str, FunctionDefinition]) -> set[str]:
    """Return the functions that raise, or call one that does."""
    found: set[str] = set()
    for name, function in functions.items():
        if function.raises or function.calls & found:
            found.add(name)
    return found


def _overlap(one: str, other: str) -> bool:
    return one == other or other.startswith((f"{one}.", f"{one}[")) or one.startswith((f"{other}.", f"{other}["))


def _ends(body: Sequence[ast.stmt]) -> bool:
    match body[-1] if body else None:
        case ast.Return() | ast.Raise():
            return True
        case ast.If(body=first, orelse=second):
            return _ends(first) and _ends(second)
    return False


def _stored(node: ast.Name) -> bool:
    return isinstance(node.ctx, ast.Store)


def _root(node: ast.expr) -> str:
    while isinstance(node, ast.Attribute | ast.Subscript):
        node = node.value
    if not isinstance(node, ast.Name):
        raise refused(node, "no variable")
    return node.id
