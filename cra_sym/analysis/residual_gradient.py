"""Gradient of the residual vibration, for optimisation."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from cra_sym.analysis.differences import by_differences, central_weights
from cra_sym.analysis.histories import Histories, History, supports
from cra_sym.analysis.modes import displaced, participation, section_place
from cra_sym.analysis.residual_vibration import Stopped, couples, ended, residual_vibration, stopped
from cra_sym.analysis.sensitivities import Sensitivities, sensitivities
from cra_sym.checks import count, default_floating_point, names
from cra_sym.model.one_wave import Change, OneWaveModes
from cra_sym.model.projection import column
from cra_sym.model.system import MOST_MODES, System
from cra_sym.si import Numbers
from cra_sym.solvers.motion import BaseMotion, Piecewise
from cra_sym.solvers.motion_terms import MotionTerm

if TYPE_CHECKING:
    from sympy.core.function import AppliedUndef

__all__ = ["residual_vibration_gradient"]

Array = NDArray[np.float64]
_SHORT = 1e-4  # step of a difference of a peak, which has a kink where its time jumps by a period
_TURN = 1e-3  # the same for a difference by the duration, in rad of the fastest mode
_TINY = 1e-30  # imaginary part whose square underflows
_SLOWEST = 1e-5  # rad until the inputs end
_SILENT = 1e-12  # relative change of a frequency, at least its rounding error, that explains all of a residual


@default_floating_point
def residual_vibration_gradient(
    system: System,
    motion: BaseMotion | Histories,
    by: Sequence[str] | None = None,
    modes: int = 5,
    *,
    zeta: Numbers | None = None,
    field: AppliedUndef | None = None,
) -> tuple[Array | float, Array]:
    r"""Return the residual vibration and its derivatives, for gradient-based optimisation.

    The residual vibration of mode i depends on its frequency and on :math:`\Gamma_i \phi_i(L)` for every motion and
    force. The derivative of the frequency is the sensitivity (31)-(32). That of :math:`\Gamma_i \phi_i(L)` by a spring
    or an inertia of an end has a closed form for a model with one wave number driven by a motion; otherwise it is an
    eighth-order difference with a relative error of about 1e-11. Both are propagated to the state at the stop by a
    complex step. Where modes are complex, or a motion acts by its displacement or velocity too, all derivatives are
    differences of the sum over the modes, accurate to about 1e-6.

    Parameters
    ----------
    system, motion, modes, zeta, field
        As in :func:`residual_vibration`.
    by : sequence of str, optional
        By default the stiffnesses of the ends, for an arm k_t and k_r, and, of one motion alone, 'duration'. Otherwise
        parameters of the system; the compliance 1/k of a stiffness k of an end, for an arm 'c_t' and 'c_r', else '1/'
        and its name; and 'duration', which stretches the motion uniformly in time over the same distance, as the
        argument of :meth:`BaseMotion.s_curve` does.

    Returns
    -------
    value : float or ndarray, shape (...)
        As from :func:`residual_vibration`, m.
    gradient : ndarray, shape (..., len(by))
        In m over the SI unit of the parameter. By an infinite stiffness it is 0. Where the residual of a mode is zero
        to rounding, as after a move in tune with it, it has a kink, and the mode counts as 0. By a zero stiffness, or
        an infinite compliance, it is nan where a rigid-body mode would become elastic; it is also nan where the phase
        of a mode until the stop is below 1e-5 rad, since rounding then destroys the result, and where the value is inf.

    Raises
    ------
    TypeError, ValueError
        If ``by`` is not a sequence of such names; otherwise as :func:`residual_vibration`.

    Examples
    --------
    >>> from cra_sym import Arm, BaseMotion, residual_vibration_gradient
    >>> move = BaseMotion.s_curve(0.2, 1.0, 2.0, 40.0, duration=1.0)
    >>> value, gradient = residual_vibration_gradient(Arm.nominal(), move, by=("duration",), modes=1)
    >>> print(f"{1e3 * value:.3f} mm, {1e3 * gradient[0]:.2f} mm/s")
    1.696 mm, 52.49 mm/s
    """
    modes = count("modes", modes, high=MOST_MODES)
    coupled = couples(system, modes) or system.numerics("damping") is not None or bool(supports(system))
    histories, *_ = ended(system, motion)
    stretch = ["duration"] if isinstance(motion, BaseMotion) or (len(histories) == 1 and _moves(system)) else []
    compliances = {f"1/{name}": name for name in system.numerics("stiffnesses")}
    compliances |= {name.replace("k_", "c_", 1): name for name in compliances.values() if name.startswith("k_")}
    known = [*system.values, *compliances, *stretch]
    by = names("by", (*system.numerics("stiffnesses"), *stretch) if by is None else by, known)
    value = residual_vibration(system, motion, modes, zeta=zeta, field=field)
    found = sensitivities(system.basis, min(modes + 1, system.most_modes))  # the next mode may be close to the last one
    gradient = np.empty((*np.shape(value), len(by)))
    if coupled:
        for place, name in enumerate(by):
            gradient[..., place] = _coupled(system, histories, found, compliances, name, modes, zeta, field)
        return value, np.where(np.isfinite(value)[..., None], gradient, np.nan)
    tip = section_place(system, field, lumped=True)
    driven = stopped(system, motion, modes, zeta, tip)
    still: list[Array] = [np.zeros(modes) for _ in driven.names]
    silent = _silent(driven)
    for place, name in enumerate(by):
        with np.errstate(all="ignore"):
            if name == "duration":  # frequency and duration count by their product alone
                rate = _along(driven, still, np.ones(modes)) / np.asarray(driven.stop)[..., None]
            else:
                stiffness = compliances.get(name)
                pairs = [
                    _rates(system, cause, found, stiffness or name, modes, tip, compliance=stiffness is not None)
                    for cause in driven.names
                ]
                rate = _along(driven, [change for change, _ in pairs], pairs[0][1])
                turned = driven.osc.omega * np.asarray(driven.stop)[..., None]
                held = (stiffness or name) in system.numerics("stiffnesses")
                rate = np.where(held & (0 < turned) & (turned < _SLOWEST), np.nan, rate)
        gradient[..., place] = np.where(silent & ~np.isnan(rate), 0.0, rate).sum(axis=-1)
    return value, np.where(np.isfinite(value)[..., None], gradient, np.nan)


def _silent(driven: Stopped) -> NDArray[np.bool_]:
    """Return which modes are at rest after the stop, to rounding: there their peak has a kink."""
    with np.errstate(all="ignore"):
        peaks = driven.peaks(driven.osc.omega * (1 + 1j * _TINY), driven.products)
        return np.asarray(peaks.real <= _SILENT * np.abs(peaks.imag) / _TINY)


def _coupled(
    system: System,
    histories: Mapping[Any, History],
    found: Sensitivities,
    compliances: Mapping[str, str],
    name: str,
    modes: int,
    zeta: Any,
    field: Any,
) -> Array:
    """Return the derivative of a sum over modes by differences."""
    if name != "duration":
        stiffness = compliances.get(name)

        def moved(one: System) -> Array:
            return np.asarray(residual_vibration(one, histories, modes, zeta=zeta, field=field))

        return by_differences(system, found, stiffness or name, moved, compliance=stiffness is not None, step=_SHORT)
    ((cause, profile),) = histories.items()
    assert isinstance(profile, BaseMotion)
    offsets, weights = central_weights()
    duration = np.asarray(profile.duration)
    step = _TURN / (2 * np.pi * found.frequency[..., :modes].max())
    factors = 1.0 + offsets[(..., *(None,) * duration.ndim)] * step / duration
    stretched = residual_vibration(system, {cause: _stretched(profile, factors)}, modes, zeta=zeta, field=field)
    return np.asarray(np.tensordot(weights / step, stretched, axes=1))


def _stretched(profile: BaseMotion, factors: Array) -> BaseMotion:
    """Return the motion over the same distance, stretched in time by the factors."""
    terms: list[MotionTerm] = []
    for term in profile.terms:
        assert isinstance(term, Piecewise)
        f = factors[..., None]
        terms.append(Piecewise(term.velocity / factors, term.knots * f, term.acceleration / f**2, term.jerk / f**3))
    return BaseMotion.of_terms(terms, factors.shape)


def _moves(system: System) -> bool:
    return {kind for _, kind in system.numerics("causes")} == {"motion"}


def _along(driven: Stopped, changes: Sequence[Array], logarithmic: Array) -> Array:
    """Return the derivatives of the peaks of the modes from those of Gamma_i phi_i(L) and of ln omega_i."""
    omega = driven.osc.omega
    moved = omega * (1 + 1j * _TINY * np.where(omega > 0, logarithmic, 0.0))
    products = [p + 1j * _TINY * change for p, change in zip(driven.products, changes, strict=True)]
    peaks = driven.peaks(moved, products)
    rate = np.where(peaks.real != 0, peaks.imag / _TINY, 0.0)
    return np.where(np.isnan(logarithmic), np.nan, rate)


def _rates(
    system: System, cause: str, found: Sensitivities, name: str, modes: int, tip: int, *, compliance: bool
) -> tuple[Array, Array]:
    """Return the derivatives of Gamma_i phi_i(L) and of ln omega_i by a parameter or by one over it."""
    rate = found.compliance[name] if compliance else found.rate[name]
    by_frequency, frequency = rate[..., :modes], found.frequency[..., :modes]
    still = frequency == 0
    with np.errstate(divide="ignore", invalid="ignore"):
        logarithmic = np.where(still, np.where(by_frequency == 0, 0.0, np.nan), by_frequency / frequency)
    given = np.broadcast_to(system.values[name], system.shape)
    change = None if tip else _along_the_mode(system, cause, name, modes, compliance=compliance)
    if change is None:
        change = by_differences(
            system,
            found,
            name,
            lambda moved: participation(moved, modes, cause) * displaced(moved, moved.modes(modes), tip),
            compliance=compliance,
        )
    held = np.isinf(given)[..., None] & (not compliance)
    absent = (given == 0)[..., None] & compliance
    return np.where(held, 0.0, np.where(absent, np.nan, change)), np.where(held, 0.0, logarithmic)


def _along_the_mode(system: System, cause: str, name: str, modes: int, *, compliance: bool) -> Array | None:
    """Return the derivative of Gamma_i phi_i(L) in closed form, or None where there is none.

    There is one for a spring or an inertia of an end of a model with one wave number whose participation is that of a
    rigid translation.
    """
    load = system.numerics("load", cause)
    springs, inertias = system.numerics("stiffnesses"), system.numerics("inertias")
    found = system.modes(modes)
    if not isinstance(found, OneWaveModes) or load.share is None or load.rest_ends:
        return None
    if name not in springs and (compliance or name not in inertias):
        return None
    end, place, factor = springs.get(name) or inertias[name]
    by: Change = "compliance" if compliance else "stiffness" if name in springs else "inertia"
    change, _ = found.product_rates(1, 0, (end, place), by)
    unit = np.asarray(factor.function(*system.domain.values))
    share = load.share.function(*system.domain.values) * (1 / unit if compliance else unit)
    return -column(np.asarray(share)) * change
