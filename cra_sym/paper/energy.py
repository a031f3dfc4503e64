"""Displacement, energies and the Lagrangian of the arm: equations (1)-(4), (6) and (7)."""

from __future__ import annotations

from functools import cache
from typing import Any

from sympy import Eq, Expr, Function, Integral, S, symbols

from cra_sym.arm.lagrangian import ArmLagrangian, kinetic_energy, paper_lagrangian, potential_energy
from cra_sym.paper.equations import Derivation, Proof, derived, numbered, proves
from cra_sym.paper.evaluation import evaluate, put, termwise
from cra_sym.paper.modal_sum import ModalSum, written_out
from cra_sym.paper.oracles import forces
from cra_sym.symbols import Dimension, dimension, symbol

__all__ = ["inner_mass", "inner_stiffness", "single_mode"]

x, t, w, v, y, L = (symbol(name) for name in ("x", "t", "w", "v", "y", "L"))
E, I_z, rho, A = (symbol(name) for name in ("E", "I_z", "rho", "A"))
m_b, m_e, J_e, k_t, k_r = (symbol(name) for name in ("m_b", "m_e", "J_e", "k_t", "k_r"))
phi_i, phi_j, q_i, q_j = (symbol(name) for name in ("phi_i", "phi_j", "q_i", "q_j"))

ENERGY = Dimension(2, 1, -2)


# Displacement (1)-(2) -------------------------------------------------------------------------------------------


@numbered(1, "displacement", "definition")
def displacement() -> Eq:
    """The manipulator is carried by the base: the absolute displacement is the motion of the base plus the elastic
    displacement."""
    return Eq(y, w + v)


@proves(1)
def prove_displacement() -> Proof:
    """Both sides are lengths; a rigid arm moves as its base; with the base at rest only the elastic displacement
    remains."""
    seen = displacement().rhs
    yield dimension(displacement()) == Dimension(m=1)
    yield seen.subs(v, 0) - w
    yield seen.subs(w, 0) - v


@numbered(2, "separation of variables", "assumption")
def separation() -> Eq:
    """The elastic displacement is a sum of mode shapes, each multiplied by its generalised coordinate."""
    return Eq(v, ModalSum(phi_i * q_i))


@proves(2)
def prove_separation() -> Proof:
    """Both sides are lengths; one term is separable, v v_xt = v_x v_t, and a sum of two is not."""
    one, two = written_out(separation().rhs, "i"), written_out(separation().rhs, "i", "j")

    def coupling(shape: Expr) -> Expr:
        return shape * shape.diff(x, t) - shape.diff(x) * shape.diff(t)

    yield dimension(separation()) == Dimension(m=1)
    yield one - phi_i * q_i
    yield coupling(one)
    yield coupling(two).expand() != 0


def single_mode(expression: Expr, shape: Expr = phi_i * q_i) -> Expr:
    """Return ``expression`` with the elastic displacement v replaced by ``shape``, at the ends too."""
    return put(expression, {v: shape})


# Energies (3)-(4) -----------------------------------------------------------------------------------------------


@numbered(3, "kinetic energy", "definition", (1,))
def kinetic() -> Eq:
    """Base, end-effector (with the rotary inertia J_e, which the paper leaves out) and manipulator."""
    return Eq(symbol("T"), kinetic_energy().total())


@proves(3)
def prove_kinetic() -> Proof:
    """It has the dimension of an energy; an arm that rotates rigidly about a root moving with the base has the kinetic
    energy given by its mass, first moment of mass and moment of inertia."""
    turned = single_mode(kinetic().rhs, x * q_i).doit()
    mass, static, inertia = forces.rigid_body()
    base, turn = w.diff(t), q_i.diff(t)
    yield dimension(kinetic()) == ENERGY
    yield turned - (m_b + mass) * base**2 / 2 - static * base * turn - (inertia + J_e) * turn**2 / 2


@numbered(4, "potential energy", "definition")
def potential() -> tuple[Eq, Eq]:
    """First as the paper describes it, the bending energy of the manipulator alone; then with the two joint springs,
    without which the generalised stiffness (6) would contradict the natural frequency (30)."""
    return Eq(symbol("U_b"), potential_energy(joint=False).total()), Eq(symbol("U"), potential_energy().total())


@proves(4)
def prove_potential() -> Proof:
    """They have the dimension of energy; an arc of radius R stores E I L / (2 R^2) for any displacement and rotation at
    the joint, and the joint stores the energy of two springs."""
    give, turn, radius = symbol("C_1") * L, symbol("C_2"), symbol("h")
    beam, full = (single_mode(e.rhs, give + turn * x + x**2 / (2 * radius)).doit() for e in potential())
    arc, springs = E * I_z * L / (2 * radius**2), (k_t * give**2 + k_r * turn**2) / 2
    yield all(dimension(e) == ENERGY for e in potential())
    yield beam - arc
    yield full - arc - springs


# Modal masses and stiffnesses (6) ------------------------------------------------------------------------------


def inner_mass(first: Expr, second: Expr) -> Expr:
    """Return the inner product of two shapes in which (3), the base at rest, is half a square."""
    return put(_inertia()[0], dict(zip(_SHAPES, (first, second), strict=True)))


def inner_stiffness(first: Expr, second: Expr, joint: bool = True) -> Expr:
    """Return the inner product of two shapes in which (4), unless asked without the joint, is half a square."""
    return put(_elasticity(joint), dict(zip(_SHAPES, (first, second), strict=True)))


_SHAPES = tuple(Function(name)(x) for name in ("first", "second"))
_SIZES = symbols("first_size second_size")
_COMBINED = sum(size * shape for size, shape in zip(_SIZES, _SHAPES, strict=True))


@cache
def _inertia() -> tuple[Expr, Expr]:
    """Return the coefficients in (3) of the product of two modal velocities, and of the first with the velocity of the
    base."""
    base = symbol("C_1")
    motion = {v: _COMBINED * t, w: base * t}
    return _coefficient(kinetic_energy(), motion, *_SIZES), _coefficient(kinetic_energy(), motion, _SIZES[0], base)


@cache
def _elasticity(joint: bool) -> Expr:
    """Return the coefficient in (4) of two shapes."""
    return _coefficient(potential_energy(joint=joint), {v: _COMBINED}, *_SIZES)


def _coefficient(energy: ArmLagrangian, motion: dict[Expr, Expr], *sizes: Expr) -> Expr:
    """Return the coefficient of a product of two amplitudes in the energy of a motion."""
    return ArmLagrangian(*(put(part, motion).diff(*sizes).expand() for part in energy)).total()


@derived(6, "generalised mass, stiffness, participation", (2, 3, 4))
def generalised() -> Derivation[tuple[Eq, Eq, Eq]]:
    """Mass and stiffness of a mode, and its participation factor for accelerations of the base: with one mode and the
    base moving, the coefficients in (3) and (4) of the squares of the modal velocity and coordinate and of the product
    of both velocities."""
    moving = single_mode(kinetic_energy().total()), single_mode(potential_energy().total())
    yield "energies of one mode", "One term of (2) substituted in (3) and (4).", moving
    return (
        Eq(symbol("M_i"), inner_mass(phi_i, phi_i)),
        Eq(symbol("K_i"), inner_stiffness(phi_i, phi_i)),
        Eq(symbol("Gamma_i"), put(_inertia()[1], {_SHAPES[0]: phi_i})),
    )


@proves(6)
def prove_generalised() -> Proof:
    """Dimensions; the work of the inertia and elastic forces of a mode on the mode itself, and of the inertia forces of
    the mode on the base, written by hand."""
    M, K, Gamma = (e.rhs for e in generalised())
    yield [dimension(e) for e in generalised()] == [Dimension(kg=1), Dimension(kg=1, s=-2), Dimension(kg=1)]
    yield termwise(M - forces.mass_product(phi_i, phi_i))
    yield termwise(K - forces.stiffness_product(phi_i, phi_i))
    yield termwise(Gamma - forces.mass_product(phi_i, S.One))


def tidy(value: Expr) -> Expr:
    """Return the integrals of ``value`` with one common integrand shape: expanded, constants inside."""
    return value.expand().replace(lambda e: isinstance(e, Integral), lambda e: Integral(e.function.expand(), *e.limits))


def modal_numbers(values: dict[str, float], shape: Any) -> dict[Expr, float]:
    """Return M_i, K_i and Gamma_i of a mode computed by shooting: (6) by quadrature."""
    return {e.lhs: evaluate(e.rhs, values, {phi_i: shape}) for e in generalised()}


# Lagrangian (7) -------------------------------------------------------------------------------------------------


@numbered(7, "Lagrangian", "definition", (3, 4))
def lagrangian_function() -> Eq:
    """Kinetic minus potential energy, including the springs of the joint."""
    return Eq(symbol("Lcal"), paper_lagrangian().total())


@proves(7)
def prove_lagrangian_function() -> Proof:
    """It has the dimension of energy and is the difference of (3) and (4) for every motion."""
    yield dimension(lagrangian_function()) == ENERGY
    yield termwise(lagrangian_function().rhs - kinetic().rhs + potential()[1].rhs)
