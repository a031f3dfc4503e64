"""Proved natural frequencies and eigenvalues: enclosures in ball arithmetic with a proof that none is missed."""

from __future__ import annotations

import math
from contextlib import suppress
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cra_sym.analysis.eigenvalues import eigenvalues
from cra_sym.checks import ByValue, count, default_floating_point, instance
from cra_sym.extras import require
from cra_sym.model.ball_problem import BoundProblem, bound
from cra_sym.model.system import MOST_MODES, System
from cra_sym.solvers.ball_determinant import BallDeterminant
from cra_sym.solvers.ball_spans import multiplicity, static_solutions
from cra_sym.solvers.ball_stiffness import BallStiffness
from cra_sym.solvers.certificates import UndecidedError, enclose, outward, precision
from cra_sym.solvers.eigenvalue_enclosures import AmbiguousError, CharacteristicProblem, Eigenvalue, first_eigenvalues

__all__ = ["Certificate", "EigenvalueCertificate", "certify", "certify_eigenvalues"]

_ROUGH = 1e-4  # tolerance of guesses
_MORE, _MOST = 8, 200  # eigenvalues beyond those asked for, the nearest of which bounds the circle; guesses at most


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


@dataclass(frozen=True, eq=False)
class EigenvalueCertificate(ByValue):
    """Proved enclosures of complex eigenvalues.

    Attributes
    ----------
    lower, upper : ndarray of complex, shape (..., modes)
        rad/s, opposite corners of a rectangle, rounded outward: real and imaginary part of the eigenvalue of the
        system, its parameters taken as the exact values of their floating-point numbers, lie between those of the two.
        Parts that are proved to be 0 are 0 in both; nan where nothing is proved.
    complete : ndarray of bool, shape (...)
        Whether every enclosure of the system is proved to hold its eigenvalue, with none of smaller modulus left out.
        Equal eigenvalues share an enclosure.
    """

    lower: NDArray[np.complex128]
    upper: NDArray[np.complex128]
    complete: NDArray[np.bool_]


@default_floating_point
def certify(system: System, modes: int = 3) -> Certificate:
    """Prove the first natural frequencies of a system with coefficients that are constant along x; (23) and (30).

    Between interior places the coefficients must be constant; at these they may jump, and terms act.

    The number of frequencies below a point is that of the negative eigenvalues of its dynamic stiffness, and of the
    parts that are eliminated on the way, each proved in ball arithmetic. Two such numbers for each frequency prove its
    enclosure and the completeness of the set. So it is also with gyroscopic terms and a potential energy that is
    positive definite. Of all other systems without natural modes the frequencies are the imaginary parts of the
    eigenvalues, over 2 pi, as :func:`certify_eigenvalues` proves them; dampers alone are left out, as they are by
    :func:`natural_frequencies`.

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
        If ``system`` is not a :class:`System`, ``modes`` not an integer from 1 to 1000, the coefficients of the model
        vary along x between places, or one is a function that ball arithmetic lacks; and as
        :func:`natural_frequencies` and :func:`eigenvalues`.
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
    natural = system.conservative_part is system
    guesses = np.asarray(1j * system.natural_frequencies(modes)) if natural else _guesses(system, modes)
    ends, complete = _proved(system, guesses, damped=not natural, hertz=True)
    lower, upper = ends.imag
    return Certificate(lower, upper, complete)


@default_floating_point
def certify_eigenvalues(system: System, modes: int = 3, *, oscillating: bool = True) -> EigenvalueCertificate:
    """Prove the first complex eigenvalues of a system with coefficients that are constant along x.

    Between interior places the coefficients must be constant; at these they may jump, and terms act. Dampers,
    gyroscopic forces and forces that follow the motion are included.

    The eigenvalues are the zeros of a determinant. Within a circle it is a polynomial and a rest that is bounded; discs
    about the zeros of the polynomial are proved to hold as many of the determinant, and the winding number along the
    circle, in ball arithmetic, proves that there are no others. See :mod:`cra_sym.solvers.enclosed_zeros`.

    Parameters
    ----------
    system : System
        Any values, arrays too.
    modes : int
        How many, 1 to 1000.
    oscillating : bool
        Leave out real eigenvalues, as :func:`eigenvalues` does, which has the same order: ascending modulus, one of
        each conjugate pair; of equal moduli the larger real part first.

    Returns
    -------
    EigenvalueCertificate
        Enclosures at most a few units in the last place of the modulus wide.

    Raises
    ------
    TypeError, ValueError
        If ``system`` is not a :class:`System`, ``modes`` not an integer from 1 to 1000, the coefficients of the model
        vary along x between places, or one is a function that ball arithmetic lacks; with internal damping also if
        moduli reach the one at which eigenvalues accumulate; and as :func:`eigenvalues`.
    MissingExtraError
        If python-flint is not installed (extra ``certify``).

    Examples
    --------
    A string that is held by a damper at its right end, ``tanh(s) = -1 / c``:

    >>> import cra_sym as cra
    >>> from sympy import Symbol
    >>> from cra_sym.symbols import L, t, v, x
    >>> c, end = Symbol("c"), v.subs(x, L)
    >>> string = cra.Model(v.diff(t)**2 / 2 - v.diff(x)**2 / 2, fields=[v], x=x, domain=(0, L), t=t,
    ...                    essential=[v.subs(x, 0)], virtual_work=[(-c * v.diff(t), v, "right")])
    >>> proof = cra.certify_eigenvalues(string.at({L: 1.0, c: 0.1}), 2)
    >>> bool(proof.complete), proof.lower.round(6)
    (True, array([-0.100335+1.570796j, -0.100335+4.712389j]))
    """
    instance("system", system, System)
    modes = count("modes", modes, high=MOST_MODES)
    instance("oscillating", oscillating, bool)
    guesses = _guesses(system, modes, oscillating)
    (lower, upper), complete = _proved(system, guesses, damped=True, oscillating=oscillating)
    return EigenvalueCertificate(lower, upper, complete)


def _proved(
    system: System, guesses: NDArray[np.complex128], *, damped: bool, oscillating: bool = True, hertz: bool = False
) -> tuple[NDArray[np.complex128], NDArray[np.bool_]]:
    """Return proved lower and upper ends of eigenvalues, in rad/s or in Hz, and whether the set is complete.

    Parameters
    ----------
    system : System
    guesses : ndarray of complex, shape (..., modes)
    damped : bool
        Whether dampers are part of the problem.
    oscillating : bool
    hertz : bool
        Whether they are over 2 pi.
    """
    flint, modes = require("flint", "certify"), guesses.shape[-1]
    held, names = system.numerics("stiffnesses"), system.numerics("names")
    values = np.broadcast_arrays(*system.parameters, np.empty(system.shape))[:-1]
    near = _neighbours(system, guesses)
    ends, complete = np.full((2, *guesses.shape), complex(np.nan, np.nan)), np.zeros(system.shape, dtype=bool)
    for index in np.ndindex(system.shape):
        given = dict(zip(names, (float(value[index]) for value in values), strict=True))
        problem = bound(flint, system.numerics, held, given, damped)
        try:
            found = _by_count(flint, problem, guesses[index]) or first_eigenvalues(
                _characteristic(flint, problem), modes, oscillating, float(np.abs(guesses[index]).max()), near[index]
            )
        except (UndecidedError, AmbiguousError):
            continue
        assert len(found) == modes
        with precision(flint, 128):
            scale = 2 * flint.arb.pi() if hertz else flint.arb(1)
            for side, towards in enumerate((-np.inf, np.inf)):
                ends[side][index] = [
                    complex(outward(one.real / scale, towards), outward(one.imag / scale, towards)) for one in found
                ]
        complete[index] = True
    return ends, complete


def _guesses(system: System, modes: int, oscillating: bool = True) -> NDArray[np.complex128]:
    """Return eigenvalues, of low accuracy if a higher one is not reached, or else those that oscillate."""
    try:
        return np.asarray(eigenvalues(system, modes, oscillating=oscillating))
    except (ValueError, ArithmeticError):
        rough = system.replace(tolerance=_ROUGH)
        for kind in dict.fromkeys((oscillating, True)):
            with suppress(ValueError, ArithmeticError):
                return np.asarray(eigenvalues(rough, modes, oscillating=kind))
        raise


def _neighbours(system: System, guesses: NDArray[np.complex128]) -> NDArray[np.complex128]:
    """Return guesses of eigenvalues of both kinds, some more than given, if there are as many."""
    if system.numerics("conservative"):
        return guesses
    near, number, largest = guesses, guesses.shape[-1] + _MORE, np.abs(guesses).max(axis=-1)
    rough = system.replace(tolerance=_ROUGH)  # a copy, whose accuracy is its own
    with suppress(ValueError, ArithmeticError):
        near = np.asarray(eigenvalues(rough, number, oscillating=False))
        while number < _MOST and not (np.abs(near).max(axis=-1) > largest).all():  # many real ones come first
            number *= 2
            near = np.asarray(eigenvalues(rough, number, oscillating=False))
    return near


def _by_count(flint: Any, problem: BoundProblem, guesses: NDArray[np.complex128]) -> list[Eigenvalue] | None:
    """Return eigenvalues i omega, proved by numbers of frequencies; None if these are not known."""
    gyroscopic = problem.problem.gyroscopic
    if not (problem.problem.conservative or gyroscopic):
        return None
    zeros = static_solutions(flint, problem.exact)
    counted = BallStiffness(flint, problem.balls, zeros, gyroscopic)
    try:
        if gyroscopic and (zeros or counted.count(flint.arb(0))):
            return None
        found = enclose(flint, counted, guesses.imag / (2 * math.pi))
    except UndecidedError:
        if gyroscopic:
            return None
        raise
    with precision(flint, 128):
        return [Eigenvalue(flint.arb(0), low.union(high) * 2 * flint.arb.pi(), True) for low, high in found]


def _characteristic(flint: Any, problem: BoundProblem) -> CharacteristicProblem:
    """Return the problem with its motions at s = 0, each the beginning of a Jordan chain."""
    of, exact = problem.problem, problem.exact
    rigid = static_solutions(flint, exact)
    at_zero = multiplicity(flint, exact, rigid)
    determinant = BallDeterminant(flint, problem.balls)
    signature = BallStiffness(flint, problem.balls, rigid).signature if of.dissipative else None

    def at(point: Any) -> int:
        shifted = exact.shifted(point)
        return multiplicity(flint, shifted, static_solutions(flint, shifted))

    return CharacteristicProblem(
        flint, determinant, of.squared, of.gyroscopic or exact.even, rigid, at_zero, at, signature
    )
