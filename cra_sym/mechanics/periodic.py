r"""Terms of a Lagrangian that are periodic in time: cosines and sines, and the matrices that multiply them.

Around a motion at rest the equations are

.. math:: \frac{d}{dt}(M\dot q + Bq) + C\dot q + Kq = f

with M, B, C and K constant or, for the periodic part, times one cosine or sine. Momenta stay under the derivative by
time, so that an oscillating mass or speed is treated exactly.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Literal

from sympy import Add, Dummy, Expr, I, Mul, S, Symbol, cos, expand, sin
from sympy.core.function import AppliedUndef, Derivative

from cra_sym.mechanics.jets import HamiltonError, Jet, JetSpace
from cra_sym.mechanics.weak import Bilinear

__all__ = ["KINDS", "Key", "TimeForms", "separated", "time_forms"]

KINDS = {"stiffness": (0, 0), "damping": (0, 1), "momentum": (1, 0), "mass": (1, 1)}
"""Matrices by the orders of the time derivatives they multiply: that of the varied displacement and of the other."""
_SIGN = {"stiffness": -1, "damping": -1, "momentum": 1, "mass": 1}


Key = tuple[int, Literal["cos", "sin"], int]
"""(order, kind, power): ``varpi**power`` times the cosine or sine of ``order * varpi * t``; order 0 is constant."""


def separated(
    label: str, expression: Expr, small: tuple[Symbol, Symbol], t: Symbol
) -> tuple[Expr, dict[tuple[int, Key], Expr]]:
    """Return the constant part of an expression, and coefficients by power of epsilon and oscillation.

    Parameters
    ----------
    label : str
        Names the expression in errors.
    expression : Expr
    small : (epsilon, varpi)
    t : Symbol

    Raises
    ------
    HamiltonError
        Names the term whose dependence on time is not of the form ``cos(n*varpi*t + phase)`` with a whole number n, or
        that is not a polynomial in epsilon and varpi.

    Examples
    --------
    >>> from sympy import cos, symbols
    >>> k, epsilon, varpi, t = symbols("k epsilon varpi t")
    >>> still, parts = separated("density", k * (1 + epsilon * cos(varpi * t)), (epsilon, varpi), t)
    >>> still, parts
    (k, {(1, (1, 'cos', 0)): k})
    """
    turn = Dummy("z")
    still: list[Expr] = []
    found: dict[tuple[int, Key], Expr] = {}
    for given in _terms(expression, small, t):
        if not _moves(given, small, t):
            still.append(given)
            continue
        waves = {node: _wave(label, given, node, small, t, turn) for node in _waves(given, t)}
        for term in Add.make_args(expand(given.xreplace(waves))):
            rest, (epsilons, power, order) = _powers(term, (small[0], small[1], turn))
            if rest.has(*small, turn) or epsilons < 0 or power < 0 or _has_bare_time(rest, t):
                raise HamiltonError(
                    f"{label}, term {given}: must be a polynomial in {small[0]} and {small[1]} times cos or sin of "
                    f"n*{small[1]}*{t} + phase, n a whole number"
                )
            if order == epsilons == power == 0:
                still.append(rest)
                continue
            parts: list[tuple[Literal["cos", "sin"], Expr]] = [("cos", rest)]
            if order != 0:
                parts.append(("sin", I * rest if order > 0 else -I * rest))
            for kind, value in parts:
                key: tuple[int, Key] = int(epsilons), (abs(int(order)), kind, int(power))
                found[key] = found.get(key, S.Zero) + value
    oscillating = {key: expand(value) for key, value in found.items()}
    return Add(*still), {key: value for key, value in oscillating.items() if value != 0}


def _terms(expression: Expr, small: tuple[Symbol, Symbol], t: Symbol) -> list[Expr]:
    """Return the terms, expanded where they oscillate."""
    found: list[Expr] = []
    for term in Add.make_args(expression):
        found += Add.make_args(expand(term, trig=False)) if _moves(term, small, t) else (term,)
    return found


def _moves(term: Expr, small: tuple[Symbol, Symbol], t: Symbol) -> bool:
    return bool(term.has(*small)) or _has_bare_time(term, t)


def _waves(term: Expr, t: Symbol) -> list[Expr]:
    return sorted((node for node in term.atoms(cos, sin) if _has_bare_time(node, t)), key=str)


def _has_bare_time(term: Expr, t: Symbol) -> bool:
    """Tell whether time occurs outside the unknown functions."""
    hidden = {node: Dummy() for node in term.atoms(AppliedUndef, Derivative)}
    return bool(term.xreplace(hidden).has(t))


def _wave(label: str, term: Expr, node: Expr, small: tuple[Symbol, Symbol], t: Symbol, turn: Dummy) -> Expr:
    """Return a cosine or sine in powers of exp(i varpi t)."""
    argument = expand(node.args[0])
    order, phase = argument.diff(t) / small[1], argument.subs(t, 0)
    if (order * small[1] / small[0]).is_Integer:
        raise HamiltonError(f"small = {small}: must be (epsilon, varpi), and {small[0]} is the frequency in {node}")
    if not order.is_Integer or phase.has(*small) or phase.atoms(AppliedUndef):
        raise HamiltonError(
            f"{label}, term {term}: {node} must be cos or sin of n*{small[1]}*{t} + phase, n a whole number and the "
            f"phase free of {small[0]} and {small[1]}"
        )
    if phase != 0 and node.func is sin:
        return _turning(sin(phase), -cos(phase), order, turn)
    if phase != 0:
        return _turning(cos(phase), sin(phase), order, turn)
    return _turning(S.One, S.Zero, order, turn) if node.func is cos else _turning(S.Zero, S.NegativeOne, order, turn)


def _turning(even: Expr, odd: Expr, order: Expr, turn: Dummy) -> Expr:
    """Return ``even cos(order varpi t) - odd sin(order varpi t)``."""
    return even * (turn**order + turn**-order) / 2 - odd * (turn**order - turn**-order) / (2 * I)


def _powers(term: Expr, symbols: Sequence[Symbol]) -> tuple[Expr, list[Expr]]:
    """Return a term without whole powers of the symbols, and these powers."""
    powers, rest = dict.fromkeys(symbols, S.Zero), []
    for factor in Mul.make_args(term):
        base, power = factor.as_base_exp()
        if base in powers and power.is_Integer:
            powers[base] += power
        else:
            rest.append(factor)
    return Mul(*rest), [powers[symbol] for symbol in symbols]


# ------------------------------------------------------------------------------------------------------- matrices


@dataclass(frozen=True)
class TimeForms:
    """Matrices of a quadratic Lagrangian and its forces, momenta kept under the derivative by time.

    Attributes
    ----------
    inside, discrete : dict of kind to Bilinear
        'stiffness', 'damping', 'momentum', 'mass': per length in the interval, and at the ends, on the coordinates and
        at interior places (numbered). Each entry has one power of time, 0.
    load, discrete_load : dict of (Jet, order) to Expr
        Forces (order 0) and momenta (order 1), whose time derivative acts.
    """

    inside: dict[str, Bilinear] = field(default_factory=dict)
    discrete: dict[str, Bilinear] = field(default_factory=dict)
    load: dict[tuple[Jet, int], Expr] = field(default_factory=dict)
    discrete_load: dict[tuple[Jet, int], Expr] = field(default_factory=dict)

    def named(self) -> dict[str, tuple[Bilinear, Bilinear]]:
        """Return both parts of every kind that occurs."""
        kinds = [kind for kind in KINDS if kind in self.inside or kind in self.discrete]
        return {kind: (self.inside.get(kind, {}), self.discrete.get(kind, {})) for kind in kinds}


def time_forms(
    space: JetSpace,
    lagrangians: Sequence[tuple[str, Expr, int | None, bool]],
    applied: Sequence[tuple[Expr, Jet, bool]],
    linearise: bool = False,
) -> TimeForms:
    """Return the matrices of Lagrangian terms and applied forces, all in jets.

    Parameters
    ----------
    space : JetSpace
    lagrangians : sequence of (label, term, number of the interior place or None, whether per length)
    applied : sequence of (force, displacement, whether per length)
    linearise : bool
        Whether terms of higher degree are neglected; otherwise they are refused.

    Raises
    ------
    HamiltonError
        Names the term that is not quadratic, or has second derivatives by time.
    """
    forms = TimeForms()
    for label, lagrangian, number, per_length in lagrangians:
        bilinear, load = (forms.inside, forms.load) if per_length else (forms.discrete, forms.discrete_load)
        for jet in space.jets(lagrangian):
            momentum = lagrangian.diff(space.symbol(jet))
            for other, factor in _factors(space, momentum, label, linearise):
                kind = _kind(space, label, jet.time, other)
                _add(bilinear, kind, (_at(space, jet, number), _at(space, other, number)), _SIGN[kind] * factor)
            still = momentum.xreplace({space.symbol(other): S.Zero for other in space.jets(momentum)})
            _load(load, (_at(space, jet, number), jet.time), still if jet.time == 0 else -still)
    for force, displacement, per_length in applied:
        bilinear, load = (forms.inside, forms.load) if per_length else (forms.discrete, forms.discrete_load)
        label = f"virtual work on {space.form(displacement)}"
        for other, factor in _factors(space, force, label, linearise):
            kind = _kind(space, label, 0, other)
            _add(bilinear, kind, (displacement, other._replace(time=0)), -factor)
        _load(load, (displacement, 0), force.xreplace({space.symbol(other): S.Zero for other in space.jets(force)}))
    return forms


def _factors(space: JetSpace, momentum: Expr, label: str, linearise: bool) -> list[tuple[Jet, Expr]]:
    found = []
    for other in space.jets(momentum):
        factor = expand(momentum.diff(space.symbol(other)))
        if space.jets(factor):
            if not linearise:
                raise HamiltonError(f"{label}: a periodic term must be quadratic or linear in the unknowns")
            factor = factor.xreplace({space.symbol(jet): S.Zero for jet in space.jets(factor)})
        if factor != 0:
            found.append((other, factor))
    return found


def _kind(space: JetSpace, label: str, time: int, other: Jet) -> str:
    for kind, orders in KINDS.items():
        if orders == (time, other.time):
            return kind
    raise HamiltonError(f"{label}: {space.form(other)} has more than one derivative by time in a periodic term")


def _at(space: JetSpace, jet: Jet, number: int | None) -> Jet:
    jet = jet._replace(time=0)
    return jet if number is None or not space.is_field(jet.unknown) else jet._replace(place=number)


def _add(forms: dict[str, Bilinear], kind: str, pair: tuple[Jet, Jet], value: Expr) -> None:
    entry = forms.setdefault(kind, {}).setdefault(pair, {0: S.Zero})
    entry[0] += value


def _load(load: dict[tuple[Jet, int], Expr], key: tuple[Jet, int], value: Expr) -> None:
    total = load.get(key, S.Zero) + value
    if total != 0:
        load[key] = total
    else:
        load.pop(key, None)
