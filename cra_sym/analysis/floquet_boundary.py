"""Boundaries of a zone of instability by Floquet theory, the reference for asymptotic boundaries."""

from __future__ import annotations

from typing import Any

import numpy as np

from cra_sym.analysis.floquet import growth_rate
from cra_sym.analysis.stability import judged_boundary
from cra_sym.model.excitations import Fluctuation
from cra_sym.model.system import System

__all__ = ["floquet_boundary"]


def floquet_boundary(
    system: System,
    excitation: Any,
    epsilon: float,
    resonance: tuple[int, int] = (1, 1),
    modes: int | None = None,
    *,
    residual: bool | None = None,
) -> tuple[float, float]:
    """Return the excitation frequencies between which vibration grows, from Floquet multipliers.

    The search starts in the middle of the zone by multiple scales and proceeds outwards until there is no growth.

    Parameters
    ----------
    system, excitation
        One system and one excitation, not a batch.
    epsilon : float
        Positive.
    resonance : (int, int)
        As in :func:`cra_sym.stability_boundary`.
    modes : int, optional
        Number of modes, by default five more than the highest one of the resonance.
    residual : bool, optional
        Whether to include the static flexibility of the omitted modes, by default for fluctuating stiffnesses of ends.

    Returns
    -------
    lower, upper : float
        rad/s.

    Raises
    ------
    ValueError
        If nothing grows in the middle of the zone, or it merges with another.
    """
    highest = max(map(abs, resonance))
    modes = highest + 5 if modes is None else modes
    sides = judged_boundary(system, excitation, epsilon, resonance, order=2, modes=highest)[:2]
    middle, half = np.mean(sides), np.ptp(sides) / 2
    residual = (
        isinstance(excitation, Fluctuation) and bool(excitation.springs(system)) if residual is None else residual
    )

    inside, outside = np.full(2, middle), middle + 2.0 * half * np.array([-1.0, 1.0])
    for _ in range(5):  # 16 times closer each
        grid = np.linspace(inside, outside, 17, axis=-1)
        growing = growth_rate(system, excitation, grid, epsilon, modes, residual=residual) > 1e-5 * half
        if growing.all(axis=-1).any() or not growing[:, 0].all():
            where = (
                "beyond the zone: it merges with another"
                if growing[:, 0].all()
                else "nowhere in the middle of the zone"
            )
            raise ValueError(f"resonance = {resonance!r}: growth {where}")
        first_still = np.argmin(growing, axis=-1)[:, None]
        inside, outside = (np.take_along_axis(grid, first_still - back, axis=-1)[:, 0] for back in (1, 0))
    lower, upper = (inside + outside) / 2
    return float(lower), float(upper)
