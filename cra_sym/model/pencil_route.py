"""From a Lagrangian with forces of any kind to its complex eigenvalues, for coefficients that vary along x too."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
from numpy.typing import NDArray

from cra_sym.kernels import Kernel, kernel
from cra_sym.model.stress_route import StressRoute, held_directions, springs_and_supports, springs_of
from cra_sym.model.values import infinite_patterns
from cra_sym.solvers.continuum import PointTerm
from cra_sym.solvers.pencil import GeneralContinuum

if TYPE_CHECKING:
    from sympy import Expr, Matrix

    from cra_sym.mechanics.jets import Jet
    from cra_sym.model.lagrangian import Model
    from cra_sym.model.projection import BilinearForm

__all__ = ["PencilRoute", "complex_modes", "inertia", "pencil_route"]

Array = NDArray[np.float64]
Index = NDArray[np.intp]
_CANCELLED = 8 * float(np.finfo(float).eps)  # what a difference of few stiffnesses is, over these, by rounding


@dataclass(frozen=True, eq=False)
class PencilRoute(StressRoute):
    """Coefficients of the energies and of all other forces, compiled.

    Attributes
    ----------
    ends : Kernel
        Of the parameters: stiffness, damping and mass of ends and lumped coordinates.
    inside : Kernel
        The same of interior places, one after the other.
    damped : bool
        Whether there are forces of first order in time.
    """

    ends: Kernel
    inside: Kernel
    damped: bool

    def problems(self, columns: Array) -> Iterator[tuple[Index, GeneralContinuum]]:
        """Yield sets that share breakpoints and infinite springs, with their problem."""
        for rows, infinite in infinite_patterns(columns):
            some = columns[:, rows].copy()
            some[list(infinite)] = 0.0
            length, left = (np.broadcast_to(v, len(rows)) for v in self.spatial.geometry(*some))
            for members, edges, nodes in self._edges(some, left, length):
                yield rows[members], self._problem(some[:, members], infinite, edges, nodes)

    def _problem(
        self, columns: Array, infinite: tuple[int, ...], edges: Array, nodes: tuple[int, ...]
    ) -> GeneralContinuum:
        sets = columns.shape[1]
        stiffness, damping, mass = _matrices(self.ends, columns, 3)
        held, springs, rest = self._end_springs(columns, infinite, stiffness)
        pull, constants = springs_of(0.5 * (damping + damping.swapaxes(-1, -2)), np.ones(sets))
        pull, constants = _first_of_equal_sets(pull, sets), np.maximum(_first_of_equal_sets(constants, sets), 0.0)
        points, forces = self._inside(columns, nodes)
        return GeneralContinuum(
            self.orders,
            self.spatial.coordinates,
            self._evaluated(columns),
            edges,
            held,
            springs,
            0.5 * (mass + mass.swapaxes(-1, -2)),
            points=points,
            variation=self.spatial.variation(columns),
            end_forces=np.stack([rest, damping - _sum(pull, constants)]),
            point_forces=forces,
            dampers=(pull, constants),
            damped=self.damped,
        )

    def _end_springs(self, columns: Array, infinite: tuple[int, ...], stiffness: Array) -> tuple[Array, Array, Array]:
        """Return directions and positive stiffnesses of springs at the ends, conditions included, and what remains."""
        spatial, sets = self.spatial, columns.shape[1]
        size = 2 * spatial.displacements + spatial.coordinates
        parts = [held_directions(spatial.free, columns, size)]
        for position in infinite:
            held = spatial.rigid_directions(position, columns)
            parts.append(springs_of(np.broadcast_to(held, (sets, size, size)), np.full(sets, np.inf)))
        rest, size_of = stiffness, np.abs(stiffness)
        for position, slope in spatial.end_stiffness.items():
            rate = np.broadcast_to(slope(*columns), (sets, size, size))
            if position in infinite or not (columns[position] > 0.0).any():
                continue
            if np.abs(rate - rate.swapaxes(-1, -2)).max() == 0.0:
                some, k = springs_of(rate, np.maximum(columns[position], 0.0))
                some, k = _first_of_equal_sets(some, sets), np.maximum(_first_of_equal_sets(k, sets), 0.0)
                parts.append((some, k))
                taken = _sum(some, k)
                rest, size_of = rest - taken, size_of + np.abs(taken)
        rest = np.where(np.abs(rest) <= _CANCELLED * size_of, 0.0, rest)  # no spring made of rounding errors
        some, k = springs_of(0.5 * (rest + rest.swapaxes(-1, -2)), np.ones(sets))
        # the difference of large stiffnesses leaves rounding errors
        some, k = _first_of_equal_sets(some, sets), np.maximum(_first_of_equal_sets(k, sets), 0.0)
        parts.append((some, k))
        rest = rest - _sum(some, k)
        directions = np.concatenate([_first_of_equal_sets(d, sets) for d, _ in parts], axis=1)
        return directions, np.concatenate([_first_of_equal_sets(k, sets) for _, k in parts], axis=1), rest

    def _inside(self, columns: Array, nodes: tuple[int, ...]) -> tuple[tuple[PointTerm, ...], tuple[Array, ...]]:
        points = self.spatial.points
        if points is None:
            return (), ()
        matrices = _matrices(self.inside, columns, 3 * len(points.held))
        terms, forces = [], []
        for number, (node, held) in enumerate(zip(nodes, points.held, strict=True)):
            stiffness, damping, mass = matrices[3 * number : 3 * number + 3]
            some, k = springs_and_supports(0.5 * (stiffness + stiffness.swapaxes(-1, -2)), held)
            k = np.maximum(k, 0.0)
            finite = np.isfinite(k)
            rest = stiffness - _sum(np.where(finite[..., None], some, 0.0), np.where(finite, k, 0.0))
            terms.append(PointTerm(node, some, k, 0.5 * (mass + mass.swapaxes(-1, -2))))
            forces.append(np.stack([rest, damping]))
        return tuple(terms), tuple(forces)


def _matrices(matrices: Kernel, columns: Array, number: int) -> list[Array]:
    sets = columns.shape[1]
    found = [np.asarray(matrix, dtype=float) for matrix in matrices(*columns)]
    assert len(found) == number
    return [np.broadcast_to(matrix, (sets, *matrix.shape[-2:])) for matrix in found]


def _first_of_equal_sets(values: Array, sets: int) -> Array:
    return np.broadcast_to(values, (sets, *values.shape[1:]))


def _sum(directions: Array, constants: Array) -> Array:
    """Return the matrix of springs on directions."""
    total: Array = (directions.swapaxes(-1, -2) * constants[:, None]) @ directions
    return total


def pencil_route(model: Model) -> PencilRoute | None:
    """Return the route of a model, or None if a field has no derivative by x or the inertia is not symmetric."""
    from sympy import Matrix, zeros

    from cra_sym.mechanics.state_form import end_displacements
    from cra_sym.mechanics.weak import weak_form
    from cra_sym.model.energies import apply_inverse, integrates_in_sequence
    from cra_sym.model.symmetry import vanishes

    weak = weak_form(model.linearised.variation)
    section, highest, lumped = weak.fields()
    orders = tuple(weak.variation.orders)
    if 0 in orders:
        return None
    x = weak.variation.space.x
    state, jets, fields = [*section, *lumped], [*highest, *section, *lumped], len(highest)

    def part(form: dict[Any, Any], rows: list[Jet], columns: list[Jet], power: int) -> Matrix:
        return Matrix(len(rows), len(columns), [form.get((p, q), {}).get(power, 0) for p in rows for q in columns])

    whole, drag = (part(weak.inside, jets, jets, power) for power in (0, 1))
    mass = part(weak.inside, [*state, *highest], [*state, *highest], 2)
    ends, places = end_displacements(weak), weak.points
    end = [part(weak.ends, ends, ends, power) for power in (0, 1, 2)]
    points = [part(point.form, state, state, power) for point in places for power in (0, 1, 2)]
    for matrix in (mass, end[2], *points[2::3]):
        if not all(vanishes(entry, x) for entry in matrix - matrix.T):
            return None
    even = (whole + whole.T) / 2
    leading, coupled = even[:fields, :fields], even[:fields, fields:]
    strain = apply_inverse(leading, coupled)
    if not integrates_in_sequence(strain, section, highest):
        strain = zeros(*coupled.shape)
    # twice the energy is (h + B s)' W (h + B s) and what remains
    spread = Matrix.hstack(Matrix.eye(fields), strain)
    rest = (whole - spread.T * leading * spread).applyfunc(lambda e: 0 if vanishes(e, x) else e)
    potential = zeros(len(state), len(state))
    for k in range(len(state)):
        potential[k, k], rest[fields + k, fields + k] = rest[fields + k, fields + k], 0
    named = {
        "W": leading, "B": strain, "R": potential, "M": mass, "N": rest, "C": drag
    }  # fmt: skip
    entries: dict[tuple[str, int, int], Expr] = {}
    for name, matrix in named.items():
        for i in range(matrix.rows):
            for j in range(matrix.cols):
                value = matrix[i, j]
                if (j >= i or name in "BNC") and value != 0 and not (name in "BR" and vanishes(value, x)):
                    entries[name, i, j] = value
    spatial = model.numerics("damped_spatial")
    return PencilRoute(
        spatial,
        orders,
        kernel(tuple(entries.values()), (x, *model.symbols), backend="numpy"),
        tuple(entries),
        spatial,
        kernel(tuple(end), model.symbols, backend="numpy"),
        kernel(tuple(points), model.symbols, backend="numpy"),
        1 in weak.powers,
    )


def complex_modes(model: Model) -> Literal["none", "always", "if coupled"]:
    """Return whether motions need complex modes: dampers couple the natural modes, or there are no natural modes.

    This holds for dampers of the highest derivatives (Kelvin-Voigt) too, which may or may not couple them.
    """
    from cra_sym.mechanics.weak import weak_form

    if model.numerics("conservative") or model.numerics("pencil") is None:
        return "none"
    try:
        _ = model.conservative
    except ValueError:
        return "always"
    weak = weak_form(model.linearised.variation)
    _, highest, _ = weak.fields()
    resisted = any(jet in highest for pair, powers in weak.inside.items() for jet in pair if 1 in powers)
    return "if coupled" if resisted else "always"


def inertia(model: Model) -> BilinearForm:
    """Return the mass of a model with forces of any kind."""
    from cra_sym.mechanics.weak import weak_form
    from cra_sym.model.forms import form_of

    weak = weak_form(model.linearised.variation)
    parts = ({pair: {2: e[2]} for pair, e in form.items() if 2 in e} for form in (weak.inside, weak.discrete))
    inside, ends = parts
    return form_of(weak, {"mass": (inside, ends)}, model.symbols)
