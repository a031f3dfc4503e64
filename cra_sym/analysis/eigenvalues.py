"""Complex eigenvalues of a system with dampers, gyroscopic forces, or forces that follow the motion."""

from __future__ import annotations

from contextlib import suppress

import numpy as np
from numpy.typing import NDArray

from cra_sym.checks import count, default_floating_point, instance, real_array
from cra_sym.model.routes import ROUNDING, GeneralRoute
from cra_sym.model.spanned_stiffness import Stiffness, check_range
from cra_sym.model.spatial import HALVINGS, SpatialProblem
from cra_sym.model.system import MOST_MODES, System
from cra_sym.model.values import flat_columns
from cra_sym.model.vanishing import check_ends
from cra_sym.si import Numbers
from cra_sym.solvers.argument import number_inside
from cra_sym.solvers.eigenvalues import refine
from cra_sym.solvers.pencil import GeneralContinuum
from cra_sym.solvers.pencil_refine import Settled, local_spectrum, lowest_eigenvalues
from cra_sym.solvers.stress_refine import cure

__all__ = ["count_eigenvalues", "damping_ratios", "eigenvalues", "oscillating_frequencies"]

Array = NDArray[np.float64]
Complex = NDArray[np.complex128]
_LEAST = 1e-11  # smallest relative tolerance that two meshes can agree to, because of rounding
_SHORTER = 1e-3, 1e-4  # shares of the length that are left out where a stiffness vanishes at an end
_ASTRAY = 10.0  # distance from the value refined, over its estimated error, beyond which a root is another one
_MOST_HALVINGS = 11
_BY_CONTINUUM = 0.2  # relative distance from s at which eigenvalues accumulate that explains an error
_SHRINK = 0.85  # next radius to try, relative to one at which rounding spoils the count


@default_floating_point
def eigenvalues(system: System, modes: int = 3, *, oscillating: bool = True) -> Complex:
    """Return complex eigenvalues s (rad/s) of motions ``exp(s t)``, one of each conjugate pair.

    Dampers, gyroscopic forces and forces that follow the motion are included, and coefficients may vary along x. Modal
    damping (zeta) is left out.

    Parameters
    ----------
    system : System
    modes : int
        How many, 1 to 1000.
    oscillating : bool
        Leave out real eigenvalues, of motions that do not oscillate, rigid-body motions at rest among them:
        Kelvin-Voigt damping has infinitely many real ones, which accumulate at minus one over the retardation time.
        Without forces of first order in time that follow the motion, both s and -s of a real pair are given.

    Returns
    -------
    ndarray of complex, shape (..., modes)
        By ascending modulus. Where forces follow the motion, a flutter pair ``+-a + i b`` is two of them.

    Raises
    ------
    ValueError
        If there are fewer eigenvalues, with the number that the argument principle counts, or they accumulate there.
    ArithmeticError
        If they do not converge, and Newton's method on the exact problem does not either.

    Notes
    -----
    They are those of the Ritz basis on the stresses, converged to a relative ``system.tolerance`` (1e-11 at least) as
    its degree rises. Where two coalesce (critical damping, flutter) their mean and product converge, and each is
    accurate to half the digits only, as its sensitivity to the parameters implies. :func:`count_eigenvalues` proves in
    a region that none is missing. With a field that has no derivative by x, Newton's method on the exact problem
    refines Ritz values of Hermite elements, and two step sizes must agree. ``system.accuracy`` tells the largest
    estimated relative error. Without dampers and other such forces ``s = i omega``.

    Examples
    --------
    Beck's column beyond flutter:

    >>> from sympy import symbols
    >>> import cra_sym as cra
    >>> from cra_sym.symbols import L, t, v, x
    >>> P, B, m = symbols("P B m")
    >>> column = cra.Model(m * v.diff(t)**2 / 2 - B * v.diff(x, 2)**2 / 2 + P * v.diff(x)**2 / 2, fields=[v], x=x,
    ...                    domain=(0, L), t=t, essential=[v.subs(x, 0), v.diff(x).subs(x, 0)],
    ...                    virtual_work=[(-P * v.diff(x), v, "right")])
    >>> column.eigenvalues({P: 30.0, B: 1.0, m: 1.0, L: 1.0}, modes=2).round(6)
    array([ 7.101221+10.249159j, -7.101221+10.249159j])
    """
    instance("system", system, System)
    modes = count("modes", modes, high=MOST_MODES)
    instance("oscillating", oscillating, bool)
    _ = system.domain  # refuses a length that is not positive
    if system.numerics("conservative"):
        return np.asarray(1j * system.natural_frequencies(modes))
    columns = flat_columns(system.parameters, system.shape)
    roots, reached = np.empty((columns.shape[1], modes), dtype=complex), np.empty(columns.shape[1])
    pencil, tolerance = system.numerics("pencil"), max(system.tolerance, _LEAST)
    if pencil is None:
        guesses = system.model.ritz(2 * modes + 10).eigenvalues(system.values, modes, oscillating=oscillating)
        found = _by_newton(system, columns, np.broadcast_to(guesses.reshape(-1, modes), roots.shape), tolerance)
        system.note_accuracy(found.error.max(axis=1).reshape(system.shape))
        return found.values.reshape(*system.shape, modes)
    for rows, problem in pencil.problems(columns):
        with np.errstate(over="ignore", under="ignore"):
            found = lowest_eigenvalues(problem, modes, oscillating, tolerance)
        good = (found.error <= tolerance).all(axis=1)
        roots[rows[good]], reached[rows[good]] = found.values[good], found.error[good].max(axis=1)
        for row in np.nonzero(~good)[0]:
            one = Settled(found.values[row : row + 1], found.error[row : row + 1])
            alone = problem.take(np.array([row]))
            last = _unsettled(system, columns[:, rows[row : row + 1]], alone, one, oscillating, tolerance)
            roots[rows[row]], reached[rows[row]] = last.values[0], last.error.max()
    check_range(roots)
    system.note_accuracy(reached.reshape(system.shape))
    return roots.reshape(*system.shape, modes)


@default_floating_point
def damping_ratios(system: System, modes: int = 3) -> NDArray[np.float64]:
    """Return ``-Re s / |s|`` of the :func:`eigenvalues`, zero for a rigid motion, shape (..., modes).

    Examples
    --------
    A string that is held by a damper at its right end:

    >>> import cra_sym as cra
    >>> from sympy import Symbol
    >>> from cra_sym.symbols import L, t, v, x
    >>> c, end = Symbol("c"), v.subs(x, L)
    >>> string = cra.Model(v.diff(t)**2 / 2 - v.diff(x)**2 / 2, fields=[v], x=x, domain=(0, L), t=t,
    ...                    essential=[v.subs(x, 0)], virtual_work=[(-c * v.diff(t), v, "right")])
    >>> cra.damping_ratios(string.at({L: 1.0, c: 0.1}), modes=2).round(4)
    array([0.0637, 0.0213])
    """
    s = eigenvalues(system, modes)
    return -s.real / np.where(s == 0.0, 1.0, np.abs(s))


def oscillating_frequencies(system: System, modes: int) -> Array:
    """Return the first natural frequencies, or those of the complex modes where there are none, rad/s."""
    if system.conservative_part is system:
        return system.natural_frequencies(modes)
    return np.asarray(eigenvalues(system, modes).imag)


@default_floating_point
def count_eigenvalues(system: System, radius: Numbers) -> NDArray[np.int64]:
    """Return the number of eigenvalues with a modulus below a radius, by the argument principle.

    The count uses only the exact characteristic function, not the method of :func:`eigenvalues`: if that gives the same
    number within the radius, none is missing or repeated.

    Parameters
    ----------
    system : System
    radius : array_like
        rad/s, in [1e-100, 1e60]; it broadcasts with the batch of the system.

    Returns
    -------
    ndarray of int, shape (...)
        Both members of each conjugate pair, real eigenvalues, and multiplicities are counted: a free undamped
        rigid-body motion counts twice.

    Raises
    ------
    ValueError
        If the radius is out of range, an eigenvalue lies on the circle, the waves are too short or rounding leaves no
        digits at this radius, or the count is not the same on two domains that end before a vanishing stiffness.

    Notes
    -----
    Where a stiffness vanishes at an end, the characteristic function is infinite. The eigenvalues are then counted on
    domains that end by 1e-3 and by 1e-4 of the length before it.

    Examples
    --------
    A string whose end absorbs every wave has no eigenvalue at all:

    >>> from sympy import symbols
    >>> import cra_sym as cra
    >>> from cra_sym.symbols import t, v, x
    >>> c = symbols("c")
    >>> string = cra.Model(v.diff(t)**2 / 2 - v.diff(x)**2 / 2, fields=[v], x=x, domain=(0, 1), t=t,
    ...                    essential=[v.subs(x, 0)], virtual_work=[(-c * v.diff(t), v, "right")])
    >>> count_eigenvalues(string.at({c: [0.5, 1.0]}), 10.0)
    array([6, 0])
    """
    instance("system", system, System)
    radii = real_array("radius", radius, low=1e-100, high=1e60, unit="rad/s")
    _ = system.domain
    shape = np.broadcast_shapes(system.shape, radii.shape)
    columns, radii = flat_columns(system.parameters, shape), np.broadcast_to(radii, shape).ravel()
    found = np.empty(len(radii), dtype=np.int64)
    spatial: SpatialProblem = system.numerics("driven_spatial")
    squared, singular = not system.numerics("damped"), spatial.singular(columns)

    def inside(problem: Stiffness, number: int, reach: float) -> int:
        try:
            return (1 + squared) * number_inside(problem, number, 0.0, reach**2 if squared else reach)
        except ArithmeticError as error:
            raise ValueError(f"radius = {reach:g}: {error}") from None

    regular = np.nonzero(~singular)[0]
    for rows, _, problem in spatial.problems(columns[:, regular]):
        for number, row in enumerate(regular[rows]):
            found[row] = inside(problem, number, float(radii[row]))
    if singular.any():
        check_ends(system, columns[:, singular])
    for row in np.nonzero(singular)[0]:
        reach = float(radii[row])
        short = {inside(spatial.shortened(columns[:, row : row + 1], share), 0, reach) for share in _SHORTER}
        if len(short) > 1:
            raise ValueError(
                f"radius = {reach:g}: a stiffness vanishes at an end, and domains that end by {_SHORTER[0]:g} and "
                f"{_SHORTER[1]:g} of the length before have different numbers of eigenvalues; change the radius"
            )
        found[row] = short.pop()
    return found.reshape(shape)


def _unsettled(
    system: System, columns: Array, problem: GeneralContinuum, found: Settled, oscillating: bool, tolerance: float
) -> Settled:
    """Return eigenvalues by Newton's method if it converges, or raise an error with their number."""
    modes, there = found.values.shape[1], int(np.isfinite(found.values).sum())
    if there < modes:
        kind = (
            "oscillating motions; eigenvalues(.., oscillating=False) gives real ones too"
            if oscillating
            else "eigenvalues"
        )
        raise ValueError(f"modes = {modes}: there are only {there} {kind}")
    bad = ~(found.error[0] <= tolerance)
    first, error = int(bad.argmax()), float(found.error[0, bad.argmax()])
    reason = f"modes = {modes}: the relative error of eigenvalue {first + 1} stays at {error:.1g}"
    confined = local_spectrum(problem)
    gap = np.abs(found.values[0, first] - confined).min(initial=np.inf)
    accumulate = gap < _BY_CONTINUUM * np.abs(found.values[0, first])
    if not accumulate or system.numerics("driven_spatial").uniform:
        with suppress(ArithmeticError, ValueError):
            exact = _by_newton(system, columns, found.values, tolerance)
            if (np.abs(exact.values - found.values) <= _ASTRAY * found.error * np.abs(exact.values)).all():
                return exact
    if accumulate:
        sizes = np.abs(confined[np.isfinite(confined)])
        raise ValueError(
            f"{reason}; eigenvalues accumulate at |s| = {sizes.min():.6g} to {sizes.max():.6g} rad/s, where inertia, "
            f"dampers and stiffness of the highest derivatives by x cancel; only {first} precede them"
        )
    number, reach = _counted(system, columns, float(np.abs(found.values[0][bad]).min()))
    if number is None:
        raise ArithmeticError(f"{reason}, and none can be counted; {cure(error)}")
    raise ValueError(
        f"{reason}; the argument principle counts {number} eigenvalues, both of each pair, with |s| < {reach:.4g} "
        "rad/s: an end that absorbs the waves leaves none, or none that the parameters determine"
    )


def _counted(system: System, columns: Array, reach: float) -> tuple[int | None, float]:
    """Return the number of eigenvalues within the largest circle in which rounding allows a count."""
    one = system.model.at(dict(zip(system.numerics("names"), columns[:, 0], strict=True)))
    for _ in range(8):
        reach *= _SHRINK
        with suppress(ValueError):
            return int(count_eigenvalues(one, reach)), reach
    return None, reach


def _by_newton(system: System, columns: Array, guesses: Complex, tolerance: float) -> Settled:
    """Return guesses refined on the exact problem; there must be no other eigenvalue below the last of them.

    Where coefficients vary along x, two step sizes must agree.
    """
    spatial: SpatialProblem = system.numerics("driven_spatial")
    squared = not system.numerics("damped")
    halvings = HALVINGS if spatial.uniform else max(GeneralRoute(spatial).needed(columns), HALVINGS)
    values, error = guesses, np.full(guesses.shape, np.inf)
    for steps in range(halvings, _MOST_HALVINGS + 1):
        finer = np.empty(guesses.shape, dtype=complex)
        for rows, _, problem in spatial.problems(columns, steps):
            found = refine(problem, values[rows], squared=squared)
            finer[rows] = np.take_along_axis(found, np.argsort(np.abs(found), axis=1, kind="stable"), axis=1)
        if np.isnan(finer).any():
            raise ArithmeticError("eigenvalues: the refinement of a Ritz value did not converge; ask for fewer modes")
        if steps > halvings:
            change = np.abs(finer - values)
            error = np.maximum(change / np.where(change > 0.0, np.abs(finer), 1.0), ROUNDING)
        elif spatial.uniform:
            error[:] = ROUNDING
        values = finer
        if (error <= tolerance).all():
            return Settled(values, error)
    worst = int(error.max(axis=0).argmax())
    raise ValueError(
        f"modes = {guesses.shape[1]}: the relative error of eigenvalue {worst + 1} stays at {error.max():.1g}; "
        f"{cure(float(error.max()))}"
    )
