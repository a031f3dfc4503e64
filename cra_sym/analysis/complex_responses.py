"""Responses of systems whose modes are complex: local dampers, gyroscopic forces, forces that follow the motion."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from cra_sym.checks import broadcastable
from cra_sym.model.projection import Load, project
from cra_sym.model.routes import Modes
from cra_sym.model.system import System
from cra_sym.model.values import flat_columns
from cra_sym.model.vanishing import check_forces
from cra_sym.solvers.coupled_modes import driven_system, with_support
from cra_sym.solvers.driven_modes import Start, checked
from cra_sym.solvers.force import Force
from cra_sym.solvers.free_peaks import free_peaks, peaks_of_modes
from cra_sym.solvers.lowest_motions import LowestMotions, lowest_motions
from cra_sym.solvers.motion import BaseMotion
from cra_sym.solvers.stopped_modes import stopped_modes

__all__ = ["complex_residual", "complex_response"]

Array = NDArray[np.float64]
_SLANTED = 1e4  # condition number of the modes beyond which rounding errors of their amplitudes count


class _DrivingInput(NamedTuple):
    """An input: its history as the acceleration of a motion, its loads, and whether it is an impulse at t = 0.

    Loads are those of units of displacement, velocity and acceleration of the motion, None where there is none.
    """

    profile: BaseMotion
    loads: tuple[Load | None, Load | None, Load | None]
    strikes: bool


def complex_response(
    system: System,
    histories: Mapping[str, BaseMotion | Force],
    outputs: Callable[[Modes], Array],
    t: Any,
    modes: int,
    derivative: int,
    zeta: Array,
    start: Start,
    initial: Mapping[Any, Any] | None,
    check: Callable[[BaseMotion, Array], None],
) -> Array:
    """Return outputs of the lowest complex modes, shape (..., outputs, times).

    Parameters
    ----------
    system : System
    histories : mapping of name to BaseMotion or Force
    outputs : callable
        ``outputs(modes)`` returns the rows (outputs, modes) of a basis.
    t, modes, derivative, start, initial
        As :func:`cra_sym.response`; the sum has 2 ``modes`` eigenvalues.
    zeta : ndarray
        Modal damping ratio of the structure without its dampers.
    check : callable
        ``check(motion, omega)`` is called with every motion and the frequencies.
    """
    causes = _causes(system, histories, start)
    times = np.empty(0)
    for cause in (None, *causes):
        times, derivative = checked(BaseMotion() if cause is None else cause.profile, t, derivative, start)
    found = []
    shape, members = _members(system, causes, outputs, modes, zeta, _momenta(system, initial), check, whole=True)
    for one in members:
        y = one.start
        total = driven_system(one.motions.system, 0.0 * y, one.rows, BaseMotion(), (), y, times, derivative)
        for acting in one.causes:
            total += acting.outputs(one.motions.system, one.rows, times, derivative)
        found.append(total)
    return np.array(found).reshape(*shape, *found[0].shape)


def complex_residual(
    system: System,
    histories: Mapping[str, BaseMotion | Force],
    tip: Callable[[Modes], Array],
    stop: Array | float,
    modes: int,
    zeta: Array,
    check: Callable[[BaseMotion, Array], None],
) -> Array:
    """Return the sum over the lowest complex modes of the largest displacements of the tip after the stop, shape (...).

    Displacements are measured from the equilibrium with a support that has moved.

    Parameters
    ----------
    system, histories, modes, zeta, check
        As in :func:`complex_response`, from rest.
    tip : callable
        ``tip(modes)`` returns the row (modes,) of a basis.
    stop : float or ndarray
        Time when all inputs have ended, s.
    """
    causes = _causes(system, histories, "inertial")
    shape, members = _members(system, causes, tip, modes, zeta, (None, None), check, whole=False)
    stops, found = np.broadcast_to(stop, shape).ravel(), np.empty(shape).ravel()
    first = 0
    for _, group in itertools.groupby(members, lambda one: id(one.motions)):
        alike = list(group)
        last = first + len(alike)
        found[first:last] = _peaks_after(alike, stops[first:last])
        first = last
    return found.reshape(shape)


def _peaks_after(members: Sequence[_Member], stops: Array) -> Array:
    """Return the sums of the peaks after the stop of members that differ in their inputs alone."""
    motions, row = members[0].motions, members[0].rows
    rigid = motions.basis.problem.rigid
    s, vectors = np.linalg.eig(motions.system)
    if not rigid and np.linalg.cond(vectors) < _SLANTED:
        shares = np.zeros((len(members), len(s)), dtype=complex)
        for causes in zip(*(one.causes for one in members), strict=True):
            push, support = causes[0].push, causes[0].support
            loads = np.stack([*(np.zeros((2, len(s))) if support is None else support), push])
            modal = np.linalg.solve(vectors, loads.T.astype(complex)).T
            strikes = np.array([one.strike for one in causes])
            shares += stopped_modes(s, modal, strikes, _of_members(causes), stops)
        return peaks_of_modes(s, (row @ vectors) * shares)
    states = np.zeros((len(members), len(s)))
    for state, one, end in zip(states, members, stops, strict=True):
        for acting in one.causes:
            state += acting.outputs(motions.system, np.eye(len(s)), np.array([end]), 0)[:, 0]
            if acting.support is not None:
                state += np.linalg.solve(motions.system, acting.support[0] * acting.moved(end)[0])
    return free_peaks(motions.system, row, states, rigid)


def _of_members(causes: Sequence[_Acting]) -> BaseMotion:
    """Return the motions of one input of members as a batch with one axis."""
    profile = causes[0].profile
    index = tuple(np.array([one.member for one in causes]).T)
    return profile[index] if profile.shape else profile * np.ones(len(causes))


class _Acting(NamedTuple):
    """An input of one member of a batch.

    Its profile, the member of the profile's batch, its effect on the state, the initial velocity that comes with an
    impulse, and the effect of displacement and velocity, shape (2, states), None if both are zero.
    """

    profile: BaseMotion
    member: tuple[int, ...]
    push: Array
    strike: float
    support: Array | None

    def outputs(self, matrix: Array, rows: Array, times: Array, derivative: int) -> Array:
        """Return the outputs ``rows`` of the states of a system that it drives from rest, (outputs, times)."""
        push, start = self.push, self.push * self.strike
        if self.support is not None:
            matrix, push, rows = with_support(matrix, push, rows, self.support)
            start = np.append(start, self.moved(0.0))
        return driven_system(matrix, push, rows, self.profile, self.member, start, times, derivative)

    def moved(self, time: float) -> tuple[float, float]:
        """Return displacement and velocity."""
        alone = self.profile[self.member] if self.profile.shape else self.profile
        w, speed, _ = alone.kinematics(time)
        return float(w), float(speed)


class _Member(NamedTuple):
    """One member of a batch: its motions, rows of the outputs, state at t = 0, and inputs."""

    motions: LowestMotions
    rows: Array
    start: Array
    causes: list[_Acting]


def _members(
    system: System,
    causes: Sequence[_DrivingInput],
    outputs: Callable[[Modes], Array],
    modes: int,
    zeta: Array,
    momenta: tuple[Load | None, Load | None],
    check: Callable[[BaseMotion, Array], None],
    *,
    whole: bool,
) -> tuple[tuple[int, ...], Iterator[_Member]]:
    """Return the shape of the batch and its members; see :func:`lowest_motions` for ``whole``."""
    shapes = {f"motion {k}": np.empty(cause.profile.shape) for k, cause in enumerate(causes)}
    shape = broadcastable(values=np.empty(system.shape), zeta=zeta, **shapes)
    columns, ratios = flat_columns(system.parameters, shape), np.broadcast_to(zeta, shape).ravel()
    speeds = [np.broadcast_to(cause.profile.velocity(0.0) if cause.strikes else 0.0, shape) for cause in causes]

    def member(column: Array, ratio: float) -> _Member:
        """Return a member with the inputs of the first motions of a batch."""
        ((_, problem),) = system.numerics("pencil").problems(column)
        motions = lowest_motions(problem, modes, ratio, whole=whole)
        one = system.model.at(dict(zip(system.numerics("names"), column[:, 0], strict=True)))
        omega = np.sort(np.abs(motions.eigenvalues.imag))
        start = _projected(one, motions, motions.start, momenta[0])
        start = start + _projected(one, motions, motions.push, momenta[1])
        acting = []
        for cause in causes:
            check(cause.profile, omega)
            *lower, push = (_projected(one, motions, motions.push, load) for load in cause.loads)
            support = None if cause.loads[:2] == (None, None) else np.stack(lower)
            acting.append(_Acting(cause.profile, (), push, 0.0, support))
        return _Member(motions, outputs(motions.basis) @ motions.shapes, start, acting)

    def members() -> Iterator[_Member]:
        kept, found = b"", None
        for number, index in enumerate(np.ndindex(shape)):
            column = columns[:, number : number + 1]
            key = np.append(column, ratios[number]).tobytes()
            if found is None or key != kept:  # the motion is the fastest index
                found, kept = member(column, float(ratios[number])), key
            acting = []
            for speed, one in zip(speeds, found.causes, strict=True):
                own = _member(index, one.profile.shape)
                acting.append(one._replace(member=own, strike=float(speed[index])))
            yield found._replace(causes=acting)

    return shape, members()


def _causes(system: System, histories: Mapping[str, BaseMotion | Force], start: Start) -> list[_DrivingInput]:
    found = []
    for name, history in histories.items():
        force = isinstance(history, Force)
        profile = history.profile if isinstance(history, Force) else history
        loads = {2: system.numerics("load", name)} if force else system.numerics("loads", name)
        for load in loads.values():
            check_forces(system, load, system.numerics("pencil"))
        found.append(
            _DrivingInput(profile, (loads.get(0), loads.get(1), loads.get(2)), not force and start == "inertial")
        )
    constant = system.numerics("constant")
    return found if constant is None else [*found, _DrivingInput(Force(1.0).profile, (None, None, constant), False)]


def _momenta(system: System, initial: Mapping[Any, Any] | None) -> tuple[Load | None, Load | None]:
    """Return the momenta of initial displacements and velocities as loads, None where they are zero."""
    if not initial:
        return None, None
    from cra_sym.model.loads import momentum

    return momentum(system.model, initial, 0), momentum(system.model, initial, 1)


def _projected(one: System, motions: LowestMotions, effect: Array, load: Load | None) -> Array:
    """Return the rate of the state per unit of a load on the coordinates of the basis."""
    if load is None:
        return np.zeros(len(motions.system))
    moved: Array = effect @ project(one.domain, motions.basis, load)
    return moved


def _member(index: tuple[int, ...], shape: tuple[int, ...]) -> tuple[int, ...]:
    """Return the member of an array of that shape that goes with one of the batch."""
    last = index[len(index) - len(shape) :]
    return tuple(0 if size == 1 else k for k, size in zip(last, shape, strict=True))
