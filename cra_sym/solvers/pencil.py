"""Any linear motion on the stress basis: dampers, gyroscopic forces and forces that follow the motion included.

In a basis of unit strain energy the problem of motions ``exp(s t)`` is ``(K + s C + s^2 S^2) d = 0``, with K the unit
matrix plus the stiffness of further forces, and S the square root of the mass. With
``e = s S d``, and ``g = c b' d`` for a strong damper c on ``b' d``, it is a linear pencil ``(A + s B) w = 0`` of
bounded matrices, and the largest ``1 / (s - shift)`` belong to the lowest eigenvalues.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from typing import Self

import numpy as np
from numpy.typing import NDArray

from cra_sym.cached import cached_property

from .continuum import Continuum
from .graded import graded
from .stress import Columns
from .stress_mesh import Mesh
from .stress_spectrum import bases

__all__ = ["Forces", "GeneralContinuum", "Reduced", "reduced"]

Array = NDArray[np.float64]
Complex = NDArray[np.complex128]
Index = NDArray[np.intp]
SHIFT = 0.7318
"""Shift, in units of the rate (a natural frequency without dampers and loads); real and positive, far from the
eigenvalues of practical problems."""
_SLOW = 1e-2
"""Eigenvalues that are taken without a shift, in the same unit."""
_SLOWEST = 1e-8
"""Eigenvalues that are known to half their digits with a shift, in the same unit."""
_STRONG = 1e3
"""Dampers beyond this constant, in the same unit, have their force as a further unknown."""
_DETAILED, _SMOOTH, _FINE, _LEVELS = 2, 16, 1e-8, 2
"""Pieces in an element beyond which stresses of finer detail are added, how many smooth ones they balance, their least
share beside Legendre functions, and how many times."""
_HEAVY, _SPREAD = 4, 1e-3
"""Ratio of the fifth root of a mass to the first (soft springs, heavy ends) below which eigenvalues of the mass have
lost digits and singular values are used instead."""
_NEVER = 1e-13
"""Values of 1 / (s - shift) below this share of the largest belong to infinite eigenvalues, without a motion."""


@dataclass(frozen=True, kw_only=True)
class GeneralContinuum(Continuum):
    """A continuum with forces of any kind besides its energies, which must be positive.

    Its coefficients have two more parts, of pairs of jets (highest derivatives h of the fields, then s): 'N' and 'C',
    the forces on the first by the second and by its velocity. The mass 'M' is that of (s, h): h may have inertia.

    Attributes
    ----------
    end_forces : ndarray, shape (2, rows, 2 n + m, 2 n + m)
        Further forces on ends and lumped coordinates per unit of their displacements and velocities.
    point_forces : tuple of ndarray, shape (2, rows, n + m, n + m)
        The same at each of the points.
    dampers : tuple of ndarray, shape (rows, dampers, 2 n + m), (rows, dampers)
        Directions at the ends and damping constants, in addition to the end forces.
    damped : bool
        Whether any forces depend on velocities.
    """

    end_forces: Array
    point_forces: tuple[Array, ...]
    dampers: tuple[Array, Array]
    damped: bool

    def take(self, rows: Index) -> Self:
        """Return the problem of some of the parameter sets."""
        return replace(
            super().take(rows),
            end_forces=self.end_forces[:, rows],
            point_forces=tuple(forces[:, rows] for forces in self.point_forces),
            dampers=(self.dampers[0][rows], self.dampers[1][rows]),
        )

    def acts_at(self, end: int, place: int) -> NDArray[np.bool_]:
        """Return in which rows anything acts on a displacement of the left (0) or right (1) end."""
        k = end * (self.displacements + self.lumped) + place
        pull, constants = self.dampers
        damped = ((pull[..., k] != 0.0) & (constants != 0.0)).any(axis=1)
        moved = (self.end_forces[:, :, k] != 0.0).any(axis=(0, 2)) | (self.end_forces[..., k] != 0.0).any(axis=(0, 2))
        return np.asarray(super().acts_at(end, place) | damped | moved)

    def sample(self, strained: bool) -> Callable[[Array], Array]:
        """Return all coefficients as one array."""
        energies, rows = super().sample(strained), np.arange(len(self.edges))

        def values(x: Array) -> Array:
            found = self.coefficients(x, rows)
            forces = [np.broadcast_to(entry, x.shape) for name in "NC" for entry in found[name].values()]
            return np.concatenate([energies(x), np.array(forces).reshape(-1, *x.shape)])

        return values

    def loaded(self) -> GeneralContinuum:
        """Return the problem with the potential energy of displacements as forces, since it need not be positive."""
        fields = len(self.orders)

        def coefficients(x: Array, rows: Index) -> dict[str, dict[tuple[int, int], Array]]:
            found = {name: dict(part) for name, part in self.coefficients(x, rows).items()}
            for (i, j), entry in found.pop("R").items():
                pair = i + fields, j + fields
                found["N"][pair] = found["N"].get(pair, 0.0) + entry
            return {**found, "R": {}}

        return replace(self, coefficients=coefficients)  # type: ignore[arg-type]


class Forces(Columns):
    """Columns with the matrices of forces of any kind."""

    problem: GeneralContinuum

    @cached_property
    def jets(self) -> list[Array]:
        """Highest derivatives of the fields, then displacements, of each unknown at the points."""
        moved, tops = self.displaced[0], self.problem.tops()
        highest = [self._rate(place, tops, [*moved]) for place in tops]
        return [h for h in highest if h is not None] + moved

    @property
    def moving(self) -> list[Array]:
        """Displacements, then highest derivatives of the fields, of each unknown at the points."""
        fields = len(self.problem.orders)
        return self.jets[fields:] + self.jets[:fields]

    @property
    def resists_strains(self) -> bool:
        """Whether there are dampers of the highest derivatives."""
        return any(min(pair) < len(self.problem.orders) for pair in self.coefficient["C"])

    def detail(self) -> Array | None:
        """Return stresses of fine detail, as functions (sets, number, fields, Q, G), or None if there are none.

        Coefficients of finer detail than the elements give stresses of that detail: those that inertia, dampers and
        further forces of the smoothest stresses demand, beside Legendre functions.
        """
        degrees, elements, fields = self.elastic
        first = min(degrees, max(2, _SMOOTH // elements)) * elements * fields
        smooth = np.r_[: self.offset + first]
        jets, n = [np.broadcast_to(jet, (*jet.shape[:2], *self.grid.x.shape[1:])) for jet in self.jets], fields
        shift = self.problem.displacements + self.problem.lumped
        found = []
        for name in "MCN":
            pairs: dict[int, Array] = {}
            for (i, j), entry in self.coefficient[name].items():
                both = [(i, j), (j, i)] if name == "M" and i != j else [(i, j)]
                for row, column in both:
                    if name == "M":  # numbered with the displacements first
                        row, column = ((k + n if k < shift else k - shift) for k in (row, column))
                    pairs[row] = pairs.get(row, np.zeros(())) + entry[:, None] * jets[column][:, smooth]
            found += self._balanced(pairs, len(smooth))
        if not found:
            return None
        whole = np.concatenate(found, axis=1)
        weights = np.broadcast_to(self.weights.reshape(-1, *whole.shape[-2:]), (self.sets, *whole.shape[-2:]))
        table = np.broadcast_to(self.legendre, (self.sets, *self.legendre.shape[1:]))
        size = np.einsum("sqg,sdeqg->sde", weights, table**2)
        share = np.einsum("sfiqg,sdeqg->sfide", whole * weights[:, None, None], table, optimize=True)
        rest = whole - np.einsum("sfide,sdeqg->sfiqg", share / size[:, None, None], table, optimize=True)
        root = np.sqrt(weights)[:, None, None]
        shape = (self.sets, whole.shape[1], -1)
        scale = np.sqrt(((root * whole) ** 2).reshape(shape).sum(axis=-1))[..., None]
        scale = np.where(scale > 0.0, scale, 1.0)
        _, strength, kinds = np.linalg.svd((root * rest).reshape(shape) / scale, full_matrices=False)
        number = int((strength > _FINE).sum(axis=1).max(initial=0))
        return kinds[:, :number].reshape(self.sets, number, *whole.shape[2:]) / root if number else None

    def _balanced(self, forces: dict[int, Array], number: int) -> list[Array]:
        """Return the stresses that balance forces on jets, given by the number of the jet, (sets, f, fields, Q, G)."""
        if not forces:
            return []
        shape = (self.sets, number, *self.grid.x.shape[1:])
        place, found = len(self.problem.orders), []
        for field, order in enumerate(self.problem.orders):
            stress = np.zeros(shape)
            for _ in range(order):
                stress = self._integral(forces.get(place, 0.0) - stress, np.zeros(number))[0]
                place += 1
            found.append(np.broadcast_to(stress - forces.get(field, 0.0), shape))
        return [np.stack(found, axis=2)]

    def forces(self, power: int) -> Array:
        """Return the matrix of the forces of displacements (0) or velocities (1), (sets, size, size)."""
        total = np.zeros((self.sets, self.size, self.size))
        for (i, j), entry in self.coefficient["NC"[power]].items():
            total += self._product(entry, self.jets[i], self.jets[j])
        total += self.ends.swapaxes(-1, -2) @ self.problem.end_forces[power] @ self.ends
        for matrix, there in zip(self.problem.point_forces, self.at_points, strict=True):
            total += there.swapaxes(-1, -2) @ matrix[power] @ there
        return total


@dataclass(frozen=True)
class Reduced:
    """The pencil of sets with equally many rigid-body motions; time is in units of ``1 / rate``.

    Attributes
    ----------
    sets : ndarray of int
        Positions of the sets in the problem.
    columns : Forces
    motions : ndarray, shape (sets, k, size)
        Unknowns of the columns for a unit of each coordinate d.
    root_mass : ndarray, shape (sets, k)
        Diagonal of S.
    stiffness, damping : ndarray, shape (sets, k, k)
        K and C, strong dampers left out.
    directions, constants : ndarray, shape (sets, k, g), (sets, g)
        Strong dampers.
    rate : ndarray, shape (sets,)
        First natural frequency without loads and dampers, rad/s; beside soft springs or heavy ends the fifth.
    rigid : int
        How many motions, the last ones, have no strain energy.
    damped : bool
    """

    sets: Index
    columns: Forces
    motions: Array
    root_mass: Array
    stiffness: Array
    damping: Array
    directions: Array
    constants: Array
    rate: Array
    rigid: int
    damped: bool

    def pencil(self) -> tuple[Array, Array]:
        """Return A and B with ``(A + s B) (d, e, g) = 0``, s in units of the rate."""
        sets, k = self.root_mass.shape
        size = 2 * k + self.constants.shape[1]
        first, second = np.zeros((sets, size, size)), np.zeros((sets, size, size))
        d, e, g = np.arange(k), np.arange(k, 2 * k), np.arange(2 * k, size)
        first[:, :k, :k], second[:, :k, :k] = self.stiffness, self.damping
        first[:, e, e] = -1.0
        second[:, d, e] = second[:, e, d] = self.root_mass
        first[:, g, g] = -1.0 / np.maximum(self.constants, 1.0)
        pull = self.directions * np.sqrt(np.minimum(self.constants, 1.0))[:, None]
        first[:, 2 * k :, :k], second[:, :k, 2 * k :] = pull.swapaxes(-1, -2), pull
        return first, second

    def eigenvalues(self) -> Complex:
        """Return all eigenvalues s, rad/s, by ascending modulus, padded with nan, shape (sets, number).

        A free rigid-body motion counts as one zero.
        """
        found = self._of_velocities() if self.damped else self._of_squares()
        if self.rigid:
            _set_rigid_zeros(self, found)
        found = np.take_along_axis(found, np.argsort(np.abs(found), axis=1, kind="stable"), axis=1)
        return found * self.rate[:, None]

    def frequency(self, mode: int) -> Array:
        """Return a natural frequency without loads and dampers, rad/s, shape (sets,); the last if there are fewer."""
        elastic = self.root_mass[:, : self.root_mass.shape[1] - self.rigid]
        place = min(max(mode - self.rigid, 1), elastic.shape[1]) - 1
        return self.rate / np.maximum(elastic[:, place], 1e-100)

    def lossless(self) -> NDArray[np.bool_]:
        """Return for which sets the eigenvalues come in pairs s and -s, since no force dissipates or supplies energy.

        Either no force depends on velocities, or those that do are gyroscopic and all others have a potential.
        """
        if not self.damped:
            return np.ones(len(self.sets), dtype=bool)
        own = np.abs(self.damping + self.damping.swapaxes(-1, -2)).max(axis=(1, 2))
        follower = np.abs(self.stiffness - self.stiffness.swapaxes(-1, -2)).max(axis=(1, 2))
        gyroscopic = own <= 1e-10 * np.abs(self.damping).max(axis=(1, 2))
        potential = follower <= 1e-10 * np.abs(self.stiffness).max(axis=(1, 2))
        unused = (np.abs(self.damping).max(axis=(1, 2)) == 0.0) & ~self.constants.any(axis=1)
        return np.asarray(unused | (gyroscopic & potential & ~self.constants.any(axis=1)))

    def _of_squares(self) -> Complex:
        """Return both s of every s^2, where forces depend on displacements only."""
        s = self.root_mass
        matrix = self.stiffness.copy()
        diagonal = np.arange(s.shape[1])
        matrix[:, diagonal, diagonal] += SHIFT * s**2
        with np.errstate(divide="ignore", invalid="ignore"):
            mu = np.linalg.eigvals(s[:, :, None] * np.linalg.solve(matrix, s[:, :, None] * np.eye(s.shape[1])))
            squares = SHIFT - 1.0 / np.where(_is_graded(mu), np.nan, mu)  # s^2
            root = np.sqrt(squares.astype(complex))
        return np.concatenate([root, -root], axis=1)

    def _of_velocities(self) -> Complex:
        first, second = self.pencil()
        unit = np.ones(first.shape[:2])  # of mass, instead of stiffness, for motions that are softer than the rate
        unit[:, : self.root_mass.shape[1]] = 1.0 / np.maximum(self.root_mass, 1.0)
        scale = unit[:, :, None] * unit[:, None, :]
        found = _inverted(scale * first, scale * second, SHIFT)
        slow = np.abs(found) < _SLOW
        softest = 1.0 / self.root_mass.max(axis=1, initial=1.0)  # natural frequency, beside rigid motions at rest
        if self.rigid:
            replaced = (softest < _SLOW).any()
        else:
            replaced = slow.any() and not (np.linalg.cond(self.stiffness) > 1e10).any()
        if replaced:
            # exact relative to the slowest one, those of the other shift absolutely
            other = _inverted(first, second, SHIFT * softest[:, None, None] if self.rigid else 0.0)
            order = np.argsort(np.abs(found), axis=1, kind="stable")
            found = np.take_along_axis(found, order, axis=1)
            other = np.take_along_axis(other, np.argsort(np.abs(other), axis=1, kind="stable"), axis=1)
            slowest = softest[:, None]
            if not self.rigid:
                slowest = np.nanmin(np.where(other == 0.0, np.inf, np.abs(other)), axis=1, keepdims=True)
            found = np.where(np.abs(found) < np.clip(np.sqrt(slowest), _SLOWEST, _SLOW), other, found)
        return found


def _inverted(first: Array, second: Array, shift: Array | float) -> Complex:
    with np.errstate(divide="ignore", invalid="ignore"):
        mu = np.linalg.eigvals(np.linalg.solve(first + shift * second, second))
        return np.asarray(np.reshape(shift, (-1, 1)) - 1.0 / np.where(_is_graded(mu), np.nan, mu), dtype=complex)


def _is_graded(mu: NDArray[np.generic]) -> NDArray[np.bool_]:
    size = np.abs(mu)
    small: NDArray[np.bool_] = size <= _NEVER * size.max(axis=1, keepdims=True)
    return small


def _set_rigid_zeros(problem: Reduced, found: Complex) -> None:
    """Replace, in place, the eigenvalues of each motion without stiffness by one zero."""
    left, size, right = np.linalg.svd(problem.stiffness)
    for row in range(len(found)):
        still = size[row] <= 1e-11 * size[row].max(initial=1.0)
        if not still.any():
            continue
        test, move = left[row][:, still].T, right[row][still].T
        matrix = problem.damping[row] + (problem.directions[row] * problem.constants[row]) @ problem.directions[row].T
        matrix = matrix if problem.damped else np.diag(problem.root_mass[row] ** 2)
        number = int(still.sum())
        free = number - int(np.linalg.matrix_rank(test @ matrix @ move, tol=1e-9 * np.abs(matrix).max(initial=1e-300)))
        drop = number + free if problem.damped else 2 * (number + free)
        place = np.argsort(np.abs(found[row]), kind="stable")[:drop]
        found[row, place] = np.nan
        found[row, place[:number]] = 0.0


def reduced(problem: GeneralContinuum, mesh: Mesh) -> Iterator[Reduced]:
    """Yield the pencils of all rows on a mesh."""
    columns = Forces(problem, mesh)
    if any(bool((entry < 0.0).any()) for entry in columns.coefficient["R"].values()):
        columns = Forces(problem.loaded(), mesh)
    if len(mesh.pieces) - 1 > _DETAILED * (len(mesh.elements) - 1) and not mesh.strained.any():
        for _ in range(_LEVELS):
            columns = Forces(columns.problem, mesh, columns.detail())
    forces = columns.forces(0)
    drag = columns.forces(1) if problem.damped else None
    for sets, elastic, rigid in bases(columns):
        square, frame = np.linalg.eigh(elastic @ columns.mass[sets] @ elastic.swapaxes(-1, -2))
        size, turn = np.sqrt(np.maximum(square, 0.0))[:, ::-1], frame.swapaxes(-1, -2)[:, ::-1]
        fifth = size[:, min(_HEAVY, size.shape[1] - 1)]
        light = fifth < _SPREAD * size[:, 0]
        if light.any():
            size, turn = graded(columns.mass_factor()[sets] @ elastic.swapaxes(-1, -2))
        rate = 1.0 / np.where(light & (fifth > 0.0), fifth, np.where(size[:, 0] > 0.0, size[:, 0], 1.0))
        motions = np.concatenate([turn @ elastic, rigid / rate[:, None, None]], axis=1)
        root = np.concatenate([size * rate[:, None], np.ones(rigid.shape[:2])], axis=1)
        back = motions.swapaxes(-1, -2)
        stiffness = motions @ forces[sets] @ back
        own = np.arange(elastic.shape[1])
        stiffness[:, own, own] += 1.0
        damping = np.zeros_like(stiffness) if drag is None else rate[:, None, None] * (motions @ drag[sets] @ back)
        pull = motions @ columns.ends[sets].swapaxes(-1, -2) @ problem.dampers[0][sets].swapaxes(-1, -2)
        constants = rate[:, None] * problem.dampers[1][sets]
        strong = (constants * (pull**2).sum(axis=1) > _STRONG).any(axis=0)
        weak = pull[:, :, ~strong]
        damping += (weak * constants[:, None, ~strong]) @ weak.swapaxes(-1, -2)
        pull, constants = pull[:, :, strong], constants[:, strong]
        length = np.sqrt((pull**2).sum(axis=1))
        length = np.where(length > 0.0, length, 1.0)
        yield Reduced(
            sets, columns, motions, root, stiffness, damping, pull / length[:, None], constants * length**2, rate,
            rigid.shape[1], problem.damped,
        )  # fmt: skip
