"""Mode shapes from the boundary conditions, in two bases that between them keep every digit at any frequency.

Everything here is SymPy, for ``xi = x / L`` in [0, 1], and runs only when a kernel is not in the cache. The joint
leaves two amplitudes open, and with them the state at the root is exact for any stiffness, zero and infinity included:

    phi(0) = c_t alpha,  phi'''(0) = -s_t alpha,     phi'(0) = c_r beta,  phi''(0) = s_r beta.
"""

from __future__ import annotations

import sympy as sp

from cra_sym.model.characteristic import PAIRS, PARAMETERS, Derivation, b, c_r, c_t, conditions, s_r, s_t, z
from cra_sym.symbols import symbol

__all__ = ["NEAR", "amplitudes_far", "generalised_mass", "polynomials", "shape_far", "tip_far", "tip_near", "tip_rows"]

NEAR = 25
"""Below this z a shape is a power series from the root, above it waves and decaying exponentials."""

alpha, beta = sp.symbols("alpha beta", real=True)
xi = symbol("xi")
_FORCE, _MOMENT = (conditions()[0].row(i) for i in range(2))
ROOT = (
    _FORCE[3] * alpha,
    _MOMENT[2] * beta,
    -_MOMENT[1] * beta,
    -_FORCE[0] * alpha,
)  # what meets the root's conditions
KRYLOV = k0, k1, k2, k3 = sp.symbols("k0:4", positive=True)  # the solutions with one unit derivative at the root
WAVES = A, B, C, D = sp.symbols("A B C D", real=True)  # cos b xi, sin b xi, exp(-b xi), exp(-b (1 - xi))
_cos, _sin, decay = sp.symbols("cos sin decay", real=True)


def polynomials() -> Derivation:
    """Return, for z up to `NEAR`, the four solutions with one unit derivative at the root, as functions of xi."""
    order = next(n for n in range(1, 40) if sp.Float(NEAR) ** n / sp.factorial(4 * n) < 2.0**-60)
    y = sp.Symbol("y", real=True)  # z xi^4
    terms = [
        sp.horner(sum(y**n / sp.factorial(4 * n + j) for n in range(order)), y).subs(y, z * xi**4) for j in range(4)
    ]
    return tuple(xi**j * term for j, term in enumerate(terms)), (xi, z)


def _near(derivative: int) -> sp.Expr:
    """Return a derivative of the shape at xi = 1 in the Krylov functions there."""
    # the derivative of the j-th solution is the one before it; of the first, z times the last
    images = [z ** ((derivative - j + 3) // 4) * KRYLOV[(j - derivative) % 4] for j in range(4)]
    return sum((state * image for state, image in zip(ROOT, images, strict=True)), sp.Integer(0))


def _tip_rows(weights: dict[sp.Symbol, sp.Expr]) -> list[sp.Matrix]:
    """Return the tip's conditions on phi and its derivatives, force and moment, in z and with some symbols replaced."""
    rows = conditions()[1].subs(weights).subs(b, z ** sp.Rational(1, 4))
    return [rows.row(0), rows.row(1)]


def _conditions(tip: list[sp.Expr]) -> list[sp.Expr]:
    """Return what has to vanish at the tip, given phi and its derivatives there: force and moment."""
    return [sp.expand((row * sp.Matrix(tip))[0]) for row in _tip_rows({})]


def tip_rows() -> Derivation:
    """Return the tip conditions as rows in (alpha, beta), each entry with the sum of its terms' magnitudes."""
    entries = []
    for condition in _conditions([_near(j) for j in range(4)]):
        for amplitude in (alpha, beta):
            entry = condition.coeff(amplitude)
            entries += [entry, sum(abs(term) for term in sp.Add.make_args(entry))]
    return tuple(entries), (*PARAMETERS, z, *KRYLOV)


def tip_near() -> Derivation:
    """Return the shape and its three derivatives at the tip from the amplitudes and the Krylov functions there."""
    return tuple(_near(j) for j in range(4)), (s_t, c_t, s_r, c_r, alpha, beta, z, *KRYLOV)


def _waves(order: int, cosine: sp.Expr, sine: sp.Expr, from_root: sp.Expr, from_tip: sp.Expr) -> sp.Expr:
    """Return a derivative of the shape in waves and decaying exponentials."""
    turned = [(cosine, sine), (-sine, cosine), (-cosine, -sine), (sine, -cosine)][order % 4]
    return b**order * (A * turned[0] + B * turned[1] + (-1) ** order * C * from_root + D * from_tip)


def _far_amplitudes() -> tuple[sp.Expr, dict[sp.Symbol, sp.Expr]]:
    """Return what the root leaves of the growing exponential (D times its decay), and A, B, C, in (alpha, beta)."""
    at_root = [_waves(j, sp.Integer(1), sp.Integer(0), sp.Integer(1), decay) for j in range(4)]
    growing = sp.Symbol("growing")
    equations = [sp.expand(a - s).subs(D, growing / decay) for a, s in zip(at_root, ROOT, strict=True)]
    solution = sp.solve([sp.expand(e) for e in equations], [A, B, C, growing], dict=True)[0]
    return solution.pop(growing), solution


def amplitudes_far() -> Derivation:
    """Return alpha, beta and the four wave amplitudes of a mode with z over `NEAR`.

    The growing exponential has to be small at the root and to keep the shear at the tip; the moment's condition is then
    met because z is a zero of the determinant. The coefficients of the first do not cancel in this range.
    """
    growing, waves = _far_amplitudes()
    tip = [_waves(j, _cos, _sin, decay, sp.Integer(1)) for j in range(4)]
    shear = sp.expand((conditions()[1] * sp.Matrix(tip))[0] / b**3)
    held = -shear.subs(D, 0).subs(waves) / shear.coeff(D)  # D from the shear, in (alpha, beta)
    remainder = growing - decay * held
    ratio = {alpha: sp.diff(remainder, beta), beta: -sp.diff(remainder, alpha)}
    amplitudes = [*ratio.values(), *(waves[x].subs(ratio, simultaneous=True) for x in (A, B, C))]
    return (*amplitudes, held.subs(ratio, simultaneous=True)), (*PARAMETERS, b, _cos, _sin, decay)


def tip_far() -> Derivation:
    """Return the shape and its three derivatives at the tip from the wave amplitudes."""
    return tuple(_waves(j, _cos, _sin, decay, sp.Integer(1)) for j in range(4)), (*WAVES, b, _cos, _sin, decay)


def shape_far() -> Derivation:
    """Return the shape and its three derivatives at xi from the wave amplitudes."""
    functions = sp.cos(b * xi), sp.sin(b * xi), sp.exp(-b * xi), sp.exp(-b * (1 - xi))
    return tuple(_waves(j, *functions) for j in range(4)), (*WAVES, b, xi)


def generalised_mass() -> Derivation:
    """Return the modal mass over rho A L from end values alone, for z > 0, given phi'' ^2 - 2 phi' phi''' + z phi^2.

    That sum is the same at every xi, and 4 z phi^2 is the derivative of 3 phi phi''' - phi' phi'' + xi times it. At the
    ends the boundary conditions turn the products into squares: nothing cancels.
    """
    invariant, tip, slope, mu, iota = sp.symbols("invariant tip slope mu iota", real=True)
    (s_mu, c_mu), (s_iota, c_iota) = PAIRS["mu"], PAIRS["iota"]
    force, moment = _tip_rows({s_mu: mu, c_mu: 1, s_iota: iota, c_iota: 1})
    phi = (tip, slope, -moment[1] * slope / moment[2], -force[0] * tip / force[3])  # at the tip, by its two conditions
    bracket = [3 * end[0] * end[3] - end[1] * end[2] for end in (ROOT, phi)]
    square = sp.expand((invariant + bracket[1] - bracket[0]) / (4 * z))
    mass = sp.expand(square + mu * tip**2 + iota * slope**2)
    return (mass,), (s_t, c_t, s_r, c_r, alpha, beta, z, invariant, tip, slope, mu, iota)
