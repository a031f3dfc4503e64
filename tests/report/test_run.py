"""Reproducing: one folder with everything, made from copies, all or nothing."""

import nbformat
import pytest
from nbformat.v4 import new_code_cell, new_markdown_cell, new_notebook

from cra_sym.claims import claim
from cra_sym.figures import FIGURES
from cra_sym.paper.equations import Equation
from cra_sym.report import run


@pytest.fixture
def book(tmp_path):
    folder = tmp_path / "the book"
    (folder / "images").mkdir(parents=True)
    (folder / "images" / "a.svg").write_text("<svg/>")
    cells = [new_markdown_cell("# Trial"), new_code_cell("open('left behind.txt', 'w').close()\n6 * 7")]
    nbformat.write(new_notebook(cells=cells), folder / "00_trial.ipynb")
    return folder


def test_one_folder_with_everything(book, tmp_path, monkeypatch):
    monkeypatch.setattr(Equation, "check", lambda self: True)
    monkeypatch.setattr(run, "save_figures", every_figure)
    for module in ("report.run", "report.page", "claims"):
        monkeypatch.setattr(f"cra_sym.{module}.claims", lambda: [claim("C20")])
    before = (book / "00_trial.ipynb").read_bytes()
    said = run.reproduce(tmp_path / "out put", notebooks=book)
    assert sorted(p.name for p in (tmp_path / "out put").iterdir()) == [
        "claims",
        "figures",
        "manifest.json",
        "notebooks",
        "report.html",
        "tables",
    ]
    made = nbformat.read(tmp_path / "out put" / "notebooks" / "00_trial.ipynb", as_version=4)
    assert made.cells[1].outputs[0].data["text/plain"] == "42"
    assert (tmp_path / "out put" / "notebooks" / "images" / "a.svg").exists()
    assert (tmp_path / "out put" / "claims" / "C20.svg").exists()
    assert (tmp_path / "out put" / "figures" / "moving_arm.svg").exists()
    assert (tmp_path / "out put" / "tables" / "frequencies.csv").exists()
    assert "42" in (tmp_path / "out put" / "report.html").read_text(encoding="utf-8")
    assert "00_trial" in said and "report.html" in said
    assert (book / "00_trial.ipynb").read_bytes() == before
    assert sorted(path.name for path in book.iterdir()) == ["00_trial.ipynb", "images"]


def every_figure(folder):
    """Stand in for the drawings, which have tests of their own."""
    folder.mkdir()
    for name in FIGURES:
        (folder / f"{name}.svg").write_text("<svg xmlns='http://www.w3.org/2000/svg'/>")
