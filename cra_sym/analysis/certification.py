"""Proved natural frequencies: enclosures in ball arithmetic with a proof that none is missed."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np

from cra_sym.analysis.modes import natural_frequencies
from cra_sym.arm.parameters import Arm
from cra_sym.arm.route import arm_route
from cra_sym.checks import count, instance
from cra_sym.extras import require
from cra_sym.solvers.certificates import UndecidedError, decided, enclose

__all__ = ["Certificate", "certify"]

_FIELDS = ("L", "b", "h", "E", "rho", "m_e", "J_e", "k_t", "k_r")


@dataclass(frozen=True, eq=False)
class Certificate:
    """Proved enclosures of natural frequencies.

    Attributes
    ----------
    lower, upper : ndarray, shape (..., modes)
        Hz, rounded outward: the natural frequency of the arm, its parameters taken as the exact values of their
        floating-point numbers, lies in between. Both are 0 for a rigid-body mode, nan where nothing is proved.
    complete : ndarray of bool, shape (...)
        Whether every enclosure of the arm is proved to hold exactly one frequency, with none between or below them.
    """

    lower: np.ndarray
    upper: np.ndarray
    complete: np.ndarray


def certify(arm: Arm, modes: int = 3) -> Certificate:
    """Prove the first natural frequencies of an arm, (23) and (30).

    The number of frequencies below a point is exact: from the beam pinned at both ends, one constraint after another
    is released, each step changes the number by at most one, and the sign of a determinant, proved in ball
    arithmetic, says whether it does. Two such numbers a zero make the enclosure and its completeness.

    Parameters
    ----------
    arm : Arm
        Any parameters in range, arrays too; infinite and zero stiffness are ordinary.
    modes : int
        How many, 1 to 1000, rigid-body modes included.

    Returns
    -------
    Certificate
        Enclosures at most a few units in the last place wide.

    Raises
    ------
    TypeError, ValueError
        If ``arm`` is no :class:`Arm`, or ``modes`` no integer from 1 to 1000.
    MissingExtraError
        If python-flint is not installed (extra ``certify``).
    """
    instance("arm", arm, Arm)
    modes = count("modes", modes)
    flint = require("flint", "certify")
    values = np.broadcast_arrays(*(getattr(arm, name) for name in _FIELDS))
    guesses = np.asarray(natural_frequencies(arm, modes=modes))
    shape = guesses.shape[:-1]
    lower, upper = np.full((2, *guesses.shape), np.nan)
    complete = np.zeros(shape, dtype=bool)
    for index in np.ndindex(shape):
        function = _BallArm(flint, dict(zip(_FIELDS, (float(value[index]) for value in values), strict=True)))
        try:
            lower[index], upper[index] = _enclosed(flint, function, guesses[index])
            complete[index] = True
        except UndecidedError:
            continue
    return Certificate(lower, upper, complete)


class _BallArm:
    """The arm's determinant and count at a point, in lambda, for one set of parameters."""

    def __init__(self, flint: Any, parameters: dict[str, float]) -> None:
        self._flint, self._parameters = flint, parameters
        self.zeros = (parameters["k_t"] == 0.0) + (parameters["k_r"] == 0.0)
        self._pairs = cache(self._pairs_at)

    def frequency(self, lam: Any) -> Any:
        """Frequency in Hz at lambda, (30)."""
        exact = self._exact()
        return lam**2 * (exact["EI"] / exact["rhoA"]).sqrt() / (2 * self._flint.arb.pi() * exact["L"] ** 2)

    def guess(self, frequency: float) -> float:
        """Lambda at a frequency, to the last digits or so: where a search begins."""
        return float((self._flint.arb(frequency) / self.frequency(self._flint.arb(1))).sqrt())

    def count(self, point: Any) -> int:
        """Return the proved number of zeros below the point."""
        number = self._pinned(point)
        for link, change in enumerate(arm_route().layout.changes, start=1):
            assert isinstance(change, int), "no slope of the arm has both a spring and an inertia"
            if self._is_positive(point, link) != (number % 2 == 0):
                number += change
        return number

    def is_positive(self, point: Any) -> bool:
        """Return the proved sign of the arm's own determinant."""
        return self._is_positive(point, -1)

    def _pinned(self, point: Any) -> int:
        """Number of zeros n pi, n = 1, 2, ..., of the pinned beam below the point."""

        def beyond(number: int) -> bool:
            return decided(self._flint, lambda: point - number * self._flint.arb.pi())

        number = int(float(point) / math.pi)
        while number > 0 and not beyond(number):
            number -= 1
        while beyond(number + 1):
            number += 1
        return number

    def _is_positive(self, point: Any, link: int) -> bool:
        return decided(self._flint, lambda: self._links(point)[link])

    def _links(self, point: Any) -> tuple[Any, ...]:
        known = arm_route().family.functions
        products = known["products"].function(point, point.cos(), point.sin(), point.cosh(), point.sinh())
        return known["chain"].function(*self._pairs(self._flint.ctx.prec), point**4, self._flint.arb(1), *products)

    def _pairs_at(self, precision: int) -> list[Any]:
        """Stiffnesses and inertias as pairs (s, c) at the context's precision; only the ratios matter."""
        exact, zero, one = self._exact(), self._flint.arb(0), self._flint.arb(1)
        mass = exact["rhoA"] * exact["L"]
        ratios = {
            "k_t": (exact["L"] ** 3, exact["EI"]),
            "k_r": (exact["L"], exact["EI"]),
            "m_e": (one, mass),
            "J_e": (one, mass * exact["L"] ** 2),
        }
        pairs = []
        for name, (factor, denominator) in ratios.items():
            infinite = self._parameters[name] == math.inf
            pairs += [one, zero] if infinite else [exact[name] * factor, denominator]
        return pairs

    def _exact(self) -> dict[str, Any]:
        exact = {name: self._flint.arb(value) for name, value in self._parameters.items()}
        area = exact["b"] * exact["h"]
        return {**exact, "EI": exact["E"] * area * exact["h"] ** 2 / 12, "rhoA": exact["rho"] * area}


def _enclosed(flint: Any, function: _BallArm, guesses: np.ndarray) -> tuple[list[float], list[float]]:
    enclosures = enclose(flint, function, [function.guess(frequency) for frequency in guesses])
    with flint.ctx.workprec(128):
        ends = [(function.frequency(low), function.frequency(high)) for low, high in enclosures]
    return [_outward(low, -np.inf) for low, _ in ends], [_outward(high, np.inf) for _, high in ends]


def _outward(ball: Any, towards: float) -> float:
    """Return the nearest floating-point number outside the ball on one side; exact zero stays zero."""
    if ball == 0:
        return 0.0
    edge = ball.lower() if towards < 0 else ball.upper()
    number = float(edge)
    while not (type(ball)(number) <= edge if towards < 0 else type(ball)(number) >= edge):
        number = float(np.nextafter(number, towards))
    return number
