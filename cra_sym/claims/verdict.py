"""Findings of the functions of claims, and verdicts for the reader."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import partial
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, Literal, get_args

import numpy as np

from cra_sym.checks import ByValue

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from cra_sym.claims.setting import Setting

__all__ = ["OUTCOMES", "THEMES", "EvidenceArray", "Finding", "Judgement", "Verdict", "judged"]

Outcome = Literal["holds", "mostly holds", "rarely holds", "contradicted", "undecidable"]
OUTCOMES: tuple[Outcome, ...] = get_args(Outcome)
MOSTLY = 0.5
"""Share of the cases above which a claim mostly holds, and below which it rarely holds."""
THEMES = ("modes", "responses", "stability")


@dataclass(frozen=True, eq=False)
class EvidenceArray(ByValue):
    """An array of the evidence.

    Attributes
    ----------
    values : ndarray
        Read-only; anything array-like may be given.
    unit : str
        ``"1"`` for pure numbers and for truth values.
    meaning : str
        Meaning of the numbers, and the quantities along its axes.
    """

    values: Any
    unit: str
    meaning: str

    def __post_init__(self) -> None:
        values = np.array(self.values)
        values.flags.writeable = False
        object.__setattr__(self, "values", values)


@dataclass(frozen=True)
class Judgement:
    """Outcome of a claim.

    Attributes
    ----------
    outcome : str
        One of `OUTCOMES`.
    share : float, optional
        Share of the cases in which the claim holds; None if there are no cases.
    here : bool, optional
        Whether it holds at the point assumed for what the paper's text lost; None if there is no such point.
    """

    outcome: Outcome
    share: float | None = None
    here: bool | None = None


@dataclass(frozen=True)
class Finding:
    """Result of the function of a claim. Mathematics is LaTeX between dollar signs.

    Attributes
    ----------
    judgement : Judgement
    plain : str
        The conclusion in one plain sentence.
    sentence : str
        The computed numbers behind it, in words.
    evidence : mapping of EvidenceArray
        ``"region"``, of truth values, is where a claim holds that holds somewhere.
    criterion : str
        The criterion with its thresholds: the claim holds if it is met everywhere, is contradicted if nowhere.
    remedy : str, optional
        The smallest change that makes the claim true, computed to do so.
    missing : str, optional
        Information that is missing in the text for a decision.
    """

    judgement: Judgement
    plain: str
    sentence: str
    evidence: Mapping[str, EvidenceArray]
    criterion: str
    remedy: str | None = None
    missing: str | None = None


@dataclass(frozen=True)
class Verdict:
    """A claim of the paper and its computed verdict.

    Attributes
    ----------
    id, theme, title : str
    claim : str
        In the paper's words.
    source : str
        Where the paper says so.
    outcome, share, here
        As in `Judgement`.
    plain, sentence, evidence, criterion, remedy, missing
        As in `Finding`.
    setting : Setting
        All input values.
    picture : callable
        Draws the evidence into axes.
    """

    id: str
    theme: str
    title: str
    claim: str
    source: str
    outcome: Outcome
    plain: str
    sentence: str
    evidence: Mapping[str, EvidenceArray] = field(repr=False)
    criterion: str = field(repr=False)
    setting: Setting = field(repr=False)
    picture: Callable[[Verdict, Axes], None] | None = field(repr=False, compare=False)
    share: float | None = None
    here: bool | None = None
    remedy: str | None = None
    missing: str | None = None

    def __post_init__(self) -> None:
        object.__setattr__(self, "evidence", MappingProxyType(dict(self.evidence)))

    @classmethod
    def of(cls, found: Finding, **known: Any) -> Verdict:
        """Return the verdict from a finding and the id, theme, title, words, source and setting of its claim."""
        judgement = found.judgement
        return cls(
            **known,
            outcome=judgement.outcome,
            share=judgement.share,
            here=judgement.here,
            plain=found.plain,
            sentence=" ".join(found.sentence.split()),
            evidence=found.evidence,
            criterion=found.criterion,
            remedy=found.remedy,
            missing=found.missing,
        )

    def __getitem__(self, name: str) -> np.ndarray:
        """Return the values of one quantity of the evidence."""
        values: np.ndarray = self.evidence[name].values
        return values

    @property
    def headline(self) -> str:
        """The outcome, the share of the cases tried where the claim holds, and whether it does at the assumed point.

        >>> from cra_sym.claims import claim
        >>> claim("C07").headline
        'rarely holds (in 17 % of the cases; at our assumed point: no)'
        """
        partly = self.share is not None and 0 < self.share < 1
        details = [f"in {_share(self.share)} of the cases"] if partly and self.share is not None else []
        details += [f"at our assumed point: {'yes' if self.here else 'no'}"] if self.here is not None else []
        return f"{self.outcome} ({'; '.join(details)})" if details else self.outcome

    def draw(self, ax: Axes | None = None) -> Figure:
        """Draw the evidence into one pair of axes, by default a new figure in the house style."""
        from cra_sym.claims.pictures import draw_panel

        if self.picture is None:
            raise NotImplementedError(f"claim {self.id} has no picture")
        return draw_panel(partial(self.picture, self), f"{self.id}  {self.title}", self.outcome, ax)

    def as_dict(self) -> dict[str, Any]:
        """Return all fields as plain Python values for JSON; numbers that are not finite become text."""
        named = ("id", "theme", "title", "claim", "source", "outcome", "share", "here", "headline")
        texts = ("plain", "sentence", "criterion", "remedy", "missing")
        evidence = {
            name: {"values": _plain(q.values), "unit": q.unit, "meaning": q.meaning}
            for name, q in self.evidence.items()
        }
        return {**{name: getattr(self, name) for name in (*named, *texts)}, "evidence": evidence}

    def _repr_markdown_(self) -> str:
        lines = [f"> {self.claim} ({self.source})", f"**{self.id} {self.headline}.** {self.plain}", self.sentence]
        lines += [f"*Judged:* {self.criterion}."]
        lines += [f"*Smallest change that reproduces the paper:* {self.remedy}."] if self.remedy else []
        lines += [f"*Missing:* {self.missing}."] if self.missing else []
        return "\n\n".join(lines)


def _share(share: float) -> str:
    """Return a share strictly between 0 and 1 in per cent, not rounded to 0 or 100.

    >>> _share(0.1649), _share(0.9997), _share(1e-5)
    ('16 %', 'over 99 %', 'under 1 %')
    """
    return "over 99 %" if share > 0.99 else "under 1 %" if share < 0.01 else f"{100 * share:.0f} %"


def _plain(values: np.ndarray) -> Any:
    if values.dtype.kind != "f":
        return values.tolist()
    return json.loads(
        json.dumps(values.tolist()).replace("NaN", '"nan"').replace("-Infinity", '"-inf"').replace("Infinity", '"inf"')
    )


def judged(*parts: Any, here: Any = None) -> Judgement:
    """Judge a claim whose ``parts`` must all hold; each is an array of where that part holds.

    Parameters
    ----------
    *parts : array_like of bool
        The share of a claim of several parts is the least of theirs.
    here : array_like of bool, optional
        Whether the claim holds at the assumed point: if all are true.

    Examples
    --------
    >>> judged([True, True], here=True)
    Judgement(outcome='holds', share=1.0, here=True)
    >>> judged([True, False, False, False]).outcome, judged([True, True], [False, False]).outcome
    ('rarely holds', 'contradicted')
    """
    share = min(float(np.mean(np.asarray(part, dtype=bool))) for part in parts)
    point = None if here is None else bool(np.all(here))
    outcome: Outcome = "mostly holds" if share > MOSTLY else "rarely holds"
    return Judgement("holds" if share == 1.0 else "contradicted" if share == 0.0 else outcome, share, point)
