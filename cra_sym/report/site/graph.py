"""The equations as an SVG graph, in which each node is the title of an equation and links to it."""

from __future__ import annotations

import textwrap
from collections.abc import Sequence
from html import escape

from cra_sym.figures.derivation import layers
from cra_sym.paper.equations import Equation

__all__ = ["equation_graph"]

_WIDE, _GAP, _LINE, _ROW = 148, 44, 13, 20  # of a node, between columns, of a line of text, between nodes
_LETTERS = 24  # of a line of a title
_WORDS = "The numbered equations, from what is put in to what comes out; arrows lead to what rests on an equation."


def equation_graph(chosen: Sequence[Equation]) -> str:
    """Return the graph as a figure of HTML: what is put in stands left, what comes out right."""
    if not chosen:
        return ""
    depth = layers(chosen)
    lines = {e.number: textwrap.wrap(f"({e.number}) {e.title}", _LETTERS, break_on_hyphens=False) for e in chosen}
    columns = [[e for e in chosen if depth[e.number] == k] for k in range(max(depth.values()) + 1)]
    heights = [sum(_tall(lines[e.number]) + _ROW for e in column) for column in columns]
    place: dict[int | str, tuple[float, float]] = {}
    nodes, edges = [], []
    for k, column in enumerate(columns):
        left, top = k * (_WIDE + _GAP), (max(heights) - heights[k]) / 2 + _ROW / 2
        for e in sorted(column, key=lambda e: _mean([place[n][1] for n in e.derived_from if n in place])):
            tall = _tall(lines[e.number])
            place[e.number] = left, top + tall / 2
            nodes.append(_node(e, lines[e.number], left, top, tall))
            top += tall + _ROW
    for e in chosen:
        edges += [_edge(place[n], place[e.number]) for n in e.derived_from if n in place]
    size = len(columns) * (_WIDE + _GAP) - _GAP, max(heights)
    return (
        f'<div class="graph" role="group" tabindex="0" aria-label="{_WORDS}">'
        f'<svg viewBox="-2 0 {size[0] + 4} {size[1]}" width="{size[0] + 4}" height="{size[1]}">'
        '<defs><marker id="arrow" viewBox="0 0 6 6" refX="6" refY="3" markerWidth="6" markerHeight="6" orient="auto">'
        f'<path d="M0 0 L6 3 L0 6 Z"/></marker></defs>{"".join(edges)}{"".join(nodes)}</svg></div>'
    )


def _tall(lines: Sequence[str]) -> int:
    return len(lines) * _LINE + 10


def _mean(heights: Sequence[float]) -> float:
    return sum(heights) / len(heights) if heights else 0.0


def _node(e: Equation, lines: Sequence[str], left: float, top: float, tall: float) -> str:
    spans = "".join(
        f'<tspan x="{left + 6:g}" y="{top + 5 + _LINE * (k + 0.8):g}">{escape(line, quote=False)}</tspan>'
        for k, line in enumerate(lines)
    )
    box = f'x="{left:g}" y="{top:g}" width="{_WIDE}" height="{tall}"'
    return f'<a href="#eq-{e.number}"><rect class="{e.kind}" {box} rx="3"/><text>{spans}</text></a>'


def _edge(start: tuple[float, float], end: tuple[float, float]) -> str:
    (x, y), (u, v) = (start[0] + _WIDE, start[1]), end
    bend = max(_GAP, (u - x) / 3)
    return f'<path class="edge" d="M{x:g} {y:g} C{x + bend:g} {y:g} {u - bend:g} {v:g} {u:g} {v:g}"/>'
