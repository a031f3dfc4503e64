"""Which coefficient tensors a Lagrangian has, and symbols for their entries."""

from __future__ import annotations

import itertools
from collections.abc import Iterator

from sympy import Rational, Symbol

from cra_sym.mechanics.amplitude_expansion import Coefficient
from cra_sym.model.nonlinear import NonlinearTerms, Product

__all__ = ["slow_coefficients", "slow_forces"]

_NAMED = {(4, 0): ("K", Rational(-1, 2)), (2, 2): ("J", Rational(1, 2)), (3, 0): ("C", Rational(-1, 3))}
_HIGHEST = 4  # highest degree in the Lagrangian that enters the first slow flow


def slow_forces(terms: NonlinearTerms | None, modes: int) -> tuple[Coefficient, ...]:
    """Return the symbols of forces on oscillators that stand for complex modes, of second and third degree."""
    kinds = {kind for product in (*terms.inside, *terms.discrete) for kind in _kinds(terms, product)} if terms else ()
    degrees = {p + v - int(not force) for force, p, v in kinds}
    found = []
    for whole in (2, 3) if 2 in degrees else (3,) if 3 in degrees else ():
        for velocities in range(whole + 1):
            for indices in _indices(modes, whole - velocities, velocities, force=True):
                symbol = Symbol(f"Q{whole - velocities}{velocities}_{''.join(map(str, indices))}", real=True)
                found.append(Coefficient(symbol, whole - velocities, velocities, indices, Rational(1), True))
    return tuple(found)


def slow_coefficients(terms: NonlinearTerms | None, modes: int, degree: int = 4) -> tuple[Coefficient, ...]:
    """Return the symbols of all entries up to a degree (one less, of forces) of the first modes.

    K of q^4 enters the Lagrangian as -K q^4/2, J of q^2 v^2 as J q^2 v^2/2, C of q^3 as -C q^3/3; other entries are
    those of the tensors.
    """
    if terms is None:
        return ()
    kinds = sorted({kind for product in (*terms.inside, *terms.discrete) for kind in _kinds(terms, product)})
    found = []
    for force, positions, velocities in kinds:
        if positions + velocities > degree - int(force):
            continue
        name, factor = _NAMED.get((positions, velocities), (f"T{positions}{velocities}", Rational(1)))
        if force:
            name, factor = f"Q{positions}{velocities}", Rational(1)
        for indices in _indices(modes, positions, velocities, force):
            symbol = Symbol(f"{name}_{''.join(map(str, indices))}", real=True)
            found.append(Coefficient(symbol, positions, velocities, indices, factor, force))
    return tuple(found)


def _kinds(terms: NonlinearTerms, product: Product) -> Iterator[tuple[bool, int, int]]:
    """Yield (whether a force, positions, velocities) of a term, its quadratures written out."""
    if product.causes:
        return
    choices = []
    for factor in product.factors:
        degrees = {1} if factor.quadrature < 0 else {len(places) for places in terms.integrands[factor.quadrature]}
        choices.append([(degree - factor.time, factor.time) for degree in degrees])
    for chosen in itertools.product(*choices):
        positions, velocities = (sum(part[k] for part in chosen) for k in (0, 1))
        if positions + velocities > 2:
            yield product.force, positions - int(product.force), velocities


def _indices(modes: int, positions: int, velocities: int, force: bool) -> Iterator[tuple[int, ...]]:
    numbers = range(1, modes + 1)
    for places in itertools.combinations_with_replacement(numbers, positions):
        for speeds in itertools.combinations_with_replacement(numbers, velocities):
            for equation in numbers if force else [None]:
                yield (*([] if equation is None else [equation]), *places, *speeds)
