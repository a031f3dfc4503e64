"""Proved stability of systems with periodic coefficients."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cra_sym.analysis.floquet import Matrices, batch_shape, checked_point, matrices_of
from cra_sym.checks import default_floating_point
from cra_sym.model.excitations import Drive, Excitation
from cra_sym.model.routes import ROUNDING
from cra_sym.model.system import System
from cra_sym.si import Numbers
from cra_sym.solvers.floquet import Oscillation, flat
from cra_sym.solvers.periodic import PeriodicSystem
from cra_sym.solvers.proved_stability import STABLE, UNSTABLE, proved_stability

__all__ = ["certify_stability"]


@default_floating_point
def certify_stability(
    system: System, excitation: Excitation, angular_frequency: Numbers, epsilon: Numbers, modes: int = 3
) -> NDArray[np.str_]:
    """Prove whether vibration grows, for each point of a chart.

    The proof is for the model of that many modes, that is for the equations of motion between them, with every
    coefficient within `system.accuracy` of the computed one, 1e-11 at least, relative to the sum of its row. 'stable'
    means that every motion is bounded: all multipliers lie inside the unit circle, or, without any damping, on it and
    apart from each other; a system that moves as a rigid body is therefore not stable. 'unstable' means that a
    multiplier lies outside. On a boundary, and where multipliers meet, a point is 'undecided'. The method is in
    :mod:`cra_sym.solvers.proved_stability`: enclosures of the monodromy matrix by Taylor series with bounds of the
    truncation and rounding errors, and of its multipliers by discs.

    Parameters
    ----------
    system : System
    excitation : Fluctuation, JointStiffness, AxialBase or the model's own `excitation`
        Of stiffnesses, masses, dampers and gyroscopic terms.
    angular_frequency : array_like
        Excitation frequency varpi, rad/s, positive.
    epsilon : array_like
        Not negative.
    modes : int
        Number of modes, 1 to 1000.

    Returns
    -------
    ndarray of str
        'stable', 'unstable' or 'undecided', shape broadcast from system, excitation, angular_frequency and epsilon.

    Raises
    ------
    TypeError, ValueError
        As :func:`cra_sym.growth_rate`.

    Examples
    --------
    >>> from cra_sym import Arm, JointStiffness
    >>> arm = Arm.nominal().replace(k_t=1e4)
    >>> print(certify_stability(arm, JointStiffness(), [186.0, 187.15, 188.0], 0.1))
    ['stable' 'unstable' 'stable']
    """
    given, frequency, epsilon, modes = checked_point(system, excitation, angular_frequency, epsilon, modes)
    shape = batch_shape(system, given, angular_frequency=frequency, epsilon=epsilon)
    matrices = matrices_of(system, given, modes)
    drives = [part for drive in matrices.drives for part in _without_momentum(drive)]
    whole = np.broadcast_to(epsilon, shape)
    batch, _ = PeriodicSystem.of(matrices.stiffness, matrices.damping, drives, frequency, whole)
    omega = matrices.modal.omega
    slowest = np.where(omega > 0, omega, np.maximum(omega.max(axis=-1, keepdims=True), 1.0) * 1e-2)
    unit = slowest.reshape(-1, 1) if slowest.size == modes else flat(slowest, shape, 1)
    spread = float(np.fmax(system.basis.accuracy, ROUNDING).max())
    verdict = proved_stability(batch, unit, _conservative(matrices) or batch.reversible, spread)
    words = np.where(verdict == STABLE, "stable", np.where(verdict == UNSTABLE, "unstable", "undecided"))
    return words.reshape(shape)[()]


def _without_momentum(drive: Drive) -> Iterator[tuple[Oscillation, tuple[Any, ...]]]:
    """Yield the drive without its momentum term: d/dt(g B q) is written as g B q' + g' B q."""
    oscillation, stiffness, damping, momentum, mass = drive
    if momentum is None:
        yield oscillation, (stiffness, damping, None, mass)
    else:
        yield oscillation, (stiffness, momentum if damping is None else momentum + damping, None, mass)
        rate, factor = oscillation.rate()
        yield rate, (factor * momentum, None, None, None)


def _conservative(matrices: Matrices) -> bool:
    """Return whether all forces, oscillating ones included, have a potential or are gyroscopic."""
    still = matrices.damping
    skew = np.array_equal(still, -still.swapaxes(-1, -2))
    for drive in matrices.drives:
        # of the Lagrangian g q' B q come d/dt(g B q) and -g B' q'
        if drive.damping is not None or drive.momentum is not None:
            nothing = np.zeros_like(still)
            damping = nothing if drive.damping is None else drive.damping
            momentum = nothing if drive.momentum is None else drive.momentum
            size = np.abs(damping).max(axis=(-2, -1), keepdims=True)
            skew &= bool((np.abs(damping + momentum.swapaxes(-1, -2)) <= ROUNDING * size).all())
    given = [part for drive in matrices.drives for part in (drive.stiffness, drive.mass) if part is not None]
    return skew and all(np.array_equal(k, k.swapaxes(-1, -2)) for k in (matrices.stiffness, *given))
