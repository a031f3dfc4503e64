"""Each model from its Lagrangian to frequencies, against classical determinants written without the package."""

from __future__ import annotations

from itertools import combinations

import numpy as np
import pytest
import sympy as sp
from mpmath import mp, mpc, mpf

import cra_sym as cra

x, t = sp.symbols("x t")
L, EI, rhoA, m_e, J_e, e, k_t, k_r, N, k_f = sp.symbols("L EI rhoA m_e J_e e k_t k_r N k_f")
v = sp.Function("v")(x, t)
HALF = sp.Rational(1, 2)
BEAM = HALF * rhoA * v.diff(t) ** 2 - HALF * EI * v.diff(x, 2) ** 2
JOINT = -HALF * k_t * v**2 - HALF * k_r * v.diff(x) ** 2
TIP = HALF * m_e * v.diff(t) ** 2


def model(density=BEAM, left=JOINT, right=TIP, fields=(v,), **options):
    return cra.Model(density, fields=fields, x=x, domain=(0, L), t=t, left=left, right=right, **options)


# independent references ---------------------------------------------------------------------------------------------


def determinant(exponents, left, right, length):
    """Determinant of the end conditions on a sum of ``exp(r x)``; a condition takes ``k -> D^k`` at its end.

    Over the product of the differences of the exponents it is real and regular where exponents meet.
    """
    matrix = mp.matrix(len(exponents))
    for column, r in enumerate(exponents):
        for row, condition in enumerate((*left, *right)):
            at = mpf(0) if row < len(left) else length
            matrix[row, column] = condition(lambda k, r=r, at=at: r**k * mp.exp(r * at))
    return mp.det(matrix) / mp.fprod(b - a for a, b in combinations(exponents, 2))


def beam_exponents(bending, mass, omega, tension=0, foundation=0):
    """Exponents of EI v'''' - N v'' + (k_f - rhoA omega^2) v = 0."""
    centre = mpf(tension) / (2 * bending)
    rest = mp.sqrt(mpc(centre**2 - (foundation - mass * omega**2) / mpf(bending)))
    return [sign * mp.sqrt(mpc(square)) for square in (centre + rest, centre - rest) for sign in (1, -1)]


def distance(function, omega):
    """Relative distance to the nearest root, by one Newton step."""
    step = omega * mpf(10) ** -12
    return abs(function(omega) * 2 * step / (function(omega + step) - function(omega - step))) / omega


def assert_roots(function, frequencies, rtol=1e-11):
    """Each frequency (Hz) is within ``rtol`` of a root of the reference, and between two of them lies no other."""
    frequencies = np.asarray(frequencies)
    assert (np.diff(frequencies) > 0).all() and frequencies[0] > 0
    with mp.workdps(40):
        omegas = [2 * mp.pi * mpf(float(f)) for f in frequencies]
        assert all(distance(function, omega) < rtol for omega in omegas)
        grid = [o * (1 + d) for o in omegas for d in (-(mpf(10) ** -6), mpf(10) ** -6)]
        fine = [grid[0] * j / 12 for j in range(1, 12)]
        fine += [a + (b - a) * j / 12 for a, b in zip(grid[1::2], grid[2::2], strict=False) for j in range(13)]
        values = [function(omega) for omega in fine]
        assert all(abs(mp.im(value)) <= mpf(10) ** -20 * abs(value) for value in values)
        signs = [mp.sign(mp.re(value)) for value in values]
    changes = np.count_nonzero(np.diff(np.array(signs, dtype=int)))
    assert changes <= len(omegas) - 1  # only across the roots themselves


# strings and rods -----------------------------------------------------------------------------------------------------


def second_order(stiffness_name="T", density_name="rho"):
    stiffness, density = sp.symbols(f"{stiffness_name} {density_name}")
    u = sp.Function("u")(x, t)
    return cra.Model(
        HALF * density * u.diff(t) ** 2 - HALF * stiffness * u.diff(x) ** 2,
        fields=[u],
        x=x,
        domain=(0, L),
        t=t,
        left=-HALF * k_t * u**2,
        right=HALF * m_e * u.diff(t) ** 2,
    )


@pytest.mark.parametrize(("spring", "mass"), [(3.0, 0.7), (0.0, 2.0), (1e-6, 0.1), (1e9, 30.0)])
def test_string_with_end_mass_and_spring(spring, mass):
    values = {"T": 5.0, "rho": 0.3, "L": 1.4, "k_t": spring, "m_e": mass}
    found = second_order().natural_frequencies(values, modes=8)
    if spring == 0.0:
        assert found[0] == 0.0
        found = found[1:]

    def reference(omega):
        b = omega * mp.sqrt(mpf(0.3) / 5)
        slope, c, s = 5 * b, mp.cos(b * mpf(1.4)), mp.sin(b * mpf(1.4))
        return spring * (slope * c - mass * omega**2 * s) - slope * (slope * s + mass * omega**2 * c)

    assert_roots(reference, found)


def test_rod_with_end_mass():
    values = {"EA": 7.0, "rho": 2.0, "L": 0.8, "k_t": np.inf, "m_e": [0.0, 0.5]}
    bare, loaded = second_order("EA").natural_frequencies(values, modes=20)
    speed = np.sqrt(7.0 / 2.0)
    np.testing.assert_allclose(bare, (2 * np.arange(20) + 1) * speed / 4 / 0.8, rtol=1e-12)
    assert_roots(lambda o: mp.cos(o * 0.8 / speed) * 7 / speed - 0.5 * o * mp.sin(o * 0.8 / speed), loaded)


# beams ---------------------------------------------------------------------------------------------------------------

VALUES = {EI: 4.6, rhoA: 0.24, L: 1.1, m_e: 0.05, k_t: 900.0, k_r: 40.0}


def joint_rows(bending, spring_t, spring_r, tension=0):
    return [
        lambda d: bending * d(3) - tension * d(1) + spring_t * d(0),
        lambda d: bending * d(2) - spring_r * d(1),
    ]


def tip_rows(bending, omega, mass, inertia=0, offset=0, tension=0):
    square = omega**2
    return [
        lambda d: bending * d(3) - tension * d(1) + mass * square * (d(0) + offset * d(1)),
        lambda d: bending * d(2) - square * (inertia * d(1) + mass * offset * (d(0) + offset * d(1))),
    ]


@pytest.mark.parametrize("offset", [0.0, 0.15, -0.1])
@pytest.mark.parametrize("inertia", [0.0, 0.003])
def test_tip_mass_with_rotary_inertia_and_offset_centre(offset, inertia):
    tip = HALF * m_e * (v.diff(t) + e * v.diff(x, t)) ** 2 + HALF * J_e * v.diff(x, t) ** 2
    found = model(right=tip).natural_frequencies({**VALUES, e: offset, J_e: inertia}, modes=6)

    def reference(omega):
        rows = joint_rows(4.6, 900, 40), tip_rows(4.6, omega, mpf(0.05), mpf(inertia), mpf(offset))
        return determinant(beam_exponents(mpf(4.6), mpf(0.24), omega), *rows, mpf(1.1))

    assert_roots(reference, found)


@pytest.mark.parametrize("tension", [500.0, 8.0, -7.0])
def test_constant_axial_force(tension):
    found = model(BEAM - HALF * N * v.diff(x) ** 2).natural_frequencies({**VALUES, N: tension}, modes=6)

    def reference(omega):
        rows = joint_rows(4.6, 900, 40, mpf(tension)), tip_rows(4.6, omega, mpf(0.05), tension=mpf(tension))
        return determinant(beam_exponents(mpf(4.6), mpf(0.24), omega, mpf(tension)), *rows, mpf(1.1))

    assert_roots(reference, found)


def test_compression_up_to_buckling():
    """A cantilever buckles at pi^2 EI / 4 L^2: the first frequency goes to zero there, and beyond it is refused."""
    column = model(
        BEAM - HALF * N * v.diff(x) ** 2, left=None, right=None, essential=[v.subs(x, 0), v.diff(x).subs(x, 0)]
    )
    load = np.pi**2 / 4
    values = {EI: 1.0, rhoA: 1.0, L: 1.0}
    shares = np.array([0.0, 0.9, 0.99, 0.999999])
    first = column.natural_frequencies({**values, N: -load * shares}, modes=1)[:, 0]
    assert (np.diff(first) < 0).all()
    # omega^2 falls linearly with the load, but for a share of the last percent
    np.testing.assert_allclose((first[3] / first[2]) ** 2, 1e-4, rtol=2e-3)
    with pytest.raises(ValueError, match=r"buckled: 1 unstable mode \(omega\^2 < 0\), in 2 of 3 parameter sets"):
        column.natural_frequencies({**values, N: -load * np.array([0.5, 1.000001, 2.0])})
    with pytest.raises(ValueError, match="buckled: 2 unstable modes"):
        column.natural_frequencies({**values, N: -9.1 * load})


@pytest.mark.parametrize("foundation", [3e4, 50.0])
def test_elastic_foundation(foundation):
    found = model(BEAM - HALF * k_f * v**2).natural_frequencies({**VALUES, k_f: foundation}, modes=6)

    def reference(omega):
        exponents = beam_exponents(mpf(4.6), mpf(0.24), omega, foundation=mpf(foundation))
        return determinant(exponents, joint_rows(4.6, 900, 40), tip_rows(4.6, omega, mpf(0.05)), mpf(1.1))

    assert_roots(reference, found)


def test_springs_at_both_ends():
    k_2, k_3 = sp.symbols("k_2 k_3")
    found = model(right=-HALF * k_2 * v**2 - HALF * k_3 * v.diff(x) ** 2).natural_frequencies(
        {k: value for k, value in VALUES.items() if k != m_e} | {k_2: 77.0, k_3: 3.0}, modes=6
    )

    def reference(omega):
        right = [lambda d: mpf(4.6) * d(3) - 77 * d(0), lambda d: mpf(4.6) * d(2) + 3 * d(1)]
        return determinant(beam_exponents(mpf(4.6), mpf(0.24), omega), joint_rows(mpf(4.6), 900, 40), right, mpf(1.1))

    assert_roots(reference, found)


# Timoshenko ----------------------------------------------------------------------------------------------------------

theta = sp.Function("theta")(x, t)
GA, rhoI = sp.symbols("GA rhoI")
TIMOSHENKO = (
    HALF * rhoA * v.diff(t) ** 2
    + HALF * rhoI * theta.diff(t) ** 2
    - HALF * EI * theta.diff(x) ** 2
    - HALF * GA * (v.diff(x) - theta) ** 2
)


def timoshenko(**options):
    return model(TIMOSHENKO, left=-HALF * k_t * v**2 - HALF * k_r * theta**2, fields=(v, theta), **options)


@pytest.mark.parametrize("slenderness", [3.0, 10.0])
def test_timoshenko_arm_with_joint_and_tip_mass(slenderness):
    inertia = 0.24 * 1.1**2 / slenderness**2
    shear = 4.6 / (1.1**2 / slenderness**2) / 3.2
    found = timoshenko().natural_frequencies({**VALUES, GA: shear, rhoI: inertia}, modes=12)

    def reference(omega):
        """V = exp(r x), Theta = c(r) exp(r x), with GA (r^2 V - r Theta) + rhoA omega^2 V = 0."""
        bending, stiff, rotary, mass = mpf(4.6), mpf(shear), mpf(inertia), mpf(0.24)
        middle = mass * omega**2 / stiff + rotary * omega**2 / bending
        last = mass * omega**2 * (rotary * omega**2 - stiff) / (bending * stiff)
        squares = [(-middle + sign * mp.sqrt(middle**2 - 4 * last)) / 2 for sign in (1, -1)]
        matrix = mp.matrix(4)
        for column, r in enumerate(sign * mp.sqrt(mpc(square)) for square in squares for sign in (1, -1)):
            tilt = (r**2 + mass * omega**2 / stiff) / r
            far = mp.exp(r * mpf(1.1))
            matrix[0, column] = stiff * (r - tilt) - 900
            matrix[1, column] = bending * r * tilt - 40 * tilt
            matrix[2, column] = (stiff * (r - tilt) - mpf(0.05) * omega**2) * far
            matrix[3, column] = bending * r * tilt * far
        return mp.det(matrix)

    with mp.workdps(40):
        assert all(distance(reference, 2 * mp.pi * mpf(float(frequency))) < 1e-11 for frequency in found)
    cut_off = np.sqrt(shear / inertia) / 2 / np.pi
    assert (found > cut_off).sum() == (10 if slenderness == 3.0 else 8)


@pytest.mark.parametrize(
    ("change", "modes"),
    [
        ({m_e: 1e3, k_t: 1e-8, k_r: 3e-9}, 1),
        ({m_e: 1e6, k_t: 1e-8, k_r: np.inf}, 2),
        ({m_e: 9.3e3, rhoA: 5e-4, EI: 1.3e-3, k_t: np.inf, k_r: 7e-7}, 3),
    ],
    ids=["two soft springs, one mode", "sliding", "light beam"],
)
def test_heavy_tips_on_soft_joints_keep_their_digits(change, modes):
    """A tip ten million times the beam: the forces in the shape have the digits that the stiffness has lost."""
    values = {**VALUES, **change}
    bending, mass = mpf(float(values[EI])), mpf(float(values[rhoA]))
    shear, inertia = bending * 100, mass / 10**4
    found = timoshenko().natural_frequencies({**values, GA: float(shear), rhoI: float(inertia)}, modes=modes)

    def reference(omega):
        middle = mass * omega**2 / shear + inertia * omega**2 / bending
        last = mass * omega**2 * (inertia * omega**2 - shear) / (bending * shear)
        squares = [(-middle + sign * mp.sqrt(middle**2 - 4 * last)) / 2 for sign in (1, -1)]
        matrix = mp.matrix(4)
        for column, r in enumerate(sign * mp.sqrt(mpc(square)) for square in squares for sign in (1, -1)):
            tilt, far = (r**2 + mass * omega**2 / shear) / r, mp.exp(r * mpf(1.1))
            held = [1, tilt] if values[k_t] == np.inf else [shear * (r - tilt) - mpf(float(values[k_t])), tilt]
            if values[k_r] != np.inf:
                held[1] = bending * r * tilt - mpf(float(values[k_r])) * tilt
            free = [shear * (r - tilt) - mpf(float(values[m_e])) * omega**2, bending * r * tilt]
            matrix[:, column] = mp.matrix([*held, *(far * entry for entry in free)])
        return mp.det(matrix)

    with mp.workdps(60):
        assert all(distance(reference, 2 * mp.pi * mpf(float(frequency))) < 1e-11 for frequency in found)


def test_timoshenko_becomes_euler_bernoulli():
    errors = []
    for slenderness in (1e2, 1e3, 1e4):
        values = {**VALUES, GA: 4.6 * slenderness**2, rhoI: 0.24 / slenderness**2}
        thick = timoshenko().natural_frequencies(values)
        errors.append(np.abs(thick / model().natural_frequencies(VALUES) - 1))
    np.testing.assert_allclose(errors[0] / errors[1], 100.0, rtol=0.05)
    assert (errors[2] < 1e-6).all()


# back to the arm of the paper -----------------------------------------------------------------------------------------


def arm_values(arm):
    return {EI: arm.EI, rhoA: arm.rhoA, L: arm.L, m_e: arm.m_e, k_t: arm.k_t, k_r: arm.k_r}


def test_the_arm_is_an_instance():
    """The same numbers from the generic solver and from the specialised one, at any stiffness."""
    k = np.array([0.0, 1e-3, 10.0, 1e6, np.inf])
    arm = cra.Arm.nominal().replace(k_t=k[:, None], k_r=k[None, :])
    generic = model().natural_frequencies(arm_values(arm), modes=5)
    special = cra.natural_frequencies(arm, modes=5)
    np.testing.assert_array_equal(generic == 0.0, special == 0.0)
    np.testing.assert_allclose(generic, special, rtol=1e-11)


def test_shapes_of_the_arm():
    arm = cra.Arm.nominal().replace(k_t=1e3, k_r=20.0)
    station = np.linspace(0.0, arm.L, 7)
    for derivative in range(4):
        np.testing.assert_allclose(
            model().mode_shapes(arm_values(arm), station, modes=4, derivative=derivative),
            cra.mode_shapes(arm, station, modes=4, derivative=derivative),
            rtol=1e-8,
            atol=1e-9 * 100**derivative,
        )


def test_free_base_as_a_coordinate():
    """A base of mass m_b that may move: w + v with a joint; by hand, the joint and the base are springs in series."""
    m_b, w = sp.symbols("m_b"), sp.Function("w")(t)
    moving = BEAM.subs(v.diff(t), v.diff(t) + w.diff(t))
    relative = model(
        moving,
        left=JOINT + HALF * m_b * w.diff(t) ** 2,
        right=TIP.subs(v.diff(t), v.diff(t) + w.diff(t)),
        coordinates=[w],
    )
    values = {**VALUES, m_b: 0.4}
    found = relative.natural_frequencies(values, modes=6)
    assert found[0] == 0.0

    def reference(omega):
        """At the root: shear = k_t v(0), and m_b w'' = k_t v(0) moves the base."""
        square = omega**2
        give = 900 * 0.4 * square / (0.4 * square - 900)  # stiffness of spring and mass in series
        return determinant(
            beam_exponents(mpf(4.6), mpf(0.24), omega),
            joint_rows(mpf(4.6), give, 40),
            tip_rows(mpf(4.6), omega, mpf(0.05)),
            mpf(1.1),
        ) * (0.4 * square - 900)

    assert_roots(reference, found[1:])


@pytest.mark.parametrize(
    ("density", "extra"),
    [(BEAM - HALF * N * v.diff(x) ** 2, {N: 1e-9}), (BEAM - HALF * k_f * v**2, {k_f: 1e-9})],
    ids=["tension", "foundation"],
)
def test_limits_back_to_the_arm(density, extra):
    np.testing.assert_allclose(
        model(density).natural_frequencies({**VALUES, **extra}), model().natural_frequencies(VALUES), rtol=1e-8
    )


# coefficients that vary along x --------------------------------------------------------------------------------------


def test_tapered_rod():
    """Section (1 + a x)^2: u = sin(k x) / (1 + a x), free at the right end."""
    EA, a = sp.symbols("EA a")
    u = sp.Function("u")(x, t)
    rod = model(
        HALF * (1 + a * x) ** 2 * (rhoA * u.diff(t) ** 2 - EA * u.diff(x) ** 2),
        left=None,
        right=None,
        fields=[u],
        essential=[u.subs(x, 0)],
    )
    found = rod.natural_frequencies({EA: 1.0, rhoA: 1.0, L: 1.0, a: [0.7, -0.6]}, modes=10)
    for row, slope in zip(found, (mpf(0.7), mpf(-0.6)), strict=True):
        assert_roots(lambda k, slope=slope: k * (1 + slope) * mp.cos(k) - slope * mp.sin(k), row, rtol=1e-9)


def test_hanging_string_with_a_tip_mass():
    """Tension from the weight below: y = a J0(z) + b Y0(z) with z = 2 omega sqrt((L - x + m_e / rhoA) / g)."""
    g = sp.symbols("g")
    tension = g * (rhoA * (L - x) + m_e)
    chain = model(HALF * rhoA * v.diff(t) ** 2 - HALF * tension * v.diff(x) ** 2, left=None, essential=[v.subs(x, 0)])
    found = chain.natural_frequencies({rhoA: 0.3, L: 2.0, m_e: 0.1, g: 9.81}, modes=5)

    def reference(omega):
        stretch = mpf(0.1) / mpf(0.3)
        top, tip = (2 * omega * mp.sqrt((length + stretch) / mpf(9.81)) for length in (2, 0))
        # g (m_e) y' = m_e omega^2 y at the tip, with dz/dx = -2 omega^2 / (g z)
        free = [2 * f(1, tip) / tip - f(0, tip) for f in (mp.besselj, mp.bessely)]
        return free[0] * mp.bessely(0, top) - free[1] * mp.besselj(0, top)

    assert_roots(reference, found, rtol=1e-10)


def test_an_upright_arm_buckles_under_its_own_weight():
    """Greenhill 1881: q L^3 / EI = 7.8373..., a zero of the Bessel function J_(-1/3)."""
    g = sp.symbols("g")
    column = model(
        BEAM - HALF * rhoA * g * (L - x) * v.diff(x) ** 2,
        left=None,
        right=None,
        essential=[v.subs(x, 0), v.diff(x).subs(x, 0)],
    )
    critical = 9 / 4 * float(mp.findroot(lambda z: mp.besselj(-mpf(1) / 3, z), 1.87)) ** 2
    values = {EI: 1.0, rhoA: 1.0, L: 1.0}
    assert column.natural_frequencies({**values, g: -critical * (1 - 1e-7)}, modes=1)[0] < 1e-3
    with pytest.raises(ValueError, match="buckled: 1 unstable mode"):
        column.natural_frequencies({**values, g: -critical * (1 + 1e-7)})
