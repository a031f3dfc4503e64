"""Numbers put into sentences."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import numpy as np

__all__ = ["listed", "mm", "number", "percent", "span"]


def number(value: Any, digits: int = 3) -> str:
    """Return a number as a reader writes it: no exponent from 1e-3 to 1e5.

    >>> number(0.30000001), number(1234.5), number(2e6), number(float("inf"))
    ('0.3', '1230', '2e6', 'infinite')
    """
    value = float(value)
    if not np.isfinite(value):
        return "infinite" if value > 0 else str(value)
    rounded = float(f"{value:.{digits}g}")
    if rounded == 0 or 1e-3 <= abs(rounded) < 1e5:
        return f"{rounded:.10f}".rstrip("0").rstrip(".")
    mantissa, exponent = f"{rounded:.{digits - 1}e}".split("e")
    return f"{mantissa.rstrip('0').rstrip('.') if '.' in mantissa else mantissa}e{int(exponent)}"


def mm(value: Any) -> str:
    """Return a length given in m as a number of mm.

    >>> mm(0.00123)
    '1.23'
    """
    return number(1e3 * float(value))


def percent(value: Any, digits: int = 2) -> str:
    """Return a share in per cent.

    >>> percent(0.1234), percent(1.0), percent(-0.0567)
    ('12 %', '100 %', '-5.7 %')
    """
    return f"{number(100 * float(value), max(digits, 3 if abs(value) >= 1 else digits))} %"


def listed(values: Iterable[Any], form: Any = number, joint: str = "and") -> str:
    """Return values as a list in words.

    >>> listed([1, 2.5, 3])
    '1, 2.5 and 3'
    """
    words = [form(value) for value in values]
    return words[0] if len(words) == 1 else f"{', '.join(words[:-1])} {joint} {words[-1]}"


def span(places: Any, where: Any, unit: str = "", form: Any = number) -> str:
    """Return where along ``places`` a condition holds, as intervals in words.

    >>> span([1, 2, 3, 4, 5], [True, True, False, True, True], "m")
    '1 to 2 and 4 to 5 m'
    """
    places, where = np.asarray(places, dtype=float), np.asarray(where, dtype=bool)
    if not where.any():
        return "nowhere"
    edges = np.flatnonzero(np.diff(np.concatenate([[False], where, [False]]).astype(int)))
    parts = []
    for first, last in zip(edges[::2], edges[1::2] - 1, strict=True):
        low, high = sorted((places[first], places[last]))
        parts.append(form(low) if form(low) == form(high) else f"{form(low)} to {form(high)}")
    return listed(parts, str) + (f" {unit}" if unit else "")
