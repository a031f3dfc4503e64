"""What a user can do wrong, and what comes back: values, infinite stiffness, shapes, dimensions."""

from __future__ import annotations

import pickle

import numpy as np
import pytest
import sympy as sp

import cra_sym as cra
from cra_sym import symbols as table

x, t = sp.symbols("x t")
L, EI, rhoA, m_e, k_t, k_r, N, c = sp.symbols("L EI rhoA m_e k_t k_r N c")
v = sp.Function("v")(x, t)
HALF = sp.Rational(1, 2)
BEAM = HALF * rhoA * v.diff(t) ** 2 - HALF * EI * v.diff(x, 2) ** 2
JOINT = -HALF * k_t * v**2 - HALF * k_r * v.diff(x) ** 2
TIP = HALF * m_e * v.diff(t) ** 2
VALUES = {EI: 4.6, rhoA: 0.24, L: 1.1, m_e: 0.05, k_t: 900.0, k_r: 40.0}


def model(density=BEAM, left=JOINT, right=TIP, fields=(v,), domain=(0, L), **options):
    return cra.Model(density, fields=fields, x=x, domain=domain, t=t, left=left, right=right, **options)


@pytest.fixture(scope="module")
def arm():
    return model()


def test_parameters_and_equations_are_those_of_the_lagrangian(arm):
    assert arm.symbols == (EI, L, k_r, k_t, m_e, rhoA)
    assert arm.equations.field_equations[0].lhs == rhoA * v.diff(t, 2) + EI * v.diff(x, 4)
    assert len(arm.equations.boundary_conditions) == 4
    assert repr(arm) == "<Model of v(x, t) with parameters EI, L, k_r, k_t, m_e, rhoA>"


def test_values_by_symbol_or_by_name_and_broadcasting(arm):
    names = {symbol.name: value for symbol, value in VALUES.items()}
    single = arm.natural_frequencies(VALUES, modes=4)
    assert single.shape == (4,)
    np.testing.assert_array_equal(arm.natural_frequencies(names, modes=4), single)
    symbolic = arm.natural_frequencies({**VALUES, m_e: sp.Rational(1, 20), k_t: sp.Integer(900)}, modes=4)
    np.testing.assert_array_equal(symbolic, single)
    batch = arm.natural_frequencies({**VALUES, k_t: [[900.0], [50.0]], L: [1.0, 1.1, 1.2]}, modes=4)
    assert batch.shape == (2, 3, 4)
    np.testing.assert_allclose(batch[0, 1], single, rtol=1e-12)
    assert (np.diff(batch, axis=1) < 0).all() and (batch[1] < batch[0]).all()


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({k_t: "stiff"}, "k_t = 'stiff'"),
        ({k_t: np.nan}, "k_t = nan"),
        ({k_t: True}, "k_t = True"),
        ({k_t: 1j}, "k_t = 1j"),
        ({k_t: 2 * sp.I}, r"k_t = 2\*I"),
        ({k_t: 2 * L}, r"k_t = 2\*L"),
        ({"k_q": 1.0}, "k_q does not occur in the model; it has EI, L, k_r, k_t, m_e, rhoA"),
        ({"k_t": 1.0}, "k_t is given twice"),
        ({k_t: [1.0, 2.0], k_r: [1.0, 2.0, 3.0]}, "k_t"),
        ({L: -1.0}, "domain: the length L"),
        ({EI: np.inf}, "EI = inf: only the stiffness of an end may be infinite"),
        ({m_e: np.inf}, "m_e = inf: only the stiffness of an end may be infinite"),
        ({k_t: -np.inf}, "k_t = -inf"),
        ({EI: 0.0}, "infinite"),
        ({rhoA: -0.24, m_e: 0.0}, "rhoA = -0.24: the kinetic energy of a section is negative; it must be at least 0"),
    ],
)
def test_values_that_are_refused(arm, change, message):
    with pytest.raises(ValueError, match=message):
        arm.natural_frequencies({**VALUES, **change})


def test_elements_refuse_what_has_no_real_spectrum():
    string = HALF * rhoA * v.diff(t) ** 2 - HALF * N * v.diff(x) ** 2
    gyroscopic = model(string + c * v.diff(x) * v.diff(t), None, None, essential=[v.subs(x, 0), v.subs(x, L)])
    with pytest.raises(ValueError, match="symmetric"):
        gyroscopic.ritz(4).natural_frequencies({rhoA: 0.7, N: 2.0, c: 0.4, L: 1.3})
    massless = model(-HALF * N * v.diff(x) ** 2, None, TIP, essential=[v.subs(x, 0)])
    with pytest.raises(ValueError, match="kinetic energy is not positive"):
        massless.ritz(4).natural_frequencies({N: 2.0, m_e: 0.3, L: 1.3})


def test_waves_in_a_travelling_string_turn_with_it():
    """Exact and elements: omega = n pi T / (L sqrt(c^2 + rho T)), from its two wave numbers."""
    string = HALF * rhoA * v.diff(t) ** 2 - HALF * N * v.diff(x) ** 2
    travelling = model(string + c * v.diff(x) * v.diff(t), None, None, essential=[v.subs(x, 0), v.subs(x, L)])
    values = {rhoA: 0.7, N: 2.0, c: 0.4, L: 1.3}
    expected = np.arange(1, 4) * np.pi * 2.0 / (1.3 * np.sqrt(0.4**2 + 0.7 * 2.0))
    np.testing.assert_allclose(travelling.eigenvalues(values).imag, expected, rtol=1e-11)
    np.testing.assert_allclose(travelling.ritz(16).eigenvalues(values).imag, expected, rtol=1e-5)


def test_a_missing_value_is_named(arm):
    with pytest.raises(ValueError, match="no value for m_e, rhoA"):
        arm.natural_frequencies({k: a for k, a in VALUES.items() if k not in (m_e, rhoA)})


@pytest.mark.parametrize(("modes", "error"), [(0, ValueError), (1.5, ValueError), ("3", TypeError)])
def test_modes_must_be_a_count(arm, modes, error):
    with pytest.raises(error, match="modes"):
        arm.natural_frequencies(VALUES, modes=modes)


def test_infinite_stiffness_is_the_essential_condition(arm):
    soft = {k: a for k, a in VALUES.items() if k not in (k_t, k_r)}
    clamped = model(left=None, essential=[v.subs(x, 0), v.diff(x).subs(x, 0)]).natural_frequencies(soft)
    pinned = model(left=-HALF * k_r * v.diff(x) ** 2, essential=[v.subs(x, 0)]).natural_frequencies({**soft, k_r: 40.0})
    found = arm.natural_frequencies({**VALUES, k_t: np.inf, k_r: [np.inf, 40.0]})
    np.testing.assert_allclose(found, [clamped, pinned], rtol=1e-12)
    np.testing.assert_allclose(arm.natural_frequencies({**VALUES, k_t: 1e13, k_r: 1e13}), clamped, rtol=1e-9)


def test_a_spring_beside_the_axis_holds_a_combination_of_displacements():
    """An infinite spring at a distance a from the end forbids v - a v' there, not each by itself."""
    a = sp.symbols("a")
    beam = model(left=-HALF * k_t * (v - a * v.diff(x)) ** 2)
    values = {EI: 1.0, rhoA: 1.0, L: 1.0, m_e: 0.3, a: 0.2}
    rigid = beam.natural_frequencies({**values, k_t: np.inf})
    assert rigid[0] == 0.0
    np.testing.assert_allclose(beam.natural_frequencies({**values, k_t: 1e8})[1:], rigid[1:], rtol=1e-6)
    essential = model(left=None, essential=[(v - a * v.diff(x)).subs(x, 0).doit()])
    np.testing.assert_allclose(essential.natural_frequencies(values)[1:], rigid[1:], rtol=1e-10)


def test_mode_shapes_have_their_axes_sign_and_field(arm):
    station = np.linspace(0.0, 1.1, 5)
    shapes = arm.mode_shapes({**VALUES, k_t: [1e3, 1e4]}, station, modes=3)
    assert shapes.shape == (2, 3, 5) and (shapes[..., -1] > 0).all()
    slope = arm.mode_shapes(VALUES, station, derivative=1)
    near = arm.mode_shapes(VALUES, np.r_[station[2] - 1e-5, station[2] + 1e-5])
    np.testing.assert_allclose((near[:, 1] - near[:, 0]) / 2e-5, slope[:, 2], rtol=1e-6)
    with pytest.raises(ValueError, match=r"x = 1\.2 must be in the domain"):
        arm.mode_shapes(VALUES, [1.2])
    with pytest.raises(ValueError, match="field"):
        arm.mode_shapes(VALUES, station, field=sp.Function("u")(x, t))


def test_modal_parameters_close_the_balance_of_forces(arm):
    """At the root the natural forces are those of the springs; at the tip that of the mass."""
    modes = arm.modal_parameters(VALUES, modes=3)
    np.testing.assert_allclose(modes.frequency, arm.natural_frequencies(VALUES), rtol=1e-12)
    np.testing.assert_allclose(modes.left_force, modes.left * [900.0, 40.0], rtol=1e-6, atol=1e-6)
    np.testing.assert_allclose(modes.right_force[:, 0], 0.05 * modes.omega**2 * modes.right[:, 0], rtol=1e-6)


# what a Lagrangian can be refused for --------------------------------------------------------------------------------

theta = sp.Function("theta")(x, t)


@pytest.mark.parametrize(
    ("build", "message"),
    [
        (lambda: model(BEAM - HALF * N * (v.diff(x) - theta) ** 2), r"theta\(x, t\) is not one of the fields"),
        (lambda: model(BEAM - HALF * N * theta.diff(x) ** 2), r"term -N\*.*: theta\(x, t\) is not one of the fields"),
        (lambda: model(right=HALF * m_e * v.diff(x, 2, t) ** 2), "not a displacement of that end"),
        (lambda: model(essential=[v.subs(x, 0)]), "k_t.*essential"),
        (lambda: model(essential=[v.diff(x, 2).subs(x, 0)], left=None), "not a displacement of an end"),
        (lambda: model(domain=(0, 0)), "domain"),
        (lambda: model(domain=(0, x)), "domain"),
        (lambda: model(right=TIP.subs(v.diff(t), v.diff(t).subs(x, L / 2))), "not an end"),
        (lambda: model(left=-HALF * sp.Symbol("EI", positive=True) * v**2), "two different symbols are named EI"),
    ],
    ids=["field", "its slope", "order", "contradiction", "natural", "empty", "x-end", "interior", "assumptions"],
)
def test_refused_at_once(build, message):
    with pytest.raises(ValueError, match=message):
        build()


def test_a_structure_without_mass_has_no_frequencies():
    with pytest.raises(ValueError, match="no motion of the structure has kinetic energy"):
        model(-HALF * EI * v.diff(x, 2) ** 2, right=None).natural_frequencies({EI: 1, L: 1, k_t: 1, k_r: 1})


def test_a_nonlinear_lagrangian_has_the_frequencies_of_its_linearisation():
    stretched = model(BEAM - N * v.diff(x) ** 4)
    np.testing.assert_array_equal(
        stretched.natural_frequencies({**VALUES, N: 1.0}), model().natural_frequencies(VALUES)
    )


def test_a_parameter_may_have_the_name_of_the_spectral_parameter():
    z, s = sp.symbols("z s")
    plain = model().natural_frequencies(VALUES)
    renamed = model(BEAM.subs(EI, z), left=JOINT.subs(k_t, s))
    values = {z: VALUES[EI], s: VALUES[k_t], **{k: a for k, a in VALUES.items() if k not in (EI, k_t)}}
    np.testing.assert_array_equal(renamed.natural_frequencies(values), plain)


# dimensions ---------------------------------------------------------------------------------------------------------

X, T, LENGTH = table.x, table.t, table.L
Y = table.v
ARM = HALF * table.rho * table.A * Y.diff(T) ** 2 - HALF * table.E * table.I_z * Y.diff(X, 2) ** 2


def declared(density=ARM, left=None, **options):
    return cra.Model(density, fields=[Y], x=X, t=T, domain=(0, LENGTH), left=left, **options)


def test_a_unit_slip_is_named():
    assert declared(left=-HALF * table.k_t * Y**2 - HALF * table.k_r * Y.diff(X) ** 2)
    with pytest.raises(ValueError, match=r"density, term -E\*I_z\*Derivative\(v\(x, t\), x\)\*\*2/2: its dimension is"):
        declared(ARM.subs(Y.diff(X, 2), Y.diff(X)))
    with pytest.raises(ValueError, match=r"left end, term -k_r\*v\(x, t\)\*\*2/2: its dimension is m\^4 kg\^1 s\^-2"):
        declared(left=-HALF * table.k_r * Y**2)


def test_a_unit_slip_in_the_virtual_work_is_named():
    assert declared(virtual_work=[(-table.k_t * Y, Y, "left")])
    with pytest.raises(ValueError, match=r"virtual work on v\(x, t\), term -k_t\*.*its dimension is m\^2 kg\^1 s\^-3"):
        declared(virtual_work=[(-table.k_t * Y.diff(T), Y, "left")])


def test_units_given_by_the_user_are_checked_and_unknown_ones_are_not():
    spring = sp.Symbol("k")
    assert declared(left=-HALF * spring * Y.diff(X) ** 2)
    assert declared(left=-HALF * spring * Y.diff(X) ** 2, units={spring: "N m/rad"})
    with pytest.raises(ValueError, match="left end"):
        declared(left=-HALF * spring * Y.diff(X) ** 2, units={"k": "N/m"})


@pytest.mark.parametrize(
    ("units", "error", "message"),
    [
        ({"rho": "furlong/s"}, ValueError, "unit = 'furlong/s': 'furlong' is not one of 1, rad, m"),
        ({"rho": 3}, TypeError, "unit = 3"),
        (
            {"rhoo": "kg/m^3"},
            ValueError,
            "units: 'rhoo' does not occur in the model; it has A, E, I_z, L, rho, t, v, x",
        ),
        ({sp.Symbol("k"): "N/m"}, ValueError, "units: 'k' does not occur"),
        ({3: "N/m"}, ValueError, "units: '3' does not occur"),
        (["N/m"], TypeError, r"units = \['N/m'\]: must be a mapping"),
    ],
)
def test_units_that_are_none_are_refused(units, error, message):
    with pytest.raises(error, match=message):
        declared(units=units)


def test_the_same_letter_with_other_assumptions_is_another_symbol():
    """T is kinetic energy in the nomenclature; here it is a tension."""
    tension, density = sp.symbols("T rho")
    y = sp.Function("y")(x, t)
    assert cra.Model(
        HALF * density * y.diff(t) ** 2 - HALF * tension * y.diff(x) ** 2, fields=[y], x=x, t=t, domain=(0, L)
    )


def test_models_pickle(arm):
    again = pickle.loads(pickle.dumps(arm))
    np.testing.assert_array_equal(again.natural_frequencies(VALUES), arm.natural_frequencies(VALUES))


def test_kernel_of_the_characteristic_function_vanishes_at_the_frequencies(arm):
    function = arm.kernel()
    assert function.arguments == ("omega", "EI", "L", "k_r", "k_t", "m_e", "rhoA")
    omega = 2 * np.pi * arm.natural_frequencies(VALUES, modes=5)
    values = [VALUES[symbol] for symbol in arm.symbols]
    either_side = function(omega * np.array([[1 - 1e-9], [1 + 1e-9]]), *values)
    assert (either_side[0] * either_side[1] < 0).all()


def test_separation_says_what_it_cannot_do():
    tapered = model(BEAM.subs(EI, EI * (1 + x)))
    with pytest.raises(ValueError, match="ritz"):
        tapered.separate()
    assert (np.diff(tapered.natural_frequencies(VALUES)) > 0).all()


AXIS = "must be a number or one axis of"


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda m: m.mode_shapes(VALUES, [[0.1, 0.2]]), rf"x has shape \(1, 2\): {AXIS} places"),
        (
            lambda m: m.frequency_response(VALUES, [[1.0]], 0.5, drive=v.subs(x, L)),
            rf"frequency has shape .*: {AXIS} freq",
        ),
        (
            lambda m: m.frequency_response(VALUES, 1.0, [[0.5]], drive=v.subs(x, L)),
            rf"x has shape .*: {AXIS} places",
        ),
        (lambda m: m.response(VALUES, None, 0.0, [[0.5]]), rf"x has shape \(1, 1\): {AXIS} places"),
        (
            lambda m: m.frequency_response(VALUES, 1e20, 0.5, drive=v.subs(x, L)),
            "angular_frequency: the waves must not be shorter than a millionth",
        ),
        (
            lambda m: m.frequency_response(VALUES, 1e99, 0.5, drive=v.subs(x, L)),
            r"angular_frequency = 1e\+99: must be",
        ),
        (lambda m: m.natural_frequencies(VALUES, modes=10**6), "modes = 1000000: must be an integer from 1 to 1000"),
        (
            lambda m: m.mode_shapes(VALUES, 0.5, derivative=10**6),
            "derivative = 1000000: must be an integer from 0 to",
        ),
        (
            lambda m: m.mode_shapes(VALUES, 0.5, field=np.zeros(2)),
            r"field = array\(\[0., 0.\]\): must be one of v\(x, t\)",
        ),
        (
            lambda m: m.frequency_response(VALUES, 1.0, 0.5, drive=np.zeros(2)),
            r"drive = array.*: must be one of v\(0, t\)",
        ),
        (
            lambda m: m.frequency_response(VALUES, 1.0, 0.5, drive=v.subs(x, L), kind=np.zeros(2)),
            "kind = array.* must be",
        ),
        (
            lambda m: m.response(VALUES, np.zeros(2), 0.0, 0.5),
            "motion = array.*: must be a BaseMotion or a mapping from functions of t",
        ),
        (
            lambda m: m.response(VALUES, None, 0.0, 0.5, initial=np.zeros(2)),
            "initial = array.*: must be a mapping from",
        ),
    ],
)
def test_arguments_of_a_wrong_shape_or_kind_are_named(arm, call, message):
    with pytest.raises((TypeError, ValueError), match=message):
        call(arm)


@pytest.mark.parametrize("change", [{EI: 1e-300}, {EI: 1.7e308}, {L: 1e300}, {L: 1e-300}, {rhoA: 1e300, L: 1e60}])
def test_numbers_beyond_the_range_of_doubles_are_refused(arm, change):
    """They ended in an eigensolver that did not converge, in nan, or in warnings of NumPy's."""
    values = {**VALUES, **change}
    calls = [
        lambda: arm.natural_frequencies(values, modes=2),
        lambda: arm.mode_shapes(values, [0.0], modes=2),
        lambda: arm.frequency_response(values, [5.0], [0.0], drive=v.subs(x, L)),
        lambda: arm.ritz(2).natural_frequencies(values, modes=2),
    ]
    for call in calls:
        try:
            assert np.isfinite(call()).all()
        except ValueError as error:
            assert not isinstance(error, np.linalg.LinAlgError) and str(error), error


class Hostile:
    """An object that refuses to be a number in its own way."""

    def __float__(self):
        raise RuntimeError("not me")


@pytest.mark.parametrize("stranger", [[1], np.zeros(2), Hostile(), b"1", len, sp.Matrix([1, 2]), int, {}])
@pytest.mark.parametrize("place", ["density", "left", "domain", "essential", "prescribed", "fields", "virtual_work"])
def test_what_is_no_expression_is_named(place, stranger):
    one = {"density": stranger, "left": stranger, "domain": (0, stranger), "virtual_work": [(stranger, v, "left")]}
    with pytest.raises((TypeError, ValueError), match=f"^{place.replace('_', '.')}.*must be"):
        model(**{place: one.get(place, [stranger])})


@pytest.mark.parametrize("given", [1, sp.Function("y")(t)])
def test_a_displacement_that_is_given_is_refused(given):
    """Frequencies do not depend on it, but a response would, and would be silent about it."""
    with pytest.raises(ValueError, match=r"essential, v\(0, t\) = .*: must be 0; measure the displacement from there"):
        model(left=None, essential=[v.subs(x, 0) - given])


@pytest.mark.parametrize("place", [1.5, -0.25])
@pytest.mark.parametrize(
    "term", ["inside", "essential", "virtual_work", "density"], ids=["spring", "support", "force", "impulse"]
)
def test_a_place_outside_the_domain_is_refused(term, place):
    a = sp.Symbol("a")
    added = {
        "inside": [(a, -k_t * v**2 / 2)],
        "essential": [v.subs(x, a)],
        "virtual_work": [(-c * v.diff(t), v, a)],
        "density": BEAM - k_t * sp.DiracDelta(x - a) * v**2 / 2,
    }[term]
    given = {name: value for name, value in {**VALUES, c: 1.0}.items()} | {a: place}
    changed = model(**{term: added})
    analysis = changed.eigenvalues if term == "virtual_work" else changed.natural_frequencies
    with pytest.raises(ValueError, match=rf"inside: a place is at x = {place}; must be in the domain, \(0, 1.1\)"):
        analysis({name: given[name] for name in changed.symbols}, modes=2)
