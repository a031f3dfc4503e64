"""From amplitude equations to the stability boundary: rotating frame, characteristic polynomial, its roots."""

from __future__ import annotations

from dataclasses import dataclass

from sympy import (
    Expr,
    I,
    ImmutableMatrix,
    Matrix,
    Poly,
    Rational,
    S,
    Symbol,
    cancel,
    factor,
    factor_terms,
    fraction,
    numer,
    rem,
    solve,
    sqrt,
    together,
    zeros,
)

from cra_sym.mechanics.two_scales import EPSILON, SIGMA, TwoScaleExpansion, amplitude, conjugate_amplitude

__all__ = ["DETUNING", "Border", "border", "rotating_matrices"]

#: varpi minus the exact resonance frequency.
DETUNING = Symbol("Delta", real=True)


@dataclass(frozen=True)
class Border:
    """Boundary of the zone in which amplitudes grow.

    Attributes
    ----------
    state : Matrix
        The two amplitudes in the rotating frame that determine stability.
    matrix : Matrix
        Their equation is d(state)/dt = matrix x state.
    condition : Expr
        Polynomial in the detuning: negative where the amplitudes grow, zero at the border.
    centre, half_width : Expr
        The detunings of the border are centre - half_width and centre + half_width.
    threshold : Expr
        Smallest epsilon, to first order, at which the amplitudes can grow; zero without damping.
    """

    state: ImmutableMatrix
    matrix: ImmutableMatrix
    condition: Expr
    centre: Expr
    half_width: Expr
    threshold: Expr


def rotating_matrices(expansion: TwoScaleExpansion) -> tuple[Matrix, list[Matrix]]:
    """Return the state and, order by order, the constant matrices of the amplitude equations in the rotating frame.

    The frame rotates each amplitude at half the detuning times the number of periods of the tongue, which makes the
    equations autonomous.
    """
    r = expansion.resonance
    partner = amplitude(r.second) if r.sign == -1 else conjugate_amplitude(r.second)
    state = Matrix([amplitude(r.first), partner])
    matrices = []
    for k, rates in enumerate(expansion.rates, start=1):
        rows = [sum((c for c in rates[a].terms.values()), S.Zero) * EPSILON**k for a in state]
        # the linear part: a weak cubic term does not affect the stability of rest
        matrix = Matrix(2, 2, lambda i, j, rows=rows: rows[i].diff(state[j]).subs(dict.fromkeys(state, 0)))
        matrices.append(matrix.subs(SIGMA, DETUNING / EPSILON**r.tongue).expand())
    frame = Matrix([[I * DETUNING * r.tongue / 2, 0], [0, -I * DETUNING * r.tongue / 2]])
    matrices[r.tongue - 1] -= frame
    return state, matrices


def border(expansion: TwoScaleExpansion) -> Border:
    """Return the border of stability that the amplitude equations imply."""
    state, matrices = rotating_matrices(expansion)
    leading, correction = matrices[0], zeros(2)
    if expansion.resonance.tongue == 2:
        leading = matrices[1]
    elif len(matrices) == 2:
        correction = matrices[1]
    first, second = _condition(leading, correction)
    # The correction modulo the leading condition: the same to the order kept, and linear in the detuning.
    shift = rem(second, first, DETUNING) if second != 0 else S.Zero
    centre, half_width = _roots(first, shift)
    threshold = _threshold(half_width, expansion.resonance.tongue) if expansion.decays else S.Zero
    matrix = (leading + correction).as_immutable()
    return Border(state.as_immutable(), matrix, _tidy(first + shift), centre, half_width, threshold)


def _condition(leading: Matrix, correction: Matrix) -> tuple[Expr, Expr]:
    """Return the stability condition of ``leading + correction`` to leading order and its first correction.

    With trace t = a + ib and determinant d = e + if, an exponent lies on the imaginary axis when
    e + (f/a)(b - f/a) = 0; without damping (a = f = 0) the exponents leave it where the discriminant vanishes.
    """
    eta = Symbol("eta", positive=True)
    total = leading + eta * correction
    (a, b), (e, f) = _parts(total.trace()), _parts(total.det())
    if a == 0 or f == 0:
        condition = 4 * e + (b**2 if a == 0 else 0)
    else:
        condition = 4 * (e + f / a * (b - f / a))
    series = [condition.subs(eta, 0), condition.diff(eta).subs(eta, 0)]
    return tuple(_polynomial(part) for part in series)


def _parts(expression: Expr) -> tuple[Expr, Expr]:
    """Return real and imaginary part of a polynomial whose symbols all stand for real numbers."""
    flat = expression.expand()
    return flat.coeff(I, 0), flat.coeff(I, 1)


def _polynomial(expression: Expr) -> Expr:
    """Return the expression with its coefficients in the detuning in lowest terms."""
    return sum((cancel(c) * DETUNING**k for (k,), c in Poly(expression, DETUNING).terms()), S.Zero)


def _tidy(expression: Expr) -> Expr:
    return sum((_fraction(c) * DETUNING**k for (k,), c in Poly(expression, DETUNING).terms()), S.Zero)


def _fraction(expression: Expr) -> Expr:
    """Return one fraction with its denominator in factors."""
    above, below = fraction(cancel(expression))
    return factor_terms(above) / factor(below)


def _roots(first: Expr, shift: Expr) -> tuple[Expr, Expr]:
    """Return centre and half-width of the two roots, to first order in the shift."""
    a, b, c = (first.coeff(DETUNING, k) for k in (2, 1, 0))
    if a == 0:
        return S.Zero, S.NaN
    centre = _fraction(-(b + shift.coeff(DETUNING, 1)) / (2 * a))
    return centre, sqrt(factor(cancel((b / (2 * a)) ** 2 - (c + shift.coeff(DETUNING, 0)) / a)))


def _threshold(half_width: Expr, tongue: int) -> Expr:
    """Return the epsilon at which the two sides of the border coincide."""
    above = numer(together(half_width**2))
    power = Symbol("power")
    roots = solve(above.expand().subs(EPSILON ** (2 * tongue), power), power)
    return factor_terms(roots[0] ** Rational(1, 2 * tongue)) if len(roots) == 1 else S.Zero
