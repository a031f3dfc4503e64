"""From a state form and parameter values to the dynamic stiffness the solvers take: infinite stiffness, batches."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from cra_sym.kernels import Kernel, kernel
from cra_sym.model.values import infinite_patterns
from cra_sym.solvers.stiffness import DynamicStiffness, Evaluation

if TYPE_CHECKING:
    from sympy import Expr, Symbol

    from cra_sym.mechanics import StateForm

__all__ = ["SpatialProblem", "check_range", "shares", "spatial_problem"]

Array = NDArray[np.float64]
_MOST_DERIVATIVES = 20


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
    """Compiled coefficients of a state form; arguments are (x, parameter, *parameters of the model) where they apply.

    Attributes
    ----------
    names : tuple of str
        All parameters of the model.
    displacements, coordinates : int
        n and m of the state form.
    uniform : bool
        Whether the system is constant along x.
    system, boundary : Kernel
        A matrix and its derivative by the parameter z or s.
    geometry : Kernel
        Length and coordinate of the left end.
    free : Kernel or None
        The motions the essential conditions allow.
    end_stiffness : dict of int to Kernel
        What each stiffness of an end, by its position, multiplies in the boundary matrix: it may be infinite.
    rows : tuple of tuple of Kernel
        For each displacement, the rows c with ``D^order q = c (q, w, P)``, order 0 and up.
    """

    names: tuple[str, ...]
    displacements: int
    coordinates: int
    uniform: bool
    system: Kernel
    boundary: Kernel
    geometry: Kernel
    free: Kernel | None
    end_stiffness: dict[int, Kernel]
    rows: tuple[tuple[Kernel, ...], ...]

    def derivative_row(self, place: int, order: int, z: np.ndarray, x: np.ndarray, columns: np.ndarray) -> np.ndarray:
        """Return the row c with ``D^order q[place] = c (q, w, P)``, shape (rows, modes, stations, 2 n + m)."""
        known = self.rows[place]
        size = 2 * self.displacements + self.coordinates
        arguments = z[:, :, None], *columns[:, :, None, None]
        row = known[min(order, len(known) - 1)](x, *arguments)[..., 0, :]
        if order >= len(known):
            if not self.uniform:
                raise ValueError(
                    f"derivative = {order} must be at most {len(known) - 1} where coefficients vary along x"
                )
            matrix = self.system(x, *arguments)[0]
            for _ in range(order - len(known) + 1):
                row = (row[..., None, :] @ matrix)[..., 0, :]
        return row[..., :size]

    def problems(self, columns: Array) -> Iterator[tuple[np.ndarray, np.ndarray, DynamicStiffness]]:
        """Yield (rows, left ends, problem) for each pattern of infinite stiffness.

        Parameters
        ----------
        columns : ndarray, shape (parameters, sets)

        Raises
        ------
        ValueError
            If a parameter is infinite that is not a stiffness of an end, or a coefficient is not finite.
        """
        for rows, infinite in infinite_patterns(columns):
            some = columns[:, rows].copy()
            some[list(infinite)] = 0.0
            yield rows, *self._problem(some, infinite)

    def _problem(self, columns: np.ndarray, infinite: tuple[int, ...]) -> tuple[np.ndarray, DynamicStiffness]:
        length, left = (np.broadcast_to(value, columns.shape[1:]) for value in self.geometry(*columns))
        n, m = self.displacements, self.coordinates
        free = np.zeros((2 * n + m, 0)) if self.free is None else self.free(*columns)
        for position in infinite:
            free = _without(free, self._rigid_directions(position, columns))

        def section(z: np.ndarray, rows: np.ndarray, share: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
            x = left[rows, None] + share * length[rows, None] if not self.uniform else 0.0
            return _finite(self.system(x, z[:, None], *columns[:, rows, None]), "a coefficient of the equations")

        def ends(z: np.ndarray, rows: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
            return _finite(self.boundary(z, *columns[:, rows]), "an end term")

        return left, _Checked(section, ends, length, n, m, free, self.uniform)

    def _rigid_directions(self, position: int, columns: np.ndarray) -> np.ndarray:
        """Return the end displacements that an infinite stiffness holds still, shape (rows, directions, size)."""
        if position not in self.end_stiffness:
            able = ", ".join(self.names[k] for k in self.end_stiffness) or "none here"
            raise ValueError(f"{self.names[position]} = inf: only the stiffness of an end may be infinite ({able})")
        return self.end_stiffness[position](*columns)


def spatial_problem(form: StateForm, symbols: tuple[Symbol, ...], left: Expr) -> SpatialProblem:
    """Return the compiled coefficients of a state form.

    Parameters
    ----------
    form : StateForm
    symbols : tuple of Symbol
        All parameters of the model.
    left : Expr
        Coordinate of the left end.
    """
    arguments = (form.parameter, *symbols)
    system, boundary = (
        kernel((matrix, matrix.diff(form.parameter)), names, backend="numpy")
        for matrix, names in ((form.system, (form.x, *arguments)), (form.boundary, arguments))
    )
    return SpatialProblem(
        tuple(symbol.name for symbol in symbols),
        len(form.displacements),
        len(form.coordinates),
        form.uniform,
        system,
        boundary,
        kernel((form.length, left), symbols, backend="numpy"),
        kernel(form.free, symbols, backend="numpy") if form.free.cols else None,
        _end_stiffness(form, symbols),
        tuple(_derivative_rows(form, place, arguments) for place in range(len(form.displacements))),
    )


def _end_stiffness(form: StateForm, symbols: tuple[Symbol, ...]) -> dict[int, Kernel]:
    """Return what each parameter that may be infinite multiplies in the boundary matrix."""
    inside = form.system.free_symbols | form.length.free_symbols | form.free.free_symbols
    slopes = {}
    for position, symbol in enumerate(symbols):
        slope = form.boundary.diff(symbol)
        if symbol not in inside and not slope.is_zero_matrix and not slope.has(symbol, form.parameter):
            slopes[position] = kernel(slope.subs({form.parameter: 0}), symbols, backend="numpy")
    return slopes


def _derivative_rows(form: StateForm, place: int, arguments: Sequence[Symbol]) -> tuple[Kernel, ...]:
    from sympy import zeros

    row = zeros(1, form.system.rows)
    row[place] = 1
    kernels = []
    for _ in range(1 if form.uniform else 2 * len(form.displacements) + 3):
        kernels.append(kernel(row, (form.x, *arguments), backend="numpy"))
        row = row.diff(form.x) + row * form.system
    return tuple(kernels)


def shares(x: np.ndarray, left: np.ndarray, length: np.ndarray, name: str = "x") -> np.ndarray:
    """Return places as shares of the length, shape (rows, stations)."""
    share = (x - left[:, None]) / length[:, None]
    if (share < -1e-12).any() or (share > 1.0 + 1e-12).any():
        raise ValueError(f"{name} = {x}: must be in the domain, {left.max():g} to {(left + length).min():g}")
    return np.clip(share, 0.0, 1.0)


def _finite(matrices: tuple[np.ndarray, np.ndarray], what: str) -> tuple[np.ndarray, np.ndarray]:
    if not np.isfinite(matrices[0]).all():
        raise ValueError(f"values: they make {what} infinite; only the stiffness of an end may be inf")
    return matrices


def _without(free: np.ndarray, held: np.ndarray) -> np.ndarray:
    """Return, per row, an orthonormal basis of the free motions that move none of the held directions."""
    constraint = held @ free
    _, size, adjoint = np.linalg.svd(constraint)
    rank = (size > 1e-12 * np.maximum(size.max(axis=-1, initial=0.0), 1e-300)[..., None]).sum(axis=-1)
    if rank.min() != rank.max():
        raise ValueError("values: an infinite stiffness must act alike in all parameter sets")
    return free @ np.swapaxes(adjoint[..., int(rank.max()) :, :], -1, -2)
