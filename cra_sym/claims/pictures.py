"""How verdicts are drawn: one panel a claim, one picture a theme."""

from __future__ import annotations

from collections.abc import Callable
from io import BytesIO
from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib import style
from matplotlib.colors import ListedColormap
from matplotlib.figure import Figure
from PIL import Image

from cra_sym.figures import STYLE

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from cra_sym.claims.family import ArmFamily
    from cra_sym.claims.ledger import Verdict

__all__ = [
    "MARKS",
    "PALETTE",
    "STYLES",
    "by_mode",
    "draw_verdict",
    "figure_claims",
    "figure_family",
    "note",
    "region_map",
    "small_png",
    "stiffness_axis",
]

MARKS = {
    "holds": ("\N{CHECK MARK}", "#009E73"),
    "holds where": ("\N{CIRCLE WITH LEFT HALF BLACK}", "#B07700"),
    "contradicted": ("\N{BALLOT X}", "#C44E00"),
    "undecidable": ("?", "#666666"),
}
"""Sign and colour of each outcome."""

PALETTE = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00")
STYLES: tuple[Any, ...] = ("-", "--", "-.", ":", (0, (5, 1, 1, 1, 1, 1)))
"""Colours and line styles of the house's cycle, for panels that draw a mode more than once."""

_TINTS = ("#BFE3D6", "#F1F1F1", "#F8E4D6")

_LABELS = {
    "k_t": "translational stiffness $k_t$ / (N/m)",
    "k_r": "rotational stiffness $k_r$ / (N m/rad)",
    "varpi": "disturbance frequency $\\varpi$ / (rad/s)",
    "psi": "phase of the disturbance $\\psi$ / deg",
}


def draw_verdict(verdict: Verdict, picture: Callable[[Verdict, Axes], None] | None, ax: Axes | None = None) -> Figure:
    """Draw one verdict under a title that says its outcome."""
    if picture is None:
        raise NotImplementedError(f"claim {verdict.id} has no picture")
    with style.context(STYLE):
        if ax is None:
            ax = Figure(figsize=(5.2, 3.6), layout="constrained").subplots()
        picture(verdict, ax)
        mark, colour = MARKS[verdict.outcome]
        ax.set_title(f"{mark} {verdict.id}  {verdict.title}", color=colour, fontsize=10)
    figure = ax.figure
    assert isinstance(figure, Figure)
    return figure


def figure_claims(theme: str, verdicts: Any = None, columns: int = 3) -> Figure:
    """Draw all verdicts of a theme, a panel each.

    Parameters
    ----------
    theme : {'modes', 'responses', 'stability'}
    verdicts : sequence of Verdict, optional
        By default those of the nominal setting.
    columns : int
    """
    if verdicts is None:
        from cra_sym.claims.ledger import claims

        verdicts = claims(theme=theme)
    rows = -(-len(verdicts) // columns)
    with style.context(STYLE):
        figure = Figure(figsize=(4.1 * columns, 3.15 * rows), layout="constrained")
        panels = list(figure.subplots(rows, columns, squeeze=False).flat)
    for ax, verdict in zip(panels, verdicts, strict=False):
        verdict.draw(ax)
    for ax in panels[len(verdicts) :]:
        ax.set_axis_off()
    return figure


def small_png(figure: Figure, colours: int = 96, dpi: int = 100) -> bytes:
    """Return a picture as a PNG of few colours: a quarter of the size, for pages that must stay small."""
    full, small = BytesIO(), BytesIO()
    with style.context(STYLE):
        figure.savefig(full, format="png", dpi=dpi)
    Image.open(full).convert("RGB").quantize(colours).save(small, "PNG", optimize=True)
    return small.getvalue()


def figure_family(family: ArmFamily | None = None, ax: Axes | None = None) -> Figure:
    """Draw the arms that share the published frequencies: thickness against length, a curve a material."""
    from cra_sym.arm.parameters import Arm
    from cra_sym.claims.family import provenance_family

    family = family or provenance_family()
    with style.context(STYLE):
        if ax is None:
            ax = Figure(figsize=(5.6, 3.8), layout="constrained").subplots()
        for name, thickness in zip(family.materials, family.thickness, strict=True):
            ax.plot(family.length, 1e3 * thickness, label=name)
        nominal = Arm.nominal()
        ax.plot(nominal.L, 1e3 * np.asarray(nominal.h), "o", color="0.15", ms=6, ls="")
        ax.annotate("nominal arm", (float(nominal.L), 1e3 * float(nominal.h)), xytext=(-6, 7), ha="right",
                    textcoords="offset points", fontsize=8.5)  # fmt: skip
        printed = ", ".join(f"{f:.3f}" for f in family.published)
        ax.set_title(f"Every arm on these curves has {printed} Hz")
        ax.set(xlabel="length $L$ / m", ylabel="thickness $h$ / mm", ylim=(0, None))
        ax.set_xlim(family.length[0], family.length[-1])
        ax.legend()
    figure = ax.figure
    assert isinstance(figure, Figure)
    return figure


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
    label: str,
    here: Any = None,
    visible: float = 0.0,
) -> None:
    """Tint the plane: green where the claim holds, orange where the opposite does, grey where nothing is to be seen.

    Parameters
    ----------
    ax : Axes
    x, y : ndarray
        Along the axes.
    ratio : ndarray, shape (len(x), len(y))
        A logarithmic ratio, negative where the claim holds.
    names : pair of str
        What x and y are.
    label : str
        What the green part is.
    here : pair of float, optional
        The nominal point.
    visible : float
        Magnitude from which the ratio counts.
    """
    tint = np.where(ratio < -visible, 0, np.where(ratio > visible, 2, 1)).T
    ax.pcolormesh(x, y, tint, cmap=ListedColormap(_TINTS), vmin=0, vmax=2, shading="nearest", rasterized=True)
    if 0 < (ratio < -visible).mean() < 1:
        ax.contour(x, y, ratio.T, levels=[-visible], colors=[PALETTE[2]], linewidths=1.2, linestyles="-")
    if here is not None:
        ax.plot(*here, "o", color="0.15", ms=5, clip_on=False, zorder=5)
    ax.set_xlabel(_LABELS[names[0]])
    ax.set_ylabel(_LABELS[names[1]])
    ax.grid(False)
    ax.margins(0)
    note(ax, f"green: {label}", "upper right")


def note(ax: Axes, text: str, place: str) -> None:
    """Write a remark into a corner of the panel."""
    vertical, horizontal = place.split()
    x, y = {"left": 0.02, "right": 0.98}[horizontal], {"upper": 0.97, "lower": 0.03}[vertical]
    align: Any = {"ha": horizontal, "va": {"upper": "top", "lower": "bottom"}[vertical]}
    box = {"facecolor": "white", "alpha": 0.75, "edgecolor": "none", "pad": 1.5}
    ax.text(x, y, text, transform=ax.transAxes, fontsize=8, color="0.25", bbox=box, **align)
