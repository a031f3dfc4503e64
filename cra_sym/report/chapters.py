"""Executed notebooks as chapters of a page."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass
from html import escape
from typing import TYPE_CHECKING, Any

from nbconvert.filters import Highlight2HTML

from cra_sym.report.markup import Markup, formula
from cra_sym.report.svg import inline_svg

if TYPE_CHECKING:
    from nbformat import NotebookNode

__all__ = ["Chapter", "chapter"]

_DRAWN = re.compile(r'\bdraw\("(\w+)"(?:, \w+)?\)\s*$')


@dataclass(frozen=True)
class Chapter:
    """A chapter: its HTML, its headings (level, identifier, text), and the names of the figures it shows."""

    html: str
    headings: list[tuple[int, str, str]]
    figures: list[str]


def chapter(name: str, notebook: NotebookNode, markup: Markup, figures: Mapping[str, str]) -> Chapter:
    """Return an executed notebook as a chapter.

    Parameters
    ----------
    name : str
        Stem of the notebook's file.
    notebook : NotebookNode
    markup : Markup
        Renders the chapter's text.
    figures : mapping
        HTML of each figure of the registry; a cell that ends in ``draw("name")`` shows it instead of its picture.
    """
    highlight = Highlight2HTML(pygments_lexer="python3")
    pieces: list[str] = []
    shown: list[str] = []
    for place, cell in enumerate(notebook.cells):
        if cell.cell_type == "markdown":
            pieces.append(markup(cell.source))
        elif cell.cell_type == "code":
            folded = "solution" in cell.metadata.get("tags", ())
            if folded:
                pieces.append("<details><summary>Solution</summary>")
            pieces.append(f'<div class="code" translate="no">{highlight(cell.source)}</div>')
            drawn = _DRAWN.search(cell.source)
            if drawn and drawn[1] in figures and drawn[1] not in shown:
                shown.append(drawn[1])
                pieces.append(figures[drawn[1]])
            else:
                pieces.extend(
                    f'<div class="output">{_output(output, markup, f"{name}-{place}-{number}")}</div>'
                    for number, output in enumerate(cell.outputs)
                )
            if folded:
                pieces.append("</details>")
    return Chapter("\n".join(pieces), markup.headings, shown)


def _output(output: Any, markup: Markup, name: str) -> str:
    """Return the richest form of one output that a page without scripts can show; ``name`` is what a picture is called.

    A picture that comes with no words is that of the section it stands in.
    """
    if output.output_type == "stream":
        return f"<pre>{escape(output.text)}</pre>"
    data = output.data
    section = f"Figure: {markup.headings[-1][2]}" if markup.headings else "Figure"
    if "image/svg+xml" in data:
        return inline_svg(data["image/svg+xml"], name, section)
    if "image/png" in data:
        words = escape(section, quote=True)
        return f'<img src="data:image/png;base64,{data["image/png"].strip()}" alt="{words}">'
    if "text/markdown" in data:
        return markup(data["text/markdown"])
    if "text/latex" in data:
        return formula(data["text/latex"])
    return data.get("text/html") or f"<pre>{escape(data['text/plain'])}</pre>"
