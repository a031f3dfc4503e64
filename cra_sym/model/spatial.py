"""From a state form and parameter values to the dynamic stiffness the solvers take: infinite stiffness, batches."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from sympy import Expr, Symbol, zeros

from cra_sym.kernels import kernel
from cra_sym.mechanics import StateForm
from cra_sym.model.values import Values
from cra_sym.solvers.stiffness import DynamicStiffness, Evaluation

__all__ = ["SpatialProblem", "check_range", "shares"]


class _Checked(DynamicStiffness):
    """The dynamic stiffness for parameters of any size, refused where doubles do not reach."""

    def evaluate(
        self, z: np.ndarray, rows: np.ndarray, *, keep_tree: bool = False, levels: np.ndarray | None = None
    ) -> Evaluation:
        try:
            with np.errstate(over="ignore", divide="ignore", invalid="ignore"):
                here = super().evaluate(z, rows, keep_tree=keep_tree, levels=levels)
        except np.linalg.LinAlgError:
            check_range(np.array(np.nan))
        if not np.iscomplexobj(here.matrix):  # a guess of a complex eigenvalue may be far off
            check_range(here.matrix, here.derivative)
        return here


def check_range(*numbers: np.ndarray) -> None:
    """Raise a ValueError unless all numbers are finite."""
    if not all(np.isfinite(array).all() for array in numbers):
        raise ValueError("values: they lead beyond the range of double precision")


@dataclass(frozen=True, eq=False)
class SpatialProblem:
    """Compiled coefficients of a state form.

    Parameters
    ----------
    form : StateForm
    symbols : tuple of Symbol
        All parameters of the model.
    left : Expr
        Coordinate of the left end.
    fields : tuple of Expr
        The unknown functions of x, in the order of the model.
    """

    form: StateForm
    symbols: tuple[Symbol, ...]
    left: Expr
    fields: tuple[Expr, ...] = ()

    @cached_property
    def _kernels(self):
        form, arguments = self.form, (self.form.parameter, *self.symbols)
        coefficients = [
            kernel((matrix, matrix.diff(form.parameter)), names, backend="numpy")
            for matrix, names in ((form.system, (form.x, *arguments)), (form.boundary, arguments))
        ]
        geometry = kernel((form.length, self.left), self.symbols, backend="numpy")
        free = kernel(form.free, self.symbols, backend="numpy") if form.free.cols else None
        return *coefficients, geometry, free

    @cached_property
    def _end_stiffness(self):
        """Coefficient of each parameter in the boundary matrix, and whether it may be infinite."""
        form, at_rest = self.form, {self.form.parameter: 0}
        inside = form.system.free_symbols | form.length.free_symbols | form.free.free_symbols
        slopes = {}
        for symbol in self.symbols:
            slope = form.boundary.diff(symbol)
            if symbol not in inside and not slope.is_zero_matrix and not slope.has(symbol, form.parameter):
                slopes[symbol] = slope.subs(at_rest)
        return slopes

    def derivative_row(self, place: int, order: int, z: np.ndarray, x: np.ndarray, columns: np.ndarray) -> np.ndarray:
        """Return the row c with ``D^order q[place] = c (q, w, P)``, shape (rows, modes, stations, 2 n + m)."""
        form = self.form
        size = 2 * len(form.displacements) + len(form.coordinates)
        row = zeros(1, form.system.rows)
        row[place] = 1
        for _ in range(order):
            row = row.diff(form.x) + row * form.system
        compiled = kernel(row[:, :size], (form.x, form.parameter, *self.symbols), backend="numpy")
        return compiled(x, z[:, :, None], *columns[:, :, None, None])[..., 0, :]

    def problems(self, values: Values) -> Iterator[tuple[np.ndarray, np.ndarray, DynamicStiffness]]:
        """Yield (rows, left ends, problem) for each pattern of infinite stiffness.

        Raises
        ------
        ValueError
            If a parameter is infinite that is no stiffness of an end, or a coefficient is not finite.
        """
        for rows, infinite in values.patterns():
            columns = values.take(rows, infinite)
            yield rows, *self._problem(columns, infinite)

    def _problem(self, columns: np.ndarray, infinite: tuple[int, ...]) -> tuple[np.ndarray, DynamicStiffness]:
        system, boundary, geometry, motions = self._kernels
        length, left = (np.broadcast_to(value, columns.shape[1:]) for value in geometry(*columns))
        self._check_geometry(length)
        n, m = len(self.form.displacements), len(self.form.coordinates)
        free = np.zeros((2 * n + m, 0)) if motions is None else motions(*columns)
        for position in infinite:
            free = _without(free, self._rigid_directions(position, columns))

        def section(z: np.ndarray, rows: np.ndarray, share: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
            x = left[rows, None] + share * length[rows, None] if not self.form.uniform else 0.0
            return _finite(system(x, z[:, None], *columns[:, rows, None]), "a coefficient of the equations")

        def ends(z: np.ndarray, rows: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
            return _finite(boundary(z, *columns[:, rows]), "an end term")

        return left, _Checked(section, ends, length, n, m, free, self.form.uniform)

    def _check_geometry(self, length: np.ndarray) -> None:
        if not (length > 0.0).all() or not np.isfinite(length).all():
            raise ValueError(f"domain: the length {self.form.length} = {length[~(length > 0.0)][:1]} must be positive")

    def _rigid_directions(self, position: int, columns: np.ndarray) -> np.ndarray:
        """Return the end displacements that an infinite stiffness holds still, shape (rows, directions, size)."""
        symbol = self.symbols[position]
        if symbol not in self._end_stiffness:
            allowed = ", ".join(s.name for s in self._end_stiffness) or "none"
            raise ValueError(f"{symbol.name} = inf: allowed only for a stiffness of an end ({allowed})")
        return kernel(self._end_stiffness[symbol], self.symbols, backend="numpy")(*columns)


def shares(x: np.ndarray, left: np.ndarray, length: np.ndarray, name: str = "x") -> np.ndarray:
    """Return places as shares of the length, shape (rows, stations)."""
    share = (x - left[:, None]) / length[:, None]
    if (share < -1e-12).any() or (share > 1.0 + 1e-12).any():
        raise ValueError(f"{name} = {x}: allowed is the domain, {left.max():g} to {(left + length).min():g}")
    return np.clip(share, 0.0, 1.0)


def _finite(matrices: tuple[np.ndarray, np.ndarray], what: str) -> tuple[np.ndarray, np.ndarray]:
    if not np.isfinite(matrices[0]).all():
        raise ValueError(f"values: they make {what} infinite; allowed is inf for the stiffness of an end")
    return matrices


def _without(free: np.ndarray, held: np.ndarray) -> np.ndarray:
    """Return, per row, an orthonormal basis of the free motions that move none of the held directions."""
    constraint = held @ free
    _, size, adjoint = np.linalg.svd(constraint)
    rank = (size > 1e-12 * np.maximum(size.max(axis=-1, initial=0.0), 1e-300)[..., None]).sum(axis=-1)
    if rank.min() != rank.max():
        raise ValueError("values: an infinite stiffness must act alike in all parameter sets")
    return free @ np.swapaxes(adjoint[..., int(rank.max()) :, :], -1, -2)
