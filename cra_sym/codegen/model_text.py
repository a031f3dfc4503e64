"""Program of an exported model in the restricted form: its derived functions in a source common to all models."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import sympy as sp

from cra_sym.cached import cached_property
from cra_sym.codegen.expressions import response_functions
from cra_sym.codegen.library import source
from cra_sym.codegen.model_constants import model_constants
from cra_sym.codegen.model_loads import load_factors
from cra_sym.codegen.model_rates import rate_functions
from cra_sym.codegen.model_time import Signals, TimeText
from cra_sym.codegen.printers import FormPrinter
from cra_sym.codegen.program import function, new_name
from cra_sym.codegen.unused import marked, top_names, without_unused
from cra_sym.codegen.waves_text import WavesText
from cra_sym.model import Model
from cra_sym.model.waves_form import WavesForm

__all__ = ["ModelText"]

_SOURCES = (
    "model", "model_modes", "model_participation", "model_drives", "model_check", "in_time", "in_time_held",
    "in_time_free", "sampling", "shaping", "controller",
)  # fmt: skip
_WRITTEN = {
    "prepare",
    "dispersion",
    "check",
    "parameter",
    "parameter_rates",
    "load_of",
    "inside_entries",
    "outside_entries",
    "factors_of",
    "put_motions",
    "put_gains",
    "control_time",
    "sensors",
    "sensor_outputs",
    "regulator",
    "observer",
}


@dataclass(frozen=True)
class ModelText:
    """Writes the text of a model.

    Attributes
    ----------
    model : Model
    form : WavesForm
    real : {'float64', 'float32'}
    signals : Signals or None
        Inputs and outputs in time, if there are any.
    """

    model: Model
    form: WavesForm
    real: str = "float64"
    signals: Signals | None = None

    @cached_property
    def names(self) -> dict[sp.Symbol, str]:
        """The field of every parameter."""
        taken = top_names(*(source(name) for name in _SOURCES), self._constants(), self._formulas) | _WRITTEN
        taken |= {f"by_{symbol.name}" for symbol in self.model.symbols} | {f"load_of_{name}" for name in self.loads}
        taken |= top_names(self.in_time.constants()) if self.in_time else set()
        return {symbol: new_name(symbol.name, taken) for symbol in self.model.symbols}

    @cached_property
    def drives(self) -> list[str]:
        """Prescribed motions that act by their acceleration."""
        return [name for name, kind in self.model.numerics("causes") if kind == "motion"]

    @cached_property
    def forces(self) -> list[str]:
        """Forces of the model that drive it in time."""
        return [one.name for one in self.signals.inputs if one.kind == "force"] if self.signals else []

    @property
    def loads(self) -> list[str]:
        """Prescribed motions, then these forces."""
        return [*self.drives, *self.forces]

    @cached_property
    def in_time(self) -> TimeText | None:
        """Writer of the part about time."""
        return TimeText(self, self.signals) if self.signals else None

    @cached_property
    def fields(self) -> list[str]:
        """Names of the fields."""
        return [field.func.__name__ for field in self.model.equations.fields]

    @cached_property
    def displacements(self) -> list[str]:
        """Displacements of a section, in the order of the text."""
        found = self.model.conservative.displacements
        return [_plain(found[at]) for at in self.form.order]

    @cached_property
    def coordinates(self) -> list[str]:
        """Names of the lumped coordinates."""
        return [str(coordinate.func.__name__) for coordinate in self.model.conservative.coordinates]

    @cached_property
    def held(self) -> list[int]:
        """Dependent or held degrees of freedom (displacements of the left end, of the right end, coordinates)."""
        return [place for place in range(self.form.structure.moving) if place not in self.form.conditions.free]

    @cached_property
    def parts(self) -> set[str]:
        """Labels of the optional lines of the text that this model needs."""
        size, mass = self.form.structure.moving, self.form.conditions.mass
        coupled = any(mass[i, j] != 0 for i in range(size) for j in range(size) if i != j)
        found = {
            "DRIVEN": self.drives,
            "FORCED": self.forces,
            "LOADED": self.loads,
            "TIMED": self.signals,
            "LUMPED": self.coordinates,
            "LINKED": self.form.structure.links,
            "COUPLED": coupled,
        }
        return {mark for mark, wanted in found.items() if wanted}

    @cached_property
    def waves(self) -> WavesText:
        """Writer of the functions of the waves."""
        return WavesText(self.form.structure, self.form.known)

    # The whole --------------------------------------------------------------------------------------------------------

    def text(self) -> str:
        """Return the text."""
        modes = source("model_modes")
        for word in ("displacements", "coordinates", "drives", "forces"):
            modes = modes.replace(f"{word.upper()}_LISTED", ", ".join(getattr(self, word)))
        modes = modes.replace("# LOADINGS", self._loads() if self.loads else "")
        parts = [self._constants(), self._parameters(), source("model"), rate_functions(self), modes]
        if self.drives:
            parts += ["".join(f"{self._function(f, f'_{f.name}')}\n\n" for f in response_functions())]
            parts += [source("model_drives")]
        if self.in_time:
            parts += [self.in_time.text]
        whole = marked("\n\n\n".join(part.strip("\n") for part in parts) + "\n", self.parts)
        whole = whole.replace("# FORMULAS", self._formulas).replace("# PREPARE", self._prepare())
        return without_unused(FormPrinter.helped(whole) + whole)

    def _constants(self) -> str:
        displacements = list(self.model.conservative.displacements)
        places = [self.form.order.index(displacements.index(field)) for field in self.model.equations.fields]
        return self.waves.constants() + model_constants(
            self.form,
            len(self.model.symbols),
            self.fields,
            (self.drives, self.forces),
            self.coordinates,
            places,
            self.real,
        )

    def _parameters(self) -> str:
        lines = [
            "class Parameters:",
            '    """The parameters of the model, in consistent units, such as SI."""',
            "",
        ]
        for symbol, name in self.names.items():
            unit = self.model.units.get(symbol.name, "") if self.model.units else ""
            own = f"{symbol.name} of the model" if name != symbol.name and symbol.name.isidentifier() else ""
            infinite = "may be infinite" if symbol in self.form.conditions.springs else ""
            words = ", ".join(filter(None, [own, unit, infinite]))
            lines.append(f"    {name}: float{'  # ' + words if words else ''}")
        return "\n".join(lines)

    @cached_property
    def _formulas(self) -> str:
        waves = self.waves
        return "\n\n".join([waves.functions(loads=bool(self.loads)), waves.static(), waves.sections()]).strip("\n")

    # Parameters to coefficients ---------------------------------------------------------------------------------------

    def _function(self, made: object, name: str) -> str:
        return FormPrinter.text_of(made, name, checked=False)  # type: ignore[arg-type]

    def call(self, name: str, entries: Sequence[sp.Expr], row: str, words: str) -> tuple[str, list[str]]:
        """Return a function of the parameters, and the statements that fill a row with its results."""
        made = function(name, words, list(entries), self._given(_free(entries)))
        given = [f"parameters.{self.names[argument.symbols[0]]}" for argument in made.arguments]
        call = f"_{name}({', '.join([*given, row])})"
        return self._function(made, f"_{name}"), [f"{row} = zeros({len(entries)})", call]

    def _given(self, symbols: set[sp.Symbol]) -> list[tuple[str, sp.Symbol]]:
        """Return parameters as arguments, in their order."""
        return [(name, symbol) for symbol, name in self.names.items() if symbol in symbols]

    @cached_property
    def _length(self) -> sp.Expr:
        left, right = self.model.equations.domain
        return sp.sympify(right - left, strict=True)

    @cached_property
    def entries(self) -> dict[int, sp.Expr]:
        """Entries of the matrices times half the length, by their number among the coefficients, that are not 0."""
        n = self.form.structure.n
        found = {}
        for at, entry in enumerate(self.form.matrices):  # A_OE and A_EO, then their factors of z
            power, rest = divmod(at, 2 * n * n)
            matrix, place = divmod(rest, n * n)
            if entry != 0:
                found[self.form.structure.matrices[matrix] + power * n * n + place] = entry * self._length / 2
        return found

    @cached_property
    def ends(self) -> dict[str, sp.Expr]:
        """Entries of the matrices of both ends and coordinates, and of links, that are not 0."""
        structure, ends = self.form.structure, self.form.conditions
        size, m = structure.moving, structure.coordinates
        found = {
            f"{name}[{at}]": matrix[at]
            for name, matrix in (("stiffness", ends.stiffness), ("mass", ends.mass), ("ties", ends.ties))
            for at in range(size**2)
        }
        for link in range(structure.links):
            found |= {f"link_{kind}[{link}]": ends.links[link, at] for at, kind in enumerate(("stiffness", "mass"))}
            found |= {f"stretch[{link * size + at}]": ends.links[link, 2 + at] for at in range(size)}
        found |= {f"carried[{at}]": ends.carried[at] for at in range(structure.n * m)}
        return {target: entry for target, entry in found.items() if entry != 0}

    def _prepare(self) -> str:
        """Return the functions that check the parameters and prepare the problem."""
        left, _ = self.model.equations.domain
        places = self.waves.places
        texts, lines = [], ["_check(parameters)"]
        lines += [f"problem.held[{place}] = 1" for place in self.held]
        moving = self.form.structure.moving
        for symbol, acting in self.form.conditions.springs.items():
            if any(place < moving for place in acting):
                lines.append(f"if parameters.{self.names[symbol]} > HUGE:")
                lines += [f"    problem.held[{place}] = 1" for place in acting if place < moving]
        groups = (
            ("inside", {f"k[{places[at]}]": entry for at, entry in self.entries.items() if at in places},
             "Return the matrices of a section times half the length, entry by entry."),
            ("outside", {"length": self._length, "left": sp.sympify(left, strict=True)} | self.ends,
             "Return the length, the left end, and stiffness, inertia, ties and links of what moves."),
        )  # fmt: skip
        for name, entries, words in groups:
            text, call = self.call(f"{name}_entries", list(entries.values()), name, words)
            texts.append(text)
            lines += call
            lines += [f"problem.{target} = {name}[{at}]" for at, target in enumerate(entries)]
        released = ["_release_links(problem)"] if self.form.structure.links else []
        lines += ["_check_ends(problem)", *released, *self._condition_lines()]
        table, filled = self.waves.dispersion()
        texts.append(table)
        lines += [f"table = zeros({len(filled)})", "_dispersion(problem.k, table)"]
        lines += [f"problem.k[{place}] = table[{at}]" for at, place in enumerate(filled)]
        lines += [
            "for i in range(COEFFICIENTS):",
            "    if not isfinite(problem.k[i]):",
            '        raise Overflow("the parameters lead out of the range of numbers")',
            "if _indefinite(problem.k) > 0.5:",
            '    raise InvalidParameters("stiffness and mass along the length must not be negative")',
            "problem.zeros_at_rest = _rigid_motions(problem)",
            "_check_stable(problem)",
        ]
        head = "def _prepare(parameters: Parameters, problem: Out[Problem]) -> None:"
        texts.append(self._check())
        texts.append("\n    ".join([head, '"""Check the parameters and compute what all else starts from."""', *lines]))
        return "\n\n".join(texts)

    def _condition_lines(self) -> Iterator[str]:
        """Yield statements that enter the factors of all conditions, over 1 + stiffness + mass."""
        structure, places = self.form.structure, self.waves.places
        for place in range(structure.places):
            found = []
            for at, value in enumerate(self._condition(place), start=structure.condition(place)):
                if at in places:
                    found.append(f"problem.k[{places[at]}] = {value}")
            link, own = place - structure.moving, place * (structure.moving + 1)
            kinds = ("stiffness", "mass")
            stiff, heavy = wanted = [f"link_{kind}[{link}]" if link >= 0 else f"{kind}[{own}]" for kind in kinds]
            parts = "".join(f" + problem.{entry}" for entry in wanted if entry in self.ends)
            if not parts:  # of one that is 1
                found = [line.replace(" * share", "").replace("share", "1.0") for line in found]
            elif any("share" in line for line in found):
                yield f"share_{place} = 1.0 / (1.0{parts})"
                if link >= 0 and stiff in self.ends:
                    yield f"pull_{place} = 1.0 if problem.{stiff} > HUGE else problem.{stiff} * share_{place}"
                if link >= 0 and heavy in self.ends:
                    yield f"inertia_{place} = problem.{heavy} * share_{place}"
            yield from (re.sub(r"\b(share|pull|inertia)\b", rf"\1_{place}", line) for line in found)

    def _condition(self, place: int) -> Iterator[str]:
        """Yield the factors of a condition: of displacements, of -z times these and of forces, with reflected signs."""
        structure = self.form.structure
        size, link, reach = structure.moving, place - structure.moving, structure.reach(place)

        def signed(other: int, name: str, at: int, minus: bool = False) -> str:
            turned = structure.turned[place] * structure.turned[other] < 0.0
            return f"{'-' if turned != minus else ''}problem.{name}[{at}]"

        for other in reach:
            at = place * size + other
            if link >= 0:
                yield f"{signed(other, 'stretch', link * size + other, True)} * pull"
            elif place in self.held:
                yield "1.0" if other == place else signed(other, "ties", at, True)
            elif other == place:
                yield f"1.0 if problem.stiffness[{at}] > HUGE else problem.stiffness[{at}] * share"
            else:
                yield f"{signed(other, 'stiffness', at)} * share"
        for other in reach:
            if link >= 0:
                yield f"{signed(other, 'stretch', link * size + other, True)} * inertia"
            else:
                yield f"{signed(other, 'mass', place * size + other)} * share"
        for other in structure.forces(place):
            if other == place:
                yield "share"
            elif other < size:
                yield f"{signed(other, 'ties', other * size + place)} * share"
            else:
                yield f"{signed(other, 'stretch', (other - size) * size + place)} * share"

    def _check(self) -> str:
        lines = ['"""Refuse what is not a number, infinite, or a divisor that is 0."""']
        for symbol, name in self.names.items():
            if symbol in self.form.conditions.springs:
                lines.append(f"if not (parameters.{name} >= -HUGE):")
                lines.append(f'    raise InvalidParameters("{name}: must be a number or infinity")')
            else:
                lines.append(f"if not isfinite(parameters.{name}):")
                lines.append(f'    raise InvalidParameters("{name}: must be finite")')
        texts = []
        for number, divisor in enumerate(self._divisors()):
            if divisor.is_Symbol:
                value, words = f"parameters.{self.names[divisor]}", f"{self.names[divisor]}: must not be 0"
            else:
                made = function("divisor", "Return a divisor.", divisor, self._given(divisor.free_symbols))
                texts.append(self._function(made, f"_divisor_{number}"))
                given = ", ".join(f"parameters.{self.names[a.symbols[0]]}" for a in made.arguments)
                value, words = f"_divisor_{number}({given})", "a coefficient of the equations becomes infinite"
            lines += [f"if {value} == 0.0:", f'    raise InvalidParameters("{words}")']
        return "\n\n".join([*texts, "\n    ".join(["def _check(parameters: Parameters) -> None:", *lines])]) + "\n"

    def _divisors(self) -> list[sp.Expr]:
        """Return the divisors in the coefficients."""
        found: dict[sp.Expr, None] = {}
        left, _ = self.model.equations.domain
        for entry in (*self.entries.values(), *self.ends.values(), self._length, sp.sympify(left, strict=True)):
            for power in sp.ordered(sp.sympify(entry, strict=True).atoms(sp.Pow)):
                if power.exp.is_negative or power.exp.could_extract_minus_sign():
                    for factor in sp.Mul.make_args(power.base):
                        found |= {} if factor.is_number else {factor: None}
        return list(found)

    # In time ----------------------------------------------------------------------------------------------------------

    def shape(self, field: int, place: str, order: int) -> str:
        """Return the call for a derivative of a field of a mode."""
        return f"mode_shape(parameters, mode, {field}, {place}, {order})"

    def force(self, end: int, entry: int) -> tuple[str, None]:
        """Return the natural force of an end of a mode."""
        return f"mode.{('left', 'right')[end]}_force[{self.form.order.index(entry)}]", None

    def participation(self, motion: str) -> str:
        """Return that of a mode."""
        return f"mode.participation[{self.drives.index(motion)}]"

    def push(self, force: str) -> str:
        """Return the effect of a force on a mode."""
        return f"mode.push[{self.forces.index(force)}]"

    # Drives -----------------------------------------------------------------------------------------------------------

    def _loads(self) -> str:
        """Return the function of a load, and the one of its modal force."""
        texts: list[str] = []
        lines: list[str] = []
        for number, name in enumerate(self.loads):
            factors = load_factors(self.model, self.form, self._length, name)
            entries = {at: value for at, value in enumerate(factors) if value != 0}
            text, call = self.call(f"load_of_{name}", list(entries.values()), f"load_{number}",
                                    f"Return the load of a unit acceleration of {name}.")  # fmt: skip
            texts.append(text)
            lines.append(f"{'el' if number else ''}if drive == {number}:")
            lines += [f"    {line}" for line in call]
            lines += [f"    load[{at}] = load_{number}[{row}]" for row, at in enumerate(entries)]
        head = "def _load_of(parameters: Parameters, drive: int, load: Mut[Row[float, LOADS]]) -> None:"
        words = '"""Put in the forces of a unit acceleration: at the left end, at the right one, and per length."""'
        return "\n\n\n".join([*texts, "\n    ".join([head, words, *lines]), source("model_participation").strip("\n")])


def _plain(displacement: sp.Expr) -> str:
    """Return a field, or a derivative of one by x, as text."""
    if isinstance(displacement, sp.Derivative):
        return str(displacement.expr.func.__name__) + "'" * sum(int(count) for _, count in displacement.variable_count)
    return str(displacement.func.__name__)


def _free(entries: Sequence[sp.Expr]) -> set[sp.Symbol]:
    return set().union(*(sp.sympify(entry, strict=True).free_symbols for entry in entries))
