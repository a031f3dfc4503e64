"""Reproducing: one folder with everything, made from copies, all or nothing."""

import nbformat
import pytest
from nbformat.v4 import new_code_cell, new_markdown_cell, new_notebook

from cra_sym.__main__ import main
from cra_sym.claims import claim
from cra_sym.claims.slipping import slipping_claim
from cra_sym.figures import ANIMATIONS, FIGURES
from cra_sym.report import run
from cra_sym.report.site import build
from cra_sym.report.tables import TABLES


@pytest.fixture
def book(tmp_path):
    folder = tmp_path / "the book"
    (folder / "images").mkdir(parents=True)
    (folder / "images" / "a.svg").write_text("<svg/>")
    cells = [new_markdown_cell("# Trial"), new_code_cell("open('left behind.txt', 'w').close()\n6 * 7")]
    nbformat.write(new_notebook(cells=cells), folder / "00_trial.ipynb")
    return folder


@pytest.fixture
def quickly(monkeypatch):
    """Stand in for drawings, judgements, tables, proofs and Sphinx, which have tests of their own."""

    def every_figure(folder, names=FIGURES, kinds=("svg",)):
        folder.mkdir(exist_ok=True)
        for name in names:
            (folder / f"{name}.svg").write_text("<svg xmlns='http://www.w3.org/2000/svg'/>")

    def pages(work):
        (work / "pages").mkdir()
        (work / "pages" / "index.html").write_text((work / "sources" / "chapters" / "00_trial.ipynb").read_text())
        return "a warning"

    monkeypatch.setattr(run, "save_figures", every_figure)
    monkeypatch.setattr(run, "save_animations", lambda folder: every_figure(folder, ANIMATIONS))
    monkeypatch.setattr(run, "TABLES", {"frequencies": TABLES["frequencies"]})
    monkeypatch.setattr(run, "claims", lambda: [claim("C20")])
    monkeypatch.setattr(run, "slipping_claims", lambda: [slipping_claim("C16")])
    for part in ("accuracy_table", "orders"):
        monkeypatch.setattr(build, part, lambda: "")
    monkeypatch.setattr(build, "write_reference", lambda folder: None)
    monkeypatch.setattr("cra_sym.claims.claims", lambda: [claim("C20")])
    monkeypatch.setattr(build, "entries", lambda chapters: [])
    monkeypatch.setattr(build, "_run_sphinx", pages)


def test_one_folder_with_everything(book, tmp_path, quickly, capsys):
    before = (book / "00_trial.ipynb").read_bytes()
    said = run.reproduce(tmp_path / "out put", notebooks=book)
    assert sorted(p.name for p in (tmp_path / "out put").iterdir()) == [
        "claims",
        "figures",
        "manifest.json",
        "notebooks",
        "site",
        "tables",
    ]
    made = nbformat.read(tmp_path / "out put" / "notebooks" / "00_trial.ipynb", as_version=4)
    assert made.cells[1].outputs[0].data["text/plain"] == "42"
    assert (tmp_path / "out put" / "notebooks" / "images" / "a.svg").exists()
    assert all((tmp_path / "out put" / "claims" / f"{name}.svg").exists() for name in ("C20", "C16-slip"))
    assert (tmp_path / "out put" / "figures" / "moving_arm.svg").exists()
    assert (tmp_path / "out put" / "tables" / "frequencies.csv").exists()
    assert "42" in (tmp_path / "out put" / "site" / "index.html").read_text(encoding="utf-8")
    assert "00_trial" in said and "index.html" in said and "Made in" in said
    told = capsys.readouterr().err
    assert "Running 1 chapter" in told and "\n00_trial\n" in told and "a warning" in told
    assert (book / "00_trial.ipynb").read_bytes() == before
    assert sorted(path.name for path in book.iterdir()) == ["00_trial.ipynb", "images"]
    assert sorted(path.name for path in tmp_path.iterdir()) == ["out put", "the book"]


def test_the_site_alone(book, tmp_path, quickly, capsys):
    assert main(["site", "--notebooks", str(book), "--output", str(tmp_path / "my site")]) == 0
    assert sorted(path.name for path in (tmp_path / "my site").iterdir()) == ["index.html", "manifest.json"]
    assert sorted(path.name for path in tmp_path.iterdir()) == ["my site", "the book"]
    assert str(tmp_path / "my site" / "index.html") in capsys.readouterr().out


def test_what_sphinx_says_is_told(tmp_path, monkeypatch):
    """A page that links to nothing warns; without sources nothing can be built."""
    monkeypatch.setattr(build, "_write_sources", lambda folder, *_: written(folder, "[lost](nowhere.md)"))
    assert "nowhere.md" in build.write_site(tmp_path / "site", [], [], [], [])
    monkeypatch.setattr(build, "_write_sources", lambda *_: None)
    with pytest.raises(build.SiteError, match="the site was not built"):
        build.write_site(tmp_path / "other", [], [], [], [])
    assert [path.name for path in tmp_path.iterdir()] == ["site"]


def written(folder, text):
    folder.mkdir(parents=True)
    (folder / "index.md").write_text(f"# Trial\n\n{text}\n")
