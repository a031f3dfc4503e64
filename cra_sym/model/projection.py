"""Loads, initial states and dampers of a model seen by its natural modes: the weak form integrated over mode shapes."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from sympy import Expr, Matrix

from cra_sym.kernels import kernel
from cra_sym.mechanics.jets import END_NAMES, Jet
from cra_sym.mechanics.weak import Bilinear
from cra_sym.model.spatial import SpatialProblem, shares
from cra_sym.model.values import Values
from cra_sym.solvers.eigenvalues import lowest
from cra_sym.solvers.shapes import mode_states

__all__ = ["Load", "ModalBasis", "modal_basis"]

_POINTS, _WEIGHTS = np.polynomial.legendre.leggauss(10)

Load = Mapping[Jet, Expr]


@dataclass(frozen=True, eq=False)
class ModalBasis:
    """Mass-normalised modes at the points of a quadrature, at the places asked for and at both ends.

    Attributes
    ----------
    spatial : SpatialProblem
    columns : ndarray, shape (symbols, rows)
        Parameters, infinite ones replaced by zero.
    z : ndarray, shape (rows, modes)
        omega^2
    x : ndarray, shape (rows, stations)
        The last stations are the places, the left and the right end.
    weights : ndarray, shape (rows, points)
    state : ndarray, shape (rows, modes, stations, 2 n + m)
    """

    spatial: SpatialProblem
    columns: np.ndarray
    z: np.ndarray
    x: np.ndarray
    weights: np.ndarray
    state: np.ndarray

    @property
    def places(self) -> slice:
        """The stations that were asked for."""
        return slice(self.weights.shape[1], -2)

    def values(self, jet: Jet) -> np.ndarray:
        """Return a displacement of every mode at all stations, shape (rows, modes, stations)."""
        form = self.spatial.form
        fields = self.spatial.fields
        if jet.unknown >= len(fields):
            return self.state[..., len(form.displacements) + jet.unknown - len(fields)]
        place = form.displacements.index(fields[jet.unknown])
        row = self.spatial.derivative_row(place, jet.space, self.z, self.x[:, None], self.columns)
        return (row * self.state).sum(axis=-1)

    def project(self, inside: Load, ends: Load) -> np.ndarray:
        """Return the generalised force on every mode, shape (rows, modes), of loads on displacements."""
        total = np.zeros(self.z.shape)
        points = self.weights.shape[1]
        for jet, load in inside.items():
            density = self._evaluate(load, self.x[:, :points])
            total += ((density * self.weights)[:, None] * self.values(jet)[..., :points]).sum(axis=-1)
        for jet, load in ends.items():
            station = -2 if jet.place == END_NAMES[0] else -1
            force = self._evaluate(load, self.x[:, [station]])
            total += force * self.values(jet._replace(place=None))[..., station]
        return total

    def damping(self, inside: Bilinear, ends: Bilinear) -> np.ndarray:
        """Return the damping matrix between the modes, shape (rows, modes, modes), of a weak form."""
        points = self.weights.shape[1]
        total = np.zeros((*self.z.shape, self.z.shape[1]))
        for (p, q), entry in inside.items():
            if 1 in entry:
                density = self._evaluate(entry[1], self.x[:, :points]) * self.weights
                first, second = (self.values(jet)[..., :points] for jet in (p, q))
                total += np.einsum("rs,ris,rjs->rij", density, first, second)
        for (p, q), entry in ends.items():
            if 1 in entry:
                first, second = (
                    self.values(jet._replace(place=None))[..., -2 if jet.place == END_NAMES[0] else -1]
                    for jet in (p, q)
                )
                factor = self._evaluate(entry[1], self.x[:, [-1]])
                total += factor[..., None] * first[:, :, None] * second[:, None, :]
        return total

    def _evaluate(self, expression: Expr, x: np.ndarray) -> np.ndarray:
        """Return an expression in x and the parameters, shape (rows, stations)."""
        compiled = kernel(Matrix([[expression]]), (self.spatial.form.x, *self.spatial.symbols), backend="numpy")
        return np.broadcast_to(compiled(x, *self.columns[:, :, None])[..., 0, 0], x.shape)


def modal_basis(spatial: SpatialProblem, given: Values, modes: int, places: np.ndarray | None) -> ModalBasis:
    """Return the modes of all parameter sets, sampled; without ``places`` the right end is the place."""
    rows = given.columns.shape[1]
    panels = modes + 8  # ten points each: several to a half-wave of the highest mode
    points = ((np.arange(panels)[:, None] + 0.5 * (1.0 + _POINTS)) / panels).ravel()
    number = len(points) + (1 if places is None else len(places)) + 2
    columns = np.where(np.isinf(given.columns), 0.0, given.columns)
    z, x, length = np.empty((rows, modes)), np.empty((rows, number)), np.empty(rows)
    state = np.empty((rows, modes, number, 2 * len(spatial.form.displacements) + len(spatial.form.coordinates)))
    for members, left, problem in spatial.problems(given):
        size = len(members)
        share = np.ones((size, 1)) if places is None else shares(places, left, problem.length)
        stations = [np.broadcast_to(points, (size, len(points))), share, np.zeros((size, 1)), np.ones((size, 1))]
        every = np.concatenate(stations, axis=1)
        z[members] = lowest(problem, modes)
        state[members] = mode_states(problem, z[members], every)
        length[members] = problem.length
        x[members] = left[:, None] + every * problem.length[:, None]
    weights = np.tile(0.5 * _WEIGHTS / panels, panels)
    return ModalBasis(spatial, columns, z, x, weights * length[:, None], state)
