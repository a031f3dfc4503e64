"""The registry of the claims: for each, one function that judges it and one that draws it.

::

    @claimed("C02", "modes", "Section 4, Fig. 3", "f1 to f3 fall with k_t", "with the decreasing of ...")
    def fall_with_k_t(setting):
        ...
        return Finding(judged(region), plain, sentence, evidence, criterion)

    @pictured("C02")
    def draw_fall_with_k_t(verdict, ax):
        ...
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, TypeAlias

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from cra_sym.claims.setting import Setting
    from cra_sym.claims.verdict import Finding, Verdict

__all__ = ["ENTRIES", "RegisteredClaim", "claimed", "pictured"]


Find: TypeAlias = "Callable[[Setting], Finding]"
Draw: TypeAlias = "Callable[[Verdict, Axes], None]"


@dataclass
class RegisteredClaim:
    """A claim, the function that judges it and the one that draws it."""

    id: str
    theme: str
    source: str
    title: str
    claim: str
    find: Find
    picture: Draw | None = None


ENTRIES: dict[str, RegisteredClaim] = {}
"""Claims by id, in the order their modules were imported."""


def claimed(id: str, theme: str, source: str, title: str, words: str) -> Callable[[Find], Find]:
    """Register the decorated function, ``Setting -> Finding``, as the judge of a claim."""

    def register(function: Find) -> Find:
        ENTRIES[id] = RegisteredClaim(id, theme, source, title, words, function)
        return function

    return register


def pictured(id: str) -> Callable[[Draw], Draw]:
    """Register the decorated function, ``(Verdict, Axes) -> None``, as the drawing of the evidence."""

    def register(function: Draw) -> Draw:
        ENTRIES[id].picture = function
        return function

    return register
