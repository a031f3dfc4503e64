"""Nonlinear vibration: what happens inside a tongue of instability, and backbones that bend."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib import style
from matplotlib.figure import Figure

from cra_sym.analysis.backbone import Backbone, backbone
from cra_sym.analysis.stability import stability_boundary
from cra_sym.analysis.steady_states import SteadyState, steady_states
from cra_sym.arm.excitations import JointStiffness
from cra_sym.arm.parameters import Arm
from cra_sym.figures import STYLE
from cra_sym.figures.drawing import BLUE, INK, ORANGE, figure_of, panels
from cra_sym.model.system import System
from cra_sym.solvers.harmonic_balance import Basis, peak

if TYPE_CHECKING:
    from matplotlib.axes import Axes

__all__ = [
    "cubic_joint",
    "figure_amplitude_map",
    "figure_backbone",
    "figure_inside_tongues",
    "figure_sweep",
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
    from sympy import Symbol

    from cra_sym.arm.lagrangian import paper_lagrangian

    field = arm.model.equations.fields[0]
    symbol = Symbol("k_3", real=True)
    model = arm.model.replace(left=paper_lagrangian()[1] - symbol * field**4 / 4)
    return model.at({**arm.values, "k_3": k_3}, zeta=arm.zeta if zeta is None else zeta)


def show_states(
    ax: Axes,
    states: Sequence[Sequence[SteadyState]],
    color: str,
    label: str,
    *,
    scale: float = 1e3,
    marker: str = "o",
) -> None:
    """Draw amplitudes over the excitation frequency: stable answers filled, unstable ones open.

    Parameters
    ----------
    ax : Axes
    states : sequence of sequence of SteadyState
    color, label, marker : str
    scale : float
        Amplitudes are drawn times this; 1000 for mm.
    """
    for stable, fill in ((True, color), (False, "white")):
        chosen = [s for found in states for s in found if s.stable is stable]
        ax.plot(
            [s.angular_frequency for s in chosen],
            [scale * s.amplitude for s in chosen],
            marker,
            markersize=3.5,
            markerfacecolor=fill,
            markeredgecolor=color,
            markeredgewidth=0.7,
            linestyle="none",
            label=label if stable else None,
        )


def figure_inside_tongues(
    arm: Arm | None = None,
    *,
    k_3: float = _CUBIC,
    epsilon: float = _EPSILON,
    modes: int = 3,
    points: int = 17,
    zeta: float = 1e-4,
    axes: Any = None,
) -> Figure:
    """Draw the amplitude of the tip inside and beside each principal tongue of an arm with a cubic joint.

    A joint that hardens (blue circles) bends the answers to higher frequencies, one that softens (orange triangles) to
    lower ones; stable answers are filled. Shaded: where the arm at rest is unstable. Beside it, on the side to which
    the answers bend, both rest and vibration are stable.

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
    points : int
        Frequencies of each.
    zeta : float
        Modal damping ratio.
    axes : sequence of Axes, optional
    """
    arm = Arm.nominal().replace(k_t=1e3) if arm is None else arm
    (row,) = panels(axes, 1, modes, (3.6 * modes, 3.7)).reshape(1, -1)
    excitation = JointStiffness(k_t=1.0)
    reach = 0.95 * np.sqrt(float(np.asarray(arm.k_t)) / k_3)  # beyond it a softening joint pushes away
    for number, ax in enumerate(row, 1):
        lower, upper = (float(side) for side in stability_boundary(arm, excitation, epsilon, (number, number)))
        width = upper - lower
        frequency = np.linspace(lower - width, upper + width, points)
        for sign, color, word, marker in ((1.0, BLUE, "hardening", "o"), (-1.0, ORANGE, "softening", "^")):
            system = cubic_joint(arm, sign * k_3, zeta)
            states = steady_states(
                system, frequency, excitation=excitation, epsilon=epsilon, period=2, harmonics=5, modes=modes
            )
            root = system.modes(modes).displacement(0, 0)
            near = [[s for s in found if _largest(root, s) < reach or sign > 0] for found in states]
            show_states(ax, near, color, word, marker=marker)
        ax.axvspan(lower, upper, color="0.9", zorder=0)
        ax.set_title(f"about $2\\omega_{number}$")
        ax.set_xlabel("excitation frequency $\\varpi$ / (rad/s)")
        ax.set_ylim(bottom=0.0)
    row[0].set_ylabel("peak at the tip / mm")
    row[0].legend(loc="upper left")
    return figure_of(row[0])


def swept(states: Sequence[Sequence[SteadyState]]) -> np.ndarray:
    """Return the amplitudes that a slow sweep passes: it keeps to the stable answer nearest to the last one.

    Parameters
    ----------
    states : sequence of sequence of SteadyState
        In the order of the sweep, which begins at rest.

    Returns
    -------
    ndarray, shape (frequencies,)
        nan where no stable answer is known.
    """
    last, found = 0.0, list[float]()
    for here in states:
        stable = np.array([state.amplitude for state in here if state.stable])
        last = float(stable[np.abs(stable - last).argmin()]) if stable.size else np.nan
        found.append(last)
    return np.array(found)


def figure_sweep(states: Sequence[Sequence[SteadyState]], *, ax: Any = None) -> Figure:
    """Draw what a slow sweep of the frequency upwards and one downwards meet: they jump at different frequencies.

    Parameters
    ----------
    states : sequence of sequence of SteadyState
        Ascending frequencies.
    ax : Axes, optional
    """
    with style.context(STYLE):
        ax = panels(None if ax is None else [ax], 1, 1, (6.4, 3.9)).ravel()[0]
        frequency = [here[0].angular_frequency for here in states]
        show_states(ax, states, "0.6", "all answers")
        ax.plot(frequency, 1e3 * swept(states), "-", color=BLUE, label="swept upwards")
        ax.plot(frequency, 1e3 * swept(states[::-1])[::-1], "--", color=ORANGE, label="swept downwards")
        ax.set_xlabel("excitation frequency $\\varpi$ / (rad/s)")
        ax.set_ylabel("peak at the tip / mm")
        ax.legend()
    return figure_of(ax)


def figure_amplitude_map(
    frequency: Any, epsilon: Any, amplitude: Any, boundary: Any = None, *, ax: Any = None
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
    with style.context(STYLE):
        ax = panels(None if ax is None else [ax], 1, 1, (6.4, 3.9)).ravel()[0]
        mesh = ax.pcolormesh(frequency, epsilon, 1e3 * np.asarray(amplitude), cmap="cividis", shading="nearest")
        ax.figure.colorbar(mesh, ax=ax, label="largest stable amplitude at the tip / mm")
        for side in () if boundary is None else boundary:
            ax.plot(side, epsilon, "-", color="white", linewidth=1.4)
        ax.set_xlim(np.min(frequency), np.max(frequency))
        ax.set_xlabel("excitation frequency $\\varpi$ / (rad/s)")
        ax.set_ylabel("$\\epsilon$")
    return figure_of(ax)


def _largest(rows: np.ndarray, state: SteadyState) -> float:
    """Return the peak of a displacement that has these values in the modes."""
    harmonics = state.coefficients.shape[1] // 2
    return float(peak(Basis.whole(harmonics, 1), rows, state.coefficients[None])[0][0])


def figure_backbone(
    system: System | None = None, *, mode: int = 1, modes: int = 6, points: int = 150, ax: Any = None
) -> Figure:
    """Draw the frequency of free vibration over its energy, with the turns at internal resonances.

    Parameters
    ----------
    system : System, optional
        Default: the nominal arm with k_t = 1000 N/m and a joint that hardens.
    mode, modes, points : int
        As in :func:`cra_sym.backbone`.
    ax : Axes, optional
    """
    system = cubic_joint(Arm.nominal().replace(k_t=1e3), _CUBIC) if system is None else system
    curve = backbone(system, mode, modes=modes, points=points)
    with style.context(STYLE):
        ax = panels(None if ax is None else [ax], 1, 1, (6.4, 3.9)).ravel()[0]
        _show_curve(ax, curve)
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
