"""A characteristic function of one wave number in real arithmetic, finite and right on both sides of a cut-off.

With one wave number lambda, a root of lambda^n = z(omega), the function is entire in z. Above the cut-off frequency
z is positive, and hyperbolic functions are taken times exp(-lambda). Below it z is negative and lambda complex, and the
function stays real. Near it the power series in z serves, in which no power of lambda is left to divide by.
"""

from __future__ import annotations

from collections.abc import Mapping

import sympy as sp

from cra_sym.codegen.complex_parts import complex_parts

__all__ = ["characteristic_pair"]

_TERMS = 30  # of the power series for |z| <= 1: 2^30/30! is below rounding
_HYPERBOLIC = sp.Dummy("C"), sp.Dummy("S")
_FUNCTIONS = (sp.cos, sp.sin, sp.cosh, sp.sinh)


def characteristic_pair(value: sp.Expr, waves: Mapping[sp.Symbol, sp.Expr], omega: sp.Symbol) -> list[sp.Expr]:
    """Return a characteristic function and its derivative by omega, both times one positive factor.

    Parameters
    ----------
    value : Expr
        In the wave number and omega.
    waves : mapping of one Symbol to Expr
        The wave number, a square root or a fourth root.
    omega : Symbol

    Raises
    ------
    ValueError
        If the wave number is not such a root, or the function is not even in it.
    """
    ((wave, root),) = waves.items()
    order = next((n for n in (2, 4) if _is_free_of_roots(sp.powsimp(sp.expand_power_base(root**n, force=True)))), None)
    if order is None:
        raise ValueError(f"the wave number {wave} = {root} is neither a square root nor a fourth root")
    z = sp.powsimp(sp.expand_power_base(root**order, force=True))
    size = sp.Dummy("size", positive=True)
    slope = sp.diff(z, omega)
    by_wave = sp.diff(value, wave) / (order * wave ** (order - 1))
    rate = sp.diff(value, omega) + by_wave * slope
    degree = max(_degree(e, wave) for e in (value, rate))
    far = [_scaled(e, wave, degree) for e in (value, rate)]
    turned = [_below(e, wave, size, order) for e in (value, rate)]
    width = max(_degree(e, size) for e in turned)
    below = [_scaled(e, size, width) for e in turned]
    flat = sp.Dummy("z", real=True)
    series = _near(value, wave, order, flat)
    near = [series.subs(flat, z), (_near(sp.diff(value, omega), wave, order, flat) + sp.diff(series, flat) * slope)]
    near = [e.subs(flat, z) * sp.exp(-degree * sp.Abs(z) ** sp.Rational(1, order)) for e in near]
    lengths = sp.Abs(z) ** sp.Rational(1, order), (-z) ** sp.Rational(1, order) / (1 if order == 2 else sp.sqrt(2))
    return [
        sp.Piecewise((a.subs(wave, lengths[0]), z > 1), (b.subs(size, lengths[1]), z < -1), (c, True))
        for a, b, c in zip(far, below, near, strict=True)
    ]


def _is_free_of_roots(e: sp.Expr) -> bool:
    return all(power.exp.is_Integer for power in e.atoms(sp.Pow))


def _degree(e: sp.Expr, wave: sp.Symbol) -> int:
    return int(max(sum(powers) for powers in _hyperbolic(e, wave).monoms()))


def _hyperbolic(e: sp.Expr, wave: sp.Symbol) -> sp.Poly:
    names = _HYPERBOLIC
    return sp.Poly(e.subs({sp.cosh(wave): names[0], sp.sinh(wave): names[1]}), *names)


def _scaled(e: sp.Expr, wave: sp.Symbol, degree: int) -> sp.Expr:
    """Return the expression times exp(-degree wave), without a number that grows exponentially."""
    decay = sp.exp(-wave)
    parts = ((1 + decay**2) / 2, (1 - decay**2) / 2)
    return sp.Add(*(
        c * parts[0] ** i * parts[1] ** j * decay ** (degree - i - j) for (i, j), c in _hyperbolic(e, wave).terms()
    ))  # fmt: skip


def _below(e: sp.Expr, wave: sp.Symbol, size: sp.Symbol, order: int) -> sp.Expr:
    """Return the expression at the wave number i size, or (1 + i) size, where it is real."""
    c, s, ch, sh = (f(size) for f in _FUNCTIONS)
    turned = (
        {sp.cos(wave): ch, sp.sin(wave): sp.I * sh, wave: sp.I * size}
        if order == 2
        else {
            sp.cos(wave): c * ch - sp.I * s * sh, sp.sin(wave): s * ch + sp.I * c * sh,
            sp.cosh(wave): c * ch + sp.I * s * sh, sp.sinh(wave): c * sh + sp.I * s * ch, wave: (1 + sp.I) * size,
        }
    )  # fmt: skip
    names = {f(wave): sp.Dummy() for f in _FUNCTIONS}
    replaced = e.subs(names).subs(wave, turned[wave])
    replaced = replaced.xreplace({names[f]: value for f, value in turned.items() if f in names})
    real, imaginary = complex_parts(replaced)
    if not _vanishes(imaginary, real):
        raise ValueError("the characteristic function is not even in its wave number")
    return sp.expand(real)


def _vanishes(e: sp.Expr, beside: sp.Expr) -> bool:
    """Return whether an expression is rounding beside another, at a point in 40 digits."""
    point = {s: sp.Rational(7 + 2 * n, 11 + n) for n, s in enumerate(sorted(beside.free_symbols, key=str))}
    return bool(abs(e.subs(point).evalf(40)) <= 1e-30 * abs(beside.subs(point).evalf(40)))


def _near(e: sp.Expr, wave: sp.Symbol, order: int, z: sp.Symbol) -> sp.Expr:
    """Return the power series in z = wave^order, in Horner's form."""
    series = {f(wave): _taylor(f, wave) for f in _FUNCTIONS}
    whole = sp.expand(e.subs(series))
    if whole == 0:
        return whole
    found: dict[int, sp.Expr] = {}
    for term in sp.Add.make_args(whole):
        coefficient, power = term.as_coeff_exponent(wave)
        found[int(power)] = found.get(int(power), sp.S.Zero) + coefficient
    kept = {p: sp.factor_terms(c) for p, c in found.items() if p <= _TERMS - order and sp.expand(c) != 0}
    if any(p < 0 or p % order for p in kept):
        raise ValueError("the characteristic function is not even in its wave number")
    result = sp.S.Zero
    for p in range(max(kept, default=0), -1, -order):
        result = result * z + kept.get(p, sp.S.Zero)
    return result


def _taylor(f: type[sp.Function], wave: sp.Symbol) -> sp.Expr:
    odd, sign = f in (sp.sin, sp.sinh), -1 if f in (sp.cos, sp.sin) else 1
    return sp.Add(*(sign ** (n // 2) * wave**n / sp.factorial(n) for n in range(int(odd), _TERMS + 6, 2)))
