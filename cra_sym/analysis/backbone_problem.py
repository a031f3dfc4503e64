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


@dataclass(frozen=True, eq=False)
class FollowedMode:
    """A mode to be followed, with a truncation in modes and harmonics."""

    system: System
    mode: int
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
            raise ValueError("virtual_work: must be forces with a potential, or dampers, which a backbone leaves out")
        if any(term.velocities % 2 for term in whole.energies if not term.causes):
            raise ValueError(
                "system: must have no gyroscopic terms, since a backbone needs motions that are reversible in time"
            )
        equations = whole.free()
        if not equations.omega[mode - 1] > 0:
            raise ValueError(f"mode = {mode}: is a rigid-body mode and does not vibrate")
        multiples = tuple(range(1, harmonics + 1, 2)) if equations.odd else tuple(range(harmonics + 1))
        basis = Basis(multiples, (), samples(equations.degree, harmonics))
        rows = watched(system, modes, place, field)
        return cls(system, mode, Balance(equations, basis), rows, (modes, harmonics, place, field))

    def richer(self, more_modes: int, more_harmonics: int) -> FollowedMode:
        modes, harmonics, place, field = self.arguments
        return self.of(self.system, self.mode, modes + more_modes, harmonics + more_harmonics, place, field)

    @property
    def equations(self) -> ModalPolynomials:
        return self.balance.equations

    def energy(self, unknowns: Array) -> tuple[float, Array]:
        """Return the energy at zero velocity and its gradient."""
        start = self.balance.basis.values(np.zeros(1))[0]
        q = self.balance.coefficients(unknowns)[0] @ start
        force = self.equations.derivatives(q[None], np.zeros_like(q)[None]).force[0]
        return float(self.equations.potential(q)), np.outer(self.equations.omega**2 * q - force, start).ravel()

    def peak(self, unknowns: Array) -> tuple[float, Array]:
        """Return the peak and its gradient."""
        basis, coefficients = self.balance.basis, self.balance.coefficients(unknowns)
        largest, phase = peak(basis, self.rows, coefficients)
        values = basis.values(phase)[0]
        sign = np.sign(self.rows @ coefficients[0] @ values)
        return float(largest[0]), sign * np.outer(self.rows, values).ravel()

    def linear_motion(self, size: float) -> Array:
        """Return the unknowns of the linear mode with a modal amplitude."""
        x = np.zeros((self.equations.modes, self.balance.basis.size))
        x[self.mode - 1, self.balance.basis.cosines.index(1)] = size
        return x.ravel()

    def small(self) -> float:
        """Return a modal amplitude at which nonlinear forces are a small fraction of the linear ones."""
        square = self.equations.omega[self.mode - 1] ** 2
        low, high = -40.0, 40.0
        for _ in range(60):
            middle = 0.5 * (low + high)
            q = np.zeros((1, self.equations.modes))
            q[0, self.mode - 1] = 10.0**middle
            v = np.roll(q, 0) * self.equations.omega[self.mode - 1]
            found = self.equations.derivatives(q, v)
            share = np.abs(found.force).max() + np.abs(found.momentum).max() * np.sqrt(square)
            low, high = (middle, high) if share < _START * square * 10.0**middle else (low, middle)
        return float(10.0**low)
