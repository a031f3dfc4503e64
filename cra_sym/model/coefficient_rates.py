"""Derivatives of the coefficients of a determinant by parameters: complex steps, several parameters at once."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cra_sym.cached import cached_property

__all__ = ["CoefficientRates"]

Array = NDArray[np.float64]
_STEP = 1e-30  # of a complex step (Squire and Trapp, SIAM Review 40, 1998)


@dataclass(frozen=True, eq=False)
class CoefficientRates:
    """Derivatives by parameters that change no coefficient in common follow from one complex step.

    See Curtis, Powell and Reid, IMA Journal of Applied Mathematics 13, 1974.

    Attributes
    ----------
    coefficients : callable
        Of complex parameters, shape (parameters, sets), analytic: shape (entries, sets).
    parameters : int
    infinite : tuple of int
        Parameters that may be infinite, in place of which a coefficient is then constant.
    """

    coefficients: Callable[[Any], Any]
    parameters: int
    infinite: tuple[int, ...]

    def __call__(self, columns: Array, positions: Sequence[int]) -> Iterator[tuple[int, dict[int, Array]]]:
        """Yield each place in ``positions``, with the derivatives that are not zero by that parameter, by entry."""
        groups = self._groups(positions)
        moved = self._moved(columns, [[positions[at] for at in group] for group in groups])
        for number, group in enumerate(groups):
            for at in group:
                step = _steps(columns, positions[at])
                entries = np.flatnonzero(self._acting[positions[at]])
                yield at, {int(k): moved[k, number] / step for k in entries if moved[k, number].any()}

    def _moved(self, columns: Array, groups: Sequence[Sequence[int]]) -> Array:
        """Return the imaginary parts after steps of the parameters of each group, shape (entries, groups, sets)."""
        sets, moved = columns.shape[1], np.tile(columns.astype(complex), len(groups))
        for number, group in enumerate(groups):
            for position in group:
                moved[position, number * sets : (number + 1) * sets] += 1j * _steps(columns, position)
        return np.asarray(self.coefficients(moved).imag.reshape(-1, len(groups), sets))

    @cached_property
    def _acting(self) -> NDArray[np.bool_]:
        """Which coefficients each parameter changes, shape (parameters, entries).

        A derivative of an analytic function is zero everywhere if it is at random values.
        """
        columns = np.random.default_rng(1).uniform(0.5, 1.5, (self.parameters, 2 + len(self.infinite)))
        for at, position in enumerate(self.infinite, start=2):
            columns[position, [1, at]] = np.inf
        moved = self._moved(columns, [[position] for position in range(self.parameters)])
        return np.asarray((moved != 0.0).any(axis=2).T)

    def _groups(self, positions: Sequence[int]) -> list[list[int]]:
        """Return groups of places in ``positions`` whose parameters change no coefficient in common."""
        groups: list[list[int]] = []
        for at, position in enumerate(positions):
            for group in groups:
                if not (self._acting[[positions[other] for other in group]] & self._acting[position]).any():
                    group.append(at)
                    break
            else:
                groups.append([at])
        return groups


def _steps(columns: Array, position: int) -> Array:
    """Return the lengths of imaginary steps of a parameter, whose squares underflow."""
    size = np.abs(columns[position])
    return np.asarray(_STEP * np.where((size > 0.0) & np.isfinite(size), size, 1.0))
