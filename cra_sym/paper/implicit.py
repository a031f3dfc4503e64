"""Sensitivities by implicit differentiation of the frequency equation: equations (31) and (32)."""

from __future__ import annotations

from functools import cache

import numpy as np
import sympy as sp

from cra_sym.paper.energy import modal_numbers
from cra_sym.paper.equations import Derivation, Proof, derived, proves, samples
from cra_sym.paper.evaluation import group_numbers
from cra_sym.paper.frequency_equation import frequency_function
from cra_sym.paper.groups import GROUPS
from cra_sym.paper.limits import natural_frequency
from cra_sym.paper.oracles import by_hand
from cra_sym.paper.oracles.shooting import sample, shoot
from cra_sym.symbols import symbol

__all__ = ["PAIRS", "frequency_sensitivities", "implicit_derivatives", "sensitivity_function"]

lamda, L, E, I_z = (symbol(name) for name in ("lamda", "L", "E", "I_z"))
#: The pair (s, c) of each stiffness.
PAIRS = {name: tuple(symbol(f"{letter}_{name}") for letter in ("s", "c")) for name in ("t", "r")}


@derived(31, "sensitivity function", (23,))
def sensitivity_function() -> Derivation[sp.Eq]:
    """The frequency equation Δ(λ, κ) = 0 holds along a root λ(κ) as a stiffness changes: the total derivative of Δ
    vanishes."""
    kappa = symbol("kappa_t")
    along = sp.Function("Delta")(sp.Function("lamda")(kappa), kappa)
    yield "along a root", "λ is a function of the stiffness, and the frequency equation holds for all.", sp.Eq(along, 0)
    free, rate = sp.Function("Delta")(lamda, kappa), sp.Function("lamda")(kappa).diff(kappa)
    total = sp.Eq(free.diff(lamda) * rate + free.diff(kappa), 0)
    yield "total derivative", "Chain rule; solved for the slope of λ.", total
    slope = sp.idiff(sp.Function("Delta")(lamda, kappa), lamda, kappa).doit()
    return sp.Eq(sp.Function("lamda")(kappa).diff(kappa), slope)


@proves(31)
def prove_sensitivity_function() -> Proof:
    """The chain rule for an arbitrary function, whose total derivative along the curve vanishes; and the unit circle,
    where the slope is minus abscissa over ordinate."""
    kappa, Delta, slope = symbol("kappa_t"), sp.Function("Delta"), sensitivity_function()
    yield slope.lhs == sp.Function("lamda")(kappa).diff(kappa)
    yield Delta(lamda, kappa).diff(lamda) * slope.rhs + Delta(lamda, kappa).diff(kappa)
    circle = sp.Lambda((lamda, kappa), lamda**2 + kappa**2 - 1)
    yield slope.rhs.replace(Delta, circle).doit() + kappa / lamda


@cache
def implicit_derivatives() -> dict[str, sp.Expr]:
    """Return the rates of lambda by each group; for a stiffness, the derivative by kappa is this times c^2.

    The chain rule over the pair (s, c) = (kappa, 1) / (1 + kappa), d s / d kappa = c^2 = -d c / d kappa, remains
    regular at zero and infinite stiffness.
    """
    function, _ = frequency_function()
    slope = function.diff(lamda)
    parts = {f"kappa_{name}": function.diff(s) - function.diff(c) for name, (s, c) in PAIRS.items()}
    parts |= {name: function.diff(symbol(name)) for name in ("mu", "iota")}
    return {name: -part / slope for name, part in parts.items()}


def _in_hertz(rates: dict[str, sp.Expr]) -> tuple[sp.Eq, sp.Eq]:
    """Convert d lamda / d kappa of each stiffness to hertz per unit of the stiffness, by (30)."""
    stiffnesses = {name: symbol(f"k_{name}") for name in rates}
    frequency, hertz = sp.Function("f_i")(*stiffnesses.values()), natural_frequency().rhs
    by_k_t, by_k_r = (
        sp.Eq(frequency.diff(k), hertz.diff(lamda) * GROUPS[k][1].diff(k) * rates[name])
        for name, k in stiffnesses.items()
    )
    return by_k_t, by_k_r


def _by_parts() -> tuple[sp.Eq, sp.Eq]:
    kappa_t = symbol("kappa_t")
    return _in_hertz({name: sensitivity_function().rhs.subs(kappa_t, symbol(f"kappa_{name}")) for name in PAIRS})


@derived(32, "sensitivities of the frequencies", (23, 30, 31), shown=_by_parts)
def frequency_sensitivities() -> Derivation[tuple[sp.Eq, sp.Eq]]:
    """(31) for the two stiffnesses, converted to Hz per N/m and Hz per N m/rad by (30); f_i is proportional to the
    square of λ. Raw sensitivities have different units: only logarithmic ones can be compared. The expression contains
    Δ of (23) in full, which is too long for a page."""
    hertz = natural_frequency()
    yield "hertz over λ", "(30) differentiated.", sp.Eq(sp.Derivative(hertz.lhs, lamda), hertz.rhs.diff(lamda).doit())
    groups = tuple(sp.Eq(sp.Derivative(group, k), value.diff(k)) for k, (group, value) in list(GROUPS.items())[:2])
    yield "groups over stiffnesses", "The remaining factors of the chain rule.", groups
    return _in_hertz({name: implicit_derivatives()[f"kappa_{name}"] * c**2 for name, (_, c) in PAIRS.items()})


@proves(32)
def prove_frequency_sensitivities() -> Proof:
    """First-order perturbation: ω_i² changes by φ_i(0)² / M_i per k_t and by φ_i'(0)² / M_i per k_r. Any shape that
    satisfies the conditions at the joint may be used: it is a mode of an arm whose end-effector balances the force and
    moment at the tip. The integral of its square follows from its end values."""
    xi, mu, iota, rho, A = (symbol(name) for name in ("xi", "mu", "iota", "rho", "A"))
    shape = by_hand.joined(xi)
    phi, slope, curvature, third = shape
    integral = 3 * phi * third - slope * curvature + xi * (lamda**4 * phi**2 - 2 * slope * third + curvature**2)
    yield integral.diff(xi) - 4 * lamda**4 * phi**2
    root, tip = shape.subs(xi, 0), shape.subs(xi, 1)
    mass = integral.subs(xi, 1) - integral.subs(xi, 0) - 4 * tip[0] * tip[3] + 4 * tip[1] * tip[2]
    below = frequency_function()[0].diff(lamda)
    for e, rate, power, pair in zip(frequency_sensitivities(), root, (1, -1), PAIRS.values(), strict=False):
        above, units = e.rhs.as_independent(L, E, I_z, rho, A, as_Add=False)
        yield units - L**power / sp.sqrt(E * I_z * rho * A)
        sides = [above * below, below]
        for inertia, force, motion in ((mu, -tip[3], lamda**4 * tip[0]), (iota, tip[2], lamda**4 * tip[1])):
            sides = [motion * s.expand().coeff(inertia, 0) + force * s.expand().coeff(inertia, 1) for s in sides]
        yield sp.pi * mass * sides[0] - lamda**2 * rate**2 * sum(pair) * sides[1]


@samples(32)
def sample_frequency_sensitivities() -> bool:
    """First-order perturbation: ω_i² changes by φ_i(0)² / M_i per k_t and by φ_i'(0)² / M_i per k_r, for modes of a
    random arm computed by shooting."""
    values = sample(32)
    numbers = {symbol(name): value for name, value in values.items()}
    for mode in shoot(values):
        groups = group_numbers(values, mode.beta)
        mass = modal_numbers(values, mode)[symbol("M_i")]
        for e, order in zip(frequency_sensitivities(), (0, 1), strict=True):
            found = float(e.rhs.subs(groups).subs(numbers))
            expected = mode(0.0, order) ** 2 / mass / (8 * np.pi**2 * mode.omega / (2 * np.pi))
            if abs(found / expected - 1) > 1e-6:
                return False
    return True
