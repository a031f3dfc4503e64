"""Modes of a continuum to a stated accuracy: quadrature mesh, then elements and degrees by the error estimate."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from .continuum import Continuum
from .stress import Columns
from .stress_mesh import Mesh, TooFineError, cells, resolved
from .stress_modes import ModeFields
from .stress_spectrum import BuckledError, spectrum
from .stress_tail import complete, tail

__all__ = ["Found", "alike", "cure", "meshed", "solved"]

Array = NDArray[np.float64]
Index = NDArray[np.intp]
Progress = Callable[[float, str], None]
Counted = Callable[[Index, Array], "NDArray[np.intp] | None"]
_ROUNDS, _MOST_UNKNOWNS, _MOST_DEGREE = 24, 1500, 40
_MOST_ELEMENTS = 12  # initial elements; with more spans than that, spans share elements
_FURTHER = 3  # number of times that residual stresses are added to the basis
_GONE = 1e-7
"""Ratio of the stiffness at an end to that at 1e-7 of the span from it, below which it counts as vanishing."""
_SHARE = 0.1
"""Compliance beyond the basis, relative to that of the last mode, below which no mode can be missing."""
_LANES = 1_000_000  # numbers in the largest array of a chunk


@dataclass(frozen=True)
class Found:
    """Modes of some of the rows.

    Attributes
    ----------
    rows : ndarray of int
    fields : ModeFields
    accuracy : ndarray, shape (rows,)
        Estimated relative error of the frequencies, the largest of the modes.
    """

    rows: Index
    fields: ModeFields
    accuracy: Array


def solved(
    problem: Continuum,
    modes: int,
    tolerance: float,
    target: float,
    progress: Progress | None = None,
    counted: Counted | None = None,
) -> list[Found]:
    """Return the lowest modes of every row.

    Parameters
    ----------
    problem : Continuum
    modes : int
    tolerance : float
        Relative error of the squared frequencies that must be reached.
    target : float
        Target error; a smaller one gives better mode shapes, whose error goes as its square root.
    progress : callable, optional
        Called after each mesh that is to be refined, with the error of the frequencies and a description of the mesh.
    counted : callable, optional
        ``counted(rows, z)`` returns how many squared frequencies of rows are below z, or None if it cannot. Used
        where the basis alone does not prove that no mode is missing.

    Raises
    ------
    ValueError
        If the structure has buckled, has fewer modes, or the tolerance is not reached: names the place and the error.
    """
    found: list[Found] = []
    for rows, ends in alike(problem):
        found += _group(problem.take(rows), rows, ends, _Aim(modes, tolerance, target, progress, counted))
    return found


def alike(problem: Continuum) -> Iterator[tuple[Index, tuple[bool, bool]]]:
    """Yield groups of sets whose stiffness vanishes at the same ends."""
    kinds = np.stack([_vanishes(problem, end) for end in (0, 1)], axis=1)
    for kind in np.unique(kinds, axis=0):
        yield np.nonzero((kinds == kind).all(axis=1))[0], (bool(kind[0]), bool(kind[1]))


def _vanishes(problem: Continuum, end: int) -> NDArray[np.bool_]:
    """Return in which rows a stiffness vanishes at an end; refuse one with a continuous spectrum."""
    edges = problem.edges
    width = edges[:, 1] - edges[:, 0] if end == 0 else edges[:, -1] - edges[:, -2]
    inward = np.array([0.0, 1e-7, 2e-7])
    at = edges[:, :1] + width[:, None] * inward if end == 0 else edges[:, -1:] - width[:, None] * inward
    rows = np.arange(len(edges))
    found = problem.coefficients(at, rows)

    def exponent(entry: Array) -> Array:
        entry = np.broadcast_to(entry, at.shape)
        with np.errstate(divide="ignore", invalid="ignore"):
            power = np.log2(np.abs(entry[:, 2] / entry[:, 1]))
        return np.where(np.isfinite(power), power, 0.0)

    tops = problem.tops()
    vanishes = np.zeros(len(edges), dtype=bool)
    for field, order in enumerate(problem.orders):
        power = exponent(found["W"][field, field])
        place = tops[field] - order + 1
        weight = exponent(found["M"][place, place]) if (place, place) in found["M"] else np.zeros(len(edges))
        stiff = np.abs(np.broadcast_to(found["W"][field, field], at.shape))
        with np.errstate(invalid="ignore"):
            gone = (power > 0.05) & ~(stiff[:, 0] > _GONE * stiff[:, 1])
        vanishes |= gone
        for k in range(order):  # a force there causes a stress that goes as the distance to the power order - 1 - k
            held = gone & (power > order - 1 - k + 0.05) & problem.acts_at(end, tops[field] - order + 1 + k)
            if held.any():
                name, moved = ("left", "right")[end], ("displacement", "slope", f"derivative of order {k}")[min(k, 2)]
                raise ValueError(
                    f"the stiffness vanishes at the {name} end like the distance to the power {power[held][0]:.3g}: a "
                    f"force on the {moved} there makes the strain infinite; leave out its spring, mass or damper, or "
                    "the load"
                )
        steep = power - weight > 2 * order - 1e-3
        if steep.any():
            name, value = ("left", "right")[end], float((power - weight)[steep][0])
            raise ValueError(
                f"the stiffness vanishes at the {name} end by {value:.3g} powers of the distance more than the mass: "
                f"from {2 * order} on there are no natural frequencies but a continuous spectrum; use ritz"
            )
    return vanishes


def _group(problem: Continuum, rows: Index, ends: tuple[bool, bool], aim: _Aim) -> list[Found]:
    try:
        problem, mesh, unresolved = meshed(problem, ends, aim.modes)
    except TooFineError as error:
        if error.sets == 1:
            raise
        half = len(rows) // 2
        parts = (np.arange(half), np.arange(half, len(rows)))
        return [item for part in parts for item in _group(problem.take(part), rows[part], ends, aim)]
    return _refined(problem, rows, mesh, unresolved, aim)


def meshed(problem: Continuum, ends: tuple[bool, bool], modes: int) -> tuple[Continuum, Mesh, Array]:
    """Return the problem integrated from a regular end, an initial mesh, and the unresolved part of each row.

    Parameters
    ----------
    problem : Continuum
        With rows that can share a mesh.
    ends : tuple of bool
        Whether a stiffness vanishes at the left and at the right end.
    modes : int

    Raises
    ------
    TooFineError
        If a coefficient varies too finely.
    """
    spans = problem.edges.shape[1] - 1
    if ends[0] and not ends[1]:
        problem = replace(problem, origin=1)
    elements = cells(spans, max(_MOST_ELEMENTS, int(np.ceil(modes / 12))))
    if spans == 1 and modes > 20:
        elements = np.linspace(0.0, 1.0, int(np.ceil(modes / 12)) + 1)
    elements = np.union1d(elements, [float(point.node) for point in problem.points])
    strained = np.zeros(len(elements) - 1, dtype=bool)
    strained[0] |= ends[0]
    strained[-1] |= ends[1]
    pieces, unresolved, smoothness = _quadrature(problem, elements, strained)
    degree = 8 + int(np.ceil(1.8 * modes / (len(elements) - 1)))
    return problem, Mesh(pieces, elements, degree, strained, smoothness, ends), unresolved


def _quadrature(problem: Continuum, elements: Array, strained: NDArray[np.bool_]) -> tuple[Array, Array, int]:
    """Return quadrature pieces that resolve the compliance, or the stiffness where the strain is expanded."""
    whole = np.union1d(elements, np.arange(problem.edges.shape[1]))
    parts, unresolved, smoothness = [], np.zeros(len(problem.edges)), 0
    for kind in np.unique(strained):
        for left, right, is_strained in zip(elements[:-1], elements[1:], strained, strict=True):
            if is_strained != kind or (not strained.any() and left > 0.0):
                continue
            if not strained.any():
                right = elements[-1]
            inner = whole[(whole >= left) & (whole <= right)]
            part, rest, degree = resolved(
                problem.sample(bool(kind)), problem.edges, inner, "coefficients", problem.variation
            )
            parts.append(part)
            unresolved, smoothness = np.maximum(unresolved, rest), max(smoothness, degree)
    return np.unique(np.concatenate(parts)), unresolved, smoothness


def _refined(problem: Continuum, rows: Index, mesh: Mesh, unresolved: Array, aim: _Aim) -> list[Found]:
    """Refine the mesh for the sets that have not reached the target."""
    found: list[Found] = []
    open_, before, degree_before = np.arange(len(rows)), np.inf, 0
    for turn in range(_ROUNDS):
        solutions = [_solved(problem, part, mesh, aim) for part in _chunks(problem, mesh, open_)]
        worst = max(solution.error.max(initial=0.0) for solution in solutions)
        size = solutions[0].fields.columns.size
        last = turn == _ROUNDS - 1 or size > _MOST_UNKNOWNS or (turn > 8 and worst > 0.5 * before)
        solutions = [solution.checked(rows, aim, last) for solution in solutions]
        for solution in solutions:
            good = solution.good(aim.tolerance if last else aim.target)
            if last and not good.all():
                _refuse(solution, good)
            if good.any():
                found.append(_settled(solution, good, rows, unresolved))
        still = [solution.part[~solution.good(aim.target)] for solution in solutions]
        if last or not sum(map(len, still)):
            return found
        if aim.progress is not None:
            aim.progress(0.5 * float(worst), f"{len(mesh.elements) - 1} elements of degree {mesh.degree}")
        marks, open_ = np.max([s.marks(aim.target) for s in solutions], axis=0), np.concatenate(still)
        degree = mesh.degree
        falling = worst > aim.target and (turn == 0 or (degree > degree_before and worst < 1e-3 * before))
        detailed = turn == 0 and len(mesh.pieces) > len(mesh.elements)
        if falling and not detailed and degree < _MOST_DEGREE - 6 and len(mesh.elements) < 20:
            mesh = replace(mesh, degree=degree + 6)
        else:
            mesh = mesh.split(marks >= 0.03 * marks.max())
        before, degree_before = worst, degree
    return found


@dataclass(frozen=True)
class _Aim:
    """Number of modes, accepted and target relative errors of z, and the callbacks for progress and count."""

    modes: int
    tolerance: float
    target: float
    progress: Progress | None
    counted: Counted | None = None


@dataclass(frozen=True)
class _Solution:
    """Modes of a chunk on one mesh, with the estimated relative error of z, total and by element.

    ``left_out`` bounds the compliance beyond the basis, by element; ``missing`` is that bound where a mode may be
    missing, and ``unproved`` marks the sets for which the basis does not prove completeness.
    """

    part: Index
    fields: ModeFields
    rounding: Array
    error: Array
    share: Array
    left_out: Array
    missing: Array
    unproved: NDArray[np.bool_]
    compliances: Array

    def good(self, level: float) -> NDArray[np.bool_]:
        """Return which sets have an error below a level and all their modes."""
        return np.asarray((self.error.max(axis=1) <= level) & ~self.missing.any(axis=1))

    def marks(self, level: float) -> Array:
        """Return the contribution of each element to the errors that are still too large, (elements,)."""
        shares: Array = self.share[self.error.max(axis=1) > level].max(axis=(0, 1), initial=0.0)
        return shares if shares.any() else self.missing.max(axis=0)

    def checked(self, rows: Index, aim: _Aim, last: bool) -> _Solution:
        """Return the solution after a count of the modes, where needed, in the widest gap above the last of them."""
        good = self.error.max(axis=1) <= (aim.tolerance if last else aim.target)
        which = np.nonzero(good & (self.unproved | (last & self.missing.any(axis=1))))[0]
        if aim.counted is None or not len(which):
            return self
        rigid = (self.fields.z[which] == 0.0).sum(axis=1)
        compliances = self.compliances[which]
        with np.errstate(divide="ignore", invalid="ignore"):
            gaps = compliances[:, :-1] / compliances[:, 1:]
        behind = np.arange(1, compliances.shape[1]) >= aim.modes - rigid[:, None]
        place = np.where(behind & np.isfinite(gaps), gaps, 0.0).argmax(axis=1)[:, None]
        first, second = (np.take_along_axis(compliances, place + k, axis=1)[:, 0] for k in (0, 1))
        with np.errstate(divide="ignore"):
            number = aim.counted(rows[self.part[which]], 1.0 / np.sqrt(first * second))
        if number is None:
            return self
        missing = self.missing.copy()
        right = number == place[:, 0] + 1 + rigid
        missing[which] = np.where(right[:, None], 0.0, self.left_out[which])
        return replace(self, missing=missing)


def _solved(problem: Continuum, part: Index, mesh: Mesh, aim: _Aim) -> _Solution:
    """Return the modes of a chunk; residual stresses are added to the basis to resolve fine detail in an element."""
    chosen = problem.take(part)
    further: Array | None = None
    most = _FURTHER if len(mesh.pieces) > 4 * len(mesh.elements) else 0
    best: _Solution | None = None
    for turn in range(most + 1):
        columns = Columns(chosen, mesh, further)
        try:
            result = spectrum(columns, aim.modes)
        except BuckledError:
            raise
        except ValueError:
            if best is None:
                raise
            return best  # the further stresses are linearly dependent to rounding
        fields = ModeFields(columns, result.z, result.vectors)
        share = 2.0 * fields.residual
        left_out, loading = tail(columns)
        most_left_out, elastic = left_out.max(axis=1), (result.z > 0.0).sum(axis=1)
        proved = complete(result.compliances, elastic, most_left_out, loading.max(axis=1), result.load)
        last = np.take_along_axis(result.compliances, np.clip(elastic - 1, 0, None)[:, None], axis=1)[:, 0]
        small = most_left_out < _SHARE * last
        missing = np.where((proved | small)[:, None], 0.0, left_out)
        solution = _Solution(
            part, fields, result.rounding, share.sum(axis=-1), share, left_out, missing, small & ~proved,
            result.compliances,
        )  # fmt: skip
        if best is not None and solution.error.max() > best.error.max():
            return best
        best = solution
        if solution.error.max() <= aim.target or turn == most:
            break
        more = fields.further()[:, ((solution.error > 0.01 * aim.target) & (result.z > 0.0)).any(axis=0)]
        further = more if further is None else np.concatenate([further, more], axis=1)
    assert best is not None
    return best


def _chunks(problem: Continuum, mesh: Mesh, every: Index) -> Iterator[Index]:
    size = problem.displacements + len(problem.orders) * (len(mesh.elements) - 1) * (mesh.degree + 1)
    lanes = size * max(size, (len(mesh.pieces) - 1) * mesh.points)
    step = max(1, _LANES // lanes)
    for start in range(0, len(every), step):
        yield every[start : start + step]


def _settled(solution: _Solution, good: NDArray[np.bool_], rows: Index, unresolved: Array) -> Found:
    """Return the sets of a solution that meet the tolerance."""
    part = solution.part[good]
    error = np.maximum(solution.error, solution.rounding).max(axis=1)[good]
    return Found(rows[part], solution.fields.take(np.nonzero(good)[0]), 0.5 * error + unresolved[part])


def _refuse(solution: _Solution, good: NDArray[np.bool_]) -> None:
    error = np.where(good[:, None], 0.0, solution.error)
    row, mode = (int(k) for k in np.unravel_index(np.argmax(error), error.shape))
    mesh = solution.fields.columns.mesh
    missing = bool(solution.missing[row].any())
    element = int(np.argmax(solution.missing[row] if missing else solution.share[row, mode]))
    piece = np.searchsorted(mesh.pieces, mesh.elements[element : element + 2])
    ends = solution.fields.columns.grid.ends[row]
    if missing:
        raise ValueError(
            f"modes = {error.shape[1]}: one may be missing; what {mesh.elements.size - 1} elements leave out is too "
            f"soft at x = {ends[piece[0]]:.6g} to {ends[piece[1]]:.6g}; use ritz"
        )
    raise ValueError(
        f"modes = {error.shape[1]}: the relative error of frequency {mode + 1} stays at {0.5 * error[row, mode]:.1g}; "
        f"it comes from the coefficients at x = {ends[piece[0]]:.6g} to {ends[piece[1]]:.6g}; "
        f"{cure(0.5 * error[row, mode])}"
    )


def cure(error: float) -> str:
    """Return the advice for an error that refinement does not reduce."""
    return f"tolerance={1.5 * error:.0e} accepts it" if error < 5e-3 else "use ritz, which estimates no error"
