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
from cra_sym.checks import broadcastable, instance, real_array
from cra_sym.model.system import System

__all__ = ["IdentifiabilityWarning", "JointEstimate", "identify_joint"]

_TOLD = np.log(2.0)  # a stiffness is told if its standard deviation is below a factor of two
_JOINT = ("k_t", "k_r")
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


def identify_joint(system: System, measured_frequencies: Any, uncertainty: Any) -> JointEstimate:
    """Return the joint's stiffnesses that fit the first natural frequencies best, with their covariance.

    Least squares with exact gradients, weighted by the uncertainty, over ln(1 + 1/kappa) of each dimensionless
    stiffness, in which a rigid joint is the ordinary value 0; started from the best of a grid.

    Parameters
    ----------
    system : System
        One set of values, with stiffnesses k_t and k_r of an end; their own values do not matter.
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
        If ``system`` is not a :class:`System` with k_t and k_r at an end, or is a batch, or the data are not positive,
        ascending and of one shape.

    Examples
    --------
    >>> from cra_sym import Arm, identify_joint, natural_frequencies
    >>> loose = Arm.nominal().replace(k_t=2e3, k_r=40.0)
    >>> estimate = identify_joint(Arm.nominal(), natural_frequencies(loose), uncertainty=0.01)
    >>> print(f"{estimate.k_t:.1f} N/m, {estimate.k_r:.3f} N m/rad")
    2000.0 N/m, 40.000 N m/rad
    """
    from scipy.optimize import least_squares

    measured, sigma = _checked(system, measured_frequencies, uncertainty)
    units = _units(system)

    @cache
    def at(*place: float) -> tuple[np.ndarray, Sensitivities]:
        stiffness = _stiffness(np.array(place)) * units
        joined = system.replace(k_t=float(stiffness[0]), k_r=float(stiffness[1]))
        return stiffness, sensitivities(joined, measured.size, by=_JOINT)

    def misfit(place: np.ndarray) -> np.ndarray:
        return (at(*place)[1].frequency - measured) / sigma

    def gradient(place: np.ndarray) -> np.ndarray:
        return _gradient(*at(*place), units) / sigma[:, None]

    fits = [
        least_squares(misfit, start, gradient, bounds=(0.0, 40.0), xtol=1e-14, ftol=1e-14, gtol=1e-14, x_scale="jac")
        for start in _starts(system, units, measured, sigma)
    ]
    best = min(fits, key=lambda fit: fit.cost)
    return _estimate(*at(*np.where(best.x < 1e-12, 0.0, best.x)), measured, sigma)


def _units(system: System) -> np.ndarray:
    """Return the stiffnesses beside which the structure itself gives as much as the joint, N/m and N m/rad.

    The first give of a rigid joint lowers omega^2 by P^2 times its compliance, P the force of the joint in the first
    mode; P^2 / omega^2 is the stiffness that would halve it.
    """
    rigid = system.replace(k_t=np.inf, k_r=np.inf)
    ends = system.numerics("stiffnesses")
    forces = np.array([rigid.modes(1).force(*ends[name])[0] for name in _JOINT])
    return forces**2 / rigid.natural_frequencies(1) ** 2


def _checked(system: System, measured_frequencies: Any, uncertainty: Any) -> tuple[np.ndarray, np.ndarray]:
    instance("system", system, System)
    missing = [name for name in _JOINT if name not in system.numerics("stiffnesses")]
    if missing:
        raise ValueError(f"system: {missing[0]} must be the stiffness of an end of its model")
    if system.shape:
        raise ValueError(f"system has shape {system.shape}: must be a single set of values, not a batch")
    measured = real_array("measured_frequencies", measured_frequencies, low=0.0, open_low=True, unit="Hz")
    sigma = real_array("uncertainty", uncertainty, low=1e-60, high=1e60, unit="Hz")
    if measured.ndim != 1 or measured.size == 0:
        raise ValueError(f"measured_frequencies has shape {measured.shape}: must be one axis of frequencies")
    if np.any(np.diff(measured) <= 0):
        raise ValueError("measured_frequencies must ascend: they are the lowest natural frequencies, in order")
    if broadcastable(measured_frequencies=measured, uncertainty=sigma) != measured.shape:
        raise ValueError(f"uncertainty has shape {sigma.shape}: must be a number or {measured.shape}")
    return measured, np.broadcast_to(sigma, measured.shape)


def _stiffness(place: np.ndarray) -> np.ndarray:
    """Return kappa from ln(1 + 1/kappa)."""
    with np.errstate(divide="ignore"):
        return 1 / np.expm1(place)


def _gradient(stiffness: np.ndarray, found: Sensitivities, units: np.ndarray) -> np.ndarray:
    """Return the derivatives of the frequencies by ln(1 + 1/kappa) of both stiffnesses, shape (modes, 2)."""
    columns = []
    for name, value, unit in zip(_JOINT, stiffness, units, strict=True):
        kappa = value / unit
        stiff = kappa > 1
        columns.append(
            found.compliance[name] / unit * (1 + 1 / kappa)
            if stiff
            else -found.frequency * found.log[name] * (1 + kappa)
        )
    return np.stack(columns, -1)


def _starts(system: System, units: np.ndarray, measured: np.ndarray, sigma: np.ndarray) -> list[np.ndarray]:
    """Return the places of the two best joints of a grid."""
    k_t, k_r = _STARTS[:, None] * units[0], _STARTS * units[1]
    found = natural_frequencies(system.replace(k_t=k_t, k_r=k_r), measured.size)
    cost = np.sum(((found - measured) / sigma) ** 2, -1)
    best = np.unravel_index(np.argsort(cost, axis=None)[:2], cost.shape)
    return [np.log1p(1 / _STARTS[[i, j]]) for i, j in zip(*best, strict=True)]


def _estimate(stiffness: np.ndarray, found: Sensitivities, measured: np.ndarray, sigma: np.ndarray) -> JointEstimate:
    fitted = found.frequency
    jacobian = np.stack([found.compliance[name] for name in _JOINT], -1) / sigma[:, None]
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
    k_t, k_r = map(float, stiffness)
    return JointEstimate(k_t, k_r, covariance, spread, deviation, fitted, residuals, identifiable, message)


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
