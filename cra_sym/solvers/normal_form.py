r"""Boundary of instability, to first or second order, where two modes resonate with a periodic excitation.

For :math:`\dot z = (A_0 + \epsilon A_1(t) + \epsilon^2 A_2(t)) z` a solution
:math:`e^{st}\sum_k z_k e^{ik\varpi t}` obeys Hill's infinite equations. Near a resonance two of their unperturbed
eigenvalues coincide, :math:`\lambda_a` and :math:`\lambda_b + iT\varpi`; all other states are eliminated to second
order (Bloch 1958), with exact receptances, so that every mode of the matrices takes part. Two equations remain, and
on the boundary the real part of one of their exponents is zero. Damping, gyroscopic and follower forces
are part of :math:`A_0`.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

__all__ = ["Boundary", "Expansion", "Pair", "boundary", "eigenpairs"]

Array = NDArray[np.float64]
Complex = NDArray[np.complex128]
_TURNS = 8  # the coefficients depend on the boundary itself: each iteration gains an order of epsilon


@dataclass(frozen=True)
class Expansion:
    """Coefficients of one batch of systems, shape (points, n, n).

    Attributes
    ----------
    still : ndarray
        A_0.
    first, second : mapping of (harmonic, power) to ndarray
        Of exp(i harmonic varpi t) varpi^power in A_1 and A_2.
    """

    still: Array
    first: Mapping[tuple[int, int], Complex]
    second: Mapping[tuple[int, int], Complex]

    def at(self, varpi: Array) -> tuple[dict[int, Complex], dict[int, Complex]]:
        """Return both by harmonic at excitation frequencies (points,)."""
        found: tuple[dict[int, Complex], dict[int, Complex]] = ({}, {})
        for part, given in zip(found, (self.first, self.second), strict=True):
            for (harmonic, power), matrix in given.items():
                part[harmonic] = part.get(harmonic, 0.0) + varpi[:, None, None] ** power * matrix
        return found


class Pair(NamedTuple):
    """Two eigenvalues of A_0, shape (points,), with right and left eigenvectors (points, n); left times right is 1."""

    values: tuple[Complex, Complex]
    right: tuple[Complex, Complex]
    left: tuple[Complex, Complex]


class Boundary(NamedTuple):
    """Both sides of a zone, rad/s, and the strength of the excitation of the pair (positive where it destabilises)."""

    lower: Array
    upper: Array
    strength: Array


def eigenpairs(still: Array) -> tuple[Complex, Complex, Complex]:
    """Return the oscillating eigenvalues (points, m), by ascending imaginary part, with right and left eigenvectors.

    The eigenvectors have shape (points, m, n). m is the smallest number of any of the systems.
    """
    values, right = np.linalg.eig(still)
    others, left = np.linalg.eig(still.swapaxes(1, 2))
    count = int((values.imag > 1e-9 * np.abs(values).max(axis=1, keepdims=True)).sum(axis=1).min())
    order = np.argsort(np.where(values.imag > 0, values.imag, np.inf), axis=1)[:, :count]
    # the same eigenvalues twice, up to rounding: pair the closest
    values = np.take_along_axis(values, order, axis=1)
    right = np.take_along_axis(right, order[:, None, :], axis=2).swapaxes(1, 2)
    match = np.abs(values[:, :, None] - others[:, None, :]).argmin(axis=2)
    left = np.take_along_axis(left, match[:, None, :], axis=2).swapaxes(1, 2)
    size = (left * right).sum(axis=2, keepdims=True)
    return values, right, left / size


def boundary(expansion: Expansion, pair: Pair, tongue: int, epsilon: Array, order: int) -> Boundary:
    """Return the boundary of the zone where ``values[0] - values[1]`` is near ``i tongue varpi``.

    Parameters
    ----------
    expansion : Expansion
    pair : Pair
    tongue : int
    epsilon : ndarray, shape (points,)
    order : {1, 2}
    """
    centre = (pair.values[0] - pair.values[1]).imag / tongue
    sides, strength = [], np.zeros_like(centre)
    for side in (-1.0, 1.0):
        varpi, exponent = centre, np.asarray(1j * pair.values[0].imag)
        for _ in range(1 if order == 1 else _TURNS):
            own, through = _reduced(expansion, pair, tongue, epsilon, order, varpi, exponent)
            side_at, exponent = _marginal(own, through, tongue, varpi, side)
            varpi = np.where(np.isfinite(side_at), side_at, centre)
        sides.append(side_at)
        strength = through.real
    return Boundary(sides[0], sides[1], strength)


def _marginal(
    own: tuple[Complex, Complex], through: Complex, tongue: int, varpi: Array, side: float
) -> tuple[Array, Complex]:
    """Return the frequency at which ``(s - own[0]) (s - own[1] + detuning) = through`` has s imaginary, and that s.

    If only one of the two is damped, a real ``through > 0`` gives growth at every detuning: infinite frequencies.
    """
    fall, other = -own[0].real, -own[1].real
    total, product = fall + other, fall * other
    now = (own[0] - own[1]).imag
    with np.errstate(divide="ignore", invalid="ignore"):
        # s = i (Im own[0] + y) and d = Im (own[0] - own[1]) in (i y + fall) (i (y + d) + other) = through
        half = 0.5 * through.imag * (other - fall) / product
        root = half**2 - (total**2 * (product - through.real) - through.imag**2) / product
        damped = half - side * np.sqrt(np.where(root >= 0, root, np.nan))
        free = -side * 2.0 * np.sqrt(np.where(through.real >= 0, through.real, np.nan))
        still = total <= 1e-12 * np.abs(own[0])
        undamped = ~still & (np.minimum(fall, other) <= 1e-12 * np.abs(own[0])) & (total > 0)
        # s (s + total + i d) = through has one side where through is complex: y = Im through / total
        level = through.imag / total
        tilted = np.abs(through.imag) > 1e-9 * np.abs(through.real)
        open_side = ~tilted | (side * through.imag < 0)
        single = np.where(open_side, -side * np.inf, -through.real / np.where(tilted, level, 1.0) - level)
        d = np.where(still, free, np.where(undamped, np.where(through.real > 0, single, np.nan), damped))
        y = np.where(still, -d / 2, (through.imag - fall * d) / total)
    # d falls with the excitation frequency: the upper side has the smaller one
    return varpi + (now - d) / tongue, np.asarray(1j * (own[0].imag + y))


def _reduced(
    expansion: Expansion, pair: Pair, tongue: int, epsilon: Array, order: int, varpi: Array, exponent: Complex
) -> tuple[tuple[Complex, Complex], Complex]:
    """Return the two diagonal entries of the reduced equations and the product of the two others."""
    first, second = expansion.at(varpi)
    shifts = (0, -tongue)  # harmonic of the two states
    entries = np.zeros((2, 2, *varpi.shape), dtype=complex)
    for column in (0, 1):
        entries[column, column] += pair.values[column] - 1j * shifts[column] * varpi
        for row in (0, 1):
            step = shifts[row] - shifts[column]
            for power, given in ((1, first), (2, second)):
                if step in given and power <= order:
                    entries[row, column] += epsilon**power * _between(pair.left[row], given[step], pair.right[column])
        if order == 2:
            for harmonic, matrix in first.items():
                moved = _applied(matrix, pair.right[column])
                place = shifts[column] + harmonic
                answer = _receptance(expansion.still, pair, shifts, place, exponent + 1j * place * varpi, moved)
                for row in (0, 1):
                    step = shifts[row] - place
                    if step in first:
                        entries[row, column] += epsilon**2 * _between(pair.left[row], first[step], answer)
    return (entries[0, 0], entries[1, 1]), entries[0, 1] * entries[1, 0]


def _receptance(
    still: Array, pair: Pair, shifts: tuple[int, int], place: int, exponent: Complex, force: Complex
) -> Complex:
    """Return the response of all states of a harmonic except the two of the pair."""
    matrix = exponent[:, None, None] * np.eye(still.shape[-1]) - still
    for k in (0, 1):
        if shifts[k] == place:  # this state is retained: its contribution is removed and its singular term regularised
            left, right = pair.left[k], pair.right[k]
            force = force - right * (left * force).sum(axis=1, keepdims=True)
            matrix = matrix + np.abs(pair.values[k])[:, None, None] * right[:, :, None] * left[:, None, :]
    return np.asarray(np.linalg.solve(matrix, force[:, :, None])[:, :, 0])


def _applied(matrix: Complex, vector: Complex) -> Complex:
    return np.asarray((matrix @ vector[:, :, None])[:, :, 0])


def _between(left: Complex, matrix: Complex, right: Complex) -> Complex:
    return np.asarray((left * _applied(matrix, right)).sum(axis=1))
