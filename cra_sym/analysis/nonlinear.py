"""Common parts of nonlinear analyses: warnings, the output displacement, sizes of motions."""

from __future__ import annotations

import warnings
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cra_sym import checks
from cra_sym.analysis.modes import check_places, displaced, section_place
from cra_sym.analysis.stability import AsymptoticWarning
from cra_sym.model.modal_equations import ModalEquations, modal_equations
from cra_sym.model.nonlinear import NonlinearTerms
from cra_sym.model.projection import along
from cra_sym.model.system import MOST_MODES, System
from cra_sym.si import Numbers
from cra_sym.solvers.harmonic_balance import Basis
from cra_sym.solvers.modal_polynomials import ModalPolynomials

__all__ = [
    "ConvergenceWarning",
    "embedding",
    "equations_of",
    "nonlinear_modal_equations",
    "samples",
    "warn_of_slopes",
    "watched",
]

Array = NDArray[np.float64]
MOST_NONLINEAR_MODES = 40
_STEEP = 0.2  # v_x^2/2 at which terms of the next order, of size v_x^4, are 0.4 of those kept
_PLACES = 41
_SAME = 1e-6  # relative distance of frequencies whose modes may be combined differently among more modes


class ConvergenceWarning(UserWarning):
    """A solution was not found; the last converged one is returned.

    Examples
    --------
    A spring that softens has no free vibration beyond its barrier at the amplitude 1:

    >>> import warnings
    >>> from sympy import Function
    >>> import cra_sym as cra
    >>> from cra_sym.symbols import t, x
    >>> q = Function("q")(t)
    >>> soft = cra.Model(0, fields=(), coordinates=[q], x=x, domain=(0, 1), t=t,
    ...                  left=q.diff(t)**2/2 - q**2/2 + q**4/4)
    >>> with warnings.catch_warnings(record=True, action="always") as said:
    ...     curve = cra.backbone(soft.at({}), amplitude=[0.5, 1.5], modes=1)
    >>> said[0].category.__name__, curve.angular_frequency.round(2)
    ('ConvergenceWarning', array([0.9, nan]))
    """


@checks.default_floating_point
def nonlinear_modal_equations(system: System, modes: int = 3, zeta: Numbers | None = None) -> ModalEquations:
    r"""Return the equations of motion of the first linear modes with their nonlinear coefficient tensors.

    .. math:: L = \tfrac12\dot q^T\dot q - \tfrac12 q^T\Omega^2 q + \sum T[q, \ldots, q, \dot q, \ldots, \dot q]

    The modes are exact, mass-normalised and positive at the tip; the tensors are integrals along the domain by
    Gauss quadrature. A system without natural modes has the modes of its conservative part, coupled by gyroscopic terms
    in the damping matrix and by forces that follow the motion.

    Parameters
    ----------
    system : System
        Not a batch.
    modes : int
        1 to 40.
    zeta : array_like, optional
        Damping ratios, one or ``modes``; default: that of the system.

    Returns
    -------
    ModalEquations
        ``.polynomials`` has ``.omega``, ``.damping``, and the tensors in ``.energies`` and ``.forces``; ``.error`` is
        the estimated relative error of the quadrature.

    Raises
    ------
    TypeError, ValueError
        If an argument is out of its range, the system is a batch, or a term is not polynomial.

    Examples
    --------
    >>> from sympy import Symbol
    >>> import cra_sym as cra
    >>> k_3, v = Symbol("k_3"), cra.Arm.nominal().model.equations.fields[0]
    >>> arm = cra.Arm.nominal().replace(k_t=1e4)
    >>> model = arm.model.replace(left=cra.paper_lagrangian()[1] - k_3 * v**4 / 4)
    >>> equations = cra.nonlinear_modal_equations(model.at({**arm.values, "k_3": 1e9}), modes=2)
    >>> equations.polynomials.energies[0].tensor.shape
    (2, 2, 2, 2)
    """
    checks.instance("system", system, System)
    if system.model.pieces["hysteresis"]:
        raise ValueError("system: has elastic-slip elements, which are not polynomials; take system.without_hysteresis")
    modes = checks.count("modes", modes, high=MOST_NONLINEAR_MODES)
    ratios = None
    if zeta is not None:
        ratios = checks.one_axis("zeta", zeta, "modes", low=0.0, unit="1")
        if ratios.ndim and ratios.size not in (1, modes):
            raise ValueError(f"zeta has shape {ratios.shape}: must have one value, or one for each of {modes} modes")
    return modal_equations(system, modes, ratios)


def equations_of(system: System, modes: int, zeta: Any = None) -> ModalPolynomials:
    """Return the checked modal equations without known functions of time."""
    return nonlinear_modal_equations(system, modes, zeta).polynomials


def watched(system: System, modes: int, place: Any = None, field: Any = None) -> Array:
    """Return the output displacement in every mode: the tip, or the first coordinate where there is no field.

    Parameters
    ----------
    system : System
    modes : int
        At most `MOST_MODES`.
    place : float, optional
        In the domain, m.
    field : applied undefined function, optional
        A field, or a lumped coordinate.

    Raises
    ------
    ValueError
        If it is not a field or coordinate of the model, or the place is not in the domain.
    """
    checks.count("modes", modes, high=MOST_MODES)
    found, entry = system.basis.modes(modes), section_place(system, field, lumped=True)
    if place is None:
        return displaced(system, found, entry)
    at = checks.one_number("place", place, unit="m")
    check_places(system, np.asarray(at), "place")
    return displaced(system, found, entry, np.atleast_1d(at))[..., 0]


def embedding(system: System, modes: int, more: int) -> Array:
    """Return the first modes in terms of those of a larger set, shape (modes, more).

    They are the same except that modes of equal frequency, as of a beam that is alike in two planes, may be ordered or
    combined differently.
    """
    part, found = system.basis, np.eye(modes, more)
    omega = part.natural_frequencies(more)
    together = np.abs(omega[:, None] - omega) <= _SAME * omega[:, None]
    if not (together.sum(axis=1) > 1)[:modes].any():
        return found
    displacements, coordinates = part.numerics("sizes")
    x = float(part.domain.left) + float(part.domain.length) * np.linspace(0.0, 1.0, _PLACES)

    def values(number: int) -> Array:
        own = part.modes(number)
        parts = [own.shape(k, 0, x) for k in range(displacements)]
        return np.concatenate([*parts, *(own.coordinate(k)[:, None] for k in range(coordinates))], axis=1)

    old, new = values(modes), values(more)
    for mode in np.flatnonzero((together.sum(axis=1) > 1)[:modes]):
        found[mode] = 0.0
        found[mode, together[mode]] = np.linalg.lstsq(new[together[mode]].T, old[mode], rcond=None)[0]
    return found


def samples(degree: int, harmonics: int, causes: int = 0) -> int:
    """Return the number of samples per period for which the sums of harmonic balance are exact."""
    return 4 * int(np.ceil(((degree + 1) * harmonics + causes + 1) / 4))


def warn_of_slopes(system: System, basis: Basis, coefficients: Array, stacklevel: int = 5) -> None:
    """Warn if squared slopes in a quadrature are too large for their expansion.

    Parameters
    ----------
    system : System
    basis : Basis
    coefficients : ndarray, shape (solutions, modes, functions)
    stacklevel : int
        Of the warning.
    """
    terms: NonlinearTerms | None = system.numerics("nonlinear")
    if terms is None or not len(coefficients):
        return
    domain, modes = system.domain, system.basis.modes(coefficients.shape[1])
    x = float(domain.left) + float(domain.length) * np.linspace(0.0, 1.0, _PLACES)
    phase = 2 * np.pi * np.arange(4 * int(basis.orders.max(initial=1.0)) + 4) / (4 * basis.orders.max(initial=1.0) + 4)
    q = (coefficients @ basis.values(phase).T).swapaxes(1, 2)
    weights = iter(np.broadcast_arrays(x, *terms.weights.function(x, *(float(v) for v in domain.values)))[1:])
    for integrand in terms.integrands:
        value = np.zeros((*q.shape[:2], x.size))
        for places in integrand:
            parts = [q @ along(modes, place, x) for place in places]
            value += np.prod(parts, axis=0) * next(weights)
        slopes = all(place.order == 1 for places in integrand for place in places)
        most = float(np.abs(value).max())
        if slopes and all(len(places) > 1 for places in integrand) and most > _STEEP:
            text = f"quadratures: an integrand reaches {most:.3g}, beyond the reach of the expansion, about {_STEEP:g}"
            warnings.warn(text, AsymptoticWarning, stacklevel=stacklevel)
