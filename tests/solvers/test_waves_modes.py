"""Mode shapes of two waves a section: orthonormal by quadrature, solutions of the equations, known ones."""

from __future__ import annotations

import numpy as np
import pytest

from cra_sym.solvers.shapes import mode_states
from cra_sym.solvers.waves import lowest_waves
from cra_sym.solvers.waves_modes import WaveShapes
from tests.solvers.test_waves import (
    FREE,
    HELD,
    HINGED,
    coupled_strings,
    random_beam,
    random_bending_and_torsion,
    random_string,
)
from tests.solvers.wave_problems import INF, beams, end_matrices, positions, stiffness, system

NODES, WEIGHTS = np.polynomial.legendre.leggauss(200)
ENDS = np.array([0.0, 1.0])


def inner_products(problem, states):
    """Return the mass matrix of modes whose states stand at the Gauss points, then at both ends."""
    n, m = len(problem.odd), problem.coordinates
    mass = -system(problem)[1, 0, n:, :n]  # P' = ... - z mass q
    inside = states[:, :-2, :n]
    total = np.einsum("isa,ab,jsb,s->ij", inside, mass, inside, WEIGHTS * problem.length[0] / 2)
    motion = np.concatenate([states[:, -2, : n + m], states[:, -1, :n]], axis=1)
    return total + motion @ end_matrices(problem)[1][0] @ motion.T


def random_soft_beam(rng):
    return random_beam(rng, -2, 3)


@pytest.mark.parametrize(
    ("seed", "kind"),
    [(seed, random_soft_beam) for seed in range(30)]
    + [(seed, kind) for seed in range(8) for kind in (random_string, random_bending_and_torsion)],
)
def test_modes_are_orthonormal(seed, kind):
    problem = kind(np.random.default_rng(seed))
    z = lowest_waves(problem, 5)
    states = WaveShapes(problem, z).states(np.concatenate([(NODES + 1) / 2, ENDS])[None])[0]
    # close neighbours mix by the rounding of their roots over their distance
    close = np.min(np.diff(z[0]) / z[0, 1:]) + 1e-3
    size = 1.0 if kind is random_soft_beam else 1e2  # roots of three waves are good to 1e-13
    np.testing.assert_allclose(inner_products(problem, states), np.eye(5), atol=size * (1e-13 + 1e-15 / close**2))


@pytest.mark.parametrize("seed", range(30))
def test_modes_meet_equations_and_end_conditions(seed):
    problem = random_beam(np.random.default_rng(100 + seed), -2, 3)
    z, (e, o) = lowest_waves(problem, 4), positions(problem)
    step = 1e-3
    share = 0.4 + step * np.arange(-2, 3)
    states = WaveShapes(problem, z).states(np.concatenate([share, ENDS, np.linspace(0.1, 0.9, 9)])[None])[0]
    system = np.zeros((4, 4, 4))
    system[np.ix_(range(4), o, e)] = problem.odd_by_even[0] + z[0, :, None, None] * problem.odd_by_even[1]
    system[np.ix_(range(4), e, o)] = problem.even_by_odd[0] + z[0, :, None, None] * problem.even_by_odd[1]
    slope = states[:, :5].transpose(0, 2, 1) @ np.array([1, -8, 0, 8, -1]) / (12 * step * problem.length[0])
    rate = (system @ states[:, 2, :, None])[..., 0]
    largest = np.abs(system) @ np.abs(states[:, 2, :, None])
    # the difference quotient: (k L step)^4 / 30 of a derivative, and its rounding
    bound = (np.abs(np.linalg.eigvals(system)).max(axis=1) * problem.length[0] * step) ** 4 / 3 + 1e-11
    size = np.maximum(largest[..., 0], np.abs(states[:, :5]).max(axis=1))
    assert (np.abs(slope - rate) <= bound[:, None] * size).all()
    for end, sign in ((0, -1.0), (1, 1.0)):
        q, force = states[:, 5 + end, :2], states[:, 5 + end, 2:]
        spring, mass = (values[0, 2 * end : 2 * end + 2] for values in (problem.stiffness, problem.mass))
        held = np.isinf(spring)
        size = np.abs(states).max(axis=1)
        assert (np.abs(q[:, held]) <= 1e-12 * size[:, :2][:, held]).all()
        rest = sign * force + (np.where(held, 0.0, spring) - z[0, :, None] * mass) * q
        scale = size[:, 2:] + (np.where(held, 0.0, spring) + z[0, :, None] * mass) * size[:, :2]
        noise = 1e-14 * np.abs(states[..., 2:]).max()  # forces of rigid modes are rounding of what others have
        assert (np.abs(rest) <= 1e-11 * scale + noise)[:, ~held].all()


@pytest.mark.parametrize("seed", range(10))
def test_modes_are_those_of_the_dynamic_stiffness(seed):
    problem = random_beam(np.random.default_rng(200 + seed), -1, 3)
    z = lowest_waves(problem, 4)
    if (z == 0.0).sum() > 1 or np.diff(z[0]).min() < 1e-3 * z[0, -1]:
        return
    share = np.linspace(0.0, 1.0, 7)[None]
    found, other = WaveShapes(problem, z).states(share)[0], mode_states(stiffness(problem), z, share)[0]
    sign = np.sign((found[..., :2] * other[..., :2]).sum(axis=(1, 2)))[:, None, None]
    size = np.abs(found).max(axis=1, keepdims=True)
    np.testing.assert_allclose((found / size)[..., :2], (sign * other / size)[..., :2], atol=1e-7)


def test_known_shapes():
    z = lowest_waves(beams(HELD), 3)
    tip = WaveShapes(beams(HELD), z).states(ENDS[None])[0, :, :, 0]
    np.testing.assert_allclose(np.abs(tip), [[0.0, 2.0]] * 3, atol=1e-12)
    share = np.linspace(0.0, 1.0, 9)[None]
    problem = beams(HINGED, HINGED, tension=1e7)
    shape = WaveShapes(problem, lowest_waves(problem, 4)).states(share)[0, :, :, 0]
    exact = np.sqrt(2.0) * np.sin(np.arange(1, 5)[:, None] * np.pi * share)
    np.testing.assert_allclose(shape * np.sign(shape[:, 1:2]), exact, atol=1e-12)


def test_boundary_layers_of_a_stiff_cable():
    """Tension 1e8: the shape of a string but for layers of 1e-4 L at the ends, to which nothing overflows."""
    problem = beams(HELD, HELD, tension=1e8)
    states = WaveShapes(problem, lowest_waves(problem, 2)).states(np.array([[0.0, 0.25, 0.5, 1.0]]))[0]
    assert np.isfinite(states).all()
    np.testing.assert_allclose(np.abs(states[0, 1:3, 0]), [1.0, np.sqrt(2.0)], rtol=1e-3)
    np.testing.assert_allclose(states[:, [0, 3], :2], 0.0, atol=1e-12)


def test_rigid_and_equal_roots_have_orthogonal_shapes():
    share = np.concatenate([(NODES + 1) / 2, ENDS])[None]
    for problem in (
        beams(FREE, right_mass=(0.7, 0.2)),
        beams(FREE, foundation=3.0),
        coupled_strings((0.0, 0.0, 0.0), [[0.0, 0.0], [0.0, 0.0]], [[0.0, 0.5], [0.3, 0.0]]),
        beams((0.0, INF), tension=5.0),
        beams((0.0, 2.0), tension=5.0, right_mass=(0.7, 0.1), offset=-0.4),
    ):
        states = WaveShapes(problem, lowest_waves(problem, 4)).states(share)[0]
        np.testing.assert_allclose(inner_products(problem, states), np.eye(4), atol=1e-12)
