"""The characteristic determinant brought into the forms a solver evaluates: scaled, differentiated, counted.

Everything here is SymPy and runs only when a kernel is not in the cache. The variable is ``z = lambda^4``: in it the
determinant is an entire function whose zeros are all real. Four functions, each of them entire in z, carry it,

    p = 1 - cos b cosh b,   q = b (sin b cosh b - cos b sinh b),   r = b^2 sin b sinh b,
    s = b^3 (cos b sinh b + sin b cosh b),   b = lambda,

and ``b d/db = 4 z d/dz`` maps their span over the polynomials in z into itself. Every stiffness and inertia enters as
a pair ``(s, c) = (kappa, 1) / (1 + kappa)``, so that zero and infinity are ordinary values and nothing overflows.
"""

from __future__ import annotations

from functools import cache
from math import prod

import sympy as sp
from sympy.polys.ring_series import rs_cos, rs_cosh, rs_sin, rs_sinh

from cra_sym.paper.modes import root_matrix, tip_matrix
from cra_sym.symbols import symbol

__all__ = [
    "NEAR",
    "basis",
    "basis_near",
    "chain",
    "coefficients",
    "derivatives",
    "determinant",
    "power_series",
    "products",
]

Derivation = tuple[tuple[sp.Expr, ...], tuple[sp.Symbol, ...]]

NEAR = 5
"""Below this z power series are used, above it scaled exponentials."""

b, z = symbol("lamda"), sp.Symbol("z", nonnegative=True)
PAIRS = {name: (symbol(f"s_{name}"), symbol(f"c_{name}")) for name in ("t", "r")}
PAIRS |= {name: sp.symbols(f"s_{name} c_{name}", nonnegative=True) for name in ("mu", "iota")}
(s_t, c_t), (s_r, c_r), (s_mu, c_mu), (s_iota, c_iota) = PAIRS.values()
PARAMETERS = tuple(x for pair in PAIRS.values() for x in pair)

# the constant 1 and the four functions, all multiplied by one positive scale
BASIS = unit, p, q, r, s = sp.symbols("unit p q r s", real=True)
_cos, _sin, _cosh, _sinh = sp.symbols("cos sin cosh sinh", real=True)
_PRODUCTS = {  # the four functions through their placeholders
    p: 1 - _cos * _cosh,
    q: b * (_sin * _cosh - _cos * _sinh),
    r: b**2 * _sin * _sinh,
    s: b**3 * (_cos * _sinh + _sin * _cosh),
}


def derivatives_of(functions: tuple[sp.Expr, sp.Expr, sp.Expr, sp.Expr]) -> sp.Matrix:
    """Return cos, sin, cosh, sinh of lambda xi (columns) and their first three derivatives by xi (rows)."""
    rotation = sp.Matrix([[0, -1, 0, 0], [1, 0, 0, 0], [0, 0, 0, 1], [0, 0, 1, 0]])
    return sp.Matrix.vstack(*(b**order * (rotation**order * sp.Matrix(functions)).T for order in range(4)))


@cache
def conditions() -> tuple[sp.Matrix, sp.Matrix]:
    """Return the systems (18) and (19) as conditions on phi and its first three derivatives: force and moment.

    Columns: derivatives 0 to 3 at the root, at the tip. Each row is homogeneous in its pair.
    """
    names = {"mu": symbol("mu"), "iota": symbol("iota")}
    at_zero = {f(b): value for f, value in ((sp.cos, 1), (sp.sin, 0), (sp.cosh, 1), (sp.sinh, 0))}
    table = derivatives_of((sp.Integer(1), sp.Integer(0), sp.Integer(1), sp.Integer(0)))

    def on_derivatives(row: sp.Matrix) -> sp.Matrix:
        entries = [sp.cancel(entry) for entry in row.subs(at_zero) * table.inv()]
        common = sp.lcm([sp.denom(entry) for entry in entries])
        return sp.Matrix([[sp.cancel(entry * common) for entry in entries]])

    def weighted(row: sp.Matrix, name: str) -> sp.Matrix:
        value, complement = PAIRS[name]
        return row.applyfunc(lambda e: value * e.coeff(names[name], 1) + complement * e.coeff(names[name], 0))

    root, tip = root_matrix(), tip_matrix()
    force, moment = (on_derivatives(root.row(i)) for i in range(2))
    tip_force, tip_moment = (weighted(on_derivatives(tip.row(i)), name) for i, name in enumerate(("mu", "iota")))
    return sp.Matrix.vstack(force, moment), sp.Matrix.vstack(tip_force, tip_moment)


@cache
def determinant() -> sp.Expr:
    """Return the characteristic determinant, linear in `BASIS` with coefficients polynomial in z and `PARAMETERS`.

    Its zeros in z, with their multiplicity, are the fourth powers of the frequency parameters, rigid-body zeros
    included. Its sign is that of ``(-1)^N``, N the number of zeros below z.
    """
    root, tip = conditions()
    at_root = derivatives_of((sp.Integer(1), sp.Integer(0), sp.Integer(1), sp.Integer(0)))
    at_tip = derivatives_of((_cos, _sin, _cosh, _sinh))
    return in_basis(sp.Matrix.vstack(root * at_root, tip * at_tip).det(method="berkowitz"))


def in_basis(expression: sp.Expr) -> sp.Expr:
    """Write a determinant, bilinear in (cos, sin) and (cosh, sinh), in `BASIS`, without its power of lambda."""
    identities = [_cos**2 + _sin**2 - 1, _cosh**2 - _sinh**2 - 1]
    _, reduced = sp.reduced(sp.expand(expression), identities, _cos, _cosh, _sin, _sinh)
    u, v = s / b**3, q / b
    products = {(1, 0, 1, 0): unit - p, (0, 1, 0, 1): r / b**2, (1, 0, 0, 1): (u - v) / 2, (0, 1, 1, 0): (u + v) / 2}
    products[0, 0, 0, 0] = unit
    polynomial = sp.Poly(reduced, _cos, _sin, _cosh, _sinh)
    mapped = sp.expand(sum(coefficient * products[powers] for powers, coefficient in polynomial.terms()))
    rigid = {s_t: 1, s_r: 1, c_mu: 1, c_iota: 1}
    clamped_free = mapped.subs({x: rigid.get(x, 0) for x in PARAMETERS}).subs({p: 0, unit: 1})
    return sp.expand(2 * mapped / clamped_free).subs(b, z ** sp.Rational(1, 4))


def theta(expression: sp.Expr) -> sp.Expr:
    """Apply ``4 z d/dz`` to a polynomial in `BASIS` and z, the scale held fixed."""
    images = {p: q, q: q + 2 * r, r: 2 * r + s, s: 3 * s + 2 * z * (unit - p), z: 4 * z}
    return sum((sp.diff(expression, x) * image for x, image in images.items()), sp.Integer(0))


@cache
def _monomials() -> list[tuple[sp.Symbol, sp.Expr, sp.Expr]]:
    """Return (name, coefficient in the parameters, monomial in z and the basis) for each term of the determinant."""
    terms = sorted(sp.Poly(determinant(), *BASIS, z).terms(), reverse=True)
    monomials = [sp.Mul(*(x**n for x, n in zip((*BASIS, z), powers, strict=True))) for powers, _ in terms]
    return [
        (sp.Symbol(f"k{index}", real=True), _by_pairs(coefficient), monomial)
        for index, ((_, coefficient), monomial) in enumerate(zip(terms, monomials, strict=True))
    ]


def _by_pairs(expression: sp.Expr) -> sp.Expr:
    return sp.collect(sp.factor(expression), PARAMETERS)


def coefficients() -> Derivation:
    """Return the determinant's coefficients as functions of the parameters; each is a sum of terms of one sign."""
    return tuple(coefficient for _, coefficient, _ in _monomials()), PARAMETERS


def derivatives() -> Derivation:
    """Return the determinant D, z D' and z^2 D'' (scaled alike) from its coefficients, z and the scaled basis."""
    names, _, monomials = zip(*_monomials(), strict=True)
    value = sp.Poly(sum(name * monomial for name, monomial in zip(names, monomials, strict=True)), *BASIS)
    terms = [(value.coeff_monomial(x), x) for x in BASIS]
    result: list[sp.Expr] = [sp.Integer(0)] * 3
    for polynomial, x in terms:
        factor = [sp.horner(z**n * polynomial.diff(z, n), z) for n in range(3)]
        once = theta(x) / 4
        function = [x, once, sp.expand(theta(once) / 4 - once)]  # x, z x' and z^2 x''
        result[0] += factor[0] * function[0]
        result[1] += factor[0] * function[1] + factor[1] * function[0]
        result[2] += factor[0] * function[2] + 2 * factor[1] * function[1] + factor[2] * function[0]
    return tuple(result), (*names, z, *BASIS)


def power_series() -> Derivation:
    """Return the coefficients of the determinant's power series in z, enough of them for z up to `NEAR`."""
    series = basis_series()
    names, _, monomials = zip(*_monomials(), strict=True)
    value = sum(name * monomial for name, monomial in zip(names, monomials, strict=True))
    powers = sp.Poly(value.subs(series), z).all_coeffs()[::-1]
    return tuple(sp.expand(power) for power in powers), names


@cache
def basis_series() -> dict[sp.Symbol, sp.Expr]:
    """Return the basis as polynomials in z, cut where a term is below rounding for z up to `NEAR`."""
    result: dict[sp.Symbol, sp.Expr] = {unit: sp.Integer(1)}
    order = next(n for n in range(1, 40) if sp.Float((4 * NEAR) ** n) / sp.factorial(4 * n) < 2.0**-60)
    ring, x = sp.ring(b, sp.QQ)
    functions = {_cos: rs_cos, _sin: rs_sin, _cosh: rs_cosh, _sinh: rs_sinh}
    taylor = {b: x} | {name: function(x, x, 4 * order + 2) for name, function in functions.items()}
    for name, product in _PRODUCTS.items():
        polynomial = ring(0)
        for powers, coefficient in sp.Poly(product, *taylor).terms():
            factors = (series**power for series, power in zip(taylor.values(), powers, strict=True))
            polynomial += prod(factors, start=ring(sp.QQ.from_sympy(coefficient)))
        result[name] = sum(sp.QQ.to_sympy(c) * z ** (n // 4) for (n,), c in polynomial.terms() if n <= 4 * order)
    return result


def basis() -> Derivation:
    """Return the scaled basis at lambda, exponentials taken out: ``exp(-lambda)`` times `BASIS`, for z over `NEAR`."""
    decay = sp.Symbol("decay", positive=True)  # exp(-b); cosh and sinh times it are (1 +- exp(-2 b)) / 2
    scaled = {_cosh: (1 + decay**2) / 2, _sinh: (1 - decay**2) / 2, _cos: sp.cos(b), _sin: sp.sin(b)}
    expressions = {unit: decay, **{x: product.subs(scaled) for x, product in _PRODUCTS.items()}}
    expressions[p] += decay - 1  # the constant in it is scaled too
    return tuple(expressions.values()), (b, decay)


def products() -> Derivation:
    """Return the four functions through lambda, its circular and its hyperbolic functions."""
    return tuple(_PRODUCTS.values()), (b, _cos, _sin, _cosh, _sinh)


def basis_near() -> Derivation:
    """Return the basis, not scaled, for z up to `NEAR`."""
    return tuple(sp.horner(series, z) for series in basis_series().values()), (z,)


def chain() -> Derivation:
    """Return the determinants whose signs count the zeros below z, one constraint after another released.

    From the beam pinned at both ends, with zeros n pi, to the arm: the joint's rotational spring is added (which may
    lower the count by one), then the tip is released to its mass, the root to its translational spring and the tip
    to its rotary inertia (each may raise it by one). Each is a limit of the arm's determinant, and written with
    its predecessor as a term, so that a pair (1, 0) or (0, 1) repeats the predecessor's sign exactly.
    """
    full = determinant()
    pinned = {s_mu: 1, c_mu: 0, s_t: 1, c_t: 0, s_iota: 0, c_iota: 1}
    both_pinned, sprung = -full.subs({**pinned, s_r: 0, c_r: 1}), -full.subs(pinned)
    del pinned[s_mu], pinned[c_mu]
    massive = -s_mu * sprung + _part(full.subs(pinned), c_mu)
    del pinned[s_t], pinned[c_t]
    translating = s_t * massive + _part(full.subs(pinned), c_t)
    rotating = c_iota * translating + _part(full, s_iota)
    return (both_pinned, sprung, massive, translating, rotating), (*PARAMETERS, z, *BASIS)


def _part(expression: sp.Expr, factor: sp.Symbol) -> sp.Expr:
    """Return the terms of an expression that hold a factor, collected."""
    part = sp.expand(expression).coeff(factor)
    return factor * sp.collect(part, PARAMETERS, lambda inner: sp.collect(inner, BASIS))
