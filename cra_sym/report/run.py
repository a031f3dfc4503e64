"""``make reproduce``: every notebook, figure and table, and a report of them, in one folder."""

from __future__ import annotations

import shutil
import textwrap
from pathlib import Path

from tqdm import tqdm

from cra_sym.claims import claims
from cra_sym.files import staged_directory, write_text
from cra_sym.report.notebooks import find_notebooks, refresh
from cra_sym.report.page import write_page
from cra_sym.report.pictures import save_animations, save_claims, save_figures
from cra_sym.report.tables import TABLES

__all__ = ["reproduce"]


def reproduce(output: str | Path, notebooks: str | Path | None = None) -> str:
    """Run every notebook and write them, the figures, the tables and the report to one folder.

    Parameters
    ----------
    output : path
        Folder to make. An earlier output there is replaced as a whole at the very end; anything else is refused first.
    notebooks : path, optional
        Folder of the notebooks, by default that of the source checkout. Copies are executed; the folder stays as it is.

    Returns
    -------
    str
        What was made, a few lines to print.

    Raises
    ------
    cra_sym.files.OutputError
        If the folder cannot be written, before any work.
    cra_sym.report.notebooks.NotebookError
        If a notebook does not run to its end; nothing is left behind.
    """
    sources = find_notebooks(notebooks)
    with staged_directory(output) as folder:
        _run_notebooks(sources[0].parent, folder / "notebooks")
        save_figures(folder / "figures")
        save_animations(folder / "figures")
        save_claims(folder / "claims", claims())
        _write_tables(folder / "tables")
        write_page(folder)
        listing = _listing(folder)
    return f"{listing}\n\nTo read everything, open {Path(output) / 'report.html'}"


def _run_notebooks(source: Path, folder: Path) -> None:
    shutil.copytree(source, folder, ignore=shutil.ignore_patterns(".*"))
    refresh(find_notebooks(folder), svg=True)


def _write_tables(folder: Path) -> None:
    folder.mkdir()
    for name, make in tqdm(TABLES.items(), unit="table", disable=None):
        table = make()
        write_text(folder / f"{name}.csv", table.csv())
        write_text(folder / f"{name}.md", table.markdown())


def _listing(folder: Path) -> str:
    """A line for each entry of a folder: its size, the kinds and the names of the files in it."""
    lines = []
    for entry in sorted(folder.iterdir(), key=lambda path: (path.is_file(), path.name)):
        files = [entry] if entry.is_file() else sorted(path for path in entry.iterdir() if path.is_file())
        size = sum(path.stat().st_size for path in files) / 1e6
        lines.append(f"{size:6.1f} MB  {entry.name}")
        if entry.is_dir():
            kinds = ", ".join(sorted({path.suffix[1:] for path in files}))
            names = f"{kinds}: {' '.join(sorted({path.stem for path in files}))}"
            lines.append(textwrap.indent(textwrap.fill(names, 90), " " * 11))
    return "\n".join(lines)
