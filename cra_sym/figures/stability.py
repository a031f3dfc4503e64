"""Zones of parametric instability (Figs. 11 and 12): boundaries by multiple scales over growth by Floquet theory."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.figure import Figure

from cra_sym.analysis.eigenvalues import oscillating_frequencies
from cra_sym.analysis.floquet import growth_rate
from cra_sym.analysis.stability import judged_boundary
from cra_sym.arm.excitations import JointStiffness
from cra_sym.arm.parameters import Arm
from cra_sym.checks import count, one_number
from cra_sym.figures.drawing import Panels, figure_of, panel, panels
from cra_sym.figures.subject import arm_or_nominal, default_excitation, rigid_body_modes, several, single
from cra_sym.model.excitations import AxialBase, Fluctuation, Parametric
from cra_sym.model.system import System

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.contour import QuadContourSet

__all__ = [
    "figure_11",
    "figure_11_axial",
    "figure_12",
    "figure_12_axial",
    "figure_combinations",
    "figure_zones",
]

#: Assumed: the paper's values of k_t are lost; the masses are published but for the first.
K_T, M_E = (1e5, 1e4, 1e3), (0.0, 0.001, 0.005)
AXIAL, JOINT = AxialBase(0.01), JointStiffness()
RIGID = "no zone: a rigid joint cannot\nfluctuate; give $k_t$, as 1e4 N/m"
_GROWTH = "YlOrBr"
FIRST: dict[str, Any] = {"color": "#0072B2", "linestyle": (0, (4, 2)), "linewidth": 1.2}
SECOND: dict[str, Any] = {"color": "#111111", "linestyle": "-", "linewidth": 1.2}


def _described(excitation: Parametric) -> str:
    if isinstance(excitation, AxialBase):
        return f"base shakes along the arm, {1e3 * np.max(excitation.amplitude):g} mm × ε"
    if isinstance(excitation, Fluctuation) and not isinstance(excitation, JointStiffness):
        return f"{', '.join(name for name, weight in excitation.weights.items() if weight)} × (1 + ε cos ϖt)"
    return "joint stiffness fluctuates" if isinstance(excitation, JointStiffness) else "as the Lagrangian says"


def quiet_boundary(*given: Any, **more: Any) -> tuple[np.ndarray, np.ndarray]:
    """Return the sides of a zone without the warnings about it, since the figure shows what they would say."""
    lower, upper, _ = judged_boundary(*given, **more)
    return lower, upper


def _growth(
    system: System,
    excitation: Parametric,
    frequency: np.ndarray,
    epsilon: np.ndarray,
    modes: int,
    tolerance: float = 1e-7,
) -> np.ndarray:
    """Return the growth rate over a chart, converged in the number of modes where springs of ends alone act."""
    # dampers, gyroscopic and follower forces act between the modes: none is left out then
    residual = bool(excitation.springs(system)) and bool(system.numerics("conservative"))
    return growth_rate(system, excitation, frequency, epsilon[:, None], modes, residual=residual, tolerance=tolerance)


def is_rigid(system: System, excitation: Parametric) -> bool:
    """Tell whether it is the stiffness of a rigid joint that should fluctuate."""
    return isinstance(excitation, JointStiffness) and bool(np.isinf(system.values["k_t"]))


def _excitation(system: System, given: Parametric | None, of_an_arm: Parametric) -> Parametric:
    if given is not None:
        return given
    return of_an_arm if isinstance(system, Arm) else default_excitation(system)


def say(ax: Axes, words: str) -> None:
    """Write a remark in the lower left corner."""
    ax.text(0.03, 0.04, words, transform=ax.transAxes, fontsize=7.5, color="0.25", va="bottom")


def _zone(
    ax: Axes, arm: System, excitation: Parametric, mode: int, epsilon: np.ndarray, points: int, tolerance: float = 1e-7
) -> None:
    """Draw one principal zone against its detuning."""
    modes, more = (min(number, arm.most_modes) for number in (max(mode, 3), mode + 2))
    second = quiet_boundary(arm, excitation, epsilon, (mode, mode), order=2, modes=modes)
    middle = 0.5 * (second[0] + second[1])
    if arm.conservative_part is arm:
        centre = 2 * float(arm.natural_frequencies(modes)[mode - 1])
    else:  # where the zone starts
        centre = float(middle[np.isfinite(middle)][0]) if np.isfinite(middle).any() else 0.0
    width = second[1] - second[0]  # the second order shifts the zone and keeps its width
    first, half = (centre - width / 2, centre + width / 2), width[-1] / 2
    if not half > 0:
        say(ax, RIGID if is_rigid(arm, excitation) else "no zone up to this ε")
        ax.set_xticks([0])
        ax.set_ylim(0.0, epsilon[-1])
        return
    detuning = np.linspace(-1.7, 1.7, points) * half
    rates = _growth(arm, excitation, centre + detuning, epsilon, more, tolerance)
    _shade(ax, detuning, epsilon, rates)
    for sides, look in ((first, FIRST), (second, SECOND)):
        for side in sides:
            ax.plot(side - centre, epsilon, **look)
    ax.set_xlim(detuning[0], detuning[-1])
    ax.set_ylim(0.0, epsilon[-1])
    ax.ticklabel_format(axis="x", style="sci", scilimits=(-2, 3), useMathText=True)
    ax.locator_params(axis="x", nbins=4)
    ax.grid(False)
    say(ax, f"$2\\omega_{mode}$ = {centre:.4g} rad/s\nwidth {2 * half:.3g} rad/s")


def _shade(
    ax: Axes, frequency: np.ndarray, epsilon: np.ndarray, rates: np.ndarray, step: float | None = None
) -> QuadContourSet | None:
    """Shade growth rates in steps; the rest stays white. Return None if there is no growth."""
    top = rates.max()
    if not top > 0:
        return None
    levels = np.linspace(0.02, 1.0, 7) * top if step is None else np.r_[0.1 * step, np.arange(step, top + step, step)]
    return ax.contourf(frequency, epsilon, rates, levels=levels, cmap=_GROWTH, antialiased=False)


def _principal_zones(
    arms: Sequence[tuple[str, System]],
    excitation: Parametric,
    epsilon: float,
    title: str,
    axes: Panels | None,
    points: int,
    tolerance: float = 1e-7,
) -> Figure:
    """Draw the zones of the first three elastic modes, or as many as there are, a row an arm."""
    count("points", points, low=2)
    one_number("epsilon", epsilon, low=0.0, open_low=True, unit="1")
    first = 1 + max(rigid_body_modes(arm) for _, arm in arms)
    shown = min(3, *(arm.most_modes + 1 - first for _, arm in arms))
    grid = panels(axes, len(arms), shown, (2.8 * shown, 1.95 * len(arms) + 0.8), sharey=True)
    sizes = np.linspace(0.0, epsilon, points)
    for row, (label, arm) in zip(grid, arms, strict=True):
        for mode, ax in enumerate(row, start=first):
            _zone(ax, arm, excitation, mode, sizes, points, tolerance)
        row[0].set_ylabel(f"{label}\n$\\epsilon$".strip())
    for mode, ax in enumerate(grid[0], start=first):
        ax.set_title(f"{title}mode {mode}" if mode == first else f"mode {mode}")
    for mode, ax in enumerate(grid[-1], start=first):
        ax.set_xlabel(rf"$\varpi - 2\omega_{mode}$ / (rad/s)")
    handles = [grid[0, 0].plot([], [], **look)[0] for look in (FIRST, SECOND)]
    figure = figure_of(grid[0, 0])
    names = ("multiple scales, first order", "second order, all modes")
    note = f"shaded: growth by Floquet theory; {_described(excitation)}; widths at ε = {epsilon:g}, scales differ"
    figure.legend(handles, names, loc="outside lower center", ncols=2, title=note, title_fontsize=8)
    return figure


def figure_zones(
    system: System | None = None,
    excitation: Parametric | None = None,
    epsilon: float = 0.3,
    *,
    axes: Panels | None = None,
    points: int = 37,
    tolerance: float = 1e-7,
) -> Figure:
    """Draw the principal zones of the first three modes of one system.

    Parameters
    ----------
    system : System, optional
        By default the nominal arm with k_t = 1e4 N/m.
    excitation : Fluctuation, AxialBase or another parametric one, optional
        By default what the Lagrangian itself says, for an arm `JointStiffness()`, else the stiffness of an end, or
        the other stiffness, that the first frequency depends on most.
    epsilon : float
        Top of the axis.
    axes : three Axes, optional
        One for each mode shown.
    points : int
        Points of the Floquet chart along each axis.
    tolerance : float
        Relative error of the monodromy matrices.
    """
    system = single(Arm.nominal().replace(k_t=1e4) if system is None else system)
    excitation = _excitation(system, excitation, JOINT)
    return _principal_zones([("", system)], excitation, epsilon, "Zones of ", axes, points, tolerance)


def figure_11(
    arm: System | None = None,
    k_t: Sequence[float] = K_T,
    excitation: Parametric = JOINT,
    epsilon: float = 0.3,
    *,
    axes: Panels | None = None,
    points: int = 37,
) -> Figure:
    """Draw the principal zones of the first three modes for three translational stiffnesses of the joint.

    Parameters
    ----------
    arm : Arm, optional
        By default the nominal one.
    k_t : sequence of float
        N/m, a row each.
    excitation : JointStiffness or AxialBase
    epsilon : float
        Top of the axis.
    axes : array of Axes, optional
    points : int
        Points of the Floquet chart along each axis.
    """
    arm = arm_or_nominal(arm)
    arms = [
        (f"$k_t$ = {_power(k)} N/m", arm.replace(k_t=k))
        for k in several("k_t", k_t, "stiffnesses", 1, low=0.0, open_low=True, allow_infinite=True, unit="N/m")
    ]
    return _principal_zones(arms, excitation, epsilon, "Fig. 11  ", axes, points)


def figure_11_axial(arm: System | None = None) -> Figure:
    """Draw Fig. 11 for a base that shakes along the arm."""
    return figure_11(arm, excitation=AXIAL, epsilon=0.2)


def figure_12(
    arm: System | None = None,
    m_e: Sequence[float] = M_E,
    excitation: Parametric = JOINT,
    epsilon: float = 0.3,
    *,
    axes: Panels | None = None,
    points: int = 37,
) -> Figure:
    """Draw the principal zones of the first three modes for three end-effectors.

    Parameters
    ----------
    arm : Arm, optional
        By default the nominal one with k_t = 1e4 N/m: a rigid joint has no stiffness that could fluctuate.
    m_e : sequence of float
        kg, a row each.
    excitation, epsilon, axes, points
        As in :func:`figure_11`.
    """
    arm = arm_or_nominal(arm, k_t=1e4)
    arms = [
        (f"$m_e$ = {1e3 * m:g} g", arm.replace(m_e=m)) for m in several("m_e", m_e, "masses", 1, low=0.0, unit="kg")
    ]
    return _principal_zones(arms, excitation, epsilon, "Fig. 12  ", axes, points)


def figure_12_axial(arm: System | None = None) -> Figure:
    """Draw Fig. 12 for a base that shakes along the arm."""
    return figure_12(arm, excitation=AXIAL, epsilon=0.2)


def _power(value: float) -> str:
    if np.isinf(value):
        return r"$\infty$"
    exponent = np.log10(value)
    return f"$10^{{{exponent:.0f}}}$" if abs(exponent - round(exponent)) < 1e-9 else f"{value:g}"


def figure_combinations(
    system: System | None = None,
    excitation: Parametric | None = None,
    epsilon: float | None = None,
    *,
    ax: Axes | None = None,
    points: int = 420,
) -> Figure:
    """Draw the whole chart: principal and combination resonances of three modes, with their names.

    Parameters
    ----------
    system : System, optional
        By default the nominal arm with k_t = 1e3 N/m.
    excitation : Fluctuation, AxialBase or another parametric one, optional
        By default what the Lagrangian itself says, for an arm a base that shakes along it, else as `figure_zones`.
    epsilon : float, optional
        Top of the axis; by default 1 for a base that shakes, else 0.5.
    ax : Axes, optional
    points : int
        Points of the Floquet chart along the frequency axis.
    """
    system = single(Arm.nominal().replace(k_t=1e3) if system is None else system)
    excitation = _excitation(system, excitation, AXIAL)
    epsilon = (1.0 if isinstance(excitation, AxialBase) else 0.5) if epsilon is None else epsilon
    count("points", points, low=6)
    epsilon = one_number("epsilon", epsilon, low=0.0, open_low=True, unit="1")
    ax = panel(ax, (9.4, 5.0))
    still = rigid_body_modes(system)
    last, shown = (min(still + more, system.most_modes) for more in (3, 4))
    if last == still:
        raise ValueError("system: has rigid-body motions alone; must have a mode that vibrates")
    omega = oscillating_frequencies(system, last)
    frequency = np.linspace(0.5 * omega[still], 2.2 * omega[-1], points)
    sizes = np.linspace(0.0, epsilon, points // 3)
    rates = np.sqrt(_growth(system, excitation, frequency, sizes, shown))
    mesh = _shade(ax, frequency, sizes, rates, step=1.0 if rates.max() > 3 else None)
    for m in range(still + 1, last + 1):
        for n in range(m, last + 1):
            for side in quiet_boundary(system, excitation, sizes, (m, n), order=2, modes=last):
                ax.plot(side, sizes, **SECOND | {"linewidth": 0.9})
            name = f"$2\\omega_{m}$" if m == n else f"$\\omega_{m}+\\omega_{n}$"
            _name(ax, name, omega[m - 1] + omega[n - 1], epsilon)
        for side in quiet_boundary(system, excitation, sizes, (m, m), order=2, tongue=2, modes=last):
            ax.plot(side, sizes, **FIRST | {"linewidth": 0.9})
        _name(ax, f"$\\omega_{m}$", omega[m - 1], epsilon, above=16, color=FIRST["color"])
    ax.set_xlim(frequency[0], frequency[-1])
    ax.set_ylim(0, epsilon)
    ax.grid(False)
    ax.set_xlabel(r"excitation frequency $\varpi$ / (rad/s)")
    ax.set_ylabel(r"$\epsilon$")
    ax.set_title(f"Principal and sum resonances: {_described(excitation)}", pad=32)
    handles = [ax.plot([], [], **look)[0] for look in (SECOND, FIRST)]
    figure = figure_of(ax)
    names = ("multiple scales, second order", "second tongue, width of order ε²")
    note = f"shaded: growth by Floquet theory, {shown} modes; thin streaks are tongues of higher order"
    figure.legend(handles, names, loc="outside lower center", ncols=2, title=note, title_fontsize=8)
    if mesh is None:
        say(ax, "no growth up to this ε")
    else:
        bar = ax.figure.colorbar(mesh, ax=ax, pad=0.01, aspect=30)
        bar.set_label(r"$\sqrt{\mathrm{growth\ rate\ /\ (1/s)}}$")
    return figure


def _name(ax: Axes, name: str, place: float, top: float, above: float = 4, **look: Any) -> None:
    ax.annotate(name, (place, top), xytext=(0, above), textcoords="offset points", ha="center", **look)
