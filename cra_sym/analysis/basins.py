"""Basins of attraction: which steady state is reached from which initial motion."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

from cra_sym import checks
from cra_sym.analysis.slip_states import SlipProblem
from cra_sym.analysis.steady_levels import FAR
from cra_sym.analysis.steady_states import SteadyState
from cra_sym.solvers.trajectories import trajectories

__all__ = ["basins"]

Array = NDArray[np.float64]
_DECAY = 4.0  # a transient has decayed to exp(-4) when the motion is assigned to a steady state
_MOST_CYCLES = 20_000
_CHUNK = 10  # cycles that are integrated at a time
_TOLERANCE = 1e-6


def basins(
    states: Sequence[SteadyState],
    displacement: ArrayLike,
    velocity: ArrayLike,
    *,
    mode: int = 1,
    cycles: int | None = None,
) -> NDArray[np.intp]:
    """Return which of the steady states at one frequency is reached from initial motions in one mode.

    All initial motions are integrated together (DOP853, relative tolerance 1e-6) for whole periods, and each is
    assigned to the stable state whose displacements and velocities at that phase are nearest.

    Parameters
    ----------
    states : sequence of SteadyState
        Result of :func:`cra_sym.steady_states` for one angular frequency.
    displacement : array_like, shape (D,)
        Initial displacement of the tip in the mode, or of the displacement chosen for ``states``, m.
    velocity : array_like, shape (V,)
        Its initial velocity, m/s.
    mode : int
        In which linear mode, from 1; the others start at rest.
    cycles : int, optional
        Periods of the steady states to integrate; default: until the slowest mode has decayed to exp(-4).

    Returns
    -------
    ndarray of int, shape (V, D)
        Index into ``states``; -1 where no stable state is clearly the nearest, compared with their mutual distances, or
        the motion diverges: beyond 1000 times the largest start and steady state.

    Raises
    ------
    TypeError, ValueError
        If there is no stable state, the states have several frequencies or epsilons, or the system has no damping in a
        mode and ``cycles`` is not given.

    Examples
    --------
    A mass on a hardening spring: from rest it reaches the small vibration, from a large deflection the large one.

    >>> from sympy import Function
    >>> import cra_sym as cra
    >>> from cra_sym.symbols import t, x
    >>> q, F = Function("q")(t), Function("F")(t)
    >>> duffing = cra.Model(0, fields=(), coordinates=[q], x=x, domain=(0, 1), t=t,
    ...                     left=q.diff(t)**2/2 - q**2/2 - q**4/4, virtual_work=[(F, q, None)])
    >>> states = cra.steady_states(duffing.at({}, zeta=0.02), 1.3, drive={F: 0.1}, modes=1)
    >>> cra.basins(states, [0.0, 0.95], [0.0]).tolist()
    [[0, 2]]
    """
    known = tuple(states)
    for state in known:
        checks.instance("states", state, SteadyState)
    stable = [k for k, state in enumerate(known) if state.stable]
    if not stable:
        raise ValueError("states: must include a stable one, since motions do not end on unstable ones")
    if len({(state.angular_frequency, state.epsilon) for state in known}) > 1:
        raise ValueError("states: must be those of one angular frequency and one epsilon")
    flow = _Flow(known[0])
    mode = checks.count("mode", mode, high=flow.modes)
    row = flow.rows[mode - 1]
    if not row:
        raise ValueError(f"mode = {mode}: does not move the displacement that was chosen; place must not be its node")
    places = checks.one_axis("displacement", displacement, "displacements", low=-1e60, high=1e60, unit="m")
    rates = checks.one_axis("velocity", velocity, "velocities", low=-1e60, high=1e60, unit="m/s")
    number = flow.cycles() if cycles is None else checks.count("cycles", cycles, high=_MOST_CYCLES)
    v, q = (grid.ravel() for grid in np.meshgrid(np.atleast_1d(rates), np.atleast_1d(places), indexing="ij"))
    start = np.zeros((2, q.size, flow.modes))
    start[0, :, mode - 1], start[1, :, mode - 1] = q / row, v / row
    marks = np.stack([flow.mark(known[k]) for k in stable])
    far = FAR * max(float(np.abs(found).max(initial=0.0)) for found in (flow.scaled(start), marks))
    reached = flow.after(start, number, far)
    found = _nearest(flow.scaled(reached), marks, flow.scaled(start))
    return np.append(np.array(stable), -1)[found].reshape(np.size(rates), np.size(places))


def _nearest(points: Array, marks: Array, started: Array) -> NDArray[np.intp]:
    """Return the nearest mark to each point, -1 if it is not clearly nearer than the marks are to each other.

    If there is only one mark, nearer than a tenth of the largest initial distance.
    """
    apart = np.linalg.norm(points[:, None] - marks[None], axis=-1)
    nearest = apart.argmin(axis=1)
    between = np.linalg.norm(marks[:, None] - marks[None], axis=-1)
    np.fill_diagonal(between, np.inf)
    most = np.linalg.norm(started - marks[0], axis=-1).max(keepdims=True)
    reach = 0.4 * between.min(axis=1) if len(marks) > 1 else 0.1 * most
    good = apart[np.arange(len(points)), nearest] <= reach[nearest]
    return np.where(good & np.isfinite(points).all(axis=1), nearest, -1)


class _Flow:
    """The modal equations that a steady state solves, for many motions at once."""

    def __init__(self, state: SteadyState) -> None:
        if isinstance(state.problem, SlipProblem):
            raise ValueError(
                "states: must be of a system without elastic-slip elements; cra.response follows one motion"
            )
        self._problem, self._period = state.problem, state.problem.period
        self._point = np.array([[state.angular_frequency, 1.0 if state.epsilon is None else state.epsilon]])
        self._equations = self._problem.driven.equations
        self._varpi = state.angular_frequency
        self.rows, self.modes = state.problem.rows, self._equations.modes

    @property
    def _cycle(self) -> float:
        return float(2 * np.pi * self._period / self._varpi)

    def cycles(self) -> int:
        """Return the number of periods of the steady states in which a transient decays."""
        rates = np.linalg.eigvalsh((self._equations.damping + self._equations.damping.T) / 4)
        if rates.min() <= 0:
            raise ValueError("cycles = None: must be given where a mode has no damping: its transient does not decay")
        return int(np.clip(np.ceil(_DECAY / (rates.min() * self._cycle)), 1, _MOST_CYCLES))

    def after(self, start: Array, cycles: int, far: float) -> Array:
        """Return displacements and velocities after some periods, shape (2, motions, modes); nan if they diverge."""
        kept, state = np.arange(start.shape[1]), start
        for begin in range(0, cycles, _CHUNK):
            end = np.array([min(_CHUNK, cycles - begin) * self._cycle])
            floor = 1e-9 * (float(np.abs(state).max(initial=0.0)) + 1e-12)
            state = trajectories(self._rate, state, end, far=far, rtol=_TOLERANCE, atol=floor)[..., 0]
            good = np.isfinite(state).all(axis=(0, 2))
            kept, state = kept[good], state[:, good]
        reached = np.full_like(start, np.nan)
        reached[:, kept] = state
        return reached

    def _rate(self, time: float, q: Array, u: Array, rows: NDArray[np.intp]) -> Array:
        at = np.broadcast_to(self._point, (len(q), 2))
        return np.stack([u, self._problem.acceleration(2 * np.pi * time / self._cycle, at, q, u)])

    def mark(self, state: SteadyState) -> Array:
        """Return the point of a steady state at phase 0 in the space of displacements and scaled velocities."""
        basis, coefficients = self._problem.basis, state.coefficients
        at = np.zeros(1)
        rate = self._varpi / self._period
        q, u = coefficients @ basis.values(at)[0], rate * (coefficients @ basis.values(at, 1)[0])
        return np.asarray(self.scaled(np.stack([q[None], u[None]]))[0])

    def scaled(self, state: Array) -> Array:
        """Return displacements and velocities over their frequency, shape (motions, 2 modes)."""
        omega = np.maximum(self._equations.omega, self._varpi * 1e-3)
        return np.concatenate([np.asarray(state[0], float), np.asarray(state[1] / omega, float)], axis=-1)
