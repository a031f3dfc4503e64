r"""Multiple scales of nonlinear modal equations: the slow flow of the amplitudes at a resonance.

The modal equations have the Lagrangian

.. math:: L = \sum_n \tfrac12(\dot q_n^2 - \omega_n^2 q_n^2) + \sum T[q, \ldots, \dot q, \ldots]

and, in addition, damping :math:`2c_n\dot q_n`, a parametric stiffness :math:`P_{mn}\cos\varpi t`, and forces
:math:`f_n\cos\varpi t`. Solutions are expanded in the amplitude; damping, detuning and excitation are of the order of
the leading nonlinear terms in the amplitude equations.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from sympy import Eq, Expr, Function, I, S, Symbol, conjugate, exp, expand, latex
from sympy.core.function import AppliedUndef

from cra_sym.mechanics.amplitude_expansion import SIGMA, TIME, AmplitudeExpansion, Coefficient, Series, Vector
from cra_sym.mechanics.steps import Step

__all__ = ["SlowFlow", "slow_flow"]


@dataclass(frozen=True)
class SlowFlow:
    r"""Slow evolution of the complex amplitudes, :math:`q_n = A_n e^{i\omega_n t} + c.c. + \ldots`

    Attributes
    ----------
    resonance : Any
        As requested.
    detuning : Eq or None
        Definition of sigma.
    amplitude_equations : tuple of Eq
        dA_n/dt of every mode that takes part.
    backbone : Expr or None
        For one mode: change of its frequency per squared real amplitude a = 2 abs(A); of second order a
        polynomial in a.
    response : Eq or None
        For one excited mode: equation of the real amplitude a of steady vibration.
    coefficients : tuple of Coefficient
        The symbols of the tensors that occur.
    steps : tuple of Step
    """

    resonance: Any
    detuning: Eq | None
    amplitude_equations: tuple[Eq, ...]
    backbone: Expr | None
    response: Eq | None
    coefficients: tuple[Coefficient, ...]
    steps: tuple[Step, ...]

    def _repr_latex_(self) -> str:
        lines = r" \\ ".join(map(latex, self.amplitude_equations))
        return rf"$\displaystyle \begin{{gathered}}{lines}\end{{gathered}}$"


def slow_flow(resonance: Any, coefficients: Sequence[Coefficient], modes: int) -> SlowFlow:
    """Return the slow flow of modal equations with given nonlinear coefficients; see `cra_sym.Model.slow_flow`.

    Raises
    ------
    ValueError
        If the resonance is not valid.
    """
    expansion = AmplitudeExpansion(resonance, modes, coefficients)
    first = expansion.first()
    forces = expansion.nonlinear(first)
    secular, power = expansion.secular(forces, 2), 2
    second: list[Series] | None = None
    if not any(value != 0 for value in secular.values()):
        second, power = expansion.second(forces), 3
        both = [one | two for one, two in zip(first, second, strict=True)]
        secular = expansion.secular(expansion.nonlinear(both), 3)
    flows = {n: expand(part + expansion.excited(n)) / (2 * I * expansion.omega[n]) for n, part in secular.items()}
    return _result(resonance, expansion, flows, power, first, second, secular)


def _result(
    resonance: Any,
    expansion: AmplitudeExpansion,
    flows: Mapping[int, Expr],
    power: int,
    first: list[Series],
    second: list[Series] | None,
    secular: Mapping[int, Expr],
) -> SlowFlow:
    functions = {n: Function(f"A_{n + 1}")(TIME) for n in flows}
    named: dict[Symbol, Expr] = {expansion.amplitude[n]: f for n, f in functions.items()}
    named |= {expansion.conjugate[n]: conjugate(f) for n, f in functions.items()}

    def in_functions(expression: Expr) -> Expr:
        return expand(expression).xreplace(named)

    equations = tuple(Eq(f.diff(TIME), in_functions(flows[n])) for n, f in functions.items())
    relation = expansion.resonance.relation
    detuning = None
    if relation is not None:
        gap = sum((k * w for k, w in zip(relation, expansion.frequencies, strict=True)), S.Zero)
        detuning = Eq(SIGMA, gap)
    backbone, response = _alone(expansion, flows)
    steps = _steps(expansion, in_functions, functions, first, second, secular, equations, detuning, power)
    used = {s for e in equations for s in e.free_symbols}
    occurring = tuple(c for c in expansion.coefficients if c.symbol in used)
    return SlowFlow(resonance, detuning, equations, backbone, response, occurring, steps)


def _alone(expansion: AmplitudeExpansion, flows: Mapping[int, Expr]) -> tuple[Expr | None, Eq | None]:
    """Return backbone and steady response of a resonance of one mode."""
    if len(flows) > 1:
        return None, None
    ((n, flow),) = flows.items()
    a, size = Symbol("a", positive=True), expansion.amplitude[n]
    terms = expand(flow.xreplace({size: a / 2, expansion.conjugate[n]: a / 2})).as_ordered_terms()
    own = expand(sum((term for term in terms if not term.has(SIGMA)), S.Zero) / (a / 2))
    driven = sum((term for term in terms if term.has(SIGMA)), S.Zero).subs(TIME, 0)
    shrinking, turning = own.coeff(a, 2).as_real_imag()
    decay, drift = own.coeff(a, 0).as_real_imag()
    backbone = expand(turning)
    relation = expansion.resonance.relation
    if relation is None or driven == 0:
        return backbone, None
    # A = a/2 exp(i (sigma t/s + psi)): all terms have the same phase velocity, and the moduli of both parts are equal
    slow = SIGMA / -relation[n]
    left = ((decay + shrinking * a**2) ** 2 + (backbone * a**2 + drift - slow) ** 2) * a**2 / 4
    return backbone, Eq(left, expand(driven * conjugate(driven)))


def _steps(
    expansion: AmplitudeExpansion,
    in_functions: Any,
    functions: Mapping[int, AppliedUndef],
    first: list[Series],
    second: list[Series] | None,
    secular: Mapping[int, Expr],
    equations: tuple[Eq, ...],
    detuning: Eq | None,
    power: int,
) -> tuple[Step, ...]:
    def wave(h: Vector) -> Expr:
        value = sum((k * w for k, w in zip(h, expansion.frequencies, strict=True)), S.Zero)
        return exp(I * value * TIME)

    def written(series: Series, order: int) -> Expr:
        return sum((in_functions(value) * wave(h) for (p, h), value in series.items() if p == order), S.Zero)

    steps = []
    statements = [
        (
            "first order",
            "Free vibration of the modes that take part, with amplitudes that change slowly.",
            tuple(Eq(Symbol(f"q_{n + 1}"), written(s, 1), evaluate=False) for n, s in enumerate(first) if s),
        )
    ]
    if detuning is not None:
        statements.append(("detuning", "How far the frequencies are from the exact resonance.", detuning))
    if second is not None and any(second):
        statements.append(
            (
                "second order",
                "What quadratic terms add; no force is resonant there.",
                tuple(Eq(Symbol(f"q_{n + 1}"), written(s, 2), evaluate=False) for n, s in enumerate(second) if s),
            )
        )
    statements += [
        (
            "secular terms",
            f"The resonant forces of order {power} in the amplitude.",
            tuple(Eq(Symbol(f"S_{n + 1}"), in_functions(part), evaluate=False) for n, part in secular.items()),
        ),
        ("amplitude equations", "The amplitudes change so that no term grows.", equations),
    ]
    before: tuple[str, ...] = ()
    for name, statement, expression in statements:
        steps.append(Step(name, statement, expression, before, "integration in time of the modal equations"))
        before = (name,)
    return tuple(steps)
