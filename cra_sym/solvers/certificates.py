"""Enclosures of natural frequencies, proved by an exact count: each contains its frequency, and none is missed.

Ball arithmetic (Arb through python-flint) is used: every operation returns a ball that contains the exact result, so a
ball that excludes zero has a proved sign. The proof does not depend on the floating-point solver, whose values are only
the starting points of the search.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from threading import RLock
from typing import Any, Protocol, TypeVar

import numpy as np

from ..cached import released_in_children

__all__ = ["Counted", "UndecidedError", "decided", "enclose", "negatives", "outward", "precision"]

FIRST_PRECISION = 192
_LARGEST_PRECISION = 12_288
_NEAREST = -53  # exponent of two of the first relative width tried, twice the target width
_WIDEST = -8
_EQUAL = -40  # times the target width: frequencies that are closer share an enclosure
_SMALL = 7 / 2**4, 7 / 2**12, 7 / 2**36
"""Of the first frequency: only rigid-body modes lie below one of these. At its half a diagonal entry of the stiffness
may be exactly zero."""

Result = TypeVar("Result")
_ALONE = released_in_children(RLock())


class UndecidedError(ArithmeticError):
    """A sign could not be proved at the largest precision: the point is a zero, or too close to one."""


@contextmanager
def precision(flint: Any, bits: int) -> Iterator[None]:
    """Set the working precision in bits; one thread at a time, since FLINT's precision is global to the process."""
    with _ALONE, flint.ctx.workprec(bits):
        yield


class Counted(Protocol):
    """A problem with natural frequencies that can be counted; points are exact balls."""

    @property
    def zeros(self) -> int:
        """Number of natural frequencies that are exactly 0."""

    def count(self, point: Any) -> int:
        """Return the proved number of natural frequencies below the point, those at 0 included."""


def decided(flint: Any, attempt: Callable[[], Result], most: int = _LARGEST_PRECISION) -> Result:
    """Return the result of an attempt at the lowest working precision that raises no :class:`UndecidedError`.

    Parameters
    ----------
    flint : module
        ``flint`` of python-flint; its context's precision is restored at the end.
    attempt : callable
    most : int
        Bits of the largest precision.

    Raises
    ------
    UndecidedError
        If that is not enough.
    """
    bits = FIRST_PRECISION
    while bits <= most:
        with precision(flint, bits):
            try:
                return attempt()
            except (UndecidedError, ZeroDivisionError):
                bits *= 2
    raise UndecidedError(f"a sign is not decided at {most} bits")


def negatives(matrix: Sequence[Sequence[Any]]) -> int:
    """Return the proved number of negative eigenvalues of a symmetric or Hermitian matrix of balls, by Sylvester's law.

    Raises
    ------
    UndecidedError
        If a pivot's ball contains zero.
    """
    rows = [list(row) for row in matrix]
    number = 0
    while rows:
        size = len(rows)
        diagonal = [rows[i][i].real for i in range(size)]
        k = max(range(size), key=lambda i: abs(float(diagonal[i].mid())))
        pivot = diagonal[k]
        if pivot < 0:
            number += 1
        elif not pivot > 0:
            raise UndecidedError("a pivot holds zero")
        others = [i for i in range(size) if i != k]
        rows = [[rows[i][j] - rows[i][k] * rows[k][j] / pivot for j in others] for i in others]
    return number


def outward(ball: Any, towards: float) -> float:
    """Return the nearest floating-point number outside the ball on one side; exact zero stays zero.

    Parameters
    ----------
    ball : arb
    towards : float
        -inf or inf.
    """
    if ball == 0:
        return 0.0
    edge = ball.lower() if towards < 0 else ball.upper()
    number = float(edge)
    while not (type(ball)(number) <= edge if towards < 0 else type(ball)(number) >= edge):
        number = float(np.nextafter(number, towards))
    return number


def enclose(flint: Any, problem: Counted, guesses: Iterable[float]) -> list[tuple[Any, Any]]:
    """Return a proved enclosure of each of the first natural frequencies.

    Parameters
    ----------
    flint : module
        ``flint`` of python-flint.
    problem : Counted
    guesses : iterable of float
        Estimates of frequencies 1, 2, ...; better ones make it faster, the proof does not depend on them.

    Returns
    -------
    list of (arb, arb)
        Exact lower and upper ends, ascending; (0, 0) for a frequency of 0. The count shows that exactly as many
        frequencies lie below the lower end as precede, and one more below the upper end, so that the set is complete.
        Each is at most 2**-53 wide relative to its frequency. Frequencies that agree to 28 digits share an enclosure.

    Raises
    ------
    UndecidedError
        If a sign cannot be proved, or a frequency is not near its guess.
    """
    zero, guesses = flint.arb(0), list(guesses)
    with precision(flint, FIRST_PRECISION):
        first = next((guess for guess in guesses if guess > 0.0), 1.0)
        if problem.zeros and not any(problem.count(flint.arb(first) * share) == problem.zeros for share in _SMALL):
            raise UndecidedError("there are other motions near zero frequency, or unstable ones")
        return [
            (zero, zero) if number < problem.zeros else _enclosure(flint, problem, number, guess)
            for number, guess in enumerate(guesses)
        ]


def _enclosure(flint: Any, problem: Counted, number: int, guess: float) -> tuple[Any, Any]:
    low, high, below, above = _bracket(flint, problem, number, guess)
    width = flint.arb(guess) * flint.arb(2) ** (_NEAREST - 1)
    while high - low > width or below < number or above > number + 1:
        if high - low < width * flint.arb(2) ** _EQUAL:
            break  # a multiple frequency: enclosed together with its equals
        # any point will do; an exact number adds no width. Not the midpoint: the guess may be the frequency itself
        middle = ((9 * low + 7 * high) / 16).mid()
        counted = problem.count(middle)
        if counted <= number:
            low, below = middle, counted
        else:
            high, above = middle, counted
    return low, high


def _bracket(flint: Any, problem: Counted, number: int, guess: float) -> tuple[Any, Any, int, int]:
    """Return two points around the guess, one with at most ``number`` frequencies below, one with more."""
    centre = flint.arb(guess)
    for exponent in range(_NEAREST, _WIDEST + 1, 3):
        reach = centre * flint.arb(2) ** exponent
        low, high = (centre - reach).mid(), (centre + reach).mid()
        below, above = problem.count(low), problem.count(high)
        if below <= number < above:
            return low, high, below, above
    raise UndecidedError(f"frequency {number + 1} is not near {guess!r}")
