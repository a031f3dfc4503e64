"""What acts at interior places: masses, springs, rotary inertias and supports, against closed forms and two fields."""

from __future__ import annotations

import pickle

import numpy as np
import pytest
import sympy as sp
from scipy.optimize import brentq

import cra_sym as cra

x, t = sp.symbols("x t")
a, m, k, L = sp.symbols("a m k L")
v = sp.Function("v")(x, t)
HALF = sp.Rational(1, 2)
CLAMPED = (v.subs(x, 0), v.diff(x).subs(x, 0))
PINNED = (v.subs(x, 0), v.subs(x, 1))
CLOSE = 1e-10


def beam(mass=1, essential=CLAMPED, length=1, **options):
    density = mass * v.diff(t) ** 2 / 2 - v.diff(x, 2) ** 2 / 2
    return cra.Model(density, fields=[v], x=x, domain=(0, length), t=t, essential=essential, **options)


def string(**options):
    density = v.diff(t) ** 2 / 2 - v.diff(x) ** 2 / 2
    return cra.Model(density, fields=[v], x=x, domain=(0, 1), t=t, essential=PINNED, **options)


KINETIC = v.diff(t) ** 2 / 2
AT_THE_MIDDLE = (2.891238395691, 14.225428316769)  # transfer matrices in 30 digits


@pytest.mark.parametrize(
    "model",
    [
        beam(1 + sp.DiracDelta(x - HALF)),
        beam(1 + 2 * sp.DiracDelta(2 * x - 1)),
        beam(1 + sp.SingularityFunction(x, HALF, -1)),
        beam(inside=[(HALF, KINETIC)]),
        beam(inside=[(HALF, KINETIC / 4), (HALF, 3 * KINETIC / 4)]),
        beam(inside=[(HALF, v.subs(x, HALF).diff(t) ** 2 / 2)]),
    ],
    ids=["DiracDelta", "scaled", "SingularityFunction", "inside", "in two parts", "evaluated form"],
)
def test_a_mass_at_the_middle_of_a_cantilever(model):
    np.testing.assert_allclose(model.at({}).natural_frequencies(2), AT_THE_MIDDLE, rtol=CLOSE)


@pytest.mark.parametrize("place", [0.1, 0.5, 0.73])
def test_a_string_with_a_bead_and_a_spring(place):
    """sin w + (m w^2 - k) / w sin(w a) sin(w (1 - a)) * (-1) = 0 by joining two sines."""
    model = string(inside=[(a, m * KINETIC - k * v**2 / 2)])
    found = model.at({a: place, m: 0.7, k: 3.0}).natural_frequencies(3)

    def condition(w):
        return w * np.sin(w) - (0.7 * w**2 - 3.0) * np.sin(w * place) * np.sin(w * (1 - place))

    grid = np.linspace(1e-3, 20.0, 4001)
    signs = np.sign([condition(w) for w in grid])
    exact = [brentq(condition, *grid[i : i + 2], xtol=1e-15) for i in np.nonzero(np.diff(signs))[0]]
    np.testing.assert_allclose(found, exact[:3], rtol=CLOSE)


@pytest.mark.parametrize("spring", [-0.1, -6.0, -40.0, -47.9])
def test_a_negative_spring_between_supports(spring):
    """1 + k (tan y - tanh y) / (32 y^3) = 0 with y = sqrt(omega) / 2: the beam buckles at k = -48."""

    def condition(y):
        return 1 + spring * (np.tan(y) - np.tanh(y)) / (32 * y**3)

    first = (2 * brentq(condition, 0.1, np.pi / 2 - 1e-9, xtol=1e-15, rtol=1e-15)) ** 2
    found = beam(essential=PINNED, inside=[(HALF, -k * v**2 / 2)]).at({k: spring}).natural_frequencies(2)
    np.testing.assert_allclose(found, [first, 4 * np.pi**2], rtol=10 * CLOSE)
    with pytest.raises(ValueError, match="buckled: 1 unstable mode"):
        beam(essential=PINNED, inside=[(HALF, -k * v**2 / 2)]).at({k: -48.1}).natural_frequencies(1)


def test_a_form_of_displacement_and_slope_that_is_not_definite():
    """At the middle of a cantilever k v v' takes and gives: lumped mass tip and stiffness [[96, -24], [-24, 8]]."""
    massless = -(v.diff(x, 2) ** 2) / 2
    short = cra.Model(
        massless,
        fields=[v],
        x=x,
        domain=(0, 1),
        t=t,
        essential=CLAMPED,
        inside=[(HALF, KINETIC - k * v * v.diff(x))],
    )
    found = short.at({k: [[4.0], [3.0]]}).natural_frequencies(1)[..., 0]
    exact = [96 - (k_ - 24) ** 2 / 8 for k_ in (4.0, 3.0)]
    np.testing.assert_allclose(found.ravel() ** 2, exact, rtol=CLOSE)


def test_supports_and_springs_that_become_supports():
    """A pinned beam held at its middle: two spans, omega = (2 pi)^2 and 4 (3.9266...)^2."""
    exact = [(2 * np.pi) ** 2, 4 * 3.92660231204792**2]
    held = beam(essential=(*PINNED, v.subs(x, HALF)))
    np.testing.assert_allclose(held.at({}).natural_frequencies(2), exact, rtol=CLOSE)
    sprung = beam(essential=PINNED, inside=[(HALF, -k * v**2 / 2)]).at({k: [1e14, 1e18]})
    np.testing.assert_allclose(sprung.natural_frequencies(2), np.tile(exact, (2, 1)), rtol=1e-9)
    clamped = beam(essential=(*PINNED, v.subs(x, HALF), v.diff(x).subs(x, HALF)))
    np.testing.assert_allclose(clamped.at({}).natural_frequencies(2), [4 * 3.92660231204792**2] * 2, rtol=CLOSE)


def test_a_place_that_moves_passes_the_node_of_a_mode():
    """The second mode of a pinned beam has its node at the middle: the frequency is smooth and even there."""
    model = beam(essential=PINNED, inside=[(a, m * KINETIC)])
    places = HALF.evalf(30) + np.array([-1e-3, -1e-6, 0.0, 1e-6, 1e-3])
    second = model.at({a: places.astype(float), m: 3.0}).natural_frequencies(2)[:, 1]
    np.testing.assert_allclose(second[2], (2 * np.pi) ** 2, rtol=CLOSE)
    np.testing.assert_allclose(second, second[::-1], rtol=1e-10)
    assert second[0] < second[1] <= second[2] * (1 + 1e-12)


def test_places_beyond_the_domain_and_at_ends_are_refused():
    model = beam(inside=[(a, m * KINETIC)])
    with pytest.raises(ValueError, match=r"inside: a place is at x = 1.4; must be in the domain, \(0, 1\)"):
        model.at({a: [0.3, 1.4], m: 5.0}).natural_frequencies(2)
    with pytest.raises(ValueError, match="at an end of the domain"):
        model.at({a: 1.0, m: 5.0}).natural_frequencies(1)
    with pytest.raises(ValueError, match="use left or right"):
        beam(inside=[(0, KINETIC)])
    with pytest.raises(ValueError, match="may jump there"):
        beam(inside=[(HALF, v.diff(x, 2) ** 2)])
    with pytest.raises(ValueError, match="linear in x"):
        beam(1 + sp.DiracDelta(x**2 - HALF))


def test_rotary_inertia_is_a_heavy_short_piece_in_the_limit():
    """Against the uniform beam with one end: the place goes to the tip."""
    right = beam(right=m * v.diff(x, t) ** 2 / 2).at({m: 0.3}).natural_frequencies(3)
    near = beam(inside=[(a, m * v.diff(x, t) ** 2 / 2)]).at({a: 1 - 1e-9, m: 0.3}).natural_frequencies(3)
    np.testing.assert_allclose(near, right, rtol=1e-7)


def test_modes_and_responses_see_the_mass():
    """Orthonormal with the mass; static response to a base acceleration by hand; dynamic by the sum over modes."""
    w = sp.Function("w")(t)
    density = (v.diff(t) + w.diff(t)) ** 2 / 2 - v.diff(x, 2) ** 2 / 2
    model = cra.Model(
        density,
        fields=[v],
        x=x,
        domain=(0, 1),
        t=t,
        essential=CLAMPED,
        prescribed=[w],
        inside=[(a, m * (v.diff(t) + w.diff(t)) ** 2 / 2)],
    )
    system = model.at({a: 0.6, m: 2.0})
    modes = system.modes(12)
    points, weights = modes.stations()
    shapes, there = modes.shape(0, 0, points), modes.shape(0, 0, np.array([0.6]))
    np.testing.assert_allclose((shapes * weights) @ shapes.T + 2.0 * there @ there.T, np.eye(12), atol=1e-11)
    static = -(1 / 8 + 2.0 * 0.6**2 * (3 - 0.6) / 6)
    # the dynamic stiffness has 128 pieces, whose stiffness is 2e6 times that of the beam: eight digits
    np.testing.assert_allclose(cra.frequency_response(system, 0.0), static, rtol=1e-7)
    share = cra.modal_parameters(system, 12).participation
    tip, omega = modes.displacement(1, 0), system.natural_frequencies(12)
    for Omega in (1.0, 5.0):
        summed = -(tip * share / (omega**2 - Omega**2)).sum()
        np.testing.assert_allclose(cra.frequency_response(system, Omega), summed, rtol=1e-5)


@pytest.mark.parametrize("kind", ["beam", "string"])
def test_rates_of_frequencies_by_everything_at_interior_places(kind):
    if kind == "beam":
        term = m * KINETIC + m * v.diff(x, t) ** 2 / 20
        model = beam(length=L, inside=[(a, term), (a / 2, -k * v**2 / 2)])
    else:
        density = v.diff(t) ** 2 / 2 - v.diff(x) ** 2 / 2
        ends = {"fields": [v], "x": x, "domain": (0, L), "t": t, "essential": [v.subs(x, 0)]}
        model = cra.Model(density, inside=[(a, m * KINETIC - k * v**2 / 2)], **ends)
    values = {"a": 0.7, "m": 1.0, "k": 30.0, "L": 1.1}
    system = model.at(values)
    found = cra.sensitivities(system, 3)
    for name, value in values.items():
        small = 1e-5 * value
        high, low = (cra.natural_frequencies(system.replace(**{name: value + d}), 3) for d in (small, -small))
        # the difference loses digits of the frequency, not of the rate
        rounding = 1e-12 * cra.natural_frequencies(system, 3) / small
        error = np.abs(found.rate[name] - (high - low) / (2 * small))
        assert (error < 1e-7 * np.abs(found.rate[name]) + rounding).all()


# closed forms ---------------------------------------------------------------------------------------------------------

T, b, C = sp.symbols("T b C")
w, turn = sp.Function("w")(t), sp.Function("turn")(x, t)
LOADED = m * KINETIC - k * v**2 / 2 + m * v.diff(x, t) ** 2 / 20
SHAKEN = m * KINETIC - k * v**2 / 2 + m * turn.diff(t) ** 2 / 20
RIDING = m * (v.diff(t) + w.diff(t)) ** 2 / 2
TENSE = KINETIC - v.diff(x, 2) ** 2 / 2 - T * v.diff(x) ** 2 / 2
SHEARED = KINETIC + turn.diff(t) ** 2 / 400 - turn.diff(x) ** 2 / 2 - 50 * (v.diff(x) - turn) ** 2 / 2
ALONG = {"x": x, "domain": (0, 1), "t": t}
CLOSED = {
    "bead on a string": (string(inside=[(a, m * KINETIC)]), {a: 0.3, m: 0.7}),
    "mass, spring, rotary inertia": (beam(inside=[(a, LOADED)]), {a: 0.3, m: 0.7, k: 3.0}),
    "support": (beam(essential=(*PINNED, v.subs(x, a))), {a: 0.37}),
    "support at an irrational place": (beam(essential=(*CLAMPED, v.subs(x, 1 / sp.sqrt(2)))), {}),
    "two places": (beam(inside=[(a, m * KINETIC), (b, -k * v**2 / 2)]), {a: 0.3, b: 0.8, m: 0.7, k: 3.0}),
    "numbers that descend": (beam(inside=[(0.8, m * KINETIC), (HALF / 2, -k * v**2 / 2)]), {m: 0.7, k: 3.0}),
    "mass before a support": (
        beam(essential=(*CLAMPED, v.subs(x, b)), inside=[(a, m * KINETIC)]), {a: 0.3, b: 0.8, m: 1}
    ),
    "tension": (
        cra.Model(TENSE, fields=[v], essential=CLAMPED, inside=[(a, m * KINETIC)], **ALONG), {a: 0.3, m: 1, T: 5}
    ),
    "Timoshenko": (
        cra.Model(SHEARED, fields=[v, turn], essential=[v.subs(x, 0), turn.subs(x, 0)], inside=[(a, SHAKEN)], **ALONG),
        {a: 0.4, m: 0.5, k: 2.0},
    ),
    "on a free base": (
        cra.Model(
            (v.diff(t) + w.diff(t)) ** 2 / 2 - v.diff(x, 2) ** 2 / 2,
            fields=[v],
            coordinates=[w],
            left=w.diff(t) ** 2 - k * w**2 / 2,
            inside=[(a, RIDING)],
            essential=CLAMPED,
            **ALONG,
        ),
        {a: 0.3, m: 0.7, k: 5.0},
    ),
}  # fmt: skip


def newton(function, root):
    """Distance of a root from that of a function, relative: a Newton step by a central difference."""
    low, here, high = (complex(function(root * (1 + h))) for h in (-1e-6, 0.0, 1e-6))
    return abs(here * 2e-6 / (high - low))


@pytest.mark.parametrize("name", CLOSED)
def test_closed_forms_with_interior_places(name):
    """The characteristic function vanishes at the frequencies of the stress basis; the shapes are the same."""
    model, values = CLOSED[name]
    closed, function = model.separate(), model.kernel()
    numbers = [values[symbol] for symbol in model.symbols]
    omega = model.at(values).natural_frequencies(3)
    for root in omega:  # the cut-off of a wave number makes it imaginary
        assert newton(lambda z: function(z + 0j, *numbers), root) < 1e-10  # the accuracy of the frequencies
    assert len(closed.spatial_problem.jump_conditions) == len(model.equations.jump_conditions) > 0
    if closed.characteristic_matrix.rows < 6:  # cofactors of larger ones take long
        known = {**values, closed.frequency: omega[1]}
        waves = {wave: value.subs(known).evalf() for wave, value in closed.basis.wave_numbers.items()}
        places = [0.2, 0.45, 0.9]
        first = closed.mode_shapes[0].subs(waves).subs(known)
        shape = np.array([complex(first.subs(x, place).evalf()) for place in places])
        expected = model.mode_shapes(values, places, 2)[1]
        np.testing.assert_allclose(shape / shape[2], expected / expected[2], rtol=1e-8)


def test_closed_forms_say_what_stands_at_interior_places():
    """A bead: lambda m sin(lambda a) sin(lambda (1 - a)) = sin(lambda), as two sines joined by hand give it."""
    closed = string(inside=[(a, m * KINETIC)]).separate()
    lam = next(iter(closed.basis.wave_numbers))
    by_hand = m * lam * sp.sin(a * lam) * sp.sin(lam * (1 - a)) - sp.sin(lam)
    assert sp.simplify(closed.characteristic_function * lam - by_hand) == 0
    (condition,) = closed.spatial_problem.jump_conditions
    assert condition.place == a and condition.rhs.has(closed.frequency)
    beyond = beam(inside=[(sp.Integer(2), m * KINETIC)]).separate()
    assert beyond.characteristic_function == beam().separate().characteristic_function  # there it is not


def test_a_double_frequency_is_a_double_zero():
    """A pinned beam clamped at its middle: both halves alike, so that the function does not change its sign."""
    model = beam(essential=(*PINNED, v.subs(x, HALF), v.diff(x).subs(x, HALF)))
    function, root = model.kernel(), 4 * 3.92660231204792**2
    near = np.array([function(root * (1 + h)) for h in (-1e-3, 0.0, 1e-3)])
    assert near[0] * near[2] > 0 and abs(near[1]) < 1e-9 * abs(near[0])


def test_a_damper_inside_in_closed_form():
    model = beam(virtual_work=[(-C * v.diff(t), v, a)])
    function = model.kernel()
    for root in model.eigenvalues({a: 0.6, C: 1.5}, 3):
        assert newton(lambda s: function(s, 1.5, 0.6), root) < 1e-10


def test_what_has_no_closed_form_is_told_the_way():
    with pytest.raises(ValueError, match=r"Heaviside.* use ritz or, for constant pieces, fields of their own"):
        beam(1 + sp.Heaviside(x - HALF)).separate()


# tables ---------------------------------------------------------------------------------------------------------------


def test_a_table_of_symbols_costs_no_derivatives_of_its_fixed_places():
    """Its values are those of the table of numbers; one whose place is a symbol is moved by that alone."""
    values = [1.0 + 0.5 * np.sin(k) for k in range(9)]
    symbols, places = sp.symbols("y0:9"), [sp.Rational(k, 9) for k in range(9)]
    named, fixed, moved = (
        beam(cra.stations(x, list(zip(at, of, strict=True)), kind="step"))
        for at, of in ((places, symbols), (places, values), ([*places[:8], a], symbols))
    )
    found = named.at(dict(zip(symbols, values, strict=True)))
    np.testing.assert_allclose(found.natural_frequencies(3), fixed.at({}).natural_frequencies(3), rtol=1e-13)
    assert all(rate is None for rate in named.numerics("spatial").breaks.rates)
    kept = [rate for rate in moved.numerics("spatial").breaks.rates if rate is not None]
    assert [rate[1] for rate in kept] == [(moved.symbols.index(a),)]


def test_tables_as_coefficients():
    steps = cra.stations(x, [(0, 1), (HALF, sp.Rational(1, 10))], kind="step")
    masses = cra.stations(x, [(0, 1), (HALF, sp.Rational(46, 100))], kind="step")
    density = masses * v.diff(t) ** 2 / 2 - steps * v.diff(x, 2) ** 2 / 2
    model = cra.Model(density, fields=[v], x=x, domain=(0, 1), t=t, essential=CLAMPED)
    np.testing.assert_allclose(model.at({}).natural_frequencies(2), [4.189753101299, 14.287900445799], rtol=CLOSE)
    linear = cra.stations(x, [(0, 2), (HALF, 1), (1, 2)])
    roof = 1 + sp.Abs(2 * x - 1)
    found = [
        cra.Model(KINETIC - tension * v.diff(x) ** 2 / 2, fields=[v], x=x, domain=(0, 1), t=t, essential=PINNED)
        .at({})
        .natural_frequencies(3)
        for tension in (linear, roof)
    ]
    np.testing.assert_allclose(found[0], found[1], rtol=CLOSE)


@pytest.mark.parametrize(
    ("table", "error", "words"),
    [
        ([(0, 1)], ValueError, "at least two"),
        ([(0, 1), (0, 2)], ValueError, "must be greater"),
        ([(1, 1), (0, 2)], ValueError, "must be greater"),
        ([(0, 1), (1,)], TypeError, "must be a pair"),
        ([(0, "1"), (1, 2)], TypeError, "must be a pair"),
    ],
)
def test_tables_that_are_refused(table, error, words):
    with pytest.raises(error, match=words):
        cra.stations(x, table)


# what follows from interior places ------------------------------------------------------------------------------------

c, J = sp.symbols("c J")
TIP = v.subs(x, 1)


def test_jump_conditions_have_their_place_and_variation():
    """EI v''' falls by the inertia, the spring and the damper; EI v'' rises by the rotary inertia; supports hold."""
    term = m * KINETIC + J * v.diff(x, t) ** 2 / 2 - k * v**2 / 2
    model = beam(
        length=L, inside=[(a, term)], virtual_work=[(-c * v.diff(t), v, a)], essential=(*CLAMPED, v.subs(x, L / 2))
    )
    shear, moment, held, free = model.equations.jump_conditions
    there = v.subs(x, a)
    assert shear.rhs == -m * there.diff(t, 2) - k * there - c * there.diff(t)
    right, left = sp.Limit(v.diff(x, 3), x, a, "+"), sp.Limit(v.diff(x, 3), x, a, "-")
    assert shear.lhs == right - left
    assert moment.rhs == J * v.diff(x, t, t).subs(x, a)
    assert [condition.place for condition in model.equations.jump_conditions] == [a, a, L / 2, L / 2]
    assert str(shear.variation) == "δv(a, t)" and shear.kind == "natural"
    assert (held.lhs, held.rhs, held.kind) == (v.subs(x, L / 2), 0, "essential") and free.rhs == 0
    assert r"\lim_{x \to a^+}" in model.equations._repr_latex_()
    assert pickle.loads(pickle.dumps(shear)).place == a


@pytest.mark.parametrize(
    ("model", "values"),
    [
        (beam(inside=[(a, m * KINETIC - k * v**2 / 2)]), {a: 0.3, m: 2.0, k: 50.0}),
        (beam(essential=(*PINNED, v.subs(x, a))), {a: 0.37}),
        (beam(essential=(*PINNED, v.subs(x, HALF), v.diff(x).subs(x, HALF))), {}),
        (string(inside=[(a, m * KINETIC), (sp.Rational(3, 4), -k * v**2 / 2)]), {a: 0.3, m: 1.0, k: 2.0}),
    ],
    ids=["mass and spring", "support", "clamp", "string, whose slope jumps"],
)
def test_ritz_has_nodes_at_interior_places(model, values):
    """From above, and with the order of convergence of elements on smooth spans: 4 of beams, 6 of strings."""
    exact = model.at(values).natural_frequencies(3) / 2 / np.pi
    errors = [model.ritz(n).natural_frequencies(values, 3) / exact - 1 for n in (4, 8)]
    assert (errors[1] > -1e-9).all() and (errors[0] > errors[1]).all()
    order = 6 if model.equations.variation.orders == (1,) else 4
    clear = errors[1] > 1e-9
    rates = np.log2(errors[0][clear] / errors[1][clear])
    assert clear.any() and (np.abs(rates - order) < 0.6).all()


def test_nodes_of_ritz_at_jumps_and_in_order():
    mass = sp.Piecewise((1, x < HALF), (4, True))
    density = mass * KINETIC - v.diff(x) ** 2 / 2
    model = cra.Model(density, fields=[v], x=x, domain=(0, 1), t=t, essential=PINNED, inside=[(a, -k * v**2)])
    found = model.ritz(8, nodes=[HALF]).natural_frequencies({a: 0.8, k: 3.0}, 2)
    np.testing.assert_allclose(found, model.at({a: 0.8, k: 3.0}).natural_frequencies(2) / 2 / np.pi, rtol=1e-7)
    with pytest.raises(ValueError, match="in the order in which they are stated"):
        model.ritz(8, nodes=[HALF]).natural_frequencies({a: 0.2, k: 3.0}, 2)
    assert model.ritz(8, nodes=[a, HALF]).natural_frequencies({a: 0.2, k: 3.0}, 1) > 0


def by_ritz(model, values, Omega, elements=40, nodes=()):
    """Tip displacement for a unit force there, from the assembled matrices."""
    elements = model.ritz(elements, nodes=nodes)
    columns = np.array([[float(values[s])] for s in elements.symbols]).reshape(len(elements.symbols), 1)
    ((_, stiffness, damping, mass),) = elements._numbers(columns)
    force = np.zeros(len(stiffness))
    force[-2] = 1.0
    return np.linalg.solve(stiffness + 1j * Omega * damping - Omega**2 * mass, force)[-2]


HELD = {
    "support": (beam(essential=(*CLAMPED, v.subs(x, a))), {a: 0.6}, ()),
    "clamp": (beam(essential=(*CLAMPED, v.subs(x, HALF), v.diff(x).subs(x, HALF))), {}, ()),
    "damper": (beam(virtual_work=[(-c * v.diff(t), v, a)]), {a: 0.6, c: 1.5}, ()),
    "damped turning": (beam(virtual_work=[(-c * v.diff(x, t), v.diff(x), a)]), {a: 0.3, c: 0.4}, ()),
    "support and damper": (
        beam(essential=(*CLAMPED, v.subs(x, a)), virtual_work=[(-c * v.diff(t), v, HALF)]),
        {a: 0.6, c: 2.0},
        (HALF, a),
    ),
}


@pytest.mark.parametrize("kind", HELD)
def test_frequency_responses_with_supports_and_dampers_inside(kind):
    """Against 40 elements a span, whose error at 30 rad/s is below 1e-6."""
    model, values, nodes = HELD[kind]
    for Omega in (0.0, 1.0, 30.0):
        found = cra.frequency_response(model.at(values), Omega, drive=TIP)
        np.testing.assert_allclose(found, by_ritz(model, values, Omega, nodes=nodes), rtol=3e-6)


def test_a_static_force_on_a_beam_held_inside():
    """Propped at a: the overhang of b bends by b^3 / 3 and turns with the span, b^2 a / 4."""
    model = beam(essential=(*CLAMPED, v.subs(x, a)))
    found = cra.frequency_response(model.at({a: [0.4, 0.7]}), 0.0, drive=TIP)
    near, over = np.array([0.4, 0.7]), np.array([0.6, 0.3])
    np.testing.assert_allclose(found, over**3 / 3 + over**2 * near / 4, rtol=1e-8)


def test_eigenvalues_with_a_damper_inside():
    model, values, _ = HELD["damper"]
    found = model.eigenvalues(values, 3)
    np.testing.assert_allclose(found, model.ritz(24).eigenvalues(values, 3), rtol=3e-6)


@pytest.mark.parametrize("kind", [sp.DiracDelta, lambda s: sp.SingularityFunction(s, 0, -1)])
def test_a_delta_in_virtual_work_acts_at_its_place(kind):
    force, drag = sp.Function("F")(t), -m * v.diff(t)
    spread = beam(
        virtual_work=[(drag * kind(2 * x - a) + drag / 3, v, "domain"), (force * kind(x - HALF), v, "domain")]
    )
    placed = beam(virtual_work=[(drag / 2, v, a / 2), (drag / 3, v, "domain"), (force, v, HALF)])
    one, other = (model.at({a: 0.8, m: 2.0}) for model in (spread, placed))
    np.testing.assert_allclose(cra.eigenvalues(one, 2), cra.eigenvalues(other, 2), rtol=1e-12)
    moved = [cra.frequency_response(system, 3.0, drive=force) for system in (one, other)]
    np.testing.assert_allclose(*moved, rtol=1e-12)


def test_a_base_that_shakes_along_the_beam_pulls_what_is_inside():
    """A mass at a place, as the limit of one that is spread; the mass per length beyond pulls (36b)."""
    spread = sp.Symbol("spread")
    bump = m / spread * sp.Heaviside(x - a + spread / 2) * sp.Heaviside(a + spread / 2 - x)
    point = beam(inside=[(a, m * KINETIC)])
    wide = beam(1 + bump)
    values = {a: 0.6, m: 2.0}
    one = point.at(values).form("axial", 3)
    other = wide.at({**values, spread: 1e-4}).form("axial", 3)
    np.testing.assert_allclose(one["axial"], other["axial"], rtol=1e-6)


def test_works_at_places_that_are_refused():
    with pytest.raises(ValueError, match="use left or right"):
        beam(virtual_work=[(-c * v.diff(t), v, 0)])
    with pytest.raises(ValueError, match="may jump there"):
        beam(virtual_work=[(-c * v.diff(x, 2, t), v.diff(x, 2), a)])
    with pytest.raises(ValueError, match="an interior place or None"):
        beam(virtual_work=[(-c * v.diff(t), v, "middle")])
