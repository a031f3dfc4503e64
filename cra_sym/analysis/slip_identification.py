"""Elastic-slip elements from measured frequency and damping over amplitude."""

from __future__ import annotations

import itertools
import warnings
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares

from cra_sym.analysis import fit_words
from cra_sym.analysis.fit_quality import goodness, information_inverse
from cra_sym.analysis.identification import (
    AmbiguityWarning,
    IdentifiabilityWarning,
    Identification,
    MisfitWarning,
)
from cra_sym.analysis.slip_backbone import held_curve
from cra_sym.checks import broadcastable, count, default_floating_point, instance, names, real_array
from cra_sym.model.system import System
from cra_sym.si import Numbers, paired

__all__ = ["identify_slip"]

Array = NDArray[np.float64]
_REACH = np.log(3.0)  # factors of the grid of starts
_STEP = 1e-4  # difference step of the logarithms: harmonic balance converges to 1e-7
_BAD = 1e3  # residual, in sigma, where no motion is found


@dataclass(frozen=True, eq=False)
class _Fit:
    """Measured curves of one mode, and the system whose parameters are to be fitted."""

    system: System
    unknown: tuple[str, ...]
    start: Array
    amplitude: Array
    measured: Array
    sigma: Array
    mode: int
    modes: int

    def values(self, logs: Array) -> dict[str, float]:
        """Return the values; an exponent, which is negative, keeps its sign."""
        return {name: float(x) for name, x in zip(self.unknown, self.start * np.exp(logs), strict=True)}

    def curves(self, logs: Array) -> Array:
        """Return frequencies, Hz, and damping ratios, one after the other; nan where there is no such motion."""
        try:
            system = self.system.replace(**self.values(logs))
            found = held_curve(system, self.mode, self.amplitude, self.modes, None, None, None)
        except ValueError:  # a value is out of its range, such as an exponent of -1
            return np.full(self.measured.size, np.nan)
        return np.concatenate([found.angular_frequency / (2 * np.pi), found.damping_ratio])

    def residuals(self, logs: Array) -> Array:
        """Return measured minus fitted, in units of the uncertainty."""
        found = (self.measured - self.curves(logs)) / self.sigma
        return np.where(np.isfinite(found), np.clip(found, -_BAD, _BAD), _BAD)


@default_floating_point
def identify_slip(
    system: System,
    amplitude: Numbers,
    frequency: Numbers,
    damping_ratio: Numbers,
    uncertainty: tuple[Numbers, Numbers],
    unknown: Sequence[str],
    *,
    mode: int = 1,
    modes: int = 2,
) -> Identification:
    """Return the values of a system with elastic-slip elements that fit frequency and damping over the amplitude.

    Least squares of :func:`cra_sym.backbone`, weighted by the uncertainties, in the logarithms of the values, from the
    best points of a grid around the values of the system, a factor of 3 up and down, which must therefore be within an
    order of magnitude.

    Parameters
    ----------
    system : System
        One set of values; zeta is the damping without the elements.
    amplitude : array_like, shape (m,)
        Peak at the tip, m; positive.
    frequency, damping_ratio : array_like, shape (m,)
        Measured at these amplitudes, for example from a decay; Hz, and 1.
    uncertainty : (float or array_like, float or array_like)
        Standard deviations of both.
    unknown : sequence of str
        Names of parameters of the system, such as stiffness and slip of a Jenkins element, or the exponent of an Iwan;
        at most four, none of them zero.
    mode, modes : int
        As in :func:`cra_sym.backbone`.

    Returns
    -------
    Identification
        Its measured values, uncertainties, residuals and fitted ``frequencies`` are those of the frequencies, Hz,
        followed by those of the damping ratios.

    Warns
    -----
    MisfitWarning, AmbiguityWarning, IdentifiabilityWarning
        As :func:`cra_sym.identify`.

    Raises
    ------
    TypeError, ValueError
        If an argument is out of its range; it is named.

    Examples
    --------
    A mass on a spring and a slider, the frequency and damping of which were measured at three amplitudes:

    >>> from math import pi
    >>> from sympy import Function, Symbol
    >>> import cra_sym as cra
    >>> from cra_sym.symbols import t, x
    >>> q, f_s = Function("q")(t), Symbol("f_s")
    >>> rig = cra.Model(0, fields=(), coordinates=[q], x=x, domain=(0, 1), t=t,
    ...                 left=q.diff(t)**2 / 2 - 2 * q**2, hysteresis=[(cra.Jenkins(3.0, f_s), q, None)])
    >>> curve = cra.backbone(rig.at({"f_s": 0.5}), amplitude=[0.1, 0.3, 1.0], modes=1)
    >>> data = [0.1, 0.3, 1.0], curve.angular_frequency / (2 * pi), curve.damping_ratio
    >>> fit = cra.identify_slip(rig.at({"f_s": 0.7}), *data, (1e-3, 1e-3), ["f_s"], modes=1)
    >>> round(fit.values["f_s"], 4)
    0.5
    """
    fit = _checked(system, amplitude, frequency, damping_ratio, uncertainty, unknown, mode, modes)
    places = list(itertools.product((-_REACH, 0.0, _REACH), repeat=len(fit.unknown)))
    costs = [float(np.sum(fit.residuals(np.array(place)) ** 2)) for place in places]
    order = np.argsort(costs, kind="stable")[:2]
    found = [_estimate(fit, least_squares(fit.residuals, places[k], "2-point", method="lm", diff_step=_STEP,
                                          max_nfev=60 * len(fit.unknown)).x) for k in order]  # fmt: skip
    found.sort(key=lambda one: one.chi2)
    best, *others = found
    fitting = [one for one in others if one.fits and _differ(best, one)]
    messages = [best.message]
    if not best.fits:
        text = (
            f"no values of the unknown parameters fit: chi2 = {best.chi2:.3g} with {best.degrees_of_freedom} degrees "
            f"of freedom (p = {best.p_value:.2g})"
        )
        warnings.warn(text, MisfitWarning, stacklevel=3)
        messages.insert(0, text)
    elif fitting:
        text = fit_words.ambiguity([one.values for one in (best, *fitting)])
        warnings.warn(text, AmbiguityWarning, stacklevel=3)
        messages.insert(0, text)
    if not (best.log_standard_deviation < fit_words.TOLD).all():
        warnings.warn(best.message, IdentifiabilityWarning, stacklevel=3)
    solutions = (best, *fitting) if best.fits else (best,)
    return replace(best, message="; ".join(messages), solutions=solutions)


def _checked(
    system: System,
    amplitude: Any,
    frequency: Any,
    damping_ratio: Any,
    uncertainty: Any,
    unknown: Any,
    mode: Any,
    modes: Any,
) -> _Fit:
    instance("system", system, System)
    if system.shape:
        raise ValueError(f"system has shape {system.shape}: must be a single set of values, not a batch")
    if not system.model.pieces["hysteresis"]:
        raise ValueError("system: has no elastic-slip elements; give its model hysteresis=[..], or use identify")
    given = paired(
        {"amplitude": amplitude, "frequency": frequency, "damping_ratio": damping_ratio},
        {"amplitude": "m", "frequency": "Hz", "damping_ratio": "1"},
    )
    size = real_array("amplitude", given["amplitude"], low=0.0, open_low=True, unit="m")
    hertz = real_array("frequency", given["frequency"], low=0.0, open_low=True, unit="Hz")
    ratio = real_array("damping_ratio", given["damping_ratio"], low=0.0, unit="1")
    if size.ndim != 1 or size.size == 0:
        raise ValueError(f"amplitude has shape {size.shape}: must be one axis of amplitudes")
    if (np.diff(size) <= 0).any():
        raise ValueError(f"amplitude[{int(np.argmax(np.diff(size) <= 0)) + 1}]: must ascend")
    if len(uncertainty) != 2:
        raise ValueError(
            f"uncertainty has {len(uncertainty)} entries: must be that of the frequency and of the damping"
        )
    sigma = [real_array("uncertainty", one, low=0.0, open_low=True) for one in uncertainty]
    for name, values in (("frequency", hertz), ("damping_ratio", ratio)):
        if values.shape != size.shape:
            raise ValueError(f"{name} has shape {values.shape}: must be {size.shape}, as amplitude")
    for deviation in sigma:
        if broadcastable(amplitude=size, uncertainty=deviation) != size.shape:
            raise ValueError(f"uncertainty has shape {deviation.shape}: must be a number or {size.shape}")
    chosen = names("unknown", unknown, system.values)
    if not 1 <= len(set(chosen)) == len(chosen) <= 4:
        raise ValueError(f"unknown = {list(chosen)}: must be one to four different names")
    start = np.array([float(np.asarray(system.values[name])) for name in chosen])
    for name, value in zip(chosen, start, strict=True):
        if value == 0 or not np.isfinite(value):
            raise ValueError(f"unknown: {name} = {value:g} in the system; must be finite and not zero, to begin with")
    deviations = np.concatenate([np.broadcast_to(one, size.shape) for one in sigma])
    measured = np.concatenate([hertz, ratio])
    return _Fit(system, chosen, start, size, measured, deviations, count("mode", mode), count("modes", modes))


def _estimate(fit: _Fit, logs: Array) -> Identification:
    residuals, values = fit.residuals(logs), fit.values(logs)
    steps = _STEP * np.eye(logs.size)
    jacobian = np.stack([(fit.residuals(logs + step) - fit.residuals(logs - step)) / (2 * _STEP) for step in steps], -1)
    chi2, freedom, p_value, fits = goodness(residuals, logs.size)
    spread = information_inverse(jacobian)
    if not fits:
        spread = spread * (chi2 / freedom if freedom > 0 else np.inf)
    size, deviation = np.array(list(values.values())), np.sqrt(np.diag(spread))
    covariance = np.where(np.isfinite(spread), np.outer(size, size) * spread, np.inf)
    message = fit_words.knowledge(
        values, [False] * logs.size, fit.system.model.units, deviation, covariance, -jacobian / size
    )
    return Identification(
        values, covariance, covariance, deviation, fit.measured - residuals * fit.sigma, residuals, fit.measured,
        fit.sigma, np.full(residuals.size, fit.mode), chi2, freedom, p_value, fits,
        fits and bool((deviation < fit_words.TOLD).all()), message,
    )  # fmt: skip


def _differ(one: Identification, other: Identification) -> bool:
    """Return whether two sets of values differ by more than three standard deviations of one of them."""
    gap = np.abs(np.log(np.array(list(one.values.values())) / np.array(list(other.values.values()))))
    return bool((gap > 3 * np.minimum(one.log_standard_deviation, other.log_standard_deviation) + 1e-3).any())
