"""The arm: a validated, immutable set of parameters and its dimensionless groups."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

from cra_sym.checks import broadcastable, normal, real_array
from cra_sym.model.numerics import Numerics
from cra_sym.model.system import System
from cra_sym.si import Numbers, paired
from cra_sym.symbols import row

if TYPE_CHECKING:
    from sympy import Expr

    from cra_sym.model.lagrangian import Model

__all__ = ["Arm", "Provenance"]

Number = float | np.ndarray


@dataclass(frozen=True)
class Provenance:
    """Origin of a nominal value.

    Attributes
    ----------
    kind : str
        ``'published'`` (printed in the paper), ``'calibrated'`` (chosen to reproduce published results) or
        ``'assumed'`` (lost in the paper's text, chosen here).
    value : float
        The nominal value, SI.
    note : str
        Reason for this value.
    """

    kind: str
    value: float
    note: str


_NOMINAL: Mapping[str, Provenance] = MappingProxyType(
    {
        "L": Provenance("assumed", 1.0, "the printed length is lost; only sqrt(EI / rho A) / L^2 is determined"),
        "b": Provenance("assumed", 0.030, "the printed width is lost; it cancels from the bare arm's frequencies"),
        "h": Provenance("assumed", 0.003, "the printed thickness is lost; a strip of common stock"),
        "E": Provenance("calibrated", 68.875e9, "brings back 2.448, 15.339 and 42.950 Hz, rigid joint, m_e = 0"),
        "rho": Provenance("assumed", 2700.0, "aluminium; the printed density is lost"),
        "m_b": Provenance("assumed", 5.0, "the printed mass is lost; it enters only the base's own equation"),
        "m_e": Provenance("published", 0.001, "one of the masses of Fig. 12"),
        "J_e": Provenance("published", 0.0, "the paper's end-effector is a point mass"),
        "k_t": Provenance("assumed", np.inf, "the rigid joint of the published frequencies"),
        "k_r": Provenance("assumed", np.inf, "the rigid joint of the published frequencies"),
        "zeta": Provenance("published", 0.0, "the paper's arm is undamped"),
    }
)

_RANGES: dict[str, dict[str, Any]] = {
    **{name: {"low": 0.0, "open_low": True} for name in ("L", "b", "h", "E", "rho")},
    **{name: {"low": 0.0} for name in ("m_b", "m_e", "J_e")},
    **{name: {"low": 0.0, "allow_infinite": True} for name in ("k_t", "k_r")},
    "zeta": {"low": 0.0, "high": np.nextafter(1.0, 0.0), "must": "real numbers in [0, 1)"},
}

_MODEL = "cra_sym.arm.lagrangian:arm_model"


def _model() -> Model:
    from cra_sym.arm.lagrangian import arm_model

    return arm_model()


_NUMERICS = Numerics(_model, _MODEL)


@dataclass(frozen=True, eq=False)
class Arm(System):
    """The paper's arm: names and checks for the parameters of :func:`cra_sym.paper_lagrangian`.

    It is a :class:`cra_sym.System`. Any parameter may be an array, and arrays broadcast as batch axes.

    Parameters
    ----------
    L, b, h : float or ndarray
        Length, width and thickness of the manipulator, m; positive.
    E : float or ndarray
        Young's modulus, Pa; positive.
    rho : float or ndarray
        Density, kg/m3; positive.
    m_b, m_e : float or ndarray
        Mass of the driving base and of the end-effector, kg; not negative.
    J_e : float or ndarray
        Rotary inertia of the end-effector, kg m2; not negative.
    k_t, k_r : float or ndarray
        Translational (N/m) and rotational (N m/rad) stiffness of the bolted joint, in ``[0, inf]``.
    zeta : float or ndarray
        Damping ratio, the same for every mode, in ``[0, 1)``.

    Raises
    ------
    TypeError
        If a field does not hold real numbers.
    ValueError
        If a value is out of its range, or the arrays do not broadcast together.

    Examples
    --------
    >>> arm = Arm.nominal().replace(k_t=1e4, m_e=[0.0, 0.001, 0.005])
    >>> arm.shape
    (3,)
    >>> print(f"{arm.kappa_t:.4g}")
    2151
    """

    L: Number
    b: Number
    h: Number
    E: Number
    rho: Number
    m_b: Number
    m_e: Number = 0.0
    J_e: Number = 0.0
    k_t: Number = np.inf
    k_r: Number = np.inf
    zeta: Number = 0.0

    provenance: ClassVar[Mapping[str, Provenance]] = _NOMINAL

    def __post_init__(self) -> None:
        units = {name: row(name).unit for name in self._names()}
        for name, value in paired(self._fields(), units).items():
            given = normal(name, real_array(name, value, unit=units[name], **_RANGES[name]))
            array = np.asarray(given + 0.0)  # -0.0 becomes 0.0
            array.flags.writeable = False
            object.__setattr__(self, name, float(array) if array.ndim == 0 else array)
        broadcastable(**self._fields())
        for name in ("EI", "rhoA", "angular_frequency_scale"):
            with np.errstate(all="ignore"):
                value = np.atleast_1d(getattr(self, name))
            bad = value[~((value > 0) & np.isfinite(value))]
            if bad.size:
                raise ValueError(f"{name} = {bad[0]:g}: L, b, h, E and rho must keep it positive and finite")

    @classmethod
    def nominal(cls) -> Arm:
        """Return the nominal arm; ``Arm.provenance`` gives the origin of each value."""
        return cls(**{name: entry.value for name, entry in cls.provenance.items()})

    @classmethod
    def _names(cls) -> tuple[str, ...]:
        return tuple(field.name for field in dataclasses.fields(cls))

    def _fields(self) -> dict[str, Any]:
        return {name: getattr(self, name) for name in self._names()}

    def replace(self, **changes: Numbers) -> Arm:
        """Return a validated copy with some fields changed.

        Raises
        ------
        TypeError, ValueError
            If a name is not a field, or as :class:`Arm`.
        """
        unknown = [name for name in changes if name not in self._names()]
        if unknown:
            raise TypeError(f"{unknown[0]!r} is not a parameter of Arm: must be one of {', '.join(self._names())}")
        return type(self)(**{**self._fields(), **changes})

    @property
    def model(self) -> Model:
        """The model of the paper's Lagrangian with prescribed base motion."""
        return _model()

    @property
    def values(self) -> Mapping[str, Number]:
        """The value of every parameter but the modal damping ratio, by name."""
        fields = self._fields()
        del fields["zeta"]
        return MappingProxyType(fields)

    @property
    def section_quantities(self) -> Mapping[str, Expr]:
        """Strain of bending on the face turned to -v."""
        from cra_sym.symbols import symbol

        x, v, h = (symbol(name) for name in ("x", "v", "h"))
        return {"strain": h / 2 * v.diff(x, 2)}

    @property
    def numerics(self) -> Numerics:
        """Compiled derivations from the paper's Lagrangian."""
        return _NUMERICS

    @property
    def A(self) -> Number:
        """Cross-sectional area, m2."""
        return self.b * self.h

    @property
    def I(self) -> Number:  # noqa: E743
        """Second moment of area, m4."""
        return self.b * self.h * self.h * self.h / 12

    @property
    def EI(self) -> Number:
        """Bending stiffness, N m2."""
        return self.E * self.I

    @property
    def rhoA(self) -> Number:
        """Mass per length, kg/m."""
        return self.rho * self.A

    @property
    def kappa_t(self) -> Number:
        """Dimensionless translational stiffness k_t L^3 / EI."""
        return self.k_t * self.L * self.L * self.L / self.EI

    @property
    def kappa_r(self) -> Number:
        """Dimensionless rotational stiffness k_r L / EI."""
        return self.k_r * self.L / self.EI

    @property
    def mu(self) -> Number:
        """Tip mass over the arm's mass, m_e / (rho A L)."""
        return self.m_e / (self.rhoA * self.L)

    @property
    def iota(self) -> Number:
        """Tip rotary inertia J_e / (rho A L^3)."""
        return self.J_e / (self.rhoA * self.L * self.L * self.L)

    @property
    def angular_frequency_scale(self) -> Number:
        """Angular frequency at frequency parameter 1, sqrt(EI / rho A) / L^2, rad/s: omega = scale lambda^2, (30)."""
        return np.sqrt(self.EI / self.rhoA) / (self.L * self.L)

    def _key(self) -> tuple[Any, ...]:
        return tuple((np.shape(value), np.asarray(value).tobytes()) for value in self._fields().values())

    def __reduce__(self) -> tuple[Any, ...]:  # arrays come back read-only and validated
        return type(self), tuple(self._fields().values())
