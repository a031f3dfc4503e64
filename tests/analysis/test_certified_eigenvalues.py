"""Proved complex eigenvalues: against closed forms and hand-written determinants in 40 digits."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
import sympy as sp
from mpmath import mp

import cra_sym as cra
from cra_sym.analysis.certification import _characteristic
from cra_sym.model.ball_problem import BallProblem
from cra_sym.model.ball_problem import bound as bound_problem
from cra_sym.solvers.certificates import precision
from cra_sym.solvers.eigenvalue_enclosures import first_eigenvalues
from cra_sym.symbols import L, t, v, x

flint = pytest.importorskip("flint", reason="the extra 'certify' brings python-flint")

HALF = sp.Rational(1, 2)
rho, EI, T, c, tau, m, U, P, k, a = sp.symbols("rho EI T c tau m U P k a")
u = sp.Function("u")(x, t)
BEAM = HALF * rho * v.diff(t) ** 2 - HALF * EI * v.diff(x, 2) ** 2
STRING = HALF * rho * v.diff(t) ** 2 - HALF * T * v.diff(x) ** 2
CLAMPED = [v.subs(x, 0), v.diff(x).subs(x, 0)]
VALUES = {"rho": 1.3, "EI": 2.0, "L": 1.1, "T": 7.0, "c": 0.4, "tau": 1e-3, "m": 0.3, "U": 2.0, "P": 45.0, "k": 300.0,
          "a": 0.4}  # fmt: skip
DIGITS = 40


def model(density, **options):
    return cra.Model(density, **{"fields": [v], "x": x, "domain": (0, L), "t": t} | options)


def bound(made, **changes):
    values = {symbol.name: VALUES[symbol.name] for symbol in made.symbols}
    return made.at(values | changes)


def exact(name):
    return mp.mpf(VALUES[name])


def holds(low, high, s):
    """Whether a rectangle of doubles holds a number of many digits."""
    return low.real <= s.real <= high.real and low.imag <= s.imag <= high.imag


def check(system, modes, expected, **options):
    """All enclosures hold the expected values, are narrow, and the solver lies within its accuracy of them."""
    proof = cra.certify_eigenvalues(system, modes, **options)
    assert proof.complete
    size = np.abs(proof.lower)
    assert (np.abs(proof.upper - proof.lower) <= 4e-16 * size).all()
    if expected is not None:
        assert all(
            holds(*ends, s) for ends, s in zip(zip(proof.lower, proof.upper, strict=True), expected, strict=True)
        )
    found = cra.eigenvalues(system, modes, **options)
    moving = size > 0.0
    # two meshes agree to the tolerance; flutter pairs are found in either order
    distance = np.abs(found[moving, None] - proof.lower[moving]).min(axis=1) / size[moving]
    assert (distance <= np.maximum(system.accuracy, 1e-11)).all()
    return proof


@pytest.mark.parametrize("factor", [0.1, 0.9, 3.0])
def test_a_string_with_a_damper_at_its_end(factor):
    """tanh(s L / w) = -1 / ratio, ratio the damper over the impedance: beyond 1 one eigenvalue is real."""
    string = model(STRING, essential=[v.subs(x, 0)], virtual_work=[(-c * v.diff(t), v, "right")])
    with mp.workdps(DIGITS):
        impedance, wave = mp.sqrt(exact("rho") * exact("T")), mp.sqrt(exact("T") / exact("rho"))
        damper = float(factor * impedance)
        ratio = mp.mpf(damper) / impedance
        rate = -mp.atanh(min(ratio, 1 / ratio)) * wave / exact("L")
        turns = [n + (mp.mpf("0.5") if ratio < 1 else (1 if n >= 0 else 0)) for n in range(3)]
        expected = [mp.mpc(rate, mp.pi * turn * wave / exact("L")) for turn in turns]
        check(bound(string, c=damper), 3, expected)
        if ratio > 1:
            check(bound(string, c=damper), 4, [mp.mpc(rate, 0), *expected], oscillating=False)


def cantilever_with_damper(s, end):
    """The determinant of (sin, cos, sinh, cosh) with a stiffness, mass and damper of the end together."""
    k4 = (-exact("rho") * s**2 / exact("EI")) ** mp.mpf("0.25")
    z = k4 * exact("L")
    f = end / (exact("EI") * k4**3)
    moment = [mp.cos(z) + mp.cosh(z), mp.sin(z) + mp.sinh(z)]
    # shear EI v''' = end * v of v = (cosh - cos) and (sinh - sin)
    shear = [
        mp.sinh(z) - mp.sin(z) - f * (mp.cosh(z) - mp.cos(z)),
        mp.cosh(z) + mp.cos(z) - f * (mp.sinh(z) - mp.sin(z)),
    ]
    return moment[0] * shear[1] - moment[1] * shear[0]


def roots(function, guesses):
    return [
        mp.findroot(function, mp.mpmathify(complex(guess)), tol=mp.mpf(10) ** (-2 * DIGITS + 10)) for guess in guesses
    ]


@cache
def damped_cantilever():
    return model(BEAM, essential=CLAMPED, virtual_work=[(-c * v.diff(t), v, "right")])


@pytest.mark.parametrize("damper", [0.0, 0.4, 60.0])
def test_a_cantilever_with_a_damper_at_its_end(damper):
    system = bound(damped_cantilever(), c=damper)
    with mp.workdps(DIGITS):
        guesses = cra.eigenvalues(system, 4)
        expected = roots(lambda s: cantilever_with_damper(s, mp.mpf(damper) * s), guesses)
        check(system, 4, expected if damper else [mp.mpc(0, s.imag) for s in expected])


@cache
def natural(free=False):
    """Squares of the natural frequencies of a beam, clamped or free at its left end."""
    function = (lambda z: mp.cos(z) * mp.cosh(z) - 1) if free else (lambda z: mp.cos(z) * mp.cosh(z) + 1)
    with mp.workdps(DIGITS):
        first = [4.73, 7.853, 10.996] if free else [1.875, 4.694, 7.855, 10.996, 14.137]
        return [mp.findroot(function, z) ** 4 * exact("EI") / (exact("rho") * exact("L") ** 4) for z in first]


def quadratic(damping, stiffness):
    """The root of s^2 + damping s + stiffness with a positive imaginary part."""
    return (-damping + mp.sqrt(mp.mpc(damping**2 - 4 * stiffness))) / 2


def test_distributed_and_internal_damping_in_closed_form():
    drag = model(BEAM, essential=CLAMPED, virtual_work=[(-c * v.diff(t), v, "domain")])
    inner = model(BEAM, essential=CLAMPED, virtual_work=[(-tau * EI * v.diff(x, 2, t), v.diff(x, 2), "domain")])
    with mp.workdps(DIGITS):
        check(bound(drag), 4, [quadratic(exact("c") / exact("rho"), square) for square in natural()[:4]])
        check(bound(inner), 4, [quadratic(exact("tau") * square, square) for square in natural()[:4]])


def test_beyond_the_rate_of_internal_damping_nothing_is_claimed():
    inner = model(BEAM, essential=CLAMPED, virtual_work=[(-tau * EI * v.diff(x, 2, t), v.diff(x, 2), "domain")])
    with pytest.raises(ValueError, match=r"modes = 5: eigenvalues accumulate.*ask for fewer modes"):
        cra.certify_eigenvalues(bound(inner, tau=5e-3), 5)


def test_a_free_beam_in_a_fluid_has_a_double_real_eigenvalue():
    """Both rigid motions decay at the same rate, and rest at any place: the latter are exactly 0."""
    free = bound(model(BEAM, virtual_work=[(-c * v.diff(t), v, "domain")]))
    with mp.workdps(DIGITS):
        rate = exact("c") / exact("rho")
        bent = [quadratic(rate, square) for square in natural(free=True)[:2]]
        check(free, 2, bent)
        proof = check(free, 6, [mp.mpc(0), mp.mpc(0), mp.mpc(-rate), mp.mpc(-rate), *bent], oscillating=False)
    assert (proof.upper[:2] == 0.0).all() and (proof.upper[:4].imag == 0.0).all()


def test_two_planes_have_double_eigenvalues():
    both = BEAM + BEAM.subs(v, u).doit()
    work = [(-c * field.diff(t), field, "right") for field in (v, u)]
    held = [*CLAMPED, u.subs(x, 0), u.diff(x).subs(x, 0)]
    planes = bound(model(both, fields=[v, u], essential=held, virtual_work=work))
    one = cra.certify_eigenvalues(bound(damped_cantilever()), 2)
    proof = check(planes, 4, None)
    assert (np.abs(proof.lower - np.repeat(one.lower, 2)) <= 1e-15 * np.abs(proof.lower)).all()


def pipe(s, mass):
    """The determinant of a clamped pipe, from the four roots of its dispersion relation."""
    EI_, rho_, U_, L_ = exact("EI"), exact("rho"), exact("U"), exact("L")
    waves = mp.polyroots([EI_, 0, mass * U_**2, 2 * mass * U_ * s, (rho_ + mass) * s**2], maxsteps=200, extraprec=200)
    rows = [[1] * 4, waves, [w**2 * mp.exp(w * L_) for w in waves], [w**3 * mp.exp(w * L_) for w in waves]]
    spread = mp.fprod(waves[i] - waves[j] for i in range(4) for j in range(i))
    return mp.det(mp.matrix(rows)) / spread


@pytest.mark.parametrize("speed", [2.0, 20.0])
def test_a_pipe_that_conveys_a_fluid(speed, monkeypatch):
    """A damper of Coriolis forces and a follower force at the free end; the faster one flutters."""
    monkeypatch.setitem(VALUES, "U", speed)
    moving = BEAM + HALF * m * (v.diff(t) + U * v.diff(x)) ** 2
    made = model(moving, essential=CLAMPED, virtual_work=[(-m * U * (v.diff(t) + U * v.diff(x)), v, "right")])
    system = bound(made)
    with mp.workdps(DIGITS):
        guesses = cra.eigenvalues(system, 3)
        check(system, 3, roots(lambda s: pipe(s, exact("m")), guesses))
        proof = cra.certify(system, 3)
        expected = [root.imag / (2 * mp.pi) for root in roots(lambda s: pipe(s, exact("m")), guesses)]
        assert proof.complete
        assert all(low <= f <= high for low, f, high in zip(proof.lower, expected, proof.upper, strict=True))
    assert (guesses.real > 0).any() == (speed > 10.0)


def test_becks_column_beyond_flutter():
    """A pair of equal moduli, the growing motion first, also if only one of the two is asked for."""
    column = model(BEAM + HALF * P * v.diff(x) ** 2, essential=CLAMPED, virtual_work=[(-P * v.diff(x), v, "right")])
    system = bound(column)
    with mp.workdps(DIGITS):
        p, n = exact("P") / exact("EI"), exact("L")

        def leading(s):
            mu = -exact("rho") * s**2 / exact("EI")
            one, two = (mp.sqrt(mp.sqrt(p**2 / 4 + mu) + sign * p / 2) for sign in (1, -1))
            sides = one * two * mp.sin(one * n) * mp.sinh(two * n)
            return 2 * mu + p**2 + 2 * mu * mp.cos(one * n) * mp.cosh(two * n) + p * sides

        guesses = cra.eigenvalues(system, 3)
        order = np.lexsort((-guesses.real, guesses.imag.round(6)))
        expected = roots(leading, guesses[order])
        expected[2] = mp.mpc(0, expected[2].imag)  # no growth, exactly
        check(system, 3, expected)
        check(system, 1, expected[:1])
    assert cra.certify_eigenvalues(bound(column, P=5.0), 3).upper.real.tolist() == [0.0, 0.0, 0.0]


def test_a_moving_belt_with_a_damper_inside_two_spans():
    """A string of two densities; a mass with a damper where they meet, found from the transfer of each."""
    string = model(
        HALF * rho * (1 + 2 * sp.Heaviside(x - a)) * v.diff(t) ** 2 - HALF * T * v.diff(x) ** 2,
        essential=[v.subs(x, 0), v.subs(x, L)],
        inside=[(a, HALF * m * v.diff(t) ** 2)], virtual_work=[(-c * v.diff(t), v, a)],
    )  # fmt: skip
    system = bound(string)
    with mp.workdps(DIGITS):
        T_, first, second = exact("T"), exact("a"), exact("L") - exact("a")

        def meet(s):
            one, two = (s * mp.sqrt(n * exact("rho") / T_) for n in (1, 3))
            pull = T_ * (one * mp.coth(one * first) + two * mp.coth(two * second))
            return pull + exact("m") * s**2 + exact("c") * s

        check(system, 4, roots(meet, cra.eigenvalues(system, 4)))


def test_a_support_inside_and_a_damper():
    """The span beyond the support hangs on the first by its slope: two flexibilities of a beam."""
    system = bound(model(BEAM, essential=[*CLAMPED, v.subs(x, a)], virtual_work=[(-c * v.diff(t), v, "right")]))
    with mp.workdps(DIGITS):
        EI_, first, second = exact("EI"), exact("a"), exact("L") - exact("a")

        def condition(s):
            w = (-exact("rho") * s**2 / EI_) ** mp.mpf("0.25")
            z, y = w * first, w * second
            sin, cos, sinh, cosh = mp.sin, mp.cos, mp.sinh, mp.cosh
            # clamped, held at the support: moment over slope there
            held = EI_ * w * (mp.cosh(z) * sin(z) - sinh(z) * cos(z)) / (1 - cos(z) * cosh(z))
            # beyond v = A (sin - sinh) + B sinh + C (cosh - cos): slope B w, moment 2 C EI w^2 at the support
            d = exact("c") * s / (EI_ * w**3)
            moments = [-sin(y) - sinh(y), sinh(y), cosh(y) + cos(y)]
            shears = [
                -cos(y) - cosh(y) - d * (sin(y) - sinh(y)), cosh(y) - d * sinh(y),
                sinh(y) - sin(y) - d * (cosh(y) - cos(y)),
            ]  # fmt: skip
            joint = [0, held * w, -2 * EI_ * w**2]
            return mp.det(mp.matrix([moments, shears, joint]))

        check(system, 3, roots(condition, cra.eigenvalues(system, 3)))


def test_lumped_coordinates_are_roots_of_a_polynomial():
    p, q = sp.Function("p")(t), sp.Function("q")(t)
    made = model(
        0, fields=(), coordinates=[p, q], domain=(0, 1),
        left=m * p.diff(t) ** 2 / 2 + rho * q.diff(t) ** 2 / 2 - k * p**2 / 2 - T * (p - q) ** 2 / 2,
        virtual_work=[(-c * q.diff(t), q, None)],
    )  # fmt: skip
    with mp.workdps(DIGITS):
        m_, rho_, k_, T_, c_ = map(exact, ("m", "rho", "k", "T", "c"))
        # (m s^2 + k + T) (rho s^2 + c s + T) - T^2
        found = mp.polyroots(
            [m_ * rho_, m_ * c_, m_ * T_ + rho_ * (k_ + T_), c_ * (k_ + T_), k_ * T_], maxsteps=200, extraprec=200
        )
        check(bound(made), 2, sorted((s for s in found if s.imag > 0), key=abs))


def test_gyroscopic_motions_that_neither_grow_nor_decay_beside_rigid_ones():
    """A free shaft with discs: its rigid motions are left out, and real parts are exactly 0."""
    both = BEAM + BEAM.subs(v, u).doit()
    disc = m * U * v.diff(x) * u.diff(x, t)
    shaft = bound(model(both, fields=[v, u], left=disc, right=disc))
    proof = check(shaft, 3, None)
    assert (proof.lower.real == 0.0).all() and (proof.upper.real == 0.0).all()
    frequencies = cra.certify(shaft, 3)
    assert frequencies.complete and np.abs(frequencies.lower * 2 * np.pi / proof.lower.imag - 1).max() < 1e-15
    for number, s in enumerate(proof.lower.imag):  # zeros at 0 besides: two rigid motions in each plane, twice
        inside = cra.count_eigenvalues(shaft, [0.99 * s, 1.01 * s]) - cra.count_eigenvalues(
            shaft, 0.5 * proof.lower[0].imag
        )
        assert inside.tolist() == [2 * number, 2 * number + 2]


def test_conservative_eigenvalues_are_the_natural_frequencies():
    beam = bound(model(BEAM))
    proof, frequencies = cra.certify_eigenvalues(beam, 4), cra.certify(beam, 4)
    assert proof.complete and (proof.lower[:2] == 0.0).all() and (proof.upper[:2] == 0.0).all()
    np.testing.assert_allclose(proof.lower.imag, 2 * np.pi * frequencies.lower, rtol=1e-15)


def test_a_batch_is_proved_one_by_one():
    system = bound(damped_cantilever(), c=np.array([0.1, 0.4]))
    proof = cra.certify_eigenvalues(system, 2)
    assert proof.lower.shape == proof.upper.shape == (2, 2) and proof.complete.tolist() == [True, True]
    one = cra.certify_eigenvalues(bound(damped_cantilever()), 2)
    assert (proof.lower[1] == one.lower).all() and (proof.upper[1] == one.upper).all()


def test_other_parameters_lie_outside_their_enclosures():
    """What changes by a part in 1e13 is noticed."""
    one, other = (
        cra.certify_eigenvalues(bound(damped_cantilever(), EI=value), 3) for value in (2.0, 2.0 * (1 + 1e-13))
    )
    assert (one.upper.imag < other.lower.imag).all()


def test_what_varies_along_x_is_refused():
    varying = model(BEAM - HALF * T * x * v.diff(x) ** 2, essential=CLAMPED)
    with pytest.raises(ValueError, match=r"constant along x between places, not .*T"):
        cra.certify_eigenvalues(bound(varying))


def test_a_wrong_matrix_entry_is_noticed(monkeypatch):
    """Each entry of the first-order form, spoiled by a part in 1e9, moves the enclosures away from the solver."""
    system = bound(damped_cantilever())
    found, made = cra.eigenvalues(system, 2), BallProblem.spanned
    spoiled = 0
    for place in range(16):

        def wrong(self, *arguments, place=place):
            nonlocal spoiled
            whole = made(self, *arguments)
            matrix = whole.spans[0].system
            entries = list(matrix.entries)
            top, bottom = entries[place]
            changed = [value + value / 10**9 for value in top]
            spoiled += any(value != 0 for value in top)
            entries[place] = changed, bottom
            return replace(whole, spans=[whole.spans[0]._replace(system=replace(matrix, entries=entries))])

        monkeypatch.setattr(BallProblem, "spanned", wrong)
        before = spoiled
        proof = cra.certify_eigenvalues(system, 2)
        outside = np.abs(found - proof.lower) > 1e-11 * np.abs(found)
        assert outside.all() == (spoiled > before), place
    assert spoiled


def test_wrong_guesses_prove_nothing_wrong(monkeypatch):
    """With eigenvalues that are a tenth too large, one twice and one missing, the same is proved."""
    system = bound(damped_cantilever())
    right = cra.certify_eigenvalues(system, 3)

    def guess(given, modes, *, oscillating=True):
        found = cra.eigenvalues(given, modes + 1, oscillating=oscillating)
        return 1.1 * np.concatenate([found[:1], found[:1], found[2:]])[:modes]

    monkeypatch.setattr("cra_sym.analysis.certification.eigenvalues", guess)
    proof = cra.certify_eigenvalues(system, 3)
    assert proof.complete and (proof.lower == right.lower).all() and (proof.upper == right.upper).all()


def test_two_proofs_of_a_conservative_system_agree():
    """By the signature of the dynamic stiffness, and by the zeros of the determinant, in spans with a mass inside."""
    beam = model(
        HALF * rho * v.diff(t) ** 2 - HALF * EI * (1 + 2 * sp.Heaviside(x - a)) * v.diff(x, 2) ** 2,
        essential=[v.subs(x, 0)], inside=[(HALF * L, HALF * m * v.diff(t) ** 2)],
    )  # fmt: skip
    system = bound(beam)
    one = cra.certify(system, 4)
    values = {name: VALUES[name] for name in system.numerics("names")}
    problem = _characteristic(flint, bound_problem(flint, system.numerics, {}, values, damped=True))
    assert problem.rigid == problem.at_zero == 1 and problem.squared  # it turns about its support
    guesses = 2j * np.pi * one.lower
    other = first_eigenvalues(problem, 3, True, float(np.abs(guesses).max()), guesses)
    assert one.complete and one.upper[0] == 0.0
    with precision(flint, 128):
        for low, high, found in zip(one.lower[1:], one.upper[1:], other, strict=True):
            frequency = found.imag / (2 * flint.arb.pi())
            assert flint.arb(float(low)) <= frequency <= flint.arb(float(high)) and found.real == 0


@pytest.mark.parametrize("form", ["critically damped", "follower"])
def test_zeros_that_coincide_at_a_fraction_are_real(form):
    """m q'' + c q' + k q with c^2 = 4 m k; a free column with follower forces at both ends, in a fluid."""
    if form == "critically damped":
        q = sp.Function("q")(t)
        single = model(
            0, fields=(), coordinates=[q], domain=(0, 1), left=m * q.diff(t) ** 2 / 2 - k * q**2 / 2,
            virtual_work=[(-c * q.diff(t), q, None)],
        )  # fmt: skip
        for change in (0.0, 2.0**-52):  # beyond it there are two, the slower one first
            proof = cra.certify_eigenvalues(single.at({m: 0.75, k: 3.0, c: 3.0 * (1 + change)}), 1, oscillating=False)
            assert proof.complete and abs(proof.lower[0] + 2.0) < 1e-7
            assert (proof.lower[0].real <= -2.0 <= proof.upper[0].real) == (change == 0.0)
        return
    ends = [(-P * v.diff(x), v, "right"), (P * v.diff(x), v, "left"), (-c * v.diff(t), v, "domain")]
    column = bound(model(BEAM + HALF * P * v.diff(x) ** 2, virtual_work=ends), P=5.0)
    proof = check(column, 2, None)
    rate = VALUES["c"] / VALUES["rho"]
    every = cra.certify_eigenvalues(column, 5, oscillating=False)
    assert every.complete and (every.lower[:2] == 0.0).all() and (every.lower[4:] == proof.lower[:1]).all()
    np.testing.assert_allclose(every.lower[2:4], -rate, rtol=1e-15)


def test_the_bound_of_the_determinant_holds_on_circles():
    """With spans, a mass, a damper and a support inside, a coordinate, and coefficients with the parameter below."""
    q = sp.Function("q")(t)
    made = model(
        HALF * rho * v.diff(t) ** 2 - HALF * EI * (1 + sp.Heaviside(x - a)) * v.diff(x, 2) ** 2,
        essential=[*CLAMPED, v.subs(x, L / 2)], coordinates=[q],
        inside=[(a, HALF * m * v.diff(t) ** 2)], right=-HALF * k * (v - q) ** 2 + HALF * m * q.diff(t) ** 2,
        virtual_work=[(-c * v.diff(t), v, a), (-tau * EI * v.diff(x, 2, t), v.diff(x, 2), "domain")],
    )  # fmt: skip
    system = bound(made)
    values = {name: VALUES[name] for name in system.numerics("names")}
    determinant = _characteristic(flint, bound_problem(flint, system.numerics, {}, values, damped=True)).determinant
    with precision(flint, 128):
        for radius in (1.0, 30.0, 700.0):
            largest = determinant.bound(flint.arb(radius))
            sizes = [abs(determinant.value(radius * flint.acb(share).exp_pi_i())) for share in np.linspace(0.0, 1.0, 9)]
            assert all(size < largest for size in sizes)
            assert largest < max(size.upper() for size in sizes) * flint.arb(10) ** 20  # and is of use
        assert determinant.bound(flint.arb(1000.0)) is None  # 1 over the time of retardation
