"""Claims on how sensitive the frequencies are to the joint: C05, C06, C06b and C20."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from cra_sym.analysis.modal_parameters import modal_parameters
from cra_sym.analysis.modes import natural_frequencies
from cra_sym.analysis.sensitivities import sensitivities
from cra_sym.claims.pictures import PALETTE, STYLES, by_mode, note, stiffness_axis
from cra_sym.claims.registry import claimed, pictured
from cra_sym.claims.setting import Setting
from cra_sym.claims.verdict import EvidenceArray, Finding, Verdict, judged
from cra_sym.claims.words import by_outcome, listed, number, percent

if TYPE_CHECKING:
    from matplotlib.axes import Axes


@claimed(
    "C05",
    "modes",
    "Section 4, Fig. 5",
    "more sensitive to $k_t$ than to $k_r$",
    "the mode frequencies are more sensitive to the tensional stiffness",
)
def more_sensitive_to_k_t(setting: Setting) -> Finding:
    """Judge C05."""
    k_t, k_r = np.logspace(1, 6, 81), np.logspace(0, 5, 81)
    plane = sensitivities(setting.arm.replace(k_t=k_t[:, None], k_r=k_r))
    region = plane.log_k_t > plane.log_k_r
    series = sensitivities(setting.arm.replace(k_t=np.array(setting.k_t)[:, None], k_r=np.array(setting.k_r)))
    at_series = series.log_k_t > series.log_k_r
    raw = series.df_dk_t / series.df_dk_r
    rigid = modal_parameters(setting.rigid)
    critical = (rigid.root_shear / rigid.root_moment * float(setting.arm.L)) ** 2
    evidence = {
        "k_t": EvidenceArray(k_t, "N/m", "translational stiffness"),
        "k_r": EvidenceArray(k_r, "N m/rad", "rotational stiffness"),
        "region": EvidenceArray(region, "1", "whether dln f/dln k_t > dln f/dln k_r: k_t, k_r, mode"),
        "ratio": EvidenceArray(plane.log_k_t / plane.log_k_r, "1", "of the logarithmic sensitivities: k_t, k_r, mode"),
        "critical": EvidenceArray(critical, "1", "k_t L^2 / k_r below which it holds near the rigid joint, by mode"),
        "series": EvidenceArray(at_series, "1", "the claim at the stiffnesses of Fig. 5: k_t, k_r, mode"),
        "raw_ratio": EvidenceArray(raw, "m^2", "df/dk_t over df/dk_r at the stiffnesses of Fig. 5: k_t, k_r, mode"),
    }
    unit = np.sqrt(raw)
    judgement = judged(region, here=at_series)
    plain = by_outcome(
        judgement,
        "The frequencies are always more sensitive to $k_t$, per cent for per cent.",
        "Which of the two stiffnesses matters more, per cent for per cent, depends on the joint and on the mode.",
        "The frequencies are never more sensitive to $k_t$, per cent for per cent.",
    )
    sentence = (
        "The raw slopes compare hertz per N/m with hertz per N m/rad: which is larger depends on the unit of length, "
        f"and in Fig. 5 turns over for units between {number(unit.min(), 2)} and {number(unit.max(), 2)} m. In "
        r"relative terms, $d\ln f/d\ln k$, it holds in "
        f"{percent(region.mean())} of the plane, near the rigid joint for $k_t L^2/k_r$ below {listed(critical)} "
        f"(modes 1 to 3, with the end-effector of {number(1e3 * float(setting.arm.m_e))} g), and at {at_series.sum()} "
        f"of the {at_series.size} points of Fig. 5."
    )
    criterion = (
        rf"$d\ln f/d\ln k_t$ is larger than $d\ln f/d\ln k_r$, for $k_t$ of {number(k_t[0])} to {number(k_t[-1])} N/m, "
        f"$k_r$ of {number(k_r[0])} to {number(k_r[-1])} N m/rad and modes 1 to 3; no threshold"
    )
    return Finding(judgement, plain, sentence, evidence, criterion)


@pictured("C05")
def draw_more_sensitive_to_k_t(verdict: Verdict, ax: Axes) -> None:
    """Draw C05."""
    x, y, ratio = verdict["k_t"], verdict["k_r"], np.log(verdict["ratio"])
    many = (ratio > 0).sum(-1)
    ax.contourf(x, y, many.T, levels=[-0.5, 0.5, 1.5, 2.5, 3.5], colors=["#F4F4F4", "#DDEFE8", "#BFE3D6", "#96D1BC"])
    for mode in range(ratio.shape[-1]):
        ax.contour(x, y, ratio[..., mode].T, levels=[0], colors=[PALETTE[mode]], linestyles=[STYLES[mode]])
        ax.plot([], [], color=PALETTE[mode], ls=STYLES[mode], label=f"mode {mode + 1}")
    grid = np.meshgrid(verdict.setting.k_t, verdict.setting.k_r)
    ax.plot(*map(np.ravel, grid), "o", color="0.2", ms=3, ls="", label="Fig. 5")
    stiffness_axis(ax, "k_t")
    stiffness_axis(ax, "k_r", "y")
    ax.set(xlim=(x[0], x[-1]), ylim=(y[0], y[-1]))
    box = {"facecolor": "white", "framealpha": 0.8, "frameon": True, "edgecolor": "none"}
    ax.legend(loc="upper left", fontsize=8, ncols=2, columnspacing=0.8,
              title="tint: in 1, 2, 3 modes", title_fontsize=8, **box)  # fmt: skip


@claimed(
    "C06",
    "modes",
    "Section 4, Fig. 5",
    "the sensitivity to $k_t$ grows as it softens",
    "with the decreasing of [the tensional stiffness], the sensitivity [to it] obviously enhances",
)
def sensitivity_to_k_t_grows(setting: Setting) -> Finding:
    """Judge C06."""
    k_t = np.logspace(6, 0, 121)
    slope = sensitivities(setting.arm.replace(k_t=k_t)).df_dk_t
    grows = np.diff(slope, axis=0) > 0
    turn = k_t[np.argmax(slope, axis=0)]
    evidence = {
        "k_t": EvidenceArray(k_t, "N/m", "translational stiffness, stiff to soft"),
        "df_dk_t": EvidenceArray(slope, "Hz m/N", "along k_t: k_t, mode"),
        "region": EvidenceArray(grows, "1", "whether the next softer k_t has the larger df/dk_t: k_t, mode"),
        "turn": EvidenceArray(turn, "N/m", "k_t at which df/dk_t is largest, by mode"),
    }
    series = sensitivities(setting.arm.replace(k_t=np.array(setting.k_t))).df_dk_t
    judgement = judged(grows, here=np.diff(series, axis=0) > 0)
    plain = by_outcome(
        judgement,
        "The softer $k_t$, the more sensitive are the frequencies to it.",
        "A softer $k_t$ makes the frequencies more sensitive to it, but not for every mode down to the softest joint.",
        "A softer $k_t$ never makes the frequencies more sensitive to it.",
    )
    ends = [f"down to {number(k)} N/m" if k > k_t[-1] else f"all the way to {number(k)} N/m" for k in turn]
    sentence = (
        f"$df/dk_t$ grows as $k_t$ falls {listed(ends, str)} (modes 1 to 3)"
        f"{', and shrinks beyond' if (turn > k_t[-1]).any() else ''}."
    )
    criterion = (
        f"$df/dk_t$ grows with each step of $k_t$ from {number(k_t[0])} down to {number(k_t[-1])} N/m, modes 1 to 3; "
        "no threshold"
    )
    return Finding(judgement, plain, sentence, evidence, criterion)


@pictured("C06")
def draw_sensitivity_to_k_t_grows(verdict: Verdict, ax: Axes) -> None:
    """Draw C06."""
    _slopes(verdict, ax, "k_t")


@claimed(
    "C06b",
    "modes",
    "Section 4, Fig. 5",
    "the sensitivity to $k_r$ hardly changes",
    "the sensitivity to [the torsional stiffness] presents tiny change",
)
def sensitivity_to_k_r_stays(setting: Setting) -> Finding:
    """Judge C06b, the second half of the sentence of C06."""
    k_r = np.logspace(5, -1, 121)
    slope = sensitivities(setting.arm.replace(k_r=k_r)).df_dk_r
    series = sensitivities(setting.arm.replace(k_r=np.array(setting.k_r))).df_dk_r
    # the other reading of the sentence: the sensitivity to k_r while k_t falls
    other = sensitivities(setting.arm.replace(k_t=np.array(setting.k_t), k_r=setting.k_r[1])).df_dk_r
    factor, factor_other = series[-1] / series[0], other[-1] / other[0]
    change = 10 * setting.visible
    tiny, tiny_other = (np.abs(np.log(f)) < np.log1p(change) for f in (factor, factor_other))
    evidence = {
        "k_r": EvidenceArray(k_r, "N m/rad", "rotational stiffness, stiff to soft"),
        "df_dk_r": EvidenceArray(slope, "Hz rad/(N m)", "along k_r: k_r, mode"),
        "region": EvidenceArray(tiny, "1", "whether df/dk_r hardly changes along the k_r of Fig. 5, by mode"),
        "factor": EvidenceArray(factor, "1", "df/dk_r from the first to the last k_r of Fig. 5, by mode"),
        "tiny_other": EvidenceArray(tiny_other, "1", "whether it hardly changes along the k_t of Fig. 5, by mode"),
        "factor_other": EvidenceArray(factor_other, "1", "df/dk_r from the first to the last k_t of Fig. 5, by mode"),
    }
    judgement = judged(tiny)
    plain = by_outcome(
        judgement,
        "The sensitivity to $k_r$ hardly changes with $k_r$.",
        "The sensitivity to $k_r$ hardly changes for some modes, and changes for others.",
        "The sensitivity to $k_r$ changes with $k_r$ in every mode.",
    )
    sentence = (
        f"Over the $k_r$ of Fig. 5 $df/dk_r$ changes by factors {listed(factor, _factor)} (modes 1 to 3); read as "
        f"$k_t$ falls at fixed $k_r$, by {listed(factor_other, _factor)}."
    )
    axis = sensitivities(setting.arm.replace(k_t=np.array(setting.k_t))).df_dk_t.max()
    unseen = k_r[np.all(slope < setting.visible * axis, axis=-1)]
    remedy = None
    if judgement.outcome != "holds" and unseen.size:
        remedy = (
            f"stiffer joints on one common axis: for $k_r$ over {number(unseen.min())} N m/rad $df/dk_r$ stays below "
            f"{percent(setting.visible)} of an axis that shows $df/dk_t$, a tiny change to the eye"
        )
    criterion = f"$df/dk_r$ changes by less than {percent(change)} over the $k_r$ of Fig. 5, modes 1 to 3"
    return Finding(judgement, plain, sentence, evidence, criterion, remedy)


@pictured("C06b")
def draw_sensitivity_to_k_r_stays(verdict: Verdict, ax: Axes) -> None:
    """Draw C06b."""
    _slopes(verdict, ax, "k_r")


def _slopes(verdict: Verdict, ax: Axes, name: str) -> None:
    """Draw df/dk over k, a curve a mode."""
    by_mode(ax, verdict[name], verdict[f"df_d{name}"])
    ax.set_yscale("log")
    stiffness_axis(ax, name)
    ax.set_ylabel(f"$df/d{name}$ / Hz per SI unit")


def _factor(value: float) -> str:
    return number(value, 2)


@claimed(
    "C20",
    "modes",
    "Section 4, Figs. 3 and 4",
    "the two springs act differently",
    "the effect mechanisms of the tensional restraint stiffness and the torsional restraint stiffness are different",
)
def two_mechanisms(setting: Setting) -> Finding:
    """Judge C20."""
    length, bending = float(setting.arm.L), float(setting.arm.EI)
    give = sensitivities(setting.rigid)
    drop_t = -give.df_dc_t * length**3 / (bending * give.frequency)
    drop_r = -give.df_dc_r * length / (bending * give.frequency)
    kappa = np.logspace(1, 6, 51)
    soft = [setting.rigid.replace(k_t=kappa * bending / length**3), setting.rigid.replace(k_r=kappa * bending / length)]
    drop = np.stack([1 - natural_frequencies(arm) / give.frequency for arm in soft])
    spread_t, spread_r = drop_t.max() / drop_t.min() - 1, drop_r.max() / drop_r.min() - 1
    differ = np.abs(drop_t / drop_r / (drop_t / drop_r)[0] - 1)[1:] > setting.visible
    evidence = {
        "kappa": EvidenceArray(kappa, "1", "dimensionless stiffness of the one spring, the other one rigid"),
        "drop": EvidenceArray(drop, "1", "relative fall of the frequency: spring (t, r), kappa, mode"),
        "coefficient_t": EvidenceArray(drop_t, "1", "c in c / kappa_t, the fall near the rigid joint, by mode"),
        "coefficient_r": EvidenceArray(drop_r, "1", "c in c / kappa_r, the fall near the rigid joint, by mode"),
    }
    judgement = judged(differ)
    plain = by_outcome(
        judgement,
        "The two springs act differently: a softer $k_r$ lowers all modes alike, a softer $k_t$ the higher ones more.",
        "The two springs act differently on some modes only.",
        "The two springs act alike on every mode.",
    )
    sentence = (
        r"Near the rigid joint a frequency falls by the fraction $c/\kappa$. For the rotational spring $c$ is "
        f"{listed(drop_r, lambda c: number(c, 4))}, within {percent(spread_r)} the same for every mode; for the "
        f"translational one {listed(drop_t)}, from least to largest {number(1 + spread_t, 2)}-fold."
    )
    criterion = (
        "from mode 1 to modes 2 and 3 the two springs' shares in the fall of the frequency change their ratio by over "
        f"{percent(setting.visible)}"
    )
    return Finding(judgement, plain, sentence, evidence, criterion)


@pictured("C20")
def draw_two_mechanisms(verdict: Verdict, ax: Axes) -> None:
    """Draw C20."""
    kappa = verdict["kappa"]
    by_mode(ax, kappa, verdict["drop"][0] * kappa[:, None])
    for mode, curve in enumerate((verdict["drop"][1] * kappa[:, None]).T):
        ax.plot(kappa, curve, lw=0.9, color=PALETTE[mode], ls=STYLES[mode])
    ax.set(xscale="log", yscale="log", xlabel="$\\kappa_t$ or $\\kappa_r$, the other infinite")
    ax.set_ylabel("relative fall times $\\kappa$")
    ax.set_xlim(kappa[0], kappa[-1])
    note(ax, "thick: $k_t$; thin: $k_r$", "upper left")
