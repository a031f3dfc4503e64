"""The work of a given force as a term of the Lagrangian."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from sympy import Expr, S, sympify
from sympy.core.function import AppliedUndef

__all__ = ["work_as_energy"]


def work_as_energy(pieces: Mapping[str, Any], force: AppliedUndef) -> dict[str, Any]:
    """Return the pieces of a model in which the virtual work of a given force is a term of the Lagrangian.

    Parameters
    ----------
    pieces : mapping
        Of which 'density', 'left', 'right', 'inside' and 'virtual_work' are read, as `Model` takes them.
    force : function of time

    Returns
    -------
    dict
        The same five.
    """
    terms: dict[str, Expr] = {"domain": S.Zero, "left": S.Zero, "right": S.Zero}
    inside, rest = list(pieces["inside"]), []
    for given, displacement, place in pieces["virtual_work"]:
        share = sympify(given, strict=True).expand().coeff(force) * force
        if place is None or isinstance(place, str):
            terms[place or "left"] += share * displacement
        elif share != 0:
            inside.append((place, share * displacement))
        if given - share != 0:
            rest.append((given - share, displacement, place))
    ends = {end: (pieces[end] or S.Zero) + terms[end] for end in ("left", "right")}
    return {"density": pieces["density"] + terms["domain"], **ends, "inside": inside, "virtual_work": rest}
