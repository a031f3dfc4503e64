"""Reference vectors in time: outputs after steps, by the matrices of the state space and their exponential."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import sympy as sp
from numpy.typing import NDArray

from cra_sym.analysis.modes import participation
from cra_sym.analysis.state_space import state_space
from cra_sym.codegen.model_time import Signals
from cra_sym.model.system import System

__all__ = ["stepped_outputs"]

Array = NDArray[np.float64]


def stepped_outputs(
    in_time: Signals, system: System, modes: int, least: float
) -> Iterator[tuple[float, int, tuple[float, ...], float]]:
    """Yield sampling times and numbers of steps, outputs after these, and the size of what was added up.

    Nothing if a free base moves less than a share ``least`` of all mass alone: the less, the more digits are lost.
    """
    linear = state_space(system, modes, *in_time.given)
    omega, loss = system.natural_frequencies(modes), 1.0
    if in_time.free:
        name = in_time.states[0]
        whole = float(system.numerics("carried", name).function(*system.domain.values)[0])
        alone = 1.0 - float(np.square(participation(system, modes, name)).sum()) / whole
        if alone < least:
            return
        loss /= alone
    fastest = float(np.abs(np.linalg.eigvals(linear.A)).max())
    slowest = float(np.min(omega[omega > 1e-6 * fastest], initial=fastest))
    moved = _cancelled(in_time, system)
    for time, steps in ((0.05 / fastest, 5), (0.7 / fastest, 9), (0.3 / slowest, 4)):
        scale, A, B = _held(linear.A, linear.B, time)
        C = linear.C * scale
        x, size = np.zeros(len(A)), np.zeros(len(C))
        for n in range(steps + 1):
            u = 0.25 * np.where((n - (n == steps)) % 3 == np.arange(B.shape[1]) % 3, 1.0, -0.5)
            y = C @ x + linear.D @ u
            size = np.maximum(size, np.abs(C) @ np.abs(x) + np.abs(linear.D) @ np.abs(u) + 0.25 * moved)
            x = A @ x + B @ u
        yield time, steps, tuple(y), loss * float(size.max())


def _held(A: Array, B: Array, time: float) -> tuple[Array, Array, Array]:
    """Return the scale of each state, and the matrices of a step for states over these, which loses fewer digits."""
    from scipy.linalg import expm

    half, inputs = len(A) // 2, B.shape[1]
    rates = np.sqrt(np.abs(np.diag(A[half:, :half]))) + np.abs(np.diag(A[half:, half:]))
    scale = np.concatenate([np.ones(half), np.maximum(rates, 1e-3 / time)])
    whole = np.zeros((len(A) + inputs,) * 2)
    whole[: len(A)] = np.hstack([A * scale, B]) / scale[:, None]
    moved = expm(whole * time)[: len(A)]
    return scale, moved[:, : len(A)], moved[:, len(A) :]


def _cancelled(in_time: Signals, system: System) -> Array:
    """Return the acceleration of prescribed motions in each output, which the modes may take back."""
    values = {symbol: float(system.values[symbol.name]) for symbol in system.model.symbols}
    return np.array(
        [
            sum(
                abs(float(sp.sympify(factor, strict=True).subs(values)))
                for part, factor in zip(one.parts, one.factors, strict=True)
                if part.kind == "motion" and part.time == 2
            )
            for one in in_time.outputs.values()
        ]
    )
