"""Harmonic balance with elastic-slip elements: modes are eliminated, the unknowns are displacements of the elements.

With the modal equations linearised at coordinates q, the displacements satisfy w = w0 - G F(w). F are the harmonics of
the forces of the elements, exact between events; G is the flexibility of the modes at each harmonic, dense where the
equations are parametric or nonlinear.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from cra_sym.cached import cached_property
from cra_sym.solvers.harmonic_balance import Balance, Basis
from cra_sym.solvers.modal_polynomials import ModalPolynomials
from cra_sym.solvers.slip_law import Cycle, cycle

__all__ = ["Elements", "SlipBalance", "stuck"]

Array = NDArray[np.float64]
_HALVINGS = 6
_PARTS, _LED = 7, 20  # largest number of halvings of a stiffness step, and Newton iterations in each


@dataclass(frozen=True, eq=False)
class Elements:
    """Elastic-slip elements on displacements w = B q - R F.

    Attributes
    ----------
    rows : ndarray, shape (displacements, modes)
        B.
    groups : tuple of (stiffness, slip)
        Of the elements on each displacement, arrays (elements,).
    coupling : ndarray, shape (displacements, displacements)
        R, zero on the diagonal: flexibility of the omitted modes between different displacements.
    """

    rows: Array
    groups: tuple[tuple[Array, Array], ...]
    coupling: Array

    @cached_property
    def stiffness(self) -> Array:
        """Stiffness of the elements on each displacement, all stuck."""
        return np.array([k.sum() for k, _ in self.groups])

    @property
    def limit(self) -> float:
        """Smallest displacement at which an element slips."""
        return float(min((f / k).min() for k, f in self.groups))

    @property
    def reach(self) -> float:
        """Largest displacement at which an element slips."""
        return float(max((f / k).max() for k, f in self.groups))

    def along(self, shape: Array) -> Elements:
        """Return the elements projected on one modal shape."""
        return replace(self, rows=(self.rows @ shape)[:, None], coupling=np.zeros_like(self.coupling))

    def softened(self, share: float) -> Elements:
        """Return elements with a share of the stiffness and the same slip forces."""
        return replace(self, groups=tuple((share * k, f) for k, f in self.groups))

    def cycles(self, displacements: Array) -> list[Cycle]:
        """Return the cycles of the elements for displacements of shape (points, displacements, functions)."""
        return [cycle(displacements[:, k], *group) for k, group in enumerate(self.groups)]


def stuck(equations: ModalPolynomials, elements: Elements, share: float = 1.0) -> Array:
    """Return the stiffness of the modal equations with a share of all elements stuck, shape (modes, modes)."""
    k = np.diag(share * elements.stiffness)
    force = np.linalg.solve(np.eye(len(k)) + k @ elements.coupling, k @ elements.rows)
    return np.asarray(np.diag(equations.omega**2) + elements.rows.T @ force)


class _Based(NamedTuple):
    """Linearised modal equations: w0, G, and the function from forces to modal coordinates (points, size)."""

    displacement: Array
    flexibility: Array
    modal: Callable[[Array, slice | NDArray[np.intp]], Array]


@dataclass(frozen=True, eq=False)
class SlipBalance:
    """The balance of modal equations with elements.

    Attributes
    ----------
    equations : ModalPolynomials
    basis : Basis
        The constant and all harmonics up to a highest one, or the constant and one harmonic.
    elements : Elements
    statics : ndarray, shape (displacements, known functions), optional
        Contribution of known functions of time to the displacements, without the modes.
    """

    equations: ModalPolynomials
    basis: Basis
    elements: Elements
    statics: Array | None = None

    @cached_property
    def _balance(self) -> Balance:
        return Balance(self.equations, self.basis)

    @property
    def modal_size(self) -> int:
        """Number of modal unknowns; those of the displacements follow them."""
        return self.equations.modes * self.basis.size

    @property
    def size(self) -> int:
        """Number of unknowns."""
        return self.modal_size + len(self.elements.groups) * self.basis.size

    @cached_property
    def constant(self) -> bool:
        """Whether the modal equations are linear with constant coefficients."""
        terms = (*self.equations.energies, *self.equations.forces)
        return not any(term.positions or term.velocities for term in terms)

    @cached_property
    def linear(self) -> bool:
        """Whether the modal equations are linear."""
        return self.equations.degree == 1

    def coefficients(self, unknowns: Array) -> Array:
        """Return the modal part of unknowns (points, size) as (points, modes, functions)."""
        return unknowns[:, : self.modal_size].reshape(-1, self.equations.modes, self.basis.size)

    def displacements(self, unknowns: Array) -> Array:
        """Return the displacements of the elements, shape (points, displacements, functions)."""
        return unknowns[:, self.modal_size :].reshape(len(unknowns), -1, self.basis.size)

    def start(self, coefficients: Array) -> Array:
        """Return unknowns from modal coefficients (points, modes, functions), with displacements without coupling."""
        w = self.elements.rows @ coefficients
        return np.concatenate([part.reshape(len(coefficients), -1) for part in (coefficients, w)], axis=1)

    def embedded(self, unknowns: Array, harmonics: int) -> Array:
        """Extend unknowns with fewer harmonics to unknowns of this balance."""
        own, rows = len(self.basis.sines), self.equations.modes + len(self.elements.groups)
        old = unknowns.reshape(len(unknowns), rows, 2 * harmonics + 1)
        new = np.zeros((len(unknowns), rows, 2 * own + 1))
        new[..., : harmonics + 1], new[..., own + 1 : own + 1 + harmonics] = np.split(old, [harmonics + 1], axis=-1)
        return new.reshape(len(unknowns), -1)

    # ------------------------------------------------------------------------------------------- linearised modes

    def _based(self, q: Array, frequency: Array, causes: Array | None) -> _Based:
        found = (
            self._receptance(frequency, causes) if self.constant else self._dense_linearisation(q, frequency, causes)
        )
        if self.statics is None or causes is None:
            return found
        own = self.statics @ self.waves(causes)
        return found._replace(displacement=found.displacement + own.reshape(len(own), -1))

    def waves(self, causes: Array) -> Array:
        """Return known functions, (points, known functions, samples), in the basis."""
        left = self.basis.weights / self.basis.samples * self.basis.values(self.basis.phase)
        return np.asarray(causes @ left)

    def _rigid(self) -> NDArray[np.bool_]:
        return np.asarray(self.equations.omega == 0.0)

    def _receptance(self, frequency: Array, causes: Array | None) -> _Based:
        """Return the linearised equations of modes with constant coefficients, by harmonic."""
        h, n, b = len(self.basis.sines), self.equations.modes, self.elements.rows
        points, m = len(frequency), len(b)
        k = np.array(self.basis.cosines) * frequency[:, None]
        z = (1j * k)[..., None, None] * self.equations.damping + np.diag(self.equations.omega**2)
        z = z - (k**2)[..., None, None] * np.eye(n)
        z[:, 0] += (
            np.diag(self._rigid()) * frequency[:, None, None] ** 2
        )  # a free rigid-body mode has no static position
        load = self._complex(self._loads(points, causes))
        right = np.concatenate([load[..., None], np.broadcast_to(b.T, (points, h + 1, n, m))], axis=-1)
        answer = np.linalg.solve(z, right.astype(complex))
        own, by = answer[..., 0], answer[..., 1:]
        flexibility = self._real(np.asarray(b @ by + self.elements.coupling, complex))

        def modal(forces: Array, rows: slice | NDArray[np.intp]) -> Array:
            total = own[rows] - (by[rows] @ self._complex(forces.reshape(len(forces), m, -1))[..., None])[..., 0]
            return self._functions(total).reshape(len(forces), -1)

        return _Based(self._functions(own @ b.T).reshape(points, -1), flexibility, modal)

    def _loads(self, points: int, causes: Array | None) -> Array:
        """Return the loads in the basis, shape (points, modes, functions)."""
        basis, n = self.basis, self.equations.modes
        if not self.equations.forces:
            return np.zeros((points, n, basis.size))
        still = np.zeros((points * basis.samples, n))
        flat = None if causes is None else causes.swapaxes(0, 1).reshape(causes.shape[1], -1)
        force = self.equations.derivatives(still, still, flat).force.reshape(points, basis.samples, n)
        left = basis.weights / basis.samples * basis.values(basis.phase)
        return np.asarray(np.einsum("psn,sm->pnm", force, left))

    def _complex(self, coefficients: Array) -> NDArray[np.complex128]:
        """Return (points, harmonics, ...) of (points, ..., functions)."""
        h = len(self.basis.sines)
        found = coefficients[..., : h + 1].astype(complex)
        found[..., 1:] -= 1j * coefficients[..., h + 1 :]
        return np.moveaxis(found, -1, 1)

    def _functions(self, harmonics: NDArray[np.complex128]) -> Array:
        """Return (points, ..., functions) of (points, harmonics, ...)."""
        moved = np.moveaxis(harmonics, 1, -1)
        return np.concatenate([moved.real, -moved.imag[..., 1:]], axis=-1)

    def _real(self, factors: NDArray[np.complex128]) -> Array:
        """Return factors at each harmonic, (points, harmonics, m, m), as matrices between functions."""
        points, count, m, _ = factors.shape
        found = np.zeros((points, m, 2 * count - 1, m, 2 * count - 1))
        k, s = np.arange(count), np.arange(count, 2 * count - 1)
        moved = factors.transpose(1, 0, 2, 3)
        found[:, :, k, :, k] = moved.real
        found[:, :, s, :, s] = moved.real[1:]
        found[:, :, k[1:], :, s] = moved.imag[1:]
        found[:, :, s, :, k[1:]] = -moved.imag[1:]
        return found.reshape(points, m * (2 * count - 1), -1)

    def _dense_linearisation(self, q: Array, frequency: Array, causes: Array | None) -> _Based:
        """Return parametric or nonlinear modes, linearised at coordinates (points, modal size)."""
        b, size = self.elements.rows, self.basis.size
        balanced = self._balance.at(q, frequency, causes)
        residual, jacobian = balanced.residual, balanced.jacobian()
        still = np.flatnonzero(self._rigid()) * size
        jacobian[:, still, still] -= frequency[:, None] ** 2
        residual[:, still] -= frequency[:, None] ** 2 * q[:, still]
        spread = np.kron(b.T, np.eye(size))
        right = np.concatenate([residual[..., None], np.broadcast_to(spread, (len(q), *spread.shape))], axis=-1)
        answer = np.linalg.solve(jacobian, right)
        own, by = q - answer[..., 0], -answer[..., 1:]
        flexibility = spread.T @ by + np.kron(self.elements.coupling, np.eye(size))

        def modal(forces: Array, rows: slice | NDArray[np.intp]) -> Array:
            return np.asarray(own[rows] - (by[rows] @ forces[..., None])[..., 0])

        return _Based(own @ spread, flexibility, modal)

    # --------------------------------------------------------------------------------------------------- answers

    def newton(
        self,
        unknowns: Array,
        frequency: Array,
        causes: Array | None = None,
        tolerance: float = 1e-11,
        most: int = 40,
        alike: NDArray[np.intp] | None = None,
    ) -> tuple[Array, NDArray[np.bool_]]:
        """Return solutions from starting points, many at once, and which converged.

        Parameters
        ----------
        unknowns : ndarray, shape (points, size)
        frequency : ndarray, shape (points,)
            Of the basis.
        causes : ndarray, shape (points, known functions, samples), optional
        tolerance : float
            Change of a displacement at convergence, relative to the motion or to the displacement of first slip.
        most : int
            Iterations.
        alike : ndarray of int, shape (points,), optional
            Points with the same number share a solution: once one of them has converged, the others are dropped.
        """
        n = self.modal_size
        q, w = unknowns[:, :n].copy(), unknowns[:, n:].copy()
        done, lost, open_ = np.zeros(len(q), bool), np.zeros(len(q), bool), np.arange(len(q))
        based = self._based(q, frequency, causes)
        share, before = np.ones(len(q)), np.full(len(q), np.inf)
        step_w, step_q = np.zeros_like(w), np.zeros_like(q)
        for _ in range(most):
            rows: slice | NDArray[np.intp] = open_
            if not self.linear:
                some = None if causes is None else causes[open_]
                based, rows = self._based(q[open_], frequency[open_], some), slice(None)
            force, slope = self.forces(w[open_])
            wrong = based.displacement[rows] - (based.flexibility[rows] @ force[..., None])[..., 0] - w[open_]
            own = based.modal(force, rows) - q[open_] if not self.linear else np.zeros((len(open_), 0))
            size = np.linalg.norm(wrong, axis=1) + np.linalg.norm(own, axis=1)
            scale = np.linalg.norm(w[open_], axis=1) + np.linalg.norm(based.displacement[rows], axis=1)
            good = size <= tolerance * (scale + self.elements.limit)
            if self.linear and good.any():
                q[open_[good]] = based.modal(force[good], open_[good])
            done[open_[good]] = True
            if alike is not None and good.any():
                lost |= np.isin(alike, alike[done]) & ~done
            worse = ~good & (size > before[open_]) & (share[open_] > 0.5**_HALVINGS)
            lost[open_] |= ~np.isfinite(size)
            self._halve(open_[worse], share, (w, step_w), (q, step_q))
            keep = ~good & ~worse & np.isfinite(size)
            moved = open_[keep]
            if moved.size:
                some_rows = moved if self.linear else np.flatnonzero(keep)
                step_w[moved], step_q[moved] = self._step(
                    based, some_rows, force[keep], slope[keep], wrong[keep], own[keep]
                )
                share[moved], before[moved] = 1.0, size[keep]
                w[moved] += step_w[moved]
                if not self.linear:
                    q[moved] += step_q[moved]
            open_ = np.flatnonzero(~done & ~lost)
            if not open_.size:
                break
        return np.concatenate([q, w], axis=1), done

    def stuck_motion(self, frequency: Array, causes: Array | None, share: float) -> Array:
        """Return unknowns of the motion with a share of the stuck stiffness for the elements, linearised at rest."""
        based = self._based(np.zeros((len(frequency), self.modal_size)), frequency, causes)
        springs = np.repeat(share * self.elements.stiffness, self.basis.size)
        matrix = np.eye(springs.size) + based.flexibility * springs
        w = np.linalg.solve(matrix, based.displacement[..., None])[..., 0]
        return np.concatenate([based.modal(springs * w, np.arange(len(frequency))), w], axis=1)

    def stiffened(self, frequency: Array, causes: Array | None) -> tuple[Array, NDArray[np.bool_]]:
        """Return solutions by continuation in the stiffness, from elements so soft that all stick, and which succeeded.

        The slip forces are held fixed. Where elements are stiff relative to the modes, solutions change little along
        the way, whereas starts with all or no elements stuck are far from them.
        """
        free = self.stuck_motion(frequency, causes, 0.0)
        largest = np.abs(free[:, self.modal_size :]).sum(axis=1).max()
        softest = 0.5 * min(1.0, self.elements.limit / max(float(largest), 1e-300))
        found = self.stuck_motion(frequency, causes, softest)
        return self._continued(found, (softest, 1.0), frequency, causes, _PARTS)

    def _continued(
        self, start: Array, shares: tuple[float, float], frequency: Array, causes: Array | None, parts: int
    ) -> tuple[Array, NDArray[np.bool_]]:
        """Continue solutions from the first share of the stiffness to the second, halving the step if necessary."""
        soft = replace(self, elements=self.elements.softened(shares[1]))
        found, good = soft.newton(start, frequency, causes, most=_LED)
        left = np.flatnonzero(~good)
        middle = float(np.sqrt(shares[0] * shares[1]))
        for pair in ((shares[0], middle), (middle, shares[1])):
            if left.size and parts:
                some = None if causes is None else causes[left]
                found[left], good[left] = self._continued(
                    start[left] if pair[1] == middle else found[left], pair, frequency[left], some, parts - 1
                )
                left = left[good[left]]
        return found, good

    @staticmethod
    def _halve(which: NDArray[np.intp], share: Array, *moved: tuple[Array, Array]) -> None:
        """Halve the last step of some points."""
        share[which] *= 0.5
        for place, step in moved:
            place[which] -= share[which, None] * step[which]

    def forces(self, w: Array) -> tuple[Array, Array]:
        """Return the harmonics of the forces, and their rates (points, displacements, functions, functions)."""
        cycles = self.elements.cycles(w.reshape(len(w), -1, self.basis.size))
        force = np.concatenate([c.force for c in cycles], axis=1)
        return force, np.stack([c.jacobian for c in cycles], axis=1)

    def _step(
        self, based: _Based, rows: NDArray[np.intp], force: Array, slope: Array, wrong: Array, own: Array
    ) -> tuple[Array, Array]:
        flexibility, size = based.flexibility[rows], self.basis.size
        matrix = np.empty_like(flexibility)
        for k in range(slope.shape[1]):
            part = slice(k * size, (k + 1) * size)
            matrix[:, :, part] = flexibility[:, :, part] @ slope[:, k]
        diagonal = np.arange(matrix.shape[1])
        matrix[:, diagonal, diagonal] += 1.0
        try:
            step: Array = np.asarray(np.linalg.solve(matrix, wrong[..., None])[..., 0], float)
        except np.linalg.LinAlgError:
            step = np.stack([np.linalg.lstsq(a, b, rcond=None)[0] for a, b in zip(matrix, wrong, strict=True)])
        if self.linear:
            return step, np.zeros((len(step), self.modal_size))
        moved = np.einsum("pdml,pdl->pdm", slope, step.reshape(len(step), -1, size)).reshape(len(step), -1)
        return step, own + based.modal(force + moved, rows) - based.modal(force, rows)
