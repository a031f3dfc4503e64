"""Steady states of nonlinear systems under periodic excitation: all periodic answers that are found, with stability."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any, overload

import numpy as np
from numpy.typing import ArrayLike, NDArray

from cra_sym import checks
from cra_sym.analysis.nonlinear import MOST_NONLINEAR_MODES, samples, watched
from cra_sym.analysis.periodic_forcing import Forced, forced
from cra_sym.analysis.slip_states import MOST, SlipProblem
from cra_sym.analysis.steady_seeds import seeds
from cra_sym.model.excitations import Parametric
from cra_sym.model.system import System
from cra_sym.solvers.harmonic_balance import Balance, Basis, newton, peak
from cra_sym.solvers.monodromy import multipliers

__all__ = ["SteadyState", "steady_states"]

Array = NDArray[np.float64]
Complex = NDArray[np.complex128]
_SAME = 1e-6  # of the size of two answers that are one
_WIDE = 1e4  # ratio of the frequencies of modes and excitation
_ROUNDS = 60  # in which answers are handed to neighbouring frequencies
UNSTABLE, UNSTABLE_UNDAMPED = 1e-9, 1e-6
"""Beyond the unit circle a multiplier means instability; without damping pairs on the circle split by rounding."""


@dataclass(frozen=True, eq=False)
class SteadyState(checks.ByValue):
    """A periodic answer.

    Attributes
    ----------
    angular_frequency : float
        Of the excitation, rad/s.
    amplitude : float
        Peak at the tip, or of what was chosen.
    stable : bool
        Whether no Floquet multiplier lies outside the unit circle.
    multipliers : complex ndarray, shape (2 modes,)
        Over one period of the answer, largest first.
    coefficients : ndarray, shape (modes, 2 harmonics + 1)
        Modal coordinates as sums of the constant, the cosines and then the sines of k varpi t / period. With
        elastic-slip elements the amplitude holds the statics of the modes left out besides.

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
    amplitude: float
    stable: bool
    multipliers: Complex
    coefficients: Array
    _problem: _Problem | SlipProblem
    _unknowns: Array

    @cached_property
    def error_modes(self) -> float:
        """Estimated relative error of the motion for want of modes: what three more change."""
        return self._problem.changed(3, 0, self._unknowns, self.angular_frequency)

    @cached_property
    def error_harmonics(self) -> float:
        """Estimated relative error of the motion for want of harmonics: what four more change.

        With elastic-slip elements, what twice as many change, or if these do not converge what the last doubling did.
        """
        return self._problem.changed(0, 4, self._unknowns, self.angular_frequency)

    @cached_property
    def loss(self) -> float:
        """Energy that elastic-slip elements take in a period of the answer, J."""
        return self._problem.loss(self._unknowns)

    def __repr__(self) -> str:
        word = "stable" if self.stable else "unstable"
        return f"<SteadyState at {self.angular_frequency:.6g} rad/s, amplitude {self.amplitude:.6g}, {word}>"


@dataclass(frozen=True, eq=False)
class _Problem:
    """A driven system in so many modes and harmonics."""

    arguments: dict[str, Any]
    rows: Array
    driven: Forced
    basis: Basis
    period: int

    @classmethod
    def of(cls, *, place: Any, field: Any, harmonics: int, period: int, **arguments: Any) -> _Problem:
        driven = forced(**arguments)
        number = samples(driven.equations.degree, harmonics, driven.order * period)
        rows = watched(arguments["system"], arguments["modes"], place, field)
        options = {**arguments, "place": place, "field": field, "harmonics": harmonics, "period": period}
        return cls(options, rows, driven, Basis.whole(harmonics, number), period)

    @cached_property
    def balance(self) -> Balance:
        return Balance(self.driven.equations, self.basis)

    def causes(self, varpi: Array) -> Array:
        return self.driven.causes(varpi, self.basis.phase, self.period)

    unique = False

    @property
    def fastest(self) -> float:
        return float(self.driven.equations.omega.max())

    def coefficients(self, unknowns: Array) -> Array:
        return self.balance.coefficients(unknowns)

    def seeds(self, varpi: Array, order: NDArray[np.intp]) -> tuple[NDArray[np.intp], Array, float]:
        return seeds(self.driven, self.basis, varpi, order, self.period)

    def loss(self, unknowns: Array) -> float:
        return 0.0

    def peaks(self, unknowns: Array, varpi: Array) -> Array:
        return peak(self.basis, self.rows, self.balance.coefficients(unknowns))[0]

    def settled(self, found: list[list[Array]], varpi: Array) -> tuple[_Problem, list[list[Array]]]:
        return self, found

    def solved(self, starts: Array, varpi: Array, floor: float) -> tuple[Array, NDArray[np.bool_]]:
        """Return answers from starts, and which converged."""
        return newton(self.balance, starts, varpi / self.period, self.causes(varpi), floor=floor)

    def multipliers(self, unknowns: Array, varpi: Array) -> Complex:
        coefficients = self.balance.coefficients(unknowns)

        def causes(phase: Array, rows: NDArray[np.intp]) -> Array:
            return self.driven.causes(varpi[rows], phase, self.period)

        return multipliers(
            self.driven.equations, self.basis, coefficients, varpi / self.period, causes, tolerance=1e-11
        )

    def changed(self, more_modes: int, more_harmonics: int, unknowns: Array, varpi: float) -> float:
        """Return by what share the motion changes when modes or harmonics are added: two steps of Newton's method."""
        options = dict(self.arguments)
        options["modes"] = min(options["modes"] + more_modes, options["system"].most_modes)
        options["harmonics"] += more_harmonics
        coefficients: Array = self.balance.coefficients(unknowns)[0]
        rich, n, h = _Problem.of(**options), len(coefficients), coefficients.shape[1] // 2
        x = np.zeros((options["modes"], rich.basis.size))
        x[:n, : h + 1], start = coefficients[:, : h + 1], options["harmonics"] + 1
        x[:n, start : start + h] = coefficients[:, h + 1 :]
        before = x.ravel()[None].copy()
        after, _ = newton(rich.balance, before, np.array([varpi / self.period]), rich.causes(np.array([varpi])), most=2)
        size = np.linalg.norm(before)
        return float(np.linalg.norm(after - before) / size) if size > 0 else 0.0


@overload
def steady_states(
    system: System,
    angular_frequency: float,
    *,
    excitation: Parametric | None = None,
    epsilon: float | None = None,
    drive: Mapping[Any, float] | None = None,
    modes: int = 3,
    harmonics: int | None = None,
    period: int = 1,
    zeta: ArrayLike | None = None,
    place: float | None = None,
    field: Any = None,
) -> tuple[SteadyState, ...]: ...
@overload
def steady_states(
    system: System,
    angular_frequency: ArrayLike,
    *,
    excitation: Parametric | None = None,
    epsilon: float | None = None,
    drive: Mapping[Any, float] | None = None,
    modes: int = 3,
    harmonics: int | None = None,
    period: int = 1,
    zeta: ArrayLike | None = None,
    place: float | None = None,
    field: Any = None,
) -> list[tuple[SteadyState, ...]]: ...
@checks.default_floating_point
def steady_states(
    system: System,
    angular_frequency: Any,
    *,
    excitation: Any = None,
    epsilon: Any = None,
    drive: Mapping[Any, Any] | None = None,
    modes: int = 3,
    harmonics: int | None = None,
    period: int = 1,
    zeta: Any = None,
    place: Any = None,
    field: Any = None,
) -> list[tuple[SteadyState, ...]] | tuple[SteadyState, ...]:
    """Return the periodic answers of a system that is excited parametrically, driven, or both.

    Elastic-slip elements are exact between their events. Of the answers in which one sticks, which form a continuum,
    it is the one whose slider is at rest at 0 or, if it does not hold there, as near as it does.

    Harmonic balance from many starts: rest, all answers of each mode alone with its nearest harmonic (by elimination,
    so that none of these is missed), free vibration with several phases, and the answers at neighbouring frequencies,
    handed on until no new one appears. For one mode and one harmonic the answers are complete.

    Parameters
    ----------
    system : System
        Not a batch.
    angular_frequency : array_like
        Of the excitation, rad/s: a number or one axis.
    excitation : Fluctuation, JointStiffness, AxialBase or ``model.excitation``, optional
        What of the Lagrangian fluctuates with cos(varpi t).
    epsilon : float, optional
        Its size.
    drive : mapping of function of t to float, optional
        Amplitudes of prescribed motions and of forces that go with cos(varpi t).
    modes : int
        How many linear modes take part, 1 to 40; with elastic-slip elements those of the system without them, and the
        statics of all others at the elements.
    harmonics : int, optional
        Highest multiple of ``varpi / period``; the constant is there too. Default: 7; with elastic-slip elements as
        many as bring the motion within 3e-7, at most 127, fewer where these do not converge (see `error_harmonics`).
    period : int
        2 asks for answers of twice the period of the excitation.
    zeta : array_like, optional
        Damping ratios; default: that of the system.
    place, field : optional
        Of the amplitude, instead of the tip.

    Returns
    -------
    tuple of SteadyState, or list of tuples
        For a number, or for each entry of the axis; smallest first. Answers that differ by a shift of time, such as
        the two of a principal parametric resonance, are two.

    Raises
    ------
    TypeError, ValueError
        If an argument is out of its range or the system is a batch.

    Examples
    --------
    A mass on a hardening spring near resonance: three answers, of which two are stable.

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
    given = {"system": system, "modes": modes, "excitation": excitation, "epsilon": epsilon, "drive": drive}
    given |= {"zeta": zeta, "place": place, "field": field, "period": period, "harmonics": harmonics}
    problem = SlipProblem.of(**given) if slipping else _Problem.of(**given)
    flat = np.atleast_1d(varpi)
    fastest = problem.fastest
    low, high = period * fastest / _WIDE, fastest * _WIDE
    if not flat.size:
        return []
    if not (flat.min() >= low and flat.max() <= high):
        bad = flat.min() if flat.min() < low else flat.max()
        raise ValueError(
            f"angular_frequency = {bad:g} must be in [{low:.3g}, {high:.3g}], near the modes that take part"
        )
    answers = _told(*_found(problem, flat), flat)
    return answers if varpi.ndim else answers[0]


def _found(problem: _Problem | SlipProblem, varpi: Array) -> tuple[_Problem | SlipProblem, list[list[Array]]]:
    """Return the distinct answers at every frequency, and the problem they belong to."""
    order = np.argsort(varpi, kind="stable")
    where, starts, size = problem.seeds(varpi, order)
    floor = 1e-14 * size * problem.fastest**2
    found: list[list[Array]] = [[] for _ in varpi]
    neighbour = {int(a): [int(b) for b in near] for a, near in _neighbours(order)}
    for _ in range(_ROUNDS):
        if not where.size:
            break
        solved, good = problem.solved(starts, varpi[where], floor)
        new: list[tuple[int, Array]] = []
        for at, answer in zip(where[good], solved[good], strict=True):
            if not any(np.linalg.norm(answer - other) <= _SAME * (size + np.linalg.norm(other)) for other in found[at]):
                found[at].append(answer)
                new.append((int(at), answer))
        wanted = [not (problem.unique and answers) for answers in found]
        handed = [(near, answer) for at, answer in new for near in neighbour[at] if wanted[near]]
        where = np.array([at for at, _ in handed], int)
        starts = np.array([answer for _, answer in handed])
    return problem.settled(found, varpi)


def _neighbours(order: NDArray[np.intp]) -> list[tuple[int, list[int]]]:
    last = len(order) - 1
    return [(int(order[k]), [int(order[j]) for j in (k - 1, k + 1) if 0 <= j <= last]) for k in range(len(order))]


def _told(problem: _Problem | SlipProblem, found: list[list[Array]], varpi: Array) -> list[tuple[SteadyState, ...]]:
    where = np.array([k for k, answers in enumerate(found) for _ in answers], int)
    if not where.size:
        return [() for _ in varpi]
    unknowns = np.array([answer for answers in found for answer in answers])
    coefficients = problem.coefficients(unknowns)
    largest = problem.peaks(unknowns, varpi[where])
    values = problem.multipliers(unknowns, varpi[where])
    damped = problem.driven.equations.damping.any() or bool(problem.driven.equations.forces)
    bound = 1.0 + (UNSTABLE if damped else UNSTABLE_UNDAMPED)
    told: list[list[SteadyState]] = [[] for _ in varpi]
    for k in np.lexsort((largest, where)):
        stable = bool(np.abs(values[k]).max() <= bound)
        told[where[k]].append(
            SteadyState(
                float(varpi[where[k]]), float(largest[k]), stable, values[k], coefficients[k], problem, unknowns[k]
            )
        )
    return [tuple(states) for states in told]
