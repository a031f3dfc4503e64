"""Search for all periodic solutions: many starts, and propagation of solutions to neighbouring points."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from cra_sym.analysis.driven_problem import DrivenProblem
from cra_sym.analysis.slip_states import SlipProblem
from cra_sym.analysis.steady_levels import mirrored, settling, shifted, traced
from cra_sym.analysis.steady_seeds import sampled

__all__ = ["Answers", "answers_at", "is_stable"]

Array = NDArray[np.float64]
Complex = NDArray[np.complex128]
Problem = DrivenProblem | SlipProblem
_SAME = 1e-6  # relative distance below which two solutions are the same
_ALIKE = 0.05  # relative distance of solutions at neighbouring points that belong together
_ROUNDS = 60  # rounds in which solutions are passed to neighbouring points
_TRACED, _FEW = 5, 3  # points at which curves over the level are followed from rest, and from solutions too if so few
_LONELY, _TRIES = 3, 3  # points without a stable solution at which motions are integrated; rounds for few points
UNSTABLE, UNSTABLE_UNDAMPED = 1e-9, 1e-6
"""Largest distance of a multiplier outside the unit circle of a stable motion; without damping pairs split by
rounding."""


class Answers(NamedTuple):
    """Solutions: the point of each (solutions,), unknowns (solutions, size), multipliers (solutions, 2 modes)."""

    problem: Problem
    where: NDArray[np.intp]
    unknowns: Array
    multipliers: Complex


def is_stable(problem: Problem, multipliers: Complex) -> NDArray[np.bool_]:
    """Return whether no multiplier is outside the unit circle, shape (solutions,)."""
    bound = 1.0 + (UNSTABLE if _damped(problem) else UNSTABLE_UNDAMPED)
    return np.asarray(np.abs(multipliers).max(axis=1, initial=0.0) <= bound)


def _damped(problem: Problem) -> bool:
    equations = problem.driven.equations
    resistance = equations.damping + equations.damping.T  # without gyroscopic terms
    return bool(resistance.any()) or any(term.velocities for term in equations.forces)


def answers_at(problem: Problem, points: Array, shape: tuple[int, int]) -> Answers:
    """Return the distinct solutions at every point.

    Parameters
    ----------
    problem : DrivenProblem or SlipProblem
    points : ndarray
        Pairs of frequency and size of the excitation, or frequencies alone of a problem that slips.
    shape : tuple of int
        Sizes and frequencies; the points are all pairs in this order.
    """
    order = _order(points, shape)
    where, starts, size = problem.seeds(points, order.ravel())
    search = _SteadySearch(problem, points, order, size)
    search.run(where, starts)
    if isinstance(problem, DrivenProblem):
        _search_on(problem, points, order.ravel(), size, search)
        return search.answers()
    problem, found = problem.settled(search.found, points)
    where = np.array([k for k, answers in enumerate(found) for _ in answers], int)
    unknowns = np.array([answer for answers in found for answer in answers])
    values = problem.multipliers(unknowns, points[where]) if where.size else np.zeros((0, 0), complex)
    return Answers(problem, where, unknowns, values)


def _search_on(
    problem: DrivenProblem, points: Array, order: NDArray[np.intp], size: float, search: _SteadySearch
) -> None:
    """Search for solutions that are not reached from the first starts and from neighbours."""
    if problem.driven.equations.degree == 1:
        return
    for at in [] if problem.driven.rests else sampled(points, order, _TRACED):
        search.run_at(at, traced(problem, points[at], size))
    for at in order if len(points) <= _FEW else []:
        known: list[Array] = []
        for answer in list(search.found[at]):
            if answer.any() and not _among(answer, known, size):
                known += list(traced(problem, points[at], size, answer))
        search.run_at(at, np.array(known).reshape(-1, problem.balance.size))
    tries = _TRIES if len(points) <= _FEW else 1
    for _ in range(tries if _damped(problem) else 0):
        lonely = search.without_stable()
        if not lonely:
            break
        chosen = [lonely[k] for k in np.unique(np.linspace(0, len(lonely) - 1, _LONELY).round().astype(int))]
        starts = [np.array(search.found[at] or [np.zeros(problem.balance.size)]) for at in chosen]
        where = np.concatenate([np.full(len(s), at) for at, s in zip(chosen, starts, strict=True)])
        before = [len(search.found[at]) for at in chosen]
        search.run(where, settling(problem, points[where], np.concatenate(starts), size))
        if before == [len(search.found[at]) for at in chosen]:
            break


def _among(answer: Array, known: list[Array], size: float) -> bool:
    """Tell whether a solution is one of the known ones."""
    return bool(known) and bool((_apart(answer, known) <= (_SAME * (size + np.sqrt(answer @ answer))) ** 2).any())


def _alike(answer: Array, known: list[Array]) -> int:
    """Return the number of known solutions close to a given one."""
    return int((_apart(answer, known) <= _ALIKE**2 * (answer @ answer)).sum()) if known else 0


def _apart(answer: Array, known: list[Array]) -> Array:
    """Return the squared distances of known solutions from a given one."""
    apart = np.array(known) - answer
    return np.asarray(np.einsum("ij,ij->i", apart, apart))


def _order(points: Array, shape: tuple[int, int]) -> NDArray[np.intp]:
    """Return the numbers of the points in ascending frequency (columns) and size (rows)."""
    grid = points.reshape(*shape, -1)
    rows = np.argsort(grid[:, 0, 1], kind="stable") if grid.shape[2] > 1 else np.arange(1)
    columns = np.argsort(grid[0, :, 0], kind="stable")
    return np.arange(len(points)).reshape(shape)[np.ix_(rows, columns)]


class _SteadySearch:
    """Solutions found so far."""

    def __init__(self, problem: Problem, points: Array, order: NDArray[np.intp], size: float) -> None:
        self._problem, self._points, self._size = problem, points, size
        self._floor = 1e-14 * size * problem.fastest**2
        self.found: list[list[Array]] = [[] for _ in points]
        self._first: list[list[int]] = [[] for _ in points]  # index of the solution of which each is a time shift
        self._values: list[list[Complex]] = [[] for _ in points]
        self._near: list[list[int]] = [[] for _ in points]
        for lines in (order, order.T):
            for one, other in zip(lines[:, :-1].ravel(), lines[:, 1:].ravel(), strict=True):
                self._near[one].append(int(other))
                self._near[other].append(int(one))

    def run(self, where: NDArray[np.intp], starts: Array) -> None:
        """Solve from starts, and pass new solutions on to neighbours until there are none."""
        for turn in range(_ROUNDS):
            if not len(where):
                return
            solved, good = self._problem.solved(starts, self._points[where], self._floor)
            new = [(int(at), x) for at, x in zip(where[good], solved[good], strict=True) if self._is_new(int(at), x)]
            new += self._mirrored(new) if turn == 0 else []
            handed = self._handed(new)
            where = np.array([at for at, _ in handed], int)
            starts = np.array([answer for _, answer in handed])

    def _handed(self, new: list[tuple[int, Array]]) -> list[tuple[int, Array]]:
        """Return new solutions as starts for neighbours that have fewer similar ones."""
        given: dict[int, list[Array]] = {}
        found = []
        for at, answer in new:
            own = _alike(answer, self.found[at])
            for near in self._near[at]:
                known = self.found[near]
                if self._problem.unique and known:
                    continue
                missing = own - _alike(answer, known)
                if missing > 0 and _alike(answer, given.setdefault(near, [])) < missing:
                    given[near].append(answer)
                    found.append((near, answer))
        return found

    def run_at(self, at: int, starts: Array) -> None:
        """Solve from starts at one point, and pass new solutions on."""
        self.run(np.full(len(starts), at), starts)

    def _mirrored(self, new: list[tuple[int, Array]]) -> list[tuple[int, Array]]:
        """Return the solutions of opposite sign that were not known."""
        if not new or not isinstance(self._problem, DrivenProblem):
            return []
        where, starts = np.array([at for at, _ in new]), mirrored(self._problem, np.array([x for _, x in new]))
        good = self._problem.solved(starts, self._points[where], self._floor, most=1)[1]
        return [(int(at), x) for at, x in zip(where[good], starts[good], strict=True) if self._is_new(int(at), x)]

    def _is_new(self, at: int, answer: Array) -> bool:
        """Store a solution, and its time shifts, if it is new."""
        if _among(answer, self.found[at], self._size):
            return False
        self._first[at].append(len(self.found[at]))
        self.found[at].append(answer)
        if isinstance(self._problem, DrivenProblem):
            for other in shifted(self._problem, answer[None]):
                if not _among(other[0], self.found[at], self._size):
                    self._first[at].append(self._first[at][-1])
                    self.found[at].append(other[0])
        return True

    def _judge(self) -> None:
        """Compute the missing multipliers; solutions that differ by a time shift have the same."""
        open_ = [
            (at, k)
            for at, first in enumerate(self._first)
            for k in range(len(self._values[at]), len(first))
            if first[k] == k
        ]
        if open_:
            where = np.array([at for at, _ in open_])
            unknowns = np.array([self.found[at][k] for at, k in open_])
            multipliers = dict(zip(open_, self._problem.multipliers(unknowns, self._points[where]), strict=True))
            for at, first in enumerate(self._first):
                for k in range(len(self._values[at]), len(first)):
                    self._values[at].append(multipliers[at, k] if first[k] == k else self._values[at][first[k]])

    def without_stable(self) -> list[int]:
        """Return the points at which no stable solution is known."""
        self._judge()
        return [
            k for k, values in enumerate(self._values) if not any(is_stable(self._problem, v[None]) for v in values)
        ]

    def answers(self) -> Answers:
        """Return all solutions found."""
        self._judge()
        where = np.array([k for k, known in enumerate(self.found) for _ in known], int)
        unknowns = np.array([x for known in self.found for x in known])
        values = np.array([value for known in self._values for value in known])
        return Answers(self._problem, where, unknowns, values)
