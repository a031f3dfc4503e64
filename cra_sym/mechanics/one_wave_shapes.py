"""Mode shapes of a line with one wave number, in two bases that together are accurate at any frequency.

The notation is that of `cra_sym.mechanics.one_wave`, ``xi = x / L``. The channels of the left end leave one amplitude
alpha_j each open, in which the state there is accurate for any stiffness and inertia, zero and infinity included:

    q_j(0) = c_j alpha_j,   P_j(0) = S_j alpha_j.
"""

from __future__ import annotations

from collections.abc import Sequence

import sympy as sp

from cra_sym.mechanics.one_wave import (
    Derivation,
    Structure,
    b,
    conditions,
    cos_,
    force_rows,
    parameters,
    sin_,
    z,
)
from cra_sym.symbols import symbol

__all__ = [
    "NEAR",
    "amplitudes_far",
    "integral_far",
    "polynomials",
    "shape_far",
    "tip_far",
    "tip_near",
    "tip_rows",
]

NEAR = {1: 2, 2: 25}
"""Below this z a shape is a power series from the left end, above it waves and decaying exponentials."""

xi = symbol("xi")
ALPHA = sp.symbols("alpha beta", real=True)
KRYLOV = sp.symbols("k0:4", positive=True)  # the solutions with one unit derivative at the left end
WAVES = A, B, C, D = sp.symbols("A B C D", real=True)  # cos b xi, sin b xi, exp(-b xi), exp(-b (1 - xi))
decay = sp.Symbol("decay", real=True)


def _n(structure: Structure) -> int:
    return len(structure[0])


def _whole(structure: Structure) -> dict[sp.Symbol, sp.Expr]:
    """Return a symbol for each S of a spring with an inertia, to avoid cancellation between its expanded terms."""
    pairs = enumerate(conditions(structure)[0])
    return {sp.Symbol(f"S_{i}", real=True): stiff for i, (stiff, _) in pairs if stiff.is_Add}


def _pairs(structure: Structure) -> list[tuple[sp.Expr, sp.Expr]]:
    """Return (S, c) of every channel, with the symbols of `_whole`."""
    names = {stiff: name for name, stiff in _whole(structure).items()}
    return [(names.get(stiff, stiff), soft) for stiff, soft in conditions(structure)[0]]


def left(structure: Structure) -> tuple[list[sp.Expr], list[sp.Expr]]:
    """Return q and P at the left end in the amplitudes."""
    pairs = _pairs(structure)[: _n(structure)]
    both = [(c * a, s * a) for (s, c), a in zip(pairs, ALPHA, strict=False)]
    return [q for q, _ in both], [p for _, p in both]


def left_derivatives(structure: Structure) -> list[sp.Expr]:
    """Return the shape and its derivatives at the left end in the amplitudes."""
    q, p = left(structure)
    n = len(q)
    return [*q, *((-1) ** (n - 1 - j) * p[j] for j in reversed(range(n)))]


def left_parameters(structure: Structure) -> tuple[sp.Symbol, ...]:
    """Return the parameters of the left end's channels, as arguments of the derived functions."""
    return parameters((structure[0], ("",) * _n(structure)))


def polynomials(n: int) -> Derivation:
    """Return, for z up to `NEAR`, the solutions with one unit derivative at the left end, as functions of xi."""
    order = next(m for m in range(1, 60) if sp.Float(NEAR[n]) ** m / sp.factorial(2 * n * m) < 2.0**-60)
    y = sp.Symbol("y", real=True)  # z xi^(2n)
    sign = (-1) ** n
    series = (sum((sign * y) ** m / sp.factorial(2 * n * m + j) for m in range(order)) for j in range(2 * n))
    terms = [sp.horner(term, y).subs(y, z * xi ** (2 * n)) for term in series]
    return tuple(xi**j * term for j, term in enumerate(terms)), (xi, z)


def _near(structure: Structure, derivative: int) -> sp.Expr:
    """Return a derivative of the shape at xi = 1 in the Krylov functions there."""
    size = 2 * _n(structure)
    # the derivative of the j-th solution is the one before it; of the first, (-1)^n z times the last
    factors = [((-1) ** _n(structure) * z) ** ((derivative - j + size - 1) // size) for j in range(size)]
    images = [factor * KRYLOV[(j - derivative) % size] for j, factor in enumerate(factors)]
    return sum((s * image for s, image in zip(left_derivatives(structure), images, strict=True)), sp.Integer(0))


def _right_conditions(structure: Structure, derivatives: list[sp.Expr]) -> list[sp.Expr]:
    """Return the residuals of the conditions of the right end, given the shape and its derivatives there."""
    n = _n(structure)
    state = force_rows(sp.Matrix(derivatives))
    pairs = _pairs(structure)[n:]
    return [(-1) ** (n - 1 - j) * (s * state[j] + c * state[n + j]) for j, (s, c) in enumerate(pairs)]


def tip_rows(structure: Structure) -> Derivation:
    """Return the conditions of the right end as rows in the amplitudes, each entry with its terms' magnitudes."""
    size = 2 * _n(structure)
    entries = []
    for condition in _right_conditions(structure, [_near(structure, d) for d in range(size)]):
        for amplitude in ALPHA[: _n(structure)]:
            entry = sp.expand(condition).coeff(amplitude)
            entries += [entry, sum(abs(term) for term in sp.Add.make_args(entry))]
    return written_out(entries, structure), (*parameters(structure), z, *KRYLOV[:size])


def tip_near(structure: Structure) -> Derivation:
    """Return the shape and its derivatives at the right end from the amplitudes and the Krylov functions there."""
    size = 2 * _n(structure)
    left = left_parameters(structure)
    tip = [_near(structure, d) for d in range(size)]
    return written_out(tip, structure), (*left, *ALPHA[: _n(structure)], z, *KRYLOV[:size])


def _waves(n: int, order: int, cosine: sp.Expr, sine: sp.Expr, from_left: sp.Expr, from_right: sp.Expr) -> sp.Expr:
    """Return a derivative of the shape in waves and decaying exponentials."""
    turned = [(cosine, sine), (-sine, cosine), (-cosine, -sine), (sine, -cosine)][order % 4]
    near_ends = (-1) ** order * C * from_left + D * from_right if n == 2 else sp.Integer(0)
    return b**order * (A * turned[0] + B * turned[1] + near_ends)


def _at_right(n: int) -> list[sp.Expr]:
    return [_waves(n, d, cos_, sin_, decay, sp.Integer(1)) for d in range(2 * n)]


def at_left(n: int) -> list[sp.Expr]:
    """Return a shape and its derivatives at the left end in waves."""
    one, zero = sp.Integer(1), sp.Integer(0)
    return [_waves(n, d, one, zero, one, decay) for d in range(2 * n)]


def amplitudes_far(structure: Structure) -> Derivation:
    """Return the amplitudes of the left end and those of the waves of a mode with z over `NEAR`.

    In a beam the growing exponential has to be small at the left end and to meet the conditions of the right end; the
    other condition then holds because z is a zero of the determinant.
    """
    n = _n(structure)
    arguments = (*parameters(structure), b, cos_, sin_, decay)
    unknown, left = list(WAVES[: 2 * n]), left_derivatives(structure)
    if n == 1:
        solution = sp.solve([a - s for a, s in zip(at_left(1), left, strict=True)], unknown, dict=True)[0]
        found = [sp.Integer(1), *(solution[x].subs(ALPHA[0], 1) for x in unknown)]
        return tuple(_in_b(x, 1) for x in written_out(found, structure)), arguments
    growing = sp.Symbol("growing")  # D times its decay
    equations = [sp.expand(a - s).subs(D, growing / decay) for a, s in zip(at_left(2), left, strict=True)]
    waves = sp.solve([sp.expand(e) for e in equations], [A, B, C, growing], dict=True)[0]
    reflected = waves.pop(growing)
    held = _from_the_right(structure, waves)
    remainder = reflected - decay * held
    ratio = {ALPHA[0]: sp.diff(remainder, ALPHA[1]), ALPHA[1]: -sp.diff(remainder, ALPHA[0])}
    amplitudes = [*ratio.values(), *(waves[x].subs(ratio, simultaneous=True) for x in (A, B, C))]
    amplitudes.append(held.subs(ratio, simultaneous=True))
    return tuple(_in_b(x, n) for x in written_out(amplitudes, structure)), arguments


def written_out(expressions: Sequence[sp.Expr], structure: Structure) -> tuple[sp.Expr, ...]:
    """Return expressions in the parameters of the channels that a structure has."""
    return tuple(x.xreplace(_whole(structure)) for x in expressions)


def _in_b(expression: sp.Expr, n: int) -> sp.Expr:
    return expression.subs(z, b ** (2 * n))


def _from_the_right(structure: Structure, waves: dict[sp.Symbol, sp.Expr]) -> sp.Expr:
    """Return D, in the amplitudes, from the conditions of the right end.

    One condition in which its coefficient is a sum of terms of one sign is sufficient. Where a spring on the
    displacement and an inertia of the slope leave none, both are used, weighted by the remaining coefficients.
    """
    rows = [sp.expand(_in_b(row, 2) / b**3) for row in _right_conditions(structure, _at_right(2))]
    for row in rows:
        terms = sp.Add.make_args(sp.expand(row.coeff(D)))
        if not row.has(*_whole(structure)) and len({sp.sign(term.as_coeff_Mul()[0]) for term in terms}) == 1:
            return -row.subs(D, 0).subs(waves) / row.coeff(D)
    above, below = [], []
    for row in rows:
        entry = row.coeff(D)
        size = sum(term**2 for term in sp.Add.make_args(sp.expand(entry)))
        above.append(entry * row.subs(D, 0).subs(waves) / size)
        below.append(entry**2 / size)
    return -sum(above) / sum(below)


def tip_far(n: int) -> Derivation:
    """Return the shape and its derivatives at the right end from the wave amplitudes."""
    return tuple(_at_right(n)), (*WAVES[: 2 * n], b, cos_, sin_, decay)


def shape_far(n: int) -> Derivation:
    """Return the shape and its derivatives at xi from the wave amplitudes."""
    functions = sp.cos(b * xi), sp.sin(b * xi), sp.exp(-b * xi), sp.exp(-b * (1 - xi))
    return tuple(_waves(n, d, *functions) for d in range(2 * n)), (*WAVES[: 2 * n], b, xi)


def integral_far(n: int) -> Derivation:
    """Return the integral of the shape from 0 to 1 from the wave amplitudes."""
    near_ends = (C + D) * (1 - decay) if n == 2 else sp.Integer(0)
    return ((A * sin_ + B * (1 - cos_) + near_ends) / b,), (*WAVES[: 2 * n], b, cos_, sin_, decay)
