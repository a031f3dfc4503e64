"""Free vibration about an offset of modes whose elastic-slip elements stick for all later times."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from .slip_statics import SlippingModes, stuck_tangent

__all__ = ["stuck_peak"]

Array = NDArray[np.float64]


def stuck_peak(modes: SlippingModes, state: Sequence[Array], row: Array) -> Array:
    """Return a bound of an output from a state on while the elements stick: the sum of the offset and the modal peaks.

    Without damping it is the least upper bound over all times where the frequencies are incommensurable.

    Parameters
    ----------
    modes : SlippingModes
    state : sequence of ndarray: (N, P), (N, P), (E, P)
        Modal displacements, velocities and forces of the elements.
    row : ndarray, shape (N, P)

    Returns
    -------
    ndarray, shape (P,)

    Raises
    ------
    ValueError
        If the elements leave a rigid-body mode free, so that there is no offset to vibrate about.
    """
    q, u, force = (np.moveaxis(part, -1, 0)[..., None] for part in (state[0], state[1], modes.total(state[2])))
    rows, tangent = np.moveaxis(modes.rows, -1, 0), np.moveaxis(stuck_tangent(modes), -1, 0)
    size = modes.omega.shape[0]
    stiff = np.einsum("np,nm->pnm", modes.omega**2, np.eye(size)) + rows.swapaxes(1, 2) @ tangent @ rows
    drag = modes.damping
    drag = np.einsum("np,nm->pnm", drag, np.eye(size)) if drag.ndim == 2 else np.moveaxis(drag, -1, 0)
    if (np.linalg.cond(stiff) > 1e14).any():
        raise ValueError("system: a rigid-body mode stays free while the elements stick; its motion has no peak")
    offset = np.linalg.solve(stiff, -rows.swapaxes(1, 2) @ (force - tangent @ rows @ q))
    system = np.zeros((len(stiff), 2 * size, 2 * size))
    system[:, :size, size:] = np.eye(size)
    system[:, size:, :size], system[:, size:, size:] = -stiff, -drag
    values, vectors = np.linalg.eig(system)
    shares = np.linalg.solve(vectors, np.concatenate([q - offset, u], axis=1) + 0j)[..., 0]
    along = row.T[:, None, :]
    swings = (along @ vectors[:, :size])[:, 0] * shares
    with np.errstate(divide="ignore", invalid="ignore"):
        quarter = np.sign(values.imag) * (np.pi / 2 - np.angle(swings * values))
        turn = np.mod(quarter, np.pi) / np.abs(values.imag)
        turned = np.abs((swings * np.exp(values * turn)).real)
    waves = values.imag != 0  # one of each conjugate pair
    peaks = np.where(waves, np.maximum(np.abs(swings.real), turned), np.abs(swings))
    return np.asarray(np.abs(along @ offset)[:, 0, 0] + peaks.sum(axis=1))
