"""Jet variables: each derivative of an unknown, in the interval or at an end, is one symbol while a variation is taken.

Coefficients then differentiate as plain expressions, and the total derivatives D_x and D_t are one chain rule.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from functools import lru_cache
from itertools import islice
from typing import Any, Literal, NamedTuple

from sympy import (
    Abs,
    Add,
    Basic,
    DiracDelta,
    Dummy,
    Expr,
    Heaviside,
    Integral,
    Lambda,
    Limit,
    Max,
    Min,
    Piecewise,
    S,
    Subs,
    Sum,
    Symbol,
    arg,
    ceiling,
    conjugate,
    floor,
    im,
    preorder_traversal,
    re,
    sign,
    sympify,
)
from sympy.core.function import AppliedUndef, Derivative, UndefinedFunction
from sympy.matrices.expressions import MatrixExpr

from cra_sym.checks import shown
from cra_sym.mechanics.grouping import grouped

__all__ = ["END_NAMES", "End", "HamiltonError", "Jet", "JetSpace", "listed", "scalar"]

End = Literal["left", "right"]
Where = End | Literal["domain", "ends"] | int
"""Where an expression stands: an end, either end, the interval, or the number of an interior place."""
END_NAMES: tuple[End, End] = ("left", "right")
_SINGULAR = (DiracDelta,)
_LONG = 12  # parts of a Piecewise beyond which it is differentiated part by part
_NOT_SMOOTH = (Abs, sign, Max, Min, Piecewise, Heaviside, floor, ceiling, re, im, arg, conjugate)
_NOT_LOCAL = (Integral, Sum)
_NO_SCALAR = (Lambda, Limit, MatrixExpr)
_MOST_LISTED = 1000


class HamiltonError(ValueError):
    """A Lagrangian that cannot be treated; the message names the term and the reason."""


def listed(name: str, values: Any) -> tuple[Any, ...]:
    """Return ``values`` as a tuple, or raise an error that names the argument."""
    if isinstance(values, str | bytes) or not isinstance(values, Iterable) or getattr(values, "ndim", 1) != 1:
        raise TypeError(f"{name} = {shown(values)}: must be a sequence such as [{shown(values)}]")
    found = tuple(islice(values, _MOST_LISTED + 1))
    if len(found) > _MOST_LISTED:
        raise ValueError(f"{name} = {shown(values)}: must have at most {_MOST_LISTED} entries")
    return found


def scalar(name: str, value: Any) -> Expr:
    """Return ``value`` as an expression, or raise an error that names the argument; no text is read."""
    try:
        expression = sympify(value, strict=True)
        is_scalar = isinstance(expression, Expr) and expression.is_commutative and not expression.has(*_NO_SCALAR)
    except Exception:  # conversion may raise anything, or the expression may be nested too deeply
        is_scalar = False
    if not is_scalar:
        raise TypeError(f"{name} = {shown(value)}: must be a scalar SymPy expression")
    return expression


class Jet(NamedTuple):
    """Derivative of orders ``space`` and ``time`` of the unknown of that index; place None is the interval."""

    unknown: int
    space: int
    time: int
    place: End | int | None


class JetSpace:
    """Conversion of expressions in v(x, t) to jet symbols and back.

    Parameters
    ----------
    fields, coordinates : sequence of applied undefined functions
        ``v(x, t)`` and ``w(t)``; unknown number k is ``(*fields, *coordinates)[k]``.
    x, t : Symbol
        Independent variables.
    domain : (Expr, Expr)
        Coordinates of the left and the right end.
    prescribed : sequence of applied undefined functions
        Known functions of x and t, not varied. Known functions of x or t alone need no declaration.
    """

    def __init__(
        self,
        fields: Sequence[AppliedUndef],
        coordinates: Sequence[AppliedUndef],
        x: Symbol,
        t: Symbol,
        domain: tuple[Expr, Expr],
        prescribed: Sequence[AppliedUndef] = (),
    ) -> None:
        self.fields, self.coordinates = listed("fields", fields), listed("coordinates", coordinates)
        self.x, self.t = x, t
        prescribed = listed("prescribed", prescribed)
        self._check_symbols(prescribed)
        self.unknowns = (*self.fields, *self.coordinates)
        ends = tuple(scalar("domain", end) for end in listed("domain", domain))
        if len(ends) != 2 or ends[0] == ends[1] or any(end.has(x, t) for end in ends):
            raise HamiltonError(f"domain = {domain}: must be two different end coordinates free of {x} and {t}")
        self.ends: dict[End | int, Expr] = dict(zip(END_NAMES, ends, strict=True))
        self.known = {function.func for function in prescribed}
        self._heads = {unknown.func: number for number, unknown in enumerate(self.unknowns)}
        if len(self._heads) != len(self.unknowns):
            raise HamiltonError(f"fields and coordinates {self.unknowns}: each may be named once only")
        self._symbols: dict[Jet, Dummy] = {}
        self._jets: dict[Dummy, Jet] = {}

    def _check_symbols(self, prescribed: tuple[Any, ...]) -> None:
        for name, value in (("x", self.x), ("t", self.t)):
            if not isinstance(value, Symbol):
                raise TypeError(f"{name} = {shown(value)}: must be a SymPy symbol")
        for function in prescribed:
            if not isinstance(function, AppliedUndef):
                raise TypeError(f"prescribed: {shown(function)}: must be an undefined function, such as w(t)")
        kinds = (("fields", self.fields, {self.x, self.t}), ("coordinates", self.coordinates, {self.t}))
        for name, functions, allowed in kinds:
            for function in functions:
                if not isinstance(function, AppliedUndef):
                    raise TypeError(
                        f"{name}: {shown(function)}: must be an undefined function of {allowed}, such as v(x, t)"
                    )
                if set(function.args) != allowed or len(function.args) != len(allowed):
                    raise HamiltonError(
                        f"{name}: {function} must be a function of exactly {', '.join(sorted(map(str, allowed)))}"
                        " (the same symbols, with the same assumptions, as x and t)"
                    )

    # ---------------------------------------------------------------------------------------------- symbols

    def symbol(self, jet: Jet) -> Dummy:
        """Return the symbol of a jet."""
        if jet not in self._symbols:
            marks = "x" * jet.space + "t" * jet.time
            made = Dummy(f"{self.unknowns[jet.unknown].func.__name__}_{marks}{jet.place or ''}")
            self._symbols[jet], self._jets[made] = made, jet
        return self._symbols[jet]

    def jets(self, *expressions: Expr) -> list[Jet]:
        """Return the jets in the expressions, in a stable order."""
        found = {self._jets[s] for e in expressions for s in e.free_symbols if s in self._jets}
        return sorted(found, key=lambda jet: (jet.unknown, jet.place or "", jet.space, jet.time))

    @property
    def names(self) -> tuple[str, str]:
        """Names of position and time."""
        return self.x.name, self.t.name

    def is_field(self, unknown: int) -> bool:
        """Tell a field from a lumped coordinate."""
        return unknown < len(self.fields)

    # ---------------------------------------------------------------------------------------------- calculus

    def d_t(self, expression: Expr) -> Expr:
        """Total time derivative."""
        chain = (
            expression.diff(self.symbol(j)) * self.symbol(j._replace(time=j.time + 1)) for j in self.jets(expression)
        )
        return Add(expression.diff(self.t), *chain)

    def d_x(self, expression: Expr) -> Expr:
        """Total x derivative of an expression in the interval."""
        chain = (
            expression.diff(self.symbol(j)) * self.symbol(j._replace(space=j.space + 1))
            for j in self.jets(expression)
            if self.is_field(j.unknown)
        )
        return Add(_real_rate(expression, self.x), *chain)

    def at(self, end: End, expression: Expr) -> Expr:
        """Take an expression in the interval to one end."""
        moved = {
            self.symbol(j): self.symbol(j._replace(place=end))
            for j in self.jets(expression)
            if self.is_field(j.unknown)
        }
        value = expression.xreplace(moved).subs(self.x, self.ends[end])
        if value.has(S.ComplexInfinity, S.NaN, S.Infinity):
            raise HamiltonError(f"{self.write(expression)} has no value at the {end} end {self.x} = {self.ends[end]}")
        return value

    # ---------------------------------------------------------------------------------------------- writing

    def form(self, jet: Jet) -> Expr:
        """Return the derivative that a jet represents, evaluated if it belongs to an end."""
        function = self.unknowns[jet.unknown]
        orders = [(v, n) for v, n in ((self.x, jet.space), (self.t, jet.time)) if n]
        derivative = function.diff(*orders) if orders else function
        return derivative if jet.place is None else derivative.subs(self.x, self.ends[jet.place])

    def restore(self, expression: Expr) -> Expr:
        """Return the expression in derivatives again, otherwise as it is."""
        return expression.xreplace({self.symbol(jet): self.form(jet) for jet in self.jets(expression)})

    def write(self, expression: Expr) -> Expr:
        """Return the expression in derivatives again, linear terms grouped by their coefficient."""
        given = {node: Dummy() for node in _maximal(expression, lambda n: _is_function(n) and n.has(self.t))}
        named = expression.xreplace(given)
        variables = [*(self.symbol(jet) for jet in self.jets(named)), *given.values()]
        back = {symbol: node for node, symbol in given.items()}
        return self.restore(grouped(named, variables).xreplace(back))

    # ---------------------------------------------------------------------------------------------- reading

    def read(self, expression: Any, place: End | Literal["domain", "ends"], label: str) -> Expr:
        """Return ``expression`` in jet symbols.

        Parameters
        ----------
        expression : Expr
            In the unknowns and their derivatives.
        place : {'domain', 'left', 'right', 'ends'}
            Where unevaluated ``v(x, t)`` is meant; at 'ends' only evaluated forms such as ``v(0, t)`` are accepted.
        label : str
            Names the expression in errors.

        Raises
        ------
        HamiltonError
            Names the term and the reason.
        """
        expression = scalar(label, expression)
        return Add(*(self._read_term(term, place, label) for term in Add.make_args(expression)))

    def _read_term(self, term: Expr, place: Where, label: str) -> Expr:
        try:
            self._check_strangers(term)
            read = self._convert(term, place)
        except HamiltonError as error:
            raise HamiltonError(f"{label}, term {term}: {error}") from None
        if place in END_NAMES:
            read = read.subs(self.x, self.ends[place])
        elif place == "ends" and read.has(self.x):
            raise HamiltonError(f"{label}, term {term}: say at which end {self.x} is meant")
        return read

    def _check_strangers(self, term: Expr) -> None:
        for own in (self.x, self.t):
            for symbol in term.free_symbols:
                if symbol.name == own.name and symbol != own:
                    raise HamiltonError(f"the symbol {symbol} here differs from {own} in its assumptions")
        if term.has(S.ComplexInfinity, S.NaN, S.Infinity, S.NegativeInfinity):
            raise HamiltonError("it is not finite")
        if term.has(S.ImaginaryUnit):
            raise HamiltonError("it is not real")

    def _mentions(self, node: Basic) -> bool:
        return any(function.func in self._heads for function in node.atoms(AppliedUndef))

    def _convert(self, node: Basic, place: Where) -> Any:
        if isinstance(node, AppliedUndef):
            return self._convert_function(node, place)
        if isinstance(node, Derivative):
            return self._convert_derivative(node, place)
        if isinstance(node, _SINGULAR) and node.has(self.x):
            raise HamiltonError(f"{node} acts at an interior point; split the interval or use an end term")
        if not node.has(AppliedUndef):
            return node
        if isinstance(node, Subs):
            return self._convert_subs(node, place)
        if self._mentions(node):
            if isinstance(node, _NOT_LOCAL):
                raise HamiltonError(f"{node} is not local: a density may not hold an integral or a sum over an unknown")
            if isinstance(node, _NOT_SMOOTH):
                raise HamiltonError(f"{node} is not differentiable in the unknowns, so it has no variation")
        if isinstance(node, UndefinedFunction) or not node.args:
            return node
        return node.func(*(self._convert(argument, place) for argument in node.args))

    def _convert_function(self, function: AppliedUndef, place: Where) -> Expr:
        if any(self._mentions(argument) for argument in function.args):
            raise HamiltonError(f"{function} is an unspecified function of an unknown: its variation is not known")
        if function.func not in self._heads:
            return function
        return self._jet(function, {}, place)

    def _convert_derivative(self, derivative: Derivative, place: Where) -> Expr:
        function = derivative.expr
        if not isinstance(function, AppliedUndef):
            done = derivative.doit()
            if done == derivative:
                raise HamiltonError(f"{derivative} cannot be carried out")
            return self._convert(done, place)
        if function.func in self._heads:
            return self._jet(function, dict(derivative.variable_count), place)
        if function.has(self.x) and function.has(self.t) and function.func not in self.known:
            raise HamiltonError(
                f"{derivative}: {function} is not one of the fields {list(map(str, self.fields))};"
                " list it in fields, or in prescribed if it is known"
            )
        return derivative

    def _convert_subs(self, subs: Subs, place: Where) -> Expr:
        inner = subs.expr
        for variable, point in zip(subs.variables, subs.point, strict=True):
            inner = inner.xreplace({variable: self.x})
            if not self._mentions(inner):
                return subs
            if point == self.x:
                continue
            return self._convert(inner, self._end_at(point, place, subs))
        return self._convert(inner, place)

    def _end_at(self, point: Expr, place: Where, node: Basic) -> End | int:
        for end, coordinate in self.ends.items():
            if point == coordinate and place != "domain":
                return end
        where = " or ".join(f"{self.x} = {coordinate}" for coordinate in self.ends.values())
        if place == "domain":
            raise HamiltonError(
                f"{node} is a value at the point {self.x} = {point}: a density is local; use left or right"
            )
        raise HamiltonError(f"{node} is a value at {self.x} = {point}, which is not an end ({where})")

    def _jet(self, function: AppliedUndef, orders: dict[Symbol, int], place: Any) -> Expr:
        number = self._heads[function.func]
        own = self.unknowns[number]
        if len(function.args) != len(own.args):
            raise HamiltonError(f"{function} should be written {own}")
        where: End | int | None = None if place == "domain" else place
        for argument, variable in zip(function.args, own.args, strict=True):
            if argument == variable:
                continue
            if variable == self.t:
                raise HamiltonError(f"{function} is not local in time: must be {own}")
            where = self._end_at(argument, place, function)
        if not self.is_field(number):
            where = None
        elif where == "ends":  # type: ignore[comparison-overlap]
            raise HamiltonError(f"{function} is not evaluated at an end: write {function}.subs({self.x}, ...)")
        space, time = orders.pop(self.x, 0), orders.pop(self.t, 0)
        if where in END_NAMES:
            space += orders.pop(self.ends[where], 0)  # v.diff(x).subs(x, L) is Derivative(v(L, t), L) in SymPy
        if orders or not all(getattr(n, "is_Integer", True) for n in (space, time)):
            raise HamiltonError(f"a derivative of {function} by {list(orders)} has no meaning here")
        return self.symbol(Jet(number, int(space), int(time), where))


def _is_function(node: Basic) -> bool:
    return isinstance(node, (AppliedUndef, Subs)) or (
        isinstance(node, Derivative) and isinstance(node.expr, AppliedUndef)
    )


def _maximal(expression: Expr, wanted: Any) -> list[Basic]:
    """Return the outermost nodes that satisfy ``wanted``."""
    found: dict[Basic, None] = {}
    walk = preorder_traversal(expression)
    for node in walk:
        if wanted(node):
            found[node] = None
            walk.skip()
    return list(found)


def _real_rate(expression: Expr, symbol: Symbol) -> Expr:
    """Return the derivative by a symbol; absolute values are differentiated as those of real numbers."""
    if not expression.has(Abs):
        tables = _maximal(expression, lambda node: isinstance(node, Piecewise) and len(node.args) > _LONG)
        names = {table: Dummy() for table in tables if table.has(symbol)}
        plain = expression.xreplace(names)
        own = (plain.diff(name) * _rate_of_parts(table, symbol) for table, name in names.items())
        return Add(plain.diff(symbol), *own).xreplace({name: table for table, name in names.items()})
    real = {s: Dummy(s.name, real=True) for s in expression.free_symbols | {symbol} if isinstance(s, Symbol)}
    rate = expression.xreplace(real).diff(real[symbol])
    return rate.xreplace({dummy: s for s, dummy in real.items()})


@lru_cache(maxsize=64)
def _rate_of_parts(table: Piecewise, symbol: Symbol) -> Expr:
    """Return the derivative of a Piecewise of many parts, part by part; SymPy would compare them with one another."""
    return Piecewise(*((value.diff(symbol), condition) for value, condition in table.args), evaluate=False)
