"""The named excitation of the paper's arm: a bolted joint whose preload fluctuates, (35b)."""

from __future__ import annotations

from typing import Any

from cra_sym.model.excitations import Fluctuation
from cra_sym.model.values import Value

__all__ = ["JointStiffness"]


class JointStiffness(Fluctuation):
    """A bolted joint whose preload fluctuates: each stiffness is k (1 + weight epsilon cos(varpi t)), (35b).

    Parameters
    ----------
    k_t, k_r : array_like
        Weights of the translational and the rotational spring, not negative.

    Raises
    ------
    TypeError, ValueError
        If a weight is not made of finite real numbers or is negative, or the arrays do not broadcast together.

    Examples
    --------
    >>> JointStiffness()
    JointStiffness(k_t=1.0, k_r=0.0)
    """

    def __init__(self, k_t: Any = 1.0, k_r: Any = 0.0) -> None:
        super().__init__(k_t=k_t, k_r=k_r)

    @property
    def k_t(self) -> Value:
        """Weight of the translational spring."""
        return self.weights["k_t"]

    @property
    def k_r(self) -> Value:
        """Weight of the rotational spring."""
        return self.weights["k_r"]
