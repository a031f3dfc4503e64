"""Enclosures of natural frequencies that an exact count proves: each holds its own, and none is missed.

The arithmetic is that of balls (Arb through python-flint): every operation returns a ball that holds the exact
result, so a ball away from zero has a proved sign. Nothing here rests upon the floating-point solver: its values are
only where the search begins.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from threading import RLock
from typing import Any, Protocol, TypeVar

__all__ = ["Counted", "UndecidedError", "decided", "enclose", "negatives", "precision"]

FIRST_PRECISION = 192
_LARGEST_PRECISION = 12_288
_NEAREST = -53  # the first width tried, relative, as a power of two; the width wanted is half of it
_WIDEST = -8
_EQUAL = -40  # of the width wanted: frequencies that are closer share an enclosure

Result = TypeVar("Result")
_ALONE = RLock()


class UndecidedError(ArithmeticError):
    """A sign could not be proved at the largest precision: the point is a zero, or as good as one."""


@contextmanager
def precision(flint: Any, bits: int) -> Iterator[None]:
    """Work with so many bits; threads take turns, since the precision of FLINT belongs to the whole process."""
    with _ALONE, flint.ctx.workprec(bits):
        yield


class Counted(Protocol):
    """A problem with natural frequencies that can be counted; points are exact balls."""

    @property
    def zeros(self) -> int:
        """Number of natural frequencies that are exactly 0."""

    def count(self, point: Any) -> int:
        """Return the proved number of natural frequencies below the point, those at 0 included."""


def decided(flint: Any, attempt: Callable[[], Result]) -> Result:
    """Return what an attempt returns at the first working precision at which it raises no :class:`UndecidedError`.

    Parameters
    ----------
    flint : module
        ``flint`` of python-flint; its context's precision is restored at the end.
    attempt : callable

    Raises
    ------
    UndecidedError
        If 12288 bits are not enough.
    """
    bits = FIRST_PRECISION
    while bits <= _LARGEST_PRECISION:
        with precision(flint, bits):
            try:
                return attempt()
            except (UndecidedError, ZeroDivisionError):
                bits *= 2
    raise UndecidedError(f"a sign is not decided at {_LARGEST_PRECISION} bits")


def negatives(matrix: Sequence[Sequence[Any]]) -> int:
    """Return the proved number of negative eigenvalues of a symmetric matrix of balls, by Sylvester's law of inertia.

    Raises
    ------
    UndecidedError
        If a pivot holds zero.
    """
    rows = [list(row) for row in matrix]
    number = 0
    while rows:
        size = len(rows)
        k = max(range(size), key=lambda i: abs(float(rows[i][i].mid())))
        pivot = rows[k][k]
        if pivot < 0:
            number += 1
        elif not pivot > 0:
            raise UndecidedError("a pivot holds zero")
        others = [i for i in range(size) if i != k]
        rows = [[rows[i][j] - rows[i][k] * rows[k][j] / pivot for j in others] for i in others]
    return number


def enclose(flint: Any, problem: Counted, guesses: Iterable[float]) -> list[tuple[Any, Any]]:
    """Return a proved enclosure of each of the first natural frequencies.

    Parameters
    ----------
    flint : module
        ``flint`` of python-flint.
    problem : Counted
    guesses : iterable of float
        Where frequency 1, 2, ... is expected; the better, the faster. They carry no weight in the proof.

    Returns
    -------
    list of (arb, arb)
        Exact lower and upper ends, ascending; (0, 0) for a frequency of 0. Below the lower end lie exactly as many as
        come before, below the upper end one more: the count makes the set complete. Each is at most 2**-53 wide
        relative to its frequency. Frequencies that agree to 28 digits share an enclosure, with so many in it.

    Raises
    ------
    UndecidedError
        If a sign cannot be proved, or a frequency is not near its guess.
    """
    zero = flint.arb(0)
    with precision(flint, FIRST_PRECISION):
        return [
            (zero, zero) if number < problem.zeros else _enclosure(flint, problem, number, guess)
            for number, guess in enumerate(guesses)
        ]


def _enclosure(flint: Any, problem: Counted, number: int, guess: float) -> tuple[Any, Any]:
    low, high, below, above = _bracket(flint, problem, number, guess)
    width = flint.arb(guess) * flint.arb(2) ** (_NEAREST - 1)
    while high - low > width or below < number or above > number + 1:
        if high - low < width * flint.arb(2) ** _EQUAL:
            break  # a multiple one: it is enclosed with its equals
        # any point will do, and an exact one costs no width; the half is the guess, which may be the frequency itself
        middle = ((9 * low + 7 * high) / 16).mid()
        counted = problem.count(middle)
        if counted <= number:
            low, below = middle, counted
        else:
            high, above = middle, counted
    return low, high


def _bracket(flint: Any, problem: Counted, number: int, guess: float) -> tuple[Any, Any, int, int]:
    """Return two points around the guess, with at most ``number`` and with more frequencies below, and how many."""
    centre = flint.arb(guess)
    for exponent in range(_NEAREST, _WIDEST + 1, 3):
        reach = centre * flint.arb(2) ** exponent
        low, high = (centre - reach).mid(), (centre + reach).mid()
        below, above = problem.count(low), problem.count(high)
        if below <= number < above:
            return low, high, below, above
    raise UndecidedError(f"frequency {number + 1} is not near {guess!r}")
