"""Export of a user's model: frequencies, modes, sensitivities, responses, for any values of its parameters."""

from __future__ import annotations

import textwrap
from collections.abc import Sequence
from functools import lru_cache
from typing import Any

import numpy as np

from cra_sym.checks import instance
from cra_sym.codegen.controllers import Controller
from cra_sym.codegen.library import Library, source
from cra_sym.codegen.model_checks import model_checks, sample, tested
from cra_sym.codegen.model_controller import ModelController
from cra_sym.codegen.model_text import ModelText
from cra_sym.codegen.model_time import Signals, in_time_readme, signals
from cra_sym.codegen.statement import stated
from cra_sym.codegen.unused import marked
from cra_sym.model import Model
from cra_sym.model.waves_form import WavesForm, waves_form

__all__ = ["KEPT", "model_library", "model_text"]

KEPT = 16  # modes in time
_MOST = 32  # largest number of parameters in a line of the reference vectors
_SAME = 1e-6  # relative distance of frequencies that count as equal
_INSTEAD = "give system= with the model at its values, whose modes are exported as numbers"


def model_library(
    model: Model,
    name: str,
    real: str = "float64",
    modes: int | None = None,
    drive: Any = None,
    outputs: Any = None,
    controller: Controller | None = None,
) -> Library:
    """Return a model as a library.

    Parameters
    ----------
    model : Model
    name, real : str
    modes : int, optional
        Largest number in time, by default 16; with a controller their number, by default 3.
    drive, outputs
        In time, as :func:`cra_sym.state_space` takes them. Default: the only prescribed motion or force, and the usual
        outputs; without one there are no functions of time.
    controller : Controller, optional
        In time; its system has the values for which gains are computed.

    Raises
    ------
    TypeError
        If it is not a Model.
    ValueError
        If it cannot be exported for any values of its parameters, or an input or output in time is none: the message
        says why.
    """
    instance("model", model, Model)
    if modes is None:
        modes = KEPT if controller is None else 3
    if drive is None and outputs is None and controller is None:
        return _usual(model, name, real, modes)
    written = model_text(model, real, signals(model, drive, outputs, modes))
    return _library(written, name, None if controller is None else ModelController(written, controller))


@lru_cache(maxsize=8)
def _usual(model: Model, name: str, real: str, modes: int) -> Library:
    form = _form(model)
    return _library(ModelText(model, form, real, signals(model, None, None, modes)), name)


def model_text(model: Model, real: str = "float64", in_time: Signals | None = None) -> ModelText:
    """Return the writer of the text of a model; raise a ValueError if it cannot be exported."""
    return ModelText(model, _form(model), real, in_time)


def _form(model: Model) -> WavesForm:
    """Return a model as input of the wave solver."""
    if model.pieces["hysteresis"]:
        raise ValueError(
            "model: has elastic-slip elements, whose slip has no frequencies; give model.without_hysteresis, or system="
        )
    form = model.state_form
    if form.damped or not model.numerics("conservative"):
        raise ValueError(f"model: has dampers, gyroscopic or follower forces; {_INSTEAD}")
    if not form.displacements:
        raise ValueError(f"model: has lumped coordinates alone; {_INSTEAD}")
    if not form.uniform:
        raise ValueError(f"model: has coefficients that vary along the length, or terms inside; {_INSTEAD}")
    if len(form.displacements) > 3:
        raise ValueError(f"model: has {len(form.displacements)} wave numbers, at most 3 can be exported; {_INSTEAD}")
    found = waves_form(form, model.symbols)
    if found is None:
        raise ValueError(
            "model: is not even under reflection, has no mass, more than twelve conditions, or "
            f"coordinates that act along the whole length; {_INSTEAD}"
        )
    if not 0 < len(model.symbols) <= _MOST:
        raise ValueError(f"model: has {len(model.symbols)} parameters, must have 1 to {_MOST}; {_INSTEAD}")
    return found


def _library(written: ModelText, name: str, loop: ModelController | None = None) -> Library:
    model = written.model
    fields = list(written.names.values())
    lines = ["def _given_parameters(given: Row[float, 64], parameters: Out[Parameters]) -> None:"]
    lines += [f"    parameters.{field} = given[{at}]" for at, field in enumerate(fields)]
    driven = source("model_check_drives") if written.drives else ""
    timed = source("in_time_check").replace("TESTED", str(tested(written))) if written.in_time else ""
    check = marked(source("model_check").replace("# GIVEN", "\n".join(lines)), written.parts)
    looped = source("in_time_controller_check") if loop else ""
    of_drives = "\n".join(" " * 8 + part.strip() for part in (driven, timed, looped) if part)
    check = check.replace("# DRIVEN", of_drives.strip())
    values = sample(written)
    _check_apart(written, values)
    shown = "\n".join(
        f"    parameters.{field} = {float(value)!r}" for field, value in zip(fields, values, strict=True)
    ).replace("inf", "HUGE * 2.0")
    text = "\n\n\n".join(
        part.strip("\n")
        for part in (written.text(), loop.text if loop else "", check, _EXAMPLE.replace("# VALUES", shown.strip()))
    )
    unknowns = [*(f"{name}(x, t)" for name in written.fields), *(f"{name}(t)" for name in written.coordinates)]
    summary = f"Frequencies, modes, sensitivities and responses of a model of {', '.join(unknowns)}".replace("\\", "")
    checks = (*model_checks(written, values), *(loop.checks() if loop else ()))
    stack = _STACK.replace("NAME", name.upper())
    stack += f"; {written.signals.stack}" if written.signals and written.signals.free else ""
    return Library(name, summary, text + "\n", stated(model), checks, _readme(written, text), written.real, stack=stack)


def _check_apart(written: ModelText, values: Sequence[float]) -> None:
    """Refuse a structure of parts joined symmetrically: its double frequencies are those of one determinant."""
    structure = written.form.structure
    if max(structure.sizes) > 2 or (structure.linked and len(structure.sizes) + structure.coordinates > 2):
        system = written.model.at(dict(zip(written.names, values, strict=True)))
        omega = system.natural_frequencies(6)
        if (np.diff(omega) <= _SAME * omega[1:]).any():
            raise ValueError(
                "model: is symmetric, with equal frequencies that exported functions give to half the digits only; "
                f"{_INSTEAD}"
            )


_STACK = """\
at most 20 kB, of
which `modes_of` takes half for `NAME_MOST_MODES` = 1000 modes, which may be set to less when compiling
(`-DNAME_MOST_MODES=20`)"""
_EXAMPLE = '''\
def _example(found: Out[Row[float, 3]]) -> None:
    """Return the first natural frequencies, Hz."""
    parameters = Parameters()
    # VALUES
    natural_frequencies(parameters, 3, found)
'''


def _readme(written: ModelText, text: str) -> str:
    units = written.model.units or {}
    rows = "".join(
        f"| `{name}` | {units.get(symbol.name, '')} | {symbol} |\n" for symbol, name in written.names.items()
    )
    drives = f" Prescribed motions, by number: {', '.join(written.drives)}." if written.drives else ""
    lumped = f" Lumped coordinates, in their order: {', '.join(written.coordinates)}." if written.coordinates else ""
    words = (
        "The frequencies are complete: an exact count says how many there are below any omega. The characteristic "
        "function is finite and right below, at and above cut-off frequencies. Fields, by number: "
        f"{', '.join(written.fields)}; displacements of a section: {', '.join(written.displacements)}.{lumped}{drives}"
    )
    table = f"{textwrap.fill(words, 112)}\n\n| parameter | unit | symbol |\n| --- | --- | --- |\n{rows}"
    return table + (in_time_readme(written.signals, text) if written.signals else "")
