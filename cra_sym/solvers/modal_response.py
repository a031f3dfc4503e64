"""Closed-form response of forced modal oscillators; on uniform grids by exact shifts and one matrix product.

Every oscillator obeys q'' + 2 zeta omega q' + omega^2 q = -gamma w''. Its unit responses come as two callables:
``free(t, omega, zeta)`` with the keys displacement, impulse, step, ramp, and ``forced(t, omega, zeta, varpi)``, the
response to exp(i varpi t).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import NamedTuple

import numpy as np

__all__ = [
    "HarmonicInput",
    "Oscillators",
    "PiecewiseInput",
    "Steady",
    "free_motion",
    "free_peak",
    "knot_states",
    "pick",
    "piecewise_response",
    "segment",
    "steady_response",
]

Array = np.ndarray
_LONG = 64  # number of samples from which the methods for long records are faster
_CHUNK = 1 << 18  # elements of a temporary array


class Oscillators(NamedTuple):
    """Modal oscillators (..., N), their unit responses, and the rows (..., R, N) that add them up to R outputs."""

    omega: Array
    zeta: Array
    gamma: Array
    rows: Array
    free: Callable[..., Mapping[str, Array]]
    forced: Callable[..., Array]


class HarmonicInput(NamedTuple):
    """Disturbance B sin(varpi t + psi) of the base; arrays (..., 1) with an axis for the modes."""

    B: Array
    varpi: Array
    psi: Array

    def phasor(self, t: Array | float) -> Array:
        """Return B varpi^2 exp(i (varpi t + psi)); its imaginary part is minus the base acceleration."""
        return np.asarray(self.B * self.varpi**2 * np.exp(1j * (self.varpi * t + self.psi)))


class Steady(NamedTuple):
    """Initial modal velocities (..., N), a constant base acceleration (..., 1), harmonics, initial displacements."""

    velocity: Array
    acceleration: Array
    harmonics: Sequence[HarmonicInput] = ()
    displacement: Array = np.zeros(1)


class PiecewiseInput(NamedTuple):
    """Base acceleration + jerk (t - knot) from each knot on; ``knots`` (K) or (..., K), the others (..., K)."""

    knots: Array
    acceleration: Array
    jerk: Array


class _Shift(NamedTuple):
    """Exact propagation of an oscillator over a time of any length."""

    p: Array
    h: Array
    g: Array  # h'
    step: Array
    ramp: Array
    harmonic: list[Array]
    slope: list[Array]  # its time derivative


def _shift(osc: Oscillators, tau: Array | float, harmonics: Sequence[HarmonicInput] = ()) -> _Shift:
    free = osc.free(tau, osc.omega, osc.zeta)
    p, h = free["displacement"], free["impulse"]
    harmonic = [osc.forced(tau, osc.omega, osc.zeta, f.varpi) for f in harmonics]
    slope = [h + 1j * f.varpi * H for f, H in zip(harmonics, harmonic, strict=True)]
    return _Shift(p, h, p - 2 * osc.zeta * osc.omega * h, free["step"], free["ramp"], harmonic, slope)


def _advance(
    osc: Oscillators,
    shift: _Shift,
    state: tuple[Array, Array],
    acceleration: Array,
    jerk: Array | float = 0.0,
    phasors: Sequence[Array] = (),
) -> tuple[Array, Array]:
    """Return q and q' after a shift, from q and q' and the base motion at its beginning."""
    q, u = state
    s = shift
    q, u = (
        s.p * q + s.h * u - osc.gamma * (s.step * acceleration + s.ramp * jerk),
        s.g * u - osc.omega**2 * s.h * q - osc.gamma * (s.h * acceleration + s.step * jerk),
    )
    for phasor, H, dH in zip(phasors, s.harmonic, s.slope, strict=True):
        q, u = q + osc.gamma * (H * phasor).imag, u + osc.gamma * (dH * phasor).imag
    return q, u


def _with_axis(values: Sequence[Array], axis: int) -> list[Array]:
    return [np.expand_dims(value, axis) for value in values]


def _widened(osc: Oscillators, axis: int) -> Oscillators:
    """Give the oscillators one more axis: -1 for the times, -2 for the outputs."""
    omega, zeta, gamma = _with_axis(osc[:3], axis)
    return osc._replace(omega=omega, zeta=zeta, gamma=gamma)


# Any times ------------------------------------------------------------------------------------------------------


def steady_response(osc: Oscillators, cause: Steady, t: Array, derivative: int = 0) -> Array:
    """Return the outputs at the times ``t`` (1-D) or a derivative of them, shape (..., R, T).

    A uniform grid is evaluated by :func:`_grid_response`, other times one by one.
    """
    step = _uniform_step(t)
    if step is not None:
        return _grid_response(osc, cause, float(t[0]), step, t.size, derivative)
    wide = _widened(osc, -1)
    acceleration = cause.acceleration[..., None]
    harmonics = [HarmonicInput(*_with_axis(f, -1)) for f in cause.harmonics]
    start = (cause.displacement[..., None], cause.velocity[..., None])

    def part(times: Array) -> Array:
        shift = _shift(wide, times, harmonics)
        q, u = _advance(wide, shift, start, acceleration, 0.0, [f.phasor(0.0) for f in harmonics])
        return _outputs(osc, q, u, acceleration - sum(f.phasor(times).imag for f in harmonics), derivative)

    width = np.prod(np.broadcast_shapes(osc.omega.shape, osc.zeta.shape, cause.velocity.shape))
    return _in_parts(part, t, int(width))


def piecewise_response(osc: Oscillators, cause: PiecewiseInput, t: Array, derivative: int = 0) -> Array:
    """Return the outputs from rest at the times ``t`` (1-D), shape (..., R, T): exact for a piecewise-linear
    acceleration."""
    q_k, u_k = knot_states(osc, cause)
    wide = _widened(osc, -1)
    shape = q_k.shape[:-2]
    at = _knots_at(cause.knots, t)
    if at is not None:
        acceleration = np.expand_dims(pick(cause.acceleration, at, shape), -2)
        return _outputs(osc, q_k[..., at], u_k[..., at], acceleration, derivative)

    def part(times: Array) -> Array:
        k = segment(cause.knots, times)
        before = np.expand_dims(k < 0, -2)
        local = np.expand_dims(pick(cause.acceleration, k, shape), -2)
        jerk = np.expand_dims(pick(cause.jerk, k, shape), -2)
        tau = np.where(before, 0.0, times - np.expand_dims(pick(cause.knots, k, shape), -2))
        index = np.broadcast_to(np.maximum(k, 0)[..., None, :], (*q_k.shape[:-1], times.size))
        state = np.take_along_axis(q_k, index, -1), np.take_along_axis(u_k, index, -1)
        q, u = _advance(wide, _shift(wide, tau), state, local, jerk)
        q, u, acceleration = (np.where(before, 0.0, value) for value in (q, u, local + jerk * tau))
        return _outputs(osc, q, u, acceleration, derivative)

    return _in_parts(part, t, q_k[..., 0].size)


def knot_states(osc: Oscillators, cause: PiecewiseInput) -> tuple[Array, Array]:
    """Return q and q' at every knot, from rest at the first, shape (..., N, K)."""
    span = np.diff(cause.knots)
    if span.ndim == 1 and span.size and np.ptp(span) <= 1e-12 * np.max(np.abs(cause.knots)):
        span = np.mean(span, keepdims=True)  # one shift serves a uniform record
    wide = _widened(osc, -1)
    shift = _shift(wide, np.expand_dims(span, -2))
    shape = np.broadcast_shapes(osc.omega.shape, (*cause.acceleration.shape[:-1], 1), shift.p.shape[:-1])
    if span.shape == (1,) and cause.knots.size > _LONG:
        return _uniform_states(osc, cause, float(span[0]), shape)
    states = np.zeros((2, *shape, cause.knots.shape[-1]), shift.p.dtype)
    state = (states[0, ..., 0], states[1, ..., 0])
    for k in range(1, states.shape[-1]):
        at = min(k, span.shape[-1]) - 1
        p, h, g, step, ramp = (value[..., at] for value in shift[:5])
        now = _Shift(p, h, g, step, ramp, [], [])
        state = _advance(osc, now, state, cause.acceleration[..., None, k - 1], cause.jerk[..., None, k - 1])
        states[0, ..., k], states[1, ..., k] = state
    return states[0], states[1]


def _uniform_states(
    osc: Oscillators, cause: PiecewiseInput, step: float, shape: tuple[int, ...]
) -> tuple[Array, Array]:
    """Return q and q' at every knot of a uniform record, from rest at the first.

    The record is divided into blocks, as many as their length. All blocks are propagated at once from rest, then the
    states at their starts from block to block, and the response to these is added by exact shifts.
    """
    count = cause.knots.size - 1
    length = int(np.ceil(np.sqrt(count)))
    blocks = -(-count // length)

    def cut(values: Array) -> Array:
        """Reshape values by knot (..., K) to (length, ..., 1, blocks)."""
        padded = np.zeros((*values.shape[:-1], blocks * length))
        padded[..., :count] = values[..., :count]
        return np.moveaxis(padded.reshape(*values.shape[:-1], 1, blocks, length), -1, 0).copy()

    wide = _widened(osc, -1)
    one = _shift(wide, step)
    acceleration, jerk = cut(cause.acceleration), cut(cause.jerk)
    q, u = np.zeros((2, length, *shape, blocks))
    state = (np.zeros((*shape, blocks)), np.zeros((*shape, blocks)))
    for k in range(length):
        state = _advance(wide, one, state, acceleration[k], jerk[k])
        q[k], u[k] = state
    whole = _shift(osc, step * length)
    start = np.zeros((2, *shape, blocks))
    for block in range(1, blocks):
        before = _advance(osc, whole, (start[0, ..., block - 1], start[1, ..., block - 1]), np.zeros(1))
        start[0, ..., block], start[1, ..., block] = (
            before[0] + q[-1, ..., block - 1],
            before[1] + u[-1, ..., block - 1],
        )
    for k in range(length):
        moved = _advance(wide, _shift(wide, step * (k + 1)), (start[0], start[1]), np.zeros(1))
        q[k] += moved[0]
        u[k] += moved[1]
    states = np.zeros((2, *shape, count + 1))
    for target, values in zip(states, (q, u), strict=True):
        target[..., 1:] = np.moveaxis(values, 0, -1).reshape(*shape, blocks * length)[..., :count]
    return states[0], states[1]


def _knots_at(knots: Array, t: Array) -> Array | None:
    """Return the index of the knot at each time, or None if some time is not a knot."""
    if knots.ndim > 1 or t.size < _LONG or knots.size < 2:
        return None
    step = (knots[-1] - knots[0]) / (knots.size - 1)
    at = np.rint((t - knots[0]) / step)
    if not (at.min() >= 0 and at.max() < knots.size):
        return None
    found = at.astype(np.intp)
    # within rounding of the times or 1e-9 of a step, the change of the state is that share of its change in a step
    slack = 1e-9 * step + 4 * np.finfo(float).eps * np.abs(knots[-1])
    return found if np.max(np.abs(t - knots[found])) <= slack else None


def segment(knots: Array, t: Array) -> Array:
    """Return the last knot not after each time, -1 before the first; shape (..., T)."""
    if knots.ndim == 1:
        return np.searchsorted(knots, t, side="right") - 1
    return np.asarray(np.sum([t >= knot[..., None] for knot in np.moveaxis(knots, -1, 0)], axis=0) - 1)


def pick(values: Array, segment: Array, shape: tuple[int, ...]) -> Array:
    """Return the values (..., K) at the segments (..., T), those of the first before it; shape (*shape, T)."""
    values = np.broadcast_to(values, (*shape, values.shape[-1]))
    return np.take_along_axis(values, np.broadcast_to(np.maximum(segment, 0), (*shape, segment.shape[-1])), -1)


def _outputs(osc: Oscillators, q: Array, u: Array, acceleration: Array, derivative: int) -> Array:
    """Add up the modes: (..., N, T) to (..., R, T)."""
    if derivative == 2:
        omega, zeta, gamma = _with_axis(osc[:3], -1)
        q = -(omega**2 * q + 2 * zeta * omega * u + gamma * acceleration)
    return np.asarray(np.matmul(osc.rows, u if derivative == 1 else q))


def _in_parts(function: Callable[[Array], Array], t: Array, width: int) -> Array:
    size = max(1, _CHUNK // max(1, width))
    return np.concatenate([function(t[i : i + size]) for i in range(0, max(t.size, 1), size)], axis=-1)


# Uniform grids --------------------------------------------------------------------------------------------------


def _uniform_step(t: Array) -> float | None:
    """Return the step of an increasing uniform grid, or None if ``t`` is not one or is too short to be worth it."""
    if t.size < 64:
        return None
    step = (t[-1] - t[0]) / (t.size - 1)
    off = np.max(np.abs(t - (t[0] + step * np.arange(t.size))))
    return float(step) if step > 0 and off <= 4 * np.finfo(float).eps * np.max(np.abs(t)) else None


def _grid_response(osc: Oscillators, cause: Steady, start: float, step: float, count: int, derivative: int) -> Array:
    """Return the outputs at ``start + step * arange(count)``, shape (..., R, count).

    The system is linear, so the output at t + tau is a row that depends on tau times a state that depends on t. The
    state is shifted from block to block, the row through one block, and one matrix product gives all times. Besides the
    result this needs memory for about 2 sqrt(count) (2 N + 1 + 2 harmonics) numbers per parameter set.
    """
    length = int(np.ceil(np.sqrt(count)))
    blocks = -(-count // length)
    states = _state_table(osc, cause, start + step * length * np.arange(blocks), step * length)
    rows = _row_table(osc, cause, step, length, derivative)
    out = np.matmul(states[..., None, :, :], np.swapaxes(rows, -1, -2))
    return np.asarray(out.reshape(*out.shape[:-2], -1)[..., :count])


def _state_table(osc: Oscillators, cause: Steady, times: Array, step: float) -> Array:
    """Return q, q', the constant acceleration and the phasors (Im, Re) at the times, shape (..., blocks, columns)."""
    harmonics, a = cause.harmonics, cause.acceleration
    start = (cause.displacement, cause.velocity)
    state = _advance(osc, _shift(osc, times[0], harmonics), start, a, 0.0, [f.phasor(0.0) for f in harmonics])
    shift = _shift(osc, step, harmonics)
    n, size = state[0].shape[-1], len(harmonics)
    table = np.empty((*state[0].shape[:-1], times.size, 2 * n + 1 + 2 * size))
    table[..., 2 * n] = a
    phasors = [f.phasor(times[0]) for f in harmonics]
    turns = [np.exp(1j * f.varpi * step) for f in harmonics]
    for block in range(times.size):
        row = table[..., block, :]
        row[..., :n], row[..., n : 2 * n] = state
        for column, phasor in enumerate(phasors, start=2 * n + 1):
            row[..., column], row[..., column + size] = phasor[..., 0].imag, phasor[..., 0].real
        state = _advance(osc, shift, state, a, 0.0, phasors)
        phasors = [phasor * turn for phasor, turn in zip(phasors, turns, strict=True)]
    return table


def _row_table(osc: Oscillators, cause: Steady, step: float, length: int, derivative: int) -> Array:
    """Return the contribution of each entry of a state to the output ``step * arange(length)`` later.

    The shape is (..., R, length, columns). A row y(tau) = r_q q + r_u q' + ... is shifted by substituting the shifted
    state into it.
    """
    osc = _widened(osc, -2)
    harmonics = [HarmonicInput(*_with_axis(f, -2)) for f in cause.harmonics]
    shift = _shift(osc, step, harmonics)
    turns = [np.exp(1j * f.varpi[..., 0] * step) for f in harmonics]
    back = osc.omega**2 * shift.h
    kick, push = osc.gamma * shift.step, osc.gamma * shift.h
    pulls = [(osc.gamma * H, osc.gamma * dH) for H, dH in zip(shift.harmonic, shift.slope, strict=True)]
    r_q, r_u, r_a = _output_row(osc, derivative)
    r_f = [-r_a + 0j] * len(harmonics)
    n, size = r_q.shape[-1], len(harmonics)
    shape = np.broadcast_shapes(r_q.shape, shift.p.shape, *(H.shape for H in shift.harmonic))[:-1]
    table = np.empty((*shape, length, 2 * n + 1 + 2 * size))
    for j in range(length):
        entry = table[..., j, :]
        entry[..., :n], entry[..., n : 2 * n], entry[..., 2 * n] = r_q, r_u, r_a
        for column, value in enumerate(r_f, start=2 * n + 1):
            entry[..., column], entry[..., column + size] = value.real, value.imag
        r_a = r_a - np.einsum("...n,...n->...", r_q, kick) - np.einsum("...n,...n->...", r_u, push)
        r_f = [
            value * turn + np.einsum("...n,...n->...", r_q, H) + np.einsum("...n,...n->...", r_u, dH)
            for value, turn, (H, dH) in zip(r_f, turns, pulls, strict=True)
        ]
        r_q, r_u = r_q * shift.p - r_u * back, r_q * shift.h + r_u * shift.g
    return table


def _output_row(osc: Oscillators, derivative: int) -> tuple[Array, Array, Array]:
    """Return the factors of q, q' and the base acceleration in a derivative of the outputs."""
    c, none = osc.rows, np.zeros_like(osc.rows)
    if derivative == 2:
        return -c * osc.omega**2, -2 * c * osc.zeta * osc.omega, -np.sum(c * osc.gamma, -1)
    return (c, none, none[..., 0]) if derivative == 0 else (none, c, none[..., 0])


# After the stop -------------------------------------------------------------------------------------------------


def free_motion(osc: Oscillators, tau: Array, state: tuple[Array, Array]) -> tuple[Array, Array]:
    """Return q and q' after a time without base acceleration, from q and q' at its beginning."""
    return _advance(osc, _shift(osc, tau), state, np.zeros(1))


def free_peak(osc: Oscillators, q: Array, u: Array) -> Array:
    """Return the largest absolute value each freely vibrating oscillator reaches from q, q' on, shape (..., N).

    It is the initial value or the first extremum after it. An oscillator of frequency zero keeps its value, or grows
    without bound if it has a velocity. The imaginary parts of complex values may hold a complex-step derivative: the
    time of the extremum, where the velocity is zero, stays real.
    """
    omega = osc.omega.real
    delta, damped = osc.zeta * omega, omega * np.sqrt(1 - osc.zeta**2)
    with np.errstate(divide="ignore", invalid="ignore"):
        turn = np.mod(np.arctan2(damped * u.real, omega**2 * q.real + delta * u.real), np.pi) / damped
    turn = np.where(damped > 0, turn, 0.0)
    q_turn, _ = free_motion(osc, turn, (q, u))
    first, later = (np.where(value.real < 0, -value, value) for value in (q, q_turn))
    peak = np.where(first.real >= later.real, first, later)
    return np.where((omega == 0) & (u != 0), np.inf, peak)
