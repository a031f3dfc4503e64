"""What the page on accuracy states is what the package does."""

from pathlib import Path

import pytest

from cra_sym.report.site.accuracy import ACCURACY, accuracy_table


@pytest.mark.parametrize("row", ACCURACY, ids=lambda row: row.quantity)
def test_no_error_is_larger_than_stated(row):
    assert row.measure() <= row.stated
    assert (Path(__file__).parents[2] / row.test).is_file()


def test_the_table_has_a_row_for_each(monkeypatch):
    for row in ACCURACY:
        monkeypatch.setitem(row.__dict__, "measure", lambda: 3e-16)
    lines = accuracy_table().splitlines()[2:]
    assert [line.split(" | ")[0].removeprefix("| ") for line in lines] == [row.quantity for row in ACCURACY]
    assert all("| 3e-16 |" in line for line in lines)
