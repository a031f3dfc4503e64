"""Argument checks for all subpackages: each error names the argument, its value and the allowed ones."""

from __future__ import annotations

import operator
from collections.abc import Collection, Iterable, Mapping, Sequence
from typing import Any

import numpy as np

from cra_sym.si import plain_numbers

__all__ = [
    "ByValue",
    "broadcastable",
    "choice",
    "common_shape",
    "count",
    "default_floating_point",
    "equal",
    "flag",
    "instance",
    "listed",
    "mapping",
    "names",
    "normal",
    "one_axis",
    "one_number",
    "real_array",
    "shown",
]


default_floating_point = np.errstate(all="warn", under="ignore")
"""Decorator: NumPy's default treatment of overflow and underflow, regardless of the caller's settings."""


def shown(value: Any) -> str:
    """Return a short one-line text of a value for error messages."""
    try:
        text = " ".join(repr(value).split())
    except Exception:  # an integer of too many digits, an expression of too many levels
        text = f"<{type(value).__name__}>"
    return text if len(text) <= 80 else text[:77] + "..."


def real_array(
    name: str,
    value: Any,
    *,
    low: float = -np.inf,
    high: float = np.inf,
    open_low: bool = False,
    allow_infinite: bool = False,
    must: str | None = None,
    unit: str | None = None,
) -> np.ndarray:
    """Return ``value`` as a float64 array, or raise an error that names the field.

    Parameters
    ----------
    name : str
        Field name used in the error.
    value : array_like
        Real numbers, exact ones too, or quantities with units; strings, booleans, complex numbers, ragged sequences and
        masked elements are refused.
    low, high : float
        Inclusive bounds (``open_low`` excludes ``low`` itself).
    allow_infinite : bool
        Whether infinity within the bounds is a value.
    must : str, optional
        Text of the requirement in the error; by default from the bounds.
    unit : str, optional
        Unit of SI that a quantity is converted to.

    Raises
    ------
    TypeError
        If ``value`` does not hold real numbers.
    ValueError
        If an element is NaN or out of bounds, or a unit cannot be converted.
    """
    bracket = "(" if open_low or (low == -np.inf and not allow_infinite) else "["
    must = must or f"real numbers in {bracket}{low:g}, {high:g}{']' if allow_infinite or np.isfinite(high) else ')'}"
    try:
        given = plain_numbers(name, value, unit)
    except (TypeError, ValueError):
        raise
    except Exception as error:  # an integer of too many digits, a list of too many levels
        raise TypeError(f"{name} = {shown(value)}: must be {must}") from error
    try:
        raw = np.asarray(given)
    except Exception as error:  # conversion of an arbitrary object may raise anything
        raise TypeError(f"{name} = {shown(value)}: must be {must}") from error
    if raw.dtype.kind in "SU" or (raw.dtype.kind == "O" and any(isinstance(entry, str) for entry in raw.flat)):
        raise TypeError(f"{name} = {shown(value)}: must be {must}, not text; convert it to numbers first")
    if raw.dtype.kind not in "iuf":
        raise TypeError(f"{name} = {shown(value)}: must be {must}")
    with np.errstate(over="ignore", under="ignore", invalid="ignore"):
        array = raw.astype(np.float64)
        good = (array > low if open_low else array >= low) & (array <= high)  # NaN fails both
    if not allow_infinite:
        good &= np.isfinite(array)
    if not good.all():
        place = np.unravel_index(int(np.argmin(good)), good.shape)
        at = f"[{', '.join(map(str, place))}]" if place else ""
        raise ValueError(f"{name}{at} = {shown(array[place].item())}: must be {must}")
    return array


def normal(name: str, array: np.ndarray) -> np.ndarray:
    """Return an array, or raise an error that names the field if a number in it is subnormal: it has lost digits."""
    small = np.abs(array)
    bad = array[(small > 0.0) & (small < np.finfo(float).tiny)]
    if bad.size:
        raise ValueError(f"{name} = {bad[0]:.3g}: must be 0 or at least 2.3e-308 in size; smaller numbers lose digits")
    return array


def one_axis(name: str, value: Any, of: str, **limits: Any) -> np.ndarray:
    """Return a number or one axis of numbers as :func:`real_array` does, or raise an error that names the field."""
    array = real_array(name, value, **limits)
    if array.ndim > 1:
        raise ValueError(f"{name} has shape {array.shape}: must be a number or one axis of {of}")
    return array


def one_number(name: str, value: Any, **limits: Any) -> float:
    """Return a single number as a float, checked as :func:`real_array` does, or raise an error that names the field."""
    array = real_array(name, value, **limits)
    if array.ndim:
        raise ValueError(f"{name} has shape {array.shape}: must be one number")
    return float(array)


def count(name: str, value: Any, *, low: int = 1, high: int | None = None) -> int:
    """Return ``value`` as an int within ``[low, high]``, or raise an error that names the field."""
    must = f"an integer of at least {low}" if high is None else f"an integer from {low} to {high}"
    if isinstance(value, (bool, np.bool_)):
        raise TypeError(f"{name} = {shown(value)}: must be {must}")
    try:
        number = operator.index(value)
    except TypeError:
        kind = ValueError if isinstance(value, (float, np.floating)) else TypeError
        raise kind(f"{name} = {shown(value)}: must be {must}") from None
    if number < low or (high is not None and number > high):
        raise ValueError(f"{name} = {shown(number)}: must be {must}")
    return number


def instance(name: str, value: Any, kind: type) -> None:
    """Raise a ``TypeError`` that names the field unless ``value`` is of the class ``kind``."""
    if not isinstance(value, kind):
        article = "an" if kind.__name__[0] in "AEIOU" else "a"
        raise TypeError(f"{name} = {shown(value)}: must be {article} {kind.__name__}")


def flag(name: str, value: Any) -> bool:
    """Return a truth value as a bool, or raise an error that names the field."""
    if not isinstance(value, (bool, np.bool_)):
        raise TypeError(f"{name} = {shown(value)}: must be True or False")
    return bool(value)


def choice(name: str, value: Any, allowed: Collection[str]) -> str:
    """Return ``value``, which is one of some words, or raise an error that names the field and the words."""
    if isinstance(value, str) and value in allowed:
        return value
    words = " or ".join(map(repr, allowed)) if len(allowed) < 3 else f"one of {', '.join(allowed)}"
    raise (ValueError if isinstance(value, str) else TypeError)(f"{name} = {shown(value)}: must be {words}")


def listed(name: str, value: Any, of: str) -> list[Any]:
    """Return the entries of a sequence that is not text, or raise an error that names the field."""
    flat = getattr(value, "ndim", 1) == 1
    if isinstance(value, (str, bytes, Mapping)) or not isinstance(value, Iterable) or not flat:
        raise TypeError(f"{name} = {shown(value)}: must be a sequence of {of}")
    return list(value)


def names(name: str, value: Any, allowed: Collection[str]) -> tuple[str, ...]:
    """Return a sequence of words as a tuple, or raise an error that names the field and the words."""
    words = listed(name, value, f"names among {', '.join(allowed)}")
    for word in words:
        if not isinstance(word, str) or word not in allowed:
            kind = ValueError if isinstance(word, str) else TypeError
            raise kind(f"{name} = {shown(word)}: must be among {', '.join(allowed)}")
    return tuple(words)


def mapping(name: str, value: Any, entries: str) -> Mapping[Any, Any]:
    """Return a mapping, an empty one for None, or raise an error that names the field and its entries."""
    if value is not None and not isinstance(value, Mapping):
        raise TypeError(f"{name} = {shown(value)}: must be a mapping from {entries}")
    return {} if value is None else value


def equal(one: Any, other: Any) -> bool:
    """Tell whether two values are equal, arrays and what holds arrays by their elements; nan equals nan."""
    if isinstance(one, np.ndarray) or isinstance(other, np.ndarray):
        arrays = isinstance(one, np.ndarray) and isinstance(other, np.ndarray)
        return arrays and np.array_equal(one, other, equal_nan=one.dtype.kind in "fc" and other.dtype.kind in "fc")
    if isinstance(one, Mapping) and isinstance(other, Mapping):
        return one.keys() == other.keys() and all(equal(one[key], other[key]) for key in one)
    if isinstance(one, (list, tuple)):
        return type(one) is type(other) and len(one) == len(other) and all(map(equal, one, other))
    return bool(one == other) or (isinstance(one, float) and isinstance(other, float) and one != one and other != other)


class ByValue:
    """Base of dataclasses that are equal if all their public fields with ``compare`` are, arrays by their elements."""

    def __eq__(self, other: object) -> bool:
        if type(other) is not type(self):
            return NotImplemented
        fields = getattr(self, "__dataclass_fields__", {})
        names = [name for name, field in fields.items() if field.compare and not name.startswith("_")]
        return all(equal(getattr(self, name), getattr(other, name)) for name in names)

    __hash__ = None  # type: ignore[assignment]


def broadcastable(**arrays: Any) -> tuple[int, ...]:
    """Return the common shape of the named arrays, or raise an error that names those that do not fit."""
    return common_shape(tuple(arrays), tuple(arrays.values()))


def common_shape(names: Sequence[str], arrays: Sequence[Any]) -> tuple[int, ...]:
    """As `broadcastable`, for names of which two may be the same."""
    try:
        return np.broadcast_shapes(*map(np.shape, arrays))
    except (ValueError, RuntimeError):  # of more than 32 axes
        shapes = ", ".join(f"{name} {np.shape(a)}" for name, a in zip(names, arrays, strict=True) if np.ndim(a))
        raise ValueError(f"shapes do not broadcast together: {shapes}") from None
