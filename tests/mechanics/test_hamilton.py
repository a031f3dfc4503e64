"""Hamilton's principle against hand-derived equations, SymPy's Euler operator and the first variation of the action."""

from __future__ import annotations

import random

import pytest
from sympy import (
    Abs,
    Derivative,
    DiracDelta,
    Eq,
    Function,
    Integral,
    Poly,
    Rational,
    Subs,
    Symbol,
    cos,
    euler_equations,
    exp,
    expand,
    sqrt,
    symbols,
)

from cra_sym.mechanics import HamiltonError, hamilton
from cra_sym.mechanics.steps import compact_latex

x, t = symbols("x t")
L, rho, A, E, I, k_t, k_r, m_e, J_e, m_b = symbols("L rho A E I k_t k_r m_e J_e m_b")
v, psi = Function("v")(x, t), Function("psi")(x, t)
w, F = Function("w")(t), Function("F")(t)
BEAM = rho * A * v.diff(t) ** 2 / 2 - E * I * v.diff(x, 2) ** 2 / 2


def arm(coordinates=(), **options):
    density = rho * A * (w.diff(t) + v.diff(t)) ** 2 / 2 - E * I * v.diff(x, 2) ** 2 / 2
    left = -k_t * v**2 / 2 - k_r * v.diff(x) ** 2 / 2 + (m_b * w.diff(t) ** 2 / 2 if coordinates else 0)
    right = m_e * (w.diff(t) + v.diff(t)) ** 2 / 2 + J_e * v.diff(x, t) ** 2 / 2
    return hamilton(
        density, fields=[v], coordinates=coordinates, x=x, domain=(0, L), t=t, left=left, right=right, **options
    )


def at(expression, end):
    return expression.subs(x, end)


# ------------------------------------------------------------------------------------------------- known equations


def test_the_arm():
    result = arm()
    (field,) = result.field_equations
    assert field == Eq(rho * A * (w.diff(t, 2) + v.diff(t, 2)) + E * I * v.diff(x, 4), 0)
    assert result.boundary_conditions == (
        Eq(E * I * at(v.diff(x, 3), 0), -k_t * at(v, 0)),
        Eq(E * I * at(v.diff(x, 2), 0), k_r * at(v.diff(x), 0)),
        Eq(E * I * at(v.diff(x, 3), L), m_e * (w.diff(t, 2) + at(v.diff(t, 2), L))),
        Eq(E * I * at(v.diff(x, 2), L), -J_e * at(v.diff(x, t, t), L)),
    )
    assert [condition.end for condition in result.boundary_conditions] == ["left", "left", "right", "right"]
    assert [condition.displacement for condition in result.boundary_conditions] == [
        at(v, 0),
        at(v.diff(x), 0),
        at(v, L),
        at(v.diff(x), L),
    ]
    assert result.coordinate_equations == ()


def test_the_base_moves_as_a_coordinate():
    (equation,) = arm([w], virtual_work=[(F, w, None)]).coordinate_equations
    total = (m_b + m_e + rho * A * L) * w.diff(t, 2) + m_e * at(v.diff(t, 2), L)
    assert expand(equation.lhs - total) == Integral(A * rho * v.diff(t, 2), (x, 0, L))
    assert equation.rhs == F


def test_evaluated_and_unevaluated_end_terms_are_the_same():
    xi = Symbol("xi")
    evaluated = hamilton(
        BEAM,
        fields=[v],
        x=x,
        domain=(0, L),
        t=t,
        left=-k_t * at(v, 0) ** 2 / 2 - k_r * Subs(Derivative(v.subs(x, xi), xi), xi, 0) ** 2 / 2,
        right=m_e * at(v.diff(t), L) ** 2 / 2 + J_e * at(v.diff(x, t), L) ** 2 / 2,
    )
    plain = hamilton(
        BEAM,
        fields=[v],
        x=x,
        domain=(0, L),
        t=t,
        left=-k_t * v**2 / 2 - k_r * v.diff(x) ** 2 / 2,
        right=m_e * v.diff(t) ** 2 / 2 + J_e * v.diff(x, t) ** 2 / 2,
    )
    assert evaluated.equations == plain.equations


def test_an_explicit_coordinate_in_an_end_term_is_that_end():
    result = hamilton(BEAM, fields=[v], x=x, domain=(-1, L), t=t, left=-x * v**2 / 2, right=-(x**2) * v**2 / 2)
    assert result.boundary_conditions[0].rhs == at(v, -1)
    assert result.boundary_conditions[2].rhs == L**2 * at(v, L)


def test_virtual_work_replaces_springs_and_masses():
    works = [
        (-k_t * v, v, "left"),
        (-k_r * v.diff(x), v.diff(x), "left"),
        (-m_e * (w + v).diff(t, 2), at(v, L), "right"),
        (-J_e * v.diff(x, t, t), at(v.diff(x), L), None),
    ]
    density = rho * A * (w.diff(t) + v.diff(t)) ** 2 / 2 - E * I * v.diff(x, 2) ** 2 / 2
    result = hamilton(density, fields=[v], x=x, domain=(0, L), t=t, virtual_work=works)
    assert result.equations == arm().equations


def test_kelvin_voigt_and_a_distributed_load():
    c, p = Symbol("c"), Function("p")(x, t)
    result = hamilton(
        BEAM,
        fields=[v],
        x=x,
        domain=(0, L),
        t=t,
        virtual_work=[(-c * v.diff(x, 2, t), v.diff(x, 2), "domain"), (p, v, "domain")],
    )
    assert expand(result.field_equations[0].rhs - p + c * v.diff(x, 4, t)) == 0
    assert result.boundary_conditions[1].lhs == E * I * at(v.diff(x, 2), 0) + c * at(v.diff(x, 2, t), 0)


def test_timoshenko():
    kGA = Symbol("kGA")
    density = rho * (A * v.diff(t) ** 2 + I * psi.diff(t) ** 2) / 2
    density -= (E * I * psi.diff(x) ** 2 + kGA * (v.diff(x) - psi) ** 2) / 2
    result = hamilton(density, fields=[v, psi], x=x, domain=(0, L), t=t, left=-k_t * v**2 / 2 - k_r * psi**2 / 2)
    first, second = result.field_equations
    assert expand(first.lhs - rho * A * v.diff(t, 2) + kGA * (v.diff(x, 2) - psi.diff(x))) == 0
    assert expand(second.lhs - rho * I * psi.diff(t, 2) + E * I * psi.diff(x, 2) + kGA * (v.diff(x) - psi)) == 0
    shear, moment, *free = result.boundary_conditions
    assert expand(shear.lhs - kGA * (at(v.diff(x), 0) - at(psi, 0))) == 0
    assert shear.rhs == k_t * at(v, 0)
    assert moment == Eq(E * I * at(psi.diff(x), 0), k_r * at(psi, 0))
    assert all(condition.rhs == 0 for condition in free)


def test_taper_keeps_the_derivatives_of_its_stiffness():
    B = Function("B")(x)
    result = hamilton(rho * v.diff(t) ** 2 / 2 - B * v.diff(x, 2) ** 2 / 2, fields=[v], x=x, domain=(0, L), t=t)
    assert expand(result.field_equations[0].lhs - rho * v.diff(t, 2) - (B * v.diff(x, 2)).diff(x, 2).doit()) == 0


# --------------------------------------------------------------------------------------------- essential conditions


def test_essential_conditions_remove_their_natural_partner():
    result = hamilton(BEAM, fields=[v], x=x, domain=(0, L), t=t, essential=[at(v, 0), at(v.diff(x), 0)])
    kinds = [condition.kind for condition in result.boundary_conditions]
    assert kinds == ["essential", "essential", "natural", "natural"]
    assert result.boundary_conditions[0] == Eq(at(v, 0), 0)
    assert result.boundary_conditions[1] == Eq(at(v.diff(x), 0), 0)


def test_a_tied_displacement_hands_its_reaction_on():
    # absolute displacement v, clamped to a base that moves with w: the base feels the shear force at the root
    result = hamilton(
        BEAM,
        fields=[v],
        coordinates=[w],
        x=x,
        domain=(0, L),
        t=t,
        left=m_b * w.diff(t) ** 2 / 2,
        virtual_work=[(F, w, None)],
        essential=[at(v, 0) - w, at(v.diff(x), 0)],
    )
    assert result.boundary_conditions[0] == Eq(at(v, 0), w)
    (equation,) = result.coordinate_equations
    assert equation.lhs == m_b * w.diff(t, 2)
    assert expand(equation.rhs - F + E * I * at(v.diff(x, 3), 0)) == 0


def test_a_rolling_end_couples_displacement_and_slope():
    # v(L) = -r v_x(L): only the resultant of shear and moment along the free motion vanishes
    r = Symbol("r")
    result = hamilton(BEAM, fields=[v], x=x, domain=(0, L), t=t, essential=[at(v, L) + r * at(v.diff(x), L)])
    essential, natural = result.boundary_conditions[2:]
    assert essential == Eq(at(v, L), -r * at(v.diff(x), L))
    moment, shear = -E * I * at(v.diff(x, 2), L), E * I * at(v.diff(x, 3), L)
    assert expand(natural.lhs - natural.rhs + (moment - r * shear)) == 0


@pytest.mark.parametrize(
    ("essential", "words"),
    [
        ([at(v, 0), 2 * at(v, 0)], "follows from or contradicts"),
        ([at(v, 0), at(v, 0) - 1], "follows from or contradicts"),
        ([at(v.diff(t), 0)], "time derivatives"),
        ([at(v.diff(x, 2), 0)], "natural"),
        ([v], "not evaluated at an end"),
        ([at(v, 0) ** 2], "linear"),
        ([k_t], "no displacement"),
    ],
)
def test_essential_conditions_that_make_no_sense(essential, words):
    with pytest.raises(HamiltonError, match=words):
        hamilton(BEAM, fields=[v], x=x, domain=(0, L), t=t, essential=essential)


# ------------------------------------------------------------------------------------------------------ second route


def integral(polynomial, variable, lower, upper):
    primitive = Poly(polynomial, variable).integrate()
    return primitive.eval(upper) - primitive.eval(lower)


def first_variation(arguments, motion, perturbation):
    """Return the variation of the action plus the virtual work over t in (0, 1) as a number."""
    epsilon = Symbol("epsilon")
    a, b = arguments["domain"]
    moved = {name: path + epsilon * perturbation[name] for name, path in motion.items()}

    def inserted(expression, paths):
        return expression.subs(paths).doit()

    def over_time(expression):
        return integral(expression, t, 0, 1)

    def slope(expression):
        return inserted(expression, moved).diff(epsilon).subs(epsilon, 0)

    total = over_time(integral(slope(arguments["density"]), x, a, b))
    total += over_time(slope(arguments.get("left", 0) + 0 * v).subs(x, a))
    total += over_time(slope(arguments.get("right", 0) + 0 * v).subs(x, b))
    for force, displacement, place in arguments.get("virtual_work", ()):
        work = inserted(force, motion) * slope(displacement)
        total += over_time(integral(work, x, a, b) if place == "domain" else work.subs(x, {"left": a}.get(place, b)))
    return total


def weak_residual(result, motion, perturbation):
    """Return the same from the equations: each residual times the variation it belongs to."""
    a, b = result.domain
    total = 0

    def over_time(expression):
        return integral(expression, t, 0, 1)

    for field, equation in zip(result.fields, result.field_equations, strict=True):
        residual = (equation.rhs - equation.lhs).subs(motion).doit()
        total += over_time(integral(residual * perturbation[field], x, a, b))
    for coordinate, equation in zip(result.coordinates, result.coordinate_equations, strict=True):
        total += over_time(at_end(equation.rhs - equation.lhs, motion, b) * perturbation[coordinate])
    for end in ("left", "right"):
        for field in result.fields:
            own = [c for c in result.boundary_conditions if c.end == end and c.displacement.has(field.func)]
            for order, condition in enumerate(own):
                # the sign that makes the elastic coefficient on the left-hand side positive
                sign = (-1) ** (len(own) - order) * (1 if end == "right" else -1)
                point = {"left": a, "right": b}[end]
                residual = at_end(condition.lhs - condition.rhs, motion, point)
                total += over_time(sign * residual * perturbation[field].diff(x, order).subs(x, point))
    return total


def at_end(expression, motion, point):
    """Insert paths into evaluated forms such as v(1, t) and Subs(v_x, x, 1)."""
    values = {unknown.subs(x, point): path.subs(x, point) for unknown, path in motion.items()}
    return expression.subs({**motion, **values}).doit()


def polynomials(unknowns, generator, flat):
    paths = {}
    for unknown in unknowns:
        in_x = sum(generator.randint(-3, 3) * x**n for n in range(4)) + x**4 if unknown.has(x) else 1
        in_t = generator.randint(1, 3) * t**2 * (1 - t) ** 2 if flat else 1 + generator.randint(-2, 2) * t + t**3
        paths[unknown] = in_x * in_t
    return paths


CASES = {
    "string": {
        "density": 3 * v.diff(t) ** 2 / 2 - (2 + x) * v.diff(x) ** 2 / 2,
        "fields": [v],
        "left": -5 * v**2 / 2,
        "right": 7 * v.diff(t) ** 2 / 2 + v,
    },
    "rod": {
        "density": v.diff(t) ** 2 + v.diff(x, t) ** 2 / 5 - v.diff(x) ** 2 + x * v,
        "fields": [v],
        "right": v.diff(t) ** 2,
    },
    "beam": {
        "density": v.diff(t) ** 2 / 2 - (1 + x**2) * v.diff(x, 2) ** 2 / 2 + 3 * v.diff(x) ** 2 / 2 - v**2,
        "fields": [v],
        "left": -3 * v**2 / 2 - v.diff(x) ** 2,
        "right": (v.diff(t) + x * v.diff(x, t)) ** 2 / 2,
        "virtual_work": [
            (-2 * v.diff(t), v, "left"),
            (-v.diff(x, 2, t), v.diff(x, 2), "domain"),
            (t, v.diff(x), "right"),
        ],
    },
    "timoshenko": {
        "density": v.diff(t) ** 2 / 2 + psi.diff(t) ** 2 / 3 - psi.diff(x) ** 2 - 2 * (v.diff(x) - psi) ** 2,
        "fields": [v, psi],
        "left": -(v**2) - psi**2 / 2,
        "right": v.diff(t) ** 2,
        "virtual_work": [(-psi.diff(t), psi, "left")],
    },
    "base": {
        "density": (w.diff(t) + v.diff(t)) ** 2 / 2 - v.diff(x, 2) ** 2 / 2 + x * w * v,
        "fields": [v],
        "coordinates": [w],
        "left": 5 * w.diff(t) ** 2 / 2 - 2 * v**2,
        "right": (w.diff(t) + v.diff(t)) ** 2,
        "virtual_work": [(t - w.diff(t), w, None)],
    },
    "gyroscopic": {
        "density": (v.diff(t) + 2 * v.diff(x)) ** 2 / 2 - 5 * v.diff(x) ** 2,
        "fields": [v],
    },
    "nonlinear": {
        "density": v.diff(t) ** 2 / 2 - v.diff(x) ** 2 / 2 - v.diff(x) ** 4 / 8 + v**3,
        "fields": [v],
        "right": -(v**4) / 4,
    },
    "third order": {
        "density": v.diff(t) ** 2 / 2 - v.diff(x, 3) ** 2 / 2 - v.diff(x) * v.diff(x, 2),
        "fields": [v],
        "left": -(v.diff(x, 2) ** 2),
    },
}


@pytest.mark.parametrize("name", CASES)
def test_the_equations_are_the_first_variation_of_the_action(name):
    generator = random.Random(name)
    arguments = {"domain": (0, Rational(3, 2)), **CASES[name]}
    unknowns = [*arguments["fields"], *arguments.get("coordinates", ())]
    motion = polynomials(unknowns, generator, flat=False)
    perturbation = polynomials(unknowns, generator, flat=True)
    result = hamilton(x=x, t=t, **arguments)
    difference = first_variation(arguments, motion, perturbation)
    assert difference != 0
    assert expand(difference - weak_residual(result, motion, perturbation)) == 0


@pytest.mark.parametrize("name", [name for name in CASES if "virtual_work" not in CASES[name]])
def test_field_equations_are_those_of_the_euler_operator(name):
    case = CASES[name]
    result = hamilton(x=x, t=t, domain=(0, 1), **case)
    theirs = euler_equations(case["density"], case["fields"], (x, t))
    for ours, other in zip(result.field_equations, theirs, strict=True):
        assert expand(ours.lhs - ours.rhs + other.lhs.doit()) == 0


# ------------------------------------------------------------------------------------------------------------ errors


@pytest.mark.parametrize(
    ("density", "words"),
    [
        (BEAM - psi.diff(x) ** 2, "psi.* not one of the fields"),
        (BEAM - k_t * at(v, 0) ** 2, "density is local"),
        (BEAM - k_t * at(v.diff(x), L / 2) ** 2, "density is local"),
        (BEAM - Integral(v, (x, 0, x)) * v, "not local"),
        (BEAM - DiracDelta(x - L / 2) * v**2, "interior point"),
        (BEAM - Abs(v.diff(x)) ** 3, "not differentiable"),
        (BEAM - v.subs(t, t - 1) * v, "not local in time"),
        (BEAM - Function("g")(v), "unspecified function"),
        (BEAM - Symbol("x", real=True) * v, "assumptions"),
        (E * I, "does not occur"),
    ],
)
def test_a_density_it_cannot_treat_names_the_term(density, words):
    with pytest.raises(HamiltonError, match=words):
        hamilton(density, fields=[v], x=x, domain=(0, L), t=t)


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ({"left": -k_t * v.diff(x, 2) ** 2}, "not a displacement of that end"),
        ({"left": -k_t * at(v, 2 * L) ** 2}, "not an end"),
        ({"left": -k_t * v**2 / 2, "essential": [at(v, 0)]}, r"k_t\*v\(0, t\)\*\*2/2.*does no work"),
        ({"left": -(k_t * v**2 + k_r * v.diff(x) ** 2) / 2, "essential": [at(v, 0)]}, r"k_t\*v.*does no work"),
        ({"virtual_work": [(F, at(v, 0), None)], "essential": [at(v, 0)]}, "does no work"),
        ({"virtual_work": [(F, v, None)]}, "not evaluated at an end"),
        ({"virtual_work": [(F, v)]}, "triple"),
        ({"virtual_work": [(F, v, "middle")]}, "middle"),
        ({"virtual_work": [(F, v.diff(t), "left")]}, "time derivatives"),
        ({"virtual_work": [(F, F, None)]}, "holds no field"),
        ({"domain": (0, 0)}, "domain"),
        ({"domain": (0, x)}, "domain"),
        ({"fields": [v, v]}, "once only"),
        ({"fields": [Function("v")(x)]}, "function of exactly"),
    ],
)
def test_other_input_it_cannot_treat(arguments, words):
    with pytest.raises(HamiltonError, match=words):
        hamilton(BEAM, **{"fields": [v], "x": x, "domain": (0, L), "t": t, **arguments})


def test_text_and_wrong_kinds_are_type_errors():
    with pytest.raises(TypeError, match="density"):
        hamilton("v**2", fields=[v], x=x, domain=(0, L), t=t)
    with pytest.raises(TypeError, match="fields"):
        hamilton(BEAM, fields=[Function("v")], x=x, domain=(0, L), t=t)
    with pytest.raises(TypeError, match="x = "):
        hamilton(BEAM, fields=[v], x=1, domain=(0, L), t=t)
    with pytest.raises(TypeError, match="density = None"):
        hamilton(None, fields=[v], x=x, domain=(0, L), t=t)


@pytest.mark.parametrize(
    ("name", "value"), [("fields", v), ("coordinates", w), ("domain", L), ("essential", at(v, 0)), ("virtual_work", F)]
)
def test_a_single_thing_for_a_sequence_is_named(name, value):
    with pytest.raises(TypeError, match=f"{name} = .*must be a sequence"):
        hamilton(BEAM, **{"fields": [v], "x": x, "domain": (0, L), "t": t, name: value})


def test_smooth_nonlinear_functions_are_varied():
    result = hamilton(
        v.diff(t) ** 2 / 2 - sqrt(1 + v.diff(x) ** 2) - cos(v) * exp(-x), fields=[v], x=x, domain=(0, L), t=t
    )
    slope = v.diff(x)
    assert (result.boundary_conditions[0].lhs - at(slope / sqrt(1 + slope**2), 0)).simplify() == 0


# ------------------------------------------------------------------------------------------------------- presentation


def test_a_condition_keeps_its_end_when_values_are_inserted():
    condition = arm().boundary_conditions[1]
    valued = condition.subs(k_r, 7)
    assert valued.rhs == 7 * at(v.diff(x), 0)
    assert (valued.end, valued.displacement, valued.kind) == ("left", at(v.diff(x), 0), "natural")
    assert Eq(condition.lhs, condition.rhs) == condition == Eq(condition.lhs, condition.rhs)
    assert hash(Eq(condition.lhs, condition.rhs)) == hash(condition)
    assert condition.variation == Function("δv")(x, t).diff(x).subs(x, 0)


def test_the_steps_read_well():
    steps = arm([w], virtual_work=[(F, w, None)]).steps
    assert [step.name for step in steps] == [
        "Lagrangian",
        "Variation",
        "Integration by parts in time",
        "Integration by parts in x",
        "Collected terms",
        "Equations",
    ]
    assert r"E I v_{xxx}(0,t) = - k_{t} v(0,t)" in steps[-1]._repr_latex_()
    assert r"E I v_{xxx}(L,t) = m_{e} \left(v_{tt}(L,t) + \ddot{w}\right)" in steps[-1]._repr_latex_()
    assert r"\delta v_{xx}" in steps[1]._repr_latex_()
    assert steps[2].derived_from == ("Variation",)
    assert arm().boundary_conditions[1]._repr_latex_() == r"$\displaystyle E I v_{xx}(0,t) = k_{r} v_{x}(0,t)$"


def test_no_assumed_sign_is_used():
    signed = {symbol: Symbol(symbol.name, positive=True) for symbol in (L, rho, A, E, I, k_t, k_r, m_e, J_e)}
    back = {new: old for old, new in signed.items()}
    density = BEAM.xreplace(signed)
    left, right = -signed[k_t] * v**2 / 2, signed[m_e] * v.diff(t) ** 2 / 2
    result = hamilton(density, fields=[v], x=x, domain=(0, signed[L]), t=t, left=left, right=right)
    plain = hamilton(BEAM, fields=[v], x=x, domain=(0, L), t=t, left=left.xreplace(back), right=right.xreplace(back))
    assert tuple(equation.xreplace(back) for equation in result.equations) == plain.equations


@pytest.mark.parametrize(
    ("expression", "expected"),
    [
        (w.diff(t, 2), r"\ddot{w}"),
        (Function("w")(L).diff(L, 2), r"w''(L)"),  # as under Duhamel's integral
        (Function("q_i")(t).diff(t).subs(t, 0), r"\dot{q}_{i}(0)"),
        (Function("δw")(t).diff(t), r"\delta \dot{w}"),
        (Function("phi_i")(x).diff(x).subs(x, L) ** 2, r"\phi_{i}'(L)^{2}"),
        (Function("phi")(x).diff(x, 8), r"\phi^{(8)}(x)"),
        (Function("v_1")(x, t).diff(x, t).subs(x, L), r"{v_{1}}_{,xt}(L,t)"),
        (Function("Delta")(k_t, k_r).diff(k_r), r"\frac{\partial}{\partial k_{r}} \Delta(k_{t},k_{r})"),
    ],
)
def test_no_derivative_is_shown_as_one_by_another_variable(expression, expected):
    assert compact_latex(expression) == expected
