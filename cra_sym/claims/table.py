"""The ledger as text for a terminal and for a page."""

from __future__ import annotations

import shutil
import textwrap
from collections import Counter
from collections.abc import Sequence

from cra_sym.claims.pictures import MARKS
from cra_sym.claims.verdict import OUTCOMES, Verdict
from cra_sym.claims.words import plain_text

__all__ = ["verdict_markdown", "verdict_text"]


def verdict_text(verdicts: Sequence[Verdict], width: int | None = None) -> str:
    """Return the verdicts as paragraphs under their outcomes, and a count at the end.

    Parameters
    ----------
    verdicts : sequence of Verdict
    width : int, optional
        Columns, by default those of the terminal, at most 110.
    """
    width = width or min(shutil.get_terminal_size((100, 24)).columns, 110)
    lines: list[str] = []
    for verdict in verdicts:
        mark, _ = MARKS[verdict.outcome]
        headline = verdict.outcome.upper() + verdict.headline.removeprefix(verdict.outcome)
        lines.append(f"{verdict.id}  {mark} {headline}")
        parts = [("", f'"{verdict.claim}" ({verdict.source})'), ("", verdict.plain), ("", verdict.sentence)]
        parts += [("Judged: ", f"{verdict.criterion}.")]
        parts += [("Would reproduce the paper: ", f"{verdict.remedy}.")] if verdict.remedy else []
        parts += [("Missing: ", f"{verdict.missing}.")] if verdict.missing else []
        for head, text in parts:
            lines += textwrap.wrap(head + plain_text(text), width, initial_indent="     ", subsequent_indent="     ")
        lines.append("")
    counts = Counter(verdict.outcome for verdict in verdicts)
    lines.append(", ".join(f"{counts[name]} {name}" for name in OUTCOMES if counts[name]))
    return "\n".join(lines)


def verdict_markdown(verdicts: Sequence[Verdict]) -> str:
    """Return the verdicts as a Markdown table: the paper's words, the verdict in a sentence, the numbers."""
    rows = ["| the paper | verdict | computed |", "| --- | --- | --- |"]
    for verdict in verdicts:
        mark, _ = MARKS[verdict.outcome]
        found = f"{verdict.sentence} *Judged:* {verdict.criterion}."
        found += f" **Would reproduce the paper:** {verdict.remedy}." if verdict.remedy else ""
        found += f" **Missing:** {verdict.missing}." if verdict.missing else ""
        words = f"**{verdict.id}** {verdict.claim} *({verdict.source})*"
        head = f"{mark} **{verdict.headline}.** {verdict.plain}"
        rows.append("| " + " | ".join(_cell(text) for text in (words, head, found)) + " |")
    return "\n".join(rows)


def _cell(text: str) -> str:
    r"""Return text without a bar that would end the cell; in LaTeX an escaped bar is another sign.

    >>> print(_cell("$|v|$ | w"))
    $\vert v\vert $ \| w
    """
    parts = text.split("$")
    parts[::2] = (part.replace("|", r"\|") for part in parts[::2])
    parts[1::2] = (part.replace("|", r"\vert ") for part in parts[1::2])
    return "$".join(parts)
