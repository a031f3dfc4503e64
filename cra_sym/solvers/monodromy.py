"""Floquet multipliers of periodic solutions: the variational equations over one period, many solutions at once.

A step is exact for the stiffness at its midpoint, so that its length is set by the change of the stiffness, not by the
fastest mode. Where velocities couple the modes, a step propagates the linear modes exactly and applies the remainder at
its midpoint by a Cayley transform. Both are symplectic without damping: multipliers of stable motions lie on the unit
circle.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from cra_sym.solvers.harmonic_balance import Basis, flattened
from cra_sym.solvers.modal_polynomials import ModalPolynomials

__all__ = ["beside_linear", "even_monodromy", "monodromy", "multipliers"]

Array = NDArray[np.float64]
Complex = NDArray[np.complex128]
Causes = Callable[[Array, NDArray[np.intp]], Array]
"""Known functions at phases of shape (samples,) for some points, shape (points, known functions, samples)."""
_BLOCK = 500_000  # matrix entries at a time, so that they stay in the processor's cache
_LEVELS = 6


def monodromy(
    equations: ModalPolynomials,
    basis: Basis,
    coefficients: Array,
    frequency: Array,
    steps: int,
    causes: Causes | None = None,
    share: float = 1.0,
) -> Array:
    """Return the maps of displacements and momenta over one period, or a share of it from the phase 0.

    Parameters
    ----------
    equations : ModalPolynomials
    basis : Basis
    coefficients : ndarray, shape (points, modes, functions)
    frequency : ndarray, shape (points,)
    steps : int
        A power of two.
    causes : callable, optional
    share : float

    Returns
    -------
    ndarray, shape (points, 2 modes, 2 modes)
        Its error falls with the square of the number of steps.
    """
    n = equations.modes
    most = max(1, _BLOCK // (steps * 4 * n * n))
    found = np.empty((len(frequency), 2 * n, 2 * n))
    for start in range(0, len(frequency), most):
        rows = np.arange(start, min(start + most, len(frequency)))
        found[rows] = _maps(equations, basis, coefficients[rows], frequency[rows], steps, causes, rows, share)
    return found


def even_monodromy(
    equations: ModalPolynomials, basis: Basis, coefficients: Array, frequency: Array, steps: int
) -> Array:
    """Return the maps over one period of motions of a system without damping that are sums of cosines.

    The variational equations are even in time, so that the first half of the period gives the second. If all multiples
    are odd, and so is the system, the period of these equations is half as long.
    """
    halves = 2 if equations.odd and all(order % 2 for order in basis.cosines) else 1
    n, share = equations.modes, 0.5 / halves
    half = monodromy(equations, basis, coefficients, frequency, max(1, int(steps * share)), share=share)
    a, b, c, d = (half[:, i : i + n, j : j + n].swapaxes(1, 2) for i in (0, n) for j in (0, n))
    mirrored = np.block([[d, b], [c, a]])
    whole: Array = mirrored @ half
    return whole @ whole if halves == 2 else whole


def _maps(
    equations: ModalPolynomials,
    basis: Basis,
    coefficients: Array,
    frequency: Array,
    steps: int,
    causes: Causes | None,
    rows: NDArray[np.intp],
    share: float,
) -> Array:
    n, points = equations.modes, len(frequency)
    phase = 2 * np.pi * share * (np.arange(steps) + 0.5) / steps
    q = np.einsum("pnm,sm->psn", coefficients, basis.values(phase)).reshape(-1, n)
    v = np.zeros_like(q)  # not needed where no nonlinear term contains velocities
    if equations.moves_mass:
        v = np.einsum("pnm,sm,p->psn", coefficients, basis.values(phase, 1), frequency).reshape(-1, n)
    known = None if causes is None else flattened(causes(phase, rows))
    h = (2 * np.pi * share / (frequency * steps))[:, None, None, None]
    if equations.moves_mass:
        rest = beside_linear(equations, q, v, known).reshape(points, steps, 2 * n, 2 * n)
        return _product(_split_maps(equations, rest, h))
    pull = equations.derivatives(q, v, known).force_q.reshape(points, steps, n, n)
    return _pushed_map(equations, pull, h) if _mixes(equations) else _product(_midpoint_maps(equations, pull, h))


def _mixes(equations: ModalPolynomials) -> bool:
    """Whether forces depend on velocities (apart from the damping of each mode) or have no potential."""
    diagonal = np.diag(np.diag(equations.damping))
    return equations.moves_mass or bool(equations.forces) or bool(np.any(equations.damping != diagonal))


def _midpoint_maps(equations: ModalPolynomials, pull: Array, h: Array) -> Array:
    """Return the maps over steps of length h, exact for the stiffness at the midpoint of each."""
    n, damping = equations.modes, np.diag(equations.damping)
    square, shape = np.linalg.eigh(np.diag(equations.omega**2) - pull)
    angle = np.sqrt(np.abs(square)) * h[..., 0]
    cosine = np.where(square > 0, np.cos(angle), np.cosh(angle))
    sine = h[..., 0] * np.where(square > 0, np.sinc(angle / np.pi), np.sinh(angle) / np.where(angle > 0, angle, 1.0))
    maps, across = np.empty((*pull.shape[:2], 2 * n, 2 * n)), shape.swapaxes(-1, -2)
    maps[:, :, :n, :n] = maps[:, :, n:, n:] = (shape * cosine[:, :, None]) @ across
    maps[:, :, :n, n:] = (shape * sine[:, :, None]) @ across
    maps[:, :, n:, :n] = -(shape * (square * sine)[:, :, None]) @ across
    if damping.any():  # momenta decay over half a step before and after
        decay = np.exp(-0.5 * damping * h[..., 0])
        maps[:, :, n:] *= decay[..., None]
        maps[:, :, :, n:] *= decay[:, :, None]
    return maps


def _split_maps(equations: ModalPolynomials, rest: Array, h: Array) -> Array:
    """Return the maps over steps of length h: linear modes exactly, the remainder at the midpoint."""
    one, scaled, turn = np.eye(2 * equations.modes), rest * h, _rotation(equations.omega, 0.5 * h)
    return np.asarray(turn @ np.linalg.solve(one - 0.5 * scaled, one + 0.5 * scaled) @ turn)


def _pushed_map(equations: ModalPolynomials, pull: Array, h: Array) -> Array:
    """Return the map over all steps as by `_split_maps` for forces of the displacements, and damping.

    The remainder changes momenta alone. The linear modes turn by half a step at the end of a step and at the start of
    the next: at once by a whole one.
    """
    n, omega = equations.modes, equations.omega
    drag = -0.5 * h * equations.damping
    implicit = np.linalg.inv(np.eye(n) - drag)
    push, keep = h * implicit @ pull, implicit @ (np.eye(n) + drag)
    turn = _rotation(omega, h)
    a, b, c, d = (np.diagonal(turn[..., i : i + n, j : j + n], 0, -2, -1)[..., None] for i in (0, n) for j in (0, n))
    maps, place = np.empty((*pull.shape[:2], 2 * n, 2 * n)), np.arange(n)
    np.multiply(b, push, out=maps[:, :, :n, :n])
    np.multiply(d, push, out=maps[:, :, n:, :n])
    maps[:, :, place, place] += a[..., 0]
    maps[:, :, n + place, place] += c[..., 0]
    maps[:, :, :n, n:], maps[:, :, n:, n:] = b * keep, d * keep
    back, half = (_rotation(omega, share * h)[:, 0] for share in (-0.5, 0.5))
    return np.asarray(back @ _product(maps) @ half)


def _product(maps: Array) -> Array:
    """Return the product of maps (points, steps, size, size) in the order of time; steps is a power of two."""
    while maps.shape[1] > 1:
        maps = maps[:, 1::2] @ maps[:, 0::2]
    return maps[:, 0]


def beside_linear(equations: ModalPolynomials, q: Array, v: Array, causes: Array | None) -> Array:
    """Return the matrix of the variational equations in (q, p) without the undamped linear modes."""
    n, found = equations.modes, equations.derivatives(q, v, causes)
    matrix = np.zeros((len(q), 2 * n, 2 * n))
    drag = found.force_v - equations.damping
    inverse = np.linalg.inv(np.eye(n) + found.momentum_v)
    back = -inverse @ found.momentum_q
    matrix[:, :n, :n], matrix[:, :n, n:] = back, inverse - np.eye(n)
    matrix[:, n:, :n], matrix[:, n:, n:] = found.force_q + drag @ back, drag @ inverse
    return matrix


def _rotation(omega: Array, time: Array) -> Array:
    """Return the exact maps of undamped linear modes over times (..., 1, 1), shape (..., 2 modes, 2 modes)."""
    angle = omega * time[..., 0]
    cosine, n = np.cos(angle), omega.size
    matrix = np.zeros((*time.shape[:-2], 2 * n, 2 * n))
    place = np.arange(n)
    matrix[..., place, place] = matrix[..., n + place, n + place] = cosine
    matrix[..., place, n + place] = time[..., 0] * np.sinc(angle / np.pi)
    matrix[..., n + place, place] = -omega * np.sin(angle)
    return matrix


@np.errstate(over="ignore", invalid="ignore")  # overflow gives infinite multipliers
def multipliers(
    equations: ModalPolynomials,
    basis: Basis,
    coefficients: Array,
    frequency: Array,
    causes: Causes | None = None,
    tolerance: float = 1e-9,
    even: bool = False,
) -> Complex:
    """Return the Floquet multipliers, by Richardson extrapolation of the maps in the number of steps.

    Parameters
    ----------
    equations, basis, coefficients, frequency, causes
        As in :func:`monodromy`.
    tolerance : float
        Error of the maps relative to their size.
    even : bool
        Whether the motions are those of :func:`even_monodromy`.

    Returns
    -------
    complex ndarray, shape (points, 2 modes)
        Largest first; infinite where they overflow.
    """
    maps = _extrapolated(equations, basis, coefficients, frequency, causes, tolerance, even)
    if not (equations.damping.any() or equations.forces):
        maps = _symplectic(maps)
    values = np.full(maps.shape[:2], np.inf, complex)
    finite = np.isfinite(maps).all(axis=(1, 2))
    values[finite] = np.linalg.eigvals(maps[finite])
    return np.take_along_axis(values, np.argsort(-np.abs(values), axis=1, kind="stable"), axis=1)


def _extrapolated(
    equations: ModalPolynomials,
    basis: Basis,
    coefficients: Array,
    frequency: Array,
    causes: Causes | None,
    tolerance: float,
    even: bool,
) -> Array:
    """Return the maps over one period, extrapolated in the number of steps."""
    found = np.empty((len(frequency), 2 * equations.modes, 2 * equations.modes))
    open_ = np.arange(len(frequency))
    turns = float((equations.omega.max() / frequency).max(initial=1.0)) if _mixes(equations) else 0.0
    steps = 2 ** int(np.ceil(np.log2(max(32.0, 2.0 * turns, 4.0 * basis.orders.max(initial=1.0)))))
    table: list[Array] = []
    for level in range(_LEVELS):
        chosen = equations, basis, coefficients[open_], frequency[open_], steps << level
        some = None if causes is None else _of_members(causes, open_)
        row = [even_monodromy(*chosen) if even else monodromy(*chosen, some)]
        for k, before in enumerate(table):
            row.append(row[k] + (row[k] - before) / (4.0 ** (k + 1) - 1))
        if table:
            size = np.abs(row[-1]).max(axis=(1, 2))
            good = np.abs(row[-1] - row[-2]).max(axis=(1, 2)) <= tolerance * size
            good |= level == _LEVELS - 1
            found[open_[good]] = row[-1][good]
            open_, row = open_[~good], [entry[~good] for entry in row]
        table = row
        if not open_.size:
            break
    return found


def _symplectic(maps: Array) -> Array:
    """Return the nearest symplectic maps, since extrapolation of a conservative system's maps is not symplectic.

    Newton's method for M' J M = J: its steps are M (1 + J E / 2) with E = M' J M - J.
    """
    n = maps.shape[-1] // 2
    j = np.block([[np.zeros((n, n)), np.eye(n)], [-np.eye(n), np.zeros((n, n))]])
    for _ in range(2):
        maps = maps + 0.5 * maps @ (j @ (maps.swapaxes(1, 2) @ j @ maps - j))
    return maps


def _of_members(causes: Causes, members: NDArray[np.intp]) -> Causes:
    return lambda phase, rows: causes(phase, members[rows])
