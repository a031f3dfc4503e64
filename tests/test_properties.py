"""Laws that hold whatever the arm: scaling, interlacing, symmetry, limits; broadcasting of every public function."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import cra_sym as cra

quick = settings(max_examples=12, deadline=None, derandomize=True, database=None)
stiffnesses = st.one_of(st.sampled_from([0.0, np.inf]), st.floats(-2, 7).map(lambda x: 10.0**x))
inertias = st.one_of(st.just(0.0), st.floats(-5, 1).map(lambda x: 10.0**x))
factors = st.floats(-1, 1).map(lambda x: 10.0**x)
arms = st.builds(
    lambda k_t, k_r, m_e, J_e: cra.Arm.nominal().replace(k_t=k_t, k_r=k_r, m_e=m_e, J_e=J_e),
    stiffnesses, stiffnesses, inertias, inertias,
)  # fmt: skip
elastic = st.builds(
    lambda k_t, k_r, m_e: cra.Arm.nominal().replace(k_t=10.0**k_t, k_r=10.0**k_r, m_e=m_e),
    st.floats(1, 5), st.floats(0, 4), st.floats(0, 0.2, allow_subnormal=False),
)  # fmt: skip
SPRING = cra.JointStiffness(k_t=1.0, k_r=0.5)


def scaled(arm, **factors):
    return arm.replace(**{name: getattr(arm, name) * factor for name, factor in factors.items()})


@quick
@given(arms, factors)
def test_all_lengths(arm, c):
    """An arm c times as large in every direction: mass as c^3, inertia c^5, springs c and c^3, frequencies 1 / c."""
    larger = scaled(arm, L=c, b=c, h=c, m_e=c**3, J_e=c**5, k_t=c, k_r=c**3, m_b=c**3)
    one, two = cra.modal_parameters(arm), cra.modal_parameters(larger)
    np.testing.assert_allclose(two.omega * c, one.omega, rtol=1e-13, atol=1e-200)
    size = np.sqrt(arm.rhoA * arm.L + arm.m_e)
    np.testing.assert_allclose(two.participation / c**1.5 / size, one.participation / size, atol=1e-11)


@quick
@given(arms, factors, factors)
def test_modulus_and_density(arm, c, d):
    """Moduli and springs times c, densities and masses times d: frequencies times sqrt(c / d), the same shapes."""
    other = scaled(arm, E=c, k_t=c, k_r=c, rho=d, m_e=d, J_e=d, m_b=d)
    one, two = cra.natural_frequencies(arm), cra.natural_frequencies(other)
    np.testing.assert_allclose(two, one * np.sqrt(c / d), rtol=1e-13)
    shapes = [cra.mode_shapes(x, [0.0, 0.4, 1.0]) for x in (arm, other)]
    np.testing.assert_allclose(shapes[1] * np.sqrt(d), shapes[0], atol=1e-10 * np.abs(shapes[0]).max())


@quick
@given(arms, st.sampled_from(["k_t", "k_r", "m_e", "J_e"]), factors)
def test_interlacing_of_the_physical_parameters(arm, name, c):
    """One spring or one inertia is a change of rank one: each frequency moves one way and not past its neighbour."""
    more = arm.replace(**{name: (getattr(arm, name) or 1e-3) * (1 + c)})
    low, high = cra.natural_frequencies(arm, modes=5), cra.natural_frequencies(more, modes=5)
    if name in ("m_e", "J_e"):
        low, high = high, low
    slack = 1 + 1e-13
    assert (low <= high * slack).all() and (high[:-1] <= low[1:] * slack).all()


@quick
@given(arms)
def test_couplings_are_symmetric_and_positive(arm):
    p = cra.modal_parameters(arm)
    for matrix in (p.axial, p.stiffness_translation, p.stiffness_rotation):
        size = np.abs(matrix).max()
        np.testing.assert_array_equal(matrix, matrix.T)
        assert np.linalg.eigvalsh(matrix).min() >= -1e-11 * size
    assert (p.participation**2).sum() <= (arm.rhoA * arm.L + arm.m_e) * (1 + 1e-12)  # Bessel


@quick
@given(elastic, st.sampled_from(["k_t", "k_r"]), st.sampled_from([0.0, np.inf]))
def test_continuous_through_zero_and_infinity(arm, name, end):
    near = arm.replace(**{name: 1e-9 if end == 0 else 1e13})
    there = arm.replace(**{name: end})
    for function in (cra.natural_frequencies, lambda a: cra.tip_response(a, cra.BaseMotion(acceleration=0.1), 0.3)):
        np.testing.assert_allclose(function(near), function(there), rtol=1e-5, atol=1e-4 * (end == 0))


@settings(quick, max_examples=5)
@given(elastic, st.floats(0.5, 2.2), st.floats(0, 0.3, allow_subnormal=False), st.floats(0.001, 0.1))
def test_undamped_multipliers_come_in_reciprocal_pairs(arm, ratio, epsilon, zeta):
    """Next to no damping takes the route that knows of no pairs; without excitation only damping changes amplitudes."""
    omega = cra.modal_parameters(arm, 2).omega
    slight, damped = cra.floquet_exponents(
        arm.replace(zeta=[1e-14, zeta]), SPRING, ratio * omega[0], [epsilon, 0.0], modes=2
    )
    pairs = cra.floquet_exponents(arm, SPRING, ratio * omega[0], epsilon, modes=2)
    for other in (-slight, pairs):
        np.testing.assert_allclose(np.sort(slight.real), np.sort(other.real), atol=1e-6 * omega[0])
    np.testing.assert_allclose(damped.real, -zeta * omega.repeat(2), rtol=1e-9)
    growth = cra.growth_rate(arm, SPRING, omega[0] * np.array([ratio, 2.0, 1.0]), 0.0, modes=2)
    assert ((growth >= 0) & (growth <= 1e-13 * omega[0])).all()


@quick
@given(elastic, st.floats(1e-3, 0.05))
def test_boundaries_are_scaled_like_frequencies(arm, epsilon):
    """Lower below upper, about twice the natural frequency; a stiffer and denser arm has the same ratio."""
    lower, upper = cra.stability_boundary(arm, cra.JointStiffness(k_t=1.0), epsilon, (1, 1))
    twice = 2 * cra.modal_parameters(arm).omega[0]
    assert lower <= twice * (1 + 1e-12) and twice <= upper * (1 + 1e-12)
    other = scaled(arm, E=4.0, k_t=4.0, k_r=4.0)
    np.testing.assert_allclose(
        cra.stability_boundary(other, cra.JointStiffness(k_t=1.0), epsilon, (1, 1)), [2 * lower, 2 * upper], rtol=1e-12
    )


@quick
@given(elastic, st.floats(-3, 3), st.floats(0.01, 1.0))
def test_responses_are_linear_in_the_motion(arm, c, t):
    one, two = cra.BaseMotion(velocity=0.1), cra.BaseMotion(amplitude=1e-3, angular_frequency=11.0)
    both = cra.BaseMotion(velocity=0.1 * c) + two
    expected = c * cra.tip_response(arm, one, t) + cra.tip_response(arm, two, t)
    assert cra.tip_response(arm, both, t) == pytest.approx(expected, abs=1e-13)


@quick
@given(elastic, st.floats(0.1, 300.0))
def test_undamped_steady_motion_is_real_and_damping_turns_it(arm, omega):
    undamped = cra.frequency_response(arm, omega)
    assert abs(undamped.imag) <= 1e-12 * abs(undamped.real) or not np.isfinite(undamped)
    assert np.sign(cra.frequency_response(arm.replace(zeta=0.01), omega).imag) != 0


@quick
@given(elastic)
def test_logarithmic_sensitivities_are_shares(arm):
    s = cra.sensitivities(arm)
    assert (s.log_k_t >= 0).all() and (s.log_k_r >= 0).all() and (s.log_k_t + s.log_k_r <= 0.5 + 1e-12).all()


ARM = cra.Arm.nominal().replace(k_t=[[1e2], [1e4]], k_r=[5.0, 50.0, np.inf], m_e=0.01, zeta=0.01)


def stop(u):
    return cra.BaseMotion.trapezoid(0.1 * u(1), 0.2 * u(1, -1), u(1, -2))


def move(u):
    return cra.BaseMotion(velocity=0.1 * u(1, -1), amplitude=1e-3 * u(1), angular_frequency=12.0 * u(0, -1))


def residual_gradient(arm, u):
    """By k_t, k_r and duration, each step as long as the units make it."""
    steps = [u(0, -2, 1), u(2, -2, 1), u(0, 1)]
    return cra.residual_vibration_gradient(arm, stop(u))[1] * steps


#: What each function of arms returns, and in which powers of length, time and mass. u(l, t, m) is a unit made of them.
NUMERIC = {
    "natural_frequencies": (lambda arm, u: cra.natural_frequencies(arm), (0, -1, 0)),
    "frequency_parameters": (
        lambda arm, u: cra.frequency_parameters(arm.kappa_t, arm.kappa_r, arm.mu, arm.iota), (0, 0, 0),
    ),
    "mode_shapes": (lambda arm, u: cra.mode_shapes(arm, u(1) * np.array([0.0, 0.3, 1.0])), (0, 0, -0.5)),
    "modal_parameters": (lambda arm, u: cra.modal_parameters(arm).axial, (-1, 0, 0)),
    "response": (
        lambda arm, u: cra.response(arm, move(u), u(0, 1) * np.array([0.1, 0.7]), u(1) * np.array([0.0, 1.0])),
        (1, 0, 0),
    ),
    "tip_response": (lambda arm, u: cra.tip_response(arm, move(u), u(0, 1) * np.array([0.1, 0.7])), (1, 0, 0)),
    "residual_vibration": (lambda arm, u: cra.residual_vibration(arm, stop(u)), (1, 0, 0)),
    "residual_vibration_gradient": (residual_gradient, (1, 0, 0)),
    "frequency_response": (lambda arm, u: cra.frequency_response(arm, u(0, -1) * np.array([3.0, 40.0])), (0, 2, 0)),
    "sensitivities": (lambda arm, u: cra.sensitivities(arm).df_dk_t, (0, 1, -1)),
    "eigenvalues": (lambda arm, u: cra.eigenvalues(arm, 2).imag, (0, -1, 0)),
    "damping_ratios": (lambda arm, u: cra.damping_ratios(arm, 2), (0, 0, 0)),
    "certify": (lambda arm, u: cra.certify(arm, modes=2).lower, (0, -1, 0)),
    "certify_eigenvalues": (lambda arm, u: cra.certify_eigenvalues(arm, modes=2).lower.imag, (0, -1, 0)),
    "floquet_exponents": (
        lambda arm, u: cra.floquet_exponents(arm, SPRING, 30.0 * u(0, -1), 0.05, modes=2).real, (0, -1, 0),
    ),
    "growth_rate": (lambda arm, u: cra.growth_rate(arm, SPRING, 30.0 * u(0, -1), 0.05, modes=2), (0, -1, 0)),
    "forced_width": (lambda arm, u: cra.forced_width(arm, cra.TransverseBase(amplitude=0.01 * u(1))), (1, -1, 0)),
    "stability_boundary": (
        lambda arm, u: np.stack(cra.stability_boundary(arm.replace(zeta=0.0), SPRING, 0.05, (1, 2)), axis=-1),
        (0, -1, 0),
    ),
}  # fmt: skip
#: A rigid-body mode has no frequency to resonate with, and a spring gives it one at a rate beyond all bounds.
BROKEN_AT_ZERO = {"stability_boundary", "sensitivities", "residual_vibration_gradient"}
#: Those of one arm, or of none.
SINGLE = {
    "identify": (
        lambda arm, u: cra.identify(arm, cra.natural_frequencies(arm, 3), 1e-3 * u(0, -1), ("m_e",)).values["m_e"],
        (0, 0, 1),
    ),
    "identify_joint": (
        lambda arm, u: cra.identify_joint(arm, cra.natural_frequencies(arm), 1e-3 * u(0, -1)).k_t,
        (0, -2, 1),
    ),
    "input_shaper": (lambda arm, u: cra.input_shaper(5.0 * u(0, -1), 0.1)[1], (0, 1, 0)),
    "state_space": (lambda arm, u: at_rest(cra.state_space(arm)), (0, 2, 0)),
}  # fmt: skip
NOT_NUMERIC = {
    "AmbiguityWarning", "Arm", "AsymptoticWarning", "AxialBase", "BaseMotion", "Fluctuation", "Force", "JointStiffness",
    "Backbone", "ConvergenceWarning", "Member", "SteadyState", "backbone", "certify_stability", "count_eigenvalues",
    "critical_value", "joined", "nonlinear_modal_equations", "slow_flow_values", "steady_states", "basins",
    "ResponseCurve", "response_curves",
    "MisfitWarning", "Model", "ResonanceWarning", "BoltedJoint", "Controller", "Iwan", "Jenkins", "SlipEvent",
    "SlipResponse", "identify_slip", "slip_response", "System", "TransverseBase", "UndersamplingWarning", "equation",
    "equations", "explore", "export", "kernel", "paper_lagrangian", "stations", "sweep",
}  # fmt: skip


def at_rest(system):
    """The displacement under a constant input."""
    return -system.C @ np.linalg.solve(system.A, system.B)


def si(length=0, time=0, mass=0):
    return 1.0


def imperial(length=0, time=0, mass=0):
    """How many feet, minutes and pounds, to these powers, make the SI unit."""
    return 0.3048**-length * 60.0**-time * 0.45359237**-mass


def in_units(arm, u):
    units = {"E": u(-1, -2, 1), "rho": u(-3, 0, 1), "k_t": u(0, -2, 1), "k_r": u(2, -2, 1), "J_e": u(2, 0, 1)}
    return scaled(arm, L=u(1), b=u(1), h=u(1), m_b=u(0, 0, 1), m_e=u(0, 0, 1), **units)


def needs_certify(name):
    if name.startswith("certify"):
        pytest.importorskip("flint")


def test_every_public_function_is_listed():
    assert set(NUMERIC) | set(SINGLE) | NOT_NUMERIC == set(cra._HOME)


@pytest.mark.parametrize("name", NUMERIC)
def test_broadcasting_equals_looping(name):
    needs_certify(name)
    call, _ = NUMERIC[name]
    whole = np.asarray(call(ARM, si))
    assert whole.shape[:2] == ARM.shape == (2, 3)
    for i, j in np.ndindex(ARM.shape):
        one = call(ARM.replace(k_t=float(ARM.k_t[i, 0]), k_r=float(ARM.k_r[j])), si)
        np.testing.assert_allclose(one, whole[i, j], rtol=1e-9, atol=1e-9 * np.abs(whole[i, j]).max(), err_msg=name)


@pytest.mark.parametrize("name", [*NUMERIC, *SINGLE])
def test_units_do_not_matter(name):
    """The same arm in feet, minutes and pounds: this covers scaling by lengths, by moduli and by densities."""
    needs_certify(name)
    call, unit = (NUMERIC | SINGLE)[name]
    arm = ARM if name in NUMERIC else ARM.replace(k_t=1e2, k_r=50.0)
    there = call(in_units(arm, imperial), imperial) / imperial(*unit)
    here = call(arm, si)
    np.testing.assert_allclose(there, here, rtol=1e-8, atol=1e-9 * np.abs(here).max())


@pytest.mark.parametrize("name", NUMERIC)
def test_everything_is_continuous_through_zero_and_infinity(name):
    needs_certify(name)
    call, _ = NUMERIC[name]
    size = np.abs(call(ARM, si)).max()
    for spring, other in (("k_t", "k_r"), ("k_r", "k_t")):
        for near, end in ((1e-14, 0.0), (1e14, np.inf)):
            if end > 0 or name not in BROKEN_AT_ZERO:
                almost, there = call(ARM.replace(**{spring: [near, end], other: 30.0}), si)
                np.testing.assert_allclose(almost, there, atol=1e-4 * size, err_msg=f"{spring} = {end}")


@pytest.mark.parametrize("name", ["k_t", "k_r", "m_e", "J_e", "L", "b", "h", "E", "rho"])
def test_sensitivities_are_slopes_at_any_length(name):
    """An arm of no unit length: a wrong power of L cannot hide."""
    arm = cra.Arm.nominal().replace(L=0.7, k_t=800.0, k_r=40.0, m_e=0.03, J_e=2e-4)
    step = 1e-5 * getattr(arm, name)
    up, down = (cra.natural_frequencies(arm.replace(**{name: getattr(arm, name) + s * step})) for s in (1, -1))
    found = getattr(cra.sensitivities(arm), f"df_d{name}")
    np.testing.assert_allclose(found, (up - down) / (2 * step), rtol=1e-7, atol=1e-7 * np.abs(found).max())


def test_damping_may_come_close_to_critical():
    assert cra.Arm.nominal().replace(zeta=0.999).zeta == 0.999
    with pytest.raises(ValueError, match="zeta = 1"):
        cra.Arm.nominal().replace(zeta=1.0)


def test_a_harmonic_of_no_size_or_speed_is_over_at_once():
    """A motion that goes on has no time after it; one that never starts has."""
    with pytest.raises(ValueError, match=r"stop|end|rest"):
        cra.residual_vibration(ARM, cra.BaseMotion(amplitude=0.5, angular_frequency=2.0))
    still = cra.BaseMotion(amplitude=0.0, angular_frequency=5.0) + stop(si)
    np.testing.assert_allclose(cra.residual_vibration(ARM, still), cra.residual_vibration(ARM, stop(si)), rtol=1e-12)
