"""Terms of a base motion: harmonics, and piecewise-linear accelerations."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from .modal_response import pick, segment

__all__ = ["Harmonic", "MotionTerm", "Piecewise"]

Array = np.ndarray


class Harmonic(NamedTuple):
    """Disturbance ``amplitude * sin(angular_frequency * t + phase)``; the arrays, of one shape, are a batch."""

    amplitude: Array
    angular_frequency: Array
    phase: Array

    def picked(self, shape: tuple[int, ...], index: Any) -> Harmonic:
        """Return some of a batch of a shape."""
        return Harmonic(*(np.asarray(np.broadcast_to(value, shape)[index]) for value in self))

    def kinematics(self, t: Array) -> tuple[Array, Array, Array]:
        """Return displacement, velocity and acceleration at the times ``t``, which become the last axis."""
        B, varpi, psi = (value[..., None] for value in self)
        sine, cosine = np.sin(varpi * t + psi), np.cos(varpi * t + psi)
        return B * sine, B * varpi * cosine, -B * varpi**2 * sine

    @property
    def duration(self) -> Array:
        """Time after which the acceleration vanishes, s."""
        return np.where(self.amplitude * self.angular_frequency == 0, 0.0, np.inf)


class Piecewise(NamedTuple):
    """Acceleration ``acceleration[k] + jerk[k] (t - knots[k])`` from knot k to the next, the last one for ever.

    Shapes: ``velocity`` (...), ``acceleration`` and ``jerk`` (..., K), ``knots`` (K) or (..., K). Up to the first
    knot the base keeps ``velocity``.
    """

    velocity: Array
    knots: Array
    acceleration: Array
    jerk: Array

    def picked(self, shape: tuple[int, ...], index: Any) -> Piecewise:
        """Return some of a batch of a shape."""

        def rows(values: Array) -> Array:
            return np.asarray(np.broadcast_to(values, (*shape, values.shape[-1]))[index])

        knots = self.knots if self.knots.ndim == 1 else rows(self.knots)
        velocity = np.asarray(np.broadcast_to(self.velocity, shape)[index])
        return Piecewise(velocity, knots, rows(self.acceleration), rows(self.jerk))

    def kinematics(self, t: Array) -> tuple[Array, Array, Array]:
        """Return displacement, velocity and acceleration at the times ``t``, which become the last axis."""
        span, v_0 = np.diff(self.knots), self.velocity[..., None]
        a, j = self.acceleration, self.jerk
        v = np.cumsum(_after(v_0, (a[..., :-1] + j[..., :-1] * span / 2) * span), -1)
        steps = (v[..., :-1] + (a[..., :-1] / 2 + j[..., :-1] * span / 6) * span) * span
        w = np.cumsum(_after(v_0 * self.knots[..., :1], steps), -1)
        k = segment(self.knots, t)
        knot, w, v, a, j = (pick(values, k, w.shape[:-1]) for values in (self.knots, w, v, a, j))
        tau = np.maximum(t - knot, 0.0)
        moving, coast = np.where(k < 0, 0.0, 1.0), np.minimum(t - knot, 0.0)
        return (
            w + v_0 * coast + (v + (a / 2 + j * tau / 6) * tau) * tau,
            v + (a + j * tau / 2) * tau,
            (a + j * tau) * moving,
        )

    @property
    def duration(self) -> Array:
        """Time after which the acceleration vanishes, s."""
        rests = (self.acceleration[..., -1] == 0) & (self.jerk[..., -1] == 0)
        moves = np.any((self.acceleration != 0) | (self.jerk != 0), axis=-1)
        return np.where(rests, np.where(moves, self.knots[..., -1], 0.0), np.inf)


MotionTerm = Harmonic | Piecewise


def _after(first: Array, rest: Array) -> Array:
    shape = np.broadcast_shapes(first.shape[:-1], rest.shape[:-1])
    return np.concatenate([np.broadcast_to(first, (*shape, 1)), np.broadcast_to(rest, (*shape, rest.shape[-1]))], -1)
