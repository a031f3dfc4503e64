"""Ritz's method in numbers: the second route to the frequencies, and starting guesses for damped models."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.linalg import block_diag, eig, eigh, solve_triangular, svd, svdvals
from sympy import Expr, Symbol

from cra_sym.cached import cached_property
from cra_sym.checks import ByValue, broadcastable, count
from cra_sym.kernels import Kernel, kernel
from cra_sym.mechanics import RitzMatrices
from cra_sym.model.spanned_stiffness import check_range
from cra_sym.model.values import checked_values, flat_columns, infinite_patterns

__all__ = ["Ritz"]

_ROUNDING = 16 * np.finfo(float).eps
"""Eigenvalues of a scaled stiffness that are rounding errors, relative to the largest.

Its entries are accurate to a few units in the last place, and a row has at most a dozen of them.
"""


@dataclass(frozen=True, eq=False)
class Ritz(ByValue):
    """Hermite elements of a model.

    Parameters
    ----------
    matrices : RitzMatrices
        Symbolic element matrices; ``stiffness``, ``damping`` and ``mass`` assemble them.
    symbols : tuple of Symbol
    """

    matrices: RitzMatrices
    symbols: tuple[Symbol, ...]

    def natural_frequencies(self, values: Mapping[Any, Any], modes: int = 3) -> np.ndarray:
        """Return upper bounds of the natural frequencies in Hz, rigid-body motions as zeros, shape (..., modes).

        Raises
        ------
        ValueError
            If there are fewer unknowns than modes, a motion has no kinetic energy, the Lagrangian has gyroscopic terms
            or the virtual work follower forces, or the structure has buckled.

        Notes
        -----
        Dampers are left out. What rounding does to the first frequencies grows like the condition of the stiffness
        scaled to ones on its diagonal, with the fourth power of the number of elements where the density has second
        derivatives: 3e-10 for 40 elements of a beam, 3e-8 for 160. A stiff end adds nothing to this error. A motion
        whose strain energy is below rounding counts as rigid.
        """
        modes = count("modes", modes, high=self.matrices.free)
        columns, shape = self._columns(values)
        omega = np.empty((columns.shape[1], modes))
        for row, stiffness, damping, mass in self._numbers(columns):
            if _asymmetric(damping) or _asymmetric(_unit_diagonal(stiffness)[0]):
                raise ValueError("natural frequencies need symmetric stiffness and damping; use eigenvalues")
            omega[row] = _angular_frequencies(stiffness, mass)[:modes]
        return (omega / (2.0 * np.pi)).reshape(*shape, modes)

    def eigenvalues(self, values: Mapping[Any, Any], modes: int = 3, *, oscillating: bool = True) -> np.ndarray:
        """Return complex eigenvalues s by ascending modulus, one of each conjugate pair, shape (..., modes).

        Parameters
        ----------
        values : mapping
        modes : int
        oscillating : bool
            Leave out real eigenvalues, of motions that decay without oscillating.

        Raises
        ------
        ValueError
            If there are fewer than ``modes`` of them.
        """
        modes = count("modes", modes)
        columns, shape = self._columns(values)
        roots = np.empty((columns.shape[1], modes), dtype=complex)
        for row, stiffness, damping, mass in self._numbers(columns):
            s = _quadratic_eigenvalues(mass, damping, stiffness)
            s = s[s.imag > 1e-7 * np.abs(s)] if oscillating else s[s.imag >= -1e-7 * np.abs(s)]
            if len(s) < modes:
                kind = "oscillating motions" if oscillating else "eigenvalues"
                raise ValueError(f"modes = {modes}: {self.matrices.elements} elements have {len(s)} {kind}")
            roots[row] = s[:modes]
        return roots.reshape(*shape, modes)

    @cached_property
    def _kernels(self) -> tuple[Kernel, Kernel, list[tuple[int, int, Expr]], list[tuple[tuple[int, int], ...]]]:
        m = self.matrices
        element = kernel(
            (m.element_stiffness, m.element_damping, m.element_mass),
            (m.element_length, m.element_start, *self.symbols),
            backend="numpy",
        )
        ends = tuple((tuple(e), tuple(e.values())) for e in (m.end_stiffness, m.end_damping, m.end_mass))
        factors = [(i, j, factor) for i, row in enumerate(m.restraint) for j, factor in row.items()]
        starts, lengths = zip(*m.spans, strict=True)
        parts = (starts, lengths, tuple(f for *_, f in factors), *(v for _, v in ends))
        return element, kernel(parts, self.symbols, backend="numpy"), factors, [places for places, _ in ends]

    def _columns(self, values: Mapping[Any, Any]) -> tuple[np.ndarray, tuple[int, ...]]:
        found = checked_values([symbol.name for symbol in self.symbols], values)
        shape = broadcastable(**found)
        return flat_columns(tuple(found.values()), shape), shape

    def _numbers(self, columns: np.ndarray) -> Iterator[tuple[int, np.ndarray, np.ndarray, np.ndarray]]:
        """Yield (row, K, C, M) on the free unknowns, one parameter set at a time."""
        for rows, infinite in infinite_patterns(columns):
            some = columns[:, rows].copy()
            some[list(infinite)] = 0.0
            for row, column in zip(rows, some.T, strict=True):
                with np.errstate(over="ignore", invalid="ignore"):
                    matrices, restraint = self._assembled(column)
                check_range(*matrices)
                for position in infinite:
                    restraint = self._held(position, column, restraint)
                stiffness, damping, mass = (restraint.T @ matrix @ restraint for matrix in matrices)
                yield int(row), stiffness, damping, mass

    def _assembled(self, column: np.ndarray) -> tuple[list[np.ndarray], np.ndarray]:
        element, rest, factors, places = self._kernels
        starts, lengths, weights, *ends = rest(*column)
        m = self.matrices
        each = m.elements // len(m.spans)
        if not min(lengths) > 0.0:
            raise ValueError("values: interior places must lie in the domain, in the order in which they are stated")
        step = np.repeat(np.array(lengths, dtype=float) / each, each)
        begin = np.repeat(np.array(starts, dtype=float), each) + step * np.tile(np.arange(each), len(m.spans))
        local = element(step, begin, *column)
        total = len(m.restraint)
        matrices = []
        for part, indices, entries in zip(local, places, ends, strict=True):
            matrix = np.zeros((total, total))
            for unknowns, block in zip(m.connectivity, part, strict=True):
                matrix[np.ix_(unknowns, unknowns)] += block
            for (i, j), entry in zip(indices, entries, strict=True):
                matrix[i, j] += entry
            matrices.append(matrix)
        restraint = np.zeros((total, m.free))
        for (i, j, _), weight in zip(factors, weights, strict=True):
            restraint[i, j] = weight
        return matrices, restraint

    def _held(self, position: int, column: np.ndarray, restraint: np.ndarray) -> np.ndarray:
        """Return the free motions that remain under an infinite stiffness of an end."""
        symbol, total = self.symbols[position], len(restraint)
        slopes = {place: entry.diff(symbol) for place, entry in self.matrices.end_stiffness.items()}
        inside = self.matrices.element_stiffness.free_symbols | self.matrices.element_mass.free_symbols
        if symbol in inside or not any(slopes.values()):
            raise ValueError(f"{symbol.name} = inf: only the stiffness of an end may be inf")
        held = np.zeros((total, total))
        for place, value in zip(slopes, kernel(tuple(slopes.values()), self.symbols)(*column), strict=True):
            held[place] = value
        _, size, adjoint = np.linalg.svd(held @ restraint)
        motions: np.ndarray = restraint @ adjoint[int((size > 1e-12 * size.max()).sum()) :].T
        return motions


def _asymmetric(matrix: np.ndarray) -> bool:
    return bool(np.abs(matrix - matrix.T).max() > 1e-12 * np.abs(matrix).max())


def _unit_diagonal(stiffness: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the stiffness scaled to a unit diagonal, and the scale factors of the unknowns in a column.

    The rounding error of a root depends on the condition of this matrix: on the mesh, hardly on the stiffest unknown.
    """
    size = np.abs(stiffness)
    own, most = np.diag(size), np.maximum(size.max(axis=0), size.max(axis=1))
    factors = 1.0 / np.sqrt(np.where(own > 0.0, own, np.where(most > 0.0, most, 1.0)))[:, None]
    return factors * stiffness * factors.T, factors


def _angular_frequencies(stiffness: np.ndarray, mass: np.ndarray) -> np.ndarray:
    """Return all roots omega of ``det(K - omega^2 M)``, both symmetric, ascending; those of rigid motions are zeros.

    With ``K = L L^T`` and ``M = F F^T`` they are one over the singular values of ``L^-1 F``. The largest of these, the
    lowest roots, are relatively exact; those of ``F^-1 L`` would be wrong by the rounding of the highest root. Rigid
    motions are held by springs, which makes K positive, and their momentum is taken out of F.
    """
    try:
        factor = np.linalg.cholesky(mass)
    except np.linalg.LinAlgError:
        raise ValueError("values: the kinetic energy is not positive for all motions of the elements") from None
    scaled, factors = _unit_diagonal(stiffness)
    momenta = factors * factor
    weights, motions = eigh(scaled)
    noise = _ROUNDING * np.abs(weights).max()
    unstable, rigid = int((weights < -noise).sum()), np.abs(weights) <= noise
    if unstable:
        raise ValueError(f"the structure has buckled: {unstable} unstable mode{'s' * (unstable > 1)} (omega^2 < 0)")
    moving = motions[:, rigid]
    along, _ = np.linalg.qr(momenta.T @ moving)
    held = solve_triangular(np.linalg.cholesky(scaled + moving @ moving.T), momenta, lower=True)
    elastic = svdvals(held - held @ along @ along.T)[: len(mass) - rigid.sum()]
    with np.errstate(divide="ignore"):
        return np.concatenate([np.zeros(rigid.sum()), 1.0 / elastic])


def _quadratic_eigenvalues(mass: np.ndarray, damping: np.ndarray, stiffness: np.ndarray) -> np.ndarray:
    """Return the finite roots of ``det(s^2 M + s C + K)`` by ascending modulus, an undamped rigid motion once, as 0.

    The singular value decomposition of the scaled K, which may be unsymmetric, gives bases Y of motions and X of test
    functions with ``X^T K Y = 1``. The unknowns are velocities Y u and spring forces f: ``s M u + C u + f = 0``,
    ``s f = u``. The lowest root then belongs to the largest entries of M, so the higher ones cannot spoil it. A rigid
    motion has a velocity and no force.
    """
    scaled, factors = _unit_diagonal(stiffness)
    left, weights, right = svd(scaled)
    rigid = weights <= _ROUNDING * weights[0]
    size = np.sqrt(np.where(rigid, 1.0, weights))
    test, motions = factors * left / size, factors * right.T / size
    heavy, drag = test.T @ mass @ motions, test.T @ damping @ motions
    rate = 1.0 / np.sqrt(np.abs(heavy[~rigid][:, ~rigid]).max(initial=0.0) or 1.0)
    inertia = rate * np.sqrt(np.abs(np.diag(heavy)))
    size = np.where(rigid & (inertia > 0.0), inertia, 1.0)
    heavy, drag = rate**2 * heavy / size / size[:, None], rate * drag / size / size[:, None]
    spring = np.eye(len(mass))[:, ~rigid]
    forces = spring.shape[1]
    before = np.block([[-drag, -spring], [spring.T, np.zeros((forces, forces))]])
    after = block_diag(heavy, np.eye(forces))
    roots = eig(before, after, right=False)
    roots = roots[np.isfinite(roots)]
    roots = roots[np.argsort(np.abs(roots), kind="stable")]
    undamped = (np.abs(roots[: rigid.sum()]) < 1e-12).sum()
    return np.concatenate([np.zeros(rigid.sum()), rate * roots[undamped:]])
