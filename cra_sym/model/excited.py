"""Time-periodic terms of a model: fluctuating parameters, shaken frames, and periodic terms of its own Lagrangian."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any, NamedTuple

from sympy import Derivative, Dummy, Expr, Heaviside, S, Symbol, expand, integrate, sympify
from sympy.core.function import AppliedUndef

from cra_sym.mechanics.hamilton import HamiltonResult
from cra_sym.mechanics.jets import END_NAMES, End, HamiltonError, Jet
from cra_sym.mechanics.periodic import Key, TimeForms, separated, time_forms
from cra_sym.mechanics.variation import Variation, vary
from cra_sym.mechanics.weak import weak_form
from cra_sym.model.forms import form_of, load_of
from cra_sym.model.projection import BilinearForm, Load
from cra_sym.solvers.floquet import Oscillation

if TYPE_CHECKING:
    from cra_sym.model.lagrangian import Model

__all__ = [
    "PeriodicForms",
    "SwungLoad",
    "axial",
    "axial_load",
    "checked_small",
    "fluctuating",
    "fluctuating_loads",
    "fluctuation",
    "periodic_forms",
    "refuse_small",
    "split_options",
    "without_oscillations",
]

Options = dict[str, Any]
Term = tuple[str, Expr, int | None, bool]
Parts = dict[tuple[int, Key], Options]
Cause = tuple[str, int] | None
_TERMS = ("density", "left", "right")


class SwungLoad(NamedTuple):
    """A load that is proportional to an oscillation, and to an input if a cause is named.

    Attributes
    ----------
    cause : (str, int) or None
        Name of a prescribed motion or force, and the order of its derivative by time.
    momentum : bool
        Whether the derivative by time of that product acts, instead of the product.
    load : Load
    """

    cause: tuple[str, int] | None
    momentum: bool
    load: Load


class PeriodicForms(NamedTuple):
    """The terms of a Lagrangian that are proportional to one oscillation.

    Attributes
    ----------
    oscillation : Oscillation
    small : bool
        Whether they are proportional to epsilon.
    matrices : BilinearForm or None
        Stiffness, damping, momentum and mass, where they occur.
    loads : tuple of SwungLoad
    """

    oscillation: Oscillation
    small: bool
    matrices: BilinearForm | None
    loads: tuple[SwungLoad, ...]


# ------------------------------------------------------------------------------------- the Lagrangian's own terms


def checked_small(small: Any, own: tuple[Symbol, Symbol]) -> tuple[Symbol, Symbol] | None:
    """Return (epsilon, varpi), or None if nothing is declared small."""
    if small is None:
        return None
    pair = tuple(small) if isinstance(small, tuple | list) else ()
    if len(pair) != 2 or not all(isinstance(s, Symbol) for s in pair) or len({*pair, *own}) != 4:
        raise TypeError(f"small = {small}: must be two symbols (epsilon, varpi) other than {own[0]} and {own[1]}")
    return pair[0], pair[1]


def refuse_small(small: tuple[Symbol, Symbol] | None, values: Any) -> None:
    """Refuse a value for epsilon or varpi."""
    given = values if isinstance(values, Mapping) else {}
    for symbol in small or ():
        if symbol in given or symbol.name in given:
            raise ValueError(f"values: {symbol} must be left out; growth_rate and stability_boundary take it")


def split_options(options: Options, small: tuple[Symbol, Symbol]) -> tuple[Options, Parts]:
    """Split the arguments of Hamilton's principle: those without oscillating terms, and these terms by oscillation.

    Raises
    ------
    HamiltonError
        Names the argument in which something oscillates that must not, or a term of another form.
    """
    t = options["t"]
    for name in ("domain", "essential"):
        for given in (sympify(given, strict=True) for given in options[name]):
            if given.has(*small):
                raise HamiltonError(
                    f"{name}: {given} must be free of {small[0]} and {small[1]}; only terms and loads may oscillate"
                )
    parts: Parts = {}

    def part(key: tuple[int, Key]) -> Options:
        return parts.setdefault(key, {"density": S.Zero, "left": S.Zero, "right": S.Zero, "inside": [], "work": []})

    still = dict(options)
    for name in _TERMS:
        if options[name] is None:
            continue
        still[name], found = separated(name, sympify(options[name], strict=True), small, t)
        for key, value in found.items():
            part(key)[name] = value
    inside, work = [], []
    for place, term in options["inside"]:
        if sympify(place, strict=True).has(*small):
            raise HamiltonError(f"inside: the place {place} must be free of {small[0]} and {small[1]}")
        rest, found = separated(f"inside at {place}", sympify(term, strict=True), small, t)
        inside.append((place, rest))
        for key, value in found.items():
            part(key)["inside"].append((place, value))
    for force, displacement, place in options["virtual_work"]:
        if sympify(displacement, strict=True).has(*small):
            raise HamiltonError(f"virtual_work: the displacement {displacement} must be free of {small[0]}, {small[1]}")
        rest, found = separated(f"virtual work on {displacement}", sympify(force, strict=True), small, t)
        if rest != 0:
            work.append((rest, displacement, place))
        for key, value in found.items():
            part(key)["work"].append((value, displacement, place))
    return {**still, "inside": tuple(inside), "virtual_work": tuple(work)}, parts


def without_oscillations(model: Model) -> tuple[Model, tuple[PeriodicForms, ...]]:
    """Return the model without its oscillating terms, with the same parameters, and these terms."""
    still, parts = split_options(model.options, model.pieces["small"])
    steady = type(model)(**still | {"quadratures": dict(still["quadratures"])})
    steady.symbols = model.symbols
    return steady, periodic_forms(steady, parts)


def periodic_forms(model: Model, parts: Mapping[tuple[int, Key], Options]) -> tuple[PeriodicForms, ...]:
    """Return the compiled matrices and forces of the oscillating terms; ``model`` is without them.

    Raises
    ------
    HamiltonError
        If a parametric term is not proportional to epsilon, or a force to a higher power of it.
    """
    found = []
    for (epsilons, key), options in parts.items():
        oscillation = Oscillation(*key)
        label = f"{oscillation.kind} of order {oscillation.order}" if oscillation.order else "constant"
        forms = _forms_of(model.linearised, options, label)
        named = forms.named()
        if named and epsilons != 1:
            raise HamiltonError(
                f"small: the parametric terms with the {label} are times epsilon**{epsilons}: they must be times "
                "epsilon to the first power; state the Lagrangian to first order"
            )
        loads = forms.load or forms.discrete_load
        if loads and epsilons > 1:
            raise HamiltonError(
                f"small: the forces with the {label} are times epsilon**{epsilons}; must be to the power 0 or 1"
            )
        weak = weak_form(model.linearised.variation)
        matrices = form_of(weak, named, model.symbols) if named else None
        swung = _loads(model, forms)
        if matrices or swung:
            found.append(PeriodicForms(oscillation, epsilons == 1, matrices, swung))
    return tuple(found)


def _forms_of(equations: HamiltonResult, options: Options, label: str) -> TimeForms:
    """Return the matrices of one part, read like the whole Lagrangian."""
    steady, space = equations.variation, equations.variation.space
    carrier: Expr = sum((_highest(steady, number) for number in range(len(space.fields))), S.Zero)
    ends: dict[End, Expr] = {end: options[end] for end in END_NAMES}
    varied = vary(space, options["density"] + carrier, ends, options["work"], (), options["inside"])
    if any(order > own for order, own in zip(varied.orders, steady.orders, strict=True)):
        raise HamiltonError(f"small: {label} has a higher derivative by {space.x} than what does not oscillate")
    places = [point.place for point in steady.points]
    density = varied.density - space.read(carrier, "domain", "density")
    terms: list[Term] = [("density", density, None, True)]
    terms.append(("end", varied.ends, None, False))
    points = varied.points
    terms += [(f"inside at {point.place}", point.lagrangian, places.index(point.place), False) for point in points]
    return time_forms(space, terms, varied.applied)


def _highest(variation: Variation, number: int) -> Expr:
    """Return a term that has the highest derivative of a field, so that its displacements are known at the ends."""
    jet = Jet(number, variation.orders[number], 0, None)
    return variation.space.form(jet)


def _loads(model: Model, forms: TimeForms) -> tuple[SwungLoad, ...]:
    """Return the loads of periodic terms, apart by what else they are proportional to."""
    weak = weak_form(model.linearised.variation)
    groups: dict[tuple[Cause, bool], tuple[dict[Jet, Expr], dict[Jet, Expr]]] = {}
    for side, given in enumerate((forms.load, forms.discrete_load)):
        for (jet, order), whole in given.items():
            for cause, value in _by_cause(weak.variation.space.restore(whole), weak.variation.space.t).items():
                groups.setdefault((cause, order == 1), ({}, {}))[side][jet] = value
    return tuple(
        SwungLoad(cause, momentum, load_of(weak, inside, ends, model.symbols))
        for (cause, momentum), (inside, ends) in groups.items()
    )


def _by_cause(load: Expr, t: Symbol) -> dict[Cause, Expr]:
    """Return the coefficients of a load by the input, and its derivative, that they multiply; None: by none.

    Raises
    ------
    HamiltonError
        Names a load that is not linear in the inputs.
    """
    given = expand(load.doit())
    inputs = {node: Dummy() for node in given.atoms(Derivative)}
    inputs |= {node: Dummy() for node in given.xreplace(inputs).atoms(AppliedUndef)}
    linear = given.xreplace(inputs)
    found: dict[Cause, Expr] = {None: linear.xreplace(dict.fromkeys(inputs.values(), S.Zero))}
    for node, mark in inputs.items():
        function, order = (node.expr, node.derivative_count) if isinstance(node, Derivative) else (node, 0)
        found[function.func.__name__, int(order)] = linear.diff(mark)
    if any(value.has(t, *inputs.values()) for value in found.values()):
        raise HamiltonError(f"small: the load {load} must be linear in prescribed motions and forces")
    return {cause: value for cause, value in found.items() if value != 0}


# ------------------------------------------------------------------------------------------ fluctuating parameters


def fluctuation(model: Model, name: str) -> str:
    """Return why a parameter cannot fluctuate about its value in a parametric excitation, or an empty text."""
    variation = model.linearised.variation
    symbol = next(s for s in model.symbols if s.name == name)
    places = [*variation.space.ends.values(), *(point.place for point in variation.points)]
    if any(place.has(symbol) for place in places):
        return "is a length"
    forms = _derivative_by(variation, symbol).named()
    if not forms:
        return "changes neither stiffness, damping nor mass"
    values = (value for pair in forms.values() for part in pair for entry in part.values() for value in entry.values())
    return "does not enter the Lagrangian linearly" if any(value.has(symbol) for value in values) else ""


def fluctuating(model: Model, name: str) -> tuple[BilinearForm, tuple[str, ...]]:
    """Return the matrices that a unit of a parameter gives, and the parameters they depend on."""
    variation = model.linearised.variation
    named = _derivative_by(variation, next(s for s in model.symbols if s.name == name)).named()
    values = (value for pair in named.values() for part in pair for entry in part.values() for value in entry.values())
    used = sorted({symbol.name for value in values for symbol in value.free_symbols if isinstance(symbol, Symbol)})
    form = form_of(weak_form(variation), named, model.symbols)
    return form, tuple(name for name in used if name in {s.name for s in model.symbols})


def fluctuating_loads(model: Model, name: str) -> tuple[SwungLoad, ...]:
    """Return the loads that a unit of a parameter gives, such as the weight of a mass and its inertia on a base."""
    variation = model.linearised.variation
    return _loads(model, _derivative_by(variation, next(s for s in model.symbols if s.name == name)))


def _derivative_by(variation: Variation, symbol: Symbol) -> TimeForms:
    """Return the derivative of all matrices by a parameter."""
    terms: list[Term] = [("density", variation.density.diff(symbol), None, True)]
    terms.append(("end", variation.ends.diff(symbol), None, False))
    terms += [("inside", point.lagrangian.diff(symbol), k, False) for k, point in enumerate(variation.points)]
    applied = [(force.diff(symbol), jet, per_length) for force, jet, per_length in variation.applied]
    return time_forms(variation.space, terms, applied, linearise=True)


# ------------------------------------------------------------------------------------------------- shaken frames


def axial(model: Model) -> BilinearForm:
    """Return the stiffness that a unit acceleration of the frame along x, towards the right, gives the first field.

    All mass that moves across the domain is also accelerated along it: the inertia of the mass beyond x, the right end
    included, does work on the foreshortening v_x^2 / 2 there, so that (36b) follows from the kinetic energy. A mass m
    that an end carries
    on a rigid lever e, of velocity v_t + e v_xt, adds m e v_x^2 / 2; m e is its coupling of both.
    """
    weak = weak_form(model.linearised.variation)
    slope = Jet(0, 1, 0, None)
    levers: dict[tuple[Jet, Jet], dict[int, Expr]] = {}
    for end in (*END_NAMES, *range(len(weak.points))):
        displacement, turn = Jet(0, 0, 0, end), Jet(0, 1, 0, end)
        moment = weak.discrete.get((displacement, turn), {}).get(2, S.Zero)
        if moment != 0:
            levers[turn, turn] = {0: moment}
    return form_of(weak, {"axial": ({(slope, slope): {0: axial_load(model)}}, levers)}, model.symbols)


def axial_load(model: Model) -> Expr:
    """Return the compression at x due to a unit acceleration of the frame along x: the mass beyond x.

    Raises
    ------
    ValueError
        If a lumped coordinate carries a mass whose position along x is not known.
    """
    weak = weak_form(model.linearised.variation)
    space = weak.variation.space
    field, tip = Jet(0, 0, 0, None), Jet(0, 0, 0, "right")
    density = weak.inside.get((field, field), {}).get(2, S.Zero)
    place = Dummy("x")
    beyond = integrate(density.subs(space.x, place), (place, space.x, space.ends["right"]))
    load = beyond + weak.ends.get((tip, tip), {}).get(2, S.Zero)
    for point in weak.points:
        load += point.form.get((field, field), {}).get(2, S.Zero) * Heaviside(point.place - space.x)
    for number, unknown in enumerate(space.unknowns):
        lumped = Jet(number, 0, 0, None)
        if space.is_field(number) or weak.discrete.get((lumped, lumped), {}).get(2, S.Zero) == 0:
            continue
        if not any(lumped in pair and 2 in orders for pair, orders in weak.inside.items()):
            raise ValueError(
                f"axial: the place along x of the mass that moves by {unknown} is not known; state the work of the "
                "axial load in the Lagrangian and let its amplitude fluctuate"
            )
    return load
