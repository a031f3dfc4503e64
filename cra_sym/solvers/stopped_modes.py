"""Complex modes after a motion has stopped: ``c' = s c + b_0 w + b_1 w' + b_2 w''``, for many motions at once."""

from __future__ import annotations

from math import factorial

import numpy as np
from numpy.typing import NDArray

from .motion import BaseMotion, Piecewise

__all__ = ["stopped_modes"]

Array = NDArray[np.float64]
Complex = NDArray[np.complex128]
_SERIES = 2.0  # modulus up to which the functions phi are summed as series
_TERMS = 20  # of these series: 2^20/24! is rounding


def stopped_modes(s: Complex, loads: Complex, strike: Array, motion: BaseMotion, stop: Array) -> Complex:
    """Return modal amplitudes at the stop, measured from the equilibrium there, shape (motions, r).

    Parameters
    ----------
    s : ndarray of complex, shape (r,)
        Eigenvalues, both of each conjugate pair in the same order.
    loads : ndarray of complex, shape (3, r)
        b_0, b_1 and b_2, conjugate too; b_0 is zero if an eigenvalue is.
    strike : ndarray, shape (motions,)
        Velocity at t = 0 that comes with an impulse on the modes.
    motion : BaseMotion
        Of shape (motions,), without harmonics that move.
    stop : ndarray, shape (motions,)
        s.
    """
    place, speed = motion.displacement(0.0), motion.velocity(0.0)
    found = np.exp(s * stop[:, None]) * loads[2] * strike[:, None] + _driven(s, loads, (place, speed), stop[:, None])
    place = place + speed * stop
    for term in motion.terms:
        if isinstance(term, Piecewise):
            effect, moved = _profile(s, loads, term, stop)
            found, place = found + effect, place + moved
    if loads[0].any():
        found = found + place[:, None] * loads[0] / s
    return np.asarray(found)


def _profile(s: Complex, loads: Complex, term: Piecewise, stop: Array) -> tuple[Complex, Array]:
    """Return the effect of the acceleration of a term, (motions, r), and by how much it moves until the stop."""
    motions = len(stop)
    knots, a, j = (np.broadcast_to(part, (motions, term.knots.shape[-1])) for part in term[1:])
    ends = np.append(knots[:, 1:], stop[:, None], axis=1)
    span = ends - knots
    v = np.cumsum((a + j * span / 2) * span, axis=1)
    v = np.append(np.zeros((motions, 1)), v[:, :-1], axis=1)
    steps = (v + (a / 2 + j * span / 6) * span) * span
    w = np.append(np.zeros((motions, 1)), np.cumsum(steps, axis=1), axis=1)
    found = np.empty((motions, len(s)), dtype=complex)
    for mode in np.flatnonzero(s.imag >= 0.0):
        parts = _driven(s[mode], loads[:, mode], (w[:, :-1], v, a, j), span)
        found[:, mode] = (np.exp(s[mode] * (stop[:, None] - ends)) * parts).sum(axis=1)
    found[:, s.imag < 0.0] = found[:, s.imag > 0.0].conj()
    return found, w[:, -1]


def _driven(s: Complex, loads: Complex, rates: tuple[Array, ...], span: Array) -> Complex:
    """Return the amplitude from zero after a span of a motion that is a polynomial, given its derivatives at first."""
    known = [*rates, *[np.zeros(())] * 3]
    if len(rates) == 2:
        known = [np.asarray(rate)[:, None] for rate in rates] + known[2:]
    total: Complex = np.zeros(1, dtype=complex)
    for n, phi in enumerate(_phi(s * span, len(rates))):
        total = total + sum(load * rate for load, rate in zip(loads, known[n:], strict=False)) * span ** (n + 1) * phi
    return total


def _phi(z: Complex, number: int) -> list[Complex]:
    """Return phi_1 to phi_number, ``phi_k(z) = sum of z^j / (j + k)!``."""
    near = np.abs(z) < _SERIES
    small, large = np.where(near, z, 0.0), np.where(near, 1.0, z)
    far: Complex = np.exp(z)
    series = np.zeros_like(z)
    for n in range(_TERMS + number, number - 1, -1):
        series = series * small + 1.0 / factorial(n)
    upward, downward = list[Complex](), [series]
    for k in range(1, number + 1):
        far = np.asarray((far - 1.0 / factorial(k - 1)) / large, dtype=complex)
        upward.append(far)
    for k in range(number - 1, 0, -1):
        series = series * small + 1.0 / factorial(k)
        downward.append(series)
    return [np.where(near, one, other) for one, other in zip(downward[::-1], upward, strict=True)]
