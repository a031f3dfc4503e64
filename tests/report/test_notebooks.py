"""The runner: executes in place, stores no trace of the machine, and says which cell failed."""

import os
import sys
from concurrent.futures import CancelledError

import nbformat
import pytest
from nbformat.v4 import new_code_cell, new_markdown_cell, new_notebook

from cra_sym.report import notebooks, pictures
from cra_sym.report.notebooks import NotebookError, cells_to_run, execute, find_notebooks, refresh


@pytest.fixture
def notebook(tmp_path):
    def make(*sources, name="trial run.ipynb"):
        cells = [new_markdown_cell("# Trial"), *map(new_code_cell, sources)]
        path = tmp_path / name
        nbformat.write(new_notebook(cells=cells, metadata={"author": "somebody"}), path)
        return path

    return make


def test_outputs_are_stored_without_a_trace(notebook):
    path = notebook("from pathlib import Path\nPath.cwd().name", "print('a')\nprint('b')", "assert True")
    refresh([path])
    first = path.read_text()
    made = nbformat.read(path, as_version=4)
    assert made.metadata == {
        "kernelspec": {"display_name": "Python 3 (ipykernel)", "language": "python", "name": "python3"},
        "language_info": {"name": "python"},
    }
    assert [cell.get("execution_count") for cell in made.cells] == [None, 1, 2, 3]
    assert made.cells[1].outputs[0].data["text/plain"] == repr(path.parent.name)
    assert [output.text for output in made.cells[2].outputs] == ["a\nb\n"]
    assert not any(cell.metadata for cell in made.cells)
    refresh([path])
    assert path.read_text() == first


def test_a_failing_cell_is_shown_and_the_file_kept(notebook):
    path = notebook("x = 1", "raise RuntimeError('no such arm')")
    before = path.read_bytes()
    with pytest.raises(NotebookError, match=r"(?s)trial run\.ipynb.*no such arm"):
        refresh([path])
    assert path.read_bytes() == before


def test_notebooks_run_side_by_side_and_a_failure_ends_them_all(notebook, tmp_path):
    count = (os.cpu_count() or 1) + 1
    slow = [notebook("import time", "time.sleep(60)", *["1"] * 3, name=f"{n}.ipynb") for n in range(count)]
    before = {path: path.read_bytes() for path in slow}
    broken = notebook("raise RuntimeError('no such arm')", name="broken.ipynb")
    with pytest.raises(NotebookError, match="no such arm"):
        refresh([broken, *slow])
    assert {path: path.read_bytes() for path in slow} == before


def test_a_run_can_be_ended_in_the_middle_of_a_cell(notebook):
    path = notebook("1", "import time\ntime.sleep(1000)")
    before, ends = path.read_bytes(), []
    with pytest.raises(CancelledError):
        execute(path, lambda: ends[0](), begun=ends.append)
    assert path.read_bytes() == before


def test_the_file_itself_is_left_alone(notebook):
    path = notebook("1 + 1")
    before = path.read_bytes()
    assert execute(path).cells[1].outputs[0].data["text/plain"] == "2"
    assert path.read_bytes() == before


def test_notebooks_are_found_in_reading_order(notebook, tmp_path):
    notebook("1", name="01_b.ipynb")
    notebook("1", "2", name="00_a.ipynb")
    assert [path.name for path in find_notebooks(tmp_path)] == ["00_a.ipynb", "01_b.ipynb"]
    assert cells_to_run(find_notebooks(tmp_path)) == 3
    with pytest.raises(FileNotFoundError, match="nowhere"):
        find_notebooks(tmp_path / "nowhere")


@pytest.mark.parametrize(
    "command, takes",
    [(notebooks._refresh_as_asked, "a notebook, or a folder"), (pictures._redraw_as_asked, "a folder with figures")],
)
def test_the_commands_say_what_they_take(monkeypatch, capsys, command, takes):
    for given, code in (["--help"], 0), ([], 2):
        monkeypatch.setattr(sys, "argv", ["command", *given])
        with pytest.raises(SystemExit) as ended:
            command()
        assert ended.value.code == code
    shown = capsys.readouterr()
    assert takes in shown.out and "required: PLACE" in shown.err
