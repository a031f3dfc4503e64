"""Slip in the joint: hysteresis loops, frequency and damping over amplitude, effect of the preload."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import cycle
from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import ArrayLike

from cra_sym.analysis.backbone import Backbone, backbone
from cra_sym.analysis.modes import natural_frequencies
from cra_sym.analysis.slip_response import SlipResponse, slip_response
from cra_sym.analysis.stability import judged_boundary
from cra_sym.analysis.steady_states import steady_states
from cra_sym.arm.bolted_joint import BoltedJoint
from cra_sym.arm.parameters import Arm
from cra_sym.checks import count, instance, one_number
from cra_sym.figures import styled
from cra_sym.figures.drawing import BLUE, GREEN, INK, ORANGE, Panels, figure_of, panel, panels
from cra_sym.figures.subject import arm_or_nominal, positive
from cra_sym.model.excitations import Fluctuation
from cra_sym.model.system import System
from cra_sym.solvers.motion import BaseMotion

if TYPE_CHECKING:
    from matplotlib.axes import Axes

__all__ = ["figure_preload", "figure_preload_tongues", "figure_slip_amplitude", "figure_slip_loop",
           "figure_tongue_bounds", "show_loop"]  # fmt: skip

_MOVE = {"distance": 0.3, "v_max": 0.5, "a_max": 2.0}
_ZETA = 0.002
_SOFT = BoltedJoint(rest=20.0, body_t=20.0, lever=0.05)  # visible deformation before slip


def show_loop(found: SlipResponse, *, ax: Axes | None = None) -> Figure:
    """Draw force over displacement of the first place that slips, and mark where it does.

    Parameters
    ----------
    found : SlipResponse
        Of one system, its times close enough to be joined by lines.
    ax : Axes, optional
    """
    with styled():
        ax = panel(ax, (6.4, 3.9))
        moved, force = 1e3 * found.displacement[0], found.force.sum(axis=0)
        ax.plot(moved, force, "-", color=INK, linewidth=0.8, label="sticks")
        slips = (found.state != 0).any(axis=0)
        ax.plot(moved[slips], force[slips], ".", color=ORANGE, markersize=3, linestyle="none", label="slips")
        ax.set_xlabel("displacement of the joint / mm")
        ax.set_ylabel("force of the faces / N")
        ax.legend()
    return figure_of(ax)


def figure_slip_loop(
    arm: Arm | None = None,
    *,
    joint: BoltedJoint | None = None,
    preload: float = 2.0,
    duration: float = 1.5,
    ax: Axes | None = None,
) -> Figure:
    """Draw the force of the faces of a bolted joint over its displacement during a move: each loop is work lost.

    Parameters
    ----------
    arm : Arm, optional
        Default: the nominal one, slightly damped.
    joint : BoltedJoint, optional
    preload : float
        N.
    duration : float
        s.
    ax : Axes, optional
    """
    arm = arm_or_nominal(arm, zeta=_ZETA)
    system = (BoltedJoint() if joint is None else joint).on(arm, one_number("preload", preload, unit="N"))
    found = slip_response(system, BaseMotion.trapezoid(**_MOVE), np.linspace(0.0, duration, 1501), modes=4)
    return show_loop(found, ax=ax)


def figure_slip_amplitude(
    system: System | None = None,
    *,
    mode: int = 1,
    modes: int = 2,
    amplitude: ArrayLike | None = None,
    curve: Backbone | None = None,
    axes: Panels | None = None,
) -> Figure:
    """Draw frequency and damping ratio of a mode with elastic-slip elements over the amplitude of its tip.

    Parameters
    ----------
    system : System, optional
        With elastic-slip elements. An arm is put on a joint that is soft and slips at 0.1 N; default: the nominal one,
        slightly damped.
    mode, modes : int
    amplitude : array_like, optional
        m.
    curve : Backbone, optional
        Curve computed already.
    axes : sequence of two Axes, optional

    Raises
    ------
    ValueError
        If the system has no elastic-slip elements.
    """
    if curve is None:
        system = Arm.nominal().replace(zeta=_ZETA) if system is None else system
        if isinstance(system, Arm):
            system = _SOFT.on(system, 0.1 / _SOFT.friction)
        if not system.model.pieces["hysteresis"]:
            raise ValueError("system: must have elastic-slip elements: Model(.., hysteresis=[(cra.Jenkins(..), ..)])")
        amplitude = np.geomspace(4e-3, 0.3, 25) if amplitude is None else amplitude
        curve = backbone(system, mode, amplitude=amplitude, modes=modes)
    instance("curve", curve, Backbone)
    with styled():
        left, right = panels(axes, 1, 2, (8.8, 3.7)).ravel()
        size = 1e3 * np.asarray(curve.amplitude)
        left.semilogx(size, curve.angular_frequency / (2 * np.pi), "-o", color=BLUE, markersize=3)
        right.loglog(size, curve.damping_ratio, "-o", color=ORANGE, markersize=3)
        for ax, label in ((left, "frequency / Hz"), (right, "damping ratio")):
            ax.set_xlabel("amplitude at the tip / mm")
            ax.set_ylabel(label)
    return figure_of(left)


def figure_tongue_bounds(
    epsilon: ArrayLike, bounded: ArrayLike, threshold: ArrayLike, *, ax: Axes | None = None
) -> Figure:
    """Draw the amplitude to which friction limits vibration in one tongue, and beyond which it does not in another.

    Parameters
    ----------
    epsilon : array_like, shape (n,)
        Size of the excitation.
    bounded : array_like, shape (n,)
        Amplitude of the stable vibration at twice the stuck frequency, m; nan where there is none.
    threshold : array_like, shape (n,)
        Amplitude of the unstable one at twice the sliding frequency, m: smaller vibrations decay, larger ones grow.
    ax : Axes, optional
    """
    with styled():
        ax = panel(ax, (6.4, 3.9))
        curves = (
            (bounded, BLUE, "-", "o", "bounded, at twice the stuck"),
            (threshold, ORANGE, "--", "^", "threshold, at twice the sliding"),
        )
        for size, color, line, marker, label in curves:
            ax.plot(epsilon, 1e3 * np.asarray(size), color=color, linestyle=line, marker=marker, ms=4, label=label)
        ax.set_ylim(bottom=0.0)
        ax.set_xlabel("size of the excitation $\\epsilon$")
        ax.set_ylabel("amplitude at the tip / mm")
        ax.legend(title="frequency of the joint")
    return figure_of(ax)


def figure_preload(
    arm: Arm | None = None,
    *,
    joint: BoltedJoint | None = None,
    preload: ArrayLike | None = None,
    shown: Sequence[float] = (1.0, 3.0, 100.0),
    duration: float = 4.0,
    modes: int = 4,
    axes: Panels | None = None,
) -> Figure:
    """Draw what the preload of a bolted joint does to frequencies, to the vibration after a move and to its course.

    Left: natural frequencies while the faces stick, over those of a rigid joint. Middle: the tip's largest
    displacement, that in the last quarter, and what friction took of the work put in. Right: the tip during and after
    the move.

    Parameters
    ----------
    arm : Arm, optional
        Default: the nominal one, slightly damped.
    joint : BoltedJoint, optional
    preload : array_like, optional
        N, ascending.
    shown : sequence of float
        Preloads whose move is drawn, N.
    duration : float
        Of what is followed, s.
    modes : int
    axes : sequence of three Axes, optional
    """
    arm = arm_or_nominal(arm, zeta=_ZETA)
    joint = BoltedJoint() if joint is None else joint
    forces = np.geomspace(0.3, 100.0, 25) if preload is None else positive("preload", preload, "preloads", unit="N")
    times = np.linspace(0.0, duration, 401)
    chosen = positive("shown", shown, "preloads", 1, unit="N")
    move, systems = BaseMotion.trapezoid(**_MOVE), joint.on(arm, forces)
    found = slip_response(systems, move, times, modes=modes)
    some = slip_response(joint.on(arm, chosen), move, times, modes=modes)
    peak, late = (1e3 * np.abs(found.tip[..., times >= since]).max(axis=-1) for since in (0.0, 0.75 * duration))
    rigid = natural_frequencies(arm.replace(k_t=np.inf, k_r=np.inf))
    with styled():
        left, middle, right = panels(axes, 1, 3, (12.0, 3.7)).ravel()
        kinds = ((INK, "-", "mode 1"), (BLUE, "--", "mode 2"), (ORANGE, ":", "mode 3"))
        for column, (color, line, label) in zip((natural_frequencies(systems) / rigid).T, kinds, strict=True):
            left.semilogx(forces, column, color=color, linestyle=line, label=label)
        left.set_ylabel("frequency over that of a rigid joint")
        left.legend()
        middle.semilogx(forces, peak, color=GREEN, linestyle="-.", label="peak / mm")
        middle.semilogx(forces, late, color=BLUE, label="late vibration / mm")
        taken = 100 * found.dissipated[..., -1].sum(axis=-1) / found.work.max(axis=-1)
        middle.semilogx(forces, taken, color=ORANGE, linestyle="--", label="lost by friction / %")
        middle.set_ylabel("displacement / mm, share of the work / %")
        middle.legend()
        for ax in (left, middle):
            ax.set_xlabel("preload / N")
        lines = ((ORANGE, ":"), (GREEN, "-"), (INK, "--"))
        for force, tip, (color, line) in zip(chosen, some.tip, cycle(lines), strict=False):
            right.plot(times, 1e3 * tip, color=color, linestyle=line, linewidth=0.9, label=f"{force:g} N")
        right.set_xlabel("time $t$ / s")
        right.set_ylabel("$v(L, t)$ / mm")
        right.set_ylim(top=1.4 * right.get_ylim()[1])
        right.legend(title="preload", ncols=3, loc="upper right")
    return figure_of(left)


def figure_preload_tongues(
    arm: Arm | None = None,
    *,
    joint: BoltedJoint | None = None,
    preload: ArrayLike | None = None,
    excitation: Fluctuation | None = None,
    epsilon: float = 0.3,
    amplitude: float = 0.02,
    amplitudes: int = 4,
    harmonics: int = 7,
    axes: Panels | None = None,
) -> Figure:
    """Draw what the preload of a bolted joint does to damping, to the width of tongues, and to the vibration inside.

    Left: damping ratio of mode 1 at an amplitude of the tip. Middle: widths of the principal tongues of modes 1 to 3
    while the faces stick, where damping does not close them. Right: the amplitude at which slip bounds the vibration at
    twice the first frequency. Left and right by harmonic balance.

    Parameters
    ----------
    arm : Arm, optional
        Default: the nominal one, slightly damped.
    joint : BoltedJoint, optional
        Default: one that is soft.
    preload : array_like, optional
        N, ascending.
    excitation : Fluctuation, optional
        Default: both springs of the joint that do not slip.
    epsilon : float
        Its size.
    amplitude : float
        Of the left panel, m.
    amplitudes : int
        Number of preloads of the right panel, at least 2; of the left one three times as many.
    harmonics : int
    axes : sequence of three Axes, optional
    """
    arm = arm_or_nominal(arm, zeta=_ZETA)
    excitation = Fluctuation(k_t=1.0, k_r=1.0) if excitation is None else excitation
    forces = np.geomspace(0.1, 10.0, 25) if preload is None else positive("preload", preload, "preloads", unit="N")
    systems = (_SOFT if joint is None else joint).on(arm, forces)
    widths = [np.subtract(*judged_boundary(systems, excitation, epsilon, (n, n))[1::-1]) for n in (1, 2, 3)]
    few = count("amplitudes", amplitudes, low=2)
    picked, often = (np.unique(np.linspace(0, forces.size - 1, n).round().astype(int)) for n in (few, 3 * few))
    options: dict[str, Any] = {"excitation": excitation, "epsilon": epsilon, "modes": 2, "period": 2}
    varpi = 4 * np.pi * natural_frequencies(systems, 1)[:, 0]
    each = systems.parameter_sets
    found = [steady_states(each[k], float(varpi[k]), harmonics=harmonics, **options) for k in picked]
    held: dict[str, Any] = {"amplitude": amplitude, "modes": 2, "harmonics": harmonics}
    damping = [float(backbone(each[k], 1, **held).damping_ratio) for k in often]
    bounded = [max((s.amplitude for s in states if s.stable and s.amplitude > 0), default=np.nan) for states in found]
    with styled():
        left, middle, right = panels(axes, 1, 3, (12.0, 3.7)).ravel()
        left.loglog(forces[often], damping, "-o", color=ORANGE, markersize=4)
        left.set_ylabel(f"damping ratio at {1e3 * amplitude:g} mm")
        kinds = ((INK, "-", "mode 1"), (BLUE, "--", "mode 2"), (ORANGE, ":", "mode 3"))
        for width, (color, line, label) in zip(widths, kinds, strict=True):
            middle.semilogx(forces, width, color=color, linestyle=line, label=label)
        middle.set_ylabel("width of the tongue / (rad/s)")
        middle.legend()
        right.loglog(forces[picked], 1e3 * np.array(bounded), "-o", color=BLUE, markersize=4)
        right.set_ylabel("amplitude inside tongue 1 / mm")
        for ax in (left, middle, right):
            ax.set_xlabel("preload / N")
    return figure_of(left)
