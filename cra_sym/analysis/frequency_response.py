"""Frequency response of a system, exact from the boundary-value problem instead of a modal sum."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Literal

import numpy as np
from numpy.typing import NDArray

from cra_sym.analysis.histories import supports
from cra_sym.analysis.modes import check_places, section_place
from cra_sym.analysis.undamped_response import Undamped, cause_name
from cra_sym.checks import choice, default_floating_point, instance, one_axis, shown
from cra_sym.model.system import System
from cra_sym.si import Numbers

if TYPE_CHECKING:
    from sympy import Expr
    from sympy.core.function import AppliedUndef

__all__ = ["frequency_response"]

Complex = NDArray[np.complex128]
_BELOW, _ABOVE, _DIGITS = 18.0, 14.0, 37.0  # reach of the quadrature in ln y, and minus ln of its error
_FASTEST = 1e60  # rad/s, whose fourth power does not overflow; below its inverse the response is static


@default_floating_point
def frequency_response(
    system: System,
    angular_frequency: Numbers,
    x: Numbers | None = None,
    drive: Expr | None = None,
    *,
    kind: Literal["force", "motion"] | None = None,
    field: AppliedUndef | None = None,
    damping: Literal["modal", "structural"] = "modal",
) -> Complex:
    """Return the complex amplitude of a field for harmonic driving ``exp(i Omega t)``, dampers included.

    The boundary-value problem is solved at each frequency, without a modal sum, for any stiffness from zero to
    infinity.

    Parameters
    ----------
    system : System
        ``system.zeta`` is its modal damping.
    angular_frequency : array_like
        Omega, rad/s, not negative; a number or one axis.
    x : array_like, optional
        Place or one axis of places in the domain, m; the right end by default.
    drive : Expr or str, optional
        Input: a unit acceleration of a prescribed motion ``w(t)`` (by default the only one), a unit displacement if
        displacement or velocity act too, as on the support of a spring; a unit of a force ``F(t)``
        of the Lagrangian or the virtual work, distributed or not; or a displacement of a section at an end or an
        interior place, such as ``v.subs(x, L/2)``, or a lumped coordinate.
    kind : {'force', 'motion'}, optional
        A unit force on that displacement (the default), or a unit motion of it, at an end or of a coordinate.
    field : applied undefined function, optional
        A field (default: the first), or a lumped coordinate, which is the same at every x.
    damping : {'modal', 'structural'}
        Meaning of zeta. 'modal': viscous, the same ratio in every mode, as in the time domain. No local damper has this
        property, but the sum over all modes has a closed form, see Notes. 'structural': a loss factor 2 zeta of every
        stiffness. Both agree at resonances, to first order in zeta.

    Returns
    -------
    complex ndarray, shape (..., x, Omega)
        m per unit of the drive; s2 for an acceleration. A single x or Omega has no axis. Without damping it is
        unbounded at a natural frequency.

    Raises
    ------
    TypeError, ValueError
        If an argument is out of its range, an infinite stiffness holds the driven displacement, the waves are too
        short, a model with dampers has modal damping too, or modal damping is outside the scope of the Notes.

    Notes
    -----
    Mode i responds with a_i f(omega_i), f(z) = 1 / (z^2 + 2 i zeta Omega z - Omega^2) having its poles at
    alpha = Omega (sqrt(1 - zeta^2) - i zeta) and at -conj(alpha). With V(z), the undamped response at complex
    frequency z, the sum over modes is a sum of residues of 2 z V(z) f(z) in the right half plane, and the residue
    theorem gives

        H = 2 alpha V(alpha) / (alpha + conj(alpha))
            + (4 i zeta Omega / pi) int_0^inf y^2 V(i y) / ((y^2 + Omega^2)^2 - (2 zeta Omega y)^2) dy.

    The integrand has no resonance, and the trapezoidal rule in ln y converges geometrically to rounding. Rigid-body
    modes, which have no damping, are summed separately.

    Where coefficients or loads vary along x, the problem is solved in a Ritz basis on the stresses, refined until the
    response changes by less than 1e-9, which leaves an error of up to about 1e-8; one that does not converge to 1e-6,
    of waves that are too short, is solved as a boundary-value problem, or refused with modal damping or a stiffness
    that vanishes at an end. Modal damping is refused where the motion of one end drives a structure that varies along
    x or can still move as a rigid body.

    Examples
    --------
    >>> from cra_sym import Arm, frequency_response
    >>> static = frequency_response(Arm.nominal(), 0.0)
    >>> print(f"{static.real:.4e} s2")
    -6.6053e-03 s2
    """
    instance("system", system, System)
    frequencies = one_axis("angular_frequency", angular_frequency, "frequencies", low=0.0, high=_FASTEST, unit="rad/s")
    grid = np.where(frequencies * _FASTEST < 1.0, 0.0, np.atleast_1d(frequencies))
    places = None if x is None else one_axis("x", x, "places", unit="m")
    if places is not None:
        check_places(system, places)
    choice("damping", damping, ("modal", "structural"))
    system, drive, kind = _as_drive(system, drive, kind)
    place = section_place(system, field, lumped=True)
    undamped = Undamped(system, places, drive, kind, place, float(grid.max(initial=0.0)))
    zeta = np.broadcast_to(system.zeta, system.shape)[..., None]
    if np.any(zeta) and undamped.problem_damped:
        raise ValueError(
            "zeta: the model has dampers, gyroscopic terms or forces that follow the motion, beside which a frequency "
            "response has no modal damping; set it to 0"
        )
    if damping == "structural":
        loss = 1 + 2j * zeta
        found = undamped(grid / np.sqrt(loss)) / loss[..., None]
    else:
        undamped.check_modal_damping(zeta)
        on_basis = undamped.has_basis and np.any(zeta)
        found = undamped.damped_on_basis(grid, zeta) if on_basis else _with_modal_damping(undamped, grid, zeta)
    found = np.where((grid == 0)[..., None, :], undamped.turned_by_motion(found), found)
    unbounded = (grid == 0) & undamped.drives_rigid_motion()[..., None]
    found = np.where(unbounded[..., None, :], np.inf, found)
    found = found[..., 0, :] if places is None or not places.ndim else found
    return found if frequencies.ndim else found[..., 0]


def _with_modal_damping(undamped: Undamped, grid: NDArray[np.float64], zeta: NDArray[np.float64]) -> Complex:
    if not np.any(zeta):
        return undamped(grid + 0.0 * zeta)
    cosine = np.sqrt(1 - zeta**2)
    static = grid == 0
    alpha = grid * (cosine - 1j * zeta)
    weight = np.where(static, 1.0, 1 - 1j * zeta / cosine)
    response = weight[..., None, :] * undamped(alpha)
    if static.all():
        return response
    moving = grid[~static]
    step = 2 * np.pi * np.arccos(np.max(zeta)) / _DIGITS
    y = np.exp(np.arange(np.log(moving.min()) - _BELOW, np.log(moving.max()) + _ABOVE, step))
    y = y[: undamped.followed(y)]  # beyond, the integrand is below 1e-12
    Omega = np.where(static, 1.0, grid)[..., None, :]
    factor = zeta[..., None]
    integrand = y[:, None] ** 3 / ((y[:, None] ** 2 + Omega**2) ** 2 - (2 * factor * Omega * y[:, None]) ** 2)
    smooth = undamped(-1j * y + 0.0 * zeta, rigid=False).real
    rest = np.where(static, 0.0, 4j * zeta * grid * step / np.pi)[..., None, :] * (smooth @ integrand)
    # a rigid-body mode has no damping, so its contribution to the formula is removed
    rigid = undamped.rigid_share(np.where(static, 1.0, alpha)), undamped.rigid_share(np.where(static, 1.0, grid))
    return np.asarray(response + rest + np.where(static[..., None, :], 0.0, rigid[1] - weight[..., None, :] * rigid[0]))


def _as_drive(system: System, drive: Any, kind: Any) -> tuple[System, Any, Any]:
    """Return system, input and kind: a displacement at an interior place is replaced by a new force there.

    A motion that acts by its displacement or velocity too is replaced by a coordinate that moves by a unit.
    """
    cause = cause_name(system, drive)
    if cause in supports(system):
        if kind is not None:
            raise ValueError(f"kind = {shown(kind)}: must be left out for {cause}, which is not a displacement")
        moved = next(function for function in system.model.driving if function.func.__name__ == cause)
        return system.model.freed(cause).at({**system.values}, system.zeta), moved, "motion"
    if drive is None or isinstance(drive, str):
        return system, drive, kind
    found = system.model.numerics("pushed", drive) if hasattr(drive, "free_symbols") else None
    if found is None:
        return system, drive, kind
    if kind not in (None, "force"):
        raise ValueError(f"kind = {shown(kind)}: what drives at an interior place must be a force")
    model, name, place = found
    check_places(system, np.asarray(place.function(*system.domain.values)), "drive: place")
    return model.at({**system.values}, system.zeta), name, kind
