"""The mode shape with its coefficients: equations (24)-(26)."""

from __future__ import annotations

from sympy import Eq, Expr, MatMul, Matrix, cancel

from cra_sym.paper.energy import phi_i
from cra_sym.paper.equations import Derivation, Proof, derived, proves, samples
from cra_sym.paper.evaluation import group_numbers, shapes_agree, shot_coefficients
from cra_sym.paper.frequency_equation import reduced_matrix, reduced_system
from cra_sym.paper.modes import C_1, C_2, C_3, C_4, basis, c_r, c_t, coefficients, mode_form, r_2, root_matrix, s_r, s_t
from cra_sym.paper.oracles import by_hand
from cra_sym.paper.oracles.shooting import sample, shoot

__all__ = ["circular_ratio", "coefficients_of", "mode_shape"]


@derived(24, "coefficient ratios", (18,))
def coefficient_ratios() -> Derivation[tuple[Eq, ...]]:
    """The root system solved for the hyperbolic coefficients."""
    root = root_matrix()
    sides = root[:, 2:], -root[:, :2]
    yield (
        "root system, sorted",
        "C_3 and C_4 on the left, C_1 and C_2 on the right.",
        Eq(MatMul(sides[0], Matrix(coefficients[2:])), MatMul(sides[1], Matrix(coefficients[:2])), evaluate=False),
    )
    solved = -root[:, 2:].adjugate() * root[:, :2] * Matrix(coefficients[:2]) / root[:, 2:].det()
    return tuple(
        Eq(name, sum(cancel(value.expand().coeff(c)) * c for c in (C_1, C_2)))
        for name, value in zip((C_3, C_4), solved.applyfunc(cancel), strict=True)
    )


@proves(24)
def prove_coefficient_ratios() -> Proof:
    """They satisfy the conditions at the joint written by hand; for a rigid joint they are -C_1, -C_2."""
    third, fourth = coefficient_ratios()
    rigid = {s_t: 1, c_t: 0, s_r: 1, c_r: 0}
    yield (third.lhs, fourth.lhs) == (C_3, C_4)
    yield from by_hand.root_rows() * Matrix([C_1, C_2, third.rhs, fourth.rhs])
    yield third.rhs.subs(rigid) + C_1
    yield fourth.rhs.subs(rigid) + C_2


@samples(24)
def sample_coefficient_ratios() -> bool:
    """Modes of a random arm, computed by shooting, have these coefficients."""
    found = {e.lhs: e.rhs for e in coefficient_ratios()}
    values = sample(26)
    for mode in shoot(values):
        known = dict(zip(coefficients, shot_coefficients(mode), strict=True))
        numbers = group_numbers(values, mode.beta)
        for name, ratio in found.items():
            if abs(float(ratio.subs(numbers).subs(known)) - known[name]) > 1e-8 * max(map(abs, known.values())):
                return False
    return True


@derived(25, "mode shape", (17, 24))
def mode_shape() -> Derivation[Eq]:
    """(24) substituted in (17), with C_2 / C_1 = r_2; the factor C_1 remains arbitrary."""
    put_in = mode_form()[0].rhs.subs({e.lhs: e.rhs for e in coefficient_ratios()})
    yield "ratios put in", "(24) in (17).", Eq(phi_i, put_in)
    shape = put_in.subs(C_2, r_2 * C_1)
    inside = (shape / C_1).expand()
    plain, second = inside.coeff(r_2, 0), inside.coeff(r_2, 1)
    return Eq(phi_i, C_1 * (_gather(plain) + r_2 * _gather(second)))


def _gather(shape: Expr) -> Expr:
    return sum(cancel(shape.coeff(function)) * function for function in basis())


def _ratio_by_parts() -> Eq:
    entries = reduced_system().lhs.args[0]
    return Eq(r_2, -entries[0, 0] / entries[0, 1])


@derived(26, "ratio of the circular coefficients", (20, 21), shown=_ratio_by_parts)
def circular_ratio() -> Derivation[Eq]:
    """From the first row of the reduced system; at a natural frequency the second row is proportional to it."""
    system = reduced_system().lhs
    row = (system.args[0] * system.args[1])[0]
    yield "first row", "Of the reduced system (20), to be solved for C_2 / C_1; its entries are (21).", Eq(row, 0)
    first, second = reduced_matrix()[0, :]
    return Eq(r_2, -first / second)


@proves(25)
def prove_mode_shape() -> Proof:
    """For any r_2, the functions of (17) with coefficients that satisfy the conditions at the joint written by hand,
    C_2 = r_2 C_1."""
    row = coefficients_of(mode_shape().rhs)
    yield from by_hand.root_rows() * row
    yield row[1] - r_2 * row[0]
    yield row[0] != 0


def coefficients_of(shape: Expr) -> Matrix:
    """Return the coefficients of the functions of (17) in a mode shape."""
    expanded = shape.expand()
    return Matrix([expanded.coeff(function) for function in basis()])


@samples(25)
def sample_mode_shape() -> bool:
    """With (26), the shape of modes of a random arm computed by shooting."""
    return shapes_agree((25,), mode_shape().rhs, circular_ratio().rhs)


@proves(26)
def prove_circular_ratio() -> Proof:
    """It satisfies the force condition at the tip, written by hand."""
    yield circular_ratio().lhs == r_2
    yield (by_hand.eliminated() * Matrix([1, circular_ratio().rhs]))[0]


@samples(26)
def sample_circular_ratio() -> bool:
    """The ratio for modes of a random arm computed by shooting, and the second row of the reduced system."""
    values = sample(28)
    for mode in shoot(values):
        numbers = group_numbers(values, mode.beta)
        known = shot_coefficients(mode)
        third, fourth = reduced_matrix().subs(numbers)[1, :]
        found, expected = float(circular_ratio().rhs.subs(numbers)), float(known[1] / known[0])
        if max(abs(found - expected), abs(-third / fourth - expected)) > 1e-7 * abs(expected):
            return False
    return True
