"""The paper's arm in its dimensionless groups."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from cra_sym import checks
from cra_sym.arm.parameters import Arm
from cra_sym.model.system import MOST_MODES
from cra_sym.si import Numbers, paired

__all__ = ["frequency_parameters"]


def frequency_parameters(
    kappa_t: Numbers, kappa_r: Numbers, mu: Numbers, iota: Numbers = 0.0, modes: int = 3
) -> NDArray[np.float64]:
    """Return the frequency parameters lambda = beta L of the paper's arm, the zeros of its determinant (22).

    Parameters
    ----------
    kappa_t, kappa_r : array_like
        Dimensionless translational and rotational stiffness of the joint, in ``[0, inf]``.
    mu, iota : array_like
        Mass and rotary inertia of the end-effector over those of the arm, in ``[0, inf)``.
    modes : int
        How many, 1 to 1000; rigid-body modes count, with lambda = 0.

    Returns
    -------
    ndarray, shape (..., modes)
        Ascending; none is missed. The relative error is a few units in the last place.

    Raises
    ------
    TypeError, ValueError
        If an argument is out of its range or the shapes do not broadcast together.

    Examples
    --------
    >>> import numpy as np
    >>> print(np.round(frequency_parameters(np.inf, np.inf, 0.0), 6))
    [1.875104 4.694091 7.854757]
    """
    modes = checks.count("modes", modes, high=MOST_MODES)
    given = paired({"kappa_t": kappa_t, "kappa_r": kappa_r, "mu": mu, "iota": iota})
    arrays = {
        name: checks.real_array(name, value, low=0.0, allow_infinite=name.startswith("kappa"), unit="1")
        for name, value in given.items()
    }
    checks.broadcastable(**arrays)
    groups = {"k_t": "kappa_t", "k_r": "kappa_r", "m_e": "mu", "J_e": "iota"}
    unit = {"L": 1.0, "b": 1.0, "h": 1.0, "E": 12.0, "rho": 1.0, "m_b": 1.0}  # E I = rho A = L = 1
    return np.sqrt(Arm(**unit, **{name: arrays[group] for name, group in groups.items()}).natural_frequencies(modes))
