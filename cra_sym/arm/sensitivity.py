"""Sensitivities (31)-(32) of the natural frequencies to the joint and to every other parameter."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Literal

import numpy as np

from cra_sym.arm.analysis import ModalParameters, modal_parameters
from cra_sym.arm.parameters import Arm
from cra_sym.arm.spectrum import pair
from cra_sym.checks import count
from cra_sym.kernels import derived_kernel

__all__ = ["Sensitivities", "sensitivities"]

_implicit = derived_kernel("cra_sym.arm.implicit:implicit_kernel", backend="numpy")
_exponents = derived_kernel("cra_sym.arm.implicit:group_exponents", backend="numpy")


@dataclass(frozen=True)
class Sensitivities:
    """Derivatives of the natural frequencies f (Hz), every array of shape (..., modes).

    Raw derivatives have the unit Hz over that of the parameter and cannot be compared with each other. Logarithmic
    ones, d ln f / d ln p, can: that of a spring is half its share of the strain energy of the mode, that of m_e minus
    half its share of the kinetic energy.

    A rigid-body mode, f = 0, leaves zero like a square root: its raw derivative by the stiffness that would hold it
    is inf, its other raw derivatives are 0 and its logarithmic ones nan. With both stiffnesses zero there are two
    such modes, and which is which depends on the direction of change: nan. An infinite stiffness has derivatives 0;
    ``df_dc_t`` and ``df_dc_r``, by the compliances 1/k_t and 1/k_r, say what the first give of a rigid joint costs.

    Attributes
    ----------
    frequency : ndarray
        f, Hz.
    df_dk_t, df_dk_r : ndarray
        Hz per N/m and Hz per N m/rad.
    df_dc_t, df_dc_r : ndarray
        Hz per m/N and Hz per rad/(N m).
    df_dm_e, df_dJ_e, df_dL, df_db, df_dh, df_dE, df_drho : ndarray
        Hz per SI unit.
    log_k_t, log_k_r, log_m_e, log_J_e, log_L, log_b, log_h, log_E, log_rho : ndarray
        d ln f / d ln p.
    """

    frequency: np.ndarray
    df_dk_t: np.ndarray
    df_dk_r: np.ndarray
    df_dc_t: np.ndarray
    df_dc_r: np.ndarray
    df_dm_e: np.ndarray
    df_dJ_e: np.ndarray
    df_dL: np.ndarray
    df_db: np.ndarray
    df_dh: np.ndarray
    df_dE: np.ndarray
    df_drho: np.ndarray
    log_k_t: np.ndarray
    log_k_r: np.ndarray
    log_m_e: np.ndarray
    log_J_e: np.ndarray
    log_L: np.ndarray
    log_b: np.ndarray
    log_h: np.ndarray
    log_E: np.ndarray
    log_rho: np.ndarray


def sensitivities(arm: Arm, modes: int = 3, *, method: Literal["modal", "implicit"] = "modal") -> Sensitivities:
    """Return the sensitivities of the natural frequencies to every parameter.

    Parameters
    ----------
    arm : Arm
    modes : int
        How many, rigid-body modes included.
    method : {'modal', 'implicit'}
        By first-order perturbation, d omega_i^2 = phi_i(0)^2 dk_t + phi_i'(0)^2 dk_r + ... with mass-normalised
        modes; or by implicit differentiation (31) of the frequency equation (23). They agree; the first is exact at
        low frequencies too, where the derivatives of the determinant cancel.

    Returns
    -------
    Sensitivities

    Examples
    --------
    >>> from cra_sym import Arm, sensitivities
    >>> found = sensitivities(Arm.nominal().replace(k_t=1e3, k_r=1e3))
    >>> print(found.log_k_t.round(4), found.log_k_r.round(4))
    [0.0173 0.2076 0.204 ] [0.0089 0.0047 0.    ]
    """
    if method not in ("modal", "implicit"):
        raise ValueError(f"method = {method!r}: allowed are 'modal' and 'implicit'")
    parameters = modal_parameters(arm, count("modes", modes))
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        found = _modal(arm, parameters) if method == "modal" else _by_determinant(arm, parameters)
        return _assembled(arm, parameters.frequency, *found)


def _column(arm: Arm, value: Any) -> np.ndarray:
    return np.broadcast_to(value, arm.shape)[..., None]


def _modal(arm: Arm, p: ModalParameters) -> tuple[np.ndarray, ...]:
    """Return d omega^2 by k_t, k_r, 1/k_t, 1/k_r, m_e and J_e."""
    square = p.omega**2
    return (
        p.root_displacement**2,
        p.root_slope**2,
        -(p.root_shear**2),
        -(p.root_moment**2),
        -square * p.tip_displacement**2,
        -square * p.tip_slope**2,
    )


def _by_determinant(arm: Arm, p: ModalParameters) -> tuple[np.ndarray, ...]:
    """Return the same by implicit differentiation; omega^2 = scale^2 lambda^4."""
    pairs = [value for kappa in (arm.kappa_t, arm.kappa_r) for value in pair(_column(arm, kappa))]
    rates = _implicit(p.lam, *pairs, *(_column(arm, value) for value in (arm.mu, arm.iota)))
    (s_t, c_t, s_r, c_r), length, EI = pairs, _column(arm, arm.L), _column(arm, arm.EI)
    by_lam = 4 * _column(arm, arm.angular_frequency_scale) ** 2 * p.lam**3
    stiffness_t, stiffness_r, mass = EI / length**3, EI / length, _column(arm, arm.rhoA) * length
    return (
        by_lam * rates["kappa_t"] * c_t**2 / stiffness_t,
        by_lam * rates["kappa_r"] * c_r**2 / stiffness_r,
        -by_lam * rates["kappa_t"] * s_t**2 * stiffness_t,
        -by_lam * rates["kappa_r"] * s_r**2 * stiffness_r,
        by_lam * rates["mu"] / mass,
        by_lam * rates["iota"] / (mass * length**2),
    )


def _assembled(arm: Arm, f: np.ndarray, *by_square: np.ndarray) -> Sensitivities:
    """Turn derivatives of omega^2 into those of f, and complete them by the chain rule over the dimensionless
    groups."""
    square = (2 * np.pi * f) ** 2
    still = f == 0
    lost = still & _column(arm, (np.asarray(arm.k_t) == 0) & (np.asarray(arm.k_r) == 0))

    def raw(change: np.ndarray) -> np.ndarray:
        held = np.where(np.abs(change) > 0, np.copysign(np.inf, change), 0.0)
        return np.where(lost, np.nan, np.where(still, held, f * change / (2 * square)))

    raws = [raw(change) for change in by_square[:4]]
    raws += [np.where(still, 0.0, raw(change)) for change in by_square[4:]]
    shares = []
    for k, by_k in ((arm.k_t, by_square[0]), (arm.k_r, by_square[1])):
        stiffness = _column(arm, k)
        shares.append(np.where(np.isinf(stiffness), 0.0, stiffness * by_k) / square)
    shares += [-_column(arm, value) * by / square for value, by in zip((arm.m_e, arm.J_e), by_square[4:], strict=True)]
    exponents = _exponents(*shares)
    logs = [np.where(still, np.nan, value / 2) for value in (*shares[:2], -shares[2], -shares[3], *exponents.values())]
    rest = [
        np.where(still, 0.0, f * log / _column(arm, getattr(arm, name)))
        for name, log in zip(exponents, logs[4:], strict=True)
    ]
    return Sensitivities(f, *raws, *rest, *logs)
