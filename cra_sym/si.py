"""Conversion of quantities with units, exact numbers and labelled arrays to plain numbers in SI.

A unit is converted or refused, never dropped. Libraries of units are recognised by their documented attributes;
none of them is imported.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from decimal import Decimal
from numbers import Real
from typing import Any, SupportsFloat, TypeAlias

import numpy as np
from numpy.typing import ArrayLike

from cra_sym.symbols import Dimension, unit_dimension

__all__ = ["Numbers", "check_rows", "dimensions", "paired", "plain_numbers"]

Numbers: TypeAlias = ArrayLike | SupportsFloat | Sequence[SupportsFloat]
"""Numbers as arguments: also those of SymPy, fractions and decimal, quantities with units, labelled arrays."""
_EXACT = {int, float}
_BASE = {"[length]": "meter", "[mass]": "kilogram", "[time]": "second"}
_OTHERS = {"[current]": "ampere", "[temperature]": "kelvin", "[substance]": "mole", "[luminosity]": "candela"}
_RATE = Dimension(s=-1)  # cycles or radians: a factor of 2 pi apart


def plain_numbers(name: str, value: Any, unit: str | None = None) -> Any:
    """Return a value that ``numpy.asarray`` accepts as numbers: quantities converted to SI, exact numbers as floats.

    Parameters
    ----------
    name : str
        Name of the argument, used in errors.
    value : array_like
        Numbers, also of SymPy, ``fractions`` and ``decimal``; quantities of Pint or Astropy; xarray and pandas objects.
    unit : str, optional
        Unit that a quantity must be convertible to, such as ``"N m/rad"`` or ``"N or N m"``; without it every unit is
        converted to SI.

    Raises
    ------
    TypeError
        If booleans stand among numbers, or an element is masked.
    ValueError
        If a unit is not convertible to ``unit``, or not to SI.
    """
    kind = type(value)
    if kind in _EXACT or isinstance(value, np.generic):
        return _timed(value, unit)
    if kind is np.ndarray and value.dtype.kind != "O":
        return _timed(value, unit)
    if hasattr(kind, "quantity") and getattr(value, "unit", None) is not None:
        return plain_numbers(name, _from_column(name, value), unit)
    if isinstance(value, np.ma.MaskedArray) or hasattr(kind, "unmasked"):
        if np.any(value.mask):
            raise TypeError(f"{name}: element {_first_masked(value)} is masked; must be real numbers")
        return plain_numbers(name, value.unmasked if hasattr(kind, "unmasked") else np.asarray(value), unit)
    if hasattr(kind, "dimensionality") and hasattr(kind, "to_base_units"):
        return plain_numbers(name, _from_pint(name, value, unit))
    if hasattr(kind, "decompose") and hasattr(kind, "unit"):
        return plain_numbers(name, _from_astropy(name, value, unit))
    if _is_labelled(value):
        _check_stated(name, value.attrs.get("units"), unit)
        return plain_numbers(name, value.data, unit)
    if hasattr(kind, "units") or hasattr(kind, "in_units"):
        raise TypeError(f"{name} = {_text(value)}: its unit cannot be converted; must be plain numbers in SI")
    if hasattr(kind, "nominal_value") and hasattr(kind, "std_dev"):
        raise TypeError(f"{name} = {_text(value)}: has an uncertainty; must be real numbers, as its nominal value is")
    if kind in (list, tuple) or kind is np.ndarray:
        return _each(name, value, unit)
    if unit == "s" and hasattr(kind, "total_seconds"):
        return value.total_seconds()
    if hasattr(kind, "__array__") or hasattr(kind, "__array_interface__"):  # of pandas, SymPy and others
        try:
            array = np.asarray(value)
        except Exception as error:  # conversion of an arbitrary object may raise anything
            raise TypeError(f"{name} = {_text(value)}: must be real numbers") from error
        _check_stated(name, _stated(value), unit)
        if array.ndim:
            return plain_numbers(name, array, unit)
    if kind is bytearray:
        raise TypeError(f"{name} = {_text(value)}: must be real numbers, not bytes")
    return value if isinstance(value, bool) else _real_number(name, value)


def paired(values: Mapping[str, Any], units: Mapping[str, str] | None = None) -> dict[str, Any]:
    """Return arguments that make a batch with labelled arrays paired by dimension, not by position.

    The axes of the batch are the dimensions in the order of their first appearance.

    Raises
    ------
    ValueError
        If a dimension has two lengths or two coordinates, arrays without names are combined with labelled ones, the
        indexes of two pandas series differ, or a unit is not that of ``units``.
    """
    check_rows(values)
    labelled = {name: value for name, value in values.items() if _is_labelled(value) and value.dims}
    if not labelled:
        return dict(values)
    order = tuple(dict.fromkeys(dimension for value in labelled.values() for dimension in value.dims))
    for dimension in order:
        _check_dimension(dimension, {name: value for name, value in labelled.items() if dimension in value.dims})
    found = {}
    for name, value in values.items():
        if name not in labelled:
            if np.ndim(value):
                other = next(iter(labelled))
                raise ValueError(
                    f"{name} has axes without names, and {other} has the dimensions {labelled[other].dims}: "
                    "must have names too"
                )
            found[name] = value
            continue
        numbers = np.asarray(plain_numbers(name, value, (units or {}).get(name)))
        numbers = numbers.transpose([value.dims.index(dimension) for dimension in order if dimension in value.dims])
        sizes = dict(zip(value.dims, value.shape, strict=True))
        found[name] = numbers.reshape([sizes.get(dimension, 1) for dimension in order])
    return found


def dimensions(value: Any) -> tuple[str, ...] | None:
    """Return the names of the dimensions of a labelled array, None of anything else."""
    return tuple(value.dims) if _is_labelled(value) else None


def _is_labelled(value: Any) -> bool:
    return all(hasattr(type(value), attribute) for attribute in ("dims", "attrs", "data"))


def check_rows(tables: Mapping[str, Any]) -> None:
    """Raise an error for pandas series and tables with different indexes, which would be paired by position."""
    tables = {name: value for name, value in tables.items() if hasattr(type(value), "iloc")}
    rows = {name: table.axes[0] for name, table in tables.items()}
    first = next(iter(rows), "")
    for name, index in rows.items():
        if not index.equals(rows[first]):
            raise ValueError(f"{name}: its index is not that of {first}; align them, or give plain arrays")


def _check_dimension(dimension: Any, values: Mapping[str, Any]) -> None:
    (first, one), *others = values.items()
    for name, other in others:
        sizes = [value.shape[value.dims.index(dimension)] for value in (one, other)]
        if sizes[0] != sizes[1]:
            raise ValueError(f"dimension {dimension!r}: {first} has {sizes[0]} entries, {name} has {sizes[1]}")
        labels = [getattr(value, "coords", {}) for value in (one, other)]
        if all(dimension in known for known in labels):
            first_label, other_label = (np.asarray(known[dimension]) for known in labels)
            if not np.array_equal(first_label, other_label):
                raise ValueError(f"dimension {dimension!r}: its coordinate in {first} is not that in {name}")


def _real_number(name: str, value: Any) -> Any:
    """Return a real number of any kind as a float, everything else as it is."""
    exact = isinstance(value, (Real, Decimal)) and not isinstance(value, (bool, np.generic))
    symbolic = getattr(value, "is_extended_real", False) is True and getattr(value, "is_number", False) is True
    if not exact and not symbolic:
        return value
    try:
        number = float(value)
        if np.isinf(number) and abs(value) != np.inf:
            raise OverflowError
    except (ArithmeticError, ValueError):  # too large, or a nan that signals
        raise ValueError(f"{name} = {_text(value)}: must be a real number in the range of floating point") from None
    return number


def _timed(value: Any, unit: str | None) -> Any:
    """Return NumPy time differences in seconds where the unit is a time."""
    if unit == "s" and value.__class__ not in _EXACT and value.dtype.kind == "m":
        return value / np.timedelta64(1, "s")
    return value


def _each(name: str, value: Any, unit: str | None) -> Any:
    kinds = set(map(type, value if isinstance(value, (list, tuple)) else value.ravel()))
    if kinds <= _EXACT:
        return value if isinstance(value, (list, tuple)) else value.astype(float)
    if kinds & {bool, np.bool_}:
        raise TypeError(f"{name} = {_text(value)}: booleans among them; must be real numbers")
    if np.ma.core.MaskedConstant in kinds:
        raise TypeError(f"{name}: an element is masked; must be real numbers")
    if isinstance(value, np.ndarray):
        flat = [plain_numbers(name, entry, unit) for entry in value.ravel()]
        shapes = set(map(np.shape, flat))
        if len(shapes) != 1:
            raise TypeError(f"{name} = {_text(value)}: its elements have different shapes; must be real numbers")
        return np.array(flat).reshape(value.shape + shapes.pop())
    return [plain_numbers(name, entry, unit) for entry in value]


def _first_masked(value: Any) -> Any:
    place = tuple(int(i) for i in np.argwhere(np.broadcast_to(value.mask, value.shape))[0])
    return place[0] if len(place) == 1 else place


def _from_pint(name: str, value: Any, unit: str | None) -> Any:
    powers = dict(value.dimensionality)
    bases = _BASE | _OTHERS
    if not set(powers) <= set(bases):
        raise ValueError(f"{name} = {_text(value)}: its unit is not one of SI; must be in {unit or 'SI units'}")
    turning = any(str(unit) == "radian" for unit, _ in value.to_base_units().unit_items())
    found = Dimension(*(powers.get(dimension, 0) for dimension in _BASE))
    _check(name, value, unit, found, bool(set(powers) & set(_OTHERS)), turning)
    return value.to(" * ".join(f"{bases[dimension]} ** {power}" for dimension, power in powers.items())).magnitude


def _from_astropy(name: str, value: Any, unit: str | None) -> Any:
    try:
        basic = value.decompose()
    except ValueError as error:  # a unit that is only a text
        raise ValueError(f"{name} = {_text(value)}: its unit is unknown; must be in {unit or 'SI units'}") from error
    powers = {str(base.name): power for base, power in zip(basic.unit.bases, basic.unit.powers, strict=True)}
    turning = bool(powers.pop("rad", 0))
    found = Dimension(powers.pop("m", 0), powers.pop("kg", 0), powers.pop("s", 0))
    if not set(powers) <= {"A", "K", "mol", "cd"}:
        raise ValueError(f"{name} = {_text(value)}: its unit is not one of SI; must be in {unit or 'SI units'}")
    _check(name, value, unit, found, bool(powers), turning)
    return basic.value


def _from_column(name: str, value: Any) -> Any:
    """Return a column of a table of Astropy as a quantity, after a check of its mask."""
    mask = np.asarray(getattr(value, "mask", False))
    if mask.any():
        raise TypeError(f"{name}: element {int(np.argmax(mask))} is masked; must be real numbers")
    try:
        return value.quantity
    except TypeError as error:  # of texts
        raise TypeError(f"{name} = {_text(value)}: must be real numbers") from error


def _stated(value: Any) -> Any:
    """Return the unit that an array in a file, or of pandas, states, None if there is none."""
    get = getattr(getattr(value, "attrs", None), "get", None)
    stated = getattr(value, "units", None) if get is None else get("units")
    if isinstance(stated, bytes):
        return stated.decode(errors="replace")
    return stated if isinstance(stated, str) else None


def _check_stated(name: str, stated: Any, unit: str | None) -> None:
    """Raise an error for a ``units`` attribute that is not the coherent SI unit."""
    if stated is None:
        return
    text = re.sub(r"([A-Za-z])\^?(-?\d)", r"\1^\2", str(stated).strip().replace("**", "^").replace("*", " "))
    if text in ("", "dimensionless"):
        text = "1"
    try:
        found = unit_dimension(text)
    except ValueError:
        raise ValueError(
            f"{name} has units {stated!r}: must be in {unit or 'base units of SI, such as N/m'}; convert it first"
        ) from None
    _check(name, stated, unit, found, False, "rad" in text)


def _check(name: str, value: Any, unit: str | None, found: Dimension, more: bool, turning: bool) -> None:
    if unit is None:
        return
    wanted = [unit_dimension(one) for one in unit.split(" or ")]
    rate = wanted == [_RATE]
    if more or found not in wanted or (rate and unit in ("Hz", "rad/s") and turning != ("rad" in unit)):
        cure = "; a frequency in Hz times 2 pi is one in rad/s" if rate and found == _RATE else ""
        raise ValueError(f"{name} = {_text(value)}: must be in {unit}{cure}")


def _text(value: Any) -> str:
    text = " ".join(str(value).split())
    return text if len(text) <= 80 else text[:77] + "..."
