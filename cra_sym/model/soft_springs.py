"""Springs whose dimensionless stiffness is too small for the determinant, yet which alone hold the structure."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray

from cra_sym.solvers.one_wave import Layout

__all__ = ["felt", "free_motions", "put_soft"]

Array = NDArray[np.float64]

_SOFTEST = 1e-150  # the product of two stiffnesses of this size does not underflow
_LEVELS = ((1e-60, 1e-80), (1e-100, 1e-120))  # limit and target of the stiffnesses that are scaled up


def felt(layout: Layout, groups: Sequence[Array]) -> list[Array]:
    """Return the groups with 0 for stiffnesses below 1e-150; the same arrays where there are none."""
    letters = (letter for _, letter in layout.groups)
    return [
        np.where(x < _SOFTEST, 0.0, x) if letter == "k" and np.any((x > 0) & (x < _SOFTEST)) else x
        for x, letter in zip(groups, letters, strict=True)
    ]


def free_motions(layout: Layout, groups: Sequence[Array], lam: Array) -> NDArray[np.bool]:
    """Tell which modes no stiffness resists, shape of ``lam`` (..., modes)."""
    number = layout.rigid_body_modes(groups, lam.shape[:-1])
    return np.asarray(np.arange(lam.shape[-1]) < number[..., None])


def put_soft(
    layout: Layout,
    groups: Sequence[Array],
    solve: Callable[[list[Array], int], Array],
    modes: int,
    levels: Sequence[tuple[float, float]] = _LEVELS,
) -> Array:
    """Return lambda, including modes that only stiffnesses below 1e-150 resist.

    In such a mode the line moves as a rigid body, so lambda^2n is homogeneous in these stiffnesses, with an error of
    the order of these stiffnesses relative to 1 and to the others. All below a limit are therefore scaled by one factor
    that brings the largest of them to a target.

    Parameters
    ----------
    layout : Layout
    groups : sequence of ndarray, shape (...)
    solve : callable
        ``solve(groups, modes)`` returns lambda, shape (..., modes), of groups of which none is softer than 1e-150.
    modes : int
    """
    real = felt(layout, groups)
    lam = solve(real, modes)
    if not levels or all(a is b for a, b in zip(real, groups, strict=True)):
        return lam
    lanes = np.any([a != b for a, b in zip(real, groups, strict=True)], axis=0)
    (limit, target), *others = levels
    here = [x[lanes] for x in groups]
    letters = [letter for _, letter in layout.groups]
    soft = [(x < limit) & (letter == "k") for x, letter in zip(here, letters, strict=True)]
    factor = target / np.max([np.where(some, x, 0.0) for some, x in zip(soft, here, strict=True)], axis=0)
    lifted = [np.where(some, x * factor, x) for some, x in zip(soft, here, strict=True)]
    found = put_soft(layout, lifted, solve, modes, others)
    alone = free_motions(layout, [np.where(some, 0.0, x) for some, x in zip(soft, here, strict=True)], found)
    found = np.where(alone, found * (factor ** (-0.5 / layout.n))[:, None], found)
    lam[lanes] = np.where(free_motions(layout, felt(layout, here), found), found, lam[lanes])
    return lam
