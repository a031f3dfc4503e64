"""The templates that are compiled are plain Python: run as such they give what the NumPy path gives."""

from pathlib import Path

import numpy as np
import pytest

import cra_sym as cra
from cra_sym.analysis import floquet as growth
from cra_sym.kernels import specialise
from cra_sym.model.one_wave_family import Family
from cra_sym.solvers import floquet, periodic

BEAMS = ("k", "k"), ("m", "m")
STRUCTURES = [
    BEAMS, (("km", "km"), ("km", "km")), (("h", "k"), ("m", "")), (("", "m"), ("h", "k")), (("k",), ("m",)),
    (("h",), ("km",)), (("m",), ("m",)),
]  # fmt: skip


def plain(module, text, kernels):
    """Return the template's functions as Python reads them, in the name of its file."""
    file = Path(cra.__file__).parent / f"{module}.py"
    names = {}
    with np.errstate(all="ignore"):
        exec(specialise._prelude(kernels, True), names)
        exec(compile(text, file, "exec"), names)
    return type("Template", (), {name: staticmethod(value) for name, value in names.items() if callable(value)})


def family(structure):
    """Return a family whose templates are not compiled."""
    made = Family(structure)
    made.__dict__["compiled_spectrum"] = plain("solvers/spectrum_lanes", *made.spectrum_parts())
    made.__dict__["compiled_modes"] = plain("solvers/modal_lanes", *made.modal_parts())
    return made


def arms(seed, size, stiffness=(-3, 6), inertia=(-3, 3)):
    rng = np.random.default_rng(seed)

    def draw(low, high, *ends):
        return np.where(rng.random(size) < 0.3, rng.choice(ends, size), 10.0 ** rng.uniform(low, high, size))

    return draw(*stiffness, 0.0, np.inf), draw(*stiffness, 0.0, np.inf), draw(*inertia, 0.0), draw(*inertia, 0.0)


def lines(structure, seed, size):
    """Stiffnesses and inertias of random lines of a structure."""
    rng = np.random.default_rng(seed)

    def draw(letter):
        low, high, *ends = (-3, 6, 0.0, np.inf) if letter == "k" else (-3, 3, 0.0)
        return np.where(rng.random(size) < 0.3, rng.choice(ends, size), 10.0 ** rng.uniform(low, high, size))

    return [draw(letter) for _, letter in Family(structure).layout.groups]


@pytest.fixture(scope="module")
def beams():
    with np.errstate(all="ignore"):
        yield family(BEAMS)


@pytest.fixture(scope="module", params=STRUCTURES, ids=str)
def some(request):
    with np.errstate(all="ignore"):
        yield family(request.param)


def test_spectrum(beams):
    """More lanes than are kept side by side; starts and steps are as good as those of the NumPy path."""
    groups, one = arms(12, 150), np.empty((150, 6))
    with np.errstate(all="ignore"):
        evaluations = beams.fill_compiled(one, *groups)
    assert 2.0 < evaluations / np.count_nonzero(one) < 2.45
    two = beams.frequency_parameters(*groups, modes=6, compile=False, threads=1)
    assert ((one == 0) == (two == 0)).all()
    np.testing.assert_allclose(one, two, rtol=2e-15)


def test_spectrum_of_any_ends(some):
    groups, one = lines(some.structure, 18, 140), np.empty((140, 5))
    with np.errstate(all="ignore"):
        some.fill_compiled(one, *groups)
    two = some.frequency_parameters(*groups, modes=5, compile=False, threads=1)
    assert ((one == 0) == (two == 0)).all()
    np.testing.assert_allclose(one, two, rtol=1e-13)


def test_spectrum_of_extreme_arms(beams):
    """First zeros orders below all points where zeros are counted, and two of about one size in one interval."""
    rng = np.random.default_rng(15)
    z = 10.0 ** rng.uniform(-2.8, 0.2, 80)
    root, turn, stiff, mu = (10.0 ** rng.uniform(*ends, 80) for ends in ((-0.2, 0.2), (-0.2, 0.2), (2, 5), (-3, -1)))
    # the second zero and the third in one interval; the first two in the first one, far apart
    some = [16.0, 3.2, 25.0, 3e-11], [1.2, 0.69, 7000.0, 4.4e-11], [0.22, 0.15, 0.51, 0.013], [0.068, 0.038, 0.27, 89.0]
    for extreme in (
        arms(24, 100, (-12, 14), (-8, 9)),
        (z * root, stiff, mu, turn / z),
        np.array(some),
    ):
        one = np.empty((len(extreme[0]), 2))
        with np.errstate(all="ignore"):
            beams.fill_compiled(one, *extreme)
        two = beams.frequency_parameters(*extreme, modes=2, compile=False, threads=1)
        np.testing.assert_allclose(one, two, rtol=1e-10)


def test_spectrum_of_many_modes(beams):
    groups, one = arms(16, 2), np.empty((2, 60))
    with np.errstate(all="ignore"):
        beams.fill_compiled(one, *groups)
    two = beams.frequency_parameters(*groups, modes=60, compile=False, threads=1)
    np.testing.assert_allclose(one, two, rtol=2e-15)


def rows(made):
    """Rows of coefficients and power series, twice."""
    return 2 * sum(len(made.functions[name].layout) for name in ("coefficients", "power_series"))


def test_the_count_does_not_jump_at_multiples_of_pi(beams):
    """There the beam pinned at both ends, whose zeros they are, has one more; rounding must not decide for the arm."""
    template, pairs = beams.compiled_spectrum, np.empty((8, 12))
    rng = np.random.default_rng(17)
    groups = (10.0 ** rng.uniform(*ends, 12) for ends in ((0, 5), (-1, 3), (-2, 0), (-3, -1)))
    template._prepare(pairs, np.zeros((rows(beams), 12)), np.empty(12, dtype=np.int64), *groups, 0, 12)

    def count(lane, lam):
        return template._count(pairs, lane, lam, lam**4, *template._scaled_basis(lam, lam**4))[0]

    for lane in range(12):
        for turns in range(1, 9):
            lam = turns * np.pi
            around = {count(lane, lam * (1.0 + step * 1.2e-16)) for step in range(-4, 5)}
            assert around == {count(lane, lam * (1.0 - 1e-9))} == {count(lane, lam * (1.0 + 1e-9))}


def test_zeros_are_counted_anywhere(some):
    """Not only at the points that the search begins with, and by another arithmetic than the NumPy path's."""
    template, groups = some.compiled_spectrum, lines(some.structure, 13, 120)
    pairs, zeros = np.empty((len(some.layout.parameters), 120)), np.empty(120, dtype=np.int64)
    # plain numbers: two truths of NumPy add up to one truth, those of Python and of machine code to two
    with np.errstate(all="ignore"):
        template._prepare(pairs, np.zeros((rows(some), 120)), zeros, *(group.tolist() for group in groups), 0, 120)
    characteristic, power = some.characteristic(*groups), 2 * some.layout.n
    np.testing.assert_array_equal(zeros, characteristic.zeros)
    lam = np.random.default_rng(14).uniform(0.05, 20.0, 120)
    points = [(lane, x, x**power) for lane, x in enumerate(lam)]
    found = [template._count(pairs, lane, x, z, *template._scaled_basis(x, z))[0] for lane, x, z in points]
    np.testing.assert_array_equal(found, characteristic.count(lam**power, slice(None))[0])


def test_modes(some):
    """More lanes than are kept side by side, by one."""
    groups = [group.reshape(5, 13) for group in lines(some.structure, 11, 65)]
    lam, table = some.frequency_parameters(*groups, modes=4, compile=False), some.layout
    one, two = (some.modes(*groups, lam=lam, compile=c, threads=1) for c in (True, False))
    units = np.linspace(1, 2, table.by_inertias.stop * 65).reshape(-1, 5, 13)
    with np.errstate(all="ignore"):
        for order in range(2 * table.n):
            size = np.maximum(lam[..., None], 1) ** order
            xi = np.linspace(0, 1, 5)
            np.testing.assert_allclose(one.shape(xi, order) / size, two.shape(xi, order) / size, atol=1e-11)
        for first, last in ((0, table.state.start), (table.strain.start, table.size), (table.size, len(units))):
            wanted = slice(first, last)
            expected = two.quantities(wanted)
            size = 1e-12 * np.nanmax(np.abs(np.where(np.isfinite(expected), expected, 0)), initial=1.0)
            np.testing.assert_allclose(one.quantities(wanted), expected, rtol=1e-9, atol=size)
            scaled = two.quantities(wanted, units[wanted])
            np.testing.assert_allclose(one.quantities(wanted, units[wanted]), scaled, rtol=1e-9, atol=2 * size)


@pytest.mark.parametrize("loose", [1, 15])
def test_a_mode_that_needs_another_basis_than_those_beside_it(loose, beams):
    """The second mode of a loose arm is a rigid body's, in power series, and that of a rigid joint in waves."""
    stiffness = np.where(np.arange(16) < loose, 0.0, np.inf)
    groups = stiffness, stiffness, np.full(16, 0.1), np.zeros(16)
    lam, ends = cra.frequency_parameters(*groups, modes=2), slice(0, beams.layout.size)
    with np.errstate(all="ignore"):
        one, two = (beams.modes(*groups, lam=lam, compile=c, threads=1).quantities(ends) for c in (True, False))
    np.testing.assert_allclose(one, two, rtol=1e-12, atol=1e-10)


@pytest.mark.parametrize("kind", ["stiffness", "soft", "damper", "mass", "masses", "several", "none", "nothing"])
def test_series_of_periodic_systems(kind):
    """Three steps of few systems; what is common to all of them or not, and of low rank or not."""
    rng = np.random.default_rng(8)
    points, wave = 3, floquet.Oscillation(1, "cos", 0)
    still, drag = np.diag([1.0, 3.0]), 0.1 * rng.normal(size=(2, 2))
    if kind in ("damper", "stiffness", "soft"):  # for the last two half a period gives the other
        drag = 0.1 * np.ones((2, 2))
    some, others = (0.1 * rng.normal(size=(4, 2, 2)) for _ in range(2))
    drives = {
        "stiffness": [(wave, (some[0] + some[0].T, None, None, None))],
        "soft": [(wave, (part + part.T, None, None, None)) for part in others[:2]],
        "damper": [(wave, (None, np.ones((2, 2)), None, None))],
        "mass": [(wave, (None, None, None, 0.2 * np.eye(2)))],
        "masses": [(wave, some), (floquet.Oscillation(2, "sin", 1), others)],
        "several": [(wave, [0.1 * rng.normal(size=(points, 2, 2)), None, some[1], some[2]])],
        "none": [(wave, (np.zeros((2, 2)), None, None, None))],
        "nothing": [],
    }[kind]
    soft = [0.9, 0.2] if kind == "soft" else None
    system, _ = periodic.PeriodicSystem.of(still, drag, drives, np.linspace(2.0, 3.0, points), 0.3, soft)
    assert (system.parity() is not None) == (kind in ("stiffness", "soft"))
    loop = plain("solvers/taylor_lanes", *growth._template_parts()).propagate
    one, two = (periodic.monodromy(system, 1e-3, found) for found in (loop, None))
    # the same series, but steps may end one coefficient earlier or later, which is within the tolerance
    np.testing.assert_allclose(one, two, rtol=0.0, atol=1e-3 * np.abs(two).max())
    one, two = (periodic.monodromy(system, 1e-15, found) for found in (loop, None))
    np.testing.assert_allclose(one, two, rtol=0.0, atol=1e-13 * np.abs(two).max())
