r"""Multiple scales of nonlinear modal equations: the slow flow of the amplitudes at a resonance.

The modal equations have the Lagrangian

.. math:: L = \sum_n \tfrac12(\dot q_n^2 - \omega_n^2 q_n^2) + \sum T[q, \ldots, \dot q, \ldots]

and, in addition, damping :math:`2c_n\dot q_n`, a parametric stiffness :math:`P_{mn}\cos\varpi t`, and forces
:math:`f_n\cos\varpi t`. Solutions are expanded in the amplitude; damping, detuning and excitation are of the order of
the leading nonlinear terms in the amplitude equations.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from typing import Any

from sympy import Eq, Expr, Function, I, Rational, S, Symbol, conjugate, exp, expand, latex, symbols
from sympy.core.function import AppliedUndef

from cra_sym.mechanics.steps import Step

__all__ = ["Coefficient", "SlowFlow", "slow_flow"]

Vector = tuple[int, ...]
Series = dict[tuple[int, Vector], Expr]
VARPI, SIGMA, TIME = Symbol("varpi", positive=True), Symbol("sigma", real=True), Symbol("t", real=True)
_HIGHEST = 3  # order in the amplitude


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
class SlowFlow:
    r"""Slow evolution of the complex amplitudes, :math:`q_n = A_n e^{i\omega_n t} + c.c. + \ldots`

    Attributes
    ----------
    resonance : Any
        As requested.
    detuning : Eq or None
        Definition of sigma.
    amplitude_equations : tuple of Eq
        dA_n/dt of every mode that takes part.
    backbone : Expr or None
        For one mode: change of its frequency per squared real amplitude a = 2 abs(A).
    response : Eq or None
        For one excited mode: equation of the real amplitude a of steady vibration.
    coefficients : tuple of Coefficient
        The symbols of the tensors that occur.
    steps : tuple of Step
    """

    resonance: Any
    detuning: Eq | None
    amplitude_equations: tuple[Eq, ...]
    backbone: Expr | None
    response: Eq | None
    coefficients: tuple[Coefficient, ...]
    steps: tuple[Step, ...]

    def _repr_latex_(self) -> str:
        lines = r" \\ ".join(map(latex, self.amplitude_equations))
        return rf"$\displaystyle \begin{{gathered}}{lines}\end{{gathered}}$"


@dataclass(frozen=True)
class _Resonance:
    """Resonant modes, relation of the frequencies (modes.., varpi), and the order of the excitation."""

    modes: tuple[int, ...]
    relation: Vector | None
    forcing: str  # 'none', 'weak' (primary), 'hard' (super- and subharmonic), 'parametric'


def _read(resonance: Any, total: int) -> _Resonance:
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
        return _Resonance(modes, None, "none")
    if kind == "internal":
        first, second, factor = numbers
        if first == second or factor < 1:
            raise ValueError(f"resonance = {resonance!r}: {allowed}")
        relation[second - 1], relation[first - 1] = 1, -factor
        return _Resonance(modes, tuple(relation), "none")
    if kind:
        n, factor = numbers
        if factor < 2:
            raise ValueError(f"resonance = {resonance!r}: the factor {factor} must be at least 2")
        relation[-1], relation[n - 1] = (factor, -1) if kind == "superharmonic" else (1, -factor)
        return _Resonance(modes, tuple(relation), "hard")
    relation[-1] = 1
    for n in numbers:
        relation[abs(n) - 1] -= 1 if n > 0 else -1
    return _Resonance(modes, tuple(relation), "parametric" if len(numbers) == 2 else "weak")


class _Expansion:
    """Powers of the amplitude and harmonics of symbolic frequencies."""

    def __init__(self, resonance: _Resonance, total: int, coefficients: Sequence[Coefficient]) -> None:
        self.resonance, self.total, self.coefficients = resonance, total, coefficients
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
                if a + b <= _HIGHEST:
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


def slow_flow(resonance: Any, coefficients: Sequence[Coefficient], modes: int, order: int = 1) -> SlowFlow:
    """Return the slow flow of modal equations with given nonlinear coefficients; see `cra_sym.Model.slow_flow`.

    Raises
    ------
    ValueError
        If ``order`` is not 1 or the resonance is not valid.
    """
    if order != 1:
        raise ValueError(f"order = {order!r}: must be 1, the first order at which the amplitudes change")
    about = _read(resonance, modes)
    expansion = _Expansion(about, modes, coefficients)
    first = expansion.first()
    forces = expansion.nonlinear(first)
    secular, power = expansion.secular(forces, 2), 2
    second: list[Series] | None = None
    if not any(value != 0 for value in secular.values()):
        second, power = expansion.second(forces), 3
        both = [one | two for one, two in zip(first, second, strict=True)]
        secular = expansion.secular(expansion.nonlinear(both), 3)
    flows = {n: expand(part + expansion.excited(n)) / (2 * I * expansion.omega[n]) for n, part in secular.items()}
    return _result(resonance, expansion, flows, power, first, second, secular)


def _result(
    resonance: Any,
    expansion: _Expansion,
    flows: Mapping[int, Expr],
    power: int,
    first: list[Series],
    second: list[Series] | None,
    secular: Mapping[int, Expr],
) -> SlowFlow:
    functions = {n: Function(f"A_{n + 1}")(TIME) for n in flows}
    named: dict[Symbol, Expr] = {expansion.amplitude[n]: f for n, f in functions.items()}
    named |= {expansion.conjugate[n]: conjugate(f) for n, f in functions.items()}

    def in_functions(expression: Expr) -> Expr:
        return expand(expression).xreplace(named)

    equations = tuple(Eq(f.diff(TIME), in_functions(flows[n])) for n, f in functions.items())
    relation = expansion.resonance.relation
    detuning = None
    if relation is not None:
        gap = sum((k * w for k, w in zip(relation, expansion.frequencies, strict=True)), S.Zero)
        detuning = Eq(SIGMA, gap)
    backbone, response = _alone(expansion, flows)
    steps = _steps(expansion, in_functions, functions, first, second, secular, equations, detuning, power)
    used = {s for e in equations for s in e.free_symbols}
    occurring = tuple(c for c in expansion.coefficients if c.symbol in used)
    return SlowFlow(resonance, detuning, equations, backbone, response, occurring, steps)


def _alone(expansion: _Expansion, flows: Mapping[int, Expr]) -> tuple[Expr | None, Eq | None]:
    """Return backbone and steady response of a resonance of one mode."""
    if len(flows) > 1:
        return None, None
    ((n, flow),) = flows.items()
    a, size = Symbol("a", positive=True), expansion.amplitude[n]
    terms = expand(flow.xreplace({size: a / 2, expansion.conjugate[n]: a / 2})).as_ordered_terms()
    own = expand(sum((term for term in terms if not term.has(SIGMA)), S.Zero) / (a / 2))
    driven = sum((term for term in terms if term.has(SIGMA)), S.Zero).subs(TIME, 0)
    shrinking, turning = own.coeff(a, 2).as_real_imag()
    decay, drift = own.coeff(a, 0).as_real_imag()
    backbone = expand(turning)
    relation = expansion.resonance.relation
    if relation is None or driven == 0:
        return backbone, None
    # A = a/2 exp(i (sigma t/s + psi)): all terms have the same phase velocity, and the moduli of both parts are equal
    slow = SIGMA / -relation[n]
    left = ((decay + shrinking * a**2) ** 2 + (backbone * a**2 + drift - slow) ** 2) * a**2 / 4
    return backbone, Eq(left, expand(driven * conjugate(driven)))


def _steps(
    expansion: _Expansion,
    in_functions: Any,
    functions: Mapping[int, AppliedUndef],
    first: list[Series],
    second: list[Series] | None,
    secular: Mapping[int, Expr],
    equations: tuple[Eq, ...],
    detuning: Eq | None,
    power: int,
) -> tuple[Step, ...]:
    def wave(h: Vector) -> Expr:
        value = sum((k * w for k, w in zip(h, expansion.frequencies, strict=True)), S.Zero)
        return exp(I * value * TIME)

    def written(series: Series, order: int) -> Expr:
        return sum((in_functions(value) * wave(h) for (p, h), value in series.items() if p == order), S.Zero)

    steps = []
    statements = [
        (
            "first order",
            "Free vibration of the modes that take part, with amplitudes that change slowly.",
            tuple(Eq(Symbol(f"q_{n + 1}"), written(s, 1), evaluate=False) for n, s in enumerate(first) if s),
        )
    ]
    if detuning is not None:
        statements.append(("detuning", "How far the frequencies are from the exact resonance.", detuning))
    if second is not None and any(second):
        statements.append(
            (
                "second order",
                "What quadratic terms add; no force is resonant there.",
                tuple(Eq(Symbol(f"q_{n + 1}"), written(s, 2), evaluate=False) for n, s in enumerate(second) if s),
            )
        )
    statements += [
        (
            "secular terms",
            f"The resonant forces of order {power} in the amplitude.",
            tuple(Eq(Symbol(f"S_{n + 1}"), in_functions(part), evaluate=False) for n, part in secular.items()),
        ),
        ("amplitude equations", "The amplitudes change so that no term grows.", equations),
    ]
    before: tuple[str, ...] = ()
    for name, statement, expression in statements:
        steps.append(Step(name, statement, expression, before, "integration in time of the modal equations"))
        before = (name,)
    return tuple(steps)
