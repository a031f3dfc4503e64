"""Fig. 4, which needs the sign-flipped arm of claim C03 beside the derived one."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from cra_sym.analysis.modes import natural_frequencies
from cra_sym.arm.parameters import Arm
from cra_sym.figures.modes import draw_in_hertz, draw_relative, panels
from cra_sym.paper.oracles.flipped import flipped_frequencies

if TYPE_CHECKING:
    from matplotlib.figure import Figure

__all__ = ["figure_4"]


def figure_4(arm: Arm | None = None, k_r: Any = None, *, axes: Any = None) -> Figure:
    """Draw f1, f2, f3 against the joint's rotational stiffness: as derived, and with the spring's sign flipped.

    The left column follows from the Lagrangian. The right one from the same Lagrangian with the sign of the rotational
    spring's energy flipped, EI v_xx(0) = -k_r v_x(0): it shows the rising f2 and f3 and the seemingly flat f1 that the
    paper reports.

    Parameters
    ----------
    arm : Arm, optional
        By default the nominal one.
    k_r : array_like, optional
        Stiffnesses in N m/rad, by default 1e2 to 1e5.
    axes : 2 x 2 array of Axes, optional
    """
    arm = arm or Arm.nominal()
    k_r = np.logspace(2, 5, 301) if k_r is None else np.asarray(k_r, dtype=float)
    figure, grid = panels(axes, 2, 2, (8.6, 6.6), sharey="row")
    (top_left, top_right), (low_left, low_right) = grid
    rigid = natural_frequencies(arm.replace(k_r=np.inf))
    derived, flipped = natural_frequencies(arm.replace(k_r=k_r)), flipped_frequencies(arm.replace(k_r=k_r))
    for upper, lower, found in ((top_left, low_left, derived), (top_right, low_right, flipped)):
        draw_in_hertz(upper, k_r, found, rigid, "k_r")
        draw_relative(lower, k_r, found / rigid, "k_r")
        upper.set_xlabel("")
    for ax in (top_right, low_right):
        ax.set_ylabel("")
    top_left.set_title("Fig. 4  Derived: $EI\\,v_{xx}(0)=+k_r\\,v_x(0)$")
    top_right.set_title("Sign flipped: $EI\\,v_{xx}(0)=-k_r\\,v_x(0)$")
    low_left.set_title("all fall, near the rigid joint by the same fraction", fontweight="normal")
    low_right.set_title("all rise; in hertz f1 only seems unchanged", fontweight="normal")
    return figure
