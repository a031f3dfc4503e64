r"""All zeros of an analytic function in a disc, enclosed and counted in ball arithmetic.

In the unit :math:`\sigma` of the disc the function is a polynomial and a rest that is bounded. The coefficients are
sums of samples on the unit circle; what these leave out follows from a bound of the function on a larger circle
(Cauchy). Real coefficients make every zero real, or one of a conjugate pair.

About an approximate zero c the polynomial is :math:`\sum b_j h^j`. If :math:`|b_k| r^k` exceeds the sum of all other
terms at r and of the rest, exactly k zeros lie within r of c (Pellet; Rouche for the rest). The number of zeros within
a circle is the winding number of the values along it. The circle is covered by discs within each of which the constant
term exceeds the sum of all others and of the rest, so that no zero lies there and the values keep to a half plane.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from fractions import Fraction
from typing import Any, NamedTuple, Protocol

from .certificates import UndecidedError

__all__ = ["INSIDE", "Analytic", "Disc", "Zero"]

_RATIOS = tuple(2.0 ** (k / 4) for k in (0.25, 0.5, 1, 2, 3, 4, 6, 8, 10, 12, 16, 20, 24, 32, 48, 64))
_MOST_TERMS = 4096
_MARGIN = 2 / 3  # share of the precision by which the rest lies below the smallest sample
_ENOUGH = 128  # bits of the precision beyond those of the ratio of samples
INSIDE = 0.95  # zeros are sought within this share of the disc
_MOST_TOGETHER = 8
_NARROW = -60  # exponent of two of the largest relative radius of an enclosure
_HIGHER = 8  # largest precision for approximate zeros, which may nearly coincide, over that of the function
_STEPS = 60  # of Newton's method, which halves the distance from a double zero
_SHORT = 48  # coefficients of the product with an exponential
_ARCS, _DEEPEST = 8, 40  # parts of a half circle to begin with, and how often one may be halved
_PROBES, _INNER = 16, 1 / 64  # samples on the upper half circle, and one inside, that tell the size of values


class Analytic(Protocol):
    """A function with real coefficients, in ball arithmetic."""

    def value(self, z: Any) -> Any:
        """Return a ball that contains the value (acb)."""

    def bound(self, radius: Any) -> Any | None:
        """Return a bound of the modulus within a radius; None if there may be a singular point."""


class Zero(NamedTuple):
    """Zeros within a radius of a centre, in the unit of the disc.

    Attributes
    ----------
    centre : acb
        Exact. With the imaginary part 0 the zeros are real or conjugate pairs; else it is positive, and as many zeros
        lie around the conjugate centre.
    radius : arb
    number : int
        Multiplicities counted.
    """

    centre: Any
    radius: Any
    number: int

    @property
    def total(self) -> int:
        """The number with that of the conjugate zeros."""
        return self.number if self.centre.imag == 0 else 2 * self.number

    @property
    def real(self) -> bool:
        """Whether the zero is proved to be real."""
        return bool(self.centre.imag == 0) and self.number == 1


@dataclass(frozen=True)
class Disc:
    """A function on a disc about zero, divided by the power of z of its zero there.

    Attributes
    ----------
    flint : module
    radius : float
    coefficients : list of arb
        Of the polynomial in the unit of the disc.
    rest : arb
        Bound of the difference between function and polynomial on the disc.
    symmetric : bool
        Whether the zeros are symmetric about the imaginary axis.
    """

    flint: Any
    radius: float
    coefficients: list[Any]
    rest: Any
    symmetric: bool = False

    @classmethod
    def of(cls, flint: Any, function: Analytic, radius: float, at_zero: int, symmetric: bool) -> Disc:
        """Return the function on a disc, at the working precision.

        Parameters
        ----------
        flint : module
        function : Analytic
        radius : float
        at_zero : int
            Proved multiplicity of the zero at z = 0, which is divided out.
        symmetric : bool

        Raises
        ------
        UndecidedError
            If the function is not known to be analytic on a larger disc, or too many terms are needed.
        """
        unit = flint.arb(radius)

        def sample(share: Any) -> Any:
            return function.value(flint.acb(share).exp_pi_i() * unit)

        sizes = [abs(sample(flint.arb(2 * k + 1) / (2 * _PROBES))) for k in range(_PROBES)]
        inner = flint.arb(_INNER)
        sizes.append(abs(function.value(flint.acb(0, inner * unit))) / inner**at_zero)
        if not all(size.is_finite() and size > 0 for size in sizes):
            raise UndecidedError("a sample holds zero")
        least, most = (pick(float(_log2(size.lower())) for size in sizes) for pick in (min, max))
        if flint.ctx.prec < most - least + _ENOUGH:
            raise UndecidedError("the values are of too different size")
        wanted = least - _MARGIN * flint.ctx.prec
        found = list(_tails(flint, function, unit, wanted))
        if not found:
            raise UndecidedError("the function is not known to be analytic beyond the disc")
        terms, ratio, largest = min(found, key=lambda item: item[0])
        if terms > _MOST_TERMS:
            raise UndecidedError("too many terms")
        half = [sample(flint.arb(2 * k) / terms) for k in range(terms // 2 + 1)]
        values = half + [value.conjugate() for value in half[-2:0:-1]]
        coefficients = [(value / terms).real for value in flint.acb.dft(values)]
        rest = 2 * largest * flint.arb(ratio) ** (-terms) / (1 - 1 / flint.arb(ratio))
        rest = sum((value.abs_upper() for value in coefficients[:at_zero]), rest)  # of what is exactly 0
        return cls(flint, radius, coefficients[at_zero:], rest.upper(), symmetric)

    def refined(self, guesses: Iterable[complex]) -> list[Any]:
        """Return zeros of the polynomial that Newton's method finds from guesses, as :meth:`approximate` does.

        Parameters
        ----------
        guesses : iterable of complex
            In the unit of the disc; some zeros may have none. It takes a small part of the time.
        """
        flint = self.flint
        polynomial = flint.acb_poly([value.mid() for value in self.coefficients])
        slope, close = polynomial.derivative(), flint.arb(2) ** (_NARROW - 20)
        kept: list[Any] = []
        for guess in guesses:
            root = flint.acb(complex(guess))
            for _ in range(_STEPS):
                step = (polynomial(root) / slope(root)).mid()
                root = (root - step).mid()
                if not abs(step) > close * abs(root):
                    break
            tiny = abs(root.imag) < close * abs(root)
            root = flint.acb(root.real, 0 if tiny else abs(root.imag))
            if abs(root) < INSIDE and not any(abs(root - other) < close * abs(root) for other in kept):
                kept.append(root)
        return sorted(kept, key=lambda root: float(abs(root)))

    def approximate(self) -> list[Any]:
        """Return all zeros of the polynomial within the disc by ascending modulus, one of each conjugate pair."""
        of = self.flint.acb_poly
        try:
            found = of([value.mid() for value in self.coefficients]).roots(
                self.flint.arb(2) ** (_NARROW - 20), _HIGHER * self.flint.ctx.prec
            )
        except ValueError as error:
            raise UndecidedError(str(error)) from None
        kept = []
        for root in found:
            if root.imag.contains(0):
                root = self.flint.acb(root.real)
            if not root.imag < 0 and abs(root) < INSIDE:
                kept.append(self.flint.acb(root.real.mid(), root.imag.mid()))
        return sorted(kept, key=lambda root: float(abs(root)))

    def enclosed(self, approximate: Sequence[Any]) -> list[Zero]:
        """Return proved enclosures of zeros near approximate ones, those that cannot be separated together.

        Raises
        ------
        UndecidedError
            If that takes a higher precision.
        """
        groups = [[root] for root in approximate]
        found = [self._around(group) for group in groups]
        while True:
            pair = next(self._joined(groups, found), None)
            if pair is None:
                return [zero for zero in found if zero is not None]
            first, second = pair
            group = [*groups[first], *(groups[second] if second != first else [z.conjugate() for z in groups[first]])]
            if len(group) > _MOST_TOGETHER:
                raise UndecidedError("zeros are not separated")
            for place in sorted({first, second}, reverse=True):
                del groups[place], found[place]
            groups.append(group)
            found.append(self._around(group))

    def _joined(self, groups: list[list[Any]], found: list[Zero | None]) -> Iterator[tuple[int, int]]:
        """Yield pairs of groups that must be taken together; twice the same for one and its conjugate."""
        for i, zero in enumerate(found):
            if zero is None:
                centre = groups[i][0]
                gaps = [(float(abs(centre - other[0])), j) for j, other in enumerate(groups) if j != i]
                if centre.imag > 0:
                    gaps.append((2 * float(centre.imag), i))
                if not gaps:
                    raise UndecidedError("a zero is not enclosed")
                yield i, min(gaps)[1]
                continue
            if zero.centre.imag != 0 and not zero.centre.imag > zero.radius:
                yield i, i
            for j, other in enumerate(found[:i]):
                if other is not None and not abs(other.centre - zero.centre) > other.radius + zero.radius:
                    yield i, j

    def _around(self, group: Sequence[Any]) -> Zero | None:
        """Return the enclosure of a group of approximate zeros, or None."""
        mean = sum(group, self.flint.acb(0)) / len(group)
        paired = any(root.imag < 0 for root in group) or all(root.imag == 0 for root in group)
        centre = self.flint.acb(mean.real.mid(), 0 if paired else mean.imag.mid())
        tiny = self.flint.arb(2) ** _NARROW
        if self.symmetric and abs(centre.real) < tiny * abs(centre):
            upright = self.flint.acb(0, centre.imag)
            return self._within(upright, len(group)) or self._within(centre, len(group))
        return self._within(centre, len(group))

    def _within(self, centre: Any, number: int) -> Zero | None:
        """Return a disc with exactly as many zeros, proved and narrow, or None."""
        values = self._about(centre)
        if number >= len(values):
            return None
        least = values[number].abs_lower()
        sizes = [value.abs_upper() for value in values]
        sizes[0] += self.rest
        if not least > 0:
            return None
        shares = [(4 * number * size / least).root(number - j).upper() for j, size in enumerate(sizes[:number])]
        radius = self.flint.arb(max(shares))
        if not radius < self.flint.arb(2) ** _NARROW * abs(centre) or not abs(centre) + radius < 1:
            return None
        others = sum((size * radius**j for j, size in enumerate(sizes) if j != number), self.flint.arb(0))
        return Zero(centre, radius, number) if others < least * radius**number else None

    def _about(self, centre: Any) -> list[Any]:
        """Return the coefficients of the polynomial in the distance from a point."""
        of = self.flint.acb_poly
        return list(of(self.coefficients)(of([centre, 1])).coeffs())

    def _turn(self, centre: Any, start: Any, stop: Any, reach: Any) -> Any | None:
        """Return the change of the argument between two points near a centre; None if there may be a zero near it.

        Times ``exp(-rate h)`` the function is nearly constant there.
        """
        flint, values = self.flint, self._about(centre)
        if not abs(values[0]) > 0:
            return None
        rate = (values[1] / values[0]).mid()
        factor = [flint.acb(1)]
        for j in range(1, _SHORT):
            factor.append(-factor[-1] * rate / j)
        near = list((flint.acb_poly(values[:_SHORT]) * flint.acb_poly(factor)).truncate(_SHORT).coeffs())
        sizes = [flint.arb_poly([abs(value) for value in part]) for part in (values, values[:_SHORT], factor)]
        grown = (abs(rate) * reach).exp()
        left_out = sizes[0](reach) * grown - (sizes[1] * sizes[2]).truncate(_SHORT)(reach) + self.rest * grown
        others = sum((b.abs_upper() * reach**j for j, b in enumerate(near) if j), left_out.upper())
        if not others < near[0].abs_lower():
            return None
        rest = flint.acb(flint.arb(0, self.rest), flint.arb(0, self.rest))
        before, after = ((flint.acb_poly(values)(h) + rest) * (-rate * h).exp() for h in (start, stop))
        return (after / before).arg() + (rate * (stop - start)).imag

    def number(self, radius: Any) -> int:
        """Return the proved number of zeros within a radius, in the unit of the disc, those at z = 0 left out.

        Raises
        ------
        UndecidedError
            If a zero lies too near to the circle.
        """
        flint, turn = self.flint, self.flint.arb(0)
        arcs = [(Fraction(k, _ARCS), Fraction(k + 1, _ARCS), 0) for k in range(_ARCS)]

        def point(share: Fraction) -> Any:
            found = flint.acb(flint.arb(flint.fmpq(share.numerator, share.denominator))).exp_pi_i() * radius
            return flint.acb(found.real.mid(), 0 if share.denominator == 1 else found.imag.mid())

        while arcs:
            first, last, depth = arcs.pop()
            start, stop = point(first), point(last)
            centre = ((start + stop) / 2).mid()
            reach = ((abs(stop - start) / 2) * (1 + flint.arb(2) ** -20)).upper()
            change = self._turn(centre, start - centre, stop - centre, reach) if abs(centre) + reach < 1 else None
            if change is not None:
                turn += change
            elif depth == _DEEPEST:
                raise UndecidedError("a zero lies too near to the circle")
            else:
                middle = (first + last) / 2
                arcs += [(first, middle, depth + 1), (middle, last, depth + 1)]
        found = (turn / flint.arb.pi()).unique_fmpz()
        if found is None:
            raise UndecidedError("the winding number is not decided")
        return int(found)


def _tails(flint: Any, function: Analytic, unit: Any, wanted: float) -> Iterator[tuple[int, float, Any]]:
    """Yield (even number of terms, ratio of radii, bound) for which the rest is small enough."""
    for ratio in _RATIOS:
        largest = function.bound(unit * ratio)
        if largest is None:
            return
        if not largest.is_finite() or not largest > 0:
            continue
        excess = float(_log2(2 * largest / (1 - 1 / flint.arb(ratio)))) - wanted
        yield 2 * max(4, int(excess / (2 * float(_log2(flint.arb(ratio))))) + 1), ratio, largest


def _log2(value: Any) -> Any:
    return value.log_base(2)
