"""Identification of parameters from measured natural frequencies: all sets of values that fit, with uncertainties."""

from __future__ import annotations

import warnings
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cra_sym.analysis import fit_words
from cra_sym.analysis.fit_arguments import checked_data, checked_names, checked_priors
from cra_sym.analysis.fit_hints import hints
from cra_sym.analysis.fit_quality import Goodness, goodness, information_inverse
from cra_sym.analysis.fit_search import Data, Search
from cra_sym.analysis.fit_unknowns import Unknown, unknowns
from cra_sym.checks import ByValue, default_floating_point, instance
from cra_sym.model.system import System
from cra_sym.si import Numbers

__all__ = [
    "AmbiguityWarning",
    "IdentifiabilityWarning",
    "Identification",
    "JointEstimate",
    "MisfitWarning",
    "identify",
    "identify_joint",
]

Array = NDArray[np.float64]
_JOINT = ("k_t", "k_r")


class IdentifiabilityWarning(UserWarning):
    """The measured frequencies do not determine the unknown parameters separately."""


class MisfitWarning(UserWarning):
    """No values of the unknown parameters fit the measured frequencies.

    Examples
    --------
    >>> import warnings
    >>> import cra_sym as cra
    >>> with warnings.catch_warnings(record=True, action="always") as said:
    ...     fit = cra.identify(cra.Arm.nominal(), [2.3, 13.0, 50.0], 0.01, unknown=("k_t", "k_r"))
    >>> any(issubclass(warning.category, cra.MisfitWarning) for warning in said), bool(fit.fits)
    (True, False)
    """


class AmbiguityWarning(UserWarning):
    """Several sets of values fit the measured frequencies.

    Examples
    --------
    Two frequencies, two joints:

    >>> import warnings
    >>> import cra_sym as cra
    >>> arm = cra.Arm.nominal()
    >>> measured = cra.natural_frequencies(arm.replace(k_t=2.57, k_r=8.28), modes=2)
    >>> with warnings.catch_warnings(record=True, action="always") as said:
    ...     fit = cra.identify_joint(arm, measured, 1e-3 * measured)
    >>> any(issubclass(warning.category, cra.AmbiguityWarning) for warning in said), len(fit.solutions)
    (True, 2)
    """


@dataclass(frozen=True, eq=False)
class Identification(ByValue):
    """Parameters that fit measured natural frequencies, and their uncertainty.

    Attributes
    ----------
    values : mapping of str to float
        SI; the stiffness of an end is inf where a rigid one fits best.
    covariance : ndarray, shape (n, n)
        Of the values to first order, SI; inf where the data do not determine them. If the values do not fit, it is
        scaled by chi2 over the degrees of freedom, and inf without degrees of freedom, since the model is then wrong.
    compliance_covariance : ndarray, shape (n, n)
        The same with 1/k in place of each stiffness k of an end; meaningful for nearly rigid ends too.
    log_standard_deviation : ndarray, shape (n,)
        Standard deviations of the logarithms of the values: about the relative uncertainty where it is small.
    frequencies, residuals : ndarray, shape (m,)
        Fitted frequencies (Hz), and measured minus fitted in units of the uncertainty.
    measured, uncertainty : ndarray, shape (m,)
        Data, Hz.
    modes : ndarray of int, shape (m,)
        The modes these belong to, from 1.
    chi2 : float
        Sum of the squared residuals, those of the priors included.
    degrees_of_freedom : int
        Number of data and priors minus that of unknowns.
    p_value : float
        Probability of a larger chi2 if the model is right; nan without degrees of freedom.
    fits : bool
        Whether p_value is at least 0.01; without degrees of freedom, whether every residual is below 3.
    identifiable : bool
        Whether the values fit and each is known to better than a factor of two (one standard deviation).
    message : str
        Summary of what the data determine.
    solutions : tuple of Identification
        Every distinct set of values that fits, best first, this one included; this one alone if none fits.
    """

    values: Mapping[str, float]
    covariance: Array
    compliance_covariance: Array
    log_standard_deviation: Array
    frequencies: Array
    residuals: Array
    measured: Array
    uncertainty: Array
    modes: NDArray[np.intp]
    chi2: float
    degrees_of_freedom: int
    p_value: float
    fits: bool
    identifiable: bool
    message: str
    solutions: tuple[Identification, ...] = ()

    def __repr__(self) -> str:
        deviations = np.sqrt(np.diag(self.covariance))
        found = (
            f"{name} = {value:.6g} +- {s:.2g}" for (name, value), s in zip(self.values.items(), deviations, strict=True)
        )
        fits = "fits" if self.fits else "does not fit"
        return f"<{type(self).__name__}: {', '.join(found)}; {fits}, p = {self.p_value:.2g}; {self.message}>"


class JointEstimate(Identification):
    """Stiffnesses of the bolted joint, with names of their own."""

    @property
    def k_t(self) -> float:
        """Translational stiffness, N/m."""
        return self.values["k_t"]

    @property
    def k_r(self) -> float:
        """Rotational stiffness, N m/rad."""
        return self.values["k_r"]


def identify(
    system: System,
    measured: Numbers,
    uncertainty: Numbers,
    unknown: Sequence[str] | None = None,
    modes: Sequence[int] | None = None,
    prior: Mapping[str, tuple[float, float]] | None = None,
) -> Identification:
    """Return the values of parameters that fit measured natural frequencies, and all other sets of values that fit.

    Least squares with exact gradients, weighted by the uncertainties, from every local minimum of a grid; the stiffness
    of an end is searched in ln(1 + unit/k), so that a rigid one has the finite value 0, others within a factor of 1000
    of their value in ``system`` (or of their prior). Values at which the structure is unstable are excluded.

    With gyroscopic forces or forces that follow the motion there are no natural frequencies: the imaginary parts of the
    oscillating :func:`eigenvalues` over 2 pi, by ascending modulus, are fitted, with gradients by differences.

    Parameters
    ----------
    system : System
        One set of values; those of unknown stiffnesses do not matter.
    measured : array_like, shape (m,)
        Natural frequencies, Hz, ascending.
    uncertainty : float or array_like, shape (m,)
        Standard deviation of each, Hz; 1e-60 to 1e60.
    unknown : sequence of str, optional
        Names of parameters of the system; by default the stiffnesses of the ends, for an arm k_t and k_r.
    modes : sequence of int, shape (m,), optional
        Which modes were measured, from 1, rigid-body modes included; by default the lowest m.
    prior : mapping of str to (value, uncertainty), optional
        Parameters that are roughly known, with standard deviation: they are estimated too.

    Returns
    -------
    Identification

    Warns
    -----
    MisfitWarning
        If no values fit. The message names each frequency without which the others fit: its value is wrong, or it is
        that of a higher mode. It also names the ``modes`` that would fit if one or two modes were missed.
    AmbiguityWarning
        If several sets of values fit that differ by more than their uncertainty.
    IdentifiabilityWarning
        If the data do not determine the parameters separately.

    Raises
    ------
    TypeError, ValueError
        If an argument is out of its range; it is named.

    Examples
    --------
    >>> from cra_sym import Arm, identify, natural_frequencies
    >>> loose = Arm.nominal().replace(k_t=2e3, k_r=40.0, m_e=0.02)
    >>> fit = identify(Arm.nominal(), natural_frequencies(loose, 5), 0.001, unknown=("k_t", "k_r", "m_e"))
    >>> print({name: float(f"{value:.4g}") for name, value in fit.values.items()}, fit.fits)
    {'k_t': 2000.0, 'k_r': 40.0, 'm_e': 0.02} True
    """
    return _identified(Identification, "measured", system, measured, uncertainty, unknown, modes, prior)


def identify_joint(
    system: System,
    measured_frequencies: Numbers,
    uncertainty: Numbers,
    modes: Sequence[int] | None = None,
    prior: Mapping[str, tuple[float, float]] | None = None,
) -> JointEstimate:
    """Return the joint stiffnesses that fit measured natural frequencies, and all other pairs that fit.

    :func:`identify` with the unknowns ``k_t`` and ``k_r``.

    Parameters
    ----------
    system : System
        One set of values, with stiffnesses k_t and k_r of an end; their own values do not matter.
    measured_frequencies, uncertainty, modes, prior
        As in :func:`identify`.

    Returns
    -------
    JointEstimate
        An :class:`Identification` with ``k_t`` and ``k_r``.

    Warns
    -----
    MisfitWarning, AmbiguityWarning, IdentifiabilityWarning
        As :func:`identify`.

    Raises
    ------
    TypeError, ValueError
        As :func:`identify`, or if k_t or k_r is not the stiffness of an end.

    Examples
    --------
    >>> from cra_sym import Arm, identify_joint, natural_frequencies
    >>> loose = Arm.nominal().replace(k_t=2e3, k_r=40.0)
    >>> estimate = identify_joint(Arm.nominal(), natural_frequencies(loose), uncertainty=0.01)
    >>> print(f"{estimate.k_t:.1f} N/m, {estimate.k_r:.3f} N m/rad")
    2000.0 N/m, 40.000 N m/rad
    """
    instance("system", system, System)
    missing = [name for name in _JOINT if name not in system.numerics("stiffnesses")]
    if missing:
        raise ValueError(f"system: {missing[0]} must be the stiffness of an end of its model")
    arguments = (system, measured_frequencies, uncertainty, _JOINT, modes, prior)
    found = _identified(JointEstimate, "measured_frequencies", *arguments)
    assert isinstance(found, JointEstimate)
    return found


@default_floating_point
def _identified(
    kind: type[Identification],
    name: str,
    system: System,
    measured: Numbers,
    uncertainty: Numbers,
    unknown: Sequence[str] | None,
    modes: Any,
    prior: Any,
) -> Identification:
    data = checked_data(system, name, measured, uncertainty, modes)
    priors = checked_priors(system, prior)
    parameters = unknowns(system, checked_names(system, unknown, priors), priors)
    search = Search(
        system, parameters, max(int(data.modes.max()) + 1, min(int(data.modes.max()) + 2, system.most_modes))
    )
    estimates = _estimates(kind, search, data)
    best = estimates[0]
    messages = [best.message]
    if not best.fits:
        numbers, causes = (data.modes + 1).tolist(), hints(search, data, name, modes is None)
        text = fit_words.misfit(best.chi2, best.degrees_of_freedom, best.p_value, best.residuals, numbers, causes)
        warnings.warn(text, MisfitWarning, stacklevel=4)
        messages = [text, *messages]
    if len(estimates) > 1:
        text = fit_words.ambiguity([estimate.values for estimate in estimates])
        warnings.warn(text, AmbiguityWarning, stacklevel=4)
        messages = [text, *messages]
    if not (best.log_standard_deviation < fit_words.TOLD).all():
        warnings.warn(best.message, IdentifiabilityWarning, stacklevel=4)
    return replace(best, message="; ".join(messages), solutions=tuple(estimates))


def _estimates(kind: type[Identification], search: Search, data: Data) -> list[Identification]:
    """Return the distinct fits, or the best values if none fits."""
    places = search.minima(data)
    best = _estimate(kind, search, data, places[0])
    if not best.fits or search.residuals(places[0], data).size < len(search.unknowns):
        return [best]
    good = [place for place in places if _goodness(search, data, place).fits]
    return [_estimate(kind, search, data, place) for place in search.distinct(good, data)]


def _goodness(search: Search, data: Data, place: Array) -> Goodness:
    """Return the goodness of fit at a point."""
    return goodness(search.residuals(place, data), len(search.unknowns))


def _estimate(kind: type[Identification], search: Search, data: Data, place: Array) -> Identification:
    found, values = search.found(place), {name: float(value) for name, value in search.values(place).items()}
    chi2, freedom, p_value, fits = _goodness(search, data, place)
    stiff = [unknown.kind == "stiffness" for unknown in search.unknowns]
    jacobian = _jacobian(search.unknowns, values, found, data)
    spread = information_inverse(jacobian)
    if not fits:
        spread = spread * (chi2 / freedom if freedom > 0 else np.inf)
    size = np.array([abs(value) for value in values.values()])
    rigid = np.isinf(size)
    with np.errstate(all="ignore"):
        scale = np.where(rigid, 1.0, np.where(stiff, size, np.where(size > 0, 1 / size, np.inf)))
        relative = np.where(rigid | rigid[:, None], np.inf, spread * np.outer(scale, scale))
        by_value = np.where(rigid, 1.0, np.where(stiff, -(size**2), 1.0))
        covariance = np.where(rigid | rigid[:, None], np.inf, spread * np.outer(by_value, by_value))
        covariance = np.where(np.isinf(spread), np.inf, covariance)
        deviation = np.sqrt(np.diag(relative))
    message = fit_words.knowledge(values, stiff, search.system.model.units, deviation, spread, jacobian)
    identifiable = fits and bool((deviation < fit_words.TOLD).all())
    frequencies = found.frequency[data.modes]
    residuals = (data.measured - frequencies) / data.sigma
    return kind(
        values, covariance, spread, deviation, frequencies, residuals, data.measured, data.sigma, data.modes + 1,
        chi2, freedom, p_value, fits, identifiable, message,
    )  # fmt: skip


def _jacobian(parameters: Iterable[Unknown], values: Mapping[str, float], found: Any, data: Data) -> Array:
    """Return the derivatives of the weighted residuals by 1/k of each stiffness and by other values themselves."""
    parameters = tuple(parameters)
    rows = np.stack([unknown.slopes(found)[data.modes] for unknown in parameters], -1) / data.sigma[:, None]
    known = [(i, unknown) for i, unknown in enumerate(parameters) if unknown.prior is not None]
    prior = np.zeros((len(known), len(parameters)))
    for row, (i, unknown) in zip(prior, known, strict=True):
        row[i] = unknown.prior_row(values[unknown.name])
    return np.nan_to_num(np.vstack([rows, prior]), nan=0.0, posinf=0.0, neginf=0.0)
