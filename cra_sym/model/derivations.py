"""Derivations from a Lagrangian for the analyses: each function takes a model, derives one quantity and compiles it."""

from __future__ import annotations

from dataclasses import replace

from sympy import Expr, S, Symbol, cancel, integrate

from cra_sym.kernels import Kernel, kernel
from cra_sym.mechanics.breakpoints import derivative
from cra_sym.mechanics.jets import END_NAMES, Jet
from cra_sym.mechanics.weak import Bilinear, WeakForm, weak_form
from cra_sym.model.ball_coefficients import ball_layout, ball_problem
from cra_sym.model.breaks import Breaks, breaks
from cra_sym.model.conservative_part import beside, conservative_part, elastic_part, stiffness_beside
from cra_sym.model.driven import driven, driven_coordinate, driven_displacement, driven_spatial, pushed
from cra_sym.model.energies import stress_route
from cra_sym.model.energy_signs import leading, masses
from cra_sym.model.excited import axial, fluctuating, fluctuating_loads, fluctuation
from cra_sym.model.forms import form_of
from cra_sym.model.held_motions import HeldMotions, moving_supports
from cra_sym.model.held_motions import held_motions as motions_held
from cra_sym.model.lagrangian import Model
from cra_sym.model.loads import causes, constant, load, load_of_order, loads
from cra_sym.model.moving import jumps
from cra_sym.model.nonlinear import nonlinear
from cra_sym.model.observables import named_observables, observable
from cra_sym.model.one_wave import one_wave_route
from cra_sym.model.pencil_route import complex_modes, inertia
from cra_sym.model.pencil_route import pencil_route as pencil
from cra_sym.model.projection import BilinearForm, EndParameter
from cra_sym.model.routes import GeneralRoute, Route
from cra_sym.model.spatial import SpatialProblem, spatial_problem
from cra_sym.model.symmetry import asymmetry
from cra_sym.model.waves import waves_route

__all__ = [
    "axial",
    "ball_layout",
    "ball_problem",
    "causes",
    "complex_modes",
    "conservative_part",
    "constant",
    "damping",
    "driven",
    "driven_coordinate",
    "driven_displacement",
    "driven_spatial",
    "elastic_part",
    "fluctuating",
    "fluctuating_loads",
    "fluctuation",
    "geometry",
    "held_motions",
    "inertia",
    "leading",
    "load",
    "load_of_order",
    "loads",
    "masses",
    "moving_supports",
    "named_observables",
    "names",
    "nonlinear",
    "observable",
    "pencil",
    "pushed",
    "rates",
    "route",
    "section_breaks",
    "spatial",
    "stiffness_beside",
    "stiffness_beside_elastic",
]


def names(model: Model) -> tuple[str, ...]:
    """Return the names of the parameters."""
    return tuple(symbol.name for symbol in model.symbols)


def geometry(model: Model) -> Kernel:
    """Return length and left end of the domain as functions of the parameters."""
    left, right = model.equations.domain
    return kernel((right - left, left), model.symbols, backend="numpy")


def length_name(model: Model) -> str:
    """Return the length of the domain as text."""
    left, right = model.equations.domain
    return str(right - left)


def spatial(model: Model) -> SpatialProblem:
    """Return the conservative spatial problem, dampers left out."""
    return spatial_problem(model.conservative, model.symbols, model.equations.domain[0])


def section_breaks(model: Model) -> Breaks | None:
    """Return where coefficients along x jump and where interior terms are; None if there are neither."""
    weak = weak_form(model.linearised.variation)
    places = [point.place for point in weak.points]
    along = [value for entry in weak.inside.values() for value in entry.values() if value.has(weak.variation.space.x)]
    return breaks(along, weak.variation.space.x, model.symbols, places) if places or along else None


def damped_spatial(model: Model) -> SpatialProblem:
    """Return the spatial problem with all forces, dampers included."""
    return spatial_problem(model.state_form, model.symbols, model.equations.domain[0])


def route(model: Model) -> Route:
    """Return the fastest way to natural frequencies and modes that the Lagrangian allows."""
    form, left = model.conservative, model.equations.domain[0]
    compiled = model.numerics("spatial")
    if not compiled.uniform:
        return stress_route(model, compiled) or GeneralRoute(compiled)
    fast = one_wave_route(form, model.symbols, left) or waves_route(form, compiled, model.symbols)
    return fast or GeneralRoute(compiled)


def held_motions(model: Model) -> HeldMotions:
    """Return the conditions of ends and coordinates whose direction depends on a parameter."""
    return motions_held(model.conservative, model.symbols)


def general_route(model: Model) -> Route:
    """Return the route that is valid for all values."""
    return GeneralRoute(model.numerics("spatial"))


# Bilinear forms --------------------------------------------------------------------------------------------------


def damping(model: Model) -> BilinearForm | None:
    """Return the damping of a model between its modes, or None if it has none."""
    weak = weak_form(model.linearised.variation)
    if 1 not in weak.powers:
        return None
    parts = tuple({pair: {1: e[1]} for pair, e in part.items() if 1 in e} for part in (weak.inside, weak.discrete))
    return form_of(weak, {"damping": (parts[0], parts[1])}, model.symbols)


def rates(model: Model) -> BilinearForm:
    """Return stiffness and mass, and their rates by every parameter ('k_t stiffness', 'k_t mass').

    Displacements are held fixed as functions of the distance from the left end over the length, so that the rate of a
    squared natural frequency is the difference of the two, mass times omega^2, for every parameter, those of the
    domain included.
    """
    weak = weak_form(model.linearised.variation)
    kinds = {"stiffness": 0, "mass": 2}
    named: dict[str, tuple[Bilinear, Bilinear]] = {
        kind: (_power(weak.inside, power), _power(weak.discrete, power)) for kind, power in kinds.items()
    }
    for symbol in model.symbols:
        for kind in kinds:
            inside, ends = named[kind]
            named[f"{symbol.name} {kind}"] = _rate(weak, inside, symbol, 1), _rate(weak, ends, symbol, 0)
    form, found = form_of(weak, named, model.symbols), model.numerics("spatial").breaks
    if found is None:
        return form
    left, right = model.equations.domain
    return replace(form, jumps=jumps(found, left, right - left, model.symbols))


def _power(form: Bilinear, power: int) -> Bilinear:
    return {pair: {power: entry[power]} for pair, entry in form.items() if power in entry}


def _rate(weak: WeakForm, form: Bilinear, symbol: Symbol, dimension: int) -> Bilinear:
    """Return the derivative of a form by a parameter, displacements fixed as functions of (x - left) / length."""
    space = weak.variation.space
    left, right = (space.ends[end] for end in END_NAMES)
    length = right - left
    drift = left.diff(symbol) + (space.x - left) / length * length.diff(symbol)
    found: Bilinear = {}
    for (p, q), entry in form.items():
        orders = sum(jet.space for jet in (p, q))
        for power, value in entry.items():
            rate = derivative(value, symbol) + value * (dimension - orders) * length.diff(symbol) / length
            rate += derivative(value, space.x) * drift if dimension else S.Zero
            if rate != 0:
                _add(found, (p, q), power, rate)
            for jet, pair in (
                (p, (p._replace(space=p.space + 1), q)),
                (q, (p, q._replace(space=q.space + 1))),
            ):
                if isinstance(jet.place, int):
                    place = weak.place(jet)
                    moved = value * (place.diff(symbol) - drift.subs(space.x, place))
                    if moved != 0:
                        _add(found, pair, power, moved)
    return found


def _add(form: Bilinear, pair: tuple[Jet, Jet], power: int, value: Expr) -> None:
    entry = form.setdefault(pair, {})
    entry[power] = entry.get(power, S.Zero) + value


def carried(model: Model, name: str) -> Kernel:
    """Return the kernel of the rigid-body (mass, damping, stiffness) that a prescribed motion sees."""
    return kernel(carried_by(model, name), model.symbols, backend="numpy")


def carried_by(model: Model, name: str) -> tuple[Expr, ...]:
    """Return the rigid-body mass, damping and stiffness that a prescribed motion sees."""
    freed = model.freed(name)
    weak = weak_form(freed.linearised.variation)
    space = weak.variation.space
    number = next(k for k, u in enumerate(space.unknowns) if u.func.__name__ == name)
    jet = Jet(number, 0, 0, None)
    for pair, entry in (*weak.inside.items(), *weak.discrete.items()):
        if pair[0] == jet != pair[1] and set(entry) - {2}:
            raise ValueError(f"{name}: a force on it depends on {space.form(pair[1])} by more than its acceleration")
    left, right = (space.ends[end] for end in END_NAMES)
    inside, discrete = weak.inside.get((jet, jet), {}), weak.discrete.get((jet, jet), {})
    return tuple(
        integrate(inside.get(order, S.Zero), (space.x, left, right)) + discrete.get(order, S.Zero)
        for order in (2, 1, 0)
    )


def sizes(model: Model) -> tuple[int, int]:
    """Return the numbers of displacements of a section and of lumped coordinates."""
    return len(model.state_form.displacements), len(model.state_form.coordinates)


def slope_place(model: Model) -> int | None:
    """Return the position of the first field's slope among the displacements of a section, or None."""
    field, x = model.equations.fields[0], model.equations.x
    found = [str(displacement) for displacement in model.state_form.displacements]
    slope = str(field.diff(x))
    return found.index(slope) if slope in found else None


def stiffnesses(model: Model) -> dict[str, EndParameter]:
    """Return the parameters that are, up to a factor, the stiffness of one displacement of an end, by name.

    Of a model without natural modes those of its conservative part that stand nowhere else.
    """
    return _end_parameters(model)


def inertias(model: Model) -> dict[str, EndParameter]:
    """Return the parameters that are, up to a factor, the inertia of one displacement of an end, by name."""
    return _end_parameters(model, inertia=True)


def _end_parameters(model: Model, *, inertia: bool = False) -> dict[str, EndParameter]:
    """Return the parameters that add a positive multiple of themselves to the stiffness or the inertia of one entry.

    In the order of the displacements, the left end first.
    """
    part: Model | None = model.numerics("conservative_part")
    elsewhere = set() if part is None else {symbol.name for symbol in beside(model, part)}
    form = (part or model).conservative
    unit = -form.parameter if inertia else S.One
    n, m = len(form.displacements), len(form.coordinates)
    inside = form.system.free_symbols | form.length.free_symbols | form.free.free_symbols
    found = {}
    for symbol in model.symbols:
        entries = [(k, entry / unit) for k, entry in enumerate(form.boundary.diff(symbol)) if entry != 0]
        if symbol in inside or symbol.name in elsewhere or len(entries) != 1:
            continue
        (row, column), factor = divmod(entries[0][0], 2 * n + m), cancel(entries[0][1])
        if row != column or n <= row < n + m or factor.has(symbol, form.parameter) or factor.is_negative:
            continue
        end, place = (0, row) if row < n else (1, row - n - m)
        found[symbol.name] = EndParameter(end, place, kernel(factor, model.symbols, backend="numpy"))
    return dict(sorted(found.items(), key=lambda item: item[1][:2]))


def stiffness_beside_elastic(model: Model) -> BilinearForm | None:
    """Return the stiffness of a model minus that of its elastic part; None if they agree."""
    return stiffness_beside(model, elastic=True)


def damped(model: Model) -> bool:
    """Return whether the Lagrangian or the virtual work has terms of first order in time."""
    return model.state_form.damped


def conservative(model: Model) -> bool:
    """Return whether all forces have a potential and none is of first order in time."""
    return not model.state_form.damped and not asymmetry(model.state_form)
