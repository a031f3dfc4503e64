r"""Modal equations with polynomial terms: their Lagrangian and forces as coefficient tensors, with exact derivatives.

.. math:: L = \tfrac12 \dot q^T \dot q - \tfrac12 q^T\Omega^2 q + \sum T[q, \ldots, q, \dot q, \ldots, \dot q]\,e(t)

with forces :math:`-C\dot q + \sum Q[q, \ldots, \dot q]\,e(t)` that have no Lagrangian. The linear modes are exact, so
that the quadratic part is diagonal.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass
from math import factorial, perm
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..cached import cached_property
from ..checks import ByValue

__all__ = ["Derivatives", "ModalPolynomials", "TensorTerm", "symmetrised"]

Array = NDArray[np.float64]


class TensorTerm(NamedTuple):
    """A tensor times modal coordinates, modal velocities, and known functions of time.

    Attributes
    ----------
    tensor : ndarray, shape (modes,) * (positions + velocities), of a force (modes, modes, ...)
        Symmetric in the axes of coordinates, which come first, and in those of velocities. The first axis of a force is
        the equation it stands in.
    positions, velocities : int
    causes : tuple of int
        Known functions of time that multiply it, by number.
    """

    tensor: Array
    positions: int
    velocities: int
    causes: tuple[int, ...] = ()


class Derivatives(NamedTuple):
    """Generalised forces, momenta and their rates at samples, linear terms left out.

    Attributes
    ----------
    force : ndarray, shape (samples, modes)
        dL/dq + Q.
    momentum : ndarray, shape (samples, modes)
        dL/dv.
    force_q, force_v, momentum_q, momentum_v : ndarray, shape (samples, modes, modes)
        Rates of both by q and v.
    """

    force: Array
    momentum: Array
    force_q: Array
    force_v: Array
    momentum_q: Array
    momentum_v: Array


def symmetrised(tensor: Array, positions: int, first: int = 0) -> Array:
    """Return a tensor that is symmetric in ``positions`` axes from ``first`` on, and in the axes after them."""
    for start, stop in ((first, first + positions), (first + positions, tensor.ndim)):
        axes = list(range(start, stop))
        orders = list(itertools.permutations(axes))
        if len(orders) > 1:
            total = np.zeros_like(tensor)
            for order in orders:
                total += tensor.transpose(*range(start), *order, *range(stop, tensor.ndim))
            tensor = total / factorial(len(axes))
    return tensor


@dataclass(frozen=True, eq=False)
class ModalPolynomials(ByValue):
    """Modal equations with polynomial terms.

    Attributes
    ----------
    omega : ndarray, shape (modes,)
        Natural frequencies, rad/s.
    damping : ndarray, shape (modes, modes)
        C, 1/s; its skew part are gyroscopic terms.
    energies, forces : tuple of TensorTerm
        Of the Lagrangian, and without one; at least of degree one.
    """

    omega: Array
    damping: Array
    energies: tuple[TensorTerm, ...]
    forces: tuple[TensorTerm, ...] = ()

    @property
    def modes(self) -> int:
        """Number of modes."""
        return self.omega.size

    @cached_property
    def degree(self) -> int:
        """Highest degree of the equations of motion in the unknowns."""
        found = [term.positions + term.velocities - 1 for term in self.energies]
        return max([1, *found, *(term.positions + term.velocities for term in self.forces)])

    @cached_property
    def odd(self) -> bool:
        """Whether the equations without known functions of time are unchanged under q -> -q."""
        free = [term for term in self.energies if not term.causes], [term for term in self.forces if not term.causes]
        even = all((term.positions + term.velocities) % 2 == 0 for term in free[0])
        return even and all((term.positions + term.velocities) % 2 for term in free[1])

    @cached_property
    def moves_mass(self) -> bool:
        """Whether the nonlinear terms contain velocities."""
        return any(term.velocities for term in (*self.energies, *self.forces))

    @cached_property
    def by_velocity(self) -> tuple[bool, bool]:
        """Whether the forces, and whether the momenta, of the nonlinear terms depend on velocities."""
        mixed = any(term.positions and term.velocities for term in self.energies)
        return mixed or any(term.velocities for term in self.forces), any(t.velocities > 1 for t in self.energies)

    def free(self) -> ModalPolynomials:
        """Return the equations without dampers, forces and known functions of time; gyroscopic terms stay."""
        kept = tuple(term for term in self.energies if not term.causes)
        return ModalPolynomials(self.omega, 0.5 * (self.damping - self.damping.T), kept)

    def nonlinear(self) -> ModalPolynomials:
        """Return the equations without linear terms beside those of the modes."""
        energies = tuple(term for term in self.energies if term.positions + term.velocities > 2)
        forces = tuple(term for term in self.forces if term.positions + term.velocities > 1)
        return ModalPolynomials(self.omega, self.damping, energies, forces)

    def first(self, modes: int) -> ModalPolynomials:
        """Return the equations of the first modes alone."""
        return self.of(np.arange(modes))

    def of(self, numbers: NDArray[np.intp]) -> ModalPolynomials:
        """Return the equations of some modes alone, by number."""

        def some(terms: Sequence[TensorTerm]) -> tuple[TensorTerm, ...]:
            return tuple(t._replace(tensor=t.tensor[np.ix_(*[numbers] * t.tensor.ndim)]) for t in terms)

        damping = self.damping[np.ix_(numbers, numbers)]
        return ModalPolynomials(self.omega[numbers], damping, some(self.energies), some(self.forces))

    def along(self, shape: Array) -> ModalPolynomials:
        """Return the equation of the modes moving in one shape, a vector (modes,) of length one."""

        def contracted(terms: Sequence[TensorTerm]) -> tuple[TensorTerm, ...]:
            found = []
            for term in terms:
                tensor = term.tensor
                for _ in range(tensor.ndim):
                    tensor = np.tensordot(tensor, shape, axes=(0, 0))
                found.append(term._replace(tensor=np.asarray(tensor).reshape((1,) * term.tensor.ndim)))
            return tuple(found)

        omega, damping = np.linalg.norm(self.omega * shape), shape @ self.damping @ shape
        return ModalPolynomials(
            np.array([omega]), np.array([[damping]]), contracted(self.energies), contracted(self.forces)
        )

    def potential(self, q: Array) -> Array:
        """Return minus the Lagrangian at zero velocity, J, for q of shape (..., modes)."""
        flat = q.reshape(-1, self.modes)
        value = 0.5 * ((self.omega * flat) ** 2).sum(axis=-1)
        for term in self.energies:
            if not term.velocities and not term.causes:
                value = value - _contracted(term.tensor, term.positions, 0, flat, flat).reshape(len(flat))
        return np.asarray(value.reshape(q.shape[:-1]))

    def energy(self, q: Array, v: Array) -> Array:
        """Return the energy v dL/dv - L, J, for q and v of shape (..., modes)."""
        flat, rates = q.reshape(-1, self.modes), v.reshape(-1, self.modes)
        value = 0.5 * (rates**2).sum(axis=-1) + 0.5 * ((self.omega * flat) ** 2).sum(axis=-1)
        for term in self.energies:
            if not term.causes:
                part = _contracted(term.tensor, term.positions, term.velocities, flat, rates)
                value = value + (term.velocities - 1) * part.reshape(len(flat))
        return np.asarray(value.reshape(q.shape[:-1]))

    def derivatives(self, q: Array, v: Array, causes: Array | None = None) -> Derivatives:
        """Return forces, momenta and their rates of the nonlinear terms.

        Parameters
        ----------
        q, v : ndarray, shape (samples, modes)
        causes : ndarray, shape (known functions, samples), optional
        """
        samples, n = q.shape
        found = Derivatives(*(np.zeros((samples, n)) for _ in range(2)), *(np.zeros((samples, n, n)) for _ in range(4)))
        for term in self.energies:
            scale = _scale(term, causes)
            a, b = term.positions, term.velocities
            for degree, kept, vector, first, second in (
                (a, (2, 0), q, found.force, found.force_q),
                (b, (0, 2), v, found.momentum, found.momentum_v),
            ):
                if degree > 1:
                    part = _slots(term, q, v, *kept)
                    _add(second, perm(degree, 2), part, scale)
                    _add(first, degree, (part @ vector[:, :, None])[:, :, 0], scale)
                elif degree:
                    _add(first, degree, _slots(term, q, v, kept[0] // 2, kept[1] // 2), scale)
            if a and b:
                mixed = _slots(term, q, v, 1, 1)
                _add(found.force_v, a * b, mixed, scale)
                _add(found.momentum_q, a * b, mixed.swapaxes(-1, -2), scale)
        for term in self.forces:
            scale = _scale(term, causes)
            a, b = term.positions, term.velocities
            _add(found.force, 1, _slots(term, q, v, 0, 0, equation=True), scale)
            if a:
                _add(found.force_q, a, _slots(term, q, v, 1, 0, equation=True), scale)
            if b:
                _add(found.force_v, b, _slots(term, q, v, 0, 1, equation=True), scale)
        return found

    def _pushes(self, q: Array, v: Array, causes: Array | None, rates: Array | None) -> tuple[Array, Array]:
        """Return forces of the nonlinear terms less the rates of their momenta at constant v, and their inertia."""
        samples, n = q.shape
        force, inertia = np.zeros((samples, n)), np.zeros((samples, n, n))
        for term in self.energies:
            scale, a, b = _scale(term, causes), term.positions, term.velocities
            if a and b:
                mixed = _slots(term, q, v, 1, 1)
                _add(force, a, (mixed @ v[:, :, None])[:, :, 0], scale)
                _add(force, -a * b, (v[:, None, :] @ mixed)[:, 0], scale)
            elif a:
                _add(force, a, _slots(term, q, v, 1, 0), scale)
            if b > 1:
                _add(inertia, perm(b, 2), _slots(term, q, v, 0, 2), scale)
            if b and term.causes and rates is not None:
                _add(force, -b, _slots(term, q, v, 0, 1), _scale_rate(term, causes, rates))
        for term in self.forces:
            _add(force, 1, _slots(term, q, v, 0, 0, equation=True), _scale(term, causes))
        return force, inertia

    def acceleration(
        self,
        q: Array,
        v: Array,
        causes: Array | None = None,
        rates: Array | None = None,
        load: Array | float = 0.0,
        *,
        whole: bool = True,
    ) -> Array:
        """Return accelerations.

        Parameters
        ----------
        q, v : ndarray, shape (samples, modes)
        causes, rates : ndarray, shape (known functions, samples), optional
            Known functions and their rates, of which momenta may depend; rates of None are zero.
        load : ndarray, shape (samples, modes), optional
            Further forces.
        whole : bool
            If False, those of the undamped linear modes are left out.
        """
        pull = self.omega**2 * q
        force, inertia = self._pushes(q, v, causes, rates)
        force = np.asarray(force - v @ self.damping.T + load)
        if self.by_velocity[1]:
            force = force + (inertia @ pull[:, :, None])[:, :, 0]
            force = np.asarray(np.linalg.solve(np.eye(self.modes) + inertia, force[:, :, None])[:, :, 0])
        return np.asarray(force - pull if whole else force)


def _scale(term: TensorTerm, causes: Array | None) -> Array | float:
    if not term.causes:
        return 1.0
    assert causes is not None
    return np.asarray(causes[list(term.causes)].prod(axis=0))


def _scale_rate(term: TensorTerm, causes: Array | None, rates: Array) -> Array:
    """Return the rate of the product of the known functions of a term."""
    assert causes is not None
    factors, slopes = causes[list(term.causes)], rates[list(term.causes)]
    parts = [np.delete(factors, k, axis=0).prod(axis=0) * slope for k, slope in enumerate(slopes)]
    return np.asarray(np.sum(parts, axis=0))


def _add(total: Array, factor: int, part: Array, scale: Array | float) -> None:
    scale = scale if isinstance(scale, float) else scale.reshape(-1, *(1,) * (part.ndim - 1))
    total += factor * scale * part


def _slots(term: TensorTerm, q: Array, v: Array, kept_q: int, kept_v: int, equation: bool = False) -> Array:
    """Contract all axes but some of coordinates and velocities; equation, coordinates, velocities is their order."""
    a, b = term.positions, term.velocities
    return _contracted(term.tensor, a - kept_q, b - kept_v, q, v, kept_v, equation)


def _contracted(
    tensor: Array, with_q: int, with_v: int, q: Array, v: Array, kept_v: int = 0, equation: bool = False
) -> Array:
    """Contract axes of velocities with v and of coordinates with q; shape (samples, modes, ...).

    Axes of one kind are alike, so that those are taken which need not be moved.
    """
    samples = len(q)
    found: Array = tensor.reshape(1, *tensor.shape)
    if with_v:
        found = _last(found, v, with_v)
    if with_q and kept_v:
        axis = 2 if equation else 1  # coordinates come first, after the equation
        found = np.moveaxis(found, range(axis, axis + with_q), range(found.ndim - with_q, found.ndim))
    if with_q:
        found = _last(found, q, with_q)
    return found if len(found) == samples else np.broadcast_to(found, (samples, *found.shape[1:]))


def _last(found: Array, vector: Array, number: int) -> Array:
    """Contract the last axes, of a number, with a vector at every sample: one product of matrices."""
    samples, n = vector.shape
    shape, products = found.shape[1 : found.ndim - number], (factors := np.ascontiguousarray(vector.T))
    for _ in range(number - 1):
        products = (products[:, None] * factors).reshape(-1, samples)
    if found.shape[0] == 1:  # the same tensor at all samples
        return (products.T @ found.reshape(-1, n**number).T).reshape(samples, *shape)
    return (found.reshape(samples, -1, n**number) @ products.T[:, :, None]).reshape(samples, *shape)
