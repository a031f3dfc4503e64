"""Random Lagrangians exported to C, from the campaign: their self-test passes."""

import pytest

from tests.campaigns.exports import tried
from tests.codegen import kit


@pytest.mark.parametrize("trial", [1, 3])
def test_what_is_built_passes_its_self_test(trial):
    kit.needs("c")
    found = tried(trial, points=1)
    assert "refused" not in found and "failed" not in found
    assert found["checks"] > 50
