"""Expansion of modal motions in powers of the amplitude and harmonics of symbolic frequencies."""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from fractions import Fraction
from typing import Any

from sympy import Expr, I, Rational, S, Symbol, exp, expand, symbols

__all__ = ["SIGMA", "TIME", "AmplitudeExpansion", "Coefficient", "Resonance", "Series", "Vector"]

Vector = tuple[int, ...]
Series = dict[tuple[int, Vector], Expr]
"""Coefficients by the power of the amplitude and the multiples of the frequencies."""
VARPI, SIGMA, TIME = Symbol("varpi", positive=True), Symbol("sigma", real=True), Symbol("t", real=True)


@dataclass(frozen=True)
class Coefficient:
    """A symbol for an entry of a coefficient tensor, up to a factor.

    Attributes
    ----------
    symbol : Symbol
    positions, velocities : int
        Degrees that identify the tensor of the Lagrangian, or of the forces.
    indices : tuple of int
        Modes, from 1; of a force the equation first.
    factor : Rational
        The entry is the symbol times this.
    force : bool
    """

    symbol: Symbol
    positions: int
    velocities: int
    indices: tuple[int, ...]
    factor: Rational
    force: bool = False


@dataclass(frozen=True)
class Resonance:
    """Resonant modes, relation of the frequencies (modes.., varpi), and the order of the excitation."""

    modes: tuple[int, ...]
    relation: Vector | None
    forcing: str  # 'none', 'weak' (primary), 'hard' (super- and subharmonic), 'parametric'


def _read(resonance: Any, total: int) -> Resonance:
    allowed = (
        "must be a mode n (primary), (n, n), (m, n) or (m, -n) (parametric), ('free', n), ('superharmonic', n, k), "
        "('subharmonic', n, k) or ('internal', m, n, k)"
    )
    named = resonance if isinstance(resonance, tuple) else (resonance,)
    kind, numbers = (named[0], named[1:]) if isinstance(named[0], str) else ("", named)
    whole = all(isinstance(n, int) and not isinstance(n, bool) and n for n in numbers)
    counts = {"free": 1, "superharmonic": 2, "subharmonic": 2, "internal": 3}
    if not whole or not numbers or (kind and counts.get(kind) != len(numbers)) or (not kind and len(numbers) > 2):
        raise ValueError(f"resonance = {resonance!r}: {allowed}")
    modes = numbers if not kind else numbers[: 2 if kind == "internal" else 1]
    modes = tuple(dict.fromkeys(abs(n) for n in modes))
    if max(modes) > total or (min(numbers[0], *numbers) < 0 and kind):
        raise ValueError(f"resonance = {resonance!r}: its modes must be from 1 to {total}")
    relation = [0] * (total + 1)
    if kind == "free":
        return Resonance(modes, None, "none")
    if kind == "internal":
        first, second, factor = numbers
        if first == second or factor < 1:
            raise ValueError(f"resonance = {resonance!r}: {allowed}")
        relation[second - 1], relation[first - 1] = 1, -factor
        return Resonance(modes, tuple(relation), "none")
    if kind:
        n, factor = numbers
        if factor < 2:
            raise ValueError(f"resonance = {resonance!r}: the factor {factor} must be at least 2")
        relation[-1], relation[n - 1] = (factor, -1) if kind == "superharmonic" else (1, -factor)
        return Resonance(modes, tuple(relation), "hard")
    relation[-1] = 1
    for n in numbers:
        relation[abs(n) - 1] -= 1 if n > 0 else -1
    return Resonance(modes, tuple(relation), "parametric" if len(numbers) == 2 else "weak")


class AmplitudeExpansion:
    """Powers of the amplitude and harmonics of symbolic frequencies."""

    highest = 3
    """Power of the amplitude up to which products are kept."""

    def __init__(self, resonance: Any, total: int, coefficients: Sequence[Coefficient]) -> None:
        self.resonance, self.total, self.coefficients = _read(resonance, total), total, coefficients
        self.omega = symbols(f"omega_1:{total + 1}", positive=True)
        self.frequencies = (*self.omega, VARPI)
        self.amplitude = symbols(f"A_1:{total + 1}")
        self.conjugate = symbols(f"Abar_1:{total + 1}")
        self.decay = symbols(f"c_1:{total + 1}", nonnegative=True)
        self.force = symbols(f"f_1:{total + 1}", real=True)

    def unit(self, n: int, sign: int = 1) -> Vector:
        return tuple(sign * int(k == n) for k in range(self.total + 1))

    def frequency(self, harmonic: Vector) -> Expr:
        """Return the frequency of a harmonic at exact resonance; sigma appears as a slow phase of the amplitudes."""
        value = sum((k * w for k, w in zip(harmonic, self.frequencies, strict=True)), S.Zero)
        relation = self.resonance.relation
        if relation is None:
            return value
        last = self.total if relation[-1] else max(k for k in range(self.total) if relation[k])
        solved = self.frequencies[last] - Rational(1, relation[last]) * sum(
            (k * w for k, w in zip(relation, self.frequencies, strict=True)), S.Zero
        )
        return expand(value.subs(self.frequencies[last], solved))

    def first(self) -> list[Series]:
        """Return the solution of first order, by mode."""
        found: list[Series] = []
        for n in range(self.total):
            series: Series = {}
            if n + 1 in self.resonance.modes:
                series[1, self.unit(n)], series[1, self.unit(n, -1)] = self.amplitude[n], self.conjugate[n]
            if self.resonance.forcing == "hard":
                size = self.force[n] / (2 * (self.omega[n] ** 2 - self.frequency(self.unit(self.total)) ** 2))
                series[1, self.unit(self.total)] = series[1, self.unit(self.total, -1)] = size
            found.append(series)
        return found

    def times(self, one: Series, other: Series) -> Series:
        found: Series = {}
        for (a, h), x in one.items():
            for (b, k), y in other.items():
                if a + b <= self.highest:
                    key = a + b, tuple(i + j for i, j in zip(h, k, strict=True))
                    found[key] = found.get(key, S.Zero) + x * y
        return {key: expand(value) for key, value in found.items()}

    def rate(self, series: Series) -> Series:
        return {(order, h): I * self.frequency(h) * value for (order, h), value in series.items()}

    def nonlinear(self, q: list[Series]) -> list[Series]:
        """Return dL/dq - d/dt dL/dv of the nonlinear terms, and forces without a Lagrangian, by mode."""
        v = [self.rate(series) for series in q]
        total: list[Series] = [{} for _ in q]
        for c in self.coefficients:
            entry = c.symbol * c.factor
            shift = int(c.force)
            places, speeds = c.indices[shift : shift + c.positions], c.indices[shift + c.positions :]
            if c.force:
                _accumulate(total[c.indices[0] - 1], self._product(q, v, places, speeds), entry)
                continue
            orders = _arrangements(places) * _arrangements(speeds)
            for n in dict.fromkeys(places):
                rest = list(places)
                rest.remove(n)
                part = self._product(q, v, rest, speeds)
                _accumulate(total[n - 1], part, entry * orders * places.count(n))
            for n in dict.fromkeys(speeds):
                rest = list(speeds)
                rest.remove(n)
                part = self.rate(self._product(q, v, places, rest))
                _accumulate(total[n - 1], part, -entry * orders * speeds.count(n))
        return total

    def _product(self, q: list[Series], v: list[Series], places: Iterable[int], speeds: Iterable[int]) -> Series:
        found: Series = {(0, (0,) * (self.total + 1)): S.One}
        for series in itertools.chain((q[n - 1] for n in places), (v[n - 1] for n in speeds)):
            found = self.times(found, series)
        return found

    def turns(self, harmonic: Vector, n: int) -> int | None:
        """Return the multiple of the relation that added to omega_n gives the harmonic, or None."""
        gap = [h - e for h, e in zip(harmonic, self.unit(n), strict=True)]
        if not any(gap):
            return 0
        relation = self.resonance.relation
        if relation is None:
            return None
        ratios = {Fraction(g, r) for g, r in zip(gap, relation, strict=True) if r}
        off = any(g for g, r in zip(gap, relation, strict=True) if not r)
        ratio = next(iter(ratios))
        return None if off or len(ratios) > 1 or ratio.denominator > 1 else int(ratio)

    def secular(self, forces: list[Series], order: int) -> dict[int, Expr]:
        """Return the resonant part of the forces on every resonant mode."""
        found = {}
        for n in (m - 1 for m in self.resonance.modes):
            total = S.Zero
            for (power, h), value in forces[n].items():
                turn = self.turns(h, n) if power == order else None
                if turn is not None:
                    total += value * exp(I * turn * SIGMA * TIME)
            found[n] = expand(total)
        return found

    def second(self, forces: list[Series]) -> list[Series]:
        """Return the solution of second order."""
        found: list[Series] = []
        for n in range(self.total):
            series: Series = {}
            for (power, h), value in forces[n].items():
                resonant = n + 1 in self.resonance.modes and (
                    self.turns(h, n) is not None or self.turns(tuple(-k for k in h), n) is not None
                )
                if power == 2 and value != 0 and not resonant:
                    series[2, h] = value / (self.omega[n] ** 2 - self.frequency(h) ** 2)
            found.append(series)
        return found

    def excited(self, n: int) -> Expr:
        """Return the resonant part of damping and weak excitation on a mode."""
        total = -2 * I * self.omega[n] * self.decay[n] * self.amplitude[n]
        relation = self.resonance.relation
        assert relation is not None or self.resonance.forcing == "none"
        if self.resonance.forcing == "weak" and n + 1 in self.resonance.modes:
            total += self.force[n] / 2 * exp(I * SIGMA * TIME)
        if self.resonance.forcing == "parametric":
            for k in (m - 1 for m in self.resonance.modes):
                coupling = Symbol(f"P_{n + 1}{k + 1}", real=True)
                for sign in (1, -1):
                    for amplitude, own in ((self.amplitude[k], 1), (self.conjugate[k], -1)):
                        h = tuple(a + b for a, b in zip(self.unit(k, own), self.unit(self.total, sign), strict=True))
                        turn = self.turns(h, n)
                        if turn is not None:
                            total -= coupling / 2 * amplitude * exp(I * turn * SIGMA * TIME)
        return total


def _accumulate(total: Series, part: Series, factor: Expr) -> None:
    for key, value in part.items():
        total[key] = total.get(key, S.Zero) + factor * value


def _arrangements(indices: Sequence[int]) -> int:
    return len(set(itertools.permutations(indices)))
