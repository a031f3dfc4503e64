"""Common parts of the drawings: an empty canvas, colours, and an arm deflected in its first mode."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, cast

import numpy as np
from matplotlib.figure import Figure

from cra_sym.analysis.modes import mode_shapes
from cra_sym.arm.parameters import Arm
from cra_sym.model.system import System

if TYPE_CHECKING:
    from matplotlib.axes import Axes

__all__ = ["BLUE", "GREEN", "INK", "ORANGE", "canvas", "deflection", "figure_of", "panels"]

#: The first colours of the style by value: "C0" would depend on the style that is active when the figure is shown.
INK, BLUE, ORANGE, GREEN = "#222222", "#0072B2", "#D55E00", "#009E73"


def canvas(ax: Axes | None, figsize: tuple[float, float]) -> tuple[Figure, Axes]:
    """Return ``ax``, or the axes of a new figure, without frame and with equal scales, after its figure."""
    if ax is None:
        ax = Figure(figsize=figsize).add_subplot()
    ax.set_aspect("equal")
    ax.set_axis_off()
    return cast(Figure, ax.figure), ax


def panels(axes: Any, rows: int, columns: int, size: tuple[float, float], **options: Any) -> np.ndarray:
    """Return a grid of axes, shape (rows, columns): those given, or those of a new figure."""
    if axes is None:
        axes = Figure(figsize=size, layout="constrained").subplots(rows, columns, squeeze=False, **options)
    return np.asarray(axes).reshape(rows, columns)


def figure_of(ax: Axes) -> Figure:
    """Return the figure that axes belong to."""
    figure = ax.figure
    assert isinstance(figure, Figure)
    return figure


def deflection(arm: System | None, xi: np.ndarray) -> np.ndarray:
    """First mode shape of ``arm`` at ``xi = x / L``, 1 at the tip; by default of an arm whose joint gives visibly."""
    if arm is None:
        nominal = Arm.nominal()
        arm = nominal.replace(k_t=20 * nominal.EI / nominal.L**3, k_r=5 * nominal.EI / nominal.L)
    shape = mode_shapes(arm, xi * arm.values["L"], modes=1)[0]
    return np.asarray(shape / shape[-1])
