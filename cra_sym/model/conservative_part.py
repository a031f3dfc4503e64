"""The part of a model that has natural modes: no gyroscopic terms, no forces that follow the motion."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from sympy import Add, Basic, Derivative, Expr, Mul, Poly, S, Subs, Symbol, expand, hessian, sympify
from sympy.core.function import AppliedUndef

from cra_sym.mechanics.jets import END_NAMES
from cra_sym.mechanics.weak import Bilinear, weak_form
from cra_sym.model.forms import form_of
from cra_sym.model.projection import BilinearForm

if TYPE_CHECKING:
    from cra_sym.model.lagrangian import Model

_ROUNDING = 1e-12  # eigenvalue of a form, relative to its entries, that counts as zero
__all__ = ["beside", "conservative_part", "elastic_part", "stiffness_beside"]


def conservative_part(model: Model) -> Model | None:
    """Return the model without terms that are odd in time and without virtual work.

    None if the model itself has natural modes already.

    Dampers alone do not count, since natural frequencies leave them out anyway. With follower forces only the potential
    energy of the highest derivatives is kept: without these forces the structure may buckle under its other loads.
    """
    return _part(model, leading=_follows(model))


def elastic_part(model: Model) -> Model | None:
    """Return the same with no more than the potential energy of the highest derivatives along the span.

    Gyroscopic terms may stabilise a structure that buckles without them, as under the centrifugal forces of rotation.
    Of ends, interior places and coordinates it keeps the potential energies that are not negative for positive
    parameters. Lumped coordinates alone have one of the form of their kinetic energy instead: all frequencies are
    1 rad/s.
    """
    part = _part(model, leading=True)
    if part is None:
        return None
    options, change = part.options, _resisting if part.options["fields"] else _standing
    found = part.replace(
        **{end: change(options[end], options["t"]) for end in END_NAMES},
        inside=tuple((place, change(term, options["t"])) for place, term in options["inside"]),
    )
    found.symbols = model.symbols
    return found


def _resisting(energy: Expr | None, t: Symbol) -> Expr | None:
    """Return the terms of a Lagrangian with rates, and of the others those with a coefficient that make no motion grow.

    These are quadratic forms in displacements, minus a sum of squares.
    """
    if energy is None:
        return None
    moving, forms = S.Zero, dict[Expr, Expr]()
    for term in Add.make_args(expand(energy)):
        if any(node.has(t) and t in node.variables for node in term.atoms(Derivative)):
            moving += term
            continue
        number, factors = term.as_coeff_mul()
        coefficient = Mul(*(factor for factor in factors if not factor.has(AppliedUndef)))
        forms[coefficient] = forms.get(coefficient, S.Zero) + number * Mul(*(f for f in factors if f.has(AppliedUndef)))
    return moving + Add(*(coefficient * form for coefficient, form in forms.items() if _never_positive(form)))


def _never_positive(form: Expr) -> bool:
    """Tell whether an expression in displacements is a quadratic form without positive eigenvalues."""
    inner = [node for node in form.atoms(AppliedUndef, Derivative, Subs)]
    places = [node for node in inner if not any(node != other and other.has(node) for other in inner)]
    read = Poly(form, *places)
    if not read.is_homogeneous or read.total_degree() != 2:
        return False
    matrix = np.array(hessian(form, places), dtype=float)
    return bool(np.linalg.eigvalsh(matrix).max() <= _ROUNDING * np.abs(matrix).max())


def _standing(energy: Expr | None, _t: Symbol) -> Expr | None:
    """Return the kinetic energy in a Lagrangian, minus the same of displacements in place of their rates."""
    if energy is None:
        return None
    kinetic = Add(*(term for term in Add.make_args(expand(energy)) if term.has(Derivative)))
    return kinetic - kinetic.xreplace({rate: rate.expr for rate in kinetic.atoms(Derivative)})


def _follows(model: Model) -> bool:
    """Tell whether forces of the virtual work follow the motion, dampers apart."""
    unknowns = {function.func for function in (*model.options["fields"], *model.options["coordinates"])}
    forces = (sympify(force, strict=True) for force, *_ in model.undamped_work())
    return any(function.func in unknowns for force in forces for function in force.atoms(AppliedUndef))


def _part(model: Model, *, leading: bool) -> Model | None:
    try:
        _ = model.conservative
    except ValueError:
        pass
    else:
        return None
    options, t = model.options, model.options["t"]
    density = _leading(model) if leading else options["density"]

    def even(expression: Expr | None) -> Expr | None:
        if expression is None:
            return None
        terms = Add.make_args(expand(sympify(expression, strict=True)))
        return sum((term for term in terms if not _is_odd_in_time(term, t)), S.Zero)

    changes: dict[str, Any] = {"density": even(density)} | {end: even(options[end]) for end in END_NAMES}
    inside = tuple((place, even(term)) for place, term in options["inside"])
    changes |= {"inside": inside, "virtual_work": (), "quadratures": dict(options["quadratures"])}
    found = type(model)(**{**options, **changes})
    found.symbols = model.symbols
    return found


def _leading(model: Model) -> Expr:
    """Return the density without the energy of displacements that are not the highest derivatives of their fields."""
    variation = model.linearised.variation
    space, orders = variation.space, variation.orders

    def is_kept(term: Expr) -> bool:
        return all(j.time or (space.is_field(j.unknown) and j.space == orders[j.unknown]) for j in space.jets(term))

    return space.restore(Add(*(term for term in Add.make_args(expand(variation.density)) if is_kept(term))))


def _is_odd_in_time(term: Expr, t: Symbol) -> bool:
    """Tell whether a term of a Lagrangian changes sign when time runs backwards."""
    odd = {node for node in term.atoms(Derivative) if sum(n for s, n in node.variable_count if s == t) % 2}
    return bool(odd) and expand(term.xreplace({node: -node for node in odd}) + term) == 0


def beside(model: Model, part: Model) -> set[Basic]:
    """Return the symbols of the terms that the conservative part leaves out."""
    own = [(model.options[name], part.options[name]) for name in ("density", *END_NAMES)]
    own += [(mine[1], left[1]) for mine, left in zip(model.options["inside"], part.options["inside"], strict=True)]
    rest = [expand((whole or S.Zero) - (left or S.Zero)) for whole, left in own]
    rest += [expand(force) for force, *_ in model.options["virtual_work"]]
    return set().union(*(term.free_symbols for term in rest))


def stiffness_beside(model: Model, *, elastic: bool = False) -> BilinearForm | None:
    """Return the stiffness of the model minus that of its conservative, or elastic, part; None if they agree."""
    part = elastic_part(model) if elastic else conservative_part(model)
    if part is None:
        return None
    whole, own = weak_form(model.linearised.variation), weak_form(part.linearised.variation)
    parts = _stiffness_difference(whole.inside, own.inside), _stiffness_difference(whole.discrete, own.discrete)
    return form_of(whole, {"stiffness": parts}, model.symbols) if any(parts) else None


def _stiffness_difference(whole: Bilinear, own: Bilinear) -> Bilinear:
    found: Bilinear = {}
    for pair in {**whole, **own}:
        value = expand(whole.get(pair, {}).get(0, S.Zero) - own.get(pair, {}).get(0, S.Zero))
        if value != 0:
            found[pair] = {0: value}
    return found
