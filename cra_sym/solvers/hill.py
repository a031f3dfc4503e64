r"""Floquet exponents by Hill's method: a Fourier series instead of an integration, for one system at a time."""

from __future__ import annotations

from typing import Any

import numpy as np

__all__ = ["hill_exponents"]


def hill_exponents(
    omega: Any, coupling: Any, angular_frequency: float, epsilon: float, decay: Any = 0.0, harmonics: int = 24
) -> np.ndarray:
    r"""Return all Floquet exponents of :math:`\ddot q + 2C\dot q + (\Omega^2 + \epsilon\cos\varpi t\,P)\,q = 0`.

    With :math:`q = e^{st}\sum_k c_k e^{ik\varpi t}` the zeros s of Hill's determinant are the eigenvalues of a banded
    matrix. It is independent of the integration in :mod:`cra_sym.solvers.periodic`, so that each checks the other.

    Parameters
    ----------
    omega, decay : array_like, shape (N,)
        Natural frequencies, rad/s, and decay rates, 1/s.
    coupling : array_like, shape (N, N)
        P, symmetric or not.
    angular_frequency, epsilon : float
    harmonics : int
        Highest k; convergence is faster than any power of k once ``harmonics * varpi`` exceeds the frequencies.

    Returns
    -------
    ndarray, shape (2N,)
        Largest real part first, imaginary parts between -1/2 and 1/2 of the excitation frequency.
    """
    omega, coupling = np.asarray(omega, dtype=float), np.asarray(coupling, dtype=float)
    modes = omega.size
    decay = np.broadcast_to(np.asarray(decay, dtype=float), (modes,))
    orders = np.arange(-harmonics, harmonics + 1)
    shift = np.kron(np.diag(1j * orders * angular_frequency), np.eye(modes))
    neighbours = np.eye(orders.size, k=1) + np.eye(orders.size, k=-1)
    stiffness = np.kron(np.eye(orders.size), np.diag(omega**2)) + 0.5 * epsilon * np.kron(neighbours, coupling)
    damping = np.kron(np.eye(orders.size), np.diag(2.0 * decay))
    one = np.eye(len(shift))
    # (s + shift)^2 + damping (s + shift) + stiffness = 0, first order in s for the harmonics of q and dq/dt
    values = np.linalg.eigvals(np.block([[-shift, one], [-stiffness, -shift - damping]]))
    return _one_strip(values, angular_frequency, 2 * modes)


def _one_strip(values: np.ndarray, frequency: float, wanted: int) -> np.ndarray:
    """Return one member of each family s + i k varpi: those in a strip whose edges are far from all exponents."""
    inner = values[np.abs(values.imag) < frequency]
    turns = np.sort(np.mod(inner.imag / frequency, 1.0))
    gaps = np.diff(np.append(turns, turns[0] + 1.0))
    cut = np.mod(turns[gaps.argmax()] + gaps.max() / 2, 1.0) - 1.0  # the strip starts in the middle of the widest gap
    found = inner[(inner.imag >= cut * frequency) & (inner.imag < (cut + 1.0) * frequency)]
    if found.size != wanted:
        raise ValueError(f"harmonics: too few to separate the {wanted} exponents ({found.size} found)")
    found = found - 1j * frequency * np.round(found.imag / frequency)
    return np.asarray(found[np.lexsort((found.imag, -found.real))])
