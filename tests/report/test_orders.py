"""The methods converge as theory says."""

import pytest

from cra_sym.report.site import orders


@pytest.mark.parametrize("row", orders._ROWS, ids=lambda row: row[0][0])
def test_errors_fall_at_the_rate_of_theory(row):
    """Within 0.1: at these sizes the next term of each error is worth less, and rounding too."""
    _, theory, measure = row
    assert measure() == pytest.approx(theory, abs=0.1)
