"""The first complex eigenvalues, enclosed in rectangles with a proof that none is missed.

All zeros of the characteristic determinant within a circle are enclosed and counted. The circle lies between the moduli
of the last eigenvalue asked for and of the next.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass
from fractions import Fraction
from functools import partial
from typing import Any, NamedTuple, NoReturn

import numpy as np
from numpy.typing import NDArray

from .ball_determinant import BallDeterminant
from .certificates import FIRST_PRECISION, UndecidedError, decided, precision
from .enclosed_zeros import INSIDE, Disc, Zero

__all__ = ["AmbiguousError", "CharacteristicProblem", "Eigenvalue", "first_eigenvalues"]

_LARGEST_PRECISION = 1536
_WIDER, _MOST_WIDER = 1.5, 12  # factor of the radius where it holds too few eigenvalues, and how often
_AROUND = 1.3, 1.15, 1.07  # first radius over the largest modulus expected, the largest that is possible
_SINGULAR = 1.1  # of a larger disc on which the coefficients must be finite
_CLEAR = -30  # exponent of two of the relative distance of enclosures from the circle
_SIMPLE = 2**60  # largest denominator of a fraction that zeros may coincide at
_DECIDING = 512  # bits
_GAP = 1e-4  # relative distance of moduli between which the circle passes


class Eigenvalue(NamedTuple):
    """An enclosure of an eigenvalue s, in rad/s: real and imaginary part (arb), and whether s may be real."""

    real: Any
    imag: Any
    oscillating: bool


class AmbiguousError(ArithmeticError):
    """Zeros coincide that may be real or a conjugate pair."""


class _TooFewError(Exception):
    """The disc holds too few eigenvalues."""


@dataclass(frozen=True)
class CharacteristicProblem:
    """What is known of the eigenvalues of a determinant.

    Attributes
    ----------
    flint : module
    determinant : BallDeterminant
    squared : bool
        Whether its parameter is z = omega^2 and not s.
    symmetric : bool
        Whether eigenvalues s are symmetric about the imaginary axis.
    rigid, at_zero : int
        Number of motions at s = 0, and multiplicity of that zero of the determinant.
    multiplicity : callable
        Returns a proved lower bound of the multiplicity of an eigenvalue at a value of the parameter (fmpq).
    signature : callable or None
        Of a problem that is symmetric at real s: returns the number of negative eigenvalues of its dynamic stiffness.
    """

    flint: Any
    determinant: BallDeterminant
    squared: bool
    symmetric: bool
    rigid: int
    at_zero: int
    multiplicity: Callable[[Any], int]
    signature: Callable[[Any], int] | None = None


def first_eigenvalues(
    problem: CharacteristicProblem, modes: int, oscillating: bool, largest: float, guesses: NDArray[np.complex128]
) -> list[Eigenvalue]:
    """Return proved enclosures of the first eigenvalues by ascending modulus, one of each conjugate pair.

    Of equal moduli the one with the larger real part comes first.

    Parameters
    ----------
    problem : CharacteristicProblem
    modes : int
    oscillating : bool
        Leave out real eigenvalues.
    largest : float
        About the largest modulus among them, rad/s.
    guesses : ndarray of complex
        Of eigenvalues of both kinds, with some that follow, in any order; they make it faster, and the proof depends on
        neither these nor the largest modulus.

    Raises
    ------
    UndecidedError
        If that is not proved at 1536 bits.
    AmbiguousError
        If zeros coincide that may be real or a pair.
    ValueError
        If a coefficient may be infinite at such moduli.
    """
    if not oscillating and modes <= problem.rigid:
        return [Eigenvalue(problem.flint.arb(0), problem.flint.arb(0), False)] * modes
    radius = largest * next((share for share in _AROUND if _analytic(problem, share * largest)), 0.0)
    if not radius:
        raise ValueError(
            f"modes = {modes}: eigenvalues accumulate, or may, where a coefficient is infinite, at a modulus of "
            f"{_SINGULAR * largest:.6g} rad/s or below, and none of larger modulus are counted; ask for fewer modes"
        )
    for _ in range(_MOST_WIDER):
        try:
            return decided(
                problem.flint,
                partial(_within, problem, modes, oscillating, _unit(problem, radius), guesses),
                _LARGEST_PRECISION,
            )
        except _TooFewError:
            radius *= _WIDER
    raise UndecidedError("there are too few eigenvalues")


def _unit(problem: CharacteristicProblem, radius: float) -> float:
    """Return the radius in the parameter of the determinant for one in s."""
    return radius**2 if problem.squared else radius


def _analytic(problem: CharacteristicProblem, radius: float) -> bool:
    """Return whether the determinant is known to be analytic well beyond a radius in s."""
    with precision(problem.flint, FIRST_PRECISION):
        beyond = problem.flint.arb(_SINGULAR * _unit(problem, radius))
        return problem.determinant.bound(beyond) is not None


def _within(
    problem: CharacteristicProblem, modes: int, oscillating: bool, unit: float, guesses: NDArray[np.complex128]
) -> list[Eigenvalue]:
    disc = Disc.of(problem.flint, problem.determinant, unit, problem.at_zero, problem.symmetric and not problem.squared)
    places = (-(guesses**2) if problem.squared else guesses) / unit
    with suppress(UndecidedError, _TooFewError):
        return _first(problem, disc, disc.refined(places[places != 0.0]), modes, oscillating)
    return _first(problem, disc, disc.approximate(), modes, oscillating)


def _first(
    problem: CharacteristicProblem, disc: Disc, roots: Sequence[Any], modes: int, oscillating: bool
) -> list[Eigenvalue]:
    """Return the first eigenvalues if the approximate zeros are all there are within a circle."""
    wanted = modes
    while True:
        found = _ordered(problem, disc, _enclosed(problem, disc, roots, wanted, oscillating), modes, oscillating)
        if len(found) == modes:
            return found
        wanted += modes - len(found)  # real zeros that coincide had looked like a pair


def _enclosed(
    problem: CharacteristicProblem, disc: Disc, roots: Sequence[Any], wanted: int, oscillating: bool
) -> list[Zero]:
    """Return all zeros within a circle around as many eigenvalues, if they are as many as they seem."""
    place, found = 0, 0 if oscillating else problem.rigid
    while found < wanted or not _apart(roots, place):
        if place == len(roots):
            raise _TooFewError
        found += _expected(problem, roots[place], oscillating)
        place += 1
    zeros = disc.enclosed(roots[:place])
    outer = abs(roots[place]) if place < len(roots) else problem.flint.arb(INSIDE)
    circle = ((abs(roots[place - 1]) + outer) / 2).mid()
    inside, within = sum(zero.total for zero in zeros), circle * (1 - problem.flint.arb(2) ** _CLEAR)
    if any(not abs(zero.centre) + zero.radius < within for zero in zeros) or disc.number(circle) != inside:
        raise UndecidedError("the number of eigenvalues differs from that of their enclosures")
    return zeros


def _apart(roots: Sequence[Any], place: int) -> bool:
    """Return whether a circle passes between the zeros before a place and the others."""
    if not place:
        return False
    last, following = float(abs(roots[place - 1])), float(abs(roots[place])) if place < len(roots) else INSIDE
    return following > last * (1.0 + _GAP)


def _expected(problem: CharacteristicProblem, root: Any, oscillating: bool) -> int:
    """Return how many eigenvalues of the kind that is asked for a zero stands for."""
    on_axis = root.imag == 0
    if problem.squared:
        return 2 * (not oscillating) if on_axis and root.real < 0 else 2 - on_axis
    return not oscillating if on_axis else 1


def _ordered(
    problem: CharacteristicProblem, disc: Disc, zeros: Sequence[Zero], modes: int, oscillating: bool
) -> list[Eigenvalue]:
    """Return the first eigenvalues by ascending modulus from all zeros within the circle."""
    flint = problem.flint
    still = Eigenvalue(flint.arb(0), flint.arb(0), False)
    groups = [[one] * zero.number for zero in zeros for one in _eigenvalues(problem, disc, zero)]
    groups = [group for group in groups if group[0].oscillating or not oscillating]
    groups.sort(key=lambda group: float(_modulus(flint, group[0]).mid()))
    found = [] if oscillating else [still] * problem.rigid
    while groups and len(found) < modes:
        first, *rest = groups
        alike = [group for group in rest if _modulus(flint, group[0]).overlaps(_modulus(flint, first[0]))]
        twins = problem.squared or problem.symmetric
        if len(alike) > 1 or (alike and not (twins and _mirrored(first[0], alike[0][0]))):
            raise UndecidedError("two moduli are not told apart")
        turn = sorted([first, *alike], key=lambda group: -float(group[0].real.mid()))
        found += [one for group in turn for one in group]
        groups = rest[len(alike) :]
    return found[:modes]


def _modulus(flint: Any, eigenvalue: Eigenvalue) -> Any:
    return abs(flint.acb(eigenvalue.real, eigenvalue.imag))


def _mirrored(first: Eigenvalue, second: Eigenvalue) -> bool:
    """Return whether two enclosures are of eigenvalues with the same modulus, mirrored by an axis."""
    return bool((first.real + second.real).contains(0) and (first.imag.overlaps(second.imag)))


def _eigenvalues(problem: CharacteristicProblem, disc: Disc, zero: Zero) -> Iterator[Eigenvalue]:
    """Yield the eigenvalues with an imaginary part of at least 0 that zeros stand for, one for each zero of a group."""
    flint, exact = problem.flint, problem.flint.arb(0)
    around = flint.arb(0, zero.radius)
    ball = (zero.centre + flint.acb(around, exact if zero.real else around)) * flint.arb(disc.radius)
    on_axis = zero.centre.imag == 0
    if problem.squared:
        if on_axis and not zero.real and not ball.real > 0 and not _all_real(problem, disc, zero):
            _refuse(problem)
        if on_axis and ball.real > 0:
            root = ball.sqrt()  # s = i omega
            yield Eigenvalue(exact if zero.real else -root.imag, root.real, True)
        elif on_axis:
            rate = (-ball.real).sqrt()
            yield from (Eigenvalue(rate, exact, False), Eigenvalue(-rate, exact, False))
        else:
            root = (-ball).sqrt()
            yield from (Eigenvalue(root.real, -root.imag, True), Eigenvalue(-root.real, -root.imag, True))
    elif on_axis:
        if not zero.real and not _all_real(problem, disc, zero):
            _refuse(problem)
        yield Eigenvalue(ball.real, exact, False)
    else:
        upright = problem.symmetric and zero.centre.real == 0 and zero.number == 1
        yield Eigenvalue(exact if upright else ball.real, ball.imag, True)


def _all_real(problem: CharacteristicProblem, disc: Disc, zero: Zero) -> bool:
    """Return whether all zeros about a real point are real: as many as the signature changes by, or equal fractions."""
    flint = problem.flint
    reach = zero.radius * (1 - flint.arb(2) ** _CLEAR)
    if problem.signature is not None:
        ends = [((zero.centre.real + side * reach) * disc.radius).mid() for side in (-1, 1)]
        first, last = map(problem.signature, ends)
        if abs(first - last) == zero.number:
            return True
    mantissa, exponent = (zero.centre.real * disc.radius).mid().man_exp()
    near = (Fraction(int(mantissa)) * Fraction(2) ** int(exponent)).limit_denominator(_SIMPLE)
    point = flint.fmpq(near.numerator, near.denominator)
    if not abs(flint.arb(point) / disc.radius - zero.centre.real) < reach:
        return False
    return problem.multiplicity(point) >= zero.number


def _refuse(problem: CharacteristicProblem) -> NoReturn:
    """Raise the error of coinciding zeros that are real or a pair: a higher precision decides that once, if at all."""
    kind = UndecidedError if problem.flint.ctx.prec < _DECIDING else AmbiguousError
    raise kind("zeros that coincide may be real or a pair")
