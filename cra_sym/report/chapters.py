"""Executed notebooks as chapters of a page."""

from __future__ import annotations

import re
from collections.abc import Collection, Mapping
from dataclasses import dataclass
from html import escape
from typing import TYPE_CHECKING, Any

from nbconvert.filters import Highlight2HTML

from cra_sym.report.markup import Markup, mathml

if TYPE_CHECKING:
    from nbformat import NotebookNode

__all__ = ["Chapter", "chapter"]

_DRAWN = re.compile(r'\bdraw\("(\w+)"\)\s*$')


@dataclass(frozen=True)
class Chapter:
    """A chapter: its HTML, its headings (level, identifier, text), and the names of the figures it shows."""

    html: str
    headings: list[tuple[int, str, str]]
    figures: list[str]


def chapter(
    name: str,
    notebook: NotebookNode,
    chapters: Collection[str],
    numbers: Collection[str],
    figures: Mapping[str, str],
) -> Chapter:
    """Return an executed notebook as a chapter.

    Parameters
    ----------
    name : str
        Stem of the notebook's file.
    chapters, numbers : collection of str
        What the page holds: chapters and equation numbers that links may lead to.
    figures : mapping
        HTML of each figure of the registry; a cell that ends in ``draw("name")`` shows it instead of its picture.
    """
    markup, highlight = Markup(name, chapters, numbers), Highlight2HTML(pygments_lexer="python3")
    pieces: list[str] = []
    shown: list[str] = []
    for cell in notebook.cells:
        if cell.cell_type == "markdown":
            pieces.append(markup(cell.source))
        elif cell.cell_type == "code":
            pieces.append(f'<div class="code" translate="no">{highlight(cell.source)}</div>')
            drawn = _DRAWN.search(cell.source)
            if drawn and drawn[1] in figures and drawn[1] not in shown:
                shown.append(drawn[1])
                pieces.append(figures[drawn[1]])
            else:
                pieces.extend(f'<div class="output">{_output(output, markup)}</div>' for output in cell.outputs)
    return Chapter("\n".join(pieces), markup.headings, shown)


def _output(output: Any, markup: Markup) -> str:
    """Return the richest form of one output that a page without scripts can show."""
    if output.output_type == "stream":
        return f"<pre>{escape(output.text)}</pre>"
    data = output.data
    if "image/png" in data:
        words = escape(data.get("text/plain", "figure"), quote=True)
        return f'<img src="data:image/png;base64,{data["image/png"].strip()}" alt="{words}">'
    if "text/markdown" in data:
        return markup(data["text/markdown"])
    if "text/latex" in data:
        return f'<div class="formula">{mathml(data["text/latex"], block=True)}</div>'
    return data.get("text/html") or f"<pre>{escape(data['text/plain'])}</pre>"
