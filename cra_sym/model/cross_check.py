"""Natural frequencies of a system compared with those of Ritz's method on Hermite elements, an independent method."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from cra_sym.model.values import flat_columns

if TYPE_CHECKING:
    from sympy import Expr, Symbol

    from cra_sym.model.system import System

__all__ = ["CrossCheck", "cross_check"]

Array = NDArray[np.float64]
_ELEMENTS, _FEWEST = 32, 2  # of all spans together where no derivative is above the second, of one span
_ROUNDING = 1e-15  # of Ritz's method, times the number of elements to the power of the condition of the stiffness


@dataclass(frozen=True)
class CrossCheck:
    """Comparison of two methods for the natural frequencies.

    Attributes
    ----------
    difference : ndarray, shape (...)
        Largest relative difference among the modes: frequency by Ritz's method over that of the system, minus one.
    mode : ndarray of int, shape (...)
        Which mode that is, from 1.
    expected : ndarray, shape (...)
        Largest difference that the error estimates of both methods allow for that mode.
    agree : ndarray of bool, shape (...)
        Whether no mode differs by more than that.
    cause : str
        Most likely cause of the largest difference of all sets.
    """

    difference: Array
    mode: NDArray[np.intp]
    expected: Array
    agree: NDArray[np.bool_]
    cause: str


def cross_check(system: System, modes: int) -> CrossCheck:
    """Compare natural frequencies with those of Hermite elements that have nodes at every breakpoint."""
    own = system.natural_frequencies(modes).reshape(-1, modes) / (2.0 * np.pi)
    accuracy = np.broadcast_to(system.accuracy, system.shape).reshape(-1, 1)
    order = max(2, *system.model.linearised.variation.orders)
    coarse, fine, elements = _by_ritz(system, modes, order)
    with np.errstate(divide="ignore", invalid="ignore"):
        difference = np.where(own > 0.0, fine / own - 1.0, np.where(fine > 0.0, np.inf, 0.0))
        falling = np.where(fine > 0.0, coarse / fine - 1.0, 0.0)
    expected = accuracy + np.abs(falling) + _ROUNDING * (2.0 * elements[:, None]) ** (2 * order)
    over = np.abs(difference) - expected
    mode = np.where((over > 0.0).any(axis=1), over.argmax(axis=1), np.abs(difference).argmax(axis=1))
    rows = np.arange(len(own))
    worst = int(np.argmax(np.where((over > 0.0).any(axis=1), np.inf, np.abs(difference[rows, mode]))))
    shape = system.shape
    return CrossCheck(
        difference[rows, mode].reshape(shape),
        (mode + 1).reshape(shape),
        expected[rows, mode].reshape(shape),
        (over <= 0.0).all(axis=1).reshape(shape),
        _cause(difference[worst, mode[worst]], mode[worst] + 1, accuracy[worst, 0], falling[worst, mode[worst]]),
    )


def _cause(difference: float, mode: int, accuracy: float, falling: float) -> str:
    expected = accuracy + abs(falling)
    found = f"mode {mode}: Ritz's method lies {abs(difference):.1g} {'above' if difference >= 0.0 else 'below'}; "
    if abs(difference) <= max(2.0 * expected, 1e-9):
        return found + (
            f"halving its elements changes it by {falling:.1g}"
            if falling >= accuracy
            else f"the system's own error estimate is {accuracy:.1g}"
        )
    if difference < 0.0:
        return (
            found
            + f"it is an upper bound, so the system's frequency is wrong, with an error estimate of {accuracy:.1g}"
        )
    return found + (
        f"halving its elements changes it by {falling:.1g}, the system's own error estimate is {accuracy:.1g}: "
        "one misses a mode or detail of a coefficient"
    )


def _by_ritz(system: System, modes: int, order: int) -> tuple[Array, Array, Array]:
    """Return frequencies in Hz on a mesh and a refined one, (sets, modes), and the number of elements of the first."""
    from cra_sym.mechanics import ritz
    from cra_sym.model.galerkin import Ritz

    model, spatial = system.model, system.numerics("spatial")
    columns = flat_columns(system.parameters, system.shape)
    whole = (2.0 * _ELEMENTS) ** (2.0 / order) / 2.0  # rounding is then the same for every order
    sets = columns.shape[1]
    found = np.empty((2, sets, modes))
    number = np.empty(sets)
    for rows, names, places in _nodes(system, columns):
        each = max(_FEWEST, int(np.ceil((whole + modes) / (len(names) + 1))))
        values = {name: column[rows] for name, column in zip(spatial.names, columns, strict=True)}
        values |= {symbol.name: at for symbol, at in zip(places[0], places[1], strict=True)}
        for k, elements in enumerate((each, 2 * each)):
            matrices = ritz(model.linearised, elements=elements, nodes=names)
            found[k, rows] = Ritz(matrices, (*model.symbols, *places[0])).natural_frequencies(values, modes)
        number[rows] = each * (len(names) + 1)
    return found[0], found[1], number


def _nodes(
    system: System, columns: Array
) -> Iterator[tuple[NDArray[np.intp], tuple[Expr, ...], tuple[tuple[Symbol, ...], tuple[Array, ...]]]]:
    """Yield sets with equal numbers of breakpoints, the nodes as symbols or places, and (symbols, their values)."""
    from sympy import Symbol

    spatial = system.numerics("spatial")
    finite = np.where(np.isinf(columns), 0.0, columns)
    length, left = (np.broadcast_to(value, columns.shape[1:]) for value in spatial.geometry.function(*finite))
    if spatial.breaks is None:
        yield np.arange(columns.shape[1]), (), ((), ())
        return
    stated = [point.place for point in system.model.equations.variation.points]
    for rows, edges, nodes in spatial.breaks.edges(finite, left, length):
        symbols = [Symbol(f"breakpoint_{k}") for k in range(1, edges.shape[1] - 1)]
        names = [stated[nodes.index(k)] if k in nodes else symbols[k - 1] for k in range(1, edges.shape[1] - 1)]
        free = [k for k, name in enumerate(names) if name is symbols[k]]
        yield rows, tuple(names), (tuple(symbols[k] for k in free), tuple(edges[:, k + 1] for k in free))
