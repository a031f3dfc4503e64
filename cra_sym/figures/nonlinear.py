"""Nonlinear vibration: what happens inside a tongue of instability, and backbones that bend."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import cache
from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import ArrayLike

from cra_sym.analysis.backbone import Backbone, backbone
from cra_sym.analysis.response_curves import ResponseCurve, response_curves
from cra_sym.analysis.stability import stability_boundary
from cra_sym.analysis.steady_states import SteadyState
from cra_sym.arm.excitations import JointStiffness
from cra_sym.arm.parameters import Arm
from cra_sym.checks import count, one_number
from cra_sym.figures import styled
from cra_sym.figures.drawing import BLUE, INK, ORANGE, Panels, figure_of, panel, panels
from cra_sym.figures.subject import arm_or_nominal
from cra_sym.model.system import System
from cra_sym.solvers.harmonic_balance import Basis, peak

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from cra_sym.model.lagrangian import Model

__all__ = [
    "cubic_joint",
    "figure_amplitude_map",
    "figure_backbone",
    "figure_inside_tongues",
    "figure_sweep",
    "show_curves",
    "show_states",
    "swept",
]

_EPSILON, _CUBIC = 0.3, 1e9


def cubic_joint(arm: Arm, k_3: float, zeta: float | None = None) -> System:
    """Return the arm with a joint of force k_t v + k_3 v^3.

    Parameters
    ----------
    arm : Arm
    k_3 : float
        N/m3; hardening if positive.
    zeta : float, optional
        Modal damping ratio; default: that of the arm.
    """
    return _with_cubic(arm.model).at({**arm.values, "k_3": k_3}, zeta=arm.zeta if zeta is None else zeta)


@cache
def _with_cubic(model: Model) -> Model:
    from sympy import Symbol

    from cra_sym.arm.lagrangian import paper_lagrangian

    return model.replace(left=paper_lagrangian()[1] - Symbol("k_3", real=True) * model.equations.fields[0] ** 4 / 4)


def show_states(ax: Axes, states: Sequence[Sequence[SteadyState]], color: str, label: str) -> None:
    """Draw amplitudes over the excitation frequency: stable solutions filled, unstable ones open.

    Parameters
    ----------
    ax : Axes
    states : sequence of sequence of SteadyState
    color, label : str
    """
    for stable, fill in ((True, color), (False, "white")):
        chosen = [s for found in states for s in found if s.stable is stable]
        ax.plot(
            [s.angular_frequency for s in chosen],
            [1e3 * s.amplitude for s in chosen],
            "o",
            markersize=3.5,
            markerfacecolor=fill,
            markeredgecolor=color,
            markeredgewidth=0.7,
            linestyle="none",
            label=label if stable else None,
        )


def show_curves(ax: Axes, curves: Sequence[ResponseCurve], color: str, label: str, marker: str = "o") -> None:
    """Draw amplitudes over the excitation frequency: stable solutions bold with marks, unstable ones thin.

    Parameters
    ----------
    ax : Axes
    curves : sequence of ResponseCurve
    color, label, marker : str
    """
    look: dict[str, Any] = {"color": color, "marker": marker, "markersize": 3.5}
    ax.plot([], [], "-", label=label, **look)
    for curve in curves:
        frequency, size = curve.angular_frequency, 1e3 * curve.amplitude
        lost = np.convolve(~curve.stable, np.ones(3), "same") > 0  # up to the next stable points
        kept = np.where(curve.stable, size, np.nan)
        ax.plot(frequency, np.where(lost, size, np.nan), "-", color=color, linewidth=0.6)
        if np.isfinite(kept).any():
            ax.plot(frequency, kept, "-", markevery=0.08, **look)


def figure_inside_tongues(
    arm: Arm | None = None,
    *,
    k_3: float = _CUBIC,
    epsilon: float = _EPSILON,
    modes: int = 3,
    zeta: float = 1e-4,
    axes: Panels | None = None,
) -> Figure:
    """Draw the amplitude of the tip inside and beside each principal tongue of an arm with a cubic joint.

    A joint that hardens (blue circles) bends the curves to higher frequencies, one that softens (orange triangles) to
    lower ones; stable solutions are bold. Shaded: where the arm at rest is unstable. Beside it, on the side to which
    the curves bend, both rest and vibration are stable.

    Parameters
    ----------
    arm : Arm, optional
        Default: the nominal one with k_t = 1000 N/m.
    k_3 : float
        Size of the cubic stiffness, N/m3; both signs are drawn.
    epsilon : float
        Of the fluctuation of k_t.
    modes : int
        How many tongues.
    zeta : float
        Modal damping ratio.
    axes : sequence of Axes, optional
    """
    arm = arm_or_nominal(arm, k_t=1e3)
    (row,) = panels(axes, 1, count("modes", modes), (3.6 * modes, 3.7))
    k_3 = one_number("k_3", k_3, low=0.0, open_low=True, unit="N/m^3")
    excitation = JointStiffness(k_t=1.0)
    reach = 0.95 * np.sqrt(float(np.asarray(arm.k_t)) / k_3)  # beyond it a softening joint pushes away
    for number, ax in enumerate(row, 1):
        lower, upper = (float(side) for side in stability_boundary(arm, excitation, epsilon, (number, number)))
        width = upper - lower
        for sign, color, word, marker in ((1.0, BLUE, "hardening", "o"), (-1.0, ORANGE, "softening", "^")):
            system = cubic_joint(arm, sign * k_3, zeta)
            curves = response_curves(
                system,
                (lower - width, upper + width),
                excitation=excitation,
                epsilon=epsilon,
                period=2,
                harmonics=5,
                modes=modes,
            )
            root = system.modes(modes).displacement(0, 0)
            near = [curve if sign > 0 else _within(curve, root, reach) for curve in curves]
            show_curves(ax, near, color, word, marker)
        ax.axvspan(lower, upper, color="0.9", zorder=0)
        ax.set_title(f"about $2\\omega_{number}$")
        ax.set_xlabel("excitation frequency $\\varpi$ / (rad/s)")
        ax.set_ylim(bottom=0.0)
    row[0].set_ylabel("peak at the tip / mm")
    row[0].legend(loc="upper left")
    return figure_of(row[0])


def swept(states: Sequence[Sequence[SteadyState]]) -> np.ndarray:
    """Return the amplitudes of a slow sweep, which follows the stable solution nearest to the previous one.

    Parameters
    ----------
    states : sequence of sequence of SteadyState
        In the order of the sweep, which begins at rest.

    Returns
    -------
    ndarray, shape (frequencies,)
        nan where no stable solution is known.
    """
    last, found = 0.0, list[float]()
    for here in states:
        stable = np.array([state.amplitude for state in here if state.stable])
        last = float(stable[np.abs(stable - last).argmin()]) if stable.size else np.nan
        found.append(last)
    return np.array(found)


def figure_sweep(states: Sequence[Sequence[SteadyState]], *, ax: Axes | None = None) -> Figure:
    """Draw what a slow sweep of the frequency upwards and one downwards meet: they jump at different frequencies.

    Parameters
    ----------
    states : sequence of sequence of SteadyState
        Ascending frequencies.
    ax : Axes, optional
    """
    with styled():
        ax = panel(ax, (6.4, 3.9))
        frequency = [here[0].angular_frequency for here in states]
        show_states(ax, states, "0.6", "all solutions")
        ax.plot(frequency, 1e3 * swept(states), "-", color=BLUE, label="swept upwards")
        ax.plot(frequency, 1e3 * swept(states[::-1])[::-1], "--", color=ORANGE, label="swept downwards")
        ax.set_xlabel("excitation frequency $\\varpi$ / (rad/s)")
        ax.set_ylabel("peak at the tip / mm")
        ax.legend()
    return figure_of(ax)


def figure_amplitude_map(
    frequency: ArrayLike,
    epsilon: ArrayLike,
    amplitude: ArrayLike,
    boundary: Sequence[ArrayLike] | None = None,
    *,
    ax: Axes | None = None,
) -> Figure:
    """Draw the largest stable amplitude over the chart of excitation frequency and size.

    Parameters
    ----------
    frequency : array_like, shape (n,)
        rad/s.
    epsilon : array_like, shape (m,)
    amplitude : array_like, shape (m, n)
        m.
    boundary : pair of array_like, shape (m,), optional
        Where rest loses its stability.
    ax : Axes, optional
    """
    with styled():
        ax = panel(ax, (6.4, 3.9))
        mesh = ax.pcolormesh(frequency, epsilon, 1e3 * np.asarray(amplitude), cmap="cividis", shading="nearest")
        ax.figure.colorbar(mesh, ax=ax, label="largest stable amplitude at the tip / mm")
        for side in () if boundary is None else boundary:
            ax.plot(side, epsilon, "-", color="white", linewidth=1.4)
        ax.set_xlim(np.min(frequency), np.max(frequency))
        ax.set_xlabel("excitation frequency $\\varpi$ / (rad/s)")
        ax.set_ylabel("$\\epsilon$")
    return figure_of(ax)


def _within(curve: ResponseCurve, rows: np.ndarray, reach: float) -> ResponseCurve:
    """Return a curve where the peak of a displacement that has these values in the modes is below a reach."""
    largest, _ = peak(Basis.whole(curve.coefficients.shape[2] // 2, 1), rows, curve.coefficients)
    return replace(curve, amplitude=np.where(largest < reach, curve.amplitude, np.nan))


def figure_backbone(
    system: System | None = None,
    *,
    mode: int = 1,
    modes: int = 6,
    points: int = 120,
    branches: bool = False,
    k_3: float = _CUBIC,
    ax: Axes | None = None,
) -> Figure:
    """Draw the frequency of free vibration over its energy, with the turns at internal resonances.

    Parameters
    ----------
    system : System, optional
        Nonlinear. An arm is given a joint of cubic stiffness, and k_t = 1000 N/m if it is rigid; default: the nominal
        one.
    mode, modes, points, branches
        As in :func:`cra_sym.backbone`; branches are dashed.
    k_3 : float
        Of the joint of an arm, N/m3.
    ax : Axes, optional
    """
    system = Arm.nominal() if system is None else system
    if isinstance(system, Arm):
        system = cubic_joint(system if np.all(np.isfinite(system.k_t)) else system.replace(k_t=1e3), k_3)
    curve = backbone(system, mode, modes=modes, points=points, branches=branches)
    with styled():
        ax = panel(ax, (6.4, 3.9))
        _show_curve(ax, curve)
        ax.axis(ax.axis())  # that of the curve itself
        for other in curve.branches:
            ax.semilogx(other.energy, other.angular_frequency / (2 * np.pi), "--", color="0.5", linewidth=0.9)
        ax.set_xlabel("energy / J")
        ax.set_ylabel("frequency / Hz")
    return figure_of(ax)


def _show_curve(ax: Axes, curve: Backbone) -> None:
    hertz = curve.angular_frequency / (2 * np.pi)
    ax.semilogx(curve.energy, hertz, color=INK, linewidth=0.8)
    for stable, color, word in ((True, BLUE, "stable"), (False, ORANGE, "unstable")):
        here = curve.stable == stable
        ax.semilogx(curve.energy[here], hertz[here], ".", color=color, markersize=4, linestyle="none", label=word)
    ax.legend()
