"""Enclosures of zeros that an exact count proves: in each exactly one, between them none.

The arithmetic is that of balls (Arb through python-flint): every operation returns a ball that holds the exact
result, so a ball away from zero has a proved sign. Nothing here rests upon the floating-point solver: its values are
only where the search begins.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, Protocol

__all__ = ["BallCharacteristic", "UndecidedError", "decided", "enclose"]

_FIRST_PRECISION = 192
_LARGEST_PRECISION = 12_288
_NEAREST = -53  # the first width tried, relative, as a power of two; the width wanted is half of it
_WIDEST = -8


class UndecidedError(ArithmeticError):
    """A sign could not be proved at the largest precision: the point is a zero, or as good as one."""


class BallCharacteristic(Protocol):
    """An entire function of one variable, with real zeros only, in ball arithmetic; points are exact balls."""

    zeros: int

    def count(self, point: Any) -> int:
        """Return the proved number of zeros below the point, those at 0 included."""

    def is_positive(self, point: Any) -> bool:
        """Return the proved sign of the function at the point, which is that of ``(-1)**count``."""


def decided(flint: Any, sign: Callable[[], Any]) -> bool:
    """Return whether a ball is positive, raising the working precision until it excludes zero.

    Parameters
    ----------
    flint : module
        ``flint`` of python-flint; its context's precision is restored at the end.
    sign : callable
        Makes the ball at the precision of the moment.

    Raises
    ------
    UndecidedError
        If the ball still holds zero at 12288 bits.
    """
    precision = _FIRST_PRECISION
    while precision <= _LARGEST_PRECISION:
        with flint.ctx.workprec(precision):
            ball = sign()
        if ball > 0:
            return True
        if ball < 0:
            return False
        precision *= 2
    raise UndecidedError(f"a sign is not decided at {_LARGEST_PRECISION} bits")


def enclose(flint: Any, function: BallCharacteristic, guesses: Sequence[float]) -> list[tuple[Any, Any]]:
    """Return a proved enclosure of each of the first zeros.

    Parameters
    ----------
    flint : module
        ``flint`` of python-flint.
    function : BallCharacteristic
        The function and its count.
    guesses : sequence of float
        Where zero 1, 2, ... is expected; the better, the faster. They carry no weight in the proof.

    Returns
    -------
    list of (arb, arb)
        Exact lower and upper ends, ascending and disjoint; (0, 0) for a zero at 0. Below the lower end lie exactly as
        many zeros as come before, below the upper end one more: the count makes the set complete. Each is at most
        2**-53 wide relative to its zero.

    Raises
    ------
    UndecidedError
        If a sign cannot be proved, or no enclosure is found: two zeros lie closer together than their enclosures.
    """
    zero = flint.arb(0)
    with flint.ctx.workprec(_FIRST_PRECISION):
        return [
            (zero, zero) if number < function.zeros else _enclosure(flint, function, number, guess)
            for number, guess in enumerate(guesses)
        ]


def _enclosure(flint: Any, function: BallCharacteristic, number: int, guess: float) -> tuple[Any, Any]:
    low, high = _bracket(flint, function, number, guess)
    width = flint.arb(guess) * flint.arb(2) ** (_NEAREST - 1)
    while high - low > width:
        middle = _exact((low + high) / 2)
        if function.is_positive(middle) == (number % 2 == 0):
            low = middle
        else:
            high = middle
    return low, high


def _bracket(flint: Any, function: BallCharacteristic, number: int, guess: float) -> tuple[Any, Any]:
    """Return two points around the guess with ``number`` and ``number + 1`` zeros below them."""
    centre = flint.arb(guess)
    for exponent in range(_NEAREST, _WIDEST + 1, 3):
        reach = centre * flint.arb(2) ** exponent
        low, high = _exact(centre - reach), _exact(centre + reach)
        below, above = function.count(low), function.count(high)
        if below <= number < above:
            break
    else:
        raise UndecidedError(f"zero {number + 1} is not near {guess!r}")
    while below < number or above > number + 1:  # a neighbour lies in between too
        middle = _exact((low + high) / 2)
        counted = function.count(middle)
        if counted <= number:
            low, below = middle, counted
        else:
            high, above = middle, counted
    return low, high


def _exact(ball: Any) -> Any:
    """Return the ball's midpoint as an exact ball: any point will do, and an exact one costs no width."""
    return ball.mid()
