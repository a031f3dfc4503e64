r"""Floquet theory for :math:`\ddot q + 2C\dot q + (\Omega^2 + \sum_r g_r(t) P_r)\,q = 0`, many systems at once.

The excitation is :math:`g_r = s_r / (1 + \lambda_r s_r)` with :math:`s_r` epsilon times a cosine or sine of a multiple
of :math:`\varpi t`; :math:`\lambda_r` is nonzero only for the static correction of omitted modes. A step is a
splitting: between kicks of the excitation every mode moves exactly (damped oscillation in closed form), so that the
step size is set by the excitation, not by the highest mode. The kicks are at the Gauss-Legendre nodes; the middle one
includes the commutator that makes the composition fourth order (Laskar and Robutel, 2001). The result is symmetric in
time, and symplectic without damping.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Literal, NamedTuple, Protocol

import numpy as np
from numpy.typing import ArrayLike

__all__ = [
    "ExcitedOscillators",
    "Loop",
    "Oscillation",
    "both_of_pairs",
    "exponents_of",
    "flat",
    "floquet_exponents",
    "growth_of",
    "growth_rate",
    "monodromy",
    "paired_exponents",
    "rate_of",
    "whole_period",
]

_NODES, KICKS = (0.5 * np.array(row) for row in np.polynomial.legendre.leggauss(3))
_NODES = _NODES + 0.5
DRIFTS = np.diff([0.0, *_NODES, 1.0])
#: Weight of the nested commutator in one step: the quadrature error of the double integral of |s - t|.
COMMUTATOR = float(1.0 / 3.0 - KICKS @ np.abs(_NODES[:, None] - _NODES) @ KICKS) / 2
_SQUARES = 14  # of monodromy matrices: 16384 periods
_BLOCK = 512  # systems propagated together, small enough for the cache
MOST_STEPS = 1e7  # steps per period, which take minutes


class Oscillation(NamedTuple):
    """``varpi**power`` times the cosine or sine of ``order * varpi * t``; order 0 with 'cos' is constant."""

    order: int
    kind: Literal["cos", "sin"]
    power: int

    def rate(self) -> tuple[Oscillation, int]:
        """Return the oscillation of the derivative by time, and its factor."""
        other: Literal["cos", "sin"] = "sin" if self.kind == "cos" else "cos"
        return Oscillation(self.order, other, self.power + 1), -self.order if self.kind == "cos" else self.order


@dataclass(frozen=True)
class ExcitedOscillators:
    """A flat batch of periodically excited systems, the batch axis last.

    Attributes
    ----------
    omega, decay : ndarray, shape (N, points)
        Natural frequencies and decay rates c_i = zeta_i omega_i, rad/s and 1/s.
    coupling : ndarray, shape (R, N, N, points) or (R, N, N, 1)
        The matrices P_r.
    compliance : ndarray, shape (R, points)
        lambda_r.
    epsilon : ndarray, shape (R, points)
        Times the power of varpi of each oscillation.
    period : ndarray, shape (points,)
    oscillations : tuple of Oscillation
        One for each of the R terms.
    """

    omega: np.ndarray
    decay: np.ndarray
    coupling: np.ndarray
    compliance: np.ndarray
    epsilon: np.ndarray
    period: np.ndarray
    oscillations: tuple[Oscillation, ...]

    @classmethod
    def of(
        cls,
        omega: ArrayLike,
        coupling: ArrayLike,
        angular_frequency: ArrayLike,
        epsilon: ArrayLike,
        decay: ArrayLike = 0.0,
        compliance: ArrayLike = 0.0,
        oscillations: Sequence[Oscillation] | None = None,
    ) -> tuple[ExcitedOscillators, tuple[int, ...]]:
        """Return the batch and its shape.

        Parameters
        ----------
        omega, decay : array_like, shape (..., N)
        coupling : array_like, shape (..., R, N, N)
        compliance : array_like, shape (..., R)
        angular_frequency, epsilon : array_like, shape (...)
            Excitation frequency varpi, rad/s, positive; epsilon.
        oscillations : sequence of R Oscillation, optional
            By default every one is cos(varpi t).
        """
        omega, coupling = np.asarray(omega, dtype=float), np.asarray(coupling, dtype=float)
        modes, terms = omega.shape[-1], coupling.shape[-3]
        decay = np.broadcast_to(decay, np.broadcast_shapes(np.shape(decay), (modes,)))
        compliance = np.broadcast_to(compliance, np.broadcast_shapes(np.shape(compliance), (terms,)))
        frequency, epsilon = np.asarray(angular_frequency, dtype=float), np.asarray(epsilon, dtype=float)
        shape = np.broadcast_shapes(
            omega.shape[:-1],
            coupling.shape[:-3],
            decay.shape[:-1],
            compliance.shape[:-1],
            frequency.shape,
            epsilon.shape,
        )
        waves = tuple(oscillations or [Oscillation(1, "cos", 0)] * terms)
        if {kind for _, kind, _ in waves} == {"sin"} and len({order for order, _, _ in waves}) == 1:
            waves = tuple(Oscillation(order, "cos", power) for order, _, power in waves)  # a quarter of a period later
        varpi, size = flat(frequency, shape, 0), flat(epsilon, shape, 0)
        shared = coupling.size == terms * modes * modes
        matrices = coupling.reshape(terms, modes, modes, 1) if shared else flat(coupling, shape, 3)
        batch = cls(
            flat(omega, shape, 1),
            flat(decay, shape, 1),
            matrices,
            flat(compliance, shape, 1),
            np.stack([size * varpi**power if power else size for _, _, power in waves]),
            2 * np.pi / varpi,
            waves,
        )
        return batch, shape

    @property
    def mirrored(self) -> bool:
        """Whether couplings are symmetric and the excitation even in time: half a period then gives the whole."""
        even = all(kind == "cos" for _, kind, _ in self.oscillations)
        return even and bool(np.array_equal(self.coupling, self.coupling.swapaxes(1, 2)))

    @property
    def conservative(self) -> bool:
        """Whether all systems are without damping and symmetric in time."""
        return self.mirrored and not self.decay.any()

    def steps(self, tolerance: float) -> np.ndarray:
        """Return the number of steps a period for each system, even, for a relative error of about ``tolerance``."""
        rows = np.abs(self.coupling).sum(axis=2)
        strength = np.sqrt(
            np.einsum("rp,rip->ip", self.epsilon, np.broadcast_to(rows, (*rows.shape[:2], self.period.size)))
        )
        turns = max(1, *(order for order, _, _ in self.oscillations))
        fastest = np.maximum(self.omega.max(axis=0), 2.0 * strength.max(axis=0)) + 2 * np.pi * turns / self.period
        angle = self.period * fastest
        with np.errstate(over="ignore"):
            steps = 0.6 * angle * (angle * 1e-6 / tolerance) ** 0.25  # the method is of fourth order
        if not (steps <= MOST_STEPS).all():
            raise ValueError(
                f"a period takes {steps.max():.2g} steps, must be at most {MOST_STEPS:g}: the excitation is too slow "
                "against the fastest mode, or too strong"
            )
        return np.asarray(2 * np.ceil(np.maximum(steps, 8) / 2).astype(np.int64))

    def take(self, index: np.ndarray) -> ExcitedOscillators:
        """Return some of the systems."""
        shared = self.coupling.shape[-1] == 1
        return ExcitedOscillators(
            self.omega[:, index],
            self.decay[:, index],
            self.coupling if shared else self.coupling[..., index],
            self.compliance[:, index],
            self.epsilon[:, index],
            self.period[index],
            self.oscillations,
        )


class Loop(Protocol):
    """The inner loop, compiled."""

    def __call__(
        self,
        drifts: np.ndarray,
        h: np.ndarray,
        kicks: np.ndarray,
        commutator: float,
        swings: np.ndarray,
        coupling: np.ndarray,
        compliance: np.ndarray,
        epsilon: np.ndarray,
        state: np.ndarray,
    ) -> None:
        """Propagate the states in place.

        Parameters
        ----------
        drifts : ndarray, shape (stages + 1, 2, 2, N, points)
            Free propagators: before each kick, and (last) between steps.
        h : ndarray, shape (points,)
            Step.
        kicks : ndarray, shape (stages,)
            Weights of the kicks.
        commutator : float
            Weight of the commutator in the middle kick.
        swings : ndarray, shape (steps, stages, R)
            The cosines and sines at the kicks.
        coupling, compliance, epsilon : ndarray
            As in :class:`ExcitedOscillators`, with a full batch axis.
        state : ndarray, shape (2N, 2N, points)
        """


def flat(array: np.ndarray, shape: tuple[int, ...], own: int) -> np.ndarray:
    """Return an array whose batch axes are broadcast, made one and put last; ``own`` axes are its own."""
    tail = array.shape[array.ndim - own :]
    flat = np.broadcast_to(array, shape + tail).reshape(-1, *tail)
    return np.ascontiguousarray(np.moveaxis(flat, 0, -1))


def drift_matrix(omega: np.ndarray, decay: np.ndarray, h: np.ndarray) -> np.ndarray:
    """Return the exact propagator of free damped modes over the time h, shape (2, 2, N, points)."""
    square = omega**2 - decay**2
    root = np.sqrt(np.abs(square)) * h
    swinging = square >= 0
    small = root < 1e-4
    ratio = np.where(swinging, np.sin(root), np.sinh(root)) / np.where(small, 1.0, root)
    ratio = np.where(small, 1.0 - np.where(swinging, 1.0, -1.0) * root**2 / 6, ratio) * h
    fall = np.exp(-decay * h)
    level = np.where(swinging, np.cos(root), np.cosh(root))
    return np.asarray(fall * np.array([[level + decay * ratio, ratio], [-(omega**2) * ratio, level - decay * ratio]]))


def _propagate(part: ExcitedOscillators, steps: int, share: float, loop: Loop | None) -> np.ndarray:
    """Return the map over a share of the period, shape (2N, 2N, points), in equal numbers of steps."""
    modes, points = part.omega.shape
    h = part.period * share / steps
    around, between, joined = (drift_matrix(part.omega, part.decay, a * h) for a in (*DRIFTS[:2], 2 * DRIFTS[0]))
    drifts = np.stack([around, between, between, joined])  # before each kick; last: between two steps
    times = np.arange(steps)[:, None] + _NODES
    phase = 2 * np.pi * share / steps * times
    waves = [(np.cos if kind == "cos" else np.sin)(order * phase) for order, kind, _ in part.oscillations]
    swings = np.stack(waves, axis=-1)
    state = np.broadcast_to(np.eye(2 * modes)[:, :, None], (2 * modes, 2 * modes, points)).copy()
    if loop is not None:
        coupling = np.array(np.broadcast_to(part.coupling, (*part.coupling.shape[:3], points)))
        compliance = np.ascontiguousarray(part.compliance)
        epsilon = np.ascontiguousarray(part.epsilon)
        loop(drifts, h, KICKS, COMMUTATOR, swings, coupling, compliance, epsilon, state)
    else:
        _kick_and_drift(drifts[:, :, :, :, None], h, swings, part, state)
    return state


def _kick_and_drift(
    drifts: np.ndarray, h: np.ndarray, swings: np.ndarray, part: ExcitedOscillators, state: np.ndarray
) -> None:
    """Propagate the states in place: `Loop` in NumPy."""
    q, p = state[: len(state) // 2], state[len(state) // 2 :]
    for step, row in enumerate(swings):
        for stage, waves in enumerate(row):
            _drift(drifts[-1 if stage == 0 and step > 0 else stage], q, p)
            swing = part.epsilon * waves[:, None]
            weights = swing / (1.0 + part.compliance * swing)
            force = _force(part.coupling, weights, q)
            p -= KICKS[stage] * h * force
            if stage == 1:
                p += COMMUTATOR * h**3 * _force(part.coupling, weights, force)
    _drift(drifts[0], q, p)


def _drift(m: np.ndarray, q: np.ndarray, p: np.ndarray) -> None:
    moved = m[0, 0] * q
    moved += m[0, 1] * p
    p *= m[1, 1]
    p += m[1, 0] * q
    q[:] = moved


def _force(coupling: np.ndarray, weights: np.ndarray, q: np.ndarray) -> np.ndarray:
    if coupling.shape[-1] == 1:
        flat = q.reshape(len(q), -1)
        total: np.ndarray = sum(g * (m[..., 0] @ flat).reshape(q.shape) for m, g in zip(coupling, weights, strict=True))
        return total
    return np.asarray(sum(np.einsum("ijp,jkp->ikp", g * m, q) for m, g in zip(coupling, weights, strict=True)))


def _maps(batch: ExcitedOscillators, share: float, tolerance: float, loop: Loop | None) -> np.ndarray:
    """Return the maps over a share of the period, shape (points, 2N, 2N)."""
    size, points = 2 * len(batch.omega), batch.period.size
    steps = np.ceil(batch.steps(tolerance) * share).astype(np.int64)
    out = np.empty((points, size, size))
    order = np.argsort(steps, kind="stable")
    for start in range(0, points, _BLOCK):
        block = order[start : start + _BLOCK]
        state = _propagate(batch.take(block), int(steps[block[-1]]), share, loop)
        out[block] = np.moveaxis(state, -1, 0)
    return out


def _whole_maps(batch: ExcitedOscillators, tolerance: float, loop: Loop | None) -> np.ndarray:
    """Return the maps over the period, shape (points, 2N, 2N)."""
    if not batch.mirrored:
        return _maps(batch, 1.0, tolerance, loop)
    damping = np.eye(len(batch.omega)) * 2 * batch.decay.T[:, None]
    return whole_period(_maps(batch, 0.5, tolerance, loop), damping, np.ones(len(batch.omega)))


def whole_period(half: np.ndarray, damping: np.ndarray, parity: np.ndarray) -> np.ndarray:
    r"""Return maps of (q, dq/dt) over a period from those over its first half, shape (points, 2N, 2N).

    Let the matrix A(t) of the equations be even in time and X a constant matrix with :math:`AX = XA^T`. Time reversal
    then gives the adjoint equation transformed by X, so that the map of the second half is :math:`X\Phi^TX^{-1}`. Such
    an X exists where a change of the signs of some q transposes K(t) and the constant C.

    Parameters
    ----------
    half : ndarray, shape (points, 2N, 2N)
    damping : ndarray, shape (points, N, N) or (1, N, N)
        C.
    parity : ndarray, shape (N,)
        The signs, 1 or -1.
    """
    n = len(parity)
    swapped = half.swapaxes(1, 2)
    # X = [[0, P], [P, -C P]], its inverse [[P C, P], [P, 0]]
    above, below = parity[:, None] * swapped[:, :n], parity[:, None] * swapped[:, n:]
    left = np.concatenate([below, above - damping @ below], axis=1)
    first, second = left[:, :, :n] * parity, left[:, :, n:] * parity
    return np.asarray(np.concatenate([first @ damping + second, first], axis=2) @ half)


def monodromy(*system: Any, tolerance: float = 1e-8, loop: Loop | None = None, **more: Any) -> np.ndarray:
    """Return the monodromy matrices of (q, dq/dt), shape (..., 2N, 2N); arguments of :class:`ExcitedOscillators`."""
    batch, shape = ExcitedOscillators.of(*system, **more)
    maps = _whole_maps(batch, tolerance, loop)
    return maps.reshape(*shape, *maps.shape[1:])


def paired_exponents(half: np.ndarray, period: np.ndarray) -> np.ndarray:
    r"""Return one exponent s of each pair (s, -s) of a system without damping, its real part not negative.

    Let the map of the first half of the period be symplectic, in canonical coordinates whose reversal in time keeps the
    displacements and changes the signs of the momenta. The second half of the period is then the first one mirrored:
    with the blocks a, b, c, d of the half-period map, :math:`\sinh^2(sT/2)` are the eigenvalues of :math:`b^Tc`, and
    :math:`\cosh^2(sT/2)` those of :math:`d^Ta`. The smaller of the two is used, so that a double multiplier 1 or -1
    loses no digits.

    Parameters
    ----------
    half : ndarray, shape (points, 2N, 2N)
    period : ndarray, shape (points,)

    Returns
    -------
    complex ndarray, shape (points, N)
    """
    n = half.shape[-1] // 2
    a, b, c, d = half[:, :n, :n], half[:, :n, n:], half[:, n:, :n], half[:, n:, n:]
    sines = np.linalg.eigvals(b.swapaxes(1, 2) @ c).astype(complex)
    cosines = np.linalg.eigvals(d.swapaxes(1, 2) @ a).astype(complex)
    nearest = np.abs(1.0 + sines[:, :, None] - cosines[:, None, :]).argmin(axis=-1)
    cosines = np.take_along_axis(cosines, nearest, axis=-1)
    exponents = np.where(sines.real > -0.5, np.arcsinh(np.sqrt(sines)), np.arccosh(np.sqrt(cosines)))
    return np.asarray(2 * exponents / period[:, None])


def both_of_pairs(growing: np.ndarray, period: np.ndarray) -> np.ndarray:
    """Return all exponents, in the order of :func:`floquet_exponents`, from one of each pair."""
    return _ordered(np.concatenate([growing, -growing], axis=-1), period)


def growth_of(growing: np.ndarray) -> np.ndarray:
    """Return the largest growth rate, not below zero, from one exponent of each pair."""
    return np.asarray(np.maximum(growing.real.max(axis=-1), 0.0))


def floquet_exponents(*system: Any, tolerance: float = 1e-8, loop: Loop | None = None, **more: Any) -> np.ndarray:
    """Return all Floquet exponents, shape (..., 2N), largest real part first; arguments of :class:`ExcitedOscillators`.

    Their imaginary parts are fixed up to multiples of the excitation frequency and given between -1/2 and 1/2 of it.
    """
    batch, shape = ExcitedOscillators.of(*system, **more)
    if batch.conservative:
        exponents = both_of_pairs(paired_exponents(_maps(batch, 0.5, tolerance, loop), batch.period), batch.period)
    else:
        exponents = exponents_of(_whole_maps(batch, tolerance, loop), batch.period)
    return exponents.reshape(*shape, exponents.shape[-1])


def exponents_of(maps: np.ndarray, period: np.ndarray) -> np.ndarray:
    """Return the exponents of monodromy matrices (points, 2N, 2N), in the order of :func:`floquet_exponents`."""
    return _ordered(np.log(np.linalg.eigvals(maps).astype(complex)) / period[:, None], period)


def _ordered(exponents: np.ndarray, period: np.ndarray) -> np.ndarray:
    order = np.lexsort((exponents.imag, -np.round(exponents.real * period[:, None], 9)), axis=-1)
    return np.take_along_axis(exponents, order, axis=-1)


def rate_of(maps: np.ndarray, period: np.ndarray, *, damped: bool) -> np.ndarray:
    """Return max(0, largest real part of the exponents) of monodromy matrices (points, 2N, 2N).

    Damped systems most of whose points are stable are decided by powers: where the norm of one is below 1, so are all
    multipliers. Eigenvalues cost fifty times as much as a square.
    """
    rates, left, power = np.zeros(len(maps)), np.arange(len(maps)), maps
    for _ in range(_SQUARES if damped else 0):
        with np.errstate(over="ignore", invalid="ignore"):
            power = power @ power
            undecided = ~(np.einsum("pij,pij->p", power, power) < 0.25)  # far from 1, for the rounding
        if not undecided.all():
            left, power = left[undecided], power[undecided]
    multipliers = np.abs(np.linalg.eigvals(maps[left])).max(axis=-1)
    rates[left] = np.maximum(np.log(multipliers) / period[left], 0.0)
    return rates


def growth_rate(*system: Any, tolerance: float = 1e-8, loop: Loop | None = None, **more: Any) -> np.ndarray:
    """Return max(0, largest real part of the exponents), shape (...); arguments of :class:`ExcitedOscillators`."""
    batch, shape = ExcitedOscillators.of(*system, **more)
    if batch.conservative:
        rates = growth_of(paired_exponents(_maps(batch, 0.5, tolerance, loop), batch.period))
    else:
        rates = rate_of(_whole_maps(batch, tolerance, loop), batch.period, damped=bool(batch.decay.any()))
    found: np.ndarray = rates.reshape(shape)
    return found
