"""Stability boundaries as kernels: results of multiple scales for each kind of resonance, in plain symbols.

``half_width_sum_1``, ``shift_sum_1``, ``damped_shift_sum_1``, ``sums_sum_1`` and so on, for each kind and tongue, take
no arguments and return ``(expressions, arguments)`` for :func:`cra_sym.kernels.derived_kernel`.
"""

from __future__ import annotations

from functools import cache, partial
from typing import Any

from sympy import Expr, I, IndexedBase, S, Symbol, expand, series, sin

from cra_sym.mechanics.multiple_scales import MultipleScales, multiple_scales
from cra_sym.mechanics.two_scales import EPSILON
from cra_sym.symbols import symbol

__all__ = ["general_resonance"]

OMEGA, P, ZETA, SLOPE = (IndexedBase(name, real=True) for name in ("omega", "P", "zeta", "dP"))
m, n, j = (Symbol(name, integer=True, positive=True) for name in "mnj")
_ASSUMED = ((OMEGA, {"positive": True}), (P, {"real": True}), (SLOPE, {"real": True}), (ZETA, {"nonnegative": True}))
_ABOUT = {"principal": (n, n), "sum": (m, n), "difference": (m, -n)}
#: The product P_rj P_jt of the couplings that lead through a spectator mode j, and its frequency.
PATH, OMEGA_J, SOFTNESS = Symbol("path", real=True), Symbol("omega_j", positive=True), Symbol("y", positive=True)


@cache
def general_resonance(kind: str, order: int, *, damped: bool = True, tongue: int = 1) -> MultipleScales:
    """Return multiple scales at one kind of resonance between modes m and n of any number of modes."""
    damping = ZETA if damped else None
    return multiple_scales(OMEGA, P, _ABOUT[kind], order=order, damping=damping, coupling_slope=SLOPE, tongue=tongue)


def plain(expression: Expr) -> Expr:
    """Return an expression with its indexed quantities as symbols: ``omega[n]`` becomes ``omega_n``."""
    names = {}
    for base, assumptions in _ASSUMED:
        for entry in (e for e in expression.atoms(type(base[m])) if e.base == base):
            name = f"{base.label}_" + "".join(str(index) for index in entry.indices)
            names[entry] = Symbol(name, **assumptions)
    return expression.xreplace(names)


def _half_width(kind: str, damped: bool, tongue: int) -> tuple[Expr, tuple[Symbol, ...]]:
    """Return half the width of a zone, from the first order at which there is one."""
    border = general_resonance(kind, tongue, damped=damped, tongue=tongue).border
    assert border is not None
    return _in_order(kind, plain(border.half_width))


def _shift(kind: str, damped: bool, tongue: int) -> tuple[Expr, tuple[Symbol, ...]]:
    """Return the second-order shift of the zone."""
    border = general_resonance(kind, 2, damped=damped, tongue=tongue).border
    assert border is not None
    return _in_order(kind, plain(border.centre))


def _in_order(kind: str, expression: Expr) -> tuple[Expr, tuple[Symbol, ...]]:
    """Return an expression and the arguments of the kernels of its kind."""
    labels = "n" if kind == "principal" else "mn"
    names = [f"omega_{i}" for i in labels]
    names += [f"P_{i}{k}" for i in labels for k in labels] + [f"dP_{i}{k}" for i in labels for k in labels]
    names += [f"S_{i}" for i in labels]
    names += [f"W_{i}{k}" for i in labels for k in labels if kind == "principal" or i != k]
    names += ["epsilon", *(f"c_{i}" for i in labels)]
    known = {s.name: s for s in expression.free_symbols}
    return expression, tuple(known.get(name, Symbol(name, real=True)) for name in names)


def _sums(kind: str, tongue: int) -> tuple[dict[str, dict[str, Expr]], tuple[Symbol, ...]]:
    """Return each sum over modes: the contributions of resonant and spectator modes, and the tail of the latter.

    ``tail`` and ``tail_2`` are the coefficients of path / omega_j^2 and path / omega_j^4 for a fast spectator.
    """
    labels = "n" if kind == "principal" else "mn"
    expressions = {}
    for s in general_resonance(kind, 2, damped=False, tongue=tongue).sums:
        row, target = ({"m": m, "n": n}[s.symbol.name[k]] for k in (2, -1))
        share = plain(s.spectator.xreplace({P[row, j]: PATH, P[j, target]: S.One}))
        far = series(share.subs(OMEGA_J**2, 1 / SOFTNESS), SOFTNESS, 0, 3)
        expressions[s.symbol.name] = {
            "resonant": plain(s.resonant),
            "spectator": share,
            "tail": expand(far.coeff(SOFTNESS, 1) / PATH),
            "tail_2": expand(far.coeff(SOFTNESS, 2) / PATH),
        }
    names = [*(f"omega_{i}" for i in labels), *(f"P_{i}{k}" for i in labels for k in labels)]
    known = {s.name: s for table in expressions.values() for e in table.values() for s in e.free_symbols}
    return expressions, (*(known.get(name, Symbol(name, real=True)) for name in names), OMEGA_J, PATH)


def forced_growth() -> tuple[Expr, tuple[Symbol, ...]]:
    """Return the growth rate of the tip amplitude at resonance n by a transverse base motion of unit epsilon."""
    response = forced_resonance().response
    assert response is not None
    omega, gamma, mass, w_1 = (symbol(name) for name in ("omega_n", "Gamma_n", "M_n", "w_1"))
    tip = Symbol("phi_L", real=True)
    return plain(response.growth) / EPSILON * abs(tip), (omega, gamma, tip, mass, w_1)


@cache
def forced_resonance() -> MultipleScales:
    """Return multiple scales for a mode M_n (q'' + omega_n^2 q) = -Gamma_n w'' with base motion at resonance n.

    The base moves by w = epsilon w_1 sin(varpi t), so that its acceleration is -epsilon w_1 varpi^2 sin(varpi t); with
    sin = Re(-i exp(i varpi t)) and the excitation at the resonance the force is what follows.
    """
    t, varpi = symbol("t"), symbol("varpi")
    shaken = -symbol("Gamma_n") / symbol("M_n") * (symbol("w_1") * sin(varpi * t)).diff(t, 2)
    strength = (shaken / sin(varpi * t)).subs(varpi, OMEGA[n])
    return multiple_scales(OMEGA, None, n, forcing={n: -I * strength})


_KERNELS = {
    name: made
    for kind in _ABOUT
    for tongue in (1, 2)
    for name, made in (
        (f"half_width_{kind}_{tongue}", partial(_half_width, kind, False, tongue)),
        (f"damped_half_width_{kind}_{tongue}", partial(_half_width, kind, True, tongue)),
        (f"shift_{kind}_{tongue}", partial(_shift, kind, False, tongue)),
        (f"damped_shift_{kind}_{tongue}", partial(_shift, kind, True, tongue)),
        (f"sums_{kind}_{tongue}", partial(_sums, kind, tongue)),
    )
}


def __getattr__(name: str) -> Any:
    if name in _KERNELS:
        return _KERNELS[name]
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
