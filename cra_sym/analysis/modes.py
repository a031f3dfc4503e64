"""Natural frequencies, mode shapes and modal quantities of any system."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Literal, overload

import numpy as np
from numpy.typing import NDArray

from cra_sym import checks
from cra_sym.analysis.complex_shapes import complex_shapes
from cra_sym.cached import cached_property
from cra_sym.model.routes import Modes
from cra_sym.model.spatial import check_range
from cra_sym.model.system import MOST_MODES, System
from cra_sym.si import Numbers

if TYPE_CHECKING:
    from sympy.core.function import AppliedUndef

__all__ = [
    "ModalParameters",
    "displaced",
    "modal_parameters",
    "mode_shapes",
    "natural_frequencies",
    "section_place",
]

Array = NDArray[np.float64]
_MOST_DERIVATIVES = 20


@checks.default_floating_point
def natural_frequencies(system: System, modes: int = 3) -> Array:
    """Return the natural frequencies (30), Hz.

    Dampers are left out: these are the frequencies of the conservative structure.

    Parameters
    ----------
    system : System
        An :class:`cra_sym.Arm` or any other.
    modes : int
        How many, 1 to 1000; rigid-body modes count, with frequency 0.

    Returns
    -------
    ndarray, shape (..., modes)
        Ascending and complete; ``...`` is ``system.shape``.

    Raises
    ------
    TypeError, ValueError
        If ``system`` is not a :class:`System`, ``modes`` is not an integer from 1 to 1000, the structure has buckled or
        has fewer natural frequencies, or its forces are not conservative.

    Examples
    --------
    >>> from cra_sym import Arm
    >>> print(natural_frequencies(Arm.nominal().replace(m_e=0)).round(3))
    [ 2.448 15.339 42.95 ]
    """
    checks.instance("system", system, System)
    return system.natural_frequencies(modes) / (2 * np.pi)


def section_place(system: System, field: Any = None, *, lumped: bool = False) -> int:
    """Return the position of a field among the displacements of a section; the first one by default.

    With ``lumped`` it may be a lumped coordinate: these come after the displacements, see `displaced`.

    Raises
    ------
    ValueError
        If it is not a field of the model.
    """
    if field is None:
        return 0
    form = system.model.state_form
    known = [*system.model.equations.fields, *(form.coordinates if lumped else ())]
    if not any(field is one or (isinstance(field, type(one)) and field == one) for one in known):
        allowed = f"one of {', '.join(map(str, known))}" if known else "None, as the model has no fields"
        raise ValueError(f"field = {checks.shown(field)}: must be {allowed}")
    return [*form.displacements, *form.coordinates].index(field)


def displaced(system: System, modes: Modes, place: int, x: Array | None = None) -> Array:
    """Return what `section_place` found in every mode: at the right end, (..., modes), or at places x, (..., modes, x).

    A lumped coordinate is the same at all places.
    """
    own = system.numerics("sizes")[0]
    if place >= own:
        value = modes.coordinate(place - own)
        return value if x is None else np.repeat(value[..., None], np.size(x), axis=-1)
    return modes.displacement(1, place) if x is None else modes.shape(place, 0, x)


@overload
def mode_shapes(system: System, x: Numbers, modes: int = 3, derivative: int = 0, *, field: AppliedUndef | None = None,
                damped: Literal[False] = False, oscillating: bool = True) -> Array:  # fmt: skip
    """Return real mode shapes."""


@overload
def mode_shapes(system: System, x: Numbers, modes: int = 3, derivative: int = 0, *, field: AppliedUndef | None = None,
                damped: bool, oscillating: bool = True) -> Array | NDArray[np.complex128]:  # fmt: skip
    """Return complex mode shapes if ``damped``."""


@checks.default_floating_point
def mode_shapes(
    system: System,
    x: Numbers,
    modes: int = 3,
    derivative: int = 0,
    *,
    field: AppliedUndef | None = None,
    damped: bool = False,
    oscillating: bool = True,
) -> Array | NDArray[np.complex128]:
    """Return the mass-normalised mode shapes (25), or their derivatives by x, positive at the right end.

    Where the first field of a mode is zero at the right end, its first nonzero derivative there is positive; where all
    are zero (a clamped right end), the field next to that end is positive.

    Parameters
    ----------
    system : System
    x : array_like
        Points in the domain, m: a number or one axis of points, the same for the whole batch.
    modes : int
        How many, 1 to 1000, rigid-body modes included.
    derivative : int
        Order of the derivative by x, 0 to 20.
    field : applied undefined function, optional
        Default: the first.
    damped : bool
        Complex shapes phi of the motions ``phi exp(s t)`` of :func:`cra_sym.eigenvalues`: with dampers, gyroscopic
        forces and forces that follow the motion. They are normalised to ``conj(phi)' M phi = 1``, with the phase that
        makes real and positive the quantity that is positive for real modes. Without such forces they are the same.
    oscillating : bool
        Leave out the shapes of real eigenvalues, as in :func:`cra_sym.eigenvalues`.

    Returns
    -------
    ndarray, shape (..., modes) or (..., modes, len(x))
        In kg^-1/2 m^-derivative for a displacement in m; complex if ``damped``.

    Raises
    ------
    TypeError, ValueError
        If ``x`` does not hold real numbers, has more than one axis or a point outside the domain of any member of the
        batch, or another argument is out of its range.

    Examples
    --------
    >>> from cra_sym import Arm, mode_shapes
    >>> mode_shapes(Arm.nominal(), [0.0, 0.5, 1.0], modes=2).round(2)
    array([[ 0.  ,  1.37,  4.03],
           [ 0.  , -2.89,  3.97]])
    """
    checks.instance("system", system, System)
    derivative = checks.count("derivative", derivative, low=0, high=_MOST_DERIVATIVES)
    modes = checks.count("modes", modes, high=MOST_MODES)
    checks.instance("damped", damped, bool)
    points = checks.one_axis("x", x, "points", unit="m")
    check_places(system, points)
    place, every = section_place(system, field), np.atleast_1d(points)
    shapes: Array | NDArray[np.complex128]
    with np.errstate(all="ignore"):
        if damped:
            shapes = complex_shapes(system, modes, oscillating, place, derivative, every)
        else:
            shapes = system.modes(modes).shape(place, derivative, every)
    check_range(shapes)
    return shapes if points.ndim else shapes[..., 0]


def check_places(system: System, points: Array, name: str = "x") -> None:
    """Raise a ValueError unless all points lie in the domain of every member of the batch."""
    if not system.numerics("sizes")[0]:
        raise ValueError(
            f"{name}: the model has coordinates alone, which have no place; use tip_response, with field= for "
            "another than the first"
        )
    left, length = system.domain.left, system.domain.length
    low, high = np.max(left), np.min(left + length)
    slack = 1e-12 * np.max(length)
    if points.size and not (points.min() >= low - slack and points.max() <= high + slack):
        bad = points.min() if points.min() < low - slack else points.max()
        raise ValueError(f"{name} = {bad:g} must be in the domain, [{low:g}, {high:g}]")


class ModalParameters:
    """Modal quantities of mass-normalised modes (M_i = 1, so that K_i = omega_i^2), positive at the right end.

    The mode axis is last; ``...`` is the batch shape of the system. 'Root' and 'tip' are the left and the right end of
    the first field v. All are finite at zero and at infinite stiffness; each is computed on first use.
    Units are given for v in m.

    Attributes
    ----------
    omega, frequency : ndarray, shape (..., modes)
        Natural angular frequency (rad/s) and natural frequency (Hz).
    lam : ndarray, shape (..., modes)
        Frequency parameter lambda, wave number times length, of a model with one wave number.
    participation : ndarray, shape (..., modes)
        Modal participation factor, (6): generalised force of a unit acceleration of the only prescribed motion, with
        the sign of Gamma_i = int rho A phi_i dx + m_e phi_i(L), kg^1/2.
    root_displacement, root_slope, root_moment, root_shear : ndarray, shape (..., modes)
        phi(0), kg^-1/2, phi'(0), kg^-1/2/m, and the natural forces there; of a beam EI phi''(0), N kg^-1/2, and
        EI phi'''(0), N kg^-1/2/m.
    tip_displacement, tip_slope : ndarray, shape (..., modes)
        phi(L), kg^-1/2, and phi'(L), kg^-1/2/m.
    left, right, left_force, right_force : ndarray, shape (..., modes, n)
        All displacements of the end sections, and the natural forces conjugate to them.
    coordinates : ndarray, shape (..., modes, m)
        Lumped coordinates.
    axial : ndarray, shape (..., modes, modes)
        G_ij = int (rho A (L - x) + m_e) phi_i' phi_j' dx, 1/m: work of the axial load of a base accelerated along x.
    stiffness_translation, stiffness_rotation : ndarray, shape (..., modes, modes)
        k_t phi_i(0) phi_j(0) and k_r phi_i'(0) phi_j'(0) of springs of the left end, 1/s2; 0 if infinite.
    """

    def __init__(self, system: System, modes: int) -> None:
        self._system, self._number = system, modes

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, ModalParameters):
            return NotImplemented
        return (self._number, self._system) == (other._number, other._system)

    def __hash__(self) -> int:
        return hash((self._number, self._system))

    def __reduce__(self) -> tuple[Any, ...]:
        return type(self), (self._system, self._number)

    def __repr__(self) -> str:
        return f"<ModalParameters of {self._number} modes, shape {self._system.shape}>"

    @property
    def _modes(self) -> Modes:
        return self._system.modes(self._number)

    @property
    def omega(self) -> Array:
        """Natural angular frequency, rad/s."""
        return self._system.natural_frequencies(self._number)

    @cached_property
    def frequency(self) -> Array:
        """Natural frequency, Hz."""
        return self.omega / (2 * np.pi)

    @property
    def lam(self) -> Array:
        """Frequency parameter, 1."""
        found: Array | None = getattr(self._modes, "lam", None)
        if found is None:
            raise ValueError("lam: a model with more than one wave number has no frequency parameter; use omega")
        return found

    @cached_property
    @checks.default_floating_point
    def participation(self) -> Array:
        """Participation factor, kg^1/2."""
        return participation(self._system, self._number)

    @property
    def root_displacement(self) -> Array:
        """phi(0), kg^-1/2."""
        return self._modes.displacement(0, 0)

    @property
    def root_slope(self) -> Array:
        """phi'(0), kg^-1/2/m."""
        return self._slope(0)

    @property
    def root_moment(self) -> Array:
        """EI phi''(0), N kg^-1/2."""
        place = self._system.numerics("slope_place")
        if place is None:
            raise ValueError("root_moment: no force of the section is conjugate to the slope; use left_force")
        return self._modes.force(0, place)

    @cached_property
    def root_shear(self) -> Array:
        """EI phi'''(0), N kg^-1/2/m."""
        return -self._modes.force(0, 0)

    @property
    def tip_displacement(self) -> Array:
        """phi(L), kg^-1/2."""
        return self._modes.displacement(1, 0)

    @property
    def tip_slope(self) -> Array:
        """phi'(L), kg^-1/2/m."""
        return self._slope(1)

    def _slope(self, end: int) -> Array:
        place = self._system.numerics("slope_place")
        if place is not None:
            return self._modes.displacement(end, place)
        domain = self._system.domain
        there = np.broadcast_to(domain.left + domain.length * end, self._system.shape)[..., None]
        return self._modes.shape(0, 1, there)[..., 0]

    @property
    def left(self) -> Array:
        """Displacements of the left end section."""
        return self._section(0, force=False)

    @property
    def right(self) -> Array:
        """Displacements of the right end section."""
        return self._section(1, force=False)

    @property
    def left_force(self) -> Array:
        """Natural forces of the left end section."""
        return self._section(0, force=True)

    @property
    def right_force(self) -> Array:
        """Natural forces of the right end section."""
        return self._section(1, force=True)

    def _section(self, end: int, *, force: bool) -> Array:
        of = self._modes.force if force else self._modes.displacement
        return np.stack([of(end, place) for place in range(self._system.numerics("sizes")[0])], axis=-1)

    @property
    def coordinates(self) -> Array:
        """Lumped coordinates."""
        found = [self._modes.coordinate(number) for number in range(self._system.numerics("sizes")[1])]
        return np.stack(found, axis=-1) if found else np.empty((*self.omega.shape, 0))

    @cached_property
    def stiffness_translation(self) -> Array:
        """Matrix of k_t phi_i(0) phi_j(0) by the springs on the left end, 1/s2."""
        return self._spring(0)

    @cached_property
    def stiffness_rotation(self) -> Array:
        """Matrix of k_r phi_i'(0) phi_j'(0) by the springs on the left end, 1/s2."""
        return self._spring(self._system.numerics("slope_place"))

    def _spring(self, place: int | None) -> Array:
        """Return the coupling by the springs of a displacement of the left end."""
        names = [name for name, spring in self._system.numerics("stiffnesses").items() if spring[:2] == (0, place)]
        zero = np.zeros((*self.omega.shape, self.omega.shape[-1]))
        return sum((stiffness_coupling(self._system, name, self._number) for name in names), start=zero)

    @cached_property
    def axial(self) -> Array:
        """Matrix of int (rho A (L - x) + m_e) phi_i' phi_j' dx, 1/m."""
        return self._system.form("axial", self._number)["axial"]


@checks.default_floating_point
def modal_parameters(system: System, modes: int = 3) -> ModalParameters:
    """Return the modal quantities of the first modes, by equations (6), (25) and (30).

    Parameters
    ----------
    system : System
    modes : int
        How many, 1 to 1000, rigid-body modes included.

    Returns
    -------
    ModalParameters
        Arrays of shape (..., modes) and (..., modes, modes); ``...`` is ``system.shape``.

    Raises
    ------
    TypeError, ValueError
        As :func:`natural_frequencies`.

    Examples
    --------
    >>> from cra_sym import Arm
    >>> parameters = modal_parameters(Arm.nominal())
    >>> print(parameters.participation.round(4))
    [ 0.3868 -0.2143  0.1257]
    """
    checks.instance("system", system, System)
    system.natural_frequencies(modes)
    return ModalParameters(system, modes)


def only_motion(system: System, *, support: bool = False) -> str:
    """Return the name of the only prescribed motion of a model.

    Parameters
    ----------
    system : System
    support : bool
        Whether it may act by its displacement and velocity too, or by one of these alone.

    Raises
    ------
    ValueError
        If there is none, or more than one.
    """
    causes = system.numerics("causes")
    motions = [name for name, kind in causes if kind == "motion" or (support and kind == "support")]
    if support and len(causes) == 1:
        motions = [name for name, _ in causes]
    if len(motions) != 1:
        found = ", ".join(motions) or "none"
        if not motions and causes:
            others = ", ".join(name for name, _ in causes)
            found += f", but is driven by {others}; name what drives it, or measure the fields from the moving frame"
        raise ValueError(f"the model must have one prescribed motion that acts by its acceleration; it has {found}")
    return str(motions[0])


def participation(system: System, modes: int, motion: str | None = None) -> Array:
    """Return the participation of the modes in a prescribed motion, kg^1/2, shape (..., modes)."""
    load = system.project(system.numerics("load", motion or only_motion(system)), modes)
    return np.negative(load, out=load)


@checks.default_floating_point
def stiffness_coupling(system: System, name: str, modes: int) -> Array:
    """Return a parameter times the derivative of the stiffness by it, between the modes, 1/s2; 0 if it is infinite.

    Raises
    ------
    ValueError
        If the model has no such parameter.
    """
    if name not in system.values:
        raise ValueError(f"{name} is not a parameter of the model; it has {', '.join(system.values)}")
    value = np.asarray(system.values[name])
    rate = system.form("rates", modes)[f"{name} stiffness"]
    return np.where(np.isinf(value), 0.0, value)[..., None, None] * rate
