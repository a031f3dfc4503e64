"""Recorders for the time integration of modes with elastic-slip elements: outputs, energies, largest output."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from .slip_polynomials import polynomial_forces, polynomial_potential
from .slip_statics import SlippingModes
from .slipping import ORDER, SlipStep

__all__ = ["Energies", "Ledger", "Peak", "Sampler"]

Array = NDArray[np.float64]
_POWERS = np.arange(ORDER + 1)[:, None]
_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(20)
_NODES, _WEIGHTS = (_NODES + 1) / 2, _WEIGHTS / 2
_LOOKS = np.linspace(0.0, 1.0, 33)


def _derivative(series: Array, order: int, span: Array) -> Array:
    """Return the series of a time derivative; steps of zero span are not evaluated."""
    for _ in range(order):
        series = series[1:] * np.arange(1, len(series)).reshape(-1, *[1] * (series.ndim - 1))
    return np.asarray(series / np.where(span > 0, span, 1.0) ** order)


def _at(series: Array, share: Array) -> Array:
    """Return the values (..., P) of series (K, ..., P) at shares (P)."""
    return np.asarray(np.einsum("k...p,kp->...p", series, share ** _POWERS[: len(series)]))


def _at_each(series: Array, shares: Array) -> Array:
    """Return the values (S, N, P) of series (K, N, P) at several shares (S, P)."""
    return np.asarray(np.einsum("knp,ksp->snp", series, shares ** _POWERS[: len(series), None]))


class Sampler:
    """Outputs at times, from the series of the steps.

    Parameters
    ----------
    rows : ndarray, shape (R, N, P)
    times : ndarray, shape (T,)
        Ascending, from 0 on.
    derivative : int
        Of the outputs by time; to the right of a jump.

    Attributes
    ----------
    values : ndarray, shape (R, P, T)
    """

    def __init__(self, rows: Array, times: Array, derivative: int) -> None:
        self.rows, self.times, self.derivative = rows, times, derivative
        self.values = np.zeros((rows.shape[0], rows.shape[2], times.size))
        self._next = np.zeros(rows.shape[2], np.intp)

    def __call__(self, step: SlipStep) -> None:
        """Record the times within a step; a time at its end belongs to the next step, except the last time."""
        begin = self._next[step.members]
        until = np.searchsorted(self.times, step.end, side="left")
        until = np.where(step.end >= self.times[-1], self.times.size, until)
        count = np.where(step.end > step.time, until - begin, 0)
        if not count.any():
            return
        lane = np.repeat(np.arange(count.size), count)
        column = begin[lane] + np.arange(lane.size) - np.repeat(np.cumsum(count) - count, count)
        used = np.flatnonzero(count)
        rows = self.rows[..., step.members[used]]
        series = np.einsum("rnp,knp->krp", rows, step.series[..., used])
        series = _derivative(series, self.derivative, step.span[used])[..., np.searchsorted(used, lane)]
        share = (self.times[column] - step.time[lane]) / step.span[lane]
        self.values[:, step.members[lane], column] = _at(series, share)
        self._next[step.members] = begin + count


class Energies(NamedTuple):
    """Energy balance in the moving frame, J, shape (P, T); by element (E, P, T).

    Attributes
    ----------
    kinetic, potential, elements : ndarray, shape (P, T)
        Stored in the masses, in the modes, and in the springs of the elements with the flexibility of omitted modes.
    input, dampers : ndarray, shape (P, T)
        Work of the loads, and energy dissipated by dampers, modal damping and polynomial forces without a potential,
        since t = 0.
    sliders : ndarray, shape (E, P, T)
        Energy dissipated by each slider.
    force : ndarray, shape (E, P, T)
    displacement : ndarray, shape (D, P, T)
    state : ndarray of int8, shape (E, P, T)
        State just before: 0 sticking, 1 or -1 slipping.
    """

    kinetic: Array
    potential: Array
    elements: Array
    input: Array
    dampers: Array
    sliders: Array
    force: Array
    displacement: Array
    state: NDArray[np.int8]


class Ledger:
    """Recorder of the energies at times at which steps end.

    Parameters
    ----------
    modes : SlippingModes
    times : ndarray, shape (T,)
        Ascending times from 0 on, at which the integration ends a step.
    start : tuple of ndarray, shape (N, P), and (E, P)
        Modal displacements and velocities, and forces, at t = 0.
    """

    def __init__(self, modes: SlippingModes, times: Array, start: tuple[Array, Array, Array]) -> None:
        self.modes, self.times = modes, times
        elements, members = modes.slip.shape
        one, each = (members, times.size), (elements, members, times.size)
        sums = [np.zeros(one) for _ in range(5)]
        moved = np.zeros((len(modes.rows), *one))
        self.energies = Energies(
            sums[0], sums[1], sums[2], sums[3], sums[4], np.zeros(each), np.zeros(each), moved, np.zeros(each, np.int8)
        )
        self.q = np.zeros((*modes.omega.shape, times.size))
        """Modal displacements."""
        self._work, self._drag, self._slid = np.zeros(members), np.zeros(members), np.zeros(each[:2])
        everyone = np.arange(members)
        self._write(everyone, np.zeros(members), *start, np.zeros(each[:2], np.int8))

    def __call__(self, step: SlipStep) -> None:
        """Add what a step did to the balance."""
        share, span, slipping = step.share, step.span, step.state != 0
        here = self.modes.of(step.members)
        moving = span > 0
        rate = step.series[1:] * _POWERS[1:, None]  # times the span
        lossy, whole = [term for term in here.polynomials if not term.conservative], np.where(moving, span, 1.0)
        nodes = share * _NODES[:, None]
        speed, load = _at_each(rate, nodes), _at_each(step.loads, nodes)
        drag = np.einsum("mnp,snp->smp", here.damping, speed) if here.damping.ndim == 3 else here.damping * speed
        scale = np.where(moving, _WEIGHTS[:, None] * share / whole**2, 0.0)
        self._work[step.members] += np.einsum("sp,snp,snp->p", scale, load, speed)
        self._drag[step.members] += np.einsum("sp,snp,snp->p", scale * whole, drag, speed)
        if lossy:
            for at, place, factor in zip(speed, nodes, scale * whole**2, strict=True):
                force = polynomial_forces(lossy, _at(step.series, place), at / whole)
                self._drag[step.members] -= factor * (force * at).sum(axis=0)
        slid = (_at(step.moved, share) - step.moved[0])[here.where]
        self._slid[:, step.members] += np.where(slipping, step.state * here.slip * slid, 0.0)
        arrived = np.flatnonzero(moving)
        (q, u), force = step.reached(), step.forces(here)
        self._write(
            step.members[arrived], step.end[arrived], q[:, arrived], u[:, arrived], force[:, arrived],
            step.state[:, arrived],
        )  # fmt: skip

    def _write(
        self, members: NDArray[np.intp], time: Array, q: Array, u: Array, force: Array, state: NDArray[np.int8]
    ) -> None:
        column = np.searchsorted(self.times, time)
        hit = np.flatnonzero((column < self.times.size) & (self.times[np.minimum(column, self.times.size - 1)] == time))
        if not hit.size:
            return
        members, column, q, u = members[hit], column[hit], q[:, hit], u[:, hit]
        force, here, kept = force[:, hit], self.modes.of(members), self.energies
        total = here.total(force)
        give = here.given(total)
        at = (members, column)
        self.q[:, members, column] = q
        kept.kinetic[at] = (u**2).sum(axis=0) / 2
        kept.potential[at] = ((here.omega * q) ** 2).sum(axis=0) / 2 + polynomial_potential(here.polynomials, q)
        kept.elements[at] = ((force**2 / here.stiffness).sum(axis=0) + (total * give).sum(axis=0)) / 2
        kept.input[at], kept.dampers[at] = self._work[members], self._drag[members]
        place = (slice(None), *at)
        kept.sliders[place], kept.force[place] = self._slid[:, members], force
        kept.displacement[place] = (here.rows * q).sum(axis=1) - give
        kept.state[place] = state[:, hit]


class Peak:
    """Recorder of the largest magnitude of an output from a time on, and of the state when all elements last stuck.

    Parameters
    ----------
    row : ndarray, shape (N, P)
    since : ndarray, shape (P,)
        Time at which a step ends, such as a knot of a motion.

    Attributes
    ----------
    moving : ndarray, shape (P,)
        Largest output until all elements last stuck; over all times where one still slips.
    state : list of ndarray: (N, P), (N, P), (E, P)
        Modal displacements, velocities and forces at that time.
    sticks : ndarray of bool, shape (P,)
        Whether none slips at the end.
    """

    def __init__(self, row: Array, since: Array, elements: int) -> None:
        self.row, self.since = row, since
        self.moving, self._stuck = np.zeros(since.size), np.zeros(since.size)
        self.sticks, self._begun = np.zeros(since.size, bool), np.zeros(since.size, bool)
        self.state = [np.zeros(row.shape), np.zeros(row.shape), np.zeros((elements, since.size))]

    def __call__(self, step: SlipStep) -> None:
        """Record a step."""
        counted = np.flatnonzero((step.end > step.time) & (step.time >= self.since[step.members]))
        members = step.members[counted]
        if not members.size:
            return
        series = np.einsum("np,knp->kp", self.row[:, members], step.series[..., counted])
        most = _largest(series, step.share[counted])
        sticks = (step.state[:, counted] == 0).all(axis=0)
        again = sticks & ~(self.sticks[members] & self._begun[members])
        begin = step.series[0], step.series[1] / np.where(step.span > 0, step.span, 1.0), step.force
        for kept, values in zip(self.state, begin, strict=True):
            kept[:, members[again]] = values[:, counted[again]]
        before = np.where(sticks, self.moving[members], np.maximum(self.moving[members], self._stuck[members]))
        self.moving[members] = np.where(sticks, before, np.maximum(before, most))
        self._stuck[members] = np.where(sticks, np.maximum(np.where(again, 0.0, self._stuck[members]), most), 0.0)
        self.sticks[members], self._begun[members] = sticks, True


def _largest(series: Array, share: Array) -> Array:
    """Return the largest magnitude of series (K, P) on [0, share]: of many samples, refined by Newton's method."""
    powers = _LOOKS[:, None] ** np.arange(len(series))
    scaled = series * share**_POWERS
    seen = np.abs(powers @ scaled)
    at = _LOOKS[seen.argmax(axis=0)]
    slopes = scaled[1:] * _POWERS[1:]
    bends = slopes[1:] * _POWERS[1:-1]
    for _ in range(4):
        with np.errstate(all="ignore"):
            step = _at(slopes, at) / _at(bends, at)
        at = np.clip(at - np.where(np.isfinite(step) & (np.abs(step) < _LOOKS[1]), step, 0.0), 0.0, 1.0)
    return np.asarray(np.maximum(np.abs(_at(scaled, at)), seen.max(axis=0)))
