"""Loads of prescribed motions as factors of displacements and coordinates."""

from __future__ import annotations

import sympy as sp

from cra_sym.model import Model
from cra_sym.model.loads import load_coefficients
from cra_sym.model.waves_form import WavesForm

__all__ = ["load_factors"]


def load_factors(model: Model, form: WavesForm, length: sp.Expr, name: str) -> list[sp.Expr]:
    """Return the factors of displacements of the left end, the right one, of their integrals, and coordinates."""
    n, order = form.structure.n, form.order
    load = model.numerics("load", name)
    inside, ends = (list(part.values()) for part in load_coefficients(model, name))
    found = [sp.S.Zero] * (3 * n + form.structure.coordinates)
    place = {displacement: position for position, displacement in enumerate(order)}
    for where, value in zip(load.ends, ends, strict=True):
        lumped = where.where == "lumped"
        found[3 * n + where.entry if lumped else place[where.entry] + n * (where.where == "right")] += value
    for where, value in zip(load.inside, inside, strict=True):
        if value.has(model.equations.x):
            raise ValueError(
                f"model: the load of {name} varies along the length; give system= with the model at its values"
            )
        if where.where == "lumped":
            found[3 * n + where.entry] += value * length
            continue
        at = place[where.entry]
        if where.order == 0:
            found[2 * n + at] += value
        elif where.order == 1:
            found[n + at] += value
            found[at] -= value
        else:
            raise ValueError(f"model: {name} acts on the highest derivative of a field; give system= with its values")
    return found
