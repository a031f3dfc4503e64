"""The rigid joint as a limit, the textbook cantilever, and frequencies in hertz: equations (27)-(30)."""

from __future__ import annotations

import numpy as np
from sympy import Eq, Expr, Limit, Matrix, Mul, Pow, cancel, limit, oo, pi, solve, sqrt

from cra_sym.arm.lagrangian import HALF
from cra_sym.paper.energy import L, modal_numbers, phi_i
from cra_sym.paper.equations import Derivation, Proof, derived, proves, samples
from cra_sym.paper.evaluation import group_numbers, shapes_agree
from cra_sym.paper.frequency_equation import by_power, frequency_function, frequency_polynomial
from cra_sym.paper.modes import (
    C_1,
    VALUES,
    basis,
    beta,
    c_r,
    c_t,
    iota,
    kappa_r,
    kappa_t,
    lamda,
    mode_form,
    mu,
    omega_i,
    r_2,
    s_r,
    s_t,
)
from cra_sym.paper.oracles.by_hand import tip_rows
from cra_sym.paper.oracles.shooting import sample, shoot
from cra_sym.paper.shapes import circular_ratio, coefficients_of, mode_shape
from cra_sym.symbols import Dimension, dimension, symbol

__all__ = ["cantilever_frequency", "cantilever_shape", "natural_frequency", "rigid_joint"]


def _finite(expression: Expr) -> Expr:
    """Write the pairs (s, c) as (kappa, 1), without the common factor of each stiffness."""
    return expression.subs({s_t: kappa_t, c_t: 1, s_r: kappa_r, c_r: 1})


def _rigid_limit(expression: Expr) -> Expr:
    """Return the limit of infinite kappa_t, then infinite kappa_r."""
    return limit(limit(expression, kappa_t, oo), kappa_r, oo)


def _take_rigid(expression: Expr) -> Expr:
    placed = expression.subs({value: name for name, value in VALUES.items()})
    return _rigid_limit(cancel(_finite(placed))).subs(VALUES)


@derived(27, "rigid joint with end-effector", (23, 25, 26))
def rigid_joint() -> Derivation[tuple[Eq, Eq, Eq]]:
    """Both stiffnesses tend to infinity: frequency equation, shape and ratio. (23) divided by κ_t κ_r has this finite
    limit."""
    divided = (_finite(frequency_polynomial()) / (kappa_t * kappa_r)).expand()
    yield "divided by the stiffnesses", "(23) over κ_t κ_r.", Eq(divided.subs(VALUES), 0)
    frequency = _rigid_limit(divided)
    shape = mode_shape().rhs / C_1
    parts = [_gather_rigid(shape.coeff(r_2, power)) for power in (0, 1)]
    return (
        Eq(by_power(frequency).subs(VALUES), 0),
        Eq(phi_i, C_1 * (parts[0] + r_2 * parts[1])),
        Eq(r_2, _take_rigid(circular_ratio().rhs)),
    )


def _gather_rigid(shape: Expr) -> Expr:
    expanded = shape.expand()
    return sum(_rigid_limit(_finite(expanded.coeff(function))) * function for function in basis())


@derived(28, "rigid joint, no end-effector: mode shape", (27,))
def cantilever_shape() -> Derivation[tuple[Eq, Eq]]:
    """The shape of (27) as the inertia of the end-effector tends to zero."""
    _, shape, ratio = rigid_joint()
    limits = Limit(Limit(ratio.rhs, mu, 0), iota, 0)
    yield "limits of the ratio", "No mass, then no rotary inertia at the tip.", Eq(r_2, limits, evaluate=False)
    return shape, Eq(r_2, _bare(ratio.rhs))


@derived(29, "rigid joint, no end-effector: frequency equation", (27,))
def cantilever_frequency() -> Derivation[Eq]:
    """The frequency equation of (27) as the inertia of the end-effector tends to zero: the textbook cantilever."""
    function = symbol("Delta")
    limits = Eq(Limit(Limit(function, mu, 0), iota, 0), 0, evaluate=False)
    yield "limits", "No mass, then no rotary inertia at the tip.", (limits, Eq(function, rigid_joint()[0].lhs))
    return Eq(_bare(rigid_joint()[0].lhs), 0)


def _bare(expression: Expr) -> Expr:
    """Return the limit of no mass, then no rotary inertia, at the tip."""
    placed = expression.subs({value: name for name, value in VALUES.items()})
    return limit(limit(placed, mu, 0), iota, 0).subs(VALUES)


_BARE = {mu: 0, iota: 0}
_RIGID = {"k_t": 1e12, "k_r": 1e12}


def _clamped(shape: Expr, ratio: Expr, frequency: Expr, tip: Matrix) -> Proof:
    """Yield what vanishes for a shape and a frequency equation of an arm clamped at the root, by hand: displacement and
    slope there, and force and moment at the tip of the two shapes that are left."""
    plain, second = (coefficients_of(shape.coeff(r_2, power) / C_1) for power in (0, 1))
    for clamped in (plain, second):
        yield clamped[0] + clamped[2]
        yield clamped[1] + clamped[3]
    yield (plain[0], plain[1], second[0], second[1]) == (1, 0, 0, 1)
    ends = tip * Matrix.hstack(plain, second)
    yield ends[0, 0] + ratio * ends[0, 1]
    yield ends.det() + 2 * lamda**5 * frequency


@proves(27)
def prove_rigid_joint() -> Proof:
    """Written by hand, the two shapes with zero displacement and slope at the joint: in this ratio they satisfy the
    force condition at the tip, and the determinant of force and moment is the frequency equation. Also the rigid joint
    as (s, c) = (1, 0) in (23)."""
    frequency, shape, ratio = rigid_joint()
    yield (shape.lhs, ratio.lhs) == (phi_i, r_2)
    yield from _clamped(shape.rhs.expand(), ratio.rhs, frequency.lhs - frequency.rhs, tip_rows())
    yield frequency.lhs - frequency_function()[0].subs({s_t: 1, c_t: 0, s_r: 1, c_r: 0})


@samples(27)
def sample_rigid_joint() -> bool:
    """Modes computed by shooting for a very stiff joint."""
    frequency, shape, ratio = rigid_joint()
    values = sample(27) | _RIGID
    residuals = [float(frequency.lhs.subs(group_numbers(values, mode.beta))) for mode in shoot(values)]
    return all(abs(r) < 1e-5 for r in residuals) and shapes_agree((27,), shape.rhs, ratio.rhs, **_RIGID)


@proves(28)
def prove_cantilever_shape() -> Proof:
    """By hand, the two shapes that neither move nor turn at the joint: in this ratio no force acts at the tip, and with
    (29) no moment."""
    shape, ratio = cantilever_shape()
    yield (shape.lhs, ratio.lhs) == (phi_i, r_2)
    frequency = cantilever_frequency()
    yield from _clamped(shape.rhs.expand(), ratio.rhs, frequency.lhs - frequency.rhs, tip_rows().subs(_BARE))


@samples(28)
def sample_cantilever_shape() -> bool:
    """Modes computed by shooting for a very stiff joint and no end-effector."""
    shape, ratio = cantilever_shape()
    return shapes_agree((28,), shape.rhs, ratio.rhs, **_RIGID, m_e=0.0, J_e=0.0)


@proves(29)
def prove_cantilever_frequency() -> Proof:
    """The determinant of the free end for the two shapes with zero displacement and slope at the joint, by hand."""
    clamped = Matrix([[1, 0], [0, 1], [-1, 0], [0, -1]])
    determinant = (tip_rows().subs(_BARE) * clamped).det() / (2 * lamda**5)
    yield cantilever_frequency().lhs - cantilever_frequency().rhs + determinant


def _apart() -> Eq:
    """Return (30) with the wave number as a separate factor."""
    speed = Pow((2 * pi * natural_frequency().rhs * L**2 / lamda**2) ** 2, HALF, evaluate=False)
    return Eq(symbol("f_i"), Mul(lamda**2 / (2 * pi * L**2), speed, evaluate=False), evaluate=False)


@derived(30, "natural frequency", (17,), shown=_apart)
def natural_frequency() -> Derivation[Eq]:
    """The wave number of (17) converted to a frequency in hertz."""
    wave = mode_form()[1].subs(beta, lamda / L)
    yield "wave number", "(17) with λ = β L.", wave
    (square,) = solve(wave, omega_i**2)
    yield "angular frequency", "Solved, by 2 π to hertz.", Eq(omega_i**2, square)
    return Eq(symbol("f_i"), sqrt(square) / (2 * pi))


@proves(30)
def prove_natural_frequency() -> Proof:
    """Dimensions; for a sine of this wave number, elastic and inertia forces balance."""
    bending, inertia = (symbol(a) * symbol(b) for a, b in (("E", "I_z"), ("rho", "A")))
    yield dimension(natural_frequency()) == Dimension(s=-1)
    yield natural_frequency().lhs == symbol("f_i")
    yield bending * (lamda / L) ** 4 - inertia * (2 * pi * natural_frequency().rhs) ** 2


@samples(30)
def sample_natural_frequency() -> bool:
    """The frequencies of a random arm from the energies of shapes computed by shooting (Rayleigh's quotient)."""
    values = sample(30)
    names = {symbol(name): value for name, value in values.items()}
    for mode in shoot(values):
        energy = modal_numbers(values, mode)
        rayleigh = np.sqrt(energy[symbol("K_i")] / energy[symbol("M_i")]) / (2 * np.pi)
        found = float(natural_frequency().rhs.subs(lamda, mode.beta * values["L"]).subs(names))
        if abs(found / rayleigh - 1) > 1e-8:
            return False
    return True
