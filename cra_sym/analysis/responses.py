"""Responses (34) of a system to prescribed motions, forces and initial states."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from cra_sym.analysis.complex_responses import complex_response
from cra_sym.analysis.histories import Histories, History, check_no_support, driven, supports
from cra_sym.analysis.histories import histories as histories_of
from cra_sym.analysis.modes import check_places, displaced, section_place
from cra_sym.analysis.nonlinear_response import nonlinear_response
from cra_sym.analysis.slipping import Slipping, slipping, slipping_outputs
from cra_sym.checks import broadcastable, count, default_floating_point, instance, one_axis, shown
from cra_sym.kernels import derived_kernel
from cra_sym.model.projection import Projected
from cra_sym.model.routes import Modes
from cra_sym.model.system import MOST_MODES, System
from cra_sym.model.values import checked_damping
from cra_sym.si import Numbers, plain_numbers
from cra_sym.solvers import modal_response as solver
from cra_sym.solvers.coupled_modes import CoupledModes, coupled_response
from cra_sym.solvers.driven_modes import Start, check_start, driven_response
from cra_sym.solvers.force import Force
from cra_sym.solvers.motion import BaseMotion

if TYPE_CHECKING:
    from sympy import Expr
    from sympy.core.function import AppliedUndef

__all__ = [
    "UndersamplingWarning", "check_sampling", "has_complex_modes", "oscillators", "response", "slipping_problem",
    "tip_response",
]  # fmt: skip

Array = NDArray[np.float64]
_UNCOUPLED = 1e-8  # damping between two modes over the geometric mean of their own, below which they count as uncoupled


class UndersamplingWarning(UserWarning):
    """Modes lie above half the sampling rate of a record, which has no information on their excitation.

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
    motion: BaseMotion | Histories | None,
    t: Numbers,
    modes: int = 5,
    derivative: int = 0,
    *,
    zeta: Numbers | None = None,
    start: Start = "inertial",
    initial: Mapping[Expr, Expr] | None = None,
    field: AppliedUndef | None = None,
) -> Array:
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
    place = section_place(system, field, lumped=True)

    def tip(found: Modes) -> Array:
        return displaced(system, found, place)[..., None, :]

    values = _oscillation(system, motion, tip, t, modes, derivative, zeta, start, initial)[..., 0, :]
    return values if np.ndim(plain_numbers("t", t, "s")) else values[..., 0]


@default_floating_point
def response(
    system: System,
    motion: BaseMotion | Histories | None,
    t: Numbers,
    x: Numbers,
    modes: int = 5,
    derivative: int = 0,
    *,
    zeta: Numbers | None = None,
    start: Start = "inertial",
    initial: Mapping[Expr, Expr] | None = None,
    field: AppliedUndef | None = None,
) -> Array:
    """Return a field in time, seen from the moving base, or its time derivatives, equation (34).

    The sum over modes of phi_i(x) q_i(t), with Duhamel's integral (12) in closed form: exact at and near every
    resonance, with and without damping, and for rigid-body modes. At 64 or more uniform times each costs a few
    nanoseconds.

    With local dampers, gyroscopic forces or forces that follow the motion, the sum is over the lowest complex modes (2
    ``modes`` eigenvalues), computed from the exponential of their state matrix. Material damping (Kelvin-Voigt) that
    couples the natural modes has eigenvalues that accumulate; all motions of a basis in which ``modes`` modes have
    converged are then summed. A nonlinear system (not a batch) is integrated in time to a relative error of about 1e-9,
    its linear modes exactly. A system with elastic-slip elements, and polynomial terms beside them, is followed exactly
    from event to event in the modes that it has without the elements; see `slip_response`.

    Parameters
    ----------
    system : System
        Batch axes broadcast with those of the motion.
    motion : BaseMotion, or mapping of function of t, or its name, to BaseMotion or Force, or None
        Histories of the prescribed motions and of the forces of the Lagrangian and of the virtual work, from t = 0 on.
        A bare BaseMotion is that of the only prescribed motion. A motion may act by its displacement and velocity too,
        as that of the support of a spring or a damper does; modal damping then opposes the motion of the fields as the
        Lagrangian measures them. Constant loads act from t = 0.
    t : array_like
        Time or one axis of times, s, not negative; any order.
    x : array_like
        Place or one axis of places in the domain, m.
    modes : int
        Modes in the sum, 1 to 1000. What the others contribute is left out: of the motion of a uniform cantilever
        under a sudden force at its tip five leave out 3e-4 at the tip and 5e-4 at a quarter of the length; where the
        outer half is a hundred times more flexible, 5e-4 and 2e-2. Velocities, accelerations and strains converge more
        slowly; twice as many modes show the difference.
    derivative : {0, 1, 2}
        Displacement (m), velocity (m/s) or acceleration (m/s2). A velocity is that to the right of a jump.
    zeta : array_like, optional
        Damping ratios in [0, 1), a last axis of ``modes`` values or one for all; default is that of the system.
    start : {'inertial', 'base'}
        At rest before t = 0 in the inertial frame (an initial base velocity then acts as an impulse,
        q_i'(0) = -Gamma_i w'(0+)/M_i), or at rest relative to the moving base.
    initial : mapping of field, coordinate or its first time derivative to an expression in x, optional
        State at t = 0 in addition to that of the start, such as ``{v: a*x**2, v.diff(t): 0}``.
    field : applied undefined function, optional
        A field (default: the first), or a lumped coordinate, which is the same at every x.

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
        Names the argument that is out of its range, the load without a history, or the unknown function.

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
    check_places(system, places, cure="use tip_response")
    modes = count("modes", modes, high=MOST_MODES)
    place = section_place(system, field, lumped=True)

    def along(found: Modes) -> Array:
        return np.swapaxes(displaced(system, found, place, np.atleast_1d(places)), -1, -2)

    values = _oscillation(system, motion, along, t, modes, derivative, zeta, start, initial)
    values = values if places.ndim else values[..., 0, :]
    return values if np.ndim(plain_numbers("t", t, "s")) else values[..., 0]


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
        rows = outputs(system.basis.modes(modes))
        for history in histories.values():
            profile = history.profile if isinstance(history, Force) else history
            check_sampling(profile, system.basis.natural_frequencies(modes))
        return nonlinear_response(system, histories, rows, t, modes, derivative, state, start, zeta)
    ratio = np.asarray(system.zeta if zeta is None else checked_damping(zeta))
    alike = ratio.ndim == 0 or ratio.shape[-1] == 1 or zeta is None
    if alike and has_complex_modes(system, modes):
        ratio = ratio[..., 0] if zeta is not None and ratio.ndim else ratio
        return complex_response(system, histories, outputs, t, modes, derivative, ratio, start, initial, check_sampling)
    rows, still = outputs(system.modes(modes)), np.zeros(modes)
    damping = system.numerics("damping")
    matrix = None if damping is None else Projected(system.domain, system.modes(modes), damping)["damping"]

    def answer(gamma: Array, profile: BaseMotion, begin: Start, state: Any = None) -> Array:
        osc = oscillators(system, gamma, rows, modes, zeta)
        check_sampling(profile, osc.omega)
        if matrix is not None and matrix.any():
            return coupled_response(
                CoupledModes(osc.omega, osc.zeta, matrix, gamma, rows), profile, t, derivative, begin, state
            )
        return driven_response(osc, profile, t, derivative, begin, state)

    def supported(name: str) -> Array:
        profile = histories[name]
        assert isinstance(profile, BaseMotion)
        osc = oscillators(system, still, rows, modes, zeta)
        check_sampling(profile, osc.omega)
        loads = system.numerics("loads", name)
        below, shifted, gamma = (-system.project(loads[k], modes) if k in loads else still for k in range(3))
        damping = np.zeros((modes, modes)) if matrix is None else matrix
        support = np.stack(np.broadcast_arrays(below, shifted), axis=-2)
        found = CoupledModes(osc.omega, osc.zeta, damping, gamma, rows, support)
        return coupled_response(found, profile, t, derivative, start)

    total: Array | None = None
    if initial or not histories:
        q, u = (_initial_state(system, initial or {}, modes, order) for order in (0, 1))
        total = answer(still, BaseMotion(), "base", (q, u))
    moving = supports(system)
    for name in moving:
        added = supported(name)
        total = added if total is None else total + added
    others = {name: history for name, history in histories.items() if name not in moving}
    for gamma, history in driven(system, others, modes):
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
    """Return the time-domain problem of a system with elastic-slip elements; arguments are checked as in `response`."""
    check_start(start)
    base = system.without_hysteresis
    state = (_initial_state(base, initial or {}, modes, 0), _initial_state(base, initial or {}, modes, 1))
    check_no_support(base)
    loads = driven(base, histories_of(base, motion), modes)
    return slipping(system, loads, modes, _ratios(base, modes, zeta), start, state, check_sampling)


def has_complex_modes(system: System, modes: int) -> bool:
    """Return whether complex modes are needed: dampers couple the natural modes, or there are no natural modes."""
    kind = system.numerics("complex_modes")
    if kind != "if coupled":
        return bool(kind == "always")
    matrix = Projected(system.domain, system.modes(modes), system.numerics("damping"))["damping"]
    own = np.sqrt(np.abs(np.einsum("...ii->...i", matrix)))
    coupling = np.abs(matrix) - own[..., :, None] * own[..., None, :] * (np.eye(modes) + _UNCOUPLED)
    return bool((coupling > 0.0).any())


def check_sampling(motion: BaseMotion, omega: Array) -> None:
    """Warn of modes above half the sampling rate of a record."""
    if motion.sample_step is None:
        return
    most = float(np.pi / motion.sample_step)
    beyond = np.flatnonzero((omega > most).reshape(-1, omega.shape[-1]).any(axis=0))
    if beyond.size:
        first = int(beyond[0]) + 1
        frequency = np.max(omega[..., first - 1]) / (2 * np.pi)
        warnings.warn(
            f"the record is sampled at {1 / motion.sample_step:.4g} Hz and has no information above half of that: mode "
            f"{first} has {frequency:.4g} Hz; take fewer than {first} modes, or sample faster",
            UndersamplingWarning,
            stacklevel=6,
        )


def _initial_state(system: System, initial: Mapping[Any, Any], modes: int, order: int) -> Array:
    """Return the modal displacements (order 0) or velocities (1) of given fields at t = 0: products with the mass."""
    if not initial:
        return np.zeros(modes)
    from cra_sym.model.loads import momentum

    load = momentum(system.model, initial, order)
    return np.zeros(modes) if load is None else system.project(load, modes)
