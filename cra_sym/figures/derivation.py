"""Drawing of the dependencies between the numbered equations."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Sequence
from typing import TYPE_CHECKING

from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from cra_sym.checks import instance, listed
from cra_sym.figures.drawing import figure_of, panel
from cra_sym.paper.equations import Equation, equations

if TYPE_CHECKING:
    from matplotlib.axes import Axes

__all__ = ["figure_derivation", "layers"]

_LOOKS = {
    "definition": {"facecolor": "#E3F1FA", "edgecolor": "#0072B2", "boxstyle": "square,pad=0.35"},
    "assumption": {"facecolor": "#FDF0DA", "edgecolor": "#C47A00", "boxstyle": "sawtooth,pad=0.35,tooth_size=0.18"},
    "derived": {"facecolor": "#E4F4EE", "edgecolor": "#00805E", "boxstyle": "round,pad=0.35"},
}


def layers(chosen: Sequence[Equation]) -> dict[int | str, int]:
    """Return for each equation the length of the longest chain of equations it is derived from."""
    sources = {e.number: [n for n in e.derived_from if n in {e.number for e in chosen}] for e in chosen}
    depth: dict[int | str, int] = {}

    def of(number: int | str) -> int:
        if number not in depth:
            depth[number] = 1 + max(map(of, sources[number]), default=-1)
        return depth[number]

    for e in chosen:
        of(e.number)
    return depth


def figure_derivation(chosen: Sequence[Equation] | None = None, *, ax: Axes | None = None) -> Figure:
    """Draw the equations from what is put in (left) to what comes out (right).

    Parameters
    ----------
    chosen : sequence of Equation, optional
        By default all of the registry, companions included.
    ax : Axes, optional
    """
    chosen = equations(companions=True) if chosen is None else listed("chosen", chosen, "equations")
    if not chosen:
        raise ValueError("chosen = (): must hold at least one equation")
    for equation in chosen:
        instance("chosen", equation, Equation)
    depth = layers(chosen)
    columns = defaultdict(list)
    for e in chosen:
        columns[depth[e.number]].append(e)
    place = _placed(columns)
    ax = panel(ax, (11.0, 5.2))
    for e in chosen:
        for source in e.derived_from:
            if source in place:
                _arrow(ax, place[source], place[e.number])
    for e in chosen:
        ax.text(
            *place[e.number], f"({e.number})", ha="center", va="center", fontsize=8.5, bbox=_LOOKS[e.kind], zorder=3
        )
    x, y = zip(*place.values(), strict=True)
    ax.set_xlim(min(x) - 0.6, max(x) + 0.6)
    ax.set_ylim(min(y) - 0.8, max(y) + 0.8)
    ax.set_axis_off()
    marks = [
        Line2D([], [], marker="s", linestyle="", markersize=9, label=kind, markerfacecolor=look["facecolor"],
               markeredgecolor=look["edgecolor"])
        for kind, look in _LOOKS.items()
    ]  # fmt: skip
    ax.legend(handles=marks, loc="lower center", ncols=3, bbox_to_anchor=(0.5, -0.06))
    return figure_of(ax)


def _placed(columns: dict[int, list[Equation]]) -> dict[int | str, tuple[float, float]]:
    """Place each column, ordered by the mean height of the sources of its equations."""
    place: dict[int | str, tuple[float, float]] = {}
    tallest = max(map(len, columns.values()))

    def height(e: Equation) -> float:
        known = [place[n][1] for n in e.derived_from if n in place]
        return sum(known) / len(known) if known else 0.0

    for column in sorted(columns):
        members = columns[column] if column == 0 else sorted(columns[column], key=height, reverse=True)
        gap = tallest / (len(members) + 1)
        for row, e in enumerate(members):
            place[e.number] = (float(column), tallest / 2 - (row + 1) * gap)
    return place


def _arrow(ax: Axes, start: tuple[float, float], end: tuple[float, float]) -> None:
    curve = 0.0 if end[0] - start[0] < 1.5 else 0.12
    look = {"arrowstyle": "-|>", "color": "0.62", "linewidth": 0.8, "shrinkA": 11, "shrinkB": 12}
    ax.annotate("", end, start, arrowprops=look | {"connectionstyle": f"arc3,rad={curve}"}, zorder=1)
