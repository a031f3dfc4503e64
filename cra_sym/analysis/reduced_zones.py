"""Zones of instability from two reduced equations, for any damping, gyroscopic forces and oscillating terms."""

from __future__ import annotations

from collections import defaultdict
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cra_sym.analysis.floquet import Matrices, matrices_of
from cra_sym.model.excitations import Parametric
from cra_sym.model.system import System
from cra_sym.solvers.floquet import Oscillation
from cra_sym.solvers.normal_form import Boundary, Expansion, Pair, boundary, eigenpairs

__all__ = ["reduced_zone"]

Array = NDArray[np.float64]


def reduced_zone(
    system: System,
    excitation: Parametric,
    epsilon: Array,
    resonance: tuple[int, int],
    tongue: int,
    modes: int,
    order: int,
) -> tuple[Array, Boundary]:
    """Return the exact resonance and the boundary, shape (...); the second mode is negative for a difference.

    Raises
    ------
    ValueError
        If the system has fewer oscillating modes than the resonance names.
    """
    matrices = matrices_of(system, excitation, modes)
    shape = np.broadcast_shapes(system.shape, excitation.shape, np.shape(epsilon))
    if 0 in shape:
        nothing = np.empty(shape)
        return nothing, Boundary(nothing, nothing, nothing)
    expansion = _expansion(matrices, shape)
    values, right, left = eigenpairs(expansion.still)
    first, second = resonance
    if max(first, abs(second)) > values.shape[1]:
        raise ValueError(f"resonance = {resonance}: only {values.shape[1]} modes of the system oscillate")
    one, other = first - 1, abs(second) - 1
    chosen = [(part[:, one], part[:, other] if second < 0 else part[:, other].conj()) for part in (values, right, left)]
    pair = Pair(*chosen)
    centre = (pair.values[0] - pair.values[1]).imag / tongue
    found = boundary(expansion, pair, tongue, np.broadcast_to(epsilon, shape).ravel(), order)
    return centre.reshape(shape), Boundary(*(np.asarray(part).reshape(shape) for part in found))


def _waves(oscillation: Oscillation) -> dict[int, complex]:
    """Return a cosine or sine in powers of exp(i varpi t)."""
    order, kind, _ = oscillation
    if order == 0:
        return {0: 1.0}
    return {order: 0.5, -order: 0.5} if kind == "cos" else {order: -0.5j, -order: 0.5j}


def _expansion(matrices: Matrices, shape: tuple[int, ...]) -> Expansion:
    """Return the equations of (q, p) in powers of epsilon, the mass inverted to second order."""
    stiffness, damping = matrices.stiffness, matrices.damping
    size = stiffness.shape[-1]
    nothing, unit = np.zeros((size, size)), np.eye(size)

    def whole(a: Any, b: Any, c: Any, d: Any) -> NDArray[Any]:
        parts = np.broadcast_arrays(a, b, c, d, np.empty((*shape, size, size)))[:4]
        rows = [np.concatenate(parts[k : k + 2], axis=-1) for k in (0, 2)]
        return np.concatenate(rows, axis=-2).reshape(-1, 2 * size, 2 * size)

    first: defaultdict[tuple[int, int], Any] = defaultdict(float)
    second: defaultdict[tuple[int, int], Any] = defaultdict(float)
    for drive in matrices.drives:
        k, c, b, m = (nothing if part is None else part for part in drive[1:])
        matrix = whole(-b, -m, damping @ b - k, damping @ m - c)
        for harmonic, share in _waves(drive.oscillation).items():
            key = harmonic, drive.oscillation.power
            first[key] = first[key] + share * matrix
        for other in matrices.drives if drive.mass is not None or drive.damping is not None else ():
            b2, m2 = (nothing if part is None else part for part in (other.momentum, other.mass))
            matrix = whole(m @ b2, m @ m2, c @ b2 - damping @ m @ b2, c @ m2 - damping @ m @ m2)
            for harmonic, share in _waves(drive.oscillation).items():
                for more, part in _waves(other.oscillation).items():
                    power = drive.oscillation.power + other.oscillation.power
                    second[harmonic + more, power] = second[harmonic + more, power] + share * part * matrix
    return Expansion(whole(nothing, unit, -stiffness, -damping), first, second)
