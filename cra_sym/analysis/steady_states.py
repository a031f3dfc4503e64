"""Steady states of nonlinear systems under periodic excitation: all periodic solutions found, with their stability."""

from __future__ import annotations

import warnings
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, TypedDict, Unpack, overload

import numpy as np
from numpy.typing import ArrayLike, NDArray

from cra_sym import checks
from cra_sym.analysis.driven_problem import DrivenProblem
from cra_sym.analysis.nonlinear import MOST_NONLINEAR_MODES, ConvergenceWarning, warn_of_slopes
from cra_sym.analysis.slip_states import MOST, SlipProblem
from cra_sym.analysis.steady_search import Answers, answers_at, is_stable
from cra_sym.cached import cached_property
from cra_sym.model.excitations import Parametric
from cra_sym.model.system import System
from cra_sym.si import Numbers

if TYPE_CHECKING:
    from sympy import Expr
    from sympy.core.function import AppliedUndef

__all__ = ["SteadyState", "steady_states"]

Array = NDArray[np.float64]
Complex = NDArray[np.complex128]
_WIDE = 1e4  # largest ratio of the frequencies of modes and excitation


@dataclass(frozen=True, eq=False)
class SteadyState(checks.ByValue):
    """A periodic solution.

    Attributes
    ----------
    angular_frequency : float
        Of the excitation, rad/s.
    epsilon : float or None
        Of the excitation, if there is one.
    amplitude : float
        Peak at the tip, or of the chosen displacement.
    stable : bool
        Whether no Floquet multiplier lies outside the unit circle.
    multipliers : complex ndarray, shape (2 modes,)
        Over one period of the solution, largest first.
    coefficients : ndarray, shape (modes, 2 harmonics + 1)
        Modal coordinates as sums of the constant, the cosines and then the sines of k varpi t / period. With
        elastic-slip elements the amplitude also includes the static contribution of the omitted modes.
    problem : DrivenProblem or SlipProblem
        The modal equations that it solves, and the harmonics in which they are balanced.

    Examples
    --------
    What :func:`cra_sym.steady_states` returns several of:

    >>> from sympy import Function
    >>> import cra_sym as cra
    >>> from cra_sym.symbols import t, x
    >>> q, F = Function("q")(t), Function("F")(t)
    >>> duffing = cra.Model(0, fields=(), coordinates=[q], x=x, domain=(0, 1), t=t,
    ...                     left=q.diff(t)**2/2 - q**2/2 - q**4/4, virtual_work=[(F, q, None)])
    >>> (state,) = cra.steady_states(duffing.at({}, zeta=0.02), 0.5, drive={F: 0.1}, modes=1)
    >>> round(state.amplitude, 4), state.stable
    (0.1315, True)
    """

    angular_frequency: float
    epsilon: float | None
    amplitude: float
    stable: bool
    multipliers: Complex
    coefficients: Array
    problem: DrivenProblem | SlipProblem = field(compare=False)
    _unknowns: Array
    _at: Any

    @cached_property
    def error_modes(self) -> float:
        """Estimated relative error of the motion by truncation of the modes: its change with three more."""
        return self.problem.changed(3, 0, self._unknowns, self._at)

    @cached_property
    def error_harmonics(self) -> float:
        """Estimated relative error of the motion by truncation of the harmonics: its change with four more.

        With elastic-slip elements, with twice as many, or by the last doubling if these do not converge.
        """
        return self.problem.changed(0, 4, self._unknowns, self._at)

    @cached_property
    def loss(self) -> float:
        """Energy dissipated by elastic-slip elements in a period of the solution, J."""
        return self.problem.loss(self._unknowns)

    def __repr__(self) -> str:
        word = "stable" if self.stable else "unstable"
        return f"<SteadyState at {self.angular_frequency:.6g} rad/s, amplitude {self.amplitude:.6g}, {word}>"


class _Options(TypedDict, total=False):
    """Arguments common to the overloads of :func:`steady_states`."""

    excitation: Parametric | None
    drive: Mapping[Expr, float] | None
    modes: int
    harmonics: int | None
    period: int
    zeta: ArrayLike | None
    place: float | None
    field: AppliedUndef | None


@overload
def steady_states(
    system: System, angular_frequency: float, *, epsilon: float | None = None, **options: Unpack[_Options]
) -> tuple[SteadyState, ...]: ...
@overload
def steady_states(
    system: System, angular_frequency: ArrayLike, *, epsilon: float | None = None, **options: Unpack[_Options]
) -> list[tuple[SteadyState, ...]]: ...
@overload
def steady_states(
    system: System, angular_frequency: float, *, epsilon: Sequence[float] | Array, **options: Unpack[_Options]
) -> list[tuple[SteadyState, ...]]: ...
@overload
def steady_states(
    system: System, angular_frequency: ArrayLike, *, epsilon: Sequence[float] | Array, **options: Unpack[_Options]
) -> list[list[tuple[SteadyState, ...]]]: ...
@checks.default_floating_point
def steady_states(
    system: System,
    angular_frequency: Numbers,
    *,
    excitation: Parametric | None = None,
    epsilon: Numbers | None = None,
    drive: Mapping[Expr, float] | None = None,
    modes: int = 3,
    harmonics: int | None = None,
    period: int = 1,
    zeta: Numbers | None = None,
    place: float | None = None,
    field: AppliedUndef | None = None,
) -> list[list[tuple[SteadyState, ...]]] | list[tuple[SteadyState, ...]] | tuple[SteadyState, ...]:
    """Return the periodic solutions of a system with parametric excitation, harmonic input, or both.

    Elastic-slip elements are treated exactly between events. Solutions in which an element always sticks form a
    continuum, of which the one with the slider at 0, or as near to 0 as possible, is returned.

    Harmonic balance is solved from many starts: rest, all solutions of each mode alone with its nearest harmonic (by
    elimination, so that none of these is missed), free vibration with several phases, the solution curve for loads that
    grow from zero, and solutions at neighbouring frequencies and sizes, until no new one appears. Where all solutions
    are unstable, motions are integrated in time until they settle. For one mode and one harmonic the set is complete;
    otherwise a solution far from all others may be missed.

    Parameters
    ----------
    system : System
        Not a batch: for one, ``[steady_states(one, ..) for one in system.parameter_sets]``.
    angular_frequency : array_like
        Of the excitation, rad/s: a number or one axis.
    excitation : Fluctuation, JointStiffness, AxialBase or ``model.excitation``, optional
        Parametric excitation, proportional to cos(varpi t).
    epsilon : array_like, optional
        Its size: a number, or one axis for a chart.
    drive : mapping of function of t to float, optional
        Amplitudes of prescribed motions and of forces proportional to cos(varpi t).
    modes : int
        Number of linear modes, 1 to 40; without natural modes (gyroscopic terms, forces that follow the motion) those
        of the conservative part; with elastic-slip elements those of the system without them, with static correction
        at the elements.
    harmonics : int, optional
        Highest multiple of ``varpi / period``; the constant is included. Default: 7; with elastic-slip elements as many
        as change the motion by less than 3e-7, at most 127, fewer where more do not converge (see `error_harmonics`).
    period : int
        2: solutions of twice the period of the excitation.
    zeta : array_like, optional
        Damping ratios; default: that of the system.
    place, field : optional
        Of the amplitude, instead of the tip.

    Returns
    -------
    tuple of SteadyState, or list of tuples
        For a number, or for each entry of the axis; smallest first. With an axis of sizes a list of these, one for
        each size. Solutions that differ by a shift of time, such as the two of a principal parametric resonance, are
        both returned.

    Warns
    -----
    ConvergenceWarning
        If no solution was found at a frequency.
    AsymptoticWarning
        If slopes of a solution are too large for ``quadratures`` of squared slopes.

    Raises
    ------
    TypeError, ValueError
        If an argument is out of its range or the system is a batch.

    Examples
    --------
    A mass on a hardening spring near resonance: three solutions, of which two are stable.

    >>> from sympy import Function
    >>> import cra_sym as cra
    >>> from cra_sym.symbols import t, x
    >>> q, F = Function("q")(t), Function("F")(t)
    >>> duffing = cra.Model(0, fields=(), coordinates=[q], x=x, domain=(0, 1), t=t,
    ...                     left=q.diff(t)**2/2 - q**2/2 - q**4/4, virtual_work=[(F, q, None)])
    >>> for state in cra.steady_states(duffing.at({}, zeta=0.02), 1.3, drive={F: 0.1}, modes=1):
    ...     print(round(state.amplitude, 4), state.stable)
    0.1481 True
    0.8927 False
    1.0264 True
    """
    checks.instance("system", system, System)
    modes = checks.count("modes", modes, high=MOST_NONLINEAR_MODES)
    slipping = bool(system.model.pieces["hysteresis"])
    most = MOST if slipping else 60
    harmonics = (None if slipping else 7) if harmonics is None else checks.count("harmonics", harmonics, high=most)
    period = checks.count("period", period, high=8)
    varpi = checks.one_axis("angular_frequency", angular_frequency, "frequencies", low=1e-300, unit="rad/s")
    sizes = np.ones(()) if epsilon is None else checks.one_axis("epsilon", epsilon, "sizes", low=0.0, unit="1")
    given: dict[str, Any] = {
        "system": system,
        "modes": modes,
        "excitation": excitation,
        "epsilon": epsilon,
        "drive": drive,
    }
    given |= {"zeta": zeta, "place": place, "field": field, "period": period, "harmonics": harmonics}
    if slipping and sizes.ndim:
        raise ValueError(f"epsilon has shape {sizes.shape}: must be one number with elastic-slip elements")
    problem = SlipProblem.of(**given) if slipping else DrivenProblem.of(**given)
    flat = np.atleast_1d(varpi)
    fastest = problem.fastest
    low, high = period * fastest / _WIDE, fastest * _WIDE
    if flat.size and not (flat.min() >= low and flat.max() <= high):
        bad = flat.min() if flat.min() < low else flat.max()
        raise ValueError(
            f"angular_frequency = {bad:g} must be in [{low:.3g}, {high:.3g}], near the modes that take part"
        )
    grid = np.stack(np.broadcast_arrays(flat, np.atleast_1d(sizes)[:, None]), axis=-1)
    points = flat if slipping else grid.reshape(-1, 2)
    per_point = _by_point(answers_at(problem, points, grid.shape[:2]), points) if points.size else []
    _warn(per_point, points, problem)
    rows = [per_point[k * flat.size : (k + 1) * flat.size] for k in range(np.size(sizes))]
    found = rows if varpi.ndim else [row[0] for row in rows]
    return found if sizes.ndim else found[0]


def _warn(per_point: list[tuple[SteadyState, ...]], points: Array, problem: DrivenProblem | SlipProblem) -> None:
    """Warn of frequencies without a solution, and of solutions outside the range of the expansion."""
    none = [k for k, answers in enumerate(per_point) if not answers]
    if none:
        more = f" and {len(none) - 1} others" if len(none) > 1 else ""
        where = float(np.reshape(points[none[0]], -1)[0])
        warnings.warn(f"no periodic solution was found at {where:.6g} rad/s{more}", ConvergenceWarning, stacklevel=4)
    if isinstance(problem, DrivenProblem) and problem.arguments["system"].model.pieces["quadratures"]:
        coefficients = [state.coefficients for answers in per_point for state in answers]
        if coefficients:
            warn_of_slopes(problem.arguments["system"], problem.basis, np.array(coefficients))


def _by_point(answers: Answers, points: Array) -> list[tuple[SteadyState, ...]]:
    problem, where, unknowns, values = answers
    per_point: list[list[SteadyState]] = [[] for _ in points]
    if where.size:
        coefficients, largest = problem.coefficients(unknowns), problem.peaks(unknowns, points[where])
        stable = is_stable(problem, values)
        for k in np.lexsort((largest, where)):
            at = points[where[k]]
            varpi, epsilon = np.append(at, 1.0)[:2]
            size = None if problem.arguments["excitation"] is None else float(epsilon)
            size = problem.arguments["epsilon"] if isinstance(problem, SlipProblem) else size
            per_point[where[k]].append(
                SteadyState(
                    float(varpi),
                    size,
                    float(largest[k]),
                    bool(stable[k]),
                    values[k],
                    coefficients[k],
                    problem,
                    unknowns[k],
                    at,
                )
            )
    return [tuple(states) for states in per_point]
