"""The arm in time: the part about time of an exported model, with the modes of the arm."""

from __future__ import annotations

import re
from collections.abc import Sequence
from typing import Any

import sympy as sp

from cra_sym.arm.parameters import Arm
from cra_sym.codegen.model_time import Shape, Signals, TimeText, signals
from cra_sym.codegen.printers import FormPrinter
from cra_sym.codegen.program import function, scalars
from cra_sym.codegen.unused import without_unused
from cra_sym.model import Model

__all__ = ["arm_in_time", "arm_signals"]


def arm_signals(modes: int, drive: Any = None, outputs: Any = None) -> Signals:
    """Return inputs and outputs of the arm, as :func:`cra_sym.codegen.model_time.signals`."""
    arm = Arm.nominal()
    found = signals(arm.model, drive, outputs, modes, arm.section_quantities)
    assert found is not None
    return found


def arm_in_time(in_time: Signals) -> str:
    """Return the part of the arm's text that is about time."""
    text = without_unused(TimeText(_ArmWriter(), in_time, "ARM").text)
    text = re.sub(r"\bparameters: Parameters\b", "arm: Arm", text)
    text = re.sub(r"\bzeta \* mode\[", "arm.zeta * mode[", re.sub(r"\bparameters\b", "arm", text))
    return text.replace("InvalidParameters", "InvalidArm").replace("SLIGHT", "LEAST_SHARE")


class _ArmWriter:
    """What the part about time needs of the arm's text."""

    @property
    def model(self) -> Model:
        return Arm.nominal().model

    def call(self, name: str, entries: Sequence[sp.Expr], row: str, words: str) -> tuple[str, list[str]]:
        used = sorted(set().union(*(sp.sympify(e, strict=True).free_symbols for e in entries)), key=str)
        made = function(name, words, list(entries), scalars(used))
        given = [f"parameters.{argument.symbols[0].name}" for argument in made.arguments]
        text = FormPrinter.text_of(made, f"_{name}", checked=False)
        return text, [f"{row} = zeros({len(entries)})", f"_{name}({', '.join([*given, row])})"]

    def shape(self, field: int, place: str, order: int) -> str:
        if order > 3:
            raise ValueError(
                f"outputs: a derivative of order {order} by x must be at most 3; give model= with the arm's"
            )
        return f"mode_shape(mode, {place}, {order})"

    def force(self, end: int, entry: int) -> tuple[str, Shape | None]:
        if not end:
            return ("-mode.root_shear", "mode.root_moment")[entry], None
        right = self.model.equations.domain[1]
        return ("-groups.rigidity", "groups.rigidity")[entry], (0, 3 - entry, right)

    def participation(self, motion: str) -> str:
        return "mode.participation"

    def push(self, force: str) -> str:
        raise ValueError(f"input = {force!r}: the arm has no forces of its own")
