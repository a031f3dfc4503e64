"""Claims on the causes and frequencies of parametric instability: C14, C15 and C19."""

from __future__ import annotations

import warnings
from typing import TYPE_CHECKING, Any

import numpy as np

from cra_sym.analysis.floquet import growth_rate
from cra_sym.analysis.modal_parameters import modal_parameters
from cra_sym.analysis.stability import AsymptoticWarning, judged_boundary
from cra_sym.arm.excitations import JointStiffness
from cra_sym.claims.motions import tip
from cra_sym.claims.pictures import PALETTE, STYLES, note
from cra_sym.claims.registry import claimed, pictured
from cra_sym.claims.setting import Setting
from cra_sym.claims.verdict import EvidenceArray, Finding, Verdict, judged
from cra_sym.claims.words import by_outcome, listed, number, percent
from cra_sym.model.excitations import AxialBase

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from cra_sym.arm.parameters import Arm

KINDS = ("transverse base", "joint stiffness", "axial base")
_WORDS = {
    "joint stiffness": r"a joint whose stiffness fluctuates, $k_t (1 + \epsilon \cos\varpi t)$",
    "axial base": r"the same disturbance along the arm, $u = \epsilon u_0 \cos\varpi t$",
}


_NO_GROWTH = 1e-9  # 1/s: rates below this are rounding


def zone(arm: Arm, excitation: Any, epsilon: Any, resonance: tuple[int, int], **options: Any) -> tuple[Any, Any]:
    """Return a stability boundary wherever its expansion is formally defined, as in the paper."""
    lower, upper, doubts = judged_boundary(arm, excitation, epsilon, resonance, **options)
    for kind, text in doubts:
        if kind is not AsymptoticWarning:
            warnings.warn(text, kind, stacklevel=2)
    return lower, upper


def _terms(kind: str) -> tuple[bool, bool]:
    """Return whether an excited arm's equations have time-dependent coefficients, and whether they force it at rest."""
    from sympy import Function, Symbol

    from cra_sym.paper.evaluation import put
    from cra_sym.paper.parametric import AXIAL, TRANSVERSE, excited_motion
    from cra_sym.symbols import t, u, v, w, x

    motion = excited_motion(kind)
    size, shape = Symbol("size"), Function("shape")(x)
    parametric = forced = False
    for equation in (*motion.field_equations, *motion.boundary_conditions):
        residual = put(equation.lhs - equation.rhs, {v: size * shape, u: AXIAL, w: TRANSVERSE}).doit()
        parametric |= residual.diff(size).expand().has(t)
        forced |= residual.subs(size, 0).doit().has(t)
    return parametric, forced


@claimed(
    "C14",
    "stability",
    "Section 5.2, (35) and (36)",
    "a shaken base is a parametric system",
    "Substituting (35) into (11) yields [(36)]. Equation (36) defines a parametric vibration system, in which "
    "instability "
    "may occur under suitable conditions",
)
def shaken_base_is_parametric(setting: Setting) -> Finding:
    """Judge C14."""
    found = {kind: _terms(kind) for kind in KINDS}
    arm = setting.arm.replace(k_t=setting.soft_k_t)
    omega = float(modal_parameters(arm, 2).omega[1])
    rate = float(growth_rate(arm, JointStiffness(), 2 * omega, setting.epsilon, residual=True))
    long = Setting.of(arm, duration=float(np.clip(10 / max(rate, 0.1), 5.0, 40.0)), modes=3)
    base = {"amplitude": setting.epsilon * setting.amplitude}
    swings = [tip(long, arm, base | {"angular_frequency": k * omega}) for k in (1, 2)]
    envelope = np.maximum.accumulate(np.abs(swings), axis=-1)
    parametric, forced = (np.array([found[kind][k] for kind in KINDS]) for k in (0, 1))
    evidence = {
        "parametric": EvidenceArray(
            parametric, "1", "time-dependent coefficients, by excitation: transverse, joint, axial"
        ),
        "forced": EvidenceArray(forced, "1", "an arm at rest is set in motion, by excitation"),
        "times": EvidenceArray(long.times, "s", "time"),
        "envelope": EvidenceArray(
            envelope, "m", "peak so far with the transverse base at omega_2 and 2 omega_2: case, time"
        ),
        "growth": EvidenceArray(rate, "1/s", "growth rate with the fluctuating joint at 2 omega_2"),
    }
    judgement = judged(parametric[:1])
    if judgement.outcome == "contradicted":
        plain = "A base that shakes across the arm forces it, and makes no coefficient of its equations vary in time."
        sentence = (
            r"It enters (11) only as the force $-\Gamma_i \ddot w$: no coefficient of the equation of motion or of a "
            r"boundary condition depends on time. At $\omega_2$ such a base makes the response grow in proportion to "
            rf"time, at $2\omega_2$ it stays below {number(1e3 * envelope[1, -1])} mm, where a joint fluctuating by "
            f"{percent(setting.epsilon)} makes any vibration grow by a factor e in {number(1 / rate)} s."
        )
    else:
        plain = "A base that shakes across the arm makes coefficients of its equations vary in time."
        sentence = f"With the fluctuating joint a vibration grows at {number(rate)} 1/s."
    others = [_WORDS[kind] for kind, there in zip(KINDS[1:], parametric[1:], strict=True) if there]
    remedy = listed(others, str, "or") if judgement.outcome == "contradicted" and others else None
    criterion = (
        "a coefficient of the equation of motion or of a boundary condition depends on time when the base shakes "
        "across the arm; symbolic, no threshold"
    )
    return Finding(judgement, plain, sentence, evidence, criterion, remedy)


@pictured("C14")
def draw_shaken_base_is_parametric(verdict: Verdict, ax: Axes) -> None:
    """Draw C14."""
    t, start = verdict["times"], 1e3 * verdict["envelope"][1, -1]
    labels = ("across, at $\\omega_2$", "across, at $2\\omega_2$")
    for k, (curve, label) in enumerate(zip(verdict["envelope"], labels, strict=True)):
        ax.semilogy(t[1:], 1e3 * curve[1:], color=PALETTE[k], ls=STYLES[k], label=label)
    growing = start * np.exp(float(verdict["growth"]) * t)
    ax.semilogy(t, growing, color=PALETTE[2], ls=STYLES[2], label="joint, at $2\\omega_2$")
    ax.set(xlabel="time $t$ / s", ylabel="peak of $|v(L,t)|$ so far / mm", xlim=(t[0], t[-1]))
    ax.set_ylim(0.3 * start, 3 * max(growing.max(), 1e3 * verdict["envelope"].max()))
    ax.legend(fontsize=8)


@claimed(
    "C15",
    "stability",
    "Section 5.2, (48) and (49)",
    "(48) gives the boundary (49)",
    "Equation (48) keeps similar form to the resulting equation in [16, 17]; thus ... the stability boundary can be "
    "similarly "
    "expressed by [(49)]",
)
def boundary_from_the_amplitude_equation(setting: Setting) -> Finding:
    """Judge C15."""
    from sympy.core.function import AppliedUndef

    from cra_sym.mechanics.boundaries import forced_resonance, general_resonance, n
    from cra_sym.mechanics.two_scales import conjugate_amplitude

    derived = [forced_resonance(), general_resonance("principal", 1, damped=False)]
    bounded = np.array([scales.border is not None for scales in derived])
    slow = [{f.func.__name__ for e in scales.amplitude_equations for f in e.atoms(AppliedUndef)} for scales in derived]
    conjugate = np.array([conjugate_amplitude(n).name in names for names in slow])
    arm = setting.arm.replace(k_t=setting.soft_k_t)
    omega = modal_parameters(arm, 3).omega
    excitations = (JointStiffness(), AxialBase(setting.amplitude))
    sides = np.array([[zone(arm, e, setting.epsilon, (k, k)) for k in (1, 2, 3)] for e in excitations])
    centre, half = sides.mean(-1), np.diff(sides)[..., 0] / 2
    probes = np.linspace(-1.5, 1.5, 61)
    rates = np.stack(
        [
            growth_rate(arm, e, centre[i, 1] + probes * half[i, 1], setting.epsilon, modes=3)
            for i, e in enumerate(excitations)
        ]
    )
    evidence = {
        "bounded": EvidenceArray(bounded, "1", "whether a boundary follows: forced (transverse base), parametric"),
        "conjugate": EvidenceArray(
            conjugate, "1", "whether the amplitude equation has the conjugate amplitude: the same two"
        ),
        "centre": EvidenceArray(
            centre / omega, "1", "centre of the zone over omega_n: excitation (joint, axial), mode"
        ),
        "detuning": EvidenceArray(probes, "1", "detuning from 2 omega_2 over the derived half-width"),
        "growth": EvidenceArray(rates, "1/s", "growth rate by Floquet theory about 2 omega_2: excitation, detuning"),
    }
    judgement = judged(bounded[:1], conjugate[:1])
    plain = by_outcome(
        judgement,
        "The amplitude equation of (36) has a boundary of instability, as the paper says.",
        "The amplitude equation of (36) has a boundary of instability in part.",
        "The amplitude equation of (36) has no boundary of instability: nothing in it can grow by itself.",
    )
    confirmed = bool((rates[:, np.abs(probes) < 0.8] > 0).all())
    sentence = (
        "The printed (48) is lost. Derived from (36) as the paper builds it, the amplitude equation is "
        rf"{'with' if conjugate[0] else 'without'} the conjugate amplitude that makes a zone, so "
        f"{'a' if bounded[0] else 'no'} boundary follows. With a parametric excitation the zones sit at "
        rf"{number(evidence['centre'].values.mean(), 4)} $\omega_n$, and Floquet theory "
        f"{'confirms' if confirmed else 'does not confirm'} them."
    )
    remedy = None
    if judgement.outcome == "contradicted" and bounded[1] and confirmed:
        remedy = rf"{listed(_WORDS.values(), str, 'or')}; and the detuning (42) counted from $2\omega_n$"
    criterion = (
        "the amplitude equation derived from (36) holds the conjugate amplitude and gives a boundary; symbolic, no "
        "threshold"
    )
    return Finding(judgement, plain, sentence, evidence, criterion, remedy)


@pictured("C15")
def draw_boundary_from_the_amplitude_equation(verdict: Verdict, ax: Axes) -> None:
    """Draw C15."""
    for k, (curve, label) in enumerate(zip(verdict["growth"], ("joint stiffness", "axial base"), strict=True)):
        ax.plot(verdict["detuning"], curve / curve.max(), color=PALETTE[k + 1], ls=STYLES[k], label=label)
    ax.axvspan(-1, 1, color="#BFE3D6", alpha=0.6, lw=0)
    ax.set(xlabel="detuning from $2\\omega_2$ / derived half-width", ylabel="growth rate / largest", ylim=(0, 1.3))
    ax.set_xlim(-1.5, 1.5)
    ax.legend(fontsize=8, loc="upper right")
    note(ax, "green: derived zone", "upper left")


@claimed(
    "C19",
    "stability",
    "Section 5.2, (42)",
    "parametric resonance near any $\\omega_n$",
    "If the variation frequency approaches any natural frequency of the system, the parametric resonance may occur",
)
def resonance_at_any_frequency(setting: Setting) -> Finding:
    """Judge C19."""
    arm = setting.arm.replace(k_t=setting.soft_k_t, zeta=0.0)
    epsilon = np.geomspace(0.02, 0.3, 8)
    zeta = np.array([0.0, 1e-5, 1e-4, 1e-3, 1e-2])
    omega = float(modal_parameters(arm, 2).omega[1])
    rates = {tongue: _largest_growth(arm, epsilon, tongue) for tongue in (1, 2)}
    logs = {tongue: np.log(np.maximum(rate, _NO_GROWTH)) for tongue, rate in rates.items()}
    powers = [float(np.polyfit(np.log(epsilon[:5]), logs[tongue][:5], 1)[0]) for tongue in (1, 2)]
    region = (
        rates[2] > zeta[:, None] * omega + _NO_GROWTH
    )  # uniform damping takes zeta omega_n from the growth of mode n
    at = int(np.argmin(np.abs(epsilon - setting.epsilon)))
    needed = [float(epsilon[row.argmax()]) if row.any() else np.inf for row in region]
    evidence = {
        "epsilon": EvidenceArray(epsilon, "1", "depth of the joint's fluctuation"),
        "growth_at_twice": EvidenceArray(rates[1], "1/s", "largest growth rate near 2 omega_2, by epsilon"),
        "growth_at_once": EvidenceArray(rates[2], "1/s", "largest growth rate near omega_2, by epsilon"),
        "powers": EvidenceArray(powers, "1", "power of epsilon in the growth near 2 omega_2 and near omega_2"),
        "zeta": EvidenceArray(zeta, "1", "damping ratio"),
        "region": EvidenceArray(region, "1", "where the arm is unstable near omega_2: zeta, epsilon"),
    }
    reach = f"{number(epsilon[0])} to {number(epsilon[-1])}"
    gone = [z for z, least in zip(zeta, needed, strict=True) if np.isinf(least)]
    end = rf"; a damping ratio of {percent(gone[0], 1)} removes it for $\epsilon$ of {reach}" if gone else ""
    own = float(np.max(setting.arm.zeta)) * omega
    judgement = judged(region, here=rates[2][at] > own + _NO_GROWTH)
    plain = by_outcome(
        judgement,
        r"A fluctuating joint makes the arm unstable near $\omega_n$, whatever the damping.",
        r"Near $\omega_n$ a fluctuating joint makes the arm unstable only by a second-order effect, which a little "
        "damping removes; the instability to expect lies near twice that frequency.",
        r"Near $\omega_n$ a fluctuating joint does not make the arm unstable; near twice that frequency it does.",
    )
    sentence = (
        r"Floquet theory finds growth near $2\omega_2$ in proportion to "
        rf"$\epsilon^{{{powers[0]:.2f}}}$: {number(rates[1][at])} 1/s at $\epsilon$ = {number(epsilon[at], 2)}"
    )
    if region.any():
        sentence += (
            rf", and near $\omega_2$ to $\epsilon^{{{powers[1]:.2f}}}$: {number(rates[2][at], 2)} 1/s, which the "
            f"first-order expansion (37) cannot see{end}."
        )
    else:
        sentence += rf", and none near $\omega_2$ for $\epsilon$ of {reach}."
    criterion = (
        rf"near $\omega_2$ a vibration grows by more than {number(_NO_GROWTH, 1)} 1/s, for $\epsilon$ of {reach} and "
        f"damping ratios of {listed(zeta, percent)}"
    )
    return Finding(judgement, plain, sentence, evidence, criterion)


def _largest_growth(arm: Arm, epsilon: np.ndarray, tongue: int) -> np.ndarray:
    """Return the largest growth rate in and around a zone of mode 2, by epsilon."""
    low, high = zone(arm, JointStiffness(), epsilon, (2, 2), order=2, tongue=tongue)
    centre, half = (low + high) / 2, (high - low) / 2
    probes = centre + np.linspace(-2.5, 2.5, 101)[:, None] * half
    return np.asarray(growth_rate(arm, JointStiffness(), probes, epsilon, residual=True, tolerance=1e-10).max(axis=0))


@pictured("C19")
def draw_resonance_at_any_frequency(verdict: Verdict, ax: Axes) -> None:
    """Draw C19."""
    for k, (name, label) in enumerate(
        (("growth_at_twice", "near $2\\omega_2$"), ("growth_at_once", "near $\\omega_2$"))
    ):
        power = verdict["powers"][k]
        ax.loglog(verdict["epsilon"], verdict[name], color=PALETTE[k], ls=STYLES[k], marker="o", ms=3,
                  label=f"{label}, $\\propto\\epsilon^{{{power:.2f}}}$")  # fmt: skip
    ax.set(xlabel="depth of the joint's fluctuation $\\epsilon$", ylabel="largest growth rate / (1/s)")
    ax.set_xticks([0.02, 0.05, 0.1, 0.2], ["0.02", "0.05", "0.1", "0.2"])
    ax.set_xticks([], minor=True)
    ax.legend(fontsize=8)
