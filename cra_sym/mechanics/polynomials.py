"""Polynomial Lagrangians: their monomials in jets, and their linearisation about zero."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from sympy import Add, Derivative, Dummy, Expr, Heaviside, Integral, Mul, S, expand, integrate
from sympy.core.function import AppliedUndef

from cra_sym.mechanics.hamilton import HamiltonResult, hamilton
from cra_sym.mechanics.jets import HamiltonError, Jet, JetSpace
from cra_sym.mechanics.quadratures import Quadrature
from cra_sym.mechanics.variation import Variation

__all__ = ["Monomial", "is_linear", "linearised", "monomials"]


@dataclass(frozen=True)
class Monomial:
    """A coefficient times powers of unknowns, of known functions of time, and their derivatives.

    Attributes
    ----------
    coefficient : Expr
        In x and the parameters.
    jets : tuple of Jet
        Repeated according to their power.
    causes : tuple of Expr
        Known functions of time, or their derivatives, repeated according to their power.
    """

    coefficient: Expr
    jets: tuple[Jet, ...]
    causes: tuple[Expr, ...] = ()

    @property
    def degree(self) -> int:
        """Degree in unknowns and known motions together."""
        return len(self.jets) + len(self.causes)

    def expression(self, space: JetSpace) -> Expr:
        """Return the term in jet symbols."""
        return Mul(self.coefficient, *map(space.symbol, self.jets), *self.causes)


def monomials(space: JetSpace, expression: Expr, label: str) -> list[Monomial]:
    """Return the monomials of an expression in jet symbols.

    Raises
    ------
    HamiltonError
        Names the term that is not polynomial.
    """
    opened = expand(expression, power_exp=False, power_base=False, log=False, basic=False)
    return [_monomial(space, term, label) for term in Add.make_args(opened) if term != 0]


def _monomial(space: JetSpace, term: Expr, label: str) -> Monomial:
    coefficient: Expr = S.One
    jets: list[Jet] = []
    causes: list[Expr] = []
    for factor in Mul.make_args(term):
        base, power = factor.as_base_exp()
        there = space.jets(base)
        cause = isinstance(base, AppliedUndef | Derivative) and base.has(space.t)
        if not there and not cause and not space.jets(power):
            coefficient *= factor
            continue
        whole = power.is_Integer and power > 0
        if not whole or (there and base != space.symbol(there[0])):
            raise HamiltonError(
                f"{label}, term {space.restore(term)}: must be polynomial in the unknowns; expand it in powers "
                "of them, or take dry friction as an elastic-slip element, hysteresis=[(Jenkins(..), ..)]"
            )
        found: list[Any] = there if there else [base]
        (jets if there else causes).extend(found * int(power))
    return Monomial(coefficient, tuple(jets), tuple(causes))


def is_linear(variation: Variation) -> bool:
    """Tell whether the equations of motion are linear in the unknowns."""
    space = variation.space

    def flat(expression: Expr, degree: int) -> bool:
        rates = [expression]
        for _ in range(degree):
            rates = [rate.diff(space.symbol(jet)) for rate in rates for jet in space.jets(rate)]
        return not any(space.jets(rate) and space.jets(expand(rate)) for rate in rates)

    energies = (variation.density, variation.ends, *(point.lagrangian for point in variation.points))
    forces = [force for force, *_ in variation.applied]
    forces += [force for point in variation.points for force, _ in point.applied]
    return all(flat(energy, 2) for energy in energies) and all(flat(force, 1) for force in forces)


def linearised(result: HamiltonResult, options: dict[str, Any]) -> HamiltonResult:
    """Return Hamilton's principle with the quadratic part of a polynomial Lagrangian and the linear part of its forces.

    A known motion counts as an unknown: its product with a quadratic term is of third order. A quadrature enters
    through the terms that are linear in it.

    Parameters
    ----------
    result : HamiltonResult
    options : dict
        Arguments of `hamilton`.

    Raises
    ------
    HamiltonError
        Names the term that is not polynomial.
    """
    variation = result.variation
    if not result.quadratures and is_linear(variation):
        return result
    space = variation.space
    inside = LoadCoefficients(result)

    def kept(expression: Expr, label: str, place: Expr | None, degree: int = 2) -> Expr:
        terms = [m for m in monomials(space, expression, label) if m.degree <= degree]
        local = [m for m in terms if not inside.take(m, place)]
        return space.restore(Add(*(m.expression(space) for m in local)))

    own = inside.without_constraints(variation.density)
    density = kept(own, "density", space.x)
    ends = kept(variation.ends, "end terms", space.ends["right"])
    points = [(p.place, kept(p.lagrangian, f"term inside at {space.x} = {p.place}", p.place)) for p in variation.points]
    work: list[tuple[Expr, Expr, Any]] = [
        (
            kept(force, f"virtual work on {space.form(jet)}", None, 1),
            space.form(jet),
            "domain" if everywhere else None,
        )
        for force, jet, everywhere in variation.applied
    ]
    work += [
        (kept(force, f"virtual work at {space.x} = {p.place}", None, 1), space.form(jet), p.place)
        for p in variation.points
        for force, jet in p.applied
    ]
    changes = {
        "density": density + inside.density(),
        "left": ends,
        "right": None,
        "inside": [pair for pair in points if pair[1] != 0],
        "virtual_work": [triple for triple in work if triple[0] != 0],
        "quadratures": None,
    }
    return hamilton(**(options | changes))


class LoadCoefficients:
    """Terms linear in quadratures, collected as a weight C(x) of their integrands."""

    def __init__(self, result: HamiltonResult) -> None:
        self._space, self._quadratures = result.variation.space, result.quadratures
        names = [unknown.func for unknown in self._space.unknowns]
        self._numbers = {names.index(q.function.func): q for q in self._quadratures}
        self._multipliers = {names.index(q.multiplier.func) for q in self._quadratures}
        self._weights: dict[Quadrature, Expr] = {}

    def without_constraints(self, density: Expr) -> Expr:
        """Return the density without the products of multipliers and constraints."""
        space = self._space
        zero = {space.symbol(jet): S.Zero for jet in space.jets(density) if jet.unknown in self._multipliers}
        return density.xreplace(zero)

    def take(self, monomial: Monomial, place: Expr | None) -> bool:
        """Collect a term if it is linear in a quadrature at a place (or along x); return whether it is."""
        jets = [jet for jet in monomial.jets if jet.unknown in self._numbers]
        if not jets:
            return False
        space = self._space
        if len(monomial.jets) > 1 or monomial.causes or place is None or jets[0].time:
            return True  # of third order and more, or the time derivative of a function: no equation changes
        x, right = space.x, space.ends["right"]
        if place == x:
            there = Dummy("x", real=True)
            weight = integrate(monomial.coefficient.subs(x, there), (there, x, right))
            if weight.has(Integral):
                raise HamiltonError(f"density, term {space.restore(monomial.expression(space))}: it has no integral")
        else:
            inside = S.One if place == right else Heaviside(place - x)
            weight = monomial.coefficient * inside
        quadrature = self._numbers[jets[0].unknown]
        self._weights[quadrature] = self._weights.get(quadrature, S.Zero) + weight
        return True

    def density(self) -> Expr:
        """Return the terms linear in quadratures as a density."""
        return Add(*(weight * self._lowest(quadrature) for quadrature, weight in self._weights.items()))

    def _lowest(self, quadrature: Quadrature) -> Expr:
        space = self._space
        read = monomials(space, space.read(quadrature.integrand, "domain", "quadratures"), "quadratures")
        return space.restore(Add(*(m.expression(space) for m in read if m.degree <= 2)))
