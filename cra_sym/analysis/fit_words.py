"""Messages about a fit to measured natural frequencies."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

__all__ = ["TOLD", "ambiguity", "knowledge", "misfit"]

Array = NDArray[np.float64]
TOLD = float(np.log(2.0))  # a parameter counts as known if its standard deviation is below a factor of two


def knowledge(
    values: Mapping[str, float],
    stiff: Sequence[bool],
    units: Mapping[str, str],
    deviation: Array,
    spread: Array,
    jacobian: Array,
) -> str:
    """Return a message about the accuracy of each parameter.

    Parameters
    ----------
    values : mapping of str to float
    stiff : sequence of bool
        Whether each is a stiffness of an end, of which the data determine 1/k.
    units : mapping of str to str
    deviation : ndarray, shape (n,)
        Standard deviations of their logarithms.
    spread, jacobian : ndarray, shape (n, n), (data, n)
        Covariance, and derivatives of the weighted residuals, by 1/k of a stiffness and by others themselves.
    """
    known_well = deviation < TOLD
    known = [f"{name} is known to {d:.2g} of itself" for name, d in zip(values, deviation, strict=True)]
    if known_well.all():
        return "; ".join(known)
    if known_well.any() or (np.isfinite(spread).all() and np.isinf(list(values.values())).any()):
        bounds = []
        for k, (name, value) in enumerate(values.items()):
            if stiff[k]:
                least = 1 / (1 / value + 2 * np.sqrt(spread[k, k]))
                bounds.append(f"{name} is only known to exceed {least:.3g} {units.get(name, '')} (2 sigma)")
            else:
                bounds.append(f"{name} = {value:.3g} is not known to a factor of two")
        return "; ".join(np.where(known_well, known, bounds).tolist())
    return _combination(values, stiff, units, jacobian)


def _combination(values: Mapping[str, float], stiff: Sequence[bool], units: Mapping[str, str], jacobian: Array) -> str:
    """Return a message about the combination of parameters that the data determine best."""
    names = list(values)
    size = np.linalg.norm(jacobian, axis=0)
    if not size.any():
        return f"the frequencies do not depend on {' and '.join(names)}"
    _, weight, basis = np.linalg.svd(jacobian / np.where(size > 0, size, 1.0))
    weights = basis[0] * size
    lead = int(np.argmax(np.abs(basis[0]) > 0.1))
    ratios, error = weights / weights[lead], 1 / (weight[0] * abs(weights[lead]))
    given = [1 / value if hard else value for value, hard in zip(values.values(), stiff, strict=True)]
    total = float(np.dot(ratios, given))
    written = [f"1/{name}" if hard else name for name, hard in zip(names, stiff, strict=True)]
    joint = units.get(names[0]) == "N/m" and [units.get(name) for name in names[1:]] == ["N m/rad"]
    terms = []
    for k, text in enumerate(written):
        if k == lead:
            terms.append(text)
        elif stiff[k]:
            terms.append(f"{ratios[k]:.3g} {'m2 ' if joint else ''}/ {names[k]}")
        else:
            terms.append(f"{ratios[k]:.3g} {text}")
    unit = " m/N" if joint else ""
    return (
        f"the frequencies do not tell {' and '.join(names)} apart: what they tell is "
        f"{' + '.join(terms)} = ({total:.3g} +- {error:.2g}){unit}"
    )


def misfit(
    chi2: float, freedom: int, p_value: float, residuals: Array, modes: Sequence[int], hints: Sequence[str]
) -> str:
    """Return a message that no values fit, with the size of the misfit and hints."""
    worst = int(np.argmax(np.abs(residuals)))
    size = f"chi2 = {chi2:.3g} with {freedom} degrees of freedom (p = {p_value:.2g}), " if freedom > 0 else ""
    text = f"no values of the unknown parameters fit: {size}mode {modes[worst]} is off by {residuals[worst]:.3g} sigma"
    return "; ".join([text, *hints])


def ambiguity(solutions: Sequence[Mapping[str, float]]) -> str:
    """Return a message with all sets of values that fit."""
    found = (", ".join(f"{name} = {value:.5g}" for name, value in values.items()) for values in solutions)
    return f"{len(solutions)} sets of values fit the data: {'; '.join(found)}"
