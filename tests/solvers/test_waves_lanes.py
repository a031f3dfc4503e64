"""The compiled search for two waves a section takes the same steps as NumPy."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest

from cra_sym.kernels import compiled, has_compiler
from cra_sym.solvers.waves import UniformProblem, lowest_waves, template
from tests.solvers.test_waves import FREE, HELD, coupled_strings
from tests.solvers.wave_problems import INF, beams

pytestmark = pytest.mark.skipif(not has_compiler(), reason="needs llvmlite")

ROUNDING = 1e-14  # both are within fifty roundings of the root


@cache
def made(structure):
    return compiled(template(structure), {}).lowest_waves


@pytest.fixture
def search():
    return made(beams(HELD).structure)


def random_ends(rng, rows):
    """Return stiffness and masses over twenty decades, zeros and infinities among them."""
    springs = 10 ** rng.uniform(-10, 10, (2, rows, 2))
    springs = np.where(rng.uniform(size=springs.shape) < 0.2, 0.0, springs)
    springs = np.where(rng.uniform(size=springs.shape) < 0.2, INF, springs)
    masses = np.where(rng.uniform(size=springs.shape) < 0.5, 0.0, 10 ** rng.uniform(-3, 2, springs.shape))
    return {"left": springs[0], "right": springs[1], "left_mass": masses[0], "right_mass": masses[1]}


FAMILIES = {
    "bending": lambda rng, rows: {},
    "tension": lambda rng, rows: {"tension": 10 ** rng.uniform(-6, 9, rows)},
    "foundation": lambda rng, rows: {"foundation": 10 ** rng.uniform(-9, 9, rows), "tension": rng.uniform(0, 50, rows)},
    "Timoshenko": lambda rng, rows: {"rotary": 10 ** rng.uniform(-4, 0, rows), "shear": 10 ** rng.uniform(0, 4, rows)},
    "compression": lambda rng, rows: {
        "foundation": 10 ** rng.uniform(3, 6, rows),
        "tension": -rng.uniform(0, 15, rows),
    },
}


@pytest.mark.parametrize("family", FAMILIES)
def test_both_paths_agree(search, family):
    rng = np.random.default_rng(7)
    rows = 700  # more than five blocks of lanes, the last one not full
    problem = beams(**random_ends(rng, rows), **FAMILIES[family](rng, rows))
    if family == "compression":
        problem = UniformProblem(
            problem.length, problem.odd_by_even, problem.even_by_odd, np.maximum(problem.stiffness, 1e3), problem.mass
        )
    found, other = lowest_waves(problem, 5, search), lowest_waves(problem, 5)
    assert (np.diff(found, axis=1) >= 0.0).all()
    np.testing.assert_allclose(found, other, rtol=ROUNDING)
    np.testing.assert_array_equal(found == 0.0, other == 0.0)


@pytest.mark.parametrize("modes", [1, 2, 30])
def test_any_number_of_modes(search, modes):
    problem = beams((3.0, 1.0), tension=np.array([0.0, 1.0, 1e6]))
    np.testing.assert_allclose(lowest_waves(problem, modes, search), lowest_waves(problem, modes), rtol=ROUNDING)


def test_two_even_displacements():
    problem = coupled_strings((0.0, 0.0, 3.0), [[0.0, 3.0], [2.0, 0.0]], [[0.0, 0.4], [1.5, 0.0]])
    found = lowest_waves(problem, 6, made(problem.structure))
    np.testing.assert_allclose(found, lowest_waves(problem, 6), rtol=ROUNDING)


def test_offset_end_masses(search):
    problem = beams((2.0, 3.0), right_mass=(0.8, 1e-3), offset=0.3, tension=np.array([0.0, 10.0, 1e5]))
    np.testing.assert_allclose(lowest_waves(problem, 4, search), lowest_waves(problem, 4), rtol=ROUNDING)


def test_refusals_are_those_of_numpy(search):
    with pytest.raises(ValueError, match="has buckled"):
        lowest_waves(beams(FREE, (INF, 0.0), tension=-50.0), 2, search)
    with pytest.raises(ValueError, match="modes = 2: the model has only 1 natural frequencies"):
        lowest_waves(beams(HELD, rhoA=0.0, right_mass=(2.0, 0.0)), 2, search)
