"""Parametric excitations of any system: the parts of its Lagrangian that are periodic in time."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING, Any, NamedTuple, Self

import numpy as np
from numpy.typing import NDArray

from cra_sym.checks import broadcastable, real_array, shown
from cra_sym.model.modal_matrices import between_modes
from cra_sym.model.system import System
from cra_sym.model.values import Value, frozen
from cra_sym.si import paired
from cra_sym.solvers.floquet import Oscillation

if TYPE_CHECKING:
    from cra_sym.model.excited import SwungLoad
    from cra_sym.model.lagrangian import Model

__all__ = ["AxialBase", "Drive", "Excitation", "Fluctuation", "LagrangianTerms", "Parametric", "TransverseBase"]

Array = NDArray[np.float64]


class Excitation:
    """Base class of excitations: named numbers that may be arrays, compared by value."""

    def __init__(self, **numbers: Any) -> None:
        units = {"amplitude": "m"}  # the others are weights
        checked = {
            name: frozen(real_array(name, value, low=0.0, unit=units.get(name, "1")))
            for name, value in paired(numbers, {name: units.get(name, "1") for name in numbers}).items()
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
        return self._key() == other._key() if type(other) is type(self) else NotImplemented

    def __hash__(self) -> int:
        return hash((type(self), self._key()))

    def __reduce__(self) -> tuple[Any, ...]:
        return _rebuilt, (type(self), dict(self._numbers))

    def __repr__(self) -> str:
        return f"{type(self).__name__}({', '.join(f'{name}={value!r}' for name, value in self._numbers.items())})"


def _rebuilt(kind: type[Excitation], numbers: dict[str, Any]) -> Excitation:
    return kind(**numbers)


class Drive(NamedTuple):
    r"""One oscillation and its matrices. With g = epsilon varpi^power cos or sin(order varpi t) the equations are

    :math:`\frac{d}{dt}(\dot q + g(M\dot q + Bq)) + C_0\dot q + gC\dot q + K_0q + gKq = 0`.

    Attributes
    ----------
    oscillation : Oscillation
    stiffness, damping, momentum, mass : ndarray, shape (..., modes, modes), or None
        K, C, B and M; None stands for zero.
    """

    oscillation: Oscillation
    stiffness: Array | None = None
    damping: Array | None = None
    momentum: Array | None = None
    mass: Array | None = None


class DirectForce(NamedTuple):
    """A force on the modes that is proportional to an oscillation, and to an input if a cause is named.

    Attributes
    ----------
    oscillation : Oscillation
    small : bool
        Whether it is proportional to epsilon.
    force : ndarray, shape (..., modes)
    cause : (str, int) or None
        Name of a prescribed motion or force, and the order of its derivative by time.
    """

    oscillation: Oscillation
    small: bool
    force: Array
    cause: tuple[str, int] | None


def _direct(
    system: System, modes: int, oscillation: Oscillation, swung: SwungLoad, *, small: bool, size: Array | float = 1.0
) -> Iterator[DirectForce]:
    """Yield a load on the modes; the derivative of a product by time is that of each factor."""
    force = size * system.project(swung.load, modes)
    if not swung.momentum:
        yield DirectForce(oscillation, small, force, swung.cause)
        return
    turned, factor = oscillation.rate()
    yield DirectForce(turned, small, factor * force, swung.cause)
    if swung.cause is not None:
        name, order = swung.cause
        yield DirectForce(oscillation, small, force, (name, order + 1))


_COSINE = Oscillation(1, "cos", 0)


class Parametric(Excitation):
    """An excitation that makes the equations of motion periodic."""

    def drives(self, system: System, modes: int) -> list[Drive]:
        """Return the oscillating matrices between the first modes of the system's conservative part."""
        raise NotImplementedError

    def forces(self, system: System, modes: int) -> list[DirectForce]:
        """Return the forces that act without any vibration."""
        return []

    def springs(self, system: System) -> list[str]:
        """Return the fluctuating stiffnesses of ends, if nothing else fluctuates; then statics keep the other modes."""
        return []


class LagrangianTerms(Parametric):
    """The terms of a model's own Lagrangian that oscillate: :attr:`cra_sym.Model.excitation`.

    Parameters
    ----------
    model : Model
    """

    def __init__(self, model: Model) -> None:
        super().__init__()
        self._model = model

    @property
    def oscillations(self) -> tuple[Oscillation, ...]:
        """The oscillations (order, 'cos' or 'sin', power): varpi**power times cos or sin of order * varpi * t."""
        return tuple(dict.fromkeys(part.oscillation for part in self._model.oscillating_terms))

    def drives(self, system: System, modes: int) -> list[Drive]:
        """Return the oscillating matrices between the first modes of the system's conservative part."""
        self._check(system)
        found = []
        for part in self._model.oscillating_terms:
            if part.matrices is not None:
                form = between_modes(system, modes, part.matrices)
                found.append(Drive(part.oscillation, **{name: form[name] for name in part.matrices.names}))
        return found

    def forces(self, system: System, modes: int) -> list[DirectForce]:
        """Return the forces that act without any vibration."""
        self._check(system)
        return [
            force
            for part in self._model.oscillating_terms
            for swung in part.loads
            for force in _direct(system, modes, part.oscillation, swung, small=part.small)
        ]

    def _check(self, system: System) -> None:
        if system.model != self._model:
            raise ValueError(f"excitation = {self!r}: is of another model; must be system.model.excitation")

    def _key(self) -> tuple[Any, ...]:
        return (self._model,)

    def __getitem__(self, index: Any) -> Self:
        """Return itself: there is no batch."""
        return self

    def __reduce__(self) -> tuple[Any, ...]:
        return type(self), (self._model,)

    def __repr__(self) -> str:
        epsilon, varpi = self._model.pieces["small"]
        words = []
        for part in self._model.oscillating_terms:
            order, kind, power = part.oscillation
            factors = [str(epsilon)] * part.small + [f"{varpi}**{power}" if power > 1 else str(varpi)] * (power > 0)
            words.append(
                " ".join([*factors, f"{kind}({'' if order == 1 else f'{order} '}{varpi} t)" if order else "1"])
            )
        return f"<{', '.join(dict.fromkeys(words))} in the Lagrangian>"


class Fluctuation(Parametric):
    """Parameters that fluctuate about their values: each is p (1 + weight epsilon cos(varpi t)).

    Stiffnesses, masses, dampers, tensions, speeds: any parameter in which the Lagrangian and the virtual work are
    linear. A changing mass keeps its momentum: the mass that is added or removed carries none.

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
        known = weights if isinstance(weights, Mapping) else {}
        given: dict[Any, Any] = {getattr(key, "name", key): value for key, value in known.items()}
        if not isinstance(weights, Mapping | None) or not all(isinstance(name, str) for name in given):
            raise TypeError(f"weights = {shown(weights)}: must be a mapping from symbols or names to numbers")
        twice = sorted(given.keys() & named.keys())
        if twice:
            raise ValueError(f"weights: {twice[0]} is given twice")
        if not given and not named:
            raise ValueError("weights: must name at least one parameter that fluctuates")
        super().__init__(**given, **named)

    @property
    def weights(self) -> Mapping[str, Value]:
        """The weight of every fluctuating parameter, by name."""
        return self._numbers

    def drives(self, system: System, modes: int) -> list[Drive]:
        """Return the fluctuating matrices between the first modes; an infinite stiffness does not fluctuate."""
        totals: dict[str, Array] = {}
        used: dict[str, tuple[str, ...]] = {}
        for name, weight in self._fluctuating(system).items():
            form, used[name] = system.numerics("fluctuating", name)
            other = next((n for n in used if n in used[name] or (name in used[n] and n != name)), None)
            if other is not None:
                raise ValueError(
                    f"{self!r}: {name} and {other} have a product, which gives epsilon squared; must fluctuate alone"
                )
            value = np.asarray(system.values[name])
            size = (np.asarray(weight) * np.where(np.isinf(value), 0.0, value))[..., None, None]
            found = between_modes(system, modes, form)
            for kind in form.names:
                totals[kind] = totals.get(kind, 0.0) + size * found[kind]
        if "stiffness" in totals:
            moving = system.basis.natural_frequencies(modes) > 0  # a rigid-body motion deforms nothing
            totals["stiffness"] = totals["stiffness"] * (moving[..., :, None] & moving[..., None, :])
        return [Drive(_COSINE, **totals)]

    def forces(self, system: System, modes: int) -> list[DirectForce]:
        """Return the fluctuating forces, such as the weight of a mass and its inertia on a moving base."""
        found: list[DirectForce] = []
        for name, weight in self._fluctuating(system).items():
            value = np.asarray(system.values[name])
            size = (np.asarray(weight) * np.where(np.isinf(value), 0.0, value))[..., None]
            for swung in system.numerics("fluctuating_loads", name):
                found += _direct(system, modes, _COSINE, swung, small=True, size=size)
        return found

    def _fluctuating(self, system: System) -> dict[str, Value]:
        """Return the weights, without those that are 0 and belong to no parameter of the model.

        Raises
        ------
        ValueError
            Names the parameter that cannot fluctuate.
        """
        found = {name: weight for name, weight in self.weights.items() if name in system.values or np.any(weight)}
        for name in found:
            reason = "is not a parameter" if name not in system.values else system.numerics("fluctuation", name)
            if reason:
                known = ", ".join(n for n in system.values if not system.numerics("fluctuation", n))
                raise ValueError(f"{self!r}: {name} {reason}; must be one of {known}")
        return found

    def springs(self, system: System) -> list[str]:
        """Return the fluctuating stiffnesses if all of them are stiffnesses of an end."""
        known, names = system.numerics("stiffnesses"), list(self._fluctuating(system))
        return names if all(name in known for name in names) else []

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
    """Base class of oscillating bases with an amplitude."""

    def __init__(self, amplitude: Any) -> None:
        super().__init__(amplitude=amplitude)

    @property
    def amplitude(self) -> Value:
        """Amplitude at epsilon = 1, m."""
        return self._numbers["amplitude"]


class AxialBase(_ShakenBase, Parametric):
    """A frame that oscillates along x: u = epsilon amplitude cos(varpi t), (35a).

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

    Examples
    --------
    >>> import cra_sym as cra
    >>> lower, upper = cra.stability_boundary(cra.Arm.nominal(), cra.AxialBase(0.001), epsilon=0.1)
    >>> print(f"{lower:.3f} to {upper:.3f} rad/s")
    30.503 to 30.513 rad/s
    """

    def drives(self, system: System, modes: int) -> list[Drive]:
        """Return the oscillating matrix: a stiffness proportional to the square of the excitation frequency."""
        form = between_modes(system, modes, system.numerics("axial"))
        return [Drive(Oscillation(1, "cos", 2), np.asarray(self.amplitude)[..., None, None] * form["axial"])]


class TransverseBase(_ShakenBase):
    """A base that oscillates across the span, w = epsilon amplitude sin(varpi t), (35).

    It is the only prescribed motion of the model. It forces vibration and does not make it unstable.

    Parameters
    ----------
    amplitude : array_like
        Amplitude at epsilon = 1, m; not negative.

    Raises
    ------
    TypeError, ValueError
        If the amplitude is not made of finite real numbers or is negative.

    Examples
    --------
    >>> import cra_sym as cra
    >>> cra.forced_width(cra.Arm.nominal(), cra.TransverseBase(0.001)).round(4)
    array([0.0119, 0.0407, 0.066 ])
    """
