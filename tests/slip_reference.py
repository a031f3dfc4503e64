"""Referees of motions with an elastic-slip element, by events: exact for linear structures, else by DOP853."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.integrate import solve_ivp
from scipy.optimize import brentq, fsolve


@dataclass
class Structure:
    """M x'' + C x' + K x + b F = load cos(Omega t) with the force F of a Jenkins element on b x."""

    mass: np.ndarray
    damping: np.ndarray
    stiffness: np.ndarray
    row: np.ndarray
    spring: float
    slip: float
    load: np.ndarray
    frequency: float

    @classmethod
    def one_mass(cls, omega, zeta, spring, slip, load, frequency):
        one = np.ones(1)
        return cls(
            np.eye(1), np.eye(1) * 2 * zeta * omega, np.eye(1) * omega**2, one, spring, slip, load * one, frequency
        )

    @property
    def limit(self):
        return self.slip / self.spring

    @cached_property
    def modes(self):
        """Eigenvalues and vectors of (x, v, cos, sin, slider or sign), sticking and slipping."""
        n, found = len(self.row), []
        inverse = np.linalg.inv(self.mass)
        for sticking in (True, False):
            matrix = np.zeros((2 * n + 3, 2 * n + 3))
            spring = self.spring if sticking else 0.0
            matrix[:n, n : 2 * n] = np.eye(n)
            matrix[n : 2 * n, :n] = -inverse @ (self.stiffness + spring * np.outer(self.row, self.row))
            matrix[n : 2 * n, n : 2 * n] = -inverse @ self.damping
            matrix[n : 2 * n, 2 * n] = inverse @ self.load
            matrix[n : 2 * n, 2 * n + 2] = inverse @ self.row * (self.spring if sticking else -self.slip)
            matrix[2 * n, 2 * n + 1], matrix[2 * n + 1, 2 * n] = -self.frequency, self.frequency
            values, vectors = np.linalg.eig(matrix)
            found.append((values, vectors, np.linalg.inv(vectors)))
        return found

    def part(self, start, state, sticking, last):
        """Return (x, v) as a function of times."""
        n = len(self.row)
        values, vectors, inverse = self.modes[0 if sticking else 1]
        wave = np.cos(self.frequency * start), np.sin(self.frequency * start)
        shares = inverse @ np.concatenate([state, wave, [last]])

        def at(time):
            turned = shares * np.exp(np.multiply.outer(np.asarray(time) - start, values))
            return (turned @ vectors.T).real[..., : 2 * n]

        return at

    def run(self, state, slider, start, stop, samples=200):
        """Return state and slider at the end, and the largest displacement b x at samples and events."""
        n, time, sticking, sign, largest = len(self.row), start, True, 0.0, 0.0
        step = 2 * np.pi / self.frequency / samples
        while time < stop:
            at = self.part(time, state, sticking, slider if sticking else sign)

            def beyond(moment, at=at, sticking=sticking, sign=sign, slider=slider):
                y = at(moment)
                x, v = y[..., :n] @ self.row, y[..., n:] @ self.row
                return np.abs(x - slider) - self.limit if sticking else -v * sign

            grid = time + step * np.arange(1, 2 * samples)
            grid = np.append(grid[grid < stop], stop)
            hit = np.flatnonzero(beyond(grid) > 0)
            end = stop
            if hit.size:
                low = grid[hit[0] - 1] if hit[0] else time + 1e-9 * step
                end = brentq(beyond, low, grid[hit[0]], xtol=1e-15, rtol=1e-15) if beyond(low) < 0 else low
            passed = at(np.append(grid[grid < end], end))
            largest = max(largest, float(np.abs(passed[:, :n] @ self.row).max()))
            time, state = end, passed[-1]
            x = float(state[:n] @ self.row)
            if not hit.size:
                return state, slider if sticking else x - sign * self.limit, largest
            if sticking:
                sticking, sign = False, float(np.sign(x - slider))
            else:
                sticking, slider = True, x - sign * self.limit
        return state, slider, largest

    def settled(self, periods, state=None, samples=200):
        """Return the largest displacement in the last of so many periods."""
        period = 2 * np.pi / self.frequency
        state, slider = np.zeros(2 * len(self.row)) if state is None else state, 0.0
        for _ in range(periods):
            state, slider, _ = self.run(state, slider, 0.0, period, samples)
        return self.run(state, slider, 0.0, period, 4000)[2]

    def periodic(self):
        """Return state, slider and largest displacement of the periodic motion, by shooting from rest."""
        n, period = len(self.row), 2 * np.pi / self.frequency

        def wrong(unknowns):
            x = unknowns[:n] @ self.row
            held = np.clip(unknowns[-1], x - self.limit, x + self.limit)
            end, last, _ = self.run(unknowns[:-1], held, 0.0, period)
            return np.append(end, last) - unknowns

        state, slider = np.zeros(2 * n), 0.0
        for _ in range(30):
            state, slider, _ = self.run(state, slider, 0.0, period)
        found = fsolve(wrong, np.append(state, slider), xtol=1e-13, full_output=True)[0]  # judged by what is wrong
        assert np.abs(wrong(found)).max() < 1e-9
        return found[:-1], found[-1], self.run(found[:-1], found[-1], 0.0, period, 4000)[2]


def integrated(acceleration, spring, slip, state, slider, duration):
    """Integrate x'' = acceleration(t, x, v) - F with a Jenkins element; return what ``Structure.run`` does."""
    limit, time, largest, sign = slip / spring, 0.0, 0.0, float(np.sign(state[0] - slider))
    sticking = abs(state[0] - slider) < (1 - 1e-9) * limit or state[1] * sign <= 0
    options = {"method": "DOP853", "rtol": 1e-10, "atol": 1e-12, "dense_output": True}
    while True:
        held = slider

        def force(x, sticking=sticking, sign=sign, held=held):
            return spring * (x - held) if sticking else sign * slip

        def rate(moment, y, force=force):
            return [y[1], acceleration(moment, y[0], y[1]) - force(y[0])]

        if sticking:
            events = [lambda _, y, s=s, held=held: s * (y[0] - held) - limit for s in (1.0, -1.0)]
        else:
            events = [lambda _, y, sign=sign: -sign * y[1]]
        for event in events:
            event.terminal, event.direction = True, 1.0
        run = solve_ivp(rate, (time, duration), state, events=events, max_step=0.1 * duration, **options)
        largest = max(largest, float(np.abs(run.sol(np.linspace(time, run.t[-1], 400))[0]).max()))
        time, state = run.t[-1], run.y[:, -1]
        largest = max(largest, abs(state[0]))
        if run.status != 1:
            return state, slider if sticking else state[0] - sign * limit, largest
        if sticking:
            sticking, sign = False, float(np.sign(state[0] - slider))
        else:
            sticking, slider = True, state[0] - sign * limit
