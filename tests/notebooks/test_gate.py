"""What a stored notebook must be, beside what nbval compares."""

from __future__ import annotations

import ast
import json
import re
from pathlib import Path

import pytest

FOLDER = Path(__file__).resolve().parents[2] / "notebooks"
NOTEBOOKS = sorted(FOLDER.glob("*.ipynb"))
IGNORING = re.compile(
    r"NBVAL_(?:IGNORE_OUTPUT|SKIP|RAISES_EXCEPTION)|nbval-(?:ignore-output|skip|raises-exception)", re.I
)


@pytest.fixture(params=NOTEBOOKS, ids=lambda path: path.name)
def path(request):
    return request.param


@pytest.fixture
def notebook(path):
    return json.loads(path.read_text(encoding="utf-8"))


def source(cell):
    return "".join(cell["source"])


def code(notebook):
    return [cell for cell in notebook["cells"] if cell["cell_type"] == "code"]


def ignoring(cell):
    return bool(IGNORING.search(source(cell)) or IGNORING.search(json.dumps(cell["metadata"])))


def test_there_are_notebooks():
    assert [path.name for path in NOTEBOOKS][:1] == ["00_overview.ipynb"]


def test_executed_from_top_to_bottom(notebook):
    assert [cell["execution_count"] for cell in code(notebook)] == list(range(1, len(code(notebook)) + 1))


def test_no_stored_error(notebook):
    outputs = [output for cell in code(notebook) for output in cell["outputs"]]
    assert not [output for output in outputs if output["output_type"] == "error"]
    assert not [output for output in outputs if output.get("name") == "stderr"]


def test_ends_with_assertions(notebook):
    asserting = [any(isinstance(n, ast.Assert) for n in ast.walk(ast.parse(source(cell)))) for cell in code(notebook)]
    assert any(asserting[-2:]), "the last cells hold assertions a reader can rerun"


def test_needs_nothing_that_only_tests_need(notebook):
    """A reader installs the package and its notebooks' tools."""
    nodes = [node for cell in code(notebook) for node in ast.walk(ast.parse(source(cell)))]
    names = {alias.name for node in nodes if isinstance(node, ast.Import) for alias in node.names}
    names |= {node.module for node in nodes if isinstance(node, ast.ImportFrom)}
    assert not {name.partition(".")[0] for name in names} & {"hypothesis", "nbval", "pytest", "tests"}


def is_solution(cell):
    return "solution" in cell["metadata"].get("tags", ())


def test_is_one_sitting(notebook):
    assert len(notebook["cells"]) <= 41
    assert notebook["cells"][0]["cell_type"] == "markdown"
    assert source(notebook["cells"][0]).startswith("# ")


def test_is_small(path):
    assert path.stat().st_size < 500_000


def test_outputs_are_compared(notebook):
    assert sum(map(ignoring, code(notebook))) <= 0.05 * len(code(notebook))


def test_metadata_is_minimal(notebook):
    """Nothing that tells who ran it, when, where or with which patch release of Python."""
    assert set(notebook["metadata"]) <= {"kernelspec", "language_info"}
    assert notebook["metadata"]["kernelspec"] == {
        "display_name": "Python 3 (ipykernel)",
        "language": "python",
        "name": "python3",
    }
    assert notebook["metadata"].get("language_info", {"name": "python"}) == {"name": "python"}
    for cell in notebook["cells"]:
        assert set(cell["metadata"]) <= ({"tags", "jupyter"} if is_solution(cell) else {"tags"})


def test_pictures_are_png(notebook):
    shown = [output.get("data", {}) for cell in code(notebook) for output in cell["outputs"]]
    assert not [data for data in shown if "image/svg+xml" in data]


def test_links_lead_to_a_notebook(notebook):
    text = "\n".join(source(cell) for cell in notebook["cells"] if cell["cell_type"] == "markdown")
    links = re.findall(r"\]\(([\w.-]+\.ipynb)\)", text)
    assert [link for link in links if not (FOLDER / link).exists()] == []
