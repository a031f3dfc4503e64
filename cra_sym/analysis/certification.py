"""Proved natural frequencies: enclosures in ball arithmetic with a proof that none is missed."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from fractions import Fraction
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cra_sym.analysis.eigenvalues import oscillating_frequencies
from cra_sym.checks import ByValue, count, default_floating_point, instance
from cra_sym.extras import require
from cra_sym.model.exact import BallProblem
from cra_sym.model.projection import EndParameter
from cra_sym.model.system import MOST_MODES, System
from cra_sym.solvers.ball_stiffness import BallStiffness, EnergyTerm
from cra_sym.solvers.certificates import UndecidedError, enclose, precision

__all__ = ["Certificate", "certify"]

Number = Callable[[Any], Any]


@dataclass(frozen=True, eq=False)
class Certificate(ByValue):
    """Proved enclosures of natural frequencies.

    Attributes
    ----------
    lower, upper : ndarray, shape (..., modes)
        Hz, rounded outward: the natural frequency of the system, its parameters taken as the exact values of their
        floating-point numbers, lies in between. Both are 0 for a rigid-body mode, nan where nothing is proved.
    complete : ndarray of bool, shape (...)
        Whether every enclosure of the system is proved to hold its frequency, with none between or below them. Equal
        frequencies share an enclosure.
    """

    lower: NDArray[np.float64]
    upper: NDArray[np.float64]
    complete: NDArray[np.bool_]


@default_floating_point
def certify(system: System, modes: int = 3) -> Certificate:
    """Prove the first natural frequencies of a system with coefficients that are constant along x; (23) and (30).

    The number of frequencies below a point is that of the negative eigenvalues of its dynamic stiffness, and of the
    parts that are eliminated on the way, each proved in ball arithmetic. Two such numbers for each frequency prove its
    enclosure and the completeness of the set. With gyroscopic terms and a potential energy that is positive definite,
    the frequencies are those of the complex modes, which neither grow nor decay.

    Parameters
    ----------
    system : System
        Any values, arrays too; infinite and zero stiffness are ordinary.
    modes : int
        How many, 1 to 1000, rigid-body modes included.

    Returns
    -------
    Certificate
        Enclosures at most a few units in the last place wide.

    Raises
    ------
    TypeError, ValueError
        If ``system`` is not a :class:`System`, ``modes`` not an integer from 1 to 1000, or the coefficients of the
        model vary along x or its forces are not conservative; with gyroscopic terms also if there are dampers, or the
        potential energy is not positive definite.
    MissingExtraError
        If python-flint is not installed (extra ``certify``).

    Examples
    --------
    >>> import cra_sym as cra
    >>> proof = cra.certify(cra.Arm.nominal())
    >>> bool(proof.complete), bool((proof.upper - proof.lower < 1e-12).all())
    (True, True)
    >>> ((proof.lower + proof.upper) / 2).round(4)
    array([ 2.4277, 15.2161, 42.6099])
    """
    instance("system", system, System)
    modes = count("modes", modes, high=MOST_MODES)
    flint = require("flint", "certify")
    problem: BallProblem = system.numerics("ball_problem")
    held: dict[str, EndParameter] = system.numerics("stiffnesses")
    guesses = oscillating_frequencies(system, modes) / (2 * math.pi)
    values = np.broadcast_arrays(*system.parameters, np.empty(system.shape))[:-1]
    names = tuple(system.values)
    order = system.numerics("names")
    assert set(order) == set(names)
    lower, upper = np.full((2, *guesses.shape), np.nan)
    complete = np.zeros(system.shape, dtype=bool)
    for index in np.ndindex(system.shape):
        given = dict(zip(order, (float(value[index]) for value in values), strict=True))
        counted = _counted(flint, problem, held, given)
        if problem.gyroscopic and (counted.zeros or counted.count(flint.arb(0))):
            raise ValueError(
                "system: its potential energy is not positive definite (it buckles, or moves as a rigid body), and "
                "motions with gyroscopic terms are then not counted; use eigenvalues and count_eigenvalues"
            )
        try:
            ends = enclose(flint, counted, guesses[index])
        except UndecidedError:
            continue
        with precision(flint, 128):
            lower[index] = [_outward(low, -np.inf) for low, _ in ends]
            upper[index] = [_outward(high, np.inf) for _, high in ends]
        complete[index] = True
    return Certificate(lower, upper, complete)


def _counted(
    flint: Any, problem: BallProblem, held: dict[str, EndParameter], values: dict[str, float]
) -> BallStiffness:
    """Return the problem of one set of values in ball arithmetic; infinite stiffnesses hold their displacement."""
    n, m = problem.displacements, problem.coordinates
    size = 2 * n + m
    fixed = []
    for name in (name for name, value in values.items() if math.isinf(value)):
        if name not in held:
            raise ValueError(
                f"{name} = inf: only the stiffness of an end may be infinite ({', '.join(held) or 'none'})"
            )
        end, place, _ = held[name]
        fixed.append(place if end == 0 else n + m + place)
    exact = [0.0 if math.isinf(value) else value for value in values.values()]

    def evaluated(kernel: Any, *first: Any) -> Sequence[Any]:
        found: Sequence[Any] = kernel(flint.arb, flint.arb.pi(), *first, *map(flint.arb, exact))
        return found

    def matrix(kernel: Any, columns: int) -> Callable[[Any], list[list[Any]]]:
        def rows(z: Any) -> list[list[Any]]:
            entries = evaluated(kernel, z)
            return [list(entries[i : i + columns]) for i in range(0, len(entries), columns)]

        return rows

    def terms() -> list[EnergyTerm]:
        entries = evaluated(problem.energy)
        gaps = [tuple(problem.orders[f] - o for f, o in zip(*jet, strict=True)) for jet in problem.jets]
        return [
            EnergyTerm(fields, (gap[0], gap[1]), *entries[3 * k : 3 * k + 3])
            for k, ((fields, _), gap) in enumerate(zip(problem.jets, gaps, strict=True))
        ]

    @cache
    def columns(precision: int) -> list[list[Any]]:
        return _free_columns(evaluated(problem.free), size, fixed)

    return BallStiffness(
        flint,
        matrix(problem.system, 2 * (n + m)),
        matrix(problem.boundary, size),
        lambda: evaluated(problem.geometry)[0],
        n,
        m,
        lambda: columns(flint.ctx.prec),
        terms,
        _rigid_motions(problem, exact, size, fixed),
        problem.gyroscopic,
    )


def _free_columns(entries: Sequence[Any], size: int, fixed: Sequence[int]) -> list[list[Any]]:
    """Return the columns of free motions in which the fixed coordinates are zero."""
    number = len(entries) // size
    columns = [[entries[i * number + j] for i in range(size)] for j in range(number)]
    for place in fixed:
        moving = [column for column in columns if column[place] != 0]
        if len(moving) > 1:
            raise ValueError("certification needs an infinite stiffness to act on one free displacement")
        columns = [column for column in columns if column[place] == 0]
    return columns


def _rigid_motions(problem: BallProblem, values: Sequence[float], size: int, fixed: Sequence[int]) -> int:
    """Return the number of rigid-body motions: polynomials of first degree without strain, by an exact rank."""

    def evaluated(kernel: Any, *first: Any) -> list[Fraction]:
        return list(kernel(Fraction, Fraction(0), *first, *map(Fraction, values)))

    n, m, fields = problem.displacements, problem.coordinates, len(problem.orders)
    unknowns = 2 * fields + m  # value at the left end and slope of each field, then coordinates
    length, _ = evaluated(problem.geometry)

    def jet(field: int, order: int) -> list[tuple[int, int]]:
        """Unknowns and the power of x they are multiplied by."""
        return [[(2 * field, 0), (2 * field + 1, 1)], [(2 * field + 1, 0)]][order] if order < 2 else []

    energy = [[Fraction(0)] * unknowns for _ in range(unknowns)]
    entries = evaluated(problem.energy)
    for k, ((p, q), (i, j)) in enumerate(problem.jets):
        for first, power in jet(p, i):
            for second, other in jet(q, j):
                degree = power + other + 1
                energy[first][second] += Fraction(entries[3 * k]) * length**degree / degree
    ends = [[Fraction(0)] * unknowns for _ in range(size)]  # displacements of the left end, w, of the right end
    place = 0
    for field, order in enumerate(problem.orders):
        for derivative in range(order):
            for unknown, power in jet(field, derivative):
                ends[place][unknown] += Fraction(int(power == 0))
                ends[n + m + place][unknown] += length**power
            place += 1
    for number in range(m):
        ends[n + number][2 * fields + number] = Fraction(1)
    boundary = evaluated(problem.boundary, Fraction(0))
    springs = [[boundary[i * size + j] for j in range(size)] for i in range(size)]
    moved = [
        [
            energy[a][b]
            + sum((ends[i][a] * springs[i][j] * ends[j][b] for i in range(size) for j in range(size)), Fraction(0))
            for b in range(unknowns)
        ]
        for a in range(unknowns)
    ]
    columns = _free_columns(evaluated(problem.free), size, fixed)
    rows = [row + [Fraction(0)] * len(columns) for row in moved]
    rows += [ends[i] + [-column[i] for column in columns] for i in range(size)]
    return unknowns + len(columns) - _rank(rows)


def _rank(rows: list[list[Fraction]]) -> int:
    """Return the rank of a matrix of fractions."""
    rank = 0
    for column in range(len(rows[0]) if rows else 0):
        pivot = next((i for i in range(rank, len(rows)) if rows[i][column] != 0), None)
        if pivot is None:
            continue
        rows[rank], rows[pivot] = rows[pivot], rows[rank]
        for i in range(rank + 1, len(rows)):
            factor = rows[i][column] / rows[rank][column]
            if factor:
                rows[i] = [a - factor * b for a, b in zip(rows[i], rows[rank], strict=True)]
        rank += 1
    return rank


def _outward(ball: Any, towards: float) -> float:
    """Return the nearest floating-point number outside the ball on one side; exact zero stays zero."""
    if ball == 0:
        return 0.0
    edge = ball.lower() if towards < 0 else ball.upper()
    number = float(edge)
    while not (type(ball)(number) <= edge if towards < 0 else type(ball)(number) >= edge):
        number = float(np.nextafter(number, towards))
    return number
