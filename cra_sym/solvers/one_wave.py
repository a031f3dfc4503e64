"""Numerical characteristic function of lines with one wave number, with the interface of the complete spectrum.

The functions themselves are derived elsewhere, for each structure: two ends, each a tuple of the kinds of its channels
(see `cra_sym.mechanics.one_wave`). Here are their values on arrays of lanes.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from cra_sym.cached import cached_property
from cra_sym.solvers.spectrum import Lanes

__all__ = ["NEAR", "Functions", "Layout", "OneWaveCharacteristic", "Structure", "parameters", "power"]

Array = NDArray[np.float64]
Counts = NDArray[np.int64]
Structure = tuple[tuple[str, ...], tuple[str, ...]]

NEAR = {1: 2.0, 2: 5.0}
"""Below this z power series are used; a test checks that it equals the value in the derivation."""
_ORDER = {1: (1, 0), 2: (1, 2, 0, 3)}


class WaveFunction(Protocol):
    """A compiled function of `cra_sym.kernels`."""

    @property
    def function(self) -> Callable[..., Any]:
        """The function of numbers or arrays."""


Functions = Mapping[str, WaveFunction]


@dataclass(frozen=True)
class Layout:
    """Row numbers of the quantities of a structure in its arrays.

    Attributes
    ----------
    structure : tuple of two tuples of n texts
    """

    structure: Structure

    @property
    def n(self) -> int:
        """Displacements of an end: 1 of a string, 2 of a beam."""
        return len(self.structure[0])

    @property
    def kinds(self) -> tuple[str, ...]:
        """The kinds of all channels."""
        return self.structure[0] + self.structure[1]

    @cached_property
    def groups(self) -> tuple[tuple[int, str], ...]:
        """Channel and letter, k or m, of each dimensionless group: a stiffness kappa or an inertia mu."""
        return tuple((i, letter) for i, kind in enumerate(self.kinds) for letter in "km" if letter in kind)

    @cached_property
    def parameters(self) -> tuple[tuple[int, str], ...]:
        """Channel and letter, s, i or c, of each parameter of the functions."""
        letters = {"k": "sc", "m": "ic", "km": "sic"}
        return tuple((i, letter) for i, kind in enumerate(self.kinds) for letter in letters.get(kind, ""))

    @cached_property
    def inertias(self) -> tuple[int, ...]:
        """Positions among the groups of the inertias."""
        return tuple(i for i, (_, letter) in enumerate(self.groups) if letter == "m")

    @cached_property
    def springs(self) -> tuple[int, ...]:
        """Positions among the groups of the stiffnesses."""
        return tuple(i for i, (_, letter) in enumerate(self.groups) if letter == "k")

    @cached_property
    def changes(self) -> tuple[int | tuple[int, int], ...]:
        """Change of the count by each link of the chain.

        It is 1, -1, or a pair of parameters: -1 where the first exceeds z times the second, else 1.
        """
        found: list[int | tuple[int, int]] = []
        for channel in _ORDER[self.n]:
            kind, is_held = self.kinds[channel], channel % self.n == 0
            if kind == ("h" if is_held else ""):
                continue
            if is_held or kind == "m":
                found.append(1)
            elif kind == "km":
                found.append((self.parameters.index((channel, "s")), self.parameters.index((channel, "i"))))
            else:
                found.append(-1)
        return tuple(found)

    @property
    def most_near(self) -> int:
        """Largest number of zeros below `NEAR`: the reference has none, and each link may add one."""
        return sum(change != -1 for change in self.changes)

    def is_held(self, groups: Sequence[Array], channel: int) -> NDArray[np.bool] | bool:
        """Return for which sets a spring or a support resists the displacement of a channel."""
        if "k" not in self.kinds[channel]:
            return self.kinds[channel] == "h"
        held: NDArray[np.bool] = groups[self.groups.index((channel, "k"))] > 0
        return held

    def rigid_body_modes(self, groups: Sequence[Array], lanes: int | tuple[int, ...]) -> Counts:
        """Return the number of rigid-body motions without a spring or support, with the shape of the lanes."""
        n = self.n
        resisted = [np.asarray(self.is_held(groups, i)).astype(np.int64) for i in range(2 * n)]
        rank = resisted[0] + resisted[n]
        if n == 2:
            rank = rank + (resisted[1] | resisted[3])
        return np.broadcast_to(n - np.minimum(rank, n), lanes)


def power(lam: Any, n: int) -> Any:
    """Return ``z = lambda^(2n)``."""
    square = lam * lam
    return square if n == 1 else square * square


def wave_number(z: Any, n: int) -> Any:
    """Return lambda."""
    return np.sqrt(z) if n == 1 else np.sqrt(np.sqrt(z))


def parameters(layout: Layout, groups: Sequence[Array]) -> Array:
    """Return ``(s, i, c) = (kappa, mu, 1) / (1 + kappa + mu)`` of every channel, shape (parameters, lanes).

    An infinite stiffness gives (1, 0, 0). Only parameters of the structure are returned.
    """
    by_group = dict(zip(layout.groups, groups, strict=True))
    rows: list[Array] = []
    for channel, kind in enumerate(layout.kinds):
        if kind in ("", "h"):
            continue
        members = [by_group[channel, letter] for letter in kind]
        total = np.asarray(sum(members, np.float64(1.0)))
        with np.errstate(invalid="ignore"):
            rows += [np.where(np.isinf(x), 1.0, x / total) for x in members]
        rows.append(1.0 / total)
    return np.array(rows)


def stacked(values: Sequence[Any], lanes: int) -> Array:
    """Return values, arrays of lanes or numbers, as rows of one array."""
    result = np.empty((len(values), lanes), np.result_type(np.float64, *values))
    for row, value in zip(result, values, strict=True):
        row[...] = value
    return result


class OneWaveCharacteristic:
    """Characteristic functions of one structure, one in each lane, for `cra_sym.solvers.spectrum`.

    Parameters
    ----------
    layout : Layout
    functions : mapping of str to Function
        ``coefficients``, ``derivatives``, ``power_series``, ``basis``, ``basis_near`` and ``chain``.
    groups : sequence of ndarray, shape (lanes,)
        Dimensionless stiffnesses in [0, inf] and inertias in [0, inf), as the layout has them.
    lanes : int
    """

    def __init__(self, layout: Layout, functions: Functions, groups: Sequence[Array], lanes: int) -> None:
        self.layout, self._functions = layout, functions
        self._parameters = parameters(layout, groups).reshape(-1, lanes)
        self._coefficients = stacked(functions["coefficients"].function(*self._parameters), lanes)
        self.zeros = layout.rigid_body_modes(groups, lanes)

    @cached_property
    def _power_series(self) -> Array:
        """Coefficients of the power series in z with the zeros at z = 0 divided out, shape (terms, lanes)."""
        powers = stacked(self._functions["power_series"].function(*self._coefficients), len(self.zeros))
        for multiplicity in range(1, self.layout.n + 1):
            shifted = self.zeros >= multiplicity
            powers[:-1, shifted], powers[-1, shifted] = powers[1:, shifted], 0.0
        return powers

    def count(self, z: float | Array, lanes: Lanes) -> tuple[Counts, Array]:
        """Return the exact number of zeros below z, rigid-body zeros included, and the scaled determinant."""
        of = self._parameters[:, lanes]
        lam, *basis = self._basis(np.asarray(z, dtype=np.float64))
        value, *links = self._functions["chain"].function(*of, z, *basis)
        number = np.floor(lam / np.pi).astype(np.int64)
        number = _with_parity(value, number, np.where(lam / np.pi - number < 0.5, -1, 1))
        for value, change in zip(links, self.layout.changes, strict=True):
            by = change if isinstance(change, int) else np.where(of[change[0]] > z * of[change[1]], -1, 1)
            number = _with_parity(value, number, by)
        shape = self.zeros[lanes].shape
        return np.broadcast_to(number, shape), np.broadcast_to(value, shape)

    def evaluate(self, z: Array, lanes: Lanes) -> tuple[Array, Array, Array]:
        """Return the determinant and its derivatives by z, scaled; rigid-body zeros divided out for small z."""
        near = z < NEAR[self.layout.n]
        if not near.any():
            return self._evaluate_far(z, lanes)
        if near.all():
            return self._evaluate_near(z, lanes)
        lanes = np.arange(len(self.zeros))[lanes]
        result = np.empty((3, z.size))
        result[:, near] = self._evaluate_near(z[near], lanes[near])
        result[:, ~near] = self._evaluate_far(z[~near], lanes[~near])
        return result[0], result[1], result[2]

    def _evaluate_far(self, z: Array, lanes: Lanes) -> tuple[Array, Array, Array]:
        _, *basis = self._basis_far(z)
        value, first, second = self._functions["derivatives"].function(*self._coefficients[:, lanes], z, *basis)
        return value, first / z, second / z**2

    def _evaluate_near(self, z: Array, lanes: Lanes) -> tuple[Array, Array, Array]:
        powers = self._power_series[:, lanes]
        value, first, second = powers[-1], np.zeros_like(z), np.zeros_like(z)
        for term in powers[-2::-1]:
            second = second * z + first
            first = first * z + value
            value = value * z + term
        return value, first, 2 * second

    def _basis_far(self, z: Array) -> tuple[Array, ...]:
        lam = wave_number(z, self.layout.n)
        decay = np.exp(-lam) if self.layout.n == 2 else 1.0
        return lam, *self._functions["basis"].function(lam, decay)

    def _basis(self, z: Array) -> tuple[Array, ...]:
        """Return lambda and the basis, scaled, for any z."""
        limit = NEAR[self.layout.n]
        near = self._functions["basis_near"].function(np.minimum(z, limit))
        lam, *far = self._basis_far(z)
        return lam, *(np.where(z < limit, a, b) for a, b in zip(near, far, strict=True))


def _with_parity(value: Array, number: Counts, change: int | Counts) -> Counts:
    """Return the number, changed where the sign of the value is not that of ``(-1)**number``."""
    return np.where((value > 0) == (number % 2 == 0), number, number + change)
