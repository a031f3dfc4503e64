"""Frequency response from base acceleration to elastic displacement: exact, from the boundary-value problem."""

from __future__ import annotations

from typing import Any, Literal

import numpy as np

from cra_sym.arm.parameters import Arm
from cra_sym.checks import choice, instance, real_array
from cra_sym.kernels import derived_kernel

__all__ = ["frequency_response"]

_conditions = derived_kernel("cra_sym.model.forced_waves:end_conditions", backend="numpy")
_waves = derived_kernel("cra_sym.model.forced_waves:wave_jets", backend="numpy")
_series = derived_kernel("cra_sym.model.forced_waves:series_jets", backend="numpy")

_NEAR = 2.0  # modulus of lambda below which power series serve
_BELOW, _ABOVE, _DIGITS = 18.0, 14.0, 37.0  # reach of the quadrature in ln y, and minus ln of its error


_FASTEST = 1e60  # rad/s, whose fourth power is a number; what is slower than its inverse is static


def frequency_response(
    arm: Arm, angular_frequency: Any, x: Any = None, *, damping: Literal["modal", "structural"] = "modal"
) -> Any:
    """Return the elastic displacement v(x) per unit of harmonic base acceleration, exp(i Omega t), m per m/s2 = s2.

    No modes are summed: the boundary-value problem is solved at each frequency, for any stiffness from zero to
    infinity.

    Parameters
    ----------
    arm : Arm
        ``arm.zeta`` is the damping.
    angular_frequency : array_like
        Omega, rad/s, not negative; a number or one axis.
    x : array_like, optional
        Place or one axis of places in [0, L], m; the tip by default.
    damping : {'modal', 'structural'}
        'modal': viscous, the same ratio zeta in every mode, as in the time domain. No local damper has this property,
        but the sum over all modes is known, see Notes. 'structural': a loss factor 2 zeta of manipulator and joint, E
        (1 + 2 i zeta), k_t (1 + 2 i zeta), k_r (1 + 2 i zeta). Both agree at resonances, to first order in zeta.

    Returns
    -------
    complex ndarray, shape (..., x, Omega)
        A single x or Omega has no axis. Without damping it grows beyond all bounds at a natural frequency.

    Raises
    ------
    TypeError, ValueError
        If an argument is out of its range.

    Notes
    -----
    Mode i answers with -phi_i Gamma_i f(omega_i), f(z) = 1 / (z^2 + 2 i zeta Omega z - Omega^2) having its poles at
    alpha = Omega (sqrt(1 - zeta^2) - i zeta) and at -conj(alpha). With V(z), the undamped response at complex
    frequency z, the sum over modes is a sum of residues of 2 z V(z) f(z) in the right half plane, and the residue
    theorem gives

        H = 2 alpha V(alpha) / (alpha + conj(alpha))
            + (4 i zeta Omega / pi) int_0^inf y^2 V(i y) / ((y^2 + Omega^2)^2 - (2 zeta Omega y)^2) dy.

    The integrand has no resonance, and the trapezoidal rule in ln y converges geometrically: to rounding, or to about
    1e-8 of the damping's share where there is a rigid-body mode.

    Examples
    --------
    >>> from cra_sym import Arm, frequency_response
    >>> static = frequency_response(Arm.nominal(), 0.0)
    >>> print(f"{static.real:.4e} s2")
    -6.6053e-03 s2
    """
    instance("arm", arm, Arm)
    Omega = real_array("angular_frequency", angular_frequency, low=0.0, high=_FASTEST)
    Omega = np.where(Omega * _FASTEST < 1.0, 0.0, Omega)
    places = real_array("x", np.min(arm.L) if x is None else x, low=0.0, high=float(np.min(arm.L)))
    for name, value in (("angular_frequency", Omega), ("x", places)):
        if value.ndim > 1:
            raise ValueError(f"{name} has shape {value.shape}: allowed are a number or one axis")
    choice("damping", damping, ("modal", "structural"))
    scale = _column(arm, arm.angular_frequency_scale)
    ratio, xi = np.broadcast_to(arm.zeta, arm.shape)[..., None], np.atleast_1d(places) / _column(arm, arm.L)
    xi = np.where(x is None, 1.0, xi)
    grid = np.atleast_1d(Omega) / scale  # lambda^2
    solve = _modal if damping == "modal" else _structural
    response = solve(arm, grid, ratio, xi) / (scale**2)[..., None]
    response = response if places.ndim else response[..., 0, :]
    return response if Omega.ndim else response[..., 0]


def _column(arm: Arm, value: Any) -> np.ndarray:
    return np.broadcast_to(value, arm.shape)[..., None]


def _structural(arm: Arm, grid: np.ndarray, ratio: np.ndarray, xi: np.ndarray) -> np.ndarray:
    loss = 1 + 2j * ratio
    return _undamped(arm, grid / np.sqrt(loss), xi) / loss[..., None]


def _modal(arm: Arm, grid: np.ndarray, ratio: np.ndarray, xi: np.ndarray) -> np.ndarray:
    cosine = np.sqrt(1 - ratio**2)
    static = grid == 0
    alpha = grid * (cosine - 1j * ratio)
    weight = np.where(static, 1.0, 1 - 1j * ratio / cosine)
    response = weight[..., None, :] * _undamped(arm, alpha, xi)
    if not np.any(ratio) or static.all():
        return response
    moving = grid[~static]
    step = 2 * np.pi * np.arccos(np.max(ratio)) / _DIGITS
    y = np.exp(np.arange(np.log(moving.min()) - _BELOW, np.log(moving.max()) + _ABOVE, step))
    Omega = np.where(static, 1.0, grid)[..., None, :]
    factor = ratio[..., None]
    integrand = y[:, None] ** 3 / ((y[:, None] ** 2 + Omega**2) ** 2 - (2 * factor * Omega * y[:, None]) ** 2)
    smooth = _undamped(arm, -1j * y, xi).real
    return response + np.where(static, 0.0, 4j * ratio * grid * step / np.pi)[..., None, :] * (smooth @ integrand)


def _undamped(arm: Arm, square: np.ndarray, xi: np.ndarray) -> np.ndarray:
    """Return the undamped response at complex lambda^2 (..., K) and places (..., X), shape (..., X, K).

    Real part positive or zero and imaginary part negative or zero, where the waves decay.
    """
    shape = np.broadcast_shapes(square.shape[:-1], arm.shape)
    lam = np.broadcast_to(np.sqrt(square + 0j), (*shape, square.shape[-1]))
    near = np.abs(lam) < _NEAR
    far = np.where(near, _NEAR, lam)
    Z = np.where(near, lam, 0.0) ** 4
    response = np.where(near[..., None, :], _solved(arm, _series, Z, Z, xi), _solved(arm, _waves, far, far**4, xi))
    return response


def _solved(arm: Arm, jets: Any, argument: np.ndarray, Z: np.ndarray, xi: np.ndarray) -> np.ndarray:
    kappa_t, kappa_r = (np.asarray(value)[..., None] for value in (arm.kappa_t, arm.kappa_r))
    stiff = [np.where(np.isinf(k), 1.0, k / (1 + np.where(np.isinf(k), 0.0, k))) for k in (kappa_t, kappa_r)]
    soft = [1 / (1 + k) for k in (kappa_t, kappa_r)]
    inertia = (np.asarray(value)[..., None] for value in (arm.mu, arm.iota))
    left, right = _conditions(stiff[0], soft[0], stiff[1], soft[1], *inertia, Z)
    (root, root_rest), (tip, tip_rest) = jets(0.0, argument), jets(1.0, argument)
    matrix = left @ np.concatenate([root, tip], -2)
    load = right - left @ np.concatenate([root_rest, tip_rest], -2)
    size = np.max(np.abs(matrix), -1, keepdims=True)
    matrix, load = matrix / size, load / size
    singular = np.linalg.det(matrix) == 0
    matrix = np.where(singular[..., None, None], np.eye(4), matrix)
    amplitudes = np.linalg.solve(matrix, np.where(singular[..., None, None], np.inf, load))
    basis, rest = jets(xi[..., :, None], argument[..., None, :])
    return np.einsum("...xkj,...kj->...xk", basis[..., 0, :], amplitudes[..., 0]) + rest[..., 0, 0]
