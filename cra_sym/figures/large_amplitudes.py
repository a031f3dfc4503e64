"""Large amplitudes: the arm that shortens as it bends, the joint that hardens under a shaken base, and basins."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.colors import ListedColormap
from matplotlib.figure import Figure
from numpy.typing import ArrayLike

from cra_sym.analysis.modal_parameters import modal_parameters
from cra_sym.analysis.response_curves import response_curves
from cra_sym.analysis.stability import stability_boundary
from cra_sym.analysis.steady_states import SteadyState
from cra_sym.arm.parameters import Arm
from cra_sym.checks import one_number
from cra_sym.figures import styled
from cra_sym.figures.drawing import BLUE, ORANGE, figure_of, panel
from cra_sym.figures.nonlinear import cubic_joint, show_curves
from cra_sym.figures.subject import arm_or_nominal
from cra_sym.model.excitations import AxialBase
from cra_sym.model.system import System

if TYPE_CHECKING:
    from matplotlib.axes import Axes

__all__ = ["figure_basins", "figure_shaken_across", "figure_shaken_along", "foreshortened_arm"]

_SOFT = {"k_t": 1e3, "zeta": 2e-3}
_SHADES = ("#F4F4F4", "#9ECAE1", "#FDD0A2", "#C7E9C0", "#DADAEB")


def foreshortened_arm(arm: Arm) -> System:
    """Return the arm that does not stretch, to third order: its tip draws near the joint as it bends.

    The bending energy has the factor 1 + v_x^2, and every section moves along the arm by u - s, where s is the integral
    of v_x^2/2 from the joint and u the motion of the base along the arm (Nayfeh and Pai 2004, with a tip mass).

    Parameters
    ----------
    arm : Arm

    Returns
    -------
    System
        With the prescribed motions w and u.
    """
    from sympy import Function

    from cra_sym.arm.lagrangian import paper_lagrangian
    from cra_sym.symbols import symbol, t, u, v, w, x

    density, _, right = paper_lagrangian()
    E, I_z, rho, A, m_e = (symbol(name) for name in ("E", "I_z", "rho", "A", "m_e"))
    s = Function("s")(x, t)
    along = (u.diff(t) - s.diff(t)) ** 2 / 2
    model = arm.model.replace(
        density=density - E * I_z * v.diff(x, 2) ** 2 * v.diff(x) ** 2 / 2 + rho * A * along,
        right=right + m_e * along,
        quadratures={s: v.diff(x) ** 2 / 2},
        prescribed=[w, u],
    )
    return model.at(arm.values, zeta=arm.zeta)


def figure_shaken_along(
    arm: Arm | None = None, *, amplitude: float = 2e-3, mode: int = 2, modes: int = 2, ax: Axes | None = None
) -> Figure:
    """Draw the amplitude of the tip inside and beside the tongue of a base that shakes along the arm.

    Nothing but the arm's own foreshortening limits it: the more it bends, the stiffer it is and the more inertia moves
    along. Stable solutions are bold. Shaded: where the arm at rest is unstable.

    Parameters
    ----------
    arm : Arm, optional
        Default: the nominal one with k_t = 1000 N/m and 0.2 % of damping.
    amplitude : float
        Of the base along the arm, m.
    mode : int
        Whose principal tongue, from 1.
    modes : int
        How many take part.
    ax : Axes, optional
    """
    from cra_sym.symbols import u

    arm = arm_or_nominal(arm, **_SOFT)
    one_number("amplitude", amplitude, low=0.0, open_low=True, unit="m")
    lower, upper = (float(side) for side in stability_boundary(arm, AxialBase(1.0), amplitude, (mode, mode)))
    width = upper - lower
    between, system = (lower - 1.5 * width, upper + width), foreshortened_arm(arm)
    curves = response_curves(system, between, drive={u: amplitude}, modes=max(modes, mode), harmonics=5, period=2)
    with styled():
        ax = panel(ax, (6.4, 3.9))
        show_curves(ax, curves, BLUE, "foreshortened arm")
        ax.axvspan(lower, upper, color="0.9", zorder=0)
        _labelled(ax)
        ax.set_title(f"$u$ = {1e3 * amplitude:g} mm along the arm, about $2\\omega_{mode}$")
    return figure_of(ax)


def figure_shaken_across(
    arm: Arm | None = None,
    *,
    k_3: float = 1e9,
    amplitude: float = 1e-4,
    mode: int = 2,
    modes: int = 2,
    zeta: float = 1e-2,
    ax: Axes | None = None,
) -> Figure:
    """Draw what the base's disturbance does to a joint that hardens, beside what it does to a linear one.

    The resonance leans to higher frequencies: where three solutions exist, the middle one is unstable (thin), and a
    sweep jumps.

    Parameters
    ----------
    arm : Arm, optional
        Default: the nominal one with k_t = 1000 N/m.
    k_3 : float
        Cubic stiffness, N/m3.
    amplitude : float
        Of the base across the arm, m.
    mode, modes : int
        Near which natural frequency; modes that take part.
    zeta : float
        Modal damping ratio.
    ax : Axes, optional
    """
    from cra_sym.symbols import w

    arm = arm_or_nominal(arm, k_t=1e3)
    omega = float(modal_parameters(arm, mode).omega[-1])
    between = (0.9 * omega, 1.25 * omega)
    with styled():
        ax = panel(ax, (6.4, 3.9))
        for size, color, word, marker in ((0.0, ORANGE, "linear joint", "^"), (k_3, BLUE, "hardening joint", "o")):
            system = cubic_joint(arm, size, zeta)
            curves = response_curves(system, between, drive={w: amplitude}, modes=max(modes, mode), harmonics=5)
            show_curves(ax, curves, color, word, marker)
        _labelled(ax)
        ax.set_title(f"$w$ = {1e3 * amplitude:g} mm across the arm, near $\\omega_{mode}$")
    return figure_of(ax)


def figure_basins(
    states: Sequence[SteadyState],
    displacement: ArrayLike,
    velocity: ArrayLike,
    *,
    mode: int = 1,
    cycles: int | None = None,
    ax: Axes | None = None,
) -> Figure:
    """Draw from which initial motions each of the stable steady states at one frequency is reached.

    Parameters
    ----------
    states : sequence of SteadyState
        Of one frequency.
    displacement, velocity : array_like
        Of the tip in the mode, m and m/s.
    mode, cycles : int
        As in :func:`cra_sym.basins`.
    ax : Axes, optional
    """
    from cra_sym.analysis.basins import basins

    reached = basins(states, displacement, velocity, mode=mode, cycles=cycles)
    shown = [k for k in range(-1, len(states)) if (reached == k).any()]
    with styled():
        ax = panel(ax, (5.6, 4.2))
        ax.pcolormesh(
            1e3 * np.asarray(displacement),
            velocity,
            np.searchsorted(shown, reached),
            cmap=ListedColormap(_SHADES[: len(shown)]),
            vmin=-0.5,
            vmax=len(shown) - 0.5,
            shading="nearest",
            rasterized=True,
        )
        for place, k in enumerate(shown):
            word = "none of them" if k < 0 else f"the state of {1e3 * states[k].amplitude:.2f} mm"
            ax.plot([], [], "s", color=_SHADES[place], markeredgecolor="0.4", label=word, linestyle="none")
        ax.set_xlabel(f"initial displacement of the tip in mode {mode} / mm")
        ax.set_ylabel("its initial velocity / (m/s)")
        ax.legend(loc="upper right", title="reaches", framealpha=0.85, frameon=True)
        ax.grid(False)
    return figure_of(ax)


def _labelled(ax: Axes) -> None:
    ax.set_xlabel("excitation frequency $\\varpi$ / (rad/s)")
    ax.set_ylabel("peak at the tip / mm")
    ax.set_ylim(bottom=0.0)
    ax.legend(loc="best")
