"""The linear weak form of a variation: every pair of displacements with its stiffness as a polynomial in s = d/dt.

Exact state form, separation of variables and Ritz matrices all take their coefficients from it and are thus consistent.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

from sympy import Add, Dummy, Expr, S, expand

from cra_sym.mechanics.jets import HamiltonError, Jet, JetSpace
from cra_sym.mechanics.variation import Variation

__all__ = ["Bilinear", "WeakForm", "weak_form"]

Bilinear = dict[tuple[Jet, Jet], dict[int, Expr]]


@dataclass(frozen=True)
class PointForm:
    """The weak form at an interior place, in the jets of the interval, and the displacements that are held there."""

    place: Expr
    form: Bilinear
    load: dict[Jet, Expr]
    held: tuple[Jet, ...]


@dataclass(frozen=True)
class WeakForm:
    r"""``sum W[p, q](s) q  =  load`` on every varied displacement p; jets without time derivative name displacements.

    Attributes
    ----------
    inside, ends : dict of (varied Jet, Jet) to dict of power of s to Expr
        Per length in the interval, and at the ends and on the lumped coordinates. Stiffness is the coefficient of
        ``s**0``, damping (and gyroscopic forces) of ``s**1``, mass of ``s**2``.
    inside_load, end_load : dict of Jet to Expr
        Terms independent of the unknowns: prescribed motions and applied forces.
    points : tuple of PointForm
        The same at interior places.
    """

    variation: Variation
    inside: Bilinear
    ends: Bilinear
    inside_load: dict[Jet, Expr]
    end_load: dict[Jet, Expr]
    points: tuple[PointForm, ...] = ()

    @property
    def powers(self) -> set[int]:
        """Powers of s that occur."""
        forms = (self.inside, self.ends, *(point.form for point in self.points))
        return {power for form in forms for entry in form.values() for power in entry}

    @property
    def even(self) -> bool:
        """Whether only even powers of s occur: the eigenvalues are squares of frequencies."""
        return all(power % 2 == 0 for power in self.powers)

    @property
    def constant(self) -> bool:
        """Whether no coefficient depends on x; there may be terms at interior places."""
        x = self.variation.space.x
        return not any(v.has(x) for entry in self.inside.values() for v in entry.values())

    @property
    def discrete(self) -> Bilinear:
        """Terms at the ends, on the lumped coordinates and at interior places, the latter with their index as place."""
        found = dict(self.ends)
        for number, point in enumerate(self.points):
            for (p, q), entry in point.form.items():
                pair = self._numbered(p, number), self._numbered(q, number)
                sums = found.setdefault(pair, {})
                found[pair] = {k: sums.get(k, S.Zero) + entry.get(k, S.Zero) for k in {*sums, *entry}}
        return found

    @property
    def discrete_load(self) -> dict[Jet, Expr]:
        """Loads at the ends, on the lumped coordinates and at interior places."""
        found = dict(self.end_load)
        for number, point in enumerate(self.points):
            for jet, value in point.load.items():
                jet = self._numbered(jet, number)
                found[jet] = found.get(jet, S.Zero) + value
        return found

    @property
    def load_terms(self) -> list[Expr]:
        """Terms of all loads, in the functions they were given in."""
        loads = (*self.inside_load.values(), *self.discrete_load.values())
        return [term for e in loads for term in Add.make_args(self.variation.space.restore(e).expand())]

    def place(self, jet: Jet) -> Expr:
        """Return the place of a jet of an end or of an interior place."""
        assert jet.place is not None
        return self.points[jet.place].place if isinstance(jet.place, int) else self.variation.space.ends[jet.place]

    def _numbered(self, jet: Jet, number: int) -> Jet:
        return jet._replace(place=number) if self.variation.space.is_field(jet.unknown) else jet

    def fields(self) -> tuple[list[Jet], list[Jet], list[Jet]]:
        """Return the displacements of a section, the highest derivative of each field, and the coordinates."""
        space, orders = self.variation.space, self.variation.orders
        section = [Jet(number, order, 0, None) for number, top in enumerate(orders) for order in range(top)]
        highest = [Jet(number, top, 0, None) for number, top in enumerate(orders)]
        lumped = [Jet(number, 0, 0, None) for number in range(len(orders), len(space.unknowns))]
        return section, highest, lumped


def weak_form(variation: Variation) -> WeakForm:
    """Return the weak form of a quadratic Lagrangian with linear applied forces.

    Raises
    ------
    HamiltonError
        Names the term that is not quadratic, or whose coefficient depends on time.
    """
    space = variation.space
    inside, inside_load = _quadratic(space, variation.density, "density")
    ends, end_load = _quadratic(space, variation.ends, "end terms")
    for force, displacement, per_length in variation.applied:
        form, load = (inside, inside_load) if per_length else (ends, end_load)
        label = f"virtual work on {space.form(displacement)}"
        for jet, factor in _linear(space, force, label):
            _check_order(variation, jet, factor, label)
        _apply(space, form, load, force, displacement, label)
    points = []
    for point in variation.points:
        form, load = _quadratic(space, point.lagrangian, f"term inside at {space.x} = {point.place}")
        for force, displacement in point.applied:
            label = f"virtual work on {space.form(displacement)} at {space.x} = {point.place}"
            _apply(space, form, load, force, displacement, label)
        points.append(PointForm(point.place, _cleaned(form), _nonzero(load), point.held))
    return WeakForm(
        variation, _cleaned(inside), _cleaned(ends), _nonzero(inside_load), _nonzero(end_load), tuple(points)
    )


def _apply(space: JetSpace, form: Bilinear, load: dict[Jet, Expr], force: Expr, displacement: Jet, label: str) -> None:
    """Add the terms of a force linear in the unknowns to a form, and the others to a load."""
    for jet, factor in _linear(space, force, label):
        _accumulate(form, displacement, jet, -factor)
    still = force.xreplace({space.symbol(jet): S.Zero for jet in space.jets(force)})
    load[displacement] = load.get(displacement, S.Zero) + still


def _quadratic(space: JetSpace, lagrangian: Expr, label: str) -> tuple[Bilinear, dict[Jet, Expr]]:
    form: Bilinear = {}
    load: dict[Jet, Expr] = {}
    for jet in space.jets(lagrangian):
        momentum = lagrangian.diff(space.symbol(jet))
        displacement, sign = jet._replace(time=0), S.NegativeOne**jet.time
        for other, factor in _linear(space, momentum, label, lagrangian):
            _accumulate(form, displacement, other, -sign * factor, jet.time)
        still = momentum.xreplace({space.symbol(other): S.Zero for other in space.jets(momentum)})
        for _ in range(jet.time):
            still = -space.d_t(still)
        load[displacement] = load.get(displacement, S.Zero) + still
    return form, load


def _linear(space: JetSpace, force: Expr, label: str, origin: Expr | None = None) -> list[tuple[Jet, Expr]]:
    """Return (jet, factor) of a force linear in the unknowns, with factors constant in time."""
    factors = [(jet, force.diff(space.symbol(jet))) for jet in space.jets(force)]
    for jet, factor in factors:
        if space.jets(factor) and space.jets(expand(factor)):
            term = _offending(space, force if origin is None else origin, 1 if origin is None else 2)
            raise HamiltonError(
                f"{label}, term {term}: it makes the equations nonlinear; linearise the Lagrangian first"
            )
        if factor.has(space.t):
            raise HamiltonError(
                f"{label}: the coefficient {space.restore(factor)} of {space.form(jet)} depends on {space.t},"
                " so the motion does not separate; of a periodic one, epsilon*cos(varpi*t), say small=(epsilon, varpi)"
            )
    return [(jet, expand(factor) if space.jets(factor) else factor) for jet, factor in factors]


def _check_order(variation: Variation, jet: Jet, factor: Expr, label: str) -> None:
    """Raise an error for a force that depends on a higher derivative than the energy."""
    space = variation.space
    if space.is_field(jet.unknown) and jet.space > variation.orders[jet.unknown] - (jet.place is not None):
        raise HamiltonError(
            f"{label}: {space.restore(factor * space.symbol(jet))} is a force that depends on an internal force,"
            " so it has no weak form; write its work on a derivative of the displacement"
        )


def _offending(space: JetSpace, expression: Expr, degree: int) -> Expr:
    """Return the first term of higher degree in the unknowns than ``degree``."""
    scale = Dummy()
    scaled = {space.symbol(jet): scale * space.symbol(jet) for jet in space.jets(expression)}
    terms = Add.make_args(expand(expression))
    found = (term for term in terms if expand(term.xreplace(scaled).diff(scale, degree + 1)) != 0)
    return space.restore(next(found, expression))


def _accumulate(form: Bilinear, varied: Jet, jet: Jet, factor: Expr, power: int = 0) -> None:
    entry = form.setdefault((varied, jet._replace(time=0)), {})
    power += jet.time
    entry[power] = entry.get(power, S.Zero) + factor


def _cleaned(form: Bilinear) -> Bilinear:
    kept = {pair: {p: value for p, value in entry.items() if expand(value) != 0} for pair, entry in form.items()}
    return {pair: entry for pair, entry in kept.items() if entry}


def _nonzero(load: dict[Jet, Expr]) -> dict[Jet, Expr]:
    return {jet: value for jet, value in load.items() if value != 0}


def polynomial(entry: Iterable[tuple[int, Expr]], parameter: Expr, squared: bool) -> Expr:
    """Return ``sum coefficient * s**power`` with s the parameter, or with ``s**2 = -parameter`` if ``squared``."""
    terms = (c * ((-parameter) ** (power // 2) if squared else parameter**power) for power, c in entry)
    return Add(*terms)
