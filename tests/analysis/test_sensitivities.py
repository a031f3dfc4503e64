"""Sensitivities: two routes against each other, finite differences at 30 digits, limits, and the claims that rest on
them."""

import mpmath
import numpy as np
import pytest
import sympy as sp
from hypothesis import given, settings
from hypothesis import strategies as st

import cra_sym as cra
from cra_sym import Arm
from cra_sym.analysis.sensitivities import Sensitivities
from cra_sym.paper.frequency_equation import frequency_function
from cra_sym.paper.oracles.implicit_rates import implicit_rates
from cra_sym.symbols import L, t, v, x
from tests.systems import system

FIELDS = ("k_t", "k_r", "m_e", "J_e", "L", "b", "h", "E", "rho")
ELASTIC = Arm.nominal().replace(k_t=2e3, k_r=60.0, m_e=0.02, J_e=2e-4)


def frequency(values, near):
    """Return the root of the frequency equation nearest to a frequency parameter, as a frequency, at working
    precision."""
    function, arguments = frequency_function()
    v = {name: mpmath.mpf(value) for name, value in values.items()}
    EI, line = v["E"] * v["b"] * v["h"] ** 3 / 12, v["rho"] * v["b"] * v["h"]
    kappa_t, kappa_r = v["k_t"] * v["L"] ** 3 / EI, v["k_r"] * v["L"] / EI
    pairs = [x for kappa in (kappa_t, kappa_r) for x in (kappa / (1 + kappa), 1 / (1 + kappa))]
    numbers = [*pairs, v["m_e"] / (line * v["L"]), v["J_e"] / (line * v["L"] ** 3)]
    numeric = sp.lambdify(arguments, function, "mpmath")
    lam = mpmath.findroot(lambda x: numeric(x, *numbers), near)
    return lam**2 * mpmath.sqrt(EI / line) / (2 * mpmath.pi * v["L"] ** 2)


@pytest.mark.parametrize("field", FIELDS)
def test_finite_differences_at_30_digits(field):
    found = cra.sensitivities(ELASTIC)
    values = {name: getattr(ELASTIC, name) for name in FIELDS}
    lam = np.sqrt(2 * np.pi * cra.natural_frequencies(ELASTIC) / ELASTIC.angular_frequency_scale)
    with mpmath.workdps(45):
        step = mpmath.mpf(10) ** -15 * mpmath.mpf(values[field])
        for mode in range(3):
            up, down = (
                frequency(values | {field: mpmath.mpf(values[field]) + side * step}, lam[mode]) for side in (1, -1)
            )
            slope = float((up - down) / (2 * step))
            relative = float((up - down) / (2 * step) * values[field] / up)
            assert getattr(found, f"df_d{field}")[mode] == pytest.approx(slope, rel=1e-10)
            assert getattr(found, f"log_{field}")[mode] == pytest.approx(relative, rel=1e-10)


def stiffnesses(low, high):
    return st.sampled_from([0.0, np.inf]) | st.floats(low, high).map(lambda power: 10**power)


def positive(high):
    return st.floats(0, high, allow_subnormal=False)


@settings(max_examples=30, deadline=None, derandomize=True)
@given(stiffnesses(0, 7), stiffnesses(-1, 6), positive(0.2), positive(1e-2))
def test_the_two_routes_agree_for_every_stiffness(k_t, k_r, m_e, J_e):
    arm = Arm.nominal().replace(k_t=k_t, k_r=k_r, m_e=m_e, J_e=J_e)
    found, frequency = cra.sensitivities(arm, 4), cra.natural_frequencies(arm, 4)
    clear = 2 * np.pi * frequency > 0.25 * arm.angular_frequency_scale  # below, the determinant's derivatives cancel
    for name, rate in implicit_rates(arm, 4).items():
        ours = getattr(found, f"df_d{name}")[clear]
        theirs = rate[clear] / (8 * np.pi**2 * frequency[clear])  # d omega^2 = 8 pi^2 f df
        assert theirs == pytest.approx(ours, rel=2e-7, abs=1e-9 * np.abs(ours).max(initial=1e-290)), name


def test_infinite_stiffness_is_the_limit():
    rigid = cra.sensitivities(Arm.nominal())
    for name in ("df_dk_t", "df_dk_r", "log_k_t", "log_k_r"):
        assert getattr(rigid, name).tolist() == [0.0, 0.0, 0.0]
    compliance = 1e-9
    f = cra.natural_frequencies(Arm.nominal())
    soft = cra.natural_frequencies(Arm.nominal().replace(k_t=1 / compliance)) - f
    assert rigid.df_dc_t == pytest.approx(soft / compliance, rel=1e-4)
    assert cra.sensitivities(Arm.nominal().replace(k_r=1e12)).df_dc_r == pytest.approx(rigid.df_dc_r, rel=1e-9)


def test_rigid_body_modes_have_the_documented_limits():
    pinned = cra.sensitivities(Arm.nominal().replace(k_t=1e3, k_r=0.0))
    assert pinned.df_dk_r[0] == np.inf and pinned.df_dk_t[0] == 0.0
    assert np.isnan(pinned.log_k_r[0]) and pinned.df_dm_e[0] == pinned.df_dL[0] == pinned.df_drho[0] == 0.0
    held = cra.natural_frequencies(Arm.nominal().replace(k_t=1e3, k_r=[0.0, 1e-6]))
    assert pinned.df_dk_r[1] == pytest.approx((held[1] - held[0])[1] / 1e-6, rel=1e-4)
    sliding = cra.sensitivities(Arm.nominal().replace(k_t=0.0))
    assert sliding.df_dk_t[0] == np.inf
    free = cra.sensitivities(Arm.nominal().replace(k_t=0.0, k_r=0.0))
    for raw in (free.df_dk_t, free.df_dk_r, free.df_dc_t, free.df_dc_r):
        assert np.isnan(raw[:2]).all() and not np.isnan(raw[2])


@settings(max_examples=25, deadline=None, derandomize=True)
@given(st.floats(1, 6), st.floats(0, 5), positive(0.2))
def test_signs_and_sums_of_energy(power_t, power_r, m_e):
    """Stiffness raises, inertia lowers; the shares of strain energy of joint and manipulator add up to one."""
    found = cra.sensitivities(Arm.nominal().replace(k_t=10**power_t, k_r=10**power_r, m_e=m_e))
    assert (found.log_k_t >= 0).all() and (found.log_k_r >= 0).all() and (found.log_m_e <= 0).all()
    assert found.log_k_t + found.log_k_r + found.log_E == pytest.approx(0.5)
    assert found.log_m_e + found.log_J_e + found.log_rho == pytest.approx(-0.5)
    by_dimensions = -2 + 3 * found.log_k_t + found.log_k_r - found.log_m_e - 3 * found.log_J_e
    assert found.log_L == pytest.approx(by_dimensions)


def test_near_the_rigid_joint_every_mode_loses_2_over_kappa_r_and_more_over_kappa_t():
    kappa = 1e6
    arm = Arm.nominal().replace(m_e=0.0)
    stiff = arm.replace(k_t=kappa * arm.EI / arm.L**3, k_r=kappa * arm.EI / arm.L)
    found = cra.sensitivities(stiff)
    # shear force 2 sigma lam^3 of the clamped root: kappa_t d ln omega / d ln k_t = (2 sigma lam^3)^2 / (2 lam^4)
    lam = np.array([1.875104068711961, 4.694091132974175, 7.854757438237613])
    sigma = (np.sinh(lam) - np.sin(lam)) / (np.cosh(lam) + np.cos(lam))
    # the next term is lam^3 / kappa, three springs' worth of it
    assert found.log_k_r * kappa == pytest.approx(2.0, rel=1e-3)
    assert found.log_k_t * kappa == pytest.approx(2 * (sigma * lam) ** 2, rel=3 * lam[-1] ** 3 / kappa)


def test_batches_broadcast():
    arms = Arm.nominal().replace(k_t=np.array([[1e3], [np.inf]]), m_e=[0.0, 0.001, 0.005])
    found = cra.sensitivities(arms, 2)
    assert found.log_k_t.shape == found.df_dL.shape == (2, 3, 2)
    one = cra.sensitivities(Arm.nominal().replace(k_t=1e3, m_e=0.005), 2)
    assert found.df_dk_t[0, 2] == pytest.approx(one.df_dk_t)


@pytest.mark.parametrize("arguments", [{"modes": 0}, {"by": "k_t"}, {"by": ["stiffness"]}])
def test_bad_input_is_named(arguments):
    (name,) = arguments
    with pytest.raises((TypeError, ValueError), match=f"{name} = "):
        cra.sensitivities(Arm.nominal(), **arguments)


def test_shapes_and_participation_follow_a_spring_as_along_the_frequency_equation():
    """Gamma_i phi_i(L) by closed form; the sum of what both do, by differences of eighth order."""
    arm = Arm.nominal().replace(L=1.1, k_t=[8e2, 2e4], k_r=60.0, m_e=0.03, J_e=1e-4)
    found, modal = cra.sensitivities(arm, 3), cra.modal_parameters(arm, 3)
    for name, channel in (("k_t", (0, 0)), ("k_r", (0, 1)), ("m_e", (1, 0)), ("J_e", (1, 1))):
        both = found.participation(name) * modal.tip_displacement + modal.participation * found.shapes(name, arm.L)
        by = "inertia" if channel[0] else "stiffness"
        end, place, factor = arm.numerics("inertias" if channel[0] else "stiffnesses")[name]
        assert (end, place) == channel
        exact, _ = arm.modes(3).product_rates(1, 0, channel, by)
        share = arm.numerics("load", "w").share.function(*arm.domain.values)
        exact = -np.asarray(share * factor.function(*arm.domain.values))[..., None] * exact
        value = np.broadcast_to(arm.values[name], (2,))[:, None]
        size = np.abs(modal.participation * modal.tip_displacement).max()
        np.testing.assert_allclose(value * both, value * exact, rtol=0, atol=1e-9 * size, err_msg=name)


@pytest.mark.parametrize("name", ["Timoshenko beam", "gantry", "hanging beam"])
def test_shapes_of_any_system_follow_every_parameter(name):
    """Against central differences extrapolated to no step, at places and for every field."""
    system_ = system(name)
    found = cra.sensitivities(system_, 2)
    share = np.array([0.0, 0.31, 1.0])
    for parameter in system_.values:
        steps = []
        for size in (2e-3, 1e-3):
            moved = [system_.replace(**{parameter: system_.values[parameter] * (1 + s * size)}) for s in (1, -1)]
            up, down = (cra.mode_shapes(one, share * one.values["l"], 2) for one in moved)
            gamma = [cra.modal_parameters(one, 2).participation for one in moved]
            steps.append((up - down, gamma[0] - gamma[1], 2 * size * system_.values[parameter]))
        (up2, gamma2, h2), (up1, gamma1, h1) = steps
        shape, gamma = (4 * up1 / h1 - up2 / h2) / 3, (4 * gamma1 / h1 - gamma2 / h2) / 3
        size = np.abs(cra.mode_shapes(system_, 1.2, 2)).max() / system_.values[parameter]
        # the fourth power of a step of 2e-3, times what a fifth derivative may be
        np.testing.assert_allclose(found.shapes(parameter, share * 1.2), shape, rtol=0, atol=1e-7 * size)
        np.testing.assert_allclose(found.participation(parameter), gamma, rtol=0, atol=1e-7 * size)


def test_the_mass_alone_scales_shapes():
    """Exact: without an end mass shapes go with the inverse root of the mass, participation with its root."""
    arm = Arm.nominal().replace(m_e=0.0, k_t=1e3, k_r=40.0)
    found, x = cra.sensitivities(arm, 3), np.linspace(0, 1, 5)
    exact = -cra.mode_shapes(arm, x, 3) / (2 * arm.rho)
    np.testing.assert_allclose(found.shapes("rho", x), exact, rtol=0, atol=1e-9 * np.abs(exact).max())
    gamma = cra.modal_parameters(arm, 3).participation / (2 * arm.rho)
    np.testing.assert_allclose(found.participation("rho"), gamma, rtol=1e-9)
    rigid = cra.sensitivities(Arm.nominal(), 2)
    assert not rigid.shapes("k_t", 1.0).any() and rigid.participation("k_r").shape == (2,)
    with pytest.raises(ValueError, match="name = 'A': must be one of L"):
        found.shapes("A", 0.5)
    with pytest.raises(ValueError, match="x = 2 must be in the domain"):
        found.shapes("rho", 2.0)


@pytest.mark.parametrize("name", ["a", "L"])
def test_parameters_of_what_holds_a_motion(name):
    """Joined ends, a clamp that turns and a rigid link: by differences of frequencies."""
    a, k, m = sp.symbols("a k m")
    payload = sp.Function("p")(t)
    string, bending = (m * v.diff(t) ** 2 / 2 - v.diff(x, order) ** 2 / 2 for order in (1, 2))
    common = {"fields": [v], "x": x, "domain": (0, L), "t": t}
    models = [
        cra.Model(string, left=-(v**2), essential=[v.subs(x, 0) - a * v.subs(x, L)], **common),
        cra.Model(bending, essential=[v.subs(x, 0), v.subs(x, L) - a * v.diff(x).subs(x, L)], **common),
        cra.Model(string, essential=[v.subs(x, 0)], coordinates=[payload], **common,
                  right=m * payload.diff(t) ** 2 / 2 - k * (v - a * payload) ** 2 / 2),
        cra.Model(bending, essential=[v.subs(x, 0)], coordinates=[payload], **common,
                  right=m * payload.diff(t) ** 2 / 2 - k * (v.diff(x) - a * payload) ** 2 / 2),
    ]  # fmt: skip
    for model in models:
        values = {s.name: {"a": 0.7, "k": np.inf, "m": 1.3, "L": 1.1}[s.name] for s in model.symbols}
        step = 1e-5  # the error is of the order of its square, and 1e-13 over it
        moved = [cra.natural_frequencies(model.at(values | {name: values[name] * (1 + s)}), 3) for s in (-step, step)]
        rate = (moved[1] - moved[0]) / (2 * step * values[name])
        found = cra.sensitivities(model.at(values), 3).rate[name]
        np.testing.assert_allclose(found, rate, atol=1e-7 * np.abs(rate).max())


def test_places_where_springs_of_one_mass_are_fixed_move_on_their_own():
    """A mass that hangs on the span by springs at two places: rates by each place and by the length."""
    length, density, bending, spring, mass, near, far, x, t = sp.symbols("l d B s m a b x t")
    field, hung = sp.Function("v")(x, t), sp.Function("q")(t)
    model = cra.Model(
        density * field.diff(t) ** 2 / 2 - bending * field.diff(x, 2) ** 2 / 2,
        fields=[field], coordinates=[hung], x=x, domain=(0, length), t=t,
        left=mass * hung.diff(t) ** 2 / 2, essential=[field.subs(x, 0), field.subs(x, length)],
        inside=[(near, -spring * (field - hung) ** 2 / 2), (far, -spring * (field - hung / 2) ** 2)],
    )  # fmt: skip
    values = {"l": 1.0, "d": 0.5, "B": 4.0, "s": 200.0, "m": 0.15, "a": 0.37, "b": 0.71}
    system = model.at(values)
    found = cra.sensitivities(system, 3)
    h = 1e-3
    for name in ("a", "b", "l"):
        at = {k: cra.natural_frequencies(system.replace(**{name: values[name] + k * h}), 3) for k in (-2, -1, 1, 2)}
        slope = (8 * (at[1] - at[-1]) - at[2] + at[-2]) / (12 * h)
        # fourth order: h^4 times a fifth derivative of about (4 pi)^5/30 f; rounding 1e-13 f/h
        np.testing.assert_allclose(found.rate[name], slope, rtol=0, atol=1e-7 * at[1].max())


@pytest.mark.parametrize("name", ["Timoshenko beam", "tensioned beam", "gantry"])
def test_rates_along_the_determinant_are_those_of_the_energies(name):
    """Rates of a root by its determinant, and first-order perturbation with modes: two routes to d omega^2 / dp."""
    given = system(name, k=[300.0, 800.0, np.inf])
    omega = given.natural_frequencies(3)
    forms, held = given.form("rates", 3, diagonal=True), given.numerics("held_motions")
    rates = given.root_rates(3, tuple(given.values))
    assert rates.keys() == given.values.keys()
    for parameter, value in given.values.items():
        energies = forms[f"{parameter} stiffness"] - omega**2 * forms[f"{parameter} mass"]
        energies = energies + held.rate(given, parameter, 3)
        finite = np.broadcast_to(np.isfinite(np.reshape(value, (-1, 1))), omega.shape)  # by inf there is no rate
        scale = (omega**2 / np.reshape(value, (-1, 1)))[finite]
        # rounding of modes by quadrature, of roots and of their slopes: each about 1e-13
        assert np.abs((rates[parameter] - energies)[finite] / scale).max() < 1e-11


@pytest.mark.parametrize("name", ["Timoshenko beam", "tensioned beam", "gantry"])
def test_compiled_rates_along_the_determinant_are_the_same(name, monkeypatch):
    pytest.importorskip("llvmlite")
    rng, values = np.random.default_rng(3), dict(system(name).values)
    spread = {key: np.asarray(value) * rng.uniform(0.5, 2.0, 150) for key, value in values.items()}
    given = system(name).replace(**spread | {"k": np.where(rng.random(150) < 0.1, np.inf, spread["k"])})
    by_numpy = given.root_rates(3, tuple(values))
    monkeypatch.setattr("cra_sym.model.waves.wants_compiler", lambda roots, parts: True)
    compiled = given.replace().root_rates(3, tuple(values))
    assert by_numpy.keys() == compiled.keys() == values.keys()
    for key, rate in by_numpy.items():  # rounding of a determinant near its root, over its slope: about 1e-13
        np.testing.assert_allclose(compiled[key], rate, rtol=1e-11, atol=1e-13 * np.abs(rate).max())


@pytest.mark.parametrize("machine_code", [False, True])
def test_close_roots_leave_their_rates_to_the_modes(machine_code, monkeypatch):
    """Two strings that a weak spring joins: the difference of their frequencies is not a slope of a determinant."""
    if machine_code:
        pytest.importorskip("llvmlite")
        monkeypatch.setattr("cra_sym.model.waves.wants_compiler", lambda roots, parts: True)
    rho, T, S, k, x, t = sp.symbols("rho T S k x t")
    u, y = (sp.Function(name)(x, t) for name in ("u", "y"))
    energy = rho * (u.diff(t) ** 2 + y.diff(t) ** 2) / 2 - T * u.diff(x) ** 2 / 2 - S * y.diff(x) ** 2 / 2
    joined = cra.Model(energy, fields=[u, y], x=x, domain=(0, 1), t=t, essential=[u.subs(x, 0), y.subs(x, 0)],
                       right=-k * (u - y) ** 2 / 2)  # fmt: skip
    for S_value, weak in ((1.0 + 1e-6, 1e-8), (1.0, 0.0)):  # close, and equal
        given = joined.at({rho: 1.0, T: 1.0, S: S_value, k: weak})
        assert not given.root_rates(1, ("T",))  # the second root, which is not asked for, is close
        assert not given.root_rates(2, ("T",))
    assert joined.at({rho: 1.0, T: 1.0, S: 1.3, k: 0.1}).root_rates(2, ("T",))
    same = joined.at({rho: 1.0, T: 1.0, S: 1.0, k: 0.1})
    even, odd = cra.sensitivities(same, 2).log["k"]
    assert abs(even) < 1e-13  # both move alike; the other one has w cos w + 2 k sin w = 0
    w = same.natural_frequencies(2)[1]
    slope = np.cos(w) - w * np.sin(w) + 0.2 * np.cos(w)
    assert odd == pytest.approx(-2 * np.sin(w) / slope * 0.1 / w, rel=1e-12)


def test_rates_read_as_a_mapping():
    found = cra.sensitivities(cra.Arm.nominal(), by=("L", "m_e"))
    assert repr(found).endswith("Hz by L, m_e: rate, log, compliance>")
    assert repr(found.log) == f"Rates({{'L': {found.log['L']!r}, 'm_e': {found.log['m_e']!r}}})"


def test_a_support_that_moves_changes_the_spans_beside_it():
    """It had been taken to stand still. A string over a support is two strings; the nearer to the end, too."""
    x, t, tension, mass, length, place = sp.symbols("x t T m l a")
    v = sp.Function("v")(x, t)
    string = cra.Model(
        mass * v.diff(t) ** 2 / 2 - tension * v.diff(x) ** 2 / 2, fields=[v], x=x, domain=(0, length), t=t,
        essential=[v.subs(x, at) for at in (0, place, length)],
    )  # fmt: skip
    for near in (0.5, 1e-3):
        found = cra.sensitivities(string.at({"T": 20.0, "m": 0.3, "l": 1.2, "a": near}), 2)
        spans = np.array([1.2 - near, near]) if near == 0.5 else 1.2 - near  # of two modes of one span, or of both
        long = np.array([1.0, 0.0]) if near == 0.5 else 1.0
        np.testing.assert_allclose(found.rate["a"], found.frequency / spans * (2 * long - 1), rtol=1e-8)
        np.testing.assert_allclose(found.rate["l"], -found.frequency / spans * long, rtol=1e-8, atol=1e-8)


def test_each_rate_is_computed_once_and_only_when_it_is_asked_for(monkeypatch):
    computed = []
    monkeypatch.setattr(Sensitivities, "_raw", lambda self, name: computed.append(name) or np.ones(3))
    found = cra.sensitivities(cra.Arm.nominal(), 3, by=("k_t", "k_r"))
    assert "k_t" in found.rate and "L" not in found.rate and not computed
    assert found.df_dk_r.size == 3 and computed == ["k_r"]


def test_rates_that_several_results_share_are_not_writable():
    found = cra.sensitivities(cra.Arm.nominal().replace(k_t=1e3), 3)
    for rate in (found.df_dk_t, found.log_k_t):
        with pytest.raises(ValueError, match="read-only"):
            rate[0] = 0.0


@pytest.mark.parametrize("damped", [False, True])
def test_shapes_beside_a_mass_that_moves(damped):
    """They were off by percents near the mass, which the steps of a difference had moved past the place.

    The two sines of a string of unit tension and density with a mass at a, in 30 digits; at the mass itself, where
    both sides differ, their mean.
    """
    m, a, c = sp.symbols("m a c")
    y = sp.Function("y")(x, t)
    string = cra.Model(
        y.diff(t) ** 2 / 2 - y.diff(x) ** 2 / 2, fields=[y], x=x, domain=(0, 1), t=t,
        inside=[(a, m * y.diff(t) ** 2 / 2)], essential=[y.subs(x, 0), y.subs(x, 1)],
        virtual_work=[(-c * y.diff(t), y, "domain")] if damped else None,
    ).at({"m": 0.3, "a": 0.3} | ({"c": 1e-4} if damped else {}))  # fmt: skip
    places = np.array([0.2999, 0.3, 0.3001, 0.32, 0.8])
    omega = 2 * np.pi * cra.natural_frequencies(string, 2)

    def shape(start, place, left, at):
        beta = mpmath.findroot(
            lambda b: mpmath.cot(b * at) + mpmath.cot(b * (1 - at)) - mpmath.mpf("0.3") * b, start, tol=1e-25
        )
        sides = [mpmath.sin(beta * s) / mpmath.sin(beta * e) for s, e in ((place, at), (1 - place, 1 - at))]
        energy = sum((e / 2 - mpmath.sin(2 * beta * e) / (4 * beta)) / mpmath.sin(beta * e) ** 2 for e in (at, 1 - at))
        size = mpmath.sqrt(energy + mpmath.mpf("0.3"))
        return (sides[0] if left else sides[1]) / size * mpmath.sign(mpmath.sin(beta * (1 - at)))

    with mpmath.workdps(30):
        at = mpmath.mpf(0.3)

        def rate(start, place, left):
            return mpmath.diff(lambda moved: shape(start, place, left, moved), at)

        sides = [[[rate(w, mpmath.mpf(p), left) for p in places] for w in omega] for left in (True, False)]
    before, after = np.array(sides, dtype=float)
    exact = np.where(places < 0.3, before, np.where(places > 0.3, after, (before + after) / 2))
    found = cra.sensitivities(string, 2, ["a"]).shapes("a", places, damped=damped)
    # differences of eighth order, about 1e-10; with the damper of complex modes, whose shapes it turns by 1e-4 / omega
    np.testing.assert_allclose(found.real, exact, rtol=0, atol=(1e-7 if damped else 1e-9) * np.abs(exact).max())
