"""The ledger as text for a terminal and for a page."""

from __future__ import annotations

import shutil
import textwrap
from collections import Counter
from collections.abc import Sequence

from cra_sym.claims.pictures import MARKS
from cra_sym.claims.verdict import OUTCOMES, Verdict

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
        lines.append(f"{verdict.id}  {mark} {verdict.outcome.upper()}  ({verdict.source})")
        parts = [("", f'"{verdict.claim}"'), ("", verdict.sentence)]
        parts += [("Would reproduce the paper: ", verdict.remedy)] if verdict.remedy else []
        parts += [("Missing: ", verdict.missing)] if verdict.missing else []
        for head, text in parts:
            lines += textwrap.wrap(head + text, width, initial_indent="     ", subsequent_indent="     ")
        lines.append("")
    counts = Counter(verdict.outcome for verdict in verdicts)
    lines.append(", ".join(f"{counts[name]} {name}" for name in OUTCOMES if counts[name]))
    return "\n".join(lines)


def verdict_markdown(verdicts: Sequence[Verdict]) -> str:
    """Return the verdicts as a Markdown table: outcome, what the paper says, what the computation says."""
    rows = ["| | the paper | computed |", "| --- | --- | --- |"]
    for verdict in verdicts:
        mark, _ = MARKS[verdict.outcome]
        found = verdict.sentence
        found += f" **Would reproduce the paper:** {verdict.remedy}." if verdict.remedy else ""
        found += f" **Missing:** {verdict.missing}." if verdict.missing else ""
        head = f"**{verdict.id}** {mark} {verdict.outcome}"
        words = f"{verdict.claim} *({verdict.source})*"
        rows.append("| " + " | ".join(_cell(text) for text in (head, words, found)) + " |")
    return "\n".join(rows)


def _cell(text: str) -> str:
    return text.replace("|", r"\|").replace("_", r"\_").replace("^", r"\^")
