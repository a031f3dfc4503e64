"""Terms of a Lagrangian at interior places, and displacements held there."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

from sympy import (
    Abs,
    Add,
    DiracDelta,
    Dummy,
    Expr,
    Heaviside,
    SingularityFunction,
    Subs,
    Symbol,
    ceiling,
    expand,
    floor,
    frac,
    sign,
    sympify,
)
from sympy.core.function import AppliedUndef, Derivative

from cra_sym.checks import shown
from cra_sym.mechanics.jets import HamiltonError, Jet, JetSpace

__all__ = ["InteriorPoint", "at_place", "in_points", "linear_work", "read_points", "supports"]


@dataclass(frozen=True)
class InteriorPoint:
    """Terms at an interior place.

    Attributes
    ----------
    place : Expr
    lagrangian : Expr
        In the jet symbols of the interval, taken at that place.
    held : tuple of Jet
        Displacements that vanish there.
    applied : tuple of (Expr, Jet)
        Non-conservative forces there, and the displacement each works on.
    """

    place: Expr
    lagrangian: Expr
    held: tuple[Jet, ...]
    applied: tuple[tuple[Expr, Jet], ...] = ()


def in_points(density: Expr, x: Symbol, label: str = "density") -> tuple[Expr, list[tuple[Expr, Expr]]]:
    """Return a density without its point loads, and these as (place, term).

    Raises
    ------
    HamiltonError
        If the argument of a DiracDelta is not affine in x, or it is differentiated or multiplied with another.

    Examples
    --------
    >>> from sympy import DiracDelta, symbols
    >>> x, a, k, m = symbols("x a k m")
    >>> in_points(k + m * DiracDelta(2 * x - a), x)
    (k, [(a/2, m/2)])
    """
    if not isinstance(density, Expr):
        return density, []
    for node in density.atoms(SingularityFunction):
        if node.args[2].is_integer is False:
            base = node.args[0] - node.args[1]
            raise HamiltonError(f"{label}: the exponent of {node} must be a whole number; write Heaviside({base}) * ..")
    steps = {n: DiracDelta(n.args[0] - n.args[1]) for n in density.atoms(SingularityFunction) if n.args[2] == -1}
    density = density.xreplace(steps)
    found = []
    for delta in sorted(density.atoms(DiracDelta), key=str):
        argument = delta.args[0]
        if not argument.has(x):
            continue
        slope = argument.diff(x)
        if len(delta.args) > 1 or slope.has(x):
            raise HamiltonError(
                f"{label}: {delta} must be DiracDelta of an expression that is linear in {x}; "
                f"{delta.func.__name__}(g({x})) is the sum over its zeros a of DiracDelta({x} - a) / |g'(a)|"
            )
        mark = Dummy()
        marked = density.xreplace({delta: mark})
        factor = marked.diff(mark)
        if expand(factor.diff(mark)) != 0 or factor.has(DiracDelta):
            raise HamiltonError(f"{label}: {delta} is multiplied with another DiracDelta")
        place = -argument.subs(x, 0) / slope
        found.append((place, factor.subs(mark, 0) / Abs(slope)))
        density = marked.subs(mark, 0)
    return density, found


def read_points(
    space: JetSpace,
    inside: Sequence[tuple[Expr, Expr]],
    held: Iterable[tuple[Expr, Expr]],
    work: Iterable[tuple[Expr, Expr, Expr]],
    orders: Sequence[int],
) -> tuple[InteriorPoint, ...]:
    """Read terms, supports and forces at interior places into jet symbols, one point for each place."""
    found: dict[Expr, tuple[list[Expr], list[Jet], list[tuple[Expr, Jet]]]] = {}

    def at(place: Expr) -> tuple[list[Expr], list[Jet], list[tuple[Expr, Jet]]]:
        return found.setdefault(place, ([], [], []))

    for given in inside:
        try:
            place, term = given
        except (TypeError, ValueError):
            raise HamiltonError(f"inside: {shown(given)} must be a pair (place, term)") from None
        place = _place(space, place)
        label = f"term inside at {space.x} = {place}"
        term = _moved(sympify(term, strict=True), space.x, place)
        _check_jumps(term, space.x, place, label)
        read = space.read(term, "domain", label)
        for jet in space.jets(read):
            _check(space, jet, orders, label)
        at(place)[0].append(read)
    for place, displacement in held:
        read = space.read(displacement, "domain", f"essential inside at {space.x} = {place}")
        (jet,) = space.jets(read)
        _check(space, jet, orders, f"essential inside at {space.x} = {place}")
        at(_place(space, place))[1].append(jet)
    for force, displacement, place in work:
        place = _place(space, place)
        label = f"virtual work of {shown(force)} on {shown(displacement)} at {space.x} = {place}"
        pushed, moved = (
            space.read(_moved(sympify(part, strict=True), space.x, place), "domain", label)
            for part in (force, displacement)
        )
        for jet in space.jets(pushed, moved):
            _check(space, jet, orders, label)
        at(place)[2].extend(linear_work(space, pushed, moved, label))
    return tuple(
        InteriorPoint(
            place,
            Add(*terms).subs(space.x, place),
            tuple(jets),
            tuple((force.subs(space.x, place), jet) for force, jet in forces),
        )
        for place, (terms, jets, forces) in found.items()
    )


def _check_jumps(term: Expr, x: Symbol, place: Expr, label: str) -> None:
    """Raise an error for a factor that is discontinuous at the place itself."""
    for node in term.atoms(Heaviside, sign, floor, ceiling, frac):
        argument = node.args[0].subs(x, place)
        if node.has(x) and (argument.is_integer if isinstance(node, (floor, ceiling, frac)) else argument.is_zero):
            raise HamiltonError(f"{label}: the factor {node} jumps right there; state which value it has")


def linear_work(space: JetSpace, force: Expr, moved: Expr, label: str) -> list[tuple[Expr, Jet]]:
    """Return (force, displacement) for each displacement in a linear combination of them."""
    works = []
    for jet in space.jets(moved):
        factor = moved.diff(space.symbol(jet))
        if jet.time or space.jets(factor):
            raise HamiltonError(f"{label}: the displacement must be linear and free of time derivatives")
        works.append((factor * force, jet))
    if not works:
        raise HamiltonError(f"{label}: the displacement holds no field and no coordinate")
    return works


def _place(space: JetSpace, place: Expr) -> Expr:
    place = sympify(place, strict=True)
    if place in space.ends.values():
        raise HamiltonError(f"inside: {space.x} = {place} is an end; use left or right")
    if place.has(space.x, space.t):
        raise HamiltonError(f"inside: the place {place} must be free of {space.x} and {space.t}")
    return place


def _check(space: JetSpace, jet: Jet, orders: Sequence[int], label: str) -> None:
    if space.is_field(jet.unknown) and jet.space >= orders[jet.unknown]:
        raise HamiltonError(f"{label}: {space.form(jet)} is not a displacement of a section, so it may jump there")


def _moved(term: Expr, x: Symbol, place: Expr) -> Expr:
    """Return a term with evaluated forms such as v(a, t) written as v(x, t)."""
    evaluated = {
        node: node.expr.xreplace({node.variables[0]: x})
        for node in term.atoms(Subs)
        if len(node.variables) == 1 and node.point[0] == place
    }
    term = term.xreplace(evaluated)
    functions = {f: f.xreplace({place: x}) for f in term.atoms(AppliedUndef) if place in f.args}
    return term.xreplace(functions)


def supports(
    essential: Sequence[Expr], x: Symbol, domain: Sequence[Expr]
) -> tuple[tuple[Expr, ...], tuple[tuple[Expr, Expr], ...]]:
    """Return the essential conditions of the ends, and those of interior places as (place, displacement).

    Raises
    ------
    HamiltonError
        If a condition at an interior place is not a single vanishing displacement.
    """
    ends, inside = [], []
    for condition in essential:
        found = _displacement(condition, x)
        if found is None or found[0] in domain:
            ends.append(condition)
        else:
            inside.append(found)
    return tuple(ends), tuple(inside)


def _displacement(condition: Expr, x: Symbol) -> tuple[Expr, Expr] | None:
    """Return place and displacement of a condition such as v(a, t) = 0 or v_x(a, t) = 0, or None."""
    found = at_place(condition, x)
    moving = isinstance(condition, Derivative) and found is not None and x not in found[1].variables
    return None if moving else found


def at_place(node: Expr, x: Symbol) -> tuple[Expr, Expr] | None:
    """Return the place of a value such as v(a, t), v_x(a, t) or v_t(a, t), and its function of x; or None."""
    if isinstance(node, Subs) and len(node.variables) == 1:
        return node.point[0], node.expr.xreplace({node.variables[0]: x})
    if isinstance(node, AppliedUndef) and len(node.args) == 2 and node.args[0] != x:
        return node.args[0], node.func(x, node.args[1])
    if isinstance(node, Derivative) and isinstance(node.expr, AppliedUndef):
        place, time = node.expr.args[0], node.expr.args[-1]
        if len(node.expr.args) == 2 and place != x:
            orders = [x if variable == place else variable for variable in node.variables]
            return place, node.expr.func(x, time).diff(*orders)
    return None
