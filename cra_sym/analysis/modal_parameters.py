"""Modal quantities of any system: participation factors, values and forces of the ends, coupling by springs."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from cra_sym import checks
from cra_sym.analysis.modes import participation
from cra_sym.cached import cached_property
from cra_sym.model.routes import Modes
from cra_sym.model.system import System

__all__ = ["ModalParameters", "modal_parameters", "stiffness_coupling"]

Array = NDArray[np.float64]


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
