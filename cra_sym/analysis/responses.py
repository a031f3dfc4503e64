"""Responses (34) of the arm to the motions of its base, and what is left of them after a stop."""

from __future__ import annotations

from typing import Any

import numpy as np

from cra_sym.analysis.modes import ModalParameters, modal_parameters, mode_shapes
from cra_sym.arm.parameters import Arm
from cra_sym.checks import broadcastable, count, instance, one_axis, real_array
from cra_sym.kernels import derived_kernel
from cra_sym.solvers import modal_response as solver
from cra_sym.solvers.driven_modes import Start, driven_response, state_at_stop
from cra_sym.solvers.motion import BaseMotion

__all__ = ["oscillators", "residual_vibration", "response", "tip_response"]

_DAMPING: dict[str, Any] = {"low": 0.0, "high": np.nextafter(1.0, 0.0), "allowed": "real numbers in [0, 1)"}

_free = derived_kernel("cra_sym.model.oscillator:free_kernel", backend="numpy")
_forced = derived_kernel("cra_sym.model.oscillator:forced_kernel", backend="numpy")


def tip_response(
    arm: Arm,
    motion: BaseMotion,
    t: Any,
    modes: int = 5,
    derivative: int = 0,
    *,
    zeta: Any = None,
    start: Start = "inertial",
) -> Any:
    """Return the elastic displacement v(L, t) of the tip seen from the base, equation (34), m.

    As :func:`response` at x = L.

    Parameters
    ----------
    arm, motion, t, modes, derivative, zeta, start
        As in :func:`response`; a velocity is in m/s, an acceleration in m/s2.

    Returns
    -------
    ndarray, shape (..., t)
        A single t has no axis.

    Raises
    ------
    TypeError, ValueError
        If an argument is out of its range or shapes do not fit; the error names it.

    Examples
    --------
    >>> from cra_sym import Arm, BaseMotion, tip_response
    >>> v = tip_response(Arm.nominal(), BaseMotion(acceleration=0.1), [0.0, 0.1, 0.2])
    >>> print(*(f"{1e3 * value:.3f} mm" for value in v))
    0.000 mm -0.621 mm -1.337 mm
    """
    modes = count("modes", modes)
    parameters = modal_parameters(arm, modes)
    osc = oscillators(arm, parameters, parameters.tip_displacement[..., None, :], zeta)
    values = driven_response(osc, motion, t, derivative, start)[..., 0, :]
    return values if np.ndim(t) else values[..., 0]


def response(
    arm: Arm,
    motion: BaseMotion,
    t: Any,
    x: Any,
    modes: int = 5,
    derivative: int = 0,
    *,
    zeta: Any = None,
    start: Start = "inertial",
) -> Any:
    """Return the elastic displacement v(x, t) seen from the base, or its time derivatives, equation (34).

    The sum over modes of phi_i(x) q_i(t), with Duhamel's integral (12) in closed form: exact at and near every
    resonance, with and without damping, and for rigid-body modes. Uniform times of 64 and more cost a few nanoseconds
    each.

    Parameters
    ----------
    arm : Arm
        Batch axes broadcast with those of the motion.
    motion : BaseMotion
        Prescribed motion of the base from t = 0 on.
    t : array_like
        Time or one axis of times, s, not negative; any order.
    x : array_like
        Place or one axis of places in [0, L], m.
    modes : int
        Modes in the sum, 1 to 1000.
    derivative : {0, 1, 2}
        Displacement (m), velocity (m/s) or acceleration (m/s2). A velocity is that to the right of a jump.
    zeta : array_like, optional
        Damping ratios in [0, 1), a last axis of ``modes`` values or one for all; default is that of the arm.
    start : {'inertial', 'base'}
        At rest before t = 0 in the inertial frame (a base that starts with a velocity strikes the arm,
        q_i'(0) = -Gamma_i w'(0+)/M_i), or at rest seen from the moving base.

    Returns
    -------
    ndarray, shape (..., x, t)
        A single x or t has no axis.

    Raises
    ------
    TypeError, ValueError
        If an argument is out of its range or shapes do not fit; the error names it.
    """
    instance("arm", arm, Arm)
    places = one_axis("x", x, "places", low=0.0, high=float(np.min(arm.L)))
    modes = count("modes", modes)
    rows = np.swapaxes(mode_shapes(arm, np.atleast_1d(places), modes), -1, -2)
    osc = oscillators(arm, modal_parameters(arm, modes), rows, zeta)
    values = driven_response(osc, motion, t, derivative, start)
    values = values if places.ndim else values[..., 0, :]
    return values if np.ndim(t) else values[..., 0]


def residual_vibration(arm: Arm, motion: BaseMotion, modes: int = 5, *, zeta: Any = None) -> Any:
    """Return the peak amplitude of the tip after the base has stopped, m: the sum of the peaks of the modes.

    Exact for one mode; without damping the least upper bound over all times (frequencies of modes are
    incommensurable); with damping an upper bound that ignores only that modes do not peak together. Being at rest
    after the stop is no condition: what counts is that the base does not accelerate any more. A rigid-body mode
    contributes its final offset.

    Parameters
    ----------
    arm, motion, modes, zeta
        As in :func:`response`; the arm is at rest before t = 0.

    Returns
    -------
    float or ndarray, shape (...)

    Raises
    ------
    TypeError, ValueError
        If the motion never stops accelerating; otherwise as :func:`response`.
    """
    instance("motion", motion, BaseMotion)
    if not np.all(np.isfinite(motion.duration)):
        raise ValueError("motion never stops accelerating: allowed are moves with a stop, or sampled records")
    parameters = modal_parameters(arm, count("modes", modes))
    osc = oscillators(arm, parameters, parameters.tip_displacement[..., None, :], zeta)
    q, u = state_at_stop(osc, motion)
    # a rigid-body mode keeps its inertial momentum: its velocity is the base's, rounding if the base has really stopped
    drift = -osc.gamma * _column(motion.velocity(np.max(motion.duration)))
    u = np.where(osc.omega > 0, u, np.where(np.abs(drift) > 1e-9 * np.abs(osc.gamma), drift, 0.0))
    total = np.sum(np.abs(parameters.tip_displacement) * solver.free_peak(osc, q, u), -1)
    return total if total.ndim else float(total)


def _column(value: Any) -> np.ndarray:
    """Return the batch array with an axis for the modes."""
    return np.asarray(value, float)[..., None]


def oscillators(arm: Arm, parameters: ModalParameters, rows: np.ndarray, zeta: Any) -> solver.Oscillators:
    """Return the modes as oscillators driven by the base, with the damping ratios of the arm or the given ones."""
    if zeta is None:
        ratios = _column(arm.zeta)
    else:
        ratios = np.atleast_1d(real_array("zeta", zeta, **_DAMPING))
    shape = broadcastable(modes=parameters.omega, zeta=ratios)
    if shape[-1] != parameters.omega.shape[-1]:
        raise ValueError(f"zeta has shape {ratios.shape}: its last axis must have one value, or one for each mode")
    return solver.Oscillators(parameters.omega, ratios, parameters.participation, rows, _free, _forced)
