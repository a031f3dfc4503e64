"""Duhamel's integral (12) in closed form: the response of one mode to a base motion, regular at every resonance.

A base motion is a sum of impulses, constant and linear accelerations, and harmonics, and each is a convolution of the
mode's impulse response with an exponential. These convolutions are divided differences of the exponential function,
which are entire in all parameters: resonance, critical damping and the rigid-body mode need no special case. Where the
generic form loses digits by cancellation, the power series of the same function is used instead.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from typing import NamedTuple

import sympy as sp
from sympy.codegen.cfunctions import expm1

from cra_sym.symbols import symbol

__all__ = [
    "UnitResponses",
    "convolution",
    "forced_kernel",
    "free_kernel",
    "guarded_responses",
    "impulse_response",
    "modal_operator",
    "unit_responses",
]

_SERIES_TERMS = 20  # of the power series, used while no angle exceeds 1: 1/20! is far below rounding


class UnitResponses(NamedTuple):
    """Responses of q'' + 2 zeta_i omega_i q' + omega_i^2 q to unit inputs, functions of t.

    Attributes
    ----------
    displacement, impulse : Expr
        Free motion from q = 1, q' = 0 and from q = 0, q' = 1.
    step, ramp : Expr
        From rest, forced by 1 and by t.
    harmonic : Expr
        From rest, forced by exp(i varpi t): its real part belongs to cos, its imaginary part to sin.
    """

    displacement: sp.Expr
    impulse: sp.Expr
    step: sp.Expr
    ramp: sp.Expr
    harmonic: sp.Expr


def _symbols() -> tuple[sp.Symbol, ...]:
    return tuple(symbol(name) for name in ("t", "omega_i", "zeta_i", "varpi"))


def modal_operator(q: sp.Expr) -> sp.Expr:
    """Return q'' + 2 zeta_i omega_i q' + omega_i^2 q, the left side of the modal equation (11) with modal damping."""
    t, omega, zeta, _ = _symbols()
    return q.diff(t, 2) + 2 * zeta * omega * q.diff(t) + omega**2 * q


def convolution(a: sp.Expr, b: sp.Expr) -> sp.Expr:
    """Return the integral of exp(a (t - tau)) exp(b tau) over tau from 0 to t, exact at and near a = b.

    With tau = t (1 - r) it is t exp(b t) times the integral of exp(z r) over (0, 1), z = (a - b) t: an entire
    function of z, which ``expm1`` evaluates without cancellation. At z = 0 the secular term t exp(b t) is what
    remains.
    """
    t = symbol("t")
    z = (a - b) * t
    return t * sp.exp(b * t) * sp.Piecewise((expm1(z) / z, sp.Ne(z, 0)), (1, True))


def impulse_response(damping: sp.Expr, damped: sp.Expr) -> sp.Expr:
    """Return the impulse response of q'' + 2 damping q' + (damping^2 + damped^2) q, as SymPy solves the equation."""
    t, d, o = symbol("t"), sp.Dummy("d", positive=True), sp.Dummy("o", positive=True)
    q = sp.Function("q")
    start = {q(0): 0, q(t).diff(t).subs(t, 0): 1}
    solution = sp.dsolve(q(t).diff(t, 2) + 2 * d * q(t).diff(t) + (d**2 + o**2) * q(t), q(t), ics=start).rhs
    return solution.subs(sp.sin(o * t), o * t * sp.sinc(o * t)).subs({d: damping, o: damped})


def _roots() -> tuple[sp.Expr, sp.Expr, sp.Expr, sp.Expr]:
    """Return damping zeta omega, damped frequency, and the two exponents of the free motion."""
    _, omega, zeta, _ = _symbols()
    delta, omega_d = zeta * omega, omega * sp.sqrt(1 - zeta**2)
    return delta, omega_d, -delta + sp.I * omega_d, -delta - sp.I * omega_d


@cache
def unit_responses() -> UnitResponses:
    """Derive the unit responses of a mode.

    Integrating the modal equation of the impulse response h once and twice gives the step response
    (1 - h' - 2 zeta_i omega_i h) / omega_i^2 and the ramp response. The harmonic one is the convolution of h, a
    difference of two exponentials, with a third.
    """
    t, omega, _, varpi = _symbols()
    delta, omega_d, one, other = _roots()
    h = impulse_response(delta, omega_d)
    p = sp.exp(-delta * t) * sp.cos(omega_d * t) + delta * h  # h' + 2 delta h, written without sinc'
    step = (1 - p) / omega**2
    ramp = (t - h - 2 * delta * step) / omega**2
    forced = sp.I * varpi
    return UnitResponses(p, h, step, ramp, (convolution(one, forced) - convolution(other, forced)) / (one - other))


@cache
def guarded_responses() -> UnitResponses:
    """Return the unit responses in a form accurate to rounding for omega_i >= 0, 0 <= zeta_i < 1, varpi >= 0.

    Where both angles are small, the power series; where the two exponents of the free motion are close to each other,
    the harmonic response's divided difference is taken in another order.
    """
    t, omega, _, varpi = _symbols()
    _, omega_d, one, other = _roots()
    unit = unit_responses()
    slow = omega * t <= 1
    close = (unit.impulse - convolution(other, sp.I * varpi)) / (one - sp.I * varpi)
    return unit._replace(
        step=sp.Piecewise((_power_series("step"), slow), (unit.step, True)),
        ramp=sp.Piecewise((_power_series("ramp"), slow), (unit.ramp, True)),
        harmonic=sp.Piecewise(
            (_power_series("harmonic"), slow & (varpi * t <= 1)), (unit.harmonic, omega_d * t > 0.5), (close, True)
        ),
    )


def _power_series(cause: str) -> sp.Expr:
    """Return the power series in t of the response from rest: its coefficients obey the modal equation term by term."""
    t, omega, zeta, varpi = _symbols()
    forces: dict[str, Callable[[int], sp.Expr]] = {
        "step": lambda n: sp.Integer(n == 0),
        "ramp": lambda n: sp.Integer(n == 1),
        "harmonic": lambda n: (sp.I * varpi) ** n,
    }
    force = forces[cause]
    before, last, total = sp.Integer(0), sp.Integer(0), sp.Integer(0)
    for n in range(_SERIES_TERMS - 1):
        before, last = last, force(n) - 2 * zeta * omega * last - omega**2 * before
        total += last * t ** (n + 2) / sp.factorial(n + 2)
    return total


def free_kernel() -> tuple[dict[str, sp.Expr], tuple[sp.Symbol, ...]]:
    """Return the unit responses except the harmonic one, and the arguments (t, omega_i, zeta_i) of their kernel."""
    derived = guarded_responses()._asdict()
    del derived["harmonic"]
    return derived, _symbols()[:3]


def forced_kernel() -> tuple[sp.Expr, tuple[sp.Symbol, ...]]:
    """Return the response to a harmonic, and the arguments (t, omega_i, zeta_i, varpi) of its kernel."""
    return guarded_responses().harmonic, _symbols()
