"""Damped motions of a mode with elastic-slip elements: frequency, damping ratio and loss over amplitude."""

from __future__ import annotations

import warnings
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cra_sym.analysis.nonlinear import ConvergenceWarning, equations_of, samples, watched
from cra_sym.analysis.slip_states import ACCURACY, FIRST, elements_of, statics_of
from cra_sym.model.system import System
from cra_sym.solvers.harmonic_balance import Basis, peak
from cra_sym.solvers.slip_balance import SlipBalance
from cra_sym.solvers.slip_modes import Held, MotionsAtAmplitude
from cra_sym.solvers.slip_stability import slip_multipliers

__all__ = ["HeldCurve", "held_curve", "warn_of_missing"]

Array = NDArray[np.float64]
_MOST = 127  # harmonics
_RATIO, _FINEST = 1.5, 1.005  # ratio of successive amplitudes where a curve is followed
_FOLLOWED = 3  # harmonics with which a curve is followed where starts with fewer do not converge
_TRIALS = 60  # steps towards the next amplitude
_JUMP = 0.05  # change of frequency and damping ratio by more harmonics beyond which it is another motion
_UNSTABLE = 1e-6
_COARSE = 1e-3  # change of frequency or damping ratio by the last harmonics that causes a warning


@dataclass(frozen=True, eq=False)
class HeldCurve:
    """Motions at given amplitudes, arrays with one axis; nan where none was found."""

    angular_frequency: Array
    damping_ratio: Array
    loss: Array
    energy: Array
    stable: NDArray[np.bool_]
    error_modes: Array
    error_harmonics: Array
    coefficients: Array


def held_curve(
    system: System, mode: int, amplitudes: Array, modes: int, harmonics: int | None, place: Any, field: Any
) -> HeldCurve:
    """Return the motions of a mode at amplitudes; arguments are those of :func:`cra_sym.backbone`."""
    problem = _problem(system, mode, modes, FIRST if harmonics is None else min(FIRST, harmonics), place, field)
    if not problem.stuck_frequency() > 0:
        raise ValueError(f"mode = {mode}: is a rigid-body mode and does not vibrate")
    found, change = _converged_motions(problem, amplitudes)
    stopped = ~found.good | (change > 0)
    more = min(modes + 3, system.without_hysteresis.most_modes)
    wide = _problem(system, mode, more, len(problem.balance.basis.sines), place, field)
    missing = _change(found, wide.solved(_widened(found, problem, wide), amplitudes))
    if harmonics is not None and harmonics > FIRST:
        problem, found, change, stopped = _richer(problem, found, amplitudes, harmonics, change, stopped)
    before = np.full(len(amplitudes), np.inf)
    while True:
        more = 2 * len(problem.balance.basis.sines) + 1
        rich, finer, change, stopped = _richer(problem, found, amplitudes, more, change, stopped)
        if harmonics is not None:
            return _held_curve_of(problem, found, change, missing)
        # the last two changes are extrapolated as a geometric series
        with np.errstate(invalid="ignore"):
            left = np.where(stopped, change, change * np.minimum(change / np.maximum(before, 1e-300), 1.0))
            first = np.isinf(before) & ~stopped
        left = np.where(first, change, left)
        problem, found, before = rich, finer, change
        if len(rich.balance.basis.sines) >= _MOST or not (left[~stopped] > ACCURACY).any():
            return _held_curve_of(problem, found, left, missing)


def warn_of_missing(found: HeldCurve, amplitudes: Array) -> None:
    """Warn, at the user's call, of motions that were not found or have too few harmonics."""
    missing = np.flatnonzero(np.isnan(found.angular_frequency))
    if missing.size:
        text = f"no motion was found at amplitude = {amplitudes[missing[0]]:g}"
        warnings.warn(text, ConvergenceWarning, stacklevel=5)
    coarse = np.flatnonzero(found.error_harmonics > _COARSE)
    if coarse.size:
        text = (
            f"at amplitude = {amplitudes[coarse[0]]:g} more harmonics do not converge, as they meet other modes; "
            "error_harmonics tells what the last of them changed. Fewer modes have fewer of these resonances"
        )
        warnings.warn(text, ConvergenceWarning, stacklevel=5)


Flags = NDArray[np.bool_]


def _with(problem: MotionsAtAmplitude, harmonics: int) -> MotionsAtAmplitude:
    """Return the problem with another number of harmonics."""
    degree = problem.balance.equations.degree
    balance = replace(problem.balance, basis=Basis.whole(harmonics, samples(degree, harmonics)))
    return MotionsAtAmplitude(balance, problem.mode, problem.rows, problem.statics)


def _richer(
    problem: MotionsAtAmplitude, found: Held, amplitudes: Array, harmonics: int, change: Array, stopped: Flags
) -> tuple[MotionsAtAmplitude, Held, Array, Flags]:
    """Return the problem with more harmonics, its motions, their change, and which motions stay at the former number.

    A motion that does not converge with more harmonics is kept, with the change by the last ones.
    """
    rich = _with(problem, harmonics)
    start = _embedded(found, problem, rich)
    open_ = np.flatnonzero(~stopped)
    finer = rich.solved(start[open_], amplitudes[open_])
    new = _change(start[open_], finer)
    good = finer.good & (new < _JUMP)
    change, stopped = change.copy(), stopped.copy()
    change[open_[good]], stopped[open_[~good]] = new[good], True
    start.put(open_[good], finer[np.flatnonzero(good)])
    return rich, start, change, stopped


def _converged_motions(problem: MotionsAtAmplitude, amplitudes: Array) -> tuple[Held, Array]:
    """Return the motions, and the change by the last harmonics where more do not converge, nan elsewhere.

    An odd multiple of the frequency may coincide with that of another mode, which has hardly any damping there.
    """
    change = np.full(len(amplitudes), np.nan)
    if problem.balance.equations.energies or problem.balance.equations.forces:
        return _at(problem, amplitudes), change  # linear starts ignore polynomial terms, so the curve is followed
    found, total = problem.solved(problem.linear(amplitudes), amplitudes), len(problem.balance.basis.sines)
    missing = np.flatnonzero(~found.good)
    if not missing.size:
        return found, change
    wanted, poor = amplitudes[missing], _with(problem, 1)
    low, last = _at(poor, wanted), np.full(missing.size, np.inf)
    stopped = ~low.good
    while len(poor.balance.basis.sines) < total:
        more = min(2 * len(poor.balance.basis.sines) + 1, total)
        poor, low, last, stopped = _richer(poor, low, wanted, more, last, stopped)
        again = np.flatnonzero(stopped)
        if more <= _FOLLOWED and again.size:
            other = _at(poor, wanted[again])
            last[again] = np.where(other.good, _change(low[again], other), last[again])
            stopped[again] = ~other.good
            low.put(again[other.good], other[np.flatnonzero(other.good)])
    found.put(missing, low)
    change[missing[stopped]] = last[stopped]
    return found, change


def _problem(system: System, mode: int, modes: int, harmonics: int, place: Any, field: Any) -> MotionsAtAmplitude:
    base = system.without_hysteresis
    whole = equations_of(base, modes)
    if base.numerics("constant") is not None:
        raise ValueError("system: must have no constant load, since a backbone starts from rest at zero")
    energies = tuple(term for term in whole.energies if not term.causes)
    if any(term.velocities % 2 for term in energies):
        raise ValueError(
            "system: must have no gyroscopic terms, since a backbone needs motions that are reversible in time"
        )
    forces = tuple(term for term in whole.forces if not term.causes)
    equations = type(whole)(whole.omega, whole.damping, energies, forces)
    basis = Basis.whole(harmonics, samples(equations.degree, harmonics))
    balance = SlipBalance(equations, basis, elements_of(system, modes))
    rows = watched(base, modes, place, field)
    if not np.abs(rows).max() > 0:
        raise ValueError("amplitude: no mode moves there; choose another place or field")
    statics = statics_of(system, modes, (), place, field)[len(balance.elements.groups)]
    return MotionsAtAmplitude(balance, mode - 1, rows, statics)


def _at(problem: MotionsAtAmplitude, amplitudes: Array) -> Held:
    """Return the motions, from linear starts or, where these fail, by continuation from smaller amplitudes."""
    found = problem.solved(problem.linear(amplitudes), amplitudes)
    if problem.balance.equations.energies or problem.balance.equations.forces:
        found.good[:] = False
    if found.good.all():
        return found
    order = np.argsort(amplitudes)
    if found.good.all():
        return found
    small = np.array([min(amplitudes.min(), 0.5 * _first_slip(problem))])
    last, at = problem.solved(problem.linear(small), small), float(small[0])
    for number in order:
        target, step = float(amplitudes[number]), _RATIO
        if found.good[number]:
            last, at = found[np.array([number])], target
            continue
        for _ in range(_TRIALS):
            if not last.good[0]:
                break
            new = min(target, at * step)
            trial = problem.solved(last.scaled(np.array([new / at])), np.array([new]))
            if trial.good[0] and abs(trial.frequency[0] / last.frequency[0] - 1) < 0.2:
                last, at, step = trial, new, min(step * 1.3, _RATIO)
                if at >= target:
                    break
            else:
                step = step**0.5
                if step < _FINEST:
                    break
        if at == target and last.good[0]:
            found.put(np.array([number]), last)
    return found


def _first_slip(problem: MotionsAtAmplitude) -> float:
    """Return the amplitude of the stuck mode at which an element begins to slip."""
    one = problem.linear(np.array([1e-12 * problem.balance.elements.limit]))
    moved = np.abs(one.displacements[0, :, 1])
    limits = [float((f / k).min()) for k, f in problem.balance.elements.groups]
    shares = [size / limit for size, limit in zip(moved, limits, strict=True)]
    return float(1e-12 * problem.balance.elements.limit / max(max(shares), 1e-300))


def _embedded(found: Held, old: MotionsAtAmplitude, new: MotionsAtAmplitude) -> Held:
    h, more = len(old.balance.basis.sines), len(new.balance.basis.sines)

    def whole(given: Array) -> Array:
        out = np.zeros((*given.shape[:2], 2 * more + 1))
        out[..., : h + 1], out[..., more + 1 : more + 1 + h] = np.split(given, [h + 1], axis=-1)
        return out

    numbers = found.frequency.copy(), found.ratio.copy()
    return Held(whole(found.coefficients), whole(found.displacements), *numbers, found.good.copy())


def _widened(found: Held, old: MotionsAtAmplitude, new: MotionsAtAmplitude) -> Held:
    """Return starts with more modes, which follow the forces of the elements statically."""
    points, n, size = found.coefficients.shape
    force = old.balance.forces(found.displacements.reshape(points, -1))[0].reshape(found.displacements.shape)
    omega, rows = new.balance.equations.omega, new.balance.elements.rows
    whole = np.zeros((points, omega.size, size))
    whole[:, :n] = found.coefficients
    whole[:, n:] = -(rows[:, n:].T @ force) / omega[n:, None] ** 2
    w = rows @ whole - new.balance.elements.coupling @ force
    return Held(whole, w, found.frequency, found.ratio, found.good)


def _change(one: Held, other: Held) -> Array:
    """Return the larger of the relative change of the frequency and the change of the damping ratio."""
    both = one.good & other.good
    change = np.maximum(np.abs(other.frequency / one.frequency - 1.0), np.abs(other.ratio - one.ratio))
    return np.where(both, change, np.nan)


def _held_curve_of(problem: MotionsAtAmplitude, found: Held, harmonics: Array, modes: Array) -> HeldCurve:
    balance, good = problem.balance, found.good
    basis, equations = balance.basis, balance.equations
    force = balance.forces(found.displacements.reshape(good.size, -1))[0]
    _, phase = peak(basis, np.ones(1), problem.series(found.coefficients, force)[:, None])
    energy, loss, stable = np.full(good.size, np.nan), np.full(good.size, np.nan), np.zeros(good.size, bool)
    for k in np.flatnonzero(good):
        x, omega = found.coefficients[k], float(found.frequency[k])
        cycles = balance.elements.cycles(found.displacements[k : k + 1])
        q, v = x @ basis.values(phase[k]), omega * (x @ basis.values(phase[k], 1))
        energy[k] = equations.energy(q, v) + sum(c.energy(float(phase[k])) for c in cycles)
        speed = (basis.orders**2 * x**2).sum()  # the integral of the squared velocities over pi omega
        loss[k] = 2 * found.ratio[k] * np.pi * omega**2 * speed
        values = slip_multipliers(equations, basis, x, omega, balance.elements, cycles)
        stable[k] = np.abs(values).max() <= 1.0 + _UNSTABLE

    def only(values: Array) -> Array:
        return np.where(good.reshape(-1, *(1,) * (values.ndim - 1)), values, np.nan)

    return HeldCurve(
        only(found.frequency), only(found.ratio), loss, energy, stable, modes, harmonics, only(found.coefficients)
    )
