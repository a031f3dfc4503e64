"""Fields that are integrals of others from the left end, such as a foreshortening: constraints with multipliers."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from sympy import Add, Expr, Function, S, Symbol
from sympy.core.function import AppliedUndef, Derivative

from cra_sym.checks import mapping, shown
from cra_sym.mechanics.jets import HamiltonError, JetSpace

__all__ = ["Quadrature", "quadratures_of", "with_constraints"]


@dataclass(frozen=True)
class Quadrature:
    """A field s(x, t), the integral of an expression from the left end, and the multiplier of s_x = integrand.

    Attributes
    ----------
    function, multiplier : applied undefined function
        If s is a shortening, the multiplier is the tension.
    integrand : Expr
    """

    function: AppliedUndef
    integrand: Expr
    multiplier: AppliedUndef


def quadratures_of(
    given: Any, fields: Sequence[AppliedUndef], x: Symbol, t: Symbol, domain: Sequence[Any]
) -> tuple[Quadrature, ...]:
    """Return the quadratures given by a mapping.

    Raises
    ------
    TypeError, HamiltonError
        Names anything that is not a function of x and t, and an integrand with time derivatives, other quadratures, or
        terms of first degree.
    """
    pairs = mapping(
        "quadratures", dict(given) if isinstance(given, tuple) else given, "functions s(x, t) to integrands"
    )
    found = []
    for function, integrand in pairs.items():
        if not isinstance(function, AppliedUndef) or tuple(function.args) != (x, t) or function in fields:
            raise HamiltonError(f"quadratures: {shown(function)} must be a function of ({x}, {t}) that is not a field")
        label = f"quadratures: {function} = {shown(integrand)}"
        space = JetSpace(fields, (), x, t, (domain[0], domain[1]))
        read = space.read(integrand, "domain", label)
        if any(jet.time for jet in space.jets(read)) or read.has(Derivative) or read.has(t):
            raise HamiltonError(f"{label} must be free of time derivatives")
        still = {space.symbol(jet): S.Zero for jet in space.jets(read)}
        slopes = [read.diff(space.symbol(jet)) for jet in space.jets(read)]
        if any(slope.xreplace(still) != 0 for slope in slopes) or read.xreplace(still) != 0:
            raise HamiltonError(f"{label} must be of second degree and more in the fields")
        name = f"N_{function.func.__name__}"
        found.append(Quadrature(function, integrand, Function(name)(x, t)))
    return tuple(found)


def with_constraints(
    quadratures: Sequence[Quadrature],
    density: Expr,
    fields: Sequence[AppliedUndef],
    essential: Sequence[Expr],
    x: Symbol,
    left: Any,
) -> Mapping[str, Any]:
    """Return density, fields and essential conditions with the quadratures as constrained fields."""
    slopes = {q.function.diff(x): q.integrand for q in quadratures}
    if any(term.has(q.function.diff(x)) for q in quadratures for term in Add.make_args(density)):
        density = density.xreplace(slopes)
    constraints = (q.multiplier * (q.function.diff(x) - q.integrand) for q in quadratures)
    return {
        "density": Add(density, *constraints),
        "fields": (*fields, *(q.function for q in quadratures), *(q.multiplier for q in quadratures)),
        "essential": (*essential, *(q.function.subs(x, left) for q in quadratures)),
    }
