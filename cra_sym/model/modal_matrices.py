"""The matrices of a system between modes that are always real: with dampers, gyroscopic and follower forces too."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from cra_sym.model.projection import Form, Projected

if TYPE_CHECKING:
    from cra_sym.model.system import System

__all__ = ["ModalMatrices", "between_modes", "modal_matrices"]

Array = NDArray[np.float64]
_NOTHING = 3e-14  # of a product of modes that are orthogonal, relative to these modes
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
        C beside the modal damping, and K beside ``omega**2``, if there are such.
    """

    omega: Array
    decay: Array
    damping: Array | None
    stiffness: Array | None


def modal_matrices(system: System, modes: int) -> ModalMatrices:
    """Return the matrices of a system between the first modes of its conservative part."""
    omega = system.conservative_part.natural_frequencies(modes)
    damping, beside = system.numerics("damping"), system.numerics("stiffness_beside")
    return ModalMatrices(
        omega,
        np.asarray(system.zeta)[..., None] * omega,
        None if damping is None else between_modes(system, modes, damping)["damping"],
        None if beside is None else between_modes(system, modes, beside)["stiffness"],
    )


def between_modes(system: System, modes: int, form: Form) -> dict[str, Array]:
    """Return bilinear forms between the first modes of the conservative part, by name."""
    found = Projected(system.domain, system.conservative_part.modes(modes), form)
    return {name: _settled(found[name]) for name in form.names}


def _settled(matrix: Array) -> Array:
    """Return a matrix without entries that are rounding, and its symmetric or skew part alone where it is one."""
    size = np.abs(matrix)
    rows, columns = size.max(axis=-1, keepdims=True), size.max(axis=-2, keepdims=True)
    matrix = np.where(size > _NOTHING * np.sqrt(rows * columns), matrix, 0.0)
    turned = matrix.swapaxes(-1, -2)
    whole = _ROUNDING * size.max(axis=(-2, -1), keepdims=True)
    for sign in (1.0, -1.0):
        if (np.abs(matrix - sign * turned) <= whole).all():
            return np.asarray(0.5 * (matrix + sign * turned))
    return matrix
