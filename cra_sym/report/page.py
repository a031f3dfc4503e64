"""The report: one HTML page that holds everything and asks the network for nothing."""

from __future__ import annotations

import base64
import inspect
import sys
from collections.abc import Iterable
from dataclasses import dataclass
from html import escape
from importlib import import_module
from importlib.metadata import version
from pathlib import Path
from typing import TYPE_CHECKING, Any

from tqdm import tqdm

import cra_sym
from cra_sym.figures import FIGURES
from cra_sym.files import write_text
from cra_sym.report.chapters import Chapter, chapter
from cra_sym.report.markup import Markup, anchor, mathml
from cra_sym.report.tables import TABLES, Table

if TYPE_CHECKING:
    from cra_sym.arm.equations import Equation

__all__ = ["write_page"]

_VERSIONS = ("sympy", "mpmath", "numpy", "scipy", "numba", "matplotlib")
_OWN_SECTION = {"equations", "nomenclature"}  # shown otherwise: as formulas, and in the overview


def write_page(folder: Path) -> Path:
    """Write ``report.html`` from the executed notebooks and the figures in ``folder``, and return its path."""
    import nbformat
    from jinja2 import Environment, PackageLoader, StrictUndefined
    from pygments.formatters import HtmlFormatter

    notebooks = sorted((folder / "notebooks").glob("*.ipynb"))
    names = [path.stem for path in notebooks]
    equations = _equations()
    numbers = [str(entry.equation.number) for entry in equations]
    figures = {name: _figure(name, folder / "figures" / f"{name}.svg") for name in FIGURES}
    chapters = [chapter(path.stem, nbformat.read(path, as_version=4), names, numbers, figures) for path in notebooks]
    shown = {name for part in chapters for name in part.figures}
    environment = Environment(
        loader=PackageLoader("cra_sym", "report"), autoescape=True, undefined=StrictUndefined, trim_blocks=True
    )
    html = environment.get_template("page.html.jinja").render(
        chapters=chapters,
        contents=[_contents(part) for part in chapters],
        equations=equations,
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
    statement: str
    route: str
    confirmed: bool
    sources: list[tuple[str, str]]
    uses: list[tuple[str, str]]


def _links(numbers: Iterable[Any]) -> list[tuple[str, str]]:
    return [(anchor("eq", number), f"({number})") for number in numbers]


def _equations() -> list[_Entry]:
    """Derive, check and typeset every equation."""
    from cra_sym.arm.equations import equations

    found = equations(companions=True)
    numbers = {str(e.number) for e in found}
    markup = Markup("equations", numbers=numbers)
    return [
        _Entry(
            equation=e,
            anchor=anchor("eq", e.number),
            formula=mathml(e._repr_latex_(), block=True),
            statement=markup(e.statement),
            route=markup(e.checked_by),
            confirmed=e.check(),
            sources=_links(e.derived_from),
            uses=_links(other.number for other in found if e.number in other.derived_from),
        )
        for e in tqdm(found, unit="equation", disable=None)
    ]


def _figure(name: str, svg: Path) -> str:
    """Return a figure with its caption, the first paragraph of the docstring of the function that draws it."""
    module, function = FIGURES[name].split(":")
    caption = inspect.cleandoc(getattr(import_module(module), function).__doc__).split("\n\n")[0].replace("\n", " ")
    data = base64.b64encode(svg.read_bytes()).decode("ascii")
    image = f'<img src="data:image/svg+xml;base64,{data}" alt="{escape(caption, quote=True)}">'
    return f'<figure id="{anchor(name)}">{image}<figcaption>{escape(caption)}</figcaption></figure>'


def _table(table: Table) -> str:
    return Markup("tables")("#" + table.markdown())  # a section, not a chapter


def _contents(part: Chapter) -> list[tuple[str, str]]:
    """Identifier and text of a chapter's title and of its sections."""
    return [(name, text) for level, name, text in part.headings if level <= 2]
