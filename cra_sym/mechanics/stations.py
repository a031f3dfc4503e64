"""A table of values at stations as a coefficient of a Lagrangian."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from typing import Any, Literal

from sympy import Expr, Piecewise, Symbol, sympify

from cra_sym import checks

__all__ = ["stations"]


def stations(
    x: Symbol, table: Sequence[tuple[Expr | float, Expr | float]], kind: Literal["linear", "step"] = "linear"
) -> Expr:
    """Return a table of values along x as an expression, for use as a coefficient in a Lagrangian.

    Parameters
    ----------
    x : Symbol
    table : sequence of (place, value)
        At least two stations. Places that are numbers must ascend; places and values may be expressions in the
        parameters.
    kind : {'linear', 'step'}
        Between two stations the value is interpolated linearly, or is that of the left one. Outside the table it is
        that of the nearest station.

    Returns
    -------
    Expr
        A Piecewise in x: frequencies and modes have breakpoints at the stations.

    Raises
    ------
    TypeError, ValueError
        If there are fewer than two stations, an entry is not a pair of expressions, or places do not ascend.

    Examples
    --------
    >>> from sympy import symbols
    >>> x, b = symbols("x b")
    >>> stations(x, [(0, 2), (1, b)], kind="step")
    Piecewise((2, x < 1), (b, True))
    """
    checks.instance("x", x, Symbol)
    checks.choice("kind", kind, ("linear", "step"))
    pairs = [_pair(entry) for entry in table]
    if len(pairs) < 2:
        raise ValueError(f"table has {len(pairs)} stations: must have at least two")
    for (before, _), (after, _) in pairwise(pairs):
        if (after - before).is_nonpositive:
            raise ValueError(f"table: the place {after} must be greater than {before} before it")
    if kind == "step":
        parts = [(value, x < after) for (_, value), (after, _) in pairwise(pairs)]
    else:
        parts = [(pairs[0][1], x < pairs[0][0])]
        for (left, low), (right, high) in pairwise(pairs):
            parts.append((low + (high - low) * (x - left) / (right - left), x < right))
    return Piecewise(*parts, (pairs[-1][1], True))


def _pair(entry: Any) -> tuple[Expr, Expr]:
    try:
        place, value = entry
        pair = sympify(place, strict=True), sympify(value, strict=True)
    except (TypeError, ValueError):
        raise TypeError(f"table: {checks.shown(entry)} must be a pair (place, value)") from None
    if not all(isinstance(part, Expr) for part in pair):
        raise TypeError(f"table: {checks.shown(entry)} must be a pair (place, value) of expressions")
    return pair
