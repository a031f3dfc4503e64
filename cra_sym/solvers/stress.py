"""Natural frequencies by Ritz's method on the stresses: for coefficients that vary along x in any way.

Unknown are, element by element, the natural forces of highest order (moment of a beam, tension of a string, moment and
shear of Timoshenko's beam) as Legendre series, and the displacements of one end. Displacements follow by integration
from that end, so the stresses need not be continuous, and a jump of a stiffness does not slow convergence.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from cra_sym.cached import cached_property

from .continuum import Continuum, Entries, compliance
from .stress_mesh import Grid, Mesh, rule

__all__ = ["Columns"]

Array = NDArray[np.float64]


class Columns:
    """Displacements and strains per unit of each unknown at the Gauss points of a mesh, and the matrices from them.

    The unknowns are the displacements of the origin, the lumped coordinates, the amplitudes of further stresses and the
    Legendre coefficients: degree by degree, in each degree element by element, in each element field by field.

    Parameters
    ----------
    problem : Continuum
    mesh : Mesh
    further : ndarray, shape (sets, functions, fields, Q, G), optional
        Further stress functions at the points of the mesh, in addition to the Legendre functions.
    """

    def __init__(self, problem: Continuum, mesh: Mesh, further: Array | None = None) -> None:
        self.problem, self.mesh, self.further = problem, mesh, further
        self.gauss = rule(mesh.points)
        self.grid = Grid.of(mesh, problem.edges, mesh.points)
        self.sets = len(problem.edges)
        self.rigid = problem.displacements + problem.lumped
        fields, elements = len(problem.orders), len(mesh.elements) - 1
        self.offset = self.rigid + (0 if further is None else further.shape[1])
        self.size = self.offset + fields * elements * (mesh.degree + 1)
        self.elastic = (mesh.degree + 1, elements, fields)
        rows = np.arange(self.sets)
        shape = self.grid.x.shape
        found = problem.coefficients(self.grid.x.reshape(len(self.grid.x), -1), rows)
        self.coefficient = {
            name: {pair: _on_points(entry, self.sets, shape[1:]) for pair, entry in part.items()}
            for name, part in found.items()
        }
        self._check_signs()

    def _check_signs(self) -> None:
        """Raise an error if a stiffness or a mass is negative somewhere."""
        for name, what in (("W", "a stiffness"), ("M", "a mass")):
            for (i, j), entry in self.coefficient[name].items():
                if i == j and (entry < 0.0).any():
                    x = np.broadcast_to(self.grid.x, (self.sets, *self.grid.x.shape[1:]))
                    bad = x[np.broadcast_to(entry < 0.0, x.shape)][0]
                    raise ValueError(f"values: {what} is negative at x = {bad:.6g}; it must be at least 0")

    # ------------------------------------------------------------------------------------------ the unknowns

    @cached_property
    def legendre(self) -> Array:
        """Legendre functions at the points, each in its element: (sets or 1, degree + 1, elements, Q, G)."""
        local = self.grid.local
        values = np.moveaxis(np.polynomial.legendre.legvander(local, self.mesh.degree), -1, 1)
        inside = self.mesh.owner == np.arange(self.elastic[1])[:, None]
        found: Array = values[:, :, None] * inside[:, :, None]
        return found

    @cached_property
    def compliance(self) -> Entries:
        """Inverse of the stiffnesses W at the points."""
        return compliance(self.coefficient["W"], self.elastic[2])

    @cached_property
    def _factor(self) -> dict[tuple[int, int], Array]:
        """Strain of field i for a unit Legendre function of field j: the compliance, or one where that is expanded."""
        strained = self.mesh.strained[self.mesh.owner][:, None]
        found = {}
        for i in range(self.elastic[2]):
            for j in range(self.elastic[2]):
                entry = self.compliance.get((min(i, j), max(i, j)))
                if strained.any():
                    entry = np.where(strained, float(i == j), 0.0 if entry is None else entry)
                if entry is not None:
                    found[i, j] = entry
        return found

    @cached_property
    def strain(self) -> list[Array]:
        """Strain of each field for each unknown, (sets or 1, size, Q, G)."""
        fields = self.elastic[2]
        found = []
        for i in range(fields):
            parts = {j: self._factor[i, j] for j in range(fields) if (i, j) in self._factor}
            found.append(self._expanded(parts))
        return found

    def _expanded(self, factors: Mapping[int, Array]) -> Array:
        """Return the sum of factors times the functions of each field, for each unknown, (sets or 1, size, Q, G)."""
        further = () if self.further is None else (self.sets,)
        sets = max(len(self.legendre), *further, *(len(part) for part in factors.values()))
        total = np.zeros((sets, self.size, *self.legendre.shape[-2:]))
        view = total[:, self.offset :].reshape(sets, *self.elastic, *total.shape[-2:])
        for j, part in factors.items():
            np.multiply(self.legendre, part[:, None, None], out=view[:, :, :, j])
            if self.further is not None:
                total[:, self.rigid : self.offset] += part[:, None] * self.further[:, :, j]
        return total

    @cached_property
    def displaced(self) -> tuple[list[Array], list[Array]]:
        """Displacements s = (q, w) of each unknown at the points, (sets or 1, size, Q, G), and at ends of pieces."""
        n, m = self.problem.displacements, self.problem.lumped
        one = np.zeros((1, self.size, 1, 1))
        values: list[Array | None] = [None] * (n + m)
        ends: list[Array | None] = [None] * (n + m)
        for number in range(n, n + m):
            unit = one.copy()
            unit[:, number] = 1.0
            values[number], ends[number] = unit, unit[..., 0]
        waiting = list(range(n))
        tops = self.problem.tops()
        while waiting:
            for place in reversed(waiting):
                rate = self._rate(place, tops, values)
                if rate is not None:
                    start = np.zeros(self.size)
                    start[place] = 1.0
                    values[place], ends[place] = self._integral(rate, start)
                    waiting.remove(place)
                    break
            else:
                raise ValueError("the strains do not give the displacements one after the other")
        return [v for v in values if v is not None], [e for e in ends if e is not None]

    def _rate(self, place: int, tops: list[int], values: list[Array | None]) -> Array | None:
        """Return the derivative of a displacement by x, or None if it depends on one not yet known."""
        if place not in tops:
            return values[place + 1]
        field = tops.index(place)
        coupled = {j: entry for (i, j), entry in self.coefficient["B"].items() if i == field}
        rate = self.strain[field]
        for j, entry in coupled.items():
            moved = values[j]
            if moved is None:
                return None
            rate = rate - entry[:, None] * moved
        return rate

    def _integral(self, rate: Array, start: Array) -> tuple[Array, Array]:
        """Return the integral from the origin at the points and at the ends of the pieces."""
        half = self.grid.half[:, None]
        rate = np.broadcast_to(rate, (*rate.shape[:2], *self.grid.x.shape[1:]))
        if len(half) > 1 and np.ptp(self.grid.half, axis=0).max() == 0.0:
            half = half[:1]
        local = (rate.reshape(-1, rate.shape[-1]) @ self.gauss.integral.T).reshape(rate.shape) * half[..., None]
        pieces = rate @ self.gauss.weights * half
        nothing = np.zeros((*pieces.shape[:2], 1))
        if self.problem.origin == 0:
            ends = np.concatenate([nothing, np.cumsum(pieces, axis=-1)], axis=-1)
        else:
            ends = np.concatenate([-np.cumsum(pieces[..., ::-1], axis=-1)[..., ::-1], nothing], axis=-1)
        ends = ends + start[:, None]
        local += ends[..., :-1, None]
        return local, ends

    @cached_property
    def weights(self) -> Array:
        """Weights of the quadrature, (sets, Q G)."""
        return (self.grid.half[..., None] * self.gauss.weights).reshape(len(self.grid.half), -1)

    # ------------------------------------------------------------------------------------------ the matrices

    @cached_property
    def elastic_stiffness(self) -> Array:
        """Integral of stress times strain, (sets, size, size)."""
        fields, found = self.elastic[2], np.zeros((self.sets, self.size, self.size))
        table = self.legendre.reshape(len(self.legendre), -1, *self.legendre.shape[-2:])
        size = self.size - self.offset
        if not fields:
            return found
        block = np.zeros((self.sets, size // fields, fields, size // fields, fields))
        for (i, j), entry in self._density.items():
            block[:, :, i, :, j] = self._product(entry, table, table)
        found[:, self.offset :, self.offset :] = block.reshape(self.sets, size, size)
        if self.further is not None:
            for j in range(fields):
                functions = self._expanded({j: np.ones((1, 1, 1))})
                for i in range(fields):
                    if (i, j) in self._density:
                        product = self._product(self._density[i, j], self.further[:, :, i], functions)
                        found[:, self.rigid : self.offset] += product
            cross = found[:, self.rigid : self.offset, self.offset :]
            found[:, self.offset :, self.rigid : self.offset] = cross.swapaxes(-1, -2)
        return found

    @cached_property
    def _density(self) -> dict[tuple[int, int], Array]:
        """Strain energy of a unit function of one field with that of another: compliance, or stiffness."""
        strained = self.mesh.strained[self.mesh.owner][:, None]
        found = {}
        for i in range(self.elastic[2]):
            for j in range(self.elastic[2]):
                pair = min(i, j), max(i, j)
                soft, stiff = self.compliance.get(pair), self.coefficient["W"].get(pair)
                if strained.any():
                    soft = np.where(strained, 0.0 if stiff is None else stiff, 0.0 if soft is None else soft)
                if soft is not None:
                    found[i, j] = soft
        return found

    @cached_property
    def potential(self) -> Array | None:
        """Stiffness from the potential energy of the displacements, (sets, size, size), or None if there is none."""
        if self.support is None or self.load is None:
            return self.load if self.support is None else self.support
        return np.asarray(self.support + self.load)

    @cached_property
    def support(self) -> Array | None:
        """The part of it that is positive semidefinite: of foundations, tensions; None if there is none."""
        entries = self._supports
        return self._quadratic(entries, np.zeros((self.sets, self.size, self.size))) if entries else None

    @cached_property
    def load(self) -> Array | None:
        """The other part, which may be negative: tensions below zero, coupling with strains; None if there is none."""
        cross, supports = self.coefficient["D"], self._supports
        direct = {pair: entry for pair, entry in self.coefficient["R"].items() if pair not in supports}
        if not cross and not direct:
            return None
        moved = self.displaced[0]
        total = np.zeros((self.sets, self.size, self.size))
        for (i, j), entry in cross.items():
            product = self._product(entry, self.strain[i], moved[j])
            total += product + product.swapaxes(-1, -2)
        return self._quadratic(direct, total)

    @cached_property
    def _supports(self) -> Entries:
        """The potential if it is semidefinite, else its squares of one displacement that are nowhere negative."""
        direct = self.coefficient["R"]
        if _semidefinite(direct):
            return direct
        coupled = {place for pair in direct for place in pair if pair[0] != pair[1]}
        return {(i, j): e for (i, j), e in direct.items() if i == j and i not in coupled and (e >= 0.0).all()}

    @cached_property
    def potential_size(self) -> Array | None:
        """The same with the magnitudes of all coefficients, or None where displacements or strains are coupled."""
        direct = self.coefficient["R"]
        if self.coefficient["D"] or any(i != j for i, j in direct):
            return None
        sizes = {pair: np.abs(entry) for pair, entry in direct.items()}
        return self._quadratic(sizes, np.zeros((self.sets, self.size, self.size)))

    @cached_property
    def mass(self) -> Array:
        """Mass matrix, (sets, size, size)."""
        total = self._quadratic(self.coefficient["M"], np.zeros((self.sets, self.size, self.size)))
        if np.any(self.problem.end_mass):
            total += self.ends.swapaxes(-1, -2) @ self.problem.end_mass @ self.ends
        for point, there in zip(self.problem.points, self.at_points, strict=True):
            total += there.swapaxes(-1, -2) @ point.mass @ there
        return total

    @property
    def moving(self) -> list[Array]:
        """What the pairs of a quadratic form are numbered by: the displacements of each unknown at the points."""
        return self.displaced[0]

    def _quadratic(self, entries: Entries, total: Array) -> Array:
        moved = self.moving
        for (i, j), entry in entries.items():
            product = self._product(entry, moved[i], moved[j])
            total += product if i == j else product + product.swapaxes(-1, -2)
        return total

    def mass_factor(self) -> Array:
        """Return F with F' F = M, from the points of the quadrature, (sets, points, size)."""
        entries, moved = self.coefficient["M"], [self.flat(side) for side in self.moving]
        places = sorted({k for pair in entries for k in pair})
        points = moved[0].shape[-1]
        density = np.zeros((self.sets, points, len(places), len(places)))
        for (i, j), entry in entries.items():
            a, b = places.index(i), places.index(j)
            density[..., a, b] = density[..., b, a] = entry.reshape(len(entry), -1) * self.weights
        size, frame = np.linalg.eigh(density)
        root = np.sqrt(np.maximum(size, 0.0))[..., None, :] * frame  # density = root root'
        parts = []
        for k in range(len(places)):
            parts.append(sum(root[:, :, a, k][:, None] * moved[place] for a, place in enumerate(places)))
        inside = [np.broadcast_to(part, (self.sets, self.size, points)).swapaxes(-1, -2) for part in parts]
        at = [_root(point.mass) @ there for point, there in zip(self.problem.points, self.at_points, strict=True)]
        return np.concatenate([*inside, _root(self.problem.end_mass) @ self.ends, *at], axis=1)

    def _product(self, entry: Array, first: Array, second: Array) -> Array:
        """Return the integrals of a coefficient times two functions of every pair of unknowns."""
        first, second = (self.flat(side) for side in (first, second))
        weighted = first * (entry.reshape(len(entry), -1) * self.weights)[:, None]
        product: Array
        if len(second) == 1:
            product = (weighted.reshape(-1, weighted.shape[-1]) @ second[0].T).reshape(*weighted.shape[:2], -1)
        else:
            product = weighted @ second.swapaxes(-1, -2)
        return product

    def flat(self, values: Array) -> Array:
        """Return values at the stations as one axis, shape (rows, columns, stations)."""
        shape = self.grid.x.shape[1:]
        return np.broadcast_to(values, (*values.shape[:2], *shape)).reshape(*values.shape[:2], -1)

    @cached_property
    def at_points(self) -> list[Array]:
        """(q, w) at each point, (sets, n + m, size)."""
        found = []
        for point in self.problem.points:
            index = int(np.searchsorted(self.mesh.pieces, point.node))
            rows = [end[..., index] if end.shape[-1] > 1 else end[..., 0] for end in self.displaced[1]]
            found.append(np.stack([np.broadcast_to(row, (self.sets, self.size)) for row in rows], axis=1))
        return found

    @cached_property
    def held(self) -> tuple[Array, Array]:
        """Direction of each spring in the unknowns, (sets, springs, size), and the stiffnesses, (sets, springs)."""
        rows, springs = [self.problem.directions @ self.ends], [self.problem.springs]
        for point, there in zip(self.problem.points, self.at_points, strict=True):
            rows.append(point.directions @ there)
            springs.append(point.springs)
        return np.concatenate(rows, axis=1), np.concatenate(springs, axis=1)

    @cached_property
    def ends(self) -> Array:
        """(q(left), w, q(right)) of every unknown, (sets, 2 n + m, size)."""
        n = self.problem.displacements
        at = self.displaced[1]
        rows = [*(at[k][..., 0] for k in range(n)), *(a[..., 0] for a in at[n:]), *(at[k][..., -1] for k in range(n))]
        return np.stack([np.broadcast_to(row, (self.sets, self.size)) for row in rows], axis=1)


def _on_points(entry: Array, sets: int, shape: tuple[int, ...]) -> Array:
    """Return a coefficient at the points, (sets or 1, Q, G)."""
    entry = np.asarray(entry, dtype=float)
    if entry.ndim < 2 or entry.shape[-1] == 1:
        entry = entry.reshape(-1, 1, 1) if entry.ndim else entry[None, None, None]
        return np.broadcast_to(entry, (len(entry), *shape))
    return entry.reshape(len(entry), *shape)


def _root(mass: Array) -> Array:
    """Return F with F' F = a mass matrix, (sets, size, size)."""
    size, frame = np.linalg.eigh(mass)
    root: Array = np.sqrt(np.maximum(size, 0.0))[..., None] * frame.swapaxes(-1, -2)
    return root


def _semidefinite(entries: Entries) -> bool:
    """Return whether a quadratic form with these entries is positive semidefinite up to rounding."""
    if all(i == j for i, j in entries):
        return all(bool((entry >= 0.0).all()) for entry in entries.values())
    size = 1 + max(max(pair) for pair in entries)
    form = np.zeros((*np.broadcast_shapes(*(entry.shape for entry in entries.values())), size, size))
    for (i, j), entry in entries.items():
        form[..., i, j] = form[..., j, i] = entry
    values = np.linalg.eigvalsh(form)
    return bool((values[..., 0] >= -size * np.finfo(float).eps * np.abs(values).max(axis=-1)).all())
