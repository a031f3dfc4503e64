"""Elastic-slip elements in the time domain: forces, slip, events, energy balance."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from cra_sym.analysis.histories import Histories, History
from cra_sym.analysis.modes import displaced, section_place
from cra_sym.analysis.responses import slipping_problem
from cra_sym.checks import ByValue, count, default_floating_point, instance, one_axis
from cra_sym.model.system import MOST_MODES, System
from cra_sym.si import Numbers
from cra_sym.solvers.driven_modes import Start
from cra_sym.solvers.slip_records import Ledger
from cra_sym.solvers.slip_statics import first_forces
from cra_sym.solvers.slipping import Events

if TYPE_CHECKING:
    from sympy import Expr
    from sympy.core.function import AppliedUndef

__all__ = ["SlipEvent", "SlipResponse", "slip_response"]

Array = NDArray[np.float64]


@dataclass(frozen=True)
class SlipEvent:
    """A change between stick and slip.

    Attributes
    ----------
    time : float
        s, to rounding.
    element : int
        Index of the Jenkins element, among those of all elements of the model.
    state : int
        0 if it sticks from then on; 1 or -1 if it slips, force and velocity being positive or negative.

    Examples
    --------
    >>> import cra_sym as cra
    >>> first = cra.SlipEvent(time=0.2, element=0, state=-1)
    >>> "sticks" if first.state == 0 else "slips"
    'slips'
    """

    time: float
    element: int
    state: int


@dataclass(frozen=True, eq=False)
class SlipResponse(ByValue):
    """A motion with elastic-slip elements in time, seen from the frame that moves.

    The elements here are Jenkins elements: one for a Jenkins of the model, several for an Iwan.

    Attributes
    ----------
    time : ndarray, shape (T,)
        s.
    tip : ndarray, shape (..., T)
        Displacement of the tip, m, or of the field or coordinate chosen.
    displacement : ndarray, shape (..., D, T)
        Displacements with elements, m (rad).
    force : ndarray, shape (..., E, T)
        Forces of the elements, N (N m).
    state : ndarray of int8, shape (..., E, T)
        0 where an element sticks, 1 or -1 where it slips in that direction, just before each time.
    kinetic, potential, elastic : ndarray, shape (..., T)
        Stored energies, J: of the masses, of the structure with its polynomial terms, of the springs of the elements.
    work, dampers : ndarray, shape (..., T)
        Work of the loads, including inertia forces of the moving frame, and energy dissipated by dampers, polynomial
        forces without a potential, and modal damping since t = 0, J.
    dissipated : ndarray, shape (..., E, T)
        Energy dissipated by each slider, J.
    initial : ndarray, shape (...)
        Energy at t = 0, J.
    events : ndarray of object, shape (...)
        For each member of the batch a tuple of :class:`SlipEvent`, in the order of time.

    Examples
    --------
    What :func:`cra_sym.slip_response` returns: what one slider of a joint takes while the base moves and stops.

    >>> from sympy import symbols
    >>> import cra_sym as cra
    >>> from cra_sym.symbols import v
    >>> arm, (k_d, f_s) = cra.Arm.nominal().replace(k_t=1e3), symbols("k_d f_s")
    >>> model = arm.model.replace(hysteresis=[(cra.Jenkins(k_d, f_s), v, "left")])
    >>> move = cra.BaseMotion.trapezoid(0.3, 0.5, 2.0)
    >>> found = cra.slip_response(model.at({**arm.values, "k_d": 5e3, "f_s": 0.3}), move, [0.5, 1.0])
    >>> found.tip.shape, found.dissipated.shape, bool((found.dissipated > 0).all())
    ((2,), (1, 2), True)
    """

    time: Array
    tip: Array
    displacement: Array
    force: Array
    state: NDArray[np.int8]
    kinetic: Array
    potential: Array
    elastic: Array
    work: Array
    dampers: Array
    dissipated: Array
    initial: Array
    events: NDArray[np.object_]

    @property
    def imbalance(self) -> Array:
        """Relative rounding error of the energy balance (stored plus dissipated energy minus work), shape (...)."""
        stored = self.kinetic + self.potential + self.elastic
        taken = self.dampers + self.dissipated.sum(axis=-2)
        there = self.initial[..., None] + self.work
        scale = np.maximum(np.abs(there), stored).max(axis=-1)
        gap = np.abs(stored + taken - there).max(axis=-1)
        return np.asarray(gap / np.where(scale > 0, scale, 1.0))


@default_floating_point
def slip_response(
    system: System,
    motion: History | Histories | None,
    t: Numbers,
    modes: int = 5,
    *,
    zeta: Numbers | None = None,
    start: Start = "inertial",
    initial: Mapping[Expr, Expr] | None = None,
    field: AppliedUndef | None = None,
) -> SlipResponse:
    """Return the time history of elastic-slip elements: states, forces, events, energies.

    Between two events the motion is linear and computed exactly; with polynomial terms beside the elements it is a
    Taylor series of degree 36, its steps so short that the last terms are rounding. Events are located to rounding, and
    none is missed, however short the slip. The modes are those without the elements; omitted modes respond statically
    to the forces of the elements, but not to the loads: take more modes where a force acts near an element. Sliders are
    at zero at t = 0.

    Parameters
    ----------
    system : System
        Of a model with ``hysteresis``; batch axes broadcast with those of the motion.
    motion, modes, zeta, start, initial, field
        As in :func:`cra_sym.response`; ``tip`` of the result is the field at the right end, or the lumped coordinate.
    t : array_like
        One axis of ascending times, s, not negative.

    Returns
    -------
    SlipResponse

    Raises
    ------
    TypeError, ValueError
        If the system has no elastic-slip elements, or has nonlinear inertia, nonlinear terms with known motions or
        forces, gyroscopic or follower forces; if the motion diverges; otherwise as :func:`cra_sym.response`.

    Examples
    --------
    >>> from sympy import symbols
    >>> import cra_sym as cra
    >>> from cra_sym.symbols import v
    >>> k_d, f_s = symbols("k_d f_s")
    >>> arm = cra.Arm.nominal().replace(k_t=1e3)
    >>> model = arm.model.replace(hysteresis=[(cra.Jenkins(k_d, f_s), v, "left")])
    >>> slipping = model.at({**arm.values, "k_d": 5e3, "f_s": 0.3})
    >>> found = cra.slip_response(slipping, cra.BaseMotion.trapezoid(0.3, 0.5, 2.0), [0.0, 0.2, 2.0])
    >>> [(round(event.time, 4), event.state) for event in found.events[()][:2]]
    [(0.0344, -1), (0.041, 0)]
    >>> bool(found.imbalance < 1e-12)
    True
    """
    instance("system", system, System)
    if not system.model.pieces["hysteresis"]:
        raise ValueError("system: has no elastic-slip elements; give its model hysteresis=[..], or use response")
    times = np.atleast_1d(one_axis("t", t, "times", low=0.0, unit="s"))
    if not times.size:
        raise ValueError("t = []: must be one time or more")
    if (np.diff(times) <= 0).any():
        raise ValueError(f"t[{int(np.argmax(np.diff(times) <= 0)) + 1}]: must ascend")
    modes = count("modes", modes, high=MOST_MODES)
    place = section_place(system.without_hysteresis, field, lumped=True)
    problem = slipping_problem(system, motion, modes, zeta, start, initial)
    begin = (problem.start.displacement, problem.start.velocity)
    force = first_forces(problem.modes, begin[0])
    grid = np.unique(np.concatenate([[0.0], times]))  # t = 0 is part of the balance
    ledger = Ledger(problem.modes, grid, (*begin, force))
    events = problem.follow(grid[-1], ledger, grid)
    kept = ledger.energies
    asked = slice(None) if times[0] == 0.0 else slice(1, None)
    tip = problem.members(displaced(problem.base, problem.base.modes(modes), place)[..., None, :])[0]

    def found(values: Array) -> Array:
        """Return values (members, times) at the requested times."""
        return values.reshape(*problem.shape, grid.size)[..., asked]

    def by_element(values: Array) -> Array:
        return problem.shaped(values)[..., asked]

    return SlipResponse(
        time=times,
        tip=found(np.einsum("np,npt->pt", tip, ledger.q)),
        displacement=by_element(kept.displacement),
        force=by_element(kept.force),
        state=by_element(kept.state.astype(float)).astype(np.int8),
        kinetic=found(kept.kinetic),
        potential=found(kept.potential),
        elastic=found(kept.elements),
        work=found(kept.input),
        dampers=found(kept.dampers),
        dissipated=by_element(kept.sliders),
        initial=(kept.kinetic + kept.potential + kept.elements)[:, 0].reshape(problem.shape),
        events=_events_by_member(events, problem.modes.omega.shape[1]).reshape(problem.shape),
    )


def _events_by_member(events: Events, members: int) -> NDArray[np.object_]:
    """Return the events of each member."""
    order = np.searchsorted(events.member, np.arange(members + 1))
    by_member = np.empty(members, object)
    for k in range(members):
        one = range(order[k], order[k + 1])
        by_member[k] = tuple(
            SlipEvent(float(events.time[j]), int(events.element[j]), int(events.state[j])) for j in one
        )
    return by_member
