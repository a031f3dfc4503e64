"""The three excitations of the arm as numbers; :mod:`cra_sym.paper.parametric` derives them from the Lagrangian."""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import Any

import numpy as np

from cra_sym.analysis.modes import ModalParameters
from cra_sym.checks import broadcastable, real_array

__all__ = ["AxialBase", "Excitation", "JointStiffness", "TransverseBase"]

Number = float | np.ndarray


@dataclass(frozen=True, eq=False)
class Excitation:
    """What the excitations share: validated numeric fields that may be arrays."""

    def __post_init__(self) -> None:
        for name in self._names():
            array = np.array(real_array(name, getattr(self, name), low=0.0))
            array.flags.writeable = False
            object.__setattr__(self, name, float(array) if array.ndim == 0 else array)
        broadcastable(**{name: getattr(self, name) for name in self._names()})

    @classmethod
    def _names(cls) -> tuple[str, ...]:
        return tuple(f.name for f in fields(cls))

    @property
    def shape(self) -> tuple[int, ...]:
        """Batch shape: the common shape of all fields."""
        return np.broadcast_shapes(*(np.shape(getattr(self, name)) for name in self._names()))

    def __eq__(self, other: object) -> bool:
        if type(other) is not type(self):
            return NotImplemented
        return all(np.array_equal(getattr(self, name), getattr(other, name)) for name in self._names())

    def __hash__(self) -> int:
        return hash((type(self), *(np.asarray(getattr(self, name)).tobytes() for name in self._names())))

    def __reduce__(self) -> tuple[Any, ...]:
        return type(self), tuple(getattr(self, name) for name in self._names())


@dataclass(frozen=True, eq=False)
class JointStiffness(Excitation):
    """A bolted joint whose preload fluctuates: each stiffness is k (1 + weight epsilon cos(varpi t)), (35b).

    Parameters
    ----------
    k_t, k_r : float or ndarray
        Weights of the translational and the rotational spring, not negative.

    Raises
    ------
    TypeError, ValueError
        If a weight is not made of finite real numbers or is negative, or the arrays do not broadcast together.

    Examples
    --------
    >>> JointStiffness()
    JointStiffness(k_t=1.0, k_r=0.0)
    """

    k_t: Number = 1.0
    k_r: Number = 0.0

    def coupling(self, modal: ModalParameters, angular_frequency: Any) -> np.ndarray:
        """Return P, 1/s2, shape (..., modes, modes)."""
        weight_t, weight_r = (np.asarray(weight)[..., None, None] for weight in (self.k_t, self.k_r))
        return weight_t * modal.stiffness_translation + weight_r * modal.stiffness_rotation

    def slope(self, modal: ModalParameters, angular_frequency: Any) -> np.ndarray:
        """Return dP/dvarpi: none."""
        return np.zeros_like(self.coupling(modal, angular_frequency))


@dataclass(frozen=True, eq=False)
class AxialBase(Excitation):
    """A base that shakes along the arm, u = epsilon amplitude cos(varpi t), (35a).

    The foreshortening of the arm feels its inertia.

    Parameters
    ----------
    amplitude : float or ndarray
        Amplitude at epsilon = 1, m; not negative.

    Raises
    ------
    TypeError, ValueError
        If the amplitude is not made of finite real numbers or is negative.
    """

    amplitude: Number

    def coupling(self, modal: ModalParameters, angular_frequency: Any) -> np.ndarray:
        """Return P, 1/s2, shape (..., modes, modes); it grows with the square of the excitation frequency."""
        scale = np.asarray(self.amplitude) * np.square(angular_frequency)
        return scale[..., None, None] * modal.axial

    def slope(self, modal: ModalParameters, angular_frequency: Any) -> np.ndarray:
        """Return dP/dvarpi, 1/s."""
        scale = 2.0 * np.asarray(self.amplitude) * np.asarray(angular_frequency)
        return scale[..., None, None] * modal.axial


@dataclass(frozen=True, eq=False)
class TransverseBase(Excitation):
    """A base that shakes across the arm, w = epsilon amplitude sin(varpi t), (35).

    It forces the arm and has no boundary.

    Parameters
    ----------
    amplitude : float or ndarray
        Amplitude at epsilon = 1, m; not negative.

    Raises
    ------
    TypeError, ValueError
        If the amplitude is not made of finite real numbers or is negative.
    """

    amplitude: Number
