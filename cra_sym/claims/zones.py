"""Claims on how wide the zones of instability are: C16 and C17."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from cra_sym.analysis.stability import forced_width
from cra_sym.arm.excitations import JointStiffness
from cra_sym.claims.pictures import PALETTE, by_mode, note, stiffness_axis, strip
from cra_sym.claims.registry import claimed, pictured
from cra_sym.claims.setting import Setting
from cra_sym.claims.stability import KINDS, zone
from cra_sym.claims.verdict import EvidenceArray, Finding, Verdict, judged
from cra_sym.claims.words import by_outcome, listed, number, percent, span
from cra_sym.model.excitations import AxialBase, TransverseBase

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from cra_sym.arm.parameters import Arm


def _widths(setting: Setting, arm: Arm) -> np.ndarray:
    """Return the first-order widths of the first three principal zones: excitation, ..., mode.

    rad/s at the setting's epsilon; for the transverse base, which has no zone, the rate at which its forced resonance
    grows, m/s.
    """
    epsilon, modes = setting.epsilon, (1, 2, 3)
    forced = epsilon * forced_width(arm, TransverseBase(setting.amplitude), modes=3)

    def parametric(excitation: Any) -> np.ndarray:
        sides = [zone(arm, excitation, epsilon, (n, n)) for n in modes]
        return np.stack([high - low for low, high in sides], axis=-1)

    return np.stack([forced, parametric(JointStiffness()), parametric(AxialBase(setting.amplitude))])


def _where(k_t: np.ndarray, region: np.ndarray) -> str:
    """Return in words for which k_t a claim holds, by excitation."""
    across, joint, along = (span(k_t, row, "N/m") for row in region)
    return (
        f"for the fluctuating joint for $k_t$ of {joint}, for the base shaken along the arm {along}, for the forced "
        f"resonances of the base shaken across {across}"
    )


_WIDTH = "width at epsilon (transverse base: rate of its forced resonance, m/s)"


@claimed(
    "C16",
    "stability",
    "Section 5.2, Fig. 11",
    "zone 1 stays, 2 and 3 widen",
    "with the change of the tensional stiffness, the instability zone of the first principal resonance presents "
    "minor change "
    "while the instability regions of the second and third principal resonances become wider",
)
def zone_1_stays(setting: Setting) -> Finding:
    """Judge C16."""
    k_t = np.logspace(np.log10(setting.k_t[0]), np.log10(setting.k_t[-1]) - 1, 61)
    widths = _widths(setting, setting.arm.replace(k_t=k_t))
    minor = 10 * setting.visible

    def as_printed(measure: np.ndarray) -> np.ndarray:
        change = measure[:, 1:] - measure[:, :1]
        others = change[..., 1:].min(axis=-1)
        return np.asarray((others > 0) & (np.abs(change[..., 0]) <= minor * others))

    region, relative = as_printed(widths), as_printed(np.log(widths))
    evidence = {
        "k_t": EvidenceArray(k_t, "N/m", "translational stiffness, stiff to soft"),
        "width": EvidenceArray(widths, "rad/s", f"{_WIDTH}: excitation (transverse, joint, axial), k_t, mode"),
        "region": EvidenceArray(region, "1", "where the claim holds in absolute width: excitation, k_t but the first"),
        "relative": EvidenceArray(relative, "1", "the same for the relative change of the widths"),
    }
    series = as_printed(_widths(setting, setting.arm.replace(k_t=np.array(setting.k_t))))[1]
    judgement = judged(region, here=series)
    plain = by_outcome(
        judgement,
        "As the joint softens zone 1 stays and zones 2 and 3 widen, in every case tried.",
        "As the joint softens zone 1 stays and zones 2 and 3 widen for some excitations and down to some $k_t$ only.",
        "As the joint softens, in no case tried does zone 1 stay while zones 2 and 3 widen.",
    )
    factors = widths[1, -1] / widths[1, 0]
    in_relative = f"in {percent(relative.mean())} of the cases" if relative.any() else "nowhere"
    sentence = (
        f"With $k_t$ below {number(k_t[0])} N/m zones 2 and 3 are wider, and zone 1 has changed by under "
        f"{percent(minor)} of what they have, in rad/s, {_where(k_t[1:], region)}. In relative width they do so "
        f"{in_relative}: down to {number(k_t[-1])} N/m the joint's three zones widen "
        f"{listed(factors, lambda f: number(f, 2))}-fold, and zone 3 is widest at "
        f"{number(k_t[widths[1, :, 2].argmax()])} N/m."
    )
    criterion = (
        f"zones 2 and 3 are wider than at {number(k_t[0])} N/m and zone 1 has changed by at most {percent(minor)} of "
        f"what the lesser of them has, in rad/s, for $k_t$ down to {number(k_t[-1])} N/m and three excitations"
    )
    return Finding(judgement, plain, sentence, evidence, criterion)


@pictured("C16")
def draw_zone_1_stays(verdict: Verdict, ax: Axes) -> None:
    """Draw C16."""
    k_t = verdict["k_t"]
    by_mode(ax, k_t, verdict["width"][1])
    ax.set_yscale("log")
    _strips(ax, k_t[1:], verdict["region"], KINDS)
    stiffness_axis(ax, "k_t")
    ax.set_ylabel("width, fluctuating joint / (rad/s)")
    ax.set_ylim(top=8 * ax.get_ylim()[1])
    ax.legend(fontsize=8, loc="upper center", ncols=3, columnspacing=1.0, handlelength=2.2)


def _strips(ax: Axes, x: np.ndarray, rows: np.ndarray, names: tuple[str, ...]) -> None:
    """Add a strip an excitation below the curves: green where the claim holds, orange where not."""
    low, high = np.log(ax.get_ylim())
    step = 0.11 * (high - low)
    for k, (row, name) in enumerate(zip(rows, names, strict=True)):
        base = low - step * (k + 1)
        strip(ax, x, row, np.exp(base), np.exp(base + 0.85 * step))
        ax.text(x.max(), np.exp(base + 0.42 * step), f"{name} ", va="center", ha="right", fontsize=7.5, color="0.25")
    ax.set_ylim(np.exp(low - step * (len(names) + 0.15)), np.exp(high))


@claimed(
    "C17",
    "stability",
    "Section 5.2, Fig. 12",
    "a heavier end-effector narrows all zones",
    "with the increasing of the mass, the instability regions of the first three principal resonances become narrower",
)
def heavier_is_narrower(setting: Setting) -> Finding:
    """Judge C17."""
    k_t = np.logspace(2, 6, 61)
    masses = np.array(setting.masses)
    widths = _widths(setting, setting.arm.replace(k_t=k_t[:, None], m_e=masses))
    narrows = np.all(np.diff(widths, axis=2) < 0, axis=2)
    region = np.all(narrows, axis=-1)
    evidence = {
        "k_t": EvidenceArray(k_t, "N/m", "translational stiffness"),
        "masses": EvidenceArray(masses, "kg", "end-effectors"),
        "width": EvidenceArray(
            widths, "rad/s", f"{_WIDTH}: excitation (transverse, joint, axial), k_t, end-effector, mode"
        ),
        "narrows": EvidenceArray(
            narrows, "1", "whether the width falls with every step of mass: excitation, k_t, mode"
        ),
        "region": EvidenceArray(region, "1", "whether it does for all three: excitation, k_t"),
    }
    ours = _widths(setting, setting.arm.replace(k_t=setting.soft_k_t, m_e=masses))[1]
    judgement = judged(region, here=np.diff(ours, axis=0) < 0)
    plain = by_outcome(
        judgement,
        "A heavier end-effector narrows all three zones, in every case tried.",
        "A heavier end-effector narrows all three zones for some joints and excitations, and widens one for others.",
        "In no case tried does a heavier end-effector narrow all three zones at once.",
    )
    change = widths[1, :, -1] / widths[1, :, 0] - 1
    stiff = int(np.argmin(np.abs(k_t - setting.k_t[-1])))
    sentence = (
        f"All three narrow with the mass {_where(k_t, region)}. "
        f"From {number(masses[0])} to {number(masses[-1])} kg the joint's zones change by "
        f"{listed(change[stiff], percent)} at {number(k_t[stiff])} N/m."
    )
    criterion = (
        f"each step of the end-effector's mass narrows all three zones, for $k_t$ of {number(k_t[0])} to "
        f"{number(k_t[-1])} N/m and three excitations; no threshold"
    )
    return Finding(judgement, plain, sentence, evidence, criterion)


@pictured("C17")
def draw_heavier_is_narrower(verdict: Verdict, ax: Axes) -> None:
    """Draw C17."""
    k_t, narrows = verdict["k_t"], verdict["narrows"]
    for kind in range(narrows.shape[0]):
        for mode in range(narrows.shape[-1]):
            base = 4 * kind + mode
            strip(ax, k_t, narrows[kind, :, mode], base, base + 0.85)
            ax.text(k_t[0] * 1.15, base + 0.42, f"zone {mode + 1}", va="center", fontsize=7.5, color=PALETTE[mode])
    ax.set_xscale("log")
    ax.set_yticks([4 * kind + 1.4 for kind in range(3)], [name.replace(" ", "\n") for name in KINDS])
    ax.set_ylim(-0.2, 12.6)
    ax.set_xlim(k_t[0], k_t[-1])
    ax.grid(False)
    stiffness_axis(ax, "k_t")
    note(ax, "green: narrower with more mass", "upper right")
