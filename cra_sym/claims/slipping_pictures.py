"""Drawings of the verdicts on a joint that slips."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING

import numpy as np

from cra_sym.claims.pictures import STYLES
from cra_sym.claims.words import number

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from cra_sym.claims.verdict import Verdict

__all__ = ["PICTURES"]


def _lines(ax: Axes, x: np.ndarray, curves: np.ndarray, names: list[str], title: str = "") -> None:
    for style, curve, name in zip(STYLES, curves, names, strict=False):
        ax.plot(x, curve, linestyle=style, label=name)
    ax.set_xscale("log")
    ax.set_xlim(x.min(), x.max())
    ax.legend(fontsize=8.5, title=title or None)


def _over_amplitude(verdict: Verdict, ax: Axes, name: str, label: str, preload: np.ndarray) -> None:
    names = [f"{number(value)} N" for value in preload]
    _lines(ax, 1e3 * verdict["amplitude"], verdict[name], names, "preload")
    ax.set_xlabel("amplitude at the tip / mm")
    ax.set_ylabel(label)


def draw_frequencies(verdict: Verdict, ax: Axes) -> None:
    """Draw C02: the first frequency over the amplitude, for preloads of the soft joint."""
    _over_amplitude(verdict, ax, "large", "first frequency / Hz", verdict["soft_preload"])


def draw_rates(verdict: Verdict, ax: Axes) -> None:
    """Draw C06: how fast the first frequency changes with the preload, over the amplitude."""
    preload = verdict["soft_preload"]
    _over_amplitude(verdict, ax, "rate", "rate of the first frequency / (Hz/N)", np.sqrt(preload[1:] * preload[:-1]))


def _over_preload(verdict: Verdict, ax: Axes, curves: np.ndarray, label: str) -> None:
    names = [f"{number(size, 2)} times" for size in verdict["size"]]
    _lines(ax, verdict["preload"], curves, names, "motion")
    ax.set_xlabel("preload / N")
    ax.set_ylabel(label)


def draw_ratio(verdict: Verdict, ax: Axes) -> None:
    """Draw C10, C11: the peak over that on the rigid joint, over the preload."""
    _over_preload(verdict, ax, np.exp(verdict["log_ratio"]), "largest value over that on a rigid joint")
    ax.axhline(1.0, color="0.5", linewidth=0.8)


def draw_growth(verdict: Verdict, ax: Axes) -> None:
    """Draw C12, C13: the peak at the largest mean acceleration over that at the smallest, over the preload."""
    peaks = verdict["peaks"]
    _over_preload(verdict, ax, peaks[-1] / peaks[0], "largest value at most over at least acceleration")
    ax.axhline(1.0, color="0.5", linewidth=0.8)


def draw_widths(verdict: Verdict, ax: Axes) -> None:
    """Draw C16: the widths of the principal zones over the preload."""
    width = verdict["width"]
    _lines(ax, verdict["preload"], width, [f"zone {n}" for n in range(1, len(width) + 1)])
    ax.set_yscale("log")
    ax.set_xlabel("preload / N")
    ax.set_ylabel("width of the zone / (rad/s)")


PICTURES: Mapping[str, Callable[[Verdict, Axes], None]] = {
    "C02": draw_frequencies,
    "C06": draw_rates,
    "C10": draw_ratio,
    "C11": draw_ratio,
    "C12": draw_growth,
    "C13": draw_growth,
    "C16": draw_widths,
}
"""Drawing of the evidence of each claim that is evaluated for slip."""
