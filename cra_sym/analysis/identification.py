"""The stiffness of a bolted joint from measured natural frequencies, and whether they can tell its two springs
apart."""

from __future__ import annotations

import warnings
from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np

from cra_sym.analysis.modes import natural_frequencies
from cra_sym.analysis.sensitivities import Sensitivities, sensitivities
from cra_sym.arm.parameters import Arm
from cra_sym.checks import broadcastable, instance, real_array

__all__ = ["IdentifiabilityWarning", "JointEstimate", "identify_joint"]

_TOLD = np.log(2.0)  # a stiffness is told if its standard deviation is below a factor of two
_STARTS = np.logspace(-2, 6, 13)  # dimensionless stiffnesses among which the search starts


class IdentifiabilityWarning(UserWarning):
    """The measured frequencies do not tell the two stiffnesses of the joint apart."""


@dataclass(frozen=True)
class JointEstimate:
    """Stiffnesses of the joint that fit measured frequencies, and what the measurement says about them.

    Attributes
    ----------
    k_t, k_r : float
        N/m and N m/rad; inf where the joint is best taken as rigid.
    covariance : ndarray, shape (2, 2)
        Of (k_t, k_r) to first order, SI; inf where the data do not fix them.
    compliance_covariance : ndarray, shape (2, 2)
        Of (1/k_t, 1/k_r), SI: what stays meaningful near a rigid joint.
    log_standard_deviation : ndarray, shape (2,)
        Standard deviations of (ln k_t, ln k_r): about the relative uncertainty where it is small.
    frequencies, residuals : ndarray
        Fitted frequencies (Hz), and measured minus fitted in units of the uncertainty.
    identifiable : bool
        Whether both stiffnesses are known to better than a factor of two (one standard deviation).
    message : str
        What the data do and do not say.
    """

    k_t: float
    k_r: float
    covariance: np.ndarray
    compliance_covariance: np.ndarray
    log_standard_deviation: np.ndarray
    frequencies: np.ndarray
    residuals: np.ndarray
    identifiable: bool
    message: str


def identify_joint(arm: Arm, measured_frequencies: Any, uncertainty: Any) -> JointEstimate:
    """Return the joint's stiffnesses that fit the first natural frequencies best, with their covariance.

    Least squares with exact gradients, weighted by the uncertainty, over ln(1 + 1/kappa) of each dimensionless
    stiffness, in which a rigid joint is the ordinary value 0; started from the best of a grid.

    Parameters
    ----------
    arm : Arm
        One arm; its own k_t and k_r do not matter.
    measured_frequencies : array_like, shape (n,)
        The n lowest natural frequencies, Hz, ascending.
    uncertainty : float or array_like, shape (n,)
        Standard deviation of each, Hz; 1e-60 to 1e60.

    Returns
    -------
    JointEstimate

    Warns
    -----
    IdentifiabilityWarning
        If the data do not tell the two stiffnesses apart: fewer than two frequencies, a joint so stiff or frequencies
        so uncertain that only a combination of both is fixed.

    Raises
    ------
    TypeError, ValueError
        If ``arm`` is no :class:`Arm` or a batch, or the data are not positive, ascending and of one shape.

    Examples
    --------
    >>> from cra_sym import Arm, identify_joint, natural_frequencies
    >>> loose = Arm.nominal().replace(k_t=2e3, k_r=40.0)
    >>> estimate = identify_joint(Arm.nominal(), natural_frequencies(loose), uncertainty=0.01)
    >>> print(f"{estimate.k_t:.1f} N/m, {estimate.k_r:.3f} N m/rad")
    2000.0 N/m, 40.000 N m/rad
    """
    from scipy.optimize import least_squares

    measured, sigma = _checked(arm, measured_frequencies, uncertainty)
    units = np.array([arm.EI / arm.L**3, arm.EI / arm.L])

    @cache
    def at(*place: float) -> tuple[Arm, Sensitivities]:
        k_t, k_r = _stiffness(np.array(place)) * units
        joined = arm.replace(k_t=float(k_t), k_r=float(k_r))
        return joined, sensitivities(joined, measured.size)

    def misfit(place: np.ndarray) -> np.ndarray:
        return (at(*place)[1].frequency - measured) / sigma

    def gradient(place: np.ndarray) -> np.ndarray:
        return _gradient(*at(*place)) / sigma[:, None]

    fits = [
        least_squares(misfit, start, gradient, bounds=(0.0, 40.0), xtol=1e-14, ftol=1e-14, gtol=1e-14, x_scale="jac")
        for start in _starts(arm, units, measured, sigma)
    ]
    best = min(fits, key=lambda fit: fit.cost)
    return _estimate(*at(*np.where(best.x < 1e-12, 0.0, best.x)), measured, sigma)


def _checked(arm: Arm, measured_frequencies: Any, uncertainty: Any) -> tuple[np.ndarray, np.ndarray]:
    instance("arm", arm, Arm)
    if arm.shape:
        raise ValueError(f"arm has shape {arm.shape}: allowed is a single arm")
    measured = real_array("measured_frequencies", measured_frequencies, low=0.0, open_low=True)
    sigma = real_array("uncertainty", uncertainty, low=1e-60, high=1e60)
    if measured.ndim != 1 or measured.size == 0:
        raise ValueError(f"measured_frequencies has shape {measured.shape}: allowed is one axis of frequencies")
    if np.any(np.diff(measured) <= 0):
        raise ValueError("measured_frequencies must ascend: they are the lowest natural frequencies, in order")
    if broadcastable(measured_frequencies=measured, uncertainty=sigma) != measured.shape:
        raise ValueError(f"uncertainty has shape {sigma.shape}: allowed are a number or {measured.shape}")
    return measured, np.broadcast_to(sigma, measured.shape)


def _stiffness(place: np.ndarray) -> np.ndarray:
    """Return kappa from ln(1 + 1/kappa)."""
    with np.errstate(divide="ignore"):
        return 1 / np.expm1(place)


def _gradient(arm: Arm, found: Sensitivities) -> np.ndarray:
    """Return the derivatives of the frequencies by ln(1 + 1/kappa_t) and ln(1 + 1/kappa_r), shape (modes, 2)."""
    columns = []
    for kappa, unit, by_c, log in (
        (arm.kappa_t, arm.EI / arm.L**3, found.df_dc_t, found.log_k_t),
        (arm.kappa_r, arm.EI / arm.L, found.df_dc_r, found.log_k_r),
    ):
        columns.append(by_c / unit * (1 + 1 / kappa) if kappa > 1 else -found.frequency * log * (1 + kappa))
    return np.stack(columns, -1)


def _starts(arm: Arm, units: np.ndarray, measured: np.ndarray, sigma: np.ndarray) -> list[np.ndarray]:
    """Return the places of the two best joints of a grid."""
    k_t, k_r = _STARTS[:, None] * units[0], _STARTS * units[1]
    found = natural_frequencies(arm.replace(k_t=k_t, k_r=k_r), measured.size)
    cost = np.sum(((found - measured) / sigma) ** 2, -1)
    best = np.unravel_index(np.argsort(cost, axis=None)[:2], cost.shape)
    return [np.log1p(1 / _STARTS[[i, j]]) for i, j in zip(*best, strict=True)]


def _estimate(arm: Arm, found: Sensitivities, measured: np.ndarray, sigma: np.ndarray) -> JointEstimate:
    fitted = found.frequency
    stiffness = np.array([arm.k_t, arm.k_r])
    jacobian = np.stack([found.df_dc_t, found.df_dc_r], -1) / sigma[:, None]
    spread = _covariance(jacobian)
    rigid = np.isinf(stiffness)
    scale = np.where(rigid, 1.0, stiffness)
    relative = np.where(rigid | rigid[:, None], np.inf, spread * np.outer(scale, scale))
    deviation = np.sqrt(np.diag(relative))
    identifiable = bool(np.all(deviation < _TOLD))
    message = _verdict(stiffness, deviation, spread, jacobian)
    if not identifiable:
        warnings.warn(message, IdentifiabilityWarning, stacklevel=3)
    covariance = relative * np.outer(scale, scale)
    residuals = (measured - fitted) / sigma
    return JointEstimate(
        float(arm.k_t), float(arm.k_r), covariance, spread, deviation, fitted, residuals, identifiable, message
    )


def _covariance(jacobian: np.ndarray) -> np.ndarray:
    """Return the inverse of the Fisher information of weighted residuals; inf where it is singular."""
    size = np.linalg.norm(jacobian, axis=0)
    if jacobian.shape[0] < 2 or not size.all():
        return np.full((2, 2), np.inf)
    _, values, basis = np.linalg.svd(jacobian / size)
    if values[1] <= 1e-12 * values[0]:
        return np.full((2, 2), np.inf)
    return (basis.T / values**2) @ basis / np.outer(size, size)


def _verdict(stiffness: np.ndarray, deviation: np.ndarray, spread: np.ndarray, jacobian: np.ndarray) -> str:
    """Say in words what is known."""
    names, units = ("k_t", "k_r"), ("N/m", "N m/rad")
    told = deviation < _TOLD
    if told.all():
        return f"both stiffnesses are told: k_t to {deviation[0]:.2g} and k_r to {deviation[1]:.2g} of itself"
    least = 1 / (1 / stiffness + 2 * np.sqrt(np.diag(spread)))
    if told.any() or (np.isfinite(spread).all() and np.isinf(stiffness).any()):
        known = [f"{name} is told to {d:.2g} of itself" for name, d in zip(names, deviation, strict=True)]
        bounds = [
            f"{name} is only known to exceed {k:.3g} {unit} (2 sigma)"
            for name, k, unit in zip(names, least, units, strict=True)
        ]
        return "; ".join(np.where(told, known, bounds).tolist())
    size = np.linalg.norm(jacobian, axis=0)
    _, values, basis = np.linalg.svd(jacobian / np.where(size > 0, size, 1.0))
    weights = basis[0] * size
    ratio, error = weights[1] / weights[0], 1 / (values[0] * abs(weights[0]))
    give = 1 / stiffness[0] + ratio / stiffness[1]
    return (
        "the frequencies do not tell k_t and k_r apart: what they tell is "
        f"1/k_t + {ratio:.3g} m2 / k_r = ({give:.3g} +- {error:.2g}) m/N"
    )
