"""What a claim's function finds, and the verdict a reader gets."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from dataclasses import astuple, dataclass, field
from functools import partial
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, Literal, get_args

import numpy as np

from cra_sym.checks import equal

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from cra_sym.claims.setting import Setting

__all__ = ["OUTCOMES", "THEMES", "Finding", "Quantity", "Verdict", "outcome"]

Outcome = Literal["holds", "holds where", "contradicted", "undecidable"]
OUTCOMES: tuple[str, ...] = get_args(Outcome)
THEMES = ("modes", "responses", "stability")


@dataclass(frozen=True, eq=False)
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

    def __eq__(self, other: object) -> bool:
        return equal(astuple(self), astuple(other)) if isinstance(other, Quantity) else NotImplemented

    __hash__ = None  # type: ignore[assignment]


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
        ``"region"``, of truth values, is where a claim holds that holds somewhere.
    criterion : str
        What was judged, with every threshold: it holds if that is so everywhere, is contradicted if nowhere.
    remedy : str, optional
        The smallest change that makes the claim true, computed to do so.
    missing : str, optional
        What the text lacks to decide.
    """

    outcome: str
    sentence: str
    evidence: Mapping[str, Quantity]
    criterion: str
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
    outcome, sentence, evidence, criterion, remedy, missing
        As in `Finding`.
    setting : Setting
        Every number that went in.
    picture : callable
        Draws the evidence into axes.
    """

    id: str
    theme: str
    title: str
    claim: str
    source: str
    outcome: str
    sentence: str
    evidence: Mapping[str, Quantity] = field(repr=False)
    criterion: str = field(repr=False)
    setting: Setting = field(repr=False)
    picture: Callable[[Verdict, Axes], None] | None = field(repr=False, compare=False)
    remedy: str | None = None
    missing: str | None = None

    def __post_init__(self) -> None:
        object.__setattr__(self, "evidence", MappingProxyType(dict(self.evidence)))

    def __getitem__(self, name: str) -> np.ndarray:
        """Return the values of one quantity of the evidence."""
        values: np.ndarray = self.evidence[name].values
        return values

    def draw(self, ax: Axes | None = None) -> Figure:
        """Draw the evidence into one pair of axes, by default a new figure in the house style."""
        from cra_sym.claims.pictures import draw_panel

        if self.picture is None:
            raise NotImplementedError(f"claim {self.id} has no picture")
        return draw_panel(partial(self.picture, self), f"{self.id}  {self.title}", self.outcome, ax)

    def as_dict(self) -> dict[str, Any]:
        """Return everything as plain Python values, ready for JSON; what is not finite becomes text."""
        plain = ("id", "theme", "title", "claim", "source", "outcome", "sentence", "criterion", "remedy", "missing")
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
