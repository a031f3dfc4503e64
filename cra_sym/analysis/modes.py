"""Natural frequencies, mode shapes and modal quantities of the arm, for any batch of parameters."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np

from cra_sym import checks
from cra_sym.arm.parameters import Arm
from cra_sym.arm.route import arm_route, route_values
from cra_sym.model.one_wave import OneWaveModes

__all__ = [
    "ModalParameters",
    "arm_modes",
    "frequency_parameters",
    "modal_parameters",
    "mode_shapes",
    "natural_frequencies",
]

MOST_MODES = 1000


def frequency_parameters(kappa_t: Any, kappa_r: Any, mu: Any, iota: Any = 0.0, modes: int = 3) -> np.ndarray:
    """Return the frequency parameters lambda = beta L, the zeros of the characteristic determinant (22).

    Parameters
    ----------
    kappa_t, kappa_r : array_like
        Dimensionless translational and rotational stiffness of the joint, in ``[0, inf]``; below 1e-150 they count as
        0, for their product has to be a number.
    mu, iota : array_like
        Mass and rotary inertia of the end-effector over those of the arm, in ``[0, inf)``.
    modes : int
        How many, 1 to 1000; rigid-body modes count, with lambda = 0.

    Returns
    -------
    ndarray, shape (..., modes)
        Ascending; none is missed. The relative error is a few units in the last place.

    Raises
    ------
    TypeError, ValueError
        If an argument is out of its range or the shapes do not broadcast together.

    Examples
    --------
    >>> import numpy as np
    >>> print(np.round(frequency_parameters(np.inf, np.inf, 0.0), 6))
    [1.875104 4.694091 7.854757]
    """
    modes = checks.count("modes", modes, high=MOST_MODES)
    stiffness: dict[str, Any] = {"low": 0.0, "allow_infinite": True}
    arrays = {
        "kappa_t": checks.real_array("kappa_t", kappa_t, **stiffness),
        "kappa_r": checks.real_array("kappa_r", kappa_r, **stiffness),
        "mu": checks.real_array("mu", mu, low=0.0),
        "iota": checks.real_array("iota", iota, low=0.0),
    }
    shape = checks.broadcastable(**arrays)
    return arm_route().parameters_of_groups(list(arrays.values()), shape, modes)


def natural_frequencies(arm: Arm, modes: int = 3) -> np.ndarray:
    """Return the natural frequencies (30), Hz.

    Parameters
    ----------
    arm : Arm
    modes : int
        How many, 1 to 1000; rigid-body modes count, with frequency 0.

    Returns
    -------
    ndarray, shape (..., modes)
        Ascending and complete; ``...`` is ``arm.shape``.

    Raises
    ------
    TypeError, ValueError
        If ``arm`` is no :class:`Arm`, or ``modes`` no integer from 1 to 1000.

    Examples
    --------
    >>> print(natural_frequencies(Arm.nominal().replace(m_e=0)).round(3))
    [ 2.448 15.339 42.95 ]
    """
    checks.instance("arm", arm, Arm)
    modes = checks.count("modes", modes, high=MOST_MODES)
    frequency = arm_route().angular_frequencies(route_values(arm), arm.shape, modes)
    frequency /= 2 * np.pi  # in place: fresh memory costs more than the product
    return frequency


def mode_shapes(arm: Arm, x: Any, modes: int = 3, derivative: int = 0) -> np.ndarray:
    """Return the mass-normalised mode shapes (25), or their derivatives by x, with phi(L) >= 0.

    Parameters
    ----------
    arm : Arm
    x : array_like
        Points in ``[0, L]``, m: a number or a row of points, the same for every arm of the batch.
    modes : int
        How many, 1 to 1000, rigid-body modes included.
    derivative : int
        Order of the derivative by x, 0 to 3.

    Returns
    -------
    ndarray, shape (..., modes) or (..., modes, len(x))
        In kg^-1/2 m^-derivative.

    Raises
    ------
    TypeError, ValueError
        If ``arm`` is no :class:`Arm`, ``x`` does not hold real numbers, has more than one axis or a point outside
        ``[0, L]`` of any arm, or ``modes`` or ``derivative`` is no integer in its range.
    """
    checks.instance("arm", arm, Arm)
    derivative = checks.count("derivative", derivative, low=0, high=3)
    points = checks.real_array("x", x, low=0.0)
    if points.ndim > 1:
        raise ValueError(f"x has shape {points.shape}: allowed are a number or a row of points")
    if points.size and points.max() > np.min(arm.L):
        raise ValueError(f"x = {points.max():g}: allowed are points in [0, L], L = {np.min(arm.L):g}")
    shapes = arm_modes(arm, modes).shape(0, derivative, np.atleast_1d(points))
    return shapes if points.ndim else shapes[..., 0]


@dataclass(frozen=True)
class ModalParameters:
    """Modal quantities for mass-normalised modes (M_i = 1 kg, so that K_i = omega_i^2) with phi(L) >= 0.

    The mode axis is last; ``...`` is the batch shape of the arm. All finite at zero and at infinite stiffness; each is
    computed when it is first asked for.

    Attributes
    ----------
    omega, frequency, lam : ndarray, shape (..., modes)
        Natural angular frequency (rad/s), natural frequency (Hz) and frequency parameter.
    participation : ndarray, shape (..., modes)
        Modal participation factor Gamma_i = int rho A phi_i dx + m_e phi_i(L), kg^1/2.
    root_displacement, root_slope, root_moment, root_shear : ndarray, shape (..., modes)
        phi(0), kg^-1/2, phi'(0), kg^-1/2/m, EI phi''(0), N kg^-1/2, and EI phi'''(0), N kg^-1/2/m.
    tip_displacement, tip_slope : ndarray, shape (..., modes)
        phi(L), kg^-1/2, and phi'(L), kg^-1/2/m.
    axial : ndarray, shape (..., modes, modes)
        G_ij = int (rho A (L - x) + m_e) phi_i' phi_j' dx, 1/m: work of the axial load of a base accelerated along x.
    stiffness_translation, stiffness_rotation : ndarray, shape (..., modes, modes)
        k_t phi_i(0) phi_j(0) and k_r phi_i'(0) phi_j'(0), 1/s2; 0 for infinite stiffness.
    """

    _arm: Arm = field(repr=False)
    _modes: OneWaveModes = field(repr=False)

    @property
    def lam(self) -> np.ndarray:
        """Frequency parameter."""
        return self._modes.lam

    @property
    def omega(self) -> np.ndarray:
        """Natural angular frequency, rad/s."""
        return self._modes.omega

    @cached_property
    def frequency(self) -> np.ndarray:
        """Natural frequency, Hz."""
        return self.omega / (2 * np.pi)

    @property
    def tip_displacement(self) -> np.ndarray:
        """phi(L), kg^-1/2."""
        return self._modes.displacement(1, 0)

    @property
    def tip_slope(self) -> np.ndarray:
        """phi'(L), kg^-1/2/m."""
        return self._modes.displacement(1, 1)

    @property
    def participation(self) -> np.ndarray:
        """Modal participation factor, kg^1/2."""
        return self._modes.momentum()

    @property
    def root_displacement(self) -> np.ndarray:
        """phi(0), kg^-1/2."""
        return self._modes.displacement(0, 0)

    @property
    def root_slope(self) -> np.ndarray:
        """phi'(0), kg^-1/2/m."""
        return self._modes.displacement(0, 1)

    @property
    def root_moment(self) -> np.ndarray:
        """EI phi''(0), N kg^-1/2."""
        return self._modes.force(0, 1)

    @cached_property
    def root_shear(self) -> np.ndarray:
        """EI phi'''(0), N kg^-1/2/m."""
        return 0.0 - self._modes.force(0, 0)

    @cached_property
    def stiffness_translation(self) -> np.ndarray:
        """Matrix of k_t phi_i(0) phi_j(0), 1/s2."""
        return self._joint_matrix(0)

    @cached_property
    def stiffness_rotation(self) -> np.ndarray:
        """Matrix of k_r phi_i'(0) phi_j'(0), 1/s2."""
        return self._joint_matrix(1)

    def _joint_matrix(self, spring: int) -> np.ndarray:
        root_energy = self._modes.strain()[spring]
        return root_energy[..., :, None] * root_energy[..., None, :]

    @cached_property
    def axial(self) -> np.ndarray:
        """Matrix of int (rho A (L - x) + m_e) phi_i' phi_j' dx, 1/m."""
        modes = self.lam.shape[-1]
        nodes, weights = np.polynomial.legendre.leggauss(int(np.ceil(self.lam.max(initial=0.0))) + 24)
        xi, weights = (1 + nodes) / 2, weights / 2  # more nodes than the product of two modes needs
        mu = np.broadcast_to(self._arm.mu, self._arm.shape).reshape(-1, 1)
        result = np.empty((len(mu), modes, modes))
        share = max(1_000_000 // (modes * xi.size), 1)  # bounds the memory
        for start in range(0, len(mu), share):
            part = slice(start, start + share)
            slopes = self._modes.dimensionless.lanes(part).shape(xi, 1)
            load = (1 - xi + mu[part, None]) * weights
            product = (slopes * load) @ slopes.swapaxes(1, 2)
            result[part] = (product + product.swapaxes(1, 2)) / 2  # to the last digit, as Floquet's shorter way needs
        return result.reshape(*self.lam.shape, modes) / _column(self._arm.L, 2)


def modal_parameters(arm: Arm, modes: int = 3) -> ModalParameters:
    """Return the modal quantities of the first modes, by equations (6), (25) and (30).

    Parameters
    ----------
    arm : Arm
    modes : int
        How many, 1 to 1000, rigid-body modes included.

    Returns
    -------
    ModalParameters
        Arrays of shape (..., modes) and (..., modes, modes); ``...`` is ``arm.shape``.

    Raises
    ------
    TypeError, ValueError
        If ``arm`` is no :class:`Arm`, or ``modes`` no integer from 1 to 1000.

    Examples
    --------
    >>> parameters = modal_parameters(Arm.nominal())
    >>> print(parameters.participation.round(4))
    [ 0.3868 -0.2143  0.1257]
    """
    return ModalParameters(arm, arm_modes(arm, modes))


def arm_modes(arm: Arm, modes: int) -> OneWaveModes:
    """Return the modes of the arm, from which everything else follows."""
    checks.instance("arm", arm, Arm)
    modes = checks.count("modes", modes, high=MOST_MODES)
    route, values = arm_route(), route_values(arm)
    lam = route.frequency_parameters(values, arm.shape, modes)
    return route.modes(values, arm.shape, route.in_radians(values, lam), lam)


def _column(value: float | np.ndarray, axes: int = 1) -> float | np.ndarray:
    """Return a parameter with last axes of length one, for modes and points; numbers stay numbers."""
    return value[(..., *(None,) * axes)] if isinstance(value, np.ndarray) else value
