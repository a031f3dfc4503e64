"""Motions of the driving base, (33): mean motion, harmonic disturbances, sampled records and point-to-point moves."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any, Literal

import numpy as np

from cra_sym.si import Numbers

from ..checks import broadcastable, choice, equal, flag, one_axis, real_array
from ..si import paired
from .motion_terms import Harmonic, MotionTerm, Piecewise
from .moves import check_feasible, fastest, quotient
from .records import KINDS, spline_motion, timed_last, uniform_times

__all__ = ["FASTEST", "BaseMotion", "Harmonic", "Piecewise"]

FASTEST = 1e15
"""rad/s; beyond it responses overflow."""

Array = np.ndarray


class BaseMotion:
    """Transverse motion of the driving base, w = v t + a t^2 / 2 + B sin(varpi t + psi) from t = 0 on, equation (33).

    Motions are added with ``+`` and scaled with ``*``; an array in any field always means a batch, never a sum.

    Parameters
    ----------
    velocity : float or ndarray
        Mean velocity v, m/s. A velocity at t = 0 acts as an impulse on an arm at rest.
    acceleration : float or ndarray
        Mean acceleration a, m/s2.
    amplitude, angular_frequency, phase : float or ndarray
        Disturbance: B in m, varpi in rad/s (0 to 1e15), psi in rad. The phase varpi t has a rounding error: that of
        the response of a mode of frequency omega is of the order of 1e-16 B varpi^2 t / omega.

    Raises
    ------
    TypeError, ValueError
        If a field is not made of finite real numbers or out of its range, or the arrays do not broadcast together.

    Examples
    --------
    >>> motion = BaseMotion(velocity=0.1) + BaseMotion(amplitude=1e-3, angular_frequency=10.0)
    >>> round(float(motion.velocity(0.0)), 6)
    0.11
    >>> BaseMotion.trapezoid(0.5, v_max=0.5, a_max=1.0).duration
    1.5
    """

    __array_ufunc__ = None  # an array times a motion is a batch of motions, not an array of objects
    __pandas_priority__ = 5000  # and likewise for a pandas Series
    terms: tuple[MotionTerm, ...]
    sample_step: float | None = None
    """Time between the samples of a record, s; None for other motions."""

    def __init__(
        self,
        velocity: Numbers = 0.0,
        acceleration: Numbers = 0.0,
        amplitude: Numbers = 0.0,
        angular_frequency: Numbers = 0.0,
        phase: Numbers = 0.0,
    ) -> None:
        given = {
            "velocity": velocity,
            "acceleration": acceleration,
            "amplitude": amplitude,
            "angular_frequency": angular_frequency,
            "phase": phase,
        }
        units = dict(zip(given, ("m/s", "m/s^2", "m", "rad/s", "rad"), strict=True))
        v, a, B, varpi, psi = (
            real_array(name, value, unit=units[name]) for name, value in paired(given, units).items()
        )
        varpi = real_array("angular_frequency", varpi, low=0.0, high=FASTEST)
        broadcastable(velocity=v, acceleration=a, amplitude=B, angular_frequency=varpi, phase=psi)
        with np.errstate(over="ignore", under="ignore"):
            if not np.isfinite(B * varpi**2).all():
                raise ValueError("amplitude, angular_frequency: must leave amplitude angular_frequency^2 finite")
        v, a = np.broadcast_arrays(v, a)
        terms: list[MotionTerm] = []
        if np.any(v) or np.any(a):
            terms.append(Piecewise(v, np.zeros(1), a[..., None], np.zeros_like(a)[..., None]))
        if np.any(B):
            terms.append(Harmonic(*np.broadcast_arrays(B, varpi, psi)))
        shape = np.broadcast_shapes(v.shape, B.shape, varpi.shape, psi.shape)
        self._set(terms, shape)

    def _set(self, terms: Iterable[MotionTerm], shape: tuple[int, ...]) -> BaseMotion:
        self.terms, self.shape = tuple(terms), shape
        return self

    @classmethod
    def of_terms(cls, terms: Iterable[MotionTerm], shape: tuple[int, ...]) -> BaseMotion:
        """Return the motion that is the sum of some terms, a batch of that shape."""
        return cls.__new__(cls)._set(terms, shape)

    def _like(self, terms: Iterable[MotionTerm], shape: tuple[int, ...]) -> BaseMotion:
        made = self.of_terms(terms, shape)
        made.sample_step = self.sample_step
        return made

    @classmethod
    def sampled(
        cls,
        t: Numbers,
        record: Numbers,
        velocity: Numbers = 0.0,
        *,
        kind: Literal["acceleration", "velocity", "position"] = "acceleration",
        sampling_rate: Numbers | None = None,
        exact: bool = False,
    ) -> BaseMotion:
        """Return the motion that a record of samples describes; outside the record the base does not accelerate.

        Parameters
        ----------
        t : array_like, shape (T,), or None
            Uniform increasing times from 0 or later, s, to 1 % of a step; at least two. Numbers may be rounded or of
            single precision, dates and time differences of NumPy, pandas and Python are taken too. Dates, and times
            that begin after 1e8 s, are counted from the first sample.
        record : array_like, shape (..., T)
            Samples, m/s2, m/s or m; leading axes are a batch. Of labelled times and records (xarray) the dimension of
            the times need not be the last.
        velocity : float or ndarray
            Velocity at t = 0, m/s, of a record of acceleration; the others have their own, that of the first sample.
        kind : {'acceleration', 'velocity', 'position'}
            What was sampled: acceleration and velocity are linear between the samples, position is a cubic spline
            (of at least four samples), which is measured from the first sample.
        sampling_rate : float, optional
            Samples per second, Hz, where ``t`` is None: the first sample is at t = 0.
        exact : bool
            Whether the interpolated record is the motion exactly. Otherwise responses warn if modes lie above half the
            sampling rate (`UndersamplingWarning`).

        Raises
        ------
        TypeError, ValueError
            If an argument does not hold finite real numbers, the times are not sorted, have gaps, are uneven or
            negative (the sample is named), or the shapes do not fit.

        Examples
        --------
        >>> motion = BaseMotion.sampled(None, [0.0, 0.1, 0.2, 0.2], kind="velocity", sampling_rate=10.0)
        >>> print(motion.velocity([0.05, 0.3, 9.0]))
        [0.05 0.2  0.2 ]
        """
        choice("kind", kind, KINDS)
        exact = flag("exact", exact)
        units = {"acceleration": "m/s^2", "velocity": "m/s", "position": "m"}
        samples = real_array(kind, timed_last(t, record, kind), unit=units[kind])
        if samples.ndim == 0:
            raise ValueError(f"{kind} has shape (): its last axis must have the sample times")
        v = real_array("velocity", velocity, unit="m/s")
        if kind != "acceleration" and v.any():
            raise ValueError(f"velocity: must be left out with kind = {kind!r}, which has its own")
        times = uniform_times(t, sampling_rate, samples.shape[-1], kind)
        if kind == "position" and times.size < 4:
            raise ValueError(f"position has {times.size} samples: must be at least four")
        shape = broadcastable(**{kind: samples[..., 0], "velocity": v})
        own, level, slope = spline_motion(times, samples, kind)
        motion = cls.of_terms([Piecewise(v + own, times, level, slope)], shape)
        motion.sample_step = None if exact else float((times[-1] - times[0]) / (times.size - 1))
        return motion

    @classmethod
    def trapezoid(
        cls, distance: Numbers, v_max: Numbers, a_max: Numbers, duration: Numbers | None = None
    ) -> BaseMotion:
        """Return the point-to-point move of trapezoidal velocity: the fastest within its limits, or one of given
        duration.

        Parameters
        ----------
        distance : float or ndarray
            Distance, m; negative moves backwards.
        v_max, a_max : float or ndarray
            Limits of velocity (may be infinite), m/s, and acceleration, m/s2; positive.
        duration : float or ndarray, optional
            Time of the move, s: the fastest move is slowed down uniformly to take that long.

        Raises
        ------
        TypeError, ValueError
            If an argument is out of its range, shapes do not broadcast together, the move would never end, or it cannot
            be made in that time; the error names the limits in the way.
        """
        return cls.s_curve(distance, v_max, a_max, np.inf, duration)

    @classmethod
    def s_curve(
        cls, distance: Numbers, v_max: Numbers, a_max: Numbers, j_max: Numbers, duration: Numbers | None = None
    ) -> BaseMotion:
        """Return the point-to-point move of jerk-limited (S-curve) velocity; as :meth:`trapezoid`, with a limit of
        jerk.

        Parameters
        ----------
        distance, v_max, a_max, duration
            As in :meth:`trapezoid`.
        j_max : float or ndarray
            Limit of jerk, m/s3; positive, infinite for a trapezoid.

        Raises
        ------
        TypeError, ValueError
            As :meth:`trapezoid`.
        """
        limit: dict[str, Any] = {"low": 0.0, "open_low": True}
        units = {"distance": "m", "v_max": "m/s", "a_max": "m/s^2", "j_max": "m/s^3", "duration": "s"}
        numbers = dict(zip(units, (distance, v_max, a_max, j_max, duration), strict=True))
        if duration is None:
            del numbers["duration"]
        given = {
            name: real_array(name, value, unit=units[name], allow_infinite=name in ("v_max", "j_max"),
                             **({} if name == "distance" else limit))
            for name, value in paired(numbers, units).items()
        }  # fmt: skip
        shape, wanted = broadcastable(**given), given.get("duration")
        d, v_max, a_max, j_max = (given[name] for name in ("distance", "v_max", "a_max", "j_max"))
        t_j, t_a, t_v = (np.broadcast_to(value, shape) for value in fastest(np.abs(d), v_max, a_max, j_max))
        least = 2 * (2 * t_j + t_a) + t_v
        if not np.isfinite(least).all():
            raise ValueError("v_max, a_max, j_max: the move never ends; must not be next to nothing")
        peak = quotient(d, (t_j + t_a) * (2 * t_j + t_a + t_v))
        if wanted is not None:
            check_feasible(wanted, least, {"v_max": t_v > 0, "a_max": (t_a > 0) | np.isinf(j_max), "j_max": t_j > 0})
            stretch = np.where(least > 0, wanted / np.where(least > 0, least, 1.0), 1.0)
            t_j, t_a, t_v, peak = t_j * stretch, t_a * stretch, t_v * stretch, peak / stretch**2
        spans = np.stack([t_j, t_a, t_j, t_v, t_j, t_a, t_j], -1)
        knots = np.concatenate([np.zeros((*shape, 1)), np.cumsum(spans, -1)], -1)
        level = peak[..., None] * np.array([0, 1, 1, 0, 0, -1, -1, 0])
        jerk = quotient(peak, t_j)[..., None] * np.array([1, 0, -1, 0, -1, 0, 1, 0])
        return cls.of_terms([Piecewise(np.zeros(shape), knots, level, jerk)], shape)

    def shaped(self, amplitudes: Numbers, times: Numbers) -> BaseMotion:
        """Return the motion convolved with impulses: scaled copies of it, each delayed by its time.

        Parameters
        ----------
        amplitudes, times : array_like, shape (..., impulses)
            As :func:`cra_sym.input_shaper` gives them; times in s, not negative. Leading axes are a batch.

        Raises
        ------
        TypeError, ValueError
            If the motion holds a harmonic or does not start from rest, an argument is out of its range, or the shapes
            do not fit.
        """
        A, delays = real_array("amplitudes", amplitudes, unit="1"), real_array("times", times, low=0.0, unit="s")
        if A.ndim == 0 or A.shape[-1:] != delays.shape[-1:]:
            raise ValueError(f"amplitudes {A.shape} and times {delays.shape}: must be one time for each impulse")
        if not all(isinstance(term, Piecewise) and not np.any(term.velocity) for term in self.terms):
            raise ValueError("only a motion that starts from rest and has no harmonic can be shaped")
        shape = broadcastable(motion=np.empty(self.shape), amplitudes=A[..., 0], times=delays[..., 0])
        copies = []
        for i in range(A.shape[-1]):
            for term in self.terms:
                assert isinstance(term, Piecewise)
                scale = A[..., i, None]
                copies.append(
                    Piecewise(
                        term.velocity, term.knots + delays[..., i, None], term.acceleration * scale, term.jerk * scale
                    )
                )
        return self._like(copies, shape)

    def __add__(self, other: Any) -> BaseMotion:
        """Superpose two motions; batches broadcast."""
        if not isinstance(other, BaseMotion):
            return NotImplemented
        shape = broadcastable(left=np.empty(self.shape), right=np.empty(other.shape))
        total = self.of_terms(self.terms + other.terms, shape)
        steps = [motion.sample_step for motion in (self, other) if motion.sample_step is not None]
        total.sample_step = max(steps, default=None)
        return total

    def __mul__(self, factor: Numbers) -> BaseMotion:
        """Scale the motion by real factors; an array is a batch."""
        scale = real_array("factor", factor, unit="1")
        shape = broadcastable(motion=np.empty(self.shape), factor=scale)
        terms: list[MotionTerm] = []
        for term in self.terms:
            if isinstance(term, Harmonic):
                terms.append(Harmonic(*np.broadcast_arrays(term.amplitude * scale, *term[1:])))
            else:
                v, k = scale[..., None], term.knots
                terms.append(Piecewise(term.velocity * scale, k, term.acceleration * v, term.jerk * v))
        return self._like(terms, shape)

    __rmul__ = __mul__

    def kinematics(self, t: Numbers) -> tuple[Array, Array, Array]:
        """Return displacement (m), velocity (m/s) and acceleration (m/s2) of the base at times ``t`` >= 0, shape
        (..., t).

        Raises
        ------
        TypeError, ValueError
            If ``t`` holds no real numbers, a negative one, or has more than one axis.
        """
        times = one_axis("t", t, "times", low=0.0, unit="s")
        total = [np.zeros((*self.shape, times.size)) for _ in range(3)]
        for term in self.terms:
            for i, part in enumerate(term.kinematics(np.atleast_1d(times))):
                total[i] = total[i] + part
        w, v, a = (value if times.ndim else value[..., 0] for value in total)
        return w, v, a

    def displacement(self, t: Numbers) -> Array:
        """Return w(t), m."""
        return self.kinematics(t)[0]

    def velocity(self, t: Numbers) -> Array:
        """Return w'(t), m/s, to the right of a jump."""
        return self.kinematics(t)[1]

    def acceleration(self, t: Numbers) -> Array:
        """Return w''(t), m/s2, to the right of a jump."""
        return self.kinematics(t)[2]

    @property
    def duration(self) -> Any:
        """Time after which the base does not accelerate any more, s; infinite if it always does."""
        longest = np.zeros(self.shape)
        for term in self.terms:
            longest = np.maximum(longest, term.duration)
        return longest if longest.ndim else float(longest)

    def __getitem__(self, index: Any) -> BaseMotion:
        """Return one of a batch, or some."""
        if not self.shape:
            raise TypeError("a single motion has no batch axis")
        terms = [term.picked(self.shape, index) for term in self.terms]
        return self._like(terms, np.empty(self.shape)[index].shape)

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, BaseMotion):
            return NotImplemented
        return self.shape == other.shape and equal(self.terms, other.terms)

    def __hash__(self) -> int:
        return hash((self.shape, tuple(type(term) for term in self.terms)))

    def __repr__(self) -> str:
        kinds = ", ".join(type(term).__name__.lower() for term in self.terms) or "at rest"
        return f"<BaseMotion of shape {self.shape}: {kinds}>"
