"""Formatting of numbers in sentences, with LaTeX between dollar signs, and conversion of sentences to plain text."""

from __future__ import annotations

import re
from collections.abc import Iterable
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from cra_sym.claims.verdict import Judgement

__all__ = ["by_outcome", "listed", "mm", "number", "percent", "plain_text", "span"]

_SIGNS = {
    name: chr(code)
    for name, code in {
        "omega": 0x3C9, "varpi": 0x3D6, "psi": 0x3C8, "phi": 0x3C6, "kappa": 0x3BA, "lambda": 0x3BB, "rho": 0x3C1,
        "sigma": 0x3C3, "Gamma": 0x393, "epsilon": 0x3B5, "zeta": 0x3B6, "times": 0xD7, "infty": 0x221E,
    }.items()
}  # fmt: skip
_POWERS = str.maketrans("-0123456789", "\N{SUPERSCRIPT MINUS}\N{SUPERSCRIPT ZERO}\N{SUPERSCRIPT ONE}\N{SUPERSCRIPT TWO}"
    "\N{SUPERSCRIPT THREE}\N{SUPERSCRIPT FOUR}\N{SUPERSCRIPT FIVE}\N{SUPERSCRIPT SIX}\N{SUPERSCRIPT SEVEN}"
    "\N{SUPERSCRIPT EIGHT}\N{SUPERSCRIPT NINE}")  # fmt: skip

TIMES = r"\times"


def number(value: Any, digits: int = 3) -> str:
    """Return a number in common notation, without an exponent from 1e-3 to 1e5.

    >>> print(number(0.30000001), number(1234.5), number(2e6), number(float("inf")))
    0.3 1230 $2\\times10^{6}$ infinite
    """
    value = float(value)
    if not np.isfinite(value):
        return "infinite" if value > 0 else str(value)
    rounded = float(f"{value:.{digits}g}")
    if rounded == 0 or 1e-3 <= abs(rounded) < 1e5:
        return f"{rounded:.10f}".rstrip("0").rstrip(".")
    mantissa, exponent = f"{rounded:.{digits - 1}e}".split("e")
    factor = mantissa.rstrip("0").rstrip(".") if "." in mantissa else mantissa
    return f"${'' if factor == '1' else factor + TIMES}10^{{{int(exponent)}}}$"


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
    """Return the intervals of ``places`` in which a condition holds, in words.

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


def by_outcome(judgement: Judgement, holds: str, partly: str, contradicted: str) -> str:
    """Return the sentence for a judgement: holds everywhere, somewhere or nowhere."""
    return {"holds": holds, "contradicted": contradicted}.get(judgement.outcome, partly)


def plain_text(text: str) -> str:
    r"""Return a sentence without LaTeX, as a terminal shows it.

    >>> plain_text(r"$k_t L^2/k_r$ of $2\times10^{-6}$, $\sqrt{EI/\rho A}$, $\omega_1$")
    'k_t L²/k_r of 2×10⁻⁶, sqrt(EI/ρ A), ω_1'
    """
    return re.sub(r"\$([^$]*)\$", lambda match: _plain_formula(match[1]), text)


def _plain_formula(latex: str) -> str:
    latex = re.sub(r"\\sqrt\{([^}]*)\}", r"sqrt(\1)", latex)
    latex = re.sub(r"\\ddot ?(\w)", r"\1''", latex)
    latex = re.sub(r"\^(?:\{(-?\d+)\}|(\d))", lambda match: (match[1] or match[2]).translate(_POWERS), latex)
    latex = re.sub(r"\\([A-Za-z]+)(?=(\\?))", lambda m: _SIGNS.get(m[1], m[1] + (" " if m[2] else "")), latex)
    return re.sub(r"[{}]|\\[,;]", "", latex)
