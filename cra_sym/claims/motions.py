"""Tip responses to mean motion plus disturbance over a plane of disturbances, by superposition of three of them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np

from cra_sym.analysis.modes import natural_frequencies
from cra_sym.analysis.responses import response
from cra_sym.arm.parameters import Arm
from cra_sym.cached import cached_property
from cra_sym.claims.setting import Setting
from cra_sym.claims.verdict import EvidenceArray
from cra_sym.solvers.motion import BaseMotion

__all__ = ["Plane", "peak", "tip"]


Start = Literal["inertial", "base"]


def tip(
    setting: Setting, arm: Arm, motion: Mapping[str, Any], *, relative: bool = False, start: Start = "inertial"
) -> np.ndarray:
    """Return the tip's elastic displacement v(L, t), or v(L, t) - v(0, t) if ``relative``, shape (..., times), m."""
    places = [0.0, float(arm.L)] if relative else float(np.min(arm.L))
    found = response(arm, BaseMotion(**motion), setting.times, places, modes=setting.modes, start=start)
    return np.asarray(found[..., 1, :] - found[..., 0, :] if relative else found)


def peak(signal: np.ndarray) -> np.ndarray:
    """Return the largest magnitude along time."""
    return np.asarray(np.abs(signal).max(axis=-1))


@dataclass(frozen=True)
class Plane:
    """Disturbances B sin(varpi t + psi) of unit amplitude over a plane of frequency and phase.

    Attributes
    ----------
    setting : Setting
    varpi : ndarray, shape (K,)
        rad/s.
    psi : ndarray, shape (P,)
        rad.
    start : {'inertial', 'base'}
        What is at rest before t = 0.
    """

    setting: Setting
    varpi: np.ndarray
    psi: np.ndarray
    start: Start = "inertial"

    @classmethod
    def of(cls, setting: Setting, start: Start = "inertial") -> Plane:
        """Return the plane up to twice the first natural frequency of the arm, every phase."""
        first = 2 * np.pi * float(natural_frequencies(setting.arm, 1)[0])
        return cls(setting, np.linspace(0.05, 2.0, 60) * first, np.radians(np.linspace(0.0, 360.0, 73)), start)

    @classmethod
    def line(cls, setting: Setting, *, varpi: float | None = None, psi: float | None = None) -> Plane:
        """Return a fine line through the plane, one of the two fixed."""
        plane = cls.of(setting)
        if varpi is not None:
            return cls(setting, np.array([varpi]), np.radians(np.linspace(0.0, 360.0, 361)))
        return cls(setting, np.linspace(plane.varpi[0], plane.varpi[-1], 241), np.array([psi]))

    @property
    def axes(self) -> dict[str, EvidenceArray]:
        """Frequency and phase as evidence."""
        return {
            "varpi": EvidenceArray(self.varpi, "rad/s", "frequency of the disturbance"),
            "psi": EvidenceArray(np.degrees(self.psi), "deg", "phase of the disturbance"),
        }

    @cached_property
    def disturbance(self) -> np.ndarray:
        """Tip response to the disturbance alone, m per m of amplitude, shape (K, P, times)."""
        arm, unit = self.setting.arm, {"amplitude": 1.0, "angular_frequency": self.varpi}
        sine, cosine = (
            tip(self.setting, arm, {**unit, "phase": phase}, start=self.start) for phase in (0.0, np.pi / 2)
        )
        return np.asarray(np.cos(self.psi)[:, None] * sine[:, None, :] + np.sin(self.psi)[:, None] * cosine[:, None, :])

    def peaks(self, amplitude: float | None = None, **mean: float) -> tuple[np.ndarray, float]:
        """Return the peaks with the disturbance, shape (K, P), and the one without, m."""
        without = tip(self.setting, self.setting.arm, mean, start=self.start)
        amplitude = self.setting.amplitude if amplitude is None else amplitude
        return peak(without + amplitude * self.disturbance), float(peak(without))
