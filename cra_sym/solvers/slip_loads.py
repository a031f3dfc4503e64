"""Loads on modes with elastic-slip elements, as power series over a step; members along the first axis of terms."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from .motion_terms import Harmonic, Piecewise

__all__ = ["Cause", "add_acceleration", "next_knot"]

Array = NDArray[np.float64]


class Cause(NamedTuple):
    """A load ``-gamma a``, a the acceleration of the terms; gamma (N, P), their arrays (P), (P, K), or 1 for P."""

    gamma: Array
    terms: Sequence[Harmonic | Piecewise]

    def of(self, kept: NDArray[np.intp]) -> Cause:
        """Return the load on some members."""
        return Cause(self.gamma[:, kept], [_term_of(term, kept) for term in self.terms])


def _term_of(term: Harmonic | Piecewise, kept: NDArray[np.intp]) -> Harmonic | Piecewise:
    """Return the term of some members; arrays with one entry apply to all."""

    def rows(values: Array) -> Array:
        return values if len(values) == 1 else np.asarray(values[kept])

    if isinstance(term, Harmonic):
        return Harmonic(*map(rows, term))
    knots = term.knots if term.knots.ndim == 1 else rows(term.knots)
    return Piecewise(rows(term.velocity), knots, rows(term.acceleration), rows(term.jerk))


def next_knot(knots: Array, time: Array) -> Array:
    """Return the first knot after each time, inf where there is none."""
    if knots.ndim == 1:
        return np.asarray(np.append(knots, np.inf)[np.searchsorted(knots, time, side="right")])
    return np.asarray(np.where(knots > time[:, None], knots, np.inf).min(axis=1))


def add_acceleration(total: Array, term: Harmonic | Piecewise, time: Array, span: Array) -> None:
    """Add the series of the acceleration of a term from a time on, in powers of the time over the span."""
    if isinstance(term, Harmonic):
        phase = term.angular_frequency * time + term.phase
        size = -term.amplitude * term.angular_frequency**2
        waves = (np.sin(phase), np.cos(phase), -np.sin(phase), -np.cos(phase))
        for k in range(len(total)):
            total[k] += size * waves[k % 4]
            size = size * (term.angular_frequency * span / (k + 1))
        return
    if term.knots.ndim == 1:
        at = np.searchsorted(term.knots, time, side="right") - 1
        knot = term.knots[np.maximum(at, 0)]
    else:
        at = (term.knots <= time[:, None]).sum(axis=1) - 1
        knot = _entries(term.knots, np.maximum(at, 0))
    level, jerk = (np.where(at < 0, 0.0, _entries(v, np.maximum(at, 0))) for v in (term.acceleration, term.jerk))
    total[0] += level + jerk * np.where(at < 0, 0.0, time - knot)
    total[1] += jerk * span


def _entries(values: Array, at: NDArray[np.intp]) -> Array:
    return np.asarray(values[0, at] if len(values) == 1 else values[np.arange(len(at)), at])
