"""Further starts of steady states: continuation in the load level, and time integration until motions settle."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from cra_sym.analysis.driven_problem import DrivenProblem
from cra_sym.solvers.continuation import at_value, follow, passings, started
from cra_sym.solvers.driven_curve import Driven
from cra_sym.solvers.trajectories import trajectories

__all__ = ["FAR", "mirrored", "settling", "shifted", "traced"]

Array = NDArray[np.float64]
_MOST_POINTS = 250  # points of a curve over the level
_FULL, _HIGHEST = np.arcsinh(1.0), np.arcsinh(10.0)  # the level is the hyperbolic sine of the continuation parameter
_SLOW = 5.0  # natural frequencies over that of the excitation up to which modes move in the integration
_CYCLES, _DECAY = (40, 100), 8.0  # periods of integration; sufficient decay of a transient
FAR = 1e3
"""Displacement, over those of the starts and of the steady states, beyond which a motion is taken to diverge."""
_TOLERANCE, _PUSH = 1e-5, 1e-2  # tolerance of the integration; relative perturbation of an unstable solution


def traced(problem: DrivenProblem, point: Array, size: float, start: Array | None = None) -> Array:
    """Return the solutions on a curve over the level of the whole excitation, through its folds.

    Parameters
    ----------
    problem : DrivenProblem
    point : ndarray, shape (2,)
        Angular frequency and size of the excitation.
    size : float
        Modal amplitude at which nonlinear forces matter.
    start : ndarray, shape (unknowns,), optional
        A solution on the curve; default: rest, at zero excitation.

    Returns
    -------
    ndarray, shape (solutions, unknowns)
    """
    frequency = float(point[0]) / problem.period
    causes = problem.causes(point[None])
    energetic = 0.1 * size * float(np.hypot(problem.driven.equations.omega, frequency).min())
    curve = Driven(
        problem.balance,
        lambda step: (frequency, 0.0, np.sinh(step) * causes),
        energetic,
        1.0,
        lowest=-np.inf,
    )
    if start is None:
        first = started(curve, np.zeros(problem.balance.size), 0.0)
    else:
        first = started(curve, start, _FULL, -1.0)
    found: list[Array] = []
    before = first
    for number, after in enumerate(follow(curve, first) if first is not None else ()):
        if before is None or after.frequency > _HIGHEST or after.frequency < -0.01 or number == _MOST_POINTS:
            break
        if number:
            passed = [s for s in passings(before, after, _FULL) if s > 1e-6 or number > 1]
            answers = [at_value(curve, before, after, float(s), _FULL) for s in passed]
            found += [answer for answer in answers if answer is not None]
            if (
                start is not None
                and passed
                and found
                and np.linalg.norm(found[-1] - start) < 1e-6 * np.linalg.norm(start)
            ):
                break  # the curve is closed
        before = after
    return np.array(found).reshape(-1, problem.balance.size)


def shifted(problem: DrivenProblem, unknowns: Array) -> list[Array]:
    """Return solutions shifted by one, two .. periods of the excitation, each of shape (solutions, unknowns)."""
    return [_moved(problem, unknowns, float(number), 1.0) for number in range(1, problem.period)]


def mirrored(problem: DrivenProblem, unknowns: Array) -> Array:
    """Return solutions with opposite sign, and shifted by half a period; symmetric systems have these too."""
    return _moved(problem, unknowns, 0.0 if problem.driven.rests else 0.5, -1.0)


def _moved(problem: DrivenProblem, unknowns: Array, shift: float, sign: float) -> Array:
    x, n = problem.coefficients(unknowns), len(problem.basis.sines)
    angle = 2 * np.pi * shift / problem.period * np.arange(1, n + 1)
    cosine, sine, c, s = x[..., 1 : n + 1], x[..., n + 1 :], np.cos(angle), np.sin(angle)
    parts = [x[..., :1], c * cosine + s * sine, c * sine - s * cosine]
    return np.asarray(sign * np.concatenate(parts, axis=-1).reshape(len(unknowns), -1))


def settling(problem: DrivenProblem, points: Array, starts: Array, size: float) -> Array:
    """Return the motions to which perturbed unstable solutions converge, as harmonics of their last period.

    Parameters
    ----------
    problem : DrivenProblem
    points : ndarray, shape (motions, 2)
    starts : ndarray, shape (motions, unknowns)
        Solutions, each of which is perturbed slightly.
    size : float
        Modal amplitude at which nonlinear forces matter.

    Returns
    -------
    ndarray, shape (motions, unknowns)
        nan where a motion diverges.
    """
    basis, equations, n = problem.basis, problem.driven.equations, problem.driven.equations.modes
    frequency, x = points[:, 0] / problem.period, problem.coefficients(starts)
    at, m = np.zeros(1), len(points)
    push = _PUSH * size * np.random.default_rng(0).normal(size=(2, m, n))
    slow = equations.omega <= max(_SLOW * points[:, 0].max(initial=0.0), equations.omega[0])
    q = (x @ basis.values(at)[0] + push[0]) * slow
    u = (x @ basis.values(at, 1)[0] + push[1]) * frequency[:, None] * slow

    def rate(phase: float, q: Array, u: Array, rows: NDArray[np.intp]) -> Array:
        rates = np.stack([u, problem.acceleration(phase, points[rows], q, u)]) / frequency[rows, None]
        return np.asarray(slow * rates)

    decay = float(np.linalg.eigvalsh((equations.damping + equations.damping.T) / 4).min())
    cycles = int(np.clip(np.ceil(_DECAY * frequency.max() / (2 * np.pi * max(decay, 1e-300))), *_CYCLES))
    samples = 2 * np.pi * (cycles - 1) + basis.phase
    scale = size + float(np.abs(q).max())
    limits = {"far": FAR * scale, "rtol": _TOLERANCE, "atol": 1e-6 * scale}
    values = trajectories(rate, np.stack([q, u]), samples, **limits)[0]
    return np.asarray((values @ (basis.weights * basis.values(samples)) / samples.size).reshape(m, -1))
