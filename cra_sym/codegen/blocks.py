"""A linear system with one input as a sum of blocks of second order, which every language can step exactly."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

__all__ = ["Blocks", "blocks_of"]

Array = NDArray[np.float64]
_AGREEMENT = 1e-9  # of the frequency responses, relative to the largest of an output; smaller values are rounding
_ZERO = 1e-6  # eigenvalues below this share of the largest may be those of a free motion


@dataclass(frozen=True)
class Blocks:
    """The system p'' + damping p' + stiffness p = u, y = on_position p + on_rate p' + through u.

    Attributes
    ----------
    stiffness, damping : ndarray, shape (blocks,)
    on_position, on_rate : ndarray, shape (outputs, blocks)
    through : ndarray, shape (outputs,)
    """

    stiffness: Array
    damping: Array
    on_position: Array
    on_rate: Array
    through: Array

    def frequency_response(self, omega: Array) -> NDArray[np.complex128]:
        """Return the outputs under exp(i omega t), shape (outputs, omega)."""
        s = 1j * omega
        below = s**2 + np.outer(self.damping, s) + self.stiffness[:, None] * np.ones_like(s)
        return np.asarray(self.on_position @ (1 / below) + self.on_rate @ (s / below) + self.through[:, None])


def blocks_of(A: Array, B: Array, C: Array, D: Array) -> Blocks:
    """Return the blocks of x' = A x + B u, y = C x + D u with one input.

    Each uncoupled mode is a block. Otherwise the blocks are formed of poles: a pair of complex ones, two real ones, or
    a double one at zero. Uncontrollable parts are left out.

    Raises
    ------
    ValueError
        If poles are too close to each other to separate their residues.
    """
    through, half = D[:, 0], len(A) // 2
    if _is_modal(A, B):
        b = B[half:, 0]
        kept = np.flatnonzero(b)
        gains = C[:, kept] * b[kept], C[:, half + kept] * b[kept]
        return Blocks(-np.diag(A[half:, :half])[kept], -np.diag(A[half:, half:])[kept], *gains, through)
    best: tuple[float, Blocks] | None = None
    for zeros in (0, 2, 4):
        found = _from_poles(A, B, C, through, zeros)
        if found is not None:
            error = _disagreement(found, A, B, C)
            best = (error, found) if best is None or error < best[0] else best
    if best is None or not best[0] < _AGREEMENT:
        raise ValueError("system: its poles lie too close to each other to be told apart; damp or separate its modes")
    return best[1]


def _is_modal(A: Array, B: Array) -> bool:
    half = len(A) // 2
    blocks = A[half:, :half], A[half:, half:]
    upper = np.array_equal(A[:half], np.eye(half, len(A), half)) and not B[:half].any()
    return upper and all(np.array_equal(block, np.diag(np.diag(block))) for block in blocks)


def _from_poles(A: Array, B: Array, C: Array, through: Array, zeros: int) -> Blocks | None:
    """Return the blocks with a given number of poles at zero, or None if there are fewer small ones."""
    from scipy.linalg import eig

    scale = np.exp(-0.5 * np.log(np.maximum(np.abs(A).max(axis=0), 1e-300) / np.maximum(np.abs(A).max(axis=1), 1e-300)))
    scale = 2.0 ** np.round(np.log2(scale))
    poles, left, right = eig(A * scale / scale[:, None], left=True, right=True)
    order = np.argsort(np.abs(poles))
    poles, left, right = poles[order], left[:, order], right[:, order]
    if zeros and not (np.abs(poles[:zeros]) <= _ZERO * np.abs(poles[-1])).all():
        return None
    with np.errstate(all="ignore"):
        shares = (
            ((C * scale) @ right) * (left.conj().T @ (B / scale[:, None]))[:, 0] / np.sum(left.conj() * right, axis=0)
        )
    first, second = _pairs(poles, zeros)
    p, q = poles[first], poles[second]
    on_rate = (shares[:, first] + shares[:, second]).real
    on_position = -(shares[:, first] * q + shares[:, second] * p).real
    blocks = Blocks((p * q).real, -(p + q).real, on_position, on_rate, through)
    return _with_free_motion(blocks, A, B, C) if zeros else blocks


def _pairs(poles: NDArray[np.complex128], zeros: int) -> tuple[list[int], list[int]]:
    """Return the pairs of indices of the poles that form a block, except those at zero."""
    first, second = [], []
    real = [i for i in range(zeros, len(poles)) if poles[i].imag == 0.0]
    for i in range(zeros, len(poles)):
        if poles[i].imag > 0.0:
            first.append(i)
            second.append(next(j for j in range(zeros, len(poles)) if poles[j] == poles[i].conjugate()))
    return first + real[0::2], second + real[1::2]


def _with_free_motion(blocks: Blocks, A: Array, B: Array, C: Array) -> Blocks:
    """Add the block of a double pole at zero, from the remainder of the response at a low frequency."""
    slowest = np.sqrt(np.min(np.abs(blocks.stiffness), initial=np.inf))
    omega = np.array([0.3 * slowest if np.isfinite(slowest) else 1.0])
    rest = (_response(A, B, C, omega) - blocks.frequency_response(omega) + blocks.through[:, None])[:, 0]
    rest = rest * -(omega**2)
    return Blocks(
        np.append(blocks.stiffness, 0.0), np.append(blocks.damping, 0.0),
        np.column_stack([blocks.on_position, rest.real]), np.column_stack([blocks.on_rate, rest.imag / omega]),
        blocks.through,
    )  # fmt: skip


def _response(A: Array, B: Array, C: Array, omega: Array) -> NDArray[np.complex128]:
    solved = [np.linalg.solve(1j * w * np.eye(len(A)) - A, B[:, 0].astype(complex)) for w in omega]
    return np.asarray(C @ np.column_stack(solved))


def _disagreement(blocks: Blocks, A: Array, B: Array, C: Array) -> float:
    """Return the largest difference of the frequency responses, relative to the largest of each output."""
    sizes = np.sqrt(np.abs(blocks.stiffness[blocks.stiffness != 0.0]))
    if not np.isfinite(sizes).all():
        return float("inf")
    omega = np.geomspace(0.1 * np.min(sizes, initial=1.0), 10 * np.max(sizes, initial=1.0), 61)
    expected = _response(A, B, C, omega)
    found = blocks.frequency_response(omega) - blocks.through[:, None]
    size = np.maximum(np.abs(expected).max(axis=1), np.abs(blocks.through))[:, None]
    return float(np.max(np.abs(found - expected) / np.where(size > 0.0, size, 1.0)))
