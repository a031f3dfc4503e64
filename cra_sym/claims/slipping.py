"""The paper's claims on the joint, evaluated for a joint that slips, over its preload and the size of the motion.

They are separate from the ledger, which is about the paper's model with two springs as the joint. Here the joint is a
:class:`cra_sym.BoltedJoint`, which softens and slips as its preload is lost, and "as k_t falls" becomes "as the preload
falls".
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np

from cra_sym.analysis.backbone import backbone
from cra_sym.analysis.modes import natural_frequencies
from cra_sym.analysis.responses import tip_response
from cra_sym.analysis.stability import stability_boundary
from cra_sym.arm.bolted_joint import BoltedJoint
from cra_sym.arm.parameters import Arm
from cra_sym.checks import choice, default_floating_point
from cra_sym.claims.ledger import claim
from cra_sym.claims.motions import peak
from cra_sym.claims.setting import Setting
from cra_sym.claims.slipping_pictures import PICTURES
from cra_sym.claims.verdict import EvidenceArray, Finding, Verdict, judged
from cra_sym.claims.words import by_outcome, listed, number, percent, span
from cra_sym.model.excitations import Fluctuation
from cra_sym.solvers.motion import BaseMotion

__all__ = ["SLIPPING", "slipping_claim", "slipping_claims"]

_PRELOAD = np.geomspace(0.1, 100.0, 16)  # N
_SIZES = np.array([1.0, 3.0, 10.0])  # of the motion, over the nominal one
_SOFT = BoltedJoint(rest=20.0, body_t=20.0, lever=0.05)  # a joint with visible deformation before slip
_SOFT_PRELOAD = np.array([0.3, 0.6, 1.2, 2.4])  # N
_AMPLITUDE = np.geomspace(5e-3, 0.1, 6)  # m, at the tip
_SETTLED = 1e-6  # relative error of frequencies by harmonic balance


def _axes(**more: EvidenceArray) -> dict[str, EvidenceArray]:
    return {
        "preload": EvidenceArray(_PRELOAD, "N", "preload of the joint"),
        "size": EvidenceArray(_SIZES, "1", "size of mean motion and disturbance, over the nominal ones"),
        "soft_preload": EvidenceArray(_SOFT_PRELOAD, "N", "preload of the soft joint"),
        "amplitude": EvidenceArray(_AMPLITUDE, "m", "amplitude at the tip on the soft joint"),
        **more,
    }


@cache
def _frequencies(arm: Arm) -> tuple[np.ndarray, np.ndarray]:
    """Return frequencies of small vibration (preload, mode), and of mode 1 (soft preload, amplitude), Hz."""
    small = natural_frequencies(BoltedJoint().on(arm, _PRELOAD))
    large = [
        backbone(_SOFT.on(arm, float(N)), 1, amplitude=_AMPLITUDE, modes=2).angular_frequency for N in _SOFT_PRELOAD
    ]
    return small, np.array(large) / (2 * np.pi)


@cache
def _tips(setting: Setting, acceleration: float, disturbed: bool, rigid: bool) -> np.ndarray:
    """Return v(L, t) of the slipping joint, shape (size, preload, times), or of the rigid one (size, 1, times)."""
    size = _SIZES[:, None]
    motion = BaseMotion(acceleration=acceleration * size)
    if disturbed:
        parts = {name: value * (size if name == "amplitude" else 1.0) for name, value in setting.disturbance.items()}
        motion = motion + BaseMotion(**parts)
    system: Any = setting.rigid if rigid else BoltedJoint().on(setting.arm, _PRELOAD)
    return np.asarray(tip_response(system, motion, setting.times, modes=3))


def _frequencies_fall(setting: Setting) -> Finding:
    small, large = _frequencies(setting.arm)
    falls = np.diff(small, axis=0) > 0
    with_slip = np.diff(large, axis=0) >= -_SETTLED * large[1:]
    judgement = judged(falls, with_slip)
    plain = by_outcome(
        judgement,
        "Every frequency falls as the preload does, and at each amplitude it falls further where the faces slip.",
        "The frequencies fall with the preload at most amplitudes.",
        "No frequency falls with the preload.",
    )
    sentence = (
        f"Stuck, $f_1$ falls from {number(small[-1, 0])} Hz at {number(_PRELOAD[-1])} N to {number(small[0, 0])} Hz at "
        f"{number(_PRELOAD[0])} N; on a soft joint slip takes it from {number(large.max())} to {number(large.min())} "
        f"Hz over amplitudes of {number(1e3 * _AMPLITUDE[0])} to {number(1e3 * _AMPLITUDE[-1])} mm."
    )
    evidence = _axes(
        small=EvidenceArray(small, "Hz", "frequencies of small vibration: preload, mode"),
        large=EvidenceArray(large, "Hz", "frequency of mode 1 on the soft joint: its preload, amplitude"),
        region=EvidenceArray(
            falls, "1", "where the frequency of small vibration falls with the preload: preload, mode"
        ),
    )
    criterion = (
        f"each frequency falls from preload to preload, to {number(_SETTLED)} of it; stuck, and with slip in mode 1"
    )
    return Finding(judgement, plain, sentence, evidence, criterion)


def _sensitivity_grows(setting: Setting) -> Finding:
    _, large = _frequencies(setting.arm)
    rate = np.abs(np.diff(large, axis=0)) / np.diff(_SOFT_PRELOAD)[:, None]
    grows = rate[:-1] > rate[1:] + 1e-9
    small = _frequencies(setting.arm)[0]
    slopes = np.diff(small, axis=0) / np.diff(_PRELOAD)[:, None]
    stuck = slopes[:-1] > slopes[1:]
    judgement = judged(grows)
    plain = by_outcome(
        judgement,
        "The more preload is lost, the more sensitive the frequency of mode 1 is to it, at every amplitude.",
        "With slip the sensitivity to the preload grows only until the faces slide: from then on it is zero.",
        "With slip the sensitivity to the preload does not grow as that is lost.",
    )
    sentence = (
        f"At the amplitudes {listed(1e3 * _AMPLITUDE, number)} mm it grows in {percent(grows.mean())} of the steps of "
        f"the preload from {number(_SOFT_PRELOAD[2])} down to {number(_SOFT_PRELOAD[0])} N; without slip, where the "
        f"contact alone softens, in {percent(stuck.mean())}."
    )
    evidence = _axes(
        rate=EvidenceArray(rate, "Hz/N", "change of the first frequency over that of the preload: preload, amplitude"),
        region=EvidenceArray(grows, "1", "where it grows as the preload falls: preload, amplitude"),
    )
    return Finding(
        judgement, plain, sentence, evidence, "the rate of $f_1$ by the preload grows as that falls; no threshold"
    )


def _smaller(setting: Setting, soft: np.ndarray, fixed: np.ndarray, what: str) -> Finding:
    seen = 1 - setting.visible
    ratio = np.log(peak(soft) / peak(fixed))
    region = ratio < np.log(seen)
    judgement = judged(region)
    plain = by_outcome(
        judgement,
        f"{what} is smaller on the joint that slips, at every preload.",
        f"{what} is smaller on the joint that slips only at some preloads: softening detunes and friction damps, until "
        "too little holds.",
        f"{what} is smaller at none of the preloads tried.",
    )
    where = ", ".join(
        f"{span(_PRELOAD, r, 'N').replace('nowhere', 'none')} for {number(s, 2)} times the motion"
        for s, r in zip(_SIZES, region, strict=True)
    )
    sentence = f"Preloads at which it is smaller than on the rigid joint by over {percent(setting.visible)}: {where}."
    evidence = _axes(
        log_ratio=EvidenceArray(ratio, "1", "ln of the peak over that on the rigid joint: size, preload"),
        region=EvidenceArray(region, "1", "where it is visibly smaller: size, preload"),
    )
    criterion = (
        f"the largest value from 0 to {number(setting.duration)} s is smaller than on the rigid joint by over "
        f"{percent(setting.visible)}, for preloads of {number(_PRELOAD[0])} to {number(_PRELOAD[-1])} N"
    )
    return Finding(judgement, plain, sentence, evidence, criterion)


def _amplitude_smaller(setting: Setting) -> Finding:
    soft, fixed = (_tips(setting, setting.accelerations[0], True, rigid) for rigid in (False, True))
    return _smaller(setting, soft, fixed, "The tip's amplitude")


def _error_smaller(setting: Setting) -> Finding:
    a = setting.accelerations[0]
    soft, fixed = (_tips(setting, a, True, rigid) - _tips(setting, a, False, rigid) for rigid in (False, True))
    return _smaller(setting, soft, fixed, "What the disturbance adds")


def _grows(setting: Setting, peaks: np.ndarray, what: str, more: float) -> Finding:
    region = (peaks[1:] > (1 + more) * peaks[:-1]).all(axis=0)
    judgement = judged(region)
    plain = by_outcome(
        judgement,
        f"{what} grows with the mean acceleration, at every preload and size of the motion.",
        f"{what} grows with the mean acceleration in some cases: friction ends superposition.",
        f"{what} does not grow with the mean acceleration.",
    )
    ratio = peaks[-1] / peaks[0]
    sentence = (
        f"From {number(setting.accelerations[0])} to {number(setting.accelerations[-1])} m/s² it changes by factors of "
        f"{number(ratio.min())} to {number(ratio.max())} over preload and size; it grows in {percent(region.mean())} "
        "of the cases."
    )
    evidence = _axes(
        peaks=EvidenceArray(peaks, "m", "largest value: acceleration, size, preload"),
        region=EvidenceArray(region, "1", "where it grows at each step of the acceleration: size, preload"),
    )
    growth = f"by over {percent(more)}" if more else "at all; no threshold"
    return Finding(
        judgement, plain, sentence, evidence, f"the largest value grows from each acceleration to the next {growth}"
    )


def _amplitude_grows(setting: Setting) -> Finding:
    peaks = [peak(_tips(setting, a, True, False)) for a in setting.accelerations]
    return _grows(setting, np.array(peaks), "The tip's amplitude", 0.0)


def _error_grows(setting: Setting) -> Finding:
    errors = [_tips(setting, a, True, False) - _tips(setting, a, False, False) for a in setting.accelerations]
    return _grows(setting, peak(np.array(errors)), "What the disturbance adds", setting.visible)


def _zones_widen(setting: Setting) -> Finding:
    system, excitation = BoltedJoint().on(setting.arm, _PRELOAD), Fluctuation(k_r=1.0)
    sides = [stability_boundary(system, excitation, setting.epsilon, (n, n)) for n in (1, 2, 3)]
    width = np.array([upper - lower for lower, upper in sides])
    widens = width[1:, :-1] > width[1:, 1:]
    change = np.abs(width[:, 0] / width[:, -1] - 1)
    steady = change[0] < change[1:].min()
    judgement = judged(widens, [steady])
    against = "neither zone 2 nor zone 3 widens" if steady else "zone 1 does not stay: another zone changes less"
    plain = by_outcome(
        judgement,
        "As the preload is lost zone 1 changes least, and zones 2 and 3 widen.",
        "As the preload is lost zones 2 and 3 widen over a part of its range.",
        f"As the preload is lost {against}.",
    )
    sentence = (
        f"From {number(_PRELOAD[-1])} to {number(_PRELOAD[0])} N the absolute widths at $\\epsilon$ = "
        f"{number(setting.epsilon)} change by {listed(change, percent)} in zones 1 to 3; zones 2 and 3 "
        f"widen in {percent(widens.mean())} of the steps. Slip does not move these borders: rest sticks. What it "
        "does is bound the vibration inside."
    )
    evidence = _axes(
        width=EvidenceArray(width, "rad/s", "absolute width of the principal zones: mode, preload"),
        region=EvidenceArray(widens, "1", "where zones 2 and 3 widen as the preload falls: mode, preload"),
    )
    criterion = (
        "the first-order widths of zones 2 and 3 grow as the preload falls, that of zone 1 changes least; no threshold"
    )
    return Finding(judgement, plain, sentence, evidence, criterion)


_JUDGES: Mapping[str, Callable[[Setting], Finding]] = {
    "C02": _frequencies_fall,
    "C06": _sensitivity_grows,
    "C10": _amplitude_smaller,
    "C11": _error_smaller,
    "C12": _amplitude_grows,
    "C13": _error_grows,
    "C16": _zones_widen,
}
SLIPPING = tuple(_JUDGES)
"""The claims that are evaluated for slip."""


@cache
def _verdict(id: str, setting: Setting) -> Verdict:
    paper, found = claim(id, setting.arm), _JUDGES[id](setting)
    return Verdict.of(
        replace(found, sentence=f"{found.sentence} With springs alone it {_headline_clause(paper)}."),
        id=id,
        theme=paper.theme,
        title=f"{paper.title}, with slip",
        claim=paper.claim,
        source=paper.source,
        setting=setting,
        picture=PICTURES[id],
    )


def _headline_clause(verdict: Verdict) -> str:
    """Return the headline as the end of a sentence."""
    return f"is {verdict.headline}" if verdict.outcome in ("contradicted", "undecidable") else verdict.headline


@default_floating_point
def slipping_claim(id: str, arm: Arm | None = None, **numbers: Any) -> Verdict:
    """Return the verdict on a claim for a bolted joint that slips, over its preload and the size of the motion.

    Parameters
    ----------
    id : str
        One of `SLIPPING`.
    arm : Arm, optional
        By default the nominal one; its springs are replaced.
    **numbers
        Fields of `Setting` to change.

    Raises
    ------
    TypeError, ValueError
        As :func:`cra_sym.claims.claim`.

    Examples
    --------
    >>> slipping_claim("C02").outcome
    'holds'
    """
    return _verdict(choice("claim", id, SLIPPING), Setting.of(arm, **numbers))


def slipping_claims(arm: Arm | None = None, **numbers: Any) -> tuple[Verdict, ...]:
    """Return the verdicts on all claims that are evaluated for slip; arguments as for :func:`slipping_claim`."""
    return tuple(slipping_claim(id, arm, **numbers) for id in SLIPPING)
