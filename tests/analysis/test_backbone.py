"""Backbones against elliptic integrals, a published benchmark, and time integration."""

from __future__ import annotations

import numpy as np
import pytest
import sympy as sp
from scipy.integrate import quad, solve_ivp
from scipy.special import ellipk

import cra_sym as cra
from cra_sym.figures.nonlinear import cubic_joint
from tests.nonlinear_models import BEAM, EI, L, beam, inextensible, mass, oscillator, q, sprung, t, v, x


def duffing_frequency(alpha, amplitude):
    """Return the exact frequency of x'' + x + alpha x^3 = 0."""
    stiff = 1 + alpha * amplitude**2
    modulus = alpha * amplitude**2 / (2 * stiff)
    return np.pi * np.sqrt(stiff) / (2 * ellipk(modulus))


@pytest.mark.parametrize(("alpha", "bound"), [(0.1, 1e-12), (10.0, 1e-7), (-0.5, 1e-6)])
def test_duffing_has_its_elliptic_frequency(alpha, bound):
    """Nine harmonics leave the error of the next one, which grows with alpha a^2."""
    system = oscillator(q.diff(t) ** 2 / 2 - q**2 / 2 - alpha * q**4 / 4).at({})
    amplitudes = np.array([0.3, 1.0])
    found = cra.backbone(system, amplitude=amplitudes, modes=1)
    np.testing.assert_allclose(found.angular_frequency, duffing_frequency(alpha, amplitudes), rtol=bound)
    np.testing.assert_allclose(found.energy, amplitudes**2 / 2 + alpha * amplitudes**4 / 4, rtol=100 * bound)
    assert found.stable.all() and (found.error_harmonics < 10 * bound).all() and not found.error_modes.any()


def test_helmholtz_has_the_period_of_its_potential():
    """x'' + x + x^2 = 0: the period by quadrature between the turning points, which are not opposite."""
    system = oscillator(q.diff(t) ** 2 / 2 - q**2 / 2 - q**3 / 3).at({})
    found = cra.backbone(system, energy=[0.02, 0.08], modes=1, harmonics=12)
    for level, frequency in zip([0.02, 0.08], found.angular_frequency, strict=True):
        low, high = sorted(r.real for r in np.roots([1 / 3, 1 / 2, 0, -level]))[1:]
        far = -3.0 / 2 - low - high  # the third root: level - V = (x - low)(high - x)(x - far)/3

        def rate(angle, low=low, high=high, far=far):
            place = (low + high) / 2 + (high - low) / 2 * np.sin(angle)
            return 1 / np.sqrt((place - far) / 3)

        period = 2 * quad(rate, -np.pi / 2, np.pi / 2, epsabs=1e-12)[0] / np.sqrt(2)
        np.testing.assert_allclose(frequency, 2 * np.pi / period, rtol=1e-8)


def test_hinged_beam_with_midplane_stretching_is_woinowsky_kriegers():
    """One mode stays one mode: W'' + pi^4 W + (stretching) W^3 = 0, with the elliptic frequency."""
    stiffness = 7.0  # E A
    stretch = oscillator_stretch(stiffness)
    with pytest.warns(cra.AsymptoticWarning, match=f"an integrand reaches {2 * np.pi**2:.3g}, beyond the reach"):
        found = cra.backbone(stretch, amplitude=[0.2, 1.0, 2.0], modes=3, place=0.5)  # (2 pi)^2/2 at the ends
    # with W sin(pi x): stretching is pi^2 W^2/4, so W'' + pi^4 W + E A pi^4/4 W^3 = 0 and alpha = E A/4
    wanted = np.pi**2 * duffing_frequency(stiffness / 4, np.array([0.2, 1.0, 2.0]))
    np.testing.assert_allclose(found.angular_frequency, wanted, rtol=1e-7)


def oscillator_stretch(stiffness):
    shortening = sp.Function("s")(x, t)
    right = -stiffness * shortening**2 / (2 * L)
    ends = [v.subs(x, 0), v.subs(x, L)]
    model = beam(BEAM, essential=ends, right=right, quadratures={shortening: v.diff(x) ** 2 / 2})
    return model.at({EI: 1.0, mass: 1.0, L: 1.0})


# the published cantilever with a cubic tip spring -----------------------------------------------------------------


def test_cantilever_with_cubic_tip_spring_at_the_published_points():
    energy = 10.0 ** np.array([-3.45666, -2.84630])
    published = np.array([24.63643, 26.91086])  # Hz, 20 finite elements and 5 harmonics
    found = cra.backbone(sprung(), energy=energy)
    np.testing.assert_allclose(found.angular_frequency / (2 * np.pi), published, rtol=1e-4)
    richer = cra.backbone(sprung(), energy=energy, modes=12)
    true = np.abs(found.angular_frequency / richer.angular_frequency - 1)
    assert (found.error_modes > 0.5 * true).all() and (found.error_modes < 2 * true).all()
    np.testing.assert_allclose(richer.angular_frequency / (2 * np.pi), published, rtol=5e-6)


def test_internal_resonance_is_followed_and_not_jumped():
    curve = cra.backbone(sprung(), points=220, branches=True)
    level, hertz = np.log10(curve.energy), curve.angular_frequency / (2 * np.pi)
    arm = np.flatnonzero((hertz > 29.7) & (hertz < 29.9))
    first = arm[level[arm].argmax()]  # the tip of the arm towards the resonance with the fifth harmonic
    assert abs(level[first] + 1.348) < 0.01 and abs(hertz[first] / 29.77 - 1) < 5e-4
    back = first + level[first : first + 60].argmin()
    assert abs(level[back] + 2.41) < 0.02 and abs(hertz[back] / 30.23 - 1) < 5e-3  # a flat turn
    on = hertz > 40
    assert on.any() and level[on][0] > -1.66
    beyond = np.interp(-1.63732, level[back:], hertz[back:])
    assert abs(beyond / 40.295 - 1) < 2e-3
    assert not curve.stable.all() and curve.stable[: first // 2].all()
    assert len(curve.crossings) and abs(curve.crossings[0] / (2 * np.pi) / hertz[first] - 1) < 1e-5
    (second,) = curve.branches  # the second mode, a fifth of whose frequency meets the first
    some = second.energy < 10
    alone = cra.backbone(sprung(), 2, energy=second.energy[some][::9], harmonics=1)
    np.testing.assert_allclose(5 * second.angular_frequency[some][::9], alone.angular_frequency, rtol=1e-9)
    assert second.crossings[0] == curve.crossings[0] and second.energy.min() < 1e-6 and second.energy.max() > 1.0
    once = cra.backbone(sprung(), energy=10.0**-2.0)
    assert abs(once.angular_frequency / (2 * np.pi) - 30.09) < 0.02  # the first crossing, not the main branch


def test_localised_motion_leaves_where_lames_equation_says():
    """Two like Duffing oscillators on a soft link, by q in opposition and r together, of frequency w < 1.

    About q = a cn(Omega t, k) alone, r obeys Lame's equation of degree two, one of whose periodic solutions, cn dn, has
    the eigenvalue 1 + k^2: that is w^2 = 1 - 3 a^2/2.
    """
    r, square = sp.Function("r")(t), 0.7
    kinetic = (q.diff(t) ** 2 + r.diff(t) ** 2) / 2
    left = kinetic - q**2 / 2 - square * r**2 / 2 - (q**4 + 6 * q**2 * r**2 + r**4) / 4
    model = cra.Model(0, fields=(), coordinates=[q, r], x=x, domain=(0, 1), t=t, left=left)
    curve = cra.backbone(model.at({}), 2, modes=2, points=60, field=q, branches=True)
    size = np.sqrt(2 * (1 - square) / 3)
    np.testing.assert_allclose(curve.crossings, [duffing_frequency(1.0, size)], rtol=1e-4)
    np.testing.assert_array_equal(curve.stable, curve.amplitude < size)
    (branch,) = curve.branches
    assert branch.stable.all() and abs(branch.amplitude.min() / size - 1) < 1e-3
    np.testing.assert_allclose(branch.angular_frequency[::-1], branch.angular_frequency, rtol=1e-8)  # either of them
    far = branch.coefficients[0].sum(axis=-1)

    def rate(_, y):
        r, q = y[:2]
        return np.append(y[2:], [-square * r - 3 * q**2 * r - r**3, -q - 3 * r**2 * q - q**3])

    start, period = np.append(far, [0.0, 0.0]), 2 * np.pi / branch.angular_frequency[0]
    end = solve_ivp(rate, (0, period), start, method="DOP853", rtol=1e-12, atol=1e-14).y[:, -1]
    np.testing.assert_allclose(end, start, atol=1e-6)
    assert abs(far[0]) > 0.5 * abs(far[1])


def test_inextensible_arm_against_time_integration_and_its_coefficient():
    for mode, coefficient in ((1, 0.272611), (2, -568.879), (3, -13814.8)):
        size = 0.01 / mode**2
        found = cra.backbone(inextensible(), mode, amplitude=2 * size, modes=3)
        linear = 2 * np.pi * cra.natural_frequencies(inextensible(), 3)[mode - 1]
        bend = (found.angular_frequency - linear) / size**2
        np.testing.assert_allclose(bend, coefficient, rtol=2e-2)  # the next term is of order a^2
    polynomials = cra.nonlinear_modal_equations(inextensible(), 3).polynomials

    def rate(_, state):
        found = polynomials.derivatives(state[None, :3], state[None, 3:])
        inertia = np.eye(3) + found.momentum_v[0]
        force = -(polynomials.omega**2) * state[:3] + found.force[0] - found.momentum_q[0] @ state[3:]
        return np.append(state[3:], np.linalg.solve(inertia, force))

    start = np.append(found.coefficients.sum(axis=-1), np.zeros(3))
    period = 2 * np.pi / found.angular_frequency
    end = solve_ivp(rate, (0, period), start, method="DOP853", rtol=1e-12, atol=1e-15).y[:, -1]
    np.testing.assert_allclose(end[:3], start[:3], atol=1e-8 * np.abs(start).max())


def test_far_out_the_caller_is_told_of_slopes_and_of_nothing_else():
    with pytest.warns(cra.AsymptoticWarning, match="an integrand reaches") as told:
        curve = cra.backbone(inextensible(), 2, modes=3, harmonics=5, points=120)
    assert [warning.filename for warning in told] == [__file__] and not curve.stable[-1]


def test_stability_far_out_is_that_of_time_integration():
    """Where a joint is 1e4 times as stiff as at rest, its force is faster than every linear mode."""
    arm, modes = cra.Arm.nominal().replace(L=0.8, m_e=0.004, J_e=1e-6, k_t=5e3, k_r=4e2), 3
    cubic = 1e6 * arm.k_t
    curve = cra.backbone(cubic_joint(arm, cubic), points=80, modes=modes)
    root, square = cra.mode_shapes(arm, [0.0], modes)[:, 0], (2 * np.pi * cra.natural_frequencies(arm, modes)) ** 2

    def largest(point):
        """The multiplier farthest out by plain integration of the variation, from the shapes at the joint alone."""
        frequency, coefficients = curve.angular_frequency[point], root @ curve.coefficients[point]

        def rate(time, state):
            give = coefficients @ np.cos(np.array(curve.multiples) * frequency * time)
            near = state.reshape(2 * modes, 2 * modes)
            stiffness = np.diag(square) + 3 * cubic * give**2 * np.outer(root, root)
            return np.concatenate([near[modes:], -stiffness @ near[:modes]]).ravel()

        start = np.eye(2 * modes).ravel()
        end = solve_ivp(rate, (0, 2 * np.pi / frequency), start, method="DOP853", rtol=1e-9, atol=1e-9).y[:, -1]
        return np.abs(np.linalg.eigvals(end.reshape(2 * modes, 2 * modes))).max()

    far = np.arange(50, 80)
    kept, left = far[curve.stable[far]][-1], far[~curve.stable[far]][-1]
    # the curve's own pair is a double one, known to half the digits of the integration
    assert largest(kept) < 1.01 and largest(left) > 1.1


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"energy": 1.0, "amplitude": 1.0}, "energy, amplitude: one of them must be None"),
        ({"energy": 0.0}, r"energy = 0.0: must be real numbers in \[1e-60"),
        ({"mode": 7}, "mode = 7: must be an integer from 1 to 6"),
        ({"harmonics": 0}, "harmonics = 0"),
        ({"energy": 1.0, "branches": True}, "branches = True: needs the whole curve"),
        ({"amplitude": 1e-3, "place": 2.0}, "place = 2 must be in the domain"),
    ],
)
def test_bad_input_is_named(options, message):
    with pytest.raises(ValueError, match=message):
        cra.backbone(sprung(), **options)


def test_what_has_no_backbone_is_refused():
    linear = oscillator(q.diff(t) ** 2 / 2 - q**2 / 2)
    with pytest.raises(ValueError, match="is linear"):
        cra.backbone(linear.at({}), modes=1)
    np.testing.assert_allclose(cra.backbone(linear.at({}), amplitude=3.0, modes=1).angular_frequency, 1.0, rtol=1e-12)
    with pytest.raises(ValueError, match="constant load"):
        cra.backbone(oscillator(q.diff(t) ** 2 / 2 - q**2 / 2 - q**4 + q).at({}), modes=1)
    pushed = oscillator(q.diff(t) ** 2 / 2 - q**2 / 2, virtual_work=[(q**2, q, None)])
    with pytest.raises(ValueError, match="virtual_work: must be forces with a potential"):
        cra.backbone(pushed.at({}), modes=1)


def test_a_curve_that_ends_says_so():
    """A softening spring has no free vibration beyond its barrier at a = 1."""
    system = oscillator(q.diff(t) ** 2 / 2 - q**2 / 2 + q**4 / 4).at({})
    with pytest.warns(cra.ConvergenceWarning, match=r"could not be followed beyond .* before amplitude = 1.5"):
        found = cra.backbone(system, amplitude=[0.5, 1.5], modes=1, harmonics=15)
    np.testing.assert_allclose(found.angular_frequency[0], duffing_frequency(-1.0, 0.5), rtol=1e-9)
    assert np.isnan(found.angular_frequency[1])
    with pytest.warns(cra.ConvergenceWarning, match="before amplitude = 1.5"):
        assert np.isnan(cra.backbone(system, amplitude=1.5, modes=1, harmonics=3).angular_frequency)
