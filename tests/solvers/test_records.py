"""Sampled records in the forms that files have: times, rates, what was sampled, gaps, and long ones against lsim."""

import warnings
from datetime import UTC, datetime, timedelta

import numpy as np
import pytest
import sympy as sp

import cra_sym as cra
from cra_sym import BaseMotion, Force, symbols
from cra_sym.analysis.responses import UndersamplingWarning
from cra_sym.solvers import modal_response

RATE, COUNT = 1024.0, 2049
EXACT = np.arange(COUNT) / RATE
SAMPLES = np.sin(7.0 * EXACT) * np.exp(-EXACT)
ARM = cra.Arm.nominal().replace(k_t=1e4, k_r=1e3, zeta=0.01)
EPOCH = 1_764_000_000.0

FORMS = {
    "float32": EXACT.astype(np.float32),
    "six decimals": np.round(EXACT, 6),
    "seven significant digits": np.array([float(f"{time:.7g}") for time in EXACT]),
    "list": EXACT.tolist(),
    "epoch seconds": EPOCH + EXACT,
    "epoch milliseconds as dates": np.datetime64("2026-11-30T10:00:00") + (1e9 * EXACT).astype("timedelta64[ns]"),
    "time differences": (1e9 * EXACT).astype("timedelta64[ns]"),
    "timedelta": [timedelta(seconds=time) for time in EXACT],
    "dates of Python": [datetime(2026, 11, 30) + timedelta(seconds=time) for time in EXACT],
    "dates with a zone": np.array([datetime(2026, 11, 30, tzinfo=UTC) + timedelta(seconds=time) for time in EXACT]),
}  # fmt: skip


@pytest.mark.parametrize("form", FORMS)
def test_times_are_taken_in_any_common_form(form):
    """The grid is that of the exact times: to the rounding of the numbers given, a hundredth of a step at most."""
    motion = BaseMotion.sampled(FORMS[form], SAMPLES)
    np.testing.assert_allclose(motion.terms[0].knots, EXACT, atol=0.01 / RATE)
    assert motion.sample_step == pytest.approx(1 / RATE, rel=1e-5)
    expected = cra.tip_response(ARM, BaseMotion.sampled(EXACT, SAMPLES), EXACT[::8])
    # a time off by a hundredth of a step moves a mode of omega by omega times that: 1.2 % of the fifth's amplitude
    found = cra.tip_response(ARM, motion, motion.terms[0].knots[::8])
    np.testing.assert_allclose(found, expected, atol=1e-3 * np.abs(expected).max())


def tables():
    """Times and records as pandas and xarray hold them, and as plain arrays."""
    pandas = pytest.importorskip("pandas", reason="the extra 'scale' brings pandas")
    xarray = pytest.importorskip("xarray", reason="the extra 'scale' brings xarray")
    dates = pandas.to_datetime(np.datetime64("2026-11-30") + (1e9 * EXACT).astype("timedelta64[ns]"))
    both = xarray.DataArray(np.stack([SAMPLES, 2 * SAMPLES], -1), dims=("time", "axis"))
    return pandas, {
        "series": (pandas.Series(EXACT), pandas.Series(SAMPLES)),
        "dates": (pandas.Series(dates), pandas.Series(SAMPLES)),
        "dates with a zone": (dates.tz_localize("Europe/Berlin"), SAMPLES),
        "a series of such": (pandas.Series(dates.tz_localize("UTC")), SAMPLES),
        "time differences": (pandas.Series(dates - dates[0]), SAMPLES),
        "labelled, the times first": (xarray.DataArray(EXACT, dims="time"), both),
    }


def test_tables_are_records_and_pair_by_their_names():
    pandas, given = tables()
    times = EXACT[:50]
    for name, (t, record) in given.items():
        motion = BaseMotion.sampled(t, record)
        assert motion.shape == ((2,) if "labelled" in name else ()), name
        found = motion.acceleration(times)
        # dates tell nanoseconds: of a step of 1e-3 s a millionth
        np.testing.assert_allclose(found[0] if motion.shape else found, SAMPLES[:50], atol=1e-4, err_msg=name)
    with pytest.raises(ValueError, match="acceleration: its index is not that of t"):
        BaseMotion.sampled(pandas.Series(EXACT), pandas.Series(SAMPLES, index=np.arange(1, COUNT + 1)))
    with pytest.raises(ValueError, match=r"force has the dimensions \('time', 'axis'\): must have that of t, 's'"):
        Force.sampled(given["labelled, the times first"][0].rename(time="s"), given["labelled, the times first"][1])
    with pytest.raises(TypeError, match=r"t = .*must be dates of one kind"):
        BaseMotion.sampled([datetime(2026, 11, 30), datetime(2026, 11, 30, tzinfo=UTC)], [0.0, 1.0])


def test_times_of_single_precision_that_cannot_tell_the_steps_ask_for_the_rate():
    with pytest.raises(ValueError, match=r"t\[1\] = 20000 is t\[0\]: .*give sampling_rate instead"):
        BaseMotion.sampled((20_000.0 + EXACT).astype(np.float32), SAMPLES)


@pytest.mark.parametrize("rate", [RATE, np.float32(RATE), 1024])
def test_a_sampling_rate_stands_for_times(rate):
    assert BaseMotion.sampled(None, SAMPLES, sampling_rate=rate) == BaseMotion.sampled(EXACT, SAMPLES)
    assert Force.sampled(None, SAMPLES, sampling_rate=rate) == Force.sampled(EXACT, SAMPLES)


def test_two_samples_are_a_record():
    assert BaseMotion.sampled(None, [1.0, 2.0], sampling_rate=4.0).kinematics(0.125)[2] == 1.5


def broken(change):
    times = EXACT.copy()
    change(times)
    return times


def gap(times):
    times[17:] += 3 / RATE


def jitter(times):
    times[17] += 0.2 / RATE


def swapped(times):
    times[[17, 18]] = times[[18, 17]]


def doubled(times):
    times[17] = times[16]


def two_rates(times):
    times[17:] = times[16] + 1.2 * (times[17:] - times[16])


def drifting(times):
    times *= 1 + 1e-3 * times


def milliseconds(times):
    times[:] = 1.7e12 + 1e3 * times


def days(times):
    times[:] = 45000 + times / 86400


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (gap, r"t\[17\] = .* is .* s after t\[16\]: .*about 3 samples are missing there; fill the gap"),
        (jitter, r"t\[17\] = .*must be uniform, .*; the step before it is .*; resample"),
        (swapped, r"t\[18\] = .* after .*: sample times must increase"),
        (doubled, r"t\[17\] = .* after .*: sample times must increase"),
        (two_rates, r"t\[\d+\] = .*must be uniform"),
        (drifting, r"t\[\d+\] = .*their step changes slowly: this one is .* s from the mean step"),
        (milliseconds, r"t\[0\] = 1\.7e\+12: must be in seconds; divide by 1e3"),
        (days, r"t\[0\] = 45000 with samples 1\.1e-08 apart: must be in seconds; multiply days by 86400"),
    ],
)
def test_what_is_wrong_with_times_is_named_with_the_sample(change, message):
    with pytest.raises(ValueError, match=message):
        BaseMotion.sampled(broken(change), SAMPLES)


@pytest.mark.parametrize(
    ("arguments", "options", "error", "message"),
    [
        ((None, SAMPLES), {}, TypeError, "t, sampling_rate: must be one of the two"),
        ((EXACT, SAMPLES), {"sampling_rate": 1.0}, TypeError, "must be one of the two"),
        ((None, SAMPLES), {"sampling_rate": 0.0}, ValueError, r"sampling_rate = 0\.0: must be"),
        ((None, SAMPLES), {"sampling_rate": [1.0, 2.0]}, ValueError, "sampling_rate has shape"),
        ((None, [1.0]), {"sampling_rate": 1.0}, ValueError, "acceleration has 1 samples"),
        ((["2026-01-01", "2026-01-02"], [0, 1]), {}, TypeError, "must be numbers or dates, as numpy.asarray"),
        ((EXACT, SAMPLES.astype(str)), {}, TypeError, "not text; convert it to numbers first"),
        ((EXACT, SAMPLES), {"kind": "jerk"}, ValueError, "kind = 'jerk': must be one of acceleration, velocity"),
        ((EXACT, SAMPLES, 1.0), {"kind": "velocity"}, ValueError, "velocity: must be left out"),
        (([0, 1, 2], [0, 1, 2]), {"kind": "position"}, ValueError, "position has 3 samples: must be at least four"),
        ((EXACT, SAMPLES[:-1]), {"kind": "position"}, ValueError, "position has 2048 samples: .* the 2049 sample"),
        ((EXACT, np.where(EXACT == EXACT[17], np.nan, SAMPLES)), {}, ValueError, r"acceleration\[17\] = nan"),
        ((np.array(["NaT", "2026-01-01"], "M8[s]"), [0, 1]), {}, ValueError, r"t\[0\] is not a time"),
        ((np.ma.masked_array(EXACT, EXACT == EXACT[17]), SAMPLES), {}, TypeError, "t: element 17 is masked"),
    ],
)
def test_bad_records_name_the_argument(arguments, options, error, message):
    with pytest.raises(error, match=message):
        BaseMotion.sampled(*arguments, **options)


# What was sampled -------------------------------------------------------------------------------------------------


def whole(t):
    """Position, velocity and acceleration of a smooth move."""
    return 0.1 * (1 - np.cos(3.0 * t)), 0.3 * np.sin(3.0 * t), 0.9 * np.cos(3.0 * t)


@pytest.mark.parametrize(
    ("kind", "order"), [("acceleration", 2), ("velocity", 2), ("position", 2)]
)  # the acceleration is linear between samples, or the velocity: both are off by the second power of the step
def test_records_of_every_kind_describe_the_same_motion(kind, order):
    errors = []
    for count in (101, 201):
        t = np.linspace(0.0, 2.0, count)
        record = whole(t)[("position", "velocity", "acceleration").index(kind)]
        motion = BaseMotion.sampled(t, record, kind=kind)
        middle = np.linspace(0.013, 1.977, 400)
        found = motion.kinematics(middle)[1 if kind == "velocity" else 2]
        errors.append(np.max(np.abs(found - whole(middle)[1 if kind == "velocity" else 2])))
    assert np.log2(errors[0] / errors[1]) == pytest.approx(order, abs=0.2)


@pytest.mark.parametrize("kind", ["velocity", "position"])
def test_a_record_is_met_at_its_samples(kind):
    t = np.linspace(0.0, 2.0, 101)
    motion = BaseMotion.sampled(t, np.stack([whole(t)[0], 2.0 * whole(t)[1]]), kind=kind)
    found = motion.kinematics(t[:-1])[0 if kind == "position" else 1]
    expected = np.stack([whole(t)[0], 2.0 * whole(t)[1]])[:, :-1]
    np.testing.assert_allclose(found, expected - (expected[:, :1] if kind == "position" else 0.0), atol=1e-12)


def test_a_velocity_record_drives_as_its_derivative():
    """Linear velocity is piecewise constant acceleration: against the sum of steps of acceleration."""
    t = np.array([0.0, 0.5, 1.0, 1.5])
    velocity = np.array([0.1, 0.4, -0.2, 0.0])
    steps = np.diff(velocity) / 0.5
    later = np.linspace(0.0, 3.0, 31)
    expected = cra.tip_response(ARM, BaseMotion(velocity=0.1), later)
    previous = 0.0
    for start, step in zip(t, [*steps, 0.0], strict=True):
        pushed = cra.tip_response(ARM, BaseMotion(acceleration=step - previous), np.maximum(later - start, 0.0))
        expected = expected + np.where(later >= start, pushed, 0.0)
        previous = step
    found = cra.tip_response(ARM, BaseMotion.sampled(t, velocity, kind="velocity", exact=True), later)
    # sums of responses that cancel: rounding of the largest
    np.testing.assert_allclose(found, expected, atol=1e-12)


# Sampling and modes -----------------------------------------------------------------------------------------------


def test_modes_above_half_the_sampling_rate_are_said():
    t = np.arange(64) / 100.0
    motion = BaseMotion.sampled(t, np.sin(t))
    with pytest.warns(UndersamplingWarning, match="sampled at 100 Hz .*: mode 4 has .*fewer than 4 modes") as caught:
        cra.tip_response(ARM, 2.0 * motion + BaseMotion(velocity=0.1), t)
    assert caught[0].filename == __file__
    with pytest.warns(UndersamplingWarning):
        cra.residual_vibration(ARM, motion)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        cra.tip_response(ARM, motion, t, modes=3)


@pytest.mark.parametrize("samples", [2, 20, 31, 32])
@pytest.mark.parametrize("kind", ["acceleration", "velocity"])
def test_a_record_of_few_samples_is_undersampled_too_unless_it_is_the_motion(samples, kind):
    t = np.arange(samples) / 100.0
    with pytest.warns(UndersamplingWarning, match="sampled at 100 Hz"):
        cra.tip_response(ARM, BaseMotion.sampled(t, np.cos(t), kind=kind), 1.0)
    with pytest.warns(UndersamplingWarning):
        cra.tip_response(ARM, np.ones(2) * BaseMotion.sampled(t, np.cos(t), kind=kind), 1.0)
    corners = BaseMotion.sampled(t, np.cos(t), kind=kind, exact=True)
    assert corners == BaseMotion.sampled(t, np.cos(t), kind=kind)  # the same motion
    cra.tip_response(ARM, corners + 2.0 * corners, 1.0)


def test_a_sampled_force_and_a_nonlinear_system_tell_it_too():
    from tests.systems import system

    given, t = system("beam with an interior mass"), np.arange(8) / 100.0
    still = cra.BaseMotion()
    with pytest.warns(UndersamplingWarning, match="sampled at 100 Hz"):
        cra.tip_response(given, {"w": still, "p": Force.sampled(t, np.cos(t))}, 0.1, 6)
    cra.tip_response(given, {"w": still, "p": Force.sampled(t, np.cos(t), exact=True)}, 0.1, 6)
    _, left, _ = cra.paper_lagrangian()
    k_3 = sp.Symbol("k_3")
    hardening = ARM.model.replace(left=left - k_3 * symbols.v**4 / 4).at({**ARM.values, "k_3": 1e9})
    with pytest.warns(UndersamplingWarning, match="sampled at 100 Hz"):
        cra.tip_response(hardening, BaseMotion.sampled(t, 1e-3 * np.cos(t)), 0.01)
    with pytest.raises(TypeError, match="exact = 1: must be True or False"):
        BaseMotion.sampled(t, t, exact=1)


# Long records -----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("count", [65, 66, 100, 1000, 1025])
@pytest.mark.parametrize("arm", [ARM, ARM.replace(zeta=0.0, k_t=0.0), ARM.replace(zeta=[0.0, 0.9])], ids=str)
@pytest.mark.parametrize("derivative", [0, 1, 2])
def test_long_records_are_followed_as_short_ones(count, arm, derivative, monkeypatch):
    """The same record sample by sample, and at times between the samples."""
    t = np.arange(count) / 200.0
    rng = np.random.default_rng(count)
    motion = BaseMotion.sampled(t, rng.normal(size=(2, 1, count)), velocity=[[0.1], [0.2]])
    times = np.concatenate([t, t[:-1] + 1.3e-3, t[-1] + t])
    found = [cra.tip_response(arm, motion, moments, 3, derivative) for moments in (t, times)]
    monkeypatch.setattr(modal_response, "_LONG", 10**9)
    expected = [cra.tip_response(arm, motion, moments, 3, derivative) for moments in (t, times)]
    for one, other in zip(found, expected, strict=True):
        # rounding of as many steps as there are, each of the size of the state
        np.testing.assert_allclose(one, other, atol=1e-15 * count * np.abs(other).max(), rtol=1e-12)


def test_a_long_record_is_answered_as_lsim_does():
    from scipy.signal import lsim

    t = np.arange(5000) / 1000.0
    record = np.random.default_rng(3).normal(size=t.size)
    found = cra.tip_response(ARM, BaseMotion.sampled(t, record), t, 5)
    _, expected, _ = lsim(cra.state_space(ARM, 5), record, t)
    # lsim takes powers of one matrix exponential, whose rounding grows with the number of steps
    np.testing.assert_allclose(found, expected, atol=1e-9 * np.abs(expected).max())
