"""Natural frequencies against a stiffness of the joint (Figs. 3, 4) or any parameter, and the first mode shapes."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import ArrayLike

from cra_sym.analysis.eigenvalues import oscillating_frequencies
from cra_sym.analysis.modes import mode_shapes, natural_frequencies
from cra_sym.arm.parameters import Arm
from cra_sym.checks import choice, count, instance, one_number
from cra_sym.figures.drawing import BLUE, ORANGE, Panels, figure_of, panel, panels
from cra_sym.figures.subject import (
    arm_or_nominal,
    field_label,
    fields,
    leading_parameter,
    over_what_is_stable,
    parameter_label,
    parameters_of,
    rigid_ends,
    several,
    single,
    unknowns,
)
from cra_sym.model.system import System
from cra_sym.paper.flipped import flipped_frequencies

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.typing import ColorType
    from sympy.core.function import AppliedUndef

__all__ = ["decades", "figure_3", "figure_4", "figure_frequencies", "figure_mode_shapes"]

_UNITS = {"k_t": "N/m", "k_r": "N m/rad"}
_QUANTITIES = {"k_t": "translational stiffness", "k_r": "rotational stiffness"}
_RIGID: dict[str, Any] = {"color": "0.45", "linestyle": (0, (4, 2)), "linewidth": 0.9}


def figure_3(arm: System | None = None, k_t: ArrayLike | None = None, *, axes: Panels | None = None) -> Figure:
    """Draw f1, f2, f3 against the joint's translational stiffness, in Hz and as a fraction of the rigid joint's.

    Parameters
    ----------
    arm : Arm, optional
        By default the nominal one.
    k_t : array_like, optional
        Stiffnesses in N/m, by default 1 to 1e6 for the nominal EI / L^3.
    axes : pair of Axes, optional
    """
    arm = arm_or_nominal(arm)
    k_t = (
        decades(arm, "k_t", 0, 6)
        if k_t is None
        else several("k_t", k_t, "stiffnesses", low=0.0, open_low=True, unit="N/m")
    )
    ((left, right),) = panels(axes, 1, 2, (8.6, 3.9))
    found, rigid = natural_frequencies(arm.replace(k_t=k_t)), natural_frequencies(arm.replace(k_t=np.inf))
    _in_hertz(left, k_t, found, rigid, "k_t")
    _relative(right, k_t, found / rigid, "k_t")
    left.set_title("Fig. 3  A softer joint lowers every mode")
    right.set_title("higher modes feel it first", fontweight="normal")
    return figure_of(left)


def figure_4(arm: Arm | None = None, k_r: ArrayLike | None = None, *, axes: Panels | None = None) -> Figure:
    """Draw f1, f2, f3 against the joint's rotational stiffness: as derived, and with the spring's sign flipped.

    The left column follows from the Lagrangian. The right one from the same Lagrangian with the sign of the rotational
    spring's energy flipped, EI v_xx(0) = -k_r v_x(0): it shows the rising f2 and f3 and the seemingly flat f1 that the
    paper reports.

    Parameters
    ----------
    arm : Arm, optional
        By default the nominal one.
    k_r : array_like, optional
        Stiffnesses in N m/rad, by default 1e2 to 1e5 for the nominal EI / L.
    axes : 2 x 2 array of Axes, optional
    """
    arm = arm_or_nominal(arm)
    instance("system", arm, Arm)  # the sign is flipped in the paper's Lagrangian
    k_r = (
        decades(arm, "k_r", 2, 5)
        if k_r is None
        else several("k_r", k_r, "stiffnesses", low=0.0, open_low=True, unit="N m/rad")
    )
    grid = panels(axes, 2, 2, (8.6, 6.6), sharey="row")
    (top_left, top_right), (low_left, low_right) = grid
    rigid = natural_frequencies(arm.replace(k_r=np.inf))
    derived, flipped = natural_frequencies(arm.replace(k_r=k_r)), flipped_frequencies(arm.replace(k_r=k_r))
    for upper, lower, found in ((top_left, low_left, derived), (top_right, low_right, flipped)):
        _in_hertz(upper, k_r, found, rigid, "k_r")
        _relative(lower, k_r, found / rigid, "k_r")
        upper.set_xlabel("")
    for ax in (top_right, low_right):
        ax.set_ylabel("")
    top_left.set_title("Fig. 4  Derived: $EI\\,v_{xx}(0)=+k_r\\,v_x(0)$")
    top_right.set_title("Sign flipped: $EI\\,v_{xx}(0)=-k_r\\,v_x(0)$")
    low_left.set_title("all fall, near the rigid joint by the same fraction", fontweight="normal")
    low_right.set_title("all rise; in hertz f1 only seems unchanged", fontweight="normal")
    return figure_of(grid[0, 0])


def figure_frequencies(
    system: System | None = None,
    parameter: str | None = None,
    values: ArrayLike | None = None,
    *,
    modes: int = 3,
    ax: Axes | None = None,
) -> Figure:
    """Draw natural frequencies against any parameter, or those of the complex modes where there are none.

    Parameters
    ----------
    system : System, optional
        By default the nominal arm with k_t = 1e4 N/m.
    parameter : str, optional
        Its name; by default the first stiffness of an end, or else what the first frequency depends on most.
    values : array_like, optional
        By default around the value the system has: decades of a stiffness, from half to twice of anything else.
    modes : int
    ax : Axes, optional
    """
    system = single(Arm.nominal().replace(k_t=1e4) if system is None else system)
    modes = min(modes, system.most_modes)
    name = leading_parameter(system) if parameter is None else choice("parameter", parameter, system.values)
    if values is None:
        x, found = over_what_is_stable(system, name, modes)
    else:
        x = several("values", values, "values", allow_infinite=True)
        found = oscillating_frequencies(system.replace(**{name: x}), modes) / (2 * np.pi)
    ax = panel(ax, (6.4, 4.0))
    if name in system.numerics("stiffnesses"):
        for level in oscillating_frequencies(system.replace(**{name: np.inf}), modes) / (2 * np.pi):
            ax.axhline(level, **_RIGID)
    for mode in range(modes):
        ax.plot(x, found[:, mode], label=f"$f_{{{mode + 1}}}$")
    given = float(system.values[name])
    if x.min() <= given <= x.max():
        ax.axvline(given, color="0.75", linewidth=0.8, zorder=0)
    ax.set_xscale("log" if x.min() > 0 and x.max() > 10 * x.min() else "linear")
    ax.set_yscale("log" if (found > 0).any() else "linear")
    ax.set_xlabel(parameter_label(system, name))
    ax.set_ylabel(f"{'natural' if system.conservative_part is system else 'oscillating'} frequency / Hz")
    ax.legend(loc="lower left", ncols=min(modes, 6), bbox_to_anchor=(0.0, 0.98), borderaxespad=0)
    return figure_of(ax)


def figure_mode_shapes(
    system: System | None = None, *, modes: int = 3, phase: float | None = None, axes: Panels | None = None
) -> Figure:
    """Draw the first mode shapes, with the springs of the ends as they are and rigid.

    Of complex modes, with gyroscopic forces or forces that follow the motion, the real part at that instant. Of lumped
    coordinates alone the modal displacement of each.

    Parameters
    ----------
    system : System, optional
        By default the nominal arm with k_t = 1e3 N/m and k_r = 1e2 N m/rad.
    modes : int
    phase : float, optional
        Instant of a free vibration, rad: the elastic shapes times its cosine, on axes with room for the whole swing.
    axes : Axes, optional
        A row for each field, a column for each mode.
    """
    system = single(Arm.nominal().replace(k_t=1e3, k_r=1e2) if system is None else system)
    known, modes = fields(system), min(count("modes", modes), system.most_modes)
    phase = None if phase is None else one_number("phase", phase, unit="rad")
    if not known:
        return _of_coordinates(system, modes, phase, axes)
    grid = panels(axes, len(known), modes, (2.87 * modes, 1.0 + 2.4 * len(known)), sharey="row")
    along, unit = field_label(system)
    for row, (name, field) in zip(grid, known.items(), strict=True):
        _shapes_of_field(row, system, field, modes, 0.0 if phase is None else phase, phase is not None)
        symbol = r"\phi" if len(known) == 1 else name
        row[0].set_ylabel(f"mass-normalised shape ${symbol}${unit}")
    for mode, ax in enumerate(grid[0]):
        ax.set_title(f"mode {mode + 1}")
    for ax in grid[-1]:
        ax.set_xlabel(along)
    return figure_of(grid[0, 0])


def _of_coordinates(system: System, modes: int, phase: float | None, axes: Panels | None) -> Figure:
    """Draw the modal displacements of lumped coordinates, a panel a mode."""
    if system.conservative_part is not system:
        raise ValueError(
            "system: has coordinates alone, with gyroscopic forces or forces that follow the motion; shapes are drawn "
            "of real modes, or of complex ones along a field"
        )
    (row,) = panels(axes, 1, modes, (2.87 * modes, 3.4), sharey="row")
    names, turn = unknowns(system), 1.0 if phase is None else np.cos(phase)
    shapes = np.array([system.modes(modes).coordinate(k) for k in range(len(names))])
    for mode, ax in enumerate(row[:modes]):
        hertz = system.natural_frequencies(modes)[mode] / (2 * np.pi)
        ax.axhline(0.0, color="0.75", linewidth=0.8)
        ax.vlines(range(len(names)), 0.0, turn * shapes[:, mode], color=BLUE)
        ax.plot(range(len(names)), turn * shapes[:, mode], "o", color=BLUE, label=f"{hertz:.3g} Hz")
        ax.set_xticks(range(len(names)), [f"${name}$" for name in names])
        ax.set_xlim(-0.6, len(names) - 0.4)
        ax.legend(loc="upper right", fontsize=8)
        ax.set_title(f"mode {mode + 1}")
    largest = np.abs(shapes).max()
    row[0].set_ylim(-1.15 * largest if phase is not None or (shapes < 0).any() else None, 1.35 * largest)
    row[0].set_ylabel("mass-normalised displacement")
    return figure_of(row[0])


def _shapes_of_field(
    row: Sequence[Axes], system: System, field: AppliedUndef | None, modes: int, phase: float, whole_swing: bool
) -> None:
    left = float(system.domain.left)
    x = np.linspace(left, left + float(system.domain.length), 301)
    looks: dict[str, tuple[System, dict[str, Any]]] = {
        "elastic": (system, {"color": ORANGE, "linestyle": "-"}),
        "rigid": (rigid_ends(system), {"color": BLUE, "linestyle": (0, (4, 2))}),
    }
    if looks["rigid"][0] == system:
        looks = {"": looks["rigid"]}
    is_complex = system.conservative_part is not system
    found = {name: mode_shapes(one, x, modes, field=field, damped=is_complex) for name, (one, _) in looks.items()}
    for mode, ax in enumerate(row):
        ax.axhline(0.0, color="0.75", linewidth=0.8)
        for name in reversed(looks):
            hertz = oscillating_frequencies(looks[name][0], modes)[mode] / (2 * np.pi)
            shape = np.real(found[name][mode] * np.exp(0.0 if name == "rigid" else 1j * phase))
            ax.plot(x, shape, label=f"{name}, {hertz:.2f} Hz".removeprefix(", "), **looks[name][1])
        ax.margins(x=0.02, y=0.12)
        ax.legend(loc="upper center" if mode else "upper left", fontsize=8)
    largest = max(np.abs(shapes).max() for shapes in found.values())
    row[0].set_ylim(-1.15 * largest if whole_swing else None, 1.35 * largest)


def decades(system: System, name: str, low: int, high: int, points: int = 301) -> np.ndarray:
    """Return stiffnesses of the joint from 10^low to 10^high for the nominal arm, for another one decades like these.

    What counts is k_t L^3 / EI and k_r L / EI.
    """
    nominal, power = Arm.nominal(), {"k_t": 3, "k_r": 1}[name]
    arm = parameters_of(system)
    shift = round(float(np.log10(arm.EI / arm.L**power / (nominal.EI / nominal.L**power))))
    return np.logspace(low + shift, high + shift, points)


def _in_hertz(ax: Axes, stiffness: np.ndarray, found: np.ndarray, rigid: np.ndarray, name: str) -> None:
    """Draw frequencies, shape (len(stiffness), modes), against a stiffness, with those of the rigid joint."""
    for mode in range(found.shape[-1]):
        ax.axhline(rigid[mode], **_RIGID)
        (line,) = ax.plot(stiffness, found[:, mode])
        _label(ax, stiffness[-1], rigid[mode], f"$f_{mode + 1}$", line.get_color())
    note: dict[str, Any] = {"xytext": (-4, 3), "textcoords": "offset points", "color": "0.35", "fontsize": 8.5}
    ax.annotate("rigid joint", (stiffness[-1], rigid[-1]), ha="right", va="bottom", **note)
    _stiffness_axis(ax, stiffness, name)
    ax.set_ylim(0.0, 1.08 * max(found.max(), rigid.max(), ax.get_ylim()[1] / 1.08))
    ax.set_ylabel("natural frequency / Hz")


def _relative(ax: Axes, stiffness: np.ndarray, ratio: np.ndarray, name: str) -> None:
    """Draw frequencies over those of the rigid joint, shape (len(stiffness), modes), against a stiffness."""
    ax.axhline(1.0, **_RIGID)
    for mode in range(ratio.shape[-1]):
        ax.plot(stiffness, ratio[:, mode], label=f"$f_{mode + 1}$")
    ax.legend(loc="lower right" if ratio[0, 0] < 1.0 else "upper right")
    _stiffness_axis(ax, stiffness, name)
    ax.set_ylabel("frequency / that of the rigid joint")


def _stiffness_axis(ax: Axes, stiffness: np.ndarray, name: str) -> None:
    ax.set_xscale("log")
    ax.set_xlim(stiffness[0], stiffness[-1])
    ax.set_xlabel(f"{_QUANTITIES[name]} ${name}$ / ({_UNITS[name]})")


def _label(ax: Axes, x: float, y: float, text: str, colour: ColorType) -> None:
    ax.annotate(
        text, (x, y), xytext=(4, 0), textcoords="offset points", color=colour, va="center", annotation_clip=False
    )
