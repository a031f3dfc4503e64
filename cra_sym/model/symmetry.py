"""Terms that exclude natural frequencies: dampers, gyroscopic terms, follower forces."""

from __future__ import annotations

from itertools import pairwise

from mpmath import mp
from sympy import Add, Derivative, Expr, Poly, Rational, S, Symbol, lambdify

from cra_sym.mechanics import StateForm
from cra_sym.mechanics.breakpoints import switches
from cra_sym.mechanics.hamilton import HamiltonResult
from cra_sym.mechanics.weak import weak_form

__all__ = ["asymmetry", "is_gyroscopic", "is_symmetric", "odd_in_time", "vanishes"]


def odd_in_time(term: Expr, t: Symbol) -> bool:
    """Tell whether a force term changes sign when time runs backwards."""
    orders = (number for node in term.atoms(Derivative) for symbol, number in node.variable_count if symbol == t)
    return bool(sum(orders) % 2 == 1)


def vanishes(expression: Expr, x: Symbol) -> bool:
    """Tell whether an expression is zero: by expansion, or else numerically in 30 digits, on every part along x.

    Products of Piecewise do not cancel when they are expanded. A sum all of whose terms are zero at some place, as a
    pulse is beside it, says nothing.
    """
    expanded = expression.expand()
    terms = Add.make_args(expanded)
    if expanded == 0:
        return True
    if len(terms) == 1:
        return False
    symbols = sorted(expanded.free_symbols, key=str)
    values, seen = lambdify(symbols, terms, "mpmath"), False
    for turn in range(1, 4):
        at = {symbol: Rational(7 * turn + 3 * k, 29 + 5 * k) for k, symbol in enumerate(symbols)}
        for place in _on_every_part(expanded, x, at):
            with mp.workdps(30):
                found = values(*(mp.mpf(v.p) / v.q for v in ({**at, x: place}[symbol] for symbol in symbols)))
                size = sum(abs(value) for value in found)
                if abs(sum(found)) > 1e-20 * size:
                    return False
            seen |= size > 0
    return bool(seen)


def _on_every_part(expression: Expr, x: Symbol, at: dict[Symbol, Rational]) -> list[Rational]:
    """Return places on every part of x between the breakpoints of an expression, for values of its symbols."""
    ends: set[Rational] = set()
    for switch in switches([expression], x):
        if switch.expression.is_polynomial(x):
            here = Poly(switch.expression.xreplace({s: v for s, v in at.items() if s != x}), x)
            ends |= {Rational(root) for root in here.nroots(maxsteps=200) if root.is_real}
    if not ends:
        return [at.get(x, S.Zero)]
    cuts = sorted(ends)
    return [cuts[0] - 1, *((left + right) / 2 for left, right in pairwise(cuts)), cuts[-1] + 1]


def asymmetry(form: StateForm) -> str:
    """Return a description of the terms that make the problem unsymmetric, or an empty text."""
    if form.damped:
        return "the Lagrangian has gyroscopic terms, of first order in time"
    half = form.system.rows // 2
    a, b, c, d = (form.system[i : i + half, j : j + half] for i in (0, half) for j in (0, half))
    points = ((matrix, matrix.T) for _, matrix, _ in form.points)
    pairs = ((b, b.T), (c, c.T), (d, -a.T), (form.boundary, form.boundary.T), *points)
    if all(vanishes(entry, form.x) for left, right in pairs for entry in left - right):
        return ""
    return "the virtual work has forces that follow the motion"


def is_gyroscopic(equations: HamiltonResult) -> bool:
    """Tell whether forces of first order in time do no work and all others have a potential."""
    return _reciprocal(equations, -1)


def is_symmetric(equations: HamiltonResult) -> bool:
    """Tell whether forces of first order in time are those of dampers and all others have a potential."""
    return _reciprocal(equations, 1)


def _reciprocal(equations: HamiltonResult, first: int) -> bool:
    """Tell whether all forms are symmetric, those of first order up to a sign."""
    weak = weak_form(equations.variation)
    for form in (weak.inside, weak.discrete):
        for (p, q), entry in form.items():
            other = form.get((q, p), {})
            for power in {*entry, *other}:
                sign = first if power == 1 else 1
                if not vanishes(entry.get(power, S.Zero) - sign * other.get(power, S.Zero), weak.variation.space.x):
                    return False
    return True
