"""Steady amplitude of one resonant mode, forced or parametrically excited, with a weak cubic term if there is one."""

from __future__ import annotations

from dataclasses import dataclass

from sympy import Eq, Expr, I, S, Symbol, cancel, expand

from cra_sym.mechanics.stability_condition import DETUNING
from cra_sym.mechanics.two_scales import EPSILON, SIGMA, TwoScaleExpansion, amplitude, conjugate_amplitude

__all__ = ["AMPLITUDE", "SteadyResponse", "steady_response"]

#: Real amplitude a of the mode's vibration, q = a cos(...).
AMPLITUDE = Symbol("a", positive=True)


@dataclass(frozen=True)
class SteadyResponse:
    """Steady vibration of the resonant mode.

    Attributes
    ----------
    curve : Eq
        Relation between amplitude and detuning: the frequency response.
    backbone : Eq
        Detuning about which that curve is symmetric, as a function of the amplitude.
    growth : Expr
        Rate at which the amplitude of a forced mode grows from rest exactly at resonance, without damping.
    """

    curve: Eq
    backbone: Eq
    growth: Expr


def steady_response(expansion: TwoScaleExpansion) -> SteadyResponse:
    """Return the steady response that the first-order amplitude equation of a single mode implies."""
    r = expansion.resonance
    a, b = amplitude(r.first), conjugate_amplitude(r.first)
    terms = {p: c * EPSILON for (_, p), c in expansion.rates[0][a].terms.items()}
    turning = I * DETUNING * (1 if r.sign == 0 else S.Half)
    # With A = (a/2) exp(i ...) in the rotating frame the free part is a complex factor of A ...
    free = expand(cancel(terms.get(S.Zero, S.Zero) / a)).subs(a * b, AMPLITUDE**2 / 4) - turning
    drive = terms.get(S.One, S.Zero)
    held = cancel(2 * drive / AMPLITUDE) if r.sign == 0 else cancel(drive / b)
    # ... and a steady state needs it to balance the drive in modulus.
    backbone = cancel(DETUNING + _parts(free)[1] / (turning / (I * DETUNING)))
    curve = Eq(_square(free), _square(held))
    return SteadyResponse(curve, Eq(DETUNING, backbone), 2 * abs(drive.subs(SIGMA, 0)) if r.sign == 0 else S.Zero)


def _parts(expression: Expr) -> tuple[Expr, Expr]:
    flat = expand(expression)
    return flat.coeff(I, 0), flat.coeff(I, 1)


def _square(expression: Expr) -> Expr:
    real, imaginary = _parts(expression)
    return real**2 + imaginary**2
