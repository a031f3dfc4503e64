"""First variation of an action in jet symbols, with checks of end terms and virtual work."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Literal

from sympy import Add, Expr, S, SympifyError, expand_mul, sympify

from cra_sym.checks import shown
from cra_sym.mechanics.constraints import Elimination, eliminate
from cra_sym.mechanics.jets import END_NAMES, End, HamiltonError, Jet, JetSpace
from cra_sym.mechanics.points import InteriorPoint, linear_work, read_points, supports

__all__ = ["Forces", "Variation", "VirtualWork", "lagrange_forces", "vary"]

VirtualWork = tuple[Expr, Expr, Literal["left", "right", "domain"] | Expr | None]
Forces = dict[Jet, Expr]


@dataclass(frozen=True)
class Variation:
    """The first variation of the action in jet symbols; `separate` and `ritz` start from here.

    Attributes
    ----------
    space : JetSpace
    density, ends : Expr
        Lagrangian density, and the sum of the Lagrangian terms of both ends.
    applied : tuple of (Expr, Jet, bool)
        Non-conservative generalised force, the displacement (a jet without time derivative) on which it does work, and
        whether it is a force per length.
    orders : tuple of int
        Highest x derivative of each field: as many displacements exist at each end.
    elimination : Elimination
        End displacements fixed by the essential conditions.
    points : tuple of InteriorPoint
        Terms at interior places.
    """

    space: JetSpace
    density: Expr
    ends: Expr
    applied: tuple[tuple[Expr, Jet, bool], ...]
    orders: tuple[int, ...]
    elimination: Elimination
    points: tuple[InteriorPoint, ...] = ()


def vary(
    space: JetSpace,
    density: Expr,
    ends: Mapping[End, Expr],
    virtual_work: Sequence[VirtualWork],
    essential: Sequence[Expr],
    inside: Sequence[tuple[Expr, Expr]] = (),
) -> Variation:
    """Convert the input to jet symbols and check that every end term can do work."""
    along = space.read(density, "domain", "density")
    essential, held = supports(essential, space.x, tuple(space.ends.values()))
    terms = {end: space.read(ends[end], end, f"{end} end") for end in END_NAMES}
    triples = [_triple(space, triple) for triple in virtual_work]
    there = [triple for triple in triples if isinstance(triple[2], Expr)]
    applied = tuple(work for triple in triples if triple not in there for work in _read_work(space, triple))
    varied = [*space.jets(along), *(jet for _, jet, everywhere in applied if everywhere)]
    orders = tuple(
        max((jet.space for jet in varied if jet.unknown == number), default=0) for number in range(len(space.fields))
    )
    for number, field in enumerate(space.fields):
        if not any(jet.unknown == number for jet in varied):
            raise HamiltonError(f"fields: {field} does not occur in the density {density}")
    elimination = eliminate(space, essential, orders)
    for end in END_NAMES:
        for term in Add.make_args(expand_mul(terms[end])):
            _check_end_term(space, f"{end} end, term {space.write(term)}", space.jets(term), orders)
            elimination.check_effective(term, f"{end} end")
    for force, jet, everywhere in applied:
        if not everywhere:
            label = f"virtual work of {space.write(force)} on {space.form(jet)}"
            _check_end_term(space, label, [jet], orders)
            elimination.check_effective(space.symbol(jet), label)
    points = read_points(space, inside, held, there, orders)
    return Variation(space, along, terms["left"] + terms["right"], applied, orders, elimination, points)


def _check_end_term(space: JetSpace, label: str, jets: Sequence[Jet], orders: Sequence[int]) -> None:
    """Raise an error for end terms in a derivative that is not a displacement of that end."""
    for jet in jets:
        if jet.place is not None and jet.space >= orders[jet.unknown]:
            field = space.unknowns[jet.unknown]
            raise HamiltonError(
                f"{label}: {space.form(jet)} is not a displacement of that end,"
                f" since the density has x derivatives of {field} up to order {orders[jet.unknown]} only"
            )


def _triple(space: JetSpace, triple: VirtualWork) -> VirtualWork:
    """Return one virtual work triple with an interior place as an expression."""
    try:
        force, displacement, place = triple
    except (TypeError, ValueError):
        raise HamiltonError(f"virtual_work: {shown(triple)} is not a triple (force, displacement, place)") from None
    if place is None or (isinstance(place, str) and place in (*END_NAMES, "domain")):
        return force, displacement, place
    try:
        found = sympify(place, strict=True)
    except (SympifyError, TypeError):
        found = None
    if not isinstance(found, Expr):
        raise HamiltonError(
            f"virtual_work: place = {shown(place)}: must be 'left', 'right', 'domain', an interior place or None"
        )
    return force, displacement, found


def _read_work(space: JetSpace, triple: VirtualWork) -> list[tuple[Expr, Jet, bool]]:
    """Return (force, displacement jet, whether it is a force per length) for one virtual work triple."""
    force, displacement, place = triple
    where: Any = "ends" if place is None else place
    label = f"virtual work of {shown(force)} on {shown(displacement)}"
    moved = space.read(displacement, where, label)
    ends = {jet.place for jet in space.jets(moved) if jet.place is not None}
    if where == "ends" and len(ends) == 1:
        where = ends.pop()
    pushed = space.read(force, where, label)
    return [(push, jet, place == "domain") for push, jet in linear_work(space, pushed, moved, label)]


def lagrange_forces(space: JetSpace, lagrangian: Expr) -> Forces:
    """Return sum_b (-d/dt)^b dL/du_b for each displacement u: integration by parts in time."""
    forces: Forces = {}
    for jet in space.jets(lagrangian):
        term = lagrangian.diff(space.symbol(jet))
        for _ in range(jet.time):
            term = -space.d_t(term)
        displacement = jet._replace(time=0)
        forces[displacement] = forces.get(displacement, S.Zero) + term
    return forces
