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
from cra_sym.claims.verdict import Finding, Quantity, Verdict, outcome
from cra_sym.claims.words import listed, mm, number, percent, span

if TYPE_CHECKING:
    from matplotlib.axes import Axes


def _softened(setting: Setting, mean: dict[str, float], head: str) -> Finding:
    """Judge whether peaks on elastic joints are smaller than on the rigid one; the sentence begins with ``head``."""
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
        "varpi": Quantity(varpi, "rad/s", "frequency of the disturbance"),
        "k_t": Quantity(k_t, "N/m", "translational stiffness"),
        "log_ratio": Quantity(ratios[0].T, "1", "ln of the peak of v(L, t), elastic over rigid: varpi, k_t"),
        "log_ratio_relative": Quantity(ratios[1].T, "1", "the same for v(L, t) - v(0, t), the joint's give left out"),
        "nominal": Quantity(nominal, "m", "peak at the nominal disturbance: elastic, rigid"),
        "first_frequency": Quantity(first, "rad/s", "first natural frequency: elastic, rigid"),
        "region": Quantity(region, "1", "where the elastic joint's peak is visibly smaller: varpi, k_t"),
        "smaller": Quantity(smaller, "1", "the same at the soft k_t of Figs. 7 and 8, by fine_varpi"),
        "fine_varpi": Quantity(fine, "rad/s", "frequency of the disturbance"),
    }
    sentence = (
        f"{head} with k_t = {number(setting.soft_k_t)} N/m v(L, t) is smaller than on the rigid joint, by over "
        f"{percent(setting.visible)}, for varpi of "
        f"{span(fine, smaller, 'rad/s')}; at {number(setting.angular_frequency)} rad/s it is {mm(nominal[0])} mm "
        "against "
        f"{mm(nominal[1])} mm. The spring lowers omega_1 from {number(first[1])} to {number(first[0])} rad/s: "
        f"towards a disturbance below it (smaller at {percent(smaller[fine < first[0]].mean())} of these frequencies) "
        f"and away from one above ({percent(smaller[fine > first[1]].mean())}; well above, how the beats fall into "
        f"{number(setting.duration)} s decides). For k_t of {number(k_t[0])} to {number(k_t[-1])} N/m the claim "
        "holds in "
        f"{percent(region.mean())} of the plane, measured as v(L) - v(0) in "
        f"{percent(region_relative.mean())}."
    )
    criterion = (
        f"the largest |v(L, t)| is smaller than on the rigid joint by over {percent(setting.visible)}, for k_t of "
        f"{number(k_t[0])} to {number(k_t[-1])} N/m and frequencies up to twice the first natural one"
    )
    return Finding(outcome(region), sentence, evidence, criterion)


@claimed(
    "C10",
    "responses",
    "Section 5.1, Fig. 7",
    "smaller on an elastic joint",
    "the vibration response amplitude of the end-effector with [finite tensional stiffness] is smaller than that of "
    "rigid "
    "restraint",
)
def _(setting: Setting) -> Finding:
    acceleration = setting.accelerations[0]
    head = f"Under {number(acceleration)} m/s2 and the disturbance,"
    return _softened(setting, {"acceleration": acceleration}, head)


@claimed(
    "C11",
    "responses",
    "Section 5.1, Fig. 8",
    "$k_t$ suppresses the disturbance",
    "the error of [finite tensional stiffness] is smaller than fixed restraint. This indicates that tensional "
    "stiffness has "
    "a suppressing effect on the motion disturbance",
)
def _(setting: Setting) -> Finding:
    return _softened(setting, {}, "The error is the response to the disturbance alone, by superposition:")


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
def _(verdict: Verdict, ax: Axes) -> None:
    _softened_picture(verdict, ax, "smaller than rigid")


@pictured("C11")
def _(verdict: Verdict, ax: Axes) -> None:
    _softened_picture(verdict, ax, "error smaller")


@claimed(
    "C12",
    "responses",
    "Section 5.1, Fig. 9",
    "amplitude grows with acceleration",
    "the vibration response amplitudes increase with the motion accelerations",
)
def _(setting: Setting) -> Finding:
    plane, a = Plane.of(setting), np.array(setting.accelerations)
    pairs = [plane.peaks(acceleration=value) for value in a]
    found, without = np.stack([with_ for with_, _ in pairs]), np.array([bare for _, bare in pairs])
    least = np.log(found[1:] / found[:-1]).min(axis=0)
    scales = np.abs(without / without[0] - a / a[0]).max()
    fails = plane.varpi[(least <= 0).any(axis=1)]
    evidence = {
        **plane.axes,
        "log_ratio": Quantity(
            -least, "1", "minus the least ln-step of the peak from one acceleration to the next: varpi, psi"
        ),
        "region": Quantity(least > 0, "1", "where the claim holds: varpi, psi"),
        "without": Quantity(without, "m", "peak without disturbance, by acceleration"),
    }
    theorem = (
        "the peak is proportional to the acceleration, a theorem" if scales < 1e-9 else "it is not quite proportional"
    )
    where = (
        f"; it fails for some phase between {number(fails.min())} and {number(fails.max())} rad/s" if fails.size else ""
    )
    sentence = (
        f"Without disturbance {theorem} of linear theory ({listed(without, mm)} mm). With it the peak grows from each "
        f"acceleration to the next in {percent((least > 0).mean())} of the plane of frequency and phase{where}."
    )
    criterion = (
        "with the disturbance the largest |v(L, t)| grows with each step of the mean acceleration, over every phase "
        "and frequencies up to twice the first natural one; no threshold"
    )
    return Finding(outcome(least > 0), sentence, evidence, criterion)


@pictured("C12")
def _(verdict: Verdict, ax: Axes) -> None:
    plane_picture(verdict, ax, "peak grows with $a$")


@claimed(
    "C13",
    "responses",
    "Section 5.1, Fig. 10",
    "error grows with acceleration",
    "with the increasing of the motion accelerations, the error aroused by the motion disturbance increases",
)
def _(setting: Setting) -> Finding:
    plane, a = Plane.of(setting), np.array(setting.accelerations)

    def error(acceleration: float, scale: float = 1.0) -> np.ndarray:
        mean, shaken = {"acceleration": acceleration}, {"amplitude": scale * setting.amplitude}
        with_disturbance = tip(setting, setting.arm, setting.disturbance | shaken | mean)
        return with_disturbance - tip(setting, setting.arm, mean)

    errors = np.stack([error(value) for value in a])
    gap = float(peak(errors - errors[0]).max() / peak(errors[0]))
    signed = np.stack([with_ - without for with_, without in (plane.peaks(acceleration=value) for value in a)])
    scale = np.abs(signed).max()
    grows = np.diff(signed, axis=0) > 1e-9 * scale
    magnitude = (np.diff(np.abs(signed), axis=0) > 1e-9 * scale).all(axis=0)
    pointwise = np.diff(peak(errors)) > 1e-9 * peak(errors[0])
    evidence = {
        "accelerations": Quantity(a, "m/s2", "mean accelerations"),
        "times": Quantity(setting.times, "s", "time"),
        "errors": Quantity(errors, "m", "v(L, t) with minus without the disturbance: acceleration, time"),
        **plane.axes,
        "error_of_peaks": Quantity(signed, "m", "peak with minus peak without: acceleration, varpi, psi"),
        "grows": Quantity(grows, "1", "whether that grows to the next acceleration"),
        "share_of_magnitudes": Quantity(magnitude.mean(), "1", "share of the plane where its magnitude grows"),
    }
    # the claim can be read instant by instant or for peaks: it stands if either reading does
    verdict = outcome(pointwise) if pointwise.any() else outcome(grows)
    superposed = "the same for every acceleration" if gap < 1e-9 else f"different by up to {percent(gap)}"
    steps = "never grows" if not grows.any() else f"grows in {percent(grows.mean())} of the steps"
    sentence = (
        f"Instant by instant the error is {superposed}: the response is a sum of what each motion causes. The "
        "difference of "
        f"the peaks {steps} with a (max|a r + d| - a max|r| cannot, by the triangle inequality); only where it is "
        "negative does "
        f"its magnitude grow, in {percent(magnitude.mean())} of the plane of frequency and phase."
    )
    remedy = None
    scaled = np.diff([float(peak(error(value, value / a[0]))) for value in a])
    if verdict == "contradicted" and (scaled > 0).all():
        remedy = "a disturbance whose amplitude grows with the acceleration it rides on, B proportional to a"
    criterion = (
        "what the disturbance adds grows with each step of the mean acceleration by over 1e-9 of itself, instant by "
        "instant or, if it does so nowhere, as the difference of the peaks with and without disturbance"
    )
    return Finding(verdict, sentence, evidence, criterion, remedy)


@pictured("C13")
def _(verdict: Verdict, ax: Axes) -> None:
    t = verdict["times"]
    for k, (a, error) in enumerate(zip(verdict["accelerations"], verdict["errors"], strict=True)):
        ax.plot(t, 1e3 * error, color=PALETTE[k], ls=STYLES[k], lw=4.0 - 1.3 * k, label=f"$a$ = {a:g} m/s$^2$")
    ax.set(xlabel="time $t$ / s", ylabel="$v(L,t)$ with $-$ without / mm", xlim=(t[0], t[-1]))
    low, high = ax.get_ylim()
    ax.set_ylim(low, high + 0.25 * (high - low))
    ax.legend(fontsize=8, loc="upper center", ncols=3, columnspacing=1.0, handlelength=2.2)
