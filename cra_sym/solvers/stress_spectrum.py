"""Eigenvalues of a Ritz basis on the stresses, as those of its compliance operator: the largest are most accurate.

With K = L L' the compliance operator is ``L^-1 M L^-T``; its largest eigenvalues are 1 / omega^2. A spring k on ``b x``
changes K by ``k b b'``, which multiplies ``L^-1`` by a rank-one modification of the unit matrix; for an infinite spring
this is a projection, so no stiffness is too large. Rigid-body motions are removed by the same projection.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .graded import graded
from .stress import Columns

__all__ = ["BuckledError", "Spectrum", "bases", "spectrum"]

Array = NDArray[np.float64]
EPS = float(np.finfo(float).eps)
EXTRA = 5  # eigenvalues beyond those requested, to find a gap for the proof of completeness
_SPREAD = 1e-8
"""Ratio of compliances below which eigenvectors have lost half their digits and singular values are used instead."""


class BuckledError(ValueError):
    """Statically unstable structure; ``unstable`` is the number of unstable modes of each parameter set."""

    def __init__(self, unstable: NDArray[np.intp]) -> None:
        number, sets = int(unstable.max()), len(unstable)
        where = f", in {np.count_nonzero(unstable)} of {sets} parameter sets" if sets > 1 else ""
        plural = "s" if number > 1 else ""
        super().__init__(f"the structure has buckled: {number} unstable mode{plural} (omega^2 < 0){where}")
        self.unstable = unstable


@dataclass(frozen=True)
class Spectrum:
    """Lowest modes of a basis.

    Attributes
    ----------
    z : ndarray, shape (sets, modes)
        Squared natural frequencies; those of rigid-body motions are 0.
    vectors : ndarray, shape (sets, modes, size)
        Unknowns of each mode, mass-normalised.
    rounding : ndarray, shape (sets, modes)
        Estimated relative rounding of z.
    compliances : ndarray, shape (sets, more than modes)
        1 / z of elastic modes as far as computed, descending, of each set.
    load : ndarray, shape (sets,)
        Bound of the potential energy of displacements, by magnitude, over the whole energy of a motion; inf if unknown.
    """

    z: Array
    vectors: Array
    rounding: Array
    compliances: Array
    load: Array


def spectrum(columns: Columns, modes: int) -> Spectrum:
    """Return the lowest modes of a basis.

    Raises
    ------
    BuckledError
        If a parameter set is statically unstable.
    ValueError
        If there are fewer modes, or no motion has kinetic energy.
    """
    parts = [(problem.sets, problem.solved(modes)) for problem in _problems(columns)]
    if len(parts) == 1:
        return parts[0][1]
    shape = {name: getattr(parts[0][1], name).shape[1:] for name in Spectrum.__dataclass_fields__}
    joined = {name: np.zeros((columns.sets, *tail)) for name, tail in shape.items()}
    for sets, part in parts:
        for name, whole in joined.items():
            found = getattr(part, name)
            width = min(found.shape[1], whole.shape[1])
            whole[sets, :width] = found[:, :width]
    return Spectrum(**joined)


def bases(columns: Columns) -> Iterator[tuple[NDArray[np.intp], Array, Array]]:
    """Yield groups of sets with equally many rigid-body motions, and bases in which their stiffness is one.

    Yields
    ------
    sets : ndarray of int
    elastic : ndarray, shape (sets, size, size)
        Orthogonal rows of unit strain energy, without potential energy that may be negative. Rows of zeros replace
        motions that infinite springs hold.
    rigid : ndarray, shape (sets, motions, size)
        Rows without strain energy; orthonormal, and orthogonal to the elastic ones, with respect to the mass.
    """
    for problem in _problems(columns):
        yield problem.sets, problem.unloaded(), problem.still


def _problems(columns: Columns) -> Iterator[_Problem]:
    rows, springs = columns.held
    free = _rigid_motions(columns, rows, springs)
    sizes = np.array([len(motion) for motion in free])
    for size in np.unique(sizes):
        sets = np.nonzero(sizes == size)[0]
        still = np.stack([free[k] for k in sets])
        yield _Problem(columns, sets, rows[sets], springs[sets], still)


def _rigid_motions(columns: Columns, rows: Array, springs: Array) -> list[Array]:
    """Return, for each set, the motions without energy in the rigid unknowns, (motions, rigid)."""
    held, active = rows[..., : columns.rigid], springs != 0.0
    alike = bool((held == held[:1]).all() and (active == active[:1]).all())
    if alike:
        free = _not_held(held[0, active[0]])
        if not len(free) or columns.potential is None:
            return [free] * columns.sets
    found = []
    for k in range(columns.sets):
        mine = held[k, active[k]]
        if columns.potential is not None:
            # a motion without potential energy of its own that is coupled to strains is not at rest
            frame, size, _ = np.linalg.svd(columns.potential[k, : columns.rigid])
            largest = max(float(np.abs(columns.potential[k]).max()), np.finfo(float).tiny)
            mine = np.concatenate([mine, frame.T[size > 1e-12 * largest]])
        found.append(_not_held(mine))
    return found


def _not_held(directions: Array) -> Array:
    """Return an orthonormal basis of the null space of the directions, (motions, unknowns)."""
    length = np.sqrt((directions**2).sum(axis=1))
    directions = directions[length > 0.0] / length[length > 0.0, None]
    if not len(directions):
        return np.eye(directions.shape[1])
    _, size, adjoint = np.linalg.svd(directions)
    return adjoint[int((size > 1e-10).sum()) :]


class _Problem:
    """The eigenvalue problem of sets with equally many rigid-body motions."""

    def __init__(self, columns: Columns, sets: NDArray[np.intp], rows: Array, springs: Array, still: Array) -> None:
        self.columns, self.sets = columns, sets
        self.mass = columns.mass[sets]
        self.still = self._normalised(still)
        held = self.still @ self.mass
        self.rows = np.concatenate([rows, held], axis=1)
        self.springs = np.concatenate([springs, np.full(held.shape[:2], np.inf)], axis=1)
        self.softened = np.ones(len(sets))  # least remaining share of the stiffness of a motion under negative springs
        self.elastic = columns.elastic_stiffness[sets]
        self.support, self.load = (None if part is None else part[sets] for part in (columns.support, columns.load))

    def _normalised(self, still: Array) -> Array:
        """Return rigid-body motions as vectors of all unknowns, orthonormal with respect to the mass."""
        full = np.zeros((len(self.sets), still.shape[1], self.columns.size))
        full[..., : self.columns.rigid] = still
        if not still.shape[1]:
            return full
        mass = full @ self.mass @ full.swapaxes(-1, -2)
        size, frame = np.linalg.eigh(mass)
        if (size[:, -1] <= 0.0).any() or (size[:, 0] < -1e-6 * size[:, -1]).any():
            raise ValueError("values: a static deflection has negative kinetic energy; masses must be at least 0")
        if (size[:, 0] < 1e-14 * size[:, -1]).any():
            raise ValueError("values: a rigid-body motion has no kinetic energy")
        orthonormal: Array = (frame.swapaxes(-1, -2) / np.sqrt(size)[..., None]) @ full
        return orthonormal

    # ------------------------------------------------------------------------------------------ the factors

    def solved(self, modes: int) -> Spectrum:
        """Return the lowest modes, those of rigid-body motions first."""
        operator = self.unloaded()
        load = np.full(len(self.sets), 0.0 if self.columns.potential is None else 1.0)
        if self.load is not None:
            operator, loading = self._loaded_factor(operator, self.load)
            load = self._load(operator)
        else:
            loading = np.ones((len(self.sets), 1))
        loading = loading / self.softened[:, None]
        matrix = operator @ self.mass @ operator.swapaxes(-1, -2)
        number = modes - self.still.shape[1]
        wanted = min(max(number, 0) + EXTRA, matrix.shape[-1])
        values, vectors = np.linalg.eigh(matrix)
        values, vectors = values[:, ::-1][:, :wanted], vectors.swapaxes(-1, -2)[:, ::-1][:, :wanted]
        self._check_sign(values, number)
        if number > 0 and (values[:, min(number, wanted) - 1] < _SPREAD * values[:, 0]).any():
            values, vectors = self._singular(operator, wanted)
        self._check_number(values, number)
        unknowns = vectors @ operator  # x = L^-T u
        kinetic = self._kinetic(unknowns)
        return self._spectrum(unknowns, kinetic, values, loading, number, load)

    def unloaded(self) -> Array:
        """Return L^-1 of the structure with its springs, without its loads."""
        base, taken = self._base()
        inverse, scale = self._inverse_factor(base)
        projected = inverse @ (scale[:, :, None] * self.rows.swapaxes(-1, -2))  # L^-1 b, (sets, size, rows)
        factor = self._springs(projected, taken)
        operator: Array = inverse * scale[:, None, :]  # L^-1
        return operator if factor is None else factor.swapaxes(-1, -2) @ operator

    def _base(self) -> tuple[Array, Array]:
        """Return a positive stiffness with springs up to its own size, and the included part of each spring."""
        total = self.elastic.copy()
        if self.support is not None:
            total += self.support
        taken = np.zeros(self.springs.shape)
        order = np.argsort(np.where(self.springs < 0.0, np.inf, self.springs).min(axis=0, initial=np.inf))
        for k in order:
            row = self.rows[:, k]
            diagonal = np.einsum("sii->si", total)
            with np.errstate(divide="ignore", invalid="ignore"):
                ratio = np.where((diagonal > 0.0) & (row != 0.0), row**2 / diagonal, 0.0).max(axis=1)
                moderate = np.where(ratio > 0.0, 1.0 / ratio, np.inf)
            alone = np.where(np.isinf(self.springs[:, k]), 1.0, self.springs[:, k])
            part = np.clip(np.minimum(self.springs[:, k], np.where(np.isinf(moderate), alone, moderate)), 0.0, None)
            taken[:, k] = part
            total += part[:, None, None] * row[:, :, None] * row[:, None, :]
        return total, taken

    def _inverse_factor(self, base: Array) -> tuple[Array, Array]:
        """Return the inverse Cholesky factor of a stiffness scaled to a unit diagonal, and the scale."""
        diagonal = np.einsum("sii->si", base)
        scale = 1.0 / np.sqrt(np.where(diagonal > 0.0, diagonal, 1.0))
        scaled = base * scale[:, :, None] * scale[:, None, :]
        try:
            return np.linalg.inv(np.linalg.cholesky(scaled)), scale
        except np.linalg.LinAlgError:
            if self.load is not None and (unstable := self._unstable()).any():
                raise BuckledError(unstable) from None
            raise ValueError(
                "values: the stiffnesses lie too far apart for double precision along x; use ritz"
            ) from None

    def _unstable(self) -> NDArray[np.intp]:
        """Return the number of motions of negative potential energy of each set."""
        found, potential = np.zeros(len(self.sets), dtype=np.intp), self.columns.potential
        assert potential is not None
        for k, (row, springs) in enumerate(zip(self.sets, self.springs, strict=True)):
            rigid = np.isinf(springs)
            free = _not_held(self.rows[k, rigid])
            pulled = self.rows[k, ~rigid] @ free.T
            total = free @ (self.elastic[k] + potential[row]) @ free.T + (pulled.T * springs[~rigid]) @ pulled
            size = np.abs(np.diag(total))
            scale = 1.0 / np.sqrt(np.maximum(size, 1e-14 * size.max()))
            found[k] = (np.linalg.eigvalsh(scale[:, None] * total * scale) < -1e-12).sum()
        return found

    def _springs(self, projected: Array, taken: Array) -> Array | None:
        """Return S with S' (I + sum (k - taken) n n') S = I, one spring after the other, or None if it is I."""
        left = np.where(np.isinf(self.springs), np.inf, self.springs - taken)
        if not (np.abs(left) > 0.0).any():
            return None
        size = projected.shape[1]
        factor = np.broadcast_to(np.eye(size), (len(left), size, size)).copy()
        # infinite springs come before negative ones
        order = np.argsort(np.where(left < 0.0, 2, np.isinf(left)), axis=1, kind="stable")
        left, projected = (
            np.take_along_axis(left, order, axis=1),
            np.take_along_axis(projected, order[:, None], axis=2),
        )
        for k in range(left.shape[1]):
            row = (projected[:, :, k][:, None, :] @ factor)[:, 0]
            square = (row**2).sum(axis=1)
            with np.errstate(invalid="ignore", divide="ignore", over="ignore"):
                growth = 1.0 + left[:, k] * square
                if (growth < -1e-12).any():
                    raise BuckledError((growth < 0.0).astype(int))
                self.softened = np.minimum(self.softened, np.maximum(growth, EPS))
                shrink = 1.0 / np.sqrt(np.maximum(growth, 1e-300))
                pull = np.where(square > 0.0, (1.0 - shrink) / square, 0.0)
            held = np.isinf(growth)
            pull[held] = 0.0
            factor -= pull[:, None, None] * (factor @ row[:, :, None]) * row[:, None, :]
            if held.any():
                factor[held] = _without(factor[held], row[held])
        return factor

    @staticmethod
    def _loaded_factor(operator: Array, load: Array) -> tuple[Array, Array]:
        """Return the operator of the loaded structure, and the largest ratio of unloaded to loaded stiffness."""
        matrix = operator @ load @ operator.swapaxes(-1, -2)
        matrix = matrix + np.eye(matrix.shape[-1])
        values, frame = np.linalg.eigh(matrix)
        unstable = (values < -64 * EPS).sum(axis=1)
        if unstable.any():
            raise BuckledError(unstable)
        if (values < 64 * EPS).any():
            raise ValueError(
                "values: the load takes the whole stiffness of a motion, to rounding: a natural frequency is 0, or too "
                "small for doubles; change the load by more than 1e-13 of it"
            )
        loaded = (frame / np.sqrt(values)[:, None, :]) @ frame.swapaxes(-1, -2)
        return loaded @ operator, 1.0 / values[:, :1]

    def _load(self, operator: Array) -> Array:
        """Return the sum, not less than the largest, of the magnitudes of the potential energy over the whole one."""
        size = self.columns.potential_size
        if size is None:
            return np.full(len(self.sets), np.inf)
        total: Array = ((operator @ size[self.sets]) * operator).sum(axis=(-2, -1))
        return total

    # ------------------------------------------------------------------------------------------ the modes

    @staticmethod
    def _check_sign(values: Array, number: int) -> None:
        if (values[:, 0] <= 0.0).any() and number > 0:
            raise ValueError("values: no motion of the structure has kinetic energy")
        if (values < -1e-9 * np.abs(values).max(axis=1, keepdims=True)).any():
            raise ValueError("values: a static deflection has negative kinetic energy; masses must be at least 0")

    def _check_number(self, values: Array, number: int) -> None:
        there = (values > 0.0).sum(axis=1)
        if number > 0 and (there < number).any():
            rigid = self.still.shape[1]
            raise ValueError(
                f"modes = {number + rigid}: the model has only {int(there.min()) + rigid} natural frequencies"
            )

    def _singular(self, operator: Array, wanted: int) -> tuple[Array, Array]:
        """Return the largest compliances and their vectors from singular values of a factor of the mass."""
        size, adjoint = graded(self.columns.mass_factor()[self.sets] @ operator.swapaxes(-1, -2))
        return size[:, :wanted] ** 2, adjoint[:, :wanted]

    def _kinetic(self, unknowns: Array) -> Array:
        """Return x' M x from the displacements, so that rounding of large eigenvalues does not spoil small ones."""
        columns = self.columns
        moved = {}

        def shape(place: int) -> Array:
            if place not in moved:
                values = columns.flat(columns.moving[place])
                values = values[self.sets] if len(values) > 1 else values
                moved[place] = unknowns @ values
            return moved[place]

        total = np.zeros(unknowns.shape[:2])
        for (i, j), entry in columns.coefficient["M"].items():
            weight = entry.reshape(len(entry), -1) * columns.weights
            weight = weight[self.sets] if len(weight) > 1 else weight
            total += (1 if i == j else 2) * ((shape(i) * shape(j)) @ weight[..., None])[..., 0]
        if np.any(columns.problem.end_mass):
            ends = unknowns @ columns.ends[self.sets].swapaxes(-1, -2)
            total += ((ends @ columns.problem.end_mass[self.sets]) * ends).sum(axis=-1)
        for point, there in zip(columns.problem.points, columns.at_points, strict=True):
            moved_there = unknowns @ there[self.sets].swapaxes(-1, -2)
            total += ((moved_there @ point.mass[self.sets]) * moved_there).sum(axis=-1)
        return total

    def _spectrum(
        self, unknowns: Array, kinetic: Array, values: Array, loading: Array, number: int, load: Array
    ) -> Spectrum:
        with np.errstate(divide="ignore", invalid="ignore"):
            compliances = np.where(kinetic > 0.0, kinetic, values)
            order = np.argsort(-compliances, axis=1, kind="stable")
            compliances = np.take_along_axis(compliances, order, axis=1)
            z = 1.0 / compliances[:, :number] if number > 0 else np.zeros((len(self.sets), 0))
        unknowns = np.take_along_axis(unknowns, order[..., None], axis=1)[:, : max(number, 0)]
        rounding = 8.0 * EPS * np.broadcast_to(loading, z.shape)
        vectors = unknowns * np.sqrt(z)[..., None]
        rigid = self.still.shape[1]
        if rigid:
            keep = max(number, 0) + min(rigid, number + rigid)
            pad = ((0, 0), (rigid, 0))
            z, rounding = np.pad(z, pad)[:, :keep], np.pad(rounding, pad)[:, :keep]
            vectors = np.concatenate([self.still, vectors], axis=1)[:, :keep]
        return Spectrum(z, vectors, rounding, compliances, load)


def _without(factor: Array, row: Array) -> Array:
    """Return an orthogonal transformation of the columns of a factor, one of which is zero: without ``row``.

    A reflection turns the row into its largest entry, so that no rounding of a soft motion takes the place of the one
    that is held.
    """
    sets, place = np.arange(len(row)), np.abs(row).argmax(axis=1)
    normal = row / np.abs(row).max(axis=1, keepdims=True)
    normal[sets, place] += np.sign(normal[sets, place]) * np.sqrt((normal**2).sum(axis=1))
    scaled = 2.0 / (normal**2).sum(axis=1)
    factor = factor - scaled[:, None, None] * (factor @ normal[:, :, None]) * normal[:, None, :]
    factor[sets, :, place] = 0.0
    return factor
