"""Responses of nonlinear systems by time integration, an independent check of steady states.

The linear modes are integrated exactly, in coordinates that rotate with each of them; an adaptive Runge-Kutta method of
order eight integrates the nonlinear terms, damping and loads.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

from cra_sym.analysis.nonlinear import MOST_NONLINEAR_MODES, nonlinear_modal_equations
from cra_sym.checks import count, one_axis
from cra_sym.model.modal_equations import ModalEquations
from cra_sym.model.system import System
from cra_sym.solvers.force import Force
from cra_sym.solvers.motion import BaseMotion
from cra_sym.solvers.motion_terms import Piecewise

__all__ = ["nonlinear_response"]

Array = NDArray[np.float64]
_TOLERANCE = 1e-10
_BEYOND = 1e6  # nonlinear over linear forces
_MOST_PARTS = 500  # breaks of a motion at which the integration restarts


def nonlinear_response(
    system: System,
    histories: Mapping[str, BaseMotion | Force],
    rows: Array,
    t: Any,
    modes: int,
    derivative: Any,
    state: tuple[Array, ...],
    start: str,
    zeta: Any = None,
) -> Array:
    """Return outputs of the modes of a nonlinear system in time.

    Parameters
    ----------
    system : System
        Not a batch.
    histories : mapping of name to BaseMotion or Force
        Not batches.
    rows : ndarray, shape (outputs, modes)
    t : array_like
        A number or one axis of times, s.
    modes : int
    derivative : {0, 1, 2}
    state : (q, dq/dt)
        At t = 0, in addition to the effect of an initial base velocity if ``start`` is 'inertial'.
    start : {'inertial', 'base'}
    zeta : array_like, optional

    Returns
    -------
    ndarray, shape (outputs, times)
        Relative error about 1e-9.

    Raises
    ------
    ValueError
        If system or motions are batches, there are too many modes, or the motion diverges.
    """
    times = np.atleast_1d(one_axis("t", t, "times", low=0.0, unit="s"))
    derivative = count("derivative", derivative, low=0, high=2)
    if modes > MOST_NONLINEAR_MODES:
        raise ValueError(f"modes = {modes}: must be at most {MOST_NONLINEAR_MODES} for a nonlinear system")
    if any(history.shape for history in histories.values()):
        raise ValueError("motion: must not be a batch for a nonlinear system")
    gammas = {
        (name, order): -system.project(one, modes)
        for name, _ in system.numerics("causes")
        for order, one in system.numerics("loads", name).items()
    }
    constant = system.numerics("constant")
    load = np.zeros(modes) if constant is None else system.project(constant, modes)
    q, u = state
    for (name, order), gamma in gammas.items():
        history = histories[name]
        if isinstance(history, BaseMotion) and order == 2 and start == "inertial":
            u = u - gamma * np.asarray(history.velocity(0.0), float)
    moving = _Moving(nonlinear_modal_equations(system, modes, zeta), histories, gammas, load)
    order = np.argsort(times, kind="stable")
    found = moving.states(times[order], np.concatenate([q, u]))
    values = np.empty((modes, times.size))
    if derivative == 2:
        along = zip(times[order], found[0].T, found[1].T, strict=True)
        values[:, order] = np.stack([moving.acceleration(*at) for at in along], 1)
    else:
        values[:, order] = found[derivative]
    return np.asarray(rows @ values)


@dataclass(frozen=True)
class _Moving:
    """The equations of motion with their loads."""

    equations: ModalEquations
    histories: Mapping[str, BaseMotion | Force]
    gammas: Mapping[tuple[str, int], Array]
    constant: Array

    def _known(self, time: float) -> Array:
        """Return the known functions of the nonlinear terms at a time, shape (functions, 1)."""
        found = []
        for name, order in self.equations.causes:
            found.append(0.0 if name not in self.histories else self._input(name, order, time))
        return np.array(found).reshape(-1, 1)

    def _input(self, name: str, order: int, time: float) -> float:
        """Return a force, or the derivative of a motion by time of that order."""
        history = self.histories[name]
        if isinstance(history, Force):
            return float(history(time))
        return float((history.displacement, history.velocity, history.acceleration)[order](time))

    def _load(self, time: float) -> Array:
        total = self.constant
        for (name, order), gamma in self.gammas.items():
            total = total - gamma * self._input(name, order, time)
        return total

    def beside(self, time: float, q: Array, u: Array) -> Array:
        """Return the acceleration minus that of the undamped linear modes."""
        polynomials, rates = self.equations.polynomials, None
        if polynomials.moves_mass and self.equations.causes:  # momenta may follow known motions
            step = 1e-6 / max(float(polynomials.omega.max()), 1e-12)
            rates = (self._known(time + step) - self._known(max(time - step, 0.0))) / (min(time, step) + step)
        known = self._known(time), rates, self._load(time)
        return np.asarray(polynomials.acceleration(q[None], u[None], *known, whole=False)[0])

    def acceleration(self, time: float, q: Array, u: Array) -> Array:
        """Return the acceleration."""
        return np.asarray(self.beside(time, q, u) - self.equations.polynomials.omega**2 * q)

    def states(self, t: Array, start: Array) -> tuple[Array, Array]:
        """Return q and dq/dt at ascending times, shape (modes, times)."""
        n, last = start.size // 2, float(t[-1])
        found = np.empty((2 * n, t.size))
        found[:, t <= 0] = start[:, None]
        state = start
        joints = [time for time in self._joints() if 0 < time < last]
        for begin, end in zip([0.0, *joints], [*joints, last], strict=True):
            if end <= begin:
                continue
            inside = (t > begin) & (t <= end)
            state = self._part(begin, end, state, t[inside], found, inside)
        return found[:n], found[n:]

    def _part(self, begin: float, end: float, state: Array, t: Array, found: Array, inside: NDArray[np.bool_]) -> Array:
        fastest = float(self.equations.polynomials.omega.max())
        loads = float(np.abs(self._load(begin)).max() + np.abs(self._load(end)).max()) + 1e-300

        def rate(time: float, y: Array) -> Array:
            q, u = self._turned(time - begin, y)
            force = self.beside(time, q, u)
            if np.abs(force).max() > _BEYOND * (fastest**2 * np.abs(q).max() + fastest * np.abs(u).max() + loads):
                raise ValueError(f"the motion diverges at t = {time:.6g} s: nonlinear forces outgrow all others")
            return self._turned_back(time - begin, force)

        at = np.append(t, end)
        scale = float(np.abs(state).max())
        run = solve_ivp(
            rate,
            (begin, end),
            state,
            method="DOP853",
            t_eval=np.unique(at),
            rtol=_TOLERANCE,
            atol=1e-13 * (scale + 1e-6),
        )
        if not run.success or not np.isfinite(run.y).all():
            raise ValueError(f"the motion diverges at t = {run.t[-1] if run.t.size else begin:g} s: {run.message}")
        places = np.searchsorted(run.t, t)
        states = np.stack([np.concatenate(self._turned(run.t[k] - begin, run.y[:, k])) for k in range(run.t.size)], 1)
        found[:, inside] = states[:, places]
        return np.asarray(states[:, -1])

    def _turned(self, time: float, y: Array) -> tuple[Array, Array]:
        omega, n = self.equations.polynomials.omega, y.size // 2
        cosine, angle = np.cos(omega * time), omega * time
        sine = time * np.sinc(angle / np.pi)
        return cosine * y[:n] + sine * y[n:], -omega * np.sin(angle) * y[:n] + cosine * y[n:]

    def _turned_back(self, time: float, force: Array) -> Array:
        omega = self.equations.polynomials.omega
        angle = omega * time
        return np.concatenate([-time * np.sinc(angle / np.pi) * force, np.cos(angle) * force])

    def _joints(self) -> list[float]:
        terms = (term for h in self.histories.values() for term in (h.profile if isinstance(h, Force) else h).terms)
        found = np.unique([k for term in terms if isinstance(term, Piecewise) for k in term.knots.ravel()])
        return found.tolist() if found.size <= _MOST_PARTS else []
