"""Where the amplitude equation (48) loses stability, without and with damping: equations (49) and (49b)."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from sympy import Eq, Expr, S, Symbol, cos, sin

from cra_sym.mechanics.boundaries import plain
from cra_sym.mechanics.multiple_scales import MultipleScales
from cra_sym.paper.equations import Derivation, Proof, Stage, derived, proves, samples
from cra_sym.paper.resonance import P_nn, epsilon, omega_n, principal, varpi
from cra_sym.symbols import symbol

__all__: list[str] = []

zeta_n, angle = symbol("zeta_n"), Symbol("theta")


@derived(49, "stability boundary", (48,))
def stability_boundary() -> Derivation[tuple[Eq, Eq]]:
    """The amplitude of (48) grows between these two frequencies. The paper's boundary, taken from axially moving beams,
    does not follow from its (36); this one follows from (48)."""
    yield from _border(principal())
    lower, upper = principal().step("boundary").expression
    return plain(lower), plain(upper)


@proves(49)
def prove_stability_boundary() -> Proof:
    """On the boundary of instability there are motions of twice the period of the excitation: with a third harmonic, a
    sine on one side and a cosine on the other satisfy the equation of motion at orders 0 and 1."""
    for sign in (1, -1):
        size, shapes = sign * abs(P_nn), (sin, cos)[::sign]
        for border, shape in zip(stability_boundary(), shapes, strict=True):
            yield border.lhs == varpi
            motion = shape(angle) + epsilon * size / (16 * omega_n**2) * shape(3 * angle)
            yield from _left_by(motion, size, border.rhs)


def _left_by(motion: Expr, size: Expr, frequency: Expr, damping: Expr = S.Zero) -> Proof:
    """Yield the residuals at orders 0 and 1 of the equation of a mode with coupling P_nn = ``size``, for a motion given
    as a function of half the phase of the excitation."""
    rate = frequency / 2
    force = rate**2 * motion.diff(angle, 2) + 2 * damping * omega_n * rate * motion.diff(angle)
    left = (force + (omega_n**2 + epsilon * size * cos(2 * angle)) * motion).expand()
    for order in (0, 1):
        yield left.coeff(epsilon, order)


@samples(49)
def sample_stability_boundary() -> bool:
    """Mathieu's characteristic values; the error shrinks with the square of epsilon."""
    from scipy.special import mathieu_a, mathieu_b

    errors = []
    for size in (0.02, 0.01):
        numbers = {omega_n: 1.0, P_nn: 1.0, epsilon: size}
        lower, upper = (float(side.rhs.subs(numbers)) for side in stability_boundary())
        errors.append(
            max(abs(4 / v**2 - curve(1, 2 * size / v**2)) for v, curve in ((lower, mathieu_a), (upper, mathieu_b)))
        )
    return bool(3.5 < errors[0] / errors[1] < 4.5)


def _border(found: MultipleScales) -> Iterator[Stage]:
    """Yield the steps from the amplitude equation to the boundary of its stability."""
    for step in found.steps:
        if step.name in ("rotating frame", "stability condition"):
            yield step.name, step.statement, plain(found.explicit(step.expression))


@derived("49b", "threshold of damping", (48,))
def damping_threshold() -> Derivation[Eq]:
    """With a damping ratio zeta_n the amplitude grows only for larger epsilon."""
    damped = principal(damped=True)
    yield from _border(damped)
    assert damped.border is not None
    return Eq(epsilon, plain(damped.explicit(damped.border.threshold)), evaluate=False)


@proves("49b")
def prove_damping_threshold() -> Proof:
    """At this epsilon, in the middle of the zone, a motion of twice the period of the excitation neither grows nor
    decays: with a third harmonic it satisfies the equation of motion at orders 0 and 1."""
    needed = zeta_n * epsilon / damping_threshold().rhs
    yield damping_threshold().lhs == epsilon
    yield not needed.has(zeta_n)
    for sign in (1, -1):
        size = sign * abs(P_nn)
        third = epsilon * size / (16 * omega_n**2) * (cos(3 * angle) - sign * sin(3 * angle))
        yield from _left_by(cos(angle) - sign * sin(angle) + third, size, 2 * omega_n, needed)


@samples("49b")
def sample_damping_threshold() -> bool:
    """The Floquet multipliers of one mode in the middle of its zone, just below and just above."""
    from cra_sym.solvers.floquet import Oscillation
    from cra_sym.solvers.periodic import floquet_exponents

    numbers = {omega_n: 1.0, P_nn: 1.0, zeta_n: 0.005}
    threshold = float(damping_threshold().rhs.subs(numbers))
    sizes = threshold * np.array([0.995, 1.005])
    drives = [(Oscillation(1, "cos", 0), ([[1.0]], None, None, None))]
    below, above = floquet_exponents([[1.0]], [[0.01]], drives, 2.0 - sizes**2 / 32, sizes)[:, 0].real
    return bool(below < 0 < above)
