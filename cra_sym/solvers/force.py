"""Force histories: constant, harmonic, sampled, in the form of the acceleration of a motion."""

from __future__ import annotations

from typing import Any

import numpy as np

from ..checks import broadcastable, real_array
from ..si import Numbers, paired
from .motion import FASTEST, BaseMotion
from .records import timed_last

__all__ = ["Force"]

_UNITS = "N or N m or N/m"  # on a displacement, on a rotation, distributed


class Force:
    """History of a force, F = level + amplitude sin(angular_frequency t + phase) from t = 0 on.

    Forces are added with ``+``; an array in any field means a batch.

    Parameters
    ----------
    level, amplitude : float or ndarray
        N (or the unit of the generalised force).
    angular_frequency, phase : float or ndarray
        rad/s, 0 to 1e15, and rad.

    Raises
    ------
    TypeError, ValueError
        If a field is not made of finite real numbers or out of its range, the square of angular_frequency is too small
        or too large to divide the amplitude by, or the arrays do not broadcast together.

    Examples
    --------
    >>> step = Force(2.0) + Force(amplitude=1.0, angular_frequency=3.0)
    >>> float(step(0.0))
    2.0
    """

    profile: BaseMotion
    """Motion whose acceleration equals the force."""

    def __init__(
        self, level: Numbers = 0.0, amplitude: Numbers = 0.0, angular_frequency: Numbers = 0.0, phase: Numbers = 0.0
    ) -> None:
        units = {"level": _UNITS, "amplitude": _UNITS, "angular_frequency": "rad/s", "phase": "rad"}
        numbers = paired(dict(zip(units, (level, amplitude, angular_frequency, phase), strict=True)), units)
        constant, size, varpi, psi = (real_array(name, value, unit=units[name]) for name, value in numbers.items())
        varpi = real_array("angular_frequency", varpi, low=0.0, high=FASTEST)
        broadcastable(level=constant, amplitude=size, angular_frequency=varpi, phase=psi)
        constant = constant + np.where(varpi == 0.0, size * np.sin(psi), 0.0)
        with np.errstate(all="ignore"):
            way = np.where(varpi == 0.0, 0.0, -size / np.where(varpi == 0.0, 1.0, varpi) ** 2)
        if not np.isfinite(way).all() or ((way == 0.0) & (size != 0.0) & (varpi != 0.0)).any():
            raise ValueError(f"angular_frequency = {angular_frequency!r}: too small or too large to compute with")
        size = way
        self.profile = BaseMotion(acceleration=constant, amplitude=size, angular_frequency=varpi, phase=psi)

    @classmethod
    def sampled(cls, t: Numbers, force: Numbers, *, sampling_rate: Numbers | None = None, exact: bool = False) -> Force:
        """Return a sampled force, linear between uniform times and zero outside the record; shape (..., T).

        Times or a sampling rate, and ``exact``, as :meth:`BaseMotion.sampled` takes them.

        Raises
        ------
        TypeError, ValueError
            As :meth:`BaseMotion.sampled`.
        """
        history = cls()
        samples = real_array("force", timed_last(t, force, "force"), unit=_UNITS)
        history.profile = BaseMotion.sampled(t, samples, sampling_rate=sampling_rate, exact=exact)
        return history

    def __call__(self, t: Numbers) -> Any:
        """Return the force at times ``t`` >= 0, shape (..., t).

        Raises
        ------
        TypeError, ValueError
            If ``t`` holds no real numbers, a negative one, or has more than one axis.
        """
        return self.profile.acceleration(t)

    def __add__(self, other: Any) -> Force:
        """Superpose two forces; batches broadcast."""
        if not isinstance(other, Force):
            return NotImplemented
        total = Force()
        total.profile = self.profile + other.profile
        return total

    @property
    def shape(self) -> tuple[int, ...]:
        """Batch shape."""
        return self.profile.shape

    def __getitem__(self, index: Any) -> Force:
        """Return one of a batch, or some."""
        chosen = Force()
        chosen.profile = self.profile[index]
        return chosen

    def __eq__(self, other: object) -> bool:
        return self.profile == other.profile if isinstance(other, Force) else NotImplemented

    def __hash__(self) -> int:
        return hash((Force, self.profile))

    def __repr__(self) -> str:
        return f"<Force of shape {self.profile.shape}>"
