"""Response of modes coupled by dampers to a base motion: matrix exponentials, exact for every term of the motion.

Each term of the motion is the output of a linear system s' = S s (a sine and a cosine, or a constant and a ramp). The
augmented system of modes and s moves freely, so that resonance and overdamped modes need no special case.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from scipy.linalg import expm

from ..checks import broadcastable
from .driven_modes import Start, checked
from .motion import BaseMotion, Harmonic, Piecewise

__all__ = ["CoupledModes", "coupled_response", "driven_system", "with_support"]

_CHUNK = 512  # times whose exponentials are formed at once
_FEW = 32  # times whose exponentials are formed one by one


class CoupledModes(NamedTuple):
    """Modes (..., N) with q'' + (D + 2 zeta omega) q' + omega^2 q = -gamma w'' - gamma_1 w' - gamma_0 w, and the rows
    (..., R, N) of the outputs; ``support`` is (gamma_0, gamma_1), shape (..., 2, N), or None where both are zero."""

    omega: np.ndarray
    zeta: np.ndarray
    damping: np.ndarray
    gamma: np.ndarray
    rows: np.ndarray
    support: np.ndarray | None = None


class _BaseAcceleration(NamedTuple):
    """A base acceleration ``weight @ s`` with s' = generator s from ``start``."""

    generator: np.ndarray
    weight: np.ndarray
    start: np.ndarray


def coupled_response(
    modes: CoupledModes,
    motion: BaseMotion,
    t: Any,
    derivative: int,
    start: Start = "inertial",
    initial: tuple[np.ndarray, np.ndarray] | None = None,
) -> np.ndarray:
    """Return the outputs at the times, shape (..., outputs, times); as `driven_response` for coupled modes."""
    times, derivative = checked(motion, t, derivative, start)
    size = modes.omega.shape[-1]
    shape = broadcastable(values=modes.omega[..., 0], zeta=modes.zeta[..., 0], motion=np.empty(motion.shape))
    still = np.zeros(size)
    q, u = (still, still) if initial is None else initial
    if start == "inertial":
        u = u - modes.gamma * np.asarray(motion.velocity(0.0))[..., None]
    state = np.concatenate(np.broadcast_arrays(q, u), axis=-1)
    inner = {"omega": 1, "zeta": 1, "damping": 2, "gamma": 1, "rows": 2}
    if modes.support is not None:
        inner["support"] = 2
    result = np.empty((*shape, modes.rows.shape[-2], times.size))
    for index in np.ndindex(shape):
        here = CoupledModes(*(_member(getattr(modes, name), shape, index, axes) for name, axes in inner.items()))
        causes = [_member_term(term, shape, index) for term in motion.terms]
        begin = _member(state, shape, index, 1)
        if modes.support is not None:
            moved = (motion.displacement(0.0), motion.velocity(0.0))
            begin = np.concatenate([begin, [_member(np.asarray(value), shape, index, 0) for value in moved]])
        result[index] = _outputs(here, causes, begin, times, derivative)
    return result


def _member(values: np.ndarray, shape: tuple[int, ...], index: tuple[int, ...], axes: int) -> np.ndarray:
    return np.asarray(np.broadcast_to(values, (*shape, *values.shape[values.ndim - axes :]))[index])


def _member_term(term: Harmonic | Piecewise, shape: tuple[int, ...], index: tuple[int, ...]) -> Harmonic | Piecewise:
    if isinstance(term, Harmonic):
        return Harmonic(*(_member(value, shape, index, 0) for value in term))
    velocity, *rest = term  # the velocity is part of the state at the start
    return Piecewise(velocity, *(_member(value, shape, index, 1) for value in rest))


def _outputs(
    modes: CoupledModes, terms: list[Harmonic | Piecewise], state: np.ndarray, times: np.ndarray, derivative: int
) -> np.ndarray:
    """Return the outputs (R, T) of one set of modes."""
    size = len(modes.omega)
    friction = modes.damping + np.diag(np.broadcast_to(2.0 * modes.zeta * modes.omega, size))
    system = np.block([[np.zeros((size, size)), np.eye(size)], [-np.diag(modes.omega**2), -friction]])
    push = np.concatenate([np.zeros(size), -modes.gamma])
    rows = np.concatenate([modes.rows, np.zeros_like(modes.rows)], axis=1)
    if modes.support is not None:
        load = np.concatenate([np.zeros((2, size)), -modes.support], axis=1)
        system, push, rows = with_support(system, push, rows, load)
    return _driven(system, push, rows, terms, state, times, derivative)


def with_support(
    system: np.ndarray, push: np.ndarray, rows: np.ndarray, load: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return system, push and rows of a state followed by w and w', of which ``load`` (2, r) acts on its rate."""
    size = len(system)
    whole = np.zeros((size + 2, size + 2))
    whole[:size, :size], whole[:size, size:], whole[size, size + 1] = system, load.T, 1.0
    return whole, np.append(push, [0.0, 1.0]), np.concatenate([rows, np.zeros((len(rows), 2))], axis=1)


def driven_system(
    system: np.ndarray,
    push: np.ndarray,
    rows: np.ndarray,
    motion: BaseMotion,
    index: tuple[int, ...],
    start: np.ndarray,
    times: np.ndarray,
    derivative: int,
) -> np.ndarray:
    """Return outputs ``rows y`` of ``y' = system y + push w''``, or their derivative by time, shape (outputs, times).

    Parameters
    ----------
    system, push, rows : ndarray, shape (r, r), (r,), (outputs, r)
    motion : BaseMotion
        A batch.
    index : tuple of int
        The member of the batch.
    start : ndarray, shape (r,)
        y at t = 0.
    times : ndarray, shape (times,)
    derivative : {0, 1, 2}
    """
    terms = [_member_term(term, motion.shape, index) for term in motion.terms]
    return _driven(system, push, rows, terms, start, times, derivative)


def _driven(
    system: np.ndarray,
    push: np.ndarray,
    rows: np.ndarray,
    terms: list[Harmonic | Piecewise],
    state: np.ndarray,
    times: np.ndarray,
    derivative: int,
) -> np.ndarray:
    """Return the outputs (R, T): the free motion plus the response to each term of the base motion."""
    for _ in range(derivative):
        rows, direct = rows @ system, rows @ push
    nothing = _BaseAcceleration(np.zeros((0, 0)), np.zeros(0), np.zeros(0))
    moved, _ = _advance_augmented(system, push, nothing, state, times)
    total = rows @ moved.T
    for term in terms:
        moved, force = _term_response(system, push, term, times)
        total += rows @ moved.T
        if derivative == 2:
            total += direct[:, None] * force
    return np.asarray(total)


def _term_response(
    system: np.ndarray, push: np.ndarray, term: Harmonic | Piecewise, times: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Return the state (T, 2 N) from rest and the base acceleration (T) of one term."""
    rest = np.zeros(len(push))
    if isinstance(term, Harmonic):
        B, varpi, psi = map(float, term)
        generator = np.array([[0.0, varpi], [-varpi, 0.0]])
        cause = _BaseAcceleration(generator, np.array([-B * varpi**2, 0.0]), np.array([np.sin(psi), np.cos(psi)]))
        return _advance_augmented(system, push, cause, rest, times)
    ramp, begin = np.array([[0.0, 0.0], [1.0, 0.0]]), np.array([1.0, 0.0])
    state, force = np.zeros((len(times), len(push))), np.zeros(len(times))
    for k, knot in enumerate(term.knots):
        cause = _BaseAcceleration(ramp, np.array([term.acceleration[k], term.jerk[k]]), begin)
        end = term.knots[k + 1] if k + 1 < len(term.knots) else np.inf
        within = (times >= knot) & (times < end)
        if within.any():
            state[within], force[within] = _advance_augmented(system, push, cause, rest, times[within] - knot)
        if np.isfinite(end):
            rest = _advance_augmented(system, push, cause, rest, np.array([end - knot]))[0][0]
    return state, force


def _advance_augmented(
    system: np.ndarray, push: np.ndarray, cause: _BaseAcceleration, state: np.ndarray, times: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Return state and base acceleration at the times after a start."""
    size = len(state)
    whole = np.zeros((size + len(cause.start),) * 2)
    whole[:size, :size], whole[size:, size:] = system, cause.generator
    whole[:size, size:] = np.outer(push, cause.weight)
    moved = _free_states(whole, np.concatenate([state, cause.start]), times)
    return moved[:, :size], moved[:, size:] @ cause.weight


def _free_states(system: np.ndarray, start: np.ndarray, times: np.ndarray) -> np.ndarray:
    """Return the states (T, N) at the times of y' = system y; equidistant times share their exponentials."""
    number = len(times)
    step = (times[-1] - times[0]) / (number - 1) if number > _FEW else 0.0
    if not step or np.abs(np.diff(times) - step).max() > 8 * np.finfo(float).eps * np.abs(times).max():
        return np.asarray(_exponentials(system, times) @ start)
    block = int(np.sqrt(number))
    coarse = _exponentials(system, times[::block]) @ start
    fine = _exponentials(system, step * np.arange(block))
    states: np.ndarray = np.einsum("fij,cj->cfi", fine, coarse, optimize=True).reshape(-1, len(start))
    return states[:number]


def _exponentials(system: np.ndarray, times: np.ndarray) -> np.ndarray:
    parts = (expm(times[i : i + _CHUNK, None, None] * system) for i in range(0, max(len(times), 1), _CHUNK))
    return np.concatenate(list(parts))
