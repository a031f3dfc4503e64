"""The generic dynamic stiffness against closed forms, high precision and independent determinants."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from mpmath import mp, mpf
from scipy.integrate import simpson

from cra_sym.solvers.eigenvalues import _polish, lowest, refine
from cra_sym.solvers.rayleigh import quotients, stationary_values
from cra_sym.solvers.shapes import mode_states
from cra_sym.solvers.stiffness import GOLDEN, DynamicStiffness, _inverse, exponential

PINNED = np.eye(4)[:, [1, 3]]
CLAMPED_FREE = np.eye(4)[:, 2:]
FREE = None


def constant(a0, a1, *, length=1.0, displacements, coordinates=0, free=None, ends0=None, ends1=None):
    """A(z) = a0 + z a1 and B(z) = ends0 + z ends1; arrays may have a leading row axis."""
    size = 2 * displacements + coordinates
    a0, a1 = np.asarray(a0, float), np.asarray(a1, float)
    ends0 = np.zeros((size, size)) if ends0 is None else ends0
    ends1 = np.zeros((size, size)) if ends1 is None else ends1

    def affine(base, slope):
        def coefficients(z, rows):
            b, s = (m[rows] if m.ndim == 3 else np.broadcast_to(m, (len(z), *m.shape)) for m in (base, slope))
            return b + z[:, None, None] * s, s

        return coefficients

    def section(z, rows, share):
        a, da = affine(a0, a1)(z, rows)
        return a[:, None], da[:, None]

    rows = max((m.shape[0] for m in (ends0, ends1, a0) if m.ndim == 3), default=1)
    lengths = np.broadcast_to(float(length), (rows,))
    return DynamicStiffness(section, affine(ends0, ends1), lengths, displacements, coordinates, free)


def beam(bending=1.0, mass=1.0, tension=0.0, foundation=0.0, **options):
    """q = (v, v'), P = (N v' - EI v''', EI v'')."""
    a0, a1 = np.zeros((4, 4)), np.zeros((4, 4))
    a0[0, 1], a0[1, 3], a0[2, 0], a0[3, 1], a0[3, 2] = 1.0, 1.0 / bending, foundation, tension, -1.0
    a1[2, 0] = -mass
    return constant(a0, a1, displacements=2, **options)


def timoshenko(bending, shear, mass, inertia, **options):
    a0, a1 = np.zeros((4, 4)), np.zeros((4, 4))
    a0[0, 1], a0[0, 2], a0[1, 3], a0[3, 2] = 1.0, 1.0 / shear, 1.0 / bending, -1.0
    a1[2, 0], a1[3, 1] = -mass, -inertia
    return constant(a0, a1, displacements=2, **options)


def joint_arm(k_t, k_r, tip):
    k_t, k_r, tip = (np.atleast_1d(np.asarray(a, float)) for a in np.broadcast_arrays(k_t, k_r, tip))
    ends0, ends1 = np.zeros((2, len(k_t), 4, 4))
    ends0[:, 0, 0], ends0[:, 1, 1], ends1[:, 2, 2] = k_t, k_r, -tip
    return beam(ends0=ends0, ends1=ends1)


def test_clamped_free_beam_300_modes():
    lam = lowest(beam(free=CLAMPED_FREE), 300)[0] ** 0.25
    with mp.workdps(40):
        exact = [
            mp.findroot(lambda l: mp.cos(l) + mp.sech(l), (i + mpf(1) / 2) * mp.pi if i else 1.875) for i in range(300)
        ]
    np.testing.assert_allclose(lam, np.array(exact, dtype=float), rtol=2e-13)


@pytest.mark.parametrize("free", [FREE, np.zeros((4, 0))], ids=["free-free", "clamped-clamped"])
def test_equal_elastic_spectra_and_rigid_zeros(free):
    lam = lowest(beam(free=free), 30)[0] ** 0.25
    rigid = 2 if free is None else 0
    assert (lam[:rigid] == 0.0).all()
    with mp.workdps(40):
        exact = [mp.findroot(lambda l: mp.cos(l) - mp.sech(l), (i + mpf(3) / 2) * mp.pi) for i in range(30 - rigid)]
    np.testing.assert_allclose(lam[rigid:], np.array(exact, dtype=float), rtol=1e-12)


def test_count_equals_closed_form_everywhere():
    lam = np.random.default_rng(0).uniform(0.5, 400.0, 500)
    count = beam(free=PINNED).evaluate(lam**4, np.zeros(500, dtype=int)).count
    np.testing.assert_array_equal(count, np.floor(lam / np.pi))


def test_a_root_costs_few_evaluations(monkeypatch):
    """Newton's steps on the right eigenvalue of K, counted instead of timed; without them it is some fifty."""
    evaluate, asked = DynamicStiffness.evaluate, []

    def counted(self, z, rows, **options):
        asked.append(len(z))
        return evaluate(self, z, rows, **options)

    monkeypatch.setattr(DynamicStiffness, "evaluate", counted)
    for problem, modes in (
        (beam(free=CLAMPED_FREE), 20),
        (joint_arm([1.0, 1e3, 1e6], [1e-2, 1.0, 1e4], [0.0, 0.1, 3.0]), 8),
    ):
        asked.clear()
        assert lowest(problem, modes).all()
        assert sum(asked) < 10 * modes * len(problem.length)


def test_any_basis_of_the_allowed_motions_and_any_number_of_rows():
    turned = CLAMPED_FREE @ np.array([[-1.0, 0.4], [-0.2, -1.0]])
    np.testing.assert_allclose(lowest(beam(free=turned), 3), lowest(beam(free=CLAMPED_FREE), 3), rtol=1e-12)
    springs = 10.0 ** np.linspace(0.0, 4.0, 8)
    for row in (0, 7):
        single = lowest(joint_arm(springs[row], 1.0, 0.1), 8)[0]
        np.testing.assert_allclose(lowest(joint_arm(springs, 1.0, 0.1), 8)[row], single, rtol=1e-12)


def test_the_entire_function_is_the_product_over_all_roots():
    """F'/F of closed forms: a string, a beam, a varying rod; and of two descriptions of one structure."""
    z = np.array([0.7, 31.0, 700.0, 2.1e4])
    row, b = np.zeros(4, dtype=int), z**0.25
    cosine = constant([[0.0, 1.0], [0.0, 0.0]], [[0.0, 0.0], [-1.0, 0.0]], displacements=1, free=np.eye(2)[:, 1:])
    k = np.sqrt(z - GROWTH**2 + 0j).real
    for problem, expected, number in (
        (cosine, -np.tan(np.sqrt(z)) / (2.0 * np.sqrt(z)), slice(None)),
        (beam(free=PINNED), (1.0 / np.tan(b) + 1.0 / np.tanh(b) - 2.0 / b) / (4.0 * b**3), slice(None)),
        (flared_rod(np.zeros((2, 0))), (1.0 / np.tan(k) - 1.0 / np.where(k > 0, k, 1.0)) / (2.0 * k), slice(1, 3)),
    ):
        found = problem.evaluate(z[number], row[number]).logarithmic_derivative
        np.testing.assert_allclose(found, expected[number], rtol=1e-8)
    slopes = [problem.evaluate(z, row).logarithmic_derivative for problem in with_a_base(0.7)]
    np.testing.assert_allclose(slopes[0], slopes[1], rtol=1e-9)


def test_a_pole_that_is_hit_to_the_last_bit():
    """Singular members are inverted from just above; those beside them keep their digits, however small."""
    singular, fine = np.array([[1.0, 1.0], [1.0, 1.0]]), 1e-20 * np.array([[2.0, 1.0], [1.0, 1.0]])
    inverse = _inverse(np.array([[[singular, fine], [fine, singular], [fine, 0.0 * fine]]]))[0]
    for beside in (inverse[0, 1], inverse[1, 0], inverse[2, 0]):
        np.testing.assert_allclose(beside * 1e-20, [[1.0, -1.0], [-1.0, 2.0]], rtol=1e-13)
    load = np.array([1.0, 1.0])
    for hit in (inverse[0, 0], inverse[1, 1]):
        np.testing.assert_allclose(singular @ (hit @ load), load, rtol=1e-14)
    assert (np.linalg.eigvalsh(inverse[2, 1]) > 1e13).all()


def test_how_often_a_part_is_halved_depends_on_no_unit_of_length():
    z, row = np.append(0.0, 10.0 ** np.arange(7)), np.zeros(8, dtype=int)
    levels = beam().levels(z, row)
    for unit in (1e-3, 1e3):
        np.testing.assert_array_equal(beam(length=unit).levels(z / unit**4, row), levels)
    assert levels[0] == 0 < levels[2]


def test_a_matrix_that_is_singular_to_the_last_bit_is_moved_by_rounding_errors():
    for matrix in (np.ones((2, 2)), np.zeros((9, 9)), 1e-20 * np.ones((3, 3)), 1e20 * np.ones((3, 3))):
        for stack in (np.broadcast_to(matrix, (3, *matrix.shape)), np.broadcast_to(matrix, (2, 5, *matrix.shape))):
            inverse = _inverse(stack)
            assert np.isfinite(inverse).all()
            np.testing.assert_allclose(np.linalg.inv(inverse), stack, atol=0.3 * (matrix.max() or 1.0))


@pytest.mark.parametrize("thickness", [0.3, 0.05, 0.005])
def test_timoshenko_across_the_cut_off(thickness):
    """Pinned ends: both branches are closed form, and one mode is pure shear at the cut-off frequency itself."""
    inertia = thickness**2 / 12
    shear = 1.0 / inertia / 3.1
    n = np.arange(1, 120) * np.pi
    half = 0.5 * (shear * n**2 + (n**2 + shear) / inertia)
    product = shear * n**4 / inertia
    upper = half + np.sqrt(half**2 - product)
    exact = np.sort(np.r_[shear / inertia, upper, product / upper])[:80]
    z = lowest(timoshenko(1.0, shear, 1.0, inertia, free=PINNED), 80)[0]
    np.testing.assert_allclose(z, exact, rtol=1e-12)


@pytest.mark.parametrize(("bending", "tension", "rtol"), [(1e-6, 1.0, 1e-12), (1e-3, 1.0, 1e-13), (1.0, -9.8, 2e-12)])
def test_axial_force(bending, tension, rtol):
    """Some eps times sqrt(tension / bending), 1000 or 32 boundary layers; times pi^2 / (pi^2 - 9.8) in compression.

    Near buckling the first square is what 142 times as large ones leave: measured 2 to 11 times eps of these.
    """
    k = np.arange(1, 51) * np.pi
    z = lowest(beam(bending, tension=tension, free=PINNED), 50)[0]
    np.testing.assert_allclose(z, bending * k**4 + tension * k**2, rtol=rtol)


@pytest.mark.parametrize(("load", "number"), [(1.01, 1), (4.1, 2), (9.1, 3), (110.0, 10)])
def test_buckled_structure_is_refused(load, number):
    with pytest.raises(ValueError, match=rf"buckled: {number} unstable mode{'s' * (number > 1)} \(omega\^2 < 0\)$"):
        lowest(beam(tension=-load * np.pi**2, free=PINNED), 3)


def test_how_many_have_buckled_and_in_how_many_sets():
    problem = joint_arm([1.0, -2.0, -5.0, 3.0], [1.0, 1.0, -3.0, 0.0], 0.0)
    with pytest.raises(ValueError, match=r"buckled: 2 unstable modes \(omega\^2 < 0\), in 2 of 4 parameter sets"):
        lowest(problem, 3)
    assert (lowest(problem.take(np.array([0, 3])), 3)[:, 0] > [0.0, -1.0]).all()
    with pytest.raises(ValueError, match=r"buckled: 1 unstable mode \(omega\^2 < 0\), in 1 of 2 parameter sets"):
        lowest(problem.take(np.array([0, 1])), 3)


def test_energy_of_motion_is_never_negative():
    ends1 = np.zeros((4, 4))
    ends1[2, 2] = 0.5
    with pytest.raises(ValueError, match="negative kinetic energy"):
        lowest(beam(ends1=ends1, free=CLAMPED_FREE), 1)
    with pytest.raises(ValueError, match="no motion of the structure has kinetic energy"):
        lowest(beam(mass=0.0, free=CLAMPED_FREE), 1)


def test_foundation():
    k = np.arange(1, 21) * np.pi
    np.testing.assert_allclose(lowest(beam(foundation=1e4, free=PINNED), 20)[0], k**4 + 1e4, rtol=1e-12)


@pytest.mark.parametrize("strings", [2, 3])
def test_equal_roots_are_counted_and_get_orthogonal_shapes(strings):
    one, none = np.eye(strings), np.zeros((strings, strings))
    a0, a1 = np.block([[none, one], [none, none]]), np.block([[none, none], [-one, none]])
    problem = constant(a0, a1, displacements=strings, free=np.zeros((2 * strings, 0)))
    z = lowest(problem, 4 * strings)
    np.testing.assert_allclose(z[0], np.repeat((np.arange(1, 5) * np.pi) ** 2, strings), rtol=1e-12)
    x = np.linspace(0.0, 1.0, 2001)
    u = mode_states(problem, z, x[None])[0, :, :, :strings]
    gram = simpson(np.einsum("isa,jsa->ijs", u, u), x=x)
    np.testing.assert_allclose(gram, np.eye(4 * strings), atol=1e-10)


def test_equal_roots_of_unlike_strings_get_shapes_that_are_orthogonal_by_mass():
    """One speed of waves, masses 1 and 5, in skew coordinates: orthogonal vectors alone would not do."""
    skew, none = np.array([[1.0, 0.7], [0.0, 1.0]]), np.zeros((2, 2))
    mass = skew.T @ np.diag([1.0, 5.0]) @ skew
    a0, a1 = np.block([[none, np.linalg.inv(mass)], [none, none]]), np.block([[none, none], [-mass, none]])
    problem = constant(a0, a1, displacements=2, free=np.zeros((4, 0)))
    z = lowest(problem, 4)
    np.testing.assert_allclose(z[0], np.repeat((np.arange(1, 3) * np.pi) ** 2, 2), rtol=1e-12)
    x = np.linspace(0.0, 1.0, 1001)
    u = mode_states(problem, z, x[None])[0, :, :, :2]
    gram = simpson(np.einsum("isa,ab,jsb->ijs", u, mass, u), x=x)
    np.testing.assert_allclose(gram, np.eye(4), atol=1e-9)


GROWTH = 0.8


def flared_rod(free=None):
    """(e^2cx u')' + z e^2cx u = 0, solved by e^-cx times a sine of sqrt(z - c^2) x."""

    def system(z, rows, share):
        assert np.min(share) >= 0.0
        assert np.max(share) <= 1.0
        area = np.exp(2 * GROWTH * np.broadcast_to(share, (len(z), np.shape(share)[-1])))
        a, da = np.zeros((2, *area.shape, 2, 2))
        a[..., 0, 1], a[..., 1, 0], da[..., 1, 0] = 1 / area, -z[:, None] * area, -area
        return a, da

    def boundary(z, rows):
        return np.zeros((2, len(z), 2, 2))

    return DynamicStiffness(system, boundary, np.ones(1), 1, free=free, uniform=False)


def flared_basis(x, z):
    k = np.sqrt(z - GROWTH**2)
    u = np.exp(-GROWTH * x) * np.array([np.cos(k * x), np.sin(k * x)])
    du = -GROWTH * u + np.exp(-GROWTH * x) * k * np.array([-np.sin(k * x), np.cos(k * x)])
    return np.array([u, np.exp(2 * GROWTH * x) * du])


def dense_string(free=None):
    """u'' + z u / (1 + x)^2 = 0, solved by sqrt(1 + x) times a sine of sqrt(z - 1/4) log(1 + x)."""

    def system(z, rows, share):
        density = 1.0 / (1.0 + np.broadcast_to(share, (len(z), np.shape(share)[-1]))) ** 2
        a, da = np.zeros((2, *density.shape, 2, 2))
        a[..., 0, 1], a[..., 1, 0], da[..., 1, 0] = 1.0, -z[:, None] * density, -density
        return a, da

    def boundary(z, rows):
        return np.zeros((2, len(z), 2, 2))

    return DynamicStiffness(system, boundary, np.ones(1), 1, free=free, uniform=False)


def dense_basis(x, z):
    k, s = np.sqrt(z - 0.25), np.log(1 + x)
    u = np.sqrt(1 + x) * np.array([np.cos(k * s), np.sin(k * s)])
    return np.array([u, (0.5 * u + k * np.sqrt(1 + x) * np.array([-np.sin(k * s), np.cos(k * s)])) / (1 + x)])


def carried(basis, z):
    """The exact transfer matrix, and its derivative by a complex step."""
    exact = basis(1.0, z + 1e-30j) @ np.linalg.inv(basis(0.0, z + 1e-30j))
    return exact.real, exact.imag / 1e-30


@pytest.mark.parametrize(("rod", "basis"), [(flared_rod(), flared_basis), (dense_string(), dense_basis)])
def test_steps_through_varying_coefficients_are_of_sixth_order(rod, basis):
    """Every coefficient of the Magnus expansion counts: transfer and its derivative gain 2^6 when steps are halved."""
    z, row = np.array([9.0]), np.zeros(1, dtype=int)
    errors = []
    for steps in (8, 16, 32):
        total, slope = np.eye(2), np.zeros((2, 2))
        for k in range(steps):
            start, share = np.full((1, 1), k / steps), np.full((1, 1), 1 / steps)
            t, dt = (a[0, 0] for a in exponential(*rod.exponent(z, row, start, share)))
            total, slope = t @ total, dt @ total + t @ slope
        errors.append([np.abs(a - b).max() for a, b in zip((total, slope), carried(basis, 9.0), strict=True)])
    assert max(errors[-1]) < 1e-9  # of order h^6: of the size of 32^-6 = 1e-9, far above rounding
    np.testing.assert_allclose(np.log2(np.array(errors[:-1]) / errors[1:]), 6.0, atol=0.1)  # the next term is h^8


def test_a_varying_part_is_cut_finer_than_a_uniform_one():
    assert flared_rod().levels(np.array([1.0, 2.0]), np.zeros(2, dtype=int)).tolist() == [6, 6]
    assert flared_rod().levels(np.array([1e6]), np.zeros(1, dtype=int)).tolist() == [12]


def test_coefficients_of_a_uniform_part_may_be_given_at_every_station():
    def system(z, rows, share):
        a, da = np.zeros((2, len(z), np.shape(share)[-1], 2, 2))
        a[..., 0, 1], a[..., 1, 0], da[..., 1, 0] = 1.0, -z[:, None], -1.0
        return a, da

    def boundary(z, rows):
        return np.zeros((2, len(z), 2, 2))

    string = DynamicStiffness(system, boundary, np.ones(1), 1, free=np.zeros((2, 0)))
    np.testing.assert_allclose(lowest(string, 12)[0], (np.arange(1, 13) * np.pi) ** 2, rtol=1e-12)


def test_count_on_a_string_that_is_denser_at_one_end():
    turns = np.random.default_rng(6).uniform(0.0, 20.0, 40)
    z = 0.25 + (turns * np.pi / np.log(2.0)) ** 2
    count = dense_string(np.zeros((2, 0))).evaluate(z, np.zeros(40, dtype=int)).count
    np.testing.assert_array_equal(count, np.floor(turns))


def test_a_flared_rod():
    z = lowest(flared_rod(np.zeros((2, 0))), 25)
    np.testing.assert_allclose(z[0], (np.arange(1, 26) * np.pi) ** 2 + GROWTH**2, rtol=1e-9)
    x = np.linspace(0.0, 1.0, 13)
    state = mode_states(flared_rod(np.zeros((2, 0))), z[:, :3], x[None])[0]
    for k, (u, force) in enumerate(np.moveaxis(state, -1, 1), start=1):
        angle = k * np.pi * x  # int e^2cx u^2 dx = 1
        shape = np.sqrt(2) * np.exp(-GROWTH * x) * np.array([np.sin(angle), np.cos(angle)])
        sign = np.sign(u[1])
        np.testing.assert_allclose(sign * u, shape[0], atol=1e-8)
        slope = k * np.pi * shape[1] - GROWTH * shape[0]
        np.testing.assert_allclose(sign * force, np.exp(2 * GROWTH * x) * slope, atol=1e-6)


def test_stationary_values_of_graded_energies_keep_their_digits():
    """Scales from 1e-12 to 1, soft ones first: each is exact to rounding of itself, which LAPACK does not promise."""
    rng = np.random.default_rng(5)
    for size in (2, 3, 4):
        strain, kinetic = (a @ np.swapaxes(a, 1, 2) + np.eye(size) for a in rng.normal(size=(2, 6, size, size)))
        grade = 10.0 ** np.linspace(-6.0, 0.0, size)
        strain = grade[:, None] * strain * grade
        found = stationary_values(strain, kinetic)
        with mp.workdps(50):
            for row in range(6):
                frame = mp.inverse(mp.cholesky(mp.matrix(kinetic[row].tolist())))
                exact = mp.eigsy(frame * mp.matrix(strain[row].tolist()) * frame.T, eigvals_only=True)
                np.testing.assert_allclose(found[row], np.array(exact, dtype=float), rtol=4e-15)


def frequency_function(lam, k_t, k_r, mu):
    """The paper's determinant, written independently of the package."""
    s, c, S, C = mp.sin(lam), mp.cos(lam), mp.sinh(lam), mp.cosh(lam)
    return (
        -(lam**5) * mu * (s * C - c * S)
        + 2 * lam**4 * k_r * mu * c * C
        + lam**4 * (c * C - 1)
        + lam**3 * k_r * (s * C + c * S)
        + 2 * lam**2 * k_t * mu * s * S
        + lam * k_r * k_t * mu * (s * C - c * S)
        + lam * k_t * (s * C - c * S)
        - k_r * k_t * (c * C + 1)
    )


def test_random_joints_over_28_decades_against_50_digits():
    rng = np.random.default_rng(1)
    k_t, k_r = 10 ** rng.uniform(-16, 12, (2, 25))
    mu = 10 ** rng.uniform(-3, 6, 25)
    z = lowest(joint_arm(k_t, k_r, mu), 4)
    with mp.workdps(50):
        for row in range(25):
            parameters = [mpf(float(a[row])) for a in (k_t, k_r, mu)]
            for value in z[row]:
                lam = start = mpf(float(value)) ** 0.25
                assert lam > 0
                for _ in range(8):
                    nudge = lam * mpf(10) ** -20
                    here = frequency_function(lam, *parameters)
                    lam -= here * nudge / (frequency_function(lam + nudge, *parameters) - here)
                assert abs(lam / start - 1) < 1e-12


def test_rigid_body_modes_of_soft_and_absent_springs():
    z = lowest(joint_arm([0.0, 1e-14, 0.0, 1e-14], [0.0, 0.0, 1e-10, 1e-9], 0.0), 3)
    np.testing.assert_array_equal((z == 0.0).sum(axis=1), [2, 1, 1, 0])
    np.testing.assert_allclose(z[1:, 1], [4e-14, 1.2e-9, 1.20000300e-8], rtol=1e-7)


def with_a_base(base):
    """y = w + v with v clamped at the root, and the base w carrying a mass, against y with an end mass."""
    a0, a1 = np.zeros((6, 6)), np.zeros((6, 6))  # (v, v', w, P_v, P_v', r)
    a0[0, 1], a0[1, 4], a0[4, 3] = 1.0, 1.0, -1.0
    a1[3, [0, 2]] = a1[5, [0, 2]] = -1.0
    ends1 = np.zeros((5, 5))
    ends1[2, 2] = -base
    relative = constant(a0, a1, displacements=2, coordinates=1, ends1=ends1, free=np.eye(5)[:, 2:])
    absolute_end = np.zeros((4, 4))
    absolute_end[0, 0] = -base
    return relative, beam(ends1=absolute_end, free=np.eye(4)[:, [0, 2, 3]])


def test_lumped_coordinate_is_the_same_as_a_mass_at_the_root():
    relative, absolute = with_a_base(0.7)
    z = lowest(relative, 8)
    np.testing.assert_allclose(z, lowest(absolute, 8), rtol=1e-11)
    assert z[0, 0] == 0.0 and z[0, 1] > 0.0
    x = np.array([[0.0, 0.3, 1.0]])
    moving = mode_states(relative, z, x)[0]
    still = mode_states(absolute, z, x)[0]
    np.testing.assert_allclose(np.abs(moving[..., 0] + moving[..., 2]), np.abs(still[..., 0]), atol=1e-10)


def test_a_massless_beam_has_only_the_modes_of_its_masses():
    ends1 = np.zeros((4, 4))
    ends1[2, 2] = -2.0
    arm = beam(mass=0.0, ends1=ends1, free=CLAMPED_FREE)
    np.testing.assert_allclose(lowest(arm, 1), [[1.5]], rtol=1e-12)
    with pytest.raises(ValueError, match="modes = 2: the model has only 1 natural"):
        lowest(arm, 2)


def test_mode_shapes_are_orthonormal_and_satisfy_the_equation():
    arm = beam(free=CLAMPED_FREE)
    z = lowest(arm, 20)
    x = np.linspace(0.0, 1.0, 4001)
    state = mode_states(arm, z, x[None])[0]
    v = state[:, :, 0]
    np.testing.assert_allclose(simpson(v[:, None] * v[None], x=x), np.eye(20), atol=1e-8)
    np.testing.assert_allclose(np.abs(v[:, -1]), 2.0, rtol=1e-10)
    np.testing.assert_allclose(state[:, 0, :2], 0.0, atol=1e-10)
    np.testing.assert_allclose(state[:, -1, 2:] / z[0, :, None] ** 0.75, 0.0, atol=1e-9)
    force = np.gradient(state[:, :, 2], x, axis=1, edge_order=2)
    # differences at the ends are off by h^2 Q''' / 3, and Q''' = -z v'' with |v''| <= 2 sqrt(z)
    error = (force[:3] + z[0, :3, None] * v[:3]) / z[0, :3, None] ** 1.5
    np.testing.assert_allclose(error, 0.0, atol=1.01 * 2 * x[1] ** 2 / 3)


@pytest.mark.parametrize("damper", [0.3, 0.9, 5.0])
def test_string_with_a_damper_at_its_end(damper):
    """cosh(s) + c sinh(s) = 0: every eigenvalue has the same real part."""

    def system(s, rows, share):
        a, da = np.zeros((2, len(s), 1, 2, 2), dtype=complex)
        a[:, 0, 0, 1], a[:, 0, 1, 0], da[:, 0, 1, 0] = 1.0, s**2, 2.0 * s
        return a, da

    def boundary(s, rows):
        b, db = np.zeros((2, len(s), 2, 2), dtype=complex)
        b[:, 1, 1], db[:, 1, 1] = damper * s, damper
        return b, db

    string = DynamicStiffness(system, boundary, np.ones(1), 1, 0, np.eye(2)[:, 1:])
    k = np.arange(5) + 0.5 if damper < 1 else np.arange(1, 6)
    exact = -0.5 * np.log(abs((damper + 1) / (damper - 1))) + 1j * np.pi * k
    asked = []
    counting = replace(string, boundary=lambda s, rows: asked.append(len(s)) or boundary(s, rows))
    found = refine(counting, (1.02j * np.pi * k - 0.1)[None])
    assert len(asked) <= 11  # each step triples the digits
    np.testing.assert_allclose(found[0], exact, rtol=1e-12)
    near = refine(string, (exact[0] + 0.1 * np.exp(2j * np.arange(3)))[None])[0]  # no two end on one root
    np.testing.assert_allclose(np.cosh(near) + damper * np.sinh(near), 0.0, atol=1e-10)
    assert (np.abs(near[:, None] - near) + 9.0 * np.eye(3)).min() > 3.0
    shape = mode_states(string, found, np.array([[0.25, GOLDEN, 1.0]]))[0, :, :, 0]
    np.testing.assert_allclose(shape[:, 0] / shape[:, 2], np.sinh(0.25 * exact) / np.sinh(exact), rtol=1e-10)
    np.testing.assert_allclose(np.abs(shape[:, 1:]).max(axis=1), 1.0, rtol=1e-12)  # at the nodes inside and at the end


def test_equal_damped_strings_get_shapes_of_their_own():
    """The root twice, in two directions."""
    one, none, damper = np.eye(2), np.zeros((2, 2)), 0.4

    def system(s, rows, share):
        a = np.array([np.block([[none, one], [z**2 * one, none]]) for z in s])
        da = np.array([np.block([[none, none], [2.0 * z * one, none]]) for z in s])
        return a[:, None], da[:, None]

    def boundary(s, rows):
        end = damper * np.block([[none, none], [none, one]])
        return s[:, None, None] * end, np.broadcast_to(end + 0j, (len(s), 4, 4))

    s = -0.5 * np.log((1 + damper) / (1 - damper)) + 0.5j * np.pi
    strings = DynamicStiffness(system, boundary, np.ones(1), 2, 0, np.eye(4)[:, 2:])
    shape = mode_states(strings, np.array([[s, s]]), np.array([[0.25, 1.0]]))[0, :, :, :2]
    np.testing.assert_allclose(shape[:, 0] * np.sinh(s), shape[:, 1] * np.sinh(0.25 * s), atol=1e-10)
    assert abs(np.linalg.det(shape[:, 1])) > 0.1


def test_quotients_of_rough_roots_are_wrong_in_second_order_only():
    arm = beam(free=CLAMPED_FREE)
    z = lowest(arm, 4)
    np.testing.assert_allclose(quotients(arm, z * (1.0 + 1e-4)), z, rtol=1e-6)


def test_two_rigid_motions_are_exact_zeros_whatever_their_masses():
    """A heavy base beside a light beam, nothing between: both translate, and rounding must not look like a spring."""
    a0, a1 = np.zeros((6, 6)), np.zeros((6, 6))  # (v, v', w, P_v, P_v', r), v seen from the base w
    a0[0, 1], a0[1, 4], a0[4, 3] = 1.0, 1 / 170.0, -1.0
    a1[3, [0, 2]] = a1[5, [0, 2]] = -0.017
    ends1 = np.zeros((5, 5))
    ends1[2, 2] = -82.0
    free = np.eye(5)[:, [0, 2, 3, 4]]  # the root may slide, not turn
    z = lowest(constant(a0, a1, length=1.6, displacements=2, coordinates=1, ends1=ends1, free=free), 4)[0]
    np.testing.assert_array_equal(z[:2], 0.0)
    with mp.workdps(30):
        exact = mp.findroot(lambda l: mp.tan(l) + mp.tanh(l), 2.365) ** 4 * 170 / mpf("0.017") / mpf("1.6") ** 4
    np.testing.assert_allclose(z[2], float(exact), rtol=1e-10)


def test_more_soft_roots_than_static_deflections():
    """All Ritz values of more roots than K has coordinates; what rounds to nothing is measured by the last bound."""
    exact = (np.arange(1, 7) * np.pi)[None] ** 4
    bounds = np.array([[1e2, 2e3, 8e3, 3e4]])
    for rough in (1.0, 1.0 + 1e-9):
        found = _polish(beam(free=PINNED), rough * exact, 1e-6 * exact, bounds)
        np.testing.assert_allclose(found, exact, rtol=1e-11)
