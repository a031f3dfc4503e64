"""Modes with elastic-slip elements in time, exact from event to event.

An element is a spring in series with a slider: it sticks below the slip force, and slips with that force until the
sliding velocity vanishes. Between such events the system is linear, but for polynomial forces. A step is the Taylor
series of its motion to rounding. Within it forces and velocities are polynomials, whose first roots, isolated by
Descartes' rule of signs, are the events. There is no fixed step.

Arrays of one number a batch member have the members along their last axis.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from .first_roots import first_roots, hull, rounding
from .motion_terms import Harmonic, Piecewise
from .slip_loads import Cause, add_acceleration, next_knot
from .slip_polynomials import ForceSeries, reach
from .slip_statics import SlippingModes, applied, first_forces, stuck_tangent, tangent_stiffness

__all__ = [
    "ORDER",
    "Cause",
    "Events",
    "SlipStep",
    "Start",
    "fastest",
    "follow",
]  # fmt: skip

Array = NDArray[np.float64]
ORDER = 36
"""Degree of the series of a step."""
_REACH = 5.0  # length of a step times the highest frequency: the first term left out is 5^37/37! = 5e-18
_MOST_STEPS = 1_000_000
_STALLED = 8  # largest number of events at the same time of a member, per element
_CLOSE = 1e-12  # margin to the slip force, relative: elements on one displacement below it start to slip together
_NOTHING = 1e-9  # velocity relative to the sum of its terms below which it is rounding just after an event
_TINIEST = 1e-4  # share of a step of the linear modes below which a motion counts as divergent
_WAYS = np.arange(1.0, ORDER + 1)[:, None, None]
_Numbers = NDArray[np.intp]
_Event = tuple[_Numbers, _Numbers, _Numbers]
_Happened = tuple[_Numbers, Array, _Numbers, _Numbers]
_FACTORIALS = np.cumprod(np.maximum(np.arange(ORDER + 1.0), 1.0))


class Start(NamedTuple):
    """Modal displacements and velocities at t = 0, (N, P), where the sliders are at zero."""

    displacement: Array
    velocity: Array


class Events(NamedTuple):
    """Times at which elements began to slip (state 1 or -1) or to stick (0), in order of time for each member."""

    member: NDArray[np.intp]
    time: Array
    element: NDArray[np.intp]
    state: NDArray[np.int8]


class SlipStep(NamedTuple):
    """A completed step. Series are in powers of the time since its start over its span, up to `share`.

    Attributes
    ----------
    members : ndarray of int, shape (P,)
    time, span, share, end : ndarray, shape (P,)
        Start of the step, span of the series, completed share of it, end of the step; the span is 0 for finished
        members.
    series, loads : ndarray, shape (ORDER + 1, N, P)
        Modal displacements, and modal loads times the square of the span.
    moved : ndarray, shape (ORDER + 1, D, P)
        Displacements with elements.
    force : ndarray, shape (E, P)
        Of the elements at the start.
    state : ndarray of int8, shape (E, P)
        Of the elements during the step: 0 where they stick.
    """

    members: NDArray[np.intp]
    time: Array
    span: Array
    share: Array
    end: Array
    series: Array
    loads: Array
    moved: Array
    force: Array
    state: NDArray[np.int8]

    def reached(self) -> tuple[Array, Array]:
        """Return modal displacements and velocities at the end of the step."""
        powers = self.share ** np.arange(ORDER + 1)[:, None]
        rate = np.einsum("knp,kp->np", self.series[1:], powers[:-1] * _WAYS[:, 0])
        u = rate / np.where(self.span > 0, self.span, 1.0)
        return np.einsum("knp,kp->np", self.series, powers), u

    def forces(self, modes: SlippingModes) -> Array:
        """Return the forces of the elements at its end, (E, P), for the modes of its members."""
        way = np.einsum("kdp,kp->dp", self.moved[1:], self.share ** np.arange(1, ORDER + 1)[:, None])
        force = np.clip(self.force + modes.stiffness * way[modes.where], -modes.slip, modes.slip)
        return np.where(self.state == 0, force, self.force)


def follow(
    modes: SlippingModes,
    causes: Sequence[Cause],
    start: Start,
    end: Array,
    visit: Callable[[SlipStep], object],
    pauses: Array | None = None,
) -> Events:
    """Integrate the modes from t = 0 to the end of each member, and call ``visit`` with every step.

    Parameters
    ----------
    modes : SlippingModes
    causes : sequence of Cause
    start : Start
    end : ndarray, shape (P,)
    visit : callable
    pauses : ndarray, shape (T,), optional
        Ascending times at which steps end.

    Raises
    ------
    ValueError
        If the motion takes too many steps, or diverges.
    """
    march = _March.at_start(modes, causes, start, end, pauses)
    found = []
    while True:
        live = np.asarray(march.time < march.end)
        if not live.any():
            break
        if live.mean() < 0.75:
            march = march.of(np.flatnonzero(live))
        events = march.step(visit)
        if events is not None:
            found.append(events)
    if not found:
        none = np.zeros(0, np.intp)
        return Events(none, np.zeros(0), none, np.zeros(0, np.int8))
    member, time, element, state = (np.concatenate(parts) for parts in zip(*found, strict=True))
    order = np.argsort(member, kind="stable")
    return Events(member[order], time[order], element[order], state[order].astype(np.int8))


@dataclass
class _March:
    """State of the integration of the unfinished members."""

    modes: SlippingModes
    causes: Sequence[Cause]
    pauses: Array | None
    members: NDArray[np.intp]
    end: Array
    longest: Array  # span of a step
    time: Array
    q: Array
    u: Array
    force: Array
    state: NDArray[np.int8]
    fresh: NDArray[np.bool_]  # the event is at the current time
    stalled: NDArray[np.intp]
    tangent: Array  # (D, D, P): rate of the forces on the displacements by that of `rows q`

    @classmethod
    def at_start(
        cls, modes: SlippingModes, causes: Sequence[Cause], start: Start, end: Array, pauses: Array | None
    ) -> _March:
        shape = modes.slip.shape
        omega = fastest(modes, causes)
        steps = float((end * omega).max(initial=0.0)) / _REACH
        if not steps <= _MOST_STEPS:
            raise ValueError(
                f"t: the motion takes {steps:.3g} steps, must be at most {_MOST_STEPS}; ask for fewer modes"
            )
        state = np.zeros(shape, np.int8)
        return cls(
            modes, causes, pauses, np.arange(shape[1]), end, _REACH / np.maximum(omega, 1e-300), np.zeros(shape[1]),
            start.displacement.copy(), start.velocity.copy(), first_forces(modes, start.displacement), state,
            np.zeros(shape, bool), np.zeros(shape[1], np.intp), tangent_stiffness(modes, state),
        )  # fmt: skip

    def of(self, kept: NDArray[np.intp]) -> _March:
        """Return some members."""
        causes = [cause.of(kept) for cause in self.causes]
        return _March(
            self.modes.of(kept), causes, self.pauses, self.members[kept], self.end[kept], self.longest[kept],
            self.time[kept], self.q[:, kept], self.u[:, kept], self.force[:, kept], self.state[:, kept],
            self.fresh[:, kept], self.stalled[kept], self.tangent[..., kept],
        )  # fmt: skip

    def step(self, visit: Callable[[SlipStep], object]) -> _Happened | None:
        """Make a step of every member, at most to its next event; return the events."""
        target = np.minimum(self.time + self.longest, self.end)
        for cause in self.causes:
            for term in cause.terms:
                if isinstance(term, Piecewise):
                    target = np.minimum(target, next_knot(term.knots, self.time))
        if self.pauses is not None:
            padded = np.append(self.pauses, np.inf)
            target = np.minimum(target, padded[np.searchsorted(self.pauses, self.time, side="right")])
        span = target - self.time
        loads = self._loads(span)
        series, moved = self._series(span, loads)
        if self.modes.polynomials:
            span, target = self._shortened(span, target, series, moved, loads)
        share, event = self._first_events(moved)
        end = np.where(share == 1.0, target, np.minimum(self.time + span * share, target))
        step = SlipStep(self.members, self.time, span, share, end, series, loads, moved, self.force, self.state)
        visit(step)
        self._move(step)
        return None if event is None else self._switch(*event)

    def _shortened(self, span: Array, target: Array, *all_series: Array) -> tuple[Array, Array]:
        """Return span and target of steps whose series have converged; scale the series, (K, .., P), to them."""
        share = reach(all_series[0])
        if not ((share == 1.0) | (share * span > _TINIEST * self.longest)).all():
            when = f"t = {self.time[share.argmin()]:g} s, in steps below {_TINIEST:g} of those of linear modes"
            raise ValueError(f"t: the motion diverges at {when}")
        powers = (share ** np.arange(ORDER + 3)[:, None])[:, None]
        for values, shift in zip(all_series, (0, 0, 2), strict=True):  # the last one: loads
            values *= powers[shift : shift + ORDER + 1]
        return span * share, np.where(share < 1.0, self.time + span * share, target)

    def _loads(self, span: Array) -> Array:
        """Return the series of the modal loads times the square of the span."""
        total = np.zeros((ORDER + 1, *self.q.shape))
        for cause in self.causes:
            along = np.zeros((ORDER + 1, span.size))
            for term in cause.terms:
                add_acceleration(along, term, self.time, span)
            along *= span**2
            for k in np.flatnonzero(along.any(axis=1)):
                total[k] -= cause.gamma * along[k]
        return total

    def _series(self, span: Array, loads: Array) -> tuple[Array, Array]:
        """Return the series of the modal displacements and of the displacements that hold elements."""
        modes = self.modes
        series, size = np.empty((ORDER + 1, *self.q.shape)), (ORDER + 1, *self.tangent.shape[1:])
        moved, force = np.zeros(size), np.zeros(size)
        stiff, pull = -(modes.omega**2) * span**2, -modes.rows * span**2
        drag = -modes.damping * span
        driven, powers = np.asarray(loads.any(axis=(1, 2))), ForceSeries(modes.polynomials, ORDER + 1, span)
        part = np.empty_like(self.q)
        series[0], series[1], force[0] = self.q, self.u * span, modes.total(self.force)  # not yet over k!
        for k in range(ORDER + 1):
            if k > 1:
                total = np.multiply(stiff, series[k - 2], out=series[k])
                if drag.ndim == 2:
                    total += np.multiply(drag, series[k - 1], out=part)
                else:
                    total += np.einsum("mnp,np->mp", drag, series[k - 1])
                for row, value in zip(pull, force[k - 2], strict=True):
                    total += np.multiply(row, value, out=part)
                if driven[k - 2]:
                    total += loads[k - 2] * _FACTORIALS[k - 2]
                if modes.polynomials:
                    more = powers.coefficient(k - 2, series[:k] / _FACTORIALS[:k, None, None])
                    total += more * span**2 * _FACTORIALS[k - 2]
            moved[k] = (modes.rows * series[k]).sum(axis=1)
            if k > 0:
                force[k] = applied(self.tangent, moved[k])
        for values in (series, force, moved):
            values /= _FACTORIALS[:, None, None]
        if modes.give.any():
            moved -= modes.given(force)
        return series, moved

    def _first_events(self, moved: Array) -> tuple[Array, _Event | None]:
        """Return the share of the step up to the first event of each member, and the event."""
        where, slip, stiffness, stuck = self.modes.where, self.modes.slip, self.modes.stiffness, self.state == 0
        shape = moved.shape[1:]
        way = np.concatenate([np.zeros((1, *shape)), moved[1:]]).reshape(ORDER + 1, -1)
        speed = (moved[1:] * _WAYS).reshape(ORDER, -1)
        (low, high, loose), (slow, fast, noise) = (
            (bound.reshape(shape)[where] for bound in (*hull(values), rounding(values))) for values in (way, speed)
        )
        room = slip + stiffness * loose + rounding(self.force[None])
        forward, back = (self.force + stiffness * bound for bound in (high, low))
        beyond, turns = (forward > room) | (back < -room), np.minimum(self.state * slow, self.state * fast) < -noise
        unclear = np.where(stuck, beyond, turns)
        share = np.ones(self.time.size)
        if not unclear.any():
            return share, None
        cases = [np.nonzero(unclear & (stuck if new else ~stuck)) for new in (0, 1, -1)]
        new = np.repeat(np.array([0, 1, -1]), [len(member) for _, member in cases])
        element, member = (np.concatenate(parts) for parts in zip(*cases, strict=True))
        place, falls = first_roots(self._margins(moved, new, element, member))
        stalled = (place == 0.0) & (self.stalled[member] > _STALLED * len(self.modes.slip))
        place, falls = np.where(stalled, 1e-3, place), falls & ~stalled
        np.minimum.at(share, member, place)
        first = np.flatnonzero(falls & (place == share[member]))
        _, once = np.unique(
            member[first], return_index=True
        )  # further events at the same time follow in steps of zero length
        chosen = first[once]
        return share, (member[chosen], element[chosen], new[chosen])

    def _margins(self, moved: Array, new: _Numbers, element: _Numbers, member: _Numbers) -> Array:
        """Return the event functions of elements: the velocity while they slip, else the margin to the slip force."""
        series = moved[:, self.modes.where[element], member]
        speed = np.zeros_like(series)
        speed[:-1] = series[1:] * _WAYS[:, 0] * self.state[element, member]
        room = -new * self.modes.stiffness[element, member] * series
        room[0] = self.modes.slip[element, member] - new * self.force[element, member]
        found = np.where(new == 0, speed, room)
        # an element that has just stopped has no velocity, one that has just started to slip no margin, to rounding
        at_rest = (new != 0) & (room[0] == 0.0)
        lowest = np.where(at_rest, found[1], found[0])
        nothing = self.fresh[element, member] & (lowest < 0) & (-lowest <= _NOTHING * np.abs(found).sum(axis=0))
        found[1, nothing & at_rest] = 0.0
        found[0, nothing & ~at_rest] = 0.0
        return found

    def _move(self, step: SlipStep) -> None:
        """Advance the state to the end of the step."""
        self.q, u = step.reached()
        self.u = np.where(step.span > 0, u, self.u)
        self.force = step.forces(self.modes)
        gone = step.end > step.time
        self.fresh &= ~gone
        self.stalled = np.where(gone, 0, self.stalled + 1)
        self.time = step.end

    def _switch(self, member: _Numbers, element: _Numbers, new: _Numbers) -> _Happened:
        """Change elements to slipping or sticking.

        Elements on one displacement that slip in the same direction stop together. Elements that reach their slip
        forces at the same time, where a hysteresis loop closes, start to slip together.
        """
        room = self.modes.slip[:, member] - new * self.force[:, member]
        alike = np.where(new == 0, True, room <= _CLOSE * self.modes.slip[:, member])
        alike &= self.modes.where[:, None] == self.modes.where[element]
        alike &= self.state[:, member] == self.state[element, member]
        alike[element, np.arange(element.size)] = True
        element, number = np.nonzero(alike)
        member, new = member[number], new[number]
        self.state = self.state.copy()
        limit = np.where(new != 0, new, self.state[element, member])
        self.force[element, member] = limit * self.modes.slip[element, member]
        self.state[element, member] = new
        self.fresh[element, member] = True
        self.tangent[..., member] = tangent_stiffness(self.modes.of(member), self.state[:, member])
        return self.members[member], self.time[member], element, new


def fastest(modes: SlippingModes, causes: Sequence[Cause]) -> Array:
    """Return a bound of the frequencies of the stuck modes, their damping included, and of the loads."""
    tangent = stuck_tangent(modes)
    size = np.sqrt((modes.rows**2).sum(axis=1))
    stiff = np.einsum("dp,dep,ep->p", size, np.abs(tangent), size)
    square = (modes.omega**2).max(axis=0) + stiff
    drag = np.abs(modes.damping)
    half = (drag.sum(axis=0) if drag.ndim == 3 else drag).max(axis=0) / 2
    found = np.asarray(half + np.sqrt(square + half**2))
    for cause in causes:
        for term in cause.terms:
            if isinstance(term, Harmonic):
                found = np.maximum(found, np.where(term.amplitude != 0, term.angular_frequency, 0.0))
    return found
