"""Ritz's method in numbers: the second route to the frequencies, and starting guesses for damped models."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from scipy.linalg import eig, eigh
from sympy import Symbol

from cra_sym.checks import count
from cra_sym.kernels import kernel
from cra_sym.mechanics import RitzMatrices
from cra_sym.model.spatial import check_range
from cra_sym.model.values import Values

__all__ = ["Ritz"]


@dataclass(frozen=True, eq=False)
class Ritz:
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
        """Return upper bounds of the natural frequencies in Hz, shape (..., modes).

        Raises
        ------
        ValueError
            If there are fewer unknowns than modes, a motion has no kinetic energy, the Lagrangian has gyroscopic terms
            or the virtual work follower forces, or the structure has buckled.

        Notes
        -----
        Dampers are left out. Rounding grows with the number of elements, the faster the higher the derivatives of the
        density, and can then lift or lower the first frequencies: compare two meshes.
        """
        modes = count("modes", modes, high=self.matrices.free)
        given = Values.read(self.symbols, values)
        squares = np.empty((given.columns.shape[1], modes))
        for row, stiffness, damping, mass in self._numbers(given):
            if _asymmetric(damping) or _asymmetric(stiffness):
                raise ValueError("natural frequencies need symmetric stiffness and damping; use eigenvalues")
            try:
                squares[row] = eigh(stiffness, mass, eigvals_only=True, subset_by_index=(0, modes - 1))
            except np.linalg.LinAlgError:
                raise ValueError("values: the kinetic energy is not positive for all motions of the elements") from None
            scale = np.trace(stiffness) / np.trace(mass)
            if squares[row, 0] < -1e-9 * scale:
                raise ValueError(f"the structure has buckled: omega^2 = {squares[row, 0]:.6g} (rad/s)^2")
        return (np.sqrt(np.maximum(squares, 0.0)) / (2.0 * np.pi)).reshape(*given.shape, modes)

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
        given = Values.read(self.symbols, values)
        roots = np.empty((given.columns.shape[1], modes), dtype=complex)
        for row, stiffness, damping, mass in self._numbers(given):
            s = _quadratic_eigenvalues(mass, damping, stiffness)
            s = s[s.imag > 1e-7 * np.abs(s)] if oscillating else s[s.imag >= -1e-7 * np.abs(s)]
            if len(s) < modes:
                kind = "oscillating motions" if oscillating else "eigenvalues"
                raise ValueError(f"modes = {modes}: {self.matrices.elements} elements have {len(s)} {kind}")
            roots[row] = s[:modes]
        return roots.reshape(*given.shape, modes)

    @cached_property
    def _kernels(self):
        m = self.matrices
        element = kernel(
            (m.element_stiffness, m.element_damping, m.element_mass),
            (m.element_length, m.element_start, *self.symbols),
            backend="numpy",
        )
        ends = tuple((tuple(e), tuple(e.values())) for e in (m.end_stiffness, m.end_damping, m.end_mass))
        factors = [(i, j, factor) for i, row in enumerate(m.restraint) for j, factor in row.items()]
        parts = (m.start, m.length, tuple(f for *_, f in factors), *(v for _, v in ends))
        return element, kernel(parts, self.symbols, backend="numpy"), factors, [places for places, _ in ends]

    def _numbers(self, given: Values) -> Iterator[tuple[int, np.ndarray, np.ndarray, np.ndarray]]:
        """Yield (row, K, C, M) on the free unknowns, one parameter set at a time."""
        for rows, infinite in given.patterns():
            for row, column in zip(rows, given.take(rows, infinite).T, strict=True):
                with np.errstate(over="ignore", invalid="ignore"):
                    matrices, restraint = self._assembled(column)
                check_range(*matrices)
                for position in infinite:
                    restraint = self._held(position, column, restraint)
                stiffness, damping, mass = (restraint.T @ matrix @ restraint for matrix in matrices)
                yield int(row), stiffness, damping, mass

    def _assembled(self, column: np.ndarray) -> tuple[list[np.ndarray], np.ndarray]:
        element, rest, factors, places = self._kernels
        start, length, weights, *ends = rest(*column)
        m = self.matrices
        step = length / m.elements
        local = element(step, start + step * np.arange(m.elements), *column)
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
        """Return the free motions that an infinite stiffness of an end leaves."""
        symbol, total = self.symbols[position], len(restraint)
        slopes = {place: entry.diff(symbol) for place, entry in self.matrices.end_stiffness.items()}
        inside = self.matrices.element_stiffness.free_symbols | self.matrices.element_mass.free_symbols
        if symbol in inside or not any(slopes.values()):
            raise ValueError(f"{symbol.name} = inf: allowed only for a stiffness of an end")
        held = np.zeros((total, total))
        for place, value in zip(slopes, kernel(tuple(slopes.values()), self.symbols)(*column), strict=True):
            held[place] = value
        _, size, adjoint = np.linalg.svd(held @ restraint)
        return restraint @ adjoint[int((size > 1e-12 * size.max()).sum()) :].T


def _asymmetric(matrix: np.ndarray) -> bool:
    return bool(np.abs(matrix - matrix.T).max() > 1e-12 * np.abs(matrix).max())


def _quadratic_eigenvalues(mass: np.ndarray, damping: np.ndarray, stiffness: np.ndarray) -> np.ndarray:
    """Return the finite roots of ``det(s^2 M + s C + K)`` by ascending modulus."""
    size = len(mass)
    rate = np.sqrt(np.linalg.norm(stiffness) / np.linalg.norm(mass))
    eye, none = np.eye(size), np.zeros((size, size))
    heavy = mass * rate**2
    left = np.block([[none, eye], [-stiffness, -damping * rate]])
    roots = rate * eig(left, np.block([[eye, none], [none, heavy]]), right=False)
    roots = roots[np.isfinite(roots)]
    return roots[np.argsort(np.abs(roots), kind="stable")]
