"""Sensitivities of the frequencies to the two stiffnesses of the joint (Fig. 5): raw as in the paper, and compared."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.figure import Figure

from cra_sym.analysis.sensitivities import sensitivities
from cra_sym.arm.parameters import Arm
from cra_sym.figures.drawing import Panels, figure_of, panels
from cra_sym.figures.modes import decades
from cra_sym.figures.subject import arm_or_nominal
from cra_sym.model.system import System

if TYPE_CHECKING:
    from matplotlib.axes import Axes

__all__ = ["figure_5"]

_MARKED = {"k_t": (1e5, 1e4, 1e3), "k_r": (1e4, 1e3, 1e2)}
_UNITS = {"k_t": "N/m", "k_r": "N m/rad"}
_NAMES = {"k_t": "translational stiffness $k_t$ / (N/m)", "k_r": "rotational stiffness $k_r$ / (N m/rad)"}


def figure_5(arm: System | None = None, *, axes: Panels | None = None) -> Figure:
    """Draw the sensitivities of f1, f2, f3 to k_t and to k_r, each with the other spring as the arm has it.

    Upper row: raw, in different units, so that the two panels cannot be compared. Lower row: logarithmic, on one scale.
    Circles mark the stiffnesses that the paper's series are taken to be.

    Parameters
    ----------
    arm : Arm, optional
        By default the nominal one, whose joint is rigid.
    axes : 2 x 2 array of Axes, optional
    """
    arm = arm_or_nominal(arm)
    grid = panels(axes, 2, 2, (8.6, 6.4), sharex="col")
    (raw_t, raw_r), (log_t, log_r) = grid
    if axes is None:
        log_r.sharey(log_t)
    for name, raw, log, low in (("k_t", raw_t, log_t, 0), ("k_r", raw_r, log_r, -1)):
        stiffness = decades(arm, name, low, 6, 281)
        found, marked = (
            sensitivities(arm.replace(**{name: values}), by=[name]) for values in (stiffness, _MARKED[name])
        )
        _curves(raw, name, stiffness, found.rate[name], marked.rate[name])
        _curves(log, name, stiffness, found.log[name], marked.log[name])
        raw.set_yscale("log")
        raw.set_ylabel(f"$\\partial f/\\partial {name}$ / (Hz per {_UNITS[name]})")
        log.set_ylabel(f"$\\partial\\ln f/\\partial\\ln {name}$")
        log.set_xlabel(_NAMES[name])
        log.set_ylim(-0.02, 0.56)
        log.axhline(0.5, color="0.45", linestyle=(0, (4, 2)), linewidth=0.9)
    raw_t.set_title("Fig. 5  Raw: units differ, not comparable")
    raw_r.set_title("other spring rigid, $m_e$ = 1 g" if arm == Arm.nominal() else "", fontweight="normal")
    log_t.set_title("Logarithmic: share of the strain energy, halved")
    where: dict[str, Any] = {"transform": log_t.get_yaxis_transform(), "ha": "right", "va": "bottom"}
    log_t.text(0.98, 0.503, "all strain energy in the spring", fontsize=8, color="0.35", **where)
    raw_t.legend(loc="lower left")
    return figure_of(raw_t)


def _curves(ax: Axes, name: str, stiffness: np.ndarray, found: np.ndarray, marked: np.ndarray) -> None:
    for mode in range(3):
        (line,) = ax.semilogx(stiffness, found[:, mode], label=f"mode {mode + 1}")
        ax.plot(_MARKED[name], marked[:, mode], "o", color=line.get_color(), markersize=4.5, markerfacecolor="white")
