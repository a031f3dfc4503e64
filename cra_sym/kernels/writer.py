"""Translation of functions of numbers and arrays to LLVM, inlined statement by statement.

The types of all values follow directly from those of the arguments: a value is a double, an integer, a condition or a
contiguous array. Everything is inlined, so that loops over lanes become SIMD code.
"""

from __future__ import annotations

import ast
from collections.abc import Callable, Mapping, Sequence
from functools import reduce
from typing import Any

import numpy as np
from llvmlite import ir

from cra_sym.kernels.arithmetic import CONDITION, INTEGER, is_constant, kind_of
from cra_sym.kernels.generated import CompileError
from cra_sym.kernels.memory import Array, Memory, Variable

__all__ = ["call"]


def call(builder: Any, function: ast.FunctionDef, arguments: Sequence[Any], namespace: Mapping[str, Any]) -> Any:
    """Write the body of a function at the position of the builder.

    Parameters
    ----------
    builder : llvmlite.ir.IRBuilder
    function : ast.FunctionDef
        Made of assignments, ``for`` over ``range``, ``while``, ``if``, ``continue`` and ``return``. Indices count from
        the start of an array and must be within it, and all parts of an expression are evaluated, regardless of its
        conditions. A name keeps its first type. Arrays created in the function are freed when it returns.
    arguments : sequence of number, LLVM value, or Array
    namespace : dict
        Values of other names: constants, NumPy and its functions of numbers, and further functions as ast.FunctionDef;
        those in ``_CALLED`` are written once and called, all others are inlined.

    Returns
    -------
    number, LLVM value, tuple of them, or None
    """
    return _FunctionWriter(builder, function, arguments, namespace).written()


def _refused(node: ast.AST) -> CompileError:
    return CompileError(f"compiled functions hold nothing like: {ast.unparse(node)}")


def _in_double(result: Any) -> Any:
    """Return a result with integer constants, as SymPy prints them, converted to doubles."""
    if isinstance(result, tuple):
        return tuple(map(_in_double, result))
    return float(result) if type(result) is int else result


class _FunctionWriter(Memory):
    """Writer of one call of a function, inlined.

    A name denotes a value. In a function with branches, an assigned name denotes a memory location of its first type,
    which LLVM turns into a register. Arrays and tuples named in a branch or a loop are local to it.
    """

    def __init__(
        self, builder: Any, function: ast.FunctionDef, arguments: Sequence[Any], namespace: Mapping[str, Any]
    ) -> None:
        super().__init__(builder)
        self.statements, self.namespace = function.body, namespace
        self.values: dict[str, Any] = {}
        self.variables: dict[str, Variable] = {}
        self.again: Any = None  # where `continue` leads
        self.end: Any = None  # where `return` leads, if the function branches
        self.depth = 0  # of statements in statements
        self.returned: Any = None  # if the function does not branch
        self.results: list[Variable] | None = None
        self.single = True
        if any(isinstance(node, (ast.For, ast.While, ast.If)) for node in ast.walk(function)):
            self.end = builder.append_basic_block("end")
        stored = self.own = {n.id for n in ast.walk(function) if isinstance(n, ast.Name) and _is_stored(n)}
        for parameter, argument in zip((a.arg for a in function.args.args), arguments, strict=True):
            if parameter in stored:
                self.assign_name(parameter, argument)
            else:
                self.values[parameter] = argument

    def written(self) -> Any:
        """Write all statements and return the result."""
        self.run(self.statements)
        if self.end is None:
            return _in_double(self.returned)
        if not self.builder.block.is_terminated:
            self.give_back(None)
        self.builder.position_at_end(self.end)
        self.free_all()
        results = tuple(map(self.read, self.results or ()))
        return (results[0] if self.single else results) if results else None

    # Statements ---------------------------------------------------------------------------------------------------

    def run(self, statements: Sequence[ast.stmt]) -> None:
        outer = set(self.values)
        self.depth += 1
        for statement in statements:
            if self.builder.block.is_terminated:
                break
            try:
                self.write(statement)
            except CompileError:
                raise
            except (ArithmeticError, AttributeError, LookupError, RecursionError, TypeError, ValueError) as error:
                raise _refused(statement) from error
        self.depth -= 1
        self.values = {name: value for name, value in self.values.items() if name in outer}

    def write(self, statement: ast.stmt) -> None:
        match statement:
            case ast.Assign(targets=targets, value=value):
                result = self.value(value)
                for target in targets:
                    self.assign(target, result)
            case ast.AugAssign(target=target, op=op, value=value):
                self.assign(target, self.binary(op, self.value(target), self.value(value)))
            case ast.Expr(value=ast.Constant(value=str())):
                pass
            case ast.Expr(value=value):
                self.value(value)
            case ast.If(test=test, body=body, orelse=orelse):
                self.branch(test, body, orelse)
            case ast.For(target=ast.Name(id=name), iter=ast.Call(func=ast.Name(id="range"), args=bounds), orelse=[]):
                self.count(name, [self.value(bound) for bound in bounds], statement.body)
            case ast.While(test=test, body=body, orelse=[]):
                self.repeat(test, body)
            case ast.Continue():
                self.builder.branch(self.again)
            case ast.Return(value=value) if self.end is None and statement is self.statements[-1]:
                self.returned = None if value is None else self.value(value)
            case ast.Return(value=value) if self.end is not None:
                self.give_back(None if value is None else self.value(value))
            case _:
                raise _refused(statement)

    def assign(self, target: ast.expr, value: Any) -> None:
        match target:
            case ast.Name(id=name):
                self.assign_name(name, value)
            case ast.Tuple(elts=targets):
                if isinstance(value, Array):
                    value = [self.element(value, (k,)) for k in range(len(targets))]
                for one, part in zip(targets, value, strict=True):
                    self.assign(one, part)
            case ast.Subscript(value=base, slice=index):
                array, indices = self.value(base), self.indices(index)
                if not array.writable:
                    raise CompileError(f"{ast.unparse(base)} is read-only")
                if len(indices) != len(array.shape):
                    raise CompileError(f"{ast.unparse(target)} is not one element")
                self.put(value, Variable(self.pointer(array, indices), array.kind))
            case _:
                raise _refused(target)

    def assign_name(self, name: str, value: Any) -> None:
        before = self.values.pop(name, None)
        several = isinstance(value, (Array, tuple))
        if self.depth > 1 and (isinstance(before, (Array, tuple)) or (several and name in self.variables)):
            raise CompileError(f"{name} is assigned again, and is an array or a tuple")
        if self.end is None or several:
            self.values[name] = value
            return
        if name not in self.variables:
            self.variables[name] = self.variable(kind_of(value), name)
        self.put(value, self.variables[name])

    def branch(self, test: ast.expr, body: Sequence[ast.stmt], orelse: Sequence[ast.stmt]) -> None:
        then, otherwise, after = map(self.builder.append_basic_block, ("then", "else", "after"))
        self.builder.cbranch(self.truth(self.value(test)), then, otherwise)
        ends: list[bool] = []
        for block, statements in ((then, body), (otherwise, orelse)):
            self.builder.position_at_end(block)
            self.run(statements)
            ends.append(self.builder.block.is_terminated)
            if not ends[-1]:
                self.builder.branch(after)
        self.builder.position_at_end(after)
        if all(ends):
            self.builder.unreachable()

    def count(self, name: str, bounds: Sequence[Any], body: Sequence[ast.stmt]) -> None:
        """Write a loop over a range; a simple one of known length is unrolled."""
        start, stop, *steps = bounds if len(bounds) > 1 else (0, *bounds)
        step = steps[0] if steps else 1
        if not is_constant(step) or not step or any(kind_of(bound) != INTEGER for bound in bounds):
            raise CompileError("ranges are of integers, in constant steps")
        if is_constant(start) and is_constant(stop) and _is_plain(name, body):
            for number in range(start, stop, step):
                self.assign_name(name, number)
                self.values[name] = number  # a constant to the body
                self.run(body)
            self.values.pop(name, None)
            return
        head, inside, following, after = map(self.builder.append_basic_block, ("head", "inside", "following", "after"))
        limit, before = self.typed(stop), self.builder.block
        self.builder.branch(head)
        self.builder.position_at_end(head)
        number = self.builder.phi(INTEGER)
        number.add_incoming(self.typed(start), before)
        self.builder.cbranch(self.compared(ast.Lt() if step > 0 else ast.Gt(), number, limit), inside, after)
        self.builder.position_at_end(inside)
        self.assign_name(name, number)
        self.loop(body, following)
        self.builder.position_at_end(following)
        number.add_incoming(self.builder.add(number, self.typed(step), flags=("nsw",)), following)
        self.builder.branch(head)
        self.builder.position_at_end(after)

    def repeat(self, test: ast.expr, body: Sequence[ast.stmt]) -> None:
        head, inside, after = map(self.builder.append_basic_block, ("head", "inside", "after"))
        self.builder.branch(head)
        self.builder.position_at_end(head)
        self.builder.cbranch(self.truth(self.value(test)), inside, after)
        self.builder.position_at_end(inside)
        self.loop(body, head)
        self.builder.position_at_end(after)

    def loop(self, body: Sequence[ast.stmt], again: Any) -> None:
        outer, self.again = self.again, again
        self.run(body)
        if not self.builder.block.is_terminated:
            self.builder.branch(again)
        self.again = outer

    def give_back(self, value: Any) -> None:
        """Store the result in the common location of all returns, and branch to the end."""
        single = not isinstance(value, tuple)
        parts = () if value is None else (value,) if single else value
        if self.results is None:
            self.results = [self.variable(kind_of(part)) for part in parts]
            self.single = single
        if single != self.single or len(parts) != len(self.results):
            raise CompileError("all ways out return as much")
        for part, place in zip(parts, self.results, strict=True):
            self.put(part, place)
        self.builder.branch(self.end)

    # Expressions --------------------------------------------------------------------------------------------------

    def value(self, node: ast.expr) -> Any:
        match node:
            case ast.Constant(value=value) if is_constant(value):
                return value
            case ast.Name(id=name):
                return self.named(name)
            case ast.Attribute(value=ast.Name(id="np"), attr=name):
                return getattr(np, name)
            case ast.Attribute(value=array, attr="shape"):
                return self.value(array).shape
            case ast.Attribute(value=array, attr="size"):
                return self.product(self.value(array).shape)
            case ast.Tuple(elts=parts):
                return tuple(self.value(part) for part in parts)
            case ast.Subscript(value=base, slice=index):
                whole, where = self.value(base), self.indices(index)
                return whole[where[0]] if isinstance(whole, tuple) else self.element(whole, where)
            case ast.UnaryOp(op=ast.USub(), operand=part):
                return self.negative(self.value(part))
            case ast.UnaryOp(op=ast.Not(), operand=part):
                return self.builder.not_(self.truth(self.value(part)))
            case ast.BinOp(left=left, op=op, right=right):
                return self.binary(op, self.value(left), self.value(right))
            case ast.Compare(left=left, ops=ops, comparators=others):
                parts = [self.value(part) for part in (left, *others)]
                triples = zip(ops, parts, parts[1:], strict=False)
                return reduce(self.builder.and_, [self.compared(*triple) for triple in triples])
            case ast.BoolOp(op=op, values=parts):
                join = self.builder.and_ if isinstance(op, ast.And) else self.builder.or_
                conditions = [self.value(part) for part in parts]
                if any(kind_of(part) != CONDITION for part in conditions):  # Python returns one of the operands
                    raise _refused(node)
                return reduce(join, map(self.typed, conditions))
            case ast.IfExp(test=test, body=body, orelse=orelse):
                return self.chosen(self.value(test), self.value(body), self.value(orelse))
            case ast.Call(func=ast.Attribute(value=bits, attr="view"), args=[kind]):
                return self.viewed(self.value(bits), self.value(kind))
            case ast.Call(func=function, args=arguments, keywords=[]):
                return self.called(self.value(function), [self.value(argument) for argument in arguments])
        raise _refused(node)

    def named(self, name: str) -> Any:
        if name in self.values:
            return self.values[name]
        if name in self.variables:
            return self.read(self.variables[name])
        if name in self.own:
            raise CompileError(f"{name} has no value yet")
        return self.namespace[name] if name in self.namespace else _BUILT_IN[name]

    def called(self, function: Any, arguments: Sequence[Any]) -> Any:
        if isinstance(function, ast.FunctionDef):
            if function.name in self.namespace.get("_CALLED", ()):
                return self.called_apart(function, arguments)
            return call(self.builder, function, arguments, self.namespace)
        if function in (np.float64, np.int64):
            return self.cast(function, *arguments)
        if function in (np.empty, np.zeros):
            return self.made(function is np.zeros, *arguments)
        if function in _BUILT_IN.values():
            return function(self, *arguments)
        return self.function(function, arguments)

    def called_apart(self, function: ast.FunctionDef, arguments: Sequence[Any]) -> None:
        """Call a function that is compiled once for each combination of argument types, not inlined.

        It returns nothing, and its array arguments do not overlap. Numbers and lengths are passed.
        """
        numbers, types = [], []
        for argument in arguments:
            parts = (argument.data, *argument.shape) if isinstance(argument, Array) else (argument,)
            numbers.append([part if isinstance(part, ir.Value) else self.typed(part) for part in parts])
            own = (argument.kind, argument.writable) if isinstance(argument, Array) else None
            types.append((own, *(number.type for number in numbers[-1])))
        module = self.builder.module
        name = f"{function.name} {types}"
        if name not in module.globals:
            made = ir.Function(module, ir.FunctionType(ir.VoidType(), [k for own in types for k in own[1:]]), name)
            made.linkage = "internal"
            made.attributes.add("noinline")
            given, parameters = iter(made.args), []
            for own, *kinds in types:
                first, *rest = (next(given) for _ in kinds)
                if own is None:
                    parameters.append(first)
                    continue
                first.add_attribute("noalias")
                parameters.append(Array(first, own[0], tuple(rest), own[1]))
            builder = ir.IRBuilder(made.append_basic_block())
            if call(builder, function, parameters, self.namespace) is not None:
                raise CompileError(f"{function.name} is called, and must return nothing")
            builder.ret_void()
        self.builder.call(module.globals[name], [number for own in numbers for number in own])

    def indices(self, node: ast.expr) -> tuple[Any, ...]:
        index = self.value(node)
        return index if isinstance(index, tuple) else (index,)

    def made(self, zeros: bool, shape: Any, kind: type = np.float64) -> Array:
        """Return a new array of doubles or integers."""
        if self.end is None or self.again is not None:
            raise CompileError("arrays are made outside of loops, in functions that hold one")
        return self.allocated(zeros, shape, kind)


def _is_stored(name: ast.Name) -> bool:
    return isinstance(name.ctx, ast.Store)


def _is_plain(name: str, body: Sequence[ast.stmt]) -> bool:
    """Return whether statements have no loop or exit and do not assign a name."""
    others = ast.For, ast.While, ast.Continue, ast.Return
    nodes = [node for statement in body for node in ast.walk(statement)]
    own = any(isinstance(node, ast.Name) and node.id == name and _is_stored(node) for node in nodes)
    return not own and not any(isinstance(node, others) for node in nodes)


def _extreme(op: ast.cmpop) -> Callable[..., Any]:
    def extreme(body: Any, first: Any, second: Any, *others: Any) -> Any:
        return reduce(lambda one, two: body.chosen(body.compared(op, two, one), two, one), (second, *others), first)

    return extreme


_BUILT_IN: dict[str, Callable[..., Any]] = {
    "abs": lambda body, value: body.intrinsic("fabs", value),
    "len": lambda body, array: array.shape[0],
    "max": _extreme(ast.Gt()),
    "min": _extreme(ast.Lt()),
}
