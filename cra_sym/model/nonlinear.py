"""Nonlinear terms of a Lagrangian, compiled: which displacements they multiply and with what coefficients."""

from __future__ import annotations

from dataclasses import dataclass

from sympy import Derivative, Expr

from cra_sym.kernels import Kernel, kernel
from cra_sym.mechanics.jets import HamiltonError, Jet, JetSpace
from cra_sym.mechanics.polynomials import LoadCoefficients, Monomial, monomials
from cra_sym.mechanics.weak import WeakForm, weak_form
from cra_sym.model.breaks import Breaks, breaks
from cra_sym.model.lagrangian import Model
from cra_sym.model.projection import Displacement

__all__ = ["Factor", "NonlinearTerms", "Product", "nonlinear"]


@dataclass(frozen=True)
class Factor:
    """A displacement or a quadrature at a place, or its rate.

    Attributes
    ----------
    place : Displacement
        Of a displacement; of a quadrature ``where`` and ``number`` alone count.
    quadrature : int
        Number of the quadrature, or -1.
    time : {0, 1}
        Order of its time derivative.
    """

    place: Displacement
    quadrature: int = -1
    time: int = 0


@dataclass(frozen=True)
class Product:
    """A term: its factors and known functions of time, by number; the first factor of a force is what it acts on."""

    factors: tuple[Factor, ...]
    causes: tuple[int, ...]
    force: bool


@dataclass(frozen=True)
class NonlinearTerms:
    """Every term of third degree and more, in unknowns and known motions together.

    Attributes
    ----------
    inside, discrete : tuple of Product
        Per length, and at the ends, at interior places and on coordinates.
    density, points : Kernel
        Their coefficients, of (x, parameters) and of the parameters.
    integrands : tuple of tuple of tuple of Displacement
        Of every quadrature the displacements that each of its terms multiplies.
    weights : Kernel
        Of (x, parameters): coefficients of these terms, one after the other.
    causes : tuple of (str, int)
        Known functions of time that occur, with the order of the derivative.
    breaks : Breaks
        Where coefficients are not smooth along x, interior places among it.
    places : Kernel
        Of the parameters: interior places.
    parameters : tuple of str
        Names of those in the nonlinear terms.
    """

    inside: tuple[Product, ...]
    discrete: tuple[Product, ...]
    density: Kernel
    points: Kernel
    integrands: tuple[tuple[tuple[Displacement, ...], ...], ...]
    weights: Kernel
    causes: tuple[tuple[str, int], ...]
    breaks: Breaks
    places: Kernel
    parameters: tuple[str, ...]


def nonlinear(model: Model) -> NonlinearTerms | None:
    """Return the nonlinear terms of a model, or None if its equations are linear.

    Raises
    ------
    HamiltonError
        Names the term that is not polynomial, that depends on time, or holds second time derivatives.
    """
    if not model.nonlinear:
        return None
    return _Reader(model).terms()


class _Reader:
    """Sorts the monomials of the variation of a model."""

    def __init__(self, model: Model) -> None:
        self._model, self._result = model, model.equations
        self._weak: WeakForm = weak_form(model.linearised.variation)
        self._space: JetSpace = self._result.variation.space
        names = [unknown.func for unknown in self._space.unknowns]
        self._quadratures = [names.index(q.function.func) for q in self._result.quadratures]
        own = [unknown.func for unknown in self._weak.variation.space.unknowns]
        self._numbers = {number: own.index(name) for number, name in enumerate(names) if name in own}
        self._causes: dict[tuple[str, int], int] = {}

    def terms(self) -> NonlinearTerms:
        variation, symbols, x = self._result.variation, self._model.symbols, self._space.x
        inside: list[tuple[Product, Expr]] = []
        discrete: list[tuple[Product, Expr]] = []
        density = LoadCoefficients(self._result).without_constraints(variation.density)
        inside += self._energy(density, "density", None)
        discrete += self._energy(variation.ends, "end terms", None)
        for number, point in enumerate(variation.points):
            discrete += self._energy(point.lagrangian, f"term inside at {x} = {point.place}", number)
            for force, jet in point.applied:
                discrete += self._force(force, jet, number)
        for force, jet, everywhere in variation.applied:
            (inside if everywhere else discrete).extend(self._force(force, jet, None))
        integrands, weights = self._integrands()
        places = tuple(point.place for point in variation.points)
        part = self._model.numerics("conservative_part") or self._model
        coefficients = [*(c for _, c in inside), *weights, *part.conservative.system]
        return NonlinearTerms(
            tuple(p for p, _ in inside),
            tuple(p for p, _ in discrete),
            kernel(tuple(c for _, c in inside), (x, *symbols), backend="numpy"),
            kernel(tuple(c for _, c in discrete), symbols, backend="numpy"),
            integrands,
            kernel(tuple(weights), (x, *symbols), backend="numpy"),
            tuple(self._causes),
            breaks(coefficients, x, symbols, places),
            kernel(places, symbols, backend="numpy"),
            tuple(s.name for s in symbols if any(c.has(s) for c in (*(c for _, c in (*inside, *discrete)), *weights))),
        )

    def _energy(self, lagrangian: Expr, label: str, point: int | None) -> list[tuple[Product, Expr]]:
        found = []
        for monomial in monomials(self._space, lagrangian, label):
            alone = len(monomial.jets) == 1 and monomial.jets[0].unknown in self._quadratures
            if monomial.jets and (monomial.degree > 2 or alone or self._moves_quadrature(monomial)):
                found.append(self._product(monomial, label, point, ()))
        return found

    def _moves_quadrature(self, monomial: Monomial) -> bool:
        return any(jet.unknown in self._quadratures for jet in monomial.jets)

    def _force(self, force: Expr, jet: Jet, point: int | None) -> list[tuple[Product, Expr]]:
        label = f"virtual work on {self._space.form(jet)}"
        read = monomials(self._space, force, label)
        return [
            self._product(m, label, point, (jet,))
            for m in read
            if m.degree > 1 or (m.jets and self._moves_quadrature(m))
        ]

    def _product(
        self, monomial: Monomial, label: str, point: int | None, worked: tuple[Jet, ...]
    ) -> tuple[Product, Expr]:
        named = f"{label}, term {self._space.restore(monomial.expression(self._space))}"
        if monomial.coefficient.has(self._space.t):
            raise HamiltonError(f"{named}: its coefficient depends on {self._space.t}; make it a prescribed motion")
        factors = tuple(self._factor(jet, point, named) for jet in (*worked, *monomial.jets))
        causes = tuple(self._cause(cause) for cause in monomial.causes)
        return Product(factors, causes, bool(worked)), monomial.coefficient

    def _factor(self, jet: Jet, point: int | None, label: str) -> Factor:
        if jet.time > 1:
            raise HamiltonError(f"{label}: must hold first time derivatives only; integrate it by parts in time")
        field = self._space.is_field(jet.unknown)
        where = "inside" if jet.place is None else str(jet.place)
        where = "point" if point is not None and field else where
        if jet.unknown in self._quadratures:
            if jet.space:
                raise HamiltonError(f"{label}: write the x derivative of a quadrature as its integrand")
            place = Displacement(where, 0, 0, point or 0)  # type: ignore[arg-type]
            return Factor(place, self._quadratures.index(jet.unknown), jet.time)
        return Factor(self._place(jet, where, point or 0), -1, jet.time)

    def _place(self, jet: Jet, where: str, point: int) -> Displacement:
        section, _, lumped = self._weak.fields()
        number = self._numbers[jet.unknown]
        if not self._space.is_field(jet.unknown):
            return Displacement("lumped", [c.unknown for c in lumped].index(number), 0)
        if where in ("inside", "point"):
            entry = section.index(Jet(number, 0, 0, None))
            return Displacement(where, entry, jet.space, point)  # type: ignore[arg-type]
        return Displacement(where, section.index(Jet(number, jet.space, 0, None)), 0)  # type: ignore[arg-type]

    def _cause(self, cause: Expr) -> int:
        function = cause.expr if isinstance(cause, Derivative) else cause
        order = sum(n for _, n in cause.variable_count) if isinstance(cause, Derivative) else 0
        return self._causes.setdefault((function.func.__name__, int(order)), len(self._causes))

    def _integrands(self) -> tuple[tuple[tuple[tuple[Displacement, ...], ...], ...], list[Expr]]:
        found, weights = [], []
        for quadrature in self._result.quadratures:
            label = f"quadratures: {quadrature.function}"
            read = monomials(self._space, self._space.read(quadrature.integrand, "domain", label), label)
            found.append(tuple(tuple(self._place(jet, "inside", 0) for jet in m.jets) for m in read))
            weights += [m.coefficient for m in read]
        return tuple(found), weights
