"""Loads of a model: its inputs (prescribed motions and forces), constant loads and the momentum of a start."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any, Literal

from sympy import Derivative, Expr, S, SympifyError, sympify
from sympy.core.function import AppliedUndef

from cra_sym.checks import mapping, shown
from cra_sym.mechanics.jets import Jet
from cra_sym.mechanics.weak import Bilinear, WeakForm, weak_form
from cra_sym.model.forms import load_of
from cra_sym.model.projection import Load

if TYPE_CHECKING:
    from cra_sym.model.lagrangian import Model

__all__ = ["causes", "constant", "load", "load_coefficients", "load_of_order", "loads", "momentum"]

Kind = Literal["motion", "force", "support"]


def causes(model: Model) -> tuple[tuple[str, Kind | str], ...]:
    """Return the functions of time that drive the model, with their kind.

    A 'motion' acts through its acceleration only, a 'force' through its value. A 'support' is a motion that acts
    through its displacement, which then has an energy of its own, its velocity, or several of these and its
    acceleration. For any other function the kind is the offending term.
    """
    return tuple((f.func.__name__, _kind(model, f)) for f in model.driving)


def _kind(model: Model, function: AppliedUndef) -> str:
    weak = weak_form(model.linearised.variation)
    orders, t = set(), weak.variation.space.t
    for term in weak.load_terms:
        if term.has(function):
            found = [order for order in range(3) if not (term / function.diff(t, order)).has(t)]
            if not found:
                return str(term)
            orders.update(found)
    if orders == {2}:
        return "motion"
    energies = [model.pieces[name] for name in ("density", "left", "right")] + [e for _, e in model.pieces["inside"]]
    stored = any(sympify(energy or 0, strict=True).diff(function, 2) != 0 for energy in energies)
    return "force" if orders == {0} and not stored else "support"


def load(model: Model, name: str) -> Load:
    """Return the load of a unit input: a unit acceleration of a prescribed motion, or a unit force."""
    found: Load = model.numerics("load_of_order", name, _order(model, name))
    return found


def loads(model: Model, name: str) -> dict[int, Load]:
    """Return the loads of units of an input (0), its velocity (1) and its acceleration (2): those that act."""
    orders = [order for order in range(3) if any(load_coefficients(model, name, order))]
    return {order: model.numerics("load_of_order", name, order) for order in orders}


def load_of_order(model: Model, name: str, order: int) -> Load:
    """Return the load of a unit of an input's derivative by time, of the given order."""
    return load_of(weak_form(model.linearised.variation), *load_coefficients(model, name, order), model.symbols)


def _order(model: Model, name: str) -> int:
    return 2 if dict(model.numerics("causes")).get(name) == "motion" else 0


def load_coefficients(model: Model, name: str, order: int | None = None) -> tuple[dict[Jet, Expr], dict[Jet, Expr]]:
    """Return a load's coefficients by displacement: per length inside, and at ends, coordinates and places.

    ``order`` is that of the derivative of the input by time; by default 2 for a 'motion' and 0 for any other.
    """
    weak = weak_form(model.linearised.variation)
    t = weak.variation.space.t
    function = next((f for f in model.driving if f.func.__name__ == name), None)
    if function is None:
        raise ValueError(f"motion: {name} acts in nonlinear terms alone, which only response takes into account")
    cause = function.diff(t, _order(model, name) if order is None else order)
    inside, discrete = (_coefficients(weak, part, cause) for part in (weak.inside_load, weak.discrete_load))
    return inside, discrete


def _coefficients(weak: WeakForm, part: dict[Jet, Expr], cause: Expr) -> dict[Jet, Expr]:
    found = {jet: weak.variation.space.restore(e).expand().coeff(cause) for jet, e in part.items()}
    return {jet: value for jet, value in found.items() if value != 0}


def constant(model: Model) -> Load | None:
    """Return the loads that are constant in time, or None if there are none.

    Raises
    ------
    ValueError
        Names a load that is an expression of time itself.
    """
    weak = weak_form(model.linearised.variation)
    still = {f: S.Zero for e in weak.load_terms for f in e.atoms(AppliedUndef)}

    def left(part: dict[Jet, Expr]) -> dict[Jet, Expr]:
        values = {jet: weak.variation.space.restore(e).subs(still).doit() for jet, e in part.items()}
        return {jet: value for jet, value in values.items() if value != 0}

    inside, ends = left(weak.inside_load), left(weak.discrete_load)
    for value in (*inside.values(), *ends.values()):
        if value.has(weak.variation.space.t):
            raise ValueError(
                f"system: the load {value} must be a function of time such as F(t), whose history is given, or, with "
                "cosines and sines of varpi*t, be told by small=(epsilon, varpi)"
            )
    return load_of(weak, inside, ends, model.symbols) if inside or ends else None


def momentum(model: Model, initial: Mapping[Expr, Any], order: int) -> Load | None:
    """Return the momentum of given displacements (order 0) or velocities (1) as a load, or None if there are none.

    Raises
    ------
    ValueError
        Names the function that is not an unknown of the model, or the value that is not an expression in x.
    """
    weak = weak_form(model.linearised.variation)
    space = weak.variation.space
    given: dict[int, Expr] = {}
    for key, value in mapping("initial", initial, "fields and coordinates to expressions in x").items():
        function = key.expr if isinstance(key, Derivative) else key
        if function not in space.unknowns or key not in (function, function.diff(space.t)):
            known = ", ".join(f"{u}, {u.diff(space.t)}" for u in space.unknowns)
            raise ValueError(f"initial: {key} must be one of {known}")
        try:
            number, value = space.unknowns.index(function), sympify(value, strict=True)
        except (SympifyError, TypeError):
            raise ValueError(f"initial: {key} = {shown(value)} must be an expression in {space.x}") from None
        if not isinstance(value, Expr):
            raise ValueError(f"initial: {key} = {shown(value)} must be an expression in {space.x}")
        free = {*model.symbols, *([space.x] if space.is_field(number) else [])}
        if value.free_symbols - free or value.atoms(AppliedUndef):
            raise ValueError(f"initial: {key} = {value} must be an expression in {', '.join(map(str, free))}")
        if order == int(isinstance(key, Derivative)):
            given[number] = value

    def weighed(form: Bilinear) -> dict[Jet, Expr]:
        loads: dict[Jet, Expr] = {}
        for (p, q), entry in form.items():
            if 2 in entry and q.unknown in given:
                value = given[q.unknown].diff(space.x, q.space)
                value = value if q.place is None else value.subs(space.x, weak.place(q))
                loads[p] = loads.get(p, S.Zero) + entry[2] * value
        return {jet: value for jet, value in loads.items() if value != 0}

    inside, ends = weighed(weak.inside), weighed(weak.discrete)
    return load_of(weak, inside, ends, model.symbols) if inside or ends else None
