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
