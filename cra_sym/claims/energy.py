"""Claims on the energies and principles that the equations rest on: C18 and C21."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from cra_sym.analysis.modal_parameters import modal_parameters
from cra_sym.analysis.sensitivities import sensitivities
from cra_sym.claims.pictures import by_mode, note, stiffness_axis
from cra_sym.claims.registry import claimed, pictured
from cra_sym.claims.setting import Setting
from cra_sym.claims.verdict import EvidenceArray, Finding, Verdict, judged
from cra_sym.claims.words import by_outcome, listed, number, percent

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from cra_sym.arm.parameters import Arm

_ROUNDING = 1e-9  # relative: what quadrature and rounding may leave of an identity


@claimed(
    "C18",
    "modes",
    "Section 3, (4) and (6)",
    "the beam's energy alone gives $K_i$",
    "the potential energy of the flexible CRA system mainly considers the elastic potential energy of the flexible "
    "manipulator",
)
def energy_of_the_beam_alone(setting: Setting) -> Finding:
    """Judge C18."""
    k_t, k_r = np.logspace(6, 1, 41), np.logspace(5, 0, 41)
    cases = [setting.rigid.replace(k_t=k_t), setting.rigid.replace(k_r=k_r)]
    alone = np.stack([_beam_share(arm) for arm in cases])
    whole = alone + np.stack([_joint_share(arm) for arm in cases])
    clamped = _beam_share(setting.rigid)
    agrees = np.abs(alone - 1) < _ROUNDING
    evidence = {
        "k_t": EvidenceArray(k_t, "N/m", "translational stiffness, the rotational one infinite"),
        "k_r": EvidenceArray(k_r, "N m/rad", "rotational stiffness, the translational one infinite"),
        "beam_only": EvidenceArray(
            alone, "1", "K_i / (M_i omega_i^2) with the beam's energy: spring (t, r), stiffness, mode"
        ),
        "with_springs": EvidenceArray(whole, "1", "the same with the two springs' energy"),
        "rigid": EvidenceArray(clamped, "1", "the same on the rigid joint, by mode"),
    }
    soft = _beam_share(setting.rigid.replace(k_t=setting.soft_k_t))
    judgement = judged(agrees, here=np.abs(soft - 1) < _ROUNDING)
    plain = by_outcome(
        judgement,
        "The beam's energy alone gives every frequency.",
        "The beam's energy alone gives the frequencies of some joints only.",
        "On an elastic joint the beam's energy alone falls short of the frequencies: the springs store energy too.",
    )
    sentence = (
        rf"$K_i/M_i$ of (6) with the beam's energy alone is $\omega_i^2$ of (30) in {percent(agrees.mean())} of the "
        f"cases; at $k_t$ = {number(setting.soft_k_t)} N/m it is {listed(soft, percent)} of it"
        f"{', on the rigid joint all of it' if np.allclose(clamped, 1, rtol=_ROUNDING) else ''}."
    )
    remedy = None
    if judgement.outcome != "holds" and np.allclose(whole, 1, rtol=_ROUNDING):
        remedy = (
            r"the springs' energy, $k_t v(0)^2/2 + k_r v_x(0)^2/2$, added to (4): then $K_i = M_i \omega_i^2$ to "
            f"{number(np.abs(whole - 1).max(), 1)} for every stiffness"
        )
    criterion = (
        rf"$K_i/M_i$ with the beam's energy alone is $\omega_i^2$ to {number(_ROUNDING, 1)}, for every stiffness and "
        "mode"
    )
    return Finding(judgement, plain, sentence, evidence, criterion, remedy)


def _beam_share(arm: Arm) -> np.ndarray:
    """Return twice the energy of the beam over ``M_i omega_i^2``: all that is proportional to E is the beam's."""
    return 2.0 * sensitivities(arm, by=["E"]).log_E


def _joint_share(arm: Arm) -> np.ndarray:
    modal = modal_parameters(arm)
    stiffness = modal.stiffness_translation + modal.stiffness_rotation
    return np.asarray(np.diagonal(stiffness, axis1=-2, axis2=-1) / modal.omega**2)


@pictured("C18")
def draw_energy_of_the_beam_alone(verdict: Verdict, ax: Axes) -> None:
    """Draw C18."""
    by_mode(ax, verdict["k_t"], verdict["beam_only"][0])
    ax.plot(verdict["k_t"], verdict["with_springs"][0].mean(-1), color="0.3", lw=1.0, ls="-")
    note(ax, "grey: with the springs' energy", "lower right")
    stiffness_axis(ax, "k_t")
    ax.legend(fontsize=8.5, loc="center right")
    ax.set_ylabel("$K_i / (M_i\\,\\omega_i^2)$")


@claimed(
    "C21",
    "modes",
    "Sections 3 and 4, (8) and (14)",
    "both principles give the same joint",
    "Hamilton's variational principle ... the principle of virtual work is utilized [for the boundary conditions]",
)
def two_principles(setting: Setting) -> Finding:
    """Judge C21."""
    from cra_sym.arm.lagrangian import paper_lagrangian
    from cra_sym.mechanics import hamilton
    from cra_sym.paper.energy import L, t, v, w, x
    from cra_sym.paper.joint import boundary_conditions

    agree = []
    for joint in (True, False):
        density, left, right = paper_lagrangian(joint=joint)
        result = hamilton(density, fields=[v], prescribed=[w], x=x, domain=(0, L), t=t, left=left, right=right)
        found = [(e.lhs - e.rhs).expand() for e in result.boundary_conditions]
        wanted = [(e.lhs - e.rhs).expand() for e in boundary_conditions()]
        agree.append([any((a - s * b).expand() == 0 for b in found for s in (1, -1)) for a in wanted])
    evidence = {
        "with_springs": EvidenceArray(
            agree[0], "1", "condition (16) met by Hamilton's principle with the springs in (4)"
        ),
        "beam_only": EvidenceArray(agree[1], "1", "the same with the beam's energy alone"),
    }
    judgement = judged(agree[0])
    plain = by_outcome(
        judgement,
        "Hamilton's principle and virtual work describe one joint, once the springs' energy is counted.",
        "Hamilton's principle and virtual work describe the joint differently, whatever energy is counted.",
        "Hamilton's principle and virtual work have no boundary condition in common.",
    )
    sentence = (
        f"With the springs' energy in (4) Hamilton's principle (8) gives {sum(agree[0])} of the 4 conditions of "
        f"virtual work (14); with the beam's energy alone it gives {sum(agree[1])}, and the joint's end is "
        f"{'free' if sum(agree[1]) < 4 else 'the same'}."
    )
    criterion = "each condition of (16) is one of Hamilton's principle with the springs in (4); symbolic, no threshold"
    return Finding(judgement, plain, sentence, evidence, criterion)


@pictured("C21")
def draw_two_principles(verdict: Verdict, ax: Axes) -> None:
    """Draw C21."""
    table = np.array([verdict["with_springs"], verdict["beam_only"]], dtype=float)
    ax.imshow(table, cmap="cividis", vmin=-0.4, vmax=1.4, aspect="auto")
    for (row, column), value in np.ndenumerate(table):
        ax.text(column, row, "same" if value else "differs", ha="center", va="center", fontsize=8.5,
                color="0.1" if value else "white")  # fmt: skip
    ax.set_xticks(range(4), ["root\nforce", "root\nmoment", "tip\nforce", "tip\nmoment"])
    ax.set_yticks([0, 1], ["with\nsprings", "beam\nalone"])
    ax.grid(False)
