"""Dynamic stiffness from a state form and parameter values, with batches and infinite stiffnesses."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from cra_sym.kernels import Kernel, kernel
from cra_sym.model.breaks import Breaks, breaks, varying
from cra_sym.model.derivative_rows import DerivativeRows
from cra_sym.model.spanned_stiffness import Stiffness
from cra_sym.model.spans import Spans
from cra_sym.model.values import infinite_patterns
from cra_sym.solvers.stress_mesh import VariationBounds

if TYPE_CHECKING:
    from sympy import Expr, Symbol

    from cra_sym.mechanics import StateForm

__all__ = ["HALVINGS", "SpatialProblem", "spatial_problem"]

Array = NDArray[np.float64]
HALVINGS = 6
"""Number of halvings of the two parts of a problem that varies along x, which gives 128 steps."""
_NEAR_END = 1e-7  # share of the length from an end at which a coefficient is compared with that at the end


@dataclass(frozen=True)
class PointTerms:
    """Compiled terms at interior places.

    Attributes
    ----------
    matrices : Kernel
        Of (parameter, parameters): for each place what the forces (P, r) grow by, times (q, w), and its derivative.
    held : tuple of tuple of int
        Displacements of a section that vanish at each place.
    """

    matrices: Kernel
    held: tuple[tuple[int, ...], ...]

    def at(self, z: Array, columns: Array) -> list[tuple[Array, Array]]:
        """Return matrix and derivative of each place, (len(z), n + m, n + m)."""
        found = self.matrices(z, *columns)
        return [(found[k], found[k + 1]) for k in range(0, len(found), 2)]


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
        For each stiffness of an end, by its index: its factor in the boundary matrix, needed where it is infinite.
    rows : tuple of DerivativeRows
        For each displacement, the rows c with ``D^order q = c (q, w, P)``.
    breaks : Breaks or None
        Where the system is not smooth along x, unless it is uniform.
    points : PointTerms or None
        What acts at interior places.
    exponents : (Kernel or None, int)
        Bounds of the variation of the system along x, see `cra_sym.model.breaks.varying`.
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
    rows: tuple[DerivativeRows, ...]
    breaks: Breaks | None = None
    points: PointTerms | None = None
    exponents: tuple[Kernel | None, int] = (None, 0)

    def variation(self, columns: Array) -> VariationBounds | None:
        """Return bounds of the variation along x for some parameter sets, None if the coefficients are polynomials."""
        found, decaying = self.exponents
        return None if found is None else VariationBounds(found.function, columns, decaying)

    @property
    def supported(self) -> bool:
        """Whether there are supports at interior places."""
        return self.points is not None and any(self.points.held)

    def singular(self, columns: Array) -> NDArray[np.bool_]:
        """Return for which parameter sets a coefficient becomes infinite at an end, because a stiffness vanishes there.

        Parameters
        ----------
        columns : ndarray, shape (parameters, sets)
        """
        return np.asarray(self._singular_ends(columns).any(axis=1))

    def _singular_ends(self, columns: Array) -> NDArray[np.bool_]:
        """Return the same for the left and the right end, shape (sets, 2)."""
        sets = columns.shape[1]
        if self.uniform or not self.displacements:
            return np.zeros((sets, 2), dtype=bool)
        finite = np.where(np.isinf(columns), 0.0, columns)
        length, left = (np.broadcast_to(value, sets)[:, None] for value in self.geometry.function(*finite))
        x = np.concatenate([left, left + _NEAR_END * length, left + (1.0 - _NEAR_END) * length, left + length], axis=1)
        with np.errstate(all="ignore"):
            found = np.abs(np.asarray(self.system(x, 1.0, *finite[..., None])[0]))
        size = np.broadcast_to(found, (*x.shape, *found.shape[-2:])).max(axis=(-2, -1))
        return np.asarray(~(size[:, [0, 3]] * _NEAR_END < size[:, [1, 2]]))

    def shortened(self, column: Array, share: float) -> Stiffness:
        """Return the problem of one set on a domain that ends a share of its length before a singular end.

        Breakpoints that come closer geometrically resolve what varies there.

        Parameters
        ----------
        column : ndarray, shape (parameters, 1)
        share : float
        """
        ((_, infinite),) = infinite_patterns(column)
        ends = self._singular_ends(column)[0]
        some = column.copy()
        some[list(infinite)] = 0.0
        length, left = (np.broadcast_to(value, 1) for value in self.geometry(*some))
        edges = np.stack([left, left + length], axis=1)
        nodes: tuple[int, ...] = ()
        if self.breaks is not None:
            ((_, edges, nodes),) = self.breaks.edges(some, left, length)
        reach = length * share
        steps = 2.0 ** np.arange(np.ceil(np.log2(share)), 0.0)
        if ends[0]:
            width = edges[0, 1] - edges[0, 0]
            edges = np.concatenate([left[:, None] + [[reach[0], *(width * steps)]], edges[:, 1:]], axis=1)
            nodes = tuple(node + len(steps) for node in nodes)
        if ends[1]:
            width = edges[0, -1] - edges[0, -2]
            last = edges[:, -1:] - [[*(width * steps[::-1]), reach[0]]]
            edges = np.concatenate([edges[:, :-1], last], axis=1)
        return self._problem(some, infinite, edges[:, 0], edges[:, -1] - edges[:, 0], edges, HALVINGS, nodes)

    def derivative_row(self, place: int, order: int, z: np.ndarray, x: np.ndarray, columns: np.ndarray) -> np.ndarray:
        """Return the row c with ``D^order q[place] = c (q, w, P)``, shape (rows, modes, stations, 2 n + m).

        Where coefficients are constant along x there is one station.
        """
        x = x[..., :1] if self.uniform else x
        known = self.rows[place].to(order)
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
        return np.asarray(row[..., :size])

    def problems(self, columns: Array, halvings: int = HALVINGS) -> Iterator[tuple[np.ndarray, np.ndarray, Stiffness]]:
        """Yield (rows, left ends, problem) for each pattern of infinite stiffness.

        Parameters
        ----------
        columns : ndarray, shape (parameters, sets)
        halvings : int
            Least number of times the two parts of a problem that varies along x are halved.

        Raises
        ------
        ValueError
            If a parameter is infinite that is not a stiffness of an end, or a coefficient is not finite.
        """
        for rows, infinite in infinite_patterns(columns):
            some = columns[:, rows].copy()
            some[list(infinite)] = 0.0
            length, left = (np.broadcast_to(value, some.shape[1:]) for value in self.geometry(*some))
            if self.breaks is None:
                yield rows, left, self._problem(some, infinite, left, length, None, halvings)
                continue
            for members, edges, nodes in self.breaks.edges(some, left, length):
                part = self._problem(some[:, members], infinite, left[members], length[members], edges, halvings, nodes)
                yield rows[members], left[members], part

    def _problem(
        self,
        columns: np.ndarray,
        infinite: tuple[int, ...],
        left: Array,
        length: Array,
        edges: Array | None,
        halvings: int,
        nodes: tuple[int, ...] = (),
    ) -> Stiffness:
        n, m = self.displacements, self.coordinates
        free = np.zeros((2 * n + m, 0)) if self.free is None else self.free(*columns)
        for position in infinite:
            free = _without(free, self.rigid_directions(position, columns))
        spans, halvings = (None, halvings) if edges is None else Spans.of(edges, halvings)

        def section(z: np.ndarray, rows: np.ndarray, share: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
            if spans is None:
                return self._coefficients(0.0, z, columns[:, rows])
            x, slope = spans.places(share, rows)
            matrix, rate = self._coefficients(x, z, columns[:, rows])
            stretch = (slope / length[rows, None])[..., None, None]
            return matrix * stretch, rate * stretch

        def ends(z: np.ndarray, rows: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
            return _finite(self.boundary(z, *columns[:, rows]), "an end term")

        def at_nodes(z: np.ndarray, rows: np.ndarray) -> list[tuple[float, np.ndarray, np.ndarray]]:
            assert self.points is not None and spans is not None
            terms = zip(self.points.at(z, columns[:, rows]), nodes, strict=True)
            return [(float(spans.knots[node]), *pair) for pair, node in terms]

        if self.supported:
            raise ValueError("essential: with supports at interior places there are natural frequencies and modes only")
        jumps = None if self.points is None else at_nodes
        return Stiffness(section, ends, length, n, m, free, self.uniform, halvings, spans, jumps)

    def _coefficients(self, x: Array | float, z: np.ndarray, columns: Array) -> tuple[np.ndarray, np.ndarray]:
        found: tuple[np.ndarray, np.ndarray] = self.system(x, z[:, None], *columns[..., None])
        if np.isfinite(found[0]).all():
            return found
        zero = [f"{name} = 0" for name, column in zip(self.names, columns, strict=True) if (column == 0).any()]
        raise ValueError(
            f"{' and '.join(zero) or 'values'}: a coefficient of the equations becomes infinite; a stiffness of the "
            "interior must be greater than 0 and finite"
        )

    def rigid_directions(self, position: int, columns: np.ndarray) -> np.ndarray:
        """Return the end displacements that an infinite stiffness suppresses, shape (rows, directions, size)."""
        if position not in self.end_stiffness:
            able = ", ".join(self.names[k] for k in self.end_stiffness) or "none here"
            raise ValueError(f"{self.names[position]} = inf: only the stiffness of an end may be infinite ({able})")
        return np.asarray(self.end_stiffness[position](*columns))


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
    places = [place for place, _, _ in form.points]
    found = None if form.uniform else breaks(list(form.system), form.x, symbols, places)
    matrices = [part for _, matrix, _ in form.points for part in (matrix, matrix.diff(form.parameter))]
    held = tuple(held for _, _, held in form.points)
    points = PointTerms(kernel(tuple(matrices), arguments, backend="numpy"), held) if places else None
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
        tuple(DerivativeRows(form, place, arguments) for place in range(len(form.displacements))),
        found,
        points,
        (None, 0) if form.uniform else varying(list(form.system.subs(form.parameter, 1)), form.x, symbols),
    )


def _end_stiffness(form: StateForm, symbols: tuple[Symbol, ...]) -> dict[int, Kernel]:
    """Return the factor in the boundary matrix of each parameter that may be infinite."""
    inside = form.system.free_symbols | form.length.free_symbols | form.free.free_symbols
    slopes = {}
    for position, symbol in enumerate(symbols):
        slope = form.boundary.diff(symbol)
        if symbol not in inside and not slope.is_zero_matrix and not slope.has(symbol, form.parameter):
            slopes[position] = kernel(slope.subs({form.parameter: 0}), symbols, backend="numpy")
    return slopes


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
    return np.asarray(free @ np.swapaxes(adjoint[..., int(rank.max()) :, :], -1, -2))
