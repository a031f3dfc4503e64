"""Matrices of a system between the real modes of its conservative part: dampers, gyroscopic and follower forces."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from cra_sym.model.projection import BilinearForm, Projected

if TYPE_CHECKING:
    from cra_sym.model.system import System

__all__ = ["ModalMatrices", "between_modes", "modal_matrices"]

Array = NDArray[np.float64]
_NOTHING = 3e-14  # largest entry between orthogonal modes that is set to zero, relative to these modes
_ROUNDING = 1e-12  # of an integral along the span, relative to the largest entry


class ModalMatrices(NamedTuple):
    """The equations ``q'' + C q' + K q = 0`` between the modes of the conservative part, of unit mass.

    Attributes
    ----------
    omega : ndarray, shape (..., modes)
        Natural frequencies of the conservative part, rad/s.
    decay : ndarray, shape (..., modes)
        Decay rates of the modal damping, 1/s.
    damping, stiffness : ndarray, shape (..., modes, modes), or None
        C without the modal damping, and K without ``omega**2``; None if they are zero.
    """

    omega: Array
    decay: Array
    damping: Array | None
    stiffness: Array | None


def modal_matrices(system: System, modes: int) -> ModalMatrices:
    """Return the matrices of a system between the first modes of its conservative part."""
    omega = system.basis.natural_frequencies(modes)
    damping, beside = system.numerics("damping"), system.stiffness_beside
    return ModalMatrices(
        omega,
        np.asarray(system.zeta)[..., None] * omega,
        None if damping is None else between_modes(system, modes, damping)["damping"],
        None if beside is None else between_modes(system, modes, beside)["stiffness"],
    )


def between_modes(system: System, modes: int, form: BilinearForm) -> dict[str, Array]:
    """Return bilinear forms between the first modes of the conservative part, by name."""
    found = Projected(system.domain, system.basis.modes(modes), form)
    matrices = {name: _without_rounding(found[name]) for name in form.names}
    if {"damping", "momentum"} <= matrices.keys():  # a gyroscopic term: one is minus the other transposed
        matrices["damping"] = _alike(matrices["damping"], matrices["momentum"].swapaxes(-1, -2))
    return matrices


def _alike(matrix: Array, other: Array) -> Array:
    """Return the other matrix, or minus it, where they agree to rounding."""
    whole = _ROUNDING * np.abs(matrix).max(axis=(-2, -1), keepdims=True)
    for sign in (1.0, -1.0):
        if (np.abs(matrix - sign * other) <= whole).all():
            return sign * other
    return matrix


def _without_rounding(matrix: Array) -> Array:
    """Set entries below rounding to zero, and make a matrix that is symmetric or skew to rounding exactly so."""
    size = np.abs(matrix)
    rows, columns = size.max(axis=-1, keepdims=True), size.max(axis=-2, keepdims=True)
    matrix = np.where(size > _NOTHING * np.sqrt(rows * columns), matrix, 0.0)
    turned = matrix.swapaxes(-1, -2)
    alike = _alike(matrix, turned)
    return matrix if alike is matrix else 0.5 * (matrix + alike)
