"""Point-to-point moves: the fastest within limits of velocity, acceleration and jerk."""

from __future__ import annotations

import numpy as np

__all__ = ["check_feasible", "fastest", "quotient"]

Array = np.ndarray


def quotient(above: Array, below: Array) -> Array:
    """Return above / below, 0 where below is 0."""
    return np.where(below > 0, above / np.where(below > 0, below, 1.0), 0.0)


def fastest(d: Array, v: Array, a: Array, j: Array) -> tuple[Array, Array, Array]:
    """Return the times of a jerk phase, of constant acceleration and of constant velocity in the fastest move."""
    with np.errstate(invalid="ignore", over="ignore", divide="ignore"):
        ramp = a / j
        full = np.where(np.isinf(v), np.inf, np.maximum(v / a, np.sqrt(v / j)))  # t_j + t_a at full speed
        cruises = d > v * (full + np.minimum(ramp, np.sqrt(v / j)))
        t_j = np.where(cruises, np.minimum(ramp, np.sqrt(v / j)), np.minimum(ramp, np.cbrt(d / (2 * j))))
        short = np.sqrt(ramp**2 / 4 + d / a) - ramp / 2  # t_j + t_a of a move that never reaches full speed
        t_a = np.maximum(np.where(cruises, full, short) - t_j, 0.0)
        t_v = np.where(cruises, d / v - (full + t_j), 0.0)
    return t_j, np.where(t_j < ramp, 0.0, t_a), t_v


def check_feasible(wanted: Array, least: Array, reached: dict[str, Array]) -> None:
    """Raise a ValueError that names the limits that a wanted duration is too short for."""
    short = np.broadcast_to(wanted < least * (1 - 1e-12), least.shape)
    if short.any():
        at = np.unravel_index(int(np.argmax(short)), short.shape)
        limits = " and ".join(name for name, hit in reached.items() if np.broadcast_to(hit, least.shape)[at])
        time = np.broadcast_to(wanted, least.shape)[at]
        raise ValueError(f"duration = {time:g}: the move takes at least {least[at]:g} s within its limit {limits}")
