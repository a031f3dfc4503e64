"""Figure 1: the robot, a driving base on a guide, a flexible manipulator bolted to it, and an end-effector."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, TypeAlias

import numpy as np

from cra_sym.figures.drawing import BLUE, INK, ORANGE, canvas, deflection, figure_of

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from matplotlib.typing import ColorType
    from numpy.typing import ArrayLike

    from cra_sym.model.system import System

__all__ = ["figure_1"]

Bounds: TypeAlias = tuple[float, float]

# Directions on paper of the arm's axis x, of the base's transverse motion w and of the vertical.
_TO_PAPER = np.array([[0.90, -0.33], [-0.80, -0.46], [0.0, 1.0]])
_STEEL, _DARK, _STRIP = "#AEB8C2", "#6F7C89", "#9CC7E4"
_LENGTH, _ROOT = 6.2, 1.2


def _paper(points: ArrayLike) -> np.ndarray:
    """Project points (x, w, z) onto the paper, shape (..., 2)."""
    return np.asarray(np.asarray(points, dtype=float) @ _TO_PAPER)


def _at(point: ArrayLike, offset: ArrayLike = (0.0, 0.0)) -> tuple[float, float]:
    """Place on paper of one point (x, w, z), moved by ``offset``."""
    across, up = _paper(point) + offset
    return float(across), float(up)


def _tint(colour: str, factor: float) -> ColorType:
    """Return a darker colour for a factor below one, a lighter one above."""
    from matplotlib.colors import to_rgb

    red, green, blue = (c * factor if factor <= 1 else 1 - (1 - c) * (2 - factor) for c in to_rgb(colour))
    return red, green, blue


def _face(ax: Axes, corners: ArrayLike, colour: ColorType, **options: Any) -> None:
    from matplotlib.patches import Polygon

    style = {"edgecolor": INK, "linewidth": 0.7, "joinstyle": "round", **options}
    ax.add_patch(Polygon(_paper(corners), closed=True, facecolor=colour, **style))


def _box(ax: Axes, x: Bounds, w: Bounds, z: Bounds, colour: str, zorder: float) -> None:
    """Draw the three faces one sees of the box ``x`` by ``w`` by ``z`` (pairs of bounds)."""
    (x0, x1), (w0, w1), (z0, z1) = x, w, z
    top = [(x0, w0, z1), (x1, w0, z1), (x1, w1, z1), (x0, w1, z1)]
    front = [(x1, w0, z0), (x1, w1, z0), (x1, w1, z1), (x1, w0, z1)]
    side = [(x0, w1, z0), (x1, w1, z0), (x1, w1, z1), (x0, w1, z1)]
    for corners, light in ((top, 1.35), (front, 0.82), (side, 1.08)):
        _face(ax, corners, _tint(colour, light), zorder=zorder)


def _arrow(ax: Axes, middle: ArrayLike, along: ArrayLike, text: str, offset: ArrayLike, colour: str = ORANGE) -> None:
    """Draw a double arrow through ``middle`` with its name beside it."""
    start, end = _at(np.subtract(middle, along)), _at(np.add(middle, along))
    shape = {"arrowstyle": "<|-|>", "color": colour, "linewidth": 1.6, "mutation_scale": 12, "shrinkA": 0, "shrinkB": 0}
    ax.annotate("", end, start, arrowprops=shape, zorder=30)
    ax.text(*_at(middle, offset), text, color=colour, fontsize=12, ha="center", va="center", zorder=30)


def _label(ax: Axes, point: ArrayLike, place: tuple[float, float], text: str) -> None:
    """Name a part, with a thin line to a point (x, w, z) of it."""
    line = {"arrowstyle": "-", "color": INK, "linewidth": 0.7, "shrinkA": 3, "shrinkB": 0}
    ax.annotate(text, _at(point), place, arrowprops=line, ha="center", va="center", fontsize=10.5, zorder=40)
    ax.plot(*_at(point), "o", color=INK, markersize=2.6, zorder=40)


def _guide(ax: Axes) -> None:
    for w in (-3.0, 2.5):
        _box(ax, (-0.45, 0.45), (w, w + 0.5), (-2.0, -0.05), _DARK, 1)
    _box(ax, (-0.55, 0.55), (-3.3, 3.3), (-0.05, 0.35), _STEEL, 2)
    for x in (-0.3, 0.3):
        _box(ax, (x - 0.09, x + 0.09), (-3.3, 3.3), (0.35, 0.47), _DARK, 3)


def _base(ax: Axes) -> None:
    _box(ax, (-0.62, 0.75), (-0.85, 0.85), (0.47, 1.5), _STEEL, 4)
    _box(ax, (0.75, 0.9), (-0.62, 0.62), (0.5, 1.45), _DARK, 5)
    for w in (-0.45, 0.45):
        for z in (0.66, 1.28):
            ax.plot(*_paper((0.9, w, z)), "h", color="#E9EDF0", markeredgecolor=INK, markersize=6, zorder=6)
    _box(ax, (0.9, _ROOT), (-0.2, 0.2), (0.68, 1.27), _STEEL, 7)


def _manipulator(ax: Axes, x: np.ndarray, bend: np.ndarray) -> None:
    lower, upper = np.full_like(x, 0.78), np.full_like(x, 1.17)
    still = np.zeros_like(x)
    for z in (lower, upper):
        ax.plot(*_paper(np.stack([x, still, z], -1)).T, color=_DARK, linewidth=0.9, linestyle=(0, (4, 3)), zorder=8)
    edge = np.concatenate([np.stack([x, bend, upper], -1), np.stack([x, bend, lower], -1)[::-1]])
    _face(ax, edge, _STRIP, zorder=9, edgecolor=BLUE, linewidth=1.0)
    rim = np.concatenate([np.stack([x, bend, upper], -1), np.stack([x, bend - 0.07, upper], -1)[::-1]])
    _face(ax, rim, _tint(_STRIP, 1.6), zorder=9.5, edgecolor=BLUE, linewidth=0.8)


def _end_effector(ax: Axes, x: float, w: float) -> None:
    _box(ax, (x, x + 0.36), (w - 0.24, w + 0.2), (0.7, 1.25), _DARK, 12)
    for z in (0.76, 1.09):
        _box(ax, (x + 0.36, x + 0.8), (w - 0.12, w + 0.08), (z, z + 0.1), _STEEL, 11 + z)


def figure_1(arm: System | None = None, ax: Axes | None = None) -> Figure:
    """The flexible Cartesian robotic arm: driving base, bolted joint, manipulator and end-effector.

    The manipulator is bent in the first mode of ``arm``; dashed lines show it straight.

    Parameters
    ----------
    arm : Arm, optional
        Arm whose first mode shape is drawn; by default the nominal one with a soft joint, so that its give is seen.
    ax : Axes, optional
        Where to draw; by default a new figure.
    """
    ax = canvas(ax, (7.6, 4.6))
    xi = np.linspace(0.0, 1.0, 80)
    bend = 1.25 * deflection(arm, xi)
    x = _ROOT + _LENGTH * xi
    _guide(ax)
    _base(ax)
    _manipulator(ax, x, bend)
    _end_effector(ax, x[-1], bend[-1])
    _arrow(ax, (0.0, 2.35, 1.15), (0, 0.75, 0), r"$w(t)$", (-0.35, 0.25))
    _arrow(ax, (0.06, 0, 2.0), (0.75, 0, 0), r"$u(t)$", (0.15, 0.32))
    tip = (x[-1] + 0.1, bend[-1] / 2, 1.45)
    _arrow(ax, tip, (0, bend[-1] / 2, 0), r"$v(L,t)$", (0.95, -0.12), BLUE)
    _label(ax, (0.0, 0.4, 1.5), (-2.2, 2.0), "driving base $m_b$")
    _label(ax, (0.9, 0.45, 0.66), (0.0, -1.6), "bolted joint $k_t$, $k_r$")
    _label(ax, (x[46], bend[46], 1.0), (4.9, 1.15), r"flexible manipulator $EI$, $\rho A$, $L$")
    _label(ax, (x[-1] + 0.36, bend[-1] + 0.1, 0.95), (6.1, -3.1), "end-effector $m_e$")
    _label(ax, (0.55, -2.4, 0.2), (3.4, 2.1), "guide")
    ax.autoscale_view()
    return figure_of(ax)
