"""Neighbouring low modes whose frequencies nearly coincide: Rayleigh-Ritz values keep digits a determinant loses.

A heavy end-effector on a soft joint moves as a rigid body, along and about itself. Tuned alike, the two motions have
frequencies as close as their coupling is weak, and zeros of the determinant at a relative distance g are known to
eps / g only. The energies of the two motions have no such loss.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from cra_sym.model.one_wave_family import Family
from cra_sym.solvers.one_wave import Layout, parameters, power, wave_number
from cra_sym.solvers.one_wave_shapes import derivatives, near_shape
from cra_sym.solvers.rayleigh import stationary_values

__all__ = ["CLOSE", "resolve_close_pairs"]

Array = NDArray[np.float64]
CLOSE = 0.1
"""Relative distance of two frequency parameters below which their zeros are replaced by Rayleigh-Ritz values."""

_POINTS, _WEIGHTS = np.polynomial.legendre.leggauss(12)  # exact to rounding up to z of 5, where all such pairs lie
_XI = np.append((1 + _POINTS) / 2, 1.0)[:, None]
_ALMOST_RIGID = 5.0
_SOFT = 10.0  # springs of the other end that are stiffer leave rounding errors larger than what is corrected


def resolve_close_pairs(family: Family, lam: Array, *groups: Array) -> None:
    """Correct, in place, low frequency parameters of every beam in which two neighbours lie close to each other.

    Parameters
    ----------
    family : Family
    lam : ndarray, shape (..., modes), contiguous
        Ascending frequency parameters.
    groups : ndarray, shape (...)
    """
    layout = family.layout
    if layout.n != 2 or lam.shape[-1] < 2 or not groups:
        return
    rows = lam.reshape(-1, lam.shape[-1])
    flat = [value.reshape(-1) for value in groups]
    base = int(not _is_sprung(layout, 0) and _is_sprung(layout, 1))
    for lower in range(min(rows.shape[1] - 1, layout.most_near - 1)):
        low, high = rows[:, lower], rows[:, lower + 1]
        close = np.flatnonzero((low > (1 - CLOSE) * high) & (power(high, 2) < _ALMOST_RIGID))
        close = close[~_is_stiff(layout, 1 - base, [value[close] for value in flat], close.size)]
        for mode in (lower, lower + 1) if close.size else ():
            z = power(rows[close, mode], 2)
            ritz = _ritz_values(family, base, z, [value[close] for value in flat])
            near = np.abs(ritz - z[:, None]) < CLOSE * z[:, None]
            wanted = ritz[:, mode - lower]
            rows[close, mode] = np.where(near.all(axis=1), wave_number(wanted, 2), rows[close, mode])


def _is_sprung(layout: Layout, end: int) -> bool:
    return any("k" in kind or kind == "h" for kind in layout.structure[end])


def _is_stiff(layout: Layout, end: int, groups: list[Array], lanes: int) -> Array:
    """Return where an end has a support or a stiff spring."""
    found = np.full(lanes, "h" in layout.structure[end])
    for (channel, letter), value in zip(layout.groups, groups, strict=True):
        if letter == "k" and channel // 2 == end:
            found |= value > _SOFT
    return found


def _ritz_values(family: Family, base: int, z: Array, groups: list[Array]) -> Array:
    """Return both stationary values of strain over kinetic energy among the solutions that meet one end's conditions.

    Those for the given z hold the mode up to the error of z, which enters squared.
    """
    layout = family.layout
    given = {name: row for name, row in zip(layout.parameters, parameters(layout, groups), strict=True)}
    known = dict(zip(layout.groups, groups, strict=True))
    state = np.zeros((4, 2, z.size))
    strain, kinetic = np.zeros((2, z.size, 2, 2))
    for j, kind in enumerate(layout.structure[base]):
        s, i, c = (given.get((2 * base + j, letter), np.zeros_like(z)) for letter in "sic")
        s, c = s + float(kind == "h"), c + float(kind == "")
        state[j, j], state[2 + j, j] = c, s - z * i
        strain[:, j, j], kinetic[:, j, j] = s * c, i * c
    start = derivatives(state, 2)[:, :, None]
    shapes = [near_shape(start, z, _XI, order, family.functions) for order in range(3)]

    def integral(shape: Array) -> Array:
        return np.einsum("apn,bpn,p->nab", shape[:, :-1], shape[:, :-1], _WEIGHTS / 2)

    strain, kinetic = strain + integral(shapes[2]), kinetic + integral(shapes[0])
    for j in range(2):
        square = np.einsum("an,bn->nab", shapes[j][:, -1], shapes[j][:, -1])
        for letter, total in (("k", strain), ("m", kinetic)):
            if (2 * (1 - base) + j, letter) in known:
                total += known[2 * (1 - base) + j, letter][:, None, None] * square
    return stationary_values(strain, kinetic)
