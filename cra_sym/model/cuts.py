"""Quadrature of densities along the domain that jump, or have kinks, where the modes need not."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from cra_sym.model.breaks import Breaks
from cra_sym.model.values import flat_columns

__all__ = ["Cuts"]

Array = NDArray[np.float64]
_POINTS, _WEIGHTS = np.polynomial.legendre.leggauss(10)


@dataclass(frozen=True)
class Cuts:
    """Where densities are not smooth along the domain.

    Attributes
    ----------
    breaks : Breaks
        Of the densities and of the coefficients of the model.
    elsewhere : bool
        Whether the densities have breakpoints that neither mass nor stiffness have.
    """

    breaks: Breaks
    elsewhere: bool

    def stations(
        self, values: Sequence[float | Array], left: float | Array, length: float | Array, shape: tuple[int, ...],
        panels: int,
    ) -> tuple[Array, Array]:  # fmt: skip
        """Return points and weights, shape (..., points), on so many panels that are cut at every breakpoint."""
        starts, lengths = (np.broadcast_to(value, shape).ravel() for value in (left, length))
        grid = starts[:, None] + lengths[:, None] * np.linspace(0.0, 1.0, panels + 1)
        places = self.breaks.inside(flat_columns(values, shape), starts, lengths)
        edges = np.sort(np.concatenate([grid, places], axis=1), axis=1)
        width = np.diff(edges, axis=1)[..., None]  # some are 0, and have no weight
        x, weights = edges[:, :-1, None] + width * 0.5 * (1.0 + _POINTS), width * 0.5 * _WEIGHTS
        return x.reshape(*shape, -1), weights.reshape(*shape, -1)
