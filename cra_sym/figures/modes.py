"""Natural frequencies against a stiffness of the joint (Fig. 3) and the first mode shapes."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.figure import Figure

from cra_sym.analysis.modes import mode_shapes, natural_frequencies
from cra_sym.arm.parameters import Arm
from cra_sym.figures.drawing import BLUE, ORANGE

if TYPE_CHECKING:
    from matplotlib.axes import Axes

__all__ = ["draw_in_hertz", "draw_relative", "figure_3", "figure_mode_shapes", "panels"]

_UNITS = {"k_t": "N/m", "k_r": "N m/rad"}
_QUANTITIES = {"k_t": "translational stiffness", "k_r": "rotational stiffness"}
_RIGID: dict[str, Any] = {"color": "0.45", "linestyle": (0, (4, 2)), "linewidth": 0.9}


def figure_3(arm: Arm | None = None, k_t: Any = None, *, axes: Any = None) -> Figure:
    """Draw f1, f2, f3 against the joint's translational stiffness, in Hz and as a fraction of the rigid joint's.

    Parameters
    ----------
    arm : Arm, optional
        By default the nominal one.
    k_t : array_like, optional
        Stiffnesses in N/m, by default 1 to 1e6.
    axes : pair of Axes, optional
    """
    arm = arm or Arm.nominal()
    k_t = np.logspace(0, 6, 301) if k_t is None else np.asarray(k_t, dtype=float)
    figure, (left, right) = panels(axes, 1, 2, (8.6, 3.9))
    found, rigid = natural_frequencies(arm.replace(k_t=k_t)), natural_frequencies(arm.replace(k_t=np.inf))
    draw_in_hertz(left, k_t, found, rigid, "k_t")
    draw_relative(right, k_t, found / rigid, "k_t")
    left.set_title("Fig. 3  A softer joint lowers every mode")
    right.set_title("higher modes feel it first", fontweight="normal")
    return figure


def figure_mode_shapes(
    arm: Arm | None = None, k_t: float = 1e3, k_r: float = 1e2, *, phase: float | None = None, axes: Any = None
) -> Figure:
    """Draw the first three mode shapes of the arm with a rigid and with an elastic joint.

    Parameters
    ----------
    arm : Arm, optional
        By default the nominal one.
    k_t, k_r : float
        The elastic joint, N/m and N m/rad.
    phase : float, optional
        Instant of a free vibration, rad: the elastic arm's shapes times its cosine, on axes with room for the whole
        swing.
    axes : three Axes, optional
    """
    arm = arm or Arm.nominal()
    figure, grid = panels(axes, 1, 3, (8.6, 3.4), sharey=True)
    x = np.linspace(0.0, float(arm.L), 301)
    rigid, elastic = arm.replace(k_t=np.inf, k_r=np.inf), arm.replace(k_t=k_t, k_r=k_r)
    pairs = [(mode_shapes(a, x), natural_frequencies(a)) for a in (rigid, elastic)]
    swing = 1.0 if phase is None else np.cos(phase)
    for mode, ax in enumerate(grid):
        ax.axhline(0.0, color="0.75", linewidth=0.8)
        for (shapes, hertz), colour, name in zip(pairs, (BLUE, ORANGE), ("rigid", "elastic"), strict=True):
            line: dict[str, Any] = {"color": colour, "linestyle": "-" if name == "elastic" else (0, (4, 2))}
            shape = shapes[mode] * (swing if name == "elastic" else 1.0)
            ax.plot(x, shape, label=f"{name}, {hertz[mode]:.2f} Hz", **line)
        ax.set_title(f"mode {mode + 1}")
        ax.set_xlabel("position along the arm $x$ / m")
        ax.margins(x=0.02, y=0.12)
        ax.legend(loc=("upper left", "upper center", "upper center")[mode], fontsize=8)
    largest = max(np.abs(shapes).max() for shapes, _ in pairs)
    grid[0].set_ylim(None if phase is None else -1.15 * largest, 1.35 * largest)
    grid[0].set_ylabel("mass-normalised shape $\\phi$ / kg$^{-1/2}$")
    return figure


def panels(axes: Any, rows: int, columns: int, size: tuple[float, float], **options: Any) -> tuple[Figure, Any]:
    """Return a figure and its grid of axes: those given, or new ones."""
    if axes is not None:
        grid = np.asarray(axes)
        return grid.flat[0].figure, grid
    figure = Figure(figsize=size, layout="constrained")
    return figure, figure.subplots(rows, columns, **options)


def draw_in_hertz(ax: Axes, stiffness: np.ndarray, found: np.ndarray, rigid: np.ndarray, name: str) -> None:
    """Draw frequencies, shape (len(stiffness), modes), against a stiffness, with those of the rigid joint."""
    for mode in range(found.shape[-1]):
        ax.axhline(rigid[mode], **_RIGID)
        (line,) = ax.plot(stiffness, found[:, mode])
        _label(ax, stiffness[-1], rigid[mode], f"$f_{mode + 1}$", line.get_color())
    note: dict[str, Any] = {"xytext": (-4, 3), "textcoords": "offset points", "color": "0.35", "fontsize": 8.5}
    ax.annotate("rigid joint", (stiffness[-1], rigid[-1]), ha="right", va="bottom", **note)
    _stiffness_axis(ax, stiffness, name)
    ax.set_ylim(0.0, 1.08 * max(found.max(), rigid.max(), ax.get_ylim()[1] / 1.08))
    ax.set_ylabel("natural frequency / Hz")


def draw_relative(ax: Axes, stiffness: np.ndarray, ratio: np.ndarray, name: str) -> None:
    """Draw frequencies over those of the rigid joint, shape (len(stiffness), modes), against a stiffness."""
    ax.axhline(1.0, **_RIGID)
    for mode in range(ratio.shape[-1]):
        ax.plot(stiffness, ratio[:, mode], label=f"$f_{mode + 1}$")
    ax.legend(loc="lower right" if ratio[0, 0] < 1.0 else "upper right")
    _stiffness_axis(ax, stiffness, name)
    ax.set_ylabel("frequency / that of the rigid joint")


def _stiffness_axis(ax: Axes, stiffness: np.ndarray, name: str) -> None:
    ax.set_xscale("log")
    ax.set_xlim(stiffness[0], stiffness[-1])
    ax.set_xlabel(f"{_QUANTITIES[name]} ${name}$ / ({_UNITS[name]})")


def _label(ax: Axes, x: float, y: float, text: str, colour: Any) -> None:
    ax.annotate(
        text, (x, y), xytext=(4, 0), textcoords="offset points", color=colour, va="center", annotation_clip=False
    )
