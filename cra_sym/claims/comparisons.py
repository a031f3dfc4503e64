"""Claims that compare responses: elastic with rigid joint (C10, C11), small with large acceleration (C12, C13)."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from cra_sym.analysis.modes import natural_frequencies
from cra_sym.claims.motions import Plane, peak, tip
from cra_sym.claims.pictures import PALETTE, STYLES, note, region_map
from cra_sym.claims.registry import claimed, pictured
from cra_sym.claims.responses import plane_picture
from cra_sym.claims.setting import Setting
from cra_sym.claims.verdict import EvidenceArray, Finding, Verdict, judged
from cra_sym.claims.words import by_outcome, listed, mm, number, percent, span

if TYPE_CHECKING:
    from matplotlib.axes import Axes


def _softened(setting: Setting, mean: dict[str, float], what: str) -> Finding:
    """Judge whether elastic joints lower the peak of the response to ``what``, compared with the rigid joint."""
    k_t = np.logspace(2, 6, 33)
    varpi = Plane.of(setting).varpi
    elastic = setting.arm.replace(k_t=k_t[:, None])
    soft, fixed = setting.arm.replace(k_t=setting.soft_k_t), setting.arm.replace(k_t=np.inf)

    def peaks(arm: Any, frequency: Any, relative: bool = False) -> np.ndarray:
        motion = setting.disturbance | mean | {"angular_frequency": frequency}
        return peak(tip(setting, arm, motion, relative=relative))

    seen = 1 - setting.visible
    ratios = [np.log(peaks(elastic, varpi, kind) / peaks(fixed, varpi, kind)) for kind in (False, True)]
    region, region_relative = (ratio.T < np.log(seen) for ratio in ratios)
    fine = np.linspace(varpi[0], varpi[-1], 241)
    smaller = peaks(soft, fine) < seen * peaks(fixed, fine)
    nominal = float(peaks(soft, setting.angular_frequency)), float(peaks(fixed, setting.angular_frequency))
    first = [2 * np.pi * float(natural_frequencies(arm, 1)[0]) for arm in (soft, fixed)]
    evidence = {
        "varpi": EvidenceArray(varpi, "rad/s", "frequency of the disturbance"),
        "k_t": EvidenceArray(k_t, "N/m", "translational stiffness"),
        "log_ratio": EvidenceArray(ratios[0].T, "1", "ln of the peak of v(L, t), elastic over rigid: varpi, k_t"),
        "log_ratio_relative": EvidenceArray(
            ratios[1].T, "1", "the same for v(L, t) - v(0, t), the joint's give left out"
        ),
        "nominal": EvidenceArray(nominal, "m", "peak at the nominal disturbance: elastic, rigid"),
        "first_frequency": EvidenceArray(first, "rad/s", "first natural frequency: elastic, rigid"),
        "region": EvidenceArray(region, "1", "where the elastic joint's peak is visibly smaller: varpi, k_t"),
        "smaller": EvidenceArray(smaller, "1", "the same at the soft k_t of Figs. 7 and 8, by fine_varpi"),
        "fine_varpi": EvidenceArray(fine, "rad/s", "frequency of the disturbance"),
    }
    judgement = judged(region, here=nominal[0] < seen * nominal[1])
    plain = by_outcome(
        judgement,
        f"The response to {what} is smaller on an elastic joint, whatever its stiffness and the disturbance.",
        f"Whether the response to {what} is smaller on an elastic joint depends on the disturbance's frequency: "
        "softening moves the first natural frequency away from some and towards others.",
        f"The response to {what} is smaller on no elastic joint.",
    )
    sentence = (
        f"With $k_t$ = {number(setting.soft_k_t)} N/m $v(L,t)$ is smaller than on the rigid joint, by over "
        rf"{percent(setting.visible)}, for $\varpi$ of "
        f"{span(fine, smaller, 'rad/s')}; at {number(setting.angular_frequency)} rad/s it is {mm(nominal[0])} mm "
        rf"against {mm(nominal[1])} mm. The spring changes $\omega_1$ from {number(first[1])} to {number(first[0])} "
        f"rad/s; for disturbances below that the response is smaller at {percent(smaller[fine < first[0]].mean())} of "
        f"the frequencies, above at {percent(smaller[fine > first[1]].mean())}, where the beats that fall into "
        f"{number(setting.duration)} s decide. For $k_t$ of {number(k_t[0])} to {number(k_t[-1])} N/m the claim holds "
        f"in {percent(region.mean())} of the plane, measured as $v(L) - v(0)$ in {percent(region_relative.mean())}."
    )
    criterion = (
        f"the largest $|v(L,t)|$ is smaller than on the rigid joint by over {percent(setting.visible)}, for $k_t$ of "
        f"{number(k_t[0])} to {number(k_t[-1])} N/m and frequencies up to twice the first natural one"
    )
    return Finding(judgement, plain, sentence, evidence, criterion)


@claimed(
    "C10",
    "responses",
    "Section 5.1, Fig. 7",
    "smaller response on an elastic joint",
    "the vibration response amplitude of the end-effector with [finite tensional stiffness] is smaller than that of "
    "rigid "
    "restraint",
)
def smaller_on_an_elastic_joint(setting: Setting) -> Finding:
    """Judge C10."""
    acceleration = setting.accelerations[0]
    what = f"an acceleration of {number(acceleration)} m/s² and the disturbance"
    return _softened(setting, {"acceleration": acceleration}, what)


@claimed(
    "C11",
    "responses",
    "Section 5.1, Fig. 8",
    "$k_t$ suppresses the disturbance",
    "the error of [finite tensional stiffness] is smaller than fixed restraint. This indicates that tensional "
    "stiffness has "
    "a suppressing effect on the motion disturbance",
)
def disturbance_suppressed(setting: Setting) -> Finding:
    """Judge C11."""
    return _softened(setting, {}, "the disturbance alone, the error,")


def _softened_picture(verdict: Verdict, ax: Axes, label: str) -> None:
    ax.set_yscale("log")
    here = verdict.setting.angular_frequency, verdict.setting.soft_k_t
    region_map(
        ax,
        verdict["varpi"],
        verdict["k_t"],
        verdict["log_ratio"],
        ("varpi", "k_t"),
        here,
        verdict.setting.visible,
    )
    apart = f"grey: less than {percent(verdict.setting.visible)} apart"
    note(ax, f"green: {label}; dot: nominal\n{apart}", "upper right")


@pictured("C10")
def draw_smaller_on_an_elastic_joint(verdict: Verdict, ax: Axes) -> None:
    """Draw C10."""
    _softened_picture(verdict, ax, "smaller than rigid")


@pictured("C11")
def draw_disturbance_suppressed(verdict: Verdict, ax: Axes) -> None:
    """Draw C11."""
    _softened_picture(verdict, ax, "error smaller")


@claimed(
    "C12",
    "responses",
    "Section 5.1, Fig. 9",
    "amplitude grows with acceleration",
    "the vibration response amplitudes increase with the motion accelerations",
)
def amplitude_grows_with_acceleration(setting: Setting) -> Finding:
    """Judge C12."""
    plane, a = Plane.of(setting), np.array(setting.accelerations)
    pairs = [plane.peaks(acceleration=value) for value in a]
    found, without = np.stack([with_ for with_, _ in pairs]), np.array([bare for _, bare in pairs])
    least = np.log(found[1:] / found[:-1]).min(axis=0)
    scales = np.abs(without / without[0] - a / a[0]).max()
    fails = plane.varpi[(least <= 0).any(axis=1)]
    evidence = {
        **plane.axes,
        "log_ratio": EvidenceArray(
            -least, "1", "minus the least ln-step of the peak from one acceleration to the next: varpi, psi"
        ),
        "region": EvidenceArray(least > 0, "1", "where the claim holds: varpi, psi"),
        "without": EvidenceArray(without, "m", "peak without disturbance, by acceleration"),
    }
    here = Plane(setting, np.array([setting.angular_frequency]), np.array([setting.phase]))
    ours = np.array([here.peaks(acceleration=value)[0] for value in a])
    judgement = judged(least > 0, here=np.diff(ours, axis=0) > 0)
    plain = by_outcome(
        judgement,
        "The peak grows with the acceleration, whatever the disturbance.",
        "The peak grows with the acceleration unless the disturbance works against it.",
        "With the disturbance the peak never grows from each acceleration to the next.",
    )
    law = "proportional to the acceleration, by superposition" if scales < 1e-9 else "not proportional to it"
    where = (
        f"; it fails for some phase between {number(fails.min())} and {number(fails.max())} rad/s" if fails.size else ""
    )
    sentence = (
        f"Without disturbance the peak is {law} ({listed(without, mm)} mm). With it the peak grows from each "
        f"acceleration to the next in {percent((least > 0).mean())} of the plane of frequency and "
        f"phase{where}."
    )
    criterion = (
        "with the disturbance the largest $|v(L,t)|$ grows with each step of the mean acceleration, over every phase "
        "and frequencies up to twice the first natural one; no threshold"
    )
    return Finding(judgement, plain, sentence, evidence, criterion)


@pictured("C12")
def draw_amplitude_grows_with_acceleration(verdict: Verdict, ax: Axes) -> None:
    """Draw C12."""
    plane_picture(verdict, ax, "peak grows with $a$")


@claimed(
    "C13",
    "responses",
    "Section 5.1, Fig. 10",
    "error grows with acceleration",
    "with the increasing of the motion accelerations, the error aroused by the motion disturbance increases",
)
def error_grows_with_acceleration(setting: Setting) -> Finding:
    """Judge C13."""
    plane, a = Plane.of(setting), np.array(setting.accelerations)

    def error(acceleration: float, scale: float = 1.0) -> np.ndarray:
        mean, shaken = {"acceleration": acceleration}, {"amplitude": scale * setting.amplitude}
        with_disturbance = tip(setting, setting.arm, setting.disturbance | shaken | mean)
        return np.asarray(with_disturbance - tip(setting, setting.arm, mean))

    errors = np.stack([error(value) for value in a])
    gap = float(peak(errors - errors[0]).max() / peak(errors[0]))
    signed = np.stack([with_ - without for with_, without in (plane.peaks(acceleration=value) for value in a)])
    scale = np.abs(signed).max()
    grows = np.diff(signed, axis=0) > 1e-9 * scale
    magnitude = (np.diff(np.abs(signed), axis=0) > 1e-9 * scale).all(axis=0)
    pointwise = np.diff(peak(errors)) > 1e-9 * peak(errors[0])
    evidence = {
        "accelerations": EvidenceArray(a, "m/s2", "mean accelerations"),
        "times": EvidenceArray(setting.times, "s", "time"),
        "errors": EvidenceArray(errors, "m", "v(L, t) with minus without the disturbance: acceleration, time"),
        **plane.axes,
        "error_of_peaks": EvidenceArray(signed, "m", "peak with minus peak without: acceleration, varpi, psi"),
        "grows": EvidenceArray(grows, "1", "whether that grows to the next acceleration"),
        "share_of_magnitudes": EvidenceArray(magnitude.mean(), "1", "share of the plane where its magnitude grows"),
    }
    # the claim can be read instant by instant or for peaks: it stands if either reading does
    judgement = judged(pointwise) if pointwise.any() else judged(grows)
    plain = by_outcome(
        judgement,
        "What the disturbance adds grows with the acceleration.",
        "What the disturbance adds grows with the acceleration in some cases only.",
        "What the disturbance adds does not grow with the acceleration, at any instant or in the peak.",
    )
    superposed = "the same for every acceleration" if gap < 1e-9 else f"different by up to {percent(gap)}"
    steps = "never grows" if not grows.any() else f"grows in {percent(grows.mean())} of the steps"
    reason = (
        r" ($\max|a r + d| - a \max|r|$ cannot, by the triangle inequality); only where it is negative does its "
        "magnitude grow,"
        if judgement.outcome == "contradicted"
        else "; its magnitude grows"
    )
    sentence = (
        f"Instant by instant the error is {superposed}. The difference of the peaks {steps}{reason} in "
        f"{percent(magnitude.mean())} of the plane of frequency and phase."
    )
    remedy = None
    scaled = np.diff([float(peak(error(value, value / a[0]))) for value in a])
    if judgement.outcome == "contradicted" and (scaled > 0).all():
        remedy = "a disturbance whose amplitude grows with the acceleration it rides on, $B$ proportional to $a$"
    criterion = (
        "what the disturbance adds grows with each step of the mean acceleration by over $10^{-9}$ of itself, instant "
        "by instant or, if it does so nowhere, as the difference of the peaks with and without disturbance"
    )
    return Finding(judgement, plain, sentence, evidence, criterion, remedy)


@pictured("C13")
def draw_error_grows_with_acceleration(verdict: Verdict, ax: Axes) -> None:
    """Draw C13."""
    t = verdict["times"]
    for k, (a, error) in enumerate(zip(verdict["accelerations"], verdict["errors"], strict=True)):
        ax.plot(t, 1e3 * error, color=PALETTE[k], ls=STYLES[k], lw=4.0 - 1.3 * k, label=f"$a$ = {a:g} m/s$^2$")
    ax.set(xlabel="time $t$ / s", ylabel="$v(L,t)$ with $-$ without / mm", xlim=(t[0], t[-1]))
    low, high = ax.get_ylim()
    ax.set_ylim(low, high + 0.25 * (high - low))
    ax.legend(fontsize=8, loc="upper center", ncols=3, columnspacing=1.0, handlelength=2.2)
