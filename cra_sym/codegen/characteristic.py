"""The characteristic function of an arm by lambda^4 with its derivatives, from the derived kernels."""

from __future__ import annotations

import numpy as np

from cra_sym.kernels import derived_kernel
from cra_sym.model.spectrum import NEAR, pair

__all__ = ["characteristic"]

_COEFFICIENTS, _POWER_SERIES, _BASIS, _DERIVATIVES = (
    derived_kernel(f"cra_sym.model.characteristic:{name}")
    for name in ("coefficients", "power_series", "basis", "derivatives")
)


def characteristic(
    kappa_t: float, kappa_r: float, mu: float, iota: float, lam: float
) -> tuple[tuple[float, ...], tuple[float, ...]]:
    """Return the determinant and its first two derivatives by z = lambda^4, times exp(-lambda), and their scales."""
    pairs = [x for value in (kappa_t, kappa_r, mu, iota) for x in pair(np.asarray(value))]
    coefficients = _COEFFICIENTS.function(*pairs)
    z, decay = lam**4, np.exp(-lam)
    if z < NEAR:
        series = np.polynomial.Polynomial(_POWER_SERIES.function(*coefficients))
        values = [decay * derivative(z) for derivative in (series, series.deriv(), series.deriv(2))]
        sizes = [float(np.polynomial.Polynomial(np.abs(p.coef))(z)) for p in (series, series.deriv(), series.deriv(2))]
    else:
        basis = _BASIS.function(lam, decay)
        scaled = _DERIVATIVES.function(*coefficients, z, *basis)
        values = [value / z**order for order, value in enumerate(scaled)]
        size = max(abs(k) for k in coefficients) * z**2 * max(abs(x) for x in basis)
        sizes = [float(size) / z**order for order in range(3)]
    return tuple(map(float, values)), tuple(sizes)
