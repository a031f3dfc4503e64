"""Free vibration of one mode to fifth order in its amplitude, by the method of Lindstedt and Poincare."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from sympy import Eq, Expr, Function, I, Rational, S, Symbol, conjugate, cos, expand

from cra_sym.mechanics.amplitude_expansion import TIME, AmplitudeExpansion, Coefficient, Series
from cra_sym.mechanics.slow_flow import SlowFlow
from cra_sym.mechanics.steps import Step

__all__ = ["free_vibration"]

_HIGHEST = 5
_WORDS = {1: "first", 2: "second", 3: "third", 4: "fourth", 5: "fifth"}


class _Turning(AmplitudeExpansion):
    """Expansion of motions whose frequency depends on the amplitude."""

    def __init__(self, resonance: Any, total: int, coefficients: Sequence[Coefficient]) -> None:
        super().__init__(resonance, total, coefficients)
        self.mode = self.resonance.modes[0] - 1
        self.own = self.unit(self.mode)
        self.changes: dict[int, Expr] = {}  # of the frequency, by the power of the amplitude
        self.squares: dict[int, Expr] = {}  # of its square

    def rate(self, series: Series) -> Series:
        found: Series = {}
        for (order, h), value in series.items():
            for power, change in {0: self.omega[self.mode], **self.changes}.items():
                if order + power <= self.highest:
                    key = order + power, h
                    found[key] = found.get(key, S.Zero) + I * h[self.mode] * change * value
        return found

    def solved(self) -> list[Series]:
        """Return the motion of all modes; the first harmonic of its own mode is the amplitude."""
        q: list[Series] = [{} for _ in range(self.total)]
        q[self.mode] = {(1, self.own): Rational(1, 2), (1, self.unit(self.mode, -1)): Rational(1, 2)}
        for self.highest in range(2, _HIGHEST + 1):
            power = self.highest
            forces = [
                {h: expand(value) for (order, h), value in series.items() if order == power}
                for series in self.nonlinear(q)
            ]
            if power % 2:
                self._turned(power - 1, -2 * forces[self.mode].get(self.own, S.Zero))
            for series, force, omega in zip(q, forces, self.omega, strict=True):
                series |= self._order(power, series, force, omega)
        return q

    def _turned(self, power: int, square: Expr) -> None:
        """Store the change of the frequency by which no force of the next order is resonant."""
        cross = sum(
            (self.changes[k] * self.changes[power - k] for k in self.changes if power - k in self.changes), S.Zero
        )
        self.squares[power] = expand(square)
        self.changes[power] = expand((square - cross) / (2 * self.omega[self.mode]))

    def _order(self, power: int, series: Series, force: dict[Any, Expr], omega: Expr) -> Series:
        """Return the harmonics of one power of the amplitude in one mode."""
        right = dict(force)
        for lower, square in self.squares.items():
            for (order, h), value in series.items():
                if order + lower == power:
                    right[h] = right.get(h, S.Zero) + square * h[self.mode] ** 2 * value
        own = self.omega[self.mode]
        return {
            (power, h): expand(value) / (omega**2 - h[self.mode] ** 2 * own**2)
            for h, value in right.items()
            if value != 0 and not (omega == own and abs(h[self.mode]) == 1)
        }


def free_vibration(resonance: Any, coefficients: Sequence[Coefficient], modes: int) -> SlowFlow:
    """Return the free vibration of a mode without damping, its frequency to the fourth power of the amplitude.

    Raises
    ------
    ValueError
        If the resonance is not ``('free', n)``, or the equations have forces without a potential or terms that are odd
        in the velocities.
    """
    expansion = _Turning(resonance, modes, coefficients)
    if expansion.resonance.relation is not None:
        raise ValueError(f"resonance = {resonance!r}: must be ('free', n) with order = 2; take order = 1")
    if any(c.force for c in coefficients):
        raise ValueError("order = 2: the model has nonlinear forces beside its Lagrangian; take order = 1")
    if any(c.velocities % 2 for c in coefficients):
        raise ValueError("order = 2: the Lagrangian has terms that are odd in the velocities; take order = 1")
    motion = expansion.solved()
    a, mode = Symbol("a", positive=True), expansion.mode
    A = Function(f"A_{mode + 1}")(TIME)
    backbone = sum((change * a ** (power - 2) for power, change in expansion.changes.items()), S.Zero)
    turning = sum((change * (4 * A * conjugate(A)) ** (n // 2) for n, change in expansion.changes.items()), S.Zero)
    equation = Eq(A.diff(TIME), expand(I * turning * A))
    used = equation.free_symbols
    occurring = tuple(c for c in coefficients if c.symbol in used)
    return SlowFlow(resonance, None, (equation,), backbone, None, occurring, _steps(expansion, motion, a, equation))


def _steps(expansion: _Turning, motion: list[Series], a: Symbol, equation: Eq) -> tuple[Step, ...]:
    own = expansion.omega[expansion.mode]
    frequency = own + sum((change * a**power for power, change in expansion.changes.items()), S.Zero)
    psi, check = Symbol("psi", real=True), "harmonic balance"
    steps: list[Step] = []
    for power in range(1, _HIGHEST + 1):
        shown = []
        for number, series in enumerate(motion, 1):
            parts = {h[expansion.mode]: value for (order, h), value in series.items() if order == power}
            waves = (value * cos(k * psi) * (2 if k else 1) for k, value in sorted(parts.items()) if k >= 0)
            if parts:
                shown.append(Eq(Symbol(f"q_{number}"), a**power * sum(waves, S.Zero), evaluate=False))
        if shown:
            statement = f"What the power {power} of the amplitude adds; psi is the phase."
            steps.append(Step(f"{_WORDS[power]} order", statement, tuple(shown), _last(steps), check))
    statement = "The frequency changes so that no force is resonant."
    steps.append(Step("frequency", statement, Eq(Symbol("Omega"), frequency), _last(steps), check))
    steps.append(
        Step(
            "amplitude equations",
            "The amplitude turns by what the frequency changes by.",
            equation,
            _last(steps),
            check,
        )
    )
    return tuple(steps)


def _last(steps: Sequence[Step]) -> tuple[str, ...]:
    return (steps[-1].name,) if steps else ()
