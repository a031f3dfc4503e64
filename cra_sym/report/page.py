"""The report: one HTML page that holds everything and asks the network for nothing."""

from __future__ import annotations

import sys
from collections.abc import Iterable
from dataclasses import dataclass
from importlib.metadata import version
from pathlib import Path
from typing import TYPE_CHECKING, Any

from tqdm import tqdm

import cra_sym
from cra_sym.claims import OUTCOMES, claims
from cra_sym.claims.pictures import MARKS
from cra_sym.figures import ANIMATIONS, FIGURES
from cra_sym.files import write_text
from cra_sym.report.chapters import Chapter, chapter
from cra_sym.report.exhibits import claim_entries, figure
from cra_sym.report.markup import Markup, anchor, formula, too_wide
from cra_sym.report.tables import TABLES, Table

if TYPE_CHECKING:
    from cra_sym.paper.equations import Equation

__all__ = ["write_page"]

_VERSIONS = ("sympy", "mpmath", "numpy", "scipy", "numba", "matplotlib")
_OWN_SECTION = {"equations", "nomenclature", "claims"}  # shown otherwise: as formulas, in the overview, with pictures


def write_page(folder: Path) -> Path:
    """Write ``report.html`` from the notebooks, figures and pictures of claims in ``folder``, and return its path."""
    import nbformat
    from jinja2 import Environment, PackageLoader, StrictUndefined
    from pygments.formatters import HtmlFormatter

    notebooks = sorted((folder / "notebooks").glob("*.ipynb"))
    names = [path.stem for path in notebooks]
    equations = _equations()
    numbers = [str(entry.equation.number) for entry in equations]
    verdicts = claims()
    ids = [verdict.id for verdict in verdicts]
    figures = {name: figure(name, folder / "figures") for name in FIGURES}
    chapters = [
        chapter(path.stem, nbformat.read(path, as_version=4), Markup(path.stem, names, numbers, ids), figures)
        for path in notebooks
    ]
    shown = {name for part in chapters for name in part.figures}
    environment = Environment(
        loader=PackageLoader("cra_sym", "report"), autoescape=True, undefined=StrictUndefined, trim_blocks=True
    )
    html = environment.get_template("page.html.jinja").render(
        chapters=chapters,
        contents=[_contents(part) for part in chapters],
        equations=equations,
        claims=claim_entries(verdicts, folder / "claims", Markup("claims", names, numbers)),
        counts=[(name, count) for name in OUTCOMES if (count := sum(v.outcome == name for v in verdicts))],
        marks={name: mark for name, (mark, _) in MARKS.items()},
        animations=[figure(name, folder / "figures") for name in ANIMATIONS],
        figures=[html for name, html in figures.items() if name not in shown],
        tables={name: _table(make()) for name, make in TABLES.items() if name not in _OWN_SECTION},
        versions={"Python": ".".join(map(str, sys.version_info[:3])), **{name: version(name) for name in _VERSIONS}},
        package=cra_sym.__version__,
        highlighting=HtmlFormatter().get_style_defs(".highlight"),
    )
    path = folder / "report.html"
    write_text(path, html)
    return path


@dataclass(frozen=True)
class _Entry:
    """An equation with what the page says about it."""

    equation: Equation
    anchor: str
    formula: str
    on_paper: str
    statement: str
    route: str
    confirmed: bool
    sources: list[tuple[str, str]]
    uses: list[tuple[str, str]]


def _links(numbers: Iterable[Any]) -> list[tuple[str, str]]:
    return [(anchor("eq", number), f"({number})") for number in numbers]


def _equations() -> list[_Entry]:
    """Derive, check and typeset every equation."""
    from cra_sym.paper.equations import equations

    found = equations(companions=True)
    numbers = {str(e.number) for e in found}
    markup = Markup("equations", numbers=numbers)
    return [
        _Entry(
            equation=e,
            anchor=anchor("eq", e.number),
            formula=formula(e._repr_latex_()),
            on_paper=str(e.expression) if too_wide(e._repr_latex_()) else "",
            statement=markup(e.statement),
            route=markup(e.checked_by),
            confirmed=e.check(),
            sources=_links(e.derived_from),
            uses=_links(other.number for other in found if e.number in other.derived_from),
        )
        for e in tqdm(found, unit="equation", disable=None)
    ]


def _table(table: Table) -> str:
    return Markup("tables")("#" + table.markdown())  # a section, not a chapter


def _contents(part: Chapter) -> list[tuple[str, str]]:
    """Identifier and text of a chapter's title and of its sections."""
    return [(name, text) for level, name, text in part.headings if level <= 2]
