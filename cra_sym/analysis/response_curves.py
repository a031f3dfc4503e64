"""Frequency-response curves of nonlinear systems: steady states followed over the frequency, through folds."""

from __future__ import annotations

import itertools
import warnings
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from cra_sym import checks
from cra_sym.analysis.driven_problem import DrivenProblem
from cra_sym.analysis.nonlinear import MOST_NONLINEAR_MODES, ConvergenceWarning, warn_of_slopes
from cra_sym.analysis.steady_levels import shifted
from cra_sym.analysis.steady_search import answers_at, is_stable
from cra_sym.model.excitations import Parametric
from cra_sym.model.system import System
from cra_sym.solvers.branching import beside
from cra_sym.solvers.continuation import Point, at_value, follow, passings, started
from cra_sym.solvers.driven_curve import Driven, turning

if TYPE_CHECKING:
    from sympy import Expr
    from sympy.core.function import AppliedUndef

__all__ = ["ResponseCurve", "response_curves"]

Array = NDArray[np.float64]
Complex = NDArray[np.complex128]
_STARTS = 5  # frequencies at which all solutions are searched for
_MOST_CURVES, _MOST_POINTS = 40, 5000
_SAME = 1e-5  # relative distance below which two solutions are the same
_STEP = 0.25  # share of the interval with the same norm as a change as large as the motion


@dataclass(frozen=True, eq=False)
class ResponseCurve:
    """Steady states along one curve over the excitation frequency.

    Attributes
    ----------
    angular_frequency, amplitude : ndarray, shape (points,)
        rad/s, and the peak at the tip, or of the chosen displacement.
    stable : ndarray of bool, shape (points,)
    multipliers : complex ndarray, shape (points, 2 modes)
        Floquet multipliers over one period of the motion, largest first.
    coefficients : ndarray, shape (points, modes, 2 harmonics + 1)
        As of :class:`cra_sym.SteadyState`.
    folds, branch_points : ndarray
        Angular frequencies at which the curve turns back, and at which another one crosses it.
    closed : bool
        Whether the last point is the first one.

    Examples
    --------
    What :func:`cra_sym.response_curves` returns; of a linear mass:

    >>> from sympy import Function
    >>> import cra_sym as cra
    >>> from cra_sym.symbols import t, x
    >>> q, F = Function("q")(t), Function("F")(t)
    >>> mass = cra.Model(0, fields=(), coordinates=[q], x=x, domain=(0, 1), t=t, left=q.diff(t)**2/2 - q**2/2,
    ...                  virtual_work=[(F, q, None)])
    >>> (line,) = cra.response_curves(mass.at({}, zeta=0.1), (0.5, 2.0), drive={F: 0.1}, modes=1, harmonics=1)
    >>> line.folds.size, line.closed, line.amplitude[0].round(4)
    (0, False, np.float64(0.1322))
    """

    angular_frequency: Array
    amplitude: Array
    stable: NDArray[np.bool_]
    multipliers: Complex
    coefficients: Array
    folds: Array
    branch_points: Array
    closed: bool


@checks.default_floating_point
def response_curves(
    system: System,
    between: Sequence[float] | Array,
    *,
    excitation: Parametric | None = None,
    epsilon: float | None = None,
    drive: Mapping[Expr, float] | None = None,
    modes: int = 3,
    harmonics: int = 7,
    period: int = 1,
    zeta: ArrayLike | None = None,
    points: int = 600,
    place: float | None = None,
    field: AppliedUndef | None = None,
) -> tuple[ResponseCurve, ...]:
    """Continue the steady states of a system in the excitation frequency, through folds and onto all branches.

    The solutions of :func:`cra_sym.steady_states` at five frequencies of the interval are continued by arclength in
    both directions until the curve leaves the interval or closes; where another curve crosses, it is followed too. Of
    curves that differ by a shift in time, one is returned. A branch point is located to 1e-5 of the interval.

    Parameters
    ----------
    system : System
        Not a batch, without elastic-slip elements.
    between : pair of float
        Lowest and highest angular frequency of the excitation, rad/s.
    excitation, epsilon, drive, modes, zeta, place, field : optional
        As in :func:`cra_sym.steady_states`; ``epsilon`` is one number.
    harmonics : int
        Highest multiple of ``varpi / period``, 1 to 60.
    period : int
        2: solutions of twice the period of the excitation.
    points : int
        Largest number of points of one curve.

    Returns
    -------
    tuple of ResponseCurve
        The one with the smallest amplitude at the lowest frequency first.

    Warns
    -----
    ConvergenceWarning
        If a curve has more points, or could not be followed to its end.
    AsymptoticWarning
        As of :func:`cra_sym.steady_states`.

    Raises
    ------
    TypeError, ValueError
        If an argument is out of its range, or the system is a batch or has elastic-slip elements.

    Examples
    --------
    A mass on a hardening spring: one curve with two folds.

    >>> from sympy import Function
    >>> import cra_sym as cra
    >>> from cra_sym.symbols import t, x
    >>> q, F = Function("q")(t), Function("F")(t)
    >>> duffing = cra.Model(0, fields=(), coordinates=[q], x=x, domain=(0, 1), t=t,
    ...                     left=q.diff(t)**2/2 - q**2/2 - q**4/4, virtual_work=[(F, q, None)])
    >>> (curve,) = cra.response_curves(duffing.at({}, zeta=0.05), (0.6, 1.8), drive={F: 0.1}, modes=1, harmonics=3)
    >>> curve.folds.round(3), round(curve.amplitude.max(), 3), curve.stable.all()
    (array([1.229, 1.158]), np.float64(0.826), np.False_)
    """
    checks.instance("system", system, System)
    if system.model.pieces["hysteresis"]:
        raise ValueError("system: must be without elastic-slip elements, for which there is steady_states")
    modes = checks.count("modes", modes, high=MOST_NONLINEAR_MODES)
    harmonics, period = checks.count("harmonics", harmonics, high=60), checks.count("period", period, high=8)
    points = checks.count("points", points, low=2, high=_MOST_POINTS)
    low, high = _interval(between)
    size = 1.0 if epsilon is None else checks.one_number("epsilon", epsilon, low=0.0, unit="1")
    problem = DrivenProblem.of(
        system=system,
        modes=modes,
        excitation=excitation,
        epsilon=epsilon,
        drive=drive,
        zeta=zeta,
        place=place,
        field=field,
        period=period,
        harmonics=harmonics,
    )
    lines = _Curves(problem, (low, high), size, points).all()
    curves = [_response_curve(problem, size, line) for line in lines]
    if curves:
        warn_of_slopes(system, problem.basis, np.concatenate([curve.coefficients for curve in curves]), 4)
    if any(line.broken for line in lines):
        text = f"a curve was not followed to its end, in {points} points or for want of convergence"
        warnings.warn(text, ConvergenceWarning, stacklevel=3)
    return tuple(sorted(curves, key=lambda curve: (curve.angular_frequency.min(), curve.amplitude[0])))


def _interval(between: Any) -> tuple[float, float]:
    ends = checks.real_array("between", between, low=1e-300, unit="rad/s")
    if ends.shape != (2,) or not ends[0] < ends[1]:
        raise ValueError(f"between = {between}: must be two angular frequencies, the lower one first")
    return float(ends[0]), float(ends[1])


@dataclass(frozen=True, eq=False)
class _Line:
    """Points of one curve in order, and the ends at which continuation failed."""

    points: list[Point]
    folds: list[float]
    closed: bool
    broken: bool


class _Curves:
    """The curves followed so far, and the branch points still to be treated."""

    def __init__(self, problem: DrivenProblem, between: tuple[float, float], size: float, most: int) -> None:
        self._problem, self._between, self._size, self._most = problem, between, size, most
        self._lines: list[_Line] = []
        grid = np.linspace(*between, _STARTS)
        self._at = np.stack([grid, np.full(_STARTS, size)], axis=1)
        self._answers = answers_at(problem, self._at, (1, _STARTS))
        known = np.linalg.norm(self._answers.unknowns.reshape(len(self._answers.where), -1), axis=1)
        self._typical = typical = float(np.median(known[known > 0])) if (known > 0).any() else 1.0
        energetic = 0.05 * typical * float(np.hypot(problem.driven.equations.omega, grid[0] / problem.period).min())
        moves = any(wave.power for wave in problem.driven.waves)
        width = between[1] - between[0]
        self._curve = Driven(problem.balance, self._forcing, energetic, _STEP * width, moves)

    def _forcing(self, varpi: float) -> tuple[float, float, Array]:
        at = np.array([[varpi, self._size]])
        return varpi / self._problem.period, 1.0 / self._problem.period, self._problem.causes(at)

    def all(self) -> list[_Line]:
        """Return all curves."""
        for at, unknowns in zip(self._answers.where, self._answers.unknowns, strict=True):
            frequency = float(self._at[at, 0])
            if not self._known(unknowns, frequency):
                self._add(unknowns, frequency)
        done = 0
        while done < len(self._lines) < _MOST_CURVES:
            for point in [p for p in self._lines[done].points if p.crossing]:
                for other in beside(self._curve, point):
                    if not self._known(other.unknowns, other.frequency):
                        self._lines.append(self._followed(other, 0))
            done += 1
        return self._lines

    def _add(self, unknowns: Array, frequency: float) -> None:
        """Follow a curve in both directions from a solution."""
        forward = started(self._curve, unknowns, frequency)
        if forward is None:
            return
        first = self._followed(forward, 0)
        if first.closed:
            self._lines.append(first)
            return
        backward = started(self._curve, unknowns, frequency, -1.0)
        second = self._followed(backward, len(first.points)) if backward is not None else first
        turned = [_reversed(p, q.step) for p, q in zip(second.points, [*second.points[1:], forward], strict=True)]
        folds = [*second.folds[::-1], *first.folds]
        self._lines.append(
            _Line([*turned[:0:-1], *_joined(turned, first)], folds, False, first.broken or second.broken)
        )

    def _followed(self, start: Point, already: int) -> _Line:
        """Follow a curve in one direction."""
        low, high = self._between
        found, folds = [start], list[float]()
        for after in itertools.islice(follow(self._curve, start), 1, self._most - already):
            before = found[-1]
            if not low <= after.frequency <= high:
                last = self._at_end(before, after, low if after.frequency < low else high)
                return _Line(found + ([] if last is None else [last]), folds, False, False)
            found.append(after)
            if _turns(before, after):
                turn = turning(self._curve, before, after)
                folds.append(before.frequency if turn is None else turn.frequency)
            if self._closes(found):
                return _Line([*found, start], folds, True, False)
        return _Line(found, folds, False, True)

    def _at_end(self, before: Point, after: Point, bound: float) -> Point | None:
        share = passings(before, after, bound)
        if not share.size:
            return None
        unknowns = at_value(self._curve, before, after, float(share[0]), bound)
        return None if unknowns is None else started(self._curve, unknowns, bound)

    def _closes(self, found: list[Point]) -> bool:
        """Tell whether the last step passed the first point."""
        if len(found) < 8:
            return False
        start, before, after = found[0], found[-2], found[-1]
        metric = self._curve.metric(start.unknowns, start.frequency)
        ahead, behind = (float((p.vector - start.vector) @ (start.tangent * metric**2)) for p in (after, before))
        near = np.linalg.norm((after.vector - start.vector) * metric) < 2 * after.step
        return bool(near and ahead >= 0 >= behind)

    def _known(self, unknowns: Array, frequency: float) -> bool:
        """Tell whether a solution, or a time-shifted one, lies on a curve that was followed."""
        alike = [unknowns, *(copy[0] for copy in shifted(self._problem, unknowns[None]))]
        same = _SAME * float(np.linalg.norm(unknowns) + self._typical)
        for line in self._lines:
            for before, after in itertools.pairwise(line.points):
                if (before.frequency - frequency) * (after.frequency - frequency) > 0 and not _turns(before, after):
                    continue
                apart = np.linalg.norm(after.unknowns - before.unknowns)
                if min(np.linalg.norm(before.unknowns - x) for x in alike) > 3 * apart + same:
                    continue
                for share in passings(before, after, frequency):
                    found = at_value(self._curve, before, after, float(share), frequency)
                    if found is not None and min(np.linalg.norm(found - x) for x in alike) <= same:
                        return True
        return False


def _turns(before: Point, after: Point) -> bool:
    return bool((before.tangent[-1] > 0) != (after.tangent[-1] > 0))


def _reversed(point: Point, step: float) -> Point:
    return Point(point.unknowns, point.frequency, -point.tangent, point.mark, step, point.crossing)


def _joined(turned: list[Point], first: _Line) -> list[Point]:
    """Return the points of the second half; the step to its first point is taken from the other half."""
    start = first.points[0]
    step = turned[0].step if len(turned) > 1 else 0.0
    return [Point(start.unknowns, start.frequency, start.tangent, start.mark, step), *first.points[1:]]


def _response_curve(problem: DrivenProblem, size: float, line: _Line) -> ResponseCurve:
    unknowns = np.array([point.unknowns for point in line.points])
    frequency = np.array([point.frequency for point in line.points])
    at = np.stack([frequency, np.full(len(frequency), size)], axis=1)
    values = problem.multipliers(unknowns, at)
    crossed = np.array([point.frequency for point in line.points if point.crossing])
    near = 1e-4 * np.ptp(frequency)  # at a branch point a curve may turn too
    folds = [w for w in line.folds if not (np.abs(crossed - w) <= near).any()]
    return ResponseCurve(
        frequency,
        problem.peaks(unknowns, at),
        is_stable(problem, values),
        values,
        problem.coefficients(unknowns),
        np.array(folds),
        crossed,
        line.closed,
    )
