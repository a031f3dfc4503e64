"""The ledger: the paper's statements, each with the computed verdict."""

from __future__ import annotations

import copyreg
from dataclasses import fields
from functools import cache
from importlib import import_module
from typing import TYPE_CHECKING, Any

from cra_sym.checks import choice, default_floating_point
from cra_sym.claims.registry import ENTRIES, RegisteredClaim
from cra_sym.claims.setting import Setting
from cra_sym.claims.verdict import THEMES, Verdict

if TYPE_CHECKING:
    from cra_sym.arm.parameters import Arm

__all__ = ["claim", "claims"]

_HOMES = ("modes", "energy", "sensitivity", "responses", "comparisons", "stability", "zones")


@cache
def _load() -> tuple[str, ...]:
    """Import the modules of the claims; return the claims in order."""
    for home in _HOMES:
        import_module(f"cra_sym.claims.{home}")
    return tuple(sorted(ENTRIES))


def _entry(id: str) -> RegisteredClaim:
    return ENTRIES[choice("claim", id, _load())]


def _rebuilt(values: dict[str, Any]) -> Verdict:
    """Return a verdict that comes from a pickle, with the picture of its claim."""
    picture = ENTRIES[values["id"]].picture if values["id"] in _load() else None
    return Verdict(**(values | {"picture": picture}))


def _reduced(verdict: Verdict) -> tuple[Any, ...]:
    values = {item.name: getattr(verdict, item.name) for item in fields(verdict)}
    return _rebuilt, (values | {"evidence": dict(verdict.evidence), "picture": None},)


copyreg.pickle(Verdict, _reduced)  # a picture is a function that cannot be pickled by name; the ledger provides it


@cache
def _verdict(id: str, setting: Setting) -> Verdict:
    entry = _entry(id)
    return Verdict.of(
        entry.find(setting),
        id=id,
        theme=entry.theme,
        title=entry.title,
        claim=entry.claim,
        source=entry.source,
        setting=setting,
        picture=entry.picture,
    )


@default_floating_point
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
    if theme is not None:
        choice("theme", theme, THEMES)
    setting = Setting.of(arm, **numbers)
    return tuple(_verdict(id, setting) for id in _load() if theme in (None, ENTRIES[id].theme))
