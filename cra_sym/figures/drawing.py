"""Common parts of the figures: axes to draw in, colours, and an arm deflected in its first mode."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, TypeAlias, cast

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from cra_sym.analysis.modes import mode_shapes
from cra_sym.arm.parameters import Arm
from cra_sym.checks import instance
from cra_sym.figures.subject import single
from cra_sym.model.system import System

__all__ = ["BLUE", "GREEN", "INK", "ORANGE", "Panels", "canvas", "deflection", "figure_of", "panel", "panels"]

#: The first colours of the style by value: "C0" would depend on the style that is active when the figure is shown.
INK, BLUE, ORANGE, GREEN = "#222222", "#0072B2", "#D55E00", "#009E73"

Panels: TypeAlias = Sequence[Axes] | NDArray[np.object_]


def panels(
    axes: Panels | None, rows: int, columns: int, size: tuple[float, float], **options: Any
) -> NDArray[np.object_]:
    """Return a grid of axes, shape (rows, columns): those given, row by row, or those of a new figure.

    Raises
    ------
    TypeError, ValueError
        If something else than Axes is given, or another number of them.
    """
    if axes is None:
        figure = Figure(figsize=size, layout="constrained")
        return cast(NDArray[np.object_], figure.subplots(rows, columns, squeeze=False, **options))
    given = np.ravel(np.asarray(axes, dtype=object))
    for one in given:
        instance("axes", one, Axes)
    if given.size != rows * columns:
        raise ValueError(f"axes: must be {rows * columns} for this figure, {rows} x {columns}, not {given.size}")
    return given.reshape(rows, columns)


def panel(ax: Axes | None, size: tuple[float, float]) -> Axes:
    """Return the axes given, or those of a new figure; anything else raises a TypeError."""
    if ax is None:
        return Figure(figsize=size, layout="constrained").subplots()
    instance("ax", ax, Axes)
    return ax


def canvas(ax: Axes | None, size: tuple[float, float]) -> Axes:
    """Return ``ax``, or the axes of a new figure, without frame and with equal scales."""
    ax = Figure(figsize=size).add_subplot() if ax is None else panel(ax, size)
    ax.set_aspect("equal")
    ax.set_axis_off()
    return ax


def figure_of(ax: Axes) -> Figure:
    """Return the whole figure that axes belong to, be it through a SubFigure."""
    return ax.figure.figure


def deflection(arm: System | None, xi: np.ndarray) -> np.ndarray:
    """First mode shape of ``arm`` at ``xi = x / L``, 1 at the tip; by default of an arm whose joint gives visibly."""
    if arm is None:
        nominal = Arm.nominal()
        arm = nominal.replace(k_t=20 * nominal.EI / nominal.L**3, k_r=5 * nominal.EI / nominal.L)
    shape = mode_shapes(single(arm), xi * arm.values["L"], modes=1)[0]
    return np.asarray(shape / shape[-1])
