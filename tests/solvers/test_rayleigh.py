"""Energies of springs as sums over elongations: no rounding of springs that nothing stretches."""

from __future__ import annotations

import numpy as np
import pytest

from cra_sym.solvers.rayleigh import energies_of_springs


def chain(springs):
    """Return the stiffness of masses in a row, each held to the next by a spring."""
    stretched = np.diff(np.eye(len(springs) + 1), axis=0)
    return np.einsum("k,ki,kj->ij", springs, stretched, stretched)


@pytest.mark.parametrize("springs", [[1.0], [3.0, 7.0, 11.0], [1e-9, 2.3, 1e7]])
def test_springs_that_nothing_stretches_store_nothing(springs):
    moved = np.full((1, 1, len(springs) + 1), 1.0 / 3.0)
    rounding = np.finfo(float).eps  # of an elongation, which enters squared
    assert abs(energies_of_springs(chain(springs)[None], moved)[0, 0, 0]) <= max(springs) * (4 * rounding) ** 2


def test_the_sum_is_the_product():
    rng = np.random.default_rng(7)
    for _ in range(20):
        matrix = rng.normal(size=(3, 4, 4))
        matrix = matrix + np.swapaxes(matrix, -1, -2)  # of both signs: pivots of either, and none
        matrix[1, :2, :2] = [[0.0, 1.0], [1.0, 0.0]]
        moved = rng.normal(size=(3, 2, 4))
        found, expected = energies_of_springs(matrix, moved), moved @ matrix @ np.swapaxes(moved, -1, -2)
        np.testing.assert_allclose(found, expected, rtol=0, atol=1e-9)  # pivots are as small as 1e-4 here
