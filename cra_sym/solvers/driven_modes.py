"""Response of modal oscillators to a base motion: superposition of the closed-form responses to its terms."""

from __future__ import annotations

from typing import Any, Literal, get_args

import numpy as np

from ..checks import broadcastable, choice, count, instance, one_axis
from . import modal_response as solver
from .motion import BaseMotion, Harmonic, Piecewise

__all__ = ["Start", "at_rest", "check_start", "checked", "driven_response", "state_at_stop"]

Start = Literal["inertial", "base"]


def driven_response(
    osc: solver.Oscillators,
    motion: BaseMotion,
    t: Any,
    derivative: int,
    start: Start = "inertial",
    initial: tuple[np.ndarray, np.ndarray] | None = None,
) -> np.ndarray:
    """Return the outputs at the times, shape (..., outputs, times).

    Parameters
    ----------
    osc : Oscillators
    motion : BaseMotion
    t : array_like
        Times from 0 on.
    derivative : {0, 1, 2}
    start : {'inertial', 'base'}
        At rest before t = 0 in the inertial frame or seen from the moving base.
    initial : pair of ndarray, shape (..., modes), optional
        Modal displacements and velocities at t = 0, in addition to those of the start.
    """
    grid, derivative = checked(motion, t, derivative, start)
    modes = osc.omega.shape[:-1]
    shape = broadcastable(system=np.empty(modes), zeta=osc.zeta[..., 0], motion=np.empty(motion.shape))
    parts = [solver.piecewise_response(osc, piece, grid, derivative) for piece in _pieces(motion)]
    steady = _steady(osc, motion, start)
    if initial is not None:
        free = solver.Steady(initial[1], np.zeros(1), displacement=initial[0])
        parts.append(solver.steady_response(osc, free, grid, derivative))
    if steady is not None:
        parts.append(solver.steady_response(osc, steady, grid, derivative))
    wanted = (*shape, osc.rows.shape[-2], grid.size)
    if not parts:
        return np.zeros(wanted)
    total = sum(parts[1:], parts[0])
    return total if total.shape == wanted else np.broadcast_to(total, wanted).copy()


_LONGEST = 1e15  # s; beyond it the phase of even a slow mode is lost to rounding


def checked(motion: Any, t: Any, derivative: Any, start: Any) -> tuple[np.ndarray, int]:
    """Return the times as one axis and the derivative, or raise an error that names the invalid argument."""
    instance("motion", motion, BaseMotion)
    times = np.atleast_1d(one_axis("t", t, "times", low=0.0, high=_LONGEST, unit="s"))
    check_start(start)
    return times, count("derivative", derivative, low=0, high=2)


def check_start(start: Any) -> None:
    """Raise an error that names the start unless it is allowed."""
    choice("start", start, get_args(Start))


def _column(value: Any) -> np.ndarray:
    """Return the batch array with an axis for the modes."""
    return np.asarray(value, float)[..., None]


def _profiles(motion: BaseMotion, *, mean: bool) -> list[Piecewise]:
    """Return the terms that are a mean motion, one constant acceleration from t = 0 on, or the other profiles."""
    profiles = [term for term in motion.terms if isinstance(term, Piecewise)]
    return [p for p in profiles if mean is (p.knots.shape == (1,) and not (p.knots.any() or p.jerk.any()))]


def _pieces(motion: BaseMotion) -> list[solver.PiecewiseInput]:
    return [solver.PiecewiseInput(p.knots, p.acceleration, p.jerk) for p in _profiles(motion, mean=False)]


def _steady(osc: solver.Oscillators, motion: BaseMotion, start: Start) -> solver.Steady | None:
    """Collect initial velocity, constant acceleration and harmonics, or return None if there are none."""
    harmonics = [solver.HarmonicInput(*map(_column, term)) for term in motion.terms if isinstance(term, Harmonic)]
    level = sum((profile.acceleration for profile in _profiles(motion, mean=True)), np.zeros(1))
    impulse = -osc.gamma * _column(motion.velocity(0.0)) * (start == "inertial")
    return solver.Steady(impulse, level, harmonics) if harmonics or level.any() or impulse.any() else None


def state_at_stop(osc: solver.Oscillators, motion: BaseMotion, stop: Any = None) -> tuple[np.ndarray, np.ndarray]:
    """Return q and q' when the base stops accelerating, or at a later time, shape (..., modes).

    For a slow mode q' is the difference of nearly equal integrals, which cancellation would destroy. It is then
    computed from the integral of q'' + 2 zeta omega q' + omega^2 q = -Gamma w'' over time, in which q is -Gamma w.
    """
    stop = _column(motion.duration if stop is None else stop)
    rest = np.zeros(1), -osc.gamma * _column(motion.velocity(0.0))
    q, u = solver.free_motion(osc, stop, rest)
    for piece in _pieces(motion):
        q_knots, u_knots = solver.knot_states(osc, piece)
        end = q_knots[..., -1], u_knots[..., -1]
        q_piece, u_piece = solver.free_motion(osc, stop - piece.knots[..., -1:], end)
        q, u = q + q_piece, u + u_piece
    end = np.max(stop)
    impulse = np.where(_column(at_rest(motion, end)), 0.0, -osc.gamma * _column(motion.velocity(end)))
    omega = osc.omega
    slow = (
        impulse
        - 2 * osc.zeta * omega * q
        + omega**2 * osc.gamma * _column(_integrated_displacement(motion, stop[..., 0]))
    )
    return q, np.where(omega.real * stop < _SLOW, slow, u)


_SLOW = 3e-5  # rad in the time of the move: beyond the square of it, an eps of q' over omega counts more
_STOPPED = 1e-9  # of the sum of all velocity changes: a remainder below this share is rounding


def at_rest(motion: BaseMotion, t: float) -> np.ndarray:
    """Return whether the velocity at a time is at most rounding, shape of the batch."""
    return np.asarray(np.abs(motion.velocity(t)) <= _STOPPED * _velocity_variation(motion))


def _velocity_variation(motion: BaseMotion) -> np.ndarray:
    """Return the total variation of the velocity, m/s."""
    total = np.zeros(motion.shape)
    for piece in (term for term in motion.terms if isinstance(term, Piecewise)):
        span, a, j = np.diff(piece.knots), piece.acceleration[..., :-1], piece.jerk[..., :-1]
        total = total + np.abs(piece.velocity) + np.sum(np.abs((a + j * span / 2) * span), -1)
    return total


def _integrated_displacement(motion: BaseMotion, stop: np.ndarray) -> np.ndarray:
    """Return the integral of the displacement up to a time, m s: by parts that of y^2 w'' / 2, y the time to go."""
    total = np.zeros(motion.shape)
    for piece in (term for term in motion.terms if isinstance(term, Piecewise)):
        left = stop[..., None] - piece.knots
        after = np.concatenate([left[..., 1:], np.zeros_like(left[..., :1])], -1)
        level = piece.acceleration + piece.jerk * left
        terms = level * (left**3 - after**3) / 6 - piece.jerk * (left**4 - after**4) / 8
        total = total + piece.velocity * stop**2 / 2 + np.sum(terms, -1)
    return total
