"""A validated sweep: a quantity over axes, evaluated piece by piece and labelled."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from itertools import product
from typing import Any

import numpy as np
from numpy.typing import NDArray
from tqdm import tqdm

import cra_sym as cra
from cra_sym.arm.parameters import Arm
from cra_sym.checks import instance, real_array
from cra_sym.extras import require
from cra_sym.model.system import System
from cra_sym.si import dimensions, plain_numbers
from cra_sym.studies.fingerprint import fingerprint
from cra_sym.studies.quantities import Quantity, named_quantity

__all__ = ["Study", "Swept", "make_study"]

Index = NDArray[np.intp]
Noted = dict[str, tuple[Any, bool]]
"""Labels of the dimensions, and whether they are given or only counted."""
_BLOCK = 1 << 17  # systems evaluated together in memory
_KINDS = "biufc"  # truth values, integers, real and complex numbers


@dataclass(frozen=True)
class Swept:
    """A parameter or an option along some dimensions of the sweep.

    Attributes
    ----------
    dims : tuple of str
    values : ndarray or object
        An array of numbers, or a motion, force or excitation that is a batch along its one dimension.
    unit : str
    """

    dims: tuple[str, ...]
    values: Any
    unit: str

    def over(self, at: Mapping[str, Index]) -> Any:
        """Return the numbers at the mesh of some places of all dimensions, with an axis for each of these."""
        part = self.values[np.ix_(*(at[dimension] for dimension in self.dims))]
        part = part.transpose([self.dims.index(dimension) for dimension in at if dimension in self.dims])
        return part.reshape([at[dimension].size if dimension in self.dims else 1 for dimension in at])


@dataclass(frozen=True)
class Study:
    """A quantity over the product of dimensions.

    Attributes
    ----------
    system : System
        Parameters that are not swept.
    quantity : Quantity
    dims : mapping of str to ndarray
        Label of every place of each swept dimension.
    fields, numbers, objects : mapping of str to Swept
        Parameters of the system, options that are numbers, and options that are motions, forces or excitations.
    options : mapping
        Options of the quantity that are not swept.
    added : mapping of str to int
        Axes that the quantity adds, with their lengths.
    dtype : numpy.dtype
        Type of the values of the quantity.
    """

    system: System
    quantity: Quantity
    dims: Mapping[str, Any]
    fields: Mapping[str, Swept]
    numbers: Mapping[str, Swept]
    objects: Mapping[str, Swept]
    options: Mapping[str, Any]
    added: Mapping[str, int]
    dtype: np.dtype[Any]

    @property
    def shape(self) -> tuple[int, ...]:
        """Shape of the product of the dimensions."""
        return tuple(len(labels) for labels in self.dims.values())

    def block(self, *places: Index) -> NDArray[Any]:
        """Evaluate the product of some places of every dimension."""
        values = self._evaluated(dict(zip(self.dims, places, strict=True)))
        whole = (*(place.size for place in places), *self.added.values())
        if not np.can_cast(values.dtype, self.dtype):
            raise TypeError(
                f"quantity = {self.quantity.name}: it returns {values.dtype} here and {self.dtype} at the first point; "
                f"must be of one kind, as numpy.asarray(..., {values.dtype}) makes it"
            )
        return np.broadcast_to(values, whole).astype(self.dtype, copy=False)

    def _evaluated(self, at: Mapping[str, Index]) -> NDArray[Any]:
        """Evaluate the mesh of some places; motions, forces and excitations one after another."""
        along = [swept.dims[0] for swept in self.objects.values()]
        if not along:
            return self._called(at, {})
        shape = [at[dimension].size for dimension in along]
        parts = {}
        for corner in product(*map(range, shape)):
            chosen = dict(zip(along, corner, strict=True))
            here = {name: at[name][[chosen[name]]] if name in chosen else places for name, places in at.items()}
            objects = {name: s.values[int(here[s.dims[0]][0])] for name, s in self.objects.items()}
            parts[corner] = self._called(here, objects)
        first = parts[(0,) * len(shape)]
        if all(places.size == 1 for places in at.values()):
            self.check_point(first)
        kind = np.result_type(*(part.dtype for part in parts.values()))
        found = np.empty((*(places.size for places in at.values()), *first.shape[len(at) :]), kind)
        order = list(at)
        for corner, part in parts.items():
            place: list[Any] = [slice(None)] * len(at)
            for dimension, number in zip(along, corner, strict=True):
                place[order.index(dimension)] = slice(number, number + 1)
            found[tuple(place)] = part
        return found

    def _called(self, at: Mapping[str, Index], objects: Mapping[str, Any]) -> NDArray[Any]:
        fields = {name: swept.over(at) for name, swept in self.fields.items()}
        numbers = {name: swept.over(at) for name, swept in self.numbers.items()}
        system = self.system.replace(**fields) if fields else self.system
        return self._numbers(self.quantity.function(system, **self.options, **numbers, **objects))

    def _numbers(self, value: Any) -> NDArray[Any]:
        """Return the result of the quantity as an array, units converted to SI."""
        if isinstance(value, (list, tuple)):
            return np.asarray([self._numbers(entry) for entry in value])
        return np.asarray(plain_numbers(f"quantity = {self.quantity.name}", value))

    def check_point(self, corner: NDArray[Any]) -> None:
        """Raise an error unless the result for one entry per axis begins with the shape of the system."""
        number = len(self.dims)
        if corner.shape[:number] != (1,) * number:
            options = ", ".join(self.options)
            doubt = f"; an array among the options ({options}) may be paired with it" if options else ""
            raise ValueError(
                f"quantity = {self.quantity.name}: with one entry an axis it returns the shape {corner.shape}, which "
                f"must begin with {(1,) * number}, that of the system{doubt}"
            )

    def evaluate(self) -> NDArray[Any]:
        """Evaluate everything, in slabs along the first dimension."""
        if not self.dims:
            return self.block()
        first, *others = (np.arange(length) for length in self.shape)
        step = max(1, _BLOCK * first.size // int(np.prod(self.shape)))
        starts = range(0, first.size, step)
        progress = tqdm(starts, desc=self.quantity.name, disable=True if len(starts) == 1 else None)
        return np.concatenate([self.block(first[start : start + step], *others) for start in progress])

    def lazy(self, chunks: int) -> Any:
        """Return the values as a Dask array whose pieces are at most ``chunks`` long in each swept dimension."""
        array = require("dask.array", "scale")
        added = dict(enumerate(self.added.values(), start=len(self.dims)))
        pieces: list[Any] = []
        for index, length in enumerate(self.shape):
            pieces += [array.from_array(np.arange(length), chunks=chunks), (index,)]
        indices = (*range(len(self.dims)), *added)
        meta = np.empty((0,) * len(indices), self.dtype)
        return array.blockwise(
            self.block, indices, *pieces, new_axes=added, dtype=self.dtype, meta=meta, align_arrays=False
        )

    def coordinates(self) -> dict[str, Any]:
        """Return the coordinates: labels of the dimensions, parameters along them, and the modes."""
        found: dict[str, Any] = {name: (name, labels, {}) for name, labels in self.dims.items()}
        for name, swept in {**self.fields, **self.numbers}.items():
            found[name] = (swept.dims, swept.values, {"units": swept.unit} if swept.unit else {})
        if "mode" in self.added:
            found["mode"] = ("mode", np.arange(1, self.added["mode"] + 1), {"units": "1"})
        if "unknown" in self.added:
            given = self.options.get("unknown") or self.system.numerics("stiffnesses")
            found["unknown"] = ("unknown", list(dict.fromkeys([*given, *(self.options.get("prior") or {})])), {})
        return found

    def attributes(self) -> dict[str, Any]:
        """Return the attributes of the dataset: the parameters that are not swept."""
        prefix = "arm" if isinstance(self.system, Arm) else "system"
        return {**{f"{prefix}_{name}": value for name, value in self._held().items()}, "cra_sym": cra.__version__}

    def variable_attributes(self) -> dict[str, str]:
        """Return unit and meaning of the quantity."""
        return {"units": self.quantity.unit, "long_name": self.quantity.meaning}

    def dataset(self, values: Any) -> Any:
        """Label values, lazy or not, of shape ``(*shape, *added)``."""
        xarray = require("xarray", "scale")
        variable = ((*self.dims, *self.added), values, self.variable_attributes())
        return xarray.Dataset({self.quantity.name: variable}, self.coordinates(), self.attributes())

    def described(self) -> dict[str, str]:
        """Return everything that determines the values, as texts by name."""
        swept = {**self.fields, **self.numbers, **self.objects}
        model = {} if isinstance(self.system, Arm) else {"model": str(dict(self.system.model.pieces))}
        return {
            "version of cra_sym": cra.__version__,
            "quantity": f"{self.quantity.name}: {fingerprint(self.quantity.function)}",
            **{name: fingerprint(value) for name, value in {**self._held(), **self.options, **model}.items()},
            **{name: f"{s.dims} {fingerprint(s.values)}" for name, s in swept.items()},
            **{f"dimension {name}": fingerprint(np.asarray(labels).tolist()) for name, labels in self.dims.items()},
        }

    def _held(self) -> dict[str, float]:
        held = {**self.system.values, "zeta": self.system.zeta}
        return {name: float(value) for name, value in held.items() if name not in self.fields}


def make_study(system: System, quantity: str | Callable[..., Any], parameters: Mapping[str, Any]) -> Study:
    """Check a sweep and learn the axes that its quantity adds, by evaluating one point.

    Raises
    ------
    TypeError, ValueError
        Naming the parameter that is unknown, missing, out of range, or not an axis.
    """
    instance("arm" if isinstance(system, Arm) else "system", system, System)
    if system.shape:
        raise ValueError(f"system: its values have shape {system.shape}; must be numbers, arrays are axes of the sweep")
    chosen = named_quantity(quantity, system)
    known = (*system.values, "zeta")
    chosen.check_options([name for name in parameters if name not in known], known)
    units = {**system.model.units, "zeta": "1", **chosen.axes}
    noted: dict[str, tuple[Any, bool]] = {}
    fields: dict[str, Swept] = {}
    numbers: dict[str, Swept] = {}
    objects: dict[str, Swept] = {}
    options = {}
    for name, value in parameters.items():
        if name in known or name in chosen.axes:
            axis = _axis(system, name, value, units.get(name, ""), noted, name in known)
            if axis is not None:
                (fields if name in known else numbers)[name] = axis
            elif name in known:
                system = system.replace(**{name: value})
            else:
                options[name] = value
        elif _is_batch(value):
            objects[name] = _batch(name, value, noted)
        else:
            options[name] = value
    first = {name: np.ravel(s.values)[0] for name, s in fields.items()}
    system = system.replace(**first) if first else system
    labels = {dimension: label for dimension, (label, _) in noted.items()}
    for dimension in labels:
        if dimension in known and (dimension not in fields or fields[dimension].dims != (dimension,)):
            raise ValueError(
                f"dimension {dimension!r}: is the name of a parameter that is not swept along it; rename it"
            )
    study = Study(system, chosen, labels, fields, numbers, objects, options, {}, np.dtype(float))
    corner = study._evaluated({name: np.zeros(1, dtype=np.intp) for name in labels})
    return _with_axes(study, corner)


def _with_axes(study: Study, corner: NDArray[Any]) -> Study:
    """Return the study with the axes that its quantity adds to one point."""
    quantity, number = study.quantity, len(study.dims)
    if corner.dtype.kind not in _KINDS:
        raise TypeError(f"quantity = {quantity.name}: it returns {corner.dtype}; must be numbers or truth values")
    study.check_point(corner)
    lengths = corner.shape[number:]
    names = quantity.dims or tuple(f"component_{index}" for index in range(len(lengths)))
    if len(names) != len(lengths):
        raise ValueError(
            f"quantity = {quantity.name}: it adds {len(lengths)} axes, must be {len(names)} ({', '.join(names)})"
        )
    for dimension in study.dims:
        if dimension in (*names[: len(lengths)], quantity.name):
            raise ValueError(f"dimension {dimension!r}: is a name of the quantity {quantity.name}; rename it")
    values = {name: getattr(study, name) for name in study.__dataclass_fields__}
    return Study(**(values | {"added": dict(zip(names, lengths, strict=True)), "dtype": corner.dtype}))


def _axis(system: System, name: str, value: Any, unit: str, noted: Noted, is_field: bool) -> Swept | None:
    """Return a parameter as an axis, or as part of the labelled one it shares; None if it is a number."""
    dims = dimensions(value)
    numbers = plain_numbers(name, value, unit or None) if dims is not None else value
    if is_field:
        changed = system.replace(**{name: numbers})
        array = np.asarray(changed.zeta if name == "zeta" else changed.values[name])
    else:
        array = real_array(name, numbers, unit=unit or None)
    if not array.ndim:
        return None
    if dims is None:
        if array.ndim != 1 or array.size == 0:
            raise ValueError(f"{name}: an array of shape {array.shape}; must be one-dimensional, not empty")
        dims = (name,)
    if array.size == 0:
        raise ValueError(f"{name}: an array of shape {array.shape}; must not be empty")
    for dimension, length in zip(dims, array.shape, strict=True):
        if not isinstance(dimension, str):
            raise TypeError(f"{name}: dimension {dimension!r}: must have a text for a name")
        given = getattr(value, "coords", {})
        own = array if dims == (name,) else np.arange(length)
        label = np.asarray(given[dimension]) if dimension in given and dims != (name,) else own
        _put(noted, dimension, label, name, stated=dimension in given or dims == (name,))
    return Swept(dims, array, unit)


def _put(noted: Noted, dimension: str, label: Any, name: str, stated: bool) -> None:
    """Record the labels of a dimension, or raise an error if they differ from those given for it."""
    known, before = noted.setdefault(dimension, (label, stated))
    if len(known) != len(label):
        raise ValueError(f"{name}: dimension {dimension!r} has {len(label)} entries, another {len(known)}")
    if stated and not before:
        noted[dimension] = label, True
    elif stated and not np.array_equal(known, label):
        raise ValueError(f"{name}: the coordinate of dimension {dimension!r} is not that of another parameter")


def _is_batch(value: Any) -> bool:
    shape = getattr(value, "shape", ())
    return (
        isinstance(shape, tuple) and bool(shape) and not isinstance(value, np.ndarray) and not hasattr(value, "dtype")
    )


def _batch(name: str, value: Any, noted: Noted) -> Swept:
    """Return a motion, force or excitation that is a batch as an axis."""
    if len(value.shape) != 1 or not hasattr(type(value), "__getitem__"):
        raise ValueError(f"{name} is a batch of shape {value.shape}: must be a single one, or a batch along one axis")
    _put(noted, name, np.arange(value.shape[0]), name, stated=True)
    return Swept((name,), value, "")
