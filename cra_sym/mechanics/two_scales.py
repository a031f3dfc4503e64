"""The expansion: right-hand sides order by order, their secular terms, and the solvability conditions."""

from __future__ import annotations

from dataclasses import dataclass

from sympy import (
    And,
    Expr,
    Integer,
    Ne,
    Piecewise,
    Poly,
    Rational,
    S,
    Sum,
    Symbol,
    collect,
    conjugate,
    expand,
    factor,
    symbols,
)

from cra_sym.mechanics.harmonics import Harmonics, Vector, frequency_of
from cra_sym.mechanics.parametric import Label, ParametricResonance, ParametricSystem

__all__ = [
    "D0",
    "D1",
    "D2",
    "EPSILON",
    "SIGMA",
    "ModeSum",
    "TwoScaleExpansion",
    "amplitude",
    "conjugate_amplitude",
    "derivatives",
]

EPSILON = Symbol("epsilon", positive=True)
SIGMA = Symbol("sigma", real=True)
D0, D1, D2 = symbols("D_0 D_1 D_2")

Rates = dict[Symbol, Harmonics]
Fields = dict[Label, Harmonics]


def amplitude(i: Label) -> Symbol:
    """Return the complex amplitude of mode i."""
    return Symbol(f"A_{i}")


def conjugate_amplitude(i: Label) -> Symbol:
    """Return the complex conjugate of mode i's amplitude."""
    return Symbol(f"Abar_{i}")


def derivatives(power: int) -> tuple[Expr, Expr, Expr]:
    """Return the coefficients of 1, epsilon, epsilon^2 in ``(D0 + epsilon D1 + epsilon^2 D2)^power``."""
    expanded = Poly((D0 + EPSILON * D1 + EPSILON**2 * D2) ** power, EPSILON)
    return tuple(expanded.coeff_monomial(EPSILON**k) for k in range(3))


@dataclass(frozen=True)
class ModeSum:
    """Feedback of the response of all modes at the combination frequencies into one amplitude equation.

    Attributes
    ----------
    symbol : Symbol
        Symbol of the sum in the amplitude equations and in the boundary.
    row : Label
        Mode whose equation it enters.
    onto : Symbol
        Amplitude it multiplies.
    resonant : Expr
        Contribution of the resonant modes; of all modes when they are written out.
    spectator : Expr
        Contribution of one non-resonant mode ``index``, when the number of modes is symbolic.
    total : Expr
        The whole sum.
    """

    symbol: Symbol
    row: Label
    onto: Symbol
    resonant: Expr
    spectator: Expr
    index: Symbol | None
    total: Expr


class TwoScaleExpansion:
    """Expansion in two or three time scales, order by order.

    Parameters
    ----------
    system, resonance
        The system to expand, and the resonance.
    order : {1, 2}
        Highest power of epsilon in the amplitude equations.

    Attributes
    ----------
    receptances : dict
        Short symbols of 1 / (omega_i^2 - nu^2), in which the solution of order 1 is expressed.
    fields : list of dict
        The solution at each order, mode by mode.
    right_sides, secular : list of dict
        Right-hand side of each order from the first on, and its part at the mode's own frequency (which must vanish).
    rates : list of dict
        Derivative of each complex amplitude with respect to T_1, T_2.
    sums : tuple of ModeSum
        The sums over all modes that enter at second order.
    """

    def __init__(self, system: ParametricSystem, resonance: ParametricResonance, order: int) -> None:
        self.system, self.resonance, self.order = system, resonance, order
        self.zero: Vector = tuple(S.Zero for _ in system.rows)
        self.scale = resonance.tongue  # the slow time on which detuning and damping act
        self.excitation = self._excitation()
        self.fields: list[Fields] = [{i: self.free(i) for i in system.rows}]
        self.right_sides: list[Fields] = []
        self.secular: list[Fields] = []
        self.rates: list[Rates] = []
        self.sums: tuple[ModeSum, ...] = ()
        self.receptances: dict[Symbol, Expr] = {}
        self._step(1)
        if order == 2:
            self._keep_resonant_modes()
            self.fields.append({i: self._particular(i) for i in system.rows})
            self._step(2)

    # the pieces ---------------------------------------------------------------------------------------------------

    def unit(self, i: Label, sign: int = 1) -> Vector:
        """Return the vector of plus or minus mode i's natural frequency."""
        return tuple(Integer(sign) if row == i else S.Zero for row in self.system.rows)

    def decay(self, i: Label) -> Expr:
        """Return the symbol of mode i's decay rate c_i = zeta_i omega_i, or zero without damping."""
        return S.Zero if self.system.zeta(i) == 0 else Symbol(f"c_{i}", positive=True)

    @property
    def decays(self) -> dict[Symbol, Expr]:
        """The decay rates that occur, in terms of damping ratios."""
        modes = [i for i in self.resonance.modes if self.decay(i) != 0]
        return {self.decay(i): self.system.zeta(i) * self.system.omega(i) for i in modes}

    def free(self, i: Label) -> Harmonics:
        """Return the general solution at order 0: a free vibration with a slowly varying complex amplitude."""
        return Harmonics({(self.unit(i), S.Zero): amplitude(i), (self.unit(i, -1), S.Zero): conjugate_amplitude(i)})

    def _excitation(self) -> Harmonics:
        """Return cos(varpi t) at the detuned frequency, in exponentials."""
        r = self.resonance
        v = tuple(r.combine(a, b) for a, b in zip(self.unit(r.first), self.unit(r.second), strict=True))
        half = Rational(1, 2)
        return Harmonics({(v, S.One): half, (tuple(-a for a in v), -S.One): half})

    def _differentiate(self, operator: Expr, field: Harmonics) -> Harmonics:
        """Apply a polynomial in D0, D1, D2."""
        parts = []
        for powers, c in Poly(operator, D0, D1, D2).terms():
            part = field * c
            for _ in range(powers[0]):
                part = part.fast(self.system.omegas)
            for k, times in enumerate(powers[1:], start=1):
                for _ in range(times):
                    part = part.slow(self.rates[k - 1], SIGMA if k == self.scale else None)
            parts.append(part)
        return Harmonics.total(parts)

    # one order ----------------------------------------------------------------------------------------------------

    def _step(self, k: int) -> None:
        """Form the right-hand side of order k and solve its secular part for the rates of the amplitudes."""
        rows = self.system.rows if k == 1 else self.resonance.modes
        unknown = {a: Symbol(f"D{k}_{a}") for i in rows for a in (amplitude(i), conjugate_amplitude(i))}
        self.rates.append({a: Harmonics({(self.zero, S.Zero): d}) for a, d in unknown.items()})
        right = {i: self._right_side(i, k) for i in rows}
        self.right_sides.append(right)
        self.secular.append({i: right[i].part(self.unit(i)) for i in rows})
        for i in rows:
            for a, vector in ((amplitude(i), self.unit(i)), (conjugate_amplitude(i), self.unit(i, -1))):
                self.rates[-1][a] = _solved(right[i].part(vector), unknown[a])

    def _right_side(self, i: Label, k: int) -> Harmonics:
        """Return the right-hand side for mode i at order k: minus all terms but D0^2 q_ik + omega_i^2 q_ik."""
        system, once, twice = self.system, derivatives(1), derivatives(2)
        parts = [self._differentiate(-twice[k - l], self.fields[l][i]) for l in range(k)]
        damping = -2 * self.decay(i) / EPSILON**self.scale  # the decay rate is taken to be of that order
        for l in range(k - self.scale + 1 if damping != 0 else 0):
            parts.append(self._differentiate(once[k - self.scale - l], self.fields[l][i]) * damping)
        parts.append(self._coupled(i, k))
        if k == 1:
            force = system.force(i) / 2
            parts.append(self.excitation.map(lambda v, c: 2 * c * (force if v == self._forward else conjugate(force))))
            cube = self.fields[0][i] * self.fields[0][i] * self.fields[0][i] if system.gamma(i) != 0 else Harmonics({})
            parts.append(cube * -system.gamma(i))
        return Harmonics.total(parts)

    @property
    def _forward(self) -> Vector:
        return next(v for v, p in self.excitation.terms if p == 1)

    def _coupled(self, i: Label, k: int) -> Harmonics:
        """Return -cos(varpi t) sum_k P_ik q_k; at second order as sums over the modes, each with a symbol."""
        system, fields = self.system, self.fields[k - 1]
        shares = {j: self.excitation * fields[j] * -system.p(i, j) for j in system.rows if system.p(i, j) != 0}
        if k == 1:
            return Harmonics.total(shares.values())
        slopes = [self.excitation * self.fields[0][j] * (-SIGMA * system.slope(i, j)) for j in self.resonance.modes]
        # The contribution of the detuning in P(varpi_0 + epsilon sigma); for the second tongue it is of third order.
        parts = slopes if self.scale == 1 else []
        for sign in (1, -1):
            parts += self._summed(i, sign, shares)
        return Harmonics.total(parts)

    def _summed(self, i: Label, sign: int, shares: Fields) -> list[Harmonics]:
        """Define symbols for the sums over modes at the frequency of mode i."""
        vector = self.unit(i, sign)
        parts = {j: share.part(vector) for j, share in shares.items()}
        found = []
        for key in sorted({key for part in parts.values() for key in part.terms}, key=str):
            coefficients = {j: part.terms.get(key, S.Zero) for j, part in parts.items()}
            for mode in self.resonance.modes:
                for a in (amplitude(mode), conjugate_amplitude(mode)):
                    terms = {j: c.diff(a) for j, c in coefficients.items() if c.has(a)}
                    if terms:
                        symbol = Symbol(f"S_{i}" if key[1] == 0 else f"W_{i}{mode}", real=True)
                        found.append(Harmonics({(self.zero, key[1]): symbol * a}))
                        if sign == 1:
                            self.sums = (*self.sums, self._mode_sum(symbol, i, a, terms))
        return [Harmonics({(vector, p): c for (_, p), c in part.terms.items()}) for part in found]

    def _mode_sum(self, symbol: Symbol, i: Label, onto: Symbol, terms: dict[Label, Expr]) -> ModeSum:
        terms = {j: collect(c, list(self.receptances)).xreplace(self.receptances) for j, c in terms.items()}
        index = self.system.spectator
        spectator = S.Zero if index is None else terms.pop(index, S.Zero)
        resonant, others = sum(terms.values(), S.Zero), S.Zero
        if spectator != 0:
            elsewhere = And(*(Ne(index, mode) for mode in self.resonance.modes))
            others = Sum(Piecewise((spectator, elsewhere), (S.Zero, True)), (index, 1, self.system.size))
        return ModeSum(symbol, i, onto, resonant, spectator, index, resonant + others)

    def _keep_resonant_modes(self) -> None:
        """Omit the free vibration of non-resonant modes, whose amplitudes only decay."""
        for i in self.system.rows:
            if i not in self.resonance.modes:
                self.fields[0][i] = Harmonics({})

    def _particular(self, i: Label) -> Harmonics:
        """Return the bounded solution of order 1 for mode i, without a new free vibration."""
        own, omegas = self.system.omega(i), self.system.omegas
        gone = {amplitude(j): 0 for j in self.system.rows if j not in self.resonance.modes}
        gone |= {conjugate_amplitude(j): 0 for j in self.system.rows if j not in self.resonance.modes}

        def divide(vector: Vector, c: Expr) -> Expr:
            gap = own**2 - frequency_of(vector, omegas) ** 2
            if gap == 0:
                raise ValueError(f"mode {i} is in internal resonance: omega_{i} = {own} is a combination of the others")
            short = Symbol(f"h_{len(self.receptances)}")
            self.receptances[short] = 1 / (factor(gap) if i in self.resonance.modes else gap)
            return c * short

        driven = self.right_sides[0][i].map(lambda v, c: c.subs(gone)).without(self.unit(i), self.unit(i, -1))
        return Harmonics({key: c for key, c in driven.terms.items() if c != 0}).map(divide)


def _solved(secular: Harmonics, unknown: Symbol) -> Harmonics:
    """Solve a secular part, linear in one unknown derivative, for it."""
    factor = sum((c.coeff(unknown) for c in secular.terms.values()), S.Zero)
    rest = secular.map(lambda v, c: expand(c.subs(unknown, 0)))
    return rest.map(lambda v, c: expand(-c / factor))
