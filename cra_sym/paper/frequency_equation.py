"""Elimination of two coefficients and the frequency equation, for every stiffness from zero to infinity: (20)-(23)."""

from __future__ import annotations

from functools import cache

from sympy import Eq, Expr, Matrix, MatrixSymbol, Poly, Symbol, cancel

from cra_sym.mechanics import HamiltonResult, separate
from cra_sym.paper.equations import Derivation, Proof, derived, proves, samples
from cra_sym.paper.evaluation import annihilates, group_numbers
from cra_sym.paper.groups import in_groups
from cra_sym.paper.modes import (
    VALUES,
    c_r,
    c_t,
    coefficients,
    iota,
    kappa_r,
    kappa_t,
    lamda,
    mu,
    product_of,
    root_matrix,
    s_r,
    s_t,
    short_symbols,
    tip_in_short,
    tip_matrix,
)
from cra_sym.paper.motion import dynamics
from cra_sym.paper.oracles import by_hand
from cra_sym.paper.oracles.by_hand import minors
from cra_sym.paper.oracles.shooting import sample, shoot
from cra_sym.symbols import symbol

__all__ = ["frequency_function", "reduced_matrix"]

_c, _s, _ch, _sh = VALUES


def _reduced(expression: Expr) -> Expr:
    """Return a polynomial in the placeholders in normal form: s^2 = 1 - c^2 and S^2 = C^2 - 1."""
    remainder = expression.expand()
    for name, square in ((_s, 1 - _c**2), (_sh, _ch**2 - 1)):
        polynomial = Poly(remainder, name)
        remainder = sum(
            (coefficient * square ** (power // 2) * name ** (power % 2)).expand()
            for (power,), coefficient in polynomial.terms()
        )
    return remainder


@cache
def _elimination() -> tuple[Matrix, Expr]:
    """Return (D, d): the 2 x 2 system for C_1, C_2 times d, free of denominators."""
    root, tip = root_matrix(), tip_in_short()
    determinant = root[:, 2:].det().expand()
    return (determinant * tip[:, :2] - tip[:, 2:] * root[:, 2:].adjugate() * root[:, :2]).applyfunc(
        _reduced
    ), determinant


def reduced_matrix() -> Matrix:
    """Return the 2 x 2 matrix of the system for C_1 and C_2, free of denominators."""
    return _elimination()[0].subs(VALUES)


_entries = Matrix(2, 2, [symbol(name) for name in ("d_11", "d_12", "d_21", "d_22")])


@derived(20, "reduced system", (18, 19))
def reduced_system() -> Derivation[Eq]:
    """(18) gives C_3 and C_4; (19) multiplied by the determinant of that step gives two equations for C_1 and C_2. The
    determinant vanishes only for a pinned and for a sliding root."""
    root = root_matrix()
    named_rows = MatrixSymbol("R", 2, 2), MatrixSymbol("T", 2, 2)
    yield (
        "columns of C_3 and C_4",
        "Coefficients of these two in (18) and (19).",
        (
            Eq(named_rows[0], root[:, 2:], evaluate=False),
            Eq(named_rows[1], tip_matrix()[:, 2:], evaluate=False),
        ),
    )
    yield "determinant of the first step", "Zero only for a pinned and for a sliding root.", _elimination()[1]
    third, fourth = coefficients[2:]
    solved = -root[:, 2:].adjugate() * root[:, :2] * Matrix(coefficients[:2])
    scale = Symbol("d")
    yield (
        "C_3 and C_4 from (18)",
        "By Cramer's rule, multiplied by that determinant d.",
        tuple(Eq(scale * name, value.expand()) for name, value in zip((third, fourth), solved, strict=True)),
    )
    return product_of(_entries, Matrix(coefficients[:2]))


@proves(20)
def prove_reduced_system() -> Proof:
    """With (21), Cramer's rule for the conditions written by hand."""
    yield from minors(reduced_system().subs(_named_entries()).lhs.args[0], by_hand.eliminated())


@samples(20)
def sample_reduced_system() -> bool:
    """Coefficients of modes computed by shooting (random arm) satisfy it; at other wave numbers they do not."""
    return annihilates(reduced_system().subs(_named_entries()).lhs.args[0], 20)


def _named_entries() -> dict[Expr, Expr]:
    return {e.lhs: e.rhs for e in reduced_coefficients()}


def _coefficients_in_short() -> tuple[Eq, ...]:
    grouped = (Eq(name, collect_stiffness(value)) for name, value in zip(_entries, _elimination()[0], strict=True))
    return (*grouped, short_symbols())


@derived(21, "its coefficients", (18, 19, 20), shown=_coefficients_in_short)
def reduced_coefficients() -> Derivation[tuple[Eq, ...]]:
    """The entries after the elimination; the joint is (s_t, c_t), (s_r, c_r), the end-effector μ, ι."""
    raw = tuple(Eq(name, value) for name, value in zip(_entries, _elimination()[0], strict=True))
    yield "C_3 and C_4 put into (19)", "Multiplied by d and simplified with cos² + sin² = 1 and cosh² - sinh² = 1.", raw
    grouped = (collect_stiffness(value).subs(VALUES) for value in _elimination()[0])
    return tuple(Eq(name, value) for name, value in zip(_entries, grouped, strict=True))


@proves(21)
def prove_reduced_coefficients() -> Proof:
    """Cramer's rule for the conditions written by hand: C_1 or C_2 with the two hyperbolic coefficients."""
    yield from minors(Matrix(2, 2, [e.rhs for e in reduced_coefficients()]), by_hand.eliminated())


@derived(22, "determinant", (20,))
def determinant() -> Derivation[Eq]:
    """A mode is a nonzero solution, so the determinant of the reduced system vanishes."""
    yield "matrix of the reduced system", "Its product with C_1 and C_2 vanishes.", _entries
    return Eq(_entries.det(), 0)


@proves(22)
def prove_determinant() -> Proof:
    """The determinant of (18) and (19) for all four coefficients, times that of the elimination."""
    matrix, factor = _elimination()
    whole = Matrix.vstack(root_matrix(), tip_in_short()).det(method="berkowitz")
    named = dict(zip(_entries, matrix, strict=True))
    yield _reduced((determinant().lhs - determinant().rhs).subs(named) - factor * whole)


@cache
def _expanded_determinant() -> Expr:
    """Return (22) with (21) substituted, without squares of sine and hyperbolic sine."""
    return _reduced(determinant().lhs.subs(dict(zip(_entries, _elimination()[0], strict=True))))


@cache
def frequency_polynomial() -> Expr:
    """Return the determinant, normalised to 1 + c C for the cantilever without end-effector."""
    polynomial = cancel(_expanded_determinant() / _elimination()[1]).expand()
    lowest = min(power for (power,), _ in Poly(polynomial, lamda).terms())
    rigid = {s_t: 1, c_t: 0, s_r: 1, c_r: 0, mu: 0, iota: 0}
    unit = (polynomial / lamda**lowest).expand().subs(rigid).subs({_c: 0})
    return (polynomial / (unit * lamda**lowest)).expand()


def _never_zero() -> Expr:
    """Return the factors of the determinant of the reduced system that the frequency equation does not contain."""
    factor = _elimination()[1]
    return cancel(_expanded_determinant() / _reduced(factor * frequency_polynomial())) * factor


def frequency_function() -> tuple[Expr, tuple[Symbol, ...]]:
    """Return Delta and its arguments (lamda, s_t, c_t, s_r, c_r, mu, iota)."""
    return frequency_polynomial().subs(VALUES), (lamda, s_t, c_t, s_r, c_r, mu, iota)


def _frequency_equation_in_short() -> tuple[Eq, Eq]:
    return Eq(collect_stiffness(frequency_polynomial()), 0), short_symbols()


@derived(23, "frequency equation", (21, 22), shown=_frequency_equation_in_short)
def frequency_equation() -> Derivation[Eq]:
    """The expanded determinant, divided by its factors that never vanish, so that a rigid joint without end-effector
    gives 1 + cos λ cosh λ."""
    yield "common factors", "Common factors of (22) with (21): d of the elimination, and powers of λ.", _never_zero()
    yield (
        "expanded",
        "(22) divided by these factors, terms not yet sorted.",
        Eq(frequency_polynomial(), 0),
    )
    return Eq(collect_stiffness(frequency_polynomial()).subs(VALUES), 0)


def collect_stiffness(polynomial: Expr) -> Expr:
    """Return the polynomial grouped by the four products of (s_t, c_t) with (s_r, c_r)."""
    pairs = [a * b for a in (s_t, c_t) for b in (s_r, c_r)]
    generators = Poly(polynomial, s_t, c_t, s_r, c_r)
    return sum(pair * by_power(generators.coeff_monomial(pair)) for pair in pairs)


def by_power(coefficient: Expr) -> Expr:
    """Return a polynomial grouped by powers of lamda, mu and iota."""
    terms = Poly(coefficient, lamda, mu, iota).terms()
    return sum((value.factor() * lamda**a * mu**b * iota**c for (a, b, c), value in terms), start=lamda * 0)


def separated(result: HamiltonResult) -> Expr:
    """Return the characteristic function that :func:`cra_sym.mechanics.separate` finds, in the table's symbols."""
    pairs = {kappa_t: s_t / c_t, kappa_r: s_r / c_r}
    modal = separate(result, parameters={name: value.subs(pairs) for name, value in in_groups().items()})
    (wave,) = modal.basis.wave_numbers
    return modal.characteristic_function.subs(wave, lamda)


@proves(23)
def prove_frequency_equation() -> Proof:
    """The determinant of the four conditions of Hamilton's principle, and of the four written by hand."""
    function = frequency_equation().lhs - frequency_equation().rhs
    yield separated(dynamics(driven=False)) - function
    yield by_hand.determinant() - 2 * lamda**6 * function


@samples(23)
def sample_frequency_equation() -> bool:
    """It changes sign at every frequency parameter of random arms, computed by shooting, and nowhere between."""
    function = frequency_equation().lhs
    for seed in (23, 24):
        values = sample(seed)
        found = [mode.beta * values["L"] for mode in shoot(values)]
        numbers = group_numbers(values, 1.0)
        numeric = function.subs({name: numbers[name] for name in numbers if name != lamda})
        places = [0.1, *(place for root in found for place in (root * (1 - 1e-9), root * (1 + 1e-9)))]
        signs = [float(numeric.subs(lamda, place)) > 0 for place in places]
        if signs != [k // 2 % 2 == 0 for k in range(len(places))]:
            return False
    return True
