"""Responses of the tip to the base's motion (Figs. 6 to 10); the scenario stands in every figure."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import ArrayLike

from cra_sym.analysis.histories import Histories, History
from cra_sym.analysis.responses import response, tip_response
from cra_sym.arm.parameters import Arm
from cra_sym.figures.drawing import BLUE, ORANGE, Panels, figure_of, panels
from cra_sym.figures.subject import arm_or_nominal, fields, moving_place, rigid_ends, several, single, span, unknowns
from cra_sym.model.system import System
from cra_sym.solvers.force import Force
from cra_sym.solvers.motion import BaseMotion

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.typing import ColorType
    from sympy import Expr

__all__ = ["figure_6", "figure_7", "figure_8", "figure_9", "figure_10", "figure_response"]

#: The assumed scenario: the paper's values are lost.
AMPLITUDE, RATE, VELOCITY, ACCELERATIONS, SOFT = 1e-3, 10.0, 0.1, (0.1, 0.2, 0.3), 1e3
_TIME = np.linspace(0.0, 2.0, 1601)
_GREY: dict[str, Any] = {"color": "0.45", "linestyle": (0, (4, 2)), "linewidth": 1.2}
_FROM_REST = "from rest in the inertial frame, undamped, 5 modes"
_TIP = "tip displacement $v(L,t)$ / mm"
_ERROR = "error: with minus without disturbance / mm"


def _tip(
    arm: System, t: np.ndarray, disturbed: bool = True, rate: float = RATE, phase: float = 0.0, **mean: Any
) -> np.ndarray:
    """Return the tip's displacement in mm."""
    motion = BaseMotion(**mean, amplitude=AMPLITUDE * disturbed, angular_frequency=rate, phase=phase)
    return np.asarray(1e3 * tip_response(arm, motion, t))


def _name(arm: System) -> str:
    return "nominal arm" if arm == Arm.nominal() else "arm as given"


def _finish(grid: np.ndarray, scenario: str) -> Figure:
    figure = figure_of(grid.flat[0])
    for ax in grid[-1]:
        ax.set_xlabel("time $t$ / s")
    figure.supxlabel(scenario, fontsize=8, color="0.35")
    return figure


def _peak(ax: Axes, t: np.ndarray, v: np.ndarray, color: ColorType) -> float:
    """Mark the largest deflection and return it."""
    k = int(np.argmax(np.abs(v)))
    ax.plot(t[k], v[k], "o", color=color, markersize=5, markerfacecolor="white", zorder=3)
    return float(abs(v[k]))


def figure_response(
    system: System | None = None,
    motion: BaseMotion | Histories | None = None,
    t: ArrayLike | None = None,
    *,
    modes: int = 5,
    initial: Mapping[Expr, Expr] | None = None,
    axes: Panels | None = None,
) -> Figure:
    """Draw the response of the tip to any motion and forces, with the springs of the ends as they are and rigid.

    Where no mode moves the right end, the place that the first mode moves most takes the place of the tip; where there
    is no field, the first coordinate does.

    Parameters
    ----------
    system : System, optional
        By default the nominal arm with k_t = 1e3 N/m.
    motion : BaseMotion, or mapping of function of t to BaseMotion or Force, optional
        By default a mean acceleration of 0.1 m/s2 with the disturbance of Fig. 7 for the only prescribed motion, a
        unit step of every force, and, where nothing drives, a unit velocity of the first field at t = 0.
    t : array_like, optional
        Times, s, by default about five periods.
    modes : int
    initial : mapping, optional
        State at t = 0, as in :func:`cra_sym.response`.
    axes : Axes, optional
    """
    system = single(Arm.nominal().replace(k_t=SOFT) if system is None else system)
    t = _times(system) if t is None else several("t", t, "times", low=0.0, unit="s")
    if motion is None and initial is None:
        motion, initial = _default_drive(system)
    ax, modes = panels(axes, 1, 1, (6.4, 3.6))[0, 0], min(modes, system.most_modes)
    place, tip, rigid = moving_place(system), float(system.domain.left + system.domain.length), rigid_ends(system)
    looks: list[tuple[System, str, dict[str, Any]]] = [(system, "as given", {"color": ORANGE, "linestyle": "-"})]
    if rigid != system:
        looks.insert(0, (rigid, "rigid ends", _GREY))
    scale, label = (1e3, _TIP) if isinstance(system, Arm) else (1.0, _displacement_label(system, place))
    for one, name, look in looks:
        if place == tip:
            found = scale * tip_response(one, motion, t, modes, initial=initial)
        else:
            found = scale * response(one, motion, t, place, modes, initial=initial)
        peak = _peak(ax, t, found, look["color"])
        ax.plot(t, found, label=f"{name}, peak {_short(peak)}{' mm' * isinstance(system, Arm)}", **look)
    ax.legend(loc="lower right", ncols=2, bbox_to_anchor=(1.0, 0.98), borderaxespad=0)
    ax.set_title("Response of the tip" if fields(system) else "Response", pad=8)
    ax.set_xlabel("time $t$ / s")
    ax.set_ylabel(label)
    return figure_of(ax)


def _short(value: float) -> str:
    return f"{value:.2f}" if 0.1 <= value < 1000 else f"{value:.3g}"


def _displacement_label(system: System, place: float) -> str:
    field = unknowns(system)[0]
    if not fields(system):
        return f"${field}$ / SI unit"
    return f"${field}$ at ${system.model.equations.x}$ = {place:g} m / SI unit"


def _times(system: System) -> np.ndarray:
    return np.linspace(0.0, span(system), _TIME.size)


def _default_drive(system: System) -> tuple[dict[str, History] | None, dict[Expr, Expr] | None]:
    causes = dict(system.numerics("causes"))
    motions = [name for name, kind in causes.items() if kind in ("motion", "support")]
    disturbed = BaseMotion(acceleration=0.1, amplitude=AMPLITUDE, angular_frequency=RATE)
    drive: dict[str, History] = {name: Force(1.0) for name, kind in causes.items() if kind == "force"}
    drive |= {name: disturbed if name == motions[0] else BaseMotion() for name in motions}
    if drive or system.numerics("constant") is not None:
        return drive, None
    equations = system.model.equations
    first = (*equations.fields, *equations.coordinates)[0]
    return None, {first.diff(equations.t): 1}


def figure_6(arm: System | None = None, *, axes: Panels | None = None) -> Figure:
    """Draw the tip's response to a mean velocity and to a mean acceleration, without and with the disturbance.

    The phase of the disturbance, which the paper does not tell, decides on the first: one row each for 0 and pi.

    Parameters
    ----------
    arm : Arm, optional
        By default the nominal one.
    axes : 2 x 2 array of Axes, optional
    """
    arm = arm_or_nominal(arm)
    t = _times(arm)
    grid = panels(axes, 2, 2, (8.6, 6.2), sharex=True, sharey="col")
    cases = (("mean velocity 0.1 m/s", {"velocity": VELOCITY}), ("mean acceleration 0.1 m/s²", {"acceleration": 0.1}))
    for ax, (title, _) in zip(grid[0], cases, strict=True):
        ax.set_title(f"Fig. 6  {title}" if ax is grid[0, 0] else title, pad=36)
    for row, (phase, name) in zip(grid, ((0.0, "0"), (np.pi, r"\pi")), strict=True):
        for ax, (_, mean) in zip(row, cases, strict=True):
            plain, moved = (_tip(arm, t, disturbed, phase=phase, **mean) for disturbed in (False, True))
            (with_line,) = ax.plot(t, moved, color=BLUE, linestyle="-", zorder=2)
            (without,) = ax.plot(t, plain, **_GREY, zorder=2.5)
            peaks = _peak(ax, t, moved, BLUE), _peak(ax, t, plain, "0.45")
            labels = [
                f"{word} disturbance, peak {p:.2f} mm" for word, p in zip(("with", "without"), peaks, strict=True)
            ]
            ax.legend([with_line, without], labels, loc="lower left", bbox_to_anchor=(0.0, 0.98), borderaxespad=0)
            ax.text(0.99, 1.03, rf"$\psi={name}$", transform=ax.transAxes, ha="right", va="bottom")
        row[0].set_ylabel(_TIP)
    return _finish(grid, f"{_name(arm)}, $B$ = 1 mm, $\\varpi$ = 10 rad/s, {_FROM_REST}")


def _against_rigid(
    axes: Panels | None,
    arm: System | None,
    quantity: Callable[[System, np.ndarray, float], np.ndarray],
    label: str,
    title: str,
) -> Figure:
    arm = arm_or_nominal(arm)
    t = _times(arm)
    grid = panels(axes, 1, 2, (8.6, 3.9), sharex=True, sharey=True)
    rigid, soft = arm.replace(k_t=np.inf), arm.replace(k_t=SOFT) if np.isinf(arm.values["k_t"]) else arm
    joints = ((rigid, "rigid joint", BLUE, "-"), (soft, f"$k_t$ = {soft.values['k_t']:g} N/m", ORANGE, "--"))
    for ax, rate in zip(grid[0], (RATE, 2 * RATE), strict=True):
        for joined, name, color, style in joints:
            v = quantity(joined, t, rate)
            peak = _peak(ax, t, v, color)
            ax.plot(t, v, color=color, linestyle=style, label=f"{name}, peak {peak:.2f} mm")
        ax.legend(loc="lower left", bbox_to_anchor=(0.0, 0.98), borderaxespad=0)
        ax.text(0.99, 1.03, rf"$\varpi={rate:g}$ rad/s", transform=ax.transAxes, ha="right", va="bottom")
    grid[0, 0].set_title(title, pad=36)
    grid[0, 0].set_ylabel(label)
    return _finish(grid, f"{_name(arm)}, mean acceleration 0.1 m/s², $B$ = 1 mm, $\\psi$ = 0, {_FROM_REST}")


def figure_7(arm: System | None = None, *, axes: Panels | None = None) -> Figure:
    """Draw the tip's response with a joint of finite translational stiffness against a rigid one.

    Two frequencies of the disturbance, below and above the first natural frequency: on it depends what a softer joint
    does.

    Parameters
    ----------
    arm : Arm, optional
        By default the nominal one.
    axes : pair of Axes, optional
    """

    def tip(joined: System, t: np.ndarray, rate: float) -> np.ndarray:
        return _tip(joined, t, rate=rate, acceleration=0.1)

    return _against_rigid(axes, arm, tip, _TIP, "Fig. 7  A softer joint: smaller peak at 20 rad/s, not at 10")


def figure_8(arm: System | None = None, *, axes: Panels | None = None) -> Figure:
    """Draw what the disturbance adds to the responses of Fig. 7.

    Parameters
    ----------
    arm : Arm, optional
        By default the nominal one.
    axes : pair of Axes, optional
    """

    def error(joined: System, t: np.ndarray, rate: float) -> np.ndarray:
        moved, plain = (_tip(joined, t, disturbed, rate, acceleration=0.1) for disturbed in (True, False))
        return np.asarray(moved - plain)

    return _against_rigid(axes, arm, error, _ERROR, "Fig. 8  It suppresses the disturbance at 20 rad/s, not at 10")


def figure_9(arm: System | None = None, *, axes: Panels | None = None) -> Figure:
    """Draw the tip's response to three mean accelerations, with and without the disturbance.

    Parameters
    ----------
    arm : Arm, optional
        By default the nominal one.
    axes : pair of Axes, optional
    """
    arm = arm_or_nominal(arm)
    t = _times(arm)
    grid = panels(axes, 1, 2, (8.6, 3.9), sharex=True, sharey=True)
    for ax, disturbed, word in zip(grid[0], (True, False), ("with", "without"), strict=True):
        for a in ACCELERATIONS:
            v = _tip(arm, t, disturbed, acceleration=a)
            (line,) = ax.plot(t, v)
            line.set_label(f"{a:g} m/s², peak {_peak(ax, t, v, line.get_color()):.2f} mm")
        ax.legend(loc="lower left", bbox_to_anchor=(0.0, 0.98), borderaxespad=0)
        ax.text(0.99, 1.03, f"{word} disturbance", transform=ax.transAxes, ha="right", va="bottom")
    grid[0, 0].set_title("Fig. 9  Peaks grow with the mean acceleration", pad=52)
    grid[0, 0].set_ylabel(_TIP)
    return _finish(grid, f"{_name(arm)}, $B$ = 1 mm, $\\varpi$ = 10 rad/s, $\\psi$ = 0, {_FROM_REST}")


def figure_10(arm: System | None = None, *, axes: Panels | None = None) -> Figure:
    """Draw the error caused by the disturbance for three mean accelerations: of the response, and of its peak.

    By superposition the first does not depend on the acceleration at all; the second never grows with it.

    Parameters
    ----------
    arm : Arm, optional
        By default the nominal one.
    axes : pair of Axes, optional
    """
    arm = arm_or_nominal(arm)
    t = _times(arm)
    grid = panels(axes, 1, 2, (8.6, 3.9))
    left, right = grid[0]
    for a, width in zip(ACCELERATIONS, (5.0, 3.0, 1.2), strict=True):
        error = _tip(arm, t, acceleration=a) - _tip(arm, t, disturbed=False, acceleration=a)
        left.plot(t, error, linewidth=width, label=f"{a:g} m/s²")
    left.legend(loc="lower left", ncols=3, bbox_to_anchor=(0.0, 0.98), borderaxespad=0)
    left.set_title("Fig. 10  Error of the response: one curve", pad=22)
    left.set_ylabel(_ERROR)
    levels = np.linspace(0.0, 1.0, 101)
    plain = np.abs(_tip(arm, t, disturbed=False, acceleration=levels)).max(-1)
    for phase, name in ((0.0, "0"), (np.pi / 2, r"\pi/2"), (np.pi, r"\pi")):
        moved = np.abs(_tip(arm, t, acceleration=levels, phase=phase)).max(-1)
        right.plot(levels, moved - plain, label=rf"$\psi={name}$")
    for value in ACCELERATIONS:
        right.axvline(value, color="0.75", linewidth=0.8, zorder=0)
    right.legend(loc="lower left", ncols=3, bbox_to_anchor=(0.0, 0.98), borderaxespad=0)
    right.set_title("Error of the peak: never grows", pad=22)
    right.set_ylabel("peak with minus peak without / mm")
    figure = _finish(grid, f"{_name(arm)}, $B$ = 1 mm, $\\varpi$ = 10 rad/s, {_FROM_REST}; 0 to {t[-1]:g} s")
    right.set_xlabel("mean acceleration / (m/s²)")
    return figure
