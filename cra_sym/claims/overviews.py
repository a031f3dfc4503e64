"""Pictures of many at once: all claims of a theme, and the family of arms that share the published frequencies."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from matplotlib.figure import Figure

from cra_sym.arm.parameters import Arm
from cra_sym.checks import choice, count, instance
from cra_sym.claims.family import ArmFamily, provenance_family
from cra_sym.claims.ledger import claims
from cra_sym.claims.verdict import THEMES, Verdict
from cra_sym.figures import styled
from cra_sym.figures.drawing import figure_of, panel
from cra_sym.figures.subject import single

if TYPE_CHECKING:
    from matplotlib.axes import Axes

__all__ = ["figure_claims", "figure_family"]


def figure_claims(theme: str, verdicts: Sequence[Verdict] | None = None, columns: int = 3) -> Figure:
    """Draw all verdicts of a theme, a panel each.

    Parameters
    ----------
    theme : {'modes', 'responses', 'stability'}
    verdicts : sequence of Verdict, optional
        By default those of the nominal setting.
    columns : int
    """
    choice("theme", theme, THEMES)
    verdicts = claims(theme=theme) if verdicts is None else tuple(verdicts)
    for verdict in verdicts:
        instance("verdict", verdict, Verdict)
    rows = max(-(-len(verdicts) // count("columns", columns, high=100)), 1)
    with styled():
        figure = Figure(figsize=(4.1 * columns, 3.15 * rows), dpi=100, layout="constrained")
        panels = list(figure.subplots(rows, columns, squeeze=False).flat)
    for ax, verdict in zip(panels, verdicts, strict=False):
        verdict.draw(ax)
    for ax in panels[len(verdicts) :]:
        ax.set_axis_off()
    return figure


def figure_family(family: ArmFamily | None = None, arm: Arm | None = None, ax: Axes | None = None) -> Figure:
    """Draw the arms that share the published frequencies: thickness against length, a curve a material, and an arm."""
    family = provenance_family() if family is None else family
    instance("family", family, ArmFamily)
    arm = Arm.nominal() if arm is None else arm
    instance("arm", arm, Arm)
    single(arm)
    with styled():
        ax = panel(ax, (5.6, 3.8))
        for name, thickness in zip(family.materials, family.thickness, strict=True):
            ax.plot(family.length, 1e3 * thickness, label=name)
        place = float(arm.L), 1e3 * float(arm.h)
        ax.plot(*place, "o", color="0.15", ms=6, ls="")
        ax.annotate(
            "nominal arm" if arm == Arm.nominal() else "this arm",
            place, xytext=(-6, 7), ha="right", textcoords="offset points", fontsize=8.5
        )  # fmt: skip
        printed = ", ".join(f"{f:.3f}" for f in family.published)
        ax.set_title(f"Every arm on these curves has {printed} Hz")
        ax.set(xlabel="length $L$ / m", ylabel="thickness $h$ / mm", ylim=(0, None))
        ax.set_xlim(family.length[0], family.length[-1])
        ax.legend()
    return figure_of(ax)
