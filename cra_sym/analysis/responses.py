"""Responses (34) of a system to prescribed motions, forces and initial states, and what is left after a stop."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from cra_sym.analysis.complex_responses import complex_residual, complex_response
from cra_sym.analysis.histories import History, driven
from cra_sym.analysis.histories import histories as histories_of
from cra_sym.analysis.modes import check_places, participation, section_place
from cra_sym.analysis.nonlinear_response import nonlinear_response
from cra_sym.analysis.slipping import Slipping, slipping, slipping_outputs, slipping_residual
from cra_sym.checks import broadcastable, count, default_floating_point, instance, one_axis, shown
from cra_sym.kernels import derived_kernel
from cra_sym.model.projection import Projected
from cra_sym.model.routes import Modes
from cra_sym.model.system import MOST_MODES, System
from cra_sym.model.values import checked_damping
from cra_sym.solvers import modal_response as solver
from cra_sym.solvers.coupled_modes import CoupledModes, coupled_response
from cra_sym.solvers.driven_modes import Start, check_start, driven_response, state_at_stop
from cra_sym.solvers.motion import BaseMotion, Force

if TYPE_CHECKING:
    from sympy import Expr
    from sympy.core.function import AppliedUndef

__all__ = [
    "History", "Stopped", "UndersamplingWarning", "residual_vibration", "response", "slipping_problem", "stopped",
    "tip_response",
]  # fmt: skip

Array = NDArray[np.float64]
_UNCOUPLED = 1e-8  # of the damping between two modes, over the geometric mean of their own


class UndersamplingWarning(UserWarning):
    """Modes lie above half the sampling rate of a record, which does not tell what excites them.

    Examples
    --------
    >>> import warnings
    >>> import cra_sym as cra
    >>> with warnings.catch_warnings(record=True, action="always") as said:
    ...     tip = cra.tip_response(cra.Arm.nominal(), cra.BaseMotion.sampled(None, [0.0] * 66, sampling_rate=99.0), 0.1)
    >>> said[0].category.__name__
    'UndersamplingWarning'
    """


_free = derived_kernel("cra_sym.model.oscillator:free_kernel", backend="numpy")
_forced = derived_kernel("cra_sym.model.oscillator:forced_kernel", backend="numpy")


@default_floating_point
def tip_response(
    system: System,
    motion: BaseMotion | Mapping[AppliedUndef, History] | None,
    t: Any,
    modes: int = 5,
    derivative: int = 0,
    *,
    zeta: Any = None,
    start: Start = "inertial",
    initial: Mapping[Any, Expr] | None = None,
    field: AppliedUndef | None = None,
) -> Any:
    """Return the displacement of the tip, the right end of the first field, equation (34); of an arm v(L, t), m.

    As :func:`response` at the right end of the domain.

    Parameters
    ----------
    system, motion, t, modes, derivative, zeta, start, initial, field
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
    instance("system", system, System)
    modes = count("modes", modes, high=MOST_MODES)
    place = section_place(system, field)

    def tip(found: Modes) -> Array:
        return found.displacement(1, place)[..., None, :]

    values = _oscillation(system, motion, tip, t, modes, derivative, zeta, start, initial)[..., 0, :]
    return values if np.ndim(t) else values[..., 0]


@default_floating_point
def response(
    system: System,
    motion: BaseMotion | Mapping[AppliedUndef, History] | None,
    t: Any,
    x: Any,
    modes: int = 5,
    derivative: int = 0,
    *,
    zeta: Any = None,
    start: Start = "inertial",
    initial: Mapping[Any, Expr] | None = None,
    field: AppliedUndef | None = None,
) -> Any:
    """Return a field in time, seen from the moving base, or its time derivatives, equation (34).

    The sum over modes of phi_i(x) q_i(t), with Duhamel's integral (12) in closed form: exact at and near every
    resonance, with and without damping, and for rigid-body modes. Uniform times of 64 and more cost a few nanoseconds
    each. Of a system with local dampers, gyroscopic forces or forces that follow the motion the sum is that of the
    lowest complex modes, as many eigenvalues as ``modes`` oscillators have, by exponentials of their state matrix;
    velocities are those of the modes. Damping of the material (Kelvin-Voigt) that couples the natural modes has
    eigenvalues that crowd: then all motions of a basis are summed in which that many modes have settled. A nonlinear
    system (not a batch) is integrated in time, its linear modes exactly, to a relative error of about 1e-9. Of a system
    with elastic-slip elements (batches too) the sum is that of its modes without them, followed exactly from event to
    event; see `slip_response`.

    Parameters
    ----------
    system : System
        Batch axes broadcast with those of the motion.
    motion : BaseMotion, or mapping of function of t to BaseMotion or Force, or None
        What the prescribed motions and the forces of the Lagrangian and of the virtual work are, from t = 0 on. A bare
        BaseMotion is that of the only prescribed motion. A motion must act by its acceleration alone: measure the
        fields from the frame that moves. Constant loads act from t = 0.
    t : array_like
        Time or one axis of times, s, not negative; any order.
    x : array_like
        Place or one axis of places in the domain, m.
    modes : int
        Modes in the sum, 1 to 1000.
    derivative : {0, 1, 2}
        Displacement (m), velocity (m/s) or acceleration (m/s2). A velocity is that to the right of a jump.
    zeta : array_like, optional
        Damping ratios in [0, 1), a last axis of ``modes`` values or one for all; default is that of the system.
    start : {'inertial', 'base'}
        At rest before t = 0 in the inertial frame (a base that starts with a velocity strikes the arm,
        q_i'(0) = -Gamma_i w'(0+)/M_i), or at rest seen from the moving base.
    initial : mapping of field, coordinate or its first time derivative to an expression in x, optional
        State at t = 0 beside that of the start, such as ``{v: a*x**2, v.diff(t): 0}``.
    field : applied undefined function, optional
        Default: the first.

    Returns
    -------
    ndarray, shape (..., x, t)
        A single x or t has no axis.

    Warns
    -----
    UndersamplingWarning
        If a mode lies above half the sampling rate of a record.

    Raises
    ------
    TypeError, ValueError
        Names the argument that is out of its range, the load without a history, the function that is not known.

    Examples
    --------
    >>> import cra_sym as cra
    >>> start = cra.BaseMotion(velocity=0.1)
    >>> (1e3 * cra.response(cra.Arm.nominal(), start, [0.0, 0.1, 0.2], x=[0.5, 1.0])).round(2)
    array([[  0.  ,  -3.34,  -0.53],
           [  0.  , -10.42,  -0.7 ]])
    """
    instance("system", system, System)
    places = one_axis("x", x, "places", unit="m")
    check_places(system, places)
    modes = count("modes", modes, high=MOST_MODES)
    place = section_place(system, field)

    def along(found: Modes) -> Array:
        return np.swapaxes(found.shape(place, 0, np.atleast_1d(places)), -1, -2)

    values = _oscillation(system, motion, along, t, modes, derivative, zeta, start, initial)
    values = values if places.ndim else values[..., 0, :]
    return values if np.ndim(t) else values[..., 0]


@default_floating_point
def residual_vibration(
    system: System,
    motion: BaseMotion | Mapping[AppliedUndef, History],
    modes: int = 5,
    *,
    zeta: Any = None,
) -> Any:
    """Return the peak amplitude of the tip after all motions and forces have stopped, m: the sum over the modes.

    Exact for one mode; without damping the least upper bound over all times (frequencies of modes are
    incommensurable); with damping an upper bound that ignores only that modes do not peak together. Being at rest
    after the stop is not a condition: what counts is that the base does not accelerate any more. A rigid-body mode
    contributes its final offset. Of a system with elastic-slip elements it is the largest displacement while they
    slip, at most for ten periods of the lowest mode; from where they stick for good on it is the offset and the sum
    over the modes. Where dampers, gyroscopic forces or forces that follow the motion couple the modes, the sum is over
    complex modes: two real eigenvalues count as one mode, and what grows leaves inf.

    Parameters
    ----------
    system, motion, modes, zeta
        As in :func:`response`; the system is at rest before t = 0. Every motion and every force must end.

    Returns
    -------
    float or ndarray, shape (...)

    Warns
    -----
    UndersamplingWarning
        As :func:`response`.

    Raises
    ------
    TypeError, ValueError
        If a motion never stops accelerating or a force never ends; otherwise as :func:`response`.

    Examples
    --------
    >>> import cra_sym as cra
    >>> move = cra.BaseMotion.s_curve(0.2, v_max=1.0, a_max=2.0, j_max=40.0)
    >>> print(f"{1e3 * cra.residual_vibration(cra.Arm.nominal(), move):.1f} mm")
    21.1 mm
    """
    instance("system", system, System)
    if system.model.pieces["hysteresis"]:
        if couples(system.without_hysteresis, modes):
            raise ValueError("system: dampers beside elastic-slip elements leave no sum over modes; use response")
        still = stopped(system.without_hysteresis, motion, modes, zeta)
        problem, rows = slipping_problem(system, motion, modes, zeta), system.without_hysteresis.modes(modes)
        peak = slipping_residual(problem, rows.displacement(1, 0), still.stop)
        return peak if peak.ndim else float(peak)
    if couples(system, modes):
        total = _complex_residual(system, motion, modes, zeta)
    else:
        found = stopped(system, motion, modes, zeta)
        total = np.sum(found.peaks(found.osc.omega, found.products), -1)
    return total if total.ndim else float(total)


@dataclass(frozen=True)
class Stopped:
    """Modes that are driven until everything stops.

    Attributes
    ----------
    osc : Oscillators
        Of which omega and zeta count.
    names : tuple of str
        What drives.
    profiles : tuple of BaseMotion
        Their motions; that of a force is the one whose acceleration it is.
    stop : float or ndarray
        When the last of them stops, s.
    products : list of ndarray, shape (..., modes)
        Participation in each times the displacement of the tip.
    """

    osc: solver.Oscillators
    names: tuple[str, ...]
    profiles: tuple[BaseMotion, ...]
    stop: Any
    products: list[Array]

    def peaks(self, omega: NDArray[Any], products: Sequence[NDArray[Any]]) -> NDArray[Any]:
        """Return the largest displacement of the tip by each mode after the stop, shape (..., modes).

        Complex frequencies and products carry a derivative along in their imaginary parts.
        """
        q: Any = 0.0
        u: Any = 0.0
        for profile, product in zip(self.profiles, products, strict=True):
            one = self.osc._replace(omega=omega, gamma=product)
            q_one, u_one = state_at_stop(one, profile, self.stop)
            # a rigid-body mode keeps its inertial momentum: its velocity is the base's, rounding if it has really
            # stopped
            speed = np.asarray(profile.velocity(np.max(self.stop)), float)[..., None]
            drift = np.where(np.abs(speed) > 1e-9, -product * speed, 0.0)
            q, u = q + q_one, u + np.where(omega.real > 0, u_one, drift)
        return solver.free_peak(self.osc._replace(omega=omega), q, u)


def couples(system: System, modes: int) -> bool:
    """Tell whether dampers, gyroscopic or follower forces couple the natural modes; refuse what has no complex ones."""
    instance("system", system, System)
    if system.numerics("complex_modes") == "none" and system.numerics("damping") is not None:
        raise ValueError(
            "system: its dampers couple modes, and with third derivatives by x or inertia of the highest derivatives "
            "there are no complex ones; use modal damping (zeta), or response after the stop"
        )
    return _has_complex_modes(system, count("modes", modes, high=MOST_MODES))


def _complex_residual(system: System, motion: Any, modes: int, zeta: Any) -> Array:
    histories, _, stop = _ended(system, motion)
    modes = count("modes", modes, high=MOST_MODES)
    ratio = np.asarray(system.zeta if zeta is None else checked_damping(zeta))
    if zeta is not None and ratio.ndim:
        if ratio.shape[-1] != 1:
            raise ValueError(f"zeta has shape {ratio.shape}: its last axis must have one value where modes are complex")
        ratio = ratio[..., 0]
    place = section_place(system, None)
    return complex_residual(
        system, histories, lambda found: found.displacement(1, place), stop, modes, ratio, _check_sampling
    )


def _ended(system: System, motion: Any) -> tuple[dict[str, History], tuple[BaseMotion, ...], Any]:
    """Return what drives, the motions it is, and when the last of them stops; refuse what never does."""
    instance("system", system, System)
    histories = histories_of(system, motion)
    if not histories:
        raise ValueError("motion: must be of what drives the model; nothing does")
    profiles = tuple(one.profile if isinstance(one, Force) else one for one in histories.values())
    for (name, one), profile in zip(histories.items(), profiles, strict=True):
        if not np.all(np.isfinite(profile.duration)):
            if isinstance(one, Force):
                raise ValueError(f"motion: the force {name} never ends: must be a sampled record")
            raise ValueError("motion never stops accelerating: must be a move with a stop, or a sampled record")
    if system.numerics("constant") is not None:
        raise ValueError("system: a constant load acts too and never ends; use response after the stop")
    stop = profiles[0].duration
    for profile in profiles[1:]:
        stop = np.maximum(stop, profile.duration)
    return histories, profiles, stop


def stopped(system: System, motion: Any, modes: int, zeta: Any) -> Stopped:
    """Return the natural modes driven until everything stops, or refuse what never stops."""
    histories, profiles, stop = _ended(system, motion)
    modes = count("modes", modes, high=MOST_MODES)
    osc = oscillators(system, np.zeros(modes), np.zeros((1, modes)), modes, zeta)
    if system.numerics("complex_modes") == "if coupled" and not _has_complex_modes(system, modes):
        osc = osc._replace(zeta=_with_dampers(system, osc.omega, osc.zeta))
    for profile in profiles:
        _check_sampling(profile, osc.omega)
    tip = system.modes(modes).displacement(1, 0)
    products = [participation(system, modes, name) * tip for name in histories]
    return Stopped(osc, tuple(histories), profiles, stop, products)


def _with_dampers(system: System, omega: Array, zeta: Array) -> Array:
    """Return damping ratios with those of dampers that leave the natural modes apart."""
    matrix = Projected(system.domain, system.modes(omega.shape[-1]), system.numerics("damping"))["damping"]
    rate = np.einsum("...ii->...i", matrix)
    with np.errstate(divide="ignore", invalid="ignore"):
        ratio = zeta + np.where(omega > 0.0, rate / (2.0 * omega), 0.0)
    if not (ratio < 1.0).all():
        raise ValueError(
            f"modes = {omega.shape[-1]}: dampers give one of these a ratio of {ratio.max():.3g}, must be below 1; take "
            "fewer modes"
        )
    return np.asarray(ratio)


def oscillators(system: System, gamma: Array, rows: Array, modes: int, zeta: Any) -> solver.Oscillators:
    """Return the modes as oscillators with q'' + .. = -gamma w'', with the damping ratios of the system or others."""
    return solver.Oscillators(
        system.natural_frequencies(modes), _ratios(system, modes, zeta), gamma, rows, _free, _forced
    )


def _ratios(system: System, modes: int, zeta: Any) -> Array:
    if zeta is None:
        ratios = np.asarray(system.zeta, float)[..., None]
    else:
        ratios = np.atleast_1d(checked_damping(zeta))
    if ratios.shape[-1] not in (1, modes):
        raise ValueError(f"zeta has shape {ratios.shape}: its last axis must have one value, or one for each mode")
    broadcastable(modes=system.natural_frequencies(modes), zeta=ratios)
    return ratios


def _oscillation(
    system: System,
    motion: BaseMotion | Mapping[Any, History] | None,
    outputs: Callable[[Modes], Array],
    t: Any,
    modes: int,
    derivative: int,
    zeta: Any,
    start: Start,
    initial: Mapping[Any, Any] | None,
) -> Array:
    """Return outputs of the driven modes, rows (..., outputs, modes) times these, shape (..., outputs, times)."""
    check_start(start)
    if initial is not None and not isinstance(initial, Mapping):
        raise TypeError(
            f"initial = {shown(initial)}: must be a mapping from fields and coordinates to expressions in x"
        )
    if system.model.pieces["hysteresis"]:
        problem = slipping_problem(system, motion, modes, zeta, start, initial)
        return slipping_outputs(problem, outputs(problem.base.modes(modes)), t, derivative)
    histories = histories_of(system, motion)
    if system.numerics("nonlinear") is not None:
        state = tuple(_initial_state(system, initial or {}, modes, order) for order in (0, 1))
        rows = outputs(system.modes(modes))
        for history in histories.values():
            profile = history.profile if isinstance(history, Force) else history
            _check_sampling(profile, system.natural_frequencies(modes))
        return nonlinear_response(system, histories, rows, t, modes, derivative, state, start, zeta)
    ratio = np.asarray(system.zeta if zeta is None else checked_damping(zeta))
    alike = ratio.ndim == 0 or ratio.shape[-1] == 1 or zeta is None
    if alike and _has_complex_modes(system, modes):
        ratio = ratio[..., 0] if zeta is not None and ratio.ndim else ratio
        return complex_response(
            system, histories, outputs, t, modes, derivative, ratio, start, initial, _check_sampling
        )
    rows, still = outputs(system.modes(modes)), np.zeros(modes)
    damping = system.numerics("damping")
    matrix = None if damping is None else Projected(system.domain, system.modes(modes), damping)["damping"]

    def answer(gamma: Array, profile: BaseMotion, begin: Start, state: Any = None) -> Array:
        osc = oscillators(system, gamma, rows, modes, zeta)
        _check_sampling(profile, osc.omega)
        if matrix is not None and matrix.any():
            return coupled_response(
                CoupledModes(osc.omega, osc.zeta, matrix, gamma, rows), profile, t, derivative, begin, state
            )
        return driven_response(osc, profile, t, derivative, begin, state)

    total: Array | None = None
    if initial or not histories:
        q, u = (_initial_state(system, initial or {}, modes, order) for order in (0, 1))
        total = answer(still, BaseMotion(), "base", (q, u))
    for gamma, history in driven(system, histories, modes):
        if isinstance(history, Force):
            added = answer(gamma, history.profile, "base")
        else:
            added = answer(gamma, history, start)
        total = added if total is None else total + added
    assert total is not None
    return total


def slipping_problem(
    system: System, motion: Any, modes: int, zeta: Any, start: Start = "inertial", initial: Any = None
) -> Slipping:
    """Return the problem in time of a system with elastic-slip elements, its arguments checked as by `response`."""
    check_start(start)
    base = system.without_hysteresis
    state = (_initial_state(base, initial or {}, modes, 0), _initial_state(base, initial or {}, modes, 1))
    loads = driven(base, histories_of(base, motion), modes)
    return slipping(system, loads, modes, _ratios(base, modes, zeta), start, state, _check_sampling)


def _has_complex_modes(system: System, modes: int) -> bool:
    """Return whether the motion is a sum of complex modes: whether dampers couple natural modes, or there are none."""
    kind = system.numerics("complex_modes")
    if kind != "if coupled":
        return bool(kind == "always")
    matrix = Projected(system.domain, system.modes(modes), system.numerics("damping"))["damping"]
    own = np.sqrt(np.abs(np.einsum("...ii->...i", matrix)))
    coupling = np.abs(matrix) - own[..., :, None] * own[..., None, :] * (np.eye(modes) + _UNCOUPLED)
    return bool((coupling > 0.0).any())


def _check_sampling(motion: BaseMotion, omega: Array) -> None:
    """Warn of modes above half the sampling rate of a record."""
    if motion.sample_step is None:
        return
    most = float(np.pi / motion.sample_step)
    beyond = np.flatnonzero((omega > most).reshape(-1, omega.shape[-1]).any(axis=0))
    if beyond.size:
        first = int(beyond[0]) + 1
        frequency = np.max(omega[..., first - 1]) / (2 * np.pi)
        warnings.warn(
            f"the record is sampled at {1 / motion.sample_step:.4g} Hz and tells nothing above half of that: mode "
            f"{first} has {frequency:.4g} Hz; take fewer than {first} modes, or sample faster",
            UndersamplingWarning,
            stacklevel=6,
        )


def _initial_state(system: System, initial: Mapping[Any, Any], modes: int, order: int) -> Array:
    """Return the modal displacements (order 0) or velocities (1) of given fields at t = 0: products with the mass."""
    if not initial:
        return np.zeros(modes)
    from cra_sym.model.derivations import momentum

    load = momentum(system.model, initial, order)
    return np.zeros(modes) if load is None else system.project(load, modes)
