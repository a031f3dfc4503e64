"""What of a Lagrangian fluctuates with time: parametric excitations of any system."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from cra_sym.checks import broadcastable, real_array, shown
from cra_sym.model.system import System
from cra_sym.model.values import Value, frozen

__all__ = ["AxialBase", "Excitation", "Fluctuation", "Parametric", "TransverseBase"]

Array = NDArray[np.float64]


class Excitation:
    """What excitations share: named numbers that may be arrays, compared by value."""

    def __init__(self, **numbers: Any) -> None:
        units = {"amplitude": "m"}  # the others are weights
        checked = {
            name: frozen(real_array(name, value, low=0.0, unit=units.get(name, "1"))) for name, value in numbers.items()
        }
        broadcastable(**{name: np.asarray(value) for name, value in checked.items()})
        self._numbers: dict[str, Value] = checked

    @property
    def shape(self) -> tuple[int, ...]:
        """Batch shape: the common shape of all numbers."""
        return np.broadcast_shapes(*(np.shape(value) for value in self._numbers.values()))

    def __getitem__(self, index: Any) -> Self:
        """Return one of a batch, or some."""
        shape = self.shape
        return type(self)(**{name: np.broadcast_to(value, shape)[index] for name, value in self._numbers.items()})

    def _key(self) -> tuple[Any, ...]:
        numbers = sorted(self._numbers.items())
        return tuple((name, np.shape(value), np.asarray(value).tobytes()) for name, value in numbers)

    def __eq__(self, other: object) -> bool:
        return self._key() == other._key() if type(other) is type(self) else NotImplemented  # type: ignore[attr-defined]

    def __hash__(self) -> int:
        return hash((type(self), self._key()))

    def __reduce__(self) -> tuple[Any, ...]:
        return _rebuilt, (type(self), dict(self._numbers))

    def __repr__(self) -> str:
        return f"{type(self).__name__}({', '.join(f'{name}={value!r}' for name, value in self._numbers.items())})"


def _rebuilt(kind: type[Excitation], numbers: dict[str, Any]) -> Excitation:
    return kind(**numbers)


class Parametric(Excitation):
    """An excitation that makes the equations of motion periodic: epsilon cos(varpi t) P between the modes.

    Attributes
    ----------
    power : int
        P grows with this power of the excitation frequency varpi.
    """

    power = 0

    def unit_coupling(self, system: System, modes: int) -> Array:
        """Return P for varpi = 1 rad/s, 1/s2, shape (..., modes, modes)."""
        raise NotImplementedError

    def coupling(self, system: System, modes: int, angular_frequency: Any) -> Array:
        """Return P, 1/s2, shape (..., modes, modes)."""
        return self._scale(angular_frequency, 0) * self.unit_coupling(system, modes)

    def slope(self, system: System, modes: int, angular_frequency: Any) -> Array:
        """Return dP/dvarpi, 1/s, shape (..., modes, modes)."""
        return self._scale(angular_frequency, 1) * self.unit_coupling(system, modes)

    def _scale(self, angular_frequency: Any, derivative: int) -> Array:
        frequency = np.asarray(angular_frequency, float)[..., None, None]
        if derivative:
            return self.power * frequency ** max(self.power - 1, 0)
        return frequency**self.power

    def springs(self, system: System) -> list[str]:
        """Return the fluctuating stiffnesses of ends, if nothing else fluctuates; then statics keep the other modes."""
        return []


class Fluctuation(Parametric):
    """Stiffnesses that fluctuate about their values: each is p (1 + weight epsilon cos(varpi t)).

    Parameters
    ----------
    weights : mapping of symbol or name to array_like, optional
    **named
        Weights of parameters by name, not negative.

    Raises
    ------
    TypeError, ValueError
        If a weight is not made of finite real numbers or is negative, a name comes twice, or arrays do not broadcast
        together.

    Examples
    --------
    >>> Fluctuation(k_t=1.0, N=0.5)
    Fluctuation(k_t=1.0, N=0.5)
    """

    def __init__(self, weights: Mapping[Any, Any] | None = None, **named: Any) -> None:
        if weights is not None and not isinstance(weights, Mapping):
            raise TypeError(f"weights = {shown(weights)}: must be a mapping from symbols or names to numbers")
        given = {key if isinstance(key, str) else key.name: value for key, value in (weights or {}).items()}
        twice = sorted(given.keys() & named.keys())
        if twice:
            raise ValueError(f"weights: {twice[0]} is given twice")
        super().__init__(**given, **named)

    @property
    def weights(self) -> Mapping[str, Value]:
        """The weight of every fluctuating parameter, by name."""
        return self._numbers

    def unit_coupling(self, system: System, modes: int) -> Array:
        """Return P, 1/s2, shape (..., modes, modes); an infinite stiffness does not fluctuate."""
        total: Array = np.zeros((modes, modes))
        form = system.form("rates", modes)
        for name, weight in self.weights.items():
            reason = "is not a parameter" if name not in system.values else system.numerics("fluctuation", name)
            if reason:
                known = ", ".join(n for n in system.values if not system.numerics("fluctuation", n))
                raise ValueError(f"{self!r}: {name} {reason}; must be one of {known}")
            value = np.asarray(system.values[name])
            size = np.asarray(weight) * np.where(np.isinf(value), 0.0, value)
            total = total + size[..., None, None] * form[f"{name} stiffness"]
        moving = system.natural_frequencies(modes) > 0  # a rigid-body motion deforms nothing
        return total * (moving[..., :, None] & moving[..., None, :])

    def springs(self, system: System) -> list[str]:
        """Return the fluctuating stiffnesses if all of them are stiffnesses of an end."""
        known = system.numerics("stiffnesses")
        return list(self.weights) if all(name in known for name in self.weights) else []

    def spring_displacements(self, system: System, modes: int) -> Array:
        """Return sqrt(k) times the displacement of each spring in every mode, 1/s, shape (..., springs, modes)."""
        found = []
        moving = system.natural_frequencies(modes) > 0  # a rigid-body motion deforms nothing
        for name in self.springs(system):
            value = np.asarray(system.values[name])
            finite = np.where(np.isinf(value), 0.0, value)
            end, place, factor = system.numerics("stiffnesses")[name]
            size = np.sqrt(finite * factor.function(*system.domain.values))
            found.append(size[..., None] * system.modes(modes).displacement(end, place) * moving)
        return np.stack(np.broadcast_arrays(*found), axis=-2)


class _ShakenBase(Excitation):
    """A base that shakes with an amplitude."""

    def __init__(self, amplitude: Any) -> None:
        super().__init__(amplitude=amplitude)

    @property
    def amplitude(self) -> Value:
        """Amplitude at epsilon = 1, m."""
        return self._numbers["amplitude"]


class AxialBase(_ShakenBase, Parametric):
    """A frame that shakes along x, towards the right end and back, u = epsilon amplitude cos(varpi t), (35a).

    The foreshortening of the first field feels the inertia of all mass beyond, so that P grows with the square of the
    excitation frequency.

    Parameters
    ----------
    amplitude : array_like
        Amplitude at epsilon = 1, m; not negative.

    Raises
    ------
    TypeError, ValueError
        If the amplitude is not made of finite real numbers or is negative.
    """

    power = 2

    def unit_coupling(self, system: System, modes: int) -> Array:
        """Return P for varpi = 1 rad/s, 1/s2, shape (..., modes, modes)."""
        return np.asarray(self.amplitude)[..., None, None] * system.form("axial", modes)["axial"]


class TransverseBase(_ShakenBase):
    """A base that shakes across the span, w = epsilon amplitude sin(varpi t), (35).

    The only prescribed motion of the model; it forces vibration and has no boundary.

    Parameters
    ----------
    amplitude : array_like
        Amplitude at epsilon = 1, m; not negative.

    Raises
    ------
    TypeError, ValueError
        If the amplitude is not made of finite real numbers or is negative.
    """
