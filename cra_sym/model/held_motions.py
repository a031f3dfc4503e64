"""Constraints that depend on a parameter: their contribution to the derivative of a squared natural frequency.

With conditions ``C(p) u = 0`` on the displacements u of the ends and the lumped coordinates, and constraint forces
``C' l``, the derivative of omega^2 by p has the term ``2 l' (dC/dp) u`` besides those of stiffness and mass.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray
from sympy import Derivative, Expr, Matrix, S, Symbol, cancel, diag, eye, zeros

from cra_sym.kernels import Kernel, kernel
from cra_sym.model.values import flat_columns
from cra_sym.model.waves_form import squares

if TYPE_CHECKING:
    from cra_sym.mechanics import StateForm
    from cra_sym.model.lagrangian import Model
    from cra_sym.model.system import System

__all__ = ["HeldMotions", "held_motions", "moving_supports"]

Array = NDArray[np.float64]


@dataclass(frozen=True)
class HeldMotions:
    """Conditions on displacements of the left end, lumped coordinates and displacements of the right end.

    Attributes
    ----------
    rows : Kernel
        Of the parameters: the matrix C.
    rates : dict of str to Kernel
        Its derivative by each parameter that changes the direction of a row, at fixed displacements over the length.
    stiff : tuple of int
        For each row the index of the parameter whose infinite value imposes the condition; -1 if it always holds.
    """

    rows: Kernel
    rates: dict[str, Kernel]
    stiff: tuple[int, ...]

    def rate(self, system: System, name: str, modes: int) -> Array | float:
        """Return the contribution to the derivative of omega^2 by a parameter, shape (..., modes)."""
        if name not in self.rates:
            return 0.0
        columns = flat_columns(system.parameters, system.shape)
        finite, sets = np.where(np.isinf(columns), 0.0, columns), columns.shape[1]
        holds = np.array([np.ones(sets, bool) if at < 0 else np.isinf(columns[at]) for at in self.stiff]).T
        if not holds.any():
            return 0.0
        size = np.where(holds, 1.0, 0.0)[:, :, None]
        rows, rate = (_matrices(part, finite, len(self.stiff)) * size for part in (self.rows, self.rates[name]))
        moved, forces = _ends(system, modes)
        n, m = system.numerics("sizes")
        z = (system.natural_frequencies(modes) ** 2).reshape(sets, modes)
        matrix = system.numerics("spatial").boundary(z, *finite[:, :, None])[0]
        acting = forces + (matrix @ moved[..., None])[..., 0]
        ends = np.r_[0:n, n + m : 2 * n + m]
        held = -acting[..., ends] @ np.linalg.pinv(rows[..., ends])  # forces of the conditions, (sets, modes, rows)
        turned = (rate[:, None] @ moved[..., None])[..., 0]
        found = np.where(z > 0.0, 2.0 * (held * turned).sum(axis=-1), 0.0)  # a rigid-body motion has no strain
        return np.asarray(found.reshape(*system.shape, modes))


def _matrices(function: Kernel, columns: Array, rows: int) -> Array:
    """Return a matrix for every set of parameters, shape (sets, rows, columns)."""
    sets = columns.shape[1]
    found = np.array([np.broadcast_to(entry, sets) for entry in function.function(*columns)], dtype=np.float64)
    return found.T.reshape(sets, rows, -1)


def _ends(system: System, modes: int) -> tuple[Array, Array]:
    """Return displacements of ends and coordinates, and forces of the span on them, (sets, modes, 2 n + m) each."""
    found, (n, m) = system.modes(modes), system.numerics("sizes")
    moved = [found.displacement(0, i) for i in range(n)] + [found.coordinate(j) for j in range(m)]
    moved += [found.displacement(1, i) for i in range(n)]
    nothing = np.zeros_like(moved[0])
    forces = [*(-found.force(0, i) for i in range(n)), *[nothing] * m, *(found.force(1, i) for i in range(n))]
    return tuple(np.stack(part, axis=-1).reshape(-1, modes, 2 * n + m) for part in (moved, forces))  # type: ignore[return-value]


def held_motions(form: StateForm, symbols: Sequence[Symbol]) -> HeldMotions:
    """Return the conditions of a conservative problem whose direction depends on a parameter.

    Those on lumped coordinates alone are left out: their forces are not known from the ends.
    """
    n, m = len(form.displacements), len(form.coordinates)
    size = 2 * n + m
    always = form.free.T.nullspace() if form.free.cols else [eye(size)[:, at] for at in range(size)]
    found = [(-1, row.T) for row in always]
    inside = form.system.free_symbols | form.length.free_symbols | form.free.free_symbols
    for position, symbol in enumerate(symbols):
        slope = form.boundary.diff(symbol)
        if symbol not in inside and not slope.is_zero_matrix and not slope.has(symbol, form.parameter):
            found += [(position, Matrix([stretch])) for _, stretch in squares(slope)]
    orders = [_order(displacement) for displacement in form.displacements]
    scale = diag(*orders, *[0] * m, *orders)
    kept = [(position, row) for position, row in found if any(row[k] != 0 for k in (*range(n), *range(n + m, size)))]
    rates = {}
    for symbol in symbols:
        turn = [row.diff(symbol) - row * scale * form.length.diff(symbol) / form.length for _, row in kept]
        if any(_changes_direction(row, rate) for (_, row), rate in zip(kept, turn, strict=True)):
            rates[symbol.name] = kernel(tuple(Matrix.vstack(*turn)), tuple(symbols), backend="numpy")
    rows = Matrix.vstack(*(row for _, row in kept)) if kept else zeros(0, size)
    return HeldMotions(
        kernel(tuple(rows), tuple(symbols), backend="numpy"), rates, tuple(position for position, _ in kept)
    )


def _order(displacement: Expr) -> int:
    """Return the order in x of the derivative that a displacement of a section is."""
    return sum(int(count) for _, count in displacement.variable_count) if isinstance(displacement, Derivative) else 0


def _changes_direction(row: Matrix, rate: Matrix) -> bool:
    """Return whether the derivative of a row is not just a multiple of the row."""
    return any(cancel(row[i] * rate[j] - row[j] * rate[i]) != S.Zero for i, j in combinations(range(row.cols), 2))


def moving_supports(model: Model) -> dict[str, Kernel]:
    """Return, for each parameter that moves a support inside relative to the ends, the shares of the length there.

    Of both ends and of all interior places, then their rates by the parameter, then whether they are supports (1 or 0).
    """
    left, right = model.equations.domain
    points = model.state_form.points
    if not any(held for *_, held in points):
        return {}
    places = [left, right, *(place for place, _, _ in points)]
    held = [S.Zero, S.Zero, *(S.One if held else S.Zero for _, _, held in points)]
    shares = [(place - left) / (right - left) for place in places]
    found = {}
    for symbol in model.symbols:
        rates = [cancel(share.diff(symbol)) for share in shares]
        if any(rate != 0 and own for rate, own in zip(rates, held, strict=True)):
            found[symbol.name] = kernel((*shares, *rates, *held), model.symbols, backend="numpy")
    return found
