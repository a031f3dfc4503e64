"""Measurable linear functions of the motion, by name: displacements, forces and combinations of them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Literal, NamedTuple

from sympy import Add, Dummy, Expr, S, Subs, cancel, expand, preorder_traversal, sympify
from sympy.core.function import AppliedUndef, Derivative

from cra_sym.checks import shown
from cra_sym.kernels import Kernel, kernel
from cra_sym.mechanics.jets import Jet
from cra_sym.mechanics.points import at_place
from cra_sym.mechanics.weak import weak_form

if TYPE_CHECKING:
    from cra_sym.model.lagrangian import Model

__all__ = ["Observable", "Part", "Sum", "named_observables", "named_sums", "observable", "sum_of"]

_HIGHEST = 2  # derivative by time


class Part(NamedTuple):
    """One displacement, or the natural force of an end, in a sum.

    Attributes
    ----------
    kind : {'field', 'force', 'coordinate', 'motion'}
        'field': at a place; 'force': conjugate to a displacement of an end section; 'motion': a prescribed one.
    entry : int
        Of the section's displacements or of the coordinates.
    order, time : int
        Derivatives by x and by t.
    end : int
        Of a force: left (0) or right (1).
    name : str
        Of a prescribed motion.
    """

    kind: Literal["field", "force", "coordinate", "motion"]
    entry: int = 0
    order: int = 0
    time: int = 0
    end: int = 0
    name: str = ""


class Sum(NamedTuple):
    """A sum of parts, each with its factor and its place in the parameters of the model.

    Attributes
    ----------
    parts : tuple of Part
    factors, places : tuple of Expr
    """

    parts: tuple[Part, ...]
    factors: tuple[Expr, ...]
    places: tuple[Expr, ...]


@dataclass(frozen=True)
class Observable:
    """A sum of parts.

    Attributes
    ----------
    parts : tuple of Part
    numbers : Kernel
        Of the parameters: the factor of every part, then the place of every part.
    """

    parts: tuple[Part, ...]
    numbers: Kernel


def named_observables(model: Model) -> dict[str, Observable]:
    """Return the named measurable quantities of a model, as `named_sums`."""
    return {name: _compiled(model, found) for name, found in named_sums(model).items()}


def named_sums(model: Model) -> dict[str, Sum]:
    """Return the named measurable quantities of a model.

    Fields at the right end, coordinates and prescribed motions by their names; 'y', the first field there in the
    inertial frame, with the motions and coordinates that carry it, and its rates; and the forces that the structure
    exerts through its ends.
    """
    equations, t = model.equations, model.equations.t
    right = equations.domain[1]
    tips = {f.func.__name__: f.subs(equations.x, right) for f in equations.fields}
    found = tips | {f.func.__name__: f for f in (*equations.coordinates, *model.motions)}
    if tips:
        tip = next(iter(tips.values())) + frame(model)
        found = {"y": tip, "tip_velocity": tip.diff(t), "tip_acceleration": tip.diff(t, 2)} | found
    ordered = sorted(found, key=lambda name: name not in tips)  # the tip of the first field comes first
    return {name: sum_of(model, found[name]) for name in ordered} | _forces(model)


def _compiled(model: Model, found: Sum) -> Observable:
    return Observable(found.parts, kernel((*found.factors, *found.places), model.symbols, backend="numpy"))


def _forces(model: Model) -> dict[str, Sum]:
    """Return the forces that the structure exerts on its supports: P at the left end, -P at the right one."""
    found = {}
    names = [str(displacement) for displacement in model.state_form.displacements]
    for number, field in enumerate(model.equations.fields):
        suffix = f"_{field.func.__name__}" if number else ""
        for kind, displacement in (("force", field), ("moment", field.diff(model.equations.x))):
            if str(displacement) in names:
                entry = names.index(str(displacement))
                for end, where, sign in ((0, "root", S.One), (1, "tip", S.NegativeOne)):
                    found[f"{where}_{kind}{suffix}"] = Sum((Part("force", entry, end=end),), (sign,), (S.Zero,))
    return found


def frame(model: Model) -> Expr:
    """Return the rigid-body displacement of the right end of the first field.

    It is due to the prescribed motions, and to coordinates that carry the whole field: its kinetic energy per length
    is then a square, such as rho A (v_t + x q_t)^2 / 2.
    """
    x, right = model.equations.x, model.equations.domain[1]
    total, steady = S.Zero, weak_form(model.linearised.variation)
    for number, coordinate in enumerate(steady.variation.space.unknowns):
        own, carried = Jet(0, 0, 0, None), Jet(number, 0, 0, None)
        mass, shared, alone = (
            steady.inside.get(pair, {}).get(2, S.Zero) for pair in ((own, own), (own, carried), (carried, carried))
        )
        if coordinate in model.equations.coordinates and shared != 0 and cancel(shared**2 - mass * alone) == 0:
            total += cancel(shared / mass).subs(x, right) * coordinate
    for motion in model.motions:
        freed = weak_form(model.freed(motion.func.__name__).linearised.variation)
        space, field = freed.variation.space, Jet(0, 0, 0, None)
        carried = Jet(space.unknowns.index(motion), 0, 0, None)
        for form, own in ((freed.inside, field), (freed.ends, field._replace(place="right"))):
            mass = form.get((own, own), {}).get(2, S.Zero)
            if mass != 0:
                share = cancel(form.get((own, carried), {}).get(2, S.Zero) / mass)
                total += share.subs(space.x, space.ends["right"]) * motion
                break
    return total


def observable(model: Model, expression: Any, name: str = "outputs") -> Observable:
    """Return a linear function of the motion, given as an expression; as `sum_of`."""
    return _compiled(model, sum_of(model, expression, name))


def sum_of(model: Model, expression: Any, name: str = "outputs") -> Sum:
    """Return a linear function of the motion, given as an expression.

    Parameters
    ----------
    model : Model
    expression : Expr
        A sum of parameters times fields at places, coordinates, prescribed motions, or derivatives of them.
    name : str
        Of the argument, for errors.

    Raises
    ------
    TypeError, ValueError
        Names the term that is not linear, has no place, or is not a function of the model.
    """
    try:
        given = sympify(expression, strict=True)
    except Exception:
        given = None
    if not isinstance(given, Expr):
        raise TypeError(f"{name} = {shown(expression)}: must be an expression in fields at places and coordinates")
    given = expand(given.xreplace(dict(model.pieces["definitions"])))
    marks = {node: Dummy() for node in _functions(given)}
    linear = expand(given.xreplace(marks))
    factors = [linear.diff(mark) for mark in marks.values()]
    rest = Add(linear, *(-factor * mark for factor, mark in zip(factors, marks.values(), strict=True)))
    if not marks or expand(rest) != 0 or any(factor.has(*marks.values()) for factor in factors):
        raise ValueError(f"{name}: {expression} must be linear in fields at places, coordinates and their derivatives")
    found = [_part(model, node, name) for node in marks]
    unknown = {s for e in (*factors, *(place for _, place in found)) for s in e.free_symbols} - {*model.symbols}
    if unknown:
        known = ", ".join(symbol.name for symbol in model.symbols)
        raise ValueError(f"{name}: {min(map(str, unknown))} in {expression} is not a parameter; must be one of {known}")
    return Sum(tuple(part for part, _ in found), tuple(factors), tuple(place for _, place in found))


def _functions(expression: Expr) -> list[Expr]:
    """Return the outermost functions, derivatives of functions and values of these at places."""
    found: dict[Expr, None] = {}
    walk = preorder_traversal(expression)
    for node in walk:
        if isinstance(node, (AppliedUndef, Subs)) or (isinstance(node, Derivative) and node.has(AppliedUndef)):
            found[node] = None
            walk.skip()
    return list(found)


def _part(model: Model, node: Expr, name: str) -> tuple[Part, Expr]:
    """Return the part that a function at a place, or a derivative of one, represents, and its place."""
    equations = model.equations
    x, t = equations.x, equations.t
    local = at_place(node, x)
    place, inner = (None, node) if local is None else local
    function = inner.expr if isinstance(inner, Derivative) else inner
    orders = dict(inner.variable_count) if isinstance(inner, Derivative) else {}
    time, space = int(orders.pop(t, 0)), int(orders.pop(x, 0))
    if time > _HIGHEST or orders:
        raise ValueError(f"{name}: {node} must be differentiated by {x}, and by {t} at most twice")
    if function in equations.fields:
        if place is None or place.has(x, t):
            raise ValueError(f"{name}: {node} must be taken at a place, such as {function}.subs({x}, ..)")
        entry = list(model.state_form.displacements).index(function)
        return Part("field", entry, space, time), place
    if place is None and function in equations.coordinates:
        return Part("coordinate", model.state_form.coordinates.index(function), 0, time), S.Zero
    if place is None and function in model.motions:
        return Part("motion", 0, 0, time, name=function.func.__name__), S.Zero
    known = _listed((*equations.fields, *equations.coordinates, *model.motions))
    raise ValueError(f"{name}: {node} must be made of {known}")


def _listed(functions: Sequence[Expr]) -> str:
    return ", ".join(map(str, functions))
