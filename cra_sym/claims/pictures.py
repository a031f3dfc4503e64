"""Drawing of verdicts, and common parts of the panels."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.colors import ListedColormap
from matplotlib.figure import Figure

from cra_sym.figures import styled
from cra_sym.figures.drawing import figure_of, panel

if TYPE_CHECKING:
    from matplotlib.axes import Axes

__all__ = [
    "MARKS",
    "PALETTE",
    "STYLES",
    "TINTS",
    "by_mode",
    "draw_panel",
    "note",
    "region_map",
    "stiffness_axis",
    "strip",
]

MARKS = {
    "holds": ("\N{CHECK MARK}", "#007A59"),
    "mostly holds": ("\N{CIRCLE WITH ALL BUT UPPER LEFT QUADRANT BLACK}", "#56690A"),
    "rarely holds": ("\N{CIRCLE WITH UPPER RIGHT QUADRANT BLACK}", "#8A5C00"),
    "contradicted": ("\N{BALLOT X}", "#B34700"),
    "undecidable": ("?", "#595959"),
}
"""Sign and colour of each outcome."""

PALETTE = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00")
STYLES: tuple[Any, ...] = ("-", "--", "-.", ":", (0, (5, 1, 1, 1, 1, 1)))
"""Colours and line styles of the package's cycle, for panels that draw a mode more than once."""

TINTS = ("#9AD3BE", "#F1F1F1", "#FBE7DA")
"""Where a claim holds (darker), where no effect is visible, and where the opposite holds."""

_LABELS = {
    "k_t": "translational stiffness $k_t$ / (N/m)",
    "k_r": "rotational stiffness $k_r$ / (N m/rad)",
    "varpi": "disturbance frequency $\\varpi$ / (rad/s)",
    "psi": "phase of the disturbance $\\psi$ / deg",
}


def draw_panel(picture: Callable[[Axes], None], title: str, outcome: str, ax: Axes | None = None) -> Figure:
    """Draw a panel in the package's style, by default in a new figure, with the outcome in the title."""
    with styled():
        ax = panel(ax, (5.2, 3.6))
        picture(ax)
        mark, colour = MARKS[outcome]
        ax.set_title(f"{mark} {title}", color=colour, fontsize=10)
    return figure_of(ax)


def by_mode(ax: Axes, x: np.ndarray, curves: np.ndarray, **options: Any) -> None:
    """Draw a curve a mode, the last axis, with a legend."""
    for mode in range(curves.shape[-1]):
        ax.plot(x, curves[:, mode], label=f"mode {mode + 1}", **options)
    ax.legend(fontsize=8.5)


def stiffness_axis(ax: Axes, name: str, side: str = "x") -> None:
    """Make an axis the logarithmic one of a stiffness, soft to stiff."""
    getattr(ax, f"set_{side}scale")("log")
    getattr(ax, f"set_{side}label")(_LABELS[name])
    if side == "x":
        lines = [line.get_xdata() for line in ax.lines if len(np.atleast_1d(line.get_xdata())) > 2]
        if lines:
            ax.set_xlim(min(map(np.min, lines)), max(map(np.max, lines)))


def region_map(
    ax: Axes,
    x: np.ndarray,
    y: np.ndarray,
    ratio: np.ndarray,
    names: tuple[str, str],
    here: Any = None,
    visible: float = 0.0,
) -> None:
    """Tint the plane: green where the claim holds, orange where the opposite does, grey where no effect is visible.

    Parameters
    ----------
    ax : Axes
    x, y : ndarray
        Along the axes.
    ratio : ndarray, shape (len(x), len(y))
        A logarithmic ratio, negative where the claim holds.
    names : pair of str
        Labels of x and y.
    here : pair of float, optional
        The nominal point.
    visible : float
        Magnitude from which the ratio counts.
    """
    tint = np.where(ratio < -visible, 0, np.where(ratio > visible, 2, 1)).T
    ax.pcolormesh(x, y, tint, cmap=ListedColormap(TINTS), vmin=0, vmax=2, shading="nearest", rasterized=True)
    if 0 < (ratio < -visible).mean() < 1:
        ax.contour(x, y, ratio.T, levels=[-visible], colors=[PALETTE[2]], linewidths=1.2, linestyles="-")
    if here is not None:
        ax.plot(*here, "o", color="0.15", ms=5, clip_on=False, zorder=5)
    ax.set_xlabel(_LABELS[names[0]])
    ax.set_ylabel(_LABELS[names[1]])
    ax.grid(False)
    ax.margins(0)


def strip(ax: Axes, x: np.ndarray, where: np.ndarray, low: float, high: float) -> None:
    """Add a horizontal strip from ``low`` to ``high``, tinted by where a claim holds along a logarithmic axis."""
    edges = np.concatenate([x[:1], np.sqrt(x[1:] * x[:-1]), x[-1:]])
    ax.pcolormesh(edges, [low, high], ~where[None], cmap=ListedColormap(TINTS[::2]), vmin=0, vmax=1, shading="flat",
                  rasterized=True)  # fmt: skip


def note(ax: Axes, text: str, place: str) -> None:
    """Write a remark into a corner of the panel."""
    vertical, horizontal = place.split()
    x, y = {"left": 0.02, "right": 0.98}[horizontal], {"upper": 0.97, "lower": 0.03}[vertical]
    align: Any = {"ha": horizontal, "va": {"upper": "top", "lower": "bottom"}[vertical]}
    box = {"facecolor": "white", "alpha": 0.75, "edgecolor": "none", "pad": 1.5}
    ax.text(x, y, text, transform=ax.transAxes, fontsize=8, color="0.25", bbox=box, **align)
