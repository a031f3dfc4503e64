"""Complete spectra of uniform problems with up to three waves a section: counts isolate roots, interpolation finds.

Formulas: `waves_kernel`. The determinant F is real below, at and above every cut-off and has the sign of (-1)**N, where
N is the number of roots below z. N is exact and costs a few evaluations of F at the same z, so no root is missed or
repeated. A root alone in its bracket is found by inverse quadratic interpolation, or bisection (Chandrupatla,
Advances in Engineering Software 28, 1997).
"""

from __future__ import annotations

from collections.abc import Callable
from importlib.resources import files
from typing import Any

import numpy as np

from .waves_count import Determinant, Functions, direct, formulas, kept
from .waves_kernel import rising, turning, wave
from .waves_problem import Floats, Integers, UniformProblem
from .waves_static import negative_energy, rigid_motions
from .waves_structure import Structure

__all__ = [
    "QUICK", "Counts", "Functions", "Search", "Structure", "UniformProblem", "determinant", "formulas", "kept",
    "lowest_waves", "template",
]  # fmt: skip

_BLOCK = 8192  # rows whose temporaries stay in the processor's cache
_COMPILED_BLOCK = 8192
_SHRINK = 0.8
_MOST_STEPS = 400
_EPS = float(np.finfo(float).eps)


QUICK: dict[str, Callable[..., Any]] = {
    "_wave": lambda k, i, m: wave(m),
    "_rising": lambda k, i, m: rising(m),
    "_turning": lambda k, i, m: turning(m),
}
"""Replacements of functions of `formulas` for arrays of lanes."""

Search = Callable[[Floats, Integers, Floats, Integers], int]
"""Compiled version for one structure: the entry `lowest_waves` of `template` compiled by `cra_sym.kernels.compiled`."""

Counts = Callable[[Integers, Floats, Floats, Floats], None]
"""The entry `counts` of the same."""


def template(structure: Structure, known: tuple[int | None, ...] | None = None) -> str:
    """Return the text of the compiled version: the formulas, and the search over blocks of lanes.

    Parameters
    ----------
    structure : Structure
    known : tuple of (0, 1 or None), optional
        Those of the problems.
    """
    search = files("cra_sym.solvers").joinpath("waves_lanes.py").read_text(encoding="utf-8")
    most = f"_MOST_ZEROS = {structure.moving - structure.n}"
    return "\n\n".join([search, most, formulas(structure, known or (None,) * structure.coefficients, ("any", "mixed"))])


def lowest_waves(
    problem: UniformProblem, modes: int, search: Search | None = None, functions: Functions | None = None
) -> Floats:
    """Return the ``modes`` smallest squared frequencies of every row: ascending, complete, double roots twice.

    Parameters
    ----------
    problem : UniformProblem
    modes : int
    search : callable, optional
        The compiled version; without it NumPy does the same steps.
    functions : mapping of str to callable, optional
        What the text of `formulas` defines for NumPy; with it the steps take a third of the time.

    Returns
    -------
    ndarray, shape (rows, modes)
        omega^2 in rad^2/s^2; rigid-body motions are exactly zero.

    Raises
    ------
    ValueError
        If a structure has buckled, has fewer natural frequencies than requested, or several that are almost zero.

    Examples
    --------
    A hinged beam with E I = rho A = L = 1: ``E = (v, M)``, ``O = (V, theta)``.

    >>> import numpy as np
    >>> a, b = np.zeros((2, 1, 2, 2)), np.zeros((2, 1, 2, 2))
    >>> a[0, 0], a[1, 0] = [[0, 0], [0, 1]], [[-1, 0], [0, 0]]  # V' = -z v, theta' = M
    >>> b[0, 0] = [[0, 1], [-1, 0]]  # v' = theta, M' = -V
    >>> hinges = np.array([[np.inf, 0.0, np.inf, 0.0]])
    >>> beam = UniformProblem(np.ones(1), a, b, hinges, np.zeros((1, 4)))
    >>> np.sqrt(np.sqrt(lowest_waves(beam, 3))) / np.pi
    array([[1., 2., 3.]])
    """
    result = np.empty((len(problem.length), modes))
    size = _COMPILED_BLOCK if search else _BLOCK
    for start in range(0, len(result), size):
        part = slice(start, start + size)
        with np.errstate(all="ignore"):
            function = determinant(problem.take(part), functions)
            if search is None:
                result[part] = _block(function, modes)
            else:
                _searched(search, function, result[part])
            _check_range(function, result[part])
    return result


def _check_range(function: Determinant, squares: Floats) -> None:
    """Raise an error for several frequencies close to zero: the determinant contains their product and underflows."""
    least = function.branch(1.0)[:, None]
    least = np.where((least > 0.0) & (least < np.inf), least, 1.0)
    if (squares[:, :1] > 1e-90 * least).all():
        return
    positive = (squares > 0.0) | (np.arange(squares.shape[1]) >= function.zeros[:, None])
    for together in range(2, squares.shape[1] + 1):
        share = 10.0 ** -(285 // together // 5 * 5)
        small = squares < share * least
        if ((small.sum(axis=1) >= together) & (small & positive).any(axis=1)).any():
            raise ValueError(f"values: several motions have less than {share:g} of the line's own omega^2; take 0")


def _searched(search: Search, function: Determinant, result: Floats) -> None:
    """Fill in a part of the result by the compiled version."""
    code = search(result, np.zeros(2, dtype=np.int64), function.k, function.zeros)
    if code < 0:
        raise ArithmeticError("the search for natural frequencies did not converge")
    if code > 0:
        result[...] = _block(function, result.shape[1])


def _block(function: Determinant, modes: int) -> Floats:
    number, row = (index.ravel() for index in np.indices((modes, len(function.zeros))))
    z = np.zeros(number.size)
    wanted = np.flatnonzero(number >= function.zeros[row])
    z[wanted] = _roots(function, number[wanted], row[wanted], _brackets(function, modes, number[wanted], row[wanted]))
    return np.sort(z.reshape(modes, -1).T, axis=1)


def determinant(problem: UniformProblem, functions: Functions | None = None) -> Determinant:
    """Return the determinant of a problem; refuse a structure that has buckled."""
    known = problem.known or (None,) * problem.structure.coefficients
    functions = functions or direct(problem.structure, known)
    function = Determinant(problem.coefficients(), problem.structure, functions, rigid_motions(problem))
    unsafe = np.flatnonzero(negative_energy(problem))
    if unsafe.size:
        suspects = function.take(unsafe)
        z = suspects.branch(1.0)
        unstable, _ = suspects.count(-1e-12 * np.where(z > 0.0, z, 1.0))
        if unstable.any():
            number, sets = int(unstable.max()), len(problem.length)
            where = f", in {np.count_nonzero(unstable)} of {sets} parameter sets" if sets > 1 else ""
            plural = "s" if number > 1 else ""
            raise ValueError(f"the structure has buckled: {number} unstable mode{plural} (omega^2 < 0){where}")
    return function


def _brackets(function: Determinant, modes: int, number: Integers, row: Integers) -> Floats:
    """Return low, high, the counts and the values there for each wanted root, shape (6, roots)."""
    points, counts, values = _counted(function, modes)
    right = np.zeros((modes, points.shape[1]), dtype=np.int64)
    for point in range(len(points)):
        right += counts[point] <= np.arange(modes)[:, None]
    right = right[number, row]
    left = right - 1
    ends = points[left, row], points[right, row], counts[left, row], counts[right, row]
    return np.array([*ends, values[left, row], values[right, row]])


def _counted(function: Determinant, modes: int) -> tuple[Floats, Integers, Floats]:
    """Return points z, up to one with enough roots below it in every row, the counts there and the values."""
    rows = len(function.zeros)
    every = np.arange(rows)
    values = np.where(function.zeros == 0, function.value(np.zeros(rows)), np.nan)
    points, counts, found = [np.zeros(rows)], [function.zeros], [np.where(values > 0.0, values, np.nan)]
    pending = every
    for step in range(1, _MOST_STEPS + 1):
        z, number, value = points[-1].copy(), np.full(rows, modes, dtype=np.int64), found[-1].copy()
        rest = function.take(pending) if pending.size < rows else function
        at = rest.branch(step + 0.0625)
        last = points[-1][pending]
        at = np.where((at > last) & (at < np.inf), at, np.where(last > 0.0, 4.0 * last, 1.0))
        z[pending] = at
        number[pending], value[pending] = rest.count(at)
        points, counts, found = [*points, z], [*counts, number], [*found, value]
        pending = pending[number[pending] < modes]
        if not pending.size:
            return np.array(points), np.array(counts), np.array(found)
    raise ValueError(f"modes = {modes}: the model has only {counts[-1].min()} natural frequencies")


def _isolate(function: Determinant, number: Integers, row: Integers, brackets: Floats) -> None:
    """Shrink brackets, in place, until each contains one root, or no floating-point number between its ends."""
    low, high, below, above, at_low, at_high = brackets
    crowded = np.flatnonzero((below < number) | (above > number + 1))
    for _ in range(_MOST_STEPS):
        if not crowded.size:
            return
        bottom, top = low[crowded], high[crowded]
        middle = np.where(bottom > 0.0, np.sqrt(bottom * top), top / 64.0)
        counted, value = function.take(row[crowded]).count(middle)
        left = counted <= number[crowded]
        up, down = crowded[left], crowded[~left]
        low[up], below[up], at_low[up] = middle[left], counted[left], value[left]
        high[down], above[down], at_high[down] = middle[~left], counted[~left], value[~left]
        still = (below[crowded] < number[crowded]) | (above[crowded] > number[crowded] + 1)
        crowded = crowded[still & (high[crowded] - low[crowded] > 4 * _EPS * high[crowded])]
    raise ArithmeticError("the search for natural frequencies did not converge")


def _open_from_zero(function: Determinant, number: Integers, row: Integers, brackets: Floats) -> None:
    """Replace, in place, lower ends at z = 0, where the value is not known, by small z on the same side of the root."""
    low, high, _, _, at_low, at_high = brackets
    pending = np.flatnonzero((low == 0.0) & ~np.isfinite(at_low))
    share = 1e-3
    while pending.size and share > 1e-300:
        z = share * high[pending]
        value = function.take(row[pending]).value(z)
        before = (value > 0.0) == (number[pending] % 2 == 0)
        done, rest = pending[before], pending[~before]
        low[done], at_low[done] = z[before], value[before]
        high[rest], at_high[rest] = z[~before], value[~before]
        pending, share = rest, 1e-3 * share


def _roots(function: Determinant, number: Integers, row: Integers, brackets: Floats) -> Floats:
    """Return the roots from brackets; `_interpolated` on those with one root, the middle of those that are a point."""
    _isolate(function, number, row, brackets)
    _open_from_zero(function, number, row, brackets)
    low, high, below, above, at_low, at_high = brackets
    z: Floats = 0.5 * (low + high)
    sign = np.where(number % 2 == 0, 1.0, -1.0)
    at_low, at_high = at_low * sign, at_high * sign
    z = np.where(at_low <= 0.0, low, np.where(at_high >= 0.0, high, z))
    alone = (below == number) & (above == number + 1) & (at_low > 0.0) & (at_high < 0.0)
    wanted = np.flatnonzero(alone)
    ends = tuple(values[wanted] for values in (low, high, at_low, at_high))
    z[wanted] = _interpolated(function.take(row[wanted]), sign[wanted], *ends)
    return z


def _middle(low: Floats, high: Floats) -> Floats:
    """Return the midpoint in terms of the fourth root of z, which is nearly the wave number."""
    z: Floats = (0.5 * (low**0.25 + high**0.25)) ** 4
    return z


def _interpolated(
    function: Determinant, sign: Floats, low: Floats, high: Floats, at_low: Floats, at_high: Floats
) -> Floats:
    """Return one root in each bracket; ``sign`` times the function is positive at its lower end."""
    z = np.empty(low.size)
    place = np.arange(low.size)
    nearest = at_low < -at_high
    x1, x2 = np.where(nearest, low, high), np.where(nearest, high, low)
    f1, f2 = np.where(nearest, at_low, at_high), np.where(nearest, at_high, at_low)
    share = np.where(low > 0.0, (_middle(low, high) - x1) / (x2 - x1), f1 / (f1 - f2))
    for _ in range(_MOST_STEPS):
        step = share * (x2 - x1)
        x = x1 + step
        f = sign * function.value(x)
        same = (f > 0.0) == (f1 > 0.0)
        x3, f3 = np.where(same, x1, x2), np.where(same, f1, f2)
        x2, f2 = np.where(same, x2, x1), np.where(same, f2, f1)
        x1, f1 = x, f
        width = x2 - x1
        xi, phi = (x1 - x2) / (x3 - x2), (f1 - f2) / (f3 - f2)
        quadratic = (phi * phi < xi) & ((1.0 - phi) ** 2 < 1.0 - xi)
        smooth = f1 / (f2 - f1) * f3 / (f2 - f3) + (x3 - x1) / width * f1 / (f3 - f1) * f2 / (f3 - f2)
        least = np.minimum(_EPS * np.abs(x1) / np.abs(width), 0.5)
        share = np.clip(np.where(quadratic, smooth, 0.5), least, 1.0 - least)
        following = np.abs(share * width)
        settled = quadratic & (following < 0.1 * np.abs(x1)) & (following * following <= 1e-15 * x1 * np.abs(step))
        done = (settled | (f1 == 0.0) | (np.abs(width) <= 2.0 * _EPS * np.abs(x1))) & (place < z.size)
        end = np.where(f1 == 0.0, x1, x1 + share * width)
        z[place[done]] = end[done]
        place[done] = z.size
        on = np.flatnonzero(place < z.size)
        if not on.size:
            return z
        if on.size < _SHRINK * place.size:
            function, place, sign, share = function.take(on), place[on], sign[on], share[on]
            x1, x2, f1, f2 = x1[on], x2[on], f1[on], f2[on]
    raise ArithmeticError("the search for natural frequencies did not converge")
