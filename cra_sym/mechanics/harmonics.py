"""Sums of harmonics whose frequencies are integer combinations of given, possibly incommensurate, frequencies."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from functools import reduce
from typing import Any

from sympy import Expr, I, S, Symbol, exp, expand

__all__ = ["Harmonics", "Vector"]

#: Coefficients of a frequency in terms of the natural frequencies, one an entry.
Vector = tuple[Any, ...]


@dataclass(frozen=True)
class Harmonics:
    r"""A sum :math:`\sum c\,e^{i(\nu T_0 + p\sigma T_r)}` stored as ``{(vector of nu, p): c}``.

    Two harmonics are the same exactly when their integer vectors are, so the frequencies may be incommensurate
    symbols. The coefficients are polynomials in the complex amplitudes.
    """

    terms: Mapping[tuple[Vector, Any], Expr]

    @classmethod
    def total(cls, parts: Iterable[Harmonics]) -> Harmonics:
        """Return the sum of the parts."""
        return reduce(Harmonics.__add__, parts, cls({}))

    def __add__(self, other: Harmonics) -> Harmonics:
        """Sum, harmonic by harmonic."""
        terms = dict(self.terms)
        for key, coefficient in other.terms.items():
            terms[key] = terms.get(key, S.Zero) + coefficient
        return Harmonics({key: c for key, c in terms.items() if c != 0})

    def __mul__(self, other: Any) -> Harmonics:
        """Product with another sum, in which frequencies add, or with a constant."""
        if not isinstance(other, Harmonics):
            return Harmonics({key: c * other for key, c in self.terms.items() if other != 0})
        products = (
            Harmonics({(tuple(a + b for a, b in zip(v, w, strict=True)), p + r): c * d})
            for (v, p), c in self.terms.items()
            for (w, r), d in other.terms.items()
        )
        return Harmonics.total(products)

    def map(self, change: Callable[[Vector, Expr], Expr]) -> Harmonics:
        """Return the sum with every coefficient changed."""
        return Harmonics({(v, p): change(v, c) for (v, p), c in self.terms.items()})

    def fast(self, frequencies: Iterable[Expr]) -> Harmonics:
        """Return the derivative with respect to the fast time."""
        given = tuple(frequencies)
        return self.map(lambda vector, c: I * frequency_of(vector, given) * c)

    def slow(self, rates: Mapping[Symbol, Harmonics], sigma: Expr | None) -> Harmonics:
        """Return the derivative with respect to a slow time.

        Parameters
        ----------
        rates : mapping
            Derivative of each complex amplitude with respect to that slow time.
        sigma : Expr or None
            Detuning, when the phases depend on that slow time.
        """
        parts = []
        for key, c in self.terms.items():
            parts += [Harmonics({key: c.diff(a)}) * rates[a] for a in c.free_symbols & rates.keys()]
            if sigma is not None and key[1] != 0:
                parts.append(Harmonics({key: I * key[1] * sigma * c}))
        return Harmonics.total(parts)

    def part(self, vector: Vector) -> Harmonics:
        """Return the coefficient of one frequency: slowly varying, so its own frequency is zero."""
        zero = tuple(S.Zero for _ in vector)
        return Harmonics({(zero, p): expand(c) for (v, p), c in self.terms.items() if v == vector})

    def without(self, *vectors: Vector) -> Harmonics:
        """Return the sum without some frequencies."""
        return Harmonics({(v, p): c for (v, p), c in self.terms.items() if v not in vectors})

    def expression(self, frequencies: Iterable[Expr], fast: Expr, slow_phase: Expr) -> Expr:
        """Return the sum as an expression; ``slow_phase`` is the detuning times its slow time."""
        given = tuple(frequencies)
        return sum(
            (c * exp(I * (frequency_of(v, given) * fast + p * slow_phase)) for (v, p), c in self.terms.items()), S.Zero
        )


def frequency_of(vector: Vector, frequencies: Iterable[Expr]) -> Expr:
    """Return the frequency a vector stands for."""
    return sum((a * omega for a, omega in zip(vector, frequencies, strict=True)), S.Zero)
