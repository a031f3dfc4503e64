"""The templates that Numba compiles are plain Python: run as such they give what the NumPy path gives."""

from pathlib import Path

import numpy as np
import pytest

import cra_sym as cra
from cra_sym.analysis import stability
from cra_sym.kernels import specialise
from cra_sym.model import modal, spectrum
from cra_sym.solvers import floquet


def plain(template, kernels):
    """Return the template's functions as Python reads them, in the name of its file."""
    files = Path(cra.__file__).parent.glob("*/*_lanes.py")
    file = next(file for file in files if file.read_text(encoding="utf-8") == template)
    names = {}
    with np.errstate(all="ignore"):
        exec(specialise._prelude(kernels, True), names)
        exec(compile(template, file, "exec"), names)
    return type("Template", (), {name: staticmethod(value) for name, value in names.items() if callable(value)})


def arms(seed, size, stiffness=(-3, 6), inertia=(-3, 3)):
    rng = np.random.default_rng(seed)

    def draw(low, high, *ends):
        return np.where(rng.random(size) < 0.3, rng.choice(ends, size), 10.0 ** rng.uniform(low, high, size))

    return draw(*stiffness, 0.0, np.inf), draw(*stiffness, 0.0, np.inf), draw(*inertia, 0.0), draw(*inertia, 0.0)


@pytest.fixture
def groups(monkeypatch):
    for module in (spectrum, modal):
        template = plain(*module._template_parts())
        monkeypatch.setattr(module, "_template", lambda template=template: template)
    with np.errstate(all="ignore"):
        yield arms(11, 65)


def test_spectrum(groups):
    """More lanes than are kept side by side; starts and steps are as good as those of the NumPy path."""
    groups, one = arms(12, 150), np.empty((150, 6))
    evaluations = spectrum._fill_compiled(one, *groups)
    assert 2.0 < evaluations / np.count_nonzero(one) < 2.45
    two = spectrum.frequency_parameters(*groups, modes=6, compile=False, threads=1)
    assert ((one == 0) == (two == 0)).all()
    np.testing.assert_allclose(one, two, rtol=2e-15)


def test_spectrum_of_extreme_arms(groups):
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
        spectrum._fill_compiled(one, *extreme)
        two = spectrum.frequency_parameters(*extreme, modes=2, compile=False, threads=1)
        np.testing.assert_allclose(one, two, rtol=1e-10)


def test_spectrum_of_many_modes(groups):
    groups, one = arms(16, 2), np.empty((2, 60))
    spectrum._fill_compiled(one, *groups)
    two = spectrum.frequency_parameters(*groups, modes=60, compile=False, threads=1)
    np.testing.assert_allclose(one, two, rtol=2e-15)


def test_the_count_does_not_jump_at_multiples_of_pi(groups):
    """There the beam pinned at both ends, whose zeros they are, has one more; rounding must not decide for the arm."""
    template, pairs = spectrum._template(), np.empty((8, 12))
    rng = np.random.default_rng(17)
    arms = (10.0 ** rng.uniform(*ends, 12) for ends in ((0, 5), (-1, 3), (-2, 0), (-3, -1)))
    template._prepare(pairs, np.zeros((44, 12)), np.empty(12, dtype=np.int64), *arms, 0, 12)

    def count(lane, lam):
        return template._count(pairs, lane, lam, lam**4, *template._scaled_basis(lam, lam**4))[0]

    for lane in range(12):
        for turns in range(1, 9):
            lam = turns * np.pi
            around = {count(lane, lam * (1.0 + step * 1.2e-16)) for step in range(-4, 5)}
            assert around == {count(lane, lam * (1.0 - 1e-9))} == {count(lane, lam * (1.0 + 1e-9))}


def test_zeros_are_counted_anywhere(groups):
    """Not only at the points that the search begins with, and by another arithmetic than the NumPy path's."""
    template, groups = spectrum._template(), arms(13, 120)
    pairs, zeros = np.empty((8, 120)), np.empty(120, dtype=np.int64)
    # plain numbers: two truths of NumPy add up to one truth, those of Python and of Numba to two
    template._prepare(pairs, np.zeros((44, 120)), zeros, *(group.tolist() for group in groups), 0, 120)
    np.testing.assert_array_equal(zeros, (groups[0] == 0.0).astype(int) + (groups[1] == 0.0))
    lam = np.random.default_rng(14).uniform(0.05, 20.0, 120)
    found = [template._count(pairs, lane, x, x**4, *template._scaled_basis(x, x**4))[0] for lane, x in enumerate(lam)]
    np.testing.assert_array_equal(found, spectrum.ArmCharacteristic(*groups).count(lam**4, slice(None))[0])


def test_modes(groups):
    """More arms than are kept side by side, by one."""
    groups = [group.reshape(5, 13) for group in groups]
    lam = cra.frequency_parameters(*groups, modes=4)
    one, two = (modal.modes_of(*groups, lam=lam, compile=c, threads=1) for c in (True, False))
    for order in range(4):
        size = np.maximum(lam[..., None], 1) ** order
        xi = np.linspace(0, 1, 5)
        np.testing.assert_allclose(one.shape(xi, order) / size, two.shape(xi, order) / size, atol=1e-12)
    for rows in (modal.ENDS, modal.STATE, modal.STRAIN, modal.SPRINGS, modal.COMPLIANCES, modal.INERTIAS):
        np.testing.assert_allclose(one.quantities(rows), two.quantities(rows), rtol=1e-10, atol=1e-13)
    units = np.linspace(1, 2, 4 * 65).reshape(4, 5, 13)
    np.testing.assert_allclose(
        one.quantities(modal.SPRINGS, units), two.quantities(modal.SPRINGS, units), rtol=1e-10, atol=1e-13
    )


@pytest.mark.parametrize("loose", [1, 15])
def test_a_mode_that_needs_another_basis_than_those_beside_it(loose, groups):
    """The second mode of a loose arm is a rigid body's, in power series, and that of a rigid joint in waves."""
    stiffness = np.where(np.arange(16) < loose, 0.0, np.inf)
    groups = stiffness, stiffness, np.full(16, 0.1), np.zeros(16)
    lam = cra.frequency_parameters(*groups, modes=2)
    one, two = (modal.modes_of(*groups, lam=lam, compile=c, threads=1).quantities(modal.ENDS) for c in (True, False))
    np.testing.assert_allclose(one, two, rtol=1e-12, atol=1e-13)


def test_floquet():
    coupling = np.array([[[1.0, 0.4], [0.3, -0.7]], [[0.2, 0.1], [0.1, 0.5]], [[0.0, 0.3], [-0.2, 0.1]]])
    system = (np.array([1.0, 2.2]), coupling, np.array([1.9, 3.1, 4.2, 5.0]), 0.3, np.array([0.01, 0.03]))
    one, two = (
        floquet.monodromy(*system, compliance=np.array([0.5, 0.2, 0.3]), tolerance=1e-4, loop=loop)
        for loop in (plain(*stability._template_parts()).kick_and_drift, None)
    )
    np.testing.assert_allclose(one, two, rtol=1e-11, atol=1e-13)
