"""Rounding error of frequencies by a heavy mass on a lever arm, where a matrix contains the sum of its terms."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from cra_sym.model.routes import GeneralRoute
from cra_sym.model.stress_route import StressRoute
from cra_sym.model.values import flat_columns
from cra_sym.solvers.stress_refine import cure

if TYPE_CHECKING:
    from cra_sym.model.routes import Route
    from cra_sym.model.system import System

__all__ = ["end_mass_rounding"]

Array = NDArray[np.float64]
_EPS = float(np.finfo(float).eps)
_COUPLED = 1e-3  # least eigenvalue of a mass matrix with unit diagonal above which at most three digits cancel
_ROUGH = 1e-4  # tolerance of the modes from which the error is estimated
_ALONE = 1.0 - 1e-12  # the same above which no masses are coupled


def end_mass_rounding(system: System, route: Route, omega: Array) -> Array:
    """Return the relative error of frequencies by rounding of the end masses, the largest of each parameter set.

    A mass m at a distance e from the end adds ``m (v + e v')^2`` to the kinetic energy, in which a mode that leaves a
    heavy mass at rest has ``v`` near ``-e v'``: the terms ``m v^2``, ``2 m e v v'`` and ``m e^2 v'^2`` cancel, and
    their rounding errors remain. Relative to the modal mass, which is one, they are up to
    ``eps sum_ij |q_i M_ij q_j|``, and omega changes by half of that (Rayleigh's quotient).

    Closed forms do not add up a matrix: zero for these.

    Parameters
    ----------
    system : System
    route : Route
    omega : ndarray, shape (..., modes)
        Its frequencies, rad/s.

    Returns
    -------
    ndarray, shape (...)

    Raises
    ------
    ValueError
        If it is beyond the tolerance of the system.
    """
    if not isinstance(route, (GeneralRoute, StressRoute)):
        return np.zeros(system.shape)
    spatial, columns = system.numerics("spatial"), flat_columns(system.parameters, system.shape)
    finite, sets = np.where(np.isinf(columns), 0.0, columns), columns.shape[1]
    slope = spatial.boundary(np.zeros(sets), *finite)[1]
    mass = np.abs(np.broadcast_to(slope, (sets, *slope.shape[-2:])))
    size = np.sqrt(np.diagonal(mass, axis1=1, axis2=2))
    unit = -slope / np.where(size > 0.0, size, 1.0)[:, :, None] / np.where(size > 0.0, size, 1.0)[:, None, :]
    unit += np.where(size > 0.0, 0.0, 1.0)[:, :, None] * np.eye(mass.shape[1])
    least = np.linalg.eigvalsh(unit)[:, 0]
    if not (least < _COUPLED).any():
        return np.where(least < _ALONE, _EPS / _COUPLED, 0.0).reshape(system.shape)
    modes = route.estimated_modes(system.parameters, system.shape, omega, _ROUGH)
    n, m = system.numerics("sizes")
    moved = [modes.displacement(0, i) for i in range(n)] + [modes.coordinate(j) for j in range(m)]
    moved += [modes.displacement(1, i) for i in range(n)]
    q = np.abs(np.stack(moved, axis=-1)).reshape(sets, -1, len(mass[0]))
    terms = np.einsum("rki,rij,rkj->rk", q, mass, q)
    error = 0.5 * _EPS * terms.max(axis=1, initial=0.0)
    if (error > system.tolerance).any():
        worst = float(error.max())
        raise ValueError(
            f"modes = {omega.shape[-1]}: the relative error of a frequency may be {worst:.1g}, by rounding of "
            f"a heavy mass on a lever arm; {cure(worst)}; essential=[..] that holds the point of that mass avoids it"
        )
    return np.asarray(error).reshape(system.shape)
