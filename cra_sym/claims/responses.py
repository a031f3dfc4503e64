"""Claims on the effect of the disturbance on the response: C07-C09, C22 and C23."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from cra_sym.analysis.frequency_response import frequency_response
from cra_sym.claims.motions import Plane, peak, tip
from cra_sym.claims.pictures import PALETTE, note, region_map, stiffness_axis
from cra_sym.claims.registry import claimed, pictured
from cra_sym.claims.setting import Setting
from cra_sym.claims.verdict import EvidenceArray, Finding, Judgement, Verdict, judged
from cra_sym.claims.words import by_outcome, listed, mm, number, percent, span

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_PLANE = "every phase and frequencies up to twice the first natural one"
_SHARES = np.array([0.2, 0.5, 1.0, 2.0, 5.0])  # of the nominal amplitude


def _peak_claim(setting: Setting, lowers: bool, mean: dict[str, float], words: str) -> Finding:
    """Judge whether the disturbance lowers, or raises, the peak, over its frequency, phase, amplitude and the start."""
    sign = 1.0 if lowers else -1.0

    def held(plane: Plane, amplitude: float | None = None) -> np.ndarray:
        found, without = plane.peaks(amplitude, **mean)
        return sign * (found - without) < 0

    plane = Plane.of(setting)
    found, without = plane.peaks(**mean)
    region = held(plane)
    ratio = sign * np.log(found / without)
    shares = [held(plane, setting.amplitude * share).mean() for share in _SHARES]
    on_base = Plane.of(setting, start="base")
    found_base, without_base = on_base.peaks(**mean)
    in_phase, opposite = (Plane.line(setting, psi=psi) for psi in (setting.phase, np.pi))
    along_psi = Plane.line(setting, varpi=setting.angular_frequency)
    nominal, against = (
        float(Plane(setting, np.array([setting.angular_frequency]), np.array([psi])).peaks(**mean)[0][0, 0])
        for psi in (setting.phase, np.pi)
    )
    degrees = np.degrees(along_psi.psi)
    evidence = {
        **plane.axes,
        "peak_with": EvidenceArray(found, "m", "peak of |v(L, t)| with the disturbance: varpi, psi"),
        "peak_without": EvidenceArray(without, "m", "peak of |v(L, t)| without it"),
        "log_ratio": EvidenceArray(
            ratio, "1", "ln of the ratio of the peaks, negative where the claim holds: varpi, psi"
        ),
        "region": EvidenceArray(region, "1", "where the claim holds: varpi, psi"),
        "amplitude": EvidenceArray(setting.amplitude * _SHARES, "m", "amplitudes of the disturbance"),
        "share": EvidenceArray(shares, "1", "share of the plane where the claim holds, by amplitude"),
        "share_start_on_base": EvidenceArray(
            (sign * (found_base - without_base) < 0).mean(),
            "1",
            "the same if the arm starts at rest seen from the base",
        ),
        "peak_without_start_on_base": EvidenceArray(without_base, "m", "peak without disturbance for that start"),
    }
    judgement = judged(region, here=sign * (nominal - without) < 0)
    verb = "lowers" if lowers else "raises"
    plain = by_outcome(
        judgement,
        f"{words} the disturbance {verb} the peak, whatever its frequency and phase.",
        f"{words} it depends on the frequency and phase of the disturbance, which the text does not tell, whether the "
        f"peak is {'lower' if lowers else 'higher'}.",
        f"{words} no frequency and no phase of the disturbance {verb} the peak.",
    )
    sentence = (
        f"A disturbance of {mm(setting.amplitude)} mm {verb} the peak in {percent(region.mean())} of the plane of "
        rf"frequency and phase. At {number(setting.angular_frequency)} rad/s it does for $\psi$ of "
        f"{span(degrees, held(along_psi)[0], 'deg')}; "
        rf"at $\psi$ = {number(np.degrees(setting.phase))} deg for $\varpi$ of "
        f"{span(in_phase.varpi, held(in_phase)[:, 0], 'rad/s')}, at 180 deg for "
        f"{span(opposite.varpi, held(opposite)[:, 0], 'rad/s')}. "
        rf"Peaks at {number(setting.angular_frequency)} rad/s: {mm(nominal)} mm ($\psi$ = "
        f"{number(np.degrees(setting.phase))} deg) and {mm(against)} mm (180 deg) against {mm(without)} mm without."
    )
    if without_base < 1e-12 * without:
        sentence += (
            " If the arm already moves with the base at t = 0, a constant velocity alone makes no vibration at all."
        )
    criterion = (
        f"the largest $|v(L,t)|$ from 0 to {number(setting.duration)} s is {'smaller' if lowers else 'larger'} with "
        f"the disturbance than without, over {_PLANE}; no threshold"
    )
    return Finding(judgement, plain, sentence, evidence, criterion)


def plane_picture(verdict: Verdict, ax: Axes, label: str) -> None:
    """Draw where a claim holds over the disturbance's frequency and phase; the dot is the nominal disturbance."""
    setting = verdict.setting
    here = setting.angular_frequency, np.degrees(setting.phase) % 360
    remark = f"green: {label}\ndot: nominal disturbance"
    region_map(ax, verdict["varpi"], verdict["psi"], verdict["log_ratio"], ("varpi", "psi"), here)
    note(ax, remark, "upper right")
    ax.set_yticks(range(0, 361, 90))


@claimed(
    "C07",
    "responses",
    "Section 5.1, Fig. 6",
    "a lower peak at mean velocity",
    "for the system with average velocity, the vibration response amplitude with motion disturbance is smaller than "
    "the "
    "vibration response amplitude without motion disturbance",
)
def lower_peak_at_mean_velocity(setting: Setting) -> Finding:
    """Judge C07."""
    mean = {"velocity": setting.velocity}
    return _peak_claim(setting, True, mean, f"At a mean velocity of {number(setting.velocity)} m/s")


@claimed(
    "C08",
    "responses",
    "Section 5.1, Fig. 6",
    "a higher peak at mean acceleration",
    "for the flexible CRA system with average acceleration, the vibration response amplitude with motion disturbance "
    "is "
    "larger than the vibration response amplitude without motion disturbance",
)
def higher_peak_at_mean_acceleration(setting: Setting) -> Finding:
    """Judge C08."""
    mean = {"acceleration": setting.accelerations[0]}
    return _peak_claim(setting, False, mean, f"Under a mean acceleration of {number(setting.accelerations[0])} m/s²")


@pictured("C07")
def draw_lower_peak_at_mean_velocity(verdict: Verdict, ax: Axes) -> None:
    """Draw C07."""
    plane_picture(verdict, ax, "peak lowered")


@pictured("C08")
def draw_higher_peak_at_mean_acceleration(verdict: Verdict, ax: Axes) -> None:
    """Draw C08."""
    plane_picture(verdict, ax, "peak raised")


@claimed(
    "C09",
    "responses",
    "Section 5.1, Fig. 6",
    "more effect when accelerating",
    "the motion disturbance enhances the vibration of the end-effector especially for the accelerating operations",
)
def matters_more_when_accelerating(setting: Setting) -> Finding:
    """Judge C09."""
    plane = Plane.of(setting)
    means = [{"velocity": setting.velocity}, {"acceleration": setting.accelerations[0]}]
    ratios = [found / without for found, without in (plane.peaks(**mean) for mean in means)]
    ratio = np.log(ratios[0] / ratios[1])
    errors = [tip(setting, setting.arm, mean | setting.disturbance) - tip(setting, setting.arm, mean) for mean in means]
    gap = float(peak(errors[0] - errors[1]) / peak(errors[0]))
    here = Plane(setting, np.array([setting.angular_frequency]), np.array([setting.phase]))
    nominal = [float(found[0, 0] / without - 1) for found, without in (here.peaks(**mean) for mean in means)]
    evidence = {
        **plane.axes,
        "log_ratio": EvidenceArray(
            ratio, "1", "ln of the relative change of the peak, velocity over acceleration: varpi, psi"
        ),
        "region": EvidenceArray(ratio < 0, "1", "where the claim holds: varpi, psi"),
        "nominal": EvidenceArray(
            nominal, "1", "relative change of the peak at the nominal disturbance: velocity, acceleration"
        ),
        "absolute_gap": EvidenceArray(
            gap, "1", "largest difference of v with minus v without between the two, relative"
        ),
    }
    judgement = judged(ratio < 0, here=nominal[1] > nominal[0])
    plain = by_outcome(
        judgement,
        "As a share of the peak the disturbance matters more when accelerating, whatever its frequency and phase.",
        "As a share of the peak the disturbance matters more when accelerating for some frequencies and phases only.",
        "As a share of the peak the disturbance matters more when accelerating for no frequency and no phase.",
    )
    same = "the same at every instant, by superposition" if gap < 1e-9 else f"different by {percent(gap)}"
    sentence = (
        f"In millimetres what the disturbance adds to $v(L,t)$ in the two operations is {same}. As a share of the peak "
        f"it matters more when accelerating in {percent((ratio < 0).mean())} of the plane of frequency and phase; for "
        f"the nominal disturbance the peak changes by {listed(nominal, percent)} (velocity, acceleration)."
    )
    criterion = (
        "the peak with over the peak without disturbance is larger under the mean acceleration than at the mean "
        f"velocity, over {_PLANE}; no threshold"
    )
    return Finding(judgement, plain, sentence, evidence, criterion)


@pictured("C09")
def draw_matters_more_when_accelerating(verdict: Verdict, ax: Axes) -> None:
    """Draw C09."""
    plane_picture(verdict, ax, "changes more when accelerating")


@claimed(
    "C22",
    "responses",
    "Section 5.1, Fig. 6",
    "the four printed peaks",
    "amplitude with motion disturbance (... mm) is smaller than ... without (... mm); [under acceleration] with (... "
    "mm) is "
    "larger than ... without (... mm)",
)
def four_printed_peaks(setting: Setting) -> Finding:
    """Judge C22."""
    plane = Plane.of(setting)
    means = [{"velocity": setting.velocity}, {"acceleration": setting.accelerations[0]}]
    pairs = [plane.peaks(**mean) for mean in means]
    here = Plane(setting, np.array([setting.angular_frequency]), np.array([setting.phase]))
    computed = np.array(
        [value for mean in means for value in (float(here.peaks(**mean)[0][0, 0]), here.peaks(**mean)[1])]
    )
    reach = np.array([[with_.min(), with_.max()] for with_, _ in pairs])
    evidence = {
        "computed": EvidenceArray(
            computed, "m", "velocity with and without, acceleration with and without disturbance"
        ),
        "reach": EvidenceArray(
            reach, "m", "least and largest peak over frequency and phase: velocity and acceleration"
        ),
        "varpi": EvidenceArray(plane.varpi, "rad/s", "frequency of the disturbance"),
        "over_phase": EvidenceArray(
            [[with_.min(1), with_.max(1)] for with_, _ in pairs], "m", "mean motion, (least, largest over phase), varpi"
        ),
        "without": EvidenceArray(
            [without for _, without in pairs], "m", "peak without disturbance: velocity and acceleration"
        ),
    }
    criterion = f"the four peaks agree with those printed to {percent(setting.visible)}; without the print, no verdict"
    ours = f"With the values assumed here they are {listed(computed, mm)} mm"
    if setting.peaks is None:
        text = (
            f"{ours}; over frequency and phase of the disturbance alone the model can give {mm(reach[0, 0])} to "
            f"{mm(reach[0, 1])} mm for the mean velocity and {mm(reach[1, 0])} to {mm(reach[1, 1])} mm for the "
            "mean acceleration."
        )
        missing = (
            r"the four amplitudes in mm, the mean velocity and acceleration, and $B$, $\varpi$ and $\psi$ of the "
            "disturbance"
        )
        plain = "The four printed amplitudes are lost, and the model alone cannot tell them."
        return Finding(Judgement("undecidable"), plain, text, evidence, criterion, missing=missing)
    printed = np.array(setting.peaks)
    judgement = judged(np.abs(computed / printed - 1) < setting.visible)
    plain = by_outcome(
        judgement,
        "The model gives the four printed amplitudes.",
        "The model gives some of the four printed amplitudes, and others not.",
        "With the values assumed here the model gives none of the four printed amplitudes.",
    )
    text = f"{ours}, where the paper prints {listed(printed, mm)} mm."
    return Finding(judgement, plain, text, evidence, criterion)


@pictured("C22")
def draw_four_printed_peaks(verdict: Verdict, ax: Axes) -> None:
    """Draw C22."""
    for k, (band, without, name) in enumerate(
        zip(verdict["over_phase"], verdict["without"], ("mean velocity", "mean acceleration"), strict=True)
    ):
        ax.fill_between(verdict["varpi"], *(1e3 * band), color=PALETTE[k], alpha=0.3, lw=0, label=name)
        ax.axhline(1e3 * without, color=PALETTE[k], ls=("-", "--")[k], lw=1.2)
    ax.set(xlabel="disturbance frequency $\\varpi$ / (rad/s)", ylabel="peak of $|v(L,t)|$ / mm", ylim=(0, None))
    ax.set_xlim(verdict["varpi"][0], verdict["varpi"][-1])
    ax.legend(fontsize=8, loc="upper left")
    note(ax, "bands: any phase;\nlines: no disturbance", "upper right")


@claimed(
    "C23",
    "responses",
    "Section 5.1",
    "$k_t$ is the main factor in the dynamics",
    "the mode frequency is more sensitive to the tensional stiffness, which is the main factor that should be "
    "significantly "
    "considered in the dynamic analysis",
)
def main_factor(setting: Setting) -> Finding:
    """Judge C23."""
    k_t, k_r = np.logspace(1, 6, 81), np.logspace(0, 5, 81)

    def give(**joint: np.ndarray) -> np.ndarray:
        return -frequency_response(setting.rigid.replace(**joint), 0.0).real

    beam = float(give())
    by_t, by_r = give(k_t=k_t) - beam, give(k_r=k_r) - beam
    ratio = np.log(by_r / by_t[:, None])
    critical = float(by_t[-1] * k_t[-1] / (by_r[-1] * k_r[-1])) * float(setting.arm.L) ** 2
    series = np.array(setting.k_t)[:, None] * float(setting.arm.L) ** 2 / np.array(setting.k_r) < critical
    evidence = {
        "k_t": EvidenceArray(k_t, "N/m", "translational stiffness"),
        "k_r": EvidenceArray(k_r, "N m/rad", "rotational stiffness"),
        "log_ratio": EvidenceArray(ratio, "1", "ln of the tip's sag by k_r over that by k_t: k_t, k_r"),
        "region": EvidenceArray(ratio < 0, "1", "where k_t adds more: k_t, k_r"),
        "critical": EvidenceArray(critical, "1", "k_t L^2 / k_r below which k_t adds more"),
        "series": EvidenceArray(series, "1", "the claim at the stiffnesses of Fig. 5: k_t, k_r"),
    }
    judgement = judged(ratio < 0, here=series)
    plain = by_outcome(
        judgement,
        "The translational spring adds most to the deflection of the tip, on every joint.",
        "Which of the two springs adds most to the deflection of the tip depends on the joint.",
        "The translational spring adds most to the deflection of the tip on no joint.",
    )
    sentence = (
        "Under a steady acceleration of the base $k_t$ adds more than $k_r$ to the sag of the tip where $k_t L^2/k_r$ "
        f"is below {number(critical)}: at {series.sum()} of the {series.size} pairs of Fig. 5."
    )
    criterion = (
        "$k_t$ adds more than $k_r$ to the tip's deflection under a steady acceleration of the base, for $k_t$ of "
        f"{number(k_t[0])} to {number(k_t[-1])} N/m and $k_r$ of {number(k_r[0])} to {number(k_r[-1])} N m/rad; no "
        "threshold"
    )
    return Finding(judgement, plain, sentence, evidence, criterion)


@pictured("C23")
def draw_main_factor(verdict: Verdict, ax: Axes) -> None:
    """Draw C23."""
    x, y = verdict["k_t"], verdict["k_r"]
    ax.set(xscale="log", yscale="log")
    region_map(ax, x, y, verdict["log_ratio"], ("k_t", "k_r"))
    note(ax, "green: $k_t$ adds more sag\ndots: stiffnesses of Fig. 5", "lower right")
    ax.plot(*np.meshgrid(verdict.setting.k_t, verdict.setting.k_r), "o", color="0.2", ms=3, ls="")
    stiffness_axis(ax, "k_t")
    ax.set_xlim(x[0], x[-1])
    ax.set_ylim(y[0], y[-1])
