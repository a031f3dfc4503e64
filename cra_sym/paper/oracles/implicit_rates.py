"""Rates of the squared natural frequencies by implicit differentiation, (31) and (32): a second route to sensitivities.

It differentiates the determinant (23), while :mod:`cra_sym.analysis.sensitivities` uses perturbation of the modes. Near
lambda = 0 the derivatives of the determinant cancel.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from cra_sym.arm.parameters import Arm
from cra_sym.kernels import derived_kernel

if TYPE_CHECKING:
    from sympy import Expr, Symbol

__all__ = ["implicit_rates", "squared_frequency_rates"]


def implicit_rates(arm: Arm, modes: int = 3) -> dict[str, NDArray[np.float64]]:
    """Return the rates of the squared angular natural frequencies by the parameters of joint and end-effector.

    Parameters
    ----------
    arm : Arm
        May hold arrays, and stiffnesses of zero and infinity.
    modes : int
        How many, 1 to 1000.

    Returns
    -------
    dict of str to ndarray, shape (..., modes)
        By ``'k_t'``, ``'k_r'``, the compliances ``'c_t'`` = 1/k_t and ``'c_r'`` = 1/k_r, ``'m_e'`` and ``'J_e'``, in
        1/s2 over the SI unit of the parameter; nan for a rigid-body mode.

    Examples
    --------
    >>> arm = Arm.nominal().replace(k_t=1e3, k_r=1e3)
    >>> logarithmic = arm.k_t * implicit_rates(arm)["k_t"] / (2 * arm.natural_frequencies(3) ** 2)
    >>> print(logarithmic.round(4))
    [0.0173 0.2076 0.204 ]
    """

    def column(value: Any) -> NDArray[np.float64]:
        return np.broadcast_to(value, arm.shape)[..., None]

    lam = np.sqrt(arm.natural_frequencies(modes) / column(arm.angular_frequency_scale))
    pairs = [column(part) for kappa in (arm.kappa_t, arm.kappa_r) for part in weights(kappa)]
    others = (column(value) for value in (arm.mu, arm.iota, arm.L, arm.E, arm.I, arm.rho, arm.A))
    with np.errstate(divide="ignore", invalid="ignore"):  # 0/0 for a rigid-body mode
        found: dict[str, NDArray[np.float64]] = _rates(lam, *pairs, *others)
    return found


def weights(kappa: Any) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return (s, c) = (kappa, 1) / (1 + kappa), which is (1, 0) for infinity."""
    rigid = np.isinf(kappa)
    soft = np.where(rigid, 0.0, 1.0 / (1.0 + np.where(rigid, 0.0, kappa)))
    return np.where(rigid, 1.0, np.where(rigid, 0.0, kappa) * soft), soft


def squared_frequency_rates() -> tuple[dict[str, Expr], tuple[Symbol, ...]]:
    """Return the derivatives of omega^2 by the parameters of joint and end-effector, and their arguments."""
    from cra_sym.paper.frequency_equation import frequency_function
    from cra_sym.paper.groups import GROUPS
    from cra_sym.paper.implicit import PAIRS, implicit_derivatives
    from cra_sym.paper.limits import natural_frequency
    from cra_sym.symbols import symbol

    lamda, *groups = frequency_function()[1]
    square = (2 * np.pi * natural_frequency().rhs) ** 2
    rates = {}
    for parameter, (group, value) in GROUPS.items():
        rate = square.diff(lamda) * _decaying(implicit_derivatives()[group.name], lamda)
        unit, (kind, end) = value.diff(parameter), parameter.name.split("_")
        if kind == "k":
            spring, soft = PAIRS[end]  # the derivatives of kappa by k and by 1/k are unit and -kappa^2 / unit
            rates[f"c_{end}"] = -rate * spring**2 / unit
            rate *= soft**2
        rates[parameter.name] = rate * unit
    return rates, (lamda, *groups, *(symbol(name) for name in ("L", "E", "I_z", "rho", "A")))


def _decaying(ratio: Expr, lamda: Symbol) -> Expr:
    """Return a ratio of expressions linear in cosh and sinh of lamda with exp(-lamda), which does not overflow."""
    from sympy import cosh, exp, fraction, sinh

    decay = exp(-lamda)
    grown = {cosh(lamda): (1 + decay**2) / 2, sinh(lamda): (1 - decay**2) / 2}

    def scaled(expression: Expr) -> Expr:
        expanded = expression.expand()
        rest = expanded.subs(dict.fromkeys(grown, 0))
        return sum((expanded.coeff(function) * value for function, value in grown.items()), decay * rest)

    above, below = fraction(ratio)
    return scaled(above) / scaled(below)


_rates = derived_kernel("cra_sym.paper.oracles.implicit_rates:squared_frequency_rates", backend="numpy")
