"""What an engineer plots beyond the paper: frequency responses, residual vibration after a move, input shaping."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from matplotlib.colors import LogNorm
from matplotlib.figure import Figure

from cra_sym.analysis.eigenvalues import oscillating_frequencies
from cra_sym.analysis.frequency_response import frequency_response
from cra_sym.analysis.histories import History
from cra_sym.analysis.modes import mode_shapes, only_motion
from cra_sym.analysis.residual_vibration import residual_vibration
from cra_sym.analysis.responses import tip_response
from cra_sym.analysis.shaping import input_shaper
from cra_sym.analysis.state_space import state_space
from cra_sym.arm.parameters import Arm
from cra_sym.checks import choice, count
from cra_sym.figures.drawing import GREEN, ORANGE, Panels, figure_of, panel, panels
from cra_sym.figures.modes import decades
from cra_sym.figures.subject import (
    fields,
    leading_parameter,
    moving_place,
    over_what_is_stable,
    parameter_label,
    parameter_name,
    single,
    unknowns,
)
from cra_sym.model.system import System
from cra_sym.solvers.force import Force
from cra_sym.solvers.motion import BaseMotion, Piecewise

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from sympy import Expr

__all__ = ["figure_frequency_response", "figure_input_shaping", "figure_residual_vibration"]

_SIZE = (8.6, 3.9)
_LOOSE = {"k_t": 1e3, "k_r": 1e2}
_LIMITS = {"distance": 0.5, "v_max": 1.0, "a_max": 4.0, "j_max": 40.0}  # m, m/s, m/s2, m/s3
_AT_REST = "system: its right end does not move; 'response' shows the place that moves most"
_MOVE = "0.5 m S-curve, at most 1 m/s, 4 m/s², 40 m/s³"


def _caption(row: np.ndarray, scenario: str) -> Figure:
    figure = figure_of(row[0])
    figure.supxlabel(scenario, fontsize=8, color="0.35")
    return figure


def figure_frequency_response(
    system: System | None = None, drive: Expr | str | None = None, *, axes: Panels | None = None, points: int = 1500
) -> Figure:
    """Draw the exact frequency response of both ends, and what keeping a few modes makes of it.

    Where no mode moves the right end, the place that the first mode moves most takes its place, and is alone if
    nothing moves the left end either. Of lumped coordinates alone it is that of the first one.

    Parameters
    ----------
    system : System, optional
        By default the nominal arm with a stiff but elastic joint and 1 % of damping.
    drive : Expr or str, optional
        As in :func:`cra_sym.frequency_response`; by default the only prescribed motion or the first force, and where
        there is none a unit force on the first field at the place shown.
    axes : Axes, optional
        One for each place shown: two, or one.
    points : int
        Frequencies drawn.
    """
    given = Arm.nominal().replace(k_t=1e5, k_r=1e3, zeta=0.01) if system is None else system
    system = single(given)
    places = _places_shown(system)
    drive = _drive(system, places[0]) if drive is None else drive
    count("points", points, low=2)
    (row,) = panels(axes, 1, len(places), (4.3 * len(places), 3.9), sharex=True)
    most = system.most_modes
    elastic = [value for value in oscillating_frequencies(system, min(6, most)) if value > 0][:3]
    if not elastic:
        raise ValueError("system: has rigid-body motions alone; must have a mode that vibrates")
    Omega = np.geomspace(float(f"{0.13 * elastic[0]:.0e}"), float(f"{2.25 * elastic[-1]:.0e}"), points)
    there, field = (np.array(places), None) if fields(system) else (None, system.model.equations.coordinates[0])
    exact = np.abs(frequency_response(system, Omega, there, drive, field=field)).reshape(len(places), -1)
    titles = ("Tip: few modes are enough", "Joint: modes converge slowly")
    for number, (ax, place) in enumerate(zip(row, places, strict=True)):
        ax.loglog(Omega, exact[number], label="exact", color="0.25", linestyle="-")
        for modes in (3, 12) if most > 3 else range(1, min(most, 2)):
            ax.loglog(Omega, np.abs(_of_modes(system, Omega, place, drive, modes)),
                      label=f"{modes} mode{'s' * (modes > 1)}", linewidth=1.3, linestyle=("--", ":")[modes > 3],
                      color=(ORANGE, GREEN)[modes > 3])  # fmt: skip
        at = f"${unknowns(system)[0]}$" if place is None else f"at $x$ = {place:g} m"
        ax.set_title(titles[number] if isinstance(system, Arm) else at)
        driven = "of the base " if isinstance(system, Arm) and drive == "w" else ""
        ax.set_xlabel(rf"frequency {driven}$\Omega$ / (rad/s)")
    row[0].set_ylabel(_response_label(system, drive))
    row[0].legend(loc="lower left")
    return _caption(row, _values(system))


def _places_shown(system: System) -> list[float] | list[None]:
    """Return the places of a frequency response; of coordinates alone None, which have no place."""
    if not fields(system):
        return [None]
    tip, left = moving_place(system), float(system.domain.left)
    shapes = np.abs(mode_shapes(system.basis, [left, tip], 3))
    return [tip, left] if shapes[:, 0].max() > 1e-9 * shapes[:, 1].max() else [tip]


def _drive(system: System, place: float | None) -> Expr | str:
    """Return the default input: the first prescribed motion or force by name, or what is shown at a place."""
    causes = dict(system.numerics("causes"))
    ordered = sorted(causes, key=lambda name: causes[name] != "motion")
    if ordered:
        return ordered[0]
    if place is None:
        return system.model.equations.coordinates[0]
    field, (_, right) = system.model.equations.fields[0], system.model.equations.domain
    x = system.model.equations.x
    return field.subs(x, right if np.isclose(place, float(system.domain.left + system.domain.length)) else place)


def _of_modes(system: System, Omega: np.ndarray, place: float | None, drive: Expr | str, modes: int) -> np.ndarray:
    """Return the transfer function of the first modes alone."""
    if place is None:
        few = state_space(system, modes, drive, [system.model.equations.coordinates[0].func.__name__])
    else:
        field = "v" if isinstance(system, Arm) else system.model.equations.fields[0].func.__name__
        few = state_space(system, modes, drive, [(field, place)])
    size, points = len(few.A), 1j * Omega[:, None, None]
    found: np.ndarray = few.C @ np.linalg.solve(points * np.eye(size) - few.A, few.B) + few.D
    by_displacement = dict(system.numerics("causes")).get(str(drive)) == "support"
    return found[:, 0, 0] * (-(Omega**2) if by_displacement else 1.0)


def _response_label(system: System, drive: Expr | str) -> str:
    if isinstance(system, Arm) and drive == "w":
        return "elastic displacement per base acceleration / s²"
    kind = dict(system.numerics("causes")).get(str(drive))
    per = {"motion": "acceleration", "support": "displacement"}.get(str(kind), "force")
    return f"${unknowns(system)[0]}$ per unit {per} / SI unit"


def _values(system: System) -> str:
    if isinstance(system, Arm):
        return f"$k_t$ = {system.k_t:g} N/m, $k_r$ = {system.k_r:g} N m/rad, $\\zeta$ = {system.zeta:g}"
    return f"$\\zeta$ = {system.zeta:g}"


def figure_residual_vibration(
    system: System | None = None, parameter: str | None = None, *, ax: Axes | None = None, points: int = 161
) -> Figure:
    """Draw the vibration left after a move over the time the move takes and a parameter, of an arm k_t.

    Parameters
    ----------
    system : System, optional
        With one prescribed motion; by default the nominal arm.
    parameter : str, optional
        By default the first stiffness of an end, or else what the first frequency owes most to.
    ax : Axes, optional
    points : int
        Values of the parameter drawn; of the time there are more.
    """
    system, name = _subject(system or Arm.nominal(), parameter)
    count("points", points, low=2)
    ax = panel(ax, _SIZE)
    joint = isinstance(system, Arm) and name == "k_t"
    values = decades(system, name, 1, 5, points) if joint else over_what_is_stable(system, name, 1, 1, points)[0]
    stiffest = system.replace(**{name: np.inf if joint else values[-1]})
    fastest = BaseMotion.s_curve(**_LIMITS).duration
    duration = np.linspace(fastest, fastest + 4.25 / _first(stiffest), 7 * points // 4)
    move = _alone(system, BaseMotion.s_curve(**_LIMITS, duration=duration))
    left = np.asarray(residual_vibration(system.replace(**{name: values[:, None]}), move, _modes(system)))
    if not np.nanmax(left) > 0:
        raise ValueError(_AT_REST)
    top = 10.0 ** np.ceil(np.log10(1e3 * left[np.isfinite(left)].max()))
    norm = LogNorm(1e-4 * top, top)
    mesh = ax.pcolormesh(duration, values, 1e3 * left, norm=norm, shading="gouraud", rasterized=True)
    ax.set_yscale("log" if values[0] > 0 and values[-1] > 30 * values[0] else "linear")
    ax.figure.colorbar(mesh, ax=ax, label="residual tip amplitude / mm", extend="both")
    period = 1 / _first(system.replace(**{name: values}))
    (profile,) = BaseMotion.s_curve(**_LIMITS).terms
    assert isinstance(profile, Piecewise)
    braking = float(profile.knots[4]) / fastest  # from the start to the braking, as a fraction of the move
    for number in (1, 2, 3):
        ax.plot(number * period / braking, values, color="white", linestyle=(0, (1, 2)), linewidth=1.0)
    ax.set_xlim(duration[0], duration[-1])
    ax.set_xlabel("time the move takes / s")
    label = parameter_label(system, name)
    ax.set_ylabel("translational stiffness $k_t$ / (N/m)" if joint else label)
    in_tune = "the joint" if joint else "mode 1"
    ax.set_title(f"Residual vibration: dark valleys are move times in tune with {in_tune}")
    ax.grid(False)
    dotted = "dotted: braking 1, 2, 3 periods of mode 1 after the start"
    damping = "" if system.zeta or system.numerics("damping") is not None else "; undamped"
    return _caption(np.array([ax]), f"{_MOVE}, slowed down; {dotted}{damping}")


def figure_input_shaping(
    system: System | None = None, parameter: str | None = None, *, axes: Panels | None = None, points: int = 201
) -> Figure:
    """Draw a move shaped for the computed modes against an S-curve of the same duration, and with a parameter, of an
    arm k_t, wrongly known.

    Parameters
    ----------
    system : System, optional
        What the shapers are made for, with one prescribed motion: by default the nominal arm with an elastic joint and
        1 % of damping.
    parameter : str, optional
        As in :func:`figure_residual_vibration`; neither zero nor infinite.
    axes : pair of Axes, optional
    points : int
        Values of the parameter drawn; of the time there are more.
    """
    system, name = _subject(system or Arm.nominal().replace(**_LOOSE, zeta=0.01), parameter)
    value = float(system.values[name])
    if not 0 < abs(value) < np.inf:
        raise ValueError(f"parameter: {name} = {value:g} must be finite and not zero, to be wrongly known")
    count("points", points, low=2)
    (row,) = panels(axes, 1, 2, _SIZE)
    left, right = row
    moves, period = shaped_moves(system), 1 / _first(system)
    end = float(f"{moves['ZVD'].duration + 2.65 * period:.2g}")
    t, wrong = np.linspace(0, end, 8 * points - 7), _wrongly_known(system, name, points)
    others = system.replace(**{name: wrong * value})
    for kind, move in moves.items():
        given, label = _alone(system, move), f"{kind}, {move.duration:.2f} s"
        rest = np.asarray(residual_vibration(others, given, _modes(system)))
        if not np.nanmax(rest) > 0:
            raise ValueError(_AT_REST)
        left.plot(t, 1e3 * tip_response(system, given, t, _modes(system)), label=label, linewidth=1.4)
        right.loglog(wrong, 1e3 * rest, linewidth=1.4)
    left.legend(loc="lower left", bbox_to_anchor=(0.0, 0.98), ncols=2, borderaxespad=0, fontsize=8)
    left.set_title("Input shaping from the computed modes", pad=36)
    left.set_xlabel("time $t$ / s")
    arm, symbol = isinstance(system, Arm), parameter_name(system, name)[0]
    left.set_ylabel("tip displacement $v(L,t)$ / mm" if arm else "tip displacement / mm")
    right.axvline(1.0, color="0.6", linewidth=0.8)
    what = "a joint" if arm and name == "k_t" else symbol
    right.set_title(f"with {what} other than assumed", pad=36, fontweight="normal")
    right.set_xlabel(f"true {symbol} / assumed {symbol}")
    right.set_ylabel("residual tip amplitude / mm")
    assumed = _values(system) if arm else f"{symbol} = {value:g}, {_values(system)}"
    return _caption(row, f"{_MOVE}; assumed {assumed}")


def _wrongly_known(system: System, name: str, points: int) -> np.ndarray:
    """Return factors of a parameter, up to 10 of a stiffness of an end, else 2, or closer to 1 where no system has it.

    Such as a length beyond which an interior place would be.
    """
    value, far = float(system.values[name]), 10.0 if name in system.numerics("stiffnesses") else 2.0
    for narrowing in range(5):
        factors = np.geomspace(far ** -(0.5**narrowing), far**0.5**narrowing, points)
        try:
            oscillating_frequencies(system.replace(**{name: factors * value}), 1)
        except ValueError:
            if narrowing == 4:
                raise
        else:
            return factors
    raise AssertionError


def _subject(system: System, parameter: str | None) -> tuple[System, str]:
    """Return a system with one prescribed motion, and the parameter of the axis."""
    only_motion(single(system), support=True)
    if parameter is None:
        return system, leading_parameter(system)
    return system, choice("parameter", parameter, tuple(system.values))


def _alone(system: System, move: BaseMotion) -> dict[str, History]:
    """Return the histories of a system: the given motion, and zero forces."""
    cause, none = only_motion(system, support=True), Force.sampled([0.0, 1.0], [0.0, 0.0], exact=True)
    return {name: move if name == cause else none for name, _ in system.numerics("causes")}


def _modes(system: System) -> int:
    """Return the number of modes of a response: five, or all of a system that has fewer."""
    return min(5, system.most_modes)


def _first(system: System) -> np.ndarray:
    """Return the frequency of the first elastic mode, Hz."""
    found = oscillating_frequencies(system, min(3, system.most_modes)) / (2 * np.pi)
    elastic = np.where(found > 0, found, np.inf).min(axis=-1)
    return np.asarray(elastic)


def shaped_moves(system: System) -> dict[str, BaseMotion]:
    """Return the fastest S-curve, the same shaped for mode 1 (ZV, ZVD), and an S-curve as slow as the ZVD move."""
    omega = 2 * np.pi * _first(system)
    fast = BaseMotion.s_curve(**_LIMITS)
    zv, zvd = (fast.shaped(*input_shaper(omega, system.zeta, order)) for order in (1, 2))
    return {"S-curve": fast, "ZV": zv, "ZVD": zvd, "slow S-curve": BaseMotion.s_curve(**_LIMITS, duration=zvd.duration)}
