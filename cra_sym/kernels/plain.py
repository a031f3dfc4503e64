"""Functions of arrays from text without branches, by NumPy."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

__all__ = ["functions_of"]

_NAMES = ("cos", "cosh", "exp", "log", "sin", "sinh", "tan", "tanh", "where")


def functions_of(text: str, replaced: Mapping[str, Callable[..., Any]] | None = None) -> dict[str, Callable[..., Any]]:
    """Return the functions that a text in the form of `cra_sym.kernels.compiled` defines.

    Parameters
    ----------
    text : str
    replaced : mapping of str to callable, optional
        Functions that the others call instead of those in the text.

    Examples
    --------
    >>> twice = functions_of("def twice(x):\\n    return where(x > 0.0, 2.0 * x, np.sqrt(abs(x)))")["twice"]
    >>> twice(np.array([3.0, -4.0]))
    array([6., 2.])
    """
    names: dict[str, Any] = {"np": np, **{name: getattr(np, name) for name in _NAMES}}
    found = dict(names)
    exec(text, found)
    found |= replaced or {}
    return {name: value for name, value in found.items() if name not in names and name != "__builtins__"}
