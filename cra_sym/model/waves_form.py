"""Input of the wave solver from a uniform Lagrangian: blocks, parities, end matrices, coefficients that are 0 or 1."""

from __future__ import annotations

from collections.abc import Sequence
from functools import reduce
from itertools import product
from typing import NamedTuple

from sympy import Dummy, Expr, Matrix, S, Symbol, cancel, eye, fraction, lcm, solve, zeros

from cra_sym.mechanics import StateForm
from cra_sym.solvers.waves import Structure, kept

__all__ = ["Conditions", "WavesForm", "conditions", "known_coefficients", "parity", "powers", "squares", "waves_form"]

_MOST_COUPLED = 3  # displacements of a section inside, which have as many wave numbers
_MOST_PLACES = 12  # conditions, whose minors double in number with each


def parity(system: Matrix, n: int) -> tuple[tuple[int, ...], tuple[bool, ...], tuple[int, ...]] | None:
    """Return the displacements block by block, which of them are odd, and the block sizes.

    None if no reflection of x leaves the problem unchanged.

    The first displacement of each block is even, since the sign of a whole block is free.
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
    """Return which displacements of a block are odd under a reflection that leaves the problem unchanged."""
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


class Conditions(NamedTuple):
    """Conditions of both ends and of the lumped coordinates, on the degrees of freedom (q left, q right, w).

    Attributes
    ----------
    stiffness, mass : Matrix, shape (dofs, dofs)
        Of the free degrees of freedom, without the links.
    ties : Matrix, shape (dofs, dofs)
        Each dependent displacement as a combination of the free ones.
    free : tuple of int
        Degrees of freedom that no essential condition holds.
    springs : dict of Symbol to tuple of int
        For each parameter that may be infinite, the degrees of freedom and links that it then holds; links are numbered
        after the degrees of freedom.
    links : Matrix, shape (links, 2 + dofs)
        Springs and masses on a combination of degrees of freedom: stiffness, mass, and the combination (the stretch of
        the spring, the displacement of the mass). A mass on a lever arm is one; expanded into a matrix, it would cancel
        the digits of smaller masses. Springs come first, masses last.
    carried : Matrix, shape (n, coordinates)
        ``q = v + carried w`` has no coordinate inside, v in the Lagrangian has.
    linked : bool
        Whether ends or coordinates are joined.
    """

    stiffness: Matrix
    mass: Matrix
    ties: Matrix
    free: tuple[int, ...]
    springs: dict[Symbol, tuple[int, ...]]
    links: Matrix
    carried: Matrix
    linked: bool


def conditions(form: StateForm, order: tuple[int, ...], symbols: Sequence[Symbol]) -> Conditions | None:
    """Return the conditions of ends and coordinates.

    None if they are not linear in z, or if a coordinate acts inside other than as a rigid translation of whole fields,
    such as a moving base under the elastic foundation of a beam.
    """
    n, m = len(order), len(form.coordinates)
    carried = _carried(form)
    if carried is None:
        return None
    shift, own = carried
    back = eye(2 * n + m)
    back[:n, n : n + m], back[n + m :, n : n + m] = -shift, -shift
    boundary = back.T * form.boundary * back
    boundary[n : n + m, n : n + m] += own * form.length
    places = [*order, *(n + m + i for i in order), *range(n, n + m)]
    boundary = boundary.extract(places, places)
    every = list(range(form.free.cols))
    free = _leaders(form.free.extract(places, every))
    if free is None:
        return None
    motions = (back.inv() * form.free).extract(places, every)
    motions *= motions.extract(free, every).inv()
    whole = (motions.T * boundary * motions).applyfunc(_expanded)
    inside = form.system.free_symbols | form.length.free_symbols | motions.free_symbols
    springs, links = _springs(whole, [symbol for symbol in symbols if symbol not in inside], form.parameter)
    masses = _lever_masses(whole, form.parameter)
    if 2 * n + m + links.rows + masses.rows <= _MOST_PLACES:
        links = Matrix.vstack(links, masses)
    for link in range(links.rows):
        stretch = links[link, 2:]
        whole -= (links[link, 0] - form.parameter * links[link, 1]) * stretch.T * stretch
    whole = whole.applyfunc(cancel) if links.rows else whole
    pairs = [powers(entry, form.parameter) for entry in whole.applyfunc(_expanded)]
    if None in pairs:
        return None
    size = 2 * n + m
    stiffness, mass, ties, stretches = (
        zeros(size, size),
        zeros(size, size),
        zeros(size, size),
        zeros(links.rows, 2 + size),
    )
    for i, row in enumerate(free):
        for j, column in enumerate(free):
            stiffness[row, column], slope = pairs[i * len(free) + j]  # type: ignore[misc]
            mass[row, column] = -slope
        stretches[:, 2 + row] = links[:, 2 + i]
        for place in range(size):
            ties[place, row] = motions[place, i] if place not in free else 0
    stretches[:, :2] = links[:, :2]
    joined = any(
        part[i, j] != 0 and i // n != j // n
        for part in (stiffness, mass, ties)
        for i in range(2 * n)
        for j in range(2 * n)
    )
    number = [*free, *range(size, size + links.rows)]
    found = {symbol: tuple(number[place] for place in acting) for symbol, acting in springs.items()}
    linked = bool(m) or joined or links.rows > 0
    return Conditions(
        stiffness, mass, ties, tuple(free), found, stretches, shift.extract(list(order), list(range(m))), linked
    )


def _expanded(entry: Expr) -> Expr:
    return entry.expand()


def _carried(form: StateForm) -> tuple[Matrix, Matrix] | None:
    """Return the uniform displacement per unit of each coordinate, and the coordinates' stiffness per length; or None.

    In terms of displacements relative to these, the equations inside do not depend on the coordinates.
    """
    n, m = len(form.displacements), len(form.coordinates)
    if not m:
        return zeros(n, 0), zeros(0, 0)
    q, w, force, reaction = (
        slice(a, b) for a, b in ((0, n), (n, n + m), (n + m, 2 * n + m), (2 * n + m, 2 * n + 2 * m))
    )
    system, z = form.system, form.parameter
    rows = [system[q, :], system[force, :]]
    parts = [part for row in rows for part in (row.subs(z, 0), row.diff(z))]
    whole = Matrix.vstack(*parts)
    unknown = [Dummy() for _ in range(n * m)]
    shift = Matrix(n, m, unknown)
    found = solve(list(whole[:, q] * shift - whole[:, w]), unknown, dict=True) if any(whole[:, w]) else [{}]
    if not found:
        return None
    shift = shift.subs(found[0]).subs(dict.fromkeys(unknown, 0))
    rest = system[reaction, :] - shift.T * system[force, :]
    own = rest[:, w].applyfunc(_expanded)
    moving = Matrix.hstack(rest[:, q], rest[:, force], rest[:, reaction])
    return (shift, own) if all(entry.expand() == 0 for entry in moving) and not shift.has(z) else None


def _leaders(motions: Matrix) -> list[int] | None:
    """Return the degree of freedom that represents each admissible motion; None if a motion has none of its own."""
    found = []
    for column in range(motions.cols):
        own = [i for i in range(motions.rows) if motions[i, column] == 1 and sum(e != 0 for e in motions[i, :]) == 1]
        if not own:
            return None
        found.append(own[0])
    return found


def _springs(
    whole: Matrix, symbols: Sequence[Symbol], parameter: Symbol
) -> tuple[dict[Symbol, tuple[int, ...]], Matrix]:
    """Return the degrees of freedom and links on which each stiffness acts, and the links as `Conditions` has them.

    Links are numbered after the degrees of freedom.
    """
    springs: dict[Symbol, tuple[int, ...]] = {}
    links: list[list[Expr]] = []
    for symbol in symbols:
        slope = whole.diff(symbol)
        parts = [] if slope.has(parameter, symbol) else squares(slope)
        acting = []
        for factor, stretch in parts:
            moved = [place for place, entry in enumerate(stretch) if entry != 0]
            if len(moved) == 1:
                acting.append(moved[0])
                continue
            number = next((number for number, (_, _, *known) in enumerate(links) if known == stretch), len(links))
            if number == len(links):
                links.append([S.Zero, S.Zero, *stretch])
            links[number][0] += symbol * factor
            acting.append(whole.rows + number)
        if acting:
            springs[symbol] = tuple(acting)
    return springs, Matrix(len(links), 2 + whole.rows, [entry for link in links for entry in link])


def _lever_masses(whole: Matrix, parameter: Symbol) -> Matrix:
    """Return the masses on a combination of degrees of freedom, as links."""
    mass = -whole.diff(parameter)
    links: list[list[Expr]] = []
    for symbol in (*sorted(mass.free_symbols - {parameter}, key=str), S.One):
        slope = mass.subs(dict.fromkeys(mass.free_symbols, 0)) if symbol is S.One else mass.diff(symbol)
        for factor, motion in [] if slope.has(parameter, symbol) and symbol is not S.One else squares(slope):
            if sum(entry != 0 for entry in motion) > 1:
                links.append([S.Zero, symbol * factor, *motion])
            mass = (mass - symbol * factor * Matrix(motion) * Matrix(motion).T).applyfunc(cancel)
    return Matrix(len(links), 2 + whole.rows, [entry for link in links for entry in link])


def squares(matrix: Matrix) -> list[tuple[Expr, list[Expr]]]:
    """Return factors d and vectors h without divisors such that a matrix is the sum of ``d h h^T``.

    The list is empty if a factor is negative. Pivots that are numbers come first, which keeps the vectors short.
    """
    found = []
    for _ in range(matrix.rows):
        place = min(range(matrix.rows), key=lambda at: (matrix[at, at] == 0, not matrix[at, at].is_number, at))
        factor = matrix[place, place]
        if factor != 0:
            stretch = (matrix[:, place] / factor).applyfunc(cancel)
            matrix = (matrix - factor * stretch * stretch.T).applyfunc(cancel)
            divisor = reduce(lcm, (fraction(entry)[1] for entry in stretch if entry.free_symbols), S.One)
            found.append((cancel(factor / divisor**2), [cancel(divisor * entry) for entry in stretch]))
    return found if matrix.is_zero_matrix and not any(factor.is_negative for factor, _ in found) else []


class WavesForm(NamedTuple):
    """Symbolic input of the wave solver.

    Attributes
    ----------
    order : tuple of int
        Displacements in the order of the problem: those that are coupled inside together.
    structure : Structure
    matrices : tuple of Expr
        Entries of A_OE and A_EO without z, then their factors of z.
    conditions : Conditions
    known : tuple of (0, 1 or None)
        Coefficients of the problem that are the same for all parameters.
    """

    order: tuple[int, ...]
    structure: Structure
    matrices: tuple[Expr, ...]
    conditions: Conditions
    known: tuple[int | None, ...]


def waves_form(form: StateForm, symbols: Sequence[Symbol]) -> WavesForm | None:
    """Return the input of the wave solver for a conservative problem, or None if the solver does not cover it."""
    n = len(form.displacements)
    if not n or 2 * n > _MOST_PLACES or not form.uniform or form.damped:
        return None
    m = len(form.coordinates)
    section = [*range(n), *range(n + m, 2 * n + m)]
    system = form.system.extract(section, section)
    split = parity(system, n)
    ends = None if split is None else conditions(form, split[0], symbols)
    if split is None or ends is None or max(split[2]) > _MOST_COUPLED:
        return None
    order, odd, sizes = split
    even_state = [n + i if odd[at] else i for at, i in enumerate(order)]
    odd_state = [(place + n) % (2 * n) for place in even_state]
    parts = [system.extract(odd_state, even_state), system.extract(even_state, odd_state)]
    entries = [powers(entry, form.parameter) for matrix in parts for entry in matrix]
    if None in entries:
        return None
    matrices = tuple(entry[power] for power in (0, 1) for entry in entries)  # type: ignore[index]
    if not any((*matrices[len(entries) :], *ends.mass)):
        return None  # nothing has mass: the general route raises the error
    structure = Structure(odd, sizes, m, ends.links.rows, ends.linked)
    if structure.places > _MOST_PLACES:
        return None
    known = known_coefficients(structure, matrices, ends)
    return WavesForm(order, structure, matrices, ends, tuple(kept(structure, known)))


def known_coefficients(structure: Structure, matrices: Sequence[Expr], ends: Conditions) -> list[int | None]:
    """Return which coefficients of a problem are 0 or 1 whatever the parameters are."""
    n = structure.n
    known: list[int | None] = [None] * structure.coefficients
    half = len(matrices) // 2  # those of A_OE, then those of A_EO, without z, and again their factors
    for at, entry in enumerate(matrices):
        power, (matrix, place) = at // half, divmod(at % half, n * n)
        if entry == 0:
            known[structure.matrices[matrix] + power * n * n + place] = 0
    for place in range(structure.moving):
        first, reach, free = structure.condition(place), structure.reach(place), place in ends.free
        size, sprung = len(reach), any(place in acting for acting in ends.springs.values())
        loose = free and not sprung and ends.stiffness[place, place] == 0 and ends.mass[place, place] == 0
        for j, other in enumerate(reach):
            own = other == place
            some = ends.stiffness[place, other] != 0 or (own and sprung)
            follows = 1 if own else None if ends.ties[place, other] != 0 else 0
            known[first + j] = follows if not free else None if some else 0
            known[first + size + j] = None if free and ends.mass[place, other] != 0 else 0
        for j, other in enumerate(structure.forces(place)):
            link = other - structure.moving
            factor = ends.links[link, 2 + place] if link >= 0 else ends.ties[other, place] + int(other == place)
            one = 1 if loose and factor * structure.turned[place] * structure.turned[other] == 1 else None
            known[first + 2 * size + j] = one if free and factor != 0 else 0
    for link in range(structure.links):
        first, size = structure.condition(structure.moving + link), structure.moving
        for other in range(size):
            for part in (0, 1):
                varies = ends.links[link, part] != 0 and ends.links[link, 2 + other] != 0
                known[first + part * size + other] = None if varies else 0
        for j, other in enumerate(structure.forces(0)):
            known[first + 2 * size + j] = None if other == structure.moving + link else 0
    return known
