"""A checked sweep: what is computed over which axes, evaluated piece by piece and labelled."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from tqdm import tqdm

import cra_sym as cra
from cra_sym.arm.parameters import Arm
from cra_sym.checks import instance, real_array
from cra_sym.extras import require
from cra_sym.studies.quantities import ARM_FIELDS, Quantity, named_quantity
from cra_sym.symbols import nomenclature

__all__ = ["Study", "make_study"]

_BLOCK = 1 << 17  # arms evaluated at once in memory


@dataclass(frozen=True)
class Study:
    """A quantity over the product of axes.

    Attributes
    ----------
    arm : Arm
        Parameters that are not swept.
    quantity : Quantity
    axes : mapping of str to ndarray
        One-dimensional values of each swept parameter.
    options : mapping
        Options of the quantity that are not swept.
    added : mapping of str to int
        Axes that the quantity adds, with their lengths.
    """

    arm: Arm
    quantity: Quantity
    axes: Mapping[str, np.ndarray]
    options: Mapping[str, Any]
    added: Mapping[str, int]

    @property
    def shape(self) -> tuple[int, ...]:
        """Shape of the product of the axes."""
        return tuple(values.size for values in self.axes.values())

    def block(self, *pieces: np.ndarray) -> np.ndarray:
        """Evaluate the product of pieces of the axes."""
        values = _evaluated(self.arm, self.quantity, dict(zip(self.axes, pieces, strict=True)), self.options)
        return np.broadcast_to(values, (*(piece.size for piece in pieces), *self.added.values()))

    def evaluate(self) -> np.ndarray:
        """Evaluate everything, in slabs along the first axis."""
        if not self.axes:
            return self.block()
        first, *others = self.axes.values()
        step = max(1, _BLOCK * first.size // int(np.prod(self.shape)))
        starts = range(0, first.size, step)
        progress = tqdm(starts, desc=self.quantity.name, disable=True if len(starts) == 1 else None)
        return np.concatenate([self.block(first[start : start + step], *others) for start in progress])

    def lazy(self, chunks: int) -> Any:
        """Return the values as a Dask array whose pieces are at most ``chunks`` long in each swept axis."""
        array = require("dask.array", "scale")
        added = dict(enumerate(self.added.values(), start=len(self.axes)))
        pieces: list[Any] = []
        for index, axis in enumerate(self.axes.values()):
            pieces += [array.from_array(axis, chunks=chunks), (index,)]
        indices = (*range(len(self.axes)), *added)
        meta = np.empty((0,) * len(indices))
        return array.blockwise(self.block, indices, *pieces, new_axes=added, dtype=meta.dtype, meta=meta)

    def dataset(self, values: Any) -> Any:
        """Label values, lazy or not, of shape ``(*shape, *added)``."""
        xarray = require("xarray", "scale")
        units = {**{row.name: row.unit for row in nomenclature()}, **self.quantity.axes}
        coordinates = {name: (name, axis, {"units": units.get(name, "1")}) for name, axis in self.axes.items()}
        if "mode" in self.added:
            coordinates["mode"] = ("mode", np.arange(1, self.added["mode"] + 1), {"units": "1"})
        attributes = {"units": self.quantity.unit, "long_name": self.quantity.meaning}
        variable = ((*self.axes, *self.added), values, attributes)
        held = {f"arm_{name}": value for name, value in self._held().items()}
        return xarray.Dataset({self.quantity.name: variable}, coordinates, {**held, "cra_sym": cra.__version__})

    def digest(self) -> str:
        """Return a hash of everything that decides the values."""
        tokenize = require("dask.base", "scale").tokenize
        quantity = (self.quantity.name, self.quantity.function)
        return tokenize(quantity, self._held(), dict(self.axes), dict(self.options), cra.__version__)

    def _held(self) -> dict[str, float]:
        return {name: getattr(self.arm, name) for name in ARM_FIELDS if name not in self.axes}


def make_study(arm: Arm, quantity: str | Callable[..., Any], parameters: Mapping[str, Any]) -> Study:
    """Check a sweep and learn the axes that its quantity adds, by evaluating one point.

    Raises
    ------
    TypeError, ValueError
        Naming the parameter that is unknown, missing, out of range, or no axis.
    """
    instance("arm", arm, Arm)
    if arm.shape:
        raise ValueError(f"arm: its fields have shape {arm.shape}; must be numbers, since arrays are axes of the sweep")
    chosen = named_quantity(quantity)
    fields = {name: value for name, value in parameters.items() if name in ARM_FIELDS}
    options = {name: value for name, value in parameters.items() if name not in fields}
    chosen.check_options(list(options))
    swept = {name: getattr(arm.replace(**{name: value}), name) for name, value in fields.items()}  # checked alone
    swept |= {name: real_array(name, value) for name, value in options.items() if name in chosen.axes}
    axes = {name: np.asarray(swept[name]) for name in parameters if np.ndim(swept.get(name, 0.0))}
    for name, values in axes.items():
        if values.ndim != 1 or values.size == 0:
            raise ValueError(f"{name}: an array of shape {values.shape}; must be one-dimensional, not empty")
    arm = arm.replace(**{name: np.ravel(swept[name])[0] for name in fields})
    options = {name: value for name, value in options.items() if name not in axes}
    corner = _evaluated(arm, chosen, {name: axis[:1] for name, axis in axes.items()}, options)
    lengths = corner.shape[len(axes) :]
    names = chosen.dims or tuple(f"component_{index}" for index in range(len(lengths)))
    return Study(arm, chosen, axes, options, dict(zip(names, lengths, strict=True)))


def _evaluated(arm: Arm, quantity: Quantity, axes: dict[str, np.ndarray], options: Mapping[str, Any]) -> np.ndarray:
    mesh = dict(zip(axes, np.ix_(*axes.values()), strict=True)) if axes else {}
    fields = {name: values for name, values in mesh.items() if name in ARM_FIELDS}
    others = {name: values for name, values in mesh.items() if name not in fields}
    return np.asarray(quantity.function(arm.replace(**fields), **options, **others))
