"""Animations of the arm as SVG without scripts: they pause under the pointer and respect reduced-motion settings.

An animation is a strip of frames that is moved stepwise past a window.
"""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from cra_sym.analysis.modes import mode_shapes, natural_frequencies
from cra_sym.analysis.responses import response
from cra_sym.arm.parameters import Arm
from cra_sym.figures import described
from cra_sym.figures.subject import arm_or_nominal
from cra_sym.solvers.motion import BaseMotion

__all__ = ["curve", "document", "film", "moved", "moving_arm", "moving_modes"]

_LINES = (("#0072B2", ' stroke-dasharray="7 3"'), ("#D55E00", ""))  # rigid joint, elastic joint
_LOOSE = {"k_t": 200.0, "k_r": 20.0}  # N/m, N m/rad: soft enough to be visible
_MOVE = {"distance": 0.4, "v_max": 1.0, "a_max": 4.0, "j_max": 40.0}  # m, m/s, m/s2, m/s3
_FRAMES, _DURATION, _SLOWER = 96, 2.4, 2.5  # frames, their duration in seconds, slow-motion factor
_LENGTH = 240  # of the arm, pixels

_RULES = """\
#{0} text{{font:13px system-ui,sans-serif;fill:#333}}#{0} .thin{{stroke:#ddd}}#{0} .rail{{stroke:#999;stroke-width:5}}
@keyframes {0}{{to{{transform:translateX(var(--travel))}}}}
#{0} .film{{animation:{0} 1s infinite}}#{0}:hover .film{{animation-play-state:paused!important}}
@media print,(prefers-reduced-motion:reduce){{#{0} .film{{animation-play-state:paused!important;\
animation-delay:var(--still)!important}}}}"""


def moving_arm(arm: Arm | None = None, k_t: float = _LOOSE["k_t"], k_r: float = _LOOSE["k_r"]) -> str:
    """Show a commanded move seen from above, with a rigid and with an elastic joint, and what the tips do.

    The base follows an S-curve of 0.4 m and stops; on the elastic joint the tip swings on. Displacements are to scale,
    time runs 2.5 times slower.

    Parameters
    ----------
    arm : Arm, optional
        By default the nominal one with 1 % of damping.
    k_t, k_r : float
        The elastic joint, N/m and N m/rad.

    Returns
    -------
    str
        An SVG document.
    """
    arm = arm_or_nominal(arm, zeta=0.01)
    motion, t = BaseMotion.s_curve(**_MOVE), np.linspace(0.0, _DURATION, _FRAMES, endpoint=False)
    x = np.linspace(0.0, float(arm.L), 17)
    give = [response(joined, motion, t, x) for joined in _joints(arm, k_t, k_r)]
    names = "rigid joint", f"elastic joint: {k_t:g} N/m, {k_r:g} N m/rad"
    panels = [
        f'<text x="{20 + 350 * k}" y="22" style="fill:{_LINES[k][0]};font-weight:600">{name}</text>'
        f'<svg x="{20 + 350 * k}" y="32" width="330" height="230"><path class="rail" d="M50 8V222"/>'
        f"{_seen_from_above(x, motion.displacement(t), v, _LINES[k][0])}</svg>"
        for k, (name, v) in enumerate(zip(names, give, strict=True))
    ]
    things = (
        '<defs><rect id="moving-arm-base" x="37" y="-13" width="26" height="26" rx="3" fill="#444" stroke="none"/>'
        f'<circle id="moving-arm-tip" cx="{50 + _LENGTH}" r="5" fill="#444" stroke="none"/></defs>'
    )
    return document("moving-arm", 430, [things, *panels, _over_time(t, [v[-1] for v in give])])


def moving_modes(arm: Arm | None = None, k_t: float = _LOOSE["k_t"], k_r: float = _LOOSE["k_r"]) -> str:
    """Show the first three mode shapes swinging, with a rigid (dashed) and with an elastic joint (solid).

    The shapes have unit modal mass. Each mode is slowed down on its own; its two periods keep their ratio.

    Parameters
    ----------
    arm : Arm, optional
        By default the nominal one.
    k_t, k_r : float
        The elastic joint, N/m and N m/rad.

    Returns
    -------
    str
        An SVG document.
    """
    arm = arm_or_nominal(arm)
    x = np.linspace(0.0, float(arm.L), 21)
    joints = _joints(arm, k_t, k_r)
    shapes = np.array([mode_shapes(joined, x) for joined in joints])  # joint, mode, x
    hertz = np.array([natural_frequencies(joined) for joined in joints])
    swing = np.cos(np.linspace(0.0, 2 * np.pi, 32, endpoint=False))
    up, panels = 75.0 / np.abs(shapes).max(), []
    for mode, slowest in enumerate((2.4, 1.8, 1.4)):
        films = [
            film(
                (curve(10 + 200 * x / x[-1], 85 - up * s * shapes[joint, mode], stroke, 2.5) for s in swing),
                220,
                slowest * hertz[:, mode].min() / hertz[joint, mode],
            )
            for joint, stroke in enumerate(_LINES)
        ]
        panels.append(
            f'<svg x="{10 + 235 * mode}" y="40" width="220" height="170"><path class="thin" d="M10 85H210"/>'
            f'<path class="rail" d="M10 5V165"/>{"".join(films)}</svg><g text-anchor="middle">'
            f'<text x="{120 + 235 * mode}" y="25">mode {mode + 1}</text><text x="{120 + 235 * mode}" y="232">'
            f"{hertz[0, mode]:.2f} Hz rigid, {hertz[1, mode]:.2f} Hz elastic</text></g>"
        )
    return document("moving-modes", 245, panels)


def _joints(arm: Arm, k_t: float, k_r: float) -> tuple[Arm, Arm]:
    return arm.replace(k_t=np.inf, k_r=np.inf), arm.replace(k_t=k_t, k_r=k_r)


def _seen_from_above(x: np.ndarray, base: np.ndarray, give: np.ndarray, colour: str) -> str:
    """Return the film of an arm whose base slides up the page."""
    scale = _LENGTH / x[-1]
    low = 175 - scale * base
    frames = (
        f"{curve(50 + scale * x, y - scale * v, (colour, ''), 3)}"
        f'<use href="#moving-arm-base" y="{y:.1f}"/><use href="#moving-arm-tip" y="{y - scale * v[-1]:.1f}"/>'
        for y, v in zip(low, give.T, strict=True)
    )
    return film(frames, 330, _DURATION * _SLOWER, still=1.0)


def _over_time(t: np.ndarray, tips: list[np.ndarray]) -> str:
    """Return the tips' displacements over time, with a line that runs along."""
    left, wide, middle, half = 75, 620, 342, 56
    across, largest = wide / _DURATION, np.abs(tips).max()
    seconds = "".join(
        f'<path class="thin" d="M{left + across * s:.1f} {middle - half}v{2 * half}"/>'
        f'<text x="{left + across * s:.1f}" y="{middle + half + 18}" text-anchor="middle">{s:g} s</text>'
        for s in np.arange(0.0, _DURATION, 0.5)
    )
    curves = "".join(
        curve(left + across * t, middle - half * v / largest, line, 2) for v, line in zip(tips, _LINES, strict=True)
    )
    cursor = f'<path d="M{left} {middle - half}v{2 * half}" stroke="#333" stroke-width="1.5"/>'
    return (
        f'{seconds}<path class="thin" d="M{left} {middle}h{wide}"/>{curves}<g text-anchor="end">'
        f'<text x="{left - 8}" y="{middle - half + 5}">{1e3 * largest:.0f} mm</text>'
        f'<text x="{left - 8}" y="{middle + 5}">0</text></g>'
        f'<text x="{left}" y="{middle - half - 9}">the tip as seen from the base, v(L, t)</text>'
        f"{moved(cursor, wide, _FRAMES, _DURATION * _SLOWER, still=1.0)}"
    )


def film(frames: Iterable[str], width: int, seconds: float, still: float = 0.0) -> str:
    """Return frames as a strip; ``still`` is the time, in seconds of the arm's motion, at which it rests in print."""
    strip = [f'<g transform="translate({k * width})">{frame}</g>' for k, frame in enumerate(frames)]
    return moved("".join(strip), -width * len(strip), len(strip), seconds, still)


def moved(content: str, travel: int, steps: int, seconds: float, still: float = 0.0) -> str:
    """Return content that is moved by ``travel`` pixels in a number of steps and seconds, repeatedly."""
    timing = f"animation-duration:{seconds:.3g}s;animation-timing-function:steps({steps})"
    return f'<g class="film" style="--travel:{travel}px;--still:-{_SLOWER * still:g}s;{timing}">{content}</g>'


def curve(x: np.ndarray, y: np.ndarray, line: tuple[str, str], width: float) -> str:
    """Return a curve through points given in pixels, to a tenth of one."""
    points = np.round(np.stack([x, y]), 1)
    steps = " ".join(f"{dx:g} {dy:g}" for dx, dy in np.diff(points, axis=1).T.round(1) + 0.0)
    start = f"M{points[0, 0]:g} {points[1, 0]:g}l{steps}"
    return f'<path d="{start}" fill="none" stroke="{line[0]}" stroke-width="{width:g}"{line[1]}/>'


def document(name: str, height: int, parts: list[str]) -> str:
    """Return an SVG document with a text alternative and the animation rules."""
    title, description = described(name.replace("-", "_"))
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" id="{name}" viewBox="0 0 720 {height}" role="img" '
        f'aria-labelledby="{name}-title {name}-desc"><title id="{name}-title">{title}</title>'
        f'<desc id="{name}-desc">{description}</desc><style>{_RULES.format(name)}</style>{"".join(parts)}</svg>'
    )
