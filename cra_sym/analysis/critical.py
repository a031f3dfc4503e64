"""Critical values of a parameter at which stability is lost: divergence (buckling) or flutter."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from itertools import islice
from typing import TYPE_CHECKING, Any, Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq

from cra_sym.checks import count, default_floating_point, instance, real_array, shown
from cra_sym.model.system import System
from cra_sym.model.values import flat_columns
from cra_sym.solvers.pencil import reduced
from cra_sym.solvers.pencil_refine import meshes, sequence

if TYPE_CHECKING:
    from sympy import Symbol

__all__ = ["CriticalValue", "critical_value"]

Array = NDArray[np.float64]
Complex = NDArray[np.complex128]
Kind = Literal["divergence", "flutter"]
_GROWTH = 1e-7, 1e-11
"""Ratio of real part to modulus above which a motion counts as growing, without and with dissipation; smaller ones are
rounding, which without dissipation is large where two eigenvalues coalesce."""
_SECTIONS = 33, 33  # numbers of values in the first and the second subdivision of the interval of the first loss
_REACH = (
    1.2  # largest modulus of the eigenvalues considered, over the frequency of the last mode without loads and dampers
)
_MESHES = 8


@dataclass(frozen=True)
class CriticalValue:
    """First loss of stability.

    Attributes
    ----------
    value : float or ndarray
        Of the parameter.
    kind : {'divergence', 'flutter'} or ndarray of str
        Static, with an eigenvalue that passes zero, or oscillating.
    angular_frequency : float or ndarray
        Of the motion that begins to grow, rad/s; 0 for divergence.
    """

    value: float | Array
    kind: Kind | NDArray[np.str_]
    angular_frequency: float | Array


@default_floating_point
def critical_value(
    system: System, parameter: str | Symbol, between: tuple[float, float], *, modes: int = 6, points: int = 65
) -> CriticalValue:
    """Return the first value of a parameter in an interval at which the equilibrium loses its stability.

    Parameters
    ----------
    system : System
        The value of the parameter in it is ignored. Modal damping (zeta) is left out.
    parameter : str or Symbol
    between : (float, float)
        Lower and upper value; at the lower one the system must be stable.
    modes : int
        Eigenvalues up to the frequency of this mode, without loads and dampers, are considered.
    points : int
        Number of values tried. Instability only between two of them is not detected.

    Returns
    -------
    CriticalValue
        Of the batch shape that the system has without the parameter.

    Raises
    ------
    TypeError, ValueError
        If the parameter is unknown, the interval is not one, the system is unstable at its lower end, or stable at all
        values that are tried; if the critical value does not converge to the tolerance of the system; the message gives
        the error reached.
    ArithmeticError
        If more than one eigenvalue crosses in a bracket that cannot be narrowed.

    Notes
    -----
    The first loss is bracketed by the complex eigenvalues. In the bracket the zero is found of a function with a simple
    zero: the determinant of the static stiffness for divergence; for flutter the squared difference of the two squared
    eigenvalues that coalesce or, with dissipation, a real part. Elements are refined until the value converges to the
    tolerance of the system.

    References
    ----------
    Bolotin, Nonconservative Problems of the Theory of Elastic Stability, 1963.

    Examples
    --------
    Euler's and Beck's columns:

    >>> from sympy import symbols
    >>> import cra_sym as cra
    >>> from cra_sym.symbols import t, v, x
    >>> P = symbols("P")
    >>> euler = cra.Model(v.diff(t)**2 / 2 - v.diff(x, 2)**2 / 2 + P * v.diff(x)**2 / 2, fields=[v], x=x, domain=(0, 1),
    ...                   t=t, essential=[v.subs(x, 0), v.diff(x).subs(x, 0)])
    >>> round(critical_value(euler.at({P: 0}), P, between=(0, 10)).value, 9)
    2.4674011
    >>> beck = euler.replace(virtual_work=[(-P * v.diff(x), v, "right")])
    >>> found = critical_value(beck.at({P: 0}), P, between=(0, 30))
    >>> found.kind, round(found.value, 9), round(found.angular_frequency, 6)
    ('flutter', 20.050953619, 11.015558)
    """
    instance("system", system, System)
    name, low, high = _checked(system, parameter, between)
    modes, points = count("modes", modes, high=100), count("points", points, low=2, high=100_000)
    others = {key: value for key, value in system.values.items() if key != name}
    shape = np.broadcast_shapes(*(np.shape(value) for value in others.values()))
    columns = flat_columns([others.get(key, 0.0) for key in system.numerics("names")], shape)
    place = list(system.numerics("names")).index(name)
    found = [_CriticalSearch(system, column, place, name, modes).first(low, high, points) for column in columns.T]
    if not shape:
        return CriticalValue(*found[0])
    value, kind, omega = (np.array(part).reshape(shape) for part in zip(*found, strict=True))
    return CriticalValue(value, kind, omega)


def _checked(system: System, parameter: Any, between: Any) -> tuple[str, float, float]:
    name = getattr(parameter, "name", parameter)
    if not isinstance(name, str) or name not in system.numerics("names"):
        raise ValueError(f"parameter = {shown(parameter)}: must be one of {', '.join(system.numerics('names'))}")
    ends = real_array(
        "between", between, unit=system.model.units.get(name), must="two real numbers, the lower one first"
    )
    if ends.shape != (2,) or not (np.isfinite(ends).all() and ends[0] < ends[1]):
        raise ValueError(f"between = {shown(between)}: must be two real numbers, the lower one first")
    if system.numerics("pencil") is None:
        raise ValueError("system: a field without a derivative by x leaves no critical value; eliminate the field")
    return name, float(ends[0]), float(ends[1])


class _FinestError(Exception):
    """There is no finer mesh."""


class _ValueState(NamedTuple):
    """Results at one value: eigenvalues, determinant of the static stiffness, whether there is no dissipation."""

    s: Complex
    statics: float
    lossless: bool


class _CriticalSearch:
    """The search of one parameter set."""

    def __init__(self, system: System, column: Array, place: int, name: str, modes: int) -> None:
        self._pencil, self._column, self._place, self._name = system.numerics("pencil"), column, place, name
        self._modes, self._tolerance = modes, system.tolerance
        self._at = lru_cache(maxsize=None)(lambda value, level: self._states(np.array([value]), level)[0])

    def first(self, low: float, high: float, points: int) -> tuple[float, Kind, float]:
        """Return value, kind and angular frequency of the first loss of stability."""
        if self._unstable(self._at(low, 1)):
            what = _described(self._at(low, 1))
            raise ValueError(f"between: the system is already unstable at {self._name} = {low:g} ({what})")
        below, above = self._bracket(low, high, points)
        for number in _SECTIONS:
            below, above = self._bracket(below, above, number)
        s = self._growing(self._at(above, 1))
        kind: Kind = "divergence" if s.imag == 0.0 else "flutter"
        before, value, least = np.inf, np.nan, np.inf
        for level in range(1, _MESHES):
            try:
                value = self._zero(kind, s, below, above, level)
            except _FinestError:
                break
            error = abs(value - before) / max(abs(value), 1e-6 * (high - low))
            least = min(least, error)
            if error <= self._tolerance:
                return value, kind, self._omega(kind, s, self._at(value, level))
            before = value
        raise ValueError(
            f"{self._name}: the critical value near {value:.6g} converges to {least:.1g} only; a tolerance of the "
            f"system of {2 * least:.1g} accepts that"
        )

    @staticmethod
    def _omega(kind: Kind, s: complex, state: _ValueState) -> float:
        """Return the angular frequency of the neutral motion; of two that coalesce, from their mean."""
        if kind == "divergence":
            return 0.0
        if state.lossless:
            return float(np.sqrt(max(_meeting(state, s).mean().real, 0.0)))
        return float(abs(state.s[np.abs(state.s - s).argmin()].imag))

    def _bracket(self, low: float, high: float, points: int) -> tuple[float, float]:
        """Return the last stable and the first unstable of equidistant values."""
        values = np.linspace(low, high, points)
        unstable = np.array([self._unstable(state) for state in self._states(values[1:], 1)])
        if not unstable.any():
            raise ValueError(
                f"between: the system is stable at all {points} values of {self._name} from {low:g} to {high:g}; ask "
                "for a wider interval or, if it is unstable in a narrow one only, more points"
            )
        first = int(unstable.argmax())
        return float(values[first]), float(values[first + 1])

    def _zero(self, kind: Kind, s: complex, low: float, high: float, level: int) -> float:
        """Return the zero of the indicator function in a bracket, which is widened if mesh refinement shifts it."""

        def sign(value: float) -> float:
            state = self._at(float(value), level)
            if kind == "divergence":
                return state.statics
            if not state.lossless:
                return float(-state.s[np.abs(state.s - s).argmin()].real)
            first, second = _meeting(state, s)
            return float(((first - second) ** 2).real)

        for _ in range(12):
            if sign(low) * sign(high) <= 0.0:
                return float(brentq(sign, low, high, xtol=1e-300, rtol=8 * np.finfo(float).eps))
            low, high = low - (high - low), high + (high - low)
        raise ArithmeticError(
            f"{self._name}: the loss of stability near {high:.6g} is not the crossing of one eigenvalue; "
            "use eigenvalues"
        )

    def _unstable(self, state: _ValueState) -> bool:
        return bool((state.s.real > _GROWTH[0 if state.lossless else 1] * np.abs(state.s)).any())

    @staticmethod
    def _growing(state: _ValueState) -> complex:
        s = state.s[state.s.imag >= 0.0]
        return complex(s[s.real.argmax()])

    def _states(self, values: Array, level: int) -> list[_ValueState]:
        """Return the results at the values, on the mesh of that level."""
        columns = np.repeat(self._column[:, None], len(values), axis=1)
        columns[self._place] = values
        found: dict[int, _ValueState] = {}
        for rows, problem in self._pencil.problems(columns):
            for part, chosen, mesh, _ in meshes(problem, self._modes, self._tolerance):
                finer = next(islice(sequence(mesh), level, None), None)
                if finer is None:
                    raise _FinestError
                for reduction in reduced(chosen, finer):
                    reach = _REACH * reduction.frequency(self._modes)
                    statics = np.linalg.det(reduction.stiffness)
                    for k, (s, lossless) in enumerate(zip(reduction.eigenvalues(), reduction.lossless(), strict=True)):
                        near = s[np.abs(s) < reach[k]]
                        found[int(rows[part[reduction.sets[k]]])] = _ValueState(near, float(statics[k]), bool(lossless))
        return [found[k] for k in range(len(values))]


def _meeting(state: _ValueState, s: complex) -> Complex:
    """Return the two squared frequencies that are nearest to that of a motion."""
    squares = -(state.s[(state.s.imag > 0.0)] ** 2)
    return squares[np.argsort(np.abs(squares + (s**2).real), kind="stable")[:2]]


def _described(state: _ValueState) -> str:
    s = state.s[state.s.real.argmax()]
    if s.imag == 0.0:
        return f"divergence, growth {s.real:.4g} 1/s"
    return f"flutter at {abs(s.imag):.4g} rad/s, growth {s.real:.4g} 1/s"
