"""The text of loops over lanes as C99: the source of the compiled kernels, printed as exported code for batches.

The text has the form of :func:`cra_sym.kernels.writer.call`: functions of numbers and arrays without annotations. Types
follow from the arguments of the first call: a value is a double, a 64-bit integer, a condition or an array of these.
Loops of known length are unrolled, since compilers vectorise innermost loops only. Arrays of unknown length have the
largest possible size, so that nothing is allocated.
"""

from __future__ import annotations

import ast
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from cra_sym.codegen.lanes_expressions import (
    ATOM,
    DOUBLE,
    HELPERS,
    INTEGER,
    Kind,
    LaneExpressions,
    Rows,
    Value,
    local,
    named,
    root_in,
)
from cra_sym.codegen.printing import folded
from cra_sym.kernels.form_parse import comments_of

__all__ = ["LanesPrinter", "Rows"]


class LanesPrinter:
    """Printer of an entry of a text with all functions that it calls.

    Parameters
    ----------
    text : str
        Of a module.
    values : mapping
        Values of its constants, by name.
    known : mapping of str to str
        Constants that already have a name in C.
    most : mapping of str to str
        Largest value of a length, by the name of its variable.
    summaries : mapping of str to str
        Summaries of functions without a docstring.
    """

    def __init__(
        self,
        text: str,
        values: Mapping[str, Any],
        known: Mapping[str, str],
        most: Mapping[str, str],
        summaries: Mapping[str, str],
    ) -> None:
        self.tree = {node.name: node for node in ast.parse(text).body if isinstance(node, ast.FunctionDef)}
        self.values, self.known, self.most, self.summaries = values, known, most, summaries
        self.comments, _ = comments_of(text)
        self.results: dict[str, Kind | tuple[str, ...] | None] = {}
        self.constants: dict[str, str] = {}
        self.helpers: set[str] = set()
        self.made: list[str] = []

    def entry(self, name: str, kinds: Sequence[Kind | None]) -> str:
        """Return the entry with constants and functions that it needs; arguments without a kind are left out."""
        self.call(name, kinds)
        helpers = [text for helper, text in HELPERS.items() if helper in self.helpers]
        return "\n\n".join(["\n".join(self.constants.values()), *helpers, *self.made])

    def call(self, name: str, kinds: Sequence[Kind | None]) -> Kind | tuple[str, ...] | None:
        """Print a function if it is new; return the type of its result."""
        if name not in self.results:
            writer = _LanesFunction(self, self.tree[name], kinds)
            text = writer.text()
            self.results[name] = writer.result
            self.made.append(text)
        return self.results[name]

    def lengths_of(self, name: str) -> list[tuple[str, int]]:
        """Return the lengths of its arguments that a function needs; they are passed as further arguments."""
        found = {
            (node.value.value.id, int(str(node.slice.value)))
            for node in ast.walk(self.tree[name])
            if isinstance(node, ast.Subscript)
            and isinstance(node.value, ast.Attribute)
            and isinstance(node.value.value, ast.Name)
            and isinstance(node.slice, ast.Constant)
            and node.value.attr == "shape"
        }
        return sorted(found)

    def constant(self, name: str) -> Value:
        """Return a constant of the text, and print it if it is new."""
        value = self.values[name]
        if name in self.known:
            return Value(self.known[name], ATOM, INTEGER)
        word = name.strip("_")
        if isinstance(value, float):
            self.constants[name] = f"static const double {word} = {value!r};"
            return Value(word, ATOM, DOUBLE)
        if abs(value) < 2**31:
            return Value(str(value), ATOM, INTEGER, value)
        self.constants[name] = f"static const int64_t {word} = {value};"
        return Value(word, ATOM, INTEGER)


class _LanesFunction(LaneExpressions):
    """One function."""

    def __init__(self, printer: LanesPrinter, node: ast.FunctionDef, kinds: Sequence[Kind | None]) -> None:
        self.printer, self.node = printer, node
        self.names: dict[str, Kind] = {}
        self.left_out = {a.arg for a, kind in zip(node.args.args, kinds, strict=True) if kind is None}
        self.parameters = {a.arg: k for a, k in zip(node.args.args, kinds, strict=True) if k is not None}
        for name, kind in self.parameters.items():
            lengths = [f"{name}_{i}" for i in range(2)]
            if isinstance(kind, Rows) and not kind.fixed:
                kind = Rows(kind.kind, tuple(lengths[: len(kind.lengths)]))
            self.names[name] = self.parameters[name] = kind
        self.fixed: dict[str, int] = {}
        self.pending: set[str] = set()  # names assigned in a branch and read after it
        self.rest: Sequence[ast.stmt] = ()  # names of the current block
        self.result: Kind | tuple[str, ...] | None = None
        self.temporary: dict[str, int] = {}  # number of rows created for the results of each function

    def text(self) -> str:
        """Return the whole function."""
        body = list(self.block(self.node.body, "    "))
        if body and body[-1] == "    return;":
            body.pop()
        name = self.node.name
        head = [k.parameter(n) if isinstance(k, Rows) else f"{k} {n}" for n, k in self.parameters.items()]
        head += [f"int64_t {n}_{i}" for n, i in self.printer.lengths_of(name) if n in self.parameters]
        kind = "void"
        if isinstance(self.result, Rows):
            head.append(f"double found[restrict {self.result.lengths[0]}]")
        elif isinstance(self.result, tuple):
            head += [f"{k} *restrict found_{i}" for i, k in enumerate(self.result)]
        elif self.result is not None:
            kind = self.result
        doc = ast.get_docstring(self.node) or self.printer.summaries.get(name, "")
        comments = [f"// {line}".rstrip() for line in doc.splitlines()]
        whole = ", ".join(part.replace(" ", "\0") for part in head)  # no parameter is broken
        signature = folded(f"static inline {kind} {named(name)}({whole})", 110, "")
        return "\n".join([*comments, *signature, "{", *body, "}"])

    # Statements ---------------------------------------------------------------------------------------------------

    def block(self, statements: Sequence[ast.stmt], indent: str) -> Iterator[str]:
        outer, rest = set(self.names), self.rest
        for number, statement in enumerate(statements):
            later = statements[number + 1 :]
            needed = _flowing(statement, later) - set(self.names)
            self.rest = statements[number:]
            self.pending |= needed
            lines = list(self.statement(statement, indent))
            self.pending -= needed
            yield from (f"{indent}{self.names[name]} {name};" for name in sorted(needed))
            comment = self.printer.comments.get(statement.lineno, "")
            if comment and lines:
                yield f"{indent}// {comment}"
            yield from lines
        self.rest = rest
        self.names = {name: kind for name, kind in self.names.items() if name in outer | self.pending}

    def statement(self, node: ast.stmt, indent: str) -> Iterator[str]:
        match node:
            case ast.Expr(value=ast.Constant()):
                pass
            case ast.Expr(value=ast.Call() as call):
                yield from self.line(self.value(call).text, indent)
            case ast.Assign(targets=targets, value=value):
                for target in reversed(targets):
                    yield from self.assign(target, value, indent)
            case ast.AugAssign(target=target, op=op, value=value):
                if not root_in(target, self.left_out):
                    sum_up = ast.BinOp(left=target, op=op, right=value)
                    yield from self.assign(target, sum_up, indent)
            case ast.For(target=ast.Name(id=name), iter=ast.Call(args=args)):
                yield from self.loop(name, [self.value(a) for a in args], node.body, indent)
            case ast.While(test=test):
                yield f"{indent}while ({self.value(test).text}) {{"
                yield from self.block(node.body, indent + "    ")
                yield f"{indent}}}"
            case ast.If(test=test):
                yield f"{indent}if ({self.value(test).text}) {{"
                yield from self.block(node.body, indent + "    ")
                if node.orelse:
                    yield f"{indent}}} else {{"
                    yield from self.block(node.orelse, indent + "    ")
                yield f"{indent}}}"
            case ast.Continue():
                yield f"{indent}continue;"
            case ast.Return(value=value):
                yield from self.returned(value, indent)
            case _:
                raise ValueError(f"loops over lanes hold nothing like: {ast.unparse(node)}")

    def line(self, text: str, indent: str) -> Iterator[str]:
        yield from folded(f"{text};", 110, indent)

    def loop(self, name: str, bounds: list[Value], body: Sequence[ast.stmt], indent: str) -> Iterator[str]:
        start, stop = (bounds[0], bounds[1]) if len(bounds) > 1 else (Value("0", ATOM, INTEGER, 0), bounds[0])
        step = bounds[2].number if len(bounds) > 2 else 1
        if start.number is not None and stop.number is not None and _is_plain(body):
            for number in range(int(start.number), int(stop.number), int(step or 1)):
                self.fixed[name] = number
                yield from self.block(body, indent)
            self.fixed.pop(name, None)
            return
        self.names[name] = INTEGER
        change = {1: f"{name}++", -1: f"{name}--"}.get(int(step or 0), f"{name} += {bounds[-1].text}")
        sign = "<" if step is None or step > 0 else ">"
        yield f"{indent}for (int64_t {name} = {start.text}; {name} {sign} {stop.text}; {change}) {{"
        yield from self.block(body, indent + "    ")
        yield f"{indent}}}"

    def assign(self, target: ast.expr, value: ast.expr, indent: str) -> Iterator[str]:
        match target, value:
            case ast.Tuple(elts=targets), ast.Tuple(elts=parts):
                for one, part in zip(targets, parts, strict=True):
                    yield from self.assign(one, part, indent)
                _check_order(targets, parts)
            case ast.Name(id=name), ast.Tuple(elts=parts):
                found = [self.value(part) for part in parts]
                self.names[name] = Rows(DOUBLE, (str(len(found)),))
                listed = ", ".join(self.typed(part, DOUBLE).text for part in found)
                yield from self.line(f"const double {name}[{len(found)}] = {{ {listed} }}", indent)
            case ast.Name(id=name), ast.Call(func=ast.Attribute(attr=("empty" | "zeros") as kind), args=args):
                yield from self.array(name, args, kind == "zeros", indent)
            case ast.Name(id=name), ast.Call(func=ast.Name(id=callee)) if callee in self.printer.tree:
                result = self.called(callee, value)
                if not isinstance(result.kind, Rows):
                    yield from self.put(target, result, indent)
                    return
                self.names[name] = result.kind
                yield f"{indent}double {name}[{result.kind.lengths[0]}];"
                yield from self.line(result.text.replace("@", name), indent)
            case ast.Tuple(elts=targets), ast.Call(func=ast.Name(id=callee)):
                yield from self.unpacked(targets, callee, value, indent)
            case ast.Tuple(elts=targets), _:
                row = self.value(value)
                for i, one in enumerate(targets):
                    yield from self.put(one, Value(f"{row.text}[{i}]", ATOM, DOUBLE), indent)
            case _:
                yield from self.put(target, self.value(value), indent)

    def unpacked(self, targets: Sequence[ast.expr], callee: str, call: ast.Call, indent: str) -> Iterator[str]:
        """Yield a call with several results, and the assignments of these."""
        result = self.called(callee, call)
        if isinstance(result.kind, Rows):
            count = self.temporary[callee] = self.temporary.get(callee, 0) + 1
            row = f"of_{callee.strip('_')}{'' if count == 1 else f'_{count}'}"
            yield f"{indent}double {row}[{result.kind.lengths[0]}];"
            yield from self.line(result.text.replace("@", row), indent)
            for i, one in enumerate(targets):
                yield from self.put(one, Value(f"{row}[{i}]", ATOM, DOUBLE), indent)
            return
        kinds = self.printer.results[callee]
        assert isinstance(kinds, tuple)
        for one, kind in zip(targets, kinds, strict=True):
            assert isinstance(one, ast.Name)
            self.names[one.id] = kind
            yield f"{indent}{kind} {local(one.id)};"
        given = ", ".join(f"&{local(one.id)}" for one in targets if isinstance(one, ast.Name))
        yield from self.line(result.text.replace("@", given), indent)

    def array(self, name: str, args: Sequence[ast.expr], zeros: bool, indent: str) -> Iterator[str]:
        lengths = args[0].elts if isinstance(args[0], ast.Tuple) else [args[0]]
        kind = INTEGER if len(args) > 1 else DOUBLE
        shape = tuple(self.value(length).text for length in lengths)
        self.names[name] = Rows(kind, shape)
        room = "".join(f"[{self.printer.most.get(length, length)}]" for length in shape)
        start = (" = { 0 }" if len(shape) == 1 else " = { { 0.0 } }") if zeros else ""
        yield f"{indent}{kind} {name}{room}{start};"

    def put(self, target: ast.expr, value: Value, indent: str) -> Iterator[str]:
        match target:
            case ast.Name(id=name) if name in self.names:
                kind = self.names[name]
                yield from self.line(f"{local(name)} = {self.typed(value, kind).text}", indent)
            case ast.Name(id=name):
                assert isinstance(value.kind, str)
                self.names[name] = value.kind
                if name in self.pending:
                    yield from self.line(f"{name} = {value.text}", indent)
                    return
                stores = [way for statement in self.rest for way in _uses(statement, name) if way == "store"]
                const = "const " if len(stores) == 1 else ""
                yield from self.line(f"{const}{value.kind} {local(name)} = {value.text}", indent)
            case _:
                place = self.value(target)
                yield from self.line(f"{place.text} = {self.typed(value, place.kind).text}", indent)

    def returned(self, value: ast.expr | None, indent: str) -> Iterator[str]:
        match value:
            case ast.Tuple(elts=parts):
                found = [self.value(part) for part in parts]
                kinds = [DOUBLE if p.number is not None else p.kind for p in found]
                if all(kind == DOUBLE for kind in kinds):
                    self.result = Rows(DOUBLE, (str(len(found)),))
                    for i, part in enumerate(found):
                        yield from self.line(f"found[{i}] = {self.typed(part, DOUBLE).text}", indent)
                else:
                    self.result = tuple(str(kind) for kind in kinds)
                    for i, part in enumerate(found):
                        yield from self.line(f"*found_{i} = {part.text}", indent)
                yield f"{indent}return;"
            case ast.expr():
                one = self.value(value)
                self.result = self.result or one.kind
                yield from self.line(f"return {self.typed(one, self.result).text}", indent)


def _check_order(targets: Sequence[ast.expr], parts: Sequence[ast.expr]) -> None:
    """Raise an error for a multiple assignment in which a later value depends on an earlier target."""
    for i, target in enumerate(targets):
        for later in parts[i + 1 :]:
            if any(ast.unparse(node) == ast.unparse(target) for node in ast.walk(later) if isinstance(node, ast.expr)):
                raise ValueError(f"{ast.unparse(target)} is changed before it is read")


def _is_plain(body: Sequence[ast.stmt]) -> bool:
    """Return whether statements have no loop and no exit."""
    others = ast.For, ast.While, ast.Continue, ast.Return
    return not any(isinstance(node, others) for statement in body for node in ast.walk(statement))


def _flowing(statement: ast.stmt, later: Sequence[ast.stmt]) -> set[str]:
    """Return the names assigned in a compound statement and read by later ones."""
    if not isinstance(statement, (ast.If, ast.For, ast.While)):
        return set()
    stored = {n.id for n in ast.walk(statement) if isinstance(n, ast.Name) and isinstance(n.ctx, ast.Store)}
    return {n for n in stored if next((way for s in later for way in _uses(s, n)), "") == "load"}


def _uses(node: ast.AST, name: str) -> Iterator[str]:
    """Yield the uses of a name in a statement, in the order of evaluation."""
    match node:
        case ast.Assign(targets=targets, value=value):
            parts: list[ast.AST] = [value, *targets]
        case ast.AugAssign(target=target, value=value):
            yield from ["load"] * (isinstance(target, ast.Name) and target.id == name)
            parts = [value, target]
        case ast.For(target=target, iter=over):
            parts = [over, target, *node.body]
        case ast.Name(id=found):
            yield from ["store" if isinstance(node.ctx, ast.Store) else "load"] * (found == name)
            return
        case _:
            parts = list(ast.iter_child_nodes(node))
    for part in parts:
        yield from _uses(part, name)
