"""``make reproduce`` and ``make site``: all notebooks, figures and tables in one folder, and the site."""

from __future__ import annotations

import shutil
import sys
import textwrap
import time
from collections.abc import Iterable
from pathlib import Path

from tqdm import tqdm

from cra_sym.claims import claims
from cra_sym.claims.slipping import slipping_claims
from cra_sym.extras import require
from cra_sym.files import staged_directory, write_text
from cra_sym.report.notebooks import find_notebooks, refresh
from cra_sym.report.pictures import save_animations, save_claims, save_figures
from cra_sym.report.tables import TABLES

__all__ = ["reproduce", "site"]


def reproduce(output: str | Path, notebooks: str | Path | None = None) -> str:
    """Run every notebook and write them, the figures, the tables and the site to one folder.

    Parameters
    ----------
    output : path
        Folder to create. An earlier output there is replaced atomically at the end; anything else is refused at the
        start.
    notebooks : path, optional
        Folder of the notebooks, by default that of the source checkout. Copies are executed; the folder stays as it is.

    Returns
    -------
    str
        Summary of the output, a few lines to print.

    Raises
    ------
    cra_sym.extras.MissingExtraError
        If the libraries that run notebooks or build the site are not installed.
    cra_sym.files.OutputError
        If the folder cannot be written, before any work.
    cra_sym.report.notebooks.NotebookError
        If a notebook does not run to its end; nothing is left behind.
    """
    _require("notebooks", "nbclient", "nbconvert", "nbformat", "ipykernel", "IPython")
    _require_site()
    sources = find_notebooks(notebooks)
    begun = time.monotonic()
    with staged_directory(output) as folder:
        shutil.copytree(sources[0].parent, folder / "notebooks", ignore=shutil.ignore_patterns(".*"))
        _print_progress(f"Running {len(sources)} chapters, drawing, judging: some six minutes on two processors")
        refresh(find_notebooks(folder / "notebooks"), svg=True)
        _print_progress("Drawing the figures")
        save_figures(folder / "figures")
        save_animations(folder / "figures")
        _print_progress("Judging the claims")
        _save_claims(folder / "claims")
        _write_tables(folder / "tables")
        _write_site(folder / "site", find_notebooks(folder / "notebooks"), (folder / "figures", folder / "claims"))
        listing = _listing(folder)
    minutes = (time.monotonic() - begun) / 60
    return (
        f"{listing}\n\nMade in {minutes:.0f} minutes. To read everything, open {Path(output) / 'site' / 'index.html'}"
    )


def site(output: str | Path, notebooks: str | Path | None = None) -> str:
    """Write the site of the notebooks as they are stored to a folder; arguments and errors as for :func:`reproduce`."""
    from cra_sym.figures import FIGURES, shows_any_system

    _require_site()
    sources = find_notebooks(notebooks)
    with staged_directory(output) as folder:
        pictures = folder.with_name(f"{folder.name}.pictures")
        try:
            _print_progress("Judging the claims")
            _save_claims(pictures)
            save_animations(pictures)
            save_figures(pictures, filter(shows_any_system, FIGURES), kinds=["svg"])
            _write_site(folder, sources, (pictures,))
        finally:
            shutil.rmtree(pictures, ignore_errors=True)
    return f"To read the site, open {Path(output) / 'index.html'}"


def _require_site() -> None:
    _require("site", "sphinx", "myst_nb", "furo", "sphinx-mathjax-offline", "nbconvert")


def _require(extra: str, *modules: str) -> None:
    for module in modules:
        require(module, extra)


def _print_progress(what: str) -> None:
    """Print the progress on standard error."""
    print(what, file=sys.stderr, flush=True)


def _save_claims(folder: Path) -> None:
    save_claims(folder, claims())
    save_claims(folder, slipping_claims(), ending="-slip")


def _write_site(folder: Path, notebooks: list[Path], pictures: Iterable[Path]) -> None:
    from cra_sym.report.site.build import write_site

    _print_progress("Checking the equations and writing the site")
    drawn = [path for place in pictures for path in sorted(place.glob("*.svg"))]
    warnings = write_site(folder, notebooks, claims(), slipping_claims(), drawn)
    if warnings:
        _print_progress(warnings)


def _write_tables(folder: Path) -> None:
    folder.mkdir()
    for name, make in tqdm(TABLES.items(), unit="table", disable=None):
        table = make()
        write_text(folder / f"{name}.csv", table.csv())
        write_text(folder / f"{name}.md", table.markdown())


def _listing(folder: Path) -> str:
    """Return a line for each entry of a folder: its size, and the kinds and names of its files."""
    lines = []
    for entry in sorted(folder.iterdir(), key=lambda path: (path.is_file(), path.name)):
        files = [entry] if entry.is_file() else [path for path in sorted(entry.rglob("*")) if path.is_file()]
        size = sum(path.stat().st_size for path in files) / 1e6
        lines.append(f"{size:6.1f} MB  {entry.name}")
        if entry.is_dir() and entry.name != "site":
            kinds = ", ".join(sorted({path.suffix[1:] for path in files}))
            names = f"{kinds}: {' '.join(sorted({path.stem for path in files}))}"
            lines.append(textwrap.indent(textwrap.fill(names, 90), " " * 11))
    return "\n".join(lines)
