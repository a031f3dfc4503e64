"""Inputs and outputs of a system in time, as a user names them."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Generic, Protocol, TypeVar

from cra_sym.analysis.modes import check_kind, only_motion
from cra_sym.checks import shown
from cra_sym.model.observables import Part

if TYPE_CHECKING:
    from sympy import Expr

    from cra_sym.model.lagrangian import Model

__all__ = ["BASE", "FREE", "Input", "Reader", "sequence", "states_of"]

BASE, FREE = "base_acceleration", "drive_force"
_MOST = 1000  # inputs, outputs


class _Parts(Protocol):
    @property
    def parts(self) -> tuple[Part, ...]:
        """What it is the sum of."""


T = TypeVar("T", bound=_Parts)


@dataclass(frozen=True)
class Input(Generic[T]):
    """One input: the acceleration of a motion or of a moving support, a force on a free motion, a load, or a force on a
    displacement.

    Attributes
    ----------
    kind : {'motion', 'support', 'free', 'force', 'displacement'}
    name, label : str
        Of the motion or force, and as the user gave it.
    displacement : sum of parts or None
    """

    kind: str
    name: str
    label: str
    displacement: T | None = None


@dataclass(frozen=True)
class Reader(Generic[T]):
    """Reader of inputs and outputs.

    Attributes
    ----------
    system : System or Model
        What they are of.
    known : mapping of str to sum of parts
        Named quantities.
    local : mapping of str to Expr
        Quantities of a section besides the fields.
    left : float or Expr
        Left end.
    place : callable
        Checks a place, given with the name of the argument, and returns it as a number.
    read : callable
        Returns an expression, given with the name of the argument, as a sum of parts.
    """

    system: Any
    known: Mapping[str, T]
    local: Mapping[str, Expr]
    left: Any
    place: Callable[[str, Any], Any]
    read: Callable[[Any, str], T]

    @property
    def model(self) -> Model:
        """The model."""
        own: Model = getattr(self.system, "model", self.system)
        return own

    def outputs(self, given: Any) -> dict[str, T]:
        """Return the outputs, by name; by default the first field."""
        if given is None:
            tip = next(iter(self.known))
            return {tip: self.known[tip]}
        named = given.items() if isinstance(given, Mapping) else ((None, one) for one in sequence("outputs", given))
        found: dict[str, T] = {}
        for name, one in named:
            own, value = self._output(one)
            name = own if name is None else name
            if not isinstance(name, str) or not name or name in found:
                raise ValueError(f"outputs: {shown(name)} must be a name, and each must be there once")
            found[name] = value
        return found

    def _output(self, given: Any) -> tuple[str, T]:
        if isinstance(given, str) and given in self.known:
            return given, self.known[given]
        if isinstance(given, str) and given in self.local:
            return given, self._at(given, self.left)
        if isinstance(given, tuple) and len(given) == 2 and isinstance(given[0], str):
            return f"{given[0]}({given[1]})", self._at(given[0], self.place("outputs: place", given[1]))
        if isinstance(given, str):
            allowed = ", ".join((*self.known, *self.local))
            raise ValueError(f"outputs = {shown(given)}: must be one of {allowed}, or an expression")
        return str(given), self.read(given, "outputs")

    def _at(self, name: str, place: Any) -> T:
        """Return a field or a quantity of the section at a place."""
        from sympy import Float

        x, fields = self.model.equations.x, self.model.equations.fields
        local = {field.func.__name__: field for field in fields} | dict(self.local)
        if name not in local:
            raise ValueError(f"outputs: {shown(name)} must be one of {', '.join(local)}, which have a place")
        where = place if hasattr(place, "free_symbols") else Float(float(place), 17)
        return self.read(local[name].subs(x, where), "outputs")

    def inputs(self, given: Any) -> list[Input[T]]:
        """Return the inputs."""
        found = [self._input(one) for one in sequence("input", given)]
        if len({one.name for one in found}) < len(found):
            raise ValueError(f"input = {shown(given)}: must name each input once")
        kinds = {one.kind for one in found}
        if "free" in kinds and kinds & {"motion", "force", "support"}:
            raise ValueError(f"input: beside {FREE!r} must be displacements that forces act on")
        return found

    def _input(self, given: Any) -> Input[T]:
        causes = dict(self.system.numerics("causes"))
        if isinstance(given, str) and given in (BASE, FREE):
            motion = only_motion(self.system, support=given == BASE and "support" in causes.values())
            return Input("free" if given == FREE else causes[motion], motion, given)
        name: str = given if isinstance(given, str) else getattr(getattr(given, "func", None), "__name__", "")
        if name in causes and (isinstance(given, str) or len(given.args) == 1):
            check_kind("input", name, causes[name])
            return Input(causes[name], name, name)
        if isinstance(given, str):
            places = [name for name, one in self.known.items() if _is_displacement(one)]
            if given not in places:
                allowed = ", ".join(dict.fromkeys((BASE, FREE, *causes, *places)))
                raise ValueError(f"input = {shown(given)}: must be one of {allowed}, or an expression")
            return Input("displacement", given, given, self.known[given])
        displacement = self.read(given, "input")
        if not _is_displacement(displacement):
            raise ValueError(f"input: {given} must be a displacement that a force acts on, without derivatives by time")
        return Input("displacement", str(given), str(given), displacement)


def states_of(inputs: Sequence[Input[T]], outputs: Mapping[str, T]) -> list[str]:
    """Return the motions that are states: free ones, moving supports, and driven ones that an output shows."""
    base = {one.name for one in inputs if one.kind in ("motion", "free")}
    acting = {one.name for one in inputs if one.kind == "support"}
    parts = [part for one in outputs.values() for part in one.parts]
    seen = {part.name for part in parts if part.kind == "motion" and part.time < 2}
    return sorted(base if any(one.kind == "free" for one in inputs) else (base & seen) | acting)


def sequence(name: str, given: Any) -> Sequence[Any]:
    """Return a single entry or a sequence of entries as a list."""
    several = list(given) if isinstance(given, Sequence) and not isinstance(given, str) else [given]
    if not 0 < len(several) <= _MOST:
        raise ValueError(f"{name} = {shown(given)}: must have 1 to {_MOST} entries")
    return several


def _is_displacement(of: _Parts) -> bool:
    return all(part.kind != "force" and part.time == 0 for part in of.parts)
