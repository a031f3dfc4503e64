"""The arm with the sign of the rotational spring's energy flipped: frequencies that rise as k_r falls.

The paper reports (Fig. 4) that f2 and f3 rise as the rotational stiffness of the joint falls. According to the
derivation they fall. With one sign of the Lagrangian reversed, Hamilton's principle gives the condition EI v_xx(0) =
-k_r v_x(0) at the root, whose frequencies rise. Its potential energy is not positive definite: the arm would buckle
without load.
"""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np
from scipy.optimize.elementwise import find_root

from cra_sym import checks
from cra_sym.arm.frequency_parameters import frequency_parameters
from cra_sym.arm.parameters import Arm
from cra_sym.kernels import derived_kernel
from cra_sym.paper.oracles.implicit_rates import weights

__all__ = ["characteristic", "flipped", "flipped_frequencies"]


@cache
def flipped() -> Any:
    """Return the result of Hamilton's principle with the sign of the energy of the rotational spring reversed."""
    from cra_sym.arm.lagrangian import paper_lagrangian
    from cra_sym.mechanics import hamilton
    from cra_sym.paper.energy import L, k_r, t, v, w, x

    density, left, right = paper_lagrangian()
    wrong = left - 2 * k_r * left.coeff(k_r)
    return hamilton(density, fields=[v], prescribed=[w], x=x, domain=(0, L), t=t, left=wrong, right=right)


def characteristic() -> tuple[Any, tuple[Any, ...]]:
    """Return the frequency function of the flipped arm and its arguments (lamda, s_t, c_t, s_r, c_r, mu, iota)."""
    from cra_sym.paper.frequency_equation import frequency_function, separated

    return separated(flipped()), frequency_function()[1]


_function = derived_kernel("cra_sym.paper.flipped:characteristic")


def flipped_frequencies(arm: Arm, modes: int = 3) -> np.ndarray:
    """Return the real natural frequencies, in Hz, of the arm with the reversed sign that start from those of the rigid
    joint.

    Its roots lie between those of the arm with rigid rotation and the next ones of the arm without rotational spring;
    those of the actual arm lie on the other side. One further mode has a negative squared frequency and does not
    oscillate.

    Parameters
    ----------
    arm : Arm
        May hold arrays.
    modes : int

    Returns
    -------
    ndarray, shape (..., modes)
    """
    modes = checks.count("modes", modes)
    kappa_t, kappa_r, mu, iota = np.broadcast_arrays(arm.kappa_t, arm.kappa_r, arm.mu, arm.iota)
    low = frequency_parameters(kappa_t, np.inf, mu, iota, modes)
    high = frequency_parameters(kappa_t, 0.0, mu, iota, modes + 1)[..., 1:]
    groups = (*weights(kappa_t), *weights(kappa_r), mu, iota)
    arguments = tuple(np.broadcast_to(group[..., None], low.shape) for group in groups)
    root = find_root(_function, (low * (1 - 1e-12), high * (1 + 1e-12)), args=arguments)
    if not np.all(root.success):
        raise ArithmeticError("a root of the flipped arm was not bracketed")
    scale = np.asarray(arm.angular_frequency_scale)[..., None]
    found: np.ndarray = root.x**2 * scale / (2.0 * np.pi)
    return found
