"""Markdown and LaTeX to HTML and MathML, with links from each equation number to its equation."""

from __future__ import annotations

import re
from collections.abc import Collection
from typing import Any

from latex2mathml.converter import convert
from nbconvert.filters.markdown_mistune import IPythonRenderer, MarkdownWithMath

__all__ = ["Markup", "anchor", "mathml"]

_DOLLARS = re.compile(r"^\$+|\$+$")
_ENVIRONMENTS = {
    r"\begin{gathered}": r"\begin{array}{c}",
    r"\end{gathered}": r"\end{array}",
    r"\begin{aligned}": r"\begin{array}{rl}",
    r"\end{aligned}": r"\end{array}",
    r"\\[4pt]": r"\\",
    r"\displaystyle": "",
}  # what the converter lacks, in what it has
_CITED = re.compile(r"(?<![\w)])\((\d{1,2}[a-z]?)\)")


def mathml(tex: str, *, block: bool = False) -> str:
    """Return a formula as MathML; dollar signs around it do not matter."""
    bare = _DOLLARS.sub("", tex.strip())
    for given, known in _ENVIRONMENTS.items():
        bare = bare.replace(given, known)
    return convert(bare.strip(), display="block" if block else "inline")


def anchor(*words: object) -> str:
    """Return an HTML identifier made of some words."""
    return re.sub(r"[^a-z0-9]+", "-", " ".join(map(str, words)).lower()).strip("-")


class _Renderer(IPythonRenderer):
    def __init__(self, chapter: str, chapters: Collection[str], numbers: Collection[str]) -> None:
        super().__init__(escape=False, exclude_anchor_links=True)
        self.chapter, self.chapters, self.numbers = chapter, chapters, numbers
        self.headings: list[tuple[int, str, str]] = []

    def block_math(self, body: str) -> str:
        return f'<div class="formula">{mathml(body, block=True)}</div>'

    def inline_math(self, body: str) -> str:
        return mathml(body)

    def text(self, text: str) -> str:
        def link(found: re.Match[str]) -> str:
            number = found[1]
            return f'<a href="#{anchor("eq", number)}">({number})</a>' if number in self.numbers else found[0]

        return _CITED.sub(link, super().text(text))

    def link(self, text: str, url: str, title: str | None = None) -> str:
        stem = url.removesuffix(".ipynb")
        if stem != url:
            return f'<a href="#{anchor(stem)}">{text}</a>' if stem in self.chapters else text
        return super().link(text, url, title)

    def heading(self, text: str, level: int, **attrs: Any) -> str:
        plain = re.sub(r"<[^>]+>", "", text)
        name = anchor(self.chapter) if level == 1 else anchor(self.chapter, plain)
        self.headings.append((level, name, plain))
        return f'<h{level + 1} id="{name}">{text}</h{level + 1}>\n'


class Markup:
    """Renders the Markdown of one chapter and remembers its headings.

    Parameters
    ----------
    chapter : str
        Stem of the chapter's file; headings get identifiers that begin with it and go one level down.
    chapters : collection of str
        Chapters of the page: links to their files become links inside the page.
    numbers : collection of str
        Numbers of the equations on the page.
    """

    def __init__(self, chapter: str, chapters: Collection[str] = (), numbers: Collection[str] = ()) -> None:
        self._renderer = _Renderer(chapter, chapters, numbers)
        self._parser = MarkdownWithMath(self._renderer)

    def __call__(self, text: str) -> str:
        """Return a piece of Markdown as HTML."""
        return self._parser.render(text)

    @property
    def headings(self) -> list[tuple[int, str, str]]:
        """Level in the Markdown, identifier and text of each heading so far."""
        return self._renderer.headings
