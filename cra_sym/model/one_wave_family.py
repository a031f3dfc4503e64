"""Frequency parameters and modes of all lines of one structure: derived functions, by NumPy or as machine code."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cra_sym.cached import cached_property
from cra_sym.kernels import Kernel, compiled, derived_kernel, template
from cra_sym.kernels.parts import flattened, in_parts, wants_compiler
from cra_sym.model.one_wave_templates import MODAL, SPECTRUM, modal_marks, spectrum_marks
from cra_sym.solvers.one_wave import OneWaveCharacteristic, Structure, parameters, wave_number
from cra_sym.solvers.one_wave_shapes import ShapeTable, fill, integral, rate_rows, shape
from cra_sym.solvers.spectrum import spectrum

__all__ = ["DimensionlessModes", "Family", "family"]

Array = NDArray[np.float64]
_CHARACTERISTIC = ("coefficients", "power_series", "chain", "derivatives")
_SHAPES = ("tip_rows", "tip_near", "amplitudes_far")
_ROWS = (
    "invariant_near", "prepared", "end_state", "generalised_mass", "rows", "rates", "rigid_body", "leading",
)  # fmt: skip
_OF_ORDER = {
    "one_wave": ("basis", "basis_near", "products"),
    "one_wave_shapes": ("polynomials", "tip_far", "shape_far", "integral_far"),
    "one_wave_rows": ("invariant_far",),
}
_OF_STRUCTURE = {"one_wave": _CHARACTERISTIC, "one_wave_shapes": _SHAPES, "one_wave_rows": _ROWS}


@cache
def family(structure: Structure) -> Family:
    """Return the family of lines with a structure; see `cra_sym.mechanics.one_wave`."""
    return Family(structure)


class Family:
    """All lines with one structure.

    Parameters
    ----------
    structure : tuple of two tuples of n texts
        The kinds of the channels of the left and of the right end.
    """

    def __init__(self, structure: Structure) -> None:
        self.structure, self.layout = structure, ShapeTable(structure)
        self.functions: dict[str, Kernel] = {
            name: derived_kernel(f"cra_sym.mechanics.{module}:{name}", given)
            for table, given in ((_OF_STRUCTURE, structure), (_OF_ORDER, self.layout.n))
            for module, names in table.items()
            for name in names
        }

    def __reduce__(self) -> tuple[Any, ...]:
        return family, (self.structure,)

    def characteristic(self, *groups: Array, lanes: int | None = None) -> OneWaveCharacteristic:
        """Return the functions for groups of shape (lanes,), as `cra_sym.solvers.spectrum` takes them."""
        lanes = groups[0].size if lanes is None else lanes
        return OneWaveCharacteristic(self.layout, self.functions, groups, lanes)

    def frequency_parameters(
        self, *groups: Array, modes: int, compile: bool | None = None, threads: int | None = None
    ) -> Array:
        """Return lambda of the first modes for validated arrays of one shape; the mode axis is last.

        The NumPy and the compiled version do the same steps. By default (``compile`` is None) the compiled one is used
        where it saves more time than loading it takes; ``threads`` defaults to what processors and workload allow. A
        structure
        without groups gives one set of modes, of shape (modes,).
        """
        shape = groups[0].shape if groups else ()
        lanes = flattened(*groups)
        result = np.empty((lanes[0].size if groups else 1, modes))
        compile = bool(groups) and (wants_compiler(result.size, self.spectrum_parts) if compile is None else compile)
        fill_one = self.fill_compiled if compile else self._fill

        def fill_part(part: slice) -> None:
            fill_one(result[part], *(x[part] for x in lanes))

        in_parts(fill_part, len(result), modes, threads=threads, compiled=compile)
        return result.reshape(*shape, modes)

    def _fill(self, result: Array, *groups: Array) -> None:
        """Fill in a part of the result, vectorised by NumPy."""
        zeros = spectrum(self.characteristic(*groups, lanes=len(result)), result.shape[1], power=2 * self.layout.n)
        result[...] = wave_number(zeros, self.layout.n)

    def fill_compiled(self, result: Array, *groups: Array) -> int:
        """Fill in a part of the result; return the number of evaluations of the determinant."""
        evaluations = np.zeros(1, dtype=np.int64)
        if not self.compiled_spectrum.frequency_parameters(result, evaluations, *groups):
            raise ArithmeticError("a zero was not reached")
        return int(evaluations[0])

    def modes(
        self, *groups: Array, lam: Array, compile: bool | None = None, threads: int | None = None
    ) -> DimensionlessModes:
        """Return the modes, given all their first frequency parameters.

        Parameters
        ----------
        groups : ndarray, shape (...)
        lam : ndarray, shape (..., modes)
        compile, threads
            As in `frequency_parameters`.
        """
        lanes = flattened(*groups)
        compile = bool(groups) and (wants_compiler(lam.size, self.modal_parts) if compile is None else compile)
        return DimensionlessModes(self, lam, lanes, compile, threads)

    def spectrum_parts(self) -> tuple[str, dict[str, Kernel]]:
        """Return the template of the compiled spectrum and the functions it takes."""
        return self._spectrum_text, {name: self.functions[name] for name in SPECTRUM}

    def modal_parts(self) -> tuple[str, dict[str, Kernel]]:
        """Return the template of the compiled modes and the functions it takes."""
        names = (*MODAL, "tip_rows") if self.layout.n == 2 else MODAL
        return self._modal_text, {name: self.functions[name] for name in names}

    @cached_property
    def _spectrum_text(self) -> str:
        return template("cra_sym.solvers.pairs_lanes", {}) + template(
            "cra_sym.solvers.spectrum_lanes", spectrum_marks(self.layout, self.functions)
        )

    @cached_property
    def _modal_text(self) -> str:
        return template("cra_sym.solvers.pairs_lanes", {}) + template(
            "cra_sym.solvers.modal_lanes", modal_marks(self.layout, self.functions)
        )

    @cached_property
    def compiled_spectrum(self) -> Any:
        """The template of the spectrum as machine code."""
        return compiled(*self.spectrum_parts())

    @cached_property
    def compiled_modes(self) -> Any:
        """The template of the modes as machine code."""
        return compiled(*self.modal_parts())


@dataclass(frozen=True, eq=False)
class DimensionlessModes:
    """Modes of unit generalised mass; each quantity has one entry per mode and is computed on first use.

    Attributes
    ----------
    family : Family
    lam : ndarray, shape (..., modes)
        Frequency parameter.
    groups : tuple of ndarray, shape (lanes,)
        Stiffnesses and inertias, as the layout of the family has them.
    compile, threads
        As in `Family.frequency_parameters`, decided.
    """

    family: Family
    lam: Array
    groups: tuple[Array, ...]
    compile: bool
    threads: int | None

    def quantities(self, rows: slice, units: Sequence[float | Array] | None = None) -> Array:
        """Return some rows of the family's table, each times its unit: a number, or an array of the batch's shape.

        See `cra_sym.solvers.one_wave_shapes.ShapeTable` for the rows.
        """
        shape = rows.stop - rows.start, *self.lam.shape
        size = self.family.layout.size
        if not shape[0]:
            return np.empty(shape)
        if not self.compile:
            first = 0 if rows.stop <= size else size
            table = self._table if first == 0 else self._rates
            found = table[rows.start - first : rows.stop - first].reshape(shape)
            return found if units is None else found * _columns(units, self.lam.shape[:-1])
        lam = np.ascontiguousarray(self.lam).reshape(-1, shape[-1])
        by_lane = np.ones((1, shape[0])) if units is None else _columns(units, self.lam.shape[:-1])
        by_lane = np.ascontiguousarray(by_lane.reshape(shape[0], -1).T)
        table = np.empty((shape[0], *lam.shape))
        fill_compiled = self.family.compiled_modes.fill

        def fill_part(part: slice) -> None:
            fill_compiled(table, rows.start, by_lane, lam, *self.groups, part.start, part.stop)

        in_parts(fill_part, *lam.shape, threads=self.threads, compiled=True)
        return table.reshape(shape)

    @cached_property
    def _table(self) -> Array:
        """All quantities by NumPy, block by block."""
        modes, lam, layout = self.lam.shape[-1], self.lam.reshape(-1), self.family.layout
        table = np.empty((layout.size, self.lam.size))

        def fill_part(part: slice) -> None:
            roots = slice(part.start * modes, part.stop * modes)
            groups = [x[part] for x in self.groups]
            by_lane = parameters(layout, groups).reshape(len(layout.parameters), part.stop - part.start)
            given = np.repeat(by_lane, modes, axis=1)
            inertias = [np.repeat(groups[i], modes) for i in layout.inertias]
            fill(table[:, roots], lam[roots], modes, layout, self.family.functions, given, inertias)

        in_parts(fill_part, self.lam.size // modes, modes, threads=None, compiled=False)
        return table

    @cached_property
    def _rates(self) -> Array:
        inertias = [np.repeat(self.groups[i], self.lam.shape[-1]) for i in self.family.layout.inertias]
        return rate_rows(self._table, self.lam.reshape(-1), self.family.layout, self.family.functions, inertias)

    @cached_property
    def state(self) -> Array:
        """The rows that describe the shapes."""
        return self.quantities(self.family.layout.state)

    def lanes(self, part: slice) -> DimensionlessModes:
        """Return some of the lanes, the batch axes taken as one."""
        modes = self.lam.shape[-1]
        lam, groups = self.lam.reshape(-1, modes)[part], tuple(x[part] for x in self.groups)
        some = DimensionlessModes(self.family, lam, groups, self.compile, self.threads)
        if not self.compile:  # the table exists or will be needed
            size = self.family.layout.size
            some.__dict__["_table"] = self._table.reshape(size, -1, modes)[:, part].reshape(size, -1)
        return some

    def shape(self, xi: Array, derivative: int = 0) -> Array:
        """Return a derivative of every shape by xi at points that broadcast on a new last axis."""
        return shape(self.lam, self.state, xi, derivative, self.family.layout.n, self.family.functions)

    def integral(self) -> Array:
        """Return the integral of every shape from 0 to 1."""
        return integral(self.lam, self.state, self.family.layout.n, self.family.functions)


def _columns(units: Sequence[float | Array], shape: tuple[int, ...]) -> Array:
    """Return the units of rows as an array (rows, ..., 1), or (rows, 1) if they are the same for the whole batch."""
    if all(np.ndim(unit) == 0 for unit in units):
        return np.array(units).reshape(-1, *(1 for _ in shape), 1)
    return np.array([np.broadcast_to(unit, shape) for unit in units])[..., None]
