"""Elastic-slip elements of a model: checks and compilation."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from sympy import Expr, Function, sympify

from cra_sym.checks import shown
from cra_sym.kernels import Kernel, kernel
from cra_sym.mechanics.jets import END_NAMES, HamiltonError, listed, scalar
from cra_sym.model.hysteresis import Element
from cra_sym.model.pieces import undamped

if TYPE_CHECKING:
    from cra_sym.model.lagrangian import Model

__all__ = ["SlipTerms", "check_displacements", "checked_hysteresis", "expressions_of", "forced", "slip_terms"]

_FORCE = "slip_force_"
Triple = tuple[Element, Expr, Any]


def checked_hysteresis(hysteresis: Any) -> tuple[Triple, ...]:
    """Return the triples (element, displacement, place), or raise an error that names an invalid one."""
    found = []
    for number, given in enumerate(listed("hysteresis", () if hysteresis is None else hysteresis)):
        label = f"hysteresis[{number}]"
        try:
            element, displacement, place = given
        except (TypeError, ValueError):
            raise TypeError(f"{label} = {shown(given)}: must be (element, displacement, place)") from None
        if not isinstance(element, Element):
            raise TypeError(f"{label}: {shown(element)} must be a Jenkins or an Iwan")
        if element.shape:
            raise ValueError(
                f"{label}: {shown(element)} holds an array; must be a symbol here, its values are given to model.at"
            )
        if not (place is None or (isinstance(place, str) and place in END_NAMES)):
            if isinstance(place, str):
                raise ValueError(f"{label}: place = {place!r} must be 'left', 'right', an interior place or None")
            place = scalar(f"{label}: place", place)
        found.append((element, scalar(f"{label}: displacement", displacement), place))
    return tuple(found)


def expressions_of(pieces: Mapping[str, Any]) -> tuple[Expr, ...]:
    """Return the parameters of all elements, one after the other, definitions put in."""
    definitions = dict(pieces["definitions"])
    given = (value for element, _, _ in pieces["hysteresis"] for value in element.parameters.values())
    return tuple(sympify(value, strict=True).subs(definitions) for value in given)


def check_displacements(model: Model) -> None:
    """Refuse an element on anything but a displacement of an unknown, or on a displacement that is held."""
    for number, (element, displacement, place) in enumerate(model.pieces["hysteresis"]):
        try:
            forced(model.without_hysteresis, ((element, displacement, place),))
        except HamiltonError as error:
            raise HamiltonError(f"hysteresis[{number}]: {displacement} cannot hold an element; {error}") from None


def forced(base: Model, triples: tuple[Triple, ...]) -> Model:
    """Return the model without dampers, with a force on each displacement, named slip_force_1 and so on."""
    t = base.equations.t
    work = [(Function(f"{_FORCE}{k}")(t), u, place) for k, (_, u, place) in enumerate(triples, 1)]
    return base.replace(virtual_work=[*undamped(base.pieces["virtual_work"], t), *work])


@dataclass(frozen=True)
class SlipTerms:
    """Elastic-slip elements, compiled.

    Attributes
    ----------
    elements : tuple of Element
    parameters : Kernel
        Of the parameters of the model: those of all elements, one after the other.
    displacements : tuple of int
        Number of the displacement of every element.
    forced : Model
        The model without the elements, with a force on each of these displacements.
    forces : tuple of str
        Names of these forces.
    """

    elements: tuple[Element, ...]
    parameters: Kernel
    displacements: tuple[int, ...]
    forced: Model
    forces: tuple[str, ...]

    def at(self, values: Any) -> tuple[Element, ...]:
        """Return the elements in numbers, for values in the order of the model's symbols.

        Raises
        ------
        ValueError
            Names the element and its parameter that is out of its range.
        """
        numbers, found = list(self.parameters.function(*values)), []
        for k, element in enumerate(self.elements):
            changes = {name: numbers.pop(0) for name in element.parameters}
            try:
                found.append(element.replace(**changes))
            except ValueError as error:
                raise ValueError(f"hysteresis[{k}]: {error}") from None
        return tuple(found)


def slip_terms(model: Model) -> SlipTerms:
    """Return the elements of a model, compiled, once; those on the same displacement share it."""
    kept = model.__dict__
    if "_slip_terms" not in kept:
        kept["_slip_terms"] = _compiled(model)
    found: SlipTerms = kept["_slip_terms"]
    return found


def _compiled(model: Model) -> SlipTerms:
    triples = model.pieces["hysteresis"]
    different = list(dict.fromkeys((u, place) for _, u, place in triples))
    moved = forced(model.without_hysteresis, tuple((triples[0][0], u, place) for u, place in different))
    return SlipTerms(
        tuple(element for element, _, _ in triples),
        kernel(expressions_of(model.pieces), model.symbols, backend="numpy"),
        tuple(different.index((u, place)) for _, u, place in triples),
        moved,
        tuple(f"{_FORCE}{k}" for k in range(1, len(different) + 1)),
    )
