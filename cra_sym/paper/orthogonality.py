"""Orthogonality of the modes with the end-effector's inertia, K_i = omega_i^2 M_i, and the modal energies (5)."""

from __future__ import annotations

from typing import Any

from sympy import Eq, Expr, Integral, solve

from cra_sym.arm.lagrangian import HALF
from cra_sym.paper.energy import (
    L,
    generalised,
    inner_mass,
    inner_stiffness,
    kinetic,
    modal_numbers,
    phi_i,
    phi_j,
    potential,
    q_i,
    q_j,
    separation,
    single_mode,
    t,
    tidy,
    w,
    x,
)
from cra_sym.paper.equations import Derivation, Proof, derived, proves, samples
from cra_sym.paper.evaluation import at, evaluate, put, termwise, virtual_factors
from cra_sym.paper.joint import end_values, mode_conditions, section_forces
from cra_sym.paper.modal_sum import ModalSum, member, written_out
from cra_sym.paper.motion import mode_field_equation
from cra_sym.paper.oracles.shooting import integrate, sample, shoot
from cra_sym.symbols import symbol

__all__ = ["modal_energies", "orthogonality", "stiffness_identity"]

omega_i, omega_j, M_i, K_i, K_b = (symbol(name) for name in ("omega_i", "omega_j", "M_i", "K_i", "K_b"))


@derived("16b", "stiffness and mass of two modes", (6, "10b", "16a"))
def stiffness_identity() -> Derivation[tuple[Eq, Eq]]:
    """Two integrations by parts transfer two derivatives from mode j to mode i, where the field equation and the four
    end conditions replace them: the stiffness product is ω_i² times the mass product, including springs, tip mass and
    rotary inertia; for i = j, K_i = ω_i² M_i."""
    shear, moment = (single_mode(law.rhs, phi_i) for law in section_forces())
    by_parts = moment * phi_j.diff(x) - shear * phi_j
    along = inner_stiffness(phi_i, phi_j, joint=False) - Integral(by_parts.diff(x) + shear.diff(x) * phi_j, (x, 0, L))
    if termwise(along.doit(integrals=False)) != 0:
        raise ArithmeticError(f"integration by parts leaves {along}")
    bent = inner_stiffness(phi_i, phi_j, joint=False)
    by_parts_twice = at(by_parts, L) - at(by_parts, 0) + Integral(shear.diff(x) * phi_j, (x, 0, L))
    yield (
        "integration by parts, twice",
        "Of the bending energy of the manipulator.",
        Eq(bent, by_parts_twice.doit(integrals=False)),
    )
    known = _balance("i")
    interior = Integral(shear.diff(x).xreplace(known) * phi_j, (x, 0, L))
    ends = (at(by_parts, L) - at(by_parts, 0)).xreplace(known)
    put_in = Eq(bent, (interior + ends).doit(integrals=False).expand())
    yield "equations of mode i put in", "(10b) replaces the fourth derivative, (16a) the terms at the ends.", put_in
    springs = inner_stiffness(phi_i, phi_j) - inner_stiffness(phi_i, phi_j, joint=False)
    mass = inner_mass(phi_i, phi_j)
    rest = termwise(interior + ends + springs - omega_i**2 * mass)
    if rest != 0:
        raise ArithmeticError(f"stiffness and mass products differ by {rest}")
    return Eq(inner_stiffness(phi_i, phi_j), omega_i**2 * mass), Eq(K_i, omega_i**2 * M_i)


def _balance(index: str) -> dict[Expr, Expr]:
    """Return the highest derivatives of mode ``index`` by (10b) and (16a), along it and at both ends."""
    equations = (mode_field_equation(), *mode_conditions())
    highest = (phi_i.diff(x, 4), *end_values(phi_i))
    pairs = zip(highest, equations, strict=True)
    return {member(value, index): member(solve(e, value)[0], index) for value, e in pairs}


def _is_mode(factors: tuple[Expr, ...], index: str) -> Proof:
    """Yield the five factors of a virtual shape, reduced by (10b) and (16a) of mode ``index``."""
    known = _balance(index)
    for factor in factors:
        yield factor.xreplace(known)


@proves("16b")
def prove_stiffness_identity() -> Proof:
    """The difference of both sides is the virtual work of the forces of mode i, which balance by (10b) and (16a), on
    any mode j; the second equation follows for j = i by (6)."""
    pair, single = stiffness_identity()
    yield from _is_mode(virtual_factors(pair.lhs - pair.rhs, phi_j), "i")
    alone = put(pair.lhs - pair.rhs, {phi_j: phi_i})
    yield termwise((single.lhs - single.rhs).subs(_generalised()) - alone)


def _generalised(index: str = "i") -> dict[Expr, Expr]:
    """Return the symbols of mass, stiffness and participation factor of a mode, with their definitions by (6)."""
    return {member(e.lhs, index): member(e.rhs, index) for e in generalised()}


@samples("16b")
def sample_stiffness_identity() -> bool:
    """Both products of all pairs of modes of a random arm, computed by shooting, by quadrature."""
    values = sample(161)
    shapes = shoot(values)
    pair, single = stiffness_identity()
    for first in shapes:
        numbers = modal_numbers(values, first) | {omega_i: first.omega}
        if abs((single.lhs / single.rhs).subs(numbers) - 1) > 1e-8:
            return False
        for second in shapes:
            sides = (
                evaluate(side, values | {"omega_i": first.omega}, {phi_i: first, phi_j: second}) for side in pair.args
            )
            scale = first.omega**2 * numbers[M_i]
            if abs(next(sides) - next(sides)) > 1e-7 * scale:
                return False
    return True


@derived("16c", "orthogonality", ("16b",))
def orthogonality() -> Derivation[tuple[Eq, Eq]]:
    """Exchange i and j in the identity and subtract: (ω_i² - ω_j²) times the mass product is zero, so for
    different frequencies both products vanish."""
    identity, _ = stiffness_identity()
    swapped = Eq(*(_swap(side) for side in identity.args))
    yield "i and j exchanged", "The identity (16b) for mode i and for mode j.", (identity, swapped)
    difference = (identity.lhs - swapped.lhs) - (identity.rhs - swapped.rhs)
    mass = inner_mass(phi_i, phi_j)
    if (difference + (omega_i**2 - omega_j**2) * mass).expand() != 0:
        raise ArithmeticError(f"the products are not symmetric: {difference}")
    subtracted = Eq((omega_i**2 - omega_j**2) * mass, 0, evaluate=False)
    yield "subtracted", "The stiffness product is symmetric and cancels.", subtracted
    return Eq(mass, 0), Eq(inner_stiffness(phi_i, phi_j), 0)


def _swap(expression: Expr) -> Expr:
    """Exchange the modes i and j."""
    aside = expression.replace(phi_j.func, symbol("eta").func).xreplace({omega_j: symbol("omega")})
    return member(aside, "j").replace(symbol("eta").func, phi_i.func).xreplace({symbol("omega"): omega_i})


@proves("16c")
def prove_orthogonality() -> Proof:
    """The forces of each mode balance by (10b) and (16a): the stiffness product minus ω_i² times the mass product, the
    work of mode i on mode j, vanishes, and so does that with ω_j². Hence ω_i² - ω_j² times the mass product is zero,
    and the stiffness product as well."""
    mass, stiffness = (e.lhs - e.rhs for e in orthogonality())
    yield from _is_mode(virtual_factors(stiffness - omega_i**2 * mass, phi_j), "i")
    yield from _is_mode(virtual_factors(stiffness - omega_j**2 * mass, phi_i), "j")


@samples("16c")
def sample_orthogonality() -> bool:
    """Both products of different modes of a random arm vanish; without the end-effector they would not."""
    values = sample(163)
    first, second, third = shoot(values)
    for pair in ((first, second), (first, third), (second, third)):
        modes = dict(zip((phi_i, phi_j), pair, strict=True))
        for product in (e.lhs for e in orthogonality()):
            beam = sum(evaluate(integral, values, modes) for integral in product.atoms(Integral))
            if abs(evaluate(product, values, modes)) > 1e-8 * abs(beam):
                return False
    return True


@derived("16d", "stiffness without the joint springs", (4, 6, "16b"))
def stiffness_of_manipulator_alone() -> Derivation[Eq]:
    """(4) without the springs, as in the paper, omits their contribution to the generalised stiffness: K_b / M_i
    differs from ω_i² unless the joint is rigid or does not move in the mode."""
    springs = inner_stiffness(phi_i, phi_i) - inner_stiffness(phi_i, phi_i, joint=False)
    yield "share of the springs", "The second energy of (4) minus the first, for one mode.", springs
    return Eq(K_b, stiffness_identity()[1].rhs - springs)


@proves("16d")
def prove_stiffness_of_manipulator_alone() -> Proof:
    """Twice the first energy of (4) differs from it by the work of the forces of the mode on the mode itself, which
    vanishes by (10b) and (16a)."""
    energy = single_mode(potential()[0].rhs) / q_i**2
    alone, size, virtual = stiffness_of_manipulator_alone(), symbol("epsilon"), symbol("eta")
    gap = 2 * energy - alone.rhs.subs(_generalised())
    varied = put(gap, {phi_i: phi_i + size * virtual}).diff(size).subs(size, 0).doit(integrals=False)
    yield alone.lhs == K_b
    yield from _is_mode(virtual_factors(varied, virtual), "i")


@samples("16d")
def sample_stiffness_of_manipulator_alone() -> bool:
    """The strain energy of modes computed by shooting; it is less than ω_i² M_i by the energy of the springs."""
    values, alone = sample(164), stiffness_of_manipulator_alone().rhs
    for mode in shoot(values):
        strain = evaluate(inner_stiffness(phi_i, phi_i, joint=False), values, {phi_i: mode})
        numbers = modal_numbers(values, mode) | {omega_i: mode.omega}
        predicted = evaluate(alone.subs(numbers), values, {phi_i: mode})
        if abs(strain / predicted - 1) > 1e-8 or strain / (mode.omega**2 * numbers[M_i]) > 0.999:
            return False
    return True


# Modal energies (5) ---------------------------------------------------------------------------------------------


def _quadratic_form(energy: Expr, variables: list[Expr]) -> dict[tuple[Expr, Expr], Expr]:
    """Second derivatives of an energy with respect to generalised coordinates or velocities."""
    names = [symbol("C_1"), symbol("C_2"), symbol("C_3")][: len(variables)]
    plain = energy.subs(dict(zip(variables, names, strict=True)))
    pairs = [(row, column) for row in range(len(names)) for column in range(row, len(names))]
    return {(variables[r], variables[c]): plain.diff(names[r]).diff(names[c]).doit(integrals=False) for r, c in pairs}


def _modal(energy: Expr, variables: list[Expr], named: dict[Expr, Expr]) -> Expr:
    """Write a quadratic energy of the modes i and j as a sum over all modes, with its coefficients named."""
    form = {pair: tidy(value).subs(named) for pair, value in _quadratic_form(energy, variables).items()}
    total = energy * 0
    for (first, second), value in form.items():
        factor = HALF if first == second else 1
        if {first, second} <= {q_i, q_i.diff(t), w.diff(t)}:
            term = factor * value * first * second
            total += term if {first, second} == {w.diff(t)} else ModalSum(term)
        elif first.has(q_i) and second.has(q_j) and value != 0:
            raise ArithmeticError(f"modes i and j do not decouple: {value}")
    return total


@derived(5, "modal energies", (2, 3, 4, 6, "16c"))
def modal_energies() -> Derivation[tuple[Eq, Eq]]:
    """(2) substituted in (3) and (4): by orthogonality there are no products of different modes."""
    two = separation().rhs.members("i", "j")
    both = tuple(single_mode(energy.rhs, two) for energy in (kinetic(), potential()[1]))
    yield "two modes", "Any two terms of (2) substituted in (3) and (4).", both
    products = tuple(e.lhs for e in orthogonality())
    yield "products of two different modes", "Their factors, which vanish by (16c).", products
    named = {tidy(e.rhs): e.lhs for e in generalised()} | {tidy(e.lhs): e.rhs for e in orthogonality()}
    motion = _modal(single_mode(kinetic().rhs, two), [q_i.diff(t), q_j.diff(t), w.diff(t)], named)
    strain = _modal(single_mode(potential()[1].rhs, two), [q_i, q_j], named)
    return Eq(symbol("T"), motion.doit()), Eq(symbol("U"), strain)


@proves(5)
def prove_modal_energies() -> Proof:
    """Both energies (3) and (4) of any two modes, with (6); the remaining terms are the products of (16c)."""
    two = separation().rhs.members("i", "j")
    mass, stiffness = (e.lhs - e.rhs for e in orthogonality())
    products = (mass * q_i.diff(t) * q_j.diff(t), stiffness * q_i * q_j)
    for e, whole, product in zip(modal_energies(), (kinetic(), potential()[1]), products, strict=True):
        modes = written_out(e.rhs, "i", "j")
        yield e.lhs == whole.lhs
        yield termwise(modes.subs(_generalised() | _generalised("j")) + product - single_mode(whole.rhs, two))


@samples(5)
def sample_modal_energies() -> bool:
    """The energies of a random arm moving in three modes, computed by shooting, by quadrature of (3) and (4)."""
    values = sample(5)
    shapes, length = shoot(values), values["L"]
    q, q_dot, w_dot = [0.3, -0.5, 0.2], [0.7, 0.4, -0.6], 0.9

    def elastic(place: Any, amplitudes: list[float], derivative: int = 0) -> Any:
        return sum(a * shape(place, derivative) for a, shape in zip(amplitudes, shapes, strict=True))

    line_mass, bending = values["rho"] * values["A"], values["E"] * values["I_z"]
    kinetic = (
        values["m_b"] * w_dot**2
        + values["m_e"] * (w_dot + elastic(length, q_dot)) ** 2
        + values["J_e"] * elastic(length, q_dot, 1) ** 2
        + integrate(lambda place: line_mass * (w_dot + elastic(place, q_dot)) ** 2, length)
    ) / 2
    potential = (
        values["k_t"] * elastic(0.0, q) ** 2
        + values["k_r"] * elastic(0.0, q, 1) ** 2
        + integrate(lambda place: bending * elastic(place, q, 2) ** 2, length)
    ) / 2
    found = []
    for e in modal_energies():
        sums = dict.fromkeys(e.rhs.atoms(ModalSum), 0.0)
        for s in sums:
            for shape, now, rate in zip(shapes, q, q_dot, strict=True):
                numbers = {q_i.diff(t): rate, w.diff(t): w_dot, q_i: now}
                sums[s] += float(s.function.subs(numbers).subs(modal_numbers(values, shape)))
        total = e.rhs.subs(sums).subs(w.diff(t), w_dot)
        found.append(float(total.subs({symbol(name): value for name, value in values.items()})))
    return bool(abs(found[0] / kinetic - 1) < 1e-10 and abs(found[1] / potential - 1) < 1e-10)
