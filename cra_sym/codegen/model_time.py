"""A model in time: its inputs and outputs, by name or as expressions, as a text in the restricted form."""

from __future__ import annotations

import math
import textwrap
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np
import sympy as sp

from cra_sym.analysis.signals import BASE, FREE, Input, Reader, states_of
from cra_sym.cached import cached_property
from cra_sym.checks import count, real_array
from cra_sym.codegen.library import source
from cra_sym.codegen.operations import operations
from cra_sym.codegen.unused import marked
from cra_sym.kernels.form_parse import parse
from cra_sym.model.derivations import carried_by
from cra_sym.model.observables import Sum, named_sums, sum_of
from cra_sym.model.system import MOST_MODES

if TYPE_CHECKING:
    from cra_sym.model import Model
    from cra_sym.model.system import System

__all__ = ["OUTPUTS", "Shape", "Signals", "TimeText", "in_time_readme", "signals"]

OUTPUTS = ("y", "v", "w", "root_force", "root_moment", "tip_acceleration")
"""Default outputs, if the system has them."""
_MOST_SIGNALS, _MOST_FREE = 64, 64
_INSTEAD = "give system= with the model at its values"


@dataclass(frozen=True)
class Signals:
    """What drives a model in time, and what is measured.

    Attributes
    ----------
    inputs : tuple of Input
    outputs : dict of str to Sum
    states : tuple of str
        Prescribed motions that are states, as :func:`cra_sym.state_space` has them.
    modes : int
        Largest number of modes.
    given : tuple
        Inputs and outputs as given to :func:`cra_sym.state_space`.
    """

    inputs: tuple[Input[Sum], ...]
    outputs: Mapping[str, Sum]
    states: tuple[str, ...]
    modes: int
    given: tuple[Any, Any]

    @property
    def free(self) -> bool:
        """Whether a force moves the base."""
        return any(one.kind == "free" for one in self.inputs)

    @cached_property
    def places(self) -> tuple[float, ...]:
        """Places of fields in outputs and inputs that do not depend on parameters, m."""
        pushed = [one.displacement for one in self.inputs if one.displacement is not None]
        return tuple(
            float(place)
            for one in (*self.outputs.values(), *pushed)
            for part, place in zip(one.parts, one.places, strict=True)
            if part.kind == "field" and sp.sympify(place, strict=True).is_number
        )

    @property
    def reach(self) -> float:
        """Length of an example from zero that has all these places, 0 without any."""
        return 1.25 * max(self.places, default=0.0)

    def are_in(self, system: System) -> bool:
        """Return whether all these places are in the domain of a system."""
        left, length = float(system.domain.left), float(system.domain.length)
        return all(left <= place <= left + length for place in self.places)

    @property
    def stack(self) -> str:
        """What `discretise` takes of the stack, as part of a sentence, if that is much: three square matrices."""
        states = 2 * (len(self.states) + self.modes)
        doubles = 3 * states**2 + states * (2 * len(self.inputs) + 4)
        return f"`discretise` takes {math.ceil(8 * doubles / 1000)} kB" if self.free else ""

    @property
    def accelerated(self) -> bool:
        """Whether an output has accelerations of coordinates."""
        return any(
            part.time == 2 and (part.kind != "motion" or part.name in self.states)
            for one in self.outputs.values()
            for part in one.parts
        )


def signals(
    model: Model, drive: Any, outputs: Any, modes: int, local: Mapping[str, sp.Expr] | None = None
) -> Signals | None:
    """Return inputs and outputs of a model; None if no input is given and the model has none of its own.

    Parameters
    ----------
    model : Model
    drive, outputs
        As :func:`cra_sym.state_space` takes them, or None.
    modes : int
        Largest number of modes.
    local : mapping of str to Expr, optional
        Further quantities of a section, as expressions in x.

    Raises
    ------
    TypeError, ValueError
        As :func:`cra_sym.state_space`; for moving supports; and beyond 64 inputs or outputs, or 64 modes with
        'drive_force'.
    """
    modes = count("modes", modes, high=MOST_MODES)
    if drive is None:
        causes = dict(model.numerics("causes"))
        own = [name for name, kind in causes.items() if kind == "motion"] or list(causes)
        if len(own) != 1 or causes[own[0]] not in ("motion", "force"):
            if outputs is not None:
                raise ValueError("outputs: give input= too")
            return None
        drive = BASE if causes[own[0]] == "motion" else own[0]
    known = named_sums(model)
    if outputs is None:
        outputs = [name for name in OUTPUTS if name in known] or None
    left, right = model.equations.domain
    low, high = float(left) if left.is_number else -np.inf, float(right) if right.is_number else np.inf
    reader = Reader(
        model, known, local or {}, left,
        lambda label, given: float(real_array(label, given, low=low, high=high, unit="m")),
        lambda given, argument: sum_of(model, given, argument),
    )  # fmt: skip
    inputs, found = reader.inputs(drive), reader.outputs(outputs)
    supports = [one.label for one in inputs if one.kind == "support"]
    if supports:
        raise ValueError(f"input = {supports[0]!r}: must not act by its displacement or velocity; {_INSTEAD}")
    for name, several in (("input", inputs), ("outputs", found)):
        if len(several) > _MOST_SIGNALS:
            raise ValueError(f"{name}: must be at most {_MOST_SIGNALS}, there are {len(several)}")
    made = Signals(tuple(inputs), found, tuple(states_of(inputs, found)), modes, (drive, outputs))
    if made.free and modes > _MOST_FREE:
        raise ValueError(f"modes = {modes}: must be at most {_MOST_FREE} with {FREE!r}; {_INSTEAD}")
    return made


Shape = tuple[int, int, sp.Expr]
"""A field by number, the order of its derivative by x, and the place."""


class Writer(Protocol):
    """What the part about time needs of the text of a model, to which `parameters` are the parameters."""

    @property
    def model(self) -> Model:
        """The model."""

    def call(self, name: str, entries: Sequence[sp.Expr], row: str, words: str) -> tuple[str, list[str]]:
        """Return a function of the parameters, and the statements that fill a row with its results."""

    def shape(self, field: int, place: str, order: int) -> str:
        """Return the call for a derivative of a field of a mode."""

    def force(self, end: int, entry: int) -> tuple[str, Shape | None]:
        """Return the natural force of an end, or the factor of a derivative of a field that it is a multiple of."""

    def participation(self, motion: str) -> str:
        """Return that of a mode."""

    def push(self, force: str) -> str:
        """Return the effect of a force on a mode."""


@dataclass(frozen=True)
class TimeText:
    """Writes the part of the text of a model that is about time.

    Attributes
    ----------
    written : Writer
    signals : Signals
    kind : {'TIMED', 'ARM'}
        Whether the modes are those of a model, or of the arm.
    """

    written: Writer
    signals: Signals
    kind: str = "TIMED"

    @property
    def parts(self) -> set[str]:
        """Labels of the optional lines that it needs."""
        found = {"FREE": self.signals.free, "HELD": not self.signals.free, "ACCELERATED": self.signals.accelerated}
        return {self.kind, *(mark for mark, wanted in found.items() if wanted)}

    @cached_property
    def text(self) -> str:
        """The text, without marks of optional lines of the model."""
        steps = source("in_time_free" if self.signals.free else "in_time_held")
        gains = "\n\n\n".join([*self._numbers[0], self._motions(), self._gains()])
        whole = source("in_time").replace("# STEPS", steps.strip("\n")).replace("# GAINS_OF", gains)
        parts = [self.constants(), source("sampling"), source("shaping"), marked(whole, self.parts)]
        return "\n\n\n".join(part.strip("\n") for part in parts)

    def constants(self) -> str:
        """Return the sizes."""
        signals = self.signals
        bases, inputs, outputs = len(signals.states), len(signals.inputs), len(signals.outputs)
        dofs = bases + signals.modes
        found = {
            "IN_TIME": (signals.modes, "modes in time, at most"),
            "BASES": (bases, f"prescribed motions that are states: {', '.join(signals.states) or 'none'}"),
            "DOFS": (dofs, "coordinates in time, at most"),
            "CHANNELS": (inputs, f"inputs: {', '.join(one.label for one in signals.inputs)}"),
            "SIGNALS": (outputs, f"outputs: {', '.join(signals.outputs)}"),
            "PUSHES": (inputs * dofs, "effects of inputs on coordinates"),
            "GAINS": (outputs * dofs, "effects of coordinates on outputs"),
            "THROUGHS": (outputs * inputs, "effects of inputs on outputs"),
        }
        if signals.free:
            found |= {
                "STATES": (2 * dofs, "coordinates and their rates"),
                "SQUARES": (4 * dofs * dofs, "of this number"),
                "STATE_INPUTS": (2 * dofs * inputs, "effects of inputs on states"),
            }
        return "\n".join(f"{name} = {value}  # {words}" for name, (value, words) in found.items())

    # Gains ------------------------------------------------------------------------------------------------------------

    @cached_property
    def _sums(self) -> list[Sum]:
        """Outputs, then displacements that inputs act on."""
        pushed = [one.displacement for one in self.signals.inputs if one.displacement is not None]
        return [*self.signals.outputs.values(), *pushed]

    @cached_property
    def _numbers(self) -> tuple[list[str], list[str], dict[sp.Expr, int]]:
        """Functions of all factors and places, the lines that call them, and the number of each of these."""
        wanted: dict[sp.Expr, int] = {}
        for one in self._sums:
            forces = [self.written.force(part.end, part.entry)[1] for part in one.parts if part.kind == "force"]
            for expression in (*one.factors, *one.places, *(there[2] for there in forces if there)):
                wanted.setdefault(sp.sympify(expression, strict=True), len(wanted))
        if self.signals.free:
            for expression in carried_by(self.written.model, self.signals.states[0]):
                wanted.setdefault(sp.sympify(expression, strict=True), len(wanted))
        text, lines = self.written.call("factors_of", list(wanted), "number", "Return factors and places of signals.")
        return [text], lines, wanted

    def _factor(self, value: Any) -> str:
        """Return the text of a factor: empty for 1."""
        value = sp.sympify(value, strict=True)
        return "" if value == 1 else f"number[{self._numbers[2][value]}] * "

    def _motions(self) -> str:
        """Return the function of what prescribed motions do."""
        signals, lines = self.signals, list(self._numbers[1])
        dofs = len(signals.states) + signals.modes
        for at, one in enumerate(signals.inputs):
            for base, name in enumerate(signals.states):
                if one.displacement is None and one.name == name:
                    lines.append(f"plant.push[{at * dofs + base}] = 1.0")
                moved = one.displacement if signals.free else None  # a force moves a free base, no prescribed one
                for part, factor in zip(moved.parts, moved.factors, strict=True) if moved else ():
                    if part.kind == "motion" and part.name == name:
                        lines.append(f"plant.push[{at * dofs + base}] += {self._factor(factor)}1.0")
        names = [one.name if one.kind == "motion" else "" for one in signals.inputs]
        for row, output in enumerate(signals.outputs.values()):
            for part, factor in zip(output.parts, output.factors, strict=True):
                if part.kind == "motion" and part.name in signals.states:
                    place = row * dofs + signals.states.index(part.name)
                    lines.append(f"plant.{_RATES[part.time]}[{place}] += {self._factor(factor)}1.0")
                elif part.kind == "motion" and part.time == 2 and part.name in names:
                    place = row * len(names) + names.index(part.name)
                    lines.append(f"plant.through[{place}] += {self._factor(factor)}1.0")
        if signals.free:
            targets = "base_mass", "damping[0]", "stiffness[0]"
            own = carried_by(self.written.model, signals.states[0])
            for target, value in zip(targets, own, strict=True):
                lines.append(f"plant.{target} = number[{self._numbers[2][sp.sympify(value, strict=True)]}]")
        head = "def _put_motions(parameters: Parameters, plant: Mut[Plant]) -> None:"
        return "\n    ".join(
            [head, '"""Put in what prescribed motions do."""', *(lines or ["plant.through[0] += 0.0"])]
        )

    def _gains(self) -> str:
        """Return the function of what a mode does."""
        signals, lines = self.signals, list(self._numbers[1])
        shapes: dict[Shape, str] = {}
        outputs = list(signals.outputs.values())
        body = []
        for row, output in enumerate(outputs):
            for time, term in self._terms(output, shapes):
                body.append(f"plant.{_RATES[time]}[{_at(row)}] += {term}")
        for at, one in enumerate(signals.inputs):
            where = f"plant.push[{_at(at)}]"
            if one.kind == "motion":
                body.append(f"{where} = -{self.written.participation(one.name)}")
            elif one.kind == "force":
                body.append(f"{where} = {self.written.push(one.name)}")
            elif one.displacement is not None:
                body += [f"{where} += {term}" for _, term in self._terms(one.displacement, shapes)]
        if signals.free:
            body.append(f"plant.coupling[at] = {self.written.participation(signals.states[0])}")
        for (field, order, place), name in shapes.items():
            at = self._numbers[2][place]
            lines.append(f"{name} = {self.written.shape(field, f'number[{at}]', order)}")
        if any("groups." in line for line in body):
            lines[:0] = ["groups = Groups()", "groups_of(parameters, groups)"]
        head = "def _put_gains(parameters: Parameters, mode: Mode, at: int, plant: Mut[Plant]) -> None:"
        return "\n    ".join([head, '"""Put in what the mode at a coordinate does."""', *lines, *body])

    def _terms(self, given: Sum, shapes: dict[Shape, str]) -> Iterator[tuple[int, str]]:
        """Yield the derivative by time and the text of each term of a sum that a mode adds to."""
        equations, form = self.written.model.equations, self.written.model.state_form
        for part, factor, place in zip(given.parts, given.factors, given.places, strict=True):
            if part.kind == "force":
                own, there = self.written.force(part.end, part.entry)
                name = "" if there is None else f" * {shapes.setdefault(there, f'shape_{len(shapes)}')}"
                yield part.time, f"{self._factor(factor)}{own}{name}"
            elif part.kind == "coordinate":
                yield part.time, f"{self._factor(factor)}mode.coordinates[{part.entry}]"
            elif part.kind == "field":
                field = list(equations.fields).index(form.displacements[part.entry])
                key = field, part.order, sp.sympify(place, strict=True)
                name = shapes.setdefault(key, f"shape_{len(shapes)}")
                yield part.time, f"{self._factor(factor)}{name}"


def _at(row: int) -> str:
    """Return the place of a coordinate in a row of the gains."""
    return ("at", "DOFS + at")[row] if row < 2 else f"{row} * DOFS + at"


_RATES = ("on_position", "on_rate", "on_acceleration")


def in_time_readme(in_time: Signals, text: str) -> str:
    """Return the part of a README about time."""
    form = parse(text)
    most = {"_size_of(plant)": len(in_time.states) + in_time.modes, "kept": len(in_time.states) + in_time.modes}
    counts = ", ".join(f"`{name}` {operations(form, name, most)}" for name in ("step", "outputs", "derivative"))
    words = (
        f"In time it has up to {in_time.modes} modes: `plant_of` prepares the system of given parameters, `discretise` "
        "exact steps under inputs u that are held, `step` takes one, `outputs` returns y."
    )
    rows = "".join(f"| u[{i}] | `{one.label}` |\n" for i, one in enumerate(in_time.inputs))
    rows += "".join(f"| y[{i}] | `{name}` |\n" for i, name in enumerate(in_time.outputs))
    return (
        f"\n{textwrap.fill(words, 112)}\n\n| in time | |\n| --- | --- |\n{rows}\n"
        f"Floating-point operations of a call with {in_time.modes} modes, at most: {counts}.\n"
    )
