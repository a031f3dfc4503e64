"""Proved enclosures against roots found at 40 digits of the determinant written out by hand."""

from __future__ import annotations

import sys

import mpmath as mp
import numpy as np
import pytest
import sympy as sp

import cra_sym as cra
from cra_sym.model.ball_problem import bound
from cra_sym.solvers.ball_spans import static_solutions
from cra_sym.solvers.ball_stiffness import BallStiffness
from cra_sym.solvers.certificates import UndecidedError, decided, enclose, negatives
from cra_sym.symbols import L, t, v, w, x

flint = pytest.importorskip("flint", reason="the extra 'certify' brings python-flint")


def random_arms(number, seed):
    rng = np.random.default_rng(seed)

    def spread(low, high, *special):
        values = 10 ** rng.uniform(low, high, number)
        chosen = rng.random(number)
        for k, value in enumerate(special):
            values[(chosen > 0.15 * k) & (chosen < 0.15 * (k + 1))] = value
        return values

    return cra.Arm.nominal().replace(
        k_t=spread(-9, 12, 0.0, np.inf),
        k_r=spread(-9, 12, 0.0, np.inf),
        m_e=spread(-6, 5, 0.0),
        J_e=spread(-9, 5, 0.0),
        L=10 ** rng.uniform(-1, 1, number),
    )


def determinant(arm, lam):
    """Determinant of the four boundary conditions, the columns cos, sin, cosh, sinh; exact parameters."""
    L, b, h, E, rho = (mp.mpf(getattr(arm, name)) for name in ("L", "b", "h", "E", "rho"))
    EI, mass = E * b * h**3 / 12, rho * b * h * L
    c, s, C, S = mp.cos(lam), mp.sin(lam), mp.cosh(lam), mp.sinh(lam)
    kt, kr = (mp.mpf(arm.k_t) * L**3 / EI, mp.mpf(arm.k_r) * L / EI)
    mu, iota = mp.mpf(arm.m_e) / mass, mp.mpf(arm.J_e) / (mass * L**2)
    shear = [1, 0, 1, 0] if mp.isinf(kt) else [kt, -(lam**3), kt, lam**3]
    moment = [0, 1, 0, 1] if mp.isinf(kr) else [-(lam**2), -kr * lam, lam**2, -kr * lam]
    tip_moment = [lam**2 * f - iota * lam**5 * g for f, g in zip((-c, -s, C, S), (-s, c, S, C), strict=True)]
    tip_shear = [lam**3 * f + mu * lam**4 * g for f, g in zip((s, -c, S, C), (c, s, C, S), strict=True)]
    return mp.det(mp.matrix([shear, moment, tip_moment, tip_shear]))


@pytest.mark.parametrize("seed", range(6))
def test_the_enclosure_holds_the_root_of_the_hand_written_determinant(seed):
    arm = random_arms(1, seed)
    arm = arm.replace(**{name: float(getattr(arm, name)[0]) for name in ("k_t", "k_r", "m_e", "J_e", "L")})
    certificate = cra.certify(arm, modes=4)
    assert certificate.complete
    with mp.workdps(60):
        L, mass = mp.mpf(arm.L), mp.mpf(arm.rho) * mp.mpf(arm.b) * mp.mpf(arm.h)
        scale = mp.sqrt(mp.mpf(arm.E) * mp.mpf(arm.b) * mp.mpf(arm.h) ** 3 / 12 / mass) / (2 * mp.pi * L**2)
        for low, high in zip(certificate.lower, certificate.upper, strict=True):
            if high == 0:
                continue
            width = mp.mpf(high) * mp.mpf(2) ** -52
            ends = [mp.sqrt((mp.mpf(x) + d) / scale) for x, d in ((low, -width), (high, width))]
            root = mp.findroot(lambda lam: determinant(arm, lam), ends, solver="anderson", tol=1e-60, verify=False)
            assert low <= scale * root**2 <= high


def test_the_solver_lies_within_the_enclosures():
    arm = random_arms(60, seed=20261122)
    certificate = cra.certify(arm, modes=10)
    assert certificate.complete.all()
    frequency = cra.natural_frequencies(arm, modes=10)
    outside = np.maximum(frequency - certificate.upper, certificate.lower - frequency)
    assert (outside <= 4e-15 * frequency).all()
    assert (certificate.upper - certificate.lower <= 1e-14 * certificate.lower).all()
    assert (certificate.upper[:, :-1] <= certificate.lower[:, 1:]).all()


def test_three_modes_unless_asked_for_more():
    certificate = cra.certify(cra.Arm.nominal())
    assert certificate.lower.shape == certificate.upper.shape == (3,) and certificate.complete.shape == ()


def test_rigid_body_modes_are_zero():
    free = cra.Arm.nominal().replace(k_t=[0.0, 0.0, 1e3], k_r=[0.0, 1e2, 0.0])
    certificate = cra.certify(free, modes=3)
    assert ((certificate.upper == 0).sum(axis=-1) == [2, 1, 1]).all()
    assert ((certificate.lower == 0) == (certificate.upper == 0)).all()


def counted(system, index=()):
    """The problem of one member of a batch in ball arithmetic."""
    names, held = system.numerics("names"), system.numerics("stiffnesses")
    values = {name: float(np.broadcast_to(system.values[name], system.shape)[index]) for name in names}
    problem = bound(flint, system.numerics, held, values, damped=False)
    return BallStiffness(flint, problem.balls, static_solutions(flint, problem.exact))


def test_the_proved_number_of_frequencies_is_the_solver_s():
    """Between and next to the frequencies, for joints of every kind."""
    arm = random_arms(40, seed=5)
    for place, found in enumerate(cra.natural_frequencies(arm, modes=8)):
        problem = counted(arm, (place,))
        assert problem.zeros == (found == 0).sum()
        near = found[found > 0] * np.array([[1 - 1e-9], [1 + 1e-9]])
        for point in [*near.flat, *(found[-3:-1] * 1.1)]:
            assert problem.count(flint.arb(point)) == (found < point).sum()


HALF = sp.Rational(1, 2)
rho, EI, T, k, G, J, m, M = sp.symbols("rho EI T k G J m M")
turn = sp.Function("turn")(x, t)
beam = HALF * rho * v.diff(t) ** 2 - HALF * EI * v.diff(x, 2) ** 2
shear = HALF * rho * v.diff(t) ** 2 + HALF * J * turn.diff(t) ** 2
shear -= HALF * EI * turn.diff(x) ** 2 + HALF * G * (v.diff(x) - turn) ** 2
clamped = [v.subs(x, 0), v.diff(x).subs(x, 0)]
moving = beam.subs(v.diff(t), v.diff(t) + w.diff(t))


def test_frequencies_at_special_shares_of_the_spectrum_are_decided():
    """A free rod: at half its first frequency entries of its dynamic stiffness are exactly zero."""
    proof = cra.certify(cra.Model(
        HALF * v.diff(t) ** 2 - HALF * T * v.diff(x) ** 2, fields=[v], x=x, domain=(0, 1), t=t
    ).at({T: 1.0}), 3)  # fmt: skip
    assert proof.complete and proof.upper[0] == 0.0 and (proof.lower[1:] <= [0.5, 1.0]).all()
    assert (proof.upper[1:] >= [0.5, 1.0]).all()


def systems():
    """Systems with one and several wave numbers, two fields, a lumped coordinate, an offset mass, no support at all."""
    common = {"fields": [v], "x": x, "domain": (0, L), "t": t}
    values = {rho: 1.3, EI: 2.0, L: 1.1}
    tip = HALF * m * (v.diff(t) + L / 5 * v.diff(x, t)) ** 2
    yield "tension", cra.Model(beam - HALF * T * v.diff(x) ** 2, essential=clamped, **common).at({**values, T: 7.0})
    yield "foundation", cra.Model(beam - HALF * k * v**2, **common).at({**values, k: 300.0})
    yield "offset mass", cra.Model(beam, essential=clamped, right=tip, **common).at({**values, m: 0.7})
    yield "free", cra.Model(beam, **common).at(values)
    string = HALF * rho * v.diff(t) ** 2 - HALF * T * v.diff(x) ** 2
    yield "string", cra.Model(string, essential=[v.subs(x, 0)], **common).at({rho: 1.3, T: 7.0, L: 1.1})
    two = {**common, "fields": [v, turn]}
    timoshenko = cra.Model(shear, essential=[v.subs(x, 0), turn.subs(x, 0)], right=tip.subs(L, 0), **two)
    yield "Timoshenko", timoshenko.at({rho: 1.3, EI: 2.0, L: 1.1, G: 50.0, J: 0.01, m: 0.7})
    yield "free Timoshenko", cra.Model(shear, **two).at({rho: 1.3, EI: 2.0, L: 1.1, G: 50.0, J: 0.01})
    carried = cra.Model(moving, essential=clamped, left=HALF * M * w.diff(t) ** 2, coordinates=[w], **common)
    yield "carried", carried.at({**values, M: 2.0})


@pytest.mark.parametrize("name", [name for name, _ in systems()])
def test_any_uniform_system_is_certified(name):
    system = dict(systems())[name]
    found, certificate = cra.natural_frequencies(system, 6), cra.certify(system, 6)
    assert certificate.complete
    # the dynamic stiffness loses digits like its condition number, some hundreds here
    np.testing.assert_allclose(certificate.lower, found, rtol=1e-12, atol=0)
    assert (certificate.upper - certificate.lower <= 1e-15 * certificate.lower).all()


def test_what_varies_along_x_is_refused():
    varying = cra.Model(beam - HALF * T * x * v.diff(x) ** 2, fields=[v], x=x, domain=(0, L), t=t, essential=clamped)
    with pytest.raises(ValueError, match="constant along x"):
        cra.certify(varying.at({rho: 1.0, EI: 1.0, T: 1.0, L: 1.0}))


def test_inertia_of_a_matrix_of_balls():
    """Against eigenvalues in floating point; a matrix whose pivots vanish is not decided."""
    rng = np.random.default_rng(3)
    for size in (1, 2, 5):
        matrix = rng.normal(size=(size, size))
        matrix += matrix.T
        balls = [[flint.arb(entry) for entry in row] for row in matrix]
        assert negatives(balls) == (np.linalg.eigvalsh(matrix) < 0).sum()
    with pytest.raises(UndecidedError):
        negatives([[flint.arb(0), flint.arb(1)], [flint.arb(1), flint.arb(0)]])


class Parabola:
    """Frequencies at 1 and at 2 or another place above."""

    zeros = 0

    def __init__(self, other=2):
        self.other = other

    def count(self, point):
        return int(point > 1) + int(point > self.other)


def test_a_guess_elsewhere_proves_nothing():
    with pytest.raises(UndecidedError, match="frequency 2 is not near"):
        enclose(flint, Parabola(), [1.0, 1.5])
    (low, high), _ = enclose(flint, Parabola(), [1.0 + 1e-9, 2.0])
    assert low <= 1 <= high and float(high - low) < 1e-15


def test_close_neighbours_get_enclosures_of_their_own():
    """Also if both guesses are so far off that the first bracket around them holds the two."""
    other = flint.arb(1) + flint.arb(2) ** -30
    (low, high), (low_2, high_2) = enclose(flint, Parabola(other), [1 - 2.0**-21, 1 + 2.0**-21])
    assert low <= 1 <= high < low_2 <= other <= high_2


def test_enclosures_are_as_narrow_as_promised():
    for root, (low, high) in zip((1, 2), enclose(flint, Parabola(), [1.0, 2.0]), strict=True):
        assert low <= root <= high
        assert high - low <= root * flint.arb(2) ** -53


def test_what_is_undecided_at_every_precision_is_said():
    with pytest.raises(UndecidedError, match="12288 bits"):
        decided(flint, lambda: negatives([[flint.arb.pi().sin()]]))


def test_a_missing_library_names_the_extra(monkeypatch):
    monkeypatch.setitem(sys.modules, "flint", None)
    with pytest.raises(ImportError, match=r"'cra_sym\[certify\]'"):
        cra.certify(cra.Arm.nominal())


def test_a_frequency_that_is_a_float_is_enclosed():
    """A string between fixed ends whose first frequencies are 1 and 2 Hz: the guess is the frequency itself."""
    m, N = sp.symbols("m N", positive=True)
    string = cra.Model(
        m * v.diff(t) ** 2 / 2 - N * v.diff(x) ** 2 / 2,
        fields=[v], x=x, domain=(0, 1), t=t, essential=[v.subs(x, 0), v.subs(x, 1)],
    )  # fmt: skip
    proved = cra.certify(string.at({m: 1.0, N: 4.0}), 2)
    assert proved.complete and (proved.lower < [1.0, 2.0]).all() and (proved.upper > [1.0, 2.0]).all()


@pytest.mark.parametrize("factor", [sp.cos, sp.sqrt, lambda a: sp.exp(-a / 3) + a ** sp.Rational(2, 3)])
def test_coefficients_may_be_irrational_functions(factor):
    """A free rod on a spring k factor(a): w tan w = k factor(a); without the spring it moves rigidly."""
    rod, k, a = sp.Function("rod")(x, t), sp.Symbol("k"), sp.Symbol("a")
    energy = rod.diff(t) ** 2 / 2 - rod.diff(x) ** 2 / 2
    made = cra.Model(energy, fields=[rod], x=x, domain=(0, 1), t=t, right=-k * factor(a) * rod**2 / 2)
    proof = cra.certify(made.at({k: [1.7, 0.0], a: 0.3}), 2)
    assert proof.complete.all() and proof.upper[1, 0] == 0.0
    with mp.workdps(40):
        stiffness = mp.mpf(1.7) * sp.lambdify(a, factor(a), "mpmath")(mp.mpf(0.3))
        for low, high in zip(proof.lower[0], proof.upper[0], strict=True):
            ends = [w * mp.sin(w) - stiffness * mp.cos(w) for w in (2 * mp.pi * mp.mpf(f) for f in (low, high))]
            assert ends[0] * ends[1] < 0 and high - low < 4 * np.spacing(high)


def test_places_and_functions_that_no_ball_takes_are_refused_by_name():
    rod, k, a = sp.Function("rod")(x, t), sp.Symbol("k"), sp.Symbol("a")
    energy = rod.diff(t) ** 2 / 2 - rod.diff(x) ** 2 / 2
    options = {"fields": [rod], "x": x, "domain": (0, 1), "t": t}
    for made, name in (
        (cra.Model(energy, right=-k * sp.besselj(0, a) * rod**2 / 2, **options), "besselj"),
        (cra.Model(energy, right=-k * rod**2 / 2, inside=[(sp.sqrt(a), -k * rod**2 / 2)], **options), "sqrt"),
    ):
        with pytest.raises(ValueError, match=rf"system: the coefficients contain {name}.*put a parameter in place of"):
            cra.certify(made.at({k: 1.0, a: 0.3}), 1)


GYROSCOPIC = {"x": x, "domain": (0, L), "t": t}


def test_a_moving_string_is_certified():
    """Between two eyes: n (w^2 - U^2) / (2 l w), w the speed of waves, in 40 digits."""
    m, T, U = sp.symbols("m T U")
    moving = m * (v.diff(t) + U * v.diff(x)) ** 2 / 2 - T * v.diff(x) ** 2 / 2
    string = cra.Model(moving, fields=[v], essential=[v.subs(x, 0), v.subs(x, L)], **GYROSCOPIC)
    proof = cra.certify(string.at({"m": 0.3, "T": 20.0, "U": [0.0, 3.0, 8.0], "L": 1.2}), 4)
    assert proof.complete.all()
    with mp.workdps(40):
        wave = mp.sqrt(mp.mpf(20.0) / mp.mpf(0.3))
        for low, high, speed in zip(proof.lower, proof.upper, (0.0, 3.0, 8.0), strict=True):
            for n in range(4):
                exact = (n + 1) * (wave**2 - mp.mpf(speed) ** 2) / (2 * mp.mpf(1.2) * wave)
                assert mp.mpf(low[n]) <= exact <= mp.mpf(high[n])
                assert high[n] - low[n] <= 4 * np.spacing(high[n])
    with pytest.raises(ValueError, match="a stiffness is negative"):  # faster than its waves
        cra.certify(string.at({"m": 0.3, "T": 20.0, "U": 9.0, "L": 1.2}))


def test_a_shaft_with_a_disc_is_certified():
    """In two planes, with a disc and distributed gyroscopic terms; the argument principle counts the same."""
    rhoA, EI, m, U, k, J, g = sp.symbols("rhoA EI m U k J g")
    u = sp.Function("u")(x, t)
    shaft = cra.Model(
        rhoA * (v.diff(t) ** 2 + u.diff(t) ** 2) / 2 + J * U * v.diff(x) * u.diff(x, t)
        - EI * (v.diff(x, 2) ** 2 + u.diff(x, 2) ** 2) / 2,
        fields=[v, u], left=-k * (v**2 + u**2) / 2,
        right=-k * (v**2 + u**2) / 2 + m * (v.diff(t) ** 2 + u.diff(t) ** 2) / 2 + g * U * v.diff(x) * u.diff(x, t),
        **GYROSCOPIC,
    ).at({"rhoA": 0.3, "m": 0.2, "EI": 5.0, "U": 30.0, "L": 1.2, "k": 800.0, "g": 2e-3, "J": 1e-4})  # fmt: skip
    proof = cra.certify(shaft, 5)
    assert proof.complete
    s = cra.eigenvalues(shaft, 5)
    assert np.abs(s.imag / (2 * np.pi) / proof.lower - 1).max() < 1e-11
    for number in range(5):  # just below and above each
        below, above = (2 * np.pi * proof.lower[number] * (1 + side * 1e-6) for side in (-1, 1))
        assert cra.count_eigenvalues(shaft, [below, above]).tolist() == [2 * number, 2 * number + 2]
    # without springs the potential energy is not positive definite, and the determinant proves
    c = sp.Symbol("c")
    damped = shaft.model.replace(virtual_work=[(-c * v.diff(t), v, "right")]).at({**shaft.values, "c": 0.1})
    for other in (shaft.replace(k=0.0), damped):
        proof = cra.certify(other, 3)
        assert proof.complete
        assert np.abs(cra.eigenvalues(other, 3).imag / (2 * np.pi) / proof.lower - 1).max() < 1e-11


def test_a_length_of_pi_makes_no_rigid_motion():
    """Pi is irrational: a string between fixed ends had been certified to have a rigid motion."""
    mass, N = sp.symbols("mass N")
    string = cra.Model(
        mass * v.diff(t) ** 2 / 2 - N * v.diff(x) ** 2 / 2,
        fields=[v], x=x, domain=(0, sp.pi), t=t, essential=[v.subs(x, 0), v.subs(x, sp.pi)],
    )  # fmt: skip
    proof = cra.certify(string.at({mass: 1.0, N: 1.0}), 3)
    with mp.workdps(40):
        exact = [n / (2 * mp.pi) for n in (1, 2, 3)]
    assert proof.complete and all(a <= f <= b for a, f, b in zip(proof.lower, exact, proof.upper, strict=True))
    free = cra.certify(string.replace(essential=[]).at({mass: 1.0, N: 1.0}), 2)
    assert free.complete and free.upper[0] == 0.0 and free.lower[1] <= exact[0] <= free.upper[1]


def test_a_stepped_string_with_a_mass_inside_is_certified():
    """Its condition where the parts meet, in 40 digits; the places lie in any order."""
    T, rho_, a, b, m = sp.symbols("T rho a b m")
    density = rho_ * (1 + 2 * sp.Heaviside(x - a)) * v.diff(t) ** 2 / 2 - T * v.diff(x) ** 2 / 2
    string = cra.Model(
        density, fields=[v], x=x, domain=(0, 1), t=t, essential=[v.subs(x, 0), v.subs(x, 1)],
        inside=[(b, m * v.diff(t) ** 2 / 2)],
    )  # fmt: skip
    places = {"a": 0.25, "b": np.array([0.5, 0.25, 0.125])}
    proof = cra.certify(string.at({"T": 2.0, "rho": 1.0, "m": 0.3, **places}), 4)
    assert proof.complete.all()
    with mp.workdps(40):
        slow, fast = mp.sqrt(mp.mpf(1) / 2), mp.sqrt(mp.mpf(3) / 2)
        for row, at in enumerate(places["b"]):

            def meet(f, at=float(at)):
                w = 2 * mp.pi * f
                state = [mp.mpf(0), mp.mpf(1)]  # displacement and tension times slope
                steps = sorted({0.25, at, 1.0})
                for left, right in zip([0.0, *steps], steps, strict=False):
                    wave = w * (slow if right <= 0.25 else fast)
                    cos, sin = mp.cos(wave * (right - left)), mp.sin(wave * (right - left)) / (2 * wave)
                    state = [cos * state[0] + sin * state[1], cos * state[1] - 4 * wave**2 * sin * state[0]]
                    if right == at:
                        state[1] -= mp.mpf(0.3) * w**2 * state[0]
                return state[0]

            for low, high in zip(proof.lower[row], proof.upper[row], strict=True):
                assert high - low <= 4 * np.spacing(high)
                assert meet(mp.mpf(low)) * meet(mp.mpf(high)) < 0


def test_a_table_of_steps_and_a_support_inside_are_certified():
    """A support at the node of a mode leaves that mode; other frequencies lie at or above those without it."""
    EI, rho_ = sp.symbols("EI rho")
    table = cra.stations(x, [(0, 3.0), (0.25, 2.0), (0.75, 3.0)], kind="step")
    ends = [v.subs(x, 0), v.subs(x, 1)]
    beam = cra.Model(
        rho_ * v.diff(t) ** 2 / 2 - EI * table * v.diff(x, 2) ** 2 / 2,
        fields=[v], x=x, domain=(0, 1), t=t, essential=ends,
    )  # fmt: skip
    held = beam.replace(essential=[*ends, v.subs(x, HALF)])
    free, proof = (cra.certify(made.at({EI: 2.0, rho_: 1.0}), 4) for made in (beam, held))
    assert free.complete and proof.complete
    assert abs(proof.lower[0] / free.lower[1] - 1) < 1e-15 and abs(proof.lower[2] / free.lower[3] - 1) < 1e-15
    assert (proof.lower >= free.lower).all()
    found = beam.at({EI: 2.0, rho_: 1.0})
    assert (np.abs(cra.natural_frequencies(found, 4) / free.lower - 1) <= found.accuracy + 1e-13).all()


def test_lumped_gyroscopic_systems_are_certified():
    """A mass on unequal springs in a rotating frame, whose frequencies are roots of a quadratic."""
    m, k, g, U = sp.symbols("m k g U")
    p, q = sp.Function("p")(t), sp.Function("q")(t)
    rotor = cra.Model(
        0, fields=(), coordinates=[p, q], x=x, domain=(0, 1), t=t,
        left=m * ((p.diff(t) - U * q) ** 2 + (q.diff(t) + U * p) ** 2) / 2 - k * p**2 / 2 - g * q**2 / 2,
    )  # fmt: skip
    proof = cra.certify(rotor.at({m: 2.0, k: 3.0, g: 5.0, U: 0.5}), 2)
    assert proof.complete
    with mp.workdps(40):  # (5/4 - s)(9/4 - s) = s, with s = omega^2
        for low, high, square in zip(proof.lower, proof.upper, (0.75, 3.75), strict=True):
            exact = mp.sqrt(square) / (2 * mp.pi)
            assert mp.mpf(low) <= exact <= mp.mpf(high)
            assert high - low <= 4 * np.spacing(high)
