"""Characteristic function of a line with one wave number for the solvers: scaled, with derivatives and count.

A line is a string (n = 1) or a beam (n = 2): one field v with the density ``a v_t^2 / 2 - c (d^n v / dx^n)^2 / 2``. In
``xi = x / L`` its motions of angular frequency omega obey ``(d/dxi)^(2n) phi = (-1)^n z phi`` with
``z = lambda^(2n) = a L^(2n) omega^2 / c``. Each displacement ``q_j = phi^(j)``, j < n, of each end is a channel: free,
held, on a spring, with a mass, or with both. With its natural force ``P_j = (-1)^(n-1-j) phi^(2n-1-j)`` it obeys

    (kappa - z mu) q - P = 0 at the left end,    (kappa - z mu) q + P = 0 at the right end.

Every stiffness and inertia enters as ``(s, i, c) = (kappa, mu, 1) / (1 + kappa + mu)``, so that zero and infinity need
no special case and nothing overflows: ``S q -+ c P = 0``, ``S = s - z i``.

A structure is a tuple of two ends, each a tuple of the kinds of its n channels: a text of the letters of what the
Lagrangian has there, ``"k"`` for a spring and ``"m"`` for a mass, or ``"h"`` for a held displacement. Functions of a
structure return expressions and their arguments, as `cra_sym.kernels.kernel` takes them.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache
from math import prod

import sympy as sp
from sympy.polys.ring_series import rs_cos, rs_cosh, rs_sin, rs_sinh

from cra_sym.symbols import symbol

__all__ = [
    "BASIS",
    "NEAR",
    "ORDER",
    "basis",
    "basis_near",
    "chain",
    "channels",
    "coefficients",
    "derivatives",
    "determinant",
    "force_rows",
    "link_channels",
    "parameters",
    "power_series",
    "products",
    "theta",
    "waves_of",
]

Structure = tuple[tuple[str, ...], tuple[str, ...]]
Derivation = tuple[tuple[sp.Expr, ...], tuple[sp.Symbol, ...]]

NEAR = {1: 2, 2: 5}
"""Below this z power series are used, above it circular functions and scaled exponentials."""
ORDER = {1: (1, 0), 2: (1, 2, 0, 3)}
"""The order in which channels are switched from the reference, whose zeros are n pi: held ends, with free slopes."""

b, z = symbol("lamda"), sp.Symbol("z", nonnegative=True)
cos_, sin_, cosh_, sinh_ = sp.symbols("cos sin cosh sinh", real=True)
BASIS = {1: sp.symbols("u w", real=True), 2: sp.symbols("unit p q r s", real=True)}
"""Basis functions of the determinant, entire in z and multiplied by one positive scale; see `products`."""
_u, _w = BASIS[1]
_unit, _p, _q, _r, _s = BASIS[2]
_PRODUCTS = {
    1: {_u: cos_, _w: b * sin_},
    2: {
        _unit: sp.Integer(1),
        _p: 1 - cos_ * cosh_,
        _q: b * (sin_ * cosh_ - cos_ * sinh_),
        _r: b**2 * sin_ * sinh_,
        _s: b**3 * (cos_ * sinh_ + sin_ * cosh_),
    },
}


def channels(structure: Structure) -> list[str]:
    """Return the kinds of all channels: those of the left end, then those of the right end."""
    return [kind for end in structure for kind in end]


@cache
def conditions(structure: Structure) -> tuple[tuple[tuple[sp.Expr, sp.Expr], ...], tuple[sp.Symbol, ...]]:
    """Return (S, c) of every channel, and the symbols s, i, c in them: the arguments of all kernels."""
    pairs: list[tuple[sp.Expr, sp.Expr]] = []
    found: list[sp.Symbol] = []
    for number, kind in enumerate(channels(structure)):
        if kind in ("", "h"):
            pairs.append((sp.Integer(kind == "h"), sp.Integer(kind == "")))
            continue
        s, i, c = (sp.Symbol(f"{name}_{number}", nonnegative=True) for name in "sic")
        pairs.append(((s if "k" in kind else sp.Integer(0)) - (z * i if "m" in kind else 0), c))
        found += [x for x, there in ((s, "k" in kind), (i, "m" in kind), (c, True)) if there]
    return tuple(pairs), tuple(found)


def parameters(structure: Structure) -> tuple[sp.Symbol, ...]:
    """Return the symbols s, i, c of the channels that the structure has."""
    return conditions(structure)[1]


def waves_of(functions: Sequence[sp.Expr]) -> sp.Matrix:
    """Return cos, sin, and for a beam cosh, sinh, of lambda xi (columns) and their derivatives by xi (rows)."""
    rotation = sp.Matrix([[0, -1], [1, 0]])
    if len(functions) == 4:
        rotation = sp.diag(rotation, sp.Matrix([[0, 1], [1, 0]]))
    row = sp.Matrix(functions)
    return sp.Matrix.vstack(*(b**order * (rotation**order * row).T for order in range(len(functions))))


def force_rows(derivatives: sp.Matrix) -> sp.Matrix:
    """Return q_0, ..., P_0, ... from the derivatives 0 to 2n - 1 (rows)."""
    n = derivatives.rows // 2
    forces = [(-1) ** (n - 1 - j) * derivatives.row(2 * n - 1 - j) for j in range(n)]
    return sp.Matrix.vstack(*(derivatives.row(j) for j in range(n)), *forces)


@cache
def _general(n: int) -> tuple[sp.Expr, tuple[tuple[sp.Symbol, sp.Symbol], ...]]:
    """Return the determinant for any (S, c), linear in each pair, and these symbols."""
    pairs = tuple((sp.Symbol(f"S_{i}"), sp.Symbol(f"C_{i}")) for i in range(2 * n))
    functions = (cos_, sin_, cosh_, sinh_)[: 2 * n]
    ends = (force_rows(waves_of(row)) for row in (tuple(map(sp.Integer, (1, 0, 1, 0)))[: 2 * n], functions))
    rows = []
    for end, (state, sign) in enumerate(zip(ends, (-1, 1), strict=True)):
        for j, (stiff, soft) in enumerate(pairs[end * n : end * n + n]):
            rows.append(stiff * state.row(j) + sign * soft * state.row(n + j))
    mapped = _in_basis(sp.Matrix.vstack(*rows).det(method="berkowitz"), n)
    held_and_free = {x: sp.Integer((i < n) == (x == pair[0])) for i, pair in enumerate(pairs) for x in pair}
    unit = mapped.subs(held_and_free).subs({_p: 0, _unit: 1, _u: 1})
    return sp.expand(sp.expand(n * mapped / unit).subs(b, z ** sp.Rational(1, 2 * n))), pairs


def _in_basis(expression: sp.Expr, n: int) -> sp.Expr:
    """Write a determinant, bilinear in (cos, sin) and (cosh, sinh), in `BASIS`."""
    if n == 1:
        return sp.expand(sp.expand(expression).subs({cos_: _u, sin_: _w / b}))
    identities = [cos_**2 + sin_**2 - 1, cosh_**2 - sinh_**2 - 1]
    _, reduced = sp.reduced(sp.expand(expression), identities, cos_, cosh_, sin_, sinh_)
    u, v = _s / b**3, _q / b
    images = {(1, 0, 1, 0): _unit - _p, (0, 1, 0, 1): _r / b**2, (1, 0, 0, 1): (u - v) / 2, (0, 1, 1, 0): (u + v) / 2}
    images[0, 0, 0, 0] = _unit
    polynomial = sp.Poly(reduced, cos_, sin_, cosh_, sinh_)
    return sp.expand(sum(coefficient * images[powers] for powers, coefficient in polynomial.terms()))


def _with(pairs: Sequence[tuple[sp.Expr, sp.Expr]]) -> sp.Expr:
    """Return the determinant with (S, c) of every channel given."""
    general, names = _general(len(pairs) // 2)
    return sp.expand(general.subs({x: v for n, p in zip(names, pairs, strict=True) for x, v in zip(n, p, strict=True)}))


@cache
def determinant(structure: Structure) -> sp.Expr:
    """Return the characteristic determinant, linear in `BASIS` with coefficients in z and the `parameters`.

    Its zeros in z are the 2n-th powers of the frequency parameters, rigid-body zeros included. Its sign is that of
    ``(-1)^N``, N the number of zeros below z.
    """
    return _with(conditions(structure)[0])


def _deficit(expression: sp.Expr, n: int) -> int:
    """Return the power of z, 0 or 1, that an expression has to be multiplied by to be a polynomial in z."""
    del n
    return max(0, *(-int(term.as_powers_dict().get(z, 0)) for term in sp.Add.make_args(expression)))


def theta(expression: sp.Expr, n: int) -> sp.Expr:
    """Apply ``2n z d/dz`` to a polynomial in `BASIS` and z, the scale held fixed."""
    beam = {_p: _q, _q: _q + 2 * _r, _r: 2 * _r + _s, _s: 3 * _s + 2 * z * (_unit - _p)}
    images = ({_u: -_w, _w: _w + z * _u} if n == 1 else beam) | {z: 2 * n * z}
    return sum((sp.diff(expression, x) * image for x, image in images.items()), sp.Integer(0))


@cache
def _monomials(structure: Structure) -> tuple[list[tuple[sp.Symbol, sp.Expr, sp.Expr]], int]:
    """Return (name, coefficient in the parameters, monomial in z and the basis) of each term, and the deficit."""
    n = len(structure[0])
    deficit = _deficit(determinant(structure), n)
    terms = sorted(sp.Poly(sp.expand(z**deficit * determinant(structure)), *BASIS[n], z).terms(), reverse=True)
    monomials = [sp.Mul(*(x**e for x, e in zip((*BASIS[n], z), powers, strict=True))) for powers, _ in terms]
    names = [sp.Symbol(f"k{index}", real=True) for index in range(len(terms))]
    found = [sp.collect(sp.factor(coefficient), parameters(structure)) for _, coefficient in terms]
    return list(zip(names, found, monomials, strict=True)), deficit


def coefficients(structure: Structure) -> Derivation:
    """Return the determinant's coefficients as functions of the parameters; each is a sum of terms of one sign."""
    return tuple(coefficient for _, coefficient, _ in _monomials(structure)[0]), parameters(structure)


def derivatives(structure: Structure) -> Derivation:
    """Return the determinant D, z D' and z^2 D'' (scaled alike) from its coefficients, z and the scaled basis."""
    n = len(structure[0])
    names, _, monomials = zip(*_monomials(structure)[0], strict=True)
    deficit = _monomials(structure)[1]
    value = sp.Poly(sum(name * monomial for name, monomial in zip(names, monomials, strict=True)), *BASIS[n])
    result: list[sp.Expr] = [sp.Integer(0)] * 3
    for polynomial, x in [(value.coeff_monomial(x), x) for x in BASIS[n]]:
        factor = [sp.horner(z**m * polynomial.diff(z, m), z) for m in range(3)]
        once = theta(x, n) / (2 * n)
        function = [x, once, sp.expand(theta(once, n) / (2 * n) - once)]  # x, z x' and z^2 x''
        result[0] += factor[0] * function[0]
        result[1] += factor[0] * function[1] + factor[1] * function[0]
        result[2] += factor[0] * function[2] + 2 * factor[1] * function[1] + factor[2] * function[0]
    if deficit:  # these belong to z D
        result[2] = result[2] - 2 * result[1] + 2 * result[0]
        result[1] = result[1] - result[0]
    return tuple(result), (*names, z, *BASIS[n])


def power_series(structure: Structure) -> Derivation:
    """Return the coefficients of the determinant's power series in z, enough of them for z up to `NEAR`."""
    names, _, monomials = zip(*_monomials(structure)[0], strict=True)
    value = sum(name * monomial for name, monomial in zip(names, monomials, strict=True))
    powers = sp.Poly(value.subs(_basis_series(len(structure[0]))), z).all_coeffs()[::-1]
    return tuple(sp.expand(power) for power in powers[_monomials(structure)[1] :]), names


@cache
def _basis_series(n: int) -> dict[sp.Symbol, sp.Expr]:
    """Return the basis as polynomials in z, cut where a term is below rounding for z up to `NEAR`."""
    largest = NEAR[n] if n == 1 else 4 * NEAR[n]  # the product of two functions has terms of the double argument
    order = next(k for k in range(1, 60) if sp.Float(largest) ** k / sp.factorial(2 * n * k) < 2.0**-60)
    ring, x = sp.ring(b, sp.QQ)
    functions = {cos_: rs_cos, sin_: rs_sin, cosh_: rs_cosh, sinh_: rs_sinh}
    taylor = {b: x} | {name: function(x, x, 2 * n * order + 2) for name, function in functions.items()}
    result: dict[sp.Symbol, sp.Expr] = {}
    for name, product in _PRODUCTS[n].items():
        polynomial = ring(0)
        for powers, coefficient in sp.Poly(product, *taylor).terms():
            factors = (series**power for series, power in zip(taylor.values(), powers, strict=True))
            polynomial += prod(factors, start=ring(sp.QQ.from_sympy(coefficient)))
        terms = [(m // (2 * n), c) for (m,), c in polynomial.terms() if m <= 2 * n * order]
        result[name] = sum(sp.QQ.to_sympy(c) * z**m for m, c in terms)
    return result


def basis(n: int) -> Derivation:
    """Return the scaled basis at lambda, for z over `NEAR`: for a beam ``exp(-lambda)`` times `BASIS`."""
    decay = sp.Symbol("decay", positive=True)  # exp(-b); cosh and sinh times it are (1 +- exp(-2 b)) / 2
    scaled = {cosh_: (1 + decay**2) / 2, sinh_: (1 - decay**2) / 2, cos_: sp.cos(b), sin_: sp.sin(b)}
    expressions = {x: product.subs(scaled) for x, product in _PRODUCTS[n].items()}
    if n == 2:
        expressions[_unit] = decay
        expressions[_p] += decay - 1  # the constant in it is scaled too
    return tuple(expressions.values()), (b, decay)


def products(n: int) -> Derivation:
    """Return the basis, but for the constant, through lambda, its circular and its hyperbolic functions."""
    return tuple(x for x in _PRODUCTS[n].values() if x != 1), (b, *(cos_, sin_, cosh_, sinh_)[: 2 * n])


def basis_near(n: int) -> Derivation:
    """Return the basis, not scaled, for z up to `NEAR`."""
    return tuple(sp.horner(series, z) for series in _basis_series(n).values()), (z,)


def link_channels(structure: Structure) -> list[int]:
    """Return the channels that `chain` switches, in order: those that are not as in the reference."""
    kinds, n = channels(structure), len(structure[0])
    return [number for number in ORDER[n] if kinds[number] != _reference(number, n)]


def _reference(number: int, n: int) -> str:
    return "h" if number % n == 0 else ""


def chain(structure: Structure) -> Derivation:
    """Return the determinants whose signs count the zeros below z, one channel after another switched.

    They lead from the reference, with zeros n pi, to the structure. A displacement that was held is released to (S, c),
    which may raise the count by one; one that was free is bound to (S, c), which may lower it by one where S > 0 and
    raise it where S < 0. Each is written with its predecessor as a term, so that a pair (1, 0) or (0, 1) repeats the
    predecessor's sign exactly.
    """
    n = len(structure[0])
    own, arguments = conditions(structure)
    held, free = (sp.Integer(1), sp.Integer(0)), (sp.Integer(0), sp.Integer(1))
    pairs = [held if _reference(number, n) == "h" else free for number in range(2 * n)]

    def collected(expression: sp.Expr) -> sp.Expr:
        return sp.collect(sp.expand(expression), arguments, lambda inner: sp.collect(inner, BASIS[n]))

    deficit = _deficit(_with(pairs), n)
    links = [sp.expand(z**deficit * _with(pairs))]
    for number in link_channels(structure):
        stiff, soft = own[number]
        before, was_held = deficit, pairs[number] == held
        pairs[number] = free if was_held else held
        other = _with(pairs)
        pairs[number] = own[number]
        deficit = _deficit(_with(pairs), n)
        kept, new = (stiff, soft) if was_held else (soft, stiff)
        kept = sp.expand(kept * z ** (deficit - before))
        raised = sp.expand(z**deficit * other * (new if new.has(z) else 1))
        part = collected(raised) if new.has(z) and new.is_Add else _factored(new, z**deficit * other, collected)
        links.append(kept * links[-1] + part)
    return tuple(links), (*arguments, z, *BASIS[n])


def _factored(new: sp.Expr, other: sp.Expr, collected) -> sp.Expr:  # type: ignore[no-untyped-def]
    """Return the product with the powers of z put to the polynomial and the parameter in front."""
    number, power = new.as_independent(z)
    return number * collected(sp.expand(power * other))
