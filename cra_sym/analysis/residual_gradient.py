"""Gradient of the residual vibration: what a design search follows."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cra_sym.analysis.modes import participation
from cra_sym.analysis.responses import residual_vibration, stopped_oscillators
from cra_sym.analysis.sensitivities import Sensitivities, sensitivities
from cra_sym.checks import count, default_floating_point, shown
from cra_sym.model.system import MOST_MODES, System
from cra_sym.solvers.driven_modes import state_at_stop
from cra_sym.solvers.modal_response import Oscillators, free_peak
from cra_sym.solvers.motion import BaseMotion

__all__ = ["residual_vibration_gradient"]

Array = NDArray[np.float64]
_TINY = 1e-30  # an imaginary part whose square is nothing
_STEP = 2e-3  # relative change of omega^2 in a step of the differences
_POINTS = 8  # on one side of a parameter that cannot be negative, or four on each side


@default_floating_point
def residual_vibration_gradient(
    system: System,
    motion: BaseMotion,
    by: Sequence[str] = ("k_t", "k_r", "duration"),
    modes: int = 5,
    *,
    zeta: Any = None,
) -> tuple[Any, Array]:
    r"""Return the residual vibration and its derivatives, as a gradient-based optimiser wants them.

    Mode i leaves :math:`|\Gamma_i \phi_i(L)| A(\omega_i T)` behind. The sensitivities (31)-(32) tell how the frequency
    follows a parameter, and the exact states of the oscillator at the stop how the peak A follows the frequency. How
    :math:`\Gamma_i \phi_i(L)` follows a parameter is a difference of eighth order, whose error is about 1e-11 of it.

    Parameters
    ----------
    system, motion, modes, zeta
        As in :func:`residual_vibration`.
    by : sequence of str
        Parameters of the system; the compliance 1/k of a stiffness k of an end, for an arm 'c_t' and 'c_r', else '1/'
        and its name; and 'duration', which stretches the motion uniformly in time over the same way, as the argument
        of :meth:`BaseMotion.s_curve` does.

    Returns
    -------
    value : float or ndarray, shape (...)
        As from :func:`residual_vibration`, m.
    gradient : ndarray, shape (..., len(by))
        In m over the SI unit of the parameter. By an infinite stiffness it is 0. Where a mode leaves exactly nothing
        behind the residual has a kink: the mode counts as 0. By a stiffness that is zero, or a compliance that is
        infinite, it is nan where a rigid-body mode is about to become a vibration.

    Raises
    ------
    TypeError, ValueError
        If ``by`` is not a sequence of such names; otherwise as :func:`residual_vibration`.

    Examples
    --------
    >>> from cra_sym import Arm, BaseMotion, residual_vibration_gradient
    >>> move = BaseMotion.s_curve(0.2, 1.0, 2.0, 40.0, duration=1.0)
    >>> value, gradient = residual_vibration_gradient(Arm.nominal(), move, by=("duration",), modes=1)
    >>> print(f"{1e3 * value:.3f} mm, {1e3 * gradient[0]:.2f} mm/s")
    1.696 mm, 52.49 mm/s
    """
    modes = count("modes", modes, high=MOST_MODES)
    osc = stopped_oscillators(system, motion, modes, zeta)
    compliances = {f"1/{name}": name for name in system.numerics("stiffnesses")}
    compliances |= {name.replace("k_", "c_", 1): name for name in compliances.values() if name.startswith("k_")}
    known = [*system.values, *compliances, "duration"]
    if isinstance(by, str) or not isinstance(by, Sequence) or not all(name in known for name in by):
        raise ValueError(f"by = {shown(by)}: must be a sequence of names among {', '.join(known)}")
    value = residual_vibration(system, motion, modes, zeta=zeta)
    peak, stretched = _unit_peaks(osc, motion)
    factor = osc.gamma * osc.rows[..., 0, :]
    found = sensitivities(system, modes)
    gradient = np.empty((*np.shape(value), len(by)))
    for place, name in enumerate(by):
        with np.errstate(divide="ignore", invalid="ignore"):
            if name == "duration":
                rate = np.abs(factor) * stretched / np.asarray(motion.duration)[..., None]
            else:
                stiffness = compliances.get(name)
                change, logarithmic = _rates(system, found, stiffness or name, modes, compliance=stiffness is not None)
                rate = np.sign(factor) * change * peak + np.abs(factor) * stretched * logarithmic
        gradient[..., place] = rate.sum(axis=-1)
    return value, gradient


def _unit_peaks(osc: Oscillators, motion: BaseMotion) -> tuple[Array, Array]:
    """Return the peak of each mode after the stop for Gamma = 1, and its derivative by ln omega.

    The peak depends on frequency and duration by their product alone, so the second is also that by ln T.
    """
    unit = osc._replace(omega=osc.omega * (1 + 1j * _TINY), gamma=np.ones_like(osc.gamma))
    q, u = state_at_stop(unit, motion)
    u = np.where(osc.omega > 0, u, 0.0)  # what a rigid-body mode does is the same at any frequency near
    peak = free_peak(unit, q, u)
    return peak.real, np.where(osc.omega > 0, peak.imag / _TINY, 0.0)


def _rates(system: System, found: Sensitivities, name: str, modes: int, *, compliance: bool) -> tuple[Array, Array]:
    """Return the derivatives of Gamma_i phi_i(L) and of ln omega_i by a parameter or by one over it."""
    by_frequency = found.compliance[name] if compliance else found.rate[name]
    still = found.frequency == 0
    with np.errstate(divide="ignore", invalid="ignore"):
        logarithmic = np.where(still, np.where(by_frequency == 0, 0.0, np.nan), by_frequency / found.frequency)
    given = np.broadcast_to(system.values[name], system.shape)
    place = 1 / given if compliance else given
    fixed = np.isinf(place)
    with np.errstate(divide="ignore", invalid="ignore"):
        steepest = np.nanmax(np.abs(2 * np.where(still, 0.0, logarithmic)), axis=-1)
        step = np.where(steepest > 0, _STEP / steepest, _STEP * np.where(place > 0, place, 1.0))
    step = np.where(fixed, 1.0, step)
    change = _differences(system, name, np.where(fixed, 1.0, place), step, modes, compliance=compliance)
    change = np.where(fixed[..., None], np.nan if compliance else 0.0, change)
    nothing = np.isinf(given)[..., None] & (not compliance)
    return np.where(nothing, 0.0, change), np.where(nothing, 0.0, logarithmic)


def _differences(system: System, name: str, place: Array, step: Array, modes: int, *, compliance: bool) -> Array:
    """Return the derivative of Gamma_i phi_i(L) by differences: central where the parameter allows, else one-sided."""
    half = _POINTS // 2
    one_sided = place < half * step
    nodes = np.arange(-half, half + 1)
    offsets = nodes[:, *(None,) * place.ndim] + np.where(one_sided, half - np.floor(place / step).clip(0, half), 0)
    values = place + offsets * step
    with np.errstate(divide="ignore"):
        moved = system.replace(**{name: 1 / values if compliance else values})
    products = participation(moved, modes) * moved.modes(modes).displacement(1, 0)
    weights = _weights(offsets)
    return (weights[..., None] * products).sum(axis=0) / step[..., None]


def _weights(offsets: Array) -> Array:
    """Return the weights of the derivative at 0 of the polynomial through values at offsets (points, ...)."""
    points = len(offsets)
    powers = np.moveaxis(offsets[None] ** np.arange(points)[:, *(None,) * offsets.ndim], (0, 1), (-2, -1))
    slope = np.zeros((*powers.shape[:-2], points, 1))
    slope[..., 1, 0] = 1.0
    return np.moveaxis(np.linalg.solve(powers, slope)[..., 0], -1, 0)
