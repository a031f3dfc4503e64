"""Model against model: what a thicker beam theory and a damper in the joint change; how eigenvalues move."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import ArrayLike

from cra_sym.figures import styled
from cra_sym.figures.drawing import Panels, figure_of, panel, panels

if TYPE_CHECKING:
    from matplotlib.axes import Axes

__all__ = ["figure_damped_joint", "figure_eigenvalues", "figure_slenderness"]


def figure_slenderness(
    slenderness: ArrayLike, thin: ArrayLike, thick: ArrayLike, *, axes: Panels | None = None
) -> Figure:
    """Draw the frequencies of a thin and of a thick beam theory, in Hz and as their ratio.

    Parameters
    ----------
    slenderness : array_like, shape (n,)
        Length over thickness.
    thin, thick : array_like, shape (n, modes)
        Natural frequencies in Hz after Euler-Bernoulli and after Timoshenko.
    axes : pair of Axes, optional
    """
    slenderness, thin, thick = (np.asarray(a, dtype=float) for a in (slenderness, thin, thick))
    with styled():
        ((left, right),) = panels(axes, 1, 2, (8.6, 3.9))
        for mode in range(thick.shape[1]):
            (line,) = left.loglog(slenderness, thick[:, mode], linestyle="-", label=f"$f_{mode + 1}$")
            left.loglog(slenderness, thin[:, mode], linestyle=":", linewidth=1.2, color=line.get_color())
            right.semilogx(slenderness, thick[:, mode] / thin[:, mode], label=f"$f_{mode + 1}$")
        left.set_ylabel("natural frequency / Hz")
        left.set_title("Timoshenko (solid), Euler-Bernoulli (dotted)")
        right.set_ylabel("Timoshenko / Euler-Bernoulli")
        right.set_title("a stout arm is softer, high modes most")
        right.axhline(1.0, color="0.75", linewidth=0.8, linestyle="-")
        for ax in (left, right):
            ax.set_xlabel("slenderness $L/h$")
            ax.legend()
    return figure_of(right)


def figure_damped_joint(damper: ArrayLike, ratio: ArrayLike, *, ax: Axes | None = None) -> Figure:
    """Draw modal damping ratios against the coefficient of a viscous damper in the joint.

    Parameters
    ----------
    damper : array_like, shape (n,)
        N s/m.
    ratio : array_like, shape (n, modes)
    ax : Axes, optional
    """
    with styled():
        ax = panel(ax, (6.4, 3.9))
        for mode, values in enumerate(np.asarray(ratio, dtype=float).T):
            ax.loglog(damper, values, label=f"mode {mode + 1}")
        ax.set_xlabel("damper in the joint $c_j$ / (N s/m)")
        ax.set_ylabel("damping ratio $\\zeta$")
        ax.set_title("Too weak dissipates little, too strong holds the joint still")
        ax.legend()
    return figure_of(ax)


def figure_eigenvalues(eigenvalues: ArrayLike, parameter: ArrayLike, *, label: str, ax: Axes | None = None) -> Figure:
    """Draw how complex eigenvalues move as a parameter grows.

    Parameters
    ----------
    eigenvalues : array_like of complex, shape (n, modes)
        1/s.
    parameter : array_like, shape (n,)
    label : str
        What the parameter is, with its unit, for the colour bar.
    ax : Axes, optional
    """
    eigenvalues, parameter = np.asarray(eigenvalues, dtype=complex), np.asarray(parameter, dtype=float)
    with styled():
        ax = panel(ax, (6.4, 4.4))
        ax.axvline(0.0, color="0.75", linewidth=0.8)
        for number, values in enumerate(eigenvalues.T):
            points = ax.scatter(
                values.real, values.imag, c=parameter, s=12, marker="os^Dv"[number % 5], cmap="viridis", linewidths=0
            )
        ax.figure.colorbar(points, ax=ax, label=label)
        ax.set_xlabel("growth Re $s$ / (1/s)")
        ax.set_ylabel("oscillation Im $s$ / (rad/s)")
        ax.set_title("Right of the line motions grow")
    return figure_of(ax)
