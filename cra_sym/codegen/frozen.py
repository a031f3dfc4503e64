"""Exported code of any system with its modes frozen as numbers: stepping, inputs and outputs."""

from __future__ import annotations

import math
import textwrap
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cra_sym.analysis.eigenvalues import oscillating_frequencies
from cra_sym.analysis.state_space import state_space
from cra_sym.codegen.blocks import Blocks, blocks_of
from cra_sym.codegen.controllers import Controller, controller_checks, numbers_of, of_blocks
from cra_sym.codegen.library import Check, Library, source
from cra_sym.codegen.model_time import OUTPUTS
from cra_sym.codegen.operations import operations
from cra_sym.codegen.statement import stated
from cra_sym.codegen.unused import marked
from cra_sym.kernels.form_parse import parse
from cra_sym.model.system import System
from cra_sym.solvers.linear_system import LinearSystem

__all__ = [
    "common_checks", "default_outputs", "exported_state_space", "frozen_library", "frozen_system",
    "stepped",
]  # fmt: skip

Array = NDArray[np.float64]
_MOST_OUTPUTS = 64
_ERRORS = {"float64": 1e-11, "float32": 2e-3}
"""Error of the outputs in the reference vectors, relative to the largest of them, by the type of real numbers."""


def frozen_system(
    system: System, modes: int, drive: Any, outputs: Sequence[str] | Mapping[str, Any] | None
) -> tuple[Blocks, tuple[str, ...], str]:
    """Return the blocks of a system, the names of its outputs and that of its input.

    Raises
    ------
    TypeError, ValueError
        As :func:`cra_sym.state_space`; and if there are more than one input or more than 64 outputs.
    """
    found = exported_state_space(system, modes, drive, default_outputs(system, drive) if outputs is None else outputs)
    return blocks_of(found.A, found.B, found.C, found.D), found.output_names, found.input_names[0]


def exported_state_space(system: System, modes: int, drive: Any, outputs: Any) -> LinearSystem:
    """Return the state space of a system.

    Raises
    ------
    TypeError, ValueError
        As :func:`cra_sym.state_space`; and if there are more than one input or more than 64 outputs.
    """
    found = state_space(system, modes, drive, outputs)
    if found.B.shape[1] != 1:
        raise ValueError(f"input: must be one, there are {found.B.shape[1]}")
    if len(found.output_names) > _MOST_OUTPUTS:
        raise ValueError(f"outputs: must be at most {_MOST_OUTPUTS}, there are {len(found.output_names)}")
    return found


def default_outputs(system: System, drive: Any) -> list[str] | None:
    """Return those of the usual outputs that a system has; None if it has none."""
    return [name for name in OUTPUTS if _has(system, drive, name)] or None


def _has(system: System, drive: Any, output: str) -> bool:
    """Return whether a system has an output."""
    try:
        state_space(system, 1, drive, [output])
    except ValueError:
        return False
    return True


def frozen_library(
    system: System,
    name: str,
    modes: int,
    real: str,
    drive: Any,
    outputs: Sequence[str] | Mapping[str, Any] | None,
    controller: Controller | None = None,
) -> tuple[Library, str, tuple[str, ...]]:
    """Return a system as a library, with the names of its input and its outputs."""
    blocks, names, given = frozen_system(system, modes, drive, outputs)
    if not len(blocks.stiffness):
        raise ValueError(f"input = {given!r}: it moves nothing")
    values = ", ".join(f"{key} = {float(value)!r}" for key, value in system.values.items())
    statements = [f"At {values}; zeta = {float(system.zeta)!r}; {modes} modes."]
    statements += [f"Input u: {given}. Outputs y: {', '.join(names)}."]
    lines = (*stated(system.model), *(line for text in statements for line in textwrap.wrap(text, 96)))
    omega = oscillating_frequencies(system, modes)
    text = constants(blocks, names, omega)
    checks = [*_checks(blocks, real), *common_checks(omega, real)]
    parts = [source(part) for part in ("sampling", "shaping", "frozen", "frozen_check", "frozen_example")]
    if controller is not None:
        matrices = of_blocks(blocks, controller.time)
        gains, loss = controller.gains(*matrices, names), _ERRORS[real]
        text += controller.text(names, *gains)
        parts[3:4] = [
            marked(source("controller"), {"FROZEN"}),
            parts[3].rstrip("\n") + "\n    " + source("controller_check"),
        ]
        for pushed, found, size in controller_checks(controller, matrices, gains, list(names)):
            checks.append(Check(4, pushed, found, loss, 10 * loss * size))
        checks.append(Check(4, (0.25, 1.0, 0.125, math.nan), (), refused=True))
    text += "\n\n".join(parts)
    summary = "A flexible system frozen as numbers, to be stepped in real time"
    return Library(name, summary, text, lines, tuple(checks), _readme(given, names, text), real), given, names


def _readme(given: str, names: Sequence[str], text: str) -> str:
    form = parse(text)
    listed = "\n".join(f"| {i} | `{name}` |" for i, name in enumerate(names))
    timed = [name for name in ("step", "outputs", "derivative", "control", "correct") if name in form.functions]
    counts = ", ".join(f"`{name}` {operations(form, name, {})}" for name in timed)
    return (
        f"The input u is `{given}`; the outputs, in SI units, are\n\n| entry | output |\n| --- | --- |\n{listed}\n\n"
        f"Floating-point operations of a call, at most: {counts}.\n"
    )


def constants(blocks: Blocks, names: Sequence[str], omega: Array) -> str:
    """Return the numbers of a system as a text in the restricted form."""
    rows = {
        "STIFFNESS": (blocks.stiffness, "1/s^2, stiffness of each block"),
        "DAMPING": (blocks.damping, "1/s, damping of each block"),
        "ON_POSITION": (blocks.on_position, "gains of q of each block, output by output"),
        "ON_RATE": (blocks.on_rate, "gains of q' of each block, likewise, s"),
        "THROUGH": (blocks.through, "gains of u, output by output"),
        "FREQUENCIES": (omega, "rad/s, natural angular frequencies of the modes kept"),
    }
    scalars = [
        f"PI = {math.pi!r}  # half a turn",
        f"BLOCKS = {len(blocks.stiffness)}  # systems of second order, whose sum this is",
        f"SIGNALS = {len(names)}  # outputs: {', '.join(names)}",
        f"MODES = {len(omega)}  # modes kept",
    ]
    return "\n".join(
        [*scalars, *(f"{n} = ({numbers_of(v)},)  # {comment}" for n, (v, comment) in rows.items()), "", ""]
    )


def common_checks(omegas: Array, real: str) -> Iterator[Check]:
    """Yield input shapers and natural frequencies."""
    loss = _ERRORS[real]
    slowest, fastest = float(np.min(omegas[omegas > 0.0], initial=1.0)), float(omegas.max()) or 1.0
    for omega, zeta in ((fastest, 0.0), (slowest, 0.2)):
        root = math.sqrt(1 - zeta**2)
        decay = math.exp(-math.pi * zeta / root)
        amplitudes = [math.comb(3, k) * decay**k / (1 + decay) ** 3 for k in range(4)]
        times = [k * math.pi / (omega * root) for k in range(4)]
        yield Check(2, (omega, zeta), (*amplitudes, *times), loss)
    for bad in (0.0, -1.0, math.nan, math.inf):
        yield Check(2, (bad, 0.1), (), refused=True)
    yield from (Check(3, (n,), (omega,), loss) for n, omega in enumerate(omegas, 1))
    yield from (Check(3, (n,), (), refused=True) for n in (0, -1, len(omegas) + 1))
    yield Check(2, (1.0, 1.0), (), refused=True)


def _checks(blocks: Blocks, real: str) -> Iterator[Check]:
    """Yield the outputs by SciPy's matrix exponential, independent of the exported code."""
    loss = _ERRORS[real]
    rates = np.sqrt(np.abs(blocks.stiffness)) + np.abs(blocks.damping)
    fastest, slowest = float(rates.max()) or 1.0, float(np.min(rates[rates > 0.0], initial=1.0))
    for time in (0.03 / fastest, 0.7 / fastest, 0.3 / slowest):
        for steps in (0, 1, 7, 40):
            found, size = stepped(blocks, time, 0.25, steps)
            for_one = loss * size * max(1.0, time * steps * fastest * 1e-3)
            yield Check(0, (time, 0.25, steps), tuple(found), 0.0, float(for_one))
    for omega in (0.0, 0.31 * slowest, 1.37 * fastest):
        undamped = (blocks.damping * omega == 0.0) & (blocks.stiffness == omega**2)
        if undamped.any():
            yield Check(1, (omega,), (), refused=True)
            continue
        z = blocks.frequency_response(np.array([omega]))[:, 0]
        yield Check(1, (omega,), tuple(np.column_stack([z.real, z.imag]).ravel()), 0.0, loss * float(np.abs(z).max()))
    for bad in (0.0, -1.0, math.nan, math.inf):
        yield Check(0, (bad, 1.0, 1), (), refused=True)
    yield Check(1, (-1.0,), (), refused=True)
    yield Check(1, (math.nan,), (), refused=True)


def stepped(blocks: Blocks, time: float, push: float, steps: int) -> tuple[Array, float]:
    """Return the outputs after steps of the input of the self-test, and the largest term of the sum."""
    from scipy.linalg import expm

    count = len(blocks.stiffness)
    scale = np.maximum(np.sqrt(np.abs(blocks.stiffness)) + np.abs(blocks.damping), 1e-3 / time)
    state = np.zeros((count, 2))
    moves = []
    for k, d, s in zip(blocks.stiffness, blocks.damping, scale, strict=True):  # the rate measured in s p
        moves.append(expm(time * np.array([[0.0, s, 0.0], [-k / s, -d, 1.0 / s], [0.0, 0.0, 0.0]])))
    met = np.zeros(len(blocks.through))
    u = push
    for n in range(steps + 1):
        rows = blocks.on_position * state[:, 0], blocks.on_rate * (state[:, 1] * scale)
        met = np.maximum(met, np.abs(rows[0]).sum(axis=1) + np.abs(rows[1]).sum(axis=1) + np.abs(blocks.through * push))
        if n == steps:
            break
        u = push if n % 3 == 0 else -0.5 * push
        state = np.array([move[:2, :2] @ x + move[:2, 2] * u for move, x in zip(moves, state, strict=True)])
    return rows[0].sum(axis=1) + rows[1].sum(axis=1) + blocks.through * push, float(met.max())
