"""Input shapers: sequences of impulses that reduce the residual vibration of a known mode after a move."""

from __future__ import annotations

from math import comb

import numpy as np
from numpy.typing import NDArray

from cra_sym.checks import broadcastable, count, default_floating_point, real_array
from cra_sym.si import Numbers, paired

__all__ = ["input_shaper"]

Array = NDArray[np.float64]
_MOST_IMPULSES = 50
_MOST_HUMPS = 10
_HALVINGS = 60  # bisections, which reach rounding
_BAND = np.linspace(-1.0, 1.0, 201)


@default_floating_point
def input_shaper(
    angular_frequency: Numbers, zeta: Numbers = 0.0, order: int = 1, *, humps: int = 0, tolerance: Numbers | None = None
) -> tuple[Array, Array]:
    r"""Return amplitudes and times of a shaper for a mode, for :meth:`BaseMotion.shaped`.

    Two impulses half a damped period apart cancel each other's residual vibration: (1, K)/(1 + K) with K = exp(-pi zeta
    / sqrt(1 - zeta^2)) (ZV). Applied ``order`` times it also zeroes the first ``order - 1`` derivatives of the residual
    vibration by the mode's frequency, for half a period each: 2 is ZVD, 3 is ZVDD (Singer and Seering, 1990). With
    ``humps`` the shaper is extra-insensitive (EI): the residual vibration is at most ``tolerance`` over the widest band
    of frequencies possible for that number of impulses (Singhose, Seering and Singer, 1994 and 1997); as a function of
    frequency it has that many humps of this height.

    Parameters
    ----------
    angular_frequency : array_like
        omega of the mode, rad/s; positive. Arrays are a batch.
    zeta : array_like
        Damping ratio, in [0, 1).
    order : int
        1 to 50; 1 with humps.
    humps : int
        0 for a zero-vibration shaper, 1 (EI) to 10.
    tolerance : array_like, optional
        Residual vibration over that of a single impulse, in (0, 1); 0.05 by default. With humps only.

    Returns
    -------
    amplitudes, times : ndarray, shape (..., order + 1) or (..., humps + 2)
        Amplitudes add up to 1; times in s.

    Raises
    ------
    TypeError, ValueError
        If an argument is out of its range or shapes do not broadcast together.

    Notes
    -----
    Without damping the residual of n + 1 impulses half a period apart is :math:`|P(s)|`, a polynomial of degree n in
    :math:`s = \cos(\pi \omega' / 2\omega)`, with P(1) = 1. Of all of them V T_n(c s) with V T_n(c) = 1 stays within V
    over the widest interval about s = 0, as with Dolph's antenna arrays; that is the EI shaper with n - 1 humps. With
    damping amplitude k is multiplied with K^k, and V chosen so that the largest residual in the band is the tolerance:
    the other humps are lower then.

    Examples
    --------
    >>> import numpy as np
    >>> amplitudes, times = input_shaper(2 * np.pi, order=2)
    >>> print(amplitudes, times)
    [0.25 0.5  0.25] [0.  0.5 1. ]
    >>> print(input_shaper(2 * np.pi, humps=1, tolerance=0.05)[0])
    [0.2625 0.475  0.2625]
    """
    given = paired({"angular_frequency": angular_frequency, "zeta": zeta}, {"angular_frequency": "rad/s", "zeta": "1"})
    omega = real_array("angular_frequency", given["angular_frequency"], low=1e-300, unit="rad/s")
    ratio = real_array(
        "zeta", given["zeta"], low=0.0, high=np.nextafter(1.0, 0.0), unit="1", must="real numbers in [0, 1)"
    )
    order, humps = count("order", order, high=_MOST_IMPULSES), count("humps", humps, low=0, high=_MOST_HUMPS)
    if tolerance is not None and not humps:
        raise ValueError("tolerance: must be left out for humps = 0, which leaves no vibration")
    if humps and order > 1:
        raise ValueError(f"order = {order}: must be 1 with humps = {humps}")
    left = real_array(
        "tolerance", 0.05 if tolerance is None else tolerance, low=1e-12, high=1 - 1e-12, unit="1",
        must="real numbers in (0, 1)",
    )  # fmt: skip
    broadcastable(angular_frequency=omega, zeta=ratio, tolerance=left)
    root = np.sqrt(1 - ratio**2)
    if humps:
        amplitudes = _insensitive(left + 0 * ratio, ratio + 0 * left, humps + 1)
    else:
        amplitudes = _damped(np.array([comb(order, k) for k in range(order + 1)]) / 2.0**order, ratio)
    times = (np.pi / (omega * root))[..., None] * np.arange(amplitudes.shape[-1])
    amplitudes, times = np.broadcast_arrays(amplitudes, times)
    return amplitudes, times


def _damped(amplitudes: Array, zeta: Array) -> Array:
    """Return amplitudes for a mode that decays from impulse to impulse, half a damped period apart."""
    decay = np.exp(-np.pi * zeta / np.sqrt(1 - zeta**2))[..., None]
    weighted = amplitudes * decay ** np.arange(amplitudes.shape[-1])
    return np.asarray(weighted / weighted.sum(axis=-1, keepdims=True))


def _insensitive(tolerance: Array, zeta: Array, degree: int) -> Array:
    """Return the amplitudes whose largest residual in their band is the tolerance, shape (..., degree + 1)."""
    if not zeta.any():
        return _equal_humps(tolerance, degree)
    low, high = np.full(tolerance.shape, -30.0), np.full(tolerance.shape, 30.0)  # of ln(V / (1 - V))
    for _ in range(_HALVINGS):
        middle = 0.5 * (low + high)
        height = 1 / (1 + np.exp(-middle))
        most = _residual(_damped(_equal_humps(height, degree), zeta), zeta, _band(height, degree)).max(axis=-1)
        low, high = np.where(most < tolerance, middle, low), np.where(most < tolerance, high, middle)
    return _damped(_equal_humps(1 / (1 + np.exp(-low)), degree), zeta)


def _equal_humps(height: Array, degree: int) -> Array:
    """Return the amplitudes without damping: coefficients in z of z^(n/2) V T_n(c cos(arg z / 2))."""
    scale = _scale(height, degree)[..., None]
    angle = np.pi * np.arange(degree + 1) / (degree + 1)
    before, values = np.ones_like(scale * angle), scale * np.cos(angle)
    for _ in range(degree - 1):
        before, values = values, 2 * scale * np.cos(angle) * values - before
    on_circle = height[..., None] * values * np.exp(1j * degree * angle)
    return np.asarray(np.fft.fft(on_circle, axis=-1).real / (degree + 1))


def _scale(height: Array, degree: int) -> Array:
    return np.asarray(np.cosh(np.arccosh(1 / height) / degree))


def _band(height: Array, degree: int) -> Array:
    """Return frequencies over that of the mode that span the band of the humps, shape (..., points)."""
    half = 2 / np.pi * np.arcsin(1 / _scale(height, degree))
    return np.asarray(1 + half[..., None] * _BAND)


def _residual(amplitudes: Array, zeta: Array, frequency: Array) -> Array:
    """Return the amplitude left by impulses over that of a single one, shape (..., frequencies).

    At the last impulse, of a mode whose frequency is ``frequency`` times that of the shaper, with the same zeta.
    """
    zeta = zeta[..., None]
    turn = np.pi * (zeta / np.sqrt(1 - zeta**2) + 1j) * frequency  # of one impulse after the other
    steps = np.arange(amplitudes.shape[-1])
    late = (amplitudes[..., None, :] * np.exp(turn[..., None] * (steps - steps[-1]))).sum(axis=-1)
    return np.asarray(np.abs(late))
