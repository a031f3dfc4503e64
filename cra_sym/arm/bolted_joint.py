"""A bolted lap joint at the root of the arm: stiffnesses and slip force as functions of the preload."""

from __future__ import annotations

from dataclasses import dataclass, fields, replace
from functools import cache
from typing import TYPE_CHECKING, Any, cast

import numpy as np
from numpy.typing import NDArray

from cra_sym.checks import count, instance, real_array
from cra_sym.si import Numbers

if TYPE_CHECKING:
    from cra_sym.arm.parameters import Arm
    from cra_sym.model import Model
    from cra_sym.model.system import System

__all__ = ["BoltedJoint"]

_UNITS = {
    "rest": "N/m", "body_t": "N/m", "body_r": "N m/rad", "roughness": "m", "lever": "m", "friction": "1",
    "poisson": "1", "exponent": "1", "reference": "N",
}  # fmt: skip


@dataclass(frozen=True)
class BoltedJoint:
    r"""Stiffnesses and slip force of a bolted lap joint over its preload N.

    Rough faces touch at their asperities, at more of them under a larger load. For exponentially distributed asperity
    heights the normal stiffness of the contact is :math:`N/\sigma` (Greenwood and Williamson), for other distributions
    a power of N (Pohrt and Popov): :math:`K_n = n (N_0/\sigma) (N/N_0)^m` of n faces. The tangential
    stiffness is :math:`2(1-\nu)/(2-\nu)` times that (Mindlin). The members' own stiffness is in series:

    .. math:: 1/k_d = 1/K_\tau + 1/k_{body,t}, \quad 1/k_r = 1/(K_n l^2) + 1/k_{body,r}.

    The faces slide as a whole (macroslip) at Coulomb's force :math:`\mu N n`; the remaining stiffness, of bolts in
    bending and bushings, is k_t. Microslip at smaller forces is left out: see :class:`cra_sym.Iwan`.

    Parameters
    ----------
    rest : float
        k_t, stiffness in parallel with the friction contact, N/m, in [0, inf).
    body_t, body_r : float
        Stiffness of the members, N/m and N m/rad; positive, may be inf.
    roughness : float
        Sigma: the standard deviation of the asperity heights, m; positive.
    lever : float
        Radius of gyration of the contact, m; positive.
    friction : float
        Coefficient of friction; positive.
    faces : int
        Number of sliding faces: 1 for a single lap joint, 2 for a double one.
    poisson : float
        Of the members, in [0, 0.5].
    exponent, reference : float
        m in (0, 1] and N_0, N; with the exponent 1 the reference does not matter.

    Raises
    ------
    TypeError, ValueError
        Names the parameter that is out of its range.

    Notes
    -----
    The defaults are assumed, for the nominal arm: an aluminium joint with little stiffness without friction. A load
    that decreases exponentially with the separation of the faces has a stiffness proportional to it; Pohrt and Popov
    computed
    exponents of 0.51 to 0.77. Mindlin's ratio is that of one circular contact; Campana, Persson and Muser found that it
    holds between rough faces too.

    References
    ----------
    J. A. Greenwood, J. B. P. Williamson, "Contact of nominally flat surfaces", Proceedings of the Royal Society A 295
    (1966), 300-319. R. D. Mindlin, "Compliance of elastic bodies in contact", Journal of Applied Mechanics 16 (1949),
    259-268. R. Pohrt, V. L. Popov, "Normal contact stiffness of elastic solids with fractal rough surfaces", Physical
    Review Letters 108 (2012), 104301. C. Campana, B. N. J. Persson, M. H. Muser, "Transverse and normal interfacial
    stiffness of solids with randomly rough surfaces", Journal of Physics: Condensed Matter 23 (2011), 085001.

    Examples
    --------
    >>> joint = BoltedJoint()
    >>> {name: float(f"{value:.3g}") for name, value in joint.values(10.0).items()}
    {'k_t': 100.0, 'k_r': 196.0, 'k_d': 616000.0, 'slip': 1.5}
    """

    rest: float = 100.0
    body_t: float = 1e6
    body_r: float = 1e4
    roughness: float = 5e-6
    lever: float = 1e-2
    friction: float = 0.15
    faces: int = 1
    poisson: float = 0.33
    exponent: float = 1.0
    reference: float = 1.0

    def __post_init__(self) -> None:
        limits: dict[str, dict[str, Any]] = {name: {"low": 0.0, "open_low": True} for name in _UNITS}
        limits["rest"] = {"low": 0.0}
        limits["body_t"]["allow_infinite"] = limits["body_r"]["allow_infinite"] = True
        limits["poisson"] = {"low": 0.0, "high": 0.5}
        limits["exponent"] |= {"high": 1.0, "must": "a real number in (0, 1]"}
        for name, limit in limits.items():
            value = real_array(name, getattr(self, name), unit=_UNITS[name], **limit)
            if value.ndim:
                raise ValueError(f"{name} has shape {value.shape}: must be one number; preloads may be many")
            object.__setattr__(self, name, float(value))
        object.__setattr__(self, "faces", count("faces", self.faces))

    def replace(self, **changes: float) -> BoltedJoint:
        """Return a validated copy with some parameters changed."""
        unknown = [name for name in changes if name not in {field.name for field in fields(self)}]
        if unknown:
            raise TypeError(f"{unknown[0]!r} is not a parameter of BoltedJoint")
        return replace(self, **cast(dict[str, Any], changes))

    def values(self, preload: Numbers) -> dict[str, NDArray[np.float64]]:
        """Return k_t, k_r, the stiffness k_d and the slip of the Jenkins element, by name.

        Parameters
        ----------
        preload : array_like
            N, positive: the sum over the bolts.

        Returns
        -------
        dict of str to ndarray
            Each of the shape of the preload; N/m, N m/rad, N/m, N.
        """
        N = real_array("preload", preload, low=0.0, open_low=True, unit="N")
        return {name: np.broadcast_to(value, N.shape)[()] for name, value in self._laws(N).items()}

    def _laws(self, N: Any) -> dict[str, Any]:
        """Return k_t, k_r, k_d and slip at a preload, an array or a symbol."""
        normal = self.faces * self.reference / self.roughness * (N / self.reference) ** self.exponent
        sideways = 2 * (1 - self.poisson) / (2 - self.poisson) * normal
        return {
            "k_t": self.rest,
            "k_r": 1.0 / (1.0 / (normal * self.lever**2) + 1.0 / self.body_r),
            "k_d": 1.0 / (1.0 / sideways + 1.0 / self.body_t),
            "slip": self.friction * self.faces * N,
        }

    def on(self, arm: Arm, preload: Numbers) -> System:
        """Return the arm with this joint: a System with a Jenkins element k_d, slip beside k_t and k_r.

        Parameters
        ----------
        arm : Arm
            Its own k_t and k_r do not matter.
        preload : array_like
            N, positive; an array is a batch.

        Examples
        --------
        >>> import cra_sym as cra
        >>> joint, arm = cra.BoltedJoint(), cra.Arm.nominal()
        >>> cra.natural_frequencies(joint.on(arm, [1.0, 10.0, 1e3])).round(1)
        array([[ 1.7, 12.4, 36.6],
               [ 2.3, 14.6, 40.9],
               [ 2.4, 15.2, 42.5]])
        """
        from cra_sym.arm.parameters import Arm

        instance("arm", arm, Arm)
        return _model(arm.model).at({**arm.values, **self.values(preload)}, zeta=arm.zeta)

    def parametric(self, arm: Arm, preload: Numbers) -> System:
        """Return the arm with this joint as :meth:`on` does, with the preload as a parameter of its Lagrangian.

        So it is a slider of :func:`cra_sym.explore`, and sensitivities and sweeps are over the preload. The springs of
        the joint are not parameters then; to let one of them fluctuate, use :meth:`on`.

        Parameters
        ----------
        arm : Arm
            Its own k_t and k_r do not matter.
        preload : array_like
            N, positive; an array is a batch.

        Examples
        --------
        >>> import cra_sym as cra
        >>> system = cra.BoltedJoint().parametric(cra.Arm.nominal(), 1.0)
        >>> cra.natural_frequencies(system.replace(preload=10.0)).round(1)
        array([ 2.3, 14.6, 40.9])
        """
        from cra_sym.arm.parameters import Arm

        instance("arm", arm, Arm)
        N = real_array("preload", preload, low=0.0, open_low=True, unit="N")
        values = {name: value for name, value in arm.values.items() if name not in ("k_t", "k_r")}
        return _parametric(self, arm.model).at({**values, "preload": N}, zeta=arm.zeta)


@cache
def _parametric(joint: BoltedJoint, model: Model) -> Model:
    from sympy import Float, Symbol

    from cra_sym.model.hysteresis import Jenkins

    N = Symbol("preload", positive=True)
    laws, springs = joint._laws(N), {s.name: s for s in model.symbols if s.name in ("k_t", "k_r")}
    (field,) = model.equations.fields
    return model.replace(
        hysteresis=[(Jenkins(laws["k_d"], laws["slip"]), field, "left")],
        definitions=dict(model.pieces["definitions"])
        | {springs["k_t"]: Float(laws["k_t"]), springs["k_r"]: laws["k_r"]},
        units=dict(model.pieces["units"]) | {N: "N"},
    )


@cache
def _model(model: Model) -> Model:
    from sympy import Symbol

    from cra_sym.model.hysteresis import Jenkins

    k_d, slip = Symbol("k_d", positive=True), Symbol("slip", positive=True)
    (field,) = model.equations.fields
    return model.replace(hysteresis=[(Jenkins(k_d, slip), field, "left")])
