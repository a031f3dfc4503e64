"""Systems with elastic-slip elements in the time domain: their modes without the elements, and the inputs."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cra_sym.analysis.nonlinear import MOST_NONLINEAR_MODES
from cra_sym.checks import broadcastable
from cra_sym.model.modal_equations import modal_equations
from cra_sym.model.projection import Projected
from cra_sym.model.system import System
from cra_sym.solvers.driven_modes import Start, checked
from cra_sym.solvers.force import Force
from cra_sym.solvers.motion import BaseMotion, Harmonic, Piecewise
from cra_sym.solvers.slip_loads import Cause
from cra_sym.solvers.slip_polynomials import Polynomial
from cra_sym.solvers.slip_records import Peak, Sampler
from cra_sym.solvers.slip_statics import SlippingModes
from cra_sym.solvers.slipping import Events, SlipStep, follow
from cra_sym.solvers.slipping import Start as State
from cra_sym.solvers.stuck_motion import stuck_peak

__all__ = ["Slipping", "linear_beside", "slipping", "slipping_outputs", "slipping_residual"]

Array = NDArray[np.float64]
_TOGETHER = 1024  # members integrated together
_PERIODS = 10.0  # periods of the lowest mode for which the motion is integrated after the stop


@dataclass(frozen=True)
class Slipping:
    """Modes with elements and their inputs, by member of a batch.

    Attributes
    ----------
    shape : tuple of int
        Of the batch; its members lie along the last axes of all arrays.
    base : System
        The system without its elements.
    modes : SlippingModes
    causes : list of Cause
    start : State
    """

    shape: tuple[int, ...]
    base: System
    modes: SlippingModes
    causes: list[Cause]
    start: State

    def members(self, rows: Array) -> Array:
        """Return arrays (..., outputs, modes) as (outputs, modes, members)."""
        return _members(rows, self.shape, 2)

    def shaped(self, values: Array) -> Array:
        """Return arrays (outputs, members, times) as (..., outputs, times)."""
        moved = np.moveaxis(values, 1, 0)
        return np.asarray(moved.reshape(*self.shape, *moved.shape[1:]))

    def follow(self, end: Any, visit: Callable[[SlipStep], object], pauses: Array | None = None) -> Events:
        """Integrate all members, in groups, to the end of each; ``visit`` is called with every step."""
        size = self.modes.omega.shape[1]
        last, found = np.broadcast_to(np.maximum(end, 1e-12), (size,)), []  # a motion of zero length is sampled once
        for first in range(0, max(size, 1), _TOGETHER):  # an empty batch too has one group
            part = np.arange(first, min(first + _TOGETHER, size))
            state = State(self.start.displacement[:, part], self.start.velocity[:, part])
            causes = [cause.of(part) for cause in self.causes]

            def show(step: SlipStep, part: NDArray[np.intp] = part) -> None:
                visit(step._replace(members=part[step.members]))

            events = follow(self.modes.of(part), causes, state, last[part], show, pauses)
            found.append(events._replace(member=part[events.member]))
        member, time, element, state_ = (np.concatenate(parts) for parts in zip(*found, strict=True))
        return Events(member, time, element, state_)


def slipping(
    system: System,
    driven: Iterable[tuple[Array, BaseMotion | Force]],
    modes: int,
    ratios: Array,
    start: Start,
    initial: tuple[Array, Array],
    check: Callable[[BaseMotion, Array], None],
) -> Slipping:
    """Return the time-domain problem of a system with elements.

    Parameters
    ----------
    system : System
    driven : iterable of (ndarray, BaseMotion or Force)
        For each input, minus the generalised force of a unit of it on every mode without the elements, and its history.
    modes : int
        Number of modes without the elements; static flexibility of the others is included at the elements.
    ratios : ndarray, shape (..., modes or 1)
        Damping ratios of these modes.
    start : {'inertial', 'base'}
    initial : (q, dq/dt)
        At t = 0, in addition to the effect of an initial base velocity if ``start`` is 'inertial'.
    check : callable
        ``check(motion, omega)`` is called with every motion and the frequencies.

    Raises
    ------
    ValueError
        If the system has nonlinear inertia or parametric nonlinear terms beside its elements, or gyroscopic or follower
        forces.
    """
    base = _conservative_beside(system)
    polynomials = _polynomials(base, modes)
    found, omega, form = system.slip_elements(modes), base.natural_frequencies(modes), base.numerics("damping")
    loads = [(gamma, h.profile if isinstance(h, Force) else h, isinstance(h, BaseMotion)) for gamma, h in driven]
    motions = {f"motion {k}": np.empty(motion.shape) for k, (_, motion, _) in enumerate(loads)}
    shape = broadcastable(system=np.empty(system.shape), zeta=ratios[..., 0], **motions)
    drag = _members(np.broadcast_to(2 * ratios * omega, (*shape, modes)), shape, 1)
    if form is not None:
        matrix = Projected(base.domain, base.modes(modes), form)["damping"]
        drag = _members(matrix, shape, 2) + np.einsum("np,nm->nmp", drag, np.eye(modes))
    q, u = initial
    causes = []
    for gamma, motion, moves in loads:
        check(motion, omega)
        if moves and start == "inertial":
            u = u - gamma * np.asarray(motion.velocity(0.0))[..., None]
        causes.append(Cause(_members(gamma, shape, 1), [_term(term, shape) for term in motion.terms]))
    slipping_modes = SlippingModes(
        _members(omega, shape, 1), drag, _members(found.displacements, shape, 2), _members(found.flexibility, shape, 2),
        found.where, _members(found.stiffness, shape, 1), _members(found.slip, shape, 1),
        tuple(term._replace(tensor=_members(term.tensor, shape, term.tensor.ndim - len(base.shape)))
              for term in polynomials),
    )  # fmt: skip
    return Slipping(shape, base, slipping_modes, causes, State(_members(q, shape, 1), _members(u, shape, 1)))


def linear_beside(system: System) -> System:
    """Return a system without its elements, if it is linear then and conservative but for dampers."""
    if system.without_hysteresis.numerics("nonlinear") is not None:
        raise ValueError(
            "system: elastic-slip elements must be its only nonlinear terms here; use slip_response or steady_states"
        )
    return _conservative_beside(system)


def _conservative_beside(system: System) -> System:
    base = system.without_hysteresis
    if base.conservative_part is not base:
        raise ValueError("system: beside elastic-slip elements its forces must be conservative, or dampers")
    return base


def _polynomials(base: System, modes: int) -> tuple[Polynomial, ...]:
    """Return the polynomial forces of a system, with its batch axes before those of the tensors."""
    if base.numerics("nonlinear") is None:
        return ()
    if modes > MOST_NONLINEAR_MODES:
        raise ValueError(f"modes = {modes}: must be at most {MOST_NONLINEAR_MODES} for a nonlinear system")
    each = [modal_equations(one, modes).polynomials for one in base.parameter_sets]
    tensors: dict[tuple[bool, int, int], list[Array | float]] = {}  # zeros where a set lacks a term
    for number, equations in enumerate(each):
        for has_potential, terms in ((True, equations.energies), (False, equations.forces)):
            for tensor, positions, velocities, causes in terms:
                if causes:
                    raise ValueError(
                        "system: in time no motion or force may multiply its displacements; use steady_states"
                    )
                if has_potential and velocities:
                    raise ValueError(
                        "system: in time its inertia must be linear beside elastic-slip elements; use steady_states"
                    )
                kind = (has_potential, positions - has_potential, velocities)
                force = positions * tensor if has_potential else tensor
                tensors.setdefault(kind, [0.0] * len(each))[number] = force
    found = []
    for (has_potential, positions, velocities), parts in tensors.items():
        size = (modes,) * (1 + positions + velocities)
        stacked = np.stack([np.broadcast_to(part, size) for part in parts]).reshape(*base.shape, *size)
        found.append(Polynomial(stacked, positions, velocities, has_potential))
    return tuple(found)


def slipping_outputs(problem: Slipping, rows: Array, t: Any, derivative: int) -> Array:
    """Return outputs in time, rows (..., outputs, modes) to (..., outputs, times)."""
    times, derivative = checked(BaseMotion(), t, derivative, "base")
    order = np.argsort(times, kind="stable")
    sampler = Sampler(problem.members(rows), times[order], derivative)
    problem.follow(times[order[-1]], sampler)
    values = np.empty_like(sampler.values)
    values[..., order] = sampler.values
    return problem.shaped(values)


def slipping_residual(problem: Slipping, row: Array, stop: Any) -> Array:
    """Return the peak of an output, row (..., modes), after all loads have stopped, shape (...).

    While elements slip it is that of the motion, for at most ten periods of the lowest elastic mode; once all stick it
    is the bound by the sum of the modes.
    """
    if problem.modes.polynomials:
        raise ValueError(
            "system: polynomial terms beside elastic-slip elements leave no bound of its residual vibration"
        )
    row = _members(row, problem.shape, 1)
    omega, last = problem.modes.omega, np.broadcast_to(stop, problem.shape).ravel()
    lowest = np.where(omega > 0, omega, np.inf).min(axis=0)
    if np.isinf(lowest).any():
        raise ValueError("modes: must be enough for one that vibrates")
    peak = Peak(row, last, len(problem.modes.slip))
    problem.follow(last + 2 * np.pi * _PERIODS / lowest, peak)
    bound = np.where(peak.sticks, stuck_peak(problem.modes, peak.state, row), 0.0)
    return np.maximum(peak.moving, bound).reshape(problem.shape)


def _members(values: Any, shape: tuple[int, ...], axes: int) -> Array:
    """Return arrays (..., axes) of a batch as (axes, members)."""
    inner = np.shape(values)[np.ndim(values) - axes :]
    flat = np.broadcast_to(values, (*shape, *inner)).reshape(-1, *inner)
    return np.ascontiguousarray(np.moveaxis(flat, 0, -1), dtype=float)


def _term(term: Harmonic | Piecewise, shape: tuple[int, ...]) -> Harmonic | Piecewise:
    """Return the term with its members along the first axis, of length one for arrays common to all."""

    def rows(values: Array, axes: int) -> Array:
        inner = values.shape[values.ndim - axes :]
        if values.size == np.prod(inner, dtype=int):
            return values.reshape(1, *inner)
        return np.broadcast_to(values, (*shape, *inner)).reshape(-1, *inner)

    if isinstance(term, Harmonic):
        return Harmonic(*(rows(np.asarray(values), 0) for values in term))
    knots = term.knots if term.knots.ndim == 1 else rows(term.knots, 1)
    knots = knots[0] if knots.ndim == 2 and len(knots) == 1 else knots
    return Piecewise(np.zeros(1), knots, rows(term.acceleration, 1), rows(term.jerk, 1))
