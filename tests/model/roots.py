"""How far a number is from the root of a function, in many digits."""

from collections.abc import Callable

from mpmath import mpc, mpf

__all__ = ["distance"]


def distance(function: Callable, value: complex, digits: int) -> float:
    """Return Newton's step from a number over the number; the step of the difference quotient is 10**-digits of it."""
    s = mpc(complex(value))
    step = s * mpf(10) ** -digits
    slope = (function(s + step) - function(s - step)) / (2 * step)
    return abs(function(s) / slope / s)
