"""Exported expressions of the arm: the derivations of the package's own kernels, with their arguments in rows."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache
from typing import Any

import sympy as sp

from cra_sym.codegen.arm_family import arm_family
from cra_sym.codegen.complex_parts import complex_parts
from cra_sym.codegen.program import DerivedFunction, function, scalars
from cra_sym.mechanics import multiple_scales, one_wave, one_wave_rows, one_wave_shapes
from cra_sym.model import oscillator
from cra_sym.symbols import symbol

__all__ = ["gauss_rule", "modal_functions", "response_functions", "spectrum_functions", "stability_functions"]

_BASIS = ("basis_row", one_wave.BASIS[2])
_KRYLOV = ("krylov", one_wave_shapes.KRYLOV)
_WAVES = ("waves", one_wave_shapes.WAVES)
_CIRCLE = sp.symbols("cos_lambda sin_lambda decay", real=True)


def _row(prefix: str, arguments: Sequence[sp.Symbol]) -> tuple[str, list[sp.Symbol]]:
    """Return the arguments k0, k1, ... as one row."""
    return prefix, [s for s in arguments if s.name[:1] == prefix and s.name[1:].isdigit()]


def _pairs() -> Any:
    return "pairs", one_wave.parameters(arm_family().structure)


def _make(summary: str, derivation: Any, *arguments: Any, of: Any = ()) -> DerivedFunction:
    expression, names = derivation(*of)
    given = {s for _, symbols in arguments for s in ((symbols,) if isinstance(symbols, sp.Symbol) else symbols)}
    rest = [s for s in names if s not in given]
    signature = [*arguments, *scalars(rest)]
    first = {s: i for i, s in enumerate(names)}
    signature.sort(key=lambda pair: min(_first(pair[1], first)))
    return function(derivation.__name__, summary, expression, signature)


def _first(symbols: Any, order: dict[sp.Symbol, int]) -> list[int]:
    members = (symbols,) if isinstance(symbols, sp.Symbol) else symbols
    return [order[s] for s in members if s in order]


@cache
def spectrum_functions() -> tuple[DerivedFunction, ...]:
    """Return the functions for the complete frequencies of the arm."""
    arm, pairs = (arm_family().structure,), _pairs()
    k = _row("k", one_wave.derivatives(*arm)[1])
    return (
        _make("Coefficients of the characteristic determinant.", one_wave.coefficients, pairs, of=arm),
        _make("Coefficients of its power series in z.", one_wave.power_series, k, of=arm),
        _make("Basis of the determinant at lambda, scaled by exp(-lambda).", _basis, ("circle", _CIRCLE)),
        _make("The same basis for small z, not scaled.", one_wave.basis_near, of=(2,)),
        _make("Determinants whose signs count the zeros below z.", one_wave.chain, pairs, _BASIS, of=arm),
        _make("Determinant D, z D' and z^2 D'', scaled alike.", one_wave.derivatives, k, _BASIS, of=arm),
    )


def _basis() -> Any:
    """Return the scaled basis as a polynomial in cos, sin and exp(-lambda), which the caller computes."""
    scaled, (lamda, decay) = one_wave.basis(2)
    c, s, e = _CIRCLE
    polynomials = [x.xreplace({sp.cos(lamda): c, sp.sin(lamda): s, decay: e}) for x in scaled]
    return polynomials, (lamda, *_CIRCLE)


_basis.__name__ = "basis"


@cache
def modal_functions() -> tuple[DerivedFunction, ...]:
    """Return the functions for mode shapes, modal quantities and responses."""
    circle = ("circle", one_wave_shapes.tip_far(2)[1][-3:])  # cos, sin and decay at lambda
    arm, pairs, shapes = (arm_family().structure,), _pairs(), one_wave_shapes
    return (
        _make("Solutions with one unit derivative at the root, for small z.", shapes.polynomials, of=(2,)),
        _make(
            "Tip conditions: entries in (alpha, beta) and their magnitudes.", shapes.tip_rows, pairs, _KRYLOV, of=arm
        ),
        _make("Shape and derivatives at the tip, for small z.", shapes.tip_near, pairs, _KRYLOV, of=arm),
        _make("alpha, beta and the wave amplitudes.", shapes.amplitudes_far, pairs, circle, of=arm),
        _make("Shape and derivatives at the tip from the wave amplitudes.", shapes.tip_far, _WAVES, circle, of=(2,)),
        _make("Shape and its three derivatives at xi from the wave amplitudes.", shapes.shape_far, _WAVES, of=(2,)),
        _make("Modal mass over rho A L, for z > 0.", _mass, pairs),
        _make("Momentum of a mode over rho A L, for z > 0.", _momentum, pairs),
        _make("Rigid-body motion, amplitudes, modal mass and momentum of a mode, z = 0.", _rigid_body, pairs),
        *response_functions(),
    )


def _mass() -> Any:
    """Return the modal mass in terms of the named inertias of the tip."""
    (mass,), arguments = _named(one_wave_rows.generalised_mass(arm_family().structure))
    return mass, arguments


def _momentum() -> Any:
    """Return the integral of a shape with the masses, which the forces of the ends give."""
    structure = arm_family().structure
    found, arguments = one_wave_rows.rows(structure)
    momentum = found[2 * len(structure[0])]
    return momentum, [x for x in arguments if x in momentum.free_symbols or x in one_wave.parameters(structure)]


def _rigid_body() -> Any:
    return _named(one_wave_rows.rigid_body(arm_family().structure))


def _named(derivation: Any) -> Any:
    """Return a derivation in terms of the named inertias of the tip."""
    expressions, arguments = derivation
    inertias = one_wave_rows.inertias(arm_family().structure)
    names = dict(zip(inertias.values(), map(symbol, ("mu", "iota")), strict=True))
    return tuple(e.xreplace(names) for e in expressions), [names.get(x, x) for x in arguments]


_mass.__name__, _momentum.__name__, _rigid_body.__name__ = "modal_mass", "momentum", "rigid_body"


@cache
def response_functions() -> tuple[DerivedFunction, ...]:
    """Return the closed forms of Duhamel's integral, in real numbers."""
    t, omega, zeta, varpi = (symbol(name) for name in ("t", "omega_i", "zeta_i", "varpi"))
    unit = oscillator.guarded_responses()
    times = [("t", t), ("omega", omega), ("zeta", zeta)]
    return (
        function("free_response", "Answers to unit displacement and to unit velocity.", unit[:2], times),
        function("mean_response", "Answers to a unit step and to a unit ramp.", unit[2:4], times),
        function(
            "harmonic_response",
            "Real and imaginary part of the answer to exp(i varpi t).",
            complex_parts(unit.harmonic),
            [*times, ("varpi", varpi)],
        ),
    )


@cache
def gauss_rule(points: int = 16) -> tuple[list[float], list[float]]:
    """Return nodes and weights of Gauss's rule on [0, 1], correctly rounded."""
    from sympy.integrals.quadrature import gauss_legendre

    nodes, weights = gauss_legendre(points, 30)
    return [float((1 + x) / 2) for x in nodes], [float(w / 2) for w in weights]


@cache
def stability_functions() -> tuple[DerivedFunction, ...]:
    """Return the first-order half-width of a zone of instability, from multiple scales."""
    omega, coupling, damping = (sp.IndexedBase(name, real=True) for name in ("omega", "P", "zeta"))
    m, n = (sp.Symbol(name, integer=True, positive=True) for name in "mn")
    made = []
    for kind, resonance in (("principal", (n, n)), ("sum", (m, n))):
        for damped in (False, True):
            border = multiple_scales(omega, coupling, resonance, order=1, damping=damping if damped else None).border
            assert border is not None
            width, arguments = _plain(border.half_width)
            name = f"{'damped_' if damped else ''}{kind}_width"
            summary = f"Half width of a {kind} resonance{', with damping c = zeta omega' if damped else ''}."
            made.append(function(name, summary, width, scalars(arguments)))
    return tuple(made)


def _plain(expression: sp.Expr) -> tuple[sp.Expr, list[sp.Symbol]]:
    """Return an expression with ``omega[n]`` as a symbol ``omega_n``, and its symbols by name."""
    names = {
        e: sp.Symbol(f"{e.base.label}_{''.join(map(str, e.indices))}", positive=e.base.label.name == "omega" or None)
        for e in expression.atoms(sp.Indexed)
    }
    renamed = expression.xreplace(names)
    return renamed, sorted(renamed.free_symbols, key=lambda s: s.name)
