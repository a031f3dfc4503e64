"""Nonlinear terms projected on the exact linear modes: coefficient tensors by quadrature, with an error estimate."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass
from functools import reduce

import numpy as np
from numpy.typing import NDArray

from cra_sym.cached import cached_property
from cra_sym.model.modal_matrices import modal_matrices
from cra_sym.model.nonlinear import Factor, NonlinearTerms, Product
from cra_sym.model.projection import Displacement, along, displaced
from cra_sym.model.routes import Modes
from cra_sym.model.system import System
from cra_sym.solvers.modal_polynomials import ModalPolynomials, TensorTerm, symmetrised

__all__ = ["ModalEquations", "modal_equations", "projected_terms"]

Array = NDArray[np.float64]
_POINTS, _WEIGHTS = np.polynomial.legendre.leggauss(10)
_MOST_ENTRIES = 5_000_000  # of one tensor


@dataclass(frozen=True)
class ModalEquations:
    """Modal equations of a system.

    Attributes
    ----------
    polynomials : ModalPolynomials
        Frequencies, damping and coefficient tensors; without natural modes, between the modes of the conservative
        part, with gyroscopic terms in the damping and forces that follow the motion among the forces.
    causes : tuple of (str, int)
        Known functions of time in the nonlinear terms, with the order of the derivative.
    error : float
        Estimated error of the tensors by the quadrature, relative to the largest entry of each.
    """

    polynomials: ModalPolynomials
    causes: tuple[tuple[str, int], ...]
    error: float


def modal_equations(system: System, modes: int, zeta: float | Array | None = None) -> ModalEquations:
    """Return the equations of motion of the first modes, nonlinear terms included.

    Parameters
    ----------
    system : System
        Not a batch.
    modes : int
    zeta : float or ndarray, shape (modes,), optional
        Damping ratios beside the dampers of the model; default: those of the system.

    Raises
    ------
    ValueError
        If the system is a batch, or a tensor would have too many entries.
    """
    if system.shape:
        raise ValueError(
            f"system has the batch shape {system.shape}: must be a single one here; see System.parameter_sets"
        )
    energies, forces, causes, error = system.cached(
        "nonlinear", modes, lambda n: projected_terms(system, system.basis.modes(n))
    )
    matrices = modal_matrices(system, modes)
    omega = matrices.omega
    ratios = np.broadcast_to(system.zeta if zeta is None else zeta, omega.shape)
    damping = np.diag(2 * ratios * omega)
    if matrices.damping is not None:
        damping = damping + matrices.damping
    beside = matrices.stiffness
    if beside is not None and (beside == beside.T).all():  # it has a potential
        energies = (*energies, TensorTerm(-0.5 * beside, 2, 0))
    elif beside is not None:
        forces = (*forces, TensorTerm(-beside, 1, 0))
    return ModalEquations(ModalPolynomials(omega, damping, energies, forces), causes, error)


def projected_terms(
    system: System, modes: Modes
) -> tuple[tuple[TensorTerm, ...], tuple[TensorTerm, ...], tuple[tuple[str, int], ...], float]:
    """Return the tensors of the nonlinear energies and forces of modes or other motions, causes, and their error."""
    terms: NonlinearTerms | None = system.numerics("nonlinear")
    if terms is None:
        return (), (), (), 0.0
    number = modes.omega.shape[-1]
    coarse, fine = (_Projection(system, modes, terms, panels) for panels in (2 * number + 8, 3 * number + 13))
    found, rough = fine.tensors(), coarse.tensors()
    error = 0.0
    for key, tensor in found.items():
        size = np.abs(tensor).max()
        if size > 0:
            error = max(error, float(np.abs(tensor - rough[key]).max() / size))
    kinds: tuple[list[TensorTerm], list[TensorTerm]] = [], []
    for (force, positions, velocities, causes), tensor in found.items():
        kinds[force].append(TensorTerm(tensor, positions, velocities, causes))
    return tuple(kinds[0]), tuple(kinds[1]), terms.causes, error


Key = tuple[bool, int, int, tuple[int, ...]]


class _Projection:
    """Terms integrated with one set of panels."""

    def __init__(self, system: System, modes: Modes, terms: NonlinearTerms, panels: int) -> None:
        self._system, self._modes, self._terms, self._n = system, modes, terms, modes.omega.shape[-1]
        domain = system.domain
        self._values = [float(value) for value in domain.values]
        columns = np.array(self._values)[:, None]
        left, length = np.array([float(domain.left)]), np.array([float(domain.length)])
        ((_, edges, _),) = terms.breaks.edges(columns, left, length)
        parts = [
            np.linspace(a, b, max(2, int(np.ceil(panels * (b - a) / length[0]))) + 1)[:-1]
            for a, b in itertools.pairwise(edges[0])
        ]
        self._edges: Array = np.append(np.concatenate(parts), edges[0, -1])
        widths = np.diff(self._edges)
        self._x: Array = (self._edges[:-1, None] + 0.5 * (1 + _POINTS) * widths[:, None]).ravel()
        self._weights: Array = (0.5 * widths[:, None] * _WEIGHTS).ravel()

    def tensors(self) -> dict[Key, Array]:
        """Return the tensors by (force, positions, velocities, causes)."""
        terms, found = self._terms, dict[Key, Array]()
        density = terms.density.function(self._x, *self._values)
        for product, coefficient in zip(terms.inside, density, strict=True):
            self._collect(found, product, self._weights * coefficient)
        for product, coefficient in zip(terms.discrete, terms.points.function(*self._values), strict=True):
            self._collect(found, product, np.atleast_1d(np.asarray(coefficient, float)))
        return {key: symmetrised(tensor, key[1], int(key[0])) for key, tensor in found.items() if np.any(tensor)}

    def _collect(self, found: dict[Key, Array], product: Product, weights: Array) -> None:
        choices = [self._factor(factor) for factor in product.factors]
        for chosen in itertools.product(*choices):
            positions, velocities = sum(part[1] for part in chosen), sum(part[2] for part in chosen)
            if positions + velocities + len(product.causes) <= 2:
                continue  # of linear theory
            if self._n ** (positions + velocities) > _MOST_ENTRIES:
                raise ValueError(
                    f"modes = {self._n}: a term of degree {positions + velocities} would have too many coefficients; "
                    "take fewer modes"
                )
            tensor = self._integrated([part[0] for part in chosen], weights)
            order = _slots([(part[1], part[2]) for part in chosen])
            positions -= int(product.force)
            key = product.force, positions, velocities, product.causes
            found[key] = found.get(key, np.zeros(())) + tensor.transpose(order)

    def _integrated(self, arrays: Sequence[Array], weights: Array) -> Array:
        """Return the sum over stations of the outer products; arrays have shape (modes, ..., stations)."""
        split, axes, total = 0, 0, sum(a.ndim - 1 for a in arrays)
        while axes + arrays[split].ndim - 1 <= total / 2 and split < len(arrays) - 1:
            axes += arrays[split].ndim - 1
            split += 1
        one = np.ones((1, len(weights)))
        left, right = (reduce(_outer, part, one) for part in (arrays[:split], arrays[split:]))
        return ((left * weights) @ right.T).reshape((self._n,) * total)

    def _factor(self, factor: Factor) -> list[tuple[Array, int, int]]:
        """Return a factor in modal coordinates: arrays with their numbers of coordinates and velocities."""
        if factor.quadrature < 0:
            values = self._displacement(factor.place)
            return [(values, 1 - factor.time, factor.time)]
        found = []
        for degree, (stations, edges) in self._sums[factor.quadrature].items():
            values = stations if factor.place.where == "inside" else edges[..., self._edge(factor.place), None]
            found.append((values * degree**factor.time, degree - factor.time, factor.time))
        return found

    def _edge(self, place: Displacement) -> int:
        if place.where != "point":
            return -1 if place.where == "right" else 0
        at = self._terms.places.function(*self._values)[place.number]
        return int(np.abs(self._edges - at).argmin())

    def _displacement(self, place: Displacement) -> Array:
        if place.where == "inside":
            return along(self._modes, place, self._x)
        if place.where == "lumped":
            return self._modes.coordinate(place.entry)[:, None]
        return displaced(self._system.domain, self._modes, place, self._terms.places)[:, None]

    @cached_property
    def _sums(self) -> list[dict[int, tuple[Array, Array]]]:
        """Integrals of the integrands from the left end to the stations and to the edges, by degree."""
        weights = iter(np.broadcast_arrays(self._x, *self._terms.weights.function(self._x, *self._values))[1:])
        found = []
        for integrand in self._terms.integrands:
            by_degree: dict[int, Array] = {}
            for places in integrand:
                arrays = [along(self._modes, place, self._x) for place in places]
                value = (reduce(_outer, arrays) * next(weights)).reshape((self._n,) * len(places) + (-1,))
                by_degree[len(places)] = by_degree.get(len(places), 0.0) + symmetrised_stations(value)
            found.append({degree: self._running(value) for degree, value in by_degree.items()})
        return found

    def _running(self, values: Array) -> tuple[Array, Array]:
        panels = values.reshape(*values.shape[:-1], -1, _POINTS.size)
        half = 0.5 * np.diff(self._edges)[:, None]
        whole = (panels * (half * _WEIGHTS)).sum(axis=-1)
        edges = np.concatenate([np.zeros_like(whole[..., :1]), np.cumsum(whole, axis=-1)], axis=-1)
        stations = edges[..., :-1, None] + half * (panels @ _RUNNING.T)
        return stations.reshape(values.shape), edges


def symmetrised_stations(values: Array) -> Array:
    """Return values (modes, ..., stations) that are symmetric in their mode axes."""
    moved = np.moveaxis(values, -1, 0)
    return np.moveaxis(symmetrised(moved, values.ndim - 1, 1), 0, -1)


def _outer(one: Array, other: Array) -> Array:
    """Return the product of all entries at every station, flattened to (entries, stations)."""
    one, other = one.reshape(-1, one.shape[-1]), other.reshape(-1, other.shape[-1])
    product: Array = one[:, None, :] * other[None, :, :]
    return product.reshape(-1, product.shape[-1])


def _slots(counts: Sequence[tuple[int, int]]) -> list[int]:
    """Return the order of axes that puts coordinates, the equation of a force first among them, before velocities."""
    positions, velocities, axis = list[int](), list[int](), 0
    for number_q, number_v in counts:
        positions += range(axis, axis + number_q)
        velocities += range(axis + number_q, axis + number_q + number_v)
        axis += number_q + number_v
    return positions + velocities


def _running_matrix() -> Array:
    """Return the integrals of the Lagrange polynomials of the Gauss points from -1 to each of them."""
    legendre = np.polynomial.legendre
    to_coefficients = np.linalg.inv(legendre.legvander(_POINTS, _POINTS.size - 1))
    integrals = [legendre.legval(_POINTS, legendre.legint(row, lbnd=-1)) for row in np.eye(_POINTS.size)]
    return np.array(integrals).T @ to_coefficients


_RUNNING = _running_matrix()
