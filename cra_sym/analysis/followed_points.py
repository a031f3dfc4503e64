"""Places of mode shapes that follow interior places, so that no difference by a parameter crosses one of these."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from cra_sym.analysis.differences import offsets_at, weights_at
from cra_sym.analysis.modes import checked_places, displaced, section_place
from cra_sym.model.projection import column
from cra_sym.model.routes import Modes
from cra_sym.model.system import System
from cra_sym.model.values import flat_columns

__all__ = ["FollowedPoints"]

Array = NDArray[np.float64]
_STEP = 1e-4  # relative, of a difference of places, which are smooth functions of a parameter
_ASIDE = 1e-10  # lengths, on both sides of a place where the slope may jump


class FollowedPoints:
    """Points that are held fixed relative to the sections between interior places, not to the whole length.

    Shapes have kinks, or jumps of a higher derivative, where a mass, a spring or a support is, or a coefficient jumps.
    At such points they are smooth functions of a parameter that moves these places.

    Parameters
    ----------
    system : System
    x : array_like or None
        Places in the domain, m: a number or one axis. A lumped coordinate needs none.
    field : applied undefined function or None
        A field (default: the first), or a lumped coordinate.

    Attributes
    ----------
    single : bool
        Whether x is a number, which has no axis.

    Raises
    ------
    TypeError, ValueError
        If a place or the field is not of the system.
    """

    def __init__(self, system: System, x: Any, field: Any) -> None:
        self.system, self._place = system, section_place(system, field, lumped=True)
        points = checked_places(system, x, self._place)
        self.single = points is not None and not points.ndim
        self._share: Array | None = None
        self._nodes: Array | None = None
        if points is None:
            return
        share = (np.atleast_1d(points) - column(system.domain.left)) / column(system.domain.length)
        self._nodes, self._share = _nodes(system), share
        if self._nodes is not None:
            self._share = np.broadcast_to(share, (*system.shape, share.shape[-1]))
            self._section = (self._share[..., None] >= self._nodes[..., None, 1:-1]).sum(axis=-1)
            low, high = (np.take_along_axis(self._nodes, self._section + k, axis=-1) for k in (0, 1))
            self._part = (self._share - low) / (high - low)

    def shapes(self, system: System, modes: Modes) -> Array:
        """Return the shapes of another system of the same model at these points, shape (..., modes, points)."""
        return displaced(system, modes, self._place, self._at(system))

    def slopes(self, system: System, modes: Modes) -> Array:
        """Return the derivatives of shapes by x at these points, the mean of both sides, (..., modes, points)."""
        at, aside = self._at(system), _ASIDE * np.asarray(column(system.domain.length))
        assert at is not None
        sides = [displaced(system, modes, self._place, at + side * aside, 1) for side in (-1.0, 1.0)]
        return np.asarray(0.5 * (sides[0] + sides[1]))

    def drift(self, name: str) -> Array | None:
        """Return the derivatives of the points by a parameter, relative to fixed shares of the length, (..., points).

        None if the parameter moves none of them.
        """
        given = np.broadcast_to(self.system.values[name], self.system.shape)
        if self._nodes is None or self._share is None or not np.isfinite(given).all():
            return None
        width = np.where(given == 0.0, _STEP, _STEP * np.abs(given))
        offsets = offsets_at(given, width)
        shares = self._shares(self.system.replace(**{name: given + offsets * width}))
        weights = weights_at(offsets) / width
        rate = (weights[..., None] * (shares - self._share)).sum(axis=0) * column(self.system.domain.length)
        return np.asarray(rate) if np.any(np.abs(rate) * column(np.abs(given)) > _ASIDE) else None

    def _at(self, system: System) -> Array | None:
        if self._share is None:
            return None
        return np.asarray(column(system.domain.left) + self._shares(system) * column(system.domain.length))

    def _shares(self, system: System) -> Array:
        nodes = None if self._nodes is None else _nodes(system)
        if nodes is None or self._nodes is None or nodes.shape[-1] != self._nodes.shape[-1]:
            assert self._share is not None
            return self._share
        section = np.broadcast_to(self._section, (*system.shape, self._section.shape[-1]))
        low, high = (np.take_along_axis(nodes, section + k, axis=-1) for k in (0, 1))
        return np.asarray(low + self._part * (high - low))


def _nodes(system: System) -> Array | None:
    """Return the ends and all interior places over the length, (..., places); None if there are none inside.

    None too where members of a batch differ in their number.
    """
    breaks = system.numerics("section_breaks")
    if breaks is None:
        return None
    columns = flat_columns(system.domain.values, system.shape)
    left, length = (np.broadcast_to(v, system.shape).ravel() for v in (system.domain.left, system.domain.length))
    groups = breaks.edges(columns, left, length)
    if len({edges.shape[1] for _, edges, _ in groups}) > 1 or groups[0][1].shape[1] < 3:
        return None
    found = np.empty((columns.shape[1], groups[0][1].shape[1]))
    for rows, edges, _ in groups:
        found[rows] = (edges - left[rows, None]) / length[rows, None]
    return found.reshape(*system.shape, -1)
