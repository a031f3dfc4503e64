"""Complex eigenvalues of a system with dampers."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from cra_sym.checks import count, default_floating_point, instance
from cra_sym.model.system import MOST_MODES, System
from cra_sym.model.values import flat_columns
from cra_sym.solvers.eigenvalues import refine

__all__ = ["damping_ratios", "eigenvalues"]


@default_floating_point
def eigenvalues(system: System, modes: int = 3, *, oscillating: bool = True) -> NDArray[np.complex128]:
    """Return complex eigenvalues s (rad/s) of motions ``exp(s t)``, dampers included, one of each conjugate pair.

    They are guessed by the Ritz matrices and refined on the exact problem. That none is missing is promised only
    without dampers, where ``s = i omega``. Modal damping (zeta) is left out.

    Parameters
    ----------
    system : System
    modes : int
    oscillating : bool
        Leave out real eigenvalues, of motions that decay without oscillating: Kelvin-Voigt damping has infinitely
        many, which crowd at minus one over the retardation time.

    Returns
    -------
    ndarray of complex, shape (..., modes)
        By ascending modulus.

    Raises
    ------
    ArithmeticError
        If a refinement does not settle.
    """
    instance("system", system, System)
    modes = count("modes", modes, high=MOST_MODES)
    if system.numerics("conservative"):
        return np.asarray(1j * system.natural_frequencies(modes))
    ritz = system.model.ritz(2 * modes + 10)
    guesses = ritz.eigenvalues(system.values, modes, oscillating=oscillating).reshape(-1, modes)
    columns, squared = flat_columns(system.parameters, system.shape), not system.numerics("damped")
    guesses = np.broadcast_to(guesses, (columns.shape[1], modes))
    roots = np.empty(guesses.shape, dtype=complex)
    for rows, _, problem in system.numerics("damped_spatial").problems(columns):
        found = refine(problem, guesses[rows], squared=squared)
        if np.isnan(found).any():
            raise ArithmeticError("eigenvalues: the refinement of a Ritz value did not settle; ask for fewer modes")
        roots[rows] = np.take_along_axis(found, np.argsort(np.abs(found), axis=1, kind="stable"), axis=1)
    return roots.reshape(*system.shape, modes)


@default_floating_point
def damping_ratios(system: System, modes: int = 3) -> NDArray[np.float64]:
    """Return ``-Re s / |s|`` of the :func:`eigenvalues`, zero for a rigid motion, shape (..., modes)."""
    s = eigenvalues(system, modes)
    return -s.real / np.where(s == 0.0, 1.0, np.abs(s))
