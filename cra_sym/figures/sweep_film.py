"""The jump, as SVG that moves by itself: an arm on a fluctuating joint while its frequency is swept up and down."""

from __future__ import annotations

import numpy as np

from cra_sym.analysis.modes import mode_shapes
from cra_sym.analysis.stability import stability_boundary
from cra_sym.analysis.steady_states import steady_states
from cra_sym.arm.excitations import JointStiffness
from cra_sym.arm.parameters import Arm
from cra_sym.figures.animation import curve, document, film, moved
from cra_sym.figures.nonlinear import cubic_joint, swept
from cra_sym.figures.subject import arm_or_nominal

__all__ = ["jumping_arm"]

_UP, _DOWN, _GREY = ("#0072B2", ""), ("#D55E00", ' stroke-dasharray="7 3"'), ("#aaa", "")
_SECONDS, _SWINGS = 12.0, 3  # frames of the animation; frames per step of the sweep
_LEFT, _WIDE, _LOW, _HIGH = 330, 350, 230, 170  # of the chart, pixels


def jumping_arm(
    arm: Arm | None = None,
    *,
    k_3: float = 1e9,
    epsilon: float = 0.3,
    mode: int = 2,
    zeta: float = 1e-3,
    points: int = 25,
) -> str:
    """Show an arm whose joint fluctuates while the frequency is swept up through a zone of instability, and down again.

    Left: the arm, whose vibration is that of the stable solution nearest to the last one, in the shape of the mode.
    Right: where the sweep is (solid: upwards, dashed: downwards) and the zone in which the arm cannot stay at rest.

    Parameters
    ----------
    arm : Arm, optional
        Default: the nominal one with k_t = 1000 N/m.
    k_3 : float
        Cubic stiffness of the joint, N/m3.
    epsilon : float
        Of the fluctuation of k_t.
    mode : int
        Whose principal zone, from 1.
    zeta : float
        Modal damping ratio.
    points : int
        Frequencies of the sweep.

    Returns
    -------
    str
        An SVG document.
    """
    arm = arm_or_nominal(arm, k_t=1e3)
    excitation = JointStiffness(k_t=1.0)
    lower, upper = (float(side) for side in stability_boundary(arm, excitation, epsilon, (mode, mode)))
    frequency = np.linspace(lower - (upper - lower) / 2, upper + (upper - lower), points)
    answers = steady_states(
        cubic_joint(arm, k_3, zeta),
        frequency,
        excitation=excitation,
        epsilon=epsilon,
        modes=mode,
        harmonics=5,
        period=2,
    )
    ways = swept(answers), swept(answers[::-1])
    amplitude, place = np.concatenate(ways), np.concatenate([frequency, frequency[::-1]])
    x = np.linspace(0.0, float(np.max(arm.L)), 21)
    shape = mode_shapes(arm, x, mode)[mode - 1]
    return document(
        "jumping-arm",
        270,
        [
            _swinging(x, shape / np.abs(shape).max(), amplitude),
            _chart(frequency, ways, (lower, upper), place, amplitude),
        ],
    )


def _swinging(x: np.ndarray, shape: np.ndarray, amplitude: np.ndarray) -> str:
    """Return the animation of the arm, some cycles at each frequency."""
    swing = np.cos(2 * np.pi * np.arange(_SWINGS * amplitude.size) / 4)
    size = 80 * np.repeat(amplitude, _SWINGS) / np.nanmax(amplitude)
    frames = (curve(20 + 240 * x / x[-1], 100 - s * shape, _UP, 3) for s in size * swing)
    window = film(frames, 280, _SECONDS)
    return (
        f'<svg x="10" y="30" width="280" height="200"><path class="thin" d="M20 100H260"/>'
        f'<path class="rail" d="M20 10V190"/>{window}</svg>'
    )


def _chart(
    frequency: np.ndarray,
    ways: tuple[np.ndarray, np.ndarray],
    zone: tuple[float, float],
    place: np.ndarray,
    amplitude: np.ndarray,
) -> str:
    """Return amplitudes over the frequency for both directions, and a dot that runs along them."""
    largest = float(np.nanmax(amplitude))
    across = _WIDE * (frequency - frequency[0]) / np.ptp(frequency) + _LEFT

    def up(values: np.ndarray) -> np.ndarray:
        return np.asarray(_LOW - _HIGH * np.nan_to_num(values) / largest)

    sides = np.interp(zone, frequency, across)
    shade = (
        f'<rect x="{sides[0]:.1f}" y="{_LOW - _HIGH}" width="{np.diff(sides)[0]:.1f}" height="{_HIGH}" fill="#eee"/>'
    )
    lines = curve(across, up(ways[0]), _UP, 2) + curve(across[::-1], up(ways[1]), _DOWN, 2)
    marks = [
        f'<circle cx="{np.interp(varpi, frequency, across):.1f}" cy="{y:.1f}" r="5" fill="#333"/>'
        for varpi, y in zip(place, up(amplitude), strict=True)
    ]
    dots = moved(
        "".join(f'<g transform="translate({720 * k})">{mark}</g>' for k, mark in enumerate(marks)),
        -720 * len(marks),
        len(marks),
        _SECONDS,
    )
    words = (
        f'<text x="{_LEFT}" y="{_LOW - _HIGH - 10}">peak at the tip, at most {1e3 * largest:.1f} mm</text>'
        f'<text x="{_LEFT}" y="{_LOW + 20}">{frequency[0]:.0f} rad/s</text>'
        f'<text x="{_LEFT + _WIDE}" y="{_LOW + 20}" text-anchor="end">{frequency[-1]:.0f} rad/s</text>'
    )
    axis = f'<path class="thin" d="M{_LEFT} {_LOW}h{_WIDE}"/>'
    return f'{shade}{axis}{lines}{words}<svg x="0" y="0" width="720" height="270">{dots}</svg>'
