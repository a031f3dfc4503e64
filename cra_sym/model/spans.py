"""A coordinate along x that passes through breakpoints at nodes of the dynamic stiffness."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from cra_sym.solvers.stiffness import GOLDEN

__all__ = ["Spans"]

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Spans:
    """A coordinate s from 0 to 1 that passes through breakpoints at nodes of the dynamic stiffness.

    Attributes
    ----------
    knots : ndarray, shape (spans + 1,)
        Nodes.
    edges : ndarray, shape (rows, spans + 1)
        Left end, breakpoints, right end.
    """

    knots: Array
    edges: Array

    @classmethod
    def of(cls, edges: Array, halvings: int) -> tuple[Spans, int]:
        """Return the coordinate for breakpoints, and how often a part must be halved to have these nodes."""
        number = edges.shape[1]
        halvings = max(halvings, int(np.ceil(np.log2(2 * number))))
        cells = np.arange(2**halvings + 1) / 2**halvings
        nodes = np.unique(np.concatenate([GOLDEN * cells, GOLDEN + (1.0 - GOLDEN) * cells]))
        share = ((edges - edges[:, :1]) / (edges[:, -1:] - edges[:, :1])).mean(axis=0)
        place = np.searchsorted(nodes, share)
        for k in range(1, number):  # in turn from the left and from the right
            place[k] = max(place[k], place[k - 1] + 1)
        place[-1] = len(nodes) - 1
        for k in range(number - 2, -1, -1):
            place[k] = min(place[k], place[k + 1] - 1)
        return cls(nodes[place], edges), halvings

    def take(self, rows: np.ndarray) -> Spans:
        """Return those of some rows."""
        return Spans(self.knots, self.edges[rows])

    def places(self, share: Array, rows: np.ndarray) -> tuple[Array, Array]:
        """Return x and dx/ds at shares of shape (rows or 1, stations)."""
        share = np.broadcast_to(share, (len(rows), share.shape[-1]))
        span = np.clip(np.searchsorted(self.knots, share, side="right") - 1, 0, len(self.knots) - 2)
        left, right = (self.edges[rows[:, None], span + k] for k in (0, 1))
        slope = (right - left) / (self.knots[span + 1] - self.knots[span])
        return left + (share - self.knots[span]) * slope, slope

    def shares(self, x: Array) -> Array:
        """Return the shares of places, shape (rows, stations)."""
        return np.stack([np.interp(at, row, self.knots) for at, row in zip(x, self.edges, strict=True)])
