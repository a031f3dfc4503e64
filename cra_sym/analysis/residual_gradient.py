"""Exact gradient of the residual vibration: what a design search follows."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from cra_sym.analysis.modes import modal_parameters
from cra_sym.analysis.responses import oscillators, residual_vibration
from cra_sym.analysis.sensitivities import CHANNELS
from cra_sym.arm.parameters import Arm
from cra_sym.checks import count, shown
from cra_sym.solvers.driven_modes import state_at_stop
from cra_sym.solvers.modal_response import Oscillators, free_peak
from cra_sym.solvers.motion import BaseMotion

__all__ = ["residual_vibration_gradient"]

_NAMES = (*CHANNELS, "duration")
_TINY = 1e-30  # an imaginary part whose square is nothing


def residual_vibration_gradient(
    arm: Arm,
    motion: BaseMotion,
    by: Sequence[str] = ("k_t", "k_r", "duration"),
    modes: int = 5,
    *,
    zeta: Any = None,
) -> tuple[Any, np.ndarray]:
    r"""Return the residual vibration and its exact derivatives, as a gradient-based optimiser wants them.

    Mode i leaves :math:`|\Gamma_i \phi_i(L)| A(\omega_i T)` behind. The sensitivities (31)-(32) tell how the frequency
    follows a parameter, closed forms along the frequency equation how :math:`\Gamma_i \phi_i(L)` does, and the exact
    states of the oscillator at the stop how the peak A follows the frequency: no difference is taken.

    Parameters
    ----------
    arm, motion, modes, zeta
        As in :func:`residual_vibration`.
    by : sequence of {'k_t', 'k_r', 'c_t', 'c_r', 'm_e', 'J_e', 'duration'}
        ``c_t`` and ``c_r`` are the compliances 1/k_t and 1/k_r; ``duration`` stretches the motion uniformly in time
        over the same way, as the argument of :meth:`BaseMotion.s_curve` does.

    Returns
    -------
    value : float or ndarray, shape (...)
        As from :func:`residual_vibration`, m.
    gradient : ndarray, shape (..., len(by))
        In m over the SI unit of the parameter. By an infinite stiffness it is 0. Where a mode leaves exactly nothing
        behind the residual has a kink: the mode counts as 0. By a stiffness that is zero, or a compliance that is
        infinite, it is nan: a rigid-body mode is about to become a vibration.

    Raises
    ------
    TypeError, ValueError
        If ``by`` is no sequence of the names above; otherwise as :func:`residual_vibration`.

    Examples
    --------
    >>> from cra_sym import Arm, BaseMotion, residual_vibration_gradient
    >>> move = BaseMotion.s_curve(0.2, 1.0, 2.0, 40.0, duration=1.0)
    >>> value, gradient = residual_vibration_gradient(Arm.nominal(), move, by=("duration",), modes=1)
    >>> print(f"{1e3 * value:.3f} mm, {1e3 * gradient[0]:.2f} mm/s")
    1.696 mm, 52.49 mm/s
    """
    known = isinstance(by, Sequence) and not isinstance(by, str)
    if not known or not all(isinstance(name, str) and name in _NAMES for name in by):
        raise ValueError(f"by = {shown(by)}: allowed is a sequence of {', '.join(_NAMES)}")
    value = residual_vibration(arm, motion, modes, zeta=zeta)
    p = modal_parameters(arm, count("modes", modes))
    peak, stretched = _unit_peaks(oscillators(arm, p, p.tip_displacement[..., None, :], zeta), motion)
    factor = p.participation * p.tip_displacement
    gradient = np.empty((*np.shape(value), len(by)))
    for column, name in enumerate(by):
        with np.errstate(divide="ignore", invalid="ignore"):
            if name == "duration":
                rate = np.abs(factor) * stretched / np.asarray(motion.duration)[..., None]
            else:
                change, logarithmic = p._modes.product_rates(1, 0, *CHANNELS[name])
                rate = np.sign(factor) * change * peak + np.abs(factor) * stretched * logarithmic
        gradient[..., column] = rate.sum(axis=-1)
    return value, gradient


def _unit_peaks(osc: Oscillators, motion: BaseMotion) -> tuple[np.ndarray, np.ndarray]:
    """Return the peak of each mode after the stop for Gamma = 1, and its derivative by ln omega.

    The peak depends on frequency and duration by their product alone, so the second is also that by ln T.
    """
    unit = osc._replace(omega=osc.omega * (1 + 1j * _TINY), gamma=np.ones_like(osc.gamma))
    q, u = state_at_stop(unit, motion)
    u = np.where(osc.omega > 0, u, 0.0)  # what a rigid-body mode does is the same at any frequency near
    peak = free_peak(unit, q, u)
    return peak.real, np.where(osc.omega > 0, peak.imag / _TINY, 0.0)
