"""The boundaries of zones of parametric instability: how far apart they are, and how accurate."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import ArrayLike, NDArray

from cra_sym.analysis.floquet_boundary import floquet_boundary
from cra_sym.analysis.stability import forced_width
from cra_sym.figures.drawing import Panels, figure_of, panels
from cra_sym.figures.stability import AXIAL, FIRST, JOINT, K_T, M_E, RIGID, SECOND, is_rigid, quiet_boundary, say
from cra_sym.figures.subject import arm_or_nominal, positive
from cra_sym.model.excitations import AxialBase, Excitation, Parametric, TransverseBase
from cra_sym.model.system import System

__all__ = ["boundary_errors", "figure_accuracy", "figure_widths"]

STRONG, TRANSVERSE = AxialBase(0.05), TransverseBase(0.001)


def figure_widths(arm: System | None = None, *, axes: Panels | None = None) -> Figure:
    """Draw how wide the principal zones are against k_t and m_e: first-order widths at epsilon = 1, three excitations.

    Parameters
    ----------
    arm : Arm, optional
        By default the nominal one; against m_e it has k_t = 1e4 N/m.
    axes : 2 x 3 array of Axes, optional
    """
    arm = arm_or_nominal(arm)
    grid = panels(axes, 2, 3, (9.6, 5.6), sharex="row")
    k_t, m_e = np.logspace(1, 6, 201), np.linspace(0.0, 0.02, 101)
    titles = ("joint stiffness", "base along the arm", "base across the arm")
    rows: tuple[tuple[np.ndarray, System, str, Sequence[float]], ...] = (
        (k_t, arm.replace(k_t=k_t), "$k_t$ / (N/m)", K_T),
        (m_e * 1e3, arm.replace(k_t=1e4, m_e=m_e), "$m_e$ / g", tuple(1e3 * m for m in M_E)),
    )
    for row, (values, batch, label, marks) in zip(grid, rows, strict=True):
        for ax, excitation in zip(row, (JOINT, AXIAL, TRANSVERSE), strict=True):
            for mode, width in enumerate(_widths(batch, excitation), start=1):
                ax.plot(values, width, label=f"mode {mode}")
            for mark in marks:
                ax.axvline(mark, color="0.8", linewidth=0.8, zorder=0)
            ax.set_yscale("log")
            ax.set_xlabel(label)
    for ax, title in zip(grid[0], titles, strict=True):
        ax.set_xscale("log")
        ax.set_title(title)
    for row in grid:
        row[0].set_ylabel("width / ε / (rad/s)")
        row[2].set_ylabel("growth of the tip / ε / (m/s)")
    grid[0, 0].legend()
    figure = figure_of(grid[0, 0])
    note = "first order, no damping; the base moves 10 mm along or 1 mm across at ε = 1; the last column is not a zone"
    figure.supxlabel(note, fontsize=8, color="0.35")
    return figure


def _widths(arm: System, excitation: Excitation) -> list[np.ndarray]:
    if isinstance(excitation, TransverseBase):
        return list(np.moveaxis(forced_width(arm, excitation), -1, 0))
    # the width is proportional to epsilon: any small value will do
    sides = [quiet_boundary(arm, excitation, 1e-3, (mode, mode)) for mode in (1, 2, 3)]
    return [(upper - lower) / 1e-3 for lower, upper in sides]


def figure_accuracy(
    arm: System | None = None, epsilon: ArrayLike | None = None, *, axes: Panels | None = None
) -> Figure:
    """Draw the error of the boundaries against epsilon: first order has slope 2, second order slope 3.

    Parameters
    ----------
    arm : Arm, optional
        By default the nominal one with k_t = 1e4 N/m.
    epsilon : array_like, optional
    axes : pair of Axes, optional
    """
    arm = arm_or_nominal(arm, k_t=1e4)
    epsilon = np.geomspace(0.03, 0.12, 3) if epsilon is None else positive("epsilon", epsilon, "sizes", unit="1")
    grid = panels(axes, 1, 2, (8.6, 3.9), sharey=False)[0]
    cases = ((JOINT, (2, 2)), (JOINT, (1, 2))), ((STRONG, (2, 2)), (STRONG, (1, 2)))
    for ax, pair in zip(grid, cases, strict=True):
        if is_rigid(arm, pair[0][0]):
            say(ax, RIGID)
            continue
        for (excitation, resonance), marker in zip(pair, "os", strict=True):
            errors = boundary_errors(arm, excitation, epsilon, resonance)
            for order, (error, look) in enumerate(zip(errors, (FIRST, SECOND), strict=True), start=1):
                slope = np.polyfit(np.log(epsilon), np.log(error), 1)[0]
                name = f"({resonance[0]}, {resonance[1]}), order {order}: slope {slope:.2f}"
                fill = "white" if marker == "s" else look["color"]
                ax.loglog(epsilon, error, marker=marker, markersize=5, markerfacecolor=fill, label=name, **look)
        ax.set_xlabel(r"$\epsilon$")
        ax.set_xticks(epsilon, [f"{size:.2g}" for size in epsilon])
        ax.minorticks_off()
        ax.legend(fontsize=8, loc="lower right")
    grid[0].set_ylabel("largest error of the two sides / (rad/s)")
    grid[0].set_title("Joint stiffness: error against Floquet")
    grid[1].set_title("Base along the arm, 50 mm × ε")
    return figure_of(grid[0])


def boundary_errors(
    arm: System, excitation: Parametric, epsilon: NDArray[np.float64], resonance: tuple[int, int]
) -> np.ndarray:
    """Return the largest error of a zone's two sides at orders 1 and 2 against Floquet theory, rad/s.

    Returns
    -------
    ndarray, shape (2, len(epsilon))
    """
    truth = np.array([floquet_boundary(arm, excitation, size, resonance) for size in epsilon]).T
    found = [np.array(quiet_boundary(arm, excitation, epsilon, resonance, order=order)) for order in (1, 2)]
    return np.array([np.abs(sides - truth).max(axis=0) for sides in found])
