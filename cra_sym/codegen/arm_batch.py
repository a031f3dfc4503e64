"""Batches of arms in C: the loops over lanes of the compiled kernels, printed, with the functions that call them."""

from __future__ import annotations

import math
from functools import cache

import numpy as np

from cra_sym.codegen.arm_family import arm_family
from cra_sym.codegen.expressions import spectrum_functions
from cra_sym.codegen.print_lanes import LanesPrinter, Rows
from cra_sym.codegen.rendering import rendered
from cra_sym.kernels.specialise import written_out

__all__ = ["arm_batch"]

_GROUPS = 1e-9, 1e-3, 0.2, 1.0, 7.0, 60.0, 1e3, 1e6, 1e9  # arms in a batch of the self-test


def arm_batch(name: str, real: str, tolerance: float) -> tuple[str, str, str]:
    """Return declarations, definitions and a self-test; in single precision arms are solved one by one."""
    double = real == "float64"
    values = {
        "name": name,
        "upper": name.upper(),
        "word": "double" if double else "float",
        "half_turns": repr(2 * math.pi) if double else f"{np.float32(2 * np.pi)}f",
        "lanes": _lanes() if double else "",
        "numbers": [f"{x!r}{'' if double else 'f'}" for x in _GROUPS],
        "section": ", ".join(f"{x!r}{'' if double else 'f'}" for x in (0.03, 0.003, 7e10, 2700.0)),
        "tolerance": repr(tolerance),
    }
    made = rendered("c", values)
    return made["batch.h"].strip(), made["batch.c"], made["batch_test.c"].strip()


@cache
def _lanes() -> str:
    text, numbers = written_out(*arm_family().spectrum_parts())
    summaries = {f.name: f.summary for f in spectrum_functions()}
    printer = LanesPrinter(text, numbers, {"_LANES": "LANES"}, {"points": "POINTS"}, summaries)
    group = Rows("const double", ("arms",))
    return printer.entry("frequency_parameters", [Rows("double", ("arms", "modes")), None, *[group] * 4])
