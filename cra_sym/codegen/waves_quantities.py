"""Quantities of the waves of a block as numbers in rows, and other rearrangements of traced formulas."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from functools import reduce
from itertools import combinations
from operator import mul
from typing import Any

from cra_sym.codegen.traced import parts
from cra_sym.solvers import waves_kernel

__all__ = ["LENGTHS", "flat", "nested", "one_basis", "principal_minors", "with_rates"]

kernel: Any = waves_kernel  # formulas of arrays and terms, without types
LENGTHS = {1: 1, 2: 9, 3: 32}
"""Number of quantities of the waves of a block, by its size."""
_CONDITIONS = (0, 29, 30)
"""Quantities of a block of three that are conditions."""


def flat(waves: Any) -> list[Any]:
    """Return the quantities of the waves of a block as numbers; conditions are 1 or 0."""
    found: list[Any] = []
    for entry in waves:
        found += flat(entry) if isinstance(entry, tuple) else [entry]
    if len(found) == LENGTHS[3]:
        for place in _CONDITIONS:
            found[place] = kernel.where(found[place], 1.0, 0.0)
    return found


def nested(entries: Sequence[Any]) -> Any:
    """Return the result of `waves_three.alone` from the numbers in a row."""
    values = [entry > 0.5 if place in _CONDITIONS else entry for place, entry in enumerate(entries)]
    near, mu, *rest = values
    return near, mu, tuple(rest[:9]), tuple(rest[9:17]), tuple(rest[17:27]), tuple(rest[27:29]), rest[29]


def with_rates(values: Sequence[Any]) -> list[Any]:
    """Return the values, then their rates."""
    return [*(parts(value)[0] for value in values), *(parts(value)[1] for value in values)]


def one_basis(bases: Sequence[Any]) -> Any:
    """Return the product of the bases of all blocks, of which one at most is not 1."""
    return next((basis for basis in bases if not isinstance(basis, float)), 1.0)


def principal_minors(matrix: Sequence[Sequence[Any]]) -> Iterator[tuple[Any, Any]]:
    """Yield the principal minors of a matrix and, of more than one row, the product of the sizes of its diagonal."""
    for size in range(1, len(matrix) + 1):
        for places in combinations(range(len(matrix)), size):
            entries = [[matrix[i][j] for j in places] for i in places]
            scale = reduce(mul, [abs(matrix[i][i]) for i in places])
            yield kernel.determinant(entries), None if size == 1 else scale
