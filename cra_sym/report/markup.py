"""Markdown and LaTeX to HTML and MathML, with links from the numbers of equations and claims to what they name."""

from __future__ import annotations

import re
from collections.abc import Collection
from itertools import zip_longest
from typing import Any
from xml.etree import ElementTree

from latex2mathml.converter import convert
from nbconvert.filters.markdown_mistune import IPythonRenderer, MarkdownWithMath

__all__ = ["Markup", "anchor", "formula", "math_width", "mathml", "too_wide"]

_DOLLARS = re.compile(r"^\$+|\$+$")
_ENVIRONMENTS = {
    r"\begin{gathered}": r"\begin{array}{c}",
    r"\end{gathered}": r"\end{array}",
    r"\begin{aligned}": r"\begin{array}{rl}",
    r"\end{aligned}": r"\end{array}",
    r"\\[4pt]": r"\\",
    r"\displaystyle": "",
}  # what the converter lacks, in what it has
_SPACED = {"+", "-", "\N{MINUS SIGN}", "="}
_CITED = re.compile(r"(?<![\w)])\((\d{1,2}[a-z]?)\)|\b(C\d\d)\b")


def mathml(tex: str, *, block: bool = False) -> str:
    """Return a formula as MathML; dollar signs around it do not matter."""
    bare = _DOLLARS.sub("", tex.strip())
    for given, known in _ENVIRONMENTS.items():
        bare = bare.replace(given, known)
    return convert(bare.strip(), display="block" if block else "inline")


def formula(tex: str) -> str:
    """Return a displayed formula that tells the style sheet how wide it is, so that it can be made to fit."""
    text = mathml(tex, block=True)
    return f'<div class="formula" style="--ems:{_ems(text):.0f}">{text}</div>'


def too_wide(tex: str) -> bool:
    """Tell whether a formula cannot be read on paper when it is made to fit."""
    return _ems(mathml(tex, block=True)) > 200


def _ems(text: str) -> float:
    return 3 + 1.2 * math_width(ElementTree.fromstring(text))


def math_width(element: ElementTree.Element) -> float:
    """Estimate how wide an element of MathML is set, in ems; rather too wide than too narrow."""
    tag, parts = element.tag.rpartition("}")[2], [math_width(child) for child in element]
    if not parts:
        text = (element.text or "").strip()
        return 0.6 * len(text) + (0.5 if tag == "mo" and text in _SPACED else 0.0)
    if tag in {"mfrac", "munderover", "munder", "mover"}:
        return 0.2 + max(parts)
    if tag in {"msub", "msup", "msubsup"}:
        return parts[0] + 0.75 * max(parts[1:])
    if tag == "mtable":
        columns = zip_longest(*([math_width(cell) + 0.3 for cell in row] for row in element), fillvalue=0.0)
        return sum(max(column) for column in columns)
    return sum(parts)


def anchor(*words: object) -> str:
    """Return an HTML identifier made of some words."""
    return re.sub(r"[^a-z0-9]+", "-", " ".join(map(str, words)).lower()).strip("-")


class _Renderer(IPythonRenderer):
    def __init__(
        self, chapter: str, chapters: Collection[str], numbers: Collection[str], claims: Collection[str]
    ) -> None:
        super().__init__(escape=False, exclude_anchor_links=True)
        self.chapter, self.chapters, self.numbers, self.claims = chapter, chapters, numbers, claims
        self.headings: list[tuple[int, str, str]] = []

    def block_math(self, body: str) -> str:
        return formula(body)

    def inline_math(self, body: str) -> str:
        return mathml(body)

    def text(self, text: str) -> str:
        def link(found: re.Match[str]) -> str:
            number, claim = found.groups()
            if number in self.numbers:
                return f'<a href="#{anchor("eq", number)}">({number})</a>'
            return f'<a href="#{anchor("claim", claim)}">{claim}</a>' if claim in self.claims else found[0]

        return _CITED.sub(link, super().text(text))

    def link(self, text: str, url: str, title: str | None = None) -> str:
        stem = url.removesuffix(".ipynb")
        if stem != url:
            return f'<a href="#{anchor(stem)}">{text}</a>' if stem in self.chapters else text
        return super().link(text, url, title)

    def table(self, text: str) -> str:
        return f'<div class="scroll"><table>{text}</table></div>\n'

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
    numbers, claims : collection of str
        Numbers of the equations on the page, names of the claims.
    """

    def __init__(
        self,
        chapter: str,
        chapters: Collection[str] = (),
        numbers: Collection[str] = (),
        claims: Collection[str] = (),
    ) -> None:
        self._renderer = _Renderer(chapter, chapters, numbers, claims)
        self._parser = MarkdownWithMath(self._renderer)

    def __call__(self, text: str) -> str:
        """Return a piece of Markdown as HTML."""
        return self._parser.render(text)

    @property
    def headings(self) -> list[tuple[int, str, str]]:
        """Level in the Markdown, identifier and text of each heading so far."""
        return self._renderer.headings
