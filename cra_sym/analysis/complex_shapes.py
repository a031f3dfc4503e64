"""Complex modes, from the exact dynamic stiffness or, where that has none, from the stress basis."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cra_sym.model.complex_shapes import CoarseIntegrationError, ComplexShapes
from cra_sym.model.projection import project
from cra_sym.model.routes import mode_sign, overview_places
from cra_sym.model.system import System
from cra_sym.model.values import flat_columns
from cra_sym.model.vanishing import check_forces
from cra_sym.solvers.lowest_motions import BasisModes, LowestMotions, lowest_motions
from cra_sym.solvers.pencil import GeneralContinuum

__all__ = ["check_complex_modes", "of_complex_modes", "resonant_growth", "shapes_and_tests"]

Array = NDArray[np.float64]
Complex = NDArray[np.complex128]


def check_complex_modes(system: System) -> None:
    """Raise an error if complex modes cannot be computed."""
    if system.numerics("pencil") is None:
        raise ValueError("system: with a field that has no derivative by x there are no complex modes; eliminate it")


def of_complex_modes(system: System, s: Complex, quantity: Callable[[System, Any], NDArray[Any]]) -> Complex:
    """Return a linear quantity of complex modes, shape (..., modes, ...).

    Parameters
    ----------
    system : System
        With forces that are not conservative.
    s : ndarray of complex, shape (..., modes)
        Eigenvalues of the modes, some of the lowest; ``...`` is the shape of the system.
    quantity : callable
        ``quantity(system, modes)`` takes a system and modes or the coordinates of a basis, of the whole batch or of
        one of its members, and returns an array of shape (..., modes, ...).
    """
    numerics, spatial = system.numerics, system.numerics("damped_spatial")
    columns = flat_columns(system.parameters, system.shape)
    if not s.size or (not spatial.supported and not spatial.singular(columns).any()):
        shapes = ComplexShapes(s, spatial, numerics("damped"), columns, system.domain, numerics("inertia"))
        try:
            return np.asarray(quantity(system, shapes), dtype=complex)
        except CoarseIntegrationError:
            if numerics("pencil") is None:
                raise
    found = []
    for values, column in zip(s.reshape(-1, s.shape[-1]), columns.T, strict=True):
        one = system.model.at(dict(zip(numerics("names"), column, strict=True)))
        basis, own, _ = _on_basis(system, column[:, None], values)
        found.append(np.tensordot(own, quantity(one, basis), axes=1))
    return np.array(found, dtype=complex).reshape(*s.shape, *found[0].shape[1:])


def resonant_growth(system: System, motion: str, s: Complex, tip: Callable[[System, Any], Array]) -> Array:
    """Return how fast an output grows when a motion of unit amplitude is in resonance, shape (..., modes).

    Driven with the frequency Im s, a mode has the amplitude ``growth (exp(Re s t) - 1) / Re s``, or ``growth t``.

    Parameters
    ----------
    system : System
        With a stress basis.
    motion : str
        Name of a prescribed motion.
    s : ndarray of complex, shape (..., modes)
        Eigenvalues of the modes, some of the lowest; those of rigid-body modes, 0, do not grow.
    tip : callable
        ``tip(system, basis)`` returns the output in every coordinate of a basis.
    """
    pencil, loads = system.numerics("pencil"), system.numerics("loads", motion)
    for load in loads.values():
        check_forces(system, load, pencil)
    columns, found = flat_columns(system.parameters, system.shape), np.zeros(s.shape)
    for row, column, whole in zip(found.reshape(-1, s.shape[-1]), columns.T, s.reshape(-1, s.shape[-1]), strict=True):
        values = whole[whole != 0.0]
        if not values.size:
            continue
        one = system.model.at(dict(zip(system.numerics("names"), column, strict=True)))
        ((_, problem),) = pencil.problems(column[:, None])
        motions = _motions(problem, values)
        all_values, vectors = np.linalg.eig(motions.system)
        number = [np.abs(all_values - value).argmin() for value in values]
        seen = (tip(one, motions.basis) @ motions.shapes @ vectors)[number]
        forces = sum(np.outer((1j * values.imag) ** order, project(one.domain, motions.basis, load))
                     for order, load in loads.items())  # fmt: skip
        row[whole != 0.0] = np.abs(seen * ((np.linalg.inv(vectors) @ motions.push)[number] * forces).sum(axis=1))
    return found


@dataclass(frozen=True, eq=False)
class Combinations:
    """Combinations of the coordinates of a basis, shape (number, coordinates), with the interface of modes."""

    basis: BasisModes
    shares: Array

    @property
    def omega(self) -> Array:
        """Placeholder array with one entry each; only its shape is used."""
        return np.zeros(len(self.shares))

    def displacement(self, end: int, place: int) -> Array:
        """Return a displacement of an end section, shape (number,)."""
        return np.asarray(self.shares @ self.basis.displacement(end, place))

    def force(self, end: int, place: int) -> Array:
        """Raise: they have no natural forces of their own."""
        raise NotImplementedError

    def coordinate(self, number: int) -> Array:
        """Return a lumped coordinate, shape (number,)."""
        return np.asarray(self.shares @ self.basis.coordinate(number))

    def shape(self, place: int, derivative: int, x: Array) -> Array:
        """Return a derivative of a displacement at places, shape (number, stations)."""
        return np.asarray(self.shares @ self.basis.shape(place, derivative, x))

    def integral(self, place: int) -> None:
        """Return None: only quadrature gives integrals."""
        return None


def shapes_and_tests(system: System, s: Complex) -> Combinations:
    """Return the real parts of some complex modes, their imaginary parts, and these of the tests of the modes.

    With forces f on the structure the amplitude of a mode obeys ``z' = s z + test . f``.

    Parameters
    ----------
    system : System
        Not a batch, with a stress basis.
    s : ndarray of complex, shape (modes,)
        Eigenvalues of the modes, some of the lowest.
    """
    basis, own, tests = _on_basis(system, flat_columns(system.parameters, ()), s)
    return Combinations(basis, np.concatenate([own.real, own.imag, tests.real, tests.imag]))


def _on_basis(system: System, column: Array, s: Complex) -> tuple[BasisModes, Complex, Complex]:
    """Return the coordinates of a basis, and in these modes and tests of one parameter set, (modes, coordinates)."""
    spatial = system.numerics("damped_spatial")
    ((_, problem),) = system.numerics("pencil").problems(column)
    motions = _motions(problem, s)
    values, vectors = np.linalg.eig(motions.system)
    number = [np.abs(values - one).argmin() for one in s]
    own, tests = motions.shapes @ vectors[:, number], (np.linalg.inv(vectors) @ motions.push)[number]
    basis = motions.basis
    energy = (np.abs(basis.problem.root_mass[0][:, None] * own) ** 2).sum(axis=0) / basis.problem.rate[0] ** 2
    ends = overview_places(spatial, np.where(np.isinf(column), 0.0, column), 1)[0]
    parts = [basis.shape(k, 0, ends) for k in range(spatial.displacements)]
    lumped = [basis.coordinate(k) for k in range(spatial.coordinates)]
    parts = parts or [np.repeat(one[:, None], len(ends), axis=1) for one in lumped]
    seen = np.stack([part.T @ own for part in parts], axis=-1)
    still = np.array([one @ own for one in lumped]).reshape(len(lumped), len(s)).T
    turn = mode_sign(np.swapaxes(seen, 0, 1)[None], still[None])[0, :, 0]
    scale = (turn / np.sqrt(energy))[:, None]
    return basis, scale * own.T, tests / scale


def _motions(problem: GeneralContinuum, s: Complex) -> LowestMotions:
    """Return the motions of enough eigenvalues to include all of these."""
    number = len(s)
    while True:
        motions = lowest_motions(problem, number, 0.0)
        gap = np.abs(motions.eigenvalues[:, None] - s).min(axis=0)
        if (gap < 1e-6 * np.maximum(np.abs(s), 1e-6 * np.abs(s).max())).all():
            return motions
        number *= 2
