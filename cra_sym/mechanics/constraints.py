"""Essential conditions: linear relations between end displacements, solved for one displacement each."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from sympy import Add, Expr, S, expand

from cra_sym.mechanics.jets import HamiltonError, Jet, JetSpace

__all__ = ["Elimination", "eliminate"]


@dataclass(frozen=True)
class Elimination:
    """Each eliminated displacement as a linear combination of the remaining ones.

    Attributes
    ----------
    space : JetSpace
    factors : dict of Jet to dict of Jet to Expr
        ``pivot = sum factor * displacement + offset``; free of other pivots.
    offsets : dict of Jet to Expr
        Prescribed motion of the pivot.
    """

    space: JetSpace
    factors: dict[Jet, dict[Jet, Expr]]
    offsets: dict[Jet, Expr]

    def value(self, displacement: Jet) -> Expr | None:
        """Return the value of an eliminated displacement, None for a free one."""
        if displacement not in self.factors:
            return None
        moved = (factor * self.space.symbol(jet) for jet, factor in self.factors[displacement].items())
        return Add(self.offsets[displacement], *moved)

    def shares(self, displacement: Jet) -> list[tuple[Jet, Expr]]:
        """Return (pivot, factor) for the pivots that move with ``displacement``."""
        return [(pivot, row[displacement]) for pivot, row in self.factors.items() if displacement in row]

    def check_homogeneous(self, label: str) -> None:
        """Raise an error for a prescribed displacement, where only homogeneous conditions are allowed."""
        for jet, offset in self.offsets.items():
            if offset != 0:
                given = f"{self.space.form(jet)} = {self.space.write(self.value(jet) or S.Zero)}"
                raise HamiltonError(f"{label}: essential, {given}: must be 0; measure the displacement from there")

    def check_effective(self, term: Expr, label: str) -> None:
        """Raise an error for an end term that does no work because of the essential conditions."""
        space, values = self.space, {}
        for jet in space.jets(term):
            value = self.value(jet._replace(time=0))
            if value is not None:
                for _ in range(jet.time):
                    value = space.d_t(value)
                values[space.symbol(jet)] = value
        if values and not space.jets(expand(term.xreplace(values))):
            fixed = ", ".join(f"{space.form(j)} = {space.write(self.value(j) or S.Zero)}" for j in self.factors)
            raise HamiltonError(
                f"{label}, term {space.write(term)}: it does no work, because {fixed} is essential; drop one"
            )


def eliminate(space: JetSpace, essential: Sequence[Expr], orders: Sequence[int]) -> Elimination:
    """Solve the essential conditions.

    Parameters
    ----------
    essential : sequence of Expr
        Linear combinations of end displacements, coordinates and prescribed motions, each of which vanishes.
    orders : sequence of int
        Highest x derivative of each field: derivatives below it are displacements of an end.

    Raises
    ------
    HamiltonError
        If one is not such a combination, or is redundant or contradictory.
    """
    factors: dict[Jet, dict[Jet, Expr]] = {}
    offsets: dict[Jet, Expr] = {}
    for condition in essential:
        row, offset = _read(space, condition, orders)
        for pivot in [jet for jet in row if jet in factors]:
            weight = row.pop(pivot)
            offset += weight * offsets[pivot]
            _add(row, factors[pivot], weight)
        ends = [jet for jet in row if jet.place is not None]
        if not ends:
            raise HamiltonError(f"essential, {condition}: it follows from or contradicts the conditions before it")
        pivot = next((jet for jet in ends if row[jet].is_number), ends[0])
        scale = -1 / row.pop(pivot)
        new, moved = {jet: scale * factor for jet, factor in row.items()}, scale * offset
        for old, others in factors.items():
            if pivot in others:
                weight = others.pop(pivot)
                offsets[old] += weight * moved
                _add(others, new, weight)
        factors[pivot], offsets[pivot] = new, moved
    return Elimination(space, factors, offsets)


def _add(row: dict[Jet, Expr], other: dict[Jet, Expr], weight: Expr) -> None:
    for jet, factor in other.items():
        row[jet] = expand(row.get(jet, S.Zero) + weight * factor)
        if row[jet] == 0:
            del row[jet]


def _read(space: JetSpace, condition: Expr, orders: Sequence[int]) -> tuple[dict[Jet, Expr], Expr]:
    label = f"essential, {condition}"
    read = space.read(condition, "ends", "essential")
    row: dict[Jet, Expr] = {}
    for jet in space.jets(read):
        row[jet] = read.diff(space.symbol(jet))
        if jet.time or space.jets(row[jet]):
            raise HamiltonError(f"{label}: it must be linear and free of time derivatives")
        if jet.place is not None and jet.space >= orders[jet.unknown]:
            raise HamiltonError(
                f"{label}: {space.form(jet)} is not a displacement of an end;"
                " a condition on it is natural and follows from the energy"
            )
    if not any(jet.place for jet in row):
        raise HamiltonError(f"{label}: it contains no displacement of an end")
    return row, read.xreplace({space.symbol(jet): S.Zero for jet in row})
