"""Linear systems with named states: a scipy StateSpace with exact discretisation and export to python-control."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import expm
from scipy.signal import StateSpace, dlti, lti

from ..checks import equal, one_number
from ..extras import require

if TYPE_CHECKING:
    import control

__all__ = ["DiscreteSystem", "LinearSystem", "NamedSystem"]

Array = NDArray[np.float64]


class NamedSystem(StateSpace):  # type: ignore[misc]
    """A :class:`scipy.signal.StateSpace` whose states, inputs and outputs have names.

    Parameters
    ----------
    A, B, C, D : ndarray
    states, inputs, outputs : sequence of str
        Names, as many as the matrices have states, inputs and outputs.
    dt : float, optional
        Step of a discrete system, s.

    Attributes
    ----------
    state_names, input_names, output_names : tuple of str
        ``inputs`` and ``outputs`` are the numbers of these, as in SciPy.
    """

    def __init__(
        self,
        A: Array,
        B: Array,
        C: Array,
        D: Array,
        states: Sequence[str],
        inputs: Sequence[str],
        outputs: Sequence[str],
        **dt: float,
    ) -> None:
        super().__init__(A, B, C, D, **dt)
        self.state_names, self.input_names, self.output_names = tuple(states), tuple(inputs), tuple(outputs)

    @property
    def _names(self) -> tuple[tuple[str, ...], ...]:
        return self.state_names, self.input_names, self.output_names

    def _key(self) -> tuple[Any, ...]:
        return self.A, self.B, self.C, self.D, self.dt, self._names

    def __eq__(self, other: object) -> bool:
        return equal(self._key(), other._key()) if isinstance(other, NamedSystem) else NotImplemented

    def __hash__(self) -> int:
        return hash((self.dt, self._names))

    def to_control(self) -> control.StateSpace:
        """Return the system as one of python-control, names and step kept.

        python-control allows no dot in a name: ``v(0.3)`` is ``v(0_3)`` there.

        Returns
        -------
        control.StateSpace

        Raises
        ------
        MissingExtraError
            If python-control, from the extra ``control``, is not installed.
        """
        states, inputs, outputs = ([name.replace(".", "_") for name in names] for names in self._names)
        step = 0.0 if self.dt is None else self.dt
        made: control.StateSpace = require("control", "control").ss(
            self.A, self.B, self.C, self.D, step, states=states, inputs=inputs, outputs=outputs
        )
        return made


class DiscreteSystem(NamedSystem, dlti):  # type: ignore[misc]
    """A linear system from sample to sample of a step ``dt``, with names of its states, inputs and outputs."""


class LinearSystem(NamedSystem, lti):  # type: ignore[misc]
    """A linear system, continuous in time, with names of its states, inputs and outputs."""

    def discrete(self, dt: float) -> DiscreteSystem:
        """Return the system from sample to sample, exact for an input held between the samples.

        The exponential of the states and the input together, over one step.

        Parameters
        ----------
        dt : float
            Time between the samples, s; positive.

        Returns
        -------
        DiscreteSystem
            The outputs at the samples; of one that follows the input directly, the value with the input of that sample.

        Raises
        ------
        TypeError, ValueError
            If ``dt`` is not a positive number.

        Examples
        --------
        >>> from cra_sym import Arm, state_space
        >>> held = state_space(Arm.nominal(), modes=2).discrete(1e-3)
        >>> held.A.shape, held.dt, held.output_names
        ((4, 4), 0.001, ('v',))
        """
        step = one_number("dt", dt, low=0.0, open_low=True, unit="s")
        size, inputs = self.B.shape
        whole = np.zeros((size + inputs, size + inputs))
        whole[:size, :size], whole[:size, size:] = self.A, self.B
        moved = expm(whole * step)[:size]
        return DiscreteSystem(moved[:, :size], moved[:, size:], self.C, self.D, *self._names, dt=step)
