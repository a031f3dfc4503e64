"""Sensitivities (31)-(32) of the natural frequencies to the joint and to every other parameter."""

from __future__ import annotations

from collections.abc import Callable
from functools import cached_property
from typing import Any, Literal

import numpy as np

from cra_sym.analysis.modes import ModalParameters, arm_modes
from cra_sym.arm.parameters import Arm
from cra_sym.checks import choice, count
from cra_sym.kernels import derived_kernel
from cra_sym.model.one_wave import Change, OneWaveModes
from cra_sym.solvers.one_wave import parameters

__all__ = ["CHANNELS", "Sensitivities", "sensitivities"]

_implicit_rates = derived_kernel("cra_sym.paper.implicit:implicit_kernel", backend="numpy")
_exponents = derived_kernel("cra_sym.paper.implicit:group_exponents", backend="numpy")


_NAMES = ("k_t", "k_r", "c_t", "c_r", "m_e", "J_e")  # what a derivative of omega^2 is known by; the rest follows
_Known = Callable[[str], np.ndarray]


class Sensitivities:
    """Derivatives of the natural frequencies f (Hz), every array of shape (..., modes),
    computed when it is first asked for.

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

    def __init__(self, arm: Arm, frequency: np.ndarray, known: _Known) -> None:
        self._arm, self._known = arm, known
        self.frequency = frequency

    def __getattr__(self, name: str) -> np.ndarray:
        if name not in Sensitivities.__annotations__:
            raise AttributeError(f"Sensitivities have no {name!r}")
        logarithmic = name.startswith("log_")
        parameter = name.removeprefix("log_" if logarithmic else "df_d")
        with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
            value = self._logarithmic(parameter) if logarithmic else self._raw(parameter)
        setattr(self, name, value)
        return value

    def __dir__(self) -> list[str]:
        return [*super().__dir__(), *Sensitivities.__annotations__]

    def _raw(self, name: str) -> np.ndarray:
        if name not in _NAMES:
            value = self.frequency * self._logarithmic(name) / _column(self._arm, getattr(self._arm, name))
            return np.where(self._still, 0.0, value) if self._rigid else value
        value = self._known(f"df_d{name}")
        if self._rigid:
            spring = name in _NAMES[:4]
            held = np.where(np.isnan(value), 0.0, value) if spring else 0.0  # 0 over 0: it holds nothing
            loose = (np.asarray(self._arm.k_t) == 0) & (np.asarray(self._arm.k_r) == 0) & spring
            value = np.where(self._still, np.where(_column(self._arm, loose), np.nan, held), value)
        return value

    def _logarithmic(self, name: str) -> np.ndarray:
        value = self._known(f"log_{name}") if name in _NAMES else self._exponents[name] / 2
        return np.where(self._still, np.nan, value) if self._rigid else value

    @cached_property
    def _exponents(self) -> dict[str, np.ndarray]:
        """The chain rule over the dimensionless groups."""
        factors = {"k_t": 2, "k_r": 2, "m_e": -2, "J_e": -2}  # shares of energy, in strain and in motion
        return _exponents(*(factor * self._known(f"log_{name}") for name, factor in factors.items()))

    @cached_property
    def _still(self) -> np.ndarray:
        return self.frequency == 0

    @cached_property
    def _rigid(self) -> bool:
        return bool(self._still.any())


def sensitivities(arm: Arm, modes: int = 3, *, method: Literal["modal", "implicit"] = "modal") -> Sensitivities:
    """Return the sensitivities (31)-(32) of the natural frequencies to every parameter.

    Parameters
    ----------
    arm : Arm
    modes : int
        How many, 1 to 1000, rigid-body modes included.
    method : {'modal', 'implicit'}
        By first-order perturbation, d omega_i^2 = phi_i(0)^2 dk_t + phi_i'(0)^2 dk_r + ... with mass-normalised
        modes; or by implicit differentiation (31) of the frequency equation (23). They agree; the first is exact at
        low frequencies too, where the derivatives of the determinant cancel.

    Returns
    -------
    Sensitivities
        Arrays of shape (..., modes); ``...`` is ``arm.shape``.

    Raises
    ------
    TypeError, ValueError
        If ``arm`` is no :class:`Arm`, ``modes`` no integer from 1 to 1000, or ``method`` neither of the two.

    Examples
    --------
    >>> from cra_sym import Arm, sensitivities
    >>> found = sensitivities(Arm.nominal().replace(k_t=1e3, k_r=1e3))
    >>> print(found.log_k_t.round(4), found.log_k_r.round(4))
    [0.0173 0.2076 0.204 ] [0.0089 0.0047 0.    ]
    """
    choice("method", method, ("modal", "implicit"))
    found = arm_modes(arm, count("modes", modes))
    modal = ModalParameters(arm, found)
    known = _by_modes(found) if method == "modal" else _by_rates(arm, modal, _implicit(arm, modal))
    return Sensitivities(arm, modal.frequency, known)


def _column(arm: Arm, value: Any) -> np.ndarray:
    return np.broadcast_to(value, arm.shape)[..., None]


CHANNELS: dict[str, tuple[tuple[int, int], Change]] = {
    "k_t": ((0, 0), "stiffness"),
    "k_r": ((0, 1), "stiffness"),
    "c_t": ((0, 0), "compliance"),
    "c_r": ((0, 1), "compliance"),
    "m_e": ((1, 0), "inertia"),
    "J_e": ((1, 1), "inertia"),
}
"""End, place and kind of what each name stands for."""


def _by_modes(modes: OneWaveModes) -> _Known:
    """Return what gives the derivatives of f that modes know, each with others that cost next to nothing beside it."""

    def known(name: str) -> np.ndarray:
        channel, by = CHANNELS[name.removeprefix("df_d").removeprefix("log_")]
        found = modes.rates(by, cycles=True) if name.startswith("df_d") else modes.logarithmic_rates(by)
        return found[channel]

    return known


def _by_rates(arm: Arm, p: ModalParameters, rates: dict[str, np.ndarray]) -> _Known:
    """Return what gives the derivatives of f from those of omega^2 by the parameters of the joint and the tip."""

    def known(name: str) -> np.ndarray:
        parameter = name.removeprefix("df_d").removeprefix("log_")
        if name.startswith("df_d"):
            return rates[parameter] / (8 * np.pi**2 * p.frequency)  # d omega^2 = 8 pi^2 f df
        value = _column(arm, getattr(arm, parameter))
        return np.where(np.isinf(value), 0.0, value * rates[parameter] / (2 * p.omega**2))

    return known


def _implicit(arm: Arm, p: ModalParameters) -> dict[str, np.ndarray]:
    """Return the same by implicit differentiation, all from one evaluation; omega^2 = scale^2 lambda^4."""
    layout, lanes = p._modes.dimensionless.family.layout, p._modes.dimensionless.groups
    s_t, c_t, s_r, c_r = parameters(layout, lanes)[:4].reshape(4, *arm.shape, 1)
    length, EI = _column(arm, arm.L), _column(arm, arm.EI)
    stiffness_t, stiffness_r, mass = EI / length**3, EI / length, _column(arm, arm.rhoA) * length
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        rates = _implicit_rates(p.lam, s_t, c_t, s_r, c_r, *(_column(arm, value) for value in (arm.mu, arm.iota)))
        by_lam = 4 * _column(arm, arm.angular_frequency_scale) ** 2 * p.lam**3
        return {
            "k_t": by_lam * rates["kappa_t"] * c_t**2 / stiffness_t,
            "k_r": by_lam * rates["kappa_r"] * c_r**2 / stiffness_r,
            "c_t": -by_lam * rates["kappa_t"] * s_t**2 * stiffness_t,
            "c_r": -by_lam * rates["kappa_r"] * s_r**2 * stiffness_r,
            "m_e": by_lam * rates["mu"] / mass,
            "J_e": by_lam * rates["iota"] / (mass * length**2),
        }
