"""A system as a linear one for control design: from base acceleration, or from the force on a free base, to the tip."""

from __future__ import annotations

from typing import TYPE_CHECKING, Literal

import numpy as np

from cra_sym.analysis.modes import only_motion, participation
from cra_sym.checks import choice, count, default_floating_point, instance
from cra_sym.model.projection import Projected
from cra_sym.model.system import MOST_MODES, System

if TYPE_CHECKING:
    from scipy.signal import StateSpace

__all__ = ["state_space"]


@default_floating_point
def state_space(
    system: System, modes: int = 3, input: Literal["base_acceleration", "drive_force"] = "base_acceleration"
) -> StateSpace:
    """Return the continuous-time system from the input to the displacement of the tip seen from the base.

    Parameters
    ----------
    system : System
        One set of values, not a batch.
    modes : int
        Modes kept, 1 to 1000.
    input : {'base_acceleration', 'drive_force'}
        The base acceleration w'' (m/s2), of the only prescribed motion: states q_i, q_i', equation (11). Or a force F
        (N) drives the free base; of an arm (m_b + m_e + rho A L) w'' + sum Gamma_i q_i'' = F: states w, q_i, w', q_i'.

    Returns
    -------
    scipy.signal.StateSpace
        An initial base velocity is the state q_i' = -Gamma_i w'(0+). ``scipy.signal.lsim`` interpolates its input
        linearly between the samples.

    Raises
    ------
    TypeError, ValueError
        If ``system`` is not a :class:`System` or is a batch, its model does not have one prescribed motion, ``modes``
        is not an integer from 1 to 1000, or ``input`` is neither of the two.

    Examples
    --------
    >>> from cra_sym import Arm, state_space
    >>> state_space(Arm.nominal(), modes=2).A.shape
    (4, 4)
    """
    from scipy.signal import StateSpace

    instance("system", system, System)
    choice("input", input, ("base_acceleration", "drive_force"))
    if system.shape:
        raise ValueError(f"system has shape {system.shape}: must be a single set of values, not a batch")
    modes = count("modes", modes, high=MOST_MODES)
    motion = only_motion(system)
    omega, gamma = system.natural_frequencies(modes), participation(system, modes, motion)
    tip = system.modes(modes).displacement(1, 0)
    mass, stiffness, damping = np.eye(modes), np.diag(omega**2), np.diag(2 * float(system.zeta) * omega)
    dampers = system.numerics("damping")
    if dampers is not None:
        damping = damping + Projected(system.domain, system.modes(modes), dampers)["damping"]
    push = -gamma
    if input == "drive_force":
        own = system.numerics("carried", motion).function(*system.domain.values)
        mass, damping, stiffness = (np.pad(matrix, ((1, 0), (1, 0))) for matrix in (mass, damping, stiffness))
        mass[0, 0], damping[0, 0], stiffness[0, 0] = (float(value) for value in own)
        mass[0, 1:] = mass[1:, 0] = gamma
        push, tip = np.eye(modes + 1)[0], np.array([0.0, *tip])
    size = push.size
    accelerations = np.linalg.solve(mass, np.hstack([-stiffness, -damping, push[:, None]]))
    A = np.vstack([np.hstack([np.zeros((size, size)), np.eye(size)]), accelerations[:, :-1]])
    B = np.concatenate([np.zeros(size), accelerations[:, -1]])[:, None]
    return StateSpace(A, B, np.concatenate([tip, np.zeros(size)])[None], np.zeros((1, 1)))
