"""Spectra of two waves a section against determinants in extended precision, dynamic stiffness and closed forms."""

from __future__ import annotations

import numpy as np
import pytest

from cra_sym.kernels.plain import functions_of
from cra_sym.solvers.eigenvalues import lowest
from cra_sym.solvers.waves import QUICK, UniformProblem, determinant, formulas, lowest_waves
from cra_sym.solvers.waves_static import rigid_motions
from tests.solvers.wave_problems import INF, beams, distance, stiffness

HELD, HINGED, FREE = (INF, INF), (INF, 0.0), (0.0, 0.0)
TURNS = np.arange(1, 40) * np.pi
ROUNDING = 1e-14
"""Relative error of a root: some fifty roundings of the determinant, whose terms add up with one sign."""


def one(problem: UniformProblem, modes: int) -> np.ndarray:
    return lowest_waves(problem, modes)[0]


def spread(rng, low, high, zero=0.0, held=0.0):
    """Return a power of ten, sometimes 0 or infinite."""
    kind = rng.uniform()
    return 0.0 if kind < zero else INF if kind > 1 - held else 10 ** rng.uniform(low, high)


def random_beam(rng, low, high):
    """Return a beam with any of tension, foundation, shear and rotary inertia, and any ends."""
    kind, r = rng.integers(4), spread
    options = {"EI": r(rng, -1, 1), "rhoA": r(rng, -1, 1), "length": r(rng, -0.5, 0.5)}
    options |= {"tension": r(rng, -2, high)} if kind & 1 else {}
    options |= {"foundation": r(rng, -2, high)} if kind & 2 else {}
    if rng.uniform() < 0.4:
        options["rotary"] = r(rng, -5, -1)
        options["shear"] = r(rng, 0, 1) / options["rotary"]
    ends = [[r(rng, low, high, zero, held) for _ in range(2)] for zero, held in ((0.2, 0.3), (0.5, 0.1))]
    masses = [[r(rng, -3, 1, zero) for _ in range(2)] for zero in (0.7, 0.4)]
    return beams(*ends, left_mass=masses[0], right_mass=masses[1], **options)


def assert_complete(problem, z):
    """Between neighbouring frequencies, dynamic stiffness counts as many below as there are."""
    between = np.sqrt(z[:-1] * z[1:])
    between = between[(z[:-1] > 0.0) & (z[1:] > z[:-1] * (1.0 + 1e-6))]
    count = stiffness(problem).evaluate(between, np.zeros(between.size, dtype=int)).count
    np.testing.assert_array_equal(count, (z[:, None] < between).sum(axis=0))


@pytest.mark.parametrize("seed", range(8))
def test_random_beams_in_extended_precision(seed):
    problem = random_beam(np.random.default_rng(seed), -3, 3)
    z = one(problem, 4)
    assert_complete(problem, z)
    assert max(distance(problem, 0, value) for value in z[z > 0.0]) < ROUNDING


@pytest.mark.parametrize("seed", range(40))
def test_random_beams_by_dynamic_stiffness(seed):
    problem = random_beam(np.random.default_rng(1000 + seed), -2, 3)
    found, other = one(problem, 6), lowest(stiffness(problem), 6)[0]
    # dynamic stiffness: its own polish is good to about 1e-12 of a root, and 1e-12 of the last for soft ones
    np.testing.assert_allclose(found, other, rtol=1e-10, atol=1e-12 * other[-1])
    np.testing.assert_array_equal(found == 0.0, other == 0.0)


@pytest.mark.parametrize("seed", range(6))
def test_soft_ends_leave_near_equal_roots(seed):
    rng = np.random.default_rng(seed)
    ends = 10 ** rng.uniform(-10, -6, (2, 2))
    problem = beams(ends[0], ends[1], foundation=rng.choice([0.0, 3e-9]), right_mass=(rng.choice([0.0, 1.0]), 0.0))
    z = one(problem, 3)
    assert (z[:2] < 1e-4).all()
    assert max(distance(problem, 0, value) for value in z) < ROUNDING


def test_nearly_equal_roots_of_a_free_beam_on_soft_foundation_stay_apart():
    problem = beams(FREE, foundation=2.5e-8, right_mass=(2.7e-8, 0.0))
    z = one(problem, 2)
    assert 0.0 < z[1] / z[0] - 1.0 < 1e-6
    assert max(distance(problem, 0, value) for value in z) < ROUNDING


@pytest.mark.parametrize("turn", [1.0, -1.0])
@pytest.mark.parametrize("size", [1e-3, 1.0, 9.8, 1e3, 1e6, 1e9])
def test_hinged_beams_under_axial_load(turn, size):
    if turn < 0 and size > np.pi**2:
        return
    exact = TURNS[:6] ** 4 + turn * size * TURNS[:6] ** 2
    terms = TURNS[:6] ** 4 + size * TURNS[:6] ** 2
    assert (np.abs(one(beams(HINGED, HINGED, tension=turn * size), 6) - exact) < ROUNDING * terms).all()


@pytest.mark.parametrize("foundation", [1e-9, 1.0, 1e4, 1e8, 1e13])
def test_hinged_beams_on_foundations(foundation):
    exact = TURNS[:6] ** 4 + foundation
    np.testing.assert_allclose(one(beams(HINGED, HINGED, foundation=foundation), 6), exact, rtol=ROUNDING)


@pytest.mark.parametrize("share", [0.3, 0.9, 0.999])
@pytest.mark.parametrize("foundation", [50.0, 1e4, 1e7])
def test_compression_on_a_foundation_where_frequencies_fall_with_the_wave_number(share, foundation):
    """The lowest mode has several half waves, and its branch falls below that number: the count subtracts it."""
    critical = (TURNS**2 + foundation / TURNS**2).min()
    exact = np.sort(TURNS**4 - share * critical * TURNS**2 + foundation)[:6]
    found = one(beams(HINGED, HINGED, tension=-share * critical, foundation=foundation), 6)
    assert (np.abs(found - exact) < ROUNDING * (exact + 2.0 * foundation + share * critical * TURNS[11] ** 2)).all()
    problem = beams((3.0, 2.0), (INF, 1.0), tension=-0.3 * critical, foundation=foundation, left_mass=(2.0, 0.1))
    z = one(problem, 5)
    assert_complete(problem, z)
    assert max(distance(problem, 0, value) for value in z[:3]) < ROUNDING


def test_hinged_timoshenko_beams_have_two_spectra():
    """Both branches of the dispersion relation at every wave number, and the thickness-shear motion without any."""
    shear, rotary = 30.0, 0.02
    k = TURNS**2
    a, b, c = rotary * np.ones_like(k), -(k + shear + shear * rotary * k), shear * k**2
    roots = np.concatenate([(-b + sign * np.sqrt(b * b - 4 * a * c)) / (2 * a) for sign in (1, -1)])
    exact = np.sort(np.append(roots, shear / rotary))[:20]
    np.testing.assert_allclose(one(beams(HINGED, HINGED, shear=shear, rotary=rotary), 20), exact, rtol=1e-13)


def test_timoshenko_becomes_euler_bernoulli():
    thin = one(beams(HELD, shear=1e16, rotary=1e-16), 4) ** 0.25
    np.testing.assert_allclose(thin, [1.8751040687119611, 4.694091132974175, 7.854757438237613, 10.995540734875467])


@pytest.mark.parametrize("foundation", [1.0, 1e3, 1e6])
def test_below_at_and_above_the_cut_off(foundation):
    """A free beam moves as a rigid body at the cut-off itself, a heavy end below it."""
    z = one(beams(FREE, foundation=foundation), 4)
    np.testing.assert_allclose(z[:2], foundation, rtol=ROUNDING)
    problem = beams(HELD, foundation=foundation, right_mass=(10.0, 1.0))
    z = one(problem, 4)
    assert z[0] < foundation
    assert_complete(problem, z)
    assert max(distance(problem, 0, value) for value in z[:2]) < ROUNDING


def test_a_heavy_end_on_a_foundation():
    np.testing.assert_allclose(
        one(beams(HELD, foundation=100.0, right_mass=(10.0, 0.0)), 1) ** 0.5, 1.49597602, rtol=1e-8
    )


def test_uniform_but_extreme():
    """The first modes are those of a rigid bar: it leads to the same numbers (accuracy: 1 / tension)."""
    z = one(beams((1e-6, 10.0), tension=1e8, right_mass=(1.0, 1.0)), 2)
    np.testing.assert_allclose(np.sqrt(z[0]), 7.0710678118e-4, rtol=1e-10)
    z = one(beams((2.996, INF), tension=3.12e8, right_mass=(4e-6, 0.0)), 2)
    np.testing.assert_allclose(np.sqrt(z[0]), np.sqrt(2.996 / 1.000004), rtol=1e-8)
    # the value of a determinant with 60 + 4 kappa digits
    np.testing.assert_allclose(np.sqrt(z), [1.73089225732274, 55491.3690779278], rtol=ROUNDING)
    assert one(beams((0.0, INF), tension=3.12e8, right_mass=(4e-6, 0.0)), 2)[0] == 0.0


@pytest.mark.parametrize(
    ("problem", "number"),
    [
        (beams(FREE), 2),
        (beams(FREE, HINGED), 1),
        (beams(FREE, (0.0, INF)), 1),
        (beams((0.0, 1e-9), (0.0, 1e9)), 1),
        (beams(HINGED, (1e-300, 0.0)), 0),
        (beams(FREE, tension=1e5), 1),
        (beams(FREE, foundation=1e-12), 0),
        (beams(FREE, shear=10.0, rotary=0.1, tension=3.0), 1),
    ],
)
def test_rigid_motions_are_exact_zeros(problem, number):
    assert rigid_motions(problem)[0] == number
    z = one(problem, 3)
    assert (z[:number] == 0.0).all() and (z[number:] > 0.0).all()


def coupled_strings(springs, ends, masses):
    """Return two strings with springs to the ground and between them: both displacements are even."""
    first, second, between = springs
    a, b = np.zeros((2, 1, 2, 2)), np.zeros((2, 1, 2, 2))
    a[0, 0] = [[first + between, -between], [-between, second + between]]
    a[1, 0], b[0, 0] = np.diag([-1.0, -0.7]), np.diag([1.0, 1 / 1.9])
    ends, masses = (np.ravel(values)[None] for values in (ends, masses))
    return UniformProblem(np.array([1.3]), a, b, ends, masses, odd=(False, False))


@pytest.mark.parametrize("springs", [(0.0, 0.0, 3.0), (1.0, 0.0, 1e3), (2.0, 5.0, 0.0)])
def test_two_even_displacements(springs):
    problem = coupled_strings(springs, [[0.0, 3.0], [2.0, 0.0]], [[0.0, 0.4], [1.5, 0.0]])
    np.testing.assert_allclose(one(problem, 6), lowest(stiffness(problem), 6)[0], rtol=1e-11)
    free = coupled_strings(springs, [[0.0, 0.0], [0.0, 0.0]], [[0.0, 0.4], [1.5, 0.0]])
    assert rigid_motions(free)[0] == (springs[:2] == (0.0, 0.0))


def test_equal_strings_have_double_roots():
    problem = coupled_strings((0.0, 0.0, 0.0), [[INF, INF], [INF, INF]], [[0.0, 0.0], [0.0, 0.0]])
    a, b = problem.odd_by_even.copy(), problem.even_by_odd.copy()
    a[1, 0], b[0, 0] = -np.eye(2), np.eye(2)
    twice = UniformProblem(np.ones(1), a, b, problem.stiffness, problem.mass, odd=(False, False))
    np.testing.assert_allclose(one(twice, 6), np.repeat(TURNS[:3] ** 2, 2), rtol=ROUNDING)


@pytest.mark.parametrize("seed", range(5))
def test_counts_at_random_points(seed):
    rng = np.random.default_rng(seed)
    problem = random_beam(rng, -2, 3)
    z = 10 ** rng.uniform(-2, 7, 60)
    where = np.zeros(z.size, dtype=int)
    count, value = determinant(problem).take(where).count(z)
    np.testing.assert_array_equal(count, stiffness(problem).evaluate(z, where).count)
    np.testing.assert_array_equal(np.sign(value), (-1.0) ** count)


@pytest.mark.parametrize("offset", [-0.7, -1e-6, 1e-3, 0.1, 5.0])
@pytest.mark.parametrize("family", [{}, {"tension": 30.0}, {"foundation": 2e3}, {"shear": 50.0, "rotary": 0.01}])
def test_offset_end_masses(family, offset):
    problem = beams((2.0, 3.0), right_mass=(0.8, 1e-3), offset=offset, **family)
    z = one(problem, 5)
    np.testing.assert_allclose(z, lowest(stiffness(problem), 5)[0], rtol=1e-10)
    assert max(distance(problem, 0, value) for value in z[:3]) < ROUNDING
    count = determinant(problem).take(np.zeros(5, dtype=int)).count(z * 1.01)[0]
    np.testing.assert_array_equal(count, (z[:, None] < z * 1.01).sum(axis=0))


def test_coupled_end_springs():
    """A spring at an arm beyond the end: one direction of the end stays free, and the beam turns about the spring."""
    problem = beams(FREE, (4.0, 4.0 * 0.3**2))
    couplings = np.zeros((2, 1, 4, 4))
    couplings[0, 0, 2:, 2:] = [[0.0, 4.0 * 0.3], [4.0 * 0.3, 0.0]]
    parts = problem.length, problem.odd_by_even, problem.even_by_odd, problem.stiffness, problem.mass
    problem = UniformProblem(*parts, couplings=couplings)
    assert rigid_motions(problem)[0] == 1
    z = one(problem, 4)
    assert z[0] == 0.0 and (z[1:] > 0.0).all()
    assert max(distance(problem, 0, value) for value in z[1:]) < ROUNDING


def section(ends, masses, odd_by_even, even_by_odd, odd, length=1.0):
    """Return a problem with one row from its matrices: constants and factors of z."""
    matrices = (np.array(matrix, dtype=float)[:, None] for matrix in (odd_by_even, even_by_odd))
    ends, masses = (np.ravel(np.array(values, dtype=float))[None] for values in (ends, masses))
    return UniformProblem(np.array([length]), *matrices, ends, masses, odd=odd)


def random_string(rng):
    """Return a string on a foundation."""
    r = spread
    ends = [[r(rng, -9, 9, 0.2, 0.3)] for _ in range(2)]
    masses = [[r(rng, -3, 2, 0.5)] for _ in range(2)]
    return section(ends, masses, [[[r(rng, -4, 6, 0.3)]], [[-r(rng, -1, 1)]]], [[[r(rng, -1, 1)]], [[0.0]]], (False,))


def random_bending_and_torsion(rng):
    """Return E = (v, phi, M), O = (V, T, theta): the mass lies off the axis, on foundations of both motions."""
    r, offset, rho = spread, rng.uniform(-0.5, 0.5), 10 ** rng.uniform(-1, 1)
    heavy = [[-rho, -rho * offset, 0], [-rho * offset, -(r(rng, -3, 0) + rho * offset**2), 0], [0, 0, 0]]
    soft = [[r(rng, -2, 6, 0.4), 0, 0], [0, r(rng, -2, 4, 0.4), 0], [0, 0, 1]]
    flexible = [[0, 0, 1], [0, r(rng, -1, 2), 0], [-1, 0, r(rng, -2, 3, 0.5)]]
    ends = [[r(rng, -9, 9, 0.2, 0.3) for _ in range(3)] for _ in range(2)]
    masses = [[r(rng, -3, 1, 0.6) for _ in range(3)] for _ in range(2)]
    return section(ends, masses, [soft, heavy], [flexible, np.zeros((3, 3))], (False, False, True))


@pytest.mark.parametrize("kind", [random_string, random_bending_and_torsion])
@pytest.mark.parametrize("seed", range(5))
def test_one_and_three_waves_in_extended_precision(kind, seed):
    problem = kind(np.random.default_rng(seed))
    z = one(problem, 4)
    # three waves: the two others are found in coordinates that the farthest one leaves, a sum of three products more
    bound = ROUNDING if kind is random_string else 1e-12
    assert max(distance(problem, 0, value) for value in z[z > 0.0][:3]) < bound


@pytest.mark.parametrize("kind", [random_string, random_bending_and_torsion])
@pytest.mark.parametrize("seed", range(10, 20))
def test_counts_of_one_and_three_waves(kind, seed):
    """At random points, below and above cut-offs, with ends from 0 and 1e-9 to 1e9 and infinity."""
    problem = kind(np.random.default_rng(seed))
    rng = np.random.default_rng(seed)
    z = 10 ** rng.uniform(-1, 7, 40)
    where = np.zeros(z.size, dtype=int)
    count, value = determinant(problem).take(where).count(z)
    other = (
        stiffness(problem).evaluate(z * (1 + 1e-6), where).count,
        stiffness(problem).evaluate(z * (1 - 1e-6), where).count,
    )
    sure = other[0] == other[1]  # the dynamic stiffness counts to about 1e-7 of z beside soft ends
    np.testing.assert_array_equal(count[sure], other[0][sure])
    np.testing.assert_array_equal(np.sign(value), (-1.0) ** count)


def test_text_and_arrays_are_the_same_formulas():
    rng = np.random.default_rng(4)
    problem = random_bending_and_torsion(rng)
    known = (None,) * problem.structure.coefficients
    functions = functions_of(formulas(problem.structure, known), QUICK)
    found = lowest_waves(problem, 5, functions=functions)
    np.testing.assert_allclose(found, lowest_waves(problem, 5), rtol=ROUNDING)


def test_rows_keep_apart():
    rng = np.random.default_rng(3)
    tension, springs = 10 ** rng.uniform(-3, 6, 50), 10 ** rng.uniform(-3, 6, (50, 2))
    together = lowest_waves(beams(springs, tension=tension), 4)
    alone = [one(beams(springs[i], tension=tension[i]), 4) for i in range(50)]
    np.testing.assert_allclose(together, alone, rtol=ROUNDING)


def test_buckled_structures_are_refused():
    with pytest.raises(ValueError, match=r"has buckled: 1 unstable mode \(omega\^2 < 0\), in 1 of 2 parameter sets"):
        lowest_waves(beams(HINGED, HINGED, tension=np.array([-10.0, 3.0])), 3)
    with pytest.raises(ValueError, match=r"has buckled: 2 unstable modes \(omega\^2 < 0\)$"):
        lowest_waves(beams(HINGED, HINGED, tension=-40.0), 3)


def test_massless_beams_have_few_frequencies():
    problem = beams(HELD, rhoA=0.0, right_mass=(2.0, 0.0))
    np.testing.assert_allclose(one(problem, 1), 3.0 / 2.0, rtol=ROUNDING)
    with pytest.raises(ValueError, match="modes = 2: the model has only 1 natural frequencies"):
        one(problem, 2)


@pytest.mark.parametrize("name", ["odd_by_even", "even_by_odd", "stiffness", "mass"])
def test_wrong_shapes_are_named(name):
    problem = beams(HELD)
    parts = {key: getattr(problem, key) for key in ("length", "odd_by_even", "even_by_odd", "stiffness", "mass")}
    with pytest.raises(ValueError, match=rf"^{name}: the shape"):
        UniformProblem(**parts | {name: parts[name][..., :1]})


@pytest.mark.parametrize(("given", "message"), [({"odd": (False,)}, "each of 2"), ({"sizes": (1,)}, "sum must be 2")])
def test_wrong_structures_are_named(given, message):
    problem = beams(HELD)
    parts = problem.length, problem.odd_by_even, problem.even_by_odd, problem.stiffness, problem.mass
    with pytest.raises(ValueError, match=message):
        UniformProblem(*parts, **given)


@pytest.mark.parametrize("stiffness", [1e-120, 1e-160, 1e-300])
def test_springs_of_next_to_nothing(stiffness):
    """One frequency of next to nothing is right; the determinant has no room for the product of two."""
    z = one(beams((stiffness, INF), tension=2.0, right_mass=(0.3, 0.0)), 3)
    np.testing.assert_allclose(z[0], stiffness / 1.3, rtol=1e-13)
    if stiffness < 1e-150:
        with pytest.raises(ValueError, match="several motions have less than 1e-140 of the line's own"):
            one(beams((stiffness, 0.0), (0.0, stiffness), foundation=0.0), 3)
        with pytest.raises(ValueError, match="take 0"):
            one(beams((stiffness, 0.0)), 3)
