"""Claims on natural frequencies and their causes: C01 to C04."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from cra_sym.analysis.modal_parameters import modal_parameters
from cra_sym.analysis.modes import natural_frequencies
from cra_sym.arm.frequency_parameters import frequency_parameters
from cra_sym.claims.family import common_scale
from cra_sym.claims.pictures import PALETTE, STYLES, by_mode, note, stiffness_axis
from cra_sym.claims.registry import claimed, pictured
from cra_sym.claims.setting import Setting
from cra_sym.claims.verdict import EvidenceArray, Finding, Verdict, judged
from cra_sym.claims.words import by_outcome, listed, number, percent, span
from cra_sym.paper.flipped import flipped_frequencies

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_NEAR_ONE = 0.05  # a power fitted to computed numbers


@claimed(
    "C01",
    "modes",
    "Section 4",
    "the rigid joint's frequencies",
    "for the ideal fixed restraint, the natural frequencies of the flexible manipulator can be calculated as 2.448 Hz, "
    "15.339 Hz, and 42.950 Hz",
)
def rigid_joint_frequencies(setting: Setting) -> Finding:
    """Judge C01."""
    published = np.array(setting.frequencies)
    bare = setting.rigid.replace(m_e=0.0, J_e=0.0)
    found = natural_frequencies(bare, modes=published.size)
    low, high, offered = common_scale(published)
    scale = float(bare.angular_frequency_scale)
    evidence = {
        "published": EvidenceArray(published, "Hz", "printed frequencies, rounded to 1 mHz, by mode"),
        "computed": EvidenceArray(found, "Hz", "of the arm without end-effector on a rigid joint, by mode"),
        "scale": EvidenceArray(scale, "rad/s", "sqrt(EI / rho A) / L^2 of this arm"),
        "scale_allowed": EvidenceArray(np.array([low, high]), "rad/s", "interval all printed frequencies agree with"),
        "scale_by_mode": EvidenceArray(offered, "rad/s", "interval of each printed frequency: mode, (low, high)"),
    }
    judgement = judged([np.all(np.abs(found - published) <= 0.0005)])
    criterion = "the printed frequencies, to within 0.0005 Hz, are those of this arm on an ideal rigid joint"
    ours = listed(found, lambda f: f"{f:.3f}")
    ratio = r"$\sqrt{EI/\rho A}/L^2$"
    if low > high:
        plain = "No clamped uniform beam has the printed frequencies, so this arm has not."
        sentence = (
            f"Mode by mode they ask for different values of {ratio}, from {number(offered.max(), 6)} down to "
            f"{number(offered.min(), 6)} rad/s; this arm has {ours} Hz."
        )
        return Finding(judgement, plain, sentence, evidence, criterion)
    same = f"{ratio} between {number(low, 6)} and {number(high, 6)} rad/s"
    if judgement.outcome == "holds":
        plain = "The printed frequencies are those of our arm on a rigid joint, to every digit."
        sentence = (
            f"{ours} Hz come out. A clamped uniform beam has these three numbers whatever it is made of, if it has "
            f"{same}: that one number is all they tell."
        )
        return Finding(judgement, plain, sentence, evidence, criterion)
    plain = "The printed frequencies are those of a clamped uniform beam, but not of this arm."
    sentence = f"This arm has {ratio} = {number(scale, 6)} rad/s and {ours} Hz."
    return Finding(judgement, plain, sentence, evidence, criterion, remedy=f"an arm with {same}")


@pictured("C01")
def draw_rigid_joint_frequencies(verdict: Verdict, ax: Axes) -> None:
    """Draw C01."""
    centre = verdict["scale_allowed"].mean()
    for mode, (low, high) in enumerate(verdict["scale_by_mode"], 1):
        ax.plot([1e6 * (low / centre - 1), 1e6 * (high / centre - 1)], [mode, mode], "-", color=PALETTE[mode - 1], lw=5)
        ax.annotate(f"{verdict['published'][mode - 1]:.3f} Hz", (0, mode), xytext=(20, 7), textcoords="offset points",
                    fontsize=8.5)  # fmt: skip
    ax.axvspan(*(1e6 * (verdict["scale_allowed"] / centre - 1)), color="0.88", lw=0)
    offset = 1e6 * (float(verdict["scale"]) / centre - 1)
    if abs(offset) < 500:
        ax.axvline(offset, color="0.2", lw=1, ls="-")
    ax.set_yticks([1, 2, 3], ["$f_1$", "$f_2$", "$f_3$"])
    ax.set_ylim(3.6, 0.3)
    ax.set_xlabel(f"$\\sqrt{{EI/\\rho A}}/L^2$: parts per million from {centre:.5f} rad/s")
    note(ax, "bars: what each printed digit allows; line: this arm", "lower left")


@claimed(
    "C02",
    "modes",
    "Section 4, Fig. 3",
    "$f_1$ to $f_3$ fall with $k_t$",
    "with the decreasing of tensional restraint stiffness, the first three natural frequencies obviously decrease and "
    "are small compared to the ideal fixed restraint",
)
def fall_with_k_t(setting: Setting) -> Finding:
    """Judge C02."""
    k_t = np.logspace(6, 0, 61)
    k_r = np.array([np.inf, *setting.k_r])
    masses = np.array(setting.masses)
    grid = setting.arm.replace(k_t=k_t, k_r=k_r[:, None], m_e=masses[:, None, None])
    found = natural_frequencies(grid)
    ideal = natural_frequencies(grid.replace(k_t=np.inf, k_r=np.inf))
    falls, below = np.diff(found, axis=-2) < 0, found < ideal
    slope = modal_parameters(grid).root_displacement ** 2  # d omega^2 / d k_t
    own = natural_frequencies(setting.arm.replace(k_t=k_t))
    fixed = natural_frequencies(setting.rigid)
    soft = natural_frequencies(setting.arm.replace(k_t=setting.soft_k_t)) / fixed
    evidence = {
        "k_t": EvidenceArray(k_t, "N/m", "stiffness, stiff to soft"),
        "frequency": EvidenceArray(own, "Hz", "of this arm: k_t, mode"),
        "rigid_frequency": EvidenceArray(fixed, "Hz", "on the rigid joint, by mode"),
        "falls": EvidenceArray(falls, "1", "whether the next softer k_t lowers it: end-effector, k_r, k_t, mode"),
        "slope": EvidenceArray(slope, "kg^-1", "d omega^2 / d k_t = phi(0)^2: end-effector, k_r, k_t, mode"),
    }
    series = natural_frequencies(setting.arm.replace(k_t=np.array(setting.k_t)))
    judgement = judged(falls, below, here=np.diff(series, axis=0) < 0)
    reach = f"{number(k_t[0])} to {number(k_t[-1])} N/m"
    if judgement.outcome == "holds":
        plain = "A softer $k_t$ lowers every natural frequency: it cannot do otherwise."
        sentence = (
            f"All three fall at every step from {reach}, for {masses.size} end-effectors and {k_r.size} rotational "
            f"stiffnesses; at {number(setting.soft_k_t)} N/m they are {listed(soft, percent)} of the rigid joint's. "
            r"It is a theorem: $d(\omega_i^2)/dk_t = \phi_i(0)^2$."
        )
    else:
        plain = "A softer $k_t$ does not lower every natural frequency."
        sentence = (
            f"In {percent(falls.mean())} of the steps from {reach} a softer joint lowers a frequency, in the others it "
            "does not."
        )
    criterion = (
        f"each softer $k_t$ from {number(k_t[0])} to {number(k_t[-1])} N/m has the lower frequency, below that of the "
        "ideal fixed joint, for every end-effector and $k_r$; no threshold"
    )
    return Finding(judgement, plain, sentence, evidence, criterion)


@pictured("C02")
def draw_fall_with_k_t(verdict: Verdict, ax: Axes) -> None:
    """Draw C02."""
    ax.axhline(1.0, color="0.45", lw=0.9, ls=(0, (4, 2)))
    by_mode(ax, verdict["k_t"], verdict["frequency"] / verdict["rigid_frequency"])
    stiffness_axis(ax, "k_t")
    ax.set_ylabel("frequency / that of the rigid joint")


def _fig_4(found: np.ndarray, rigid: np.ndarray, visible: float) -> tuple[np.ndarray, np.ndarray]:
    """Return where along k_r f1 looks unchanged, and where f2 and f3 visibly rise, on a common axis in hertz."""
    axis = max(found.max(), rigid.max())
    change = (found - rigid) / axis
    return np.abs(change[:, 0]) <= visible, np.all(change[:, 1:] > visible, axis=-1)


@claimed(
    "C03",
    "modes",
    "Section 4, Fig. 4",
    "$f_1$ flat, $f_2$ and $f_3$ rise as $k_r$ falls",
    "with torsional restraint stiffness decrease, the first natural frequency presents no change, while the second and "
    "third natural frequencies obviously increase",
)
def flat_and_rising_with_k_r(setting: Setting) -> Finding:
    """Judge C03."""
    k_r = np.logspace(5, np.log10(min(setting.k_r)), 121)
    arm = setting.arm.replace(k_r=k_r)
    found, fixed = natural_frequencies(arm), natural_frequencies(setting.arm.replace(k_r=np.inf))
    flipped = flipped_frequencies(arm)
    flat, rises = _fig_4(found, fixed, setting.visible)
    flat_flipped, rises_flipped = _fig_4(flipped, fixed, setting.visible)
    as_printed = flat_flipped & rises_flipped
    evidence = {
        "k_r": EvidenceArray(k_r, "N m/rad", "stiffness, stiff to soft"),
        "frequency": EvidenceArray(found, "Hz", "derived: k_r, mode"),
        "flipped_frequency": EvidenceArray(flipped, "Hz", "with the spring's sign flipped: k_r, mode"),
        "rigid_frequency": EvidenceArray(fixed, "Hz", "for infinite k_r, by mode"),
        "region": EvidenceArray(flat & rises, "1", "where Fig. 4 would look as the paper says, by k_r"),
        "flipped_region": EvidenceArray(as_printed, "1", "the same with the sign flipped, by k_r"),
    }
    series = natural_frequencies(setting.arm.replace(k_r=np.array(setting.k_r)))
    judgement = judged(flat & rises, here=np.logical_and(*_fig_4(series, fixed, setting.visible)))
    last, change = found[-1] / fixed - 1, np.diff(found, axis=0)
    if judgement.outcome == "contradicted" and np.all(change < 0):
        near = (1 - found[0] / fixed) * float(np.max(arm.kappa_r))
        equal = np.ptp(near) < setting.visible * near.max()
        alike = rf"same fraction ${number(near[0], 1)}/\kappa_r$"
        share = alike if equal else rf"fractions {listed(near)} over $\kappa_r$"
        plain = "A softer $k_r$ lowers all three frequencies, and raises none."
        sentence = (
            f"They fall by {listed(-last, percent)} at {number(k_r[-1])} N m/rad, near the rigid joint by the {share}"
            r". A softer spring cannot raise a frequency: $d(\omega_i^2)/dk_r = \phi_i'(0)^2$."
        )
    else:
        plain = by_outcome(
            judgement,
            "A softer $k_r$ raises $f_2$ and $f_3$, and $f_1$ looks flat.",
            "For some $k_r$ the picture is as the paper draws it, for others it is not.",
            "Nowhere along $k_r$ is $f_1$ flat while $f_2$ and $f_3$ rise.",
        )
        sentence = (
            f"On an axis in hertz $f_1$ stays within {percent(setting.visible)} while $f_2$ and $f_3$ rise for $k_r$ "
            f"of {span(k_r, flat & rises, 'N m/rad')}; at {number(k_r[-1])} N m/rad they change by "
            f"{listed(last, percent)}."
        )
    remedy = None
    if as_printed.any() and not (flat & rises).any():
        rise = flipped[-1] / fixed - 1
        remedy = (
            f"the sign of the rotational spring, $EI v_{{xx}}(0) = -k_r v_x(0)$: all three rise, by "
            f"{listed(rise, percent)}, and for $k_r$ of {span(k_r, as_printed, 'N m/rad')} $f_1$ moves by less than "
            f"{percent(setting.visible)} of an axis in hertz that shows $f_3$, so that it looks flat. Such a joint "
            f"{_energy_of_a_tilt()}"
        )
    criterion = (
        f"on one axis in hertz that reaches $f_3$, $f_1$ moves by at most {percent(setting.visible)} of it, and $f_2$ "
        f"and $f_3$ rise by more, for $k_r$ of {number(k_r[-1])} to {number(k_r[0])} N m/rad"
    )
    return Finding(judgement, plain, sentence, evidence, criterion, remedy)


def _energy_of_a_tilt() -> str:
    """Return a sentence on the energy of the flipped joint when the straight arm is turned by one radian."""
    from sympy import latex

    from cra_sym.arm.lagrangian import paper_lagrangian
    from cra_sym.paper.energy import k_r, v, w, x
    from cra_sym.paper.evaluation import at, put

    _, left, _ = paper_lagrangian()
    flipped = 2 * left.coeff(k_r) * k_r - left
    energy = at(put(flipped, {v: x, w: x * 0}), 0).doit()
    folds = ": it would fold by itself" if energy.is_nonpositive else ""
    return f"has the potential energy ${latex(energy, fold_short_frac=True)}$ when turned by 1 rad{folds}"


@pictured("C03")
def draw_flat_and_rising_with_k_r(verdict: Verdict, ax: Axes) -> None:
    """Draw C03."""
    rigid = verdict["rigid_frequency"]
    by_mode(ax, verdict["k_r"], verdict["frequency"] / rigid)
    for mode in range(rigid.size):
        ax.plot(verdict["k_r"], verdict["flipped_frequency"][:, mode] / rigid[mode], color=PALETTE[mode],
                ls=STYLES[mode], lw=0.9)  # fmt: skip
    ax.axhline(1.0, color="0.45", lw=0.9, ls=(0, (4, 2)))
    stiffness_axis(ax, "k_r")
    ax.set_ylabel("frequency / that of the rigid joint")
    note(ax, "thin: spring's sign flipped", "upper right")


@claimed(
    "C04",
    "modes",
    "Section 4, (27)-(29)",
    "infinite stiffness is the rigid joint",
    "the mode shape equation and frequency equation ... consistent with the ideal rigid assumption ... the proposed "
    "elastic restraint model can provide a whole restraint of the bolted joints",
)
def limit_of_infinite_stiffness(setting: Setting) -> Finding:
    """Judge C04."""
    from sympy import cos, cosh

    from cra_sym.paper.equations import equation
    from cra_sym.symbols import symbol

    lamda = symbol("lamda")
    limits = np.array([equation(number).check() for number in (27, 28, 29)])
    ratio = equation(29).expression.lhs / (1 + cos(lamda) * cosh(lamda))
    textbook = bool(ratio.cancel().diff(lamda).equals(0))
    kappa = np.logspace(2, 8, 25)
    mu, iota = float(setting.arm.mu), float(setting.arm.iota)
    fixed = frequency_parameters(np.inf, np.inf, mu, iota) ** 2
    gaps = np.stack(
        [
            1 - frequency_parameters(kappa, np.inf, mu, iota) ** 2 / fixed,
            1 - frequency_parameters(np.inf, kappa, mu, iota) ** 2 / fixed,
        ]
    )
    order = -np.diff(np.log(np.abs(gaps[..., -9:, :])), axis=1) / np.log(kappa[1] / kappa[0])
    reached = np.abs(order - 1) < _NEAR_ONE
    evidence = {
        "kappa": EvidenceArray(kappa, "1", "dimensionless stiffness of the one spring, the other one rigid"),
        "gap": EvidenceArray(
            gaps, "1", "shortfall of the frequency from the rigid joint's: spring (t, r), kappa, mode"
        ),
        "order": EvidenceArray(order, "1", "power of 1/kappa with which it vanishes: spring, kappa, mode"),
        "limits": EvidenceArray(limits, "1", "whether (27), (28), (29) pass their checks"),
        "textbook": EvidenceArray(textbook, "1", "whether (29) is 1 + cos(lambda) cosh(lambda) = 0"),
    }
    judgement = judged(limits, [textbook], reached)
    if judgement.outcome == "holds":
        plain = "With infinite stiffness the model becomes the ideal rigid joint, in its equations and in its numbers."
        sentence = (
            r"Symbolically: (23) divided by $\kappa_t \kappa_r$ has the finite limit (27), which without end-effector "
            r"is $1 + \cos\lambda \cosh\lambda = 0$. Numerically the frequencies approach the rigid joint's from below "
            rf"as $1/\kappa$, to {percent(gaps[..., -1, :].max())} at $\kappa$ = {number(kappa[-1])}."
        )
    else:
        plain = "The limit of infinite stiffness is not that of the ideal rigid joint in every respect."
        sentence = (
            f"Of the limits (27), (28), (29) {int(limits.sum())} are confirmed, (29) is "
            f"{'' if textbook else 'not '}the cantilever's equation, and {percent(reached.mean())} of the frequencies "
            r"approach the rigid joint's as $1/\kappa$."
        )
    criterion = (
        r"(27), (28) and (29) pass their checks, (29) is the cantilever's, and over the last decades of $\kappa$ the "
        rf"shortfall vanishes as a power of $1/\kappa$ within {number(_NEAR_ONE)} of 1"
    )
    return Finding(judgement, plain, sentence, evidence, criterion)


@pictured("C04")
def draw_limit_of_infinite_stiffness(verdict: Verdict, ax: Axes) -> None:
    """Draw C04."""
    for spring, (gap, style) in enumerate(zip(verdict["gap"], ("-", "--"), strict=True)):
        for mode in range(gap.shape[-1]):
            label = f"$f_{mode + 1}$" if spring == 0 else None
            ax.loglog(verdict["kappa"], np.abs(gap[:, mode]), ls=style, color=PALETTE[mode], label=label)
    ax.set_xlabel("$\\kappa_t$ (solid) or $\\kappa_r$ (dashed), the other infinite")
    ax.set_ylabel("shortfall from the rigid joint")
    ax.legend()
