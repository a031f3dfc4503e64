r"""Damped nonlinear modes with elastic-slip elements: motions held periodic by modal damping of opposite sign.

The extended periodic motion concept (M. Krack, Computers and Structures 154, 2015): with the damping ratio zeta of a
motion, the equations :math:`\ddot q + (C - 2\zeta\omega)\dot q + \Omega^2 q + \ldots + B^T F = 0` have a periodic
solution for each amplitude, and zeta is a property of the motion, as omega is.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from cra_sym.cached import cached_property
from cra_sym.solvers.harmonic_balance import Balance, peak
from cra_sym.solvers.slip_balance import SlipBalance, stuck

__all__ = ["Held", "MotionsAtAmplitude"]

Array = NDArray[np.float64]
_TOLERANCE = 1e-11
_ITERATIONS = 30
_LARGEST = 0.5  # relative step


@dataclass(frozen=True, eq=False)
class Held:
    """Motions that are made periodic by modal damping of opposite sign.

    Attributes
    ----------
    coefficients : ndarray, shape (points, modes, functions)
    displacements : ndarray, shape (points, displacements, functions)
    frequency, ratio : ndarray, shape (points,)
        omega and zeta.
    good : ndarray of bool, shape (points,)
        Whether they converged.
    """

    coefficients: Array
    displacements: Array
    frequency: Array
    ratio: Array
    good: NDArray[np.bool_]

    def __getitem__(self, rows: NDArray[np.intp]) -> Held:
        """Return some of them."""
        return Held(
            self.coefficients[rows], self.displacements[rows], self.frequency[rows], self.ratio[rows], self.good[rows]
        )

    def put(self, rows: NDArray[np.intp], others: Held) -> None:
        """Replace some of them."""
        self.coefficients[rows], self.displacements[rows] = others.coefficients, others.displacements
        self.frequency[rows], self.ratio[rows], self.good[rows] = others.frequency, others.ratio, others.good

    def scaled(self, factor: Array) -> Held:
        """Return starts of other amplitudes."""
        by = factor[:, None, None]
        return Held(self.coefficients * by, self.displacements * by, self.frequency, self.ratio, self.good)


class _IterationState(NamedTuple):
    """State of the iteration: forces and their rates, rates of the peak by modes and forces, error of the peak."""

    coefficients: Array
    displacements: Array
    frequency: Array
    ratio: Array
    force: Array
    slope: Array
    gradient: Array
    by_force: Array
    beyond: Array


@dataclass(frozen=True, eq=False)
class MotionsAtAmplitude:
    """The equations of one mode's motions.

    Attributes
    ----------
    balance : SlipBalance
        Its modal equations hold no known functions of time.
    mode : int
        From 0.
    rows : ndarray, shape (modes,)
        Of the displacement whose peak is the amplitude.
    statics : ndarray, shape (displacements,)
        Contribution of a force on each element displacement to that displacement, beyond the modes, with opposite sign.
    """

    balance: SlipBalance
    mode: int
    rows: Array
    statics: Array

    @cached_property
    def active(self) -> NDArray[np.intp]:
        """Functions in use: odd harmonics alone where the equations are unchanged under q -> -q."""
        orders = self.balance.basis.orders.astype(int)
        return np.flatnonzero(orders % 2 == 1) if self.balance.equations.odd else np.arange(orders.size)

    def linear(self, amplitudes: Array) -> Held:
        """Return starts with the elements' equivalent stiffness and loss at each amplitude, found by iteration."""
        balance, elements = self.balance, self.balance.elements
        n, size = balance.equations.modes, balance.basis.size
        frequency, ratio = np.empty(len(amplitudes)), np.empty(len(amplitudes))
        coefficients = np.zeros((len(amplitudes), n, size))
        for k, amplitude in enumerate(amplitudes):
            share, lost = np.ones(len(elements.groups)), np.zeros(len(elements.groups))
            for _ in range(40):
                square, shapes = np.linalg.eigh(self._stiffness(share))
                shape = shapes[:, self.mode]
                shape = shape * amplitude / (self.rows @ shape)
                before = share
                share, lost = self._equivalent(np.abs(elements.rows @ shape))
                if np.abs(share - before).max() < 1e-6:
                    break
            frequency[k] = np.sqrt(square[self.mode])
            ratio[k] = lost.sum() / (2 * np.pi * square[self.mode] * (shape @ shape))
            ratio[k] += shape @ balance.equations.damping @ shape / (2 * frequency[k] * (shape @ shape))
            coefficients[k, :, 1] = shape
        w = elements.rows @ coefficients
        return Held(coefficients, w, frequency, ratio, np.zeros(len(amplitudes), bool))

    def _stiffness(self, share: Array) -> Array:
        rows, springs = self.balance.elements.rows, share * self.balance.elements.stiffness
        return np.asarray(np.diag(self.balance.equations.omega**2) + (rows.T * springs) @ rows)

    def _equivalent(self, sizes: Array) -> tuple[Array, Array]:
        """Return equivalent stiffness over stuck stiffness, and the loss, of the elements on each displacement."""
        shares, losses = np.ones(sizes.size), np.zeros(sizes.size)
        waves = sizes[None, :, None] * np.array([0.0, 1.0, 0.0])
        for k, found in enumerate(self.balance.elements.cycles(waves)):
            losses[k] = found.loss[0]
            if sizes[k] > 0:
                shares[k] = found.force[0, 1] / (sizes[k] * found.stiffness.sum())
        return shares, losses

    def solved(self, start: Held, amplitudes: Array) -> Held:
        """Return the motions of given amplitudes near a starting point, by Newton's method."""
        x = start.coefficients.copy()
        w, frequency, ratio = start.displacements.copy(), start.frequency.copy(), start.ratio.copy()
        good, open_ = np.zeros(len(x), bool), np.arange(len(x))
        active = self.active
        for _ in range(_ITERATIONS if len(x) else 0):
            step_x, step_w, step_f, step_z = self._step(
                x[open_], w[open_], frequency[open_], ratio[open_], amplitudes[open_]
            )
            size = np.linalg.norm(x[open_].reshape(len(open_), -1), axis=1)
            length = np.linalg.norm(step_x.reshape(len(open_), -1), axis=1) / size
            length = np.maximum(length, np.abs(step_f) / frequency[open_])
            alive = np.isfinite(length) & np.isfinite(step_z)
            factor = np.where(alive, np.minimum(1.0, _LARGEST / np.maximum(length, 1e-300)), 0.0)
            x[np.ix_(open_, np.arange(x.shape[1]), active)] += factor[:, None, None] * np.nan_to_num(step_x)
            w[open_] += factor[:, None, None] * np.nan_to_num(step_w)
            frequency[open_] += factor * np.nan_to_num(step_f)
            ratio[open_] += factor * np.nan_to_num(step_z)
            done = alive & (length < _TOLERANCE)
            good[open_[done]] = True
            open_ = open_[alive & ~done & (frequency[open_] > 0)]
            if not open_.size:
                break
        return Held(x, w, frequency, ratio, good)

    def _step(
        self, x: Array, w: Array, frequency: Array, ratio: Array, amplitudes: Array
    ) -> tuple[Array, Array, Array, Array]:
        """Return the steps of the active coefficients, the displacements, omega and zeta."""
        basis, points = self.balance.basis, len(x)
        force, slope = self.balance.forces(w.reshape(points, -1))
        series = self.series(x, force)
        largest, phase = peak(basis, np.ones(1), series[:, None])
        values = basis.values(phase)
        values *= np.sign((series * values).sum(axis=1))[:, None]
        gradient = self.rows[:, None] * values[:, None, self.active]
        by_force = -self.statics[:, None] * values[:, None]
        state = _IterationState(x, w, frequency, ratio, force, slope, gradient, by_force, largest - amplitudes)
        return self._condensed(state) if self._linear else self._whole(state)

    def series(self, coefficients: Array, force: Array) -> Array:
        """Return the displacement whose peak is the amplitude, shape (points, functions)."""
        shape = len(coefficients), self.statics.size, -1
        return np.asarray(self.rows @ coefficients - self.statics @ force.reshape(shape))

    def _whole(self, state: _IterationState) -> tuple[Array, Array, Array, Array]:
        """Return the step from the equations of all modes."""
        balance, active = self.balance, self.active
        x, w = state.coefficients, state.displacements
        points, n, size = x.shape
        m, b = len(balance.elements.groups), balance.elements.rows
        residual, jacobian, by_frequency, by_ratio = self._modal(x, state.frequency, state.ratio)
        apart = np.zeros((points, m, size, m, size))
        for k in range(m):
            apart[:, k, :, k] = state.slope[:, k]
        spread = apart.reshape(points, m * size, m * size)
        coupling = np.kron(balance.elements.coupling, np.eye(size))
        own = np.eye(m * size) + coupling @ spread
        wrong = (b @ x).reshape(points, -1) - state.force @ coupling.T - w.reshape(points, -1)
        effective = np.swapaxes(np.linalg.solve(np.swapaxes(own, 1, 2), np.swapaxes(spread, 1, 2)), 1, 2)
        acting = (state.force + (effective @ wrong[..., None])[..., 0]).reshape(points, m, size)
        residual = residual - b.T @ acting
        blocks = effective.reshape(points, m, size, m, size)
        jacobian = jacobian - np.einsum("di,pdmel,ej->pimjl", b, blocks, b, optimize=True)

        number = n * active.size
        matrix, right = np.zeros((points, number + 2, number + 2)), np.zeros((points, number + 2))
        matrix[:, :number, :number] = jacobian[:, :, active][..., active].reshape(points, number, number)
        matrix[:, :number, number] = by_frequency[..., active].reshape(points, -1)
        matrix[:, :number, number + 1] = by_ratio[..., active].reshape(points, -1)
        right[:, :number] = residual[..., active].reshape(points, -1)
        followed = (state.by_force.reshape(points, 1, -1) @ effective).reshape(points, m, size)
        whole_gradient = state.gradient + (b.T @ followed)[..., active]
        matrix[:, number, :number] = whole_gradient.reshape(points, -1)
        right[:, number] = state.beyond + (followed.reshape(points, -1) * wrong).sum(axis=1)
        first_sine = self.mode * active.size + int(np.flatnonzero(active == len(balance.basis.cosines))[0])
        matrix[:, number + 1, first_sine] = 1.0
        right[:, number + 1] = x[:, self.mode, len(balance.basis.cosines)]
        step = -_solve(matrix, right)
        step_x = step[:, :number].reshape(points, n, -1)
        whole = np.zeros_like(x)
        whole[..., active] = step_x
        moved = wrong + (b @ whole).reshape(points, -1)
        step_w = np.asarray(np.linalg.solve(own, moved[..., None])[..., 0], float).reshape(w.shape)
        return step_x, step_w, step[:, number], step[:, number + 1]

    def _condensed(self, state: _IterationState) -> tuple[Array, Array, Array, Array]:
        """Return the step for linear modes, all eliminated but the first harmonic of the mode that is followed.

        Its equation is nearly singular when the elements have little effect, so a spring is added and its force is an
        unknown.
        """
        elements, active, mode = self.balance.elements, self.active, self.mode
        b, m, half = elements.rows, len(elements.groups), active.size // 2
        points, n = len(state.coefficients), len(b.T)
        x, w = state.coefficients[..., active], state.displacements[..., active]
        force = state.force.reshape(points, m, -1)[..., active]
        slope = state.slope[:, :, active][..., active]
        k, omega = self.balance.basis.orders[active[:half]], state.frequency[:, None]
        ratio = state.ratio[:, None]
        c = self.balance.equations.damping
        z = (1j * k * omega)[..., None, None] * (c - 2 * (ratio * omega)[..., None, None] * np.eye(n))
        z = z + np.diag(self.balance.equations.omega**2) - ((k * omega) ** 2)[..., None, None] * np.eye(n)
        u, f = (np.moveaxis(part[..., :half] - 1j * part[..., half:], -1, 1) for part in (x, force))
        residual = -(z @ u[..., None])[..., 0] - f @ b
        by_omega = (2 * k**2 * omega + 4j * k * ratio * omega)[..., None] * u - 1j * k[:, None] * (u @ c.T)
        by_ratio = (2j * k * omega**2)[..., None] * u
        spring = omega**2
        z[:, 0, mode, mode] += spring[:, 0]
        own = np.zeros_like(u)
        own[:, 0, mode] = spring[:, 0]
        spread = np.broadcast_to(b.T, (*u.shape, m))
        right = np.concatenate([np.stack([residual, by_omega, by_ratio, own], axis=-1), spread], axis=-1)
        answer = np.asarray(np.linalg.solve(z, right), complex)
        by_force = answer[..., 4:]

        def real(values: NDArray[Any]) -> Array:
            """Return (points, ..., functions) of (points, harmonics, ...)."""
            moved = np.moveaxis(values, 1, -1)
            return np.concatenate([moved.real, -moved.imag], axis=-1)

        size = m * 2 * half
        flexible = _between(np.asarray(b @ by_force + elements.coupling, complex))
        bent = np.concatenate(
            [flexible[:, :, j * 2 * half : (j + 1) * 2 * half] @ slope[:, j] for j in range(m)], axis=2
        )
        held = _between(by_force[:, :, mode : mode + 1])[:, [0, half]]
        held = np.concatenate([held[:, :, j * 2 * half : (j + 1) * 2 * half] @ slope[:, j] for j in range(m)], axis=2)
        seen = [real(answer[..., j] @ b.T).reshape(points, -1) for j in range(3)]
        turned = real(1j * (answer[..., 3] @ b.T)).reshape(points, -1)  # a sine is -i times a cosine
        first = [answer[:, 0, mode, j] for j in range(4)]
        matrix, total = np.zeros((points, size + 4, size + 4)), np.zeros((points, size + 4))
        matrix[:, :size, :size] = np.eye(size) + bent
        matrix[:, :size, size] = -real(answer[..., 3] @ b.T).reshape(points, -1)
        matrix[:, :size, size + 1] = turned
        matrix[:, :size, size + 2], matrix[:, :size, size + 3] = -seen[1], -seen[2]
        wrong = (b @ x).reshape(points, -1) - np.einsum("de,pem->pdm", elements.coupling, force).reshape(points, -1)
        wrong = wrong - w.reshape(points, -1)
        total[:, :size] = seen[0] + wrong
        matrix[:, size : size + 2, :size] = held
        spun = np.stack([first[3], -1j * first[3]], axis=-1)  # of unit cosine and unit sine
        for row, part in ((size, np.real), (size + 1, lambda value: -np.imag(value))):
            matrix[:, row, size : size + 2] = -part(spun)
            matrix[:, row, row] += 1.0
            matrix[:, row, size + 2], matrix[:, row, size + 3] = -part(first[1]), -part(first[2])
            total[:, row] = part(first[0])
        gradient = np.asarray(state.gradient[..., :half] + 1j * state.gradient[..., half:], complex)  # conjugate

        def along(values: NDArray[np.complex128]) -> Array:
            return np.asarray((gradient * np.moveaxis(values, 1, -1)).sum(axis=(1, 2)).real)

        pulled = np.einsum("pnk,pknd->pdk", gradient, by_force)
        pull = np.concatenate([pulled.real, pulled.imag], axis=-1)
        pull = np.concatenate([pull[:, None, j] @ slope[:, j] for j in range(m)], axis=2)[:, 0]
        own_force = state.by_force[..., active]
        followed = np.concatenate([own_force[:, None, j] @ slope[:, j] for j in range(m)], axis=2)[:, 0]
        matrix[:, size + 2, :size] = followed - pull
        matrix[:, size + 2, size] = along(answer[..., 3])
        matrix[:, size + 2, size + 1] = along(-1j * answer[..., 3])
        matrix[:, size + 2, size + 2], matrix[:, size + 2, size + 3] = along(answer[..., 1]), along(answer[..., 2])
        total[:, size + 2] = -state.beyond - along(answer[..., 0])
        matrix[:, size + 3, size + 1] = 1.0
        total[:, size + 3] = -x[:, mode, half]
        step = _solve(matrix, total)
        step_w = step[:, :size].reshape(points, m, 2 * half)
        moved = np.einsum("pdml,pdl->pdm", slope, step_w)
        pushed = np.moveaxis(moved[..., :half] - 1j * moved[..., half:], -1, 1)
        found = answer[..., 0] - (by_force @ pushed[..., None])[..., 0]
        found = found + answer[..., 1] * step[:, size + 2, None, None] + answer[..., 2] * step[:, size + 3, None, None]
        found = found + answer[..., 3] * (step[:, size] - 1j * step[:, size + 1])[:, None, None]
        whole = np.zeros_like(state.displacements)
        whole[..., active] = step_w
        return real(found), whole, step[:, size + 2], step[:, size + 3]

    @cached_property
    def _linear(self) -> bool:
        return not self.balance.equations.energies and not self.balance.equations.forces

    def _modal(self, x: Array, frequency: Array, ratio: Array) -> tuple[Array, Array, Array, Array]:
        """Return the residual of the modes, and its rates by coefficients, omega and zeta, elements left out."""
        equations, basis = self.balance.equations, self.balance.basis
        points, n, size = x.shape
        w = frequency[:, None, None]
        turned = x @ basis.turned.T
        found = Balance(equations, basis).at(x.reshape(points, -1), frequency)
        residual, by_frequency = found.residual.reshape(x.shape), found.by_frequency.reshape(x.shape)
        jacobian = found.jacobian().reshape(points, n, size, n, size)
        by_ratio = 2 * w**2 * turned
        residual = residual + ratio[:, None, None] * by_ratio
        added = (2 * ratio * frequency**2)[:, None, None] * basis.turned
        for k in range(n):
            jacobian[:, k, :, k] += added
        return residual, jacobian, by_frequency + 4 * ratio[:, None, None] * w * turned, by_ratio

    def stuck_frequency(self) -> float:
        """Return the natural frequency with all elements stuck."""
        squares = np.linalg.eigvalsh(stuck(self.balance.equations, self.balance.elements))
        return float(np.sqrt(max(squares[self.mode], 0.0)))


def _between(factors: NDArray[np.complex128]) -> Array:
    """Return factors at each harmonic, (points, harmonics, i, j), as matrices between cosines and sines."""
    points, count, i, j = factors.shape
    found = np.zeros((points, i, 2 * count, j, 2 * count))
    k = np.arange(count)
    moved = factors.transpose(1, 0, 2, 3)
    found[:, :, k, :, k] = found[:, :, k + count, :, k + count] = moved.real
    found[:, :, k, :, k + count], found[:, :, k + count, :, k] = moved.imag, -moved.imag
    return found.reshape(points, i * 2 * count, j * 2 * count)


def _solve(matrix: Array, right: Array) -> Array:
    try:
        return np.asarray(np.linalg.solve(matrix, right[..., None])[..., 0])
    except np.linalg.LinAlgError:
        return np.full_like(right, np.nan)
