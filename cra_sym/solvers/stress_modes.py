"""Modes of a Ritz basis on the stresses along x, and their residual in the equations of equilibrium."""

from __future__ import annotations

from math import factorial

import numpy as np
from numpy.typing import NDArray

from cra_sym.cached import cached_property

from .stress import Columns
from .stress_mesh import rule

__all__ = ["ModeFields"]

Array = NDArray[np.float64]


class ModeFields:
    """Displacements and natural forces of modes at the Gauss points of every piece.

    The other natural forces, and the residual of the unknown stresses, follow from equilibrium: each is the integral of
    inertia and potential forces. Constants of integration are fitted to the unknown stresses.

    Parameters
    ----------
    columns : Columns
    z : ndarray, shape (sets, modes)
    vectors : ndarray, shape (sets, modes, size)
    """

    def __init__(self, columns: Columns, z: Array, vectors: Array) -> None:
        self.columns, self.z, self.vectors = columns, z, vectors
        self.problem = columns.problem

    def take(self, sets: NDArray[np.intp]) -> ModeFields:
        """Return the modes of some of the sets."""
        if len(sets) == len(self.z):
            return self
        further = self.columns.further
        columns = Columns(self.problem.take(sets), self.columns.mesh, None if further is None else further[sets])
        return ModeFields(columns, self.z[sets], self.vectors[sets])

    def _of(self, values: Array) -> Array:
        """Return a quantity of the modes, given per unit of each unknown at the points, (sets, modes, Q, G)."""
        shape = self.columns.grid.x.shape[1:]
        return (self.vectors @ self.columns.flat(values)).reshape(*self.z.shape, *shape)

    @cached_property
    def displaced(self) -> list[Array]:
        """Displacements s = (q, w), each (sets, modes, Q, G)."""
        return [self._of(values) for values in self.columns.displaced[0]]

    @cached_property
    def ends(self) -> Array:
        """(q(left), w, q(right)), (sets, modes, 2 n + m)."""
        found = self.vectors @ self.columns.ends.swapaxes(-1, -2)
        held = np.isinf(self.problem.springs).any(axis=0)
        for row in np.moveaxis(self.problem.directions[:, held], 1, 0):  # held displacements are exactly zero
            found = found - (found @ row[..., None]) * (row / (row**2).sum(axis=-1, keepdims=True))[:, None]
        return found

    def nodes(self, place: int) -> Array:
        """Return a displacement at the ends of the pieces, (sets, modes, Q + 1)."""
        return self.vectors @ np.broadcast_to(
            self.columns.displaced[1][place], (len(self.vectors), *self.columns.displaced[1][place].shape[1:])
        )

    @cached_property
    def strain(self) -> list[Array]:
        """Strain of each field."""
        return [self._of(values) for values in self.columns.strain]

    @cached_property
    def stress(self) -> list[Array]:
        """Natural force of highest order of each field, P = W e + D s, from the unknowns."""
        found = []
        for i in range(len(self.problem.orders)):
            total = sum(self._entry("W", i, j) * e for j, e in enumerate(self.strain) if self._has("W", i, j))
            for j, s in enumerate(self.displaced):
                if (i, j) in self.columns.coefficient["D"]:
                    total = total + self._entry("D", i, j, False) * s
            found.append(np.asarray(total))
        return found

    def _has(self, name: str, i: int, j: int) -> bool:
        return (min(i, j), max(i, j)) in self.columns.coefficient[name]

    def _entry(self, name: str, i: int, j: int, symmetric: bool = True) -> Array:
        pair = (min(i, j), max(i, j)) if symmetric else (i, j)
        return self.columns.coefficient[name][pair][:, None]

    def _force(self, place: int) -> Array:
        """Return the derivative by x of the natural force of a displacement, without the next lower force."""
        total = np.zeros((*self.z.shape, *self.columns.grid.x.shape[1:]))
        z = self.z[..., None, None]
        for j, s in enumerate(self.displaced):
            if self._has("R", place, j):
                total += self._entry("R", place, j) * s
            if self._has("M", place, j):
                total -= z * (self._entry("M", place, j) * s)
        for i, (stress, strain) in enumerate(zip(self.stress, self.strain, strict=True)):
            if (i, place) in self.columns.coefficient["B"]:
                total += self._entry("B", i, place, False) * stress
            if (i, place) in self.columns.coefficient["D"]:
                total += self._entry("D", i, place, False) * strain
        return total

    # ------------------------------------------------------------------------------------------ equilibrium

    @cached_property
    def _equilibrium_forces(self) -> tuple[list[Array], list[Array], list[Array]]:
        """Natural forces from equilibrium at the points and at the ends of pieces, and the residual of each field."""
        forces: list[Array] = []
        ends: list[Array] = []
        residuals = []
        place = 0
        for field, order in enumerate(self.problem.orders):
            chain: list[tuple[Array, Array]] = []
            for k in range(order):
                rate = self._force(place + k)
                chain.append(self._integral(rate - chain[-1][0] if chain else rate))
            stress = self.stress[field]
            free = self._self_equilibrated_forces(order)
            shift = self._fit(stress - chain[-1][0], [levels[-1][0] for levels in free], self._softness(field))
            for k, (values, value_ends) in enumerate(chain):
                for part, levels in zip(np.moveaxis(shift, -1, 0), free, strict=True):
                    values = values + part[..., None, None] * levels[k][0][:, None]
                    value_ends = value_ends + part[..., None] * levels[k][1][:, None]
                forces.append(values)
                ends.append(value_ends)
            residuals.append(forces[-1] - stress)
            place += order
        return forces, ends, residuals

    def _self_equilibrated_forces(self, order: int) -> list[list[tuple[Array, Array]]]:
        """Return the self-equilibrated forces of a field, at the points and at the ends of pieces, lowest order first.

        With zero below some order and a constant in it, the next ones are linear in x, quadratic and so on: a constant
        moment, or a constant shear force with a linear moment. They also jump at each interior place.
        """
        grid = self.columns.grid
        points = sorted({point.node for point in self.problem.points})
        kinks = grid.ends[:, np.searchsorted(self.columns.mesh.pieces, points)]
        scale = 0.5 * (grid.ends[:, -1] - grid.ends[:, 0])
        starts = [(0.5 * (grid.ends[:, 0] + grid.ends[:, -1]), np.full(len(scale), -np.inf))]
        starts += [(kink, kink) for kink in kinks.T]

        def level(first: int, k: int, centre: Array, start: Array, x: Array) -> Array:
            origin, begin, size = (part.reshape(-1, *[1] * (x.ndim - 1)) for part in (centre, start, scale))
            if k < first:
                return np.zeros_like(x)
            power = ((origin - x) / size) ** (k - first) / factorial(k - first)
            return np.where(x > begin, power * size ** (k + 1 - order), 0.0)

        return [
            [(level(first, k, *at, grid.x), level(first, k, *at, grid.ends)) for k in range(order)]
            for at in starts
            for first in reversed(range(order))
        ]

    def _softness(self, field: int) -> Array:
        """Return weights of the integral of a squared stress times its compliance, (sets, 1, Q, G)."""
        grid = self.columns.grid
        soft = np.broadcast_to(self.columns.compliance[field, field], (len(grid.x), *grid.x.shape[1:]))
        return (soft * grid.half[..., None] * self.columns.gauss.weights)[:, None]

    @staticmethod
    def _fit(values: Array, basis: list[Array], weight: Array) -> Array:
        """Return coefficients of functions that fit values in the weighted mean square, (sets, modes, functions)."""
        root = np.sqrt(weight.reshape(len(weight), -1, 1))
        frame, upper = np.linalg.qr(np.stack([f.reshape(len(f), -1) for f in basis], axis=-1) * root)
        load = frame.swapaxes(-1, -2) @ (values.reshape(*values.shape[:2], -1).swapaxes(-1, -2) * root)
        return np.linalg.solve(upper, load).swapaxes(-1, -2)

    def _integral(self, rate: Array) -> tuple[Array, Array]:
        """Return the integral from the left end at the points and at the ends of the pieces."""
        half = self.columns.grid.half[:, None]
        gauss = self.columns.gauss
        local = (rate @ gauss.integral.T) * half[..., None]
        pieces = (rate @ gauss.weights) * half
        ends = np.concatenate([np.zeros((*pieces.shape[:2], 1)), np.cumsum(pieces, axis=-1)], axis=-1)
        return local + ends[..., :-1, None], ends

    @property
    def forces(self) -> list[Array]:
        """Natural forces P at the points, each (sets, modes, Q, G)."""
        return self._equilibrium_forces[0]

    @property
    def force_ends(self) -> list[Array]:
        """Natural forces P at the ends of the pieces, each (sets, modes, Q + 1)."""
        return self._equilibrium_forces[1]

    @property
    def unbalanced(self) -> list[Array]:
        """Highest natural force of each field by equilibrium minus that of the basis, (sets, modes, Q, G)."""
        return self._equilibrium_forces[2]

    def further(self) -> Array:
        """Return `unbalanced` as further basis functions of unit strain energy, (sets, modes, fields, Q, G)."""
        strained = self.columns.mesh.strained[self.columns.mesh.owner][:, None]
        found = []
        for field, force in enumerate(self.unbalanced):
            soft = self.columns.compliance[field, field][:, None]
            found.append(np.where(strained, force * soft, force) if strained.any() else force)
        size = np.sqrt(self.residual.sum(axis=-1) * self.z)[..., None, None, None]
        return np.stack(found, axis=2) / np.where(size > 0.0, size, 1.0)

    @cached_property
    def residual(self) -> Array:
        """Strain energy of the residual stresses relative to that of the mode, (sets, modes, elements).

        The sum over the elements, divided by the relative distance to the next compliance, bounds the relative error
        of z (Temple's inequality). Rigid-body modes have none.
        """
        energies = sum((r**2 * self._softness(field)).sum(axis=-1) for field, r in enumerate(self.unbalanced))
        starts = np.searchsorted(self.columns.mesh.owner, np.arange(len(self.columns.mesh.elements) - 1))
        share = np.add.reduceat(np.asarray(energies), starts, axis=-1)
        return np.where(self.z[..., None] > 0.0, share / np.where(self.z > 0.0, self.z, 1.0)[..., None], 0.0)

    # ------------------------------------------------------------------------------------------ any place

    def states(self, x: Array) -> Array:
        """Return the state (q, w, P) at places x of shape (sets, stations): (sets, modes, stations, 2 n + m)."""
        ends, grid = self.columns.grid.ends, self.columns.grid
        n, m = self.problem.displacements, self.problem.lumped
        found = np.empty((*self.z.shape, x.shape[1], 2 * n + m))
        spectrum = rule(self.columns.mesh.points).spectrum
        number = spectrum.shape[0]
        sets = np.arange(len(x))[:, None]
        right = ends[:, 1:-1]
        piece = (x[:, :, None] >= right[:, None, :]).sum(axis=-1) if right.shape[1] < 64 else _located(x, ends)
        middle = 0.5 * (ends[sets, piece] + ends[sets, piece + 1])
        local = np.clip((x - middle) / np.broadcast_to(grid.half, (len(x), grid.half.shape[1]))[sets, piece], -1.0, 1.0)
        table = np.polynomial.legendre.legvander(local, number - 1) @ spectrum  # (sets, stations, G)
        quantities = [*self.displaced[:n], *self.displaced[n:], *self.forces]
        for k, values in enumerate(quantities):
            picked = values[sets[:, None], np.arange(self.z.shape[1])[None, :, None], piece[:, None, :]]
            found[..., k] = (picked * table[:, None]).sum(axis=-1)
        return found


def _located(x: Array, ends: Array) -> NDArray[np.intp]:
    return np.stack([np.searchsorted(row[1:-1], at, side="right") for row, at in zip(ends, x, strict=True)])
