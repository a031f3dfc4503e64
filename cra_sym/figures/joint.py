"""Figure 2: the model of the bolted joint, a translational and a rotational spring between base and manipulator."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, TypeAlias

import numpy as np

from cra_sym.figures.drawing import BLUE, INK, ORANGE, canvas, deflection, figure_of

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from cra_sym.model.system import System

__all__ = ["figure_2"]

Point: TypeAlias = tuple[float, float]

_GREEN, _GREY = "#009E73", "#8A949E"
_LENGTH, _DATUM, _LEDGE = 7.6, -2.1, -1.25  # where the arm ends, the fixed frame lies and the spring k_t stands


def _line(ax: Axes, start: Point, end: Point, colour: str = _GREY, **options: Any) -> None:
    style = {"linewidth": 1.0, "linestyle": "-", "solid_capstyle": "butt", **options}
    ax.plot(*np.transpose([start, end]), color=colour, **style)


def _measure(ax: Axes, start: Point, end: Point, text: str, colour: str = INK, side: float = 0.12) -> None:
    """Draw an arrow from ``start`` to ``end`` and name the distance on its left (``side`` < 0) or right."""
    shape = {"arrowstyle": "-|>", "color": colour, "linewidth": 1.3, "mutation_scale": 11, "shrinkA": 0, "shrinkB": 0}
    ax.annotate("", end, start, arrowprops=shape, zorder=20)
    middle = np.mean([start, end], axis=0)
    align = "left" if side > 0 else "right"
    ax.text(middle[0] + side, middle[1], text, color=colour, fontsize=12, ha=align, va="center", zorder=20)


def _coil(ax: Axes, x: float, bottom: float, top: float) -> None:
    """Draw a helical spring seen from the side, with straight ends."""
    turns = np.linspace(0.0, 1.0, 15)
    across = np.where(np.arange(15) % 2, 0.17, -0.17)
    across[[0, -1]] = 0.0
    lead = 0.16 * (top - bottom)
    along = bottom + lead + (top - bottom - 2 * lead) * turns
    points = x + np.r_[0, across, 0], np.r_[bottom, along, top]
    ax.plot(*points, color=_GREEN, linewidth=1.8, solid_joinstyle="round", linestyle="-", zorder=6)


def _spiral(ax: Axes, centre: Point, slope: float) -> None:
    """Draw a spiral spring from the pin's hub to the inclined arm."""
    angle = np.linspace(0.0, 1.0, 200)
    radius, turn = 0.07 + 0.35 * angle, np.pi + (3 * np.pi + np.arctan(slope)) * angle
    x, y = centre[0] + radius * np.cos(turn), centre[1] + radius * np.sin(turn)
    ax.plot(x, y, color=_GREEN, linewidth=1.6, linestyle="-", zorder=12)


def _block(ax: Axes, corner: Point, width: float, height: float, colour: str, zorder: float = 3) -> None:
    from matplotlib.patches import Rectangle

    ax.add_patch(Rectangle(corner, width, height, facecolor=colour, edgecolor=INK, linewidth=0.9, zorder=zorder))


def _base(ax: Axes) -> None:
    """Draw the driving base on its guide, and the ledge on which the joint stands."""
    from matplotlib.patches import Circle

    _block(ax, (-2.62, _DATUM - 0.25), 0.3, 3.9, "#D5DAE0", 1)
    for y in np.arange(_DATUM - 0.25, _DATUM + 3.4, 0.25):
        _line(ax, (-2.82, y), (-2.62, y + 0.22), linewidth=0.8)
    for y in (-0.9, 0.4):
        ax.add_patch(Circle((-2.18, y), 0.14, facecolor="white", edgecolor=INK, linewidth=0.9, zorder=2))
    _block(ax, (-2.04, -1.35), 1.2, 2.2, "#AEB8C2")
    _block(ax, (-0.84, -1.45), 1.3, 0.2, "#AEB8C2", 2.9)
    ax.text(-1.44, -0.25, r"$m_b$", fontsize=14, ha="center", va="center", zorder=5)
    shape = {"arrowstyle": "-|>", "color": ORANGE, "linewidth": 2.2, "mutation_scale": 15, "shrinkA": 0, "shrinkB": 0}
    ax.annotate("", (-1.44, 1.75), (-1.44, 0.87), arrowprops=shape)
    ax.text(-1.3, 1.45, r"$F(t)$", color=ORANGE, fontsize=12, va="center")


def _joint(ax: Axes, give: float, slope: float) -> None:
    """Draw the carrier that slides on the base, the spring below it and the spiral at its pin."""
    from matplotlib.patches import Circle

    for y in (give - 0.2, give + 0.2):
        ax.add_patch(Circle((-0.75, y), 0.09, facecolor="white", edgecolor=INK, linewidth=0.9, zorder=4))
    _block(ax, (-0.66, give - 0.33), 0.78, 0.66, "#DCE3E9", 5)
    _coil(ax, -0.2, _LEDGE, give - 0.33)
    _spiral(ax, (0.0, give), slope)
    ax.add_patch(Circle((0.0, give), 0.07, facecolor="white", edgecolor=INK, linewidth=1.0, zorder=13))
    ax.text(0.1, 0.5 * (_LEDGE + give) - 0.12, r"$k_t$", color=_GREEN, fontsize=14, va="center")
    ax.text(-0.1, give + 0.62, r"$k_r$", color=_GREEN, fontsize=14, ha="center", va="center")


def _manipulator(ax: Axes, x: np.ndarray, v: np.ndarray) -> None:
    ax.fill_between(x, v - 0.075, v + 0.075, facecolor="#9CC7E4", edgecolor=BLUE, linewidth=1.0, zorder=10)
    _block(ax, (x[-1] - 0.05, v[-1] - 0.28), 0.56, 0.56, "#6F7C89", 11)
    ax.text(x[-1] + 0.23, v[-1], r"$m_e$", color="white", fontsize=13, ha="center", va="center", zorder=12)


def _lines_and_measures(ax: Axes, x: np.ndarray, v: np.ndarray, slope: float) -> None:
    from matplotlib.patches import Arc

    _line(ax, (-2.3, _DATUM), (_LENGTH + 1.1, _DATUM), linestyle=(0, (8, 3, 1, 3)))
    _line(ax, (-0.84, 0.0), (_LENGTH + 1.1, 0.0), linestyle=(0, (4, 3)))
    ax.text(_LENGTH + 1.1, _DATUM - 0.22, "fixed frame", ha="right", va="center", fontsize=9.5)
    ax.text(_LENGTH + 1.1, -0.2, "moves with the base", ha="right", va="center", fontsize=9.5)
    _measure(ax, (1.0, _DATUM), (1.0, 0.0), r"$w(t)$", ORANGE)
    i = int(0.55 * len(x))
    _measure(ax, (x[i], 0.0), (x[i], v[i] - 0.08), r"$v(x,t)$", BLUE)
    j = int(0.72 * len(x))
    _measure(ax, (x[j], _DATUM), (x[j], v[j] - 0.08), "", INK)
    ax.text(x[j] + 0.12, 0.5 * _DATUM, r"$y(x,t) = w + v$", fontsize=12, va="center")
    _measure(ax, (0.62, 0.0), (0.62, v[0]), r"$v(0,t)$", BLUE)
    end = 2.6
    _line(ax, (0.0, v[0]), (end, v[0]), linewidth=0.8)
    _line(ax, (0.0, v[0]), (end, v[0] + slope * end), linewidth=0.8)
    ax.add_patch(Arc((0.0, v[0]), 4.9, 4.9, theta1=0, theta2=np.degrees(np.arctan(slope)), color=BLUE, linewidth=1.2))
    ax.text(2.7, v[0] + 0.5 * slope * 2.5, r"$v_x(0,t)$", color=BLUE, fontsize=12, va="center")
    _measure(ax, (-0.2, _DATUM - 0.55), (1.5, _DATUM - 0.55), "")
    ax.text(1.62, _DATUM - 0.55, r"$x$", fontsize=12, va="center")
    _line(ax, (0.0, _DATUM - 0.68), (0.0, _DATUM - 0.42), INK)


def figure_2(arm: System | None = None, ax: Axes | None = None) -> Figure:
    """The bolted joint as two springs: ``k_t`` yields to the shear force, ``k_r`` to the bending moment.

    The base has moved by w(t); the manipulator, bent in the first mode of ``arm``, stands off by v(x, t), which at
    the joint is not zero.

    Parameters
    ----------
    arm : Arm, optional
        Arm whose first mode shape is drawn; by default the nominal one with a soft joint, so that its give is seen.
    ax : Axes, optional
        Where to draw; by default a new figure.
    """
    ax = canvas(ax, (8.0, 4.4))
    xi = np.linspace(0.0, 1.0, 400)
    x, v = _LENGTH * xi, 2.7 * deflection(arm, xi)
    slope = float(v[1] - v[0]) / float(x[1] - x[0])
    _base(ax)
    _joint(ax, float(v[0]), slope)
    _manipulator(ax, x, v)
    _lines_and_measures(ax, x, v, slope)
    ax.autoscale_view()
    return figure_of(ax)
