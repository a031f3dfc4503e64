"""Elastic-slip elements: the Jenkins element (a spring in series with a slider) and Iwan's distribution of them."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar, Self

import numpy as np
from numpy.typing import NDArray

from cra_sym.checks import broadcastable, count, real_array, shown
from cra_sym.solvers.distributions import Distribution, Piece

__all__ = ["Element", "Iwan", "Jenkins", "Tabulated"]

Array = NDArray[np.float64]
_POSITIVE = {"low": 0.0, "open_low": True}


class Element:
    """Base class of elastic-slip elements: checked parameters, and closed forms of their distribution.

    Parameters are numbers, arrays that broadcast together, or SymPy expressions; closed forms need numbers.
    """

    _LIMITS: ClassVar[Mapping[str, Mapping[str, Any]]] = {}

    def __post_init__(self) -> None:
        for name, limits in self._LIMITS.items():
            object.__setattr__(self, name, _parameter(name, getattr(self, name), limits))
        _ = self.shape

    @property
    def parameters(self) -> dict[str, Any]:
        """The parameters by name."""
        return {name: getattr(self, name) for name in self._LIMITS}

    @property
    def shape(self) -> tuple[int, ...]:
        """Common shape of the parameters that are arrays."""
        return broadcastable(**{name: v for name, v in self.parameters.items() if not _symbolic(v)})

    def replace(self, **changes: Any) -> Self:
        """Return a validated copy with some parameters changed.

        Raises
        ------
        TypeError, ValueError
            If a name is not a parameter, or as the class.
        """
        unknown = [name for name in changes if name not in self.parameters]
        if unknown:
            raise TypeError(f"{unknown[0]!r} is not a parameter of {type(self).__name__}")
        return dataclasses.replace(self, **changes)  # type: ignore[type-var]

    @property
    def distribution(self) -> Distribution:
        """The distribution of the elements in parallel, with numbers for its parameters."""
        raise NotImplementedError

    def force(self, displacement: Any) -> Array:
        """Return the force on first loading to a displacement; after a reversal Masing's rule holds."""
        return self._numbers().force(real_array("displacement", displacement, unit=None))[()]

    def loss(self, amplitude: Any) -> Array:
        """Return the energy lost in a cycle between the displacements -amplitude and amplitude, J."""
        return self._numbers().loss(_amplitude(amplitude))[()]

    def equivalent_stiffness(self, amplitude: Any) -> Array:
        """Return the first harmonic of the force over a harmonic displacement, in phase with it."""
        return self._numbers().equivalent(_amplitude(amplitude))[()]

    def secant_stiffness(self, amplitude: Any) -> Array:
        """Return the largest force of a cycle over the amplitude; for zero amplitude the stuck stiffness."""
        size, found = _amplitude(amplitude), self._numbers()
        with np.errstate(divide="ignore", invalid="ignore"):
            return np.where(size > 0, found.force(size) / np.where(size > 0, size, 1.0), found.stiffness)[()]

    def elements(self, number: int = 60) -> tuple[Array, Array]:
        """Return stiffness and slip of the Jenkins elements that approximate it, shape (..., about ``number``).

        Stiffness and slip of the whole are exact. For the four-parameter law and amplitudes from 2e-3 to any multiple
        of the largest slip displacement, the relative error of the loss is below 0.05, 0.01 and 0.003 for 30, 60 and
        120 elements, and falls with the square of their number; that of the equivalent stiffness is below 1e-3 for 60.
        Two elements represent all that slip below 1e-3 of that displacement.
        """
        stiffness, slip = self._numbers().elements(count("number", number, high=10_000))
        return stiffness, slip

    def _numbers(self) -> Distribution:
        for name, value in self.parameters.items():
            if _symbolic(value):
                raise TypeError(f"{name} = {shown(value)}: must be a number here; replace({name}=..)")
        return self.distribution

    def _fields(self) -> dict[str, Any]:
        return {field.name: getattr(self, field.name) for field in dataclasses.fields(self)}  # type: ignore[arg-type]

    def _key(self) -> tuple[Any, ...]:
        values = self._fields().values()
        return tuple(v if _symbolic(v) else (np.shape(v), np.asarray(v, float).tobytes()) for v in values)

    def __eq__(self, other: object) -> bool:
        return self._key() == other._key() if type(other) is type(self) else NotImplemented

    def __hash__(self) -> int:
        return hash((type(self), self._key()))

    def __reduce__(self) -> tuple[Any, ...]:
        return _rebuilt, (type(self), self._fields())


@dataclass(frozen=True, eq=False)
class Jenkins(Element):
    """A spring in series with a slider: the elastic-slip element.

    Parameters
    ----------
    stiffness : float, ndarray or Expr
        Of the spring, N/m, or N m/rad on a slope; positive and finite.
    slip : float, ndarray or Expr
        Force (moment) at which the slider slips; positive and finite.

    Raises
    ------
    TypeError, ValueError
        Names the parameter that is not real or out of its range.

    Examples
    --------
    >>> element = Jenkins(stiffness=60.0, slip=3.0)
    >>> element.force([0.02, 0.1]), element.loss(0.1)
    (array([1.2, 3. ]), np.float64(0.6000000000000001))
    >>> element.equivalent_stiffness([0.05, 0.1])
    array([60., 30.])
    """

    stiffness: Any
    slip: Any

    _LIMITS: ClassVar[Mapping[str, Mapping[str, Any]]] = {"stiffness": _POSITIVE, "slip": _POSITIVE}

    @property
    def distribution(self) -> Distribution:
        """The one element."""
        k, f = np.broadcast_arrays(np.asarray(self.stiffness, float), np.asarray(self.slip, float))
        return Distribution((), ((k, f / k),))


@dataclass(frozen=True, eq=False)
class Iwan(Element):
    r"""Jenkins elements in parallel, distributed over the displacement at which they slip.

    The four-parameter law: a stiffness per slip displacement :math:`R\varphi^\chi` up to :math:`\varphi_{max}`, and a
    stiffness S of elements that slip there together. The energy lost in a cycle of small amplitude a is
    :math:`4 R a^{3+\chi} / ((2+\chi)(3+\chi))`. With chi = 0 and beta = 0 the distribution is uniform.

    Parameters
    ----------
    stiffness : float, ndarray or Expr
        K_T, with all elements stuck, N/m; positive and finite.
    slip : float, ndarray or Expr
        F_S, the force at which all elements slip; positive and finite.
    chi : float, ndarray or Expr
        Exponent, in (-1, 0].
    beta : float, ndarray or Expr
        S over the stiffness of the other elements, in [0, inf).
    number : int
        Number of Jenkins elements that represent it in analyses, see `elements`.

    Raises
    ------
    TypeError, ValueError
        Names the parameter that is not real or out of its range.

    References
    ----------
    D. J. Segalman, "A four-parameter Iwan model for lap-type joints", Journal of Applied Mechanics 72 (2005), 752-760.

    Examples
    --------
    >>> joint = Iwan(stiffness=1e6, slip=100.0, chi=-0.5, beta=0.5)
    >>> round(float(joint.phi_max) * 1e6, 3)
    180.0
    >>> joint.loss([1e-5, 2e-5])[1] / joint.loss(1e-5) == 2**2.5
    np.True_
    """

    stiffness: Any
    slip: Any
    chi: Any = 0.0
    beta: Any = 0.0
    number: int = 60

    _LIMITS: ClassVar[Mapping[str, Mapping[str, Any]]] = {
        "stiffness": _POSITIVE,
        "slip": _POSITIVE,
        "chi": {"low": -1.0, "open_low": True, "high": 0.0, "must": "real numbers in (-1, 0]"},
        "beta": {"low": 0.0},
    }

    def __post_init__(self) -> None:
        object.__setattr__(self, "number", count("number", self.number, low=2, high=10_000))
        super().__post_init__()

    @classmethod
    def uniform(cls, stiffness: Any, slip: Any, number: int = 60) -> Iwan:
        """Return the uniform distribution from 0 to 2 slip / stiffness."""
        return cls(stiffness, slip, number=number)

    @classmethod
    def of_density(cls, R: Any, S: Any, phi_max: Any, chi: Any, number: int = 60) -> Iwan:
        """Return the law given by R, S, phi_max and chi instead of K_T, F_S, beta and chi.

        Parameters
        ----------
        R : float, ndarray or Expr
            Factor of the density, positive.
        S : float, ndarray or Expr
            Stiffness that slips at ``phi_max``, not negative.
        phi_max : float, ndarray or Expr
            Largest slip displacement, m, positive.
        chi : float, ndarray or Expr
            Exponent, in (-1, 0].
        """
        R, phi_max = _parameter("R", R, _POSITIVE), _parameter("phi_max", phi_max, _POSITIVE)
        S, chi = _parameter("S", S, {"low": 0.0}), _parameter("chi", chi, cls._LIMITS["chi"])
        distributed = R * phi_max ** (chi + 1) / (chi + 1)
        slip = R * phi_max ** (chi + 2) / (chi + 2) + S * phi_max
        return cls(distributed + S, slip, chi, S / distributed, number)

    @staticmethod
    def of_points(displacements: Any, densities: Any, number: int = 60) -> Tabulated:
        """Return a distribution whose density is linear between points.

        Parameters
        ----------
        displacements : array_like, shape (points,)
            Slip displacements, m, not negative, ascending.
        densities : array_like, shape (points,)
            Stiffness per slip displacement there, N/m^2, not negative; nothing slips outside.
        number : int
            How many Jenkins elements stand for it in analyses.
        """
        return Tabulated(displacements, densities, number)

    @property
    def _shape(self) -> Any:
        return (self.chi + 1) / (self.chi + 2)

    @property
    def phi_max(self) -> Any:
        """Displacement at which all sliders slip, m."""
        return self.slip * (1 + self.beta) / (self.stiffness * (self.beta + self._shape))

    @property
    def S(self) -> Any:
        """Stiffness of the elements that slip last, N/m."""
        return self.stiffness * self.beta / (1 + self.beta)

    @property
    def R(self) -> Any:
        """Factor of the density, N/m^(2 + chi)."""
        return (self.stiffness - self.S) * (self.chi + 1) / self.phi_max ** (self.chi + 1)

    @property
    def distribution(self) -> Distribution:
        """The distribution in numbers."""
        parts = (self.R, self.chi, 0.0, self.phi_max, self.S)
        factor, exponent, start, stop, last = np.broadcast_arrays(*(np.asarray(part, float) for part in parts))
        single = ((last, stop),) if last.any() else ()
        return Distribution((Piece(((factor, exponent),), start, stop),), single)


@dataclass(frozen=True, eq=False)
class Tabulated(Element):
    """Jenkins elements in parallel, their density given by points; see :meth:`Iwan.of_points`.

    Examples
    --------
    >>> uniform = Iwan.of_points([0.0, 2.0], [1.5, 1.5])
    >>> uniform.stiffness, uniform.slip, uniform.loss(1.0) == Iwan(3.0, 3.0).loss(1.0)
    (3.0, 3.0, np.True_)
    """

    displacements: Any
    densities: Any
    number: int = 60

    def __post_init__(self) -> None:
        object.__setattr__(self, "number", count("number", self.number, low=2, high=10_000))
        for name in ("displacements", "densities"):
            value = _parameter(name, getattr(self, name), {"low": 0.0})
            if _symbolic(value) or np.ndim(value) != 1 or np.size(value) < 2:
                raise ValueError(f"{name} = {shown(value)}: must be one axis of at least two numbers")
            object.__setattr__(self, name, value)
        if self.displacements.shape != self.densities.shape:
            raise ValueError(f"densities: must be as many as displacements, {self.displacements.size}")
        if not (np.diff(self.displacements) > 0).all():
            raise ValueError(f"displacements = {shown(self.displacements)}: must ascend")
        if not self.stiffness > 0:
            raise ValueError(f"densities = {shown(self.densities)}: one of them must be positive")

    @property
    def stiffness(self) -> float:
        """Stiffness with all sliders stuck, N/m."""
        return float(self.distribution.stiffness)

    @property
    def slip(self) -> float:
        """Force at which all sliders slip."""
        return float(self.distribution.slip)

    @property
    def distribution(self) -> Distribution:
        """The distribution."""
        return Distribution.of_lines(self.displacements, self.densities)


def _symbolic(value: Any) -> bool:
    return bool(getattr(value, "free_symbols", None))


def _parameter(name: str, value: Any, limits: Mapping[str, Any]) -> Any:
    """Return a checked number or read-only array, or an expression as it is."""
    if _symbolic(value):
        from sympy import Expr, Symbol
        from sympy.core.function import AppliedUndef

        plain = isinstance(value, Expr) and value.is_commutative and not value.atoms(AppliedUndef)
        if not plain or not all(isinstance(symbol, Symbol) for symbol in value.free_symbols):
            raise TypeError(f"{name} = {shown(value)}: must be numbers or an expression in symbols")
        return value
    array = np.asarray(real_array(name, value, **limits) + 0.0)
    array.flags.writeable = False
    return float(array) if array.ndim == 0 else array


def _amplitude(amplitude: Any) -> Array:
    return real_array("amplitude", amplitude, low=0.0)


def _rebuilt(kind: type[Element], fields: dict[str, Any]) -> Element:
    return kind(**fields)
