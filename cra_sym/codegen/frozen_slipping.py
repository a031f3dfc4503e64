"""Exported code of a system with elastic-slip elements, its modes frozen as numbers: steps exact between events."""

from __future__ import annotations

import math
import textwrap
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cra_sym.analysis.slipping import linear_beside
from cra_sym.analysis.state_space import state_space
from cra_sym.codegen.controllers import numbers_of
from cra_sym.codegen.frozen import common_checks, default_outputs, exported_state_space
from cra_sym.codegen.library import Check, Library, source
from cra_sym.codegen.operations import operations
from cra_sym.codegen.statement import stated
from cra_sym.kernels.form_parse import parse
from cra_sym.model.system import System
from cra_sym.solvers.motion_terms import Piecewise
from cra_sym.solvers.slip_statics import SlippingModes
from cra_sym.solvers.slipping import ORDER, Cause, SlipStep, Start, fastest, follow

__all__ = ["SlippingNumbers", "slipping_library", "slipping_numbers"]

Array = NDArray[np.float64]
Outputs = Sequence[Any] | Mapping[str, Any]
_MOST = {"coordinates": 64, "places": 16, "elements": 512}
_SINGLE = {
    "float64": "",
    "float32": """
In single precision the reference vectors agree to 1e-3; two events that are very close may change places.
""",
}
_STEPS = 24  # of a motion in the reference vectors
_TELLING = 3  # number of modes in the check whether an end is held by springs alone
_OF_PRECISION = {
    "float64": {
        "REACH": (5.0, "the longest piece of a step times FASTEST"),  # the first term left out is 5^37/37! = 5e-18
        "LEFT_OUT": (1e-17, "of the highest term of a power series, at most"),
        "NEARLY": (1e-12, "relative margin to the slip force of elements that start to slip together"),
        "NOTHING": (1e-9, "velocity relative to the sum of its terms, just after an event, that is rounding"),
        "EPS": (2.0**-52, "rounding"),
        "ROUNDING": (2.0**-48, "of the sum of its terms: what counts as zero of a polynomial"),
    },
    "float32": {
        "REACH": (2.0, "the longest piece of a step times FASTEST"),
        "LEFT_OUT": (1e-9, "of the highest term of a power series, at most"),
        "NEARLY": (1e-5, "relative margin to the slip force of elements that start to slip together"),
        "NOTHING": (1e-4, "velocity relative to the sum of its terms, just after an event, that is rounding"),
        "EPS": (2.0**-23, "rounding"),
        "ROUNDING": (2.0**-19, "of the sum of its terms: what counts as zero of a polynomial"),
    },
}
_ERRORS = {"float64": (1e-9, 1e-12), "float32": (1e-3, 1e-5)}
"""Error of the reference vectors, relative to each value, and to the largest of them."""


@dataclass(frozen=True, eq=False)
class SlippingNumbers:
    """A system with one input and elastic-slip elements; its coordinates are motions that outputs need, then modes.

    Attributes
    ----------
    modes : SlippingModes
        Of one member.
    drive : ndarray, shape (coordinates,)
        Generalised forces under a unit of the input.
    on_position, on_rate : ndarray, shape (outputs, coordinates)
    on_force : ndarray, shape (outputs, places)
        The same on the forces of the elements at each place.
    through : ndarray, shape (outputs,)
        The same on the input.
    names : tuple of str
        Of the outputs.
    given : str
        The input.
    states : tuple of str
        Of the coordinates.
    """

    modes: SlippingModes
    drive: Array
    on_position: Array
    on_rate: Array
    on_force: Array
    through: Array
    names: tuple[str, ...]
    given: str
    states: tuple[str, ...]

    def followed(self, inputs: Array, time: float) -> tuple[Array, Array, Array]:
        """Return outputs, forces of the elements and energies dissipated by them, by the package's own integration.

        Parameters
        ----------
        inputs : ndarray, shape (motions, steps, 2)
            Input at the beginning and at the end of each step, which it goes between straight.
        time : float
            Of a step, s.

        Returns
        -------
        outputs, force, taken : ndarray, shape (outputs or elements, motions)
        """
        count, steps, _ = inputs.shape
        knots: Array = np.arange(steps, dtype=np.float64) * time
        term = Piecewise(np.zeros(1), knots, inputs[..., 0], (inputs[..., 1] - inputs[..., 0]) / time)
        modes, still = self.modes.of(np.zeros(count, np.intp)), np.zeros((len(self.drive), count))
        kept = _Last(modes, still.copy(), still.copy(), np.zeros(modes.slip.shape), np.zeros(modes.slip.shape))
        load = Cause(-np.repeat(self.drive[:, None], count, axis=1), [term])
        follow(modes, [load], Start(still, still), np.full(count, steps * time), kept)
        outputs = self.on_position @ kept.q + self.on_rate @ kept.rate + self.on_force @ modes.total(kept.force)
        return outputs + np.outer(self.through, inputs[:, -1, 1]), kept.force, kept.taken


@dataclass
class _Last:
    """Final states of motions, and energies dissipated by the elements."""

    modes: SlippingModes
    q: Array
    rate: Array
    force: Array
    taken: Array

    def __call__(self, step: SlipStep) -> None:
        own, moves = self.modes.of(step.members), step.span > 0
        way = np.einsum("kdp,kp->dp", step.moved[1:], step.share ** np.arange(1, ORDER + 1)[:, None])[own.where]
        self.taken[:, step.members] += np.where(step.state != 0, step.force * way, 0.0)
        self.force[:, step.members] = step.forces(own)
        q, rate = step.reached()
        self.q[:, step.members[moves]], self.rate[:, step.members[moves]] = q[:, moves], rate[:, moves]


def slipping_numbers(system: System, modes: int, drive: Any, outputs: Outputs | None) -> SlippingNumbers:
    """Return a system with elastic-slip elements in numbers.

    Raises
    ------
    TypeError, ValueError
        As :func:`cra_sym.state_space`; and if the system is nonlinear beside its elements, the base is free, or there
        are more inputs, outputs, coordinates or elements than the exported code takes.
    """
    base = linear_beside(system)
    if outputs is None:
        usual = [one for one in default_outputs(base, drive) or () if (_held(system, one) or (0, 0.0))[1] is not None]
        outputs = usual or state_space(base, 1, drive).output_names
    outputs = outputs if isinstance(outputs, Mapping | list | tuple) else [outputs]
    found = exported_state_space(base, modes, drive, outputs)
    if found.input_names[0] == "drive_force":
        raise ValueError(
            "input = 'drive_force': must be another with elastic-slip elements; make the base a coordinate of the model"
        )
    half, elements = len(found.A) // 2, system.slip_elements(modes)
    rows = np.hstack([np.zeros((len(elements.displacements), half - modes)), elements.displacements])
    sizes = {"coordinates": half, "places": len(rows), "elements": elements.where.size}
    for name, most in _MOST.items():
        if sizes[name] > most:
            raise ValueError(
                f"modes, hysteresis: make {sizes[name]} {name}, must be at most {most}; take fewer modes or a smaller "
                "number of an Iwan"
            )
    omega = np.sqrt(np.diagonal(-found.A[half:, :half]))
    stiffness, slip = (np.reshape(part, (*np.shape(part), 1)) for part in (elements.stiffness, elements.slip))
    slipping = SlippingModes(
        omega[:, None], -found.A[half:, half:, None], rows[..., None], elements.flexibility[..., None],
        elements.where, stiffness, slip,
    )  # fmt: skip
    on_forces = _on_forces(system, modes, outputs, elements.flexibility)
    return SlippingNumbers(
        slipping, found.B[half:, 0], found.C[:, :half], found.C[:, half:], on_forces, found.D[:, 0], found.output_names,
        found.input_names[0], tuple(found.state_names[:half]),
    )  # fmt: skip


def _on_forces(system: System, modes: int, outputs: Outputs, give: Array) -> Array:
    """Return the effect of the element forces on outputs: on accelerations, and on forces of the ends with elements."""
    base, columns = system.without_hysteresis, []
    x, (left, right) = base.model.equations.x, base.model.equations.domain
    for displacement, place in _places(system):
        where = {"left": left, "right": right}[place] if isinstance(place, str) else place
        pushed = displacement if where is None else displacement.subs(x, where)
        columns.append(-state_space(base, modes, pushed, outputs).D[:, 0])
    found = np.stack(columns, axis=1)
    for k, one in enumerate(outputs.values() if isinstance(outputs, Mapping) else outputs):
        held = _held(system, one)
        if held is not None:
            place, spring = held
            if spring is None:
                raise ValueError(
                    f"outputs: {one} is of an end with a mass and an elastic-slip element, which the modes "
                    "cannot separate; leave it out, the state has the force of the element"
                )
            found[k] -= spring * give[place]  # of the modes left out
            found[k, place] += 1.0  # the element acts on the end beside its springs
    return found


def _places(system: System) -> list[tuple[Any, Any]]:
    return list(dict.fromkeys((displacement, place) for _, displacement, place in system.model.pieces["hysteresis"]))


def _held(system: System, output: Any) -> tuple[int, float | None] | None:
    """Return the place of elements where an output is the force of an end, and the stiffness of its springs.

    The latter is None if there are masses too: a force is then not a multiple of the displacement.
    """
    base = system.without_hysteresis
    known = base.numerics("named_observables")
    for part in known[output].parts if isinstance(output, str) and output in known else ():
        if part.kind != "force":
            continue
        there = base.model.state_form.displacements[part.entry], ("left", "right")[part.end]
        if there in _places(system):
            place, several = _places(system).index(there), min(_TELLING, base.most_modes)
            force = base.modes(several).force(part.end, part.entry) * (1.0 if part.end == 0 else -1.0)
            row = system.slip_elements(several).displacements[place]
            spring = float(force @ row / (row @ row))
            alike = np.abs(force - spring * row).max() <= 1e-6 * np.abs(force).max()
            return place, spring if alike else None
    return None


def slipping_library(
    system: System, name: str, modes: int, real: str, drive: Any, outputs: Outputs | None
) -> tuple[Library, str, tuple[str, ...]]:
    """Return a system with elastic-slip elements as a library, with the names of its input and its outputs."""
    numbers = slipping_numbers(system, modes, drive, outputs)
    base = system.without_hysteresis
    omega = base.natural_frequencies(modes)
    values = ", ".join(f"{key} = {float(value)!r}" for key, value in system.values.items())
    statements = [
        f"Elastic-slip elements: {_listed(system)}.",
        f"At {values}; zeta = {float(system.zeta)!r}; {modes} modes.",
    ]
    statements += [f"Input u: {numbers.given}. Outputs y: {', '.join(numbers.names)}."]
    lines = (*stated(base.model), *(line for text in statements for line in textwrap.wrap(text, 96)))
    parts = ("shaping", "slipping", "slipping_check", "frozen_example")
    text = _constants(numbers, omega, real) + "\n\n".join(source(part) for part in parts)
    summary = "A flexible system with elastic-slip elements frozen as numbers, to be stepped in real time"
    checks = (*_checks(numbers, real), *common_checks(omega, real))
    made = Library(
        name, summary, text, lines, checks, _readme(numbers, text) + _SINGLE[real], real, stack=_stack(numbers)
    )
    return made, numbers.given, numbers.names


def _listed(system: System) -> str:
    lines = []
    for element, displacement, place in system.model.pieces["hysteresis"]:
        values = ", ".join(f"{key} = {value}" for key, value in element.parameters.items())
        lines.append(f"{type(element).__name__}({values}) on {displacement}" + (f" at {place}" if place else ""))
    return "; ".join(lines)


def _constants(numbers: SlippingNumbers, omega: Array, real: str) -> str:
    """Return the numbers of a system as a text in the restricted form."""
    modes, coordinates = numbers.modes, len(numbers.drive)
    places, elements = len(modes.rows), len(modes.slip)
    scalars = {
        "PI": (math.pi, "half a turn"),
        "COORDINATES": (coordinates, f"z: {', '.join(numbers.states)}"),
        "PLACES": (places, "displacements that hold elements"),
        "ELEMENTS": (elements, "elastic-slip elements"),
        "SIGNALS": (len(numbers.names), f"outputs: {', '.join(numbers.names)}"),
        "MODES": (len(omega), "modes kept"),
        "MOST_DEGREE": (ORDER, "of a power series"),
        "TERMS": (ORDER + 1, "of a power series"),
        "COORDINATE_TERMS": ((ORDER + 1) * coordinates, "terms of the series of all coordinates"),
        "PLACE_TERMS": ((ORDER + 1) * places, "the same of all places"),
        "COUPLINGS": (places * places, "pairs of places"),
        "FASTEST": (float(fastest(modes, [])[0]), "1/s, above all frequencies"),
        "MOST_PANELS": (500.0, "pieces of a step without events"),
        "MOST_PIECES": (1000 + 10 * elements, "of a step"),
        "MOST_AT_ONCE": (8 * elements, "largest number of events at the same time"),
        "ON_THE_WAY": (1e-3, "share of a piece that is skipped then"),
        "MOST_HALVINGS": (41, "of a piece to isolate an event"),
        "MOST_TURNS": (80, "of Newton's method"),
        **_OF_PRECISION[real],
    }
    rows = {
        "STIFFNESS": (modes.omega[:, 0] ** 2, "1/s^2, of each coordinate"),
        "DAMPING": (modes.damping[..., 0], "1/s, coordinate by coordinate, on all rates"),
        "DRIVE": (numbers.drive, "on each coordinate, of u = 1"),
        "ON_PLACES": (modes.rows[..., 0], "displacements place by place, by the coordinates"),
        "GIVE": (modes.give[..., 0], "m/N, displacements by the forces, of the modes left out"),
        "SPRINGS": (modes.stiffness, "N/m, of each element"),
        "SLIPS": (modes.slip, "N, force at which each element slips"),
        "ON_POSITION": (numbers.on_position, "output by output, on each coordinate"),
        "ON_RATE": (numbers.on_rate, "the same on its rate, s"),
        "ON_FORCE": (numbers.on_force, "the same on the force at each place"),
        "THROUGH": (numbers.through, "the same on u"),
        "FREQUENCIES": (omega, "rad/s, of the modes kept, without the elements"),
    }
    lines = [f"{name} = {value!r}  # {comment}" for name, (value, comment) in scalars.items()]
    lines += [f"PLACE_OF = ({', '.join(map(str, modes.where))},)  # the place of each element"]
    lines += [f"{name} = ({numbers_of(value)},)  # {comment}" for name, (value, comment) in rows.items()]
    return "\n".join([*lines, "", ""])


def _stack(numbers: SlippingNumbers) -> str:
    """Return the stack of the C code: series of coordinates and places, polynomials, a copy of the state."""
    coordinates, places, elements = len(numbers.drive), len(numbers.modes.rows), len(numbers.modes.slip)
    doubles = (ORDER + 1) * (coordinates + 2 * places + 3) + 2 * coordinates + 3 * elements + 2 * places**2 + 128
    return f"about {math.ceil(8 * doubles / 1000)} kB"


def _readme(numbers: SlippingNumbers, text: str) -> str:
    form = parse(text)
    listed = "\n".join(f"| {i} | `{name}` |" for i, name in enumerate(numbers.names))
    counts = ", ".join(
        f"{name} {operations(form, function, {'degree + 1': ORDER + 1})}"
        for name, function in (("`outputs`", "outputs"), ("a power series", "_power_series"))
    )
    words = (
        "`step` and `step_between` locate where elements begin to slip or to stick, and are exact in between; the "
        "state has the force of each element and the energy dissipated by it. A step is a power series for each 5 rad "
        "of the fastest frequency, and one or more for each event; beyond "
        f"{form.constants['MOST_PIECES'].values[0]} the step returns an error, and the state is unchanged. "
        f"Floating-point operations, at most: {counts}."
    )
    return (
        f"The input u is `{numbers.given}`; the outputs, in SI units, are\n\n| entry | output |\n| --- | --- |\n"
        f"{listed}\n\n{textwrap.fill(words, 112)}\n"
    )


def _checks(numbers: SlippingNumbers, real: str) -> Iterator[Check]:
    """Yield outputs, forces and energies by the package's own integration of the motion."""
    modes, (loss, of_all) = numbers.modes, _ERRORS[real]
    rates = modes.omega[modes.omega > 0]
    quickest, slowest = float(fastest(modes, [])[0]), float(np.min(rates, initial=1.0))
    pushes = _pushes(numbers) * np.array([0.05, 1.5, 10.0])
    u = np.where(np.arange(_STEPS) % 3 == 0, 1.0, -0.5) * pushes[:, None]
    inputs = np.concatenate([np.stack([u, u], axis=-1), np.stack([0.3 * u, u], axis=-1)])
    for time in (0.03 / quickest, 2.0 / quickest, min(0.7 / slowest, 60.0 / quickest)):
        yield Check(0, (time, pushes[1], 0), (*(numbers.through * pushes[1]), 0.0, 0.0), loss)
        found = np.vstack(
            [part if k == 0 else part.sum(axis=0) for k, part in enumerate(numbers.followed(inputs, time))]
        )
        for k, values in enumerate(found.T):
            given = time, float(pushes[k % 3]), _STEPS
            yield Check(k // 3, given, tuple(values), loss, of_all * float(np.abs(values).max()))
    for bad in (0.0, -1.0, math.nan, math.inf):
        yield Check(0, (bad, 1.0, 1), (), refused=True)
    yield from (Check(k, (0.03 / quickest, bad, 1), (), refused=True) for k in (0, 1) for bad in (math.nan, math.inf))


def _pushes(numbers: SlippingNumbers) -> float:
    """Return an estimate of the constant input at which the first element slips."""
    modes = numbers.modes
    rows, stiff = modes.rows[..., 0], np.diag(modes.omega[:, 0] ** 2)
    springs = modes.total(modes.stiffness)[:, 0]
    at_rest = np.linalg.pinv(stiff + rows.T @ np.diag(springs) @ rows) @ numbers.drive
    reached = np.abs(rows @ at_rest)[modes.where]
    limits = (modes.slip / modes.stiffness)[:, 0]
    return float(np.min(limits[reached > 0] / reached[reached > 0], initial=np.inf)) if reached.any() else 1.0
