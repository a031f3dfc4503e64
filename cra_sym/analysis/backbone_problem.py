"""The equations of a backbone: the continuation of a natural mode, truncated to a number of modes and harmonics."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cra_sym.analysis.nonlinear import equations_of, samples, watched
from cra_sym.model.system import System
from cra_sym.solvers.harmonic_balance import Balance, Basis, peak
from cra_sym.solvers.modal_polynomials import ModalPolynomials

__all__ = ["FollowedMode"]

Array = NDArray[np.float64]
_START = 1e-5  # nonlinear share of the forces at the first point
_STILL = 1e-7  # of the highest frequency: below, a zero of the gyroscopic system, which is known to half its digits


@dataclass(frozen=True, eq=False)
class FollowedMode:
    """A mode to be followed, with a truncation in modes and harmonics.

    Attributes
    ----------
    linear : float
        Angular frequency of the linear motion, rad/s.
    shape : ndarray of complex, shape (modes,)
        Its modal amplitudes, of length one: the real part times the cosine, minus the imaginary part times the sine.
    """

    system: System
    mode: int
    linear: float
    shape: NDArray[np.complex128]
    balance: Balance
    rows: Array
    arguments: tuple[int, int, Any, Any]

    @classmethod
    def of(cls, system: System, mode: int, modes: int, harmonics: int, place: Any, field: Any) -> FollowedMode:
        whole = equations_of(system, modes)
        if system.numerics("constant") is not None:
            raise ValueError("system: must have no constant load, since a backbone starts from rest at zero")
        forces = [force for force in whole.forces if not force.causes]
        if any(force.velocities % 2 == 0 for force in forces):
            raise ValueError(
                "virtual_work: must be forces with a potential, or dampers, which a backbone leaves out; forces that "
                "follow the motion are neither: use steady_states"
            )
        equations = whole.free()
        frequency, shape = _linear_mode(equations, mode)
        multiples = tuple(range(1, harmonics + 1, 2)) if equations.odd else tuple(range(harmonics + 1))
        reversible = not equations.damping.any() and not any(term.velocities % 2 for term in equations.energies)
        sines = () if reversible else tuple(k for k in multiples if k)
        basis = Basis(multiples, sines, samples(equations.degree, harmonics))
        rows = watched(system, modes, place, field)
        arguments = modes, harmonics, place, field
        return cls(system, mode, frequency, shape, Balance(equations, basis), rows, arguments)

    def richer(self, more_modes: int, more_harmonics: int) -> FollowedMode:
        modes, harmonics, place, field = self.arguments
        return self.of(self.system, self.mode, modes + more_modes, harmonics + more_harmonics, place, field)

    @property
    def equations(self) -> ModalPolynomials:
        return self.balance.equations

    def energy(self, vector: Array) -> tuple[float, Array]:
        """Return the energy at the phase 0, where velocities vanish if motions are even in time, and its gradient."""
        basis, equations, frequency = self.balance.basis, self.equations, vector[-1]
        start, turn = (basis.values(np.zeros(1), derivative)[0] for derivative in (0, 1))
        x = self.balance.coefficients(vector[:-1])[0]
        q, u = x @ start, x @ turn
        v = frequency * u
        found = equations.derivatives(q[None], v[None])
        by_q = equations.omega**2 * q - found.force[0] + v @ found.momentum_q[0]
        by_v = v + found.momentum_v[0] @ v
        gradient = np.outer(by_q, start) + frequency * np.outer(by_v, turn)
        return float(equations.energy(q, v)), np.append(gradient, by_v @ u)

    def peak(self, vector: Array) -> tuple[float, Array]:
        """Return the peak and its gradient."""
        basis, coefficients = self.balance.basis, self.balance.coefficients(vector[:-1])
        largest, phase = peak(basis, self.rows, coefficients)
        values = basis.values(phase)[0]
        sign = np.sign(self.rows @ coefficients[0] @ values)
        return float(largest[0]), np.append(sign * np.outer(self.rows, values), 0.0)

    def linear_motion(self, size: float) -> Array:
        """Return the unknowns of the linear motion with a modal amplitude."""
        basis = self.balance.basis
        x = np.zeros((self.equations.modes, basis.size))
        x[:, basis.cosines.index(1)] = size * self.shape.real
        if basis.sines:
            x[:, len(basis.cosines) + basis.sines.index(1)] = -size * self.shape.imag
        return x.ravel()

    def small(self) -> float:
        """Return a modal amplitude at which nonlinear forces are a small fraction of the linear ones."""
        square, shape, nonlinear = self.linear**2, np.abs(self.shape)[None], self.equations.nonlinear()
        low, high = -40.0, 40.0
        for _ in range(60):
            middle = 0.5 * (low + high)
            q = 10.0**middle * shape
            found = nonlinear.derivatives(q, q * self.linear)
            share = np.abs(found.force).max() + np.abs(found.momentum).max() * self.linear
            low, high = (middle, high) if share < _START * square * 10.0**middle else (low, middle)
        return float(10.0**low)


def _linear_mode(equations: ModalPolynomials, mode: int) -> tuple[float, NDArray[np.complex128]]:
    """Return frequency and modal amplitudes of a linear motion, counted from 1 by ascending frequency."""
    n, omega, rest = equations.modes, equations.omega, np.zeros((1, equations.modes))
    beside = equations.derivatives(rest, rest)
    if equations.damping.any() or beside.force_q.any():
        stiffness = np.diag(omega**2) - beside.force_q[0]
        values, vectors = np.linalg.eig(np.block([[np.zeros((n, n)), np.eye(n)], [-stiffness, -equations.damping]]))
        order = np.argsort(np.where(values.imag >= 0.0, values.imag, np.inf), kind="stable")[:n]
        values, vectors = values[order], vectors[:n, order]
        if np.abs(values.real).max() > _STILL * np.abs(values).max():
            raise ValueError("system: must be stable at rest, since a backbone starts there")
        omega = np.where(values.imag > _STILL * omega.max(), values.imag, 0.0)
    else:
        vectors = np.eye(n, dtype=complex)
    if not omega[mode - 1] > 0:
        raise ValueError(f"mode = {mode}: is a rigid-body mode and does not vibrate")
    shape = vectors[:, mode - 1]
    largest = shape[np.abs(shape).argmax()]
    return float(omega[mode - 1]), shape * (largest.conj() / np.abs(largest)) / np.linalg.norm(shape)
