r"""Monodromy matrices of any equations of second order with periodic coefficients, many systems at once.

.. math:: \frac{d}{dt}\Bigl(\dot q + \sum_r g_r (M_r\dot q + B_r q)\Bigr) + \Bigl(C + \sum_r g_r C_r\Bigr)\dot q
          + \Bigl(K + \sum_r g_r K_r\Bigr) q = 0

with :math:`g_r` epsilon times a cosine or sine of a multiple of :math:`\varpi t`. The state is q and the momentum p
under the derivative by time. Each step is a Taylor series, whose coefficients are sums over those of the cosines; all
systems take the same number of steps a period, so these are plain numbers.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cra_sym.solvers.floquet import MOST_STEPS, Oscillation, exponents_of, flat, rate_of, whole_period

__all__ = ["PeriodicSystem", "Swing", "floquet_exponents", "growth_rate", "monodromy", "step_coefficients"]

Array = NDArray[np.float64]
_HIGHEST = 24
"""Order of the series, at most."""
_WIDEST = 3.0  # step, in units of the fastest motion's time: beyond, the terms of a series lose digits
_FASTER, _MUCH_FASTER = 1.25, 2.0
"""How much faster than the rate a series may grow where stiffness oscillates, and where masses and speeds do too."""
_PRODUCTS = (
    31  # what the products of matrices for one term cost, in halves of one term of a sum over products of series
)
_BLOCK = 384  # systems propagated together, small enough for the cache


@dataclass(frozen=True)
class Swing:
    """One oscillating term; matrices (N, N, points) or (N, N, 1), None where there is nothing.

    Attributes
    ----------
    oscillation : Oscillation
    size : ndarray, shape (points,)
        epsilon times the power of varpi.
    stiffness, damping, momentum, mass : ndarray or None
        K_r, C_r, B_r, M_r.
    """

    oscillation: Oscillation
    size: Array
    stiffness: Array | None
    damping: Array | None
    momentum: Array | None
    mass: Array | None

    @property
    def only_stiffness(self) -> bool:
        """Whether nothing else oscillates."""
        return self.damping is None and self.momentum is None and self.mass is None

    def take(self, index: NDArray[np.intp]) -> Swing:
        """Return some of the systems."""
        matrices = (self.stiffness, self.damping, self.momentum, self.mass)
        return Swing(self.oscillation, self.size[index], *(_some(matrix, index) for matrix in matrices))


@dataclass(frozen=True)
class PeriodicSystem:
    """A flat batch of systems, the batch axis last.

    Attributes
    ----------
    stiffness, damping : ndarray, shape (N, N, points) or (N, N, 1)
        K and C.
    swings : tuple of Swing
    period : ndarray, shape (points,)
    """

    stiffness: Array
    damping: Array
    swings: tuple[Swing, ...]
    period: Array

    @classmethod
    def of(
        cls,
        stiffness: Any,
        damping: Any,
        drives: Sequence[tuple[Oscillation, Sequence[Any]]],
        angular_frequency: Any,
        epsilon: Any,
    ) -> tuple[PeriodicSystem, tuple[int, ...]]:
        """Return the batch and its shape.

        Parameters
        ----------
        stiffness, damping : array_like, shape (..., N, N)
        drives : sequence of (oscillation, (stiffness, damping, momentum, mass))
            Matrices (..., N, N) or None.
        angular_frequency, epsilon : array_like, shape (...)
            varpi, rad/s, positive; epsilon.
        """
        given = [np.asarray(m, float) for m in (stiffness, damping)]
        some = [np.asarray(m, float) for _, matrices in drives for m in matrices if m is not None]
        varpi, epsilon = np.asarray(angular_frequency, float), np.asarray(epsilon, float)
        shape = np.broadcast_shapes(*(m.shape[:-2] for m in (*given, *some)), varpi.shape, epsilon.shape)

        def columns(matrix: Any) -> Array | None:
            if matrix is None:
                return None
            matrix = np.asarray(matrix, float)
            single = matrix.size == matrix.shape[-1] * matrix.shape[-2]
            return matrix.reshape(*matrix.shape[-2:], 1) if single else flat(matrix, shape, 2)

        frequency, size = flat(varpi, shape, 0), flat(epsilon, shape, 0)
        swings = tuple(Swing(wave, size * frequency**wave.power, *map(columns, m)) for wave, m in drives)
        whole = [columns(matrix) for matrix in given]
        assert whole[0] is not None and whole[1] is not None
        batch = cls(whole[0], whole[1], swings, 2 * np.pi / frequency)
        batch.check_mass()
        return batch, shape

    def take(self, index: NDArray[np.intp]) -> PeriodicSystem:
        """Return some of the systems."""
        stiffness, damping = (_some(matrix, index) for matrix in (self.stiffness, self.damping))
        assert stiffness is not None and damping is not None
        return PeriodicSystem(stiffness, damping, tuple(s.take(index) for s in self.swings), self.period[index])

    def check_mass(self) -> None:
        """Refuse a mass that need not be positive throughout the period."""
        total = np.zeros_like(self.period)
        for swing in self.swings:
            if swing.mass is not None:
                total = total + np.abs(swing.size) * np.linalg.norm(np.moveaxis(swing.mass, -1, 0), 2, axis=(-2, -1))
        if (total >= 1.0).any():
            raise ValueError(
                f"epsilon: the mass fluctuates by {total.max():.3g} times itself; must be less than once, so that it "
                "stays positive"
            )

    def parity(self) -> NDArray[np.int8] | None:
        """Return signs of q that turn an even K(t) and a constant C into their transposes, None if there are none."""
        if any(s.oscillation.kind == "sin" or not s.only_stiffness for s in self.swings):
            return None
        matrices = (self.stiffness, self.damping, *(s.stiffness for s in self.swings if s.stiffness is not None))
        size = len(self.stiffness)
        same, opposite = np.zeros((2, size, size), bool)  # signs of two
        for matrix in matrices:
            turned = matrix.swapaxes(0, 1)
            there = ((matrix != 0) | (turned != 0)).any(axis=-1)
            even, odd = ((matrix == sign * turned).all(axis=-1) for sign in (1, -1))
            if (there & ~even & ~odd & ~np.eye(size, dtype=bool)).any():
                return None
            same, opposite = same | (there & even), opposite | (there & ~even)
        signs = np.zeros(size, np.int8)
        while not signs.all():
            fresh = [int(np.argmin(signs != 0))]
            signs[fresh] = 1
            while fresh:
                row = fresh.pop()
                for sign, joined in ((1, same[row]), (-1, opposite[row])):
                    found = np.nonzero(joined & (signs == 0))[0]
                    signs[found] = sign * signs[row]
                    fresh.extend(found.tolist())
        product = signs[:, None] * signs
        return None if (same & (product < 0)).any() or (opposite & (product > 0)).any() else signs

    def rate(self) -> Array:
        """Return a bound of how fast anything moves, 1/s, shape (points,)."""
        stiffness, damping, heavy = _rows(self.stiffness), _rows(self.damping), np.zeros(1)
        turns = 1
        for swing in self.swings:
            size = np.abs(swing.size)
            stiffness = stiffness + size * _rows(swing.stiffness)
            damping = damping + size * (_rows(swing.damping) + _rows(swing.momentum))
            heavy = heavy + size * _rows(swing.mass)
            turns = max(turns, swing.oscillation.order)
        light = np.maximum(1.0 - heavy, 0.1)
        return np.asarray(np.sqrt(stiffness / light) + damping / light + 2 * np.pi * turns / self.period)


def _some(matrix: Array | None, index: NDArray[np.intp]) -> Array | None:
    return matrix if matrix is None or matrix.shape[-1] == 1 else matrix[..., index]


def _rows(matrix: Array | None) -> Array:
    """Return the largest sum of absolute values in a row, shape (points,) or (1,)."""
    return np.zeros(1) if matrix is None else np.asarray(np.abs(matrix).sum(axis=1).max(axis=0))


def _applied(matrix: Array, states: Array) -> Array:
    """Return matrix times states, (N, N, points or 1) times (N, columns, points)."""
    if matrix.shape[-1] == 1:
        return np.asarray((matrix[..., 0] @ states.reshape(len(states), -1)).reshape(states.shape))
    return np.asarray(np.einsum("ijp,jkp->ikp", matrix, states))


def step_coefficients(wave: Oscillation, step: int, steps: int, order: int) -> Array:
    """Return the Taylor coefficients of a cosine or sine over one step of a period, as a function of 0 <= tau <= 1."""
    turn = 2 * np.pi * wave.order / steps
    phase = turn * step + (0.0 if wave.kind == "cos" else -np.pi / 2)
    k = np.arange(order + 1)
    factors = np.cumprod(np.concatenate([[1.0], turn / k[1:]]))
    return np.asarray(np.array([np.cos(phase), -np.sin(phase), -np.cos(phase), np.sin(phase)])[k % 4] * factors)


class _Series:
    """Taylor coefficients of q, dq/dtau and p over one step, found one after the other."""

    def __init__(self, system: PeriodicSystem, h: Array, order: int) -> None:
        self.system, self.h, self.order = system, h, order
        size, points = len(system.stiffness), system.period.size
        self.shape = (size, 2 * size, points)
        self.damped = bool(system.damping.any())
        store = (order + 1, *self.shape)
        names = {"stiffness": "q", "momentum": "q", "damping": "u", "mass": "u"}
        self.products = [
            {name: np.empty(store) for name in names if getattr(swing, name) is not None} for swing in system.swings
        ]

    def advanced(self, step: int, steps: int, q: Array, p: Array) -> tuple[Array, Array]:
        """Return the state at the end of a step."""
        waves = [step_coefficients(swing.oscillation, step, steps, self.order) for swing in self.system.swings]
        mass = self._mass(waves)
        end_q, end_p = q.copy(), p.copy()
        for k in range(self.order):
            rate, resistance = self._rates(k, q, p, waves, mass)
            step_size = self.h / (k + 1)
            q, p = step_size * rate, -step_size * resistance
            end_q += q
            end_p += p
        return end_q, end_p

    def _mass(self, waves: list[Array]) -> Array | None:
        """Return the inverse mass at the start of the step, (N, N, points), or None for unit mass."""
        terms = [(s, w[0]) for s, w in zip(self.system.swings, waves, strict=True) if s.mass is not None]
        if not terms:
            return None
        total = np.eye(self.shape[0])[..., None] + sum(s.mass * (s.size * w) for s, w in terms)
        return np.moveaxis(np.linalg.inv(np.moveaxis(total, -1, 0)), 0, -1)

    def _rates(self, k: int, q: Array, p: Array, waves: list[Array], mass: Array | None) -> tuple[Array, Array]:
        """Return the coefficients k of dq/dt and of -dp/dt."""
        rate = p
        for swing, kept, wave in zip(self.system.swings, self.products, waves, strict=True):
            if "momentum" in kept:
                rate = rate - self._convolved(kept["momentum"], swing.momentum, q, wave, k, swing.size)
            if "mass" in kept and k:
                rate = rate - swing.size * _weighed(wave[1 : k + 1], kept["mass"][:k])
        rate = rate if mass is None else _applied(mass, rate)
        resistance = _applied(self.system.stiffness, q)
        if self.damped:
            resistance += _applied(self.system.damping, rate)
        for swing, kept, wave in zip(self.system.swings, self.products, waves, strict=True):
            if "stiffness" in kept:
                resistance += self._convolved(kept["stiffness"], swing.stiffness, q, wave, k, swing.size)
            if "damping" in kept:
                resistance += self._convolved(kept["damping"], swing.damping, rate, wave, k, swing.size)
            if "mass" in kept:
                assert swing.mass is not None
                kept["mass"][k] = _applied(swing.mass, rate)
        return rate, resistance

    def _convolved(self, kept: Array, matrix: Array | None, states: Array, wave: Array, k: int, size: Array) -> Array:
        assert matrix is not None
        kept[k] = _applied(matrix, states)
        found = _weighed(wave[: k + 1], kept[: k + 1])
        found *= size
        return found


def _weighed(wave: Array, kept: Array) -> Array:
    """Return the sum of wave[j] kept[-1 - j]."""
    return np.asarray((wave[::-1] @ kept.reshape(len(kept), -1)).reshape(kept.shape[1:]))


def propagated(system: PeriodicSystem, steps: int, order: int, *, half: bool = False) -> Iterator[tuple[Array, Array]]:
    """Yield (q, p), shape (N, 2N, points), after every step of a period, or of half of it, from every unit state."""
    h = system.period / steps
    series = _Series(system, h, order)
    q, p = (
        np.ascontiguousarray(np.broadcast_to(half[..., None], series.shape))
        for half in np.split(np.eye(series.shape[1]), 2)
    )
    for step in range(steps // 2 if half else steps):
        q, p = series.advanced(step, steps, q, p)
        yield q, p


def monodromy(system: PeriodicSystem, tolerance: float = 1e-8) -> Array:
    """Return the monodromy matrices of (q, p), shape (points, 2N, 2N), for a relative error of about ``tolerance``."""
    angle, parity = system.period * system.rate(), system.parity()
    angle = angle * (_FASTER if all(swing.only_stiffness for swing in system.swings) else _MUCH_FASTER)
    size, points = 2 * len(system.stiffness), system.period.size
    out = np.empty((points, size, size))
    rank = np.argsort(angle, kind="stable")
    for start in range(0, points, _BLOCK):
        block = rank[start : start + _BLOCK]
        steps, order = _cheapest(float(angle[rank[min(start + _BLOCK, points) - 1]]), tolerance)
        end = deque(propagated(system.take(block), steps, order, half=parity is not None), maxlen=1)
        out[block] = np.moveaxis(np.concatenate(end[0]), -1, 0)
    # without oscillating masses and speeds the momentum is dq/dt
    return out if parity is None else whole_period(out, np.moveaxis(system.damping, -1, 0), parity)


def _cheapest(angle: float, tolerance: float) -> tuple[int, int]:
    """Return an even number of steps a period and the order of their series that reach the tolerance at least cost.

    The series of a motion with the rate 1 that ends with the term of order n leaves ``h**(n + 1) / (n + 1)!`` a step.
    """
    orders = np.arange(6, _HIGHEST + 1)
    logs = (orders + 1) * np.log(angle) - np.cumsum(np.log(np.arange(1, _HIGHEST + 2)))[orders] - np.log(tolerance)
    with np.errstate(over="ignore"):
        steps = 2 * np.ceil(np.maximum(np.exp(logs / orders), angle / _WIDEST) / 2)
    cost = steps * orders * (_PRODUCTS + orders)
    best = int(np.argmin(cost))
    if not steps[best] <= MOST_STEPS:
        raise ValueError(
            f"a period takes {steps[best]:.2g} steps, must be at most {MOST_STEPS:g}: the excitation is too slow "
            "against the fastest mode, or too strong"
        )
    return int(steps[best]), int(orders[best])


def growth_rate(*given: Any, tolerance: float = 1e-8) -> Array:
    """Return max(0, largest real part of the exponents), shape (...); arguments of :meth:`PeriodicSystem.of`."""
    system, shape = PeriodicSystem.of(*given)
    return rate_of(monodromy(system, tolerance), system.period).reshape(shape)


def floquet_exponents(*given: Any, tolerance: float = 1e-8) -> NDArray[np.complex128]:
    """Return all Floquet exponents, shape (..., 2N), largest real part first; arguments as :func:`growth_rate`."""
    system, shape = PeriodicSystem.of(*given)
    exponents = exponents_of(monodromy(system, tolerance), system.period)
    return exponents.reshape(*shape, exponents.shape[-1])
