"""All numbers on which verdicts depend, with their origin: published in the paper, or assumed because lost there."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import Any, ClassVar

import numpy as np

from cra_sym.analysis.modes import natural_frequencies
from cra_sym.arm.parameters import Arm
from cra_sym.cached import cached_property
from cra_sym.checks import count, instance, real_array

__all__ = ["Setting"]

_KINDS: Mapping[str, tuple[str, str]] = MappingProxyType(
    {
        "frequencies": ("published", "Hz; ideal fixed restraint, Section 4"),
        "k_t": ("assumed", "N/m; the series of Figs. 5 and 11 is lost"),
        "k_r": ("assumed", "N m/rad; the series of Fig. 5 is lost"),
        "soft_k_t": ("assumed", "N/m; the value of Figs. 7 and 8 is lost"),
        "velocity": ("assumed", "m/s; the average velocity of Fig. 6 is lost"),
        "accelerations": ("published", "m/s2; Figs. 9 and 10; of the three the first, 0.1, is lost and assumed"),
        "amplitude": ("assumed", "m; the disturbance's amplitude B is lost"),
        "angular_frequency": ("assumed", "rad/s; the disturbance's frequency varpi is lost"),
        "phase": ("assumed", "rad; (33) is lost, and with it the disturbance's phase psi"),
        "duration": ("assumed", "s; the time axis of Figs. 6 to 10 is lost"),
        "masses": ("published", "kg; Fig. 12; of the three the first, 0, is lost and assumed"),
        "epsilon": ("assumed", "1; the range of Figs. 11 and 12 is lost"),
        "peaks": ("lost", "m; the four response amplitudes printed with Fig. 6"),
        "modes": ("assumed", "1; modes in a response"),
        "visible": ("assumed", "1; a change counts as seen from this share of what is drawn on"),
    }
)
#: Series, with the number of values where the paper prints so many.
_LENGTHS = {"frequencies": 3, "k_t": 0, "k_r": 0, "accelerations": 0, "masses": 0, "peaks": 4}
_LARGEST = {"duration": 1e4, "angular_frequency": 1e4, "epsilon": 1.0, "visible": 1.0}


@dataclass(frozen=True)
class Setting:
    """The arm and the numbers of the paper's simulations.

    Attributes
    ----------
    arm : Arm
        One arm, no batch.
    frequencies : tuple of float
        The published natural frequencies, Hz.
    k_t, k_r : tuple of float
        Series of stiffnesses, stiff to soft, N/m and N m/rad.
    soft_k_t : float
        The elastic joint that is compared with the rigid one, N/m.
    velocity, accelerations
        Mean velocity (m/s) and mean accelerations (m/s2) of the base.
    amplitude, angular_frequency, phase : float
        The disturbance B sin(varpi t + psi): m, rad/s, rad.
    duration : float
        Duration of responses, s.
    masses : tuple of float
        Series of end-effectors, kg.
    epsilon : float
        Depth of a parametric excitation.
    peaks : tuple of float, optional
        The four amplitudes printed with Fig. 6, m: velocity with and without disturbance, acceleration with and
        without. Lost; they can be entered from the printed paper.
    modes : int
        Modes in a response.
    visible : float
        Relative change from which on it counts as visible in a figure.
    """

    arm: Arm = field(default_factory=Arm.nominal)
    frequencies: tuple[float, ...] = (2.448, 15.339, 42.950)
    k_t: tuple[float, ...] = (1e5, 1e4, 1e3)
    k_r: tuple[float, ...] = (1e4, 1e3, 1e2)
    soft_k_t: float = 1e3
    velocity: float = 0.1
    accelerations: tuple[float, ...] = (0.1, 0.2, 0.3)
    amplitude: float = 1e-3
    angular_frequency: float = 10.0
    phase: float = 0.0
    duration: float = 2.0
    masses: tuple[float, ...] = (0.0, 0.001, 0.005)
    epsilon: float = 0.05
    peaks: tuple[float, ...] | None = None
    modes: int = 5
    visible: float = 0.01

    provenance: ClassVar[Mapping[str, tuple[str, str]]] = _KINDS

    def __post_init__(self) -> None:
        instance("arm", self.arm, Arm)
        if self.arm.shape:
            raise ValueError(f"arm has the batch shape {self.arm.shape}: must be one arm")
        object.__setattr__(self, "modes", count("modes", self.modes, high=100))
        for entry in dataclasses.fields(self):
            name, value = entry.name, getattr(self, entry.name)
            if name in ("arm", "modes") or (name == "peaks" and value is None):
                continue
            array = real_array(name, value, low=-1e6 if name == "phase" else 0.0, high=_LARGEST.get(name, 1e12))
            length = _LENGTHS.get(name, ())
            if array.ndim != (name in _LENGTHS) or array.size == 0 or (length and array.size != length):
                one = f"{length or 'some'} numbers in a row" if name in _LENGTHS else "one number"
                raise ValueError(f"{name} has shape {array.shape}: must be {one}")
            object.__setattr__(self, name, tuple(map(float, array)) if array.ndim else float(array))

    @classmethod
    def of(cls, arm: Arm | None = None, **numbers: Any) -> Setting:
        """Return the nominal setting with some values changed."""
        unknown = [name for name in numbers if name not in cls.provenance]
        if unknown:
            raise TypeError(f"{unknown[0]!r} is not a number of a setting: must be one of {', '.join(cls.provenance)}")
        return cls(**numbers) if arm is None else cls(arm, **numbers)

    @cached_property
    def rigid(self) -> Arm:
        """The arm on a rigid joint."""
        return self.arm.replace(k_t=np.inf, k_r=np.inf)

    @property
    def disturbance(self) -> dict[str, float]:
        """The base's harmonic disturbance, as :class:`cra_sym.BaseMotion` takes it."""
        return {name: getattr(self, name) for name in ("amplitude", "angular_frequency", "phase")}

    @cached_property
    def times(self) -> np.ndarray:
        """Times of the responses, s: sixteen a period of the third mode of the rigidly held arm."""
        fastest = float(natural_frequencies(self.rigid, 3)[-1])
        return np.linspace(0.0, self.duration, int(np.clip(16 * fastest * self.duration, 400, 4000)) + 1)
