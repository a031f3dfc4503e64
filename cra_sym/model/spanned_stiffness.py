"""Dynamic stiffness with breakpoints along x, and terms that act at interior places."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from cra_sym.model.spans import Spans
from cra_sym.solvers.stiffness import GOLDEN, DynamicStiffness, Evaluation

__all__ = ["Stiffness", "check_range", "shares"]

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Stiffness(DynamicStiffness):
    """The dynamic stiffness; values beyond the range of double precision are refused.

    Its coordinate ``share`` runs through the domain span by span, so that every breakpoint is a node of its pieces.

    Attributes
    ----------
    spans : Spans or None
        Where the coefficients vary along x.
    at_nodes : callable or None
        ``at_nodes(z, rows)`` returns (share, matrix, derivative) of what acts at interior places.
    """

    spans: Spans | None = None
    at_nodes: Callable[[np.ndarray, np.ndarray], list[tuple[float, np.ndarray, np.ndarray]]] | None = None

    def take(self, rows: np.ndarray) -> DynamicStiffness:
        """Return the problem of some of the parameter sets."""
        spans = None if self.spans is None else self.spans.take(rows)
        at = self.at_nodes
        at_nodes = None if at is None else lambda z, index: at(z, rows[index])
        return replace(super().take(rows), spans=spans, at_nodes=at_nodes)  # type: ignore[call-arg]

    def _transfer(self, z: np.ndarray, rows: np.ndarray, levels: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return the transfer matrices of all pieces; the piece right of an interior place includes the terms there."""
        whole, slope = super()._transfer(z, rows, levels)
        for part, piece, jump, rate in self._entered(z, rows, int(levels.max(initial=0))):
            first, first_slope = whole[part, :, piece], slope[part, :, piece]
            slope[part, :, piece] = first_slope @ jump + first @ rate
            whole[part, :, piece] = first @ jump
        return whole, slope

    def behind(self, start: np.ndarray, z: np.ndarray, row: np.ndarray, level: int) -> np.ndarray:
        """Return states left of the pieces, (part, row, piece, state), behind what acts there."""
        found = start
        for part, piece, jump, _ in self._entered(z, row, level):
            found = found.copy() if found is start else found
            found[part, :, piece] = (jump @ start[part, :, piece, :, None])[..., 0]
        return found

    def _entered(
        self, z: np.ndarray, rows: np.ndarray, level: int
    ) -> Iterator[tuple[int, int, np.ndarray, np.ndarray]]:
        """Yield part and piece right of each interior place, with the transfer matrix there and its derivative."""
        if self.at_nodes is None:
            return
        size = self.displacements + self.coordinates
        for share, matrix, rate in self.at_nodes(z, rows):
            part = int(share > GOLDEN - 1e-9)
            width = 1.0 - GOLDEN if part else GOLDEN
            piece = round((share - part * GOLDEN) / width * 2**level)
            jump = np.broadcast_to(np.eye(2 * size, dtype=matrix.dtype), (len(z), 2 * size, 2 * size)).copy()
            slope = np.zeros_like(jump)
            jump[:, size:, :size], slope[:, size:, :size] = matrix, rate
            yield part, piece, jump, slope

    def shares(self, x: Array, left: Array) -> Array:
        """Return the shares of places x of shape (stations,) or (rows, stations), in shape (rows, stations)."""
        share = shares(x, left, self.length)
        return share if self.spans is None else self.spans.shares(left[:, None] + share * self.length[:, None])

    def evaluate(
        self, z: np.ndarray, rows: np.ndarray, *, keep_tree: bool = False, levels: np.ndarray | None = None
    ) -> Evaluation:
        try:
            with np.errstate(over="ignore", divide="ignore", invalid="ignore"):
                here = super().evaluate(z, rows, keep_tree=keep_tree, levels=levels)
        except np.linalg.LinAlgError:
            check_range(np.array(np.nan))
        if not np.iscomplexobj(here.matrix):  # the estimate of a complex eigenvalue may be far off
            check_range(here.matrix, here.derivative)
        return here


def check_range(*numbers: np.ndarray) -> None:
    """Raise a ValueError unless all numbers are finite."""
    if not all(np.isfinite(array).all() for array in numbers):
        raise ValueError("values: they lead beyond the range of double precision")


def shares(x: np.ndarray, left: np.ndarray, length: np.ndarray, name: str = "x") -> np.ndarray:
    """Return places as shares of the length, shape (rows, stations)."""
    share = (x - left[:, None]) / length[:, None]
    if (share < -1e-12).any() or (share > 1.0 + 1e-12).any():
        raise ValueError(f"{name} = {x}: must be in the domain, {left.max():g} to {(left + length).min():g}")
    return np.asarray(np.clip(share, 0.0, 1.0))
