"""Tables: what is written is what was computed, whichever the form."""

import csv
import io

import pytest

from cra_sym.claims import claim
from cra_sym.report.tables import TABLES, Table

TABLE = Table("Trial", ("name", "value / Hz"), [("a|b, c", 1 / 3), ("d", float("inf"))])


def test_csv_keeps_every_digit():
    head, *rows = csv.reader(io.StringIO(TABLE.csv()))
    assert tuple(head) == TABLE.columns
    assert [(name, float(value)) for name, value in rows] == TABLE.rows


def test_markdown_rounds_and_escapes():
    lines = TABLE.markdown().splitlines()
    assert lines[:2] == ["# Trial", ""]
    assert lines[4] == r"| a\|b, c | 0.333333 |"


@pytest.mark.parametrize("name", TABLES)
def test_every_table_is_complete(name, monkeypatch):
    monkeypatch.setattr("cra_sym.claims.claims", lambda: [claim("C20")])
    table = TABLES[name]()
    assert table.rows
    assert {len(row) for row in table.rows} == {len(table.columns)}


def test_published_frequencies_lead_the_table():
    first = TABLES["frequencies"]().rows[0]
    assert [f"{value:.3f}" for value in first[-3:]] == ["2.448", "15.339", "42.950"]
