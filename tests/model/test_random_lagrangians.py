"""Random Lagrangians from the grammar of the campaign: here those of two fields on each other, along x."""

import pytest

from tests.campaigns.lagrangians import tried


@pytest.mark.parametrize("trial", [0, 5])
def test_frequencies_are_those_of_ritz(trial):
    """Layers that hold two fields together, neither of which is held alone."""
    found = tried(trial)
    assert "refused" not in found
    assert found["gap"] == 0.0
