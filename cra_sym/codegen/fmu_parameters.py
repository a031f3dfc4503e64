"""The library of a functional mock-up unit whose parameters are those of the model, with the values of a system."""

from __future__ import annotations

import re
import textwrap
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from cra_sym.analysis.state_space import state_space
from cra_sym.arm.parameters import Arm
from cra_sym.codegen.frozen import default_outputs
from cra_sym.codegen.library import Library
from cra_sym.codegen.model_text import ModelText
from cra_sym.codegen.model_time import signals
from cra_sym.codegen.program import new_name
from cra_sym.codegen.statement import stated
from cra_sym.codegen.user_model import model_text
from cra_sym.kernels.callables import executed
from cra_sym.kernels.form import Program
from cra_sym.kernels.form_parse import parse
from cra_sym.model.system import System
from cra_sym.symbols import row

__all__ = ["Parameter", "Unit", "parametric_unit", "reasons"]

_AGREEMENT = 1e-9  # of the printed code with the package, at the start values


@dataclass(frozen=True)
class Parameter:
    """A parameter: its name, field in the code, start value, unit and description."""

    name: str
    field: str
    value: float
    unit: str
    description: str

    @property
    def start(self) -> str:
        """The start value as text."""
        return "INF" if np.isinf(self.value) else repr(self.value)


@dataclass(frozen=True)
class Unit:
    """A library, the names of inputs and outputs, and the parameters, the damping ratio last; none if it is frozen."""

    library: Library
    inputs: tuple[str, ...]
    outputs: tuple[str, ...]
    parameters: tuple[Parameter, ...] = ()


def parametric_unit(system: System, name: str, modes: int, drive: Any, outputs: Any) -> Unit:
    """Return the code of a system for all values of its parameters.

    Raises
    ------
    TypeError, ValueError
        If that is not possible; the message says why.
    """
    given = default_outputs(system, drive) if outputs is None else outputs
    in_time = signals(system.model, drive, given, modes, system.section_quantities)
    assert in_time is not None
    written = model_text(system.model, "float64", in_time)
    statements = [f"Inputs: {', '.join(one.label for one in in_time.inputs)}. Outputs: {', '.join(in_time.outputs)}."]
    lines = (*stated(system.model), *(line for text in statements for line in textwrap.wrap(text, 96)))
    text = f"{written.text().strip()}\n\n\n{_UNTESTED}"
    library = Library(name, "A flexible system to be stepped in real time, with parameters", text, lines, ())
    _check(library, written, system)
    parameters = _parameters(written, system)
    return Unit(library, tuple(one.label for one in in_time.inputs), tuple(in_time.outputs), parameters)


_UNTESTED = '''\
def _evaluate(quantity: int, given: Row[float, 64], found: Mut[Row[float, 256]]) -> None:
    """Compute nothing: a unit has no reference vectors."""
    found[0] = given[quantity]
'''


def _parameters(written: ModelText, system: System) -> tuple[Parameter, ...]:
    units: Mapping[str, str] = written.model.units or {}
    found = []
    for symbol, field in written.names.items():
        name = symbol.name
        words = row(name).meaning if isinstance(system, Arm) else f"parameter {name}"
        found.append(Parameter(name, field, float(system.values[name]), units.get(name, ""), words))
    zeta = new_name("zeta", {one.name for one in found})
    return (*found, Parameter(zeta, "", float(system.zeta), "1", "damping ratio of every mode"))


def _check(library: Library, written: ModelText, system: System) -> None:
    """Raise a ValueError unless the printed code has the poles of the state space of the package."""
    in_time = written.signals
    assert in_time is not None
    names = executed(library.texts("python")[f"{library.name}.py"], f"<cra_sym export {library.name}>")
    given = names["Parameters"](*(float(system.values[symbol.name]) for symbol in written.names))
    plant = names["plant_of"](given, in_time.modes, names["modes_of"](given, in_time.modes), float(system.zeta))
    linear = state_space(system, in_time.modes, *in_time.given)
    half = len(linear.A) // 2
    column = np.linspace(0.5, 1.5, len(linear.A))
    u = np.ones(linear.B.shape[1])
    state = names["State"](list(column[:half]), list(column[half:]))
    found = np.array(names["derivative"](plant, state, list(u)).rate)
    expected = (linear.A @ column + linear.B @ u)[half:]
    size = np.abs(linear.A[half:]) @ column + np.abs(linear.B[half:]) @ u
    if not (np.abs(found - expected) <= _AGREEMENT * size).all():
        raise ValueError("model: its modes are not the same in exported code")


def reasons(library: Library) -> list[str]:
    """Return what each status of the C code means, in words."""
    whole: Program = parse(library.text)
    public = whole.used_by([name for name, f in whole.functions.items() if f.public])
    errors = [re.sub(r"(?<!^)(?=[A-Z])", " ", name).lower() for name in public.errors]
    return ["good", "a missing argument", *errors]
