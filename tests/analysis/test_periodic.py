"""Periodic Lagrangians and fluctuating parameters of any system, each against Ritz or Galerkin and multipliers."""

from __future__ import annotations

import pickle
import warnings
from functools import cache
from pathlib import Path

import mpmath
import numpy as np
import pytest
import sympy as sp
from scipy.integrate import solve_ivp
from scipy.linalg import eigh
from sympy import cos, sin

import cra_sym as cra
from cra_sym.analysis.reduced_zones import reduced_zone
from cra_sym.solvers import floquet, periodic, proved_stability
from cra_sym.symbols import L, epsilon, t, v, varpi, x

EI, rhoA, rhoI, kGA, T, P, m, k, c, a, d = sp.symbols("EI rhoA rhoI kGA T P m k c a d")
SMALL = (epsilon, varpi)
CLAMPED = [v.subs(x, 0), v.diff(x).subs(x, 0)]
PINNED = [v.subs(x, 0), v.subs(x, L)]
BEAM = rhoA * v.diff(t) ** 2 / 2 - EI * v.diff(x, 2) ** 2 / 2
UNIT = {EI: 1.0, rhoA: 1.0, L: 1.0}


def model(density, fields=(v,), **options):
    return cra.Model(density, fields=list(fields), x=x, domain=(0, L), t=t, **options)


# the second route: Ritz's matrices of the Lagrangian with its cosine held at 0 and at 1, then a general integrator ----


@cache
def ritz_matrices(lagrangian, values):
    parts = lagrangian.ritz(elements=8).matrices
    return [np.array(part.xreplace(dict(values)), dtype=float) for part in (parts.mass, parts.damping, parts.stiffness)]


def ritz_multipliers(still, swung, values, varpi, size, modes, base=None):
    """Multipliers of d/dt(M q') + C q' + K q = 0 that goes with size cos(varpi t) from ``still`` towards ``swung``, in
    the first modes of ``base`` or of ``still``."""
    values = tuple(values.items())
    one, other = (ritz_matrices(lagrangian, values) for lagrangian in (still, swung))
    mass, _, stiffness = one if base is None else ritz_matrices(base, values)
    _, shapes = eigh(stiffness, mass)
    base, more = ([shapes[:, :modes].T @ part @ shapes[:, :modes] for part in parts] for parts in (one, other))
    more = [after - before for before, after in zip(base, more, strict=True)]

    def rates(time, y):
        q, p = y.reshape(2, modes, 2 * modes)
        mass, damping, stiffness = (b + size * np.cos(varpi * time) * s for b, s in zip(base, more, strict=True))
        u = np.linalg.solve(mass, p)
        return np.concatenate([u, -damping @ u - stiffness @ q]).ravel()

    return multipliers_of(rates, varpi, modes)


def multipliers_of(rates, varpi, modes):
    whole = solve_ivp(rates, (0.0, 2 * np.pi / varpi), np.eye(2 * modes).ravel(), "DOP853", rtol=1e-11, atol=1e-11)
    return np.linalg.eigvals(whole.y[:, -1].reshape(2 * modes, -1))


def agree(system, excitation, varpi, size, modes, others, rtol):
    """The largest multiplier, which decides, is that of the other route; one of these lies outside the unit circle."""
    exponents = cra.floquet_exponents(system, excitation, varpi, size, modes)
    mine = np.exp(exponents[..., 0].real * 2 * np.pi / np.asarray(varpi))
    theirs = np.abs(others).max(axis=-1)
    np.testing.assert_allclose(mine, theirs, rtol=rtol)
    assert (theirs > 1.01).any()


# what is periodic in a Lagrangian --------------------------------------------------------------------------------


def test_a_lagrangian_says_what_is_periodic_in_it():
    swaying = model(
        BEAM + m * (v.diff(t) - epsilon * varpi * a * sin(2 * varpi * t)) ** 2 / 2,
        right=-k * (1 + epsilon * cos(varpi * t + sp.pi / 3)) * v**2 / 2 + d * v * cos(varpi * t),
        essential=CLAMPED,
        small=SMALL,
    )
    assert [symbol.name for symbol in swaying.symbols] == ["EI", "L", "a", "d", "k", "m", "rhoA"]
    assert set(swaying.excitation.oscillations) == {(2, "sin", 1), (1, "cos", 0), (1, "sin", 0)}
    assert repr(swaying.excitation) == (
        "<epsilon varpi sin(2 varpi t), cos(varpi t), epsilon cos(varpi t), epsilon sin(varpi t) in the Lagrangian>"
    )
    system = swaying.at({**UNIT, a: 0.1, d: 2.0, k: 3.0, m: 0.5})
    still = model(BEAM + m * v.diff(t) ** 2 / 2, right=-k * v**2 / 2, essential=CLAMPED)
    steady = still.at({**UNIT, k: 3.0, m: 0.5})
    assert np.array_equal(cra.natural_frequencies(system), cra.natural_frequencies(steady))
    tip = cra.mode_shapes(steady, 1.0, 2)
    drives = {drive.oscillation: drive.stiffness for drive in swaying.excitation.drives(system, 2)}
    np.testing.assert_allclose(drives[1, "cos", 0], 1.5 * np.outer(tip, tip), rtol=1e-12)
    np.testing.assert_allclose(drives[1, "sin", 0], -1.5 * np.sqrt(3) * np.outer(tip, tip), rtol=1e-12)
    forces = {(wave, small): force for wave, small, force, _ in swaying.excitation.forces(system, 2)}
    np.testing.assert_allclose(forces[(1, "cos", 0), False], 2.0 * tip, rtol=1e-12)
    # the momentum -m a varpi epsilon sin(2 varpi t): its rate is a force m a 2 varpi^2 epsilon cos(2 varpi t)
    place, weight = np.polynomial.legendre.leggauss(30)
    area = cra.mode_shapes(steady, (1 + place) / 2, 2) @ weight / 2
    np.testing.assert_allclose(forces[(2, "cos", 2), True], 2 * 0.5 * 0.1 * area, rtol=1e-9)
    assert pickle.loads(pickle.dumps(swaying)).excitation == swaying.excitation
    assert still.excitation is None and model(BEAM, essential=CLAMPED, small=SMALL).excitation is None


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"right": -k * epsilon**2 * cos(varpi * t) * v**2}, r"epsilon\*\*2: they must be times epsilon to the first"),
        ({"right": -k * (1 + epsilon * cos(varpi * t)) ** 2 * v**2}, "to the first power"),
        ({"right": -k * cos(varpi * t) * v**2}, r"epsilon\*\*0: they must be times epsilon"),
        ({"right": -k * epsilon * cos(varpi * t / 2) * v**2}, r"n\*varpi\*t \+ phase, n a whole number"),
        ({"right": -k * epsilon * cos(3 * t) * v**2}, r"n\*varpi\*t \+ phase, n a whole number"),
        ({"right": -k * sp.sqrt(epsilon) * v**2}, "must be a polynomial in epsilon and varpi"),
        ({"right": -k * epsilon * cos(varpi * t) * v**4}, "must be quadratic or linear in the unknowns"),
        ({"right": k * epsilon**2 * cos(varpi * t) * v}, "power 0 or 1"),
        ({"domain": (0, L * (1 + epsilon))}, "domain: .* must be free of epsilon and varpi; only terms and loads"),
        ({"domain": (0, L * varpi)}, r"domain: L\*varpi must be free of epsilon and varpi; only terms"),
        ({"small": (epsilon, t)}, r"small = .*: must be two symbols \(epsilon, varpi\)"),
        ({"small": epsilon}, r"small = .*: must be two symbols \(epsilon, varpi\)"),
    ],
)
def test_what_cannot_be_periodic_is_named(options, words):
    given = {"fields": [v], "x": x, "domain": (0, L), "t": t, "essential": CLAMPED, "small": SMALL} | options
    with pytest.raises((ValueError, TypeError), match=words):
        cra.Model(BEAM, **given)


def test_cosines_of_time_need_their_symbols():
    pulsating = model(BEAM, right=-k * epsilon * cos(varpi * t) * v**2, essential=CLAMPED)
    with pytest.raises(
        ValueError, match=r"small = \(varpi, epsilon\): must be \(epsilon, varpi\), and varpi is the freq"
    ):
        model(BEAM, right=-k * epsilon * cos(2 * varpi * t + 1) * v**2, small=SMALL[::-1])
    with pytest.raises(ValueError, match=r"depends on t, .* say small=\(epsilon, varpi\)"):
        pulsating.at({**UNIT, k: 1.0, epsilon: 0.1, varpi: 3.0}).natural_frequencies(1)
    pulled = model(BEAM, right=k * L * epsilon * cos(varpi * t) * v, essential=CLAMPED).at(
        {**UNIT, k: 1.0, epsilon: 0.1, varpi: 3.0}
    )
    with pytest.raises(ValueError, match=r"system: the load .*cos\(t\*varpi\) .* told by small=\(epsilon, varpi\)"):
        cra.tip_response(pulled, None, 0.1)


def test_small_symbols_are_no_values():
    pulsating = model(BEAM, right=-k * epsilon * cos(varpi * t) * v**2, essential=CLAMPED, small=SMALL)
    with pytest.raises(ValueError, match="values: epsilon must be left out"):
        pulsating.at({**UNIT, k: 1.0, epsilon: 0.1})
    other = model(BEAM, right=-k * v**2 / 2, essential=CLAMPED).at({**UNIT, k: 1.0})
    with pytest.raises(ValueError, match="is of another model"):
        cra.growth_rate(other, pulsating.excitation, 7.0, 0.1)
    with pytest.raises(TypeError, match="excitation = None: must be"):
        cra.growth_rate(other, other.model.excitation, 7.0, 0.1)


def test_what_cannot_fluctuate_is_named():
    system = model(BEAM - T * v.diff(x) ** 2 / 2, essential=CLAMPED).at({**UNIT, T: 1.0})
    for name, words in (("L", "L is a length"), ("q", "q is not a parameter")):
        with pytest.raises(ValueError, match=rf"{words}; must be one of EI, T, rhoA"):
            cra.growth_rate(system, cra.Fluctuation({name: 1.0}), 7.0, 0.1)
    with pytest.raises(TypeError, match=r"weights = \{1: 1.0\}: must be a mapping from symbols or names"):
        cra.Fluctuation({1: 1.0})
    with pytest.raises(ValueError, match="weights: must name at least one parameter"):
        cra.Fluctuation()
    with pytest.raises(ValueError, match="h does not enter the Lagrangian linearly; must be one of b, E, rho, m_e"):
        cra.growth_rate(cra.Arm.nominal(), cra.Fluctuation(h=1.0), 7.0, 0.1)


def test_a_mass_must_stay_positive_and_two_factors_do_not_fluctuate():
    system = model(BEAM, essential=CLAMPED).at(UNIT)
    with pytest.raises(ValueError, match=r"the mass fluctuates by 1\.2 times itself; must be less than once"):
        cra.growth_rate(system, cra.Fluctuation(rhoA=1.0), 7.0, 1.2)
    arm = cra.Arm.nominal()
    with pytest.raises(ValueError, match="have a product, which gives epsilon squared"):
        cra.growth_rate(arm, cra.Fluctuation(E=1.0, b=1.0), 7.0, 0.1)


# worked systems --------------------------------------------------------------------------------------------------


def test_a_pulsating_tip_spring_against_the_published_boundary():
    """133 points that SSMTool (Jain and Haller) computed on a finite-element model; see the table's head.

    At each, damped vibration neither grows nor falls off: within 1e-4 in Omega. Where the boundary turns round, Omega
    does not tell: there two of the points lie 1e-5 below it in epsilon.
    """
    points = np.genfromtxt(Path(__file__).with_name("pulsating_tip_spring.csv"), delimiter=",", skip_header=3)
    damping, alpha, beta = sp.symbols("damping alpha beta")
    drag = [
        (-damping * alpha * rhoA * v.diff(t), v, "domain"),
        (-damping * beta * EI * v.diff(x, 2, t), v.diff(x, 2), "domain"),
    ]
    beam = model(BEAM, right=-epsilon * cos(varpi * t) * v**2 / 2, essential=CLAMPED, virtual_work=drag, small=SMALL)
    values = {EI: 45e6 * 1e4 / 12, rhoA: 1780e-9 * 100, L: 2700.0, alpha: 0.001 * 0.125, beta: 0.002 * 0.125}
    system = beam.at({**values, damping: points[:, 0][:, None]})
    frequency, size = points[:, 1][:, None], points[:, 2][:, None]
    near = np.array([1 - 1e-4, 1 + 1e-4, 1.0, 1.0]), np.array([1.0, 1.0, 1 - 3e-5, 1 + 3e-5])
    slowest = cra.floquet_exponents(system, beam.excitation, near[0] * frequency, near[1] * size)[..., 0].real
    crossed = np.ptp(np.sign(slowest[:, :2]), axis=1) > 0
    assert len(points) == 133 and crossed.sum() == 131
    assert (np.ptp(np.sign(slowest), axis=1) > 0).all()


def test_a_timoshenko_arm_on_a_base_that_shakes_along_it():
    """The inertia of what lies beyond pulls on the foreshortening; `AxialBase` derives the same from the mass."""
    psi = sp.Function("psi")(x, t)
    kinetic = rhoA * v.diff(t) ** 2 / 2 + rhoI * psi.diff(t) ** 2 / 2
    arm = kinetic - EI * psi.diff(x) ** 2 / 2 - kGA * (v.diff(x) - psi) ** 2 / 2
    held = [v.subs(x, 0), psi.subs(x, 0)]

    def pulled(acceleration, **options):
        work = acceleration * (rhoA * (L - x) + m) * v.diff(x) ** 2 / 2
        return model(arm + work, [v, psi], right=m * v.diff(t) ** 2 / 2, essential=held, **options)

    motion = epsilon * a * cos(varpi * t)
    own = pulled(motion.diff(t, 2), small=SMALL)
    values = {EI: 1.0, rhoA: 1.0, rhoI: 1e-3, kGA: 300.0, L: 1.0, m: 0.2}
    system, plain = own.at({**values, a: 0.02}), pulled(0).at(values)
    omega = 2 * np.pi * cra.natural_frequencies(plain)
    varpis, sizes = np.array([2 * omega[0], 2 * omega[1], omega[0] + omega[1]]), np.array([1.0, 0.4, 0.4])
    amplitudes = sizes * 0.02 * varpis**2
    still, swung, given = pulled(0), pulled(-1), zip(varpis, amplitudes, strict=True)
    others = [ritz_multipliers(still, swung, values, w, size, 3) for w, size in given]
    agree(system, own.excitation, varpis, sizes, 3, np.array(others), 2e-4)  # eight elements
    ours = cra.growth_rate(system, own.excitation, varpis, sizes)
    np.testing.assert_allclose(ours, cra.growth_rate(plain, cra.AxialBase(0.02), varpis, sizes), rtol=1e-6)


BELT = rhoA * (v.diff(t) + c * v.diff(x)) ** 2 / 2 - T * v.diff(x) ** 2 / 2
MOVING = {rhoA: 1.0, L: 1.0, T: 1.0, c: 0.3}
TENSION = cra.Fluctuation(T=1.0)


@pytest.mark.filterwarnings("ignore:resonance:cra_sym.AsymptoticWarning")
def test_a_tensioned_belt_with_fluctuating_tension():
    """Standing, all modes keep their shape: Mathieu's equations, and no sums. Moving, modes couple: sums.

    A string's frequencies are multiples of the first, so that zones lie on each other, of which it is warned.
    """
    standing = model(rhoA * v.diff(t) ** 2 / 2 - T * v.diff(x) ** 2 / 2, essential=PINNED).at({rhoA: 1, L: 1, T: 1})
    size = 0.2
    for n in (1, 2):
        sides = cra.stability_boundary(standing, TENSION, size, (n, n), order=2)
        # a_1, b_1 = 1 -+ q - q^2/8 of Mathieu's equation, a = (2 omega/varpi)^2 and q = 2 epsilon omega^2/varpi^2
        exact = [2 * n * np.pi * np.sqrt(1 / (1 - sign * q - q**2 / 8)) for sign, q in ((-1, 0.0), (1, 0.0))]
        for _ in range(30):
            exact = [
                2 * n * np.pi / np.sqrt(1 + sign * (q := 2 * size * (n * np.pi / side) ** 2) - q**2 / 8)
                for sign, side in zip((1, -1), exact, strict=True)
            ]
        np.testing.assert_allclose(sides, exact, rtol=size**3 / 8)
    with pytest.warns(cra.ResonanceWarning, match="does not couple these modes"):
        assert np.isnan(cra.stability_boundary(standing, TENSION, size, (1, 2))).all()
    moving = model(BELT, essential=PINNED)
    system = moving.at(MOVING)
    lower, upper = cra.stability_boundary(system, TENSION, 0.1, (1, 2), order=2)
    assert (lower + upper) / 2 == pytest.approx(3 * np.pi * (1 - 0.3**2), rel=2e-3)  # n pi (1 - c^2) each
    inside, outside = (lower + upper) / 2, upper + 0.3 * (upper - lower)
    rate = cra.growth_rate(system, TENSION, [inside, outside], 0.1, 8)
    assert rate[0] > 0.2 * (upper - lower) and rate[1] < 1e-9
    assert list(cra.certify_stability(system, TENSION, [inside, outside], 0.1, 8)) == ["unstable", "stable"]
    tighter = model(BELT - T * v.diff(x) ** 2 / 2, essential=PINNED)
    others = ritz_multipliers(moving, tighter, MOVING, inside, 0.1, 4)
    agree(system, TENSION, inside, 0.1, 4, others, 1e-4)


def test_a_support_inside_leaves_the_zones_of_its_span():
    """It was refused. A string on a pulsating spring, held at a support, has the zones of the span up to there."""

    def string(**options):
        return model(rhoA * v.diff(t) ** 2 / 2 - T * v.diff(x) ** 2 / 2, left=-k * v**2 / 2, **options)

    values, pulsating = {rhoA: 1.0, T: 1.0, k: 2.0}, cra.Fluctuation(k=1.0)
    whole = string(essential=[v.subs(x, a), v.subs(x, L)]).at({**values, a: 1.0, L: 1.05})
    alone = string(essential=[v.subs(x, L)]).at({**values, L: 1.0})
    for resonance in ((1, 1), (1, 2)):
        found, exact = (cra.stability_boundary(one, pulsating, 0.1, resonance, order=2) for one in (whole, alone))
        np.testing.assert_allclose(found, exact, rtol=1e-9)  # 24 modes here are 23 there, and the rest is static
    residual = [cra.growth_rate(one, pulsating, np.mean(exact), 0.1, 2, residual=True) for one in (whole, alone)]
    assert residual[0] == pytest.approx(residual[1], rel=1e-8) and residual[0] > 0


def test_a_moving_belt_has_no_difference_zones():
    """All its modes have positive energy below the critical speed, so that a difference is stable (Krein).

    The belt bends a little: without stiffness every frequency is a multiple of the first, and zones coincide.
    """
    system = model(BELT - EI * v.diff(x, 2) ** 2 / 2, essential=PINNED).at({**MOVING, EI: 0.02})
    (drive,) = cra.Fluctuation(rhoA=1.0).drives(system, 3)
    np.testing.assert_array_equal(drive.damping, -drive.momentum.T)  # exactly: half a period gives the other
    for empty in (
        cra.stability_boundary(system, TENSION, [])[0],
        cra.growth_rate(system, TENSION, 3.0, []),
        cra.certify_stability(system, TENSION, [], 0.1),
    ):
        assert empty.shape == (0,)
    with pytest.warns(cra.ResonanceWarning, match=r"\(2, -1\).*one of the modes takes what the other one gives"):
        assert np.isnan(cra.stability_boundary(system, TENSION, 0.1, (2, -1))).all()
    omega = cra.floquet_exponents(system, TENSION, 100.0, 0.0, 8).imag
    one, two = np.sort(omega[omega > 0])[:2]
    assert cra.certify_stability(system, TENSION, two - one, 0.1, 8) == "stable"


def test_a_pulsating_follower_force_has_difference_zones():
    """P is not symmetric there; the column stands below Beck's load."""

    def column(load):
        return model(
            BEAM + load * v.diff(x) ** 2 / 2, essential=CLAMPED, virtual_work=[(-load * v.diff(x), v, "right")]
        )

    values = {**UNIT, P: 8.0}
    system, load = column(P).at(values), cra.Fluctuation(P=1.0)
    lower, upper = cra.stability_boundary(system, load, 0.3, (2, -1), order=2)
    varpis = np.array([(lower + upper) / 2, upper + (upper - lower)])
    rates = cra.growth_rate(system, load, varpis, 0.3, 6)
    assert upper > lower and rates[0] > 0.2 * (upper - lower) and rates[1] < 1e-9
    others = ritz_multipliers(column(P), column(2 * P), values, varpis[0], 0.3, 4, base=column(0))
    agree(system, load, varpis[0], 0.3, 4, others, 1e-4)


def test_a_pipe_that_conveys_pulsating_fluid():
    """Against Galerkin's sines in the equation of Paidoussis and Issid (1974), to first order in the pulsation:
    EI v_xxxx + (m U^2 + m U_t (L - x)) v_xx + 2 m U v_xt + (m + M) v_tt = 0."""
    U, M = sp.symbols("U M")
    speed, square = U * (1 + epsilon * cos(varpi * t)), U**2 * (1 + 2 * epsilon * cos(varpi * t))
    density = (
        (m + M) * v.diff(t) ** 2 / 2
        + m * speed * v.diff(t) * v.diff(x)
        + m * (square + speed.diff(t) * (L - x)) * v.diff(x) ** 2 / 2
        - EI * v.diff(x, 2) ** 2 / 2
    )
    pipe = model(density, essential=PINNED, small=SMALL)
    system, modes = pipe.at({EI: 1.0, L: 1.0, m: 0.5, M: 0.5, U: 2.0}), 6
    n = np.arange(1, modes + 1)[:, None] * np.pi
    place, weight = np.polynomial.legendre.leggauss(60)
    place, weight = (1 + place) / 2, weight / 2
    shape, slope, bend = (
        np.sqrt(2) * s for s in (np.sin(n * place), n * np.cos(n * place), -(n**2) * np.sin(n * place))
    )
    turn, curve, far = ((weight * shape) @ part.T for part in (slope, bend, (1 - place) * bend))

    def multipliers(w, size):
        def rates(time, y):
            q, u = y.reshape(2, modes, 2 * modes)
            g, rate = size * np.cos(w * time), -size * w * np.sin(w * time)
            stiffness = np.diag(n[:, 0] ** 4) + 0.5 * (4.0 * (1 + 2 * g) * curve + 2.0 * rate * far)
            return np.concatenate([u, -2.0 * (1 + g) * turn @ u - stiffness @ q]).ravel()

        return multipliers_of(rates, w, modes)

    lower, upper = cra.stability_boundary(system, pipe.excitation, 0.2, (1, 1), order=2)
    varpis = np.array([0.3 * lower + 0.7 * upper, (lower + upper) / 2])
    agree(system, pipe.excitation, varpis, 0.2, modes, np.array([multipliers(w, 0.2) for w in varpis]), 1e-7)
    assert cra.growth_rate(system, pipe.excitation, upper + 0.2 * (upper - lower), 0.2, modes) < 1e-8
    assert list(cra.certify_stability(system, pipe.excitation, varpis, 0.2, modes)) == ["unstable", "unstable"]


def test_a_column_under_a_pulsating_load():
    """Bolotin: each mode of a pinned column is Mathieu's equation, omega_n^2 (1 - P/P_n) (1 - 2 mu cos varpi t)."""
    column = model(BEAM + P * (1 - epsilon * cos(varpi * t)) * v.diff(x) ** 2 / 2, essential=PINNED, small=SMALL)
    load, size = 5.0, 0.3
    system = column.at({**UNIT, P: load})
    for n in (1, 2, 3):
        buckling = (n * np.pi) ** 2
        omega = n * np.pi * np.sqrt(buckling - load)
        mu = size * load / (2 * (buckling - load))
        first = cra.stability_boundary(system, column.excitation, size, (n, n))
        np.testing.assert_allclose(first, 2 * omega * np.array([1 - mu / 2, 1 + mu / 2]), rtol=1e-9)
        second = cra.stability_boundary(system, column.excitation, size, (n, n), order=2)
        bolotin = 2 * omega * np.sqrt(np.array([1 - mu, 1 + mu]))  # of the first determinant, right to mu^2 / 4
        np.testing.assert_allclose(second, bolotin, rtol=mu**2 / 4)


def test_a_cantilevered_column_with_a_tip_mass():
    def loaded(load):
        return model(BEAM + load * v.diff(x) ** 2 / 2, right=m * v.diff(t) ** 2 / 2, essential=CLAMPED)

    values = {**UNIT, m: 0.3, P: 1.0}
    column, load = loaded(P).at(values), cra.Fluctuation(P=1.0)
    omega = 2 * np.pi * cra.natural_frequencies(column)
    varpis = np.array([2 * omega[0], 2 * omega[1], omega[0] + omega[1]])
    others = [ritz_multipliers(loaded(P), loaded(2 * P), values, w, 0.8, 3) for w in varpis]
    agree(column, load, varpis, 0.8, 3, np.array(others), 1e-4)


def test_a_gantry_of_two_beams_with_a_payload_on_a_fluctuating_joint():
    z, w = sp.Function("z")(x, t), sp.Function("w")(t)
    beams = BEAM + sp.Rational(3, 2) * BEAM.subs(v, z).doit()

    def gantry(stiffness, **options):
        payload = m * w.diff(t) ** 2 / 2 - stiffness * ((v - w) ** 2 + (z - w) ** 2) / 2
        held = [f.subs(x, 0) for f in (v, z, v.diff(x), z.diff(x))]
        return model(beams, [v, z], right=payload, coordinates=[w], essential=held, **options)

    values = {**UNIT, m: 0.4, k: 20.0}
    own = gantry(k * (1 + epsilon * cos(varpi * t)), small=SMALL)
    system = own.at(values)
    omega = 2 * np.pi * cra.natural_frequencies(system, 3)
    varpis = np.array([2 * omega[0], 2 * omega[2], omega[0] + omega[2]])
    still, stiff = gantry(k), gantry(2 * k)
    others = [ritz_multipliers(still, stiff, values, w, 0.5, 4) for w in varpis]
    agree(system, own.excitation, varpis, 0.5, 4, np.array(others), 1e-3)  # eight elements, and a narrow zone
    named = cra.growth_rate(still.at(values), cra.Fluctuation(k=1.0), varpis, 0.5)
    np.testing.assert_allclose(cra.growth_rate(system, own.excitation, varpis, 0.5), named, rtol=1e-9)


# fluctuating masses, dampers and several parameters, sums and phases ----------------------------------------------


def test_masses_dampers_and_stiffnesses_fluctuate_together():
    def beam(turn):
        return model(
            (1 + 0.3 * turn) * rhoA * v.diff(t) ** 2 / 2 - (1 + turn) * EI * v.diff(x, 2) ** 2 / 2,
            right=m * (1 + turn / 2) * v.diff(t) ** 2 / 2,
            essential=CLAMPED,
            virtual_work=[(-c * (1 + 2 * turn) * v.diff(t), v, "right")],
        )

    values = {**UNIT, m: 0.2, c: 0.1}
    system, fluctuation = beam(0).at(values), cra.Fluctuation(EI=1.0, rhoA=0.3, m=0.5, c=2.0)
    omega = 2 * np.pi * cra.natural_frequencies(system)
    varpis = np.array([2 * omega[0], omega[0] + omega[1], 2 * omega[1]])
    still, swung = beam(0), beam(1)
    others = [ritz_multipliers(still, swung, values, w, 0.4, 3) for w in varpis]
    agree(system, fluctuation, varpis, 0.4, 3, np.array(others), 1e-4)


@pytest.mark.filterwarnings("ignore:resonance:cra_sym.AsymptoticWarning")
def test_two_phases_and_twice_the_frequency():
    """A cosine, a sine of another matrix, and one of 2 varpi; the boundary to second order against multipliers."""
    pulsating = (1 + epsilon * cos(varpi * t)) * EI * v.diff(x, 2) ** 2 / 2
    beam = model(
        rhoA * v.diff(t) ** 2 / 2 - pulsating,
        right=-k * (epsilon * sin(varpi * t) + epsilon * cos(2 * varpi * t)) * v**2 / 2,
        essential=CLAMPED,
        small=SMALL,
    )
    system, shares = beam.at({**UNIT, k: 4.0}), np.array([-0.05, 0.05, 0.95, 1.05])
    for resonance, tongue in (((1, 1), 1), ((1, 1), 2), ((1, 2), 1)):
        lower, upper = cra.stability_boundary(system, beam.excitation, 0.1, resonance, order=2, tongue=tongue)
        grown = cra.growth_rate(system, beam.excitation, lower + shares * (upper - lower), 0.1, 6) > 1e-6
        assert list(grown) == [False, True, True, False]


@pytest.mark.parametrize("damping", [0.0, 0.001])
@pytest.mark.parametrize("resonance", [(1, 1), (2, 2), (1, 2)])
def test_reduced_equations_give_the_derived_boundaries(resonance, damping):
    """Two routes to second order: multiple scales, derived, and Hill's equations reduced to two."""
    arm, shake = cra.Arm.nominal().replace(k_t=1e3, zeta=damping), cra.AxialBase(0.01)
    errors = []
    for size in (0.2, 0.1):
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            derived = np.array(cra.stability_boundary(arm, shake, size, resonance, order=2))
        _, reduced = reduced_zone(arm, shake, np.asarray(size), resonance, 1, 24, 2)
        errors.append(np.abs(derived - [reduced.lower, reduced.upper]).max() / np.ptp(derived))
    assert errors[1] < 0.02 and errors[1] < errors[0] / 3  # of third order, relative to a width of first order


# proofs ----------------------------------------------------------------------------------------------------------


def test_a_seeded_sample_of_a_chart_is_proved():
    """The whole chart is tests.benchmarks.stability's: 99 % decided, none against the multipliers."""
    rng = np.random.default_rng(7)
    arm = cra.Arm.nominal().replace(k_t=1e3)
    omega = 2 * np.pi * cra.natural_frequencies(arm)
    for excitation, most in ((cra.JointStiffness(), 0.4), (cra.AxialBase(0.01), 0.4)):
        varpi, size = rng.uniform(omega[0], 2.2 * omega[2], 200), rng.uniform(0.0, most, 200)
        proved = cra.certify_stability(arm, excitation, varpi, size)
        grown = cra.growth_rate(arm, excitation, varpi, size, tolerance=1e-12)
        assert np.isin(proved, ["stable", "unstable"]).mean() >= 0.99
        assert not (grown[proved == "stable"] > 1e-7).any() and (grown[proved == "unstable"] > 0).all()
        assert (proved == "unstable").sum() > 10


def test_damped_systems_are_proved_and_exact_resonances_are_not():
    belt = model(BELT, essential=PINNED, virtual_work=[(-d * v.diff(t), v, "domain")]).at({**MOVING, d: 0.2})
    assert list(cra.certify_stability(belt, TENSION, [5.7, 3.0], [0.4, 0.1])) == ["unstable", "stable"]
    arm = cra.Arm.nominal()
    omega = 2 * np.pi * cra.natural_frequencies(arm)
    assert cra.certify_stability(arm, cra.AxialBase(0.01), omega[0], 0.0) == "undecided"  # two multipliers 1


def test_an_enclosure_holds_the_monodromy_matrix_of_twenty_digits():
    """Mathieu's equation by mpmath's Taylor series; the proved bound is not exceeded, nor far too wide."""
    from mpmath import mp, odefun

    stiffness, size, varpi = np.array([[[2.3]]]), 0.8, 1.7
    swing = periodic.Swing(floquet.Oscillation(1, "cos", 0), np.array([size]), np.array([[[1.1]]]), None, None, None)
    system = periodic.PeriodicSystem(stiffness, np.zeros((1, 1, 1)), (swing,), np.array([2 * np.pi / varpi]))
    unit = np.array([[np.sqrt(2.3)]])
    maps, error = proved_stability.enclosed_monodromy(system, unit, 40, 0.0)
    with mp.workdps(20):

        def rates(time, y):
            return [y[1], -(mp.mpf(2.3) + mp.mpf(size) * mp.cos(mp.mpf(varpi) * time) * mp.mpf(1.1)) * y[0]]

        end = mp.mpf(system.period[0])
        columns = [odefun(rates, 0, start)(end) for start in ([1 / mp.mpf(unit[0, 0]), 0], [0, 1])]
        exact = [[columns[j][i] * (mp.mpf(unit[0, 0]) if i == 0 else 1) for j in (0, 1)] for i in (0, 1)]
        off = mp.sqrt(sum((mp.mpf(maps[0, i, j]) - exact[i][j]) ** 2 for i in (0, 1) for j in (0, 1)))
    assert float(off) < error[0] < 1e-11


def test_discs_hold_the_eigenvalues_of_every_matrix_within_the_error():
    rng = np.random.default_rng(3)
    maps = rng.normal(size=(50, 4, 4))
    centres, radii = proved_stability.multiplier_discs(maps, np.full(50, 1e-4))
    other = rng.normal(size=maps.shape)
    other *= 1e-4 / np.linalg.norm(other, axis=(1, 2), keepdims=True)
    found = np.linalg.eigvals(maps + other)
    assert (np.abs(found[:, :, None] - centres[:, None, :]) <= radii[:, None, :]).any(axis=2).all()
    assert np.median(radii) < 1e-2


@pytest.mark.parametrize("tolerance", [1e-4, 1e-8, 1e-12])
def test_the_monodromy_matrix_is_as_accurate_as_it_is_asked_for(tolerance):
    """Of random systems in which everything oscillates, against one of far smaller steps."""
    rng = np.random.default_rng(11)
    for _ in range(5):
        random = [0.2 * rng.normal(size=(2, 2, 1)) for _ in range(5)]
        swing = periodic.Swing(floquet.Oscillation(2, "sin", 0), np.array([0.4]), *random[:4])
        still = np.diag(rng.uniform(1.0, 30.0, 2))[..., None]
        system = periodic.PeriodicSystem(still, random[4], (swing,), np.array([2 * np.pi / rng.uniform(0.5, 5.0)]))
        found, exact = periodic.monodromy(system, tolerance), periodic.monodromy(system, 1e-17)
        assert np.abs(found - exact).max() < max(tolerance, 1e-12) * np.abs(exact).max()


def integrated(stiffness, damping, matrices, varpi, size):
    """The map of (q, p) over a period by a general integrator."""
    swung, drag, momentum, mass = matrices
    n = len(stiffness)

    def rates(time, y):
        q, p = y.reshape(2, n, 2 * n)
        g = size * np.cos(varpi * time)
        u = np.linalg.solve(np.eye(n) + g * mass, p - g * momentum @ q)
        return np.concatenate([u, -(damping + g * drag) @ u - (stiffness + g * swung) @ q]).ravel()

    end = solve_ivp(rates, (0, 2 * np.pi / varpi), np.eye(2 * n).ravel(), "DOP853", rtol=1e-12, atol=1e-13)
    return end.y[:, -1].reshape(2 * n, 2 * n)


@pytest.mark.parametrize("kind", ["damped", "gyroscopic", "both", "speed", "mass", "all", "free", "damper", "any"])
def test_half_a_period_tells_the_other_where_signs_make_it_so(kind):
    """Dampers, a gyroscopic coupling of odd with even modes that stands still or oscillates, and masses do; an
    oscillating damper and matrices of no symmetry do not."""
    rng = np.random.default_rng(5)
    stiffness, swung, damping, mass = rng.normal(size=(4, 4, 4))
    stiffness, swung, mass = stiffness + stiffness.T + 12 * np.eye(4), swung + swung.T, (mass + mass.T) / 6
    drag, momentum = np.zeros((2, 4, 4))
    odd = {"gyroscopic", "both", "speed", "all", "free"}
    signs = np.array([1, -1, 1, -1])
    same = signs[:, None] * signs > 0
    if kind in odd:
        stiffness, swung, mass = stiffness * same, swung * same, mass * same
        momentum = np.where(same, 0.0, damping) * (kind in ("speed", "all", "free"))
        drag = -momentum.T
    skew = np.where(same, 0.0, damping - damping.T) * (kind in odd)
    positive = np.where(same | (kind not in odd), damping @ damping.T / 10, 0.0)
    without = ("gyroscopic", "speed", "free")  # without damping
    still = skew if kind in without else {"any": damping / 5}.get(kind, positive + skew)
    if kind == "damper":
        drag = positive
    if kind not in ("mass", "all", "free"):
        mass = np.zeros((4, 4))
    wave, given = floquet.Oscillation(1, "cos", 0), (swung, drag, momentum, mass)
    drives = [(wave, [part if part.any() else None for part in given])]
    system, _ = periodic.PeriodicSystem.of(stiffness, still, drives, [2.0, 5.5], 0.6)
    assert (system.parity() is None) == (kind in ("any", "damper")) and system.conservative == (kind in without)
    exponents = periodic.floquet_exponents(stiffness, still, drives, [2.0, 5.5], 0.6, tolerance=1e-12)
    for found, row, rate in zip(periodic.monodromy(system, 1e-12), exponents, (2.0, 5.5), strict=True):
        exact = integrated(stiffness, still, given, rate, 0.6)
        np.testing.assert_allclose(found, exact, rtol=0, atol=3e-10 * np.abs(exact).max())
        # the characteristic polynomial is smooth where multipliers meet, though they are not
        polynomial = np.poly(np.exp(row * 2 * np.pi / rate))
        np.testing.assert_allclose(polynomial, np.poly(exact), rtol=0, atol=1e-8 * np.abs(np.poly(exact)).max())
        if kind in without:  # what does not grow does not by exactly nothing
            stable = np.abs(np.linalg.eigvals(exact)).max() < 1 + 1e-6
            assert (row[0].real == 0.0) == stable
    sine = (wave._replace(kind="sin"), drives[0][1])
    alone, mixed = (
        periodic.PeriodicSystem.of(stiffness, still, some, 2.0, 0.3)[0] for some in ([sine], [*drives, sine])
    )
    assert (alone.parity() is None) == (system.parity() is None)  # a sine is a cosine a quarter of a period later
    assert mixed.parity() is None  # not even about any time


@pytest.mark.parametrize("heavy", [0.3, 0.9])
@pytest.mark.parametrize("shapes", [1, 2, 3])
def test_a_mass_that_nearly_vanishes_is_followed(heavy, shapes):
    """Its inverse has a pole near the real axis, where the cosine is -1/heavy: steps must not reach it, however slow
    the system is. Masses that differ in their axes are inverted as matrices, the others as numbers."""
    rng = np.random.default_rng(shapes)
    point = rng.normal(size=(shapes, 3))
    masses = np.array([np.outer(row, row) / (row @ row) for row in point])
    drives = [(floquet.Oscillation(1, "cos", 0), (None, None, None, masses.sum(axis=0)))]
    if shapes == 3:
        drives = [(floquet.Oscillation(k + 1, "cos", 0), (None, None, None, m / 4)) for k, m in enumerate(masses)]
    still, drag = np.diag([0.01, 0.3, 4.0]), np.diag([0.0, 0.1, 0.0])
    size = heavy if shapes == 3 else heavy / np.linalg.norm(masses.sum(axis=0), 2)
    system, _ = periodic.PeriodicSystem.of(still, drag, drives, [0.7, 40.0], size)
    for found, exact in zip(periodic.monodromy(system), periodic.monodromy(system, 1e-15), strict=True):
        assert np.abs(found - exact).max() < 1e-8 * np.abs(exact).max()
    if shapes < 3:
        none = np.zeros((3, 3))
        other = integrated(still, drag, (none, none, none, drives[0][1][3]), 40.0, size)
        np.testing.assert_allclose(exact, other, rtol=0, atol=1e-10 * np.abs(other).max())


@cache
def planes():
    """Two planes that a spring between their tips couples, which pulsates about zero; a damper along each."""
    u, e, c_u = sp.Function("u")(x, t), sp.Symbol("e"), sp.Symbol("c_u")
    return model(
        BEAM + rhoA * u.diff(t) ** 2 / 2 - 2 * EI * u.diff(x, 2) ** 2 / 2,
        fields=(v, u),
        right=-k * epsilon * cos(varpi * t) * v * u,
        essential=[*CLAMPED, u.subs(x, 0), u.diff(x).subs(x, 0)],
        virtual_work=[(-c_u * u.diff(t), u, "domain"), (-e * v.diff(t), v, "domain")],
        small=SMALL,
    )


@cache
def coupled_planes(damper, other):
    return planes().at({**UNIT, k: 3.0, "c_u": damper, "e": other})


@pytest.mark.filterwarnings("ignore:resonance:cra_sym.AsymptoticWarning")
def test_a_sum_zone_with_one_mode_damped_has_no_end_to_first_order():
    """The width (c_m + c_n) sqrt(R/(c_m c_n) - 1) grows without bound; growth s at a detuning d: s(s + c + i d) = R."""
    size, damper = 0.2, 0.1
    widths = []
    for other in (0.1, 1e-3, 1e-5):
        system = coupled_planes(damper, other)
        lower, upper = cra.stability_boundary(system, system.model.excitation, size, (1, 2), modes=2)
        widths.append(upper - lower)
        omega = 2 * np.pi * cra.natural_frequencies(coupled_planes(0.0, 0.0), 2)
        strength = (size * 3.0 * 2.0 * 2.0) ** 2 / (16 * omega.prod())  # both tips move by 2 in their mode
        c_1, c_2 = damper / 2, other / 2
        expected = 2 * (c_1 + c_2) * np.sqrt(strength / (c_1 * c_2) - 1)
        assert widths[-1] == pytest.approx(expected, rel=1e-3)
    assert widths[0] < widths[1] < widths[2]
    for one, other in ((damper, 0.0), (0.0, damper)):
        system = coupled_planes(one, other)
        with pytest.warns(cra.AsymptoticWarning, match="one of the two modes is not damped: vibration grows at every"):
            assert cra.stability_boundary(system, system.model.excitation, size, (1, 2), modes=2) == (0.0, np.inf)
        detuning = np.array([-0.8, -0.4, 0.4, 0.8])
        found = cra.growth_rate(system, system.model.excitation, omega.sum() + detuning, size, 2)
        still = damper / 2 + 1j * detuning
        growing = (-still + np.sqrt(still**2 + 4 * strength)).real / 2
        # what the other terms of the excitation, of order epsilon^2 too, do to slow growth
        np.testing.assert_allclose(
            found, np.maximum(growing, (-still - np.sqrt(still**2 + 4 * strength)).real / 2), rtol=0.1
        )
    lower, upper = cra.stability_boundary(system, system.model.excitation, [0.0, size], (1, 2), modes=2)
    assert lower[0] == upper[0] == pytest.approx(omega.sum(), rel=1e-3) and upper[1] == np.inf


@pytest.mark.parametrize("size", [5e-324, 1e-200, 1e300])
@pytest.mark.filterwarnings("ignore:resonance:UserWarning")
def test_boundaries_of_extreme_excitations_are_numbers_or_none(size):
    system = coupled_planes(0.1, 0.1)
    for side in cra.stability_boundary(system, system.model.excitation, size, (1, 2), order=2, modes=2):
        assert np.isnan(side) or np.isfinite(side)


@pytest.mark.parametrize("damper", [0.0, 0.05])
def test_points_of_an_oscillating_gyroscopic_term_are_proved(damper):
    """A belt whose speed pulsates in the Coriolis term: none of the proved points is against the growth rates."""
    belt = model(
        rhoA * v.diff(t) ** 2 / 2 + rhoA * c * (1 + epsilon * cos(varpi * t)) * v.diff(t) * v.diff(x)
        - (T - rhoA * c**2) * v.diff(x) ** 2 / 2,
        essential=PINNED, small=SMALL, virtual_work=[(-d * v.diff(t), v, "domain")],
    ).at({rhoA: 1.0, c: 0.3, T: 1.0, L: 1.0, d: damper})  # fmt: skip
    assert all(drive.momentum is not None for drive in belt.model.excitation.drives(belt, 3))
    omega = 2 * np.pi * cra.natural_frequencies(belt.conservative_part, 3)
    frequency, size = np.linspace(omega[0], 2.2 * omega[-1], 25), np.linspace(0.02, 0.8, 8)[:, None]
    proved = cra.certify_stability(belt, belt.model.excitation, frequency, size)
    grown = cra.floquet_exponents(belt, belt.model.excitation, frequency, size, tolerance=1e-12)[..., 0].real
    assert (proved != "undecided").mean() > 0.95 and (proved == "stable").any() and (proved == "unstable").any()
    assert (grown[proved == "unstable"] > 0).all() and (grown[proved == "stable"] < 1e-7).all()


@pytest.mark.parametrize("damper", [0.0, 0.05])
def test_points_of_an_oscillating_mass_are_proved(damper):
    """None is against the growth rates; beyond a mass that may vanish nothing is proved."""
    tip = {"right": m * v.diff(t) ** 2 / 2, "virtual_work": [(-d * v.diff(t), v, "domain")]}
    beam = model(BEAM, essential=CLAMPED, **tip).at({**UNIT, m: 0.2, d: damper})
    omega, heavier = 2 * np.pi * cra.natural_frequencies(beam, 2), cra.Fluctuation(m=1.0, rhoA=0.5)
    at = np.linspace(omega[0], 2.2 * omega[-1], 30), np.linspace(0.05, 0.6, 5)[:, None]
    proved = cra.certify_stability(beam, heavier, *at, 2)
    grown = cra.floquet_exponents(beam, heavier, *at, 2, tolerance=1e-12)[..., 0].real
    assert (proved != "undecided").mean() > 0.95 and (proved == "stable").any() and (proved == "unstable").any()
    assert (grown[proved == "unstable"] > 0).all() and (grown[proved == "stable"] < 1e-7).all()
    with pytest.raises(ValueError, match=r"epsilon: the mass fluctuates by .* must be less than once"):
        cra.certify_stability(beam, heavier, 7.0, 5.0, 2)


def test_the_bound_of_a_monodromy_matrix_with_an_oscillating_mass_holds():
    """The exact motion from one state, by mpmath; the bound is that of doubles, not of a crude majorant."""
    heavy, steps = 0.7, 200
    stiffness, damping = np.diag([1.0, 5.0]), np.array([[0.0, 0.3], [-0.3, 0.1]])
    mass = np.array([[0.6, 0.3], [0.3, 0.4]]) / 0.9  # its row sums are one at most
    wave = floquet.Oscillation(1, "cos", 0)
    system, _ = periodic.PeriodicSystem.of(stiffness, damping, [(wave, (None, None, None, mass))], 3.0, heavy)
    unit = np.sqrt(np.diagonal(stiffness))[:, None]
    maps, error = proved_stability.enclosed_monodromy(system, unit, steps, 0.0)
    with mpmath.workdps(20):
        k, c, heavier = (mpmath.matrix(part.tolist()) for part in (stiffness, damping, heavy * mass))

        def rates(time, state):
            q, (p1, p2), turn = mpmath.matrix(state[:2]), state[2:], mpmath.cos(3 * time)
            a, b, d = 1 + turn * heavier[0, 0], turn * heavier[0, 1], 1 + turn * heavier[1, 1]
            u = mpmath.matrix([d * p1 - b * p2, a * p2 - b * p1]) / (a * d - b * b)
            return [*u, *(-(c * u) - k * q)]

        exact = mpmath.odefun(rates, 0, [1, 0, 1, 0], tol=mpmath.mpf(10) ** -17)(2 * mpmath.pi / 3)
    scale = np.array([*unit[:, 0], 1.0, 1.0])
    found = maps[0] @ (scale * np.array([1.0, 0.0, 1.0, 0.0]))
    start = np.linalg.norm(scale * np.array([1.0, 0.0, 1.0, 0.0]))
    off = np.linalg.norm(found - scale * np.array([float(value) for value in exact]))
    assert off <= error[0] * start and error[0] < 1e-9  # two hundred steps with some hundred operations each


@pytest.mark.parametrize("rank", [0, 1, 2])
def test_factors_of_low_rank_leave_the_motion_as_it_is(rank):
    rng = np.random.default_rng(11 + rank)
    columns, swung = 0.3 * rng.normal(size=(2, 3, rank))
    mass, other = 0.3 * columns @ columns.T, columns @ swung.T
    drives = [(floquet.Oscillation(1, "cos", 0), [other @ other.T, other, other.T, mass])]
    stiffness = np.diag([1.0, 4.0, 9.0])
    system, _ = periodic.PeriodicSystem.of(stiffness, 0.01 * stiffness, drives, np.array([2.0, 3.0]), 0.2)
    found = [np.array(list(periodic.propagated(system, 10, 16, factored=by)))[-1] for by in (False, True)]
    # rounding of some 1e3 operations on states of size one
    np.testing.assert_allclose(*found, rtol=0, atol=1e-12)
    if rank:
        still, _ = periodic.PeriodicSystem.of(stiffness, 0.01 * stiffness, [], np.array([2.0, 3.0]), 0.2)
        assert np.abs(found[1] - np.array(list(periodic.propagated(still, 10, 16)))[-1]).max() > 1e-3


def test_zones_of_one_damped_mass():
    """Fewer modes than a second order would include: Mathieu's zone with damping, to second order."""
    q = sp.Function("q")(t)
    energy = q.diff(t) ** 2 / 2 - k * q**2 / 2
    mass = cra.Model(0, fields=[], x=x, domain=(0, 1), t=t, coordinates=[q], left=energy,
                     virtual_work=[(-d * q.diff(t), q, None)]).at({k: 100.0, d: 0.1})  # fmt: skip
    lower, upper = cra.stability_boundary(mass, cra.Fluctuation(k=1.0), 0.1, order=2, modes=1)
    for side, way in ((lower, 1), (upper, -1)):
        inside, outside = (
            cra.floquet_exponents(mass, cra.Fluctuation(k=1.0), side + way * step, 0.1, 1)[0].real
            for step in (0.01, -0.01)
        )  # the third order is of the size 10 * 0.1**3 / 8
        assert outside < 0 < inside


@pytest.mark.parametrize("own", [True, False])
def test_a_fluctuating_mass_feels_a_moving_base_and_its_weight(own):
    """The inertia on the base did not fluctuate, and a Lagrangian that says so was refused with an internal error.

    Against the periodic motion of an integrator: the start that comes back after a period.
    """
    q, w, push = (sp.Function(name)(t) for name in ("q", "w", "push"))
    wave = 1 + epsilon * cos(varpi * t)
    turned = 1 + epsilon * sin(varpi * t) if own else 1

    def lagrangian(factor, other):
        inertia = m * factor * ((q + w).diff(t) ** 2 / 2 - d * q)
        return inertia - k * q**2 / 2 + push * other * q

    given = {"left": lagrangian(wave if own else 1, turned), "small": SMALL if own else None}
    block = cra.Model(0, fields=[], x=x, domain=(0, 1), t=t, coordinates=[q], prescribed=[w],
                      virtual_work=[(-c * q.diff(t), q, None)], **given)  # fmt: skip
    system = block.at({m: 1.0, k: 50.0, c: 0.5, d: 0.3})
    rate, size, amplitude, force = 6.0, 0.3, 0.01, 0.2
    ((state,),) = cra.steady_states(
        system, [rate], excitation=block.excitation if own else cra.Fluctuation(m=1.0), epsilon=size,
        drive={"w": amplitude, "push": force}, modes=1, harmonics=15,
    )  # fmt: skip

    def rates(time, y):
        factor = 1 + size * np.cos(rate * time)
        other = 1 + size * np.sin(rate * time) * own
        speed = y[1] / factor + amplitude * rate * np.sin(rate * time)  # momentum m (q' + w')
        return [speed, -50.0 * y[0] - 0.5 * speed - 0.3 * factor + force * other * np.cos(rate * time)]

    def after(start, **more):
        return solve_ivp(rates, (0.0, 2 * np.pi / rate), start, "DOP853", rtol=1e-11, atol=1e-13, **more).y

    still = after([0.0, 0.0])[:, -1]
    map_ = np.stack([after(unit)[:, -1] - still for unit in np.eye(2)], axis=-1)
    start = np.linalg.solve(np.eye(2) - map_, still)
    path = after(start, t_eval=np.linspace(0.0, 2 * np.pi / rate, 2001))[0]
    assert state.amplitude == pytest.approx(np.abs(path).max(), rel=1e-5)  # of the samples: their distance squared
    assert state.stable


def test_an_input_in_oscillating_terms_alone_drives():
    q, push = sp.Function("q")(t), sp.Function("push")(t)
    energy = m * q.diff(t) ** 2 / 2 - k * q**2 / 2 + push * q * epsilon * cos(varpi * t)
    block = cra.Model(0, fields=[], x=x, domain=(0, 1), t=t, coordinates=[q], left=energy, small=SMALL,
                      virtual_work=[(-c * q.diff(t), q, None)]).at({m: 1.0, k: 50.0, c: 0.5})  # fmt: skip
    ((state,),) = cra.steady_states(
        block, [6.0], excitation=block.model.excitation, epsilon=0.3, drive={"push": 0.2}, modes=1, harmonics=3
    )
    still, swung = 0.03 / 50.0, 0.03 / abs(50.0 - 12.0**2 + 6.0j)  # cos^2 = 1/2 + cos(2 varpi t)/2
    assert state.amplitude == pytest.approx(still + swung, rel=1e-9)
    assert cra.growth_rate(block, block.model.excitation, 6.0, 0.3, 1) == 0.0
    with pytest.raises(
        ValueError, match=r"small: the load .*push\(t\)\*\*2.* must be linear in prescribed motions and"
    ):
        block.model.replace(left=energy + epsilon * cos(varpi * t) * q * push**2)


@pytest.mark.parametrize("kind", ["phases", "gyroscopic", "equal", "free", "circulatory"])
def test_what_does_not_grow_without_damping_does_so_by_nothing(kind):
    """Where half a period does not give the other: several phases, equal planes, rigid motions, follower forces."""
    rng = np.random.default_rng(4)
    cosine, sine = (floquet.Oscillation(1, wave, 0) for wave in ("cos", "sin"))
    still, drag, (swung, other, turn) = np.diag([1.0, 4.0, 9.0]), np.zeros((3, 3)), rng.normal(size=(3, 3, 3))
    swung, other, turn = swung + swung.T, other + other.T, turn - turn.T
    drives = [(cosine, (swung, None, None, None)), (sine, (other, None, None, None))]
    if kind == "gyroscopic":
        drag, drives = turn, drives[:1]
    elif kind == "equal":  # every multiplier is double
        still, drag = np.kron(still[:2, :2], np.eye(2)), np.zeros((4, 4))
        drives = [(wave, (np.kron(m[0][:2, :2], np.eye(2)), None, None, None)) for wave, m in drives]
    elif kind == "free":
        still = np.diag([0.0, 4.0, 9.0])
        drives = [(wave, (None, None, None, m[0] / 12)) for wave, m in drives]
    elif kind == "circulatory":
        still, drives = still + 0.3 * np.triu(other, 1), [(cosine, (swung + 0.3 * turn, None, None, None))]
    varpi, size = np.linspace(0.5, 8.0, 24), np.linspace(0.0, 0.4, 9)[:, None]
    growth = periodic.growth_rate(still, drag, drives, varpi, size) * 2 * np.pi / varpi
    system, shape = periodic.PeriodicSystem.of(still, drag, drives, varpi, size)
    multipliers = np.linalg.eigvals(periodic.monodromy(system, 1e-14))
    exact = np.log(np.abs(multipliers).max(axis=-1)).reshape(shape)
    growing = exact > 1e-5  # rigid motions' double multipliers are known to half the digits
    assert ((growth > 0) == growing).all() and growing.any() and not growing.all()
    np.testing.assert_allclose(growth[growing], exact[growing], rtol=1e-6)
    exponents = periodic.floquet_exponents(still, drag, drives, varpi, size)
    np.testing.assert_allclose(exponents[..., 0].real * 2 * np.pi / varpi, growth, rtol=1e-9, atol=1e-15)


def test_follower_forces_without_damping_are_proved():
    """Reversible in time: multipliers on the circle that stay apart prove that nothing grows."""
    still = np.array([[1.0, 0.3, 0.0], [-0.2, 4.0, 0.5], [0.2, 0.1, 9.0]])
    swung = np.array([[0.5, -0.4, 0.2], [0.9, 0.7, 0.3], [-0.1, 0.6, -0.8]])
    drives = [(floquet.Oscillation(1, "cos", 0), (swung, None, None, None))]
    varpi, size = np.linspace(0.7, 8.0, 40), np.linspace(0.0, 0.6, 12)[:, None]
    system, shape = periodic.PeriodicSystem.of(still, np.zeros((3, 3)), drives, varpi, size)
    assert system.reversible and not system.conservative
    verdict = proved_stability.proved_stability(system, np.array([[1.0], [2.0], [3.0]]), system.reversible, 1e-11)
    growth = periodic.growth_rate(still, np.zeros((3, 3)), drives, varpi, size)
    stable, unstable = (verdict.reshape(shape) == word for word in (proved_stability.STABLE, proved_stability.UNSTABLE))
    assert (growth[stable] == 0).all() and (growth[unstable] > 0).all() and unstable.any()
    assert (stable | unstable).mean() > 0.97  # multipliers meet where frequencies differ by the excitation's
