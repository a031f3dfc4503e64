"""The one number that the three published frequencies determine, and the family of arms that share it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any

import numpy as np

from cra_sym.analysis.frequency_response import frequency_response
from cra_sym.analysis.modal_parameters import modal_parameters
from cra_sym.analysis.modes import natural_frequencies
from cra_sym.arm.frequency_parameters import frequency_parameters
from cra_sym.arm.parameters import Arm
from cra_sym.checks import mapping, one_axis, real_array, shown
from cra_sym.claims.setting import Setting
from cra_sym.symbols import symbol

__all__ = ["MATERIALS", "ArmFamily", "common_scale", "provenance_family"]

MATERIALS: Mapping[str, tuple[float, float]] = MappingProxyType(
    {
        "carbon fibre": (140e9, 1600.0),
        "aluminium": (68.9e9, 2700.0),
        "steel": (210e9, 7850.0),
        "acrylic": (3.2e9, 1190.0),
    }
)
"""Young's modulus (Pa) and density (kg/m3) from handbooks: examples, not the paper's material."""


def common_scale(frequencies: Any, rounding: float = 0.0005) -> tuple[float, float, np.ndarray]:
    """Return the interval of sqrt(EI / rho A) / L^2 that is consistent with rounded frequencies of a clamped bare arm.

    Parameters
    ----------
    frequencies : array_like, shape (modes,)
        Hz.
    rounding : float
        Half a unit of the last digit, Hz.

    Returns
    -------
    low, high : float
        rad/s; low > high if there is none.
    by_mode : ndarray, shape (modes, 2)
        The interval of each frequency.

    Examples
    --------
    >>> low, high, _ = common_scale([2.448, 15.339, 42.950])
    >>> print(f"{low:.5f} {high:.5f}")
    4.37394 4.37404
    """
    f = np.atleast_1d(one_axis("frequencies", frequencies, "frequencies", low=0.0, high=1e12, open_low=True))
    lam = frequency_parameters(np.inf, np.inf, 0.0, modes=f.size)
    by_mode = 2 * np.pi * (f[:, None] + [-rounding, rounding]) / lam[:, None] ** 2
    return float(by_mode[:, 0].max()), float(by_mode[:, 1].min()), by_mode


@dataclass(frozen=True)
class ArmFamily:
    """Arms of different size and material with the same natural frequencies.

    Attributes
    ----------
    materials : tuple of str
    length : ndarray, shape (K,)
        m.
    thickness : ndarray, shape (materials, K)
        m; the width cancels.
    frequencies : ndarray, shape (materials, K, modes)
        Hz, computed, of the clamped arm without end-effector.
    published : ndarray, shape (modes,)
        Hz.
    mass, stiffness : ndarray, shape (materials, K)
        Mass (kg) and stiffness against a force at the tip (N/m) of a strip as wide as the nominal one: these differ.
    """

    materials: tuple[str, ...]
    length: np.ndarray
    thickness: np.ndarray
    frequencies: np.ndarray
    published: np.ndarray
    mass: np.ndarray
    stiffness: np.ndarray


def provenance_family(
    frequencies: Any = None, length: Any = None, materials: Mapping[str, tuple[float, float]] = MATERIALS
) -> ArmFamily:
    """Return arms with the published frequencies.

    Parameters
    ----------
    frequencies : array_like, optional
        Published frequencies of the clamped arm, Hz.
    length : array_like, optional
        Lengths, m, by default 0.3 to 2.
    materials : mapping
        Name to Young's modulus and density.

    Returns
    -------
    ArmFamily

    Raises
    ------
    ValueError
        If no clamped uniform arm has these frequencies.
    """
    published = np.array(Setting.frequencies) if frequencies is None else np.atleast_1d(frequencies)
    low, high, _ = common_scale(published)
    if low > high:
        raise ValueError(f"frequencies = {published.tolist()}: those of no clamped uniform arm")
    given = np.linspace(0.3, 2.0, 35) if length is None else length
    length = np.atleast_1d(one_axis("length", given, "lengths", low=1e-12, high=1e12))
    rows = list(mapping("materials", materials, "names to modulus and density").values())
    numbers = real_array("materials", rows, low=1e-12, high=1e30)
    if numbers.ndim != 2 or numbers.shape[1] != 2:
        raise ValueError(f"materials = {shown(materials)}: must be pairs of a modulus and a density")
    modulus, density = numbers.T[:, :, None]
    thickness = (low + high) / 2 * length**2 * np.sqrt(12 * density / modulus)
    bare = Arm.nominal().replace(m_e=0.0, J_e=0.0, k_t=np.inf, k_r=np.inf)
    arms = bare.replace(L=length, h=thickness, E=modulus, rho=density)
    found = natural_frequencies(arms, modes=published.size)
    stiffness = 1 / frequency_response(arms, 0.0, drive=symbol("v").subs(symbol("x"), symbol("L"))).real
    free = modal_parameters(arms.replace(k_t=0.0, k_r=0.0), 2)  # which move as rigid bodies, with all the mass
    mass = np.sum(free.participation**2, axis=-1)
    return ArmFamily(tuple(materials), length, thickness, found, published, mass, stiffness)
