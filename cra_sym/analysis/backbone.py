"""Backbone curves: the free periodic motions that continue a linear mode, through folds and internal resonances."""

from __future__ import annotations

import itertools
import warnings
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from cra_sym import checks
from cra_sym.analysis.backbone_problem import FollowedMode
from cra_sym.analysis.nonlinear import MOST_NONLINEAR_MODES, ConvergenceWarning, embedding, warn_of_slopes
from cra_sym.analysis.slip_backbone import held_curve, warn_of_missing
from cra_sym.model.system import System
from cra_sym.si import Numbers
from cra_sym.solvers.branching import branches as branches_of
from cra_sym.solvers.continuation import Curve, Measure, Point, between, correct, first_point, follow, shares
from cra_sym.solvers.harmonic_balance import peak
from cra_sym.solvers.monodromy import multipliers

if TYPE_CHECKING:
    from sympy.core.function import AppliedUndef

__all__ = ["Backbone", "backbone"]

Array = NDArray[np.float64]
_MOST_POINTS = 1000
_MORE_MODES, _MORE_HARMONICS = 3, 4  # points for which the error is estimated together
UNSTABLE = 1e-6
"""A motion counts as unstable if the modulus of a Floquet multiplier exceeds 1 by more."""


@dataclass(frozen=True, eq=False)
class Backbone(checks.ByValue):
    """Free periodic motions that grow from a linear mode.

    Attributes
    ----------
    angular_frequency : ndarray, shape (...)
        rad/s.
    energy : ndarray, shape (...)
        At the instant of zero velocity, J; with gyroscopic terms, where there is none, the energy v dL/dv - L, which is
        constant.
    amplitude : ndarray, shape (...)
        Peak at the tip, or of the chosen displacement.
    stable : ndarray of bool, shape (...)
        Whether no Floquet multiplier has a modulus beyond 1 + 1e-6.
    error_modes, error_harmonics : ndarray, shape (...)
        Estimated relative truncation error of the frequency: its change with three more modes, and with four more
        harmonics.
    coefficients : ndarray, shape (..., modes, functions)
        Modal coordinates as sums of cosines of ``multiples`` of the phase; with gyroscopic terms also of the sines of
        those that are not zero, after the cosines.
    multiples : tuple of int
    crossings : ndarray, shape (branch points,)
        Angular frequencies at which the curve meets another one on the way.
    damping_ratio, loss : ndarray, shape (...)
        With elastic-slip elements: the damping ratio of the motion, and the energy dissipated in a cycle, J; zero for
        free motions without damping.
    branches : tuple of Backbone
        Only with ``branches``: the curves that cross the whole curve.

    Examples
    --------
    >>> import cra_sym as cra
    >>> line = cra.backbone(cra.Arm.nominal(), amplitude=[0.01, 0.1], modes=1)
    >>> line.angular_frequency.round(3), line.stable  # of a linear system
    (array([15.254, 15.254]), array([ True,  True]))
    """

    angular_frequency: Array
    energy: Array
    amplitude: Array
    stable: NDArray[np.bool_]
    error_modes: Array
    error_harmonics: Array
    coefficients: Array
    multiples: tuple[int, ...]
    crossings: Array
    damping_ratio: Array
    loss: Array
    branches: tuple[Backbone, ...] = ()


@checks.default_floating_point
def backbone(
    system: System,
    mode: int = 1,
    *,
    energy: Numbers | None = None,
    amplitude: Numbers | None = None,
    modes: int = 6,
    harmonics: int | None = None,
    points: int = 400,
    branches: bool = False,
    place: float | None = None,
    field: AppliedUndef | None = None,
) -> Backbone:
    """Return the undamped free periodic motions that continue a linear mode to finite amplitude.

    Harmonic balance, continued by arclength from the linear mode through every fold. No internal
    resonance is skipped: a change of the number of negative eigenvalues of the Jacobian shows that a step was too long.

    Dampers are left out. Without natural modes, as with gyroscopic terms, the curve begins at a motion of the system
    between the modes of its conservative part, and mode counts these motions.

    With elastic-slip elements the motion is damped, also by dampers and damping ratios. It is made periodic by damping
    of opposite sign, -2 zeta omega times the velocity of every mode (EPMC, Krack 2015). Its amplitude must be
    given; it is stable if no multiplier of the equations without this damping has a modulus beyond 1 + 1e-6. Its
    coefficients are those of the constant, the cosines and the sines.

    Parameters
    ----------
    system : System
        Not a batch.
    mode : int
        Counted from 1.
    energy, amplitude : array_like, optional
        Points to return: the first along the curve with that energy (J, at zero velocity), or with that peak at the
        tip. By default the whole curve with its folds, up to ``points`` points.
    modes : int
        Number of linear modes, 1 to 40; with elastic-slip elements those of the system without them.
    harmonics : int, optional
        Highest multiple of the frequency, 1 to 60. Internal resonances with higher ones do not show. Default: 9; with
        elastic-slip elements as many as change frequency and damping ratio by less than 3e-7, at most 127. There are
        fewer where more do not converge, since stiff elements excite lightly damped modes: ``error_harmonics`` is then
        the change by the last of them.
    points : int
        Number of points of the whole curve, and at most of each branch.
    branches : bool
        Whether to follow the curves that cross the whole curve too, both ways, where an internal resonance joins two
        modes or a motion of another form sets in; where several cross at one point, one of them. Like the curve itself,
        they have the harmonics ``multiples``, and no sines without gyroscopic terms; motions without this symmetry, or
        of twice the period, that begin where a multiplier passes 1 or -1, are not followed. A branch ends at energies
        below those of the curve, or where it closes.
    place, field : optional
        Of the peak, instead of the tip.

    Returns
    -------
    Backbone
        Of the shape of ``energy`` or ``amplitude``, or with one axis of points.

    Warns
    -----
    ConvergenceWarning
        If the curve could not be followed far enough; points that were not reached are nan. With elastic-slip elements
        also if ``error_harmonics`` exceeds 1e-3.
    AsymptoticWarning
        If slopes are too large for ``quadratures`` of squared slopes.

    Raises
    ------
    TypeError, ValueError
        If an argument is out of its range, both energy and amplitude are given, the system is a batch, has no
        vibrating mode of that number, has constant loads, terms that are not polynomial, or forces without a potential
        that are even in time, such as forces that follow the motion.

    Examples
    --------
    A mass on a spring that hardens, x'' + x + x^3 = 0, at the amplitude 1:

    >>> from sympy import Function
    >>> import cra_sym as cra
    >>> from cra_sym.symbols import t, x
    >>> q = Function("q")(t)
    >>> duffing = cra.Model(0, fields=(), coordinates=[q], x=x, domain=(0, 1), t=t,
    ...                     left=q.diff(t)**2/2 - q**2/2 - q**4/4)
    >>> cra.backbone(duffing.at({}), amplitude=1.0, modes=1).angular_frequency.round(6)
    np.float64(1.317776)
    """
    checks.instance("system", system, System)
    modes = checks.count("modes", modes, high=MOST_NONLINEAR_MODES)
    harmonics = None if harmonics is None else checks.count("harmonics", harmonics, high=60)
    mode, points = checks.count("mode", mode, high=modes), checks.count("points", points, low=2, high=_MOST_POINTS)
    if energy is not None and amplitude is not None:
        raise ValueError("energy, amplitude: one of them must be None")
    if checks.flag("branches", branches) and (energy is not None or amplitude is not None):
        raise ValueError("branches = True: needs the whole curve, with neither energy nor amplitude given")
    if system.model.pieces["hysteresis"]:
        return _held(system, mode, energy, amplitude, modes, harmonics, place, field)
    problem = FollowedMode.of(system, mode, modes, 9 if harmonics is None else harmonics, place, field)
    if energy is None and amplitude is None:
        return _whole(problem, points, branches)
    name, value = ("energy", energy) if amplitude is None else ("amplitude", amplitude)
    unit = "J" if amplitude is None else None
    targets = checks.real_array(name, value, low=1e-60, high=1e60, unit=unit)
    return _at_targets(problem, targets, problem.energy if amplitude is None else problem.peak, name)


def _held(
    system: System, mode: int, energy: Any, amplitude: Any, modes: int, harmonics: int | None, place: Any, field: Any
) -> Backbone:
    """Return the backbone of damped motions with elastic-slip elements."""
    if amplitude is None:
        raise ValueError(f"energy = {energy}: must be None and amplitude given, as the model has hysteresis")
    if system.shape:
        raise ValueError(
            f"system has the batch shape {system.shape}: must be a single one here; see System.parameter_sets"
        )
    targets = checks.real_array("amplitude", amplitude, low=1e-60, high=1e60)
    found = held_curve(system, mode, targets.ravel(), modes, harmonics, place, field)
    warn_of_missing(found, targets.ravel())

    def shaped(values: NDArray[Any]) -> NDArray[Any]:
        return np.asarray(values.reshape((*targets.shape, *values.shape[1:])))[()]

    return Backbone(
        shaped(found.angular_frequency),
        shaped(found.energy),
        targets[()],
        shaped(found.stable),
        shaped(found.error_modes),
        shaped(found.error_harmonics),
        shaped(found.coefficients),
        tuple(range(found.coefficients.shape[-1] // 2 + 1)),
        np.zeros(0),
        shaped(found.damping_ratio),
        shaped(found.loss),
    )


def _started(problem: FollowedMode, measure: Measure, below: float | None) -> tuple[Curve, Point]:
    curve = Curve(problem.balance, problem.linear)
    size = problem.small()
    if below is not None:
        whole = measure(np.append(problem.linear_motion(1.0), problem.linear))[0]
        if not whole > 0:
            raise ValueError("amplitude: the mode does not move there; choose another place or field")
        power = 2.0 if measure == problem.energy else 1.0
        size = min(size, float((0.5 * below / whole) ** (1 / power)))
    for _ in range(20):
        found = first_point(curve, problem.linear_motion(size), measure)
        if found is not None:
            return curve, found
        size *= 0.3
    raise ValueError(f"mode = {problem.mode}: harmonic balance does not converge even for a small motion")


def _whole(problem: FollowedMode, points: int, branches: bool) -> Backbone:
    if problem.equations.degree == 1:
        raise ValueError("system: is linear, so its backbone has no end; ask for an energy or an amplitude")
    curve, start = _started(problem, problem.energy, None)
    found = list(itertools.islice(follow(curve, start, leaps=True), points))
    if len(found) < points:
        _unfinished(found[-1], f"after {len(found)} of {points} points")
    whole = _backbone_of(problem, *_along(found), _crossings(found))
    if not branches:
        return whole
    lowest, lines = problem.energy(start.vector)[0], list[Backbone]()
    for other in branches_of(curve, found, points, lambda point: problem.energy(point.vector)[0] < lowest):
        if other.broken:
            _unfinished((other.points or [other.origin])[-1], "on a branch")
        if other.points:
            crossings = np.array([other.origin.frequency, *_crossings(other.points)])
            lines.append(_backbone_of(problem, *_along(other.points), crossings))
    return replace(whole, branches=tuple(lines))


def _along(points: list[Point]) -> tuple[list[Array], list[Array], tuple[int]]:
    """Return the points of a curve, the normals that fix them, and the shape of the results."""
    return [point.vector for point in points], [point.tangent for point in points], (len(points),)


def _at_targets(problem: FollowedMode, targets: Array, measure: Measure, name: str) -> Backbone:
    flat = targets.ravel()
    curve, point = _started(problem, measure, float(flat.min()))
    answers: list[Array | None] = [None] * flat.size
    passed: list[Point] = []
    value, slope = _rate(measure, point)
    for following in follow(curve, point, leaps=True):
        passed.append(following)
        new_value, new_slope = _rate(measure, following)
        for k, target in enumerate(flat):
            if answers[k] is None and following is not point:
                places = shares(value, slope, new_value, new_slope, following.step, float(np.log(target)))
                if places.size:
                    answers[k] = _refined(curve, point, following, float(places[0]), measure, float(target))
        point, value, slope = following, new_value, new_slope
        if all(a is not None for a in answers) or len(passed) == _MOST_POINTS:
            break
    missing = [k for k, answer in enumerate(answers) if answer is None]
    if missing:
        _unfinished(passed[-1], f"before {name} = {flat[missing[0]]:g}")
    blank = np.full(problem.balance.size + 1, np.nan)
    vectors = [blank if a is None else a for a in answers]
    normals = [blank if a is None else measure(a)[1] for a in answers]
    return _backbone_of(problem, vectors, normals, targets.shape, _crossings(passed))


def _crossings(points: list[Point]) -> Array:
    return np.array([point.frequency for point in points if point.crossing])


def _unfinished(last: Point, where: str) -> None:
    warnings.warn(
        f"the curve could not be followed beyond {last.frequency:.6g} rad/s, {where}", ConvergenceWarning, stacklevel=5
    )


def _rate(measure: Measure, point: Point) -> tuple[float, float]:
    """Return the logarithm of the measure and its derivative along the curve."""
    value, gradient = measure(point.vector)
    return float(np.log(value)), float(gradient @ point.tangent / value)


def _refined(curve: Curve, before: Point, after: Point, share: float, measure: Measure, target: float) -> Array | None:
    guess = between(before, after, share)

    def constraint(vector: Array) -> tuple[float, Array]:
        value, gradient = measure(vector)
        return np.log(value / target), gradient / value

    found = correct(curve, guess, constraint, 20)
    return None if found is None else found[0]


def _backbone_of(
    problem: FollowedMode, vectors: list[Array], normals: list[Array], shape: tuple[int, ...], crossings: Array
) -> Backbone:
    """Return the result at points of the curve; the normals keep a point in place when modes or harmonics are added."""
    stacked = np.array(vectors)
    good = np.isfinite(stacked).all(axis=1)
    unknowns, frequency = stacked[:, :-1], stacked[:, -1]
    size, multiples = len(stacked), problem.balance.basis.cosines
    energy, largest = np.full(size, np.nan), np.full(size, np.nan)
    for k in np.flatnonzero(good):
        energy[k] = problem.energy(stacked[k])[0]
    coefficients = problem.balance.coefficients(unknowns)
    warn_of_slopes(problem.system, problem.balance.basis, coefficients[good], 6)
    largest[good] = peak(problem.balance.basis, problem.rows, coefficients[good])[0]
    stable = np.zeros(size, bool)
    stable[good] = _stable(problem, coefficients[good], frequency[good])
    errors = []
    for more in ((_MORE_MODES, 0), (0, _MORE_HARMONICS)):
        error = np.full(size, np.nan)
        if good.any():
            error[good] = _changed(problem, more, stacked[good], np.array(normals)[good])
        errors.append(error.reshape(shape))
    return Backbone(
        frequency.reshape(shape)[()],
        energy.reshape(shape)[()],
        largest.reshape(shape)[()],
        stable.reshape(shape)[()],
        errors[0][()],
        errors[1][()],
        coefficients.reshape(*shape, *coefficients.shape[1:]),
        multiples,
        crossings,
        np.zeros(shape)[()],
        np.zeros(shape)[()],
    )


def _stable(problem: FollowedMode, coefficients: Array, frequency: Array) -> NDArray[np.bool_]:
    """Return whether all multipliers are on the unit circle, except the pair at 1 due to the curve itself."""
    if not len(frequency):
        return np.zeros(0, bool)
    basis = problem.balance.basis
    even = not basis.sines  # else there is no instant about which motions are even in time
    tolerance = 1e-7 if even else 1e-11
    values = multipliers(problem.equations, basis, coefficients, frequency, tolerance=tolerance, even=even)
    order = np.argsort(np.abs(values - 1.0), axis=1)
    others = np.take_along_axis(values, order[:, 2:], axis=1)
    return np.asarray(np.abs(others).max(axis=1, initial=0.0) <= 1.0 + UNSTABLE)


def _changed(problem: FollowedMode, more: tuple[int, int], vectors: Array, normals: Array) -> Array:
    """Return the relative change of the frequency when modes and harmonics are added: two steps of Newton's method."""
    try:
        rich = problem.richer(*more)
    except ValueError:  # there are no more modes
        return np.zeros(len(vectors))
    n, old, new = problem.equations.modes, problem.balance.basis, rich.balance.basis
    places = [new.cosines.index(k) for k in old.cosines]
    places += [len(new.cosines) + new.sines.index(k) for k in old.sines]
    into = embedding(problem.system, n, rich.equations.modes).T

    def embedded(rows: Array) -> Array:
        x = np.zeros((len(rows), rich.equations.modes, new.size))
        x[:, :, places] = into @ rows[:, :-1].reshape(-1, n, old.size)
        return np.concatenate([x.reshape(len(rows), -1), rows[:, -1:]], axis=1)

    curve = Curve(rich.balance, rich.linear)
    z, normal = embedded(vectors), embedded(normals)
    metric = np.stack([curve.metric(row[:-1], row[-1]) for row in z])
    for _ in range(2):
        residual, matrix = (np.stack(part) for part in zip(*(curve.linearised(row)[:2] for row in z), strict=True))
        size = np.linalg.norm(normal / metric, axis=1)[:, None]
        bordered = np.concatenate([matrix / metric[:, None, :], (normal / metric / size)[:, None, :]], axis=1)
        right = np.concatenate([residual, np.zeros((len(z), 1))], axis=1)
        z = z - np.linalg.solve(bordered, right[:, :, None])[:, :, 0] / metric
    return np.abs(z[:, -1] / vectors[:, -1] - 1.0)
