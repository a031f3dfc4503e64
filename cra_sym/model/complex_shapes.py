"""Complex mode shapes from the exact dynamic stiffness, normalised by the kinetic energy."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from cra_sym.cached import cached_property
from cra_sym.model.projection import BilinearForm, Domain, Projected
from cra_sym.model.routes import StateModes, mode_sign, overview_places
from cra_sym.model.spatial import SpatialProblem
from cra_sym.solvers.shapes import mode_states

__all__ = ["CoarseIntegrationError", "ComplexShapes"]

Array = NDArray[np.float64]
Complex = NDArray[np.complex128]
_STEPS = 5, 6, 7, 8  # halvings of the two parts; with more, rounding spoils the shear forces
_GOOD, _POOR = 1e-9, 1e-6
_POINTS, _WEIGHTS = np.polynomial.legendre.leggauss(10)


class CoarseIntegrationError(ValueError):
    """Coefficients vary too finely along x for the integration."""


@dataclass(frozen=True, eq=False)
class ComplexShapes:
    """Shapes phi of motions ``phi exp(s t)`` with ``conj(phi)' M phi = 1``, real and positive at the right end.

    Where the first field vanishes there, its first derivative that does not is real and positive. They have the
    interface of modes, with complex values.

    Attributes
    ----------
    s : ndarray of complex, shape (..., modes)
        Eigenvalues.
    spatial : SpatialProblem
        With everything in it.
    damped : bool
        Whether its parameter is s, not ``-s**2``.
    columns : ndarray, shape (parameters, rows)
        Parameters of the flat batch.
    domain : Domain
    inertia : BilinearForm
        The mass.
    """

    s: Complex
    spatial: SpatialProblem
    damped: bool
    columns: Array
    domain: Domain
    inertia: BilinearForm

    @property
    def omega(self) -> Array:
        """Placeholder array with one entry per mode; only its shape is used."""
        return self.s.imag

    def shape(self, place: int, derivative: int, x: Array) -> Complex:
        """Return a derivative of a displacement of the section at places (..., stations), (..., modes, stations)."""
        x = np.broadcast_to(x, (*self.s.shape[:-1], x.shape[-1])).reshape(len(self._parameter), x.shape[-1])
        finite = np.where(np.isinf(self.columns), 0.0, self.columns)
        row = self.spatial.derivative_row(place, derivative, self._parameter, x[:, None], finite)
        shapes: Complex = self._factor[..., None] * (row * self._states(x)).sum(axis=-1)
        return shapes.reshape(*self.s.shape, x.shape[-1])

    def displacement(self, end: int, place: int) -> Complex:
        """Return a displacement of an end section, shape (..., modes)."""
        return np.asarray((self._factor * self._overview[:, :, -end, place]).reshape(self.s.shape))

    def coordinate(self, number: int) -> Complex:
        """Return a lumped coordinate, shape (..., modes)."""
        return self.displacement(0, self.spatial.displacements + number)

    def stations(self) -> tuple[Array, Array]:
        """Return points and weights of a quadrature that respects the breakpoints, shape (..., points)."""
        return self._parts.stations()

    @cached_property
    def _parameter(self) -> Complex:
        s = self.s.reshape(self.columns.shape[1], self.s.shape[-1])
        return s if self.damped else -(s**2) + 0j

    @cached_property
    def _overview(self) -> Complex:
        """States at both ends and some places between, shape (rows, modes, stations, 2 n + m)."""
        finite = np.where(np.isinf(self.columns), 0.0, self.columns)
        return self._states(overview_places(self.spatial, finite, len(self._parameter)))

    @cached_property
    def _parts(self) -> _ShapeParts:
        return _ShapeParts(
            np.zeros((*self.s.shape[:-1], 2 * self.s.shape[-1])),
            self.spatial,
            self.columns,
            lambda x: np.concatenate([(states := self._states(x)).real, states.imag], axis=1),
        )

    @cached_property
    def _factor(self) -> Complex:
        """Normalisation factors of the shapes, (rows, modes)."""
        n, m, modes = self.spatial.displacements, self.spatial.coordinates, self.s.shape[-1]
        if not self.s.size:
            return np.empty((0, modes), dtype=complex)
        watched = n or m  # coordinates where there is no field
        turn = mode_sign(self._overview[..., :watched], self._overview[..., -1, n : n + m])[..., 0]
        energy = Projected(self.domain, self._parts, self.inertia, diagonal=True)["mass"]
        return np.asarray(turn / np.sqrt(energy.reshape(-1, 2, modes).sum(axis=1)))

    def _states(self, x: Array) -> Complex:
        """Return states at places x (rows, stations), shape (rows, modes, stations, 2 n + m)."""
        z = self._parameter
        size = 2 * self.spatial.displacements + self.spatial.coordinates
        state = np.empty((*z.shape, x.shape[-1], size), dtype=complex)
        for rows, left, problem in self.spatial.problems(self.columns, self._halvings):
            state[rows] = mode_states(problem, z[rows], problem.shares(x[rows], left))
        return state

    @cached_property
    def _halvings(self) -> int:
        """Number of halvings of each part for the integration along x: the fewest that reproduce the eigenvalues."""
        best, least = _STEPS[0], np.inf
        for halvings in _STEPS if not self.spatial.uniform else ():
            error = self._error(halvings)
            if error < least:
                best, least = halvings, error
            if least < _GOOD:
                return best
        if _POOR < least < np.inf:
            raise CoarseIntegrationError(
                f"damped: the coefficients vary too finely along x for complex shapes: {2 ** (_STEPS[-1] + 1)} steps "
                f"give the eigenvalues to {least:.1g} only"
            )
        return best

    def _error(self, halvings: int) -> float:
        """Return the largest relative distance of the eigenvalues from those of the integration."""
        z, worst = self._parameter, 0.0
        for rows, _, problem in self.spatial.problems(self.columns, halvings):
            here = problem.evaluate(z[rows].ravel(), np.repeat(np.arange(len(rows)), z.shape[1]))
            step = 1.0 / here.logarithmic_derivative
            size = np.maximum(np.abs(z[rows]), 1e-6 * np.abs(z[rows]).max(axis=1, keepdims=True))
            worst = max(worst, float(np.abs(step.reshape(size.shape) / size).max()))
        return worst


class _ShapeParts(StateModes):
    """Real and imaginary parts of complex shapes as modes, with a quadrature that respects the breakpoints."""

    def stations(self) -> tuple[Array, Array]:
        """Return points and weights, shape (..., points)."""
        finite, rows = self._finite, self.columns.shape[1]
        length, left = (np.broadcast_to(g, rows) for g in self.spatial.geometry.function(*finite))
        if self.spatial.breaks is None:
            whole: tuple[int, ...] = ()
            groups = [(np.arange(rows), np.stack([left, left + length], axis=1), whole)]
        else:
            groups = self.spatial.breaks.edges(finite, left, length)
        most = max(edges.shape[1] for _, edges, _ in groups) - 1
        panels = int(np.ceil((self.omega.shape[-1] + 8) / most)) + 2
        share = ((np.arange(panels)[:, None] + 0.5 * (1.0 + _POINTS)) / panels).ravel()
        weight = np.tile(0.5 * _WEIGHTS / panels, panels)
        x, weights = np.empty((rows, most, share.size)), np.zeros((rows, most, share.size))
        for members, edges, _ in groups:
            spans = np.diff(edges, axis=1)
            number = spans.shape[1]
            x[members] = edges[:, -1, None, None]
            x[members, :number] = edges[:, :-1, None] + spans[..., None] * share
            weights[members, :number] = spans[..., None] * weight
        shape = (*self.omega.shape[:-1], most * share.size)
        return x.reshape(shape), weights.reshape(shape)
