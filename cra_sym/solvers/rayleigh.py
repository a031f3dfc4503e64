"""Rayleigh-Ritz values of computed mode shapes: full relative accuracy for frequencies far below those of the beam.

A soft joint moves the arm almost rigidly. Its frequency drowns in the rounding of the static stiffness, but the forces
in the computed shape do not: strain energy taken from the forces has no cancellation.
"""

from __future__ import annotations

import numpy as np

from .shapes import mode_states
from .stiffness import DynamicStiffness

__all__ = ["ritz_values"]

_POINTS, _WEIGHTS = np.polynomial.legendre.leggauss(10)


def ritz_values(problem: DynamicStiffness, z: np.ndarray) -> np.ndarray:
    """Return strain over kinetic energy, minimised over the span of the modes with the given approximate roots.

    Parameters
    ----------
    problem : DynamicStiffness
    z : ndarray, shape (rows, modes)

    Returns
    -------
    ndarray, shape (rows, modes)
        omega^2, ascending.
    """
    strain, kinetic = _energies(problem, z)
    frame = np.linalg.inv(np.linalg.cholesky(kinetic))
    return np.linalg.eigvalsh(frame @ strain @ np.swapaxes(frame, -1, -2))


def _energies(problem: DynamicStiffness, z: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the matrices of strain and kinetic energy of the modes, integrated panel by panel."""
    n, m = problem.displacements, problem.coordinates
    every = np.arange(len(z))
    reference = z[:, -1]
    system, slope = problem.system(reference, every)
    radius = np.abs(np.linalg.eigvals(system)).max(initial=0.0, axis=-1) * problem.length
    panels = int(np.ceil(radius.max())) + 1
    fraction = ((np.arange(panels)[:, None] + 0.5 * (1.0 + _POINTS)) / panels).ravel()
    stations = problem.length[:, None] * np.concatenate([[0.0], fraction, [1.0]])
    weight = problem.length[:, None] * np.tile(0.5 * _WEIGHTS / panels, panels)
    state = mode_states(problem, z, stations)
    inner = state[:, :, 1:-1]
    strain_density, kinetic_density = _energy_densities(system, slope, reference, n, m)
    end, end_slope = problem.boundary(reference, every)
    edge = np.concatenate([state[:, :, 0, : n + m], state[:, :, -1, :n]], axis=-1)
    strain, kinetic = (
        np.einsum("rs,risa,rab,rjsb->rij", weight, inner, density, inner, optimize=True)
        + np.einsum("ria,rab,rjb->rij", edge, ends, edge)
        for density, ends in (
            (strain_density, end - reference[:, None, None] * end_slope),
            (kinetic_density, -end_slope),
        )
    )
    return strain, kinetic


def _energy_densities(system, slope, z, n: int, m: int) -> tuple[np.ndarray, np.ndarray]:
    """Return the quadratic forms of strain and kinetic energy density in (q, w, P).

    With H = P q' - (U - z T) and A = [[H_P], [-H_q]]: T = dH/dz, and U = P H_P - H + z T.
    """
    force = slice(n + m, 2 * n + m)
    stiff = np.zeros((len(z), 2 * n + m, 2 * n + m))
    inertia = np.zeros_like(stiff)
    inertia[:, : n + m, : n + m] = -slope[:, n + m :, : n + m]
    inertia[:, force, force] = slope[:, :n, force]
    inertia[:, force, : n + m] = slope[:, :n, : n + m]
    inertia[:, : n + m, force] = np.swapaxes(slope[:, :n, : n + m], -1, -2)
    stiff[:, : n + m, : n + m] = system[:, n + m :, : n + m]
    stiff[:, force, force] = system[:, :n, force]
    return stiff + z[:, None, None] * inertia, inertia
