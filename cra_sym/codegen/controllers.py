"""A regulator and an observer for exported code, from the Riccati equations of the sampled system."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from cra_sym.checks import instance, one_number
from cra_sym.codegen.blocks import Blocks
from cra_sym.model.system import System

__all__ = ["Controller", "controller_checks", "numbers_of", "of_blocks", "sampled_matrices"]

Array = NDArray[np.float64]
_UNSEEN = "{}: these outputs do not see every mode and the base; add one, such as 'y'"


@dataclass(frozen=True)
class Controller:
    """Specification of a linear-quadratic regulator and a stationary Kalman filter for :func:`cra_sym.export`.

    Parameters
    ----------
    time : float
        Sampling time, s.
    measured : sequence of str
        Outputs of the system that are measured.
    noise : sequence of float
        Standard deviation of the (discrete white) noise of each, in its unit.
    disturbance : float
        Standard deviation of the (discrete white) noise added to the input, in its unit.
    weights : mapping of str to float
        Weights of the squares of outputs in the cost function of the regulator, at least one.
    effort : float
        Weight of the square of the input.
    system : System, optional
        Values for which the gains of an exported model are computed; of an exported system they are its own.

    Raises
    ------
    ValueError
        If a number is not positive, or there are not as many noises as measured outputs.

    Examples
    --------
    >>> import tempfile
    >>> import cra_sym as cra
    >>> sensors = {"measured": ["w", "root_moment"], "noise": [1e-5, 1e-3]}
    >>> loop = cra.Controller(1e-3, **sensors, disturbance=0.1, weights={"y": 1e4})
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     made = cra.export("c", folder, system=cra.Arm.nominal(), controller=loop)
    """

    time: float
    measured: Sequence[str]
    noise: Sequence[float]
    disturbance: float
    weights: Mapping[str, float]
    effort: float = 1.0
    system: System | None = None

    def __post_init__(self) -> None:
        if self.system is not None:
            instance("system", self.system, System)
        for name in ("time", "disturbance", "effort"):
            _positive(name, getattr(self, name))
        if isinstance(self.measured, str) or not len(self.measured):
            raise ValueError(f"measured = {self.measured!r}: must be names of outputs")
        if len(self.measured) != len(self.noise):
            raise ValueError(f"noise: must have {len(self.measured)} numbers, one for each measured output")
        if not self.weights:
            raise ValueError("weights: must have an output and its weight")
        for number in self.noise:
            _positive("noise", number)
        for output, number in self.weights.items():
            _positive(f"weights[{output!r}]", number)

    def gains(self, A: Array, B: Array, C: Array, D: Array, names: Sequence[str]) -> tuple[Array, Array]:
        """Return the regulator's gain, shape (states,), and the observer's, shape (states, measured).

        Parameters
        ----------
        A, B, C, D : ndarray
            Of the sampled system with one input; its states are all positions, then their rates.
        names : sequence of str
            Of the outputs.

        Raises
        ------
        ValueError
            If an output is unknown, or some state is not observable by the weighted or by the measured outputs.
        """
        for argument, wanted in (("measured", self.measured), ("weights", self.weights)):
            for name in wanted:
                if name not in names:
                    raise ValueError(f"{argument}: {name!r} is not one of the outputs {', '.join(names)}")
        weight = np.diag([float(self.weights.get(name, 0.0)) for name in names])
        cost = D.T @ weight @ D + float(self.effort)
        cross = C.T @ weight @ D
        future = _riccati("weights", A, B, C.T @ weight @ C, cost, cross)
        regulator = np.linalg.solve(cost + B.T @ future @ B, B.T @ future @ A + cross.T)
        seen = C[[list(names).index(name) for name in self.measured]]
        noise = np.diag(np.square(np.asarray(self.noise, float)))
        spread = _riccati("measured", A.T, seen.T, B @ B.T * float(self.disturbance) ** 2, noise, None)
        observer = np.linalg.solve(seen @ spread @ seen.T + noise, seen @ spread).T
        _settles("weights", A - B @ regulator)
        _settles("measured", A - A @ observer @ seen)
        return np.asarray(regulator[0]), np.asarray(observer, np.float64)

    def text(self, names: Sequence[str], regulator: Array, observer: Array) -> str:
        """Return the gains as constants in the restricted form."""
        measured = [list(names).index(name) for name in self.measured]
        return (
            f"CONTROL_TIME = {float(self.time)!r}  # s, sampling time of regulator and observer\n"
            f"SENSORS = {len(measured)}  # measured outputs: {', '.join(self.measured)}\n"
            f"SENSOR_OUTPUTS = ({', '.join(map(str, measured))},)  # their numbers among the outputs\n"
            f"REGULATOR = ({numbers_of(regulator)},)  # gain on all positions, then on all rates\n"
            f"OBSERVER = ({numbers_of(observer)},)  # gain on the measured outputs, state by state\n\n\n"
        )


def numbers_of(values: Array) -> str:
    """Return the text of the entries of a row of constants."""
    return ", ".join(repr(float(x) + 0.0) for x in np.ravel(values))


def of_blocks(blocks: Blocks, time: float) -> tuple[Array, Array, Array, Array]:
    """Return the matrices of a frozen system that is sampled; its states are all positions, then their rates."""
    C = np.hstack([blocks.on_position, blocks.on_rate])
    return *sampled_matrices(blocks, time), C, blocks.through[:, None]


def sampled_matrices(blocks: Blocks, time: float) -> tuple[Array, Array]:
    """Return A and B of x(t + time) = A x + B u for a held input; x are all positions, then all rates."""
    from scipy.linalg import expm

    count = len(blocks.stiffness)
    A, B = np.zeros((2 * count, 2 * count)), np.zeros((2 * count, 1))
    for i, (k, d) in enumerate(zip(blocks.stiffness, blocks.damping, strict=True)):
        move = expm(time * np.array([[0.0, 1.0, 0.0], [-k, -d, 1.0], [0.0, 0.0, 0.0]]))
        A[np.ix_([i, count + i], [i, count + i])], B[[i, count + i], 0] = move[:2, :2], move[:2, 2]
    return A, B


def controller_checks(
    controller: Controller, matrices: tuple[Array, Array, Array, Array], gains: tuple[Array, Array], names: list[str]
) -> Iterator[tuple[tuple[float, ...], tuple[float, ...], float]]:
    """Yield input, steps, feedforward and error of the measurements, then what follows from the matrices, and its size.

    What follows is the input of the regulator, and the corrected outputs.
    """
    A, B, C, D = matrices
    regulator, observer = gains
    measured = [names.index(name) for name in controller.measured]
    x = np.zeros(len(A))
    for steps in range(9):
        error = 1e-3 * (1.0 + np.arange(len(measured))) - (C @ x + D[:, 0] * 0.25)[measured]
        y = C @ (x + observer @ error) + D[:, 0] * 0.25
        sizes = np.abs(regulator) @ np.abs(x), *(np.abs(C) @ (np.abs(x) + np.abs(observer) @ np.abs(error)))
        yield (0.25, float(steps), 0.125, 1e-3), (float(0.125 - regulator @ x), *y), float(max(sizes))
        x = A @ x + B[:, 0] * 0.25


def _riccati(name: str, A: Array, B: Array, Q: Array, R: Array, S: Array | None) -> Array:
    from scipy.linalg import solve_discrete_are

    try:
        return np.asarray(solve_discrete_are(A, B, Q, R, s=S))
    except np.linalg.LinAlgError as error:
        raise ValueError(_UNSEEN.format(name)) from error


def _settles(name: str, closed: Array) -> None:
    if not np.abs(np.linalg.eigvals(closed)).max() < 1.0 - 1e-10:  # the eigenvalue 1 of an unobserved base remains
        raise ValueError(_UNSEEN.format(name))


def _positive(name: str, value: object) -> None:
    one_number(name, value, low=0.0, open_low=True, must="in (0, inf)")
