"""Build of the site: sources generated from the package's objects, rendered by Sphinx."""

from __future__ import annotations

import json
import shutil
import subprocess
import sys
from collections import Counter
from collections.abc import Sequence
from importlib import metadata
from pathlib import Path
from typing import TYPE_CHECKING, Any

from cra_sym.claims import OUTCOMES, Setting, Verdict
from cra_sym.claims.pictures import MARKS
from cra_sym.figures import ANIMATIONS, FIGURES, described
from cra_sym.files import write_text
from cra_sym.report.site.accuracy import accuracy_table
from cra_sym.report.site.chapters import Chapter, write_chapters
from cra_sym.report.site.extension import LINKS
from cra_sym.report.site.graph import equation_graph
from cra_sym.report.site.ledger import LedgerEntry, entries, numbers
from cra_sym.report.site.orders import orders
from cra_sym.report.site.reference import write_reference

if TYPE_CHECKING:
    from jinja2 import Environment

__all__ = ["SiteError", "write_site"]

_HERE = Path(__file__).parent
_VERSIONS = ("sympy", "mpmath", "numpy", "scipy", "llvmlite", "matplotlib", "sphinx", "myst-nb", "furo")


class SiteError(RuntimeError):
    """Sphinx failed to build the site; the message is its output."""

    exit_code = 1


def write_site(
    folder: Path,
    notebooks: Sequence[Path],
    verdicts: Sequence[Verdict],
    slipping: Sequence[Verdict],
    pictures: Sequence[Path],
) -> str:
    """Write the site into ``folder``; return the warnings of Sphinx, empty if there are none.

    Parameters
    ----------
    folder : path
        New or empty folder. Only a temporary folder next to it is written besides.
    notebooks : sequence of path
        Chapters in reading order, shown with their stored outputs.
    verdicts, slipping : sequence of Verdict
        With the paper's joint, and with a joint that slips.
    pictures : sequence of path
        SVG files of the animations, of the verdicts by their ids, with the ending ``-slip`` for a joint that slips, and
        of the figures by their names.

    Raises
    ------
    SiteError
        If Sphinx fails.
    """
    work = folder.with_name(f"{folder.name}.work")
    try:
        _write_sources(work / "sources", notebooks, verdicts, slipping, pictures)
        said = _run_sphinx(work)
        shutil.copytree(work / "pages", folder, dirs_exist_ok=True, ignore=shutil.ignore_patterns(".buildinfo"))
    finally:
        shutil.rmtree(work, ignore_errors=True)
    return said


def _run_sphinx(work: Path) -> str:
    options = ["-q", "-b", "html", "-c", str(_HERE), "-d", str(work / "doctrees")]
    places = [str(work / "sources"), str(work / "pages")]
    done = subprocess.run([sys.executable, "-m", "sphinx", *options, *places], capture_output=True, text=True)
    if done.returncode:
        raise SiteError(f"the site was not built: {done.stderr.strip()}")
    return done.stderr.replace(f"{work / 'sources'}/", "").strip()


def _write_sources(
    folder: Path,
    notebooks: Sequence[Path],
    verdicts: Sequence[Verdict],
    slipping: Sequence[Verdict],
    pictures: Sequence[Path],
) -> None:
    """Write everything that Sphinx reads."""
    shutil.copytree(_HERE / "pages", folder, ignore=shutil.ignore_patterns("*.jinja", "__pycache__"))
    chapters = write_chapters(notebooks, folder)
    ledger = entries(chapters)
    write_reference(folder / "reference")
    write_text(folder / "accuracy.txt", accuracy_table())
    (folder / "pictures").mkdir()
    for path in pictures:
        shutil.copy(path, folder / "pictures")
    environment, known = _environment(), _known(chapters, ledger, verdicts, pictures) | {"slipping": slipping}
    for path in sorted((_HERE / "pages").glob("*.jinja")):
        text = environment.get_template(path.name).render(known)
        write_text(folder / path.stem, text)
    homes = {str(e.equation.number): f"equations#eq-{e.equation.number}" for e in ledger}
    write_text(folder / LINKS, json.dumps(homes | {v.id: f"claims#{v.id.lower()}" for v in verdicts}))


def _environment() -> Environment:
    from jinja2 import Environment, FileSystemLoader, StrictUndefined

    environment = Environment(
        loader=FileSystemLoader(_HERE / "pages"), undefined=StrictUndefined, trim_blocks=True, lstrip_blocks=True
    )
    environment.filters["numbers"] = numbers
    environment.filters["cell"] = lambda text: text.replace("|", r"\|").replace("_", r"\_").replace("^", r"\^")
    return environment


def _known(
    chapters: Sequence[Chapter], ledger: Sequence[LedgerEntry], verdicts: Sequence[Verdict], pictures: Sequence[Path]
) -> dict[str, Any]:
    """Return the names available in the templates of the pages."""
    from cra_sym.arm.parameters import Arm
    from cra_sym.report.tables import TABLES
    from cra_sym.symbols import nomenclature

    files = {path.stem: path for path in pictures}
    outcomes = Counter(v.outcome for v in verdicts)
    drawn = {name for chapter in chapters for name in chapter.figures}
    return {
        "version": metadata.version("cra_sym"),
        "chapters": chapters,
        "entries": ledger,
        "graph": equation_graph([e.equation for e in ledger]),
        "verdicts": verdicts,
        "marks": {name: mark for name, (mark, _) in MARKS.items()},
        "counts": [(name, MARKS[name][0], outcomes[name]) for name in OUTCOMES if outcomes[name]],
        "animations": {name: _animation(files[name]) for name in ANIMATIONS},
        "figures": [(name, *described(name)) for name in FIGURES if name in files and name not in drawn],
        "arm": Arm.provenance,
        "units": {row.name: row.unit for row in nomenclature()},
        "setting": Setting(),
        "orders": orders(),
        "frequencies": TABLES["frequencies"]().markdown(),
        "comparison": _section_of_the_readme("Beside other packages"),
        "versions": {"Python": ".".join(map(str, sys.version_info[:3]))} | {n: metadata.version(n) for n in _VERSIONS},
    }


def _animation(path: Path) -> str:
    """Return an animation, with its own text and rules, as a figure with a pause switch."""
    words, more = described(path.stem)
    stop = '<label class="pause"><input type="checkbox"> Hold still</label>'
    picture = path.read_text(encoding="utf-8").strip()
    return f'<figure class="animation">{picture}<figcaption>{words} {more} {stop}</figcaption></figure>'


def _section_of_the_readme(title: str) -> str:
    """Return a section of the README: from the checkout, or from the metadata of the installed distribution."""
    checkout = _HERE.parents[2]
    text = (
        (checkout / "README.md").read_text(encoding="utf-8")
        if (checkout / "pyproject.toml").is_file()
        else metadata.metadata("cra_sym").json["description"]
    )
    return str(text).partition(f"\n## {title}\n")[2].partition("\n## ")[0].strip()
