"""Figures, animations and claims as pieces of the page."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from html import escape
from pathlib import Path

from cra_sym.claims import Verdict
from cra_sym.claims.words import plain_text
from cra_sym.figures import described
from cra_sym.report.markup import Markup, anchor
from cra_sym.report.svg import inline_svg

__all__ = ["ClaimEntry", "claim_entries", "figure"]


def figure(name: str, folder: Path) -> str:
    """Return a figure or an animation of the registry, from its file in ``folder``, with its caption."""
    shown, more = described(name)
    caption = escape(f"{shown} {more}")
    picture = _text(folder / f"{name}.svg")
    if "<style>" in picture:  # an animation: it carries its own words and rules
        stop = '<label class="pause"><input type="checkbox"> Hold still</label>'
        return f'<figure class="animation">{picture}<figcaption>{caption} {stop}</figcaption></figure>'
    svg = inline_svg(picture, anchor(name), shown, more)
    return f'<figure id="{anchor(name)}" class="wide">{svg}<figcaption>{caption}</figcaption></figure>'


@dataclass(frozen=True)
class ClaimEntry:
    """A verdict with what the page says about it."""

    verdict: Verdict
    anchor: str
    title: str
    claim: str
    texts: dict[str, str]
    picture: str
    arrays: list[tuple[str, str, str, str]]


def claim_entries(verdicts: Sequence[Verdict], folder: Path, markup: Markup) -> list[ClaimEntry]:
    """Return the verdicts as entries of the page, each with the picture of its evidence from ``folder``."""
    return [
        ClaimEntry(
            verdict=v,
            anchor=anchor("claim", v.id),
            title=_inline(markup, v.title),
            claim=_inline(markup, v.claim),
            texts={
                name: _inline(markup, text)
                for name in ("plain", "sentence", "criterion", "remedy", "missing")
                if (text := getattr(v, name))
            },
            picture=inline_svg(
                _text(folder / f"{v.id}.svg"),
                anchor("picture", v.id),
                f"{v.id}, {v.outcome}: {v.title.replace('$', '')}",
                plain_text(v.plain),
            ),
            arrays=[
                (name, " x ".join(map(str, q.values.shape)) or "1", q.unit, q.meaning) for name, q in v.evidence.items()
            ],
        )
        for v in verdicts
    ]


def _inline(markup: Markup, text: str) -> str:
    return markup(text).strip().removeprefix("<p>").removesuffix("</p>")


def _text(path: Path) -> str:
    return path.read_text(encoding="utf-8")
