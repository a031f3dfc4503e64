"""Derivative of a bilinear form by a parameter that moves a jump of a coefficient: the contribution of the jump."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from cra_sym.kernels import Kernel, kernel
from cra_sym.model.breaks import Breaks

if TYPE_CHECKING:
    from sympy import Expr, Symbol

__all__ = ["Jumps", "jumps"]

Array = NDArray[np.float64]
_ASIDE = 1e-10
"""Distance from a jump at which its two sides are evaluated, in lengths: the coefficients are smooth there."""


@dataclass(frozen=True)
class Jumps:
    """Breakpoints of a model and how the parameters move them.

    Attributes
    ----------
    breaks : Breaks
    domain : Kernel
        Of the parameters: left end and length, and their derivatives by every parameter.
    """

    breaks: Breaks
    domain: Kernel

    def sides(self, columns: Array) -> tuple[Array, Array, Array]:
        """Return positions just left and right of every breakpoint, (sets, breakpoints), and the breakpoints' rates.

        The rates, (parameters, sets, breakpoints), are relative to points at a fixed share of the length.
        """
        sets = columns.shape[1]
        left, length, *rates = (np.broadcast_to(value, sets) for value in self.domain.function(*columns))
        places, moved = self.breaks.moving(columns, left, length)
        count = len(columns)
        share = (places - left[:, None]) / length[:, None]
        drift = [rates[k][:, None] + share * rates[count + k][:, None] for k in range(count)]
        relative = np.where((moved != 0.0).any(axis=0) | (share > 0.0), moved - np.array(drift), 0.0)
        aside = _ASIDE * length[:, None]
        inside = share > 0.0
        return places - np.where(inside, aside, 0.0), places + np.where(inside, aside, 0.0), relative


def jumps(breaks: Breaks, left: Expr, length: Expr, symbols: tuple[Symbol, ...]) -> Jumps:
    """Return the breakpoints of a model with their rates by the parameters."""
    rates = [end.diff(symbol) for end in (left, length) for symbol in symbols]
    return Jumps(breaks, kernel((left, length, *rates), symbols, backend="numpy"))
