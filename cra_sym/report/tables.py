"""Small labelled tables, and their output formats."""

from __future__ import annotations

import csv
import io
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

__all__ = ["TABLES", "Table"]


@dataclass(frozen=True)
class Table:
    """A title, column heads with their units, and rows of numbers and text; people are shown ``digits`` digits.

    >>> print(Table("Squares", ("n", "square / 1"), [(2, 4.0)]).text(), end="")
    n  square / 1
    2           4
    """

    title: str
    columns: tuple[str, ...]
    rows: Sequence[tuple[Any, ...]]
    digits: int = 6

    def _shown(self, value: Any) -> str:
        return f"{value:.{self.digits}g}" if isinstance(value, float) else str(value)

    def csv(self) -> str:
        """Comma-separated values, numbers in full precision."""
        buffer = io.StringIO()
        writer = csv.writer(buffer, lineterminator="\n")
        writer.writerow(self.columns)
        writer.writerows([[repr(float(v)) if isinstance(v, float) else v for v in row] for row in self.rows])
        return buffer.getvalue()

    def markdown(self) -> str:
        """A Markdown table under its title."""
        cells = [self.columns, ["---"] * len(self.columns), *([self._shown(v) for v in row] for row in self.rows)]
        body = "\n".join("| " + " | ".join(str(c).replace("|", r"\|") for c in row) + " |" for row in cells)
        return f"# {self.title}\n\n{body}\n"

    def text(self) -> str:
        """Aligned columns for a terminal: numbers to the right, text to the left."""
        cells = [list(self.columns), *([self._shown(v) for v in row] for row in self.rows)]
        widths = [max(map(len, column)) for column in zip(*cells, strict=True)]
        numeric = [all(isinstance(v, (int, float)) for v in column) for column in zip(*self.rows, strict=True)]
        lines = (
            "  ".join(c.rjust(w) if n else c.ljust(w) for c, w, n in zip(row, widths, numeric, strict=True))
            for row in cells
        )
        return "".join(line.rstrip() + "\n" for line in lines)


def nomenclature() -> Table:
    """Every symbol: name, LaTeX, unit, meaning."""
    from cra_sym.symbols import nomenclature

    rows = [(row.name, row.latex, row.unit, row.meaning) for row in nomenclature()]
    return Table("Nomenclature", ("name", "LaTeX", "unit", "meaning"), rows)


def equations() -> Table:
    """The paper's numbered equations and their sources."""
    from cra_sym.paper.equations import equations

    rows = [(e.number, e.title, e.kind, ", ".join(map(str, e.derived_from))) for e in equations()]
    return Table("Equations", ("number", "title", "kind", "derived from"), rows)


def frequencies() -> Table:
    """The first three natural frequencies along the two stiffness series of the paper."""
    from cra_sym.analysis.modes import natural_frequencies
    from cra_sym.arm.parameters import Arm

    nominal, inf = Arm.nominal(), float("inf")
    published = nominal.replace(m_e=0.0)
    cases = [("fixed joint, no end-effector", published)]
    cases += [("k_t", nominal.replace(k_t=k)) for k in (inf, 1e5, 1e4, 1e3)]
    cases += [("k_r", nominal.replace(k_r=k)) for k in (1e4, 1e3, 1e2)]
    rows = [
        (name, float(arm.k_t), float(arm.k_r), float(arm.m_e), *map(float, natural_frequencies(arm, modes=3)))
        for name, arm in cases
    ]
    columns = ("varied", "k_t / (N/m)", "k_r / (N m/rad)", "m_e / kg", "f_1 / Hz", "f_2 / Hz", "f_3 / Hz")
    return Table("Natural frequencies", columns, rows)


def claims() -> Table:
    """The paper's claims and their verdicts."""
    from cra_sym.claims import claims
    from cra_sym.claims.words import plain_text

    rows = [
        (v.id, v.claim, v.source, v.headline, *map(plain_text, (v.plain, v.sentence, v.remedy or v.missing or "")))
        for v in claims()
    ]
    end = "would reproduce the paper, or is missing"
    columns = ("claim", "the paper", "where", "outcome", "in a sentence", "computed", end)
    return Table("Claims", columns, rows)


TABLES: dict[str, Callable[[], Table]] = {
    "nomenclature": nomenclature,
    "equations": equations,
    "frequencies": frequencies,
    "claims": claims,
}
