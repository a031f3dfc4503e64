"""The arm as a linear system for control design: from base acceleration, or from the force on a free base, to the
tip."""

from __future__ import annotations

from typing import Any, Literal

import numpy as np

from cra_sym.analysis.modes import modal_parameters
from cra_sym.arm.parameters import Arm
from cra_sym.checks import choice, count, instance

__all__ = ["state_space"]


def state_space(
    arm: Arm, modes: int = 3, input: Literal["base_acceleration", "drive_force"] = "base_acceleration"
) -> Any:
    """Return the continuous-time system from the input to the elastic displacement v(L, t) of the tip.

    Parameters
    ----------
    arm : Arm
        One arm, no batch.
    modes : int
        Modes kept, 1 to 1000.
    input : {'base_acceleration', 'drive_force'}
        The base acceleration w'' (m/s2) is prescribed: states q_i, q_i', equation (11). Or a force F (N) drives a
        free base of mass m_b, (m_b + m_e + rho A L) w'' + sum Gamma_i q_i'' = F: states w, q_i, w', q_i'.

    Returns
    -------
    scipy.signal.StateSpace
        An initial base velocity is the state q_i' = -Gamma_i w'(0+). ``scipy.signal.lsim`` interpolates its input
        linearly between the samples.

    Raises
    ------
    TypeError, ValueError
        If ``arm`` is no :class:`Arm` or a batch, ``modes`` no integer from 1 to 1000, or ``input`` neither of the two.

    Examples
    --------
    >>> from cra_sym import Arm, state_space
    >>> state_space(Arm.nominal(), modes=2).A.shape
    (4, 4)
    """
    from scipy.signal import StateSpace

    instance("arm", arm, Arm)
    choice("input", input, ("base_acceleration", "drive_force"))
    if arm.shape:
        raise ValueError(f"arm has shape {arm.shape}: allowed is a single arm")
    p = modal_parameters(arm, count("modes", modes))
    if input == "base_acceleration":
        mass, stiffness, damping = np.eye(modes), np.diag(p.omega**2), np.diag(2 * float(arm.zeta) * p.omega)
        push, tip = -p.participation, p.tip_displacement
    else:
        whole = arm.m_b + arm.m_e + arm.rhoA * arm.L
        mass = np.block([[np.array([[whole]]), p.participation[None]], [p.participation[:, None], np.eye(modes)]])
        stiffness, damping = (np.diag([0.0, *d]) for d in (p.omega**2, 2 * float(arm.zeta) * p.omega))
        push, tip = np.eye(modes + 1)[0], np.array([0.0, *p.tip_displacement])
    size = push.size
    accelerations = np.linalg.solve(mass, np.hstack([-stiffness, -damping, push[:, None]]))
    A = np.vstack([np.hstack([np.zeros((size, size)), np.eye(size)]), accelerations[:, :-1]])
    B = np.concatenate([np.zeros(size), accelerations[:, -1]])[:, None]
    return StateSpace(A, B, np.concatenate([tip, np.zeros(size)])[None], np.zeros((1, 1)))
