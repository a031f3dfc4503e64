"""The method of multiple scales for parametrically excited systems of many modes, to second order."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from sympy import Eq, Expr, Symbol, latex

from cra_sym.mechanics.parametric import ParametricResonance, ParametricSystem
from cra_sym.mechanics.scales_steps import derivation
from cra_sym.mechanics.stability_condition import Border, border
from cra_sym.mechanics.steady_response import SteadyResponse, steady_response
from cra_sym.mechanics.steps import Step, Steps
from cra_sym.mechanics.two_scales import ModeSum, TwoScaleExpansion

__all__ = ["MultipleScales", "multiple_scales"]

#: Angular frequency of the excitation.
VARPI = Symbol("varpi", positive=True)


@dataclass(frozen=True, repr=False)
class MultipleScales:
    """Result of the method of multiple scales for one resonance.

    Attributes
    ----------
    system, resonance, order
        The expanded system, the resonance, and the power of epsilon.
    steps : tuple of Step
        The derivation.
    amplitude_equations : tuple of Eq
        Slow evolution of the complex amplitudes of the modes that take part.
    sums : tuple of ModeSum
        The sums over all modes, each with the symbol that stands for it (second order only).
    decays : dict
        Decay rate c_i of each mode that takes part, in terms of its damping ratio.
    border : Border or None
        Boundary of growth; None for a forced resonance.
    response : SteadyResponse or None
        Steady response of a forced resonance, or of a principal one with a cubic term.
    """

    system: ParametricSystem
    resonance: ParametricResonance
    order: int
    steps: Steps
    amplitude_equations: tuple[Eq, ...]
    sums: tuple[ModeSum, ...]
    decays: dict[Symbol, Expr]
    border: Border | None
    response: SteadyResponse | None

    def __repr__(self) -> str:
        at = self.resonance
        modes = {0: f"{at.first}", 1: f"({at.first}, {at.second})", -1: f"({at.first}, -{at.second})"}[at.sign]
        tongue = f", tongue {at.tongue}" if at.tongue > 1 else ""
        return f"Multiple scales of order {self.order} at the {at.kind} resonance {modes}{tongue}"

    @property
    def exact_resonance(self) -> Expr:
        """Excitation frequency at the exact resonance."""
        r = self.resonance
        return r.combine(self.system.omega(r.first), self.system.omega(r.second))

    @property
    def boundary(self) -> tuple[Expr, Expr]:
        """The excitation frequencies between which the amplitudes grow, in short symbols; see :meth:`explicit`."""
        if self.border is None:
            raise ValueError("a forced resonance has no stability boundary")
        centre = self.exact_resonance + self.border.centre
        return centre - self.border.half_width, centre + self.border.half_width

    def explicit(self, expression: Expr) -> Expr:
        """Return an expression with the decay rates and the sums over modes written out."""
        return expression.subs({s.symbol: s.total for s in self.sums}).subs(self.decays)

    def step(self, name: str) -> Step:
        """Return the step of that name."""
        return self.steps.step(name)

    def _repr_latex_(self) -> str:
        if self.border is None:
            shown = self.amplitude_equations
        else:
            shown = tuple(Eq(VARPI, side) for side in self.boundary)
        return r"$\displaystyle \begin{gathered}" + r" \\ ".join(latex(e) for e in shown) + r"\end{gathered}$"


def multiple_scales(
    frequencies: Any,
    coupling: Any = None,
    resonance: Any = (1, 1),
    *,
    order: int = 1,
    damping: Any = None,
    forcing: Any = None,
    cubic: Any = None,
    coupling_slope: Any = None,
    size: Any = None,
    tongue: int = 1,
) -> MultipleScales:
    r"""Expand :math:`\ddot q + 2Z\Omega\dot q + (\Omega^2 + \epsilon\cos(\varpi t)P)\,q = \epsilon f` at a resonance.

    Harmonics are identified by their integer combinations of natural frequencies, so the frequencies may be unrelated
    symbols. All symbols are real, except the complex amplitudes of forces.

    Parameters
    ----------
    frequencies : sequence or IndexedBase
        omega_i. With an IndexedBase the number of modes is symbolic, and the other arguments are IndexedBase too.
    coupling : Matrix or IndexedBase, optional
        P, symmetric or not, at the exact resonance.
    resonance : tuple or label
        ``(n, n)`` principal, ``(m, n)`` sum, ``(m, -n)`` difference, ``n`` forced; modes are counted from 1.
    order : {1, 2}
        Order in epsilon of the amplitude equations.
    damping : sequence, dict or IndexedBase, optional
        Damping ratios zeta_i, taken to be of the order of the detuning.
    forcing : sequence, dict or IndexedBase, optional
        Complex amplitudes F_i: the force on mode i is ``epsilon Re(F_i exp(i varpi t))``.
    cubic : sequence, dict or IndexedBase, optional
        gamma_i of a weak term ``epsilon gamma_i q_i^3``; first order only.
    coupling_slope : Matrix or IndexedBase, optional
        dP/dvarpi at the exact resonance, when P depends on the excitation frequency.
    size : Expr, optional
        Number of modes when it is symbolic; N by default.
    tongue : {1, 2}
        2: expansion about half the excitation frequency, where instability appears at second order only.

    Returns
    -------
    MultipleScales

    Raises
    ------
    TypeError, ValueError
        If the pieces do not fit together, or a mode not named is in internal resonance at second order.

    Examples
    --------
    >>> from sympy import Matrix, symbols
    >>> omega, p = symbols("omega p", positive=True)
    >>> multiple_scales([omega], Matrix([[p]]), (1, 1)).boundary
    (-epsilon*p/(2*omega) + 2*omega, epsilon*p/(2*omega) + 2*omega)
    """
    if order not in (1, 2):
        raise ValueError(f"order = {order!r}: must be 1 or 2")
    about = ParametricResonance.of(resonance, tongue)
    if order < about.tongue:
        raise ValueError(f"order = {order}: the second tongue appears at order 2")
    if order == 2 and (cubic is not None or about.sign == 0):
        raise ValueError("order = 2: must be 1 for a forced resonance or with a cubic term")
    system = ParametricSystem.of(
        about,
        frequencies,
        coupling,
        damping=damping,
        forcing=forcing,
        cubic=cubic,
        coupling_slope=coupling_slope,
        size=size,
    )
    expansion = TwoScaleExpansion(system, about, order)
    edge = border(expansion) if about.sign else None
    single = about.sign == 0 or (about.kind == "principal" and cubic is not None)
    response = steady_response(expansion) if single else None
    steps = derivation(expansion, edge, response)
    equations = next(step.expression for step in steps if step.name == "amplitude equations")
    return MultipleScales(system, about, order, steps, equations, expansion.sums, expansion.decays, edge, response)
