"""What a uniform Lagrangian is to the solver of waves: blocks, parities, end matrices, coefficients that are known."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import product

from sympy import Expr, Matrix, Symbol, zeros

from cra_sym.mechanics import StateForm
from cra_sym.solvers.waves import Structure

__all__ = ["End", "end_matrices", "known_coefficients", "only_entry", "parity", "powers"]


def parity(system: Matrix, n: int) -> tuple[tuple[int, ...], tuple[bool, ...], tuple[int, ...]] | None:
    """Return displacements block by block, which are odd, and the sizes of blocks; None if a reflection changes all.

    Of each block the first displacement is even: a reflection may turn all of it.
    """
    places = {i: (i, n + i) for i in range(n)}
    linked = {
        i: {j for j in range(n) if any(system[r, c] != 0 or system[c, r] != 0 for r in places[i] for c in places[j])}
        for i in range(n)
    }
    blocks: list[list[int]] = []
    for i in range(n):
        if not any(i in block for block in blocks):
            reached, new = {i}, {i}
            while new:
                new = {k for j in new for k in linked[j]} - reached
                reached |= new
            blocks.append(sorted(reached))
    odd: dict[int, bool] = {}
    for block in blocks:
        found = _reflection(system, n, block)
        if found is None:
            return None
        odd |= found
    order = tuple(i for block in blocks for i in block)
    return order, tuple(odd[i] for i in order), tuple(map(len, blocks))


def _reflection(system: Matrix, n: int, block: Sequence[int]) -> dict[int, bool] | None:
    """Return which displacements of a block are odd under a reflection that leaves the problem alone."""
    for signs in product((False, True), repeat=len(block) - 1):
        odd = dict(zip(block, (False, *signs), strict=True))
        first = [n + i if odd[i] else i for i in block]
        second = [i if odd[i] else n + i for i in block]
        if all(system[i, j].expand() == 0 for part in (first, second) for i in part for j in part):
            return odd
    return None


def powers(entry: Expr, parameter: Symbol) -> tuple[Expr, Expr] | None:
    """Return the part of an entry without z and its factor of z, or None if it is not linear in z."""
    slope = entry.diff(parameter).expand()
    return None if slope.has(parameter) else (entry.subs(parameter, 0), slope)


End = tuple[Matrix, Matrix, Matrix, set[int]]


def end_matrices(form: StateForm, order: tuple[int, ...], odd: tuple[bool, ...]) -> list[End] | None:
    """Return stiffness, mass, ties and the free displacements of each end, in order.

    None if the ends are linked, not linear in z, or link what the count does not.
    """
    n, found = len(order), []
    places = [*order, *(n + i for i in order)]
    boundary = form.boundary.extract(places, places)
    motions = form.free.extract(places, list(range(form.free.cols)))
    if any(entry.expand() != 0 for entry in boundary[:n, n:]):
        return None
    for end in (0, 1):
        here = slice(end * n, (end + 1) * n)
        free = _leaders(motions, n, end)
        if free is None:
            return None
        allowed = zeros(n, n)
        for i, column in free.items():
            allowed[:, i] = motions[here, column]
        ties = Matrix(n, n, lambda i, j, free=free, allowed=allowed: 0 if i in free else allowed[i, j])
        whole = (allowed.T * boundary[here, here] * allowed).applyfunc(lambda entry: entry.expand())
        pairs = [pair for pair in (powers(entry, form.parameter) for entry in whole) if pair is not None]
        mixed = any(ties[i, j] != 0 and odd[i] != odd[j] for i in range(n) for j in range(n))
        both_odd = any(whole[i, j] != 0 and odd[i] and odd[j] for i in range(n) for j in range(i))
        if len(pairs) < n * n or mixed or both_odd:
            return None
        stiffness, mass = (Matrix(n, n, [pair[k] * sign for pair in pairs]) for k, sign in ((0, 1), (1, -1)))
        found.append((stiffness, mass, ties, set(free)))
    return found


def _leaders(motions: Matrix, n: int, end: int) -> dict[int, int] | None:
    """Return the displacements of an end that are free, each with its column of the motions that are allowed.

    None if a motion moves both ends.
    """
    found = {}
    for column in range(motions.cols):
        moved = [i for i in range(2 * n) if motions[i, column] != 0]
        if not any(i // n == end for i in moved):
            continue
        lead = [i for i in moved if motions[i, column] == 1 and sum(entry != 0 for entry in motions[i, :]) == 1]
        if not lead or any(i // n != end for i in moved):
            return None
        found[lead[0] - end * n] = column
    return found


def known_coefficients(
    structure: Structure, matrices: Sequence[Expr], ends: Sequence[End], stiffnesses: set[tuple[int, int]]
) -> list[int | None]:
    """Return which coefficients of a problem are 0 or 1 whatever the parameters are."""
    n = structure.n
    known: list[int | None] = [None] * structure.coefficients
    half = len(matrices) // 2  # those of A_OE, then those of A_EO, without z, and again their factors
    for at, entry in enumerate(matrices):
        power, (matrix, place) = at // half, divmod(at % half, n * n)
        if entry == 0:
            known[structure.matrices[matrix] + power * n * n + place] = 0
    for end in (0, 1):
        stiffness, mass, ties, free = ends[end]
        for i in range(n):
            first = structure.condition(end, i)
            for j in range(n):
                q: int | None = 1 if i == j else None if ties[i, j] != 0 else 0
                inertia: int | None = 0
                force: int | None = 0
                if i in free:
                    loose = stiffness[i, i] == 0 and mass[i, i] == 0 and (end, i) not in stiffnesses
                    q = 0 if stiffness[i, j] == 0 and (i != j or (end, i) not in stiffnesses) else None
                    inertia = 0 if mass[i, j] == 0 else None
                    force = (1 if loose else None) if i == j else None if ties[j, i] != 0 else 0
                known[first + j], known[first + n + j], known[first + 2 * n + j] = q, inertia, force
    return known


def only_entry(form: StateForm, symbol: Symbol) -> int | None:
    """Return the displacement of an end that a stiffness alone holds, None if there is none or it does more."""
    inside = form.system.free_symbols | form.length.free_symbols | form.free.free_symbols
    slope = form.boundary.diff(symbol)
    places = [i for i in range(slope.rows) if slope[i, i] != 0 and not slope[i, i].has(symbol, form.parameter)]
    return places[0] if symbol not in inside and len(places) == 1 and sum(e != 0 for e in slope) == 1 else None
