"""Notebooks as chapters of the site: sources for Sphinx, and downloads."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from cra_sym.extras import require
from cra_sym.figures import FIGURES, described
from cra_sym.files import write_text

if TYPE_CHECKING:
    from nbformat import NotebookNode

__all__ = ["NUMBERED", "Chapter", "write_chapters"]

NUMBERED = re.compile(r"\\qquad (?:\\mathrm\{)?\((\d{1,2}[a-z]?)\)|\\tag\{(\d{1,2}[a-z]?)\}")
"""Pattern of the equation number in a displayed formula."""
_DRAWN = re.compile(r'\bdraw\("(\w+)"[^()]*\)\s*$')


@dataclass(frozen=True)
class Chapter:
    """A chapter: stem of its file, title, numbers of the equations and names of the figures it shows."""

    name: str
    title: str
    equations: tuple[str, ...]
    figures: tuple[str, ...]


def write_chapters(notebooks: Sequence[Path], folder: Path) -> list[Chapter]:
    """Write notebooks, as they are stored, into the sources of the site.

    Parameters
    ----------
    notebooks : sequence of path
        In reading order.
    folder : path
        The sources: ``chapters/`` and ``downloads/`` are made there.
    """
    nbformat, exporters = require("nbformat", "site"), require("nbconvert.exporters", "site")
    chapters = []
    for path in notebooks:
        notebook = nbformat.read(path, as_version=4)
        script, _ = exporters.PythonExporter().from_notebook_node(notebook)
        write_text(folder / "downloads" / f"{path.stem}.py", script)
        write_text(folder / "downloads" / path.name, path.read_text(encoding="utf-8"))
        title = notebook.cells[0].source.partition("\n")[0].lstrip("# ")
        drawn = (_drawn(cell) for cell in notebook.cells)
        chapters.append(Chapter(path.stem, title, _equations(notebook), tuple(filter(None, drawn))))
        write_text(folder / "chapters" / path.name, nbformat.writes(_prepared(notebook, path.stem)))
    return chapters


def _equations(notebook: NotebookNode) -> tuple[str, ...]:
    """Return the numbers of the equations whose formula the notebook shows, in order."""
    outputs = (output.get("data", {}) for cell in notebook.cells for output in cell.get("outputs", ()))
    texts = (data.get("text/markdown") or data.get("text/latex") or "" for data in outputs)
    return tuple(found[1] or found[2] for text in texts for found in NUMBERED.finditer(text))


def _drawn(cell: Any) -> str:
    """Return the name of the figure that a cell ends with, if it does."""
    found = _DRAWN.search(cell.source) if cell.cell_type == "code" else None
    return found[1] if found and found[1] in FIGURES else ""


def _prepared(notebook: NotebookNode, name: str) -> NotebookNode:
    """Add downloads under the title, fold solutions, and describe figures."""
    title, _, rest = notebook.cells[0].source.partition("\n")
    book, script = (f"{{download}}`{what} <../downloads/{name}.{kind}>`" for what, kind in _DOWNLOADS.items())
    notebook.cells[0].source = f"{title}\n\nTo run this chapter: {book}, or {script}.\n{rest}"
    for cell in notebook.cells:
        if "solution" in cell.metadata.get("tags", ()):
            prompts = dict.fromkeys(("code_prompt_show", "code_prompt_hide"), "Solution")
            cell.metadata = {"tags": ["hide-cell"], "mystnb": prompts}
        if drawn := _drawn(cell):
            words, more = described(drawn)
            figure = {"image": {"alt": words}, "figure": {"caption": f"{words} {more}".strip()}}
            cell.metadata["mystnb"] = {**cell.metadata.get("mystnb", {}), **figure}
    return notebook


_DOWNLOADS = {"notebook": "ipynb", "Python script": "py"}
