"""Closely spaced natural frequencies: a Rayleigh-Ritz step restores the digits that the determinant loses.

A heavy end-effector on a soft joint translates and rotates as a rigid body; two heavy ends on springs are almost
uncoupled. The weaker the coupling of two such motions of equal frequency, the closer their frequencies, and two zeros
of the determinant at a relative distance g are accurate to eps / g only. A Rayleigh-Ritz step with the two approximate
shapes has no such loss, since the error of the shapes enters the frequencies squared.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from cra_sym.model.one_wave_family import DimensionlessModes, Family
from cra_sym.solvers.rayleigh import stationary_values

__all__ = ["CLOSE", "resolve_close_pairs"]

Array = NDArray[np.float64]

CLOSE = 0.1
"""Distance of two frequency parameters, relative below 1, under which Rayleigh-Ritz values replace the zeros."""

_APART = 1e-9  # least relative distance of the two frequencies at which shapes are taken; its square is below rounding
_TURNS = 3  # the first may start from shapes that are nearly parallel
_LANES = 1000  # lanes at once, to bound memory


def resolve_close_pairs(family: Family, lam: Array, *groups: Array) -> None:
    """Correct, in place, the frequency parameters of neighbours that lie close to each other.

    Parameters
    ----------
    family : Family
    lam : ndarray, shape (..., modes), contiguous
        Ascending frequency parameters.
    groups : ndarray, shape (...)
    """
    rows = lam.reshape(-1, lam.shape[-1])
    flat = [np.broadcast_to(value, lam.shape[:-1]).reshape(-1) for value in groups]
    for lower in range(rows.shape[1] - 1):
        low, high = rows[:, lower], rows[:, lower + 1]
        close = np.flatnonzero(low > (1 - CLOSE) * high)  # few enough for a closer look
        close = close[high[close] - low[close] < CLOSE * np.minimum(high[close], 1.0)]
        for start in range(0, close.size, _LANES):
            some = close[start : start + _LANES]
            rows[some, lower : lower + 2] = _rayleigh_ritz(
                family, rows[some, lower : lower + 2], [x[some] for x in flat]
            )


def _rayleigh_ritz(family: Family, pairs: Array, groups: list[Array]) -> Array:
    """Return pairs of frequency parameters, shape (lanes, 2), from the energies of their shapes."""
    for _ in range(_TURNS):
        middle, half = pairs.mean(axis=1), np.maximum(np.diff(pairs)[:, 0], _APART * pairs[:, 1]) / 2
        apart = np.stack([middle - half, middle + half], axis=1)
        modes = family.modes(*groups, lam=np.where(np.diff(pairs) < _APART * pairs[:, 1:], apart, pairs), compile=False)
        strain, kinetic = _energies(modes, groups)
        pairs = stationary_values(strain, kinetic) ** (0.5 / family.layout.n)
    return pairs


def _energies(modes: DimensionlessModes, groups: list[Array]) -> tuple[Array, Array]:
    """Return the matrices of twice the strain and twice the kinetic energy, each of shape (lanes, modes, modes).

    The end values follow from the conditions of the right end; the shapes are corrected to have these values.
    """
    table, n = modes.family.layout, modes.family.layout.n
    points, weights = np.polynomial.legendre.leggauss(int(np.ceil(modes.lam.max())) + 24)  # more than products need
    xi, weights = (1 + points) / 2, weights / 2
    rows = modes.quantities(slice(0, table.size))
    ends = np.array([1.0])
    missing = [rows[table.right][j][..., None] - modes.shape(ends, j) for j in range(n)]
    beam = [(xi**2 * (3 - 2 * xi), 6 - 12 * xi), (xi**2 * (xi - 1), 6 * xi - 2)]
    hermite = beam if n == 2 else [(xi, np.ones_like(xi))]
    shape, bent = modes.shape(xi, 0), modes.shape(xi, n)
    for gap, (value, curved) in zip(missing, hermite, strict=True):
        shape, bent = shape + gap * value, bent + gap * curved
    strain, kinetic = ((f * weights) @ np.swapaxes(f, 1, 2) for f in (bent, shape))
    for root in rows[table.strain]:
        strain = strain + root[:, :, None] * root[:, None, :]
    for position in table.inertias:
        end, j = divmod(table.groups[position][0], n)
        q = rows[table.right if end else table.left][j]
        kinetic = kinetic + groups[position][:, None, None] * (q[:, :, None] * q[:, None, :])
    return strain, kinetic
