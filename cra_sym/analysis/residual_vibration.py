"""Residual vibration: the peak of the tip after all motions and forces have ended."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from cra_sym.analysis.complex_responses import complex_residual
from cra_sym.analysis.histories import Histories, History, check_no_support, supports
from cra_sym.analysis.histories import histories as histories_of
from cra_sym.analysis.modes import displaced, participation, section_place
from cra_sym.analysis.responses import check_sampling, has_complex_modes, oscillators, slipping_problem
from cra_sym.analysis.slipping import slipping_residual
from cra_sym.checks import broadcastable, count, default_floating_point, instance
from cra_sym.model.projection import Projected
from cra_sym.model.system import MOST_MODES, System
from cra_sym.model.values import checked_damping
from cra_sym.si import Numbers
from cra_sym.solvers import modal_response as solver
from cra_sym.solvers.driven_modes import at_rest, state_at_stop
from cra_sym.solvers.force import Force
from cra_sym.solvers.motion import BaseMotion

if TYPE_CHECKING:
    from sympy.core.function import AppliedUndef

__all__ = ["Stopped", "couples", "ended", "residual_vibration", "stopped"]

Array = NDArray[np.float64]


@default_floating_point
def residual_vibration(
    system: System,
    motion: BaseMotion | Histories,
    modes: int = 5,
    *,
    zeta: Numbers | None = None,
    field: AppliedUndef | None = None,
) -> Array | float:
    """Return the peak amplitude of the tip after all motions and forces have stopped, m: the sum over the modes.

    Exact for one mode; without damping the least upper bound over all times (frequencies of modes are incommensurable);
    with damping an upper bound, since the modes do not peak at the same time. The base need not be at rest after the
    stop, it must only have no acceleration; one that acts by its displacement or velocity must be at rest, and
    displacements are measured from the equilibrium. A rigid-body mode contributes its final offset. For a system with
    elastic-slip elements it is the largest displacement while they slip, for at most ten periods of the lowest mode,
    and the offset plus the sum over the modes once all stick. Where dampers, gyroscopic forces or forces that follow
    the motion couple the modes, the sum is over complex modes: two real eigenvalues count as one mode, and a growing
    mode gives inf.

    Parameters
    ----------
    system, motion, modes, zeta
        As in :func:`cra_sym.response`; the system is at rest before t = 0. Every motion and every force must end.
    field : applied undefined function, optional
        A field at the right end (default: the first), or a lumped coordinate.

    Returns
    -------
    float or ndarray, shape (...)

    Warns
    -----
    UndersamplingWarning
        As :func:`cra_sym.response`.

    Raises
    ------
    TypeError, ValueError
        If a motion never stops accelerating or a force never ends; otherwise as :func:`cra_sym.response`.

    Examples
    --------
    >>> import cra_sym as cra
    >>> move = cra.BaseMotion.s_curve(0.2, v_max=1.0, a_max=2.0, j_max=40.0)
    >>> print(f"{1e3 * cra.residual_vibration(cra.Arm.nominal(), move):.1f} mm")
    21.1 mm
    """
    instance("system", system, System)
    place = section_place(system, field, lumped=True)
    if system.model.pieces["hysteresis"]:
        if couples(system.without_hysteresis, modes):
            raise ValueError(
                "system: modes with dampers beside elastic-slip elements cannot be summed one by one; use response"
            )
        still = stopped(system.without_hysteresis, motion, modes, zeta)
        problem, rows = slipping_problem(system, motion, modes, zeta), system.without_hysteresis.modes(modes)
        peak = slipping_residual(problem, displaced(system, rows, place), still.stop)
        return peak if peak.ndim else float(peak)
    if couples(system, modes) or supports(system):
        total = _complex_residual(system, motion, modes, zeta, place)
    else:
        found = stopped(system, motion, modes, zeta, place)
        total = np.sum(found.peaks(found.osc.omega, found.products), -1)
    return total if total.ndim else float(total)


@dataclass(frozen=True)
class Stopped:
    """Modes that are driven until all inputs have ended.

    Attributes
    ----------
    osc : Oscillators
        Of which omega and zeta count.
    names : tuple of str
        Names of the inputs.
    profiles : tuple of BaseMotion
        Their motions; for a force the motion with this acceleration.
    stop : float or ndarray
        Time when the last of them ends, s.
    products : list of ndarray, shape (..., modes)
        Participation in each times the displacement of the tip.
    """

    osc: solver.Oscillators
    names: tuple[str, ...]
    profiles: tuple[BaseMotion, ...]
    stop: Any
    products: list[Array]

    def peaks(self, omega: NDArray[Any], products: Sequence[NDArray[Any]]) -> NDArray[Any]:
        """Return the largest displacement of the tip by each mode after the stop, shape (..., modes).

        The imaginary parts of complex frequencies and products may hold a complex-step derivative.
        """
        q: Any = 0.0
        u: Any = 0.0
        for profile, product in zip(self.profiles, products, strict=True):
            one = self.osc._replace(omega=omega, gamma=product)
            q_one, u_one = state_at_stop(one, profile, self.stop)
            q, u = q + q_one, u + u_one
        return solver.free_peak(self.osc._replace(omega=omega), q, u)


def couples(system: System, modes: int) -> bool:
    """Tell whether dampers, gyroscopic or follower forces couple the natural modes; complex modes must then exist."""
    instance("system", system, System)
    if system.numerics("complex_modes") == "none" and system.numerics("damping") is not None:
        raise ValueError(
            "system: its dampers couple modes, and with a field that has no derivative by x there are no complex ones; "
            "eliminate the field, use modal damping (zeta), or response after the stop"
        )
    return has_complex_modes(system, count("modes", modes, high=MOST_MODES))


def _complex_residual(system: System, motion: Any, modes: int, zeta: Any, place: int) -> Array:
    histories, _, stop = ended(system, motion)
    for name in supports(system):
        if system.numerics("pencil") is None or (system.basis.natural_frequencies(1) == 0.0).any():
            check_no_support(system)
        profile = histories[name]
        assert isinstance(profile, BaseMotion)
        if not all((at_rest(profile, float(end)) | (stop != end)).all() for end in np.unique(stop)):
            raise ValueError(f"motion: {name} acts by its displacement or velocity; must be at rest after the stop")
    modes = count("modes", modes, high=MOST_MODES)
    ratio = np.asarray(system.zeta if zeta is None else checked_damping(zeta))
    if zeta is not None and ratio.ndim:
        if ratio.shape[-1] != 1:
            raise ValueError(f"zeta has shape {ratio.shape}: its last axis must have one value where modes are complex")
        ratio = ratio[..., 0]
    return complex_residual(
        system, histories, lambda found: displaced(system, found, place), stop, modes, ratio, check_sampling
    )


def ended(system: System, motion: Any) -> tuple[dict[str, History], tuple[BaseMotion, ...], Any]:
    """Return the inputs, their motions, and the time when the last of them ends; refuse those without an end."""
    instance("system", system, System)
    histories = histories_of(system, motion)
    if not histories:
        raise ValueError("motion: the model has no input, neither a prescribed motion nor a force")
    profiles = tuple(one.profile if isinstance(one, Force) else one for one in histories.values())
    for (name, one), profile in zip(histories.items(), profiles, strict=True):
        if not np.all(np.isfinite(profile.duration)):
            if isinstance(one, Force):
                raise ValueError(f"motion: the force {name} never ends: must be a sampled record")
            raise ValueError("motion never stops accelerating: must be a move with a stop, or a sampled record")
    if system.numerics("constant") is not None:
        raise ValueError("system: a constant load acts too and never ends; use response after the stop")
    inputs = histories if len(histories) > 1 else ["motion"]
    shapes = {name: np.empty(profile.shape) for name, profile in zip(inputs, profiles, strict=True)}
    broadcastable(system=np.empty(system.shape), **shapes)
    stop = profiles[0].duration
    for profile in profiles[1:]:
        stop = np.maximum(stop, profile.duration)
    return histories, profiles, stop


def stopped(system: System, motion: Any, modes: int, zeta: Any, place: int = 0) -> Stopped:
    """Return the natural modes driven until all inputs have ended; refuse inputs without an end."""
    histories, profiles, stop = ended(system, motion)
    check_no_support(system)
    modes = count("modes", modes, high=MOST_MODES)
    osc = oscillators(system, np.zeros(modes), np.zeros((1, modes)), modes, zeta)
    if system.numerics("complex_modes") == "if coupled" and not has_complex_modes(system, modes):
        osc = osc._replace(zeta=_with_dampers(system, osc.omega, osc.zeta))
    for profile in profiles:
        check_sampling(profile, osc.omega)
    tip = displaced(system, system.modes(modes), place)
    products = [participation(system, modes, name) * tip for name in histories]
    return Stopped(osc, tuple(histories), profiles, stop, products)


def _with_dampers(system: System, omega: Array, zeta: Array) -> Array:
    """Return damping ratios including those of dampers that do not couple the natural modes."""
    matrix = Projected(system.domain, system.modes(omega.shape[-1]), system.numerics("damping"))["damping"]
    rate = np.einsum("...ii->...i", matrix)
    with np.errstate(divide="ignore", invalid="ignore"):
        ratio = zeta + np.where(omega > 0.0, rate / (2.0 * omega), 0.0)
    if not (ratio < 1.0).all():
        raise ValueError(
            f"modes = {omega.shape[-1]}: dampers give one of these a ratio of {ratio.max():.3g}, must be below 1; take "
            "fewer modes"
        )
    return np.asarray(ratio)
