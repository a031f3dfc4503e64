"""Parametric stability of a system: boundaries by multiple scales."""

from __future__ import annotations

import warnings
from collections.abc import Iterator
from typing import Any

import numpy as np

from cra_sym import checks
from cra_sym.analysis.complex_shapes import check_complex_modes, resonant_growth
from cra_sym.analysis.eigenvalue_rates import gaps, with_next
from cra_sym.analysis.floquet import batch_shape, matrices_of, parametric
from cra_sym.analysis.modes import displaced, only_motion, participation
from cra_sym.analysis.zones import Zone, derived, first_order_zone, zone_of
from cra_sym.kernels import derived_kernel
from cra_sym.model.excitations import Excitation, Fluctuation, Parametric, TransverseBase
from cra_sym.model.one_wave import OneWaveModes
from cra_sym.model.system import MOST_MODES, System
from cra_sym.si import Numbers, paired

__all__ = ["AsymptoticWarning", "ResonanceWarning", "forced_width", "judged_boundary", "stability_boundary"]

_FORCED = derived_kernel("cra_sym.mechanics.boundaries:forced_growth")
_GROWING, _LIGHT = 1e-9, 0.1  # real parts of eigenvalues over their moduli: rounding, and light damping
_SAME = 1e-9  # relative distance below which eigenvalues are equal
_REACH = 0.5  # largest second-order shift of the zone over its half-width


class ResonanceWarning(UserWarning):
    """The requested resonance has no instability; the boundary is nan there.

    Examples
    --------
    >>> import warnings
    >>> import cra_sym as cra
    >>> with warnings.catch_warnings(record=True, action="always") as said:
    ...     bounds = cra.stability_boundary(cra.Arm.nominal(), cra.AxialBase(0.001), 0.1, resonance=(1, -2))
    >>> print(said[0].category.__name__, *(float(bound) for bound in bounds))
    ResonanceWarning nan nan
    """


class AsymptoticWarning(UserWarning):
    """A boundary is returned outside the range in which its expansion in epsilon is reliable.

    Examples
    --------
    >>> import warnings
    >>> import cra_sym as cra
    >>> soft = cra.Arm.nominal().replace(k_t=1e3, k_r=1e2)
    >>> with warnings.catch_warnings(record=True, action="always") as said:
    ...     bounds = cra.stability_boundary(soft, cra.JointStiffness(), epsilon=0.9)
    >>> print(said[0].category.__name__, said[0].message)
    AsymptoticWarning resonance (1, 1): epsilon = 0.9 is beyond the reach of the expansion
    """


@checks.default_floating_point
def stability_boundary(
    system: System,
    excitation: Excitation,
    epsilon: Numbers,
    resonance: tuple[int, int] = (1, 1),
    order: int = 1,
    modes: int = 3,
    *,
    tongue: int = 1,
) -> tuple[np.ndarray, np.ndarray]:
    """Return the excitation frequencies between which a resonance makes the system unstable, (49).

    Parameters
    ----------
    system : System
    excitation : Fluctuation, JointStiffness, AxialBase or the model's own `excitation`
    epsilon : array_like
        Not negative.
    resonance : (int, int)
        ``(n, n)`` principal, ``(m, n)`` sum, ``(m, -n)`` difference; modes are counted from 1.
    order : {1, 2}
        Order in epsilon. The second one shifts the zone, without a change of width where the boundary is a derived
        formula. It includes the response of other modes than the first ``modes``: of 24, and the static response of all
        others where stiffnesses of ends fluctuate and damping is modal.
    modes : int
        Number of modes, 1 to 1000; other resonances among them are checked for overlap.
    tongue : {1, 2}
        2: the zone near half the frequency, (omega_m + omega_n) / 2, whose width is of order epsilon^2.

    Returns
    -------
    lower, upper : ndarray
        rad/s, shape broadcast from system, excitation and epsilon; nan where there is no instability. If only one of
        the two modes is damped, vibration grows at every detuning, slowly at large ones: 0 and inf.

    Warns
    -----
    ResonanceWarning
        Where there is no instability; the message gives the reason.
    AsymptoticWarning
        Where the zone overlaps that of another resonance, or epsilon is too large for the expansion.

    Raises
    ------
    TypeError, ValueError
        If an argument is out of its range or shapes do not broadcast together.

    Notes
    -----
    For one stiffness proportional to cos(varpi t) and modal damping, the boundary is derived by multiple scales,
    (37)-(49). Otherwise all states but those of the two modes are eliminated to second order
    (:mod:`cra_sym.solvers.normal_form`). Modes are then those of the system without its oscillating terms, with dampers
    and gyroscopic forces, by ascending frequency.

    Examples
    --------
    >>> from cra_sym import Arm, JointStiffness
    >>> arm = Arm.nominal().replace(k_t=1e4)
    >>> lower, upper = stability_boundary(arm, JointStiffness(), 0.1, (2, 2), order=2)
    >>> print(f"{lower:.3f} {upper:.3f}")
    186.938 187.346
    """
    lower, upper, doubts = judged_boundary(system, excitation, epsilon, resonance, order, modes, tongue=tongue)
    for kind, text in doubts:
        warnings.warn(text, kind, stacklevel=3)
    return lower, upper


@checks.default_floating_point
def judged_boundary(
    system: System,
    excitation: Excitation,
    epsilon: Numbers,
    resonance: tuple[int, int] = (1, 1),
    order: int = 1,
    modes: int = 3,
    *,
    tongue: int = 1,
) -> tuple[np.ndarray, np.ndarray, list[tuple[type[UserWarning], str]]]:
    """Return the result of :func:`stability_boundary` with its warnings as pairs of category and text, not issued."""
    excitation = parametric(excitation)
    checks.instance("system", system, System)
    epsilon = paired({"system": np.empty(system.shape), "epsilon": epsilon})["epsilon"]
    epsilon = checks.real_array("epsilon", epsilon, low=0.0, unit="1")
    modes = checks.count("modes", modes)
    first, second = _resonance(resonance, modes)
    order, tongue = checks.count("order", order, high=2), checks.count("tongue", tongue, high=2)
    shape = batch_shape(system, excitation, epsilon=epsilon)
    if tongue > order and not any(d.oscillation.order == tongue for d in excitation.drives(system, modes)):
        raise ValueError("order = 1: the second tongue appears at order 2")
    zone = zone_of(system, excitation, epsilon, first, second, tongue, modes)
    alone = derived(matrices_of(system, excitation, modes))
    doubts = [
        *_explained(zone, system, excitation, first, second, alone=alone),
        *_doubted(zone, system, excitation, epsilon, (first, second), modes, rival=tongue == 1),
    ]
    if order == 1:
        zone = first_order_zone(system, excitation, epsilon, first, second, modes, tongue)
    if np.isinf(zone.half_width).any():
        text = "one of the two modes is not damped: vibration grows at every detuning, slowly at large ones"
        doubts.append((AsymptoticWarning, f"resonance {(first, second)}: {text}; see growth_rate"))
    lower, upper = (np.broadcast_to(side, shape)[()] + 0.0 for side in zone.bounds)
    return lower, upper, doubts


@checks.default_floating_point
def forced_width(system: System, excitation: TransverseBase, modes: int = 3) -> np.ndarray:
    """Return the measure of the forced resonances of a transverse base, (49a).

    It is ``|Gamma_n phi_n(L)| omega_n w_1 / (2 M_n)``, and not a boundary. A transverse base motion at a
    natural frequency makes the undamped tip amplitude grow linearly in time, at this rate for epsilon = 1. The measure
    does not depend on the normalisation of the modes.

    Without natural modes (gyroscopic terms, forces that follow the motion), and with a base that acts by its
    displacement or velocity too, resonances are those of the complex modes, at ``Im s`` of :func:`cra_sym.eigenvalues`,
    and dampers count. The measure is the rate at the start: of a mode that decays, the amplitude grows as
    ``(1 - exp(Re s t)) / |Re s|`` times the rate, not as t.

    Parameters
    ----------
    system : System
        The damping of natural modes does not matter, and modal damping (zeta) does not at all.
    excitation : TransverseBase
        Its amplitude is w_1.
    modes : int
        How many resonances, 1 to 1000; that of a rigid-body mode, with omega_n = 0, has the measure 0.

    Returns
    -------
    ndarray, shape (..., modes)
        m/s; ``...`` is broadcast from system and excitation. It is nan for modes of equal frequencies, which are not
        determined one by one.

    Raises
    ------
    TypeError, ValueError
        If ``system`` is not a :class:`System`, ``excitation`` not a :class:`TransverseBase`, ``modes`` not an
        integer from 1 to 1000, or shapes do not broadcast together; if a complex mode grows by itself, or decays by
        more than a tenth of its frequency.

    Examples
    --------
    >>> import cra_sym as cra
    >>> cra.forced_width(cra.Arm.nominal(), cra.TransverseBase(0.001), modes=2).round(4)
    array([0.0119, 0.0407])
    """
    if not isinstance(excitation, TransverseBase):
        raise TypeError(
            f"excitation = {checks.shown(excitation)}: must be a TransverseBase; the others have stability_boundary"
        )
    checks.instance("system", system, System)
    checks.broadcastable(system=np.empty(system.shape), amplitude=np.empty(excitation.shape))
    modes = checks.count("modes", modes, high=MOST_MODES)
    amplitude = np.asarray(excitation.amplitude)[..., None]
    acts_by_more = any(kind == "support" for _, kind in system.numerics("causes"))
    if acts_by_more or system.conservative_part is not system:
        return np.asarray(amplitude * _complex_growth(system, only_motion(system, support=acts_by_more), modes))
    found, omega = system.modes(modes), system.natural_frequencies(modes)
    width: np.ndarray = _FORCED(omega, participation(system, modes), found.displacement(1, 0), 1.0, amplitude)
    if isinstance(found, OneWaveModes):  # of which no frequency is repeated
        return width
    more = system.natural_frequencies(min(modes + 1, system.most_modes))
    repeated = (omega > 0.0) & (gaps(np.asarray(1j * more, dtype=complex))[..., :modes] <= _SAME * omega)
    return np.where(repeated, np.nan, width)


def _complex_growth(system: System, motion: str, modes: int) -> np.ndarray:
    """Return how fast the tip grows in resonance with a motion of unit amplitude, 1/s, shape (..., modes)."""
    check_complex_modes(system)
    s = with_next(system, modes)
    apart, s = gaps(s)[..., :modes], s[..., :modes]
    decays = f"decays by more than {_LIGHT:g} of its frequency, so that its resonance does not grow"
    for bad, what in (
        (s.real > _GROWING * np.abs(s), "grows by itself, so that no resonance shows; see eigenvalues"),
        (-s.real > _LIGHT * np.abs(s), f"{decays}; use frequency_response"),
    ):
        if bad.any():
            number = int(np.nonzero(bad)[-1].min()) + 1
            raise ValueError(f"system: mode {number} {what}")
    found = resonant_growth(system, motion, s, lambda one, basis: displaced(one, basis, 0))
    return np.where((s != 0.0) & (apart <= _SAME * np.abs(s)), np.nan, found)


def _resonance(resonance: Any, modes: int) -> tuple[int, int]:
    allowed = f"must be (n, n), (m, n) or (m, -n) with modes from 1 to {modes}"
    try:
        first, second = resonance
    except (TypeError, ValueError):
        raise ValueError(f"resonance = {checks.shown(resonance)}: {allowed}") from None
    sign = -1 if isinstance(second, int | np.integer) and second < 0 else 1
    try:
        first, second = checks.count("m", first, high=modes), sign * checks.count("n", sign * second, high=modes)
    except (TypeError, ValueError):
        raise ValueError(f"resonance = {checks.shown(resonance)}: {allowed}") from None
    if first == -second:
        raise ValueError(
            f"resonance = {resonance!r}: {allowed}; the difference of a mode with itself is not a frequency"
        )
    # the order of the two modes does not matter; omega_m - omega_n is made positive
    return (-second, -first) if second < 0 and first < -second else (first, second)


def _still(system: System, excitation: Parametric) -> str:
    """Return which fluctuating parameters do not fluctuate at their values, as a text for a message."""
    weights = excitation.weights if isinstance(excitation, Fluctuation) else {}
    values = {name: np.asarray(system.values[name]) for name, weight in weights.items() if np.any(weight)}
    fixed = [f"{name} = {v}" for name, value in values.items() for v in (0.0, np.inf) if np.any(value == v)]
    return f": nothing fluctuates about {' and '.join(fixed)}" if fixed else ""


def _explained(
    zone: Zone, system: System, excitation: Parametric, first: int, second: int, *, alone: bool
) -> Iterator[tuple[type[UserWarning], str]]:
    """Return a message with the reason why there is no zone."""
    name = f"resonance ({first}, {second})"
    rest = zone.centre <= 0
    reasons = [
        (rest, "a rigid-body mode has no frequency to resonate with"),
        (
            ~rest & (zone.strength == 0),
            f"{excitation!r} does not couple these modes{_still(system, excitation)}",
        ),
        (
            ~rest & (zone.strength < 0),
            "there is none: P is symmetric, and a difference resonance needs P_mn P_nm < 0"
            if alone
            else "there is none: one of the modes takes what the other one gives",
        ),
        (~rest & (zone.strength > 0) & np.isnan(zone.half_width), "epsilon is below the threshold that damping sets"),
    ]
    for where, reason in reasons:
        if np.any(where):
            scope = "" if np.all(where) else f" for {np.count_nonzero(where)} of {np.size(where)} parameter sets"
            yield ResonanceWarning, f"{name}: no instability{scope}: {reason}"


def _doubted(
    zone: Zone,
    system: System,
    excitation: Parametric,
    epsilon: np.ndarray,
    resonance: tuple[int, int],
    modes: int,
    *,
    rival: bool,
) -> Iterator[tuple[type[UserWarning], str]]:
    """Return a message if the expansion is not reliable; with ``rival``, the second order must be below the first."""
    name = f"resonance {resonance}"
    there = ~np.isnan(zone.half_width) & (epsilon > 0)
    with np.errstate(invalid="ignore"):
        far = there & (zone.half_width > _REACH * zone.centre)
        far |= there & rival & (np.abs(zone.shift) > _REACH * zone.free_half_width)
    if np.any(far):
        largest = np.broadcast_to(epsilon, far.shape)[far].min()
        text = f"epsilon = {largest:g} is beyond the reach of the expansion"
        yield AsymptoticWarning, f"{name}: {text}"
    weights = excitation.weights.values() if isinstance(excitation, Fluctuation) else ()
    if any(np.any(epsilon * np.asarray(weight) > 1) for weight in weights):
        text = "epsilon times weight exceeds 1: a stiffness is negative in part of the period"
        yield AsymptoticWarning, f"{name}: {text}"
    for other in _overlapping(zone, system, excitation, epsilon, resonance, modes):
        text = f"its zone overlaps that of resonance {other}, and each is derived as if it were alone"
        yield AsymptoticWarning, f"{name}: {text}"


def _overlapping(
    zone: Zone, system: System, excitation: Parametric, epsilon: np.ndarray, resonance: tuple[int, int], modes: int
) -> list[str]:
    found = []
    for m in range(1, modes + 1):
        for n in range(m, modes + 1):
            if (m, n) in (resonance, resonance[::-1]):
                continue
            other = first_order_zone(system, excitation, epsilon, m, n, modes)
            if _touches(zone, other.centre, other.half_width):
                found.append(f"({m}, {n})")
            # the second tongue, of order epsilon^2, lies at half the frequency and is computed only if it is near
            if _touches(zone, other.centre / 2, 2 * zone.half_width):
                second = zone_of(system, excitation, epsilon, m, n, 2, modes)
                if _touches(zone, second.centre + second.shift, second.half_width):
                    found.append(f"({m}, {n}), second tongue")
    return found


def _touches(zone: Zone, centre: np.ndarray, half_width: np.ndarray) -> bool:
    with np.errstate(invalid="ignore"):
        return bool(np.any(np.abs(centre - zone.centre - zone.shift) < half_width + zone.half_width))
