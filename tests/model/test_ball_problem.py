"""Coefficients in exact arithmetic: fractions, what switches along x, and where."""

from __future__ import annotations

from fractions import Fraction

import pytest
import sympy as sp

import cra_sym as cra
from cra_sym.mechanics.breakpoints import switches
from cra_sym.model.ball_problem import bound
from cra_sym.model.exact import exact_kernel, exact_matrix
from cra_sym.model.resolved import resolved
from cra_sym.symbols import t, v, x

flint = pytest.importorskip("flint", reason="the extra 'certify' brings python-flint")

a, b, c, z = sp.symbols("a b c z")


def test_fractions_stay_fractions():
    """Reciprocals, sums of floats and fractions, and large integers are exact."""
    kernel = exact_kernel([1 / a, 0.1 + b / 3, sp.Integer(2) ** 70 + a, 1 / (a + b) ** 2, sp.S.Zero], (a, b))
    found = kernel(Fraction, None, Fraction(3), Fraction(7))
    assert found == [Fraction(1, 3), Fraction(0.1) + Fraction(7, 3), 2**70 + 3, Fraction(1, 100), 0]


def test_numbers_in_the_lagrangian_are_exact():
    """One over 0.3 is not the rounded quotient, and 0.7 / 3 is a third of the number given."""
    held = [v.subs(x, 0)]
    string = cra.Model(
        a * sp.Float(0.7) * v.diff(t) ** 2 / 2 - sp.Float(0.3) * v.diff(x) ** 2 / 2,
        fields=[v], x=x, domain=(0, 0.1), t=t, essential=held,
    )  # fmt: skip
    one = bound(flint, string.numerics, {}, {"a": 1 / 3}, damped=False).exact
    (_, (flexible, _), (mass, _), _) = one.spans[0].system.entries
    exact = [Fraction(1) / Fraction(0.3), -Fraction(1 / 3) * Fraction(0.7), Fraction(0.1)]
    assert [Fraction(int(q.p), int(q.q)) for q in (flexible[0], mass[1], one.spans[0].length)] == exact


def test_a_matrix_is_its_numerators_and_denominators():
    entries = [b * z**2 - c * z + a, 0, 1 / (b * (1 + c * z)), z / (a + z**2) + 0.25]
    matrix = exact_matrix(sp.Matrix(2, 2, entries), z, (a, b, c))(Fraction, None, *map(Fraction, (2, 3, 5)))
    at = matrix.at(Fraction(1, 7))
    for k, entry in enumerate(entries):
        assert at[k // 2][k % 2] == Fraction(
            *sp.Rational(
                sp.nsimplify(entry, rational=True).subs({a: 2, b: 3, c: 5, z: sp.Rational(1, 7)})
            ).as_numer_denom()
            if entry
            else (0, 1)
        )
    # 1 / 3 (1 - 5 z + 25 z^2 ..), and |1 / (1 + 5 z)| <= 1 / (1 - 5 r)
    assert [part[1][0] for part in matrix.series(3)] == [Fraction(1, 3), Fraction(-5, 3), Fraction(25, 3)]
    assert matrix.bound(Fraction(1, 10))[1][0] == Fraction(2, 3) and matrix.bound(Fraction(1, 5)) is None


EXPRESSIONS = [
    3 + b * sp.Heaviside(x - a),
    sp.Piecewise((b, x < a), (c, x <= 2 * a), (1 / b, True)),
    1 / sp.Piecewise((2, sp.And(x > a, x < b)), (c, True)) + sp.sign(a - x),
    sp.Abs(x - a) / (x - a) * c + sp.Max(x - a, 0) - sp.Min(x, b),
    sp.SingularityFunction(x, a, 0) + sp.SingularityFunction(x, b, 1),
    sp.Piecewise((c, sp.Ne(x, a)), (5, True)),
]


@pytest.mark.parametrize("expression", EXPRESSIONS)
def test_parts_are_the_expression_there(expression):
    values = {a: sp.Rational(1, 3), b: sp.Rational(3, 4), c: sp.Rational(7, 5)}
    known = [switch.expression for switch in switches([expression], x)]
    for place in (sp.Rational(1, 10), sp.Rational(1, 2), sp.Rational(9, 10)):
        at = {**values, x: place}
        part = resolved(expression, x, {known_: (1 if known_.subs(at) > 0 else -1) for known_ in known})
        assert not part.has(sp.Piecewise, sp.Heaviside, sp.sign, sp.Abs, sp.Max, sp.Min)
        assert sp.simplify(part.subs(at) - expression.subs(at).rewrite(sp.Piecewise)) == 0


def test_a_place_outside_of_the_domain_is_refused():
    string = cra.Model(
        v.diff(t) ** 2 / 2 - v.diff(x) ** 2 / 2, fields=[v], x=x, domain=(0, 1), t=t, essential=[v.subs(x, 0)],
        inside=[(a, b * v.diff(t) ** 2 / 2)],
    )  # fmt: skip
    layout = string.numerics("ball_layout", False)
    assert layout.cuts(Fraction, None, [Fraction(1, 2), Fraction(1)])[1][0] == ((0,),)
    with pytest.raises(ValueError, match=r"inside: .* not at x = 1\.5"):
        layout.cuts(Fraction, None, [Fraction(3, 2), Fraction(1)])
