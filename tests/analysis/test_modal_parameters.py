"""Mode shapes and modal quantities: orthonormality by quadrature, boundary conditions, limits, units, bad input."""

import subprocess
import sys

import numpy as np
import pytest
import sympy as sp
from numpy.polynomial.legendre import leggauss

import cra_sym as cra
from cra_sym.codegen.arm_family import arm_family
from cra_sym.kernels import has_compiler
from cra_sym.mechanics import one_wave as derived
from cra_sym.mechanics import one_wave_shapes as derived_shapes
from cra_sym.solvers import one_wave, one_wave_shapes

NOMINAL = cra.Arm.nominal()
MODES = 6


def extreme_arms(seed=0, size=80):
    rng = np.random.default_rng(seed)

    def draw(low, high, ends):
        values = 10.0 ** rng.uniform(low, high, size)
        return np.where(rng.random(size) < 0.3, rng.choice(ends, size), values)

    stiff = (0.0, np.inf)
    return NOMINAL.replace(
        L=rng.uniform(0.2, 3, size), k_t=draw(-8, 13, stiff), k_r=draw(-8, 13, stiff),
        m_e=draw(-9, 5, (0.0,)), J_e=draw(-9, 5, (0.0,)),
    )  # fmt: skip


@pytest.fixture(scope="module")
def arm():
    return extreme_arms()


@pytest.fixture(scope="module")
def parameters(arm):
    return cra.modal_parameters(arm, MODES)


@pytest.fixture(scope="module")
def quadrature(arm):
    """Shapes and slopes and curvatures at Gauss points of each arm, evaluated arm by arm in physical coordinates."""
    nodes, weights = leggauss(60)
    nodes, weights = (1 + nodes) / 2, weights / 2
    derivatives = []
    for order in range(3):
        rows = [cra.mode_shapes(one(arm, i), one(arm, i).L * nodes, MODES, order) for i in range(arm.shape[0])]
        derivatives.append(np.array(rows))
    return derivatives, weights * np.asarray(arm.L)[:, None]


def one(arm, i):
    return cra.Arm(**{name: np.broadcast_to(getattr(arm, name), arm.shape)[i] for name in arm._names()})


def column(value, arm):
    return np.broadcast_to(value, arm.shape)[:, None]


def matrix(values):
    return values[..., :, None] * values[..., None, :]


def test_orthonormal_with_the_end_effector(arm, parameters, quadrature):
    (shape, _, _), weights = quadrature
    gram = np.einsum("nik,nk,njk->nij", shape, weights * column(arm.rhoA, arm), shape)
    gram += column(arm.m_e, arm)[..., None] * matrix(parameters.tip_displacement)
    gram += column(arm.J_e, arm)[..., None] * matrix(parameters.tip_slope)
    np.testing.assert_allclose(gram, np.broadcast_to(np.eye(MODES), gram.shape), atol=2e-13)


def test_modal_stiffness_is_the_squared_frequency(arm, parameters, quadrature):
    (_, _, curvature), weights = quadrature
    K = np.einsum("nik,nk,njk->nij", curvature, weights * column(arm.EI, arm), curvature)
    K += parameters.stiffness_translation + parameters.stiffness_rotation
    scale = np.where(matrix(parameters.omega) > 0, matrix(parameters.omega), 1.0)
    np.testing.assert_allclose(K / scale, np.eye(MODES) * (parameters.omega > 0)[:, None], atol=2e-13)


def test_participation(arm, parameters, quadrature):
    (shape, _, _), weights = quadrature
    integral = np.einsum("nik,nk->ni", shape, weights * column(arm.rhoA, arm))
    integral += column(arm.m_e, arm) * parameters.tip_displacement
    total = np.sqrt(column(arm.rhoA, arm) * column(arm.L, arm) + column(arm.m_e, arm))
    np.testing.assert_allclose(parameters.participation / total, integral / total, atol=1e-12)


def test_the_waves_are_those_of_the_shapes():
    modes = NOMINAL.replace(k_t=1e3, k_r=50.0).modes(MODES).dimensionless
    far = modes.lam**4 > one_wave_shapes.NEAR[2]
    lam, xi = modes.lam[far, None], np.linspace(0, 1, 7)
    waves = np.array([np.cos(lam * xi), np.sin(lam * xi), np.exp(-lam * xi), np.exp(-lam * (1 - xi))])
    written_out = np.sum(modes.state[4:, far, None] * waves, axis=0)
    np.testing.assert_allclose(modes.shape(xi)[far], written_out, atol=1e-12)


def test_axial_matrix(arm, parameters, quadrature):
    (_, slope, _), weights = quadrature
    nodes = (1 + leggauss(60)[0]) / 2
    load = column(arm.rhoA, arm) * column(arm.L, arm) * (1 - nodes) + column(arm.m_e, arm)
    expected = np.einsum("nik,nk,njk->nij", slope, weights * load, slope)
    size = np.abs(expected).max(axis=(1, 2), keepdims=True)
    np.testing.assert_allclose(parameters.axial / size, expected / size, atol=1e-12)
    assert (parameters.axial == parameters.axial.swapaxes(-1, -2)).all()


def test_boundary_conditions(arm, parameters):
    k_t, k_r = column(arm.k_t, arm), column(arm.k_r, arm)
    shear, moment = parameters.root_shear, parameters.root_moment
    displacement, slope = parameters.root_displacement, parameters.root_slope
    for k, force, give in ((k_t, -shear, displacement), (k_r, moment, slope)):
        elastic = np.flatnonzero(np.isfinite(k[:, 0]) & (k[:, 0] > 0))
        np.testing.assert_allclose(force[elastic] / k[elastic], give[elastic], rtol=1e-12, atol=1e-300)
    assert (displacement[np.isinf(k_t[:, 0])] == 0).all() and (slope[np.isinf(k_r[:, 0])] == 0).all()
    assert (shear[k_t[:, 0] == 0] == 0).all() and (moment[k_r[:, 0] == 0] == 0).all()


def test_end_values_are_those_of_the_shapes(arm, parameters):
    length = float(np.min(arm.L))
    arm = arm.replace(L=length)
    parameters = cra.modal_parameters(arm, MODES)
    ends = [cra.mode_shapes(arm, [0.0, length], MODES, order) for order in range(4)]
    size = np.sqrt(parameters.omega[..., None] + 1) * np.abs(ends[0]).max()
    names = {"root_displacement": 1.0, "root_slope": 1.0, "root_moment": arm.EI, "root_shear": arm.EI}
    for order, (name, unit) in enumerate(names.items()):
        scale = (unit * size * (parameters.lam[..., None] / length + 1) ** order)[..., 0]
        np.testing.assert_allclose(getattr(parameters, name) / scale, unit * ends[order][..., 0] / scale, atol=1e-13)
    np.testing.assert_allclose(parameters.tip_displacement / size[..., 0], ends[0][..., 1] / size[..., 0], atol=1e-13)
    assert (parameters.tip_displacement >= 0).all()


def test_three_modes_of_a_tip_without_inertia_unless_asked_for_more():
    lam = cra.frequency_parameters(40.0, 3.0, 0.2)
    np.testing.assert_array_equal(lam, cra.frequency_parameters(40.0, 3.0, 0.2, 0.0, modes=3))
    shapes = cra.mode_shapes(NOMINAL, 0.5)
    np.testing.assert_array_equal(shapes, cra.mode_shapes(NOMINAL, [0.5], modes=3, derivative=0)[:, 0])
    for number in (
        cra.natural_frequencies(NOMINAL),
        cra.modal_parameters(NOMINAL).omega,
        cra.sensitivities(NOMINAL).frequency,
    ):
        assert number.shape == (3,)


def test_a_textbook_cantilever():
    """The tip swings twice the root of the mean square; the mean is 2 / lambda (sinh - sin) / (cosh + cos)."""
    arm = NOMINAL.replace(m_e=0.0)
    p, mass = cra.modal_parameters(arm), np.sqrt(arm.rhoA * arm.L)
    np.testing.assert_allclose(p.tip_displacement * mass, 2.0, rtol=1e-12)
    mean = 2 / p.lam * (np.sinh(p.lam) - np.sin(p.lam)) / (np.cosh(p.lam) + np.cos(p.lam))
    np.testing.assert_allclose(p.participation / mass, mean * [1, -1, 1], rtol=1e-12)


def test_high_modes_stay_orthonormal():
    arm = NOMINAL.replace(k_t=1e3, k_r=1e2)
    nodes, weights = leggauss(400)
    shape = cra.mode_shapes(arm, (1 + nodes) / 2, 100)
    p = cra.modal_parameters(arm, 100)
    gram = np.einsum("ik,k,jk->ij", shape, weights / 2 * arm.rhoA, shape) + arm.m_e * matrix(p.tip_displacement)
    np.testing.assert_allclose(gram, np.eye(100), atol=1e-11)
    last = cra.mode_shapes(arm, [0.0, 0.5, 1.0], 1000)[-1]
    assert np.isfinite(last).all() and np.abs(last).max() < 5


def test_shapes_meet_between_the_two_bases(monkeypatch):
    """The power series and the exponentials describe the same modes on either side of where one takes over."""
    groups = [np.array(x) for x in ((3.0, 50.0, 1e3), (2.0, 0.1, np.inf), (0.1, 2.0, 0.0), (0.0, 0.3, 0.01))]
    lam = np.array([cra.frequency_parameters(*(g[i] for g in groups), modes=3) for i in range(3)])
    xi = np.linspace(0, 1, 7)
    results = []
    for near in (12.0, 60.0):
        monkeypatch.setitem(one_wave_shapes.NEAR, 2, near)
        results.append(arm_family().modes(*groups, lam=lam).shape(xi))
    np.testing.assert_allclose(*results, atol=1e-12)


def test_free_arm_translates_and_rotates():
    arm = NOMINAL.replace(k_t=0.0, k_r=0.0, m_e=0.1)
    shape = cra.mode_shapes(arm, [0.0, 0.5, 1.0], 2)
    mass = arm.rhoA * arm.L
    centre = (mass / 2 + arm.m_e) / (mass + arm.m_e)
    np.testing.assert_allclose(shape[0], 1 / np.sqrt(mass + arm.m_e), rtol=1e-14)
    assert shape[1, 0] < 0 < shape[1, 2]
    assert np.interp(centre, [0, 1], shape[1, [0, 2]]) == pytest.approx(0, abs=1e-14)
    np.testing.assert_allclose(cra.modal_parameters(arm, 2).participation, [np.sqrt(mass + arm.m_e), 0], atol=1e-14)


def test_nearly_rigid_modes_are_as_good():
    """Springs a million million times too soft to bend the arm: displacement and slope of a rigid bar, all digits."""
    soft = cra.modal_parameters(NOMINAL.replace(k_t=1e-13, k_r=np.inf), 1)
    free = cra.modal_parameters(NOMINAL.replace(k_t=0.0, k_r=np.inf), 1)
    assert soft.omega[0] == pytest.approx(np.sqrt(1e-13 / (0.243 + 0.001)), rel=1e-12)
    assert soft.tip_displacement[0] == pytest.approx(free.tip_displacement[0], rel=1e-12)
    assert soft.participation[0] == pytest.approx(free.participation[0], rel=1e-12)
    assert soft.stiffness_translation[0, 0] == pytest.approx(soft.omega[0] ** 2, rel=1e-12)


def test_sensitivity_of_the_squared_frequency_is_the_squared_root_displacement():
    arm = NOMINAL.replace(k_t=500.0, k_r=20.0, J_e=1e-5)
    p = cra.modal_parameters(arm)
    for name, square in (("k_t", p.root_displacement**2), ("k_r", p.root_slope**2)):
        k, h = getattr(arm, name), 1e-4
        up, down = (cra.modal_parameters(arm.replace(**{name: k * (1 + s * h)})).omega ** 2 for s in (1, -1))
        np.testing.assert_allclose((up - down) / (2 * h * k), square, rtol=1e-6)


def test_frequencies_of_the_nominal_arm():
    np.testing.assert_allclose(
        cra.natural_frequencies(NOMINAL.replace(m_e=0)), [2.448, 15.339, 42.950], rtol=0, atol=5e-4
    )
    assert cra.natural_frequencies(NOMINAL)[0] == pytest.approx(2.428, abs=5e-4)
    p = cra.modal_parameters(NOMINAL)
    np.testing.assert_allclose(p.frequency, cra.natural_frequencies(NOMINAL), rtol=1e-15)
    np.testing.assert_allclose(p.omega, 2 * np.pi * p.frequency, rtol=1e-15)


def test_batch_axes():
    arm = NOMINAL.replace(k_t=np.geomspace(1, 1e6, 4)[:, None], m_e=[0.0, 1e-3, 5e-3])
    p = cra.modal_parameters(arm, 2)
    assert p.omega.shape == (4, 3, 2) and p.axial.shape == p.stiffness_rotation.shape == (4, 3, 2, 2)
    assert cra.mode_shapes(arm, np.linspace(0, 1, 5), 2).shape == (4, 3, 2, 5)
    assert cra.mode_shapes(arm, 0.5, 2).shape == (4, 3, 2)
    single = cra.modal_parameters(arm.replace(k_t=1.0, m_e=5e-3), 2)
    for name in ("omega", "participation", "root_moment", "tip_slope", "axial", "stiffness_translation"):
        np.testing.assert_allclose(getattr(p, name)[0, 2], getattr(single, name), rtol=1e-12)
    beams = arm.replace(L=[0.5, 1.0, 2.0], rho=np.geomspace(1e3, 8e3, 4)[:, None])
    shapes = cra.mode_shapes(beams, [0.1, 0.5], 2, derivative=1)
    one = beams.replace(k_t=float(beams.k_t[1, 0]), m_e=5e-3, L=2.0, rho=float(beams.rho[1, 0]))
    np.testing.assert_allclose(shapes[1, 2], cra.mode_shapes(one, [0.1, 0.5], 2, derivative=1), rtol=1e-12)
    empty = cra.modal_parameters(NOMINAL.replace(k_t=np.ones((0,))), 2)
    assert empty.omega.shape == (0, 2) and empty.axial.shape == (0, 2, 2)


def test_closed_form_mass_follows_from_the_field_equation():
    """d/dx [3 y y''' - y' y'' + x H] = 4 z y^2 and dH/dx = 0, with H = y''^2 - 2 y' y''' + z y^2 and y'''' = z y."""
    x, z = sp.symbols("x z")
    y = sp.Function("y")(x)
    d = [y.diff(x, n) if n else y for n in range(5)]
    invariant = d[2] ** 2 - 2 * d[1] * d[3] + z * y**2
    concomitant = 3 * y * d[3] - d[1] * d[2] + x * invariant
    field = {d[4]: z * y}
    assert sp.expand(invariant.diff(x).subs(field)) == 0
    assert sp.expand(concomitant.diff(x).subs(field) - 4 * z * y**2) == 0


def test_ranges_of_the_numbers_are_those_of_the_derivation():
    assert one_wave_shapes.NEAR == derived_shapes.NEAR and one_wave.NEAR == derived.NEAR


@pytest.mark.parametrize(
    ("call", "error", "message"),
    [
        (lambda: cra.mode_shapes(NOMINAL, 1.001), ValueError, r"x = 1.001 must be in the domain, \[0, 1\]"),
        (lambda: cra.mode_shapes(NOMINAL, -0.1), ValueError, "x = -0.1"),
        (lambda: cra.mode_shapes(NOMINAL, [[0.1]]), ValueError, r"x has shape \(1, 1\)"),
        (lambda: cra.mode_shapes(NOMINAL, "tip"), TypeError, "x = 'tip'"),
        (lambda: cra.mode_shapes(NOMINAL, 0.5, derivative=21), ValueError, "derivative = 21"),
        (lambda: cra.mode_shapes(NOMINAL, 0.5, derivative=-1), ValueError, "derivative = -1"),
        (lambda: cra.mode_shapes(NOMINAL, 0.5, modes=0), ValueError, "modes = 0"),
        (lambda: cra.mode_shapes(NOMINAL, 0.5, modes=1001), ValueError, "modes = 1001: must be .* 1 to 1000"),
        (lambda: cra.natural_frequencies(1.0), TypeError, "system = 1.0"),
        (lambda: cra.modal_parameters(NOMINAL, 1.5), ValueError, "modes = 1.5"),
    ],
)
def test_bad_input(call, error, message):
    with pytest.raises(error, match=message):
        call()


@pytest.mark.skipif(not has_compiler(), reason="llvmlite is an option")
def test_compiled_and_numpy_paths_agree(arm):
    groups = [np.broadcast_to(x, arm.shape) for x in (arm.kappa_t, arm.kappa_r, arm.mu, arm.iota)]
    lam = cra.frequency_parameters(*groups, modes=MODES)
    arms = arm_family()
    one, two = (arms.modes(*groups, lam=lam, compile=c, threads=2) for c in (True, False))
    xi = np.linspace(0, 1, 9)
    for order in range(4):
        size = np.maximum(lam[..., None], 1) ** order
        np.testing.assert_allclose(one.shape(xi, order) / size, two.shape(xi, order) / size, atol=1e-13)
    table = arms.layout
    for rows in (slice(0, table.waves.start), table.strain, slice(table.size, table.by_inertias.stop)):
        np.testing.assert_allclose(one.quantities(rows), two.quantities(rows), rtol=1e-11, atol=1e-14)


def test_numbers_need_no_sympy_once_derived():
    code = (
        "import sys, cra_sym as cra; arm = cra.Arm.nominal(); cra.modal_parameters(arm).axial; "
        "cra.mode_shapes(arm, 0.5); print('sympy' in sys.modules, 'llvmlite' in sys.modules)"
    )
    for _ in range(2):  # the first run derives what the store does not hold yet
        run = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert run.stdout.split() == ["False", "False"]
