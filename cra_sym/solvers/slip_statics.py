"""Modes with elastic-slip elements: their data, and the statics of the elements.

An element is a spring in series with a slider: it sticks below the slip force, and slips with that force.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from .slip_polynomials import Polynomial

__all__ = ["SlippingModes", "applied", "first_forces", "stuck_tangent", "tangent_stiffness"]

Array = NDArray[np.float64]


class SlippingModes(NamedTuple):
    """Modes q'' + D q' + omega^2 q = loads - rows' F, mass-normalised, with elastic-slip elements on displacements.

    The displacements are u = rows q - give F, F the sum of the forces of the elements on each.

    Attributes
    ----------
    omega : ndarray, shape (N, P)
    damping : ndarray, shape (N, P) or (N, N, P)
        D, of modal damping 2 zeta omega its diagonal.
    rows : ndarray, shape (D, N, P)
        Displacements in each mode.
    give : ndarray, shape (D, D, P)
        Static flexibility of the omitted modes.
    where : ndarray of int, shape (E,)
        The displacement of each element.
    stiffness, slip : ndarray, shape (E, P)
    polynomials : tuple of Polynomial
        Further forces on the right.
    """

    omega: Array
    damping: Array
    rows: Array
    give: Array
    where: NDArray[np.intp]
    stiffness: Array
    slip: Array
    polynomials: tuple[Polynomial, ...] = ()

    def of(self, members: NDArray[np.intp]) -> SlippingModes:
        """Return some members."""
        omega, damping, rows, give, where, stiffness, slip, polynomials = self
        parts = (omega[:, members], damping[..., members], rows[..., members], give[..., members])
        terms = tuple(term.of(members) for term in polynomials)
        return SlippingModes(*parts, where, stiffness[:, members], slip[:, members], terms)

    def total(self, values: Array) -> Array:
        """Return the sums over the elements of each displacement, (E, P) to (D, P)."""
        if len(self.rows) == 1:
            return np.asarray(values.sum(axis=0, keepdims=True))
        return np.stack([values[self.where == d].sum(axis=0) for d in range(len(self.rows))])

    def given(self, totals: Array) -> Array:
        """Return the static displacements (..., D, P) of the omitted modes under forces."""
        return np.asarray(np.einsum("efp,...fp->...ep", self.give, totals))


def tangent_stiffness(modes: SlippingModes, state: NDArray[np.int8]) -> Array:
    """Return the tangent stiffness of the forces with respect to `rows q`: only sticking elements contribute."""
    k = modes.total(np.where(state == 0, modes.stiffness, 0.0))
    if len(k) == 1:
        return np.asarray(k / (1.0 + k * modes.give[0]))[None]
    # F = k (rows q - give F)
    stiff = np.einsum("dp,de->pde", k, np.eye(len(k)))
    matrix = np.eye(len(k)) + stiff @ np.moveaxis(modes.give, -1, 0)
    return np.asarray(np.moveaxis(np.linalg.solve(matrix, stiff), 0, -1))


def stuck_tangent(modes: SlippingModes) -> Array:
    """Return the tangent stiffness of the forces with respect to `rows q` with all elements stuck, (D, D, P)."""
    return tangent_stiffness(modes, np.zeros(modes.slip.shape, np.int8))


def applied(matrix: Array, values: Array) -> Array:
    """Return the product of the matrix of each member, (D, D, P), with its values (D, P)."""
    return np.asarray(matrix[0] * values if len(values) == 1 else np.einsum("efp,fp->ep", matrix, values))


def first_forces(modes: SlippingModes, q: Array) -> Array:
    """Return the forces of the elements at displacements reached in one loading, from sliders at zero, (E, P)."""
    state, force = np.zeros(modes.slip.shape, np.int8), np.zeros(modes.slip.shape)
    for _ in range(len(state) + 1):
        held = modes.total(np.where(state != 0, force, 0.0))
        free = (modes.rows * q).sum(axis=1) - modes.given(held)
        moved = free - modes.given(applied(tangent_stiffness(modes, state), free))
        force = np.where(state == 0, modes.stiffness * moved[modes.where], force)
        beyond = (state == 0) & (np.abs(force) > modes.slip)
        if not beyond.any():
            break
        state = np.where(beyond, np.sign(force), state).astype(np.int8)
        force = np.where(beyond, state * modes.slip, force)
    return force
