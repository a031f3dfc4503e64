"""The characteristic function of an arm by lambda^4 with its derivatives, from the derived kernels."""

from __future__ import annotations

import numpy as np

from cra_sym.codegen.arm_family import arm_family
from cra_sym.solvers.one_wave import NEAR, parameters

__all__ = ["characteristic"]


def characteristic(
    kappa_t: float, kappa_r: float, mu: float, iota: float, lam: float
) -> tuple[tuple[float, ...], tuple[float, ...]]:
    """Return the determinant and its first two derivatives by z = lambda^4, times exp(-lambda), and their scales."""
    family = arm_family()
    functions = {name: kernel.function for name, kernel in family.functions.items()}
    pairs = parameters(family.layout, [np.asarray(value) for value in (kappa_t, kappa_r, mu, iota)])
    coefficients = functions["coefficients"](*pairs)
    z, decay = lam**4, np.exp(-lam)
    if z < NEAR[2]:
        series = np.polynomial.Polynomial(functions["power_series"](*coefficients))
        values = [decay * derivative(z) for derivative in (series, series.deriv(), series.deriv(2))]
        sizes = [float(np.polynomial.Polynomial(np.abs(p.coef))(z)) for p in (series, series.deriv(), series.deriv(2))]
    else:
        basis = functions["basis"](lam, decay)
        scaled = functions["derivatives"](*coefficients, z, *basis)
        values = [value / z**order for order, value in enumerate(scaled)]
        size = max(abs(k) for k in coefficients) * z**2 * max(abs(x) for x in basis)
        sizes = [float(size) / z**order for order in range(3)]
    return tuple(map(float, values)), tuple(sizes)
