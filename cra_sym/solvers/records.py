"""Sampled records: sample times in any common form, and interpolation between the samples."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..checks import one_number, real_array, shown
from ..si import check_rows, dimensions

__all__ = ["KINDS", "spline_motion", "timed_last", "uniform_times"]

Array = NDArray[np.float64]
KINDS = ("acceleration", "velocity", "position")
_CLOCK = 1e8  # s, three years: times that begin later are clock times
_LAST = 1e11  # s, three thousand years: later times are not seconds of any calendar
_LATE, _DAYS = 1e4, 2e11  # s; first time over the step of a record whose times are days
_UNEVEN = 0.01  # of a step
_SLOWEST, _FASTEST = 1e-12, 1e12  # samples per second


def uniform_times(t: Any, sampling_rate: Any, number: int, name: str) -> Array:
    """Return the times of the samples on an exactly uniform grid.

    Parameters
    ----------
    t : array_like or None
        Times, s: numbers of any precision, or NumPy's dates and time differences. They are counted from the first
        sample if they are dates or begin after 1e8 s.
    sampling_rate : float or None
        Samples per second, Hz, instead of times; the first sample is at 0.
    number : int
        Samples in the record.
    name : str
        Name of the record, used in errors.

    Raises
    ------
    TypeError, ValueError
        Names the sample at which times do not increase, are missing or uneven.
    """
    if (t is None) == (sampling_rate is None):
        raise TypeError("t, sampling_rate: must be one of the two")
    if t is None:
        rate = one_number("sampling_rate", sampling_rate, low=_SLOWEST, high=_FASTEST, unit="Hz")
        return _enough(np.arange(number) / rate, name)
    times, resolution = _seconds(t)
    if times.ndim != 1 or times.size < 2:
        raise ValueError(f"t has shape {times.shape}: must be one axis of at least two sample times")
    if times.size != number:
        raise ValueError(f"{name} has {number} samples: its last axis must have the {times.size} sample times")
    return _gridded(times, resolution)


def timed_last(t: Any, record: Any, name: str) -> Any:
    """Return a record with the dimension of the times as its last one, where both have names.

    Raises
    ------
    ValueError
        If the record has other dimensions, or other rows.
    """
    check_rows({"t": t, name: record})
    times, found = dimensions(t), dimensions(record)
    if not times or not found:
        return record
    if times[0] not in found:
        raise ValueError(f"{name} has the dimensions {found}: must have that of t, {times[0]!r}")
    return record.transpose(*(one for one in found if one != times[0]), times[0])


def _enough(times: Array, name: str) -> Array:
    if times.size < 2:
        raise ValueError(f"{name} has {times.size} samples: must be at least two")
    return times


def _seconds(t: Any) -> tuple[Array, float]:
    """Return times in seconds, and their resolution."""
    if hasattr(getattr(t, "dtype", None), "tz"):  # of pandas
        given = np.asarray(t, dtype=f"M8[{t.dtype.unit}]")
    elif isinstance(t, (list, tuple)) or hasattr(type(t), "dimensionality"):  # of Pint: no array without its unit
        given = t
    else:
        given = np.asarray(getattr(t, "values", t))
    first = given[0] if len(np.shape(given)) == 1 and len(given) else None
    if isinstance(first, (str, bytes)):
        raise TypeError(f"t = {shown(t)}: must be numbers or dates, as numpy.asarray(t, 'M8[ns]') makes of text")
    if hasattr(first, "timestamp"):  # dates of Python
        try:
            return np.array([(one - given[0]).total_seconds() for one in given]), 1e-6
        except (AttributeError, TypeError) as error:
            raise TypeError(f"t = {shown(t)}: must be dates of one kind") from error
    if isinstance(given, np.ndarray) and given.dtype.kind == "M":
        if np.isnat(given).any():
            raise ValueError(f"t[{int(np.argmax(np.isnat(given).ravel()))}] is not a time (NaT)")
        one = np.ones(1, given.dtype.str.replace("M8", "m8"))  # what the clock tells
        return (given - given.ravel()[0]) / np.timedelta64(1, "s"), float((one / np.timedelta64(1, "s"))[0])
    times = real_array("t", t, low=0.0, unit="s")
    eps = np.finfo(np.float64).eps
    if isinstance(given, np.ndarray) and given.dtype.kind == "f":
        eps = np.spacing(given.dtype.type(1))
    resolution = float(eps) * float(np.max(np.abs(times), initial=0.0))
    if times.ndim and times.size and times.ravel()[0] > _LAST:
        raise ValueError(f"t[0] = {times.ravel()[0]:g}: must be in seconds; divide by 1e3 if these are milliseconds")
    if times.ndim and times.size and times.ravel()[0] > _CLOCK:
        times = times - times.ravel()[0]
    return times, resolution


def _gridded(times: Array, resolution: float) -> Array:
    span = np.diff(times)
    if not np.all(span > 0):
        at = int(np.argmin(span > 0))
        if span[at] == 0 and resolution > 0.1 * np.median(span):
            raise ValueError(
                f"t[{at + 1}] = {times[at + 1]:g} is t[{at}]: the numbers tell times to {resolution:.2g} s only; "
                "give sampling_rate instead"
            )
        cure = "; where they are rounded, give sampling_rate instead" if span[at] == 0 else ""
        raise ValueError(f"t[{at + 1}] = {times[at + 1]:g} after {times[at]:g}: sample times must increase{cure}")
    step = float(np.sort(span)[(span.size - 1) // 2])
    if times[0] > max(_LATE, _DAYS * step):
        raise ValueError(
            f"t[0] = {times[0]:g} with samples {step:.2g} apart: must be in seconds; multiply days by 86400, or "
            "count from the first sample"
        )
    slack = _UNEVEN * step + resolution
    gap = np.flatnonzero(span > 1.5 * step + slack)
    if gap.size:
        at = int(gap[0])
        raise ValueError(
            f"t[{at + 1}] = {times[at + 1]:g} is {span[at]:g} s after t[{at}]: sample times must be uniform, and about "
            f"{round(span[at] / step) - 1} samples are missing there; fill the gap, or split the record"
        )
    count = np.arange(times.size)
    middle = count - count.mean()
    step = float(middle @ (times - times.mean()) / (middle @ middle))  # least squares: rounding averages out
    grid = times.mean() + step * middle
    off = np.abs(times - grid)
    if np.any(off > slack):
        # the first step that differs, or where a drift is largest
        uneven = np.flatnonzero(np.abs(span - step) > slack)
        if not uneven.size:
            at = int(np.argmax(off))
            raise ValueError(
                f"t[{at}] = {times[at]:g}: sample times must be uniform, and their step changes slowly: this one is "
                f"{off[at]:.2g} s from the mean step of {step:g} s; resample the record"
            )
        at = int(uneven[0]) + 1
        raise ValueError(
            f"t[{at}] = {times[at]:g}: sample times must be uniform, {step:g} s apart to 1 %; the step before it is "
            f"{span[max(at - 1, 0)]:g} s; resample the record"
        )
    exact = times[0] + (times[-1] - times[0]) / (times.size - 1) * count
    fits = np.max(np.abs(times - exact)) <= 4 * np.finfo(float).eps * np.max(np.abs(times))
    return exact if fits else np.asarray(np.maximum(grid[0], 0.0) + step * count)


def spline_motion(times: Array, record: Array, kind: str) -> tuple[Array, Array, Array]:
    """Return initial velocity (...), acceleration (..., T) and jerk (..., T) from the samples of a motion.

    Between samples the acceleration is linear for a record of acceleration, the velocity linear for one of velocity,
    the position a cubic spline for one of position; after the last sample the base does not accelerate.
    """
    span = np.diff(times)
    none = np.zeros_like(record[..., :1])
    if kind == "acceleration":
        level, slope = record[..., :-1], np.diff(record) / span
        velocity = np.zeros(record.shape[:-1])
    elif kind == "velocity":
        level, velocity = np.diff(record) / span, record[..., 0]
        slope = np.zeros_like(level)
    else:
        from scipy.interpolate import CubicSpline

        spline = CubicSpline(times, record, axis=-1)
        bend = spline(times, 2)
        level, slope = bend[..., :-1], np.diff(bend) / span
        velocity = spline(times[0], 1)
    return velocity, np.concatenate([level, none], -1), np.concatenate([slope, none], -1)
