"""Input shapers: nothing of the shaped mode is left, and ZVD is flat where ZV is not."""

import numpy as np
import pytest

import cra_sym as cra
from cra_sym import Arm, BaseMotion

MOVE = BaseMotion.trapezoid(0.5, 1.0, 2.0)


@pytest.mark.parametrize("zeta", [0.0, 0.05, 0.3])
@pytest.mark.parametrize("order", [1, 2, 3])
def test_the_shaped_mode_is_at_rest_after_the_stop(zeta, order):
    arm = Arm.nominal().replace(zeta=zeta)
    shaper = cra.input_shaper(cra.modal_parameters(arm, 1).omega[0], zeta, order)
    assert shaper[0].sum() == pytest.approx(1.0)
    before, after = (cra.residual_vibration(arm, move, modes=1) for move in (MOVE, MOVE.shaped(*shaper)))
    assert after < 1e-12 < 1e-4 < before


def test_more_derivatives_forgive_a_wrong_frequency():
    arm = Arm.nominal()
    omega = cra.modal_parameters(arm, 1).omega[0]
    ratios = []
    for order in (1, 2, 3):
        for error in (0.02, 0.04):
            shaped = MOVE.shaped(*cra.input_shaper(omega * (1 + error), order=order))
            ratios.append(cra.residual_vibration(arm, shaped, modes=1))
    orders = np.log2(np.array(ratios[1::2]) / ratios[::2])
    assert orders == pytest.approx([1, 2, 3], abs=0.1)  # relative to the first term the next is 2 to 4 %, times order


def test_two_equal_impulses_half_a_period_apart_unless_asked_for_more():
    amplitudes, times = cra.input_shaper(4.0)
    assert amplitudes == pytest.approx([0.5, 0.5]) and times == pytest.approx([0.0, np.pi / 4])
    almost_critical = cra.input_shaper(4.0, 0.99)[0]
    assert almost_critical[0] == pytest.approx(1.0, abs=1e-9)  # the first impulse's vibration dies by itself


def test_batches():
    amplitudes, times = cra.input_shaper([10.0, 20.0], [[0.0], [0.1]], order=2)
    assert amplitudes.shape == times.shape == (2, 2, 3)


@pytest.mark.parametrize(
    "arguments", [{"angular_frequency": 0.0}, {"zeta": -1e-3}, {"zeta": 1.0}, {"order": 0}, {"order": 51}]
)
def test_bad_input_is_named(arguments):
    (name,) = arguments
    with pytest.raises(ValueError, match=f"{name} = "):
        cra.input_shaper(**({"angular_frequency": 1.0} | arguments))


def residual(amplitudes, times, omega, zeta=0.0):
    """Return what impulses leave of a mode, over a single one, by adding the decaying responses at the last."""
    late = times[-1] - times
    damped = omega * np.sqrt(1 - zeta**2)
    phases = amplitudes * np.exp(-zeta * omega * late - 1j * damped * late)
    return abs(phases.sum())


@pytest.mark.parametrize("tolerance", [0.01, 0.05, 0.2])
def test_extra_insensitive_shapers_are_the_published_ones(tolerance):
    """Singhose, Seering and Singer: one hump (1994), two and three humps (1997), without damping."""
    V = tolerance
    X = np.cbrt(V**2 * (np.sqrt(1 - V**2) + 1))
    two = (3 * X**2 + 2 * X + 3 * V**2) / (16 * X)
    three = (1 + 3 * V + 2 * np.sqrt(2 * (V**2 + V))) / 16
    published = {
        1: [(1 + V) / 4, (1 - V) / 2, (1 + V) / 4],
        2: [two, 0.5 - two, 0.5 - two, two],
        3: [three, (1 - V) / 4, 1 - 2 * (three + (1 - V) / 4), (1 - V) / 4, three],
    }
    for humps, amplitudes in published.items():
        found, times = cra.input_shaper(3.0, humps=humps, tolerance=V)
        np.testing.assert_allclose(found, amplitudes, rtol=1e-12)
        np.testing.assert_allclose(times, np.pi / 3.0 * np.arange(humps + 2), rtol=1e-15)


@pytest.mark.parametrize("humps", [1, 2, 3, 6])
@pytest.mark.parametrize("zeta", [0.0, 0.02, 0.2])
def test_the_largest_residual_of_the_band_is_the_tolerance(humps, zeta):
    amplitudes, times = cra.input_shaper(5.0, zeta, humps=humps, tolerance=0.05)
    assert amplitudes.sum() == pytest.approx(1.0, rel=1e-14) and (amplitudes > 0).all()
    left = np.array([residual(amplitudes, times, 5.0 * r, zeta) for r in np.linspace(0.05, 1.95, 3801)])
    inside = np.flatnonzero(left <= 0.05 * (1 + 1e-5))
    runs = np.split(inside, np.flatnonzero(np.diff(inside) > 1) + 1)
    middle = next(run for run in runs if run[0] <= 1900 <= run[-1])
    assert left[middle].max() == pytest.approx(0.05, rel=2e-2)  # on a grid of the frequency
    peaks = [k for k in middle[1:-1] if left[k] > left[k - 1] and left[k] >= left[k + 1]]
    if not zeta:
        assert len(peaks) == humps
        np.testing.assert_allclose(left[peaks], 0.05, rtol=1e-4)
    else:
        assert left[peaks].max(initial=0.0) <= 0.05 * (1 + 1e-9)


@pytest.mark.parametrize("humps", [1, 3])
@pytest.mark.parametrize("zeta", [0.02, 0.2, 0.6])
def test_with_damping_the_largest_residual_up_to_the_ends_of_the_humps_is_the_tolerance(humps, zeta):
    """Without the decay |P| is V T_n(c s), whose middle hump, of height V, is at the frequency of the mode (n even)."""
    amplitudes, times = cra.input_shaper(5.0, zeta, humps=humps, tolerance=0.05)
    growth = np.exp(np.pi * zeta / np.sqrt(1 - zeta**2)) ** np.arange(humps + 2)
    undamped = amplitudes * growth / (amplitudes * growth).sum()
    V = residual(undamped, np.pi * np.arange(humps + 2), 1.0)
    half = 2 / np.pi * np.arcsin(1 / np.cosh(np.arccosh(1 / V) / (humps + 1)))
    left = [residual(amplitudes, times, 5.0 * r, zeta) for r in np.linspace(1 - half, 1 + half, 401)]
    # with damping the largest is at an end of the band; bisection of V ends at rounding
    assert max(left) == pytest.approx(0.05, rel=1e-10) and max(left) == max(left[0], left[-1])


def test_five_per_cent_are_left_by_default():
    assert cra.input_shaper(1.0, humps=1)[0][0] == pytest.approx((1 + 0.05) / 4, rel=1e-14)


def test_more_humps_and_tolerance_widen_the_band():
    def width(**options):
        amplitudes, times = cra.input_shaper(1.0, **options)
        ratios = np.linspace(1.0, 1.95, 2000)
        beyond = [residual(amplitudes, times, r) > 0.05 * (1 + 1e-9) for r in ratios]
        return ratios[np.argmax(beyond)] - 1

    widths = [width(), width(order=2), *(width(humps=n, tolerance=0.05) for n in (1, 2, 3))]
    assert widths == sorted(widths)
    # Singhose: insensitivity at 5 % of ZV 0.06, ZVD 0.29, EI 0.40, two humps 0.73, three 0.97 (whole width)
    np.testing.assert_allclose(2 * np.array(widths), [0.06, 0.29, 0.40, 0.73, 0.97], atol=0.01)


def test_a_shaped_move_leaves_the_tolerance_of_a_wrongly_known_arm():
    """The residual of the first mode after a shaped move, over that of the move: at the edge of the band."""
    move = cra.BaseMotion.trapezoid(0.1, 0.2, 1.0)
    arm = cra.Arm.nominal().replace(k_t=1e3)
    omega = cra.modal_parameters(arm, 1).omega[0]
    for ratio in (0.85, 1.0, 1.15):
        shaped = move.shaped(*cra.input_shaper(omega * ratio, humps=1, tolerance=0.05))
        amplitudes, times = cra.input_shaper(omega * ratio, humps=1, tolerance=0.05)
        left = cra.residual_vibration(arm, shaped, 1) / cra.residual_vibration(arm, move, 1)
        assert left == pytest.approx(residual(amplitudes, times, omega), rel=1e-9)
        assert left <= 0.05 * (1 + 1e-9)


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"humps": 11}, "humps = 11: must be an integer from 0 to 10"),
        ({"humps": 1, "tolerance": 1.0}, r"tolerance = 1.0: must be real numbers in \(0, 1\)"),
        ({"tolerance": 0.1}, "tolerance: must be left out for humps = 0"),
        ({"humps": 1, "order": 2}, "order = 2: must be 1 with humps = 1"),
    ],
)
def test_what_is_no_shaper_is_named(options, words):
    with pytest.raises(ValueError, match=words):
        cra.input_shaper(1.0, **options)
