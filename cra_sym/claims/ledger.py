"""The ledger: what the paper states, and the verdict the package computes on each statement.

A theme's module writes one function a claim, which computes a `Finding`, and one that draws it::

    @claimed("C02", "modes", "Section 4, Fig. 3", "f1 to f3 fall with k_t", "with the decreasing of ...")
    def falls(setting):
        ...
        return Finding(outcome(region), sentence, evidence)

    @pictured("C02")
    def _(verdict, ax):
        ...
"""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import cache
from importlib import import_module
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, Literal, get_args

import numpy as np

from cra_sym.claims.setting import Setting

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from cra_sym.arm.parameters import Arm

__all__ = ["OUTCOMES", "THEMES", "Finding", "Quantity", "Verdict", "claim", "claimed", "claims", "outcome", "pictured"]

Outcome = Literal["holds", "holds where", "contradicted", "undecidable"]
OUTCOMES: tuple[str, ...] = get_args(Outcome)
THEMES = ("modes", "responses", "stability")

_HOMES = ("modes", "sensitivity", "responses", "comparisons", "stability", "zones")


@dataclass(frozen=True)
class Quantity:
    """An array of the evidence.

    Attributes
    ----------
    values : ndarray
        Read-only; anything array-like may be given.
    unit : str
        ``"1"`` for pure numbers and for truth values.
    meaning : str
        What the numbers are, and along which other quantities its axes run.
    """

    values: Any
    unit: str
    meaning: str

    def __post_init__(self) -> None:
        values = np.array(self.values)
        values.flags.writeable = False
        object.__setattr__(self, "values", values)


@dataclass(frozen=True)
class Finding:
    """What the function of a claim returns.

    Attributes
    ----------
    outcome : str
        One of `OUTCOMES`.
    sentence : str
        The verdict in words, with the computed numbers.
    evidence : mapping of Quantity
    remedy : str, optional
        The smallest change that makes the claim true, computed to do so.
    missing : str, optional
        What the text lacks to decide.
    """

    outcome: str
    sentence: str
    evidence: Mapping[str, Quantity]
    remedy: str | None = None
    missing: str | None = None


@dataclass(frozen=True)
class Verdict:
    """A claim of the paper and what the computation says about it.

    Attributes
    ----------
    id, theme, title : str
    claim : str
        In the paper's words.
    source : str
        Where the paper says so.
    outcome, sentence, evidence, remedy, missing
        As in `Finding`.
    setting : Setting
        Every number that went in.
    """

    id: str
    theme: str
    title: str
    claim: str
    source: str
    outcome: str
    sentence: str
    evidence: Mapping[str, Quantity] = field(repr=False)
    setting: Setting = field(repr=False)
    remedy: str | None = None
    missing: str | None = None

    def __getitem__(self, name: str) -> np.ndarray:
        """Return the values of one quantity of the evidence."""
        return self.evidence[name].values

    def draw(self, ax: Axes | None = None) -> Figure:
        """Draw the evidence into one pair of axes, by default a new figure in the house style."""
        from cra_sym.claims.pictures import draw_verdict

        return draw_verdict(self, _entry(self.id).picture, ax)

    def as_dict(self) -> dict[str, Any]:
        """Return everything as plain Python values, ready for JSON; what is not finite becomes text."""
        plain = ("id", "theme", "title", "claim", "source", "outcome", "sentence", "remedy", "missing")
        evidence = {
            name: {"values": _plain(q.values), "unit": q.unit, "meaning": q.meaning}
            for name, q in self.evidence.items()
        }
        return {**{name: getattr(self, name) for name in plain}, "evidence": evidence}

    def _repr_markdown_(self) -> str:
        lines = [f"**{self.id} {self.outcome}.** {self.sentence}", f"> {self.claim} ({self.source})"]
        lines += [f"*Smallest change that reproduces the paper:* {self.remedy}"] if self.remedy else []
        lines += [f"*Missing:* {self.missing}"] if self.missing else []
        return "\n\n".join(lines)


def _plain(values: np.ndarray) -> Any:
    if values.dtype.kind != "f":
        return values.tolist()
    return json.loads(
        json.dumps(values.tolist()).replace("NaN", '"nan"').replace("-Infinity", '"-inf"').replace("Infinity", '"inf"')
    )


def outcome(*parts: Any) -> str:
    """Judge a claim that all ``parts`` must meet, each an array that tells where it does.

    >>> outcome([True, True]), outcome([True, False]), outcome([True, True], [False, False])
    ('holds', 'holds where', 'contradicted')
    """
    arrays = [np.asarray(part, dtype=bool) for part in parts]
    if not all(part.any() for part in arrays):
        return "contradicted"
    return "holds" if all(part.all() for part in arrays) else "holds where"


@dataclass
class _Entry:
    id: str
    theme: str
    source: str
    title: str
    claim: str
    find: Callable[[Setting], Finding]
    picture: Callable[[Verdict, Axes], None] | None = None


_LEDGER: dict[str, _Entry] = {}


def claimed(id: str, theme: str, source: str, title: str, words: str) -> Callable:
    """Register the decorated function, ``Setting -> Finding``, as the judge of a claim."""

    def register(function: Callable[[Setting], Finding]) -> Callable[[Setting], Finding]:
        _LEDGER[id] = _Entry(id, theme, source, title, words, function)
        return function

    return register


def pictured(id: str) -> Callable:
    """Register the decorated function, ``(Verdict, Axes) -> None``, as what draws the evidence."""

    def register(function: Callable[[Verdict, Axes], None]) -> Callable[[Verdict, Axes], None]:
        _LEDGER[id].picture = function
        return function

    return register


@cache
def _load() -> tuple[str, ...]:
    """Import the modules of the claims; return the claims in order."""
    for home in _HOMES:
        import_module(f"cra_sym.claims.{home}")
    return tuple(sorted(_LEDGER))


def _entry(id: str) -> _Entry:
    if id not in _load():
        raise ValueError(f"claim = {id!r}: allowed are {', '.join(_load())}")
    return _LEDGER[id]


@cache
def _verdict(id: str, setting: Setting) -> Verdict:
    entry = _entry(id)
    found = entry.find(setting)
    if found.outcome not in OUTCOMES:
        raise ArithmeticError(f"{id}: outcome {found.outcome!r} is none of {', '.join(OUTCOMES)}")
    return Verdict(
        id=id,
        theme=entry.theme,
        title=entry.title,
        claim=entry.claim,
        source=entry.source,
        outcome=found.outcome,
        sentence=" ".join(found.sentence.split()),
        evidence=MappingProxyType(dict(found.evidence)),
        setting=setting,
        remedy=found.remedy,
        missing=found.missing,
    )


def claim(id: str, arm: Arm | None = None, **numbers: Any) -> Verdict:
    """Return the verdict on one claim.

    Parameters
    ----------
    id : str
        ``"C01"``, ``"C02"`` and so on.
    arm : Arm, optional
        By default the nominal one.
    **numbers
        Fields of `Setting` to change: the base's motion, the series of stiffnesses, the thresholds.

    Returns
    -------
    Verdict
        Computed once for each setting.

    Raises
    ------
    TypeError, ValueError
        If there is no such claim or field, or a value is not allowed.

    Examples
    --------
    >>> claim("C02").outcome
    'holds'
    """
    _entry(id)
    return _verdict(id, Setting.of(arm, **numbers))


def claims(arm: Arm | None = None, *, theme: str | None = None, **numbers: Any) -> tuple[Verdict, ...]:
    """Return the verdicts on all claims, or on those of one theme; arguments as for :func:`claim`."""
    if theme is not None and theme not in THEMES:
        raise ValueError(f"theme = {theme!r}: allowed are {', '.join(THEMES)}")
    setting = Setting.of(arm, **numbers)
    return tuple(_verdict(id, setting) for id in _load() if theme in (None, _LEDGER[id].theme))
