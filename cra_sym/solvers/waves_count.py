"""Uniform problems with up to three waves a section: their determinant and exact count, in NumPy and as text."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import cache
from typing import Any

import numpy as np

from . import waves_kernel, waves_three
from .straight import Exact, straight
from .waves_problem import Floats, Integers
from .waves_structure import Structure

__all__ = [
    "KINDS", "Determinant", "Functions", "assembled", "block_columns", "block_waves", "condition", "count_of",
    "determinant_of", "direct", "displacements", "end_rows", "formulas", "kept", "kinds", "lowest_branch", "regime",
    "regime_formula",
    "sections", "signs", "value_of", "wave_texts",
]  # fmt: skip

kernel: Any = waves_kernel  # formulas of arrays and terms, without types
three: Any = waves_three

ZERO = Exact(0)
Functions = Mapping[str, Callable[..., Any]]
Entries = Any  # a sequence of numbers, arrays or terms
Rows = list[tuple[Any, ...]]


def sections(structure: Structure, k: Entries, z: Any) -> list[tuple[Any, Any]]:
    """Return the matrices a and b of every block."""
    first, second = structure.matrices
    n = structure.n
    return [(kernel.linear(k, z, first, block, n), kernel.linear(k, z, second, block, n)) for block in structure.blocks]


def signs(structure: Structure, block: tuple[int, int]) -> list[int]:
    """Return 1 for each even and -1 for each odd displacement of a block."""
    return [-1 if odd else 1 for odd in structure.odd[slice(*block)]]


def block_waves(structure: Structure, block: tuple[int, int], a: Any, b: Any) -> Any:
    """Return the quantities of the waves of a block from which its columns are computed."""
    if len(a) == 1:
        return (b[0] * a[0],)
    return kernel.wave_numbers(a, b) if len(a) == 4 else three.alone(a, b, signs(structure, block))


def block_columns(structure: Structure, block: tuple[int, int], a: Any, b: Any, waves: Any, kind: str) -> Any:
    """Return the columns of a block and their basis, in a given regime or in any."""
    if len(a) == 1:
        return kernel.columns_of_one(a[0], b[0], *kernel.wave(waves[0])), 1.0
    if len(a) == 4:
        return kernel.two_waves(a, b, waves, kind)
    return three.three_waves(a, b, signs(structure, block), waves, kernel.two_waves, kind)


KINDS = {1: ("any",), 2: ("near", "close", "mixed", "distant"), 3: ("near", "close", "mixed", "distant", "series")}
"""Regimes of a block, by its size."""


def kinds(structure: Structure) -> tuple[str, ...]:
    """Return the regimes of a problem: that of the blocks with several waves if they share one, else 'any'."""
    several = sum(size > 1 for size in structure.sizes) > 1
    return (*KINDS[max(structure.sizes)], *(("any",) if several else ()))


def regime(waves: Any) -> Any:
    """Return the place of the regime of a block among the kinds; a number, for terms too."""
    where, split = kernel.where, len(waves) == 7
    near, close, mixed = kernel.regime(*(waves[2] if split else waves)[:3])
    found = where(near, 0.0, where(close, 1.0, where(mixed, 2.0, 3.0)))
    return where(waves[0], 4.0, found) if split else found


def _mu(waves: Any, slopes: Any) -> list[tuple[Any, Any, Any]]:
    """Return each mu of a block, whether it is real, and whether its branch omega(k) falls."""
    rates = [-value if at % 2 == 0 else value for at, value in enumerate(slopes)]

    def rate(mu: Any) -> Any:  # of the characteristic polynomial by z
        found = rates[0]
        for value in rates[1:]:
            found = found * mu + value
        return found

    if len(waves) == 1:
        return [(waves[0], True, rates[0] < 0.0)]
    pair, lone = (waves[2], waves[1]) if len(waves) == 7 else (waves, None)
    half, product, square = pair[:3]
    big, small = kernel.eigenvalues(half, product, square)
    real = square >= 0.0
    upward = kernel.where(half < 0.0, -1.0, 1.0)  # the sign of big - small
    if lone is None:
        return [(big, real, rate(big) * upward < 0.0), (small, real, rate(small) * upward > 0.0)]
    beyond = kernel.where(lone < half, 1.0, -1.0)  # the sign for both waves over that for one
    found = [(lone, True, rate(lone) < 0.0)]
    found += [(big, real, rate(big) * upward * beyond < 0.0), (small, real, rate(small) * upward * beyond > 0.0)]
    return found


def _shears(structure: Structure, block: tuple[int, int], b: Any) -> Any:
    """Return the number of uniform motions of a block (constant along x) below z."""
    size, odd = block[1] - block[0], structure.odd[slice(*block)]
    if not any(odd):
        return 0.0
    order = sorted(range(size), key=lambda i: odd[i])
    first = sum(1 for value in odd if not value)
    found = []
    for number in range(first + 1, size + 1):
        found.append(kernel.determinant([[b[size * i + j] for j in order[:number]] for i in order[:number]]))
    if len(found) == 1:
        return kernel.where(found[0] < 0.0, 1.0, 0.0)
    return kernel.where(found[1] < 0.0, 1.0, kernel.where(found[0] < 0.0, 2.0, 0.0))


def assembled(structure: Structure, columns: Sequence[Any]) -> tuple[list[Any], list[Any]]:
    """Return E and O for all columns, row by row."""
    n = structure.n
    even, odd = ([[ZERO] * (2 * n) for _ in range(n)] for _ in range(2))
    for (start, stop), block in zip(structure.blocks, columns, strict=True):
        size = stop - start
        parts = ((even, 0), (odd, 0), (odd, n), (even, n))
        for number, (rows, shift) in enumerate(parts):
            for i in range(size):
                for j in range(size):
                    rows[start + i][shift + start + j] = block[number * size * size + size * i + j]
    return even, odd


def displacements(structure: Structure, even: list[Any], odd: list[Any]) -> tuple[list[Any], list[Any]]:
    """Return q and P of sections whose E and O are given."""
    q = [odd[i] if structure.odd[i] else even[i] for i in range(structure.n)]
    return q, [even[i] if structure.odd[i] else odd[i] for i in range(structure.n)]


def end_rows(structure: Structure, even: list[Any], odd: list[Any], *, reflected: bool = True) -> tuple[Rows, Rows]:
    """Return the displacements of all degrees of freedom and the forces, including links, for all columns.

    Both have the opposite sign for a displacement that is odd under reflection; a force of the left end is -P. The
    columns of the section are followed by one for each coordinate and each link.
    """
    n, size = structure.n, structure.places
    q, force = displacements(structure, even, odd)

    def row(values: Any, end: int) -> tuple[Any, ...]:
        second = values[n:] if end or not reflected else [-value for value in values[n:]]
        return *values[:n], *second, *([ZERO] * (size - 2 * n))

    units = [tuple(Exact(int(c == place)) for c in range(size)) for place in range(2 * n, size)]
    moved, forces = ([row(values, end) for end in (0, 1) for values in part] for part in (q, force))
    return [*moved, *units[: structure.coordinates]], [*forces, *units[structure.coordinates :]]


def condition(structure: Structure, k: Entries, z: Any, place: int, moved: Rows, forces: Rows) -> tuple[Any, ...]:
    """Return the condition of a degree of freedom for all columns."""
    acting = dict(zip((*range(2 * structure.n), *range(structure.moving, structure.places)), forces, strict=True))
    own = [moved[e] for e in structure.reach(place)], [acting[d] for d in structure.forces(place)]
    found: tuple[Any, ...] = kernel.condition(k, z, structure.condition(place), *own)
    return found


def value_of(structure: Structure, k: Entries, z: Any, columns: Sequence[Any], basis: Any) -> Any:
    """Return the determinant of all conditions, expanded by the last block, or by the left end for one block."""
    n, width, several = structure.n, structure.places, len(structure.blocks) > 1
    parts, last = assembled(structure, columns), structure.block(n - 1)
    left = [p for p in range(n) if all(max(found, default=0) < n for found in structure.touched(k, p))]
    apart = [p for p in structure.order if structure.block(p) == last] if several else left
    others = [p for p in structure.order if p not in apart]
    found = []
    for places, reflected in ((others, True), (apart, several)):
        ends = end_rows(structure, *parts, reflected=reflected)
        found.append(kernel.minors([condition(structure, k, z, place, *ends) for place in places]))
    sign = structure.sign([*others, *apart])
    return kernel.joined(*found, len(others), width, sign, () if several else range(n, 2 * n)) / basis


def _chain(structure: Structure, k: Entries, z: Any, parts: tuple[Any, Any]) -> Iterator[tuple[Any, Any]]:
    """Yield determinants from E = 0, w = 0 and no links to the actual problem, with the changes of the count.

    Each step changes one condition and the count by 0 or 1, in a known direction. Odd displacements, free at the start,
    get their springs
    first: this lowers the count, or raises it where inertia exceeds the spring. Those coupled to others are held. Each
    later release of a displacement raises the count, each spring lowers it, each mass raises it.
    """
    moved, forces = end_rows(structure, *parts)
    units, way = [*moved, *forces[2 * structure.n :]], structure.chain(k)
    final = {place: condition(structure, k, z, place, moved, forces) for place in structure.order}
    rows = {place: forces[place] if structure.is_odd(place) else units[place] for place in structure.order}
    places = [*way.lumped, *way.same, *way.following, *way.first, *way.last]
    places.sort(key=lambda place: structure.block(place) if place not in way.lumped else -2)
    sign = structure.sign(places)

    def changed(place: int, row: tuple[Any, ...]) -> Any:
        rows[place] = row
        size = max(1 + places.index(place), len(way.lumped))
        upper, lower = [rows[p] for p in places[:size]], [rows[p] for p in places[: size - 1 : -1]]
        back = -1.0 if len(lower) % 4 in (2, 3) else 1.0
        return kernel.joined(kernel.minors(upper), kernel.minors(lower), size, structure.places, sign * back)

    for place in way.first:
        own = structure.own(place)
        sprung = k[own] - z * k[own + len(structure.reach(place))] > 0.0
        yield changed(place, final[place]), kernel.where(sprung, -1.0, 1.0)
    for place in way.bound:
        yield changed(place, units[place]), -1.0
    rows |= {place: final[place] for place in way.following}
    for place in (*way.last, *way.lumped):
        rise: Any = -1.0 if place >= structure.moving else 1.0
        yield changed(place, final[place]), kernel.where(z < 0.0, -1.0, 1.0) if structure.is_mass(k, place) else rise


def count_of(
    structure: Structure,
    k: Entries,
    z: Any,
    matrices: Sequence[Any],
    waves: Sequence[Any],
    columns: Sequence[Any],
    bases: Sequence[Any],
) -> tuple[Any, Any]:
    """Return the count by a chain of conditions, and the last determinant."""
    number, basis = 0.0, 1.0
    for block, (_, b), wave, column, own in zip(structure.blocks, matrices, waves, columns, bases, strict=True):
        size = block[1] - block[0]
        table = [k[structure.table(i) : structure.table(i) + 4] for i in range(*block)]
        held = [
            kernel.determinant([column[part * size * size + size * i :][:size] for i in range(size)]) for part in (0, 3)
        ]
        slopes = kernel.elementary(table, z)[1]
        shear = _shears(structure, block, b)
        number = kernel.reference(_mu(wave, slopes), shear, held[0] * held[1] * own) + number
        basis = own if isinstance(basis, float) else basis * own
    value = None
    for value, change in _chain(structure, k, z, assembled(structure, columns)):
        number = kernel.adaptable(value * basis, number, change)
    return number, value_of(structure, k, z, columns, basis) if value is None else value / basis


def _prepared(structure: Structure, k: Entries, z: Any, kind: str) -> tuple[Any, ...]:
    """Return matrices, waves, columns and their bases of all blocks."""
    matrices, blocks = sections(structure, k, z), structure.blocks
    waves = [block_waves(structure, block, *both) for block, both in zip(blocks, matrices, strict=True)]
    given = zip(blocks, matrices, waves, strict=True)
    columns, bases = zip(
        *(block_columns(structure, block, *both, own, kind) for block, both, own in given), strict=True
    )
    return matrices, waves, columns, bases


def _functions(structure: Structure, wanted: Sequence[str]) -> dict[str, Callable[[Entries, Any], Sequence[Any]]]:
    """Return the functions of the coefficients of a lane and of z, or of half waves along the length."""

    def value(kind: str) -> Callable[[Entries, Any], Sequence[Any]]:
        return lambda k, z: [determinant_of(structure, kind, k, z, scaled=True)]

    def count(kind: str) -> Callable[[Entries, Any], Sequence[Any]]:
        return lambda k, z: count_of(structure, k, z, *_prepared(structure, k, z, kind))

    def kind_of(k: Entries, z: Any) -> Sequence[Any]:
        found = None
        for block, (a, b) in zip(structure.blocks, sections(structure, k, z), strict=True):
            if len(a) > 1:
                place = regime(block_waves(structure, block, a, b))
                found = place if found is None else kernel.where(place == found, found, len(kinds(structure)) - 1.0)
        return [0.0 if found is None else found]

    found = {f"_value_{kind}": value(kind) for kind in wanted}
    found |= {f"_count_{kind}": count(kind) for kind in wanted}
    return found | {"_regime": kind_of, "_branch": lambda k, turns: [lowest_branch(structure, k, turns)]}


def determinant_of(structure: Structure, kind: str, k: Entries, z: Any, *, scaled: bool = False) -> Any:
    """Return the determinant of all conditions in one regime; without a positive or negative factor unless scaled."""
    _, _, columns, bases = _prepared(structure, k, z, kind)
    return value_of(structure, k, z, columns, _product(bases) if scaled else 1.0)


def wave_texts() -> list[str]:
    """Return the texts of the functions of a wave that the other texts call."""
    waves = {"_wave": kernel.wave_anywhere, "_rising": kernel.rising, "_turning": kernel.turning}
    return [straight(name, lambda _, m, function=function: function(m), ["m"]) for name, function in waves.items()]


@cache
def formulas(structure: Structure, known: tuple[int | None, ...], wanted: tuple[str, ...] = ()) -> str:
    """Return the text of ``_value_kind`` and ``_count_kind`` for some kinds of regimes, of ``_regime`` and ``_branch``.

    The arguments are the coefficients that are not known, a lane or lanes, and z or the half waves along the length.
    The default is the kinds that `Determinant` needs.
    """
    functions = _functions(structure, wanted or kinds(structure))
    texts = wave_texts()
    texts += [straight(name, function, ["z"], known) for name, function in functions.items()]
    return "\n\n\n".join(texts) + "\n"


def direct(structure: Structure, known: tuple[int | None, ...]) -> Functions:
    """Return the functions of `formulas` without generating text; slower."""

    def of_lanes(function: Callable[[Entries, Any], Sequence[Any]]) -> Callable[..., Any]:
        def found(k: Floats, i: Any, z: Any) -> Any:
            rows = iter(k)
            results = function([Exact(value) if value is not None else next(rows)[i] for value in known], z)
            return results[0] if len(results) == 1 else tuple(results)

        return found

    return {name: of_lanes(function) for name, function in _functions(structure, kinds(structure)).items()}


def _product(bases: Sequence[Any]) -> Any:
    found = bases[0]
    for basis in bases[1:]:
        found = found if isinstance(basis, float) else basis if isinstance(found, float) else found * basis
    return found


def kept(structure: Structure, known: Sequence[int | None]) -> list[int | None]:
    """Return the known coefficients, except in matrix rows that would then be omitted as a whole."""
    kept, n = list(known), structure.n
    for first in structure.matrices:
        for start, stop in structure.blocks:
            for i in range(start, stop):
                row = [first + shift + n * i + j for shift in (0, n * n) for j in range(start, stop)]
                if stop - start > 1 and all(known[place] == 0 for place in row):
                    for place in row:
                        kept[place] = None
    return kept


def lowest_branch(structure: Structure, k: Entries, turns: Any) -> Any:
    """Return the lowest z of free waves of ``turns`` half waves along the length."""
    wave = turns * (0.5 * np.pi) * (turns * (0.5 * np.pi))
    lowest = None
    for block in structure.blocks:
        table = [k[structure.table(i) : structure.table(i) + 4] for i in range(*block)]
        z = kernel.branch(wave, table)
        lowest = z if lowest is None else kernel.where((z < lowest) | (lowest != lowest), z, lowest)
    return lowest


def regime_formula(structure: Structure, known: Sequence[int | None]) -> str:
    """Return the text of ``_regime`` alone."""
    return straight("_regime", _functions(structure, ())["_regime"], ["z"], known)


class Determinant:
    """The determinant of the end conditions, entire in z up to a positive factor, with the exact count.

    Parameters
    ----------
    k : ndarray, shape (varying coefficients, rows)
        From `UniformProblem.coefficients`.
    structure : Structure
    functions : mapping of str to callable
        What the text of `formulas` defines.
    zeros : ndarray of int, shape (rows,)
        Multiplicity of the zero at z = 0, which is divided out of the values.
    """

    def __init__(self, k: Floats, structure: Structure, functions: Functions, zeros: Integers) -> None:
        self.k, self.structure, self.zeros = k, structure, zeros
        self._functions, self._kinds = functions, kinds(structure)

    def take(self, rows: Integers) -> Determinant:
        """Return the functions of some of the rows."""
        return Determinant(self.k[:, rows], self.structure, self._functions, self.zeros[rows])

    @np.errstate(all="ignore")
    def value(self, z: Floats) -> Floats:
        """Return the determinant over ``z**zeros``."""
        result = np.empty(z.size)
        for kind, part in self.regimes(z):
            result[part] = self._functions[f"_value_{kind}"](self.k, part, z[part])
        return self._deflated(result, z)

    @np.errstate(all="ignore")
    def count(self, z: Floats) -> tuple[Integers, Floats]:
        """Return the exact number of zeros below z (for z > 0 those at 0 included), and the value."""
        number, result = np.empty(z.size, dtype=np.int64), np.empty(z.size)
        for kind, part in self.regimes(z):
            number[part], result[part] = self._functions[f"_count_{kind}"](self.k, part, z[part])
        return number, self._deflated(result, z)

    def branch(self, turns: float) -> Floats:
        """Return the lowest z of free waves of ``turns`` half waves along the length."""
        z: Floats = self._functions["_branch"](self.k, slice(None), turns)
        return z + np.zeros(self.zeros.size)

    def _deflated(self, value: Floats, z: Floats) -> Floats:
        return value / z**self.zeros if self.zeros.any() else value

    def regimes(self, z: Floats) -> Iterator[tuple[str, Any]]:
        """Yield each regime and its members."""
        if len(self._kinds) == 1:
            yield self._kinds[0], slice(None)
            return
        place = self._functions["_regime"](self.k, slice(None), z)
        for at, kind in enumerate(self._kinds):
            members = np.flatnonzero(place == at)
            if members.size:
                yield kind, slice(None) if members.size == z.size else members
