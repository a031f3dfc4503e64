"""Derivation of a problem in exact arithmetic: its coefficients between the places at which they change."""

from __future__ import annotations

from collections.abc import Collection, Iterable
from typing import TYPE_CHECKING, Any

from sympy import Expr, Float, Function, Matrix, Rational, S, cos, cosh, exp, log, sin, sinh, tan, tanh

from cra_sym.mechanics.breakpoints import switches
from cra_sym.mechanics.weak import weak_form
from cra_sym.model.ball_problem import BallLayout, BallProblem, Pattern
from cra_sym.model.exact import ExactMatrix, exact_kernel, exact_matrix, irrational_nodes
from cra_sym.model.resolved import resolved
from cra_sym.model.symmetry import asymmetry, is_gyroscopic, is_symmetric

if TYPE_CHECKING:
    from cra_sym.mechanics import StateForm
    from cra_sym.mechanics.jets import Jet
    from cra_sym.model.lagrangian import Model

__all__ = ["ball_layout", "ball_problem"]

_ALLOWED = sin, cos, tan, exp, log, sinh, cosh, tanh
_NAMES = ", ".join(function.__name__ for function in _ALLOWED)


def ball_layout(model: Model, damped: bool) -> BallLayout:
    """Return where the coefficients of a model change along x.

    Raises
    ------
    ValueError
        If they do so elsewhere than at the zeros of expressions of first degree in x.
    """
    exact = _exact(model)
    form, entries = _form(exact, damped), _energy(exact, damped)[2]
    x, symbols = form.x, model.symbols
    pairs = []
    for switch in switches([*form.system, *entries], x):
        slope = None if switch.levels else switch.slope(x)
        if slope is None:
            raise _varying(switch.expression)
        pairs += [switch.expression.subs(x, 0), slope]
    left, right = exact.equations.domain
    places = [place for place, _, _ in _acting(form)]
    return BallLayout(*(exact_kernel(_rational(parts), symbols) for parts in ([left, right], places, pairs)))


def ball_problem(model: Model, damped: bool, pattern: Pattern) -> BallProblem:
    """Return the problem of a model in a form that is exact for any kind of number.

    Parameters
    ----------
    model : Model
    damped : bool
        Whether dampers are part of it.
    pattern : Pattern
        As :meth:`BallLayout.cuts` returns it.

    Raises
    ------
    ValueError
        If a coefficient varies along x between these places, or is not a rational function of the parameters.
    """
    exact = _exact(model)
    form = _form(exact, damped)
    fields, orders, entries = _energy(exact, damped)
    x, z, symbols, points = form.x, form.parameter, model.symbols, _acting(form)
    found = switches([*form.system, *entries], x)
    acting, signs = pattern
    parts = [dict(zip((switch.expression for switch in found), sign, strict=True)) for sign in signs]

    def constant(expressions: Iterable[Expr], part: dict[Expr, int]) -> list[Expr]:
        values = [resolved(expression, x, part) for expression in expressions]
        varying = next((value for value in values if value.has(x)), None)
        if varying is not None:
            raise _varying(varying)
        return _rational(values, _ALLOWED)

    def matrix(given: Matrix, part: dict[Expr, int] | None = None) -> ExactMatrix:
        return exact_matrix(Matrix(*given.shape, constant(given, part or {})), z, symbols)

    return BallProblem(
        len(form.displacements),
        len(form.coordinates),
        tuple(((p.unknown, q.unknown), (p.space, q.space)) for p, q in fields),
        orders,
        tuple(matrix(form.system, part) for part in parts),
        tuple(exact_kernel(constant(entries, part), symbols) for part in parts),
        tuple(
            (
                tuple(matrix(points[k][1]) for k in there),
                tuple(sorted({place for k in there for place in points[k][2]})),
            )
            for there in acting
        ),
        matrix(form.boundary),
        exact_kernel(_rational(form.free, _ALLOWED), symbols),
        not form.damped,
        not asymmetry(form),
        form.damped and is_gyroscopic(exact.linearised),
        form.damped and is_symmetric(exact.linearised),
    )


def _exact(model: Model) -> Model:
    """Return the model with fractions in place of its floating-point numbers, with which a derivation would round."""
    rounded = False

    def put(piece: Any) -> Any:
        nonlocal rounded
        if isinstance(piece, (tuple, list)):
            return tuple(map(put, piece))
        numbers = {piece} if isinstance(piece, float) else piece.atoms(Float) if isinstance(piece, Expr) else set()
        rounded |= bool(numbers)
        exact = {number: Rational(number) for number in numbers}
        return piece.xreplace(exact) if isinstance(piece, Expr) else exact.get(piece, piece)

    options = {name: put(piece) for name, piece in model.steady.options.items()}
    return type(model)(**options | {"quadratures": dict(options["quadratures"])}) if rounded else model


def _form(model: Model, damped: bool) -> StateForm:
    return model.state_form if damped else model.conservative


def _acting(form: StateForm) -> list[tuple[Expr, Matrix, tuple[int, ...]]]:
    """Return the terms inside but for loads."""
    return [point for point in form.points if point[2] or any(point[1])]


def _energy(model: Model, damped: bool) -> tuple[list[tuple[Jet, Jet]], tuple[int, ...], list[Expr]]:
    """Return the pairs of displacements of the energy density, the highest orders, and three values of each pair."""
    weak = weak_form(model.linearised.variation)
    powers = (0, 1, 2) if damped else (0, 2)
    orders = {jet.unknown: jet.space for jet in weak.fields()[1]}
    pairs = [pair for pair, entry in weak.inside.items() if not entry.keys().isdisjoint(powers)]
    pairs = [pair for pair in pairs if all(jet.unknown in orders for jet in pair)]
    entries = [weak.inside[p].get(power, S.Zero) if power in powers else S.Zero for p in pairs for power in range(3)]
    return pairs, tuple(orders.values()), entries


def _varying(found: Expr) -> ValueError:
    return ValueError(
        f"system: certification needs coefficients that are constant along x between places, not {found}; "
        "system.accuracy estimates the error of natural_frequencies and eigenvalues, system.check() compares two routes"
    )


def _rational(expressions: Iterable[Expr], allowed: Collection[type[Function]] = ()) -> list[Expr]:
    """Return the expressions, refused unless they are rational functions, or made of the allowed ones and powers."""
    found = list(expressions)
    for entry in found:
        nodes = irrational_nodes(entry)
        refused = {node for node in nodes if not allowed} | {
            node for node in entry.atoms(Function) if not isinstance(node, tuple(allowed))
        }
        if refused:
            name = min(map(str, refused))
            raise ValueError(
                f"system: the coefficients contain {name}: places must be rational functions of the "
                f"parameters, coefficients may have {_NAMES} and powers too; put a parameter in place of {name}"
            )
    return found
