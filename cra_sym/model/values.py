"""Parameter values as a user gives them: by symbol or by name, numbers or arrays, checked against the model."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cra_sym.checks import broadcastable, normal, real_array, shown
from cra_sym.si import paired

__all__ = ["checked_damping", "checked_values", "flat_columns", "frozen", "infinite_patterns"]

_NUMBERS = "real numbers, or inf for the stiffness of an end"
Value = float | NDArray[np.float64]


def checked_values(
    names: Sequence[str], given: Mapping[Any, Any], units: Mapping[str, str] | None = None
) -> dict[str, Value]:
    """Return the values by name, in the order of the names, as numbers and read-only arrays.

    Parameters
    ----------
    names : sequence of str
        The parameters of the model.
    given : mapping of symbol or name to array_like
    units : mapping of name to unit, optional
        Quantities with units must be convertible to these; where there is none, they are converted to SI.

    Raises
    ------
    TypeError, ValueError
        Names the parameter that is missing, unknown, given twice or not made of real numbers, or shapes that do not
        broadcast together.
    """
    if not isinstance(given, Mapping):
        raise TypeError(f"values = {shown(given)}: must be a mapping from symbols or their names to numbers")
    named: dict[str, Any] = {}
    for key, value in given.items():
        name = key if isinstance(key, str) else getattr(key, "name", str(key))
        if name not in names:
            raise ValueError(f"values: {name} does not occur in the model; it has {', '.join(names) or 'none'}")
        if name in named:
            raise ValueError(f"values: {name} is given twice")
        named[name] = value
    found: dict[str, NDArray[np.float64]] = {}
    for name, value in paired(named, units).items():
        try:
            found[name] = real_array(name, value, allow_infinite=True, unit=(units or {}).get(name), must=_NUMBERS)
        except TypeError as error:
            raise ValueError(str(error)) from None
        if (found[name] == -np.inf).any():
            raise ValueError(f"{name} = -inf: must be {_NUMBERS}")
        normal(name, found[name])
    missing = [name for name in names if name not in found]
    if missing:
        raise ValueError(f"values: no value for {', '.join(missing)}")
    broadcastable(**found)
    return {name: frozen(found[name]) for name in names}


def frozen(array: NDArray[np.float64]) -> Value:
    """Return a number, or a read-only array; -0.0 becomes 0.0."""
    array = np.asarray(array + 0.0)
    array.flags.writeable = False
    return float(array) if array.ndim == 0 else array


def checked_damping(zeta: Any) -> NDArray[np.float64]:
    """Return damping ratios, or raise an error if one is out of range."""
    return real_array("zeta", zeta, low=0.0, high=np.nextafter(1.0, 0.0), unit="1", must="real numbers in [0, 1)")


def flat_columns(values: Sequence[Value], shape: tuple[int, ...]) -> NDArray[np.float64]:
    """Return parameters that broadcast to a shape as flat columns, shape (parameters, sets)."""
    columns = np.empty((len(values), int(np.prod(shape))))
    for column, value in zip(columns, values, strict=True):
        column[:] = np.broadcast_to(value, shape).ravel()
    return columns


def infinite_patterns(columns: NDArray[np.float64]) -> list[tuple[NDArray[np.intp], tuple[int, ...]]]:
    """Return, for each pattern of infinite values, the sets and the positions of the infinite parameters."""
    kinds, where = np.unique(np.isinf(columns), axis=1, return_inverse=True)
    return [
        (np.nonzero(where.ravel() == k)[0], tuple(np.nonzero(kinds[:, k])[0].tolist())) for k in range(kinds.shape[1])
    ]
