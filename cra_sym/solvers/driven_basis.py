"""Steady vibration on the stress basis, for stiffnesses that vanish at an end (no dynamic stiffness exists then)."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from .lowest_motions import BasisModes, modal_damping
from .pencil import GeneralContinuum, Reduced, reduced
from .pencil_refine import meshes, sequence

__all__ = ["driven_on_basis"]

Array = NDArray[np.float64]
Complex = NDArray[np.complex128]
_AIMED, _ACCEPTED = 1e-9, 1e-6  # relative difference of the responses on two meshes
_MODES = 10  # for which the first mesh is made
_LANES = 1_000_000  # numbers in the largest array of a chunk


def driven_on_basis(
    problem: GeneralContinuum,
    s: Complex,
    load: Callable[[BasisModes], Array],
    outputs: Callable[[BasisModes], Array],
    *,
    motion: bool = False,
    zeta: float = 0.0,
) -> Complex:
    """Return outputs of the steady motion ``exp(s t)``, shape (outputs, len(s)); infinite at a resonance.

    Parameters
    ----------
    problem : GeneralContinuum
        Of one parameter set.
    s : ndarray of complex, shape (K,)
        1/s.
    load : callable
        ``load(basis)`` returns the force on each coordinate of a basis or, for a motion, the driven displacement per
        unit of each coordinate.
    outputs : callable
        ``outputs(basis)`` returns the rows (outputs, coordinates).
    motion : bool
        Whether the driven displacement is prescribed, with unit amplitude, instead of a force.
    zeta : float
        Modal damping ratio of the structure without dampers.

    Raises
    ------
    ValueError
        If the responses do not converge to 1e-6 under refinement of the mesh.
    """
    ((_, chosen, mesh, _),) = meshes(problem, _MODES, 1e-10)
    found, error = np.empty((0, len(s)), dtype=complex), np.full(len(s), np.inf)
    open_, before, size = np.arange(len(s)), None, 0
    for finer in sequence(mesh):
        (one,) = reduced(chosen, finer)
        basis, size = BasisModes(one), one.root_mass.shape[1]
        here = outputs(basis) @ _coordinates(one, s[open_] / one.rate[0], load(basis), motion, zeta)
        if before is None:
            found = here.copy()
        else:
            with np.errstate(invalid="ignore", divide="ignore"):
                largest = np.maximum(np.abs(here).max(axis=0), np.abs(before).max(axis=0))
                change = np.abs(here - before).max(axis=0) / largest
            change = np.where(np.isfinite(change), change, 0.0)  # no response at all, or a resonance
            better = change < error[open_]
            found[:, open_[better]], error[open_[better]] = here[:, better], change[better]
            open_, here = open_[change > _AIMED], here[:, change > _AIMED]
        before = here
        if not len(open_):
            break
    worst = float(error.max(initial=0.0))
    if worst > _ACCEPTED:
        raise ValueError(
            f"angular_frequency: the response converges to {worst:.1g} only, on {size} coordinates; lower it"
            + (" or zeta, or set damping='structural'" if zeta else "")
            + ". A force has no finite response where a stiffness vanishes"
        )
    return found


def _coordinates(one: Reduced, s: Complex, load: Array, motion: bool, zeta: float) -> Complex:
    """Return the coordinates of the basis (k, K) for s in units of the rate."""
    k, strong = one.root_mass.shape[1], one.constants[0]
    stiffness, damping, mass = one.stiffness[0], one.damping[0] + modal_damping(one, zeta), one.root_mass[0] ** 2
    pull = one.directions[0] * np.sqrt(np.minimum(strong, 1.0))  # their forces are unknowns
    g = slice(k, k + len(strong))
    size = k + len(strong) + motion
    force = np.zeros((size, 1))
    if motion:
        force[-1] = 1.0
    else:
        force[:k, 0] = load
    found = np.full((k, len(s)), np.inf, dtype=complex)
    for part in np.array_split(np.arange(len(s)), max(1, len(s) * size**2 // _LANES)):
        at = s[part][:, None, None]
        matrix = np.zeros((len(part), size, size), dtype=complex)
        matrix[:, :k, :k] = stiffness + at * damping + at**2 * np.diag(mass)
        matrix[:, :k, g], matrix[:, g, :k], matrix[:, g, g] = at * pull, pull.T, -np.diag(1.0 / np.maximum(strong, 1.0))
        if motion:
            matrix[:, :k, -1] = matrix[:, -1, :k] = load
        found[:, part] = _solved(matrix, force)[:, :k, 0].T
    return found


def _solved(matrix: Complex, force: Array) -> Complex:
    """Return the solutions, infinite where a resonance is met to the last digit."""
    try:
        return np.asarray(np.linalg.solve(matrix, force.astype(complex)))
    except np.linalg.LinAlgError:
        if len(matrix) == 1:
            return np.full((1, *force.shape), np.inf, dtype=complex)
        half = len(matrix) // 2
        return np.concatenate([_solved(matrix[:half], force), _solved(matrix[half:], force)])
