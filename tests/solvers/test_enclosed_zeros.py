"""Enclosed zeros of functions whose zeros are known, and what must not be claimed."""

from __future__ import annotations

import math

import pytest

from cra_sym.solvers.certificates import UndecidedError, precision

flint = pytest.importorskip("flint", reason="the extra 'certify' brings python-flint")
Disc = pytest.importorskip("cra_sym.solvers.enclosed_zeros").Disc


class Cosine:
    """cos z, with zeros at odd multiples of pi / 2."""

    power = 1

    def value(self, z):
        return z.cos() ** self.power

    def bound(self, radius):
        return radius.cosh() ** self.power


class SquaredCosine(Cosine):
    power = 2


class Product:
    """A polynomial with given zeros, one of each pair."""

    def __init__(self, *zeros):
        self.zeros = [flint.acb(z) for z in zeros] + [flint.acb(z).conjugate() for z in zeros if complex(z).imag]

    def value(self, z):
        return math.prod((z - zero for zero in self.zeros), start=flint.acb(1))

    def bound(self, radius):
        return math.prod((radius + abs(zero) for zero in self.zeros), start=flint.arb(1))


class Pole:
    """1 + 1 / (1 + z): a zero at -2, beyond the pole."""

    def value(self, z):
        return 1 + 1 / (1 + z)

    def bound(self, radius):
        return 1 + 1 / (1 - radius) if radius < 1 else None


@pytest.fixture(autouse=True)
def bits():
    with precision(flint, 256):
        yield


def test_zeros_of_a_cosine_are_enclosed_and_counted():
    disc = Disc.of(flint, Cosine(), 12.0, 0, False)
    zeros = disc.enclosed(disc.approximate())
    assert len(zeros) == 8 and all(zero.real and zero.total == 1 for zero in zeros)
    for k in (1, 3, 5, 7):
        exact = k * flint.arb.pi() / 2
        assert sum(bool(abs(abs(zero.centre) * 12 - exact) <= 12 * zero.radius) for zero in zeros) == 2
    for radius, number in ((1.0, 0), (2.0, 2), (6.0, 4), (10.0, 6)):
        assert disc.number(flint.arb(radius) / 12) == number


def test_double_zeros_are_enclosed_together():
    disc = Disc.of(flint, SquaredCosine(), 3.0, 0, False)
    zeros = disc.enclosed(disc.approximate())
    assert [zero.number for zero in zeros] == [2, 2] and not any(zero.real for zero in zeros)
    assert disc.number(flint.arb(0.9)) == 4


@pytest.mark.parametrize("gap", [1e-12, 1e-3])
def test_neighbours_are_told_apart(gap):
    """Two pairs, and a pair near the real axis beside a real zero."""
    given = [complex(-0.5, 1.0), complex(-0.5, 1.0 + gap), complex(0.7, gap), 0.7]
    disc = Disc.of(flint, Product(*given), 2.0, 0, False)
    zeros = disc.enclosed(disc.approximate())
    assert len(zeros) == 4 and [zero.number for zero in zeros] == [1] * 4
    for s in given:
        assert any(abs(zero.centre * 2 - flint.acb(s)) <= 2 * zero.radius for zero in zeros)
    assert disc.number(flint.arb(0.9)) == 7


def test_zeros_at_zero_are_divided_out():
    disc = Disc.of(flint, Product(0.0, 0.0, 0.25), 1.0, 2, False)
    (zero,) = disc.enclosed(disc.approximate())
    assert abs(zero.centre - flint.acb(0.25)) <= zero.radius and disc.number(flint.arb(0.5)) == 1


def test_a_zero_that_is_left_out_is_counted():
    """The number along the circle does not come from the enclosures."""
    disc = Disc.of(flint, Cosine(), 6.0, 0, False)
    some = disc.enclosed(disc.approximate()[1:])
    assert sum(zero.total for zero in some) == 3 and disc.number(flint.arb(0.9)) == 4


def test_a_wrong_guess_is_no_enclosure():
    disc = Disc.of(flint, Cosine(), 6.0, 0, False)
    with pytest.raises(UndecidedError):
        disc.enclosed([flint.acb(0.1)])


def test_a_zero_on_the_circle_is_not_counted():
    disc = Disc.of(flint, Product(0.5, 0.25), 1.0, 0, False)
    with pytest.raises(UndecidedError, match="too near"):
        disc.number(flint.arb(0.5))


def test_nothing_is_claimed_beyond_a_pole():
    assert Disc.of(flint, Pole(), 0.5, 0, False).number(flint.arb(0.9)) == 0
    with pytest.raises(UndecidedError, match="analytic"):
        Disc.of(flint, Pole(), 1.5, 0, False)


def test_the_rest_bounds_what_the_polynomial_leaves_out():
    """At places in the disc, with so many digits that the difference is not rounding."""
    with precision(flint, 1024):
        disc = Disc.of(flint, Cosine(), 6.0, 0, False)
        polynomial = flint.acb_poly(disc.coefficients)
        differences = []
        for share in (flint.acb(1), flint.acb(0, 1), flint.acb(0.6, 0.8), flint.acb(-0.3, 0.2)):
            difference = abs((share * 6).cos() - polynomial(share))
            assert difference <= disc.rest
            differences.append(difference)
        assert any(difference > disc.rest * flint.arb(2) ** -100 for difference in differences)
