"""The numbered equations for the site: each with its formula, its sources, its uses and its proof."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

from tqdm import tqdm

from cra_sym.mechanics.steps import display_latex
from cra_sym.paper.equations import Equation, equations
from cra_sym.report.site.chapters import Chapter

__all__ = ["LedgerEntry", "entries", "numbers"]


@dataclass(frozen=True)
class LedgerEntry:
    """An equation, derived and checked, with its texts on the site."""

    equation: Equation
    formula: str
    used_in: tuple[int | str, ...]
    chapter: Chapter | None
    confirmed: bool


def entries(chapters: Sequence[Chapter]) -> list[LedgerEntry]:
    """Derive, check and typeset every equation; the chapter is the first that shows it."""
    found = equations(companions=True)
    return [
        LedgerEntry(
            equation=e,
            formula=display_latex(e.shown, tag=e.number),
            used_in=tuple(other.number for other in found if e.number in other.derived_from),
            chapter=next((chapter for chapter in chapters if str(e.number) in chapter.equations), None),
            confirmed=e.check(),
        )
        for e in tqdm(found, unit="equation", disable=None)
    ]


def numbers(chosen: Iterable[int | str]) -> str:
    """Return numbers of equations as text, such as ``(1), (16a)``."""
    return ", ".join(f"({number})" for number in chosen)
